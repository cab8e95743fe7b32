//! The printer's +5 V: without it nothing is driven and no byte counts, and a job that has lost it is over.

use super::{ID, answering, foreign, hear, introducing, negotiations, send, settings, speak, text};
use bridge::port::Timing;
use bridge::simulation::{Line, Peripheral};
use model::bench::{Bench, MS};
use model::{Board, Host, Job, Planes, seeded};
use protocol::link::message::{Answer, Ask, Fault, Handshake, JobKind, JobState, ToBridge};
use rand::RngExt;

/// Strobes and pulses of nInit while the printer's supply was absent; the strobe that had begun to be set up is allowed.
fn driven_without_supply(bench: &Bench<'_>) -> usize {
    let (mut off_since, mut count) = (None, 0);
    for edge in bench.cable.edges() {
        match (edge.line, edge.level) {
            (Line::Power, 0) => off_since = Some(edge.at),
            (Line::Power, 1) => off_since = None,
            (Line::Strobe | Line::Init, 0) => {
                count += usize::from(off_since.is_some_and(|since| edge.at - since > 1_000));
            }
            _ => {}
        }
    }
    count
}

/// Jobs of every kind and way, at a printer that seems ready but for its supply.
#[test]
fn nothing_is_strobed_while_the_sense_line_is_low_and_everything_arrives_when_it_rises() {
    let planes = Planes::random(&mut seeded(3));
    let (printed, streams) = (planes.printed(), planes.streams());
    for (way, handshake) in [
        ("raw", Handshake::Busy),
        ("raw", Handshake::BusyAck),
        ("streams", Handshake::Busy),
        ("text", Handshake::Busy),
        ("plain", Handshake::Busy),
        ("plain", Handshake::BusyAck),
    ] {
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral::default());
        bench.cable.plan(0, Line::Power, 0);
        bench.cable.pass(1);
        bench.tell(&ToBridge::Configure(settings(handshake, Timing::DEFAULT)));
        bench.turn();
        let text = foreign(1_500);
        let (data, expected) = match way {
            "streams" => (&streams, &printed),
            "text" => (&text, &text),
            _ => (&printed, &printed),
        };
        let kind = if way == "streams" { JobKind::Streams } else { JobKind::Raw };
        let job = Job { id: 7, kind, data: data.clone(), expected: expected.clone() };
        let (mut host, mut plain) = (Host::new(&job), &data[..]);
        for round in 0..4_000 {
            if way == "plain" {
                let taken = bench.engine.local(&plain[..plain.len().min(64)]);
                plain = &plain[taken..];
            } else {
                speak(&mut bench, &mut host);
            }
            hear(&mut bench, &mut host, 10);
            if round == 2_000 {
                assert_eq!(bench.cable.taken().len(), 0, "{way}, {handshake:?}");
                assert_eq!(
                    (driven_without_supply(&bench), bench.cable.resets()),
                    (0, 0),
                    "{way}, {handshake:?}"
                );
                assert_eq!(bench.state(), JobState::Stopped(Fault::PowerOff), "{way}, {handshake:?}");
                bench.cable.plan(0, Line::Power, 1);
            }
        }
        assert_eq!(bench.state(), JobState::Done, "{way}, {handshake:?}");
        assert!(bench.cable.taken() == *expected, "{way}, {handshake:?}: other bytes on the paper");
        assert_eq!(bench.cable.resets(), 1, "what it has of another job nobody knows");
    }
}

#[test]
fn a_printer_without_its_supply_is_neither_negotiated_with_nor_asked() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { device_id: Some(ID.to_vec()), ..answering(vec![]) });
    bench.cable.plan(0, Line::Power, 0);
    bench.cable.pass(1);
    bench.pass(600 * MS);
    let off = text(Answer::Stopped(Fault::PowerOff));
    assert_eq!((bench.ask(1, Ask::DeviceId), bench.ask(2, Ask::Printer)), (off.clone(), off));
    assert_eq!((negotiations(&bench), driven_without_supply(&bench)), (0, 0));
}

