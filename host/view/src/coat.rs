//! Curves split into a clear coat and what lies below it, and the texels that stand for them.
//!
//! Problem: a stack under finish has two lobes, and other programs know a second lobe only as a clear coat.
//! Method: for each of some widths of a coat and parts of it, the coat's lobe is taken from the curve and what remains is fitted as a
//! surface by itself. All curves share the width whose fits are best by area. A curve has a coat where that removes more than half of
//! its distance to the nearest surface without one, and the distance could be seen.
//! Cost: [`LEVELS`] x [`PARTS`] fits for each curve, once. Limits: one width for the whole sheet; a coat reflects 4 %.
//! Source: KHR_materials_clearcoat; light passes the coat twice, as in `appearance::materials::Coat`.

use appearance::brdf::Space;
use appearance::materials::{DIELECTRIC, Metallic, Widths};
use appearance::srgb;
use rayon::prelude::*;

/// The least roughness: its square is the narrowest lobe that a document may have.
pub(crate) const SMOOTHEST: u8 = 37;

/// The roughness of coats that are tried, of 255: from the smoothest texel on.
const LEVELS: [u8; 10] = [37, 44, 52, 60, 70, 82, 96, 112, 132, 160];

/// Parts of a coat that are tried.
const PARTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// The least distance from a surface without a coat that is worth a texture: it is barely visible.
const SEEN: f64 = 0.01;

/// The share of that distance that a coat leaves at most.
const BETTER: f64 = 0.5;

/// A texel: base colour in sRGB, metalness, roughness.
#[derive(Clone, Copy)]
pub(crate) struct Texel {
    pub base: [u8; 3],
    pub metallic: u8,
    pub roughness: u8,
    /// How much of it the coat covers.
    pub coat: u8,
    pub distance: f64,
}

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

/// How far the nearest texel without a coat is from a row, rounded to eight bits.
fn distance(widths: &Widths<'_>, space: &Space, row: &[f64]) -> f64 {
    texel(widths, space, row, None).distance
}

/// The texel nearest to a row, below a coat that covers a part of it.
pub(crate) fn texel(widths: &Widths<'_>, space: &Space, row: &[f64], coat: Option<(&Coating, f64)>) -> Texel {
    let part = coat.map_or(0.0, |(_, part)| part.clamp(0.0, 1.0));
    let code = (255.0 * part).round() as u8;
    let part = f64::from(code) / 255.0;
    let below = coat.map_or_else(|| row.to_vec(), |(coating, _)| coating.below(row, part));
    let Some(near) = widths.nearest(&below) else {
        return Texel { base: [0; 3], metallic: 0, roughness: u8::MAX, coat: 0, distance: f64::INFINITY };
    };
    let Metallic { base, metallic } = near.metallic();
    let base = base.map(|b| (srgb::encode(b as f32) * 255.0).round() as u8);
    let metallic = (metallic * 255.0).round() as u8;
    let read = Metallic {
        base: base.map(|b| f64::from(srgb::decode(f32::from(b) / 255.0))),
        metallic: f64::from(metallic) / 255.0,
    };
    let mut found = widths.row(&near.with(&read));
    if let Some((coating, _)) = coat {
        found.iter_mut().zip(&coating.lobe).for_each(|(f, lobe)| *f = through(part) * *f + part * lobe);
    }
    let distance = space.distance(row, &found);
    Texel { base, metallic, roughness: SMOOTHEST + near.width as u8, coat: code, distance }
}
