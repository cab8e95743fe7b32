//! One stack for every dot, in clusters no smaller than the inks can hold.
pub(crate) mod rule;
