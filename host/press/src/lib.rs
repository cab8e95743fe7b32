//! Dots, pages, jobs and pictures.
//!
//! The modules stand in the order of the data: a mixture of stacks goes through [`halftone`], flat art through [`layers`],
//! a chart through [`chart`], and each gives a dot map ([`sheet`]); [`layout`] puts it on a page, [`separate`] splits the page
//! into passes, [`job`] plans them and writes them in the printer's language, [`simulate`] prints them without a printer,
//! [`inspect`] reads them and [`preview`] shows them. [`pipeline`] is the way from dots to a job. Nothing here talks to a
//! device.
#![deny(unsafe_code)]

pub mod chart;
pub mod files;
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
