//! One set of features for shared dependencies.
//!
//! Problem: cargo chooses the features of a dependency by the packages that are built together, so a bench of one crate would
//! compile half of all dependencies, and every crate above them, again with fewer features than the program has.
//! Method: this crate depends on those whose features differ, with all the features that the program, its tests and its benches ask for, and
//! the crate of inks depends on it, which all others use. It holds no code.
//! Limits: the crates that do not use inks are small, and are left to themselves.
