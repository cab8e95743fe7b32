//! Softened, sharpened, thin and lone pixels of reserved colours.

use super::*;
use crate::read::picture;

/// A disc of one colour on another, softened over a pixel as drawing programs do.
fn soft_disc(side: usize, colour: [u8; 3], ground: [u8; 3]) -> Vec<u8> {
    let middle = side as f64 / 2.0;
    (0..side * side)
        .flat_map(|at| {
            let (x, y) = ((at % side) as f64 + 0.5 - middle, (at / side) as f64 + 0.5 - middle);
            let inside = (side as f64 / 3.0 - x.hypot(y) + 0.5).clamp(0.0, 1.0);
            std::array::from_fn::<u8, 3, _>(|c| {
                (inside * f64::from(colour[c]) + (1.0 - inside) * f64::from(ground[c])).round() as u8
            })
        })
        .collect()
}

fn plane(layer: &Layer) -> u64 {
    match &layer.shape {
        Shape::Solid(plane) => plane.dots(),
        Shape::Tone(_) => panic!("reserved colours have no tones"),
    }
}

/// The usual rules, and each of them a fifth less and more.
fn moved() -> Vec<Rules> {
    let Rules { least, coloured, exact, off, beyond } = Rules::USUAL;
    let usual = Rules::USUAL;
    let moved = [4u8, 6].map(|fifths| {
        let by = f64::from(fifths) / 5.0;
        [
            Rules { least: least * u64::from(fifths) / 5, ..usual },
            Rules { coloured: (f64::from(coloured) * by) as u8, ..usual },
            // The next whole number.
            Rules { exact: exact + fifths - 5, ..usual },
            Rules { off: off * by, ..usual },
            Rules { beyond: beyond * by, ..usual },
        ]
    });
    [&[usual], moved.as_flattened()].concat()
}

#[test]
fn colours_that_the_user_names_are_inks_and_several_of_one_ink_one_layer() {
    let side = 60;
    let mut pixels = soft_disc(side, [255, 0, 0], [255; 3]);
    // A bar of the other colour of the same ink, one of another ink, and one of the vendor's gold, which nobody asked for.
    for (y, colour) in [(2, [200, 0, 200]), (54, [0, 128, 0]), (58, [225, 160, 0])] {
        for at in y * side..(y + 2) * side {
            pixels[3 * at..3 * at + 3].copy_from_slice(&colour);
        }
    }
    let colours =
        vec![(Ink::MetallicGold, [255, 0, 0]), (Ink::White, [4, 124, 3]), (Ink::MetallicGold, [200, 0, 200])];
    let options = Options { colours, ..Options::default() };
    let size = (side as u32, side as u32);
    let found = take(&mut pixels, size, (side, side), &options);
    let inks: Vec<Ink> = found.layers.iter().map(|layer| layer.ink).collect();
    assert_eq!(inks, [Ink::MetallicGold, Ink::White]);
    let disc = std::f64::consts::PI * 20.0 * 20.0 + 120.0;
    let gold = plane(&found.layers[0]) as f64;
    assert!((gold - disc).abs() < 0.02 * disc, "{gold} dots of {disc}, soft edges included");
    assert_eq!(plane(&found.layers[1]), 120, "within the tolerance");
    let plain = pixels.as_chunks::<3>().0.iter().filter(|pixel| **pixel != [255; 3]).count();
    assert_eq!(plain, 120, "the vendor's gold is a plain colour here");
    let narrow = Options { tolerance: Some(0), ..options };
    let found = take(&mut [4, 125, 3].repeat(side * side), size, (side, side), &narrow);
    assert!(found.layers.is_empty());
}

#[test]
fn softened_edges_leave_no_fringe_of_colour() {
    let usual = moved().into_iter().map(|rules| (rules, None));
    // That of metals, a fifth less and more.
    let wider = [10, 14].map(|tolerance| (Rules::USUAL, Some(tolerance)));
    for (rules, tolerance) in usual.chain(wider) {
        let side = 300;
        let area = std::f64::consts::PI * 100.0 * 100.0;
        for (at, entry) in TABLE.iter().enumerate() {
            for ground in [[255; 3], TABLE[(at + 1) % TABLE.len()].colour] {
                let mut rgb = soft_disc(side, entry.colour, ground);
                let options = Options { reserved: true, tolerance, ..Options::default() };
                let found = take_by(rules, &mut rgb, (300, 300), (side, side), &options);
                assert!(rgb.iter().all(|&v| v == 255), "{:?} on {ground:?} leaves colour", entry.ink);
                assert!(
                    found.layers.iter().all(|layer| layer.ink == entry.ink || ground != [255; 3]),
                    "an edge of {:?} on paper calls for another ink",
                    entry.ink
                );
                assert!(found.layers.len() <= 2, "{:?} on {ground:?} calls for a third ink", entry.ink);
                let layer = found.layers.iter().find(|layer| layer.ink == entry.ink).unwrap();
                let off = (plane(layer) as f64 - area).abs() / area;
                assert!(off < 0.005, "{:?}: {} dots, the disc has {area:.0}", entry.ink, plane(layer));
            }
        }
    }
}

