//! From a job to its destination, for every command that has one: the plan's confirmation, copies, and how it ended.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::path::Path;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::Args;

use crate::cli::arguments::choice::whole;
use crate::cli::commands::bridge::shelf_text;
use crate::cli::console::terminal::{Terminal, cartridges_needed, cartridges_text, size_text};
use crate::cli::console::{show, stderr};
use crate::cli::output::{self, Staged};
use device::connection::{Address, Destination};
use device::deliver::{Cartridges, Delivery, Ended, Failure, Job, Packed, find_cartridges};
use device::encodings::{self, Content};
use device::printers::Printers;
use device::transit::finish::Sheet;
use device::transit::journal::{Journal, OpenJob};
use device::transit::session::Outcome;
use observe::Observer;
use press::pipeline;

/// Where a job goes, how often, and whether it was asked for.
#[derive(Args, Debug)]
pub struct DeliverArgs {
    /// Also send the job to: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:PATH
    ///
    /// The plan is shown first, and the job is sent after you confirm it (see --yes). A file is written without asking.
    /// Without --to nothing is sent.
    #[arg(long, value_name = "WHERE")]
    pub to: Option<Destination>,
    /// Number of sheets to print; the program waits for Enter between them
    #[arg(long, value_name = "N", default_value_t = 1, requires = "to", value_parser = whole(1..=99u16))]
    pub copies: u16,
    /// Send even if the device does not identify itself as an ALPS printer
    #[arg(long, requires = "to")]
    pub force: bool,
    /// Send without asking for confirmation
    ///
    /// Needed where there is no terminal to confirm the plan on.
    #[arg(short, long)]
    pub yes: bool,
}

impl DeliverArgs {
    /// The file the job is to be written to, if it goes to a file.
    pub fn file(&self) -> Result<Option<&Path>> {
        match &self.to {
            Some(to @ Destination::File(path)) => fits(to, self.copies).map(|()| Some(path.as_path())),
            _ => Ok(None),
        }
    }

    /// Sends a job whose plan was shown. A job for a file was written with everything else.
    pub fn send(&self, job: &pipeline::Job, observer: &dyn Observer) -> Result<()> {
        let to = match &self.to {
            None | Some(Destination::File(_)) => return Ok(()),
            Some(to) => to,
        };
        let name = &job.draft.plan.document;
        let checked = encodings::check(&job.bytes, observer)?;
        let mut cartridges_shown = false;
        if let Destination::Bridge(address) = to {
            let cartridges = find_cartridges(address, &checked.inks);
            // What is not known now may be behind the reset that the printer gets before the job.
            cartridges_shown = matches!(cartridges, Cartridges::Known { .. });
            show(&format!("{}\n", cartridges_text(&cartridges, checked.by_hand)))?;
        }
        if !self.yes {
            confirm(name)?;
        }
        let order = Order { copies: self.copies, force: self.force, cartridges_shown };
        deliver(Job { name, content: Content::Made(job), checked: &checked }, to, order, observer)
    }
}

/// Whether so many copies can go there.
fn fits(to: &Destination, copies: u16) -> Result<()> {
    if let (Destination::File(path), 2..) = (to, copies) {
        let file = path.display();
        bail!(
            "--copies counts printed sheets, but {file} holds the job once; print it with `foilpress send {file} --copies {copies}`"
        );
    }
    Ok(())
}

/// How a job is to be delivered.
#[derive(Clone, Copy)]
pub struct Order {
    /// Sheets to print.
    pub copies: u16,
    /// Whether it may go to a device that does not identify itself as an ALPS printer.
    pub force: bool,
    /// Whether the user has already seen which cartridges are loaded.
    pub cartridges_shown: bool,
}

/// Takes a job to its destination, once for each copy.
pub fn deliver(job: Job<'_>, to: &Destination, order: Order, observer: &dyn Observer) -> Result<()> {
    fits(to, order.copies)?;
    if let Some(driver) = job.checked.dialect {
        observer.note(&format!(
            "{} is in the dialect of {driver}'s drivers, which nobody has tried; it is sent unchanged",
            job.name
        ));
    }
    match to {
        Destination::File(path) => {
            let staged = Staged::file(path)?;
            std::fs::write(staged.path(), job.content.bytes())
                .with_context(|| format!("cannot write {}", path.display()))?;
            staged.commit()
        }
        Destination::Raw(path) => to_device(job, path, order, observer),
        Destination::Bridge(address) => to_bridge(job, address, order, observer),
    }
}

