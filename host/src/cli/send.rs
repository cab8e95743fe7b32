//! `foilpress send`, and what `print`, `resume` and `cancel` share with it: a job on its way to a printer.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use indicatif::HumanBytes;
use protocol::ink::Ink;
use protocol::link::message::JobKind;

use super::output::{self, Staged};
use crate::observe::Observer;
use crate::send::finish::{self, Sheet, await_sheet};
use crate::send::journal::{Journal, NewJob, OpenJob, PassPlace};
use crate::send::session::{Outcome, Session};
use crate::send::{self, Address, Checked, Destination, Event, streams, words};

/// Arguments of `send`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress send job.rgl --to usb:                     (the only bridge on USB)\n  \
    foilpress send job.rgl --to serial:/dev/ttyACM0      (a bridge; `foilpress bridge list` finds it)\n  \
    foilpress send job.rgl --to raw:/dev/usb/lp0         (a printer at a USB-to-parallel cable)\n\n\
    With a bridge the job is kept on disk until it is printed: after a pulled cable it goes on by itself, after anything \
    worse with `foilpress resume`. A raw device cannot tell what it printed, so there is nothing to resume there.")]
pub struct Args {
    /// One whole job in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Where to: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    #[arg(long, value_name = "WHERE")]
    to: Destination,
    /// Send also to a printer that says it is no ALPS
    #[arg(long)]
    force: bool,
}

/// Runs `send`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let job = super::read_job(&args.job)?;
    let name = args.job.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    deliver(&name, &job, &args.to, args.force, observer)
}

/// Checks a job and takes it to its destination; with `force` also to a printer that is no ALPS.
pub fn deliver(name: &str, job: &[u8], to: &Destination, force: bool, observer: &dyn Observer) -> Result<()> {
    let checked = send::check(job, observer)?;
    match to {
        Destination::File(path) => {
            let staged = Staged::file(path)?;
            std::fs::write(staged.path(), job).with_context(|| format!("cannot write {}", path.display()))?;
            staged.commit()
        }
        Destination::Raw(path) => to_device(name, job, &checked, path, observer),
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
            let queued = journal.queue(NewJob {
                name,
                to: address.to_string(),
                kind,
                data,
                port_bytes: job.len() as u64,
                passes: checked.passes,
            })?;
            observer.note(&load(&checked.inks));
            observer.note(&format!(
                "{name} is queued as job {:08x}, {}; nothing is printed yet",
                queued.entry.record.job,
                how_large(kind, data.len(), job.len())
            ));
            go(queued, &journal, address, false, observer)
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

fn to_device(name: &str, job: &[u8], checked: &Checked, path: &Path, observer: &dyn Observer) -> Result<()> {
    observer.note(&load(&checked.inks));
    output::say_on_interrupt(
        "the printer may have a part of the job. Switch it off and on before the next one",
    );
    send::raw::send(job, path, observer)?;
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
    if cancel {
        session.cancel();
        // Whatever happens now: the next process that opens the job cancels it too.
        job.save(session.record())?;
    }
    let mut reporter = Reporter::new(&job, observer);
    let outcome = match session.outcome() {
        Some(outcome) => outcome,
        None => {
            send::run(&mut session, &mut || address.open(), &mut |record| job.save(record), &mut |event| {
                reporter.tell(&event)
            })
            .with_context(|| {
                format!(
                    "job {number:08x} ({}) is kept; `foilpress resume {number:08x}` goes on with it",
                    job.entry.name
                )
            })?
        }
    };
    observer.end();
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
    observer.note(&format!(
        "this bridge does not take the page as pass streams; the same job goes byte for byte, as job {:08x}",
        queued.entry.record.job
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
                let ink = words::pass_at(&self.passes, self.printed).map(|(_, ink)| ink);
                self.observer.note(&words::fault(*fault, ink));
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
