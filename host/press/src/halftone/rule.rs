//! Which stack comes next along the walk: multi-channel error diffusion with a hard minimum cluster.
//!
//! Problem: at each dot the weights ask for shares of several stacks, and exactly one is printed, in runs no
//! shorter than the stack's minimum.
//!
//! The rule. Each stack q has a debt e_q, dots asked for minus dots printed. A stack is a candidate at position i of n
//! where it has weight within its own next minimum, so what is owed from elsewhere never comes out as a stray dot;
//! and only if its minimum still fits before the end, the current stack excepted. The horizon m is the largest
//! minimum of the candidates, n - i at most, and `look_q = e_q + (weights of q over the next m dots)`. Printing k costs
//! `cost(k) = max(|look_k - m|, max over q != k of |look_q|)`; the cheapest candidate is taken, ties go to the smaller
//! sum of squares, then to the current stack, then to the lower index. If it is the current stack one more dot is
//! printed, otherwise its own minimum. With one minimum for all this is the rule of the paper.
//!
//! One horizon for all, because costs over horizons of different length do not compare: the longer one asks for more,
//! so two stacks of a large minimum that are owed the same would wait for ever behind any of a smaller one.
//!
//! Theorem. The cheapest candidate is the one with the largest look, ties going to the current stack and then to the
//! lower index. Proof: let `look_j > look_k`. The two costs share all terms but two: cost(j) has |look_j - m| and
//! |look_k|, cost(k) has |look_k - m| and |look_j|. |look_k| is at most |look_j| if look_k is 0 or more, otherwise at
//! most |look_k - m|; |look_j - m| is less than |look_k - m| if look_j is m or less, otherwise at most |look_j|. So
//! cost(j) <= cost(k), and the sums of squares differ by -2 m (look_j - look_k) < 0, which decides a tie for j. Equal
//! looks make both equal. Hence a decision is an argmax.
//!
//! Method: looks are kept, not debts, over the horizon of the last decision: printing d dots adds d weights at the far
//! end of the window and takes d off the stack printed; another horizon adds or takes what lies between the two ends.
//! While the current stack stays, no gap to it shrinks by more than 2 (1 - w) a dot, w its own weight at the far end, so
//! runs go on many dots at a time with one division.
//!
//! Debts of the absent. A stack without weight for [`ABSENT`] dots is parked: its debt is set aside and handed in
//! equal parts to the others, and taken back from them when it returns. Otherwise the stacks still present would owe
//! the opposite for ever, and a newcomer would print a solid patch until it caught up.
//!
//! Cost: O(stacks / 8) instructions a decision, about one and a half decisions a run. Weights are integers that
//! sum to [`UNIT`], so the result is the same on every machine. Debts are 32-bit in that unit: 8192 dots, where
//! the tests see a few minima.

use std::collections::VecDeque;

/// One dot of full weight.
pub(super) const UNIT: i32 = 1 << 18;

/// After how many dots without weight a stack's debt is set aside.
pub(super) const ABSENT: u32 = 4096;

/// Stacks side by side in one vector operation.
pub(super) const LANES: usize = 8;

/// One number for each of eight stacks.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
#[repr(align(32))]
pub(super) struct Lanes(pub [i32; LANES]);

/// Number of [`Lanes`] for so many stacks.
pub(super) fn blocks(stacks: usize) -> usize {
    stacks.div_ceil(LANES).max(1)
}

fn get(lanes: &[Lanes], k: usize) -> i32 {
    lanes[k / LANES].0[k % LANES]
}

fn get_mut(lanes: &mut [Lanes], k: usize) -> &mut i32 {
    &mut lanes[k / LANES].0[k % LANES]
}

/// Adds so many dots of these weights.
#[inline(always)]
fn add(look: &mut [Lanes], weights: &[Lanes], dots: i32) {
    for (look, weight) in look.iter_mut().zip(weights) {
        for l in 0..LANES {
            look.0[l] = look.0[l].wrapping_add(weight.0[l].wrapping_mul(dots));
        }
    }
}

/// Where the weights come from, in stretches of constant weight.
pub(super) trait Source {
    /// Writes the weights of the next stretch, 0 or more each with sum [`UNIT`] and 0 in lanes without a stack, and says
    /// how many dots it has, at least one. Called only while dots are left.
    fn stretch(&mut self, weights: &mut [Lanes]) -> u32;
}

/// Where the runs go.
pub(super) trait Sink {
    /// The next `dots` dots are stack `k`.
    fn run(&mut self, k: usize, dots: u32);
}

