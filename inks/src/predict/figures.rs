//! The figures of the model as numbers that a fit can move.
//!
//! Problem: the figures are shares, widths and colours with different ranges, some of them products (the reflectance of a
//! metal and its tint) that no curve can tell apart.
//! Method: one positive number for each degree of freedom, as its logarithm. Solids and paper are linear RGB instead of CIELAB, so that
//! each channel is a number of its own. Diffuse and specular reflectance of a metal are one colour each. A figure that nobody measured
//! keeps the library's value as a prior, with a spread that says how far it may be off; curves have the last word.
//! Limits: the reflectance of aluminium, the share that the surface takes and the floor of dark channels are not fitted:
//! every curve holds them only as a product with figures that are.

use protocol::ink::Ink;

use crate::lab;
use crate::model::{Layer, Optics};
use crate::provenance::Figure;
use crate::stack::Stack;

/// Shares below this cannot be told from none.
const LEAST: f64 = 1e-5;
/// The floor of dark channels while figures are fitted: dark inks are what they were measured to be.
const DARKEST: f64 = 1e-4;
/// A channel of a solid below this is known only to be dark.
const DARK: f64 = 0.05;

const SHARE: [f64; 2] = [LEAST, 1.0];
const ALPHA: [f64; 2] = [0.01, 1.0];
const FACTOR: [f64; 2] = [0.1, 4.0];

/// A number of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// A channel of the paper's albedo.
    Paper(usize),
    PaperF0,
    PaperAlpha,
    InkOnMetalF0,
    InkOnMetalWidening,
    InkOnMetalAlpha,
    CoatInternal,
    CoatWidening,
    /// A channel of a process ink's solid on the paper.
    Solid(Ink, usize),
    FilterF0(Ink),
    FilterAlpha(Ink),
    /// A channel of a metal's body.
    Diffuse(Ink, usize),
    /// A channel of a metal's reflectance, as a share of aluminium's.
    Reflectance(Ink, usize),
    SeenPower(Ink),
    MetalAlpha(Ink),
    AlphaOnPrimer(Ink),
    BinderF0(Ink),
    BinderAlpha(Ink),
    Transmission(Ink),
    Levelling(Ink),
    CoatF0(Ink),
    CoatAlpha(Ink),
}

