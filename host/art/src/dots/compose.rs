//! Layers to stacks: white, finish, order, passes, knockout, undercoats.
//!
//! Problem: layers tell where each ink is, while a sheet tells which inks lie on each dot, bottom to top. Some inks also need
//! others beneath them that nobody drew.
//! Method: every layer is a plane; tones and colours are halftoned to planes. All planes are read eight dots at a time, the
//! combinations that occur are counted, and each becomes a stack: the inks in their [`Order`], with
//! [`Settings::passes`] of each, without knocked-out inks, with accepted undercoats. If the art lacks something, the result
//! has a [`Suggestion`]; nothing is added silently.
//! Cost: about 2 ns a dot, and the halftones. Limits: [`MOST_PASSES`] planes, 256 stacks.

mod arrange;
mod plates;
mod separation;
mod settings;
mod suggest;
mod underbase;

use inks::{InkSet, Library, Stack};
use protocol::ink::{Ink, Kind};
use rayon::prelude::*;
use serde::Serialize;

use crate::artwork::{Artwork, Shape};
use crate::colour::{How, Picked};
use crate::dots::bitplane;
use crate::dots::white::White;
use crate::error::{
    foil, no_sheet, not_halftoned, nothing, only_white, too_many_passes, too_small, unfitted,
};
use crate::read::size::MM;
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps};
use halftone::{Method, halftone};
use observe::{Diagnosis, Observer};
use sheet::DotMap;
use sheet::order::customary;
use sheet::{MOST_PASSES, Plane, pack};

use separation::{COLOURS, Separation};

pub use arrange::Order;
pub use separation::InkLayer;
pub use settings::{Finish, GAMMAS, Settings, Text};
pub use suggest::{Accept, Remedy, Suggestion};
pub use underbase::MOST_CHOKE_MM;

/// A report on composed art.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Width and height in millimetres.
    pub size_mm: (f64, f64),
    /// The inks from the paper up.
    pub laid: Vec<InkLayer>,
    /// Dots without any ink.
    pub bare: u64,
    /// What had to be assumed, including the notes of the art.
    pub notes: Vec<String>,
}

/// Art as stacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Composed {
    /// The dots.
    pub dots: DotMap,
    /// A report on them.
    pub report: Report,
    /// What the art lacks.
    pub suggestions: Vec<Suggestion>,
}

