//! Light from everywhere: a latitude-longitude panorama of radiance.
//!
//! Conventions: row 0 is up (+y). At column u and row v, both from 0 to 1, the direction is
//! `(sin phi sin t, cos t, -cos phi sin t)` with phi = 2 pi u and t = pi v. The eye looks along -z, so the middle of the
//! panorama is behind the eye and its left edge is behind the ball. Texels are weighted by their exact solid angle.
//! Renderers take each texel for a point of light in its middle, so they cut a panorama of few rows finer ([`Probe::resized`]).
//! Source of files: Radiance `.hdr` (RGBE) and OpenEXR, decoded within limits.

use std::f64::consts::PI;
use std::path::Path;

use readers::{Bounds, Format, Samples};

use super::error::PreviewError;

/// The widest panorama that can be read.
const WIDEST: usize = 8192;
/// The fewest rows that a panorama is rendered with: texels of 2.8 degrees.
const FEWEST: usize = 64;
/// The most memory: that of the widest in four channels of four bytes.
const BOUNDS: Bounds = Bounds { side: None, bytes: 512 << 20 };

/// Radiance from every direction. See the module text for its layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    width: usize,
    height: usize,
    rgb: Vec<[f32; 3]>,
}

impl Probe {
    /// A panorama of `height` rows. Radiance is finite and not negative.
    ///
    /// # Errors
    /// A number of texels that is no multiple of `height`, or radiance out of range.
    pub fn new(height: usize, rgb: Vec<[f32; 3]>) -> Result<Probe, PreviewError> {
        let shape = |what, expected, found| PreviewError::Shape { what, expected, found };
        let width = rgb.len() / height.max(1);
        if width == 0 || width * height != rgb.len() {
            return Err(shape("texels of a light probe", width.max(1) * height.max(1), rgb.len()));
        }
        let good = |t: &&[f32; 3]| t.iter().all(lightens);
        let count = rgb.iter().filter(good).count();
        if count != rgb.len() {
            return Err(shape("texels of a light probe that are finite and not negative", rgb.len(), count));
        }
        Ok(Probe { width, height, rgb })
    }

    /// The same radiance from every direction: a furnace.
    pub fn constant(radiance: f32) -> Probe {
        let (width, height) = (128, 64);
        Probe { width, height, rgb: vec![[radiance.max(0.0); 3]; width * height] }
    }

    /// A synthetic photo studio of `height` rows (1 or more): a window with four panes at the upper left, a tall strip light at
    /// the right, a lamp behind and a soft ceiling light, in a grey room that is darker below.
    pub fn studio(height: usize) -> Probe {
        let height = height.max(1);
        let width = 2 * height;
        let texel = |i: usize| {
            let d = direction(
                ((i % width) as f64 + 0.5) / width as f64,
                ((i / width) as f64 + 0.5) / height as f64,
            );
            studio_radiance(d).map(|v| v as f32)
        };
        Probe { width, height, rgb: (0..width * height).map(texel).collect() }
    }

    /// Reads a Radiance `.hdr` or an OpenEXR file; its first bytes decide which.
    ///
    /// # Errors
    /// A file that cannot be read, or is not a panorama twice as wide as high.
    pub fn read(path: &Path) -> Result<Probe, PreviewError> {
        let wrong = |problem: String| PreviewError::Probe { path: path.to_path_buf(), problem };
        let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
        Probe::from_bytes(&bytes, path).map_err(wrong)
    }

