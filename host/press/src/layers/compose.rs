//! Layers to stacks: white, finish, order, repeats, knock-out, undercoats.
//!
//! Problem: layers say where inks are, a sheet says what lies on each dot, bottom to top, and some inks need others
//! beneath them that nobody drew.
//! Method: every layer is a plane; tones and colours are halftoned to planes. Eight dots of all planes at a time make
//! the combinations that occur, which are counted, and each is turned into a stack once: in the order of the inks
//! ([`Order`]), each as often as [`Settings::passes`] says, with knocked-out inks taken away and accepted undercoats put
//! in. What the art needs and did not ask for comes back as [`Suggestion`]s, never silently.
//! Cost: about 2 ns a dot and the halftones'. Limits: [`MOST_PASSES`] planes, 256 stacks.

mod arrange;
mod beds;
mod suggest;

use inks::{InkSet, Library, Stack};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;
use serde::Serialize;

use super::raster::MM;
use super::{Artwork, LayersError, Shape, White, bits};
use crate::halftone::Placement;
use crate::pipeline;
use crate::separate::{MOST_PASSES, Plane, customary, pack};
use crate::sheet::Piece;
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps};
use observe::Observer;

pub use arrange::Order;
pub use suggest::{Accept, Suggestion};

/// Where glossy finish goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Finish {
    /// On what is drawn.
    Artwork,
    /// On the whole rectangle of the art.
    All,
    /// Nowhere, not even where the art draws it.
    None,
}

/// How layers become stacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The inks that may be used. Layers of others are left out and named in a note; foils must be among them.
    pub inks: InkSet,
    /// The order from the paper up.
    pub order: Order,
    /// How often an ink is laid in each of its layers; once when it is not listed.
    pub passes: Vec<(Ink, u8)>,
    /// Inks that leave out the process inks beneath them on their dots.
    pub knockout: InkSet,
    /// Where white goes; where the art draws it when not given.
    pub white: Option<White>,
    /// Dots the white is shrunk by, 0 to 236; negative to spread it.
    pub choke: f64,
    /// Where finish goes; where the art draws it when not given.
    pub finish: Option<Finish>,
    /// The suggestions that are accepted.
    pub accept: Vec<Accept>,
}

impl Default for Settings {
    fn default() -> Settings {
        let metallic = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Metallic);
        Settings {
            inks: InkSet::default().with(Ink::White),
            order: Order::Usual,
            passes: Vec::new(),
            knockout: InkSet::of(metallic),
            white: None,
            choke: 0.0,
            finish: None,
            accept: Vec::new(),
        }
    }
}

/// One ink at one depth.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Laid {
    /// Name of the ink.
    pub ink: &'static str,
    /// Dots that have it.
    pub dots: u64,
    /// Where it comes from.
    pub from: String,
    /// How often it is laid on each of them.
    pub passes: usize,
}

/// What was composed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Width and height in millimetres.
    pub size_mm: (f64, f64),
    /// The inks from the paper up.
    pub laid: Vec<Laid>,
    /// Dots without any ink.
    pub bare: u64,
    /// What was decided on the user's behalf, those of the art included.
    pub notes: Vec<String>,
}

/// Art as stacks.
#[derive(Clone, Debug, PartialEq)]
pub struct Composed {
    /// The dots.
    pub piece: Piece,
    /// What was composed.
    pub report: Report,
    /// What the art needs.
    pub suggestions: Vec<Suggestion>,
}

/// Where the planes of plain colour come from.
const COLOURS: &str = "the picture's colours";

/// A plane on its way into the stacks.
struct Slot {
    ink: Ink,
    from: String,
    place: Option<u32>,
    plane: Plane,
    passes: usize,
}

