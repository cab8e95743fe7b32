//! What is kept over restarts: any memory and any flash leave a bridge that starts, prints the next job, and reads back what it stores.
//!
//! The input fills the slots of the checkpoints and some sectors of the flash; records of both get right checksums as often as not, since chance
//! does not hit those.

use arbitrary::{Result, Unstructured};
use bridge::alone::Alone;
use bridge::checkpoint::{self, CheckpointStore, MARKS, PAST_SLOT, SLOT};
use bridge::engine::{Engine, Identity, Memory, Outcome};
use bridge::store::{Flash, Next, PAGE_DATA, SECTOR, Store};
use protocol::link::frame::{Reader, checksum};
use protocol::link::message::{JobKind, JobState, Lines, ToBridge};
use protocol::runs::Decoder;
use std::cell::RefCell;
use std::ops::Range;

const SECTORS: usize = 8;

/// A memory and a flash.
pub fn check(bytes: &[u8]) {
    let mut script = Unstructured::new(bytes);
    let memory = Retained::new(&mut script);
    let flash = RefCell::new(flash(&mut script));
    let (mut checkpoints, checkpoint) = CheckpointStore::new(memory, true);

    let (mut data, mut output, mut band, mut decoder) = ([0; 2100], [0; 2048], [0; 2048], Decoder::default());
    let memory = Memory { data: &mut data, output: &mut output, band: &mut band, decoder: &mut decoder };
    let identity = Identity { boot: 1, serial: 2, firmware: "0.1.0" };
    let mut engine = match checkpoint {
        Some(checkpoint) => Engine::resume(memory, identity, checkpoint),
        None => Engine::new(memory, identity),
    };
    let mut alone = Alone::open(Chip(&flash), &mut engine, checkpoint.is_some());
    for stored in alone.store().jobs() {
        read(alone.store(), *stored);
    }
    engine.port(Lines::IDLE, None);
    checkpoints.store(engine.checkpoint(), checkpoints.place());

    // Whatever was there: once it is given up, a job goes through.
    let mut reader = Reader::new();
    let mut tell = |engine: &mut Engine<'_>, message: &ToBridge<'_>| {
        let mut body = [0; 1100];
        let body = protocol::link::frame::write(message, &mut body).map(|length| body[..length].to_vec());
        engine.receive(&mut reader, &body.expect("it fits a frame"));
    };
    let open = engine.progress().job;
    // A host repeats itself: the bridge may have a reset to do first.
    for _ in 0..2 {
        tell(&mut engine, &ToBridge::Abandon { job: open });
        run(&mut engine, &mut checkpoints, &mut alone);
    }
    let job = 0x00c0_ffee;
    tell(&mut engine, &ToBridge::Begin { job, kind: JobKind::Raw, length: 3 });
    tell(&mut engine, &ToBridge::Data { job, offset: 0, bytes: b"abc" });
    run(&mut engine, &mut checkpoints, &mut alone);
    let taken = engine.checkpoint().past.iter().any(|past| past.job == job) || open == job;
    assert!(taken || engine.progress().state == JobState::Done, "{:?}", engine.progress());

    stores(Chip(&flash));
}

/// The board does what it is told, and the printer takes everything.
fn run(engine: &mut Engine<'_>, checkpoints: &mut CheckpointStore<Retained>, alone: &mut Alone<Chip<'_>>) {
    for _ in 0..200 {
        engine.port(Lines::IDLE, None);
        bridge::turn::work(engine, || 0);
        alone.poll(engine, 0);
        if engine.task().is_some() {
            engine.done(Outcome::Done);
        }
        let count = engine.output().len().min(100);
        engine.consumed(count);
        for sent in 0..count {
            checkpoints.mark(sent);
        }
        checkpoints.store(engine.checkpoint(), (checkpoints.place() + count) % MARKS);
    }
}

/// A job is stored and read back, over a restart, or there is no room for it.
fn stores(flash: Chip<'_>) {
    let bytes: Vec<u8> = (0..3_000u32).map(|at| (at % 249) as u8).collect();
    let mut store = Store::open(flash);
    if !store.begin(0x00c0_ffee, JobKind::Raw, bytes.len() as u32, "job") {
        return;
    }
    let mut at = 0;
    for _ in 0..10_000 {
        let count = store.wants().min(bytes.len() - at);
        match store.put(&bytes[at..at + count]) {
            Ok(true) => {
                let again = Store::open(flash);
                let stored = again.jobs().iter().copied().find(|stored| stored.job == 0x00c0_ffee);
                let stored = stored.expect("what was stored is there after a restart");
                assert!(read(&again, stored).as_deref() == Some(&bytes), "other bytes");
                return;
            }
            Ok(false) => at += count,
            Err(_) => panic!("this flash keeps what is written"),
        }
    }
    panic!("storing does not end");
}

/// All of a job, if the flash still holds it.
fn read<F: Flash>(store: &Store<F>, stored: bridge::store::Stored) -> Option<Vec<u8>> {
    let (mut reading, mut bytes) = (store.read(&stored), Vec::new());
    for _ in 0..100_000 {
        let mut page = [0; PAGE_DATA];
        match store.next(&mut reading, &mut page) {
            Next::Bytes(count) => bytes.extend_from_slice(&page[..count]),
            Next::Later => {}
            Next::Damaged => return None,
            Next::End => return Some(bytes),
        }
    }
    panic!("reading does not end");
}

