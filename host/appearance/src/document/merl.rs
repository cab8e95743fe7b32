//! MERL `.binary`: an isotropic BRDF tabulated over theta_h, theta_d and phi_d.
//!
//! Layout (little-endian): three i32 cell counts (90, 90, 180 as published; others are read too), then f64 values: all
//! red, all green, all blue, phi_d fastest, then theta_d. theta_h cells are square-root spaced, the others uniform.
//! Reflectance in 1/sr is the stored number times 1, 1.15 and 1.66 over 1500. Negative numbers mark cells that were not
//! measured; they are left out of the average. [`super::average`] computes the curve.

use maths::Maths;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use super::average;
use super::content::Document;
use super::curve;
use super::error::DocumentError;
use super::source::Source;
use crate::brdf::Space;

/// What stored numbers are multiplied by for red, green and blue. Source: `BRDFRead.cpp` of the MERL
/// database.
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The most cells per colour: eleven times as many as in the published files.
const MOST_CELLS: u64 = 1 << 24;

/// Bytes of the header: three numbers of 32 bits.
const HEADER: usize = 12;

/// The largest file, in bytes: its header and three numbers of 64 bits for each cell.
pub(super) const MOST_BYTES: u64 = HEADER as u64 + 24 * MOST_CELLS;

pub(super) fn open(path: &Path, space: Space, source: Source<'_>) -> Result<Document, DocumentError> {
    curve::averaged(path, space, source, MOST_BYTES, parse)
}

