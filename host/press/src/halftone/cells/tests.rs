//! The claims of the cells: widths by trying every square, tones by counting, regions by changing their neighbours.

use super::super::eye::{Eye, Tangent, error_planes, errors_seen, peak, swing};
use super::super::solids::Solids;
use super::super::thin::thin;
use super::super::{Method, Settings, TONE, halftone};
use super::Point;
use super::cell::{Cell, fits_half};
use super::plan::{halved_size_of, size_of};
use crate::sheet::clusters::smallest_clusters;
use appearance::brdf::{Space, reflectances};
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps, quantise};
use inks::{Library, Stack};
use observe::Silent;
use proptest::prelude::*;
use protocol::ink::Ink;
use protocol::paper::Paper;

fn stacks(count: usize) -> Vec<Stack> {
    let pairs = (0..169).map(|i| Stack::new([Ink::ALL[i % 13], Ink::ALL[i / 13]]));
    std::iter::once(Stack::SUBSTRATE)
        .chain(Ink::ALL.map(|ink| Stack::new([ink])))
        .chain(pairs)
        .take(count)
        .collect()
}

/// Every channel is one stack.
fn plain(width: usize, height: usize, count: usize, at: impl Fn(usize, usize) -> Vec<f64>) -> InkMix {
    let mut data = vec![0; width * height * count];
    for (pixel, out) in data.chunks_exact_mut(count).enumerate() {
        quantise(&at(pixel % width, pixel / width), out);
    }
    let matrix = (0..count).map(|i| (0..count).map(|q| if q == i { ONE } else { 0 }).collect()).collect();
    InkMix { stacks: stacks(count), maps: WeightMaps::new(width, height, count, data).unwrap(), matrix }
}

/// Cells without fixed dots.
fn cells(
    mix: &InkMix,
    (width, height): (usize, usize),
    minimum: &[u16],
    points: Option<&[Point]>,
    observer: &Silent,
) -> Vec<u8> {
    let solids = Solids::new(mix, width, height, None);
    super::cells(mix, (width, height), minimum, &solids, points, points.is_some(), observer)
}

fn side(minimum: u16) -> usize {
    (1..).find(|side| side * side >= usize::from(minimum)).unwrap()
}

