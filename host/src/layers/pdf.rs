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
