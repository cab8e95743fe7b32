//! The device and its descriptors.
//!
//! The serial port (CDC-ACM) is there for every program that can open one; the bulk endpoints, a vendor function that
//! Windows binds to WinUSB by itself, for programs with a USB library; the printer for operating systems.

use super::{BulkIn, BulkOut, PACKET, Usb, printer};
use crate::shared::Shared;
use bridge::printer_class::DEVICE_ID_MAX;
use embassy_usb::class::cdc_acm::{CdcAcmClass, ControlChanged, Receiver, Sender, State};
use embassy_usb::msos::{self, windows_version};
use embassy_usb::{Builder, Config, UsbDevice};
use static_cell::StaticCell;

/// Any number that is no standard request.
const MSOS_REQUEST: u8 = 0x20;

/// Windows finds the bulk endpoints by it.
const INTERFACE_GUIDS: &[&str] = &["{6E8C7E4B-3D0D-4F7A-9B0B-0F1C5C1E5F55}"];

/// The device and its endpoints.
pub struct Device {
    /// To be run by a task.
    pub device: UsbDevice<'static, Usb>,
    /// The serial port, to the host.
    pub serial_out: Sender<'static, Usb>,
    /// The serial port, from the host.
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
pub fn build(driver: Usb, serial_number: &'static str, shared: &'static Shared) -> Device {
    static CONFIGURATION: StaticCell<[u8; 192]> = StaticCell::new();
    static BOS: StaticCell<[u8; 64]> = StaticCell::new();
    static MSOS: StaticCell<[u8; 256]> = StaticCell::new();
    // The device ID is the longest answer to a control request.
    static CONTROL: StaticCell<[u8; DEVICE_ID_MAX]> = StaticCell::new();
    static STATE: StaticCell<State<'static>> = StaticCell::new();

    let mut config = Config::new(protocol::USB.0, protocol::USB.1);
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
        CONTROL.init([0; DEVICE_ID_MAX]),
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
    let printer = printer::build(&mut builder, shared);

    Device { device: builder.build(), serial_out, serial_in, serial_lines, bulk_out, bulk_in, printer }
}

/// Runs the device.
#[embassy_executor::task]
pub async fn run(mut device: UsbDevice<'static, Usb>) -> ! {
    device.run().await
}
