//! The conversation with the host: greetings, questions, settings, credit, and what is refused.

use super::{Rig, a_raw_job, offer, refused};
use bridge::engine::{Engine, Outcome, Task};
use model::{IDENTITY, Job, framed, memory, seeded};
use proptest::prelude::*;
use protocol::link::frame;
use protocol::link::message::{
    Answer, Ask, DATA_MAX, Fault, Handshake, JobKind, JobState, Lines, PAST, PastJob, PortSettings, Refusal,
    SCHEMA, Standing, ToBridge, ToHost, Usage, VERSION,
};

#[test]
fn a_greeting_is_answered_with_who_and_where() {
    let said = Rig::new().tell(ToBridge::Hello { version: VERSION, schema: SCHEMA });
    let hello = ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 2, firmware: "test" };
    let past = ToHost::Past([PastJob::NONE; PAST]);
    let standing = ToHost::Standing { standing: Standing::AT_REST, job: 0 };
    assert_eq!(said.text, [format!("{hello:?}"), format!("{past:?}"), format!("{standing:?}")]);
    assert_eq!(said.progress.unwrap().state, JobState::None);
}

#[test]
fn a_hello_of_another_version_is_answered_whatever_is_in_it() {
    let mut rig = Rig::new();
    for hello in [&[0, 77][..], &[0, 77, 1, 2, 3, 4, 5, 6, 7, 8, 9], &[0, 1, 2]] {
        rig.engine.receive(&mut rig.reader, &framed_bytes(hello));
        let said = rig.said().text;
        assert!(said[0].starts_with("Hello") && said[0].contains(&format!("version: {VERSION}")), "{said:?}");
    }
}

/// Two users, and a queue between them: whoever comes back is told how the own job has ended.
#[test]
fn the_last_jobs_are_remembered_with_their_ends_through_resets() {
    let mut rig = Rig::new();
    let stream = a_raw_job();
    let mut expected = Vec::new();
    for id in 1..=20 {
        match id % 3 {
            0 => {
                rig.tell(ToBridge::Begin { job: id, kind: JobKind::Raw, length: 500 });
                rig.tell(ToBridge::Cancel { job: id });
                rig.print();
                expected.insert(0, PastJob { job: id, state: JobState::Cancelled, printed: 0 });
            }
            1 => {
                let printed = rig.send(id, JobKind::Raw, &stream).printed;
                expected.insert(0, PastJob { job: id, state: JobState::Done, printed });
            }
            _ => {
                let ended = rig.send(id, JobKind::Raw, &stream[..stream.len() - 3]);
                assert!(matches!(ended.state, JobState::Broken(_)));
                expected.insert(0, PastJob { job: id, state: ended.state, printed: ended.printed });
            }
        }
        // Jobs of a plain printer interface are nobody's to come back to.
        offer(&mut rig, &stream, 500);
        rig.print();
        if id % 4 == 0 {
            rig = rig.restarted();
        }
    }
    expected.truncate(PAST);
    let past: [PastJob; PAST] = expected.clone().try_into().unwrap();
    let told = format!("{:?}", ToHost::Past(past));
    let said = rig.tell(ToBridge::Hello { version: VERSION, schema: SCHEMA });
    assert_eq!(said.text[1], told);
    // Whoever goes on with a job that is over hears the same.
    let said = rig.tell(ToBridge::Data { job: 10, offset: 0, bytes: b"x" });
    assert_eq!(
        (said.text, rig.tell(ToBridge::Cancel { job: 10 }).text),
        (vec![told.clone()], vec![told.clone()])
    );
    let said = rig.tell(ToBridge::Begin { job: 10, kind: JobKind::Raw, length: 500 });
    assert_eq!(said.text, [refused(Refusal::OtherJob, 10), vec![told]].concat());
    assert_eq!(rig.tell(ToBridge::Cancel { job: 2 }).text, refused(Refusal::NoSuchJob, 2), "too long ago");
    assert_eq!(rig.engine.progress().state, JobState::Done);
}

#[test]
fn the_firmwares_use_is_told_when_asked_for() {
    let mut rig = Rig::new();
    assert!(!rig.engine.usage_wanted());
    rig.tell(ToBridge::Ask { request: 9, what: Ask::Board });
    assert!(rig.engine.usage_wanted());
    let usage = Usage { fixed: 1, stack: 2, stack_used: 3, longest_us: 4 };
    rig.engine.usage(usage);
    assert_eq!(rig.said().text, [format!("{:?}", ToHost::Board { request: 9, usage })]);
    assert!(!rig.engine.usage_wanted());
}

