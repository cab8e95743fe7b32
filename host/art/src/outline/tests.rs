//! Letters and lines of every width, ground and side, with the dots that they are fixed to.

use super::super::flat::INKED;
use super::*;

const DARK: Treatment = Treatment::Shape(Shape {
    solids: [7, 5, 0, 0],
    mild: u8::MAX,
    dark: true,
    near: true,
    bare: true,
    mixed: 1 << 7,
    rank: 9,
});
const LIGHT: Treatment = Treatment::Shape(Shape {
    solids: [7, 0, 0, 0],
    mild: u8::MAX,
    dark: false,
    near: true,
    bare: true,
    mixed: 1 << 7,
    rank: 9,
});

/// Paper, black, then a colour of this kind with this treatment, at all dots that satisfy `is`.
fn drawn(
    (width, length): (usize, usize),
    kind: ObjectType,
    treatment: Treatment,
    is: impl Fn(usize, usize) -> bool,
) -> Vec<u8> {
    let colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3]), (kind, [128; 3])];
    let index = (0..width * length).map(|at| 2 * u8::from(is(at % width, at / width))).collect();
    fixed(
        &Flat { colours, index },
        width,
        &[Treatment::Solid(0), Treatment::Solid(1), treatment],
        &Looks::default(),
    )
}

/// White letters in a dark bar would have rims of ink, and beside paper they would vanish without.
#[test]
fn a_pale_stroke_on_ink_is_paper_and_beside_paper_keeps_its_rim() {
    let colours = vec![
        (ObjectType::Picture, [255; 3]),
        (ObjectType::Picture, [0; 3]),
        (ObjectType::Text, [235; 3]),
        (ObjectType::Drawing, [60; 3]),
    ];
    for (bar, fill) in [(0..60, Some(PAPER)), (10..60, None), (0..0, None)] {
        let index = (0..60 * 50).map(|at| match (at % 60, at / 60) {
            (20..27, 4..40) => 2,
            (x, _) if bar.contains(&x) || bar.start == 10 && x > 23 => 3,
            _ => 0,
        });
        let index: Vec<u8> = if bar.start == 10 {
            // The left half of the stroke's border is paper.
            index
                .enumerate()
                .map(|(at, colour)| if colour == 3 && at % 60 < 23 { 0 } else { colour })
                .collect()
        } else {
            index.collect()
        };
        let flat = Flat { colours: colours.clone(), index };
        let fixed =
            fixed(&flat, 60, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, DARK], &Looks::default());
        let (middle, rim) = (fixed[20 * 60 + 23], fixed[20 * 60 + 20]);
        assert_eq!((middle, rim), fill.map_or((TONE, 7), |stack| (stack, stack)), "{bar:?}");
    }
}

/// The same on a shading, where text is told from what belongs to the shading.
#[test]
fn pale_text_on_a_shading_with_more_ink_than_paper_is_paper() {
    for (kind, ground, printed) in [
        (ObjectType::Text, INKED, [PAPER, PAPER]),
        (ObjectType::Text, TONE, [7, TONE]),
        (ObjectType::Drawing, INKED, [TONE, TONE]),
    ] {
        let colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3]), (kind, [235; 3])];
        let is_stroke = |at: usize| (20..27).contains(&(at % 60)) && (4..40).contains(&(at / 60));
        let index = (0..60 * 50).map(|at| if is_stroke(at) { 2 } else { ground }).collect();
        let fixed = fixed(
            &Flat { colours, index },
            60,
            &[Treatment::Solid(0), Treatment::Solid(1), LIGHT],
            &Looks::default(),
        );
        assert_eq!([fixed[20 * 60 + 20], fixed[20 * 60 + 23]], printed, "{kind:?} on {ground}");
        assert_eq!(fixed[20 * 60 + 10], TONE);
    }
}

