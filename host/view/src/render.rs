//! The picture of a lit sheet.
//!
//! Problem: a frame of a million pixels and eight bases must follow a hand, on two cores.
//! Method: a ray through each pixel meets the plane or the cylinder of the sheet in closed form. Its footprint chooses the
//! level of the weight maps, which are read between places and levels (trilinear). All curves lie in one table over the
//! half angle, entry by entry ([`Fine`]), so a light costs one lookup and one product of weights and entries:
//! `L = sum_k w_k f_k(theta_h) E cos_i`. Rows run in parallel. A light probe is integrated on a grid over the sheet
//! ([`Field`](crate::surroundings)).
//! Cost: for each pixel four places of two levels, and two entries of the table for each light.
//! Limits: one bounce and no shadows, which the outside of a cylinder does not need; the picture is filtered alike in all
//! directions, so a sheet seen at a grazing angle is soft across; edges of the sheet are smooth, the silhouette of a bent one
//! is not. The back of a sheet is never seen: all of a bent one lies behind its middle, where [`Scene::check`] wants the eye
//! in front.

use appearance::wide::wide;
use observe::Observer;
use press::preview::{ENTRIES, Fine, LONGEST_SIDE, PreviewError, Radiance};
use rayon::prelude::*;

use crate::error::ViewError;
use crate::lit::{LANES, Lit};
use crate::scene::{Frame, Light, Scene, right_and_up, unit};
use crate::surroundings::Field;

type V = [f32; 3];

/// Renders one [`Lit`] again and again. See the module text.
pub struct Renderer<'a> {
    lit: &'a Lit,
    fine: Fine,
    /// For each entry the three channels, each with a value for every curve.
    table: Vec<f32>,
}

/// A scene in the axes of the sheet.
struct Seen {
    /// The eye, if it is near.
    eye: Option<V>,
    /// Unit direction to the eye from the origin.
    towards: V,
    /// A pixel to the right and up, in metres.
    right: V,
    up: V,
    /// The window's point at the top left corner of the picture.
    corner: V,
    curl: Option<f32>,
    lights: Vec<Light>,
    /// Half the sheet's sides.
    half: [f32; 2],
}

/// Where a ray meets the sheet.
struct Hit {
    at: V,
    normal: V,
    /// Unit direction to the eye.
    view: V,
    /// Place on the sheet, metres right and up of its middle, along the paper.
    place: [f32; 2],
    /// How the place changes from pixel to pixel, across and down.
    steps: [[f32; 2]; 2],
    covered: f32,
}

