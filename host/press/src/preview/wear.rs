//! The dots that a worn printer leaves of a sheet.
//!
//! Problem: passes do not fall exactly on each other and single dots do not transfer. Before a sheet is printed one wants to see how much
//! of that it bears.
//! Method: every pass is shifted and stretched by normal deviates of a given root mean square, and each of its dots is left out with a given
//! probability. What then lies on a dot are the inks of the passes that reach it, in the order of the passes: a new stack. All
//! deviates follow from seed, pass and place alone, so the result does not depend on the number of threads.
//! Cost: for each dot and pass one look at a table, and a number where dots may be missing; some 10 ns a dot for seven passes.
//! Limits: shifts are whole dots of 0.042 mm, in each row by itself where the feed is off. What is shifted over the edge is lost, and bare
//! paper comes in. Missing dots are independent; a dead element of a head would leave a line. Of more than 256 stacks the rarest show as
//! the nearest of the others.

use std::collections::HashMap;
use std::f64::consts::TAU;

use inks::Stack;
use protocol::ink::Ink;
use rayon::prelude::*;

use crate::separate::{SeparateError, passes};
use crate::split_mix::nth;
use sheet::MOST_PASSES;
use sheet::{DOTS_PER_MM, DotMap};

/// How worn a printer is. The default is a new one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wear {
    /// Root mean square of the shift of a pass in millimetres, across and along the feed alike.
    pub registration: f64,
    /// Root mean square of what a pass is fed too far, as a share of the length.
    pub feed: f64,
    /// Probability that a dot of a pass does not transfer, 0 to 1.
    pub missing: f64,
    /// Chooses among the printers that are worn like this.
    pub seed: u64,
}

/// Where a pass fell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// Its ink.
    pub ink: Ink,
    /// Dots to the right.
    pub right: i64,
    /// Dots down, at the top of the sheet.
    pub down: f64,
    /// Share of the length by which it was fed too far.
    pub feed: f64,
}

impl Moved {
    /// Millimetres to the right and down at the top of the sheet, as printed: in whole dots.
    pub fn millimetres(&self) -> [f64; 2] {
        [self.right as f64, self.down.round()].map(|dots| dots / DOTS_PER_MM)
    }
}

/// What became of a sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Worn {
    /// The dots as they are.
    pub dots: DotMap,
    /// The passes, first printed first.
    pub passes: Vec<Moved>,
    /// Dots whose stack is another one than was planned.
    pub changed: u64,
    /// Dots that should have had a stack other than bare paper.
    pub planned: u64,
    /// Dots shown with a similar stack because there were more than 256.
    pub merged: u64,
}

/// The most stacks of a dot map.
const MOST_STACKS: usize = 256;

/// A number above 0 and at most 1.
fn uniform(seed: u64, n: u64) -> f64 {
    ((nth(seed, n) >> 11) + 1) as f64 / (1u64 << 53) as f64
}

/// A standard normal deviate (Box and Muller 1958).
fn normal(seed: u64, n: u64) -> f64 {
    (-2.0 * uniform(seed, 2 * n).ln()).sqrt() * (TAU * uniform(seed, 2 * n + 1)).cos()
}

impl Wear {
    /// Whether the printer is as new.
    pub fn is_none(&self) -> bool {
        self.registration == 0.0 && self.feed == 0.0 && self.missing == 0.0
    }

    fn moved(&self, pass: usize, ink: Ink) -> Moved {
        let deviate = |which: u64| normal(nth(self.seed, pass as u64), which);
        let rms = self.registration * DOTS_PER_MM;
        Moved {
            ink,
            right: (rms * deviate(0)).round() as i64,
            down: rms * deviate(1),
            feed: (self.feed * deviate(2)).clamp(-0.5, 0.5),
        }
    }

