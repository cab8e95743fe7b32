//! A photograph of a series, before it is read: its file, its time, and the light that both let in.

use std::path::PathBuf;

use readers::Exif;

/// A photograph with its exposure, before it is read.
#[derive(Clone, Debug)]
pub struct Exposure {
    /// The file.
    pub path: PathBuf,
    /// Time in seconds.
    pub seconds: f64,
    /// What the file says.
    pub exif: Exif,
}

impl Exposure {
    /// Light on the sensor relative to other photographs: time, sensitivity, aperture.
    pub(crate) fn relative(&self) -> f64 {
        let aperture = self.exif.aperture.unwrap_or(1.0);
        self.seconds * self.exif.iso.unwrap_or(100.0) / 100.0 / (aperture * aperture)
    }

    /// The file's name.
    pub(crate) fn name(&self) -> String {
        self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}
