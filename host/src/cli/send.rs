//! `foilpress send`, and what `print`, `resume` and `cancel` share with it: a job on its way to a printer.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use indicatif::HumanBytes;
use protocol::ink::Ink;
use protocol::link::message::JobKind;

use super::deliver::{loaded, next_sheet};
use super::ledger;
use super::output::{self, Staged};
use device::send::finish::{self, Sheet, await_sheet};
use device::send::journal::{Journal, NewJob, OpenJob, PassPlace};
use device::send::raw::RawError;
use device::send::session::{Outcome, Session};
use device::send::{self, Address, Checked, Destination, Event, Wish, streams, words};
use observe::Observer;

/// Arguments of `send`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress send job.rgl --to usb:                     (the only bridge on USB)\n  \
    foilpress send job.rgl --to serial:/dev/ttyACM0      (a bridge; `foilpress bridge list` finds it)\n  \
    foilpress send job.rgl --to raw:/dev/usb/lp0         (a printer on a USB-to-parallel cable)\n\n\
    A job sent to a bridge is kept on disk until it is printed. After a pulled cable it continues by itself; after any \
    other interruption `foilpress resume` continues it. A raw device cannot report what it has printed, so a job sent to \
    one cannot be resumed.")]
pub struct Args {
    /// Complete job in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Destination: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    #[arg(long, value_name = "WHERE")]
    to: Destination,
    /// Send even if the device does not identify itself as an ALPS printer
    #[arg(long)]
    force: bool,
    /// Number of sheets to print; the program waits for Enter between them
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=99))]
    copies: u16,
}

/// Runs `send`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let job = super::read_job(&args.job)?;
    let name = args.job.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    let checked = send::check(&job, observer)?;
    if let Destination::Bridge(address) = &args.to {
        observer.note(&loaded(address, &checked.inks));
    }
    deliver(&name, &job, &checked, &args.to, args.copies, args.force, observer)
}

/// Takes a job that was checked to its destination, once for each copy; with `force` also to a printer that is no ALPS.
pub fn deliver(
    name: &str,
    job: &[u8],
    checked: &Checked,
    to: &Destination,
    copies: u16,
    force: bool,
    observer: &dyn Observer,
) -> Result<()> {
    if let Some(driver) = checked.dialect {
        observer.note(&format!(
            "{name} is in the dialect of {driver}'s drivers, which was never tried; it is sent as it is"
        ));
    }
    match to {
        Destination::File(path) => {
            let staged = Staged::file(path)?;
            std::fs::write(staged.path(), job).with_context(|| format!("cannot write {}", path.display()))?;
            staged.commit()
        }
        Destination::Raw(path) => {
            for copy in 1..=copies {
                to_device(name, job, checked, path, observer)?;
                if copy < copies && !next_sheet(copy, copies)? {
                    let left = copies - copy;
                    bail!(
                        "{copy} of {copies} sheets are sent; send the job again with --copies {left} for the others"
                    );
                }
            }
            Ok(())
        }
        Destination::Bridge(address) => {
            super::bridge::expect_alps(address, force, observer)?;
            let journal = Journal::of_user()?;
            journal.tidy()?;
            super::bridge::before_sending(&journal, address, observer)?;
            let streams = streams::of_job(job, observer).filter(|streams| streams.len() < job.len());
            let (kind, data) = match &streams {
                Some(streams) => (JobKind::Streams, &streams[..]),
                None => (JobKind::Raw, job),
            };
            // All are on disk before the first is printed, so that an interruption between two sheets loses none.
            let mut queue = Vec::new();
            for copy in 1..=copies {
                let name = if copies == 1 { name.to_owned() } else { copy_name(name, copy, copies) };
                let queued = journal.queue(NewJob {
                    name: &name,
                    to: address.to_string(),
                    kind,
                    data,
                    port_bytes: job.len() as u64,
                    passes: checked.passes.clone(),
                })?;
                let number = format!("{:08x}", queued.entry.record.job);
                ledger::begun(&number, &name, checked, job.len() as u64, observer);
                queue.push(queued);
            }
            observer.note(&load(&checked.inks));
            for (copy, queued) in (1..).zip(queue) {
                observer.note(&format!(
                    "{} is queued as job {:08x}, {}; nothing is printed yet",
                    queued.entry.name,
                    queued.entry.record.job,
                    how_large(kind, data.len(), job.len())
                ));
                go(queued, &journal, address, false, observer)?;
                if copy < copies && !next_sheet(copy, copies)? {
                    bail!("{copy} of {copies} sheets are sent; `foilpress resume` sends the next one");
                }
            }
            Ok(())
        }
    }
}

