//! The steps, and what they do to bases and weight maps.
//!
//! While steps are applied each map is a list of its own, so that a new basis costs one list. What a step adds to one map of a
//! pixel it takes from another in the same integers, so sums stay [`ONE`] whatever the rounding.

use super::error::EditError;
use super::mask::Mask;
use super::replacement::Replacement;
use super::surface::{Applied, LIGHTER, ROUGHER, Surface};
use crate::brdf::Table;
use crate::document::foil::{MOST_BASES, MOST_WEIGHTS};
use crate::materials::{Factored, check_reflectance};
use crate::weights::{ONE, WeightMaps};

/// One edit.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// What changes.
    pub change: Change,
    /// Where; everywhere without one.
    pub mask: Option<Mask>,
}

/// What an edit changes. Bases are numbered from 0.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The surface of a basis, or of every one.
    Surface {
        /// The basis; all without one.
        basis: Option<usize>,
        /// The edit.
        surface: Surface,
    },
    /// A basis becomes another material.
    Replace {
        /// The basis.
        basis: usize,
        /// The material.
        by: Replacement,
    },
    /// Two bases change places.
    Swap(usize, usize),
    /// A share of one basis becomes another one.
    Mix {
        /// The basis that loses weight.
        basis: usize,
        /// The basis that gains it.
        into: usize,
        /// The share of the weight, 0..=1.
        share: f64,
    },
}

/// A document after its edits.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    /// The document.
    pub document: Factored,
    /// For each of its bases, the basis of the document before from which it was made.
    pub origin: Vec<usize>,
    /// What each step did, in order; several for a step that edits all bases, none for one that changes nothing.
    pub effects: Vec<Effect>,
}

/// What a step did to one basis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// The step, from 0.
    pub step: usize,
    /// The basis.
    pub basis: usize,
    /// The basis that has the result: the same, a new one, or the other one of a swap or a mixture.
    pub into: usize,
    /// The share of the document whose weight has the edited curve or another basis now.
    pub share: f64,
    /// The factors that an edit of the surface came to.
    pub applied: Option<Applied>,
}

/// The document after these steps.
///
/// # Errors
/// The first step that does not suit the document, by its number.
pub fn apply(document: &Factored, steps: &[Step]) -> Result<Edited, EditError> {
    if document.space.angles().is_empty() {
        return Err(EditError::Tabulation);
    }
    let mut work = Work::new(document);
    for (number, step) in steps.iter().enumerate() {
        work.step = number;
        let refused = |source| EditError::Step { number: number + 1, source: Box::new(source) };
        work.apply(step).map_err(|error| if steps.len() > 1 { refused(error) } else { error })?;
    }
    work.finished()
}

struct Work<'a> {
    source: &'a Factored,
    bases: Vec<Vec<f64>>,
    origin: Vec<usize>,
    maps: Vec<Vec<u16>>,
    effects: Vec<Effect>,
    step: usize,
}

