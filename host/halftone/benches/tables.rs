//! The tables of `docs/decisions/cells.md`: `cargo bench -p foilpress-halftone --bench tables -- methods`, `times` or `documents`.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use appearance::brdf::{Space, reflectances};
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps, quantise};
use halftone::contrast_sensitivity::{Eye, Tangent, error_planes, errors_seen, peak, swing};
use halftone::thin::thin;
use halftone::{Method, Settings, halftone, metrics};
use inks::{Library, Stack};
use observe::Silent;
use protocol::ink::Ink;
use protocol::paper::Paper;

fn main() {
    for table in std::env::args().skip(1) {
        match table.as_str() {
            "methods" => methods(),
            "times" => times(),
            "documents" => documents(),
            // Cargo's own.
            "--bench" => {}
            other => eprintln!("there is no table `{other}`; there are methods, times, documents"),
        }
    }
}

/// The bare paper, single inks, then pairs of them.
fn stacks(count: usize) -> Vec<Stack> {
    let pairs = (0..169).map(|i| Stack::new([Ink::ALL[i % 13], Ink::ALL[i / 13]]));
    std::iter::once(Stack::SUBSTRATE)
        .chain(Ink::ALL.map(|ink| Stack::new([ink])))
        .chain(pairs)
        .take(count)
        .collect()
}

/// The side of the smallest square of so many dots.
fn side(minimum: u16) -> usize {
    (1..).find(|side| side * side >= usize::from(minimum)).unwrap()
}

/// The patches of the table: name, stacks, minima, shares of each stack at (u, v) of 0 to 1.
type Patch = (&'static str, [&'static str; 5], [u16; 5], fn(f64, f64) -> [f64; 5]);

