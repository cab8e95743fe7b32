//! The port's driver on simulated pins in virtual time, between the engine and a printer.

use bridge::driver::Event;
use bridge::port::Timing;
use bridge::printer_class::DeviceId;
use bridge::simulation::{Line, Pause, Peripheral, Response, SimulatedPort, check};
use model::bench::{Bench, MS};
use model::{Board, Host, Job, Planes, framed, seeded};
use proptest::prelude::*;
use protocol::link::message::{
    Answer, Ask, Fault, Handshake, JobKind, JobState, Lines, PortSettings, ToBridge,
};
use rand::RngExt;

const LINES: [Line; 4] = [Line::Busy, Line::PaperOut, Line::Select, Line::Fault];

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

/// Lets a host send its job, and does something else now and then.
fn converse(bench: &mut Bench<'_>, job: &Job, mut now_and_then: impl FnMut(&mut Bench<'_>)) -> JobState {
    let mut host = Host::new(job);
    for round in 0..20_000 {
        if let Some(state) = host.finished {
            return state;
        }
        for frame in host.speak() {
            bench.engine.receive(&mut bench.reader, &frame);
        }
        for _ in 0..10 {
            bench.turn();
        }
        let said = bench.transmitted();
        host.hear(&said);
        if round % 3 == 0 {
            now_and_then(bench);
        }
    }
    panic!("no end, {:?}", bench.engine.progress());
}

fn pauses(random: &mut impl RngExt, bytes: usize) -> Vec<Pause> {
    (0..3)
        .map(|_| Pause {
            after: random.random_range(1..=bytes),
            line: LINES[random.random_range(0..4)],
            ns: random.random_range(1..2_000_000_000),
        })
        .collect()
}

#[test]
fn jobs_reach_the_paper_through_frames_and_pins() {
    for seed in 0..16 {
        let mut random = seeded(seed);
        let job = Job::random(1, &mut random);
        let pauses = pauses(&mut random, job.expected.len());
        let peripheral = Peripheral { work: random.random_range(0..20_000), pauses, ..Peripheral::default() };
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, peripheral);
        let handshake = if seed % 2 == 0 { Handshake::Busy } else { Handshake::BusyAck };
        bench.tell(&ToBridge::Configure(settings(handshake, Timing::FAST)));
        bench.turn();
        bench.random = Some(random);
        assert_eq!(converse(&mut bench, &job, |_| {}), JobState::Done, "seed {seed}");
        assert!(bench.cable.taken() == job.expected, "seed {seed}: other bytes on the paper");
        assert_eq!(check(&bench.cable.edges(), &Timing::FAST), [], "seed {seed}");
    }
}

/// The sender has bytes in flight whenever it is stopped, and the processor may be in the middle of a handful.
#[test]
fn settings_that_change_in_the_middle_of_a_job_cost_no_byte_and_double_none() {
    let mut changes = 0;
    for seed in 100..124 {
        let mut random = seeded(seed);
        let job = Job::random(1, &mut random);
        let pauses = pauses(&mut random, job.expected.len());
        let peripheral = Peripheral { work: random.random_range(0..8_000), pauses, ..Peripheral::default() };
        let mut board = Board::new(4096, 6000);
        let mut bench = Bench::new(&mut board, peripheral);
        bench.random = Some(seeded(seed + 1000));
        let state = converse(&mut bench, &job, |bench| {
            let handshake = [Handshake::Busy, Handshake::Busy, Handshake::BusyAck][random.random_range(0..3)];
            let timing = [Timing::FAST, Timing::DEFAULT, Timing::SAFE][random.random_range(0..3)];
            // nAck is no status line that shows a fault: without it the processor sends.
            let heed = if random.random_bool(0.3) { Lines(Lines::ALL.0 & !Lines::ACK) } else { Lines::ALL };
            let settings = PortSettings { heed, ..settings(handshake, timing) };
            bench.tell(&ToBridge::Configure(settings));
            changes += 1;
        });
        assert_eq!(state, JobState::Done, "seed {seed}");
        assert!(bench.cable.taken() == job.expected, "seed {seed}: other bytes on the paper");
        assert_eq!(check(&bench.cable.edges(), &Timing::FAST), [], "seed {seed}");
    }
    assert!(changes > 200, "{changes} changes");
}

