//! Downloads, and archives that no one packs by accident.

use std::io::{Cursor, Write as _};
use std::path::Path;
use std::sync::Arc;

use files::shelf::Memory;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::document::{Document, Options, open};
use observe::Silent;

fn png(value: u8) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image::GrayImage::from_pixel(2, 2, image::Luma([value]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

fn maps(folder: &str) -> Vec<(String, Vec<u8>)> {
    [("Color", 200), ("Roughness", 60), ("Metalness", 255)]
        .map(|(role, value)| (format!("{folder}Metal032_1K_{role}.png"), png(value)))
        .to_vec()
}

fn zipped(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (i, (name, bytes)) in files.iter().enumerate() {
        let method = if i % 2 == 0 { CompressionMethod::Deflated } else { CompressionMethod::Stored };
        writer.start_file(name.as_str(), SimpleFileOptions::default().compression_method(method)).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn opened(path: &Path) -> Result<Document, String> {
    open(path.to_str().unwrap(), &Options::default(), &Silent).map_err(|error| error.to_string())
}

fn row(document: &Document) -> Vec<f32> {
    let mut row = vec![0.0; document.materials().space().columns()];
    document.materials().reflectance(3, &mut row);
    row
}

#[test]
fn an_archive_is_the_folder_that_it_holds_wherever_the_maps_are() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("plain");
    std::fs::create_dir(&folder).unwrap();
    for (name, bytes) in maps("") {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let plain = opened(&folder).unwrap();
    for below in ["", "textures/", "Metal 032/textures/"] {
        let mut files = maps(below);
        files.push(("scene.blend".into(), b"BLENDER".to_vec()));
        files.push(("__MACOSX/._Metal032_1K_Color.png".into(), b"\0\x05\x16\x07".to_vec()));
        let path = outer.path().join("metal.zip");
        std::fs::write(&path, zipped(&files)).unwrap();
        let found = opened(&path).unwrap();
        assert_eq!(
            (row(&found), &found.digest, &found.name[..]),
            (row(&plain), &plain.digest, "metal"),
            "{below}"
        );
        // The same, unpacked.
        let unpacked = outer.path().join("unpacked");
        for (name, bytes) in &files {
            let at = unpacked.join(name);
            std::fs::create_dir_all(at.parent().unwrap()).unwrap();
            std::fs::write(at, bytes).unwrap();
        }
        let found = opened(&unpacked).unwrap();
        assert_eq!((row(&found), &found.digest, &found.name[..]), (row(&plain), &plain.digest, "unpacked"));
        let said = found.notes.join("\n");
        assert_eq!(said.contains("the material is read from"), !below.is_empty(), "{said}");
        std::fs::remove_dir_all(unpacked).unwrap();
    }
}

#[test]
fn several_materials_in_one_download_are_a_choice() {
    let outer = tempfile::tempdir().unwrap();
    let path = outer.path().join("both.zip");
    std::fs::write(&path, zipped(&[maps("gold/"), maps("tin/")].concat())).unwrap();
    let error = opened(&path).unwrap_err();
    assert!(error.contains("both.zip") && error.contains("gold, tin"), "{error}");
}

#[test]
fn a_scene_in_an_archive_finds_its_pictures_there() {
    let outer = tempfile::tempdir().unwrap();
    let scene = br#"{"asset":{"version":"2.0"},"images":[{"uri":"textures/a.png"}],"textures":[{"source":0}],
        "materials":[{"name":"tin","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}"#;
    let path = outer.path().join("scene.zip");
    std::fs::write(&path, zipped(&[("s.gltf".into(), scene.to_vec()), ("textures/a.png".into(), png(99))]))
        .unwrap();
    let found = opened(&path).unwrap();
    assert_eq!((&found.name[..], found.materials().width()), ("tin", 2));
}

#[test]
fn archives_with_bad_intent_are_errors() {
    let outer = tempfile::tempdir().unwrap();
    let path = outer.path().join("bad.zip");
    let error = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        opened(&path).unwrap_err()
    };
    for name in ["../x_color.png", "/x_color.png", "C:x_color.png", "a/../../x_color.png"] {
        let said = error(&zipped(&[(name.into(), png(0))]));
        assert!(said.contains("bad.zip") && said.contains("lies outside"), "{name}: {said}");
    }
    // A name of the same length, so that only the names change.
    let twice = zipped(&[("a_color.png".into(), png(0)), ("b_color.png".into(), png(1))]);
    let mut same = twice.clone();
    let places: Vec<usize> =
        (0..twice.len() - 11).filter(|&i| twice[i..].starts_with(b"b_color.png")).collect();
    assert_eq!(places.len(), 2);
    places.iter().for_each(|&at| same[at] = b'a');
    assert!(error(&same).contains("share a name"), "{}", error(&same));
    // The table of contents says that there are 50000 files, and the archive none of it.
    let mut many = twice.clone();
    let end = many.windows(4).rposition(|w| w == b"PK\x05\x06").unwrap();
    many[end + 8..end + 12].copy_from_slice(&[0x50, 0xc3, 0x50, 0xc3]);
    let said = error(&many);
    assert!(said.contains("number of files is 50000; the limit is 10000"), "{said}");
    let said = error(&twice[..twice.len() / 2]);
    assert!(said.contains("bad.zip"), "{said}");
}

/// A file of zeros that is far larger than it seems, and one whose header states a size that is not its own.
#[test]
fn what_comes_out_is_limited_whatever_the_header_says() {
    let outer = tempfile::tempdir().unwrap();
    let path = outer.path().join("bomb.zip");
    let files = [("a_color.png".into(), png(9)), ("material.toml".into(), vec![b' '; 3 << 20])];
    std::fs::write(&path, zipped(&files)).unwrap();
    let said = opened(&path).unwrap_err();
    assert!(said.contains("material.toml") && said.contains("the limit is 1048576"), "{said}");
}

#[test]
fn documents_in_memory_are_those_on_disk_and_say_what_they_lack() {
    let outer = tempfile::tempdir().unwrap();
    let mut memory = Memory::default();
    let mut put = |name: &str, bytes: &[u8]| {
        let path = outer.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        memory.insert(path, bytes).unwrap();
    };
    maps("metal.v2/").iter().for_each(|(name, bytes)| put(name, bytes));
    put("metal.zip", &zipped(&maps("textures/")));
    let scene = |uri: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"{uri}"}}],"textures":[{{"source":0}}],"materials":[{{"name":"a",
            "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}]}}"#
        )
    };
    put("whole.gltf", scene("metal.v2/Metal032_1K_Color.png").as_bytes());
    put("rust.gltf", scene("rust.png").as_bytes());
    put("out.gltf", scene("../rust.png").as_bytes());
    let spec = |name: &str| outer.path().join(name).to_str().unwrap().to_owned();
    let names = ["metal.v2", "metal.zip", "whole.gltf"];
    let on_disk = names.map(|name| opened(Path::new(&spec(name))).unwrap());
    let options = Options { shelf: Arc::new(memory), ..Options::default() };
    let specs = names.map(spec);
    let wanting = ["rust.gltf", "out.gltf"].map(spec);
    // What is in memory alone needs no disk.
    drop(outer);
    for (disk, spec) in on_disk.iter().zip(&specs) {
        let found = open(spec, &options, &Silent).unwrap();
        assert_eq!((&found.name, &found.digest), (&disk.name, &disk.digest));
        assert_eq!((&found.notes, row(&found)), (&disk.notes, row(disk)));
    }
    assert_eq!((&*on_disk[0].name, &*on_disk[1].name), ("metal.v2", "metal"));
    let errors = wanting.map(|spec| observe::with_causes(&open(&spec, &options, &Silent).unwrap_err()));
    assert!(errors[0].contains("rust.png: cannot open: "), "{}", errors[0]);
    assert!(errors[1].contains("`../rust.png` must be a file in the document's folder"), "{}", errors[1]);
}
