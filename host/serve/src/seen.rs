//! A sheet as somebody sees it: printed by the simulated printer, in all inks or some.
//!
//! Cost: a sheet takes 4 MB a pass, and a tenth of a second to print. Limits: the last one is kept for the
//! next look.

use std::io::Write as _;
use std::sync::{Arc, Mutex, PoisonError};

use device::encodings;
use observe::{Silent, with_causes};
use press::preview::inks::{Ground, thumbnail};
use press::simulate::{Printout, Setup, print};
use protocol::ink::Ink;
use queue::backend::Sheets as _;
use sheet::Sheet;

use crate::jobs::{Job, Store};
use crate::making::Making;

/// A sheet that somebody looks at: its job, the round of its drawing, and its page.
pub(crate) struct Seen {
    of: (u32, u32, usize),
    printout: Arc<Printout>,
}

/// The longest side of the picture that is kept.
const KEPT: usize = 240;

/// The sheet that a job prints for a page, from 1, if it is drawn.
///
/// # Errors
/// In words: there is none.
pub(crate) fn printed(
    seen: &Mutex<Option<Seen>>,
    job: &Job,
    page: usize,
    sheets: &Making,
) -> Result<Arc<Printout>, String> {
    let of = (job.id, job.round, page);
    {
        let seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(seen) = seen.as_ref().filter(|seen| seen.of == of) {
            return Ok(seen.printout.clone());
        }
    }
    let missing = || format!("there is no sheet {page}");
    let index = page.checked_sub(1).filter(|index| *index < sheets.count()).ok_or_else(missing)?;
    let bytes = sheets.sheet(index).map_err(|error| error.to_string())?.ok_or_else(missing)?;
    encodings::check(&bytes, &Silent).map_err(|error| with_causes(&error))?;
    let printout = Arc::new(print(&bytes, &Setup::default(), &Silent).map_err(|error| with_causes(&error))?);
    *seen.lock().unwrap_or_else(PoisonError::into_inner) = Some(Seen { of, printout: printout.clone() });
    Ok(printout)
}

/// A sheet in all inks but some, and its dots in 1/600 inch across.
///
/// # Errors
/// In words: it has too many stacks.
pub(crate) fn sheet_without(printout: &Printout, without: &[Ink]) -> Result<(Sheet, usize), String> {
    let all = &printout.passes;
    let sheet = match without {
        [] => printout.sheet_in_dots(None),
        _ => {
            let passes = all.iter().filter(|pass| !without.contains(&pass.ink)).cloned().collect();
            Printout { passes, ..printout.clone() }.sheet_in_dots(None)
        }
    };
    let across = usize::from(printout.resolution.dpi().0) / 600;
    Ok((sheet.map_err(|error| with_causes(&error))?, across.max(1)))
}

/// Keeps a small picture of a job's first sheet, which stays when the sheet is gone.
///
/// # Errors
/// In words: there is no sheet, or no room.
pub(crate) fn keep_picture(
    seen: &Mutex<Option<Seen>>,
    store: &Store,
    job: &Job,
    sheets: &Making,
) -> Result<(), String> {
    let path = store.picture(job.id);
    let printout = printed(seen, job, 1, sheets)?;
    let (sheet, across) = sheet_without(&printout, &[])?;
    let picture = thumbnail(&sheet, sheet.whole(), across, Ground::default(), KEPT);
    let bytes = picture.png().map_err(|error| error.to_string())?;
    files::write(&path, |out| out.write_all(&bytes)).map_err(|error| with_causes(&error))
}
