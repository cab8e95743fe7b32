//! Printing: from a job's document to its last sheet.
//!
//! Problem: a page costs 100 MB while it is drawn, a document has hundreds of them, and a sheet that was sent must not be sent again.
//! Method: the filter of print queues draws the document ([`queue::filter`]); each sheet goes into a file as it is made. When all are
//! there, that is put on record, and the delivery of print queues sends them one after the other ([`queue::backend`]). A job of
//! finished sheets is taken apart instead of drawn. A restart draws again what was not all drawn, and goes on behind the last sheet
//! that was sent.
//! Cost: one page in memory; the sheets of one job on disk.
//! Limits: one device, one job at a time.

use std::borrow::Cow;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use files::durable::{self, Access};
use observe::{Observer, with_causes};
use press::inspect::sheets;
use protocol::ink::Ink;

use crate::budget::{Purpose, Turn};
use crate::jobs::{Job, State};
use crate::server::{Cartridge, ChangeError, Server};
use crate::spool::JOB;
use crate::values::now;
use device::questions::status::Status;
use make::options::is_chosen;
use queue::backend::{self, Sheets};
use queue::call::{Call, Exit};
use queue::filter::{self, FilterError, Filtered};
use queue::messages::{Reason, Report, colour};

/// Prints one job after the other, for ever.
pub fn work(server: &Server) -> ! {
    loop {
        let job = server.next();
        let ended = print(server, &job);
        {
            let mut data = server.data();
            data.percent = None;
            data.message.clear();
            data.reasons.clear();
            data.changed = now();
        }
        if let Err(error) = ended {
            // The job stays as it is on disk, and the next start takes it up.
            server.observer.note(&format!("job {}: {}", job.id, with_causes(&error)));
            std::thread::sleep(std::time::Duration::from_secs(2));
        }
    }
}

fn print(server: &Server, job: &Job) -> Result<(), ChangeError> {
    let voice = Voice { server, id: job.id, stage: Mutex::default() };
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
    let drawn = prepare_for(server, job.id, &voice, Purpose::Print);
    // A sheet that is open at the bridge is ended there first, whatever became of the job.
    if voice.is_cancelled() && !server.is_open(job) {
        return end(server, &call, &voice, State::Canceled, "cancelled");
    }
    if let Err(why) = drawn {
        return end(server, &call, &voice, State::Aborted, &why);
    }
    let folder = Folder::of(&server.store.sheets(job.id));
    let stop = || voice.is_cancelled();
    let (exit, whole) = backend::deliver(&call, &server.settings.devices, &folder, &voice, &stop, &stop);
    match exit {
        Exit::Ok if whole => end(server, &call, &voice, State::Completed, &voice.printed()),
        Exit::Ok => end(server, &call, &voice, State::Canceled, "cancelled"),
        Exit::Cancel => {
            let why = voice.last();
            end(server, &call, &voice, State::Aborted, &why)
        }
        // Somebody has to do something first, and says so by releasing the job.
        Exit::Failed | Exit::Hold | Exit::Stop => server.change(job.id, |job| {
            (job.state, job.ticket.held) = (if job.cancel { State::Canceled } else { State::Held }, false);
            job.ended = job.cancel.then(now);
            Ok(())
        }),
    }
}

/// The end of a job: on record first, then forgotten by the delivery.
fn end(server: &Server, call: &Call, voice: &Voice<'_>, state: State, why: &str) -> Result<(), ChangeError> {
    server.change(voice.id, |job| {
        (job.state, job.ended) = (state, Some(now()));
        job.message = why.into();
        Ok(())
    })?;
    // What is still open, as at a bridge that is another one now, is ended before the next job there.
    if !backend::is_open(&call.to, &call.journal.join(&call.identity)) {
        backend::forget(call, voice);
    }
    Ok(server.store.clear(voice.id, false)?)
}

/// Makes the sheets of a job that waits, so that somebody can look at them.
///
/// # Errors
/// In words: why there are none.
pub fn prepare(server: &Server, id: u32) -> Result<(), String> {
    prepare_for(server, id, &Voice { server, id, stage: Mutex::default() }, Purpose::Look)
}

