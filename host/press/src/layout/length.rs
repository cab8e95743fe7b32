//! Lengths as people type them: `2mm`, `1.5cm`, `0.25in`. Inside the program they are millimetres, then dots.

use std::str::FromStr;

use sheet::DOTS_PER_MM;

/// A length in millimetres.
#[derive(Clone, Copy, PartialEq, PartialOrd, Debug, Default)]
pub struct Mm(pub f64);

/// Two lengths: across, then down.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Point(pub Mm, pub Mm);

/// Not a length.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoLength {
    /// Not a single length.
    #[error("`{0}` is not a length; write it like 2mm, 1.5cm or 0.25in")]
    Length(String),
    /// Not a pair.
    #[error("`{0}` is not a pair of lengths; write it like 20x30mm, 20mm,30mm or 1x2in (across, then down)")]
    Pair(String),
}

/// Ten metres: more than any sheet, few enough dots for every kind of number.
const MOST: f64 = 10_000.0;

/// The number and its unit in millimetres, if there is a unit.
fn split(text: &str) -> Option<(&str, f64)> {
    [("mm", 1.0), ("cm", 10.0), ("in", 25.4)]
        .into_iter()
        .find_map(|(name, mm)| Some((text.strip_suffix(name)?, mm)))
}

fn number(text: &str, unit: f64) -> Option<Mm> {
    let mm = text.trim().parse::<f64>().ok()? * unit;
    (mm.is_finite() && mm.abs() <= MOST).then_some(Mm(mm))
}

impl Mm {
    /// The nearest whole number of dots.
    pub fn dots(self) -> i64 {
        // Finite and at most `MOST` by construction from text; a cast saturates for anything else.
        (self.0 * DOTS_PER_MM).round() as i64
    }

    /// The length of so many dots.
    pub fn of_dots(dots: i64) -> Mm {
        Mm(dots as f64 / DOTS_PER_MM)
    }
}

impl FromStr for Mm {
    type Err = NoLength;

    fn from_str(text: &str) -> Result<Mm, NoLength> {
        let lower = text.trim().to_ascii_lowercase();
        // Zero is zero in every unit.
        if lower == "0" {
            return Ok(Mm(0.0));
        }
        split(&lower)
            .and_then(|(value, unit)| number(value, unit))
            .ok_or_else(|| NoLength::Length(text.into()))
    }
}

impl FromStr for Point {
    type Err = NoLength;

    fn from_str(text: &str) -> Result<Point, NoLength> {
        let wrong = || NoLength::Pair(text.into());
        let lower = text.trim().to_ascii_lowercase();
        let (first, second) = lower.split_once(['x', ',']).ok_or_else(wrong)?;
        let (second, unit) = split(second).ok_or_else(wrong)?;
        // `20x30mm`: the unit counts for both unless the first has its own.
        let (first, first_unit) = split(first.trim()).unwrap_or((first, unit));
        match (number(first, first_unit), number(second, unit)) {
            (Some(x), Some(y)) => Ok(Point(x, y)),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read_with_their_unit_and_refused_without() {
        assert_eq!("2mm".parse(), Ok(Mm(2.0)));
        assert_eq!(" 1.5 CM".parse(), Ok(Mm(15.0)));
        assert_eq!("-1in".parse(), Ok(Mm(-25.4)));
        assert_eq!("0".parse(), Ok(Mm(0.0)));
        for wrong in ["", "2", "mm", "2m", "nanmm", "infmm", "1e9mm", "2x3mm"] {
            assert!(wrong.parse::<Mm>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn pairs_may_share_a_unit_or_have_two() {
        assert_eq!("20x30mm".parse(), Ok(Point(Mm(20.0), Mm(30.0))));
        assert_eq!("2cm, 3mm".parse(), Ok(Point(Mm(20.0), Mm(3.0))));
        assert_eq!("-0.2,0.3mm".parse(), Ok(Point(Mm(-0.2), Mm(0.3))));
        for wrong in ["", "20mm", "20x30", "axbmm", "1x2x3mm"] {
            assert!(wrong.parse::<Point>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_inch_is_600_dots() {
        assert_eq!("1in".parse::<Mm>().map(Mm::dots), Ok(600));
        assert_eq!(Mm::of_dots(600), Mm(25.4));
    }
}
