//! Rectangles of the ideal page, and what of one lies beyond another.

use super::length::Mm;

/// A rectangle on the ideal page: dots from the corner of the printable area, `right` and `bottom` one past the last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Rect {
    pub left: i64,
    pub top: i64,
    pub right: i64,
    pub bottom: i64,
}

impl Rect {
    pub fn width(&self) -> i64 {
        self.right - self.left
    }

    pub fn length(&self) -> i64 {
        self.bottom - self.top
    }

    pub fn meet(&self, other: Rect) -> Rect {
        Rect {
            left: self.left.max(other.left),
            top: self.top.max(other.top),
            right: self.right.min(other.right),
            bottom: self.bottom.min(other.bottom),
        }
    }

    pub fn contains(&self, x: i64, y: i64) -> bool {
        (self.left..self.right).contains(&x) && (self.top..self.bottom).contains(&y)
    }
}

/// What lies beyond the printable area, in millimetres on each side.
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// At the left.
    pub left: f64,
    /// At the top.
    pub top: f64,
    /// At the right.
    pub right: f64,
    /// At the bottom.
    pub bottom: f64,
}

impl Cut {
    pub(super) fn of(block: Rect, room: Rect) -> Option<Cut> {
        let beyond = |dots: i64| Mm::of_dots(dots.max(0)).0;
        let cut = Cut {
            left: beyond(room.left - block.left),
            top: beyond(room.top - block.top),
            right: beyond(block.right - room.right),
            bottom: beyond(block.bottom - room.bottom),
        };
        (cut != Cut::default()).then_some(cut)
    }
}

impl std::fmt::Display for Cut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sides = [("left", self.left), ("top", self.top), ("right", self.right), ("bottom", self.bottom)];
        let said: Vec<String> = sides
            .iter()
            .filter(|(_, mm)| *mm > 0.0)
            // A single dot is not nothing.
            .map(|(side, mm)| format!("{:.1} mm at the {side}", mm.max(0.1)))
            .collect();
        f.write_str(&said.join(", "))
    }
}
