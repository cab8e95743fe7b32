//! Crop marks, registration marks and camera marks around a block of copies.
//!
//! Crop marks are ticks outside the block in line with every edge that is cut. Registration marks are a cross in a ring in
//! the middle of each side, printed by every pass on the same place, so that a pass that is off shows beside the others.
//! Camera marks stand above and below the block, flush with its sides, clear of all other marks, with bare paper around them.
//! Where the printable area leaves no room a tick becomes shorter; what cannot be drawn is counted.

use inks::Stack;
use protocol::ink::Ink;

use super::block::Block;
use super::camera::{self, Name, QUIET, SIDE};
use super::length::Mm;
use super::rect::Rect;
use super::settings::{Layout, LayoutError};
use sheet::DotMap;
use sheet::order::passes_of;

/// From the block to a mark, in millimetres.
const AWAY: f64 = 1.5;
/// Length of a tick, and the least that is still one.
const TICK: f64 = 4.0;
const LEAST_TICK: f64 = 1.0;
/// Width of all lines in dots: 0.17 mm, as fine as foil goes.
const LINE: i64 = 4;
/// Side of a registration mark in millimetres.
const TARGET: f64 = 5.0;

/// What a mark is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum MarkShape {
    /// A filled rectangle.
    Tick,
    /// A cross in a ring that fills the rectangle.
    Target,
    /// A pattern that fills the rectangle.
    Camera(Name),
}

/// A mark and its place on the ideal page.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Mark {
    pub(super) place: Rect,
    pub(super) shape: MarkShape,
}

impl Mark {
    /// Whether the mark has ink at (x, y) of the page.
    pub(super) fn covers(&self, x: i64, y: i64) -> bool {
        if !self.place.contains(x, y) {
            return false;
        }
        match self.shape {
            MarkShape::Tick => true,
            MarkShape::Camera(name) => {
                let cell = |at: i64, from: i64| (at - from) as usize / camera::CELL;
                name.is_dark(cell(x, self.place.left), cell(y, self.place.top))
            }
            MarkShape::Target => {
                // In half dots from the middle, so that even sides have one.
                let side = self.place.width();
                let dx = 2 * (x - self.place.left) + 1 - side;
                let dy = 2 * (y - self.place.top) + 1 - side;
                let reach = dx * dx + dy * dy;
                let (outer, inner) = (side * 2 / 3, side * 2 / 3 - 2 * LINE);
                dx.abs() < LINE
                    || dy.abs() < LINE
                    || (reach < outer * outer && reach >= inner.max(0) * inner.max(0))
            }
        }
    }
}

/// Ticks in line with the columns' and rows' edges (first and one past the last dot), and how many had no room.
pub(super) fn crop(
    block: Rect,
    columns: &[(i64, i64)],
    rows: &[(i64, i64)],
    room: Rect,
) -> (Vec<Mark>, usize) {
    let (away, tick) = (Mm(AWAY).dots(), Mm(TICK).dots());
    let mut places = Vec::new();
    for edge in edges(columns) {
        let (left, right) = (edge - LINE / 2, edge + LINE / 2);
        places.push((Rect { left, right, top: block.top - away - tick, bottom: block.top - away }, true));
        places
            .push((Rect { left, right, top: block.bottom + away, bottom: block.bottom + away + tick }, true));
    }
    for edge in edges(rows) {
        let (top, bottom) = (edge - LINE / 2, edge + LINE / 2);
        places.push((Rect { top, bottom, left: block.left - away - tick, right: block.left - away }, false));
        places
            .push((Rect { top, bottom, left: block.right + away, right: block.right + away + tick }, false));
    }
    let mut missing = 0;
    let marks = places
        .into_iter()
        .filter_map(|(place, upright)| {
            let fits = place.meet(room);
            let (length, width) =
                if upright { (fits.length(), fits.width()) } else { (fits.width(), fits.length()) };
            // Half a line at the very edge of the printable area still shows where to cut.
            if length < Mm(LEAST_TICK).dots() || width < LINE / 2 {
                missing += 1;
                return None;
            }
            Some(Mark { place: fits, shape: MarkShape::Tick })
        })
        .collect();
    (marks, missing)
}

