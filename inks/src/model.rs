//! The reflectance of a stack of layers, computed from figures for each layer.
//!
//! Problem: no measurements of these ribbons are public, and the library needs 57 stacks.
//! Method: process the layers from the paper upward, with a diffuse albedo, at most one metal lobe and at most one surface
//! lobe. A process ink is a filter that light passes twice (Beer-Lambert): it multiplies everything beneath it by
//! T = solid / paper and has its own surface. Flakes and foil are opaque and replace everything. Primer levels the surface.
//! Finish is a coat in optical contact: Saunderson's form `(1 - F0)(1 - r) kd / (1 - r kd)` on a body, `(1 - F0)^2` and a
//! wider lobe on metal, and a new surface in both cases.
//! Cost: a few operations per layer. Limits: full coverage, no trapping, no scattering between layers; light and eye in one
//! place. Combinations that the model was not fitted to (a filter over finish, primer over metal) follow the same rules.

use maths::Maths;
use protocol::ink::Ink;
use serde::Deserialize;
use toml::Spanned;

use crate::lab;
use crate::lobes::{Lobe, Lobes};
use crate::provenance::{Figure, Parameter, Value};
use crate::set::InkName;
use crate::stack::Stack;

type Rgb = [f64; 3];

/// The bare substrate.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paper {
    /// A description.
    pub name: String,
    /// CIELAB under D50.
    pub lab: Figure<[f64; 3]>,
    /// Surface lobe: reflectance at normal incidence.
    pub f0: Figure<f64>,
    /// Surface lobe: microfacet width.
    pub alpha: Figure<f64>,
    /// Minimum cluster of bare paper, in dots of 1/600 inch.
    pub minimum_cluster: Figure<u16>,
}

/// Figures shared by all layers.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Name and version, as recorded in the provenance of a curve.
    pub name: String,
    /// Share of the light that the surface reflects before it reaches the diffuse body.
    pub interface: Figure<f64>,
    /// Lower bound for the channels of a solid, needed for inks outside Rec. 709.
    pub darkest: Figure<f64>,
    /// Reflectance of aluminium, the metal of flakes and foils, at normal incidence.
    pub aluminium: Figure<Rgb>,
    /// Factor on the reflectance of a metal for each filter over it, in addition to the filter's transmittance.
    pub ink_on_metal_f0: Figure<f64>,
    /// Factor on the alpha of a metal for each filter over it.
    pub ink_on_metal_widening: Figure<f64>,
    /// Alpha of the surface of a filter over metal.
    pub ink_on_metal_alpha: Figure<f64>,
    /// Effective internal reflection r under a coat.
    pub coat_internal: Figure<f64>,
    /// Factor on the alpha of a metal under a coat.
    pub coat_widening: Figure<f64>,
}

/// The effect of an ink on the layers beneath it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// A transparent colour.
    Filter(Filter),
    /// Opaque flakes or film.
    Metal(Box<Metal>),
    /// A clear layer that levels the surface beneath it.
    Undercoat(Undercoat),
    /// A clear coat with a new surface.
    Coat(Coat),
}

/// A transparent colour.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filter {
    /// CIELAB under D50 of the solid on the library's paper.
    pub lab: Figure<[f64; 3]>,
    /// Its surface: reflectance at normal incidence.
    pub f0: Figure<f64>,
    /// Its surface: microfacet width, on anything but metal.
    pub alpha: Figure<f64>,
}

/// Opaque flakes in a binder, or a metallised film.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metal {
    /// Diffuse albedo.
    pub diffuse: Figure<f64>,
    /// Its colour; grey if absent.
    pub diffuse_tint: Option<Figure<Rgb>>,
    /// Share of the reflectance of aluminium.
    pub reflectance: Figure<f64>,
    /// Colour of the reflectance; neutral if absent.
    pub tint: Option<Figure<Rgb>>,
    /// A process ink whose pigment colours the body and the flakes.
    pub seen_through: Option<Spanned<InkName>>,
    /// Exponent of that ink's T for the flakes.
    pub seen_power: Option<Figure<f64>>,
    /// Microfacet width.
    pub alpha: Figure<f64>,
    /// Factor on alpha directly on primer.
    pub alpha_on_primer: Figure<f64>,
    /// Surface of the binder: reflectance; no such lobe if absent.
    pub binder_f0: Option<Figure<f64>>,
    /// Surface of the binder: microfacet width.
    pub binder_alpha: Option<Figure<f64>>,
}

