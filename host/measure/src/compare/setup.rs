//! The camera file of a comparison: where the lamps stood, what is known of the camera, what is white.
//!
//! TOML, unknown keys are errors. Lengths are millimetres in the frame of the sheet: the origin is the middle of its camera
//! marks, x points right, y up, z out of the print toward camera and lamps.

use std::path::Path;

use serde::Deserialize;

use crate::MeasureError;
use crate::setup::parsed;

/// The version of the format: a number so that a later program can tell.
const FORMAT: u32 = 1;
/// Farthest that cameras and lamps may be, in mm: a hundred metres, so that a wrong unit would be an error.
const FARTHEST: f64 = 100_000.0;

/// What the camera file says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompareSetup {
    /// Version of the format: 1.
    pub format: u32,
    /// What is known of the camera; the marks tell the rest.
    #[serde(default)]
    pub camera: Camera,
    /// The lamps, one at a time.
    #[serde(default)]
    pub light: Vec<Light>,
    /// What sets exposure and white balance.
    #[serde(default)]
    pub white: White,
    /// The grey card, where it is what is white.
    #[serde(default)]
    pub card: Card,
    /// Whether values are proportional to light [default: those of 16 bits and OpenEXR are, those of 8 bits are not].
    pub linear: Option<bool>,
}

/// What is known of the camera.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Angle of view across the picture's width [default: from the EXIF focal length for 35 mm film, else solved].
    pub field_of_view_deg: Option<f64>,
    /// Where the camera stood, if it stood in one place [default: solved].
    pub position_mm: Option<[f64; 3]>,
    /// How far from there it may have been.
    pub tolerance_mm: Option<f64>,
}

/// A lamp.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where it is.
    pub position_mm: [f64; 3],
    /// Beginning of the names of the photographs taken with it. Needed for several lamps.
    #[serde(default)]
    pub photos: String,
}

/// What sets exposure and white balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum White {
    /// The bare paper around the marks, whose curve the library has.
    #[default]
    Paper,
    /// A three-step grey card in the sheet's plane.
    Card,
}

/// The three-step grey card.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Card {
    /// Left, top, right, bottom of the three steps together [default: it is looked for].
    pub rectangle_px: Option<[f64; 4]>,
    /// Reflectance of the steps, from left to right or from top to bottom.
    pub reflectance: [f64; 3],
}

impl Default for Card {
    fn default() -> Card {
        Card { rectangle_px: None, reflectance: [0.9, 0.18, 0.036] }
    }
}

impl CompareSetup {
    /// Reads and checks a camera file.
    ///
    /// # Errors
    /// The field, what was found and what to do.
    pub fn read(path: &Path) -> Result<CompareSetup, MeasureError> {
        parsed(path, "a camera file", CompareSetup::parse)
    }