#[test]
fn a_bridge_that_is_reset_again_and_again_goes_on_at_the_byte() {
    let mut resets = 0;
    for seed in 200..230 {
        let mut random = seeded(seed);
        let job = Job::random(1, &mut random);
        let cable = SimulatedPort::new(Peripheral { work: 3_000, ..Peripheral::default() });
        let (mut checkpoint, mut life) = (None, 0);
        let state = loop {
            let mut memory = Board::new(4096, 6000);
            let mut bench = Bench::on(&cable, &mut memory, checkpoint);
            if seed % 2 == 1 {
                bench.tell(&ToBridge::Configure(settings(Handshake::BusyAck, Timing::DEFAULT)));
            }
            let mut host = Host::new(&job);
            // Later lives are long enough to come to an end.
            let rounds = if life > 6 { 10_000 } else { random.random_range(1..6) };
            for _ in 0..rounds {
                if host.finished.is_some() {
                    break;
                }
                for frame in host.speak() {
                    bench.engine.receive(&mut bench.reader, &frame);
                }
                for _ in 0..random.random_range(1..20) {
                    bench.turn();
                }
                host.hear(&bench.transmitted());
            }
            if let Some(state) = host.finished {
                break state;
            }
            // Anywhere between two turns, with the sender in the middle of its bytes.
            cable.pass(random.random_range(0..3 * MS));
            checkpoint = bench.board.clone().reset();
            let printed = checkpoint.map_or(0, |checkpoint| checkpoint.progress.printed);
            assert_eq!(printed as usize, cable.taken().len(), "seed {seed}, life {life}");
            (life, resets) = (life + 1, resets + 1);
        };
        assert_eq!(state, JobState::Done, "seed {seed}");
        assert!(cable.taken() == job.expected, "seed {seed}: other bytes on the paper");
    }
    assert!(resets > 30, "{resets} resets");
}

#[test]
fn the_status_comes_back_whole_wherever_the_answer_breaks_and_however_late_it_is() {
    let whole = status();
    for (first, after_ms) in [(38, 0), (1, 3), (37, 15), (20, 800), (38, 1900)] {
        let (one, two) = whole.split_at(first);
        let pieces = vec![
            Response { after: after_ms * MS, bytes: one.to_vec() },
            Response { after: (after_ms + 50) * MS, bytes: two.to_vec() },
        ];
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, answering(pieces));
        assert_eq!(
            bench.ask(1, Ask::PrinterAtRest),
            text(Answer::Bytes(&whole)),
            "{first} bytes, {after_ms} ms"
        );
        assert_eq!(bench.cable.taken(), [0x05, 0x01]);
        assert_eq!(check(&bench.cable.edges(), &Timing::DEFAULT), []);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Whatever the printer's times are, it gets the question once, and its answer arrives if it comes in time.
    #[test]
    fn a_printer_is_asked_once_and_its_answer_arrives_if_it_comes_within_two_seconds(
        busy_before_ms in 0u64..1_800,
        busy_between_ms in 0u64..1_800,
        after_ms in 0u64..4_000,
        (answer_after, work) in (0u64..200_000, 0u64..50_000),
        seed in any::<u64>(),
    ) {
        let pauses = vec![Pause { after: 1, line: Line::Busy, ns: busy_between_ms * MS }];
        let status_answer = vec![Response { after: after_ms * MS, bytes: status() }];
        let mut board = Board::new(2048, 2048);
        let peripheral =
            Peripheral { answer_after, work, pauses, status: status_answer, ..Peripheral::default() };
        let mut bench = Bench::new(&mut board, peripheral);
        bench.random = Some(seeded(seed));
        bench.cable.plan(0, Line::Busy, 1);
        bench.cable.plan(busy_before_ms * MS, Line::Busy, 0);
        bench.cable.pass(1);
        let answer = bench.ask(1, Ask::PrinterAtRest);
        let taken = bench.cable.taken();
        let busy = busy_before_ms + busy_between_ms;
        if taken.len() < 2 {
            // Two seconds are for both bytes.
            prop_assert!(busy > 1_900 && answer == text(Answer::Silent), "{busy} ms busy, {answer}");
        } else {
            prop_assert_eq!(&taken[..], &[5, 1]);
            let whole = text(Answer::Bytes(&status()));
            prop_assert!(answer == whole || after_ms > 1_900 && answer == text(Answer::Silent), "{after_ms} ms: {answer}");
        }
        prop_assert_eq!(check(&bench.cable.edges(), &Timing::DEFAULT), vec![]);
        // The port is back in its forward direction.
        let before = taken.len();
        send(&mut bench, 7, b"after");
        for _ in 0..100 {
            bench.pass(100 * MS);
        }
        prop_assert_eq!(bench.state(), JobState::Done);
        prop_assert!(bench.cable.taken()[before..].ends_with(b"after"));
    }
}

