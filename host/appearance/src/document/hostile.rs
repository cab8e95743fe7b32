//! Every reader against damaged and malicious files.
//!
//! Each test starts from a good document and [damages](testing::damage) one of its files. Every result must be a document
//! or an error that names the file; a panic or an endless loop fails the test.

use std::path::Path;

use base64::Engine;
use proptest::prelude::*;

use super::*;
use crate::brdf::{Space, Table};
use crate::weights::{WeightMaps, quantise};
use observe::Silent;
use testing::damage::{damages, spoilt};

/// A good document: its files, the one to open (the folder if none), and the one to damage.
#[derive(Clone, Debug)]
struct Victim {
    files: Vec<(&'static str, Vec<u8>)>,
    opened: Option<&'static str>,
    damaged: &'static str,
}

fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 90]));
    let picture = image::DynamicImage::ImageRgb8(picture);
    match format {
        image::ImageFormat::OpenExr | image::ImageFormat::Hdr => {
            image::DynamicImage::ImageRgb32F(picture.to_rgb32f()).write_to(&mut bytes, format).unwrap();
        }
        _ => picture.write_to(&mut bytes, format).unwrap(),
    }
    bytes.into_inner()
}

/// A folder of maps whose base colour is one picture.
fn folder(picture: &'static str, format: image::ImageFormat) -> Victim {
    folder_of(picture, encoded(format))
}

/// A folder of maps whose base colour has these bytes.
fn folder_of(picture: &'static str, bytes: Vec<u8>) -> Victim {
    let grey = image::GrayImage::from_fn(9, 7, |x, y| image::Luma([(20 * x + y) as u8]));
    let mut roughness = std::io::Cursor::new(Vec::new());
    grey.write_to(&mut roughness, image::ImageFormat::Png).unwrap();
    let files = vec![
        (picture, bytes),
        ("roughness.png", roughness.into_inner()),
        ("nor.png", encoded(image::ImageFormat::Png)),
        (
            "material.toml",
            b"size_mm = [10, 20]\ncolour_space = \"linear\"\nmetallic = 0.5\n[maps]\nnormal = \"nor.png\"\n"
                .to_vec(),
        ),
    ];
    Victim { files, opened: None, damaged: picture }
}

/// A factored document as this program writes it.
fn factored(damaged: &'static str) -> Victim {
    let space = Space::half_angle(5);
    let mut bases = Table::new(space.columns());
    for basis in 0..2 {
        bases.push(&(0..space.columns()).map(|j| (basis * 7 + j) as f64 / 20.0).collect::<Vec<f64>>());
    }
    let mut data = vec![0; 4 * 3 * 2];
    for (pixel, weights) in data.chunks_exact_mut(2).enumerate() {
        quantise(&[pixel as f64, 11.0 - pixel as f64], weights);
    }
    let maps = WeightMaps::new(4, 3, 2, data).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("a.foil");
    foil::write(&crate::materials::Factored { space, bases, maps }, "a", Some((30.0, 20.0)), None, &path)
        .unwrap();
    let names = ["document.toml", "bases.csv", "weights-00.png", "weights-01.png"];
    let files = names.map(|name| (name, std::fs::read(path.join(name)).unwrap())).to_vec();
    Victim { files, opened: None, damaged }
}

fn gltf(image: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"images":[{image}],"textures":[{{"source":0}}],
        "buffers":[{{"byteLength":BYTES}}],"bufferViews":[{{"buffer":0,"byteLength":BYTES}}],
        "materials":[{{"name":"one","pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}},"metallicFactor":0.25,
        "roughnessFactor":0.5}},"normalTexture":{{"index":0,"scale":0.5}},"extensions":{{
        "KHR_materials_ior":{{"ior":1.4}}}}}}]}}"#
    )
}

fn glb() -> Vec<u8> {
    let png = encoded(image::ImageFormat::Png);
    let mut text =
        gltf(r#"{"bufferView":0,"mimeType":"image/png"}"#).replace("BYTES", &png.len().to_string());
    text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(4) - text.len()));
    let mut data = png;
    data.resize(data.len().next_multiple_of(4), 0);
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + text.len() as u32 + data.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_bytes()), (b"BIN\0", &data)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

fn mtlx() -> Vec<u8> {
    br#"<materialx version="1.38"><nodegraph name="g"><constant name="c" type="color3"><input name="value"
        type="color3" value="0.5, 0.25, 0.125"/></constant><output name="o" type="color3" nodename="c"/></nodegraph>
        <standard_surface name="s" type="surfaceshader"><input name="base_color" type="color3" nodegraph="g"/>
        <input name="coat" type="float" value="0.5"/></standard_surface><surfacematerial name="m" type="material">
        <input name="surfaceshader" nodename="s"/></surfacematerial></materialx>"#
        .to_vec()
}

