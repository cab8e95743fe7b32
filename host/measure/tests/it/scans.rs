//! Scans of charts as a scanner would make them, and what is read from them.
//!
//! The scanner of this test shares nothing with the program: ink is where the nearest printed dot is within the ink's reach, asked of
//! each place by itself, with an edge that fades over some micrometres; clusters below a size are lost or fade; the sheet lies
//! askew at another scale, is lit unevenly, blurred, and comes with noise in 8 bits of sRGB.

use std::fs;
use std::path::PathBuf;

use halftone::Method;
use inks::{Library, Stack};
use measure::scans::{ramp, registration};
use observe::Silent;
use press::chart;
use press::layout::{Layout, arrange};
use protocol::ink::Ink;
use protocol::paper::Paper;
use rayon::prelude::*;
use sheet::{DotMap, Sheet};

const DOTS_PER_MM: f64 = 600.0 / 25.4;

fn stack(text: &str) -> Stack {
    text.parse().unwrap()
}

fn chart_of(first: &str, second: &str) -> Sheet {
    let library = Library::builtin();
    laid(&chart::ramp(&stack(first), &stack(second), Method::Cells, &library, &Silent).unwrap())
}

fn laid(dots: &DotMap) -> Sheet {
    // As small as the chart and its marks, with some bare paper.
    let paper = Paper::Custom { width: dots.width() as u16 + 60, length: dots.length() as u16 + 650 };
    let layout = Layout { camera_marks: true, ..Layout::centred(paper) };
    arrange(dots, &layout, &Silent).unwrap().sheet
}

/// How the printer and the scanner are.
#[derive(Clone)]
struct Bench {
    dpi: f64,
    /// The reach of the ink beyond its dots, and the width of its edge, in mm.
    reach: f64,
    soft: f64,
    /// Clusters of fewer dots keep this part of their ink.
    least: usize,
    kept: f64,
    turn_deg: f64,
    scale: f64,
    /// Fall-off of light toward the corners.
    fall: f64,
    /// Brightness of paper, of ink, and of each ground.
    paper: f64,
    noise: f64,
    /// The left top corner of the sheet's dots in the picture, in mm.
    at: [f64; 2],
    /// Size of the picture in mm.
    size: [f64; 2],
    mirrored: bool,
}

impl Bench {
    fn for_ramp(sheet: &Sheet, dpi: f64) -> Bench {
        let size = [sheet.width() as f64 / DOTS_PER_MM + 12.0, sheet.length() as f64 / DOTS_PER_MM + 12.0];
        Bench {
            dpi,
            reach: 0.017,
            soft: 0.006,
            least: 9,
            kept: 0.0,
            turn_deg: 1.0,
            scale: 1.004,
            fall: 0.12,
            paper: 0.82,
            noise: 0.006,
            at: [6.5, 4.5],
            size,
            mirrored: false,
        }
    }
}

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

/// How much ink each dot of a stack keeps: clusters that are too small lose some.
fn kept(dots: &DotMap, number: u8, bench: &Bench) -> Vec<f32> {
    let (width, length) = (dots.width(), dots.length());
    let mut kept: Vec<f32> = dots.index().iter().map(|&dot| f32::from(u8::from(dot == number))).collect();
    let mut done = vec![false; kept.len()];
    for start in 0..kept.len() {
        if done[start] || dots.index()[start] != number {
            continue;
        }
        let mut cluster = vec![start];
        done[start] = true;
        let mut next = 0;
        while next < cluster.len() {
            let (x, y) = (cluster[next] % width, cluster[next] / width);
            next += 1;
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let (x, y) = (x as i64 + dx, y as i64 + dy);
                if x < 0 || y < 0 || x >= width as i64 || y >= length as i64 {
                    continue;
                }
                let at = y as usize * width + x as usize;
                if !done[at] && dots.index()[at] == number {
                    done[at] = true;
                    cluster.push(at);
                }
            }
        }
        if cluster.len() < bench.least {
            cluster.into_iter().for_each(|at| kept[at] = bench.kept as f32);
        }
    }
    kept
}

/// The printed sheet: the light of each place.
struct Printed<'a> {
    dots: &'a DotMap,
    kept: Vec<f32>,
    number: u8,
    bench: &'a Bench,
    light: Vec<f64>,
}

