//! The photographs of a folder as one series of exposures for each lamp, and what a series lacks.
//!
//! A photograph belongs to the lamp that its name begins with; its exposure time is that of the setup file, or that of EXIF. Photographs
//! of no lamp or without a time are errors, as are lamps without photographs. What more exposures would show is advice.

use std::path::{Path, PathBuf};

use super::exposure::Exposure;
use super::merge::Shot;
use super::photo;
use crate::MeasureError;
use crate::setup::Setup;

/// Photographs with their exposure times, for each lamp of the setup, and what is not in the folder.
pub(crate) fn series(
    folder: &Path,
    setup: &Setup,
) -> Result<(Vec<Vec<Exposure>>, Vec<MeasureError>), MeasureError> {
    let mut series: Vec<Vec<Exposure>> = vec![Vec::new(); setup.light.len()];
    let mut named: Vec<&String> = setup.exposures.keys().collect();
    // Photographs that the setup file names are no exposures, wherever they lie.
    let photos = &setup.photos;
    let others: Vec<PathBuf> = [&photos.lamp_off, &photos.flat_field, &photos.dark_frame]
        .into_iter()
        .flatten()
        .filter_map(|path| path.canonicalize().ok())
        .collect();
    named.retain(|name| {
        photos.lamp_off.as_deref().and_then(Path::file_name).is_none_or(|off| off != name.as_str())
    });
    for path in photo::list(folder)? {
        if path.canonicalize().is_ok_and(|path| others.contains(&path)) {
            continue;
        }
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let Some(light) = setup.light.iter().position(|light| name.starts_with(&light.photos)) else {
            let beginnings: Vec<&str> = setup.light.iter().map(|light| &*light.photos).collect();
            let problem = format!(
                "belongs to no lamp: its name begins with none of {}; rename it, or change light.photos",
                beginnings.join(", ")
            );
            return Err(MeasureError::photo(&path, problem));
        };
        named.retain(|other| **other != name);
        series[light].push(exposure(path, &name, setup)?);
    }
    let mut missing = Vec::new();
    if let Some(name) = named.first() {
        missing.push(MeasureError::Scene(format!(
            "setup file: exposures names {name}, which is not in {}; correct the name",
            folder.display()
        )));
    }
    for empty in (0..series.len()).filter(|&light| series[light].is_empty()) {
        missing.push(MeasureError::Scene(format!(
            "light {}: no photograph's name begins with `{}`; photograph it, or take it out of the setup file",
            empty + 1,
            setup.light[empty].photos
        )));
    }
    Ok((series, missing))
}

/// A photograph with its exposure time.
fn exposure(path: PathBuf, name: &str, setup: &Setup) -> Result<Exposure, MeasureError> {
    let exif = photo::exif(&path)?;
    let seconds = setup.exposures.get(name).copied().or(exif.seconds).filter(|t| t.is_finite() && *t > 0.0);
    let Some(seconds) = seconds else {
        return Err(MeasureError::photo(
            &path,
            format!(
                "has no exposure time; keep the camera's EXIF, or add `\"{name}\" = 0.004` (seconds) to [exposures] in the setup file"
            ),
        ));
    };
    Ok(Exposure { path, seconds, exif })
}

/// The photograph with the lamp off, if the setup file names one.
pub(crate) fn lamp_off(setup: &Setup) -> Result<Option<Exposure>, MeasureError> {
    let Some(path) = &setup.photos.lamp_off else { return Ok(None) };
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    exposure(path.clone(), &name, setup).map(Some)
}

/// Relative exposures of a series.
pub(crate) fn exposures(shots: &[Shot]) -> Vec<f64> {
    shots.iter().map(|shot| shot.seconds * shot.ratio).collect()
}

/// What exposures a second try needs under lamp `lamp`: `clipped` are the stacks whose highlight even the shortest does not show.
pub(crate) fn advice(shots: &[Shot], lamp: usize, clipped: &[&str]) -> Vec<String> {
    let mut again = Vec::new();
    if shots.iter().any(|shot| shot.recovered) {
        again.push(format!(
            "lamp {lamp}: tones that a camera's curve has bent (JPEG) are recovered to some per cent only: develop RAW to linear 16-bit TIFF"
        ));
    }
    if !clipped.is_empty() {
        let shortest = shots.last().map_or(0.0, |shot| shot.seconds);
        again.push(format!(
            "{}: the highlight is clipped even at {}: add exposures 4 and 16 times as short",
            clipped.join(", "),
            seconds(shortest)
        ));
    }
    if shots.len() == 1 {
        again.push(format!("lamp {lamp}: one exposure only: take at least three, a factor of 4 apart"));
    }
    again
}

/// A time as photographers write it.
pub(crate) fn seconds(time: f64) -> String {
    if time < 0.4 { format!("1/{:.0} s", 1.0 / time) } else { format!("{time:.1} s") }
}