impl<'a> Work<'a> {
    fn new(source: &'a Factored) -> Work<'a> {
        let channels = source.maps.channels();
        let map =
            |channel: usize| source.maps.data().iter().skip(channel).step_by(channels).copied().collect();
        Work {
            source,
            bases: source.bases.rows().map(<[f64]>::to_vec).collect(),
            origin: (0..channels).collect(),
            maps: (0..channels).map(map).collect(),
            effects: Vec::new(),
            step: 0,
        }
    }

    fn finished(self) -> Result<Edited, EditError> {
        let (width, height) = (self.source.maps.width(), self.source.maps.height());
        let channels = self.maps.len();
        let mut data = vec![0; width * height * channels];
        for (channel, map) in self.maps.iter().enumerate() {
            data.iter_mut().skip(channel).step_by(channels).zip(map).for_each(|(out, &w)| *out = w);
        }
        let mut bases = Table::new(self.source.space.columns());
        self.bases.iter().for_each(|row| bases.push(row));
        // Every step keeps the sums.
        let maps = WeightMaps::new(width, height, channels, data).map_err(|source| {
            EditError::Document(crate::document::DocumentError::Weights { path: "edited".into(), source })
        })?;
        let document = Factored { space: self.source.space.clone(), bases, maps };
        Ok(Edited { document, origin: self.origin, effects: self.effects })
    }

    fn known(&self, basis: usize) -> Result<usize, EditError> {
        let bases = self.bases.len();
        if basis < bases { Ok(basis) } else { Err(EditError::Basis { found: basis, bases }) }
    }

    fn apply(&mut self, step: &Step) -> Result<(), EditError> {
        check(&step.change)?;
        let size = (self.source.maps.width(), self.source.maps.height());
        let mask = step.mask.as_ref().map(|mask| mask.values(size, &self.maps)).transpose()?;
        let mask = mask.as_deref();
        match &step.change {
            Change::Surface { basis, surface } => {
                let bases = match *basis {
                    Some(basis) => self.known(basis)?..basis + 1,
                    None => 0..self.bases.len(),
                };
                for basis in bases {
                    let (row, applied) = surface.edited(&self.source.space, &self.bases[basis]);
                    self.put(basis, row, mask, Some(applied))?;
                }
            }
            Change::Replace { basis, by } => {
                let basis = self.known(*basis)?;
                if by.row.len() != self.source.space.columns() {
                    return Err(EditError::Tabulation);
                }
                self.put(basis, by.row.clone(), mask, None)?;
            }
            &Change::Swap(a, b) => self.swap(a, b, mask)?,
            &Change::Mix { basis, into, share } => self.mix(basis, into, share, mask)?,
        }
        Ok(())
    }

    /// Gives a basis another curve, or under a mask moves its weight to a new basis with that curve.
    fn put(
        &mut self,
        basis: usize,
        row: Vec<f64>,
        mask: Option<&[u16]>,
        applied: Option<Applied>,
    ) -> Result<(), EditError> {
        check_reflectance(&row)
            .map_err(|error| EditError::Reflectance { basis, problem: error.to_string() })?;
        if row == self.bases[basis] {
            return Ok(());
        }
        let parts: Vec<u16> = match mask {
            Some(mask) => self.maps[basis].iter().zip(mask).map(|(&w, &m)| part(w, m)).collect(),
            None => self.maps[basis].clone(),
        };
        let share = self.share(parts.iter().map(|&part| u64::from(part)).sum());
        let mut into = basis;
        if parts == self.maps[basis] {
            self.bases[basis] = row;
        } else if share > 0.0 {
            let pixels = parts.len();
            let most = MOST_BASES.min(MOST_WEIGHTS / pixels.max(1));
            if self.bases.len() >= most {
                return Err(EditError::Many { bases: most, pixels });
            }
            into = self.bases.len();
            self.maps[basis].iter_mut().zip(&parts).for_each(|(w, part)| *w -= part);
            self.bases.push(row);
            self.origin.push(self.origin[basis]);
            self.maps.push(parts);
        }
        // What no pixel has has its new curve for the steps behind, but nothing that is seen has changed.
        if share > 0.0 {
            self.effects.push(Effect { step: self.step, basis, into, share, applied });
        }
        Ok(())
    }

    fn swap(&mut self, a: usize, b: usize, mask: Option<&[u16]>) -> Result<(), EditError> {
        let (a, b) = self.two(a, b)?;
        let (mut first, second) = (std::mem::take(&mut self.maps[a]), &mut self.maps[b]);
        let mut moved = 0;
        for (pixel, (a, b)) in first.iter_mut().zip(second).enumerate() {
            let mask = mask.map_or(ONE, |mask| mask[pixel]);
            let (low, high) = if *a < *b { (a, b) } else { (b, a) };
            let part = part(*high - *low, mask);
            *low += part;
            *high -= part;
            moved += u64::from(part);
        }
        self.maps[a] = first;
        self.moved(a, b, moved);
        Ok(())
    }

    fn mix(&mut self, basis: usize, into: usize, share: f64, mask: Option<&[u16]>) -> Result<(), EditError> {
        let (a, b) = self.two(basis, into)?;
        let share = (share * f64::from(ONE)).round() as u16;
        let (mut loses, gains) = (std::mem::take(&mut self.maps[a]), &mut self.maps[b]);
        let mut moved = 0;
        for (pixel, (loses, gains)) in loses.iter_mut().zip(gains).enumerate() {
            let part = part(*loses, mask.map_or(share, |mask| part(share, mask[pixel])));
            *loses -= part;
            *gains += part;
            moved += u64::from(part);
        }
        self.maps[a] = loses;
        self.moved(a, b, moved);
        Ok(())
    }

    fn two(&self, a: usize, b: usize) -> Result<(usize, usize), EditError> {
        if a == b {
            return Err(EditError::Same { basis: self.known(a)? });
        }
        Ok((self.known(a)?, self.known(b)?))
    }

    fn moved(&mut self, basis: usize, into: usize, weight: u64) {
        if weight > 0 {
            let share = self.share(weight);
            self.effects.push(Effect { step: self.step, basis, into, share, applied: None });
        }
    }

    fn share(&self, weight: u64) -> f64 {
        weight as f64 / (f64::from(ONE) * (self.source.maps.width() * self.source.maps.height()) as f64)
    }
}

/// A weight times a mask, rounded; never more than the weight.
fn part(weight: u16, mask: u16) -> u16 {
    ((u32::from(weight) * u32::from(mask) + u32::from(ONE) / 2) / u32::from(ONE)) as u16
}

/// Checks the numbers of a step, which may come from a file.
fn check(change: &Change) -> Result<(), EditError> {
    let range = |what, found: f64, range: std::ops::RangeInclusive<f64>| {
        let expected = format!("{} to {}", range.start(), range.end());
        if range.contains(&found) { Ok(()) } else { Err(EditError::Value { what, found, expected }) }
    };
    match change {
        Change::Surface { surface, .. } => {
            range("rougher", surface.rougher, ROUGHER)?;
            range("albedo", surface.albedo, LIGHTER)
        }
        Change::Mix { share, .. } => range("share", *share, 0.0..=1.0),
        Change::Replace { .. } | Change::Swap(..) => Ok(()),
    }
}
