//! Photographs of a printed sheet beside what was predicted of it.
//!
//! In the order of the data: [`Setup`] says where lamps stood; `sheet` finds the camera marks of the dots that were printed, and
//! [`crate::marks`] those of each photograph, which says whether it shows this sheet; [`crate::camera`] solves for lens and
//! poses; the paper around the marks, or a grey card, gives exposure and white balance; `picture` lays the
//! photograph flat; `scenery` shows document, mixture and dots from the same place under the same lamp; `figures` compares them,
//! and [`page`] shows all of it.
//! Limits: a flat sheet; one lamp at a time, which is a point; no light from elsewhere, which looks like an error of the inks.

mod figures;
mod flat;
pub mod page;
pub(crate) mod picture;
mod scenery;
mod setup;
pub(crate) mod sheet;

use std::path::{Path, PathBuf};

use appearance::brdf::Space;
use appearance::factor::Factored;
use inks::Library;
use observe::Observer;
use press::sheet::{Area, DotMap};
use serde::Serialize;

pub use figures::{Errors, Factor};
pub use setup::{Card, Setup, White};

use crate::MeasureError;
use crate::camera::{self, Camera, Known, Seen};
use crate::marks::Mark;
use crate::photo;
use picture::Picture;
use scenery::Scenery;
use sheet::Marks;

/// Corners that lie farther than this from where a flat sheet has them, in pixels and in picture widths, are not on one.
const MOST_RESIDUAL: (f64, f64) = (1.0, 6e-4);
/// A deviation of the paper at one mark from the lamp's fall-off that is worth a warning.
const UNEVEN: f64 = 0.05;
/// A standard error of the camera's position, in mm, that is worth a warning.
const UNSURE: f64 = 3.0;
/// The most photographs of a comparison.
const MOST_PHOTOS: usize = 64;

/// What was printed, and of what.
pub struct Printed<'a> {
    /// The dots of the whole sheet, marks included.
    pub sheet: &'a DotMap,
    /// The library that predicts them.
    pub library: &'a Library,
    /// The document, where there is one.
    pub document: Option<Document<'a>>,
}

/// The tabulation of stacks: so fine that reading between its angles is exact to a thousandth, as a document's own is not.
pub fn space() -> Space {
    Space::half_angle(512)
}

/// A document and where it is on the sheet.
pub struct Document<'a> {
    /// The document.
    pub document: &'a Factored,
    /// Its mixture of stacks, tabulated as [`space`] says.
    pub mapped: &'a Factored,
    /// One copy of it.
    pub area: Area,
}

/// A comparison: figures that do not depend on pictures.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Whether there is a document to compare with.
    pub document: bool,
    /// Middle and size of what was compared, in mm of the sheet's frame.
    pub middle_mm: [f64; 2],
    /// Its size.
    pub size_mm: [f64; 2],
    /// The lens.
    pub lens: LensFigures,
    /// Each photograph.
    pub photos: Vec<PhotoFigures>,
    /// Root mean square of the photographs' errors.
    pub errors: Errors,
    /// What is doubtful, and what to do.
    pub warnings: Vec<String>,
}

/// The lens as solved.
#[derive(Clone, Debug, Serialize)]
pub struct LensFigures {
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Its relative standard error.
    pub focal_error: f64,
    /// Angle of view across the width.
    pub field_of_view_deg: f64,
    /// Radial terms over the distance from the middle in focal lengths.
    pub radial: [f64; 2],
}

/// One photograph.
#[derive(Clone, Debug, Serialize)]
pub struct PhotoFigures {
    /// File name.
    pub name: String,
    /// Marks that were found.
    pub marks: usize,
    /// Where the camera was, in mm of the sheet's frame.
    pub camera_mm: [f64; 3],
    /// Its standard error.
    pub camera_error_mm: f64,
    /// The camera's axes right, down and forward, on the sheet.
    pub camera_axes: [[f64; 3]; 3],
    /// Distance of the marks' corners from where they should be, in pixels.
    pub residual_px: f64,
    /// Where the lamp was.
    pub light_mm: [f64; 3],
    /// Angle of incidence, angle to the camera and half angle in the middle, in degrees.
    pub angles_deg: [f64; 3],
    /// Least and largest half angle.
    pub half_angles_deg: [f64; 2],
    /// Factor from the file's values, 0 to 1, to radiance under irradiance 1.
    pub scale: [f64; 3],
    /// How far the paper at the marks deviates from the lamp's fall-off.
    pub paper_deviation: f64,
    /// Share of the compared spots that were seen and not clipped.
    pub seen: f64,
    /// Errors.
    pub errors: Errors,
    /// Stacks that are brighter or darker than the library says.
    pub stacks: Vec<Factor>,
}

