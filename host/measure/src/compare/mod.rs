//! Photographs of a printed sheet beside what was predicted of it.
//!
//! In the order of the data: [`Setup`] says where lamps stood; `sheet` finds the camera marks of the dots that were printed, and
//! [`crate::marks`] those of each photograph, which says whether it shows this sheet; [`crate::camera`] solves for lens and
//! poses; the paper around the marks, or a grey card, gives exposure and white balance; `picture` lays the
//! photograph flat; the renderer of `view` shows document, mixture and dots from the same place under the same lamp; `figures` compares them,
//! and [`page`] shows all of it.
//! Limits: a flat sheet; one lamp at a time, which is a point; no light from elsewhere, which looks like an error of the inks.

mod figures;
mod flat;
pub mod page;
pub(crate) mod picture;
mod setup;
pub(crate) mod sheet;

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use appearance::brdf::{Space, reflectances};
use appearance::factor::Factored;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use inks::{Curve, Library, Stack};
use observe::Observer;
use press::preview::{Exposure, Radiance, Source, picture as shown};
use press::sheet::{Area, DotMap};
use serde::Serialize;
use view::{Light, Lit, Renderer, Scene};

pub use figures::{Errors, Factor};
pub use setup::{Card, Setup, White};

use crate::MeasureError;
use crate::camera::{self, Camera, Known, Lens, Pose, Seen};
use crate::linear::median;
use crate::marks::Mark;
use crate::{card, photo};
use figures::{Cover, Lighting, Squares, Steps};
use flat::{Flat, Window};
use picture::Picture;
use sheet::Marks;

/// Corners that lie farther than this from where a flat sheet has them, in pixels and in picture widths, are not on one.
const MOST_RESIDUAL: (f64, f64) = (1.0, 6e-4);
/// A deviation of the paper at one mark from the lamp's fall-off that is worth a warning.
const UNEVEN: f64 = 0.05;
/// A standard error of the camera's position, in mm, that is worth a warning.
const UNSURE: f64 = 3.0;
/// The most photographs of a comparison.
const MOST_PHOTOS: usize = 64;
/// Quality of the pictures: differences of a percent stay visible.
const QUALITY: u8 = 88;
/// Full colour of the difference: this part of the mean light.
const DIFFERENCE: f64 = 0.3;

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
    /// Share of the compared squares that were seen and not clipped.
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
    Ok(Shot { path: path.to_path_buf(), name, light, size: (picture.width, picture.height), marks })
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

/// What is compared, prepared once for all photographs.
struct Scenery {
    window: Window,
    print: Lit,
    document: Option<(Lit, Lit)>,
    shares: Vec<f32>,
    stacks: Vec<(String, Curve)>,
    paper: Curve,
}

fn view_error(error: impl std::fmt::Display) -> MeasureError {
    MeasureError::Scene(error.to_string())
}

impl Scenery {
    fn new(
        printed: &Printed<'_>,
        area: Area,
        middle: [f64; 2],
        size: [f64; 2],
        shot: &Shot,
        camera: &Camera,
    ) -> Result<Scenery, MeasureError> {
        let Printed { sheet, library, document } = printed;
        let space = &space();
        // As fine as the photographs are.
        let seen = |mm: f64| {
            camera.lens.project(&camera.poses[0], [middle[0] + mm, middle[1], 0.0]).unwrap_or_default()
        };
        let (a, b) = (seen(-0.5), seen(0.5));
        let pixels = (a[0] - b[0]).hypot(a[1] - b[1]);
        if pixels < 1.0 {
            return Err(MeasureError::Scene(format!(
                "{}: a millimetre of the sheet is {pixels:.1} pixels; bring the camera nearer",
                shot.name
            )));
        }
        let window = Window::new(middle, size, pixels);
        let metres = size.map(|side| side / 1000.0);
        let rows = reflectances(sheet.stacks(), library, space);
        let source = Source::Print { dots: sheet, space, stacks: &rows, area };
        let longest = window.width.max(window.height).clamp(64, 2048);
        let lit = |source: &Source<'_>| Lit::new(source, metres, longest).map_err(view_error);
        let print = lit(&source)?;
        let document = document
            .as_ref()
            .map(|both| Ok((lit(&Source::Factored(both.document))?, lit(&Source::Factored(both.mapped))?)))
            .transpose()?;
        let [across, down] = window.squares;
        let shares = source.shares(across, down).map_err(view_error)?.unwrap_or_default();
        let stacks = sheet
            .stacks()
            .iter()
            .zip(rows.rows())
            .map(|(stack, row)| (stack.to_string(), space.curve(row)))
            .collect();
        let bare = reflectances(&[Stack::SUBSTRATE], library, space);
        let paper = space.curve(bare.row(0));
        Ok(Scenery { window, print, document, shares, stacks, paper })
    }

