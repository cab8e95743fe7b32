//! A flat sheet that mirrors a checkerboard standing behind it: figure 2 of the 2009 paper, of any print.
//!
//! Problem: how sharp a surface is shows in what it mirrors. A near object is mirrored sharply where the sheet touches it and ever
//! more blurred away from it, which lights far away do not show.
//! Method: the sheet lies in the plane z = 0, the board stands upright beyond its far edge and is the only light, and the eye is far
//! away in front. Each place of the sheet reflects `L = 4 int f(theta_h) cos_i Le (v h) dh` over the half vectors h, in [`RINGS`] rings of
//! [`SPOKES`] each, narrow where lobes are. The eye is the same everywhere, so the half vectors and the ways to the board are, too. How
//! much light a ring brings depends on the place, and the curve of a pixel on its dots: the reflection is the sum of their products.
//! The board is averaged over the footprint of a half vector and of the pixel, in closed form, so edges have no steps.
//! Cost: some 2700 rays a pixel; seconds a picture. Error: below 2 % of the integral over the board itself (test).
//! Limits: those of the preview; footprints are rectangles along the board.

use std::f64::consts::{FRAC_PI_2, TAU};

use observe::Observer;
use rayon::prelude::*;
use readers::Pixels;

use super::canvas::{Canvas, Heading, Letters};
use super::error::PreviewError;
use super::flat::{Curves, DOCUMENT_SAMPLES};
use super::radiance::Radiance;
use super::source::{Scratch, Source};
use super::tone::ToneCurve;

/// Rings of half vectors around the normal, and half vectors in each.
const RINGS: usize = 96;
const SPOKES: usize = 56;

/// Pixels across the sheet in the picture, and around everything.
const SIDE: usize = 640;
const GAP: usize = 16;

/// How high the eye is over the sheet: 45 degrees.
const ELEVATION: f64 = std::f64::consts::FRAC_PI_4;

/// A white square is a little lighter than what a mirror shows of it: half of its light, by curves over the half angle.
const TONE: ToneCurve = ToneCurve { exposure: 1.4, knee: 0.4 };

/// An upright checkerboard that gives light. The unit of length is the width of the sheet, whose middle is the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// How far behind the middle of the sheet its plane is.
    pub behind: f64,
    /// Half its width.
    pub half: f64,
    /// Its height over the plane of the sheet, on which it stands.
    pub height: f64,
    /// The side of a square. Two meet over the middle of the sheet.
    pub square: f64,
    /// Radiance of the squares: of the first at the right of the middle, and of its neighbours.
    pub light: [f64; 2],
}

impl Board {
    /// A board that an eye at this elevation sees everywhere in a sheet of this length.
    fn behind(length: f64, elevation: f64) -> Board {
        let behind = 0.5 * length + 0.02;
        let height = 1.1 * (behind + 0.5 * length) * elevation.tan();
        Board { behind, half: 0.6, height, square: 0.1, light: [1.0, 0.02] }
    }

    /// Mean radiance of a rectangle on it, of which these are the parts across and up.
    fn mean(&self, across: Part, up: Part) -> f64 {
        let [a, b] = self.light;
        0.5 * (a + b) * across.inside * up.inside + 0.5 * (a - b) * across.signed * up.signed
    }

    fn across(&self, middle: f64, width: f64) -> Part {
        Part::of(middle, width, [-self.half, self.half], self.square)
    }

    fn up(&self, middle: f64, width: f64) -> Part {
        Part::of(middle, width, [0.0, self.height], self.square)
    }
}

/// What a piece of a line covers of stripes of +1 and -1.
#[derive(Clone, Copy)]
struct Part {
    /// The part of the piece that lies on the stripes.
    inside: f64,
    /// The mean of the stripes over the piece.
    signed: f64,
}