/// What crosses the cable, against what the printer gets.
fn how_large(kind: JobKind, sent: usize, printed: usize) -> String {
    match kind {
        JobKind::Streams => format!(
            "{} as pass streams, 1/{:.1} of the {} the bridge makes of them",
            HumanBytes(sent as u64),
            printed as f64 / sent as f64,
            HumanBytes(printed as u64)
        ),
        JobKind::Raw => format!("{} as they are", HumanBytes(printed as u64)),
    }
}

/// What a copy is called.
fn copy_name(name: &str, copy: u16, copies: u16) -> String {
    format!("{name} (sheet {copy} of {copies})")
}

/// Whether these are the copies of one job that wait for each other.
pub fn are_copies(names: &[&str]) -> bool {
    let stem = |name: &str| name.rfind(" (sheet ").map(|at| name[..at].to_owned());
    names
        .first()
        .and_then(|first| stem(first))
        .is_some_and(|first| names.iter().all(|name| stem(name).as_deref() == Some(first.as_str())))
}

fn to_device(name: &str, job: &[u8], checked: &Checked, path: &Path, observer: &dyn Observer) -> Result<()> {
    observer.note(&load(&checked.inks));
    output::say_on_interrupt(
        "the printer may have a part of the job. Switch it off and on before the next one",
    );
    // A device has no numbers for jobs; the moment and the process are one.
    let moment = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let number = format!("raw-{}-{}", moment.as_nanos(), std::process::id());
    ledger::begun(&number, name, checked, job.len() as u64, observer);
    let sent = send::raw::send(job, path, observer);
    let taken = match &sent {
        Ok(()) => job.len(),
        Err(RawError::Write { taken, .. }) => *taken,
        Err(_) => 0,
    };
    ledger::printed(&number, taken as u64, sent.is_ok(), observer);
    sent?;
    observer.note(&format!(
        "{name}: the system has taken all {} bytes for the printer; whether they are printed only the printer shows",
        job.len()
    ));
    Ok(())
}

/// The cassettes to have at hand.
fn load(inks: &[Ink]) -> String {
    let list: Vec<String> = inks.iter().map(|ink| format!("{} ({})", ink.name(), ink.part())).collect();
    format!("cassettes needed, in this order: {}", list.join(", "))
}

/// Sends a job from the journal, or with `cancel` brings it to its end, until the bridge says how it ended and the
/// printer, as far as it says anything, that the sheet is out.
pub fn go(
    mut job: OpenJob,
    journal: &Journal,
    address: &Address,
    cancel: bool,
    observer: &dyn Observer,
) -> Result<()> {
    let number = job.entry.record.job;
    output::say_on_interrupt(&format!(
        "the bridge goes on printing what it holds. `foilpress resume {number:08x}` goes on, \
         `foilpress cancel {number:08x}` ends the sheet"
    ));
    let data = std::mem::take(&mut job.data);
    let mut session = Session::new(job.entry.record, &data);
    let result = converse(&mut job, &mut session, address, cancel, observer);
    let whole = matches!(result, Ok(Outcome::Printed));
    ledger::printed(&format!("{number:08x}"), session.record().printed.into(), whole, observer);
    let outcome = result?;
    let record = &job.entry.record;
    let refused = outcome == Outcome::Broken && record.kind == JobKind::Streams && record.printed == 0;
    if refused && !cancel {
        return once_more_as_it_is(&job, &data, journal, address, observer);
    }
    let text = words::outcome(outcome, &job.entry, session.progress());
    match outcome {
        Outcome::Printed if cancel => bail!("{text}; it was too late to cancel"),
        Outcome::Cancelled if !cancel => bail!("{text}"),
        Outcome::Printed => {
            observer.note(&text);
            wait_for_sheet(&job.entry.name, address, observer);
        }
        Outcome::Cancelled => observer.note(&text),
        Outcome::Broken | Outcome::Lost | Outcome::Forgotten => bail!("{text}"),
    }
    Ok(())
}

/// The conversation with the bridge until it says how the job ended.
fn converse(
    job: &mut OpenJob,
    session: &mut Session<'_>,
    address: &Address,
    cancel: bool,
    observer: &dyn Observer,
) -> Result<Outcome> {
    let number = job.entry.record.job;
    if cancel {
        session.cancel();
        // Whatever happens now: the next process that opens the job cancels it too.
        job.save(session.record())?;
    }
    let mut reporter = Reporter::new(job, observer);
    let outcome = match session.outcome() {
        Some(outcome) => outcome,
        None => {
            let mut save = |record: &_| job.save(record);
            let mut watch = |event: Event<'_>| reporter.tell(&event);
            send::run_at(session, address, &mut save, &mut watch, &mut || Wish::GoOn).with_context(|| {
                format!(
                    "job {number:08x} ({}) is kept; `foilpress resume {number:08x}` goes on with it",
                    job.entry.name
                )
            })?
        }
    };
    observer.end();
    Ok(outcome)
}

