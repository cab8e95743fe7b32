extern crate std;
use super::super::frame;
use super::*;
use proptest::prelude::*;
use std::vec::Vec;

const SETTINGS: PortSettings = PortSettings {
    setup_ns: 800,
    strobe_ns: 800,
    hold_ns: 800,
    settle_ns: 500,
    handshake: Handshake::Busy,
    patience_s: 600,
    heed: Lines(0x3f),
};
const PROGRESS: Progress = Progress {
    job: 7,
    state: JobState::Printing,
    accepted: 1200,
    limit: 9392,
    printed: 300,
    pass: 1,
    row: 40,
};

/// Job 7 printed, with 300 bytes; job 6 lost behind 4 bytes; 14 empty places.
const PAST_BYTES: &[u8] = &[
    7, 7, 4, 0xac, 2, 6, 7, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
];

fn with_state(state: JobState) -> ToHost<'static> {
    ToHost::Progress(Progress { job: 1, state, accepted: 2, limit: 3, printed: 4, pass: 5, row: 6 })
}

fn broken(what: DefectKind) -> ToHost<'static> {
    with_state(JobState::Broken(Defect { at: 9, what }))
}

/// One example of every variant and the bytes it has had since it was introduced.
fn to_bridge() -> Vec<(ToBridge<'static>, &'static [u8])> {
    let settings = |handshake| ToBridge::Configure(PortSettings { handshake, ..SETTINGS });
    let ask = |what| ToBridge::Ask { request: 300, what };
    std::vec![
        (ToBridge::Hello { version: 1, schema: 0x0102_0304 }, &[0, 1, 0x84, 0x86, 0x88, 0x08]),
        (ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 1061 }, &[1, 7, 0, 0xa5, 0x08]),
        (ToBridge::Begin { job: 7, kind: JobKind::Streams, length: 1061 }, &[1, 7, 1, 0xa5, 0x08]),
        (
            ToBridge::Data { job: 7, offset: 960, bytes: &[0x1b, 0x65, 0] },
            &[2, 7, 0xc0, 0x07, 3, 0x1b, 0x65, 0]
        ),
        (ToBridge::Cancel { job: 7 }, &[3, 7]),
        (ask(Ask::Lines), &[4, 0xac, 0x02, 0]),
        (ask(Ask::Printer), &[4, 0xac, 0x02, 1]),
        (ask(Ask::DeviceId), &[4, 0xac, 0x02, 2]),
        (settings(Handshake::Busy), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 0, 0xd8, 4, 0x3f]),
        (settings(Handshake::BusyAck), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 1, 0xd8, 4, 0x3f]),
        (settings(Handshake::Ack), &[5, 0xa0, 6, 0xa0, 6, 0xa0, 6, 0xf4, 3, 2, 0xd8, 4, 0x3f]),
        (ToBridge::Initialise { request: 300 }, &[6, 0xac, 0x02]),
        (ToBridge::Bootloader, &[7]),
        (ToBridge::Drive { data: 0xaa, control: 0b0111 }, &[8, 0xaa, 7]),
        (ToBridge::Probe { request: 300, data: 0xaa, control: 0b0111 }, &[9, 0xac, 0x02, 0xaa, 7]),
        (ToBridge::ReadLog { request: 300, from: 1200 }, &[10, 0xac, 0x02, 0xb0, 9]),
        (ToBridge::Abandon { job: 7 }, &[11, 7]),
        (ask(Ask::Vouched), &[4, 0xac, 0x02, 3]),
        (ask(Ask::Board), &[4, 0xac, 0x02, 4]),
        (
            ToBridge::Store { job: 7, kind: JobKind::Streams, length: 1061, name: "leaf" },
            &[12, 7, 1, 0xa5, 0x08, 4, b'l', b'e', b'a', b'f'],
        ),
        (ToBridge::ListStored { request: 300, index: 2 }, &[13, 0xac, 0x02, 2]),
        (ToBridge::PrintStored { job: 8, stored: 7 }, &[14, 8, 7]),
        (ToBridge::DeleteStored { request: 300, stored: 7 }, &[15, 0xac, 0x02, 7]),
    ]
}