    /// Reads and checks the text of a camera file.
    ///
    /// # Errors
    /// The field, what was found and what to do.
    pub fn parse(text: &str) -> Result<CompareSetup, String> {
        let setup: CompareSetup =
            toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        setup.check()?;
        Ok(setup)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("format: {}, but this program reads {FORMAT}", self.format));
        }
        if self.light.is_empty() {
            return Err(
                "no [[light]]; say where the lamp stood, such as position_mm = [-250, 300, 500]".into()
            );
        }
        let place = |field: &str, p: [f64; 3]| -> Result<(), String> {
            if !p.iter().all(|v| v.is_finite() && v.abs() <= FARTHEST) {
                return Err(format!(
                    "{field}: {p:?} is not a place; expected x, y and z in mm, each at most {FARTHEST} from 0"
                ));
            }
            if p[2] < 1.0 {
                return Err(format!(
                    "{field}: z = {} mm is behind the sheet or in it; z points out of the print, so it must be above 0",
                    p[2]
                ));
            }
            Ok(())
        };
        for (i, light) in self.light.iter().enumerate() {
            place(&format!("light {}: position_mm", i + 1), light.position_mm)?;
            let twice = self.light[..i].iter().any(|other| other.photos == light.photos);
            if self.light.len() > 1 && (light.photos.is_empty() || twice) {
                return Err(format!(
                    "light {}: photos = {:?}; with several lamps, each needs the beginning of the names of its photographs, such as \
                     photos = \"left-\"",
                    i + 1,
                    light.photos
                ));
            }
        }
        let Camera { field_of_view_deg, position_mm, tolerance_mm } = self.camera;
        if let Some(angle) = field_of_view_deg
            && !(1.0..=150.0).contains(&angle)
        {
            return Err(format!(
                "camera.field_of_view_deg: {angle}; expected the angle across the width of a photograph, 1 to 150 degrees"
            ));
        }
        if let Some(p) = position_mm {
            place("camera.position_mm", p)?;
        }
        if tolerance_mm.is_some() && position_mm.is_none() {
            return Err("camera.tolerance_mm: it says how far camera.position_mm may be off, so state camera.position_mm too".into());
        }
        if let Some(tolerance) = tolerance_mm
            && !(0.01..=1000.0).contains(&tolerance)
        {
            return Err(format!("camera.tolerance_mm: {tolerance}; expected 0.01 to 1000 mm"));
        }
        let mut steps = self.card.reflectance;
        steps.sort_by(f64::total_cmp);
        if !(steps[0] > 0.0 && steps[2] <= 1.0 && steps[0] < 0.7 * steps[1] && steps[1] < 0.7 * steps[2]) {
            return Err(format!(
                "card.reflectance: {:?}; expected three different reflectances between 0 and 1, such as [0.9, 0.18, 0.036]",
                self.card.reflectance
            ));
        }
        if let Some(r) = self.card.rectangle_px
            && !(r.iter().all(|v| v.is_finite() && *v >= 0.0) && r[0] < r[2] && r[1] < r[3])
        {
            return Err(format!("card.rectangle_px: {r:?}; expected left, top, right, bottom in pixels"));
        }
        Ok(())
    }

    /// The lamp of a photograph, by its name.
    pub(crate) fn light_of(&self, name: &str) -> Option<usize> {
        match &self.light[..] {
            [_] if self.light[0].photos.is_empty() => Some(0),
            // The longest beginning fits best: `left-` and `left-low-`.
            all => (0..all.len())
                .filter(|&i| name.starts_with(&all[i].photos))
                .max_by_key(|&i| all[i].photos.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAMP: &str = "[[light]]\nposition_mm = [-250, 300, 500]\n";

    #[test]
    fn wrong_fields_are_named_with_what_to_do() {
        assert!(CompareSetup::parse(&format!("format = 1\n{LAMP}")).is_ok());
        for (text, words) in [
            (format!("format = 2\n{LAMP}"), "format: 2"),
            ("format = 1".into(), "position_mm"),
            ("format = 1\n[[light]]\nposition_mm = [0, 0, -500]".into(), "behind the sheet"),
            ("format = 1\n[[light]]\nposition_mm = [0, nan, 500]".into(), "not a place"),
            ("format = 1\n[[light]]\nposition_mm = [0, 1e9, 500]".into(), "not a place"),
            (format!("format = 1\n{LAMP}{LAMP}"), "photos"),
            (
                format!("format = 1\n[camera]\nposition_mm = [0, 0, -400]\n{LAMP}"),
                "camera.position_mm: z = -400",
            ),
            (format!("format = 1\n[camera]\nposition_mm = [inf, 0, 400]\n{LAMP}"), "camera.position_mm"),
            (format!("format = 1\n[camera]\nfield_of_view_deg = nan\n{LAMP}"), "field_of_view_deg"),
            (format!("format = 1\n[camera]\ntolerance_mm = 4\n{LAMP}"), "tolerance_mm"),
            (format!("format = 1\nlamp = 3\n{LAMP}"), "unknown field"),
            (format!("format = 1\n[card]\nreflectance = [0.9, 0.9, 0.1]\n{LAMP}"), "card.reflectance"),
            (format!("format = 1\n[card]\nrectangle_px = [9, 9, 1, 1]\n{LAMP}"), "card.rectangle_px"),
        ] {
            let said = CompareSetup::parse(&text).unwrap_err();
            assert!(said.contains(words), "{text}\n{said}");
        }
    }

    #[test]
    fn the_longest_beginning_names_the_lamp() {
        let text = "format = 1\n[[light]]\nposition_mm = [1, 1, 500]\nphotos = \"left\"\n[[light]]\nposition_mm = [2, 2, 500]\nphotos = \"left-low\"\n";
        let setup = CompareSetup::parse(text).unwrap();
        assert_eq!(setup.light_of("left-1.png"), Some(0));
        assert_eq!(setup.light_of("left-low-1.png"), Some(1));
        assert_eq!(setup.light_of("right.png"), None);
    }
}
