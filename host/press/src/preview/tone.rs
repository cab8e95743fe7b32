//! From radiance to the bytes of a picture.
//!
//! Method: one exposure for all pictures to compare, then a tone curve. It keeps darks and midtones, and
//! compresses brighter values by `x / (x + room)` above the knee, so that a highlight a hundred times
//! brighter than white keeps its shape. Half of the result is scaled by the largest channel (gold stays
//! gold), the other half by each channel (the core of a highlight turns white, as on film). With the knee
//! at white all colours up to it are kept, and brighter ones are cut off. sRGB coding by `palette`. Limits:
//! display-referred; compare radiance, not bytes.

use palette::{LinSrgb, Srgb};

use super::radiance::Radiance;

/// The exposure maps the brighter middle of a picture to this: light enough for white paper, with room for
/// highlights.
const MIDDLE: f32 = 0.6;

/// The curve for a view of a sheet is straight up to this part of white. Source: four fifths leave a
/// highlight a fifth in which it keeps its shape.
const STRAIGHT: f32 = 0.8;

/// From radiance to display values: a factor, then the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneCurve {
    /// The factor of radiance, positive.
    pub exposure: f32,
    /// The value above which the curve compresses, as a fraction of white: 0 to 1.
    pub knee: f32,
}

impl ToneCurve {
    /// For white paper facing a light of irradiance 1, which reflects about 0.85 / pi: it becomes slightly
    /// darker than white.
    pub const PAPER: ToneCurve = ToneCurve { exposure: 3.0, knee: 0.4 };

    /// An exposure that keeps 70 % of the covered pixels of `pictures` below 0.6 of white. It is within a
    /// factor of 4 of that of [`ToneCurve::PAPER`], so that black never looks white.
    pub fn of(pictures: &[Radiance]) -> ToneCurve {
        let paper = ToneCurve::PAPER;
        let exposure = ToneCurve::under_a_probe(pictures).exposure;
        ToneCurve { exposure: exposure.clamp(paper.exposure / 4.0, paper.exposure * 4.0), ..paper }
    }

    /// The same without a limit: the light of a panorama has any strength, while lamps have an irradiance
    /// of 1. A picture that is all black stays so.
    pub fn under_a_probe(pictures: &[Radiance]) -> ToneCurve {
        ToneCurve { exposure: exposure(pictures, 700, MIDDLE), ..ToneCurve::PAPER }
    }

    /// For a target under one light, and all that is compared with it: straight up to four fifths of white,
    /// below which is all of it but the brightest two-hundredth. So a ground of a thirtieth of the light
    /// looks like one, whatever the light.
    pub fn of_view(target: &Radiance) -> ToneCurve {
        ToneCurve { exposure: exposure(std::slice::from_ref(target), 995, STRAIGHT), knee: STRAIGHT }
    }

    /// The exposure so many stops above that of [`ToneCurve::PAPER`].
    pub fn stops(stops: f64) -> ToneCurve {
        let exposure = (f64::from(ToneCurve::PAPER.exposure) * stops.exp2()) as f32;
        ToneCurve { exposure, ..ToneCurve::PAPER }
    }

    /// How many stops the exposure lies above that of [`ToneCurve::PAPER`].
    pub fn in_stops(self) -> f64 {
        f64::from(self.exposure / ToneCurve::PAPER.exposure).log2()
    }

    /// Maps a linear colour before exposure to display values, linear from 0 to 1.
    pub fn shown(self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|v| (v * self.exposure).max(0.0));
        let most = rgb[0].max(rgb[1]).max(rgb[2]);
        if most <= self.knee {
            return rgb;
        }
        let together = self.bent(most) / most;
        rgb.map(|v| 0.5 * (v * together + self.bent(v)))
    }

    /// The curve: the identity below the knee, approaching 1 above it, with equal slopes at the knee.
    fn bent(self, v: f32) -> f32 {
        let (over, room) = (v - self.knee, 1.0 - self.knee);
        if over <= 0.0 { v } else { self.knee + room * over / (over + room) }
    }
}

/// The factor that brings so many thousandths of the covered pixels to at most `value`; that of
/// [`ToneCurve::PAPER`] for what is all black.
fn exposure(pictures: &[Radiance], thousandths: usize, value: f32) -> f32 {
    let covered = pictures.iter().flat_map(|p| &p.pixels).filter(|p| p[3] > 0.5);
    let mut values: Vec<f32> = covered.map(|p| p[0].max(p[1]).max(p[2])).collect();
    let paper = ToneCurve::PAPER.exposure;
    if values.is_empty() {
        return paper;
    }
    let at = (values.len() - 1) * thousandths / 1000;
    let (_, bright, _) = values.select_nth_unstable_by(at, f32::total_cmp);
    let found = value / *bright;
    if *bright > 1e-9 && found > 0.0 { found } else { paper }
}

