//! The task at the port: it alone touches the printer.
//!
//! With the default handshake the [`Strobe`] engine sends and this task only feeds it, looks at the lines every
//! millisecond and counts. With another handshake, or with status lines that are not to be heeded, the processor
//! works the pins itself through [`bridge::port::Port`], which it also does for everything between jobs: device
//! ID, status answer, reset.

use crate::keep::{Keeper, MARKS};
use crate::pins::{self, Ack, Data, Line};
use crate::printer::Face;
use crate::shared::{Shared, Side};
use crate::strobe::{CHUNK, SENT, Strobe};
use crate::watch::HEARTBEAT;
use bridge::engine::{Outcome, Task};
use bridge::port::{BadSettings, Port, ReverseError, Stop, Timing};
use embassy_futures::select::select3;
use embassy_futures::yield_now;
use embassy_rp::pac;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::delay::DelayNs;
use portable_atomic::Ordering;
use protocol::link::message::{Answer, Fault, Handshake, JobState, Lines, PortSettings};

/// Between two looks at the lines.
const TICK: Duration = Duration::from_millis(1);

/// The printer's supply has to be away for so long before its job is given up.
const POWER_GONE: Duration = Duration::from_millis(20);

/// Bytes the processor sends before it looks after other things: a tenth of a millisecond each at worst.
const HANDFUL: usize = 32;

/// Waits by counting clock cycles, never less than asked for; and keeps the watchdog quiet meanwhile, since a slow
/// printer may take its time with a nibble.
pub struct Cycles;

impl DelayNs for Cycles {
    fn delay_ns(&mut self, ns: u32) {
        if ns >= 1000 {
            pac::WATCHDOG.load().write_value(pac::watchdog::regs::Load(crate::watch::LOAD));
        }
        // 125 MHz: a cycle is 8 ns.
        cortex_m::asm::delay(ns.div_ceil(8).max(1));
    }
}

/// The port worked by the processor.
type ByHand = Port<Data, Line, Line, Ack, Cycles>;

/// Room for an answer of the printer: device IDs are some hundred bytes long.
const ANSWER: usize = 512;

/// The question for the status, and how long its answer is.
const STATUS_QUESTION: [u8; 2] = [0x05, 0x01];
const STATUS_LENGTH: usize = 38;

/// How often the answer is looked for, and the pause between: two seconds in all.
const STATUS_TRIES: u32 = 200;
const STATUS_PAUSE_US: u32 = 10_000;

/// A printer is asked who it is when it has been ready for so long.
const SETTLED: Duration = Duration::from_millis(500);

/// Who works the pins.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Owner {
    /// The PIO block.
    Strobe,
    /// The processor, because the settings ask for what only it can do.
    Hand,
    /// The processor, which has set levels for a wiring test. They stand until there is something to send.
    Test,
}

/// The task's own state.
struct Desk {
    shared: &'static Shared,
    face: &'static Face,
    strobe: Strobe,
    hand: ByHand,
    owner: Owner,
    handshake: Handshake,
    heed: Lines,
    patience: Duration,
    /// When a byte last crossed, or nothing was waiting to.
    moved: Instant,
    power_seen: Instant,
    /// What the port worked by hand says.
    stop: Option<Fault>,
    /// Since when the printer has been ready, until it has been asked who it is.
    unasked: Option<Instant>,
    asked: bool,
    keeper: Keeper,
    /// Job and state last written to the log.
    told: Option<(u32, JobState)>,
}

/// Serves the port.
#[embassy_executor::task]
pub async fn serve(shared: &'static Shared, face: &'static Face, strobe: Strobe, keeper: Keeper) -> ! {
    let now = Instant::now();
    let mut desk = Desk {
        shared,
        face,
        strobe,
        hand: Port::new(pins::port(), Cycles),
        owner: Owner::Hand,
        handshake: Handshake::Busy,
        heed: Lines::ALL,
        patience: Duration::from_millis(Timing::PATIENCE_MS.into()),
        moved: now,
        power_seen: now,
        stop: None,
        unasked: None,
        asked: false,
        keeper,
        told: None,
    };
    desk.give_back();
    loop {
        HEARTBEAT.store(true, Ordering::Relaxed);
        desk.count();
        if let Some(task) = shared.engine(|engine| engine.task()) {
            desk.perform(task);
        }
        desk.look();
        desk.introduce();
        if desk.owner == Owner::Test && shared.engine(|engine| !engine.output().is_empty()) {
            desk.give_back();
        }
        let pause = match desk.owner {
            Owner::Strobe => desk.feed(),
            Owner::Hand => desk.send_by_hand(),
            Owner::Test => TICK,
        };
        desk.keep();
        shared.wake(Side::Work);
        shared.wake(Side::Link);
        if pause.as_ticks() == 0 {
            yield_now().await;
        } else {
            select3(Timer::after(pause), shared.wait(Side::Port), SENT.wait()).await;
        }
    }
}