#[derive(Default)]
struct Stretch {
    dots: u32,
    weights: Vec<Lanes>,
}

/// The stretches between the nearest and the farthest window's end.
struct Ahead {
    first: usize,
    held: VecDeque<Stretch>,
    spare: Vec<Stretch>,
}

/// Stacks of one minimum, and the window of that many dots.
struct Class {
    minimum: u32,
    /// -1 for the stacks of this class.
    member: Vec<Lanes>,
    /// End of the last stretch that the window has reached in which a stack of this class has weight.
    until: u32,
    /// End of the window.
    front: u32,
    /// Stretch at the end of the window, where it ends, and how many of its dots are in the window.
    stretch: usize,
    end: u32,
    used: u32,
}

/// The rule at work on one stretch of the walk. See the module text.
pub(super) struct Rule {
    dots: u32,
    /// By minimum, the smallest first.
    classes: Vec<Class>,
    class_of: Vec<usize>,
    /// What the stacks look like over the window of class `horizon`.
    look: Vec<Lanes>,
    horizon: usize,
    /// Of each stack the end of the last stretch with weight that its class's window has reached.
    seen: Vec<Lanes>,
    lane: Vec<Lanes>,
    ahead: Ahead,
    /// -1 for stacks whose debts are in the looks, and how many are not.
    live: Vec<Lanes>,
    away: usize,
    /// End of the last stretch with weight.
    last: Vec<Lanes>,
    /// Dots asked for so far.
    known: u32,
    parked: Vec<i32>,
    absent: u32,
    next_check: u32,
}

/// Walks to the end with the widest vectors the machine has; the result is the same with any.
pub(super) fn walk<S: Source, K: Sink>(rule: &mut Rule, source: &mut S, sink: &mut K) {
    #[cfg(target_arch = "x86_64")]
    {
        /// The same code, compiled for AVX2: integer operations only, so equal bit for bit.
        #[target_feature(enable = "avx2")]
        fn wide<S: Source, K: Sink>(rule: &mut Rule, source: &mut S, sink: &mut K) {
            rule.walk(source, sink);
        }
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "a call to code compiled for a processor feature")]
            // SAFETY: the only requirement of `wide` is that the processor has AVX2, just detected.
            unsafe {
                wide(rule, source, sink)
            };
            return;
        }
    }
    rule.walk(source, sink);
}

/// A class's best candidate.
#[derive(Clone, Copy)]
struct Candidate {
    stack: usize,
    /// How far its look is above that of the next best of the class.
    margin: i64,
}

const NEVER: i32 = i32::MIN;

impl Rule {
    /// For a walk of `dots` dots over stacks with these minima (1 or more); debts are set aside after `absent`.
    pub(super) fn new(minimum: &[u16], dots: u32, absent: u32) -> Rule {
        let n = blocks(minimum.len());
        let mut kinds: Vec<u32> = minimum.iter().map(|&m| u32::from(m.max(1))).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let class_of: Vec<usize> =
            minimum.iter().map(|&m| kinds.partition_point(|&kind| kind < u32::from(m.max(1)))).collect();
        let class = |(c, &kind): (usize, &u32)| {
            let mut member = vec![Lanes::default(); n];
            for (k, _) in class_of.iter().enumerate().filter(|(_, of)| **of == c) {
                *get_mut(&mut member, k) = -1;
            }
            Class { minimum: kind, member, until: 0, front: 0, stretch: 0, end: 0, used: 0 }
        };
        Rule {
            dots,
            classes: kinds.iter().enumerate().map(class).collect(),
            look: vec![Lanes::default(); n],
            horizon: kinds.len().saturating_sub(1),
            seen: vec![Lanes::default(); n],
            lane: (0..n).map(|b| Lanes(std::array::from_fn(|l| (b * LANES + l) as i32))).collect(),
            ahead: Ahead { first: 0, held: VecDeque::new(), spare: Vec::new() },
            live: vec![Lanes::default(); n],
            away: minimum.len(),
            last: vec![Lanes::default(); n],
            known: 0,
            parked: vec![0; minimum.len()],
            absent,
            next_check: absent,
            class_of,
        }
    }

    /// Walks to the end.
    #[inline(always)]
    pub(super) fn walk<S: Source, K: Sink>(&mut self, source: &mut S, sink: &mut K) {
        for c in 0..self.classes.len() {
            let m = self.classes[c].minimum.min(self.dots);
            self.look_on(c, m, source);
        }
        let (mut at, mut current) = (0u32, None);
        while at < self.dots {
            let (stack, run) = self.decide(at, current);
            if at + run < self.dots {
                for c in 0..self.classes.len() {
                    self.look_on(c, run, source);
                }
                let look = get_mut(&mut self.look, stack);
                *look = look.wrapping_sub((run as i32).wrapping_mul(UNIT));
            }
            sink.run(stack, run);
            (at, current) = (at + run, Some(stack));
            if at >= self.next_check {
                self.park(at);
            }
        }
    }

