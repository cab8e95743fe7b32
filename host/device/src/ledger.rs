//! How much ribbon has gone, cartridge by cartridge, failed jobs counted too.
//!
//! Problem: ribbons are no longer made and say nothing of what is left on them.
//! Method: a file that only grows, a line of JSON for each thing that happens: a job is sent, its end is known, a new
//! cartridge is put in. A line is written at once and made durable; half a line, after a crash, is passed over. Totals are
//! taken from the lines whenever they are asked for.
//! Limits: what a pass takes is an estimate ([`press::job::ribbon`]); a pass that was begun counts by the bytes of it
//! that were printed. Only what this program sends is seen.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use protocol::ink::Ink;
use serde::{Deserialize, Serialize};

/// Name of the file.
const FILE: &str = "ledger.jsonl";
/// More than a lifetime of jobs.
const LARGEST: u64 = 64 << 20;

/// A line.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Line {
    /// When, in seconds since 1970.
    pub at: u64,
    /// What.
    pub event: Event,
}

/// What happens to ribbons.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
// Not tagged inside, for then numbers would depend on how another library of the program has them parsed.
#[serde(rename_all = "lowercase")]
pub enum Event {
    /// A fresh cartridge is put in.
    New {
        /// Name of its ink.
        ink: String,
    },
    /// A job is about to be sent.
    Job {
        /// Its number, or any text no other job has.
        job: String,
        /// What people call it.
        name: String,
        /// Its passes.
        passes: Vec<PassUse>,
    },
    /// So much of a job is printed.
    Printed {
        /// The job.
        job: String,
        /// Bytes that have crossed the printer's port.
        bytes: u64,
        /// Whether it was printed to its end.
        whole: bool,
    },
}

/// What a pass takes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct PassUse {
    /// Name of its ink.
    pub ink: String,
    /// Offset of its first byte.
    pub begin: u64,
    /// One past its last byte.
    pub end: u64,
    /// Ribbon for all of it in millimetres, an estimate.
    pub ribbon_mm: f64,
}

/// What has gone of one ink since its cartridge was new.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Total {
    /// Name of the ink.
    pub ink: String,
    /// When the cartridge was noted as new, in seconds since 1970; absent if never.
    pub since: Option<u64>,
    /// Ribbon in millimetres, an estimate.
    pub ribbon_mm: f64,
    /// Passes begun.
    pub passes: u32,
    /// Of these, in jobs that were not printed to their end.
    pub failed: u32,
}

/// Why the ledger cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("the ledger of ribbons, {}: cannot be {what}", path.display())]
pub struct LedgerError {
    what: &'static str,
    path: PathBuf,
    #[source]
    source: io::Error,
}

/// The file.
#[derive(Clone, Debug)]
pub struct Ledger {
    path: PathBuf,
}

impl Ledger {
    /// The ledger in this folder.
    pub fn in_folder(folder: &Path) -> Ledger {
        Ledger { path: folder.join(FILE) }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn error(&self, what: &'static str) -> impl FnOnce(io::Error) -> LedgerError {
        let path = self.path.clone();
        move |source| LedgerError { what, path, source }
    }

    /// Adds a line. When this returns it is on disk.
    pub fn append(&self, event: Event) -> Result<(), LedgerError> {
        let at = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        self.write(&Line { at, event }).map_err(self.error("written"))
    }

    fn write(&self, line: &Line) -> io::Result<()> {
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&self.path)?;
        // Two programs may be at it; the lock goes with the file.
        file.lock()?;
        let mut text = serde_json::to_vec(line)?;
        text.push(b'\n');
        if file.seek(SeekFrom::End(0))? > 0 {
            file.seek(SeekFrom::End(-1))?;
            let mut last = [0];
            file.read_exact(&mut last)?;
            // Half a line of a crash is not to swallow this one.
            if last != *b"\n" {
                text.insert(0, b'\n');
            }
        }
        file.write_all(&text)?;
        file.sync_all()
    }

    /// All lines that can be read, and how many cannot.
    pub fn lines(&self) -> Result<(Vec<Line>, usize), LedgerError> {
        let file = match File::open(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok((Vec::new(), 0)),
            file => file.map_err(self.error("read"))?,
        };
        let (mut lines, mut damaged) = (Vec::new(), 0);
        for text in BufReader::new(file.take(LARGEST)).split(b'\n') {
            let text = text.map_err(self.error("read"))?;
            if text.is_empty() {
                continue;
            }
            match serde_json::from_slice(&text) {
                Ok(line) => lines.push(line),
                Err(_) => damaged += 1,
            }
        }
        Ok((lines, damaged))
    }
}

