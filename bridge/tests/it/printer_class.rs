//! The ordinary printer: packets of an operating system, with an engine behind them and a printer that is a list.

use bridge::engine::{Engine, LOCAL};
use bridge::printer_class::{End, Intake, Next, PACKET};
use model::{IDENTITY, Job, framed, is_a_whole_job, memory, rested, seeded};
use proptest::prelude::*;
use protocol::link::frame::Reader;
use protocol::link::message::{Fault, JobKind, JobState, Lines, ToBridge};
use rand::RngExt;

/// A second, in µs.
const S: u64 = 1_000_000;

struct Rig {
    engine: Engine<'static>,
    intake: Intake,
    now: u64,
    printed: Vec<u8>,
    /// Bytes the printer takes in a millisecond.
    pace: usize,
}

impl Rig {
    fn new() -> Rig {
        let mut intake = Intake::new();
        intake.connect(0);
        let engine = rested(memory(2048, 4096, 40_000), IDENTITY);
        Rig { engine, intake, now: 0, printed: Vec::new(), pace: 400 }
    }

    /// A millisecond, with what the engine and the printer do in it.
    fn tick(&mut self) {
        self.now += 1000;
        if let Next::Time(at) | Next::Packet(at) = self.intake.next()
            && at <= self.now
        {
            self.intake.wake(&mut self.engine, self.now);
        }
        while self.engine.work() {}
        if let Some(task) = self.engine.task() {
            panic!("{task:?}");
        }
        let output = self.engine.output();
        let count = output.len().min(self.pace);
        self.printed.extend_from_slice(&output[..count]);
        self.engine.consumed(count);
    }

    fn pass(&mut self, us: u64) {
        for _ in 0..us / 1000 {
            self.tick();
        }
    }

    fn wants(&self) -> bool {
        matches!(self.intake.next(), Next::Packet(_))
    }

    /// A packet, as soon as one is wanted. Returns after how many ms that was.
    fn packet(&mut self, bytes: &[u8]) -> u64 {
        let before = self.now;
        while !self.wants() {
            self.tick();
            assert!(self.now - before < 100 * S, "no packet is wanted any more");
        }
        self.intake.buffer()[..bytes.len()].copy_from_slice(bytes);
        self.intake.receive(bytes.len(), &mut self.engine, self.now);
        (self.now - before) / 1000
    }

    fn end(&mut self, end: End) {
        self.intake.end(end, &mut self.engine, self.now);
    }

    fn write(&mut self, bytes: &[u8]) {
        for packet in bytes.chunks(PACKET) {
            self.packet(packet);
        }
    }

    fn state(&self) -> (u32, JobState) {
        let progress = self.engine.progress();
        (progress.job, progress.state)
    }
}

proptest! {
    #![proptest_config(testing::cases(40))]

    /// A slow or a quick host, a slow or a quick printer, packets of any length, empty ones among them.
    #[test]
    fn what_a_host_writes_arrives_byte_for_byte_whatever_the_packets_and_the_pace(
        seed in any::<u64>(),
        pace in 1usize..800,
        longest_pause_ms in prop_oneof![Just(0u64), Just(3), Just(2_000)],
        count in 1usize..3,
    ) {
        let mut random = seeded(seed);
        let mut rig = Rig::new();
        rig.pace = pace;
        let mut expected = Vec::new();
        for _ in 0..count {
            expected.extend(Job::random(1, &mut random).expected.into_iter());
        }
        // Pauses are rare when they are long.
        let rare = 1 + longest_pause_ms as u32;
        let mut left = &expected[..];
        while !left.is_empty() {
            let (packet, rest) = left.split_at(random.random_range(0..=PACKET).min(left.len()));
            rig.packet(packet);
            left = rest;
            if random.random_range(0..rare) == 0 {
                rig.pass(random.random_range(0..=longest_pause_ms) * 1000);
            }
        }
        for _ in 0..10_000 {
            rig.pass(100_000);
            if rig.printed.len() >= expected.len() {
                break;
            }
        }
        prop_assert!(rig.printed == expected);
        rig.pass(10_000);
        prop_assert_eq!(rig.state(), (LOCAL, JobState::Done));
    }
}

#[test]
fn a_packet_is_held_while_a_job_of_the_link_is_open_and_no_other_is_wanted() {
    let mut rig = Rig::new();
    let mut reader = Reader::new();
    rig.engine.receive(&mut reader, &framed(&ToBridge::Begin { job: 5, kind: JobKind::Raw, length: 4 }));
    rig.packet(b"plain text");
    assert_eq!(rig.intake.next(), Next::Time(1000));
    rig.pass(3 * S);
    assert!(!rig.wants() && rig.printed.is_empty());
    rig.engine.receive(&mut reader, &framed(&ToBridge::Data { job: 5, offset: 0, bytes: b"link" }));
    rig.pass(3_000);
    assert!(rig.wants());
    rig.pass(5_000);
    assert_eq!(rig.printed, b"linkplain text");
}