/// All edges, each once; two that touch are one cut.
fn edges(spans: &[(i64, i64)]) -> Vec<i64> {
    let mut edges: Vec<i64> = spans.iter().flat_map(|&(start, end)| [start, end]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// A registration mark in the middle of each side of the block, and how many had no room. They stand clear of `ticks`.
pub(super) fn registration(block: Rect, room: Rect, ticks: bool) -> (Vec<Mark>, usize) {
    let side = Mm(TARGET).dots();
    let away = if ticks { Mm(AWAY + TICK + AWAY).dots() } else { Mm(AWAY).dots() };
    let (x, y) = ((block.left + block.right - side) / 2, (block.top + block.bottom - side) / 2);
    let corners = [
        (x, block.top - away - side),
        (x, block.bottom + away),
        (block.left - away - side, y),
        (block.right + away, y),
    ];
    let places = corners.map(|(left, top)| Rect { left, top, right: left + side, bottom: top + side });
    let marks: Vec<Mark> = places
        .into_iter()
        .filter(|place| place.meet(room) == *place)
        .map(|place| Mark { place, shape: MarkShape::Target })
        .collect();
    let missing = places.len() - marks.len();
    (marks, missing)
}

/// A camera mark at each corner of the block, and how many had no room.
fn cameras(block: Rect, room: Rect, layout: &Layout, names: [Name; camera::CORNERS]) -> (Vec<Mark>, usize) {
    let (side, quiet) = (SIDE as i64, QUIET as i64);
    let away = quiet + if layout.crop_marks { Mm(AWAY + TICK).dots() } else { 0 };
    // Between the two above the block: bare paper, and a cross if there is one.
    let between = quiet + if layout.registration_marks { quiet + Mm(TARGET).dots() } else { 0 };
    let left = block.left.min((block.left + block.right - between) / 2 - side);
    let right = block.right.max(left + 2 * side + between);
    let (above, below) = (block.top - away - side, block.bottom + away);
    let corners = [(left, above), (right - side, above), (left, below), (right - side, below)];
    let marks: Vec<Mark> = corners
        .into_iter()
        .zip(names)
        .map(|((left, top), name)| Mark {
            place: Rect { left, top, right: left + side, bottom: top + side },
            shape: MarkShape::Camera(name),
        })
        .filter(|mark| mark.place.meet(room) == mark.place)
        .collect();
    let missing = camera::CORNERS - marks.len();
    (marks, missing)
}

/// The darkest ink of these on white paper, if one is dark.
fn dark(inks: &[Ink]) -> Option<Ink> {
    const ORDER: [Ink; 7] = [
        Ink::Black,
        Ink::Magenta,
        Ink::Cyan,
        Ink::MetallicMagenta,
        Ink::MetallicCyan,
        Ink::MetallicGold,
        Ink::MetallicSilver,
    ];
    ORDER.into_iter().find(|ink| inks.contains(ink))
}

/// The ink in use that shows best on most grounds.
fn best(inks: &[Ink]) -> Option<Ink> {
    const ORDER: [Ink; 13] = [
        Ink::Black,
        Ink::MetallicSilver,
        Ink::MetallicGold,
        Ink::MetallicCyan,
        Ink::MetallicMagenta,
        Ink::Magenta,
        Ink::Cyan,
        Ink::White,
        Ink::Yellow,
        Ink::SilverFoil,
        Ink::GoldFoil,
        Ink::Finish,
        Ink::Primer,
    ];
    ORDER.into_iter().find(|ink| inks.contains(ink))
}

/// Chosen inks in the order of the passes they join, those the dots do not have where they customarily go.
fn in_order(chosen: &[Ink], in_use: &[Ink]) -> Vec<Ink> {
    let mut stacks: Vec<Stack> = chosen.iter().map(|&ink| Stack::new([ink])).collect();
    stacks.push(Stack::new(in_use));
    let mut order: Vec<Ink> = Vec::new();
    for ink in passes_of(&stacks) {
        if chosen.contains(&ink) && !order.contains(&ink) {
            order.push(ink);
        }
    }
    order
}

/// The marks, each with the number of its stack, which is added to `stacks`; and how many had no room. `in_use` are the
/// inks of the dots in the order of passes.
pub(super) fn marks_of(
    layout: &Layout,
    dots: &DotMap,
    in_use: &[Ink],
    block: &Block,
    stacks: &mut Vec<Stack>,
) -> Result<(Vec<(Mark, u8)>, usize), LayoutError> {
    let (ticks, crosses) = match &layout.mark_inks[..] {
        [] => (best(in_use).into_iter().collect(), in_use.to_vec()),
        chosen => {
            let chosen = in_order(chosen, in_use);
            (chosen.clone(), chosen)
        }
    };
    let mut number = |inks: Vec<Ink>| -> Result<u8, LayoutError> {
        let stack = Stack::new(inks);
        let at = stacks.iter().position(|known| *known == stack).unwrap_or_else(|| {
            stacks.push(stack);
            stacks.len() - 1
        });
        u8::try_from(at).map_err(|_| LayoutError::Stacks)
    };
    let (mut all, mut left_out) = (Vec::new(), 0);
    let mut add = |(marks, missing): (Vec<Mark>, usize), stack: u8| {
        all.extend(marks.into_iter().map(|mark| (mark, stack)));
        left_out += missing;
    };
    if layout.crop_marks {
        add(crop(block.place, &block.columns, &block.rows, block.room), number(ticks)?);
    }
    if layout.registration_marks {
        add(registration(block.place, block.room, layout.crop_marks), number(crosses)?);
    }
    if layout.camera_marks {
        let chosen = if layout.mark_inks.is_empty() { in_use } else { &layout.mark_inks[..] };
        let Some(ink) = dark(chosen) else {
            return Err(LayoutError::Setting(
                "camera marks need a dark ink, and none of the inks of this sheet is dark on paper; choose one with --mark-ink, such \
                 as black"
                    .into(),
            ));
        };
        add(cameras(block.place, block.room, layout, camera::names(dots)), number(vec![ink])?);
    }
    Ok((all, left_out))
}
