//! The rule of the paper among solids: each connected region of tones for itself.
//!
//! Problem: the walk crosses solids, where nothing may be printed but the solid; a run cut by one is not a cluster, and a
//! debt carried over one would print on the far side of an edge.
//! Method, band by band of the walk. Solids are printed, and what is left of the walk between them are segments. Segments
//! that touch are one region. Along the segments of a region the rule goes on with its debts, but no run crosses from one
//! to the next. A segment too short for every stack with weight in it is a rest:
//! 1. It prints the stack it touches most among the rule's. That stack was drawn by the same shares, so rests keep tones on
//!    average, and the cluster beside it only grows.
//! 2. Rests that touch no segment of the rule join until they are as large as the largest minimum cluster; each such
//!    clump prints one stack, the one with the most debt of its region's clumps.
//! 3. A clump that stays too small for a stack prints it only if no stack with weight holds; then the one with the smallest
//!    minimum cluster. Foil in specks would come off and be missed; ink in a speck is only a little rough.
//!
//! Cost: some 20 ns a dot of a band with solids and tones. Memory: 8 bytes a dot of a band.
//! Limits: a region ends with its band of 64 rows, which drops a few dots of debt.

use std::cmp::Reverse;
use std::collections::HashMap;

use observe::Observer;
use protocol::walk::{Band, MOST, Tile};

use super::mix::Lattice;
use super::rule::{self, LANES, Lanes, Rule, Source, UNIT, blocks};
use crate::TONE;
use crate::solids::Solids;
use sheet::forest::Forest;

/// No segment.
const NONE: u32 = u32::MAX;

/// Consecutive tones of the walk.
#[derive(Clone, Copy)]
struct Segment {
    /// Number of its tile in the band, and of its first dot on the tile's curve.
    tile: usize,
    offset: usize,
    /// Its first dot in the band's list of tones, and the one after its last.
    from: usize,
    end: usize,
    /// Too short for any stack with weight in it.
    rest: bool,
}

/// The tones of a band.
struct Tones<'a> {
    lattice: &'a Lattice<'a>,
    minimum: &'a [u16],
    width: usize,
    tiles: Vec<Tile>,
    /// Every tone in the order of the walk, as its place in the rows of the band.
    order: Vec<u32>,
    segments: Vec<Segment>,
    /// The segment of each dot, or [`NONE`].
    of: Vec<u32>,
}

/// Halftones a band into its rows. `minimum` is that of each stack of the lattice.
pub(super) fn band(
    band: &Band,
    lattice: &Lattice,
    minimum: &[u16],
    solids: &Solids,
    rows: &mut [u8],
    observer: &dyn Observer,
) {
    let mut tones = Tones::new(band, lattice, minimum, solids, rows);
    if !tones.order.is_empty() {
        tones.find_rests();
        let region = tones.joined(|_, _| true);
        tones.walk(&region, rows);
        tones.print_rests(&region, rows);
    }
    observer.advance(u64::from(band.len()));
}

