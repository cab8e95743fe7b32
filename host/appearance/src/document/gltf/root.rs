//! The objects of a glTF file that a material needs, and the chunks of its container.
//!
//! Everything else is ignored: geometry, animations, cameras. An error names the field by its path.
//! Source: glTF 2.0, sections 4.4 (GLB) and 5; the extensions that [`Extensions`] names.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

/// The text of a file and, of a container, its data.
///
/// # Errors
/// What is wrong with the container.
pub(super) fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let Some(after) = bytes.strip_prefix(b"glTF") else { return Ok((bytes, None)) };
    let Some((version, rest)) = after.split_first_chunk().map(|(v, rest)| (u32::from_le_bytes(*v), rest))
    else {
        return Err(format!("expected 12 bytes, found {}", bytes.len()));
    };
    let Some(length) = rest.first_chunk().map(|length| u32::from_le_bytes(*length) as usize) else {
        return Err(format!("expected 12 bytes, found {}", bytes.len()));
    };
    if version != 2 {
        return Err(format!("it has version {version}; expected 2"));
    }
    // A header, and that of the first chunk.
    if length < 20 || length > bytes.len() {
        return Err(format!("it gives a length of {length} bytes, but the file has {}", bytes.len()));
    }
    let (text, rest) = chunk(&bytes[12..length], "JSON")?;
    let data = if rest.is_empty() { None } else { Some(chunk(rest, "BIN\0")?.0) };
    Ok((text, data))
}

/// The first chunk, which has this kind, and what follows it.
fn chunk<'a>(bytes: &'a [u8], kind: &str) -> Result<(&'a [u8], &'a [u8]), String> {
    let name = kind.trim_end_matches('\0');
    let Some((head, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(format!("{} bytes are left for the chunk {name}; expected at least 8", bytes.len()));
    };
    let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
    if &head[4..] != kind.as_bytes() {
        return Err(format!("expected the chunk {name}, found `{}`", head[4..].escape_ascii()));
    }
    if length > rest.len() {
        return Err(format!(
            "the chunk {name} gives a length of {length} bytes, but {} are left",
            rest.len()
        ));
    }
    Ok(rest.split_at(length))
}

/// Reads the text of a file.
///
/// # Errors
/// What is wrong with it: the path of a field, and the problem.
pub(super) fn parse(text: &[u8]) -> Result<Root, (String, String)> {
    // glTF 1.0 has objects where 2.0 has lists, so it is looked at by itself.
    #[derive(Deserialize)]
    struct Versioned {
        asset: Asset1,
    }
    #[derive(Deserialize)]
    struct Asset1 {
        version: String,
    }
    let versioned: Result<Versioned, _> = serde_json::from_slice(text);
    if let Some(version) = versioned.ok().map(|found| found.asset.version).filter(|v| v.starts_with("1.")) {
        return Err((
            "asset.version".into(),
            format!("it is glTF {version}; only 2.0 is read, and the program that made it exports that too"),
        ));
    }
    let mut reader = serde_json::Deserializer::from_slice(text);
    let root = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let path = error.path().to_string();
        let error = error.into_inner();
        // A text that is no JSON has no field, and neither has the whole.
        let field = if path == "." || !error.is_data() { "glTF".to_owned() } else { path };
        (field, error.to_string())
    })?;
    reader.end().map_err(|error| ("glTF".to_owned(), error.to_string()))?;
    Ok(root)
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    #[serde(rename = "asset")]
    _asset: Asset,
    #[serde(default)]
    pub(super) extensions_used: Vec<String>,
    #[serde(default)]
    pub(super) materials: Vec<Material>,
    #[serde(default)]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default)]
    pub(super) textures: Vec<Texture>,
    #[serde(default)]
    pub(super) images: Vec<Image>,
    #[serde(default)]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub(super) buffers: Vec<Buffer>,
}

/// Every file has one, so what has none is another kind of JSON.
#[derive(Deserialize)]
struct Asset {
    #[serde(rename = "version")]
    _version: String,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Material {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) normal_texture: Option<Info>,
    pub(super) emissive_texture: Option<IgnoredAny>,
    pub(super) emissive_factor: [f32; 3],
    pub(super) alpha_mode: Option<String>,
    pub(super) extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: [f32; 4],
    pub(super) base_color_texture: Option<Info>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) metallic_roughness_texture: Option<Info>,
}