/// Rings of a shading in few steps: what lies between a lighter and a darker one is no line, but a frame that is darker than both sides is.
#[test]
fn a_step_of_a_shading_is_screened_and_a_line_between_areas_is_not() {
    for (inner, step) in [([200; 3], true), ([90; 3], false), ([160, 160, 20], false)] {
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Drawing, [160; 3]),
            (ObjectType::Drawing, inner),
        ];
        // A square of 200 dots on black, with a border of seven.
        let index = (0..300 * 300)
            .map(|at| match (at % 300usize, at / 300usize) {
                (x, y) if (57..243).contains(&x) && (57..243).contains(&y) => 3,
                (50..250, 50..250) => 2,
                _ => 1,
            })
            .collect();
        let treatments = [Treatment::Solid(0), Treatment::Solid(1), DARK, LIGHT];
        let fixed = fixed(&Flat { colours, index }, 300, &treatments, &Looks::default());
        let middle = fixed[53 * 300 + 150];
        assert_eq!(middle, if step { TONE } else { 7 }, "{inner:?}");
    }
}

/// Of stripes that are as thick, one is a little shorter than a letter and the others are longer.
#[test]
fn short_stripes_are_printed_like_long_ones() {
    let stripes = |lengths: &'static [usize]| {
        let is = move |x: usize, y: usize| {
            y % 30 < 14 && lengths.get(y / 30).is_some_and(|&long| (10..10 + long).contains(&x))
        };
        drawn((300, 150), ObjectType::Drawing, DARK, is)
    };
    let (alone, beside) = (stripes(&[100]), stripes(&[100, 200, 200]));
    assert_eq!(alone[7 * 300 + 50], 7);
    for row in [7, 37, 67] {
        assert_eq!(beside[row * 300 + 50], TONE, "{row}");
    }
}

#[test]
fn a_thin_stroke_is_solid_and_a_wide_one_keeps_its_rim() {
    // A drawing no larger than a letter is one.
    let small = SMALL as usize;
    for (kind, most, long) in [
        (ObjectType::Text, LETTER, 50),
        (ObjectType::Drawing, LETTER, small),
        (ObjectType::Text, LETTER, small + 1),
        (ObjectType::Drawing, STROKE, small + 1),
    ] {
        let most = usize::from(most);
        for (wide, solid) in [(most - 1, true), (most, false)] {
            let inside = |x: usize| (5..5 + wide).contains(&x);
            let fixed = drawn((60, long), kind, DARK, |x, _| inside(x));
            for (at, &stack) in fixed.iter().enumerate() {
                let (x, y) = (at % 60, at / 60);
                let rim = x == 5 || x == 4 + wide || y == 0 || y + 1 == long;
                let wanted = if !inside(x) {
                    0
                } else if solid || rim {
                    7
                } else {
                    TONE
                };
                assert_eq!(stack, wanted, "{kind:?}, {wide} wide, at {x}, {y}");
            }
        }
    }
}

/// A small drawing in a colour unlike all stacks is none of them: grey enclaves of a map were black.
#[test]
fn a_small_drawing_unlike_its_solid_is_screened_within_its_rim() {
    let unlike = Treatment::Shape(Shape {
        solids: [7, 5, 0, 0],
        mild: u8::MAX,
        dark: true,
        near: false,
        bare: true,
        mixed: 1 << 7,
        rank: 9,
    });
    let cut = |kind| drawn((60, 50), kind, unlike, |x, _| (5..17).contains(&x))[25 * 60..26 * 60].to_vec();
    let (drawing, text) = (cut(ObjectType::Drawing), cut(ObjectType::Text));
    assert_eq!([4, 5, 6, 15, 16, 17].map(|x| drawing[x]), [0, 7, TONE, TONE, 7, 0]);
    assert_eq!([4, 5, 6, 15, 16, 17].map(|x| text[x]), [0, 7, 7, 7, 7, 0]);
}

