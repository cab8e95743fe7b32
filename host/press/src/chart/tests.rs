use super::*;
use crate::layout::{Layout, Mm, Point, Position, Profile, arrange};
use halftone::Method;
use inks::{Library, Stack};
use observe::Silent;
use protocol::ink::Ink;
use protocol::paper::Paper;
use sheet::DotMap;

fn stack(text: &str) -> Stack {
    text.parse().unwrap()
}

/// Dots of each stack in a rectangle, by name.
fn count(chart: &DotMap, (x, y, width, length): (usize, usize, usize, usize), wanted: &str) -> usize {
    let number = chart.stacks().iter().position(|s| *s == stack(wanted));
    (y..y + length)
        .map(|row| {
            let row = &chart.index()[row * chart.width() + x..][..width];
            row.iter().filter(|&&dot| Some(usize::from(dot)) == number).count()
        })
        .sum()
}

#[test]
fn a_ramp_has_the_tone_of_its_place() {
    let chart = ramp(&stack("MS"), &stack("MS+C"), Method::Cells, &Library::builtin(), &Silent).unwrap();
    let place = super::ramp::parts().ramp;
    for tenth in 0..10 {
        let width = chart.width() / 10;
        let place = (tenth * width, place.top, width, place.length);
        let share = count(&chart, place, "MS") as f64 / (width * place.3) as f64;
        let want = 0.95 - 0.1 * tenth as f64;
        assert!((share - want).abs() < 0.01, "{tenth}: {share} {want}");
    }
    assert_eq!(count(&chart, (0, place.top, chart.width(), place.length), "substrate"), 0);
}

/// Dots joined to this one by their sides, by spreading.
fn joined(chart: &DotMap, start: (usize, usize)) -> Vec<(usize, usize)> {
    let at = |(x, y): (usize, usize)| chart.index()[y * chart.width() + x];
    let mut found = vec![start];
    let mut next = 0;
    while let Some(&(x, y)) = found.get(next) {
        next += 1;
        for near in [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)] {
            if at(near) == at(start) && !found.contains(&near) {
                found.push(near);
            }
        }
    }
    found
}

#[test]
fn a_ramp_has_clusters_of_every_size_and_solids_of_both_stacks() {
    let chart = ramp(&stack("K"), &stack("MS"), Method::Cells, &Library::builtin(), &Silent).unwrap();
    let parts = super::ramp::parts();
    assert_eq!((chart.width(), chart.length()), parts.size);
    for (row, (own, other)) in parts.clusters.iter().zip([("K", "MS"), ("MS", "K")]) {
        assert_eq!(row.len(), super::ramp::MOST);
        for (dots, patch) in (1..).zip(row) {
            let place = (patch.left, patch.top, patch.width, patch.length);
            let (inked, ground) = (count(&chart, place, own), count(&chart, place, other));
            assert_eq!(inked + ground, patch.width * patch.length);
            let share = inked as f64 / (inked + ground) as f64;
            assert!((0.07..0.14).contains(&share), "{own} of {dots} dots: {share}");
            let number = chart.stacks().iter().position(|s| *s == stack(own)).unwrap() as u8;
            let wide = chart.width();
            let row = |y: usize| (patch.left..patch.left + patch.width).map(move |x| y * wide + x);
            let mut left: Vec<usize> = (patch.top..patch.top + patch.length).flat_map(row).collect();
            left.retain(|&i| chart.index()[i] == number);
            while let Some(&first) = left.first() {
                let cluster = joined(&chart, (first % chart.width(), first / chart.width()));
                assert_eq!(cluster.len(), dots);
                left.retain(|i| !cluster.contains(&(i % chart.width(), i / chart.width())));
            }
        }
    }
    // Foil in clusters of fewer than 3 x 3 dots is not printed.
    let foil = ramp(&stack("SF"), &stack("MS"), Method::Cells, &Library::builtin(), &Silent).unwrap();
    for (dots, patch) in (1..).zip(&parts.clusters[0]) {
        let place = (patch.left, patch.top, patch.width, patch.length);
        assert_eq!(count(&foil, place, "SF") > 0, dots >= 9, "{dots}");
    }
    for (strips, name) in parts.solids.iter().zip(["K", "MS"]) {
        for strip in strips {
            let place = (strip.left, strip.top, strip.width, strip.length);
            assert_eq!(count(&chart, place, name), strip.width * strip.length, "{name} {strip:?}");
        }
    }
}

