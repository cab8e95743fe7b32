//! Whether a page has room for a chart, which has one size: asked before the long work.

use super::error::ChartError;
use crate::layout::{self, Layout, LayoutError, Mm};

/// Checks that a chart of this size in dots can be laid so.
///
/// # Errors
/// A paper that is too small, or a place where the chart does not lie wholly on it, unless the layout says to cut.
pub fn check_room(
    chart: &'static str,
    (width, length): (usize, usize),
    layout: &Layout,
) -> Result<(), ChartError> {
    let (most_width, most_length) = (usize::from(layout.paper.width()), usize::from(layout.paper.length()));
    if !layout.cut && (width > most_width || length > most_length) {
        let needed = |dots: usize| Mm::of_dots(dots as i64).0.ceil() as u32;
        let (width, length) = (needed(width), needed(length));
        return Err(ChartError::Paper { chart, width, length, paper: layout.paper.name() });
    }
    layout::check(width, length, layout).map_err(|error| match error {
        LayoutError::Beyond { cut, width, length, paper, most_width, most_length } => {
            ChartError::Beyond { cut, width, length, paper, most_width, most_length }
        }
        other => ChartError::Layout(other),
    })
}
