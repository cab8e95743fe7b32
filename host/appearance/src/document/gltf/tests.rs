//! Files made here, by hand: each workflow, each way to store a picture, each way out of the folder.

use super::*;
use crate::document::open;
use crate::materials::{Materials, Surface, Surfaces, metallic};
use base64::Engine;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use observe::Silent;

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
    let values = |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
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
fn files_outside_the_folder_and_damage_are_errors() {
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
        (image(r#"{"uri":"%2e%2e/secret.png"}"#), "must be a file in the document's folder"),
        (image(&absolute), "must be a file in the document's folder"),
        (image(r#"{"uri":"file:///etc/passwd"}"#), "must be a file in the document's folder"),
        (image(r#"{"uri":"missing.png"}"#), "missing.png"),
        (image(r#"{"uri":"data:image/png;base64,@@"}"#), "damaged"),
        (image(r#"{"bufferView":7,"mimeType":"image/png"}"#), "bufferView 7 does not exist"),
        (image("{}"), "neither uri nor bufferView"),
        (
            image(r#"{"uri":"missing.png"}"#)
                .replace(r#"{"source":0}"#, r#"{"extensions":{"KHR_texture_basisu":{"source":0}}}"#)
                .replace(
                    r#""images""#,
                    r#""extensionsUsed":["KHR_texture_basisu","KHR_texture_transform"],"images""#,
                ),
            "texture 0 has no image that can be read; the file uses KHR_texture_basisu; export the file with PNG",
        ),
        (image("").replace(r#""index":0"#, r#""index":4"#), "texture 4 does not exist"),
        (r#"{"asset":{"version":"2.0"}}"#.into(), "no material"),
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
    // Two of one name are no choice, either; their numbers are.
    std::fs::write(&path, r#"{"asset":{"version":"2.0"},"materials":[{"name":"tin"},{"name":"tin"}]}"#)
        .unwrap();
    let error = surfaces(&path, Some("tin")).unwrap_err().to_string();
    assert!(error.contains("2 materials have the name `tin`") && error.contains("1 (tin)"), "{error}");
    assert!(surfaces(&path, Some("1")).is_ok());
}

/// A factor beyond 1 is legal to write and of no use to a printer: it is cut off, and said.
#[test]
fn factors_that_are_cut_off_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bright.gltf");
    let notes = |factors: &str| {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"materials":[{{"pbrMetallicRoughness":{{{factors}}}}}]}}"#
        );
        std::fs::write(&path, json).unwrap();
        surfaces(&path, None).unwrap().1.notes
    };
    let said =
        notes(r#""baseColorFactor":[1.7,0.5,1,1],"roughnessFactor":-0.5,"metallicFactor":1"#).join("\n");
    assert!(said.contains("baseColorFactor: 1.7 is not from 0 to 1"), "{said}");
    assert!(said.contains("roughnessFactor: -0.5"), "{said}");
    assert!(
        !notes(r#""baseColorFactor":[1,0.5,0,1],"roughnessFactor":0.5"#).join("\n").contains("from 0 to 1")
    );
}

/// The equation of glTF's coat, term by term: factors times textures, the coat's lobe over the dimmed base.
#[test]
fn a_clear_coat_is_a_second_lobe() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("coat.png"), png(2, 2, |i| [if i == 3 { 255 } else { 0 }, 204, 9]))
        .unwrap();
    let path = folder.path().join("a.gltf");
    let text = r#"{"asset":{"version":"2.0"},"extensionsUsed":["KHR_materials_clearcoat","KHR_materials_sheen"],
        "images":[{"uri":"coat.png"}],"textures":[{"source":0}],"materials":[{"pbrMetallicRoughness":{
        "baseColorFactor":[0.2,0.4,0.6,1],"metallicFactor":0,"roughnessFactor":0.9},"extensions":{
        "KHR_materials_clearcoat":{"clearcoatFactor":0.5,"clearcoatRoughnessFactor":0.5,
        "clearcoatTexture":{"index":0},"clearcoatRoughnessTexture":{"index":0}}}}]}"#;
    std::fs::write(&path, text).unwrap();
    let (read, document) = surfaces(&path, None).unwrap();
    let base = metallic([0.2, 0.4, 0.6], [0.04; 3], 0.9, 0.0);
    close(read.surface(0), base);
    let mut row = vec![0.0; read.space().columns()];
    read.reflectance(3, &mut row);
    let below = read.space().row(&base.curve(read.space().angles()));
    for (n, &t) in read.space().angles().iter().enumerate() {
        // Roughness 0.5 * 0.8, so that alpha is 0.16.
        let coat = 0.96 * 0.96 * below[3 * n] + 0.04 * inks::ggx::lobe(t, 0.16);
        let expected = 0.5 * coat + 0.5 * below[3 * n];
        assert!((f64::from(row[3 * n]) / expected - 1.0).abs() < 1e-3, "{n}: {} {expected}", row[3 * n]);
    }
    let said = document.notes.join("\n");
    assert!(said.contains("KHR_materials_sheen") && !said.contains("KHR_materials_clearcoat"), "{said}");
}

#[test]
fn what_is_not_printed_is_noted_and_alpha_that_is_read_is_not_called_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let alpha: Vec<u8> = (0..4).flat_map(|i| [200, 100, 50, 60 * i]).collect();
    let mut picture = Vec::new();
    PngEncoder::new(&mut picture).write_image(&alpha, 2, 2, ExtendedColorType::Rgba8).unwrap();
    let notes = |material: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0","extras":"made by hand"}},"images":[{{"uri":"{}"}}],"textures":[{{"source":0}}],
            "materials":[{{"extras":7,{material}}}]}}"#,
            data_uri(&picture)
        );
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, text).unwrap();
        surfaces(&path, None).unwrap().1.notes.join("; ")
    };
    let plain = r#""pbrMetallicRoughness":{"baseColorTexture":{"index":0}}"#;
    let said = notes(plain);
    assert!(said.contains("alpha is ignored") && !said.contains("not printed"), "{said}");
    let said = notes(&format!(r#"{plain},"emissiveFactor":[0,0.5,0],"alphaMode":"BLEND""#));
    assert!(said.contains("not printed: emission, transparency"), "{said}");
    let said = notes(
        r#""extensions":{"KHR_materials_pbrSpecularGlossiness":{"specularGlossinessTexture":{"index":0}}}"#,
    );
    assert!(said.contains("alpha is read as glossiness") && !said.contains("ignored"), "{said}");
    let said = notes(r#""extensions":{"KHR_materials_specular":{"specularTexture":{"index":0}}}"#);
    assert!(said.contains("alpha is read as the strength") && !said.contains("ignored"), "{said}");
}

#[test]
fn normals_that_lie_otherwise_than_the_other_maps_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let bumps = data_uri(&png(8, 8, |i| if i % 2 == 0 { [200, 128, 220] } else { [56, 128, 220] }));
    let base = data_uri(&png(8, 8, |_| [90, 120, 150]));
    let alpha = |own: &str, others: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"{base}"}},{{"uri":"{bumps}"}}],"textures":[{{"source":0}},{{"source":1}}],
            "materials":[{{"normalTexture":{{"index":1{own}}},"pbrMetallicRoughness":{{"roughnessFactor":0.2,
            "baseColorTexture":{{"index":0{others}}}}}}}]}}"#
        );
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, text).unwrap();
        let (surfaces, document) = surfaces(&path, None).unwrap();
        (surfaces.surface(0).alpha, document.notes.join("; "))
    };
    let scaled = r#","extensions":{"KHR_texture_transform":{"scale":[10,10]}}"#;
    let smooth = 0.2f32.powi(2);
    for (own, others) in [("", ""), (scaled, scaled)] {
        let (found, notes) = alpha(own, others);
        assert!(found > 1.5 * smooth && !notes.contains("normalTexture: ignored"), "{found} {notes}");
    }
    for (own, others) in [(scaled, ""), ("", scaled), (r#","texCoord":1"#, "")] {
        let (found, notes) = alpha(own, others);
        assert!((found - smooth).abs() < 1e-4 && notes.contains("normalTexture: ignored"), "{found} {notes}");
    }
}

