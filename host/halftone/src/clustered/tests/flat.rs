//! Flat tones neither repeat nor swing from row to row or column to column.

use super::*;

/// What chance makes of the largest of many autocorrelations where clusters of `side` x `side` dots have no order: each has a
/// deviation of one over the root of their number, and the largest of m is about the root of 2 ln m of these. Order within a few
/// clusters widens the deviation up to 1.6 times (Bartlett's sum of squares of the autocorrelation).
fn chance((wide, high): (usize, usize), side: usize, far: usize) -> f64 {
    let clusters = ((wide - far) * (high - far) / (side * side)) as f64;
    let lags = 0.5 * std::f64::consts::PI * (far as f64 / side as f64).powi(2);
    (2.0 * lags.ln() / clusters).sqrt()
}

/// The largest autocorrelation of each stack beyond the scale of its own clusters: three mean spacings of it or, where it is most of
/// the tone, of what is not. Fails where it is above 0.1 and chance.
fn check_peaks(mix: &InkMix, settings: &Settings, shares: &[f64], (wide, high): (usize, usize), side: usize) {
    let sheet = halftone(mix, (wide as u16, high as u16), None, settings, &Silent).unwrap();
    let far = wide.min(high) / 4;
    for (stack, &share) in shares.iter().enumerate() {
        let near = 3.0 * side as f64 / share.min(1.0 - share).sqrt();
        let (most, lag) = peak(wide, sheet.index(), stack as u8, near, far);
        let bound = 0.1 + chance((wide, high), side, far);
        assert!(
            most < bound,
            "{shares:.2?}, {wide} x {high}: {stack} repeats by {most:.3} at {lag:?}, over {bound:.3}"
        );
        if side == 4 {
            let (rows, columns) = swing(wide, sheet.index(), stack as u8, side);
            assert!(rows < 1.15 && columns < 1.15, "{shares:.2?}: {stack} swings by {rows:.2}, {columns:.2}");
        }
    }
}

/// A flat mixture of stacks with a minimum of 9, all equally far apart.
fn even(shares: &[f64]) -> (InkMix, Settings) {
    let settings = Settings { method: Method::Cells, minimum: vec![9; shares.len()], reflectance: None };
    (plain(1, 1, shares.len(), |_, _| shares.to_vec()), settings)
}

/// A flat mixture of paper, metal and ink, by what they reflect.
fn metallic(names: [&str; 3], shares: &[f64]) -> (InkMix, Settings) {
    let mut mix = plain(1, 1, 3, |_, _| shares.to_vec());
    mix.stacks = names.map(|name| name.parse().unwrap()).to_vec();
    let settings = Settings::from_library(&mix.stacks, &Library::builtin());
    (mix, settings)
}

/// Flat mixtures of stacks with different minima.
#[test]
fn flat_halves_do_not_repeat() {
    let third = 1.0 / 3.0;
    for (names, shares) in [
        (["substrate", "SF", "K"], [0.5, 0.3, 0.2]),
        (["substrate", "SF", "K"], [third; 3]),
        (["substrate", "SF", "K"], [0.5, 0.25, 0.25]),
        (["substrate", "SF", "K"], [0.7, 0.1, 0.2]),
        (["substrate", "MS", "K"], [0.25, 0.5, 0.25]),
        (["substrate", "MS", "Y"], [0.48, 0.04, 0.48]),
        (["substrate", "MS", "K"], [0.05, 0.48, 0.47]),
        (["substrate", "MS", "K"], [0.72, 0.03, 0.25]),
    ] {
        let (mix, settings) = metallic(names, &shares);
        for size in [(528, 528), (636, 492)] {
            check_peaks(&mix, &settings, &shares, size, 4);
        }
    }
}

/// On a page where chance adds a hundredth, what had the largest autocorrelations on 15 sizes of page stays below the 0.1.
#[test]
fn nothing_repeats_where_chance_is_small() {
    const SIDE: usize = 1536;
    let silver = [0.25, 0.5, 0.25];
    for (shares, (mix, settings), side) in [
        (&[0.48, 0.46, 0.06][..], even(&[0.48, 0.46, 0.06]), 3),
        (&[0.75, 0.25], even(&[0.75, 0.25]), 3),
        (&silver, metallic(["substrate", "MS", "K"], &silver), 4),
    ] {
        let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
        let common = (0..shares.len()).max_by(|&a, &b| shares[a].total_cmp(&shares[b])).unwrap();
        let near = 3.0 * side as f64 / shares[common].min(1.0 - shares[common]).sqrt();
        let (most, lag) = peak(SIDE, sheet.index(), common as u8, near, 132);
        assert!(most < 0.1, "{shares:?}: {common} repeats by {most:.3} at {lag:?}");
        let (beyond, lag) = peak(SIDE, sheet.index(), common as u8, 30.0, 132);
        let by_chance = 1.6 * chance((SIDE, SIDE), side, 132);
        assert!(
            beyond < by_chance,
            "{shares:?}: {common} repeats by {beyond:.4} at {lag:?}, by chance {by_chance:.4}"
        );
    }
}

