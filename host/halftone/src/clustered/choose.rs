//! Which stack a cell prints, or which two.
//!
//! Problem: of what a cell asks for and is owed, one stack or two are all it can print, and stacks that look alike may stand
//! in for each other from cell to cell, but not for good.
//! Method: the cell prints what leaves the shortest vector of debts, where lengths are measured by what stacks reflect
//! ([`Metric`]) and, less, by stacks for themselves. That is the stack with the largest debt if all are equally far apart.
//! Where halves hold, it is compared with the best half and the best other half after it.
//! Near a quarter, a third and above all a half tones lock into patterns, so the decision is disturbed, the more the nearer
//! two stacks are to sharing the cell.
//! Limits: without reflectance all stacks are equally far apart; with it one metric is that of the whole page.
//! Cost: some two dozen operations a stack and cell. Memory: the product of each two stacks.

use super::cell::{Cell, fits_half};
use super::field::LANES;
use crate::dbs::Point;
use appearance::weights::ONE;

/// What a stack's own debt weighs, against the mean square of the distance of stacks from the mean of the page: with less, tones
/// are no longer kept; with more, the dots look less even.
const OWN: f32 = 1.3;

/// By how much the decision of a cell is disturbed, in cells, for the second largest share in it, linear in between: where
/// there are two stacks, and where others share the cell, which break most patterns themselves.
const DISTURBED: [(f32, f32, f32); 6] = [
    (0.2, 0.04, 0.04),
    (0.25, 0.13, 0.04),
    (0.3, 0.13, 0.05),
    (0.33, 0.13, 0.12),
    (0.43, 0.14, 0.12),
    (0.48, 0.28, 0.12),
];

/// The same where one stack has half of the cell, which makes a checkerboard of it whatever the others are.
const HALF: f32 = 0.16;

/// The least of these where cells may be cut and a second stack has a tenth of them or more.
const CUT: f32 = 0.2;

/// The largest share of a stack in cells that lock.
const LOCKED: f32 = 0.55;

/// By how much a weight differs over a block whose cells, if they may be cut, need hardly any disturbance.
const TEXTURED: f32 = 0.06 * ONE as f32;

/// Numbers in -1..1 without order, of mean 0: 256 beginnings, and as many stacks from there.
pub(super) static NOISE: [f32; 512] = {
    let (mut noise, mut state, mut i) = ([0.0; 512], 1u32, 0);
    while i < 256 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        noise[i] = (state >> 8) as f32 / 8_388_608.0 - 1.0;
        noise[i + 256] = -noise[i];
        i += 1;
    }
    noise
};

/// How far stacks are apart: scalar products of the stacks of a field.
pub(crate) struct Metric {
    /// Each coordinate of the stacks and padding, from the mean of the page; 0 where all stacks are equally far apart.
    coordinates: [Vec<f32>; 4],
    /// What a stack's own debt weighs.
    own: f32,
    /// The products of each stack with all others, a row each.
    products: Vec<f32>,
    /// The product of each stack with itself.
    squares: Vec<f32>,
}