/// Stores a job in a bridge. Nothing is printed.
pub fn store(job: Job<'_>, to: &Destination, observer: &dyn Observer) -> Result<()> {
    let Destination::Bridge(address) = to else {
        bail!("--store needs a bridge as the destination: usb:, serial:PORT or tcp:HOST:PORT");
    };
    let terminal = Terminal::new(false, true, observer);
    // Before the job is coded: a mistyped address is told at once.
    let shelf =
        device::deliver::store::shelf(address, &terminal).map_err(|failure| not_stored(job.name, failure))?;
    let packed = Packed::new(job, observer);
    let size = size_text(packed.kind(), packed.data().len() as u64, job.content.bytes().len() as u64);
    let stored = shelf_text(&shelf).unwrap_or_else(|| "no room for jobs".into());
    observer.note(&format!("{}: {size}; the bridge has {stored}", job.name));
    output::say_on_interrupt("what is stored of the job does not count; store it again");
    let number = device::deliver::store::store(&packed, address, &terminal)
        .map_err(|failure| not_stored(job.name, failure))?;
    observer.note(&cartridges_needed(&job.checked.inks));
    observer.note(&format!(
        "{} is stored in the bridge as job {number:08x}. Its button prints it, and so does `foilpress bridge jobs --print {number:08x}`",
        job.name
    ));
    Ok(())
}

fn not_stored(name: &str, failure: Failure) -> anyhow::Error {
    anyhow::Error::from(failure).context(format!("{name} is not stored"))
}

fn to_device(job: Job<'_>, path: &Path, order: Order, observer: &dyn Observer) -> Result<()> {
    let printers = Printers::of_system()?;
    let terminal = Terminal::new(order.force, order.cartridges_shown, observer);
    let delivery = Delivery::new(&printers, &terminal);
    observer.note(&cartridges_needed(&job.checked.inks));
    for copy in 1..=order.copies {
        delivery.send_raw(job, path).map_err(|failure| not_sent(failure, None))?;
        observer.note(&format!(
            "{}: the system has taken all {} bytes for the printer; whether they are printed, only the printer shows",
            job.name,
            job.content.bytes().len()
        ));
        if copy < order.copies && !next_sheet(copy, order.copies)? {
            bail!(
                "{copy} of {} sheets are sent; send the job again with --copies {} for the others",
                order.copies,
                order.copies - copy
            );
        }
    }
    Ok(())
}

fn to_bridge(job: Job<'_>, address: &Address, order: Order, observer: &dyn Observer) -> Result<()> {
    let copies = order.copies;
    let printers = Printers::of_system()?;
    let terminal =
        Terminal::new(order.force, order.cartridges_shown, observer).fed_by_hand(job.checked.by_hand);
    let delivery = Delivery::new(&printers, &terminal);
    // Before anything is queued: a mistyped address or a missing permission leaves no job behind.
    delivery.meet(address, None, &job.checked.inks).map_err(|failure| not_sent(failure, Some(address)))?;
    let journal = Journal::of_user()?;
    journal.tidy()?;
    let packed = Packed::new(job, observer);
    observer.note(&cartridges_needed(&job.checked.inks));
    // All are on disk before the first is sent, so that an interruption between two sheets loses none.
    let mut queue =
        vec![delivery.queue(&journal, &packed.named(&copy_name(job.name, 1, copies)), address)?];
    for copy in 2..=copies {
        queue.push(delivery.queue(&journal, &packed.named(&copy_name(job.name, copy, copies)), address)?);
    }
    for (copy, queued) in (1..).zip(queue) {
        let kept = kept(&queued, address);
        let ended = delivery
            .send(&journal, queued, address, copy == 1, false)
            .map_err(|failure| advised(failure, Some(address)))
            .with_context(kept)?;
        finish(&delivery, &ended, address, false, observer)?;
        if copy < copies && !next_sheet(copy, copies)? {
            bail!("{copy} of {copies} sheets are sent; `foilpress resume` sends the next one");
        }
    }
    Ok(())
}

/// Goes on with a job of the journal, or with `cancel` brings it to its end.
pub fn go_on(
    journal: &Journal,
    job: OpenJob,
    address: &Address,
    cancel: bool,
    observer: &dyn Observer,
) -> Result<()> {
    let printers = Printers::of_system()?;
    // Whether the device is the right one was settled when the job was queued; that it is not is told all the same.
    let terminal = Terminal::new(true, cancel, observer);
    let delivery = Delivery::new(&printers, &terminal);
    let kept = kept(&job, address);
    let ended = delivery
        .send(journal, job, address, false, cancel)
        .map_err(|failure| advised(failure, Some(address)))
        .with_context(kept)?;
    finish(&delivery, &ended, address, cancel, observer)
}