/// Where a number is kept.
enum FigureTarget<'a> {
    Scalar(&'a mut Figure<f64>),
    Channel(&'a mut Figure<[f64; 3]>, usize),
    /// A channel of a colour that is kept as CIELAB.
    Colour(&'a mut Figure<[f64; 3]>, usize),
}

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

impl Slot {
    /// Its name, such as `cyan.solid.red`.
    pub fn name(self) -> String {
        let of = |ink: Ink, name: &str| format!("{}.{name}", ink.name());
        let channel = |ink: Ink, name: &str, c: usize| format!("{}.{name}.{}", ink.name(), CHANNELS[c]);
        match self {
            Slot::Paper(c) => format!("paper.albedo.{}", CHANNELS[c]),
            Slot::PaperF0 => "paper.f0".into(),
            Slot::PaperAlpha => "paper.alpha".into(),
            Slot::InkOnMetalF0 => "model.ink_on_metal_f0".into(),
            Slot::InkOnMetalWidening => "model.ink_on_metal_widening".into(),
            Slot::InkOnMetalAlpha => "model.ink_on_metal_alpha".into(),
            Slot::CoatInternal => "model.coat_internal".into(),
            Slot::CoatWidening => "model.coat_widening".into(),
            Slot::Solid(ink, c) => channel(ink, "solid", c),
            Slot::FilterF0(ink) | Slot::CoatF0(ink) => of(ink, "f0"),
            Slot::FilterAlpha(ink) | Slot::MetalAlpha(ink) | Slot::CoatAlpha(ink) => of(ink, "alpha"),
            Slot::Diffuse(ink, c) => channel(ink, "diffuse", c),
            Slot::Reflectance(ink, c) => channel(ink, "reflectance", c),
            Slot::SeenPower(ink) => of(ink, "seen_power"),
            Slot::AlphaOnPrimer(ink) => of(ink, "alpha_on_primer"),
            Slot::BinderF0(ink) => of(ink, "binder_f0"),
            Slot::BinderAlpha(ink) => of(ink, "binder_alpha"),
            Slot::Transmission(ink) => of(ink, "transmission"),
            Slot::Levelling(ink) => of(ink, "levelling"),
        }
    }

    /// The ink whose layers it describes; none for paper and model.
    pub fn ink(self) -> Option<Ink> {
        match self {
            Slot::Paper(_) | Slot::PaperF0 | Slot::PaperAlpha => None,
            Slot::InkOnMetalF0 | Slot::InkOnMetalWidening | Slot::InkOnMetalAlpha => None,
            Slot::CoatInternal | Slot::CoatWidening => None,
            Slot::Solid(ink, _) | Slot::Diffuse(ink, _) | Slot::Reflectance(ink, _) => Some(ink),
            Slot::FilterF0(ink) | Slot::FilterAlpha(ink) | Slot::SeenPower(ink) => Some(ink),
            Slot::MetalAlpha(ink) | Slot::AlphaOnPrimer(ink) => Some(ink),
            Slot::BinderF0(ink) | Slot::BinderAlpha(ink) => Some(ink),
            Slot::Transmission(ink) | Slot::Levelling(ink) => Some(ink),
            Slot::CoatF0(ink) | Slot::CoatAlpha(ink) => Some(ink),
        }
    }

    /// The values it can have.
    pub fn range(self) -> [f64; 2] {
        match self {
            Slot::Paper(_) | Slot::Solid(..) => [DARKEST, 1.0],
            Slot::PaperF0 | Slot::FilterF0(_) | Slot::BinderF0(_) | Slot::CoatF0(_) => SHARE,
            Slot::InkOnMetalF0 | Slot::Diffuse(..) | Slot::Reflectance(..) | Slot::Transmission(_) => SHARE,
            Slot::PaperAlpha | Slot::InkOnMetalAlpha | Slot::FilterAlpha(_) => ALPHA,
            Slot::MetalAlpha(_) | Slot::BinderAlpha(_) | Slot::CoatAlpha(_) => ALPHA,
            Slot::InkOnMetalWidening | Slot::CoatWidening | Slot::AlphaOnPrimer(_) | Slot::Levelling(_) => {
                FACTOR
            }
            Slot::CoatInternal => [LEAST, 0.95],
            Slot::SeenPower(_) => [0.01, 4.0],
        }
    }

    /// How far the library's value may be off before anything was measured: a standard deviation of the logarithm.
    pub fn spread(self, value: f64) -> f64 {
        match self {
            // Published, for this class of print.
            Slot::Paper(_) | Slot::InkOnMetalF0 | Slot::InkOnMetalWidening => 0.1,
            Slot::Transmission(_) => 0.05,
            Slot::PaperF0 | Slot::FilterF0(_) | Slot::CoatF0(_) | Slot::AlphaOnPrimer(_) => 0.2,
            Slot::CoatWidening => 0.15,
            Slot::Solid(..) if value < DARK => 1.0,
            Slot::Solid(..) | Slot::Levelling(_) => 0.3,
            Slot::Reflectance(..) | Slot::SeenPower(_) => 0.4,
            Slot::CoatInternal => 0.5,
            // Guesses.
            Slot::PaperAlpha | Slot::InkOnMetalAlpha | Slot::FilterAlpha(_) | Slot::MetalAlpha(_) => 0.6,
            Slot::BinderAlpha(_) | Slot::CoatAlpha(_) => 0.6,
            Slot::Diffuse(..) | Slot::BinderF0(_) => 0.7,
        }
    }

    fn place(self, optics: &mut Optics) -> Option<FigureTarget<'_>> {
        let Optics { paper, model, layers } = optics;
        Some(match self {
            Slot::Paper(c) => FigureTarget::Colour(&mut paper.lab, c),
            Slot::PaperF0 => FigureTarget::Scalar(&mut paper.f0),
            Slot::PaperAlpha => FigureTarget::Scalar(&mut paper.alpha),
            Slot::InkOnMetalF0 => FigureTarget::Scalar(&mut model.ink_on_metal_f0),
            Slot::InkOnMetalWidening => FigureTarget::Scalar(&mut model.ink_on_metal_widening),
            Slot::InkOnMetalAlpha => FigureTarget::Scalar(&mut model.ink_on_metal_alpha),
            Slot::CoatInternal => FigureTarget::Scalar(&mut model.coat_internal),
            Slot::CoatWidening => FigureTarget::Scalar(&mut model.coat_widening),
            Slot::Solid(ink, c) => match layer(layers, ink)? {
                Layer::Filter(filter) => FigureTarget::Colour(&mut filter.lab, c),
                _ => return None,
            },
            Slot::FilterF0(ink) | Slot::FilterAlpha(ink) => match layer(layers, ink)? {
                Layer::Filter(filter) => FigureTarget::Scalar(match self {
                    Slot::FilterF0(_) => &mut filter.f0,
                    _ => &mut filter.alpha,
                }),
                _ => return None,
            },
            Slot::Transmission(ink) | Slot::Levelling(ink) => match layer(layers, ink)? {
                Layer::Undercoat(under) => FigureTarget::Scalar(match self {
                    Slot::Transmission(_) => &mut under.transmission,
                    _ => &mut under.levelling,
                }),
                _ => return None,
            },
            Slot::CoatF0(ink) | Slot::CoatAlpha(ink) => match layer(layers, ink)? {
                Layer::Coat(coat) => FigureTarget::Scalar(match self {
                    Slot::CoatF0(_) => &mut coat.f0,
                    _ => &mut coat.alpha,
                }),
                _ => return None,
            },
            Slot::Diffuse(ink, _)
            | Slot::Reflectance(ink, _)
            | Slot::SeenPower(ink)
            | Slot::MetalAlpha(ink)
            | Slot::AlphaOnPrimer(ink)
            | Slot::BinderF0(ink)
            | Slot::BinderAlpha(ink) => {
                let Layer::Metal(metal) = layer(layers, ink)? else { return None };
                match self {
                    Slot::Diffuse(_, c) => FigureTarget::Channel(metal.diffuse_tint.as_mut()?, c),
                    Slot::Reflectance(_, c) => FigureTarget::Channel(metal.tint.as_mut()?, c),
                    Slot::SeenPower(_) => FigureTarget::Scalar(metal.seen_power.as_mut()?),
                    Slot::MetalAlpha(_) => FigureTarget::Scalar(&mut metal.alpha),
                    Slot::AlphaOnPrimer(_) => FigureTarget::Scalar(&mut metal.alpha_on_primer),
                    Slot::BinderF0(_) => FigureTarget::Scalar(metal.binder_f0.as_mut()?),
                    _ => FigureTarget::Scalar(metal.binder_alpha.as_mut()?),
                }
            }
        })
    }

    /// The number; `None` if the optics have no such figure.
    pub fn get(self, optics: &mut Optics) -> Option<f64> {
        Some(match self.place(optics)? {
            FigureTarget::Scalar(figure) => figure.get(),
            FigureTarget::Channel(figure, c) => figure.get()[c],
            FigureTarget::Colour(figure, c) => lab::to_linear_rgb(figure.get())[c],
        })
    }

    /// Changes the number, if the optics have it.
    pub fn set(self, optics: &mut Optics, value: f64) {
        match self.place(optics) {
            Some(FigureTarget::Scalar(figure)) => figure.set(value),
            Some(FigureTarget::Channel(figure, c)) => {
                let mut triple = figure.get();
                triple[c] = value;
                figure.set(triple);
            }
            Some(FigureTarget::Colour(figure, c)) => {
                let mut rgb = lab::to_linear_rgb(figure.get());
                rgb[c] = value;
                figure.set(lab::from_linear_rgb(rgb));
            }
            None => {}
        }
    }
}

fn layer(layers: &mut [Option<Layer>], ink: Ink) -> Option<&mut Layer> {
    layers[ink as usize].as_mut()
}

/// Gives every metal its colours as one number for each channel, and every colour channels within their range.
pub(super) fn prepared(optics: &Optics) -> Optics {
    let mut optics = optics.clone();
    let floor = optics.model.darkest.get().max(DARKEST);
    let inside = |lab: &mut Figure<[f64; 3]>, most: [f64; 3]| {
        let rgb = lab::to_linear_rgb(lab.get());
        let rgb = std::array::from_fn(|c| rgb[c].max(floor).min(most[c]));
        lab.set(lab::from_linear_rgb(rgb));
        rgb
    };
    let paper = inside(&mut optics.paper.lab, [1.0; 3]);
    // A filter passes no more than all light. A little less is where its figure can move from.
    let clear = paper.map(|v| 0.995 * v);
    for layer in optics.layers.iter_mut().flatten() {
        match layer {
            Layer::Filter(filter) => {
                inside(&mut filter.lab, clear);
            }
            Layer::Metal(metal) => {
                for (share, tint) in
                    [(&mut metal.diffuse, &mut metal.diffuse_tint), (&mut metal.reflectance, &mut metal.tint)]
                {
                    let colour = tint.as_ref().map_or([1.0; 3], Figure::get);
                    *tint = Some(share.triple(colour.map(|v| v * share.get())));
                    share.set(1.0);
                }
            }
            Layer::Undercoat(_) | Layer::Coat(_) => {}
        }
    }
    optics.model.darkest.set(DARKEST);
    optics
}

/// The inks that the curve of a stack depends on: its own, and those that its metals are seen through.
pub(super) fn inks_of(optics: &Optics, stack: &Stack) -> Vec<Ink> {
    let mut inks: Vec<Ink> = Vec::new();
    for &ink in stack.layers() {
        let seen = match &optics.layers[ink as usize] {
            Some(Layer::Metal(metal)) => metal.seen_through.as_ref().map(|name| name.get_ref().0),
            _ => None,
        };
        inks.extend(std::iter::once(ink).chain(seen));
    }
    inks.sort_unstable();
    inks.dedup();
    inks
}

/// Every number that the optics have for paper, model and these inks.
pub(super) fn slots(optics: &mut Optics, inks: &[Ink]) -> Vec<Slot> {
    let mut all = vec![Slot::Paper(0), Slot::Paper(1), Slot::Paper(2), Slot::PaperF0, Slot::PaperAlpha];
    all.extend([Slot::InkOnMetalF0, Slot::InkOnMetalWidening, Slot::InkOnMetalAlpha]);
    all.extend([Slot::CoatInternal, Slot::CoatWidening]);
    for &ink in inks {
        all.extend((0..3).map(|c| Slot::Solid(ink, c)));
        all.extend([Slot::FilterF0(ink), Slot::FilterAlpha(ink)]);
        all.extend((0..3).map(|c| Slot::Diffuse(ink, c)));
        all.extend((0..3).map(|c| Slot::Reflectance(ink, c)));
        all.extend([Slot::SeenPower(ink), Slot::MetalAlpha(ink), Slot::AlphaOnPrimer(ink)]);
        all.extend([Slot::BinderF0(ink), Slot::BinderAlpha(ink)]);
        all.extend([Slot::Transmission(ink), Slot::Levelling(ink), Slot::CoatF0(ink), Slot::CoatAlpha(ink)]);
    }
    all.retain(|slot| slot.get(optics).is_some());
    all
}
