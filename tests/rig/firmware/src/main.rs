//! The rig on a Raspberry Pi Pico: a serial port at one end, a printer that does as it is told at the other.
//!
//! One task runs the USB device, the other answers orders and, every [`LOOK`], looks at the host's lines: for a negotiation, and for a
//! reset. Both have 35 ms by the standard. The handshake needs neither ([`port`]).
#![no_std]
#![no_main]

mod pins;
mod port;

use core::fmt::Write as _;
use embassy_executor::Spawner;
use embassy_futures::select::{Either, select};
use embassy_rp::peripherals::{PIO0, USB};
use embassy_rp::pio::Pio;
use embassy_rp::{bind_interrupts, pio, usb};
use embassy_time::{Duration, Timer};
use embassy_usb::class::cdc_acm::{CdcAcmClass, State};
use embassy_usb::driver::EndpointError;
use embassy_usb::{Builder, Config, UsbDevice};
use heapless::String;
use panic_halt as _;
use port::Port;
use rig::{ID_MAX, LINE_MAX, Nibble, Order, ROOM, Report, Status, WORDS, checksum};
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Interrupts {
    USBCTRL_IRQ => usb::InterruptHandler<USB>;
    PIO0_IRQ_0 => pio::InterruptHandler<PIO0>;
});

type Driver = usb::Driver<'static, USB>;

/// A test number of pid.codes; the bridge has 1.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0002;

const PACKET: u16 = 64;

/// Between two looks at the host's lines.
const LOOK: Duration = Duration::from_micros(50);

/// The status question, and the answer of a printer that is idle and has no cartridges.
const STATUS: [u8; 2] = [0x05, 0x01];
const IDLE: [u8; 38] = {
    let mut answer = [0; 38];
    [answer[0], answer[1], answer[2], answer[4], answer[37]] = [0x02, 0x80, 0x21, 0x10, 0x03];
    let mut slot = 0;
    while slot < 9 {
        answer[5 + 3 * slot] = 0xff;
        slot += 1;
    }
    answer
};

/// Words of samples in an answer.
const PIECE: usize = 128;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let peripherals = embassy_rp::init(Default::default());
    pins::bring_up();

    static BYTES: ConstStaticCell<[u8; ROOM]> = ConstStaticCell::new([0; ROOM]);
    static SAMPLES: ConstStaticCell<[u32; WORDS]> = ConstStaticCell::new([0; WORDS]);
    static TICKET: StaticCell<u32> = StaticCell::new();
    let Pio { mut common, .. } = Pio::new(peripherals.PIO0, Interrupts);
    let port = Port::new(&mut common, BYTES.take(), SAMPLES.take(), TICKET.init(0));

    static CONFIGURATION: StaticCell<[u8; 128]> = StaticCell::new();
    static BOS: StaticCell<[u8; 64]> = StaticCell::new();
    static MSOS: StaticCell<[u8; 64]> = StaticCell::new();
    static CONTROL: StaticCell<[u8; 64]> = StaticCell::new();
    static STATE: StaticCell<State<'static>> = StaticCell::new();
    let mut config = Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some("Foilpress");
    config.product = Some("Foilpress rig");
    config.max_power = 100;
    let mut builder = Builder::new(
        Driver::new(peripherals.USB, Interrupts),
        config,
        CONFIGURATION.init([0; 128]),
        BOS.init([0; 64]),
        MSOS.init([0; 64]),
        CONTROL.init([0; 64]),
    );
    let serial = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET);
    // The pool holds one of the task, which is spawned once.
    spawner.spawn(run(builder.build()).unwrap());
    Rig {
        port,
        nibble: Nibble::default(),
        status: Status::READY,
        id: String::new(),
        on: false,
        answered: 0,
        seen: Seen::default(),
    }
    .serve(serial)
    .await
}

#[embassy_executor::task]
async fn run(mut device: UsbDevice<'static, Driver>) -> ! {
    device.run().await
}

/// What the processor itself has seen since the beginning.
#[derive(Default)]
struct Seen {
    resets: u32,
    reset_at: u32,
    asked: u32,
}

struct Rig {
    port: Port,
    nibble: Nibble,
    status: Status,
    id: String<ID_MAX>,
    on: bool,
    /// Bytes it had taken when it last said how it is.
    answered: usize,
    seen: Seen,
}

