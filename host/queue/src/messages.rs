//! Messages to the print system: lines on standard error that begin with a keyword.
//!
//! `STATE:` lines add and remove reasons of the printer's state, `ATTR:` lines set attributes, `INFO:` and `ERROR:` lines
//! are what people read beside the printer's name, `PAGE:` lines count sheets. Only changes are reported. Reasons are keywords
//! of IPP where there is one, so that print dialogs show them in the user's language.

use std::collections::BTreeSet;
use std::io::Write;
use std::sync::{Mutex, PoisonError};

use protocol::ink::Ink;
use protocol::link::message::Fault;
use protocol::status::Complaint;

use device::questions::status::Status;
use observe::{Observer, visible_line};

/// Why a printer does not print, or soon will not.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Reason {
    /// The bridge is not connected, or another program uses it.
    Connecting,
    /// The printer is off line or switched off, or its bridge is disconnected.
    OffLine,
    /// No paper.
    MediaEmpty,
    /// Paper of another size.
    MediaNeeded,
    /// Paper jam.
    MediaJam,
    /// Its cover is open.
    CoverOpen,
    /// A ribbon is at its end.
    SupplyEmpty,
    /// A cartridge is needed that is not loaded.
    SupplyMissing,
    /// The disk of this computer is full.
    SpoolAreaFull,
    /// Something else that needs the operator.
    Other,
}

const ALL: [Reason; 10] = [
    Reason::Connecting,
    Reason::OffLine,
    Reason::MediaEmpty,
    Reason::MediaNeeded,
    Reason::MediaJam,
    Reason::CoverOpen,
    Reason::SupplyEmpty,
    Reason::SupplyMissing,
    Reason::SpoolAreaFull,
    Reason::Other,
];

impl Reason {
    /// The keyword.
    pub fn keyword(self) -> &'static str {
        match self {
            Reason::Connecting => "connecting-to-device",
            Reason::OffLine => "offline-report",
            Reason::MediaEmpty => "media-empty-error",
            Reason::MediaNeeded => "media-needed-error",
            Reason::MediaJam => "media-jam-error",
            Reason::CoverOpen => "cover-open-error",
            Reason::SupplyEmpty => "marker-supply-empty-error",
            Reason::SupplyMissing => "marker-supply-missing-warning",
            Reason::SpoolAreaFull => "spool-area-full",
            Reason::Other => "other-error",
        }
    }

    /// The reason for a fault that the port's lines show.
    pub fn of_fault(fault: Fault) -> Reason {
        match fault {
            Fault::PaperOut => Reason::MediaEmpty,
            Fault::OffLine | Fault::PowerOff => Reason::OffLine,
            Fault::Error | Fault::BusyTooLong | Fault::NoAck | Fault::Held => Reason::Other,
        }
    }

    /// The reason for a complaint of the printer itself.
    pub fn of_complaint(complaint: &Complaint) -> Reason {
        match complaint {
            Complaint::CoverOpen => Reason::CoverOpen,
            Complaint::NoPaper { .. } => Reason::MediaEmpty,
            Complaint::WrongSize { .. } => Reason::MediaNeeded,
            Complaint::Jam { .. } => Reason::MediaJam,
            Complaint::RibbonEnd | Complaint::RibbonBreak => Reason::SupplyEmpty,
            Complaint::WrongCartridge { .. } => Reason::SupplyMissing,
            _ => Reason::Other,
        }
    }
}

/// Whoever hears how a delivery goes: a print system, or a print server. As an [`Observer`] it hears notes and progress.
pub trait Report: Observer {
    /// Replaces the printer's reasons by these.
    fn reasons(&self, reasons: &[Reason]);
    /// Removes these reasons.
    fn lift(&self, over: &[Reason]);
    /// Removes all reasons but this one.
    fn lift_all_but(&self, stays: Reason) {
        let over: Vec<Reason> = ALL.into_iter().filter(|&reason| reason != stays).collect();
        self.lift(&over);
    }
    /// A message for people.
    fn info(&self, text: &str);
    /// Why the job failed or stopped.
    fn error(&self, text: &str);
    /// A message for the log only.
    fn debug(&self, text: &str);
    /// A sheet is done.
    fn page(&self, number: usize);
    /// How much of the sheet is done, in percent.
    fn percent(&self, share: u64);
    /// The cartridges the printer has found. It does not know how much ribbon is left.
    fn cartridges(&self, status: &Status);
}

