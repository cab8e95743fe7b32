//! Dark gloss keeps its hue, and what that costs.

use super::*;
use crate::brdf::reflectances;
use crate::gamut::candidates::Candidates;
use crate::gamut::fitting::clamp;
use crate::gamut::settings::LIGHT;

const SIDE: usize = 16;

/// Panes of dark metal, F0 from .05 to .14 down the page, roughness from .14 to .45 across it, a little
/// bluish.
fn panes(space: &Space) -> Table {
    let mut rows = Table::new(space.columns());
    for pane in 0..SIDE * SIDE {
        let at = |i: usize| i as f32 / (SIDE - 1) as f32;
        let (rough, f0) = (0.14 + 0.31 * at(pane % SIDE), 0.05 + 0.09 * at(pane / SIDE));
        let surface =
            Surface { diffuse: [0.0; 3], f0: [0.75, 0.9, 1.0].map(|c| c * f0), alpha: rough * rough };
        rows.push(&space.row(&surface.curve(space.angles())));
    }
    rows
}

/// What all panes look like, root mean square, and R/G and B/G at 60 degrees of each as a multiple of what
/// they should be, with `times` the constants of [`Hull::with_constants`](crate::solve::Hull).
fn printed(inks: &str, times: [f64; 5]) -> (f64, Vec<[f64; 2]>) {
    let (space, library) = (Space::half_angle(32), Library::builtin());
    let panes = panes(&space);
    let printable = Printable::combined(&library, &inks.parse().unwrap(), &space);
    let mut all = Candidates::new(&space, &printable, LIGHT).unwrap();
    all.priced = all.priced.with_constants(times).in_clusters(&printable.clusters);
    let made = clamp::rows(&all, &panes).unwrap();
    let n = space.angles().iter().position(|t| t.to_degrees() > 60.0).unwrap();
    let both = || made.rows().zip(panes.rows());
    let squared = |(made, pane): (&[f64], &[f64])| {
        space.distance(made, pane).powi(2) + (LIGHT * space.light_distance(made, pane)).powi(2)
    };
    let squares: f64 = both().map(squared).sum();
    let off = |(made, pane): (&[f64], &[f64])| {
        [0, 2].map(|c| made[3 * n + c] / made[3 * n + 1] / (pane[3 * n + c] / pane[3 * n + 1]))
    };
    ((squares / panes.len() as f64).sqrt(), both().map(off).collect())
}

#[test]
fn dark_panes_keep_their_hue() {
    for inks in ["K,MM,MC,MS,F,P", "K,Y,MM,MC,F,P,SF"] {
        let (before, off) = printed(inks, [0.0, 1.0, 1.0, 1.0, 0.0]);
        assert!(off.iter().flatten().any(|&r| r > 2.0), "without hue: {off:?}");
        let (_, off) = printed(inks, [1.0; 5]);
        // A fifth more or less of any constant keeps the promises, and nearly the same hues.
        let moved =
            (0..10).map(|i| std::array::from_fn(|n| if n == i / 2 { [0.8, 1.2][i % 2] } else { 1.0 }));
        for times in moved.chain([[1.0; 5]]) {
            let (after, ratios) = printed(inks, times);
            assert!(ratios.iter().flatten().all(|r| (0.5..1.5).contains(r)), "{inks} {times:?}: {ratios:?}");
            let all = || ratios.iter().flatten().zip(off.iter().flatten());
            let most = all().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let mean = all().map(|(a, b)| (a - b).abs()).sum::<f64>() / all().count() as f64;
            println!("{inks} {times:?}: {after} of {before}, moved by {mean}, at most {most}");
            // What keeping the hue of the dark costs the rest.
            assert!(after <= 1.25 * before, "{inks} {times:?}: {after} {before}");
            // Beside and below each pane is one of nearly the same hue.
            for (i, r) in ratios.iter().enumerate() {
                let next = [(i % SIDE + 1 < SIDE, i + 1), (i / SIDE + 1 < SIDE, i + SIDE)];
                for (_, j) in next.into_iter().filter(|(inside, _)| *inside) {
                    let steps = std::array::from_fn::<f64, 2, _>(|c| ratios[j][c] / r[c]);
                    assert!(
                        steps.iter().all(|s| (0.8..1.25).contains(s)),
                        "{inks} {times:?}: {i} {j} {steps:?}"
                    );
                }
            }
        }
    }
}

/// The chosen cartridges of the whole mapping, not only those named above.
#[test]
fn mapped_dark_panes_keep_their_hue() {
    struct Panes(Space, Table);
    impl Materials for Panes {
        fn width(&self) -> usize {
            SIDE
        }
        fn height(&self) -> usize {
            SIDE
        }
        fn space(&self) -> &Space {
            &self.0
        }
        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            out.iter_mut().zip(self.1.row(pixel)).for_each(|(out, &f)| *out = f as f32);
        }
    }
    let (space, library) = (Space::half_angle(32), Library::builtin());
    let pixels = Panes(space.clone(), panes(&space));
    let n = space.angles().iter().position(|t| t.to_degrees() > 60.0).unwrap();
    for inks in [InkSet::default(), InkSet::of(Ink::ALL)] {
        let printable = Printable::combined(&library, &inks, &space);
        let mapped = clamped(&pixels, &printable, &GamutSettings::default(), &Silent).unwrap();
        let stacks = reflectances(&mapped.mix.stacks, &library, &space);
        let mut shares = vec![0.0; stacks.len()];
        for pane in 0..SIDE * SIDE {
            mapped.mix.shares(pane, &mut shares);
            let at = |c: usize| stacks.rows().zip(&shares).map(|(row, s)| s * row[3 * n + c]).sum::<f64>();
            let ratios = [at(0) / at(1) * 0.9 / 0.75, at(2) / at(1) * 0.9];
            assert!(
                ratios.iter().all(|r| (0.5..1.5).contains(r)),
                "{pane}: {ratios:?}, of {:?}",
                mapped.report.cartridges
            );
        }
    }
}
