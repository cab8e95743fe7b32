//! The printer's device ID: asked for by a host, or by the bridge itself when the printer has been switched
//! on.

use super::{ID, events, foreign, introducing, negotiations, send, text};
use bridge::driver::Event;
use bridge::port::Timing;
use bridge::printer_class::DeviceId;
use bridge::simulation::{Line, Peripheral, SimulatedPort, check};
use model::bench::{Bench, MS};
use model::{Board, seeded};
use protocol::link::message::{Answer, Ask, Fault, JobState, ToBridge};

#[test]
fn a_printer_that_does_not_negotiate_is_one_way() {
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, Peripheral { negotiates: false, ..Peripheral::default() });
    assert_eq!(bench.ask(1, Ask::Printer), text(Answer::OneWay));
    assert_eq!(bench.ask(2, Ask::DeviceId), text(Answer::OneWay));
    assert!(bench.board.events().contains(&Event::NoDeviceId) || bench.cable.now() < 500 * MS);
    assert!(bench.cable.taken().is_empty(), "the question is text to it");
}

#[test]
fn a_printer_that_has_shown_that_it_does_not_negotiate_is_left_alone_until_it_is_switched_on_again() {
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, Peripheral { negotiates: false, ..Peripheral::default() });
    bench.pass(600 * MS);
    assert_eq!((negotiations(&bench), events(&bench)), (1, vec![Event::NoDeviceId]));
    for request in 1..20 {
        assert_eq!(bench.ask(request, Ask::Printer), text(Answer::OneWay));
        assert_eq!(bench.ask(100 + request, Ask::DeviceId), text(Answer::OneWay));
    }
    bench.pass(5_000 * MS);
    assert_eq!((negotiations(&bench), bench.cable.taken().len()), (1, 0));
    // Also behind a restart of the bridge.
    let checkpoint = bench.board.clone().reset();
    let cable = bench.cable.clone();
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::on(&cable, &mut board, checkpoint);
    bench.pass(600 * MS);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::OneWay));
    assert_eq!(negotiations(&bench), 1);
    // Another printer may be there when it is on again, or the same in the middle of a sheet: behind a reset
    // it is asked.
    bench.cable.switch(false);
    bench.pass(30 * MS);
    bench.cable.switch(true);
    bench.pass(600 * MS);
    assert_eq!(negotiations(&bench), 1);
    bench.tell(&ToBridge::Initialise { request: 7 });
    bench.pass(600 * MS);
    assert_eq!(negotiations(&bench), 2);
}

#[test]
fn a_busy_printer_tells_no_device_id_and_says_why_if_it_can() {
    for (line, level, expected) in
        [(Line::Busy, 1, Answer::Silent), (Line::PaperOut, 1, Answer::Stopped(Fault::PaperOut))]
    {
        let mut board = Board::new(2048, 2048);
        let mut bench = Bench::new(&mut board, introducing(ID));
        bench.cable.plan(0, Line::Busy, 1);
        bench.cable.plan(0, line, level);
        bench.cable.pass(1);
        assert_eq!(bench.ask(1, Ask::DeviceId), text(expected));
    }
}

#[test]
fn the_device_id_comes_back_as_it_is_and_is_shown_from_then_on() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;";
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, introducing(told));
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(told)));
    assert_eq!(bench.id.bytes(), b"\x00\x1dMANUFACTURER:ALPS;MODEL:MD;");
}

#[test]
fn a_device_id_that_breaks_off_is_passed_on_and_one_beyond_the_room_is_cut() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;".to_vec();
    let mut board = Board::new(2048, 2048);
    let peripheral = Peripheral { dumb_after: Some(41), ..introducing(&told) };
    let mut bench = Bench::new(&mut board, peripheral);
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(&told[..20])));
    let long = [&b"\x10\x00MFG:ALPS;DES:"[..], &[b'x'; 2000], b";"].concat();
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, introducing(&long));
    assert_eq!(bench.ask(1, Ask::DeviceId), text(Answer::Bytes(&long[..512])));
    assert_eq!(bench.id.bytes().len(), 512);
    send(&mut bench, 7, b"after");
    bench.pass(100 * MS);
    assert_eq!(bench.cable.taken(), b"after");
}

