//! Why something is not made: the error of the stage that refused.

use std::error::Error as StdError;

use appearance::brdf::plot::PlotError;
use appearance::factor::FactorError;
use appearance::gamut::GamutError;
use appearance::weights::WeightError;
use halftone::HalftoneError;
use observe::Diagnosis;
use press::pipeline::JobError;
use press::pipeline::document::StageError;
use press::preview::PreviewError;
use view::ViewError;

/// Why something is not made. The text is that of the stage that refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A document does not become dots.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// Dots do not become a job.
    #[error(transparent)]
    Job(#[from] JobError),
    /// Art or settings that do not suit each other.
    #[error(transparent)]
    Diagnosis(#[from] Diagnosis),
    /// Figures of the dots.
    #[error(transparent)]
    Halftone(#[from] HalftoneError),
    /// A picture.
    #[error(transparent)]
    Preview(#[from] PreviewError),
    /// A picture under light that follows the hand.
    #[error(transparent)]
    View(#[from] ViewError),
    /// A plot of curves. Never seen; if it is, it is a bug worth a report.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// Text that cannot be written. Never seen either.
    #[error(transparent)]
    Text(#[from] std::fmt::Error),
    /// A picture that cannot be compressed. Never seen either.
    #[error("a picture cannot be written")]
    Picture(#[from] std::io::Error),
    /// There is nothing of that name.
    #[error("`{name}` is none of {}", known.join(", "))]
    Name {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
}

impl From<FactorError> for Error {
    fn from(error: FactorError) -> Error {
        StageError::from(error).into()
    }
}

impl From<WeightError> for Error {
    fn from(error: WeightError) -> Error {
        StageError::from(GamutError::from(error)).into()
    }
}

impl Error {
    /// The error of the stage that refused, for whoever tells its kinds apart.
    #[must_use]
    pub fn stage(&self) -> &(dyn StdError + 'static) {
        match self {
            Error::Stage(error) => error,
            Error::Job(error) => error,
            Error::Diagnosis(error) => error,
            Error::Halftone(error) => error,
            Error::Preview(error) => error,
            Error::View(error) => error,
            Error::Plot(error) => error,
            Error::Text(error) => error,
            Error::Picture(_) | Error::Name { .. } => self,
        }
    }
}