#[test]
fn a_ladder_keeps_four_levels_apart_where_clamping_keeps_two() {
    let chart = ladder(&stack("SF"), &stack("MS"), Method::Cells, &Library::builtin(), &Silent).unwrap();
    let (patch, gap) = (709, 94);
    let share = |row: usize, column: usize| {
        // In the middle of the patch, clear of its labels.
        let block = chart.length() / 2;
        let place = (column * (patch + gap), row * block + 80 + 24 + 2, patch, patch - 4);
        count(&chart, place, "SF") as f64 / (patch * (patch - 4)) as f64
    };
    let clamped: Vec<f64> = (0..4).map(|column| share(0, column)).collect();
    let mapped: Vec<f64> = (0..4).map(|column| share(1, column)).collect();
    // Figure 5: inks of gloss 10 and 50 %; levels of 100, 80, 50, 10 %.
    for (found, want) in clamped.iter().zip([1.0, 1.0, 1.0, 0.0]) {
        assert!((found - want).abs() < 0.005, "{clamped:?}");
    }
    for (found, want) in mapped.iter().zip([1.0, 7.0 / 9.0, 4.0 / 9.0, 0.0]) {
        assert!((found - want).abs() < 0.005, "{mapped:?}");
    }
}

#[test]
fn every_stack_has_a_patch_of_its_own_that_is_solid() {
    let all: Vec<Stack> = ["substrate", "C", "K", "MS", "MS+C", "MS+C+F"].map(stack).to_vec();
    let chart = stacks(&all, Paper::A4, None).unwrap();
    for wanted in &all[1..] {
        let number = chart.stacks().iter().position(|s| s == wanted).unwrap() as u8;
        let dots = chart.index().iter().filter(|&&dot| dot == number).count();
        // A patch of 20 x 20 mm; black also writes the labels.
        assert!(
            if wanted.to_string() == "K" { dots > 472 * 472 } else { dots == 472 * 472 },
            "{wanted}: {dots}"
        );
    }
    let many: Vec<Stack> = (1..200).map(|n| Stack::new(vec![Ink::White; n])).collect();
    assert!(stacks(&many, Paper::A4, None).unwrap_err().to_string().contains("choose fewer inks"));
    // Six strips go round a food can, and seven do not.
    let can = Some("37x110".parse::<Can>().unwrap());
    let chart = stacks(&many[1..7], Paper::A4, can).unwrap();
    assert_eq!(chart.width(), (1.8 * 37.0 * 600.0 / 25.4_f64).round() as usize);
    let said = stacks(&many[1..8], Paper::A4, can).unwrap_err().to_string();
    assert!(said.contains("7 stacks") && said.contains("room for 6"), "{said}");
    for wrong in ["", "x", "33x", "19", "nan", "33x-5", "inf"] {
        assert!(wrong.parse::<Can>().is_err(), "{wrong}");
    }
}

#[test]
fn a_page_without_room_is_refused_before_a_chart_is_made() {
    let (k, paper) = (stack("K"), stack("substrate"));
    let library = Library::builtin();
    let sizes = [
        (super::ramp::parts().size, ramp(&k, &paper, Method::Cells, &library, &Silent).unwrap()),
        (size_of_ladder(), ladder(&k, &paper, Method::Cells, &library, &Silent).unwrap()),
        (size_of_halftones(&k, &paper), halftones(&k, &paper, &library, &Silent).unwrap()),
    ];
    for (size, chart) in sizes {
        assert_eq!(size, (chart.width(), chart.length()));
        let a4 = Layout::centred(Paper::A4);
        assert_eq!(check_room("ramp", size, &a4), Ok(()));
        let postcard = Layout::centred(Paper::Custom { width: 900, length: 900 });
        assert!(matches!(check_room("ramp", size, &postcard), Err(ChartError::Paper { .. })));
        assert_eq!(check_room("ramp", size, &Layout { cut: true, ..postcard }), Ok(()));
        let beside = Layout { position: Position::FromEdge("190x9mm".parse().unwrap()), ..a4 };
        assert!(matches!(check_room("ramp", size, &beside), Err(ChartError::Beyond { .. })));
    }
}

