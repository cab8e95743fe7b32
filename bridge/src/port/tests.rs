//! The port against a printer in virtual time.

use super::*;
use crate::simulation::{
    AckLine, DataLines, DelayLine, InLine, Line, OutLine, Pause, Peripheral, SimulatedPort, check,
};
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

type TestPort = Port<DataLines, OutLine, InLine, AckLine, DelayLine>;

fn connect(peripheral: Peripheral) -> (SimulatedPort, TestPort) {
    let cable = SimulatedPort::new(peripheral);
    let (pins, delay) = cable.pins();
    let port = Port::new(pins, delay);
    (cable, port)
}

/// Writes everything as a caller would who has other things to do; gives the faults that were reported.
fn write_all(cable: &SimulatedPort, port: &mut TestPort, bytes: &[u8]) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut left = bytes;
    while !left.is_empty() {
        let written = port.write(left, (cable.now() / 1_000_000) as u32);
        left = &left[written.count..];
        match written.stop {
            None => assert!(left.is_empty(), "stopped without a reason"),
            Some(Stop::Busy) => cable.pass(20_000_000),
            Some(Stop::Fault(fault)) => {
                if faults.last() != Some(&fault) {
                    faults.push(fault);
                }
                cable.pass(1_000_000_000);
            }
        }
        assert!(cable.now() < 7_200_000_000_000, "two hours have passed");
    }
    faults
}

/// Reads as a caller would who has other things to do.
fn read(
    cable: &SimulatedPort,
    port: &mut TestPort,
    what: Reverse,
    buffer: &mut [u8],
) -> Result<usize, ReverseError> {
    let mut talk = Conversation::new(what);
    loop {
        let before = cable.now();
        let ended = port.converse(&mut talk, buffer, cable.now() / 1000);
        assert!(cable.now() - before < 500_000, "{} ns without a pause", cable.now() - before);
        match ended {
            Some(ended) => return ended,
            None => cable.pass(100_000),
        }
    }
}

fn settings(timing: Timing, handshake: Handshake) -> PortSettings {
    PortSettings { handshake, ..timing.settings() }
}

fn a_timing() -> impl Strategy<Value = Timing> {
    prop_oneof![
        Just(Timing::DEFAULT),
        Just(Timing::FAST),
        Just(Timing::SAFE),
        Just(Timing::SLOW),
        (100u32..3000, 100u32..3000, 100u32..3000).prop_map(|(setup, strobe, hold)| Timing {
            setup,
            strobe,
            hold,
            settle: 500
        }),
    ]
}

proptest! {
    #![proptest_config(testing::cases(48))]

    #[test]
    fn every_byte_crosses_once_and_no_time_is_cut_short(
        bytes in prop::collection::vec(any::<u8>(), 1..120),
        timing in a_timing(),
        handshake in prop_oneof![Just(Handshake::Busy), Just(Handshake::BusyAck)],
        (busy_after, work, ack) in (0u64..=500, 0u64..20_000, 500u64..10_000),
        pauses in prop::collection::vec((1usize..120, 0usize..4, 1u64..1_000_000_000), 0..3),
    ) {
        let lines = [Line::Busy, Line::PaperOut, Line::Select, Line::Fault];
        let pauses = pauses.into_iter().map(|(after, line, ns)| Pause { after, line: lines[line], ns }).collect();
        let (cable, mut port) = connect(Peripheral { busy_after, work, ack, pauses, ..Peripheral::default() });
        port.configure(&settings(timing, handshake)).unwrap();
        write_all(&cable, &mut port, &bytes);
        prop_assert_eq!(cable.taken(), bytes);
        prop_assert_eq!(check(&cable.edges(), &timing), vec![]);
    }

    #[test]
    fn a_printer_with_only_an_acknowledge_gets_every_byte_at_its_own_pace(
        bytes in prop::collection::vec(any::<u8>(), 1..120),
        (work, ack) in (0u64..20_000, 500u64..10_000),
    ) {
        let (cable, mut port) = connect(Peripheral { has_busy: false, work, ack, ..Peripheral::default() });
        port.configure(&settings(Timing::DEFAULT, Handshake::Ack)).unwrap();
        write_all(&cable, &mut port, &bytes);
        prop_assert_eq!(cable.taken(), bytes);
        // Between two strobes there is an acknowledge.
        let mut acknowledged = true;
        for edge in cable.edges() {
            match (edge.line, edge.level) {
                (Line::Ack, 0) => acknowledged = true,
                (Line::Strobe, 0) => prop_assert!(core::mem::replace(&mut acknowledged, false)),
                _ => {}
            }
        }
    }

    #[test]
    fn a_device_id_comes_back_whatever_the_printer_says_its_length_is(
        text in prop::collection::vec(any::<u8>(), 0..200),
        answer_after in 0u64..30_000_000,
    ) {
        let (cable, mut port) = connect(Peripheral { device_id: Some(text.clone()), answer_after, ..Peripheral::default() });
        let mut buffer = [0; 256];
        // A printer slower than the limit is silent, not misread; 500 ns belong to its settling time.
        let found = read(&cable, &mut port, Reverse::DeviceId, &mut buffer);
        prop_assert_eq!(found, Ok(text.len()));
        prop_assert_eq!(&buffer[..text.len()], &text[..]);
        write_all(&cable, &mut port, b"after");
        prop_assert_eq!(cable.taken(), b"after");
        prop_assert_eq!(check(&cable.edges(), &Timing::DEFAULT), vec![]);
    }
}

