//! What each pixel sees: the half angle and the irradiance of the sample's surface there.
//!
//! A pinhole camera looks at a cylinder or a plane under a point light. For a pixel the ray meets the surface in p with normal n;
//! l and v point to light and camera from there, h is halfway between them, and theta_h the angle from n to h. A lamp of unit
//! radiant intensity gives the irradiance `n.l / r^2`. Cost: some fifty operations a pixel. Limits: no lens distortion, no
//! light from anywhere else.

use crate::MeasureError;
use crate::camera::residual_shift::ResidualShifts;
use crate::setup::{SampleShape, Setup};

pub(crate) type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + t b`.
pub(crate) fn along(a: Vector, t: f64, b: Vector) -> Vector {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn unit(a: Vector) -> Vector {
    a.map(|v| v / dot(a, a).sqrt())
}

/// Turns a vector about a unit axis by a small or large angle.
pub(crate) fn turned(v: Vector, axis: Vector, angle: f64) -> Vector {
    let (sin, cos) = angle.sin_cos();
    let side = cross(axis, v);
    std::array::from_fn(|i| v[i] * cos + side[i] * sin + axis[i] * dot(axis, v) * (1.0 - cos))
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug)]
struct Pinhole {
    position: Vector,
    right: Vector,
    up: Vector,
    forward: Vector,
    /// Distance of the picture in pixels.
    focal: f64,
    middle: [f64; 2],
}

impl Pinhole {
    /// Direction of the ray through a place in the picture; pixel centres are at halves. Not of unit length.
    fn ray(&self, x: f64, y: f64) -> Vector {
        let (u, v) = ((x - self.middle[0]) / self.focal, (self.middle[1] - y) / self.focal);
        std::array::from_fn(|i| self.forward[i] + u * self.right[i] + v * self.up[i])
    }

    /// Where a point is in the picture.
    fn project(&self, p: Vector) -> [f64; 2] {
        let d = along(p, -1.0, self.position);
        let depth = dot(d, self.forward);
        [
            self.middle[0] + self.focal * dot(d, self.right) / depth,
            self.middle[1] - self.focal * dot(d, self.up) / depth,
        ]
    }
}

/// What a pixel sees.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Half angle in radians.
    pub theta: f64,
    /// Cosine of the angle of incidence.
    pub cos_i: f64,
    /// Cosine of the angle to the camera.
    pub cos_o: f64,
    /// Irradiance from a lamp of unit radiant intensity, in 1/mm^2.
    pub irradiance: f64,
    /// Place on the sample: across and along its axis in millimetres, from its middle.
    pub place: [f64; 2],
}

/// Something that was measured with a tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unknown {
    /// Radius of the can in mm.
    Radius,
    /// Turn of the sample's axis in the picture's plane, in radians.
    Lean,
    /// Turn of the sample's axis to the camera, in radians.
    Nod,
    /// Turn of a flat sample about its axis, in radians.
    Turn,
    /// The sample's middle, to the right, in mm.
    Across,
    /// The sample's middle, toward the camera, in mm.
    Depth,
    /// A coordinate of a light in mm.
    Light(usize, usize),
    /// A coordinate in pixels of a photograph against where it was aligned to: its light, its place in the series, the axis.
    Slip(usize, usize, usize),
}

/// Camera, sample, card and lights.
#[derive(Clone, Debug)]
pub struct Scene {
    camera: Pinhole,
    /// Radius in mm; None for a flat sample.
    radius: Option<f64>,
    centre: Vector,
    /// Directions of the sample: to the right, along its axis, toward the camera.
    frame: [Vector; 3],
    half: [f64; 2],
    lights: Vec<Vector>,
    diameters: Vec<f64>,
    card: (Vector, Vector),
    slips: ResidualShifts,
    /// Standard deviation of the lens' blur in pixels.
    blur: f64,
}

impl Scene {
    /// The scene that a setup file describes, in pictures of this size.
    ///
    /// # Errors
    /// Directions that are none, a light or camera inside the sample.
    pub fn new(
        setup: &Setup,
        (width, height): (usize, usize),
        field_of_view: f64,
    ) -> Result<Scene, MeasureError> {
        let wrong = |problem: &str| MeasureError::Scene(format!("setup file: {problem}"));
        let forward = along(setup.camera.look_at_mm, -1.0, setup.camera.position_mm);
        let right = cross(forward, setup.camera.up);
        if dot(forward, forward) < 1e-6 || dot(right, right) < 1e-9 * dot(forward, forward) {
            return Err(wrong(
                "camera: it looks along `up` or at itself; check position_mm, look_at_mm and up",
            ));
        }
        let (forward, right) = (unit(forward), unit(right));
        let camera = Pinhole {
            position: setup.camera.position_mm,
            right,
            up: cross(right, forward),
            forward,
            focal: 0.5 * width as f64 / (0.5 * field_of_view).tan(),
            middle: [width as f64 / 2.0, height as f64 / 2.0],
        };
        let sample = &setup.sample;
        let toward = along(setup.camera.position_mm, -1.0, sample.centre_mm);
        let side = cross(sample.axis, toward);
        if dot(sample.axis, sample.axis) < 1e-9 || dot(side, side) < 1e-6 * dot(toward, toward) {
            return Err(wrong(
                "sample.axis: the camera looks along it; give the direction of the can's axis",
            ));
        }
        let axis = unit(sample.axis);
        let across = unit(side);
        let normal = cross(across, axis);
        let radius = sample.radius_mm.filter(|_| sample.shape == SampleShape::Cylinder);
        let half = [sample.width_mm.map_or(radius.unwrap_or(0.0), |w| 0.5 * w), 0.5 * sample.height_mm];
        for (name, p) in std::iter::once(("camera.position_mm", setup.camera.position_mm))
            .chain(setup.light.iter().map(|light| ("light.position_mm", light.position_mm)))
        {
            let d = along(p, -1.0, sample.centre_mm);
            if dot(d, normal) <= radius.unwrap_or(0.0) {
                return Err(wrong(&format!(
                    "{name}: it does not stand in front of the sample; z points to the camera"
                )));
            }
        }
        let facing = setup.card.normal.unwrap_or_else(|| along([0.0; 3], -1.0, forward));
        if dot(facing, facing) < 1e-9 || dot(facing, forward) >= 0.0 {
            return Err(wrong("card.normal: the card does not face the camera"));
        }
        Ok(Scene {
            camera,
            radius,
            centre: sample.centre_mm,
            frame: [across, axis, normal],
            half,
            lights: setup.light.iter().map(|light| light.position_mm).collect(),
            diameters: setup.light.iter().map(|light| light.diameter_mm).collect(),
            card: (setup.card.position_mm.unwrap_or(sample.centre_mm), unit(facing)),
            slips: ResidualShifts::default(),
            blur: 0.0,
        })
    }

    /// Radius of the can in mm.
    pub fn radius(&self) -> Option<f64> {
        self.radius
    }

    /// Where the lights are, in mm.
    pub fn lights(&self) -> &[[f64; 3]] {
        &self.lights
    }

    /// Width of a lamp in mm.
    pub(crate) fn diameter(&self, light: usize) -> f64 {
        self.diameters[light]
    }

    /// The same scene for photographs that may lie aside from where they were aligned to.
    #[must_use]
    pub(crate) fn with_slips(self, slips: ResidualShifts) -> Scene {
        Scene { slips, ..self }
    }

    /// The same scene through a lens that blurs by so many pixels.
    #[must_use]
    pub(crate) fn with_blur(self, blur: f64) -> Scene {
        Scene { blur, ..self }
    }

    /// Standard deviation of the lens' blur in pixels.
    pub(crate) fn blur(&self) -> f64 {
        self.blur
    }

    /// How far a lamp is from the sample's middle in mm.
    pub(crate) fn lamp_distance(&self, light: usize) -> f64 {
        let way = along(self.lights[light], -1.0, self.centre);
        dot(way, way).sqrt()
    }

    /// The scene with one measure changed.
    #[must_use]
    pub(crate) fn changed(mut self, what: Unknown, by: f64) -> Scene {
        let turn = |frame: [Vector; 3], about: Vector| frame.map(|v| turned(v, about, by));
        match what {
            Unknown::Radius => self.radius = self.radius.map(|r| r + by),
            Unknown::Lean => self.frame = turn(self.frame, self.frame[2]),
            Unknown::Nod => self.frame = turn(self.frame, self.frame[0]),
            Unknown::Turn => self.frame = turn(self.frame, self.frame[1]),
            Unknown::Across => self.centre = along(self.centre, by, self.frame[0]),
            Unknown::Depth => self.centre = along(self.centre, by, self.frame[2]),
            Unknown::Light(light, axis) => self.lights[light][axis] += by,
            Unknown::Slip(light, shot, axis) => self.slips.shift(light, shot, axis, by),
        }
        self
    }

    /// Where a ray meets the sample's surface, and the normal there.
    fn hit(&self, d: Vector) -> Option<(Vector, Vector)> {
        let o = along(self.camera.position, -1.0, self.centre);
        let [across, axis, normal] = self.frame;
        let (ox, oz, dx, dz) = (dot(o, across), dot(o, normal), dot(d, across), dot(d, normal));
        let t = match self.radius {
            Some(radius) => {
                let (a, b, c) = (dx * dx + dz * dz, ox * dx + oz * dz, ox * ox + oz * oz - radius * radius);
                let discriminant = b * b - a * c;
                if discriminant <= 0.0 {
                    return None;
                }
                (-b - discriminant.sqrt()) / a
            }
            None => -oz / dz,
        };
        if t.is_nan() || t <= 0.0 {
            return None;
        }
        let p = along(o, t, d);
        let n = match self.radius {
            Some(radius) => {
                along(along([0.0; 3], dot(p, across) / radius, across), dot(p, normal) / radius, normal)
            }
            None => normal,
        };
        let outside = dot(p, axis).abs() > self.half[1]
            || (self.radius.is_none() && dot(p, across).abs() > self.half[0]);
        (!outside).then(|| (along(self.centre, 1.0, p), n))
    }

    fn view_of(&self, p: Vector, n: Vector, light: Vector) -> View {
        let to_light = along(light, -1.0, p);
        let distance2 = dot(to_light, to_light);
        let (l, v) = (unit(to_light), unit(along(self.camera.position, -1.0, p)));
        let h = unit(along(l, 1.0, v));
        let (cos_i, cos_o) = (dot(n, l), dot(n, v));
        let q = along(p, -1.0, self.centre);
        View {
            // The sine keeps small angles exact.
            theta: dot(cross(n, h), cross(n, h)).sqrt().atan2(dot(n, h)),
            cos_i,
            cos_o,
            irradiance: cos_i.max(0.0) / distance2,
            place: [dot(q, self.frame[0]), dot(q, self.frame[1])],
        }
    }

    /// What is seen at a place in the picture; pixel centres are at halves.
    pub fn view(&self, x: f64, y: f64, light: usize) -> Option<View> {
        let (p, n) = self.hit(self.camera.ray(x, y))?;
        Some(self.view_of(p, n, self.lights[light]))
    }

    /// What a pixel sees of which this photograph of the series is the first that is not full.
    pub(crate) fn seen(&self, x: f64, y: f64, light: usize, first: u8) -> Option<View> {
        let [dx, dy] = self.slips.at(light, first);
        self.view(x + dx, y + dy, light)
    }

    /// The place of the sample's surface that a pixel sees, unrolled: across (along the arc of a can) and along its axis in mm, from the middle
    /// of the side that faces the camera.
    pub(crate) fn unrolled(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        let (p, _) = self.hit(self.camera.ray(x, y))?;
        let q = along(p, -1.0, self.centre);
        let [across, up, toward] = self.frame.map(|axis| dot(q, axis));
        Some([self.radius.map_or(across, |radius| radius * across.atan2(toward)), up])
    }

    /// The pixel of such a place, if it faces the camera.
    pub(crate) fn pixel_of(&self, [arc, up]: [f64; 2]) -> Option<[f64; 2]> {
        let [across, axis, normal] = self.frame;
        let (n, from) = match self.radius {
            Some(radius) => {
                let (s, c) = (arc / radius).sin_cos();
                let n = along(along([0.0; 3], s, across), c, normal);
                (n, along(self.centre, radius, n))
            }
            None => (normal, along(self.centre, arc, across)),
        };
        let p = along(from, up, axis);
        (dot(n, along(self.camera.position, -1.0, p)) > 0.0).then(|| self.camera.project(p))
    }

    /// The same under a part of the lamp that is off its middle by these millimetres, across the light's way.
    pub(crate) fn seen_under(
        &self,
        [x, y]: [f64; 2],
        light: usize,
        first: u8,
        off: [f64; 2],
    ) -> Option<View> {
        let [dx, dy] = self.slips.at(light, first);
        let (p, n) = self.hit(self.camera.ray(x + dx, y + dy))?;
        let lamp = self.lights[light];
        let way = unit(along(p, -1.0, lamp));
        let side = unit(cross(way, if way[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] }));
        let other = cross(way, side);
        Some(self.view_of(p, n, along(along(lamp, off[0], side), off[1], other)))
    }

    /// Irradiance of the card at a place in the picture from a lamp of unit radiant intensity.
    pub(crate) fn card_irradiance(&self, x: f64, y: f64, light: usize) -> f64 {
        let d = self.camera.ray(x, y);
        let (point, normal) = self.card;
        let t = dot(along(point, -1.0, self.camera.position), normal) / dot(d, normal);
        let p = along(self.camera.position, t, d);
        self.view_of(p, normal, self.lights[light]).irradiance
    }

    /// A place beside the can in the picture: `across` mm from its axis, `height` mm from its middle.
    pub(crate) fn beside(&self, across: f64, height: f64) -> [f64; 2] {
        self.camera.project(along(along(self.centre, height, self.frame[1]), across, self.frame[0]))
    }

    /// Half the length of the print along its axis, in mm.
    pub(crate) fn half_height(&self) -> f64 {
        self.half[1]
    }

    /// Cosine of incidence at the can's right (1) or left (-1) outline.
    pub(crate) fn lit_from_side(&self, side: f64, light: usize) -> f64 {
        side * dot(unit(along(self.lights[light], -1.0, self.centre)), self.frame[0])
    }

    /// Millimetres a pixel at the sample's middle.
    pub(crate) fn pixel_mm(&self) -> f64 {
        let o = along(self.camera.position, -1.0, self.centre);
        dot(o, o).sqrt() / self.camera.focal
    }

    /// By how many pixels the ray at this place passes outside the can's outline.
    pub(crate) fn outside_outline(&self, x: f64, y: f64) -> f64 {
        let d = self.camera.ray(x, y);
        let o = along(self.camera.position, -1.0, self.centre);
        let between = cross(d, self.frame[1]);
        let distance = dot(o, between).abs() / dot(between, between).sqrt();
        (distance - self.radius.unwrap_or(0.0)) / self.pixel_mm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::tests::CAN;

    fn can() -> Scene {
        Scene::new(&Setup::parse(CAN).unwrap(), (480, 360), 14f64.to_radians()).unwrap()
    }

    /// At the middle of the picture the can's surface is 50 mm in front of the origin and faces the camera.
    #[test]
    fn the_nearest_line_of_a_can_by_hand() {
        let view = can().view(240.0, 180.0, 0).unwrap();
        let (l, r2) = ([350.0, 100.0, 850.0], 350.0f64.powi(2) + 100.0f64.powi(2) + 850.0f64.powi(2));
        let cos_i = l[2] / r2.sqrt();
        assert!((view.cos_i - cos_i).abs() < 1e-12 && (view.cos_o - 1.0).abs() < 1e-12);
        assert!((view.irradiance - cos_i / r2).abs() < 1e-15);
        // Halfway between the eye at the normal and the light: half the light's angle.
        assert!((view.theta - 0.5 * cos_i.acos()).abs() < 1e-12);
    }

    /// A point on the surface by its angle round the can, projected by hand.
    #[test]
    fn a_place_round_the_can_by_hand() {
        let scene = can();
        let focal = 240.0 / 7f64.to_radians().tan();
        let phi = 0.6f64;
        let p = [50.0 * phi.sin(), 20.0, 50.0 * phi.cos()];
        let (x, y) = (240.0 + focal * p[0] / (1200.0 - p[2]), 180.0 - focal * p[1] / (1200.0 - p[2]));
        let view = scene.view(x, y, 0).unwrap();
        let n = [phi.sin(), 0.0, phi.cos()];
        let l = unit(along([350.0, 100.0, 900.0], -1.0, p));
        let v = unit(along([0.0, 0.0, 1200.0], -1.0, p));
        let h = unit(along(l, 1.0, v));
        assert!((view.cos_i - dot(n, l)).abs() < 1e-12 && (view.theta - dot(n, h).acos()).abs() < 1e-9);
        assert!(scene.view(5.0, 5.0, 0).is_none());
        // The outline: where the tangent from the camera touches.
        let tangent = (50.0f64 / 1200.0).asin().tan();
        assert!(scene.outside_outline(240.0 + focal * tangent, 180.0).abs() < 1e-9);
        let card = scene.card_irradiance(400.0, 180.0, 0);
        let q = [(400.0 - 240.0) / focal * 1200.0, 0.0, 0.0];
        let to = along([350.0, 100.0, 900.0], -1.0, q);
        assert!((card - to[2] / dot(to, to).powf(1.5)).abs() < 1e-15);
    }

    #[test]
    fn impossible_setups_are_named() {
        let scene = |from: &str, to: &str| {
            let setup = Setup::parse(&CAN.replace(from, to)).unwrap();
            Scene::new(&setup, (480, 360), 0.2).unwrap_err().to_string()
        };
        assert!(scene("[350, 100, 900]", "[350, 100, -900]").contains("light.position_mm"));
        assert!(scene("[0, 0, 1200]", "[0, 1200, 0]").contains("camera"));
        assert!(scene("radius_mm = 50", "radius_mm = 50\naxis = [0, 0, 1]").contains("sample.axis"));
        assert!(scene("[sample]", "[card]\nnormal = [0, 0, -1]\n[sample]").contains("card.normal"));
    }
}