/// Encodes a linear colour from 0 to 1 as sRGB.
pub(super) fn srgb(rgb: [f32; 3]) -> [u8; 3] {
    let coded: Srgb<u8> = Srgb::from_linear(LinSrgb::new(rgb[0], rgb[1], rgb[2]));
    [coded.red, coded.green, coded.blue]
}

/// Decodes an sRGB colour to linear values.
pub(super) fn linear(rgb: [u8; 3]) -> [f32; 3] {
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
            let shown = ToneCurve { exposure: 1.0, ..ToneCurve::PAPER }.shown([
                1.5f32.powf(i as f32 / 100.0) - 1.0,
                0.2,
                0.1,
            ]);
            assert!(shown[0] > last && shown[0] <= 1.0, "step {i}: {} after {last}", shown[0]);
            last = shown[0];
        }
    }

    #[test]
    fn darks_and_middles_are_left_alone() {
        assert_eq!(ToneCurve { exposure: 2.0, ..ToneCurve::PAPER }.shown([0.05, 0.1, 0.2]), [0.1, 0.2, 0.4]);
    }

    #[test]
    fn highlights_go_towards_white_but_keep_their_order() {
        let [r, g, b] = ToneCurve { exposure: 1.0, ..ToneCurve::PAPER }.shown([18.0, 14.0, 6.0]);
        assert!(r > g && g > b && b > 0.5, "{r} {g} {b}");
    }

    #[test]
    fn most_of_a_picture_leaves_room_for_what_shines() {
        let values: Vec<f32> = (1..=100).map(|i| i as f32 * 0.01).collect();
        let exposure = ToneCurve::of(&[picture(&values)]).exposure;
        let below = values.iter().filter(|&&v| v * exposure <= 0.6 + 1e-6).count();
        assert!((69..=71).contains(&below), "{below} of 100");
        let black = ToneCurve::of(&[picture(&[0.0; 9])]).exposure;
        assert!(black.is_finite() && black <= 12.0, "{black:?}");
    }

    /// Whatever the strength of its light, a picture under a probe looks the same; lamps have one strength.
    #[test]
    fn under_a_probe_no_light_is_too_strong_or_too_weak() {
        let values: Vec<f32> = (1..=100).map(|i| i as f32 * 0.01).collect();
        for strength in [1e-6, 1e-3, 1.0, 60.0, 1e5, 1e20] {
            let lit = picture(&values.iter().map(|v| v * strength).collect::<Vec<_>>());
            let tone = ToneCurve::under_a_probe(std::slice::from_ref(&lit));
            let below = lit.pixels.iter().filter(|p| p[0] * tone.exposure <= 0.6 + 1e-5).count();
            assert!((69..=71).contains(&below), "{strength}: {below} of 100");
            let limited = ToneCurve::of(&[lit]).in_stops();
            assert!((-2.001..=2.001).contains(&limited), "{strength}: {limited}");
        }
        assert_eq!(ToneCurve::under_a_probe(&[picture(&[0.0; 9])]), ToneCurve::PAPER);
        assert_eq!(ToneCurve::under_a_probe(&[]), ToneCurve::PAPER);
    }

    /// What is a thirtieth of the brightest part looks like a thirtieth.
    #[test]
    fn a_view_keeps_the_ratios_of_its_target() {
        for strength in [1e-4, 1.0, 50.0] {
            let lit: Vec<f32> = [7.2; 40].into_iter().chain([0.24; 60]).map(|v| v * strength).collect();
            let tone = ToneCurve::of_view(&picture(&lit));
            let [bright, dark] = [lit[0], lit[99]].map(|v| tone.shown([v; 3])[0]);
            assert!(
                (bright - 0.8).abs() < 1e-6 && (dark * 30.0 / bright - 1.0).abs() < 1e-5,
                "{bright} {dark}"
            );
        }
        assert_eq!(ToneCurve::of_view(&picture(&[0.0; 9])).exposure, ToneCurve::PAPER.exposure);
    }

    #[test]
    fn with_the_knee_at_white_colours_are_kept_or_cut_off() {
        let cut = ToneCurve { exposure: 0.5, knee: 1.0 };
        assert_eq!(cut.shown([0.4, 1.0, 1.9]), [0.2, 0.5, 0.95]);
        let [r, g, b] = cut.shown([8.0, 4.0, 1.0]);
        assert_eq!([r, g], [1.0, 0.75], "half keeps the hue of the highlight, half turns white");
        assert!(b < g);
        assert!(ToneCurve { exposure: 1.0, knee: 0.0 }.shown([0.5, 0.2, 0.1])[0] < 0.5);
    }

    #[test]
    fn stops_double_the_exposure() {
        assert_eq!(ToneCurve::stops(1.0).exposure, 2.0 * ToneCurve::PAPER.exposure);
        assert!((ToneCurve::stops(-2.5).in_stops() + 2.5).abs() < 1e-6);
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
