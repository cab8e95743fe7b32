//! From files and pages in memory to artwork: which file is what, what a name prints, and the size on paper.
//!
//! Method: [`open`] chooses the way of a file. Pictures come from the crate `readers`, drawings from [`svg`],
//! pages from [`pdf`]; [`inks_by_name`] says what the planes and colours of a picture print, and [`layered`]
//! and `pdf::plates` what layers and spots do.

pub(crate) mod coverage;
pub(crate) mod cut_lines;
pub(crate) mod file;
pub(crate) mod indexed_page;
pub(crate) mod inks_by_name;
pub(crate) mod layered;
pub mod names;
pub mod object_type;
pub(crate) mod open;
pub(crate) mod page;
pub mod pdf;
pub(crate) mod picture;
pub mod process;
pub(crate) mod reserved;
pub(crate) mod scans;
pub(crate) mod seen;
pub(crate) mod size;
pub(crate) mod svg;
