//! What the bridge reports, in the words of somebody who stands before the printer.

use protocol::ink::Ink;
use protocol::link::message::{Defect, DefectKind, Fault, JobState, Progress};

use super::journal::Entry;
use super::session::{Outcome, Phase};
use crate::encodings::PassPlace;

/// What to do about a fault, with `ink` in the pass that was being printed.
///
/// The lines of the port do not tell a missing cartridge from an open cover, and the printer must not be asked in the
/// middle of a job; so the cartridge the pass needs is named wherever it may be the reason.
pub fn fault(fault: Fault, ink: Option<Ink>) -> String {
    let cartridge =
        |ink: Ink| format!("{} cartridge ({}, barcode {})", ink.name(), ink.part(), ink.barcode());
    match (fault, ink) {
        (Fault::PaperOut, _) => "the printer is out of paper: load a sheet, and the job continues".into(),
        (Fault::OffLine | Fault::Error, Some(ink)) => format!(
            "the printer has stopped: it may want the {}. Open the cover, put it in, close the cover, \
             and the job continues",
            cartridge(ink)
        ),
        (Fault::OffLine, None) => {
            "the printer is off line: close its cover and press its ready button, and the job continues"
                .into()
        }
        (Fault::Error, None) => {
            "the printer reports an error: look at its lamps, cover and paper; the job continues once it is cleared"
                .into()
        }
        (Fault::PowerOff, _) => {
            "the printer is switched off or its cable is loose (+5 V absent): switch it on".into()
        }
        (Fault::BusyTooLong, Some(ink)) => format!(
            "the printer has been busy for a long time without an error: if it does not move, it may want the {}; \
             nothing is lost by waiting",
            cartridge(ink)
        ),
        (Fault::BusyTooLong, None) => {
            "the printer has been busy for a long time without an error; nothing is lost by waiting".into()
        }
        (Fault::NoAck, _) => {
            "the printer does not acknowledge bytes (nAck never came): the nAck wire may be loose".into()
        }
        (Fault::Held, _) => {
            "the job is held with the bridge's button: press it once more, and the job continues".into()
        }
    }
}

/// The number (from 1) of the pass that byte `printed` of the port belongs to, and its ink. `None` before the first.
pub fn pass_at(passes: &[PassPlace], printed: u64) -> Option<(usize, Ink)> {
    let number = passes.partition_point(|pass| pass.offset <= printed);
    Some((number, Ink::from_code(passes.get(number.checked_sub(1)?)?.ink)?))
}

/// The ink whose cartridge the printer may want with `printed` bytes at the port: that of the pass, or of the first one once
/// a job has begun.
pub fn wanted(passes: &[PassPlace], printed: u64) -> Option<Ink> {
    let first = passes.first()?.offset;
    let at = if printed > 0 { printed.max(first) } else { 0 };
    pass_at(passes, at).map(|(_, ink)| ink)
}

/// Where on the sheet a job was last heard of.
fn reached(entry: &Entry) -> String {
    match pass_at(&entry.passes, u64::from(entry.record.printed)) {
        Some((number, ink)) => format!(", in pass {number} of {} ({})", entry.passes.len(), ink.name()),
        None => ", before its first pass".into(),
    }
}

/// How a job ended, in a sentence that says what to do next.
pub fn outcome(outcome: Outcome, entry: &Entry, progress: Option<&Progress>) -> String {
    let printed = entry.record.printed;
    match outcome {
        Outcome::Printed => format!(
            "{}: sent; the printer has taken all {} bytes, {} passes, and now prints what it still holds",
            entry.name,
            printed,
            entry.passes.len()
        ),
        Outcome::Cancelled if printed == 0 => {
            format!("{}: cancelled; the printer has not received any of it", entry.name)
        }
        Outcome::Cancelled => {
            format!(
                "{}: cancelled; the sheet comes out unfinished and the printer is ready for the next job",
                entry.name
            )
        }
        Outcome::Stored => format!("{}: stored in the bridge; nothing is printed yet", entry.name),
        Outcome::Broken => {
            let why = match progress.map(|progress| progress.state) {
                Some(JobState::Broken(what)) => format!(" ({})", defect(what)),
                _ => String::new(),
            };
            format!(
                "{}: the bridge could not read the job{why}, so it was not printed; the printer is ready for the next one",
                entry.name
            )
        }
        Outcome::Lost => format!(
            "{}: the sheet is lost{}: the printer was switched off or its cable pulled during the job, the bridge lost its supply, or someone \
             gave the job up with `foilpress bridge reset`. Take out the sheet, and send the job again; the bridge resets the printer before \
             the next one",
            entry.name,
            reached(entry)
        ),
        Outcome::Forgotten => format!(
            "{}: the bridge no longer knows this job, because it lost its memory or has printed many others since. At least {printed} of \
             {} bytes were printed{}. If the sheet comes out complete, nothing is wrong; otherwise it is lost: take it out. The job is not \
             sent again by itself, so that nothing is printed twice",
            entry.name,
            entry.port_bytes,
            reached(entry)
        ),
    }
}

fn defect(defect: Defect) -> String {
    let what = match defect.what {
        DefectKind::Header => "an unknown header",
        DefectKind::Forbidden => "something that must not be printed",
        DefectKind::TooLarge => "a page too wide for its memory",
        DefectKind::Stream => "a damaged pass stream",
        DefectKind::Excess => "bytes after the end",
        DefectKind::Truncated => "the end is missing",
        DefectKind::Flash => "the bridge's flash does not keep what is written",
    };
    format!("byte {}: {what}", defect.at)
}

/// Where a job in the journal stands.
pub fn phase(entry: &Entry) -> String {
    match entry.record.phase {
        _ if entry.record.cancel && !matches!(entry.record.phase, Phase::Ended(_)) => {
            "cancel requested; the bridge has not confirmed it".into()
        }
        Phase::Queued => "queued, nothing printed".into(),
        Phase::Begun => "announced to the bridge, nothing printed".into(),
        Phase::Sending => {
            format!("at least {} of {} bytes printed", entry.record.printed, entry.port_bytes)
        }
        Phase::Ended(outcome) => match outcome {
            Outcome::Printed => "printed",
            Outcome::Cancelled => "cancelled",
            Outcome::Broken => "refused by the bridge",
            Outcome::Lost => "sheet lost",
            Outcome::Stored => "stored in the bridge",
            Outcome::Forgotten => "no longer known to the bridge",
        }
        .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_in_a_pass_names_the_cartridge_as_it_is_sold() {
        let text = fault(Fault::OffLine, Some(Ink::White));
        assert!(text.contains("white cartridge (MDC-SCWH, barcode 16)"), "{text}");
        assert!(!fault(Fault::PaperOut, Some(Ink::White)).contains("cartridge"), "paper is no matter of ink");
    }

    #[test]
    fn the_pass_is_the_one_whose_bytes_are_being_printed() {
        let passes = [
            PassPlace { ink: Ink::White.code(), offset: 50 },
            PassPlace { ink: Ink::Cyan.code(), offset: 900 },
        ];
        let at = |printed| pass_at(&passes, printed);
        assert_eq!(at(49), None);
        assert_eq!((at(50), at(899)), (Some((1, Ink::White)), Some((1, Ink::White))));
        assert_eq!(at(5000), Some((2, Ink::Cyan)));
        // The first cartridge is fetched before its first row; a printer that has not begun wants none.
        assert_eq!(
            [0, 1, 49, 900].map(|printed| wanted(&passes, printed)),
            [None, Some(Ink::White), Some(Ink::White), Some(Ink::Cyan)]
        );
    }
}
