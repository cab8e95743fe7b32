//! How layers become stacks.

use inks::InkSet;
use protocol::ink::{Ink, Kind};
use serde::Serialize;

use super::arrange::Order;
use super::suggest::Accept;
use crate::colour::intent::Intent;
use crate::dots::white::White;
use halftone::Method;

/// Where glossy finish goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Finish {
    /// On everything that is drawn.
    Artwork,
    /// On the whole rectangle of the art.
    All,
    /// Nowhere, not even where the art draws it.
    None,
}

/// How text in colours that no stack prints becomes dots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Text {
    /// Like everything else in its colour.
    #[default]
    Mixed,
    /// In the nearest solid, if one looks about like its colour: for labels.
    Solid,
}

/// The exponents by which pictures may be brightened.
pub const GAMMAS: std::ops::RangeInclusive<f64> = 0.2..=5.0;

/// How layers become stacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The inks that may be used. Layers of other inks are left out with a note; layers of other foils are an error.
    pub inks: InkSet,
    /// The order from the paper up.
    pub order: Order,
    /// Passes of an ink in each of its layers; one for inks that are not listed.
    pub passes: Vec<(Ink, u8)>,
    /// Inks that leave out the process inks beneath them.
    pub knockout: InkSet,
    /// Where white goes; `None` for where the art draws it.
    pub white: Option<White>,
    /// Dots by which white is shrunk, 0 to 237; negative to spread it.
    pub choke: f64,
    /// Where finish goes; `None` for where the art draws it.
    pub finish: Option<Finish>,
    /// How colours that the inks do not reach are replaced.
    pub intent: Intent,
    /// Exponent that brightens the colours of pictures, one of [`GAMMAS`]: values become their power 1 / `gamma`.
    pub gamma: f64,
    /// How tones become dots.
    pub halftone: Method,
    /// How text becomes dots.
    pub text: Text,
    /// The suggestions to follow.
    pub accept: Vec<Accept>,
}

impl Default for Settings {
    fn default() -> Settings {
        let metallic = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Metallic);
        Settings {
            inks: InkSet::default().with(Ink::White),
            order: Order::Default,
            passes: Vec::new(),
            knockout: InkSet::of(metallic),
            white: None,
            choke: 0.0,
            finish: None,
            intent: Intent::Auto,
            gamma: 1.0,
            halftone: Method::Fine,
            text: Text::Mixed,
            accept: Vec::new(),
        }
    }
}
