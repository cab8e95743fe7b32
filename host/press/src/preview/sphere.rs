//! A material as a ball, seen from far away, under one distant light or under a light probe.
//!
//! Geometry: the eye looks along -z from infinity, the ball fills the picture, x points right, y points up. The normal at
//! (x, y) is (x, y, sqrt(1 - x^2 - y^2)).
//! One light: `f(theta_h) cos_i`, averaged over `SUBSAMPLES`^2 places of a pixel. A light at the eye gives
//! theta_h = asin r, which is the curve itself.
//! Probe: the sum over texels of `f(theta_h) cos_i L dOmega` is linear in the curve. So the light of each pixel is gathered
//! once, as a weight for every entry of a fine table of the curve (`fine`), and each material is the product of these weights
//! and its own table.
//! Cost: see `LightTree` for the light, and a product of tables for each pixel and material.
//! Limits: highlights narrower than a texel show the texels; 128 rows are enough for the sharpest foil.

use inks::Curve;
use rayon::prelude::*;

use appearance::brdf::{Space, Table};
use appearance::wide::wide;
use observe::Observer;

use super::error::{PreviewError, check_size};
use super::fine::{ENTRIES, Fine};
use super::light_tree::{Gathered, LightTree, NORMALS, distance, dot, half};
use super::probe::Probe;
use super::radiance::Radiance;

/// Places along each axis of a pixel at which coverage and light from one direction are sampled.
const SUBSAMPLES: usize = 4;

/// Pixels whose light is gathered together: across and down.
const TILE: [usize; 2] = [4, NORMALS / 4];

/// A `size` x `size` picture of a ball of `curve` under a distant light in direction `light` (any length), with irradiance 1
/// where the surface faces it.
///
/// # Errors
/// A size out of range, or a direction that is zero or not finite.
pub fn under_light(curve: &Curve, light: [f64; 3], size: usize) -> Result<Radiance, PreviewError> {
    check_size(size, size)?;
    let length = light.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 1e-9) {
        return Err(PreviewError::Light { light: 0, problem: "its direction must be finite and not zero" });
    }
    let l = light.map(|v| v / length);
    let h = half(l);
    let fine = Fine::new();
    let table = fine.table(curve);
    let mut pixels = vec![[0.0f32; 4]; size * size];
    pixels.par_chunks_exact_mut(size).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = [0.0; 4];
            subsamples(size, x, y, |nx, ny| {
                let n = [nx, ny, (1.0 - nx * nx - ny * ny).max(0.0).sqrt()];
                let cos_i = dot(n, l).max(0.0);
                // The chord stays exact where the cosine runs out of digits.
                let (k, s) = fine.at(distance(n, h) as f32);
                let s = f64::from(s);
                for c in 0..3 {
                    let (near, far) = (f64::from(table[k][c]), f64::from(table[k + 1][c]));
                    sum[c] += (near + s * (far - near)) * cos_i;
                }
                sum[3] += 1.0;
            });
            *pixel = sum.map(|s| (s / (SUBSAMPLES * SUBSAMPLES) as f64) as f32);
        }
    });
    Ok(Radiance { width: size, height: size, pixels })
}

