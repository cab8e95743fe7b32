//! glTF and GLB: one material of a file as a document, with its textures as they are stored.
//!
//! Supported: metallic-roughness with its factors, `KHR_materials_pbrSpecularGlossiness`, `KHR_materials_specular`,
//! `KHR_materials_ior`, `KHR_materials_clearcoat`, and normal maps (converted to roughness). A material without light
//! (`KHR_materials_unlit`) is printed matt. Geometry is ignored: the print is the texture square,
//! wherever the mesh places it. A texture transform that all maps share is ignored with a note; maps with different
//! transforms do not align and are an error.
//! Source: glTF 2.0, sections 3.9 and appendix B.

mod loader;
mod root;

use std::path::Path;

use super::content::MOST_BYTES;
use super::content::{ColourSpace, Content, Document, Options, SWATCH_MM};
use super::error::DocumentError;
use super::picture::Picture;
use super::relief;
use super::source::Source;
use super::texture::Field;
use super::texture::layers::{CoatLayer, Layers, PbrWorkflow, build};
use crate::brdf::Space;
use crate::materials::dielectric;

use loader::{Loaded, Loader, Placement, coloured};
use root::{Clearcoat, Info, Material, Primitive, Root};

/// Extensions that are supported, or that do not affect reflectance.
const READ: [&str; 6] = [
    "KHR_materials_clearcoat",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_variants",
    UNLIT,
];

const UNLIT: &str = "KHR_materials_unlit";

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
    let (text, blob) = root::chunks(&bytes).map_err(|problem| wrong("GLB header", problem))?;
    let root = root::parse(text).map_err(|(field, problem)| wrong(&field, problem))?;
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
    let emits = material.emissive_texture.is_some() || material.emissive_factor != [0.0; 3];
    let is_transparent = material.alpha_mode.as_deref().is_some_and(|mode| mode != "OPAQUE");
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
    let coloured = |primitive: &Primitive| {
        let colour = |name: &String| name.starts_with("COLOR_");
        primitive.material == Some(number) && primitive.attributes.keys().any(colour)
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
    let name = material.name.clone().filter(|name| !name.trim().is_empty());
    let name = name.unwrap_or_else(|| format!("{}-{number}", source.name_of(path)));
    let (notes, digest) = source.finish();
    Ok(Document {
        name,
        content: Content::Surfaces(surfaces),
        size_mm: (!textured).then_some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
        views: None,
    })
}

/// The requested material, by number or name; by default the only one.
fn choose<'r>(
    root: &'r Root,
    path: &Path,
    asked: Option<&str>,
) -> Result<(usize, &'r Material), DocumentError> {
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

fn count_maps(material: &Material) -> u64 {
    let pbr = &material.pbr_metallic_roughness;
    let mut maps = u64::from(material.normal_texture.is_some());
    match &material.extensions.glossiness {
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
    material: &Material,
    options: &Options,
) -> Result<Layers, DocumentError> {
    let space = options.colour_space.unwrap_or(ColourSpace::Srgb);
    let extensions = &material.extensions;
    let (base, kind) = match &extensions.glossiness {
        Some(old) => {
            note_clamped(loader, "diffuseFactor", &old.diffuse_factor);
            note_clamped(loader, "specularFactor", &old.specular_factor);
            note_clamped(loader, "glossinessFactor", &[old.glossiness_factor]);
            let [r, g, b, _] = old.diffuse_factor;
            let base = loader.colour(old.diffuse_texture.as_ref(), [r, g, b], space, "diffuseTexture")?;
            let (f0, gloss) = match &old.specular_glossiness_texture {
                Some(info) => {
                    let Loaded { name, picture } =
                        loader.load(info, "specularGlossinessTexture", Picture::decode_with_alpha)?;
                    loader.source.note(format!("{name}: alpha is read as glossiness"));
                    let gloss = Field::Map(picture.channel(3)).times(old.glossiness_factor);
                    (coloured(&picture, old.specular_factor, space), gloss)
                }
                None => (old.specular_factor.map(Field::Constant), Field::Constant(old.glossiness_factor)),
            };
            (base, PbrWorkflow::Specular { f0, gloss })
        }
        None => {
            let pbr = &material.pbr_metallic_roughness;
            note_clamped(loader, "baseColorFactor", &pbr.base_color_factor);
            note_clamped(loader, "roughnessFactor", &[pbr.roughness_factor]);
            note_clamped(loader, "metallicFactor", &[pbr.metallic_factor]);
            let [r, g, b, _] = pbr.base_color_factor;
            let base =
                loader.colour(pbr.base_color_texture.as_ref(), [r, g, b], space, "baseColorTexture")?;
            let (rough, metal) = (pbr.roughness_factor, pbr.metallic_factor);
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
            let index = extensions.ior.as_ref().map_or(1.5, |ior| ior.ior);
            let plain = dielectric(index);
            let (f0, level) = match &extensions.specular {
                Some(s) => {
                    let tint = s.specular_color_factor.map(|v| v * plain);
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
                            Field::Map(picture.channel(3)).times(s.specular_factor)
                        }
                        None => Field::Constant(s.specular_factor),
                    };
                    (f0, level)
                }
                None => ([plain; 3].map(Field::Constant), Field::Constant(1.0)),
            };
            (base, PbrWorkflow::Metallic { roughness, metal, f0, level })
        }
    };
    let unlit = extensions.unlit.is_some();
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
    let coat = match &extensions.clearcoat {
        Some(coat) if !unlit => clearcoat(loader, coat)?,
        _ => None,
    };
    Ok(Layers { base, kind, variance, coat })
}

/// How much the clear coat covers (red), and its roughness (green).
fn clearcoat(loader: &mut Loader<'_, '_>, coat: &Clearcoat) -> Result<Option<CoatLayer>, DocumentError> {
    note_clamped(loader, "clearcoatFactor", &[coat.clearcoat_factor]);
    note_clamped(loader, "clearcoatRoughnessFactor", &[coat.clearcoat_roughness_factor]);
    if coat.clearcoat_factor <= 0.0 {
        return Ok(None);
    }
    if coat.clearcoat_normal_texture.is_some() {
        loader.source.note("clearcoatNormalTexture: ignored; the coat is printed smooth".into());
    }
    let mut field = |info: &Option<Info>, factor, channel, name| match info {
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
    normal: &Info,
    base: Option<(usize, usize)>,
) -> Result<Option<Field>, DocumentError> {
    let placement = Placement::of(normal);
    if loader.placement.is_some_and(|first| first != placement) {
        loader.source.note(
            "normalTexture: ignored, because its placement on the surface differs from that of the other maps"
                .into(),
        );
        return Ok(None);
    }
    let Loaded { name, picture } = loader.texture(normal.index, "normalTexture", Picture::decode)?;
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
