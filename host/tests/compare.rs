//! Photographs of a print beside its prediction, by the program, as its users do.
//!
//! The photographs are made here by a pinhole camera with a bent lens that shares nothing with the program's solver or renderer: a
//! ray for each part of a pixel, the dot it meets, that stack's curve, the inverse square of the lamp's distance. One stack is brighter on
//! paper than the library says. Exposure, white balance, lens and poses are not told to the program; noise is that of a
//! 12-bit sensor.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use appearance::brdf::{Space, reflectances};
use appearance::document;
use inks::{Curve, Library};
use observe::Silent;
use press::layout::Arranged;
use rayon::prelude::*;
use serde_json::Value;
use testing::program::Bench;

type V = [f64; 3];
/// A photograph of 16 bits.
type Picture = image::ImageBuffer<image::Rgb<u16>, Vec<u16>>;

const SIZE: (usize, usize) = (1200, 900);
const FOCAL: f64 = 2300.0;
const RADIAL: [f64; 2] = [-0.14, 0.03];
const DOTS_PER_MM: f64 = 600.0 / 25.4;
const PRINT: &str = "tile --size 60x40mm --paper postcard --camera-marks -q";
/// On paper the inks' strongest stack is brighter than in the library.
const BRIGHTER: V = [1.3, 1.25, 1.35];

fn dot(a: V, b: V) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: V) -> V {
    a.map(|v| v / dot(a, a).sqrt())
}

/// Where a camera stood, what it looked at, how it was turned, and the lamp that was on.
struct Shot {
    name: &'static str,
    eye: V,
    target: V,
    roll: f64,
    lamp: V,
    exposure: f64,
}

const LEFT: V = [-190.0, 150.0, 330.0];
const RIGHT: V = [260.0, -60.0, 420.0];
const SHOTS: [Shot; 4] = [
    Shot {
        name: "left-1.png",
        eye: [10.0, -15.0, 265.0],
        target: [0.0, 1.0, 0.0],
        roll: 0.03,
        lamp: LEFT,
        exposure: 0.8,
    },
    Shot {
        name: "left-2.png",
        eye: [120.0, 60.0, 235.0],
        target: [-2.0, 0.0, 0.0],
        roll: -0.2,
        lamp: LEFT,
        exposure: 0.5,
    },
    Shot {
        name: "right-1.png",
        eye: [-60.0, 130.0, 230.0],
        target: [0.0, 0.0, 0.0],
        roll: 0.1,
        lamp: RIGHT,
        exposure: 0.7,
    },
    Shot {
        name: "right-2.png",
        eye: [-110.0, -70.0, 225.0],
        target: [1.0, 1.0, 0.0],
        roll: 1.5,
        lamp: RIGHT,
        exposure: 0.9,
    },
];
/// The sensor's response to the three channels.
const WHITE: V = [1.5, 1.0, 1.25];

impl Shot {
    /// The camera's axes right, down and forward.
    fn axes(&self) -> [V; 3] {
        let forward = unit(minus(self.target, self.eye));
        let right = unit(cross(forward, [0.0, 1.0, 0.0]));
        let down = cross(forward, right);
        let (s, c) = self.roll.sin_cos();
        let turned = |a: V, ka: f64, b: V, kb: f64| -> V { std::array::from_fn(|i| ka * a[i] + kb * b[i]) };
        [turned(right, c, down, s), turned(down, c, right, -s), forward]
    }

    /// The lens moves a place at r to r (1 + k1 r^2 + k2 r^4); Newton's method finds r. What a pixel's middle is to be multiplied by;
    /// within a pixel it is even.
    fn bent(pixel: [f64; 2]) -> f64 {
        let [x, y] = seen(pixel);
        let far = x.hypot(y);
        let mut r = far;
        for _ in 0..5 {
            let r2 = r * r;
            let bent = r * (1.0 + RADIAL[0] * r2 + RADIAL[1] * r2 * r2) - far;
            r -= bent / (1.0 + 3.0 * RADIAL[0] * r2 + 5.0 * RADIAL[1] * r2 * r2);
        }
        if far > 0.0 { r / far } else { 1.0 }
    }

