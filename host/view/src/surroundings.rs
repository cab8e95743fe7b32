//! A sheet under a light probe.
//!
//! Problem: each pixel of a bent or near sheet has its own normal and its own direction to the eye, and sums over all texels
//! of a panorama take a second for some hundred of them.
//! Method: reflectance is linear in the curves, so the light of the panorama is gathered into the entries of a table of the
//! half angle, and its product with each curve is what a place of only that curve sends to the eye. That is done at the
//! nodes of a grid over the sheet, and pixels read between them. The panorama is a quadtree; a node stands for its
//! texels where half vectors and cosine hardly change over it. A flat sheet and a far eye need one node.
//! Cost: some hundred nodes of the tree for each of the [`NODES`]^2 nodes of the grid.
//! Error: within 1 % of the sum over all texels for paper and for foil, at nodes and between them (test).
//! Limits: highlights narrower than a texel show the texels.

use std::f64::consts::PI;

use observe::Observer;
use press::preview::{ENTRIES, Fine, Probe};
use rayon::prelude::*;

use crate::footprint::{Corners, Weights};
use crate::light::{Curves, Sums};
use crate::lit::{LANES, Lit};
use crate::ray::{BLOCK, Hits};
use crate::scene::{Frame, Scene, dot, unit};

/// Nodes along each side of the grid.
const NODES: usize = 65;

/// The most rows of a panorama that are used: texels of 1.4 degrees.
const ROWS: usize = 128;

/// A node of the tree replaces its texels if their half vectors spread over no more than this fraction of their angle to the
/// normal.
const OPENING: f32 = 0.12;

/// Sine of the reach of the largest nodes that may cross the horizon.
const HORIZON: f32 = 0.1;

/// What each curve sends to the eye under a probe, all over a sheet.
pub(crate) struct Field {
    nodes: usize,
    /// Values of a node after another: for each channel one of every curve.
    values: Vec<[f32; LANES]>,
}

impl Field {
    /// Gathers light on the grid.
    pub fn new(probe: &Probe, scene: &Scene, lit: &Lit, curves: &Curves, observer: &dyn Observer) -> Field {
        let probe = probe.resized(ROWS);
        let frame = Frame::new(&scene.pose);
        let tree = Tree::new(&probe, &frame);
        let towards = frame.in_sheet(unit(scene.camera.towards));
        let nodes = if scene.pose.curl.is_none() && scene.camera.distance.is_none() { 1 } else { NODES };
        observer.begin("lighting by the probe", nodes as u64);
        let rows: Vec<Vec<[f32; LANES]>> = (0..nodes)
            .into_par_iter()
            .map(|j| {
                let mut light = vec![[0.0f32; 3]; ENTRIES];
                let mut row = Vec::with_capacity(nodes * 3 * lit.stride / LANES);
                for i in 0..nodes {
                    let part = |k: usize| if nodes == 1 { 0.0 } else { k as f64 / (nodes - 1) as f64 - 0.5 };
                    let (s, y) = (part(i) * lit.size[0], -part(j) * lit.size[1]);
                    let (at, normal) = match scene.pose.curl {
                        Some(r) => {
                            let (sin, cos) = (s / r).sin_cos();
                            ([r * sin, y, r * (cos - 1.0)], [sin, 0.0, cos])
                        }
                        None => ([s, y, 0.0], [0.0, 0.0, 1.0]),
                    };
                    let view = match scene.camera.distance {
                        Some(d) => unit(std::array::from_fn(|c| d * towards[c] - at[c])),
                        None => towards,
                    };
                    light.fill([0.0; 3]);
                    tree.gather(
                        normal.map(|c| c as f32),
                        view.map(|c| c as f32),
                        &curves.fine,
                        OPENING,
                        &mut light,
                    );
                    row.extend(curves.product(&light));
                }
                observer.advance(1);
                row
            })
            .collect();
        observer.end();
        Field { nodes, values: rows.concat() }
    }

    /// Adds what pixels with these weights send to the eye.
    #[inline(always)]
    pub fn shade(&self, hits: &Hits, weights: &Weights, sums: &mut Sums) {
        let mut corners = Corners::default();
        corners.find(&hits.place, self.nodes, self.nodes, true);
        let groups = weights.values.len() / BLOCK;
        let step = 3 * groups;
        let [across, down] = corners.next.map(|next| next * step);
        let weights = weights.values.chunks_exact(groups);
        for (i, (light, weights)) in sums.lanes.iter_mut().zip(weights).enumerate() {
            if hits.covered[i] > 0.0 {
                let (right, below) = (corners.parts[0][i], corners.parts[1][i]);
                let top = &self.values[corners.first[i] as usize * step..];
                let bottom = &top[down..];
                let (a, b) = (&top[..step], &top[across..][..step]);
                let (c, d) = (&bottom[..step], &bottom[across..][..step]);
                for (channel, light) in light.iter_mut().enumerate() {
                    let mut sum = *light;
                    for (k, w) in weights.iter().enumerate() {
                        let k = channel * groups + k;
                        let (a, b, c, d) = (a[k], b[k], c[k], d[k]);
                        for l in 0..LANES {
                            let (top, bottom) = (a[l] + right * (b[l] - a[l]), c[l] + right * (d[l] - c[l]));
                            sum[l] += w[l] * (top + below * (bottom - top));
                        }
                    }
                    *light = sum;
                }
            }
        }
    }
}