impl Part {
    fn of(middle: f64, width: f64, [from, to]: [f64; 2], stripe: f64) -> Part {
        let (low, high) = ((middle - 0.5 * width).max(from), (middle + 0.5 * width).min(to));
        if high <= low {
            return Part { inside: 0.0, signed: 0.0 };
        }
        // The integral of the stripes from 0; boards have fewer than 8192. Rounding down by a cast is five times as fast as a remainder.
        let integral = |at: f64| {
            let pairs = at / (2.0 * stripe) + 4096.0;
            let part = pairs - f64::from(pairs as u32);
            2.0 * stripe * part.min(1.0 - part)
        };
        Part { inside: (high - low) / width, signed: (integral(high) - integral(low)) / width }
    }
}

/// Where an eye in a direction looks by one half vector.
struct Ray {
    ring: usize,
    /// `4 (v h) cos_i` times the solid angle of the half vector.
    weight: f64,
    /// How far across and up it goes for each unit towards the board, and how wide its footprint becomes.
    slope: [f64; 2],
    spread: [f64; 2],
}

/// The half angles of the rings.
fn rings() -> impl Iterator<Item = f64> {
    (0..RINGS).map(|i| FRAC_PI_2 * ((i as f64 + 0.5) / RINGS as f64).powi(2))
}

/// The rays that rise towards the board.
fn rays(elevation: f64) -> Vec<Ray> {
    let (sin, cos) = elevation.sin_cos();
    // The mirrored direction to the light, and the cosine between eye and half vector.
    let light = |theta: f64, phi: f64| {
        let h = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
        let vh = sin * h[2] - cos * h[1];
        ([2.0 * vh * h[0], 2.0 * vh * h[1] + cos, 2.0 * vh * h[2] - sin], vh)
    };
    let slope = |theta: f64, phi: f64| {
        let ([x, y, z], _) = light(theta, phi);
        [x / y, z / y]
    };
    let edge = |ring: usize| FRAC_PI_2 * (ring as f64 / RINGS as f64).powi(2);
    let mut rays = Vec::new();
    for (ring, theta) in rings().enumerate() {
        let solid_angle = (edge(ring).cos() - edge(ring + 1).cos()) * TAU / SPOKES as f64;
        for spoke in 0..SPOKES {
            // Turned from ring to ring, so that spokes make no pattern.
            let phi = TAU * (spoke as f64 / SPOKES as f64 + 0.618_033_988_749_895 * ring as f64);
            let (l, vh) = light(theta, phi);
            if vh <= 0.0 || l[1] < 1e-3 || l[2] <= 0.0 {
                continue;
            }
            // Twice the slopes' change over a small step, to the sides of the half vector's field.
            const STEP: f64 = 1e-4;
            let at = slope(theta, phi);
            let (further, beside) = (slope(theta + STEP, phi), slope(theta, phi + STEP));
            let spread = std::array::from_fn(|c| {
                let along = (further[c] - at[c]) / STEP * (edge(ring + 1) - edge(ring));
                let around = (beside[c] - at[c]) / STEP * TAU / SPOKES as f64;
                along.hypot(around)
            });
            rays.push(Ray { ring, weight: 4.0 * vh * l[2] * solid_angle, slope: at, spread });
        }
    }
    rays
}