    /// The place on the sheet in mm that is seen at a place of the picture.
    fn place(&self, axes: &[V; 3], at: [f64; 2], by: f64) -> [f64; 2] {
        let [x, y] = seen(at);
        let way: V = std::array::from_fn(|c| axes[2][c] + by * (x * axes[0][c] + y * axes[1][c]));
        let t = -self.eye[2] / way[2];
        [self.eye[0] + t * way[0], self.eye[1] + t * way[1]]
    }

    /// The places in mm whose pixels are full, or nearly: sensors bend the last values.
    fn full(&self, picture: &Picture) -> Vec<[f64; 2]> {
        let axes = self.axes();
        let full = picture
            .enumerate_pixels()
            .filter(|(_, _, p)| p.0.iter().any(|v| f64::from(*v) > 0.97 * 65_535.0));
        full.map(|(x, y, _)| [f64::from(x) + 0.5, f64::from(y) + 0.5])
            .map(|pixel| self.place(&axes, pixel, Shot::bent(pixel)))
            .collect()
    }
}

/// Pixels from the picture's corner as tangents of the angles from its middle.
fn seen([x, y]: [f64; 2]) -> [f64; 2] {
    [(x - SIZE.0 as f64 / 2.0) / FOCAL, (y - SIZE.1 as f64 / 2.0) / FOCAL]
}

/// A curve by its values at even steps of the angle.
struct Steps(Vec<V>);

impl Steps {
    fn new(curve: &Curve, factor: V) -> Steps {
        let value = |i: usize| -> V {
            let f = curve.at(i as f64 / 4096.0 * 1.6);
            std::array::from_fn(|c| f[c] * factor[c])
        };
        Steps((0..=4096).map(value).collect())
    }

    fn at(&self, theta: f64) -> V {
        let at = (theta / 1.6 * 4096.0).clamp(0.0, 4095.999);
        let (a, b, t) = (self.0[at as usize], self.0[at as usize + 1], at.fract());
        std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
    }
}

/// The sheet as it lies on the table: dots, and a curve for each stack.
struct Sheet {
    page: Arranged,
    curves: Vec<Steps>,
    /// The stack that is brighter.
    bright: usize,
    library: Vec<Steps>,
}

impl Sheet {
    fn load(folder: &Path) -> Sheet {
        let page = Arranged::load(folder).unwrap();
        let library = Library::builtin();
        let space = Space::half_angle(512);
        let plain: Vec<Curve> =
            reflectances(page.sheet.stacks(), &library, &space).rows().map(|row| space.curve(row)).collect();
        let census = page.laid.census(&page.sheet);
        let bright = (1..plain.len()).max_by_key(|&i| census[i]).unwrap();
        let factor = |i: usize| if i == bright { BRIGHTER } else { [1.0; 3] };
        let curves = plain.iter().enumerate().map(|(i, curve)| Steps::new(curve, factor(i))).collect();
        let library = plain.iter().map(|curve| Steps::new(curve, [1.0; 3])).collect();
        Sheet { page, curves, bright, library }
    }

    /// The middle of the print in dots: that of its marks, which stand alike above and below.
    fn middle(&self) -> [f64; 2] {
        let copy = self.page.laid.copies[0];
        [copy.left as f64 + copy.width as f64 / 2.0, copy.top as f64 + copy.length as f64 / 2.0]
    }

    /// The stack at a place in mm; nothing beyond the paper.
    fn stack(&self, x: f64, y: f64) -> Option<usize> {
        let [mx, my] = self.middle();
        let (i, j) = ((mx + x * DOTS_PER_MM).floor(), (my - y * DOTS_PER_MM).floor());
        let (width, length) = (self.page.sheet.width() as f64, self.page.sheet.length() as f64);
        let margin = 4.0 * DOTS_PER_MM;
        if i < -margin || j < -margin || i >= width + margin || j >= length + margin {
            return None;
        }
        if i < 0.0 || j < 0.0 || i >= width || j >= length {
            return Some(0);
        }
        Some(usize::from(self.page.sheet.index()[j as usize * self.page.sheet.width() + i as usize]))
    }
}