impl<'a> Printed<'a> {
    fn new(dots: &'a DotMap, ink: &str, bench: &'a Bench) -> Printed<'a> {
        let number = dots.stacks().iter().position(|s| *s == stack(ink)).unwrap() as u8;
        let light = dots
            .stacks()
            .iter()
            .map(|s| match s.to_string().as_str() {
                "substrate" => bench.paper,
                "K" => 0.05,
                "MS" => 0.35,
                _ => 0.6,
            })
            .collect();
        Printed { dots, kept: kept(dots, number, bench), number, bench, light }
    }

    /// How much of a place, in dots of the sheet, the ink covers.
    fn inked(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor() as i64, y.floor() as i64);
        let mut most: f64 = 0.0;
        for j in row - 2..=row + 2 {
            for i in column - 2..=column + 2 {
                if i < 0 || j < 0 || i >= self.dots.width() as i64 || j >= self.dots.length() as i64 {
                    continue;
                }
                let kept = f64::from(self.kept[j as usize * self.dots.width() + i as usize]);
                if kept <= most {
                    continue;
                }
                // To the square of this dot.
                let dx = (i as f64 - x).max(x - (i + 1) as f64).max(0.0);
                let dy = (j as f64 - y).max(y - (j + 1) as f64).max(0.0);
                let off = dx.hypot(dy) / DOTS_PER_MM;
                most = most.max(kept * ((self.bench.reach - off) / self.bench.soft + 0.5).clamp(0.0, 1.0));
            }
        }
        most
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor(), y.floor());
        if column < 0.0 || row < 0.0 || column >= self.dots.width() as f64 || row >= self.dots.length() as f64
        {
            return self.bench.paper;
        }
        let own = self.dots.index()[row as usize * self.dots.width() + column as usize];
        // What is under the ink, or where it was lost: the ground of its patch is that of a dot close by.
        let ground = if own == self.number {
            self.ground(column as i64, row as i64)
        } else {
            self.light[usize::from(own)]
        };
        let share = self.inked(x, y);
        share * self.light[usize::from(self.number)] + (1.0 - share) * ground
    }

    fn ground(&self, x: i64, y: i64) -> f64 {
        for reach in 1..4 {
            for (dx, dy) in [(reach, 0), (-reach, 0), (0, reach), (0, -reach)] {
                let (x, y) = (x + dx, y + dy);
                if x >= 0 && y >= 0 && x < self.dots.width() as i64 && y < self.dots.length() as i64 {
                    let own = self.dots.index()[y as usize * self.dots.width() + x as usize];
                    if own != self.number {
                        return self.light[usize::from(own)];
                    }
                }
            }
        }
        self.bench.paper
    }

    fn same_around(&self, x: f64, y: f64) -> Option<f64> {
        let (column, row) = (x.floor() as i64, y.floor() as i64);
        let (width, length) = (self.dots.width() as i64, self.dots.length() as i64);
        if column < 3 || row < 3 || column + 3 >= width || row + 3 >= length {
            return None;
        }
        let at = |i: i64, j: i64| self.dots.index()[(j * width + i) as usize];
        let own = at(column, row);
        let kept = self.kept[(row * width + column) as usize];
        ((-3..=3).all(|j| (-3..=3).all(|i| at(column + i, row + j) == own)) && (kept == 0.0 || kept == 1.0))
            .then(|| self.light[usize::from(own)])
    }
}

