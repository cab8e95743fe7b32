//! Bytes to the printer without the processor: a PIO program works the strobe, DMA feeds it and counts.
//!
//! Problem: a byte every 2.42 µs, each with setup, strobe and hold times that are never too short, no strobe while the
//! printer is busy or in trouble, and an exact count of what has crossed the port whenever it stops.
//!
//! Method: ten instructions, one byte each round. The program waits for Busy before it changes the data. Then it looks at
//! Busy, PError, Select, nFault and the printer's +5 V together until all are well, and strobes three ticks later. Behind every strobe it
//! pushes a word. A DMA channel takes these words away, and its counter *is* the number of bytes that have crossed. The
//! words stay as marks in memory that survives a reset ([`crate::retained`]). A byte in a FIFO or half way through its setup is
//! not counted and can be taken back.
//!
//! One tick is an eighth of the longest time asked for and of one clock cycle more:
//!
//! | | ticks | asked for |
//! |---|---|---|
//! | data before nStrobe falls | 8 | setup: 8 ticks |
//! | nStrobe low | 8 | strobe: 8 ticks |
//! | data after nStrobe rises | 8 at least | hold: 8 ticks |
//! | nStrobe falling until Busy is looked at | 15 at least | settle: 8 ticks |
//!
//! A byte takes 24 ticks when the printer is quick enough: 2.42 µs with the default timing.
//!
//! Two buffers take turns. The interrupt of the DMA channel starts the second when the first is through, so the
//! printer never waits for a task to be scheduled. The library keeps the books of the two ([`TwoBuffers`]).
//!
//! Limits: the handshake is Busy, and all status lines are heeded. For other handshakes, and for everything else the
//! port can do, the library's [`Port`](bridge::port::Port) works the same pins.

use crate::pins;
use crate::{board, retained};
use bridge::checkpoint::{MARKS, MARKS_BITS};
use bridge::driver::TwoBuffers;
use bridge::port::Timing;
use core::cell::RefCell;
use core::sync::atomic::{Ordering, compiler_fence};
use critical_section::{CriticalSection, Mutex};
use embassy_rp::interrupt;
use embassy_rp::pac;
use embassy_rp::pac::dma::vals::{DataSize, TreqSel};
use embassy_rp::peripherals::{DMA_CH0, DMA_CH1, PIO0};
use embassy_rp::pio::program::{
    Instruction, InstructionOperands, JmpCondition, MovDestination, MovOperation, MovSource,
};
use embassy_rp::pio::{Common, Config, Direction, Pin, ShiftDirection, StateMachine};
use embassy_rp::{Peri, clocks};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use fixed::FixedU32;
use fixed::types::extra::U8;

/// Bytes in each of the two buffers: at 2.4 µs, 2.4 ms of work for the printer.
pub const CHUNK: usize = 1024;

/// The pins the program looks at, from Busy up to the printer's +5 V. Between them are an unused pin, which rests low, and nOE,
/// which is low while the buffers drive the cable.
const LOOKED_AT: u8 = pins::POWER - pins::BUSY + 1;

/// Busy low, PError low, Select high, nFault high, nOE low, +5 V present, as the program reads them from Busy upwards.
const READY: u32 = 1 << 2 | 1 << 3 | 1 << (pins::POWER - pins::BUSY);

/// The instructions during which a byte crosses: from the strobe to the push that counts it.
const CROSSING: core::ops::RangeInclusive<u8> = 7..=9;

/// Words of the DMA counter between two starts of it.
const COUNTER: u32 = board::COUNT_MAX;

const FEED: usize = 0;
const TALLY: usize = 1;

/// A buffer has been sent.
pub static SENT: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// What the interrupt starts when the present buffer is through: address and length. Its other half belongs to the
/// task; both look only inside a critical section.
static NEXT: Mutex<RefCell<Option<(u32, u32)>>> = Mutex::new(RefCell::new(None));

fn start(address: u32, length: u32) {
    let channel = pac::DMA.ch(FEED);
    channel.read_addr().write_value(address);
    channel.write_addr().write_value(pac::PIO0.txf(0).as_ptr() as u32);
    board::set_count(channel, length);
    compiler_fence(Ordering::SeqCst);
    channel.ctrl_trig().write(|w| {
        w.set_treq_sel(TreqSel::PIO0_TX0);
        w.set_data_size(DataSize::SIZE_BYTE);
        w.set_incr_read(true);
        w.set_chain_to(FEED as u8);
        w.set_en(true);
    });
}

fn feeding() -> bool {
    pac::DMA.ch(FEED).ctrl_trig().read().busy()
}

/// Starts the buffer that waits, if the one before is through.
fn advance(token: CriticalSection<'_>) {
    if !feeding()
        && let Some((address, length)) = NEXT.borrow_ref_mut(token).take()
    {
        start(address, length);
    }
}

