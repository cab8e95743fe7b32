//! One page by two roads: `layers` and a print queue make the same dots of it.

use std::process::Stdio;

use image::{Rgb, RgbImage};
use observe::Silent;
use press::inspect::inspect;
use protocol::ink::Ink;
use sheet::Plane;
use testing::needs::ghostscript;
use testing::program::Bench;

/// A postcard in points, no whole number of dots.
const SHEET: (f64, f64) = (283.465, 419.528);

const LINES: &str = "/Times-Roman findfont 11 scalefont setfont 30 380 moveto (Flat art, dot by dot) show \
    /Helvetica findfont 6 scalefont setfont 30 360 moveto (the quick brown fox jumps over the lazy dog) show\n";
/// Tints and text in them, one of them across the margins and the edge of the sheet.
const TONES: &str = ".9 .5 .13 setrgbcolor 40 200 60.3 71.7 rectfill .5 setgray -9 90 60 40 rectfill 240 300 60 119 rectfill \
    .55 .7 .95 setrgbcolor 150 40.2 80 33 rectfill 30 340 moveto (tinted words) show\n";
const PICTURE: &str = "gsave 120 150 translate 100 90 scale 40 36 8 [40 0 0 -36 0 36] \
    {1440 string 0 1 1439 {1 index exch dup dup 7 mul exch 40 idiv 13 mul add 255 and put} for} image grestore\n";
const SPOTS: &str = "[/Separation (Gold) /DeviceCMYK {0 exch 0 exch dup .3 mul exch 0}] setcolorspace 1 setcolor 40 40 30.1 30.1 rectfill \
    .3 setcolor 180 250 40 60 rectfill [/Separation (White) /DeviceCMYK {pop 0 0 0 .1}] setcolorspace 1 setcolor 90 100 50 30 rectfill\n";
const PLATES: &str =
    ".4 .1 0 .2 setcmykcolor 60 120 50 90 rectfill 0 0 0 .37 setcmykcolor 130 300 50.5 40 rectfill\n";

/// The dots of each ink on the sheet; there may be several passes of one.
fn planes(job: &[u8]) -> Vec<(Ink, Plane)> {
    let mut planes: Vec<(Ink, Plane)> =
        inspect(job, &Silent).passes.into_iter().map(|pass| (pass.ink, pass.plane)).collect();
    planes.sort_by_key(|(ink, _)| *ink);
    planes
}

/// Arguments of `layers`, among them the paper.
fn by_layers(bench: &Bench, arguments: &str) -> Vec<(Ink, Plane)> {
    let _ = std::fs::remove_dir_all(bench.path("art.print"));
    bench.done(&format!("layers {arguments} -o art.print"));
    planes(&std::fs::read(bench.path("art.print/job.rgl")).expect("a job"))
}

fn by_queue(bench: &Bench, file: &str, options: &str) -> Vec<(Ink, Plane)> {
    let mut command = bench.command_of(["cups-filter", "1", "user", "title", "1", options, file]);
    let output = command.stdin(Stdio::null()).output().expect("the filter starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    planes(&output.stdout)
}

#[test]
fn layers_and_a_queue_make_the_same_dots_of_a_page() {
    if !ghostscript() {
        return;
    }
    let bench = Bench::new();
    let all = [LINES, TONES, PICTURE, PLATES].concat();
    let pages = [
        ("solid", LINES.to_owned(), "", ""),
        ("drawings", [LINES, TONES].concat(), "", ""),
        ("plates", [SPOTS, PLATES, LINES].concat(), "FoilpressSpots=Named", ""),
        ("pictures", all.clone(), "", ""),
        ("cells", all, "FoilpressHalftone=Cells", "--halftone cells"),
    ];
    for (name, drawing, of_queue, of_layers) in pages {
        let (width, length) = SHEET;
        let page = format!("%!PS\n<</PageSize[{width} {length}]>>setpagedevice\n{drawing}showpage\n");
        std::fs::write(bench.path("page.ps"), page).expect("a page");
        let queued = by_queue(&bench, "page.ps", of_queue);
        let layers = by_layers(&bench, &format!("page.ps --paper postcard --at 0x0mm --crop {of_layers}"));
        let dots: u64 = queued.iter().map(|(_, plane)| plane.dots()).sum();
        assert!(dots > 5000, "{name}: {dots} dots");
        let inks = |planes: &[(Ink, Plane)]| planes.iter().map(|(ink, _)| *ink).collect::<Vec<_>>();
        assert_eq!(inks(&queued), inks(&layers), "{name}");
        for ((ink, queued), (_, layers)) in queued.iter().zip(&layers) {
            assert!(queued == layers, "{name}: {} {} and {}", ink.name(), queued.dots(), layers.dots());
        }
    }
}

#[test]
fn layers_and_a_queue_make_the_same_dots_of_a_picture() {
    let bench = Bench::new();
    // Wide and low, and it states no size: it is turned and fitted.
    let picture = RgbImage::from_fn(1200, 40, |x, y| match (x, y) {
        (40..390, 10..30) => Rgb([230, 126, 34]),
        (420..424, _) => Rgb([0; 3]),
        (430.., _) => Rgb([(x / 5) as u8, 4 * y as u8, 120]),
        _ => Rgb([255; 3]),
    });
    picture.save(bench.path("art.png")).expect("a picture");
    let (queued, layers) =
        (by_queue(&bench, "art.png", ""), by_layers(&bench, "art.png --paper a4 --fit auto"));
    assert!(queued.len() > 2 && queued == layers);
}
