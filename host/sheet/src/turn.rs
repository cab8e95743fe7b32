//! Quarter turns of a picture.

use serde::{Deserialize, Serialize};

/// A turn of a picture by whole quarters.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Turn {
    /// As it comes.
    #[default]
    None,
    /// By 90° anticlockwise.
    Left,
    /// By 180°.
    Half,
    /// By 90° clockwise.
    Right,
}

impl Turn {
    /// Whether rows become columns.
    #[must_use]
    pub fn is_across(self) -> bool {
        matches!(self, Turn::Left | Turn::Right)
    }

    /// Width and height after the turn.
    #[must_use]
    pub fn sides<T>(self, (width, height): (T, T)) -> (T, T) {
        if self.is_across() { (height, width) } else { (width, height) }
    }

    /// Where what lies at this column and row after the turn lay before it, in a picture that had this width
    /// and height then.
    #[must_use]
    pub fn source(self, (x, y): (usize, usize), (width, height): (usize, usize)) -> (usize, usize) {
        match self {
            Turn::None => (x, y),
            Turn::Left => (width - 1 - y, x),
            Turn::Half => (width - 1 - x, height - 1 - y),
            Turn::Right => (y, height - 1 - x),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Letters that are read row by row.
    fn turned(turn: Turn, rows: &[&str]) -> Vec<String> {
        let size = (rows[0].len(), rows.len());
        let (width, height) = turn.sides(size);
        let letter = |x, y| {
            let (x, y) = turn.source((x, y), size);
            char::from(rows[y].as_bytes()[x])
        };
        (0..height).map(|y| (0..width).map(|x| letter(x, y)).collect()).collect()
    }

    #[test]
    fn a_turn_goes_the_way_it_says() {
        let rows = ["abc", "def"];
        assert_eq!(turned(Turn::None, &rows), ["abc", "def"]);
        assert_eq!(turned(Turn::Left, &rows), ["cf", "be", "ad"]);
        assert_eq!(turned(Turn::Half, &rows), ["fed", "cba"]);
        assert_eq!(turned(Turn::Right, &rows), ["da", "eb", "fc"]);
    }

    proptest! {
        #[test]
        fn two_quarters_are_a_half_and_left_undoes_right(
            width in 1usize..9, height in 1usize..9, at in (0usize..9, 0usize..9)
        ) {
            let (size, at) = ((width, height), (at.0 % width, at.1 % height));
            // The picture on its side in between.
            let between = (height, width);
            let left = Turn::Left.source(Turn::Left.source(at, between), size);
            prop_assert_eq!(left, Turn::Half.source(at, size));
            prop_assert_eq!(Turn::Right.source(Turn::Left.source(at, between), size), at);
        }
    }
}
