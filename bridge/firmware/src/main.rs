//! The bridge on a Raspberry Pi Pico or Pico 2.
//!
//! Every decision is in the library `bridge`, where it is tested without a board. Here is what the board adds: pins, a
//! strobe engine of PIO and DMA, a USB device, flash, memory that survives a reset, a watchdog, and the calls between
//! these and the library. What only this board can show (the PIO program, DMA, descriptors) is tested with the image
//! on an emulated one. Nine tasks on one core:
//!
//! | task | waits for | does |
//! |---|---|---|
//! | `usb::device::run` | the bus | runs the device itself |
//! | `usb::link::serial`, `usb::link::bulk` | packets | give them to the engine |
//! | `usb::link::answer` | something to say | takes frames from the engine |
//! | `usb::printer::run` | packets | gives them to the intake of the printer class |
//! | `work` | data, room | lets the engine make printer bytes, a turn at a time |
//! | `port::serve` | 1 ms, a sent buffer | polls the port's driver |
//! | `alone::serve` | 10 ms, packets, the button | writes to and reads from the store |
//! | `watch::run` | 10 ms | sets the lamp, looks at the button, feeds the watchdog |
//!
//! Memory: 64 KiB of stack, lowest, most of it for the start; 79,040 bytes for a band of the widest page at 1200 dpi, 36 KiB of printer bytes so that the
//! printer has work while a band is decoded, 12 KiB of window for the link, 8 KiB that outlive a reset.
#![no_std]
#![no_main]

mod alone;
mod board;
mod fault;
mod flash;
mod log;
mod pins;
mod port;
mod retained;
mod shared;
mod stack;
mod strobe;
mod trace;
mod usb;
mod watch;

use bridge::alone::Alone;
use bridge::engine::{Checkpoint, Engine, Identity, Memory};
use bridge::turn::{self, Turn};
use core::ffi::CStr;
use embassy_executor::Spawner;
use embassy_futures::yield_now;
use embassy_rp::binary_info::consts::{ID_RP_PROGRAM_VERSION_STRING, TAG_RASPBERRY_PI};
use embassy_rp::binary_info::{self, EntryAddr, rp_program_name};
use embassy_rp::clocks::{self, RoscRng};
use embassy_rp::pac;
use embassy_rp::peripherals::{PIO0, USB};
use embassy_rp::pio::Pio;
use embassy_rp::{bind_interrupts, pio, usb as usb_driver};
use embassy_time::Instant;
use flash::Area;
use protocol::runs::Decoder;
use shared::{Shared, Side};
use static_cell::{ConstStaticCell, StaticCell};
use strobe::{CHUNK, Strobe};
use usb::control::Watchful;
use usb::{device, link, printer};
use watch::Life;

bind_interrupts!(struct Interrupts {
    USBCTRL_IRQ => usb_driver::InterruptHandler<USB>;
    PIO0_IRQ_0 => pio::InterruptHandler<PIO0>;
});

/// The program's name and version in the image, for whoever is to flash it.
#[unsafe(link_section = ".bi_entries")]
#[used]
static PROGRAM: [EntryAddr; 2] = [
    rp_program_name!(c"foilpress-bridge"),
    binary_info::str!(TAG_RASPBERRY_PI, ID_RP_PROGRAM_VERSION_STRING, VERSION),
];

const VERSION: &CStr = match CStr::from_bytes_with_nul(board::VERSION.as_bytes()) {
    Ok(version) => version,
    Err(_) => panic!("it ends with a zero"),
};

// The library counts time in µs, and a tick is one: converted they would be divided, by a processor that cannot.
const _: () = assert!(embassy_time::TICK_HZ == 1_000_000);

