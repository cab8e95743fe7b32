//! Bases to mixtures of printable stacks.
