//! The next stack along the walk: multi-channel error diffusion with a minimum cluster.
//!
//! Problem: at each dot the weights ask for fractions of several stacks, but exactly one stack is printed, in runs no
//! shorter than its minimum cluster.
//!
//! The rule. Each stack q has a debt e_q, the dots asked for minus the dots printed. A stack is a candidate at position i of
//! n if it has weight within its own next minimum cluster, so that a debt from elsewhere never prints as a stray dot; its
//! minimum cluster must also fit before the end, unless it is the current stack. The horizon m is the largest minimum
//! cluster of the candidates, at most n - i. The lookahead demand of q is its debt plus the weights ahead,
//! `demand_q = e_q + (weights of q over the next m dots)`. Printing k costs
//! `cost(k) = max(|demand_k - m|, max over q != k of |demand_q|)`. The cheapest candidate is taken; ties go to the smaller
//! sum of squares, then to the current stack, then to the lower index. If it is the current stack, one more dot is
//! printed, otherwise its own minimum cluster. With the same minimum cluster for all stacks, this is the rule of the paper.
//!
//! One horizon serves all stacks, because costs over horizons of different lengths cannot be compared. The longer horizon
//! asks for more, so two stacks of a large minimum cluster with equal debts would wait forever behind any of a smaller one.
//!
//! Theorem. The cheapest candidate is the one with the largest demand; ties go to the current stack and then to the
//! lower index. Proof: let `demand_j > demand_k`. The two costs share all terms but two: cost(j) has |demand_j - m| and
//! |demand_k|, cost(k) has |demand_k - m| and |demand_j|. |demand_k| is at most |demand_j| if demand_k is 0 or more,
//! otherwise at most |demand_k - m|; |demand_j - m| is less than |demand_k - m| if demand_j is m or less, otherwise at most
//! |demand_j|. So cost(j) <= cost(k), and the sums of squares differ by -2 m (demand_j - demand_k) < 0, which decides a tie
//! for j. Equal demands make both equal. Hence a decision is an argmax.
//!
//! Method: the rule keeps demands instead of debts, over the horizon of the last decision. Printing d dots adds d weights at
//! the far end of the window and subtracts d from the printed stack; a change of horizon adds or subtracts the weights
//! between the two ends. While the current stack stays, no gap to it shrinks by more than 2 (1 - w) a dot, where w is its
//! own weight at the far end. So one division gives the number of dots by which a run can safely continue. With one
//! minimum cluster for all stacks, `even` walks the same way with less to keep.
//!
//! Debts of absent stacks. A stack without weight for [`ABSENT`] dots is parked: its debt is set aside and shared equally
//! among the others, and taken back from them when it returns. Otherwise the stacks still present would owe the opposite
//! forever, and a newcomer would print a solid patch until it caught up.
//!
//! Cost: O(stacks / 8) instructions a decision, about one and a half decisions a run. Weights are integers that
//! sum to [`UNIT`], so the result is the same on every machine. Limits: debts are 32-bit in that unit, which is 8192 dots;
//! the tests see debts of a few minimum clusters.

use appearance::wide::wide;
use std::collections::VecDeque;

mod even;

/// One dot of full weight.
pub(super) const UNIT: i32 = 1 << 18;

/// Dots without weight after which a stack's debt is set aside.
pub(super) const ABSENT: u32 = 4096;

/// Stacks in one vector operation: eight numbers of 32 bits are a register of AVX2. Sums are equal on every
/// processor, since all use as many.
pub(super) const LANES: usize = 8;

/// One number for each of eight stacks.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
#[repr(align(32))]
pub(super) struct Lanes(pub [i32; LANES]);

/// Number of [`Lanes`] for a number of stacks.
pub(super) fn blocks(stacks: usize) -> usize {
    stacks.div_ceil(LANES).max(1)
}

fn get(lanes: &[Lanes], k: usize) -> i32 {
    lanes[k / LANES].0[k % LANES]
}

fn get_mut(lanes: &mut [Lanes], k: usize) -> &mut i32 {
    &mut lanes[k / LANES].0[k % LANES]
}

/// Adds the weights of a number of dots.
#[inline(always)]
fn add(demand: &mut [Lanes], weights: &[Lanes], dots: i32) {
    for (demand, weight) in demand.iter_mut().zip(weights) {
        for l in 0..LANES {
            demand.0[l] = demand.0[l].wrapping_add(weight.0[l].wrapping_mul(dots));
        }
    }
}

