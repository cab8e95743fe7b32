//! Printing: from a job's document to its last sheet.
//!
//! Problem: a page costs 100 MB while it is drawn, a document has hundreds of them, and a sheet that was sent
//! must not be sent again.
//! Method: the filter of print queues draws the document ([`queue::filter`]); each sheet goes into a file as
//! it is drawn, and the delivery of print queues sends one after the other meanwhile ([`queue::backend`]).
//! When all are drawn, that is put on record. A job of finished sheets is taken apart instead of drawn. A
//! restart draws the document again, keeps the sheets that are there, and goes on behind the last one that
//! was sent. What cannot be kept for want of space is tried again, and again.
//! Cost: one page in memory; the sheets of one job on disk.
//! Limits: one device, one job at a time.

use std::error::Error;
use std::fs;
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use files::durable::{self, Access, is_full};
use observe::{Observer, with_causes};
use press::inspect::sheets;
use protocol::ink::Ink;

use crate::budget::{Purpose, Turn};
use crate::jobs::{Job, State};
use crate::making::Making;
use crate::seen;
use crate::server::{Cartridge, ChangeError, Server};
use crate::spool::JOB;
use crate::template::hundredths;
use crate::values::now;
use device::questions::status::Status;
use make::options::is_chosen;
use queue::backend::{self, Sheets as _};
use queue::call::{Call, Exit};
use queue::filter::{self, FilterError, Filtered};
use queue::messages::{Reason, Report, colour};

/// How long a job waits that could not be kept, at first and at most.
const AGAIN: (Duration, Duration) = (Duration::from_secs(2), Duration::from_secs(30));

/// Prints one job after the other, for ever.
pub fn work(server: &Server) -> ! {
    let mut again = AGAIN.0;
    loop {
        let job = server.next();
        let voice = Voice { server, id: job.id, purpose: Purpose::Print };
        let ended = print(server, &job, &voice);
        server.rests();
        let Err(why) = ended else {
            again = AGAIN.0;
            continue;
        };
        let (why, reason) = match why {
            Unfinished::Full => (FULL.into(), Reason::SpoolAreaFull),
            Unfinished::Record(error) => (with_causes(&error), Reason::Other),
        };
        if again == AGAIN.0 {
            server.observer.note(&format!("job {}: {why}", job.id));
        }
        server.try_again(job.id, &server.without_places(&why), reason, again);
        again = AGAIN.1.min(2 * again);
    }
}

/// Why a job is not over, and will be tried again.
pub enum Unfinished {
    /// The disk is full.
    Full,
    /// Its record cannot be kept.
    Record(ChangeError),
}

impl From<ChangeError> for Unfinished {
    fn from(error: ChangeError) -> Unfinished {
        if is_full(&error) { Unfinished::Full } else { Unfinished::Record(error) }
    }
}

fn print(server: &Server, job: &Job, voice: &Voice<'_>) -> Result<(), Unfinished> {
    let call = Call {
        title: job.name.clone(),
        identity: job.identity(),
        copies: job.ticket.copies,
        file: None,
        to: server.settings.to.clone(),
        journal: server.sent(),
        awaits_sheets: true,
        in_class: false,
        listed: (String::new(), String::new()),
        lister: PathBuf::new(),
    };
    let job = fixed(server, job.id)?;
    let making = Making::of(&server.store.sheets(&job));
    let stop = || voice.is_cancelled();
    let ((exit, whole), drawn) = thread::scope(|scope| {
        let drawing = scope.spawn(|| draw_for(server, &job, voice, &making));
        let sent = backend::deliver(&call, &server.settings.devices, &making, voice, &stop, &stop);
        making.enough();
        (sent, drawing.join().unwrap_or_else(|_| Err(Undrawn::Document("it cannot be drawn".into()))))
    });
    match (exit, drawn) {
        (Exit::Ok, Err(_)) if voice.is_cancelled() => end(server, &call, voice, State::Canceled, "cancelled"),
        (Exit::Ok, Err(Undrawn::Full)) => Err(Unfinished::Full),
        (Exit::Ok, Err(Undrawn::Enough)) => Err(Unfinished::Record(ChangeError::State("not drawn"))),
        (Exit::Ok, Err(Undrawn::Document(why))) => {
            let why = unfinished(server, &job, &why);
            end(server, &call, voice, State::Aborted, &why)
        }
        (Exit::Ok, Ok(())) if whole => {
            // A picture for those who look for it later; a job is printed without one, too.
            let _ = seen::keep_picture(&server.seen, &server.store, &job, &making);
            end(server, &call, voice, State::Completed, &voice.printed())
        }
        (Exit::Ok, Ok(())) => end(server, &call, voice, State::Canceled, "cancelled"),
        (Exit::Cancel, _) => end(server, &call, voice, State::Aborted, &voice.last()),
        (Exit::Failed | Exit::Stop, _) if voice.lacks_space() => Err(Unfinished::Full),
        // Somebody has to do something first, and says so by releasing the job.
        (Exit::Failed | Exit::Hold | Exit::Stop, _) => Ok(server.change(job.id, |job| {
            (job.state, job.ticket.held) = (if job.cancel { State::Canceled } else { State::Held }, false);
            job.awaits_switch = exit == Exit::Hold && !job.cancel;
            job.ended = job.cancel.then(now);
            Ok(())
        })?),
    }
}

