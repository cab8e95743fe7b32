//! Host, bridge and printer joined in memory: whatever happens between them, the bytes at the printer are those of an
//! undisturbed run.

#[cfg(unix)]
mod alone;
#[cfg(unix)]
mod faults;
mod paper;
#[cfg(unix)]
mod process;
mod wire;

use device::transit::session::{Outcome, Phase, Record, Session, SessionError};
use model::{ALL, Job, Mischief, NONE, is_a_whole_job, seeded};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{JobKind, JobState, Progress, SCHEMA, ToBridge, ToHost, VERSION};
use rand::RngExt;
use std::time::Duration;
use wire::{Extra, World};

/// What can happen beside the model's accidents.
const EVERYTHING: Extra = Extra { delay: 40, late_kill: 20, away: 5, amnesia: 0 };
const NOTHING: Extra = Extra { delay: 0, late_kill: 0, away: 0, amnesia: 0 };

fn disturbed(seeds: std::ops::Range<u64>) {
    let mut accidents = wire::Accidents::default();
    let mut streams = 0;
    for seed in seeds.clone() {
        let mut random = seeded(seed);
        let job = Job::random(random.random_range(1..=u32::MAX), &mut random);
        let mut boards = wire::boards(&mut random);
        let mut world = World::new(&job, &mut boards, ALL, EVERYTHING);
        let outcome = world.run(None, &mut random);
        assert_eq!(outcome, Outcome::Printed, "seed {seed}");
        assert!(world.printed == job.expected, "seed {seed}: other bytes at the port");
        assert!(!world.initialised, "seed {seed}: the printer was reset");
        streams += usize::from(job.kind == JobKind::Streams);
        accidents.add(world.accidents);
    }
    println!("seeds {seeds:?}, {streams} of them pass streams: {accidents:?}");
    assert!((seeds.count() / 3..).contains(&streams));
    assert!(accidents.all_happened(), "something never went wrong, so it was not tried: {accidents:?}");
}

