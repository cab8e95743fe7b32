//! How much of a print's distance from its document the measurement of its stacks leaves open.
//!
//! Problem: a distance is worth chasing only where it is more than the curves themselves are uncertain by.
//! Method: in each column of a pixel's row the variances of the stacks' samples add up with the squares of their shares, and
//! the cube root takes the result into the metric's column: half the step from one standard deviation below to one above. A
//! column's squared difference counts as within the measurement as far as two such deviations reach.
//! Cost: a thousand sampled pixels, one sum over the stacks each. Neither figure depends on how errors of neighbouring samples
//! of a curve go together. Limits: errors of different stacks count as independent, so a grey card that is not what its
//! maker says is in neither; curves without standard deviations, such as modelled ones, count as exact.

use inks::Library;
use maths::Maths;
use serde::Serialize;

use super::mix::InkMix;
use crate::brdf::{Space, Table, reflectances};
use crate::gamut::sample;
use crate::materials::Materials;

/// Pixels that are compared: a thousand tell a root mean square to 2 or 3 %, and two figures are shown
/// (decisions/differences-within-the-measurement.md).
const SAMPLE: usize = 1024;
/// Standard deviations that are still no difference: two of them hold 95 % of a normal distribution's values.
const BAND: f64 = 2.0;

/// What the uncertainty of the curves means for a print.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DistanceUncertainty {
    /// Root mean square distance d of the sampled pixels from their mixtures.
    pub distance: f64,
    /// Root mean square distance d between the mixtures and what they may be: one standard deviation of every curve.
    pub deviation: f64,
    /// Share of the squared distance that lies within two standard deviations, in 0..=1.
    pub within: f64,
    /// Share of the print that stacks cover whose curves have standard deviations, in 0..=1.
    pub known: f64,
}

impl std::fmt::Display for DistanceUncertainty {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.0} % of the difference lies within your measurement: the curves' own uncertainty, known for {:.0} % of the print, \
             makes d = {:.3}",
            100.0 * self.within,
            100.0 * self.known,
            self.deviation
        )
    }
}

/// Compares sampled pixels of a document with their mixtures; `None` if no curve in use has standard deviations.
///
/// `mix` has the resolution of `pixels`, whose space is one of half angles.
pub fn distance_uncertainty(
    pixels: &dyn Materials,
    mix: &InkMix,
    library: &Library,
    seed: u64,
) -> Option<DistanceUncertainty> {
    let space = pixels.space();
    let curves = reflectances(&mix.stacks, library, space);
    let deviations: Vec<Option<Vec<f64>>> = mix
        .stacks
        .iter()
        .map(|stack| {
            let known = library.entry(stack)?.uncertainty.as_ref()?;
            Some(space.angles().iter().flat_map(|&theta| known.at(theta)).collect())
        })
        .collect();
    let sampled = sample::pixels(pixels.width() * pixels.height(), SAMPLE, seed);
    let wanted = sample::rows(pixels, &sampled);
    let mut shares = vec![0.0; mix.stacks.len()];
    let (mut all, mut own, mut within, mut known) = (0.0, 0.0, 0.0, 0.0);
    for (&pixel, wanted) in sampled.iter().zip(wanted.rows()) {
        mix.shares(pixel, &mut shares);
        known +=
            shares.iter().zip(&deviations).filter(|(_, d)| d.is_some()).map(|(share, _)| share).sum::<f64>();
        let (printed, sigma) = mixture(&shares, &curves, &deviations);
        for ((wanted, printed), sigma) in differences(space, wanted, &printed, &sigma) {
            let (apart, sigma) = (wanted - printed, BAND * sigma);
            all += apart * apart;
            own += (sigma / BAND).squared();
            within += apart.abs().min(sigma).squared();
        }
    }
    let count = sampled.len() as f64;
    (known > 0.0).then(|| DistanceUncertainty {
        distance: (all / count).sqrt(),
        deviation: (own / count).sqrt(),
        within: if all > 0.0 { within / all } else { 1.0 },
        known: (known / count).min(1.0),
    })
}

