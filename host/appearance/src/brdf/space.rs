//! The tabulation that every stage works in, and the perceptual metric on it.
//!
//! Problem: Euclidean distance on raw reflectance overweights differences in highlights that nobody notices.
//! Method: a BRDF is a row of columns j = 3 n + channel over configurations n. Each column carries the factor
//! c_j from reflectance to reflected radiance and the root W_j of its quadrature weight; the distance is
//! `d^2 = sum_j W_j^2 (cbrt(f_j c_j) - cbrt(f'_j c_j))^2`, eqs. 2-3 of the 2009 paper's appendix discretised.
//! That distance says how highlights differ, but calls black and a mirror equal when both miss the highlight of a glossy
//! target. So a half-angle space also knows the [albedo](Space::albedo), a linear functional of the row, and the
//! [distance in light](Space::light_distance) between two rows.
//! Only [`Space::half_angle`] knows what a configuration is, so the same code serves any linear tabulation with its own
//! quadrature.
//! Cost: O(columns) per distance. Limits: values below 0 count as 0; cube roots of radiance do not add, only reflectance does.

use maths::Maths;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use inks::Curve;

/// Half angles beyond this one are away from the highlight: a lobe as wide as alpha .35 has a tenth of its peak here.
const DARK: f64 = FRAC_PI_4;

/// The meaning of the columns of a tabulated BRDF. See the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    radiance: Vec<f64>,
    weight: Vec<f64>,
    angles: Vec<f64>,
    light: Vec<f64>,
    dark: Vec<f64>,
}

/// Why some numbers are not a tabulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpaceError {
    /// The lists differ in length or are empty.
    #[error(
        "a tabulation needs one quadrature weight for each cosine and at least one of each; found {cosines} cosines and {weights} weights"
    )]
    Length {
        /// Number of cosines.
        cosines: usize,
        /// Number of weights.
        weights: usize,
    },
    /// A number is negative, infinite or not a number.
    #[error(
        "configuration {sample}: cosine {cosine} and weight {weight} must be finite numbers of 0 or more"
    )]
    Value {
        /// Which configuration.
        sample: usize,
        /// Its cosine.
        cosine: f64,
        /// Its weight.
        weight: f64,
    },
}

impl Space {
    /// Half-angle curves on the square-root grid theta_n = (pi/2) u^2, u = (n + 1/2) / samples, with quadrature
    /// weight `dtheta_n sin theta_n cos theta_n`. At least one sample; 32 are as accurate as 512 uniform ones.
    pub fn half_angle(samples: usize) -> Space {
        let samples = samples.max(1);
        let (mut cosine, mut measure, mut angles) = (Vec::new(), Vec::new(), Vec::new());
        for n in 0..samples {
            let u = (n as f64 + 0.5) / samples as f64;
            let theta = FRAC_PI_2 * u * u;
            let dtheta = FRAC_PI_2 * 2.0 * u / samples as f64;
            cosine.push(theta.cosine());
            measure.push(dtheta * theta.sine() * theta.cosine());
            angles.push(theta);
        }
        // 4 sin 2t cos 2t = 8 sin t cos t cos 2t up to 45 degrees, by the same rule.
        let light = measure.iter().zip(&angles).map(|(&m, &t)| 8.0 * m * (2.0 * t).cosine());
        let light = light.take_while(|&q: &f64| q > 0.0).collect();
        let beyond = |&t: &f64| if t > DARK { 1.0 } else { 0.0 };
        let all: f64 = measure.iter().zip(&angles).map(|(m, t)| m * beyond(t)).sum();
        let share = |(m, t): (&f64, &f64)| if all > 0.0 { m * beyond(t) / all } else { 0.0 };
        let dark = measure.iter().zip(&angles).map(share).collect();
        Space { angles, light, dark, ..Space::interleave(&cosine, &measure) }
    }

