//! Passes that lie beside where they should, from what photographs show and inks do not explain.
//!
//! Problem: a ribbon that lies three dots to the right bares one side of every shape and doubles the other, and with one factor for
//! each stack this looks like stacks that are five times too bright, or darker than nothing. Method: each ink's dots are moved on their own, and
//! what they then lie on gives the stacks, those that the job does not have too. Spots are differentiated by each ink's place, one dot either way, and the places
//! that explain all photographs best are solved together with the factors of all stacks (Gauss and Newton, with the factors eliminated); this is repeated from
//! there until whole dots no longer change. What is left of a dot is taken along the slope. Cost: four counts for each ink and round, over [`SPOTS`] spots.
//! Limits: one place for each ink, on the whole sheet; sheets of at most [`MOST`] inks, each printed once; places count from the camera marks.

use appearance::brdf::{Space, Table, reflectances};
use inks::{Library, Stack};
use protocol::ink::Ink;
use serde::Serialize;
use sheet::{Area, DOTS_PER_MM, DotMap, order};

use super::figures::{Cover, Lighting};
use super::flat::{ComparedArea, Covering};
use super::inputs::space;
use crate::linalg::Cholesky;

/// The most inks of a sheet whose passes are placed: their stacks have numbers of 8 bits.
const MOST: usize = 8;
/// Spots that are looked at, in whole rows: far more than two places for each of eight inks need, for they
/// share errors; the time grows with them.
const SPOTS: usize = 2000;
/// Photographs that are looked at: enough, for all show the same dots, and the time grows with them.
const PHOTOS: usize = 8;
/// Rounds: those of [`STEP`] dots reach [`FARTHEST`] in half of them.
const ROUNDS: usize = 12;
/// Dots that a pass moves in one round: what one dot either way says holds only nearby, where a moved ink
/// still overlaps its place.
const STEP: f64 = 4.0;
/// Dots that a pass may be off, a millimetre, as wide as a spot: what moved farther would leave it, and
/// slopes say nothing of it.
const FARTHEST: i64 = 24;
/// What a spot may be off for other reasons, as a share of the light. It only scales the terms below against
/// the light: what is left over gives the standard errors.
const NOISE: f64 = 0.01;
/// How far inks may be from the library, as a share, so that factors of stacks that hardly show stay near 1.
const INKS: f64 = 0.3;
/// How far a pass may be, in dots, so that an ink that hardly shows stays where it should be.
const PLACES: f64 = 6.0;
/// Spots overlap, and what they are off by is alike along an edge: how many know as much as one that knows of no other.
const ALIKE: f64 = 9.0;
/// A pass is off if it is by so many standard errors, and by so many dots: less is within a ribbon's play.
const SURE: f64 = 4.0;
/// And by so many dots, for less is within a ribbon's play.
const SLIGHT: f64 = 0.5;

/// A pass that lies beside its place.
#[derive(Clone, Debug, Serialize)]
pub struct PassOff {
    /// The ink.
    pub ink: String,
    /// To the right and up, in mm, from where the camera marks say.
    pub off_mm: [f64; 2],
    /// Its standard error.
    pub error_mm: [f64; 2],
}

/// What registration is solved from: a photograph's light, spot by spot.
pub(super) struct Evidence<'a> {
    pub(super) lighting: &'a Lighting,
    pub(super) seen: &'a [Option<[f64; 3]>],
}

/// A sheet's dots, each ink of which may be moved.
pub(super) struct Passes<'a> {
    sheet: &'a DotMap,
    area: Area,
    /// All inks, lowest first; none if the sheet's passes cannot be told apart.
    pub(super) inks: Vec<Ink>,
    /// The stacks of the sheet, then those that moved inks make.
    pub(super) stacks: Vec<Stack>,
    curves: Vec<inks::Curve>,
    /// The inks of each stack of the sheet, and the stack of each set of inks.
    sets: Vec<u8>,
    numbers: Vec<u8>,
    bare: Option<u8>,
}

/// How far each ink's dots are moved: to the right and down.
pub(super) type Shifts = Vec<[i64; 2]>;

/// Where passes are.
#[derive(Clone, Debug)]
pub(super) struct Registration {
    whole: Shifts,
    /// What is left of a dot.
    part: Vec<[f64; 2]>,
    error: Vec<[f64; 2]>,
}