/// The pictures of one photograph, laid flat, as JPEG.
pub struct Pictures {
    /// The photograph.
    pub photo: Vec<u8>,
    /// The predicted print.
    pub print: Vec<u8>,
    /// The document and its mixture of stacks.
    pub document: Option<(Vec<u8>, Vec<u8>)>,
    /// Photograph against print.
    pub difference: Vec<u8>,
}

/// A photograph that shows the sheet. It is read again to be compared, so that many do not fill the memory.
struct Shot {
    path: PathBuf,
    name: String,
    light: usize,
    size: (usize, usize),
    bent: bool,
    marks: Vec<(Mark, sheet::Printed)>,
}

/// Compares the photographs in a folder with what was printed.
///
/// # Errors
/// Photographs that cannot be read, do not show the sheet, differ in size or are too bright; a sheet without marks.
pub fn compare(
    folder: &Path,
    setup: &Setup,
    printed: &Printed<'_>,
    observer: &dyn Observer,
) -> Result<(Comparison, Vec<Pictures>), MeasureError> {
    let sheet = Marks::of(printed.sheet, printed.library)?;
    let paths = photo::list(folder)?;
    if paths.len() > MOST_PHOTOS {
        return Err(MeasureError::Scene(format!(
            "{}: {} photographs; compare at most {MOST_PHOTOS} at a time",
            folder.display(),
            paths.len()
        )));
    }
    observer.begin("finding marks", paths.len() as u64);
    let mut shots: Vec<Shot> = Vec::new();
    for path in &paths {
        let shot = read(path, setup, &sheet)?;
        if let Some(first) = shots.first()
            && first.size != shot.size
        {
            let problem = format!(
                "{} x {} pixels, but {} has {} x {}; photographs of one comparison are from one camera, held the same way and \
                 not cropped",
                shot.size.0, shot.size.1, first.name, first.size.0, first.size.1
            );
            return Err(MeasureError::photo(path, problem));
        }
        shots.push(shot);
        observer.advance(1);
    }
    observer.end();
    let camera = solved(&paths[0], setup, &shots)?;
    let area = printed.document.as_ref().map_or(sheet.between, |document| document.area);
    let (middle, size) = sheet.area(area);
    let mut warnings = Vec::new();
    if let Some(worst) = camera.uncertain_mm.iter().copied().reduce(f64::max).filter(|worst| *worst > UNSURE)
    {
        warnings.push(format!(
            "the camera's place is uncertain by {worst:.0} mm; tilt the sheet or the camera in some photographs, or give \
             camera.field_of_view_deg"
        ));
    }
    let bent = shots.iter().filter(|shot| shot.bent).count();
    if bent > 0 {
        warnings.push(format!(
            "{bent} of {} photographs have 8 bits, whose tones are taken for sRGB; cameras bend them further, so errors of some per cent \
             and the factors of dark stacks may be the camera's; photograph in RAW or 16 bits, or state linear in the camera file",
            shots.len()
        ));
    }
    let scenery = Scenery::new(printed, area, middle, size, &shots[0], &camera)?;
    observer.begin("comparing", shots.len() as u64);
    let (mut photos, mut pictures) = (Vec::new(), Vec::new());
    for (i, shot) in shots.iter().enumerate() {
        let (figures, drawn) = scenery.compared(shot, i, &camera, setup, observer)?;
        if figures.paper_deviation > UNEVEN {
            warnings.push(format!(
                "{}: the paper at the marks is off by up to {:.0} % from the fall-off of lamp {}; check its position_mm, and that no \
                 other light falls on the sheet",
                shot.name,
                100.0 * figures.paper_deviation,
                shot.light + 1
            ));
        }
        if figures.seen < 0.9 {
            warnings.push(format!(
                "{}: {:.0} % of the print is clipped or outside the picture and was left out; expose shorter, or show all of it",
                shot.name,
                100.0 * (1.0 - figures.seen)
            ));
        }
        photos.push(figures);
        pictures.push(drawn);
        observer.advance(1);
    }
    observer.end();
    let lens = LensFigures {
        focal_px: camera.lens.focal,
        focal_error: camera.uncertain_focal,
        field_of_view_deg: 2.0 * (camera.lens.middle[0] / camera.lens.focal).atan().to_degrees(),
        radial: camera.lens.radial,
    };
    let errors = together(&photos);
    let comparison = Comparison {
        document: printed.document.is_some(),
        middle_mm: middle,
        size_mm: size,
        lens,
        photos,
        errors,
        warnings,
    };
    Ok((comparison, pictures))
}

