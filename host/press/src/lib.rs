//! Pages, jobs and pictures.
//!
//! The modules follow the data. A dot map ([`sheet`]) comes from a mixture of stacks ([`halftone`]), from flat art or from a
//! [`chart`]. [`layout`] puts it on a page, [`separate`] splits the page into passes, and [`job`] plans the
//! passes and writes them in the printer's language. [`simulate`] prints a job without a printer, [`inspect`] reads it, and
//! [`preview`] shows it. [`pipeline`] is the way from dots to a job. Nothing here talks to a device.
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]
#![deny(unsafe_code)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixel arithmetic: sides and values are bounded by checks at the input (pages fit in u16, pictures in 2^28 pixels, \
              stacks in u8), and checked casts in loops over dots would cost time and hide the arithmetic"
)]

pub mod chart;
pub mod html;
pub mod inspect;
pub mod job;
pub mod layout;
pub mod pipeline;
#[allow(clippy::disallowed_methods, reason = "pictures decide no dot; what does, forbids them again")]
pub mod preview;
pub mod separate;
pub mod simulate;
mod split_mix;