/// The sense line alone, whenever in a byte: the wire breaks, or the printer's supply fails before its lines do.
#[test]
fn bytes_in_the_strobe_buffers_when_the_supply_goes_are_counted_as_they_are() {
    for step in 0..60u64 {
        let bytes = foreign(3_000);
        let mut board = Board::new(4096, 4096);
        let mut bench =
            Bench::new(&mut board, Peripheral { work: 1_000 + step * 37, ..Peripheral::default() });
        bench.pass(60 * MS);
        send(&mut bench, 7, &bytes);
        bench.pass(2 * MS);
        bench.cable.plan(step * 53, Line::Power, 0);
        bench.pass(10 * MS);
        let at_the_fall = bench.cable.taken().len();
        bench.pass(40 * MS);
        let printed = bench.engine.progress().printed as usize;
        assert_eq!((bench.state(), printed), (JobState::Lost, bench.cable.taken().len()), "step {step}");
        assert_eq!((at_the_fall, driven_without_supply(&bench)), (printed, 0), "step {step}");
        bench.cable.plan(0, Line::Power, 1);
        bench.pass(60 * MS);
        send(&mut bench, 8, b"next");
        bench.pass(10 * MS);
        assert_eq!((bench.state(), bench.cable.resets()), (JobState::Done, 1));
        assert_eq!(bench.cable.taken()[printed..], *b"next");
    }
}

#[test]
fn dropouts_of_the_supply_below_twenty_milliseconds_cost_no_sheet() {
    for seed in 300..312 {
        let mut random = seeded(seed);
        let bytes = foreign(3_000);
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral { work: 100_000, ..Peripheral::default() });
        let mut at = 0;
        for _ in 0..8 {
            at += random.random_range(1..60) * MS;
            bench.cable.plan(at, Line::Power, 0);
            // The slow ramp of a supply: it comes and goes about the threshold.
            for _ in 0..random.random_range(0..6) {
                at += random.random_range(1..15) * MS;
                bench.cable.plan(at, Line::Power, 1);
                at += 3 * MS;
                bench.cable.plan(at, Line::Power, 0);
            }
            at += random.random_range(1..18) * MS;
            bench.cable.plan(at, Line::Power, 1);
        }
        send(&mut bench, 7, &bytes);
        bench.pass(1_500 * MS);
        assert_eq!(bench.state(), JobState::Done, "seed {seed}");
        assert!(bench.cable.taken() == bytes, "seed {seed}");
        assert_eq!((bench.cable.resets(), driven_without_supply(&bench)), (0, 0));
    }
}

#[test]
fn a_printer_that_is_switched_off_loses_the_job_and_is_reset_before_the_next_one() {
    let bytes = foreign(3_000);
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { work: 100_000, ..Peripheral::default() });
    send(&mut bench, 7, &bytes);
    bench.pass(50 * MS);
    bench.cable.switch(false);
    bench.pass(15 * MS);
    assert_eq!(bench.state(), JobState::Stopped(Fault::Error));
    bench.pass(10 * MS);
    assert_eq!(bench.state(), JobState::Lost);
    let had = bench.cable.taken().len();
    assert!(had > 100 && had < 1_000, "{had}");
    send(&mut bench, 8, &bytes);
    bench.pass(1_000 * MS);
    bench.cable.switch(true);
    bench.pass(1_000 * MS);
    assert_eq!(bench.state(), JobState::Done);
    assert_eq!((&bench.cable.taken()[had..], bench.cable.resets()), (&bytes[..], 1));
    // The reset came before the first byte.
    let edges = bench.cable.edges();
    let reset = edges.iter().position(|edge| edge.line == Line::Init).unwrap();
    let strobes = edges[..reset].iter().filter(|edge| edge.line == Line::Strobe && edge.level == 0).count();
    assert_eq!(strobes, had);
}

