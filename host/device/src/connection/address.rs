//! Where a job goes: `file:`, `raw:`, `usb:`, `serial:`, `tcp:`, `unix:`.

use std::fmt;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use super::transport::{Serial, Socket, Transport};
use super::usb::{self, Usb};

/// A destination of a job.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Destination {
    /// A file that holds the job.
    File(PathBuf),
    /// A device that takes the printer's bytes as they are, such as `/dev/usb/lp0`.
    Raw(PathBuf),
    /// A bridge.
    Bridge(Address),
}

/// Where a bridge is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Address {
    /// The bulk endpoints of the bridge with this serial number, or of the only bridge there is.
    Usb(Option<String>),
    /// A serial port: `/dev/ttyACM0`, `COM5`.
    Serial(String),
    /// HOST:PORT of a serial port shared over the network, or of an emulator.
    Tcp(String),
    /// A local socket.
    Unix(PathBuf),
}

/// A text that is no destination.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "`{0}` is not a destination; write usb:, serial:/dev/ttyACM0 or tcp:HOST:PORT for a bridge (`foilpress bridge list` finds \
     it), raw:/dev/usb/lp0 for a printer at a cable of its own, or file:job.rgl"
)]
pub struct NoDestination(String);

/// A text that is no address of a bridge.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "`{0}` is not the address of a bridge; write usb:, serial:/dev/ttyACM0 or tcp:HOST:PORT (`foilpress bridge list` finds it)"
)]
pub struct NoAddress(String);

impl FromStr for Destination {
    type Err = NoDestination;

    fn from_str(text: &str) -> Result<Destination, NoDestination> {
        match text.split_once(':') {
            // The kernel's printer device needs no prefix: it can be nothing else.
            _ if text.starts_with("/dev/usb/lp") => Ok(Destination::Raw(text.into())),
            Some(("usb", "")) => Ok(Destination::Bridge(Address::Usb(None))),
            Some((_, "")) | None => Err(NoDestination(text.into())),
            Some(("file", path)) => Ok(Destination::File(path.into())),
            Some(("raw", path)) => Ok(Destination::Raw(path.into())),
            Some(("usb", serial)) => Ok(Destination::Bridge(Address::Usb(Some(serial.into())))),
            Some(("serial", path)) => Ok(Destination::Bridge(Address::Serial(path.into()))),
            Some(("unix", path)) => Ok(Destination::Bridge(Address::Unix(path.into()))),
            Some(("tcp", place)) if place.contains(':') => {
                Ok(Destination::Bridge(Address::Tcp(place.into())))
            }
            Some(_) => Err(NoDestination(text.into())),
        }
    }
}

impl FromStr for Address {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Address, NoAddress> {
        match text.parse() {
            Ok(Destination::Bridge(address)) => Ok(address),
            _ => Err(NoAddress(text.into())),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Usb(serial) => write!(f, "usb:{}", serial.as_deref().unwrap_or("")),
            Address::Serial(path) => write!(f, "serial:{path}"),
            Address::Tcp(place) => write!(f, "tcp:{place}"),
            Address::Unix(path) => write!(f, "unix:{}", path.display()),
        }
    }
}

/// Why a bridge's port cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Nothing is there.
    #[error("{0}: nothing is there; is the bridge plugged in? `foilpress bridge list` shows those that are")]
    Absent(Address),
    /// Several bridges, by their serial numbers.
    #[error("several bridges are on USB; choose one by its serial number: {}", by_number(.0))]
    Several(Vec<Option<String>>),
    /// Two bridges with this serial number.
    #[error(
        "two bridges have the serial number {0}, so nothing tells their printers apart; unplug one of them"
    )]
    Twins(String),
    /// Not allowed.
    #[error("{0}: permission denied; `foilpress doctor` shows what to set up")]
    Forbidden(Address),
    /// Another program has it.
    #[error("{0}: another program uses it, perhaps another foilpress that is sending")]
    InUse(Address),
    /// Something else.
    #[error("{address}: cannot be opened")]
    Other {
        /// Where.
        address: Address,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}