fn to_host() -> Vec<(ToHost<'static>, &'static [u8])> {
    let lines = |fault| ToHost::Lines { request: 3, lines: Lines(0x39), fault };
    let answer = |answer| ToHost::Answer { request: 3, answer };
    let refused = |reason| ToHost::Refused { reason, job: 7 };
    let stored = |job| ToHost::Stored { request: 3, count: 1, room: 1000, total: 2000, job };
    let mut past = [PastJob::NONE; PAST];
    past[0] = PastJob { job: 7, state: JobState::Done, printed: 300 };
    past[1] = PastJob { job: 6, state: JobState::Lost, printed: 4 };
    let usage = Usage { fixed: 1024, stack: 2048, stack_used: 100, longest_us: 9 };
    std::vec![
        (
            ToHost::Hello { version: 1, schema: 0x80, boot: 5, serial: 0xe660, firmware: "0.1" },
            &[0, 1, 0x80, 1, 5, 0xe0, 0xcc, 3, 3, b'0', b'.', b'1'],
        ),
        (ToHost::Progress(PROGRESS), &[1, 7, 1, 0xb0, 9, 0xb0, 0x49, 0xac, 2, 1, 40]),
        (with_state(JobState::None), &[1, 1, 0, 2, 3, 4, 5, 6]),
        (with_state(JobState::Stopped(Fault::PaperOut)), &[1, 1, 2, 0, 2, 3, 4, 5, 6]),
        (with_state(JobState::Cancelling), &[1, 1, 3, 2, 3, 4, 5, 6]),
        (with_state(JobState::Done), &[1, 1, 4, 2, 3, 4, 5, 6]),
        (with_state(JobState::Cancelled), &[1, 1, 5, 2, 3, 4, 5, 6]),
        (broken(DefectKind::Header), &[1, 1, 6, 9, 0, 2, 3, 4, 5, 6]),
        (broken(DefectKind::Forbidden), &[1, 1, 6, 9, 1, 2, 3, 4, 5, 6]),
        (broken(DefectKind::TooLarge), &[1, 1, 6, 9, 2, 2, 3, 4, 5, 6]),
        (broken(DefectKind::Stream), &[1, 1, 6, 9, 3, 2, 3, 4, 5, 6]),
        (broken(DefectKind::Excess), &[1, 1, 6, 9, 4, 2, 3, 4, 5, 6]),
        (broken(DefectKind::Truncated), &[1, 1, 6, 9, 5, 2, 3, 4, 5, 6]),
        (with_state(JobState::Lost), &[1, 1, 7, 2, 3, 4, 5, 6]),
        (lines(None), &[2, 3, 0x39, 0]),
        (lines(Some(Fault::PaperOut)), &[2, 3, 0x39, 1, 0]),
        (lines(Some(Fault::OffLine)), &[2, 3, 0x39, 1, 1]),
        (lines(Some(Fault::Error)), &[2, 3, 0x39, 1, 2]),
        (lines(Some(Fault::PowerOff)), &[2, 3, 0x39, 1, 3]),
        (lines(Some(Fault::BusyTooLong)), &[2, 3, 0x39, 1, 4]),
        (lines(Some(Fault::NoAck)), &[2, 3, 0x39, 1, 5]),
        (answer(Answer::Bytes(&[2, 0x80])), &[3, 3, 0, 2, 2, 0x80]),
        (answer(Answer::NotNow), &[3, 3, 1]),
        (answer(Answer::OneWay), &[3, 3, 2]),
        (answer(Answer::Silent), &[3, 3, 3]),
        (answer(Answer::Stopped(Fault::OffLine)), &[3, 3, 4, 1]),
        (refused(Refusal::Unknown), &[4, 0, 7]),
        (refused(Refusal::JobOpen), &[4, 1, 7]),
        (refused(Refusal::NoSuchJob), &[4, 2, 7]),
        (refused(Refusal::OtherJob), &[4, 3, 7]),
        (refused(Refusal::Empty), &[4, 4, 7]),
        (refused(Refusal::BeyondLimit), &[4, 5, 7]),
        (refused(Refusal::Settings), &[4, 6, 7]),
        (ToHost::Log(&[1, 2]), &[5, 2, 1, 2]),
        (
            ToHost::LogPart { request: 3, at: 1200, end: 1202, bytes: &[1, 2] },
            &[6, 3, 0xb0, 9, 0xb2, 9, 2, 1, 2],
        ),
        (answer(Answer::Unsure), &[3, 3, 5]),
        (ToHost::Past(past), PAST_BYTES),
        (ToHost::Board { request: 3, usage }, &[8, 3, 0x80, 8, 0x80, 0x10, 100, 9]),
        (with_state(JobState::Storing), &[1, 1, 8, 2, 3, 4, 5, 6]),
        (with_state(JobState::Stored), &[1, 1, 9, 2, 3, 4, 5, 6]),
        (lines(Some(Fault::Held)), &[2, 3, 0x39, 1, 6]),
        (broken(DefectKind::Flash), &[1, 1, 6, 9, 6, 2, 3, 4, 5, 6]),
        (refused(Refusal::NoRoom), &[4, 7, 7]),
        (stored(None), &[9, 3, 1, 0xe8, 7, 0xd0, 0x0f, 0]),
        (
            stored(Some(StoredJob { job: 7, kind: JobKind::Streams, length: 1061, name: "leaf" })),
            &[9, 3, 1, 0xe8, 7, 0xd0, 0x0f, 1, 7, 1, 0xa5, 0x08, 4, b'l', b'e', b'a', b'f'],
        ),
        (ToHost::Standing { standing: Standing::UNKNOWN, job: 7 }, &[10, 0, 7]),
        (ToHost::Standing { standing: Standing::AT_REST, job: 0 }, &[10, 1, 0]),
        (ToHost::Standing { standing: Standing::IN_SHEET, job: 300 }, &[10, 2, 0xac, 2]),
        // Of a later version: it says nothing that is known.
        (ToHost::Standing { standing: Standing(200), job: 0 }, &[10, 200, 0]),
    ]
}

