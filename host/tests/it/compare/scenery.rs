//! What is compared: a document, its job, photographs of its print, and the camera file.

use std::fs;
use std::path::Path;

use testing::program::Bench;

use super::camera::{Sheet, Shot, photograph};

/// The document with the options that it is printed with.
pub const PRINT: &str = "tile --size 60x40mm --paper postcard --camera-marks -q";

/// Where the lamps stood, and nothing else.
pub const CAMERA: &str = "format = 1\n[[light]]\nphotos = \"left\"\nposition_mm = [-190, 150, 330]\n\
    [[light]]\nphotos = \"right\"\nposition_mm = [260, -60, 420]\n";

/// Red paint beside silver, and a disc of gold on both.
pub fn three_materials(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let maps: [(&str, [[u8; 3]; 3]); 3] = [
        ("base_color.png", [[180, 30, 25], [200, 200, 205], [200, 160, 80]]),
        ("roughness.png", [[90; 3], [130; 3], [120; 3]]),
        ("metallic.png", [[0; 3], [255; 3], [255; 3]]),
    ];
    for (name, values) in maps {
        let picture = image::RgbImage::from_fn(240, 160, |x, y| {
            let disc = (f64::from(x) - 119.5).hypot(f64::from(y) - 79.5) < 45.0;
            image::Rgb(values[if disc { 2 } else { usize::from(x >= 120) }])
        });
        picture.save(folder.join(name)).unwrap();
    }
}

/// Puts all of it into a bench: `tile`, its job and the steps to it, `photos`, `camera.toml`.
pub fn photographed(bench: &Bench, shots: &[Shot]) {
    three_materials(&bench.path("tile"));
    for step in [
        "factor tile -q -o tile.foil",
        "map tile.foil -q --document tile -o tile.mix",
        "halftone tile.mix -q --size 60x40mm -o tile.dots",
        "layout tile.dots -q --paper postcard --camera-marks -o tile.sheet",
        "separate tile.sheet -q -o tile.passes",
        "encode tile.passes -q -o job.rgl",
    ] {
        bench.done(step);
    }
    let sheet = Sheet::load(&bench.path("tile.sheet"));
    fs::create_dir(bench.path("photos")).unwrap();
    for shot in shots {
        photograph(&sheet, shot, shot.exposure, true).save(bench.path("photos").join(shot.name)).unwrap();
    }
    fs::write(bench.path("camera.toml"), CAMERA).unwrap();
}
