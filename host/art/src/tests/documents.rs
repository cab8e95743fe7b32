//! What documents in PDF and PostScript say of themselves: their size, the names of their spots, their ground, their damage.

use super::*;

#[test]
fn an_eps_file_has_the_size_and_the_place_of_its_bounding_box() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let eps = |box_of: &str, x: i32, y: i32, end: &str| {
        format!(
            "%!PS-Adobe-3.0 EPSF-3.0\n{box_of}\n%%EndComments\n0 setgray {} {} 36 12 rectfill\n{end}",
            x + 12,
            y + 6
        )
    };
    let plain = eps("%%BoundingBox: -50 300 94 372", -50, 300, "showpage\n");
    // A preview for DOS lies behind the PostScript; the header says where either is.
    let (start, length) = (30u32.to_le_bytes(), (plain.len() as u32).to_le_bytes());
    let preview =
        [b"\xc5\xd0\xd3\xc6", &start[..], &length, &[0; 16], b"\xff\xff", plain.as_bytes(), &[7; 40]]
            .concat();
    let fine = eps("%%BoundingBox: 0 0 73 37\n%%HiResBoundingBox: 0.5 0.5 72.5 36.5", 0, 0, "showpage\n");
    for (name, bytes, size) in [
        ("plain.eps", plain.into_bytes(), (1200, 600)),
        ("far.eps", eps("%%BoundingBox: 5000 4000 5144 4072", 5000, 4000, "").into_bytes(), (1200, 600)),
        ("preview.eps", preview, (1200, 600)),
        ("fine.eps", fine.into_bytes(), (600, 300)),
    ] {
        let art = read(&[bench.write(name, bytes)], &Options::default());
        assert_eq!((art.width, art.length), size, "{name}");
        assert!(near(art.drawn.dots(), 300.0 * 100.0, 0.03), "{name}: {}", art.drawn.dots());
        let left = (0..art.width).find(|&x| (0..art.length).any(|y| bitplane::at(&art.drawn, x, y))).unwrap();
        // Of the finer box half a point is cut off at the left.
        assert!(left.abs_diff(if name == "fine.eps" { 96 } else { 100 }) <= 1, "{name}: {left}");
    }
}

/// A PDF with a bar for each spot, which is drawn 36 x 36 points from the left; names as PDF writes them.
fn spots(names: &[&[u8]]) -> Vec<u8> {
    let mut spaces = Vec::new();
    let mut drawing = Vec::new();
    for (at, name) in names.iter().enumerate() {
        spaces.extend(format!("/S{at} [/Separation /").bytes());
        spaces.extend_from_slice(name);
        spaces.extend(b" /DeviceCMYK << /FunctionType 2 /Domain [0 1] /C0 [0 0 0 0] /C1 [0 1 0 0] /N 1 >>] ");
        drawing.extend(format!("/S{at} cs 1 scn {} 0 36 36 re f\n", 36 * at).bytes());
    }
    let objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>".to_vec(),
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_vec(),
        [
            b"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 144 72] /Contents 4 0 R /Resources << /ColorSpace << ",
            &spaces[..],
            b">> >> >>",
        ]
        .concat(),
        [format!("<< /Length {} >>\nstream\n", drawing.len()).as_bytes(), &drawing, b"\nendstream"].concat(),
    ];
    let mut file = b"%PDF-1.4\n".to_vec();
    let mut table = "xref\n0 5\n0000000000 65535 f \n".to_owned();
    for (at, object) in objects.iter().enumerate() {
        table += &format!("{:010} 00000 n \n", file.len());
        file.extend([format!("{} 0 obj\n", at + 1).as_bytes(), object, b"\nendobj\n"].concat());
    }
    let end = format!("{table}trailer << /Size 5 /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", file.len());
    [file, end.into_bytes()].concat()
}

