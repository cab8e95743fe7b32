//! Pictures amid flat art: icons and photographs on a ground that text is on, too.
//!
//! Problem: a screenshot is one shape, since all of it is on one ground. What is shaded in it is no flat art, and what is flat no picture.
//! Method: a pixel that is neither a main colour nor between two is a stray. What hangs together beside the wide main colours is an island if
//! strays fill a square of three pixels of it, and if by more than half of its border it ends in a step: a shadow fades into its ground, and
//! both are one picture.
//! Cost: a look at each pixel of shapes with strays. Limits: what touches an island is of it, such as a line around it in the colour of softened
//! edges; pixels in the very colour of the ground are not.

use std::ops::Range;

use super::flat::{similar, split};
use super::main_colours::WHITE_AND_BLACK;
use sheet::forest::{Forest, beside};

/// Flat art and what is not explained of it.
pub(super) struct Sea<'a, const N: usize> {
    pub pixels: &'a [[u8; N]],
    pub width: usize,
    /// Its pixels, in order.
    pub stretches: &'a [Range<usize>],
    /// Those that are neither a main colour nor between two, in order.
    pub strays: &'a [usize],
    /// How many times the pixels were enlarged after they were drawn.
    pub enlarged: usize,
}

impl<const N: usize> Sea<'_, N> {
    /// The islands, in order. `is_ground` tells wide main colours.
    pub fn islands(&self, is_ground: impl Fn([u8; 3]) -> bool) -> Vec<Range<usize>> {
        let cores: Vec<usize> = self.strays.iter().copied().filter(|&at| self.ends_a_square(at)).collect();
        if cores.is_empty() {
            return Vec::new();
        }
        let is_ground = |pixel: &[u8; N]| {
            let (_, colour) = split(pixel);
            WHITE_AND_BLACK.contains(&colour) || is_ground(colour)
        };
        let mut loose: Vec<Range<usize>> = Vec::new();
        for stretch in self.stretches {
            let mut at = stretch.start;
            for run in self.pixels[stretch.clone()].chunk_by(|a, b| is_ground(a) == is_ground(b)) {
                if !is_ground(&run[0]) {
                    loose.push(at..at + run.len());
                }
                at += run.len();
            }
        }
        let roots = Forest::of_stretches(&loose, self.width, |_, _| true).roots();
        let mut has_core = vec![false; loose.len()];
        for core in cores {
            let of = loose.partition_point(|run| run.end <= core);
            has_core[roots[of] as usize] = true;
        }
        // How much of the border there is to ground, and how much of that is no step.
        let mut borders = vec![[0u64; 2]; loose.len()];
        for (run, &root) in loose.iter().zip(&roots).filter(|&(_, &root)| has_core[root as usize]) {
            let [border, faded] = &mut borders[root as usize];
            for (inside, outside) in self.edges(run.clone()) {
                let [own, other] = [inside, outside].map(|at| split(&self.pixels[at]).1);
                if is_ground(&self.pixels[outside]) {
                    *border += 1;
                    *faded += u64::from(similar(own, other));
                }
            }
        }
        let is_island = |&(_, &root): &(Range<usize>, &u32)| {
            let [border, faded] = borders[root as usize];
            has_core[root as usize] && 2 * faded < border
        };
        loose.into_iter().zip(&roots).filter(is_island).map(|(run, _)| run).collect()
    }

    /// Whether a stray is the last of a square of three, as they were drawn.
    fn ends_a_square(&self, at: usize) -> bool {
        let side = 2 * self.enlarged;
        at % self.width >= side
            && at >= side * self.width
            && (0..9).all(|place| {
                let (x, y) = (place % 3 * self.enlarged, place / 3 * self.enlarged);
                self.strays.binary_search(&(at - x - y * self.width)).is_ok()
            })
    }

    /// The pixels of a run and those beside it, pair by pair.
    fn edges(&self, run: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
        let (width, pixels) = (self.width, self.pixels.len());
        beside(run.clone(), width).filter(move |&at| at < pixels).map(move |at| {
            let row = run.start / width;
            let x = (at % width).clamp(run.start % width, (run.end - 1) % width);
            (row * width + x, at)
        })
    }
}

