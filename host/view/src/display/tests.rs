//! The display against independent routes: closed forms, sampling of the dots and of the mask, and other solvers.

use appearance::brdf::{Space, Table, reflectances};
use appearance::materials::Materials;
use inks::{Library, Stack};
use proptest::prelude::*;
use sheet::DOTS_PER_MM;

use super::solve::within;
use super::*;
use crate::direction;

const ROOM: (usize, usize) = (4800, 6372);

fn stacks(names: &[&str]) -> Vec<Stack> {
    names.iter().map(|name| name.parse().unwrap()).collect()
}

fn screen() -> Screen {
    Screen { pixels: (200, 150), pitch_mm: 0.28, cell: 1, open: 0.3, closed: 0.001 }
}

/// An image whose pixels are given rows.
struct Rows(usize, usize, Space, Vec<Vec<f32>>);

impl Materials for Rows {
    fn width(&self) -> usize {
        self.0
    }

    fn height(&self) -> usize {
        self.1
    }

    fn space(&self) -> &Space {
        &self.2
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.copy_from_slice(&self.3[pixel % self.3.len()]);
    }
}

const HEAD_ON: Sight = Sight { light: [0.0, 0.0, 1.0], eye: [0.0, 0.0, 1.0] };

#[test]
fn tiles_hold_every_stack_and_checker_two() {
    for count in 2..=MOST_STACKS {
        let names = ["K", "MS", "W", "MG", "C", "M", "Y", "F", "substrate"];
        let grid = Grid::new(
            Screen { cell: 3, ..screen() },
            stacks(&names[..count]),
            (2, 2),
            &Library::builtin(),
            ROOM,
        )
        .unwrap();
        let shares = grid.shares();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(shares.iter().all(|&share| share > 0.0), "{count}: {shares:?}");
    }
    let grid = Grid::new(screen(), stacks(&["K", "W"]), (2, 2), &Library::builtin(), ROOM).unwrap();
    let tile: Vec<usize> = (0..4).map(|i| grid.stack_in_tile(i % 2, i / 2)).collect();
    assert_eq!(tile, [0, 1, 1, 0]);
}

/// With screen and print in line, a target that is a mixture of stacks is shown as that mixture times the brightness.
#[test]
fn in_line_a_mixture_of_stacks_is_shown_as_the_closed_form_says() {
    let library = Library::builtin();
    let names = stacks(&["MS+F", "K", "W", "MS"]);
    // Closed cells are dark, and cells end where pixels do.
    let perfect = Screen { closed: 0.0, pitch_mm: 8.0 / DOTS_PER_MM, ..screen() };
    let grid = Grid::new(perfect, names.clone(), (3, 2), &library, ROOM).unwrap();
    let space = Space::half_angle(32);
    let looks = reflectances(&names, &library, &space);
    let mixtures = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.5, 0.0, 0.5, 0.0],
        [0.1, 0.2, 0.3, 0.4],
    ];
    let mixed = |mixture: &[f64; 4]| -> Vec<f32> {
        let column = |j: usize| (0..4).map(|q| mixture[q] * looks.row(q)[j]).sum::<f64>() as f32;
        (0..space.columns()).map(column).collect()
    };
    let image = Rows(3, 2, space.clone(), mixtures.iter().map(mixed).collect());
    let frame = Frame::for_image(&grid, &image, &library).unwrap();
    assert!(frame.distance.unwrap().0 < 1e-4, "{:?}", frame.distance);
    let weights = seen(&grid, &frame, &Placed::default(), &HEAD_ON);
    assert!((grid.brightness() - 0.25 * 0.3 * 0.3).abs() < 1e-12);
    for (pixel, mixture) in weights.chunks_exact(4).zip(&mixtures) {
        let shown: Vec<f64> = pixel.iter().map(|w| w / grid.brightness()).collect();
        // A step of the screen's values is up to 2 % of a cell.
        for (shown, share) in shown.iter().zip(mixture) {
            assert!((shown - share).abs() < 0.01, "{shown:?} for {mixture:?}");
        }
    }
}