impl Metric {
    /// For so many stacks and padding, of which the mean page has these shares. Without points all stacks are equally far
    /// apart.
    pub(crate) fn new(lanes: usize, shares: &[f32], points: Option<&[Point]>) -> Metric {
        let mut coordinates: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; lanes]);
        let mut own = 0.0;
        if let Some(points) = points {
            let mean: Point = std::array::from_fn(|c| {
                shares.iter().zip(points).map(|(share, point)| share * point[c]).sum()
            });
            for (q, (share, point)) in shares.iter().zip(points).enumerate() {
                for c in 0..4 {
                    let from_mean = point[c] - mean[c];
                    coordinates[c][q] = from_mean;
                    own += OWN * share * from_mean * from_mean;
                }
            }
        }
        if own < f32::MIN_POSITIVE {
            own = 1.0;
            coordinates.iter_mut().for_each(|coordinate| coordinate.fill(0.0));
        }
        let product = |a: usize, b: usize| {
            let sum: f32 = coordinates.iter().map(|coordinate| coordinate[a] * coordinate[b]).sum();
            if a == b { sum + own } else { sum }
        };
        let products = (0..lanes * lanes).map(|at| product(at / lanes, at % lanes)).collect();
        let squares = (0..lanes).map(|q| product(q, q)).collect();
        Metric { coordinates, own, products, squares }
    }

    /// The product of a vector of debts with each coordinate.
    #[inline(always)]
    pub(super) fn seen(&self, debts: &[f32]) -> Point {
        let along = |coordinate: &[f32]| {
            let mut sums = [0.0f32; LANES];
            for (line, debts) in coordinate.as_chunks::<LANES>().0.iter().zip(debts.as_chunks::<LANES>().0) {
                for l in 0..LANES {
                    sums[l] += line[l] * debts[l];
                }
            }
            sums.iter().sum()
        };
        let [a, b, c, d] = &self.coordinates;
        [along(a), along(b), along(c), along(d)]
    }

    /// Whether all stacks are equally far apart.
    pub(super) fn is_even(&self) -> bool {
        self.coordinates.iter().all(|coordinate| coordinate.iter().all(|&at| at == 0.0))
    }

    /// What a stack's own debt weighs.
    pub(super) fn own(&self) -> f32 {
        self.own
    }

    /// Where a stack lies from the mean of the page.
    #[inline(always)]
    pub(super) fn point(&self, stack: u8) -> Point {
        std::array::from_fn(|c| self.coordinates[c][usize::from(stack)])
    }

    /// The product of a vector of debts, of which this is seen, with each stack: into `out`.
    #[inline(always)]
    fn products(&self, debts: &[f32], seen: Point, out: &mut [f32]) {
        let [a, b, c, d] = &self.coordinates;
        let coordinates = a.iter().zip(b).zip(c.iter().zip(d));
        for ((out, debt), ((a, b), (c, d))) in out.iter_mut().zip(debts).zip(coordinates) {
            *out = self.own * debt + seen[0] * a + seen[1] * b + seen[2] * c + seen[3] * d;
        }
    }

    fn row(&self, stack: u8) -> &[f32] {
        let lanes = self.squares.len();
        &self.products[usize::from(stack) * lanes..][..lanes]
    }
}

/// Decides for one cell after another.
pub(super) struct Chooser<'a> {
    pub(super) metric: &'a Metric,
    /// By side of cells, 0 for stacks that half a cell holds and minus infinity for others; nothing where there are none.
    small: Vec<Vec<f32>>,
    /// The product of a vector of debts with each stack.
    products: Vec<f32>,
    /// What each stack gains.
    gains: Vec<f32>,
}