    /// Any tabulation: for each configuration, the factor from reflectance to reflected radiance (the cosine at the
    /// light) and the quadrature weight of the configuration in the image that the distance compares.
    pub fn tabulated(cosine: &[f64], measure: &[f64]) -> Result<Space, SpaceError> {
        if cosine.len() != measure.len() || cosine.is_empty() {
            return Err(SpaceError::Length { cosines: cosine.len(), weights: measure.len() });
        }
        for (sample, (&cosine, &weight)) in cosine.iter().zip(measure).enumerate() {
            if !(cosine.is_finite() && weight.is_finite() && cosine >= 0.0 && weight >= 0.0) {
                return Err(SpaceError::Value { sample, cosine, weight });
            }
        }
        Ok(Space::interleave(cosine, measure))
    }

    fn interleave(cosine: &[f64], measure: &[f64]) -> Space {
        Space {
            radiance: cosine.iter().flat_map(|&c| [c; 3]).collect(),
            weight: measure.iter().flat_map(|&m| [m.sqrt(); 3]).collect(),
            angles: Vec::new(),
            light: Vec::new(),
            dark: Vec::new(),
        }
    }

    /// Number of columns: three per configuration, interleaved R G B.
    pub fn columns(&self) -> usize {
        self.weight.len()
    }

    /// Per column: the factor c_j from reflectance to reflected radiance.
    pub fn radiance(&self) -> &[f64] {
        &self.radiance
    }

    /// Per column: the root W_j of the quadrature weight.
    pub fn weight(&self) -> &[f64] {
        &self.weight
    }

    /// The half angles in radians, one per configuration; empty for other tabulations.
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// A curve as a row of this space (reflectance in 1/sr). Only for half-angle spaces; other spaces have no angles and
    /// give an empty row.
    pub fn row(&self, curve: &Curve) -> Vec<f64> {
        self.angles.iter().flat_map(|&theta| curve.at(theta)).collect()
    }

    /// A row of a half-angle space as a curve.
    pub fn curve(&self, row: &[f64]) -> Curve {
        let mut samples = row.chunks_exact(3);
        Curve::sampled(&self.angles, |_| samples.next().map_or([0.0; 3], |v| [v[0], v[1], v[2]]))
    }

    /// Distance between two rows of reflectance in 1/sr (0.01: barely visible; 0.05: obvious).
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (j, (&a, &b)) in a.iter().zip(b).enumerate() {
            let c = self.radiance[j];
            let d = self.weight[j] * ((a.max(0.0) * c).cube_root() - (b.max(0.0) * c).cube_root());
            sum += d * d;
        }
        sum.sqrt()
    }

    /// For each configuration, its share in the [albedo](Space::albedo); those left out at the end have none.
    pub fn light(&self) -> &[f64] {
        &self.light
    }

    /// For each configuration, its share in the mean reflectance away from the highlight, which is what most of a glossy ball
    /// shows where no lamp is. Empty in spaces without half angles.
    pub fn dark(&self) -> &[f64] {
        &self.dark
    }

    /// The reflectance (1/sr) of the matt surface that returns as much of the light from the normal as this row, channel by
    /// channel: `(1/pi) int f(theta_h = theta_o / 2) cos theta_o dOmega`. Zero in spaces without half angles.
    pub fn albedo<T: Copy + Into<f64>>(&self, row: &[T]) -> [f64; 3] {
        let mut albedo = [0.0; 3];
        for (&q, f) in self.light.iter().zip(row.chunks_exact(3)) {
            albedo.iter_mut().zip(f).for_each(|(a, &f)| *a += q * f.into().max(0.0));
        }
        albedo
    }

    /// How far two rows differ in the light that they return: the distance between the cube roots of their albedos.
    pub fn light_distance<T: Copy + Into<f64>>(&self, a: &[T], b: &[T]) -> f64 {
        let both = self.albedo(a).into_iter().zip(self.albedo(b));
        both.map(|(a, b)| (a.cube_root() - b.cube_root()).squared()).sum::<f64>().sqrt()
    }

    /// A row of reflectance in 1/sr transformed so that [`Space::distance`] is the Euclidean distance between two results.
    pub(crate) fn seen(&self, row: &[f64]) -> Vec<f64> {
        let columns = row.iter().zip(self.radiance.iter().zip(&self.weight));
        columns.map(|(&f, (&c, &weight))| weight * (f.max(0.0) * c).cube_root()).collect()
    }
}

