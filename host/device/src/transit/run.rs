//! A session on real links: opens, reads, writes, waits, and opens again when the link goes.
//!
//! The first link has to come at once, so that a wrong name is told; after that the bridge may be away for as long as it
//! likes: it prints what it holds, and the job goes on where it stands when the cable is back.

use std::cell::Cell;
use std::time::Duration;

use protocol::link::message::{Fault, Progress};

use super::session::{Outcome, Record, Session, SessionError};
use crate::connection::transport::Transport;
use crate::connection::{Bridge, OpenError};
use observe::with_causes;

/// How long to wait for bytes when there is nothing to send.
const IDLE: Duration = Duration::from_millis(20);
/// A link that has been opened but on which no bridge introduces itself is given up after this.
const INTRODUCTION: Duration = Duration::from_secs(5);
/// Between two attempts to open a link that was lost.
const REOPEN: Duration = Duration::from_millis(500);
/// The record is saved at least this often while its figures change.
const SAVE: Duration = Duration::from_secs(1);

/// What happens while a job is sent.
#[derive(Debug)]
pub enum Event<'a> {
    /// The bridge has introduced itself: once on each link, and again when it has restarted without the link going.
    Connected(&'a Bridge),
    /// The link went, or cannot be opened again yet. Told once for each loss.
    Away(&'a str),
    /// The job has come on, or its state has changed.
    Moved(&'a Progress),
    /// The printer takes no bytes, or takes them again.
    Fault(Option<Fault>),
}

/// What the caller wants while a job is sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wish {
    /// That it is printed.
    GoOn,
    /// That it ends early, the printer being ready for the next one.
    Cancel,
    /// To be let go, wherever the job is.
    Leave,
}

/// Why sending stopped. The job is in the journal, and can be resumed.
#[derive(Debug, thiserror::Error)]
pub enum RunError<E: std::error::Error + 'static> {
    /// The link could not be opened in the first place.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// What answers is no bridge, or nothing answers.
    #[error(
        "no bridge answers there{}; check the port (`foilpress bridge list`) and that it runs this program's firmware",
        rubbish(*.0)
    )]
    NoAnswer(usize),
    /// The conversation cannot go on.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The record could not be saved, so nothing more was sent.
    #[error("cannot keep the job's record")]
    Save(#[source] E),
    /// The caller stopped waiting; the job goes on where it stands when it is resumed.
    #[error("stopped before the job ended")]
    Left,
}

fn rubbish(bytes: usize) -> String {
    if bytes > 0 { format!(" ({bytes} bytes came that are not its messages)") } else { String::new() }
}

