//! Coverage: how much ink a layer has at each pixel of its picture.
//!
//! Problem: layers come in any depth and colour, with or without transparency; a layer is ink, from none to full.
//! Method: [`Coverage`] chooses the rule by what the picture has. Cost: 1 ns a pixel; one or two bytes.
//! Limits: 8 bits a channel; colours are taken as they are stored, without a profile.

use std::path::{Path, PathBuf};

use readers::resolution::Dpi;
use readers::{Picture, Raster};

use crate::error::resolution_in_words;

/// The rule that gave the coverage.
///
/// A layer of a drawing: its opacity, because what is drawn in the layer of an ink is ink. Other art follows its pixels.
/// Opaque art: the distance of the darkest of red, green and blue from white, so black art is ink, and so is art drawn in
/// the ink's own saturated colour. Art in one colour on a transparent background: its opacity, whatever the colour. Other
/// art with transparency: the product of the two, so dark and opaque is ink. A page is drawn by programs that fill its ground
/// with white, so beside another colour white is ground: a page in white and one colour is ink where it has that colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Coverage {
    /// Dark is ink.
    Dark,
    /// Opaque is ink.
    Opaque,
    /// Dark and opaque is ink.
    DarkAndOpaque,
    /// Whatever is drawn, in several colours, is ink.
    Drawn,
    /// Whatever is drawn, in one colour, is ink, except the white ground.
    NotWhite,
}

/// The coverage of a layer's picture.
pub(crate) struct Scan {
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub dpi: Option<Dpi>,
    /// 0 no ink, 255 full ink; one byte a pixel.
    pub coverage: Vec<u8>,
    pub by: Coverage,
}

impl Scan {
    /// The size in words, at the resolution that was set instead of the file's.
    pub fn size_at(&self, set: Option<f64>) -> String {
        let pixels = format!("{} x {} pixels", self.width, self.height);
        let dpi = set.map(|dpi| (dpi, dpi)).or(self.dpi);
        dpi.map_or(pixels.clone(), |dpi| format!("{pixels} at {}", resolution_in_words(dpi)))
    }
}

impl Scan {
    /// The coverage of a layer's picture.
    pub fn of_picture(picture: Picture) -> Scan {
        let Picture { name, size: (width, height), colours, resolution, .. } = picture;
        let mut builder = CoverageBuilder::new(
            width as usize * height as usize,
            colours.as_ref().is_some_and(Raster::has_opacity),
        );
        if let Some(Raster { channels, samples }) = &colours {
            builder.row(samples, *channels);
        }
        let (coverage, by) = builder.finish();
        Scan { path: name, width, height, dpi: resolution, coverage, by }
    }

    /// The coverage of a layer of a drawing, whatever its colours: red, green, blue and opacity of each pixel.
    pub fn of_layer(path: &Path, (width, height): (u32, u32), rgba: &[u8]) -> Scan {
        let mut builder = CoverageBuilder::of_drawing(rgba.len() / 4);
        builder.row(rgba, 4);
        let by = if builder.one_colour() { Coverage::Opaque } else { Coverage::Drawn };
        Scan { path: path.to_path_buf(), width, height, dpi: None, coverage: builder.alpha, by }
    }

    /// The coverage of a page: red, green, blue and opacity of each pixel.
    pub fn of_page(path: &Path, size: (u32, u32), rgba: &[u8]) -> Scan {
        let scan = Scan::of_drawing(path, size, rgba);
        if scan.by != Coverage::DarkAndOpaque {
            return scan;
        }
        let pixels = rgba.as_chunks::<4>().0;
        let mut builder = CoverageBuilder::of_drawing(0);
        let ink = |pixel: &[u8; 4]| pixel[..3] != [255; 3];
        pixels.iter().filter(|pixel| ink(pixel)).for_each(|pixel| builder.widen(pixel));
        if !builder.one_colour() {
            return scan;
        }
        let coverage = pixels.iter().map(|pixel| if ink(pixel) { pixel[3] } else { 0 }).collect();
        Scan { coverage, by: Coverage::NotWhite, ..scan }
    }

    /// The coverage of a layer that was drawn on nothing and has tones: red, green, blue and opacity of each pixel.
    pub fn of_drawing(path: &Path, (width, height): (u32, u32), rgba: &[u8]) -> Scan {
        let mut builder = CoverageBuilder::of_drawing(rgba.len() / 4);
        builder.row(rgba, 4);
        let (coverage, by) = builder.finish();
        Scan { path: path.to_path_buf(), width, height, dpi: None, coverage, by }
    }
}

/// Collects pixels and chooses the rule once all of them are known.
pub(crate) struct CoverageBuilder {
    dark: Vec<u8>,
    alpha: Vec<u8>,
    /// Least and greatest red, green and blue among opaque pixels.
    range: [(u8, u8); 3],
    transparent: bool,
}

impl CoverageBuilder {
    /// Colours that differ by more than this in any channel are two colours.
    const ONE_COLOUR: u8 = 24;

    pub fn new(pixels: usize, alpha: bool) -> CoverageBuilder {
        CoverageBuilder {
            dark: Vec::with_capacity(pixels),
            alpha: Vec::with_capacity(if alpha { pixels } else { 0 }),
            range: [(255, 0); 3],
            transparent: false,
        }
    }

    /// For a drawing, which has no ground: what is drawn in one colour is ink even if it leaves no pixel free.
    pub fn of_drawing(pixels: usize) -> CoverageBuilder {
        CoverageBuilder { transparent: true, ..CoverageBuilder::new(pixels, true) }
    }

    /// Adds pixels of 1 to 4 channels: grey; grey and alpha; RGB; RGB and alpha.
    pub fn row(&mut self, row: &[u8], channels: usize) {
        match channels {
            1 => self.dark.extend(row.iter().map(|&v| 255 - v)),
            3 => self.dark.extend(row.as_chunks::<3>().0.iter().map(|&[r, g, b]| 255 - r.min(g).min(b))),
            2 => row.as_chunks::<2>().0.iter().for_each(|&[v, a]| self.pixel([v; 3], a)),
            _ => row.as_chunks::<4>().0.iter().for_each(|&[r, g, b, a]| self.pixel([r, g, b], a)),
        }
    }

    fn pixel(&mut self, colour: [u8; 3], alpha: u8) {
        self.dark.push(255 - colour[0].min(colour[1]).min(colour[2]));
        self.alpha.push(alpha);
        self.transparent |= alpha < 255;
        let [r, g, b] = colour;
        self.widen(&[r, g, b, alpha]);
    }

    /// Takes a pixel's colour into the range.
    fn widen(&mut self, &[ref colour @ .., alpha]: &[u8; 4]) {
        // Opaque pixels only: programs store any colour under transparent ones.
        if alpha >= 250 {
            for (range, &v) in self.range.iter_mut().zip(colour) {
                *range = (range.0.min(v), range.1.max(v));
            }
        }
    }

    /// Whether everything opaque has one colour.
    fn one_colour(&self) -> bool {
        self.range.iter().all(|&(least, most)| most <= least.saturating_add(CoverageBuilder::ONE_COLOUR))
    }

    /// The coverage and its rule.
    pub fn finish(self) -> (Vec<u8>, Coverage) {
        if !self.transparent {
            return (self.dark, Coverage::Dark);
        }
        if self.one_colour() {
            return (self.alpha, Coverage::Opaque);
        }
        let times = |(d, a): (&u8, &u8)| ((u32::from(*d) * u32::from(*a) + 127) / 255) as u8;
        (self.dark.iter().zip(&self.alpha).map(times).collect(), Coverage::DarkAndOpaque)
    }
}