/// Why a job ends of which some sheets are printed already.
fn unfinished(server: &Server, job: &Job, why: &str) -> String {
    let done = server.data().jobs.get(&job.id).map_or(0, |job| job.done);
    let plural = |number: u32| if number == 1 { "sheet is" } else { "sheets are" };
    let path = job.document.as_ref().map(|document| server.store.folder(job.id).join(document));
    let pages = || match job.format.as_str() {
        "application/pdf" => path.as_deref().and_then(art::pdf::page_count),
        _ => None,
    };
    match done {
        0 => why.into(),
        done => match pages() {
            Some(pages) => {
                let chosen = (1..=pages).filter(|&page| is_chosen(&job.ticket.pages(), page)).count();
                let all = u32::try_from(chosen).unwrap_or(u32::MAX).saturating_mul(job.ticket.copies);
                format!("{done} of {all} {} printed; {why}", plural(all))
            }
            None => format!("{done} {} printed; {why}", plural(done)),
        },
    }
}

/// The end of a job: on record first, then forgotten by the delivery. Where the disk is full, what is not
/// printed any more makes room for that.
fn end(server: &Server, call: &Call, voice: &Voice<'_>, state: State, why: &str) -> Result<(), Unfinished> {
    let why = server.without_places(why);
    server.end(voice.id, state, &why)?;
    // What is still open, as at a bridge that is another one now, is ended before the next job there.
    if !backend::is_open(&call.to, &call.journal.join(&call.identity)) {
        backend::forget(call, voice);
    }
    Ok(())
}

/// A job whose sheet is decided, as it is when the job is drawn first, and stays known.
fn fixed(server: &Server, id: u32) -> Result<Job, ChangeError> {
    let job = server.data().jobs.get(&id).cloned().ok_or(ChangeError::NoJob)?;
    let ticket = job.ticket.clone().on(server.data().loaded());
    if ticket == job.ticket {
        return Ok(job);
    }
    server.change(id, |kept| {
        (kept.ticket.size, kept.ticket.kind) = (ticket.size, ticket.kind.clone());
        Ok(())
    })?;
    Ok(Job { ticket, ..job })
}

/// Makes the sheets of a job that waits, so that somebody can look at them; where they are.
///
/// # Errors
/// In words: why there are none.
pub fn prepare(server: &Server, id: u32) -> Result<Making, String> {
    let job = fixed(server, id).map_err(|error| server.without_places(&with_causes(&error)))?;
    let making = Making::of(&server.store.sheets(&job));
    let voice = Voice { server, id, purpose: Purpose::Look };
    match draw_for(server, &job, &voice, &making) {
        Ok(()) => Ok(making),
        Err(Undrawn::Full) => Err(FULL.into()),
        Err(Undrawn::Enough) => Err("the job is printed or cancelled".into()),
        Err(Undrawn::Document(why)) => Err(server.without_places(&why)),
    }
}

/// What is said where the disk is full.
pub const FULL: &str = "the disk of the print server is full; it goes on when there is room";

/// Why sheets are not all drawn.
enum Undrawn {
    /// The disk is full.
    Full,
    /// Nobody wants them any more.
    Enough,
    /// The document, in words.
    Document(String),
}

