//! From one plane to another as a camera sees it: homographies.
//!
//! Method: the eight unknowns of a homography with its last entry 1, by least squares over points that are first brought to unit
//! size (Hartley 1997). Cost: one 8 x 8 system. Limits: planes through the eye have none.

use crate::linalg::Cholesky;

/// A map between planes, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Homography(pub(crate) [f64; 9]);

impl Homography {
    /// The image of a point.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let h = &self.0;
        let w = h[6] * x + h[7] * y + h[8];
        [(h[0] * x + h[1] * y + h[2]) / w, (h[3] * x + h[4] * y + h[5]) / w]
    }

    /// The map that takes four points to four others.
    pub(crate) fn through(from: [[f64; 2]; 4], to: [[f64; 2]; 4]) -> Option<Homography> {
        Homography::fit(&from, &to)
    }

    /// The map that takes points nearest to others. At least four.
    pub(crate) fn fit(from: &[[f64; 2]], to: &[[f64; 2]]) -> Option<Homography> {
        if from.len() < 4 || from.len() != to.len() {
            return None;
        }
        let (a, b) = (UnitFrame::fit(from)?, UnitFrame::fit(to)?);
        let (mut normal, mut right) = (vec![0.0; 64], vec![0.0; 8]);
        for (p, q) in from.iter().zip(to) {
            let ([x, y], [u, v]) = (a.to(*p), b.to(*q));
            for (row, value) in [
                ([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u),
                ([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v),
            ] {
                for i in 0..8 {
                    right[i] += row[i] * value;
                    for j in 0..8 {
                        normal[8 * i + j] += row[i] * row[j];
                    }
                }
            }
        }
        let h = Cholesky::new(&normal, 8)?.solve(&right);
        let h = [h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0];
        // T_b^-1 H T_a.
        let h = times(&b.back(), &times(&h, &a.forth()));
        let scale = h[8];
        (scale.is_finite() && scale.abs() > 1e-12 && h.iter().all(|v| v.is_finite()))
            .then(|| Homography(h.map(|v| v / scale)))
    }
}

/// Moves points to their middle and scales them to unit size.
struct UnitFrame {
    middle: [f64; 2],
    scale: f64,
}

impl UnitFrame {
    fn fit(points: &[[f64; 2]]) -> Option<UnitFrame> {
        let n = points.len() as f64;
        let middle = points.iter().fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]).map(|v| v / n);
        let size = points.iter().map(|p| (p[0] - middle[0]).hypot(p[1] - middle[1])).sum::<f64>() / n;
        (size > 1e-9 && size.is_finite()).then(|| UnitFrame { middle, scale: 1.0 / size })
    }

    fn to(&self, p: [f64; 2]) -> [f64; 2] {
        [(p[0] - self.middle[0]) * self.scale, (p[1] - self.middle[1]) * self.scale]
    }

    fn forth(&self) -> [f64; 9] {
        let (s, [x, y]) = (self.scale, self.middle);
        [s, 0.0, -s * x, 0.0, s, -s * y, 0.0, 0.0, 1.0]
    }

    fn back(&self) -> [f64; 9] {
        let (s, [x, y]) = (1.0 / self.scale, self.middle);
        [s, 0.0, x, 0.0, s, y, 0.0, 0.0, 1.0]
    }
}

fn times(a: &[f64; 9], b: &[f64; 9]) -> [f64; 9] {
    std::array::from_fn(|i| (0..3).map(|k| a[i / 3 * 3 + k] * b[3 * k + i % 3]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_through_a_steep_view() {
        let truth = Homography([410.0, -35.0, 800.0, 52.0, 377.0, 650.0, 0.11, -0.08, 1.0]);
        let from: Vec<[f64; 2]> = (0..12).map(|i| [f64::from(i % 4) - 1.3, f64::from(i / 4) * 0.8]).collect();
        let to: Vec<[f64; 2]> = from.iter().map(|p| truth.at(*p)).collect();
        let found = Homography::fit(&from, &to).unwrap();
        for p in [[0.3, 0.4], [-1.0, 2.0]] {
            let (a, b) = (found.at(p), truth.at(p));
            assert!((a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6, "{a:?} {b:?}");
        }
        let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]];
        assert!(Homography::through(line, line).is_none());
    }
}