/// A clear layer that levels the surface beneath it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Undercoat {
    /// Factor on the light from beneath.
    pub transmission: Figure<f64>,
    /// Factor on the alpha of the surface beneath.
    pub levelling: Figure<f64>,
}

/// A clear coat with a new surface.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coat {
    /// Reflectance at normal incidence.
    pub f0: Figure<f64>,
    /// Microfacet width.
    pub alpha: Figure<f64>,
}

/// The name of a figure, its range, and the figure.
pub(crate) type Listed<'a> = (&'static str, [f64; 2], Value<'a>);

const SHARE: [f64; 2] = [0.0, 1.0];
/// A lobe below 0.01 is narrower than any curve or printed film; above 1 it is not a lobe.
const ALPHA: [f64; 2] = [0.01, 1.0];
const FACTOR: [f64; 2] = [0.1, 4.0];
/// Covers L*, a* and b*; the later check of the albedo catches impossible colours.
const LAB: [f64; 2] = [-150.0, 150.0];

impl Paper {
    pub(crate) fn figures(&self) -> Vec<Listed<'_>> {
        vec![
            ("lab", LAB, Value::Triple(&self.lab)),
            ("f0", SHARE, Value::Scalar(&self.f0)),
            ("alpha", ALPHA, Value::Scalar(&self.alpha)),
        ]
    }
}

impl Model {
    pub(crate) fn figures(&self) -> Vec<Listed<'_>> {
        vec![
            ("interface", SHARE, Value::Scalar(&self.interface)),
            ("darkest", [1e-4, 0.1], Value::Scalar(&self.darkest)),
            ("aluminium", SHARE, Value::Triple(&self.aluminium)),
            ("ink_on_metal_f0", SHARE, Value::Scalar(&self.ink_on_metal_f0)),
            ("ink_on_metal_widening", FACTOR, Value::Scalar(&self.ink_on_metal_widening)),
            ("ink_on_metal_alpha", ALPHA, Value::Scalar(&self.ink_on_metal_alpha)),
            ("coat_internal", [0.0, 0.95], Value::Scalar(&self.coat_internal)),
            ("coat_widening", FACTOR, Value::Scalar(&self.coat_widening)),
        ]
    }
}

impl Layer {
    pub(crate) fn figures(&self) -> Vec<Listed<'_>> {
        match self {
            Layer::Filter(filter) => vec![
                ("lab", LAB, Value::Triple(&filter.lab)),
                ("f0", SHARE, Value::Scalar(&filter.f0)),
                ("alpha", ALPHA, Value::Scalar(&filter.alpha)),
            ],
            Layer::Metal(metal) => {
                let mut figures = vec![
                    ("diffuse", SHARE, Value::Scalar(&metal.diffuse)),
                    ("reflectance", SHARE, Value::Scalar(&metal.reflectance)),
                    ("alpha", ALPHA, Value::Scalar(&metal.alpha)),
                    ("alpha_on_primer", FACTOR, Value::Scalar(&metal.alpha_on_primer)),
                ];
                figures.extend(metal.diffuse_tint.iter().map(|f| ("diffuse_tint", SHARE, Value::Triple(f))));
                figures.extend(metal.tint.iter().map(|f| ("tint", SHARE, Value::Triple(f))));
                figures.extend(metal.seen_power.iter().map(|f| ("seen_power", [0.0, 4.0], Value::Scalar(f))));
                figures.extend(metal.binder_f0.iter().map(|f| ("binder_f0", SHARE, Value::Scalar(f))));
                figures.extend(metal.binder_alpha.iter().map(|f| ("binder_alpha", ALPHA, Value::Scalar(f))));
                figures
            }
            Layer::Undercoat(under) => vec![
                ("transmission", SHARE, Value::Scalar(&under.transmission)),
                ("levelling", FACTOR, Value::Scalar(&under.levelling)),
            ],
            Layer::Coat(coat) => {
                vec![("f0", SHARE, Value::Scalar(&coat.f0)), ("alpha", ALPHA, Value::Scalar(&coat.alpha))]
            }
        }
    }
}

