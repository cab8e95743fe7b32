//! From photographs to the pixels of each stack: exposures merged, card and marks found.
//!
//! What is wrong goes to a function of the caller's: a measurement ends at the first problem, a check goes on to the next.

use std::path::Path;

use inks::Stack;
use observe::Observer;
use sheet::DotMap;

use super::PhotoSeries;
use crate::camera::exposure::Exposure;
use crate::camera::frames::Frames;
use crate::camera::merge;
use crate::camera::residual_shift::ResidualShifts;
use crate::camera::series;
use crate::curves::blur;
use crate::curves::card;
use crate::curves::coverage;
use crate::curves::extent::Pixel;
use crate::curves::gather;
use crate::curves::patches::{ChartOnSample, Region};
use crate::curves::pictures::Copy;
use crate::geometry::correction;
use crate::geometry::scene::Scene;
use crate::geometry::shadow;
use crate::setup::Setup;
use crate::{MeasureError, linalg};

/// Takes a problem; to hand it back ends the look.
pub type Problems<'p> = dyn FnMut(MeasureError) -> Result<(), MeasureError> + 'p;

/// What is kept of a series.
pub struct SeriesRecord {
    /// The lamp's number.
    pub light: usize,
    pub series: PhotoSeries,
    pub copy: Copy,
    pub outline: Vec<[f64; 2]>,
    /// For each stack.
    pub pixels: Vec<Vec<Pixel>>,
}

/// What the photographs show.
pub struct Looked {
    pub scene: Scene,
    pub stacks: Vec<Stack>,
    /// One for each lamp, if there was no problem.
    pub seen: Vec<SeriesRecord>,
}

impl Looked {
    /// Takes out the stacks whose pixels are not enough for a curve, and says why.
    pub fn leave_out_hidden(&mut self) -> Vec<MeasureError> {
        let mut errors = Vec::new();
        for i in (0..self.stacks.len()).rev() {
            let pixels = self.seen.iter().flat_map(|seen| &seen.pixels[i]);
            if let Err(error) = coverage::check(&self.scene, &self.stacks[i], pixels) {
                self.stacks.remove(i);
                self.seen.iter_mut().for_each(|seen| drop(seen.pixels.remove(i)));
                errors.push(error);
            }
        }
        errors.reverse();
        errors
    }
}

/// Looks at the photographs of a folder. Nothing is seen where `problems` took every lamp's.
///
/// # Errors
/// What `problems` hands back, and what leaves nothing to look at.
pub fn look(
    folder: &Path,
    setup: &Setup,
    chart: Option<&DotMap>,
    observer: &dyn Observer,
    problems: &mut Problems<'_>,
) -> Result<Looked, MeasureError> {
    let (series, missing) = series::series(folder, setup)?;
    missing.into_iter().try_for_each(&mut *problems)?;
    let chart = chart.map(ChartOnSample::new).transpose()?;
    let stacks = match &chart {
        Some(chart) => chart.stacks(),
        None => {
            setup.sample.stack.iter().chain(setup.patch.iter().map(|patch| &patch.stack)).cloned().collect()
        }
    };
    let photos = Photos {
        setup,
        chart,
        frames: Frames::read(setup.photos.flat_field.as_deref(), setup.photos.dark_frame.as_deref())?,
        off: series::lamp_off(setup)?,
    };
    observer.begin("reading photographs", 2 * series.iter().map(Vec::len).sum::<usize>() as u64);
    let mut scene = None;
    let mut seen = Vec::new();
    for (light, exposures) in series.into_iter().enumerate().filter(|(_, exposures)| !exposures.is_empty()) {
        match photos.look(light, exposures, &mut scene, observer) {
            Ok(record) => seen.push(record),
            Err(error) => problems(error)?,
        }
    }
    observer.end();
    let Some((_, scene)) = scene else { return Err(MeasureError::Scene("no photograph can be used".into())) };
    let blur = linalg::median(&mut seen.iter().map(|seen| seen.series.blur).collect::<Vec<_>>());
    let slips = ResidualShifts::new(seen.iter().map(|seen| series::exposures(&seen.series.shots)));
    Ok(Looked { scene: scene.with_blur(blur).with_slips(slips), stacks, seen })
}

/// What all series share.
struct Photos<'s> {
    setup: &'s Setup,
    chart: Option<ChartOnSample>,
    frames: Frames,
    off: Option<Exposure>,
}

impl Photos<'_> {
    /// The photographs under one lamp. `first` is the first series' size and scene, made here if there is none.
    fn look(
        &self,
        light: usize,
        exposures: Vec<Exposure>,
        first: &mut Option<((usize, usize), Scene)>,
        observer: &dyn Observer,
    ) -> Result<SeriesRecord, MeasureError> {
        let setup = self.setup;
        let film = exposures.iter().find_map(|e| e.exif.film_focal_mm);
        let path = exposures[0].path.clone();
        let (radiance, shots) =
            merge::merge(exposures, &self.frames, self.off.as_ref(), setup.photos.linear, observer)?;
        let size = (radiance.width, radiance.height);
        let (expected, scene) = match first {
            Some(first) => first,
            None => first.insert((size, Scene::new(setup, size, setup.field_of_view(film, size)?)?)),
        };
        if *expected != size {
            let problem = format!(
                "{} x {} pixels, but another lamp's have {} x {}",
                size.0, size.1, expected.0, expected.1
            );
            return Err(MeasureError::photo(&path, problem));
        }
        let steps = match setup.card.rectangle_px {
            Some(rectangle) => card::steps_of(rectangle, &radiance),
            None => card::find(&radiance, setup.card.reflectance)?,
        };
        let card = card::calibrate(&radiance, steps, &setup.card, scene, light)?;
        let blur = blur::of_card(&radiance, &card.steps);
        let scene = &scene.clone().with_blur(blur);
        let shadow = scene.radius().and_then(|_| shadow::look(scene, &radiance, card.scale, light));
        let irradiance = card.irradiance(scene, light);
        let copy = Copy::new(&radiance, card.scale.map(|k| irradiance / std::f64::consts::PI / k));
        let regions = match &self.chart {
            // A lens that is out of focus hides marks, too.
            Some(chart) => chart.regions(&path, &radiance, scene).map_err(|error| {
                match blur::advice(blur, light + 1) {
                    Some(said) => MeasureError::Scene(format!("{said}. Otherwise: {error}")),
                    None => error,
                }
            })?,
            None => regions(setup),
        };
        let pixels =
            regions.iter().map(|at| gather::pixels(&radiance, scene, card.scale, light, at)).collect();
        let outline = correction::outline(scene, &radiance, light);
        Ok(SeriesRecord { light, series: PhotoSeries { shots, card, blur, shadow }, copy, outline, pixels })
    }
}

/// Where the stacks of a setup file are.
fn regions(setup: &Setup) -> Vec<Region> {
    let whole = setup.sample.stack.iter().map(|_| Region::All);
    whole.chain(setup.patch.iter().map(|patch| Region::Pixels(patch.rectangle_px))).collect()
}
