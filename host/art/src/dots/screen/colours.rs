//! What colours become, as an eye sees it: panels, pictures, ramps and what lies beyond the inks' reach.

use super::figures::{REACH, drawn, lights};
use super::mixtures::shares;
use super::tests::INKS;
use super::*;
use crate::colour::bound::seen;
use crate::colour::intent::{Hull, Intent, Light, oklab};
use palette::color_difference::Ciede2000;
use proptest::prelude::*;

/// The mean light of a colour's mixture: flat, or amid others in a picture.
fn printed(mixtures: &Mixtures<'_, 16>, colour: [u8; 3], is_flat: bool, is_drawn: bool) -> Light {
    let stops = match is_flat {
        true => mixtures.flat(colour, is_drawn),
        false => mixtures.stops(colour, is_drawn),
    };
    mixtures.mean(&shares(&stops))
}

fn apart(a: Light, b: Light) -> f64 {
    seen(a).difference(seen(b))
}

/// Greys that are neither paper nor black by name, and dark colours that the inks reach.
#[test]
fn dark_panels_have_the_colours_that_were_drawn() {
    let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
    let greys = (4..=248).map(|v| [v; 3]);
    let levels = [8u8, 16, 26, 36, 51, 64, 80];
    let dark =
        levels.into_iter().flat_map(|r| levels.into_iter().flat_map(move |g| levels.map(move |b| [r, g, b])));
    let mut most = (0.0, [0; 3]);
    for colour in greys.chain(dark).filter(|&colour| REACH.has(drawn(colour))) {
        let off = apart(printed(&mixtures, colour, true, true), drawn(colour));
        most = if off > most.0 { (off, colour) } else { most };
    }
    println!("worst: {:?}", most);
    assert!(most.0 <= 3.0, "{most:?}");
}

#[test]
fn what_programs_write_for_black_and_nearly_paper_is_one_stack() {
    let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
    for (colours, named) in [
        (&[[35, 31, 32], [29, 29, 27]][..], [0; 3]),
        (&[[250, 250, 250], [253, 253, 252], [255, 254, 252]], [255; 3]),
    ] {
        for &colour in colours {
            for drawn in [false, true] {
                assert_eq!(mixtures.flat(colour, drawn), mixtures.stops(named, drawn), "{colour:?}");
            }
        }
    }
    // Cream is a colour, and so is a dark grey.
    for colour in [[255, 250, 235], [34, 34, 34], [245; 3]] {
        assert!(!mixtures::is_alone(&mixtures.flat(colour, true)), "{colour:?}");
    }
}

/// Every way from one to another of paper, black and the six primaries: what is printed of a step of it.
#[test]
fn ramps_between_solids_have_no_step_that_is_seen() {
    let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
    let corner = |bits: usize| [4, 2, 1].map(|bit| if bits & bit > 0 { 255.0 } else { 0.0 });
    let mut worst = (0.0, [0.0; 3], [0.0; 3], 0, false);
    for (a, b, is_drawn) in (0..8).flat_map(|a| (a + 1..8).flat_map(move |b| [(a, b, false), (a, b, true)])) {
        let (a, b) = (corner(a), corner(b));
        let at = |step: u32| -> [u8; 3] {
            std::array::from_fn(|c| (a[c] + (b[c] - a[c]) * f64::from(step) / 255.0).round() as u8)
        };
        let means: Vec<Light> = (0..256).map(|step| printed(&mixtures, at(step), true, is_drawn)).collect();
        // The room's light on the sheet, by which an eye sees less of what is darkest.
        let lit = |light: Light| light.map(|v| (v + 0.02) / 1.02);
        for (step, pair) in (0..).zip(means.windows(2)) {
            // What is nearly paper is paper.
            if crate::colour::bound::is_paper(at(step)) || crate::colour::bound::is_paper(at(step + 1)) {
                continue;
            }
            // Through grey, the art itself has steps.
            let own = apart(lit(drawn(at(step))), lit(drawn(at(step + 1))));
            let off = apart(lit(pair[0]), lit(pair[1]));
            let off = if off > own + 1.0 { off } else { 0.0 };
            worst = if off > worst.0 { (off, a, b, step, is_drawn) } else { worst };
        }
    }
    println!("{worst:?}");
    assert!(worst.0 <= 1.8, "{worst:?}");
}

/// A dense sample of what the inks reach has nothing of the hue that is nearer.
#[test]
fn beyond_reach_the_nearest_printable_colour_of_the_hue_is_taken() {
    let hull = Hull::new(&lights());
    let level = |n: usize| (n * 17) as u8;
    let mut beyond = 0;
    for at in 0..4096 {
        let colour = drawn([level(at / 256), level(at / 16 % 16), level(at % 16)]);
        if REACH.has(colour) {
            continue;
        }
        beyond += 1;
        let (own, found) = (oklab(colour), oklab(hull.map(colour, Intent::Colorimetric)));
        let far = (0..3).map(|i| (own[i] - found[i]).powi(2)).sum::<f64>().sqrt();
        let (_, least) = REACH.nearest(colour);
        // The sample has hues half a degree away, too, which an edge of the hull makes nearer.
        assert!(far <= least + 0.008, "{colour:?}: {far}, not {least}");
        let turn = (own[1] * found[2] - own[2] * found[1]).atan2(own[1] * found[1] + own[2] * found[2]);
        // What is nearly grey has no hue.
        assert!(
            turn.to_degrees().abs() <= 1.0 || found[1].hypot(found[2]) < 0.01,
            "{colour:?} turns by {turn}"
        );
    }
    assert!(beyond > 1000, "{beyond}");
}

/// Navy lies nearer to two inks than to what is teal.
#[test]
fn navy_is_blue() {
    let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
    for is_drawn in [false, true] {
        let off = apart(printed(&mixtures, [0, 0, 128], true, is_drawn), drawn([0, 0, 128]));
        println!("{is_drawn}: {off}");
        assert!(!is_drawn || off <= 3.6, "{off}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1331))]

    #[test]
    fn a_panel_and_a_picture_of_one_colour_hardly_differ(colour: [u8; 3]) {
        let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
        let off = apart(printed(&mixtures, colour, true, false), printed(&mixtures, colour, false, false));
        prop_assert!(off <= 2.0, "{off}");
    }
}

#[test]
fn panels_and_pictures_differ_by_little_on_average() {
    let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
    let level = |n: usize| (n * 255 / 10) as u8;
    let off = |at: usize| {
        let colour = [level(at / 121), level(at / 11 % 11), level(at % 11)];
        apart(printed(&mixtures, colour, true, false), printed(&mixtures, colour, false, false))
    };
    let mean = (0..1331).map(off).sum::<f64>() / 1331.0;
    println!("mean {mean}");
    assert!(mean <= 0.3, "{mean}");
}
