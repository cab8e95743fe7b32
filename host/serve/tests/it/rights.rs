//! Whose a job is: who may change it from another computer.

use std::net::IpAddr;

use serve::body::Limits;
use serve::jobs::{Owner, State};
use serve::operations::answer;
use serve::server::Server;
use serve::template::Ticket;
use serve::wire::{Place, Request};
use testing::ipp;

use super::Running;

const HOLD: u16 = 0x0c;
const RELEASE: u16 = 0x0d;
const CANCEL_MY: u16 = 0x39;
const CLOSE: u16 = 0x3b;

/// Who asks: from where, under which name, with the code or without it.
struct Asks(&'static str, &'static str, bool);

const OWNER: Asks = Asks("192.168.1.7", "ada", false);
const OTHERS: [Asks; 2] = [Asks("192.168.1.8", "ada", false), Asks("192.168.1.7", "eve", false)];

fn ask(server: &Server, Asks(from, user, is_keeper): &Asks, operation: u16, job: u32) -> u16 {
    let from: IpAddr = from.parse().unwrap();
    let place = Place {
        host: "192.168.1.5:8631".into(),
        is_encrypted: false,
        printer: "standard".into(),
        from,
        is_keeper: *is_keeper,
    };
    let number = (job as i32).to_be_bytes();
    let named = [(0x42, "requesting-user-name", user.as_bytes()), (0x21, "job-id", &number[..])];
    let named = if operation == CANCEL_MY { &named[..1] } else { &named[..] };
    let bytes = ipp::request(operation, "ipp://192.168.1.5:8631/ipp/print/standard", named, &[]);
    let answered = answer(server, &place, &Request::read(bytes).unwrap()).bytes();
    u16::from_be_bytes([answered[2], answered[3]])
}

#[test]
fn a_job_is_changed_by_its_owner_or_with_the_code() {
    let running = Running::start(Limits::default(), false);
    let server = &running.server;
    let printer = server.printer("").unwrap();
    let create = || {
        let owner = Owner { user: OWNER.1.into(), from: Some(OWNER.0.parse().unwrap()), key: None };
        server.create(printer, "leaf", owner, Ticket::default()).unwrap()
    };
    let state = |job: u32| server.data().jobs[&job].state;
    let job = create();
    for other in &OTHERS {
        for operation in [HOLD, RELEASE, CLOSE, ipp::CANCEL] {
            // client-error-not-authorized
            assert_eq!(
                ask(server, other, operation, job),
                0x0403,
                "{operation:#x} by {} at {}",
                other.1,
                other.0
            );
        }
        assert_eq!(ask(server, other, CANCEL_MY, 0), 0);
        // Everybody may look.
        assert_eq!(ask(server, other, ipp::JOB, job), 0);
        assert_eq!(state(job), State::Incoming);
    }
    assert_eq!(ask(server, &OWNER, HOLD, job), 0);
    assert_eq!(ask(server, &OWNER, ipp::CANCEL, job), 0);
    assert_eq!(state(job), State::Canceled);
    let (mine, coded) = (create(), create());
    assert_eq!(ask(server, &Asks("192.168.1.8", "eve", true), ipp::CANCEL, coded), 0);
    assert_eq!((state(mine), state(coded)), (State::Incoming, State::Canceled));
    assert_eq!(ask(server, &OWNER, CANCEL_MY, 0), 0);
    assert_eq!(state(mine), State::Canceled);
}
