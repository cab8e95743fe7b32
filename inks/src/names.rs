//! The names of all inks: the printer's cartridges, and inks of one's own in a box of one of them.

use protocol::ink::Ink;

use crate::cartridges;
use crate::own::{self, Own};

/// The ink of this name or code, if the whole text is one; of an ink of one's own that it poses as.
pub fn ink(text: &str) -> Option<Ink> {
    cartridges::ink(text).or_else(|| own::named(text).map(Own::poses_as))
}

/// All names of more than a code, for suggestions.
pub fn known() -> impl Iterator<Item = &'static str> {
    cartridges::known().chain(own::all().iter().map(Own::name))
}