impl<'a> Passes<'a> {
    pub(super) fn new(sheet: &'a DotMap, library: &Library, area: Area) -> Passes<'a> {
        let mut stacks = sheet.stacks().to_vec();
        let mut inks = order::passes_of(&stacks);
        let twice = inks.iter().enumerate().any(|(i, ink)| inks[..i].contains(ink));
        if twice || inks.len() > MOST {
            inks.clear();
        }
        let set = |stack: &Stack| -> u8 {
            inks.iter().enumerate().map(|(i, ink)| u8::from(stack.layers().contains(ink)) << i).sum()
        };
        let sets: Vec<u8> = stacks.iter().map(set).collect();
        let bare = stacks.iter().position(|stack| stack.layers().is_empty()).map(|at| at as u8);
        let mut numbers = Vec::new();
        for mask in 0..if inks.is_empty() { 0 } else { 1usize << inks.len() } {
            let known = sets.iter().position(|known| usize::from(*known) == mask);
            numbers.push(known.unwrap_or(stacks.len()) as u8);
            if known.is_none() {
                let own = inks.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1);
                stacks.push(Stack::new(own.map(|(_, ink)| *ink).collect::<Vec<_>>()));
            }
        }
        let space: Space = space();
        let rows: Table = reflectances(&stacks, library, &space);
        let curves = rows.rows().map(|row| space.curve(row)).collect();
        Passes { sheet, area, inks, stacks, curves, sets, numbers, bare }
    }

    /// How many of the stacks the sheet has.
    pub(super) fn own(&self) -> usize {
        self.sets.len()
    }

    /// The stack of a dot of the job.
    fn dot(&self, x: i64, y: i64) -> u8 {
        let (width, length) = (self.sheet.width() as i64, self.sheet.length() as i64);
        match self.bare {
            Some(bare) if x < 0 || y < 0 || x >= width || y >= length => bare,
            _ => {
                let (x, y) = (x.clamp(0, width - 1), y.clamp(0, length - 1));
                self.sheet.index()[(y * width + x) as usize]
            }
        }
    }

    /// The cover of these rows of spots with each ink moved so far.
    fn counted(
        &self,
        window: &ComparedArea,
        blur: [f64; 2],
        rows: &[usize],
        shifts: &[[i64; 2]],
    ) -> Vec<f32> {
        let moved: Vec<(usize, [i64; 2])> =
            shifts.iter().copied().enumerate().filter(|(_, shift)| *shift != [0, 0]).collect();
        let still = moved.iter().fold(u8::MAX, |still, (i, _)| still & !(1 << i));
        let own = |x: i64, y: i64| self.dot(x, y);
        let shifted = |x: i64, y: i64| {
            let mut set = self.sets[usize::from(self.dot(x, y))] & still;
            for (i, [right, down]) in &moved {
                set |= self.sets[usize::from(self.dot(x - right, y - down))] & 1 << i;
            }
            self.numbers[usize::from(set)]
        };
        let at: &(dyn Fn(i64, i64) -> u8 + Sync) = if moved.is_empty() { &own } else { &shifted };
        window.shares(&Covering::Dots { area: self.area, stacks: self.stacks.len(), at }, blur, rows)
    }

    /// What covers the spots: the job's dots, or where they lie.
    pub(super) fn cover(&self, window: &ComparedArea, blur: [f64; 2], at: Option<&Registration>) -> Cover {
        let rows = window.rows();
        let none: Shifts = vec![[0, 0]; self.inks.len()];
        let Some(at) = at else {
            return self.kept(self.counted(window, blur, &rows, &none));
        };
        let mut shares = self.counted(window, blur, &rows, &at.whole);
        for (i, part) in at.part.iter().enumerate() {
            for c in 0..2 {
                for (step, by) in [(1, 0.5), (-1, -0.5)] {
                    let mut shifts = at.whole.clone();
                    shifts[i][c] += step;
                    let next = self.counted(window, blur, &rows, &shifts);
                    let by = (by * part[c]) as f32;
                    shares.iter_mut().zip(next).for_each(|(share, next)| *share += by * next);
                }
            }
        }
        self.kept(shares)
    }