/// Beside inks a rim would be a line of a third colour; beside a stack of its own mixture it keeps the edge.
#[test]
fn a_wide_shape_has_its_rim_beside_paper_and_what_would_fray_its_edge() {
    for (beside, rim) in [
        (Treatment::Solid(PAPER), true),
        (Treatment::Solid(4), false),
        (Treatment::Solid(3), true),
        (LIGHT, true),
        (DARK, false),
    ] {
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Drawing, [128; 3]),
            (ObjectType::Drawing, [60; 3]),
        ];
        let index = (0..300 * 200).map(|at| if at % 300 < 150 { 2 } else { 3 }).collect();
        let own = Treatment::Shape(Shape {
            solids: [7, 5, 0, 0],
            mild: u8::MAX,
            dark: true,
            near: true,
            bare: true,
            mixed: 1 << 3,
            rank: 9,
        });
        let flat = Flat { colours, index };
        let fixed =
            fixed(&flat, 300, &[Treatment::Solid(0), Treatment::Solid(1), own, beside], &Looks::default());
        let row = &fixed[100 * 300..101 * 300];
        assert_eq!([row[148], row[149]], [TONE, if rim { 7 } else { TONE }], "{beside:?}");
    }
}

/// What a line cuts off of a fill is no stroke, but a stroke beside its like on paper is one.
#[test]
fn a_piece_of_a_fill_is_printed_like_the_fill() {
    let colours = vec![
        (ObjectType::Picture, [255; 3]),
        (ObjectType::Picture, [0; 3]),
        (ObjectType::Drawing, [128; 3]),
        (ObjectType::Drawing, [60; 3]),
    ];
    let long = SMALL as usize + 1;
    for (gap, piece) in [(3, TONE), (0, 7)] {
        for treatment in [DARK, LIGHT] {
            // A fill, a line or paper, and six dots of the fill.
            let index = (0..80 * long).map(|at| match at % 80 {
                10..60 | 64..70 => 2,
                60..64 => gap,
                _ => 0,
            });
            let flat = Flat { colours: colours.clone(), index: index.collect() };
            let fixed = fixed(
                &flat,
                80,
                &[Treatment::Solid(0), Treatment::Solid(1), treatment, Treatment::Solid(5)],
                &Looks::default(),
            );
            let rim_alone = treatment == LIGHT || piece == TONE;
            assert_eq!(fixed[30 * 80 + 67], if rim_alone { TONE } else { piece }, "{gap}, {treatment:?}");
            assert_eq!(fixed[30 * 80 + 64], piece, "{gap}, {treatment:?}");
        }
    }
}

/// A pale line on several colours: a table on rows that are tinted in turns, the wires of a dartboard.
#[test]
fn a_pale_line_between_colours_is_decided_by_both_sides_of_it() {
    let colours = vec![
        (ObjectType::Picture, [255; 3]),
        (ObjectType::Picture, [0; 3]),
        (ObjectType::Drawing, [190; 3]),
        (ObjectType::Drawing, [240; 3]),
    ];
    let printed = |[left, right]: [u8; 2], wide: usize| -> Vec<u8> {
        // The other half of its length lies between the same colours the other way round.
        let index = (0..100 * 300).map(|at| match (at % 100, at / 100) {
            (x, _) if (40..40 + wide).contains(&x) => 2,
            (x, y) if (x < 40) == (y < 150) => left,
            _ => right,
        });
        let flat = Flat { colours: colours.clone(), index: index.collect() };
        fixed(&flat, 100, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, LIGHT], &Looks::default())
            [4040..4040 + wide]
            .to_vec()
    };
    // Between ink it is paper; between ink and paper its edge to the paper is drawn; between paper and a tint it is a line.
    assert_eq!(printed([1, 1], 6), [0; 6]);
    assert_eq!(printed([1, 0], 6), [0, 0, 0, 0, 0, 7]);
    assert_eq!(printed([0, 3], 6), [7, TONE, TONE, TONE, TONE, 7]);
    assert_eq!(printed([0, 3], 3), [0, 7, 0]);
    // A soft edge is as narrow.
    assert_eq!(printed([1, 0], 3), [TONE; 3]);
}