    fn compared(
        &self,
        shot: &Shot,
        number: usize,
        camera: &Camera,
        setup: &Setup,
        observer: &dyn Observer,
    ) -> Result<(PhotoFigures, Pictures), MeasureError> {
        let (pose, lens) = (&camera.poses[number], &camera.lens);
        let window = &self.window;
        let lamp = setup.light[shot.light].position_mm;
        let lighting = Lighting { eye: pose.position(), lamp, middle: window.middle };
        let picture = Picture::read(&shot.path, setup.linear)?;
        let (paper, paper_deviation) = self.paper_scale(shot, &picture, &lighting)?;
        let scale = match setup.white {
            White::Paper => paper,
            White::Card => card_scale(shot, &picture, &setup.card, &lighting, lens, pose)?,
        };
        let photo = picture.flat(window, lens, pose, scale);
        let scene = self.scene(&lighting);
        let render = |lit: &Lit| -> Result<Radiance, MeasureError> {
            Renderer::new(lit).laid_flat(&scene, window.width, window.height, observer).map_err(view_error)
        };
        let print = render(&self.print)?;
        let document = match &self.document {
            Some((document, mapped)) => Some((render(document)?, render(mapped)?)),
            None => None,
        };
        let seen = photo.squares(window);
        let squares = |radiance: &Radiance| -> Squares {
            flat(radiance).squares(window).into_iter().map(Option::unwrap_or_default).collect()
        };
        let predicted = squares(&print);
        let targets = document.as_ref().map(|(document, mapped)| (squares(document), squares(mapped)));
        let steps = Steps {
            document: targets.as_ref().map(|(document, mapped)| (document, mapped)),
            print: &predicted,
            photo: &seen,
        };
        let cover = Cover { shares: &self.shares, stacks: &self.stacks };
        let Some((errors, stacks)) = figures::errors(&steps, &cover, window, &lighting) else {
            return Err(MeasureError::Scene(format!(
                "{}: all of the print is clipped or outside the picture; expose shorter, or show all of it",
                shot.name
            )));
        };
        let half: Vec<f64> =
            (0..seen.len()).map(|i| lighting.at(window.square(i)).0[2].to_degrees()).collect();
        let figures = PhotoFigures {
            name: shot.name.clone(),
            marks: shot.marks.len(),
            camera_mm: pose.position(),
            camera_error_mm: camera.uncertain_mm[number],
            camera_axes: pose.rotation,
            residual_px: camera.residuals[number],
            light_mm: lamp,
            angles_deg: lighting.at(window.middle).0.map(f64::to_degrees),
            half_angles_deg: [
                half.iter().copied().fold(90.0, f64::min),
                half.iter().copied().fold(0.0, f64::max),
            ],
            scale,
            paper_deviation,
            seen: seen.iter().flatten().count() as f64 / seen.len() as f64,
            errors,
            stacks,
        };
        let exposure = Exposure::of(std::slice::from_ref(&print));
        let draw = |radiance: &Radiance| jpeg(&shown(radiance, exposure).map_err(view_error)?);
        let pictures = Pictures {
            difference: jpeg(&difference(&photo, &print, &predicted))?,
            photo: draw(&radiance(&photo))?,
            print: draw(&print)?,
            document: match &document {
                Some((document, mapped)) => Some((draw(document)?, draw(mapped)?)),
                None => None,
            },
        };
        Ok((figures, pictures))
    }

    /// The scene of a photograph, with its origin in the middle of the window, in metres.
    fn scene(&self, lighting: &Lighting) -> Scene {
        let [x, y] = self.window.middle;
        let from = |p: [f64; 3]| [p[0] - x, p[1] - y, p[2]].map(|mm| mm / 1000.0);
        let eye = from(lighting.eye);
        let distance = eye.iter().map(|c| c * c).sum::<f64>().sqrt();
        Scene {
            camera: view::Camera { towards: eye, distance: Some(distance), middle: [0.0; 2], height: 1.0 },
            pose: view::Pose::default(),
            lights: vec![Light::Near(from(lighting.lamp))],
            probe: None,
        }
    }

