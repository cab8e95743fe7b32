use super::{Artwork, LayersError, Options};
use std::path::Path;
pub(super) fn spots(_file: &Path, _options: &Options) -> Result<Option<Artwork>, LayersError> {
    Ok(None)
}
pub(super) fn density(_bytes: &[u8]) -> Option<super::raster::Density> {
    None
}
