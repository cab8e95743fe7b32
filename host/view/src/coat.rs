//! Curves split into a clear coat and what lies below it.
//!
//! Problem: a stack under finish has two lobes, and other programs know a second lobe only as a clear coat.
//! Method: for each of some widths of a coat and parts of it, the coat's lobe is taken from the curve and what remains is fitted as a
//! surface by itself. All curves share the width whose fits are best by area. A curve has a coat where that removes more than half of
//! its distance to the nearest surface without one, and the distance could be seen.
//! Cost: [`LEVELS`] x [`PARTS`] fits for each curve, once. Limits: one width for the whole sheet; a coat reflects 4 %.
//! Source: KHR_materials_clearcoat; light passes the coat twice, as in `appearance::materials::Coat`.

use appearance::brdf::Space;
use appearance::materials::{DIELECTRIC, Widths};
use rayon::prelude::*;

use crate::glb::distance;

/// The roughness of coats that are tried, of 255: from the smoothest texel on.
const LEVELS: [u8; 10] = [37, 44, 52, 60, 70, 82, 96, 112, 132, 160];

/// Parts of a coat that are tried.
const PARTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// The least distance from a surface without a coat that is worth a texture: it is barely visible.
const SEEN: f64 = 0.01;

/// The share of that distance that a coat leaves at most.
const BETTER: f64 = 0.5;

/// The coat of a sheet.
pub(crate) struct Coating {
    /// Its lobe where it covers all (1/sr).
    pub lobe: Vec<f64>,
    /// Its roughness, of 255.
    pub roughness: u8,
    /// How much of each curve it covers.
    pub parts: Vec<f64>,
}

/// The light that comes back through a coat that covers this part.
pub(crate) fn through(part: f64) -> f64 {
    1.0 - part + part * (1.0 - DIELECTRIC).powi(2)
}

impl Coating {
    fn new(space: &Space, roughness: u8, parts: Vec<f64>) -> Coating {
        let alpha = (f64::from(roughness) / 255.0).powi(2);
        let lobe = |&t: &f64| [DIELECTRIC * inks::ggx::lobe(t, alpha); 3];
        Coating { lobe: space.angles().iter().flat_map(lobe).collect(), roughness, parts }
    }

    /// The coat that curves with these shares of a sheet have, if one has any.
    pub fn of(widths: &Widths<'_>, space: &Space, rows: &[Vec<f64>], shares: &[f64]) -> Option<Coating> {
        let plain: Vec<f64> = rows.par_iter().map(|row| distance(widths, space, row)).collect();
        let tried = LEVELS.map(|roughness| {
            let mut coating = Coating::new(space, roughness, Vec::new());
            let found: Vec<(f64, f64)> = rows
                .par_iter()
                .zip(&plain)
                .map(|(row, &plain)| coating.part(widths, space, row, plain))
                .collect();
            let left: f64 = found.iter().zip(shares).map(|((left, _), share)| share * left * left).sum();
            coating.parts = found.into_iter().map(|(_, part)| part).collect();
            (left, coating)
        });
        let best = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, coating)| coating)?;
        best.parts.iter().zip(shares).any(|(part, share)| *part > 0.0 && *share > 0.0).then_some(best)
    }

    /// The distance that is left of a curve, and the part of it that this coat covers.
    fn part(&self, widths: &Widths<'_>, space: &Space, row: &[f64], plain: f64) -> (f64, f64) {
        if plain < SEEN {
            return (plain, 0.0);
        }
        let tried = PARTS.map(|part| {
            let below = self.below(row, part);
            // What is missing below the coat's own lobe counts, too.
            let mut whole: Vec<f64> = below.iter().map(|f| through(part) * f).collect();
            whole.iter_mut().zip(&self.lobe).for_each(|(f, lobe)| *f += part * lobe);
            (distance(widths, space, &below) + space.distance(row, &whole), part)
        });
        match tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(found) if found.0 < BETTER * plain => found,
            _ => (plain, 0.0),
        }
    }

    /// What lies below a coat that covers this part.
    pub fn below(&self, row: &[f64], part: f64) -> Vec<f64> {
        let each = row.iter().zip(&self.lobe);
        each.map(|(f, lobe)| ((f - part * lobe) / through(part)).max(0.0)).collect()
    }
}
