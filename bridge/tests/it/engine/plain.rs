//! Jobs through a plain printer interface, which has no frames and no numbers.

use super::{Rig, a_raw_job, offer, refused};
use bridge::engine::{Engine, LOCAL, Outcome, Task};
use model::{IDENTITY, Planes, is_a_whole_job, memory, seeded};
use protocol::link::message::{Fault, JobKind, JobState, Lines, Refusal, ToBridge};

#[test]
fn jobs_through_a_plain_printer_interface_end_by_themselves() {
    for size in [1, 64, 5000] {
        let (mut rig, mut expected) = (Rig::new(), Vec::new());
        for seed in 0..6 {
            expected.extend(Planes::random(&mut seeded(seed)).printed());
        }
        offer(&mut rig, &expected, size);
        rig.print();
        assert_eq!((rig.engine.progress().job, rig.engine.progress().state), (LOCAL, JobState::Done));
        assert!(rig.printed == expected, "in portions of {size}");
        // The link has its turn afterwards.
        let stream = a_raw_job();
        assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    }
}

#[test]
fn a_plain_printer_interface_that_falls_silent_leaves_a_whole_job_and_text_as_it_is() {
    let mut rig = Rig::new();
    let stream = a_raw_job();
    offer(&mut rig, &stream[..stream.len() / 2], 64);
    rig.engine.local_end();
    rig.print();
    assert!(matches!(rig.engine.progress().state, JobState::Broken(_)));
    assert!(is_a_whole_job(&rig.printed));
    let mut rig = Rig::new();
    offer(&mut rig, b"plain text\r\n", 3);
    rig.engine.local_end();
    rig.print();
    assert_eq!((rig.engine.progress().state, &rig.printed[..]), (JobState::Done, &b"plain text\r\n"[..]));
}

#[test]
fn a_plain_printer_interface_that_is_reset_drops_what_has_not_begun_and_leaves_a_whole_job() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.engine.local_reset();
    assert_eq!(rig.engine.progress().state, JobState::None);
    offer(&mut rig, &stream[..stream.len() / 2], 64);
    let before = rig.printed.len();
    rig.engine.local_reset();
    rig.print();
    assert_eq!(rig.engine.progress().state, JobState::Cancelled);
    assert!(is_a_whole_job(&rig.printed) && rig.printed.len() - before < 1300);
    offer(&mut rig, &stream, 64);
    rig.print();
    assert_eq!(rig.engine.progress().state, JobState::Done);
    assert!(rig.printed.ends_with(&stream));
}

#[test]
fn a_plain_printer_interface_waits_only_while_nothing_is_on_its_way() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    assert_eq!(rig.engine.local_waits(), None);
    rig.engine.local(&stream[..20]);
    rig.print();
    // Nothing has gone to the printer before the first row.
    assert_eq!(rig.engine.local_waits(), Some(false));
    offer(&mut rig, &stream[20..stream.len() / 2], 64);
    rig.print();
    assert_eq!(rig.engine.local_waits(), Some(true));
    rig.engine.port(Lines::IDLE, Some(Fault::PaperOut));
    assert_eq!(rig.engine.local_waits(), None);
    rig.engine.port(Lines::IDLE, None);
    offer(&mut rig, &stream[stream.len() / 2..], 64);
    rig.print();
    assert_eq!(rig.engine.local_waits(), None);
}

#[test]
fn the_link_and_a_plain_printer_interface_do_not_mix_their_jobs() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    assert!(rig.engine.local(&stream[..200]) > 0);
    let said = rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 9 });
    assert_eq!(said.text, refused(Refusal::JobOpen, 1));
    let mut rig = Rig::new();
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 9 });
    assert_eq!(rig.engine.local(&stream[..200]), 0);
    // Half a sheet at a reset of the bridge: nobody sends the rest, so the printer is reset.
    let mut rig = Rig::new();
    offer(&mut rig, &stream[..1500], 64);
    let mut engine = rig.restarted().engine;
    assert_eq!(
        (engine.progress().state, engine.task()),
        (JobState::Lost, None),
        "nobody knows yet what is there"
    );
    engine.port(Lines::IDLE, None);
    assert_eq!(engine.task(), Some(Task::Initialise));
}

#[test]
fn a_printer_of_which_nothing_is_known_is_reset_before_the_first_byte_of_any_job() {
    let stream = a_raw_job();
    for is_plain in [true, false] {
        let mut rig = Rig::with(Engine::new(memory(2048, 4096, 40_000), IDENTITY));
        for resets in [1, 0] {
            let taken = match is_plain {
                true => rig.engine.local(&stream),
                false => {
                    rig.open(1 + resets, &stream, 900);
                    900
                }
            };
            while rig.engine.work() {}
            assert_eq!(rig.engine.task(), None, "nobody has looked at it yet");
            rig.engine.port(Lines::IDLE, None);
            assert_eq!(rig.engine.task(), [None, Some(Task::Initialise)][resets as usize]);
            assert_eq!(rig.engine.output().is_empty(), resets > 0);
            rig.engine.done(Outcome::Done);
            match is_plain {
                true => offer(&mut rig, &stream[taken..], 64),
                false => drop(rig.send(1 + resets, JobKind::Raw, &stream)),
            }
            rig.print();
            assert_eq!(rig.engine.progress().state, JobState::Done);
        }
        assert!(rig.printed == [&stream[..], &stream].concat());
    }
}

/// A cable that is pulled looks as the switch does, and a reset that the printer has not noticed is none.
#[test]
fn a_printer_that_was_seen_without_its_supply_is_reset_until_it_has_noticed() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    for off in [Lines(Lines::IDLE.0 & !Lines::POWER), Lines(0)] {
        rig.engine.port(off, Some(Fault::PowerOff));
        rig.engine.port(Lines::IDLE, None);
        offer(&mut rig, &stream[..stream.len() / 2], 64);
        rig.engine.port(Lines::IDLE, None);
        for _ in 0..3 {
            assert_eq!((rig.engine.task(), rig.engine.output().len()), (Some(Task::Initialise), 0));
            rig.engine.done(Outcome::Unnoticed);
        }
        assert_eq!(rig.engine.task(), Some(Task::Initialise));
        rig.engine.done(Outcome::Done);
        assert!(!rig.engine.output().is_empty());
        offer(&mut rig, &stream[stream.len() / 2..], 64);
        rig.print();
        assert_eq!((rig.engine.progress().state, rig.engine.task()), (JobState::Done, None));
    }
}
