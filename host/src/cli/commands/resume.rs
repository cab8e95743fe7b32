//! `foilpress resume` and `foilpress cancel`: jobs that have not ended.

use std::io::Write as _;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use crate::cli::commands::bridge;
use crate::cli::console::terminal::agreed;
use crate::cli::console::{show, stdout};
use crate::cli::printing::deliver::{are_copies, go_on};
use device::connection::Address;
use device::questions::query::Query;
use device::transit::journal::{Entry, Journal, JournalError};
use device::transit::session::Phase;
use device::transit::words;
use observe::Observer;
use serde_json::json;

/// Arguments of `resume`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress resume                                     (the only unfinished job)\n  \
    foilpress resume 5f3a9c01 --to serial:/dev/ttyACM1   (the port has a new name)\n  \
    foilpress resume --list")]
pub struct Resume {
    /// Number of the job [default: the only unfinished job]
    #[arg(value_parser = number)]
    job: Option<u32>,
    /// Current address of the bridge [default: the address the job was sent to]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// List the jobs and their states without resuming any
    #[arg(long, conflicts_with_all = ["job", "to"])]
    list: bool,
    /// Print the list as JSON
    #[arg(long, requires = "list")]
    json: bool,
}

/// Arguments of `cancel`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress cancel                                     (the only unfinished job)\n  \
    foilpress cancel 5f3a9c01\n  \
    foilpress cancel ffffffff                            (whatever the system is printing through the bridge by itself)\n  \
    foilpress cancel --to usb: --yes                     (whatever the bridge is printing, whoever has sent it)\n\n\
    A job that is not this user's is ended after a question, if --to names the bridge that prints it. A sheet that has begun comes out unfinished, and the printer is ready for the next job. Stop a `send` that is \
    still running first (Ctrl-C).")]
pub struct Cancel {
    /// Number of the job [default: the only unfinished job]
    #[arg(value_parser = number)]
    job: Option<u32>,
    /// Current address of the bridge [default: the address the job was sent to]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// End the job of another user or computer without asking
    #[arg(short, long)]
    yes: bool,
}

/// What there is to say where no job ever was.
const NONE_YET: &str = "no job has been sent to a bridge yet";

/// A job's number as people read it.
fn number_of(job: u32) -> String {
    format!("{job:08x}")
}

fn number(text: &str) -> Result<u32, String> {
    u32::from_str_radix(text, 16).map_err(|_| {
        "expected a job number of eight digits 0-9 and a-f; `foilpress resume --list` shows them".into()
    })
}

/// Runs `resume`.
pub fn resume(args: &Resume, observer: &dyn Observer) -> Result<()> {
    let journal = Journal::of_user()?;
    if args.list {
        let (entries, damaged) = (journal.entries()?, journal.damaged()?);
        if args.json {
            let mut list: Vec<_> = entries.iter().map(as_json).collect();
            list.extend(
                damaged
                    .iter()
                    .map(|(job, error)| json!({ "job": number_of(*job), "error": error.to_string() })),
            );
            return show(&format!("{}\n", serde_json::to_string_pretty(&list)?));
        }
        if entries.is_empty() && damaged.is_empty() {
            observer.note(NONE_YET);
        }
        damaged.iter().for_each(|(job, error)| observer.note(&format!("job {}: {error}", number_of(*job))));
        let mut out = stdout();
        for entry in entries {
            writeln!(out, "{}", line(&entry))?;
        }
        return Ok(());
    }
    let job = journal.open(choose(&journal, args.job)?)?;
    let address = address(&job.entry, args.to.as_ref())?;
    let cancel = job.entry.record.cancel;
    go_on(&journal, job, &address, cancel, observer)
}

/// Runs `cancel`.
pub fn cancel(args: &Cancel, observer: &dyn Observer) -> Result<()> {
    if args.job == Some(PLAIN) {
        return cancel_plain(args.to.as_ref());
    }
    let journal = Journal::of_user()?;
    let own = match (args.job, &args.to) {
        (Some(number), _) => journal.open(number).map_err(anyhow::Error::from),
        (None, None) => choose(&journal, None).and_then(|number| Ok(journal.open(number)?)),
        // The bridge says which one is open there.
        (None, Some(to)) => open_at(to)?.map_or_else(
            || choose(&journal, None).and_then(|number| Ok(journal.open(number)?)),
            |number| Ok(journal.open(number)?),
        ),
    };
    match (own, &args.to) {
        (Ok(job), _) => {
            let address = address(&job.entry, args.to.as_ref())?;
            go_on(&journal, job, &address, true, observer)
        }
        (Err(error), Some(to)) if is_unknown(&error) => cancel_anothers(to, args.job, args.yes),
        (Err(error), _) => Err(error),
    }
}

/// Whether this user's journal has no such job, or none that is not over.
fn is_unknown(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(JournalError::NoSuchJob(_) | JournalError::Ended(_)))
}