impl<'a> Chooser<'a> {
    /// For stacks with these minimum clusters, and cells up to this side.
    pub(super) fn new(metric: &'a Metric, minimum: &[u16], largest: usize) -> Chooser<'a> {
        let lanes = metric.squares.len();
        let small = |size: usize| {
            let bar = |q: usize| minimum.get(q).is_some_and(|&minimum| fits_half(minimum, size));
            let bars: Vec<f32> = (0..lanes).map(|q| if bar(q) { 0.0 } else { f32::NEG_INFINITY }).collect();
            if bars.contains(&0.0) { bars } else { Vec::new() }
        };
        Chooser {
            metric,
            small: (0..=largest).map(small).collect(),
            products: vec![0.0; lanes],
            gains: vec![0.0; lanes],
        }
    }

    /// Whether cells of this side may be cut into halves.
    pub(super) fn cuts(&self, side: usize) -> bool {
        !self.small[side].is_empty()
    }

    /// 0 for each stack that may have half of a cell of this side; nothing where such cells are not cut.
    pub(super) fn small(&self, side: usize) -> &[f32] {
        &self.small[side]
    }

    /// What `area` dots print that ask for `want` and owe `debts`. With a side they are a whole cell, which may be cut into
    /// halves: which way, and which half comes first, says `turn`.
    #[inline(always)]
    pub(super) fn choose(
        &mut self,
        want: &[f32],
        debts: &[f32],
        area: f32,
        side: Option<usize>,
        turn: u32,
    ) -> Cell {
        let Chooser { metric, small, products, gains } = self;
        metric.products(debts, metric.seen(debts), products);
        let stacks = products.iter().zip(&metric.squares).zip(want);
        for (gain, ((product, square), &want)) in gains.iter_mut().zip(stacks) {
            let gained = product - 0.5 * area * square;
            *gain = if want > 0.0 { gained } else { f32::NEG_INFINITY };
        }
        let (whole, gained) = largest(gains);
        let small = match side {
            Some(side) if !small[side].is_empty() => &small[side],
            _ => return Cell::whole(whole),
        };
        let stacks = products.iter_mut().zip(&metric.squares).zip(small).zip(want);
        for (gain, (((product, square), bar), &want)) in gains.iter_mut().zip(stacks) {
            let gained = *product - 0.25 * area * square + bar;
            *product = gained;
            *gain = if want > 0.0 { gained } else { f32::NEG_INFINITY };
        }
        let (first, one) = largest(gains);
        let stacks = products.iter().zip(metric.row(first)).zip(want);
        for (gain, ((product, with), &want)) in gains.iter_mut().zip(stacks) {
            let gained = product - 0.5 * area * with;
            *gain = if want > 0.0 { gained } else { f32::NEG_INFINITY };
        }
        let (second, other) = largest(gains);
        if 0.5 * (one + other) <= gained {
            return Cell::whole(whole);
        }
        let halves = if turn & 2 == 0 { [first, second] } else { [second, first] };
        Cell { halves, stacked: turn & 1 == 1 }
    }
}

/// The stack with the largest gain, the lowest among equals, and that gain.
#[inline(always)]
fn largest(gains: &[f32]) -> (u8, f32) {
    let mut most = [f32::NEG_INFINITY; LANES];
    for gains in gains.as_chunks::<LANES>().0 {
        for l in 0..LANES {
            most[l] = if gains[l] > most[l] { gains[l] } else { most[l] };
        }
    }
    let most = most.into_iter().fold(f32::NEG_INFINITY, f32::max);
    (gains.iter().position(|&gain| gain == most).unwrap_or_default() as u8, most)
}

/// Whether two stacks ask for about half of a cell each, and hardly any other for some: where all cells are cut into the same halves,
/// halves arranged by their neighbours would be columns and rows.
pub(super) fn halves_lock(want: &[f32]) -> bool {
    let (mut first, mut second) = (0.0f32, 0.0f32);
    for &want in want {
        (first, second) = if want > first { (want, first) } else { (first, second.max(want)) };
    }
    let all: f32 = want.iter().sum();
    first < LOCKED * all && first + second > 2.0 * (1.0 - LOCKED) * all
}

/// Whether a document varies by itself where a weight differs by so much over a block.
pub(super) fn textured(varies: u16) -> bool {
    f32::from(varies) >= TEXTURED
}

/// By how much to disturb the decision of a cell that asks for `want`, in cells: [`DISTURBED`]. Where it may be `cut` and the
/// document varies by itself nothing locks, and hardly any disturbance is needed.
pub(super) fn disturbing(want: &[f32], cut: bool, varies: u16) -> f32 {
    let flat = if cut { (1.0 - f32::from(varies) / TEXTURED).max(0.05) } else { 1.0 };
    let (mut first, mut second) = ([0.0f32; LANES], [0.0f32; LANES]);
    for want in want.as_chunks::<LANES>().0 {
        for l in 0..LANES {
            let lower = if want[l] < first[l] { want[l] } else { first[l] };
            second[l] = if lower > second[l] { lower } else { second[l] };
            first[l] = if want[l] > first[l] { want[l] } else { first[l] };
        }
    }
    let (first, second) = first.into_iter().chain(second).fold((0.0f32, 0.0f32), |(first, second), want| {
        if want > first { (want, first) } else { (first, second.max(want)) }
    });
    let all: f32 = want.iter().sum();
    let alone = (1.0 - 4.0 * (all - first - second) / all).max(0.0);
    let share = second / all;
    let half = HALF * (1.0 - 20.0 * (first / all - 0.5).abs()).max(0.0);
    let half = if cut { half.max(CUT * (10.0 * share).min(1.0)) } else { half };
    let between = |&(_, two, more): &(f32, f32, f32)| more + alone * (two - more);
    let mut below = &DISTURBED[0];
    for above in &DISTURBED {
        if share < above.0 {
            let part = (share - below.0).max(0.0) / (above.0 - below.0).max(f32::MIN_POSITIVE);
            return flat * half.max(between(below) + part * (between(above) - between(below)));
        }
        below = above;
    }
    flat * half.max(between(below))
}
