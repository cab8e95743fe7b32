//! A document's materials as a few bases and their weight maps.

use crate::brdf::{Space, Table};
use crate::weights::WeightMaps;

/// A factored document: at each pixel the reflectance is the weighted sum of the bases (section 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct Factored {
    /// The tabulation the bases are in.
    pub space: Space,
    /// The bases, reflectance in 1/sr, one a row.
    pub bases: Table,
    /// Their weights; as many channels as bases.
    pub maps: WeightMaps,
}