const PATCHES: [Patch; 12] = [
    ("ramp of 4 inks; 8", ["substrate", "C", "M", "Y", "K"], [8; 5], |u, v| {
        [0.0, (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
    }),
    ("K ramp; 8", ["substrate", "K", "C", "M", "Y"], [8; 5], |u, _| [1.0 - u, u, 0.0, 0.0, 0.0]),
    ("ramp of 4 inks", ["substrate", "C", "M", "Y", "K"], [9; 5], |u, v| {
        [0.0, (1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
    }),
    ("5 stacks", ["substrate", "C", "M", "Y", "K"], [9; 5], |_, _| [0.3, 0.25, 0.2, 0.15, 0.1]),
    ("K 10 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.9, 0.1, 0.0, 0.0, 0.0]),
    ("K 25 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.75, 0.25, 0.0, 0.0, 0.0]),
    ("K 33 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0, 0.0]),
    ("K 50 %", ["substrate", "K", "C", "M", "Y"], [9; 5], |_, _| [0.5, 0.5, 0.0, 0.0, 0.0]),
    ("K ramp", ["substrate", "K", "C", "M", "Y"], [9; 5], |u, _| [1.0 - u, u, 0.0, 0.0, 0.0]),
    ("foil, K, paper", ["substrate", "SF", "K", "C", "M"], [9; 5], |_, _| [0.5, 0.3, 0.2, 0.0, 0.0]),
    ("foil ramp", ["substrate", "SF", "K", "C", "M"], [8, 16, 8, 8, 8], |u, v| {
        [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v, 0.0]
    }),
    ("foil of 16", ["substrate", "SF", "K", "C", "M"], [8, 16, 8, 8, 8], |_, _| [0.5, 0.3, 0.2, 0.0, 0.0]),
];

/// Prints how each method does on each patch. With a folder in `FOILPRESS_LOOK` it writes
/// the patches there as pictures of one pixel a dot.
fn methods() {
    const SIDE: usize = 1024;
    let (library, space) = (Library::builtin(), Space::half_angle(32));
    let colours: [[u8; 3]; 5] = [[255, 255, 255], [0, 160, 220], [220, 0, 120], [250, 220, 0], [20, 20, 20]];
    println!(
        "{:16} {:6} {:>7} {:>7} {:>6} {:>12} {:>5} {:>5} {:>6}",
        "", "", "0.3 m", "0.5 m", "peak", "lag", "rows", "cols", "thin %"
    );
    for (name, names, minimum, shares) in PATCHES {
        let flat = shares(0.0, 0.0) == shares(1.0, 1.0);
        let pixels = if flat { 1 } else { 256 };
        let at = |i: usize| (i as f64 + 0.5) / pixels as f64;
        let mut data = vec![0; pixels * pixels * 5];
        for (pixel, out) in data.chunks_exact_mut(5).enumerate() {
            quantise(&shares(at(pixel % pixels), at(pixel / pixels)), out);
        }
        let mix = InkMix {
            stacks: names.map(|name| name.parse().unwrap()).to_vec(),
            maps: WeightMaps::new(pixels, pixels, 5, data).unwrap(),
            matrix: (0..5).map(|i| (0..5).map(|q| if q == i { ONE } else { 0 }).collect()).collect(),
        };
        let table = reflectances(&mix.stacks, &library, &space);
        let mean: Vec<f64> = (0..5)
            .map(|q| {
                (0..64)
                    .map(|i| shares((f64::from(i % 8) + 0.5) / 8.0, (f64::from(i / 8) + 0.5) / 8.0)[q])
                    .sum::<f64>()
                    / 64.0
            })
            .collect();
        let tangent = Tangent::new(&space, &table, &mean);
        let asked: Vec<f32> = (0..SIDE * SIDE)
            .flat_map(|dot| {
                let place = |dot: usize| (dot as f64 + 0.5) / SIDE as f64;
                shares(place(dot % SIDE), place(dot / SIDE)).map(|share| share as f32)
            })
            .collect();
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings { method, minimum: minimum.to_vec(), reflectance: Some(table.clone()) };
            let sheet = halftone(&mix, (SIDE as u16, SIDE as u16), None, &settings, &Silent).unwrap();
            let dots = sheet.index();
            let seen = errors_seen(&error_planes(dots, &asked, &tangent), &Eye::new(SIDE, SIDE, &[0.3, 0.5]));
            // The rarest stack of the patch, and three of its mean spacings.
            let rare =
                (1..5).filter(|&q| mean[q] > 0.0).min_by(|&a, &b| mean[a].total_cmp(&mean[b])).unwrap();
            let b = side(minimum[rare]);
            let near = 3.0 * b as f64 / mean[rare].sqrt();
            let (most, lag) = if flat { peak(SIDE, dots, rare as u8, near, 256) } else { (0.0, (0, 0)) };
            let (rows, columns) = if flat { swing(SIDE, dots, rare as u8, b) } else { (0.0, 0.0) };
            let thin = thin(SIDE, dots, |q| minimum[usize::from(q)].into(), |_| false);
            println!(
                "{name:16} {:6} {:7.5} {:7.5} {most:6.3} {:>12} {rows:5.2} {columns:5.2} {:6.2}",
                format!("{method:?}"),
                seen[0],
                seen[1],
                format!("{lag:?}"),
                100.0 * thin as f64 / (SIDE * SIDE) as f64
            );
            if let Some(folder) = std::env::var_os("FOILPRESS_LOOK") {
                let picture = image::RgbImage::from_fn(SIDE as u32, SIDE as u32, |x, y| {
                    image::Rgb(colours[usize::from(dots[y as usize * SIDE + x as usize])])
                });
                let file = format!("{}-{method:?}.png", name.replace([' ', ',', '%'], ""));
                picture.save(std::path::Path::new(&folder).join(file)).unwrap();
            }
        }
    }
}

/// Prints how long A4 takes, with stacks that print by cells of 3 x 3 dots and by cells of 4 x 4 in halves.
fn times() {
    let (library, space) = (Library::builtin(), Space::half_angle(32));
    for (count, minimum) in [(8, 9), (8, 8), (57, 9)] {
        let mix = a4(count);
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings {
                method,
                minimum: vec![minimum; count],
                reflectance: Some(reflectances(&mix.stacks, &library, &space)),
            };
            let size = (Paper::A4.width(), Paper::A4.length());
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let took = (0..2)
                    .map(|_| {
                        let start = std::time::Instant::now();
                        pool.install(|| halftone(&mix, size, None, &settings, &Silent).unwrap());
                        start.elapsed()
                    })
                    .min()
                    .unwrap();
                println!("A4, {count} stacks of {minimum}, {method:?}: {took:.2?} on {threads} threads");
            }
        }
    }
}

/// A smooth document of eight bases, a pixel for 4 x 4 dots.
fn a4(count: usize) -> InkMix {
    let (width, height, channels) = (1200, 1593, 8);
    let mut data = vec![0; width * height * channels];
    for (pixel, out) in data.chunks_exact_mut(channels).enumerate() {
        let (x, y) = ((pixel % width) as f64 / 190.0, (pixel / width) as f64 / 230.0);
        let wave = |i: usize| 1.05 + (x * (1.0 + i as f64 * 0.3) + y * (2.0 - i as f64 * 0.2)).sin();
        quantise(&(0..channels).map(wave).collect::<Vec<_>>(), out);
    }
    let matrix = (0..channels)
        .map(|i| {
            let mut row = vec![0; count];
            quantise(&(0..count).map(|q| 1.0 + ((q * 7 + i * 13) % 11) as f64).collect::<Vec<_>>(), &mut row);
            row
        })
        .collect();
    InkMix { stacks: stacks(count), maps: WeightMaps::new(width, height, channels, data).unwrap(), matrix }
}

/// Prints how each method does on documents: the folders of `foilpress map` in `FOILPRESS_MIXES`, separated by colons.
fn documents() {
    // 120 and 20 mm.
    const SIDES: [u16; 2] = [2835, 472];
    let Some(folders) = std::env::var_os("FOILPRESS_MIXES") else { return };
    let all = std::env::split_paths(&folders).flat_map(|folder| SIDES.map(|side| (folder.clone(), side)));
    for (folder, side) in all {
        let name = folder.file_stem().unwrap().to_string_lossy().into_owned();
        let (mix, _) = appearance::gamut::files::load(&folder).unwrap();
        let settings = Settings::from_library(&mix.stacks, &Library::builtin());
        let mut walked = Vec::new();
        for method in [Method::Walk, Method::Cells, Method::Best] {
            let settings = Settings { method, ..settings.clone() };
            let start = std::time::Instant::now();
            let sheet = halftone(&mix, (side, side), None, &settings, &Silent).unwrap();
            let took = start.elapsed();
            let look = metrics::look(&mix, &sheet, &settings).unwrap().unwrap();
            let tones = metrics::tones(&mix, &sheet, &Silent).unwrap();
            let worst = tones.iter().map(|tone| (tone.printed - tone.asked).abs()).fold(0.0, f64::max);
            let seen: Vec<f64> = look.seen.iter().map(|seen| seen.1).collect();
            walked = if walked.is_empty() { seen.clone() } else { walked };
            if let Some(folder) = std::env::var_os("FOILPRESS_LOOK") {
                std::fs::write(
                    std::path::Path::new(&folder).join(format!("{name}.{side}.{method:?}")),
                    sheet.index(),
                )
                .unwrap();
            }
            println!(
                "{name:16} {side:5} {:6} {:.5} {:.5}, {:.3} {:.3} of the walk; thin {:.2} %, tones within {:.3} %, {took:.2?}",
                format!("{method:?}"),
                seen[0],
                seen[1],
                seen[0] / walked[0],
                seen[1] / walked[1],
                100.0 * look.thin,
                100.0 * worst,
            );
        }
    }
}
