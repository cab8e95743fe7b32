//! Separations: planes of ink on their way into stacks.

use protocol::ink::Ink;
use serde::Serialize;

use sheet::Plane;

/// Source of the planes of plain colour.
pub(super) const COLOURS: &str = "the picture's colours";

/// One ink at one depth, before it is part of stacks.
pub(super) struct Separation {
    pub ink: Ink,
    /// Its source: a layer's name, or the setting that asks for it.
    pub from: String,
    /// Its place from the paper up, if the source gives one.
    pub place: Option<u32>,
    pub plane: Plane,
    pub passes: usize,
}

/// One ink at one depth of the composed art.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct InkLayer {
    /// Name of the ink.
    pub ink: &'static str,
    /// Dots that have it.
    pub dots: u64,
    /// Its source: a layer's name, or the setting that asks for it.
    pub from: String,
    /// Passes on each of its dots.
    pub passes: usize,
}