/// Pictures of balls under `probe`, one for each of `rows` (reflectance in the half-angle space `space`).
///
/// # Errors
/// A size out of range, a space without half angles, or rows of another space.
pub fn under_probe(
    space: &Space,
    rows: &Table,
    probe: &Probe,
    size: usize,
    observer: &dyn Observer,
) -> Result<Vec<Radiance>, PreviewError> {
    check_size(size, size)?;
    let angles = space.angles();
    if angles.is_empty() {
        return Err(PreviewError::NoAngles { columns: space.columns() });
    }
    if rows.columns() != space.columns() {
        return Err(PreviewError::Shape {
            what: "columns of the materials' reflectance",
            expected: space.columns(),
            found: rows.columns(),
        });
    }
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    observer.begin("lighting material balls", size as u64);
    let tree = LightTree::new(probe);
    let fine = Fine::new();
    let tables: Vec<Planes> = rows.rows().map(|row| Planes::new(&fine.table(&space.curve(row)))).collect();
    let places: Vec<usize> = (0..size).step_by(TILE[1]).collect();
    let bands: Vec<Vec<[f32; 4]>> = places
        .into_par_iter()
        .map_init(Gathered::default, |gathered, top| {
            let lines = TILE[1].min(size - top);
            let mut band = vec![[0.0f32; 4]; lines * size * rows.len()];
            wide(
                #[inline(always)]
                || {
                    for left in (0..size).step_by(TILE[0]) {
                        let mut pixels = [(0, 0.0); NORMALS];
                        let mut normals = [[0.0; 3]; NORMALS];
                        let mut count = 0;
                        for (x, y) in
                            (0..lines).flat_map(|y| (left..size.min(left + TILE[0])).map(move |x| (x, y)))
                        {
                            if let Some((normal, covered)) = facing(size, x, top + y) {
                                pixels[count] = (y * size + x, covered);
                                normals[count] = normal;
                                count += 1;
                            }
                        }
                        tree.gather(&normals[..count], &fine, gathered);
                        for (k, &(pixel, covered)) in pixels[..count].iter().enumerate() {
                            let light = Planes::new(gathered.of(k));
                            for (table, ball) in tables.iter().zip(band.chunks_exact_mut(lines * size)) {
                                let [r, g, b] = light.product(table).map(|sum| sum * covered);
                                ball[pixel] = [r, g, b, covered];
                            }
                        }
                    }
                },
            );
            observer.advance(lines as u64);
            band
        })
        .collect();
    observer.end();
    let ball = |i: usize| {
        let parts = bands.iter().flat_map(|band| band.chunks_exact(band.len() / rows.len()).nth(i));
        Radiance { width: size, height: size, pixels: parts.flatten().copied().collect() }
    };
    Ok((0..rows.len()).map(ball).collect())
}

/// The mean normal of what a pixel shows of the ball, and the part of the pixel that is covered; `None` beside the ball.
fn facing(size: usize, x: usize, y: usize) -> Option<([f32; 3], f32)> {
    let (mut nx, mut ny, mut count) = (0.0, 0.0, 0u8);
    subsamples(size, x, y, |sx, sy| {
        nx += sx;
        ny += sy;
        count += 1;
    });
    if count == 0 {
        return None;
    }
    let (nx, ny) = (nx / f64::from(count), ny / f64::from(count));
    let normal = [nx, ny, (1.0 - nx * nx - ny * ny).max(0.0).sqrt()].map(|v| v as f32);
    Some((normal, f32::from(count) / (SUBSAMPLES * SUBSAMPLES) as f32))
}

/// Calls `inside` for every sub-sample of pixel (x, y) on the ball.
fn subsamples(size: usize, x: usize, y: usize, mut inside: impl FnMut(f64, f64)) {
    let at =
        |i: usize, j: usize| ((i * SUBSAMPLES + j) as f64 + 0.5) / (size * SUBSAMPLES) as f64 * 2.0 - 1.0;
    for j in 0..SUBSAMPLES {
        for i in 0..SUBSAMPLES {
            let (nx, ny) = (at(x, i), -at(y, j));
            if nx * nx + ny * ny < 1.0 {
                inside(nx, ny);
            }
        }
    }
}

/// A table with each channel by itself, so that products run in lanes.
struct Planes([[f32; ENTRIES]; 3]);

const LANES: usize = 8;

impl Planes {
    fn new<const N: usize>(entries: &[[f32; N]]) -> Planes {
        let mut planes = Planes([[0.0; ENTRIES]; 3]);
        for (k, entry) in entries.iter().enumerate() {
            (0..3).for_each(|c| planes.0[c][k] = entry[c]);
        }
        planes
    }