impl Default for MetallicRoughness {
    fn default() -> MetallicRoughness {
        MetallicRoughness {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct Extensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) glossiness: Option<SpecularGlossiness>,
    #[serde(rename = "KHR_materials_specular")]
    pub(super) specular: Option<Specular>,
    #[serde(rename = "KHR_materials_ior")]
    pub(super) ior: Option<Ior>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub(super) clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: [f32; 4],
    pub(super) diffuse_texture: Option<Info>,
    pub(super) specular_factor: [f32; 3],
    pub(super) glossiness_factor: f32,
    pub(super) specular_glossiness_texture: Option<Info>,
}

impl Default for SpecularGlossiness {
    fn default() -> SpecularGlossiness {
        SpecularGlossiness {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Specular {
    pub(super) specular_factor: f32,
    pub(super) specular_texture: Option<Info>,
    pub(super) specular_color_factor: [f32; 3],
    pub(super) specular_color_texture: Option<Info>,
}

impl Default for Specular {
    fn default() -> Specular {
        Specular {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

#[derive(Deserialize)]
#[serde(default)]
pub(super) struct Ior {
    pub(super) ior: f32,
}

impl Default for Ior {
    fn default() -> Ior {
        Ior { ior: 1.5 }
    }
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Clearcoat {
    pub(super) clearcoat_factor: f32,
    pub(super) clearcoat_texture: Option<Info>,
    pub(super) clearcoat_roughness_factor: f32,
    pub(super) clearcoat_roughness_texture: Option<Info>,
    pub(super) clearcoat_normal_texture: Option<Info>,
}

/// A texture of a material.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Info {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: u32,
    /// Of normals.
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) extensions: InfoExtensions,
}

fn one() -> f32 {
    1.0
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct InfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<Transform>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Transform {
    pub(super) offset: [f32; 2],
    pub(super) rotation: f32,
    pub(super) scale: [f32; 2],
    pub(super) tex_coord: Option<u32>,
}

impl Default for Transform {
    fn default() -> Transform {
        Transform { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, IgnoredAny>,
    pub(super) material: Option<usize>,
}

#[derive(Deserialize)]
pub(super) struct Texture {
    pub(super) source: Option<usize>,
    #[serde(default)]
    pub(super) extensions: TextureExtensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub(super) struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    pub(super) webp: Option<Webp>,
}

#[derive(Deserialize)]
pub(super) struct Webp {
    pub(super) source: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
}

#[derive(Deserialize)]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn container(version: u32, length: usize, chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut bytes = b"glTF".to_vec();
        bytes.extend(version.to_le_bytes());
        bytes.extend((length as u32).to_le_bytes());
        for (kind, chunk) in chunks {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(*kind);
            bytes.extend(*chunk);
        }
        bytes
    }

    #[test]
    fn a_container_has_a_text_and_may_have_data() {
        let both = container(2, 34, &[(b"JSON", b"{ }  "), (b"BIN\0", b"x")]);
        assert_eq!(chunks(&both), Ok((&b"{ }  "[..], Some(&b"x"[..]))));
        assert_eq!(chunks(&container(2, 22, &[(b"JSON", b"{}")])), Ok((&b"{}"[..], None)));
        assert_eq!(chunks(b"{}"), Ok((&b"{}"[..], None)));
        // What follows the stated length is not part of the file.
        assert_eq!(chunks(&[&both[..], b"more"].concat()).unwrap().1, Some(&b"x"[..]));
    }

    #[test]
    fn damaged_containers_say_which_part_is_wrong() {
        let good = container(2, 34, &[(b"JSON", b"{ }  "), (b"BIN\0", b"x")]);
        for (bytes, says) in [
            (good[..11].to_vec(), "expected 12 bytes, found 11"),
            (container(1, 22, &[(b"JSON", b"{}")]), "version 1"),
            (good[..33].to_vec(), "a length of 34 bytes, but the file has 33"),
            (container(2, 12, &[]), "a length of 12 bytes"),
            (container(2, 22, &[(b"BIN\0", b"{}")]), "expected the chunk JSON, found `BIN\\x00`"),
            (
                container(2, 33, &[(b"JSON", b"{ }  "), (b"BIN\0", b"x")]),
                "BIN gives a length of 1 bytes, but 0",
            ),
            (
                container(2, 30, &[(b"JSON", b"{ }  "), (b"BIN\0", b"x")]),
                "5 bytes are left for the chunk BIN",
            ),
        ] {
            let error = chunks(&bytes).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_by_its_path() {
        let material =
            |inner: &str| format!(r#"{{"asset":{{"version":"2.0"}},"materials":[{{}},{{{inner}}}]}}"#);
        for (text, path) in [
            (
                material(r#""pbrMetallicRoughness":{"roughnessFactor":"high"}"#),
                "materials[1].pbrMetallicRoughness.roughnessFactor",
            ),
            (material(r#""emissiveFactor":[1,2]"#), "materials[1].emissiveFactor"),
            (material(r#""normalTexture":{"index":-1}"#), "materials[1].normalTexture.index"),
            (
                material(r#""normalTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":1}}}"#),
                "materials[1].normalTexture.extensions.KHR_texture_transform.scale",
            ),
            (r#"{"asset":{"version":"2.0"},"materials":{}}"#.into(), "materials"),
            (r#"{"asset":{"version":"2.0"},"bufferViews":[{"buffer":0}]}"#.into(), "bufferViews[0]"),
            (r#"{"asset":{"version":2}}"#.into(), "asset.version"),
            (r#"{"materials":[]}"#.into(), "glTF"),
            ("{".into(), "glTF"),
            (r#"{"asset":{"version":"2.0"}} x"#.into(), "glTF"),
        ] {
            let (found, problem) = parse(text.as_bytes()).err().unwrap();
            assert!(found == path && !problem.is_empty(), "{text}: {found}: {problem}");
        }
    }
}
