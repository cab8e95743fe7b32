//! A bridge's pair of bulk endpoints, through the system's USB library.
//!
//! Problem: find the bridges on USB, also those that may not be opened, and make a byte pipe of one of them.
//! Method: devices with the bridge's numbers and its maker's name; the interface of class *vendor* with one bulk
//! endpoint each way, as the descriptors say. Linux tells names and serial numbers in `/sys` to everybody, so a bridge
//! without permission can still be named; elsewhere the device itself is asked.
//! Limits: a device that is plugged in while the list is made may be missed. A transfer that runs out of time on macOS
//! may lose what had come: the frames' checksums notice, and it is said again.

use std::io::{self, ErrorKind};
use std::time::Duration;

use rusb::{Context, Device, DeviceHandle, Direction, TransferType, UsbContext as _};

use super::transport::{Transport, WRITE_PATIENCE};

/// The maker's name in the descriptors.
const MAKER: &str = "Foilpress";
/// Class of an interface that speaks a language of its own.
const VENDOR_CLASS: u8 = 0xff;
/// Asking a device for its name.
const NAME_PATIENCE: Duration = Duration::from_millis(500);
/// Largest transfer asked for: a multiple of every packet size there is.
const TRANSFER: usize = 4096;

/// What lets the person at a Linux machine open the bridge.
pub const UDEV_RULES: &str = include_str!("../../../../packaging/70-foilpress.rules");

/// A device of certain numbers.
pub struct Attached {
    pub(crate) device: Device<Context>,
    /// Its maker, as far as it can be known.
    pub maker: Option<String>,
    /// What it is.
    pub product: Option<String>,
    /// Its serial number.
    pub serial_number: Option<String>,
    /// Why it cannot be opened.
    pub closed: Option<rusb::Error>,
}

impl Attached {
    fn new(device: Device<Context>) -> Attached {
        let open = device.open();
        let closed = open.as_ref().err().copied();
        let told = |file: &str, index: fn(&rusb::DeviceDescriptor) -> Option<u8>| {
            system_tells(&device, file).or_else(|| {
                let handle = open.as_ref().ok()?;
                let index = index(&device.device_descriptor().ok()?)?;
                let language = *handle.read_languages(NAME_PATIENCE).ok()?.first()?;
                handle.read_string_descriptor(language, index, NAME_PATIENCE).ok()
            })
        };
        let printable = |text: String| super::printable(&text);
        Attached {
            maker: told("manufacturer", |d| d.manufacturer_string_index()).map(printable),
            product: told("product", |d| d.product_string_index()).map(printable),
            serial_number: told("serial", |d| d.serial_number_string_index()).map(printable),
            closed,
            device,
        }
    }

    /// Whether the system does not let this user open it.
    pub fn is_forbidden(&self) -> bool {
        self.closed == Some(rusb::Error::Access)
    }

    /// Whether it has this serial number; the case of its digits does not matter.
    pub fn is(&self, serial_number: &str) -> bool {
        self.serial_number.as_deref().is_some_and(|own| own.eq_ignore_ascii_case(serial_number))
    }
}

/// What Linux says about a device in a file of its folder.
fn system_tells(device: &Device<Context>, file: &str) -> Option<String> {
    if !cfg!(target_os = "linux") {
        return None;
    }
    let ports: Vec<String> = device.port_numbers().ok()?.iter().map(u8::to_string).collect();
    let path = format!("/sys/bus/usb/devices/{}-{}/{file}", device.bus_number(), ports.join("."));
    let text = std::fs::read_to_string(path).ok()?;
    Some(text.trim_end().to_owned())
}

/// The devices with these vendor and product numbers, in an order that does not change while they stay plugged in.
pub fn attached(numbers: (u16, u16)) -> io::Result<Vec<Attached>> {
    let system = Context::new().map_err(|error| match error {
        // What the library says where the kernel has no USB at all.
        rusb::Error::Other => io::Error::other(
            "this system shows no USB bus; a container, a virtual machine or WSL has to be given one",
        ),
        error => translated(error),
    })?;
    let mut found: Vec<_> = system
        .devices()
        .map_err(translated)?
        .iter()
        .filter(|device| device.device_descriptor().is_ok_and(|d| (d.vendor_id(), d.product_id()) == numbers))
        .collect();
    found.sort_by_key(|device| (device.bus_number(), device.address()));
    Ok(found.into_iter().map(Attached::new).collect())
}

/// The bridges on USB, those that may not be opened included.
pub fn bridges() -> io::Result<Vec<Attached>> {
    let mut found = attached(protocol::USB)?;
    // One whose maker is not to be known is taken for a bridge: its numbers fit, and why it is closed is worth saying.
    found.retain(|device| device.maker.as_deref().is_none_or(|maker| maker == MAKER));
    Ok(found)
}