/// What has gone of each ink. `known` says how many bytes were printed of a job whose end never came to the ledger.
pub fn totals(lines: &[Line], known: impl Fn(&str) -> Option<u64>) -> Vec<Total> {
    let ended = |wanted: &str| {
        let ends = lines.iter().filter_map(|line| match &line.event {
            Event::Printed { job, bytes, whole } if job == wanted => Some((*bytes, *whole)),
            _ => None,
        });
        // A job that goes on after an interruption has several ends; the last knows most.
        ends.reduce(|a, b| (a.0.max(b.0), a.1 || b.1))
    };
    let mut totals: Vec<Total> = Ink::ALL
        .iter()
        .map(|ink| Total { ink: ink.name().into(), since: None, ribbon_mm: 0.0, passes: 0, failed: 0 })
        .collect();
    for line in lines {
        match &line.event {
            Event::New { ink } => {
                if let Some(total) = totals.iter_mut().find(|total| total.ink == *ink) {
                    let ink = std::mem::take(&mut total.ink);
                    *total = Total { ink, since: Some(line.at), ribbon_mm: 0.0, passes: 0, failed: 0 };
                }
            }
            Event::Job { job, passes, .. } => {
                let (bytes, whole) = ended(job).unwrap_or_else(|| (known(job).unwrap_or(0), false));
                for pass in passes {
                    let Some(total) = totals.iter_mut().find(|total| total.ink == pass.ink) else { continue };
                    if bytes <= pass.begin && !whole {
                        continue;
                    }
                    let length = pass.end.saturating_sub(pass.begin).max(1);
                    let done = bytes.saturating_sub(pass.begin).min(length) as f64 / length as f64;
                    total.ribbon_mm += pass.ribbon_mm.max(0.0) * if whole { 1.0 } else { done };
                    total.passes += 1;
                    total.failed += u32::from(!whole);
                }
            }
            Event::Printed { .. } => {}
        }
    }
    totals.retain(|total| total.passes > 0 || total.since.is_some());
    totals
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(ink: Ink, begin: u64, end: u64, ribbon_mm: f64) -> PassUse {
        PassUse { ink: ink.name().into(), begin, end, ribbon_mm }
    }

    fn job(number: &str, passes: Vec<PassUse>) -> Event {
        Event::Job { job: number.into(), name: "leaf".into(), passes }
    }

    fn printed(number: &str, bytes: u64, whole: bool) -> Event {
        Event::Printed { job: number.into(), bytes, whole }
    }

    fn of(ledger: &Ledger, ink: Ink) -> Option<(f64, u32, u32)> {
        let totals = totals(&ledger.lines().unwrap().0, |_| None);
        totals.iter().find(|total| total.ink == ink.name()).map(|t| (t.ribbon_mm, t.passes, t.failed))
    }

    #[test]
    fn whole_jobs_count_whole_and_failed_ones_by_what_was_printed() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::in_folder(folder.path());
        let passes = || vec![pass(Ink::White, 100, 1100, 400.0), pass(Ink::Cyan, 1100, 2100, 300.0)];
        ledger.append(job("a", passes())).unwrap();
        ledger.append(printed("a", 2200, true)).unwrap();
        ledger.append(job("b", passes())).unwrap();
        ledger.append(printed("b", 600, false)).unwrap();
        assert_eq!(of(&ledger, Ink::White), Some((600.0, 2, 1)));
        assert_eq!(of(&ledger, Ink::Cyan), Some((300.0, 1, 0)));
        assert_eq!(of(&ledger, Ink::Black), None);
        // It goes on and is printed: what was counted as lost is part of the whole.
        ledger.append(printed("b", 2200, true)).unwrap();
        assert_eq!(of(&ledger, Ink::White), Some((800.0, 2, 0)));
    }

    #[test]
    fn a_new_cartridge_begins_at_nothing_and_the_others_go_on() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::in_folder(folder.path());
        for number in ["a", "b"] {
            ledger
                .append(job(number, vec![pass(Ink::White, 0, 9, 10.0), pass(Ink::Cyan, 9, 19, 5.0)]))
                .unwrap();
            ledger.append(printed(number, 20, true)).unwrap();
            if number == "a" {
                ledger.append(Event::New { ink: "white".into() }).unwrap();
            }
        }
        assert_eq!(
            (of(&ledger, Ink::White), of(&ledger, Ink::Cyan)),
            (Some((10.0, 1, 0)), Some((10.0, 2, 0)))
        );
    }

    #[test]
    fn half_a_line_costs_no_other_line() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::in_folder(folder.path());
        let passes = vec![pass(Ink::White, 0, 10, 10.0)];
        ledger.append(job("a", passes.clone())).unwrap();
        ledger.append(printed("a", 10, true)).unwrap();
        let whole = std::fs::read(ledger.path()).unwrap();
        for cut in 1..whole.len() {
            std::fs::write(ledger.path(), &whole[..cut]).unwrap();
            ledger.append(job("b", passes.clone())).unwrap();
            ledger.append(printed("b", 10, true)).unwrap();
            let (lines, damaged) = ledger.lines().unwrap();
            let torn = !whole[..cut].ends_with(b"\n")
                && serde_json::from_slice::<Line>(
                    whole[..cut].split(|&byte| byte == b'\n').next_back().unwrap(),
                )
                .is_err();
            assert_eq!(damaged, usize::from(torn), "cut at {cut}");
            assert!(lines.ends_with(&[]) && lines.len() >= 2);
            let white = totals(&lines, |_| None).remove(0);
            assert!(white.ribbon_mm >= 10.0, "cut at {cut}: {white:?}");
        }
    }

    #[test]
    fn a_job_that_was_killed_counts_as_far_as_the_journal_knows() {
        let lines = [Line { at: 1, event: job("5f", vec![pass(Ink::White, 0, 100, 10.0)]) }];
        assert_eq!(totals(&lines, |number| (number == "5f").then_some(50))[0].ribbon_mm, 5.0);
        assert!(totals(&lines, |_| None).is_empty());
    }
}