    /// Reads a panorama, or says what is wrong with it.
    fn from_bytes(bytes: &[u8], path: &Path) -> Result<Probe, String> {
        let expected = |found: &str| format!("expected a Radiance HDR or OpenEXR picture, {found}");
        let format = Format::of(bytes, path).map_err(|fault| expected(&fault.to_string()))?;
        if !["Radiance HDR", "OpenEXR"].contains(&format.name()) {
            return Err(expected(&format!("found {}", format.name())));
        }
        let header = format.open(bytes, BOUNDS).map_err(|fault| fault.to_string())?;
        let (across, down) = header.size();
        let (width, height) = (across as usize, down as usize);
        if width == 0 || height == 0 || width > WIDEST || width != 2 * height {
            return Err(format!(
                "{width} x {height} pixels; it must be twice as wide as high and at most {WIDEST} wide"
            ));
        }
        let stored = header.decode().map_err(|fault| fault.to_string())?;
        let exposure = stored.exposure;
        if !(exposure.is_finite() && exposure > 0.0) {
            return Err(format!("EXPOSURE={exposure} must be above 0"));
        }
        let Samples::Float(values) = stored.into_rgb() else {
            return Err(expected("found whole numbers"));
        };
        // The program that wrote the file multiplied the pixels by the exposure in the header.
        let rgb: Vec<[f32; 3]> =
            values.as_chunks::<3>().0.iter().map(|texel| texel.map(|v| v / exposure)).collect();
        if rgb.len() != width * height {
            return Err("its parts differ in size; save the panorama alone".into());
        }
        if let Some(i) = rgb.iter().position(|texel| !texel.iter().all(lightens)) {
            return Err(format!(
                "pixel ({}, {}) is {:?}; radiance must be a number and at least 0",
                i % width,
                i / width,
                rgb[i]
            ));
        }
        Ok(Probe { width, height, rgb })
    }

    /// Texels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Texels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Radiance, row by row.
    pub fn rgb(&self) -> &[[f32; 3]] {
        &self.rgb
    }

    /// The direction of the middle of a texel.
    pub fn direction(&self, x: usize, y: usize) -> [f64; 3] {
        direction((x as f64 + 0.5) / self.width as f64, (y as f64 + 0.5) / self.height as f64)
    }

    /// The solid angle of each texel of row `y`. All texels together have 4 pi.
    pub fn solid_angle(&self, y: usize) -> f64 {
        let edge = |y: usize| (PI * y as f64 / self.height as f64).cos();
        (edge(y) - edge(y + 1)) * 2.0 * PI / self.width as f64
    }

    /// The probe as it is rendered: averaged by solid angle to at most `height` rows, and cut into at least 64 where that is no more.
    pub fn resized(&self, height: usize) -> Probe {
        let height = height.max(1);
        let cut = self.height * FEWEST.div_ceil(self.height);
        let rows = if self.height < FEWEST { cut } else { self.height }.min(height);
        if rows == self.height { self.clone() } else { self.resampled(rows) }
    }

    /// The mean radiance over each texel of a panorama of `height` rows. Texels that lie in several new ones are cut, so that all
    /// light stays where it was, whatever the two sizes are.
    fn resampled(&self, height: usize) -> Probe {
        let width = (self.width * height / self.height).max(1);
        let rows = overlaps(self.height, height, |from, to| (PI * from).cos() - (PI * to).cos());
        let columns = overlaps(self.width, width, |from, to| to - from);
        let mut rgb = Vec::with_capacity(width * height);
        for row in &rows {
            let mut line = vec![[0.0f64; 3]; self.width];
            for &(y, part) in row {
                for (sum, texel) in line.iter_mut().zip(&self.rgb[y * self.width..]) {
                    (0..3).for_each(|c| sum[c] += part * f64::from(texel[c]));
                }
            }
            rgb.extend(columns.iter().map(|column| -> [f32; 3] {
                std::array::from_fn(|c| column.iter().map(|&(x, part)| part * line[x][c]).sum::<f64>() as f32)
            }));
        }
        Probe { width, height, rgb }
    }
}

/// Whether this is radiance.
fn lightens(value: &f32) -> bool {
    value.is_finite() && *value >= 0.0
}

/// For each of `new` equal parts of a side the parts of `old` equal ones that lie in it, by their size between two places from 0
/// to 1; together 1.
fn overlaps(old: usize, new: usize, size: impl Fn(f64, f64) -> f64) -> Vec<Vec<(usize, f64)>> {
    // Places in whole numbers, so that parts that end together do.
    let place = |at: usize| at as f64 / (old * new) as f64;
    (0..new)
        .map(|j| {
            let (start, end) = (j * old, (j + 1) * old);
            let whole = size(place(start), place(end));
            let within = start / new..end.div_ceil(new);
            within
                .map(|i| (i, size(place(start.max(i * new)), place(end.min((i + 1) * new))) / whole))
                .collect()
        })
        .collect()
}

