//! Storing, and printing with no host, while the supply goes anywhere. What crosses the port is parsed:
//! nothing is lost but the sheet in the rollers, nothing is printed twice or behind a part of something else,
//! and the store holds the old or the new state.

use bridge::alone::{Alone, SILENCE_US};
use bridge::button::Press;
use bridge::engine::{Engine, Outcome, Task};
use bridge::standing::Standing;
use bridge::store::{Next, NoFlash, PAGE_DATA};
use model::flash::ModelFlash;
use model::{Board, IDENTITY, Job, framed, is_a_whole_job, seeded};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    ALONE, DATA_MAX, DefectKind, Fault, JobKind, JobState, LOCAL, Lines, PastJob, Progress, Refusal,
    StoredJob, ToBridge, ToHost,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A bridge from one start to the next.
struct Bridge<'m> {
    engine: Engine<'m>,
    alone: Alone<ModelFlash>,
    reader: Reader,
    said: Vec<String>,
}

impl<'m> Bridge<'m> {
    fn start(board: &'m mut Board, flash: &ModelFlash) -> Bridge<'m> {
        let mut engine = Engine::new(board.memory(), IDENTITY);
        let alone = Alone::open(flash.clone(), &mut engine, false);
        Bridge { engine, alone, reader: Reader::new(), said: Vec::new() }
    }

    fn restart(board: &'m mut Board, flash: &ModelFlash, before: bridge::engine::Checkpoint) -> Bridge<'m> {
        let mut engine = Engine::resume(board.memory(), IDENTITY, before);
        let alone = Alone::open(flash.clone(), &mut engine, true);
        Bridge { engine, alone, reader: Reader::new(), said: Vec::new() }
    }

    /// The store has a turn, and time stands still.
    fn poll(&mut self) -> bool {
        self.alone.poll(&mut self.engine, 0)
    }

    fn tell(&mut self, message: ToBridge<'_>) {
        self.engine.receive(&mut self.reader, &framed(&message));
    }

    fn hear(&mut self) -> Vec<String> {
        let (mut reader, mut buffer) = (Reader::new(), [0; MAX]);
        loop {
            let length = self.engine.transmit(&mut buffer);
            if length == 0 {
                return std::mem::take(&mut self.said);
            }
            let Read::Message(bytes, []) = reader.read(&buffer[..length]) else { panic!("not a frame") };
            self.said.push(format!("{:?}", frame::decode::<ToHost>(bytes).unwrap()));
        }
    }

    /// The next piece of a job's data, as far as the credit goes.
    fn send(&mut self, id: u32, data: &[u8], most: usize) {
        let Progress { job, accepted, limit, .. } = self.engine.progress();
        if job == id && accepted < limit {
            let end = (accepted as usize + most.min(DATA_MAX)).min(limit as usize);
            self.tell(ToBridge::Data { job: id, offset: accepted, bytes: &data[accepted as usize..end] });
        }
    }

    fn progress(&self) -> Progress {
        self.engine.progress()
    }

    fn stored(&self) -> Vec<(u32, Vec<u8>)> {
        let store = self.alone.store();
        let read = |stored| {
            let (mut reading, mut data, mut page) = (store.read(stored), Vec::new(), [0; PAGE_DATA]);
            loop {
                match store.next(&mut reading, &mut page) {
                    Next::Bytes(count) => data.extend_from_slice(&page[..count]),
                    Next::Later => {}
                    Next::Damaged => panic!("damaged"),
                    Next::End => return data,
                }
            }
        };
        store.jobs().iter().map(|stored| (stored.job, read(stored))).collect()
    }
}

/// The printer: what has crossed the port since it was last known to stand between two jobs.
#[derive(Default)]
struct Printer {
    since: Vec<u8>,
    resets: usize,
    /// The sheet that was in it at each reset.
    lost: Vec<Vec<u8>>,
}

impl Printer {
    /// A moment at the port: a task is done, or some bytes cross.
    fn serve(&mut self, engine: &mut Engine<'_>, most: usize) {
        if let Some(task) = engine.task() {
            assert_eq!(task, Task::Initialise, "nobody has asked for anything else");
            self.resets += 1;
            if !self.since.is_empty() {
                self.lost.push(std::mem::take(&mut self.since));
            }
            engine.done(Outcome::Done);
        }
        engine.port(Lines::IDLE, None);
        let bytes = engine.output();
        let count = bytes.len().min(most);
        self.since.extend_from_slice(&bytes[..count]);
        engine.consumed(count);
    }
}

/// What the bridge does next in the test of cuts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Deed {
    Store,
    Button,
    Command,
    Link,
    Delete,
}

#[test]
fn a_thousand_cuts_cost_nothing_but_the_sheet_in_the_rollers() {
    let mut random = seeded(21);
    let mut board = Board::new(2048, 4096);
    let (mut number, mut cuts, mut warm) = (0u32, 0u32, 0u32);
    let (mut printed, mut sheets_lost, mut cancelled, mut cut_while) = (0, 0, 0, [0; 5]);
    while cuts < 1000 {
        let flash = ModelFlash::new(random.random_range(14..40), &mut random);
        let mut printer = Printer::default();
        let mut kept: Vec<Job> = Vec::new();
        for _ in 0..25 {
            let mut bridge = Bridge::start(&mut board, &flash);
            let found = bridge.stored();
            let same = |kept: &[Job]| {
                found.iter().map(|(id, data)| (*id, data)).eq(kept.iter().map(|job| (job.id, &job.data)))
            };
            assert!(same(&kept), "what is stored outlives the supply");
            // In the middle of an operation of the flash, or between two.
            if random.random_bool(0.5) {
                flash.cut_after(random.random_range(0..40));
            }
            let mut moments = random.random_range(1..300);
            let mut deed;
            'deeds: loop {
                number += 1;
                deed = match random.random_range(0..8) {
                    0 | 1 => Deed::Store,
                    2..=4 if !kept.is_empty() => Deed::Button,
                    5 if !kept.is_empty() => Deed::Command,
                    6 if kept.len() > 1 => Deed::Delete,
                    7 => Deed::Link,
                    _ => Deed::Store,
                };
                let fresh = Job::random(number, &mut random);
                let length = fresh.data.len() as u32;
                let which = random.random_range(0..kept.len().max(1));
                let (id, expected) = match deed {
                    Deed::Store => {
                        if length > bridge.alone.store().room() {
                            continue;
                        }
                        bridge.tell(ToBridge::Store { job: number, kind: fresh.kind, length, name: "job" });
                        (number, Vec::new())
                    }
                    Deed::Button => {
                        bridge.engine.press(Press::Short);
                        (ALONE, kept.last().unwrap().expected.clone())
                    }
                    Deed::Command => {
                        bridge.tell(ToBridge::PrintStored { job: number, stored: kept[which].id });
                        (number, kept[which].expected.clone())
                    }
                    Deed::Link => {
                        bridge.tell(ToBridge::Begin { job: number, kind: fresh.kind, length });
                        (number, fresh.expected.clone())
                    }
                    Deed::Delete => {
                        bridge.tell(ToBridge::DeleteStored { request: 1, stored: kept[which].id });
                        (0, Vec::new())
                    }
                };
                let cancel_at = random.random_bool(0.15).then(|| random.random_range(0..4000));
                let mut is_cancelled = false;
                loop {
                    let more = bridge.poll();
                    moments -= 1;
                    if flash.is_off() || moments == 0 {
                        break 'deeds;
                    }
                    if deed == Deed::Delete {
                        if !more {
                            kept.remove(which);
                            break;
                        }
                        continue;
                    }
                    if matches!(deed, Deed::Store | Deed::Link) {
                        bridge.send(id, &fresh.data, random.random_range(1..960));
                    }
                    for _ in 0..random.random_range(0..40) {
                        bridge.engine.work();
                    }
                    if cancel_at.is_some_and(|at| printer.since.len() >= at)
                        && !is_cancelled
                        && bridge.progress().job == id
                    {
                        is_cancelled = true;
                        bridge.engine.press(Press::Long);
                    } else if random.random_ratio(1, 200) && bridge.engine.open_job() == Some(id) {
                        bridge.engine.press(Press::Short);
                        if matches!(bridge.progress().state, JobState::Stopped(Fault::Held)) {
                            assert!(bridge.engine.output().is_empty());
                            bridge.engine.press(Press::Short);
                        }
                    }
                    printer.serve(&mut bridge.engine, random.random_range(0..3000));
                    // The board restarts by itself now and then. Only a job of the link waits for its host
                    // then.
                    if random.random_ratio(1, 300) && deed != Deed::Link {
                        warm += 1;
                        let before = bridge.engine.checkpoint();
                        bridge = Bridge::restart(&mut board, &flash, before);
                        if is_cancelled && bridge.engine.open_job() == Some(id) {
                            bridge.engine.press(Press::Long);
                        }
                    }
                    let Progress { job, state, .. } = bridge.progress();
                    if job != id || bridge.engine.open_job().is_some() {
                        continue;
                    }
                    match (deed, state) {
                        (Deed::Store, JobState::Stored) => kept.push(fresh),
                        (Deed::Store, JobState::Cancelled) => {}
                        (_, JobState::Done) => {
                            assert!(printer.since == expected, "{deed:?}: every byte has crossed, once");
                            printed += 1;
                        }
                        (_, JobState::Cancelled) => {
                            assert!(
                                is_cancelled && (printer.since.is_empty() || is_a_whole_job(&printer.since))
                            );
                            cancelled += 1;
                        }
                        (deed, state) => panic!("{deed:?} has ended as {state:?}"),
                    }
                    printer.since.clear();
                    // The note that it has ended.
                    while bridge.poll() {}
                    if flash.is_off() {
                        break 'deeds;
                    }
                    break;
                }
            }
            // The supply of the bridge goes, that of the printer stays.
            cuts += 1;
            cut_while[deed as usize] += 1;
            flash.power_up();
            let half = std::mem::take(&mut printer.since);
            let mut again = Bridge::start(&mut board, &flash);
            let found = again.stored();
            match deed {
                Deed::Delete => kept.retain(|job| found.iter().any(|(id, _)| *id == job.id)),
                Deed::Store if found.len() > kept.len() => {
                    // It was the last one, and it is whole: the comparison above says so of all others.
                    let (id, data) = found.last().unwrap().clone();
                    assert_eq!(id, number);
                    // What it prints is found by printing it with a new board of its own.
                    let expected = print_once(&data, found_kind(&again, id));
                    kept.push(Job { id, kind: found_kind(&again, id), data, expected });
                }
                _ => {}
            }
            if !half.is_empty() {
                assert_eq!(again.progress().state, JobState::Lost, "{deed:?}");
                assert!(matches!(again.engine.standing(), Standing::Unknown { .. }));
            }
            printer.since = half;
            let lost = printer.lost.len();
            // Whatever comes next comes behind a reset.
            again.engine.local(b"plain text");
            again.engine.local_end();
            for _ in 0..4 {
                while again.poll() | again.engine.work() {}
                printer.serve(&mut again.engine, 1000);
            }
            assert_eq!(std::mem::take(&mut printer.since), b"plain text", "{deed:?}: into a part of a sheet");
            sheets_lost += printer.lost.len() - lost;
        }
    }
    println!("{printed} printed, {sheets_lost} lost, {cancelled} cancelled, {warm} restarts, {cut_while:?}");
    assert!(printed > 300 && sheets_lost > 100 && cancelled > 50 && warm > 100);
    assert!(cut_while.iter().take(4).all(|&count| count > 50), "{cut_while:?}");
}