#[test]
fn the_log_is_given_when_asked_for_and_a_probe_only_between_jobs() {
    let mut rig = Rig::new();
    assert_eq!(rig.engine.log_wanted(), None);
    rig.engine.log(0, 2, b"no");
    assert!(rig.said().text.is_empty());
    rig.tell(ToBridge::ReadLog { request: 4, from: 70 });
    assert_eq!(rig.engine.log_wanted(), Some(70));
    rig.engine.log(80, 83, b"log");
    let part = ToHost::LogPart { request: 4, at: 80, end: 83, bytes: b"log" };
    assert_eq!((rig.said().text, rig.engine.log_wanted()), (vec![format!("{part:?}")], None));
    rig.tell(ToBridge::Probe { request: 5, data: 0x80, control: 7 });
    assert_eq!(rig.engine.task(), Some(Task::Probe { data: 0x80, control: 7 }));
    rig.engine.done(Outcome::Lines(Lines::IDLE));
    let lines = ToHost::Lines { request: 5, lines: Lines::IDLE, fault: None };
    assert_eq!(rig.said().text, [format!("{lines:?}")]);
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 9 });
    let said = rig.tell(ToBridge::Probe { request: 6, data: 0, control: 0 });
    assert_eq!(said.text, [format!("{:?}", ToHost::Answer { request: 6, answer: Answer::NotNow })]);
}

/// A printer may take longer to answer than a host waits before it says its question again.
#[test]
fn a_question_that_is_said_again_while_the_printer_is_asked_is_answered_once() {
    for (what, task) in [(Ask::Printer, Task::PrinterStatus), (Ask::DeviceId, Task::DeviceId)] {
        let mut rig = Rig::new();
        let question = ToBridge::Ask { request: 3, what };
        assert_eq!(rig.tell(question).text, Vec::<String>::new());
        assert_eq!(rig.tell(question).text, Vec::<String>::new());
        assert_eq!(rig.engine.task(), Some(task));
        assert_eq!(rig.tell(question).text, Vec::<String>::new());
        // Another one finds the printer at work.
        let other = rig.tell(ToBridge::Ask { request: 4, what });
        assert_eq!(other.text, [format!("{:?}", ToHost::Answer { request: 4, answer: Answer::NotNow })]);
        rig.engine.done(Outcome::Answer(Answer::Bytes(b"all is well")));
        let answer = ToHost::Answer { request: 3, answer: Answer::Bytes(b"all is well") };
        assert_eq!(rig.said().text, [format!("{answer:?}")]);
        assert_eq!(rig.engine.task(), None);
    }
}

#[test]
fn a_question_is_answered_at_once_though_the_printer_takes_nothing() {
    let mut rig = Rig::new();
    let data = vec![b'x'; 20_000];
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 20_000 });
    // As much as there is credit for, and the printer is out of paper.
    rig.engine.port(Lines(Lines::IDLE.0 | Lines::PAPER_OUT), Some(Fault::PaperOut));
    loop {
        let progress = rig.engine.progress();
        let count = (progress.limit - progress.accepted).min(DATA_MAX as u32);
        if count == 0 && !rig.engine.work() {
            break;
        }
        rig.tell(ToBridge::Data { job: 1, offset: progress.accepted, bytes: &data[..count as usize] });
    }
    let lines = Lines(Lines::IDLE.0 | Lines::PAPER_OUT);
    let said = rig.tell(ToBridge::Ask { request: 5, what: Ask::Lines });
    let answer = ToHost::Lines { request: 5, lines, fault: Some(Fault::PaperOut) };
    assert_eq!(said.text, [format!("{answer:?}")]);
    let said = rig.tell(ToBridge::Cancel { job: 1 });
    assert_eq!(said.progress.unwrap().state, JobState::Cancelling);
}

#[test]
fn questions_to_the_printer_are_the_boards_to_put_and_have_the_port_to_themselves() {
    let mut rig = Rig::new();
    rig.tell(ToBridge::Ask { request: 8, what: Ask::DeviceId });
    assert_eq!(rig.engine.task(), Some(Task::DeviceId));
    assert_eq!(rig.engine.task(), None, "a task is given once");
    // A job that comes meanwhile waits.
    let stream = a_raw_job();
    rig.send(1, JobKind::Raw, &stream);
    assert!(rig.printed.is_empty());
    rig.engine.done(Outcome::Answer(Answer::Bytes(b"MFG:ALPS;")));
    let answer = ToHost::Answer { request: 8, answer: Answer::Bytes(b"MFG:ALPS;") };
    assert_eq!(rig.said().text, [format!("{answer:?}")]);
    assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    assert!(rig.printed == stream);
}