fn noise(seed: u64, x: usize, y: usize, q: usize) -> f64 {
    let v = (seed ^ (x * 31 + y * 1009 + q * 7919) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((v ^ v >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93) >> 40) as f64 / (1u64 << 24) as f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    /// Tones alone, with a minimum for each stack: the border of the page is the only edge.
    #[test]
    fn no_part_is_thinner_than_its_minimum_asks(
        (width, height) in (12usize..150, 12usize..150),
        seed in any::<u64>(),
        minimum in prop_oneof![
            prop::collection::vec(1u16..64, 5),
            prop::collection::vec(prop_oneof![Just(8u16), Just(16)], 5),
        ],
        searched in any::<bool>(),
    ) {
        let mix = plain(9, 7, 5, |x, y| {
            (0..5).map(|q| (noise(seed, x / 3, y / 2, q) - 0.4).max(0.0).powi(2) + if q < 2 { 0.1 } else { 0.0 }).collect()
        });
        let points: Vec<Point> = (0..5).map(|q| [q as f32, (q * q % 3) as f32, 0.0, 0.3]).collect();
        let dots = cells(&mix, (width, height), &minimum, searched.then_some(&points[..]), &Silent);
        let minimum = |stack: u8| minimum[usize::from(stack)].into();
        prop_assert_eq!(thin(width, &dots, minimum, |_| false), 0);
    }

    /// Solids of any shape amid tones are exact, and a stack is printed only where it has weight.
    #[test]
    fn solids_are_exact_and_nothing_strays(
        (width, height) in (1usize..120, 1usize..120),
        seed in any::<u64>(),
        minimum in prop::collection::vec(1u16..17, 4),
        grain in 1usize..9,
    ) {
        let asked = |x: usize, y: usize| match (noise(seed, x / grain, y / grain, 9) * 4.0) as usize {
            0 => vec![1.0, 0.0, 0.0, 0.0],
            1 => vec![0.0, 0.0, 0.0, 1.0],
            2 => vec![0.3, 0.7, 0.0, 0.0],
            _ => vec![0.0, 0.2, 0.8, 0.0],
        };
        let mix = plain(width, height, 4, asked);
        let dots = cells(&mix, (width, height), &minimum, None, &Silent);
        for (at, &dot) in dots.iter().enumerate() {
            let shares = asked(at % width, at / width);
            if shares.contains(&1.0) {
                prop_assert_eq!(shares[usize::from(dot)], 1.0, "dot {}, {}", at % width, at / width);
            } else {
                prop_assert!(dot < 3);
            }
        }
    }
}

/// A disc and slanted bars of solid in a tone: every connected part of the tone keeps its minimum, and what is thin
/// lies beside a solid that makes it so.
#[test]
fn parts_beside_solids_keep_their_minimum() {
    let (width, height) = (400, 300);
    let solid = |x: usize, y: usize| {
        let (dx, dy) = (x as f64 - 140.0, y as f64 - 150.0);
        dx.hypot(dy) < 100.0 || (x > 250 && (3 * x + y) % 120 < 50)
    };
    let mix =
        plain(width, height, 3, |x, y| if solid(x, y) { vec![0.0, 0.0, 1.0] } else { vec![0.6, 0.3, 0.1] });
    let dots = cells(&mix, (width, height), &[9; 3], None, &Silent);
    let free: Vec<bool> = (0..dots.len()).map(|at| solid(at % width, at / width)).collect();
    // Solids of the same stack may touch a part, so they are numbered apart.
    let numbered: Vec<u8> = dots.iter().zip(&free).map(|(&dot, &free)| if free { 3 } else { dot }).collect();
    let least = smallest_clusters(width, &numbered, &std::array::from_fn(|stack| stack as u8));
    assert!(least[..3].iter().all(|&area| area >= 9), "{:?}", &least[..4]);
    let tones = free.iter().filter(|&&free| !free).count();
    let thin_dots = thin(width, &dots, |_| 9, |at| free[at]);
    assert!(thin_dots as f64 <= 0.003 * tones as f64, "{thin_dots} of {tones}");
    let beside = |at: usize| {
        let (x, y) = (at % width, at / width);
        (y.saturating_sub(4)..(y + 5).min(height))
            .any(|y| (x.saturating_sub(4)..(x + 5).min(width)).any(|x| solid(x, y)))
    };
    assert_eq!(thin(width, &dots, |_| 9, |at| free[at] || beside(at)), 0);
}

/// A tone in a frame of solid: nothing beyond the frame changes its dots.
#[test]
fn no_debt_crosses_a_solid() {
    let (width, height) = (400, 300);
    let print = |share: f64| {
        let mix = plain(width, height, 3, |x, y| {
            let (dx, dy) = (x as f64 - 190.0, y as f64 - 150.0);
            match dx.hypot(dy * 1.3) {
                r if r < 100.0 => vec![0.63, 0.37, 0.0],
                r if r < 106.0 => vec![0.0, 0.0, 1.0],
                _ => vec![1.0 - share, share, 0.0],
            }
        });
        cells(&mix, (width, height), &[9, 9, 9], None, &Silent)
    };
    let (a, b) = (print(0.2), print(0.81));
    assert_ne!(a, b);
    for at in 0..a.len() {
        let (dx, dy) = ((at % width) as f64 - 190.0, (at / width) as f64 - 150.0);
        if dx.hypot(dy * 1.3) < 106.0 {
            assert_eq!(a[at], b[at], "{}, {}", at % width, at / width);
        }
    }
}

#[test]
fn tones_are_kept_at_any_ratio_of_pixels_to_dots() {
    for (pixels, dots) in [(1, 700), (37, 640), (300, 600), (600, 600), (900, 600), (1500, 601)] {
        let mix = plain(pixels, pixels, 4, |x, y| {
            let t = (x as f64 / pixels as f64 * 5.0).sin().abs() * (1.0 - 0.4 * y as f64 / pixels as f64);
            vec![0.2, 0.8 * t, 0.75 * (1.0 - t), 0.05 * (1.0 - t)]
        });
        let sheet = cells(&mix, (dots, dots), &[9, 9, 16, 9], None, &Silent);
        for q in 0..4 {
            let asked: f64 = mix.maps.data().iter().skip(q).step_by(4).map(|&w| f64::from(w)).sum::<f64>()
                / f64::from(ONE)
                / (pixels * pixels) as f64;
            let printed =
                sheet.iter().filter(|&&dot| usize::from(dot) == q).count() as f64 / (dots * dots) as f64;
            assert!((printed - asked).abs() < 2e-3, "stack {q} of {pixels} pixels: {printed}, {asked} asked");
        }
    }
}

/// Strips begin like any other row: the tone of the rows at a border of strips is what it is elsewhere.
#[test]
fn strips_leave_no_seams() {
    let mix = plain(1, 1, 3, |_, _| vec![0.85, 0.05, 0.1]);
    let (width, height) = (2400, 1600);
    let seam = super::STRIP * super::plan::BLOCK;
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
    let seam = super::STRIP * super::plan::BLOCK;
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
    super::cells(&mix, size, &vec![9; shares.len()], &solids, Some(points), false, &Silent)
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
        let (width, seam) = (12_000, super::STRIP * super::plan::BLOCK);
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
        let field = super::field::Field::new(&mix, width, height, &[3, 24], &solids);
        let metric = super::Metric::new(field.lanes, &field.mean(), Some(points));
        let least = vec![9; shares.len()];
        let plan = super::Plan::new(&field, &least, &mut vec![0; width * height]);
        let mut strip = super::Strip::new(&field, &plan, &metric, &least);
        let mut mean = vec![0.0; shares.len()];
        for row in 0..height / 24 - 1 {
            strip.block_row(row, &mut super::Target { rows: None, top: 0 });
            if row >= 10 {
                let debts = strip.mean_debts();
                mean.iter_mut()
                    .zip(debts)
                    .for_each(|(mean, debt)| *mean += debt / 9.0 / (height / 24 - 11) as f64);
            }
        }
        let want: Vec<f32> = shares.iter().map(|&share| 9.0 * share as f32).collect();
        let differs = |metric| {
            let usual = super::border::Usual::new(metric, &want, 9, &[]);
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

/// The search moves dots and takes none away; the error it judges by falls.
#[test]
fn the_search_keeps_tones_and_sees_less() {
    let side = 512;
    let shares = [0.4, 0.3, 0.2, 0.1];
    let mix = plain(1, 1, 4, |_, _| shares.to_vec());
    let points: Vec<Point> = vec![[0.0; 4], [0.3, 0.1, 0.0, 0.0], [0.1, 0.4, 0.1, 0.0], [0.7, 0.6, 0.5, 0.0]];
    let solids = Solids::new(&mix, side, side, None);
    let print =
        |searched| super::cells(&mix, (side, side), &[9; 4], &solids, Some(&points), searched, &Silent);
    let (plain, best) = (print(false), print(true));
    for q in 0..4 {
        let count = |dots: &[u8]| dots.iter().filter(|&&dot| dot == q).count();
        assert_eq!(count(&plain), count(&best), "stack {q}");
    }
    let seen = |dots: &[u8]| {
        let error = |c: usize| {
            let mean: f64 = shares.iter().zip(&points).map(|(a, p)| a * f64::from(p[c])).sum();
            dots.iter().map(|&dot| f64::from(points[usize::from(dot)][c]) - mean).collect()
        };
        errors_seen(&(0..4).map(error).collect::<Vec<_>>(), &Eye::new(side, side, &[0.3]))[0]
    };
    assert!(seen(&best) < 0.85 * seen(&plain), "{} of {}", seen(&best), seen(&plain));
    assert_eq!(thin(side, &best, |_| 9, |_| false), 0);
}

#[test]
fn a_cell_is_read_as_it_is_printed() {
    let (width, stacks) = (11, [7u8, 5, 250]);
    let mut number = [u8::MAX; 256];
    stacks.iter().enumerate().for_each(|(q, &stack)| number[usize::from(stack)] = q as u8);
    for size in [2, 4, 6, 8] {
        for (first, second) in [(0, 0), (0, 2), (2, 1)] {
            for stacked in [false, true] {
                let cell = Cell { halves: [first, second], stacked: stacked && first != second };
                let mut dots = vec![9; width * size];
                cell.print(&mut dots[3..], width, size, &stacks);
                assert_eq!(Cell::read(&dots[3..], width, size, &number), cell);
                let count = |q: u8| dots.iter().filter(|&&dot| dot == stacks[usize::from(q)]).count();
                let half = if first == second { size * size } else { size * size / 2 };
                assert_eq!((count(first), count(second)), (half, half));
            }
        }
    }
}

/// Whole cells and halves hold the minimum, and no stack takes more dots where it may have halves.
#[test]
fn sizes_hold_the_minimum() {
    for minimum in 1..=64u16 {
        let (size, halved) = (size_of(minimum), halved_size_of(minimum));
        assert!(size * size >= minimum.into());
        let dots = if fits_half(minimum, halved) { halved * halved / 2 } else { halved * halved };
        assert!(dots >= minimum.into() && dots <= size * size, "{minimum}");
    }
    assert_eq!([8, 9, 16].map(size_of), [3, 3, 4]);
    assert_eq!([8, 9, 16].map(halved_size_of), [4, 3, 4]);
}

/// Stacks of which half a cell holds the minimum, beside one that takes whole cells: each keeps its tone, where stacks may stand
/// in for each other and where not, and the search changes none.
#[test]
fn halves_keep_tones_and_the_search_sees_less() {
    let side = 600;
    let minimum = [8, 8, 16, 8];
    let mix = plain(150, 150, 4, |x, y| {
        let t = (x as f64 / 9.0).sin() * (y as f64 / 7.0).cos() * 0.2;
        vec![0.4 + t, 0.3 - t, 0.2 + 0.5 * t, 0.1 - 0.5 * t]
    });
    let points: Vec<Point> =
        vec![[0.0; 4], [0.6, 0.1, 0.0, 0.0], [0.65, 0.1, 0.05, 0.0], [0.7, 0.6, 0.5, 0.0]];
    let solids = Solids::new(&mix, side, side, None);
    let print =
        |points, searched| super::cells(&mix, (side, side), &minimum, &solids, points, searched, &Silent);
    let alike = print(None, false);
    let (cells, best) = (print(Some(&points[..]), false), print(Some(&points[..]), true));
    let count = |dots: &[u8], q: usize| dots.iter().filter(|&&dot| usize::from(dot) == q).count();
    for q in 0..4 {
        let asked = mix.maps.data().iter().skip(q).step_by(4).map(|&w| f64::from(w)).sum::<f64>();
        let asked = asked / f64::from(ONE) / (150.0 * 150.0);
        for dots in [&alike, &cells] {
            let printed = count(dots, q) as f64 / (side * side) as f64;
            assert!((printed - asked).abs() < 1.5e-3, "stack {q}: {printed}, {asked} asked");
        }
        assert_eq!(count(&cells, q), count(&best, q), "stack {q}");
    }
    let solids = Solids::new(&mix, side, side, None);
    let field = super::field::Field::new(&mix, side, side, &[], &solids);
    let (asked, _) = field.points((0, 0), (side, side), &points);
    let seen = |dots: &[u8]| {
        let error = |c: usize| {
            let dots = dots.iter().zip(&asked);
            dots.map(|(&dot, asked)| f64::from(points[usize::from(dot)][c] - asked[c])).collect()
        };
        errors_seen(&(0..4).map(error).collect::<Vec<_>>(), &Eye::new(side, side, &[0.3]))[0]
    };
    let seen = [&alike, &cells, &best].map(|dots| seen(dots));
    assert!(seen[1] < 0.95 * seen[0] && seen[2] < 0.85 * seen[1], "{seen:?}");
    for dots in [&alike, &cells, &best] {
        assert_eq!(thin(side, dots, |q| minimum[usize::from(q)].into(), |_| false), 0);
    }
}

/// Flat mixtures of stacks with different minima, by what they reflect.
#[test]
fn flat_halves_do_not_repeat() {
    const SIDE: usize = 528;
    let third = 1.0 / 3.0;
    let library = Library::builtin();
    for (names, shares) in [
        (["substrate", "SF", "K"], vec![0.5, 0.3, 0.2]),
        (["substrate", "SF", "K"], vec![third; 3]),
        (["substrate", "SF", "K"], vec![0.5, 0.25, 0.25]),
        (["substrate", "SF", "K"], vec![0.7, 0.1, 0.2]),
        (["substrate", "MS", "K"], vec![0.25, 0.5, 0.25]),
        (["substrate", "MS", "Y"], vec![0.48, 0.04, 0.48]),
        (["substrate", "MS", "K"], vec![0.05, 0.48, 0.47]),
        (["substrate", "MS", "K"], vec![0.72, 0.03, 0.25]),
    ] {
        let mut mix = plain(1, 1, shares.len(), |_, _| shares.clone());
        mix.stacks = names.map(|name| name.parse().unwrap()).to_vec();
        let settings = Settings::from_library(&mix.stacks, &library);
        let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
        for (stack, share) in shares.iter().enumerate() {
            let (most, lag) = peak(SIDE, sheet.index(), stack as u8, 12.0 / share.sqrt(), SIDE / 4);
            let (rows, columns) = swing(SIDE, sheet.index(), stack as u8, 4);
            assert!(most < 0.1, "{names:?} {shares:.2?}: {stack} repeats by {most:.3} at {lag:?}");
            assert!(
                rows < 1.15 && columns < 1.15,
                "{names:?} {shares:.2?}: {stack} swings by {rows:.2}, {columns:.2}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
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

proptest! {
    /// Windows of documents coarser and finer than the dots, dot by dot through the shares of stacks.
    #[test]
    fn what_a_window_asks_for_is_what_its_dots_do(
        pixels in (1usize..40, 1usize..40), dots in (1usize..60, 1usize..60), at in (0.0f64..1.0, 0.0f64..1.0),
        flat in any::<bool>(), seed in any::<u64>(),
    ) {
        let mix = plain(pixels.0, pixels.1, 4, |x, y| {
            let (x, y) = if flat { (0, 0) } else { (x, y) };
            (0..4).map(|q| if q == 2 { 0.0 } else { 0.1 + noise(seed, x, y, q) }).collect()
        });
        let points = [[0.5, 0.1, 0.2, 0.9], [0.1, 0.7, 0.3, 0.2], [5.0; 4], [0.3, 0.0, 0.8, 0.4]];
        let part = |dots: usize, at: f64| {
            let from = (dots as f64 * at) as usize;
            (from, (dots - from).div_ceil(2))
        };
        let ((left, width), (top, height)) = (part(dots.0, at.0), part(dots.1, at.1));
        let solids = Solids::new(&mix, dots.0, dots.1, None);
        let field = super::field::Field::new(&mix, dots.0, dots.1, &[], &solids);
        let (found, same) = field.points((left, top), (width, height), &points);
        prop_assert!(same || !flat);
        prop_assert_eq!(found.len(), width * height);
        let (mut scratch, mut want) = (Vec::new(), vec![0.0; field.lanes]);
        for (i, found) in found.iter().enumerate() {
            want.fill(0.0);
            field.add_dot(left + i % width, top + i / width, &mut scratch, &mut want);
            for (c, found) in found.iter().enumerate() {
                let shares = field.stacks.iter().zip(&want);
                let expected: f32 = shares.map(|(&q, share)| share * points[usize::from(q)][c]).sum();
                prop_assert!((found - expected).abs() < 1e-5, "dot {i}: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn dots_do_not_depend_on_the_number_of_threads() {
    let mix = plain(50, 300, 9, |x, y| match (x / 5 + y / 7) % 5 {
        0 => (0..9).map(|q| if q == 4 { 1.0 } else { 0.0 }).collect(),
        _ => (0..9).map(|q| ((x * q + y) % 7) as f64 + 0.1).collect(),
    });
    let dots = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let points: Vec<Point> = (0..9).map(|q| [q as f32, (q * q % 5) as f32, 0.0, 0.0]).collect();
        pool.install(|| cells(&mix, (400, 2500), &[9, 9, 16, 9, 9, 8, 8, 9, 9], Some(&points), &Silent))
    };
    assert_eq!(dots(1), dots(3));
}

/// The five patches of the table: name, stacks, minima, shares of each stack at (u, v) of 0 to 1.
/// Exact weights repeat on tones near simple fractions: a half becomes a checkerboard. And where debts begin at nothing and
/// stay inside a tone, it begins too light, and its last row prints what is left.
#[test]
fn flat_tones_neither_repeat_nor_change_at_their_border() {
    const SIDE: usize = 510;
    for tone in [0.02, 0.1, 0.2, 0.25, 1.0 / 3.0, 0.4, 0.45, 0.47, 0.48, 0.49, 0.5] {
        let mix = plain(1, 1, 2, |_, _| vec![1.0 - tone, tone]);
        let settings = Settings { method: Method::Cells, minimum: vec![9; 2], reflectance: None };
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
    const SIDE: usize = 510;
    let third = 1.0 / 3.0;
    for shares in [
        vec![third; 3],
        vec![0.5, 0.25, 0.25],
        vec![0.5, 0.3, 0.2],
        vec![0.4, 0.4, 0.2],
        vec![0.48, 0.46, 0.06],
        vec![0.5, 0.4, 0.1],
        vec![0.25; 4],
        vec![0.2; 5],
        vec![0.3, 0.25, 0.2, 0.15, 0.1],
    ] {
        let mix = plain(1, 1, shares.len(), |_, _| shares.clone());
        let settings = Settings { method: Method::Cells, minimum: vec![9; shares.len()], reflectance: None };
        let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
        for (stack, share) in shares.iter().enumerate() {
            let (most, lag) = peak(SIDE, sheet.index(), stack as u8, 9.0 / share.sqrt(), SIDE / 4);
            assert!(most < 0.1, "{shares:.2?}: {stack} repeats by {most:.3} at {lag:?}");
        }
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

/// Tints in small boxes, which borders cut all around, keep their tones on average.
#[test]
fn boxes_of_a_tint_have_its_tone() {
    const SIDE: usize = 720;
    for tone in [0.05, 0.1, 0.25, 0.4] {
        // 48 x 24 dots, and 12 between.
        let fixed: Vec<u8> = (0..SIDE * SIDE)
            .map(|at| if at % SIDE % 60 < 48 && at / SIDE % 36 < 24 { TONE } else { 0 })
            .collect();
        let flat = plain(1, 1, 2, |_, _| vec![1.0 - tone, tone]);
        let settings = Settings { method: Method::Cells, minimum: vec![9; 2], reflectance: None };
        let size = (SIDE as u16, SIDE as u16);
        let sheet = halftone(&flat, size, Some(&fixed), &settings, &Silent).unwrap();
        let boxes = fixed.iter().filter(|&&stack| stack == TONE).count() as f64;
        let inked = sheet.index().iter().filter(|&&stack| stack == 1).count() as f64;
        assert!((inked / boxes / tone - 1.0).abs() < 0.03, "{tone}: {}", inked / boxes);
    }
}

type Patch = (&'static str, [&'static str; 5], [u16; 5], fn(f64, f64) -> [f64; 5]);

const PATCHES: [Patch; 10] = [
    ("ramp of 4 inks", ["substrate", "C", "M", "Y", "K"], [9; 5], |u, v| {
        [0.0, (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
    }),
    ("5 stacks", ["substrate", "C", "M", "Y", "K"], [9; 5], |_, _| [0.3, 0.25, 0.2, 0.15, 0.1]),
    ("K 10 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.9, 0.1, 0.0, 0.0, 0.0]),
    ("K 25 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.75, 0.25, 0.0, 0.0, 0.0]),
    ("K 33 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0, 0.0]),
    ("K 50 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.5, 0.5, 0.0, 0.0, 0.0]),
    ("K ramp", ["substrate", "K", "C", "M", "Y"], [9; 5], |u, _| [1.0 - u, u, 0.0, 0.0, 0.0]),
    ("foil, K, paper", ["substrate", "SF", "K", "C", "M"], [9; 5], |_, _| [0.5, 0.3, 0.2, 0.0, 0.0]),
    ("foil ramp", ["substrate", "SF", "K", "C", "M"], [8, 16, 8, 8, 8], |u, v| {
        [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v, 0.0]
    }),
    ("foil of 16", ["substrate", "SF", "K", "C", "M"], [8, 16, 8, 8, 8], |_, _| [0.5, 0.3, 0.2, 0.0, 0.0]),
];

/// Prints how each method does on each patch, and how long A4 takes. With a folder in `FOILPRESS_LOOK` it writes
/// the patches there as pictures of one pixel a dot.
#[test]
#[ignore = "a table for docs/decisions/cells.md; takes minutes"]
fn table_of_methods() {
    const SIDE: usize = 1024;
    let (library, space) = (Library::builtin(), Space::half_angle(32));
    let colours: [[u8; 3]; 5] = [[255, 255, 255], [0, 160, 220], [220, 0, 120], [250, 220, 0], [20, 20, 20]];
    println!(
        "{:16} {:6} {:>7} {:>7} {:>6} {:>12} {:>5} {:>5} {:>6}",
        "", "", "0.3 m", "0.5 m", "peak", "lag", "rows", "cols", "thin %"
    );
    for (name, names, minimum, shares) in PATCHES {
        let flat = shares(0.0, 0.0) == shares(1.0, 1.0);
        let pixels = if flat { 1 } else { 256 };
        let at = |i: usize| (i as f64 + 0.5) / pixels as f64;
        let mut mix = plain(pixels, pixels, 5, |x, y| shares(at(x), at(y)).to_vec());
        mix.stacks = names.map(|name| name.parse().unwrap()).to_vec();
        let table = reflectances(&mix.stacks, &library, &space);
        let mean: Vec<f64> = (0..5)
            .map(|q| {
                (0..64)
                    .map(|i| shares((f64::from(i % 8) + 0.5) / 8.0, (f64::from(i / 8) + 0.5) / 8.0)[q])
                    .sum::<f64>()
                    / 64.0
            })
            .collect();
        let tangent = Tangent::new(&space, &table, &mean);
        let asked: Vec<f32> = (0..SIDE * SIDE)
            .flat_map(|dot| {
                let place = |dot: usize| (dot as f64 + 0.5) / SIDE as f64;
                shares(place(dot % SIDE), place(dot / SIDE)).map(|share| share as f32)
            })
            .collect();
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings { method, minimum: minimum.to_vec(), reflectance: Some(table.clone()) };
            let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
            let dots = sheet.index();
            let seen = errors_seen(&error_planes(dots, &asked, &tangent), &Eye::new(SIDE, SIDE, &[0.3, 0.5]));
            // The rarest stack of the patch, and three of its mean spacings.
            let rare =
                (1..5).filter(|&q| mean[q] > 0.0).min_by(|&a, &b| mean[a].total_cmp(&mean[b])).unwrap();
            let b = side(minimum[rare]);
            let near = 3.0 * b as f64 / mean[rare].sqrt();
            let (most, lag) = if flat { peak(SIDE, dots, rare as u8, near, 256) } else { (0.0, (0, 0)) };
            let (rows, columns) = if flat { swing(SIDE, dots, rare as u8, b) } else { (0.0, 0.0) };
            let thin = thin(SIDE, dots, |q| minimum[usize::from(q)].into(), |_| false);
            println!(
                "{name:16} {:6} {:7.5} {:7.5} {most:6.3} {:>12} {rows:5.2} {columns:5.2} {:6.2}",
                format!("{method:?}"),
                seen[0],
                seen[1],
                format!("{lag:?}"),
                100.0 * thin as f64 / (SIDE * SIDE) as f64
            );
            if let Some(folder) = std::env::var_os("FOILPRESS_LOOK") {
                let picture = image::RgbImage::from_fn(SIDE as u32, SIDE as u32, |x, y| {
                    image::Rgb(colours[usize::from(dots[y as usize * SIDE + x as usize])])
                });
                let file = format!("{}-{method:?}.png", name.replace([' ', ',', '%'], ""));
                picture.save(std::path::Path::new(&folder).join(file)).unwrap();
            }
        }
    }
    for count in [8, 57] {
        let mix = a4(count);
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings {
                method,
                minimum: vec![9; count],
                reflectance: Some(reflectances(&mix.stacks, &library, &space)),
            };
            let size = (Paper::A4.width(), Paper::A4.length());
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            let took = (0..3)
                .map(|_| {
                    let start = std::time::Instant::now();
                    pool.install(|| halftone(&mix, size, None, &settings, &Silent).unwrap());
                    start.elapsed()
                })
                .min()
                .unwrap();
            println!("A4, {count} stacks, {method:?}: {took:.2?} on one thread");
        }
    }
}

/// A smooth document of eight bases, a pixel for 4 x 4 dots.
fn a4(count: usize) -> InkMix {
    let (width, height, channels) = (1200, 1593, 8);
    let mut data = vec![0; width * height * channels];
    for (pixel, out) in data.chunks_exact_mut(channels).enumerate() {
        let (x, y) = ((pixel % width) as f64 / 190.0, (pixel / width) as f64 / 230.0);
        let wave = |i: usize| 1.05 + (x * (1.0 + i as f64 * 0.3) + y * (2.0 - i as f64 * 0.2)).sin();
        quantise(&(0..channels).map(wave).collect::<Vec<_>>(), out);
    }
    let matrix = (0..channels)
        .map(|i| {
            let mut row = vec![0; count];
            quantise(&(0..count).map(|q| 1.0 + ((q * 7 + i * 13) % 11) as f64).collect::<Vec<_>>(), &mut row);
            row
        })
        .collect();
    InkMix { stacks: stacks(count), maps: WeightMaps::new(width, height, channels, data).unwrap(), matrix }
}

/// Prints how each method does on documents: the folders of `foilpress map` in `FOILPRESS_MIXES`, separated by colons.
#[test]
#[ignore = "a table for docs/decisions/cells.md; needs mapped documents"]
fn table_of_documents() {
    const SIDE: u16 = 2835;
    let Some(folders) = std::env::var_os("FOILPRESS_MIXES") else { return };
    for folder in std::env::split_paths(&folders) {
        let name = folder.file_stem().unwrap().to_string_lossy().into_owned();
        let (mix, _) = appearance::gamut::files::load(&folder).unwrap();
        let settings = Settings::from_library(&mix.stacks, &Library::builtin());
        let mut walked = Vec::new();
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings { method, ..settings.clone() };
            let start = std::time::Instant::now();
            let sheet = halftone(&mix, (SIDE, SIDE), None, &settings, &Silent).unwrap();
            let took = start.elapsed();
            let look = super::super::metrics::look(&mix, &sheet, &settings).unwrap().unwrap();
            let tones = super::super::metrics::tones(&mix, &sheet, &Silent).unwrap();
            let worst = tones.iter().map(|tone| (tone.printed - tone.asked).abs()).fold(0.0, f64::max);
            let seen: Vec<f64> = look.seen.iter().map(|seen| seen.1).collect();
            walked = if walked.is_empty() { seen.clone() } else { walked };
            if let Some(folder) = std::env::var_os("FOILPRESS_LOOK") {
                std::fs::write(
                    std::path::Path::new(&folder).join(format!("{name}.{method:?}")),
                    sheet.index(),
                )
                .unwrap();
            }
            println!(
                "{name:16} {:6} {:.5} {:.5}, {:.3} {:.3} of the walk; thin {:.2} %, tones within {:.3} %, {took:.2?}",
                format!("{method:?}"),
                seen[0],
                seen[1],
                seen[0] / walked[0],
                seen[1] / walked[1],
                100.0 * look.thin,
                100.0 * worst,
            );
        }
    }
}