#[test]
fn a_printer_that_says_nothing_or_one_byte_is_silent_after_two_seconds() {
    for response in [vec![], vec![Response { after: MS, bytes: vec![0x06] }]] {
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, answering(response));
        assert_eq!(bench.ask(1, Ask::PrinterAtRest), text(Answer::Silent));
        let ms = bench.cable.now() / MS;
        assert!((2_000..2_400).contains(&ms), "{ms} ms");
        assert_eq!(bench.cable.taken(), [0x05, 0x01]);
    }
}

#[test]
fn a_printer_that_takes_no_question_is_silent_after_two_seconds_and_the_question_is_dropped() {
    // It is busy from the first byte on, or before it.
    for after in [0, 1] {
        let pauses = vec![Pause { after: 1, line: Line::Busy, ns: 4_000 * MS }];
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, Peripheral { pauses, ..answering(vec![]) });
        if after == 0 {
            bench.cable.plan(0, Line::Busy, 1);
            bench.cable.pass(1);
        }
        assert_eq!(bench.ask(1, Ask::PrinterAtRest), text(Answer::Silent));
        let ms = bench.cable.now() / MS;
        assert!((2_000..2_100).contains(&ms), "{ms} ms");
        bench.pass(5_000 * MS);
        assert_eq!(bench.cable.taken().len(), after);
    }
}

#[test]
fn a_printer_that_shows_a_fault_is_not_asked() {
    let faults = [
        (Line::PaperOut, 1, Fault::PaperOut),
        (Line::Select, 0, Fault::OffLine),
        (Line::Fault, 0, Fault::Error),
        (Line::Power, 0, Fault::PowerOff),
    ];
    for (line, level, fault) in faults {
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, answering(vec![Response { after: 0, bytes: status() }]));
        bench.cable.plan(0, line, level);
        bench.cable.pass(1);
        assert_eq!(bench.ask(1, Ask::PrinterAtRest), text(Answer::Stopped(fault)));
        assert!(bench.cable.now() < 5 * MS);
        assert!(bench.cable.taken().is_empty());
        // Between its two bytes.
        let pauses = vec![Pause { after: 1, line, ns: 100 * MS }];
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, Peripheral { pauses, ..answering(vec![]) });
        if line != Line::Power {
            assert_eq!(bench.ask(1, Ask::PrinterAtRest), text(Answer::Stopped(fault)));
            assert_eq!(bench.cable.taken(), [0x05]);
        }
    }
}

#[test]
fn a_printer_switched_off_in_the_middle_of_the_question_ends_it() {
    // While it should take the question, and while it should answer.
    for work in [1_000, 300 * MS] {
        let status_answer = vec![Response { after: 900 * MS, bytes: status() }];
        let mut board = Board::new(2048, 2048);
        let mut bench =
            Bench::new(&mut board, Peripheral { work, status: status_answer, ..Peripheral::default() });
        bench.tell(&ToBridge::Ask { request: 1, what: Ask::PrinterAtRest });
        bench.pass(100 * MS);
        bench.cable.switch(false);
        let answer = bench.hear("Answer { request: 1, answer: ");
        assert_eq!(answer.trim_end_matches(" }"), text(Answer::Stopped(Fault::PowerOff)));
        assert!(bench.cable.now() < 200 * MS);
        // Then the printer is back, and takes a job.
        bench.cable.switch(true);
        bench.pass(1_000 * MS);
        let before = bench.cable.taken().len();
        send(&mut bench, 7, b"after");
        bench.pass(2_000 * MS);
        assert_eq!(bench.cable.taken()[before..], *b"after");
    }
}

