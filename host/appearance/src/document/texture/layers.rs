//! The parameters of a material of a scene, and the surfaces that they make.
//!
//! Problem: glTF and MaterialX give each parameter as a number or as a picture of its own size.
//! Method: a field for each parameter; all maps are resized to the base colour, or else to the largest map.
//! Cost: what resizing costs.
//! Limits: maps whose shapes differ by more than 1 % are refused.

use std::path::Path;

use super::{Field, same_shape};
use crate::brdf::Space;
use crate::document::error::DocumentError;
use crate::document::relief;
use crate::document::source::Source;
use crate::materials::{Coat, Surfaces, metallic, specular};

/// The parameters of a material, each a map or a constant.
pub struct Layers {
    pub base: [Field; 3],
    pub kind: PbrWorkflow,
    /// Slope variance of the normal map, at the size of that map.
    pub variance: Option<Field>,
    /// The clear coat over all of it.
    pub coat: Option<CoatLayer>,
}

/// A clear coat.
pub struct CoatLayer {
    /// The part of the surface that it covers.
    pub weight: Field,
    /// Its roughness.
    pub roughness: Field,
    /// Its reflectance at normal incidence.
    pub f0: f32,
}

impl CoatLayer {
    /// The coat of a pixel.
    pub fn at(&self, pixel: usize) -> Coat {
        Coat::new(self.weight.at(pixel), self.roughness.at(pixel), self.f0)
    }
}

/// How base and reflectance belong together.
pub enum PbrWorkflow {
    /// Base colour, roughness and metallic, with the reflectance of what is no metal and a factor on it.
    Metallic { roughness: Field, metal: Field, f0: [Field; 3], level: Field },
    /// Diffuse and specular colour, and glossiness.
    Specular { f0: [Field; 3], gloss: Field },
}

/// Resizes all maps to the base colour, or else to the largest map, and builds the surfaces. Also returns
/// whether there was any map.
pub fn build(
    layers: Layers,
    path: &Path,
    space: Space,
    source: &mut Source<'_>,
) -> Result<(Surfaces, bool), DocumentError> {
    let Layers { base, kind, variance, coat } = layers;
    let mut others: Vec<Option<(usize, usize)>> = vec![variance.as_ref().and_then(Field::size)];
    match &kind {
        PbrWorkflow::Metallic { roughness, metal, f0, level } => {
            others.extend([roughness.size(), metal.size(), f0[0].size(), level.size()]);
        }
        PbrWorkflow::Specular { f0, gloss } => others.extend([f0[0].size(), gloss.size()]),
    }
    if let Some(coat) = &coat {
        others.extend([coat.weight.size(), coat.roughness.size()]);
    }
    let largest = others.iter().flatten().copied().max_by_key(|&(w, h)| w * h);
    let chosen = base[0].size().or(largest);
    let (width, height) = chosen.unwrap_or((1, 1));
    for size in others.into_iter().flatten().filter(|&size| size != (width, height)) {
        let (w, h) = size;
        if !same_shape(size, (width, height)) {
            return Err(DocumentError::Field {
                path: path.to_path_buf(),
                field: "textures".into(),
                problem: format!(
                    "maps of {width} x {height} and {w} x {h} pixels; all maps need the same proportions"
                ),
            });
        }
        source.note(format!("a map of {w} x {h} pixels is resized to {width} x {height}"));
    }
    let fit = |field: Field| field.resized(width, height);
    let base = base.map(fit);
    let variance = variance.map(fit);
    let coat =
        coat.map(|coat| CoatLayer { weight: fit(coat.weight), roughness: fit(coat.roughness), f0: coat.f0 });
    let coat = move |i: usize| coat.as_ref().map(|coat| coat.at(i)).unwrap_or_default();
    let rough =
        move |alpha: f32, i: usize| variance.as_ref().map_or(alpha, |v| relief::widened(alpha, v.at(i)));
    let rgb = |fields: &[Field; 3], i: usize| -> [f32; 3] {
        std::array::from_fn(|c| fields[c].at(i).clamp(0.0, 1.0))
    };
    let surfaces = match kind {
        PbrWorkflow::Metallic { roughness, metal, f0, level } => {
            let (roughness, metal, f0, level) = (fit(roughness), fit(metal), f0.map(fit), fit(level));
            Surfaces::build(width, height, space, move |i| {
                let level = level.at(i).clamp(0.0, 1.0);
                let f0 = rgb(&f0, i).map(|v| v * level);
                let metal = metal.at(i).clamp(0.0, 1.0);
                let mut surface = metallic(rgb(&base, i), f0, roughness.at(i).clamp(0.0, 1.0), metal);
                surface.alpha = rough(surface.alpha, i);
                surface.under(coat(i))
            })
        }
        PbrWorkflow::Specular { f0, gloss } => {
            let (f0, gloss) = (f0.map(fit), fit(gloss));
            Surfaces::build(width, height, space, move |i| {
                let mut surface = specular(rgb(&base, i), rgb(&f0, i), gloss.at(i).clamp(0.0, 1.0));
                surface.alpha = rough(surface.alpha, i);
                surface.under(coat(i))
            })
        }
    };
    Ok((surfaces, chosen.is_some()))
}