    /// Prints dots on such a printer.
    ///
    /// # Errors
    /// Stacks that need more passes than a sheet takes.
    pub fn print(&self, dots: &DotMap) -> Result<Worn, SeparateError> {
        let census = dots.census();
        let used: Vec<usize> = (0..census.len()).filter(|&q| census[q] > 0).collect();
        let stacks: Vec<Stack> = used.iter().map(|&q| dots.stacks()[q].clone()).collect();
        let (inks, bits) = passes(&stacks);
        if inks.len() > MOST_PASSES {
            return Err(SeparateError::Passes { passes: inks.len(), inks });
        }
        let mut passes_of = [0u16; 256];
        used.iter().zip(bits).for_each(|(&q, bits)| passes_of[q] = bits);
        let moved: Vec<Moved> = inks.iter().enumerate().map(|(pass, &ink)| self.moved(pass, ink)).collect();
        let width = dots.width();
        let mut masks = vec![0u16; dots.index().len()];
        masks.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for (pass, moved) in moved.iter().enumerate() {
                self.lay(dots, &passes_of, pass, moved, y, row);
            }
        });
        let (stacks, number, merged) = numbered(&masks, &inks);
        let index: Vec<u8> = masks.par_iter().map(|&mask| number[usize::from(mask)]).collect();
        let planned = census.iter().sum::<u64>() - census.first().copied().unwrap_or(0);
        let changed =
            dots.index().par_iter().zip(&masks).filter(|(dot, mask)| passes_of[usize::from(**dot)] != **mask);
        let changed = changed.count() as u64;
        let dots = DotMap::new(width, dots.length(), stacks, index)?;
        Ok(Worn { dots, passes: moved, changed, planned, merged })
    }

    /// Lays a pass on a row of dots.
    fn lay(
        &self,
        dots: &DotMap,
        passes_of: &[u16; 256],
        pass: usize,
        moved: &Moved,
        y: usize,
        row: &mut [u16],
    ) {
        // A row of the pass lands `down` lower and is stretched from the top.
        let from = ((y as f64 - moved.down) / (1.0 + moved.feed)).round();
        if !(from >= 0.0 && from < dots.length() as f64) {
            return;
        }
        let start = from as usize * dots.width();
        let source = &dots.index()[start..start + dots.width()];
        let shift = moved.right.unsigned_abs() as usize;
        let (skipped, left) = if moved.right >= 0 { (0, shift) } else { (shift, 0) };
        // So many dots of each row are missing as have a number below this.
        let least = (self.missing * (1u64 << 53) as f64) as u64;
        let seed = nth(self.seed ^ 0x6d69_7373_696e_6721, pass as u64);
        let landed = source.iter().enumerate().skip(skipped);
        for (out, (x, &dot)) in row.iter_mut().skip(left).zip(landed) {
            let has = passes_of[usize::from(dot)] >> pass & 1;
            if has == 1 && (least == 0 || nth(seed, (start + x) as u64) >> 11 >= least) {
                *out |= 1 << pass;
            }
        }
    }
}

