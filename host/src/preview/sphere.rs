//! A material as a ball, seen from far away, under one far light or under a light probe.
//!
//! Geometry: the eye looks along -z from infinity, the ball fills the picture, x is right, y is up; the normal at
//! (x, y) is (x, y, sqrt(1 - x^2 - y^2)).
//! One light: `f(theta_h) cos_i`, averaged over [`SUBSAMPLES`]^2 places of a pixel. Light at the eye gives
//! theta_h = asin r: the curve itself.
//! Probe: the sum over texels of `f(theta_h) cos_i L dOmega` is linear in the curve, so each pixel's light is
//! gathered once, as the weight of every sample of the curve, and all materials are that row times their own.
//! Texels are a quadtree; a node stands for its texels where the curve and the cosine cannot change much over it.
//! Cost: a pass over some hundreds of nodes for each pixel, whatever the number of materials.
//! Limits: highlights narrower than a texel show the texels; 128 rows serve the sharpest foil.

use inks::Curve;
use rayon::prelude::*;

use crate::brdf::{Space, Table};
use crate::observe::Observer;

use super::flat::bracket;
use super::probe::{Probe, direction};
use super::{PreviewError, Radiance, check_size};

/// Places along each axis of a pixel at which coverage, and light from one direction, are taken.
pub const SUBSAMPLES: usize = 4;

/// A node is taken whole when its half vectors stay within this share of their angle to the normal. Tested to
/// keep every pixel within 1 % of the sum over single texels, for the sharpest foil and for paper.
const OPENING: f32 = 0.1;

/// Steps of the table from the chord between normal and half vector to a place among the curve's angles.
const STEPS: usize = 8192;

/// A ball of `curve` under light from far away in direction `light` (any length), irradiance 1 where the surface
/// faces it, as a `size` x `size` picture.
pub fn under_light(curve: &Curve, light: [f64; 3], size: usize) -> Result<Radiance, PreviewError> {
    check_size(size, size)?;
    let length = light.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(length.is_finite() && length > 1e-9) {
        return Err(PreviewError::Light { light: 0, problem: "its direction must be finite and not zero" });
    }
    let l = light.map(|v| v / length);
    let h = half(l);
    let mut pixels = vec![[0.0f32; 4]; size * size];
    pixels.par_chunks_exact_mut(size).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = [0.0; 4];
            subsamples(size, x, y, |nx, ny| {
                let n = [nx, ny, (1.0 - nx * nx - ny * ny).max(0.0).sqrt()];
                let cos_i = dot(n, l).max(0.0);
                // asin of the half chord: exact where the cosine has no digits left.
                let theta = 2.0 * (0.5 * distance(n, h)).min(1.0).asin();
                let f = curve.at(theta);
                (0..3).for_each(|c| sum[c] += f[c] * cos_i);
                sum[3] += 1.0;
            });
            *pixel = sum.map(|s| (s / (SUBSAMPLES * SUBSAMPLES) as f64) as f32);
        }
    });
    Ok(Radiance { width: size, height: size, pixels })
}

/// Balls of `rows` (reflectance in the half-angle space `space`), each by itself under `probe`.
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
    let tree = Tree::new(probe);
    let places = Places::new(angles);
    let columns = space.columns();
    let lines: Vec<Vec<[f32; 4]>> = (0..size)
        .into_par_iter()
        .map_init(
            || vec![0.0f64; columns],
            |light, y| {
                let mut line = vec![[0.0f32; 4]; size * rows.len()];
                for x in 0..size {
                    let (mut nx, mut ny, mut count) = (0.0, 0.0, 0);
                    subsamples(size, x, y, |sx, sy| {
                        nx += sx;
                        ny += sy;
                        count += 1;
                    });
                    if count == 0 {
                        continue;
                    }
                    let (nx, ny) = (nx / f64::from(count), ny / f64::from(count));
                    let n = [nx, ny, (1.0 - nx * nx - ny * ny).max(0.0).sqrt()];
                    light.fill(0.0);
                    tree.gather(n.map(|v| v as f32), &places, OPENING, light);
                    let covered = f64::from(count) / (SUBSAMPLES * SUBSAMPLES) as f64;
                    for (row, line) in rows.rows().zip(line.chunks_exact_mut(size)) {
                        let mut sum = [0.0; 3];
                        for (light, f) in light.chunks_exact(3).zip(row.chunks_exact(3)) {
                            (0..3).for_each(|c| sum[c] += light[c] * f[c]);
                        }
                        let [r, g, b] = sum.map(|s| (s * covered) as f32);
                        line[x] = [r, g, b, covered as f32];
                    }
                }
                observer.advance(1);
                line
            },
        )
        .collect();
    observer.end();
    let ball = |i: usize| Radiance {
        width: size,
        height: size,
        pixels: lines.iter().flat_map(|line| line[i * size..][..size].iter().copied()).collect(),
    };
    Ok((0..rows.len()).map(ball).collect())
}

/// Calls `inside` with every sub-sample of pixel (x, y) that lies on the ball.
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

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    dot(d, d).sqrt()
}

/// The half vector of a unit direction and the eye; any normal across the view for light from straight behind.
fn half(l: [f64; 3]) -> [f64; 3] {
    let h = [l[0], l[1], l[2] + 1.0];
    let length = dot(h, h).sqrt();
    if length < 1e-6 { [1.0, 0.0, 0.0] } else { h.map(|v| v / length) }
}

/// From the chord between normal and half vector to a fractional place among the curve's angles.
struct Places {
    table: Vec<f32>,
}

