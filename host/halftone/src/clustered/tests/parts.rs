//! Parts are as wide as their minimum asks, by trying every rectangle; solids are exact and keep debts apart, by changing their
//! neighbours; and the search keeps all of it.

use super::*;

proptest! {
    #![proptest_config(testing::cases(32))]
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

/// Beside a solid, another tone and a softened edge a flat tone has the cells that it has in its midst.
#[test]
fn flat_tones_have_the_same_cells_at_their_edges() {
    let (width, height) = (300, 200);
    for edge in [[0.0, 0.0, 1.0], [0.8, 0.2, 0.0]] {
        let mix = plain(width, height, 3, |x, y| match (x, y) {
            (10..=280, 10..=180) => vec![0.55, 0.45, 0.0],
            (9..=281, 9..=181) => vec![0.3, 0.2, 0.5],
            _ => edge.to_vec(),
        });
        let dots = cells(&mix, (width, height), &[8; 3], None, &Silent);
        let inside = |x: usize, y: usize| (18..272).contains(&x) && (18..172).contains(&y);
        let mut changes = 0;
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| inside(x, y))
        {
            for (at, before) in [(x, y * width + x - 1), (y, (y - 1) * width + x)] {
                if dots[y * width + x] != dots[before] {
                    changes += 1;
                    assert_eq!(at % 3, 0, "{edge:?}: a part ends at {x}, {y}");
                }
            }
        }
        assert!(changes > 1000, "{changes}");
    }
}

/// A ramp has no solid columns or rows where it passes a tone that locks: all lines of dots have about what is asked of them.
#[test]
fn ramps_have_no_lines() {
    let (long, short) = (1200, 400);
    let ramp = |at: usize| {
        let ink = 0.02 + 0.96 * (at as f64 + 0.5) / (long / 2) as f64;
        vec![1.0 - ink, ink]
    };
    for (levels, across) in [(1, true), (1, false), (6, true), (6, false)] {
        let step = |at: usize| ramp(at / levels * levels);
        let (mix, size) = match across {
            true => (plain(long / 2, 1, 2, |x, _| step(x)), (long, short)),
            false => (plain(1, long / 2, 2, |_, y| step(y)), (short, long)),
        };
        let dots = cells(&mix, size, &[8; 2], None, &Silent);
        for line in 4..long - 4 {
            let at = |i: usize| if across { i * long + line } else { line * short + i };
            let ink = (0..short).filter(|&i| dots[at(i)] == 1).count() as f64 / short as f64;
            let asked = ramp(line / 2)[1];
            assert!(
                (ink - asked).abs() < 0.22,
                "line {line} across {across}, {levels}: {ink:.2} of {asked:.2}"
            );
        }
    }
}

/// A shading of 8 bits has about so many steps in each block that some blocks would be flat and others not: its bands took turns.
#[test]
fn an_upright_shading_has_no_bands_of_blocks() {
    let (width, long) = (720, 1176);
    for levels in [80, 100, 120, 140, 170] {
        let ink = |y: usize| 0.9 - 0.8 * (y * levels / (long / 4)) as f64 / levels as f64;
        let mix = plain(1, long / 4, 2, |_, y| vec![1.0 - ink(y), ink(y)]);
        let dots = cells(&mix, (width, long), &[8; 2], None, &Silent);
        let printed: Vec<f64> = dots
            .chunks_exact(24 * width)
            .map(|band| band.iter().filter(|&&dot| dot == 1).count() as f64 / band.len() as f64)
            .collect();
        for pair in printed.windows(2) {
            assert!(pair[1] < pair[0] + 0.004, "{levels}: {printed:.3?}");
        }
    }
}

/// A ramp does not repeat along its rows where it passes a tone that locks, however slowly it rises: by so much over a block.
#[test]
fn ramps_do_not_repeat() {
    let width = 1416;
    for rise in [0.01, 0.02, 0.04, 0.08] {
        let long = (0.96 / rise) as usize * 24;
        let ramp = |y: usize| 0.02 + 0.96 * (y as f64 + 0.5) / (long / 2) as f64;
        let mix = plain(1, long / 2, 2, |_, y| vec![1.0 - ramp(y), ramp(y)]);
        let dots = cells(&mix, (width, long), &[8; 2], None, &Silent);
        for (band, dots) in dots.chunks_exact(36 * width).enumerate() {
            let ink = dots.iter().filter(|&&dot| dot == 1).count() as f64 / dots.len() as f64;
            let off = |dot: u8| f64::from(dot) - ink;
            let all: f64 = dots.iter().map(|&dot| off(dot).powi(2)).sum();
            // Three mean spacings are at most 24 dots where there is most to see.
            for lag in (24..128).step_by(4) {
                let pairs = dots.chunks_exact(width).flat_map(|row| row.iter().zip(&row[lag..]));
                let alike = pairs.map(|(&a, &b)| off(a) * off(b)).sum::<f64>() / all;
                assert!(alike < 0.2, "{rise}, rows from {}, ink {ink:.2}: {alike:.2} at {lag}", 36 * band);
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
    let least = smallest_clusters(width, &numbered, &std::array::from_fn(|stack| stack as u8), Touch::Side);
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

/// The search moves dots, and changes tones for the better alone; the error it judges by falls.
#[test]
fn the_search_keeps_tones_and_sees_less() {
    let side = 512;
    let shares = [0.4, 0.3, 0.2, 0.1];
    let mix = plain(1, 1, 4, |_, _| shares.to_vec());
    let points: Vec<Point> = vec![[0.0; 4], [0.3, 0.1, 0.0, 0.0], [0.1, 0.4, 0.1, 0.0], [0.7, 0.6, 0.5, 0.0]];
    let solids = Solids::new(&mix, side, side, None);
    let print = |searched| {
        super::super::cells(&mix, (side, side), &[9; 4], &solids, Some(&points), searched, &Silent)
    };
    let (plain, best) = (print(false), print(true));
    for (q, share) in shares.iter().enumerate() {
        let count = |dots: &[u8]| dots.iter().filter(|&&dot| usize::from(dot) == q).count();
        let off = |dots: &[u8]| (count(dots) as f64 - share * (side * side) as f64).abs();
        assert!(off(&best) <= off(&plain).max(18.0), "stack {q}: off by {} and {}", off(&plain), off(&best));
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

/// Stacks of which half a cell holds the minimum, beside one that takes whole cells: each keeps its tone, where stacks may stand
/// in for each other and where not, and the search brings each within a cell of it in each of two parts.
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
    let print = |points, searched| {
        super::super::cells(&mix, (side, side), &minimum, &solids, points, searched, &Silent)
    };
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
        let off = (count(&best, q) as f64 - asked * (side * side) as f64).abs();
        assert!(off <= 32.0, "stack {q}: off by {off}");
    }
    let solids = Solids::new(&mix, side, side, None);
    let field = super::super::field::Field::new(&mix, side, side, &[], &solids);
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
