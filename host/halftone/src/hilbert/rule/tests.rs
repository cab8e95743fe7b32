//! The fast rule against the rule word for word, and what it promises of any document.

use super::*;
use proptest::prelude::*;

/// Weights in stretches, and the runs that came of them.
struct Tape<'a> {
    stretches: std::slice::Iter<'a, (u32, Vec<i32>)>,
}

impl Source for Tape<'_> {
    fn stretch(&mut self, weights: &mut [Lanes]) -> u32 {
        let (dots, row) = self.stretches.next().expect("asked for more than there is");
        weights.fill(Lanes::default());
        for (k, &w) in row.iter().enumerate() {
            *get_mut(weights, k) = w;
        }
        *dots
    }
}

#[derive(Default)]
struct Runs(Vec<usize>);

impl Sink for Runs {
    fn run(&mut self, k: usize, dots: u32) {
        self.0.extend(std::iter::repeat_n(k, dots as usize));
    }
}

fn fast(stretches: &[(u32, Vec<i32>)], minimum: &[u16], absent: u32) -> Vec<usize> {
    let dots = stretches.iter().map(|s| s.0).sum();
    let mut runs = Runs::default();
    Rule::new(minimum, dots, absent).walk(&mut Tape { stretches: stretches.iter() }, &mut runs);
    // The same with whatever vectors this machine has.
    let mut wide = Runs::default();
    walk(&mut Rule::new(minimum, dots, absent), &mut Tape { stretches: stretches.iter() }, &mut wide);
    assert_eq!(runs.0, wide.0);
    // And where the source goes on beyond the walk, as it does behind a segment between solids.
    let mut longer = stretches.to_vec();
    longer.last_mut().unwrap().0 += 16;
    let mut cut = Runs::default();
    walk(&mut Rule::new(minimum, dots, absent), &mut Tape { stretches: longer.iter() }, &mut cut);
    assert_eq!(runs.0, cut.0);
    runs.0
}

/// The rule word for word, dot by dot, every stack's cost computed in full.
fn literal(stretches: &[(u32, Vec<i32>)], minimum: &[u16], absent: usize) -> Vec<usize> {
    let weights: Vec<&[i32]> =
        stretches.iter().flat_map(|(dots, row)| std::iter::repeat_n(&row[..], *dots as usize)).collect();
    let ends: Vec<usize> = stretches
        .iter()
        .scan(0, |end, (dots, _)| {
            *end += *dots as usize;
            Some(std::iter::repeat_n(*end, *dots as usize))
        })
        .flatten()
        .collect();
    let (n, stacks) = (weights.len(), minimum.len());
    let unit = i128::from(UNIT);
    let mut debt = vec![0i128; stacks];
    let (mut live, mut parked, mut last) = (vec![false; stacks], vec![0i128; stacks], vec![0usize; stacks]);
    let share = |debt: &mut [i128], live: &[bool], k: usize, amount: i128| {
        let others = live.iter().filter(|l| **l).count() as i128;
        if others == 0 {
            return;
        }
        debt[k] -= amount;
        let mut odd = amount % others;
        for q in (0..stacks).filter(|&q| live[q]) {
            debt[q] += amount / others + std::mem::take(&mut odd);
        }
    };
    let far = usize::from(*minimum.iter().max().unwrap());
    let (mut entered, mut check) = (0, absent);
    let (mut at, mut current, mut out) = (0, None::<usize>, Vec::new());
    loop {
        // The windows advance before the debts of absent stacks are checked.
        while entered < n.min(at + far) {
            for q in 0..stacks {
                if weights[entered][q] > 0 {
                    last[q] = ends[entered];
                    if !live[q] {
                        let back = std::mem::take(&mut parked[q]);
                        share(&mut debt, &live, q, -back);
                        live[q] = true;
                    }
                }
            }
            entered += 1;
        }
        if at >= check {
            check = at + absent;
            for q in 0..stacks {
                if live[q] && at.saturating_sub(last[q]) >= absent {
                    live[q] = false;
                    parked[q] = debt[q];
                    let amount = debt[q];
                    share(&mut debt, &live, q, amount);
                }
            }
        }
        if at == n {
            break out;
        }
        let left = n - at;
        let asked =
            |q: usize, m: usize| -> i128 { weights[at..at + m].iter().map(|w| i128::from(w[q])).sum() };
        let own = |k: usize| usize::from(minimum[k]).min(left);
        let candidates: Vec<usize> = (0..stacks)
            .filter(|&k| asked(k, own(k)) > 0 && (usize::from(minimum[k]) <= left || Some(k) == current))
            .collect();
        let fitting = candidates.iter().map(|&k| usize::from(minimum[k])).filter(|&m| m <= left);
        let m = fitting.max().unwrap_or(0);
        let cost = |k: usize| {
            let deviation = |q: usize| {
                let demand = debt[q] + asked(q, m);
                (if q == k { demand - m as i128 * unit } else { demand }).abs()
            };
            let worst = (0..stacks).map(deviation).max().unwrap();
            (worst, (0..stacks).map(|q| deviation(q).pow(2)).sum::<i128>(), Some(k) != current, k)
        };
        let best = (m > 0)
            .then(|| candidates.into_iter().min_by_key(|&k| cost(k)))
            .flatten()
            .or(current)
            .or_else(|| {
                let any = (0..stacks).filter(|&k| asked(k, own(k)) > 0);
                any.max_by_key(|&k| (debt[k] + asked(k, own(k)), std::cmp::Reverse(k)))
            })
            .unwrap();
        let run = match current {
            Some(current) if current == best => 1,
            _ if m > 0 => own(best),
            _ => left,
        };
        for _ in 0..run {
            for q in 0..stacks {
                debt[q] += i128::from(weights[at][q]);
            }
            debt[best] -= unit;
            at += 1;
        }
        out.extend(std::iter::repeat_n(best, run));
        current = Some(best);
    }
}

