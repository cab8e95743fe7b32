//! The list of samples.

use super::painting::Painting;
use super::{card, dove, flange, ladder, leaf};

/// A drawn material.
#[derive(Clone, Copy)]
pub struct Sample {
    /// Its name, as in `sample:NAME`.
    pub name: &'static str,
    /// What it shows.
    pub about: &'static str,
    draw: fn() -> Painting,
}

/// All samples.
pub const SAMPLES: [Sample; 5] = [
    Sample { name: "leaf", about: "an autumn oak leaf with silver veins on matte paper", draw: leaf::draw },
    Sample {
        name: "card",
        about: "a greeting card: gold, silver and glossy holly on matte green",
        draw: card::draw,
    },
    Sample { name: "dove", about: "a silver dove with a glossy olive twig on matte blue", draw: dove::draw },
    Sample { name: "flange", about: "a rusted steel ring, bare metal beside rust", draw: flange::draw },
    Sample {
        name: "ladder",
        about: "four steps of gloss over one colour, 100, 80, 50 and 10 percent",
        draw: ladder::draw,
    },
];

/// A name that no sample has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no sample `{name}`; the samples are {}", SAMPLES.map(|sample| sample.name).join(", "))]
pub struct UnknownSample {
    /// The name.
    name: String,
}

impl Sample {
    /// The sample with this name.
    pub fn named(name: &str) -> Result<Sample, UnknownSample> {
        SAMPLES
            .into_iter()
            .find(|sample| sample.name == name)
            .ok_or_else(|| UnknownSample { name: name.into() })
    }

    /// Draws it, which takes a fraction of a second.
    pub(crate) fn draw(&self) -> Painting {
        (self.draw)()
    }
}
