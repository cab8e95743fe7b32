//! Found by itself: the printers in every dialog of the network, while the server lives.
//!
//! Problem: a service file for Avahi stays when the server has gone, and Windows and macOS have no such files. Method: the server answers
//! multicast DNS itself, with a name for each printer, and takes the names back at its end. Where Avahi runs it owns that port, and two
//! responders on one computer disturb each other; there the server leaves the announcing to `serve --install`. A responder announces
//! one subtype for each service, and clients ask for two (IPP Everywhere for `_print`, AirPrint for `_universal`), so there are two with
//! equal records. Interfaces that lead to machines inside this computer are left out: through them a printer would appear twice.
//! Cost: two threads, a packet a minute. Limits: a name that another computer has already is changed by the responder ("… (2)").
//! Source: RFC 6762 and 6763; Bonjour Printing Specification 1.2.1 and PWG 5100.14, section 4, for the keys.
//! `docs/decisions/announcing.md` says why no other library.

use std::path::Path;
use std::time::Duration;

use mdns_sd::{IfKind, IfPredicate, ServiceDaemon, ServiceInfo};

use crate::printer::{DEVICE_ID, MODEL, URF, title};
use crate::server::Preset;
use crate::spool::KINDS;

/// What clients ask for beside all printers.
const SUBTYPES: [&str; 2] = ["_print", "_universal"];
/// The protocol in the clear and encrypted: both at the same port.
const TYPES: [&str; 2] = ["_ipp", "_ipps"];
/// The wait for a farewell to be sent.
const FAREWELL: Duration = Duration::from_secs(2);

/// How the interfaces of machines and tunnels inside this computer begin: Docker, containers, virtual machines, VPNs.
const INSIDE: [&str; 14] = [
    "docker", "br-", "veth", "virbr", "vnet", "vmnet", "vboxnet", "cni", "flannel", "cali", "lxc", "tun",
    "wg", "utun",
];

/// Whether an interface leads out of this computer.
pub fn is_real(name: &str) -> bool {
    !INSIDE.iter().any(|start| name.starts_with(start)) && name != "lo" && name != "lo0"
}

/// Whether Avahi answers for this computer already.
pub fn has_avahi() -> bool {
    Path::new("/run/avahi-daemon/socket").exists()
}

/// The keys of a printer's advertisement.
pub fn keys(preset: &Preset, uuid: &str) -> Vec<(&'static str, String)> {
    let mut pdl: Vec<&str> = Vec::new();
    KINDS.iter().for_each(|kind| {
        if !pdl.contains(&kind.mime) {
            pdl.push(kind.mime);
        }
    });
    let colour = if preset.choices.colours.len() > 1 { "T" } else { "F" };
    let id = |key: &str| {
        DEVICE_ID
            .split(';')
            .find_map(|pair| pair.strip_prefix(key)?.strip_prefix(':'))
            .unwrap_or_default()
            .to_owned()
    };
    vec![
        ("txtvers", "1".into()),
        ("qtotal", "1".into()),
        ("rp", format!("ipp/print/{}", preset.name)),
        ("ty", MODEL.into()),
        ("product", "(MD-5500)".into()),
        ("usb_MFG", id("MFG")),
        ("usb_MDL", id("MDL")),
        ("note", String::new()),
        ("priority", "50".into()),
        ("pdl", pdl.join(",")),
        ("URF", URF.join(",")),
        ("Color", colour.into()),
        ("Duplex", "F".into()),
        ("PaperMax", "legal-A4".into()),
        ("kind", "document,photo".into()),
        ("UUID", uuid.into()),
        ("mopria-certified", "1.3".into()),
        ("air", "none".into()),
        ("TLS", "1.2".into()),
    ]
}

/// The printers' names on the network, until this is dropped.
pub struct Advert {
    responders: Vec<ServiceDaemon>,
    names: Vec<String>,
}

impl Advert {
    /// Announces printers with their identities at a port of a computer, which dialogs call something, through the interfaces for which `leads_out` is true.
    ///
    /// # Errors
    /// The system does not let us answer, or a name is none.
    pub fn begin(
        printers: &[(Preset, String)],
        (computer, called): (&str, &str),
        port: u16,
        leads_out: fn(&str) -> bool,
    ) -> Result<Advert, mdns_sd::Error> {
        let mut advert = Advert { responders: Vec::new(), names: Vec::new() };
        for subtype in SUBTYPES {
            let responder = ServiceDaemon::new()?;
            let inside = IfPredicate::new(move |interface| !leads_out(&interface.name));
            responder.disable_interface(IfKind::Predicate(inside))?;
            for (printer, uuid) in printers {
                for kind in TYPES {
                    let service = format!("{subtype}._sub.{kind}._tcp.local.");
                    let (name, host) = (title(&printer.name, called), format!("{computer}.local."));
                    let keys = keys(printer, uuid);
                    let info =
                        ServiceInfo::new(&service, &name, &host, "", port, &keys[..])?.enable_addr_auto();
                    advert.names.push(info.get_fullname().to_owned());
                    responder.register(info)?;
                }
            }
            advert.responders.push(responder);
        }
        advert.names.sort();
        advert.names.dedup();
        Ok(advert)
    }
}

impl Drop for Advert {
    fn drop(&mut self) {
        // All say farewell before any is waited for. Whoever is gone cannot, and clients find out by themselves.
        let farewells: Vec<_> = self
            .responders
            .iter()
            .flat_map(|responder| self.names.iter().filter_map(|name| responder.unregister(name).ok()))
            .collect();
        for farewell in farewells {
            let _ = farewell.recv_timeout(FAREWELL);
        }
        for responder in &self.responders {
            if let Ok(ended) = responder.shutdown() {
                let _ = ended.recv_timeout(FAREWELL);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_into_this_computer_are_left_out() {
        for name in ["eth0", "enp3s0", "wlan0", "en0", "br0", "Ethernet 2"] {
            assert!(is_real(name), "{name}");
        }
        for name in ["lo", "docker0", "br-4f2a", "veth12ab", "virbr0", "vmnet8", "tun0"] {
            assert!(!is_real(name), "{name}");
        }
    }
}