/// Says how a job ended, and waits for the sheet if all of it was sent.
fn finish(
    delivery: &Delivery<'_>,
    ended: &Ended,
    address: &Address,
    cancel: bool,
    observer: &dyn Observer,
) -> Result<()> {
    let text = ended.in_words();
    match ended.outcome {
        Outcome::Printed if cancel => bail!("{text}; it was too late to cancel"),
        Outcome::Printed => {
            observer.note(&text);
            await_sheet(delivery, ended, address, observer);
            Ok(())
        }
        Outcome::Cancelled if cancel => {
            observer.note(&text);
            Ok(())
        }
        Outcome::Cancelled | Outcome::Broken | Outcome::Lost | Outcome::Stored | Outcome::Forgotten => {
            bail!("{text}")
        }
    }
}

/// Says when the sheet is out, or why that cannot be said. Nothing that happens here changes that the job was sent.
fn await_sheet(delivery: &Delivery<'_>, ended: &Ended, address: &Address, observer: &dyn Observer) {
    let name = &ended.entry.name;
    output::say_on_interrupt("the printer has the whole job and continues without this program");
    let mut watch = |troubles: &[String]| match troubles {
        [] => observer.note("the printer continues"),
        troubles => observer.note(&format!("the printer waits: {}", troubles.join("; "))),
    };
    match delivery.await_sheet(ended.entry.record.job, address, &mut watch) {
        Sheet::Out => {
            observer.note(&format!("{name}: printed; the printer says it is done, and the sheet is out"));
        }
        Sheet::Unknown(why) => {
            observer.note(&format!("{name}: {why}; only the printer shows when the sheet is printed"));
        }
    }
}

/// What becomes of a job that is on disk when sending it fails; if it is on disk then.
fn kept(job: &OpenJob, address: &Address) -> impl FnOnce() -> String + use<> {
    let (number, name, data) = (job.entry.record.job, job.entry.name.clone(), job.place());
    let address = address.to_string();
    move || match data.exists() {
        true => format!("job {number:08x} ({name}) is kept; `foilpress resume {number:08x}` continues it"),
        false => format!(
            "job {number:08x} ({name}) is lost: somebody has removed {}; `foilpress cancel {number:08x} --to {address}` ends what \
             the bridge has of it",
            data.display()
        ),
    }
}

/// A failure before anything was queued.
fn not_sent(failure: Failure, to: Option<&Address>) -> anyhow::Error {
    advised(failure, to).context("not sent")
}

/// A failure with what can be done about it on the command line.
fn advised(failure: Failure, to: Option<&Address>) -> anyhow::Error {
    let advice = match (&failure, to) {
        (Failure::ResetOwed(_), Some(to)) => {
            format!("then `foilpress bridge reset --to {to}`, and send the job again")
        }
        (Failure::ResetOwed(_), None) => {
            "switch it off and on, then confirm that with `foilpress bridge reset --by-hand`".into()
        }
        (Failure::NotAlps(_), _) => "connect the right printer, or send with --force".into(),
        _ => return failure.into(),
    };
    anyhow!("{failure}; {advice}")
}

/// What a copy is called.
fn copy_name(name: &str, copy: u16, copies: u16) -> String {
    if copies == 1 { name.into() } else { format!("{name} (sheet {copy} of {copies})") }
}

/// Whether these are the copies of one job that wait for each other.
pub fn are_copies(names: &[&str]) -> bool {
    let stem = |name: &str| name.rfind(" (sheet ").map(|at| name[..at].to_owned());
    names
        .first()
        .and_then(|first| stem(first))
        .is_some_and(|first| names.iter().all(|name| stem(name).as_deref() == Some(first.as_str())))
}

/// Asks the person at the terminal. Where there is none, nobody has seen the plan.
fn confirm(name: &str) -> Result<()> {
    if !io::stdin().is_terminal() {
        bail!("{name} is not sent: there is no terminal to confirm the plan on; review it, then pass --yes");
    }
    write!(stderr(), "Send it? [y/N] ")?;
    let mut answer = String::new();
    io::stdin().lock().read_line(&mut answer)?;
    match answer.trim().to_ascii_lowercase().as_str() {
        "y" | "yes" => Ok(()),
        _ => bail!("{name} is not sent"),
    }
}

/// Waits for Enter between two sheets; `false` when nobody is there to press it.
fn next_sheet(done: u16, copies: u16) -> Result<bool> {
    write!(stderr(), "Sheet {done} of {copies} is sent. Load the next one and press Enter: ")?;
    let mut answer = String::new();
    Ok(io::stdin().lock().read_line(&mut answer)? > 0)
}