fn found_kind(bridge: &Bridge<'_>, id: u32) -> JobKind {
    bridge.alone.store().jobs().iter().find(|stored| stored.job == id).unwrap().kind
}

/// What the engine makes of this job when it comes over the link.
fn print_once(data: &[u8], kind: JobKind) -> Vec<u8> {
    let job = Job { id: 1, kind, data: data.to_vec(), expected: Vec::new() };
    model::run(&job, &model::NONE, None, &mut seeded(1)).printed
}

/// Polls until nothing moves any more, the printer taking everything.
fn settle(bridge: &mut Bridge<'_>, printer: &mut Printer) {
    for _ in 0..200 {
        while bridge.poll() | bridge.engine.work() {}
        printer.serve(&mut bridge.engine, usize::MAX);
    }
}

fn store(bridge: &mut Bridge<'_>, printer: &mut Printer, job: &Job) {
    let length = job.data.len() as u32;
    bridge.tell(ToBridge::Store { job: job.id, kind: job.kind, length, name: &format!("sheet {}", job.id) });
    bridge.poll();
    while bridge.engine.open_job() == Some(job.id) {
        bridge.send(job.id, &job.data, DATA_MAX);
        while bridge.poll() {}
    }
    settle(bridge, printer);
    assert_eq!(bridge.progress().state, JobState::Stored);
    assert!(printer.since.is_empty(), "nothing of it goes to the printer");
}