/// Why a stack cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// An ink has no optical figures.
    #[error("{} has no `[ink.layer]`, so stack {stack} cannot be modelled; measure it instead", ink.name())]
    NoLayer {
        /// The stack.
        stack: Stack,
        /// The ink without figures.
        ink: Ink,
    },
    /// A metal is coloured by an ink that is not a filter.
    #[error("{} is seen through {}, which has no `[ink.layer.filter]`", metal.name(), filter.name())]
    NoFilter {
        /// The metal.
        metal: Ink,
        /// The ink that should be a filter.
        filter: Ink,
    },
}

/// The figures of a whole library.
#[derive(Clone, Debug, PartialEq)]
pub struct Optics {
    /// The bare substrate.
    pub paper: Paper,
    /// Figures shared by all layers.
    pub model: Model,
    /// The effect of each ink, if known; indexed by `Ink as usize`.
    pub layers: [Option<Layer>; Ink::ALL.len()],
}

/// The layers so far: one body, at most one metal, at most one surface.
struct Pile {
    kd: Rgb,
    metal: Option<Lobe>,
    surface: Option<Lobe>,
}

fn each(a: Rgb, f: impl Fn(usize, f64) -> f64) -> Rgb {
    std::array::from_fn(|c| f(c, a[c]))
}

impl Optics {
    fn paper_albedo(&self) -> Rgb {
        lab::to_linear_rgb(self.paper.lab.get()).map(|v| v.clamp(self.model.darkest.get(), 1.0))
    }

    /// The transmittance of a filter for light that passes it twice: T = solid / paper, at most 1.
    fn double_pass(&self, filter: &Filter) -> Rgb {
        let paper = self.paper_albedo();
        each(lab::to_linear_rgb(filter.lab.get()), |c, v| {
            (v.max(self.model.darkest.get()) / paper[c]).min(1.0)
        })
    }

    fn seen_through(&self, ink: Ink, metal: &Metal) -> Result<Rgb, ModelError> {
        match &metal.seen_through {
            None => Ok([1.0; 3]),
            Some(name) => {
                let filter = name.get_ref().0;
                match &self.layers[filter as usize] {
                    Some(Layer::Filter(f)) => Ok(self.double_pass(f)),
                    _ => Err(ModelError::NoFilter { metal: ink, filter }),
                }
            }
        }
    }

    /// The lobes of a stack.
    pub fn lobes(&self, stack: &Stack) -> Result<Lobes, ModelError> {
        let surface = Lobe { f0: [self.paper.f0.get(); 3], alpha: self.paper.alpha.get() };
        let mut pile = Pile { kd: self.paper_albedo(), metal: None, surface: Some(surface) };
        let mut below: Option<&Layer> = None;
        for &ink in stack.layers() {
            let layer = self.layers[ink as usize]
                .as_ref()
                .ok_or_else(|| ModelError::NoLayer { stack: stack.clone(), ink })?;
            match layer {
                Layer::Filter(filter) => self.lay_filter(&mut pile, filter),
                Layer::Metal(metal) => {
                    let primed = matches!(below, Some(Layer::Undercoat(_)));
                    self.lay_metal(&mut pile, metal, self.seen_through(ink, metal)?, primed);
                }
                Layer::Undercoat(under) => lay_undercoat(&mut pile, under),
                Layer::Coat(coat) => self.lay_coat(&mut pile, coat),
            }
            below = Some(layer);
        }
        let entering = 1.0 - self.model.interface.get();
        Ok(Lobes { kd: pile.kd, entering, lobes: pile.metal.into_iter().chain(pile.surface).collect() })
    }

