//! What comes over the border of a tone, and stays inside it.
//!
//! Problem: error diffusion has nothing to begin with in the first cells of a tone, and nowhere to leave what the last ones owe.
//! Method: in the midst of a tone rare stacks are owed something on average and common ones have had too much ([`Usual`]).
//! Beyond the border cells would owe that too: it comes in where a tone begins and is forgotten where it ends, and only
//! what differs from it stays inside. So a tone neither begins too light nor ends in a line of what was left over.
//! Where stacks are not equally far apart, the means come from the metric ([`Lean`]). At the page's own border nothing is
//! assumed: rows above the first and cells beyond the ends of rows are diffused and thrown away, and what is owed below the last
//! row is let go ([`super::error_diffusion`]).
//! Cost: a few operations a stack, and a system of four unknowns, for cells beside a border. Limits: cells that may be cut into
//! halves are taken to be among stacks that are equally far apart.

use super::choose::{Metric, NOISE};
use crate::dbs::Point;
use inks::linalg::Cholesky;

/// The largest difference of a debt above the first row of a tone, in cells, for a stack of share p: times root of p (1 - p).
const SPREAD: f32 = 1.25;

/// Adds to a slot what comes over the border of the tone: the part `missing` of what cells there would owe, were they alike.
/// Where rows of cells begin, with a `lot`, debts differ from cell to cell as they do in the midst of a tone, or the
/// first rows would print all at once: a stack drawn by lot is owed more or less, and the commonest less or more.
pub(super) fn begin(slots: &mut [f32], want: &[f32], missing: f32, usual: &Usual, lot: Option<u32>) {
    for (q, (slot, &want)) in slots.iter_mut().zip(want).enumerate() {
        *slot += missing * usual.of(q, want);
    }
    let Some(lot) = lot else { return };
    let most = want.iter().copied().fold(0.0, f32::max);
    let common = want.iter().position(|&want| want == most).unwrap_or(0);
    let rare = |q: &usize| *q != common && want[*q] > 0.0;
    let count = (0..slots.len()).filter(rare).count();
    let Some(drawn) = (0..slots.len()).filter(rare).nth(lot as usize % count.max(1)) else { return };
    let quantum = if usual.halved(drawn) { usual.half } else { 2.0 * usual.half };
    let share = want[drawn] % quantum / quantum;
    let noise = NOISE[(lot >> 16) as usize % NOISE.len()];
    let differs = SPREAD * quantum * noise * (share * (1.0 - share)).sqrt();
    slots[drawn] += differs;
    slots[common] -= differs;
}

/// The mean debts of stacks in the midst of a flat tone: a part of what each has less than its equal share. Stacks that may
/// have halves of a cell count as one beside stacks that may not, and owe alike. Where all may, half of each
/// cell goes to a stack that asks for as much, and the equal share is that of the rest. Fitted to mixtures of 2 to 10 stacks
/// of 0.5 to 96 %, within 0.05 of a cell, and to mixtures of 2 to 6 stacks in cells that may be cut, within 0.06.
pub(super) struct Usual<'a> {
    part: f32,
    equal: f32,
    /// Half of the area.
    half: f32,
    /// 0 for each stack that may have half a cell; nothing where cells are not cut.
    small: &'a [f32],
    /// What each of these owes because of the others.
    together: f32,
    /// The part and the equal share among these.
    rest: Option<(f32, f32)>,
    lean: Option<Lean<'a>>,
}

/// The part of its debt where all decisions are equal that a stack owes on average, for what that is beyond its equal share.
const LEAN: f32 = 0.65;

/// The most that a stack is taken to owe because of what others reflect, in cells.
const MOST: f32 = 2.0;

/// How debts differ from those among stacks that are equally far apart.
///
/// Decisions are fastest to change where the choice of each stack would leave equally long debts. With the products P of
/// the stacks, the debts D before the choice and the area A that is where P D - A diag(P) / 2 is the same for all stacks: the
/// centre of the sphere through all of them. Debts vary about a point between that and nothing. P is a multiple
/// of 1 and four coordinates, so four unknowns tell the centre, however many stacks there are.
struct Lean<'a> {
    metric: &'a Metric,
    /// The mean of the stacks present, and where the centre is seen from there.
    mean: Point,
    centre: [f64; 4],
    /// Mean square of the distance from the mean.
    square: f64,
    /// Half of the area.
    half: f64,
    part: f64,
}