#[test]
fn sharpened_edges_leave_no_fringe_of_colour_either() {
    for rules in moved() {
        // A black bar on the white, resampled with a filter that rings, as image programs do.
        let (white, bar) = ([230; 3], 180..300);
        let large = image::RgbImage::from_fn(480, 480, |x, y| {
            image::Rgb(if bar.contains(&x) && (90..390).contains(&y) { [0; 3] } else { white })
        });
        for filter in [image::imageops::FilterType::Lanczos3, image::imageops::FilterType::CatmullRom] {
            // 7 to 3: edges fall between pixels.
            let small = image::imageops::resize(&large, 206, 206, filter);
            assert!(small.pixels().any(|pixel| pixel.0[0] > 235), "the filter rings");
            let mut rgb = small.into_raw();
            let found = take_by(
                rules,
                &mut rgb,
                (206, 206),
                (206, 206),
                &Options { reserved: true, ..Options::default() },
            );
            assert!(rgb.iter().all(|&v| v == 255), "{filter:?} leaves colour");
            let inks: Vec<Ink> = found.layers.iter().map(|layer| layer.ink).collect();
            assert_eq!(inks, [Ink::White, Ink::Black], "{filter:?}");
            let wanted = (120.0 * 300.0) * (206.0f64 / 480.0).powi(2);
            assert!((plane(&found.layers[1]) as f64 - wanted).abs() < 0.02 * wanted);
        }
    }
}

#[test]
fn a_lone_pixel_of_metal_beside_colours_is_a_colour_and_a_line_of_it_is_metal() {
    for rules in moved() {
        // Within the tolerance, not exact.
        let silver = [197, 197, 197];
        let green = [40, 160, 60];
        let picture = |is_silver: &dyn Fn(usize, usize) -> bool| -> Vec<u8> {
            (0..400).flat_map(|at| if is_silver(at % 20, at / 20) { silver } else { green }).collect()
        };
        let two = |x, y| (x, y) == (9, 9) || (x, y) == (10, 10);
        let mut rgb = picture(&two);
        let found =
            take_by(rules, &mut rgb, (20, 20), (20, 20), &Options { reserved: true, ..Options::default() });
        assert!(found.layers.is_empty() && rgb == picture(&two));
        let mut rgb = picture(&|x, y| y == 9 && x > 3);
        let found =
            take_by(rules, &mut rgb, (20, 20), (20, 20), &Options { reserved: true, ..Options::default() });
        assert_eq!((found.layers[0].ink, plane(&found.layers[0])), (Ink::MetallicSilver, 16));
    }
}

/// A line of which one pixel is covered wholly and those beside it in part, on black and on paper; no pixel of it lies in a square.
#[test]
fn a_thin_line_is_of_its_ink_with_its_softened_edges() {
    for rules in moved() {
        let gold = [225, 160, 0];
        for ground in [[0u8; 3], [255; 3]] {
            for shares in
                [[0.25, 1.0, 0.75], [0.0, 1.0, 0.5], [0.4, 1.0, 0.6], [0.0, 0.75, 0.6], [0.0, 0.8, 0.2]]
            {
                let pixel = |at: usize| -> [u8; 3] {
                    // And a square of it elsewhere.
                    if at % 40 < 9 && at / 40 < 9 {
                        return gold;
                    }
                    let share = (at % 40).checked_sub(19).and_then(|x| shares.get(x)).copied().unwrap_or(0.0);
                    std::array::from_fn(|c| {
                        (share * f64::from(gold[c]) + (1.0 - share) * f64::from(ground[c])).round() as u8
                    })
                };
                let mut rgb: Vec<u8> = (0..40 * 40).flat_map(pixel).collect();
                let found = take_by(
                    rules,
                    &mut rgb,
                    (40, 40),
                    (40, 40),
                    &Options { reserved: true, ..Options::default() },
                );
                let of_gold = found.layers.iter().find(|layer| layer.ink == Ink::MetallicGold).map(plane);
                let wide = shares.iter().filter(|&&share| share > 0.5).count() as u64;
                let half = shares.iter().filter(|&&share| share == 0.5).count() as u64;
                assert!(
                    of_gold.is_some_and(|dots| (81 + 40 * wide..=81 + 40 * (wide + half)).contains(&dots)),
                    "{of_gold:?} for {shares:?} on {ground:?}"
                );
                assert!(rgb.iter().all(|&v| v == 255), "{shares:?} on {ground:?}: process colours are left");
            }
        }
    }
}