struct State<W> {
    out: W,
    reasons: BTreeSet<Reason>,
    /// The current stage, its steps, the steps done, and the percentage reported last.
    stage: (String, u64, u64),
    share: Option<u64>,
}

/// Messages to the print system. As an observer it reports notes as information and progress as that of the job.
pub struct Messages<W> {
    state: Mutex<State<W>>,
    progress: bool,
}

impl<W: Write + Send> Messages<W> {
    /// Begins by removing every reason that an earlier process may have left.
    pub fn new(out: W) -> Messages<W> {
        let state = State { out, reasons: ALL.into(), stage: (String::new(), 0, 0), share: None };
        let messages = Messages { state: Mutex::new(state), progress: true };
        messages.reasons(&[]);
        messages
    }

    /// For a filter, which knows nothing about the printer and whose progress is not that of the job.
    pub fn of_filter(out: W) -> Messages<W> {
        let state = State { out, reasons: BTreeSet::new(), stage: (String::new(), 0, 0), share: None };
        Messages { state: Mutex::new(state), progress: false }
    }

    fn with<R>(&self, act: impl FnOnce(&mut State<W>) -> R) -> R {
        act(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn line(&self, keyword: &str, text: &str) {
        // A message is one line. If nobody reads it, the job goes on.
        let text = text.replace('\n', " ");
        let text = visible_line(&text);
        // Filter and backend share a pipe: what is written at once, up to a page, is not torn apart by the other's lines.
        let line = format!("{keyword}: {text}\n");
        self.with(|state| {
            let _ = state.out.write_all(line.as_bytes());
        });
    }
}

impl<W: Write + Send> Report for Messages<W> {
    fn reasons(&self, reasons: &[Reason]) {
        let wanted: BTreeSet<Reason> = reasons.iter().copied().collect();
        let before = self.with(|state| std::mem::replace(&mut state.reasons, wanted.clone()));
        for (sign, changed) in [("-", &before - &wanted), ("+", &wanted - &before)] {
            if !changed.is_empty() {
                let words: Vec<&str> = changed.into_iter().map(Reason::keyword).collect();
                self.line("STATE", &format!("{sign}{}", words.join(",")));
            }
        }
    }

    fn lift(&self, over: &[Reason]) {
        let left: Vec<Reason> =
            self.with(|state| state.reasons.iter().copied().filter(|r| !over.contains(r)).collect());
        self.reasons(&left);
    }

    fn info(&self, text: &str) {
        self.line("INFO", text);
    }

    fn error(&self, text: &str) {
        self.line("ERROR", text);
    }

    fn debug(&self, text: &str) {
        self.line("DEBUG", text);
    }

    fn page(&self, number: usize) {
        self.line("PAGE", &format!("{number} 1"));
    }

    fn percent(&self, share: u64) {
        let new = self.with(|state| state.share.replace(share) != Some(share));
        if new {
            self.line("ATTR", &format!("job-media-progress={share}"));
        }
    }

    fn cartridges(&self, status: &Status) {
        if status.stale || status.cartridges.is_empty() {
            return;
        }
        let each = |say: &dyn Fn(&device::questions::status::CartridgeStatus) -> String| {
            status.cartridges.iter().map(say).collect::<Vec<_>>().join(",")
        };
        // Of IPP's levels: -3 some is left, 0 none.
        let level = |condition: &str| if condition == "loaded" { "-3" } else { "0" };
        let ink = |barcode| Ink::from_barcode(barcode);
        self.line(
            "ATTR",
            &format!(
                "marker-names={} marker-types={} marker-colors={} marker-levels={}",
                each(&|c| ink(c.barcode)
                    .map_or_else(|| format!("cartridge-{}", c.barcode), |ink| ink.name().into())),
                each(&|_| "ribbonWax".into()),
                each(&|c| ink(c.barcode).map_or("none", colour).into()),
                each(&|c| level(c.condition).into()),
            ),
        );
    }
}

/// The colour of a ribbon in a print dialog.
pub fn colour(ink: Ink) -> &'static str {
    match ink {
        Ink::Black => "#000000",
        Ink::Cyan => "#00FFFF",
        Ink::Magenta => "#FF00FF",
        Ink::Yellow => "#FFFF00",
        Ink::MetallicGold | Ink::GoldFoil => "#E1A000",
        Ink::MetallicMagenta => "#A32473",
        Ink::MetallicCyan => "#00B0C9",
        Ink::MetallicSilver | Ink::SilverFoil => "#BDC1C5",
        Ink::White => "#FFFFFF",
        Ink::Finish | Ink::Primer => "none",
    }
}

impl<W: Write + Send> Observer for Messages<W> {
    fn begin(&self, stage: &str, total: u64) {
        self.with(|state| state.stage = (stage.into(), total, 0));
        self.debug(stage);
    }

