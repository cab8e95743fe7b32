//! Where the camera was for each photograph of a flat sheet, its focal length, and how its lens bends.
//!
//! Problem: from the corners of marks in the pictures to the pose within half a millimetre. Method: a homography for each photograph;
//! the focal length from what homographies of one camera have in common (Zhang, PAMI 22, 2000), with the principal point in the middle; then
//! all unknowns together, poses, focal length and two radial terms, by Levenberg and Marquardt's method on the distances in
//! pixels with Huber's weights. What is known beforehand (angle of view, position) enters with its tolerance.
//! Cost: the unknowns of photographs meet only in the three of the lens, yet the dense system of 6 n + 3 unknowns is small enough.
//! Limits: square pixels, no decentring. Photographs taken straight on do not tell focal length from distance; tilt some of
//! them, or state the angle of view.

use super::homography::Homography;
use super::scene::{Vector, along, cross, dot, unit};
use crate::linalg::Cholesky;

/// A point of the sheet in mm (x right, y up), and where it is in the picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkPoint {
    /// On the sheet.
    pub sheet: [f64; 2],
    /// In the picture.
    pub pixel: [f64; 2],
}

/// What is known of a camera beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Focal length in pixels and its relative standard error.
    pub focal: Option<(f64, f64)>,
    /// Position in mm and its standard error.
    pub position: Option<([f64; 3], f64)>,
}

/// The lens that all photographs share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length in pixels.
    pub focal: f64,
    /// Radial terms: a place at the distance r from the middle, in focal lengths, is seen at `r (1 + k1 r^2 + k2 r^4)`.
    pub radial: [f64; 2],
    /// The middle of the picture.
    pub middle: [f64; 2],
}

/// A photograph's pose: from the sheet's axes (x right, y up, z toward the camera's side, mm) to the camera's (x right, y down, z forward).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rows are the camera's axes on the sheet.
    pub rotation: [Vector; 3],
    /// The sheet's origin as the camera sees it.
    pub translation: Vector,
}

impl Pose {
    /// Where the camera is, in mm of the sheet.
    pub fn position(&self) -> [f64; 3] {
        std::array::from_fn(|i| -(0..3).map(|k| self.rotation[k][i] * self.translation[k]).sum::<f64>())
    }

    fn see(&self, p: Vector) -> Vector {
        std::array::from_fn(|i| dot(self.rotation[i], p) + self.translation[i])
    }

    /// Turned about the camera's axes by small angles and moved.
    fn moved(&self, by: &[f64]) -> Pose {
        let axis = [by[0], by[1], by[2]];
        let angle = dot(axis, axis).sqrt();
        let columns: [Vector; 3] = std::array::from_fn(|c| {
            let v = [self.rotation[0][c], self.rotation[1][c], self.rotation[2][c]];
            if angle < 1e-300 { v } else { super::scene::turned(v, unit(axis), angle) }
        });
        Pose {
            rotation: std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r])),
            translation: along(self.translation, 1.0, [by[3], by[4], by[5]]),
        }
    }
}

impl Lens {
    /// Where a point of the sheet's space is seen in a photograph of this pose; `None` behind the camera.
    pub fn project(&self, pose: &Pose, p: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, z] = pose.see(p);
        if z <= 1e-6 {
            return None;
        }
        let (u, v) = (x / z, y / z);
        let r2 = u * u + v * v;
        let bent = 1.0 + r2 * (self.radial[0] + r2 * self.radial[1]);
        Some([self.middle[0] + self.focal * bent * u, self.middle[1] + self.focal * bent * v])
    }

    /// Pixels of a millimetre of the sheet, near a place of it; 0 behind the camera.
    pub(crate) fn density(&self, pose: &Pose, [x, y]: [f64; 2]) -> f64 {
        let seen = |dx: f64| self.project(pose, [x + dx, y, 0.0]).unwrap_or_default();
        let (a, b) = (seen(-0.5), seen(0.5));
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// The place of the sheet that a pixel shows, in mm.
    pub fn on_sheet(&self, pose: &Pose, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let seen = [0, 1].map(|c| (pixel[c] - self.middle[c]) / self.focal);
        // Lenses bend little, so the inverse is a fixed point that is reached at once.
        let [mut u, mut v] = seen;
        for _ in 0..20 {
            let r2 = u * u + v * v;
            let bent = 1.0 + r2 * (self.radial[0] + r2 * self.radial[1]);
            (u, v) = (seen[0] / bent, seen[1] / bent);
        }
        let eye = pose.position();
        let way: Vector =
            std::array::from_fn(|c| u * pose.rotation[0][c] + v * pose.rotation[1][c] + pose.rotation[2][c]);
        let t = -eye[2] / way[2];
        (t.is_finite() && t > 0.0).then(|| [eye[0] + t * way[0], eye[1] + t * way[1]])
    }
}

