//! Jobs on their way to the paper: each byte crosses once, whatever the printer, the settings and resets do.

use super::{foreign, hear, send, settings, speak};
use bridge::driver::Event;
use bridge::port::Timing;
use bridge::simulation::{Line, Pause, Peripheral, SimulatedPort, check};
use model::bench::{Bench, MS};
use model::{Board, Host, Job, seeded};
use protocol::link::message::{Fault, Handshake, JobState, Lines, PortSettings, ToBridge};
use rand::RngExt;

const LINES: [Line; 4] = [Line::Busy, Line::PaperOut, Line::Select, Line::Fault];

/// Lets a host send its job, and does something else now and then.
fn converse(bench: &mut Bench<'_>, job: &Job, mut now_and_then: impl FnMut(&mut Bench<'_>)) -> JobState {
    let mut host = Host::new(job);
    for round in 0..20_000 {
        if let Some(state) = host.finished {
            return state;
        }
        speak(bench, &mut host);
        hear(bench, &mut host, 10);
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
                speak(&mut bench, &mut host);
                hear(&mut bench, &mut host, random.random_range(1..20));
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
        // A reset of a printer whose supply is not to be seen is none.
        assert_eq!(bench.cable.resets(), 1 + usize::from(line == Some(Line::Power)), "{line:?}");
    }
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
fn a_line_that_is_not_heeded_stops_nothing() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral::default());
    bench.cable.plan(0, Line::Select, 0);
    bench.cable.pass(1);
    let heed = Lines(Lines::ALL.0 & !Lines::SELECT);
    bench.tell(&ToBridge::Configure(PortSettings { heed, ..Timing::DEFAULT.settings() }));
    bench.turn();
    send(&mut bench, 7, b"text");
    bench.pass(60 * MS);
    assert_eq!((bench.cable.taken(), bench.state()), (b"text".to_vec(), JobState::Done));
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
