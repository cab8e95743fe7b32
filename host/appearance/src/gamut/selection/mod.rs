//! Choosing what to print with: cartridges out of all inks, stacks out of all that the rules allow, and which stacks the others
//! can stand for.
//!
//! All three fit sampled targets to sets of stacks and compare the distances.

pub(super) mod cartridges;
pub(super) mod fitted;
pub(super) mod redundancy;
pub(super) mod sharp;
pub(super) mod stacks;