/// Sends a job, or brings it to its end, until the bridge says how it ended.
///
/// `ways` opens the link anew each time; `save` makes the record durable. Only the time between two calls of the
/// system decides what happens when; which bytes reach the printer does not depend on it.
pub fn run<E: std::error::Error>(
    session: &mut Session<'_>,
    open: &mut dyn FnMut() -> Result<Box<dyn Transport>, OpenError>,
    save: &mut dyn FnMut(&Record) -> Result<(), E>,
    watch: &mut dyn FnMut(Event<'_>),
) -> Result<Outcome, RunError<E>> {
    run_while(session, open, &mut std::thread::sleep, save, watch, &mut || Wish::GoOn)
}

/// Like [`run`]; `pause` waits between two attempts to open the link, `wish` is asked again and again what the caller wants.
pub fn run_while<E: std::error::Error>(
    session: &mut Session<'_>,
    open: &mut dyn FnMut() -> Result<Box<dyn Transport>, OpenError>,
    pause: &mut dyn FnMut(Duration),
    save: &mut dyn FnMut(&Record) -> Result<(), E>,
    watch: &mut dyn FnMut(Event<'_>),
    wish: &mut dyn FnMut() -> Wish,
) -> Result<Outcome, RunError<E>> {
    let mut met = false;
    loop {
        let link = if met { reopen(open, pause, watch, wish).ok_or(RunError::Left)? } else { open()? };
        session.connected(link.now());
        match converse(session, link, save, watch, wish, &mut met)? {
            Some(outcome) => return Ok(outcome),
            None if met => pause(REOPEN),
            None => return Err(RunError::NoAnswer(0)),
        }
    }
}

/// [`run_while`] with a bridge that has a number. Once one has introduced itself it is that one, whatever its port is called
/// when it comes back: `open` is told its number.
pub fn run_at<E: std::error::Error>(
    session: &mut Session<'_>,
    open: &mut dyn FnMut(Option<u64>) -> Result<Box<dyn Transport>, OpenError>,
    pause: &mut dyn FnMut(Duration),
    save: &mut dyn FnMut(&Record) -> Result<(), E>,
    watch: &mut dyn FnMut(Event<'_>),
    wish: &mut dyn FnMut() -> Wish,
) -> Result<Outcome, RunError<E>> {
    let known = Cell::new(session.record().bridge);
    let mut watch = |event: Event<'_>| {
        if let Event::Connected(bridge) = &event {
            known.set(Some(bridge.serial));
        }
        watch(event);
    };
    run_while(session, &mut || open(known.get()), pause, save, &mut watch, wish)
}

/// Opens the link again, however long that takes; `None` when the caller wishes to be let go.
fn reopen(
    open: &mut dyn FnMut() -> Result<Box<dyn Transport>, OpenError>,
    pause: &mut dyn FnMut(Duration),
    watch: &mut dyn FnMut(Event<'_>),
    wish: &mut dyn FnMut() -> Wish,
) -> Option<Box<dyn Transport>> {
    let mut told = String::new();
    loop {
        match open() {
            Ok(link) => return Some(link),
            Err(_) if wish() == Wish::Leave => return None,
            Err(error) => {
                let text = with_causes(&error);
                if text != told {
                    watch(Event::Away(&text));
                    told = text;
                }
                pause(REOPEN);
            }
        }
    }
}

/// One link from its opening to its loss: `None` when it is lost.
fn converse<E: std::error::Error>(
    session: &mut Session<'_>,
    mut link: Box<dyn Transport>,
    save: &mut dyn FnMut(&Record) -> Result<(), E>,
    watch: &mut dyn FnMut(Event<'_>),
    wish: &mut dyn FnMut() -> Wish,
    met: &mut bool,
) -> Result<Option<Outcome>, RunError<E>> {
    let opened = link.now();
    let mut out = Vec::new();
    let mut sent = 0;
    let mut buffer = [0; 4096];
    let mut received = 0usize;
    let mut introduced = None;
    let mut last = session.progress().copied();
    let (mut saved, mut saved_at) = (session.record().printed, opened);
    loop {
        let now = link.now();
        match wish() {
            Wish::Cancel if !session.record().cancel => session.cancel(),
            Wish::Leave => return Err(RunError::Left),
            Wish::GoOn | Wish::Cancel => {}
        }
        if sent == out.len() {
            out.clear();
            sent = 0;
            session.speak(now, &mut out, save).map_err(RunError::Save)?;
        }
        if let Some(outcome) = session.outcome() {
            // What was decided on the last message heard has to be on disk too.
            session.speak(now, &mut out, save).map_err(RunError::Save)?;
            return Ok(Some(outcome));
        }
        if sent < out.len() {
            match link.send(&out[sent..]) {
                Ok(count) => sent += count,
                Err(error) => {
                    watch(Event::Away(&with_causes(&error)));
                    return Ok(None);
                }
            }
        }
        let patience = if sent < out.len() || session.has_more() { Duration::ZERO } else { IDLE };
        let count = match link.receive(&mut buffer, patience) {
            Ok(count) => count,
            Err(error) => {
                watch(Event::Away(&with_causes(&error)));
                return Ok(None);
            }
        };
        let now = link.now();
        received += count;
        session.hear(now, &buffer[..count])?;
        if session.greeted()
            && let Some(bridge) = session.bridge()
            && introduced.replace(bridge.boot) != Some(bridge.boot)
        {
            *met = true;
            watch(Event::Connected(bridge));
        }
        tell_progress(session, &mut last, watch);
        if session.record().printed != saved && now.saturating_sub(saved_at) >= SAVE {
            save(session.record()).map_err(RunError::Save)?;
            (saved, saved_at) = (session.record().printed, now);
        }
        if !session.greeted() && !*met && now.saturating_sub(opened) >= INTRODUCTION {
            return Err(RunError::NoAnswer(received));
        }
        if session.is_dead(now) {
            watch(Event::Away("the bridge does not answer"));
            return Ok(None);
        }
    }
}

/// Tells what is new since `last`: a fault that came or went, and where the job is.
fn tell_progress(session: &Session<'_>, last: &mut Option<Progress>, watch: &mut dyn FnMut(Event<'_>)) {
    let Some(progress) = session.progress().filter(|progress| last.as_ref() != Some(progress)) else {
        return;
    };
    let (before, fault) = (last.as_ref().and_then(fault_of), session.fault());
    if before != fault {
        watch(Event::Fault(fault));
    }
    watch(Event::Moved(progress));
    *last = Some(*progress);
}

fn fault_of(progress: &Progress) -> Option<Fault> {
    match progress.state {
        protocol::link::message::JobState::Stopped(fault) => Some(fault),
        _ => None,
    }
}
