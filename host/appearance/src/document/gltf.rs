//! glTF and GLB: one material of a file as a document, with its textures as they are stored.
//!
//! Supported: metallic-roughness with its factors, `KHR_materials_pbrSpecularGlossiness`, `KHR_materials_specular`,
//! `KHR_materials_ior`, `KHR_materials_clearcoat`, and normal maps (converted to roughness). A material without light
//! (`KHR_materials_unlit`) is printed matt. Geometry is ignored: the print is the texture square,
//! wherever the mesh places it. A texture transform that all maps share is ignored with a note; maps with different
//! transforms do not align and are an error.
//! Source: glTF 2.0, sections 3.9 and appendix B.

mod loader;

use std::path::Path;

use ::gltf::json;
use ::gltf::json::extensions::texture::TextureTransform;
use ::gltf::json::material::AlphaMode;
use ::gltf::json::validation::Checked;

use super::content::{ColourSpace, Content, Document, Options, SWATCH_MM, name_of};
use super::error::DocumentError;
use super::layers::{CoatLayer, Layers, PbrWorkflow, build};
use super::picture::Picture;
use super::relief;
use super::source::{MOST_BYTES, Source};
use super::texture::Field;
use crate::brdf::Space;
use crate::materials::dielectric;

use loader::{Loaded, Loader, Placement, coloured};

/// Extensions that are supported, or that do not affect reflectance.
const READ: [&str; 6] = [
    CLEARCOAT,
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_variants",
    UNLIT,
];

const CLEARCOAT: &str = "KHR_materials_clearcoat";
const UNLIT: &str = "KHR_materials_unlit";
const TRANSFORM: &str = "KHR_texture_transform";

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
    let emits = material.emissive_texture.is_some() || material.emissive_factor.0 != [0.0; 3];
    let is_transparent = material.alpha_mode != Checked::Valid(AlphaMode::Opaque);
    let unprinted: Vec<&str> = [(emits, "emission"), (is_transparent, "transparency (alphaMode)")]
        .into_iter()
        .filter_map(|(is_there, what)| is_there.then_some(what))
        .collect();
    if !unprinted.is_empty() {
        source.note(format!(
            "{}: not printed: {}; they describe what ink on paper cannot show",
            path.display(),
            unprinted.join(", ")
        ));
    }
    let coloured = |primitive: &json::mesh::Primitive| {
        let colour = |semantic: &Checked<json::mesh::Semantic>| {
            matches!(semantic, Checked::Valid(json::mesh::Semantic::Colors(_)))
        };
        primitive.material.is_some_and(|of| of.value() == number) && primitive.attributes.keys().any(colour)
    };
    if root.meshes.iter().flat_map(|mesh| &mesh.primitives).any(coloured) {
        source.note(format!(
            "{}: the vertex colours (COLOR_0), which multiply the base colour, belong to the mesh and are ignored",
            path.display()
        ));
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
        views: None,
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
                    let Loaded { name, picture } =
                        loader.load(info, "specularGlossinessTexture", Picture::decode_with_alpha)?;
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
                    let Loaded { name, picture } =
                        loader.load(info, "metallicRoughnessTexture", Picture::decode)?;
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
                            let Loaded { name, picture } =
                                loader.load(info, "specularTexture", Picture::decode_with_alpha)?;
                            loader
                                .source
                                .note(format!("{name}: alpha is read as the strength of reflection"));
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
    let unlit = extensions.is_some_and(|e| e.others.contains_key(UNLIT));
    let kind = if unlit {
        loader
            .source
            .note(format!("{UNLIT}: the material has no reflectance; its base colour is printed matt"));
        let [roughness, metal, level] = [1.0, 0.0, 0.0].map(Field::Constant);
        PbrWorkflow::Metallic { roughness, metal, f0: [0.0; 3].map(Field::Constant), level }
    } else {
        kind
    };
    let variance = match &material.normal_texture {
        Some(normal) if !unlit => normal_variance(loader, normal, base[0].size())?,
        _ => None,
    };
    let coat = match extensions.and_then(|e| e.others.get(CLEARCOAT)) {
        Some(coat) if !unlit => clearcoat(loader, coat)?,
        _ => None,
    };
    Ok(Layers { base, kind, variance, coat })
}

/// `KHR_materials_clearcoat`, which the `gltf` crate does not know.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Clearcoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<json::texture::Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<json::texture::Info>,
    clearcoat_normal_texture: Option<json::material::NormalTexture>,
}

impl Default for Clearcoat {
    fn default() -> Clearcoat {
        Clearcoat {
            clearcoat_factor: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness_factor: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
        }
    }
}

/// How much the clear coat covers (red), and its roughness (green).
fn clearcoat(
    loader: &mut Loader<'_, '_>,
    value: &serde_json::Value,
) -> Result<Option<CoatLayer>, DocumentError> {
    let coat: Clearcoat =
        serde_json::from_value(value.clone()).map_err(|error| loader.wrong(CLEARCOAT, error.to_string()))?;
    note_clamped(loader, "clearcoatFactor", &[coat.clearcoat_factor]);
    note_clamped(loader, "clearcoatRoughnessFactor", &[coat.clearcoat_roughness_factor]);
    if coat.clearcoat_factor <= 0.0 {
        return Ok(None);
    }
    if coat.clearcoat_normal_texture.is_some() {
        loader.source.note("clearcoatNormalTexture: ignored; the coat is printed smooth".into());
    }
    let mut field = |info: &Option<json::texture::Info>, factor, channel, name| match info {
        Some(info) => Ok::<_, DocumentError>(
            Field::Map(loader.load(info, name, Picture::decode)?.picture.channel(channel)).times(factor),
        ),
        None => Ok(Field::Constant(factor)),
    };
    let weight = field(&coat.clearcoat_texture, coat.clearcoat_factor, 0, "clearcoatTexture")?;
    let roughness = field(
        &coat.clearcoat_roughness_texture,
        coat.clearcoat_roughness_factor,
        1,
        "clearcoatRoughnessTexture",
    )?;
    Ok(Some(CoatLayer { weight, roughness, f0: dielectric(1.5) }))
}

/// Says which factors are not from 0 to 1, as glTF has them: what they make is cut off there.
fn note_clamped(loader: &mut Loader<'_, '_>, name: &str, factors: &[f32]) {
    if let Some(factor) = factors.iter().find(|factor| !(0.0..=1.0).contains(*factor)) {
        loader.source.note(format!("{name}: {factor} is not from 0 to 1; what it makes is cut off there"));
    }
}

/// The slope variance of the normal map, or nothing if it lies otherwise on the surface, as detail that repeats at another
/// scale does.
fn normal_variance(
    loader: &mut Loader<'_, '_>,
    normal: &json::material::NormalTexture,
    base: Option<(usize, usize)>,
) -> Result<Option<Field>, DocumentError> {
    let transform = normal.extensions.as_ref().and_then(|e| e.others.get(TRANSFORM)).cloned();
    let transform: Option<TextureTransform> = transform
        .map(serde_json::from_value)
        .transpose()
        .map_err(|error| loader.wrong("normalTexture", format!("{TRANSFORM}: {error}")))?;
    let placement = Placement::new(normal.tex_coord, transform.as_ref());
    if loader.placement.is_some_and(|first| first != placement) {
        loader.source.note(
            "normalTexture: ignored, because its placement on the surface differs from that of the other maps"
                .into(),
        );
        return Ok(None);
    }
    let Loaded { name, picture } = loader.texture(normal.index.value(), "normalTexture", Picture::decode)?;
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

#[cfg(test)]
mod tests;
