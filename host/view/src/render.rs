//! The picture of a lit sheet.
//!
//! Problem: a frame of a million pixels and eight bases must follow a hand, on two cores.
//! Method: rows run in parallel, and of a row [`BLOCK`] pixels at a time. [`Rays`] finds where their rays meet the sheet,
//! [`Weights`] reads the mean weights over their footprints, and [`Curves`] mixes what the lights make of them. A light probe is
//! integrated on a grid over the sheet ([`Field`](crate::surroundings)).
//! Cost: that of its parts; on two cores 23 ms for a million pixels, eight curves and one light.
//! Limits: one bounce and no shadows, which the outside of a cylinder does not need; edges of the sheet are smooth, the
//! silhouette of a bent one is not. The back of a sheet is never seen: all of a bent one lies behind its middle, where
//! [`Scene::check`] wants the eye in front.

use appearance::wide::wide;
use observe::Observer;
use press::preview::{LONGEST_SIDE, PreviewError, Radiance};
use rayon::prelude::*;

use crate::error::ViewError;
use crate::footprint::Weights;
use crate::light::{Curves, Lamp, Lighting, Sums};
use crate::lit::{LANES, Lit};
use crate::ray::{BLOCK, Hits, Rays};
use crate::scene::{Frame, Scene};
use crate::surroundings::Field;

/// Renders one [`Lit`] again and again. See the module text.
pub struct Renderer<'a> {
    lit: &'a Lit,
    curves: Curves,
}

/// A scene in the axes of the sheet.
struct SheetScene {
    rays: Rays,
    lamps: Vec<Lamp>,
    field: Option<Field>,
}

/// What a thread needs for a block of pixels.
struct Block {
    hits: Hits,
    weights: Weights,
    lighting: Lighting,
    sums: Sums,
}

