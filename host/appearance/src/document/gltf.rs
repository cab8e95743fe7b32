//! glTF and GLB: one material of a file as a document, with its textures as they are stored.
//!
//! Supported: metallic-roughness with its factors, `KHR_materials_pbrSpecularGlossiness`, `KHR_materials_specular`,
//! `KHR_materials_ior`, and normal maps (converted to roughness). Geometry is ignored: the print is the texture square,
//! wherever the mesh places it. A texture transform that all maps share is ignored with a note; maps with different
//! transforms do not align and are an error.
//! Source: glTF 2.0, sections 3.9 and appendix B.

mod loader;

use std::path::Path;

use ::gltf::json;

use super::content::{ColourSpace, Content, Document, Options, SWATCH_MM, name_of};
use super::error::DocumentError;
use super::relief;
use super::source::{MOST_BYTES, Source};
use super::texture::{Field, same_shape};
use crate::brdf::Space;
use crate::materials::{Surfaces, dielectric, metallic, specular};

use loader::{Loaded, Loader, coloured};

/// Extensions that are supported, or that do not affect reflectance.
const READ: [&str; 5] = [
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_variants",
    "KHR_materials_unlit",
];

pub(super) fn open(
    path: &Path,
    options: &Options,
    space: Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let bytes = source.read(path, MOST_BYTES)?;
    let wrong = |field: &str, problem: String| DocumentError::Field {
        path: path.to_path_buf(),
        field: field.into(),
        problem,
    };
    check_glb(&bytes).map_err(|problem| wrong("GLB header", problem))?;
    let ::gltf::Gltf { document, blob } = ::gltf::Gltf::from_slice_without_validation(&bytes)
        .map_err(|error| wrong("glTF", error.to_string()))?;
    drop(bytes);
    let root = document.into_json();
    let (number, material) = choose(&root, path, options.material.as_deref())?;
    let foreign: Vec<&str> = root
        .extensions_used
        .iter()
        .map(String::as_str)
        .filter(|name| name.contains("_materials_") && !READ.contains(name))
        .collect();
    if !foreign.is_empty() {
        source.note(format!("{}: the file uses {}, which is ignored", path.display(), foreign.join(", ")));
    }
    let maps = count_maps(material);
    source.observer.begin("reading", maps);
    let mut loader = Loader { root: &root, blob, path, source: &mut source, placement: None };
    let layers = layers(&mut loader, material, options)?;
    let (surfaces, textured) = build(layers, path, space, &mut source)?;
    source.observer.end();
    let (notes, digest) = source.finish();
    let name = material.name.clone().filter(|name| !name.trim().is_empty());
    Ok(Document {
        name: name.unwrap_or_else(|| format!("{}-{number}", name_of(path))),
        content: Content::Surfaces(surfaces),
        size_mm: (!textured).then_some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
    })
}

/// Checks the lengths in the container, before the `gltf` crate does arithmetic on them.
fn check_glb(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let Some(length) = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])) else {
        return Err(format!("expected 12 bytes, found {}", bytes.len()));
    };
    if length < 20 || length as usize > bytes.len() {
        return Err(format!("it gives a length of {length} bytes, but the file has {}", bytes.len()));
    }
    Ok(())
}

/// The requested material, by number or name; by default the only one.
fn choose<'r>(
    root: &'r json::Root,
    path: &Path,
    asked: Option<&str>,
) -> Result<(usize, &'r json::Material), DocumentError> {
    let name = |i: usize| root.materials[i].name.as_deref().unwrap_or("without a name");
    let fail = |problem: String| DocumentError::Choice {
        path: path.to_path_buf(),
        problem,
        materials: (0..root.materials.len()).map(|i| format!("{i} ({})", name(i))).collect(),
    };
    if root.materials.is_empty() {
        return Err(DocumentError::Field {
            path: path.to_path_buf(),
            field: "materials".into(),
            problem: "the file has no material".into(),
        });
    }
    let found = match asked {
        None if root.materials.len() == 1 => 0,
        None => return Err(fail(format!("the file has {} materials", root.materials.len()))),
        Some(asked) => match asked.parse::<usize>() {
            Ok(number) if number < root.materials.len() => number,
            _ => {
                let alike: Vec<usize> = (0..root.materials.len()).filter(|&i| name(i) == asked).collect();
                match alike[..] {
                    [one] => one,
                    [] => return Err(fail(format!("there is no material `{asked}`"))),
                    _ => {
                        return Err(fail(format!("{} materials have the name `{asked}`", alike.len())));
                    }
                }
            }
        },
    };
    Ok((found, &root.materials[found]))
}