    /// The stacks of the job, and of the others those that are there.
    fn kept(&self, shares: Vec<f32>) -> Cover {
        let n = self.stacks.len();
        let own = self.sheet.stacks().len();
        let there = |s: &usize| *s < own || shares.iter().skip(*s).step_by(n).any(|share| *share != 0.0);
        let kept: Vec<usize> = (0..n).filter(there).collect();
        Cover {
            shares: shares.chunks_exact(n).flat_map(|spot| kept.iter().map(|s| spot[*s])).collect(),
            curves: kept.iter().map(|s| self.curves[*s].clone()).collect(),
            names: kept.iter().map(|s| self.stacks[*s].to_string()).collect(),
        }
    }

    /// Where the passes are, if one of them is not where it should be.
    pub(super) fn solve(
        &self,
        window: &ComparedArea,
        blur: [f64; 2],
        photos: &[Evidence<'_>],
    ) -> Option<Registration> {
        if self.inks.is_empty() || photos.is_empty() {
            return None;
        }
        let [across, down] = window.spots();
        let every = (across * down).div_ceil(SPOTS).max(1);
        let rows: Vec<usize> = (0..down).skip(every / 2).step_by(every).collect();
        let photos: Vec<&Evidence<'_>> = photos.iter().step_by(photos.len().div_ceil(PHOTOS)).collect();
        let mut whole: Shifts = vec![[0, 0]; self.inks.len()];
        let mut tried: Vec<Shifts> = Vec::new();
        for _ in 0..ROUNDS {
            let (part, error) = self.step(window, blur, &photos, &rows, &whole)?;
            let mut next = whole.clone();
            for (shift, part) in next.iter_mut().zip(&part) {
                for c in 0..2 {
                    shift[c] += part[c].clamp(-STEP, STEP).round() as i64;
                }
            }
            let found = Registration { whole: whole.clone(), part, error };
            if next == whole || tried.contains(&next) {
                return found.is_off().then_some(found);
            }
            if next.iter().flatten().any(|dots| dots.abs() > FARTHEST) {
                return None;
            }
            tried.push(std::mem::replace(&mut whole, next));
        }
        None
    }

    /// How much farther each ink lies, in dots, and its standard error.
    #[expect(clippy::type_complexity, reason = "two lists alike")]
    fn step(
        &self,
        window: &ComparedArea,
        blur: [f64; 2],
        photos: &[&Evidence<'_>],
        rows: &[usize],
        whole: &[[i64; 2]],
    ) -> Option<(Vec<[f64; 2]>, Vec<[f64; 2]>)> {
        let (n, free) = (self.stacks.len(), 2 * self.inks.len());
        let base = self.counted(window, blur, rows, whole);
        let slopes: Vec<Vec<f32>> = (0..free)
            .map(|j| {
                let at = |step: i64| {
                    let mut shifts = whole.to_vec();
                    shifts[j / 2][j % 2] += step;
                    self.counted(window, blur, rows, &shifts)
                };
                at(1).into_iter().zip(at(-1)).map(|(a, b)| 0.5 * (a - b)).collect()
            })
            .collect();
        let there = |shares: &[f32], s: usize| shares.iter().skip(s).step_by(n).any(|share| *share != 0.0);
        let lit: Vec<usize> =
            (0..n).filter(|s| there(&base, *s) || slopes.iter().any(|d| there(d, *s))).collect();
        let own: Vec<usize> = lit.iter().copied().filter(|s| there(&base, *s)).collect();
        let (m, across) = (own.len(), window.spots()[0]);
        let (mut normal, mut right) = (vec![0.0; free * free], vec![0.0; free]);
        let (mut square, mut count) = (0.0, 0.0);
        for photo in photos {
            let spots: Vec<(usize, usize)> = rows
                .iter()
                .enumerate()
                .flat_map(|(k, row)| (0..across).map(move |x| (k * across + x, row * across + x)))
                .filter(|(_, i)| photo.seen[*i].is_some())
                .collect();
            // The light of every stack at every spot, once.
            let lights: Vec<[f64; 3]> = spots
                .iter()
                .flat_map(|(_, i)| {
                    let ([_, _, theta], irradiance) = photo.lighting.at(window.spot(*i));
                    lit.iter().map(move |s| self.curves[*s].at(theta).map(|f| f * irradiance))
                })
                .collect();
            let summed: f64 = spots.iter().filter_map(|(_, i)| photo.seen[*i]).flatten().map(|v| v * v).sum();
            let unit = NOISE * (summed / (3 * spots.len().max(1)) as f64).sqrt().max(1e-30);
            for c in 0..3 {
                let (mut aa, mut ap, mut ra) = (vec![0.0; m * m], vec![0.0; m * free], vec![0.0; m]);
                (0..m).for_each(|s| aa[s * m + s] = INKS.powi(-2));
                let mut a = vec![0.0; m];
                let mut p = vec![0.0; free];
                for ((k, i), lights) in spots.iter().zip(lights.chunks_exact(lit.len())) {
                    let sum = |shares: &[f32]| -> f64 {
                        lit.iter().zip(lights).map(|(s, l)| f64::from(shares[k * n + s]) * l[c]).sum::<f64>()
                            / unit
                    };
                    let mut next = 0;
                    for (s, l) in lit.iter().zip(lights) {
                        if own.get(next) == Some(s) {
                            a[next] = f64::from(base[k * n + s]) * l[c] / unit;
                            next += 1;
                        }
                    }
                    p.iter_mut().zip(&slopes).for_each(|(p, d)| *p = sum(d));
                    let off = photo.seen[*i].map_or(0.0, |rgb| rgb[c]) / unit - sum(&base);
                    square += off * off;
                    count += 1.0;
                    for s in (0..m).filter(|s| a[*s] != 0.0) {
                        ra[s] += a[s] * off;
                        (0..m).for_each(|t| aa[s * m + t] += a[s] * a[t]);
                        (0..free).for_each(|j| ap[s * free + j] += a[s] * p[j]);
                    }
                    for j in 0..free {
                        right[j] += p[j] * off;
                        (0..free).for_each(|l| normal[j * free + l] += p[j] * p[l]);
                    }
                }
                // The factors are eliminated.
                let system = Cholesky::new(&aa, m)?;
                let by = system.solve(&ra);
                square -= by.iter().zip(&ra).map(|(a, b)| a * b).sum::<f64>();
                for j in 0..free {
                    let column: Vec<f64> = (0..m).map(|s| ap[s * free + j]).collect();
                    let solved = system.solve(&column);
                    right[j] -= column.iter().zip(&by).map(|(a, b)| a * b).sum::<f64>();
                    for l in 0..free {
                        normal[j * free + l] -= (0..m).map(|s| solved[s] * ap[s * free + l]).sum::<f64>();
                    }
                }
            }
        }
        (0..free).for_each(|j| normal[j * free + j] += PLACES.powi(-2));
        let system = Cholesky::new(&normal, free)?;
        let found = system.solve(&right);
        square -= found.iter().zip(&right).map(|(a, b)| a * b).sum::<f64>();
        let variance = ALIKE * (square / f64::max(count, 1.0)).max(1e-4);
        let error = |j: usize| {
            let mut unit = vec![0.0; free];
            unit[j] = 1.0;
            (variance * system.solve(&unit)[j]).max(0.0).sqrt()
        };
        let pairs = |of: &dyn Fn(usize) -> f64| (0..free / 2).map(|i| [of(2 * i), of(2 * i + 1)]).collect();
        Some((pairs(&|j| found[j]), pairs(&error)))
    }
}

impl Registration {
    fn dots(&self, i: usize) -> [f64; 2] {
        [0, 1].map(|c| self.whole[i][c] as f64 + self.part[i][c])
    }

    fn off(&self, i: usize) -> bool {
        let dots = self.dots(i);
        (0..2).any(|c| dots[c].abs() > (SURE * self.error[i][c]).max(SLIGHT))
    }

    fn is_off(&self) -> bool {
        (0..self.whole.len()).any(|i| self.off(i))
    }

    /// The passes that are off.
    pub(super) fn named(&self, passes: &Passes<'_>) -> Vec<PassOff> {
        let named = (0..self.whole.len()).filter(|i| self.off(*i));
        named
            .map(|i| {
                let [right, down] = self.dots(i).map(|dots| dots / DOTS_PER_MM);
                PassOff {
                    ink: passes.inks[i].name().to_owned(),
                    off_mm: [right, -down],
                    error_mm: self.error[i].map(|dots| dots / DOTS_PER_MM),
                }
            })
            .collect()
    }
}

impl PassOff {
    /// What is said of it.
    pub(super) fn words(&self) -> String {
        let [right, up] = self.off_mm;
        let part = |mm: f64, [more, less]: [&str; 2]| {
            format!("{:.2} mm {}", mm.abs(), if mm > 0.0 { more } else { less })
        };
        format!(
            "{} lies {} and {}",
            self.ink,
            part(right, ["to the right", "to the left"]),
            part(up, ["up", "down"])
        )
    }
}
