use super::*;
use observe::Silent;
use proptest::prelude::*;
use protocol::ink::Ink;
use protocol::paper::Paper;

fn random(width: usize, length: usize, stacks: u8, seed: u32) -> DotMap {
    let random = |i: usize| ((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 9) % u32::from(stacks);
    let index = (0..width * length).map(|i| random(i) as u8).collect();
    let all = ["substrate", "W", "W+C", "MS", "K"].map(|text| text.parse().unwrap());
    DotMap::new(width, length, all[..usize::from(stacks)].to_vec(), index).unwrap()
}

/// Lengths whose dots are known: 600 an inch.
fn dots(across: i64, down: i64) -> Point {
    Point(Mm::of_dots(across), Mm::of_dots(down))
}

proptest! {
    #![proptest_config(testing::cases(300))]
    /// Every dot of the page against a walk over all copies, with nothing shared but the numbers.
    #[test]
    fn every_dot_is_that_of_the_copy_that_covers_it(
        size in (1usize..40, 1usize..40), page in (60u16..150, 60u16..150), at in (-30i64..120, -30i64..120),
        repeat in (1u16..4, 1u16..4), gap in (0i64..9, 0i64..9), mirror: bool, seed: u32,
        offset in (-12i64..12, -12i64..12), feed in prop_oneof![Just(1.0f64), 0.98f64..1.02],
    ) {
        let artwork = random(size.0, size.1, 5, seed);
        let layout = Layout {
            position: Position::FromPrintable(dots(at.0, at.1)),
            repeat: Repeat::Grid(repeat.0, repeat.1),
            gap: dots(gap.0, gap.1),
            mirror,
            cut: true,
            profile: Profile {
                offset_mm: [Mm::of_dots(offset.0).0, Mm::of_dots(offset.1).0], feed, ..Profile::default()
            },
            ..Layout::centred(Paper::Custom { width: page.0, length: page.1 })
        };
        let (wide, long) = (i64::from(page.0), i64::from(page.1));
        let (w, h) = (size.0 as i64, size.1 as i64);
        let ideal = |x: i64, y: i64| -> u8 {
            if x < 0 || y < 0 || x >= wide || y >= long {
                return 0;
            }
            for row in 0..i64::from(repeat.1) {
                for column in 0..i64::from(repeat.0) {
                    let dx = x - at.0 - column * (w + gap.0);
                    let dy = y - at.1 - row * (h + gap.1);
                    if (0..w).contains(&dx) && (0..h).contains(&dy) {
                        let dx = if mirror { w - 1 - dx } else { dx };
                        return artwork.index()[(dy * w + dx) as usize];
                    }
                }
            }
            0
        };
        let want: Vec<u8> = (0..long)
            .flat_map(|y| (0..wide).map(move |x| (x, y)))
            .map(|(x, y)| ideal(x + offset.0, offset.1 + (y as f64 * feed).round() as i64))
            .collect();
        match arrange(&artwork, &layout, &Silent) {
            Ok(arranged) => {
                prop_assert!(arranged.sheet.index() == want);
                // Whatever has ink lies in the area that is said to be printed.
                let area = arranged.laid.area;
                for (i, _) in want.iter().enumerate().filter(|(_, stack)| **stack != 0) {
                    let (x, y) = (i % page.0 as usize, i / page.0 as usize);
                    prop_assert!((area.left..area.left + area.width).contains(&x));
                    prop_assert!((area.top..area.top + area.length).contains(&y));
                }
            }
            Err(LayoutError::Nothing { .. }) => prop_assert!(want.iter().all(|&stack| stack == 0)),
            Err(error) => prop_assert!(false, "{error}"),
        }
    }

    #[test]
    fn what_is_not_cut_is_all_there(
        size in (1usize..60, 1usize..60), repeat in (1u16..4, 1u16..4), gap in 0i64..9, seed: u32,
    ) {
        let artwork = random(size.0, size.1, 4, seed);
        let paper = Paper::Custom { width: 150, length: 140 };
        let layout = Layout { repeat: Repeat::Grid(repeat.0, repeat.1), gap: dots(gap, gap), ..Layout::centred(paper) };
        let wide = i64::from(repeat.0) * (size.0 as i64 + gap) - gap;
        let long = i64::from(repeat.1) * (size.1 as i64 + gap) - gap;
        match arrange(&artwork, &layout, &Silent) {
            Ok(arranged) => {
                let count = usize::from(repeat.0 * repeat.1);
                prop_assert_eq!(arranged.laid.copies.len(), count);
                let inked = |index: &[u8]| index.iter().filter(|&&dot| dot != 0).count();
                prop_assert_eq!(inked(arranged.sheet.index()), count * inked(artwork.index()));
                prop_assert_eq!(arranged.laid.cut, None);
                let area = arranged.laid.area;
                prop_assert_eq!((area.left as i64, area.width as i64), ((150 - wide) / 2, wide));
                prop_assert_eq!((area.top as i64, area.length as i64), ((140 - long) / 2, long));
            }
            Err(LayoutError::Beyond { .. }) => prop_assert!(wide > 150 || long > 140),
            Err(error) => prop_assert!(false, "{error}"),
        }
    }
}

/// A solid rectangle of this stack.
fn solid(width: usize, length: usize, stack: &str) -> DotMap {
    let stacks = vec![Stack::SUBSTRATE, stack.parse().unwrap()];
    DotMap::new(width, length, stacks, vec![1; width * length]).unwrap()
}

#[test]
fn a_position_from_the_edge_of_the_paper_is_what_a_ruler_measures() {
    // 80 dots and 284 rows lie outside of the printable area of A4.
    let artwork = solid(30, 20, "K");
    let at = Position::FromEdge(dots(600, 1200));
    let layout = Layout { position: at, ..Layout::centred(Paper::A4) };
    let area = arrange(&artwork, &layout, &Silent).unwrap().laid.area;
    assert_eq!((area.left, area.top, area.width, area.length), (520, 916, 30, 20));
    let postcard = Layout { paper: Paper::Postcard, ..layout };
    assert_eq!(arrange(&artwork, &postcard, &Silent).unwrap().laid.area.top, 1200 - 71);
}

#[test]
fn what_would_be_cut_is_said_in_mm_and_cut_only_when_asked() {
    let artwork = solid(1200, 600, "C");
    let at = Position::FromPrintable(dots(-236, 6372 - 600 + 118));
    let layout = Layout { position: at, ..Layout::centred(Paper::A4) };
    let said = arrange(&artwork, &layout, &Silent).unwrap_err().to_string();
    assert!(said.contains("10.0 mm at the left, 5.0 mm at the bottom of 50.8 x 25.4 mm"), "{said}");
    assert!(said.contains("move it") && said.contains("203.2 x 269.7"), "{said}");
    let arranged = arrange(&artwork, &Layout { cut: true, ..layout.clone() }, &Silent).unwrap();
    assert_eq!(arranged.sheet.census()[1], (1200 - 236) * (600 - 118));
    assert!(arranged.laid.cut.is_some_and(|cut| (cut.left - 9.99).abs() < 0.01 && cut.right == 0.0));
    let away = Position::FromPrintable(dots(9000, 0));
    let nothing = arrange(&artwork, &Layout { position: away, cut: true, ..layout }, &Silent);
    assert!(matches!(nothing, Err(LayoutError::Nothing { .. })));
}

#[test]
fn filling_takes_as_many_as_fit_and_one_more_would_not() {
    let artwork = solid(700, 900, "W");
    let layout = Layout { repeat: Repeat::Fill, gap: dots(50, 60), ..Layout::centred(Paper::A4) };
    let arranged = arrange(&artwork, &layout, &Silent).unwrap();
    // 6 x 700 + 5 x 50 = 4450 of 4800, 6 x 900 + 5 x 60 = 5700 of 6372.
    assert_eq!(arranged.laid.grid, (6, 6));
    let more = |grid| Layout { repeat: grid, ..layout.clone() };
    assert!(arrange(&artwork, &more(Repeat::Grid(7, 1)), &Silent).is_err());
    assert!(arrange(&artwork, &more(Repeat::Grid(1, 7)), &Silent).is_err());
    let large = solid(4801, 10, "W");
    assert!(matches!(arrange(&large, &layout, &Silent), Err(LayoutError::FillsNothing { .. })));
    assert!(arrange(&artwork, &more(Repeat::Grid(0, 1)), &Silent).is_err());
}

#[test]
fn ticks_stand_outside_in_line_with_the_edges_and_in_one_ink() {
    let artwork = solid(600, 480, "W+C+K");
    let layout = Layout {
        repeat: Repeat::Grid(2, 1),
        crop_marks: true,
        position: Position::FromPrintable(dots(1000, 1000)),
        ..Layout::centred(Paper::A4)
    };
    let arranged = arrange(&artwork, &layout, &Silent).unwrap();
    let sheet = &arranged.sheet;
    let black: Stack = "K".parse().unwrap();
    let number = sheet.stacks().iter().position(|stack| *stack == black).unwrap() as u8;
    let dots: Vec<(usize, usize)> = (0..sheet.index().len())
        .filter(|&i| sheet.index()[i] == number)
        .map(|i| (i % 4800, i / 4800))
        .collect();
    // Ticks 4 mm (94 dots) long and 4 dots wide: 3 upright edges and 2 level ones, at both ends.
    assert_eq!(dots.len(), (3 + 2) * 2 * 94 * 4);
    for (x, y) in dots {
        let beside =
            [1000, 1600, 2200].iter().any(|&edge| x.abs_diff(edge) <= 2) && !(965..1515).contains(&y);
        let level = [1000, 1480].iter().any(|&edge| y.abs_diff(edge) <= 2) && !(965..2235).contains(&x);
        assert!(beside || level, "({x}, {y})");
    }
    assert_eq!(arranged.laid.marks_left_out, 0);
    assert_eq!(sheet.census()[1], 2 * 600 * 480, "nothing of the copies is covered");
}

#[test]
fn registration_marks_have_every_pass_and_the_ink_can_be_chosen() {
    let mut layout = Layout { registration_marks: true, ..Layout::centred(Paper::Postcard) };
    let artwork = random(600, 600, 5, 7);
    let arranged = arrange(&artwork, &layout, &Silent).unwrap();
    assert_eq!(arranged.sheet.stacks().last().unwrap().to_string(), "W+MS+C+K");
    layout.mark_inks = vec![Ink::Magenta];
    let arranged = arrange(&artwork, &layout, &Silent).unwrap();
    let census = arranged.sheet.census();
    assert_eq!(arranged.sheet.stacks().last().unwrap().to_string(), "M");
    // Four rings with crosses, alike: the paper's own symmetry.
    assert!(census.last().unwrap().is_multiple_of(4) && *census.last().unwrap() > 4 * 118 * 4);
}

#[test]
fn marks_without_room_are_left_out_and_counted_never_beyond_the_area() {
    let paper = Paper::Custom { width: 700, length: 900 };
    let layout = Layout { crop_marks: true, registration_marks: true, ..Layout::centred(paper) };
    // 50 dots at the sides: 35 away, 15 are no tick. 150 above and below: ticks, but no crosses.
    let arranged = arrange(&solid(600, 600, "K"), &layout, &Silent).unwrap();
    assert_eq!(arranged.laid.marks_left_out, 4 + 4);
    assert_eq!(arranged.laid.area, Area { left: 48, top: 21, width: 604, length: 858 });
}

#[test]
fn without_anything_asked_the_page_is_the_artwork_in_its_middle() {
    let artwork = random(301, 200, 3, 5);
    let arranged = arrange(&artwork, &Layout::centred(Paper::A4), &Silent).unwrap();
    assert_eq!(arranged.laid.area, Area { left: 2249, top: 3086, width: 301, length: 200 });
    assert_eq!(arranged.sheet.stacks(), artwork.stacks());
    // A printer that is off moves its own room, not the middle, while there is room.
    let profile = Profile { offset_mm: [2.54, 0.0], ..Profile::default() };
    let layout = Layout { profile, ..Layout::centred(Paper::A4) };
    assert_eq!(arrange(&artwork, &layout, &Silent).unwrap().laid.area.left, 2249 - 60);
    assert_eq!(layout.largest(), (4740, 6372));
    let grid = Layout { repeat: Repeat::Grid(2, 3), gap: dots(40, 72), ..layout.clone() };
    assert_eq!(grid.largest(), (2350, 2076));
    assert!(arrange(&solid(2350, 2076, "K"), &grid, &Silent).is_ok());
    assert!(arrange(&solid(2351, 2076, "K"), &grid, &Silent).is_err());
    assert!(arrange(&solid(2350, 2077, "K"), &grid, &Silent).is_err());
    // From a corner there is room as far as the other edges; from beyond the page the layout is refused.
    for (x, y, largest) in [(40, 72, (4760, 6300)), (-40, 0, (4800, 6372)), (4800, 0, (4800, 6372))] {
        let position = Position::FromPrintable(dots(x, y));
        assert_eq!(Layout { position, ..Layout::centred(Paper::A4) }.largest(), largest, "{x}, {y}");
    }
    let whole = solid(4740, 100, "K");
    assert_eq!(arrange(&whole, &layout, &Silent).unwrap().laid.area.left, 0);
}

#[test]
fn what_is_too_large_is_told_what_fits_and_what_is_beside_the_page_is_told_to_move() {
    let layout = Layout::centred(Paper::Custom { width: 2362, length: 1181 });
    let said = check(4724, 1181, &layout).unwrap_err().to_string();
    // 100 x 50 mm: half of 200 x 50 is 100 x 25.
    assert!(
        said.contains("make it smaller (99.9 x 24.9 mm fits)") || said.contains("(100.0 x 25.0 mm fits)"),
        "{said}"
    );
    let beside = Layout { position: Position::FromPrintable(dots(-1, 0)), ..layout };
    assert!(check(100, 100, &beside).unwrap_err().to_string().contains("mm; move it"));
}

/// The cells of camera marks, read back from the sheet with nothing shared but the names.
#[test]
fn camera_marks_stand_clear_at_the_corners_of_the_print() {
    let dots = random(900, 700, 5, 3);
    let names = camera::names(&dots);
    let corner = |layout: &Layout, i: usize| -> (usize, usize) {
        let copy =
            arrange(&dots, &Layout { camera_marks: false, ..layout.clone() }, &Silent).unwrap().laid.copies
                [0];
        let ticks = if layout.crop_marks { Mm(5.5).dots() as usize } else { 0 };
        let x = if i.is_multiple_of(2) { copy.left } else { copy.left + copy.width - camera::SIDE };
        let y =
            if i < 2 { copy.top - ticks - 45 - camera::SIDE } else { copy.top + copy.length + ticks + 45 };
        (x, y)
    };
    let paper = Paper::Custom { width: 1500, length: 1700 };
    for layout in [
        Layout { camera_marks: true, ..Layout::centred(paper) },
        Layout { camera_marks: true, crop_marks: true, registration_marks: true, ..Layout::centred(paper) },
    ] {
        let Arranged { sheet, laid } = arrange(&dots, &layout, &Silent).unwrap();
        assert_eq!(laid.marks_left_out, 0);
        let black = sheet.stacks().iter().position(|stack| stack.to_string() == "K").unwrap();
        for (i, name) in names.into_iter().enumerate() {
            let (left, top) = corner(&layout, i);
            for y in 0..camera::SIDE + 60 {
                for x in 0..camera::SIDE + 60 {
                    let dot = sheet.index()[(top + y - 30) * sheet.width() + left + x - 30];
                    let inside = (30..30 + camera::SIDE).contains(&x) && (30..30 + camera::SIDE).contains(&y);
                    let dark = inside && name.is_dark((x - 30) / camera::CELL, (y - 30) / camera::CELL);
                    assert_eq!(usize::from(dot), if dark { black } else { 0 }, "mark {i}, {x}, {y}");
                }
            }
        }
    }
    // A narrow print has its marks apart from each other, and one as long as the paper has none.
    let narrow = random(80, 700, 5, 3);
    let layout = Layout { camera_marks: true, ..Layout::centred(paper) };
    let Arranged { laid, .. } = arrange(&narrow, &layout, &Silent).unwrap();
    assert_eq!((laid.marks_left_out, laid.area.width), (0, 2 * camera::SIDE + camera::QUIET));
    let long = random(900, 1500, 5, 3);
    assert_eq!(arrange(&long, &layout, &Silent).unwrap().laid.marks_left_out, 4);
    let pale = DotMap::new(10, 10, vec![Stack::SUBSTRATE, Stack::new([Ink::White])], vec![1; 100]).unwrap();
    let said = arrange(&pale, &layout, &Silent).unwrap_err().to_string();
    assert!(said.contains("--mark-ink"), "{said}");
    let black = Layout { mark_inks: vec![Ink::White, Ink::Black], ..layout };
    assert!(arrange(&pale, &black, &Silent).is_ok());
}

/// The curve in a tile is its own mirror image: a mirrored copy has whole tiles from its right side.
#[test]
fn the_walk_of_a_mirrored_copy_begins_with_the_first_whole_tile_from_the_right() {
    for width in [100, 128, 333] {
        let plain = Layout::centred(Paper::A4);
        let left = frame(width, 50, &plain).unwrap();
        let found = frame(width, 50, &Layout { mirror: true, ..plain }).unwrap();
        let right = usize::from(left.x) + width;
        assert_eq!((right - usize::from(found.x)) % usize::from(EDGE), 0, "{width}");
        assert!(found.x >= left.x && found.x - left.x < EDGE, "{width}");
    }
}
