//! Where tones begin and end: the first and last rows and columns of pages and strips, by counting dots.

use super::*;

/// Strips begin like any other row: the tone of the rows at a border of strips is what it is elsewhere.
#[test]
fn strips_leave_no_seams() {
    let mix = plain(1, 1, 3, |_, _| vec![0.85, 0.05, 0.1]);
    let (width, height) = (2400, 1600);
    let seam = super::super::STRIP * super::super::mask::BLOCK;
    let dots = cells(&mix, (width, height), &[9, 9, 9], None, &Silent);
    let tone = |row: usize| {
        let rows = &dots[row * width..(row + 24) * width];
        rows.iter().filter(|&&s| s == 2).count() as f64 / rows.len() as f64
    };
    let worst = |rows: &[usize]| rows.iter().map(|&row| (tone(row) - 0.1).abs()).fold(0.0, f64::max);
    let inside: Vec<usize> =
        (48..1536).step_by(24).filter(|row| !(seam - 68..seam + 62).contains(row)).collect();
    let (inside, at_seam) = (worst(&inside), worst(&[seam - 24, seam - 12, seam, seam + 12]));
    assert!(inside < 0.006 && at_seam < 0.006, "inside {inside}, at the seam {at_seam}");
}

/// A faint tone is there from the first rows of a page and of a strip.
#[test]
fn faint_tones_begin_where_they_begin() {
    let mix = plain(1, 1, 2, |_, _| vec![0.98, 0.02]);
    let seam = super::super::STRIP * super::super::mask::BLOCK;
    let (width, height) = (4800, seam + 72);
    let dots = cells(&mix, (width, height), &[9, 9], None, &Silent);
    for top in [0, 24, seam - 24, seam, seam + 24] {
        let rows = &dots[top * width..(top + 24) * width];
        let share = rows.iter().filter(|&&dot| dot == 1).count() as f64 / rows.len() as f64;
        assert!((0.015..0.025).contains(&share), "rows from {top}: {share}");
    }
}

