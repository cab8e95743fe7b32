//! The setup file: who measured, what stood where, and what lies where in the picture.
//!
//! TOML, unknown keys are errors. Lengths are millimetres in a frame whose origin is the middle of the sample: on the axis of the
//! can, or on the sheet. x points right, y up, z to the camera. Positions in the picture are pixels from its top left corner.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use inks::Stack;
use serde::Deserialize;

use crate::MeasureError;

/// The version of the format: a number so that a later program can tell.
const FORMAT: u32 = 1;
/// The largest setup file in bytes: people write them by hand; few enough for hostile files.
const MOST_BYTES: u64 = 1 << 20;

/// What the setup file says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Version of the format: 1.
    pub format: u32,
    /// Who measured.
    pub by: String,
    /// When, as `YYYY-MM-DD` or `YYYY-MM`.
    pub when: String,
    /// Paper, lamp, camera: anything else needed to repeat the measurement.
    #[serde(default)]
    pub note: String,
    /// Whether the geometry is exact, or measured with a tape and to be corrected from the pictures.
    #[serde(default)]
    pub geometry: Trust,
    /// The camera.
    pub camera: Camera,
    /// The lamps, one after the other.
    #[serde(default)]
    pub light: Vec<Light>,
    /// What the print lies on.
    pub sample: Sample,
    /// The grey card.
    #[serde(default)]
    pub card: Card,
    /// The stacks.
    #[serde(default)]
    pub patch: Vec<Patch>,
    /// Exposure times in seconds by file name, for files without EXIF.
    #[serde(default)]
    pub exposures: BTreeMap<String, f64>,
    /// The photographs as files.
    #[serde(default)]
    pub photos: Photos,
}

/// Whether positions are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Trust {
    /// As measured with a tape, within the tolerances.
    #[default]
    Solved,
    /// Exact.
    Known,
}

/// The camera.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where its lens is.
    pub position_mm: [f64; 3],
    /// What is in the middle of the picture.
    #[serde(default)]
    pub look_at_mm: [f64; 3],
    /// What is up in the picture.
    #[serde(default = "up")]
    pub up: [f64; 3],
    /// Angle of view across the picture's width; otherwise from the EXIF focal length for 35 mm film.
    pub field_of_view_deg: Option<f64>,
}

/// A lamp.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Where it is.
    pub position_mm: [f64; 3],
    /// How far from there it may be.
    #[serde(default = "light_tolerance")]
    pub tolerance_mm: f64,
    /// How wide its bright part is.
    #[serde(default)]
    pub diameter_mm: f64,
    /// Beginning of the names of the photographs taken with it. Needed for several lamps.
    #[serde(default)]
    pub photos: String,
}

/// The shape of the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleShape {
    /// Wrapped round a can.
    Cylinder,
    /// A flat sheet.
    Flat,
}

/// What the print lies on.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Its shape.
    pub shape: SampleShape,
    /// Radius of the can with the print on it.
    pub radius_mm: Option<f64>,
    /// How far the radius may be off [default: 1.5 %].
    pub radius_tolerance_mm: Option<f64>,
    /// How far the sample may be tilted against what is said here.
    #[serde(default = "tilt_tolerance")]
    pub tilt_tolerance_deg: f64,
    /// Its middle.
    #[serde(default)]
    pub centre_mm: [f64; 3],
    /// How far its middle may be off.
    #[serde(default = "centre_tolerance")]
    pub centre_tolerance_mm: f64,
    /// The can's axis, or the direction of the sheet that is up.
    #[serde(default = "up")]
    pub axis: [f64; 3],
    /// Length of the print along the axis.
    pub height_mm: f64,
    /// Width of a flat print.
    pub width_mm: Option<f64>,
    /// The stack, if the whole print is of one.
    pub stack: Option<Stack>,
    /// The job or sheet of the chart of stacks that lies on it, beside the setup file: its marks tell where the stacks are.
    pub chart: Option<PathBuf>,
}

/// The three-step grey card.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Card {
    /// Left, top, right, bottom of the three steps together [default: it is looked for].
    pub rectangle_px: Option<[f64; 4]>,
    /// Reflectance of the steps, from left to right or from top to bottom.
    pub reflectance: [f64; 3],
    /// A point of the plane it stands in [default: the middle of the sample].
    pub position_mm: Option<[f64; 3]>,
    /// Where it faces [default: the camera].
    pub normal: Option<[f64; 3]>,
}

