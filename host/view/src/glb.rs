//! A lit sheet as glTF, for any renderer.
//!
//! Problem: other programs know materials as base colour, metalness and roughness, not as sums of curves.
//! Method: the mean curve of every place is replaced by the nearest body with one GGX lobe ([`Widths`]), among the widths that
//! eight bits of roughness can say, and that by the metallic workflow. Two PNG textures and a rectangle of the sheet's true size
//! make one binary file. Curves that a clear coat over a surface explains clearly better, such as those of finish, are split into
//! both ([`coat`](crate::coat)): the coat's part is a third texture (`KHR_materials_clearcoat`), and what is below is fitted alone.
//! Cost: some ten microseconds for each texel.
//! Limits: one lobe a texel and one width of the coat, a highlight of at least 4 % on all that is no metal, and eight bits. [`Glb`] says how far the
//! texels are from the curves they stand for.
//! Source: glTF 2.0, sections 3.6, 3.7, 3.9 and 4.4; KHR_materials_clearcoat.

use appearance::brdf::Space;
use appearance::materials::Widths;
use observe::Observer;
use rayon::prelude::*;
use serde_json::json;

use crate::coat::{Coating, SMOOTHEST, Texel, texel};
use crate::error::ViewError;
use crate::lit::Lit;

/// The file, and how true it is.
#[derive(Clone, Debug)]
pub struct Glb {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// Texels across and down.
    pub texels: [usize; 2],
    /// Root mean square distance d between the texels, as another program reads them, and the curves of their places.
    pub distance: f64,
    /// The largest distance of a texel.
    pub worst: f64,
}

/// Writes what is lit as a binary glTF file. `space` is that of the curves.
///
/// # Errors
/// Textures that cannot be packed; never seen.
pub fn glb(lit: &Lit, space: &Space, name: &str, observer: &dyn Observer) -> Result<Glb, ViewError> {
    let alphas: Vec<f64> = (SMOOTHEST..=u8::MAX).map(|level| (f64::from(level) / 255.0).powi(2)).collect();
    let widths = Widths::new(space, &alphas);
    let rows: Vec<Vec<f64>> = lit.curves.iter().map(|curve| space.row(curve)).collect();
    let level = &lit.levels[0];
    let mut shares = vec![0.0f64; rows.len()];
    for weights in level.weights.chunks_exact(lit.stride) {
        shares.iter_mut().zip(weights).for_each(|(share, &w)| *share += f64::from(w));
    }
    let coating = Coating::of(&widths, space, &rows, &shares);
    observer.begin("fitting materials", level.height as u64);
    let texels: Vec<Texel> = level
        .weights
        .par_chunks_exact(level.width * lit.stride)
        .flat_map_iter(|weights| {
            observer.advance(1);
            let texels = weights.chunks_exact(lit.stride).map(|weights| {
                let (mut mean, mut part) = (vec![0.0; space.columns()], 0.0);
                for (k, (&weight, row)) in weights.iter().zip(&rows).enumerate() {
                    if weight != 0.0 {
                        mean.iter_mut().zip(row).for_each(|(sum, f)| *sum += f64::from(weight) * f);
                        part += coating.as_ref().map_or(0.0, |coating| f64::from(weight) * coating.parts[k]);
                    }
                }
                texel(&widths, space, &mean, coating.as_ref().map(|coating| (coating, part)))
            });
            texels.collect::<Vec<_>>()
        })
        .collect();
    observer.end();
    let square: f64 = texels.iter().map(|texel| texel.distance.powi(2)).sum();
    let worst = texels.iter().map(|texel| texel.distance).fold(0.0, f64::max);
    let texture = |texel: &dyn Fn(&Texel) -> [u8; 3]| {
        let bytes: Vec<u8> = texels.iter().flat_map(texel).collect();
        let size = (level.width as u32, level.height as u32);
        readers::png(&bytes, size, readers::Pixel::Rgb)
    };
    // Red is free; occlusion, which some programs expect there, is none.
    let surfaces = texture(&|texel| [255, texel.roughness, texel.metallic])?;
    let coat = match &coating {
        Some(coating) => Some((texture(&|texel| [texel.coat; 3])?, coating.roughness)),
        None => None,
    };
    let bytes = packed(lit.size, name, [texture(&|texel| texel.base)?, surfaces], coat)?;
    let distance = (square / texels.len().max(1) as f64).sqrt();
    Ok(Glb { bytes, texels: [level.width, level.height], distance, worst })
}