/// The solved camera.
#[derive(Clone, Debug)]
pub struct SolvedCamera {
    /// The lens.
    pub lens: Lens,
    /// A pose for each photograph.
    pub poses: Vec<Pose>,
    /// Root mean square distance of corners from where they should be, in pixels, for each photograph.
    pub residuals: Vec<f64>,
    /// Standard error of each camera's position in mm, all directions together.
    pub uncertain_mm: Vec<f64>,
    /// Relative standard error of the focal length.
    pub uncertain_focal: f64,
}

/// Standard deviations of the radial terms before anything is seen: those of ordinary lenses.
const BENT: [f64; 2] = [0.3, 0.3];
/// Standard error of a corner in pixels, at least: what is measured with 1 % noise is 0.025
/// (decisions/marks-and-photographs.md), so that a perfect fit claims no perfect pose.
const LEAST_ERROR: f64 = 0.02;
/// The most steps of the method, so that one that does not settle ends.
const STEPS: usize = 60;
/// Unknowns of the lens: focal length and two radial terms. Source: Zhang 2000, section 3.3.
const LENS: usize = 3;

/// Solves for the camera from what each photograph of `width` x `height` pixels shows. Each has at least eight points.
///
/// `None` if points lie on a line or no camera sees them so.
pub fn solve(
    photos: &[Vec<MarkPoint>],
    (width, height): (usize, usize),
    known: &Known,
) -> Option<SolvedCamera> {
    let middle = [width as f64 / 2.0, height as f64 / 2.0];
    let planes: Vec<Homography> = photos
        .iter()
        .map(|points| {
            let from: Vec<[f64; 2]> = points.iter().map(|p| p.sheet).collect();
            let to: Vec<[f64; 2]> =
                points.iter().map(|p| [p.pixel[0] - middle[0], p.pixel[1] - middle[1]]).collect();
            Homography::fit(&from, &to)
        })
        .collect::<Option<_>>()?;
    let focal = known.focal.map_or_else(|| focal(&planes, width.max(height) as f64), |(focal, _)| focal);
    let lens = Lens { focal, radial: [0.0; 2], middle };
    let poses: Vec<Pose> = planes.iter().map(|plane| pose(plane, focal)).collect::<Option<_>>()?;
    let mut state = State { lens, poses };
    let n = LENS + 6 * photos.len();
    let mut damping = 1e-3;
    let start_focal = focal;
    let mut normal = Vec::new();
    for step in 0..STEPS {
        let base = state.residuals(photos)?;
        let sigma = spread(&base).max(LEAST_ERROR);
        let weights: Vec<Vec<f64>> = base
            .iter()
            .map(|photo| {
                let weight = |r: &[f64]| {
                    let off = r[0].hypot(r[1]) / (2.5 * sigma);
                    let w = if off <= 1.0 { 1.0 } else { 1.0 / off } / (sigma * sigma);
                    [w, w]
                };
                photo.chunks_exact(2).flat_map(weight).collect()
            })
            .collect();
        let mut gradient = vec![0.0; n];
        normal = vec![0.0; n * n];
        state.gather(photos, &base, &weights, &mut normal, &mut gradient)?;
        let priors = state.priors(known, start_focal);
        for prior in &priors {
            prior.add(&mut normal, &mut gradient, n);
        }
        let cost = |state: &State, residuals: &[Vec<f64>]| -> f64 {
            let seen: f64 =
                residuals.iter().flatten().zip(weights.iter().flatten()).map(|(r, w)| w * r * r).sum();
            seen + state.priors(known, start_focal).iter().map(|p| p.value * p.value).sum::<f64>()
        };
        let old = cost(&state, &base);
        let mut done = true;
        for _ in 0..10 {
            let Some(factors) = Cholesky::damped(&normal, n, damping) else {
                damping = (damping * 10.0).max(1e-6);
                continue;
            };
            let by = factors.solve(&gradient);
            let next = state.moved(&by);
            let better = next.residuals(photos).map(|r| cost(&next, &r)).filter(|c| *c < old);
            if let Some(new) = better {
                done = old - new < 1e-9 * old.max(1e-9);
                state = next;
                damping = (damping / 8.0).max(1e-9);
                break;
            }
            damping *= 8.0;
        }
        if done && step > 3 {
            break;
        }
    }
    state.finished(photos, &normal)
}

