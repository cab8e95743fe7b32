//! Balls of a material under four lights, which say whether its print passes for it.
//!
//! Problem: the metric compares curves angle by angle. For a mirror that no ink reaches, a lobe that is ten
//! times as wide is as far off as black; to an eye one is silver and the other is not.
//! Method: a ball shows a material from all sides at once. Its light at a point, `L = int f(theta_h) Le(l)
//! cos(theta_l) dl` with `dl = 4 (v . h) dh`, is linear in the curve, so it is a matrix over the columns of
//! the space: each of [`NORMALS`] points on a ball, under each of four lights given by formula, sums its
//! half vectors ring by ring. The error of a print is the root mean square difference of cube roots of
//! light; every light is scaled so that a white ball has a mean of 1.
//! Cost: .4 s of a core for the matrix, 40 microseconds for a pair of curves. Limits: no shadows; curves have
//! no colour of their own at grazing angles, as everywhere here.
//! Source: people judge reflectance by balls under light as it occurs (R. W. Fleming, R. O. Dror and E. H.
//! Adelson, "Real-world illumination and the perception of surface reflectance properties", 2003).

use std::f64::consts::{PI, TAU};

use maths::Maths as _;
use rayon::prelude::*;

use crate::brdf::{Space, Table};

/// Points of a ball, spread evenly over its picture. Source: with three times as many,
/// differences are within a tenth of themselves (test).
const NORMALS: usize = 96;
/// Rings of half vectors for each column, and half vectors of a ring: light is then within 1 % of the
/// integral for curves as wide as an ink's.
const RINGS: usize = 8;
/// Half vectors of a ring. Source: see [`RINGS`].
const AROUND: usize = 64;
/// The golden angle, by which points and rings are turned against each other. Source: π (3 - √5).
const GOLDEN: f64 = 2.399_963_229_728_653;

type Vector = [f64; 3];

/// Radiance from a direction: x is right, y up, and z is where the viewer is.
pub(super) type Light = fn(Vector) -> Vector;

/// The lights that choose: what people have above a table.
const LIGHTS: [Light; 4] = [studio, sun, room, overcast];

/// The light of each point, in each channel, for a curve.
pub(super) struct Balls(Table);

impl Balls {
    /// Balls in a half-angle space under the four lights.
    pub fn new(space: &Space) -> Balls {
        Balls::under(space, &LIGHTS, NORMALS)
    }

    /// So many points of balls under any lights.
    pub fn under(space: &Space, lights: &[Light], points: usize) -> Balls {
        let mut rows = Table::new(space.columns());
        for light in lights {
            let of_points: Vec<Vec<f64>> = (0..points)
                .into_par_iter()
                .map(|point| of_point(space, *light, normal(point, points)))
                .collect();
            // A white ball has the same curve at all angles.
            let white = of_points.iter().flatten().sum::<f64>() / (3 * points) as f64 / PI;
            for point in of_points {
                rows.push(&point.iter().map(|part| part / white).collect::<Vec<_>>());
            }
        }
        Balls(rows)
    }

    /// How differently the balls of two rows (1/sr) look.
    pub fn apart(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for part in self.0.rows() {
            let of = |row: &[f64]| {
                let mut light = [0.0; 3];
                for (part, f) in part.chunks_exact(3).zip(row.chunks_exact(3)) {
                    (0..3).for_each(|c| light[c] += part[c] * f[c].max(0.0));
                }
                light.map(f64::cube_root)
            };
            sum += of(a).iter().zip(of(b)).map(|(a, b)| (a - b).squared()).sum::<f64>();
        }
        (sum / (3 * self.0.len()) as f64).sqrt()
    }
}

/// The normal at a point of a ball.
fn normal(point: usize, all: usize) -> Vector {
    let r = ((point as f64 + 0.5) / all as f64).sqrt();
    let (sine, cosine) = (point as f64 * GOLDEN).sine_cosine();
    [r * cosine, r * sine, (1.0 - r * r).sqrt()]
}

/// What each column of a curve adds to the light of a point with this normal.
fn of_point(space: &Space, light: Light, normal: Vector) -> Vec<f64> {
    // Two directions across the normal, which is never straight up.
    let right = unit(cross([0.0, 1.0, 0.0], normal));
    let up = cross(normal, right);
    let mut row = Vec::with_capacity(space.columns());
    let columns =
        space.angles().iter().zip(space.weight().chunks_exact(3)).zip(space.radiance().chunks_exact(3));
    for ((&angle, weight), cosine) in columns {
        // The column's part of all half vectors, over 2 pi.
        let measure = weight[0].squared() / cosine[0];
        let wide = measure / angle.sine();
        let mut sum = [0.0; 3];
        for ring in 0..RINGS {
            let theta = angle + wide * ((ring as f64 + 0.5) / RINGS as f64 - 0.5);
            let (sine, cosine) = theta.sine_cosine();
            let part = wide * sine / RINGS as f64 * TAU / AROUND as f64;
            for i in 0..AROUND {
                let (y, x) = (i as f64 * TAU / AROUND as f64 + ring as f64 * GOLDEN).sine_cosine();
                let h: Vector =
                    std::array::from_fn(|c| normal[c] * cosine + (right[c] * x + up[c] * y) * sine);
                let facing = h[2];
                let l: Vector = std::array::from_fn(|c| 2.0 * facing * h[c] - if c == 2 { 1.0 } else { 0.0 });
                let falls = dot(l, normal);
                if facing > 0.0 && falls > 0.0 {
                    let times = 4.0 * facing * falls * part;
                    sum.iter_mut().zip(light(l)).for_each(|(sum, radiance)| *sum += times * radiance);
                }
            }
        }
        row.extend(sum);
    }
    row
}

