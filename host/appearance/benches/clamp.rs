//! Equation 1 at every pixel of rusty metal (synthetic without FOILPRESS_DATA), on all threads.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use std::borrow::Cow;

use appearance::brdf::Table;
use appearance::document::Materials;
use appearance::factor::Factored;
use appearance::gamut::{GamutError, GamutSettings, Intent, Printable, map};
use appearance::weights::WeightMaps;
use divan::{Bencher, black_box};
use inks::{InkSet, Library};
use observe::Silent;
use protocol::ink::Ink;

mod common;

#[divan::bench(args = [256, 1024], sample_count = 1)]
fn clamp(bencher: Bencher, size: usize) {
    run(bencher, size, Intent::Clamp);
}

#[divan::bench(args = [256], sample_count = 1)]
fn blend(bencher: Bencher, size: usize) {
    run(bencher, size, Intent::Blend);
}

#[divan::bench(args = [256, 1024], sample_count = 1)]
fn contrast(bencher: Bencher, size: usize) {
    run(bencher, size, Intent::Contrast);
}

fn run(bencher: Bencher, size: usize, intent: Intent) {
    let pixels = common::Field::rusty_metal(size);
    let printable = Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), pixels.space());
    let mut row = vec![0f32; pixels.space().columns()];
    pixels.reflectance(0, &mut row);
    let mut bases = Table::new(row.len());
    bases.push(&row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>());
    let document = Factored { space: pixels.space().clone(), bases, maps: WeightMaps::uniform(size, size) };
    let settings = GamutSettings { intent, ..GamutSettings::default() };
    bencher.counter(divan::counter::ItemsCount::new(size * size)).bench_local(|| {
        let bases = || Ok::<_, GamutError>(Cow::Borrowed(&document));
        black_box(map(&pixels, bases, &printable, &settings, &Silent).unwrap())
    });
}

fn main() {
    divan::main();
}