#[test]
fn a_packet_that_is_held_is_dropped_when_the_host_resets_or_goes() {
    for end in [End::Reset, End::Gone] {
        let mut rig = Rig::new();
        let mut reader = Reader::new();
        rig.engine.receive(&mut reader, &framed(&ToBridge::Begin { job: 5, kind: JobKind::Raw, length: 4 }));
        rig.packet(b"dropped");
        rig.pass(2_000);
        rig.end(end);
        assert!(rig.wants());
        rig.engine.receive(&mut reader, &framed(&ToBridge::Data { job: 5, offset: 0, bytes: b"link" }));
        rig.packet(b"kept");
        rig.pass(20_000);
        assert_eq!(rig.printed, b"linkkept", "{end:?}");
    }
}

#[test]
fn a_soft_reset_anywhere_in_a_job_ends_the_sheet_and_the_next_job_prints() {
    for seed in 0..40 {
        let mut random = seeded(seed);
        let job = Job::random(1, &mut random).expected;
        let mut rig = Rig::new();
        rig.pace = random.random_range(1..60);
        rig.write(&job[..random.random_range(0..job.len())]);
        rig.pass(random.random_range(0..30) * 1000);
        rig.end(End::Reset);
        // The endpoint may still give a packet that the host has sent before.
        for _ in 0..1_000 {
            rig.pass(10_000);
            if rig.state().1 != JobState::Cancelling {
                break;
            }
        }
        assert!(rig.printed.is_empty() || is_a_whole_job(&rig.printed), "seed {seed}");
        rig.printed.clear();
        rig.pace = 400;
        rig.write(&job);
        rig.pass(S);
        assert!(rig.printed == job, "seed {seed}");
    }
}

#[test]
fn a_host_that_goes_leaves_a_whole_job_and_text_as_it_is() {
    let job = Job::random(1, &mut seeded(3)).expected;
    let mut rig = Rig::new();
    rig.write(&job[..job.len() * 2 / 3]);
    rig.end(End::Gone);
    rig.pass(S);
    assert!(is_a_whole_job(&rig.printed));
    rig.printed.clear();
    rig.write(b"text");
    rig.end(End::Gone);
    rig.pass(S);
    assert_eq!(rig.printed, b"text");
    assert_eq!(rig.state(), (LOCAL, JobState::Done));
}

/// How many seconds of silence end a job.
fn patience(rig: &mut Rig) -> u64 {
    let before = rig.now;
    while rig.state().1 == JobState::Printing {
        rig.pass(100_000);
        assert!(rig.now - before < 400 * S);
    }
    (rig.now - before) / S
}

#[test]
fn a_silent_host_has_five_minutes_with_a_sheet_in_the_printer_and_five_seconds_without() {
    let job = Job::random(1, &mut seeded(3)).expected;
    let mut rig = Rig::new();
    rig.write(&job[..job.len() * 2 / 3]);
    rig.pass(500_000);
    assert!((299..=300).contains(&patience(&mut rig)));
    assert!(is_a_whole_job(&rig.printed));
    let mut rig = Rig::new();
    rig.write(b"text");
    assert_eq!(patience(&mut rig), 5);
}

#[test]
fn any_packet_begins_the_silence_anew_even_an_empty_one() {
    let mut rig = Rig::new();
    rig.write(b"text");
    for _ in 0..10 {
        rig.pass(4 * S);
        rig.packet(&[]);
        assert_eq!(rig.state().1, JobState::Printing);
    }
    assert_eq!(patience(&mut rig), 5);
    assert_eq!(rig.printed, b"text");
}

#[test]
fn an_empty_packet_opens_no_job() {
    let mut rig = Rig::new();
    rig.packet(&[]);
    rig.pass(10 * S);
    assert_eq!(rig.state(), (0, JobState::None));
}

#[test]
fn a_printer_that_waits_for_its_operator_is_no_silence_of_the_host() {
    let mut rig = Rig::new();
    rig.pace = 0;
    rig.write(b"text");
    rig.engine.port(Lines::IDLE, Some(Fault::PaperOut));
    rig.pass(1_000 * S);
    assert_eq!(rig.state(), (LOCAL, JobState::Stopped(Fault::PaperOut)));
    rig.engine.port(Lines::IDLE, None);
    rig.pace = 400;
    rig.write(b" goes on");
    rig.pass(10 * S);
    assert_eq!((&rig.printed[..], rig.state().1), (&b"text goes on"[..], JobState::Done));
}
