//! TIFF files beyond what the usual decoder reads: named channels, unusual layouts of pixels, several pages.

pub(crate) mod channels;
pub(crate) mod layouts;
pub(crate) mod pages;