/// The closed form with its leak, where the pitch is a whole number of dots: exactly `a_q T^2`.
#[test]
fn on_whole_dots_weights_are_shares_times_the_square_of_what_passes() {
    let screen = Screen { pitch_mm: 8.0 / DOTS_PER_MM, ..screen() };
    let grid = Grid::new(screen, stacks(&["MS", "K", "W"]), (4, 3), &Library::builtin(), ROOM).unwrap();
    let (across, down) = grid.cells();
    let values: Vec<u8> = (0..across * down).map(|i| (i * 37 % 256) as u8).collect();
    let frame = Frame { values, distance: None };
    let weights = seen(&grid, &frame, &Placed::default(), &HEAD_ON);
    for (i, weights) in weights.chunks_exact(3).enumerate() {
        let mut expected = [0.0; 3];
        for (ty, tx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let (x, y) = (MARGIN + i % 4 * 2 + tx, MARGIN + i / 4 * 2 + ty);
            let passes = screen.passes(frame.values[y * across + x]);
            expected[grid.stack_in_tile(tx, ty)] += 0.25 * passes * passes;
        }
        for (found, expected) in weights.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "pixel {i}: {weights:?}, not {expected:?}");
        }
    }
}

/// Sampled: thousands of places of a pixel, each with the dot that is printed there and the mask's own pixels on both ways.
#[test]
fn beside_its_place_and_behind_glass_what_is_seen_is_the_mean_over_places() {
    let library = Library::builtin();
    let screen = Screen { cell: 2, pitch_mm: 0.19, ..screen() };
    let names = stacks(&["MS", "K", "W", "MS+C"]);
    let grid = Grid::new(screen, names.clone(), (3, 2), &library, ROOM).unwrap();
    let (across, down) = grid.cells();
    let values = (0..across * down).map(|i| if i * 7919 % 13 < 6 { 255 } else { (i * 31 % 256) as u8 });
    let frame = Frame { values: values.collect(), distance: None };
    let (dots, mask, (left, top)) = (grid.dots().unwrap(), frame.picture(&grid), grid.origin());
    let placed = Placed { shift_mm: [0.11, -0.23], depth_mm: 0.7 };
    let sight = Sight { light: direction(-35.0, 20.0), eye: direction(25.0, -10.0) };
    let weights = seen(&grid, &frame, &placed, &sight);
    // Refraction by Snell's law, told anew: the angle in the glass, then the way across.
    let crossing = |to: [f64; 3]| {
        let outside = to[2].acos();
        let inside = (outside.sin() / 1.5).asin();
        let long = placed.depth_mm * inside.tan();
        let azimuth = to[1].atan2(to[0]);
        [long * azimuth.cos() - placed.shift_mm[0], -long * azimuth.sin() - placed.shift_mm[1]]
    };
    let ways = [crossing(sight.light), crossing(sight.eye)];
    const SIDE: usize = 400;
    for (i, weights) in weights.chunks_exact(4).enumerate() {
        let edge = |cell: usize| grid.edge(cell) as f64 / DOTS_PER_MM;
        let (x, y) = (MARGIN + i % 3 * 2, MARGIN + i / 3 * 2);
        let (from, to) = ([edge(x), edge(y)], [edge(x + 2), edge(y + 2)]);
        let mut sums = [0.0; 4];
        for place in 0..SIDE * SIDE {
            let at = |c: usize, i: usize| from[c] + (to[c] - from[c]) * (i as f64 + 0.5) / SIDE as f64;
            let at = [at(0, place % SIDE), at(1, place / SIDE)];
            let dot = [(at[0] * DOTS_PER_MM) as usize, (at[1] * DOTS_PER_MM) as usize];
            let stack = &dots.stacks()[usize::from(dots.index()[dot[1] * dots.width() + dot[0]])];
            let q = names.iter().position(|known| known == stack).expect("a stack of the grid");
            let passes = ways.map(|way| {
                let pixel = |c: usize| ((at[c] + way[c]) / screen.pitch_mm).floor() as u32;
                screen.passes(mask.at(left + pixel(0), top + pixel(1)))
            });
            sums[q] += passes[0] * passes[1] / (SIDE * SIDE) as f64;
        }
        for (found, sum) in weights.iter().zip(sums) {
            assert!((found - sum).abs() < 0.01 * sum + 2e-5, "pixel {i}: {weights:?}, sampled {sums:?}");
        }
    }
}

