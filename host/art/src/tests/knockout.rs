//! White and clear inks beneath and over other things of a page.

use std::io::Write as _;

use super::exports::pdf;
use super::*;
use crate::Above;

const WHITE: (&str, &str) = ("White", ".1 0 0 0");
const GOLD: (&str, &str) = ("Gold", "0 .2 .8 .2");
const FINISH: (&str, &str) = ("Finish", ".05 0 0 .05");

/// Dots of so many square points.
fn square(points: f64) -> f64 {
    points * (600.0 / 72.0) * (600.0 / 72.0)
}

fn assert_near(found: u64, points: f64) {
    assert!(near(found, square(points), 0.02), "{found}, not {}", square(points));
}

/// White on 120 x 60 points; black on 40 x 30, cyan on 30 x 30 and a hole of 10 x 10 of them.
const DRAWING: &str = "/S0 cs 1 scn 10 10 120 60 re f 0 0 0 1 k 30 20 40 30 re f \
    1 0 0 0 k 80 20 30 30 re f 0 0 0 0 k 115 20 10 10 re f";

#[test]
fn colours_that_knock_out_white_are_told_and_white_can_be_kept() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let file = bench.write("art.pdf", pdf(&[WHITE], DRAWING, ""));
    let art = read(std::slice::from_ref(&file), &Options::default());
    let [(Above::Colours, colours), (Above::Paper, holes)] = art.knocked_out[..] else {
        panic!("{:?}", art.knocked_out)
    };
    assert_near(colours, 2100.0);
    assert_near(holes, 100.0);
    assert_near(dots_of(&art, Ink::White), 5000.0);
    let kept = read(&[file], &Options { keep_white: true, ..Options::default() });
    assert_near(dots_of(&kept, Ink::White), 7100.0);
    assert_near(kept.white_kept, 2100.0);
    assert!(matches!(kept.knocked_out[..], [(Above::Paper, _)]), "{:?}", kept.knocked_out);
    // Art that overprints keeps it anyway.
    let over = DRAWING.replace("0 0 0 1 k", "/G gs 0 0 0 1 k").replace(" 0 0 0 0 k 115 20 10 10 re f", "");
    let over = pdf(&[WHITE], &over, "/ExtGState << /G << /OP true /op true /OPM 1 >> >>");
    assert_eq!(read(&[bench.write("over.pdf", over)], &Options::default()).knocked_out, []);
}

/// As guides to white ink say: white is set to overprint, and what follows is as it was.
#[test]
fn white_that_is_set_to_overprint_is_knocked_out_like_any_other() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let drawing = format!("/G gs {}", DRAWING.replace("0 0 0 1 k", "/H gs 0 0 0 1 k"));
    let states = "/ExtGState << /G << /OP true /op true >> /H << /OP false /op false >> >>";
    let art = read(&[bench.write("art.pdf", pdf(&[WHITE], &drawing, states))], &Options::default());
    assert_near(dots_of(&art, Ink::White), 5000.0);
    let [(Above::Colours, colours), (Above::Paper, _)] = art.knocked_out[..] else {
        panic!("{:?}", art.knocked_out)
    };
    assert_near(colours, 2100.0);
}

#[test]
fn finish_takes_nothing_away_and_metal_takes_white_unless_it_is_told_not_to() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let drawing = format!("{DRAWING} /S1 cs 1 scn 12 12 10 20 re f /S2 cs 1 scn 0 0 142 85 re f");
    let file = bench.write("art.pdf", pdf(&[WHITE, GOLD, FINISH], &drawing, ""));
    let art = read(std::slice::from_ref(&file), &Options::default());
    assert_near(dots_of(&art, Ink::White), 4800.0);
    assert_near(dots_of(&art, Ink::MetallicGold), 200.0);
    assert_near(dots_of(&art, Ink::Finish), 142.0 * 85.0);
    assert_near(dots_of(&art, Ink::Black), 1200.0);
    assert_near(dots_of(&art, Ink::Cyan), 900.0);
    let [(Above::Colours, _), (Above::Ink(Ink::MetallicGold), gold), (Above::Paper, _)] = art.knocked_out[..]
    else {
        panic!("{:?}", art.knocked_out)
    };
    assert_near(gold, 200.0);
    let over_white = inks::InkSet::of([Ink::MetallicGold]);
    let kept = read(&[file], &Options { over_white, ..Options::default() });
    assert_near(dots_of(&kept, Ink::White), 5000.0);
}

/// A page whose states and colours stand in a compressed stream, with a table of places in another.
fn packed(drawing: &str, states: &str) -> Vec<u8> {
    let space = "[/Separation /White /DeviceCMYK << /FunctionType 2 /Domain [0 1] /C0 [0 0 0 0] /C1 [.1 0 0 0] /N 1 >>]";
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".into(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 142 85] /Contents 4 0 R /Resources << /ColorSpace << /S0 {space} >> \
             {states} >> >>"
        ),
    ];
    let (mut head, mut body) = (String::new(), String::new());
    for (number, object) in (1..).zip(&objects) {
        head += &format!("{number} {} ", body.len());
        body += &format!("{object} ");
    }
    let mut zipped = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    zipped.write_all(format!("{head}{body}").as_bytes()).unwrap();
    let zipped = zipped.finish().unwrap();
    let mut file = b"%PDF-1.6\n".to_vec();
    let contents = file.len();
    file.extend(
        format!("4 0 obj << /Length {} >>\nstream\n{drawing}\nendstream endobj\n", drawing.len()).bytes(),
    );
    let stream = file.len();
    let about = format!("/N 3 /First {} /Filter /FlateDecode /Length {}", head.len(), zipped.len());
    file.extend(format!("5 0 obj << /Type /ObjStm {about} >>\nstream\n").bytes());
    file.extend(zipped);
    file.extend(b"\nendstream endobj\n");
    let table = file.len();
    let row = |kind: u8, at: usize, index: u8| [&[kind][..], &(at as u32).to_be_bytes(), &[index]].concat();
    let rows = [
        row(0, 0, 0),
        row(2, 5, 0),
        row(2, 5, 1),
        row(2, 5, 2),
        row(1, contents, 0),
        row(1, stream, 0),
        row(1, table, 0),
    ];
    let rows = rows.concat();
    let about = format!("/Size 7 /W [1 4 1] /Root 1 0 R /Length {}", rows.len());
    file.extend(format!("6 0 obj << /Type /XRef {about} >>\nstream\n").bytes());
    file.extend(rows);
    file.extend(format!("\nendstream endobj\nstartxref\n{table}\n%%EOF\n").bytes());
    file
}

#[test]
fn states_in_compressed_streams_are_found_and_bytes_before_the_document_do_not_matter() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let drawing = DRAWING.replace("0 0 0 1 k", "/H gs 0 0 0 1 k");
    let file = packed(&drawing, "/ExtGState << /H << /OP false /op false >> >>");
    for before in ["", "Content-Type: application/pdf\n\n"] {
        let file = [before.as_bytes(), &file].concat();
        let art = read(&[bench.write("art.pdf", file)], &Options::default());
        assert_near(dots_of(&art, Ink::White), 5000.0);
        let colours = art.knocked_out.iter().find(|(above, _)| *above == Above::Colours);
        assert_near(colours.map_or(0, |(_, dots)| *dots), 2100.0);
        assert!(!art.notes.iter().any(|note| note.contains("damaged")), "{:?}", art.notes);
    }
}