/// The source of weights, in stretches of constant weight.
pub(super) trait Source {
    /// Writes the weights of the next stretch and returns its number of dots, at least one; dots beyond the end of the walk do
    /// not count. Weights are 0 or more, sum to [`UNIT`], and are 0 in lanes without a stack. Called only while dots are left.
    fn stretch(&mut self, weights: &mut [Lanes]) -> u32;
}

/// The destination of runs.
pub(super) trait Sink {
    /// Takes the next run: `dots` dots of stack `k`.
    fn run(&mut self, k: usize, dots: u32);
}

#[derive(Default)]
struct Stretch {
    dots: u32,
    weights: Vec<Lanes>,
}

/// The stretches between the ends of the shortest and the longest window.
struct Ahead {
    first: usize,
    held: VecDeque<Stretch>,
    spare: Vec<Stretch>,
}

/// The stacks with one minimum cluster, and the window of that many dots.
#[derive(Default)]
struct Class {
    min_cluster: u32,
    /// -1 for each stack of this class.
    member: Vec<Lanes>,
    /// End of the last stretch reached by the window in which a stack of this class has weight.
    until: u32,
    /// End of the window.
    front: u32,
    /// The stretch at the end of the window, the end of that stretch, and its number of dots inside the window.
    stretch: usize,
    end: u32,
    used: u32,
}

/// The state of the rule on a part of the walk. See the module text.
pub(super) struct Rule {
    dots: u32,
    /// In order of minimum cluster, the smallest first.
    classes: Vec<Class>,
    class_of: Vec<usize>,
    /// Lookahead demands of the stacks over the window of class `horizon`.
    demand: Vec<Lanes>,
    horizon: usize,
    /// For each stack, the end of the last stretch with weight that the window of its class has reached.
    seen: Vec<Lanes>,
    lane: Vec<Lanes>,
    ahead: Ahead,
    /// -1 for stacks whose debts are part of the demands, and the number of stacks whose debts are not.
    live: Vec<Lanes>,
    away: usize,
    /// End of the last stretch with weight.
    last: Vec<Lanes>,
    /// Dots fetched from the source so far.
    known: u32,
    parked: Vec<i32>,
    absent: u32,
    next_check: u32,
}

/// Walks to the end with the widest vectors of this processor. The result does not depend on them.
pub(super) fn walk<S: Source, K: Sink>(rule: &mut Rule, source: &mut S, sink: &mut K) {
    wide(
        #[inline(always)]
        || rule.walk(source, sink),
    );
}

/// The best candidate.
#[derive(Clone, Copy)]
struct Candidate {
    stack: usize,
    /// Its demand minus that of the next best candidate.
    margin: i64,
}

const NEVER: i32 = i32::MIN;

impl Rule {
    /// For a walk of `dots` dots over stacks with these minimum clusters (1 or more). Debts are set aside after `absent`
    /// dots without weight.
    pub(super) fn new(min_clusters: &[u16], dots: u32, absent: u32) -> Rule {
        let n = blocks(min_clusters.len());
        let mut kinds: Vec<u32> = min_clusters.iter().map(|&m| u32::from(m.max(1))).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let class_of: Vec<usize> =
            min_clusters.iter().map(|&m| kinds.partition_point(|&kind| kind < u32::from(m.max(1)))).collect();
        let class = |(c, &kind): (usize, &u32)| {
            let mut member = vec![Lanes::default(); n];
            for (k, _) in class_of.iter().enumerate().filter(|(_, of)| **of == c) {
                *get_mut(&mut member, k) = -1;
            }
            Class { min_cluster: kind, member, until: 0, front: 0, stretch: 0, end: 0, used: 0 }
        };
        Rule {
            dots,
            classes: kinds.iter().enumerate().map(class).collect(),
            demand: vec![Lanes::default(); n],
            horizon: kinds.len().saturating_sub(1),
            seen: vec![Lanes::default(); n],
            lane: (0..n).map(|b| Lanes(std::array::from_fn(|l| (b * LANES + l) as i32))).collect(),
            ahead: Ahead { first: 0, held: VecDeque::new(), spare: Vec::new() },
            live: vec![Lanes::default(); n],
            away: min_clusters.len(),
            last: vec![Lanes::default(); n],
            known: 0,
            parked: vec![0; min_clusters.len()],
            absent,
            next_check: absent,
            class_of,
        }
    }