/// Shares with many zeros and some wholes, in the unit, summing to it exactly.
fn shares(stacks: usize) -> impl Strategy<Value = Vec<i32>> {
    let raw = prop::collection::vec(prop_oneof![3 => Just(0u32), 2 => 1u32..100, 1 => Just(50u32)], stacks);
    (raw, 0..stacks).prop_map(move |(mut raw, some)| {
        raw[some] += 1;
        let sum: u32 = raw.iter().sum();
        let mut row: Vec<i32> =
            raw.iter().map(|&r| (u64::from(r) * UNIT as u64 / u64::from(sum)) as i32).collect();
        row[some] += UNIT - row.iter().sum::<i32>();
        row
    })
}

/// Stretches, minima, and after how many dots a stack is absent.
type Document = (Vec<(u32, Vec<i32>)>, Vec<u16>, u32);

fn document(stacks: std::ops::Range<usize>) -> impl Strategy<Value = Document> {
    stacks.prop_flat_map(|stacks| {
        let minimum = prop_oneof![
            (1u16..20).prop_map(move |c| vec![c; stacks]),
            prop::collection::vec(prop_oneof![Just(1u16), Just(4), Just(9), Just(16)], stacks),
        ];
        let stretches = prop::collection::vec((1u32..40, shares(stacks)), 1..40);
        (stretches, minimum, prop_oneof![Just(ABSENT), 1u32..200])
    })
}

proptest! {
    #![proptest_config(testing::cases(2000))]
    #[test]
    fn argmax_windows_and_jumps_give_the_literal_rule((stretches, minimum, absent) in document(1..12)) {
        prop_assert_eq!(fast(&stretches, &minimum, absent), literal(&stretches, &minimum, absent as usize));
    }

    #[test]
    fn no_run_is_shorter_than_its_minimum((stretches, minimum, absent) in document(1..12)) {
        let out = fast(&stretches, &minimum, absent);
        let runs: Vec<_> = out.chunk_by(|a, b| a == b).collect();
        for run in &runs {
            prop_assert!(run.len() >= usize::from(minimum[run[0]]) || runs.len() == 1);
        }
    }

    #[test]
    fn a_stack_is_printed_only_within_its_minimum_of_its_weight((stretches, minimum, absent) in document(1..12)) {
        let out = fast(&stretches, &minimum, absent);
        let wanted: Vec<&[i32]> = stretches
            .iter()
            .flat_map(|(dots, row)| std::iter::repeat_n(&row[..], *dots as usize))
            .collect();
        // The last run may have to go on to the end.
        let end = out.len().saturating_sub(usize::from(*minimum.iter().max().unwrap()));
        for (at, &k) in out.iter().enumerate().take(end) {
            let c = usize::from(minimum[k]);
            let near = &wanted[at.saturating_sub(c)..(at + c).min(out.len())];
            prop_assert!(near.iter().any(|w| w[k] > 0), "stack {} at {}", k, at);
        }
    }

    #[test]
    fn constant_weights_are_met_within_a_few_minima(
        row in shares(11),
        minimum in prop_oneof![
            (1u16..17).prop_map(|c| vec![c; 11]),
            prop::collection::vec(prop_oneof![Just(8u16), Just(16)], 11),
        ],
    ) {
        let out = fast(&[(20_000, row.clone())], &minimum, ABSENT);
        let c = f64::from(*minimum.iter().max().unwrap());
        for (k, &w) in row.iter().enumerate() {
            let printed = out.iter().filter(|&&s| s == k).count() as f64;
            let wanted = 20_000.0 * f64::from(w) / f64::from(UNIT);
            prop_assert!((printed - wanted).abs() <= 3.0 * c, "{} {}", printed, wanted);
        }
    }

    /// Regions of two inks each, some of them coarse, one after the other and back: what is owed stays small
    /// however often the walk crosses from one to the other.
    #[test]
    fn debts_stay_small_over_many_crossings(
        regions in prop::collection::vec(shares(8), 2..4),
        minimum in prop::collection::vec(prop_oneof![Just(8u16), Just(16)], 8),
        length in 100u32..9000,
    ) {
        let stretches: Vec<_> =
            (0..24).map(|i| (length, regions[i % regions.len()].clone())).collect();
        let out = fast(&stretches, &minimum, ABSENT);
        for k in 0..8 {
            let printed = out.iter().filter(|&&s| s == k).count() as f64;
            let wanted: f64 =
                stretches.iter().map(|(n, w)| f64::from(*n) * f64::from(w[k]) / f64::from(UNIT)).sum();
            prop_assert!((printed - wanted).abs() <= 120.0, "{}: {} {}", k, printed, wanted);
        }
    }
}

