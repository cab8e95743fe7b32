//! What the alignment of hand-held photographs leaves: a fraction of a pixel for each.
//!
//! Problem: a tenth of a pixel is 2 % of a foil's flank, and each photograph shows other half angles, so that one that lies a little
//! aside looks like a lamp that stands elsewhere. Method: a place of the merged picture is a mean of the photographs that are not
//! full there, with weights near their exposures; it lies aside by the mean of theirs. The photograph that the others were
//! aligned to lies where it is. Cost: a table for each lamp. Limits: channels that fill at different exposures count as green.

/// How far each photograph lies aside from where it was aligned to, for each lamp's series, longest exposure first.
#[derive(Clone, Debug, Default)]
pub(crate) struct ResidualShifts(Vec<ShiftSeries>);

#[derive(Clone, Debug)]
struct ShiftSeries {
    exposures: Vec<f64>,
    /// For each photograph, where pixels lie of which it is the first that is not full.
    aside: Vec<[f64; 2]>,
}

impl ResidualShifts {
    /// Relative exposures of each lamp's photographs.
    pub(crate) fn new(exposures: impl IntoIterator<Item = Vec<f64>>) -> ResidualShifts {
        let still = |exposures: Vec<f64>| ShiftSeries { aside: vec![[0.0; 2]; exposures.len()], exposures };
        ResidualShifts(exposures.into_iter().map(still).collect())
    }

    /// Moves a photograph by so many pixels along an axis.
    pub(crate) fn shift(&mut self, light: usize, shot: usize, axis: usize, by: f64) {
        let Some(ShiftSeries { exposures, aside }) = self.0.get_mut(light) else { return };
        for (first, aside) in aside.iter_mut().enumerate().take(shot + 1) {
            aside[axis] += by * exposures[shot] / exposures[first..].iter().sum::<f64>();
        }
    }

    /// How far a pixel lies aside of which this photograph is the first that is not full.
    pub(crate) fn at(&self, light: usize, first: u8) -> [f64; 2] {
        let aside = self.0.get(light).and_then(|series| series.aside.get(usize::from(first)));
        aside.copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_where_their_photographs_do() {
        let mut slips = ResidualShifts::new([vec![4.0, 2.0, 1.0], vec![1.0]]);
        slips.shift(0, 1, 0, 0.7);
        slips.shift(0, 2, 1, 0.3);
        for (first, expected) in
            [(0, [0.2, 0.3 / 7.0]), (1, [1.4 / 3.0, 0.1]), (2, [0.0, 0.3]), (3, [0.0, 0.0])]
        {
            let found = slips.at(0, first);
            assert!((0..2).all(|axis| (found[axis] - expected[axis]).abs() < 1e-12), "{first}: {found:?}");
        }
        assert_eq!((slips.at(1, 0), slips.at(2, 0)), ([0.0; 2], [0.0; 2]));
        slips.shift(5, 0, 0, 1.0);
    }
}
