//! The engine on a good link: what it answers, what it refuses, how it ends a job. What the subjects share stands here.

mod conversation;
mod jobs;
mod plain;
mod printer;

use bridge::engine::Engine;
use model::{IDENTITY, Planes, framed, memory, rested, seeded};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{DATA_MAX, JobKind, JobState, Progress, Refusal, ToBridge, ToHost};

struct Rig {
    engine: Engine<'static>,
    reader: Reader,
    printed: Vec<u8>,
}

/// What the engine said, as owned text, and the last progress.
#[derive(Debug, PartialEq)]
struct Said {
    text: Vec<String>,
    progress: Option<Progress>,
}

impl Rig {
    /// A bridge whose diary says that the printer stands between two jobs.
    fn new() -> Rig {
        Rig::with(rested(memory(2048, 4096, 40_000), IDENTITY))
    }

    fn with(engine: Engine<'static>) -> Rig {
        Rig { engine, reader: Reader::new(), printed: Vec::new() }
    }

    /// The bridge after a reset.
    fn restarted(&self) -> Rig {
        Rig::with(Engine::resume(memory(2048, 2048, 40_000), IDENTITY, self.engine.checkpoint()))
    }

    fn tell(&mut self, message: ToBridge<'_>) -> Said {
        self.engine.receive(&mut self.reader, &framed(&message));
        self.said()
    }

    fn said(&mut self) -> Said {
        let (mut reader, mut buffer) = (Reader::new(), [0; MAX]);
        let mut said = Said { text: Vec::new(), progress: None };
        loop {
            let length = self.engine.transmit(&mut buffer);
            if length == 0 {
                return said;
            }
            let Read::Message(bytes, []) = reader.read(&buffer[..length]) else { panic!("not a frame") };
            let message = frame::decode::<ToHost>(bytes).unwrap();
            if let ToHost::Progress(progress) = message {
                said.progress = Some(progress);
            } else {
                said.text.push(format!("{message:?}"));
            }
        }
    }

    /// Opens a raw job, and sends so many bytes of its data.
    fn open(&mut self, job: u32, data: &[u8], count: usize) {
        self.tell(ToBridge::Begin { job, kind: JobKind::Raw, length: data.len() as u32 });
        self.tell(ToBridge::Data { job, offset: 0, bytes: &data[..count] });
    }

    /// Works and prints until nothing moves.
    fn print(&mut self) {
        loop {
            while self.engine.work() {}
            let bytes = self.engine.output();
            if bytes.is_empty() {
                return;
            }
            self.printed.extend_from_slice(bytes);
            let count = bytes.len();
            self.engine.consumed(count);
        }
    }

    /// Sends a whole job as fast as the credit allows.
    fn send(&mut self, id: u32, kind: JobKind, data: &[u8]) -> Progress {
        self.tell(ToBridge::Begin { job: id, kind, length: data.len() as u32 });
        for _ in 0..10_000 {
            let progress = self.engine.progress();
            if progress.job != id || !matches!(progress.state, JobState::Printing) {
                break;
            }
            let (from, to) = (progress.accepted, progress.limit.min(progress.accepted + DATA_MAX as u32));
            if from < to {
                let bytes = &data[from as usize..to as usize];
                self.tell(ToBridge::Data { job: id, offset: from, bytes });
            }
            self.print();
        }
        self.engine.progress()
    }
}

fn refused(reason: Refusal, job: u32) -> Vec<String> {
    vec![format!("{:?}", ToHost::Refused { reason, job })]
}

fn a_raw_job() -> Vec<u8> {
    Planes::random(&mut seeded(3)).printed()
}

/// Offers bytes as a printer interface does, again and again.
fn offer(rig: &mut Rig, mut bytes: &[u8], size: usize) {
    while !bytes.is_empty() {
        let taken = rig.engine.local(&bytes[..size.min(bytes.len())]);
        bytes = &bytes[taken..];
        rig.print();
        assert!(taken > 0 || !rig.engine.work(), "nothing moves");
    }
}
