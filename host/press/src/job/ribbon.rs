//! How much ribbon and time a pass takes, by estimate.
//!
//! Problem: ribbons are no longer made, and a file does not say how much of one it uses up.
//! Method: the head prints a band of 240 rows (10.16 mm) in one run across the paper. The ribbon runs along with the
//! carriage, however few dots it prints, so a band takes as much ribbon as lies between its first and its last dot.
//! Bands begin at the first row with ink and follow each other; blank rows between them are passed over.
//! Limits: an estimate. 240 rows is the number of elements in the head, read from the printer's device ID. How far the
//! ribbon runs before the first and after the last dot is not known, so the true figure is higher. Times rest on one
//! recording of four nearly empty passes (6 to 9 s each, cartridge change included); that a band takes 2 s is a guess.

use crate::layout::Mm;
use sheet::Plane;

/// Rows the head prints at once at 600 dpi.
const BAND: usize = 240;
/// Changing the cartridge and pulling back the sheet.
const PASS_SECONDS: f64 = 5.0;
/// One run of the carriage.
const BAND_SECONDS: f64 = 2.0;

/// What a pass takes, by estimate.
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize)]
pub struct Use {
    /// Runs of the carriage.
    pub bands: u32,
    /// Ribbon in millimetres.
    pub ribbon_mm: f64,
    /// Time in seconds.
    pub seconds: f64,
}

/// What a pass takes; `dpi` across and along are those of the plane.
pub fn of(plane: &Plane, dpi: (u16, u16)) -> Use {
    let rows = (BAND * usize::from(dpi.1) / 600).max(1);
    let lines: Vec<&[u8]> = plane.bits.chunks_exact(plane.stride.max(1)).collect();
    let (mut bands, mut dots, mut y) = (0, 0, 0);
    while y < lines.len() {
        if lines[y].iter().all(|&byte| byte == 0) {
            y += 1;
            continue;
        }
        let end = (y + rows).min(lines.len());
        let ends = lines[y..end].iter().filter_map(|line| ends(line));
        let (first, last) = ends.fold((usize::MAX, 0), |(a, b), (c, d)| (a.min(c), b.max(d)));
        dots += last + 1 - first;
        bands += 1;
        y = end;
    }
    if bands == 0 {
        return Use::default();
    }
    let across = 600.0 / f64::from(dpi.0.max(1));
    Use {
        bands,
        ribbon_mm: Mm::of_dots(dots as i64).0 * across,
        seconds: PASS_SECONDS + BAND_SECONDS * f64::from(bands),
    }
}

/// First and last dot of a row.
fn ends(row: &[u8]) -> Option<(usize, usize)> {
    let first = row.iter().position(|&byte| byte != 0)?;
    let last = row.iter().rposition(|&byte| byte != 0)?;
    Some((
        first * 8 + row[first].leading_zeros() as usize,
        last * 8 + 7 - row[last].trailing_zeros() as usize,
    ))
}

/// A duration in a fitting unit: `40 s`, `6 min`, `1 h 20 min`.
pub(super) fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match minutes {
        _ if seconds < 90.0 => format!("{seconds:.0} s"),
        0..=59 => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

/// A length of ribbon: millimetres below a metre, metres above.
pub fn length(mm: f64) -> String {
    if mm < 995.0 { format!("{mm:.0} mm") } else { format!("{:.2} m", mm / 1000.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane of 800 dots across with rectangles (x, y, width, length) of ink.
    fn plane(length: usize, rectangles: &[(usize, usize, usize, usize)]) -> Plane {
        let mut bits = vec![0u8; 100 * length];
        for &(x, y, width, long) in rectangles {
            for row in y..y + long {
                for column in x..x + width {
                    bits[row * 100 + column / 8] |= 0x80 >> (column % 8);
                }
            }
        }
        Plane { width: 800, length, stride: 100, bits }
    }

    #[test]
    fn a_full_rectangle_takes_its_width_for_each_band_begun() {
        for (long, bands) in [(1, 1), (240, 1), (241, 2), (960, 4)] {
            let used = of(&plane(1000, &[(30, 7, 600, long)]), (600, 600));
            assert_eq!(used.bands, bands);
            assert!((used.ribbon_mm - 25.4 * f64::from(bands)).abs() < 1e-9, "{used:?}");
            assert!((used.seconds - 5.0 - 2.0 * f64::from(bands)).abs() < 1e-9);
        }
    }

    #[test]
    fn two_dots_far_apart_take_the_ribbon_between_them() {
        let far = of(&plane(300, &[(0, 10, 1, 1), (799, 200, 1, 1)]), (600, 600));
        assert!((far.ribbon_mm - 800.0 * 25.4 / 600.0).abs() < 1e-9);
        // In two bands each takes its own dot only.
        let apart = of(&plane(600, &[(0, 10, 1, 1), (799, 500, 1, 1)]), (600, 600));
        assert!((apart.ribbon_mm - 2.0 * 25.4 / 600.0).abs() < 1e-9 && apart.bands == 2);
    }

    #[test]
    fn blank_passes_take_nothing_and_other_resolutions_are_in_the_same_millimetres() {
        assert_eq!(of(&plane(300, &[]), (600, 600)), Use::default());
        let fine = of(&plane(300, &[(0, 0, 800, 1)]), (1200, 600));
        assert!((fine.ribbon_mm - 800.0 * 25.4 / 1200.0).abs() < 1e-9);
        let coarse = of(&plane(300, &[(0, 0, 800, 121)]), (300, 300));
        assert_eq!(coarse.bands, 2);
    }

    #[test]
    fn durations_and_lengths_are_said_in_fitting_units() {
        assert_eq!([40.0, 360.0, 4800.0].map(duration), ["40 s", "6 min", "1 h 20 min"]);
        assert_eq!([12.3, 5432.0].map(length), ["12 mm", "5.43 m"]);
    }
}