#[test]
fn letters_of_a_word_are_printed_alike() {
    let limit = usize::from(LETTER);
    // An O as wide as the limit, and letters that are a little thinner; then a word of which most is wide.
    for (widths, solid) in
        [([limit, limit - 1, limit - 2, limit - 3], true), ([limit - 1, limit, limit + 1, limit + 2], false)]
    {
        let stroke = |x: usize| (x % 60 < widths[x / 60 % 4]).then_some(x / 60);
        let fixed = drawn((240, 60), ObjectType::Text, DARK, |x, _| stroke(x).is_some());
        for x in (0..240).filter(|&x| stroke(x).is_some()) {
            let rim = x % 60 == 0 || x % 60 + 1 == widths[x / 60];
            assert_eq!(fixed[30 * 240 + x], if solid || rim { 7 } else { TONE }, "{widths:?} at {x}");
        }
        // Lines are decided by themselves.
        let lines = drawn((240, SMALL as usize + 1), ObjectType::Drawing, DARK, |x, _| {
            x % 60 < usize::from(STROKE) - x / 60 % 2
        });
        assert_eq!((lines[30 * 240 + 4], lines[30 * 240 + 64]), (TONE, 7));
    }
}

#[test]
fn a_pale_letter_keeps_its_rim_and_a_pale_hairline_its_edge() {
    let long = SMALL as usize + 1;
    let cut = |kind, long, wide: usize| {
        drawn((20, long), kind, LIGHT, |x, _| (5..5 + wide).contains(&x))[20..40].to_vec()
    };
    let rim = [0, 7, TONE, TONE, TONE, TONE, 7, 0];
    for (kind, long) in [(ObjectType::Text, 20), (ObjectType::Drawing, 20), (ObjectType::Drawing, long)] {
        assert_eq!(cut(kind, long, 6)[4..12], rim, "{kind:?}, {long}");
    }
    assert_eq!(cut(ObjectType::Drawing, long, 12)[4..8], [0, TONE, TONE, TONE], "a wide one is a tint");
    for (wide, middle) in (1..=usize::from(HAIR)).zip([5, 5, 6, 6]) {
        let line = cut(ObjectType::Drawing, long, wide);
        let printed: Vec<usize> = (0..20).filter(|&x| line[x] != 0).collect();
        assert!(printed == [middle] && line[middle] == 7, "{wide}: {printed:?}");
    }
    // A cross is whole.
    let cross = drawn((long, long), ObjectType::Drawing, LIGHT, |x, y| x / 2 == 30 || y / 2 == 20);
    let row = |y: usize| (0..long).filter(|x| cross[y * long + x] == 7).count();
    assert_eq!([row(39), row(40), row(41)], [1, long, 2]);
    // On a shading, and on a tint that is like it, it is no line.
    for (ground, beside) in [(255, TONE), (3, TONE)] {
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Drawing, [230; 3]),
            (ObjectType::Drawing, [238; 3]),
        ];
        let index = (0..20 * long).map(|at| if (5..7).contains(&(at % 20)) { 2 } else { ground }).collect();
        let flat = Flat { colours, index };
        let fixed =
            fixed(&flat, 20, &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, LIGHT], &Looks::default());
        assert_eq!(fixed[24..28], [beside, TONE, TONE, beside], "{ground}");
    }
    // A soft edge lies beside ink.
    let colours = vec![
        (ObjectType::Picture, [255; 3]),
        (ObjectType::Picture, [0; 3]),
        (ObjectType::Drawing, [230; 3]),
        (ObjectType::Drawing, [60; 3]),
    ];
    let index = (0..40 * long).map(|at| [3, 3, 2, 2, 0].get(at % 40 / 2).copied().unwrap_or(0)).collect();
    let flat = Flat { colours, index };
    let fixed = fixed(
        &flat,
        40,
        &[Treatment::Solid(0), Treatment::Solid(1), LIGHT, Treatment::Solid(5)],
        &Looks::default(),
    );
    assert_eq!(fixed[400..409], [5, 5, 5, 5, TONE, TONE, TONE, TONE, 0]);
}

