//! Halftone of a full A4 page.
//!
//! Run `cargo bench --bench halftone`. The document is 1200 x 1593 pixels with eight smooth bases, so a pixel is
//! 4 x 4 dots; every pixel has weight of every stack.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps, quantise};
use divan::Bencher;
use halftone::metrics::tones;
use halftone::{Method, Settings, halftone};
use inks::{Library, Stack};
use observe::Silent;
use protocol::ink::Ink;
use protocol::paper::Paper;
use sheet::DotMap;

fn main() {
    divan::main();
}

/// So many different stacks: the substrate, then one, two and three layers.
fn stacks(count: usize) -> Vec<Stack> {
    let inks = [Ink::MetallicSilver, Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black, Ink::Finish];
    let mut all = vec![Stack::SUBSTRATE];
    for mask in 1u32..64 {
        all.push(Stack::new((0..6).filter(|i| mask >> i & 1 == 1).map(|i| inks[i]).collect::<Vec<_>>()));
    }
    all.sort_by_key(|stack| stack.layers().len());
    all.truncate(count);
    all
}

fn document(count: usize) -> InkMix {
    let (width, height, channels) = (1200, 1593, 8);
    let mut data = vec![0; width * height * channels];
    for (pixel, out) in data.chunks_exact_mut(channels).enumerate() {
        let (x, y) = ((pixel % width) as f64 / 190.0, (pixel / width) as f64 / 230.0);
        let weights: Vec<f64> = (0..channels)
            .map(|i| 1.05 + (x * (1.0 + i as f64 * 0.3) + y * (2.0 - i as f64 * 0.2)).sin())
            .collect();
        quantise(&weights, out);
    }
    let matrix = (0..channels)
        .map(|i| {
            let shares: Vec<f64> = (0..count).map(|q| 1.0 + ((q * 7 + i * 13) % 11) as f64).collect();
            let mut row = vec![0; count];
            quantise(&shares, &mut row);
            row
        })
        .collect();
    let maps = WeightMaps::new(width, height, channels, data).expect("quantised");
    assert_eq!(maps.at(0).iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
    InkMix { stacks: stacks(count), maps, matrix }
}

fn page() -> (u16, u16) {
    (Paper::A4.width(), Paper::A4.length())
}

/// What a method needs to know of these stacks; all have a minimum of 9 dots.
fn settings(mix: &InkMix, method: Method) -> Settings {
    let count = mix.stacks.len();
    Settings { method, minimum: vec![9; count], ..Settings::from_library(&mix.stacks, &Library::builtin()) }
}

/// A full A4 page of so many active stacks by each method.
#[divan::bench(args = [8, 57], consts = [0, 1, 2], sample_count = 5)]
fn methods<const METHOD: usize>(bencher: Bencher, count: usize) {
    let mix = document(count);
    let settings = settings(&mix, [Method::Walk, Method::Cells, Method::Best][METHOD]);
    bencher.bench(|| halftone(&mix, page(), None, &settings, &Silent).expect("a valid mix"));
}

/// The same in single dots of four stacks of process inks.
#[divan::bench(sample_count = 5)]
fn single_dots(bencher: Bencher) {
    let mut mix = document(5);
    mix.stacks = ["substrate", "C", "M", "Y", "K"].map(|stack| stack.parse().expect("known inks")).to_vec();
    let settings = settings(&mix, Method::Blue);
    bencher.bench(|| halftone(&mix, page(), None, &settings, &Silent).expect("a valid mix"));
}

/// By the walk with metallic silver, and all stacks on it, at 16 dots.
#[divan::bench(args = [8, 57], sample_count = 5)]
fn two_minima(bencher: Bencher, count: usize) {
    let mix = document(count);
    let minima = Settings::of(&mix.stacks, 9, |ink| if ink == Ink::MetallicSilver { 16 } else { 9 });
    let settings = Settings { method: Method::Walk, ..minima };
    bencher.bench(|| halftone(&mix, page(), None, &settings, &Silent).expect("a valid mix"));
}

/// Stacks of the paper's oak leaf: metallic silver and three process inks, with finish on some.
fn leaf() -> (InkMix, DotMap) {
    let mut mix = document(8);
    let text = ["substrate", "C", "M", "Y", "MS", "MS+C", "MS+M+Y", "MS+Y+F"];
    mix.stacks = text.map(|stack| stack.parse().expect("known inks")).to_vec();
    let dots = halftone(&mix, page(), None, &Settings::uniform(8, 9), &Silent).expect("a valid mix");
    (mix, dots)
}

/// Tones and clusters of a full A4 page.
#[divan::bench(sample_count = 3)]
fn report(bencher: Bencher) {
    let (mix, dots) = leaf();
    bencher.bench(|| tones(&mix, &dots, &Silent).expect("the same stacks"));
}