    fn lay_filter(&self, pile: &mut Pile, filter: &Filter) {
        let t = self.double_pass(filter);
        pile.kd = each(pile.kd, |c, v| v * t[c]);
        let mut alpha = filter.alpha.get();
        if let Some(metal) = &mut pile.metal {
            metal.f0 = each(metal.f0, |c, v| v * t[c] * self.model.ink_on_metal_f0.get());
            metal.alpha = (metal.alpha * self.model.ink_on_metal_widening.get()).min(1.0);
            alpha = self.model.ink_on_metal_alpha.get();
        }
        pile.surface = Some(Lobe { f0: [filter.f0.get(); 3], alpha });
    }

    fn lay_metal(&self, pile: &mut Pile, metal: &Metal, t: Rgb, primed: bool) {
        let tint = |figure: &Option<Figure<Rgb>>| figure.as_ref().map_or([1.0; 3], Figure::get);
        let (body, colour) = (tint(&metal.diffuse_tint), tint(&metal.tint));
        let power = metal.seen_power.as_ref().map_or(1.0, Figure::get);
        pile.kd = each(body, |c, v| metal.diffuse.get() * v * t[c]);
        let aluminium = self.model.aluminium.get();
        let f0 = each(colour, |c, v| metal.reflectance.get() * aluminium[c] * v * t[c].power(power));
        let smoother = if primed { metal.alpha_on_primer.get() } else { 1.0 };
        pile.metal = Some(Lobe { f0, alpha: (metal.alpha.get() * smoother).min(1.0) });
        pile.surface = match (&metal.binder_f0, &metal.binder_alpha) {
            (Some(f0), Some(alpha)) => Some(Lobe { f0: [f0.get(); 3], alpha: alpha.get() }),
            _ => None,
        };
    }

    fn lay_coat(&self, pile: &mut Pile, coat: &Coat) {
        let through = 1.0 - coat.f0.get();
        if let Some(metal) = &mut pile.metal {
            metal.f0 = metal.f0.map(|v| v * through * through);
            metal.alpha = (metal.alpha * self.model.coat_widening.get()).min(1.0);
            pile.kd = pile.kd.map(|v| v * through * through);
        } else {
            let r = self.model.coat_internal.get();
            pile.kd = pile.kd.map(|v| through * (1.0 - r) * v / (1.0 - r * v));
        }
        pile.surface = Some(Lobe { f0: [coat.f0.get(); 3], alpha: coat.alpha.get() });
    }

    /// The figures behind the lobes of a stack: paper, model, then each ink once.
    pub fn parameters(&self, stack: &Stack) -> Vec<Parameter> {
        let mut inks: Vec<Ink> = Vec::new();
        for &ink in stack.layers() {
            let seen = match &self.layers[ink as usize] {
                Some(Layer::Metal(metal)) => metal.seen_through.as_ref().map(|name| name.get_ref().0),
                _ => None,
            };
            for ink in std::iter::once(ink).chain(seen) {
                if !inks.contains(&ink) {
                    inks.push(ink);
                }
            }
        }
        let mut all: Vec<(&str, Listed<'_>)> = Vec::new();
        all.extend(self.paper.figures().into_iter().map(|figure| ("paper", figure)));
        all.extend(self.model.figures().into_iter().map(|figure| ("model", figure)));
        for ink in inks {
            if let Some(layer) = &self.layers[ink as usize] {
                all.extend(layer.figures().into_iter().map(|figure| (ink.name(), figure)));
            }
        }
        all.into_iter()
            .map(|(owner, (name, _, value))| Parameter {
                name: format!("{owner}.{name}"),
                value: value.numbers(),
                source: value.source(),
            })
            .collect()
    }
}

fn lay_undercoat(pile: &mut Pile, under: &Undercoat) {
    let through = under.transmission.get();
    pile.kd = pile.kd.map(|v| v * through);
    if let Some(metal) = &mut pile.metal {
        metal.f0 = metal.f0.map(|v| v * through);
    }
    if let Some(surface) = &mut pile.surface {
        surface.alpha = (surface.alpha * under.levelling.get()).min(1.0);
    }
}
