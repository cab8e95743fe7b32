//! How much light counts for each pixel of a document that is sharper than the inks.
//!
//! Problem: its materials are judged one by one ([`super::selection::sharp`]), and nothing may jump where one
//! shades into another. Method: a target has the mean over all materials, each by the inverse fourth power of
//! its distance (D. Shepard 1968). Cost: a comparison with each material, in such documents alone. Limits:
//! distances are those of summaries.

use maths::Maths as _;

/// Numbers in the summary of a target. Source: as many as where a fit starts is found by.
const NUMBERS: usize = 16;

/// A target in a few numbers.
pub(super) type Summary = [f32; NUMBERS];

/// How many times light counts for each material of a document.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shine(pub Vec<(Summary, f64)>);

impl Shine {
    /// How many times light counts for a target.
    pub fn times(&self, summary: &Summary) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        for (known, times) in &self.0 {
            let far: f32 = known.iter().zip(summary).map(|(a, b)| (a - b) * (a - b)).sum();
            let near = 1.0 / f64::from(far.max(1e-12)).squared();
            sum += near * times;
            all += near;
        }
        sum / all
    }
}