#[test]
fn unlit_materials_are_matt_and_vertex_colours_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let text = |attribute: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_materials_unlit"],"accessors":[],"meshes":[
            {{"primitives":[{{"attributes":{{"{attribute}":0}},"material":0}}]}}],"materials":[{{
            "pbrMetallicRoughness":{{"baseColorFactor":[0.2,0.4,0.6,1],"roughnessFactor":0.1}},
            "extensions":{{"KHR_materials_unlit":{{}}}}}}]}}"#
        )
    };
    std::fs::write(&path, text("COLOR_0")).unwrap();
    let (read, document) = surfaces(&path, None).unwrap();
    close(read.surface(0), Surface { diffuse: [0.2, 0.4, 0.6], f0: [0.0; 3], alpha: 1.0 });
    let said = document.notes.join("\n");
    assert!(said.contains("printed matt") && said.contains("vertex colours (COLOR_0)"), "{said}");
    std::fs::write(&path, text("POSITION")).unwrap();
    assert!(!surfaces(&path, None).unwrap().1.notes.join("\n").contains("COLOR_0"));
}

#[test]
fn webp_pictures_are_read_where_the_file_names_them() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([200, 100, 50])).save(folder.path().join("a.webp")).unwrap();
    let path = folder.path().join("a.gltf");
    let text = r#"{"asset":{"version":"2.0"},"images":[{"uri":"a.webp"}],"textures":[{"extensions":{
        "EXT_texture_webp":{"source":0}}}],"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}"#;
    std::fs::write(&path, text).unwrap();
    let linear = |v: f32| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
    let expected = metallic([200.0, 100.0, 50.0].map(linear), [0.04; 3], 1.0, 1.0);
    close(surfaces(&path, None).unwrap().0.surface(3), expected);
}