#[test]
fn the_checker_finds_a_strobe_that_is_too_early() {
    let (cable, mut port) = connect(Peripheral::default());
    port.configure(&settings(Timing::FAST, Handshake::Busy)).unwrap();
    write_all(&cable, &mut port, b"ab");
    assert_eq!(check(&cable.edges(), &Timing::FAST), []);
    // The same waveform held against longer times: setup, strobe and hold of both bytes but the last hold.
    assert_eq!(check(&cable.edges(), &Timing::SLOW).len(), 5);
}

/// Busy that rises when it is believed, and not sooner, loses nothing: also where that is later than the strobe, the data and the next
/// byte's setup together.
#[test]
fn busy_that_rises_as_late_as_it_is_believed_loses_nothing() {
    for (around, settle) in [(100, 500), (400, 3_000)] {
        let peripheral =
            Peripheral { busy_after: settle.into(), work: 50_000, ack: 0, ..Peripheral::default() };
        let (cable, mut port) = connect(peripheral);
        let timing = Timing { setup: 100, strobe: around, hold: around, settle };
        port.configure(&settings(timing, Handshake::Busy)).unwrap();
        write_all(&cable, &mut port, &[1, 2, 3, 4]);
        assert_eq!(cable.taken(), [1, 2, 3, 4]);
        assert_eq!(check(&cable.edges(), &timing), []);
    }
}

#[test]
fn an_operator_may_take_an_hour() {
    let pauses = vec![Pause { after: 2, line: Line::PaperOut, ns: 3_600_000_000_000 }];
    let (cable, mut port) = connect(Peripheral { pauses, ..Peripheral::default() });
    assert_eq!(write_all(&cable, &mut port, b"abcd"), [Fault::PaperOut]);
    assert_eq!(cable.taken(), b"abcd");
}

#[test]
fn a_busy_printer_is_called_a_fault_after_the_patience_and_still_gets_its_bytes() {
    let pauses = vec![Pause { after: 2, line: Line::Busy, ns: 61_000_000_000 }];
    let (cable, mut port) = connect(Peripheral { pauses, ..Peripheral::default() });
    port.configure(&PortSettings { patience_s: 60, ..Timing::DEFAULT.settings() }).unwrap();
    assert_eq!(write_all(&cable, &mut port, b"abcd"), [Fault::BusyTooLong]);
    assert_eq!(cable.taken(), b"abcd");
}

#[test]
fn an_acknowledge_that_never_comes_is_reported_and_does_not_hold_the_sheet() {
    let (cable, mut port) = connect(Peripheral { ack: 0, ..Peripheral::default() });
    port.configure(&settings(Timing::DEFAULT, Handshake::BusyAck)).unwrap();
    assert_eq!(write_all(&cable, &mut port, b"ab"), [Fault::NoAck]);
    assert_eq!(cable.taken(), b"ab");
}

#[test]
fn a_printer_that_is_switched_off_gets_nothing() {
    let (cable, mut port) = connect(Peripheral::default());
    cable.plan(0, Line::Power, 0);
    cable.pass(1);
    let written = port.write(b"a", 0);
    assert_eq!(written, Written { count: 0, stop: Some(Stop::Fault(Fault::PowerOff)) });
    assert_eq!(cable.taken(), b"");
}

#[test]
fn a_line_that_is_not_heeded_stops_nothing() {
    let (cable, mut port) = connect(Peripheral::default());
    cable.plan(0, Line::Select, 0);
    cable.pass(1);
    assert_eq!(port.write(b"a", 0).stop, Some(Stop::Fault(Fault::OffLine)));
    let heed = Lines(Lines::ALL.0 & !Lines::SELECT);
    port.configure(&PortSettings { heed, ..Timing::DEFAULT.settings() }).unwrap();
    assert_eq!(port.write(b"a", 0), Written { count: 1, stop: None });
}