fn jobs(random: &mut ChaCha8Rng) -> [Job; 2] {
    [Job::random(101, random), Job::random(102, random)]
}

#[test]
fn the_host_stores_lists_prints_and_deletes() {
    let mut random = seeded(22);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let [first, second] = jobs(&mut random);
    let total = bridge.alone.store().total();
    let ask = |bridge: &mut Bridge<'_>, message: ToBridge<'_>| {
        bridge.hear();
        bridge.tell(message);
        while bridge.poll() {}
        bridge.hear()
    };
    fn told(count: u8, room: u32, total: u32, job: Option<StoredJob<'_>>) -> String {
        format!("{:?}", ToHost::Stored { request: 9, count, room, total, job })
    }
    assert_eq!(
        ask(&mut bridge, ToBridge::ListStored { request: 9, index: 0 }),
        [told(0, total, total, None)]
    );
    store(&mut bridge, &mut printer, &first);
    store(&mut bridge, &mut printer, &second);
    let room = bridge.alone.store().room();
    assert!(room < total);
    let of = |job: &Job| (job.id, job.kind, job.data.len() as u32);
    for (index, (job, kind, length)) in [(0, of(&first)), (1, of(&second))] {
        let name = format!("sheet {job}");
        let expected = told(2, room, total, Some(StoredJob { job, kind, length, name: &name }));
        assert_eq!(ask(&mut bridge, ToBridge::ListStored { request: 9, index }), [expected]);
    }
    assert_eq!(ask(&mut bridge, ToBridge::ListStored { request: 9, index: 2 }), [told(2, room, total, None)]);

    // The first one, twice; a question that is repeated prints nothing more.
    for id in [501, 502] {
        for _ in 0..3 {
            bridge.tell(ToBridge::PrintStored { job: id, stored: first.id });
            settle(&mut bridge, &mut printer);
        }
        assert_eq!(std::mem::take(&mut printer.since), first.expected);
        assert_eq!((bridge.progress().job, bridge.progress().state), (id, JobState::Done));
    }
    // A printer of which nothing was known was reset before the first, and before no other.
    assert_eq!(printer.resets, 1);
    let past: Vec<PastJob> = bridge.engine.checkpoint().past.iter().copied().take(4).collect();
    let ends: Vec<(u32, JobState)> = past.iter().map(|past| (past.job, past.state)).collect();
    use JobState::{Done, Stored};
    assert_eq!(ends, [(502, Done), (501, Done), (second.id, Stored), (first.id, Stored)]);

    let refused = |reason, job| vec![format!("{:?}", ToHost::Refused { reason, job })];
    assert_eq!(
        ask(&mut bridge, ToBridge::DeleteStored { request: 9, stored: 77 }),
        refused(Refusal::NoSuchJob, 77)
    );
    let said = ask(&mut bridge, ToBridge::PrintStored { job: 503, stored: 77 });
    assert_eq!(said[..1], refused(Refusal::NoSuchJob, 77));
    let large = ToBridge::Store { job: 504, kind: JobKind::Raw, length: room + 1, name: "large" };
    assert_eq!(ask(&mut bridge, large)[..1], refused(Refusal::NoRoom, 504));
    assert_eq!(bridge.engine.open_job(), None);

    assert_eq!(ask(&mut bridge, ToBridge::DeleteStored { request: 9, stored: first.id }).len(), 1);
    assert_eq!(bridge.stored(), [(second.id, second.data.clone())]);
    let mut other = Board::new(2048, 4096);
    assert_eq!(Bridge::start(&mut other, &flash).stored(), [(second.id, second.data)]);
}

