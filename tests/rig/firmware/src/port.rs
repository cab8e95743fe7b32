//! The printer's side of the cable, kept by PIO and DMA.
//!
//! Four state machines of PIO 0, a cycle being [`rig::TICK_NS`]:
//!
//! | machine | program | DMA |
//! |---|---|---|
//! | 0 | takes a byte when nStrobe falls, is busy, waits for a ticket that says how long it works, pulses nAck | 0 takes the bytes to memory, 1 brings the tickets |
//! | 1 | pushes a word when nStrobe falls | 2, whose counter counts them |
//! | 2 | the same for nInit | 3 |
//! | 3 | samples 16 lines from the first strobe on | 4 |
//!
//! A printer without tickets stays busy: so it stops at a byte. A byte that is strobed while machine 0 is not waiting is lost, as at a real
//! printer, and shows as a strobe more than bytes. When the memory is full, machine 0 stays busy at its push.

use crate::pins;
use embassy_rp::pac;
use embassy_rp::pac::dma::vals::{DataSize, TreqSel};
use embassy_rp::peripherals::PIO0;
use embassy_rp::pio::{Common, LoadedProgram};
use rig::{ROOM, TICK_NS, WORDS};

const TAKE: usize = 0;
const STROBES: usize = 1;
const RESETS: usize = 2;
const WAVE: usize = 3;

const BYTES: usize = 0;
const TICKETS: usize = 1;
const STROBE_COUNT: usize = 2;
const RESET_COUNT: usize = 3;
const SAMPLES: usize = 4;

/// nAck high, Busy low.
const IDLE: u16 = 0b01;
/// Of a printer that is off: both are high by pull-ups, and so they are behind the buffer.
const OFF: u16 = 0b11;

/// What counters count down from.
const COUNTER: u32 = u32::MAX;

/// Where DMA leaves what nobody reads.
static NOWHERE: portable_atomic::AtomicU32 = portable_atomic::AtomicU32::new(0);

/// The port and its memory.
pub struct Port {
    bytes: &'static mut [u8; ROOM],
    words: &'static mut [u32; WORDS],
    /// What DMA reads as ticket.
    ticket: &'static mut u32,
    /// The channel of the tickets was started.
    bringing: bool,
    origins: [u8; 4],
}

fn machine(number: usize) -> pac::pio::StateMachine {
    pac::PIO0.sm(number)
}

fn enable(machines: u8, on: bool) {
    pac::PIO0
        .ctrl()
        .modify(|w| w.set_sm_enable(if on { w.sm_enable() | machines } else { w.sm_enable() & !machines }));
}

/// Executes an instruction at once.
fn execute(number: usize, instruction: u16) {
    machine(number).instr().write(|w| w.set_instr(instruction));
}

/// `jmp ADDRESS side SIDE`, with two bits of side-set.
const fn jump(address: u8, side: u16) -> u16 {
    side << 11 | address as u16
}

/// `mov y, y side SIDE`, which changes nothing but the pins.
const fn show(side: u16) -> u16 {
    0xa042 | side << 11
}

struct Transfer {
    from: u32,
    to: u32,
    count: u32,
    request: TreqSel,
    size: DataSize,
    steps: bool,
}

fn start(channel: usize, transfer: &Transfer) {
    let dma = pac::DMA.ch(channel);
    dma.read_addr().write_value(transfer.from);
    dma.write_addr().write_value(transfer.to);
    dma.trans_count().write_value(transfer.count);
    core::sync::atomic::compiler_fence(core::sync::atomic::Ordering::SeqCst);
    dma.ctrl_trig().write(|w| {
        w.set_treq_sel(transfer.request);
        w.set_data_size(transfer.size);
        w.set_incr_write(transfer.steps);
        w.set_chain_to(channel as u8);
        w.set_en(true);
    });
}

fn abort(channel: usize) {
    pac::DMA.chan_abort().write(|w| w.set_chan_abort(1 << channel));
    while pac::DMA.ch(channel).ctrl_trig().read().busy() {}
}

fn left(channel: usize) -> u32 {
    pac::DMA.ch(channel).trans_count().read()
}

impl Port {
    /// Loads the programs. The printer is off.
    pub fn new(
        common: &mut Common<'static, PIO0>,
        bytes: &'static mut [u8; ROOM],
        words: &'static mut [u32; WORDS],
        ticket: &'static mut u32,
    ) -> Self {
        let take = embassy_rp::pio::program::pio_asm!(
            ".side_set 2",
            "    wait 1 pin 8   side 0b01",
            ".wrap_target",
            "    wait 0 pin 8   side 0b01",
            "    in pins, 8     side 0b11",
            "    push block     side 0b11",
            "    pull block     side 0b11",
            "    mov x, osr     side 0b11",
            "work:",
            "    jmp x-- work   side 0b11",
            "    set x, 15      side 0b10",
            "ack:",
            "    jmp x-- ack    side 0b10",
            "    wait 1 pin 8   side 0b11",
            ".wrap",
        );
        let count = embassy_rp::pio::program::pio_asm!(
            ".wrap_target",
            "    wait 1 pin 8",
            "    wait 0 pin 8",
            "    push block",
            ".wrap",
        );
        let wave = embassy_rp::pio::program::pio_asm!(
            "    wait 0 pin 8",
            ".wrap_target",
            "    in pins, 16",
            ".wrap"
        );
        let take = common.load_program(&take.program);
        let count = common.load_program(&count.program);
        let wave = common.load_program(&wave.program);
        for (number, program, base) in [
            (TAKE, &take, pins::DATA),
            (STROBES, &count, pins::DATA),
            (RESETS, &count, pins::INIT - 8),
            (WAVE, &wave, pins::DATA),
        ] {
            configure(number, program, base);
        }
        execute(TAKE, 0xe083 | OFF << 11); // set pindirs, 3
        execute(TAKE, show(OFF));
        Port {
            bytes,
            words,
            ticket,
            bringing: false,
            origins: [take.origin, count.origin, count.origin, wave.origin],
        }
    }