#[test]
fn a_printer_that_goes_busy_between_two_looks_is_not_strobed() {
    // For every moment of the first byte: a printer's own key makes it busy then.
    for at in (0..3000).step_by(7) {
        let (cable, mut port) = connect(Peripheral { ack: 0, work: 0, ..Peripheral::default() });
        cable.plan(at, Line::Busy, 1);
        cable.plan(at + 200_000, Line::Busy, 0);
        write_all(&cable, &mut port, b"ab");
        let strobes =
            cable.edges().iter().filter(|edge| edge.line == Line::Strobe && edge.level == 0).count();
        assert_eq!((cable.taken().as_slice(), strobes), (&b"ab"[..], 2));
        let edges = cable.edges();
        // What falls within the last look at the lines and the strobe itself, 32 ns here, no host can see.
        let raced = check(&edges, &Timing::DEFAULT).iter().any(|violation| {
            !matches!(violation, crate::simulation::Violation::NotReady { at: strobe } if strobe - at <= 32)
                && !matches!(violation, crate::simulation::Violation::ChangedWhileBusy { at: change } if change - at <= 32)
        });
        assert!(!raced, "busy at {at}: {:?}", check(&edges, &Timing::DEFAULT));
    }
}

#[test]
fn a_printer_of_before_1284_goes_on_printing_after_a_negotiation() {
    let (cable, mut port) = connect(Peripheral { negotiates: false, ..Peripheral::default() });
    assert_eq!(read(&cable, &mut port, Reverse::DeviceId, &mut [0; 64]), Err(ReverseError::OneWay));
    write_all(&cable, &mut port, b"text");
    assert_eq!(cable.taken(), b"text");
    assert_eq!(check(&cable.edges(), &Timing::DEFAULT), []);
}

#[test]
fn a_mode_the_printer_does_not_offer_is_refused_and_left() {
    let (cable, mut port) = connect(Peripheral { device_id: None, ..Peripheral::default() });
    assert_eq!(read(&cable, &mut port, Reverse::DeviceId, &mut [0; 64]), Err(ReverseError::Refused));
    write_all(&cable, &mut port, b"text");
    assert_eq!(cable.taken(), b"text");
}

#[test]
fn both_nibbles_of_every_byte_arrive() {
    let all: Vec<u8> = (0..=255).collect();
    let (cable, mut port) = connect(Peripheral { reverse_data: all.clone(), ..Peripheral::default() });
    let mut buffer = [0; 300];
    assert_eq!(read(&cable, &mut port, Reverse::Answer, &mut buffer), Ok(256));
    assert_eq!(buffer[..256], all);
}

#[test]
fn an_answer_can_be_read_in_pieces_and_nothing_is_an_answer_too() {
    let (cable, mut port) =
        connect(Peripheral { reverse_data: vec![1, 2, 3, 4, 5], ..Peripheral::default() });
    let mut buffer = [0; 3];
    assert_eq!((read(&cable, &mut port, Reverse::Answer, &mut buffer), buffer), (Ok(3), [1, 2, 3]));
    assert_eq!((read(&cable, &mut port, Reverse::Answer, &mut buffer), buffer), (Ok(2), [4, 5, 3]));
    assert_eq!(read(&cable, &mut port, Reverse::Answer, &mut buffer), Ok(0));
}

#[test]
fn a_printer_that_falls_silent_leaves_what_came_and_a_working_port() {
    let device_id = Some(b"\x00\x0dMFG:ALPS;..".to_vec());
    let (cable, mut port) = connect(Peripheral { device_id, dumb_after: Some(9), ..Peripheral::default() });
    let mut buffer = [0; 64];
    assert_eq!(read(&cable, &mut port, Reverse::DeviceId, &mut buffer), Err(ReverseError::Silent(4)));
    assert_eq!(&buffer[..4], b"\x00\x0dMF");
    write_all(&cable, &mut port, b"text");
    assert_eq!(cable.taken(), b"text");
}

#[test]
fn a_busy_printer_is_not_negotiated_with() {
    let (cable, mut port) = connect(Peripheral { work: 1_000_000, ..Peripheral::default() });
    write_all(&cable, &mut port, b"x");
    assert_eq!(read(&cable, &mut port, Reverse::Answer, &mut [0; 4]), Err(ReverseError::NotIdle));
    assert!(cable.edges().iter().all(|edge| edge.line != Line::SelectIn));
}

#[test]
fn a_reset_is_long_enough() {
    let (cable, mut port) = connect(Peripheral::default());
    port.initialise();
    let edges: Vec<_> = cable.edges().into_iter().filter(|edge| edge.line == Line::Init).collect();
    assert_eq!(cable.resets(), 1);
    assert!(edges[1].at - edges[0].at >= 50_000);
}

#[test]
fn settings_no_printer_could_follow_are_refused() {
    let (_, mut port) = connect(Peripheral::default());
    let settings = PortSettings { strobe_ns: 0, ..Timing::DEFAULT.settings() };
    assert_eq!(port.configure(&settings), Err(BadSettings));
}
