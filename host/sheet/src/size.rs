//! A size on paper as people type it, with its unit.

use std::fmt;
use std::str::FromStr;

/// A size on paper as typed: `120x90mm`, `12x9cm`, `5x4in`, or only the width, `120mm`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Size {
    /// Width in millimetres.
    pub width: f64,
    /// Height in millimetres; the document's shape decides when it is not given.
    pub height: Option<f64>,
}

/// What is not a size.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a size; write it like 120x90mm, 12x9cm, 5x4in, or only the width, 120mm")]
pub struct NoSize(pub String);

impl FromStr for Size {
    type Err = NoSize;

    fn from_str(text: &str) -> Result<Size, NoSize> {
        let wrong = || NoSize(text.into());
        let lower = text.trim().to_ascii_lowercase();
        let (numbers, unit) = [("mm", 1.0), ("cm", 10.0), ("in", 25.4)]
            .into_iter()
            .find_map(|(name, mm)| Some((lower.strip_suffix(name)?, mm)))
            .ok_or_else(wrong)?;
        let length = |number: &str| -> Result<f64, NoSize> {
            let value: f64 = number.trim().parse().map_err(|_| wrong())?;
            if value.is_finite() && value > 0.0 { Ok(value * unit) } else { Err(wrong()) }
        };
        match numbers.split_once('x') {
            Some((width, height)) => Ok(Size { width: length(width)?, height: Some(length(height)?) }),
            None => Ok(Size { width: length(numbers)?, height: None }),
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.height {
            Some(height) => write!(f, "{}x{}mm", self.width, height),
            None => write!(f, "{}mm", self.width),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_with_their_unit_and_refused_without() {
        assert_eq!("120x90mm".parse(), Ok(Size { width: 120.0, height: Some(90.0) }));
        assert_eq!("5 x 4 in".parse(), Ok(Size { width: 127.0, height: Some(101.6) }));
        assert_eq!("12cm".parse(), Ok(Size { width: 120.0, height: None }));
        for wrong in ["", "120", "mm", "0mm", "-3mm", "axbmm", "1x2x3mm", "infmm", "nanmm"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }
}
