//! Where the eye is, how the sheet is held, and what lights it.
//!
//! The sheet lies around the origin and faces +z. It is first bent around an upright cylinder, then turned about the upright
//! axis and tipped about the level one. Eye and lights do not move with it. The eye is at a point, or infinitely far away;
//! the picture is a window in the plane through the origin that faces the eye, so zooming never changes a highlight.

use press::preview::Probe;

use crate::error::ViewError;

/// Farthest that eyes, lights and radii may be, in metres.
const FARTHEST: f64 = 1000.0;

/// The unit direction at an azimuth to the right and an elevation upwards (degrees) from the direction the sheet faces.
pub fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let (a, e) = (azimuth.to_radians(), elevation.to_radians());
    [a.sin() * e.cos(), e.sin(), a.cos() * e.cos()]
}

/// Pixels across and down of a picture in the proportions of a sheet, whose longer side has `longest`.
pub fn proportions([width, height]: [f64; 2], longest: usize) -> (usize, usize) {
    let side =
        |side: f64| ((side / width.max(height) * longest as f64).round() as usize).max(16.min(longest));
    (side(width), side(height))
}

/// The eye, and what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Direction from the origin to the eye, of any length.
    pub towards: [f64; 3],
    /// Distance of the eye from the origin in metres; `None` is infinitely far away.
    pub distance: Option<f64>,
    /// The place in the window's plane that the middle of the picture shows, in metres right and up of the origin.
    pub middle: [f64; 2],
    /// Metres across the height of the picture.
    pub height: f64,
}

impl Camera {
    /// An eye in this direction that sees a whole sheet of `size` metres, with a margin, in a picture of these proportions
    /// (width by height).
    pub fn whole(towards: [f64; 3], distance: Option<f64>, size: [f64; 2], aspect: f64) -> Camera {
        let height = 1.08 * size[1].max(size[0] / aspect.max(1e-3));
        Camera { towards, distance, middle: [0.0; 2], height }
    }

    /// The same eye with a window that is so many times smaller, and with a place of the sheet in its middle (metres right and
    /// up of the sheet's middle, along the paper).
    ///
    /// # Errors
    /// A place that is turned away from the eye or lies behind it.
    pub fn zoomed(self, zoom: f64, [s, y]: [f64; 2], pose: &Pose) -> Result<Camera, ViewError> {
        let frame = Frame::new(pose);
        let towards = unit(self.towards);
        let [right, up] = right_and_up(towards).map(|axis| frame.in_sheet(axis));
        let towards = frame.in_sheet(towards);
        let (at, normal) = match pose.curl {
            Some(r) => {
                let (sin, cos) = (s / r).sin_cos();
                ([r * sin, y, r * (cos - 1.0)], [sin, 0.0, cos])
            }
            None => ([s, y, 0.0], [0.0, 0.0, 1.0]),
        };
        let view = match self.distance {
            Some(d) => std::array::from_fn(|c| d * towards[c] - at[c]),
            None => towards,
        };
        // The ray from the eye to the place meets the window so many times as far away.
        let scale = self.distance.map_or(1.0, |d| d / (d - dot(towards, at)));
        if dot(normal, view) <= 0.0 || !(scale > 0.0 && scale.is_finite()) {
            return Err(ViewError::Camera(
                "the eye does not see the place in the middle of the picture; choose another place, or turn the sheet".into(),
            ));
        }
        let middle = [right, up].map(|axis| scale * dot(axis, at));
        Ok(Camera { middle, height: self.height / zoom, ..self })
    }
}

/// How the sheet is held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Turned to the right about the upright axis, in radians.
    pub turn: f64,
    /// Tipped back about the level axis, in radians.
    pub tip: f64,
    /// Bent around an upright cylinder of this radius (metres), with the printed side out; flat without one.
    pub curl: Option<f64>,
}

/// A light of irradiance 1 at the origin, on a surface that faces it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Infinitely far away in this direction, of any length.
    Far([f64; 3]),
    /// At this point in metres. It falls off with the square of the distance.
    Near([f64; 3]),
}

/// A scene. See the module text.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The eye.
    pub camera: Camera,
    /// How the sheet is held.
    pub pose: Pose,
    /// The lights.
    pub lights: Vec<Light>,
    /// Light from everywhere.
    pub probe: Option<Probe>,
}