#[test]
fn a_job_that_is_being_printed_is_neither_deleted_nor_printed_again_nor_joined_by_another() {
    let mut random = seeded(23);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let [first, second] = jobs(&mut random);
    store(&mut bridge, &mut printer, &first);
    bridge.engine.press(Press::Short);
    bridge.poll();
    for message in [
        ToBridge::DeleteStored { request: 1, stored: first.id },
        ToBridge::PrintStored { job: 9, stored: first.id },
        ToBridge::Store { job: 10, kind: second.kind, length: second.data.len() as u32, name: "x" },
        ToBridge::Begin { job: 11, kind: second.kind, length: second.data.len() as u32 },
        // Nobody else's data either.
        ToBridge::Data { job: ALONE, offset: bridge.progress().accepted, bytes: &[1; 50] },
    ] {
        bridge.hear();
        bridge.tell(message);
        bridge.poll();
        let said = bridge.hear().join("\n");
        let refused = said.contains("JobOpen");
        assert!(refused || matches!(message, ToBridge::Data { .. }), "{message:?}: {said}");
    }
    settle(&mut bridge, &mut printer);
    assert_eq!(printer.since, first.expected);
    assert_eq!(bridge.stored().len(), 1);
}

#[test]
fn the_button_starts_holds_goes_on_and_cancels() {
    let mut random = seeded(24);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    // With nothing to start.
    bridge.engine.press(Press::Short);
    settle(&mut bridge, &mut printer);
    bridge.engine.press(Press::Long);
    settle(&mut bridge, &mut printer);
    assert_eq!((bridge.engine.open_job(), printer.since.len()), (None, 0));

    let [first, second] = jobs(&mut random);
    store(&mut bridge, &mut printer, &first);
    store(&mut bridge, &mut printer, &second);
    bridge.engine.press(Press::Short);
    while printer.since.len() < second.expected.len() / 2 {
        while bridge.poll() | bridge.engine.work() {}
        printer.serve(&mut bridge.engine, 100);
    }
    bridge.engine.press(Press::Short);
    assert_eq!(bridge.progress().state, JobState::Stopped(Fault::Held));
    let before = printer.since.len();
    settle(&mut bridge, &mut printer);
    assert_eq!(printer.since.len(), before, "nothing crosses while it is held");
    bridge.engine.press(Press::Short);
    settle(&mut bridge, &mut printer);
    assert_eq!(std::mem::take(&mut printer.since), second.expected);

    // Again, and cancelled while it is held: a whole job for the printer.
    bridge.engine.press(Press::Short);
    while printer.since.len() < second.expected.len() / 2 {
        while bridge.poll() | bridge.engine.work() {}
        printer.serve(&mut bridge.engine, 100);
    }
    bridge.engine.press(Press::Short);
    bridge.engine.press(Press::Long);
    settle(&mut bridge, &mut printer);
    assert_eq!(bridge.progress().state, JobState::Cancelled);
    assert!(is_a_whole_job(&printer.since) && printer.since.len() < second.expected.len());
    assert_eq!(bridge.stored().len(), 2);
}

