//! One photograph beside its prediction.
//!
//! Problem: a photograph has the camera's perspective, the lamp's fall-off and an exposure of its own.
//! Method: the renderer of `view` shows document, mixture and dots from the camera's place under its lamp, prepared once for all
//! photographs; the paper around the marks, or the middle step of a grey card, gives exposure and white balance. Both are laid flat.
//! That is for looking. Figures compare spots: what covers a spot is counted over all dots, as blurred as the photograph is, and lit.
//! Cost: three renderings and two counts a photograph. Limits: a lamp is a point.

use std::f64::consts::PI;

use appearance::brdf::reflectances;
use appearance::factor::Factored;
use inks::{Curve, Stack};
use observe::Observer;
use press::preview::{Radiance, Source, ToneCurve, picture as picture_of};
use readers::Pixels;
use sheet::Area;
use view::{Light, Lit, Renderer, Scene};

use super::comparison::{PhotoFigures, Pictures};
use super::figures::{self, Cover, Lighting, Scale, Spots, Steps};
use super::flat::{ComparedArea, Covering, Flat};
use super::inputs::{ComparedPrint, SheetPhoto, space};
use super::passes::{Evidence, Passes, Registration};
use super::picture::Picture;
use super::setup::{Card, CompareSetup, White};
use crate::MeasureError;
use crate::curves::card;
use crate::geometry::pose::{Lens, Pose, SolvedCamera};
use crate::linalg::{median, spread};

/// Quality of the pictures: differences of a percent stay visible.
const QUALITY: u8 = 88;
/// Full colour of the difference: this part of the mean light.
const DIFFERENCE: f64 = 0.3;

/// What is compared, prepared once for all photographs.
pub(super) struct Scenery<'a> {
    window: ComparedArea,
    print: Lit,
    pub(super) passes: Passes<'a>,
    document: Option<[Shown<'a>; 2]>,
    paper: Curve,
}

/// A document to look at, and to count.
struct Shown<'a> {
    lit: Lit,
    factored: &'a Factored,
    curves: Vec<Curve>,
}

impl Shown<'_> {
    fn cover(&self, window: &ComparedArea, blur: [f64; 2]) -> Cover {
        Cover {
            shares: window.shares(&Covering::Factored(self.factored), blur, &window.rows()),
            curves: self.curves.clone(),
            names: Vec::new(),
        }
    }
}

/// What a photograph shows, spot by spot, and what it should show.
pub(super) struct Looked {
    lighting: Lighting,
    scale: Scale,
    paper_deviation: f64,
    seen: Vec<Option<[f64; 3]>>,
    predicted: Spots,
    document: Option<[Spots; 2]>,
}

fn lit(source: &Source<'_>, window: &ComparedArea) -> Result<Lit, MeasureError> {
    let longest = window.width.max(window.height).clamp(64, 2048);
    Lit::new(source, window.size.map(|side| side / 1000.0), longest).map_err(view_error)
}

fn view_error(error: impl std::fmt::Display) -> MeasureError {
    MeasureError::Scene(error.to_string())
}

