//! Files as modellers write them, and every way not to be one.

use std::path::Path;

use crate::document::{Content, Document, Options, open};
use crate::materials::{Surface, Surfaces, metallic};
use observe::Silent;

fn read(folder: &Path, text: &str, material: Option<&str>) -> Result<(Surfaces, Document), String> {
    let path = folder.join("m.mtl");
    std::fs::write(&path, text).unwrap();
    let options = Options { material: material.map(Into::into), ..Options::default() };
    let document = open(path.to_str().unwrap(), &options, &Silent).map_err(|error| error.to_string())?;
    let Content::Surfaces(surfaces) = &document.content else { panic!("MTL gives surfaces") };
    Ok((surfaces.clone(), document))
}

fn close(a: Surface, b: Surface) {
    let values = |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
    for (x, y) in values(a).into_iter().zip(values(b)) {
        assert!((x - y).abs() < 3e-4, "{a:?} {b:?}");
    }
}

#[test]
fn numbers_pictures_and_exponents_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, value: [u8; 3]| {
        image::RgbImage::from_pixel(2, 2, image::Rgb(value)).save(folder.path().join(name)).unwrap();
    };
    std::fs::create_dir(folder.path().join("tex")).unwrap();
    picture("tex/c 1.png", [200, 100, 50]);
    picture("r.png", [102; 3]);
    let text = "# Made by hand\nnewmtl gold\nKd .5 .4 .3\nPm 1\nPr 0.3\nKe 1 1 1\n\nnewmtl skin\nKd 1 1 1\n\
        map_Kd -s 2 2 2 -o 0.5 tex\\c 1.png\nmap_Pr -bm 1.5 r.png\n";
    let (surfaces, document) = read(folder.path(), text, Some("gold")).unwrap();
    close(surfaces.surface(0), metallic([0.5, 0.4, 0.3], [0.04; 3], 0.3, 1.0));
    assert!(document.notes.iter().any(|note| note.contains("Ke")), "{:?}", document.notes);
    let (surfaces, _) = read(folder.path(), text, Some("1")).unwrap();
    let srgb = |v: f32| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
    close(surfaces.surface(2), metallic([srgb(200.0), srgb(100.0), srgb(50.0)], [0.04; 3], 0.4, 0.0));
    let (surfaces, document) = read(folder.path(), "newmtl a\nKd 0.2 0.2 0.2\nNs 998\n", None).unwrap();
    let roughness = (2.0f32 / 1000.0).sqrt().sqrt();
    close(surfaces.surface(0), metallic([0.2; 3], [0.04; 3], roughness, 0.0));
    assert!(document.notes.iter().any(|note| note.contains("Ns 998")), "{:?}", document.notes);
}

#[test]
fn wrong_files_are_errors_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |text: &str, says: &[&str]| {
        let error = read(folder.path(), text, None).err().unwrap();
        assert!(says.iter().all(|word| error.contains(word)), "{error}");
    };
    fails("Kd 1 1 1\n", &["no material"]);
    fails("newmtl a\nKd red\n", &["line 2", "`red`"]);
    fails("newmtl a\nPr nan\n", &["line 2", "`nan`"]);
    fails("newmtl a\nmap_Kd ../x.png\n", &["line 2", "folder"]);
    fails("newmtl a\nmap_Kd -s 1\n", &["line 2"]);
    fails("newmtl a\nmap_Kd gone.png\n", &["gone.png"]);
    fails("newmtl a\nnewmtl b\n", &["2 materials", "0 (a)"]);
}
