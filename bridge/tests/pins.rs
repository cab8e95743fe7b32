//! The whole bridge on pins: frames go in at one end, a printer in virtual time stands at the other.

mod model;

use bridge::engine::Engine;
use bridge::pinned::{Pinned, Turn};
use bridge::port::{Port, Timing};
use bridge::simulation::{
    AckLine, DataLines, DelayLine, InLine, Line, OutLine, Pause, Peripheral, SimulatedPort, check,
};
use model::{Board, Host, IDENTITY, Job, framed, seeded};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{Answer, Ask, Fault, Handshake, JobState, PortSettings, ToBridge, ToHost};
use rand::RngExt;

type Bridge<'m> = Pinned<'m, DataLines, OutLine, InLine, AckLine, DelayLine>;

fn connect(board: &mut Board, peripheral: Peripheral) -> (SimulatedPort, Bridge<'_>) {
    let cable = SimulatedPort::new(peripheral);
    let (pins, delay) = cable.pins();
    (cable, Pinned::new(Engine::new(board.memory(), IDENTITY), Port::new(pins, delay)))
}

fn turn(cable: &SimulatedPort, bridge: &mut Bridge<'_>) -> Turn {
    let turn = bridge.turn((cable.now() / 1_000_000) as u32);
    cable.pass(if turn == Turn::Rest { 1_000_000 } else { 20_000 });
    turn
}

fn heard(bridge: &mut Bridge<'_>) -> Vec<u8> {
    let (mut bytes, mut frame) = (Vec::new(), [0; MAX]);
    loop {
        let length = bridge.engine.transmit(&mut frame);
        if length == 0 {
            return bytes;
        }
        bytes.extend_from_slice(&frame[..length]);
    }
}

/// The text of the answer to a question.
fn ask(cable: &SimulatedPort, bridge: &mut Bridge<'_>, what: Ask) -> String {
    bridge.engine.receive(&mut Reader::new(), &framed(&ToBridge::Ask { request: 1, what }));
    for _ in 0..40_000 {
        turn(cable, bridge);
        let bytes = heard(bridge);
        let (mut reader, mut left) = (Reader::new(), &bytes[..]);
        while let Read::Message(message, rest) = reader.read(left) {
            if let Ok(ToHost::Answer { request: 1, answer }) = frame::decode(message) {
                return format!("{answer:?}");
            }
            left = rest;
        }
    }
    panic!("no answer in {} ms", cable.now() / 1_000_000);
}

#[test]
fn jobs_reach_the_paper_through_frames_and_pins() {
    for seed in 0..12 {
        let mut random = seeded(seed);
        let job = Job::random(1, &mut random);
        let mut board = Board::new(4096, 4096);
        let lines = [Line::Busy, Line::PaperOut, Line::Select, Line::Fault];
        let pauses: Vec<Pause> = (0..3)
            .map(|_| Pause {
                after: random.random_range(1..=job.expected.len()),
                line: lines[random.random_range(0..4)],
                ns: random.random_range(1..2_000_000_000),
            })
            .collect();
        let peripheral = Peripheral { work: random.random_range(0..20_000), pauses, ..Peripheral::default() };
        let (cable, mut bridge) = connect(&mut board, peripheral);
        let handshake = if seed % 2 == 0 { Handshake::Busy } else { Handshake::BusyAck };
        let settings = PortSettings { handshake, ..Timing::FAST.settings() };
        let mut reader = Reader::new();
        bridge.engine.receive(&mut reader, &framed(&ToBridge::Configure(settings)));
        turn(&cable, &mut bridge);
        let mut host = Host::new(&job);
        let mut turns = 0;
        while host.finished.is_none() {
            for frame in host.speak() {
                bridge.engine.receive(&mut reader, &frame);
            }
            for _ in 0..50 {
                turn(&cable, &mut bridge);
            }
            host.hear(&heard(&mut bridge));
            turns += 1;
            assert!(turns < 10_000, "seed {seed}: no end");
        }
        assert_eq!(host.finished, Some(JobState::Done), "seed {seed}");
        assert!(cable.taken() == job.expected, "seed {seed}: other bytes on the paper");
        assert_eq!(check(&cable.edges(), &Timing::FAST), [], "seed {seed}");
    }
}

#[test]
fn the_printers_status_comes_back_through_the_status_lines() {
    let mut answer = vec![0x02, 0x80, 0x21, 0x00, 0x10];
    answer.extend([0xff, 0, 0].repeat(9));
    answer.extend([0, 0, 0, 0, 0, 0x03]);
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) =
        connect(&mut board, Peripheral { reverse_data: answer.clone(), ..Peripheral::default() });
    assert_eq!(ask(&cable, &mut bridge, Ask::Printer), format!("{:?}", Answer::Bytes(&answer)));
    assert_eq!(cable.taken(), [0x05, 0x01]);
    assert_eq!(check(&cable.edges(), &Timing::DEFAULT), []);
}

#[test]
fn a_printer_that_does_not_answer_is_called_silent_or_one_way_or_stopped() {
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) = connect(&mut board, Peripheral::default());
    assert_eq!(ask(&cable, &mut bridge, Ask::Printer), format!("{:?}", Answer::Silent));
    assert!(cable.now() >= 10_000_000_000, "it was given ten seconds");
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) = connect(&mut board, Peripheral { negotiates: false, ..Peripheral::default() });
    assert_eq!(ask(&cable, &mut bridge, Ask::Printer), format!("{:?}", Answer::OneWay));
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) = connect(&mut board, Peripheral::default());
    cable.plan(0, Line::PaperOut, 1);
    assert_eq!(ask(&cable, &mut bridge, Ask::Printer), format!("{:?}", Answer::Stopped(Fault::PaperOut)));
    assert!(cable.taken().is_empty());
}

#[test]
fn the_device_id_comes_back_with_its_length() {
    let id = b"\x00\x1eMANUFACTURER:ALPS;MODEL:MD;";
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) =
        connect(&mut board, Peripheral { device_id: Some(id.to_vec()), ..Peripheral::default() });
    assert_eq!(ask(&cable, &mut bridge, Ask::DeviceId), format!("{:?}", Answer::Bytes(id)));
}

#[test]
fn the_boot_loader_is_the_callers() {
    let mut board = Board::new(2048, 2048);
    let (cable, mut bridge) = connect(&mut board, Peripheral::default());
    bridge.engine.receive(&mut Reader::new(), &framed(&ToBridge::Bootloader));
    assert_eq!(turn(&cable, &mut bridge), Turn::Bootloader);
}