fn count_maps(material: &json::Material) -> u64 {
    let pbr = &material.pbr_metallic_roughness;
    let mut maps = u64::from(material.normal_texture.is_some());
    match material.extensions.as_ref().and_then(|e| e.pbr_specular_glossiness.as_ref()) {
        Some(old) => {
            maps += u64::from(old.diffuse_texture.is_some());
            maps += u64::from(old.specular_glossiness_texture.is_some());
        }
        None => {
            maps += u64::from(pbr.base_color_texture.is_some());
            maps += u64::from(pbr.metallic_roughness_texture.is_some());
        }
    }
    maps
}

/// The parameters of a material, each a map or a constant.
struct Layers {
    base: [Field; 3],
    kind: PbrWorkflow,
    /// Slope variance of the normal map, at the size of that map.
    variance: Option<Field>,
}

enum PbrWorkflow {
    Metallic { roughness: Field, metal: Field, f0: [Field; 3], level: Field },
    Specular { f0: [Field; 3], gloss: Field },
}

fn layers(
    loader: &mut Loader<'_, '_>,
    material: &json::Material,
    options: &Options,
) -> Result<Layers, DocumentError> {
    let space = options.colour_space.unwrap_or(ColourSpace::Srgb);
    let extensions = material.extensions.as_ref();
    let (base, kind) = match extensions.and_then(|e| e.pbr_specular_glossiness.as_ref()) {
        Some(old) => {
            note_clamped(loader, "diffuseFactor", &old.diffuse_factor.0);
            note_clamped(loader, "specularFactor", &old.specular_factor.0);
            note_clamped(loader, "glossinessFactor", &[old.glossiness_factor.0]);
            let [r, g, b, _] = old.diffuse_factor.0;
            let base = loader.colour(old.diffuse_texture.as_ref(), [r, g, b], space, "diffuseTexture")?;
            let (f0, gloss) = match &old.specular_glossiness_texture {
                Some(info) => {
                    let Loaded { name, picture } = loader.load(info, "specularGlossinessTexture")?;
                    loader.source.note(format!("{name}: alpha is read as glossiness"));
                    let gloss = Field::Map(picture.channel(3)).times(old.glossiness_factor.0);
                    (coloured(&picture, old.specular_factor.0, space), gloss)
                }
                None => {
                    (old.specular_factor.0.map(Field::Constant), Field::Constant(old.glossiness_factor.0))
                }
            };
            (base, PbrWorkflow::Specular { f0, gloss })
        }
        None => {
            let pbr = &material.pbr_metallic_roughness;
            note_clamped(loader, "baseColorFactor", &pbr.base_color_factor.0);
            note_clamped(loader, "roughnessFactor", &[pbr.roughness_factor.0]);
            note_clamped(loader, "metallicFactor", &[pbr.metallic_factor.0]);
            let [r, g, b, _] = pbr.base_color_factor.0;
            let base =
                loader.colour(pbr.base_color_texture.as_ref(), [r, g, b], space, "baseColorTexture")?;
            let (rough, metal) = (pbr.roughness_factor.0, pbr.metallic_factor.0);
            let (roughness, metal) = match &pbr.metallic_roughness_texture {
                Some(info) => {
                    let Loaded { name, picture } = loader.load(info, "metallicRoughnessTexture")?;
                    if picture.colours() != 3 {
                        let problem =
                            format!("{name}: expected roughness in green and metallic in blue, found grey");
                        return Err(loader.wrong("metallicRoughnessTexture", problem));
                    }
                    let map = |channel| Field::Map(picture.channel(channel));
                    (map(1).times(rough), map(2).times(metal))
                }
                None => (Field::Constant(rough), Field::Constant(metal)),
            };
            let index = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
            let plain = dielectric(index);
            let (f0, level) = match extensions.and_then(|e| e.specular.as_ref()) {
                Some(s) => {
                    let tint = s.specular_color_factor.0.map(|v| v * plain);
                    let f0 = loader.colour(
                        s.specular_color_texture.as_ref(),
                        tint,
                        space,
                        "specularColorTexture",
                    )?;
                    let level = match &s.specular_texture {
                        Some(info) => {
                            let picture = loader.load(info, "specularTexture")?.picture;
                            Field::Map(picture.channel(3)).times(s.specular_factor.0)
                        }
                        None => Field::Constant(s.specular_factor.0),
                    };
                    (f0, level)
                }
                None => ([plain; 3].map(Field::Constant), Field::Constant(1.0)),
            };
            (base, PbrWorkflow::Metallic { roughness, metal, f0, level })
        }
    };
    let variance = match &material.normal_texture {
        None => None,
        Some(normal) => normal_variance(loader, normal, base[0].size())?,
    };
    Ok(Layers { base, kind, variance })
}

