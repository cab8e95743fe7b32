//! How large a document is on the page.
//!
//! Millimetres exist only here, in the layout and at the command line: what comes out is a size in 600 dpi dots. A document
//! keeps its shape; where it lies is the layout's business.

use std::fmt;
use std::str::FromStr;

use protocol::paper::{LARGEST, Paper};

use crate::halftone::Placement;
use crate::layout::Layout;

/// Dots in a millimetre at 600 dpi.
pub const DOTS_PER_MM: f64 = 600.0 / 25.4;

/// A size on paper as typed: `120x90mm`, `12x9cm`, `5x4in`, or only the width, `120mm`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Size {
    /// Width in millimetres.
    pub width: f64,
    /// Height in millimetres; the document's shape decides when it is not given.
    pub height: Option<f64>,
}

/// Why a document cannot be placed, or a size not read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlacementError {
    /// Not a size.
    #[error("`{0}` is no size; write it like 120x90mm, 12x9cm, 5x4in, or only the width, 120mm")]
    Size(String),
    /// Larger than the printable area.
    #[error(
        "{width:.1} x {height:.1} mm does not fit: {paper} prints {most_width:.1} x {most_height:.1} mm here; \
         give a smaller --size, another --paper, or --crop to cut"
    )]
    TooLarge {
        /// Width asked for, in mm.
        width: f64,
        /// Height asked for, in mm.
        height: f64,
        /// Name of the paper.
        paper: &'static str,
        /// Printable width in mm.
        most_width: f64,
        /// Printable height in mm.
        most_height: f64,
    },
    /// Less than a dot.
    #[error("{width:.4} x {height:.4} mm is less than a dot (1 dot is {:.4} mm); give a larger --size", 1.0 / DOTS_PER_MM)]
    TooSmall {
        /// Width asked for, in mm.
        width: f64,
        /// Height asked for, in mm.
        height: f64,
    },
}

impl FromStr for Size {
    type Err = PlacementError;

    fn from_str(text: &str) -> Result<Size, PlacementError> {
        let wrong = || PlacementError::Size(text.into());
        let lower = text.trim().to_ascii_lowercase();
        let (numbers, unit) = [("mm", 1.0), ("cm", 10.0), ("in", 25.4)]
            .into_iter()
            .find_map(|(name, mm)| Some((lower.strip_suffix(name)?, mm)))
            .ok_or_else(wrong)?;
        let length = |number: &str| -> Result<f64, PlacementError> {
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

/// Dots across and down of a document of `pixels` (width, height) that a layout has room for.
///
/// `asked` is the size wanted: the document fills it as far as its shape allows. Without it the document's own
/// size `own_mm` counts, and without that the largest size that fits. A layout that cuts has room for any document up to
/// the largest sheet.
pub fn dots(
    pixels: (usize, usize),
    own_mm: Option<(f64, f64)>,
    asked: Option<Size>,
    layout: &Layout,
) -> Result<(u16, u16), PlacementError> {
    let largest = layout.largest();
    let fill = (largest.0 as f64 / DOTS_PER_MM, largest.1 as f64 / DOTS_PER_MM);
    let most = if layout.cut { (usize::from(LARGEST.0), usize::from(LARGEST.1)) } else { largest };
    let aspect = match own_mm {
        Some((width, height)) => height / width,
        None => pixels.1 as f64 / pixels.0 as f64,
    };
    let within = |width: f64, height: f64| {
        let width = width.min(height / aspect);
        (width, width * aspect)
    };
    let (width, height) = match (asked, own_mm) {
        (Some(Size { width, height: Some(height) }), _) => within(width, height),
        (Some(Size { width, height: None }), _) => (width, width * aspect),
        (None, Some(own)) => own,
        (None, None) => within(fill.0, fill.1),
    };
    // Rounding gives half a dot of grace, so that a size computed from the page's own dots is not refused.
    let dots = ((width * DOTS_PER_MM).round(), (height * DOTS_PER_MM).round());
    if !(dots.0 >= 1.0 && dots.1 >= 1.0) {
        return Err(PlacementError::TooSmall { width, height });
    }
    if dots.0 > most.0 as f64 || dots.1 > most.1 as f64 {
        return Err(PlacementError::TooLarge {
            width,
            height,
            paper: layout.paper.name(),
            most_width: most.0 as f64 / DOTS_PER_MM,
            most_height: most.1 as f64 / DOTS_PER_MM,
        });
    }
    // No layout has more room than the largest sheet, whose sides are u16.
    Ok((dots.0 as u16, dots.1 as u16))
}

/// Places a document in the middle of `paper`; its size is that of [`dots`].
pub fn place(
    pixels: (usize, usize),
    own_mm: Option<(f64, f64)>,
    asked: Option<Size>,
    paper: Paper,
) -> Result<Placement, PlacementError> {
    let (width, height) = dots(pixels, own_mm, asked, &Layout::centred(paper))?;
    Ok(Placement { paper, x: (paper.width() - width) / 2, y: (paper.length() - height) / 2, width, height })
}

/// Width and height of a placed document in millimetres.
pub fn size_mm(placement: &Placement) -> (f64, f64) {
    (f64::from(placement.width) / DOTS_PER_MM, f64::from(placement.height) / DOTS_PER_MM)
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

    #[test]
    fn a_document_without_a_size_fills_the_page_in_its_own_shape() {
        let p = place((1000, 1000), None, None, Paper::A4).unwrap();
        assert_eq!((p.width, p.height, p.x, p.y), (4800, 4800, 0, 786));
        let p = place((480, 6372), None, None, Paper::A4).unwrap();
        assert_eq!((p.width, p.height), (480, 6372));
    }

    #[test]
    fn a_box_is_filled_as_far_as_the_shape_allows() {
        let p = place((200, 100), None, Some("100x100mm".parse().unwrap()), Paper::A4).unwrap();
        assert_eq!((p.width, p.height), (2362, 1181));
        let p = place((200, 100), Some((50.0, 50.0)), Some("100mm".parse().unwrap()), Paper::A4);
        assert_eq!(p.map(|p| (p.width, p.height)), Ok((2362, 2362)), "its own size gives the shape");
    }

    #[test]
    fn what_does_not_fit_is_refused_with_both_sizes() {
        let wrong = place((10, 10), None, Some("300mm".parse().unwrap()), Paper::A4).unwrap_err();
        let text = wrong.to_string();
        assert!(
            text.contains("300.0 x 300.0") && text.contains("203.2 x 269.7") && text.contains("a4"),
            "{text}"
        );
        assert!(matches!(
            place((10, 10), Some((0.01, 0.01)), None, Paper::A4),
            Err(PlacementError::TooSmall { .. })
        ));
    }
}
