//! A page from pixels to the dots of all inks beside a plain halftone of one channel: `cargo bench -p foilpress-art --bench speed`.
//!
//! Method: pages of A4 at 600 dpi as Ghostscript would draw them, in memory. Their way to stacks is timed in turns with netpbm's
//! `pamditherbw -fs` on the same page in grey, both in processor time, and the ratios of each turn are shown. Linux only: the times
//! are those of `/proc/self/stat`, in hundredths of a second.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use std::io::Write;
use std::process::{Command, Stdio};

use art::object_type::Order;
use art::{Options, Page, Settings, compose};
use inks::Library;
use observe::Silent;

const WIDTH: usize = 4960;
const HEIGHT: usize = 7016;
const TURNS: usize = 5;

/// The tags of Ghostscript for text and pictures.
const TEXT: u8 = 1;
const PICTURE: u8 = 2;

fn main() {
    let pages: [(&str, fn(usize, usize) -> [u8; 4]); 3] =
        [("text in colours", text), ("black text", black), ("photograph", photograph)];
    let only = std::env::args().nth(1).filter(|only| only != "--bench");
    for (name, pixel) in pages.into_iter().filter(|page| only.as_deref().is_none_or(|only| only == page.0)) {
        let page: Vec<u8> = (0..WIDTH * HEIGHT).flat_map(|at| pixel(at % WIDTH, at / WIDTH)).collect();
        let ratios: Vec<String> = (0..TURNS)
            .map(|_| {
                let (ours, theirs) = (spent(0, || ours(&page)), spent(2, || theirs(&page)));
                format!("{:.2} ({ours:.2} of {theirs:.2} s)", ours / theirs)
            })
            .collect();
        eprintln!("{name}: {}", ratios.join(", "));
    }
}

/// Letters of 10 points, more or less: a stroke of 7 dots in a place of 50 by 120.
fn stroke(x: usize, y: usize) -> bool {
    let (column, line) = (x / 50, y / 140);
    let margins = !(500..WIDTH - 500).contains(&x) || !(600..HEIGHT - 600).contains(&y);
    let (u, v) = (x % 50, y % 140);
    let letter = (column * 7919 + line * 104_729) % 11;
    let on = |at: usize| (at..at + 7).contains(&u) && (20..90).contains(&v);
    let bar = |at: usize| (at..at + 7).contains(&v) && (5..40).contains(&u);
    !margins
        && letter > 1
        && (on(5) || letter > 5 && on(30) || letter % 3 == 0 && bar(20) || letter % 2 == 0 && bar(83))
}

fn text(x: usize, y: usize) -> [u8; 4] {
    let inks = [[0; 3], [0; 3], [40, 70, 140], [110; 3], [230, 126, 34]];
    let [r, g, b] = inks[y / 140 % inks.len()];
    if stroke(x, y) { [TEXT, r, g, b] } else { [0, 255, 255, 255] }
}

fn black(x: usize, y: usize) -> [u8; 4] {
    if stroke(x, y) { [TEXT, 0, 0, 0] } else { [0, 255, 255, 255] }
}

/// Light that falls off, waves of several lengths, and a picture's noise, in pixels of 300 dpi.
fn photograph(x: usize, y: usize) -> [u8; 4] {
    let (x, y) = (x / 2, y / 2);
    let noise = ((x * 7919 + y * 104_729) ^ (x * y)) % 7;
    let wave = |f: f64, g: f64| ((x as f64 * f + y as f64 * g).sin() + 1.0) / 2.0;
    let light = 0.2 + 0.4 * wave(0.003, 0.001) + 0.3 * wave(-0.011, 0.017) + 0.1 * wave(0.09, 0.05);
    let rgb = [0.9 + 0.1 * wave(0.002, 0.0), 0.9, 0.7 + 0.3 * wave(0.0, 0.004)];
    let [r, g, b] = rgb.map(|v| (240.0 * light * v) as u8 + noise as u8);
    [PICTURE, r, g, b]
}

fn ours(page: &[u8]) {
    let page = Page::read(&mut &page[..], Order::First, (WIDTH, HEIGHT)).expect("a page");
    let art = page.art("page", 600, &Options::default()).expect("art");
    let composed = compose(&art, &Settings::default(), &Library::builtin(), &Silent).expect("dots");
    assert!(composed.report.bare > 0);
}

fn theirs(page: &[u8]) {
    let mut program = Command::new("pamditherbw");
    let mut program =
        program.arg("-fs").stdin(Stdio::piped()).stdout(Stdio::null()).spawn().expect("netpbm's pamditherbw");
    let mut grey = format!("P5\n{WIDTH} {HEIGHT}\n255\n").into_bytes();
    grey.extend(page.as_chunks::<4>().0.iter().map(|&[_, _, g, _]| g));
    program.stdin.take().expect("a pipe").write_all(&grey).expect("it reads");
    assert!(program.wait().expect("it ends").success());
}

/// The seconds of processor time that something takes: of this process, or of its children if `from` is 2.
fn spent(from: usize, work: impl FnOnce()) -> f64 {
    let now = || {
        let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
        // After the name, which may have spaces: the state is the third field, user time the fourteenth.
        let (_, fields) = stat.rsplit_once(')').expect("a name");
        let times: Vec<f64> =
            fields.split_whitespace().skip(11 + from).take(2).flat_map(str::parse).collect();
        times.iter().sum::<f64>() / 100.0
    };
    let before = now();
    work();
    now() - before
}