/// The picture that a scanner makes, light from 0 to 1. `edge` is the sheet's own extent around its dots in mm (left, top, right,
/// bottom), beyond which everything is black.
fn scanned(printed: &Printed<'_>, edge: Option<[f64; 4]>) -> (usize, usize, Vec<f32>) {
    let bench = printed.bench;
    let [width, height] = bench.size.map(|side| (side / 25.4 * bench.dpi) as usize);
    let (s, c) = bench.turn_deg.to_radians().sin_cos();
    let per_mm = bench.dpi / 25.4 * bench.scale;
    let fine = if bench.dpi < 450.0 { 3 } else { 2 };
    let mut values: Vec<f32> = (0..height)
        .into_par_iter()
        .flat_map_iter(|j| {
            (0..width).map(move |i| {
                let place = |dx: f64, dy: f64| {
                    let (x, y) =
                        ((i as f64 + dx) / per_mm - bench.at[0], (j as f64 + dy) / per_mm - bench.at[1]);
                    [(c * x + s * y) * DOTS_PER_MM, (c * y - s * x) * DOTS_PER_MM]
                };
                let [x, y] = place(0.5, 0.5);
                if let Some([left, top, right, bottom]) = edge {
                    let (x, y) = (x / DOTS_PER_MM, y / DOTS_PER_MM);
                    if x < -left || y < -top || x > right || y > bottom {
                        return 0.01;
                    }
                }
                let light = printed.same_around(x, y).unwrap_or_else(|| {
                    let mut sum = 0.0;
                    for k in 0..fine * fine {
                        let part = |k: usize| (k as f64 + 0.5) / fine as f64;
                        let [x, y] = place(part(k % fine), part(k / fine));
                        sum += printed.at(x, y);
                    }
                    sum / (fine * fine) as f64
                });
                let (u, v) = (i as f64 / width as f64 - 0.5, j as f64 / height as f64 - 0.45);
                (light * (1.0 - bench.fall * 2.0 * (u * u + v * v) - 0.05 * u)) as f32
            })
        })
        .collect();
    // A lens: three taps both ways, twice.
    for _ in 0..2 {
        for (stride, wrap) in [(1usize, width), (width, width * height)] {
            let old = values.clone();
            values.par_iter_mut().enumerate().for_each(|(at, value)| {
                let within = at % wrap;
                if within >= stride && within + stride < wrap {
                    *value = 0.25 * old[at - stride] + 0.5 * old[at] + 0.25 * old[at + stride];
                }
            });
        }
    }
    values.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
        let mut state = 0x9e37_79b9_7f4a_7c15u64.wrapping_mul(j as u64 + 1);
        for value in row.iter_mut() {
            let normal = (0..4).map(|_| random(&mut state)).sum::<f64>() - 2.0;
            *value += (normal * 3f64.sqrt() * bench.noise) as f32;
        }
        if bench.mirrored {
            row.reverse();
        }
    });
    (width, height, values)
}

/// An 8-bit file in sRGB.
fn saved(
    folder: &tempfile::TempDir,
    name: &str,
    (width, height, values): &(usize, usize, Vec<f32>),
    gain: f32,
) -> PathBuf {
    let coded = |v: f32| {
        let v = (v * gain).clamp(0.0, 1.0);
        let bent = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (255.0 * bent).round() as u8
    };
    let bytes: Vec<u8> = values.par_iter().map(|v| coded(*v)).collect();
    let path = folder.path().join(name);
    image::GrayImage::from_raw(*width as u32, *height as u32, bytes).unwrap().save(&path).unwrap();
    path
}

#[test]
fn a_known_dot_gain_is_found_within_a_hundredth_and_the_smallest_cluster_exactly() {
    let folder = tempfile::tempdir().unwrap();
    for (pair, dpi, reach, least, keeps) in
        [(["K", "substrate"], 400.0, 0.017, 9, 0.0), (["K", "MS"], 300.0, 0.024, 14, 0.6)]
    {
        let sheet = chart_of(pair[0], pair[1]);
        let bench = Bench { reach, least, kept: keeps, ..Bench::for_ramp(&sheet, dpi) };
        let printed = Printed::new(sheet.dots(), pair[0], &bench);
        let path = saved(&folder, "scan.tif", &scanned(&printed, None), 1.0);
        let found = ramp::measure(&[path], sheet.dots(), &Library::builtin(), None, &Silent).unwrap();
        let [ink, ground] = &found.series;
        println!(
            "{pair:?} at {dpi} dpi: reach {:.3} of {:.1} um +- {:.3}, smallest {:?} of {least}; gaps {:?}, {:.3} um; ramp off by {:.4}, gain at half {:.4}",
            ink.dot_gain_um,
            1000.0 * reach,
            ink.dot_gain_error_um,
            ink.minimum_cluster,
            ground.minimum_cluster,
            ground.dot_gain_um,
            found.off_linear,
            found.gain_at_half
        );
        for size in &ink.sizes {
            println!("  {:>2}: {:.4} {:.4} {:.4}", size.dots, size.share, size.seen, size.expected);
        }
        assert!((ink.dot_gain_um / (1000.0 * reach) - 1.0).abs() < 0.01, "{}", ink.dot_gain_um);
        assert_eq!(ink.minimum_cluster, Some(least as u16));
        // The tone at half ink, as the simulated sheet has it.
        let half = half_tone(&printed);
        assert!((found.gain_at_half - half).abs() < 0.01, "{} {half}", found.gain_at_half);
        let dots = found.dots();
        assert_eq!(dots[0].owner, ramp::Owner::Ink(Ink::Black));
        assert_eq!(dots[0].dot_gain_um.is_some(), pair[1] == "substrate");
    }
}

