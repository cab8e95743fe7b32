//! Dots, pages, jobs and pictures.
//!
//! The modules stand in the order of the data: a mixture of stacks goes through [`halftone`], flat art through [`layers`],
//! a chart through [`chart`]; [`layout`] puts the dots on a page ([`sheet`]), [`separate`] splits them into passes, [`job`]
//! writes them in the printer's language, [`simulate`] prints them without a printer, [`inspect`] reads them and [`preview`]
//! shows them. [`pipeline`] is the order of the stages in one place. Nothing here talks to a device.
#![deny(unsafe_code)]

pub mod chart;
pub mod halftone;
pub mod inspect;
pub mod job;
pub mod layers;
pub mod layout;
pub mod pipeline;
pub mod preview;
pub mod scratch;
pub mod separate;
pub mod sheet;
pub mod simulate;