#[test]
fn lines_of_a_vernier_meet_in_the_middle_and_a_dot_apart_for_each_line_from_it() {
    let chart = registration(&[Ink::Black, Ink::White], Paper::A4).unwrap();
    let row_of = |text: &str, from: usize| -> Vec<usize> {
        let number = chart.stacks().iter().position(|s| *s == stack(text)).unwrap() as u8;
        let row = &chart.index()[from * chart.width()..][..chart.width()];
        (1..row.len()).filter(|&x| row[x] == number && row[x - 1] != number).collect()
    };
    // The first row that has 21 lines of white at each side; 10 rows above it the black ones.
    let white = (0..chart.length()).find(|&y| row_of("W", y).len() == 42).unwrap();
    let (other, first) = (row_of("W", white), row_of("K", white - 10));
    assert_eq!(first.len(), 42);
    for i in 0..42 {
        assert_eq!(other[i] as i64 - first[i] as i64, (i % 21) as i64 - 10);
    }
    assert!(other[20] < chart.width() / 4 && other[21] > chart.width() / 4 * 3);
    assert!(matches!(registration(&[Ink::Black], Paper::A4), Err(ChartError::OneInk)));
    assert!(registration(&Ink::ALL, Paper::A4).is_err());
}

#[test]
fn a_machine_that_is_measured_and_corrected_prints_the_crosses_where_they_belong() {
    // The machine as it really is, and what a ruler finds on its calibration chart.
    for real in [([0.5, -0.8], 1.004), ([-1.0, 2.0], 0.99)] {
        let real = Profile { offset_mm: real.0, feed: real.1, ..Profile::default() };
        let chart = calibration(Ink::Black, Paper::A4, &[]).unwrap();
        let lands = |chart: &DotMap, layout: &Layout| -> Vec<(f64, f64)> {
            let sheet = arrange(chart, layout, &Silent).unwrap().sheet;
            let width = sheet.width();
            // Rows of ink 14 mm long are the level arms of the crosses.
            let arm = 14 * 600 / 26;
            let mut rows: Vec<usize> = Vec::new();
            let mut column = 0;
            for (y, row) in sheet.index().chunks(width).enumerate() {
                if let Some(x) = (0..600).find(|&x| row[x..x + arm].iter().all(|&dot| dot != 0)) {
                    rows.push(y);
                    column = x;
                }
            }
            let (upper, lower): (Vec<usize>, Vec<usize>) = rows.iter().partition(|&&y| y < 3000);
            [upper, lower]
                .iter()
                .map(|rows| {
                    let row = rows.iter().sum::<usize>() as f64 / rows.len() as f64 + 0.5;
                    let x = 3.386667 + (column as f64) / 600.0 * 25.4 + 7.0 + real.offset_mm[0];
                    (x, 12.022667 + real.offset_mm[1] + real.feed * row / 600.0 * 25.4)
                })
                .collect()
        };
        let uncorrected = Layout::centred(Paper::A4);
        let seen = lands(&chart, &uncorrected);
        let found =
            calibration::profile(Point(Mm(seen[0].0), Mm(seen[0].1)), Some(Mm(seen[1].1 - seen[0].1)));
        assert!((found.feed - real.feed).abs() < 3e-4, "{found:?}");
        for (found, real) in found.offset_mm.iter().zip(real.offset_mm) {
            assert!((found - real).abs() < 0.1, "{found:?} {real}");
        }
        let corrected = Layout { profile: found, cut: true, ..uncorrected };
        let crosses = lands(&chart, &corrected);
        for (cross, y) in crosses.iter().zip([30.0, 230.0]) {
            assert!((cross.0 - 20.0).abs() < 0.1 && (cross.1 - y).abs() < 0.1, "{crosses:?}");
        }
    }
}

#[test]
fn charts_refuse_what_shows_nothing() {
    let library = Library::builtin();
    assert!(matches!(
        ramp(&stack("C"), &stack("C"), Method::Cells, &library, &Silent),
        Err(ChartError::Same { .. })
    ));
    let small = calibration(Ink::Black, Paper::Postcard, &[]).unwrap_err().to_string();
    assert!(small.contains("postcard") && small.contains("a4"), "{small}");
}

