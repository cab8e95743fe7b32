//! How large a document or art is on paper.
//!
//! What comes out is a size in 600 dpi dots. A document keeps its shape; where it lies is the rest of the layout's
//! business.

use protocol::paper::LARGEST;

use super::settings::Layout;
use sheet::{DOTS_PER_MM, Size};

/// Why a document of this size cannot be printed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SizeError {
    /// Larger than the printable area.
    #[error(
        "{width:.1} x {height:.1} mm does not fit; the printable area of {paper} has room for {most_width:.1} x \
         {most_height:.1} mm"
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
    /// Larger than any sheet, though what lies beyond the printable area would be cut off.
    #[error(
        "{width:.1} x {height:.1} mm does not fit the largest sheet, which has room for {most_width:.1} x {most_height:.1} mm"
    )]
    BeyondSheets {
        /// Width asked for, in mm.
        width: f64,
        /// Height asked for, in mm.
        height: f64,
        /// Printable width of the largest sheet in mm.
        most_width: f64,
        /// Its printable height in mm.
        most_height: f64,
    },
    /// Less than a dot.
    #[error("{width:.4} x {height:.4} mm is smaller than a dot (1 dot is {:.4} mm)", 1.0 / DOTS_PER_MM)]
    TooSmall {
        /// Width asked for, in mm.
        width: f64,
        /// Height asked for, in mm.
        height: f64,
    },
}

/// Dots across and down of a document of `pixels` (width, height) on a page of this layout.
///
/// The document fills the size `asked` for as far as its shape allows. Without one it has its own size `own_mm`, and
/// without that the largest size that fits. A layout that cuts has room for any document up to the largest sheet.
///
/// # Errors
/// A size smaller than a dot, or larger than the room.
pub fn dots(
    pixels: (usize, usize),
    own_mm: Option<(f64, f64)>,
    asked: Option<Size>,
    layout: &Layout,
) -> Result<(u16, u16), SizeError> {
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
        return Err(SizeError::TooSmall { width, height });
    }
    if dots.0 > most.0 as f64 || dots.1 > most.1 as f64 {
        let (most_width, most_height) = (most.0 as f64 / DOTS_PER_MM, most.1 as f64 / DOTS_PER_MM);
        return Err(match layout.cut {
            true => SizeError::BeyondSheets { width, height, most_width, most_height },
            false => {
                let paper = layout.paper.name();
                SizeError::TooLarge { width, height, paper, most_width, most_height }
            }
        });
    }
    // No layout has more room than the largest sheet, whose sides are u16.
    Ok((dots.0 as u16, dots.1 as u16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::paper::Paper;

    fn on_a4(
        pixels: (usize, usize),
        own: Option<(f64, f64)>,
        asked: Option<&str>,
    ) -> Result<(u16, u16), SizeError> {
        let layout = Layout::centred(Paper::A4);
        dots(pixels, own, asked.map(|text| text.parse().unwrap()), &layout)
    }

    #[test]
    fn a_document_without_a_size_fills_the_page_in_its_own_shape() {
        assert_eq!(on_a4((1000, 1000), None, None), Ok((4800, 4800)));
        assert_eq!(on_a4((480, 6372), None, None), Ok((480, 6372)));
    }

    #[test]
    fn a_box_is_filled_as_far_as_the_shape_allows() {
        assert_eq!(on_a4((200, 100), None, Some("100x100mm")), Ok((2362, 1181)));
        let own = on_a4((200, 100), Some((50.0, 50.0)), Some("100mm"));
        assert_eq!(own, Ok((2362, 2362)), "its own size gives the shape");
    }

    #[test]
    fn what_does_not_fit_is_refused_with_both_sizes() {
        let text = on_a4((10, 10), None, Some("300mm")).unwrap_err().to_string();
        assert!(
            text.contains("300.0 x 300.0") && text.contains("203.2 x 269.7") && text.contains("a4"),
            "{text}"
        );
        assert!(matches!(on_a4((10, 10), Some((0.01, 0.01)), None), Err(SizeError::TooSmall { .. })));
    }

    #[test]
    fn a_layout_that_cuts_has_room_up_to_the_largest_sheet() {
        let layout = Layout { cut: true, ..Layout::centred(Paper::Postcard) };
        let large = |asked: &str| dots((10, 10), None, Some(asked.parse().unwrap()), &layout);
        assert_eq!(large("200mm"), Ok((4724, 4724)));
        assert!(matches!(large("220mm"), Err(SizeError::BeyondSheets { .. })));
    }
}
