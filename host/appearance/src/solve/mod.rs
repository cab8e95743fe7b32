//! Constrained least squares, the problem behind factoring, gamut mapping and clamping.
//!
//! [`Simplex`] solves the convex quadratic problem exactly, [`SimplexBatch`] the same for many pixels at
//! once. [`Mixer`] solves the perceptual problem (eq. 1) by a short sequence of such quadratics.

mod batch;
mod columns;
mod gram;
mod hue;
mod hull;
mod mixture;
mod perceptual;
mod root;
mod simplex;
mod supports;
pub(crate) mod vector;

pub use batch::SimplexBatch;
pub use columns::Columns;
pub use gram::Gram;
pub use hull::{Hull, MixtureError, Target};
pub(crate) use hull::{LAYER_PRICE, SMALL};
pub use mixture::{Best, Fit, Mixer};
pub use simplex::{Certificate, Simplex, SimplexError};