fn by_number(bridges: &[Option<String>]) -> String {
    let name = |bridge: &Option<String>| match bridge {
        Some(serial) => format!("usb:{serial}"),
        None => "one that does not tell its number".into(),
    };
    bridges.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// The one bridge meant. Which one is meant is settled before anything is opened.
fn choose(address: &Address, serial: Option<&str>) -> Result<usb::Attached, OpenError> {
    let mut found = usb::bridges().map_err(|source| OpenError::Other { address: address.clone(), source })?;
    if let Some(serial) = serial {
        found.retain(|bridge| bridge.is(serial));
    }
    match (found.len(), serial) {
        (0 | 1, _) => found.pop().ok_or_else(|| OpenError::Absent(address.clone())),
        (_, Some(serial)) => Err(OpenError::Twins(super::printable(serial))),
        (_, None) => Err(OpenError::Several(found.into_iter().map(|bridge| bridge.serial_number).collect())),
    }
}

impl Address {
    /// Opens the pipe.
    pub fn open(&self) -> Result<Box<dyn Transport>, OpenError> {
        const CONNECT: Duration = Duration::from_secs(5);
        let result: io::Result<Box<dyn Transport>> = match self {
            Address::Usb(serial) => {
                Usb::open(&choose(self, serial.as_deref())?).map(|pipe| Box::new(pipe) as _)
            }
            Address::Serial(path) => {
                Serial::open(path).map(|port| Box::new(port) as _).map_err(|error| match error.kind {
                    // A port that is there but not to be had is somebody else's.
                    serialport::ErrorKind::NoDevice if Path::new(path).exists() => {
                        io::ErrorKind::ResourceBusy.into()
                    }
                    _ => error.into(),
                })
            }
            Address::Tcp(place) => place
                .to_socket_addrs()
                .and_then(|mut all| all.next().ok_or_else(|| io::ErrorKind::NotFound.into()))
                .and_then(|place| TcpStream::connect_timeout(&place, CONNECT))
                .and_then(|socket| {
                    // Small messages are not to wait for each other.
                    socket.set_nodelay(true)?;
                    Ok(Box::new(Socket::new(socket)) as _)
                }),
            #[cfg(unix)]
            Address::Unix(path) => {
                std::os::unix::net::UnixStream::connect(path).map(|socket| Box::new(Socket::new(socket)) as _)
            }
            #[cfg(not(unix))]
            Address::Unix(_) => Err(io::ErrorKind::Unsupported.into()),
        };
        result.map_err(|source| match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => OpenError::Absent(self.clone()),
            io::ErrorKind::PermissionDenied => OpenError::Forbidden(self.clone()),
            io::ErrorKind::ResourceBusy | io::ErrorKind::WouldBlock => OpenError::InUse(self.clone()),
            _ => OpenError::Other { address: self.clone(), source },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn destinations_are_read_and_shown_the_same() {
        for text in [
            "usb:",
            "usb:E6614103E7453D2A",
            "serial:/dev/ttyACM0",
            "serial:COM5",
            "tcp:localhost:4000",
            "unix:/run/bridge",
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        assert_eq!("file:job.rgl".parse(), Ok(Destination::File("job.rgl".into())));
        assert_eq!("raw:/dev/usb/lp1".parse(), Ok(Destination::Raw("/dev/usb/lp1".into())));
        assert_eq!("/dev/usb/lp0".parse(), Ok(Destination::Raw("/dev/usb/lp0".into())));
    }

    #[test]
    fn what_is_no_destination_is_answered_with_examples() {
        for text in ["", "job.rgl", "file:", "tcp:localhost", "usb", "parallel:/dev/parport0", "/dev/ttyACM0"]
        {
            let error = text.parse::<Destination>().unwrap_err();
            assert!(error.to_string().contains("serial:/dev/ttyACM0"), "{text}");
        }
        assert!("file:job.rgl".parse::<Address>().is_err(), "a file is no bridge");
    }

    #[test]
    fn a_port_that_is_not_there_is_said_to_be_absent() {
        let absent = |text: &str| text.parse::<Address>().unwrap().open().map(|_| ());
        assert!(matches!(absent("serial:/dev/no-such-port"), Err(OpenError::Absent(_))));
        // Where there is no USB at all that is said instead.
        let usb = absent("usb:no-such-number").unwrap_err();
        let said = matches!(&usb, OpenError::Absent(_))
            || matches!(&usb, OpenError::Other { source, .. } if source.to_string().contains("no USB bus"));
        assert!(said, "{usb:?}");
        #[cfg(unix)]
        assert!(matches!(absent("unix:/no/such/socket"), Err(OpenError::Absent(_))));
    }
}