/// The stacks that masks of passes are, a number for each mask, and how many dots have a stack that is not theirs.
fn numbered(masks: &[u16], inks: &[Ink]) -> (Vec<Stack>, Vec<u8>, u64) {
    let count = |mut counts: Vec<u64>, masks: &[u16]| {
        masks.iter().for_each(|&mask| counts[usize::from(mask)] += 1);
        counts
    };
    let empty = || vec![0u64; 1 << inks.len()];
    let counts = masks.par_chunks(1 << 20).fold(empty, count).reduce(empty, |mut a, b| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    });
    let stack = |mask: usize| {
        let layers = inks.iter().enumerate().filter(|(pass, _)| mask >> pass & 1 == 1);
        Stack::new(layers.map(|(_, &ink)| ink).collect::<Vec<_>>())
    };
    let mut found: Vec<usize> = (1..counts.len()).filter(|&mask| counts[mask] > 0).collect();
    found.sort_by_key(|&mask| (std::cmp::Reverse(counts[mask]), mask));
    let mut stacks = vec![Stack::SUBSTRATE];
    let mut known: HashMap<Stack, u8> = HashMap::from([(Stack::SUBSTRATE, 0)]);
    let mut number = vec![0u8; counts.len()];
    let (mut kept, mut rare) = (vec![0], Vec::new());
    for mask in found {
        let stack = stack(mask);
        match known.get(&stack) {
            Some(&same) => number[mask] = same,
            None if stacks.len() < MOST_STACKS => {
                number[mask] = stacks.len() as u8;
                known.insert(stack.clone(), number[mask]);
                stacks.push(stack);
            }
            None => {
                rare.push(mask);
                continue;
            }
        }
        kept.push(mask);
    }
    // The most frequent of those that differ in the fewest layers: they come in this order.
    for &mask in &rare {
        let nearest = kept.iter().min_by_key(|&&other| (mask ^ other).count_ones());
        number[mask] = nearest.map_or(0, |&other| number[other]);
    }
    (stacks, number, rare.iter().map(|&mask| counts[mask]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stacks(names: &[&str]) -> Vec<Stack> {
        names.iter().map(|name| name.parse().unwrap()).collect()
    }

    /// Independent dots: stack `i` with these probabilities, bare paper for the rest.
    fn noise(side: usize, names: &[&str], shares: &[f64]) -> DotMap {
        let dot = |i: usize| {
            let mut left = uniform(77, i as u64);
            for (stack, share) in shares.iter().enumerate() {
                if left <= *share {
                    return stack as u8 + 1;
                }
                left -= share;
            }
            0
        };
        DotMap::new(side, side, stacks(names), (0..side * side).map(dot).collect()).unwrap()
    }

    fn share(worn: &Worn, stack: &str) -> f64 {
        let stack: Stack = stack.parse().unwrap();
        let at = worn.dots.stacks().iter().position(|s| *s == stack);
        at.map_or(0.0, |at| worn.dots.census()[at] as f64 / worn.dots.index().len() as f64)
    }

    /// Five standard deviations of a share of so many independent dots.
    fn bound(p: f64, dots: f64) -> f64 {
        5.0 * (p * (1.0 - p) / dots).sqrt()
    }

    proptest! {
        #[test]
        fn a_new_printer_changes_nothing(index in prop::collection::vec(0u8..4, 6 * 5), seed in any::<u64>()) {
            let names = stacks(&["substrate", "MS+C", "C+MS", "K"]);
            let dots = DotMap::new(6, 5, names, index).unwrap();
            let worn = Wear { seed, ..Wear::default() }.print(&dots).unwrap();
            let named = |dots: &DotMap| dots.index().iter().map(|&q| dots.stacks()[usize::from(q)].clone()).collect::<Vec<_>>();
            prop_assert_eq!(named(&worn.dots), named(&dots));
            prop_assert_eq!((worn.changed, worn.merged), (0, 0));
        }

        /// Every ink of every dot, found the other way round: from where it was meant to where it lands.
        #[test]
        fn inks_land_where_their_pass_puts_them(index in prop::collection::vec(0u8..4, 40 * 30), seed in any::<u64>()) {
            let dots = DotMap::new(40, 30, stacks(&["substrate", "MS+C", "C", "MS+C+M"]), index).unwrap();
            let worn = Wear { registration: 0.1, seed, ..Wear::default() }.print(&dots).unwrap();
            let mut layers = vec![Vec::new(); 40 * 30];
            for moved in &worn.passes {
                for (i, &dot) in dots.index().iter().enumerate() {
                    let (x, y) = ((i % 40) as i64 + moved.right, (i / 40) as i64 + moved.down.round() as i64);
                    let has = dots.stacks()[usize::from(dot)].layers().contains(&moved.ink);
                    if has && (0..40).contains(&x) && (0..30).contains(&y) {
                        layers[(y * 40 + x) as usize].push(moved.ink);
                    }
                }
            }
            for (i, layers) in layers.into_iter().enumerate() {
                let found = &worn.dots.stacks()[usize::from(worn.dots.index()[i])];
                prop_assert_eq!(found.layers(), layers, "dot {}", i);
            }
        }
    }

    /// Dots beside dots become independent once passes are shifted against each other: the areas are Demichel's products.
    #[test]
    fn shifted_passes_cover_what_demichel_says() {
        let (c, m, side) = (0.4, 0.35, 1000);
        let dots = noise(side, &["substrate", "C", "M"], &[c, m]);
        let worn = Wear { registration: 0.2, seed: 4, ..Wear::default() }.print(&dots).unwrap();
        let [first, second] = worn.passes[..] else { panic!("{:?}", worn.passes) };
        assert!(
            (first.right, first.down.round()) != (second.right, second.down.round()),
            "{:?}",
            worn.passes
        );
        let [top, bottom] = [second.ink, first.ink].map(|ink| Stack::new(vec![ink]).to_string());
        // At most this share of the sheet is left bare at its edges.
        let edge =
            worn.passes.iter().map(|p| p.right.abs() as f64 + p.down.abs() + 1.0).sum::<f64>() / side as f64;
        let area = |name: &str| if name == "C" { c } else { m };
        for (found, expected) in [
            (share(&worn, &format!("{bottom}+{top}")), area(&bottom) * area(&top)),
            (share(&worn, &bottom), area(&bottom) * (1.0 - area(&top))),
            (share(&worn, &top), area(&top) * (1.0 - area(&bottom))),
            (share(&worn, "substrate"), (1.0 - c) * (1.0 - m)),
        ] {
            assert!(
                (found - expected).abs() < bound(expected, 1e6) + edge * expected,
                "{found}, not {expected}"
            );
        }
        // The order of passes decides: never the other way round.
        assert_eq!(share(&worn, &format!("{top}+{bottom}")), 0.0);
        assert_eq!(share(&Wear::default().print(&dots).unwrap(), &format!("{bottom}+{top}")), 0.0);
    }

    /// Missing dots of two passes: binomial, independent, and the layer above falls to the one below.
    #[test]
    fn as_many_dots_are_missing_as_asked() {
        let side = 600;
        let names = ["substrate", "MS+C"];
        let dots = DotMap::new(side, side, stacks(&names), vec![1; side * side]).unwrap();
        let n = (side * side) as f64;
        for missing in [0.001, 0.05, 0.5] {
            let worn = Wear { missing, seed: 9, ..Wear::default() }.print(&dots).unwrap();
            let kept = 1.0 - missing;
            for (stack, expected) in [
                ("MS+C", kept * kept),
                ("MS", kept * missing),
                ("C", kept * missing),
                ("substrate", missing * missing),
            ] {
                let found = share(&worn, stack);
                assert!(
                    (found - expected).abs() <= bound(expected, n) + 1.0 / n,
                    "{stack}: {found}, not {expected}"
                );
            }
            assert!((worn.changed as f64 - n * (1.0 - share(&worn, "MS+C"))).abs() < 0.5);
            let other = Wear { missing, seed: 10, ..Wear::default() }.print(&dots).unwrap();
            assert_ne!(other.dots, worn.dots);
        }
        let none = Wear { missing: 1.0, ..Wear::default() }.print(&dots).unwrap();
        assert_eq!(share(&none, "substrate"), 1.0);
    }

    /// Mean square of 4000 shifts against the normal distribution: its variance is 2 / n.
    #[test]
    fn shifts_have_the_root_mean_square_asked_for() {
        let n = 4000;
        let of = |which: fn(&Moved) -> f64| {
            let square = |seed| {
                which(&Wear { registration: 0.5, feed: 0.001, missing: 0.0, seed }.moved(3, Ink::Cyan))
                    .powi(2)
            };
            (0..n).map(square).sum::<f64>() / f64::from(n as u32)
        };
        let dots = (0.5 * DOTS_PER_MM).powi(2);
        // Rounding to whole dots adds a twelfth.
        for (found, expected) in [
            (of(|m| m.right as f64), dots + 1.0 / 12.0),
            (of(|m| m.down), dots),
            (of(|m| 1000.0 * m.feed), 1.0),
        ] {
            assert!(
                (found / expected - 1.0).abs() < 5.0 * (2.0 / f64::from(n as u32)).sqrt(),
                "{found}, not {expected}"
            );
        }
    }

    /// Bands that begin every 50 rows: a pass that is fed too far has them every 50 (1 + feed).
    #[test]
    fn a_pass_fed_too_far_is_stretched() {
        let (width, length) = (4, 2000);
        let index = (0..width * length).map(|i| u8::from(i / width % 50 < 25)).collect();
        let dots = DotMap::new(width, length, stacks(&["substrate", "K"]), index).unwrap();
        let feeds = (1..5).map(|seed| {
            let worn = Wear { feed: 0.01, seed, ..Wear::default() }.print(&dots).unwrap();
            let feed = worn.passes[0].feed;
            for band in 1..(length as f64 / (1.0 + feed.abs()) / 50.0) as usize {
                let begins = (50.0 * band as f64 * (1.0 + feed)).round() as usize;
                let inked = |y: usize| worn.dots.index()[y * width] == 1;
                assert!(!inked(begins - 2) && inked(begins + 1), "band {band} of feed {feed}");
            }
            feed
        });
        let feeds: Vec<f64> = feeds.collect();
        assert!(feeds.iter().any(|f| *f > 2e-3) && feeds.iter().any(|f| *f < -2e-3), "{feeds:?}");
    }

    /// Nine inks on every dot, half of them missing: 512 stacks, of which 256 can be told apart.
    #[test]
    fn of_too_many_stacks_the_rarest_are_shown_as_their_neighbours() {
        let all = "K+C+M+Y+MS+MC+MM+P+F";
        let dots = DotMap::new(400, 400, stacks(&["substrate", all]), vec![1; 160_000]).unwrap();
        let worn = Wear { missing: 0.5, seed: 1, ..Wear::default() }.print(&dots).unwrap();
        assert_eq!(worn.dots.stacks().len(), 256);
        let share = worn.merged as f64 / 160_000.0;
        assert!((0.4..0.55).contains(&share), "{share}");
        // A neighbour lacks or has one ink more, so the mean number of layers stays.
        let layers = worn.dots.index().iter().map(|&q| worn.dots.stacks()[usize::from(q)].layers().len());
        let mean = layers.sum::<usize>() as f64 / 160_000.0;
        assert!((mean - 4.5).abs() < 0.1, "{mean}");
    }

    #[test]
    fn more_passes_than_a_sheet_takes_are_refused() {
        let (cyan_first, black_first) = (["C+K"; 8].join("+"), ["K+C"; 8].join("+"));
        let dots = DotMap::new(2, 1, stacks(&["substrate", &cyan_first, &black_first]), vec![1, 2]).unwrap();
        assert!(matches!(Wear::default().print(&dots), Err(SeparateError::Passes { passes: 17, .. })));
    }
}