#[test]
fn a_printer_that_does_not_negotiate_is_one_way() {
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, Peripheral { negotiates: false, ..Peripheral::default() });
    assert_eq!(bench.ask(1, Ask::PrinterAtRest), text(Answer::OneWay));
    assert_eq!(bench.ask(2, Ask::DeviceId), text(Answer::OneWay));
    assert!(bench.board.events().contains(&Event::NoDeviceId) || bench.cable.now() < 500 * MS);
    assert!(bench.cable.taken().is_empty(), "the question is text to it");
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

#[test]
fn a_printer_that_has_shown_that_it_does_not_negotiate_is_left_alone_until_it_is_switched_on_again() {
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, Peripheral { negotiates: false, ..Peripheral::default() });
    bench.pass(600 * MS);
    assert_eq!((negotiations(&bench), events(&bench)), (1, vec![Event::NoDeviceId]));
    for request in 1..20 {
        assert_eq!(bench.ask(request, Ask::PrinterAtRest), text(Answer::OneWay));
        assert_eq!(bench.ask(100 + request, Ask::DeviceId), text(Answer::OneWay));
    }
    bench.pass(5_000 * MS);
    assert_eq!((negotiations(&bench), bench.cable.taken().len()), (1, 0));
    // Also behind a restart of the bridge.
    let checkpoint = bench.board.clone().reset();
    let cable = bench.cable.clone();
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::on(&cable, &mut board, checkpoint);
    bench.pass(600 * MS);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::OneWay));
    assert_eq!(negotiations(&bench), 1);
    // Another printer may be there when it is on again.
    bench.cable.switch(false);
    bench.pass(30 * MS);
    bench.cable.switch(true);
    bench.pass(600 * MS);
    assert_eq!(negotiations(&bench), 2);
}

#[test]
fn the_printer_is_asked_only_when_it_is_known_to_stand_between_two_jobs() {
    let peripheral = || answering(vec![Response { after: 0, bytes: status() }]);
    let unsure = text(Answer::Unsure);
    let whole = text(Answer::Bytes(&status()));
    // A bridge that has just got its supply does not know what the printer stands in.
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, peripheral());
    assert_eq!((bench.ask(1, Ask::Printer), bench.cable.taken().len()), (unsure.clone(), 0));
    // Behind a reset, a job, or the printer's own switch it does.
    bench.tell(&ToBridge::Initialise);
    bench.pass(10 * MS);
    assert_eq!(bench.ask(2, Ask::Printer), whole);
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, peripheral());
    send(&mut bench, 7, b"text");
    bench.pass(10 * MS);
    assert_eq!(bench.ask(3, Ask::Printer), whole);
    let checkpoint = bench.board.clone().reset();
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::on(&bench.cable.clone(), &mut board, checkpoint);
    assert_eq!(bench.ask(4, Ask::Printer), whole, "a restart forgets nothing");
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, peripheral());
    bench.cable.switch(false);
    bench.pass(50 * MS);
    bench.cable.switch(true);
    bench.pass(50 * MS);
    assert_eq!(bench.ask(5, Ask::Printer), whole);
    // A job that ended before a byte of it crossed says nothing.
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, peripheral());
    bench.tell(&ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 9 });
    bench.tell(&ToBridge::Cancel { job: 7 });
    bench.pass(10 * MS);
    assert_eq!((bench.state(), bench.ask(6, Ask::Printer)), (JobState::Cancelled, unsure.clone()));
    // In the middle of a row even a host that thinks it knows better asks in vain: the reset is owed.
    send(&mut bench, 8, &foreign(3_000));
    bench.pass(5 * MS);
    bench.cable.plan(0, Line::Power, 0);
    bench.pass(40 * MS);
    bench.cable.plan(0, Line::Select, 0);
    bench.cable.plan(0, Line::Power, 1);
    bench.pass(40 * MS);
    let had = bench.cable.taken().len();
    assert_eq!((bench.state(), bench.cable.resets()), (JobState::Lost, 0));
    assert_eq!(bench.ask(7, Ask::PrinterAtRest), unsure);
    assert_eq!(bench.cable.taken().len(), had);
}

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
                for frame in host.speak() {
                    bench.engine.receive(&mut bench.reader, &frame);
                }
            }
            for _ in 0..10 {
                bench.turn();
            }
            let said = bench.transmitted();
            host.hear(&said);
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
        assert_eq!(bench.cable.resets(), 0);
    }
}