#[test]
fn a_reset_that_is_owed_outlives_the_supply_and_comes_before_anything_else() {
    let mut random = seeded(25);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let [first, second] = jobs(&mut random);
    // A job of the link is lost with the printer's supply, and then the bridge loses its own.
    bridge.tell(ToBridge::Begin { job: 7, kind: first.kind, length: first.data.len() as u32 });
    while printer.since.is_empty() {
        bridge.send(7, &first.data, 500);
        while bridge.poll() | bridge.engine.work() {}
        printer.serve(&mut bridge.engine, 100);
    }
    bridge.engine.port(Lines(0), Some(Fault::PowerOff));
    assert_eq!(bridge.progress().state, JobState::Lost);
    while bridge.poll() {}
    drop(bridge);
    let mut bridge = Bridge::start(&mut board, &flash);
    assert_eq!(bridge.engine.standing(), Standing::Unknown { job: 7, due: false });
    bridge.tell(ToBridge::Begin { job: 8, kind: second.kind, length: second.data.len() as u32 });
    while bridge.engine.open_job() == Some(8) {
        bridge.send(8, &second.data, 500);
        while bridge.poll() | bridge.engine.work() {}
        printer.serve(&mut bridge.engine, 100);
    }
    // Before the first one, since nothing was known, and behind its loss.
    assert_eq!((printer.resets, printer.since), (2, second.expected));
    while bridge.poll() {}
    drop(bridge);
    assert_eq!(Bridge::start(&mut board, &flash).engine.standing(), Standing::AtRest, "the reset was done");
}