impl Desk {
    /// Tells the engine what the strobe engine has sent.
    fn count(&mut self) {
        let crossed = self.strobe.crossed();
        self.consumed(crossed);
        if self.owner == Owner::Strobe && self.strobe.in_flight() == 0 {
            self.moved = Instant::now();
        }
    }

    fn consumed(&mut self, count: usize) {
        if count > 0 {
            self.moved = Instant::now();
            self.shared.engine(|engine| engine.consumed(count));
        }
    }

    /// Keeps where the job stands for the time after a reset, and says in the log what has changed.
    fn keep(&mut self) {
        let checkpoint = self.shared.engine(|engine| engine.checkpoint());
        self.keeper.store(checkpoint, self.strobe.place());
        let state = (checkpoint.progress.job, checkpoint.progress.state);
        if self.told.replace(state) != Some(state) && state.0 != 0 {
            defmt::info!(
                "job {=u32:08x}: {}, {=u32} bytes printed",
                state.0,
                state.1,
                checkpoint.progress.printed
            );
        }
    }

    /// Fills the strobe engine's buffers; says when to look again.
    fn feed(&mut self) -> Duration {
        while self.strobe.has_room() {
            // The oldest bytes of the output are those in flight already.
            let (strobe, engine) = (&mut self.strobe, &self.shared);
            let given = engine.engine(|engine| {
                let fresh = engine.output_behind(strobe.in_flight());
                strobe.give(&fresh[..fresh.len().min(CHUNK)])
            });
            if given == 0 {
                break;
            }
        }
        TICK
    }

    /// Sends some bytes; says how long to leave the printer alone, or zero if it is ready for more.
    fn send_by_hand(&mut self) -> Duration {
        let now = Instant::now().as_millis() as u32;
        let hand = &mut self.hand;
        let keeper = &self.keeper;
        let (count, stop, more) = self.shared.engine(|engine| {
            let output = engine.output();
            let handful = &output[..output.len().min(HANDFUL)];
            let mut count = 0;
            for byte in handful {
                let written = hand.write(core::slice::from_ref(byte), now);
                if written.count == 0 {
                    return (count, written.stop, true);
                }
                keeper.mark(count);
                count += 1;
            }
            (count, None, count > 0)
        });
        self.strobe.set_place((self.keeper.place() + count) % MARKS);
        self.consumed(count);
        self.stop = match stop {
            Some(Stop::Fault(fault)) => Some(fault),
            Some(Stop::Busy) => self.stop.filter(|_| count == 0),
            None => None,
        };
        match stop {
            None if more => Duration::from_ticks(0),
            Some(Stop::Busy) => Duration::from_micros(100),
            _ => TICK,
        }
    }

    /// Looks at the lines and tells the engine. If that ends a job, what is on its way is taken back.
    fn look(&mut self) {
        let now = Instant::now();
        let lines = pins::status();
        let heeded = lines.heeding(self.heed);
        if heeded.high(Lines::POWER) {
            self.power_seen = now;
        }
        let fault = match heeded.fault() {
            // A spike on the line must not cost a sheet; for so long it is taken for an error.
            Some(Fault::PowerOff) if now - self.power_seen < POWER_GONE => Some(Fault::Error),
            None if heeded.high(Lines::BUSY) && now - self.moved >= self.patience => Some(Fault::BusyTooLong),
            None => self.stop,
            fault => fault,
        };
        let lost = self.shared.engine(|engine| {
            let before = engine.progress().state;
            engine.port(lines, fault);
            before != JobState::Lost && engine.progress().state == JobState::Lost
        });
        if lost {
            self.strobe.stop();
        }
    }

    /// Asks a printer that has been switched on who it is, once it has been ready for a while and nobody uses it.
    fn introduce(&mut self) {
        let lines = pins::status().heeding(self.heed);
        if !lines.high(Lines::POWER) {
            if self.asked {
                self.face.forget();
            }
            self.asked = false;
        }
        let ready = lines.fault().is_none() && !lines.high(Lines::BUSY);
        if self.asked || !ready || self.owner == Owner::Test || !self.shared.engine(|engine| engine.is_idle())
        {
            self.unasked = None;
            return;
        }
        let now = Instant::now();
        if now - *self.unasked.get_or_insert(now) < SETTLED {
            return;
        }
        // Once, whatever comes of it: a printer that does not negotiate is to be left alone.
        self.asked = true;
        self.take_pins();
        let mut answer = [0; ANSWER];
        match self.hand.device_id(&mut answer) {
            Ok(count) | Err(ReverseError::Silent(count)) if self.face.learn(&answer[..count]) => {
                defmt::info!("the printer has said who it is, in {=usize} bytes", count);
            }
            _ => defmt::info!("the printer does not say who it is"),
        }
        self.give_back();
    }

