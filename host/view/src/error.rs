//! Errors of relit pictures.

use press::preview::PreviewError;

/// Why a picture or a page cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Reading the document, the sheet or the light probe.
    #[error(transparent)]
    Preview(#[from] PreviewError),
    /// A document must be factored before it can be lit.
    #[error("the document is not factored; factor it first")]
    NotFactored,
    /// The document has too many materials for one picture.
    #[error("{found} materials in one picture; at most {most} can be lit")]
    Materials {
        /// Those found.
        found: usize,
        /// The most.
        most: usize,
    },
    /// A size on paper that is no length.
    #[error("the sheet would be {width} x {height} m; each side must be from 0.00001 to 10 m")]
    Size {
        /// Width.
        width: f64,
        /// Height.
        height: f64,
    },
    /// A light that cannot shine.
    #[error("light {light}: {problem}")]
    Light {
        /// Its number, from 1.
        light: usize,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// An eye that cannot see the sheet.
    #[error("view: {0}")]
    Camera(String),
    /// A sheet that cannot be held like this.
    #[error("sheet: {0}")]
    Pose(String),
    /// Packing a page or a texture. Never seen; if it is, it is a bug worth a report.
    #[error("the file cannot be packed")]
    Pack(#[from] std::io::Error),
    /// Writing a description. Never seen; if it is, it is a bug worth a report.
    #[error("the file cannot be described")]
    Describe(#[from] serde_json::Error),
}
