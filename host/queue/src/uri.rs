//! Device URIs: the destination of a queue, as the print system writes it.
//!
//! `foilpress:/KIND/REST` is the destination `KIND:REST` of every other command: `foilpress:/serial/dev/ttyACM0`,
//! `foilpress:/tcp/host:4000`, `foilpress:/raw/dev/usb/lp0`. A file is not a destination of a queue: everybody who
//! may print could write it with the rights of the print system.

use percent_encoding::{AsciiSet, CONTROLS, percent_decode_str, utf8_percent_encode};

use device::connection::{Destination, NoDestination};

/// The scheme, and the name of the backend.
pub const SCHEME: &str = "foilpress";

/// Characters that would end a URI or not survive a command line.
const UNSAFE: &AsciiSet =
    &CONTROLS.add(b' ').add(b'"').add(b'#').add(b'%').add(b'<').add(b'>').add(b'?').add(b'\\').add(b'`');

/// A text that is not a device URI of this program.
#[derive(Debug, thiserror::Error)]
pub enum UriError {
    /// Another scheme, or the kind or place is missing.
    #[error("`{0}` is not a device of this program; expected one such as foilpress:/serial/dev/ttyACM0")]
    Form(String),
    /// A file.
    #[error("a queue cannot print to a file; `foilpress print --to file:…` can")]
    File,
    /// The kind or place is not a valid destination.
    #[error(transparent)]
    Destination(#[from] NoDestination),
}

/// Kinds whose place is a path, so that its first slash ends the kind.
fn is_path(kind: &str) -> bool {
    matches!(kind, "serial" | "raw" | "unix")
}

/// The destination a URI names.
pub fn parse(uri: &str) -> Result<Destination, UriError> {
    let form = || UriError::Form(uri.into());
    let rest = uri.strip_prefix(SCHEME).and_then(|rest| rest.strip_prefix(":/")).ok_or_else(form)?;
    let rest = percent_decode_str(rest).decode_utf8().map_err(|_| form())?;
    let (kind, place) = rest.split_once('/').unwrap_or((&rest, ""));
    let place = if is_path(kind) { format!("/{place}") } else { place.into() };
    match format!("{kind}:{place}").parse()? {
        Destination::File(_) => Err(UriError::File),
        destination => Ok(destination),
    }
}

/// The URI of a destination as it is typed, such as `serial:/dev/ttyACM0`.
pub fn of(destination: &str) -> Result<String, UriError> {
    // What is no destination says so itself, in the words of every other command.
    destination.parse::<Destination>()?;
    // The one destination that needs no kind is a device of the kernel.
    let (kind, place) = destination.split_once(':').unwrap_or(("raw", destination));
    let place = if is_path(kind) { place.strip_prefix('/').unwrap_or(place) } else { place };
    let uri = format!("{SCHEME}:/{kind}/{}", utf8_percent_encode(place, UNSAFE));
    // An address is valid if its URI can be read back.
    parse(&uri)?;
    Ok(uri)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_destination_comes_back_from_its_uri() {
        for (typed, uri) in [
            ("serial:/dev/ttyACM0", "foilpress:/serial/dev/ttyACM0"),
            ("raw:/dev/usb/lp0", "foilpress:/raw/dev/usb/lp0"),
            ("/dev/usb/lp1", "foilpress:/raw/dev/usb/lp1"),
            ("tcp:localhost:4000", "foilpress:/tcp/localhost:4000"),
            ("usb:", "foilpress:/usb/"),
            ("usb:E6614103E7453D2A", "foilpress:/usb/E6614103E7453D2A"),
            ("unix:/run/my bridge#1%", "foilpress:/unix/run/my%20bridge%231%25"),
        ] {
            assert_eq!(of(typed).unwrap(), uri);
            assert_eq!(parse(uri).unwrap(), typed.parse().unwrap());
        }
    }

    #[test]
    fn files_and_other_schemes_are_no_devices() {
        assert!(matches!(of("file:/etc/passwd"), Err(UriError::File)));
        assert!(matches!(parse("foilpress:/file/etc/passwd"), Err(UriError::File)));
        for wrong in
            ["", "usb://ALPS/MD-5500", "foilpress", "foilpress:/", "foilpress:/tcp/host", "foilpress:/%ff/x"]
        {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