    /// The next stack and for how many dots.
    #[inline(always)]
    fn decide(&mut self, at: u32, current: Option<usize>) -> (usize, u32) {
        let left = self.dots - at;
        // Only at the very end do minima no longer fit; there every dot is decided by itself.
        let largest = self.classes.last().map_or(1, |class| class.minimum);
        let end = left < 2 * largest;
        let fits = |class: &Class| class.minimum <= left && class.until > at;
        let top = match self.classes.iter().rposition(fits) {
            Some(top) => top,
            None => match current {
                Some(current) => return (current, left.min(1)),
                // Shorter than every minimum that has weight: one run of what looks best over all of it.
                None => return (self.anyone(at), left),
            },
        };
        if top != self.horizon {
            self.look_over(top);
        }
        let best = if end { self.best_at_end(at, left, current) } else { self.best(at, current) };
        let Some(best) = best else { return (current.unwrap_or(0), left.min(1)) };
        if Some(best.stack) != current {
            return (best.stack, self.classes[self.class_of[best.stack]].minimum.min(left));
        }
        (best.stack, if end { 1 } else { self.stay(at, top, best) })
    }

    /// How many dots the current stack, just found best over the horizon of class `top`, certainly stays best.
    #[inline(always)]
    fn stay(&self, at: u32, top: usize, best: Candidate) -> u32 {
        // Debts are set aside at a dot that does not depend on how far the runs go at a time.
        let mut most = self.next_check.saturating_sub(at).max(1);
        let mut rate = 0;
        for (c, class) in self.classes.iter().enumerate() {
            // At the far end of the walk nothing is asked for any more, and nothing new comes.
            let (dots, weight) = match class.front < self.dots {
                true => {
                    let stretch = &self.ahead.held[class.stretch - self.ahead.first];
                    (stretch.dots - class.used, get(&stretch.weights, best.stack))
                }
                false => (1, 0),
            };
            // Beyond this stretch there may be new candidates, and a larger horizon.
            most = most.min(dots);
            if c == top {
                rate = UNIT - weight;
                // Without its candidates the horizon is another.
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

    /// The candidate with the largest look; ties go to the current stack, then to the lower index. All minima fit.
    #[inline(always)]
    fn best(&self, at: u32, current: Option<usize>) -> Option<Candidate> {
        let (look, now) = (&self.look[..], at as i32);
        let mut most = Lanes([NEVER; LANES]);
        for (look, seen) in look.iter().zip(&self.seen) {
            for l in 0..LANES {
                most.0[l] = most.0[l].max(if seen.0[l] > now { look.0[l] } else { NEVER });
            }
        }
        let most = most.0.into_iter().fold(NEVER, i32::max);
        if most == NEVER {
            return None;
        }
        if let Some(stack) = current
            && get(&self.seen, stack) > now
            && get(look, stack) == most
        {
            let (mut second, own) = (Lanes([NEVER; LANES]), stack as i32);
            for ((look, seen), lane) in look.iter().zip(&self.seen).zip(&self.lane) {
                for l in 0..LANES {
                    let other = (seen.0[l] > now) & (lane.0[l] != own);
                    second.0[l] = second.0[l].max(if other { look.0[l] } else { NEVER });
                }
            }
            let second = second.0.into_iter().fold(NEVER, i32::max);
            let margin = if second == NEVER { i64::MAX } else { i64::from(most) - i64::from(second) };
            return Some(Candidate { stack, margin });
        }
        for ((look, seen), lane) in look.iter().zip(&self.seen).zip(&self.lane) {
            let found: [bool; LANES] = std::array::from_fn(|l| (seen.0[l] > now) & (look.0[l] == most));
            if let Some(l) = found.iter().position(|&found| found) {
                return Some(Candidate { stack: lane.0[l] as usize, margin: 0 });
            }
        }
        None
    }

    /// As [`Rule::best`] where a minimum may not fit any more.
    #[cold]
    fn best_at_end(&self, at: u32, left: u32, current: Option<usize>) -> Option<Candidate> {
        let candidate = |k: &usize| {
            let fits = self.classes[self.class_of[*k]].minimum <= left;
            get(&self.seen, *k) > at as i32 && (fits || Some(*k) == current)
        };
        let order = |&k: &usize| (get(&self.look, k), Some(k) == current, std::cmp::Reverse(k));
        let stack = (0..self.class_of.len()).filter(candidate).max_by_key(order)?;
        Some(Candidate { stack, margin: 0 })
    }

    /// The largest look of all that have weight, whatever their minimum, each over its own.
    #[cold]
    fn anyone(&mut self, at: u32) -> usize {
        let mut best: Option<(i32, usize)> = None;
        for c in 0..self.classes.len() {
            self.look_over(c);
            for k in (0..self.class_of.len()).filter(|&k| self.class_of[k] == c) {
                let look = get(&self.look, k);
                let better = best.is_none_or(|(most, first)| look > most || (look == most && k < first));
                if get(&self.seen, k) > at as i32 && better {
                    best = Some((look, k));
                }
            }
        }
        best.map_or(0, |(_, k)| k)
    }

    /// Makes the window of class `c` the horizon: the looks gain or lose the weights between the two ends.
    #[inline(never)]
    fn look_over(&mut self, c: usize) {
        let (near, far) = (self.horizon.min(c), self.horizon.max(c));
        let sign = if c == far { 1 } else { -1 };
        let (from, to) = (&self.classes[near], &self.classes[far]);
        for s in from.stretch..=to.stretch {
            let Some(stretch) = self.ahead.held.get(s - self.ahead.first) else { break };
            let begin = if s == from.stretch { from.used } else { 0 };
            let end = if s == to.stretch { to.used } else { stretch.dots };
            add(&mut self.look, &stretch.weights, sign * (end - begin) as i32);
        }
        self.horizon = c;
    }

    /// Moves the end of a class's window on, to the end of the walk at most.
    #[inline(always)]
    fn look_on<S: Source>(&mut self, c: usize, dots: u32, source: &mut S) {
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
                add(&mut self.look, &stretch.weights, step as i32);
            }
        }
    }

    /// Lets a class's window enter the next stretch, asking for it if no other class has been there.
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
        class.end = class.front.saturating_add(stretch.dots).min(self.dots);
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

    /// Asks for the next stretch.
    #[inline(always)]
    fn fetch<S: Source>(&mut self, source: &mut S) {
        let mut stretch = self.ahead.spare.pop().unwrap_or_default();
        stretch.weights.resize(self.live.len(), Lanes::default());
        stretch.dots = source.stretch(&mut stretch.weights).max(1);
        self.known = self.known.saturating_add(stretch.dots);
        let end = self.known.min(self.dots) as i32;
        for (last, weight) in self.last.iter_mut().zip(&stretch.weights) {
            for l in 0..LANES {
                last.0[l] = if weight.0[l] > 0 { end } else { last.0[l] };
            }
        }
        if self.away > 0 {
            self.welcome(&stretch.weights);
        }
        self.ahead.held.push_back(stretch);
    }

    /// Gives stacks that come back their debts.
    #[inline(never)]
    fn welcome(&mut self, weights: &[Lanes]) {
        for k in 0..self.parked.len() {
            if get(weights, k) > 0 && get(&self.live, k) == 0 {
                let debt = std::mem::take(&mut self.parked[k]);
                self.share(k, debt.wrapping_neg());
                *get_mut(&mut self.live, k) = -1;
                self.away -= 1;
            }
        }
    }

    /// Sets the debts of the absent aside.
    #[cold]
    fn park(&mut self, at: u32) {
        self.next_check = at.saturating_add(self.absent);
        for k in 0..self.parked.len() {
            let last = get(&self.last, k) as u32;
            if get(&self.live, k) != 0 && at.saturating_sub(last) >= self.absent {
                // Without weight in any window the look is the bare debt.
                let debt = get(&self.look, k);
                self.parked[k] = debt;
                *get_mut(&mut self.live, k) = 0;
                self.away += 1;
                self.share(k, debt);
            }
        }
    }

    /// Takes `debt` off stack `k` and gives it to the live ones in equal parts, the odd units to the first.
    fn share(&mut self, k: usize, debt: i32) {
        let live: i32 = self.live.iter().flat_map(|b| b.0).map(|l| -l).sum();
        if debt == 0 || live == 0 {
            return;
        }
        let mut odd = debt % live;
        let own = get_mut(&mut self.look, k);
        *own = own.wrapping_sub(debt);
        for other in 0..self.parked.len() {
            if get(&self.live, other) != 0 {
                let look = get_mut(&mut self.look, other);
                *look = look.wrapping_add(debt / live + std::mem::take(&mut odd));
            }
        }
    }
}

#[cfg(test)]
mod tests;