/// The direction at column `u` and row `v`, both 0 to 1.
fn direction(u: f64, v: f64) -> [f64; 3] {
    towards((2.0 * PI * u).sin_cos(), (PI * v).sin_cos())
}

/// The direction with sines and cosines of its angles around the vertical and from it.
fn towards(around: (f64, f64), down: (f64, f64)) -> [f64; 3] {
    [around.0 * down.0, down.1, -around.1 * down.0]
}

/// Directions at every quarter of a texel, corners included, without sines and cosines for each.
pub(super) struct Directions {
    around: Vec<(f64, f64)>,
    down: Vec<(f64, f64)>,
}

impl Directions {
    /// The directions of a probe.
    pub fn new(probe: &Probe) -> Directions {
        let angles = |texels: usize, whole: f64| {
            (0..=4 * texels).map(|i| (whole * i as f64 / (4 * texels) as f64).sin_cos()).collect()
        };
        Directions { around: angles(probe.width, 2.0 * PI), down: angles(probe.height, PI) }
    }

    /// The direction at a place, in quarters of a texel from the upper left corner.
    pub fn at(&self, x: usize, y: usize) -> [f64; 3] {
        towards(self.around[x], self.down[y])
    }
}

/// A rectangular lamp: its direction, half its size as tangents, panes across and down, radiance.
struct Lamp {
    towards: [f64; 3],
    half: [f64; 2],
    panes: [f64; 2],
    radiance: [f64; 3],
}

const LAMPS: [Lamp; 4] = [
    Lamp {
        towards: [-0.62, 0.52, 0.59],
        half: [0.34, 0.42],
        panes: [2.0, 2.0],
        radiance: [13.0, 13.4, 14.0],
    },
    Lamp { towards: [0.86, 0.10, 0.50], half: [0.10, 0.80], panes: [1.0, 1.0], radiance: [7.4, 7.0, 6.4] },
    Lamp { towards: [0.35, 0.45, -0.82], half: [0.40, 0.25], panes: [1.0, 1.0], radiance: [9.0, 8.8, 8.4] },
    Lamp { towards: [0.10, 0.99, 0.05], half: [0.60, 0.35], panes: [1.0, 1.0], radiance: [3.0, 3.0, 3.0] },
];

fn studio_radiance(d: [f64; 3]) -> [f64; 3] {
    // A floor, and a wall that brightens towards the ceiling, with a soft line between them.
    let up = smooth(-0.35, 0.25, d[1]);
    let wall = 0.20 + 0.22 * d[1].max(0.0);
    let mut sum: [f64; 3] = std::array::from_fn(|c| {
        let floor = [0.075, 0.070, 0.064][c];
        floor + (wall * [0.97, 1.0, 1.04][c] - floor) * up
    });
    for lamp in &LAMPS {
        let lit = lamp.mask(d);
        (0..3).for_each(|c| sum[c] += lit * lamp.radiance[c]);
    }
    sum
}

impl Lamp {
    /// The fraction of the lamp's radiance in direction `d`: 1 within a pane, 0 outside, smooth at the edges.
    fn mask(&self, d: [f64; 3]) -> f64 {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let unit = |a: [f64; 3]| a.map(|v| v / dot(a, a).sqrt());
        let w = unit(self.towards);
        // Undefined for a lamp straight overhead; every lamp is tilted enough to keep this cross product away from 0.
        let across = unit([w[2], 0.0, -w[0]]);
        let up = [
            w[1] * across[2] - w[2] * across[1],
            w[2] * across[0] - w[0] * across[2],
            w[0] * across[1] - w[1] * across[0],
        ];
        let facing = dot(d, w);
        if facing <= 0.05 {
            return 0.0;
        }
        let place = [dot(d, across) / facing / self.half[0], dot(d, up) / facing / self.half[1]];
        let mut lit = 1.0;
        for (p, panes) in place.into_iter().zip(self.panes) {
            lit *= 1.0 - smooth(0.93, 1.0, p.abs());
            let within = ((p + 1.0) * 0.5 * panes).rem_euclid(1.0);
            let bar = within.min(1.0 - within);
            if panes > 1.0 {
                lit *= smooth(0.03, 0.07, bar);
            }
        }
        lit
    }
}

