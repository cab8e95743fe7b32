//! Two exposures of one picture with more light than white: what an HDR print shows in its two views.
//!
//! Method: straight on the print shows the exposure that gives the logarithmic mean of the luminance 18 %
//! (Reinhard et al. 2002, equations 1 and 2), whose lights are burnt out. In the reflection it shows the
//! one at which the brightest thousandth begins to burn out, whose shadows are black. Between the two the
//! print mixes them, so its exposure changes with the tilt.
//! Limits: two exposures, clipped; no local tone mapping.

use maths::Maths;

/// The luminance of the logarithmic mean: middle grey. Source: Reinhard and others 2002, section 3.
const KEY: f64 = 0.18;

/// The part of the pixels that may burn out in the short exposure.
const BURNT: f64 = 0.001;

/// Two factors of the luminance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exposures {
    pub long: f64,
    pub short: f64,
}

impl Exposures {
    /// The exposures of a picture with this luminance, if it has any light.
    pub(super) fn of(luminance: &[f64]) -> Option<Exposures> {
        Exposures::burning(luminance, BURNT)
    }

    /// The same where this part of the pixels may burn out in the short exposure.
    fn burning(luminance: &[f64], burnt: f64) -> Option<Exposures> {
        let mut lit: Vec<f64> = luminance.iter().copied().filter(|&y| y > 0.0).collect();
        lit.sort_unstable_by(f64::total_cmp);
        let last = lit.len().checked_sub(1)?;
        let mean = (lit.iter().map(|y| y.logarithm()).sum::<f64>() / lit.len() as f64).exponential();
        let brightest = lit[last - (burnt * last as f64) as usize];
        Some(Exposures { long: KEY / mean, short: 1.0 / brightest })
    }

    /// How far the exposures lie apart, in stops.
    pub(super) fn stops(self) -> f64 {
        (self.long / self.short).logarithm2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part that may burn out moved by a fifth moves the short exposure by less than a third of a stop,
    /// the step of cameras, in measured panoramas, whose sun or lamps cover more or less than that.
    #[test]
    fn the_part_that_may_burn_out_hardly_matters() {
        let Some(data) = testing::needs::data() else { return };
        for name in ["studio.hdr", "venice.hdr"] {
            let picture = image::open(data.join("env").join(name)).unwrap().into_rgb32f();
            let luminance = |p: &image::Rgb<f32>| crate::srgb::luminance(p.0.map(f64::from));
            let luminance: Vec<f64> = picture.pixels().map(luminance).collect();
            let stops = [0.8, 1.0, 1.2]
                .map(|factor| Exposures::burning(&luminance, factor * BURNT).unwrap().short.log2());
            println!("{name}: {stops:.2?}");
            assert!(stops.iter().all(|s| (s - stops[1]).abs() < 1.0 / 3.0), "{name}: {stops:?}");
            // Ten times as many would be seen.
            let many = Exposures::burning(&luminance, 10.0 * BURNT).unwrap().short.log2();
            assert!(many - stops[1] > 0.5, "{name}: {many}");
        }
    }

    #[test]
    fn a_sun_over_a_dark_room_is_told_from_a_grey_wall() {
        // Nine in ten pixels at .01, one at 4: ln mean is .01 * 400^.1.
        let room: Vec<f64> = (0..2000).map(|i| if i % 10 == 0 { 4.0 } else { 0.01 }).collect();
        let found = Exposures::of(&room).unwrap();
        assert!(
            (found.long - 0.18 / (0.01 * 400f64.powf(0.1))).abs() < 1e-9 && (found.short - 0.25).abs() < 1e-9
        );
        assert!((found.stops() - (found.long * 4.0).log2()).abs() < 1e-9);
        // One pixel of two thousand is less than a thousandth, and does not count.
        let mut spark = vec![0.5; 2001];
        spark[7] = 1e6;
        assert!((Exposures::of(&spark).unwrap().short - 2.0).abs() < 1e-9);
        assert!(Exposures::of(&[0.5; 9]).unwrap().stops() < 0.0);
        assert_eq!(Exposures::of(&[0.0; 4]), None);
    }
}
