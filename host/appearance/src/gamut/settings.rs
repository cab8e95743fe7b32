//! The choices in mapping.

use serde::Serialize;

/// What to do with materials outside the printer's gamut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Intent {
    /// Clamp, unless that merges more than 1 % of pairs of materials that differ; then blend.
    #[default]
    Auto,
    /// Map the bases, keep the weights: relative differences survive.
    Basis,
    /// Map each pixel by itself: lowest error, differences outside the gamut are lost.
    Clamp,
    /// Clamped where that is near, the mapped bases where it is not.
    Blend,
}

/// How the bases' gloss is treated before they are mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Gloss {
    /// Scale, if mapping would otherwise merge bases that differ and scaling helps.
    #[default]
    WhereMerged,
    /// Leave the gloss as it is.
    Keep,
    /// Scale all gloss in common, so that the most extreme basis just reaches the gamut.
    Scale,
}

/// Settings of the gamut mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// What to do with materials outside the gamut.
    pub intent: Intent,
    /// How the bases' gloss is treated.
    pub gloss: Gloss,
    /// Most different cartridges in the result; the machine holds 7.
    pub most_cartridges: usize,
    /// Seed of the sample of pixels that cartridges and intent are chosen by.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { intent: Intent::Auto, gloss: Gloss::WhereMerged, most_cartridges: 7, seed: 1 }
    }
}