/// A download: maps in a folder of a zip archive.
fn archive() -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    for name in ["textures/a_albedo.png", "textures/a_roughness.png", "readme.txt"] {
        writer.start_file(name, options).unwrap();
        let grey = image::GrayImage::from_pixel(3, 2, image::Luma([9]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        grey.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        std::io::Write::write_all(&mut writer, bytes.get_ref()).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn float_tiff() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let grey = image::ImageBuffer::from_fn(9, 7, |x, _| image::Rgb([x as f32 / 9.0, 0.25, 0.5]));
    image::DynamicImage::ImageRgb32F(grey).write_to(&mut bytes, image::ImageFormat::Tiff).unwrap();
    bytes.into_inner()
}

fn victims() -> Vec<Victim> {
    use image::ImageFormat::*;
    let single = |file, bytes| Victim { files: vec![(file, bytes)], opened: Some(file), damaged: file };
    let png = encoded(Png);
    let uri = base64::engine::general_purpose::STANDARD.encode(&png);
    let inline = gltf(&format!(r#"{{"uri":"data:image/png;base64,{uri}"}}"#)).replace("BYTES", "8");
    let outside = gltf(r#"{"uri":"map%20one.png"}"#).replace("BYTES", "8");
    let beside = |damaged| Victim {
        files: vec![("a.gltf", outside.clone().into_bytes()), ("map one.png", png.clone())],
        opened: Some("a.gltf"),
        damaged,
    };
    let mut merl: Vec<u8> = [3i32, 30, 4].iter().flat_map(|d| d.to_le_bytes()).collect();
    merl.extend((0..3 * 360).flat_map(|i| f64::from(i).to_le_bytes()));
    let gonio_lines: String =
        gonio::tests::table(|h, _| 0.1 + h).lines().take(120).map(|line| format!("{line}\n")).collect();
    let bsdf = rgl::tests::tensor_file(&[
        ("theta_i", vec![2], vec![0.0, 1.5]),
        ("phi_i", vec![1], vec![0.0]),
        ("ndf", vec![2, 2], vec![1.0; 4]),
        ("sigma", vec![2, 2], vec![1.0; 4]),
        ("vndf", vec![1, 2, 2, 2], vec![1.0; 8]),
        ("rgb", vec![1, 2, 3, 2, 2], vec![0.5; 24]),
    ]);
    vec![
        folder("albedo.png", Png),
        folder("albedo.jpg", Jpeg),
        folder("albedo.tif", Tiff),
        folder("albedo.hdr", Hdr),
        folder("albedo.exr", OpenExr),
        folder("albedo.tga", Tga),
        folder("albedo.webp", WebP),
        Victim { damaged: "roughness.png", ..folder("albedo.png", Png) },
        Victim { damaged: "nor.png", ..folder("albedo.png", Png) },
        Victim { damaged: "material.toml", ..folder("albedo.png", Png) },
        factored("document.toml"),
        factored("bases.csv"),
        factored("weights-00.png"),
        single("a.csv", b"theta_h_deg,r,g,b\n0,1,1,1\n45,0.5,0.5,0.5\n90,0,0,0\n".to_vec()),
        single("a.binary", merl),
        single("a.bsdf", bsdf),
        single("a.brdf", gonio_lines.into_bytes()),
        single("inline.gltf", inline.into_bytes()),
        beside("a.gltf"),
        beside("map one.png"),
        single("a.glb", glb()),
        single("a.mtlx", mtlx()),
        single("a.zip", archive()),
        folder_of("albedo.tif", float_tiff()),
    ]
}

impl Victim {
    fn bytes(&self) -> &[u8] {
        let (_, bytes) = self.files.iter().find(|(name, _)| *name == self.damaged).unwrap();
        bytes
    }

    /// Writes the files to a folder, one of them with other bytes, and opens the document.
    fn open_with(&self, folder: &Path, bytes: &[u8]) -> Result<Document, DocumentError> {
        for (name, good) in &self.files {
            let bytes = if *name == self.damaged { bytes } else { good };
            std::fs::write(folder.join(name), bytes).unwrap();
        }
        let spec = self.opened.map_or_else(|| folder.to_path_buf(), |name| folder.join(name));
        open(spec.to_str().unwrap(), &Options::default(), &Silent)
    }

    /// The result must be a document that can be read to its end, or an error that names the file.
    fn survive(&self, bytes: &[u8]) {
        let folder = tempfile::tempdir().unwrap();
        match self.open_with(folder.path(), bytes) {
            Ok(document) => {
                let materials = document.materials();
                let mut row = vec![0.0; materials.space().columns()];
                for pixel in 0..(materials.width() * materials.height()).min(1000) {
                    materials.reflectance(pixel, &mut row);
                    assert!(row.iter().all(|v| v.is_finite() && *v >= 0.0), "{}", self.damaged);
                }
            }
            Err(error) => {
                let text = error.to_string();
                let folder = folder.path().file_name().unwrap().to_string_lossy();
                assert!(text.contains(&*folder), "{}: {text}", self.damaged);
            }
        }
    }
}

#[test]
fn the_good_files_are_good() {
    for victim in victims() {
        let folder = tempfile::tempdir().unwrap();
        if let Err(error) = victim.open_with(folder.path(), victim.bytes()) {
            panic!("{}: {error}", victim.damaged);
        }
    }
}

#[test]
fn truncated_files_give_errors() {
    for victim in victims() {
        let bytes = victim.bytes();
        let step = (bytes.len() / 60).max(1);
        for length in (0..bytes.len()).step_by(step) {
            victim.survive(&bytes[..length]);
        }
    }
}

proptest! {
    #![proptest_config(testing::cases(1000))]
    #[test]
    fn damaged_files_give_documents_or_errors(
        which in prop::sample::select(victims()).no_shrink(),
        damages in damages(),
    ) {
        which.survive(&spoilt(which.damaged, which.bytes(), &damages));
    }

    #[test]
    fn noise_under_any_name_gives_documents_or_errors(
        which in prop::sample::select(victims()).no_shrink(),
        bytes in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        which.survive(&bytes);
    }
}

#[test]
fn other_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("letter.txt"), "Dear printer").unwrap();
    let error =
        |path: &Path| open(path.to_str().unwrap(), &Options::default(), &Silent).unwrap_err().to_string();
    assert!(error(&path("letter.txt")).contains("letter.txt"));
    assert!(error(&path("missing")).contains("missing"));
    assert!(error(folder.path()).contains("no base colour map"));
    let options = Options { samples: 0, ..Options::default() };
    assert!(open("sample:leaf", &options, &Silent).unwrap_err().to_string().contains("0 samples"));
}
