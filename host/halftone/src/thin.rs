//! Parts of a halftone that are too thin to hold.
//!
//! Problem: a dot holds if some rectangle of its own stack covers it that has the stack's minimum of dots and sides of at most
//! 2 to 1. A window has a quarter of a million dots, each of which lies in dozens of such rectangles.
//! Method: the dots of a stack are bits. Those at which a rectangle begins are an erosion, those that it covers the dilation of these
//! again; both double the length they have done with each step, 64 dots at a time. Cost: `O(log minimum)` operations a word for each
//! stack and shape: 10 ms for 512 x 512 dots of seven stacks. Memory: a bit a dot.

/// Dots in parts too thin for their stack: no rectangle that has only that stack, as many dots as `minimum(stack)` and sides of
/// at most 2 to 1 covers them. It may reach over dots that `free` exempts, such as solids, and over the border. Exempt dots are
/// not counted.
pub fn thin(width: usize, index: &[u8], minimum: impl Fn(u8) -> usize, free: impl Fn(usize) -> bool) -> u64 {
    let free: Vec<bool> = (0..index.len()).map(free).collect();
    let mut stacks = [false; 256];
    for (&stack, &free) in index.iter().zip(&free) {
        stacks[usize::from(stack)] |= !free;
    }
    let mut count = 0;
    for stack in (0..=255u8).filter(|&stack| stacks[usize::from(stack)]) {
        let shapes = holding(minimum(stack));
        let margin = shapes.iter().map(|&(wide, high)| wide.max(high)).max().unwrap_or(1);
        // The border counts as the stack's own.
        let mut own = Bits::new(width, index.len() / width, margin, true);
        let mut left = Bits::new(width, index.len() / width, margin, false);
        for (at, (&dot, &free)) in index.iter().zip(&free).enumerate() {
            if dot != stack && !free {
                own.toggle(at % width, at / width);
            } else if !free {
                left.toggle(at % width, at / width);
            }
        }
        for (wide, high) in shapes {
            let mut fits = own.clone();
            fits.erode(wide, high);
            fits.dilate(wide, high);
            left.without(&fits);
            if left.count() == 0 {
                break;
            }
        }
        count += left.count();
    }
    count
}

/// The smallest rectangles of at least so many dots whose sides are at most 2 to 1: widths and heights.
fn holding(dots: usize) -> Vec<(usize, usize)> {
    let fits = |wide: usize, high: usize| wide * high >= dots && wide.max(high) <= 2 * wide.min(high);
    let longest = 2 * dots.isqrt() + 2;
    (1..=longest)
        .filter_map(|wide| (1..=longest).find(|&high| fits(wide, high)).map(|high| (wide, high)))
        .collect()
}

/// A bit a dot, with a margin on all sides.
#[derive(Clone)]
struct Bits {
    margin: usize,
    /// Words of a row.
    words: usize,
    rows: Vec<u64>,
}

impl Bits {
    /// All 0 with a margin of `border`, or all 1.
    fn new(width: usize, height: usize, margin: usize, fill: bool) -> Bits {
        let words = (width + 2 * margin).div_ceil(64);
        Bits { margin, words, rows: vec![if fill { u64::MAX } else { 0 }; words * (height + 2 * margin)] }
    }

    fn toggle(&mut self, x: usize, y: usize) {
        let x = x + self.margin;
        self.rows[(y + self.margin) * self.words + x / 64] ^= 1 << (x % 64);
    }