/// Composes art to one stack for every dot.
///
/// # Errors
/// Settings that do not suit the art, more passes than a sheet can take, art without a dot.
pub fn compose(
    art: &Artwork,
    settings: &Settings,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Composed, Diagnosis> {
    let mut notes = art.notes.clone();
    let mut tell = |note: String| {
        observer.note(&note);
        notes.push(note);
    };
    if art.width as u64 * art.length as u64 == 0 {
        return Err(too_small(art.width as f64 * MM, art.length as f64 * MM));
    }
    suggest::white_beneath(art.white_kept, &art.knocked_out).for_each(&mut tell);
    let (mut separations, picked) = drawn_separations(art, settings, library, observer, &mut tell)?;
    underbase::lay_white(&mut separations, art, settings, &mut tell)?;
    underbase::lay_finish(&mut separations, art, settings)?;
    separations.retain(|separation| separation.plane.dots() > 0);
    if separations.is_empty() {
        let is_drawn = art.opaque.as_ref().is_some_and(|opaque| opaque.dots() > 0);
        let reason = match &art.layers[..] {
            [] if is_drawn => return Err(only_white(&art.name)),
            [] => format!("{} is white or transparent everywhere", art.name),
            _ => format!("no layer of {} has a dot", art.name),
        };
        return Err(nothing(reason));
    }
    let mut inks: Vec<Ink> = separations.iter().map(|separation| separation.ink).collect();
    inks.sort_unstable();
    inks.dedup();
    let mut separations = arrange::arranged(separations, &settings.order, library)?;
    for separation in &mut separations {
        separation.passes =
            usize::from(settings.passes.iter().find(|(ink, _)| *ink == separation.ink).map_or(1, |p| p.1));
    }
    if let Some((ink, _)) = settings.passes.iter().find(|(ink, _)| !inks.contains(ink)) {
        tell(format!("the art has no {}, so its number of passes has no effect", ink.name()));
    }
    let passes: usize = separations.iter().map(|separation| separation.passes).sum();
    if passes > MOST_PASSES {
        let inks = separations
            .iter()
            .flat_map(|separation| vec![separation.ink.name(); separation.passes])
            .collect::<Vec<_>>()
            .join(", ");
        return Err(too_many_passes(passes, &inks));
    }
    let planes: Vec<&Plane> = separations.iter().map(|separation| &separation.plane).collect();
    let census = match settings.accept[..] {
        [] => Vec::new(),
        _ => pack::census(&planes, art.width, art.length),
    };
    for &accepted in &settings.accept {
        let without = settings.accept.iter().copied().filter(|other| *other != accepted).collect();
        let without = Settings { accept: without, ..settings.clone() };
        let is_idle = match accepted {
            Accept::WhiteKept => art.white_kept == 0,
            _ => census.iter().enumerate().filter(|(_, count)| **count > 0).all(|(mask, _)| {
                layers(&separations, mask, settings) == layers(&separations, mask, &without)
            }),
        };
        if is_idle {
            tell(accepted.note());
        }
    }
    // White and finish beneath and on them make other stacks of what was picked.
    let is_bare = matches!(settings.white, None | Some(White::None))
        && matches!(settings.finish, None | Some(Finish::None));
    stack_up(art, &separations, picked.filter(|_| is_bare), settings, notes)
}

/// The stack of each dot, and for each stack the inks that it has, a bit each.
struct Stacked {
    index: Vec<u8>,
    inks_of: [u16; 256],
    inks: Vec<Ink>,
}

/// The layers of the art itself, with tones and colours halftoned; and what was picked for its colours if it has nothing else.
fn drawn_separations(
    art: &Artwork,
    settings: &Settings,
    library: &Library,
    observer: &dyn Observer,
    tell: &mut dyn FnMut(String),
) -> Result<(Vec<Separation>, Option<Stacked>), Diagnosis> {
    let mut separations: Vec<Separation> = Vec::new();
    let mut together = picked_together(art, settings, library)?;
    for (at, layer) in art.layers.iter().enumerate() {
        let name = layer.ink.name();
        let unwanted = match layer.ink {
            Ink::White => settings.white == Some(White::None),
            Ink::Finish => settings.finish == Some(Finish::None),
            _ => false,
        };
        if unwanted {
            tell(format!("{}: left out, because the settings ask for no {name}", layer.name));
            continue;
        }
        if !settings.inks.contains(layer.ink) {
            if layer.ink.kind() == Kind::Foil {
                return Err(foil(&layer.name, layer.ink));
            }
            tell(format!("{}: left out, because {name} is not among the allowed inks", layer.name));
            continue;
        }
        let plane = match &layer.shape {
            Shape::Solid(plane) => plane.clone(),
            Shape::Tone(coverage) => match together.iter().position(|(number, _)| *number == at) {
                Some(found) => together.swap_remove(found).1,
                None => tone(coverage, art, layer.ink, settings, library, observer)?,
            },
        };
        let (ink, from, place) = (layer.ink, layer.name.clone(), layer.place);
        separations.push(Separation { ink, from, place, plane, passes: 1 });
    }
    if let Some(colour) = &art.colour {
        let process = InkSet::of(settings.inks.iter().filter(|ink| ink.kind() == Kind::Process));
        if process.is_empty() {
            tell("the picture's colours are left out, because no process ink is allowed".into());
            return Ok((separations, None));
        }
        let how = How {
            intent: settings.intent,
            gamma: settings.gamma,
            halftone: settings.halftone,
            labels: settings.text == Text::Solid,
        };
        let Picked { planes, stacks } =
            colour.picked((art.width, art.length), &process, how, library, observer)?;
        if separations.is_empty() {
            let inks = planes.iter().map(|(ink, _)| *ink).collect();
            let separation =
                |(ink, plane)| Separation { ink, from: COLOURS.into(), place: None, plane, passes: 1 };
            let stacked = stacks.map(|(index, inks_of)| Stacked { index, inks_of, inks });
            return Ok((planes.into_iter().map(separation).collect(), stacked));
        }
        let mut spot = bitplane::blank(art.width, art.length);
        separations.iter().for_each(|separation| bitplane::add(&mut spot, &separation.plane));
        for (ink, mut plane) in planes {
            if !colour.overprints {
                // Dots of a layer, such as a reserved colour, keep that ink alone.
                bitplane::merge(&mut plane, &spot, |dots, spot| dots & !spot);
            }
            match separations.iter_mut().find(|separation| separation.ink == ink) {
                Some(separation) => bitplane::add(&mut separation.plane, &plane),
                None => {
                    separations.push(Separation { ink, from: COLOURS.into(), place: None, plane, passes: 1 })
                }
            }
        }
    }
    Ok((separations, None))
}

/// The numbers of the layers with tones of process inks whose dots are picked from one table, and their dots.
fn picked_together(
    art: &Artwork,
    settings: &Settings,
    library: &Library,
) -> Result<Vec<(usize, Plane)>, Diagnosis> {
    let mut found: Vec<(usize, (Ink, &[u8]))> = Vec::new();
    let is_known = |found: &[(usize, (Ink, &[u8]))], ink: Ink| found.iter().any(|(_, plate)| plate.0 == ink);
    for (at, layer) in art.layers.iter().enumerate() {
        let is_process = layer.ink.kind() == Kind::Process && settings.inks.contains(layer.ink);
        if let (Shape::Tone(coverage), true, false) =
            (&layer.shape, is_process && settings.halftone == Method::Fine, is_known(&found, layer.ink))
        {
            found.push((at, (layer.ink, coverage)));
        }
    }
    found.truncate(plates::MOST);
    if found.is_empty() {
        return Ok(Vec::new());
    }
    let (numbers, together): (Vec<usize>, Vec<(Ink, &[u8])>) = found.into_iter().unzip();
    Ok(numbers.into_iter().zip(plates::picked(&together, art.width, library)?).collect())
}

/// Halftones a layer with tones, in clusters large enough for its ink.
fn tone(
    coverage: &[u8],
    art: &Artwork,
    ink: Ink,
    settings: &Settings,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Plane, Diagnosis> {
    let weights = coverage.iter().flat_map(|&c| {
        let ink = ((u32::from(c) * u32::from(ONE) + 127) / 255) as u16;
        [ONE - ink, ink]
    });
    let maps = WeightMaps::new(art.width, art.length, 2, weights.collect()).map_err(unfitted)?;
    let stacks = vec![Stack::SUBSTRATE, Stack::new([ink])];
    let mix = InkMix { stacks, maps, matrix: vec![vec![ONE, 0], vec![0, ONE]] };
    let (width, height) = (art.width as u16, art.length as u16);
    let method = match settings.halftone {
        // Foils and metals need cells of their own.
        Method::Fine if ink.kind() != Kind::Process => Method::Cells,
        method => method,
    };
    let toning = halftone::Settings { method, ..halftone::Settings::from_library(&mix.stacks, library) };
    // What the plate has wholly or not at all is no tone.
    let fixed = coverage.par_iter().map(|&c| match c {
        0 => 0,
        255 => 1,
        _ => halftone::TONE,
    });
    let fixed: Vec<u8> = fixed.collect();
    let dots = halftone(&mix, (width, height), Some(&fixed), &toning, observer).map_err(not_halftoned)?;
    Ok(bitplane::from_bytes(art.width, dots.index(), |stack| stack == 1))
}

/// The inks on a dot with the separations of `mask`, from the paper up.
fn layers(separations: &[Separation], mask: usize, settings: &Settings) -> Vec<Ink> {
    let mut layers: Vec<Ink> = Vec::new();
    for (_, separation) in separations.iter().enumerate().filter(|(at, _)| mask & 1 << at != 0) {
        if settings.knockout.contains(separation.ink) {
            layers.retain(|ink| ink.kind() != Kind::Process);
        }
        let three_times = separation.ink == Ink::White
            && separation.passes == 1
            && settings.accept.contains(&Accept::WhiteThrice);
        let passes = if three_times { 3 } else { separation.passes };
        layers.extend(std::iter::repeat_n(separation.ink, passes));
    }
    if settings.accept.contains(&Accept::FoilUndercoat)
        && let Some(foil) = layers.iter().position(|ink| ink.kind() == Kind::Foil)
    {
        // All process inks in their customary order replace those directly beneath the foil.
        let from = layers[..foil].iter().rposition(|ink| ink.kind() != Kind::Process).map_or(0, |at| at + 1);
        let mut coat: Vec<Ink> = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Process).collect();
        coat.sort_by_key(|&ink| customary(ink));
        layers.splice(from..foil, coat);
    }
    if settings.accept.contains(&Accept::SilverUnderWhite) && layers.first() == Some(&Ink::White) {
        layers.insert(0, Ink::MetallicSilver);
    }
    if settings.accept.contains(&Accept::EvenWhite)
        && let Some(at) = layers.windows(2).position(|pair| pair == [Ink::Black, Ink::White])
    {
        layers.splice(at + 1..at + 1, [Ink::Primer, Ink::Finish, Ink::Primer]);
    }
    layers
}

/// Makes a stack of every combination of separations that occurs. What was `picked` is these separations, a dot at a time.
fn stack_up(
    art: &Artwork,
    separations: &[Separation],
    picked: Option<Stacked>,
    settings: &Settings,
    notes: Vec<String>,
) -> Result<Composed, Diagnosis> {
    let (width, length) = (art.width, art.length);
    let planes: Vec<&Plane> = separations.iter().map(|separation| &separation.plane).collect();
    let picked = picked.map(|Stacked { index, inks_of, inks }| {
        // An ink may be listed at two depths.
        let has = |bits: u16, separation: &Separation| {
            inks.iter().zip(0..).any(|(ink, at)| *ink == separation.ink && bits >> at & 1 > 0)
        };
        let mask = |bits: u16| {
            separations
                .iter()
                .enumerate()
                .filter(|(_, separation)| has(bits, separation))
                .fold(0, |mask, (at, _)| mask | 1 << at)
        };
        (index, inks_of.map(mask))
    });
    let census = match &picked {
        Some((index, masks)) => {
            let mut census = vec![0; 1 << separations.len()];
            let counts: Vec<[u64; 256]> =
                index.par_chunks(1 << 20).map(|dots| sheet::census([dots].into_iter())).collect();
            for (count, &mask) in counts.iter().flat_map(|counts| counts.iter().zip(masks)) {
                census[mask] += count;
            }
            census
        }
        None => pack::census(&planes, width, length),
    };
    let mut stacks = vec![Stack::SUBSTRATE];
    let mut counts = vec![0u64];
    let mut stack_of = vec![0u16; census.len()];
    for (mask, &count) in census.iter().enumerate().filter(|(_, count)| **count > 0) {
        let stack = Stack::new(layers(separations, mask, settings));
        let number = stacks.iter().position(|known| *known == stack).unwrap_or_else(|| {
            stacks.push(stack);
            counts.push(0);
            stacks.len() - 1
        });
        counts[number] += count;
        // More than 256 stacks are refused below.
        stack_of[mask] = number.min(256) as u16;
    }
    let index = match picked {
        Some((mut index, masks)) => {
            let number = masks.map(|mask: usize| stack_of[mask] as u8);
            let renumber = |dots: &mut [u8]| dots.iter_mut().for_each(|dot| *dot = number[usize::from(*dot)]);
            if number.iter().zip(0..).any(|(&number, old)| number != old) {
                index.par_chunks_mut(1 << 16).for_each(renumber);
            }
            index
        }
        // Every combination that occurs has an entry in the table, so unpacking always succeeds.
        None => pack::unpack(&planes, width, length, &stack_of).unwrap_or_default(),
    };
    let dots = DotMap::new(width, length, stacks, index).map_err(no_sheet)?;
    let laid: Vec<InkLayer> = separations
        .iter()
        .enumerate()
        .map(|(at, separation)| InkLayer {
            ink: separation.ink.name(),
            dots: census
                .iter()
                .enumerate()
                .filter(|(mask, _)| mask & 1 << at != 0)
                .map(|(_, count)| count)
                .sum(),
            from: separation.from.clone(),
            passes: separation.passes,
        })
        .collect();
    let order: Vec<Ink> = separations.iter().map(|separation| separation.ink).collect();
    let mut suggestions = suggest::suggest(dots.stacks(), &counts, &order);
    suggestions.extend(suggest::rare(&laid));
    suggestions.extend(suggest::knocked_out(&art.knocked_out));
    let size_mm = ((width / art.across) as f64 * MM, length as f64 * MM);
    Ok(Composed { report: Report { size_mm, laid, bare: counts[0], notes }, dots, suggestions })
}

#[cfg(test)]
mod tests;
