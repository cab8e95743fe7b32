//! Constrained least squares: the one problem under factoring, gamut mapping and clamping.
//!
//! [`simplex`] solves the convex quadratic exactly, [`mixture`] the perceptual problem (eq. 1) by a short
//! sequence of such quadratics.

pub mod gram;
pub mod hull;
pub mod mixture;
pub mod root;
pub mod simplex;
pub mod vector;

pub use gram::{Gram, GramError};
pub use hull::{Hull, MixtureError, Target};
pub use mixture::{Best, Fit, Mixer};
pub use simplex::{Certificate, Simplex, SimplexError};