/// 64 rows of 9880 dots, as `protocol::runs::band_bytes` counts them.
const WIDEST_BAND: usize = 9880_usize.div_ceil(8) * 64;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    // Before anything else: the lines at rest.
    let peripherals = embassy_rp::init(Default::default());
    pins::bring_up();
    // From here on every task has to show that it lives, also while USB starts.
    let watchdog = watch::start(peripherals.WATCHDOG);

    // Before the first word of the log, and before a byte goes to the printer.
    let (checkpoints, checkpoint, known) = retained::checkpoints();
    let reason = pac::WATCHDOG.reason().read();
    // RUN, or a supply that sags: it may have come within a strobe.
    let from_outside = !reason.timer() && !reason.force();
    let checkpoint = if from_outside { checkpoint.map(Checkpoint::reset_from_outside) } else { checkpoint };
    if from_outside {
        // An operation of the flash that RUN has cut short has not hung.
        retained::flash_works(false);
    }
    let used_before = stack::used();
    stack::fill();

    // Times are counted in cycles of this clock.
    assert!(clocks::clk_sys_freq() == board::CLOCK_HZ);

    let mut flash = flash::take(peripherals.FLASH);
    let number = board::serial_number(&mut flash);
    let identity = Identity {
        boot: RoscRng.next_u32(),
        serial: u64::from_be_bytes(number),
        firmware: VERSION.to_str().unwrap_or_default(),
    };

    static DATA: ConstStaticCell<[u8; 12 * 1024]> = ConstStaticCell::new([0; 12 * 1024]);
    static OUTPUT: ConstStaticCell<[u8; 36 * 1024]> = ConstStaticCell::new([0; 36 * 1024]);
    static BAND: ConstStaticCell<[u8; WIDEST_BAND]> = ConstStaticCell::new([0; WIDEST_BAND]);
    static SHARED: StaticCell<Shared> = StaticCell::new();
    // In its place from the beginning: on the stack it would be there twice.
    static DECODER: StaticCell<Decoder> = StaticCell::new();
    let decoder = DECODER.init_with(Decoder::default);
    let memory = Memory { data: DATA.take(), output: OUTPUT.take(), band: BAND.take(), decoder };
    defmt::info!(
        "bridge {=str} {=u64:x} up on a {=str}, after {=str}",
        identity.firmware,
        identity.serial,
        board::NAME,
        match (reason.timer(), reason.force()) {
            (true, _) => "the watchdog's bite",
            (_, true) => "a restart",
            _ => "power or reset",
        }
    );
    if known {
        defmt::info!("the run before used {=u32} of {=u32} bytes of stack", used_before, stack::size());
    }
    if let Some(checkpoint) = &checkpoint {
        let Checkpoint { progress, .. } = checkpoint;
        defmt::info!(
            "job {=u32:08x} from before: {}, {=u32} bytes printed",
            progress.job,
            progress.state,
            progress.printed
        );
    }
    let shared: &'static Shared = SHARED.init_with(|| {
        Shared::new(match checkpoint {
            Some(checkpoint) => Engine::resume(memory, identity, checkpoint),
            None => Engine::new(memory, identity),
        })
    });
    // Before a byte goes anywhere: the flash says where the printer stands.
    static ALONE: StaticCell<Alone<Area>> = StaticCell::new();
    if retained::flash_hung() {
        defmt::error!("the flash has not ended an operation: nothing is stored until the supply was away");
    }
    let area = Area::new(flash);
    let alone = ALONE.init_with(|| shared.engine(|engine| Alone::open(area, engine, checkpoint.is_some())));
    let store = alone.store();
    defmt::info!(
        "{=usize} jobs stored, room for {=u32} of {=u32} bytes",
        store.jobs().len(),
        store.room(),
        store.total()
    );

    let Pio { mut common, sm0, .. } = Pio::new(peripherals.PIO0, Interrupts);
    let data = [
        common.make_pio_pin(peripherals.PIN_2),
        common.make_pio_pin(peripherals.PIN_3),
        common.make_pio_pin(peripherals.PIN_4),
        common.make_pio_pin(peripherals.PIN_5),
        common.make_pio_pin(peripherals.PIN_6),
        common.make_pio_pin(peripherals.PIN_7),
        common.make_pio_pin(peripherals.PIN_8),
        common.make_pio_pin(peripherals.PIN_9),
    ];
    let strobe_pin = common.make_pio_pin(peripherals.PIN_10);
    let busy = common.make_pio_pin(peripherals.PIN_15);
    static BUFFERS: ConstStaticCell<[[u8; CHUNK]; 2]> = ConstStaticCell::new([[0; CHUNK]; 2]);
    let [first, second] = BUFFERS.take();
    let mut strobe = Strobe::new(
        &mut common,
        sm0,
        data,
        strobe_pin,
        busy,
        [first, second],
        (peripherals.DMA_CH0, peripherals.DMA_CH1),
    );
    strobe.set_place(checkpoints.place());
    // The pins went to the PIO block and had no driver meanwhile. The cable has not seen it: the driver enables the buffers.
    pins::bring_up();

    static DRIVER: StaticCell<port::PicoDriver> = StaticCell::new();
    let driver = DRIVER.init_with(|| port::driver(strobe, checkpoints));

    static SERIAL: StaticCell<[u8; 16]> = StaticCell::new();
    let serial_number = hex(&number, SERIAL.init([0; 16]));
    let driver_of_bus = Watchful(usb_driver::Driver::new(peripherals.USB, Interrupts));
    let usb = device::build(driver_of_bus, serial_number, shared);
    // The pools hold one of each task, and each is spawned once.
    spawner.spawn(device::run(usb.device).unwrap());
    spawner.spawn(link::serial(shared, usb.serial_in, usb.serial_lines).unwrap());
    spawner.spawn(link::bulk(shared, usb.bulk_in).unwrap());
    spawner.spawn(link::answer(shared, usb.serial_out, usb.bulk_out).unwrap());
    let (from_host, to_host) = usb.printer;
    spawner.spawn(printer::run(shared, from_host, to_host).unwrap());
    spawner.spawn(port::serve(shared, driver).unwrap());
    spawner.spawn(alone::serve(shared, alone).unwrap());
    spawner.spawn(watch::run(shared, watchdog).unwrap());
    trace::restart();
    work(shared).await
}

/// Lets the engine work, a turn at a time.
async fn work(shared: &'static Shared) {
    loop {
        watch::show_life(Life::Work);
        let Turn { more, wake_port, wake_store } =
            shared.engine(|engine| turn::work(engine, || Instant::now().as_ticks()));
        if wake_port {
            shared.wake(Side::Port);
        }
        if wake_store {
            shared.wake(Side::Store);
        }
        if more {
            yield_now().await;
        } else {
            shared.wake(Side::Link);
            shared.wait(Side::Work).await;
        }
    }
}

fn hex<'a>(bytes: &[u8; 8], text: &'a mut [u8; 16]) -> &'a str {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    for (pair, &byte) in text.chunks_exact_mut(2).zip(bytes) {
        pair[0] = DIGITS[usize::from(byte >> 4)];
        pair[1] = DIGITS[usize::from(byte & 15)];
    }
    core::str::from_utf8(text).unwrap_or("0")
}