#[test]
fn the_paper_does_not_notice_a_bad_link() {
    disturbed(0..400);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn the_paper_does_not_notice_ten_thousand_bad_links() {
    disturbed(100_000..110_000);
}

#[test]
fn on_a_good_link_nothing_is_sent_twice() {
    for seed in 0..100 {
        let mut random = seeded(seed);
        let job = Job::random(9, &mut random);
        let mut boards = wire::boards(&mut random);
        let mut world = World::new(&job, &mut boards, NONE, NOTHING);
        assert_eq!(world.run(None, &mut random), Outcome::Printed);
        assert!(world.printed == job.expected);
        // Framing costs 1 byte in 100, greetings a little more. A tail may be asked for again while the printer is slow.
        let most = job.data.len() * 105 / 100 + 4096;
        assert!(world.sent <= most, "seed {seed}: {} bytes for {}", world.sent, job.data.len());
    }
}

fn cancelled(seeds: std::ops::Range<u64>, mischief: Mischief, extra: Extra) {
    let (mut early, mut late, mut never) = (0, 0, 0);
    for seed in seeds {
        let mut random = seeded(seed);
        let job = Job::random(7, &mut random);
        let at = random.random_range(0..job.expected.len() * 5 / 4).saturating_sub(job.expected.len() / 4);
        let mut boards = wire::boards(&mut random);
        let mut world = World::new(&job, &mut boards, mischief, extra);
        let outcome = world.run(Some(at), &mut random);
        assert!(!world.initialised, "seed {seed}: the printer was reset");
        match outcome {
            Outcome::Printed => {
                assert!(world.printed == job.expected, "seed {seed}");
                late += 1;
            }
            Outcome::Cancelled => {
                never += u32::from(world.printed.is_empty());
                early += 1;
                assert!(
                    world.printed.is_empty() || is_a_whole_job(&world.printed),
                    "seed {seed}: the next job will not work"
                );
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
    println!("cancelled in time {early}, of them before the first byte {never}, too late {late}");
    assert!(early > never && never > 0 && late > 0);
}

#[test]
fn a_cancelled_sheet_is_a_whole_job_to_the_printer() {
    cancelled(20_000..20_300, NONE, NOTHING);
}

#[test]
fn a_cancelled_sheet_is_a_whole_job_on_a_bad_link_too() {
    cancelled(30_000..30_300, ALL, EVERYTHING);
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn ten_thousand_cancelled_sheets_are_whole_jobs() {
    cancelled(200_000..210_000, ALL, EVERYTHING);
}

/// A bridge that loses its memory may cost the sheet, but never prints anything twice or out of place.
#[test]
fn a_bridge_that_forgets_never_makes_the_host_print_twice() {
    let (mut whole, mut lost) = (0, 0);
    for seed in 0..400 {
        let mut random = seeded(seed);
        let job = Job::random(5, &mut random);
        let mut boards = wire::boards(&mut random);
        let mut world = World::new(&job, &mut boards, ALL, Extra { amnesia: 25, ..EVERYTHING });
        let outcome = world.run(None, &mut random);
        match outcome {
            Outcome::Printed => {
                whole += 1;
                assert!(world.printed == job.expected, "seed {seed}");
            }
            Outcome::Forgotten => {
                lost += 1;
                assert!(job.expected.starts_with(&world.printed), "seed {seed}: something was printed twice");
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
    println!("printed {whole}, lost with the bridge's memory {lost}");
    assert!(whole > 0 && lost > 0);
}

/// What two hosts say, one of which hears every burst whole and the other byte by byte.
#[test]
fn byte_by_byte_a_session_hears_the_same() {
    for seed in 0..100 {
        let mut random = seeded(seed);
        let job = Job::random(3, &mut random);
        let mut boards = wire::boards(&mut random);
        let mut world = World::new(&job, &mut boards, Mischief { fault: 0, ..ALL }, NOTHING);
        let record = Record::new(3, job.kind, job.data.len() as u32);
        let mut whole = Session::new(record, &job.data);
        let mut pieces = Session::new(record, &job.data);
        whole.connected(Duration::ZERO);
        pieces.connected(Duration::ZERO);
        for i in 0..200 {
            let now = Duration::from_millis(25 * i);
            let mut said = [Vec::new(), Vec::new()];
            for (session, said) in [&mut whole, &mut pieces].into_iter().zip(&mut said) {
                let Ok(()) = session.speak(now, said, &mut |_| Ok::<(), std::convert::Infallible>(()));
            }
            assert!(said[0] == said[1], "seed {seed}, step {i}");
            let answer = world.overhear(&said[0], &mut random);
            let heard = whole.hear(now, &answer);
            assert_eq!(answer.iter().try_for_each(|&byte| pieces.hear(now, &[byte])), heard);
            assert_eq!((whole.record(), whole.progress()), (pieces.record(), pieces.progress()));
        }
        assert!(whole.record().printed > 0, "seed {seed}: nothing happened");
    }
}

#[test]
fn a_job_does_not_disturb_one_that_the_bridge_already_prints() {
    let mut random = seeded(1);
    let first = Job::random(1, &mut random);
    let second = Job::random(2, &mut random);
    let mut boards = wire::boards(&mut random);
    let mut world = World::new(&first, &mut boards, NONE, NOTHING);
    world.step(&mut random);
    while world.printed.is_empty() {
        world.step(&mut random);
    }
    // Another host speaks up while the first one is silent.
    let data = second.data.clone();
    let mut intruder = Session::new(Record::new(2, second.kind, data.len() as u32), &data);
    assert_eq!(world.converse(&mut intruder, Duration::from_secs(5)), Err(SessionError::Busy(1)));
    assert_eq!(world.run(None, &mut random), Outcome::Printed);
    assert!(world.printed == first.expected);
}

#[test]
fn a_job_begun_on_one_bridge_does_not_go_on_on_another() {
    let mut random = seeded(2);
    let job = Job::random(3, &mut random);
    let mut boards = wire::boards(&mut random);
    let mut world = World::new(&job, &mut boards, NONE, NOTHING);
    while world.printed.is_empty() {
        world.step(&mut random);
    }
    let record = Record { bridge: Some(0xabcd), ..*world.record() };
    let data = job.data.clone();
    let mut session = Session::new(record, &data);
    let refused = world.converse(&mut session, Duration::from_secs(2));
    assert_eq!(refused, Err(SessionError::OtherBridge { expected: 0xabcd, found: 2 }));
}

#[test]
fn a_job_that_no_bridge_has_heard_of_is_cancelled_without_one() {
    let mut session = Session::new(Record::new(4, JobKind::Raw, 3), b"abc");
    session.cancel();
    assert_eq!(session.outcome(), Some(Outcome::Cancelled));
}

/// Nobody has asked whether the printer is ready for it, and its data would come behind whatever an earlier job has left there.
#[test]
fn a_cancelled_job_of_which_nothing_has_left_gives_no_data() {
    let record = Record { phase: Phase::Begun, bridge: Some(2), ..Record::new(4, JobKind::Raw, 300) };
    let shown =
        Progress { job: 4, state: JobState::Printing, accepted: 0, limit: 300, printed: 0, pass: 0, row: 0 };
    let hello = ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 2, firmware: "test" };
    for cancelled in [false, true] {
        let mut session = Session::new(record, &[7; 300]);
        if cancelled {
            session.cancel();
        }
        session.connected(Duration::ZERO);
        for message in [hello, ToHost::Progress(shown)] {
            let mut buffer = [0; MAX];
            let length = frame::write(&message, &mut buffer).unwrap();
            session.hear(Duration::ZERO, &buffer[..length]).unwrap();
        }
        assert_eq!(session.has_more(), !cancelled);
        let mut said = Vec::new();
        let Ok(()) =
            session.speak(Duration::ZERO, &mut said, &mut |_| Ok::<(), std::convert::Infallible>(()));
        let (mut reader, mut rest, mut data, mut ends) = (Reader::new(), &said[..], false, false);
        loop {
            match reader.read(rest) {
                Read::More => break,
                Read::Damaged(_, more) => rest = more,
                Read::Message(message, more) => {
                    rest = more;
                    data |= matches!(frame::decode(message), Ok(ToBridge::Data { .. }));
                    ends |= matches!(frame::decode(message), Ok(ToBridge::Cancel { job: 4 }));
                }
            }
        }
        assert_eq!((data, ends), (!cancelled, cancelled));
    }
}

#[test]
fn rubbish_on_the_link_is_neither_believed_nor_fatal() {
    for seed in 0..50 {
        let mut random = seeded(seed);
        let mut session = Session::new(Record::new(4, JobKind::Raw, 3), b"abc");
        session.connected(Duration::ZERO);
        for i in 0..200 {
            let rubbish: Vec<u8> =
                (0..random.random_range(0..300)).map(|_| random.random_range(0..=255)).collect();
            session.hear(Duration::from_millis(i * 10), &rubbish).unwrap();
        }
        assert!(!session.greeted() && session.outcome().is_none());
    }
}
