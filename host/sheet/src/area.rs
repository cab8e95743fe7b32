//! A rectangle of dots.

use serde::{Deserialize, Serialize};

use super::dots::DotMap;

/// A rectangle of dots, counted from the top left corner of what it lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Area {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub length: usize,
}

impl Area {
    /// All dots of a map.
    pub fn whole(dots: &DotMap) -> Area {
        Area { left: 0, top: 0, width: dots.width(), length: dots.length() }
    }

    /// Whether it has a dot and all its dots lie within `width` x `length` dots.
    pub fn fits(&self, width: usize, length: usize) -> bool {
        let within = |start: usize, size: usize, all: usize| {
            size > 0 && start.checked_add(size).is_some_and(|end| end <= all)
        };
        within(self.left, self.width, width) && within(self.top, self.length, length)
    }
}
