//! glTF and GLB: one material of a file as a document, its textures unrolled as they are stored.
//!
//! Read: metallic-roughness with its factors, `KHR_materials_pbrSpecularGlossiness`, `KHR_materials_specular`,
//! `KHR_materials_ior`, normal maps (folded into roughness). Geometry is not: the print is the texture square, so
//! where the mesh puts it does not matter. A texture transform common to all maps does not matter either and is noted;
//! maps with different transforms do not lie on each other and are refused.
//! Pictures come from data URIs, from buffers, or from files in the same folder or below; no path leads out.
//! Source: glTF 2.0, sections 3.9 and appendix B.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use ::gltf::json;
use base64::Engine;

use super::error::DocumentError;
use super::folder::relief_note;
use super::picture::Picture;
use super::relief;
use super::source::{MOST_BYTES, Source};
use super::surfaces::{Surfaces, dielectric, metallic, specular};
use super::texture::{Field, same_shape};
use super::{ColourSpace, Content, Document, Options, SWATCH_MM, stem};
use crate::brdf::Space;

/// Extensions that are read, or that say nothing about reflectance.
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
        source.note(format!("{}: {} is used by the file and not read", path.display(), foreign.join(", ")));
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
        name: name.unwrap_or_else(|| format!("{}-{number}", stem(path))),
        content: Content::Surfaces(surfaces),
        size_mm: (!textured).then_some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
    })
}

/// The container's lengths, before the crate that splits it does arithmetic on them.
fn check_glb(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let Some(length) = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])) else {
        return Err(format!("expected 12 bytes, found {}", bytes.len()));
    };
    if length < 20 || length as usize > bytes.len() {
        return Err(format!("says the file has {length} bytes, it has {}", bytes.len()));
    }
    Ok(())
}

