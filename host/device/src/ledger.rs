//! How much ribbon each cartridge has used, failed jobs counted too.
//!
//! Problem: ribbons are no longer made and do not tell how much is left on them.
//! Method: files that only grow, a line of JSON for each thing that happens: a job is sent, its end is known, a new
//! cartridge is put in, its price is noted. A line is written at once and made durable; half a line, after a crash, is skipped. Totals are
//! computed from the lines whenever they are asked for. How much ribbon a cartridge gives is what its owner says, or else what
//! the earlier ones gave between two new cartridges of their ink.
//! A cartridge belongs to a printer, not to whoever prints, so the ledger is that of the computer, beside
//! [what is known of its printers](crate::printers). Each user appends to a file of their own, which nobody else can change;
//! totals are taken from all of them. The lines name no document: everyone can read them.
//! Limits: what a pass takes is an estimate ([`press::job::ribbon`]); a pass that was begun counts by the bytes of it
//! that were printed. Only what this program sends is seen. Two printers of one computer share the ledger.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::printers::Printers;
use files::durable;
use press::job::cost::{Cost, Price};
use protocol::ink::Ink;
use serde::{Deserialize, Serialize};

/// Names of the files: this, the user, and `.jsonl`.
const PREFIX: &str = "ribbon-";
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
    /// A cartridge of an ink costs so much, from now on.
    Price {
        /// Name of the ink.
        ink: String,
        /// How much.
        amount: f64,
        /// Of what, as the owner writes it.
        currency: String,
        /// How much ribbon a cartridge gives in millimetres, if the owner knows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ribbon_mm: Option<f64>,
    },
    /// A job is about to be sent.
    Job {
        /// Its number, or any text no other job has.
        job: String,
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
    /// What a cartridge costs, if that is noted.
    pub price: Option<Price>,
    /// What the ribbon that has gone costs, an estimate, if it is also known how much a cartridge gives.
    pub cost: Option<Cost>,
}

/// Why the ledger cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("the ribbon ledger {} cannot be {what}", path.display())]
pub struct LedgerError {
    what: &'static str,
    path: PathBuf,
    #[source]
    source: io::Error,
}

/// The ledger of a computer.
#[derive(Clone, Debug)]
pub struct Ledger {
    folder: PathBuf,
    /// This user's file.
    path: PathBuf,
    /// Another folder whose lines count: the one that was this computer's before.
    other: Option<PathBuf>,
}

impl Ledger {
    /// The ledger in this folder.
    pub fn in_folder(folder: &Path) -> Ledger {
        let path = folder.join(format!("{PREFIX}{}.jsonl", user()));
        Ledger { folder: folder.to_path_buf(), path, other: None }
    }

    /// The ledger beside what is known of printers. What this user printed before there was a folder that all users share, and
    /// what others print where it cannot be written, counts as well.
    pub fn of(printers: &Printers) -> Ledger {
        Ledger { other: printers.other().map(Path::to_path_buf), ..Ledger::in_folder(printers.folder()) }
    }