impl<'a> Scenery<'a> {
    pub(super) fn new(
        printed: &ComparedPrint<'a>,
        area: Area,
        middle: [f64; 2],
        size: [f64; 2],
        shot: &SheetPhoto,
        camera: &SolvedCamera,
    ) -> Result<Scenery<'a>, MeasureError> {
        let ComparedPrint { sheet, library, document } = printed;
        let space = &space();
        // As fine as the photographs are.
        let pixels = camera.lens.density(&camera.poses[0], middle);
        if pixels < 1.0 {
            return Err(MeasureError::Scene(format!(
                "{}: a millimetre of the sheet is {pixels:.1} pixels; bring the camera nearer",
                shot.name
            )));
        }
        let window = ComparedArea::new(middle, size, pixels);
        let rows = reflectances(sheet.stacks(), library, space);
        let print = lit(&Source::Print { dots: sheet, space, stacks: &rows, area }, &window)?;
        let factored = |factored: &'a Factored| -> Result<Shown<'a>, MeasureError> {
            let source = Source::Factored(factored);
            let curves = factored.bases.rows().map(|row| source.space().curve(row)).collect();
            Ok(Shown { lit: lit(&source, &window)?, factored, curves })
        };
        let document = match document {
            Some(both) => Some([factored(both.document)?, factored(both.mapped)?]),
            None => None,
        };
        let passes = Passes::new(sheet, library, area);
        let bare = reflectances(&[Stack::SUBSTRATE], library, space);
        let paper = space.curve(bare.row(0));
        Ok(Scenery { window, print, passes, document, paper })
    }

    /// Looks at one photograph beside its prediction.
    pub(super) fn looked(
        &self,
        shot: &SheetPhoto,
        number: usize,
        camera: &SolvedCamera,
        setup: &CompareSetup,
        observer: &dyn Observer,
    ) -> Result<(Looked, Pictures), MeasureError> {
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
        let seen = picture.spots(window, lens, pose, scale.factor);
        let sums = |cover: Cover| cover.lights(window, &lighting).sums();
        let predicted = sums(self.passes.cover(window, shot.blur, None));
        let document: Option<[Spots; 2]> = self
            .document
            .as_ref()
            .map(|both| both.each_ref().map(|shown| sums(shown.cover(window, shot.blur))));
        let photo = picture.flat(window, lens, pose, scale.factor);
        let scene = self.scene(&lighting);
        let render = |lit: &Lit| -> Result<Radiance, MeasureError> {
            Renderer::new(lit).laid_flat(&scene, window.width, window.height, observer).map_err(view_error)
        };
        let print = render(&self.print)?;
        let tone = ToneCurve::of(std::slice::from_ref(&print));
        let draw = |radiance: &Radiance| jpeg(&picture_of(radiance, tone).map_err(view_error)?);
        let pictures = Pictures {
            difference: jpeg(&difference(&photo, &print, &predicted))?,
            photo: draw(&radiance(&photo))?,
            print: draw(&print)?,
            document: match &self.document {
                Some([document, mapped]) => {
                    Some((draw(&render(&document.lit)?)?, draw(&render(&mapped.lit)?)?))
                }
                None => None,
            },
        };
        Ok((Looked { lighting, scale, paper_deviation, seen, predicted, document }, pictures))
    }

    /// Where the passes are, if not where they should be.
    pub(super) fn registration(&self, shots: &[SheetPhoto], looked: &[Looked]) -> Option<Registration> {
        let evidence: Vec<Evidence<'_>> =
            looked.iter().map(|look| Evidence { lighting: &look.lighting, seen: &look.seen }).collect();
        let blur = [0, 1].map(|c| median(&mut shots.iter().map(|shot| shot.blur[c]).collect::<Vec<_>>()));
        self.passes.solve(&self.window, blur, &evidence)
    }

    /// The figures of one photograph.
    pub(super) fn compared(
        &self,
        shot: &SheetPhoto,
        number: usize,
        look: &Looked,
        camera: &SolvedCamera,
        registration: Option<&Registration>,
    ) -> Result<PhotoFigures, MeasureError> {
        let (window, Looked { lighting, seen, .. }) = (&self.window, look);
        let cover = self.passes.cover(window, shot.blur, registration);
        let lights = cover.lights(window, lighting);
        let steps = Steps {
            document: look.document.as_ref(),
            print: &look.predicted,
            photo: seen,
            placed: registration.map(|_| self.passes.own()),
        };
        let Some((errors, stacks)) = figures::errors(&steps, &lights, window, look.scale.error) else {
            return Err(MeasureError::Scene(format!(
                "{}: all of the print is clipped or outside the picture; expose shorter, or show all of it",
                shot.name
            )));
        };
        let half: Vec<f64> = (0..seen.len()).map(|i| lighting.at(window.spot(i)).0[2].to_degrees()).collect();
        let pose = &camera.poses[number];
        Ok(PhotoFigures {
            name: shot.name.clone(),
            marks: shot.marks.len(),
            camera_mm: pose.position(),
            camera_error_mm: camera.uncertain_mm[number],
            camera_axes: pose.rotation,
            residual_px: camera.residuals[number],
            light_mm: lighting.lamp,
            angles_deg: lighting.at(window.middle).0.map(f64::to_degrees),
            half_angles_deg: [
                half.iter().copied().fold(90.0, f64::min),
                half.iter().copied().fold(0.0, f64::max),
            ],
            scale: look.scale.factor,
            blur_mm: shot.blur,
            paper_deviation: look.paper_deviation,
            seen: seen.iter().flatten().count() as f64 / seen.len() as f64,
            errors,
            stacks,
        })
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

    /// The factors that make the bare paper around the marks as bright as the library says, and how far the worst mark is
    /// from them. Marks that differ leave the factors uncertain.
    fn paper_scale(
        &self,
        shot: &SheetPhoto,
        picture: &Picture,
        lighting: &Lighting,
    ) -> Result<(Scale, f64), MeasureError> {
        let mut ratios: [Vec<f64>; 3] = Default::default();
        let mut single: [Vec<f64>; 3] = Default::default();
        for (mark, known) in &shot.marks {
            let Some(plane) = mark.plane() else { continue };
            let [left, top] = known.corners[0];
            let cell = (known.corners[1][0] - left) / 8.0;
            let mut own: [Vec<f64>; 3] = Default::default();
            // Along the middle of the bare paper on all four sides.
            for step in 0..108 {
                let along = (f64::from(step % 27) + 0.5) / 3.0 - 0.5;
                let [x, y] = match step / 27 {
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
            for c in 0..3 {
                single[c].push(median(&mut own[c].clone()));
                ratios[c].append(&mut own[c]);
            }
        }
        let factor = ratios.map(|mut all| median(&mut all));
        if factor.iter().any(|k| !(k.is_finite() && *k > 0.0 && *k < 1e6)) {
            return Err(MeasureError::Scene(format!(
                "{}: the paper beside the camera marks is black; expose longer, and check that the lamp of the camera file is the one that \
                 was on",
                shot.name
            )));
        }
        let off = |c: usize| single[c].iter().map(move |k| k / factor[c] - 1.0);
        let worst = off(1).map(f64::abs).fold(0.0, f64::max);
        let freedom = ((single[0].len() - 1) * single[0].len()) as f64;
        let error = std::array::from_fn(|c| (off(c).map(|off| off * off).sum::<f64>() / freedom).sqrt());
        Ok((Scale { factor, error }, worst))
    }
}

/// The factors that make the middle step of a grey card in the sheet's plane as bright as it is.
fn card_scale(
    shot: &SheetPhoto,
    picture: &Picture,
    stated: &Card,
    lighting: &Lighting,
    lens: &Lens,
    pose: &Pose,
) -> Result<Scale, MeasureError> {
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
    let spreads = ratios.map(|all| (spread(&all), all.len()));
    Ok(Scale {
        factor: spreads.map(|((middle, _), _)| middle),
        // A median's is a quarter more than a mean's.
        error: spreads.map(|((middle, spread), count)| 1.25 * spread / middle / (count as f64).sqrt()),
    })
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

fn jpeg(picture: &Pixels<[u8; 3]>) -> Result<Vec<u8>, MeasureError> {
    picture.jpeg(QUALITY).map_err(view_error)
}

/// Red where the photograph is brighter than the print, blue where it is darker, white where they agree.
fn difference(photo: &Flat, print: &Radiance, predicted: &Spots) -> Pixels<[u8; 3]> {
    let mean = predicted.iter().flatten().sum::<f64>() / (3 * predicted.len().max(1)) as f64;
    Pixels::from_fn(photo.width as u32, photo.height as u32, |x, y| {
        let i = y as usize * photo.width + x as usize;
        if !photo.known[i] {
            return [128, 128, 128];
        }
        let covered = print.pixels[i][3].max(1e-3);
        let off: f64 =
            (0..3).map(|c| f64::from(photo.rgb[i][c] - print.pixels[i][c] / covered)).sum::<f64>() / 3.0;
        let part = (off / (DIFFERENCE * mean.max(1e-12))).clamp(-1.0, 1.0);
        let fade = |away: f64| (255.0 * (1.0 - away.max(0.0))) as u8;
        [fade(-part), fade(part.abs()), fade(part)]
    })
}