    /// A printer that is on and idle, counters at zero. It works `work_ns` on each byte, and stays at work on byte number `bytes`.
    pub fn begin(&mut self, work_ns: u32, bytes: u32) {
        self.stop();
        *self.ticket = work_ns / TICK_NS;
        let fifo = |number| pac::PIO0.rxf(number).as_ptr() as u32;
        let nowhere = NOWHERE.as_ptr() as u32;
        let count = |number, request| Transfer {
            from: fifo(number),
            to: nowhere,
            count: COUNTER,
            request,
            size: DataSize::SIZE_BYTE,
            steps: false,
        };
        let bytes_in = Transfer {
            to: self.bytes.as_mut_ptr() as u32,
            count: ROOM as u32,
            steps: true,
            ..count(TAKE, TreqSel::PIO0_RX0)
        };
        start(BYTES, &bytes_in);
        start(STROBE_COUNT, &count(STROBES, TreqSel::PIO0_RX1));
        start(RESET_COUNT, &count(RESETS, TreqSel::PIO0_RX2));
        let samples = Transfer {
            to: self.words.as_mut_ptr() as u32,
            count: WORDS as u32,
            size: DataSize::SIZE_WORD,
            steps: true,
            ..count(WAVE, TreqSel::PIO0_RX3)
        };
        start(SAMPLES, &samples);
        self.bring(bytes - 1);
        execute(TAKE, show(IDLE));
        enable(0b1111, true);
    }

    /// Goes on for so many bytes beyond those it has tickets for.
    pub fn more(&mut self, bytes: u32) {
        abort(TICKETS);
        let waiting = if self.bringing { left(TICKETS) } else { 0 };
        self.bring(waiting.saturating_add(bytes));
    }

    /// Brings so many tickets.
    fn bring(&mut self, count: u32) {
        // The counter of a channel that is not started shows what was left before.
        self.bringing = count > 0;
        if !self.bringing {
            return;
        }
        let tickets = Transfer {
            from: &raw const *self.ticket as u32,
            to: pac::PIO0.txf(TAKE).as_ptr() as u32,
            count,
            request: TreqSel::PIO0_TX0,
            size: DataSize::SIZE_WORD,
            steps: false,
        };
        start(TICKETS, &tickets);
    }

    /// Stops everything. What was counted is gone.
    fn stop(&mut self) {
        enable(0b1111, false);
        for channel in [BYTES, TICKETS, STROBE_COUNT, RESET_COUNT, SAMPLES] {
            abort(channel);
        }
        for (number, origin) in self.origins.into_iter().enumerate() {
            // A change of how the FIFOs are joined empties them.
            machine(number).shiftctrl().modify(|w| w.set_fjoin_rx(true));
            machine(number).shiftctrl().modify(|w| w.set_fjoin_rx(false));
            pac::PIO0.ctrl().modify(|w| w.set_sm_restart(1 << number));
            execute(number, if number == TAKE { jump(origin, OFF) } else { jump(origin, 0) });
        }
    }

    /// Switches the taking of bytes off, these levels at nAck and Busy; or on again, with the byte under way lost.
    pub fn set_taking(&mut self, taking: Result<(), u16>) {
        match taking {
            Err(side) => {
                enable(1 << TAKE, false);
                execute(TAKE, show(side));
            }
            Ok(()) => {
                pac::PIO0.ctrl().modify(|w| w.set_sm_restart(1 << TAKE));
                execute(TAKE, jump(self.origins[TAKE], IDLE));
                enable(1 << TAKE, true);
            }
        }
    }

    /// As a printer that is switched off.
    pub fn set_off(&mut self) {
        self.set_taking(Err(OFF));
    }

    /// What it took.
    pub fn taken(&self) -> &[u8] {
        &self.bytes[..ROOM - (left(BYTES) as usize).min(ROOM)]
    }

    /// Strobes and pulses of nInit.
    pub fn counts(&self) -> (u32, u32) {
        (COUNTER - left(STROBE_COUNT), COUNTER - left(RESET_COUNT))
    }

    /// Samples so far.
    pub fn wave(&self) -> &[u32] {
        &self.words[..WORDS - (left(SAMPLES) as usize).min(WORDS)]
    }
}

/// A machine of its program, standing still at its beginning. Its `in` shifts so that what came first ends lowest.
fn configure(number: usize, program: &LoadedProgram<'static, PIO0>, base: u8) {
    let sm = machine(number);
    sm.clkdiv().write(|w| w.0 = (TICK_NS / 8) << 16);
    sm.execctrl().write(|w| {
        w.set_wrap_bottom(program.wrap.target);
        w.set_wrap_top(program.wrap.source);
    });
    sm.shiftctrl().write(|w| {
        w.set_in_shiftdir(number == WAVE);
        w.set_autopush(number == WAVE);
    });
    sm.pinctrl().write(|w| {
        w.set_in_base(base);
        w.set_sideset_count(if number == TAKE { 2 } else { 0 });
        w.set_sideset_base(pins::ACK);
        w.set_set_base(pins::ACK);
        w.set_set_count(2);
    });
}
