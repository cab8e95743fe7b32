//! From radiance to the bytes of a picture.
//!
//! Method: one exposure for everything that is to be compared, then a curve that leaves darks and middles alone
//! and bends only what would clip, on the largest channel so that a gold highlight stays gold; sRGB coding by
//! `palette`. Limits: display-referred and not invertible above the bend; compare numbers on radiance.

use palette::{LinSrgb, Srgb};

use super::Radiance;

/// Where the curve begins to bend, as a share of white.
const KNEE: f32 = 0.7;

/// Radiance of white paper facing a light of irradiance 1, about 0.85 / pi, lands a little below white.
const PAPER: f32 = 3.0;

/// What radiance is multiplied by before it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure(pub f32);

impl Exposure {
    /// An exposure under which 90 % of the covered pixels of `pictures` lie below the bend of the curve, but never
    /// so far from that of white paper that black would look white: a factor of 4 at most either way.
    pub fn of(pictures: &[Radiance]) -> Exposure {
        let mut values: Vec<f32> = pictures
            .iter()
            .flat_map(|p| &p.pixels)
            .filter(|p| p[3] > 0.5)
            .map(|p| p[0].max(p[1]).max(p[2]))
            .collect();
        if values.is_empty() {
            return Exposure(PAPER);
        }
        let at = (values.len() - 1) * 9 / 10;
        let (_, bright, _) = values.select_nth_unstable_by(at, f32::total_cmp);
        Exposure((KNEE / bright.max(1e-9)).clamp(PAPER / 4.0, PAPER * 4.0))
    }

    /// A colour (linear, before exposure) as it is shown: 0 to 1, linear.
    pub fn shown(self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|v| (v * self.0).max(0.0));
        let most = rgb[0].max(rgb[1]).max(rgb[2]);
        if most <= KNEE {
            return rgb;
        }
        let room = 1.0 - KNEE;
        let bent = KNEE + room * (1.0 - (-(most - KNEE) / room).exp());
        rgb.map(|v| v * bent / most)
    }
}

/// Codes a linear colour of 0 to 1 as sRGB.
pub fn srgb(rgb: [f32; 3]) -> [u8; 3] {
    let coded: Srgb<u8> = Srgb::from_linear(LinSrgb::new(rgb[0], rgb[1], rgb[2]));
    [coded.red, coded.green, coded.blue]
}

/// A colour coded as sRGB, linear again.
pub fn linear(rgb: [u8; 3]) -> [f32; 3] {
    let colour: LinSrgb<f32> = Srgb::new(rgb[0], rgb[1], rgb[2]).into_linear();
    [colour.red, colour.green, colour.blue]
}