    fn advance(&self, steps: u64) {
        let share = self.with(|state| {
            state.stage.2 += steps;
            (state.stage.1 > 0).then(|| (100 * state.stage.2 / state.stage.1).min(100))
        });
        if let Some(share) = share.filter(|_| self.progress) {
            self.percent(share);
        }
    }

    fn end(&self) {}

    fn note(&self, text: &str) {
        self.info(text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(messages: Messages<Vec<u8>>) -> Vec<String> {
        let state = messages.state.into_inner().unwrap();
        String::from_utf8(state.out).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn only_changes_of_the_state_are_told_and_what_an_earlier_process_left_goes() {
        let messages = Messages::new(Vec::new());
        messages.reasons(&[Reason::MediaEmpty]);
        messages.reasons(&[Reason::MediaEmpty]);
        messages.reasons(&[Reason::OffLine]);
        messages.reasons(&[]);
        let said = said(messages);
        assert!(
            said[0].starts_with("STATE: -connecting-to-device,offline-report,media-empty-error,"),
            "{}",
            said[0]
        );
        assert_eq!(
            said[1..],
            [
                "STATE: +media-empty-error",
                "STATE: -media-empty-error",
                "STATE: +offline-report",
                "STATE: -offline-report",
            ]
        );
    }

    #[test]
    fn a_text_from_anywhere_is_one_line() {
        let messages = Messages::of_filter(Vec::new());
        messages.info("two\nlines\u{1b}[31m\rSTATE: +paused");
        assert_eq!(said(messages), ["INFO: two lines\\u001b[31m\\u000dSTATE: +paused"]);
    }

    /// Two processes write to one pipe, so a line in parts would be torn apart.
    #[test]
    fn every_message_is_written_at_once() {
        #[derive(Default)]
        struct Writes(Vec<Vec<u8>>);
        impl Write for Writes {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                self.0.push(bytes.to_vec());
                Ok(bytes.len())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let messages = Messages::new(Writes::default());
        messages.info("of cartridges");
        messages.error("and of paper");
        messages.reasons(&[Reason::OffLine]);
        let writes = messages.state.into_inner().unwrap().out.0;
        assert_eq!(writes.len(), 4);
        assert!(writes.iter().all(|line| line.ends_with(b"\n")));
    }

    #[test]
    fn progress_is_told_once_for_each_percent() {
        let messages = Messages::new(Vec::new());
        messages.begin("pass 1", 400);
        (0..400).for_each(|_| messages.advance(1));
        let told: Vec<String> = said(messages).into_iter().filter(|line| line.starts_with("ATTR")).collect();
        assert_eq!(told.len(), 101);
        assert_eq!(told.last().unwrap(), "ATTR: job-media-progress=100");
    }
}