impl<'a> Renderer<'a> {
    /// Prepares the curves.
    pub fn new(lit: &'a Lit) -> Renderer<'a> {
        Renderer { lit, curves: Curves::new(lit) }
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
        self.draw(scene, width, height, observer, |_| ())
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
        self.draw(scene, width, height, observer, |rays| rays.lay_flat(width, height))
    }

    /// Renders a scene whose rays `change` may move.
    fn draw(
        &self,
        scene: &Scene,
        width: usize,
        height: usize,
        observer: &dyn Observer,
        change: impl FnOnce(&mut Rays),
    ) -> Result<Radiance, ViewError> {
        scene.check(self.lit.size)?;
        if !(1..=LONGEST_SIDE).contains(&width) || !(1..=LONGEST_SIDE).contains(&height) {
            return Err(PreviewError::Size { width, height }.into());
        }
        let mut seen = self.seen(scene, width, height, observer);
        change(&mut seen.rays);
        observer.begin("lighting the sheet", height as u64);
        let mut pixels = vec![[0.0f32; 4]; width * height];
        pixels.par_chunks_exact_mut(width).enumerate().for_each_init(
            || Block::new(self.lit),
            |block, (y, row)| {
                wide(
                    #[inline(always)]
                    || self.row(&seen, y, row, block),
                );
                observer.advance(1);
            },
        );
        observer.end();
        Ok(Radiance { width, height, pixels })
    }

    /// Brings a scene into the axes of the sheet.
    fn seen(&self, scene: &Scene, width: usize, height: usize, observer: &dyn Observer) -> SheetScene {
        let frame = Frame::new(&scene.pose);
        let places = [self.lit.levels[0].width, self.lit.levels[0].height];
        SheetScene {
            rays: Rays::new(scene, self.lit.size, places, width, height),
            lamps: scene.lights.iter().map(|light| Lamp::new(light, &frame)).collect(),
            field: scene
                .probe
                .as_ref()
                .map(|probe| Field::new(probe, scene, self.lit, &self.curves, observer)),
        }
    }

    /// Renders a row, which is black and empty.
    #[inline(always)]
    fn row(&self, seen: &SheetScene, y: usize, row: &mut [[f32; 4]], block: &mut Block) {
        let Block { hits, weights, lighting, sums } = block;
        for (n, out) in row.chunks_mut(BLOCK).enumerate() {
            seen.rays.follow(n * BLOCK, y, hits);
            hits.covered[out.len()..].fill(0.0);
            if hits.covered.iter().all(|&covered| covered == 0.0) {
                continue;
            }
            weights.read(self.lit, hits);
            sums.lanes.fill([[0.0; LANES]; 3]);
            for lamp in &seen.lamps {
                lighting.fall(lamp, hits);
                self.curves.shade(lighting, weights, sums);
            }
            if let Some(field) = &seen.field {
                field.shade(hits, weights, sums);
            }
            sums.finish(&hits.covered, out);
        }
    }
}

impl Block {
    fn new(lit: &Lit) -> Block {
        Block {
            hits: Hits::default(),
            weights: Weights::new(lit.stride),
            lighting: Lighting::default(),
            sums: Sums::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::tests::uniform;
    use crate::scene::{Camera, Light, Pose, direction, right_and_up};
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

    /// A checkerboard as fine as the map, of a matt grey and black.
    fn checkered(side: usize) -> Lit {
        use appearance::brdf::{Space, Table};
        use appearance::factor::Factored;
        use appearance::weights::{ONE, WeightMaps};
        let space = Space::half_angle(32);
        let mut bases = Table::new(space.columns());
        bases.push(&vec![0.2; space.columns()]);
        bases.push(&vec![0.0; space.columns()]);
        let data = (0..side * side).flat_map(|i| {
            let on = (i % side + i / side).is_multiple_of(2);
            [if on { ONE } else { 0 }, if on { 0 } else { ONE }]
        });
        let maps = WeightMaps::new(side, side, 2, data.collect()).unwrap();
        let factored = Factored { space, bases, maps };
        Lit::new(&press::preview::Source::Factored(&factored), [0.1, 0.1], side).unwrap()
    }

    /// Seen small, it is the mean of its fields and never flickers.
    #[test]
    fn fine_detail_is_averaged_before_it_is_lit() {
        let lit = checkered(512);
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

    /// Dots of three stacks, a flat grey each, without order, and what is lit with maps of `places`.
    fn print(side: usize, places: usize) -> (Vec<u8>, Lit) {
        use appearance::brdf::{Space, Table};
        use sheet::{Area, DotMap};
        let space = Space::half_angle(16);
        let mut stacks = Table::new(space.columns());
        [0.2, 0.05, 0.01].iter().for_each(|grey| stacks.push(&vec![*grey; space.columns()]));
        let names = ["substrate", "C", "K"].map(|stack| stack.parse::<inks::Stack>().unwrap());
        let dot = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 13) as u8 % 3;
        let index: Vec<u8> = (0..side * side).map(dot).collect();
        let dots = DotMap::new(side, side, names.to_vec(), index.clone()).unwrap();
        let source = press::preview::Source::Print {
            dots: &dots,
            space: &space,
            stacks: &stacks,
            area: Area::whole(&dots),
        };
        (index, Lit::new(&source, [0.01, 0.01], places).unwrap())
    }

    /// Far eye and light in front: each pixel is the mean of the dots at sixteen places of it up to two dots a pixel, and of a
    /// finer grid where the map is coarser than that; maps make no difference.
    #[test]
    fn few_dots_of_a_pixel_are_looked_at_one_by_one() {
        let side = 256;
        for (places, per_pixel) in [(64, 0.05), (64, 0.9), (128, 1.9), (64, 3.1)] {
            let (index, lit) = print(side, places);
            let pixels = 100;
            let height = per_pixel * 0.01 / side as f64 * f64::from(pixels);
            let scene = Scene {
                camera: Camera { towards: [0.0, 0.0, 1.0], distance: None, middle: [1e-5, 2e-5], height },
                pose: Pose::default(),
                lights: vec![Light::Far([0.0, 0.0, 1.0])],
                probe: None,
            };
            let picture = Renderer::new(&lit).render(&scene, 100, 100, &Silent).unwrap();
            let places = if per_pixel < 2.0 { 4 } else { 8 };
            let mut off = 0;
            let mut seen = 0;
            for (i, found) in picture.pixels.iter().enumerate().filter(|(_, p)| p[3] == 1.0) {
                let at = |p: usize, n: u32, middle: f64| {
                    let p = p as f64 + (f64::from(n) + 0.5) / f64::from(places) - 50.0;
                    let dot = p * per_pixel + middle * side as f64 / 0.01 + 0.5 * side as f64;
                    (dot.max(0.0) as usize).min(side - 1)
                };
                let mut mean = 0.0;
                for (x, y) in (0..places).flat_map(|y| (0..places).map(move |x| (x, y))) {
                    let dot = index[at(i / 100, y, -2e-5) * side + at(i % 100, x, 1e-5)];
                    mean += [0.2, 0.05, 0.01][usize::from(dot)] / f64::from(places * places);
                }
                seen += 1;
                // A place at the very edge of a dot may fall on the other side in f32.
                off += u32::from((f64::from(found[0]) - mean).abs() > 1e-5);
            }
            assert!(seen > 4000 && off * 200 < seen, "{per_pixel} dots a pixel: {off} of {seen}");
        }
    }

    /// Pixels of many dots are read from the map, and their mean is that of the dots.
    #[test]
    fn many_dots_of_a_pixel_are_their_mean() {
        let (_, lit) = print(512, 256);
        let scene = Scene {
            camera: Camera { towards: [0.0, 0.0, 1.0], distance: None, middle: [0.0; 2], height: 0.009 },
            pose: Pose::default(),
            lights: vec![Light::Far([0.0, 0.0, 1.0])],
            probe: None,
        };
        let mean = |pixels: usize| {
            let picture = Renderer::new(&lit).render(&scene, pixels, pixels, &Silent).unwrap();
            picture.pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / picture.pixels.len() as f64
        };
        let (many, few) = (mean(20), mean(700));
        assert!((many / few - 1.0).abs() < 0.01, "{many} and {few}");
    }

    /// Pixels are equal bit for bit with the widest lanes of this processor and with those that every processor of its kind has.
    #[test]
    fn pictures_do_not_depend_on_the_processor() {
        let lit = checkered(64);
        let renderer = Renderer::new(&lit);
        // One block, and a part of another.
        let (width, height) = (BLOCK + 27, 40);
        for (distance, curl, probe) in [
            (None, None, None),
            (Some(0.4), None, Some(press::preview::Probe::studio(16))),
            (None, Some(0.04), Some(press::preview::Probe::studio(16))),
            (Some(0.4), Some(0.05), None),
        ] {
            let scene = Scene {
                camera: Camera::whole(direction(30.0, 20.0), distance, [0.1, 0.1], 2.0),
                pose: Pose { turn: 0.2, tip: -0.1, curl },
                lights: vec![Light::Near([0.1, 0.1, 0.3]), Light::Far([0.3, -0.2, 1.0])],
                probe,
            };
            let picture = renderer.render(&scene, width, height, &Silent).unwrap();
            let seen = renderer.seen(&scene, width, height, &Silent);
            let mut block = Block::new(&lit);
            for (y, wide) in picture.pixels.chunks_exact(width).enumerate() {
                let mut row = vec![[0.0; 4]; width];
                renderer.row(&seen, y, &mut row, &mut block);
                for (x, (wide, narrow)) in wide.iter().zip(&row).enumerate() {
                    assert_eq!(wide.map(f32::to_bits), narrow.map(f32::to_bits), "{x}, {y}");
                }
            }
            assert!(picture.pixels.iter().filter(|p| p[0] > 0.0).count() > 500);
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