#[test]
fn a_printer_without_its_supply_is_neither_negotiated_with_nor_asked() {
    let id = Some(b"\x00\x0cMFG:ALPS;;".to_vec());
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { device_id: id, ..answering(vec![]) });
    bench.cable.plan(0, Line::Power, 0);
    bench.cable.pass(1);
    bench.pass(600 * MS);
    let off = text(Answer::Stopped(Fault::PowerOff));
    assert_eq!((bench.ask(1, Ask::DeviceId), bench.ask(2, Ask::PrinterAtRest)), (off.clone(), off));
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
        bench.pass(10 * MS);
        send(&mut bench, 8, b"next");
        bench.pass(10 * MS);
        assert_eq!((bench.state(), bench.cable.resets()), (JobState::Done, 1));
        assert_eq!(bench.cable.taken()[printed..], *b"next");
    }
}

#[test]
fn a_job_given_up_ends_at_once_whatever_the_printer_does_and_the_next_one_prints_behind_a_reset() {
    for (line, level) in [(None, 0), (Some(Line::Busy), 1), (Some(Line::PaperOut), 1), (Some(Line::Power), 0)]
    {
        let bytes = foreign(3_000);
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral { work: 20_000, ..Peripheral::default() });
        if line == Some(Line::Power) {
            bench.cable.plan(0, Line::Power, 0);
        }
        send(&mut bench, 7, &bytes);
        bench.pass(30 * MS);
        if let Some(line) = line {
            bench.cable.plan(0, line, level);
        }
        bench.pass(5 * MS);
        bench.tell(&ToBridge::Abandon { job: 9 });
        bench.pass(MS);
        assert!(matches!(bench.state(), JobState::Printing | JobState::Stopped(_)), "another job's number");
        bench.tell(&ToBridge::Abandon { job: 7 });
        bench.pass(5 * MS);
        let printed = bench.cable.taken().len();
        let expected = if printed == 0 { JobState::Cancelled } else { JobState::Lost };
        let progress = bench.engine.progress();
        assert_eq!((progress.state, progress.printed as usize), (expected, printed), "{line:?}");
        if let Some(line) = line {
            bench.cable.plan(0, line, 1 - level);
        }
        bench.pass(50 * MS);
        send(&mut bench, 8, b"next");
        bench.pass(50 * MS);
        assert_eq!(bench.state(), JobState::Done, "{line:?}");
        assert_eq!(bench.cable.taken()[printed..], *b"next", "{line:?}");
        assert_eq!(bench.cable.resets(), 1, "{line:?}");
    }
}

/// Whatever printer and settings are, other tasks have their turn within a millisecond.
#[test]
fn no_poll_keeps_the_processor_for_a_millisecond() {
    let mute = Peripheral { status: vec![], ..Peripheral::default() };
    let printers = [
        ("mute", mute.clone()),
        ("slow", Peripheral { answer_after: 33_000_000, device_id: Some(vec![b':'; 40]), ..mute.clone() }),
        ("stops", Peripheral { dumb_after: Some(5), device_id: Some(vec![b':'; 40]), ..mute.clone() }),
        ("one-way", Peripheral { negotiates: false, ..mute.clone() }),
        (
            "endless",
            Peripheral { device_id: Some(vec![b':'; 4000]), reverse_data: vec![9; 4000], ..mute.clone() },
        ),
        ("at work", Peripheral { work: 90_000, ..mute }),
    ];
    let slowest = Timing { setup: 65_535, strobe: 65_535, hold: 65_535, settle: 65_535 };
    for (name, printer) in printers {
        for (handshake, timing) in
            [(Handshake::Busy, Timing::DEFAULT), (Handshake::BusyAck, slowest), (Handshake::Busy, slowest)]
        {
            let mut board = Board::new(4096, 4096);
            let mut bench = Bench::new(&mut board, printer.clone());
            bench.tell(&ToBridge::Configure(settings(handshake, timing)));
            bench.turn();
            bench.ask(1, Ask::PrinterAtRest);
            bench.ask(2, Ask::DeviceId);
            let before = bench.cable.taken().len();
            send(&mut bench, 7, &foreign(1_000));
            bench.tell(&ToBridge::Initialise);
            bench.pass(3_000 * MS);
            assert_eq!(bench.state(), JobState::Done, "{name}, {handshake:?}");
            assert!(bench.cable.taken()[before..] == foreign(1_000), "{name}, {handshake:?}");
            assert!(bench.longest < MS, "{name}, {handshake:?}: {} ns", bench.longest);
        }
    }
}

