//! Whether bytes may be sent: one whole legal job, and nothing else.
//!
//! Cost: one look at each byte, one bit of memory for each dot and pass, because the ribbon a pass takes depends on where its dots are.

use protocol::ink::Ink;
use protocol::paper::Paper;

use observe::Observer;
use press::inspect::{StreamError, inspect};
use press::job::ribbon;
use serde::{Deserialize, Serialize};

/// Why a job is not sent. No byte has left.
#[derive(Debug, thiserror::Error)]
pub enum Unsendable {
    /// Not one whole legal job.
    #[error("not sent: the file is not one complete job")]
    Illegal(#[from] StreamError),
    /// More than positions on the link can say.
    #[error("not sent: {0} bytes are more than 2 GB")]
    TooLarge(u64),
}

/// A pass of a job, as much as is needed to speak of it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct PassPlace {
    /// Code of its ink in the printer's language.
    pub ink: u8,
    /// Offset of its first byte at the port.
    pub offset: u64,
}

/// A job that may be sent.
#[derive(Clone, Debug)]
pub struct Checked {
    /// Where its passes begin.
    pub passes: Vec<PassPlace>,
    /// Its inks in the order of first use.
    pub inks: Vec<Ink>,
    /// Ribbon that each pass takes in millimetres, an estimate.
    pub ribbon_mm: Vec<f64>,
    /// Whose dialect it is, if it is not ours: worth a word, for only ours is known to print.
    pub dialect: Option<&'static str>,
    /// Whether its paper is fed by hand, with the feed lever at M.
    pub by_hand: bool,
}

/// Checks that these bytes are one whole legal job, and nothing else.
pub fn check(job: &[u8], observer: &dyn Observer) -> Result<Checked, Unsendable> {
    const MOST: u64 = i32::MAX as u64;
    if job.len() as u64 > MOST {
        return Err(Unsendable::TooLarge(job.len() as u64));
    }
    let inspected = inspect(job, observer);
    if let Some(error) = inspected.inspection.error {
        return Err(error.into());
    }
    let passes: Vec<PassPlace> = inspected
        .inspection
        .passes
        .iter()
        .map(|pass| PassPlace { ink: pass.code, offset: pass.offset })
        .collect();
    let mut inks = Vec::new();
    for ink in passes.iter().filter_map(|pass| Ink::from_code(pass.ink)) {
        if !inks.contains(&ink) {
            inks.push(ink);
        }
    }
    let dpi = inspected.inspection.setup.resolution.unwrap_or((600, 600));
    let ribbon_mm = inspected.passes.iter().map(|pass| ribbon::of(&pass.plane, dpi).ribbon_mm).collect();
    // Of all papers, the vendor feeds postcards by hand.
    let by_hand = inspected.inspection.setup.paper == Some(Paper::Postcard.name());
    Ok(Checked { passes, inks, ribbon_mm, dialect: inspected.inspection.dialect, by_hand })
}