    /// This user's file.
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
        let mut file = self.open()?;
        // Two programs may be at it; the lock goes with the file.
        file.lock()?;
        let mut text = serde_json::to_vec(line)?;
        text.push(b'\n');
        let is_new = file.seek(SeekFrom::End(0))? == 0;
        if !is_new {
            file.seek(SeekFrom::End(-1))?;
            let mut last = [0];
            file.read_exact(&mut last)?;
            // Half a line of a crash is not to swallow this one.
            if last != *b"\n" {
                text.insert(0, b'\n');
            }
        }
        file.write_all(&text)?;
        file.sync_all()?;
        if is_new { durable::sync_folder(&self.folder) } else { Ok(()) }
    }

    /// Opens this user's file, which is made if need be. In a folder that everyone may write to, somebody else may have put a
    /// link or a file of theirs in its place: neither is written to.
    fn open(&self) -> io::Result<File> {
        let mut options = OpenOptions::new();
        options.read(true).append(true).create(true);
        #[cfg(unix)]
        {
            use rustix::fs::OFlags;
            use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _};
            let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
            let file = options.mode(0o644).custom_flags(flags.bits().cast_signed()).open(&self.path)?;
            let found = file.metadata()?;
            if !found.is_file() || found.uid() != rustix::process::geteuid().as_raw() {
                return Err(io::Error::new(io::ErrorKind::PermissionDenied, "it is another user's"));
            }
            if found.len() == 0 {
                // Readable for everyone, whatever this user's mask is.
                file.set_permissions(fs::Permissions::from_mode(0o644))?;
            }
            Ok(file)
        }
        #[cfg(not(unix))]
        options.open(&self.path)
    }

    /// All lines of all users that can be read, oldest first, and how many cannot be read.
    pub fn lines(&self) -> Result<(Vec<Line>, usize), LedgerError> {
        let mut paths: Vec<PathBuf> = Vec::new();
        // What was counted in the folder before came first, also within a second.
        for folder in self.other.iter().chain([&self.folder]) {
            let listing = match fs::read_dir(folder) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                listing => listing.map_err(self.error("read"))?,
            };
            let mut its: Vec<PathBuf> = listing
                .filter_map(|item| Some(item.ok()?.path()))
                .filter(|path| {
                    let name = path.file_name().and_then(|name| name.to_str());
                    name.is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(".jsonl"))
                        && path.symlink_metadata().is_ok_and(|found| found.is_file())
                })
                .collect();
            its.sort();
            paths.append(&mut its);
        }
        let (mut lines, mut damaged) = (Vec::new(), 0);
        for path in paths {
            let (mut its, torn) = self.lines_of(&path)?;
            lines.append(&mut its);
            damaged += torn;
        }
        // Stable: what one user did within a second stays in order.
        lines.sort_by_key(|line: &Line| line.at);
        Ok((lines, damaged))
    }

    fn lines_of(&self, path: &Path) -> Result<(Vec<Line>, usize), LedgerError> {
        let file = File::open(path).map_err(self.error("read"))?;
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

/// Who prints, as a part of a file's name.
fn user() -> String {
    #[cfg(unix)]
    return rustix::process::geteuid().as_raw().to_string();
    #[cfg(not(unix))]
    std::env::var("USERNAME")
        .unwrap_or_default()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
        .take(40)
        .collect()
}

/// What has gone of each ink, and what that costs. `known` says how many bytes were printed of a job whose end never came to
/// the ledger.
pub fn totals(lines: &[Line], known: impl Fn(&str) -> Option<u64>) -> Vec<Total> {
    let mut totals = counted(lines, known);
    totals.retain(|total| total.passes > 0 || total.since.is_some() || total.price.is_some());
    totals
}

/// The prices that are noted, with the ribbon that a cartridge gives as far as that is known. `known` as for [`totals`].
pub fn prices(lines: &[Line], known: impl Fn(&str) -> Option<u64>) -> Vec<Price> {
    counted(lines, known).into_iter().filter_map(|total| total.price).collect()
}

/// The totals of every ink.
fn counted(lines: &[Line], known: impl Fn(&str) -> Option<u64>) -> Vec<Total> {
    let ended = |wanted: &str| {
        let ends = lines.iter().filter_map(|line| match &line.event {
            Event::Printed { job, bytes, whole } if job == wanted => Some((*bytes, *whole)),
            _ => None,
        });
        // A job that goes on after an interruption has several ends; the last knows most.
        ends.reduce(|a, b| (a.0.max(b.0), a.1 || b.1))
    };
    let fresh = |ink: String| Total {
        ink,
        since: None,
        ribbon_mm: 0.0,
        passes: 0,
        failed: 0,
        price: None,
        cost: None,
    };
    let mut totals: Vec<Total> = Ink::ALL.iter().map(|ink| fresh(ink.name().into())).collect();
    // The ribbon of each cartridge that was followed by a new one.
    let mut gave: Vec<(String, f64)> = Vec::new();
    for line in lines {
        match &line.event {
            Event::New { ink } => {
                if let Some(total) = totals.iter_mut().find(|total| total.ink == *ink) {
                    // Only a cartridge that was noted when it was new has been counted from its beginning.
                    if total.since.is_some() && total.ribbon_mm > 0.0 {
                        gave.push((ink.clone(), total.ribbon_mm));
                    }
                    let price = total.price.take();
                    *total = Total { since: Some(line.at), price, ..fresh(ink.clone()) };
                }
            }
            Event::Price { ink, amount, currency, ribbon_mm } => {
                if let Some(total) = totals.iter_mut().find(|total| total.ink == *ink) {
                    let cartridge = Cost { amount: *amount, currency: currency.clone() };
                    let ribbon_mm = ribbon_mm.filter(|mm| mm.is_finite() && *mm > 0.0);
                    let price = Price { ink: ink.clone(), cartridge, ribbon_mm };
                    total.price = Some(price).filter(|price| price.cartridge.amount.is_finite());
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
    for total in &mut totals {
        let Some(price) = &mut total.price else { continue };
        if price.ribbon_mm.is_none() {
            let its: Vec<f64> = gave.iter().filter(|(ink, _)| *ink == total.ink).map(|(_, mm)| *mm).collect();
            price.ribbon_mm = (!its.is_empty()).then(|| its.iter().sum::<f64>() / its.len() as f64);
        }
        total.cost = price.of(total.ribbon_mm);
    }
    totals
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(ink: Ink, begin: u64, end: u64, ribbon_mm: f64) -> PassUse {
        PassUse { ink: ink.name().into(), begin, end, ribbon_mm }
    }

    fn job(number: &str, passes: Vec<PassUse>) -> Event {
        Event::Job { job: number.into(), passes }
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
    fn what_was_counted_in_the_folder_before_still_counts() {
        let (before, now) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let old = Ledger::in_folder(before.path());
        old.append(Event::Price {
            ink: "white".into(),
            amount: 12.0,
            currency: "EUR".into(),
            ribbon_mm: Some(2e4),
        })
        .unwrap();
        old.append(job("a", vec![pass(Ink::White, 0, 9, 10.0)])).unwrap();
        old.append(printed("a", 9, true)).unwrap();
        let ledger = Ledger { other: Some(before.path().into()), ..Ledger::in_folder(now.path()) };
        ledger.append(job("b", vec![pass(Ink::White, 0, 9, 20.0)])).unwrap();
        ledger.append(printed("b", 9, true)).unwrap();
        assert_eq!(of(&ledger, Ink::White), Some((30.0, 2, 0)));
        assert_eq!(prices(&ledger.lines().unwrap().0, |_| None).len(), 1);
        assert_eq!(of(&Ledger::in_folder(now.path()), Ink::White), Some((20.0, 1, 0)));
        // A new cartridge is written where the computer's ledger is now, and counts for both.
        ledger.append(Event::New { ink: "white".into() }).unwrap();
        assert_eq!(of(&ledger, Ink::White).map(|(mm, ..)| mm), Some(0.0));
        let gone = Ledger { other: Some(before.path().join("none")), ..ledger };
        assert_eq!(gone.lines().unwrap().0.len(), 3);
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
    fn ribbon_costs_its_share_of_the_cartridge_as_long_as_that_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::in_folder(folder.path());
        let total = || totals(&ledger.lines().unwrap().0, |_| None).remove(0);
        let price = |amount, ribbon_mm| Event::Price {
            ink: "white".into(),
            amount,
            currency: "EUR".into(),
            ribbon_mm,
        };
        let print = |number: &str, mm: f64| {
            ledger.append(job(number, vec![pass(Ink::White, 0, 10, mm)])).unwrap();
            ledger.append(printed(number, 10, true)).unwrap();
        };
        ledger.append(price(12.0, None)).unwrap();
        print("a", 400.0);
        let white = total();
        assert_eq!((white.ribbon_mm, white.cost), (400.0, None));
        assert_eq!(white.price.unwrap().cartridge.amount, 12.0);
        // Its first cartridge was not counted from the beginning; the second gave 6 m.
        ledger.append(Event::New { ink: "white".into() }).unwrap();
        print("b", 6000.0);
        assert_eq!(total().cost, None);
        ledger.append(Event::New { ink: "white".into() }).unwrap();
        print("c", 1500.0);
        assert_eq!(total().cost, Some(Cost { amount: 3.0, currency: "EUR".into() }));
        // The owner knows better, and the price changes.
        ledger.append(price(20.0, Some(10_000.0))).unwrap();
        assert_eq!(total().cost, Some(Cost { amount: 3.0, currency: "EUR".into() }));
        let [known] = &prices(&ledger.lines().unwrap().0, |_| None)[..] else { panic!("one price") };
        assert_eq!((known.cartridge.amount, known.ribbon_mm), (20.0, Some(10_000.0)));
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
    #[cfg(unix)]
    fn every_users_jobs_count_and_nothing_is_written_through_a_link_of_somebody_else() {
        let folder = tempfile::tempdir().unwrap();
        let ledger = Ledger::in_folder(folder.path());
        let lines = |event: Event| format!("{}\n", serde_json::to_string(&Line { at: 1, event }).unwrap());
        let other = lines(job("a", vec![pass(Ink::White, 0, 10, 10.0)])) + &lines(printed("a", 10, true));
        fs::write(folder.path().join("ribbon-someone.jsonl"), other).unwrap();
        ledger.append(job("b", vec![pass(Ink::White, 0, 10, 5.0)])).unwrap();
        ledger.append(printed("b", 10, true)).unwrap();
        assert_eq!(of(&ledger, Ink::White), Some((15.0, 2, 0)));
        fs::remove_file(ledger.path()).unwrap();
        let precious = folder.path().join("precious");
        fs::write(&precious, "").unwrap();
        std::os::unix::fs::symlink(&precious, ledger.path()).unwrap();
        assert!(ledger.append(printed("b", 10, true)).is_err());
        assert_eq!(fs::read(&precious).unwrap(), b"");
        assert_eq!(of(&ledger, Ink::White), Some((10.0, 1, 0)), "nor is a link read");
    }

    #[test]
    fn a_job_that_was_killed_counts_as_far_as_the_journal_knows() {
        let lines = [Line { at: 1, event: job("5f", vec![pass(Ink::White, 0, 100, 10.0)]) }];
        assert_eq!(totals(&lines, |number| (number == "5f").then_some(50))[0].ribbon_mm, 5.0);
        assert!(totals(&lines, |_| None).is_empty());
    }
}
