//! The bridges at this computer, each once, by whatever ways it can be reached.
//!
//! A bridge shows a serial port and a pair of bulk endpoints; its serial number says that they are one. Ports of other
//! devices are listed but never spoken to: a greeting may mean something to them.

use serialport::SerialPortType;

use super::address::{Address, OpenError};
use super::transport::Transport;
use super::usb;

/// What is plugged in.
#[derive(Default)]
pub struct Survey {
    /// What may be a bridge.
    pub bridges: Vec<Candidate>,
    /// Serial ports of other devices on USB.
    pub others: Vec<Port>,
}

/// A device that says it is a bridge.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// Its serial number, if it tells.
    pub serial_number: Option<String>,
    /// The ways to it, the one to try first in front. Never empty.
    pub addresses: Vec<Address>,
}

/// A serial port on USB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Where it is.
    pub address: Address,
    /// What it says it is.
    pub product: String,
    /// Its serial number, if it tells.
    pub serial_number: Option<String>,
    /// Whether it may be a bridge.
    pub bridge: bool,
}

/// Looks what is plugged in. A system that cannot list its ports, or its USB devices, has none to offer; a port can
/// still be named.
pub fn survey() -> Survey {
    let usb = usb::bridges().unwrap_or_default();
    joined(ports(), usb.into_iter().map(|bridge| bridge.serial_number).collect())
}

fn ports() -> Vec<Port> {
    // The library's search takes for granted that Linux has this folder; containers may not.
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut ports: Vec<Port> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .filter_map(|port| {
            let SerialPortType::UsbPort(device) = port.port_type else { return None };
            let product = device.product.unwrap_or_else(|| format!("{:04x}:{:04x}", device.vid, device.pid));
            // Windows tells its driver's words instead of the device's.
            let named = |text: &str| text.to_ascii_lowercase().contains("foilpress");
            let numbered = (device.vid, device.pid) == protocol::USB;
            let bridge = named(&product)
                || device.manufacturer.as_deref().is_some_and(named)
                || (numbered && cfg!(windows));
            Some(Port {
                address: Address::Serial(port.port_name),
                product,
                serial_number: device.serial_number,
                bridge,
            })
        })
        .collect();
    // Each is listed twice on macOS; the one that calls out is the one to open.
    ports.retain(|port| {
        !matches!(&port.address, Address::Serial(name) if cfg!(target_os = "macos") && name.starts_with("/dev/tty."))
    });
    ports.sort_by_key(|port| port.address.to_string());
    ports
}

/// Puts together what belongs together.
fn joined(ports: Vec<Port>, usb: Vec<Option<String>>) -> Survey {
    let mut survey = Survey::default();
    for port in ports {
        if port.bridge {
            survey
                .bridges
                .push(Candidate { serial_number: port.serial_number, addresses: vec![port.address] });
        } else {
            survey.others.push(port);
        }
    }
    let single = usb.len() == 1;
    for serial_number in usb {
        let same = |candidate: &&mut Candidate| match (&candidate.serial_number, &serial_number) {
            (Some(one), Some(other)) => one.eq_ignore_ascii_case(other),
            _ => false,
        };
        // A device without a number can be named only if it is the only one.
        let address = match &serial_number {
            Some(number) => Address::Usb(Some(number.clone())),
            None if single => Address::Usb(None),
            None => continue,
        };
        match survey.bridges.iter_mut().find(same) {
            Some(candidate) => candidate.addresses.push(address),
            None => survey.bridges.push(Candidate { serial_number, addresses: vec![address] }),
        }
    }
    survey
}

/// The serial number that the bridge at this port shares with one at another: some clones of the board have none of their own. What
/// is noted of one printer would then be taken for the other's.
fn twin(ports: &[Port], address: &Address) -> Option<String> {
    let serial =
        |port: &Port| port.serial_number.as_deref().map(str::to_ascii_uppercase).filter(|_| port.bridge);
    let own = serial(ports.iter().find(|port| port.address == *address)?)?;
    let same = ports.iter().filter(|port| serial(port).as_ref() == Some(&own)).count();
    (same > 1).then_some(own)
}