#[interrupt]
fn DMA_IRQ_1() {
    pac::DMA.ints(1).write_value(1 << FEED);
    critical_section::with(advance);
    SENT.signal(());
}

/// Stops the machine for good, no byte being cut in two, with the last one counted.
pub fn halt() {
    board::abort(FEED);
    let machine = pac::PIO0.sm(0);
    // The program is the only one, loaded at the beginning. A byte takes ten microseconds at most with the slowest timing; a machine
    // that waits for the printer is not crossing.
    pac::PIO0.ctrl().modify(|w| w.set_sm_enable(w.sm_enable() & !1));
    while CROSSING.contains(&(machine.addr().read().addr())) {
        pac::PIO0.ctrl().modify(|w| w.set_sm_enable(w.sm_enable() | 1));
        cortex_m::asm::delay(20);
        pac::PIO0.ctrl().modify(|w| w.set_sm_enable(w.sm_enable() & !1));
    }
    cortex_m::asm::delay(40);
}

const _: () = assert!(MARKS > 2 * CHUNK);

/// The strobe engine.
pub struct Strobe {
    machine: StateMachine<'static, PIO0, 0>,
    origin: u8,
    buffers: [&'static mut [u8; CHUNK]; 2],
    /// What either buffer holds.
    books: TwoBuffers,
    /// The counter when it was last asked.
    tally: u32,
    /// Marks made so far.
    place: usize,
    last: u8,
}

impl Strobe {
    /// Loads the program. nStrobe is high by the program's own level afterwards; the pins are still the processor's.
    pub fn new(
        common: &mut Common<'static, PIO0>,
        mut machine: StateMachine<'static, PIO0, 0>,
        data: [Pin<'static, PIO0>; 8],
        strobe: Pin<'static, PIO0>,
        busy: Pin<'static, PIO0>,
        buffers: [&'static mut [u8; CHUNK]; 2],
        _channels: (Peri<'static, DMA_CH0>, Peri<'static, DMA_CH1>),
    ) -> Self {
        let program = embassy_rp::pio::program::pio_asm!(
            ".side_set 1",
            ".wrap_target",
            "    pull block      side 1",
            // The byte before must be done with before its data go: they stand until Busy has fallen. To wait for the
            // one line takes a tick; a look at all four would take four, and be late by as much.
            "    wait 0 pin 0    side 1",
            // Setup: 4 + 4 ticks. `mov` and not `out`, so that the byte is still there if it has to wait.
            "    mov pins, osr   side 1 [3]",
            "before:",
            "    mov isr, null   side 1",
            "    in pins, 7      side 1",
            "    mov x, isr      side 1",
            "    jmp x!=y before side 1",
            "    nop             side 0 [7]",
            // Hold: 5 ticks here, 3 for push, pull and wait before the data can change.
            "    nop             side 1 [4]",
            "    push block      side 1",
            ".wrap",
        );
        let loaded = common.load_program(&program.program);
        let origin = loaded.origin;
        let mut config = Config::default();
        config.use_program(&loaded, &[&strobe]);
        config.set_out_pins(&data.each_ref());
        config.set_in_pins(&[&busy]);
        // To the left: the levels then are a number in the register.
        config.shift_in.direction = ShiftDirection::Left;
        machine.set_config(&config);
        machine.set_pins(embassy_rp::gpio::Level::High, &[&strobe]);
        machine.set_pin_dirs(Direction::Out, &[&strobe]);
        machine.set_pin_dirs(Direction::Out, &data.each_ref());
        let mut engine =
            Strobe { machine, origin, buffers, books: TwoBuffers::new(), tally: 0, place: 0, last: 0 };
        engine.set_timing(&Timing::DEFAULT);
        engine.rewind();
        engine.start_tally();
        pac::DMA.inte(1).modify(|w| *w |= 1 << FEED);
        // SAFETY: the handler above shares nothing with tasks that is not behind a critical section.
        unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::DMA_IRQ_1) };
        engine
    }

    /// Sets the times, from the next byte on. Only with nothing in flight.
    pub fn set_timing(&mut self, timing: &Timing) {
        let divider = timing.eighth(clocks::clk_sys_freq());
        self.machine.set_clock_divider(FixedU32::<U8>::from_bits(divider));
    }

    /// Whether there is a buffer to fill. Before the counter is used up it needs a moment without any, to be started anew.
    pub fn has_room(&self) -> bool {
        self.tally <= COUNTER / 2 && self.books.free().is_some()
    }

    /// Bytes handed over that have not crossed the port.
    pub fn in_flight(&self) -> usize {
        self.books.in_flight() as usize
    }

    /// Hands over bytes; says how many were taken.
    pub fn give(&mut self, bytes: &[u8]) -> usize {
        let count = bytes.len().min(CHUNK);
        let (Some(free), Some(&last)) = (self.books.free(), bytes[..count].last()) else { return 0 };
        let buffer = &mut self.buffers[free];
        buffer[..count].copy_from_slice(&bytes[..count]);
        let address = buffer.as_ptr() as u32;
        self.last = last;
        self.books.fill(count as u32);
        critical_section::with(|token| {
            advance(token);
            if feeding() {
                NEXT.borrow_ref_mut(token).replace((address, count as u32));
            } else {
                start(address, count as u32);
            }
        });
        count
    }