/// A quantity that is known beforehand: its deviation in standard errors and the slopes of that.
struct Prior {
    value: f64,
    slopes: Vec<(usize, f64)>,
}

impl Prior {
    fn add(&self, normal: &mut [f64], gradient: &mut [f64], n: usize) {
        for &(i, a) in &self.slopes {
            gradient[i] -= a * self.value;
            for &(j, b) in &self.slopes {
                normal[i * n + j] += a * b;
            }
        }
    }
}

/// All unknowns.
#[derive(Clone)]
struct State {
    lens: Lens,
    poses: Vec<Pose>,
}

impl State {
    /// Unknowns: the logarithm of the focal length, the radial terms, then for each photograph turn and translation.
    fn moved(&self, by: &[f64]) -> State {
        let mut next = self.clone();
        next.lens.focal *= by[0].clamp(-0.5, 0.5).exp();
        next.lens.radial[0] += by[1];
        next.lens.radial[1] += by[2];
        for (pose, by) in next.poses.iter_mut().zip(by[LENS..].chunks_exact(6)) {
            *pose = pose.moved(by);
        }
        next
    }

    fn residuals_of(&self, photo: usize, points: &[MarkPoint]) -> Option<Vec<f64>> {
        let mut out = Vec::with_capacity(2 * points.len());
        for p in points {
            let [x, y] = self.lens.project(&self.poses[photo], [p.sheet[0], p.sheet[1], 0.0])?;
            out.extend([x - p.pixel[0], y - p.pixel[1]]);
        }
        out.iter().all(|v| v.is_finite()).then_some(out)
    }

    fn residuals(&self, photos: &[Vec<MarkPoint>]) -> Option<Vec<Vec<f64>>> {
        photos.iter().enumerate().map(|(i, points)| self.residuals_of(i, points)).collect()
    }

    /// Normal equations by differences. A photograph depends on the lens and its own pose.
    fn gather(
        &self,
        photos: &[Vec<MarkPoint>],
        base: &[Vec<f64>],
        weights: &[Vec<f64>],
        normal: &mut [f64],
        gradient: &mut [f64],
    ) -> Option<()> {
        let n = gradient.len();
        for (photo, points) in photos.iter().enumerate() {
            let unknowns: Vec<usize> = (0..LENS).chain(LENS + 6 * photo..LENS + 6 * photo + 6).collect();
            let depth = self.poses[photo].translation[2].abs().max(1.0);
            let mut columns = Vec::with_capacity(unknowns.len());
            for (k, &unknown) in unknowns.iter().enumerate() {
                let step = if k < LENS + 3 { 1e-5 } else { 1e-5 * depth };
                let mut by = vec![0.0; n];
                by[unknown] = step;
                let up = self.moved(&by).residuals_of(photo, points)?;
                by[unknown] = -step;
                let down = self.moved(&by).residuals_of(photo, points)?;
                columns.push(up.iter().zip(&down).map(|(a, b)| (a - b) / (2.0 * step)).collect::<Vec<f64>>());
            }
            let weights = &weights[photo];
            for (a, &i) in columns.iter().zip(&unknowns) {
                gradient[i] -=
                    a.iter().zip(&base[photo]).zip(weights).map(|((a, r), w)| w * a * r).sum::<f64>();
                for (b, &j) in columns.iter().zip(&unknowns) {
                    normal[i * n + j] +=
                        a.iter().zip(b).zip(weights).map(|((a, b), w)| w * a * b).sum::<f64>();
                }
            }
        }
        Some(())
    }

