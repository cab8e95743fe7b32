//! How near the inks come to a material.
//!
//! Method: the gamut mapping of [`crate::gamut`] with intent basis, for a picture whose every pixel is one of the
//! materials, with as many cartridges as they need and without scaling gloss.
//! Cost: a millisecond per material after the hull of the stacks.

use std::borrow::Cow;

use observe::Silent;

use crate::brdf::{Space, Table};
use crate::gamut::{self, GamutError, GamutSettings, Gloss, Intent, Printable};
use crate::materials::Factored;
use crate::weights::{ONE, WeightMaps};

/// The distance d between each row (1/sr) and the mixture of stacks chosen for it (0.01: barely visible; 0.05: obvious).
///
/// # Errors
/// Those of the mapping.
pub fn reach(space: &Space, rows: &Table, printable: &Printable) -> Result<Vec<f64>, GamutError> {
    let n = rows.len();
    let mut weights = vec![0; n * n];
    weights.iter_mut().step_by(n + 1).for_each(|weight| *weight = ONE);
    let Ok(maps) = WeightMaps::new(n, 1, n, weights) else {
        return Ok(Vec::new());
    };
    let materials = Factored { space: space.clone(), bases: rows.clone(), maps };
    let settings = GamutSettings {
        intent: Intent::Basis,
        gloss: Gloss::Keep,
        most_cartridges: usize::MAX,
        ..GamutSettings::default()
    };
    let mapped = gamut::map(
        &materials,
        || Ok::<_, GamutError>(Cow::Borrowed(&materials)),
        printable,
        &settings,
        &Silent,
    )?;
    Ok(mapped.report.materials.iter().map(|material| material.unscaled_distance).collect())
}