impl Scene {
    /// Checks that the eye sees the front of a sheet of this size (metres), and that all lights can shine.
    ///
    /// # Errors
    /// What is wrong, with what would be right.
    pub fn check(&self, size: [f64; 2]) -> Result<(), ViewError> {
        let camera = |problem: String| Err(ViewError::Camera(problem));
        let Camera { towards, distance, middle, height } = self.camera;
        if !is_direction(towards) {
            return camera("its direction must be finite and not zero".into());
        }
        if !distance.is_none_or(|d| d > 0.0 && d <= FARTHEST) {
            return camera(format!("the eye must be more than 0 and at most {FARTHEST} m away"));
        }
        if !(middle.iter().all(|m| m.is_finite()) && height > 0.0 && height.is_finite()) {
            return camera("the window must be a place and a height above 0".into());
        }
        self.check_pose(size)?;
        let frame = Frame::new(&self.pose);
        let eye = frame.in_sheet(unit(towards));
        if eye[2] < 1e-3 {
            return camera(
                "the eye is behind the sheet or at its edge; turn the view or the sheet so that they face each other".into(),
            );
        }
        // A bent sheet lies behind its middle, so only the middle can come too near.
        if let Some(d) = distance
            && d * eye[2] < 1e-3
        {
            return camera(format!(
                "the eye is {:.2} mm above the plane of the sheet, as good as in it; turn the view or the sheet so that they face each \
                 other, or go farther away",
                1000.0 * d * eye[2]
            ));
        }
        for (i, light) in self.lights.iter().enumerate() {
            let (Light::Far(v) | Light::Near(v)) = *light;
            let problem = if !is_direction(v) {
                "its direction must be finite and not zero"
            } else if matches!(light, Light::Near(_)) && dot(v, v).sqrt() < 1e-4 {
                "it is inside the sheet; move it away"
            } else if dot(v, v).sqrt() > FARTHEST {
                "it is more than 1000 m away; make it a far light"
            } else {
                continue;
            };
            return Err(ViewError::Light { light: i + 1, problem: problem.into() });
        }
        Ok(())
    }

    fn check_pose(&self, size: [f64; 2]) -> Result<(), ViewError> {
        let Pose { turn, tip, curl } = self.pose;
        if !(turn.is_finite() && tip.is_finite()) {
            return Err(ViewError::Pose("the tilt must be finite".into()));
        }
        let least = size[0] / std::f64::consts::PI;
        match curl {
            Some(r) if !(r >= least * (1.0 - 1e-9) && r <= FARTHEST) => Err(ViewError::Pose(format!(
                "it cannot be bent to a radius of {r} m; {size:.3} m of paper take from {least:.3} to {FARTHEST} m",
                size = size[0],
            ))),
            _ => Ok(()),
        }
    }
}

fn is_direction(v: [f64; 3]) -> bool {
    let length = dot(v, v);
    length.is_finite() && length > 1e-18
}

/// The rotation between the world and the sheet.
pub(crate) struct Frame([[f64; 3]; 3]);

impl Frame {
    pub fn new(pose: &Pose) -> Frame {
        let ((st, ct), (sp, cp)) = (pose.turn.sin_cos(), pose.tip.sin_cos());
        // Rows are the sheet's axes in the world: turned about y, then tipped back about x.
        Frame([[ct, -st * sp, -st * cp], [0.0, cp, -sp], [st, ct * sp, ct * cp]])
    }

