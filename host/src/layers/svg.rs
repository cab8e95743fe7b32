use super::{Artwork, LayersError, Options};
use crate::observe::Observer;
use std::path::Path;
pub(super) fn read(
    file: &Path,
    _options: &Options,
    _observer: &dyn Observer,
) -> Result<Artwork, LayersError> {
    Err(super::raster::wrong(file, "is not read yet"))
}
pub(super) fn is_svg(start: &[u8]) -> bool {
    String::from_utf8_lossy(start).contains("<svg")
}