impl Rig {
    /// Answers orders for ever.
    async fn serve(&mut self, mut serial: CdcAcmClass<'static, Driver>) -> ! {
        let mut line = String::<LINE_MAX>::new();
        let mut packet = [0; PACKET as usize];
        loop {
            match select(serial.read_packet(&mut packet), Timer::after(LOOK)).await {
                Either::First(Ok(count)) => {
                    for &byte in &packet[..count] {
                        if byte == b'\n' {
                            // Who has closed the port hears no answer.
                            let _ = self.answer(&line, &mut serial).await;
                            line.clear();
                        } else if line.push(char::from(byte)).is_err() {
                            // What is longer than any order is none.
                            line.clear();
                        }
                    }
                }
                Either::First(Err(EndpointError::Disabled)) => {
                    line.clear();
                    self.look();
                    Timer::after(LOOK).await;
                }
                Either::First(Err(EndpointError::BufferOverflow)) => {}
                Either::Second(()) => self.look(),
            }
        }
    }

    /// Looks at the host's lines.
    fn look(&mut self) {
        let resets = self.port.counts().1;
        if self.seen.resets != resets {
            (self.seen.resets, self.seen.reset_at) = (resets, self.port.taken().len() as u32);
        }
        if !self.on || self.id.is_empty() {
            return;
        }
        let took_bytes = self.nibble.takes_bytes();
        // It is asked how it is, and has not said so since.
        let taken = self.port.taken();
        let asked = taken.len() > self.answered && taken.ends_with(&STATUS);
        let say = if asked { &IDLE[..] } else { &[] };
        let own = self.nibble.look(pins::host(), self.status, &self.id, say);
        if self.nibble.has_said() {
            self.answered = taken.len();
        }
        let Some(own) = own else { return };
        self.seen.asked += u32::from(took_bytes);
        // The lines that say what nAck means come before it.
        pins::show(own.status);
        cortex_m::asm::delay(125);
        self.port.set_taking(if self.nibble.takes_bytes() { Ok(()) } else { Err(pins::side(own)) });
    }

    async fn answer(
        &mut self,
        line: &str,
        serial: &mut CdcAcmClass<'static, Driver>,
    ) -> Result<(), EndpointError> {
        let mut text = String::<LINE_MAX>::new();
        // What is written fits.
        let _ = match Order::parse(line) {
            Err(reason) => writeln!(text, "error {reason}"),
            Ok(Order::Report) => writeln!(text, "{}", self.report()),
            Ok(Order::Wave(from)) => self.wave(from as usize, &mut text),
            Ok(order) => {
                self.obey(order);
                writeln!(text, "ok")
            }
        };
        for packet in text.as_bytes().chunks(usize::from(PACKET) - 1) {
            serial.write_packet(packet).await?;
        }
        Ok(())
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Begin { work_ns, bytes } => {
                self.seen = Seen::default();
                (self.nibble, self.status, self.on) = (Nibble::default(), Status::READY, true);
                self.answered = 0;
                self.port.begin(work_ns, bytes);
                pins::show(self.status);
                pins::power(true);
            }
            Order::More(bytes) => self.port.more(bytes),
            Order::Lines(status) => {
                self.status = status;
                if self.nibble.takes_bytes() {
                    pins::show(status);
                }
            }
            Order::Power(on) => {
                self.on = on;
                self.nibble = Nibble::default();
                if on {
                    pins::show(self.status);
                    self.port.set_taking(Ok(()));
                } else {
                    self.port.set_off();
                }
                pins::power(on);
            }
            Order::Id(id) => self.id = id,
            Order::Report | Order::Wave(_) => {}
        }
    }

    fn report(&self) -> Report {
        let taken = self.port.taken();
        let (strobes, resets) = self.port.counts();
        let Seen { reset_at, asked, .. } = self.seen;
        let words = self.port.wave().len() as u32;
        Report {
            taken: taken.len() as u32,
            checksum: checksum(taken),
            strobes,
            resets,
            reset_at,
            asked,
            words,
        }
    }

    fn wave(&self, from: usize, text: &mut String<LINE_MAX>) -> core::fmt::Result {
        text.write_str("wave ")?;
        let words = self.port.wave();
        for word in &words[from.min(words.len())..(from.saturating_add(PIECE)).min(words.len())] {
            write!(text, "{word:08x}")?;
        }
        text.write_str("\n")
    }
}