impl<'a> Lean<'a> {
    /// Nothing where two stacks or less are present, or all are equally far apart.
    fn new(metric: &'a Metric, want: &[f32], area: f32) -> Option<Lean<'a>> {
        let here = || (0..want.len()).filter(|&q| want[q] > 0.0);
        let count = here().count();
        if count < 3 || metric.is_even() {
            return None;
        }
        let mut mean = [0.0; 4];
        for q in here() {
            let point = metric.point(q as u8);
            (0..4).for_each(|c| mean[c] += point[c] / count as f32);
        }
        let half = 0.5 * f64::from(area);
        let mut lean = Lean { metric, mean, centre: [0.0; 4], square: 0.0, half, part: f64::from(LEAN) };
        let (mut system, mut right) = ([0.0; 16], [0.0; 4]);
        for c in 0..4 {
            system[5 * c] = f64::from(metric.own());
        }
        for q in here() {
            let (from_mean, square) = lean.beside_mean(q);
            lean.square += square / count as f64;
            for c in 0..4 {
                right[c] += half * square * from_mean[c];
                (0..4).for_each(|d| system[4 * c + d] += from_mean[c] * from_mean[d]);
            }
        }
        lean.centre.copy_from_slice(&Cholesky::new(&system, 4)?.solve(&right));
        let most = here().map(|q| lean.of(q).abs()).fold(0.0, f32::max) / area;
        lean.part *= f64::from((MOST / most.max(MOST)).min(1.0));
        Some(lean)
    }

    fn beside_mean(&self, q: usize) -> ([f64; 4], f64) {
        let point = self.metric.point(q as u8);
        let from_mean: [f64; 4] = std::array::from_fn(|c| f64::from(point[c] - self.mean[c]));
        (from_mean, from_mean.iter().map(|from| from * from).sum())
    }

    /// What stack `q` owes more than it would among stacks equally far apart.
    fn of(&self, q: usize) -> f32 {
        let (from_mean, square) = self.beside_mean(q);
        let along: f64 = from_mean.iter().zip(&self.centre).map(|(from, centre)| from * centre).sum();
        (self.part * (self.half * (square - self.square) - along) / f64::from(self.metric.own())) as f32
    }
}

impl<'a> Usual<'a> {
    /// Of a tone of which a cell of `area` dots asks for so much of each stack. `small` is 0 for stacks that may have half of a
    /// cell, and empty where cells are whole.
    /// Without a metric, or where cells may be cut, all stacks are taken to be equally far apart.
    pub(super) fn new(metric: Option<&'a Metric>, want: &[f32], area: usize, small: &'a [f32]) -> Usual<'a> {
        let area = area as f32;
        let half = 0.5 * area;
        let part_of = |most: f32, area: f32| 0.45 + 0.8 * (most / area - 0.8).max(0.0);
        let (mut whole, mut most) = (0, 0.0f32);
        let (mut halved, mut sum, mut largest) = (0, 0.0, 0.0f32);
        for (q, &want) in want.iter().enumerate().filter(|(_, want)| **want > 0.0) {
            if small.get(q) == Some(&0.0) {
                (halved, sum, largest) = (halved + 1, sum + want, largest.max(want));
            } else {
                (whole, most) = (whole + 1, most.max(want));
            }
        }
        let present = whole + halved.min(1);
        let (part, equal) = (part_of(most.max(sum), area), area / present.max(1) as f32);
        let together = part * (equal - sum) / halved.max(1) as f32;
        let rest = (whole == 0 && halved > 1).then(|| {
            let left = |want: f32| if want >= half { want - half } else { want };
            let (mut sum, mut most) = (0.0, 0.0f32);
            for &want in want.iter().filter(|&&want| want > 0.0) {
                (sum, most) = (sum + left(want), most.max(left(want)));
            }
            // Near a half it is a matter of chance which stack has too little.
            let clear = (16.0 * (largest / area - 0.5).abs()).min(1.0);
            (clear * part_of(most, half).min(0.61), sum / halved as f32)
        });
        let lean = metric.filter(|_| halved == 0).and_then(|metric| Lean::new(metric, want, area));
        Usual { part, equal, half, small, together, rest, lean }
    }

    /// Whether a stack may have half of a cell.
    fn halved(&self, q: usize) -> bool {
        self.small.get(q) == Some(&0.0)
    }

    /// What stack `q` owes, of which the cell asks for `want`.
    pub(super) fn of(&self, q: usize, want: f32) -> f32 {
        if want <= 0.0 {
            return 0.0;
        }
        if !self.halved(q) {
            return self.part * (self.equal - want) + self.lean.as_ref().map_or(0.0, |lean| lean.of(q));
        }
        let left = if want >= self.half { want - self.half } else { want };
        self.together + self.rest.map_or(0.0, |(part, equal)| part * (equal - left))
    }
}