proptest! {
    #![proptest_config(testing::cases(60))]
    /// Groups of eight stacks, some of them not full, and more than fit in arrays.
    #[test]
    fn many_stacks_follow_the_literal_rule((stretches, minimum, absent) in document(9..80)) {
        prop_assert_eq!(fast(&stretches, &minimum, absent), literal(&stretches, &minimum, absent as usize));
    }
}

/// The whole halftone of a mix without solids is the literal rule along the walk, at one dot a pixel.
#[test]
fn a_mix_without_solids_is_walked_by_the_literal_rule() {
    use crate::hilbert::mix::Lattice;
    use crate::{Method, Settings, halftone};
    use appearance::weights::{ONE, WeightMaps, quantise};
    use inks::Stack;
    use protocol::{ink::Ink, walk::Walk};
    for (seed, width, height) in [(1u64, 70u16, 45u16), (2, 129, 66), (3, 64, 200)] {
        let (wide, high, count) = (usize::from(width), usize::from(height), 4);
        let noise = |i: usize| ((seed ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 + 1.0;
        let mut data = vec![0; wide * high * count];
        for (pixel, out) in data.chunks_exact_mut(count).enumerate() {
            quantise(&(0..count).map(|q| noise(pixel * 4 + q).powi(2)).collect::<Vec<_>>(), out);
        }
        let matrix = (0..count).map(|i| (0..count).map(|q| if q == i { ONE } else { 0 }).collect()).collect();
        let inks = [Ink::Cyan, Ink::Magenta, Ink::Black].map(|ink| Stack::new([ink]));
        let mix = appearance::gamut::InkMix {
            stacks: std::iter::once(Stack::SUBSTRATE).chain(inks).collect(),
            maps: WeightMaps::new(wide, high, count, data).unwrap(),
            matrix,
        };
        let minimum = vec![9, 4, 16, 9];
        let settings = Settings { method: Method::Walk, minimum: minimum.clone(), reflectance: None };
        let dots = halftone(&mix, (width, height), None, &settings, &observe::Silent).unwrap();
        let walk = Walk::new(width, height);
        let lattice = Lattice::new(&mix, &walk);
        let mut along = lattice.along(walk.bands().flat_map(|band| band.tiles()));
        let (mut stretches, mut at) = (Vec::new(), 0);
        while at < walk.len() {
            let mut lanes = vec![Lanes::default(); 1];
            let dots = along.stretch(&mut lanes);
            stretches.push((dots, lanes[0].0[..count].to_vec()));
            at += dots;
        }
        for (position, q) in literal(&stretches, &minimum, ABSENT as usize).into_iter().enumerate() {
            let (x, y) = walk.at(position as u32).unwrap();
            let found = dots.index()[usize::from(y) * wide + usize::from(x)];
            assert_eq!(usize::from(found), q, "dot {x}, {y}");
        }
    }
}

/// Hairlines of many stacks, none large enough to be printed: without parking the background would owe
/// all of them, and a newcomer would then be printed alone for hundreds of dots.
#[test]
fn debts_of_the_absent_do_not_make_a_newcomer_solid() {
    let stacks = 60;
    let whole = |k: usize| (0..stacks).map(|q| if q == k { UNIT } else { 0 }).collect::<Vec<_>>();
    let mut stretches = Vec::new();
    for k in 2..stacks {
        stretches.push((3, whole(k)));
        stretches.push((9000, whole(0)));
    }
    let mut half = whole(0);
    (half[0], half[1]) = (UNIT / 2, UNIT / 2);
    stretches.push((400, half));
    let out = fast(&stretches, &vec![9; stacks], ABSENT);
    let longest = out.chunk_by(|a, b| a == b).filter(|run| run[0] == 1).map(<[usize]>::len).max();
    assert!(longest.is_some_and(|l| l <= 18), "{longest:?}");
}