/// What an eye far away, in front and at an elevation, sees of a sheet before a board, `width` pixels across: a pixel is a
/// place on the sheet, whose length looks shorter.
///
/// # Errors
/// A tabulation without half angles, tables that do not match each other, or a size out of range.
pub fn mirrored(
    source: &Source,
    board: &Board,
    elevation: f64,
    width: usize,
    observer: &dyn Observer,
) -> Result<Radiance, PreviewError> {
    let space = source.space();
    if space.angles().is_empty() {
        return Err(PreviewError::NoAngles { columns: space.columns() });
    }
    let (across, down) = source.size();
    let length = down as f64 / across.max(1) as f64;
    let height = ((length * elevation.sin() * width as f64).round() as usize).max(1);
    let lines = source.lines(width, height, DOCUMENT_SAMPLES)?;
    let curves = Curves::new(space, &lines);
    let angles: Vec<f64> = rings().collect();
    let rays = rays(elevation);
    observer.begin("mirroring a board", height as u64);
    let mut pixels = vec![[0.0f32; 4]; width * height];
    pixels.par_chunks_exact_mut(width).enumerate().for_each_init(Scratch::default, |scratch, (y, out)| {
        let tall = length / height as f64;
        let to = board.behind - length * (0.5 - (y as f64 + 0.5) / height as f64);
        // What does not depend on the place across.
        let part = |ray: &Ray| {
            let wide = (to * ray.spread[1]).hypot(tall * ray.slope[1]);
            board.up(to * ray.slope[1], wide.max(1e-9))
        };
        let rays: Vec<(&Ray, Part, f64)> = rays
            .iter()
            .map(|ray| (ray, part(ray), (to * ray.spread[0]).hypot(1.0 / width as f64)))
            .filter(|(_, up, _)| up.inside > 0.0)
            .collect();
        let mut x = 0;
        lines.each(y, scratch, |mean| {
            let place = (x as f64 + 0.5) / width as f64 - 0.5;
            let mut light = [0.0; RINGS];
            for (ray, up, wide) in &rays {
                let across = board.across(place + to * ray.slope[0], *wide);
                light[ray.ring] += ray.weight * board.mean(across, *up);
            }
            let mut sum = [0.0; 3];
            for (&theta, light) in angles.iter().zip(light).filter(|(_, light)| *light > 0.0) {
                let f = curves.at(theta, &mean);
                (0..3).for_each(|c| sum[c] += f64::from(f[c]) * light);
            }
            let [r, g, b] = sum.map(|v| v as f32);
            out[x] = [r, g, b, 1.0];
            x += 1;
        });
        observer.advance(1);
    });
    observer.end();
    Ok(Radiance { width, height, pixels })
}

/// The board itself, as the same eye sees it.
fn seen(board: &Board, elevation: f64, width: usize) -> Radiance {
    let (unit, squeezed) = (width as f64, width as f64 * elevation.cos());
    let (across, down) =
        ((2.0 * board.half * unit).round() as usize, (board.height * squeezed).round() as usize);
    let pixel = |i: usize| {
        let x = (i % across) as f64 + 0.5;
        let z = (down - i / across) as f64 - 0.5;
        let light = board
            .mean(board.across(x / unit - board.half, 1.0 / unit), board.up(z / squeezed, 1.0 / squeezed));
        let light = light as f32;
        [light, light, light, 1.0]
    };
    Radiance { width: across, height: down, pixels: (0..across * down).map(pixel).collect() }
}

/// The part of a board that is shown, so that the sheet fills the picture: as wide as it, and half as high,
/// but at least two squares.
fn shown(board: Radiance, sheet: usize) -> Radiance {
    let (left, squares) = ((board.width - SIDE) / 2, SIDE / 7);
    let height = (sheet / 2).max(squares).min(board.height);
    let rows = board.pixels.chunks_exact(board.width).skip(board.height - height);
    let pixels = rows.flat_map(|row| &row[left..left + SIDE]).copied().collect();
    Radiance { width: SIDE, height, pixels }
}

