//! A rendered picture before tone mapping.

/// Linear radiance, row by row from the top. The fourth value is the covered part of the pixel (0 to 1); the colours are
/// premultiplied by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` values R, G, B, coverage.
    pub pixels: Vec<[f32; 4]>,
}
