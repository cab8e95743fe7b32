//! Every size: each dot once, each step to a neighbour.

extern crate std;

use super::*;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// Walks the whole rectangle by its tile tables; says what is wrong, if anything.
fn check(width: u16, height: u16) -> Result<(), std::string::String> {
    let walk = Walk::new(width, height);
    let mut seen = vec![false; walk.len() as usize];
    let mut table = [0u16; MOST];
    let mut last: Option<(u16, u16)> = None;
    let mut position = 0u32;
    let mut y = 0;
    for band in walk.bands() {
        if band.y != y || band.height > EDGE || band.start() != position {
            return Err(std::format!("{width}x{height}: band {band:?} does not follow row {y}"));
        }
        y += band.height;
        for tile in band.tiles() {
            if tile.w > EDGE || (tile.w < THIN && width >= EDGE) || (tile.h < 20 && height >= EDGE) {
                return Err(std::format!("{width}x{height}: {tile:?} is badly cut"));
            }
            let n = tile.fill(&mut table);
            if n != usize::from(tile.area()) {
                return Err(std::format!("{width}x{height}: {tile:?} has {n} dots"));
            }
            for &offset in &table[..n] {
                let at = (tile.x + offset % EDGE, tile.y + offset / EDGE);
                let place = usize::from(at.1) * usize::from(width) + usize::from(at.0);
                if core::mem::replace(&mut seen[place], true) {
                    return Err(std::format!("{width}x{height}: {at:?} is visited twice"));
                }
                if let Some(last) = last
                    && last.0.abs_diff(at.0) + last.1.abs_diff(at.1) != 1
                {
                    return Err(std::format!("{width}x{height}: step from {last:?} to {at:?}"));
                }
                last = Some(at);
                position += 1;
            }
        }
    }
    if position != walk.len() || y != height {
        return Err(std::format!("{width}x{height}: {position} dots in {y} rows"));
    }
    Ok(())
}

#[test]
fn every_small_rectangle_is_walked_once_by_steps_to_neighbours() {
    for height in 1..=70 {
        for width in 1..=70 {
            check(width, height).unwrap();
        }
    }
}

/// Every height and width a tile can have meets every rest of a division by 128.
#[test]
fn every_rest_of_a_height_and_a_width_is_walked_by_steps_to_neighbours() {
    for side in 1..=400 {
        check(37, side).unwrap();
        check(side, 45).unwrap();
        check(side, side + 1).unwrap();
    }
}

#[test]
fn whole_pages_are_walked_once_by_steps_to_neighbours() {
    for (width, height) in [(4800, 6372), (4940, 7760), (4801, 6373), (2202, 3081), (1, 7761), (4939, 1)] {
        check(width, height).unwrap();
    }
}

/// A wrong stack depth would panic here: the domain is finite and all of it is tried.
#[test]
fn every_tile_starts_and_ends_where_its_orientation_says() {
    let mut table = [0u16; MOST];
    for h in 1..=EDGE {
        for w in 1..=EDGE {
            for orientation in [Orientation::Along, Orientation::Down, Orientation::Back] {
                let (along, across) = if orientation == Orientation::Down { (h, w) } else { (w, h) };
                let tile = Tile { x: 0, y: 0, w, h, orientation };
                assert_eq!(tile.fill(&mut table), usize::from(w * h));
                if (along % 2 == 1 && across % 2 == 0) || along == 1 {
                    continue;
                }
                let dot = |x: u16, y: u16| y * EDGE + x;
                let ends = match orientation {
                    Orientation::Along => (dot(0, 0), dot(w - 1, 0)),
                    Orientation::Down => (dot(0, 0), dot(0, h - 1)),
                    Orientation::Back => (dot(w - 1, h - 1), dot(0, h - 1)),
                };
                assert_eq!((table[0], table[usize::from(w * h) - 1]), ends, "{tile:?}");
            }
        }
    }
}

#[test]
fn sixteen_dots_of_a_full_tile_are_a_square_of_four_by_four() {
    let mut table = [0u16; MOST];
    for orientation in [Orientation::Along, Orientation::Down, Orientation::Back] {
        Tile { x: 0, y: 0, w: 64, h: 64, orientation }.fill(&mut table);
        for block in table.chunks(16) {
            let squares: Vec<_> = block.iter().map(|o| (o % EDGE / 4, o / EDGE / 4)).collect();
            assert!(squares.iter().all(|s| *s == squares[0]), "{orientation:?} {squares:?}");
        }
    }
}

proptest! {
    #[test]
    fn a_position_leads_to_its_dot_and_back(width in 1u16..=300, height in 1u16..=300, at in 0u32..90_000) {
        let walk = Walk::new(width, height);
        let at = at % walk.len();
        let (x, y) = walk.at(at).unwrap();
        prop_assert_eq!(walk.position(x, y), Some(at));
        if at > 0 {
            let (px, py) = walk.at(at - 1).unwrap();
            prop_assert_eq!(px.abs_diff(x) + py.abs_diff(y), 1);
        }
    }
}

/// The descent by areas and the table by a stack are two routes to one curve.
#[test]
fn single_positions_agree_with_the_tables() {
    let mut table = [0u16; MOST];
    for (width, height) in [(200, 131), (97, 200), (64, 192), (5, 9)] {
        let walk = Walk::new(width, height);
        let mut position = 0;
        for tile in walk.bands().flat_map(|band| band.tiles()) {
            let n = tile.fill(&mut table);
            for &offset in &table[..n] {
                let dot = (tile.x + offset % EDGE, tile.y + offset / EDGE);
                assert_eq!(walk.at(position), Some(dot));
                assert_eq!(walk.position(dot.0, dot.1), Some(position));
                position += 1;
            }
        }
    }
}

#[test]
fn a_rectangle_without_dots_has_no_bands_and_outside_is_nowhere() {
    for (width, height) in [(0, 9), (9, 0), (0, 0)] {
        let walk = Walk::new(width, height);
        assert!(walk.is_empty() && walk.bands().len() == 0 && walk.at(0).is_none());
    }
    let walk = Walk::new(9, 9);
    assert_eq!((walk.at(81), walk.position(9, 0), walk.position(0, 9)), (None, None, None));
    assert_eq!(Walk::new(u16::MAX, u16::MAX).at(u32::MAX), None);
}