/// A rectangle around the origin that faces +z, in metres, with these textures.
fn packed(
    [width, height]: [f64; 2],
    name: &str,
    textures: [Vec<u8>; 2],
    coat: Option<(Vec<u8>, u8)>,
) -> Result<Vec<u8>, ViewError> {
    let (x, y) = ((0.5 * width) as f32, (0.5 * height) as f32);
    // From the lower left corner against the clock; textures begin at the top.
    let positions = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]];
    let places = [[0.0f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let floats = |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    let parts = [
        floats(positions.as_flattened()),
        floats([[0.0f32, 0.0, 1.0]; 4].as_flattened()),
        floats(places.as_flattened()),
        [0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect(),
    ];
    let mut binary = Vec::new();
    let mut views = Vec::new();
    for (i, part) in parts.iter().chain(&textures).chain(coat.as_ref().map(|coat| &coat.0)).enumerate() {
        let mut view = json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": part.len()});
        // What the numbers are for: of vertices, or of triangles.
        const TARGETS: [u32; 4] = [34962, 34962, 34962, 34963];
        if let Some(target) = TARGETS.get(i) {
            view["target"] = json!(target);
        }
        views.push(view);
        binary.extend_from_slice(part);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    const FLOAT: u32 = 5126;
    const SHORT: u32 = 5123;
    let texture = |source: usize| json!({"sampler": 0, "source": source});
    let picture =
        |view: usize, name: &str| json!({"bufferView": view, "mimeType": "image/png", "name": name});
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("foilpress ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0,
        }]}],
        "materials": [{"name": name, "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1},
        }}],
        "textures": [texture(0), texture(1)],
        // Linear, with smaller copies for the distance; nothing repeats.
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}],
        "images": [picture(4, "base colour"), picture(5, "roughness and metalness")],
        "accessors": [
            {"bufferView": 0, "componentType": FLOAT, "count": 4, "type": "VEC3",
             "min": [-x, -y, 0.0], "max": [x, y, 0.0]},
            {"bufferView": 1, "componentType": FLOAT, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": FLOAT, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": SHORT, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": binary.len()}],
    });
    if let Some((_, roughness)) = coat {
        document["extensionsUsed"] = json!(["KHR_materials_clearcoat"]);
        document["textures"] = json!([texture(0), texture(1), texture(2)]);
        document["images"] = json!([
            picture(4, "base colour"),
            picture(5, "roughness and metalness"),
            picture(6, "clear coat")
        ]);
        document["materials"][0]["extensions"] = json!({"KHR_materials_clearcoat": {
            "clearcoatFactor": 1, "clearcoatTexture": {"index": 2},
            "clearcoatRoughnessFactor": f64::from(roughness) / 255.0,
        }});
    }
    let mut text = serde_json::to_vec(&document)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = Vec::with_capacity(28 + text.len() + binary.len());
    let length = |bytes: usize| (bytes as u32).to_le_bytes();
    bytes.extend_from_slice(b"glTF");
    bytes.extend_from_slice(&2u32.to_le_bytes());
    bytes.extend_from_slice(&length(28 + text.len() + binary.len()));
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        bytes.extend_from_slice(&length(chunk.len()));
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(chunk);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::Table;
    use appearance::document::{Options, open};
    use appearance::factor::Factored;
    use appearance::weights::{ONE, WeightMaps};
    use observe::Silent;
    use press::preview::Source;

    /// A metal, a varnished body and a matt one, each pure somewhere.
    fn lit(space: &Space) -> (Lit, Factored) {
        let lobe = |t: f64, alpha: f64| inks::ggx::lobe(t, alpha);
        let mut bases = Table::new(space.columns());
        let mut push = |f: &dyn Fn(f64) -> [f64; 3]| {
            bases.push(&space.row(&inks::Curve::sampled(space.angles(), f)));
        };
        push(&|t| [0.9, 0.7, 0.3].map(|f0| f0 * lobe(t, 0.09)));
        push(&|t| [0.1, 0.3, 0.5].map(|d| d * 0.96 / std::f64::consts::PI + 0.04 * lobe(t, 0.25)));
        push(&|t| [0.8; 3].map(|d| d * 0.96 / std::f64::consts::PI + 0.04 * lobe(t, 0.9)));
        let data = (0..64 * 32).flat_map(|i| {
            let which = i % 64 / 22;
            std::array::from_fn::<u16, 3, _>(|k| if k == which { ONE } else { 0 })
        });
        let maps = WeightMaps::new(64, 32, 3, data.collect()).unwrap();
        let factored = Factored { space: space.clone(), bases, maps };
        (Lit::new(&Source::Factored(&factored), [0.08, 0.04], 64).unwrap(), factored)
    }

    /// Our own reader of glTF, written for other people's files, finds the curves again.
    #[test]
    fn the_file_is_read_back_as_the_same_materials() {
        let space = Space::half_angle(32);
        let (lit, factored) = lit(&space);
        let glb = glb(&lit, &space, "three <materials>", &Silent).unwrap();
        assert_eq!(glb.texels, [64, 32]);
        assert!(glb.distance < 0.004 && glb.worst < 0.006, "{} {}", glb.distance, glb.worst);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.glb");
        std::fs::write(&path, &glb.bytes).unwrap();
        let document = open(path.to_str().unwrap(), &Options::default(), &Silent).unwrap();
        assert_eq!(document.name, "three <materials>");
        let materials = document.materials();
        assert_eq!((materials.width(), materials.height()), (64, 32));
        for (x, k) in [(3, 0), (30, 1), (60, 2)] {
            let mut row = vec![0.0f32; space.columns()];
            materials.reflectance(5 * 64 + x, &mut row);
            let found: Vec<f64> = row.into_iter().map(f64::from).collect();
            let off = space.distance(&found, factored.bases.row(k));
            assert!(off < 0.006, "{k}: {off}");
        }
    }

    /// A print of half finish: two lobes, as finish over paper and over a metal has them, beside paper without.
    #[test]
    fn finish_is_a_clear_coat_that_is_found_again() {
        let space = Space::half_angle(32);
        let lobe = |t: f64, alpha: f64| inks::ggx::lobe(t, alpha);
        let mut bases = Table::new(space.columns());
        let paper = |t: f64| [0.8; 3].map(|d| d * 0.96 / std::f64::consts::PI + 0.04 * lobe(t, 0.8));
        let metal = |t: f64| [0.9, 0.7, 0.3].map(|f0| f0 * lobe(t, 0.5));
        let coated = |f: [f64; 3], t: f64| f.map(|f| 0.96 * 0.96 * f + 0.04 * lobe(t, 0.05));
        for f in [&paper as &dyn Fn(f64) -> [f64; 3], &|t| coated(paper(t), t), &|t| coated(metal(t), t)] {
            bases.push(&space.row(&inks::Curve::sampled(space.angles(), f)));
        }
        let data = (0..64 * 32).flat_map(|i| {
            let which = i % 64 / 22;
            std::array::from_fn::<u16, 3, _>(|k| if k == which { ONE } else { 0 })
        });
        let maps = WeightMaps::new(64, 32, 3, data.collect()).unwrap();
        let factored = Factored { space: space.clone(), bases, maps };
        let lit = Lit::new(&Source::Factored(&factored), [0.08, 0.04], 64).unwrap();
        let glb = glb(&lit, &space, "coated", &Silent).unwrap();
        assert!(glb.distance < 0.006, "{}", glb.distance);
        let text = String::from_utf8_lossy(&glb.bytes);
        assert!(text.contains("KHR_materials_clearcoat"), "the coat is there");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.glb");
        std::fs::write(&path, &glb.bytes).unwrap();
        let document = open(path.to_str().unwrap(), &Options::default(), &Silent).unwrap();
        for (x, k) in [(3, 0), (30, 1), (60, 2)] {
            let mut row = vec![0.0f32; space.columns()];
            document.materials().reflectance(5 * 64 + x, &mut row);
            let found: Vec<f64> = row.into_iter().map(f64::from).collect();
            let off = space.distance(&found, factored.bases.row(k));
            assert!(off < 0.01, "{k}: {off}");
            // Over a matt body one lobe does as well; over a metal it is another material.
            let alphas: Vec<f64> =
                (SMOOTHEST..=u8::MAX).map(|level| (f64::from(level) / 255.0).powi(2)).collect();
            let widths = Widths::new(&space, &alphas);
            let alone = texel(&widths, &space, factored.bases.row(k), None).distance;
            assert!(k < 2 || off < 0.5 * alone, "{k}: {off}, {alone}");
        }
    }

    /// The container by the letter of the specification, not by a reader.
    #[test]
    fn the_container_is_aligned_and_says_its_lengths() {
        let space = Space::half_angle(32);
        let (lit, _) = lit(&space);
        let bytes = glb(&lit, &space, "x", &Silent).unwrap().bytes;
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let text = word(12);
        assert_eq!((text % 4, &bytes[16..20]), (0, &b"JSON"[..]));
        let document: serde_json::Value = serde_json::from_slice(&bytes[20..20 + text]).unwrap();
        let binary = &bytes[28 + text..];
        assert_eq!((word(20 + text), &bytes[24 + text..28 + text]), (binary.len(), &b"BIN\0"[..]));
        assert_eq!(document["buffers"][0]["byteLength"], binary.len());
        for view in document["bufferViews"].as_array().unwrap() {
            let [offset, length] =
                ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
            assert!(offset % 4 == 0 && offset + length <= binary.len(), "{view}");
        }
        for image in document["images"].as_array().unwrap() {
            let view = &document["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
            let offset = view["byteOffset"].as_u64().unwrap() as usize;
            assert_eq!(&binary[offset + 1..offset + 4], b"PNG");
        }
        // The sheet has its size: 80 x 40 mm.
        let position = &document["accessors"][0];
        let side = |c: usize| position["max"][c].as_f64().unwrap() - position["min"][c].as_f64().unwrap();
        assert!((side(0) - 0.08).abs() < 1e-6 && (side(1) - 0.04).abs() < 1e-6, "{position}");
    }
}
