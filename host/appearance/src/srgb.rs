//! The transfer curve of sRGB (IEC 61966-2-1), in both directions.

use palette::encoding::{FromLinear, IntoLinear, Srgb};

/// The linear value of an encoded one; both are 0 to 1 for displayable colours, and values below 0 count as 0.
pub fn decode(v: f32) -> f32 {
    <Srgb as IntoLinear<f32, f32>>::into_linear(v.max(0.0))
}

/// The encoded value of a linear one; both are 0 to 1, and values outside are clamped.
pub fn encode(v: f32) -> f32 {
    <Srgb as FromLinear<f32, f32>>::from_linear(v.clamp(0.0, 1.0))
}
