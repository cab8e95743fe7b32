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
//! All stacks are weighed at once, sixteen in a vector.
//! Cost: 40 ns a dot, and 20 ns for its mixture. Limits: sixteen stacks for each vector.
//! Source: R. Floyd, L. Steinberg, An adaptive algorithm for spatial greyscale (1976); R. Levien, Output
//! dependent feedback in error diffusion halftoning (1993).

use super::Known;
use super::mixtures::{Mixtures, Rules, Stops};
use crate::colour::packed::{DRAWN, Key, colour};
use appearance::weights::ONE;
use halftone::green_noise::SIDE;
use wide::i16x16;

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
const NONE: i16 = i16::MIN;

/// What each stack has.
type Lanes<const L: usize> = [i16x16; L];

/// Stacks in a vector.
const LANES: usize = i16x16::LANES as usize;

fn lanes<const L: usize>(of: impl Fn(usize) -> i16) -> Lanes<L> {
    std::array::from_fn(|l| i16x16::new(std::array::from_fn(|q| of(LANES * l + q))))
}

/// Dots in that unit.
fn in_units(of: f64) -> i16 {
    (of * f64::from(DOT)).round() as i16
}

/// The rows of a strip on their way down, of `L` vectors of stacks.
pub(super) struct Diffusion<const L: usize> {
    /// Half of what a neighbour holds, and the noise.
    hold: i16,
    noise: i32,
    /// What is owed in this row and in the next, with a dot beyond each border.
    own: Vec<Lanes<L>>,
    next: Vec<Lanes<L>>,
    /// The stacks of the row above.
    above: Vec<i16>,
}

/// Whether a dot carries errors: of a picture, and not of a colour that is a stack.
#[inline(always)]
pub(super) fn is_carrying(key: Key, is_named: impl Fn([u8; 3]) -> bool) -> bool {
    key & DRAWN == 0 && !is_named(colour(key))
}

impl<const L: usize> Diffusion<L> {
    const NOTHING: Lanes<L> = [i16x16::ZERO; L];

    pub fn new(width: usize, rules: Rules) -> Diffusion<L> {
        Diffusion {
            hold: in_units(rules.hold / 2.0),
            noise: in_units(rules.noise).into(),
            own: vec![Self::NOTHING; width + 2],
            next: vec![Self::NOTHING; width + 2],
            above: vec![NONE; width],
        }
    }

    /// A row without any dot that carries errors.
    pub fn rest(&mut self) {
        self.own.fill(Self::NOTHING);
        self.above.fill(NONE);
    }

    /// The dots of row `y` of the page that carry errors; others are left as they are. `out` is `None`
    /// where only the errors matter.
    #[inline(always)]
    pub fn row<const N: usize>(
        &mut self,
        y: usize,
        keys: &[Key],
        known: &mut Known<'_, N>,
        thresholds: &[u16],
        mut out: Option<&mut [u8]>,
    ) {
        let Diffusion { hold, noise, own, next, above } = self;
        let width = keys.len();
        next.fill(Self::NOTHING);
        let (mut ahead, mut before) = (Self::NOTHING, NONE);
        let mixtures = known.mixtures;
        let mut at = (Key::MAX, [0; N]);
        for step in 0..width {
            let x = if y.is_multiple_of(2) { step } else { width - 1 - step };
            let key = keys[x];
            if !is_carrying(key, |colour| mixtures.is_named(colour)) {
                (ahead, before, above[x]) = (Self::NOTHING, NONE, NONE);
                continue;
            }
            if key != at.0 {
                at = (key, known.stops(key));
            }
            let mut owed: Lanes<L> = std::array::from_fn(|l| own[x + 1][l] + ahead[l]);
            let chosen = choose(&at.1, &mut owed, (*hold, before, above[x]), (*noise, thresholds[x % SIDE]));
            if let Some(out) = &mut out {
                out[x] = mixtures.order[chosen as usize];
            }
            (before, above[x]) = (chosen, chosen);
            // In sixteenths: seven ahead, three, five and one below; what rounding leaves goes with the last.
            let (behind, forth) = if y.is_multiple_of(2) { (x, x + 2) } else { (x + 2, x) };
            for l in 0..L {
                let part = owed[l] >> 4;
                ahead[l] = part * 7i16;
                next[behind][l] += part * 3i16;
                next[x + 1][l] += part * 5i16;
                next[forth][l] += part + (owed[l] & i16x16::splat(15));
            }
        }
        std::mem::swap(own, next);
    }
}