impl Default for Card {
    fn default() -> Card {
        Card { rectangle_px: None, reflectance: [0.9, 0.18, 0.036], position_mm: None, normal: None }
    }
}

/// A stack in the picture.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Patch {
    /// Its inks from the bottom up.
    pub stack: Stack,
    /// Left, top, right, bottom.
    pub rectangle_px: [f64; 4],
}

/// The files.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Photos {
    /// Whether values are proportional to light [default: those of 16 bits and OpenEXR are, those of 8 bits are not].
    pub linear: Option<bool>,
    /// Photograph of an evenly lit white surface, beside the setup file.
    pub flat_field: Option<PathBuf>,
    /// Photograph with the lens covered, beside the setup file.
    pub dark_frame: Option<PathBuf>,
    /// Photograph with the lamp off and all else as it was, beside the setup file.
    pub lamp_off: Option<PathBuf>,
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn light_tolerance() -> f64 {
    15.0
}

fn tilt_tolerance() -> f64 {
    1.0
}

fn centre_tolerance() -> f64 {
    2.0
}

/// Reads a file of at most [`MOST_BYTES`] bytes and parses its text; `kind` is what was expected.
pub(crate) fn parsed<T>(
    path: &Path,
    kind: &str,
    parse: impl FnOnce(&str) -> Result<T, String>,
) -> Result<T, MeasureError> {
    let io = |source| MeasureError::Io { path: path.to_path_buf(), source };
    let wrong = |problem| MeasureError::Setup { path: path.to_path_buf(), problem };
    if std::fs::metadata(path).map_err(io)?.len() > MOST_BYTES {
        return Err(wrong(format!("longer than {MOST_BYTES} bytes; expected {kind} in TOML")));
    }
    parse(&std::fs::read_to_string(path).map_err(io)?).map_err(wrong)
}

impl Setup {
    /// Reads and checks a setup file. Files that it names are beside it.
    ///
    /// # Errors
    /// The field, what was found and what to do.
    pub fn read(path: &Path) -> Result<Setup, MeasureError> {
        let mut setup = parsed(path, "a setup file", Setup::parse)?;
        let beside = path.parent().unwrap_or(Path::new(""));
        let photos = &mut setup.photos;
        let files =
            [&mut photos.flat_field, &mut photos.dark_frame, &mut photos.lamp_off, &mut setup.sample.chart];
        for file in files.into_iter().flatten() {
            *file = beside.join(&*file);
        }
        Ok(setup)
    }