/// Lines a pixel wide beside squares of every ink: greys and pale colours stay what they are.
#[test]
fn thin_lines_in_grey_and_in_pale_colours_are_colour() {
    for rules in moved() {
        let squares = TABLE.map(|entry| entry.colour);
        for line in [[90; 3], [128; 3], [170; 3], [210; 3], [220, 221, 222], [250, 240, 214], [200, 226, 231]]
        {
            let pixel = |at: usize| match (at % 80, at / 80) {
                (60, _) => line,
                (x @ ..54, 2..13) if x % 9 < 8 => squares[x / 9],
                _ => [255; 3],
            };
            let mut rgb: Vec<u8> = (0..80 * 40).flat_map(pixel).collect();
            take_by(rules, &mut rgb, (80, 40), (80, 40), &Options { reserved: true, ..Options::default() });
            let kept = (0..40).filter(|y| rgb[3 * (80 * y + 60)..][..3] == line).count();
            assert_eq!(kept, 40, "{line:?}");
        }
    }
}

#[test]
fn a_stray_grey_calls_for_silver_only_if_silver_is_at_hand() {
    let grey = [189, 193, 197].repeat(100);
    let with = |inks: &str| Options { reserved: true, inks: inks.parse().unwrap(), ..Options::default() };
    let mut rgb = grey.clone();
    let found = take(&mut rgb, (10, 10), (10, 10), &with("white,metallic-gold,process"));
    assert!(found.layers.is_empty() && rgb == grey);
    assert!(found.notes("art").iter().any(|note| note.contains("metallic-silver")));
    let found = take(&mut rgb, (10, 10), (10, 10), &with("metallic-silver"));
    assert_eq!(found.layers.iter().map(|layer| layer.ink).collect::<Vec<_>>(), [Ink::MetallicSilver]);
    assert!(rgb.iter().all(|&v| v == 255));
}

#[test]
fn colours_within_the_tolerance_are_the_ink_and_others_are_not() {
    let (gold, off) = ([225, 160, 0], [225, 173, 0]);
    for (tolerance, wanted) in [(None, 1), (Some(13), 2), (Some(0), 1)] {
        let mut rgb = [gold, off].concat();
        let options = Options { reserved: true, tolerance, ..Options::default() };
        let found = take(&mut rgb, (2, 1), (2, 1), &options);
        assert_eq!(plane(&found.layers[0]), wanted, "tolerance {tolerance:?}");
    }
}

#[test]
fn tolerances_of_the_table_do_not_overlap() {
    for (i, a) in TABLE.iter().enumerate() {
        for b in &TABLE[..i] {
            let apart = (0..3).any(|c| {
                u16::from(a.colour[c].abs_diff(b.colour[c])) > u16::from(a.tolerance) + u16::from(b.tolerance)
            });
            assert!(apart, "{:?} and {:?}", a.ink, b.ink);
        }
    }
}

/// In pixels of four dots a disc has the edge of a disc and not that of its pixels.
#[test]
fn coarse_reserved_colours_have_the_edges_of_all_flat_art() {
    let (side, coarse) = (60, 4);
    let dots = (coarse * side, coarse * side);
    let options = Options { reserved: true, ..Options::default() };
    for colour in [[225, 160, 0], [0, 176, 201]] {
        let size = (side as u32, side as u32);
        let pixels = soft_disc(side, colour, [255; 3]);
        let art = picture::opaque_artwork::<3>("art", "art", size, dots, pixels.clone(), &options);
        assert_eq!(
            (art.layers.len(), art.colour.is_some()),
            (1, false),
            "{colour:?}: process colours are left"
        );
        let Shape::Solid(found) = &art.layers[0].shape else { panic!("reserved colours have no tones") };
        let (mut wrong, mut steps) = (0, 0);
        for (x, y) in (0..dots.0 * dots.1).map(|at| (at % dots.0, at / dots.0)) {
            let middle = dots.0 as f64 / 2.0;
            let far = (x as f64 + 0.5 - middle).hypot(y as f64 + 0.5 - middle);
            let wanted = far < dots.0 as f64 / 3.0;
            wrong += u32::from(bitplane::at(found, x, y) != wanted);
            // Blue tells how much of a pixel is covered.
            let blue = pixels[3 * (y / coarse * side + x / coarse) + 2];
            let is_covered = u16::from(blue) < (u16::from(colour[2]) + 255) / 2;
            steps += u32::from(is_covered != wanted);
        }
        assert!(3 * wrong < steps, "{colour:?}: {wrong} wrong dots, of pixels {steps}");
    }
}
