//! The workstation's end of the link: whatever a bridge says, in whatever order, the session neither fails nor says what is not so.
//!
//! The input is a script of messages, noise and time, and a status answer of a printer.

use super::frame::framed;
use arbitrary::{Result, Unstructured};
use device::questions::status::Status;
use device::transit::session::{Outcome, Record, Session};
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{
    Defect, DefectKind, Fault, JobKind, JobState, Progress, Refusal, SCHEMA, ToBridge, ToHost, VERSION,
};
use std::time::Duration;

const JOB: u32 = 7;
const LENGTH: u32 = 5_000;

/// A script.
pub fn check(bytes: &[u8]) {
    let _ = Status::read(bytes);
    let data: Vec<u8> = (0..LENGTH).map(|at| (at % 251) as u8).collect();
    let mut bench = Bench {
        session: Session::new(Record::new(JOB, JobKind::Raw, LENGTH), &data),
        data: &data,
        now: Duration::ZERO,
        done: false,
        spoken: Reader::new(),
    };
    bench.session.connected(bench.now);
    let mut script = Unstructured::new(bytes);
    while !script.is_empty() && bench.step(&mut script).is_ok() {}
}

struct Bench<'d> {
    session: Session<'d>,
    data: &'d [u8],
    now: Duration,
    /// The bridge has said that the job is done.
    done: bool,
    spoken: Reader,
}

impl Bench<'_> {
    fn step(&mut self, script: &mut Unstructured<'_>) -> Result<()> {
        match script.int_in_range(0..=7u8)? {
            0 => self.hear(&noise(script)?)?,
            1 => {
                let body = noise(script)?;
                self.hear(&framed(&body))?;
            }
            2 => {
                let version = if script.ratio(7u8, 8u8)? { VERSION } else { script.arbitrary()? };
                let schema = if script.ratio(7u8, 8u8)? { SCHEMA } else { script.arbitrary()? };
                let (boot, serial) = (script.int_in_range(0..=3)?, script.int_in_range(0..=2)?);
                self.say(&ToHost::Hello { version, schema, boot, serial, firmware: "0.1.0" })?;
            }
            3 | 4 => {
                let progress = progress(script)?;
                self.done |= progress.job == JOB && progress.state == JobState::Done;
                self.say(&ToHost::Progress(progress))?;
            }
            5 => {
                let reasons = [
                    Refusal::JobOpen,
                    Refusal::NoSuchJob,
                    Refusal::OtherJob,
                    Refusal::BeyondLimit,
                    Refusal::NoRoom,
                ];
                let reason = *script.choose(&reasons)?;
                self.say(&ToHost::Refused { reason, job: script.int_in_range(0..=8)? })?;
            }
            6 => {
                self.now += Duration::from_millis(script.int_in_range(0..=5_000)?);
                if script.ratio(1u8, 16u8)? {
                    self.session.connected(self.now);
                    self.spoken = Reader::new();
                }
                if script.ratio(1u8, 32u8)? {
                    self.session.cancel();
                }
            }
            _ => self.speak(),
        }
        let printed = self.session.outcome() == Some(Outcome::Printed);
        assert!(!printed || self.done, "printed, though no bridge has said so");
        Ok(())
    }

    fn say(&mut self, message: &ToHost<'_>) -> Result<()> {
        let mut frame = [0; MAX];
        let length = frame::write(message, &mut frame).expect("it fits a frame");
        self.hear(&frame[..length])
    }

    /// An error ends a session.
    fn hear(&mut self, bytes: &[u8]) -> Result<()> {
        // Chance may make a whole message of noise.
        let mut reader = Reader::new();
        let mut left = bytes;
        loop {
            match reader.read(left) {
                Read::More => break,
                Read::Damaged(_, rest) => left = rest,
                Read::Message(message, rest) => {
                    left = rest;
                    self.done |= match frame::decode(message) {
                        Ok(ToHost::Progress(progress)) => {
                            progress.job == JOB && progress.state == JobState::Done
                        }
                        Ok(ToHost::Past(past)) => {
                            past.iter().any(|past| past.job == JOB && past.state == JobState::Done)
                        }
                        _ => false,
                    };
                }
            }
        }
        self.session.hear(self.now, bytes).map_err(|_| arbitrary::Error::IncorrectFormat)
    }

    fn speak(&mut self) {
        let mut out = Vec::new();
        let kept = self.session.speak(self.now, &mut out, &mut |_| Ok::<(), ()>(()));
        assert_eq!(kept, Ok(()));
        let mut left = &out[..];
        loop {
            match self.spoken.read(left) {
                Read::More => break,
                Read::Damaged(damage, _) => panic!("a damaged frame: {damage:?}"),
                Read::Message(message, rest) => {
                    left = rest;
                    match frame::decode(message).expect("a message") {
                        ToBridge::Data { job, offset, bytes } => {
                            let at = offset as usize;
                            assert_eq!((job, self.data.get(at..at + bytes.len())), (JOB, Some(bytes)));
                        }
                        ToBridge::Begin { job, length, .. } => assert_eq!((job, length), (JOB, LENGTH)),
                        ToBridge::Cancel { job } => assert_eq!(job, JOB),
                        _ => {}
                    }
                }
            }
        }
    }
}

fn noise(script: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let length = script.int_in_range(0..=40)?.min(script.len());
    Ok(script.bytes(length)?.to_vec())
}

fn progress(script: &mut Unstructured<'_>) -> Result<Progress> {
    let states = [
        JobState::None,
        JobState::Printing,
        JobState::Stopped(Fault::PaperOut),
        JobState::Cancelling,
        JobState::Done,
        JobState::Cancelled,
        JobState::Broken(Defect { at: 5, what: DefectKind::Stream }),
        JobState::Lost,
        JobState::Storing,
        JobState::Stored,
    ];
    let state = *script.choose(&states)?;
    let job = if script.ratio(3u8, 4u8)? { JOB } else { script.arbitrary()? };
    let figure = |script: &mut Unstructured<'_>| -> Result<u32> {
        if script.ratio(7u8, 8u8)? { script.int_in_range(0..=LENGTH) } else { script.arbitrary() }
    };
    let (accepted, limit, printed) = (figure(script)?, figure(script)?, figure(script)?);
    Ok(Progress { job, state, accepted, limit, printed, pass: script.arbitrary()?, row: script.arbitrary()? })
}