/// Rows of equal length in one allocation: bases, stacks, candidates. Reflectance in 1/sr unless noted otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    columns: usize,
    values: Vec<f64>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: usize) -> Table {
        Table { columns: columns.max(1), values: Vec::new() }
    }

    /// Adds a row; it must have `columns` values.
    ///
    /// # Panics
    /// If the row has another length, which is a bug in the caller and never depends on input.
    pub fn push(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.columns, "the row belongs to another space");
        self.values.extend_from_slice(row);
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Row `i`.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..][..self.columns]
    }

    /// Row `i`, mutable.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.columns..][..self.columns]
    }

    /// The rows in order.
    pub fn rows(&self) -> std::slice::ChunksExact<'_, f64> {
        self.values.chunks_exact(self.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two Lambertians differ by |cbrt a - cbrt b| times the root of three times the integral of
    /// cos^(2/3) sin cos = 3/8, channel by channel.
    #[test]
    fn distance_of_two_lambertians_has_a_closed_form() {
        let space = Space::half_angle(512);
        let lambert = |v: f64| vec![v; space.columns()];
        let expected = (0.3f64.cbrt() - 0.1f64.cbrt()).abs() * (3.0f64 * 3.0 / 8.0).sqrt();
        let d = space.distance(&lambert(0.3), &lambert(0.1));
        assert!((d - expected).abs() < 1e-5, "{d} {expected}");
        let seen = space.seen(&lambert(0.3)).into_iter().zip(space.seen(&lambert(0.1)));
        let d = seen.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!((d - expected).abs() < 1e-5, "{d} {expected}");
    }

    #[test]
    fn thirty_two_samples_serve_as_well_as_many() {
        let lobe = |alpha: f64| {
            move |t: f64| [0.9 * inks::ggx::lobe(t, alpha) + 0.005, 0.8 * inks::ggx::lobe(t, alpha), 0.1]
        };
        let distance = |samples| {
            let space = Space::half_angle(samples);
            let row = |alpha| space.row(&Curve::sampled(space.angles(), lobe(alpha)));
            space.distance(&row(0.06), &row(0.27))
        };
        let (few, many) = (distance(32), distance(4096));
        assert!((few / many - 1.0).abs() < 2e-3, "{few} {many}");
    }

    /// A space of uniform angles from 0 to 90 degrees with trapezoid weights, as measurements often come.
    fn uniform(samples: usize) -> (Space, Vec<f64>) {
        let step = FRAC_PI_2 / (samples - 1) as f64;
        let angles: Vec<f64> = (0..samples).map(|n| n as f64 * step).collect();
        let cosine: Vec<f64> = angles.iter().map(|t| t.cos().max(0.0)).collect();
        let half = |n| if n == 0 || n + 1 == samples { 0.5 } else { 1.0 };
        let measure: Vec<f64> = (0..samples).map(|n| half(n) * step * angles[n].sin() * cosine[n]).collect();
        (Space::tabulated(&cosine, &measure).unwrap(), angles)
    }

    /// The lobes of silver foil on primer and on paper, the sharpest pair of the ink library.
    fn foils() -> [inks::Lobes; 2] {
        let library = inks::Library::builtin();
        ["P+SF", "SF"].map(|stack| library.optics().lobes(&stack.parse().unwrap()).unwrap())
    }

    fn flat(values: impl Iterator<Item = [f64; 3]>) -> Vec<f64> {
        values.flatten().collect()
    }

    #[test]
    fn the_square_root_grid_does_with_32_samples_what_uniform_angles_do_with_512() {
        let [primed, plain] = foils();
        let root = |samples| {
            let space = Space::half_angle(samples);
            let row = |lobes: &inks::Lobes| flat(space.angles().iter().map(|&t| lobes.at(t)));
            space.distance(&row(&primed), &row(&plain))
        };
        let even = |samples| {
            let (space, angles) = uniform(samples);
            let row = |lobes: &inks::Lobes| flat(angles.iter().map(|&t| lobes.at(t)));
            space.distance(&row(&primed), &row(&plain))
        };
        let truth = root(20_000);
        let off = |d: f64| (d / truth - 1.0).abs();
        assert!(off(root(32)) < 3e-4 && off(even(512)) < 3e-4);
        assert!(off(even(32)) > 0.02 && off(even(64)) > 5e-3);
    }

    /// Averaging each cell instead of sampling its centre keeps its energy but distorts the cube root, most of all on steep
    /// flanks.
    #[test]
    fn sampling_the_middle_of_a_cell_beats_averaging_the_cell() {
        let [primed, plain] = foils();
        let off = |samples: usize, fine: u32| {
            let space = Space::half_angle(samples);
            let row = |lobes: &inks::Lobes| {
                flat((0..samples).map(|n| {
                    let (mut sum, mut area) = ([0.0; 3], 0.0);
                    for k in 0..fine {
                        let u = (n as f64 + (f64::from(k) + 0.5) / f64::from(fine)) / samples as f64;
                        let t = FRAC_PI_2 * u * u;
                        let weight = u * t.sin() * t.cos();
                        area += weight;
                        for (sum, f) in sum.iter_mut().zip(lobes.at(t)) {
                            *sum += weight * f;
                        }
                    }
                    sum.map(|v| v / area)
                }))
            };
            let (space_truth, angles) = (Space::half_angle(20_000), Space::half_angle(20_000).angles);
            let truth = |lobes: &inks::Lobes| flat(angles.iter().map(|&t| lobes.at(t)));
            let truth = space_truth.distance(&truth(&primed), &truth(&plain));
            (space.distance(&row(&primed), &row(&plain)) / truth - 1.0).abs()
        };
        for samples in [16, 32, 64] {
            let (point, mean) = (off(samples, 1), off(samples, 32));
            assert!(point < mean, "{samples}: {point} {mean}");
        }
    }

    fn row(columns: usize) -> impl Strategy<Value = Vec<f64>> {
        // Values over six decades, and exact zeros.
        prop::collection::vec(prop_oneof![Just(0.0), (-4.0f64..2.0).prop_map(|e| 10f64.powf(e))], columns)
    }

    proptest! {
        #[test]
        fn it_is_a_metric((a, b, c) in (row(24), row(24), row(24))) {
            let space = Space::half_angle(8);
            let d = |a: &[f64], b: &[f64]| space.distance(a, b);
            prop_assert_eq!(d(&a, &b), d(&b, &a));
            prop_assert_eq!(d(&a, &a), 0.0);
            prop_assert!(d(&a, &c) <= d(&a, &b) + d(&b, &c) + 1e-12);
            prop_assert!(a == b || d(&a, &b) > 0.0);
        }

        /// The cube root is the only nonlinearity: light eight times as strong looks twice as strong.
        #[test]
        fn distances_grow_with_the_cube_root_of_the_light((a, b) in (row(24), row(24)), s in 1e-3f64..1e3) {
            let space = Space::half_angle(8);
            let scaled = |row: &[f64]| row.iter().map(|v| v * s).collect::<Vec<_>>();
            let (d, far) = (space.distance(&a, &b), space.distance(&scaled(&a), &scaled(&b)));
            prop_assert!((far - s.cbrt() * d).abs() <= 1e-9 * (far + 1e-9));
        }

        /// Listing every configuration twice with half its weight changes nothing.
        #[test]
        fn splitting_a_configuration_changes_nothing((a, b) in (row(24), row(24))) {
            let space = Space::half_angle(8);
            let (cosine, measure): (Vec<f64>, Vec<f64>) = space
                .radiance
                .chunks_exact(3)
                .zip(space.weight.chunks_exact(3))
                .flat_map(|(c, w)| [(c[0], w[0] * w[0] / 2.0); 2])
                .unzip();
            let split = Space::tabulated(&cosine, &measure).unwrap();
            let twice = |row: &[f64]| flat(row.chunks_exact(3).flat_map(|v| [[v[0], v[1], v[2]]; 2]));
            let (d, again) = (space.distance(&a, &b), split.distance(&twice(&a), &twice(&b)));
            prop_assert!((d - again).abs() <= 1e-12 * (1.0 + d));
        }
    }

    /// A tabulation over theta_h and theta_d: all pairs of directions, with measure sin cos d theta for each angle, the
    /// second one normalised to 1.
    struct Bivariate {
        space: Space,
        cells: Vec<[f64; 2]>,
    }

    fn bivariate(halves: usize, differences: usize) -> Bivariate {
        let (mut cosine, mut measure, mut cells) = (Vec::new(), Vec::new(), Vec::new());
        for h in 0..halves {
            let u = (h as f64 + 0.5) / halves as f64;
            let theta_h = FRAC_PI_2 * u * u;
            let dh = FRAC_PI_2 * 2.0 * u / halves as f64 * theta_h.sin() * theta_h.cos();
            for d in 0..differences {
                let theta_d = FRAC_PI_2 * (d as f64 + 0.5) / differences as f64;
                let dd = 2.0 * FRAC_PI_2 / differences as f64 * theta_d.sin() * theta_d.cos();
                cosine.push(theta_h.cos());
                measure.push(dh * dd);
                cells.push([theta_h, theta_d]);
            }
        }
        Bivariate { space: Space::tabulated(&cosine, &measure).unwrap(), cells }
    }

    /// Lobes from the sharpest that a document has to the widest, against an integral of 100,000 steps.
    #[test]
    fn the_light_of_sharp_lobes_is_their_integral() {
        let space = Space::half_angle(32);
        for alpha in [0.02, 0.03, 0.05, 0.1, 0.3, 1.0] {
            let row = flat(space.angles().iter().map(|&t| [inks::ggx::lobe(t, alpha); 3]));
            let steps = 100_000;
            let expected: f64 = (0..steps)
                .map(|i| {
                    let u = (f64::from(i) + 0.5) / f64::from(steps);
                    let t = 0.5 * FRAC_PI_2 * u * u;
                    let dt = FRAC_PI_2 * u / f64::from(steps);
                    4.0 * (2.0 * t).sin() * (2.0 * t).cos() * inks::ggx::lobe(t, alpha) * dt
                })
                .sum();
            let found = space.albedo(&row)[1];
            assert!((found / expected - 1.0).abs() < 2e-3, "alpha {alpha}: {found}, not {expected}");
        }
    }

    #[test]
    fn a_table_over_two_angles_is_a_space_like_any_other() {
        let table = bivariate(64, 48);
        assert!(table.space.angles().is_empty());
        let [primed, plain] = foils();
        // Without dependence on theta_d it must agree with the half-angle space.
        let lifted = |lobes: &inks::Lobes| flat(table.cells.iter().map(|cell| lobes.at(cell[0])));
        let half = Space::half_angle(64);
        let curve = |lobes: &inks::Lobes| flat(half.angles().iter().map(|&t| lobes.at(t)));
        let (two, one) = (
            table.space.distance(&lifted(&primed), &lifted(&plain)),
            half.distance(&curve(&primed), &curve(&plain)),
        );
        assert!((two / one - 1.0).abs() < 1e-3, "{two} {one}");
        // A surface and the same surface with s(theta_d) times the light: for f = a and f' = a s(theta_d) the distance
        // separates into the integral of cos^(2/3) sin cos = 3/8 and that of (1 - cbrt s)^2 over theta_d.
        // With s = cos^6 the latter is 2 * integral (1 - x^2)^2 x dx = 1/3.
        let a = 0.25;
        let level = vec![a; table.space.columns()];
        let falling = flat(table.cells.iter().map(|cell| [a * cell[1].cos().powi(6); 3]));
        let expected = a.cbrt() * (3.0f64 * 3.0 / 8.0 / 3.0).sqrt();
        let d = table.space.distance(&level, &falling);
        assert!((d / expected - 1.0).abs() < 1e-3, "{d} {expected}");
    }
}