#[test]
fn a_page_that_flash_has_forgotten_ends_the_sheet_properly() {
    let mut random = seeded(26);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(80, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let job = loop {
        let job = Job::random(5, &mut random);
        if job.data.len() > 6000 {
            break job;
        }
    };
    store(&mut bridge, &mut printer, &job);
    // In its second sector.
    let place = flash
        .bytes()
        .windows(64)
        .position(|bytes| job.data.windows(64).nth(17 * PAGE_DATA + 10).unwrap() == bytes);
    flash.flip(place.expect("the job's data are in the flash as they are"), 3);
    bridge.engine.press(Press::Short);
    settle(&mut bridge, &mut printer);
    let state = bridge.progress().state;
    assert!(matches!(state, JobState::Broken(defect) if defect.what == DefectKind::Truncated), "{state:?}");
    assert!(printer.since.is_empty() || is_a_whole_job(&printer.since));
}

#[test]
fn flash_that_is_worn_out_refuses_the_job_and_says_why() {
    let mut random = seeded(27);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(8, &mut random));
    let mut bridge = Bridge::start(&mut board, &flash);
    flash.wear_out(2 * 4096);
    bridge.tell(ToBridge::Store { job: 5, kind: JobKind::Raw, length: 500, name: "x" });
    bridge.poll();
    bridge.send(5, &[1; 500], 500);
    while bridge.poll() {}
    let state = bridge.progress().state;
    assert!(matches!(state, JobState::Broken(defect) if defect.what == DefectKind::Flash), "{state:?}");
}

#[test]
fn a_board_without_an_area_says_so() {
    let mut board = Board::new(2048, 4096);
    let mut engine = Engine::new(board.memory(), IDENTITY);
    let mut alone = Alone::open(NoFlash, &mut engine, false);
    let (mut reader, mut buffer) = (Reader::new(), [0; MAX]);
    let list = framed(&ToBridge::ListStored { request: 3, index: 0 });
    engine.receive(&mut reader, &list);
    while alone.poll(&mut engine, 0) {}
    let length = engine.transmit(&mut buffer);
    let mut reader = Reader::new();
    let Read::Message(bytes, []) = reader.read(&buffer[..length]) else { panic!("not a frame") };
    let expected = ToHost::Stored { request: 3, count: 0, room: 0, total: 0, job: None };
    assert_eq!(frame::decode::<ToHost>(bytes), Ok(expected));
}

/// The data of a drawn sheet.
fn drawn(kind: JobKind, random: &mut ChaCha8Rng) -> Vec<u8> {
    let planes = model::Planes::random(random);
    if kind == JobKind::Raw { planes.printed() } else { planes.streams() }
}

#[test]
fn a_stored_job_whose_first_page_has_changed_is_broken_and_not_done() {
    let mut random = seeded(31);
    for kind in [JobKind::Raw, JobKind::Streams] {
        let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
        let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
        let data = drawn(kind, &mut random);
        let start = data[..data.len().min(100)].to_vec();
        store(&mut bridge, &mut printer, &Job { id: 101, kind, data, expected: Vec::new() });
        let at = flash.bytes().windows(start.len()).position(|piece| piece == start).expect("it is there");
        flash.flip(at, 3);
        bridge.tell(ToBridge::PrintStored { job: 501, stored: 101 });
        settle(&mut bridge, &mut printer);
        let Progress { job, state, printed, .. } = bridge.progress();
        assert!(job == 501 && matches!(state, JobState::Broken(_)) && printed == 0, "{kind:?}: {state:?}");
        assert!(printer.since.is_empty());
    }
}

