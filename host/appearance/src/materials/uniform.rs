//! One material everywhere, such as a measured BRDF.

use inks::Curve;

use super::pixels::Materials;
use crate::brdf::Space;

/// The largest accepted reflectance in 1/sr: the peak of a mirror under a laser. Larger values are damage.
const MOST_REFLECTANCE: f64 = 1e9;

/// A number that cannot be a reflectance.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{value:e} is not a reflectance; expected 0 to {MOST_REFLECTANCE:e} per steradian")]
pub(crate) struct ReflectanceError {
    /// The number.
    value: f64,
}

/// Checks that all values can be reflectances in 1/sr.
pub(crate) fn check_reflectance(row: &[f64]) -> Result<(), ReflectanceError> {
    match row.iter().find(|v| !(0.0..=MOST_REFLECTANCE).contains(*v)) {
        Some(&value) => Err(ReflectanceError { value }),
        None => Ok(()),
    }
}

/// One material everywhere: a picture of a single pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Uniform {
    space: Space,
    row: Vec<f32>,
}

impl Uniform {
    /// The material of a curve (1/sr), sampled at the angles of the space. Fails on values that are too large.
    pub(crate) fn new(space: Space, curve: &Curve) -> Result<Uniform, ReflectanceError> {
        let row = space.row(curve);
        check_reflectance(&row)?;
        Ok(Uniform { space, row: row.into_iter().map(|v| v as f32).collect() })
    }
}

impl Materials for Uniform {
    fn width(&self) -> usize {
        1
    }

    fn height(&self) -> usize {
        1
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, _pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.row);
    }

    fn key(&self, _pixel: usize, _row: &mut [f32]) -> u64 {
        0
    }
}
