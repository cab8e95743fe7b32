//! Who may do what: which names the server answers to, which pages may talk to it, and who may change things.
//!
//! Problem: a page on the internet, opened on a computer of the house, can send requests to any address that this computer reaches. It
//! cannot choose the headers `Origin` and `Host`, but with a name of its own that suddenly means this server (rebinding) both look
//! alike. Method: `Host` must be an address in numbers, `localhost`, or one of this computer's own names, so that a foreign name is
//! refused whatever it means; and a request that tells its origin must come from this very host. Printing is what a printer is for, and
//! everybody who reaches it may; changing the loaded sheet or another's job from another computer needs the code shown in the
//! terminal.
//! Limits: this keeps pages out, not people on the network who may print, which is what sharing a printer means.
//! Source: RFC 6454, section 7; RFC 9110, section 7.2.

use std::net::{IpAddr, SocketAddr};

/// What a request says of where it comes from and where it thinks it goes.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The other side.
    pub peer: SocketAddr,
    /// `Host`.
    pub host: Option<&'a str>,
    /// `Origin`.
    pub origin: Option<&'a str>,
    /// The code it knows.
    pub code: Option<&'a str>,
}

/// A host without its port.
fn bare(host: &str) -> &str {
    match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(rest),
        None => host
            .rsplit_once(':')
            .filter(|(_, port)| port.bytes().all(|b| b.is_ascii_digit()))
            .map_or(host, |(host, _)| host),
    }
}

/// Whether `host` is one of the names of this computer.
pub fn is_own(host: &str, names: &[String]) -> bool {
    let host = bare(host).trim_end_matches('.');
    host.parse::<IpAddr>().is_ok()
        || host.eq_ignore_ascii_case("localhost")
        || names.iter().any(|name| name.eq_ignore_ascii_case(host))
}

/// Whether a request is meant for this server, and no foreign page has sent it.
///
/// # Errors
/// Why it is refused.
pub fn check(asked: &Asked<'_>, names: &[String]) -> Result<(), &'static str> {
    let host = asked.host.ok_or("the request names no host")?;
    if !is_own(host, names) {
        return Err("the request is for a host of another name");
    }
    match asked.origin {
        None => Ok(()),
        Some(origin) => match origin.split_once("://") {
            Some(("http" | "https", from)) if from.eq_ignore_ascii_case(host) => Ok(()),
            _ => Err("the request comes from another page"),
        },
    }
}

/// Whether somebody may change what is not theirs: whoever is at this computer, or knows the code.
pub fn may_change(asked: &Asked<'_>, code: &str) -> bool {
    let known = asked.code.is_some_and(|said| {
        let (said, code) = (said.as_bytes(), code.as_bytes());
        // All bytes are compared, so that the time tells nothing.
        said.len() == code.len() && said.iter().zip(code).fold(0, |all, (a, b)| all | (a ^ b)) == 0
    });
    asked.peer.ip().to_canonical().is_loopback() || known
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked<'a>(host: Option<&'a str>, origin: Option<&'a str>) -> Asked<'a> {
        Asked { peer: "192.168.1.7:5000".parse().unwrap(), host, origin, code: None }
    }

    #[test]
    fn only_own_names_and_own_pages_are_answered() {
        fn allowed(host: Option<&str>, origin: Option<&str>) -> bool {
            let names = ["workshop".to_owned(), "workshop.local".to_owned()];
            check(&asked(host, origin), &names).is_ok()
        }
        for host in [
            "localhost",
            "localhost:8631",
            "127.0.0.1:8631",
            "[::1]:8631",
            "[fe80::1]",
            "192.168.1.5",
            "Workshop.local:8631",
            "workshop.local.",
        ] {
            assert!(allowed(Some(host), None), "{host}");
            assert!(allowed(Some(host), Some(&format!("http://{host}"))), "{host}");
        }
        for host in
            ["evil.example", "evil.example:8631", "localhost.evil.example", "workshop.local.evil.example", ""]
        {
            assert!(!allowed(Some(host), None), "{host}");
            // Rebinding: host and origin agree, and are foreign.
            assert!(!allowed(Some(host), Some(&format!("http://{host}"))), "{host}");
        }
        assert!(!allowed(None, None));
        for origin in [
            "null",
            "http://evil.example",
            "http://localhost:3000",
            "file://",
            "http://localhost:8631.evil.example",
        ] {
            assert!(!allowed(Some("localhost:8631"), Some(origin)), "{origin}");
        }
    }

    #[test]
    fn whoever_is_elsewhere_needs_the_code() {
        let from = |peer: &str, code: Option<&'static str>| {
            may_change(&Asked { peer: peer.parse().unwrap(), host: None, origin: None, code }, "482913")
        };
        assert!(from("127.0.0.1:1", None) && from("[::1]:1", None) && from("[::ffff:127.0.0.1]:1", None));
        assert!(from("192.168.1.7:1", Some("482913")));
        for wrong in [None, Some(""), Some("48291"), Some("4829130"), Some("482914")] {
            assert!(!from("192.168.1.7:1", wrong), "{wrong:?}");
        }
    }
}
