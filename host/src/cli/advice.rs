//! The options that help when something is refused: libraries name what is wrong, only the command line knows its options.

use press::chart::ChartError;
use press::layout::{LayoutError, SizeError};
use press::pipeline::JobError;
use press::pipeline::document::StageError;

/// Which options to try, if this error is one of those that options help against.
pub fn of(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| {
        let layout = cause.downcast_ref::<LayoutError>();
        let layout = layout.or_else(|| match cause.downcast_ref()? {
            JobError::Layout(error) => Some(error),
            _ => None,
        });
        let layout = layout.or_else(|| match cause.downcast_ref()? {
            StageError::Layout(error) => Some(error),
            _ => None,
        });
        let size = cause.downcast_ref::<SizeError>();
        let size = size.or_else(|| match cause.downcast_ref()? {
            StageError::Size(error) => Some(error),
            _ => None,
        });
        match (layout, size, cause.downcast_ref()) {
            (Some(LayoutError::Beyond { .. }), ..) => {
                Some("change --at or --size, take a larger --paper, or cut with --crop")
            }
            (Some(LayoutError::FillsNothing { .. }), ..) => Some("give a smaller --size or a larger --paper"),
            (_, Some(SizeError::TooLarge { .. }), _) => {
                Some("give a smaller --size, a larger --paper, or cut with --crop")
            }
            (_, Some(SizeError::TooSmall { .. }), _) => Some("give a larger --size"),
            (.., Some(ChartError::TooMany { .. })) => Some("name the inks with --inks"),
            _ => None,
        }
    })
}
