//! Layers to stacks: white, finish, order, repeats, knock-out, undercoats.
//!
//! Problem: layers say where inks are, a sheet says what lies on each dot, bottom to top, and some inks need others
//! beneath them that nobody drew.
//! Method: every layer is a plane; tones and colours are halftoned to planes. Eight dots of all planes at a time make
//! the combinations that occur, which are counted, and each is turned into a stack once: in the order of the inks
//! ([`Order`]), each as often as [`Settings::passes`] says, with knocked-out inks taken away and accepted undercoats put
//! in. What the art needs and did not ask for comes back as [`Suggestion`]s, never silently.
//! Cost: about 2 ns a dot and the halftones'. Limits: [`MOST_PASSES`] planes, 256 stacks.

use inks::{InkSet, Library, Stack};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;
use serde::Serialize;

use super::raster::MM;
use super::{Artwork, LayersError, Shape, White, bits, distance, order, white};
use crate::gamut::InkMix;
use crate::halftone::Placement;
use crate::observe::Observer;
use crate::pipeline;
use crate::separate::{MOST_PASSES, Plane, customary, pack};
use crate::sheet::Piece;
use crate::weights::{ONE, WeightMaps};

/// In which order layers lie on the paper.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Order {
    /// As their numbered names say if all are numbered, otherwise by the ink library's rules.
    #[default]
    Usual,
    /// By the ink library's rules.
    Rules,
    /// As given, first lowest.
    Given,
    /// In this order from the paper up. An ink may stand twice: its layer is laid at both depths.
    Inks(Vec<Ink>),
}

/// Where glossy finish goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Finish {
    /// On what is drawn.
    Artwork,
    /// On the whole rectangle of the art.
    All,
    /// Nowhere, not even where the art draws it.
    None,
}

/// A suggestion that the user accepts: what the plan adds to the art.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Accept {
    /// Solid cyan, magenta, yellow and black beneath every foil.
    FoilUndercoat,
    /// Primer, finish, primer between black and the white on it.
    EvenWhite,
    /// Three layers of white where there is one.
    WhiteThrice,
}

impl Accept {
    /// As typed.
    pub fn name(self) -> &'static str {
        match self {
            Accept::FoilUndercoat => "foil-undercoat",
            Accept::EvenWhite => "even-white",
            Accept::WhiteThrice => "white-thrice",
        }
    }
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

/// Something the print needs that the art does not have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Suggestion {
    /// What and why.
    pub text: String,
    /// What to add to the command to have it.
    pub how: String,
    /// How many dots it is about.
    pub dots: u64,
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
    lay_white(&mut slots, art, settings, &mut tell)?;
    lay_finish(&mut slots, art, settings)?;
    slots.retain(|slot| slot.plane.dots() > 0);
    if slots.is_empty() {
        let reason = format!("no layer of {} has a dot", art.name);
        return Err(LayersError::Nothing { reason });
    }
    let mut inks: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
    inks.sort_unstable();
    inks.dedup();
    let mut slots = arranged(slots, &settings.order, library)?;
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
                None => slots.push(Slot {
                    ink,
                    from: "the picture's colours".into(),
                    place: None,
                    plane,
                    passes: 1,
                }),
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
        .map_err(crate::gamut::GamutError::from)?;
    let stacks = vec![Stack::SUBSTRATE, Stack::new([ink])];
    let mix = InkMix { stacks, maps, matrix: vec![vec![ONE, 0], vec![0, ONE]] };
    let (width, height) = (art.width as u16, art.length as u16);
    let place = Placement { paper: Paper::Custom { width, length: height }, x: 0, y: 0, width, height };
    let sheet = pipeline::halftone_mix(&mix, library, &place, observer)?;
    Ok(bits::from_bytes(art.width, sheet.index(), |stack| stack == 1))
}