#[test]
fn the_alignment_frame_is_dark_only_in_line() {
    let library = Library::builtin();
    let screen = Screen { pitch_mm: 8.0 / DOTS_PER_MM, ..screen() };
    let grid = Grid::new(screen, stacks(&["W", "K"]), (6, 5), &library, ROOM).unwrap();
    let frame = Frame::alignment(&grid);
    let (dots, mask, (left, top)) = (grid.dots().unwrap(), frame.picture(&grid), grid.origin());
    // Light through the slits of the margin falls on black, and a whole pixel beside on paper.
    let bright = |dx: u32, dy: u32| {
        let (across, down) = grid.cells();
        let mut paper = 0;
        for (y, x) in (0..down).flat_map(|y| (0..across).map(move |x| (y, x))) {
            let margin = x.min(across - 1 - x) < MARGIN || y.min(down - 1 - y) < MARGIN;
            let open = mask.at(left + x as u32, top + y as u32) == 255;
            let (x, y) = (x + dx as usize, y + dy as usize);
            if margin && open && x < across && y < down {
                let dot = (grid.edge(y) + 2) * dots.width() + grid.edge(x) + 2;
                paper += usize::from(dots.index()[dot] == 0);
            }
        }
        paper
    };
    assert_eq!(bright(0, 0), 0);
    assert!(bright(1, 0) >= 4 * 8 && bright(0, 1) >= 4 * 8, "{} {}", bright(1, 0), bright(0, 1));
    // Inside, every pixel shows the first stack alone, and all pixels the same.
    let weights = seen(&grid, &frame, &Placed::default(), &HEAD_ON);
    assert!(weights.chunks_exact(2).all(|w| w[0] > 0.03 && w[1] < 1e-5), "{weights:?}");
}

proptest! {
    /// Every choice of unknowns at their bounds, the others in closed form: the best feasible one is the minimum.
    #[test]
    fn the_bounded_quadratic_is_the_best_of_all_active_sets(
        rows in prop::collection::vec(prop::array::uniform5(-1.0f64..1.0), 3), target in prop::array::uniform5(-2.0f64..2.0),
    ) {
        let dot = |a: &[f64; 5], b: &[f64; 5]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let hessian: Vec<f64> = (0..9).map(|i| dot(&rows[i / 3], &rows[i % 3])).collect();
        let slope: Vec<f64> = rows.iter().map(|row| -dot(row, &target)).collect();
        let value = |u: &[f64]| {
            let miss: Vec<f64> = (0..5).map(|j| (0..3).map(|q| u[q] * rows[q][j]).sum::<f64>() - target[j]).collect();
            miss.iter().map(|m| m * m).sum::<f64>()
        };
        let mut found = vec![0.0; 3];
        within(&hessian, &slope, &[(0.1, 1.0); 3], &mut found);
        // From a start of 0.1 the model is that of a start of 0 by its slope there.
        prop_assert!(found.iter().all(|u| (0.1..=1.0).contains(u)));
        let mut best = f64::INFINITY;
        for set in 0..27 {
            let state = [set % 3, set / 3 % 3, set / 9];
            let mut u = state.map(|s| [0.1, 1.0, f64::NAN][s]);
            let free: Vec<usize> = (0..3).filter(|&q| state[q] == 2).collect();
            // Gauss-Jordan on the free unknowns.
            let mut system: Vec<Vec<f64>> = free.iter().map(|&q| {
                let fixed: f64 = (0..3).filter(|k| !free.contains(k)).map(|k| hessian[q * 3 + k] * u[k]).sum();
                free.iter().map(|&k| hessian[q * 3 + k]).chain([-slope[q] - fixed]).collect()
            }).collect();
            let n = free.len();
            let mut singular = false;
            for p in 0..n {
                let pivot = (p..n).max_by(|&a, &b| system[a][p].abs().total_cmp(&system[b][p].abs())).unwrap();
                system.swap(p, pivot);
                singular |= system[p][p].abs() < 1e-9;
                for r in (0..n).filter(|&r| r != p) {
                    let factor = system[r][p] / system[p][p];
                    let pivot = system[p].clone();
                    system[r].iter_mut().zip(pivot).for_each(|(at, by)| *at -= factor * by);
                }
            }
            if singular {
                continue;
            }
            free.iter().enumerate().for_each(|(p, &q)| u[q] = system[p][n] / system[p][p]);
            if u.iter().all(|u| (0.1 - 1e-9..=1.0 + 1e-9).contains(u)) {
                best = best.min(value(&u));
            }
        }
        prop_assert!(value(&found) <= best + 1e-7, "{} against {best}", value(&found));
    }

    /// No place of a fine grid of openings is better than what the solver finds.
    #[test]
    fn no_opening_of_two_stacks_is_nearer(
        a in 0usize..57, b in 0usize..57, diffuse in prop::array::uniform3(0.0f64..0.9), f0 in 0.0f64..0.9, alpha in 0.05f64..0.6,
    ) {
        let (library, space) = (Library::builtin(), Space::half_angle(32));
        let all: Vec<Stack> = library.entries().iter().map(|entry| entry.stack.clone()).collect();
        let rows = reflectances(&[all[a].clone(), all[b].clone()], &library, &space);
        let leak = 1e-4;
        let solver = Solver::of_rows(&space, &rows, &[1.0, 2.0], leak);
        let target: Vec<f32> = space.angles().iter().flat_map(|&t| {
            let lobe = f0 * inks::ggx::lobe(t, alpha);
            diffuse.map(|d| (d / std::f64::consts::PI + lobe) as f32)
        }).collect();
        let (open, distance) = solver.solve(&target);
        prop_assert!(open.iter().all(|u| (leak - 1e-12..=1.0 + 1e-12).contains(u)));
        let wide: Vec<f64> = target.iter().map(|&f| f64::from(f)).collect();
        let of = |u: f64, v: f64| {
            let mixed: Vec<f64> = rows.row(0).iter().zip(rows.row(1)).map(|(a, b)| u * a + 2.0 * v * b).collect();
            space.distance(&mixed, &wide)
        };
        prop_assert!((of(open[0], open[1]) - distance).abs() < 1e-9);
        const STEPS: usize = 40;
        for i in 0..=STEPS * STEPS {
            let part = |i: usize| leak + (1.0 - leak) * (i as f64 / STEPS as f64).powi(2);
            let other = of(part(i % (STEPS + 1)), part((i / (STEPS + 1)).min(STEPS)));
            prop_assert!(distance <= other + 1e-6, "{distance} at {open:?}, {other} on the grid");
        }
    }
}