    /// Begins another walk of `dots` dots with the debts that the one before left.
    pub(super) fn resume(&mut self, dots: u32) {
        // At the end all windows are empty, so the demands are the debts.
        for class in &mut self.classes {
            *class = Class { until: 0, front: 0, stretch: 0, end: 0, used: 0, ..std::mem::take(class) };
        }
        self.horizon = self.classes.len().saturating_sub(1);
        self.seen.fill(Lanes::default());
        self.last.fill(Lanes::default());
        self.ahead.spare.extend(self.ahead.held.drain(..));
        (self.ahead.first, self.known, self.dots, self.next_check) = (0, 0, dots, self.absent);
    }

    /// Walks to the end.
    #[inline(always)]
    pub(super) fn walk<S: Source, K: Sink>(&mut self, source: &mut S, sink: &mut K) {
        for c in 0..self.classes.len() {
            let m = self.classes[c].min_cluster.min(self.dots);
            self.advance(c, m, source);
        }
        let (mut at, mut current) = (0u32, None);
        while at < self.dots {
            if let Some(stack) = current
                && self.classes.len() == 1
            {
                let (to, stack) = self.walk_evenly(at, stack, source, sink);
                (at, current) = (to, Some(stack));
                if at >= self.next_check {
                    self.park(at);
                }
                if at >= self.dots {
                    break;
                }
            }
            let (stack, run) = self.decide(at, current);
            for c in 0..self.classes.len() {
                self.advance(c, run, source);
            }
            let demand = get_mut(&mut self.demand, stack);
            *demand = demand.wrapping_sub((run as i32).wrapping_mul(UNIT));
            sink.run(stack, run);
            (at, current) = (at + run, Some(stack));
            if at >= self.next_check {
                self.park(at);
            }
        }
    }

    /// The next stack, and the length of its run.
    #[inline(always)]
    fn decide(&mut self, at: u32, current: Option<usize>) -> (usize, u32) {
        let left = self.dots - at;
        // Minimum clusters may not fit near the end, where each dot is decided separately.
        let largest = self.classes.last().map_or(1, |class| class.min_cluster);
        let end = left < 2 * largest;
        let fits = |class: &Class| class.min_cluster <= left && class.until > at;
        let top = match self.classes.iter().rposition(fits) {
            Some(top) => top,
            None => match current {
                Some(current) => return (current, left.min(1)),
                // Shorter than every minimum cluster with weight: one run of the stack with the largest demand.
                None => return (self.anyone(at), left),
            },
        };
        if top != self.horizon {
            self.set_horizon(top);
        }
        let best = if end { self.best_at_end(at, left, current) } else { self.best(at, current) };
        let Some(best) = best else { return (current.unwrap_or(0), left.min(1)) };
        if Some(best.stack) != current {
            return (best.stack, self.classes[self.class_of[best.stack]].min_cluster.min(left));
        }
        (best.stack, if end { 1 } else { self.stay(at, top, best) })
    }

    /// The number of dots for which the current stack, just found best over the horizon of class `top`, surely stays best.
    #[inline(always)]
    fn stay(&self, at: u32, top: usize, best: Candidate) -> u32 {
        // The dots at which debts are set aside must not depend on the length of the runs.
        let mut most = self.next_check.saturating_sub(at).max(1);
        let mut rate = 0;
        for (c, class) in self.classes.iter().enumerate() {
            // Beyond the end of the walk there are no weights and no new candidates.
            let (dots, weight) = match class.front < self.dots {
                true => {
                    let stretch = &self.ahead.held[class.stretch - self.ahead.first];
                    (stretch.dots - class.used, get(&stretch.weights, best.stack))
                }
                false => (1, 0),
            };
            // Beyond this stretch there may be new candidates and a larger horizon.
            most = most.min(dots);
            if c == top {
                rate = UNIT - weight;
                // Without candidates of this class the horizon changes.
                if class.until < class.front {
                    most = most.min(class.until - at);
                }
            }
            if weight == 0 && c == self.class_of[best.stack] {
                most = most.min((get(&self.seen, best.stack) as u32).saturating_sub(at));
            }
        }
        if rate > 0 && most > 1 {
            let gap = best.margin.max(0);
            most = most.min((gap / (2 * i64::from(rate))).min(i64::from(u32::MAX)) as u32);
        }
        most.max(1)
    }