/// Figure 2: a print, and the foot of the board that it mirrors.
///
/// # Errors
/// Those of [`mirrored`].
pub fn near_picture(
    heading: Heading,
    source: &Source,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>, PreviewError> {
    let (across, down) = source.size();
    let board = Board::behind(down as f64 / across.max(1) as f64, ELEVATION);
    let sheet = mirrored(source, &board, ELEVATION, SIDE, observer)?;
    let board_picture = shown(seen(&board, ELEVATION, SIDE), sheet.height);
    // What lies between the far edge of the sheet and the foot of the board.
    let between = (0.02 * ELEVATION.sin() * SIDE as f64).round() as usize;
    let head = GAP + Letters::Title.height() + GAP;
    let foot = head + board_picture.height + between;
    let mut canvas = Canvas::new(board_picture.width + 2 * GAP, foot + sheet.height + GAP)?;
    canvas.heading(heading, GAP, Letters::Title);
    canvas.paste(GAP, head, &board_picture, TONE);
    canvas.paste(GAP, foot, &sheet, TONE);
    Ok(canvas.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::{Space, Table};
    use appearance::factor::Factored;
    use appearance::weights::WeightMaps;
    use observe::Silent;
    use std::f64::consts::PI;

    const BOARD: Board = Board { behind: 0.55, half: 0.6, height: 1.2, square: 0.1, light: [1.0, 0.0] };
    const WIDTH: usize = 60;

    /// A square sheet of one material.
    fn sheet(f: impl Fn(f64) -> f64, samples: usize) -> Factored {
        let space = Space::half_angle(samples);
        let mut bases = Table::new(space.columns());
        bases.push(&space.angles().iter().flat_map(|&t| [f(t); 3]).collect::<Vec<_>>());
        Factored { space, bases, maps: WeightMaps::uniform(8, 8) }
    }

    fn lit(f: impl Fn(f64) -> f64, samples: usize) -> Radiance {
        mirrored(&Source::Factored(&sheet(f, samples)), &BOARD, ELEVATION, WIDTH, &Silent).unwrap()
    }

    /// The place of a pixel on the sheet.
    fn place(picture: &Radiance, i: usize) -> [f64; 2] {
        let at = |i: usize, n: usize| (i as f64 + 0.5) / n as f64 - 0.5;
        [at(i % WIDTH, WIDTH), -at(i / WIDTH, picture.height)]
    }

    /// Squares of the board as (left, foot, light), cut off at its edges.
    fn squares() -> Vec<([f64; 4], f64)> {
        let mut squares = Vec::new();
        for i in -6..6 {
            for j in 0..12 {
                let (x, z) = (f64::from(i) * BOARD.square, f64::from(j) * BOARD.square);
                let light = BOARD.light[usize::from((i + j) % 2 != 0)];
                squares.push(([x, x + BOARD.square, z, z + BOARD.square], light));
            }
        }
        squares
    }

    /// A mirror shows the square that the mirrored ray meets.
    #[test]
    fn a_mirror_shows_the_squares_where_geometry_says() {
        let picture = lit(|t| 0.9 * inks::ggx::lobe(t, 0.006), 256);
        let (mut right, mut bright, mut dark) = (0, 0.0f64, 0.0f64);
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let [x, y] = place(&picture, i);
            let z = (BOARD.behind - y) * ELEVATION.tan();
            // Away from the edges of squares.
            let middle = |v: f64| ((v / BOARD.square).rem_euclid(1.0) - 0.5).abs() < 0.25;
            if !(middle(x) && middle(z)) || z > BOARD.height {
                continue;
            }
            right += 1;
            let light = ((x / BOARD.square).floor() + (z / BOARD.square).floor()).rem_euclid(2.0) == 0.0;
            // Curves over the half angle reflect with both cosines.
            let found = f64::from(pixel[1]) / ELEVATION.sin().powi(2);
            if light {
                assert!((0.75..0.91).contains(&found), "{x} {y}: {found}");
                bright = bright.max(found);
            } else {
                assert!(found < 0.15, "{x} {y}: {found}");
                dark = dark.max(found);
            }
        }
        assert!(right > 300 && bright > 0.8 && dark < bright, "{right} {bright} {dark}");
    }

    /// The irradiance of a polygon (Lambert's formula), at a point of the sheet with its normal up.
    fn irradiance(at: [f64; 2], [left, right, foot, top]: [f64; 4]) -> f64 {
        let corners = [[left, foot], [right, foot], [right, top], [left, top]].map(|[x, z]| {
            let v = [x - at[0], BOARD.behind - at[1], z];
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            v.map(|c| c / length)
        });
        let edge = |a: [f64; 3], b: [f64; 3]| {
            let dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let length = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
            if length > 0.0 { dot.clamp(-1.0, 1.0).acos() * cross[2] / length } else { 0.0 }
        };
        0.5 * (0..4).map(|i| edge(corners[i], corners[(i + 1) % 4])).sum::<f64>().abs()
    }

    #[test]
    fn lambertian_paper_receives_what_the_closed_form_says() {
        let picture = lit(|_| 0.6 / PI, 8);
        for (i, pixel) in picture.pixels.iter().enumerate().step_by(37) {
            let at = place(&picture, i);
            let expected: f64 =
                squares().iter().map(|(square, light)| light * irradiance(at, *square)).sum::<f64>() * 0.6
                    / PI;
            let found = f64::from(pixel[1]);
            assert!((found / expected - 1.0).abs() < 0.02, "{at:?}: {found}, not {expected}");
        }
    }

    /// The reflection as an integral over the squares of the board, a grid of lamps each, with the lobe itself.
    fn over_the_board(f: impl Fn(f64) -> f64, at: [f64; 2], lamps: usize) -> f64 {
        let v = [0.0, -ELEVATION.cos(), ELEVATION.sin()];
        let mut sum = 0.0;
        for ([left, _, foot, _], light) in squares().into_iter().filter(|(_, light)| *light > 0.0) {
            let side = BOARD.square / lamps as f64;
            for k in 0..lamps * lamps {
                let (x, z) = (
                    left + ((k % lamps) as f64 + 0.5) * side - at[0],
                    foot + ((k / lamps) as f64 + 0.5) * side,
                );
                let y = BOARD.behind - at[1];
                let square = x * x + y * y + z * z;
                let l = [x, y, z].map(|c| c / square.sqrt());
                let h: [f64; 3] = std::array::from_fn(|c| l[c] + v[c]);
                let length = h.iter().map(|c| c * c).sum::<f64>().sqrt();
                sum += light * f((h[2] / length).min(1.0).acos()) * l[2] * l[1] / square * side * side;
            }
        }
        sum
    }

    #[test]
    fn what_is_mirrored_is_the_integral_over_the_board() {
        for (body, f0, alpha) in [(0.02, 0.8, 0.06), (0.2, 0.04, 0.12), (0.05, 0.5, 0.3)] {
            let f = |t: f64| body + f0 * inks::ggx::lobe(t, alpha);
            let picture = lit(f, 128);
            let brightest = picture.pixels.iter().map(|p| f64::from(p[1])).fold(0.0, f64::max);
            let mut worst = 0.0f64;
            for (i, pixel) in picture.pixels.iter().enumerate().step_by(97) {
                // The mean over the pixel.
                let [x, y] = place(&picture, i);
                let part = |k: usize, n: usize| ((k as f64 + 0.5) / 3.0 - 0.5) / n as f64;
                let places = (0..9).map(|k| [x + part(k % 3, WIDTH), y + part(k / 3, picture.height)]);
                let expected = places.map(|at| over_the_board(f, at, 24)).sum::<f64>() / 9.0;
                worst = worst.max((f64::from(pixel[1]) - expected).abs() / brightest);
            }
            println!("alpha {alpha}: greatest error {worst:.4} of the brightest");
            assert!(worst < 0.02, "{alpha}: {worst}");
        }
    }

    /// Contrast between squares falls with the distance to the board and with the width of the lobe.
    #[test]
    fn reflections_blur_with_distance_and_with_roughness() {
        let contrast = |alpha: f64| {
            let picture = lit(|t| 0.8 * inks::ggx::lobe(t, alpha), 128);
            // Of the light over white squares and over black ones in the row that mirrors this height, in the middle of the sheet.
            let at = |z: f64| {
                let y = BOARD.behind - z / ELEVATION.tan();
                let row = ((0.5 - y) * picture.height as f64) as usize;
                let mut light = [0.0; 2];
                for x in WIDTH / 5..WIDTH - WIDTH / 5 {
                    let square = (((x as f64 + 0.5) / WIDTH as f64 - 0.5) / BOARD.square).floor();
                    let dark = (square + (z / BOARD.square).floor()).rem_euclid(2.0) > 0.5;
                    light[usize::from(dark)] += f64::from(picture.pixels[row * WIDTH + x][1]);
                }
                (light[0] - light[1]) / (light[0] + light[1])
            };
            [at(0.15), at(0.85)]
        };
        let all = [0.01, 0.03, 0.06, 0.12].map(contrast);
        println!("{all:.3?}");
        for [near, far] in all {
            assert!(near > 1.1 * far, "{all:?}");
        }
        for pair in all.windows(2) {
            assert!(pair[0][0] > pair[1][0] && pair[0][1] > pair[1][1] - 0.001, "{all:?}");
        }
        assert!(all[0][1] > 0.4 && all[3][1] < 0.02, "{all:?}");
    }
}