#[test]
fn values_of_the_screen_pass_what_they_are_meant_to() {
    let screen = screen();
    for twice in [0.0, 0.01, 0.2, 0.5, 0.9, 1.0] {
        let passed = screen.passes(screen.value(twice)).powi(2) / screen.open.powi(2);
        assert!((passed - f64::max(twice, screen.leak())).abs() < 0.015, "{twice}: {passed}");
    }
    assert_eq!((screen.value(screen.leak()), screen.value(1.0)), (0, 255));
}

#[test]
fn the_best_stacks_are_those_the_image_is_made_of() {
    let (library, space) = (Library::builtin(), Space::half_angle(32));
    let names = stacks(&["MS", "K", "W+C"]);
    let looks = reflectances(&names, &library, &space);
    let rows = (0..3).map(|q| looks.row(q).iter().map(|&f| f as f32).collect()).collect();
    let target = Target { space: &space, rows };
    let candidates = stacks(&["substrate", "MS", "MG", "K", "W", "W+C", "W+M", "MS+F"]);
    let found = choose(&candidates, 3, &[target], &screen(), &library, &observe::Silent).unwrap();
    assert!(names.iter().all(|name| found.contains(name)), "{found:?}");
}

/// One pixel in four hundred is red, and the stacks that are chosen can show it.
#[test]
fn rare_colours_are_kept() {
    let (library, space) = (Library::builtin(), Space::half_angle(32));
    let looks = reflectances(&stacks(&["substrate", "K", "C", "M+Y"]), &library, &space);
    let look = |q: usize| looks.row(q).iter().map(|&f| f as f32).collect::<Vec<f32>>();
    let pixels =
        (0..40 * 40).map(|pixel| look(if pixel % 400 == 399 { 3 } else { pixel * 7 % 11 % 3 })).collect();
    let image = Rows(40, 40, space.clone(), pixels);
    let target = Target::sample(&image);
    assert!(target.rows.len() <= 64 && target.rows.iter().all(|row| row.len() == space.columns()));
    let candidates = stacks(&["substrate", "K", "C", "C+K", "W", "M+Y", "MS", "MG"]);
    let found = choose(&candidates, 4, &[target], &screen(), &library, &observe::Silent).unwrap();
    assert!(found.contains(&"M+Y".parse().unwrap()), "{found:?}");
}