/// Half angle, and irradiance relative to that of a surface that faces the lamp in the middle of the sheet.
fn lit(place: [f64; 2], eye: V, lamp: V) -> (f64, f64) {
    let p = [place[0], place[1], 0.0];
    let (to, away) = (minus(lamp, p), minus(eye, p));
    let (l, v) = (unit(to), unit(away));
    let h = unit(std::array::from_fn(|i| l[i] + v[i]));
    (h[2].clamp(-1.0, 1.0).acos(), l[2] * dot(lamp, lamp) / dot(to, to))
}

/// A photograph: RGB of 12 bits in 16.
fn photograph(sheet: &Sheet, shot: &Shot, exposure: f64, noise: bool) -> Picture {
    let axes = shot.axes();
    let (width, height) = SIZE;
    let values: Vec<u16> = (0..height)
        .into_par_iter()
        .flat_map_iter(|j| {
            let mut state =
                0x9e37_79b9_7f4a_7c15u64.wrapping_mul(j as u64 + 1 + 7919 * shot.name.len() as u64);
            let mut row = Vec::with_capacity(3 * width);
            for i in 0..width {
                let pixel = [i as f64 + 0.5, j as f64 + 0.5];
                let by = Shot::bent(pixel);
                let (theta, irradiance) = lit(shot.place(&axes, pixel, by), shot.eye, shot.lamp);
                let mut sum = [0.0; 3];
                for k in 0..9 {
                    let part = |k: u32| f64::from(k) / 3.0 + 1.0 / 6.0;
                    let [x, y] = shot.place(&axes, [i as f64 + part(k % 3), j as f64 + part(k / 3)], by);
                    let f = sheet.stack(x, y).map_or([0.03 / PI; 3], |stack| sheet.curves[stack].at(theta));
                    (0..3).for_each(|c| sum[c] += f[c] * irradiance / 9.0);
                }
                for c in 0..3 {
                    // White paper is about 0.85 / pi.
                    let signal = 4095.0 * 2.2 * sum[c] * exposure * WHITE[c] / 1.5;
                    let mut normal = -6.0;
                    for _ in 0..12 {
                        state = state
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        normal += (state >> 11) as f64 / (1u64 << 53) as f64;
                    }
                    let seen =
                        if noise { signal + normal * (0.25 * signal.max(0.0) + 4.0).sqrt() } else { signal };
                    row.push(seen.round().clamp(0.0, 4095.0) as u16 * 16);
                }
            }
            row
        })
        .collect();
    image::ImageBuffer::from_raw(width as u32, height as u32, values).unwrap()
}

/// A full pixel spoils what is read between it and the next, in mm.
const REACH: f64 = 0.11;

const CAMERA: &str = "format = 1\n[[light]]\nphotos = \"left\"\nposition_mm = [-190, 150, 330]\n\
    [[light]]\nphotos = \"right\"\nposition_mm = [260, -60, 420]\n";

/// A folder with a document, its job, photographs of its print and the camera file; made once.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<(Bench, PathBuf)> = OnceLock::new();
    let (_, folder) = FOLDER.get_or_init(|| {
        let bench = Bench::new();
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
        for shot in &SHOTS {
            photograph(&sheet, shot, shot.exposure, true).save(bench.path("photos").join(shot.name)).unwrap();
        }
        fs::write(bench.path("camera.toml"), CAMERA).unwrap();
        let folder = bench.path("");
        (bench, folder)
    });
    folder
}

