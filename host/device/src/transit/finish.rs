//! From the last byte to the sheet: what the printer itself says while it prints from its own memory.
//!
//! Problem: a job is done when the sheet is out, but what the bridge knows is that the last byte has crossed
//! the port; the printer holds some of it and prints for a while. Method: ask for its status every few
//! seconds, as the vendor's own monitor does. Its answer lags: an MD-5000 says idle right behind the last
//! byte and then prints for half a minute. So the sheet is out when the printer was seen at work and has
//! ended, or has been idle for 20 s. Another job that comes meanwhile makes the answer that one's, and then
//! nothing is known.
//! Limits: a port that does not talk back tells nothing, and that is what is reported; the sheet itself
//! nobody but the user can see.
//! A printer that is switched off and on between two questions has lost the sheet and says that it is idle.

use std::time::Duration;

use protocol::link::message::{Ask, Fault};

use crate::connection::OpenError;
use crate::connection::transport::Transport;
use crate::questions::query::{Query, QueryError, Reply};
use crate::questions::status::Status;

/// Between two questions: the vendor's monitor asks every four seconds.
const EVERY: Duration = Duration::from_secs(4);
/// So many answers in a row that it is idle are enough where it was never seen printing: 20 s.
const STILL_IDLE: u32 = 6;
/// How long the bridge may take to answer for itself.
const BRIDGE_PATIENCE: Duration = Duration::from_secs(5);
/// How long it may take to put a question to the printer, and to get the answer.
const PRINTER_PATIENCE: Duration = Duration::from_secs(25);
/// So many questions without an answer are enough where there never was one...
const NEVER: u32 = 2;
/// ...and so many where the printer has answered before: some of its states take no question.
const NO_MORE: u32 = 75;

/// What is known of the sheet.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Sheet {
    /// The printer says it has nothing to print any more.
    Out,
    /// Nothing can be known, for this reason.
    Unknown(String),
}

/// Why the printer could not be asked. The job is printed as far as the bridge can tell.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FinishError {
    /// The link could not be opened again.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The bridge did not answer.
    #[error(transparent)]
    Query(#[from] QueryError),
}

fn unknown(why: &str) -> Sheet {
    Sheet::Unknown(why.into())
}

/// Waits, without limit, until the printer says that it is done with this job, asking every few seconds.
/// `watch` is told what is the matter with the printer, once for each change; nothing when all is well again.
/// `pause` says whether to go on.
pub(crate) fn await_sheet(
    job: u32,
    open: &mut dyn FnMut() -> Result<Box<dyn Transport>, OpenError>,
    pause: &mut dyn FnMut(Duration) -> bool,
    watch: &mut dyn FnMut(&[String]),
) -> Result<Sheet, FinishError> {
    let mut link = open()?;
    let mut query = Query::new(&mut *link, BRIDGE_PATIENCE)?;
    let mut troubles: Vec<String> = Vec::new();
    let (mut worked, mut idle, mut unanswered, mut most) = (false, 0, 0, NEVER);
    loop {
        let (busy, said) = match query.printer(Ask::Printer, PRINTER_PATIENCE)? {
            Reply::OneWay => return Ok(unknown("the printer's port is one-way")),
            Reply::NotNow => return Ok(unknown("the bridge is busy with another job or question")),
            Reply::Unsure | Reply::NotAsked => {
                return Ok(unknown(
                    "the printer was switched off, its cable was pulled, or the bridge has restarted, which does not know what it is doing",
                ));
            }
            Reply::Stopped(Fault::PowerOff) => {
                return Ok(unknown("the printer is switched off or its cable is loose"));
            }
            Reply::Stopped(Fault::BusyTooLong) | Reply::Silent => (None, Vec::new()),
            Reply::Stopped(fault) => (None, vec![super::words::fault(fault, None)]),
            Reply::Bytes(bytes) => match Status::read(&bytes) {
                Ok(status) => {
                    let works = status.printing || status.holds_data;
                    worked |= works;
                    (Some(works || status.stale), status.errors)
                }
                Err(_) => (None, Vec::new()),
            },
        };
        match busy {
            Some(busy) => {
                (unanswered, most) = (0, NO_MORE);
                idle = if busy { 0 } else { idle + 1 };
            }
            None if said.is_empty() => unanswered += 1,
            None => unanswered = 0,
        }
        if said != troubles {
            watch(&said);
            troubles = said;
        }
        if idle >= if worked { 1 } else { STILL_IDLE } {
            // Asked behind the last answer: a job that came after it changes nothing.
            let last = query.ask_progress(BRIDGE_PATIENCE)?;
            return Ok(if last.job == job {
                Sheet::Out
            } else {
                unknown("the bridge has had another job since")
            });
        }
        if unanswered == most {
            return Ok(unknown("the printer does not answer"));
        }
        if !pause(EVERY) {
            return Ok(unknown("nobody waits for it any more"));
        }
    }
}
