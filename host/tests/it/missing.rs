//! Documents of which Ghostscript leaves something out: `layers` and the filter of queues draw them and tell of it alike.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::process::Output;

use testing::needs::ghostscript;
use testing::program::{Bench, text};

/// What stands in a document with a gradient by a function of two variables, as browsers write it: without a matrix.
const GRADIENT: &str = "/Pattern << /P5 << /Type /Pattern /PatternType 2 /Shading << /ShadingType 1 /ColorSpace /DeviceRGB \
    /Domain [0 288 0 432] /Function 5 0 R >> >> >>";

/// One page of 4 x 6 inches with these resources and content; object 5 is a function that is yellow everywhere.
fn document(resources: &str, content: &str) -> Vec<u8> {
    let stream =
        |start: &str, text: &str| format!("<< {start} /Length {} >> stream\n{text}\nendstream", text.len());
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".into(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 288 432] /Contents 4 0 R /Resources << {resources} >> >>"
        ),
        stream("", content),
        stream("/FunctionType 4 /Domain [0 288 0 432] /Range [0 1 0 1 0 1]", "{ pop pop 1 1 0 }"),
    ];
    let mut file = "%PDF-1.4\n".to_owned();
    let mut table = "xref\n0 6\n0000000000 65535 f \n".to_owned();
    for (at, object) in objects.iter().enumerate() {
        table += &format!("{:010} 00000 n \n", file.len());
        file += &format!("{} 0 obj\n{object}\nendobj\n", at + 1);
    }
    let end = format!("{table}trailer << /Size 6 /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", file.len());
    (file + &end).into_bytes()
}

/// Inks and dots of the passes of a job.
fn passes(job: &[u8]) -> Vec<(String, u64)> {
    let seen = press::inspect::inspect(job, &observe::Silent).inspection.passes;
    seen.into_iter().map(|pass| (pass.ink.to_string(), pass.dots)).collect()
}

/// The passes and the messages of a document through `layers` and through the filter, with this search path for programs.
fn both(document: &[u8], path: Option<&str>) -> [(Vec<(String, u64)>, String); 2] {
    let bench = Bench::new();
    let name = if document.starts_with(b"%PDF") { "page.pdf" } else { "page.ps" };
    fs::write(bench.path(name), document).unwrap();
    let run = |args: &str| {
        let mut command = bench.command(args);
        if let Some(script) = path {
            let folder = bench.path("bin");
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("gs"), script).unwrap();
            fs::set_permissions(folder.join("gs"), fs::Permissions::from_mode(0o755)).unwrap();
            let usual = std::env::var_os("PATH").unwrap_or_default();
            let all = std::iter::once(folder).chain(std::env::split_paths(&usual));
            command.env("PATH", std::env::join_paths(all).unwrap());
        }
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        output
    };
    let layers: Output = run(&format!("layers {name} --paper a4 -o page.print"));
    let job = fs::read(bench.path("page.print/job.rgl")).unwrap();
    let file = bench.path(name).display().to_string();
    let queued = run(&format!("cups-filter 1 me title 1 FoilpressPosition=Centre {file}"));
    [(passes(&job), text(&layers.stderr)), (passes(&queued.stdout), text(&queued.stderr))]
}

/// The dots of a square of so many points, if it is printed.
fn has(passes: &[(String, u64)], ink: &str, points: f64) -> bool {
    let wanted = (points * 600.0 / 72.0).powi(2);
    passes.iter().any(|(found, dots)| found == ink && (*dots as f64 / wanted - 1.0).abs() < 0.1)
}

const CONTENT: &str = "0 0 0 rg 102 102 36 36 re f /Pattern cs /P5 scn 150 150 72 72 re f";

#[test]
fn a_gradient_that_browsers_write_is_drawn_or_its_loss_is_told() {
    if !ghostscript() {
        return;
    }
    for (passes, said) in both(&document(GRADIENT, CONTENT), None) {
        assert!(has(&passes, "black", 36.0), "{passes:?}");
        assert_eq!(has(&passes, "yellow", 72.0), !said.contains("part of the document is missing"), "{said}");
    }
    // An ordinary page has no note.
    for (passes, said) in both(&document("", "1 1 0 rg 150 150 72 72 re f BT q ET Q"), None) {
        assert!(has(&passes, "yellow", 72.0), "{passes:?}");
        assert!(!said.contains("Ghostscript") && !said.contains("missing"), "{said}");
    }
}

/// As later versions do, which ignore the option, and as they say it.
#[test]
fn without_an_older_interpreter_the_loss_is_told() {
    if !ghostscript() {
        return;
    }
    let found = std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())
        .map(|folder| folder.join("gs"))
        .find(|file| file.is_file());
    let found = found.expect("Ghostscript is on the path").display().to_string();
    let script = format!(
        "#!/bin/sh\nfor a; do shift; [ \"$a\" = -dNEWPDF=false ] || set -- \"$@\" \"$a\"; done\nexec {found} \"$@\"\n"
    );
    for (passes, said) in both(&document(GRADIENT, CONTENT), Some(&script)) {
        assert!(has(&passes, "black", 36.0), "{passes:?}");
        assert_eq!(has(&passes, "yellow", 72.0), !said.contains("part of the document is missing"), "{said}");
        assert!(!said.contains("older interpreter"), "{said}");
        assert!(has(&passes, "yellow", 72.0) || said.contains("save the page as a picture (PNG)"), "{said}");
    }
}