    fn priors(&self, known: &Known, start: f64) -> Vec<Prior> {
        let mut priors: Vec<Prior> = (0..2)
            .map(|k| Prior { value: self.lens.radial[k] / BENT[k], slopes: vec![(1 + k, 1.0 / BENT[k])] })
            .collect();
        // Without any knowledge, anything from half to twice the first guess is likely.
        let (focal, error) = known.focal.unwrap_or((start, 0.7));
        priors.push(Prior { value: (self.lens.focal / focal).ln() / error, slopes: vec![(0, 1.0 / error)] });
        if let Some((position, error)) = known.position {
            for (photo, pose) in self.poses.iter().enumerate() {
                let at = pose.position();
                let step = 1e-4;
                for axis in 0..3 {
                    let slopes = (0..6)
                        .map(|k| {
                            let mut by = [0.0; 6];
                            by[k] = step;
                            let slope = (pose.moved(&by).position()[axis] - at[axis]) / step / error;
                            (LENS + 6 * photo + k, slope)
                        })
                        .collect();
                    priors.push(Prior { value: (at[axis] - position[axis]) / error, slopes });
                }
            }
        }
        priors
    }

    fn finished(self, photos: &[Vec<MarkPoint>], normal: &[f64]) -> Option<SolvedCamera> {
        let n = LENS + 6 * photos.len();
        let residuals = self
            .residuals(photos)?
            .iter()
            .map(|r| (2.0 * r.iter().map(|r| r * r).sum::<f64>() / r.len() as f64).sqrt())
            .collect();
        // Weights hold 1 / sigma^2 already.
        let factors = Cholesky::new(normal, n)?;
        let mut position = vec![0.0; photos.len()];
        let mut focal = 0.0;
        for k in 0..n {
            let mut one = vec![0.0; n];
            one[k] = 1.0;
            // Columns of L^-T: their squares add up to the covariance.
            let by = factors.back(one);
            focal += by[0] * by[0];
            let moved = self.moved(&by.iter().map(|v| v * 1e-3).collect::<Vec<_>>());
            for (sum, (a, b)) in position.iter_mut().zip(self.poses.iter().zip(&moved.poses)) {
                let d = along(b.position(), -1.0, a.position());
                *sum += dot(d, d) * 1e6;
            }
        }
        let forward = self.poses.iter().all(|pose| pose.position()[2] > 0.0);
        forward.then(|| SolvedCamera {
            lens: self.lens,
            residuals,
            uncertain_mm: position.into_iter().map(f64::sqrt).collect(),
            uncertain_focal: focal.sqrt(),
            poses: self.poses,
        })
    }
}

fn spread(residuals: &[Vec<f64>]) -> f64 {
    let mut all: Vec<f64> = residuals.iter().flatten().map(|r| r.abs()).collect();
    1.4826 * crate::linalg::median(&mut all)
}

/// The focal length that makes the images of the sheet's axes perpendicular and equally long, as nearly as all photographs
/// allow; that of an ordinary lens where they do not tell.
fn focal(planes: &[Homography], longest: f64) -> f64 {
    let (mut top, mut bottom) = (0.0, 0.0);
    for Homography(h) in planes {
        // Columns scaled alike, so that photographs count alike.
        let scale = 1.0 / (h[0].hypot(h[3]).max(h[1].hypot(h[4]))).max(1e-300);
        let a = [h[0], h[3], h[6]].map(|v| v * scale);
        let b = [h[1], h[4], h[7]].map(|v| v * scale);
        for (flat, deep) in [
            (a[0] * b[0] + a[1] * b[1], a[2] * b[2]),
            (a[0] * a[0] + a[1] * a[1] - b[0] * b[0] - b[1] * b[1], a[2] * a[2] - b[2] * b[2]),
        ] {
            // flat / f^2 + deep = 0, in units where deep is of order 1.
            let deep = deep * longest * longest;
            top -= flat * deep;
            bottom += deep * deep;
        }
    }
    // f^2 = -flat / deep; the least-squares slope of flat over deep.
    let square = top / bottom * longest * longest;
    let usual = 1.2 * longest;
    if bottom > 1e-6 && square.is_finite() && square > 0.0 {
        square.sqrt().clamp(0.3 * longest, 20.0 * longest)
    } else {
        usual
    }
}