    /// Reads and checks the text of a setup file.
    ///
    /// # Errors
    /// The field, what was found and what to do.
    pub fn parse(text: &str) -> Result<Setup, String> {
        let setup: Setup = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        setup.check()?;
        Ok(setup)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("format: version {}; expected version {FORMAT}", self.format));
        }
        for (name, text) in [("by", &self.by), ("when", &self.when)] {
            if text.trim().is_empty() {
                return Err(format!("{name}: is empty; a measurement needs who and when"));
            }
        }
        let date = self.when.split('-').map(str::parse::<u32>).collect::<Result<Vec<_>, _>>();
        let date = date.unwrap_or_default();
        let in_range = |part: usize, range: std::ops::RangeInclusive<u32>| {
            date.get(part).is_some_and(|n| range.contains(n))
        };
        let day = date.len() == 2 || date.len() == 3 && in_range(2, 1..=31);
        if !(day && in_range(0, 1990..=9999) && in_range(1, 1..=12)) {
            return Err(format!("when: `{}` is not a date; expected YYYY-MM-DD or YYYY-MM", self.when));
        }
        self.check_lengths()?;
        self.check_lights()?;
        for (i, reflectance) in self.card.reflectance.iter().enumerate() {
            if !(1e-3..=1.0).contains(reflectance) {
                return Err(format!(
                    "card.reflectance: step {} is {reflectance}; expected 0.001 to 1",
                    i + 1
                ));
            }
        }
        let rectangles =
            self.patch.iter().map(|patch| (format!("patch {}", patch.stack), patch.rectangle_px));
        for (name, [left, top, right, bottom]) in
            rectangles.chain(self.card.rectangle_px.map(|at| ("card".to_owned(), at)))
        {
            if !(left >= 0.0 && top >= 0.0 && right > left && bottom > top && right.max(bottom) < 1e6) {
                return Err(format!(
                    "{name}: rectangle_px {left}, {top}, {right}, {bottom}; expected left, top, right, bottom in pixels"
                ));
            }
        }
        match (&self.sample.stack, self.patch.is_empty(), &self.sample.chart) {
            (None, true, None) => Err(
                "sample.stack: missing; name the stack of the whole print, its chart (sample.chart), or add a [[patch]] for each"
                    .to_owned(),
            ),
            (Some(_), false, _) => Err("sample.stack: given beside [[patch]]; keep one of them".to_owned()),
            (Some(_), _, Some(_)) | (_, false, Some(_)) => {
                Err("sample.chart: given beside sample.stack or [[patch]]; keep one of them".to_owned())
            }
            _ => Ok(()),
        }
    }

    fn check_lengths(&self) -> Result<(), String> {
        let positive = |name: &str, value: f64, most: f64| {
            if value.is_finite() && value > 0.0 && value <= most {
                return Ok(());
            }
            Err(format!("{name}: {value}; expected more than 0 and at most {most}"))
        };
        positive("sample.height_mm", self.sample.height_mm, 1e4)?;
        match (self.sample.shape, self.sample.radius_mm, self.sample.width_mm) {
            (SampleShape::Cylinder, Some(radius), None) => positive("sample.radius_mm", radius, 1e4)?,
            (SampleShape::Flat, None, Some(width)) => positive("sample.width_mm", width, 1e4)?,
            (SampleShape::Cylinder, ..) => {
                return Err("sample: a cylinder needs radius_mm and has no width_mm".to_owned());
            }
            (SampleShape::Flat, ..) => {
                return Err("sample: a flat sheet needs width_mm and has no radius_mm".to_owned());
            }
        }
        if let Some(angle) = self.camera.field_of_view_deg {
            positive("camera.field_of_view_deg", angle, 150.0)?;
        }
        for (name, tolerance) in [
            ("sample.radius_tolerance_mm", self.sample.radius_tolerance_mm.unwrap_or(1.0)),
            ("sample.tilt_tolerance_deg", self.sample.tilt_tolerance_deg),
            ("sample.centre_tolerance_mm", self.sample.centre_tolerance_mm),
        ] {
            positive(name, tolerance, 100.0)?;
        }
        let vectors = [
            ("camera.position_mm", self.camera.position_mm),
            ("camera.look_at_mm", self.camera.look_at_mm),
            ("camera.up", self.camera.up),
            ("sample.centre_mm", self.sample.centre_mm),
            ("sample.axis", self.sample.axis),
            ("card.position_mm", self.card.position_mm.unwrap_or_default()),
            ("card.normal", self.card.normal.unwrap_or_default()),
        ];
        match vectors.iter().find(|(_, v)| v.iter().any(|v| !v.is_finite() || v.abs() > 1e5)) {
            Some((name, v)) => Err(format!("{name}: {v:?}; expected three numbers within 100 m")),
            None => Ok(()),
        }
    }

    fn check_lights(&self) -> Result<(), String> {
        if self.light.is_empty() || self.light.len() > 64 {
            return Err(format!("light: {} lamps; expected 1 to 64 tables [[light]]", self.light.len()));
        }
        for (i, light) in self.light.iter().enumerate() {
            let bad = light.position_mm.iter().any(|v| !v.is_finite() || v.abs() > 1e5);
            if bad || !(0.0..=1e3).contains(&light.diameter_mm) || !(1e-6..=1e3).contains(&light.tolerance_mm)
            {
                return Err(format!(
                    "light {}: expected lengths in millimetres and a tolerance above 0",
                    i + 1
                ));
            }
            let others = self.light.iter().enumerate().filter(|(j, _)| *j != i);
            if let Some((j, _)) =
                others.into_iter().find(|(_, other)| other.photos.starts_with(&light.photos))
            {
                return Err(format!(
                    "light {}: photos `{}` also begins the names of light {}; give each lamp a beginning of its own",
                    i + 1,
                    light.photos,
                    j + 1
                ));
            }
        }
        Ok(())
    }

    /// The setup in a sentence, for provenance.
    pub fn sentence(&self) -> String {
        let sample = match (self.sample.shape, self.sample.radius_mm) {
            (SampleShape::Cylinder, Some(radius)) => format!("bent round a cylinder of {radius} mm radius"),
            _ => "flat".to_owned(),
        };
        let lamps =
            if self.light.len() == 1 { "one lamp".into() } else { format!("{} lamps", self.light.len()) };
        let note = if self.note.is_empty() { String::new() } else { format!("; {}", self.note) };
        format!("photographs of the print {sample}, {lamps}, three-step grey card in the picture{note}")
    }

    /// The field of view across a picture of this size in radians.
    pub(crate) fn field_of_view(
        &self,
        film_focal_mm: Option<f64>,
        (width, height): (usize, usize),
    ) -> Result<f64, MeasureError> {
        // Equivalents of 35 mm film are by the diagonal (CIPA DC-008), 43.27 mm of 36 x 24, whatever the picture's shape.
        let (width, height) = (width as f64, height as f64);
        let across = 36f64.hypot(24.0) * width / width.hypot(height);
        let angle = self.camera.field_of_view_deg.map(|degrees| degrees * PI / 180.0);
        angle.or(film_focal_mm.map(|focal| 2.0 * (0.5 * across / focal).atan())).ok_or_else(|| {
            MeasureError::Scene(
                "the photographs do not say the focal length; add camera.field_of_view_deg to the setup file"
                    .into(),
            )
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const CAN: &str = r#"
format = 1
by = "A. Owner"
when = "2026-11-02"
[camera]
position_mm = [0, 0, 1200]
field_of_view_deg = 14.0
[[light]]
position_mm = [350, 100, 900]
[sample]
shape = "cylinder"
radius_mm = 50
height_mm = 120
stack = "MS+C"
"#;

    #[test]
    fn the_example_of_the_guide_is_a_setup() {
        let guide = include_str!("../../../docs/measuring-inks.md");
        let example = guide.split("```toml setup\n").nth(1).unwrap().split("```").next().unwrap();
        let setup = Setup::parse(example).unwrap();
        assert_eq!(setup.sample.chart.as_deref(), Some(Path::new("stacks.rgl")));
        // The other way: a table for each stack.
        let patch = guide.split("[[patch]]\n").nth(1).unwrap().split("```").next().unwrap();
        let other = example.replace("chart = \"stacks.rgl\"", "") + "[[patch]]\n" + patch;
        assert_eq!(Setup::parse(&other).unwrap().patch.len(), 1);
    }

    #[test]
    fn a_short_file_is_enough_and_says_how_it_was_measured() {
        let setup = Setup::parse(CAN).unwrap();
        assert_eq!((setup.geometry, setup.card.reflectance), (Trust::Solved, [0.9, 0.18, 0.036]));
        assert!(setup.sentence().contains("cylinder of 50 mm"), "{}", setup.sentence());
    }

    #[test]
    fn each_wrong_field_is_named() {
        for (from, to, named) in [
            ("format = 1", "format = 2", "version 2"),
            ("by = \"A. Owner\"", "by = \" \"", "by: is empty"),
            ("2026-11-02", "yesterday", "yesterday"),
            ("radius_mm = 50", "radius_mm = -50", "radius_mm: -50"),
            ("radius_mm = 50", "width_mm = 50", "needs radius_mm"),
            ("radius_mm = 50", "radius = 50", "radius"),
            ("stack = \"MS+C\"", "", "sample.stack: missing"),
            (
                "stack = \"MS+C\"",
                "stack = \"C\"\nchart = \"c.rgl\"",
                "sample.chart: given beside sample.stack",
            ),
            ("height_mm = 120", "height_mm = nan", "height_mm"),
            ("14.0", "1e9", "field_of_view_deg"),
            ("[[light]]\nposition_mm = [350, 100, 900]", "", "0 lamps"),
            ("[sample]", "[[light]]\nposition_mm = [1, 2, 3]\n[sample]", "beginning of its own"),
            ("[sample]", "[card]\nreflectance = [0.9, 18, 0.036]\n[sample]", "step 2 is 18"),
            ("[sample]", "[card]\nrectangle_px = [9, 9, 3, 20]\n[sample]", "left, top, right, bottom"),
        ] {
            let error = Setup::parse(&CAN.replace(from, to)).unwrap_err();
            assert!(error.contains(named), "{to}: {error}");
        }
    }

    /// 144 mm across a film of 24 mm is 9.53 degrees by hand; 4:3 is 34.6 mm across.
    #[test]
    fn focal_lengths_for_film_are_by_the_diagonal() {
        let setup = Setup::parse(&CAN.replace("field_of_view_deg = 14.0", "")).unwrap();
        for (size, focal, degrees) in
            [((900, 1350), 144.0, 9.53), ((1350, 900), 144.0, 14.25), ((4000, 3000), 50.0, 38.18)]
        {
            let found = setup.field_of_view(Some(focal), size).unwrap().to_degrees();
            assert!((found - degrees).abs() < 0.01, "{size:?}: {found}");
        }
        assert!(setup.field_of_view(None, (4, 3)).is_err());
    }
}