impl<'a> Renderer<'a> {
    /// Prepares the curves.
    pub fn new(lit: &'a Lit) -> Renderer<'a> {
        let fine = Fine::new();
        let stride = lit.stride;
        let mut table = vec![0.0; ENTRIES * 3 * stride];
        for (k, curve) in lit.curves.iter().enumerate() {
            for (entry, rgb) in fine.table(curve).into_iter().enumerate() {
                for (c, f) in rgb.into_iter().enumerate() {
                    table[(entry * 3 + c) * stride + k] = f;
                }
            }
        }
        Renderer { lit, fine, table }
    }

    /// Renders `width` x `height` pixels.
    ///
    /// # Errors
    /// A scene that cannot be seen ([`Scene::check`]), or a picture that is empty or too large.
    pub fn render(
        &self,
        scene: &Scene,
        width: usize,
        height: usize,
        observer: &dyn Observer,
    ) -> Result<Radiance, ViewError> {
        self.draw(scene, width, height, observer, |_, _| ())
    }

    /// Renders a scene whose window `place` may move.
    fn draw(
        &self,
        scene: &Scene,
        width: usize,
        height: usize,
        observer: &dyn Observer,
        place: impl FnOnce(&mut Seen, [f64; 2]),
    ) -> Result<Radiance, ViewError> {
        scene.check(self.lit.size)?;
        if !(1..=LONGEST_SIDE).contains(&width) || !(1..=LONGEST_SIDE).contains(&height) {
            return Err(PreviewError::Size { width, height }.into());
        }
        let mut seen = Seen::new(scene, self.lit.size, width, height);
        place(&mut seen, self.lit.size);
        let seen = seen;
        let field = scene.probe.as_ref().map(|probe| {
            Field::new(probe, scene, self.lit, &self.fine, |light| self.product(light), observer)
        });
        observer.begin("lighting the sheet", height as u64);
        let mut pixels = vec![[0.0f32; 4]; width * height];
        pixels.par_chunks_exact_mut(width).enumerate().for_each_init(
            || vec![0.0f32; 2 * self.lit.stride],
            |scratch, (y, row)| {
                let (weights, level) = scratch.split_at_mut(self.lit.stride);
                wide(
                    #[inline(always)]
                    || {
                        for (x, out) in row.iter_mut().enumerate() {
                            let Some(hit) = seen.hit(x as f32 + 0.5, y as f32 + 0.5) else { continue };
                            self.weights(&hit, weights, level);
                            let mut rgb = self.shade(&seen, &hit, weights);
                            if let Some(field) = &field {
                                let from = field.at(hit.place, self.lit.size, weights);
                                (0..3).for_each(|c| rgb[c] += from[c]);
                            }
                            let [r, g, b] = rgb.map(|v| v * hit.covered);
                            *out = [r, g, b, hit.covered];
                        }
                    },
                );
                observer.advance(1);
            },
        );
        observer.end();
        Ok(Radiance { width, height, pixels })
    }

    /// Renders the sheet laid flat, `width` x `height` pixels from edge to edge: what the eye of the scene sees of each place,
    /// where the place is on the sheet. For photographs that were laid flat the same way.
    ///
    /// # Errors
    /// Those of [`Renderer::render`]; a sheet that is bent.
    pub fn laid_flat(
        &self,
        scene: &Scene,
        width: usize,
        height: usize,
        observer: &dyn Observer,
    ) -> Result<Radiance, ViewError> {
        if scene.pose.curl.is_some() {
            return Err(ViewError::Pose("only a flat sheet can be laid flat".into()));
        }
        self.draw(scene, width, height, observer, |seen, size| {
            // The window lies in the sheet instead of facing the eye.
            let [w, h] = size.map(|side| side as f32);
            seen.right = [w / width as f32, 0.0, 0.0];
            seen.up = [0.0, h / height as f32, 0.0];
            seen.corner = [-0.5 * w, 0.5 * h, 0.0];
        })
    }

    /// The light of the lights that a place with these weights sends to the eye.
    #[inline(always)]
    fn shade(&self, seen: &Seen, hit: &Hit, weights: &[f32]) -> V {
        let stride = self.lit.stride;
        let mut sum = [0.0; 3];
        for light in &seen.lights {
            let Some((irradiance, chord)) = irradiance(*light, hit) else { continue };
            let (entry, s) = self.fine.at(chord);
            let near = &self.table[entry * 3 * stride..][..6 * stride];
            let (near, far) = near.split_at(3 * stride);
            for (c, sum) in sum.iter_mut().enumerate() {
                let (near, far) = (&near[c * stride..][..stride], &far[c * stride..][..stride]);
                *sum += irradiance * mixed(weights, near, far, s);
            }
        }
        sum
    }

    /// For each channel and curve, the product of light on every entry with the curve.
    fn product(&self, light: &[[f32; 3]]) -> Vec<f32> {
        let stride = self.lit.stride;
        let mut out = vec![0.0; 3 * stride];
        for (light, entry) in light.iter().zip(self.table.chunks_exact(3 * stride)) {
            if *light != [0.0; 3] {
                for (c, (out, f)) in out.chunks_exact_mut(stride).zip(entry.chunks_exact(stride)).enumerate()
                {
                    out.iter_mut().zip(f).for_each(|(out, &f)| *out += light[c] * f);
                }
            }
        }
        out
    }

    /// The mean weights over the footprint of a hit.
    #[inline(always)]
    fn weights(&self, hit: &Hit, out: &mut [f32], scratch: &mut [f32]) {
        let [width, height] = self.lit.size.map(|side| side as f32);
        let first = &self.lit.levels[0];
        let (u, v) = (hit.place[0] / width + 0.5, 0.5 - hit.place[1] / height);
        let length = |[s, y]: [f32; 2]| {
            let (s, y) = (s * first.width as f32 / width, y * first.height as f32 / height);
            s * s + y * y
        };
        let footprint = length(hit.steps[0]).max(length(hit.steps[1]));
        let last = self.lit.levels.len() - 1;
        let lod = if footprint > 1.0 { (0.5 * footprint.log2()).min(last as f32) } else { 0.0 };
        let (below, part) = (lod as usize, lod.fract());
        self.between(below, u, v, out);
        if part > 0.0 && below < last {
            self.between(below + 1, u, v, scratch);
            out.iter_mut().zip(scratch).for_each(|(out, far)| *out += part * (*far - *out));
        }
    }

    /// The weights at a point of a level, between its places.
    #[inline(always)]
    fn between(&self, level: usize, u: f32, v: f32, out: &mut [f32]) {
        let level = &self.lit.levels[level];
        let stride = self.lit.stride;
        let split = |at: f32, side: usize| {
            let at = (at * side as f32 - 0.5).clamp(0.0, (side - 1) as f32);
            let low = at as usize;
            (low, (low + 1).min(side - 1), at - low as f32)
        };
        let ((left, right, across), (top, bottom, down)) = (split(u, level.width), split(v, level.height));
        let place = |x: usize, y: usize| &level.weights[(y * level.width + x) * stride..][..stride];
        let parts =
            [(1.0 - across) * (1.0 - down), across * (1.0 - down), (1.0 - across) * down, across * down];
        let corners = [place(left, top), place(right, top), place(left, bottom), place(right, bottom)];
        let corners = corners.map(|corner| corner.as_chunks::<LANES>().0);
        for (i, out) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            *out = std::array::from_fn(|l| {
                parts[0] * corners[0][i][l]
                    + parts[1] * corners[1][i][l]
                    + parts[2] * corners[2][i][l]
                    + parts[3] * corners[3][i][l]
            });
        }
    }
}

