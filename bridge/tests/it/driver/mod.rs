//! The port's driver on simulated pins in virtual time, between the engine and a printer. What the subjects share stands here.

mod device_id;
mod jobs;
mod port;
mod questions;
mod supply;

use bridge::driver::Event;
use bridge::port::Timing;
use bridge::simulation::{Line, Peripheral, Response};
use model::Host;
use model::bench::Bench;
use protocol::link::message::{Answer, Handshake, JobKind, PortSettings, ToBridge};

/// A device ID.
const ID: &[u8] = b"\x00\x0cMFG:ALPS;;";

fn status() -> Vec<u8> {
    let mut answer = vec![0x02, 0x80, 0x21, 0x00, 0x10];
    answer.extend([0xff, 0, 0].repeat(9));
    answer.extend([0, 0, 0, 0, 0, 0x03]);
    answer
}

fn text(answer: Answer<'_>) -> String {
    format!("{answer:?}").trim_end_matches(" }").to_owned()
}

/// A printer that answers the status question with these pieces.
fn answering(status: Vec<Response>) -> Peripheral {
    Peripheral { status, ..Peripheral::default() }
}

/// A printer that has this device ID.
fn introducing(id: &[u8]) -> Peripheral {
    Peripheral { device_id: Some(id.to_vec()), ..Peripheral::default() }
}

/// What a host has to say arrives at the bridge.
fn speak(bench: &mut Bench<'_>, host: &mut Host<'_>) {
    for frame in host.speak() {
        bench.engine.receive(&mut bench.reader, &frame);
    }
}

/// So many turns of the bridge, and what it says in them arrives at a host.
fn hear(bench: &mut Bench<'_>, host: &mut Host<'_>, turns: usize) {
    for _ in 0..turns {
        bench.turn();
    }
    host.hear(&bench.transmitted());
}

/// Opens a raw job of these bytes, and sends all of them at once.
fn send(bench: &mut Bench<'_>, job: u32, bytes: &[u8]) {
    bench.tell(&ToBridge::Begin { job, kind: JobKind::Raw, length: bytes.len() as u32 });
    for (i, piece) in bytes.chunks(900).enumerate() {
        bench.tell(&ToBridge::Data { job, offset: i as u32 * 900, bytes: piece });
    }
}

/// Bytes in no language, which pass through as they are.
fn foreign(count: usize) -> Vec<u8> {
    (0..count).map(|i| b'a' + (i % 26) as u8).collect()
}

fn settings(handshake: Handshake, timing: Timing) -> PortSettings {
    PortSettings { handshake, ..timing.settings() }
}

fn events(bench: &Bench<'_>) -> Vec<Event> {
    bench.board.events().into_iter().filter(|event| !matches!(event, Event::Job(_))).collect()
}

fn negotiations(bench: &Bench<'_>) -> usize {
    let (mut selected, mut count) = (true, 0);
    for edge in bench.cable.edges() {
        match edge.line {
            Line::SelectIn => selected = edge.level == 0,
            // Event 1 of IEEE 1284.
            Line::AutoFeed if edge.level == 0 && !selected => count += 1,
            _ => {}
        }
    }
    count
}