    /// A vector of the world in the sheet's axes.
    pub fn in_sheet(&self, v: [f64; 3]) -> [f64; 3] {
        self.0.map(|axis| dot(axis, v))
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

/// The directions right and up in the picture of an eye in this unit direction: up is as near to +y as can be.
pub(crate) fn right_and_up(towards: [f64; 3]) -> [[f64; 3]; 2] {
    let [x, y, z] = towards;
    // Straight above or below there is no level direction; any will do.
    let level = (x * x + z * z).sqrt();
    let right = if level > 1e-9 { [z / level, 0.0, -x / level] } else { [1.0, 0.0, 0.0] };
    let up = [y * right[2] - z * right[1], z * right[0] - x * right[2], x * right[1] - y * right[0]];
    [right, up]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        Scene {
            camera: Camera::whole([0.0, 0.0, 1.0], Some(0.5), [0.12, 0.09], 4.0 / 3.0),
            pose: Pose::default(),
            lights: vec![Light::Far(direction(30.0, 20.0))],
            probe: None,
        }
    }

    fn refused(change: impl FnOnce(&mut Scene)) -> String {
        let mut scene = scene();
        change(&mut scene);
        scene.check([0.12, 0.09]).unwrap_err().to_string()
    }

    #[test]
    fn what_cannot_be_seen_or_lit_is_refused_with_what_to_do() {
        assert!(scene().check([0.12, 0.09]).is_ok());
        for (said, expected) in [
            (refused(|s| s.camera.towards = direction(120.0, 0.0)), "behind the sheet"),
            (refused(|s| s.pose.turn = 1.6), "behind the sheet"),
            (refused(|s| s.camera.towards = [0.0; 3]), "view: its direction"),
            (refused(|s| s.camera.towards = [f64::NAN, 0.0, 1.0]), "view: its direction"),
            (refused(|s| s.camera.distance = Some(0.0)), "more than 0"),
            (refused(|s| s.camera.distance = Some(1e-4)), "go farther away"),
            (refused(|s| s.camera.towards = direction(0.0, 89.9)), "0.87 mm above the plane"),
            (refused(|s| s.camera.height = f64::INFINITY), "window"),
            (refused(|s| s.pose.curl = Some(0.01)), "from 0.038 to 1000 m"),
            (refused(|s| s.pose.curl = Some(f64::NAN)), "cannot be bent"),
            (refused(|s| s.pose.tip = f64::INFINITY), "tilt"),
            (refused(|s| s.lights.push(Light::Near([0.0; 3]))), "light 2: its direction"),
            (refused(|s| s.lights.push(Light::Far([0.0, f64::INFINITY, 0.0]))), "light 2"),
            (refused(|s| s.lights[0] = Light::Near([0.0, 0.0, 1e-5])), "inside the sheet"),
        ] {
            assert!(said.contains(expected), "{said}");
        }
    }

    /// Wherever the eye is and however the sheet is held, the ray through the middle of the picture meets the place, and the
    /// window is so many times smaller.
    #[test]
    fn the_place_that_was_asked_for_is_in_the_middle() {
        use crate::ray::{BLOCK, Hits, Rays};
        let size = [0.12, 0.09];
        for (towards, distance, pose) in [
            ((0.0, 0.0), Some(0.5), Pose::default()),
            ((0.0, 0.0), None, Pose { curl: Some(0.06), ..Pose::default() }),
            ((20.0, -35.0), Some(0.3), Pose { turn: 0.4, tip: -0.7, curl: None }),
            ((-15.0, 10.0), Some(0.25), Pose { turn: -0.2, tip: 0.3, curl: Some(0.05) }),
        ] {
            for [s, y] in [[0.0, 0.0], [0.04, 0.03], [-0.05, -0.044]] {
                let whole = Camera::whole(direction(towards.0, towards.1), distance, size, 4.0 / 3.0);
                let camera = whole.zoomed(25.0, [s, y], &pose).unwrap();
                assert!((camera.height * 25.0 / whole.height - 1.0).abs() < 1e-12);
                let scene = Scene { camera, pose, lights: Vec::new(), probe: None };
                let rays = Rays::new(&scene, size, [64, 64], BLOCK + 1, 3);
                let mut hits = Hits::default();
                rays.follow(BLOCK / 2, 1, &mut hits);
                let found = [(hits.place[0][0] - 0.5) * 0.12, (0.5 - hits.place[1][0]) * 0.09];
                let off = (f64::from(found[0]) - s).hypot(f64::from(found[1]) - y);
                assert!(off < 1e-6, "{pose:?}: {found:?}, not {s}, {y}");
            }
        }
        let behind = Pose { curl: Some(0.04), ..Pose::default() };
        let whole = Camera::whole([0.0, 0.0, 1.0], Some(0.5), size, 4.0 / 3.0);
        assert!(whole.zoomed(2.0, [0.0595, 0.0], &Pose { turn: 0.6, ..behind }).is_err());
    }

    #[test]
    fn the_picture_is_upright() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        let [right, up] = right_and_up([0.0, 0.0, 1.0]);
        assert!(near(right, [1.0, 0.0, 0.0]) && near(up, [0.0, 1.0, 0.0]));
        for v in [direction(40.0, 30.0), direction(-70.0, -80.0)] {
            let [right, up] = right_and_up(v);
            assert!(dot(right, v).abs() < 1e-12 && dot(up, v).abs() < 1e-12 && dot(right, up).abs() < 1e-12);
            assert!(right[1] == 0.0 && up[1] > 0.0);
        }
    }

    #[test]
    fn pictures_have_the_proportions_of_the_sheet() {
        assert_eq!(proportions([0.12, 0.09], 1024), (1024, 768));
        assert_eq!(proportions([0.01, 1.0], 100), (16, 100));
    }

    /// A sheet turned to the right faces an eye on the right, and one tipped back an eye above.
    #[test]
    fn turning_and_tipping_face_where_they_say() {
        let facing = |turn: f64, tip: f64, v| {
            let pose = Pose { turn: turn.to_radians(), tip: tip.to_radians(), curl: None };
            Frame::new(&pose).in_sheet(v)[2]
        };
        assert!((facing(30.0, 0.0, direction(30.0, 0.0)) - 1.0).abs() < 1e-12);
        assert!((facing(0.0, 25.0, direction(0.0, 25.0)) - 1.0).abs() < 1e-12);
    }
}
