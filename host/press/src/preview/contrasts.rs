//! How much of each of two pictures is seen in each of their two views, on the dots of a print.
//!
//! Problem: [`views`] keeps two pictures apart in the target; mapping, halftone and clusters may mix them
//! again.
//! Method: document and print are averaged over cells that the eye resolves. In each view the luminance of
//! the print's cells is fitted by `c + p a + q b`, `a` and `b` the luminance of the pictures, 0 to 1 (least
//! squares). The contrast of a picture is the difference in lightness, cube roots, between its white and
//! its black where the other picture is as on average, under the white of the view: bare paper straight on,
//! the brightest that the second picture shows in the reflection.
//! Cost: one pass over the dots, 24 multiply-adds a cell. Limits: luminance alone; two pictures that
//! resemble each other (correlation beyond [`ALIKE`]) cannot be told apart, and have no figures.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use std::fmt;

use appearance::factor::Factored;
use appearance::srgb::luminance;
use appearance::views::{REFLECTION, STRAIGHT, Views, contrast};
use sheet::DOTS_PER_MM;

use super::error::PreviewError;
use super::fidelity::spot_mm;
use super::source::Source;

/// The correlation from which pictures are alike.
const ALIKE: f64 = 0.99;

/// The most cells across and down, for the memory's sake.
const MOST_CELLS: usize = 256;

/// The contrast of both pictures in both views: 1 from the black to the white of the view, negative if
/// inverted.
#[derive(Clone, Debug, PartialEq)]
pub struct Contrasts {
    /// The names of the pictures.
    pub names: [String; 2],
    /// Of the first and the second picture with the light beside the eye.
    pub straight: [f64; 2],
    /// Of both in the reflection of the light.
    pub reflection: [f64; 2],
}

impl Contrasts {
    /// Whether each picture is seen in its own view, and more than the other one there.
    pub fn lost(&self) -> Option<&str> {
        let weak = |own: f64, other: f64| own < appearance::views::FAINTEST || own <= other.abs();
        if weak(self.straight[0], self.straight[1]) {
            return Some(&self.names[0]);
        }
        weak(self.reflection[1], self.reflection[0]).then_some(&self.names[1])
    }
}

impl fmt::Display for Contrasts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.names;
        // Adding 0 turns a negative zero into the positive one.
        let [straight, reflection] =
            [self.straight, self.reflection].map(|view| view.map(|v| (100.0 * v).round() / 100.0 + 0.0));
        write!(
            f,
            "straight on (lamp at 45°) {a} has a contrast of {:.2} and {b} {:.2}; in the reflection of the lamp {b} has {:.2} and {a} {:.2} (1: \
             from black to white; 0.1: just seen)",
            straight[0], straight[1], reflection[1], reflection[0]
        )
    }
}

/// Measures a print, seen from `metres`; `None` if the pictures are alike.
///
/// # Errors
/// Tables that do not match their sources.
pub fn contrasts(
    target: &Factored,
    views: &Views,
    print: &Source,
    metres: f64,
) -> Result<Option<Contrasts>, PreviewError> {
    let Source::Print { stacks, space, .. } = *print else { return Ok(None) };
    let cell = (spot_mm(metres) * DOTS_PER_MM).max(1.0);
    let (across, down) = print.size();
    // Lengths are far below 2^32 dots.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cells = |dots: usize| ((dots as f64 / cell) as usize).clamp(2, MOST_CELLS);
    let (width, height) = (cells(across), cells(down));
    let shown = Source::Factored(target).shares(width, height)?.unwrap_or_default();
    let shares = print.shares(width, height)?.unwrap_or_default();
    let looks: Vec<[f64; 2]> = stacks
        .rows()
        .map(|row| {
            let curve = space.curve(row);
            [STRAIGHT, REFLECTION].map(|angle| luminance(curve.at(angle)))
        })
        .collect();
    let pictures = sums(&shown, &views.shown);
    let prints = sums(&shares, &looks);
    let Some(fit) = Fit::new(&pictures, &prints) else { return Ok(None) };
    let names = views.names.clone();
    let white = fit.ends(1, 1)[1];
    let seen = |view: usize, white: f64| {
        [0, 1].map(|picture| {
            let [dark, bright] = fit.ends(view, picture);
            contrast(dark, bright, white)
        })
    };
    let (straight, reflection) = (seen(0, views.white), seen(1, white.max(f64::MIN_POSITIVE)));
    Ok(Some(Contrasts { names, straight, reflection }))
}