/// Whether the bridge drives the cable: nSelectIn, low at rest, is high by a pull-up else.
fn drives(bench: &Bench<'_>) -> bool {
    let edges = bench.cable.edges();
    edges.iter().rev().find(|edge| edge.line == Line::SelectIn).is_some_and(|edge| edge.level == 0)
}

#[test]
fn the_cable_is_driven_only_while_the_printer_has_its_supply_or_is_worked_on() {
    for handshake in [Handshake::Busy, Handshake::Ack, Handshake::BusyAck] {
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral::default());
        bench.cable.plan(0, Line::Power, 0);
        bench.cable.pass(1);
        bench.tell(&ToBridge::Configure(settings(handshake, Timing::DEFAULT)));
        bench.pass(100 * MS);
        assert!(!drives(&bench), "{handshake:?}: a printer that was off when the bridge started");
        send(&mut bench, 7, &foreign(700));
        bench.pass(100 * MS);
        assert!(!drives(&bench), "{handshake:?}: a job that waits");
        bench.cable.plan(0, Line::Power, 1);
        bench.pass(2 * MS);
        assert!(drives(&bench), "{handshake:?}: switched on");
        bench.pass(60 * MS);
        assert_eq!((bench.state(), bench.cable.taken()), (JobState::Done, foreign(700)), "{handshake:?}");
        for (dropout_ms, stays) in [(17, true), (24, false)] {
            bench.cable.plan(0, Line::Power, 0);
            bench.pass(dropout_ms * MS);
            assert_eq!(drives(&bench), stays, "{handshake:?}: off for {dropout_ms} ms");
            bench.cable.plan(0, Line::Power, 1);
            bench.pass(2 * MS);
            assert!(drives(&bench), "{handshake:?}: on again");
        }
    }
}

/// A loop-back plug has no +5 V.
#[test]
fn a_wiring_test_drives_the_cable_of_a_printer_that_is_off_until_its_end() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral::default());
    bench.cable.switch(false);
    bench.pass(100 * MS);
    assert!(!drives(&bench));
    bench.tell(&ToBridge::Drive { data: 0xaa, control: 0b0111 });
    bench.pass(300 * MS);
    assert!(drives(&bench));
    bench.tell(&ToBridge::Drive { data: 0, control: 0b0111 });
    bench.pass(2 * MS);
    assert!(!drives(&bench));
    send(&mut bench, 7, &foreign(700));
    bench.cable.switch(true);
    bench.pass(100 * MS);
    assert_eq!((bench.state(), bench.cable.taken()), (JobState::Done, foreign(700)));
}

/// Whenever it is switched on and off, and whatever it is asked meanwhile: no byte is strobed at a cable that is not driven, so
/// none is counted that has not arrived.
#[test]
fn no_byte_counts_that_was_strobed_while_the_cable_was_free() {
    for seed in 400..440 {
        let mut random = seeded(seed);
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, introducing(ID));
        bench.random = Some(seeded(seed + 1000));
        for job in 1..6 {
            bench.cable.switch(false);
            bench.pass(random.random_range(15..40) * MS);
            let request = job as u16;
            let what = if random.random() { Ask::DeviceId } else { Ask::Printer };
            bench.cable.plan(random.random_range(0..3_000_000), Line::Power, 1);
            bench.pass(random.random_range(0..2) * MS);
            bench.tell(&ToBridge::Ask { request, what });
            bench.cable.pass(random.random_range(0..1_000_000));
            bench.cable.switch(true);
            bench.hear(&format!("Answer {{ request: {request}, "));
            let before = bench.cable.taken().len();
            let bytes = foreign(random.random_range(1..900));
            send(&mut bench, job, &bytes);
            bench.pass(4_000 * MS);
            assert_eq!(bench.state(), JobState::Done, "seed {seed}, job {job}");
            assert!(bench.cable.taken()[before..] == bytes, "seed {seed}, job {job}");
        }
    }
}
