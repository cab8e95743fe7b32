//! The interface through which every stage reads materials.

use crate::brdf::Space;

/// A picture that gives the reflectance of each of its pixels.
pub trait Materials: Sync {
    /// Pixels across.
    fn width(&self) -> usize;
    /// Pixels down.
    fn height(&self) -> usize;
    /// The tabulation of its rows.
    fn space(&self) -> &Space;
    /// Writes the reflectance (1/sr) of pixel `y * width + x`; `out` has [`Space::columns`] places.
    fn reflectance(&self, pixel: usize, out: &mut [f32]);
}