    /// The candidate with the largest demand; ties go to the current stack, then to the lower index. All minimum clusters
    /// fit before the end.
    #[inline(always)]
    fn best(&self, at: u32, current: Option<usize>) -> Option<Candidate> {
        let (demand, now) = (&self.demand[..], at as i32);
        let mut most = Lanes([NEVER; LANES]);
        for (demand, seen) in demand.iter().zip(&self.seen) {
            for l in 0..LANES {
                most.0[l] = most.0[l].max(if seen.0[l] > now { demand.0[l] } else { NEVER });
            }
        }
        let most = most.0.into_iter().fold(NEVER, i32::max);
        if most == NEVER {
            return None;
        }
        if let Some(stack) = current
            && get(&self.seen, stack) > now
            && get(demand, stack) == most
        {
            let (mut second, own) = (Lanes([NEVER; LANES]), stack as i32);
            for ((demand, seen), lane) in demand.iter().zip(&self.seen).zip(&self.lane) {
                for l in 0..LANES {
                    let other = (seen.0[l] > now) & (lane.0[l] != own);
                    second.0[l] = second.0[l].max(if other { demand.0[l] } else { NEVER });
                }
            }
            let second = second.0.into_iter().fold(NEVER, i32::max);
            let margin = if second == NEVER { i64::MAX } else { i64::from(most) - i64::from(second) };
            return Some(Candidate { stack, margin });
        }
        for ((demand, seen), lane) in demand.iter().zip(&self.seen).zip(&self.lane) {
            let found: [bool; LANES] = std::array::from_fn(|l| (seen.0[l] > now) & (demand.0[l] == most));
            if let Some(l) = found.iter().position(|&found| found) {
                return Some(Candidate { stack: lane.0[l] as usize, margin: 0 });
            }
        }
        None
    }

    /// The same near the end, where a minimum cluster may not fit.
    #[cold]
    fn best_at_end(&self, at: u32, left: u32, current: Option<usize>) -> Option<Candidate> {
        let candidate = |k: &usize| {
            let fits = self.classes[self.class_of[*k]].min_cluster <= left;
            get(&self.seen, *k) > at as i32 && (fits || Some(*k) == current)
        };
        let order = |&k: &usize| (get(&self.demand, k), Some(k) == current, std::cmp::Reverse(k));
        let stack = (0..self.class_of.len()).filter(candidate).max_by_key(order)?;
        Some(Candidate { stack, margin: 0 })
    }

    /// The stack with the largest demand among all with weight, each over the window of its own class.
    #[cold]
    fn anyone(&mut self, at: u32) -> usize {
        let mut best: Option<(i32, usize)> = None;
        for c in 0..self.classes.len() {
            self.set_horizon(c);
            for k in (0..self.class_of.len()).filter(|&k| self.class_of[k] == c) {
                let demand = get(&self.demand, k);
                let better = best.is_none_or(|(most, first)| demand > most || (demand == most && k < first));
                if get(&self.seen, k) > at as i32 && better {
                    best = Some((demand, k));
                }
            }
        }
        best.map_or(0, |(_, k)| k)
    }

    /// Makes the window of class `c` the horizon: the demands gain or lose the weights between the two ends.
    #[inline(never)]
    fn set_horizon(&mut self, c: usize) {
        let (near, far) = (self.horizon.min(c), self.horizon.max(c));
        let sign = if c == far { 1 } else { -1 };
        let (from, to) = (&self.classes[near], &self.classes[far]);
        for s in from.stretch..=to.stretch {
            let Some(stretch) = self.ahead.held.get(s - self.ahead.first) else { break };
            let begin = if s == from.stretch { from.used } else { 0 };
            let end = if s == to.stretch { to.used } else { stretch.dots };
            add(&mut self.demand, &stretch.weights, sign * (end - begin) as i32);
        }
        self.horizon = c;
    }

    /// Advances the end of a class's window, to the end of the walk at most.
    #[inline(always)]
    fn advance<S: Source>(&mut self, c: usize, dots: u32, source: &mut S) {
        let mut dots = dots.min(self.dots - self.classes[c].front);
        while dots > 0 {
            if self.classes[c].front == self.classes[c].end {
                self.enter(c, source);
            }
            let class = &mut self.classes[c];
            let step = dots.min(class.end - class.front);
            (class.front, class.used, dots) = (class.front + step, class.used + step, dots - step);
            if c == self.horizon {
                let stretch = &self.ahead.held[class.stretch - self.ahead.first];
                add(&mut self.demand, &stretch.weights, step as i32);
            }
        }
    }