/// A softbox above on the left, a narrow one on the right, and a dim room.
fn studio(l: Vector) -> Vector {
    let key = panel(l, [-0.55, 0.6, 0.58], [0.35, 0.35]);
    let edge = panel(l, [0.88, 0.1, 0.46], [0.1, 0.6]);
    [0.05 + 12.0 * key + 4.0 * edge; 3]
}

/// A clear sky with a low sun in haze, over earth.
fn sun(l: Vector) -> Vector {
    if l[1] < 0.0 {
        return [0.2, 0.17, 0.14];
    }
    // The sun with its haze is 4 degrees wide, and gives four times the light of the sky.
    let sun = 600.0 * ((dot(l, unit([0.5, 0.6, 0.62])) - 1.0) / 0.0024).exponential();
    let horizon = (1.0 - l[1]).cubed();
    [(0.3, 0.6, 1.0), (0.5, 0.5, 0.93), (0.9, 0.2, 0.82)]
        .map(|(sky, haze, of_sun)| sky + haze * horizon + of_sun * sun)
}

/// A room with one window on the left, and a ceiling that is brighter than the floor.
fn room(l: Vector) -> Vector {
    let window = panel(l, [-0.85, 0.2, 0.49], [0.4, 0.55]);
    let wall = 0.15 + 0.08 * l[1];
    [wall + 6.0 * window, 0.95 * wall + 7.0 * window, 0.85 * wall + 8.0 * window]
}

/// An overcast sky: a third as bright at the horizon as above. Source: P. Moon and D. E. Spencer (1942).
fn overcast(l: Vector) -> Vector {
    [if l[1] < 0.0 { 0.15 } else { (1.0 + 2.0 * l[1]) / 3.0 }; 3]
}

/// How far a direction hits a rectangle at distance 1 with these half sides; its edges are soft.
fn panel(l: Vector, centre: Vector, half: [f64; 2]) -> f64 {
    let ahead = unit(centre);
    let right = unit(cross([0.0, 1.0, 0.0], ahead));
    let far = dot(l, ahead);
    if far <= 0.0 {
        return 0.0;
    }
    let inside = |at: f64, half: f64| 1.0 / (1.0 + ((at.abs() - half) / 0.03).exponential());
    inside(dot(l, right) / far, half[0]) * inside(dot(l, cross(ahead, right)) / far, half[1])
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|a| a / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::Surface;

    /// The light of a point by summing over directions of light, spread evenly over the sphere.
    fn summed(f: impl Fn(f64) -> f64, light: Light, normal: Vector) -> Vector {
        const ALL: usize = 400_000;
        let mut sum = [0.0; 3];
        for i in 0..ALL {
            let z = 1.0 - (2 * i + 1) as f64 / ALL as f64;
            let (y, x) = (i as f64 * GOLDEN).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let l = [r * x, r * y, z];
            let falls = dot(l, normal);
            if falls > 0.0 {
                let h = unit([l[0], l[1], l[2] + 1.0]);
                let times = f(dot(h, normal).min(1.0).acos()) * falls * 4.0 * PI / ALL as f64;
                sum.iter_mut().zip(light(l)).for_each(|(sum, radiance)| *sum += times * radiance);
            }
        }
        sum
    }

    #[test]
    fn the_light_of_each_point_is_the_integral_over_all_directions() {
        let space = Space::half_angle(32);
        for alpha in [0.12, 0.3, 1.0] {
            let surface = Surface { diffuse: [0.2; 3], f0: [0.6; 3], alpha };
            let row = space.row(&surface.curve(space.angles()));
            let f = |t: f64| 0.2 / PI + 0.6 * inks::ggx::lobe(t, f64::from(alpha));
            for light in LIGHTS {
                for point in [0, 20, 45, 80] {
                    let parts = of_point(&space, light, normal(point, NORMALS));
                    let mut found = [0.0; 3];
                    for (part, f) in parts.chunks_exact(3).zip(row.chunks_exact(3)) {
                        (0..3).for_each(|c| found[c] += part[c] * f[c]);
                    }
                    let right = summed(f, light, normal(point, NORMALS));
                    for (found, right) in found.iter().zip(right) {
                        assert!((found / right - 1.0).abs() < 0.01, "{alpha} {point}: {found} {right}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_few_points_say_what_many_say() {
        let space = Space::half_angle(32);
        let of = |f0: f32, alpha| {
            space.row(&Surface { diffuse: [0.0; 3], f0: [f0; 3], alpha }.curve(space.angles()))
        };
        let (few, many) = (Balls::new(&space), Balls::under(&space, &LIGHTS, 3 * NORMALS));
        for (a, b) in [((0.95, 0.03), (0.6, 0.25)), ((0.95, 0.03), (0.04, 0.1)), ((0.5, 0.1), (0.5, 0.2))] {
            let (a, b) = (of(a.0, a.1), of(b.0, b.1));
            let ratio = few.apart(&a, &b) / many.apart(&a, &b);
            assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
        }
    }

    #[test]
    fn a_white_ball_is_white_under_every_light() {
        let space = Space::half_angle(32);
        for light in LIGHTS {
            let balls = Balls::under(&space, &[light], NORMALS);
            let mean = balls.0.rows().map(|row| row.iter().sum::<f64>() / 3.0 / PI).sum::<f64>();
            assert!((mean / NORMALS as f64 - 1.0).abs() < 1e-12);
        }
    }
}