/// The job that is open at a bridge.
fn open_at(to: &Address) -> Result<Option<u32>> {
    let mut link = to.open()?;
    let query = Query::new(&mut *link, bridge::PATIENCE)?;
    Ok(Some(query.progress()).filter(|progress| progress.is_open()).map(|progress| progress.job))
}

/// Ends what is open at a bridge and is not in this user's journal, after a question.
fn cancel_anothers(to: &Address, job: Option<u32>, yes: bool) -> Result<()> {
    let mut link = to.open()?;
    let mut query = Query::new(&mut *link, bridge::PATIENCE)?;
    let open = *query.progress();
    if !open.is_open() || job.is_some_and(|job| job != open.job) {
        bail!("the bridge does not have this job open; {}", bridge::doing(&open));
    }
    let job = open.job;
    let what = format!(
        "{}, and it is not in this user's journal: another user or computer may be sending it",
        bridge::doing(&open)
    );
    if !yes && !agreed(&format!("{what}. End it early?")) {
        bail!("{what}, so it was not cancelled; pass --yes to end it");
    }
    // After a restart only the job's data tell where it may end, and its sender has them.
    if open.limit == 0 {
        bail!(
            "the bridge has restarted in the middle of job {job:08x}, and only its sender can end it properly; `foilpress bridge \
             reset --to {to}` gives it up"
        );
    }
    let mut progress = query.cancel(job, bridge::PATIENCE)?;
    let start = Instant::now();
    while progress.is_open() && progress.job == job && start.elapsed() < ENDING {
        sleep(Duration::from_millis(200));
        progress = query.ask_progress(bridge::PATIENCE)?;
    }
    show(&format!("{}\n", bridge::doing(&progress)))?;
    if progress.is_open() && progress.job == job {
        bail!(
            "job {job:08x} ends as soon as the printer takes bytes again; if it does not, `foilpress bridge reset --to {to}` gives it up"
        );
    }
    Ok(())
}

/// How long to wait for the end of a job that was cancelled.
const ENDING: Duration = Duration::from_secs(10);

/// Number of whatever the operating system prints through the bridge as through an ordinary printer.
const PLAIN: u32 = u32::MAX;

/// Ends what the operating system prints; no journal knows of it.
fn cancel_plain(to: Option<&Address>) -> Result<()> {
    let address = bridge::named_or_only(to)?;
    let mut link = address.open()?;
    let progress = Query::new(&mut *link, bridge::PATIENCE)?.cancel(PLAIN, bridge::PATIENCE)?;
    let mut out = stdout();
    writeln!(out, "{}", bridge::doing(&progress))?;
    Ok(())
}

fn address(entry: &Entry, asked: Option<&Address>) -> Result<Address> {
    match asked {
        Some(address) => Ok(address.clone()),
        None => entry.to.parse().with_context(|| "the journal names no bridge; name it with --to"),
    }
}

/// The job meant.
fn choose(journal: &Journal, asked: Option<u32>) -> Result<u32> {
    if let Some(number) = asked {
        return Ok(number);
    }
    let all = journal.entries()?;
    let open: Vec<&Entry> =
        all.iter().filter(|entry| !matches!(entry.record.phase, Phase::Ended(_))).collect();
    match &open[..] {
        [] => {
            if let Some((job, error)) = journal.damaged()?.into_iter().next() {
                return Err(
                    anyhow::Error::from(error).context(format!("job {} cannot be read", number_of(job)))
                );
            }
            bail!(
                "{}",
                if all.is_empty() {
                    NONE_YET
                } else {
                    "no job waits; all have ended (`foilpress resume --list`)"
                }
            )
        }
        [one] => Ok(one.record.job),
        // Sheets of one job wait for each other; any of them is the next.
        several if are_copies(&several.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>()) => {
            let next = several.iter().min_by_key(|entry| (entry.name.len(), &entry.name));
            next.map(|entry| entry.record.job).context("several jobs are none")
        }
        several => {
            let lines: Vec<String> = several.iter().map(|entry| line(entry)).collect();
            bail!("several jobs have not ended; choose one:\n{}", lines.join("\n"))
        }
    }
}

/// A job for programs to read.
pub fn as_json(entry: &Entry) -> serde_json::Value {
    serde_json::json!({
        "job": format!("{:08x}", entry.record.job),
        "name": entry.name,
        "to": entry.to,
        "queued_at": entry.queued,
        "bytes": entry.port_bytes,
        "bytes_printed": entry.record.printed,
        "ended": matches!(entry.record.phase, Phase::Ended(_)),
        "state": words::phase(entry),
    })
}

/// A job in a line.
pub fn line(entry: &Entry) -> String {
    format!("{:08x}  {}  {}: {}", entry.record.job, entry.to, entry.name, words::phase(entry))
}