/// The pose that a homography (sheet in mm to pixels from the middle) means for a focal length.
fn pose(plane: &Homography, focal: f64) -> Option<Pose> {
    let h = &plane.0;
    let column = |k: usize| [h[k] / focal, h[3 + k] / focal, h[6 + k]];
    let (a, b, t) = (column(0), column(1), column(2));
    let mut scale = 1.0 / (dot(a, a) * dot(b, b)).sqrt().sqrt();
    if !scale.is_finite() {
        return None;
    }
    if t[2] < 0.0 {
        scale = -scale;
    }
    let (a, b) = (unit(a.map(|v| v * scale)), unit(b.map(|v| v * scale)));
    // The two directions nearest to a and b that are perpendicular.
    let (sum, difference) = (unit(along(a, 1.0, b)), unit(along(a, -1.0, b)));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let x: Vector = std::array::from_fn(|i| half * (sum[i] + difference[i]));
    let y: Vector = std::array::from_fn(|i| half * (sum[i] - difference[i]));
    let z = cross(x, y);
    let rotation = std::array::from_fn(|r| [x[r], y[r], z[r]]);
    let pose = Pose { rotation, translation: t.map(|v| v * scale) };
    (rotation.iter().flatten().all(|v: &f64| v.is_finite())).then_some(pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera built from where it stands and what it looks at: another way round than the solver's.
    fn view(eye: Vector, target: Vector, roll: f64) -> Pose {
        let forward = unit(along(target, -1.0, eye));
        let right = unit(cross(forward, [0.0, 1.0, 0.0]));
        let down = cross(forward, right);
        let (s, c) = roll.sin_cos();
        let x: Vector = std::array::from_fn(|i| c * right[i] + s * down[i]);
        let y: Vector = std::array::from_fn(|i| c * down[i] - s * right[i]);
        let rotation = [x, y, forward];
        Pose { rotation, translation: rotation.map(|axis| -dot(axis, eye)) }
    }

    fn corners() -> Vec<[f64; 2]> {
        let mut all = Vec::new();
        for (x, y) in [(-50.0, 40.0), (40.0, 40.0), (-50.0, -50.0), (40.0, -50.0)] {
            all.extend([[x, y], [x + 10.16, y], [x + 10.16, y - 10.16], [x, y - 10.16]]);
        }
        all
    }

    /// Photographs of the marks with noise of `error` pixels.
    fn photos(lens: &Lens, poses: &[Pose], error: f64, seed: u64) -> Vec<Vec<MarkPoint>> {
        let mut state = seed;
        let mut noise = || {
            // A sum of four even numbers is nearly normal.
            let mut sum = -2.0;
            for _ in 0..4 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum += (state >> 11) as f64 / (1u64 << 53) as f64;
            }
            sum * 3f64.sqrt() * error
        };
        poses
            .iter()
            .map(|pose| {
                corners()
                    .into_iter()
                    .map(|sheet| {
                        let [x, y] = lens.project(pose, [sheet[0], sheet[1], 0.0]).unwrap();
                        MarkPoint { sheet, pixel: [x + noise(), y + noise()] }
                    })
                    .collect()
            })
            .collect()
    }

    fn angle(a: &Pose, b: &Pose) -> f64 {
        let trace: f64 = (0..3).map(|i| dot(a.rotation[i], b.rotation[i])).sum();
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
    }

    fn poses() -> Vec<Pose> {
        vec![
            view([0.0, 20.0, 520.0], [0.0, 0.0, 0.0], 0.02),
            view([250.0, -40.0, 430.0], [5.0, 0.0, 0.0], -0.05),
            view([-190.0, 210.0, 400.0], [0.0, -6.0, 0.0], 0.4),
            view([60.0, -300.0, 410.0], [0.0, 0.0, 0.0], 1.6),
        ]
    }

    #[test]
    fn poses_lens_and_focal_length_come_back() {
        let lens = Lens { focal: 3100.0, radial: [-0.12, 0.05], middle: [1000.0, 750.0] };
        let truth = poses();
        for (error, mm, degrees) in [(0.0, 0.02, 1e-3), (0.03, 0.5, 0.05)] {
            let camera = solve(&photos(&lens, &truth, error, 5), (2000, 1500), &Known::default()).unwrap();
            for (found, pose) in camera.poses.iter().zip(&truth) {
                let off = along(found.position(), -1.0, pose.position());
                let off = dot(off, off).sqrt();
                assert!(off < mm && angle(found, pose) < degrees, "{off} mm, {} degrees", angle(found, pose));
            }
            assert!((camera.lens.focal / 3100.0 - 1.0).abs() < 1e-3, "{}", camera.lens.focal);
        }
    }

    #[test]
    fn pixels_and_places_of_the_sheet_belong_together() {
        let lens = Lens { focal: 3100.0, radial: [-0.15, 0.06], middle: [1000.0, 750.0] };
        for pose in poses() {
            for place in corners() {
                let pixel = lens.project(&pose, [place[0], place[1], 0.0]).unwrap();
                let back = lens.on_sheet(&pose, pixel).unwrap();
                assert!((back[0] - place[0]).hypot(back[1] - place[1]) < 1e-6, "{place:?} {back:?}");
            }
        }
    }

    #[test]
    fn the_error_it_states_is_the_error_it_makes() {
        let lens = Lens { focal: 3100.0, radial: [-0.1, 0.0], middle: [1000.0, 750.0] };
        let truth = poses();
        let (mut made, mut stated) = (0.0, 0.0);
        for seed in 0..12 {
            let camera = solve(&photos(&lens, &truth, 0.1, seed), (2000, 1500), &Known::default()).unwrap();
            for (i, pose) in truth.iter().enumerate() {
                let off = along(camera.poses[i].position(), -1.0, pose.position());
                made += dot(off, off);
                stated += camera.uncertain_mm[i] * camera.uncertain_mm[i];
            }
        }
        let ratio = (made / stated).sqrt();
        assert!((0.6..1.6).contains(&ratio), "{ratio}");
    }

    #[test]
    fn straight_on_only_what_is_known_tells_the_distance() {
        let lens = Lens { focal: 3100.0, radial: [0.0; 2], middle: [1000.0, 750.0] };
        let truth = [view([0.0, 0.0, 520.0], [0.0; 3], 0.0)];
        let seen = photos(&lens, &truth, 0.02, 3);
        let blind = solve(&seen, (2000, 1500), &Known::default()).unwrap();
        assert!(blind.uncertain_mm[0] > 5.0, "{}", blind.uncertain_mm[0]);
        let known = Known { focal: Some((3100.0, 0.001)), position: None };
        let told = solve(&seen, (2000, 1500), &known).unwrap();
        assert!((told.poses[0].position()[2] - 520.0).abs() < 1.5 && told.uncertain_mm[0] < 2.0);
        let known = Known { focal: None, position: Some(([0.0, 0.0, 520.0], 1.0)) };
        let told = solve(&seen, (2000, 1500), &known).unwrap();
        assert!((told.lens.focal / 3100.0 - 1.0).abs() < 0.01, "{}", told.lens.focal);
    }

    #[test]
    fn points_on_a_line_are_no_sheet() {
        let line: Vec<MarkPoint> = (0..8)
            .map(f64::from)
            .map(|i| MarkPoint { sheet: [i, 2.0 * i], pixel: [10.0 * i, 20.0 * i] })
            .collect();
        assert!(solve(&[line], (200, 100), &Known::default()).is_none());
    }
}