#[test]
fn spots_keep_their_plates_whatever_characters_their_names_have() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    // UTF-8, and Latin-1 as older programs write it.
    for (pdf, name) in [
        (&b"Stra#C3#9Fe"[..], "Stra\u{df}e"),
        (b"Stra#DFe", "Stra\u{df}e"),
        (b"PANTONE#20100#25", "PANTONE 100%"),
        (b"Red#2FOrange", "Red/Orange"),
        (b"a#28b#29c#2Etif", "a(b)c.tif"),
    ] {
        let file = bench.write("spots.pdf", spots(&[b"White#2FUnder", pdf]));
        let art = read(std::slice::from_ref(&file), &Options::default());
        assert_eq!(art.layers[0].ink, Ink::White, "{name}");
        assert_eq!(extent(&art.layers[0]).4, 300 * 300, "{name}");
        assert_eq!(dots_of(&art, Ink::Magenta), 300 * 300, "{name}");
        let note = format!("spot colour `{name}` names no ink: printed by its process colours");
        assert!(art.notes.iter().any(|said| said.ends_with(&note)), "{:?}", art.notes);
        assert!(!art.notes.iter().any(|said| said.contains("left out")), "{:?}", art.notes);
        // The queue's way.
        assert_eq!(spots_of(&file).unwrap(), [["White/Under"]], "{name}");
    }
}

#[test]
fn the_white_ground_of_a_page_is_no_colour_of_its_art() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let pages = |first: &str| {
        format!(
            "%!PS-Adobe-3.0\n/page {{ <</PageSize [144 72]>> setpagedevice 1 setgray 0 0 144 72 rectfill }} def\n\
             page {first} showpage\npage 1 1 0 setrgbcolor 24 12 48 48 rectfill showpage\n"
        )
    };
    let inks = vec![Ink::White, Ink::MetallicGold];
    let options = Options { pages: Pages::Inks(inks), ..Options::default() };
    let file = bench.write("pages.ps", pages("0.9 setgray 24 12 48 48 rectfill"));
    let art = read(&[file], &options);
    for layer in &art.layers {
        assert!(near(extent(layer).4, 400.0 * 400.0, 0.03), "{:?}", art.notes);
    }
    assert!(art.notes.iter().any(|note| note.contains("page 1: drawn in one colour and white")));
    // Several pale colours have no dot of their own, and that is an error.
    let pale = pages("0.9 setgray 24 12 24 48 rectfill 0.7 setgray 48 12 24 48 rectfill");
    let text = open(&[bench.write("pale.ps", pale)], &options, &Silent).unwrap_err().to_string();
    assert!(text.contains("page 1 has art, but white gets no dot of it"), "{text}");
}

#[test]
fn a_document_that_cannot_be_read_says_why() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let whole = spots(&[b"White"]);
    let lock = format!(
        "/Root 1 0 R /Encrypt << /Filter /Standard /V 1 /R 2 /O <{}> /U <{}> /P -4 >> /ID [<33> <33>] >>",
        "11".repeat(32),
        "22".repeat(32)
    );
    let locked = String::from_utf8(whole.clone()).unwrap().replace("/Root 1 0 R >>", &lock);
    for (name, bytes, why) in [
        ("stub.pdf", &b"%PDF-1.4\n"[..], "is damaged (Ghostscript says `"),
        ("cut.pdf", &whole[..whole.len() / 3], "is damaged (Ghostscript says `"),
        ("locked.pdf", locked.as_bytes(), "it is encrypted and needs a password"),
        ("none.ps", b"%!PS\n1 pop\n", "it has no page"),
    ] {
        let text = refused(&[bench.write(name, bytes)]);
        assert!(text.contains(why), "{name}: {text}");
    }
    let text = open(
        &[bench.write("whole.pdf", &whole)],
        &Options { pages: Pages::Number(9), ..Options::default() },
        &Silent,
    );
    assert!(text.unwrap_err().to_string().contains("there is no page 9; the file has "));
}