impl Undrawn {
    fn of(error: &(dyn Error + 'static)) -> Undrawn {
        if is_full(error) { Undrawn::Full } else { Undrawn::Document(with_causes(error)) }
    }
}

impl From<io::Error> for Undrawn {
    fn from(error: io::Error) -> Undrawn {
        match Undrawn::of(&error) {
            Undrawn::Document(why) => Undrawn::Document(format!("cannot keep the job's sheets: {why}")),
            full => full,
        }
    }
}

/// Makes the sheets of a job unless they are there, and puts on record that all of them are.
fn draw_for(server: &Server, job: &Job, voice: &Voice<'_>, making: &Making) -> Result<(), Undrawn> {
    let _over = making.until_over();
    let turn = server.drawing.take(voice.purpose);
    let _told = Told(server);
    let known = server.data().jobs.get(&job.id).cloned();
    let known = known.ok_or_else(|| Undrawn::Document("there is no such job".into()))?;
    if known.sheets.is_some_and(|sheets| making.holds(sheets / job.ticket.copies.max(1))) {
        return Ok(());
    }
    if known.cancel || known.state.is_over() || known.state == State::Incoming {
        return Err(Undrawn::Enough);
    }
    let drawn = draw(server, job, &mut SheetFiles { count: 0, making, voice, turn: &turn })?;
    let count = u32::try_from(making.count()).unwrap_or(u32::MAX);
    let kept = server.change(job.id, |kept| {
        // Meanwhile somebody may have changed it.
        if kept.round == job.round {
            kept.sheets = Some(count.saturating_mul(job.ticket.copies));
            (kept.laid, kept.is_cut) = (drawn.laid, drawn.is_cut);
            kept.lies = drawn.lies.map(|lies| [lies.left, lies.top, lies.width, lies.length].map(hundredths));
        }
        Ok(())
    });
    kept.map_err(|error| Undrawn::of(&error))
}

/// Nothing is drawn any more when this is dropped.
struct Told<'a>(&'a Server);

impl Drop for Told<'_> {
    fn drop(&mut self) {
        self.0.draws(None);
    }
}

/// Makes the sheets of a job, and says how its pages lie.
fn draw(server: &Server, job: &Job, out: &mut SheetFiles<'_>) -> Result<Filtered, Undrawn> {
    durable::make_folder(out.making.folder(), Access::Private)?;
    let document = job.document.as_deref();
    let document = document.ok_or_else(|| Undrawn::Document("the job has no document".into()))?;
    let path = server.store.folder(job.id).join(document);
    let mut file = fs::File::open(&path)?;
    let mut drawn = Filtered::default();
    if job.format == JOB {
        finished(&mut file, &job.ticket.pages(), out)?;
    } else {
        let preset = server.printer(&job.printer).ok_or_else(|| {
            Undrawn::Document("its printer is not there any more; print it on another one".into())
        })?;
        let (choices, voice) = (job.ticket.choices(&preset.choices), out.voice);
        drawn = filter::run(file, Some(&path), &choices, &server.settings.library, out, voice)
            .map_err(|error| out.why(Undrawn::of(&error)))?;
    }
    match out.count {
        0 => Err(Undrawn::Document("there is nothing to print: every page is blank".into())),
        _ => Ok(drawn),
    }
}

/// Takes a job of finished sheets apart, one in memory at a time.
fn finished(
    document: &mut dyn Read,
    pages: &[std::ops::RangeInclusive<usize>],
    out: &mut SheetFiles<'_>,
) -> Result<(), Undrawn> {
    let (mut bytes, mut seen, mut is_all) = (Vec::new(), 0, false);
    while !is_all || !bytes.is_empty() {
        let before = bytes.len();
        // Twice as much each time: a sheet of unknown length is looked at no more than that often.
        let more = document.take(before.max(1 << 20) as u64).read_to_end(&mut bytes)?;
        is_all = more == 0;
        let mut places = sheets(&bytes);
        if !is_all {
            // The last one may go on.
            places.pop();
        }
        let end = places.last().map_or(0, |place| place.end);
        for place in places.into_iter().filter(|place| !place.is_empty()) {
            seen += 1;
            if is_chosen(pages, seen) {
                out.write_all(&bytes[place]).map_err(|error| out.why(error.into()))?;
            }
        }
        bytes.drain(..end);
    }
    match out.count {
        0 => Err(Undrawn::Document(FilterError::NotChosen(seen).to_string())),
        _ => Ok(()),
    }
}

/// Where the filter writes: each write is a sheet, and becomes a file unless it is there from an earlier
/// time.
struct SheetFiles<'a> {
    count: usize,
    making: &'a Making,
    voice: &'a Voice<'a>,
    turn: &'a Turn<'a>,
}