/// 0 below `from`, 1 above `to`, smooth in between.
fn smooth(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    /// A flat (not run-length coded) file of RGBE pixels.
    fn file(header: &str, width: usize, height: usize, pixels: &[[u8; 4]]) -> Vec<u8> {
        let head = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
        head.into_bytes().into_iter().chain(pixels.iter().flatten().copied()).collect()
    }

    fn read(bytes: Vec<u8>) -> Result<Probe, PreviewError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("env.hdr");
        std::fs::write(&path, bytes).unwrap();
        Probe::read(&path)
    }

    #[test]
    fn rgbe_is_mantissa_times_a_power_of_two() {
        let pixels = [[128, 64, 32, 129], [0, 0, 0, 0], [200, 100, 50, 136], [1, 2, 3, 130]];
        let bytes = file("", 4, 2, &pixels.repeat(2));
        let probe = read(bytes).unwrap();
        assert_eq!((probe.width(), probe.height()), (4, 2));
        for (found, [r, g, b, e]) in probe.rgb().iter().zip(pixels.iter().cycle()) {
            let scale = 2f32.powi(i32::from(*e) - 136) * f32::from(u8::from(*e > 0));
            for (found, mantissa) in found.iter().zip([r, g, b]) {
                // Some readers put half a step on the mantissa.
                assert!(
                    (found - f32::from(*mantissa) * scale).abs() <= 0.5 * scale,
                    "{found} {mantissa} {e}"
                );
            }
        }
    }

    #[test]
    fn exposure_is_taken_out_again() {
        let pixels = [[128, 64, 32, 129]; 2];
        let plain = read(file("", 2, 1, &pixels)).unwrap();
        let exposed = read(file("EXPOSURE=2.0\nEXPOSURE=4.0\n", 2, 1, &pixels)).unwrap();
        for (a, b) in plain.rgb().iter().flatten().zip(exposed.rgb().iter().flatten()) {
            assert!((a / 8.0 - b).abs() < 1e-6);
        }
    }

    #[test]
    fn huge_and_square_panoramas_are_refused_by_name() {
        for (w, h) in [(1 << 20, 1 << 19), (64, 64), (0, 0), (16384, 8192)] {
            let error = read(file("", w, h, &[])).unwrap_err().to_string();
            assert!(error.contains("env.hdr"), "{error}");
        }
    }

    proptest! {
        #[test]
        fn damaged_files_are_errors_or_panoramas_but_never_worse(
            at in 0usize..140, byte in any::<u8>(), cut in 0usize..140,
        ) {
            let mut bytes = file("EXPOSURE=1\n", 8, 4, &[[2, 2, 0, 8]; 32]);
            let len = bytes.len();
            bytes[at % len] = byte;
            bytes.truncate(len - cut % len);
            if let Ok(probe) = read(bytes) {
                prop_assert!(probe.rgb().iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
            }
        }

        #[test]
        fn all_light_is_kept_at_any_size(height in 1usize..40, rows in 1usize..90, seed in any::<u32>()) {
            let (h, w) = (height, 2 * height);
            let value = |i: usize| ((i as u32).wrapping_mul(2_654_435_761).wrapping_add(seed) >> 16) as f32;
            let probe = Probe::new(h, (0..w * h).map(|i| [value(i), value(i + 7), 1.0]).collect()).unwrap();
            let other = probe.resized(rows);
            prop_assert!(other.height() <= rows && other.height() >= rows.min(FEWEST));
            let light = |p: &Probe, c: usize| -> f64 {
                (0..p.rgb().len()).map(|i| f64::from(p.rgb()[i][c]) * p.solid_angle(i / p.width())).sum()
            };
            for c in 0..3 {
                prop_assert!((light(&other, c) / light(&probe, c) - 1.0).abs() < 1e-5);
            }
        }
    }

    /// Light that falls on a surface that faces `n`, each texel a point of light in its middle.
    fn falls(probe: &Probe, n: [f64; 3]) -> f64 {
        let texel = |i: usize| {
            let (x, y) = (i % probe.width(), i / probe.width());
            let d = probe.direction(x, y);
            let cos = (0..3).map(|c| n[c] * d[c]).sum::<f64>().max(0.0);
            f64::from(probe.rgb()[i][0]) * cos * probe.solid_angle(y)
        };
        (0..probe.rgb().len()).map(texel).sum()
    }

    /// Sizes that have no small factor, or few rows, are as good as others. A hemisphere of radiance 1 lights what faces it with pi,
    /// and what stands across it with pi / 2.
    #[test]
    fn a_hemisphere_lights_alike_at_any_size() {
        for height in [2, 6, 50, 129, 254, 509, 514, 1000, 1024] {
            let width = 2 * height;
            let texel = |i: usize| [if i / width < height / 2 { 1.0 } else { 0.0 }; 3];
            let above = Probe::new(height, (0..width * height).map(texel).collect()).unwrap();
            // Of an odd number of rows the middle one is dark, and half of it is above the horizon.
            let low = if height % 2 == 1 { 0.5 * PI / height as f64 } else { 0.0 };
            let (top, side) = (PI * low.cos().powi(2), 0.5 * PI - low - low.sin() * low.cos());
            for rows in [64, 128] {
                let small = above.resized(rows);
                for (n, expected) in
                    [([0.0, 1.0, 0.0], top), ([1.0, 0.0, 0.0], side), ([0.0, 0.0, 1.0], side)]
                {
                    let found = falls(&small, n);
                    assert!(
                        (found / expected - 1.0).abs() < 0.01,
                        "{height} rows as {}: {found}, not {expected}",
                        small.height()
                    );
                }
            }
        }
    }

    #[test]
    fn open_exr_is_read_and_what_is_no_radiance_is_refused_with_its_place() {
        let written = |odd: f32| {
            let picture = image::Rgb32FImage::from_fn(8, 4, |x, y| {
                image::Rgb([x as f32, 0.25 * y as f32, if (x, y) == (5, 2) { odd } else { 1e5 }])
            });
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, image::ImageFormat::OpenExr).unwrap();
            read(bytes.into_inner())
        };
        let probe = written(0.5).unwrap();
        assert_eq!((probe.width(), probe.height()), (8, 4));
        assert_eq!(probe.rgb()[2 * 8 + 5], [5.0, 0.5, 0.5]);
        assert_eq!(probe.rgb()[8 + 7], [7.0, 0.25, 1e5]);
        for odd in [f32::NAN, f32::INFINITY, -1.0] {
            let error = written(odd).unwrap_err().to_string();
            assert!(error.contains("env.hdr") && error.contains("pixel (5, 2)"), "{error}");
        }
    }

    #[test]
    fn texels_cover_the_whole_sphere() {
        let probe = Probe::constant(1.0);
        let sum: f64 = (0..probe.height()).map(|y| probe.solid_angle(y) * probe.width() as f64).sum();
        assert!((sum - 4.0 * PI).abs() < 1e-9);
    }

    #[test]
    fn the_middle_is_behind_the_eye_and_the_top_is_up() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(direction(0.5, 0.5), [0.0, 0.0, 1.0]));
        assert!(near(direction(0.0, 0.5), [0.0, 0.0, -1.0]));
        assert!(near(direction(0.25, 0.5), [1.0, 0.0, 0.0]));
        assert!(near(direction(0.1, 0.0), [0.0, 1.0, 0.0]));
    }

    #[test]
    fn real_panoramas_open() {
        let Some(data) = testing::needs::data() else { return };
        for name in ["studio.hdr", "venice.hdr"] {
            let probe = Probe::read(&data.join("env").join(name)).unwrap();
            assert_eq!((probe.width(), probe.height()), (1024, 512));
            let small = probe.resized(128);
            assert_eq!((small.width(), small.height()), (256, 128));
            assert!(small.rgb().iter().flatten().any(|v| *v > 1.0));
        }
    }
}