/// Whatever its slope, what is left of a pale hairline is one line, each dot of which touches the next. It is as long as what was drawn.
#[test]
fn a_pale_hairline_has_no_gap() {
    const SIDE: usize = 200;
    for degrees in (0..180).step_by(7) {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let inside = |x: usize, y: usize| {
            let (x, y) = (x as f64 + 0.5 - SIDE as f64 / 2.0, y as f64 + 0.5 - SIDE as f64 / 2.0);
            (x * sin - y * cos).abs() < 1.5 && (x * cos + y * sin).abs() < 90.0
        };
        let fixed = drawn((SIDE, SIDE), ObjectType::Drawing, LIGHT, inside);
        let dots: Vec<usize> = (0..SIDE * SIDE).filter(|&at| fixed[at] == 7).collect();
        let middle = |&&at: &&usize| (at % SIDE).abs_diff(SIDE / 2) + (at / SIDE).abs_diff(SIDE / 2);
        let first = *dots.iter().min_by_key(middle).unwrap();
        let (mut seen, mut next) = (vec![first], vec![first]);
        while let Some(at) = next.pop() {
            for &other in &dots {
                let near = (at % SIDE).abs_diff(other % SIDE) <= 1 && (at / SIDE).abs_diff(other / SIDE) <= 1;
                if near && !seen.contains(&other) {
                    seen.push(other);
                    next.push(other);
                }
            }
        }
        let along = |at: &usize| (at % SIDE) as f64 * cos + (at / SIDE) as f64 * sin;
        let (from, to) = seen.iter().map(along).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        assert!(to - from > 172.0, "{degrees}: {from} to {to}");
        let drawn = (0..SIDE * SIDE).filter(|&at| inside(at % SIDE, at / SIDE)).count();
        assert!(3 * dots.len() <= 2 * drawn, "{degrees}: {} of {drawn}", dots.len());
    }
}

/// A letter of treatment [`DARK`] or [`LIGHT`] on a ground that is printed so, `share` of its border on it and the rest on paper.
fn on_a_ground(letter: Treatment, wide: usize, ground: Treatment, share: f64) -> Vec<u8> {
    let colours = vec![
        (ObjectType::Picture, [255; 3]),
        (ObjectType::Picture, [0; 3]),
        (ObjectType::Text, [128; 3]),
        (ObjectType::Drawing, [60; 3]),
    ];
    let index = (0..60 * 60)
        .map(|at| match (at % 60, at / 60) {
            (x, y) if (20..20 + wide).contains(&x) && (10..50).contains(&y) => 2,
            (_, y) if (y as f64) < 10.0 + 40.0 * share => 3,
            _ => 0,
        })
        .collect();
    fixed(
        &Flat { colours, index },
        60,
        &[Treatment::Solid(0), Treatment::Solid(1), letter, ground],
        &Looks::default(),
    )
}

