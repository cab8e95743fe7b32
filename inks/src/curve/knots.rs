//! Reflectance between the samples of a curve.
//!
//! Problem: 32 samples must stand for lobes that fall by four decades within a few degrees and rise again as 1 / cos toward
//! 90 degrees. Straight lines between them are up to 25 % wrong.
//! Method: cubic Hermite pieces of ln f over `x = 4 sqrt(theta) - ln(cos^2 theta + e^2) / 2`, e = 0.03. In x every lobe is
//! smooth on the scale of the square-root grid, at its peak and at grazing angles alike. Slopes are those of the polynomial
//! through five samples, limited after Fritsch and Carlson (1980), so that f is monotone between samples that are. A sample
//! that is an extremum gets slope 0, or that of the parabola through it and its neighbours if the second differences there
//! and beside it have the same sign, as at the bottom of a lobe and never in alternating noise.
//! Below the first sample f is even in theta, so `ln f` goes on as a parabola in theta; above the last one it is constant.
//! Beside a sample that is 0, f is linear in x.
//! Cost: seven logarithms and an exponential a value. Error with 32 samples: a test of [`Curve`](crate::Curve) has it.
//! Limits: beyond an extremum a value may exceed the sample by 2/27 of the larger step to a neighbour, in ln f; beyond
//! 81.7 degrees, the last but one of 32 samples, errors grow to 2 % (`docs/decisions/between-samples.md`).

use maths::Maths;

/// Samples that a slope depends on.
const WINDOW: usize = 5;
/// The cosine below which ln f is no longer stretched: 88 degrees.
const GRAZING: f64 = 0.03;
/// The steepest slope of a monotone piece, in slopes of its chord (Fritsch and Carlson).
const STEEPEST: f64 = 3.0;
/// The largest part of the first step by which ln f is continued towards 0 degrees: that of samples at 1, 2, 3 steps.
const CONTINUED: f64 = 1.0 / 3.0;

/// The angles of a curve, prepared for reading values between them. See the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Knots {
    theta: Vec<f64>,
    x: Vec<f64>,
    /// For each angle, the first sample of its window, and the weight of each sample in the derivative there.
    derivative: Vec<(usize, [f64; WINDOW])>,
}

/// An angle between the knots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnotPosition(Between);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    /// Below the first sample: the part of the first step by which ln f is continued.
    Below(f64),
    /// From a sample by a part of the way to the next one.
    At(usize, f64),
}

fn coordinate(theta: f64) -> f64 {
    let cos = theta.cosine();
    4.0 * theta.abs().sqrt().copysign(theta) - 0.5 * (cos * cos + GRAZING * GRAZING).logarithm()
}

impl Knots {
    /// Prepares angles: radians, ascending, at least one, within 0..=pi/2.
    pub fn new(theta: Vec<f64>) -> Knots {
        let x: Vec<f64> = theta.iter().map(|&t| coordinate(t)).collect();
        let derivative = (0..x.len()).map(|i| derivative(&x, i)).collect();
        Knots { theta, x, derivative }
    }

