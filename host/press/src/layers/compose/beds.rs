//! White beneath the art and finish on it, where the settings say.

use protocol::ink::{Ink, Kind};

use super::super::raster::MM;
use super::super::{Artwork, LayersError, White, bits, distance, white};
use super::{Finish, Settings, Slot};

/// Adds white where the settings say, and chokes or spreads it.
pub(super) fn lay_white(
    slots: &mut Vec<Slot>,
    art: &Artwork,
    settings: &Settings,
    tell: &mut dyn FnMut(String),
) -> Result<(), LayersError> {
    let wrong = |option, problem: String| Err(LayersError::Setting { option, problem });
    let ground = match settings.white {
        None | Some(White::None) => None,
        Some(White::Reserved) => {
            if !slots.iter().any(|slot| slot.ink == Ink::White) {
                return wrong("--white reserved", "the picture has no reserved white, 230,230,230".into());
            }
            None
        }
        Some(White::Under) => {
            let mut under = bits::blank(art.width, art.length);
            let clear = |ink: Ink| matches!(ink.kind(), Kind::Finish | Kind::Primer);
            slots.iter().filter(|slot| !clear(slot.ink)).for_each(|slot| bits::add(&mut under, &slot.plane));
            Some(under)
        }
        Some(White::Opaque) => Some(art.drawn.clone()),
        Some(White::Silhouette) => Some(white::silhouette(&art.drawn)),
        Some(White::Alpha) => match &art.opaque {
            Some(opaque) => Some(opaque.clone()),
            None => {
                return wrong(
                    "--white alpha",
                    format!(
                        "{} has no transparency, so all of it would be white; export it with a transparent ground, or use \
                         --white opaque or silhouette",
                        art.name
                    ),
                );
            }
        },
    };
    if ground.is_some() && !settings.inks.contains(Ink::White) {
        return wrong("--white", "white is not among --inks".into());
    }
    if let Some(mut ground) = ground {
        // One bed of white: the art's own white belongs to it.
        let mode = settings.white.map_or_else(String::new, |mode| format!("--white {mode}"));
        let drawn = slots.iter().position(|slot| slot.ink == Ink::White);
        if let Some(at) = drawn {
            let drawn = slots.remove(at);
            bits::add(&mut ground, &drawn.plane);
        }
        slots.push(Slot { ink: Ink::White, from: mode, place: Some(0), plane: ground, passes: 1 });
    }
    if settings.choke == 0.0 {
        return Ok(());
    }
    let radius = settings.choke.abs();
    if radius.is_nan() || radius > f64::from(distance::MOST) {
        let option = if settings.choke > 0.0 { "--choke" } else { "--spread" };
        return wrong(
            option,
            format!("{:.2} mm is more than {:.0} mm", radius * MM, f64::from(distance::MOST) * MM),
        );
    }
    let square = (radius * radius + 1e-6) as u32;
    if square == 0 {
        tell(format!("{:.3} mm is less than a dot (0.042 mm): the white stays as it is", radius * MM));
    }
    let mut any = false;
    for slot in slots.iter_mut().filter(|slot| slot.ink == Ink::White) {
        any = true;
        slot.plane = if settings.choke > 0.0 {
            distance::shrink(&slot.plane, square)
        } else {
            distance::grow(&slot.plane, square)
        };
    }
    if !any {
        return wrong("--choke", "there is no white to choke or spread; add a --white".into());
    }
    Ok(())
}

/// Adds finish where the settings say.
pub(super) fn lay_finish(
    slots: &mut Vec<Slot>,
    art: &Artwork,
    settings: &Settings,
) -> Result<(), LayersError> {
    let coat = match settings.finish {
        None | Some(Finish::None) => return Ok(()),
        Some(Finish::Artwork) => {
            let mut coat = art.drawn.clone();
            slots.iter().for_each(|slot| bits::add(&mut coat, &slot.plane));
            coat
        }
        Some(Finish::All) => bits::full(art.width, art.length),
    };
    if !settings.inks.contains(Ink::Finish) {
        return Err(LayersError::Setting {
            option: "--finish",
            problem: "finish is not among --inks".into(),
        });
    }
    match slots.iter_mut().find(|slot| slot.ink == Ink::Finish) {
        Some(slot) => bits::add(&mut slot.plane, &coat),
        None => slots.push(Slot {
            ink: Ink::Finish,
            from: "--finish".into(),
            place: Some(u32::MAX),
            plane: coat,
            passes: 1,
        }),
    }
    Ok(())
}