#[test]
fn a_busy_printer_tells_no_device_id_and_says_why_if_it_can() {
    for (line, level, expected) in
        [(Line::Busy, 1, Answer::Silent), (Line::PaperOut, 1, Answer::Stopped(Fault::PaperOut))]
    {
        let mut board = Board::new(2048, 2048);
        let id = Some(b"\x00\x0cMFG:ALPS;;".to_vec());
        let mut bench = Bench::new(&mut board, Peripheral { device_id: id, ..Peripheral::default() });
        bench.cable.plan(0, Line::Busy, 1);
        bench.cable.plan(0, line, level);
        bench.cable.pass(1);
        assert_eq!(bench.ask(1, Ask::DeviceId), text(expected));
    }
}

#[test]
fn the_link_is_answered_and_a_job_is_taken_while_the_printer_is_asked() {
    let status_answer = vec![Response { after: 1_500 * MS, bytes: status() }];
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, answering(status_answer));
    bench.tell(&ToBridge::Ask { request: 1, what: Ask::PrinterAtRest });
    for request in 2..40 {
        let asked = bench.cable.now();
        bench.tell(&ToBridge::Ask { request, what: Ask::Lines });
        bench.hear(&format!("Lines {{ request: {request}"));
        assert!(bench.cable.now() - asked <= 5 * MS);
        bench.pass(7 * MS);
    }
    // A second question, and a job: the one is refused, the other waits.
    assert_eq!(bench.ask(50, Ask::DeviceId), text(Answer::NotNow));
    let bytes = foreign(1000);
    send(&mut bench, 7, &bytes);
    bench.pass(500 * MS);
    assert_eq!(bench.cable.taken(), [5, 1]);
    let answer = bench.hear("Answer { request: 1, answer: ");
    assert_eq!(answer.trim_end_matches(" }"), text(Answer::Bytes(&status())));
    bench.pass(100 * MS);
    assert_eq!(bench.cable.taken(), [&[5, 1], &bytes[..]].concat());
    assert_eq!(bench.state(), JobState::Done);
}

#[test]
fn the_device_id_comes_back_as_it_is_and_is_shown_from_then_on() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;";
    let mut board = Board::new(2048, 2048);
    let peripheral = Peripheral { device_id: Some(told.to_vec()), ..Peripheral::default() };
    let mut bench = Bench::new(&mut board, peripheral);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(told)));
    assert_eq!(bench.id.bytes(), b"\x00\x1dMANUFACTURER:ALPS;MODEL:MD;");
}

#[test]
fn a_device_id_that_breaks_off_is_passed_on_and_one_beyond_the_room_is_cut() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;".to_vec();
    let mut board = Board::new(2048, 2048);
    let peripheral =
        Peripheral { device_id: Some(told.clone()), dumb_after: Some(41), ..Peripheral::default() };
    let mut bench = Bench::new(&mut board, peripheral);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(&told[..20])));
    let long = [&b"\x10\x00MFG:ALPS;DES:"[..], &[b'x'; 2000], b";"].concat();
    let mut board = Board::new(2048, 2048);
    let peripheral = Peripheral { device_id: Some(long.clone()), ..Peripheral::default() };
    let mut bench = Bench::new(&mut board, peripheral);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(&long[..512])));
    assert_eq!(bench.id.bytes().len(), 512);
    send(&mut bench, 7, b"after");
    bench.pass(100 * MS);
    assert_eq!(bench.cable.taken(), b"after");
}

fn events(bench: &Bench<'_>) -> Vec<Event> {
    bench.board.events().into_iter().filter(|event| !matches!(event, Event::Job(_))).collect()
}