/// The material asked for, by number or name; the only one if nothing is asked.
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
            problem: "the file has no material to print".into(),
        });
    }
    let found = match asked {
        None if root.materials.len() == 1 => 0,
        None => return Err(fail(format!("the file has {} materials", root.materials.len()))),
        Some(asked) => match asked.parse::<usize>() {
            Ok(number) if number < root.materials.len() => number,
            _ => (0..root.materials.len())
                .find(|&i| name(i) == asked)
                .ok_or_else(|| fail(format!("there is no material `{asked}`")))?,
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

/// Where a map lies on the surface: offset, rotation, scale, set of coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Placement {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    coordinates: u32,
}

impl Placement {
    fn of(info: &json::texture::Info) -> Placement {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        Placement {
            offset: transform.map_or([0.0; 2], |t| t.offset.0),
            rotation: transform.map_or(0.0, |t| t.rotation.0),
            scale: transform.map_or([1.0; 2], |t| t.scale.0),
            coordinates: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
        }
    }

    fn is_plain(&self) -> bool {
        self.offset == [0.0; 2] && self.rotation == 0.0 && self.scale == [1.0; 2]
    }
}

/// A decoded texture and how to call it.
struct Loaded {
    name: String,
    picture: Picture,
}

struct Loader<'a, 's> {
    root: &'a json::Root,
    blob: Option<Vec<u8>>,
    path: &'a Path,
    source: &'a mut Source<'s>,
    /// That of the first map read; the others must share it.
    placement: Option<Placement>,
}

impl<'a> Loader<'a, '_> {
    fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.to_path_buf(), field: field.into(), problem }
    }

    /// The picture of a map that must lie where the others do.
    fn load(&mut self, info: &json::texture::Info, field: &str) -> Result<Loaded, DocumentError> {
        let placement = Placement::of(info);
        match self.placement {
            None => {
                if !placement.is_plain() {
                    self.source.note(format!(
                        "{}: the texture is printed as it is stored, without its texture transform",
                        self.path.display()
                    ));
                }
                self.placement = Some(placement);
            }
            Some(first) if first != placement => {
                let problem =
                    "placed on the surface otherwise than the material's other maps, which a flat print \
                               cannot follow; bake the maps to one set of coordinates"
                        .into();
                return Err(self.wrong(field, problem));
            }
            Some(_) => {}
        }
        self.texture(info.index.value(), field)
    }

    fn texture(&mut self, index: usize, field: &str) -> Result<Loaded, DocumentError> {
        let Some(texture) = self.root.textures.get(index) else {
            return Err(self.wrong(field, format!("texture {index} does not exist")));
        };
        let number = texture.source.value();
        let Some(image) = self.root.images.get(number) else {
            return Err(self.wrong(field, format!("image {number} does not exist")));
        };
        let (name, bytes) = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => self.resource(uri, field, &format!("image {number}"))?,
            (None, Some(view)) => {
                let name = PathBuf::from(format!("{} image {number}", self.path.display()));
                (name, self.view(view.value(), field)?)
            }
            (None, None) => {
                return Err(self.wrong(field, format!("image {number} has neither uri nor bufferView")));
            }
        };
        let picture = Picture::decode(&bytes, &name, self.source)?;
        self.source.observer.advance(1);
        let name = name.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Loaded { name, picture })
    }

    /// The bytes a buffer view covers.
    fn view(&mut self, index: usize, field: &str) -> Result<Vec<u8>, DocumentError> {
        let Some(view) = self.root.buffer_views.get(index) else {
            return Err(self.wrong(field, format!("bufferView {index} does not exist")));
        };
        let number = view.buffer.value();
        let Some(buffer) = self.root.buffers.get(number) else {
            return Err(self.wrong(field, format!("buffer {number} does not exist")));
        };
        let external;
        let data: &[u8] = match &buffer.uri {
            Some(uri) => {
                external = self.resource(uri, field, &format!("buffer {number}"))?.1;
                &external
            }
            None => match &self.blob {
                Some(blob) if number == 0 => blob,
                _ => {
                    return Err(
                        self.wrong(field, format!("buffer {number} has no uri and the file no data chunk"))
                    );
                }
            },
        };
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.checked_add(view.byte_length.0).filter(|&end| end <= data.len() as u64);
        let Some(end) = end else {
            let problem = format!(
                "bufferView {index} asks for {} bytes at {start}, buffer {number} has {}",
                view.byte_length.0,
                data.len()
            );
            return Err(self.wrong(field, problem));
        };
        Ok(data[start as usize..end as usize].to_vec())
    }

    /// What a URI stands for: data, or a file in the folder of the document or below.
    fn resource(&mut self, uri: &str, field: &str, label: &str) -> Result<(PathBuf, Vec<u8>), DocumentError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded =
                data.split_once(',').filter(|(kind, _)| kind.ends_with(";base64")).map(|(_, data)| data);
            let Some(encoded) = encoded else {
                return Err(self.wrong(field, format!("{label}: expected a data URI in base64")));
            };
            let bytes = base64::engine::general_purpose::STANDARD
                .decode(encoded)
                .map_err(|error| self.wrong(field, format!("{label}: the data URI is damaged: {error}")))?;
            return Ok((PathBuf::from(format!("{} {label}", self.path.display())), bytes));
        }
        let file = percent_decoded(uri);
        let within =
            Path::new(&*file).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if !within || file.contains([':', '\\', '\0']) || file.is_empty() {
            return Err(self.wrong(
                field,
                format!("{label}: `{uri}` is not a file in the document's folder or below, and nothing else is read"),
            ));
        }
        let path = self.path.parent().unwrap_or(Path::new("")).join(&*file);
        let bytes = self.source.read(&path, MOST_BYTES)?;
        Ok((path, bytes))
    }

    fn colour(
        &mut self,
        info: Option<&json::texture::Info>,
        factor: [f32; 3],
        space: ColourSpace,
        field: &str,
    ) -> Result<[Field; 3], DocumentError> {
        let Some(info) = info else { return Ok(factor.map(Field::Constant)) };
        let Loaded { name, picture } = self.load(info, field)?;
        let how = if space == ColourSpace::Srgb { "sRGB" } else { "linear" };
        self.source.note(format!("{name}: {field} read as {how}"));
        if picture.has_foreign_profile() {
            self.source.note(format!("{name}: its colour profile is not applied"));
        }
        Ok(coloured(&picture, factor, space))
    }
}

fn coloured(picture: &Picture, factor: [f32; 3], space: ColourSpace) -> [Field; 3] {
    let [r, g, b] = picture.linear(space);
    [Field::Map(r).times(factor[0]), Field::Map(g).times(factor[1]), Field::Map(b).times(factor[2])]
}