proptest! {
    #![proptest_config(testing::cases(8))]
    /// Flat mixtures of any tones: the ink of whole columns and rows varies no more than that of independent cells.
    #[test]
    fn columns_and_rows_of_flat_tones_are_even(
        names in prop::sample::subsequence(vec!["SF", "C", "M", "Y", "K"], 1..4),
        shares in prop::collection::vec(0.1f64..1.0, 4),
        searched in any::<bool>(),
    ) {
        const SIDE: usize = 600;
        let shares = &shares[..=names.len()];
        let mix = plain(1, 1, shares.len(), |_, _| shares.iter().map(|share| share / shares.iter().sum::<f64>()).collect());
        let stacks = std::iter::once("substrate").chain(names).map(|name| name.parse().unwrap()).collect();
        let mix = InkMix { stacks, ..mix };
        let method = if searched { Method::Best } else { Method::Cells };
        let settings = Settings { method, ..Settings::from_library(&mix.stacks, &Library::builtin()) };
        let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
        let side = settings.minimum.iter().map(|&minimum| size_of(minimum)).max().unwrap();
        for stack in 0..shares.len() {
            let (rows, columns) = swing(SIDE, sheet.index(), stack as u8, side);
            prop_assert!(rows < 1.05 && columns < 1.05, "{} swings by {rows:.2} and {columns:.2}", mix.stacks[stack]);
        }
    }
}

/// Exact weights repeat on tones near simple fractions: a half becomes a checkerboard. And where debts begin at nothing and
/// stay inside a tone, it begins too light, and its last row prints what is left.
#[test]
fn flat_tones_neither_repeat_nor_change_at_their_border() {
    const SIDE: usize = 510;
    for tone in [0.02, 0.1, 0.2, 0.25, 1.0 / 3.0, 0.4, 0.45, 0.47, 0.48, 0.49, 0.5] {
        let (mix, settings) = even(&[1.0 - tone, tone]);
        let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
        let dots = sheet.index();
        let (most, lag) = peak(SIDE, dots, 1, 9.0 / tone.sqrt(), SIDE / 4);
        assert!(most < 0.1, "{tone} repeats by {most:.3} at {lag:?}");
        let (rows, columns) = swing(SIDE, dots, 1, 3);
        assert!(rows < 1.1 && columns < 1.1, "{tone} swings by {rows:.2} and {columns:.2}");
        // Three rows of cells along either side, against independent cells.
        let inked = |at: &dyn Fn(usize, usize) -> bool| {
            (0..dots.len()).filter(|&dot| dots[dot] == 1 && at(dot % SIDE, dot / SIDE)).count() as f64 / 9.0
        };
        let cells = (SIDE / 3 * 3) as f64;
        let spread = 3.0 * (cells * tone * (1.0 - tone)).sqrt();
        for (side, count) in [
            ("top", inked(&|_, y| y < 9)),
            ("bottom", inked(&|_, y| y >= SIDE - 9)),
            ("left", inked(&|x, _| x < 9)),
            ("right", inked(&|x, _| x >= SIDE - 9)),
        ] {
            assert!(
                (count - cells * tone).abs() < spread,
                "{tone} at the {side}: {count} of {}",
                cells * tone
            );
        }
    }
}

#[test]
fn flat_mixtures_do_not_repeat() {
    let third = 1.0 / 3.0;
    for shares in [
        &[0.75, 0.25][..],
        &[2.0 * third, third],
        &[third; 3],
        &[0.5, 0.25, 0.25],
        &[0.5, 0.3, 0.2],
        &[0.4, 0.4, 0.2],
        &[0.48, 0.46, 0.06],
        &[0.5, 0.4, 0.1],
        &[0.25; 4],
        &[0.2; 5],
        &[0.3, 0.25, 0.2, 0.15, 0.1],
    ] {
        let (mix, settings) = even(shares);
        for size in [(510, 510), (636, 492)] {
            check_peaks(&mix, &settings, shares, size, 3);
        }
    }
}
