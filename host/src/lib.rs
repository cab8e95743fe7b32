//! From a document of materials to one-bit ink passes and back to a simulated sheet.
//!
//! The modules stand in the order of the data: [`document`] → [`factor`] → [`gamut`] → [`halftone`] → [`layout`] →
//! [`separate`] → [`job`] → [`simulate`] → [`preview`]; [`pipeline`] is their order in one function. Flat art comes in by
//! [`layers`] and [`chart`] and takes the same way from the layout on. [`send`] brings a job to a printer. A stage is a function
//! of its input and its settings; it prints nothing and knows no neighbour. Progress goes through [`observe::Observer`].
//! `docs/code.md` leads from each command to its module.

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

#[cfg(test)]
mod damage;