/// The weighted sum of values between two entries.
#[inline(always)]
fn mixed(weights: &[f32], near: &[f32], far: &[f32], s: f32) -> f32 {
    let mut sums = [0.0; LANES];
    let (near, far) = (near.as_chunks::<LANES>().0, far.as_chunks::<LANES>().0);
    for ((w, near), far) in weights.as_chunks::<LANES>().0.iter().zip(near).zip(far) {
        for l in 0..LANES {
            sums[l] += w[l] * (near[l] + s * (far[l] - near[l]));
        }
    }
    sums.iter().sum()
}

/// `E cos_i` of a light on a place that faces it, and the chord between the normal and the half vector.
#[inline(always)]
fn irradiance(light: Light, hit: &Hit) -> Option<(f32, f32)> {
    let (l, falloff) = match light {
        Light::Far(v) => (v.map(|c| c as f32), 1.0),
        Light::Near(at) => {
            let at = at.map(|c| c as f32);
            let to = minus(at, hit.at);
            let square = dot(to, to);
            (scaled(to, 1.0 / square.sqrt()), dot(at, at) / square)
        }
    };
    let cos = dot(hit.normal, l);
    if cos <= 0.0 {
        return None;
    }
    let h: V = std::array::from_fn(|c| l[c] + hit.view[c]);
    let d = minus(scaled(h, 1.0 / dot(h, h).sqrt().max(1e-12)), hit.normal);
    Some((falloff * cos, dot(d, d).sqrt()))
}

impl Seen {
    fn new(scene: &Scene, size: [f64; 2], width: usize, height: usize) -> Seen {
        let frame = Frame::new(&scene.pose);
        let towards = unit(scene.camera.towards);
        let [right, up] = right_and_up(towards).map(|axis| frame.in_sheet(axis));
        let pixel = scene.camera.height / height as f64;
        let [x, y] = scene.camera.middle;
        let (left, top) = (x - 0.5 * width as f64 * pixel, y + 0.5 * height as f64 * pixel);
        let f32s = |v: [f64; 3]| v.map(|c| c as f32);
        let towards = frame.in_sheet(towards);
        let light = |light: &Light| match *light {
            Light::Far(v) => Light::Far(frame.in_sheet(unit(v))),
            Light::Near(at) => Light::Near(frame.in_sheet(at)),
        };
        Seen {
            eye: scene.camera.distance.map(|distance| f32s(towards.map(|c| c * distance))),
            towards: f32s(towards),
            right: f32s(right.map(|c| c * pixel)),
            up: f32s(up.map(|c| c * pixel)),
            corner: f32s(std::array::from_fn(|c| left * right[c] + top * up[c])),
            curl: scene.pose.curl.map(|r| r as f32),
            lights: scene.lights.iter().map(light).collect(),
            half: size.map(|side| 0.5 * side as f32),
        }
    }

