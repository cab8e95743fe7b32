//! Connected shapes of flat colours, and how wide their strokes are.
//!
//! Problem: whether a colour is printed solid depends on the width of what is drawn in it.
//! Method: a shape is a 4-connected set of dots of one kind whose colours follow each other as in a shading, held as runs of rows. Its
//! width is the side of the largest square that fits in it, by the recurrence over the three neighbours above and to the left.
//! Cost: 3 ns a dot of such shapes, 0.3 ns of others. Memory: 32 bytes a run.
//! Limits: a slanting stroke counts as thinner than it is.

use super::flat::{Flat, TONE, similar};
use sheet::forest::Forest;

/// A stretch of a row that belongs to one shape.
pub(super) struct Run {
    pub start: u32,
    pub end: u32,
    /// The root of its shape, another run or this.
    pub root: u32,
    pub colour: u8,
    /// Side of the largest square that ends in the run; at the root, of the shape.
    pub side: u8,
}

/// Whether two colours of the palette can belong to one shape.
pub(super) fn joined(flat: &Flat, a: u8, b: u8) -> bool {
    let ((kind, colour), (other, beside)) = (flat.colours[usize::from(a)], flat.colours[usize::from(b)]);
    a == b || kind == other && similar(colour, beside)
}

/// Whether what is beside a colour of the palette can belong to its shape; what is no colour of the palette cannot.
pub(super) fn continues(flat: &Flat, own: u8, beside: u8) -> bool {
    usize::from(beside) < flat.colours.len() && joined(flat, own, beside)
}

/// A stretch of a run at whose dots large squares end: each is the lower right corner of one that lies in its shape.
pub(super) struct Core {
    pub run: u32,
    pub start: u32,
    pub end: u32,
}

/// All shapes of an image.
pub(super) struct Shapes {
    pub runs: Vec<Run>,
    /// The number of the first run of each row, and how many there are.
    pub rows: Vec<usize>,
    /// Where the large squares end, in order.
    pub cores: Vec<Core>,
}

/// The shapes in these colours, and the squares of `large` dots in them.
pub(super) fn shapes(flat: &Flat, width: usize, (shaped, large): (&[bool; 256], u8)) -> Shapes {
    let pairs: Vec<bool> = (0..=255u8)
        .flat_map(|a| (0..=255u8).map(move |b| (a, b)))
        .map(|(a, b)| shaped[usize::from(a)] && shaped[usize::from(b)] && joined(flat, a, b))
        .collect();
    let alike = |a: u8, b: u8| pairs[256 * usize::from(a) + usize::from(b)];
    let (mut runs, mut rows, mut cores) = (Vec::<Run>::new(), vec![0], Vec::<Core>::new());
    let mut shapes = Forest::default();
    // Sides of the largest squares whose lower right corner is a dot of this row and of the one above.
    let (mut here, mut above) = (vec![0u8; width], vec![0u8; width]);
    let blank = vec![TONE; width];
    for (y, row) in flat.index.chunks_exact(width).enumerate() {
        let over = if y > 0 { &flat.index[(y - 1) * width..y * width] } else { &blank };
        let first = *rows.last().unwrap_or(&0);
        let mut up = if y > 0 { rows[y - 1] } else { 0 };
        here.fill(0);
        let mut x = 0;
        while x < width {
            let colour = row[x];
            if !shaped[usize::from(colour)] {
                x += 1;
                continue;
            }
            let number = shapes.add();
            let start = x;
            let mut side = 0;
            while x < width && row[x] == colour {
                let whole = x > 0
                    && alike(colour, row[x - 1])
                    && alike(colour, over[x])
                    && alike(colour, over[x - 1]);
                let least = if whole { here[x - 1].min(above[x]).min(above[x - 1]) } else { 0 };
                here[x] = least.saturating_add(1);
                side = side.max(here[x]);
                if here[x] >= large {
                    let at = x as u32;
                    match cores.last_mut().filter(|core| core.run == number && core.end == at) {
                        Some(core) => core.end += 1,
                        None => cores.push(Core { run: number, start: at, end: at + 1 }),
                    }
                }
                x += 1;
            }
            runs.push(Run { start: start as u32, end: x as u32, root: number, colour, side });
            if start > 0 && number as usize > first && alike(colour, row[start - 1]) {
                shapes.join(number, number - 1);
            }
            while up < first && runs[up].end as usize <= start {
                up += 1;
            }
            for other in (up..first).take_while(|&at| (runs[at].start as usize) < x) {
                if alike(colour, runs[other].colour) {
                    shapes.join(number, other as u32);
                }
            }
        }
        rows.push(runs.len());
        std::mem::swap(&mut here, &mut above);
    }
    for (at, root) in shapes.roots().into_iter().enumerate() {
        runs[at].root = root;
        let side = runs[at].side;
        runs[root as usize].side = runs[root as usize].side.max(side);
    }
    Shapes { runs, rows, cores }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::ObjectType;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn shapes_are_connected_sets_and_their_squares_the_largest(
            width in 1usize..20, seed: u32, length in 1usize..20, dense in 30u32..95
        ) {
            let random = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 11;
            let is = |x: usize, y: usize| random(y * width + x) % 100 < dense;
            let colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3]), (ObjectType::Text, [128; 3])];
            let index: Vec<u8> = (0..width * length).map(|at| 2 * u8::from(is(at % width, at / width))).collect();
            let flat = Flat { colours, index };
            let mut shaped = [false; 256];
            shaped[2] = true;
            let Shapes { runs, rows, cores } = shapes(&flat, width, (&shaped, 2));
            // By spreading numbers from dot to neighbour.
            let mut number: Vec<usize> = (0..width * length).collect();
            let mut changed = true;
            while std::mem::take(&mut changed) {
                for at in (0..width * length).filter(|&at| is(at % width, at / width)) {
                    let right = (at % width + 1 < width).then_some(at + 1);
                    for next in [right, Some(at + width)].into_iter().flatten() {
                        if next < width * length && is(next % width, next / width) {
                            let least = number[at].min(number[next]);
                            changed |= number[at] != least || number[next] != least;
                            (number[at], number[next]) = (least, least);
                        }
                    }
                }
            }
            let mut sides = vec![0; width * length];
            for at in 0..width * length {
                for side in 1..=width.min(length) {
                    let (x, y) = (at % width, at / width);
                    if x + side <= width
                        && y + side <= length
                        && (y..y + side).all(|y| (x..x + side).all(|x| is(x, y)))
                    {
                        sides[number[at]] = sides[number[at]].max(side);
                    }
                }
            }
            for y in 0..length {
                for x in 0..width {
                    let square = x > 0 && y > 0 && (y - 1..=y).all(|y| (x - 1..=x).all(|x| is(x, y)));
                    let core = |core: &Core| {
                        (rows[y]..rows[y + 1]).contains(&(core.run as usize))
                            && (core.start..core.end).contains(&(x as u32))
                    };
                    prop_assert_eq!(cores.iter().any(core), square);
                }
                for at in rows[y]..rows[y + 1] {
                    let shape = runs[at].root;
                    let dot = y * width + runs[at].start as usize;
                    prop_assert_eq!(usize::from(runs[shape as usize].side), sides[number[dot]]);
                    for (v, other) in (0..length).flat_map(|v| (rows[v]..rows[v + 1]).map(move |other| (v, other))) {
                        let beside = v * width + runs[other].start as usize;
                        prop_assert_eq!(runs[other].root == shape, number[beside] == number[dot]);
                    }
                }
            }
        }
    }
}
