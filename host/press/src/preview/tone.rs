//! From radiance to the bytes of a picture.
//!
//! Method: one exposure for everything that is to be compared; then a curve that leaves darks and middles alone and
//! bends what would clip, `x / (x + room)` above the knee, so that a highlight a hundred times white still has a
//! shape. It is taken half on the largest channel (gold stays gold) and half channel by channel (the core of a
//! highlight goes to white, as on film). sRGB coding by `palette`. Limits: display-referred; compare numbers on
//! radiance, not on bytes.

use palette::{LinSrgb, Srgb};

use super::Radiance;

/// Where the curve begins to bend, as a share of white.
const KNEE: f32 = 0.4;

/// Where the exposure puts the brighter middle of a picture: light enough for paper to look white, with room left
/// for what shines.
const MIDDLE: f32 = 0.6;

/// What radiance is multiplied by before it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure(pub f32);

impl Exposure {
    /// White paper facing a light of irradiance 1 reflects about 0.85 / pi; this lands it a little below white.
    pub const PAPER: Exposure = Exposure(3.0);

    /// An exposure under which 70 % of the covered pixels of `pictures` stay below 0.6 of white, but never so far from that of white paper that black would look white: a factor of 4 at most either way.
    pub fn of(pictures: &[Radiance]) -> Exposure {
        let mut values: Vec<f32> = pictures
            .iter()
            .flat_map(|p| &p.pixels)
            .filter(|p| p[3] > 0.5)
            .map(|p| p[0].max(p[1]).max(p[2]))
            .collect();
        if values.is_empty() {
            return Exposure::PAPER;
        }
        let at = (values.len() - 1) * 7 / 10;
        let (_, bright, _) = values.select_nth_unstable_by(at, f32::total_cmp);
        Exposure((MIDDLE / bright.max(1e-9)).clamp(Exposure::PAPER.0 / 4.0, Exposure::PAPER.0 * 4.0))
    }

    /// A colour (linear, before exposure) as it is shown: 0 to 1, linear.
    pub fn shown(self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|v| (v * self.0).max(0.0));
        let most = rgb[0].max(rgb[1]).max(rgb[2]);
        if most <= KNEE {
            return rgb;
        }
        let together = bent(most) / most;
        rgb.map(|v| 0.5 * (v * together + bent(v)))
    }
}

/// The curve: the identity below the knee, towards 1 above it, with one slope where they meet.
fn bent(v: f32) -> f32 {
    let (over, room) = (v - KNEE, 1.0 - KNEE);
    if over <= 0.0 { v } else { KNEE + room * over / (over + room) }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: &[f32]) -> Radiance {
        let pixels = values.iter().map(|&v| [v, 0.5 * v, 0.25 * v, 1.0]).collect();
        Radiance { width: values.len(), height: 1, pixels }
    }

    #[test]
    fn brighter_stays_brighter_and_below_white() {
        let mut last = -1.0;
        // From black to 130 times white: beyond, steps this fine fall below the digits of f32.
        for i in 0..1200 {
            let shown = Exposure(1.0).shown([1.5f32.powf(i as f32 / 100.0) - 1.0, 0.2, 0.1]);
            assert!(shown[0] > last && shown[0] <= 1.0, "step {i}: {} after {last}", shown[0]);
            last = shown[0];
        }
    }

    #[test]
    fn darks_and_middles_are_left_alone() {
        assert_eq!(Exposure(2.0).shown([0.05, 0.1, 0.2]), [0.1, 0.2, 0.4]);
    }

    #[test]
    fn highlights_go_towards_white_but_keep_their_order() {
        let [r, g, b] = Exposure(1.0).shown([18.0, 14.0, 6.0]);
        assert!(r > g && g > b && b > 0.5, "{r} {g} {b}");
    }

    #[test]
    fn most_of_a_picture_leaves_room_for_what_shines() {
        let values: Vec<f32> = (1..=100).map(|i| i as f32 * 0.01).collect();
        let exposure = Exposure::of(&[picture(&values)]);
        let below = values.iter().filter(|&&v| v * exposure.0 <= 0.6 + 1e-6).count();
        assert!((69..=71).contains(&below), "{below} of 100");
        let black = Exposure::of(&[picture(&[0.0; 9])]);
        assert!(black.0.is_finite() && black.0 <= 12.0, "{black:?}");
    }

    /// IEC 61966-2-1, by its formula.
    #[test]
    fn bytes_are_srgb() {
        for i in 0..=1000 {
            let v = f64::from(i) / 1000.0;
            let coded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            let found = srgb([v as f32; 3])[1];
            assert!((f64::from(found) - 255.0 * coded).abs() < 0.55, "{v}: {found}, not {}", 255.0 * coded);
        }
        assert_eq!(srgb(linear([0, 52, 255])), [0, 52, 255]);
    }
}
