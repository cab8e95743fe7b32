//! The photographs that correct the others: a flat field, a dark frame.
//!
//! Problem: a lens darkens corners and a sensor adds a little everywhere; both are taken out with photographs of an even surface and of
//! nothing. Method: subtract, divide. Which pixels are full is asked of the raw values first: afterwards they are no longer all at one brightest
//! value. Cost: a pass over each photograph. Limits: values proportional to light.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::photo::{self, Photo};
use super::probe::CLIPPED;
use crate::MeasureError;
use readers::Samples;

/// The least share of the mean that a flat field divides by: below it there is no picture, only noise.
const LEAST_FIELD: f32 = 0.02;
/// The part of a flat field's or a lamp-off photograph's pixels that may be full: dust and hot pixels.
pub(crate) const FULL: f64 = 1e-3;

/// What is taken from each photograph before it is merged.
pub struct Frames {
    /// An evenly lit white surface.
    flat: Option<(PathBuf, Photo)>,
    /// The lens covered.
    dark: Option<Photo>,
}

/// A photograph after the frames, and which of its pixels were full before.
pub(crate) struct Developed {
    pub(crate) photo: Photo,
    full: Full,
}

enum Full {
    /// Values from here on, for each channel.
    From([f32; 3]),
    /// A bit for each channel of each pixel.
    Marked(Vec<u8>),
}

impl Developed {
    /// Whether value number `i`, which is of channel `c`, is full.
    #[inline]
    pub(crate) fn is_full(&self, i: usize, c: usize) -> bool {
        match &self.full {
            Full::From(from) => self.photo.at(i) >= from[c],
            Full::Marked(marked) => marked[i / 3] & 1 << c != 0,
        }
    }
}

impl Frames {
    /// Reads the files that are named.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn read(flat: Option<&Path>, dark: Option<&Path>) -> Result<Frames, MeasureError> {
        let flat = flat.map(|path| photo::read(path).map(|photo| (path.to_path_buf(), photo))).transpose()?;
        Ok(Frames { flat, dark: dark.map(photo::read).transpose()? })
    }

    /// Whether the flat field says how the lens darkens, for a sensor that is full at `white`.
    pub(crate) fn check(&self, white: [f32; 3]) -> Result<(), MeasureError> {
        let Some((path, photo)) = &self.flat else { return Ok(()) };
        let count = 3 * photo.width * photo.height;
        let full = (0..count).filter(|&i| photo.at(i) >= CLIPPED * white[i % 3]).count();
        if full as f64 > FULL * count as f64 {
            return Err(MeasureError::photo(
                path,
                "the flat field is clipped, so it does not say how the lens darkens; expose it shorter",
            ));
        }
        Ok(())
    }

    #[cfg(test)]
    pub(crate) fn none() -> Frames {
        Frames { flat: None, dark: None }
    }

    fn flat(&self) -> Option<&Photo> {
        self.flat.as_ref().map(|flat| &flat.1)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.flat.is_none() && self.dark.is_none()
    }

    /// Whether a photograph has the size of the frames.
    pub(crate) fn fits(&self, photo: &Photo, path: &Path) -> Result<(), MeasureError> {
        for frame in self.flat().into_iter().chain(&self.dark) {
            if (frame.width, frame.height) != (photo.width, photo.height) {
                return Err(MeasureError::photo(
                    path,
                    format!(
                        "{} x {} pixels, but the flat field or dark frame has {} x {}; take them with the same camera, upright",
                        photo.width, photo.height, frame.width, frame.height
                    ),
                ));
            }
        }
        Ok(())
    }

    /// A photograph without the dark frame, divided by the flat field.
    pub(crate) fn corrected(&self, photo: &Photo) -> Photo {
        let count = 3 * photo.width * photo.height;
        let dark = |i: usize| self.dark.as_ref().map_or(0.0, |frame| frame.at(i));
        let field = |i: usize| self.flat().map_or(1.0, |frame| frame.at(i) - dark(i));
        let mean: [f32; 3] = std::array::from_fn(|c| {
            let sum: f64 = (c..count).step_by(3).map(|i| f64::from(field(i))).sum();
            (sum / (count / 3) as f64) as f32
        });
        let values = (0..count)
            .into_par_iter()
            .map(|i| (photo.at(i) - dark(i)) * mean[i % 3] / field(i).max(LEAST_FIELD * mean[i % 3]));
        Photo { values: Samples::Float(values.collect()), width: photo.width, height: photo.height }
    }

    /// Corrects a photograph of a sensor that is full at `white`.
    pub(crate) fn develop(&self, photo: Photo, white: [f32; 3]) -> Developed {
        let from = white.map(|white| CLIPPED * white);
        if self.is_empty() {
            return Developed { photo, full: Full::From(from) };
        }
        let marked = (0..photo.width * photo.height)
            .into_par_iter()
            .map(|i| (0..3).fold(0u8, |bits, c| bits | u8::from(photo.at(3 * i + c) >= from[c]) << c))
            .collect();
        Developed { photo: self.corrected(&photo), full: Full::Marked(marked) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photo(values: [f32; 6]) -> Photo {
        Photo { width: 2, height: 1, values: Samples::Float(values.to_vec()) }
    }

    /// The right pixel of each channel is full at 21; the left, in the dim part of the field, only looks as bright afterwards.
    #[test]
    fn frames_are_taken_off_and_hide_no_full_pixel() {
        let frames = Frames {
            flat: Some(("flat.png".into(), photo([11.0, 12.0, 13.0, 31.0, 32.0, 33.0]))),
            dark: Some(photo([1.0, 2.0, 3.0, 1.0, 2.0, 3.0])),
        };
        let clean = frames.develop(photo([11.0, 12.0, 13.0, 21.0, 22.0, 23.0]), [21.0, 22.0, 23.0]);
        let values: Vec<f32> = (0..6).map(|i| clean.photo.at(i)).collect();
        assert_eq!(values, [20.0, 20.0, 20.0, 40.0 / 3.0, 40.0 / 3.0, 40.0 / 3.0]);
        for c in 0..3 {
            assert!(!clean.is_full(c, c) && clean.is_full(3 + c, c), "{c}");
        }
        let small = Photo { width: 1, height: 1, values: Samples::Eight(vec![0; 3]) };
        let error = frames.fits(&small, Path::new("a.png")).unwrap_err().to_string();
        assert!(error.contains("a.png: 1 x 1 pixels"), "{error}");
    }

    #[test]
    fn a_flat_field_that_is_full_is_refused() {
        let frames = |value: f32| Frames { flat: Some(("flat.png".into(), photo([value; 6]))), dark: None };
        assert!(frames(0.9).check([1.0; 3]).is_ok());
        let error = frames(0.98).check([1.0; 3]).unwrap_err().to_string();
        assert!(error.contains("flat.png: the flat field is clipped"), "{error}");
    }
}
