//! Error carried along in pictures: what a dot prints too much or too little of each stack, the dots after
//! it make good.
//!
//! Problem: a table knows nothing of what it did beside a dot, so a photograph is three times farther from
//! what was asked, for the eye, than its stacks allow. Error diffusion of colours is near, but its dots lie
//! alone, and the printer loses these.
//! Method: shares are carried, not colours. Every stack of a dot's mixture is owed its share and what is
//! left from before; the dot is the stack that is owed most, where one that the dot before or above has
//! counts as owed [`Rules::hold`] more (output feedback: R. Levien), and the table's threshold is noise
//! that favours dark or pale stacks. A stack outside the mixture is taken only when it is owed more than a
//! dot. Rows run to and fro, with the weights of Floyd and Steinberg. Error goes from one dot of a picture
//! to another and nowhere else: text and drawings are as they would be alone, and what lies elsewhere
//! changes nothing in a picture. Strips begin [`EARLY`] rows early with no error, so that their border is
//! no seam.
//! Cost: 15 ns a dot. Limits: `N` stacks.
//! Source: R. Floyd, L. Steinberg, An adaptive algorithm for spatial greyscale (1976); R. Levien, Output
//! dependent feedback in error diffusion halftoning (1993).

use super::Known;
use super::mixtures::{Mixtures, Rules, Stops};
use crate::colour::packed::{DRAWN, Key, colour};
use appearance::weights::ONE;
use halftone::green_noise::SIDE;

/// Rows above a strip whose dots are chosen only for their error. Source: a test compares the rows at
/// borders with others.
pub(super) const EARLY: usize = 16;

/// A dot in the unit of errors: errors of two dots, which are the most, fit in 16 bits seven times.
const DOT: i16 = 4096;
/// Stops in that unit.
const SHIFT: u32 = (ONE as u32 / DOT as u32).trailing_zeros();
/// The most that is owed or given in advance.
const MOST: i16 = 2 * DOT;
/// What a stack outside the mixture must be owed to be taken: more than a dot, so that none is added to
/// what is even.
const STRANGE: i16 = DOT + DOT / 5;
/// No stack.
const NONE: usize = usize::MAX;

/// Dots in that unit.
fn in_units(of: f64) -> i16 {
    (of * f64::from(DOT)).round() as i16
}

/// The rows of a strip on their way down.
pub(super) struct Diffusion<const N: usize> {
    /// Half of what a neighbour holds, and the noise.
    hold: i16,
    noise: i32,
    /// What is owed in this row and in the next, with a dot beyond each border.
    own: Vec<[i16; N]>,
    next: Vec<[i16; N]>,
    /// The stacks of the row above.
    above: Vec<usize>,
}

/// Whether a dot carries errors: of a picture, and not of a colour that is a stack.
#[inline(always)]
pub(super) fn is_carrying(key: Key, is_named: impl Fn([u8; 3]) -> bool) -> bool {
    key & DRAWN == 0 && !is_named(colour(key))
}

impl<const N: usize> Diffusion<N> {
    pub fn new(width: usize, rules: Rules) -> Diffusion<N> {
        Diffusion {
            hold: in_units(rules.hold / 2.0),
            noise: in_units(rules.noise).into(),
            own: vec![[0; N]; width + 2],
            next: vec![[0; N]; width + 2],
            above: vec![NONE; width],
        }
    }

    /// A row without any dot that carries errors.
    pub fn rest(&mut self) {
        self.own.fill([0; N]);
        self.above.fill(NONE);
    }

