//! What dots depend on, and what does not matter to them.

use std::sync::LazyLock;

use super::mixtures::Rules;
use super::*;
use crate::colour::fit::Wishes;
use crate::colour::intent::Intent;
use crate::colour::packed::key;
use crate::dots::pixels::Pixels;
use crate::read::object_type::{INKS_OF_PICTURES, ObjectType};
use appearance::brdf::Space;
use appearance::document::SAMPLES;
use appearance::gamut::Printable;
use halftone::green_noise::USUAL;
use inks::{InkSet, Library};
use proptest::prelude::*;

/// The built-in library's process inks, fitted.
pub(super) static INKS: LazyLock<(Fit, Solids<'static>)> = LazyLock::new(|| inks(Intent::Auto));

/// The same by this intent.
pub(super) fn inks(intent: Intent) -> (Fit, Solids<'static>) {
    let space = Space::half_angle(SAMPLES);
    let process =
        InkSet::of(InkSet::default().iter().filter(|ink| ink.kind() == protocol::ink::Kind::Process));
    let printable: &'static Printable =
        Box::leak(Box::new(Printable::from_library(&Library::builtin(), &process, &space)));
    let solids = Solids::new(printable, &space);
    let wishes = Wishes { intent, gamma: 1.0, has_drawings: true, has_pictures: true };
    let fit = Fit::new((printable, &solids), &space, &wishes).unwrap();
    (fit, solids)
}

/// Art as it is drawn: the colour of each pixel.
#[derive(Clone, Debug)]
pub(super) struct Art {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<[u8; 3]>,
}

impl Art {
    pub fn new(width: usize, height: usize, rgb: impl Fn(usize, usize) -> [u8; 3]) -> Art {
        let rgb = (0..width * height).map(|at| rgb(at % width, at / width)).collect();
        Art { width, height, rgb }
    }

    /// The stack of each of so many dots.
    pub fn dots(&self, kind: ObjectType, dots: (usize, usize)) -> Vec<u8> {
        self.dots_by(Rules::USUAL, kind, dots)
    }

    /// The same by these rules.
    pub fn dots_by(&self, rules: Rules, kind: ObjectType, dots: (usize, usize)) -> Vec<u8> {
        let tag = if kind == ObjectType::Picture { ObjectType::PICTURE } else { ObjectType::DRAWING };
        let bytes = self.rgb.iter().flat_map(|&[r, g, b]| [tag, r, g, b]).collect();
        let pixels = Pixels { bytes, each: 4, width: self.width, height: self.height };
        let (fit, solids) = &*INKS;
        let mut mixtures = Mixtures::<16>::new(fit, solids);
        mixtures.rules = rules;
        let pictures = kind == ObjectType::Picture;
        let strip = if pictures { STRIP_OF_PICTURES } else { STRIP };
        strips::<16, 1>(
            &pixels.rows(dots, false),
            dots,
            (strip, pictures),
            &mixtures,
            Table::for_cluster(USUAL),
        )
    }

    fn at_dots(&self) -> Vec<u8> {
        self.dots(ObjectType::Drawing, (self.width, self.height))
    }
}

/// The number of a stack.
pub(super) fn stack(name: &str) -> u8 {
    INKS.0.stacks.iter().position(|stack| stack.to_string() == name).unwrap() as u8
}

#[test]
fn a_colour_that_is_a_stack_is_that_stack() {
    let names = [
        ([255, 255, 255], "substrate"),
        ([0, 0, 0], "K"),
        ([0, 255, 255], "C"),
        ([255, 0, 255], "M"),
        ([255, 255, 0], "Y"),
        ([255, 0, 0], "M+Y"),
        ([0, 255, 0], "C+Y"),
        ([0, 0, 255], "C+M"),
        ([35, 31, 32], "K"),
        ([252, 252, 252], "substrate"),
    ];
    for (colour, name) in names {
        for kind in [ObjectType::Drawing, ObjectType::Picture] {
            // Between other colours, and as a line of one dot.
            let art = Art::new(64, 64, |x, y| match (x, y) {
                (4..40, 4..40) => colour,
                (50, _) => colour,
                _ => [200, 190, 120],
            });
            let dots = art.dots(kind, (64, 64));
            // What is nearly a stack is one in areas of pictures, and everywhere in drawings.
            let is_corner = colour.iter().all(|&v| v == 0 || v == 255);
            let inside = |at: usize| (5..39).contains(&(at % 64)) && (5..39).contains(&(at / 64));
            let all = art.rgb.iter().enumerate().filter(|(_, found)| **found == colour);
            for (at, _) in all.filter(|&(at, _)| is_corner || kind == ObjectType::Drawing || inside(at)) {
                assert_eq!(dots[at], stack(name), "{colour:?} of {kind:?} at {}, {}", at % 64, at / 64);
            }
        }
    }
}

/// As a mask in CMYK has it.
#[test]
fn full_inks_of_a_picture_in_a_page_are_these_inks() {
    for (colour, named) in INKS_OF_PICTURES {
        let dots = |colour: [u8; 3]| {
            let art = Art::new(64, 64, |x, y| if (x / 3 + y / 3) % 2 > 0 { colour } else { [255; 3] });
            art.dots(ObjectType::Picture, (64, 64))
        };
        assert_eq!(dots(colour), dots(named), "{colour:?}");
    }
}

/// Text alone, and only where a solid looks about like it.
#[test]
fn labels_are_in_the_nearest_solid() {
    let dots = |colour: [u8; 3], tag: u8, labels: bool| {
        let bytes = [tag, colour[0], colour[1], colour[2]].repeat(64 * 64);
        let pixels = Pixels { bytes, each: 4, width: 64, height: 64 };
        let (fit, solids) = &*INKS;
        super::dots(pixels.rows((64, 64), labels), (64, 64), (fit, solids), Table::for_cluster(USUAL), false)
    };
    let (dark, grey) = ([60; 3], [128; 3]);
    assert!(dots(dark, ObjectType::TEXT, true).iter().all(|&dot| dot == stack("K")));
    let mixed = dots(dark, ObjectType::TEXT, false);
    assert!(mixed.contains(&stack("substrate")));
    assert_eq!(dots(dark, ObjectType::DRAWING, true), mixed);
    assert_eq!(dots(grey, ObjectType::TEXT, true), dots(grey, ObjectType::TEXT, false));
}

/// A stroke of three dots has two edges and one dot between them; the tone outside has the whole lean.
#[test]
fn a_tone_leans_to_its_edges_and_keeps_its_ink() {
    let grey = [150; 3];
    let count = |from: usize, to: usize| {
        let art = Art::new(256, 256, |x, _| if (64..192).contains(&x) { grey } else { [255; 3] });
        let dots = art.at_dots();
        let ink = (0..256 * 256).filter(|at| (from..to).contains(&(at % 256)) && dots[*at] == stack("K"));
        ink.count() as f64 / (256 * (to - from)) as f64
    };
    let (edge, second, inside, all) = (count(64, 65), count(65, 66), count(70, 180), count(64, 192));
    // Half of the room is that of the paper between the ink.
    let room = inside.min(1.0 - inside);
    assert!((edge - inside - 0.75 * room).abs() < 0.05, "{edge} beside {inside}");
    assert!((inside - second - 0.75 * room).abs() < 0.1, "{second} beside {inside}");
    assert!((all - inside).abs() < 0.005, "{all} and {inside}");
    // One and two dots wide, there is nothing to take it from.
    for wide in [1, 2] {
        let art = Art::new(256, 256, |x, _| if (64..64 + wide).contains(&x) { grey } else { [255; 3] });
        let dots = art.at_dots();
        let ink = dots.iter().filter(|&&dot| dot == stack("K")).count() as f64 / (256 * wide) as f64;
        assert!((ink - inside).abs() < 0.08, "{wide}: {ink}");
    }
}

/// Rectangles on a page.
fn rectangles() -> impl Strategy<Value = Vec<(usize, usize, usize, usize, [u8; 3])>> {
    let side = || 0usize..250;
    prop::collection::vec((side(), side(), 1usize..60, 1usize..60, any::<[u8; 3]>()), 0..12)
}

type Rectangle = (usize, usize, usize, usize, [u8; 3]);

fn page(size: (usize, usize), (left, top): (usize, usize), rectangles: &[Rectangle]) -> Art {
    let mut art = Art::new(size.0, size.1, |_, _| [255; 3]);
    for &(x, y, wide, high, colour) in rectangles {
        for v in (y + top..y + top + high).filter(|&v| v < size.1) {
            for u in (x + left..x + left + wide).filter(|&u| u < size.0) {
                art.rgb[v * size.0 + u] = colour;
            }
        }
    }
    art
}

proptest! {
    #[test]
    fn an_object_elsewhere_changes_no_dot(
        drawn in rectangles(), added in (0usize..250, 0usize..250, 1usize..40, 1usize..40, any::<[u8; 3]>()),
        coarse in prop_oneof![Just(1usize), Just(2), Just(4)],
    ) {
        let size = (240, 240);
        let before = page(size, (0, 0), &drawn);
        let after = page(size, (0, 0), &[&drawn[..], &[added]].concat());
        let dots = (coarse * size.0, coarse * size.1);
        let [before, after] = [before, after].map(|art| art.dots(ObjectType::Drawing, dots));
        // Pixels that are coarser than dots are followed for a millimetre, and strokes are for another.
        let near = if coarse == 1 { HALO } else { coarse * 28 };
        let (x, y, wide, high, _) = added;
        for at in 0..before.len() {
            let (u, v) = (at % dots.0 + near, at / dots.0 + near);
            let beside = (x * coarse..(x + wide) * coarse + 2 * near).contains(&u)
                && (y * coarse..(y + high) * coarse + 2 * near).contains(&v);
            prop_assert!(beside || before[at] == after[at], "{}, {}", at % dots.0, at / dots.0);
        }
    }

    #[test]
    fn art_that_moves_by_a_period_of_the_table_moves_its_dots(drawn in rectangles(), right in 0usize..2, down in 0usize..2) {
        let size = (320 + SIDE, 320 + SIDE);
        let still = page(size, (8, 8), &drawn).at_dots();
        let moved = page(size, (8 + SIDE * right, 8 + SIDE * down), &drawn).at_dots();
        for (x, y) in (0..320 * 320).map(|at| (at % 320, at / 320)) {
            let there = (y + SIDE * down) * size.0 + x + SIDE * right;
            prop_assert_eq!(still[y * size.0 + x], moved[there], "{}, {}", x, y);
        }
    }

    #[test]
    fn strips_and_threads_do_not_matter(drawn in rectangles(), height in 1usize..300, threads in 1usize..4) {
        let art = page((200, 300), (0, 0), &drawn);
        let keys: Vec<Key> = art.rgb.iter().map(|&colour| key(colour, true)).collect();
        let rows = |rows: Range<usize>, out: &mut [Key]| out.copy_from_slice(&keys[200 * rows.start..200 * rows.end]);
        let (fit, solids) = &*INKS;
        let mixtures = Mixtures::<16>::new(fit, solids);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let strips = |height| strips::<16, 1>(&rows, (200, 300), (height, false), &mixtures, Table::for_cluster(USUAL));
        prop_assert!(pool.install(|| strips(height)) == strips(STRIP));
    }
}