const SETTINGS: PortSettings = PortSettings {
    setup_ns: 1,
    strobe_ns: 2,
    hold_ns: 3,
    settle_ns: 4,
    handshake: Handshake::Busy,
    patience_s: 5,
    heed: Lines::ALL,
};

#[test]
fn settings_reach_the_board_in_the_middle_of_a_job() {
    let mut rig = Rig::new();
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 50 });
    rig.tell(ToBridge::Configure(SETTINGS));
    assert_eq!(rig.engine.task(), Some(Task::Configure(SETTINGS)));
    rig.engine.done(Outcome::BadSettings);
    assert_eq!(rig.said().text, refused(Refusal::Settings, 0));
}

/// Nothing is wrong with the settings then.
#[test]
fn settings_for_a_board_that_is_busy_are_refused_as_too_early() {
    let mut rig = Rig::new();
    rig.tell(ToBridge::Ask { request: 8, what: Ask::DeviceId });
    let said = rig.tell(ToBridge::Configure(SETTINGS));
    assert_eq!(said.text, refused(Refusal::JobOpen, 0));
}

#[test]
fn data_beyond_the_credit_are_refused_and_harm_nothing() {
    let mut rig = Rig::new();
    let stream = a_raw_job();
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: stream.len() as u32 });
    let limit = rig.engine.progress().limit;
    for offset in (0..limit).step_by(DATA_MAX) {
        let end = (offset as usize + DATA_MAX).min(stream.len());
        rig.tell(ToBridge::Data { job: 1, offset, bytes: &stream[offset as usize..end] });
    }
    // The last piece overlapped the limit and was dropped whole.
    let said =
        rig.tell(ToBridge::Data { job: 1, offset: 1920, bytes: &stream[1920..2880.min(stream.len())] });
    assert_eq!(said.text, refused(Refusal::BeyondLimit, 1));
    assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    assert!(rig.printed == stream);
}

#[test]
fn what_cannot_be_followed_is_refused_with_the_reason() {
    let mut rig = Rig::new();
    let begin = |job, kind, length| ToBridge::Begin { job, kind, length };
    assert_eq!(rig.tell(begin(0, JobKind::Raw, 5)).text, refused(Refusal::Empty, 0));
    assert_eq!(rig.tell(begin(4, JobKind::Raw, 0)).text, refused(Refusal::Empty, 4));
    assert_eq!(rig.tell(ToBridge::Cancel { job: 9 }).text, refused(Refusal::NoSuchJob, 9));
    assert_eq!(
        rig.tell(ToBridge::Data { job: 9, offset: 0, bytes: b"x" }).text,
        refused(Refusal::NoSuchJob, 9)
    );
    assert_eq!(rig.tell(begin(1, JobKind::Raw, 50)).text, Vec::<String>::new());
    assert_eq!(rig.tell(begin(1, JobKind::Raw, 51)).text, refused(Refusal::OtherJob, 1));
    assert_eq!(rig.tell(begin(2, JobKind::Raw, 50)).text, refused(Refusal::JobOpen, 2));
    assert_eq!(rig.tell(ToBridge::Bootloader).text, refused(Refusal::JobOpen, 1));
    let question = rig.tell(ToBridge::Ask { request: 8, what: Ask::Printer });
    assert_eq!(question.text, [format!("{:?}", ToHost::Answer { request: 8, answer: Answer::NotNow })]);
    rig.engine.receive(&mut rig.reader, &framed_bytes(&[99, 1, 2]));
    assert_eq!(rig.said().text, refused(Refusal::Unknown, 0));
}

