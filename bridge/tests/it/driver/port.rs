//! Who may use the port, and for how long.

use super::{ID, answering, events, foreign, send, settings, status, text};
use bridge::driver::Event;
use bridge::port::Timing;
use bridge::simulation::{Line, Peripheral, Response};
use model::Board;
use model::bench::{Bench, MS};
use protocol::link::message::{Answer, Ask, Handshake, JobState, ToBridge};

#[test]
fn the_link_is_answered_and_a_job_is_taken_while_the_printer_is_asked() {
    let status_answer = vec![Response { after: 1_500 * MS, bytes: status() }];
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, answering(status_answer));
    bench.tell(&ToBridge::Ask { request: 1, what: Ask::Printer });
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
fn a_task_goes_before_the_introduction_when_both_are_due() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(
        &mut board,
        Peripheral {
            device_id: Some(ID.to_vec()),
            status: vec![Response { after: 0, bytes: status() }],
            ..Peripheral::default()
        },
    );
    bench.pass(499 * MS);
    bench.cable.pass(10 * MS);
    bench.tell(&ToBridge::Ask { request: 1, what: Ask::Printer });
    bench.pass(3 * MS);
    assert_eq!((bench.cable.taken(), events(&bench)), (vec![5, 1], vec![]));
    bench.hear("Answer { request: 1, answer: ");
    assert_eq!(events(&bench), []);
    bench.pass(600 * MS);
    assert_eq!(events(&bench), [Event::DeviceId(12)]);
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
            bench.ask(1, Ask::Printer);
            bench.ask(2, Ask::DeviceId);
            let before = bench.cable.taken().len();
            send(&mut bench, 7, &foreign(1_000));
            bench.tell(&ToBridge::Initialise { request: 7 });
            bench.pass(3_000 * MS);
            assert_eq!(bench.state(), JobState::Done, "{name}, {handshake:?}");
            assert!(bench.cable.taken()[before..] == foreign(1_000), "{name}, {handshake:?}");
            assert!(bench.longest < MS, "{name}, {handshake:?}: {} ns", bench.longest);
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