#[test]
fn bytes_never_change() {
    let mut buffer = [0; frame::MAX];
    for (message, bytes) in to_bridge() {
        assert_eq!(postcard::to_slice(&message, &mut buffer).unwrap(), bytes, "{message:?}");
        assert_eq!(frame::decode::<ToBridge>(bytes), Ok(message));
    }
    for (message, bytes) in to_host() {
        assert_eq!(postcard::to_slice(&message, &mut buffer).unwrap(), bytes, "{message:?}");
        assert_eq!(frame::decode::<ToHost>(bytes), Ok(message));
    }
}

#[test]
fn the_fingerprint_is_that_of_every_example() {
    let all: Vec<u8> = to_bridge()
        .iter()
        .map(|(_, bytes)| *bytes)
        .chain(to_host().iter().map(|(_, bytes)| *bytes))
        .flatten()
        .copied()
        .collect();
    let sum = frame::checksum(&all);
    assert_eq!(SCHEMA, sum, "the message set has changed: SCHEMA should be {sum:#010x}");
}

#[test]
fn numbers_of_the_future_are_unknown_and_not_misread() {
    assert_eq!(frame::decode::<ToBridge>(&[99, 1, 2]), Err(frame::Unknown));
    assert_eq!(frame::decode::<ToHost>(&[1, 1, 99, 2, 3, 4, 5, 6]), Err(frame::Unknown));
    // A longer form of a known message is not that message.
    assert_eq!(frame::decode::<ToBridge>(&[3, 7, 0]), Err(frame::Unknown));
}

#[test]
fn the_longest_data_message_fits_a_frame() {
    let message = ToBridge::Data { job: u32::MAX, offset: u32::MAX, bytes: &[0xff; DATA_MAX] };
    assert!(frame::write(&message, &mut [0; frame::MAX]).is_ok());
}

#[test]
fn the_version_of_a_hello_is_found_whatever_follows_it() {
    for (_, bytes) in to_bridge().iter().take(1) {
        assert_eq!(hello_version(bytes), Some(1));
    }
    assert_eq!(hello_version(to_host()[0].1), Some(1));
    assert_eq!(hello_version(&[0, 77, 1, 2, 3, 4, 5, 6, 7]), Some(77));
    assert_eq!((hello_version(&[1, 77]), hello_version(&[0]), hello_version(&[])), (None, None, None));
}

#[test]
fn the_longest_memory_of_ended_jobs_fits_a_frame() {
    let state = JobState::Broken(Defect { at: u32::MAX, what: DefectKind::Truncated });
    let past = [PastJob { job: u32::MAX, state, printed: u32::MAX }; PAST];
    assert!(frame::write(&ToHost::Past(past), &mut [0; frame::MAX]).is_ok());
}

#[test]
fn the_worked_examples_of_the_document_are_these_bytes() {
    let text = include_str!("../../../../docs/wire-format.md");
    let mut buffer = [0; frame::MAX];
    let check = |frame: &[u8]| {
        let hex: Vec<std::string::String> = frame.iter().map(|byte| std::format!("{byte:02x}")).collect();
        let hex = hex.join(" ");
        assert!(text.contains(&std::format!("`{hex}`")), "docs/wire-format.md does not show `{hex}`");
    };
    let examples = [
        ToBridge::Hello { version: VERSION, schema: SCHEMA },
        ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 1061 },
        ToBridge::Data { job: 7, offset: 960, bytes: &[0x1b, 0x65, 0] },
        ToBridge::Cancel { job: 7 },
    ];
    for message in &examples {
        let length = frame::write(message, &mut buffer).unwrap();
        check(&buffer[..length]);
    }
    let length = frame::write(&ToHost::Progress(PROGRESS), &mut buffer).unwrap();
    check(&buffer[..length]);
}

#[test]
fn a_printer_that_is_off_is_not_called_out_of_paper() {
    assert_eq!(Lines::IDLE.fault(), None);
    assert_eq!(Lines(Lines::IDLE.0 | Lines::BUSY).fault(), None);
    assert_eq!(Lines(Lines::PAPER_OUT).fault(), Some(Fault::PowerOff));
    assert_eq!(Lines(Lines::POWER | Lines::PAPER_OUT).fault(), Some(Fault::PaperOut));
    assert_eq!(Lines(Lines::POWER | Lines::FAULT).fault(), Some(Fault::OffLine));
    assert_eq!(Lines(Lines::POWER | Lines::SELECT).fault(), Some(Fault::Error));
}

proptest! {
    #[test]
    fn no_bytes_make_decoding_fail_other_than_by_unknown(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
        let _ = frame::decode::<ToBridge>(&bytes);
        let _ = frame::decode::<ToHost>(&bytes);
    }
}