/// Whoever has sent it, and however little of it there is.
#[test]
fn a_job_that_is_open_is_given_up_by_its_number_and_by_nothing_else() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    for count in [0, 900] {
        rig.open(1, &stream, count);
        while rig.engine.work() {}
        assert_eq!(rig.tell(ToBridge::Initialise { request: 7 }).text, refused(Refusal::JobOpen, 1));
        assert_eq!(rig.tell(ToBridge::Abandon { job: 9 }).text, refused(Refusal::NoSuchJob, 9));
        assert_eq!(rig.engine.task(), None);
    }
    assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    assert!(rig.printed == stream);
    assert_eq!(rig.tell(ToBridge::Initialise { request: 7 }).text, Vec::<String>::new());
    assert_eq!(rig.engine.task(), Some(Task::Initialise));
    rig.engine.done(Outcome::Done);
    let lines = ToHost::Lines { request: 7, lines: Lines::IDLE, fault: None };
    assert!(rig.said().text.contains(&format!("{lines:?}")), "it is told when it has been done");
}

/// A frame around bytes that are no message of this version.
fn framed_bytes(body: &[u8]) -> Vec<u8> {
    let mut with_sum = body.to_vec();
    with_sum.extend(frame::checksum(body).to_le_bytes());
    let mut coded = vec![0; 64];
    let length = cobs(&with_sum, &mut coded);
    coded.truncate(length);
    coded.push(0);
    coded
}

fn cobs(bytes: &[u8], out: &mut [u8]) -> usize {
    let (mut code, mut at) = (0, 1);
    for &byte in bytes {
        if byte == 0 {
            out[code] = (at - code) as u8;
            code = at;
        } else {
            out[at] = byte;
        }
        at += 1;
    }
    out[code] = (at - code) as u8;
    at
}

proptest! {
    #![proptest_config(testing::cases(40))]

    #[test]
    fn byte_by_byte_is_the_same_as_whole(seed in any::<u64>(), sizes in prop::collection::vec(1usize..200, 1..20)) {
        let job = Job::random(1, &mut seeded(seed));
        let mut frames = framed(&ToBridge::Begin { job: 1, kind: job.kind, length: job.data.len() as u32 });
        for (i, bytes) in job.data.chunks(500).enumerate().take(4) {
            frames.extend(framed(&ToBridge::Data { job: 1, offset: i as u32 * 500, bytes }));
        }
        let outcome = |mut sizes: Box<dyn Iterator<Item = usize>>| {
            let mut rig = Rig::new();
            let mut left = &frames[..];
            while !left.is_empty() {
                let (portion, rest) = left.split_at(sizes.next().unwrap().min(left.len()));
                rig.engine.receive(&mut rig.reader, portion);
                left = rest;
            }
            rig.print();
            (rig.said(), rig.printed, rig.engine.checkpoint())
        };
        let whole = outcome(Box::new(std::iter::repeat(usize::MAX)));
        prop_assert_eq!(&outcome(Box::new(std::iter::repeat(1))), &whole);
        prop_assert_eq!(&outcome(Box::new(sizes.into_iter().cycle())), &whole);
    }

    #[test]
    fn no_conversation_makes_it_fail(
        messages in prop::collection::vec((0u8..13, 0u32..4, 0u32..6000, prop::collection::vec(any::<u8>(), 0..400), any::<u8>()), 0..60),
    ) {
        let mut rig = Rig::new();
        for (kind, job, number, bytes, small) in messages {
            rig.tell(match kind {
                0 => ToBridge::Hello { version: small, schema: number },
                1 | 2 => ToBridge::Begin { job, kind: if small & 1 == 0 { JobKind::Raw } else { JobKind::Streams }, length: number },
                3 | 4 => ToBridge::Data { job, offset: rig.engine.progress().accepted, bytes: &bytes },
                5 => ToBridge::Data { job, offset: number.wrapping_sub(100), bytes: &bytes },
                6 => ToBridge::Cancel { job },
                7 => ToBridge::Ask { request: 1, what: Ask::Printer },
                8 => ToBridge::Initialise { request: 7 },
                9 => ToBridge::Drive { data: small, control: small },
                10 => ToBridge::Probe { request: 1, data: small, control: small },
                11 => ToBridge::Abandon { job },
                _ => ToBridge::ReadLog { request: 1, from: number },
            });
            match small % 5 {
                0 => while rig.engine.work() {},
                1 => rig.print(),
                2 => { rig.engine.task(); rig.engine.done(Outcome::Answer(Answer::Silent)); }
                3 => rig.engine = Engine::resume(memory(2048, 2048, 500), IDENTITY, rig.engine.checkpoint()),
                _ => rig.engine.port(Lines(small), Lines(small).fault()),
            }
            let progress = rig.engine.progress();
            prop_assert!(progress.accepted <= progress.limit);
        }
    }
}
