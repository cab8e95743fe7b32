//! The source of a number, stored with the number.

use std::fmt;

use serde::{Deserialize, Serialize};
use toml::Spanned;

/// How a single figure was obtained.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Measured on the printed ink itself.
    Measured,
    /// Published for this ink, this printer, or the same class of print or metal.
    Literature,
    /// Derived from other figures.
    Formula,
    /// An informed guess; nothing is published.
    Guess,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Source::Measured => "measured",
            Source::Literature => "literature",
            Source::Formula => "formula",
            Source::Guess => "guess",
        })
    }
}

/// A figure with its source, `{ value = 0.12, source = "guess", note = "..." }` in a file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure<T> {
    value: Spanned<T>,
    source: Source,
    note: Option<String>,
}

impl<T: Copy> Figure<T> {
    /// The value.
    pub fn get(&self) -> T {
        *self.value.get_ref()
    }

    /// The same figure, measured.
    pub(crate) fn measured(&mut self, value: T, note: String) {
        self.set(value);
        self.source = Source::Measured;
        self.note = Some(note);
    }

    /// Replaces the value, whatever its source.
    pub(crate) fn set(&mut self, value: T) {
        self.value = Spanned::new(self.value.span(), value);
    }

    /// A figure of the same source for three channels.
    pub(crate) fn triple(&self, value: [f64; 3]) -> Figure<[f64; 3]> {
        Figure { value: Spanned::new(self.value.span(), value), source: self.source, note: None }
    }

    /// Its source.
    pub fn source(&self) -> Source {
        self.source
    }

    /// A remark, if the file has one.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Byte offset of the value in its file.
    pub fn offset(&self) -> usize {
        self.value.span().start
    }
}

/// A figure of either shape, for lists and checks.
#[derive(Clone, Copy, Debug)]
pub enum Value<'a> {
    /// One number.
    Scalar(&'a Figure<f64>),
    /// One number per channel, or L*, a*, b*.
    Triple(&'a Figure<[f64; 3]>),
}

impl Value<'_> {
    /// The numbers.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Value::Scalar(figure) => vec![figure.get()],
            Value::Triple(figure) => figure.get().to_vec(),
        }
    }

    /// Their source.
    pub fn source(&self) -> Source {
        match self {
            Value::Scalar(figure) => figure.source(),
            Value::Triple(figure) => figure.source(),
        }
    }

    /// Byte offset in the file.
    pub fn offset(&self) -> usize {
        match self {
            Value::Scalar(figure) => figure.offset(),
            Value::Triple(figure) => figure.offset(),
        }
    }
}

/// A figure behind a modelled curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Its path in the library, such as `cyan.lab`.
    pub name: String,
    /// Its one or three numbers.
    pub value: Vec<f64>,
    /// Its source.
    pub source: Source,
}

/// The source of a curve, so that nobody mistakes a model for a measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Provenance {
    /// Computed from figures of the library; not measured.
    Modelled {
        /// The model's name.
        model: String,
        /// The figures used, substrate first, then layer by layer.
        parameters: Vec<Parameter>,
    },
    /// Computed from measurements of something else: of other stacks, or of gloss and colour.
    Predicted {
        /// Who measured what it was predicted from.
        by: String,
        /// When, as `YYYY-MM-DD` or `YYYY-MM`.
        when: String,
        /// From what, by which model, and how far off it may be.
        setup: String,
    },
    /// Measured on a print.
    Measured {
        /// Who measured.
        by: String,
        /// When, as `YYYY-MM-DD` or `YYYY-MM`.
        when: String,
        /// Instrument, geometry, paper and anything else needed to repeat it.
        setup: String,
    },
}

impl Provenance {
    /// Whether the curve is a measurement.
    pub fn is_measured(&self) -> bool {
        matches!(self, Provenance::Measured { .. })
    }

    /// `modelled`, `predicted` or `measured`.
    pub fn word(&self) -> &'static str {
        match self {
            Provenance::Modelled { .. } => "modelled",
            Provenance::Predicted { .. } => "predicted",
            Provenance::Measured { .. } => "measured",
        }
    }
}

/// Which curves of a library may be used.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Trust {
    /// All of them.
    #[default]
    All,
    /// Those that were measured, and those predicted from measurements.
    Predicted,
    /// Those that were measured.
    Measured,
}

impl Trust {
    /// Whether a curve of this origin may be used.
    pub fn includes(self, provenance: &Provenance) -> bool {
        match provenance {
            Provenance::Modelled { .. } => self == Trust::All,
            Provenance::Predicted { .. } => self != Trust::Measured,
            Provenance::Measured { .. } => true,
        }
    }
}