#[test]
fn a_printer_introduces_itself_once_each_time_it_is_switched_on() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;".to_vec();
    let mut board = Board::new(2048, 2048);
    let peripheral = Peripheral { device_id: Some(told.clone()), ..Peripheral::default() };
    let mut bench = Bench::new(&mut board, peripheral);
    let unheard = DeviceId::new().bytes().to_vec();
    bench.pass(480 * MS);
    assert_eq!((bench.id.bytes(), events(&bench)), (&unheard[..], vec![]));
    bench.pass(100 * MS);
    assert_eq!(events(&bench), [Event::DeviceId(told.len())]);
    let heard = bench.id.bytes().to_vec();
    assert!(heard.ends_with(b"MODEL:MD;"));
    bench.pass(5_000 * MS);
    assert_eq!(events(&bench).len(), 1);
    bench.cable.switch(false);
    bench.pass(5 * MS);
    assert_eq!(bench.id.bytes(), unheard);
    bench.cable.switch(true);
    bench.pass(600 * MS);
    assert_eq!((bench.id.bytes(), events(&bench).len()), (&heard[..], 2));
    assert!(bench.cable.taken().is_empty());
}

#[test]
fn a_printer_that_is_busy_or_in_use_is_not_asked_for_its_device_id() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { work: 700_000, ..Peripheral::default() });
    // A job that takes two seconds.
    let bytes = foreign(2_800);
    send(&mut bench, 7, &bytes);
    bench.pass(1_900 * MS);
    assert_eq!(events(&bench), []);
    bench.pass(150 * MS);
    assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done));
    assert_eq!(events(&bench), []);
    // A wiring test, whose levels stand.
    bench.tell(&ToBridge::Drive { data: 0x55, control: 0b0111 });
    bench.pass(2_000 * MS);
    assert_eq!(events(&bench), []);
    bench.tell(&ToBridge::Initialise);
    bench.pass(600 * MS);
    assert_eq!(events(&bench), [Event::NoDeviceId]);
}

#[test]
fn a_job_that_comes_about_when_the_printer_is_asked_for_its_device_id_loses_nothing() {
    for at in (494..504).flat_map(|ms| [ms * MS, ms * MS + 300_000, ms * MS + 700_000]) {
        let id = Some(b"\x00\x0cMFG:ALPS;;".to_vec());
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral { device_id: id, ..Peripheral::default() });
        bench.random = Some(seeded(at));
        bench.pass(at);
        let bytes = foreign(2_000);
        send(&mut bench, 7, &bytes);
        bench.pass(800 * MS);
        assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done), "{at}");
        assert_eq!(events(&bench).len(), 1);
        assert_eq!(check(&bench.cable.edges(), &Timing::DEFAULT), []);
    }
}

#[test]
fn a_task_goes_before_the_introduction_when_both_are_due() {
    let id = Some(b"\x00\x0cMFG:ALPS;;".to_vec());
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(
        &mut board,
        Peripheral {
            device_id: id,
            status: vec![Response { after: 0, bytes: status() }],
            ..Peripheral::default()
        },
    );
    bench.pass(499 * MS);
    bench.cable.pass(10 * MS);
    bench.tell(&ToBridge::Ask { request: 1, what: Ask::PrinterAtRest });
    bench.pass(3 * MS);
    assert_eq!((bench.cable.taken(), events(&bench)), (vec![5, 1], vec![]));
    bench.hear("Answer { request: 1, answer: ");
    assert_eq!(events(&bench), []);
    bench.pass(600 * MS);
    assert_eq!(events(&bench), [Event::DeviceId(12)]);
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
        bench.pass(20 * MS);
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
        let id = Some(b"\x00\x0cMFG:ALPS;;".to_vec());
        let mut bench = Bench::new(&mut board, Peripheral { device_id: id, ..Peripheral::default() });
        bench.random = Some(seeded(seed + 1000));
        for job in 1..6 {
            bench.cable.switch(false);
            bench.pass(random.random_range(15..40) * MS);
            let request = job as u16;
            let what = if random.random() { Ask::DeviceId } else { Ask::PrinterAtRest };
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

#[test]
fn levels_of_a_wiring_test_stand_until_there_is_something_to_print() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral::default());
    bench.tell(&ToBridge::Drive { data: 0xaa, control: 0b1111 });
    bench.pass(300 * MS);
    let last = |bench: &Bench<'_>, line| {
        bench.cable.edges().iter().rev().find(|edge| edge.line == line).map(|edge| edge.level)
    };
    assert_eq!((last(&bench, Line::Data), last(&bench, Line::SelectIn)), (Some(0xaa), Some(1)));
    bench.tell(&ToBridge::Probe { request: 3, data: 0x55, control: 0b0111 });
    assert!(bench.hear("Lines { request: 3, ").starts_with("lines: Lines"));
    assert_eq!((last(&bench, Line::Data), last(&bench, Line::SelectIn)), (Some(0x55), Some(0)));
    bench.tell(&ToBridge::Drive { data: 0, control: 0b1101 });
    bench.pass(10 * MS);
    let bytes = foreign(500);
    send(&mut bench, 7, &bytes);
    bench.pass(50 * MS);
    assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done));
    assert_eq!(last(&bench, Line::SelectIn), Some(0));
}

