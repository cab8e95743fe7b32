//! Constrained least squares, the problem behind factoring, gamut mapping and clamping.
//!
//! [`Simplex`] solves the convex quadratic problem exactly. [`Mixer`] solves the perceptual problem (eq. 1) by a short
//! sequence of such quadratics.

mod columns;
mod gram;
mod hull;
mod mixture;
mod root;
mod seen;
mod simplex;
pub(crate) mod vector;

pub use columns::Columns;
pub use gram::Gram;
pub(crate) use hull::LAYER_PRICE;
pub use hull::{Hull, MixtureError, Target};
pub use mixture::{Best, Fit, Mixer};
pub use simplex::{Certificate, Simplex, SimplexError};