    /// The dots of row `y` of the page that carry errors; others are left as they are. `out` is `None`
    /// where only the errors matter.
    #[inline(always)]
    pub fn row(
        &mut self,
        y: usize,
        keys: &[Key],
        known: &mut Known<'_, N>,
        thresholds: &[u16],
        mut out: Option<&mut [u8]>,
    ) {
        let Diffusion { hold, noise, own, next, above } = self;
        let width = keys.len();
        next.fill([0; N]);
        let (mut ahead, mut before) = ([0i16; N], NONE);
        let mixtures = known.mixtures;
        let mut at = (Key::MAX, [0; N]);
        for step in 0..width {
            let x = if y.is_multiple_of(2) { step } else { width - 1 - step };
            let key = keys[x];
            if !is_carrying(key, |colour| mixtures.is_named(colour)) {
                (ahead, before, above[x]) = ([0; N], NONE, NONE);
                continue;
            }
            if key != at.0 {
                at = (key, known.stops(key));
            }
            let mut owed = own[x + 1];
            owed.iter_mut().zip(ahead).for_each(|(owed, ahead)| *owed += ahead);
            let chosen = choose(&at.1, &mut owed, (*hold, before, above[x]), (*noise, thresholds[x % SIDE]));
            if let Some(out) = &mut out {
                out[x] = mixtures.order[chosen];
            }
            (before, above[x]) = (chosen, chosen);
            // In sixteenths: seven ahead, three, five and one below; what rounding leaves goes with the last.
            let (behind, forth) = if y.is_multiple_of(2) { (x, x + 2) } else { (x + 2, x) };
            let parts = owed.map(|owed| owed >> 4);
            ahead = parts.map(|part| 7 * part);
            next[behind].iter_mut().zip(parts).for_each(|(to, part)| *to += 3 * part);
            next[x + 1].iter_mut().zip(parts).for_each(|(to, part)| *to += 5 * part);
            let rest = next[forth].iter_mut().zip(owed.iter().zip(parts));
            rest.for_each(|(to, (owed, part))| *to += owed - 15 * part);
        }
        std::mem::swap(own, next);
    }
}

/// The stack of a dot, and what is owed after it.
#[inline(always)]
fn choose<const N: usize>(
    stops: &Stops<N>,
    owed: &mut [i16; N],
    (hold, before, above): (i16, usize, usize),
    (noise, threshold): (i32, u16),
) -> usize {
    let mut ends = [0i16; N];
    ends.iter_mut().zip(stops).for_each(|(end, stop)| *end = (stop >> SHIFT) as i16);
    let mut starts = [0i16; N];
    starts[1..].copy_from_slice(&ends[..N - 1]);
    // From the darkest to the palest stack of the mixture, as far as the threshold lies from its middle.
    let favour = noise * (i32::from(DOT) / 2 - i32::from(threshold >> SHIFT)) / i32::from(DOT);
    let mut scores = [i16::MIN; N];
    for q in 0..N {
        let share = ends[q] - starts[q];
        owed[q] += share;
        let middle = i32::from(DOT) - i32::from(starts[q]) - i32::from(ends[q]);
        let score = owed[q] + ((favour * middle) >> DOT.trailing_zeros()) as i16;
        let is_wanted = share > 0 || owed[q] >= STRANGE;
        scores[q] = if is_wanted { score } else { i16::MIN };
    }
    // Below no picture nothing is owed yet. A tint begins by the table, and what is rare in it is owed as
    // much more than the rest as it is where the tint goes on: what holds the others back.
    if above == NONE {
        let parts = (0..N).filter(|&q| ends[q] > starts[q]).count() as i32;
        for q in (0..N).filter(|&q| ends[q] > starts[q]) {
            let rare = i32::from(DOT) / parts - i32::from(ends[q] - starts[q]);
            owed[q] += ((2 * i32::from(hold) * rare) >> DOT.trailing_zeros()) as i16;
        }
        scores = [i16::MIN; N];
        scores[Mixtures::pick(stops, threshold)] = 0;
    }
    for neighbour in [before, above].into_iter().filter(|_| above != NONE) {
        if let Some(score) = scores.get_mut(neighbour).filter(|score| **score > i16::MIN) {
            *score += hold;
        }
    }
    let most = scores.iter().fold(i16::MIN, |most, &score| most.max(score));
    let chosen = scores.iter().position(|&score| score == most).unwrap_or(0);
    owed[chosen] -= DOT;
    owed.iter_mut().for_each(|owed| *owed = (*owed).clamp(-MOST, MOST));
    chosen
}