    /// Where the ray through a point of the picture (pixels from its top left corner) meets the sheet.
    #[inline(always)]
    fn hit(&self, x: f32, y: f32) -> Option<Hit> {
        let window: V = std::array::from_fn(|c| self.corner[c] + x * self.right[c] - y * self.up[c]);
        let (o, d) = match self.eye {
            Some(eye) => (eye, minus(window, eye)),
            None => (window, self.towards.map(|c| -c)),
        };
        match self.curl {
            None => self.hit_at(o, d, -o[2] / d[2], [0.0, 0.0, 1.0], None),
            Some(r) => {
                let a = d[0] * d[0] + d[2] * d[2];
                let b = o[0] * d[0] + o[2] * d[2] + r * d[2];
                // The axis lies r behind the origin; r squared has cancelled.
                let c = o[0] * o[0] + o[2] * o[2] + 2.0 * o[2] * r;
                let root = (b * b - a * c).sqrt();
                if root.is_nan() || a == 0.0 {
                    return None;
                }
                // The nearer root, by the formula that does not cancel.
                let t = if b < 0.0 { c / (root - b) } else { (-b - root) / a };
                let (px, pz) = (o[0] + t * d[0], o[2] + t * d[2] + r);
                self.hit_at(o, d, t, [px / r, 0.0, pz / r], Some(r * px.atan2(pz)))
            }
        }
    }

    #[inline(always)]
    fn hit_at(&self, o: V, d: V, t: f32, normal: V, along: Option<f32>) -> Option<Hit> {
        if !t.is_finite() || (self.eye.is_some() && t <= 0.0) {
            return None;
        }
        let at: V = std::array::from_fn(|c| o[c] + t * d[c]);
        let facing = dot(normal, d);
        // A step in the picture, moved along the ray into the tangent plane.
        let scale = if self.eye.is_some() { t } else { 1.0 };
        let step = |axis: V, sign: f32| {
            let e = scaled(axis, scale * sign);
            let on = dot(normal, e) / facing;
            let p: V = std::array::from_fn(|c| e[c] - on * d[c]);
            [p[0] * normal[2] - p[2] * normal[0], p[1]]
        };
        let steps = [step(self.right, 1.0), step(self.up, -1.0)];
        let mut place = [along.unwrap_or(at[0]), at[1]];
        let mut covered = 1.0;
        for i in 0..2 {
            // At the silhouette of a bent sheet a step goes to infinity, which must not blur its edge into the air.
            let width =
                (steps[0][i] * steps[0][i] + steps[1][i] * steps[1][i]).sqrt().min(0.1 * self.half[i]);
            covered *= ((self.half[i] - place[i].abs()) / width.max(1e-12) + 0.5).clamp(0.0, 1.0);
            place[i] = place[i].clamp(-self.half[i], self.half[i]);
        }
        if covered.is_nan() || covered <= 0.0 || facing >= 0.0 {
            return None;
        }
        let view = match self.eye {
            Some(_) => scaled(d, -1.0 / dot(d, d).sqrt()),
            None => self.towards,
        };
        Some(Hit { at, normal, view, place, steps, covered })
    }
}