/// The board restarts while it prints from its flash, and finds the job gone from there, or half of it: the
/// job ends, and what the printer has of it is followed by a reset.
#[test]
fn a_stored_job_that_a_restart_does_not_find_again_ends_and_the_printer_is_reset() {
    let mut random = seeded(33);
    for (kind, most) in
        [(JobKind::Raw, 0), (JobKind::Raw, 300_usize), (JobKind::Streams, 0), (JobKind::Streams, 300)]
    {
        for gone in [true, false] {
            let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
            let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
            let data = drawn(kind, &mut random);
            let start = data[..data.len().min(100)].to_vec();
            store(&mut bridge, &mut printer, &Job { id: 101, kind, data, expected: Vec::new() });
            bridge.tell(ToBridge::PrintStored { job: 501, stored: 101 });
            for _ in 0..200 {
                bridge.poll();
                bridge.engine.work();
                let left = most.saturating_sub(printer.since.len());
                printer.serve(&mut bridge.engine, left);
            }
            assert_eq!((bridge.progress().job, printer.since.len()), (501, most), "{kind:?}");
            let before = bridge.engine.checkpoint();
            if gone {
                // Its record in the diary has aged.
                (0..2 * 4096).step_by(32).for_each(|byte| flash.flip(byte, 0));
            } else {
                let at = flash.bytes().windows(start.len()).position(|piece| piece == start).expect("there");
                flash.flip(at, 3);
            }
            let mut board = Board::new(2048, 4096);
            let mut bridge = Bridge::restart(&mut board, &flash, before);
            let resets = printer.resets;
            settle(&mut bridge, &mut printer);
            assert!(matches!(bridge.progress().state, JobState::Broken(_)), "{:?}", bridge.progress());
            assert_eq!(printer.resets - resets, usize::from(most > 0), "{kind:?}, {most} bytes had crossed");
            assert_eq!(bridge.engine.standing(), Standing::AtRest);
        }
    }
}

#[test]
fn a_plain_job_that_the_loss_of_the_supply_cuts_in_two_leaves_a_note() {
    let mut random = seeded(32);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(40, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let stream = model::Planes::random(&mut random).printed();
    for piece in stream[..stream.len() / 2].chunks(64) {
        bridge.engine.local(piece);
        settle(&mut bridge, &mut printer);
    }
    let mut other = Board::new(2048, 4096);
    let again = Bridge::start(&mut other, &flash);
    assert!(matches!(again.engine.standing(), Standing::Unknown { job: LOCAL, .. }), "whatever comes next");
    // One that has come to its end leaves none.
    for piece in stream[stream.len() / 2..].chunks(64) {
        bridge.engine.local(piece);
        settle(&mut bridge, &mut printer);
    }
    assert_eq!(bridge.progress().state, JobState::Done);
    let mut other = Board::new(2048, 4096);
    assert_eq!(Bridge::start(&mut other, &flash).engine.standing(), Standing::AtRest);
}

/// A store cannot be resumed, and all others wait for it.
#[test]
fn a_store_whose_host_says_nothing_of_it_for_thirty_seconds_is_dropped() {
    let mut random = seeded(33);
    let (mut board, flash) = (Board::new(2048, 4096), ModelFlash::new(60, &mut random));
    let (mut bridge, mut printer) = (Bridge::start(&mut board, &flash), Printer::default());
    let [first, _] = jobs(&mut random);
    let store = || ToBridge::Store { job: 5, kind: first.kind, length: first.data.len() as u32, name: "x" };
    let mut now = 7;
    bridge.tell(store());
    bridge.alone.poll(&mut bridge.engine, now);
    // A host that is slow, and one that has nothing new to say, live.
    for round in 0..6 {
        now += SILENCE_US - 1;
        bridge.alone.poll(&mut bridge.engine, now);
        assert_eq!(bridge.progress().state, JobState::Storing, "round {round}");
        match round % 2 {
            0 => bridge.send(5, &first.data, 50),
            _ => bridge.tell(store()),
        }
        // Another one's words do not count.
        bridge.tell(ToBridge::Begin { job: 9, kind: JobKind::Raw, length: 9 });
        bridge.alone.poll(&mut bridge.engine, now);
    }
    for at in [now + SILENCE_US / 2, now + SILENCE_US - 1] {
        bridge.tell(ToBridge::Begin { job: 9, kind: JobKind::Raw, length: 9 });
        bridge.alone.poll(&mut bridge.engine, at);
        assert_eq!(bridge.engine.local(b"text"), 0, "everybody waits");
    }
    bridge.alone.poll(&mut bridge.engine, now + SILENCE_US);
    assert_eq!((bridge.progress().state, bridge.engine.open_job()), (JobState::Cancelled, None));
    assert_eq!(bridge.engine.local(b"text"), 4);
    bridge.engine.local_end();
    settle(&mut bridge, &mut printer);
    assert_eq!((&printer.since[..], bridge.stored().len()), (&b"text"[..], 0));
}
