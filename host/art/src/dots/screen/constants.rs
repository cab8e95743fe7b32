//! What does not matter to dots: how blocks are looked at, and a fifth of each rule of edges and of mixtures.

use std::collections::HashSet;

use super::figures::{GREY, SIDE as ART, SIZES, figure_by, map, softened, text};
use super::mixtures::Rules;
use super::tests::{Art, INKS, stack};
use super::*;
use crate::colour::packed::key;
use crate::dots::edges::{self, Edges};
use crate::read::object_type::ObjectType;
use halftone::green_noise::USUAL;
use proptest::prelude::*;

proptest! {
    /// Blocks are a short cut: a dot is flat by its own neighbours.
    #[test]
    fn a_dot_is_flat_by_its_neighbours(
        width in 1usize..150, height in 1usize..12, seed: u32, rare in 1u32..400,
    ) {
        let random = |at: usize| (at as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 8;
        let plain: Vec<Key> =
            (0..width * height).map(|at| key([if random(at) % rare == 0 { 9 } else { 200 }; 3], random(at) & 64 > 0 && rare < 50)).collect();
        let rows = |rows: Range<usize>, out: &mut [Key]| out.copy_from_slice(&plain[width * rows.start..width * rows.end]);
        let mut strip = Strip::default();
        // What was read before does not matter.
        strip.read(&rows, (width, height), (0, 0..height.div_ceil(2)));
        strip.read(&rows, (width, height), (0, 0..height));
        for at in 0..width * height {
            let (x, y) = (at % width, at / width);
            let near = (y.saturating_sub(1)..(y + 2).min(height)).flat_map(|v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| (u, v)));
            let alike = near.filter(|&(u, v)| (u, v) != (x, y) && plain[v * width + u] == plain[at]).count();
            prop_assert_eq!(strip.keys[at] & FLAT > 0, alike >= 2, "{}, {}", x, y);
            prop_assert_eq!(strip.keys[at] & AREA > 0, alike == 8 && plain[at] & DRAWN == 0, "{}, {}", x, y);
        }
    }
}

/// Each rule of edges by itself, a fifth less and more.
fn moved() -> Vec<(String, edges::Rules)> {
    let edges::Rules { tone, off, far_mm, area, stroke } = edges::Rules::USUAL;
    let usual = edges::Rules::USUAL;
    [0.8, 1.2]
        .into_iter()
        .flat_map(|by| {
            let times = |v: f64| v * by;
            [
                ("tone", edges::Rules { tone: times(tone.into()).round() as u8, ..usual }),
                ("off", edges::Rules { off: times(off.into()) as f32, ..usual }),
                ("far", edges::Rules { far_mm: times(far_mm), ..usual }),
                ("area", edges::Rules { area: times(area as f64).round() as usize, ..usual }),
                ("stroke", edges::Rules { stroke: times(stroke.into()) as f32, ..usual }),
            ]
            .map(|(name, rules)| (format!("{by} {name}"), rules))
        })
        .collect()
}

/// The dots of art in pixels of so many dots, by these rules.
fn by(rules: edges::Rules, art: &Art, coarse: usize) -> Vec<u8> {
    let soft = softened(art, coarse);
    let pixel = |x: usize, y: usize| key(soft.rgb[y * soft.width + x], false);
    let edges = Edges::by(rules, pixel, (soft.width, soft.height), (ART, ART));
    let (fit, solids) = &*INKS;
    let table = Table::for_cluster(USUAL);
    dots(|rows, out: &mut [Key]| edges.read(rows, out), (ART, ART), (fit, solids), table, false)
}

/// As many dots of soft black text are wrong as by the usual rules, or about so.
#[test]
fn a_fifth_of_a_rule_hardly_matters_to_soft_text() {
    let art = text(&[8.0, 12.0, 8.0, 12.0], [0; 3], [255; 3]);
    let ink = art.rgb.iter().filter(|rgb| **rgb == [0; 3]).count() as f64;
    let mut names = HashSet::new();
    for (coarse, most) in [(2, 0.05), (4, 0.12)] {
        for (name, rules) in moved() {
            let dots = by(rules, &art, coarse);
            let wrong =
                art.rgb.iter().zip(&dots).filter(|(rgb, dot)| (**rgb == [0; 3]) != (**dot == stack("K")));
            let wrong = wrong.count() as f64 / ink;
            println!("pixels of {coarse}, {name}: {wrong:.4}");
            assert!(wrong <= most, "{name}: {wrong} of the dots in pixels of {coarse}");
            names.insert(name);
        }
    }
    assert_eq!(names.len(), 10);
}

/// An eye sees the same by rules of which one is a fifth less or more.
#[test]
fn a_fifth_of_a_rule_of_mixtures_hardly_changes_what_an_eye_sees() {
    let Rules { least, apart, part, .. } = Rules::USUAL;
    let usual = Rules::USUAL;
    let moved = [4, 6].map(|fifths| {
        [
            Rules { least: (u32::from(least) * fifths / 5) as u16, ..usual },
            Rules { apart: apart * fifths / 5, ..usual },
            Rules { part: part * fifths / 5, ..usual },
        ]
    });
    let art = [
        ("grey text", text(&SIZES, GREY, [255; 3]), 1.0),
        ("navy text on a tint", text(&SIZES, [26, 79, 139], [225, 235, 245]), 2.9),
        ("map", map(), 1.5),
    ];
    for (name, art, most) in art {
        let before = figure_by(usual, &art, ObjectType::Drawing, 1);
        for rules in moved.as_flattened() {
            let found = figure_by(*rules, &art, ObjectType::Drawing, 1);
            let Rules { least, apart, part, .. } = rules;
            println!("{name}, {least} {apart} {part}: {found:.3}, not {before:.3}");
            assert!(
                found <= most && (found - before).abs() < 0.15,
                "{name}, {least} {apart} {part}: {found}, not {before}"
            );
        }
    }
}
