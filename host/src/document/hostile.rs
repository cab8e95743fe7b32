//! Every reader against files nobody would send in good faith.
//!
//! Starting from a good file of each kind: cut short anywhere, bytes changed anywhere. Whatever comes, the answer is a
//! document or an error that names the file; a panic or an endless loop fails the test.

use std::path::{Path, PathBuf};

use proptest::prelude::*;

use super::*;
use crate::observe::Silent;

/// A file of one kind, and how to open it: the name within a folder, or the folder itself.
struct Kind {
    file: &'static str,
    bytes: Vec<u8>,
    whole_folder: bool,
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

fn kinds() -> Vec<Kind> {
    use image::ImageFormat::*;
    let picture = |file, format| Kind { file, bytes: encoded(format), whole_folder: true };
    let single = |file, bytes| Kind { file, bytes, whole_folder: false };
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    let json = br#"{"asset":{"version":"2.0"},"images":[{"bufferView":0,"mimeType":"image/png"}],"textures":[{"source":0}],"buffers":[{"byteLength":8}],"bufferViews":[{"buffer":0,"byteLength":8}],"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}"#;
    let mut text = json.to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    glb.extend((36 + text.len() as u32).to_le_bytes());
    glb.extend((text.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(&text);
    glb.extend(8u32.to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend([1u8; 8]);
    let mut merl: Vec<u8> = [3i32, 30, 4].iter().flat_map(|d| d.to_le_bytes()).collect();
    merl.extend((0..3 * 360).flat_map(|i| f64::from(i).to_le_bytes()));
    let bsdf = rgl::tests::tensor_file(&[
        ("theta_i", vec![2], vec![0.0, 1.5]),
        ("phi_i", vec![1], vec![0.0]),
        ("ndf", vec![2, 2], vec![1.0; 4]),
        ("sigma", vec![2, 2], vec![1.0; 4]),
        ("vndf", vec![1, 2, 2, 2], vec![1.0; 8]),
        ("rgb", vec![1, 2, 3, 2, 2], vec![0.5; 24]),
    ]);
    vec![
        picture("albedo.png", Png),
        picture("albedo.jpg", Jpeg),
        picture("albedo.tif", Tiff),
        picture("albedo.hdr", Hdr),
        picture("albedo.exr", OpenExr),
        Kind {
            file: "material.toml",
            bytes: b"size_mm = [10, 20]\ncolour_space = \"linear\"\n[maps]\nnormal = \"n.png\"\n".to_vec(),
            whole_folder: true,
        },
        Kind {
            file: "document.toml",
            bytes: b"format = 1\nname = \"a\"\nwidth = 2\nheight = 2\nsamples = 4\nbases = \"bases.csv\"\nmaps = [\"w.png\"]\n".to_vec(),
            whole_folder: true,
        },
        single("a.csv", b"theta_h_deg,r,g,b\n0,1,1,1\n45,0.5,0.5,0.5\n90,0,0,0\n".to_vec()),
        single("a.binary", merl),
        single("a.bsdf", bsdf),
        single("a.gltf", json.to_vec()),
        single("a.glb", glb),
    ]
}

/// Opens a file of some bytes; the answer must name the file, or be a document that can be read to its end.
fn survive(kind: &Kind, bytes: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    if kind.whole_folder {
        std::fs::write(folder.path().join("roughness.png"), encoded(image::ImageFormat::Png)).unwrap();
    }
    let file = folder.path().join(kind.file);
    std::fs::write(&file, bytes).unwrap();
    let spec: PathBuf = if kind.whole_folder { folder.path().into() } else { file };
    match open(spec.to_str().unwrap(), &Options::default(), &Silent) {
        Ok(document) => {
            let materials = document.materials();
            let mut row = vec![0.0; materials.space().columns()];
            for pixel in 0..(materials.width() * materials.height()).min(1000) {
                materials.reflectance(pixel, &mut row);
                assert!(row.iter().all(|v| v.is_finite() && *v >= 0.0), "{}", kind.file);
            }
        }
        Err(error) => {
            let text = error.to_string();
            let named = folder.path().file_name().is_some_and(|name| text.contains(&*name.to_string_lossy()));
            assert!(named, "{}: {text}", kind.file);
        }
    }
}

#[test]
fn the_good_files_are_good() {
    for kind in
        kinds().iter().filter(|kind| !kind.whole_folder && kind.file != "a.gltf" && kind.file != "a.glb")
    {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(kind.file);
        std::fs::write(&file, &kind.bytes).unwrap();
        open(file.to_str().unwrap(), &Options::default(), &Silent).unwrap();
    }
}

#[test]
fn files_cut_short_anywhere_are_answered() {
    for kind in kinds() {
        let step = (kind.bytes.len() / 60).max(1);
        for length in (0..kind.bytes.len()).step_by(step) {
            survive(&kind, &kind.bytes[..length]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn changed_bytes_are_answered(
        which in 0usize..12,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        near_start in any::<bool>(),
    ) {
        let kind = &kinds()[which];
        let mut bytes = kind.bytes.clone();
        // Headers hold the sizes: half of the damage goes there.
        let reach = if near_start { bytes.len().min(64) } else { bytes.len() };
        for (at, value) in changes {
            bytes[at.index(reach)] = value;
        }
        survive(kind, &bytes);
    }

    #[test]
    fn noise_under_any_name_is_answered(which in 0usize..12, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        survive(&kinds()[which], &bytes);
    }
}

#[test]
fn what_is_no_document_is_refused() {
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