#[test]
fn parts_that_a_document_names_but_does_not_have_are_told() {
    if !ghostscript() {
        return;
    }
    for (passes, said) in both(&document("", "0 0 0 rg 102 102 36 36 re f /Im9 Do"), None) {
        assert!(has(&passes, "black", 36.0), "{passes:?}");
        assert!(said.contains("the document is damaged (Ghostscript says `"), "{said}");
    }
}

/// Where a group is mixed in CMYK, K became white and cyan red.
#[test]
fn inks_in_a_transparency_group_of_cmyk_stay_what_they_are() {
    if !ghostscript() {
        return;
    }
    let marks = "0 0 0 1 k 102 102 36 36 re f 1 0 0 0 k 150 150 54 54 re f /s gs 0 1 1 0 k 30 330 72 72 re f";
    let resources = "/ExtGState << /s << /ca .5 >> >>";
    let page = String::from_utf8(document(resources, marks)).unwrap();
    let group = page.replace("/Contents", "/Group << /S /Transparency /CS /DeviceCMYK >> /Contents");
    for (passes, said) in both(group.as_bytes(), None) {
        assert!(has(&passes, "black", 36.0) && has(&passes, "cyan", 54.0), "{passes:?}, {said}");
    }
}

/// Newer versions write each further copy of a page in other colours.
#[test]
fn copies_that_a_document_asks_for_are_left_to_the_print_system() {
    if !ghostscript() {
        return;
    }
    for asks in ["/#copies 2 def", "<< /NumCopies 3 >> setpagedevice"] {
        let page = format!(
            "%!PS\n<< /PageSize [288 432] >> setpagedevice {asks} 0 setgray 102 102 36 36 rectfill showpage\n"
        );
        for (passes, said) in both(page.as_bytes(), None) {
            assert!(passes.len() == 1 && has(&passes, "black", 36.0), "{asks}: {passes:?}, {said}");
        }
    }
}

/// Ghostscript knows ten spot colours of a document unless it is told of more.
#[test]
fn a_document_with_many_spot_colours_keeps_its_layers_of_ink() {
    if !ghostscript() {
        return;
    }
    let spot = |name: &str, at: usize| {
        format!(
            "[/Separation ({name}) /DeviceCMYK {{0 exch 0 0}}] setcolorspace 1 setcolor {} 200 9 9 rectfill\n",
            9 * at
        )
    };
    let mut page = "%!PS\n<< /PageSize [288 432] >> setpagedevice\n".to_owned();
    page.extend((0..14).map(|at| spot(&format!("Tone {at}"), at)));
    page += "[/Separation (Gold) /DeviceCMYK {0 exch dup 0}] setcolorspace 1 setcolor 102 102 36 36 rectfill showpage\n";
    for (passes, said) in both(page.as_bytes(), None) {
        assert!(has(&passes, "metallic-gold", 36.0), "{passes:?}, {said}");
    }
}

/// Ghostscript lost the white plate of small pages, and its 10 % of grey was screened over the page.
#[test]
fn a_small_page_keeps_its_spots_where_something_is_transparent() {
    if !ghostscript() {
        return;
    }
    let resources = "/ExtGState << /s << /ca .5 >> >> /ColorSpace << /W [/Separation /White /DeviceCMYK \
        << /FunctionType 2 /Domain [0 1] /C0 [0 0 0 0] /C1 [0 0 0 .1] /N 1 >>] >>";
    let page = document(resources, "/W cs 1 scn 0 0 200 100 re f /s gs 0 1 1 0 k 70 20 60 60 re f");
    let page = String::from_utf8(page).unwrap().replace("[0 0 288 432] /Contents", "[0 0 200 100] /Contents");
    let bench = Bench::new();
    fs::write(bench.path("page.pdf"), page).unwrap();
    bench.done("layers page.pdf --at 10x15mm -o page.print");
    let passes = passes(&fs::read(bench.path("page.print/job.rgl")).unwrap());
    // Half of the white shows through the square, which is half of itself.
    let (all, square) = (200.0 * 100.0 * (600.0f64 / 72.0).powi(2), (60.0f64 * 600.0 / 72.0).powi(2));
    for (ink, wanted) in [("white", all - square / 2.0), ("magenta", square / 2.0), ("yellow", square / 2.0)]
    {
        let dots = passes.iter().find(|(found, _)| found == ink).map_or(0.0, |(_, dots)| *dots as f64);
        assert!((dots / wanted - 1.0).abs() < 0.03, "{ink}: {dots}, not {wanted}: {passes:?}");
    }
    assert_eq!(passes.len(), 3, "{passes:?}");
}

/// By one road it had tones, by the other it was exact.
#[test]
fn a_picture_that_asks_to_be_smooth_has_the_dots_of_its_pixels_by_both_roads() {
    if !ghostscript() {
        return;
    }
    let picture = "q 96 0 0 96 72 72 cm BI /W 8 /H 8 /CS /G /BPC 1 /I true /F /AHx ID aa55aa55aa55aa55> EI Q";
    for (passes, said) in both(&document("", picture), None) {
        let [(ink, dots)] = &passes[..] else { panic!("{passes:?}, {said}") };
        assert_eq!(ink, "black");
        assert!((*dots as f64 / (96.0f64 * 600.0 / 72.0).powi(2) - 0.5).abs() < 0.01, "{dots}");
    }
}