/// Sectors of anything, among them records as the store writes them. Numbers stay below those that a flash wears out before.
fn flash(script: &mut Unstructured<'_>) -> Vec<u8> {
    let mut bytes = vec![0xff; SECTORS * SECTOR as usize];
    while !script.is_empty() && record(&mut bytes, script).is_ok() {}
    bytes
}

fn record(flash: &mut [u8], script: &mut Unstructured<'_>) -> Result<()> {
    let sector = script.int_in_range(0..=SECTORS - 1)? * SECTOR as usize;
    let small = |script: &mut Unstructured<'_>| -> Result<u32> {
        if script.ratio(7u8, 8u8)? {
            script.int_in_range(0..=4)
        } else {
            script.int_in_range(0..=0x3fff_ffff)
        }
    };
    let (id, length) = (small(script)?, small(script)?);
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let (at, mut record) = match script.int_in_range(0..=3u8)? {
        // The head of a sector: kind, name, then the job's number in the store, place, sequence, the job's number, length.
        0 => {
            let mut head = [&b"\0\0\0\0F1"[..], script.bytes(2)?].concat();
            head.extend(words(&[id, small(script)?, small(script)?, small(script)?, length]));
            head.resize(64, b'n');
            (sector, head)
        }
        // What makes it count.
        1 => (sector + 256, words(&[0, id, length])),
        // A record of the printer log.
        2 => {
            let at = script.int_in_range(0..=100usize)? * 20;
            let numbers = [0, small(script)?, script.int_in_range(0..=3)?, id, length];
            (sector % (2 * SECTOR as usize) + at, words(&numbers))
        }
        _ => {
            let length = script.int_in_range(0..=64)?.min(script.len());
            (sector + script.int_in_range(0..=4032usize)?, [&[0; 4], script.bytes(length)?].concat())
        }
    };
    if script.ratio(15u8, 16u8)? {
        let sum = checksum(&record[4..]).to_le_bytes();
        record[..4].copy_from_slice(&sum);
    }
    let end = (at + record.len()).min(flash.len());
    flash[at..end].copy_from_slice(&record[..end - at]);
    Ok(())
}

/// Clones are the same flash.
#[derive(Clone, Copy)]
struct Chip<'f>(&'f RefCell<Vec<u8>>);

impl Flash for Chip<'_> {
    fn size(&self) -> u32 {
        self.0.borrow().len() as u32
    }

    fn read(&self, at: u32, out: &mut [u8]) {
        let bytes = self.0.borrow();
        for (at, out) in (at as usize..).zip(out) {
            *out = bytes.get(at).copied().unwrap_or(0xff);
        }
    }

    fn program(&mut self, at: u32, bytes: &[u8]) {
        let mut flash = self.0.borrow_mut();
        for (flash, byte) in flash[at as usize..].iter_mut().zip(bytes) {
            *flash &= byte;
        }
    }

    fn erase(&mut self, sector: u32) {
        let at = (sector * SECTOR) as usize;
        self.0.borrow_mut()[at..at + SECTOR as usize].fill(0xff);
    }
}

struct Retained {
    slots: [[u8; SLOT]; 2],
    past: [[u8; PAST_SLOT]; 2],
    marks: Vec<bool>,
}

impl Retained {
    fn new(script: &mut Unstructured<'_>) -> Retained {
        let mut slots: [[u8; SLOT]; 2] = script.arbitrary().unwrap_or([[0; SLOT]; 2]);
        slots.iter_mut().for_each(|slot| seal(slot));
        let mut past = [[0; PAST_SLOT]; 2];
        for slot in &mut past {
            let length = slot.len().min(script.len());
            slot[..length].copy_from_slice(script.bytes(length).unwrap_or(&[0; PAST_SLOT][..length]));
            seal(slot);
        }
        let marked = script.int_in_range(0..=MARKS).unwrap_or(0);
        Retained { slots, past, marks: (0..MARKS).map(|at| at < marked).collect() }
    }
}

/// Gives a slot its checksum, which stands in its first four bytes.
fn seal(slot: &mut [u8]) {
    let sum = checksum(&slot[4..]).to_le_bytes();
    slot[..4].copy_from_slice(&sum);
}

impl checkpoint::Memory for Retained {
    fn slots(&self) -> [[u8; SLOT]; 2] {
        self.slots
    }

    fn write(&mut self, which: usize, slot: [u8; SLOT]) {
        self.slots[which] = slot;
    }

    fn past(&self) -> [[u8; PAST_SLOT]; 2] {
        self.past
    }

    fn write_past(&mut self, which: usize, slot: [u8; PAST_SLOT]) {
        self.past[which] = slot;
    }

    fn is_marked(&self, at: usize) -> bool {
        self.marks[at]
    }

    fn mark(&mut self, at: usize) {
        self.marks[at] = true;
    }

    fn clear(&mut self, places: Range<usize>) {
        self.marks[places].fill(false);
    }
}
