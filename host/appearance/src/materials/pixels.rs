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

    /// Adds `part` times that reflectance to `out`.
    fn add(&self, pixel: usize, part: f32, out: &mut [f32]) {
        let mut row = vec![0.0; out.len()];
        self.reflectance(pixel, &mut row);
        out.iter_mut().zip(&row).for_each(|(out, &f)| *out += part * f);
    }

    /// A hash of what decides the reflectance of a pixel: pixels with different hashes may still reflect the same, and pixels
    /// with equal hashes hardly ever differ. `row` is memory for a row.
    fn key(&self, pixel: usize, row: &mut [f32]) -> u64 {
        self.reflectance(pixel, row);
        hash(row)
    }
}

/// A multiply-and-rotate hash over the bits.
pub(super) fn hash(values: &[f32]) -> u64 {
    values.iter().fold(0x9e37_79b9_7f4a_7c15, |h: u64, v| {
        (h.rotate_left(5) ^ u64::from(v.to_bits())).wrapping_mul(0x517c_c1b7_2722_0a95)
    })
}
