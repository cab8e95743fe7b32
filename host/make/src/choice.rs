//! Names and words of what can be chosen beside the options of a [page](crate::options): for a command line
//! and for reports.

use appearance::document::ColourSpace;
use appearance::factor::Method;
use appearance::gamut::{self, Intent};
use art::Accept;
use inks::Trust;
use press::layout::fit::Scaling;

use crate::view::Show;

/// An enum whose values have names.
pub trait Choice: Copy + Send + Sync + 'static {
    /// Each value with its name and a line of help, which may be empty.
    const ALL: &'static [(Self, &'static str, &'static str)];
}

/// The name of a value.
#[must_use]
pub fn name<T: Choice + PartialEq>(value: T) -> &'static str {
    T::ALL.iter().find(|(known, ..)| *known == value).map_or("", |(_, name, _)| name)
}

impl Choice for ColourSpace {
    const ALL: &'static [(ColourSpace, &'static str, &'static str)] = &[
        (ColourSpace::Srgb, "srgb", "The transfer curve of IEC 61966-2-1"),
        (ColourSpace::Linear, "linear", "Proportional to reflectance"),
    ];
}

impl Choice for Method {
    const ALL: &'static [(Method, &'static str, &'static str)] = &[
        (
            Method::Archetypes,
            "archetypes",
            "Corners of the document, fitted in the metric, kept near its real materials",
        ),
        (
            Method::Kmeans,
            "kmeans",
            "The paper's convex-hull k-means: real materials, robust, but inside the corners",
        ),
        (
            Method::Sacls,
            "sacls",
            "The paper's sparse alternating constrained least squares; kmeans where its bases are far from any real material",
        ),
    ];
}

/// What mixtures are chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Distance d and the distance in light.
    Light,
    /// Distance d alone.
    Paper,
}

impl Metric {
    /// The weight of the distance in light.
    #[must_use]
    pub fn light(self) -> f64 {
        match self {
            Metric::Light => gamut::LIGHT,
            Metric::Paper => 0.0,
        }
    }
}

impl Choice for Metric {
    const ALL: &'static [(Metric, &'static str, &'static str)] = &[
        (Metric::Light, "light", "Distance d and how much light is returned: metals shine"),
        (Metric::Paper, "paper", "Distance d alone, as in the 2009 paper"),
    ];
}

impl Choice for Trust {
    const ALL: &'static [(Trust, &'static str, &'static str)] = &[
        (Trust::All, "all", "Every curve of the library, modelled ones too"),
        (Trust::Predicted, "predicted", "Curves that were measured, and those predicted from measurements"),
        (Trust::Measured, "measured", "Curves that were measured, and no others"),
    ];
}

impl Choice for Intent {
    const ALL: &'static [(Intent, &'static str, &'static str)] = &[
        (
            Intent::Auto,
            "auto",
            "Clamp, or blend if that keeps clearly more materials apart; with shine where that looks clearly nearer",
        ),
        (Intent::Basis, "basis", "Map the bases and keep the weights: relative differences survive"),
        (
            Intent::Clamp,
            "clamp",
            "Map each pixel by itself: lowest error, but differences outside the gamut are lost",
        ),
        (Intent::Blend, "blend", "Clamp where the result is near, use the mapped bases where it is not"),
        (
            Intent::Contrast,
            "contrast",
            "Clamp what the inks can make; elsewhere keep differences between neighbours, such as scratches and grain",
        ),
        (
            Intent::Shine,
            "shine",
            "Clamp, and let mirrors that no ink reaches shine as the nearest metal instead of turning dark",
        ),
    ];
}

impl Choice for art::Text {
    const ALL: &'static [(art::Text, &'static str, &'static str)] = &[
        (art::Text::Mixed, "mixed", "In its colour, mixed dot by dot like everything else"),
        (art::Text::Solid, "solid", "In the nearest solid, if one looks about like its colour: for labels"),
    ];
}

impl Choice for Accept {
    const ALL: &'static [(Accept, &'static str, &'static str)] = &[
        (
            Accept::FoilUndercoat,
            Accept::FoilUndercoat.name(),
            "Solid cyan, magenta, yellow and black beneath every foil",
        ),
        (
            Accept::EvenWhite,
            Accept::EvenWhite.name(),
            "Primer, finish and primer between black and the white above it",
        ),
        (Accept::WhiteThrice, Accept::WhiteThrice.name(), "Three layers of white instead of one"),
        (
            Accept::SilverUnderWhite,
            Accept::SilverUnderWhite.name(),
            "Metallic silver beneath white, for dark grounds",
        ),
        (
            Accept::WhiteKept,
            Accept::WhiteKept.name(),
            "White beneath the colours of a page that knock it out",
        ),
    ];
}

impl Choice for Scaling {
    const ALL: &'static [(Scaling, &'static str, &'static str)] = &[
        (Scaling::Auto, Scaling::Auto.name(), "Turned, and made smaller if it is too large"),
        (Scaling::AutoFit, Scaling::AutoFit.name(), "The same"),
        (Scaling::Fit, Scaling::Fit.name(), "As large as the printable area holds"),
        (Scaling::Fill, Scaling::Fill.name(), "The whole sheet is covered, and the rest cut"),
        (Scaling::None, Scaling::None.name(), "As large as it is, in the middle of the sheet"),
    ];
}

impl Choice for Show {
    const ALL: &'static [(Show, &'static str, &'static str)] = &[
        (Show::Document, "document", "The document itself"),
        (Show::Mapped, "mapped", "The mixtures of inks that stand for it"),
        (Show::Printed, "printed", "The printed dots"),
    ];
}