    /// Moves a class's window into the next stretch, and fetches the stretch if no other class has reached it.
    #[inline(always)]
    fn enter<S: Source>(&mut self, c: usize, source: &mut S) {
        let begun = self.classes[c].front > 0;
        self.classes[c].stretch += usize::from(begun);
        self.classes[c].used = 0;
        let nearest = self.classes.iter().map(|class| class.stretch).min().unwrap_or(0);
        while self.ahead.first < nearest && !self.ahead.held.is_empty() {
            self.ahead.spare.extend(self.ahead.held.pop_front());
            self.ahead.first += 1;
        }
        if self.classes[c].stretch - self.ahead.first == self.ahead.held.len() {
            self.fetch(source);
        }
        let class = &mut self.classes[c];
        let stretch = &self.ahead.held[class.stretch - self.ahead.first];
        class.end = class.front + stretch.dots;
        let (mut any, end) = (Lanes::default(), class.end as i32);
        for ((seen, member), weight) in self.seen.iter_mut().zip(&class.member).zip(&stretch.weights) {
            for l in 0..LANES {
                let own = weight.0[l] & member.0[l];
                any.0[l] |= own;
                seen.0[l] = if own > 0 { end } else { seen.0[l] };
            }
        }
        if any.0.into_iter().fold(0, |all, own| all | own) > 0 {
            class.until = class.end;
        }
    }

    /// Reads the next stretch, to the end of the walk at most: a source may go on behind it.
    #[inline(always)]
    fn read<S: Source>(&mut self, source: &mut S, weights: &mut [Lanes]) -> u32 {
        let dots = source.stretch(weights).min(self.dots - self.known).max(1);
        self.known += dots;
        dots
    }

    /// Fetches the next stretch.
    #[inline(always)]
    fn fetch<S: Source>(&mut self, source: &mut S) {
        let mut stretch = self.ahead.spare.pop().unwrap_or_default();
        stretch.weights.resize(self.live.len(), Lanes::default());
        stretch.dots = self.read(source, &mut stretch.weights);
        let end = self.known as i32;
        for (last, weight) in self.last.iter_mut().zip(&stretch.weights) {
            for l in 0..LANES {
                last.0[l] = if weight.0[l] > 0 { end } else { last.0[l] };
            }
        }
        if self.away > 0 {
            self.unpark(&stretch.weights);
        }
        self.ahead.held.push_back(stretch);
    }

    /// Returns their debts to parked stacks that have weight again.
    #[inline(never)]
    fn unpark(&mut self, weights: &[Lanes]) {
        for k in 0..self.parked.len() {
            if get(weights, k) > 0 && get(&self.live, k) == 0 {
                let debt = std::mem::take(&mut self.parked[k]);
                self.share(k, debt.wrapping_neg());
                *get_mut(&mut self.live, k) = -1;
                self.away -= 1;
            }
        }
    }

    /// Sets aside the debts of absent stacks.
    #[cold]
    fn park(&mut self, at: u32) {
        self.next_check = at.saturating_add(self.absent);
        for k in 0..self.parked.len() {
            let last = get(&self.last, k) as u32;
            if get(&self.live, k) != 0 && at.saturating_sub(last) >= self.absent {
                // Without weight in any window, the demand equals the debt.
                let debt = get(&self.demand, k);
                self.parked[k] = debt;
                *get_mut(&mut self.live, k) = 0;
                self.away += 1;
                self.share(k, debt);
            }
        }
    }

    /// Subtracts `debt` from stack `k` and adds it to the live stacks in equal parts; odd units go to the first.
    fn share(&mut self, k: usize, debt: i32) {
        let live: i32 = self.live.iter().flat_map(|b| b.0).map(|l| -l).sum();
        if debt == 0 || live == 0 {
            return;
        }
        let mut odd = debt % live;
        let own = get_mut(&mut self.demand, k);
        *own = own.wrapping_sub(debt);
        for other in 0..self.parked.len() {
            if get(&self.live, other) != 0 {
                let demand = get_mut(&mut self.demand, other);
                *demand = demand.wrapping_add(debt / live + std::mem::take(&mut odd));
            }
        }
    }
}

#[cfg(test)]
mod tests;