/// Each column has the tones it says, on the same places; its labels stand clear of the patches.
#[test]
fn the_halftones_have_the_same_tones() {
    let print = |a: &str, b: &str| halftones(&stack(a), &stack(b), &Library::builtin(), &Silent).unwrap();
    let chart = print("K", "substrate");
    let (patch, column, row) = ((709, 236), 709 + 47, 60 + 24 + 236 + 47);
    assert_eq!(chart.width(), 6 * column - 47);
    for screen in 0..6 {
        for (j, want) in [0.5, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9].into_iter().enumerate() {
            let place = (screen * column, 80 + 47 + j * row + 60 + 24, patch.0, patch.1);
            let share = count(&chart, place, "K") as f64 / (patch.0 * patch.1) as f64;
            assert!((share - want).abs() < 0.004, "screen {screen}, patch {j}: {share} {want}");
        }
        // Text has the share of its tone on as many dots in every column.
        let ink = |j: usize| {
            let place = (screen * column, 80 + 47 + (9 + j) * row + 60 + 24, patch.0, patch.1);
            count(&chart, place, "K") as f64
        };
        for (j, want) in [0.2, 0.5].into_iter().enumerate() {
            assert!((ink(j) / ink(2) * 0.8 / want - 1.0).abs() < 0.1, "screen {screen}, text {j}");
        }
    }
    assert_eq!(print("SF", "MS").width(), 3 * column - 47);
}

#[test]
fn the_first_sheet_has_four_bars_where_a_ruler_looks_for_them_in_a_job_of_less_than_two_kilobytes() {
    use super::first::{APART, BARS, PLACE, WIDE};
    let dots = |mm: f64| (mm * 600.0 / 25.4).round() as usize;
    for paper in [Paper::A4, Paper::Postcard] {
        let chart = first(Ink::Black, paper).unwrap();
        let (x, top) = (dots(PLACE.0) - 80, usize::from(paper.top()));
        for bar in 0..BARS {
            let y = dots(PLACE.1 + APART * bar as f64) - top;
            let place = (x - 20, y - 20, dots(WIDE) + 40, dots(1.0) + 40);
            assert!(count(&chart, place, "K").abs_diff(dots(1.0) * dots(WIDE)) < 150, "{paper:?} {bar}");
        }
        let all = count(&chart, (0, 0, chart.width(), chart.length()), "K");
        assert!(all.abs_diff(BARS * dots(1.0) * dots(WIDE)) < 500);
        let library = Library::builtin();
        let layout = Layout::centred(paper);
        let allowed = inks::InkSet::of([Ink::Black]);
        let request = crate::pipeline::Request {
            name: "first",
            dots: &chart,
            layout: &layout,
            handling: crate::job::Handling { media: protocol::rgl::Media::Plain, curl_correction: true },
            allowed,
            library: &library,
        };
        assert!(crate::pipeline::job(&request, &Silent).unwrap().bytes.len() < 2000);
    }
    let small = Paper::Custom { width: 500, length: 4000 };
    assert!(matches!(first(Ink::Black, small), Err(ChartError::Paper { chart: "first", .. })));
}

#[test]
fn a_strip_for_each_ink_has_every_row_of_the_head_by_itself() {
    let inks = [Ink::Black, Ink::White, Ink::MetallicGold];
    let chart = heads(&inks, Paper::A4).unwrap();
    for ink in inks {
        let number = chart.stacks().iter().position(|s| *s == Stack::new([ink])).unwrap();
        let has = |x: usize, y: usize| usize::from(chart.index()[y * chart.width() + x]) == number;
        let within = |y: &usize| (0..chart.width()).any(|x| has(x, *y));
        let rows: Vec<usize> = (0..chart.length()).filter(within).collect();
        // More than the band of 10 mm that the head prints at once.
        assert!(rows.len() as f64 * 25.4 / 600.0 > 11.0, "{ink:?}: {} rows", rows.len());
        for &y in &rows {
            let alone = (0..chart.width()).any(|x| has(x, y) && !has(x, y - 1) && !has(x, y + 1));
            assert!(alone, "{ink:?}, row {y}");
        }
        let columns: Vec<usize> = (0..chart.width()).filter(|&x| rows.iter().any(|&y| has(x, y))).collect();
        let wide = (columns[columns.len() - 1] - columns[0]) as f64 * 25.4 / 600.0;
        assert!(wide < 17.0, "{ink:?} takes {wide} mm of ribbon for each band");
    }
}