/// A bridge with too little memory for the page, or too old for its streams, has printed nothing of it: it gets what the
/// printer is to get, byte for byte.
fn once_more_as_it_is(
    job: &OpenJob,
    data: &[u8],
    journal: &Journal,
    address: &Address,
    observer: &dyn Observer,
) -> Result<()> {
    let mut bytes = Vec::new();
    streams::expand(data, &mut |piece| {
        bytes.extend_from_slice(piece);
        true
    })?;
    let queued = journal.queue(NewJob {
        name: &job.entry.name,
        to: address.to_string(),
        kind: JobKind::Raw,
        data: &bytes,
        port_bytes: bytes.len() as u64,
        passes: job.entry.passes.clone(),
    })?;
    let number = format!("{:08x}", queued.entry.record.job);
    ledger::begun(&number, &queued.entry.name, &send::check(&bytes, observer)?, bytes.len() as u64, observer);
    observer.note(&format!(
        "this bridge does not take the page as pass streams; the same job goes byte for byte, as job {number}"
    ));
    go(queued, journal, address, false, observer)
}

/// Says when the sheet is out, or why that cannot be said. Nothing that happens here changes that the job is printed.
fn wait_for_sheet(name: &str, address: &Address, observer: &dyn Observer) {
    output::say_on_interrupt("the printer has the whole job and goes on by itself");
    let mut watch = |troubles: &[String]| match troubles {
        [] => observer.note("the printer goes on"),
        troubles => observer.note(&format!("the printer waits: {}", troubles.join("; "))),
    };
    let unknown =
        |why: &str| observer.note(&format!("{name}: {why}; only the printer shows when the sheet is done"));
    match await_sheet(&mut || address.open(), finish::EVERY, &mut watch) {
        Ok(Sheet::Out) => observer.note(&format!("{name}: the printer says it is done; the sheet is out")),
        Ok(Sheet::Unknown(why)) => unknown(why),
        Err(error) => unknown(&error.to_string()),
    }
}

/// Turns what happens into progress of passes and notes.
struct Reporter<'o> {
    passes: Vec<PassPlace>,
    total: u64,
    observer: &'o dyn Observer,
    /// The pass shown, from 1, and the position shown.
    pass: usize,
    shown: u64,
    printed: u64,
    away: bool,
}

impl<'o> Reporter<'o> {
    fn new(job: &OpenJob, observer: &'o dyn Observer) -> Reporter<'o> {
        Reporter {
            passes: job.entry.passes.clone(),
            total: job.entry.port_bytes,
            observer,
            pass: 0,
            shown: 0,
            printed: u64::from(job.entry.record.printed),
            away: false,
        }
    }

    fn tell(&mut self, event: &Event<'_>) {
        match event {
            Event::Connected(bridge) => {
                if self.away {
                    self.observer.note("the bridge is back; going on where the printer is");
                } else {
                    self.observer
                        .note(&format!("bridge {:016x}, firmware {}", bridge.serial, bridge.firmware));
                }
                self.away = false;
            }
            Event::Away(why) => {
                if !std::mem::replace(&mut self.away, true) {
                    self.observer.note(&format!(
                        "the link to the bridge is gone ({why}); it prints what it holds, and the job goes on when it is \
                         back. Nothing is lost"
                    ));
                }
            }
            Event::Moved(progress) => {
                self.printed = u64::from(progress.printed);
                self.show();
            }
            Event::Fault(Some(fault)) => {
                self.observer.note(&words::fault(*fault, words::wanted(&self.passes, self.printed)));
            }
            Event::Fault(None) => self.observer.note("the printer goes on"),
        }
    }

    /// A bar for each pass, in bytes that crossed the port.
    fn show(&mut self) {
        let Some((number, ink)) = words::pass_at(&self.passes, self.printed) else { return };
        let begin = self.passes[number - 1].offset;
        if number != self.pass {
            let end = self.passes.get(number).map_or(self.total, |next| next.offset);
            self.observer.begin(
                &format!("pass {number} of {}, {}", self.passes.len(), ink.name()),
                end.saturating_sub(begin),
            );
            self.pass = number;
            self.shown = begin;
        }
        let before = std::mem::replace(&mut self.shown, self.printed);
        self.observer.advance(self.printed.saturating_sub(before));
    }
}