    /// The pins to the processor, with nothing in flight.
    fn take_pins(&mut self) {
        let crossed = self.strobe.stop();
        self.consumed(crossed);
        if self.owner == Owner::Strobe {
            pins::take_back(self.strobe.last());
            self.owner = Owner::Hand;
        }
        if self.owner == Owner::Test {
            self.hand.rest();
        }
    }

    /// Does what only the board can do, with nothing in flight.
    fn perform(&mut self, task: Task) {
        self.take_pins();
        let mut answer = [0; ANSWER];
        let outcome = match task {
            Task::Configure(settings) => match self.configure(&settings) {
                Ok(()) => Outcome::Done,
                Err(BadSettings) => Outcome::BadSettings,
            },
            Task::DeviceId => {
                let result = self.hand.device_id(&mut answer);
                if let Ok(count) = result {
                    self.face.learn(&answer[..count]);
                }
                Outcome::Answer(self.answer(result, &answer))
            }
            Task::PrinterStatus => Outcome::Answer(self.status(&mut answer)),
            Task::Initialise => {
                self.hand.initialise();
                Outcome::Done
            }
            Task::Bootloader => {
                pins::enable(false);
                embassy_rp::rom_data::reset_to_usb_boot(1 << pins::LAMP, 0);
                Outcome::Done
            }
            Task::Drive { data, control } => {
                self.hand.drive(data, control);
                Outcome::Done
            }
            Task::Probe { data, control } => {
                self.hand.drive(data, control);
                Outcome::Lines(pins::status())
            }
        };
        if matches!(task, Task::Drive { .. } | Task::Probe { .. }) {
            self.owner = Owner::Test;
        } else {
            self.give_back();
        }
        self.shared.engine(|engine| engine.done(outcome));
    }

    /// The lines at rest, and the pins to whom the settings give them.
    fn give_back(&mut self) {
        self.hand.rest();
        self.owner = if self.handshake == Handshake::Busy && self.heed == Lines::ALL {
            pins::lend_to_pio();
            Owner::Strobe
        } else {
            Owner::Hand
        };
        self.stop = None;
        self.moved = Instant::now();
    }

    fn configure(&mut self, settings: &PortSettings) -> Result<(), BadSettings> {
        self.hand.configure(settings)?;
        self.strobe.set_timing(&Timing::from_settings(settings)?);
        (self.handshake, self.heed) = (settings.handshake, settings.heed);
        self.patience = Duration::from_secs(settings.patience_s.into());
        Ok(())
    }

    /// Puts the status question and waits for the answer. The printer is left in compatibility mode.
    fn status<'a>(&mut self, buffer: &'a mut [u8; ANSWER]) -> Answer<'a> {
        let mut asked = 0;
        for _ in 0..STATUS_TRIES {
            let now = Instant::now().as_millis() as u32;
            let written = self.hand.write(&STATUS_QUESTION[asked..], now);
            asked += written.count;
            match written.stop {
                None => break,
                Some(Stop::Fault(fault)) => return Answer::Stopped(fault),
                Some(Stop::Busy) => Cycles.delay_us(STATUS_PAUSE_US),
            }
        }
        if asked < STATUS_QUESTION.len() {
            return Answer::Silent;
        }
        let mut have = 0;
        for _ in 0..STATUS_TRIES {
            Cycles.delay_us(STATUS_PAUSE_US);
            match self.hand.read(&mut buffer[have..]) {
                Ok(count) => have += count,
                // It is at work on the question.
                Err(ReverseError::NotIdle) => {}
                Err(error) => return self.answer(Err(error), buffer),
            }
            if have >= STATUS_LENGTH {
                return Answer::Bytes(&buffer[..have]);
            }
        }
        Answer::Silent
    }

    fn answer<'a>(&mut self, result: Result<usize, ReverseError>, buffer: &'a [u8; ANSWER]) -> Answer<'a> {
        match result {
            Ok(0) | Err(ReverseError::Silent(0)) => Answer::Silent,
            // Device IDs that break off are of use all the same.
            Ok(count) | Err(ReverseError::Silent(count)) => Answer::Bytes(&buffer[..count]),
            Err(ReverseError::OneWay | ReverseError::Refused) => Answer::OneWay,
            Err(ReverseError::NotIdle) => match pins::status().heeding(self.heed).fault() {
                Some(fault) => Answer::Stopped(fault),
                None => Answer::Silent,
            },
        }
    }
}
