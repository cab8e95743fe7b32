//! `foilpress send`, and what `print`, `resume` and `cancel` share with it: a job on its way to a printer.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use protocol::ink::Ink;
use protocol::link::message::JobKind;

use super::output::{self, Staged};
use crate::observe::Observer;
use crate::send::journal::{Journal, NewJob, OpenJob, PassPlace};
use crate::send::session::{Outcome, Session};
use crate::send::{self, Address, Checked, Destination, Event, words};

/// Arguments of `send`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress send job.rgl --to serial:/dev/ttyACM0      (a bridge; `foilpress bridge list` finds it)\n  \
    foilpress send job.rgl --to raw:/dev/usb/lp0         (a printer at a USB-to-parallel cable)\n\n\
    With a bridge the job is kept on disk until it is printed: after a pulled cable it goes on by itself, after anything \
    worse with `foilpress resume`. A raw device cannot tell what it printed, so there is nothing to resume there.")]
pub struct Args {
    /// One whole job in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Where to: serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    #[arg(long, value_name = "WHERE")]
    to: Destination,
}

/// Runs `send`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let job = super::read_job(&args.job)?;
    let name = args.job.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    deliver(&name, &job, &args.to, observer)
}

/// Checks a job and takes it to its destination.
pub fn deliver(name: &str, job: &[u8], to: &Destination, observer: &dyn Observer) -> Result<()> {
    let checked = send::check(job, observer)?;
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
        Destination::Raw(path) => to_device(name, job, &checked, path, observer),
        Destination::Bridge(address) => {
            let journal = Journal::of_user()?;
            journal.tidy()?;
            let queued = journal.queue(NewJob {
                name,
                to: address.to_string(),
                kind: JobKind::Raw,
                data: job,
                port_bytes: job.len() as u64,
                passes: checked.passes,
            })?;
            observer.note(&load(&checked.inks));
            observer.note(&format!(
                "{name} is queued as job {:08x}; nothing is printed yet",
                queued.entry.record.job
            ));
            go(queued, address, false, observer)
        }
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

/// Sends a job from the journal, or with `cancel` brings it to its end, until the bridge says how it ended.
pub fn go(mut job: OpenJob, address: &Address, cancel: bool, observer: &dyn Observer) -> Result<()> {
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
    let text = words::outcome(outcome, &job.entry, session.progress());
    match outcome {
        Outcome::Printed if cancel => bail!("{text}; it was too late to cancel"),
        Outcome::Cancelled if !cancel => bail!("{text}"),
        Outcome::Printed | Outcome::Cancelled => observer.note(&text),
        Outcome::Broken | Outcome::Lost | Outcome::Forgotten => bail!("{text}"),
    }
    Ok(())
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
