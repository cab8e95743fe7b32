//! Four steps of gloss over one colour: figure 5 of the paper as a document.
//!
//! The specular part is 100, 80, 50 and 10 percent of one lobe, and the diffuse part is the same in all steps. Only a
//! mapping that preserves relative gloss preserves four steps.

use super::canvas::{Point, byte, encode, inside, mix};
use super::painting::{Finish, Painting};

/// Shares of the full gloss, from the left: any would do of which neighbours differ visibly.
const STEPS: [f32; 4] = [1.0, 0.8, 0.5, 0.1];

/// Reflectance at normal incidence for full gloss: any would do.
const FULL: f32 = 0.6;

/// The diffuse albedo, linear: a dark blue, so that gloss is seen against it. Any would do.
const DIFFUSE: [f32; 3] = [0.05, 0.10, 0.17];

/// Any size would do; golden jobs hold this one.
const WIDTH: usize = 1024;
/// As [`WIDTH`]: any would do.
const HEIGHT: usize = 320;

/// A square with rounded corners: distance from its edge.
fn square(p: Point, centre: Point, half: f32, corner: f32) -> f32 {
    let x = ((p[0] - centre[0]).abs() - half + corner).max(0.0);
    let y = ((p[1] - centre[1]).abs() - half + corner).max(0.0);
    let outside = (x * x + y * y).sqrt() - corner;
    let within = ((p[0] - centre[0]).abs().max((p[1] - centre[1]).abs()) - half).min(0.0);
    if outside > -corner { outside } else { within }
}

/// Draws the ladder.
pub fn draw() -> Painting {
    let pixels = WIDTH * HEIGHT;
    let (mut base, mut f0, mut glossiness) =
        (Vec::with_capacity(pixels), Vec::with_capacity(pixels), Vec::with_capacity(pixels));
    for i in 0..pixels {
        let p = [(i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5];
        let step = (p[0] as usize / 256).min(3);
        let centre = [step as f32 * 256.0 + 128.0, HEIGHT as f32 / 2.0];
        let share = inside(square(p, centre, 104.0, 14.0));
        // Matte white around the steps shows the paper.
        let specular = mix(0.04, STEPS[step] * FULL, share);
        // Readers dim the diffuse part by 1 - f0; dividing by it first gives all steps the same diffuse part.
        base.push(DIFFUSE.map(|v| encode(mix(0.8, v / (1.0 - STEPS[step] * FULL), share))));
        f0.push([encode(specular); 3]);
        glossiness.push(byte(mix(0.1, 0.65, share)));
    }
    Painting {
        width: WIDTH,
        height: HEIGHT,
        base,
        finish: Finish::Specular { f0, glossiness },
        size: (1600, 500),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Space;

    #[test]
    fn the_steps_differ_in_gloss_alone() {
        let surfaces = draw().surfaces(Space::half_angle(8));
        let at = |step: usize| surfaces.surface(HEIGHT / 2 * WIDTH + step * 256 + 128);
        for (step, share) in STEPS.into_iter().enumerate() {
            let surface = at(step);
            assert!(surface.f0.iter().all(|f0| (f0 / (FULL * share) - 1.0).abs() < 0.03), "{surface:?}");
            for (found, wanted) in surface.diffuse.into_iter().zip(DIFFUSE) {
                assert!((found / wanted - 1.0).abs() < 0.04, "{surface:?}");
            }
            assert_eq!(surface.alpha, at(0).alpha);
        }
    }
}
