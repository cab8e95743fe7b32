//! Two ways to one engine, and the engine's work in turns.

use bridge::engine::Engine;
use bridge::links::{Links, Way};
use bridge::turn::{self, Turn};
use model::{IDENTITY, framed, memory, rested, seeded};
use protocol::link::frame::MAX;
use protocol::link::message::{JobKind, JobState, ToBridge, VERSION};
use std::cell::Cell;

const HELLO: ToBridge<'_> = ToBridge::Hello { version: VERSION, schema: 0 };

fn engine() -> Engine<'static> {
    rested(memory(2048, 4096, 40_000), IDENTITY)
}

fn answers(engine: &mut Engine<'_>) -> usize {
    let mut frame = [0; MAX];
    core::iter::from_fn(|| (engine.transmit(&mut frame) > 0).then_some(())).count()
}

#[test]
fn the_way_that_spoke_last_is_answered() {
    let (mut links, mut engine) = (Links::new(), engine());
    assert_eq!(links.speaker(), None);
    for way in [Way::Serial, Way::Bulk, Way::Serial] {
        links.receive(way, &framed(&HELLO), &mut engine);
        assert_eq!(links.speaker(), Some(way));
        assert!(answers(&mut engine) > 0);
    }
}

#[test]
fn frames_of_two_ways_do_not_mix() {
    let (mut links, mut engine) = (Links::new(), engine());
    let data: Vec<u8> = (0..200).collect();
    let begin = framed(&ToBridge::Begin { job: 3, kind: JobKind::Raw, length: 200 });
    let piece = framed(&ToBridge::Data { job: 3, offset: 0, bytes: &data });
    links.receive(Way::Serial, &begin, &mut engine);
    // The other way breaks into the frame, with half a frame of its own.
    links.receive(Way::Serial, &piece[..90], &mut engine);
    links.receive(Way::Bulk, &[&framed(&HELLO)[..], &piece[..50]].concat(), &mut engine);
    links.receive(Way::Serial, &piece[90..], &mut engine);
    assert_eq!(engine.progress().accepted, 200);
}

#[test]
fn a_way_that_goes_takes_its_answers_with_it_and_the_job_stays() {
    let (mut links, mut engine) = (Links::new(), engine());
    let begin = framed(&ToBridge::Begin { job: 3, kind: JobKind::Raw, length: 200 });
    links.receive(Way::Bulk, &begin, &mut engine);
    // The other one goes: nothing changes.
    links.lost(Way::Serial, &mut engine);
    assert_eq!(links.speaker(), Some(Way::Bulk));
    links.receive(Way::Bulk, &framed(&HELLO)[..4], &mut engine);
    links.lost(Way::Bulk, &mut engine);
    assert_eq!(links.speaker(), None);
    links.receive(Way::Bulk, &[&[0], &framed(&HELLO)[..]].concat(), &mut engine);
    assert!(answers(&mut engine) > 0, "half a frame of before spoils the next one");
    assert_eq!(engine.progress().state, JobState::Printing);
}

#[test]
fn only_the_fall_of_data_terminal_ready_closes_the_serial_port() {
    let (mut links, mut engine) = (Links::new(), engine());
    links.receive(Way::Serial, &framed(&HELLO), &mut engine);
    // A host that never raises the line.
    links.data_terminal_ready(false, &mut engine);
    assert_eq!(links.speaker(), Some(Way::Serial));
    links.data_terminal_ready(true, &mut engine);
    links.data_terminal_ready(true, &mut engine);
    assert_eq!(links.speaker(), Some(Way::Serial));
    links.data_terminal_ready(false, &mut engine);
    assert_eq!((links.speaker(), answers(&mut engine)), (None, 0));
    // And does not disturb the other way.
    links.data_terminal_ready(true, &mut engine);
    links.receive(Way::Bulk, &framed(&HELLO), &mut engine);
    links.data_terminal_ready(false, &mut engine);
    assert_eq!(links.speaker(), Some(Way::Bulk));
}

#[test]
fn a_way_that_takes_no_frame_is_not_answered_any_more() {
    let (mut links, mut engine) = (Links::new(), engine());
    links.receive(Way::Serial, &framed(&HELLO), &mut engine);
    links.silence(Way::Serial, &mut engine);
    assert_eq!((links.speaker(), answers(&mut engine)), (None, 0));
    // What was written to a way that has spoken before, and fails when another one has: that one stays.
    links.receive(Way::Bulk, &framed(&HELLO), &mut engine);
    links.silence(Way::Serial, &mut engine);
    assert_eq!(links.speaker(), Some(Way::Bulk));
}

#[test]
fn a_turn_of_work_ends_with_its_time_or_with_the_work() {
    let planes = model::Planes::random(&mut seeded(5));
    let streams = planes.streams();
    let mut engine = engine();
    let (mut reader, now, slices) = (protocol::link::frame::Reader::new(), Cell::new(0u64), Cell::new(0));
    assert_eq!(
        turn::work(&mut engine, || now.get()),
        Turn { more: false, wake_port: false, wake_store: false }
    );
    let length = streams.len() as u32;
    engine.receive(&mut reader, &framed(&ToBridge::Begin { job: 3, kind: JobKind::Streams, length }));
    let bytes = &streams[..streams.len().min(900)];
    engine.receive(&mut reader, &framed(&ToBridge::Data { job: 3, offset: 0, bytes }));
    let (mut woken, mut printed) = (0, 0);
    loop {
        let (start, empty) = (now.get(), engine.output().is_empty());
        slices.set(0);
        // Each slice takes 70 µs: the third is the last one that begins within the turn.
        let turn = turn::work(&mut engine, || {
            slices.set(slices.get() + 1);
            now.set(now.get() + if slices.get() > 1 { 70 } else { 0 });
            now.get()
        });
        assert!(now.get() - start <= 200 + 70, "{} µs", now.get() - start);
        assert_eq!(turn.wake_port, empty && !engine.output().is_empty());
        woken += usize::from(turn.wake_port);
        let count = engine.output().len();
        engine.consumed(count);
        printed += count;
        if !turn.more {
            break;
        }
        assert!(now.get() - start >= 200, "a turn with work left ended after {} µs", now.get() - start);
    }
    assert!(woken > 0 || printed == 0);
}