/// The stack of a dot, and what is owed after it.
#[inline(always)]
fn choose<const N: usize, const L: usize>(
    stops: &Stops<N>,
    owed: &mut Lanes<L>,
    (hold, before, above): (i16, i16, i16),
    (noise, threshold): (i32, u16),
) -> i16 {
    const { assert!(N == LANES * L) };
    let ends = stops.map(|stop| (stop >> SHIFT) as i16);
    let mut starts = [0i16; N];
    starts[1..].copy_from_slice(&ends[..N - 1]);
    let (ends, starts): (Lanes<L>, Lanes<L>) = (lanes(|q| ends[q]), lanes(|q| starts[q]));
    let share: Lanes<L> = std::array::from_fn(|l| ends[l] - starts[l]);
    owed.iter_mut().zip(share).for_each(|(owed, share)| *owed += share);
    let numbers = lanes::<L>(|q| q as i16);
    let is = |l: usize, stack: i16| numbers[l].simd_eq(i16x16::splat(stack));
    let chosen = if above == NONE {
        begin(&share, owed, hold);
        Mixtures::pick(stops, threshold) as i16
    } else {
        // From the darkest to the palest stack of the mixture, as far as the threshold lies from its middle;
        // times sixteen, so that the upper half of its products are dots.
        let off = i32::from(DOT) / 2 - i32::from(threshold >> SHIFT);
        let favour = i16x16::splat((16 * (noise * off / i32::from(DOT))) as i16);
        let hold = i16x16::splat(hold);
        let scores: Lanes<L> = std::array::from_fn(|l| {
            let middle = i16x16::splat(DOT) - starts[l] - ends[l];
            let held = (is(l, before) & hold) + (is(l, above) & hold);
            let is_wanted = share[l].simd_gt(i16x16::ZERO) | owed[l].simd_gt(i16x16::splat(STRANGE - 1));
            is_wanted.select(owed[l] + favour.mul_keep_high(middle) + held, i16x16::splat(i16::MIN))
        });
        let most =
            i16x16::splat(scores[1..].iter().fold(scores[0], |most, &score| most.max(score)).reduce_max());
        let mut found = scores.iter().map(|score| score.simd_eq(most).to_bitmask()).enumerate();
        let (l, which) = found.find(|(_, which)| *which > 0).unwrap_or((0, 1));
        (LANES * l) as i16 + which.trailing_zeros() as i16
    };
    for (l, owed) in owed.iter_mut().enumerate() {
        let left = *owed - (is(l, chosen) & i16x16::splat(DOT));
        *owed = left.max(i16x16::splat(-MOST)).min(i16x16::splat(MOST));
    }
    chosen
}

/// What is owed where nothing is yet, below no picture: a tint begins by the table, and what is rare in it
/// is owed as much more than the rest as it is where the tint goes on, which is what holds the others back.
#[cold]
fn begin<const L: usize>(share: &Lanes<L>, owed: &mut Lanes<L>, hold: i16) {
    let share = share.map(i16x16::to_array);
    let parts = share.as_flattened().iter().filter(|share| **share > 0).count() as i32;
    for (owed, share) in owed.iter_mut().zip(share) {
        let rare = |share: i16| i32::from(DOT) / parts - i32::from(share);
        let more = |share| (2 * i32::from(hold) * rare(share)) >> DOT.trailing_zeros();
        *owed += i16x16::new(share.map(|share| if share > 0 { more(share) as i16 } else { 0 }));
    }
}