    /// The sum over entries of light times reflectance, in a fixed order.
    #[inline(always)]
    fn product(&self, other: &Planes) -> [f32; 3] {
        std::array::from_fn(|c| {
            let mut sums = [0.0; LANES];
            let (a, b) = (self.0[c].as_chunks::<LANES>().0, other.0[c].as_chunks::<LANES>().0);
            for (a, b) in a.iter().zip(b) {
                (0..LANES).for_each(|l| sums[l] += a[l] * b[l]);
            }
            sums.iter().sum()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use std::f64::consts::PI;

    fn lobe(diffuse: f64, f0: f64, alpha: f64) -> impl Fn(f64) -> [f64; 3] {
        move |t| {
            let specular = f0 * inks::ggx::lobe(t, alpha);
            [diffuse / PI + specular, 0.8 * diffuse / PI + specular, 0.3 * diffuse / PI + 0.7 * specular]
        }
    }

    fn table(space: &Space, curves: &[&dyn Fn(f64) -> [f64; 3]]) -> Table {
        let mut rows = Table::new(space.columns());
        curves.iter().for_each(|f| rows.push(&space.row(&Curve::sampled(space.angles(), f))));
        rows
    }

    /// `f(asin r) cos(asin r)`, averaged over a pixel by a much finer rule than the renderer's.
    #[test]
    fn a_ball_lit_from_the_eye_shows_its_curve() {
        let (size, fine) = (48, 24);
        let f = lobe(0.3, 0.5, 0.3);
        let grid: Vec<f64> = (0..=2000).map(|i| PI / 2.0 * f64::from(i) / 2000.0).collect();
        let ball = under_light(&Curve::sampled(&grid, &f), [0.0, 0.0, 3.0], size).unwrap();
        for (i, pixel) in ball.pixels.iter().enumerate().filter(|(_, p)| p[3] == 1.0) {
            let mut expected = 0.0;
            for k in 0..fine * fine {
                let at = |p: usize, s: usize| {
                    (p as f64 + (s as f64 + 0.5) / fine as f64) / size as f64 * 2.0 - 1.0
                };
                let r = at(i % size, k % fine).hypot(at(i / size, k / fine)).min(1.0);
                expected += f(r.asin())[0] * r.asin().cos() / (fine * fine) as f64;
            }
            let found = f64::from(pixel[0]);
            // At the rim the curve's own slope has no bound; 0.001 is a hundredth of what the ball reflects there.
            assert!(
                (found - expected).abs() < 0.001 + 0.005 * expected,
                "pixel {i}: {found}, not {expected}"
            );
        }
    }

    /// Every stack of the library from its 32 samples, under a light at the eye, by the lobes themselves; and the narrowest lobe
    /// of a document.
    #[test]
    fn balls_show_the_lobes_of_their_stacks() {
        let (size, space) = (40, Space::half_angle(32));
        let narrow = inks::Lobe { f0: [0.9; 3], alpha: 0.02 };
        let narrow = inks::Lobes { kd: [0.0; 3], entering: 1.0, lobes: vec![narrow] };
        let library = inks::Library::builtin();
        let (mut most, mut rim) = (0.0f64, 0.0f64);
        for lobes in library.entries().iter().filter_map(|e| e.lobes.as_ref()).chain([&narrow]) {
            let ball = under_light(&lobes.curve(space.angles()), [0.0, 0.0, 1.0], size).unwrap();
            for (i, pixel) in ball.pixels.iter().enumerate().filter(|(_, p)| p[3] == 1.0) {
                // By the renderer's own places in a pixel, so that only the curve differs.
                let (mut expected, mut highest) = ([0.0; 3], 0.0f64);
                subsamples(size, i % size, i / size, |x, y| {
                    let theta = x.hypot(y).asin();
                    highest = highest.max(theta);
                    let f = lobes.at(theta);
                    (0..3).for_each(|c| expected[c] += f[c] * theta.cos() / (SUBSAMPLES * SUBSAMPLES) as f64);
                });
                for (&found, expected) in pixel.iter().zip(expected) {
                    let error = (f64::from(found) / expected - 1.0).abs();
                    let kept = if highest < 80f64.to_radians() { &mut most } else { &mut rim };
                    *kept = kept.max(error);
                }
            }
        }
        println!("greatest relative error {most:.5}, at the rim {rim:.5}");
        assert!(most < 0.005 && rim < 0.02, "{most} {rim}");
    }

    /// The mean of `cos theta` over the disc is 2/3.
    #[test]
    fn a_lambertian_ball_lit_from_the_eye_reflects_two_thirds() {
        let white = Curve::sampled(&[0.0, PI / 2.0], |_| [1.0 / PI; 3]);
        let ball = under_light(&white, [0.0, 0.0, 1.0], 200).unwrap();
        let sum = |c: usize| ball.pixels.iter().map(|p| f64::from(p[c])).sum::<f64>();
        assert!((sum(0) / sum(3) * PI - 2.0 / 3.0).abs() < 1e-4);
        assert!((sum(3) / 40_000.0 - PI / 4.0).abs() < 1e-3, "coverage of the disc");
    }

    #[test]
    fn the_highlight_lies_where_the_normal_halves_light_and_eye() {
        let size = 201;
        let shiny = Curve::sampled(
            &(0..400).map(|i| f64::from(i) * 0.0039).collect::<Vec<_>>(),
            lobe(0.0, 0.8, 0.05),
        );
        // 60 degrees to the upper left: the half vector is 30 degrees off the eye, at r = 1/2.
        let (side, front) = (60f64.to_radians().sin() / 2f64.sqrt(), 60f64.to_radians().cos());
        let ball = under_light(&shiny, [-side, side, front], size).unwrap();
        let (at, _) = ball.pixels.iter().enumerate().max_by(|a, b| a.1[0].total_cmp(&b.1[0])).unwrap();
        let (x, y) = (at % size, at / size);
        let expected = 100.0 - 100.5 * 0.5 / 2f64.sqrt();
        assert!((x as f64 - expected).abs() <= 1.0 && (y as f64 - expected).abs() <= 1.0, "({x}, {y})");
    }

    #[test]
    fn a_lambertian_in_a_furnace_reflects_its_albedo() {
        let space = Space::half_angle(16);
        let rows = table(&space, &[&|_| [0.5 / PI, 0.2 / PI, 1.0 / PI]]);
        let ball = &under_probe(&space, &rows, &Probe::constant(2.0), 24, &Silent).unwrap()[0];
        for p in ball.pixels.iter().filter(|p| p[3] == 1.0) {
            for (found, albedo) in p.iter().zip([0.5, 0.2, 1.0]) {
                assert!((found / (2.0 * albedo) - 1.0).abs() < 5e-3, "{found} for {albedo}");
            }
        }
    }

    /// The reflection integral texel by texel, with arc cosines and the lobes themselves.
    fn texel_by_texel(f: &dyn Fn(f64) -> [f64; 3], probe: &Probe, n: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for y in 0..probe.height() {
            for x in 0..probe.width() {
                let l = probe.direction(x, y);
                let cos_i = dot(n, l);
                if cos_i <= 0.0 {
                    continue;
                }
                let h = [l[0], l[1], l[2] + 1.0];
                let f = f((dot(n, h) / dot(h, h).sqrt()).clamp(-1.0, 1.0).acos());
                let light = probe.rgb()[y * probe.width() + x];
                (0..3).for_each(|c| sum[c] += f[c] * cos_i * f64::from(light[c]) * probe.solid_angle(y));
            }
        }
        sum
    }

    #[test]
    fn groups_of_texels_light_a_ball_like_the_texels_themselves() {
        let size = 23;
        let space = Space::half_angle(32);
        let (foil, satin, paper) = (lobe(0.01, 0.9, 0.045), lobe(0.1, 0.5, 0.27), lobe(0.8, 0.04, 0.28));
        let curves: [&dyn Fn(f64) -> [f64; 3]; 3] = [&foil, &satin, &paper];
        let rows = table(&space, &curves);
        let probe = Probe::studio(64);
        let balls = under_probe(&space, &rows, &probe, size, &Silent).unwrap();
        for (ball, f) in balls.iter().zip(curves) {
            for (i, p) in ball.pixels.iter().enumerate().filter(|(_, p)| p[3] == 1.0) {
                let at = |k: usize| (k as f64 + 0.5) / size as f64 * 2.0 - 1.0;
                let (nx, ny) = (at(i % size), -at(i / size));
                let expected = texel_by_texel(f, &probe, [nx, ny, (1.0 - nx * nx - ny * ny).sqrt()]);
                for c in 0..3 {
                    let relative = f64::from(p[c]) / expected[c] - 1.0;
                    assert!(relative.abs() < 0.01, "pixel {i}: {} is {} of it too much", p[c], relative);
                }
            }
        }
    }

    #[test]
    fn balls_do_not_depend_on_the_number_of_threads() {
        let space = Space::half_angle(8);
        let rows = table(&space, &[&lobe(0.2, 0.3, 0.1), &lobe(0.7, 0.04, 0.3)]);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| under_probe(&space, &rows, &Probe::studio(16), 20, &Silent).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn other_tabulations_and_rows_are_refused() {
        let bare = Space::tabulated(&[1.0], &[1.0]).unwrap();
        let error = under_probe(&bare, &Table::new(3), &Probe::constant(1.0), 8, &Silent).unwrap_err();
        assert!(matches!(error, PreviewError::NoAngles { columns: 3 }), "{error}");
        let space = Space::half_angle(4);
        let error = under_probe(&space, &Table::new(3), &Probe::constant(1.0), 8, &Silent).unwrap_err();
        assert!(matches!(error, PreviewError::Shape { expected: 12, found: 3, .. }), "{error}");
        assert!(matches!(
            under_light(&Curve::sampled(&[0.0], |_| [1.0; 3]), [0.0, f64::NAN, 1.0], 8),
            Err(PreviewError::Light { .. })
        ));
    }
}
