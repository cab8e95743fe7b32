//! White beneath the art and finish on it, as the settings say.

use observe::Diagnosis;
use protocol::ink::{Ink, Kind};

use super::super::artwork::Artwork;
use super::super::size::MM;
use super::super::white::{self, White};
use super::super::{bitplane, distance};
use super::separation::Separation;
use super::settings::{Finish, Settings};
use sheet::Plane;

/// The most that white is choked or spread, in mm.
pub const MOST_CHOKE_MM: f64 = 10.0;

/// Adds white, and chokes or spreads it.
pub(super) fn lay_white(
    separations: &mut Vec<Separation>,
    art: &Artwork,
    settings: &Settings,
    tell: &mut dyn FnMut(String),
) -> Result<(), Diagnosis> {
    if let Some((mode, mut bed)) = white_bed(separations, art, settings)? {
        if !settings.inks.contains(Ink::White) {
            return refused("white", "white is not among the allowed inks");
        }
        // The art's own white becomes part of the bed, so that there is one layer of white.
        if let Some(at) = separations.iter().position(|separation| separation.ink == Ink::White) {
            let drawn = separations.remove(at);
            bitplane::add(&mut bed, &drawn.plane);
        }
        let from = format!("white setting: {mode}");
        separations.push(Separation { ink: Ink::White, from, place: Some(0), plane: bed, passes: 1 });
    }
    choke(separations, settings.choke, tell)
}

/// The plane of white that the settings ask for, if any, and its mode.
fn white_bed(
    separations: &[Separation],
    art: &Artwork,
    settings: &Settings,
) -> Result<Option<(White, Plane)>, Diagnosis> {
    let Some(mode) = settings.white else { return Ok(None) };
    let bed = match mode {
        White::None => return Ok(None),
        White::Reserved => {
            if !separations.iter().any(|separation| separation.ink == Ink::White) {
                return refused(
                    "white",
                    "the picture has no reserved white; draw what is to be white in exactly 230,230,230",
                );
            }
            return Ok(None);
        }
        White::Under => {
            let mut under = bitplane::blank(art.width, art.length);
            let clear = |ink: Ink| matches!(ink.kind(), Kind::Finish | Kind::Primer);
            separations
                .iter()
                .filter(|separation| !clear(separation.ink))
                .for_each(|separation| bitplane::add(&mut under, &separation.plane));
            under
        }
        White::Opaque => art.drawn.clone(),
        White::Silhouette => white::silhouette(&art.drawn),
        White::Alpha => match &art.opaque {
            Some(opaque) => opaque.clone(),
            None => {
                let problem = format!(
                    "{} has no transparency, so all of it would be white; export it with a transparent background, or choose \
                     white mode opaque or silhouette",
                    art.name
                );
                return refused("white", problem);
            }
        },
    };
    Ok(Some((mode, bed)))
}

/// Shrinks all white by so many dots, or spreads it if the number is negative.
fn choke(separations: &mut [Separation], choke: f64, tell: &mut dyn FnMut(String)) -> Result<(), Diagnosis> {
    if choke == 0.0 {
        return Ok(());
    }
    let setting = if choke > 0.0 { "choke" } else { "spread" };
    let radius = choke.abs();
    // What is typed as 10 mm may be a little more in dots.
    if radius.is_nan() || radius * MM > MOST_CHOKE_MM + 1e-9 {
        let typed = (radius * MM * 1e4).round() / 1e4;
        return refused(setting, format!("{typed} mm is more than {MOST_CHOKE_MM} mm"));
    }
    let square = (radius * radius + 1e-6) as u32;
    if square == 0 {
        tell(format!(
            "{setting}: {:.3} mm is less than a dot (0.042 mm), so the white is unchanged",
            radius * MM
        ));
    }
    let mut any = false;
    for separation in separations.iter_mut().filter(|separation| separation.ink == Ink::White) {
        any = true;
        separation.plane = if choke > 0.0 {
            distance::shrink(&separation.plane, square)
        } else {
            distance::grow(&separation.plane, square)
        };
    }
    if !any {
        return refused(setting, "there is no white to choke or spread; choose where white goes");
    }
    Ok(())
}

fn refused<T>(setting: &'static str, problem: impl std::fmt::Display) -> Result<T, Diagnosis> {
    Err(Diagnosis::of_setting(setting, problem))
}

/// Adds finish.
pub(super) fn lay_finish(
    separations: &mut Vec<Separation>,
    art: &Artwork,
    settings: &Settings,
) -> Result<(), Diagnosis> {
    let coat = match settings.finish {
        None | Some(Finish::None) => return Ok(()),
        Some(Finish::Artwork) => {
            let mut coat = art.drawn.clone();
            separations.iter().for_each(|separation| bitplane::add(&mut coat, &separation.plane));
            coat
        }
        Some(Finish::All) => bitplane::full(art.width, art.length),
    };
    if !settings.inks.contains(Ink::Finish) {
        return refused("finish", "finish is not among the allowed inks");
    }
    match separations.iter_mut().find(|separation| separation.ink == Ink::Finish) {
        Some(separation) => bitplane::add(&mut separation.plane, &coat),
        None => separations.push(Separation {
            ink: Ink::Finish,
            from: "finish setting".into(),
            place: Some(u32::MAX),
            plane: coat,
            passes: 1,
        }),
    }
    Ok(())
}