/// The mean of a table of pairs at each place.
fn sums(shares: &[f32], table: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mean = |shares: &[f32]| {
        shares.iter().zip(table).fold([0.0; 2], |[a, b], (&share, value)| {
            let share = f64::from(share);
            [a + share * value[0], b + share * value[1]]
        })
    };
    shares.chunks_exact(table.len().max(1)).map(mean).collect()
}

/// The least squares fit of two views by two pictures.
struct Fit {
    /// The mean of each picture.
    means: [f64; 2],
    /// For each view: its mean, and the slopes along both pictures.
    views: [(f64, [f64; 2]); 2],
}

impl Fit {
    fn new(pictures: &[[f64; 2]], prints: &[[f64; 2]]) -> Option<Fit> {
        let n = pictures.len().min(prints.len()) as f64;
        let mean = |values: &[[f64; 2]], k: usize| values.iter().map(|v| v[k]).sum::<f64>() / n;
        let means = [0, 1].map(|k| mean(pictures, k));
        let product = |f: &dyn Fn(usize) -> f64| (0..pictures.len()).map(f).sum::<f64>() / n;
        let off = |i: usize, k: usize| pictures[i][k] - means[k];
        let [aa, ab, bb] = [(0, 0), (0, 1), (1, 1)].map(|(k, l)| product(&|i| off(i, k) * off(i, l)));
        let det = aa * bb - ab * ab;
        if !(n > 0.0 && aa > 0.0 && bb > 0.0 && ab * ab <= ALIKE * ALIKE * aa * bb && det > 0.0) {
            return None;
        }
        let views = [0, 1].map(|view| {
            let level = mean(prints, view);
            let [ay, by] = [0, 1].map(|k| product(&|i| off(i, k) * (prints[i][view] - level)));
            (level, [(bb * ay - ab * by) / det, (aa * by - ab * ay) / det])
        });
        Some(Fit { means, views })
    }

    /// The luminance of a view where one picture is black and where it is white, the other as on average.
    fn ends(&self, view: usize, picture: usize) -> [f64; 2] {
        let (level, slopes) = self.views[view];
        [0.0, 1.0].map(|value| level + slopes[picture] * (value - self.means[picture]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_finds_what_each_picture_does_to_each_view() {
        // Two pictures that overlap in part; y = 0.02 + 0.1 a + 0.03 b straight on, 1 + 0 a + 5 b in the
        // reflection.
        let pictures: Vec<[f64; 2]> =
            (0..64).map(|i| [f64::from(i % 8) / 7.0, f64::from((i / 8 + i % 8) % 5) / 4.0]).collect();
        let prints: Vec<[f64; 2]> =
            pictures.iter().map(|[a, b]| [0.02 + 0.1 * a + 0.03 * b, 1.0 + 5.0 * b]).collect();
        let fit = Fit::new(&pictures, &prints).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        near(fit.views[0].1[0], 0.1);
        near(fit.views[0].1[1], 0.03);
        near(fit.views[1].1[0], 0.0);
        near(fit.ends(1, 1)[1] - fit.ends(1, 1)[0], 5.0);
        // A picture and itself cannot be told apart.
        let same: Vec<[f64; 2]> = pictures.iter().map(|[a, _]| [*a, *a]).collect();
        assert!(Fit::new(&same, &prints).is_none());
    }

    #[test]
    fn a_picture_is_lost_where_the_other_is_stronger_or_it_is_faint() {
        let found =
            |straight, reflection| Contrasts { names: ["a", "b"].map(String::from), straight, reflection };
        assert_eq!(found([0.6, 0.02], [0.03, 0.5]).lost(), None);
        assert_eq!(found([0.6, -0.7], [0.03, 0.5]).lost(), Some("a"));
        assert_eq!(found([0.6, 0.02], [0.03, 0.09]).lost(), Some("b"));
        assert_eq!(found([0.6, 0.02], [0.3, 0.2]).lost(), Some("b"));
    }
}