/// Root mean squares over photographs.
fn together(photos: &[PhotoFigures]) -> Errors {
    let mean = |of: &dyn Fn(&Errors) -> Option<f64>| -> Option<f64> {
        let all: Option<Vec<f64>> = photos.iter().map(|photo| of(&photo.errors)).collect();
        all.map(|all| (all.iter().map(|v| v * v).sum::<f64>() / all.len().max(1) as f64).sqrt())
    };
    let plain = |of: &dyn Fn(&Errors) -> f64| mean(&|e: &Errors| Some(of(e))).unwrap_or(0.0);
    Errors {
        total: plain(&|e| e.total),
        gamut: mean(&|e| e.gamut),
        halftone: mean(&|e| e.halftone),
        print: plain(&|e| e.print),
        inks: plain(&|e| e.inks),
        rest: plain(&|e| e.rest),
    }
}

/// Reads a photograph and finds the sheet's marks in it.
fn read(path: &Path, setup: &Setup, sheet: &Marks) -> Result<Shot, MeasureError> {
    let wrong = |problem: String| Err(MeasureError::photo(path, problem));
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let Some(light) = setup.light_of(&name) else {
        return wrong(format!(
            "no lamp of the camera file has photographs that begin so; add a [[light]] with photos = \"{}\"",
            name.split(['-', '.']).next().unwrap_or_default()
        ));
    };
    let picture = Picture::read(path, setup.linear)?;
    let marks = sheet.seen(path, &picture.grey())?;
    Ok(Shot {
        path: path.to_path_buf(),
        name,
        light,
        size: (picture.width, picture.height),
        bent: picture.bent,
        marks,
    })
}

/// Solves for the camera.
fn solved(first: &Path, setup: &Setup, shots: &[Shot]) -> Result<Camera, MeasureError> {
    let (width, height) = shots[0].size;
    let seen: Vec<Vec<Seen>> = shots
        .iter()
        .map(|shot| {
            let corners = |(mark, known): &(Mark, sheet::Printed)| {
                let (mark, known) = (*mark, *known);
                (0..4).map(move |i| Seen { sheet: known.corners[i], pixel: mark.corners[i] })
            };
            shot.marks.iter().flat_map(corners).collect()
        })
        .collect();
    let focal_of = |degrees: f64| 0.5 * width as f64 / (0.5 * degrees).to_radians().tan();
    let focal = match setup.camera.field_of_view_deg {
        // Stated angles are of the lens when it is focused far away.
        Some(degrees) => Some((focal_of(degrees), 0.02)),
        // Film is 36 mm wide.
        None => photo::exif(first)?.film_focal_mm.map(|mm| (mm / 36.0 * width.max(height) as f64, 0.06)),
    };
    let known = Known {
        focal,
        position: setup.camera.position_mm.map(|at| (at, setup.camera.tolerance_mm.unwrap_or(20.0))),
    };
    let Some(camera) = camera::solve(&seen, (width, height), &known) else {
        return Err(MeasureError::Scene(
            "no camera explains where the marks are; check that the photographs are not mirrored or cropped, and that \
             camera.field_of_view_deg and camera.position_mm are right"
                .into(),
        ));
    };
    let most = MOST_RESIDUAL.0.max(MOST_RESIDUAL.1 * width as f64);
    for (shot, residual) in shots.iter().zip(&camera.residuals) {
        if *residual > most {
            return Err(MeasureError::Scene(format!(
                "{}: the marks are {residual:.1} pixels from where a flat sheet has them; lay the sheet flat, hold the camera still, and use \
                 one focal length for all photographs",
                shot.name
            )));
        }
    }
    Ok(camera)
}