/// Adds white where the settings say, and chokes or spreads it.
fn lay_white(
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
fn lay_finish(slots: &mut Vec<Slot>, art: &Artwork, settings: &Settings) -> Result<(), LayersError> {
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

/// The slots from the paper up.
fn arranged(slots: Vec<Slot>, wanted: &Order, library: &Library) -> Result<Vec<Slot>, LayersError> {
    let numbered = slots.iter().all(|slot| slot.place.is_some());
    let twice = (1..slots.len()).find(|&i| slots[..i].iter().any(|slot| slot.ink == slots[i].ink));
    let mut slots = slots;
    match wanted {
        Order::Given => {}
        Order::Usual if numbered => slots.sort_by_key(|slot| slot.place),
        Order::Usual | Order::Rules => {
            if let Some(twice) = twice {
                return Err(LayersError::Setting {
                    option: "--order",
                    problem: format!(
                        "{} layers are of {}; say at which depth each lies: number the files from the paper up \
                         (01-white.png, 02-black.png, 03-white.png), or use --order given",
                        slots.iter().filter(|slot| slot.ink == slots[twice].ink).count(),
                        slots[twice].ink.name()
                    ),
                });
            }
            let inks: Vec<Ink> = slots.iter().map(|slot| slot.ink).collect();
            let order = order::by_rules(&inks, library);
            slots.sort_by_key(|slot| order.iter().position(|&ink| ink == slot.ink));
        }
        Order::Inks(order) => return in_order(slots, order),
    }
    Ok(slots)
}

/// The slots as listed; an ink listed more often than it has layers is laid there again.
fn in_order(slots: Vec<Slot>, order: &[Ink]) -> Result<Vec<Slot>, LayersError> {
    let wrong = |problem: String| Err(LayersError::Setting { option: "--order", problem });
    if let Some(slot) = slots.iter().find(|slot| !order.contains(&slot.ink)) {
        return wrong(format!("{} ({}) is not in the list", slot.ink.name(), slot.from));
    }
    let mut arranged: Vec<Slot> = Vec::new();
    for (at, &ink) in order.iter().enumerate() {
        let of_ink: Vec<&Slot> = slots.iter().filter(|slot| slot.ink == ink).collect();
        let nth = order[..at].iter().filter(|&&before| before == ink).count();
        let times = order.iter().filter(|&&listed| listed == ink).count();
        let Some(last) = of_ink.last() else {
            return wrong(format!("the art has no {}", ink.name()));
        };
        if of_ink.len() > times {
            return wrong(format!("{} has {} layers and is listed {times} times", ink.name(), of_ink.len()));
        }
        let slot = of_ink.get(nth).unwrap_or(last);
        let (from, plane) = (slot.from.clone(), slot.plane.clone());
        arranged.push(Slot { ink, from, place: None, plane, passes: 1 });
    }
    Ok(arranged)
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
    let laid = slots
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
    let suggestions = suggest(piece.stacks(), &dots, &order);
    let size_mm = (width as f64 * MM, length as f64 * MM);
    Ok(Composed { report: Report { size_mm, laid, bare: dots[0], notes }, piece, suggestions })
}

/// What the stacks need; `order` are the inks from the paper up.
fn suggest(stacks: &[Stack], dots: &[u64], order: &[Ink]) -> Vec<Suggestion> {
    let about = |touches: &dyn Fn(&[Ink]) -> bool| -> u64 {
        stacks.iter().zip(dots).filter(|(stack, _)| touches(stack.layers())).map(|(_, dots)| dots).sum()
    };
    let process = |layers: &[Ink]| {
        Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Process).all(|ink| layers.contains(&ink))
    };
    let bare_foil = about(&|layers| {
        layers.iter().position(|ink| ink.kind() == Kind::Foil).is_some_and(|foil| !process(&layers[..foil]))
    });
    let white_on_black = about(&|layers| layers.windows(2).any(|pair| pair == [Ink::Black, Ink::White]));
    let thin_white = about(&|layers| layers.iter().filter(|&&ink| ink == Ink::White).count() == 1);
    let primed = about(&|layers| layers.contains(&Ink::Primer));
    let metal = |layers: &[Ink]| layers.iter().position(|ink| ink.kind() == Kind::Metallic);
    let metals = about(&|layers| metal(layers).is_some());
    let covered = about(&|layers| metal(layers).is_some_and(|metal| layers[metal..].contains(&Ink::Black)));
    // A little black on metal is lettering; most of the metal under black is a mistake.
    let hidden = if 2 * covered > metals { covered } else { 0 };
    let (metal_inks, others): (Vec<Ink>, Vec<Ink>) =
        order.iter().partition(|ink| ink.kind() == Kind::Metallic);
    let beneath = others.iter().rposition(|ink| ink.kind() == Kind::Process).map_or(0, |at| at + 1);
    let metal_above = [&others[..beneath], &metal_inks, &others[beneath..]].concat();
    let metal_above: Vec<_> = metal_above.into_iter().map(Ink::name).collect();
    let accept = |what: Accept| format!("--accept {}", what.name());
    [
        (
            bare_foil,
            "foil prints properly only on a solid of cyan, magenta, yellow and black, for grip and gloss",
            accept(Accept::FoilUndercoat),
        ),
        (
            white_on_black,
            "white straight on black is full of missing points; primer, finish and primer between them make it even",
            accept(Accept::EvenWhite),
        ),
        (thin_white, "one layer of white looks grey; three are nearly white", accept(Accept::WhiteThrice)),
        (
            primed,
            "primer can tear its ribbon on the settings for plain paper; those for cardboard cured it",
            "--media cardboard".into(),
        ),
        (
            hidden,
            "black covers most of the metallic ink; laid above black the metal is seen, and black is left out beneath it",
            format!("--order {}", metal_above.join(",")),
        ),
    ]
    .into_iter()
    .filter(|(dots, ..)| *dots > 0)
    .map(|(dots, text, how)| Suggestion { text: text.into(), how, dots })
    .collect()
}

#[cfg(test)]
mod tests;
