//! Why there is no measurement.

use std::path::PathBuf;

/// Why photographs give no curves. Each text names the file or field and says what to do.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A file cannot be read or written.
    #[error("{}: cannot be read or written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The setup file.
    #[error("{}: {problem}", path.display())]
    Setup {
        /// The file.
        path: PathBuf,
        /// Field, what was found, what to do.
        problem: String,
    },
    /// A photograph.
    #[error("{}: {problem}", path.display())]
    Photo {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
    /// The photographs together, or what they show.
    #[error("{0}")]
    Scene(String),
}

impl MeasureError {
    pub(crate) fn photo(path: &std::path::Path, problem: impl Into<String>) -> MeasureError {
        MeasureError::Photo { path: path.to_path_buf(), problem: problem.into() }
    }
}
