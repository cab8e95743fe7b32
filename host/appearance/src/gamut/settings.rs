//! The choices in mapping.

use serde::Serialize;

/// What to do with materials outside the printer's gamut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Intent {
    /// Clamp, or blend if clamping merges more than 1 % of the pairs of different materials and blending at
    /// least a fifth fewer; with shine where it makes balls look at least a fifth better.
    #[default]
    Auto,
    /// Map the bases and keep the weights: relative differences survive.
    Basis,
    /// Map each pixel on its own: lowest error, but differences outside the gamut are lost.
    Clamp,
    /// Clamped pixels where they are close to the target, the mapped bases elsewhere.
    Blend,
    /// Clamp in the gamut; outside it, keep differences between neighbouring pixels at the price of
    /// closeness.
    Contrast,
    /// Clamp, and print materials that reflect more sharply than any ink as those that return as much light
    /// as makes their balls look most alike.
    Shine,
}

impl Intent {
    /// Whether it maps the bases; the others fit each pixel by itself.
    pub fn uses_bases(self) -> bool {
        matches!(self, Intent::Basis | Intent::Blend)
    }
}

/// The weight of the distance in light beside distance d at which metals shine and other materials hardly
/// change; `docs/decisions/metric-that-knows-light.md` has the figures.
pub const LIGHT: f64 = 0.28;

/// How the gloss of the bases is treated before they are mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Gloss {
    /// Scale if mapping would otherwise merge more than 1 % of pairs of materials and scaling helps.
    #[default]
    WhereMerged,
    /// Keep the gloss.
    Keep,
    /// Scale the gloss of all bases by one factor, so that the most extreme basis just reaches the gamut.
    Scale,
}

/// Settings of the gamut mapping.
#[derive(Clone, Debug, PartialEq)]
pub struct GamutSettings {
    /// What to do with materials outside the gamut.
    pub intent: Intent,
    /// Mixtures are chosen by distance d and this times the distance in light ([`LIGHT`]), as sides of a
    /// right angle; 0 is the metric of the 2009 paper.
    pub light: f64,
    /// Whether hue in the dark has a price of its own, if light has a weight. In a print of two pictures it
    /// would be bought with the one in the reflection, so there distances alone decide.
    pub hue: bool,
    /// Side in pixels of the square that an eye averages over. With it, clamped pixels are moved so that
    /// their means over such squares come nearer, at the price of each by itself; without it, each pixel
    /// comes as near as it can.
    pub eye: Option<f64>,
    /// How the gloss of the bases is treated.
    pub gloss: Gloss,
    /// The most cartridges in the result; the printer holds 7.
    pub most_cartridges: usize,
    /// Seed of the sample of pixels that the cartridges and the intent are chosen by.
    pub seed: u64,
}

impl Default for GamutSettings {
    fn default() -> GamutSettings {
        GamutSettings {
            intent: Intent::Auto,
            light: LIGHT,
            hue: true,
            eye: None,
            gloss: Gloss::WhereMerged,
            most_cartridges: 7,
            seed: 1,
        }
    }
}
