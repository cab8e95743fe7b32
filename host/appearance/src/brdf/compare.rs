//! Two curves of one stack, side by side: how far they differ, and whether the measurement could tell.
//!
//! Problem: two libraries never agree exactly; which differences are more than the measurement's own uncertainty?
//! Method: distance d and the distance in light say what people see. Sample by sample, a difference is within the
//! measurement if it is at most two standard deviations, those of both curves together; the curves agree if 95 % of the
//! samples that were seen are. The band is the distance d that two standard deviations everywhere would make.
//! Cost: one evaluation of both curves at the angles of the space. Limits: a curve without standard deviations counts as
//! exact, and so does a model; where neither has any, there is no verdict.

use inks::Entry;
use maths::Maths;
use serde::Serialize;

use super::space::Space;

/// Standard deviations that are still no difference: two of them hold 95 % of a normal distribution's values.
const BAND: f64 = 2.0;
/// The share of samples that has to lie within, as the band of two deviations would have it: 95 %.
const AGREE: f64 = 0.95;
/// The largest half angle in degrees whose ratio is reported: measured curves must hold up to there
/// (decisions/curves-from-photographs.md), and beyond it are extrapolated.
const WIDEST: f64 = 60.0;

/// How two curves differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Distance d (0.01: barely visible; 0.05: obvious).
    pub distance: f64,
    /// Distance in light.
    pub light: f64,
    /// Distance d that two standard deviations at all angles would make; `None` if neither curve has any.
    pub band: Option<f64>,
    /// Whether the difference is within the measurement; `None` if that cannot be said.
    pub within: Option<bool>,
    /// The largest ratio of the second to the first, or its inverse, up to 60 degrees.
    pub largest: Largest,
}

/// Where two curves differ most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Largest {
    /// Half angle in degrees.
    pub theta_deg: f64,
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// The second curve's value by the first one's.
    pub ratio: f64,
}

/// Compares two curves in a half-angle space.
pub fn compare(space: &Space, a: &Entry, b: &Entry) -> Difference {
    let (first, second) = (space.row(&a.curve_at(space.angles())), space.row(&b.curve_at(space.angles())));
    let known: Vec<_> = [a, b].into_iter().filter_map(|entry| entry.uncertainty.as_ref()).collect();
    let mut largest = Largest { theta_deg: 0.0, channel: 1, ratio: 1.0 };
    let (mut inside, mut compared) = (0usize, 0usize);
    let (mut middle, mut above) = (Vec::new(), Vec::new());
    for (n, &theta) in space.angles().iter().enumerate() {
        let seen = known.iter().all(|u| u.is_measured(theta));
        for channel in 0..3 {
            let (x, y) = (first[3 * n + channel], second[3 * n + channel]);
            let sigma = BAND * known.iter().map(|u| u.at(theta)[channel].squared()).sum::<f64>().sqrt();
            middle.push(0.5 * (x + y));
            above.push(0.5 * (x + y) + sigma);
            if seen {
                compared += 1;
                inside += usize::from((x - y).abs() <= sigma);
            }
            let ratio = y.max(1e-9) / x.max(1e-9);
            if theta.to_degrees() <= WIDEST && ratio.logarithm().abs() > largest.ratio.logarithm().abs() {
                largest = Largest { theta_deg: theta.to_degrees(), channel, ratio };
            }
        }
    }
    let can_tell = !known.is_empty() && compared > 0;
    Difference {
        distance: space.distance(&first, &second),
        light: space.light_distance(&first, &second),
        band: (!known.is_empty()).then(|| space.distance(&middle, &above)),
        within: can_tell.then_some(inside as f64 >= AGREE * compared as f64),
        largest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::{Curve, Library, Uncertainty};
    use std::path::Path;

    /// A flat curve with this relative standard deviation, as measured.
    fn flat(value: f64, relative: Option<f64>) -> Entry {
        let mut entry = Library::builtin().entries()[0].clone();
        entry.lobes = None;
        entry.curve = Curve::new(vec![0.0, 1.5], vec![[value; 3]; 2]).unwrap();
        let rows = |s: f64| format!("theta_h_deg,r_sigma,g_sigma,b_sigma\n0,{s},{s},{s}\n90,{s},{s},{s}\n");
        entry.uncertainty =
            relative.and_then(|r| Uncertainty::from_csv(&rows(r * value), Path::new("x.csv")).unwrap());
        entry
    }

    /// Flat curves have a closed form: the difference of cube roots times the root of 9/8.
    #[test]
    fn a_difference_is_judged_against_the_band() {
        let space = Space::half_angle(256);
        let d = |a: f64, b: f64| (a.cbrt() - b.cbrt()).abs() * (9.0f64 / 8.0).sqrt();
        let near = compare(&space, &flat(0.1, Some(0.02)), &flat(0.104, Some(0.02)));
        assert!((near.distance - d(0.1, 0.104)).abs() < 1e-5, "{near:?}");
        // Two standard deviations of both: 0.1 and 0.104 times 2 %, as sides of a right angle.
        let sigma = 2.0 * 0.002f64.hypot(0.00208);
        assert!((near.band.unwrap() - d(0.102, 0.102 + sigma)).abs() < 1e-5);
        assert_eq!(near.within, Some(true));
        assert!((near.largest.ratio - 1.04).abs() < 1e-9);
        let far = compare(&space, &flat(0.1, Some(0.02)), &flat(0.11, Some(0.02)));
        assert_eq!(far.within, Some(false));
        let unknown = compare(&space, &flat(0.1, None), &flat(0.11, None));
        assert!(unknown.band.is_none() && unknown.within.is_none());
        let same = compare(&space, &flat(0.1, Some(0.0)), &flat(0.1, None));
        assert_eq!((same.distance, same.within), (0.0, Some(true)));
    }
}