/// Composes art to one stack for every dot.
///
/// # Errors
/// Settings that do not fit the art, more layers than the machine takes, nothing to print.
pub fn compose(
    art: &Artwork,
    settings: &Settings,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Composed, LayersError> {
    let mut notes = art.notes.clone();
    let mut tell = |note: String| {
        observer.note(&note);
        notes.push(note);
    };
    if art.width as u64 * art.length as u64 == 0 {
        return Err(LayersError::TooSmall {
            width_mm: art.width as f64 * MM,
            height_mm: art.length as f64 * MM,
        });
    }
    let mut slots = drawn_slots(art, settings, library, observer, &mut tell)?;
    beds::lay_white(&mut slots, art, settings, &mut tell)?;
    beds::lay_finish(&mut slots, art, settings)?;
    slots.retain(|slot| slot.plane.dots() > 0);
    if slots.is_empty() {
        let reason = format!("no layer of {} has a dot", art.name);
        return Err(LayersError::Nothing { reason });
    }
    let mut inks: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
    inks.sort_unstable();
    inks.dedup();
    let mut slots = arrange::arranged(slots, &settings.order, library)?;
    for slot in &mut slots {
        slot.passes =
            usize::from(settings.passes.iter().find(|(ink, _)| *ink == slot.ink).map_or(1, |p| p.1));
    }
    if let Some((ink, _)) = settings.passes.iter().find(|(ink, _)| !inks.contains(ink)) {
        tell(format!("--passes: there is no {} to lay more often", ink.name()));
    }
    let passes: usize = slots.iter().map(|slot| slot.passes).sum();
    if passes > MOST_PASSES {
        let inks =
            slots.iter().flat_map(|slot| vec![slot.ink.name(); slot.passes]).collect::<Vec<_>>().join(", ");
        return Err(LayersError::Passes { passes, inks });
    }
    stack_up(art, &slots, settings, notes)
}

/// The art's own layers, tones and colours halftoned.
fn drawn_slots(
    art: &Artwork,
    settings: &Settings,
    library: &Library,
    observer: &dyn Observer,
    tell: &mut dyn FnMut(String),
) -> Result<Vec<Slot>, LayersError> {
    let mut slots: Vec<Slot> = Vec::new();
    for layer in &art.layers {
        let name = layer.ink.name();
        let unwanted = match layer.ink {
            Ink::White => settings.white == Some(White::None),
            Ink::Finish => settings.finish == Some(Finish::None),
            _ => false,
        };
        if unwanted {
            tell(format!("{}: left out, since no {name} is wanted", layer.name));
            continue;
        }
        if !settings.inks.contains(layer.ink) {
            if layer.ink.kind() == Kind::Foil {
                return Err(LayersError::Setting {
                    option: "--inks",
                    problem: format!(
                        "{} asks for {name}; the codes of the foils are inferred and were never seen on hardware, so they \
                         are printed only when asked for: add --inks +{name}",
                        layer.name
                    ),
                });
            }
            tell(format!("{}: left out, since {name} is not among --inks", layer.name));
            continue;
        }
        let plane = match &layer.shape {
            Shape::Solid(plane) => plane.clone(),
            Shape::Tone(coverage) => tone(coverage, art, layer.ink, library, observer)?,
        };
        let (ink, from, place) = (layer.ink, layer.name.clone(), layer.place);
        slots.push(Slot { ink, from, place, plane, passes: 1 });
    }
    if let Some(colour) = &art.colour {
        let process = InkSet::of(settings.inks.iter().filter(|ink| ink.kind() == Kind::Process));
        if process.is_empty() {
            tell("the picture's colours are left out, since --inks has no process ink".into());
            return Ok(slots);
        }
        let (stacks, index) = colour.halftone((art.width, art.length), &process, library, observer)?;
        let mut spot = bits::blank(art.width, art.length);
        slots.iter().for_each(|slot| bits::add(&mut spot, &slot.plane));
        let mut inks_of = [0u16; 256];
        for (inks_of, stack) in inks_of.iter_mut().zip(&stacks) {
            let has = process.iter().enumerate().filter(|(_, ink)| stack.layers().contains(ink));
            *inks_of = has.fold(0, |bits, (at, _)| bits | 1 << at);
        }
        let planes = pack::pack(art.width, &index, &inks_of, process.len());
        for (ink, mut plane) in process.iter().zip(planes) {
            // What an ink was drawn for by its reserved colour is that ink alone.
            bits::merge(&mut plane, &spot, |dots, spot| dots & !spot);
            match slots.iter_mut().find(|slot| slot.ink == ink) {
                Some(slot) => bits::add(&mut slot.plane, &plane),
                None => slots.push(Slot { ink, from: COLOURS.into(), place: None, plane, passes: 1 }),
            }
        }
    }
    Ok(slots)
}

/// A layer with tones as dots of its ink, in clusters the ink holds.
fn tone(
    coverage: &[u8],
    art: &Artwork,
    ink: Ink,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Plane, LayersError> {
    let weights = coverage.iter().flat_map(|&c| {
        let ink = ((u32::from(c) * u32::from(ONE) + 127) / 255) as u16;
        [ONE - ink, ink]
    });
    let maps = WeightMaps::new(art.width, art.length, 2, weights.collect())
        .map_err(appearance::gamut::GamutError::from)?;
    let stacks = vec![Stack::SUBSTRATE, Stack::new([ink])];
    let mix = InkMix { stacks, maps, matrix: vec![vec![ONE, 0], vec![0, ONE]] };
    let (width, height) = (art.width as u16, art.length as u16);
    let place = Placement { paper: Paper::Custom { width, length: height }, x: 0, y: 0, width, height };
    let sheet = pipeline::halftone_mix(&mix, library, &place, Default::default(), observer)?;
    Ok(bits::from_bytes(art.width, sheet.index(), |stack| stack == 1))
}

/// The layers of a dot that has the slots of `mask`.
fn layers(slots: &[Slot], mask: usize, settings: &Settings) -> Vec<Ink> {
    let mut layers: Vec<Ink> = Vec::new();
    for (_, slot) in slots.iter().enumerate().filter(|(at, _)| mask & 1 << at != 0) {
        if settings.knockout.contains(slot.ink) {
            layers.retain(|ink| ink.kind() != Kind::Process);
        }
        let thrice =
            slot.ink == Ink::White && slot.passes == 1 && settings.accept.contains(&Accept::WhiteThrice);
        let passes = if thrice { 3 } else { slot.passes };
        layers.extend(std::iter::repeat_n(slot.ink, passes));
    }
    if settings.accept.contains(&Accept::FoilUndercoat)
        && let Some(foil) = layers.iter().position(|ink| ink.kind() == Kind::Foil)
    {
        // The process inks directly beneath, completed, in their customary order.
        let from = layers[..foil].iter().rposition(|ink| ink.kind() != Kind::Process).map_or(0, |at| at + 1);
        let mut coat: Vec<Ink> = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Process).collect();
        coat.sort_by_key(|&ink| customary(ink));
        layers.splice(from..foil, coat);
    }
    if settings.accept.contains(&Accept::EvenWhite)
        && let Some(at) = layers.windows(2).position(|pair| pair == [Ink::Black, Ink::White])
    {
        layers.splice(at + 1..at + 1, [Ink::Primer, Ink::Finish, Ink::Primer]);
    }
    layers
}

fn stack_up(
    art: &Artwork,
    slots: &[Slot],
    settings: &Settings,
    notes: Vec<String>,
) -> Result<Composed, LayersError> {
    let (width, length) = (art.width, art.length);
    let planes: Vec<&Plane> = slots.iter().map(|slot| &slot.plane).collect();
    let census = pack::census(&planes, width, length);
    let mut stacks = vec![Stack::SUBSTRATE];
    let mut dots = vec![0u64];
    let mut stack_of = vec![0u16; census.len()];
    for (mask, &count) in census.iter().enumerate().filter(|(_, count)| **count > 0) {
        let stack = Stack::new(layers(slots, mask, settings));
        let number = stacks.iter().position(|known| *known == stack).unwrap_or_else(|| {
            stacks.push(stack);
            dots.push(0);
            stacks.len() - 1
        });
        dots[number] += count;
        // More than 256 stacks are refused below, by the piece.
        stack_of[mask] = number.min(256) as u16;
    }
    // No entry of the table says there is no stack, so there is no such dot.
    let index = pack::unpack(&planes, width, length, &stack_of).unwrap_or_default();
    let piece = Piece::new(width, length, stacks, index)?;
    let laid: Vec<Laid> = slots
        .iter()
        .enumerate()
        .map(|(at, slot)| Laid {
            ink: slot.ink.name(),
            dots: census
                .iter()
                .enumerate()
                .filter(|(mask, _)| mask & 1 << at != 0)
                .map(|(_, count)| count)
                .sum(),
            from: slot.from.clone(),
            passes: slot.passes,
        })
        .collect();
    let order: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
    let mut suggestions = suggest::suggest(piece.stacks(), &dots, &order);
    suggestions.extend(suggest::rare(&laid, &settings.inks));
    let size_mm = (width as f64 * MM, length as f64 * MM);
    Ok(Composed { report: Report { size_mm, laid, bare: dots[0], notes }, piece, suggestions })
}

#[cfg(test)]
mod tests;
