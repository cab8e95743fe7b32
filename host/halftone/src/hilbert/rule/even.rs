//! The rule where all stacks have the same minimum cluster, as in most documents.
//!
//! Problem: with several windows, stretches are kept between their ends, tables have any length, and each decision begins with
//! a choice of the horizon. All that takes longer than the decisions.
//! Method: with one window, only the stretch at its end is needed. Demands, ends and weights are arrays of fixed length. What
//! one decision writes is read as a vector by the next, so it is written as a vector. This serves the part of a walk where
//! everything fits; its beginning, its last two minimum clusters and the debts of absent stacks are left to the
//! general rule, which finds the state that it would have left itself.
//! Cost: half of the general rule for eight stacks. Limits: [`MOST`] groups of stacks.

use super::{LANES, Lanes, NEVER, Rule, Sink, Source, UNIT};

/// The most groups of stacks.
const MOST: usize = 8;

/// The state of the rule for `B` groups of stacks.
struct Even<const B: usize> {
    demand: [Lanes; B],
    /// End of the last stretch with weight.
    seen: [Lanes; B],
    /// The stretch at the end of the window.
    weights: [Lanes; B],
    /// Its number of dots, and how many of them are beyond the window.
    dots: u32,
    beyond: u32,
    /// End of the window.
    front: u32,
}

/// An array of the groups there are, and of empty ones.
#[inline(always)]
fn filled<const B: usize>(from: &[Lanes]) -> [Lanes; B] {
    std::array::from_fn(|b| from.get(b).copied().unwrap_or_default())
}

/// A number for each lane.
#[inline(always)]
fn each<const B: usize>(of: impl Fn(usize, usize) -> i32) -> [Lanes; B] {
    let mut lanes = [Lanes::default(); B];
    for (b, lanes) in lanes.iter_mut().enumerate() {
        for l in 0..LANES {
            lanes.0[l] = of(b, l);
        }
    }
    lanes
}

#[inline(always)]
fn get<const B: usize>(lanes: &[Lanes; B], k: usize) -> i32 {
    lanes[k / LANES % B].0[k % LANES]
}

#[inline(always)]
fn largest<const B: usize>(lanes: &[Lanes; B]) -> i32 {
    let mut eight = [NEVER; LANES];
    for lanes in lanes {
        eight.iter_mut().zip(lanes.0).for_each(|(most, lane)| *most = lane.max(*most));
    }
    // In halves, as vectors do it: one lane after the other takes twice as long.
    let four: [i32; 4] = std::array::from_fn(|l| eight[l].max(eight[l + 4]));
    let two: [i32; 2] = std::array::from_fn(|l| four[l].max(four[l + 2]));
    two[0].max(two[1])
}

/// A bit for each lane with this number.
#[inline(always)]
fn equal<const B: usize>(lanes: &[Lanes; B], number: i32) -> u64 {
    let mut bits = 0;
    for (b, lanes) in lanes.iter().enumerate() {
        let mut eight = 0;
        for l in 0..LANES {
            eight |= u32::from(lanes.0[l] == number) << l;
        }
        bits |= u64::from(eight) << (LANES * b);
    }
    bits
}

impl<const B: usize> Even<B> {
    /// Advances the end of the window within its stretch.
    #[inline(always)]
    fn advance(&mut self, dots: u32) {
        super::add(&mut self.demand, &self.weights, dots as i32);
        self.front += dots;
        self.beyond -= dots;
    }

    /// Takes dots printed of a stack from its demand.
    #[inline(always)]
    fn print(&mut self, stack: usize, dots: u32) {
        let printed = (dots as i32).wrapping_mul(UNIT);
        let own: [Lanes; B] = each(|b, l| if (b * LANES + l) as i32 == stack as i32 { printed } else { 0 });
        super::add(&mut self.demand, &own, -1);
    }
}

