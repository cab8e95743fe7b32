//! Error carried along in pictures: what it changes, and what it does not.

use super::diffusion::EARLY;
use super::figures::{figure_by, photograph};
use super::mixtures::{Rules, shares};
use super::tests::INKS;
use super::*;
use crate::colour::bound::seen;
use crate::colour::packed::key;
use crate::read::object_type::ObjectType;
use halftone::green_noise::USUAL;
use proptest::prelude::*;

/// The numbers of the stacks of keys in rows of `width`.
fn dots_of(keys: &[Key], width: usize, pictures: bool) -> Vec<u8> {
    let rows = |rows: Range<usize>, out: &mut [Key]| {
        out.copy_from_slice(&keys[width * rows.start..width * rows.end])
    };
    let (fit, solids) = &*INKS;
    super::dots(rows, (width, keys.len() / width), (fit, solids), Table::for_cluster(USUAL), pictures)
}

/// A rectangle of a page: left, top, width, height, a colour, and whether it is a picture of colours about
/// that.
type Rectangle = (usize, usize, usize, usize, [u8; 3], bool);

fn page((width, height): (usize, usize), rectangles: &[Rectangle]) -> Vec<Key> {
    let mut keys = vec![packed_white(); width * height];
    for &(left, top, wide, high, colour, is_picture) in rectangles {
        for (x, y) in (left..left + wide).flat_map(|x| (top..top + high).map(move |y| (x, y))) {
            let grain = ((x * 7 + y * 13) % 9) as u8;
            let colour = if is_picture { colour.map(|v| v.saturating_add(grain)) } else { colour };
            keys[y * width + x] = key(colour, !is_picture);
        }
    }
    keys
}

fn packed_white() -> Key {
    key([255; 3], false)
}

proptest! {
    /// A caption, a drawing or a photograph beside a picture changes none of its dots, nor any of a drawing.
    #[test]
    fn what_lies_beside_a_picture_changes_no_dot(
        first: [u8; 3], second: [u8; 3], is_picture: bool, left in 150usize..200, top in 0usize..300, high in 1usize..60
    ) {
        let (width, height) = (260, 400);
        let before = [(20, 60, 100, 300, first, true), (210, 10, 30, 300, first, false)];
        let added = (left, top, 40, high, second, is_picture);
        let plain = dots_of(&page((width, height), &before), width, true);
        let both = dots_of(&page((width, height), &[before[0], before[1], added]), width, true);
        for at in 0..plain.len() {
            let (x, y) = (at % width, at / width);
            let is_beside = (left.saturating_sub(HALO)..left + 40 + HALO).contains(&x)
                && (top.saturating_sub(HALO)..top + high + HALO).contains(&y);
            prop_assert!(is_beside || plain[at] == both[at], "{}, {}", x, y);
        }
    }

    #[test]
    fn any_number_of_threads_makes_the_same_picture(colour: [u8; 3], threads in 1usize..9) {
        let keys = page((120, 700), &[(10, 5, 100, 690, colour, true)]);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        prop_assert!(pool.install(|| dots_of(&keys, 120, true)) == dots_of(&keys, 120, true));
    }

    /// An even area has its mixture, whatever that is.
    #[test]
    fn an_area_has_the_shares_of_its_mixture(colour in prop::array::uniform3(1u8..255)) {
        let (width, height) = (200, 200);
        let dots = dots_of(&vec![key(colour, false); width * height], width, true);
        let mixtures = Mixtures::<16>::new(&INKS.0, &INKS.1);
        let wanted = mixtures.mean(&shares(&mixtures.flat(colour, false)));
        let mut counts = [0u32; 16];
        dots.iter().for_each(|&dot| counts[usize::from(dot)] += 1);
        let found: [u16; 16] = std::array::from_fn(|q| {
            let count = counts[usize::from(mixtures.order[q])];
            (u64::from(count) * u64::from(appearance::weights::ONE) / dots.len() as u64) as u16
        });
        let found = mixtures.mean(&found);
        for c in 0..3 {
            prop_assert!((wanted[c] - found[c]).abs() < 0.012, "{:?} and {:?}", wanted, found);
        }
    }
}

/// Rows about the border of two strips are as light as others.
#[test]
fn the_border_of_two_strips_is_no_seam() {
    let (width, height) = (600, 2 * STRIP_OF_PICTURES);
    let mut most: f64 = 0.0;
    for n in 0..50u32 {
        let colour = [n * 37 % 200 + 30, n * 91 % 200 + 30, n * 53 % 200 + 30].map(|v| v as u8);
        let dots = dots_of(&vec![key(colour, false); width * height], width, true);
        let light = |rows: Range<usize>| {
            let dots = &dots[width * rows.start..width * rows.end];
            let mut mean = [0.0; 3];
            for &dot in dots {
                let light = INKS.1.light(&INKS.0.stacks[usize::from(dot)]);
                mean.iter_mut().zip(light).for_each(|(mean, v)| *mean += v / dots.len() as f64);
            }
            seen(mean).l
        };
        // As many rows as an eye takes together at .3 m: half a millimetre.
        let mean = light(100..2 * STRIP_OF_PICTURES);
        let off = |at: usize| (light(at - 6..at + 6) - mean).abs();
        let others = (1..8).map(|n| off(STRIP_OF_PICTURES + 25 * n)).fold(0.0, f64::max);
        let own = off(STRIP_OF_PICTURES);
        println!("{colour:?}: {own:.2}, {others:.2}");
        most = most.max(own - others);
    }
    println!("{EARLY} rows early: {most}");
    assert!(most <= 0.3, "{most}");
}

/// A fifth less or more of what holds dots together and of the noise is hardly seen.
#[test]
fn a_fifth_of_a_rule_of_pictures_hardly_matters() {
    let art = photograph();
    let figure = |rules| figure_by(rules, &art, ObjectType::Picture, 2);
    let usual = figure(Rules::USUAL);
    for by in [0.8, 1.2] {
        for rules in [
            Rules { hold: by * Rules::USUAL.hold, ..Rules::USUAL },
            Rules { noise: by * Rules::USUAL.noise, ..Rules::USUAL },
        ] {
            let found = figure(rules);
            println!("hold {}, noise {}: {found:.2}, not {usual:.2}", rules.hold, rules.noise);
            assert!((found - usual).abs() < 0.5 && found < 2.5, "{found}, not {usual}");
        }
    }
}