#[test]
fn what_cannot_be_shown_is_said() {
    let library = Library::builtin();
    let said = |screen: Screen, names: &[&str], pixels| {
        Grid::new(screen, stacks(names), pixels, &library, ROOM).unwrap_err().to_string()
    };
    let two = ["MS", "K"];
    assert!(said(screen(), &["MS"], (2, 2)).contains("2 to 9"));
    assert!(said(screen(), &["MS", "K", "MS"], (2, 2)).contains("MS is given twice"));
    assert!(said(screen(), &two, (0, 2)).contains("0 x 2"));
    let fine = said(Screen { pitch_mm: 0.1, ..screen() }, &two, (2, 2));
    assert!(fine.contains("MS needs 16 dots") && fine.contains("--cell 2"), "{fine}");
    assert!(
        Grid::new(Screen { pitch_mm: 0.1, cell: 2, ..screen() }, stacks(&two), (2, 2), &library, ROOM)
            .is_ok()
    );
    let small = said(screen(), &two, (91, 20));
    assert!(small.contains("202 x 60") && small.contains("at most 90 x 19"), "{small}");
    let wide = Screen { pixels: (4000, 4000), ..screen() };
    let sheet = said(wide, &two, (600, 300));
    assert!(sheet.contains("does not fit on the sheet") && sheet.contains("at most 352 x 176"), "{sheet}");
    assert!(said(wide, &two, (usize::MAX, usize::MAX)).contains("at most"));
    for wrong in [
        Screen { pitch_mm: f64::NAN, ..screen() },
        Screen { pitch_mm: 0.0, ..screen() },
        Screen { cell: 0, ..screen() },
        Screen { open: 0.1, closed: 0.2, ..screen() },
        Screen { open: 1.5, ..screen() },
        Screen { pixels: (0, 4), ..screen() },
        Screen { pixels: (4, LONGEST + 1), ..screen() },
    ] {
        assert!(said(wrong, &two, (2, 2)).starts_with("screen: "), "{wrong:?}");
    }
    let grid = Grid::new(screen(), stacks(&two), (3, 3), &library, ROOM).unwrap();
    let image = Rows(2, 2, Space::half_angle(8), vec![vec![0.1; 24]]);
    assert!(Frame::for_image(&grid, &image, &library).unwrap_err().to_string().contains("2 x 2"));
}

/// A black image opens nothing, and one brighter than everything opens all.
#[test]
fn targets_out_of_reach_end_at_the_bounds() {
    let space = Space::half_angle(8);
    let mut rows = Table::new(24);
    rows.push(&[0.2; 24]);
    rows.push(&[0.1; 24]);
    let solver = Solver::of_rows(&space, &rows, &[1.0, 1.0], 0.01);
    assert_eq!(solver.solve(&[0.0; 24]).0, [0.01, 0.01]);
    assert_eq!(solver.solve(&[50.0; 24]).0, [1.0, 1.0]);
    let dark = Solver::of_rows(
        &space,
        &{
            let mut t = Table::new(24);
            t.push(&[0.0; 24]);
            t.push(&[0.0; 24]);
            t
        },
        &[1.0, 1.0],
        0.0,
    );
    assert!(dark.solve(&[0.1; 24]).1.is_finite());
}

#[test]
fn names_of_unknown_origin_stay_text() {
    let library = Library::builtin();
    let grid = Grid::new(screen(), stacks(&["MS", "K"]), (3, 3), &library, ROOM).unwrap();
    let hostile = "</script><img src=x onerror=alert(1)>{{data}}";
    let frames = [(hostile.to_owned(), Frame::alignment(&grid))];
    let subject = page::Subject {
        name: hostile,
        about: hostile,
        grid: &grid,
        frames: &frames,
        placed: Placed::default(),
        library: &library,
    };
    let text = page::page(&subject).unwrap();
    assert!(
        !text.contains("<img") && text.matches("</script>").count() == 2,
        "{}",
        text.matches("</script>").count()
    );
    assert!(!text.contains("\nimport ") && !text.contains("://"));
}
