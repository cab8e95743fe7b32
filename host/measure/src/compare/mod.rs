//! Photographs of a printed sheet beside what was predicted of it.
//!
//! In the order of the data: [`CompareSetup`] says where lamps stood; `geometry::sheet_marks` finds the camera marks of the dots that were printed, and
//! [`geometry::marks`](crate::geometry::marks) those of each photograph, which says whether it shows this sheet; [`geometry::pose`](crate::geometry::pose) solves for lens and
//! poses; the paper around the marks, or a grey card, gives exposure and white balance; `picture` lays the
//! photograph flat; `blur` says how sharp it is; `scenery` shows document, mixture and dots from the same place under the same lamp;
//! `passes` finds which inks lie beside their place; `figures` compares, `doubts` thinks of the paper, and [`page`] shows all of it.
//! Limits: a flat sheet; one lamp at a time, which is a point; no light from elsewhere, which looks like an error of the inks.

mod blur;
mod comparison;
mod doubts;
mod figures;
mod flat;
mod inputs;
pub mod page;
mod passes;
pub(crate) mod picture;
mod scenery;
mod setup;

use std::path::Path;

use observe::Observer;

pub use comparison::{Comparison, LensFigures, PhotoFigures, Pictures};
pub use figures::{Errors, Factor};
pub use inputs::{ComparedDocument, ComparedPrint, space};
pub use passes::PassOff;
pub use setup::{Card, CompareSetup, White};

use crate::MeasureError;
use crate::camera::photo;
use crate::geometry::marks::Mark;
use crate::geometry::pose::{self, Known, MarkPoint, SolvedCamera};
use crate::geometry::sheet_marks::{PrintedMark, SheetMarks};
use inputs::SheetPhoto;
use picture::Picture;
use scenery::Scenery;

/// Corners that lie farther than this from where a flat sheet has them, in pixels and in picture widths, are not on one.
const MOST_RESIDUAL: (f64, f64) = (1.0, 6e-4);
/// A deviation of the paper at one mark from the lamp's fall-off that is worth a warning.
const UNEVEN: f64 = 0.05;
/// A standard error of the camera's position, in mm, that is worth a warning.
const UNSURE: f64 = 3.0;
/// The most photographs of a comparison: ten times as many as one needs, few enough for hostile setups.
const MOST_PHOTOS: usize = 64;

/// Compares the photographs in a folder with what was printed.
///
/// # Errors
/// Photographs that cannot be read, do not show the sheet, differ in size or are too bright; a sheet without marks.
pub fn compare(
    folder: &Path,
    setup: &CompareSetup,
    printed: &ComparedPrint<'_>,
    observer: &dyn Observer,
) -> Result<(Comparison, Vec<Pictures>), MeasureError> {
    let sheet = SheetMarks::find(printed.sheet, printed.library)?;
    let paths = photo::list(folder)?;
    if paths.len() > MOST_PHOTOS {
        return Err(MeasureError::Scene(format!(
            "{}: {} photographs; compare at most {MOST_PHOTOS} at a time",
            folder.display(),
            paths.len()
        )));
    }
    observer.begin("finding marks", paths.len() as u64);
    let mut shots: Vec<SheetPhoto> = Vec::new();
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
    let (mut looked, mut pictures) = (Vec::new(), Vec::new());
    for (i, shot) in shots.iter().enumerate() {
        let (look, drawn) = scenery.looked(shot, i, &camera, setup, observer)?;
        looked.push(look);
        pictures.push(drawn);
        observer.advance(1);
    }
    observer.end();
    let registration = scenery.registration(&shots, &looked);
    let passes = registration.as_ref().map_or_else(Vec::new, |found| found.named(&scenery.passes));
    if !passes.is_empty() {
        let all: Vec<String> = passes.iter().map(PassOff::words).collect();
        warnings.push(format!(
            "passes that are off: {} of the camera marks; stacks are compared where they lie",
            all.join("; ")
        ));
    }
    if scenery.passes.inks.is_empty() {
        warnings.push("passes that are off were not looked for: the sheet has more than 8 inks, or one that is printed twice".into());
    }
    let mut photos = Vec::new();
    for (i, shot) in shots.iter().enumerate() {
        let figures = scenery.compared(shot, i, &looked[i], &camera, registration.as_ref())?;
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
    }
    if setup.white == White::Paper {
        warnings.extend(doubts::of_paper(&photos));
    }
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
        passes,
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
fn read(path: &Path, setup: &CompareSetup, sheet: &SheetMarks) -> Result<SheetPhoto, MeasureError> {
    let wrong = |problem: String| Err(MeasureError::photo(path, problem));
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let Some(light) = setup.light_of(&name) else {
        return wrong(format!(
            "no lamp of the camera file has photographs that begin so; add a [[light]] with photos = \"{}\"",
            name.split(['-', '.']).next().unwrap_or_default()
        ));
    };
    let picture = Picture::read(path, setup.linear)?;
    let grey = picture.grey();
    let marks = sheet.seen(path, &grey)?;
    Ok(SheetPhoto {
        path: path.to_path_buf(),
        name,
        light,
        size: (picture.width, picture.height),
        bent: picture.bent,
        blur: blur::of_marks(&grey, &marks),
        marks,
    })
}

/// Solves for the camera.
fn solved(first: &Path, setup: &CompareSetup, shots: &[SheetPhoto]) -> Result<SolvedCamera, MeasureError> {
    let (width, height) = shots[0].size;
    let seen: Vec<Vec<MarkPoint>> = shots
        .iter()
        .map(|shot| {
            let corners = |(mark, known): &(Mark, PrintedMark)| {
                let (mark, known) = (*mark, *known);
                (0..4).map(move |i| MarkPoint { sheet: known.corners[i], pixel: mark.corners[i] })
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
    let Some(camera) = pose::solve(&seen, (width, height), &known) else {
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
