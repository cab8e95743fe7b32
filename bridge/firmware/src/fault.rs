//! The last words of a program that cannot go on: a panic, or a fault of the processor.
//!
//! Both write where the program was to the log, which outlives the restart, and switch the buffers off once the byte under way
//! has crossed. The watchdog, which nobody feeds any more, does the rest; what was sent is marked, so the job goes on after it.
//!
//! A fault tells the registers as they were. If the stack has grown beyond its end there was no place to save them, and it says
//! that. Should the processor lock up instead, which a fault in a fault makes it do, the log has no word of it; the next start
//! tells then how much of the stack was used, which is all.
//!
//! A panic tells the return addresses on the stack, and whatever looks like one, for `addr2line`. File and line of every possible
//! panic would take 14 KB of flash.

use crate::{board, log, pins, stack, strobe};

/// Room for the handler below the pointer; with less, it begins again at the top of the stack, whose content nobody needs then.
const ROOM: u32 = 1024;

core::arch::global_asm!(
    // The processor has saved eight words where the main stack's pointer is now. The handler's stack is that one, if there is room.
    ".section .HardFault.handler, \"ax\"",
    ".global HardFault",
    ".type HardFault, %function",
    ".thumb_func",
    "HardFault:",
    "    mrs r0, msp",
    "    ldr r1, =_stack_end + {room}",
    "    cmp r0, r1",
    "    bhs 1f",
    "    ldr r1, =_stack_start",
    "    mov sp, r1",
    "1:  bl {fault}",
    "    .ltorg",
    room = const ROOM,
    fault = sym fault,
);

/// What the processor saves when it takes an exception.
#[repr(C)]
#[derive(Clone, Copy)]
struct Frame {
    r: [u32; 4],
    r12: u32,
    lr: u32,
    pc: u32,
    xpsr: u32,
}

/// Ends the program, with the address of what the processor has saved.
extern "C" fn fault(at: u32) -> ! {
    quieten();
    if at < stack::end() || at > stack::start() - size_of::<Frame>() as u32 {
        defmt::error!("fault: the stack has grown beyond its {=u32} bytes", stack::size());
    } else {
        // SAFETY: within the stack, which is memory, and a multiple of four as the processor has it. Any words are a frame.
        let Frame { r, r12, lr, pc, xpsr } = unsafe { (at as *const Frame).read_volatile() };
        defmt::error!(
            "fault at {=u32:#x}, called from {=u32:#x}: r0 to r3 {:#x}, r12 {=u32:#x}, psr {=u32:#x}, sp {=u32:#x}",
            pc,
            lr,
            &r[..],
            r12,
            xpsr,
            at + size_of::<Frame>() as u32
        );
    }
    halt()
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    quieten();
    let mut trace = [0; 8];
    let (mut at, mut found) = (cortex_m::register::msp::read(), 0);
    while at < stack::start() && found < trace.len() {
        // SAFETY: a word of the stack in use, which lies between the pointer and its top.
        let word = unsafe { (at as *const u32).read_volatile() };
        // Instructions are in flash, and an odd address is that of Thumb code.
        if board::CODE.contains(&word) && word & 1 == 1 {
            (trace[found], found) = (word, found + 1);
        }
        at += 4;
    }
    defmt::error!("panic at {:#x}", &trace[..found]);
    halt()
}

/// Nothing happens any more but what this module does.
fn quieten() {
    cortex_m::interrupt::disable();
    strobe::halt();
    pins::enable(false);
    log::take_over();
}

fn halt() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