/// What a mixture reflects, and its standard deviation, column by column.
fn mixture(shares: &[f64], curves: &Table, deviations: &[Option<Vec<f64>>]) -> (Vec<f64>, Vec<f64>) {
    let (mut printed, mut variance) = (vec![0.0; curves.columns()], vec![0.0; curves.columns()]);
    for ((&share, curve), deviation) in shares.iter().zip(curves.rows()).zip(deviations) {
        printed.iter_mut().zip(curve).for_each(|(sum, f)| *sum += share * f);
        for (sum, sigma) in variance.iter_mut().zip(deviation.iter().flatten()) {
            *sum += (share * sigma).squared();
        }
    }
    variance.iter_mut().for_each(|v| *v = v.sqrt());
    (printed, variance)
}

/// Document, print and the print's standard deviation in the metric's columns.
fn differences<'a>(
    space: &'a Space,
    wanted: &'a [f64],
    printed: &'a [f64],
    sigma: &'a [f64],
) -> impl Iterator<Item = ((f64, f64), f64)> + 'a {
    let columns = space.radiance().iter().zip(space.weight());
    columns.zip(wanted.iter().zip(printed.iter().zip(sigma))).map(
        |((&c, &weight), (&wanted, (&printed, &sigma)))| {
            let seen = |f: f64| weight * (f.max(0.0) * c).cube_root();
            ((seen(wanted), seen(printed)), 0.5 * (seen(printed + sigma) - seen(printed - sigma)))
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gamut::{GamutSettings, Printable, clamped};
    use crate::materials::Surface;
    use files::shelf::Disk;
    use inks::Stack;
    use observe::Silent;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::fmt::Write as _;

    const STACKS: [&str; 5] = ["substrate", "C", "M+C", "MS", "MS+Y"];

    /// A library of these stacks as modelled, each sample uncertain by a share of its value that depends on stack and angle.
    fn library(relative: impl Fn(usize, f64) -> f64) -> Library {
        let folder = tempfile::tempdir().unwrap();
        let mut text = "format = 1\nbased_on = \"built-in\"\n".to_owned();
        for (q, stack) in STACKS.iter().enumerate() {
            let lobes = Library::builtin().optics().lobes(&stack.parse().unwrap()).unwrap();
            let mut rows = "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma\n".to_owned();
            for i in 0..=180 {
                let theta = f64::from(i).powi(2) / 360.0;
                let [r, g, b] = lobes.at(theta.to_radians());
                let s = relative(q, theta);
                let _ = writeln!(rows, "{theta},{r:e},{g:e},{b:e},{:e},{:e},{:e}", s * r, s * g, s * b);
            }
            std::fs::write(folder.path().join(format!("{q}.csv")), rows).unwrap();
            let _ = writeln!(
                text,
                "[[measured]]\nstack = \"{stack}\"\ncurve = \"{q}.csv\"\nby = \"nobody\"\nwhen = \"2026-11\"\nsetup = \"made up\""
            );
        }
        std::fs::write(folder.path().join("library.toml"), text).unwrap();
        Library::open(&Disk, folder.path()).unwrap()
    }

    /// 8 x 8 materials from dark to light and from dull to glossy, some of them beyond what the stacks reach.
    struct MeasuredDocument(Space);

    impl Materials for MeasuredDocument {
        fn width(&self) -> usize {
            8
        }
        fn height(&self) -> usize {
            8
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            let (u, v) = ((pixel % 8) as f32 / 7.0, (pixel / 8) as f32 / 7.0);
            let surface = Surface {
                diffuse: [0.8 * u, 0.7 * u, 0.3 + 0.3 * u],
                f0: [0.04 + 0.4 * v; 3],
                alpha: 0.4 - 0.2 * v,
            };
            let row = self.0.row(&surface.curve(self.0.angles()));
            out.iter_mut().zip(row).for_each(|(out, f)| *out = f as f32);
        }
    }

    fn document() -> MeasuredDocument {
        MeasuredDocument(Space::half_angle(32))
    }

    fn mapped(library: &Library, document: &MeasuredDocument) -> InkMix {
        let stacks: Vec<Stack> = STACKS.map(|stack| stack.parse().unwrap()).to_vec();
        let rows = reflectances(&stacks, library, document.space());
        clamped(document, &Printable::new(stacks, rows), &GamutSettings::default(), &Silent).unwrap().mix
    }

    fn normal(random: &mut impl Rng) -> f64 {
        let (u, v): (f64, f64) = (random.random(), random.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Curves are drawn from their deviations, and prints compared without any formula for how these go on.
    #[test]
    fn drawn_curves_agree_with_the_propagated_deviation() {
        let library = library(|q, theta| 0.03 + 0.02 * q as f64 + if theta < 5.0 { 0.05 } else { 0.0 });
        let document = document();
        let mix = mapped(&library, &document);
        let found = distance_uncertainty(&document, &mix, &library, 1).unwrap();
        let space = document.space();
        let curves = reflectances(&mix.stacks, &library, space);
        let pixels: Vec<usize> = (0..64).collect();
        let (wanted, printed) = (sample::rows(&document, &pixels), sample::printed(&mix, &curves, &pixels));
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut squares = vec![vec![0.0; space.columns()]; 64];
        const DRAWS: usize = 600;
        let mut moved = 0.0;
        for _ in 0..DRAWS {
            let mut drawn = Table::new(space.columns());
            for (stack, row) in mix.stacks.iter().zip(curves.rows()) {
                let known = library.entry(stack).unwrap().uncertainty.as_ref().unwrap();
                let sigma = space.angles().iter().flat_map(|&theta| known.at(theta));
                drawn.push(
                    &row.iter().zip(sigma).map(|(f, s)| f + s * normal(&mut random)).collect::<Vec<_>>(),
                );
            }
            for ((may, is), squares) in
                sample::printed(&mix, &drawn, &pixels).rows().zip(printed.rows()).zip(&mut squares)
            {
                moved += space.distance(may, is).powi(2);
                for ((a, b), square) in space.seen(may).iter().zip(space.seen(is)).zip(squares) {
                    *square += (a - b).powi(2) / DRAWS as f64;
                }
            }
        }
        let moved = (moved / (DRAWS * 64) as f64).sqrt();
        let (mut all, mut within) = (0.0, 0.0);
        for ((wanted, printed), squares) in wanted.rows().zip(printed.rows()).zip(&squares) {
            for ((a, b), square) in space.seen(wanted).iter().zip(space.seen(printed)).zip(squares) {
                all += (a - b).powi(2);
                within += (a - b).powi(2).min(4.0 * square);
            }
        }
        println!("drawn: {moved:.5}, {:.4} within; {found:?}", within / all);
        assert!((found.deviation / moved - 1.0).abs() < 0.02, "{moved} {found:?}");
        assert!(
            (found.within - within / all).abs() < 0.01 && (0.05..0.95).contains(&found.within),
            "{within} {all} {found:?}"
        );
        assert!((found.distance - (all / 64.0f64).sqrt()).abs() < 1e-9 && (found.known - 1.0).abs() < 1e-9);
    }

    /// Exact curves leave nothing open, useless ones leave everything, and modelled ones say nothing.
    #[test]
    fn the_share_goes_from_nothing_to_everything() {
        let document = document();
        let of = |library: &Library| distance_uncertainty(&document, &mapped(library, &document), library, 1);
        let exact = of(&library(|_, _| 0.0)).unwrap();
        assert_eq!((exact.deviation, exact.within), (0.0, 0.0));
        let vague = of(&library(|_, _| 5.0)).unwrap();
        assert!(vague.within > 0.999, "{vague:?}");
        assert_eq!(of(&Library::builtin()), None);
        let words =
            DistanceUncertainty { distance: 0.03, deviation: 0.006, within: 0.124, known: 0.96 }.to_string();
        assert!(
            words.starts_with("12 % of the difference") && words.contains("96 %") && words.contains("0.006"),
            "{words}"
        );
    }
}
