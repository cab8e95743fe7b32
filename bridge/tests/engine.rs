//! The engine on a good link: what it answers, what it refuses, how it ends a job.

use bridge::engine::{Engine, LOCAL, Outcome, Task};
use model::{IDENTITY, Job, NONE, Planes, framed, is_a_whole_job, memory, run, seeded};
use proptest::prelude::*;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Answer, Ask, DATA_MAX, DefectKind, Fault, Handshake, JobKind, JobState, Lines, PAST, PastJob,
    PortSettings, Progress, Refusal, SCHEMA, ToBridge, ToHost, Usage, VERSION,
};
use protocol::walk::Placed;

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
    fn new() -> Rig {
        Rig::with(Engine::new(memory(2048, 4096, 40_000), IDENTITY))
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

#[test]
fn a_greeting_is_answered_with_who_and_where() {
    let said = Rig::new().tell(ToBridge::Hello { version: VERSION, schema: SCHEMA });
    let hello = ToHost::Hello { version: VERSION, schema: SCHEMA, boot: 1, serial: 2, firmware: "test" };
    let past = ToHost::Past([PastJob::NONE; PAST]);
    assert_eq!(said.text, [format!("{hello:?}"), format!("{past:?}")]);
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
fn a_printer_without_its_supply_gets_nothing_and_no_reset() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    while rig.engine.work() {}
    assert!(!rig.engine.output().is_empty());
    let off = Lines(Lines::IDLE.0 & !Lines::POWER);
    rig.engine.port(off, Some(Fault::PowerOff));
    assert!(rig.engine.output().is_empty() && rig.engine.output_behind(3).is_empty());
    rig.engine.port(Lines::IDLE, None);
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
fn streams_come_out_as_the_encoder_that_writes_files_would_have_it() {
    for seed in 0..100 {
        let planes = Planes::random(&mut seeded(seed));
        let mut rig = Rig::new();
        let progress = rig.send(1, JobKind::Streams, &planes.streams());
        assert_eq!(progress.state, JobState::Done);
        assert!(rig.printed == planes.printed(), "seed {seed}");
        assert_eq!(progress.printed as usize, rig.printed.len());
    }
}

#[test]
fn real_streams_pass_through_unchanged() {
    let Some(folder) = testing::needs::golden() else { return };
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|name| name == "bin") {
            let stream = std::fs::read(&path).unwrap();
            let mut rig = Rig::new();
            assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
            assert!(rig.printed == stream, "{path:?}");
        }
    }
}

#[test]
fn several_jobs_follow_each_other() {
    let (mut rig, mut random) = (Rig::new(), seeded(9));
    let mut expected = Vec::new();
    for id in 1..20 {
        let job = Job::random(id, &mut random);
        assert_eq!(rig.send(id, job.kind, &job.data).state, JobState::Done);
        expected.extend(job.expected);
        // A late repetition of the one before changes nothing.
        rig.tell(ToBridge::Begin { job: id, kind: job.kind, length: job.data.len() as u32 });
        rig.tell(ToBridge::Data { job: id, offset: 0, bytes: &job.data[..1] });
        assert_eq!(rig.engine.progress().state, JobState::Done);
    }
    assert!(rig.printed == expected);
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
    assert_eq!(rig.tell(ToBridge::Initialise).text, refused(Refusal::JobOpen, 1));
    assert_eq!(rig.tell(ToBridge::Bootloader).text, refused(Refusal::JobOpen, 1));
    let question = rig.tell(ToBridge::Ask { request: 8, what: Ask::Printer });
    assert_eq!(question.text, [format!("{:?}", ToHost::Answer { request: 8, answer: Answer::NotNow })]);
    rig.engine.receive(&mut rig.reader, &framed_bytes(&[99, 1, 2]));
    assert_eq!(rig.said().text, refused(Refusal::Unknown, 0));
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

#[test]
fn settings_reach_the_board_in_the_middle_of_a_job() {
    let mut rig = Rig::new();
    rig.tell(ToBridge::Begin { job: 1, kind: JobKind::Raw, length: 50 });
    let settings = PortSettings {
        setup_ns: 1,
        strobe_ns: 2,
        hold_ns: 3,
        settle_ns: 4,
        handshake: Handshake::Busy,
        patience_s: 5,
        heed: Lines::ALL,
    };
    rig.tell(ToBridge::Configure(settings));
    assert_eq!(rig.engine.task(), Some(Task::Configure(settings)));
    rig.engine.done(Outcome::BadSettings);
    assert_eq!(rig.said().text, refused(Refusal::Settings, 0));
}

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
fn a_printer_switched_off_in_the_middle_gets_nothing_more() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, DATA_MAX);
    // Off before the first byte is no harm: it may be switched on yet.
    rig.engine.port(Lines(0), Some(Fault::PowerOff));
    assert_eq!(rig.engine.progress().state, JobState::Stopped(Fault::PowerOff));
    while rig.engine.work() {}
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
    rig.tell(ToBridge::Initialise);
    assert_eq!((rig.engine.progress().state, rig.engine.task()), (JobState::Lost, Some(Task::Initialise)));
}