fn percent_decoded(uri: &str) -> Cow<'_, str> {
    if !uri.contains('%') {
        return Cow::Borrowed(uri);
    }
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let hex = |b: &u8| char::from(*b).to_digit(16);
        match (first, tail) {
            (b'%', [high, low, after @ ..]) if hex(high).is_some() && hex(low).is_some() => {
                let value = hex(high).unwrap_or(0) * 16 + hex(low).unwrap_or(0);
                bytes.push(value as u8);
                rest = after;
            }
            _ => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    Cow::Owned(String::from_utf8_lossy(&bytes).into_owned())
}

/// The numbers of a material, each a map or a constant.
struct Layers {
    base: [Field; 3],
    kind: Kind,
    /// Slope variance and the size of the map it comes from.
    variance: Option<Field>,
}

enum Kind {
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
            let [r, g, b, _] = old.diffuse_factor.0;
            let base = loader.colour(old.diffuse_texture.as_ref(), [r, g, b], space, "diffuseTexture")?;
            let (f0, gloss) = match &old.specular_glossiness_texture {
                Some(info) => {
                    let Loaded { name, picture } = loader.load(info, "specularGlossinessTexture")?;
                    loader.source.note(format!("{name}: alpha is glossiness here"));
                    let gloss = Field::Map(picture.channel(3)).times(old.glossiness_factor.0);
                    (coloured(&picture, old.specular_factor.0, space), gloss)
                }
                None => {
                    (old.specular_factor.0.map(Field::Constant), Field::Constant(old.glossiness_factor.0))
                }
            };
            (base, Kind::Specular { f0, gloss })
        }
        None => {
            let pbr = &material.pbr_metallic_roughness;
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
            (base, Kind::Metallic { roughness, metal, f0, level })
        }
    };
    let variance = match &material.normal_texture {
        None => None,
        Some(normal) => normal_variance(loader, normal, base[0].size())?,
    };
    Ok(Layers { base, kind, variance })
}

/// The slope variance of the normal map, or nothing if it does not lie where the other maps do: detail that
/// repeats at its own scale.
fn normal_variance(
    loader: &mut Loader<'_, '_>,
    normal: &json::material::NormalTexture,
    base: Option<(usize, usize)>,
) -> Result<Option<Field>, DocumentError> {
    if loader.placement.is_some_and(|first| first.coordinates != normal.tex_coord) {
        loader.source.note("normalTexture: has coordinates of its own; its relief is left out".into());
        return Ok(None);
    }
    let Loaded { name, picture } = loader.texture(normal.index.value(), "normalTexture")?;
    if picture.colours() != 3 {
        return Err(
            loader.wrong("normalTexture", format!("{name}: expected components of normals, found grey"))
        );
    }
    let scale = base.map_or(1.0, |(width, _)| picture.width as f64 / width as f64);
    let radius = (scale * (relief::WINDOW / 2) as f64).round().clamp(1.0, 256.0) as usize;
    loader.source.note(relief_note(&name));
    let variance = relief::slope_variance(&picture.channel(0), &picture.channel(1), normal.scale, radius);
    Ok(Some(Field::Map(variance)))
}