/// A texel, or a group of them.
struct Node {
    /// Unit direction, weighted by radiance.
    towards: [f32; 3],
    /// Sum of radiance times solid angle.
    light: [f32; 3],
    /// Greatest distance between `towards` and the node's corners; 0 for single texels.
    reach: f32,
    /// The node after this one's descendants.
    next: u32,
}

/// A quadtree of nodes in the axes of the sheet, each followed by its descendants.
struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    fn new(probe: &Probe, frame: &Frame) -> Tree {
        let mut tree = Tree { nodes: Vec::with_capacity(probe.rgb().len() * 4 / 3 + 64) };
        tree.add(probe, frame, [0, probe.width()], [0, probe.height()]);
        tree
    }

    /// Adds the node of columns `x` and rows `y` (start, end) with its descendants. Each step halves the longer side.
    fn add(&mut self, probe: &Probe, frame: &Frame, x: [usize; 2], y: [usize; 2]) {
        let (mut light, mut mean, mut total) = ([0.0f64; 3], [0.0f64; 3], 0.0);
        for row in y[0]..y[1] {
            let omega = probe.solid_angle(row);
            for column in x[0]..x[1] {
                let texel = probe.rgb()[row * probe.width() + column].map(f64::from);
                let d = probe.direction(column, row);
                // Black texels weigh a little, because a dark node needs a direction, too.
                let weight = omega * (texel.iter().sum::<f64>() + 1e-9);
                total += weight;
                for c in 0..3 {
                    light[c] += omega * texel[c];
                    mean[c] += weight * d[c];
                }
            }
        }
        let length = dot(mean, mean).sqrt();
        let towards = if length > 1e-12 * total { unit(mean) } else { [0.0, 1.0, 0.0] };
        let single = x[1] - x[0] == 1 && y[1] - y[0] == 1;
        let mut reach = 0.0f64;
        // Directions may cancel; such a node is always opened.
        if !single && length < 0.3 * total {
            reach = 2.0;
        } else if !single {
            for (i, j) in (0..25).map(|n| (n % 5, n / 5)) {
                let part = |r: [usize; 2], k: usize, n: usize| {
                    (r[0] as f64 + (r[1] - r[0]) as f64 * k as f64 / 4.0) / n as f64
                };
                let (phi, t) = (2.0 * PI * part(x, i, probe.width()), PI * part(y, j, probe.height()));
                let d = [phi.sin() * t.sin(), t.cos(), -phi.cos() * t.sin()];
                let off: [f64; 3] = std::array::from_fn(|c| d[c] - towards[c]);
                reach = reach.max(dot(off, off).sqrt());
            }
        }
        let here = self.nodes.len();
        self.nodes.push(Node {
            towards: frame.in_sheet(towards).map(|c| c as f32),
            light: light.map(|v| v as f32),
            reach: reach as f32,
            next: 0,
        });
        if !single {
            let middle = |r: [usize; 2]| r[0] + (r[1] - r[0]) / 2;
            if x[1] - x[0] >= y[1] - y[0] {
                let m = middle(x);
                self.add(probe, frame, [x[0], m], y);
                self.add(probe, frame, [m, x[1]], y);
            } else {
                let m = middle(y);
                self.add(probe, frame, x, [y[0], m]);
                self.add(probe, frame, x, [m, y[1]]);
            }
        }
        self.nodes[here].next = self.nodes.len() as u32;
    }

    /// Adds the light on a normal, as seen from `view`, to the entries of a table.
    fn gather(&self, n: [f32; 3], view: [f32; 3], fine: &Fine, opening: f32, light: &mut [[f32; 3]]) {
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            let l = node.towards;
            let cos = n[0] * l[0] + n[1] * l[1] + n[2] * l[2];
            if cos <= -node.reach {
                i = node.next as usize;
                continue;
            }
            let h: [f32; 3] = std::array::from_fn(|c| l[c] + view[c]);
            let length = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt().max(1e-6);
            let d: [f32; 3] = std::array::from_fn(|c| h[c] / length - n[c]);
            let chord = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            // The cosine has a kink at the horizon, so only small nodes may cross it. Half vectors turn by the reach over
            // the length of the sum.
            let horizon = cos > node.reach || node.reach < HORIZON;
            if node.reach > 0.0 && !(horizon && node.reach <= opening * chord * length) {
                i += 1;
                continue;
            }
            if cos > 0.0 {
                let (k, s) = fine.at(chord);
                let (near, far) = (cos * (1.0 - s), cos * s);
                (0..3).for_each(|c| {
                    light[k][c] += near * node.light[c];
                    light[k + 1][c] += far * node.light[c];
                });
            }
            i = node.next as usize;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::tests::uniform;
    use crate::render::Renderer;
    use crate::scene::{Camera, Pose, direction};
    use observe::Silent;

    /// The sum over all texels, in f64 and straight from the curve.
    fn by_hand(f: impl Fn(f64) -> f64, probe: &Probe, n: [f64; 3], v: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        for y in 0..probe.height() {
            for x in 0..probe.width() {
                let l = probe.direction(x, y);
                let h = unit(std::array::from_fn(|c| l[c] + v[c]));
                let radiance = f64::from(probe.rgb()[y * probe.width() + x][0]);
                sum += radiance
                    * probe.solid_angle(y)
                    * dot(n, l).max(0.0)
                    * f(dot(n, h).clamp(-1.0, 1.0).acos());
            }
        }
        sum
    }

    #[test]
    fn a_bent_sheet_near_the_eye_gets_the_light_of_all_texels() {
        let probe = Probe::studio(64);
        for alpha in [0.06, 0.3] {
            let f = |t: f64| 0.05 + 0.4 * inks::ggx::lobe(t, alpha);
            let lit = uniform([0.1, 0.1], |t| [f(t); 3]);
            let r = 0.08;
            let scene = Scene {
                camera: Camera {
                    towards: direction(20.0, 10.0),
                    distance: Some(0.5),
                    middle: [0.0; 2],
                    height: 0.12,
                },
                pose: Pose { turn: 0.2, tip: 0.1, curl: Some(r) },
                lights: Vec::new(),
                probe: Some(probe.clone()),
            };
            let frame = Frame::new(&scene.pose);
            let side = 60;
            let picture = Renderer::new(&lit).render(&scene, side, side, &Silent).unwrap();
            let eye = frame.in_sheet(direction(20.0, 10.0).map(|c| 0.5 * c));
            let back = |v: [f64; 3]| -> [f64; 3] {
                let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| frame.in_sheet(e));
                std::array::from_fn(|c| dot(axes[c], v))
            };
            let [right, up] = crate::scene::right_and_up(direction(20.0, 10.0)).map(|a| frame.in_sheet(a));
            let mut worst = 0.0f64;
            let mut compared = 0;
            for (x, y) in [(30, 30), (22, 17), (37, 40), (25, 33), (40, 21)] {
                let [found, _, _, covered] = picture.pixels[y * side + x];
                if covered < 1.0 {
                    continue;
                }
                let step = 0.12 / side as f64;
                let (px, py) = ((x as f64 + 0.5 - 30.0) * step, (30.0 - y as f64 - 0.5) * step);
                let d: [f64; 3] = std::array::from_fn(|c| px * right[c] + py * up[c] - eye[c]);
                let (a, b) = (d[0] * d[0] + d[2] * d[2], eye[0] * d[0] + (eye[2] + r) * d[2]);
                let c = eye[0] * eye[0] + (eye[2] + r).powi(2) - r * r;
                let t = (-b - (b * b - a * c).sqrt()) / a;
                let at: [f64; 3] = std::array::from_fn(|c| eye[c] + t * d[c]);
                let n = back([at[0] / r, 0.0, (at[2] + r) / r]);
                let v = unit(back(d.map(|c| -c)));
                let expected = by_hand(f, &probe, n, v);
                worst = worst.max((f64::from(found) / expected - 1.0).abs());
                compared += 1;
            }
            assert!(compared >= 3 && worst < 0.01, "alpha {alpha}: {compared} places, worst {worst}");
        }
    }

    /// In a furnace of radiance 1 a matt surface sends its albedo to the eye.
    #[test]
    fn a_furnace_gives_back_the_albedo() {
        let lit = uniform([0.1, 0.1], |_| [0.6 / PI, 0.3 / PI, 0.1 / PI]);
        let scene = Scene {
            camera: Camera::whole(direction(30.0, 0.0), None, [0.1, 0.1], 1.0),
            pose: Pose::default(),
            lights: Vec::new(),
            probe: Some(Probe::constant(1.0)),
        };
        let picture = Renderer::new(&lit).render(&scene, 9, 9, &Silent).unwrap();
        let [r, g, b, _] = picture.pixels[40];
        for (found, expected) in [(r, 0.6), (g, 0.3), (b, 0.1)] {
            assert!((found / expected - 1.0).abs() < 0.005, "{found}, not {expected}");
        }
    }
}
