//! Fitting mixtures of the chosen stacks to materials, by intent.
//!
//! [`basis`] fits single materials, [`clamp`] every pixel. [`blend`], [`local`] and [`spatial_average`] change clamped pixels for the
//! sake of what lies around them; the last two move the targets and fit again ([`refit`]).

pub(super) mod basis;
pub(super) mod blend;
pub(super) mod clamp;
pub(super) mod gloss;
pub(super) mod local;
mod refit;
pub(super) mod spatial_average;
mod warm_start;