impl SheetFiles<'_> {
    /// Why nothing more is drawn: not for the document's sake if nobody wants it.
    fn why(&self, why: Undrawn) -> Undrawn {
        if self.is_enough() { Undrawn::Enough } else { why }
    }

    /// Whether nobody wants more.
    fn is_enough(&self) -> bool {
        self.voice.is_cancelled() || self.making.is_enough()
    }
}

impl Write for SheetFiles<'_> {
    fn write(&mut self, sheet: &[u8]) -> io::Result<usize> {
        // Meanwhile the job itself may have been printed.
        if self.turn.give_way() && !self.voice.waits() {
            self.making.enough();
        }
        if self.is_enough() {
            return Err(io::Error::other("nobody wants it any more"));
        }
        self.count += 1;
        self.voice.server.draws(Some((self.voice.id, self.count)));
        if self.count > self.making.count() {
            let path = self.making.path(self.count);
            durable::write(&path, sheet, Access::Private)?;
            self.making.has(self.count);
        }
        Ok(sheet.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What is told of a job becomes its state and the printers'.
struct Voice<'a> {
    server: &'a Server,
    id: u32,
    purpose: Purpose,
}

impl Voice<'_> {
    fn is_cancelled(&self) -> bool {
        self.server.data().jobs.get(&self.id).is_none_or(|job| job.cancel)
    }

    /// Whether the job waits.
    fn waits(&self) -> bool {
        let waits = |job: &Job| matches!(job.state, State::Pending | State::Held);
        self.server.data().jobs.get(&self.id).is_some_and(waits)
    }

    /// That it is printed, and how its pages lie.
    fn printed(&self) -> String {
        let laid = self.server.data().jobs.get(&self.id).map(|job| job.laid.join("; "));
        match laid {
            Some(laid) if !laid.is_empty() => format!("printed; {laid}"),
            _ => "printed".into(),
        }
    }

    fn last(&self) -> String {
        self.server.data().jobs.get(&self.id).map_or_else(String::new, |job| job.message.clone())
    }

    /// Whether the delivery has found the disk full.
    fn lacks_space(&self) -> bool {
        self.server.data().reasons.contains(&Reason::SpoolAreaFull)
    }

    fn say(&self, text: &str) {
        let text = &self.server.without_places(text);
        let mut data = self.server.data();
        if self.purpose == Purpose::Print {
            data.message.clone_from(text);
        }
        data.changed = now();
        // On disk with the job's next state; until then it is for whoever asks.
        if let Some(job) = data.jobs.get_mut(&self.id) {
            job.message.clone_from(text);
        }
    }
}

impl Observer for Voice<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, _: u64) {}

    fn end(&self) {}

    fn note(&self, text: &str) {
        self.say(text);
    }
}

impl Report for Voice<'_> {
    fn reasons(&self, reasons: &[Reason]) {
        let mut data = self.server.data();
        if data.reasons != reasons {
            data.reasons = reasons.to_vec();
            data.changed = now();
        }
    }

    fn lift(&self, over: &[Reason]) {
        let left: Vec<Reason> =
            self.server.data().reasons.iter().copied().filter(|r| !over.contains(r)).collect();
        self.reasons(&left);
    }

    fn info(&self, text: &str) {
        self.say(text);
    }

    fn error(&self, text: &str) {
        self.say(text);
        // Of a full disk it is told when the job is tried again.
        if !self.lacks_space() {
            self.server.observer.note(&format!("job {}: {text}", self.id));
        }
    }

    fn debug(&self, _: &str) {}

    fn page(&self, number: usize) {
        // If that cannot be saved, the number is counted again after a restart, from the delivery's own
        // records.
        let _ = self.server.change(self.id, |job| {
            job.done = u32::try_from(number).unwrap_or(u32::MAX);
            Ok(())
        });
    }

    fn percent(&self, share: u64) {
        self.server.data().percent = Some(share);
    }

    fn cartridges(&self, status: &Status) {
        if status.stale || status.cartridges.is_empty() {
            return;
        }
        let of = |barcode| Ink::from_barcode(barcode);
        let found = status.cartridges.iter().map(|cartridge| Cartridge {
            name: of(cartridge.barcode)
                .map_or_else(|| format!("cartridge-{}", cartridge.barcode), |ink| ink.name().into()),
            colour: of(cartridge.barcode).map_or("none", colour),
            is_loaded: cartridge.condition == "loaded",
        });
        self.server.data().cartridges = found.collect();
    }
}
