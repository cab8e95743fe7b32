//! What is asked of a picture, and what every reader says alike.

use std::path::Path;

use observe::Diagnosis;

use crate::jpeg;

/// What to read of a picture, and how large it may be.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The page of a file with several, from 1; the first if none is chosen.
    pub page: Option<u32>,
    /// Whether an extra channel of this name is wanted as a plane. Process plates become planes, too. Without
    /// it the picture has colours only.
    pub planes: Option<&'a dyn Fn(&str) -> bool>,
    /// The most pixels.
    pub pixels: u64,
    /// The most pixels across and down that the caller can use: colours that are finer are averaged while
    /// they are read. Planes are left as they are.
    pub finest: Option<(u32, u32)>,
    /// What has so many pixels, in words.
    pub room: &'static str,
    /// Formats that the caller reads by other means, in words.
    pub besides: &'static str,
}

impl Request<'_> {
    /// Refuses absurd sizes before anything is allocated.
    ///
    /// # Errors
    /// No pixel, or more than allowed.
    pub fn check(&self, name: &Path, (width, height): (u32, u32)) -> Result<(), Diagnosis> {
        if width == 0 || height == 0 {
            let problem = format!("the picture is {width} x {height} pixels; expected at least one");
            return Err(Diagnosis::of_file(name, problem));
        }
        if u64::from(width) * u64::from(height) > self.pixels {
            let problem = format!("the picture is {width} x {height} pixels, more than {}", self.room);
            return Err(Diagnosis::of_file(name, problem).hint("make it smaller"));
        }
        Ok(())
    }
}

/// A note on samples of 16 bits.
pub(crate) fn reduced(name: &Path) -> String {
    format!("{}: 16 bits per channel are reduced to 8", name.display())
}

/// A picture that ends before its end.
pub(crate) const CUT_SHORT: &str =
    "the picture ends before its last row: the file was cut short; copy or save it again";

/// Refuses a JPEG that was cut short: the decoder makes up what it lacks.
pub(crate) fn whole_jpeg(name: &Path, bytes: &[u8]) -> Result<(), Diagnosis> {
    if jpeg::is_whole(bytes) { Ok(()) } else { Err(Diagnosis::of_file(name, CUT_SHORT)) }
}
