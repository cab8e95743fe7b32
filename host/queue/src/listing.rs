//! The devices that the backend lists: bridges on this computer, and printers on parallel cables.
//!
//! Source: backend(7).

use std::fs;
use std::path::{Path, PathBuf};

use super::uri;
use device::connection::find;
use device::questions::query::is_alps;

/// The line that is printed when there is no device, so that the print system knows the backend.
const NO_DEVICE: &str = "network foilpress \"Unknown\" \"ALPS MD-5500 through a Foilpress bridge\"";
/// The device ID listed for the printer of a bridge: the printer is not asked.
const ID: &str = "MFG:ALPS;MDL:MD-5500;CMD:RGL;";

/// A line for every device there is; one line if there is none.
pub fn devices() -> String {
    let survey = find::survey();
    let bridges = survey.bridges.iter().filter_map(|bridge| bridge.addresses.first()).map(|address| {
        device(&address.to_string(), &format!("ALPS MD-5500 through a Foilpress bridge ({address})"), ID)
    });
    let cables = (0..8).filter_map(|number| {
        let device = PathBuf::from(format!("/dev/usb/lp{number}"));
        let id = fs::read_to_string(format!("/sys/class/usbmisc/lp{number}/device/ieee1284_id")).ok()?;
        (device.exists() && is_alps(&id)).then(|| at_cable(&device, &id))
    });
    // A device whose address has no URI is left out.
    let lines: String = bridges.chain(cables).flatten().collect();
    if lines.is_empty() { format!("{NO_DEVICE}\n") } else { lines }
}

fn at_cable(path: &Path, id: &str) -> Result<String, uri::UriError> {
    let path = path.display();
    device(&format!("raw:{path}"), &format!("ALPS MD-5500 on a parallel cable ({path})"), id.trim())
}

fn device(address: &str, about: &str, id: &str) -> Result<String, uri::UriError> {
    let plain = |text: &str| text.replace(['"', '\n'], " ");
    Ok(format!("direct {} \"ALPS MD-5500\" \"{}\" \"{}\"\n", uri::of(address)?, plain(about), plain(id)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_a_line_whatever_it_says_of_itself() {
        let line = at_cable(Path::new("/dev/usb/lp0"), "MFG:ALPS;DES:\"MD\"\n;\n").unwrap();
        assert_eq!(
            line,
            "direct foilpress:/raw/dev/usb/lp0 \"ALPS MD-5500\" \"ALPS MD-5500 on a parallel cable (/dev/usb/lp0)\" \
             \"MFG:ALPS;DES: MD  ;\"\n"
        );
    }
}