/// Red paint beside silver, and a disc of gold on both.
fn three_materials(folder: &Path) {
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

/// A bench with copies of what the shared folder has.
fn bench(photos: &[&str]) -> Bench {
    let (bench, from) = (Bench::new(), folder());
    three_materials(&bench.path("tile"));
    for name in ["job.rgl", "camera.toml"] {
        fs::copy(from.join(name), bench.path(name)).unwrap();
    }
    for (name, size) in [("tile.dots", "60x40mm"), ("other.dots", "50x30mm")] {
        bench.done(&format!("halftone {} -q --size {size} -o {name}", from.join("tile.mix").display()));
    }
    fs::create_dir(bench.path("photos")).unwrap();
    for name in photos {
        fs::copy(from.join("photos").join(name), bench.path("photos").join(name)).unwrap();
    }
    bench
}

fn names() -> Vec<&'static str> {
    SHOTS.iter().map(|shot| shot.name).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn vector(value: &Value) -> V {
    std::array::from_fn(|i| number(&value[i]))
}

/// Mean light of the photograph as it would be without camera, of the prediction and of the document, over squares of the
/// document's copy that no full pixel of the photograph touches.
struct Truth {
    squares: usize,
    photo: Vec<V>,
    print: Vec<V>,
    document: Vec<V>,
}

impl Truth {
    fn new(sheet: &Sheet, shot: &Shot, picture: &Picture, tile: &Path) -> Truth {
        let options = document::Options { material: None, colour_space: None, samples: document::SAMPLES };
        let document = document::open(tile.to_str().unwrap(), &options, &Silent).unwrap();
        let materials = document.materials();
        let space = materials.space();
        // Few pixels differ.
        let (mut rows, mut curves, mut curve_of) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..materials.width() * materials.height() {
            let mut row = vec![0.0f32; space.columns()];
            materials.reflectance(pixel, &mut row);
            let known = rows.iter().position(|known| *known == row).unwrap_or_else(|| {
                let curve = space.curve(&row.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
                curves.push(Steps::new(&curve, [1.0; 3]));
                rows.push(row);
                rows.len() - 1
            });
            curve_of.push(known);
        }
        let copy = sheet.page.laid.copies[0];
        let (across, down) = (60usize, 40usize);
        let mut squares =
            Truth { squares: across * down, photo: Vec::new(), print: Vec::new(), document: Vec::new() };
        let [mx, my] = sheet.middle();
        let (left, top) = ((copy.left as f64 - mx) / DOTS_PER_MM, (my - copy.top as f64) / DOTS_PER_MM);
        let full = shot.full(picture);
        let touched = |i: usize, j: usize| {
            full.iter().any(|[x, y]| {
                let off = |at: f64, k: usize| (at - k as f64 - 0.5).abs() < 0.5 + REACH;
                off(x - left, i) && off(top - y, j)
            })
        };
        for j in 0..down {
            for i in (0..across).filter(|i| !touched(*i, j)) {
                let range = |k: usize, side: usize, count: usize| {
                    (k * side).div_ceil(count)..((k + 1) * side).div_ceil(count)
                };
                let mut sums = [[0.0; 3]; 3];
                let mut count = 0.0;
                for y in range(j, copy.length, down) {
                    for x in range(i, copy.width, across) {
                        let (dx, dy) = (copy.left + x, copy.top + y);
                        let place =
                            [(dx as f64 + 0.5 - mx) / DOTS_PER_MM, (my - dy as f64 - 0.5) / DOTS_PER_MM];
                        let (theta, irradiance) = lit(place, shot.eye, shot.lamp);
                        let stack = usize::from(sheet.page.sheet.index()[dy * sheet.page.sheet.width() + dx]);
                        let pixel = (y * materials.height() / copy.length) * materials.width()
                            + x * materials.width() / copy.width;
                        let curves = [&sheet.curves[stack], &sheet.library[stack], &curves[curve_of[pixel]]];
                        for (sum, curve) in sums.iter_mut().zip(curves) {
                            let f = curve.at(theta);
                            (0..3).for_each(|c| sum[c] += f[c] * irradiance);
                        }
                        count += 1.0;
                    }
                }
                let [photo, print, document] = sums.map(|sum| sum.map(|v| v / count));
                squares.photo.push(photo);
                squares.print.push(print);
                squares.document.push(document);
            }
        }
        squares
    }
}

fn rms(a: &[V], b: &[V]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| dot(minus(*a, *b), minus(*a, *b))).sum::<f64>() / (3 * a.len()) as f64)
        .sqrt()
}

fn size(a: &[V]) -> f64 {
    rms(a, &vec![[0.0; 3]; a.len()])
}

