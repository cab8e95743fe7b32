//! The claims of the stage: clusters by flood fill, tones by counting, the same sheet whoever computes it.

use super::*;
use appearance::weights::{WeightMaps, quantise};
use observe::Silent;
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

fn stacks(count: usize) -> Vec<Stack> {
    let two = |i: usize| [Ink::ALL[i % 13], Ink::ALL[i / 13 % 13]];
    let all = std::iter::once(Stack::SUBSTRATE)
        .chain(Ink::ALL.into_iter().map(|ink| Stack::new([ink])))
        .chain((0..169).map(|i| Stack::new(two(i))));
    all.take(count).collect()
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

fn by(method: Method, mix: &InkMix, size: (u16, u16), fixed: Option<&[u8]>, minimum: &[u16]) -> DotMap {
    let settings = Settings { method, minimum: minimum.to_vec(), ..Settings::of(&mix.stacks, 1, |_| 1) };
    halftone(mix, size, fixed, &settings, &Silent).unwrap()
}

fn run(mix: &InkMix, size: (u16, u16), minimum: u16) -> DotMap {
    by(Method::Walk, mix, size, None, &vec![minimum; mix.stacks.len()])
}

/// Sizes of the 4-connected components of equal stacks, by flood fill.
fn components(sheet: &DotMap) -> Vec<(u8, usize)> {
    let (width, index) = (sheet.width(), sheet.index());
    let mut seen = vec![false; index.len()];
    let mut found = Vec::new();
    for start in 0..index.len() {
        if seen[start] {
            continue;
        }
        let (mut todo, mut size) = (vec![start], 0);
        seen[start] = true;
        while let Some(dot) = todo.pop() {
            size += 1;
            let x = dot % width;
            let near = [
                (x > 0).then(|| dot - 1),
                (x + 1 < width).then_some(dot + 1),
                dot.checked_sub(width),
                (dot + width < index.len()).then_some(dot + width),
            ];
            for next in near.into_iter().flatten() {
                if !seen[next] && index[next] == index[start] {
                    seen[next] = true;
                    todo.push(next);
                }
            }
        }
        found.push((index[start], size));
    }
    found
}

/// The 4-connected part of each dot, by its first dot.
fn labels(width: usize, index: &[u8]) -> Vec<usize> {
    let mut label: Vec<usize> = (0..index.len()).collect();
    loop {
        let mut changed = false;
        for dot in (0..index.len()).chain((0..index.len()).rev()) {
            let right = (dot % width + 1 < width).then_some(dot + 1);
            let below = (dot + width < index.len()).then_some(dot + width);
            for next in [right, below].into_iter().flatten().filter(|&next| index[next] == index[dot]) {
                let least = label[dot].min(label[next]);
                changed |= label[dot] != least || label[next] != least;
                (label[dot], label[next]) = (least, least);
            }
        }
        if !changed {
            return label;
        }
    }
}

/// First dot and size of every 4-connected part.
fn parts(width: usize, index: &[u8]) -> Vec<(usize, usize)> {
    let label = labels(width, index);
    let firsts = (0..index.len()).filter(|&dot| label[dot] == dot);
    firsts.map(|first| (first, label.iter().filter(|&&l| l == first).count())).collect()
}

/// A tone in a frame of solid: nothing beyond the frame changes its dots, whatever the method.
#[test]
fn no_debt_crosses_a_solid() {
    let print = |method, share: f64| {
        let mix = plain(400, 300, 3, |x, y| match (x as f64 - 190.0).hypot((y as f64 - 150.0) * 1.3) {
            r if r < 100.0 => vec![0.63, 0.37, 0.0],
            r if r < 106.0 => vec![0.0, 0.0, 1.0],
            _ => vec![1.0 - share, share, 0.0],
        });
        by(method, &mix, (400, 300), None, &[9; 3]).into_parts().1
    };
    for method in [Method::Walk, Method::Cells, Method::Blue, Method::Fine] {
        let (a, b) = (print(method, 0.2), print(method, 0.81));
        assert_ne!(a, b);
        for at in 0..a.len() {
            let (x, y) = ((at % 400) as f64 - 190.0, (at / 400) as f64 - 150.0);
            if x.hypot(y * 1.3) < 106.0 {
                assert_eq!(a[at], b[at], "{method:?}: {}, {}", at % 400, at / 400);
            }
        }
        // The tone inside the frame, of some 24000 dots.
        let inside = |at: &usize| ((at % 400) as f64 - 190.0).hypot((at / 400) as f64 * 1.3 - 195.0) < 100.0;
        let all: Vec<usize> = (0..a.len()).filter(inside).collect();
        let share = all.iter().filter(|&&at| a[at] == 1).count() as f64 / all.len() as f64;
        assert!((share - 0.37).abs() < 0.004, "{method:?}: {share}");
    }
}

#[test]
fn single_dots_and_small_clusters_are_for_process_inks_alone() {
    for method in [Method::Blue, Method::Fine] {
        let mix = plain(1, 1, 6, |_, _| vec![0.5, 0.3, 0.2, 0.0, 0.0, 0.0]);
        let dots = by(method, &mix, (256, 256), None, &[9; 6]);
        for (q, share) in [(0, 0.5), (1, 0.3), (2, 0.2)] {
            let printed = dots.index().iter().filter(|&&dot| dot == q).count() as f64 / 65_536.0;
            assert!((printed - share).abs() < 1e-3, "{method:?}, {q}: {printed}");
        }
        let foil = mix.stacks.iter().position(|stack| !is_process(stack)).unwrap();
        let mut mixed = mix.clone();
        mixed.matrix[1].swap(1, foil);
        let settings = Settings { method, ..Settings::uniform(6, 9) };
        let said = halftone(&mixed, (9, 9), None, &settings, &Silent).unwrap_err();
        assert_eq!(said, HalftoneError::NotProcess { stack: mix.stacks[foil].clone() });
    }
}

proptest! {
    #![proptest_config(testing::cases(48))]
    #[test]
    fn no_cluster_is_smaller_than_its_minimum(
        (width, height) in (1u16..150, 1u16..150),
        seed in any::<u64>(),
        minimum in prop::collection::vec(1u16..17, 5),
    ) {
        let noise = |x: usize, y: usize, q: usize| {
            let v = (seed ^ (x * 31 + y * 1009 + q * 7919) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((v >> 40) as f64 / (1u64 << 24) as f64).powi(3)
        };
        let mix = plain(9, 7, 5, |x, y| (0..5).map(|q| noise(x, y, q)).collect());
        let settings = Settings { method: Method::Walk, minimum: minimum.clone(), ..Settings::default() };
        let sheet = halftone(&mix, (width, height), None, &settings, &Silent);
        let clusters = components(&sheet.unwrap());
        for (stack, size) in &clusters {
            prop_assert!(
                *size >= usize::from(minimum[usize::from(*stack)]) || clusters.len() == 1,
                "{} of {} dots", stack, size
            );
        }
    }

    /// Solids of any shape amid tones, given by the mix or fixed: exact by every method. Clusters of tones hold their
    /// minimum, unless the whole connected region is smaller.
    #[test]
    fn solids_are_exact_and_the_walk_between_them_holds(
        (width, height) in (1usize..150, 1usize..65),
        seed in any::<u64>(),
        minimum in prop_oneof![(1u16..17).prop_map(|m| vec![m; 4]), prop::collection::vec(1u16..17, 4)],
        grain in 1usize..12,
        method in prop_oneof![3 => Just(Method::Walk), 1 => Just(Method::Cells)],
    ) {
        let dice = |x: usize, y: usize, salt: u64| {
            let v = (seed ^ salt ^ (x / grain * 1009 + y / grain * 7919) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            (v ^ v >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 61
        };
        let asked = |x: usize, y: usize| match dice(x, y, 1) {
            0 => vec![1.0, 0.0, 0.0, 0.0],
            1 => vec![0.0, 0.0, 0.0, 1.0],
            2..=4 => vec![0.3, 0.7, 0.0, 0.0],
            _ => vec![0.1, 0.3, 0.6, 0.0],
        };
        let fixed: Vec<u8> =
            (0..width * height).map(|at| if dice(at % width, at / width, 77) == 0 { 2 } else { TONE }).collect();
        let mix = plain(width, height, 4, asked);
        let dots = by(method, &mix, (width as u16, height as u16), Some(&fixed), &minimum);
        let solid = |at: usize| match fixed[at] {
            TONE => asked(at % width, at / width).iter().position(|&share| share == 1.0).map(|q| q as u8),
            stack => Some(stack),
        };
        for (at, &dot) in dots.index().iter().enumerate() {
            match solid(at) {
                Some(stack) => prop_assert_eq!(dot, stack, "dot {}, {}", at % width, at / width),
                None => prop_assert!(dot < 3),
            }
        }
        if method == Method::Walk && minimum.iter().all(|&m| m == minimum[0]) {
            let numbered: Vec<u8> = dots.index().iter().enumerate()
                .map(|(at, &dot)| if solid(at).is_some() { 9 } else { dot }).collect();
            let tones: Vec<u8> = numbered.iter().map(|&n| u8::from(n == 9)).collect();
            for (start, size) in parts(width, &numbered) {
                if numbered[start] != 9 && size < usize::from(minimum[0]) {
                    let whole = parts(width, &tones);
                    let label = labels(width, &tones);
                    let own = whole.iter().find(|(other, _)| label[*other] == label[start]);
                    // Rests of which none prints a stack that this one asks for stay alone.
                    let odd = asked(start % width, start / width)[2] == 0.0
                        || numbered[start] != 2 && dots.index().contains(&2);
                    prop_assert!(own.is_some_and(|own| own.1 == size) || odd, "{} dots at {}", size, start);
                }
            }
        }
    }

    /// The document's own mean, pixel by pixel, is an independent route to the tone; the sheet may differ by the
    /// debts left at the end.
    #[test]
    fn tones_are_kept_at_any_ratio_of_pixels_to_dots(
        (pw, ph) in (1usize..90, 1usize..90),
        (dw, dh) in (1usize..5, 1usize..5),
        coarse in any::<bool>(),
    ) {
        let mix = plain(pw, ph, 3, |x, y| {
            let t = ((x * 7 + y * 3) % 11) as f64 / 10.0;
            vec![0.2, 0.8 * t, 0.8 * (1.0 - t)]
        });
        let (width, height) = if coarse { (pw * dw, ph * dh) } else { (pw.div_ceil(dw), ph.div_ceil(dh)) };
        let sheet = run(&mix, (width as u16, height as u16), 4);
        let dots = (width * height) as f64;
        // Sampling bilinearly between pixels loses up to a quarter pixel of each border.
        let border = if coarse { 0.25 * 2.0 * (width * dh + height * dw) as f64 } else { 0.0 };
        for (q, &count) in sheet.census().iter().enumerate() {
            let mean = mix.maps.data().iter().skip(q).step_by(3).map(|&w| f64::from(w)).sum::<f64>()
                / f64::from(ONE) / (pw * ph) as f64;
            prop_assert!(
                (count as f64 - mean * dots).abs() <= 12.0 + border + 1e-3 * dots,
                "stack {}: {} dots, {} asked", q, count, mean * dots
            );
        }
    }
}

#[test]
fn only_stacks_with_weight_are_on_a_dot() {
    let mix = plain(3, 3, 4, |_, _| vec![0.0, 0.4, 0.0, 0.6]);
    let dots = run(&mix, (101, 99), 9);
    assert!(dots.index().iter().all(|&stack| stack == 1 || stack == 3));
}

#[test]
fn a_page_of_one_stack_is_solid() {
    let sheet = run(&plain(1, 1, 3, |_, _| vec![0.0, 0.0, 1.0]), (333, 1111), 16);
    assert!(sheet.index().iter().all(|&stack| stack == 2));
}

/// Two strips and more of bands: 2100 rows of a flat tone. The tone of 16 rows at a border of bands or strips
/// must be what it is elsewhere.
#[test]
fn bands_and_strips_leave_no_seams() {
    let mix = plain(1, 1, 3, |_, _| vec![0.55, 0.15, 0.3]);
    let size = (1600, 2176);
    let sheet = run(&mix, size, 9);
    let tone = |row: usize| {
        let dots = &sheet.index()[row * 1600..(row + 16) * 1600];
        dots.iter().filter(|&&s| s == 2).count() as f64 / dots.len() as f64
    };
    let deviation = |row: usize| (tone(row) - 0.3).abs();
    let inside = (16..2144).step_by(64).map(deviation).fold(0.0, f64::max);
    let borders = (64..2176).step_by(64).map(|row| deviation(row - 8)).fold(0.0, f64::max);
    assert!(inside < 0.01 && borders < 0.01, "inside {inside}, at borders {borders}");
}

#[test]
fn the_sheet_does_not_depend_on_the_number_of_threads() {
    let mix = plain(50, 300, 9, |x, y| (0..9).map(|q| ((x * q + y) % 7) as f64 + 0.1).collect());
    let sheet = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&mix, (400, 2500), 9))
    };
    assert_eq!(sheet(1), sheet(3));
}

/// Pixels of one stack each, of 2 by 2 dots: finer than any cluster, so only the mean can be kept.
#[test]
fn a_checkerboard_finer_than_the_clusters_is_averaged() {
    let mix = plain(120, 120, 2, |x, y| if (x + y) % 2 == 0 { vec![1.0, 0.0] } else { vec![0.0, 1.0] });
    let sheet = run(&mix, (240, 240), 16);
    let census = sheet.census();
    assert!(census[0].abs_diff(census[1]) <= 64, "{census:?}");
    for y in (0..192).step_by(48) {
        for x in (0..192).step_by(48) {
            let ones: usize =
                (y..y + 48).flat_map(|y| &sheet.index()[y * 240 + x..][..48]).map(|&s| usize::from(s)).sum();
            assert!(ones.abs_diff(1152) < 110, "{ones} of 2304 at ({x}, {y})");
        }
    }
}

/// An edge between two solid stacks that the walk crosses many times: each side keeps its stack but for what a
/// minimum run hangs over the edge.
#[test]
fn an_edge_between_solids_stays_within_a_cluster() {
    let mix = plain(64, 64, 2, |x, _| if x < 29 { vec![1.0, 0.0] } else { vec![0.0, 1.0] });
    let size = (512, 512);
    let sheet = run(&mix, size, 9);
    for (dot, &stack) in sheet.index().iter().enumerate() {
        let x = dot % 512;
        if !(29 * 8 - 14..29 * 8 + 14).contains(&x) {
            assert_eq!(stack, u8::from(x >= 29 * 8), "column {x}");
        }
    }
}

#[test]
fn progress_counts_every_dot_once() {
    struct Count(AtomicU64, AtomicU64);
    impl Observer for Count {
        fn begin(&self, _: &str, total: u64) {
            self.0.fetch_add(total, Ordering::Relaxed);
        }
        fn advance(&self, steps: u64) {
            self.1.fetch_add(steps, Ordering::Relaxed);
        }
        fn end(&self) {}
        fn note(&self, _: &str) {}
    }
    let count = Count(AtomicU64::new(0), AtomicU64::new(0));
    let mix = plain(4, 4, 2, |x, _| vec![x as f64, 1.0]);
    halftone(&mix, (130, 1200), None, &Settings { method: Method::Walk, ..Settings::uniform(2, 4) }, &count)
        .unwrap();
    assert_eq!((count.0.into_inner(), count.1.into_inner()), (130 * 1200, 130 * 1200));
}

#[test]
fn contradictions_are_named() {
    let mix = plain(2, 2, 2, |_, _| vec![0.5, 0.5]);
    let (page, settings) = ((50, 60), Settings::uniform(2, 9));
    let error = |mix: &InkMix, size: (u16, u16), settings: &Settings| {
        halftone(mix, size, None, settings, &Silent).unwrap_err().to_string()
    };
    for size in [(0, 60), (50, 0), (11_641, 60), (50, u16::MAX)] {
        assert!(error(&mix, size, &settings).contains("expected 1 x 1 to 11640 x 11640 dots"));
    }
    assert!(error(&mix, page, &Settings::uniform(3, 9)).contains("3 minimum clusters"));
    assert!(error(&mix, page, &Settings::uniform(2, 0)).contains("`substrate` is 0 dots"));
    let mut wrong = mix.clone();
    wrong.matrix[1] = vec![5, ONE];
    assert!(error(&wrong, page, &settings).contains("row 1"));
    wrong.matrix[1] = vec![ONE];
    assert!(error(&wrong, page, &settings).contains("1 shares for 2 stacks"));
    wrong.matrix.pop();
    assert!(error(&wrong, page, &settings).contains("1 rows of shares for 2"));
    let mut wrong = mix;
    wrong.stacks[0] = wrong.stacks[1].clone();
    assert!(error(&wrong, page, &settings).contains("the substrate comes first"));
}