fn dot(a: V, b: V) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn scaled(a: V, by: f32) -> V {
    a.map(|c| c * by)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::tests::uniform;
    use crate::scene::{Camera, Pose, direction};
    use observe::Silent;
    use std::f64::consts::PI;

    fn lobe(t: f64) -> [f64; 3] {
        let s = inks::ggx::lobe(t, 0.15);
        [0.05 + s, 0.1 + 0.8 * s, 0.02 + 0.3 * s]
    }

    fn pixel(scene: &Scene, lit: &Lit, x: usize, y: usize, side: usize) -> [f32; 4] {
        Renderer::new(lit).render(scene, side, side, &Silent).unwrap().pixels[y * side + x]
    }

    /// Everything by hand in f64: where pixel (x, y) of a square picture meets a flat sheet, and what it sends to the eye.
    fn by_hand(scene: &Scene, x: usize, y: usize, side: usize) -> [f64; 3] {
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let sum = |a: [f64; 3], s: f64, b: [f64; 3]| [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
        let unit = |a: [f64; 3]| a.map(|c| c / dot(a, a).sqrt());
        let (st, ct) = scene.pose.turn.sin_cos();
        let (sp, cp) = scene.pose.tip.sin_cos();
        let n = [st, ct * sp, ct * cp];
        let v = unit(scene.camera.towards);
        let [right, up] = right_and_up(v);
        let step = scene.camera.height / side as f64;
        let (px, py) =
            ((x as f64 + 0.5 - side as f64 / 2.0) * step, (side as f64 / 2.0 - y as f64 - 0.5) * step);
        let window = sum(sum([0.0; 3], px, right), py, up);
        let (o, d) = match scene.camera.distance {
            Some(distance) => (v.map(|c| c * distance), unit(sum(window, -distance, v))),
            None => (window, v.map(|c| -c)),
        };
        let p = sum(o, -dot(n, o) / dot(n, d), d);
        let mut total = [0.0; 3];
        for light in &scene.lights {
            let (l, e) = match *light {
                Light::Far(l) => (unit(l), 1.0),
                Light::Near(at) => {
                    (unit(sum(at, -1.0, p)), dot(at, at) / dot(sum(at, -1.0, p), sum(at, -1.0, p)))
                }
            };
            let h = unit(sum(l, -1.0, d));
            let f = lobe(dot(n, h).min(1.0).acos());
            (0..3).for_each(|c| total[c] += f[c] * e * dot(n, l).max(0.0));
        }
        total
    }

    #[test]
    fn a_flat_sheet_is_what_the_formula_says_from_anywhere() {
        let lit = uniform([0.12, 0.12], lobe);
        let mut scene = Scene {
            camera: Camera::whole(direction(0.0, 0.0), None, [0.12, 0.12], 1.0),
            pose: Pose::default(),
            lights: vec![Light::Far(direction(30.0, 10.0))],
            probe: None,
        };
        let mut compared = 0;
        for (towards, distance) in
            [((0.0, 0.0), None), ((35.0, 20.0), None), ((-50.0, 10.0), Some(0.4)), ((10.0, 60.0), Some(0.25))]
        {
            for lights in [
                vec![Light::Far(direction(30.0, 10.0))],
                vec![Light::Near([0.1, -0.05, 0.3]), Light::Far(direction(-60.0, 40.0))],
            ] {
                for (turn, tip) in [(0.0, 0.0), (0.3, -0.2)] {
                    scene.camera =
                        Camera::whole(direction(towards.0, towards.1), distance, [0.12, 0.12], 1.0);
                    scene.lights.clone_from(&lights);
                    scene.pose = Pose { turn, tip, curl: None };
                    for (x, y) in [(20, 20), (12, 25), (30, 16)] {
                        let [r, g, b, covered] = pixel(&scene, &lit, x, y, 40);
                        if covered < 1.0 {
                            continue;
                        }
                        for (found, expected) in [r, g, b].into_iter().zip(by_hand(&scene, x, y, 40)) {
                            let off = (f64::from(found) / expected - 1.0).abs();
                            assert!(off < 0.003, "{scene:?} ({x}, {y}): {found}, not {expected}");
                        }
                        compared += 1;
                    }
                }
            }
        }
        assert!(compared > 30, "{compared}");
    }

    /// A matt cylinder under a far light: rho / pi times the cosine, where the ray meets it.
    #[test]
    fn a_matt_cylinder_darkens_as_the_cosine() {
        let r = 0.05;
        let lit = uniform([PI * r, 0.1], |_| [0.6 / PI, 0.3 / PI, 0.1 / PI]);
        let side = 101;
        let (sin, cos) = 25f64.to_radians().sin_cos();
        let scene = Scene {
            camera: Camera { towards: [0.0, 0.0, 1.0], distance: None, middle: [0.0; 2], height: 0.12 },
            pose: Pose { curl: Some(r), ..Pose::default() },
            lights: vec![Light::Far([sin, 0.0, cos])],
            probe: None,
        };
        let picture = Renderer::new(&lit).render(&scene, side, side, &Silent).unwrap();
        let mut seen = 0;
        for x in 0..side {
            let at = (x as f64 + 0.5 - side as f64 / 2.0) * 0.12 / side as f64;
            let [red, _, _, covered] = picture.pixels[side / 2 * side + x];
            if at.abs() > r {
                assert_eq!(covered, 0.0, "{at}");
            } else if at.abs() < 0.98 * r {
                let angle = (at / r).asin();
                let expected = 0.6 / PI * (angle.sin() * sin + angle.cos() * cos).max(0.0);
                assert!((f64::from(red) - expected).abs() < 5e-4, "{at}: {red}, not {expected}");
                seen += 1;
            }
        }
        assert!(seen > 70);
    }

    /// From any side one sees the front of a bent sheet and never its back, which reflects nothing here that it could.
    #[test]
    fn the_back_of_a_bent_sheet_is_never_seen() {
        let r = 0.05;
        let lit = uniform([0.99 * PI * r, 0.1], |_| [0.1; 3]);
        for azimuth in [-89.0, -60.0, -20.0, 45.0, 80.0, 89.0] {
            for distance in [None, Some(0.3)] {
                let scene = Scene {
                    camera: Camera {
                        towards: direction(azimuth, 0.0),
                        distance,
                        middle: [0.0; 2],
                        height: 0.15,
                    },
                    pose: Pose { curl: Some(r), ..Pose::default() },
                    lights: vec![Light::Far(direction(azimuth, 0.0))],
                    probe: None,
                };
                let picture = Renderer::new(&lit).render(&scene, 80, 80, &Silent).unwrap();
                // The light is at the eye, so all of the front that is seen is lit, and there is no hole in it.
                for row in picture.pixels.chunks_exact(80) {
                    let covered: Vec<usize> = (0..80).filter(|&x| row[x][3] == 1.0).collect();
                    assert!(covered.windows(2).all(|pair| pair[1] == pair[0] + 1), "{azimuth} {distance:?}");
                    assert!(covered.iter().all(|&x| row[x][0] > 0.0), "{azimuth} {distance:?}");
                }
            }
        }
    }

    /// A checkerboard as fine as the map, seen small, is the mean of its fields and never flickers.
    #[test]
    fn fine_detail_is_averaged_before_it_is_lit() {
        use appearance::brdf::{Space, Table};
        use appearance::factor::Factored;
        use appearance::weights::{ONE, WeightMaps};
        let space = Space::half_angle(32);
        let mut bases = Table::new(space.columns());
        bases.push(&vec![0.2; space.columns()]);
        bases.push(&vec![0.0; space.columns()]);
        let side = 512;
        let data = (0..side * side).flat_map(|i| {
            let on = (i % side + i / side) % 2 == 0;
            [if on { ONE } else { 0 }, if on { 0 } else { ONE }]
        });
        let maps = WeightMaps::new(side, side, 2, data.collect()).unwrap();
        let factored = Factored { space, bases, maps };
        let lit = Lit::new(&press::preview::Source::Factored(&factored), [0.1, 0.1], 512).unwrap();
        let scene = Scene {
            camera: Camera::whole([0.0, 0.0, 1.0], Some(0.5), [0.1, 0.1], 1.0),
            pose: Pose { turn: 0.4, tip: 0.1, curl: None },
            lights: vec![Light::Far([0.0, 0.0, 1.0])],
            probe: None,
        };
        let picture = Renderer::new(&lit).render(&scene, 150, 150, &Silent).unwrap();
        let expected = 0.1 * 0.4f32.cos() * 0.1f32.cos();
        for p in picture.pixels.iter().filter(|p| p[3] == 1.0) {
            assert!((p[0] / expected - 1.0).abs() < 0.02, "{}, not {expected}", p[0]);
        }
    }

    #[test]
    fn pictures_that_are_empty_or_too_large_are_refused() {
        let lit = uniform([0.1, 0.1], lobe);
        let scene = Scene {
            camera: Camera::whole([0.0, 0.0, 1.0], None, [0.1, 0.1], 1.0),
            pose: Pose::default(),
            lights: Vec::new(),
            probe: None,
        };
        for (width, height) in [(0, 5), (5, 0), (9000, 5)] {
            assert!(Renderer::new(&lit).render(&scene, width, height, &Silent).is_err());
        }
    }
}
