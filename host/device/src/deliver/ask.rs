//! Questions to the printer behind a bridge, put only where they can do no harm.
//!
//! Problem: the status question is two bytes at the port. Inside a job they are row data, and to a printer that does not negotiate
//! they are text; a negotiation itself may take an old printer off line. Method: the bridge answers only while it knows that the
//! printer stands between two jobs. After a loss of its supply it does not; then what this computer has noted about the printer
//! decides, the same notes by which a job is sent. A printer that has shown that it does not negotiate is noted by its bridge's
//! serial number, and left alone.
//! A job that an operating system printed through the bridge by itself leaves no note here: the bridge keeps one in its flash.

use std::time::Duration;

use protocol::link::message::Ask;

use crate::printers::{Printer, Printers, PrintersError, Standing};
use crate::questions::query::{Query, QueryError, Reply};

/// Why a printer could not be asked.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// The bridge did not answer.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// What is known of printers cannot be read.
    #[error(transparent)]
    Printers(#[from] PrintersError),
}

/// Whom to ask although it has shown before that it does not negotiate.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Negotiate {
    /// Nobody.
    Known,
    /// Everybody: the user wants to know, and another printer may be there by now.
    Again,
    /// Nobody at all, not even for the first time.
    Never,
}

/// Asks the printer for its device ID.
pub fn device_id(
    query: &mut Query<'_>,
    printers: &Printers,
    negotiate: Negotiate,
    patience: Duration,
) -> Result<Reply, AskError> {
    ask(query, printers, Ask::DeviceId, negotiate, patience)
}

/// Asks the printer for its status.
pub fn status(
    query: &mut Query<'_>,
    printers: &Printers,
    negotiate: Negotiate,
    patience: Duration,
) -> Result<Reply, AskError> {
    match ask(query, printers, Ask::Printer, negotiate, patience)? {
        Reply::Unsure if is_at_rest(query, printers)? => {
            ask(query, printers, Ask::PrinterAtRest, negotiate, patience)
        }
        reply => Ok(reply),
    }
}

fn ask(
    query: &mut Query<'_>,
    printers: &Printers,
    what: Ask,
    negotiate: Negotiate,
    patience: Duration,
) -> Result<Reply, AskError> {
    let printer = Printer::Bridge(query.bridge().serial);
    match negotiate {
        Negotiate::Never => return Ok(Reply::NotAsked),
        Negotiate::Known if printers.is_one_way(&printer) => return Ok(Reply::OneWay),
        Negotiate::Known | Negotiate::Again => {}
    }
    let reply = query.printer(what, patience)?;
    let one_way = match reply {
        // One that negotiates but has no device ID is not told from one that does not negotiate.
        Reply::OneWay if what != Ask::DeviceId => true,
        Reply::Bytes(_) => false,
        _ => return Ok(reply),
    };
    // If it cannot be noted, the printer is asked once more the next time.
    let _ = printers.note_one_way(&printer, one_way);
    Ok(reply)
}

/// Whether nothing is noted of which the printer may hold a part.
fn is_at_rest(query: &Query<'_>, printers: &Printers) -> Result<bool, PrintersError> {
    let bridge = query.bridge();
    let unfinished = printers.unfinished(&Printer::Bridge(bridge.serial))?;
    Ok(unfinished.iter().all(|job| {
        matches!(job.standing(bridge.boot, query.progress(), query.past()), Standing::Ended { .. })
    }))
}