#[test]
fn a_finished_job_is_remembered_through_a_reset() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.send(1, JobKind::Raw, &stream);
    let mut rig = rig.restarted();
    // The host has not heard of the end and sends it again.
    assert_eq!(rig.send(1, JobKind::Raw, &stream).state, JobState::Done);
    assert!(rig.printed.is_empty(), "the sheet was printed twice");
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

/// Offers bytes as a printer interface does, again and again.
fn offer(rig: &mut Rig, mut bytes: &[u8], size: usize) {
    while !bytes.is_empty() {
        let taken = rig.engine.local(&bytes[..size.min(bytes.len())]);
        bytes = &bytes[taken..];
        rig.print();
        assert!(taken > 0 || !rig.engine.work(), "nothing moves");
    }
}

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
fn a_raw_job_cancelled_before_its_first_row_has_not_touched_the_printer() {
    let stream = a_raw_job();
    let mut rig = Rig::new();
    rig.open(1, &stream, 60);
    rig.print();
    rig.tell(ToBridge::Cancel { job: 1 });
    rig.print();
    assert_eq!((rig.engine.progress().state, rig.printed.len()), (JobState::Cancelled, 0));
    assert_eq!(rig.engine.task(), None);
}

#[test]
fn a_cancel_that_comes_too_late_changes_nothing() {
    let stream = Planes {
        width: 8,
        rows: 1,
        inks: vec![protocol::ink::Ink::Black],
        bits: vec![vec![1]],
        walk: Placed::whole(8, 1),
    }
    .printed();
    let mut rig = Rig::new();
    rig.open(1, &stream, stream.len());
    while rig.engine.work() {}
    assert_eq!(rig.tell(ToBridge::Cancel { job: 1 }).progress.unwrap().state, JobState::Printing);
    rig.print();
    assert_eq!(rig.engine.progress().state, JobState::Done);
    assert!(rig.printed == stream);
}

#[test]
fn a_stream_that_ends_too_early_is_brought_to_an_end() {
    let stream = a_raw_job();
    for cut in (100..stream.len() - 2).step_by(97) {
        let mut rig = Rig::new();
        let state = rig.send(1, JobKind::Raw, &stream[..cut]).state;
        assert!(
            matches!(state, JobState::Broken(defect) if defect.what == DefectKind::Truncated),
            "{state:?}"
        );
        assert!(rig.printed.is_empty() || is_a_whole_job(&rig.printed), "cut at {cut}");
    }
}

#[test]
fn pass_streams_with_a_defect_are_brought_to_an_end() {
    let mut outcomes = std::collections::BTreeSet::new();
    for seed in 0..300u64 {
        let mut data = Planes::random(&mut seeded(seed)).streams();
        match seed % 3 {
            0 => data.truncate(data.len() - 1),
            1 => data.push(0),
            _ => {
                let at = (seed as usize * 7919) % data.len();
                data[at] ^= 1 << (seed / 3 % 8);
            }
        }
        let mut rig = Rig::new();
        let state = rig.send(1, JobKind::Streams, &data).state;
        outcomes.insert(match state {
            JobState::Broken(defect) => format!("{:?}", defect.what),
            state => format!("{state:?}"),
        });
        assert!(rig.printed.is_empty() || is_a_whole_job(&rig.printed), "seed {seed}: {state:?}");
        assert!(seed % 3 == 2 || matches!(state, JobState::Broken(_)), "seed {seed}: {state:?}");
    }
    for kind in ["Excess", "Truncated", "Stream", "Header"] {
        assert!(outcomes.contains(kind), "never {kind}: {outcomes:?}");
    }
}

#[test]
fn a_page_too_wide_for_the_memory_is_refused_before_the_first_byte() {
    let planes = Planes {
        width: 4800,
        rows: 10,
        inks: vec![protocol::ink::Ink::Black],
        bits: vec![vec![1; 6000]],
        walk: Placed::whole(4800, 10),
    };
    let mut rig = Rig::with(Engine::new(memory(2048, 2048, 38_399), IDENTITY));
    let state = rig.send(1, JobKind::Streams, &planes.streams()).state;
    assert!(matches!(state, JobState::Broken(defect) if defect.what == DefectKind::TooLarge));
    assert!(rig.printed.is_empty());
    let mut rig = Rig::with(Engine::new(memory(2048, 2048, 38_400), IDENTITY));
    assert_eq!(rig.send(1, JobKind::Streams, &planes.streams()).state, JobState::Done);
}

#[test]
fn positions_on_the_sheet_rise_to_the_last_pass() {
    let planes = Planes::random(&mut seeded(5));
    let mut rig = Rig::new();
    let progress = rig.send(1, JobKind::Streams, &planes.streams());
    assert_eq!(usize::from(progress.pass) + 1, planes.inks.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

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
                8 => ToBridge::Initialise,
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

#[test]
fn an_undisturbed_run_of_the_model_is_the_job() {
    for seed in 0..50 {
        let mut random = seeded(seed);
        let job = Job::random(3, &mut random);
        assert!(run(&job, &NONE, None, &mut random).printed == job.expected);
    }
}

#[test]
fn the_engine_fits_a_microcontroller() {
    assert!(size_of::<Engine>() <= 14 * 1024, "{} bytes", size_of::<Engine>());
}
