//! White beneath the art and finish on it, as the settings say.
//!
//! Choke and spread move the outline of what is drawn: a tint has dots of its own, which a round brush would take one by one.

use observe::Diagnosis;
use protocol::ink::{Ink, Kind};

use super::separation::Separation;
use super::settings::{Finish, Settings};
use crate::artwork::Artwork;
use crate::dots::bitplane;
use crate::dots::distance;
use crate::dots::white::{self, White};
use crate::read::size::MM;
use sheet::Plane;
use sheet::forest::Forest;

/// The most that white is choked or spread, in mm: more would be a mistake of units.
pub const MOST_CHOKE_MM: f64 = 10.0;

/// Where white comes from that the art does not draw.
const SETTING: &str = "white setting";

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
        let from = format!("{SETTING}: {mode}");
        separations.push(Separation { ink: Ink::White, from, place: Some(0), plane: bed, passes: 1 });
    }
    choke(separations, art, settings, tell)
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

/// Moves the outline of all white inwards by so many dots, or outwards if the number is negative.
fn choke(
    separations: &mut [Separation],
    art: &Artwork,
    settings: &Settings,
    tell: &mut dyn FnMut(String),
) -> Result<(), Diagnosis> {
    let choke = settings.choke;
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
    let (mut any, mut lost, mut all) = (false, 0, 0);
    for separation in separations.iter_mut().filter(|separation| separation.ink == Ink::White) {
        any = true;
        let outline = outline(separation, art, settings.white);
        if choke > 0.0 {
            let before = separation.plane.clone();
            bitplane::merge(&mut separation.plane, &distance::shrink(&outline, square), |white, inside| {
                white & inside
            });
            all += before.dots();
            lost += dots_of_parts_without(&separation.plane, &outline, &before);
        } else {
            let mut edge = distance::grow(&outline, square);
            bitplane::merge(&mut edge, &outline, |grown, outline| grown & !outline);
            bitplane::add(&mut separation.plane, &edge);
        }
    }
    if lost > 0 {
        tell(format!(
            "choke: parts of the art that are at most {:.2} mm wide lose all their white: {lost} of {all} dots; a smaller choke \
             keeps it",
            2.0 * radius * MM
        ));
    }
    if !any {
        return refused(setting, "there is no white to choke or spread; choose where white goes");
    }
    Ok(())
}

/// What the outline of white encloses: all that is drawn over it, also where a tint leaves dots free.
fn outline(white: &Separation, art: &Artwork, mode: Option<White>) -> Plane {
    let mut outline = white.plane.clone();
    let is_set = white.from.starts_with(SETTING);
    for layer in
        art.layers.iter().filter(|layer| layer.ink == Ink::White && (is_set || layer.name == white.from))
    {
        bitplane::add(&mut outline, &layer.drawn(art.width));
    }
    if is_set && mode == Some(White::Under) {
        let mut colours = art.drawn.clone();
        for layer in &art.layers {
            let drawn = layer.drawn(art.width);
            match layer.ink.kind() {
                Kind::Finish | Kind::Primer => {
                    bitplane::merge(&mut colours, &drawn, |all, clear| all & !clear)
                }
                _ => bitplane::add(&mut outline, &drawn),
            }
        }
        bitplane::add(&mut outline, &colours);
    }
    outline
}

/// How many dots `before` has in those parts of `outline` in which `after` has none. What touches at a corner hangs together.
fn dots_of_parts_without(after: &Plane, outline: &Plane, before: &Plane) -> u64 {
    let (mut parts, mut found) = (Forest::default(), Vec::new());
    let (mut above, mut row): (Vec<(usize, usize, u32)>, Vec<_>) = (Vec::new(), Vec::new());
    for y in 0..outline.length {
        let (mut x, mut first) = (0, 0);
        while x < outline.width {
            if !bitplane::at(outline, x, y) {
                x += 1;
                continue;
            }
            let from = x;
            let (mut dots, mut is_left) = (0, false);
            while x < outline.width && bitplane::at(outline, x, y) {
                dots += u64::from(bitplane::at(before, x, y));
                is_left |= bitplane::at(after, x, y);
                x += 1;
            }
            let number = parts.add();
            found.push((dots, is_left));
            first += above[first..].iter().take_while(|(_, to, _)| *to < from).count();
            for (_, _, other) in above[first..].iter().take_while(|(other, ..)| *other <= x) {
                parts.join(*other, number);
            }
            row.push((from, x, number));
        }
        above.clear();
        std::mem::swap(&mut above, &mut row);
    }
    let roots: Vec<usize> = (0..found.len() as u32).map(|number| parts.root(number) as usize).collect();
    let mut left = vec![false; found.len()];
    roots.iter().zip(&found).for_each(|(root, (_, is_left))| left[*root] |= is_left);
    roots.iter().zip(&found).filter(|(root, _)| !left[**root]).map(|(_, (dots, _))| dots).sum()
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