#[test]
fn what_lies_on_its_own_solid_is_printed_in_the_next() {
    let at = |fixed: &[u8], x: usize| fixed[30 * 60 + x];
    // Thin: in the next stack, or in paper.
    let letter = on_a_ground(DARK, 6, Treatment::Solid(7), 1.0);
    assert_eq!([19, 20, 25, 26].map(|x| at(&letter, x)), [7, 5, 5, 7]);
    let pale = on_a_ground(LIGHT, 6, Treatment::Solid(7), 1.0);
    assert_eq!([19, 20, 25, 26].map(|x| at(&pale, x)), [7, 0, 0, 7]);
    // Wide: its rim is in the next, or there is none.
    let wide = on_a_ground(DARK, 30, Treatment::Solid(7), 1.0);
    assert_eq!([19, 20, 21, 48, 49, 50].map(|x| at(&wide, x)), [7, 5, TONE, TONE, 5, 7]);
    let pale = on_a_ground(LIGHT, 30, Treatment::Solid(7), 1.0);
    assert_eq!([19, 20, 49, 50].map(|x| at(&pale, x)), [7, TONE, TONE, 7]);
    // On another solid, or where its solid is only beside a small part of it, nothing changes.
    let other = on_a_ground(DARK, 6, Treatment::Solid(4), 1.0);
    assert_eq!([19, 20, 25, 26].map(|x| at(&other, x)), [4, 7, 7, 4]);
    let partly = on_a_ground(DARK, 6, Treatment::Solid(7), 0.2);
    assert_eq!(partly[15 * 60 + 22], 7);
    assert_eq!(at(&partly, 22), 7);
    // Of two shapes the nearer to the solid keeps it.
    let ground = |rank| {
        Treatment::Shape(Shape {
            solids: [7, 0, 0, 0],
            mild: u8::MAX,
            dark: true,
            near: true,
            bare: true,
            mixed: 1 << 7,
            rank,
        })
    };
    assert_eq!(at(&on_a_ground(DARK, 6, ground(3), 1.0), 22), 5);
    assert_eq!(at(&on_a_ground(DARK, 6, ground(12), 1.0), 22), 7);
}

#[test]
fn the_bands_of_a_shading_are_one_wide_shape() {
    // Bands of three dots, each a little lighter.
    let mut colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3])];
    colours.extend((0..20).map(|step| (ObjectType::Drawing, [40 + 4 * step; 3])));
    let index = (0..60 * 40).map(|at| 2 + (at % 60 / 3) as u8).collect();
    let mut treatments = vec![Treatment::Solid(0), Treatment::Solid(1)];
    treatments.extend([DARK; 20]);
    let fixed = fixed(&Flat { colours, index }, 60, &treatments, &Looks::default());
    for (at, &stack) in fixed.iter().enumerate() {
        let rim = at % 60 == 0 || at % 60 == 59 || at / 60 == 0 || at / 60 == 39;
        assert_eq!(stack, if rim { 7 } else { TONE });
    }
}

/// Chrome and gold letters: each band was a letter in its nearest solid.
#[test]
fn a_letter_that_is_filled_with_a_shading_is_screened_and_a_fine_one_has_one_colour() {
    let steps = 24;
    let mut colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3])];
    colours.extend((0..steps).map(|at| (ObjectType::Text, [255 - 8 * at, 120, 8 * at])));
    let Treatment::Shape(dark) = DARK else { panic!() };
    // One half in one solid, the other in another.
    let treatment =
        |at: u8| Treatment::Shape(Shape { solids: [if at < steps / 2 { 7 } else { 6 }, 5, 0, 0], ..dark });
    let treatments: Vec<Treatment> =
        [Treatment::Solid(0), Treatment::Solid(1)].into_iter().chain((0..steps).map(treatment)).collect();
    for (wide, wanted) in [(6usize, 1usize), (12, 0)] {
        let index = (0..60 * 80).map(|at| match (at % 60, at / 60) {
            (x, y) if (20..20 + wide).contains(&x) && (4..4 + 72).contains(&y) => 2 + (y as u8 - 4) / 3,
            _ => 0,
        });
        let flat = Flat { colours: colours.clone(), index: index.collect() };
        let fixed = fixed(&flat, 60, &treatments, &Looks::default());
        let mut found: Vec<u8> =
            fixed.iter().zip(&flat.index).filter(|&(_, &own)| own > 1).map(|(&dot, _)| dot).collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), 1, "{wide}: {found:?}");
        assert_eq!(found.iter().filter(|&&dot| dot != TONE).count(), wanted, "{wide}: {found:?}");
    }
}
