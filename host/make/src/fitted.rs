//! Art on the sheet that is given: measured, laid, and read as large as it is printed.
//!
//! Method: [`art::seen`] tells the size, [`fit`] decides, and the reader applies it where the drawing is
//! still sharp.
//! Limits: a picture that states no resolution has a shape and no size, so it is fitted.

use std::fmt;
use std::path::PathBuf;

use art::{Options, Room, seen};
use observe::Diagnosis;
use press::layout::Position;
use press::layout::fit::{Edge, Fit, FitError, Scaling, Wish, fit};
use protocol::paper::Paper;
use sheet::Size;

use crate::layers::Settings;

/// Why art is not laid.
#[derive(Debug, thiserror::Error)]
pub enum FittedError {
    /// It cannot be read.
    #[error(transparent)]
    Art(#[from] Diagnosis),
    /// It cannot be laid on the sheet.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Art that is laid on a sheet, and not read yet.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// How it lies.
    pub fit: Fit,
    /// How it is read, so that it is as large and lies as `fit` says.
    pub read: Options,
    /// Whether it has a size of its own.
    is_stated: bool,
    /// Whether somebody has said how wide it is to be.
    is_wished: bool,
}

impl Fitted {
    /// How art is read by these options for this sheet.
    ///
    /// # Errors
    /// Art that cannot be read, or laid on the sheet.
    pub fn of(files: &[PathBuf], read: &Options, paper: Paper, wish: &Wish) -> Result<Fitted, FittedError> {
        let found = seen(files, read)?;
        let (edge, mut wish) = (if found.is_page { Edge::Margin } else { Edge::Content }, *wish);
        if !found.is_stated && !matches!(wish.scaling, Scaling::Fill | Scaling::Wide(_)) {
            wish.scaling = Scaling::Fit;
        }
        let fit = fit(found.size_mm, edge, paper, &wish)?;
        let (width, length) = found.size_mm;
        let size = Size { width: fit.scale * width, height: Some(fit.scale * length) };
        let read = Options {
            // A document is drawn at another resolution; a picture gets another size.
            scale: if found.is_page { fit.scale } else { 1.0 },
            size: if found.is_page { None } else { Some(size) },
            turn: fit.turn,
            room: Room { cut: true, ..Room::default() },
            ..read.clone()
        };
        let is_wished = matches!(wish.scaling, Scaling::Wide(_));
        Ok(Fitted { fit, read, is_stated: found.is_stated, is_wished })
    }

    /// These settings for art that lies so.
    #[must_use]
    pub fn settings(&self, mut settings: Settings) -> Settings {
        settings.read = self.read.clone();
        settings.page.layout.position = Position::FromEdge(self.fit.corner);
        settings.page.layout.cut = true;
        settings
    }
}

impl fmt::Display for Fitted {
    /// What was done to it, in words; none if it lies as it comes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_stated {
            return self.fit.fmt(f);
        }
        let turned = Fit { scale: 1.0, ..self.fit }.to_string();
        if self.is_wished {
            return f.write_str(&turned);
        }
        let and = if turned.is_empty() { "" } else { " and " };
        write!(f, "{turned}{and}as large as the sheet allows, for it states no resolution")
    }
}