/// Pixels, and what is told of them, without those of islands; both are in order.
pub(super) fn without<'a, T: Copy>(
    pixels: &'a [(Range<usize>, T)],
    islands: &'a [Range<usize>],
) -> impl Iterator<Item = (Range<usize>, T)> + 'a {
    let mut next = 0;
    pixels.iter().flat_map(move |(all, told)| {
        while islands.get(next).is_some_and(|island| island.end <= all.start) {
            next += 1;
        }
        let within = islands[next..].iter().take_while(|island| island.start < all.end);
        let ends = within.clone().map(|island| island.start).chain([all.end]);
        let starts = [all.start].into_iter().chain(within.map(|island| island.end));
        let parts = starts.zip(ends).filter(|(start, end)| start < end);
        parts.map(|(start, end)| (start..end, *told)).collect::<Vec<_>>()
    })
}

#[cfg(test)]
mod tests {
    use super::super::posters::{Known, Poster, poster};
    use super::*;

    const SIDE: usize = 160;
    const GROUND: [u8; 3] = [225, 235, 250];
    const INK: [u8; 3] = [30, 40, 60];

    /// A ground with rows of stems and whatever `picture` says, on which a pixel may be none of both.
    fn page(picture: impl Fn(usize, usize) -> Option<[u8; 3]>) -> Vec<[u8; 3]> {
        let pixel = |(x, y): (usize, usize)| match (x % 9, y % 16) {
            _ if picture(x, y).is_some() => picture(x, y).unwrap_or(GROUND),
            (2..4, 3..13) if x < 90 => INK,
            _ => GROUND,
        };
        (0..SIDE * SIDE).map(|at| pixel((at % SIDE, at / SIDE))).collect()
    }

    fn art(pixels: &[[u8; 3]]) -> Option<Poster> {
        let rows: Vec<Range<usize>> = (0..SIDE).map(|y| y * SIDE..(y + 1) * SIDE).collect();
        poster(pixels, SIDE, &rows, Known { common: &[], thin: false, enlarged: 1 })
    }

    /// A shaded disc with a softened edge.
    fn disc(x: usize, y: usize) -> Option<[u8; 3]> {
        let far = (x as f64 - 125.0).hypot(y as f64 - 60.0);
        let own = [250.0 - 2.0 * x as f64 / 3.0, 60.0 + 2.0 * y as f64, 40.0];
        let share = (22.5 - far).clamp(0.0, 1.0);
        (share > 0.0)
            .then(|| std::array::from_fn(|c| (own[c] * share + f64::from(GROUND[c]) * (1.0 - share)) as u8))
    }

    #[test]
    fn a_shaded_disc_on_a_ground_with_letters_is_a_picture_and_they_are_flat() {
        let pixels = page(disc);
        let found = art(&pixels).expect("flat art");
        let mut seen = vec![None; pixels.len()];
        for (span, colour) in found.spans {
            seen[span].fill(Some(colour));
        }
        for (at, seen) in seen.into_iter().enumerate() {
            let far = ((at % SIDE) as f64 - 125.0).hypot((at / SIDE) as f64 - 60.0);
            match far {
                ..21.0 => assert_eq!(seen, None, "{far}"),
                24.0.. => assert_eq!(seen, Some(pixels[at])),
                _ => {}
            }
        }
    }

    /// A glow ends where nobody sees it: it and its ground are one picture.
    #[test]
    fn what_fades_into_its_ground_is_no_island() {
        let glow = |x: usize, y: usize| {
            let far = (x as f64 - 125.0).hypot(y as f64 - 60.0);
            let share = (1.0 - far / 30.0).max(0.0);
            (share > 0.0).then(|| {
                std::array::from_fn(|c| {
                    (f64::from(GROUND[c]) * (1.0 - share) + [250.0, 90.0, 20.0][c] * share).round() as u8
                })
            })
        };
        assert!(art(&page(glow)).is_none());
    }

    #[test]
    fn pixels_without_islands_are_all_others() {
        let pixels = [(2..9, 'a'), (9..10, 'b'), (14..20, 'c'), (20..30, 'd')];
        let islands = [0..1, 4..5, 6..7, 9..10, 12..13, 18..22, 29..31];
        let found: Vec<_> = without(&pixels, &islands).collect();
        assert_eq!(found, [(2..4, 'a'), (5..6, 'a'), (7..9, 'a'), (14..18, 'c'), (22..29, 'd')]);
    }
}