    /// How many bytes have crossed the port since this was last asked.
    pub fn crossed(&mut self) -> usize {
        let tally = COUNTER - board::count(pac::DMA.ch(TALLY));
        let fresh = tally - self.tally;
        self.tally = tally;
        self.place = (self.place + fresh as usize) % MARKS;
        self.books.empty(fresh);
        if self.books.in_flight() == 0 && self.tally > COUNTER / 2 {
            self.start_tally();
        }
        fresh as usize
    }

    /// How many marks there are, modulo [`MARKS`]; as of the last [`Strobe::crossed`].
    pub fn place(&self) -> usize {
        self.place
    }

    /// The next mark belongs there: others than this have made some.
    pub fn set_place(&mut self, place: usize) {
        if place != self.place {
            self.place = place;
            self.start_tally();
        }
    }

    /// Stops and forgets what has not crossed the port; says how much has since it was last asked. No byte is cut
    /// in two: if nStrobe is low, its time is waited for, ten microseconds at most with the slowest timing.
    pub fn stop(&mut self) -> usize {
        critical_section::with(|token| NEXT.borrow_ref_mut(token).take());
        pac::DMA.inte(1).modify(|w| *w &= !(1 << FEED));
        board::abort(FEED);
        while feeding() {}
        // An aborted channel may raise its interrupt.
        pac::DMA.ints(1).write_value(1 << FEED);
        pac::DMA.inte(1).modify(|w| *w |= 1 << FEED);
        loop {
            self.machine.set_enable(false);
            let at = self.machine.get_addr() - self.origin;
            if !CROSSING.contains(&at) {
                break;
            }
            self.machine.set_enable(true);
            cortex_m::asm::delay(20);
        }
        while !self.machine.rx().empty() {}
        // The last word may be on its way through the DMA.
        cortex_m::asm::delay(20);
        let crossed = self.crossed();
        self.books.clear();
        self.rewind();
        crossed
    }

    /// The last byte that was handed over: what the data lines show, or would show.
    pub fn last(&self) -> u8 {
        self.last
    }

    /// To the beginning of the program, with empty FIFOs.
    fn rewind(&mut self) {
        self.machine.set_enable(false);
        self.machine.clear_fifos();
        self.machine.restart();
        self.machine.clkdiv_restart();
        let jump = Instruction {
            operands: InstructionOperands::JMP { condition: JmpCondition::Always, address: self.origin },
            delay: 0,
            side_set: Some(1),
        };
        // `set` holds five bits, and these are seven.
        let ready = Instruction {
            operands: InstructionOperands::MOV {
                destination: MovDestination::Y,
                op: MovOperation::None,
                source: MovSource::OSR,
            },
            delay: 0,
            side_set: Some(1),
        };
        let drain = Instruction {
            operands: InstructionOperands::PULL { if_empty: false, block: false },
            delay: 0,
            side_set: Some(1),
        };
        let side_set = embassy_rp::pio::program::SideSet::new(false, 1, false);
        // SAFETY: the machine stands still; both are instructions of its own kind with nStrobe high, and the program
        // is where it was loaded.
        unsafe {
            // What waits in the queue is taken out and thrown away, should it have outlived its clearing.
            for _ in 0..8 {
                self.machine.exec_instr(drain.encode(side_set));
            }
            self.machine.tx().push(READY);
            self.machine.exec_instr(drain.encode(side_set));
            self.machine.exec_instr(ready.encode(side_set));
            self.machine.exec_instr(jump.encode(side_set));
        }
        self.machine.set_enable(true);
    }

    fn start_tally(&mut self) {
        let channel = pac::DMA.ch(TALLY);
        board::abort(TALLY);
        while channel.ctrl_trig().read().busy() {}
        channel.read_addr().write_value(pac::PIO0.rxf(0).as_ptr() as u32);
        channel.write_addr().write_value(retained::marks() as u32 + self.place as u32);
        board::set_count(channel, COUNTER);
        channel.ctrl_trig().write(|w| {
            w.set_treq_sel(TreqSel::PIO0_RX0);
            // What was pushed is the state of the lines, which was `READY` and not zero.
            w.set_data_size(DataSize::SIZE_BYTE);
            w.set_incr_write(true);
            w.set_ring_sel(true);
            w.set_ring_size(MARKS_BITS);
            w.set_chain_to(TALLY as u8);
            w.set_en(true);
        });
        self.tally = 0;
    }
}

const _: () = assert!(pins::BUSY == pins::ACK + 1 && pins::STROBE == pins::DATA + 8 && LOOKED_AT == 7);
