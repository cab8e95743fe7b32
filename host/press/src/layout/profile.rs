//! The calibration of one printer: where it begins, and how far it feeds.
//!
//! Both are corrected in the dots. The printer's language has commands for them, but shifts there cannot be negative and
//! the line-feed command was never tried on hardware.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::length::Mm;
use files::{FileError, read_toml, write_toml};

/// The largest offset that is a printer's and not a mistake, in millimetres.
const MOST_OFFSET: f64 = 10.0;
/// The largest error of the feed that is a printer's.
const MOST_FEED: f64 = 0.02;
/// The most that a sheet is askew in a printer, in degrees.
const MOST_SKEW: f64 = 3.0;

/// A printer as measured with the calibration chart.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// How far to the right and how far down of the requested position the printer starts, in millimetres.
    pub offset_mm: [f64; 2],
    /// How many millimetres a line of 1 mm along the feed measures on paper.
    pub feed: f64,
    /// By how much prints are turned on the sheet, clockwise, in degrees. It is shown, and not corrected: rows of dots stay rows.
    #[serde(default)]
    pub skew_deg: f64,
}

impl Default for Profile {
    /// A printer that prints everything where it should.
    fn default() -> Profile {
        Profile { offset_mm: [0.0, 0.0], feed: 1.0, skew_deg: 0.0 }
    }
}

impl Profile {
    /// What is wrong with it, if anything, with the field.
    pub fn problem(&self) -> Option<String> {
        let [x, y] = self.offset_mm;
        if !(x.abs() <= MOST_OFFSET && y.abs() <= MOST_OFFSET) {
            return Some(format!("offset_mm: {x}, {y}; no printer is more than {MOST_OFFSET} mm off"));
        }
        if (self.feed - 1.0).abs() > MOST_FEED || self.feed.is_nan() {
            return Some(format!(
                "feed: {}; the measured length of 1 mm must be between {} and {}",
                self.feed,
                1.0 - MOST_FEED,
                1.0 + MOST_FEED
            ));
        }
        if self.skew_deg.abs() > MOST_SKEW || self.skew_deg.is_nan() {
            return Some(format!(
                "skew_deg: {}; no sheet goes in askew by more than {MOST_SKEW} degrees",
                self.skew_deg
            ));
        }
        None
    }

    /// Reads a profile.
    pub fn load(path: &Path) -> Result<Profile, FileError> {
        let profile: Profile = read_toml(path)?;
        match profile.problem() {
            None => Ok(profile),
            Some(problem) => Err(FileError::Text { path: path.into(), problem }),
        }
    }

    /// Writes a profile whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        match self.problem() {
            None => write_toml(path, self),
            Some(problem) => Err(FileError::Text { path: path.into(), problem }),
        }
    }

    /// The offset in dots.
    pub(crate) fn offset(&self) -> (i64, i64) {
        (Mm(self.offset_mm[0]).dots(), Mm(self.offset_mm[1]).dots())
    }

    /// The row of an ideal page that row `sent` of the stream lands on.
    pub(crate) fn lands_on(&self, sent: i64) -> i64 {
        self.offset().1 + (sent as f64 * self.feed).round() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_comes_back_from_its_file_and_nonsense_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("default.toml");
        let profile = Profile { offset_mm: [0.25, -0.5], feed: 1.002, skew_deg: -0.12 };
        profile.save(&path).unwrap();
        assert_eq!(Profile::load(&path).unwrap(), profile);
        for (text, word) in [
            ("offset_mm = [0.0, 99.0]\nfeed = 1.0", "offset_mm"),
            ("offset_mm = [0.0, nan]\nfeed = 1.0", "offset_mm"),
            ("offset_mm = [0.0, 0.0]\nfeed = 2.0", "feed"),
            ("offset_mm = [0.0, 0.0]\nfeed = nan", "feed"),
            ("offset_mm = [0.0, 0.0]\nfeed = 1.0\nskew_deg = nan", "skew_deg"),
            ("offset_mm = [0.0, 0.0]\nfeed = 1.0\nfed = 1", "fed"),
        ] {
            std::fs::write(&path, text).unwrap();
            let said = Profile::load(&path).unwrap_err().to_string();
            assert!(said.contains(word) && said.contains("default.toml"), "{said}");
        }
    }
}