    fn count(&self) -> u64 {
        self.rows.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    fn without(&mut self, other: &Bits) {
        self.rows.iter_mut().zip(&other.rows).for_each(|(word, other)| *word &= !other);
    }

    /// Keeps the dots at which a rectangle of ones begins, to the right and down.
    fn erode(&mut self, wide: usize, high: usize) {
        doubling(wide, 63, |step| {
            for row in self.rows.chunks_exact_mut(self.words) {
                for i in 0..row.len() {
                    let next = row.get(i + 1).copied().unwrap_or(0);
                    row[i] &= row[i] >> step | next << (64 - step);
                }
            }
        });
        doubling(high, usize::MAX, |step| {
            for i in 0..self.rows.len() {
                self.rows[i] &= self.rows.get(i + step * self.words).copied().unwrap_or(0);
            }
        });
    }

    /// Fills a rectangle from every one, to the right and down.
    fn dilate(&mut self, wide: usize, high: usize) {
        doubling(wide, 63, |step| {
            for row in self.rows.chunks_exact_mut(self.words) {
                for i in (0..row.len()).rev() {
                    let before = if i > 0 { row[i - 1] } else { 0 };
                    row[i] |= row[i] << step | before >> (64 - step);
                }
            }
        });
        doubling(high, usize::MAX, |step| {
            for i in (step * self.words..self.rows.len()).rev() {
                self.rows[i] |= self.rows[i - step * self.words];
            }
        });
    }
}

/// Makes steps of at most `most` so that something that reaches over one dot reaches over `length`.
fn doubling(length: usize, most: usize, mut by: impl FnMut(usize)) {
    let mut reach = 1;
    while reach < length {
        let step = reach.min(length - reach).min(most);
        by(step);
        reach += step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every rectangle of every shape around every dot.
    fn by_definition(
        width: usize,
        index: &[u8],
        minimum: impl Fn(u8) -> usize,
        free: impl Fn(usize) -> bool,
    ) -> u64 {
        let height = index.len() / width;
        let covered = |x: usize, y: usize| {
            let stack = index[y * width + x];
            let alike = |x: isize, y: isize| {
                if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
                    return true;
                }
                let at = y as usize * width + x as usize;
                free(at) || index[at] == stack
            };
            let (x, y) = (x as isize, y as isize);
            holding(minimum(stack)).iter().any(|&(wide, high)| {
                let (wide, high) = (wide as isize, high as isize);
                let fits = |left: isize, top: isize| {
                    (top..top + high).all(|y| (left..left + wide).all(|x| alike(x, y)))
                };
                (y - high + 1..=y).any(|top| (x - wide + 1..=x).any(|left| fits(left, top)))
            })
        };
        (0..index.len()).filter(|&at| !free(at) && !covered(at % width, at / width)).count() as u64
    }

    proptest! {
        #![proptest_config(testing::cases(64))]

        /// Blots of three stacks on a ground, some of them exempt.
        #[test]
        fn the_count_is_that_of_the_definition(
            width in 1usize..140,
            height in 1usize..24,
            blots in prop::collection::vec((0u8..4, 0usize..140, 0usize..24, 1usize..9, 1usize..9), 0..40),
            minimum in prop::array::uniform4(1usize..30),
        ) {
            let mut index = vec![0u8; width * height];
            for (stack, left, top, wide, high) in blots {
                for y in top..(top + high).min(height) {
                    for x in left..(left + wide).min(width) {
                        index[y * width + x] = stack;
                    }
                }
            }
            let minimum = |stack: u8| minimum[usize::from(stack)];
            let free = |at: usize| at % 11 == 3 && index[at] != 1;
            prop_assert_eq!(thin(width, &index, minimum, free), by_definition(width, &index, minimum, free));
        }
    }

    #[test]
    fn a_line_is_thin_and_a_square_is_not() {
        let width = 16;
        let mut index = vec![0u8; width * width];
        for y in 4..7 {
            for x in 4..7 {
                index[y * width + x] = 1;
            }
        }
        assert_eq!(thin(width, &index, |_| 9, |_| false), 0);
        // One more dot to the right of the square is covered by no rectangle.
        index[5 * width + 7] = 1;
        assert_eq!(thin(width, &index, |_| 9, |_| false), 1);
        assert_eq!(thin(width, &index, |_| 9, |at| at == 5 * width + 7), 0);
        assert_eq!(thin(width, &index, |_| 1, |_| false), 0);
        // 2 x 4 dots hold 8, and 1 x 8 do not.
        let bar = |wide: usize| -> Vec<u8> {
            (0..width * width)
                .map(|at| u8::from(at % width < 8 / wide && (3..3 + wide).contains(&(at / width))))
                .collect()
        };
        assert_eq!(thin(width, &bar(2), |stack| if stack == 1 { 8 } else { 1 }, |_| false), 0);
        assert_eq!(thin(width, &bar(1), |stack| if stack == 1 { 8 } else { 1 }, |_| false), 8);
        assert_eq!(thin(width, &bar(2), |stack| if stack == 1 { 9 } else { 1 }, |_| false), 8);
    }
}