impl Rule {
    /// Walks on while two minimum clusters are left and no debt has to be set aside. There is one window, which is full, and
    /// `current` is the last stack. Returns where the walk is, and the stack there.
    #[inline(always)]
    pub(super) fn walk_evenly<S: Source, K: Sink>(
        &mut self,
        at: u32,
        current: usize,
        source: &mut S,
        sink: &mut K,
    ) -> (u32, usize) {
        match self.live.len() {
            1 => self.walk_groups::<1, S, K>(at, current, source, sink),
            2 => self.walk_groups::<2, S, K>(at, current, source, sink),
            3..=4 => self.walk_groups::<4, S, K>(at, current, source, sink),
            5..=MOST => self.walk_groups::<MOST, S, K>(at, current, source, sink),
            _ => (at, current),
        }
    }

    /// The same for up to `B` groups of stacks.
    #[inline(always)]
    fn walk_groups<const B: usize, S: Source, K: Sink>(
        &mut self,
        mut at: u32,
        mut current: usize,
        source: &mut S,
        sink: &mut K,
    ) -> (u32, usize) {
        let (class, groups) = (&self.classes[0], self.live.len());
        let minimum = class.min_cluster;
        let (Some(stretch), Some(last)) = (self.ahead.held.back(), self.dots.checked_sub(2 * minimum)) else {
            return (at, current);
        };
        let mut even = Even::<B> {
            demand: filled(&self.demand),
            seen: filled(&self.seen),
            weights: filled(&stretch.weights),
            dots: stretch.dots,
            beyond: stretch.dots - class.used,
            front: class.front,
        };
        let mut live: [Lanes; B] = filled(&self.live);
        let stop = self.next_check.min(last + 1);
        while at < stop {
            let asked: [Lanes; B] =
                each(|b, l| if even.seen[b].0[l] > at as i32 { even.demand[b].0[l] } else { NEVER });
            let most = largest(&asked);
            let best = equal(&asked, most);
            let run = if best >> current & 1 == 1 {
                let others: [Lanes; B] =
                    each(|b, l| if (b * LANES + l) as i32 == current as i32 { NEVER } else { asked[b].0[l] });
                let gap = most.saturating_sub(largest(&others)) as u32;
                // As in `Rule::stay`: beyond this stretch there may be new candidates.
                let mut run = (self.next_check - at).min(even.beyond);
                let weight = get(&even.weights, current);
                if weight == 0 {
                    run = run.min((get(&even.seen, current) as u32).saturating_sub(at));
                }
                if weight < UNIT && run > 1 {
                    run = run.min(gap / (2 * (UNIT - weight)) as u32);
                }
                run.max(1)
            } else {
                current = best.trailing_zeros() as usize % (B * LANES);
                minimum
            };
            let mut dots = run.min(self.dots - even.front);
            while dots > even.beyond {
                dots -= even.beyond;
                even.advance(even.beyond);
                even.dots = self.read(source, &mut even.weights[..groups]);
                even.beyond = even.dots;
                let end = self.known as i32;
                even.seen = each(|b, l| if even.weights[b].0[l] > 0 { end } else { even.seen[b].0[l] });
                let back: [Lanes; B] = each(|b, l| i32::from(even.weights[b].0[l] > 0) & !live[b].0[l]);
                if largest(&back) > 0 {
                    self.demand.copy_from_slice(&even.demand[..groups]);
                    self.unpark(&even.weights[..groups]);
                    (even.demand, live) = (filled(&self.demand), filled(&self.live));
                }
            }
            even.advance(dots);
            even.print(current, run);
            sink.run(current, run);
            at += run;
        }
        self.demand.copy_from_slice(&even.demand[..groups]);
        // The only window has entered every stretch that was fetched.
        self.seen.copy_from_slice(&even.seen[..groups]);
        self.last.copy_from_slice(&even.seen[..groups]);
        if let Some(stretch) = self.ahead.held.back_mut() {
            stretch.weights.copy_from_slice(&even.weights[..groups]);
            stretch.dots = even.dots;
        }
        let class = &mut self.classes[0];
        (class.front, class.used) = (even.front, even.dots - even.beyond);
        class.end = even.front + even.beyond;
        class.until = class.end;
        (at, current)
    }
}