/// Scanner programs sharpen, and write 16 bits with the curve of sRGB: neither changes the dot gain in silence.
#[test]
fn sharpening_and_a_tone_curve_in_16_bits_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let sheet = chart_of("K", "substrate");
    let bench = Bench { reach: 0.022, least: 6, ..Bench::for_ramp(&sheet, 300.0) };
    let printed = Printed::new(sheet.dots(), "K", &bench);
    let (width, height, plain) = scanned(&printed, None);
    let measured = |path: PathBuf, linear: Option<bool>| {
        ramp::measure(&[path], sheet.dots(), &Library::builtin(), linear, &Silent)
    };
    // Unsharp mask: what a mean over 5 x 5 pixels takes away is added again.
    let mean = |x: usize, y: usize| {
        let range = |at: usize, side: usize| at.saturating_sub(2)..(at + 3).min(side);
        let all = range(y, height).flat_map(|y| range(x, width).map(move |x| (x, y)));
        let (sum, count) = all.fold((0.0, 0.0f32), |(sum, n), (x, y)| (sum + plain[y * width + x], n + 1.0));
        sum / count
    };
    let sharp = |amount: f32| -> Vec<f32> {
        let value = |i: usize| plain[i] + amount * (plain[i] - mean(i % width, i / width));
        (0..plain.len()).into_par_iter().map(value).collect()
    };
    let said = |found: Result<ramp::Ramp, measure::MeasureError>| found.unwrap_err().to_string();
    let words = said(measured(saved(&folder, "sharp.png", &(width, height, sharp(1.5)), 1.0), None));
    println!("{words}");
    assert!(words.contains("sharpened") && words.contains("turn sharpening off"), "{words}");
    // 16 bits, proportional to light and not.
    let sixteen = |name: &str, coded: &(dyn Fn(f32) -> f32 + Sync)| {
        let values: Vec<u16> =
            plain.par_iter().map(|v| (65_535.0 * coded(v.clamp(0.0, 1.0))).round() as u16).collect();
        let path = folder.path().join(name);
        let picture: image::ImageBuffer<image::Luma<u16>, _> =
            image::ImageBuffer::from_raw(width as u32, height as u32, values).unwrap();
        picture.save(&path).unwrap();
        path
    };
    let gamma = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    let (light, bent) = (sixteen("light.png", &|v| v), sixteen("bent.png", &gamma));
    let words = said(measured(bent.clone(), None));
    println!("{words}");
    assert!(
        words.contains("bent.png") && words.contains("tone curve") && words.contains("--linear false"),
        "{words}"
    );
    for (path, linear) in [(light, None), (bent, Some(false))] {
        let found = measured(path, linear).unwrap();
        assert!((found.series[0].dot_gain_um / 22.0 - 1.0).abs() < 0.02, "{}", found.series[0].dot_gain_um);
        assert_eq!(found.series[0].minimum_cluster, Some(6));
    }
}

/// How much more than its dots ink covers in the middle of the ramp: places drawn by chance.
fn half_tone(printed: &Printed<'_>) -> f64 {
    let parts = chart::ramp::parts();
    let dots = printed.dots;
    let (left, top) = ((dots.width() - parts.size.0) / 2, (dots.length() - parts.size.1) / 2);
    let mut state = 77;
    let (mut seen, mut share, count) = (0.0, 0.0, 60_000);
    for _ in 0..count {
        let x = left as f64 + parts.ramp.width as f64 * (0.47 + 0.06 * random(&mut state));
        let y = (top + parts.ramp.top + 20) as f64 + (parts.ramp.length - 40) as f64 * random(&mut state);
        seen += printed.inked(x, y);
        share += f64::from(u8::from(dots.index()[y as usize * dots.width() + x as usize] == printed.number));
    }
    (seen - share) / f64::from(count)
}

