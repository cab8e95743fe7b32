//! What the engine does when the printer shows a fault or has lost its supply, and when it has it reset.

use super::{Rig, a_raw_job, refused};
use bridge::engine::{Outcome, Task};
use bridge::standing::Standing;
use protocol::link::message::{
    DATA_MAX, Fault, JobKind, JobState, Lines, Refusal, SCHEMA, ToBridge, VERSION,
};

#[test]
fn a_fault_stops_the_job_and_its_end_lets_it_go_on() {
    let mut rig = Rig::new();
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 50 });
    rig.engine.port(Lines(0), Some(Fault::OffLine));
    assert_eq!(rig.said().progress.unwrap().state, JobState::Stopped(Fault::OffLine));
    rig.engine.port(Lines::IDLE, None);
    assert_eq!(rig.said().progress.unwrap().state, JobState::Printing);
}

#[test]
fn a_printer_without_its_supply_gets_nothing_and_then_a_reset_before_the_first_byte() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    while rig.engine.work() {}
    assert!(!rig.engine.output().is_empty());
    let off = Lines(Lines::IDLE.0 & !Lines::POWER);
    rig.engine.port(off, Some(Fault::PowerOff));
    assert!(
        rig.engine.output().is_empty()
            && rig.engine.output_behind(3).is_empty()
            && rig.engine.task().is_none()
    );
    rig.engine.port(Lines::IDLE, None);
    assert!(rig.engine.output().is_empty());
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
    rig.engine.done(Outcome::Done);
    assert!(!rig.engine.output().is_empty());
    // A job that ends where a reset is needed waits with it for the supply.
    let mut rig = Rig::new();
    rig.open(2, &[b'a'; 3000], 500);
    rig.print();
    rig.tell(ToBridge::Cancel { job: 2 });
    rig.engine.port(off, Some(Fault::PowerOff));
    assert_eq!((rig.engine.progress().state, rig.engine.task()), (JobState::Lost, None));
    rig.engine.port(Lines::IDLE, None);
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
}

#[test]
fn a_printer_switched_off_in_the_middle_gets_nothing_more() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    // Off before the first byte is no harm: it may be switched on yet.
    rig.engine.port(Lines(0), Some(Fault::PowerOff));
    assert_eq!(rig.engine.progress().state, JobState::Stopped(Fault::PowerOff));
    while rig.engine.work() {}
    rig.engine.port(Lines::IDLE, None);
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
    rig.engine.done(Outcome::Done);
    rig.engine.consumed(1);
    rig.engine.port(Lines(0), Some(Fault::PowerOff));
    assert_eq!(rig.engine.progress().state, JobState::Lost);
    assert!(rig.engine.output().is_empty());
}

#[test]
fn a_printer_that_went_in_a_job_is_reset_when_it_is_back_and_before_the_next_one() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    while rig.engine.work() {}
    rig.engine.consumed(1);
    rig.engine.port(Lines(0), Some(Fault::PowerOff));
    // The host has the next one ready, and the bridge is restarted meanwhile: none of that counts as a reset.
    let mut rig = rig.restarted();
    let begin = |rig: &mut Rig| {
        rig.open(2, &stream, DATA_MAX);
        while rig.engine.work() {}
    };
    begin(&mut rig);
    for fault in [Fault::PowerOff, Fault::Error, Fault::OffLine] {
        rig.engine.port(Lines(0), Some(fault));
        assert!(rig.engine.output().is_empty() && rig.engine.task().is_none(), "{fault:?}");
    }
    // Restarted once more, with the next job open, and again when the reset was to be done and was not.
    for ready in [false, true] {
        if ready {
            rig.engine.port(Lines::IDLE, None);
            assert_eq!(rig.engine.task(), Some(Task::Initialise));
        }
        rig = rig.restarted();
        begin(&mut rig);
        assert!(rig.engine.output().is_empty() && rig.engine.task().is_none());
    }
    rig.engine.port(Lines::IDLE, None);
    assert!(rig.engine.output().is_empty(), "bytes before the reset");
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
    rig.engine.done(Outcome::Done);
    assert!(!rig.engine.output().is_empty());
    rig.engine.port(Lines::IDLE, None);
    assert_eq!(rig.engine.task(), None, "it is reset once");
}

#[test]
fn a_job_nobody_has_the_data_of_any_more_can_be_given_up() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    while rig.engine.work() {}
    rig.engine.consumed(100);
    let mut rig = rig.restarted();
    let said = rig.tell(ToBridge::Hello { version: VERSION, schema: SCHEMA });
    let progress = said.progress.unwrap();
    assert_eq!((progress.job, progress.accepted, progress.limit, progress.printed), (1, 0, 0, 100));
    assert_eq!(rig.tell(ToBridge::Initialise { request: 7 }).text, refused(Refusal::JobOpen, 1));
    rig.tell(ToBridge::Abandon { job: 1 });
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
    rig.engine.done(Outcome::Done);
    assert_eq!((rig.engine.progress().state, rig.engine.standing()), (JobState::Lost, Standing::AtRest));
}

#[test]
fn text_passes_through_and_cancelling_it_resets_the_printer() {
    let text = vec![b'a'; 3000];
    let mut rig = Rig::new();
    assert_eq!(rig.send(1, JobKind::Raw, &text).state, JobState::Done);
    assert!(rig.printed == text);
    rig.open(2, &text, 500);
    rig.print();
    rig.tell(ToBridge::Cancel { job: 2 });
    rig.print();
    assert_eq!(
        (rig.engine.progress().state, rig.engine.task()),
        (JobState::Cancelled, Some(Task::Initialise))
    );
    rig.engine.done(Outcome::Done);
    assert_eq!(rig.engine.task(), None);
}