#[test]
fn a_printer_introduces_itself_once_each_time_it_is_switched_on() {
    let told = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;".to_vec();
    let mut board = Board::new(2048, 2048);
    let mut bench = Bench::new(&mut board, introducing(&told));
    let unheard = DeviceId::new().bytes().to_vec();
    bench.pass(480 * MS);
    assert_eq!((bench.id.bytes(), events(&bench)), (&unheard[..], vec![]));
    bench.pass(100 * MS);
    assert_eq!(events(&bench), [Event::DeviceId(told.len())]);
    let heard = bench.id.bytes().to_vec();
    assert!(heard.ends_with(b"MODEL:MD;"));
    bench.pass(5_000 * MS);
    assert_eq!(events(&bench).len(), 1);
    bench.cable.switch(false);
    bench.pass(30 * MS);
    assert_eq!(bench.id.bytes(), unheard);
    bench.cable.switch(true);
    bench.pass(600 * MS);
    assert_eq!(
        (bench.id.bytes(), events(&bench).len()),
        (&unheard[..], 1),
        "it may be in the middle of a sheet"
    );
    bench.tell(&ToBridge::Initialise { request: 7 });
    bench.pass(600 * MS);
    assert_eq!((bench.id.bytes(), events(&bench).len()), (&heard[..], 2));
    assert!(bench.cable.taken().is_empty());
}

#[test]
fn a_printer_that_is_busy_or_in_use_is_not_asked_for_its_device_id() {
    let mut board = Board::new(4096, 4096);
    let mut bench = Bench::new(&mut board, Peripheral { work: 700_000, ..Peripheral::default() });
    // A job that takes two seconds.
    let bytes = foreign(2_800);
    send(&mut bench, 7, &bytes);
    bench.pass(1_900 * MS);
    assert_eq!(events(&bench), []);
    bench.pass(150 * MS);
    assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done));
    assert_eq!(events(&bench), []);
    // A wiring test, whose levels stand.
    bench.tell(&ToBridge::Drive { data: 0x55, control: 0b0111 });
    bench.pass(2_000 * MS);
    assert_eq!(events(&bench), []);
    bench.tell(&ToBridge::Initialise { request: 7 });
    bench.pass(600 * MS);
    assert_eq!(events(&bench), [Event::NoDeviceId]);
}

#[test]
fn a_job_that_comes_about_when_the_printer_is_asked_for_its_device_id_loses_nothing() {
    for at in (494..504).flat_map(|ms| [ms * MS, ms * MS + 300_000, ms * MS + 700_000]) {
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::new(&mut board, introducing(ID));
        bench.random = Some(seeded(at));
        bench.pass(at);
        let bytes = foreign(2_000);
        send(&mut bench, 7, &bytes);
        bench.pass(800 * MS);
        assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done), "{at}");
        assert_eq!(events(&bench).len(), 1);
        assert_eq!(check(&bench.cable.edges(), &Timing::DEFAULT), []);
    }
}

#[test]
fn a_board_that_restarts_in_the_middle_of_a_conversation_ends_it_before_the_next_byte() {
    let mut steps = 0;
    loop {
        let cable = SimulatedPort::new(Peripheral { answer_after: 300_000, ..introducing(ID) });
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::on(&cable, &mut board, None);
        while negotiations(&bench) == 0 {
            bench.turn();
        }
        (0..steps).for_each(|_| bench.turn());
        if !events(&bench).is_empty() {
            break;
        }
        steps += 1;
        let checkpoint = bench.board.clone().reset();
        let mut board = Board::new(4096, 4096);
        let mut bench = Bench::on(&cable, &mut board, checkpoint);
        let bytes = foreign(2_000);
        send(&mut bench, 7, &bytes);
        bench.pass(100 * MS);
        assert_eq!((bench.cable.taken(), bench.state()), (bytes, JobState::Done), "after {steps} steps");
        assert_eq!(cable.resets(), 0, "a sheet that is being printed would be lost");
    }
    assert!(steps > 20, "{steps} steps");
}
