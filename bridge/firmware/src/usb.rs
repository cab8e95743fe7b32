//! The link: one USB device with a serial port and a pair of bulk endpoints, both speaking frames; and a [printer], which
//! speaks none.
//!
//! The serial port (CDC-ACM) is there for every program that can open one; the bulk endpoints, a vendor function that
//! Windows binds to WinUSB by itself, for programs with a USB library. Each has its own frame reader. Answers go
//! to the one that spoke last.
//!
//! What arrives is always read: flow control is by credits in the frames, never by leaving an endpoint full, so a
//! cancel or a question is seen however much data is under way.

use crate::keep;
use crate::printer::{self, Face, LONGEST};
use crate::shared::{Shared, Side};
use core::cell::Cell;
use embassy_futures::select::{Either, select};
use embassy_rp::peripherals::USB;
use embassy_rp::usb::Driver;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{CdcAcmClass, ControlChanged, Receiver, Sender, State};
use embassy_usb::driver::{Endpoint, EndpointError, EndpointIn, EndpointOut};
use embassy_usb::msos::{self, windows_version};
use embassy_usb::{Builder, Config, UsbDevice};
use protocol::link::frame::{MAX, Reader};
use protocol::link::message::DATA_MAX;
use static_cell::StaticCell;

/// The driver.
pub type Usb = Driver<'static, USB>;
/// A bulk endpoint to the host.
pub type BulkIn = <Usb as embassy_usb::driver::Driver<'static>>::EndpointIn;
/// A bulk endpoint from the host.
pub type BulkOut = <Usb as embassy_usb::driver::Driver<'static>>::EndpointOut;

/// A test number of pid.codes, to be replaced by one of the project's own before boards are sold.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

/// Any number that is no standard request.
const MSOS_REQUEST: u8 = 0x20;

/// Windows finds the bulk endpoints by it.
const INTERFACE_GUIDS: &[&str] = &["{6E8C7E4B-3D0D-4F7A-9B0B-0F1C5C1E5F55}"];

/// Bytes of a full packet.
pub const PACKET: u16 = 64;

/// One less than a packet: a full one would have to be followed by an empty one for the host to stop waiting.
const PORTION: usize = PACKET as usize - 1;

/// The device and its ends.
pub struct Link {
    /// To be run by a task.
    pub device: UsbDevice<'static, Usb>,
    /// The serial port, outwards.
    pub serial_out: Sender<'static, Usb>,
    /// The serial port, inwards.
    pub serial_in: Receiver<'static, Usb>,
    /// The serial port's lines.
    pub serial_lines: ControlChanged<'static>,
    /// The bulk endpoint to the host.
    pub bulk_out: BulkIn,
    /// The bulk endpoint from the host.
    pub bulk_in: BulkOut,
    /// The printer's endpoints.
    pub printer: (BulkOut, BulkIn),
}

/// Builds the device. To be called once.
pub fn build(driver: Usb, serial_number: &'static str, face: &'static Face) -> Link {
    static CONFIGURATION: StaticCell<[u8; 192]> = StaticCell::new();
    static BOS: StaticCell<[u8; 64]> = StaticCell::new();
    static MSOS: StaticCell<[u8; 256]> = StaticCell::new();
    static CONTROL: StaticCell<[u8; LONGEST]> = StaticCell::new();
    static STATE: StaticCell<State<'static>> = StaticCell::new();

    let mut config = Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some("Foilpress");
    config.product = Some("Foilpress bridge");
    config.serial_number = Some(serial_number);
    config.max_power = 100;
    let mut builder = Builder::new(
        driver,
        config,
        CONFIGURATION.init([0; 192]),
        BOS.init([0; 64]),
        MSOS.init([0; 256]),
        CONTROL.init([0; LONGEST]),
    );
    builder.msos_descriptor(windows_version::WIN8_1, MSOS_REQUEST);

    let serial = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET);
    let (serial_out, serial_in, serial_lines) = serial.split_with_control();

    let mut function = builder.function(0xff, 0, 0);
    function.msos_feature(msos::CompatibleIdFeatureDescriptor::new("WINUSB", ""));
    function.msos_feature(msos::RegistryPropertyFeatureDescriptor::new(
        "DeviceInterfaceGUIDs",
        msos::PropertyData::RegMultiSz(INTERFACE_GUIDS),
    ));
    let mut interface = function.interface();
    let mut setting = interface.alt_setting(0xff, 0, 0, None);
    let bulk_in = setting.endpoint_bulk_out(None, PACKET);
    let bulk_out = setting.endpoint_bulk_in(None, PACKET);
    drop(function);
    let printer = printer::build(&mut builder, face);

    Link { device: builder.build(), serial_out, serial_in, serial_lines, bulk_out, bulk_in, printer }
}