/// Says which factors are not from 0 to 1, as glTF has them: what they make is cut off there.
fn note_clamped(loader: &mut Loader<'_, '_>, name: &str, factors: &[f32]) {
    if let Some(factor) = factors.iter().find(|factor| !(0.0..=1.0).contains(*factor)) {
        loader.source.note(format!("{name}: {factor} is not from 0 to 1; what it makes is cut off there"));
    }
}

/// The slope variance of the normal map, or nothing if it has its own coordinates, as detail that repeats at another
/// scale does.
fn normal_variance(
    loader: &mut Loader<'_, '_>,
    normal: &json::material::NormalTexture,
    base: Option<(usize, usize)>,
) -> Result<Option<Field>, DocumentError> {
    if loader.placement.is_some_and(|first| first.coordinates != normal.tex_coord) {
        loader.source.note(
            "normalTexture: ignored, because its coordinates differ from those of the other maps".into(),
        );
        return Ok(None);
    }
    let Loaded { name, picture } = loader.texture(normal.index.value(), "normalTexture")?;
    if picture.colours() != 3 {
        return Err(loader
            .wrong("normalTexture", format!("{name}: expected normals with three components, found grey")));
    }
    let scale = base.map_or(1.0, |(width, _)| picture.width as f64 / width as f64);
    let radius = (scale * (relief::WINDOW / 2) as f64).round().clamp(1.0, 256.0) as usize;
    loader.source.note(relief::note(&name));
    let variance = relief::slope_variance(&picture.channel(0), &picture.channel(1), normal.scale, radius);
    Ok(Some(Field::Map(variance)))
}

/// Resizes all maps to the base colour, or else to the largest map, and builds the surfaces. Also returns whether there was
/// any map.
fn build(
    layers: Layers,
    path: &Path,
    space: Space,
    source: &mut Source<'_>,
) -> Result<(Surfaces, bool), DocumentError> {
    let Layers { base, kind, variance } = layers;
    let mut others: Vec<Option<(usize, usize)>> = vec![variance.as_ref().and_then(Field::size)];
    match &kind {
        PbrWorkflow::Metallic { roughness, metal, f0, level } => {
            others.extend([roughness.size(), metal.size(), f0[0].size(), level.size()]);
        }
        PbrWorkflow::Specular { f0, gloss } => others.extend([f0[0].size(), gloss.size()]),
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
                surface
            })
        }
        PbrWorkflow::Specular { f0, gloss } => {
            let (f0, gloss) = (f0.map(fit), fit(gloss));
            Surfaces::build(width, height, space, move |i| {
                let mut surface = specular(rgb(&base, i), rgb(&f0, i), gloss.at(i).clamp(0.0, 1.0));
                surface.alpha = rough(surface.alpha, i);
                surface
            })
        }
    };
    Ok((surfaces, chosen.is_some()))
}

#[cfg(test)]
mod tests;