/// An interface with a pair of bulk endpoints, claimed by this program.
pub struct Pair {
    /// The device.
    pub handle: DeviceHandle<Context>,
    /// The interface's number.
    pub interface: u8,
    /// The endpoint to the device.
    pub out: u8,
    /// The endpoint from the device.
    pub into: u8,
}

impl Pair {
    /// Opens the first interface of class *vendor* that has one bulk endpoint each way.
    pub fn claim(device: &Device<Context>) -> io::Result<Pair> {
        let (interface, out, into) = find_pair(device).map_err(translated)?.ok_or_else(|| {
            io::Error::new(ErrorKind::InvalidData, "the device has no interface of the kind expected")
        })?;
        let handle = device.open().map_err(translated)?;
        // No system has a driver of its own for the class *vendor*, so there is none to detach.
        handle.claim_interface(interface).map_err(translated)?;
        Ok(Pair { handle, interface, out, into })
    }
}

fn find_pair(device: &Device<Context>) -> rusb::Result<Option<(u8, u8, u8)>> {
    let configuration = device.active_config_descriptor()?;
    for setting in configuration.interfaces().filter_map(|interface| interface.descriptors().next()) {
        if setting.class_code() != VENDOR_CLASS {
            continue;
        }
        let (mut out, mut into) = (None, None);
        for endpoint in setting.endpoint_descriptors() {
            match (endpoint.transfer_type(), endpoint.direction()) {
                (TransferType::Bulk, Direction::Out) => out = out.or(Some(endpoint.address())),
                (TransferType::Bulk, Direction::In) => into = into.or(Some(endpoint.address())),
                _ => {}
            }
        }
        if let (Some(out), Some(into)) = (out, into) {
            return Ok(Some((setting.interface_number(), out, into)));
        }
    }
    Ok(None)
}

/// What the USB library says, as the rest of the program says it.
pub fn translated(error: rusb::Error) -> io::Error {
    let kind = match error {
        rusb::Error::Access => ErrorKind::PermissionDenied,
        rusb::Error::Busy => ErrorKind::ResourceBusy,
        rusb::Error::NoDevice | rusb::Error::NotFound => ErrorKind::NotFound,
        rusb::Error::Timeout => ErrorKind::TimedOut,
        rusb::Error::Interrupted => ErrorKind::Interrupted,
        rusb::Error::Pipe => ErrorKind::BrokenPipe,
        rusb::Error::NoMem => ErrorKind::OutOfMemory,
        rusb::Error::NotSupported => ErrorKind::Unsupported,
        _ => ErrorKind::Other,
    };
    let text = match error {
        rusb::Error::NoDevice => "the device was unplugged",
        rusb::Error::NotSupported => "the system has no driver for the device's interface",
        _ => return io::Error::new(kind, error),
    };
    io::Error::new(kind, text)
}

/// A bridge's bulk endpoints as a pipe.
pub struct Usb {
    pair: Pair,
    /// What came and was not asked for yet.
    held: [u8; TRANSFER],
    rest: std::ops::Range<usize>,
}

impl Usb {
    /// Claims the bridge's bulk endpoints for this program alone, and throws away what an earlier conversation left.
    pub fn open(bridge: &Attached) -> io::Result<Usb> {
        /// More than the bridge can have under way: packets in its buffers and a frame behind them.
        const STALE: usize = 64;
        let pair = Pair::claim(&bridge.device)?;
        let mut usb = Usb { pair, held: [0; TRANSFER], rest: 0..0 };
        for _ in 0..STALE {
            if usb.fetch(Duration::ZERO)? == 0 {
                break;
            }
        }
        usb.rest = 0..0;
        Ok(usb)
    }

    fn fetch(&mut self, patience: Duration) -> io::Result<usize> {
        // The library takes nothing for no limit.
        let patience = patience.max(Duration::from_millis(1));
        let count = later(self.pair.handle.read_bulk(self.pair.into, &mut self.held, patience))?;
        self.rest = 0..count;
        Ok(count)
    }
}

fn later(result: rusb::Result<usize>) -> io::Result<usize> {
    match result {
        Err(rusb::Error::Timeout | rusb::Error::Interrupted) => Ok(0),
        other => other.map_err(translated),
    }
}

impl Transport for Usb {
    fn send(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let bytes = &bytes[..bytes.len().min(TRANSFER)];
        later(self.pair.handle.write_bulk(self.pair.out, bytes, WRITE_PATIENCE))
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.rest.is_empty() && !buffer.is_empty() {
            self.fetch(patience)?;
        }
        let count = self.rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.held[self.rest.start..self.rest.start + count]);
        self.rest.start += count;
        Ok(count)
    }
}
