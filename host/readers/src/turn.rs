//! Which way up a picture is shown, as its file states.
//!
//! Problem: cameras and scanners store pixels as the sensor gives them, and state how to turn them; every viewer does so.
//! Method: one number from 1 to 8, in EXIF (JPEG, PNG) or in a tag of the same meaning (TIFF), names one of the eight ways
//! to turn or mirror a rectangle. The resolution turns with the pixels. Cost: 1 to 3 ns a pixel. Limits: a number that is
//! none of the eight means no turn, as viewers take it.
//! Source: TIFF 6.0, tag 274.

use image::metadata::Orientation;
use rayon::prelude::*;

use crate::picture::Raster;
use crate::resolution::Dpi;

/// How to turn the pixels of a file before they are shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Turn(pub Orientation);

impl Turn {
    /// As EXIF data state.
    pub fn of_exif(exif: Option<&[u8]>) -> Turn {
        Turn(exif.and_then(Orientation::from_exif_chunk).unwrap_or(Orientation::NoTransforms))
    }

    /// As the tag of a TIFF states.
    pub fn of_tag(value: Option<u16>) -> Turn {
        let turn = value.and_then(|value| Orientation::from_exif(u8::try_from(value).ok()?));
        Turn(turn.unwrap_or(Orientation::NoTransforms))
    }

    /// Whether rows become columns.
    fn on_its_side(self) -> bool {
        use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
        matches!(self.0, Rotate90 | Rotate90FlipH | Rotate270 | Rotate270FlipH)
    }

    /// Width and height after the turn.
    pub fn size(self, (width, height): (u32, u32)) -> (u32, u32) {
        if self.on_its_side() { (height, width) } else { (width, height) }
    }

    /// The resolution after the turn.
    pub fn dpi(self, dpi: Option<Dpi>) -> Option<Dpi> {
        dpi.map(|(x, y)| if self.on_its_side() { (y, x) } else { (x, y) })
    }

    /// Turns a plane of one byte a pixel; `size` is that before the turn.
    pub fn plane(self, plane: Vec<u8>, size: (u32, u32)) -> Vec<u8> {
        use Orientation::*;
        if self.0 == NoTransforms {
            return plane;
        }
        let (width, height) = (size.0 as usize, size.1 as usize);
        let across = self.size(size).0 as usize;
        let mut turned = vec![0; plane.len()];
        turned.par_chunks_mut(across.max(1)).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let (from_x, from_y) = match self.0 {
                    NoTransforms => (x, y),
                    FlipHorizontal => (width - 1 - x, y),
                    Rotate180 => (width - 1 - x, height - 1 - y),
                    FlipVertical => (x, height - 1 - y),
                    Rotate90FlipH => (y, x),
                    Rotate90 => (y, height - 1 - x),
                    Rotate270FlipH => (width - 1 - y, height - 1 - x),
                    Rotate270 => (width - 1 - y, x),
                };
                *pixel = plane[from_y * width + from_x];
            }
        });
        turned
    }
}

impl Turn {
    /// Turns colours; `size` is that before the turn.
    pub fn raster(self, raster: Raster, size: (u32, u32)) -> Raster {
        if self.0 == Orientation::NoTransforms {
            return raster;
        }
        let channels = raster.channels;
        let mut samples = vec![0; raster.samples.len()];
        for c in 0..channels {
            let plane = raster.samples.iter().skip(c).step_by(channels).copied().collect();
            let turned = self.plane(plane, size);
            samples.iter_mut().skip(c).step_by(channels).zip(turned).for_each(|(sample, v)| *sample = v);
        }
        Raster { channels, samples }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_none_of_the_eight_turns_nothing() {
        for value in [None, Some(0), Some(9), Some(262)] {
            assert_eq!(Turn::of_tag(value).0, Orientation::NoTransforms);
        }
        assert_eq!(Turn::of_exif(Some(b"junk")).0, Orientation::NoTransforms);
        assert_eq!(Turn::of_exif(None).plane(vec![1, 2], (2, 1)), [1, 2]);
        assert!(Turn::of_tag(Some(6)).plane(Vec::new(), (0, 0)).is_empty());
    }
}