#[test]
fn what_no_ramp_can_be_read_from_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let dots =
        chart::ramp(&stack("K"), &stack("substrate"), Method::Cells, &Library::builtin(), &Silent).unwrap();
    let sheet = laid(&dots);
    let bench = Bench::for_ramp(&sheet, 160.0);
    let printed = Printed::new(sheet.dots(), "K", &bench);
    let good = scanned(&printed, None);
    let refused = |path: PathBuf, sheet: &Sheet, words: &[&str]| {
        let said =
            ramp::measure(&[path], sheet.dots(), &Library::builtin(), None, &Silent).unwrap_err().to_string();
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
    };
    let path = saved(&folder, "good.png", &good, 1.0);
    // One dot makes another chart.
    let (stacks, mut index) = dots.clone().into_parts();
    let middle = index.len() / 5;
    index[middle] ^= 1;
    let other = laid(&DotMap::new(dots.width(), dots.length(), stacks, index).unwrap());
    refused(path.clone(), &other, &["good.png", "another sheet"]);
    // A sheet that is no ramp.
    let stacks = chart::stacks(&[stack("K"), stack("MS")], Paper::A4, None).unwrap();
    let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
    refused(
        path,
        &arrange(&stacks, &layout, &Silent).unwrap().sheet,
        &["not a ramp chart", "foilpress chart ramp"],
    );
    let (width, height, values) = &good;
    let blank = (*width, *height, vec![0.8; values.len()]);
    refused(saved(&folder, "blank.png", &blank, 1.0), &sheet, &["no camera marks"]);
    let mirrored: Vec<f32> = values.chunks(*width).flat_map(|row| row.iter().rev().copied()).collect();
    refused(saved(&folder, "mirrored.png", &(*width, *height, mirrored.clone()), 1.0), &sheet, &["mirrored"]);
    refused(saved(&folder, "bright.png", &good, 1.4), &sheet, &["substrate is clipped", "darker"]);
    // Half of it, and without its right side.
    let half = (*width, height / 2, values[..width * (height / 2)].to_vec());
    refused(saved(&folder, "half.png", &half, 1.0), &sheet, &["only 2 of the sheet's 4"]);
    let narrow: Vec<f32> = values.chunks(*width).flat_map(|row| row[..width - 30].to_vec()).collect();
    let cut = saved(&folder, "cut.png", &(width - 30, *height, narrow), 1.0);
    assert!(ramp::measure(&[cut], sheet.dots(), &Library::builtin(), None, &Silent).is_ok());
    let twice: Vec<f32> = values.chunks(*width).flat_map(|row| [row, row].concat()).collect();
    refused(saved(&folder, "two.png", &(2 * width, *height, twice), 1.0), &sheet, &["two copies"]);
    let coarse = Bench { dpi: 110.0, ..bench.clone() };
    let coarse = scanned(&Printed::new(sheet.dots(), "K", &coarse), None);
    refused(saved(&folder, "coarse.png", &coarse, 1.0), &sheet, &["dpi", "300 dpi or more"]);
    fs::write(folder.path().join("none.png"), "nothing").unwrap();
    refused(folder.path().join("none.png"), &sheet, &["none.png", "not a readable photograph"]);
}

/// A printer that is off, and a sheet that lies askew on a scanner with black behind it.
#[test]
fn offset_feed_and_skew_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let dots = chart::registration(&[Ink::Black, Ink::Cyan], Paper::A4).unwrap();
    let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
    let sheet = arrange(&dots, &layout, &Silent).unwrap().sheet;
    let library = Library::builtin();
    let (width, length) = (sheet.width() as f64 / DOTS_PER_MM, sheet.length() as f64 / DOTS_PER_MM);
    // Margins of A4 as the language has them.
    let (left, top) = (80.0 / DOTS_PER_MM, f64::from(Paper::A4.top()) / DOTS_PER_MM);
    for (offset, feed, skew, turn) in [([0.42, -0.77], 1.0037, 0.0, 0.6), ([-0.9, 0.35], 0.9962, 0.25, -0.8)]
    {
        let bench = Bench {
            dpi: 200.0,
            reach: 0.01,
            least: 0,
            turn_deg: turn,
            scale: 1.0,
            at: [12.0, 16.0],
            size: [width + 32.0, length + 36.0],
            ..Bench::for_ramp(&sheet, 200.0)
        };
        // The printed dots are moved, stretched and turned on the sheet, about the middle of its width and its first row.
        let printed = Printed::new(sheet.dots(), "K", &bench);
        let (s, c) = f64::to_radians(skew).sin_cos();
        let [mx, my] = [left + width / 2.0, top + length / 2.0];
        let back = |x: f64, y: f64| {
            // From the sheet to what was sent: about the middle of the page across, and along for the turn.
            let (u, v) = (x - mx - offset[0], y - my - offset[1] - (feed - 1.0) * (my - top));
            let (u, v) = (c * u + s * v, c * v - s * u);
            [(u + mx - left) * DOTS_PER_MM, (v / feed + my - top) * DOTS_PER_MM]
        };
        let picture = registered(&printed, &bench, back, [210.0, 297.0]);
        let path = saved(&folder, "scan.png", &picture, 1.0);
        let found =
            registration::measure(&[path.clone(), path], &sheet, &library, Some(200.0), &Silent).unwrap();
        let placed = &found.scans[0];
        println!("{offset:?} {feed} {skew}: {placed:?}");
        for (found, real) in placed.offset_mm.iter().zip(offset) {
            assert!((found - real).abs() < 0.02, "{placed:?}");
        }
        assert!((placed.feed - feed).abs() < 1e-4 && (placed.skew_deg - skew).abs() < 0.02, "{placed:?}");
        assert_eq!(found.apart_mm, Some(0.0));
        assert!((found.profile.offset_mm[0] - offset[0]).abs() < 0.02);
    }
}

