//! The claims of the cells by counting dots: here tones and what cells are made of; by subject in the modules.

mod borders;
mod flat;
mod never_grainier;
mod parts;

use super::super::contrast_sensitivity::{Eye, errors_seen, peak, swing};
use super::super::solids::Solids;
use super::super::thin::thin;
use super::super::{Method, Settings, TONE, halftone};
use super::Point;
use super::cell::{Cell, fits_half};
use super::plan::{halved_size_of, size_of};
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps, quantise};
use inks::{Library, Stack};
use observe::Silent;
use proptest::prelude::*;
use protocol::ink::Ink;
use sheet::clusters::{Touch, smallest_clusters};

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

fn noise(seed: u64, x: usize, y: usize, q: usize) -> f64 {
    let v = (seed ^ (x * 31 + y * 1009 + q * 7919) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((v ^ v >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93) >> 40) as f64 / (1u64 << 24) as f64
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

/// A document of as many pixels as dots says itself how many dots each stack has. Smooth, with a solid disc and sides that cut cells.
#[test]
fn the_search_settles_tones_to_a_cell_a_part() {
    let points: [Point; 4] = [[0.0; 4], [1.0, 0.0, 0.0, 0.0], [0.3, 0.8, 0.0, 0.0], [0.9, 0.4, 0.3, 0.0]];
    for (seed, (width, height)) in
        [(472, 472), (301, 530), (203, 640), (97, 77), (300, 300)].into_iter().enumerate()
    {
        let disc = |x: usize, y: usize| x.abs_diff(width / 3).pow(2) + y.abs_diff(height / 2).pow(2) < 900;
        let mix = plain(width, height, 4, |x, y| {
            let wave = |q: usize| {
                1.05 + (x as f64 / (60.0 + 9.0 * q as f64)
                    + y as f64 / (70.0 - 8.0 * q as f64)
                    + (seed * q) as f64)
                    .sin()
            };
            if disc(x, y) { vec![0.0, 0.0, 1.0, 0.0] } else { (0..4).map(wave).collect() }
        });
        let sheet = cells(&mix, (width, height), &[8, 8, 16, 8], Some(&points), &Silent);
        // Such a page has two parts, each of which may be off by a cell of 16 dots.
        for q in 0..4 {
            let weights = mix.maps.data().iter().skip(q).step_by(4);
            let asked = weights.map(|&weight| f64::from(weight)).sum::<f64>() / f64::from(ONE);
            let printed = sheet.iter().filter(|&&dot| usize::from(dot) == q).count() as f64;
            assert!(
                (printed - asked).abs() <= 32.0,
                "stack {q} of {width} x {height}: {printed}, {asked} asked"
            );
        }
    }
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