/// Opens an address; if nothing is there any more, or it fits several, the bridge with this number wherever it is now: a
/// bridge that was plugged in again may have another port. One that cannot be told from another is refused.
pub fn open(address: &Address, number: Option<u64>) -> Result<Box<dyn Transport>, OpenError> {
    if matches!(address, Address::Serial(_))
        && let Some(serial) = twin(&ports(), address)
    {
        return Err(OpenError::Twins(super::printable(&serial)));
    }
    let error = match address.open() {
        Ok(link) => return Ok(link),
        Err(error) => error,
    };
    let local = matches!(address, Address::Serial(_) | Address::Usb(_));
    let elsewhere = matches!(error, OpenError::Absent(_) | OpenError::Several(_));
    if local
        && elsewhere
        && let Some(number) = number
    {
        let bridges = survey().bridges;
        let mut fitting = bridges.iter().filter(|bridge| bridge.number() == Some(number));
        match (fitting.next(), fitting.next()) {
            (Some(bridge), None) => return bridge.open().map(|(_, link)| link),
            (Some(_), Some(_)) => return Err(OpenError::Twins(format!("{number:016X}"))),
            (None, _) => {}
        }
    }
    Err(error)
}

/// Why there is not one bridge to take.
#[derive(Debug, thiserror::Error)]
pub enum ChoiceError {
    /// None.
    #[error("no bridge found")]
    None,
    /// Several.
    #[error("several bridges: {}", .0.join(", "))]
    Several(Vec<String>),
}

/// The only bridge there is.
pub fn only() -> Result<Candidate, ChoiceError> {
    let mut bridges = survey().bridges;
    match bridges.len() {
        0 | 1 => bridges.pop().ok_or(ChoiceError::None),
        _ => Err(ChoiceError::Several(bridges.iter().map(|b| b.addresses[0].to_string()).collect())),
    }
}

impl Candidate {
    /// Its serial number as the link tells it.
    pub fn number(&self) -> Option<u64> {
        u64::from_str_radix(self.serial_number.as_deref()?, 16).ok()
    }

    /// Opens the first of its ways that can be opened; otherwise says what is wrong with the first.
    pub fn open(&self) -> Result<(&Address, Box<dyn Transport>), OpenError> {
        let mut wrong = None;
        for address in &self.addresses {
            match address.open() {
                Ok(link) => return Ok((address, link)),
                Err(error) => wrong = wrong.or(Some(error)),
            }
        }
        Err(wrong.unwrap_or_else(|| OpenError::Absent(Address::Usb(self.serial_number.clone()))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(name: &str, serial: Option<&str>, bridge: bool) -> Port {
        Port {
            address: Address::Serial(name.into()),
            product: "thing".into(),
            serial_number: serial.map(str::to_owned),
            bridge,
        }
    }

    fn addresses(survey: &Survey) -> Vec<Vec<String>> {
        survey.bridges.iter().map(|b| b.addresses.iter().map(Address::to_string).collect()).collect()
    }

    #[test]
    fn a_bridge_with_a_serial_port_and_bulk_endpoints_is_one_bridge() {
        let survey = joined(
            vec![
                port("a", Some("E661"), true),
                port("b", Some("E662"), true),
                port("c", Some("E661"), false),
            ],
            vec![Some("e662".into()), Some("E663".into())],
        );
        assert_eq!(addresses(&survey), [vec!["serial:a"], vec!["serial:b", "usb:e662"], vec!["usb:E663"]]);
        assert_eq!(survey.others, [port("c", Some("E661"), false)]);
    }

    #[test]
    fn two_bridges_with_one_serial_number_are_refused_and_others_are_not() {
        let ports = [
            port("a", Some("E661"), true),
            port("b", Some("e661"), true),
            port("c", Some("E662"), true),
            port("d", Some("E662"), false),
            port("e", None, true),
            port("f", None, true),
        ];
        let twins =
            ["a", "b", "c", "d", "e", "f", "g"].map(|name| twin(&ports, &Address::Serial(name.into())));
        assert_eq!(twins.map(|serial| serial.is_some()), [true, true, false, false, false, false, false]);
    }

    #[test]
    fn bridges_without_numbers_are_never_taken_for_one_another() {
        let survey = joined(vec![port("a", None, true)], vec![None]);
        assert_eq!(addresses(&survey), [vec!["serial:a"], vec!["usb:"]]);
        let survey = joined(vec![], vec![None, None]);
        assert!(survey.bridges.is_empty());
    }
}