/// The half-angle curve of a file's bytes; `path` names it in errors.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<inks::Curve, DocumentError> {
    let wrong = |field: &str, problem: String| DocumentError::Field {
        path: path.to_path_buf(),
        field: field.into(),
        problem,
    };
    let Some((header, body)) = bytes.split_at_checked(HEADER) else {
        return Err(wrong(
            "header",
            format!("expected three sizes in 12 bytes, found {} bytes", bytes.len()),
        ));
    };
    let dims: Vec<i64> =
        header.chunks_exact(4).map(|b| i64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect();
    let cells = dims
        .iter()
        .try_fold(1u64, |n, &d| u64::try_from(d).ok().filter(|&d| d > 0).and_then(|d| n.checked_mul(d)));
    let Some(cells) = cells.filter(|&cells| cells <= MOST_CELLS) else {
        return Err(wrong(
            "header",
            format!(
                "sizes {}, {}, {}: expected positive sizes, such as 90, 90, 180, with at most {MOST_CELLS} cells",
                dims[0], dims[1], dims[2]
            ),
        ));
    };
    if body.len() as u64 != 24 * cells {
        return Err(wrong(
            "size",
            format!(
                "{cells} cells of three colours need {} bytes, found {}",
                HEADER as u64 + 24 * cells,
                bytes.len()
            ),
        ));
    }
    let (heights, differences, azimuths) = (dims[0] as usize, dims[1] as usize, dims[2] as usize);
    let cells = cells as usize;
    let stored = |index: usize| {
        let at = 8 * index;
        f64::from_le_bytes(body[at..at + 8].try_into().unwrap_or([0; 8]))
    };
    if let Some(index) = (0..3 * cells).find(|&index| !stored(index).is_finite()) {
        return Err(wrong(
            ["red", "green", "blue"][index / cells],
            format!("cell {} is {}, not a finite number", index % cells, stored(index)),
        ));
    }
    let theta_h: Vec<f64> =
        (0..heights).map(|i| FRAC_PI_2 * ((i as f64 + 0.5) / heights as f64).squared()).collect();
    average::curve(&theta_h, differences, azimuths, |[h, d, p], _, _| {
        let cell = p + azimuths * (d + differences * h);
        let rgb: [f64; 3] = std::array::from_fn(|c| stored(cell + c * cells));
        rgb.iter().all(|v| *v >= 0.0).then(|| std::array::from_fn(|c| rgb[c] * SCALE[c]))
    })
    .ok_or_else(|| wrong("cells", "no cell with theta_d between 2.5 and 57.5 degrees was measured".into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;
    use testing::needs::Need;

    fn file(dims: [i32; 3], value: impl Fn(usize, usize, usize, usize) -> f64) -> Vec<u8> {
        let mut bytes: Vec<u8> = dims.iter().flat_map(|d| d.to_le_bytes()).collect();
        for c in 0..3 {
            for h in 0..dims[0] as usize {
                for d in 0..dims[1] as usize {
                    for p in 0..dims[2] as usize {
                        bytes.extend(value(c, h, d, p).to_le_bytes());
                    }
                }
            }
        }
        bytes
    }

    /// Each colour and each theta_h cell is read from its place in the layout, for any value of the other two angles, and
    /// missing cells do not count.
    #[test]
    fn a_function_of_the_half_angle_comes_back_scaled() {
        let bytes = file([12, 30, 36], |c, h, d, p| {
            if (d + p) % 3 == 0 { -1.0 } else { (1500 * (c + 1)) as f64 / (1.0 + h as f64) }
        });
        let curve = parse(&bytes, Path::new("x.binary")).unwrap();
        for (h, (&t, v)) in curve.theta().iter().zip(curve.rgb()).enumerate() {
            let centre = 90.0 * ((h as f64 + 0.5) / 12.0).powi(2);
            assert!((t.to_degrees() - centre).abs() < 1e-9);
            for (c, scale) in [1.0, 2.0 * 1.15, 3.0 * 1.66].into_iter().enumerate() {
                assert!((v[c] - scale / (1.0 + h as f64)).abs() < 1e-12);
            }
        }
        assert!(curve.theta().len() >= 10);
    }

    #[test]
    fn damage_is_named() {
        let good = file([3, 30, 4], |_, _, _, _| 1.0);
        let check = |bytes: &[u8], says: &str| {
            let error = parse(bytes, Path::new("x.binary")).unwrap_err().to_string();
            assert!(error.contains("x.binary") && error.contains(says), "{error}");
        };
        check(&good[..7], "7 bytes");
        check(&good[..good.len() - 1], "need 8652 bytes, found 8651");
        let mut huge = good.clone();
        huge[..12].copy_from_slice(&[255, 255, 255, 127].repeat(3));
        check(&huge, "2147483647");
        let mut negative = good.clone();
        negative[..4].copy_from_slice(&(-3i32).to_le_bytes());
        check(&negative, "-3");
        let mut nan = good.clone();
        nan[12 + 8 * 400..12 + 8 * 401].copy_from_slice(&f64::NAN.to_le_bytes());
        check(&nan, "green: cell 40 is NaN");
        check(&file([3, 30, 4], |_, _, _, _| -1.0), "no cell");
    }

    /// A full-size file, written by an independent program from a neural fit of a real measurement, against the published
    /// curve of that measurement.
    #[test]
    fn a_full_size_file_gives_the_curve_of_its_material() {
        let Some(data) = testing::needs::data().filter(|_| testing::needs::numpy()) else { return };
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("brass.binary");
        let Some(script) = testing::needs::path(Need::Reference, "FOILPRESS_REFERENCE") else { return };
        let done = Command::new("python3")
            .arg(script)
            .args(["merl", "--name", "merl/brass", "--net"])
            .arg(data.join("brdf/nbrdf/networks.json"))
            .arg("--out")
            .arg(&out)
            .output();
        assert!(done.is_ok_and(|done| done.status.success()), "the reference writes the file");
        let space = Space::half_angle(32);
        let found = space.row(&parse(&std::fs::read(&out).unwrap(), &out).unwrap());
        let published = inks::Curve::from_csv(
            std::fs::File::open(data.join("brdf/curves_avg/merl_brass.csv")).unwrap(),
            "brass".as_ref(),
        )
        .unwrap();
        let distance = space.distance(&found, &space.row(&published));
        let black = space.distance(&vec![0.0; space.columns()], &space.row(&published));
        assert!(distance < 0.01 * black, "{distance} of {black}");
    }
}