/// A scan of a whole sheet of this size in mm, whose dots lie where `back` says, on black.
fn registered(
    printed: &Printed<'_>,
    bench: &Bench,
    back: impl Fn(f64, f64) -> [f64; 2] + Sync,
    size: [f64; 2],
) -> (usize, usize, Vec<f32>) {
    let [width, height] = bench.size.map(|side| (side / 25.4 * bench.dpi) as usize);
    let (s, c) = bench.turn_deg.to_radians().sin_cos();
    let per_mm = bench.dpi / 25.4;
    let values: Vec<f32> = (0..height)
        .into_par_iter()
        .flat_map_iter(|j| {
            let back = &back;
            let mut state = 0x9e37_79b9_7f4a_7c15u64.wrapping_mul(j as u64 + 1);
            (0..width).map(move |i| {
                let mut sum = 0.0;
                for k in 0..9 {
                    let part = |k: usize| (k as f64 + 0.5) / 3.0;
                    let (x, y) = (
                        (i as f64 + part(k % 3)) / per_mm - bench.at[0],
                        (j as f64 + part(k / 3)) / per_mm - bench.at[1],
                    );
                    let (x, y) = (c * x + s * y, c * y - s * x);
                    sum += if x < 0.0 || y < 0.0 || x > size[0] || y > size[1] {
                        0.01
                    } else {
                        let [column, row] = back(x, y);
                        if column < 0.0
                            || row < 0.0
                            || column >= printed.dots.width() as f64
                            || row >= printed.dots.length() as f64
                        {
                            bench.paper
                        } else {
                            let at = row as usize * printed.dots.width() + column as usize;
                            printed.light[usize::from(printed.dots.index()[at])]
                        }
                    };
                }
                let normal = (0..4).map(|_| random(&mut state)).sum::<f64>() - 2.0;
                (sum / 9.0 + normal * 3f64.sqrt() * bench.noise) as f32
            })
        })
        .collect();
    (width, height, values)
}

#[test]
fn what_no_profile_can_be_read_from_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let dots = chart::registration(&[Ink::Black, Ink::Cyan], Paper::A4).unwrap();
    let layout = Layout { camera_marks: true, ..Layout::centred(Paper::A4) };
    let sheet = arrange(&dots, &layout, &Silent).unwrap().sheet;
    let (width, length) = (sheet.width() as f64 / DOTS_PER_MM, sheet.length() as f64 / DOTS_PER_MM);
    let bench = Bench {
        least: 0,
        turn_deg: 0.0,
        at: [5.0, 5.0],
        size: [width + 17.0, length + 28.0],
        ..Bench::for_ramp(&sheet, 150.0)
    };
    let printed = Printed::new(sheet.dots(), "K", &bench);
    let top = f64::from(Paper::A4.top());
    let back = |x: f64, y: f64| [x * DOTS_PER_MM - 80.0, y * DOTS_PER_MM - top];
    let refused = |path: &PathBuf, dpi: Option<f64>, words: &[&str]| {
        let said =
            registration::measure(std::slice::from_ref(path), &sheet, &Library::builtin(), dpi, &Silent);
        let said = said.unwrap_err().to_string();
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
    };
    // Nothing but paper all around.
    let white = registered(&printed, &bench, back, [1000.0, 1000.0]);
    let mut lid = white.clone();
    lid.2.iter_mut().for_each(|v| *v = if *v < 0.02 { 0.82 } else { *v });
    let path = saved(&folder, "lid.png", &lid, 1.0);
    refused(&path, None, &["does not state its resolution", "--dpi"]);
    refused(&path, Some(300.0), &["as large as at 150 dpi", "--dpi"]);
    refused(&path, Some(150.0), &["left edge", "something black"]);
}