impl Places {
    fn new(angles: &[f64]) -> Places {
        // Chord / sqrt 2 = sqrt(1 - cos theta_h): even steps of it are dense where curves are steep.
        let place = |step: usize| {
            let chord = std::f64::consts::SQRT_2 * step as f64 / STEPS as f64;
            let (i, _, s) = bracket(angles, 2.0 * (0.5 * chord).min(1.0).asin());
            (i as f64 + s) as f32
        };
        Places { table: (0..=STEPS).map(place).collect() }
    }

    /// The sample below and how far it is to the next; the next exists wherever that is above 0.
    fn at(&self, chord: f32) -> (usize, f32) {
        let step = (chord * (STEPS as f32 * std::f32::consts::FRAC_1_SQRT_2)).min(STEPS as f32 - 0.5);
        let (k, s) = (step as usize, step.fract());
        let place = self.table[k] + s * (self.table[k + 1] - self.table[k]);
        (place as usize, place.fract())
    }
}

/// Texels of a probe and groups of them.
struct Node {
    /// Unit direction of the light, weighted by radiance.
    towards: [f32; 3],
    /// Its half vector with the eye.
    half: [f32; 3],
    /// Sum of radiance times solid angle.
    light: [f32; 3],
    /// Greatest sine of the angle between `towards` and the node's corners.
    reach: f32,
    /// Greatest distance between `half` and the half vectors at the corners; 0 for single texels.
    spread: f32,
    /// The node after this one's descendants.
    next: u32,
}

/// A quadtree of nodes, each followed by its descendants.
struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    fn new(probe: &Probe) -> Tree {
        let mut tree = Tree { nodes: Vec::with_capacity(probe.rgb().len() * 4 / 3 + 64) };
        tree.add(probe, [0, probe.width()], [0, probe.height()]);
        tree
    }

    /// Adds the texels of columns `x` and rows `y` (start, end) and everything below; recursion halves the
    /// longer side each time, so its depth is the logarithm of the number of texels.
    fn add(&mut self, probe: &Probe, x: [usize; 2], y: [usize; 2]) {
        let (mut light, mut mean, mut total) = ([0.0f64; 3], [0.0f64; 3], 0.0);
        for row in y[0]..y[1] {
            let omega = probe.solid_angle(row);
            for column in x[0]..x[1] {
                let texel = probe.rgb()[row * probe.width() + column].map(f64::from);
                let d = probe.direction(column, row);
                // Black texels count a little: a dark node still needs a direction.
                let weight = omega * (texel.iter().sum::<f64>() + 1e-9);
                total += weight;
                for c in 0..3 {
                    light[c] += omega * texel[c];
                    mean[c] += weight * d[c];
                }
            }
        }
        let single = x[1] - x[0] == 1 && y[1] - y[0] == 1;
        let length = dot(mean, mean).sqrt();
        // Directions that cancel leave none; such a node is always opened, so any will do.
        let scattered = length < 0.3 * total;
        let towards = if length > 1e-12 * total { mean.map(|v| v / length) } else { [0.0, 1.0, 0.0] };
        let h = half(towards);
        let (mut reach, mut spread) = (0.0f64, 0.0f64);
        if !single {
            for j in 0..=4 {
                for i in 0..=4 {
                    let part = |r: [usize; 2], k: usize, n: usize| {
                        (r[0] as f64 + (r[1] - r[0]) as f64 * k as f64 / 4.0) / n as f64
                    };
                    let d = direction(part(x, i, probe.width()), part(y, j, probe.height()));
                    reach = reach.max(distance(d, towards));
                    spread = spread.max(distance(half(d), h));
                }
            }
            if scattered {
                (reach, spread) = (2.0, 2.0);
            }
        }
        let here = self.nodes.len();
        self.nodes.push(Node {
            towards: towards.map(|v| v as f32),
            half: h.map(|v| v as f32),
            light: light.map(|v| v as f32),
            reach: reach as f32,
            spread: spread as f32,
            next: 0,
        });
        if !single {
            let middle = |r: [usize; 2]| r[0] + (r[1] - r[0]) / 2;
            if x[1] - x[0] >= y[1] - y[0] {
                let m = middle(x);
                self.add(probe, [x[0], m], y);
                self.add(probe, [m, x[1]], y);
            } else {
                let m = middle(y);
                self.add(probe, x, [y[0], m]);
                self.add(probe, x, [m, y[1]]);
            }
        }
        self.nodes[here].next = self.nodes.len() as u32;
    }

    /// Adds the light on normal `n` to the samples of a curve, `light[3 * sample + channel]`.
    fn gather(&self, n: [f32; 3], places: &Places, opening: f32, light: &mut [f64]) {
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            let cos_i = n[0] * node.towards[0] + n[1] * node.towards[1] + n[2] * node.towards[2];
            if cos_i <= -node.reach {
                i = node.next as usize;
                continue;
            }
            let d = [n[0] - node.half[0], n[1] - node.half[1], n[2] - node.half[2]];
            let chord = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            // Across the horizon the cosine has a kink, which only small nodes may straddle.
            let horizon = cos_i > node.reach || node.reach < 0.05;
            if node.spread > 0.0 && !(horizon && node.spread <= opening * chord) {
                i += 1;
                continue;
            }
            if cos_i > 0.0 {
                let (k, s) = places.at(chord);
                let near = f64::from(cos_i * (1.0 - s));
                let far = f64::from(cos_i * s);
                for c in 0..3 {
                    light[3 * k + c] += near * f64::from(node.light[c]);
                }
                if far > 0.0 {
                    for c in 0..3 {
                        light[3 * k + 3 + c] += far * f64::from(node.light[c]);
                    }
                }
            }
            i = node.next as usize;
        }
    }
}