#[test]
fn poses_and_errors_are_the_true_ones() {
    let bench = bench(&names());
    let said = bench.done(&format!("compare photos {PRINT} --job job.rgl --camera camera.toml --json"));
    let report: Value = serde_json::from_str(&said).expect("JSON");
    let alone = bench.done("compare photos --job job.rgl --camera camera.toml -q --json -o alone.html");
    let alone: Value = serde_json::from_str(&alone).expect("JSON");
    let sheet = Sheet::load(&folder().join("tile.sheet"));
    println!(
        "focal length {:.1} of {FOCAL}, distortion {} of {RADIAL:?}, brighter stack {}",
        number(&report["lens"]["focal_px"]),
        report["lens"]["radial"],
        sheet.page.sheet.stacks()[sheet.bright]
    );
    let mut worst = 0.0f64;
    for (i, shot) in SHOTS.iter().enumerate() {
        let found = &report["photos"][i];
        assert_eq!(found["name"], shot.name);
        let off = minus(vector(&found["camera_mm"]), shot.eye);
        let trace: f64 = shot
            .axes()
            .iter()
            .enumerate()
            .map(|(k, axis)| dot(*axis, vector(&found["camera_axes"][k])))
            .sum();
        let turned = (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees();
        let picture = image::open(bench.path("photos").join(shot.name)).unwrap().into_rgb16();
        let truth = Truth::new(&sheet, shot, &picture, &bench.path("tile"));
        let errors = &found["errors"];
        let pairs = [
            ("total", number(&errors["total"]), rms(&truth.photo, &truth.document) / size(&truth.document)),
            ("print", number(&errors["print"]), rms(&truth.photo, &truth.print) / size(&truth.document)),
        ];
        println!(
            "{}: {:.3} mm off (states {:.3}), turned by {turned:.4} degrees, residual {:.3} px; {errors}",
            shot.name,
            dot(off, off).sqrt(),
            number(&found["camera_error_mm"]),
            number(&found["residual_px"])
        );
        assert!(dot(off, off).sqrt() < 0.5 && turned < 0.2, "{}: {off:?} {turned}", shot.name);
        for (name, found, truth) in pairs {
            println!("  {name}: {:.3} %, truly {:.3} %", 100.0 * found, 100.0 * truth);
            worst = worst.max((found / truth - 1.0).abs());
        }
        let seen = truth.photo.len() as f64 / truth.squares as f64;
        println!("  {:.1} % seen, truly {:.1} %", 100.0 * number(&found["seen"]), 100.0 * seen);
        assert!((number(&found["seen"]) - seen).abs() < 0.005, "{}", shot.name);
        // What differs is one stack, so it is the inks'.
        assert!(number(&errors["rest"]) < 0.25 * number(&errors["inks"]), "{errors}");
        let name = sheet.page.sheet.stacks()[sheet.bright].to_string();
        let factor =
            found["stacks"].as_array().unwrap().iter().find(|row| row["stack"] == name.as_str()).unwrap();
        let factor = vector(&factor["factor"]);
        println!("  {name}: {factor:?}, truly {BRIGHTER:?}");
        assert!((0..3).all(|c| (factor[c] / BRIGHTER[c] - 1.0).abs() < 0.05), "{factor:?}");
    }
    assert!(worst < 0.03, "figures are off by {worst}");
    // The highlight of the last photograph is full, so that squares are left out.
    assert!(number(&report["photos"][3]["seen"]) < 0.99);
    assert!(number(&report["photos"][0]["errors"]["gamut"]) > 0.0);
    // Alone, the window is all between the marks, and errors are from the print.
    assert_eq!(alone["document"], false);
    assert_eq!(alone["photos"][0]["errors"]["gamut"], Value::Null);
    let page = fs::read_to_string(bench.path("photos/compare.html")).unwrap();
    assert!(
        page.starts_with("<!doctype html>")
            && page.contains("left-1.png")
            && page.matches("data:image/jpeg").count() == 20
    );
    assert!(!page.contains("http://") && !page.contains("https://"));
    if let Some(keep) = std::env::var_os("FOILPRESS_KEEP") {
        fs::copy(bench.path("photos/compare.html"), Path::new(&keep).join("compare.html")).unwrap();
        fs::copy(bench.path("photos/left-2.png"), Path::new(&keep).join("left-2.png")).unwrap();
    }
}

#[test]
fn photographs_and_camera_files_that_do_not_serve_are_named() {
    let sheet = Sheet::load(&folder().join("tile.sheet"));
    let shot = &SHOTS[0];
    let compare = "compare photos --job job.rgl --camera camera.toml -q";
    let bench = bench(&[shot.name, SHOTS[1].name]);
    let photo = bench.path("photos").join(shot.name);
    let original = image::open(&photo).unwrap().into_rgb16();
    let put = |change: &dyn Fn(&mut Picture)| {
        let mut picture = original.clone();
        change(&mut picture);
        picture.save(&photo).unwrap();
    };
    let refused = |args: &str, words: &[&str]| {
        let said = bench.refused(1, args);
        assert!(words.iter().all(|words| said.contains(words)), "{said}");
        assert!(!bench.path("photos/compare.html").exists(), "half-written");
    };
    put(&|picture| picture.pixels_mut().for_each(|p| p.0 = [20_000; 3]));
    refused(compare, &[shot.name, "no camera marks were found"]);
    // A hand over the right half hides two marks.
    put(&|picture| {
        picture.enumerate_pixels_mut().filter(|(x, _, _)| *x > 600).for_each(|(_, _, p)| p.0 = [9000; 3]);
    });
    refused(compare, &[shot.name, "only 2 of the sheet's 4 camera marks"]);
    put(&|picture| *picture = image::imageops::crop_imm(picture, 10, 0, 1100, 900).to_image());
    refused(compare, &["1200 x 900 pixels, but left-1.png has 1100 x 900"]);
    photograph(&sheet, shot, 4.0, false).save(&photo).unwrap();
    refused(compare, &[shot.name, "clipped", "expose shorter"]);
    fs::write(&photo, "no picture").unwrap();
    refused(compare, &[shot.name, "not a readable photograph"]);
    put(&|_| ());

    // The same photographs with another sheet's job, and with one without marks.
    bench.done("layout tile.dots -q --paper postcard -o bare.sheet");
    bench.done("layout other.dots -q --paper postcard --camera-marks -o other.sheet");
    refused(
        "compare photos bare.sheet --camera camera.toml -q",
        &["the sheet has 0 camera marks", "--camera-marks"],
    );
    refused("compare photos other.sheet --camera camera.toml -q", &[shot.name, "those of another sheet"]);
    refused(
        "compare photos tile --size 50x30mm --paper postcard --job job.rgl --camera camera.toml -q",
        &["not the job of tile"],
    );
    refused("compare photos --camera camera.toml -q", &["say what was printed"]);
    refused("compare job.rgl --job job.rgl --camera camera.toml -q", &["not a folder"]);

    for (text, words) in [
        ("format = 1\n[[light]]\nposition_mm = [0, 0, -300]\n", "behind the sheet"),
        ("format = 1\n[[light]]\nposition_mm = [nan, 0, 300]\n", "not a place"),
        (
            "format = 1\n[camera]\nposition_mm = [0, 0, -300]\n[[light]]\nposition_mm = [0, 9, 300]\n",
            "camera.position_mm",
        ),
        (
            "format = 1\n[[light]]\nphotos = \"low\"\nposition_mm = [0, 9, 300]\n",
            "no lamp of the camera file",
        ),
    ] {
        fs::write(bench.path("camera.toml"), text).unwrap();
        refused(compare, &[words]);
    }
    // A lamp that was elsewhere does not go unnoticed.
    fs::write(bench.path("camera.toml"), "format = 1\n[[light]]\nposition_mm = [150, -200, 250]\n").unwrap();
    let output =
        bench.command("compare photos --job job.rgl --camera camera.toml -o page.html").output().unwrap();
    let said = testing::program::text(&output.stderr);
    assert!(output.status.success() && said.contains("fall-off of lamp 1"), "{said}");
}
