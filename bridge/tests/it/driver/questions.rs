//! The status question to the printer: when it is put, and what comes of it at printers of every kind.

use super::{answering, foreign, send, status, text};
use bridge::port::Timing;
use bridge::simulation::{Line, Pause, Peripheral, Response, check};
use model::bench::{Bench, MS};
use model::{Board, seeded};
use proptest::prelude::*;
use protocol::link::message::{Answer, Ask, Fault, JobKind, JobState, ToBridge};

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
        assert_eq!(bench.ask(1, Ask::Printer), text(Answer::Bytes(&whole)), "{first} bytes, {after_ms} ms");
        assert_eq!(bench.cable.taken(), [0x05, 0x01]);
        assert_eq!(check(&bench.cable.edges(), &Timing::DEFAULT), []);
    }
}

proptest! {
    #![proptest_config(testing::cases(24))]

    /// Whatever the printer's times are, it gets the question once, and its answer arrives if it comes in
    /// time.
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
        let answer = bench.ask(1, Ask::Printer);
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
        assert_eq!(bench.ask(1, Ask::Printer), text(Answer::Silent));
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
        assert_eq!(bench.ask(1, Ask::Printer), text(Answer::Silent));
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
        assert_eq!(bench.ask(1, Ask::Printer), text(Answer::Stopped(fault)));
        assert!(bench.cable.now() < 5 * MS);
        assert!(bench.cable.taken().is_empty());
        // Between its two bytes.
        let pauses = vec![Pause { after: 1, line, ns: 100 * MS }];
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, Peripheral { pauses, ..answering(vec![]) });
        if line != Line::Power {
            assert_eq!(bench.ask(1, Ask::Printer), text(Answer::Stopped(fault)));
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
        bench.tell(&ToBridge::Ask { request: 1, what: Ask::Printer });
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
fn the_printer_is_asked_only_when_it_is_known_to_stand_between_two_jobs() {
    let peripheral = || answering(vec![Response { after: 0, bytes: status() }]);
    let unsure = text(Answer::Unsure);
    let whole = text(Answer::Bytes(&status()));
    // A bridge that has just got its supply, and whose diary says nothing, does not know what the printer
    // stands in.
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::unaware(&mut board, peripheral());
    assert_eq!((bench.ask(1, Ask::Printer), bench.cable.taken().len()), (unsure.clone(), 0));
    assert_eq!(bench.ask(8, Ask::DeviceId), unsure, "a negotiation may disturb it");
    // Behind a reset or a job it does.
    bench.tell(&ToBridge::Initialise { request: 7 });
    bench.pass(60 * MS);
    assert_eq!(bench.ask(2, Ask::Printer), whole);
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::unaware(&mut board, peripheral());
    send(&mut bench, 7, b"text");
    bench.pass(60 * MS);
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
    assert_eq!(bench.ask(5, Ask::Printer), unsure, "it was its switch, or only the cable");
    // A job that ended before a byte of it crossed says nothing.
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::unaware(&mut board, peripheral());
    bench.tell(&ToBridge::Begin { job: 7, kind: JobKind::Raw, length: 9 });
    bench.tell(&ToBridge::Cancel { job: 7 });
    bench.pass(60 * MS);
    assert_eq!((bench.state(), bench.ask(6, Ask::Printer)), (JobState::Cancelled, unsure.clone()));
    // In the middle of a row, too.
    send(&mut bench, 8, &foreign(3_000));
    bench.pass(5 * MS);
    bench.cable.plan(0, Line::Power, 0);
    bench.pass(40 * MS);
    bench.cable.plan(0, Line::Select, 0);
    bench.cable.plan(0, Line::Power, 1);
    bench.pass(40 * MS);
    let had = bench.cable.taken().len();
    assert_eq!((bench.state(), bench.cable.resets()), (JobState::Lost, 1));
    assert_eq!(bench.ask(7, Ask::Printer), unsure);
    assert_eq!(bench.cable.taken().len(), had);
}