impl<'a> Tones<'a> {
    /// Prints the solids of a band and lists the rest.
    fn new(
        band: &Band,
        lattice: &'a Lattice<'a>,
        minimum: &'a [u16],
        solids: &Solids,
        rows: &mut [u8],
    ) -> Tones<'a> {
        let tiles: Vec<Tile> = band.tiles().collect();
        let width = rows.len() / usize::from(band.height).max(1);
        for (at, dot) in rows.iter_mut().enumerate() {
            *dot = solids.at(at % width, usize::from(band.y) + at / width);
        }
        let (mut order, mut segments, mut of) = (Vec::new(), Vec::<Segment>::new(), vec![NONE; rows.len()]);
        let (mut curve, mut before) = ([0; MOST], false);
        for (number, tile) in tiles.iter().enumerate() {
            let dots = tile.fill(&mut curve);
            for (offset, &place) in curve[..dots].iter().enumerate() {
                let (x, y) =
                    (usize::from(place % protocol::walk::EDGE), usize::from(place / protocol::walk::EDGE));
                let at = (usize::from(tile.y - band.y) + y) * width + usize::from(tile.x) + x;
                let tone = rows[at] == TONE;
                if tone {
                    if !before {
                        let from = order.len();
                        segments.push(Segment { tile: number, offset, from, end: from, rest: false });
                    }
                    of[at] = segments.len() as u32 - 1;
                    order.push(at as u32);
                }
                if let Some(segment) = segments.last_mut() {
                    segment.end = order.len();
                }
                before = tone;
            }
        }
        Tones { lattice, minimum, width, tiles, order, segments, of }
    }

    /// The weights of a segment, in the rule's unit.
    fn weights(&self, segment: &Segment) -> Vec<i64> {
        let mut sums = vec![0; self.minimum.len()];
        let mut lanes = vec![Lanes::default(); blocks(self.minimum.len())];
        let mut along = self.lattice.along_from(self.tiles[segment.tile..].iter().copied(), segment.offset);
        let mut left = (segment.end - segment.from) as u32;
        while left > 0 {
            let dots = along.stretch(&mut lanes).min(left);
            left -= dots;
            for (q, sum) in sums.iter_mut().enumerate() {
                *sum += i64::from(lanes[q / LANES].0[q % LANES]) * i64::from(dots);
            }
        }
        sums
    }

    fn find_rests(&mut self) {
        let least = self.minimum.iter().copied().min().unwrap_or(1);
        let most = self.minimum.iter().copied().max().unwrap_or(1);
        for i in 0..self.segments.len() {
            let segment = self.segments[i];
            let dots = segment.end - segment.from;
            let holds = |(&weight, &minimum): (&i64, &u16)| weight > 0 && usize::from(minimum) <= dots;
            self.segments[i].rest = dots < usize::from(least)
                || dots < usize::from(most) && !self.weights(&segment).iter().zip(self.minimum).any(holds);
        }
    }

    /// Calls `with` for each two segments that touch, from the top left, once for each two dots that do.
    fn touching(&self, mut with: impl FnMut(u32, u32, usize, usize)) {
        for (at, &own) in self.of.iter().enumerate().filter(|(_, own)| **own != NONE) {
            let right = ((at + 1) % self.width != 0).then_some(at + 1);
            for next in right.into_iter().chain([at + self.width]) {
                if let Some(&other) = self.of.get(next)
                    && other != NONE
                    && other != own
                {
                    with(own, other, at, next);
                }
            }
        }
    }

    /// The first segment of the set of each, where those that touch are joined if `may` says so.
    fn joined(&self, may: impl Fn(u32, u32) -> bool) -> Vec<u32> {
        let mut sets = Forest::new(self.segments.len());
        self.touching(|a, b, _, _| {
            if may(a, b) {
                sets.join(a, b);
            }
        });
        sets.roots()
    }

    /// The rule along the segments that are no rests, region by region.
    fn walk(&self, region: &[u32], rows: &mut [u8]) {
        let mut list: Vec<usize> = (0..self.segments.len()).filter(|&i| !self.segments[i].rest).collect();
        list.sort_by_key(|&i| (region[i], i));
        for same in list.chunk_by(|&a, &b| region[a] == region[b]) {
            let mut rule: Option<Rule> = None;
            for &i in same {
                let segment = self.segments[i];
                let dots = (segment.end - segment.from) as u32;
                match &mut rule {
                    Some(rule) => rule.resume(dots),
                    None => rule = Some(Rule::new(self.minimum, dots, rule::ABSENT)),
                }
                let tiles = self.tiles[segment.tile..].iter().copied();
                let mut source = self.lattice.along_from(tiles, segment.offset);
                let mut paint = Paint {
                    stacks: &self.lattice.stacks,
                    order: &self.order[segment.from..segment.end],
                    rows: &mut *rows,
                };
                if let Some(rule) = &mut rule {
                    rule::walk(rule, &mut source, &mut paint);
                }
            }
        }
    }

    /// Rests print what they touch, or decide in clumps.
    fn print_rests(&self, region: &[u32], rows: &mut [u8]) {
        if !self.segments.iter().any(|segment| segment.rest) {
            return;
        }
        let weights: Vec<Vec<i64>> = self
            .segments
            .iter()
            .map(|segment| if segment.rest { self.weights(segment) } else { Vec::new() })
            .collect();
        let mut printed: Vec<bool> = self.segments.iter().map(|segment| !segment.rest).collect();
        // First every rest by itself, then those that are left by clumps.
        let single: Vec<(Vec<u32>, usize)> =
            (0..printed.len() as u32).filter(|&i| !printed[i as usize]).map(|i| (vec![i], 0)).collect();
        self.adopt(&single, &weights, &mut printed, rows);
        let clumps = self.clumps(|i| !printed[i as usize]);
        let enough = usize::from(self.minimum.iter().copied().max().unwrap_or(1));
        let (large, small): (Vec<_>, Vec<_>) = clumps.into_iter().partition(|&(_, dots)| dots >= enough);
        self.adopt(&small, &weights, &mut printed, rows);
        let mut debts: HashMap<u32, Vec<i64>> = HashMap::new();
        for (members, dots) in large.into_iter().chain(small) {
            if printed[members[0] as usize] {
                continue;
            }
            let debt =
                debts.entry(region[members[0] as usize]).or_insert_with(|| vec![0; self.minimum.len()]);
            let asked = self.asked(&members, &weights);
            debt.iter_mut().zip(&asked).for_each(|(debt, asked)| *debt += asked);
            let lacking = |q: usize| self.minimum[q] * u16::from(usize::from(self.minimum[q]) > dots);
            let order = |&q: &usize| (Reverse(lacking(q)), debt[q], Reverse(q));
            let best = (0..asked.len()).filter(|&q| asked[q] > 0).max_by_key(order).unwrap_or(0);
            debt[best] -= i64::from(UNIT) * dots as i64;
            self.paint(&members, best, rows);
        }
    }

    /// What some rests ask for together.
    fn asked(&self, members: &[u32], weights: &[Vec<i64>]) -> Vec<i64> {
        let mut asked = vec![0; self.minimum.len()];
        for &member in members {
            asked.iter_mut().zip(&weights[member as usize]).for_each(|(sum, weight)| *sum += weight);
        }
        asked
    }

    /// Prints each clump like the printed dots that it touches, of the stack it touches most among those it asks for.
    fn adopt(
        &self,
        clumps: &[(Vec<u32>, usize)],
        weights: &[Vec<i64>],
        printed: &mut [bool],
        rows: &mut [u8],
    ) {
        let mut clump_of = vec![NONE; self.segments.len()];
        for (number, (members, _)) in clumps.iter().enumerate() {
            members.iter().for_each(|&member| clump_of[member as usize] = number as u32);
        }
        let mut votes: Vec<Vec<u32>> = vec![Vec::new(); clumps.len()];
        self.touching(|a, b, at, next| {
            let (own, other, dot) = if printed[a as usize] { (b, a, at) } else { (a, b, next) };
            if clump_of[own as usize] == NONE || !printed[other as usize] {
                return;
            }
            if let Some(q) = self.lattice.stacks.iter().position(|&q| q == rows[dot])
                && weights[own as usize][q] > 0
            {
                let votes = &mut votes[clump_of[own as usize] as usize];
                votes.resize(self.minimum.len(), 0);
                votes[q] += 1;
            }
        });
        for ((members, _), votes) in clumps.iter().zip(&votes) {
            if let Some(most) = (0..votes.len()).max_by_key(|&q| (votes[q], Reverse(q))) {
                self.paint(members, most, rows);
                members.iter().for_each(|&member| printed[member as usize] = true);
            }
        }
    }

    fn paint(&self, members: &[u32], q: usize, rows: &mut [u8]) {
        for &member in members {
            let segment = self.segments[member as usize];
            for &at in &self.order[segment.from..segment.end] {
                rows[at as usize] = self.lattice.stacks[q];
            }
        }
    }

    /// Segments that touch, joined while one of them is less than the largest minimum cluster: each clump with its dots.
    fn clumps(&self, mine: impl Fn(u32) -> bool) -> Vec<(Vec<u32>, usize)> {
        let enough = usize::from(self.minimum.iter().copied().max().unwrap_or(1));
        let mut sets = Forest::new(self.segments.len());
        let mut dots: Vec<usize> = self.segments.iter().map(|segment| segment.end - segment.from).collect();
        self.touching(|a, b, _, _| {
            if mine(a)
                && mine(b)
                && dots[sets.root(a) as usize].min(dots[sets.root(b) as usize]) < enough
                && let Some((stays, goes)) = sets.join(a, b)
            {
                dots[stays as usize] += dots[goes as usize];
            }
        });
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); self.segments.len()];
        for i in (0..self.segments.len() as u32).filter(|&i| mine(i)) {
            members[sets.root(i) as usize].push(i);
        }
        members.into_iter().zip(dots).filter(|(members, _)| !members.is_empty()).collect()
    }
}

/// Writes runs to the dots of a segment.
struct Paint<'a> {
    stacks: &'a [u8],
    order: &'a [u32],
    rows: &'a mut [u8],
}

impl rule::Sink for Paint<'_> {
    fn run(&mut self, k: usize, dots: u32) {
        let (here, rest) = self.order.split_at((dots as usize).min(self.order.len()));
        for &at in here {
            self.rows[at as usize] = self.stacks[k];
        }
        self.order = rest;
    }
}
