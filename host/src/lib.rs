//! From a document of materials to one-bit ink passes and back to a simulated sheet.
//!
//! The modules stand in the order of the data: `document` → `factor` → `gamut` → `halftone` → `separate` →
//! `job` → `simulate` → `preview`. A stage is a function of its input and its settings; it prints nothing and
//! knows no neighbour. Progress goes through [`observe::Observer`].

pub mod observe;

pub mod brdf;
pub mod solve;
pub mod weights;

pub mod document;
pub mod sample;

pub mod factor;

pub mod gamut;

pub mod sheet;

pub mod halftone;

pub mod layers;

pub mod layout;

pub mod separate;

pub mod job;

pub mod simulate;

pub mod send;

pub mod flash;

pub mod inspect;

pub mod preview;

pub mod pipeline;

pub mod chart;

pub mod folders;

pub mod scratch;

pub mod ledger;

pub mod queue;

pub mod cli;
