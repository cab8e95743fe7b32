//! The transfer curve of sRGB (IEC 61966-2-1), in both directions, and the luminance of its colours.

use maths::Maths;

/// The linear value of an encoded one; both are 0 to 1 for displayable colours, and values below 0 count as
/// 0.
pub fn decode(v: f32) -> f32 {
    if v <= 0.04045 {
        v.max(0.0) * (1.0 / 12.92f64) as f32
    } else {
        let base = f64::from(v) * f64::from((1.0 / 1.055f64) as f32) + f64::from((0.055 / 1.055f64) as f32);
        (base as f32).power(2.4)
    }
}

/// The encoded value of a linear one; both are 0 to 1, and values outside are clamped.
pub fn encode(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        // In `f32` these two numbers would make white a little less than 1.
        (f64::from(v.power((1.0 / 2.4f64) as f32)) * 1.055 - 0.055) as f32
    }
}

/// The luminance of a linear colour (ITU-R BT.709).
#[must_use]
pub fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use palette::encoding::{FromLinear, IntoLinear, Srgb};

    #[test]
    fn both_ways_are_those_of_a_library() {
        for v in (0..=100_000).map(|i| i as f32 / 100_000.0) {
            let linear: f32 = Srgb::into_linear(v);
            assert!((decode(v) - linear).abs() <= f32::EPSILON * linear, "{v}: {} {linear}", decode(v));
            // The exponent and its power are rounded, and what is left after .055 is taken away keeps that.
            let (found, encoded): (f64, f64) = (encode(v).into(), Srgb::from_linear(f64::from(v)));
            let bound = 2.0 * f64::from(f32::EPSILON) * (encoded + 0.055);
            assert!((found - encoded).abs() <= bound, "{v}: {found} {encoded}");
        }
        assert_eq!((decode(-1.0), encode(-1.0), encode(7.0)), (0.0, 0.0, 1.0));
        assert!((decode(2.0) - 4.953_75).abs() < 1e-4 && decode(f32::NAN).is_nan());
    }
}