    /// The factors that make the bare paper around the marks as bright as the library says, and how far single marks are
    /// from them.
    fn paper_scale(
        &self,
        shot: &Shot,
        picture: &Picture,
        lighting: &Lighting,
    ) -> Result<([f64; 3], f64), MeasureError> {
        let mut ratios: [Vec<f64>; 3] = Default::default();
        let mut single: Vec<f64> = Vec::new();
        for (mark, known) in &shot.marks {
            let Some(plane) = mark.plane() else { continue };
            let [left, top] = known.corners[0];
            let cell = (known.corners[1][0] - left) / 8.0;
            let mut own: [Vec<f64>; 3] = Default::default();
            // Along the middle of the bare paper on all four sides.
            for step in 0..36 {
                let along = f64::from(step % 9) - 0.5;
                let [x, y] = match step / 9 {
                    0 => [along, -0.7],
                    1 => [along, 8.7],
                    2 => [-0.7, along],
                    _ => [8.7, along],
                };
                let Some((light, full)) = picture.at(plane.at([x, y])) else { continue };
                if full {
                    return Err(MeasureError::Scene(format!(
                        "{}: the paper beside a camera mark is clipped; expose shorter, so that white paper stays below the brightest \
                         value",
                        shot.name
                    )));
                }
                let ([_, _, theta], irradiance) = lighting.at([left + x * cell, top - y * cell]);
                let expected = self.paper.at(theta);
                (0..3).for_each(|c| own[c].push(expected[c] * irradiance / light[c].max(1e-9)));
            }
            single.push(median(&mut own[1].clone()));
            (0..3).for_each(|c| ratios[c].append(&mut own[c]));
        }
        let scale = ratios.map(|mut all| median(&mut all));
        if scale.iter().any(|k| !(k.is_finite() && *k > 0.0 && *k < 1e6)) {
            return Err(MeasureError::Scene(format!(
                "{}: the paper beside the camera marks is black; expose longer, and check that the lamp of the camera file is the one that \
                 was on",
                shot.name
            )));
        }
        let off = single.iter().map(|k| (k / scale[1] - 1.0).abs()).fold(0.0, f64::max);
        Ok((scale, off))
    }
}

/// The factors that make the middle step of a grey card in the sheet's plane as bright as it is.
fn card_scale(
    shot: &Shot,
    picture: &Picture,
    stated: &Card,
    lighting: &Lighting,
    lens: &Lens,
    pose: &Pose,
) -> Result<[f64; 3], MeasureError> {
    let radiance = picture.radiance();
    let named = |error: MeasureError| MeasureError::Scene(format!("{}: {error}", shot.name));
    let steps = match stated.rectangle_px {
        Some(rectangle) => card::steps_of(rectangle, &radiance),
        None => card::find(&radiance, stated.reflectance).map_err(named)?,
    };
    let mut bright = stated.reflectance;
    bright.sort_by(|a, b| b.total_cmp(a));
    let mut ratios: [Vec<f64>; 3] = Default::default();
    for (x, y, i) in card::inside(&radiance, steps[1]) {
        if radiance.bound[i] != 0 {
            return Err(MeasureError::Scene(format!(
                "{}: the grey card is clipped; expose shorter",
                shot.name
            )));
        }
        let Some(place) = lens.on_sheet(pose, [x as f64 + 0.5, y as f64 + 0.5]) else { continue };
        let irradiance = lighting.at(place).1;
        (0..3).for_each(|c| {
            ratios[c].push(bright[1] / PI * irradiance / f64::from(radiance.value[3 * i + c]).max(1e-9));
        });
    }
    if ratios[0].len() < 12 {
        return Err(MeasureError::Scene(format!(
            "{}: the grey card's middle step has {} usable pixels; bring it nearer, or check card.rectangle_px",
            shot.name,
            ratios[0].len()
        )));
    }
    Ok(ratios.map(|mut all| median(&mut all)))
}

fn flat(radiance: &Radiance) -> Flat {
    let mut flat = Flat::new(radiance.width, radiance.height);
    // The edge of the sheet covers its pixels in part.
    flat.rgb = radiance.pixels.iter().map(|p| [p[0], p[1], p[2]].map(|v| v / p[3].max(1e-3))).collect();
    flat
}

fn radiance(flat: &Flat) -> Radiance {
    let pixel =
        |(rgb, known): (&[f32; 3], &bool)| if *known { [rgb[0], rgb[1], rgb[2], 1.0] } else { [0.0; 4] };
    Radiance {
        width: flat.width,
        height: flat.height,
        pixels: flat.rgb.iter().zip(&flat.known).map(pixel).collect(),
    }
}

fn jpeg(picture: &RgbImage) -> Result<Vec<u8>, MeasureError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(picture).map_err(view_error)?;
    Ok(bytes)
}

/// Red where the photograph is brighter than the print, blue where it is darker, white where they agree.
fn difference(photo: &Flat, print: &Radiance, predicted: &Squares) -> RgbImage {
    let mean = predicted.iter().flatten().sum::<f64>() / (3 * predicted.len().max(1)) as f64;
    RgbImage::from_fn(photo.width as u32, photo.height as u32, |x, y| {
        let i = y as usize * photo.width + x as usize;
        if !photo.known[i] {
            return image::Rgb([128, 128, 128]);
        }
        let covered = print.pixels[i][3].max(1e-3);
        let off: f64 =
            (0..3).map(|c| f64::from(photo.rgb[i][c] - print.pixels[i][c] / covered)).sum::<f64>() / 3.0;
        let part = (off / (DIFFERENCE * mean.max(1e-12))).clamp(-1.0, 1.0);
        let fade = |away: f64| (255.0 * (1.0 - away.max(0.0))) as u8;
        image::Rgb([fade(-part), fade(part.abs()), fade(part)])
    })
}