/// Brings all maps to one size, that of the base colour or else the largest, and makes the surfaces. Also says
/// whether there was any map at all.
fn build(
    layers: Layers,
    path: &Path,
    space: Space,
    source: &mut Source<'_>,
) -> Result<(Surfaces, bool), DocumentError> {
    let Layers { base, kind, variance } = layers;
    let mut others: Vec<Option<(usize, usize)>> = vec![variance.as_ref().and_then(Field::size)];
    match &kind {
        Kind::Metallic { roughness, metal, f0, level } => {
            others.extend([roughness.size(), metal.size(), f0[0].size(), level.size()]);
        }
        Kind::Specular { f0, gloss } => others.extend([f0[0].size(), gloss.size()]),
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
                    "maps of {width} x {height} and {w} x {h} pixels: one material needs one shape"
                ),
            });
        }
        source.note(format!("a map of {w} x {h} pixels is resized to {width} x {height}"));
    }
    let fit = |field: Field| field.resized(width, height);
    let base = base.map(fit);
    let variance = variance.map(fit);
    let rough = |alpha: f32, i: usize| variance.as_ref().map_or(alpha, |v| relief::widened(alpha, v.at(i)));
    let rgb = |fields: &[Field; 3], i: usize| -> [f32; 3] {
        std::array::from_fn(|c| fields[c].at(i).clamp(0.0, 1.0))
    };
    let surfaces = match kind {
        Kind::Metallic { roughness, metal, f0, level } => {
            let (roughness, metal, f0, level) = (fit(roughness), fit(metal), f0.map(fit), fit(level));
            Surfaces::build(width, height, space, |i| {
                let level = level.at(i).clamp(0.0, 1.0);
                let f0 = rgb(&f0, i).map(|v| v * level);
                let metal = metal.at(i).clamp(0.0, 1.0);
                let mut surface = metallic(rgb(&base, i), f0, roughness.at(i).clamp(0.0, 1.0), metal);
                surface.alpha = rough(surface.alpha, i);
                surface
            })
        }
        Kind::Specular { f0, gloss } => {
            let (f0, gloss) = (f0.map(fit), fit(gloss));
            Surfaces::build(width, height, space, |i| {
                let mut surface = specular(rgb(&base, i), rgb(&f0, i), gloss.at(i).clamp(0.0, 1.0));
                surface.alpha = rough(surface.alpha, i);
                surface
            })
        }
    };
    Ok((surfaces, chosen.is_some()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Materials, Surface, open};
    use crate::observe::Silent;
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

    fn png(width: u32, height: u32, rgb: impl Fn(u32) -> [u8; 3]) -> Vec<u8> {
        let data: Vec<u8> = (0..width * height).flat_map(rgb).collect();
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes).write_image(&data, width, height, ExtendedColorType::Rgb8).unwrap();
        bytes
    }

    fn data_uri(bytes: &[u8]) -> String {
        format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
    }

    fn surfaces(path: &Path, material: Option<&str>) -> Result<(Surfaces, Document), DocumentError> {
        let options = Options { material: material.map(Into::into), ..Options::default() };
        let document = open(path.to_str().unwrap(), &options, &Silent)?;
        let Content::Surfaces(surfaces) = &document.content else { panic!("glTF gives surfaces") };
        Ok((surfaces.clone(), document))
    }

    fn close(a: Surface, b: Surface) {
        let values =
            |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
        for (x, y) in values(a).into_iter().zip(values(b)) {
            assert!((x - y).abs() < 2e-4, "{a:?} {b:?}");
        }
    }

    #[test]
    fn textures_and_factors_multiply_and_each_way_of_storing_them_reads_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let base = png(2, 2, |i| [255, 128, (60 * i) as u8]);
        let orm = png(2, 2, |i| [9, 200, (80 * i) as u8]);
        std::fs::write(folder.path().join("base colour.png"), &base).unwrap();
        std::fs::write(folder.path().join("orm.png"), &orm).unwrap();
        let json = |images: &str, rest: &str| {
            format!(
                r#"{{"asset":{{"version":"2.0"}},"images":[{images}],
                "textures":[{{"source":0}},{{"source":1}}],
                "materials":[{{"name":"a"}},{{"name":"tin","pbrMetallicRoughness":{{
                "baseColorFactor":[1,0.5,1,1],"roughnessFactor":0.75,"metallicFactor":0.5,
                "baseColorTexture":{{"index":0}},"metallicRoughnessTexture":{{"index":1}}}}}}]{rest}}}"#
            )
        };
        let file = folder.path().join("file.gltf");
        std::fs::write(&file, json(r#"{"uri":"base%20colour.png"},{"uri":"./orm.png"}"#, "")).unwrap();
        let inline = folder.path().join("inline.gltf");
        let uris = format!(r#"{{"uri":"{}"}},{{"uri":"{}"}}"#, data_uri(&base), data_uri(&orm));
        std::fs::write(&inline, json(&uris, "")).unwrap();
        // The same as a binary container.
        let views = format!(
            r#","buffers":[{{"byteLength":{}}}],"bufferViews":[{{"buffer":0,"byteLength":{}}},
            {{"buffer":0,"byteOffset":{},"byteLength":{}}}]"#,
            base.len() + orm.len(),
            base.len(),
            base.len(),
            orm.len()
        );
        let image = |view| format!(r#"{{"bufferView":{view},"mimeType":"image/png"}}"#);
        let mut text = json(&format!("{},{}", image(0), image(1)), &views).into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut data = [base, orm].concat();
        data.resize(data.len().next_multiple_of(4), 0);
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((28 + text.len() as u32 + data.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", data)] {
            glb.extend((chunk.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        let binary = folder.path().join("binary.glb");
        std::fs::write(&binary, glb).unwrap();

        for path in [file, inline, binary] {
            let (read, document) = surfaces(&path, Some("tin")).unwrap();
            assert_eq!((read.width(), read.height(), &document.name[..]), (2, 2, "tin"));
            let linear = |v: f32| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
            let colour = [1.0, 0.5 * linear(128.0), linear(180.0)];
            let (rough, metal) = (0.75 * 200.0 / 255.0, 0.5 * 240.0 / 255.0);
            close(read.surface(3), metallic(colour, [0.04; 3], rough, metal));
        }
    }

    #[test]
    fn index_of_refraction_and_specular_factors_set_the_reflectance_of_dielectrics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(
            &path,
            r#"{"asset":{"version":"2.0"},"materials":[{"pbrMetallicRoughness":{"metallicFactor":0,
            "roughnessFactor":0.5,"baseColorFactor":[0.2,0.3,0.4,1]},"extensions":{"KHR_materials_ior":{"ior":2.0},
            "KHR_materials_specular":{"specularFactor":0.5,"specularColorFactor":[1,0.5,0]}}}]}"#,
        )
        .unwrap();
        let (read, document) = surfaces(&path, None).unwrap();
        let f0 = [1.0 / 18.0, 1.0 / 36.0, 0.0];
        let diffuse = [0.2 * (1.0 - f0[0]), 0.3 * (1.0 - f0[1]), 0.4];
        close(read.surface(0), Surface { diffuse, f0, alpha: 0.25 });
        assert_eq!(document.size_mm, Some((SWATCH_MM, SWATCH_MM)));
    }

    #[test]
    fn the_older_workflow_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(
            &path,
            r#"{"asset":{"version":"2.0"},"materials":[{"extensions":{"KHR_materials_pbrSpecularGlossiness":{
            "diffuseFactor":[0.5,0.5,0.5,1],"specularFactor":[0.2,0.1,0.1],"glossinessFactor":0.6}}}]}"#,
        )
        .unwrap();
        let expected = Surface { diffuse: [0.4; 3], f0: [0.2, 0.1, 0.1], alpha: 0.16 };
        close(surfaces(&path, None).unwrap().0.surface(0), expected);
    }

    #[test]
    fn nothing_outside_the_folder_is_read_and_damage_is_named() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("inner");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(outer.path().join("secret.png"), png(1, 1, |_| [0; 3])).unwrap();
        let path = folder.join("a.gltf");
        let image = |uri: &str| {
            format!(
                r#"{{"asset":{{"version":"2.0"}},"images":[{uri}],"textures":[{{"source":0}}],"materials":[{{
                "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}]}}"#
            )
        };
        let absolute = format!(r#"{{"uri":"{}"}}"#, outer.path().join("secret.png").display());
        for (json, says) in [
            (image(r#"{"uri":"../secret.png"}"#), "secret.png"),
            (image(r#"{"uri":"%2e%2e/secret.png"}"#), "not a file in the document's folder"),
            (image(&absolute), "not a file in the document's folder"),
            (image(r#"{"uri":"file:///etc/passwd"}"#), "not a file in the document's folder"),
            (image(r#"{"uri":"missing.png"}"#), "missing.png"),
            (image(r#"{"uri":"data:image/png;base64,@@"}"#), "damaged"),
            (image(r#"{"bufferView":7,"mimeType":"image/png"}"#), "bufferView 7 does not exist"),
            (image("{}"), "neither uri nor bufferView"),
            (image("").replace(r#""index":0"#, r#""index":4"#), "texture 4 does not exist"),
            (r#"{"asset":{"version":"2.0"}}"#.into(), "no material to print"),
            ("{".into(), "glTF"),
        ] {
            std::fs::write(&path, &json).unwrap();
            let error = surfaces(&path, None).unwrap_err().to_string();
            assert!(error.contains("a.gltf") || error.contains("missing.png"), "{error}");
            assert!(error.contains(says), "{json}: {error}");
        }
    }

    #[test]
    fn several_materials_need_a_choice() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, r#"{"asset":{"version":"2.0"},"materials":[{"name":"tin"},{}]}"#).unwrap();
        let error = surfaces(&path, None).unwrap_err().to_string();
        assert!(error.contains("0 (tin), 1 (without a name)"), "{error}");
        assert!(surfaces(&path, Some("1")).is_ok() && surfaces(&path, Some("tin")).is_ok());
        assert!(surfaces(&path, Some("2")).is_err() && surfaces(&path, Some("lead")).is_err());
    }
}
