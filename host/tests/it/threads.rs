//! Equal results for any number of threads: whole prints, compared file by file and byte by byte.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use testing::program::Bench;

/// Every file of a folder and its folders, by its name within it.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for name in testing::program::entries(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            found.insert(name, fs::read(path).unwrap());
        }
    }
    found
}

/// Three materials that run into each other, with noise: no two pixels alike, so that nothing is too little to be shared out.
fn document(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let noise = |x: u32, y: u32, salt: u32| {
        let v = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ salt).wrapping_mul(0xC2B2_AE3D);
        (v >> 27) as u8
    };
    let picture =
        |rgb: &dyn Fn(u32, u32) -> [u8; 3]| image::RgbImage::from_fn(40, 240, |x, y| image::Rgb(rgb(x, y)));
    let maps: [(&str, image::RgbImage); 3] = [
        ("base_color.png", picture(&|x, y| [60 + (y / 2) as u8, 40 + 2 * x as u8, 50 + noise(x, y, 1)])),
        ("roughness.png", picture(&|x, y| [90 + noise(x, y, 2) + x as u8; 3])),
        ("metallic.png", picture(&|x, y| [if (x + y) % 140 < 70 { 0 } else { 215 + noise(x, y, 3) }; 3])),
    ];
    for (name, map) in maps {
        map.save(folder.join(name)).unwrap();
    }
}

/// The command with so many threads, into a folder that is read and removed.
fn with_threads(bench: &Bench, threads: u32, args: &str) -> BTreeMap<String, Vec<u8>> {
    let mut command = bench.command(&format!("{args} -q -o out.print"));
    let output = command.env("RAYON_NUM_THREADS", threads.to_string()).output().unwrap();
    assert!(output.status.success(), "{args}: {}", testing::program::text(&output.stderr));
    let written = files(&bench.path("out.print"));
    fs::remove_dir_all(bench.path("out.print")).unwrap();
    written
}

fn the_same_with_one_thread_and_with_three(bench: &Bench, args: &str) {
    let one = with_threads(bench, 1, args);
    let three = with_threads(bench, 3, args);
    assert!(one.contains_key("job.rgl") && one.contains_key("preview.png"), "{:?}", one.keys());
    assert!(one.keys().eq(three.keys()));
    let differ: Vec<_> = one.iter().filter(|(name, bytes)| three[*name] != **bytes).map(|(n, _)| n).collect();
    assert!(differ.is_empty(), "{args}: {differ:?} depend on the number of threads");
}

#[test]
fn a_document_is_printed_and_shown_the_same_with_any_number_of_threads() {
    let bench = Bench::new();
    document(&bench.path("tile"));
    // The blend clamps too. Long enough for two strips of the halftone.
    let args = "print tile --size 15x90mm --bases 4 --intent blend --inks all";
    the_same_with_one_thread_and_with_three(&bench, args);
}

#[test]
fn a_picture_in_process_inks_is_printed_the_same_with_any_number_of_threads() {
    let bench = Bench::new();
    document(&bench.path("tile"));
    fs::rename(bench.path("tile/base_color.png"), bench.path("photo.png")).unwrap();
    the_same_with_one_thread_and_with_three(&bench, "layers photo.png --size 15x90mm");
}
