//! Why a picture cannot be read, whatever its format.

use image::ImageError;

/// Why a picture cannot be read.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Fault {
    /// It has no known format; what it is instead.
    #[error("found {0}")]
    Unknown(&'static str),
    /// It is larger than allowed.
    #[error("{0}")]
    Large(String),
    /// It has pixels that are not decoded.
    #[error("{0}")]
    Unsupported(String),
    /// It has pixels of another kind than is read; with what to do.
    #[error("{0}")]
    Kind(String),
    /// It is damaged.
    #[error("{0}")]
    Damaged(String),
}

impl From<ImageError> for Fault {
    fn from(error: ImageError) -> Fault {
        let said = error.to_string();
        match error {
            ImageError::Limits(_) => Fault::Large(said),
            ImageError::Unsupported(_) => Fault::Unsupported(said),
            _ => Fault::Damaged(said),
        }
    }
}