/// Flat materials of the kind that is measured, as points of the stacks that the program chooses for them: some paper, far
/// from what is printed beside it, and inks that look alike. Shares, then points.
type Material = (&'static str, &'static [f64], &'static [Point]);

const MATERIALS: [Material; 4] = [
    (
        "green phenolic",
        &[0.0058, 0.0553, 0.1275, 0.8114],
        &[[0.0; 4], [-3.823, 0.202, 0.0, 0.0], [-3.933, -0.097, 0.017, 0.0], [-3.956, -0.098, -0.017, 0.0]],
    ),
    (
        "green plastic",
        &[0.0092, 0.0999, 0.1874, 0.5663, 0.1372],
        &[
            [0.0; 4],
            [-2.118, 0.311, 0.004, 0.0],
            [-2.223, -0.084, -0.091, 0.0],
            [-2.266, -0.101, 0.043, 0.013],
            [-2.277, -0.106, 0.042, -0.013],
        ],
    ),
    (
        "dark red paint",
        &[0.0131, 0.0104, 0.3260, 0.6505],
        &[[0.0; 4], [-1.759, 0.569, 0.004, 0.0], [-2.102, -0.223, -0.111, 0.0], [-2.114, -0.252, 0.107, 0.0]],
    ),
    (
        "fruitwood",
        &[0.0210, 0.0174, 0.8834, 0.0782],
        &[[0.0; 4], [1.744, -0.412, 0.0, 0.0], [1.935, 0.185, -0.009, 0.0], [1.948, 0.185, 0.009, 0.0]],
    ),
];

/// The dots of a material without the search.
fn printed(shares: &[f64], points: &[Point], size: (usize, usize)) -> Vec<u8> {
    let mix = plain(1, 1, shares.len(), |_, _| shares.to_vec());
    let solids = Solids::new(&mix, size.0, size.1, None);
    super::super::cells(&mix, size, &vec![9; shares.len()], &solids, Some(points), false, &Silent)
}

/// A rare stack far from the others is printed from the first row of cells to the last, which also owns what is less than a cell, and in the rows after a seam of strips.
#[test]
fn rare_stacks_far_from_others_keep_their_share_at_borders() {
    for (name, shares, points) in MATERIALS {
        let part = |dots: &[u8], stack: usize| {
            dots.iter().filter(|&&dot| usize::from(dot) == stack).count() as f64
                / dots.len() as f64
                / shares[stack]
        };
        let rare: Vec<usize> = (0..shares.len()).filter(|&q| shares[q] < 0.06).collect();
        let mut bad = Vec::new();
        let mut check = |place: &str, stack: usize, part: f64, within: f64| {
            if (part - 1.0).abs() > within {
                bad.push(format!("{name}, {place}: {part:.2} of {stack}"));
            }
        };
        let (long, height) = (24_000, 100);
        let dots = printed(shares, points, (long, height));
        for &stack in &rare {
            for (place, rows) in [("first row", 0..3), ("second row", 3..6), ("last row", height - 4..height)]
            {
                check(place, stack, part(&dots[rows.start * long..rows.end * long], stack), 0.3);
            }
        }
        let (width, seam) = (12_000, super::super::STRIP * super::super::mask::BLOCK);
        let dots = printed(shares, points, (width, seam + 60));
        for &stack in &rare {
            for top in (seam - 24..seam + 60).step_by(12) {
                check(
                    &format!("12 rows from {top}"),
                    stack,
                    part(&dots[top * width..(top + 12) * width], stack),
                    0.15,
                );
            }
        }
        assert!(bad.is_empty(), "{bad:#?}");
    }
}

/// The mean debts that are assumed beyond borders are those in the midst of a tone.
#[test]
fn usual_debts_are_those_in_the_midst_of_a_tone() {
    for (name, shares, points) in MATERIALS {
        let (width, height) = (2400, 1200);
        let mix = plain(1, 1, shares.len(), |_, _| shares.to_vec());
        let solids = Solids::new(&mix, width, height, None);
        let field = super::super::field::Field::new(&mix, width, height, &[3, 24], &solids);
        let metric = super::super::Metric::new(field.lanes, &field.mean(), Some(points));
        let least = vec![9; shares.len()];
        let plan = super::super::Plan::new(&field, &least, &mut vec![0; width * height]);
        let mut strip = super::super::Strip::new(&field, &plan, &metric, &least);
        let mut mean = vec![0.0; shares.len()];
        for row in 0..height / 24 - 1 {
            strip.block_row(row, &mut super::super::Target { rows: None, top: 0 });
            if row >= 10 {
                let debts = strip.mean_debts();
                mean.iter_mut()
                    .zip(debts)
                    .for_each(|(mean, debt)| *mean += debt / 9.0 / (height / 24 - 11) as f64);
            }
        }
        let want: Vec<f32> = shares.iter().map(|&share| 9.0 * share as f32).collect();
        let differs = |metric| {
            let usual = super::super::border::Usual::new(metric, &want, 9, &[]);
            let debts: Vec<f64> = (0..want.len()).map(|q| f64::from(usual.of(q, want[q])) / 9.0).collect();
            debts.iter().zip(&mean).map(|(debt, mean)| (debt - mean).abs()).fold(0.0, f64::max)
        };
        let (leaning, even) = (differs(Some(&metric)), differs(None));
        assert!(
            leaning < 0.13 && leaning < 0.6 * even,
            "{name}: {leaning:.3} of a cell, {even:.3} by equal distances; {mean:.3?}"
        );
    }
}

/// The first and last columns of a narrow sheet print what is asked from the first rows of a strip on: rows go on beyond the page.
#[test]
fn faint_tones_are_kept_in_the_first_and_last_columns() {
    const ACROSS: usize = 33;
    let (width, strips) = (3 * ACROSS, 200);
    let strip = super::super::STRIP * super::super::mask::BLOCK;
    let (_, rare, points) = MATERIALS[0];
    let faint: (&[f64], Option<&[Point]>) = (&[0.03, 0.97], None);
    for (shares, points) in [faint, (rare, Some(points))] {
        let mix = plain(1, 1, shares.len(), |_, _| shares.to_vec());
        let size = (width, strip * strips);
        let solids = Solids::new(&mix, size.0, size.1, None);
        let dots = super::super::cells(&mix, size, &vec![9; shares.len()], &solids, points, false, &Silent);
        // 96 rows of dots of each strip, of columns of cells as far from either side.
        let count = |column: usize| {
            let near = |x: usize| x / 3 == column || x / 3 == ACROSS - 1 - column;
            let rows = (0..strips).flat_map(|i| strip * i..strip * i + 96);
            let inked = rows.map(|y| (0..width).filter(|&x| near(x) && dots[y * width + x] == 0).count());
            inked.sum::<usize>() as f64 / (strips * 96 * 6) as f64 / shares[0]
        };
        let parts: Vec<f64> = (0..6).map(count).collect();
        assert!(parts.iter().all(|part| (part - 1.0).abs() < 0.3), "{shares:?}: {parts:.2?}");
    }
}

/// Cells that own what the border of the page cuts off are cut into halves like all others: the last rows and columns change as often along
/// the border as those in the midst.
#[test]
fn the_rim_is_as_fine_as_the_rest() {
    const LONG: usize = 6000;
    for rest in 0..4 {
        let short = 120 + rest;
        let asked = |along: usize| {
            let t = 0.05 * (along as f64 / 3.0).sin();
            vec![0.4 + t, 0.35 - t, 0.25]
        };
        let below = plain(LONG / 6, 1, 3, |x, _| asked(x));
        let dots = cells(&below, (LONG, short), &[8; 3], None, &Silent);
        let changes = |y: usize| (1..LONG).filter(|&x| dots[y * LONG + x] != dots[y * LONG + x - 1]).count();
        let inside = (40..80).map(changes).sum::<usize>() as f64 / 40.0;
        assert!(changes(short - 1) as f64 > 0.9 * inside, "below {rest}: {} of {inside}", changes(short - 1));
        assert_eq!(thin(LONG, &dots, |_| 8, |_| false), 0);
        let beside = plain(1, LONG / 6, 3, |_, y| asked(y));
        let dots = cells(&beside, (short, LONG), &[8; 3], None, &Silent);
        let changes =
            |x: usize| (1..LONG).filter(|&y| dots[y * short + x] != dots[(y - 1) * short + x]).count();
        let inside = (40..80).map(changes).sum::<usize>() as f64 / 40.0;
        assert!(
            changes(short - 1) as f64 > 0.9 * inside,
            "beside {rest}: {} of {inside}",
            changes(short - 1)
        );
        assert_eq!(thin(short, &dots, |_| 8, |_| false), 0);
    }
}

/// Where cells may be cut into halves, the first and last rows of cells have the ink of the tone, all stacks equally far apart: in
/// a document that varies, and beside foil, which takes whole cells.
#[test]
fn tones_of_cells_that_may_be_cut_begin_and_end_with_their_ink() {
    const LONG: usize = 12_000;
    for (shares, minimum, varies, within) in [
        (vec![0.97, 0.03], vec![8; 2], 0.003, 0.2),
        (vec![0.88, 0.12], vec![8; 2], 0.003, 0.08),
        (vec![0.88, 0.12], vec![8; 2], 0.02, 0.08),
        (vec![0.75, 0.25], vec![8; 2], 0.02, 0.05),
        (vec![0.8, 0.1, 0.1], vec![8; 3], 0.01, 0.08),
        (vec![0.6, 0.1, 0.2, 0.1], vec![8; 4], 0.01, 0.08),
        (vec![0.8, 0.1, 0.1], vec![8, 8, 16], 0.0, 0.15),
        (vec![0.6, 0.1, 0.2, 0.1], vec![8, 8, 8, 16], 0.0, 0.15),
    ] {
        let last = shares.len() - 1;
        let mix = plain(LONG / 12, 8, shares.len(), |x, y| {
            let mut shares = shares.clone();
            let more = if (x + y) % 2 == 0 { varies } else { -varies };
            (shares[0], shares[last]) = (shares[0] - more, shares[last] + more);
            shares
        });
        let dots = cells(&mix, (LONG, 96), &minimum, None, &Silent);
        for (stack, share) in shares.iter().enumerate() {
            for top in [0, 4, 88, 92] {
                let rows = &dots[top * LONG..(top + 4) * LONG];
                let printed =
                    rows.iter().filter(|&&dot| usize::from(dot) == stack).count() as f64 / rows.len() as f64;
                assert!(
                    (printed / share - 1.0).abs() < within,
                    "{shares:?}, minimum {minimum:?}: {printed:.4} of {stack} in rows from {top}"
                );
            }
        }
    }
}