/// Who is to be answered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Speaker {
    Serial,
    Bulk,
}

/// Who spoke last, and a bell for when that changes.
pub struct Floor {
    speaker: Cell<Option<Speaker>>,
    changed: Signal<NoopRawMutex, ()>,
}

impl Floor {
    /// Nobody has spoken.
    pub const fn new() -> Self {
        Floor { speaker: Cell::new(None), changed: Signal::new() }
    }

    fn take(&self, speaker: Speaker) {
        if self.speaker.replace(Some(speaker)) != Some(speaker) {
            self.changed.signal(());
        }
    }

    /// `speaker` is gone; true if it was to be answered.
    fn leave(&self, speaker: Speaker) -> bool {
        let left = self.speaker.get() == Some(speaker);
        if left {
            self.speaker.set(None);
            self.changed.signal(());
        }
        left
    }
}

impl Shared {
    fn hear(&self, floor: &Floor, speaker: Speaker, reader: &mut Reader, bytes: &[u8]) {
        floor.take(speaker);
        self.engine(|engine| engine.receive(reader, bytes));
        self.wake(Side::Work);
        self.wake(Side::Port);
        self.wake(Side::Link);
    }

    fn gone(&self, floor: &Floor, speaker: Speaker, reader: &mut Reader) {
        reader.reset();
        if floor.leave(speaker) {
            self.engine(|engine| engine.link_lost());
        }
    }
}

/// Runs the device.
#[embassy_executor::task]
pub async fn run(mut device: UsbDevice<'static, Usb>) -> ! {
    device.run().await
}

/// Reads the serial port.
#[embassy_executor::task]
pub async fn serial(
    shared: &'static Shared,
    floor: &'static Floor,
    mut serial: Receiver<'static, Usb>,
    lines: ControlChanged<'static>,
) -> ! {
    static READER: StaticCell<Reader> = StaticCell::new();
    let reader = READER.init(Reader::new());
    let mut packet = [0; PACKET as usize];
    let mut ready = false;
    loop {
        serial.wait_connection().await;
        loop {
            match select(serial.read_packet(&mut packet), lines.control_changed()).await {
                Either::First(Ok(count)) => {
                    shared.hear(floor, Speaker::Serial, reader, &packet[..count]);
                }
                Either::First(Err(_)) => break,
                Either::Second(()) => {
                    // A host that closes the port drops this line. Some never raise it, so only its fall counts.
                    let now = serial.dtr();
                    if ready && !now {
                        shared.gone(floor, Speaker::Serial, reader);
                    }
                    ready = now;
                }
            }
        }
        shared.gone(floor, Speaker::Serial, reader);
    }
}

/// Reads the bulk endpoint.
#[embassy_executor::task]
pub async fn bulk(shared: &'static Shared, floor: &'static Floor, mut endpoint: BulkOut) -> ! {
    static READER: StaticCell<Reader> = StaticCell::new();
    let reader = READER.init(Reader::new());
    let mut packet = [0; PACKET as usize];
    loop {
        endpoint.wait_enabled().await;
        while let Ok(count) = endpoint.read(&mut packet).await {
            shared.hear(floor, Speaker::Bulk, reader, &packet[..count]);
        }
        shared.gone(floor, Speaker::Bulk, reader);
    }
}

/// Writes frames to whoever is to be answered.
#[embassy_executor::task]
pub async fn answer(
    shared: &'static Shared,
    floor: &'static Floor,
    mut serial: Sender<'static, Usb>,
    mut bulk: BulkIn,
) -> ! {
    static FRAME: StaticCell<[u8; MAX]> = StaticCell::new();
    let frame = FRAME.init([0; MAX]);
    loop {
        shared.wait(Side::Link).await;
        while let Some(speaker) = floor.speaker.get() {
            let length = shared.engine(|engine| {
                if let Some(from) = engine.log_wanted() {
                    let (at, end, count) = keep::read_log(from, &mut frame[..DATA_MAX]);
                    engine.log(at, end, &frame[..count]);
                }
                engine.transmit(frame)
            });
            if length == 0 {
                break;
            }
            floor.changed.reset();
            let send = async {
                for portion in frame[..length].chunks(PORTION) {
                    match speaker {
                        Speaker::Serial => serial.write_packet(portion).await?,
                        Speaker::Bulk => bulk.write(portion).await?,
                    }
                }
                Ok::<(), EndpointError>(())
            };
            // A host that has gone silent must not keep the other one from being answered. What it misses of a frame
            // it finds out by the checksum.
            match select(send, floor.changed.wait()).await {
                Either::First(Ok(())) | Either::Second(()) => {}
                Either::First(Err(_)) => {
                    floor.leave(speaker);
                    shared.engine(|engine| engine.link_lost());
                }
            }
        }
    }
}
