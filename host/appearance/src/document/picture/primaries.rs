//! Colours of other primaries as amounts of red, green and blue of Rec. 709.
//!
//! Problem: an OpenEXR file may state the chromaticities of its colours, such as those of ACES; read as
//! Rec. 709 its colours are pale.
//! Method: chromaticities and white give the matrix to XYZ (SMPTE RP 177); Bradford's matrix adapts the
//! file's white to D65; the inverse of Rec. 709's own matrix follows. Cost: nine products a pixel. Limits:
//! colours outside of Rec. 709 become negative, and the caller clamps them.
//! Source: SMPTE RP 177-1993; ICC.1:2022, annex E (Bradford).

use readers::Primaries;

type Matrix = [[f64; 3]; 3];

/// Red, green, blue and D65 of ITU-R BT.709.
const REC_709: Primaries = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

/// The response of the cones, after Bradford.
const CONES: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// The matrix from linear amounts of these primaries to linear Rec. 709; `None` if they are the same within
/// what files round to.
///
/// # Errors
/// Primaries that do not span colours.
pub fn to_rec_709(primaries: &Primaries) -> Result<Option<Matrix>, String> {
    // Programs write them with three or four digits, so that equal ones differ by so much.
    const ALIKE: f32 = 0.001;
    if primaries.iter().flatten().zip(REC_709.iter().flatten()).all(|(a, b)| (a - b).abs() <= ALIKE) {
        return Ok(None);
    }
    let matrix = || {
        let from = to_xyz(primaries)?;
        let cones = |white: [f32; 2]| Some(times(&CONES, xyz(white)?));
        let (own, d65) = (cones(primaries[3])?, cones(REC_709[3])?);
        let mut scaled = CONES;
        (0..3).for_each(|row| (0..3).for_each(|c| scaled[row][c] *= d65[row] / own[row]));
        let adapted = product(&inverse(&CONES)?, &product(&scaled, &from));
        let found = product(&inverse(&to_xyz(&REC_709)?)?, &adapted);
        found.iter().flatten().all(|v| v.is_finite()).then_some(found)
    };
    matrix().map(Some).ok_or_else(|| format!("its chromaticities {primaries:?} do not span colours"))
}

/// XYZ of a chromaticity, with a luminance of 1.
fn xyz([x, y]: [f32; 2]) -> Option<[f64; 3]> {
    let (x, y) = (f64::from(x), f64::from(y));
    (x.is_finite() && y > 0.0 && y.is_finite()).then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

/// The matrix from amounts of primaries to XYZ, in which white is equal amounts.
fn to_xyz(primaries: &Primaries) -> Option<Matrix> {
    let columns = [chromatic(primaries[0])?, chromatic(primaries[1])?, chromatic(primaries[2])?];
    let matrix: Matrix = std::array::from_fn(|row| std::array::from_fn(|c| columns[c][row]));
    let amounts = times(&inverse(&matrix)?, xyz(primaries[3])?);
    Some(matrix.map(|row| std::array::from_fn(|c| row[c] * amounts[c])))
}

/// Chromaticity coordinates with their third: primaries of ACES lie on the line without luminance.
fn chromatic([x, y]: [f32; 2]) -> Option<[f64; 3]> {
    let (x, y) = (f64::from(x), f64::from(y));
    (x.is_finite() && y.is_finite()).then_some([x, y, 1.0 - x - y])
}

fn times(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| (0..3).map(|c| row[c] * v[c]).sum())
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|c| (0..3).map(|k| a[row][k] * b[k][c]).sum()))
}

/// The inverse by cofactors; `None` if there is none.
fn inverse(m: &Matrix) -> Option<Matrix> {
    // Chromaticities have 24 bits: what is on a line is so up to this, and all known primaries span more
    // than 0.1.
    const FLAT: f64 = 1e-6;
    let cofactor = |row: usize, c: usize| {
        let at = |i: usize, j: usize| m[(row + i) % 3][(c + j) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum();
    (determinant.abs() > FLAT)
        .then(|| std::array::from_fn(|row| std::array::from_fn(|c| cofactor(c, row) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// AP1, the primaries of ACEScg.
    pub const AP1: Primaries = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], [0.32168, 0.33767]];

    #[test]
    fn aces_is_converted_as_its_makers_do() {
        // OpenColorIO's built-in transform from ACEScg to linear Rec. 709 (Bradford).
        let published =
            [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]];
        let found = to_rec_709(&AP1).unwrap().unwrap();
        for (a, b) in found.iter().flatten().zip(published.iter().flatten()) {
            assert!((a - b).abs() < 2e-4, "{found:?}");
        }
    }

    #[test]
    fn white_stays_white_and_the_own_primaries_nothing_to_do() {
        assert_eq!(to_rec_709(&REC_709), Ok(None));
        let wide = [[0.7347, 0.2653], [0.2738, 0.7174], [0.1666, 0.0089], [0.3457, 0.3585]];
        for row in to_rec_709(&wide).unwrap().unwrap() {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{row:?}");
        }
    }

    #[test]
    fn primaries_on_a_line_or_without_white_are_errors() {
        let mut line = AP1;
        line[2] = [0.5 * (AP1[0][0] + AP1[1][0]), 0.5 * (AP1[0][1] + AP1[1][1])];
        let mut black = AP1;
        black[3] = [0.3, 0.0];
        let mut nan = AP1;
        nan[1] = [f32::NAN, 0.3];
        for wrong in [line, black, nan] {
            assert!(to_rec_709(&wrong).is_err(), "{wrong:?}");
        }
    }
}
