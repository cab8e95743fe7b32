//! A rectangle of a picture's pixels, such as the part that is drawn or the part to print.

use rayon::prelude::*;
use sheet::Turn;

/// A rectangle in pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Window {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Window {
    /// The whole of a picture of so many pixels across and down.
    #[must_use]
    pub fn whole((width, height): (usize, usize)) -> Window {
        Window { left: 0, top: 0, width, height }
    }

    /// The smallest window around all pixels with a byte other than `ground`. A pixel has `bytes` bytes, a row has `width`
    /// pixels.
    pub fn around(pixels: &[u8], width: usize, bytes: usize, ground: u8) -> Option<Window> {
        let drawn = |&byte: &u8| byte != ground;
        // For each row that is not blank: its number, and its first and last byte other than the ground.
        let [top, bottom, first, last] = pixels
            .par_chunks_exact((width * bytes).max(1))
            .enumerate()
            .filter_map(|(y, row)| {
                // Most rows are blank, and comparing words finds that fastest.
                let (head, words, tail) = (row.as_chunks::<16>().0, [ground; 16], row.as_chunks::<16>().1);
                if head.iter().all(|word| *word == words) && !tail.iter().any(drawn) {
                    return None;
                }
                Some([y, y, row.iter().position(drawn)?, row.iter().rposition(drawn)?])
            })
            .reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])])?;
        let (left, right) = (first / bytes, last / bytes);
        Some(Window { left, top, width: right + 1 - left, height: bottom + 1 - top })
    }

    /// The same window of a picture that is turned; `size` is that before the turn.
    #[must_use]
    pub fn turned(self, size: (usize, usize), turn: Turn) -> Window {
        let Window { left, top, width, height } = self;
        let (right, below) = (size.0 - left - width, size.1 - top - height);
        let (left, top) = match turn {
            Turn::None => (left, top),
            Turn::Left => (top, right),
            Turn::Half => (right, below),
            Turn::Right => (below, left),
        };
        let (width, height) = turn.sides((width, height));
        Window { left, top, width, height }
    }

    /// The smallest window around both.
    pub fn join(&self, other: &Window) -> Window {
        let (left, top) = (self.left.min(other.left), self.top.min(other.top));
        let right = (self.left + self.width).max(other.left + other.width);
        let bottom = (self.top + self.height).max(other.top + other.height);
        Window { left, top, width: right - left, height: bottom - top }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_drawn_lies_in_its_window_and_touches_all_its_sides(
            width in 1usize..40,
            drawn in prop::collection::vec((0usize..40, 0usize..9, 0usize..3), 0..6),
        ) {
            let mut pixels = vec![255u8; 3 * width * 9];
            let drawn: Vec<_> = drawn.into_iter().map(|(x, y, c)| (x % width, y, c)).collect();
            for (x, y, c) in &drawn {
                pixels[3 * (y * width + x) + c] = 254;
            }
            let window = Window::around(&pixels, width, 3, 255);
            prop_assert_eq!(window.is_none(), drawn.is_empty());
            if let Some(window) = window {
                let xs = || drawn.iter().map(|pixel| pixel.0);
                let ys = || drawn.iter().map(|pixel| pixel.1);
                prop_assert_eq!((window.left, window.left + window.width - 1), (xs().min().unwrap(), xs().max().unwrap()));
                prop_assert_eq!((window.top, window.top + window.height - 1), (ys().min().unwrap(), ys().max().unwrap()));
            }
        }
    }
}