#[test]
fn the_boot_loader_is_started_once_and_not_in_a_job() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { work: 100_000, ..Peripheral::default() });
    send(&mut bench, 7, &foreign(1_000));
    bench.pass(10 * MS);
    bench.tell(&ToBridge::Bootloader);
    bench.pass(10 * MS);
    assert_eq!(bench.board.boots(), 0);
    bench.pass(500 * MS);
    bench.tell(&ToBridge::Bootloader);
    bench.pass(10 * MS);
    assert_eq!(bench.board.boots(), 1);
}

#[test]
fn a_printer_that_stays_busy_is_a_fault_after_the_patience_whoever_sends() {
    for handshake in [Handshake::Busy, Handshake::BusyAck] {
        let pauses = vec![Pause { after: 200, line: Line::Busy, ns: 5_000 * MS }];
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, Peripheral { pauses, ..Peripheral::default() });
        let settings = PortSettings { patience_s: 3, ..settings(handshake, Timing::DEFAULT) };
        bench.tell(&ToBridge::Configure(settings));
        bench.turn();
        let bytes = foreign(1_000);
        send(&mut bench, 7, &bytes);
        bench.pass(2_900 * MS);
        assert_eq!(bench.state(), JobState::Printing, "{handshake:?}");
        bench.pass(200 * MS);
        assert_eq!(bench.state(), JobState::Stopped(Fault::BusyTooLong), "{handshake:?}");
        bench.pass(2_500 * MS);
        assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done), "{handshake:?}");
    }
}

#[test]
fn an_acknowledge_that_is_lost_is_reported_and_does_not_hold_the_sheet() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { ack: 0, ..Peripheral::default() });
    bench.tell(&ToBridge::Configure(settings(Handshake::BusyAck, Timing::DEFAULT)));
    bench.turn();
    send(&mut bench, 7, b"abc");
    let mut stopped = false;
    for _ in 0..30 {
        bench.pass(100 * MS);
        stopped |= bench.board.events().iter().any(
            |event| matches!(event, Event::Job(progress) if progress.state == JobState::Stopped(Fault::NoAck)),
        );
    }
    assert!(stopped);
    assert_eq!((bench.cable.taken(), bench.state()), (b"abc".to_vec(), JobState::Done));
}

#[test]
fn the_log_tells_each_state_of_a_job_once() {
    let pauses = vec![Pause { after: 400, line: Line::PaperOut, ns: 50 * MS }];
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { pauses, ..Peripheral::default() });
    send(&mut bench, 7, &foreign(1_000));
    bench.pass(200 * MS);
    send(&mut bench, 8, &foreign(1_000));
    bench.pass(50 * MS);
    let told: Vec<(u32, JobState)> = bench
        .board
        .events()
        .iter()
        .filter_map(|event| match event {
            Event::Job(progress) => Some((progress.job, progress.state)),
            _ => None,
        })
        .collect();
    let stopped = JobState::Stopped(Fault::PaperOut);
    assert_eq!(
        told,
        [
            (7, JobState::Printing),
            (7, stopped),
            (7, JobState::Printing),
            (7, JobState::Done),
            (8, JobState::Printing),
            (8, JobState::Done)
        ]
    );
}

#[test]
fn a_line_that_is_not_heeded_stops_nothing() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral::default());
    bench.cable.plan(0, Line::Select, 0);
    bench.cable.pass(1);
    let heed = Lines(Lines::ALL.0 & !Lines::SELECT);
    bench.engine.receive(
        &mut bench.reader,
        &framed(&ToBridge::Configure(PortSettings { heed, ..Timing::DEFAULT.settings() })),
    );
    bench.turn();
    send(&mut bench, 7, b"text");
    bench.pass(10 * MS);
    assert_eq!((bench.cable.taken(), bench.state()), (b"text".to_vec(), JobState::Done));
}
