//! Reading art, dot by dot, from files that other means than the readers made.

use std::fs;
use std::path::{Path, PathBuf};

mod archives;
mod damage;
mod documents;
mod drawings;
pub(crate) mod exports;
mod files;
mod hostile;
mod knockout;
mod layered;
mod pages;
mod pictures;
mod plates;
mod programs;
mod shelves;
mod sizes;
mod styles;
mod thin;
mod turned;

use super::*;
use crate::colour::packed;
use crate::dots::bitplane;
use crate::read::file;
use crate::read::pdf::{Interpreter, Part};
use observe::{Diagnosis, Silent};
use protocol::ink::Ink;
use tempfile::TempDir;
use testing::needs::ghostscript;

struct Bench(TempDir);

impl Bench {
    fn new() -> Bench {
        Bench(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a PNG of this kind, at 600 dpi by default.
    fn png(
        &self,
        name: &str,
        (width, height): (u32, u32),
        colour: png::ColorType,
        depth: png::BitDepth,
        data: &[u8],
        change: impl FnOnce(&mut png::Encoder<'_, fs::File>),
    ) -> PathBuf {
        let path = self.path(name);
        let mut encoder = png::Encoder::new(fs::File::create(&path).unwrap(), width, height);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let unit = png::Unit::Meter;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: 23_622, yppu: 23_622, unit }));
        change(&mut encoder);
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        path
    }

    fn grey(&self, name: &str, size: (u32, u32), data: &[u8]) -> PathBuf {
        self.png(name, size, png::ColorType::Grayscale, png::BitDepth::Eight, data, |_| ())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }
}

/// The spot colours of each page of a document that are layers.
fn spots_of(file: &Path) -> Result<Vec<Vec<String>>, Diagnosis> {
    let survey = pdf::survey(file, Part::Sheet, &Silent)?;
    Ok(survey.pages.into_iter().map(|page| page.spots).collect())
}

fn read(paths: &[PathBuf], options: &Options) -> Artwork {
    open(paths, options, &Silent).unwrap()
}

fn refused(paths: &[PathBuf]) -> String {
    open(paths, &Options::default(), &Silent).unwrap_err().to_string()
}

/// Columns and rows of the dots of a layer: first and last of each, and how many dots.
fn extent(layer: &Layer) -> (usize, usize, usize, usize, u64) {
    let Shape::Solid(plane) = &layer.shape else { panic!("{} has tones", layer.name) };
    let inked = |&(x, y): &(usize, usize)| bitplane::at(plane, x, y);
    let all = || (0..plane.length).flat_map(|y| (0..plane.width).map(move |x| (x, y))).filter(inked);
    let (xs, ys) = (all().map(|p| p.0), all().map(|p| p.1));
    (xs.clone().min().unwrap(), ys.clone().min().unwrap(), xs.max().unwrap(), ys.max().unwrap(), plane.dots())
}

/// Dots of a length in millimetres.
fn dots(mm: f64) -> f64 {
    mm * 600.0 / 25.4
}

fn near(found: u64, wanted: f64, share: f64) -> bool {
    (found as f64 / wanted - 1.0).abs() < share
}

/// The inks of art with their dots: of its layers, and of its colours.
fn laid(art: &Artwork) -> Vec<(Ink, u64)> {
    let settings = Settings { inks: inks::InkSet::of(Ink::ALL), order: Order::Given, ..Settings::default() };
    let composed = compose(art, &settings, &inks::Library::builtin(), &Silent).unwrap();
    let named = |laid: crate::InkLayer| (Ink::from_name(laid.ink).unwrap(), laid.dots);
    composed.report.laid.into_iter().map(named).collect()
}

/// How many dots have an ink.
fn dots_of(art: &Artwork, ink: Ink) -> u64 {
    laid(art).into_iter().filter(|(found, _)| *found == ink).map(|(_, dots)| dots).sum()
}
