//! The structure of `library.toml`.
//!
//! Unknown keys are errors. Values that are checked later keep their position in the file.

use serde::Deserialize;
use toml::Spanned;

use crate::model::{Layer, Model, Paper};
use crate::provenance::Figure;
use crate::rule::{Certainty, Rule};
use crate::set::InkName;

/// The version of the format that is read.
pub(crate) const FORMAT: u32 = 1;

/// The name of the file in the folder of a library.
pub const FILE_NAME: &str = "library.toml";

/// The largest library file, in bytes.
pub(crate) const MOST_BYTES: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub format: Spanned<u32>,
    pub based_on: Option<Spanned<String>>,
    pub name: Option<String>,
    pub about: Option<String>,
    pub licence: Option<Spanned<String>>,
    pub stacks: Option<Vec<Spanned<String>>>,
    pub paper: Option<Paper>,
    pub model: Option<Model>,
    #[serde(default)]
    pub ink: Vec<Spanned<InkTable>>,
    #[serde(default)]
    pub rule: Vec<Spanned<Rule>>,
    #[serde(default)]
    pub measured: Vec<Spanned<MeasuredTable>>,
    #[serde(default)]
    pub predicted: Vec<Spanned<MeasuredTable>>,
    #[serde(default)]
    pub dots: Vec<Spanned<DotsTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct InkTable {
    pub ink: InkName,
    pub okidata: String,
    pub alps: String,
    pub part: Spanned<String>,
    pub code: Spanned<u8>,
    pub barcode: Spanned<u8>,
    pub minimum_cluster: Figure<u16>,
    #[serde(default)]
    pub cautions: Vec<Caution>,
    pub layer: Option<Spanned<Layer>>,
}

/// Advice for owners before using a cartridge.
#[derive(Clone, Debug, PartialEq, Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Caution {
    /// The advice.
    pub text: String,
    /// How certain it is.
    pub certainty: Certainty,
}

/// A curve that was measured, or predicted from measurements.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeasuredTable {
    pub stack: Spanned<String>,
    pub curve: Spanned<String>,
    pub by: Spanned<String>,
    pub when: Spanned<String>,
    pub setup: Spanned<String>,
}

/// What a ramp chart said about the dots of an ink, or about gaps of bare paper between inks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DotsTable {
    pub ink: Spanned<DotsOf>,
    pub minimum_cluster: Spanned<u16>,
    pub dot_gain_um: Option<Spanned<f64>>,
    pub by: Spanned<String>,
    pub when: Spanned<String>,
    pub setup: Spanned<String>,
}

/// An ink by its name, or `paper`.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "String")]
pub(crate) enum DotsOf {
    Ink(protocol::ink::Ink),
    Paper,
}

impl DotsOf {
    pub(crate) fn name(self) -> &'static str {
        match self {
            DotsOf::Ink(ink) => ink.name(),
            DotsOf::Paper => "paper",
        }
    }
}

impl TryFrom<String> for DotsOf {
    type Error = crate::set::InkSetError;

    fn try_from(word: String) -> Result<DotsOf, Self::Error> {
        if word == "paper" {
            return Ok(DotsOf::Paper);
        }
        InkName::try_from(word).map(|ink| DotsOf::Ink(ink.0))
    }
}
