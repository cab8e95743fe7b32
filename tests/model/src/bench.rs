//! The whole bridge in virtual time: frames go in at one end, a printer stands at the other.

use crate::{Board, IDENTITY, framed, rested};
use bridge::driver::Driver;
use bridge::engine::{Checkpoint, Engine};
use bridge::port::Port;
use bridge::printer_class::DeviceId;
use bridge::simulation::{
    AckLine, DataLines, DelayLine, InLine, OutLine, Peripheral, SimulatedBoard, SimulatedPort,
};
use bridge::turn;
use protocol::link::frame::{self, MAX, Read, Reader};
use protocol::link::message::{Ask, JobState, Progress, ToBridge, ToHost};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub const MS: u64 = 1_000_000;

pub struct Bench<'m> {
    pub cable: SimulatedPort,
    pub board: SimulatedBoard,
    pub engine: Engine<'m>,
    pub driver: Driver<SimulatedBoard, DataLines, OutLine, InLine, AckLine, DelayLine>,
    pub id: DeviceId,
    pub reader: Reader,
    /// When tasks wake: other tasks end a pause early. Without it the driver gets every pause it asks for.
    pub random: Option<ChaCha8Rng>,
    /// What the engine has said, but for progress.
    pub said: Vec<String>,
    pub progress: Option<Progress>,
    /// The longest time in ns that the driver has kept the processor.
    pub longest: u64,
}

impl<'m> Bench<'m> {
    /// A bridge whose diary says that the printer stands between two jobs.
    pub fn new(board: &'m mut Board, peripheral: Peripheral) -> Self {
        Self::on(&SimulatedPort::new(peripheral), board, None)
    }

    /// A bridge of which nobody knows what it did before.
    pub fn unaware(board: &'m mut Board, peripheral: Peripheral) -> Self {
        Self::with(&SimulatedPort::new(peripheral), Engine::new(board.memory(), IDENTITY))
    }

    /// A bridge that starts at this cable.
    pub fn on(cable: &SimulatedPort, board: &'m mut Board, checkpoint: Option<Checkpoint>) -> Self {
        let engine = match checkpoint {
            Some(checkpoint) => Engine::resume(board.memory(), IDENTITY, checkpoint),
            None => rested(board.memory(), IDENTITY),
        };
        Self::with(cable, engine)
    }

    fn with(cable: &SimulatedPort, engine: Engine<'m>) -> Self {
        let (pins, delay) = cable.pins();
        let board = SimulatedBoard::new(cable);
        let driver = Driver::new(board.clone(), Port::new(pins, delay));
        Bench {
            cable: cable.clone(),
            board,
            engine,
            driver,
            id: DeviceId::new(),
            reader: Reader::new(),
            random: None,
            said: Vec::new(),
            progress: None,
            longest: 0,
        }
    }

    pub fn tell(&mut self, message: &ToBridge<'_>) {
        self.engine.receive(&mut self.reader, &framed(message));
    }

    /// A turn of every task, and the pause behind it.
    pub fn turn(&mut self) {
        let clock = self.cable.clone();
        turn::work(&mut self.engine, || {
            // A slice of work takes its time.
            clock.pass(20_000);
            clock.now() / 1000
        });
        let start = self.cable.now();
        let pause_us = self.driver.poll(&mut self.engine, &mut self.id);
        self.longest = self.longest.max(self.cable.now() - start);
        let pause_us = match &mut self.random {
            Some(random) if pause_us > 0 => random.random_range(0..=pause_us),
            _ => pause_us,
        };
        self.cable.pass(u64::from(pause_us) * 1000);
    }

    /// What the engine has to say now, as bytes.
    pub fn transmitted(&mut self) -> Vec<u8> {
        let (mut bytes, mut frame) = (Vec::new(), [0; MAX]);
        loop {
            let length = self.engine.transmit(&mut frame);
            if length == 0 {
                return bytes;
            }
            bytes.extend_from_slice(&frame[..length]);
        }
    }

    /// Notes what the engine says.
    pub fn listen(&mut self) {
        let bytes = self.transmitted();
        let (mut reader, mut left) = (Reader::new(), &bytes[..]);
        while let Read::Message(message, rest) = reader.read(left) {
            left = rest;
            match frame::decode::<ToHost>(message) {
                Ok(ToHost::Progress(progress)) => self.progress = Some(progress),
                Ok(message) => self.said.push(format!("{message:?}")),
                Err(_) => panic!("no message"),
            }
        }
    }

    /// Lets so much time pass.
    pub fn pass(&mut self, ns: u64) {
        let end = self.cable.now() + ns;
        while self.cable.now() < end {
            self.turn();
            self.listen();
        }
    }

    /// Lets time pass until something is said that begins so; gives the rest of it, and removes it.
    pub fn hear(&mut self, start: &str) -> String {
        for _ in 0..200_000 {
            if let Some(at) = self.said.iter().position(|said| said.starts_with(start)) {
                return self.said.remove(at)[start.len()..].to_owned();
            }
            self.turn();
            self.listen();
        }
        panic!("not said in {} ms: {start}; but {:?}", self.cable.now() / MS, self.said);
    }

    /// The answer to a question, as text.
    pub fn ask(&mut self, request: u16, what: Ask) -> String {
        self.tell(&ToBridge::Ask { request, what });
        let answer = self.hear(&format!("Answer {{ request: {request}, answer: "));
        answer.trim_end_matches(" }").to_owned()
    }

    pub fn state(&self) -> JobState {
        self.engine.progress().state
    }
}