    /// The angles in radians.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Finds an angle in radians among the knots.
    pub fn place(&self, theta: f64) -> KnotPosition {
        let t = &self.theta;
        let above = t.partition_point(|&t| t <= theta);
        KnotPosition(match above {
            0 if t.len() > 1 => {
                let step = t[1] * t[1] - t[0] * t[0];
                Between::Below(((t[0] * t[0] - theta * theta) / step).clamp(0.0, CONTINUED))
            }
            0 => Between::At(0, 0.0),
            _ if above == t.len() => Between::At(above - 1, 0.0),
            _ => {
                let (from, to) = (self.x[above - 1], self.x[above]);
                let part = (coordinate(theta) - from) / (to - from);
                // Angles that differ in their last digits may have the same x.
                Between::At(above - 1, if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 })
            }
        })
    }

    /// The value at a place; `sample` gives that of each knot, finite and 0 or more.
    #[inline]
    pub fn value(&self, place: KnotPosition, sample: impl Fn(usize) -> f64) -> f64 {
        let (i, s) = match place.0 {
            Between::Below(part) => {
                let (first, second) = (sample(0), sample(1));
                return if first > 0.0 && second > 0.0 {
                    first * (first / second).power(part)
                } else {
                    first
                };
            }
            Between::At(i, 0.0) => return sample(i),
            Between::At(i, s) => (i, s),
        };
        let (from, to) = (sample(i), sample(i + 1));
        if from <= 0.0 || to <= 0.0 {
            return from + s * (to - from);
        }
        // All that the two slopes depend on.
        let first = self.derivative[i].0.min(i.saturating_sub(2));
        let last = self.x.len() - 1;
        let logarithms: [f64; WINDOW + 1] =
            std::array::from_fn(|j| sample((first + j).min(last)).max(f64::MIN_POSITIVE).logarithm());
        let ln = |i: usize| logarithms[i - first];
        let h = self.x[i + 1] - self.x[i];
        let step = (to / from).logarithm();
        let (start, end) = (h * self.slope(i, ln), h * self.slope(i + 1, ln));
        let rest = 1.0 - s;
        from * (s * s * (3.0 - 2.0 * s) * step + s * rest * (rest * start - s * end)).exponential()
    }

    /// The limited slope of `y` over x at knot `i`.
    #[inline]
    fn slope(&self, i: usize, y: impl Fn(usize) -> f64) -> f64 {
        let last = self.x.len() - 1;
        let chord = |i: usize| (y(i + 1) - y(i)) / (self.x[i + 1] - self.x[i]);
        let limited = |slope: f64, most: f64, sign: f64| sign * (sign * slope).clamp(0.0, STEEPEST * most);
        let derivative = |i: usize| {
            let (first, weights) = &self.derivative[i];
            (*first..=last).zip(weights).map(|(j, w)| w * y(j)).sum::<f64>()
        };
        let slope = if last == 0 {
            0.0
        } else if i == 0 {
            let chord = chord(0);
            limited(chord * self.start(), chord.abs(), chord.signum())
        } else if i == last {
            let chord = chord(last - 1);
            limited(derivative(last), chord.abs(), chord.signum())
        } else {
            let (before, after) = (chord(i - 1), chord(i));
            if before * after > 0.0 {
                limited(derivative(i), before.abs().min(after.abs()), after.signum())
            } else if i >= 2 && i + 2 <= last {
                let bend = after - before;
                let smooth = bend * (before - chord(i - 2)) > 0.0 && bend * (chord(i + 1) - after) > 0.0;
                let (left, right) = (self.x[i] - self.x[i - 1], self.x[i + 1] - self.x[i]);
                // A slope over a width exceeds the sample by 4/27 of their product.
                let most = (before * left).abs().max((after * right).abs()) / (2.0 * left.max(right));
                let parabola = (before * right + after * left) / (left + right);
                if smooth { parabola.max(-most).min(most) } else { 0.0 }
            } else {
                0.0
            }
        };
        if slope.is_finite() { slope } else { 0.0 }
    }

    /// The slope at the first knot of a function that is even in theta, in slopes of the first chord.
    fn start(&self) -> f64 {
        let (a, b) = (self.theta[0], self.theta[1]);
        let (sin, cos) = a.sine_cosine();
        let stretch = 2.0 / a.abs().sqrt() + sin * cos / (cos * cos + GRAZING * GRAZING);
        2.0 * a / stretch * (self.x[1] - self.x[0]) / (b * b - a * a)
    }
}

/// The weights of the samples around `i` in the derivative at `i` of the polynomial through them (Lagrange).
fn derivative(x: &[f64], i: usize) -> (usize, [f64; WINDOW]) {
    let count = WINDOW.min(x.len());
    let first = i.saturating_sub(WINDOW / 2).min(x.len() - count);
    let window = &x[first..first + count];
    let here = i - first;
    let mut weights = [0.0; WINDOW];
    for j in (0..count).filter(|&j| j != here) {
        let others = (0..count).filter(|&k| k != j && k != here);
        let ratio: f64 = others.map(|k| (x[i] - window[k]) / (window[j] - window[k])).product();
        weights[j] = ratio / (window[j] - x[i]);
    }
    weights[here] = -weights.iter().sum::<f64>();
    (first, weights)
}