/// Makes the sheets of a job unless they are there, and puts on record that all of them are.
fn prepare_for(server: &Server, id: u32, voice: &Voice<'_>, purpose: Purpose) -> Result<(), String> {
    let turn = server.drawing.take(purpose);
    let job = server.data().jobs.get(&id).cloned().ok_or("there is no such job")?;
    if job.sheets.is_some() {
        return Ok(());
    }
    if job.state.is_over() || job.state == State::Incoming {
        return Err("the job has no document that could be drawn".into());
    }
    // Which sheet that is, is decided when the job is drawn, and stays known.
    let job = Job { ticket: job.ticket.on(server.data().loaded()), ..job };
    let drawn = draw(server, &job, voice, &turn)?;
    let count = Folder::of(&server.store.sheets(id)).files.len();
    let kept = server.change(id, |kept| {
        kept.sheets = Some(u32::try_from(count).unwrap_or(u32::MAX).saturating_mul(job.ticket.copies));
        (kept.ticket.size, kept.ticket.kind) = (job.ticket.size, job.ticket.kind);
        (kept.laid, kept.is_cut) = (drawn.laid, drawn.is_cut);
        Ok(())
    });
    kept.map_err(|error| with_causes(&error))
}

/// Makes the sheets of a job, and says how its pages lie.
fn draw(server: &Server, job: &Job, voice: &Voice<'_>, turn: &Turn<'_>) -> Result<Filtered, String> {
    let text = |error: io::Error| format!("cannot keep the job's sheets: {error}");
    let to = server.store.sheets(job.id);
    match fs::remove_dir_all(&to) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(text(error)),
        _ => {}
    }
    durable::make_folder(&to, Access::Private).map_err(text)?;
    let document = job.document.as_deref().ok_or("the job has no document")?;
    let path = server.store.folder(job.id).join(document);
    let mut out = SheetFiles { folder: &to, count: 0, voice, turn };
    let mut drawn = Filtered::default();
    if job.format == JOB {
        let bytes = fs::read(&path).map_err(text)?;
        let (all, pages) = (sheets(&bytes), job.ticket.pages());
        if !(1..=all.len()).any(|page| is_chosen(&pages, page)) {
            return Err(FilterError::NotChosen(all.len()).to_string());
        }
        for (_, place) in (1..).zip(all).filter(|(page, _)| is_chosen(&pages, *page)) {
            out.write_all(&bytes[place]).map_err(text)?;
        }
    } else {
        let preset = server
            .printer(&job.printer)
            .ok_or("its printer is not there any more; print it on another one")?;
        let choices = job.ticket.choices(&preset.choices);
        let file = fs::File::open(&path).map_err(text)?;
        drawn = filter::run(file, Some(&path), &choices, &server.settings.library, &mut out, voice)
            .map_err(|error| with_causes(&error))?;
    }
    match out.count {
        0 => Err("there is nothing to print: every page is blank".into()),
        _ => durable::sync_folder(&to).map(|()| drawn).map_err(text),
    }
}

/// Where the filter writes: each write is a sheet, and becomes a file.
struct SheetFiles<'a> {
    folder: &'a Path,
    count: usize,
    voice: &'a Voice<'a>,
    turn: &'a Turn<'a>,
}

impl Write for SheetFiles<'_> {
    fn write(&mut self, sheet: &[u8]) -> io::Result<usize> {
        if self.voice.is_cancelled() {
            return Err(io::Error::other("the job is cancelled"));
        }
        // Meanwhile the job itself may have been printed.
        if self.turn.give_way() && !self.voice.waits() {
            return Err(io::Error::other("the job is printed"));
        }
        self.count += 1;
        durable::write(&self.folder.join(format!("{:05}.rgl", self.count)), sheet, Access::Private)?;
        Ok(sheet.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The sheets in a folder, in order.
pub struct Folder {
    files: Vec<PathBuf>,
}

impl Folder {
    /// Those there are.
    pub fn of(folder: &Path) -> Folder {
        let mut files: Vec<PathBuf> = fs::read_dir(folder)
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|ending| ending == "rgl"))
            .collect();
        files.sort();
        Folder { files }
    }
}

impl Sheets for Folder {
    fn count(&self) -> usize {
        self.files.len()
    }

    fn sheet(&self, index: usize) -> io::Result<Cow<'_, [u8]>> {
        Ok(Cow::Owned(fs::read(&self.files[index])?))
    }
}

/// What is told of a job becomes its state and the printers'.
struct Voice<'a> {
    server: &'a Server,
    id: u32,
    /// Steps of the current stage, and those done.
    stage: Mutex<(u64, u64)>,
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

    fn say(&self, text: &str) {
        let mut data = self.server.data();
        data.message = text.into();
        data.changed = now();
        // On disk with the job's next state; until then it is for whoever asks.
        if let Some(job) = data.jobs.get_mut(&self.id) {
            job.message = text.into();
        }
    }
}

impl Observer for Voice<'_> {
    fn begin(&self, _stage: &str, total: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = (total, 0);
    }

    fn advance(&self, steps: u64) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        stage.1 += steps;
    }

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
        self.server.observer.note(&format!("job {}: {text}", self.id));
    }

    fn debug(&self, _: &str) {}

    fn page(&self, number: usize) {
        // If that cannot be saved, the number is counted again after a restart, from the delivery's own records.
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
