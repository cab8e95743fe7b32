//! Who may do what: which names the server answers to, which pages may talk to it, and who may do each thing
//! it does.
//!
//! Problem: a page on the internet, opened on a computer of the house, can send requests to any address that
//! this computer reaches. It cannot choose the headers `Origin` and `Host`, but with a name of its own that
//! suddenly means this server (rebinding) both look alike. And what one guest prints is nobody else's to see.
//! Method: `Host` must be an address in numbers, `localhost`, or one of this computer's own names, so that a
//! foreign name is refused whatever it means; and a request that tells its origin must come from this very
//! host. Every route of the desk and every operation of IPP is a [`Deed`] with a row in one table ([`who`]),
//! which has no default. Who does it shows a [`Permit`], which only this table gives.
//! Limits: name and address are no proof on a network where somebody takes both. This keeps pages out, not
//! people on the network who may print, which is what sharing a printer means.
//! Source: RFC 6454, section 7; RFC 9110, section 7.2.

use std::net::{IpAddr, SocketAddr};

use crate::jobs::Owner;
use crate::wire::Operation;

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
    // Behind a percent sign an address may name the interface through which it is reached.
    let address = host.split('%').next().unwrap_or(host);
    address.parse::<IpAddr>().is_ok()
        || host.eq_ignore_ascii_case("localhost")
        || names.iter().any(|name| name.eq_ignore_ascii_case(host))
}

/// Whether a request is meant for this server, and no foreign page has sent it. IPP that no page has sent may
/// call this computer by any name that leads here.
///
/// # Errors
/// Why it is refused.
pub fn check(asked: &Asked<'_>, names: &[String], is_ipp: bool) -> Result<(), &'static str> {
    let host = asked.host.ok_or("the request names no host")?;
    if !(is_own(host, names) || is_ipp && asked.origin.is_none()) {
        return Err(
            "the request is for a host of another name; `foilpress serve --name` adds names of this computer",
        );
    }
    match asked.origin {
        None => Ok(()),
        Some(origin) => match origin.split_once("://") {
            Some(("http" | "https", from)) if from.eq_ignore_ascii_case(host) => Ok(()),
            _ => Err("the request comes from another page"),
        },
    }
}

/// A file of the page.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asset {
    /// The page itself.
    Page,
    /// Its style.
    Style,
    /// Its icon.
    Icon,
    /// The script that the others belong to.
    Desk,
    /// Requests.
    Ask,
    /// The sheet.
    Sheet,
    /// What a job asks for.
    Ticket,
    /// What is going on.
    Lists,
}

/// What a browser asks of the desk.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Route {
    /// A file of the page.
    File(Asset),
    /// How things are.
    State,
    /// A document becomes a job that is held.
    Upload,
    /// A chart becomes one.
    Chart,
    /// What a job would print.
    Plan,
    /// A picture of that.
    Preview,
    /// A small picture of what it prints or has printed.
    Picture,
    /// It is to be printed in another way.
    Change,
    /// What was printed is printed again.
    Again,
    /// A job that was held is printed.
    Release,
    /// A job waits until it is released.
    Hold,
    /// A job ends.
    Cancel,
    /// A job for another sheet is laid on the loaded one.
    Lay,
    /// Somebody says which sheet is loaded.
    Load,
    /// Somebody has switched the printer off and on.
    Switched,
}

/// Everything that can be asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Deed {
    /// At the desk.
    Desk(Route),
    /// By IPP.
    Ipp(Operation),
}

impl From<Route> for Deed {
    fn from(route: Route) -> Deed {
        Deed::Desk(route)
    }
}

impl From<Operation> for Deed {
    fn from(operation: Operation) -> Deed {
        Deed::Ipp(operation)
    }
}

/// Who may do something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Who {
    /// Everybody who reaches the server.
    Anybody,
    /// Whose job it is, and the keeper.
    Owner,
    /// Whoever is at this computer or knows the code.
    Keeper,
}

/// The table of rights.
#[must_use]
pub fn who(deed: Deed) -> Who {
    match deed {
        Deed::Desk(Route::File(_) | Route::State | Route::Upload | Route::Chart)
        | Deed::Ipp(
            Operation::PrintJob
            | Operation::ValidateJob
            | Operation::CreateJob
            | Operation::GetJobAttributes
            | Operation::GetJobs
            | Operation::GetPrinterAttributes
            | Operation::CancelMyJobs
            | Operation::IdentifyPrinter,
        ) => Who::Anybody,
        Deed::Desk(
            Route::Plan
            | Route::Preview
            | Route::Picture
            | Route::Change
            | Route::Again
            | Route::Release
            | Route::Hold
            | Route::Cancel
            | Route::Lay,
        )
        | Deed::Ipp(
            Operation::SendDocument
            | Operation::CancelJob
            | Operation::HoldJob
            | Operation::ReleaseJob
            | Operation::CloseJob,
        ) => Who::Owner,
        Deed::Desk(Route::Load | Route::Switched) | Deed::Ipp(Operation::CancelJobs) => Who::Keeper,
    }
}

/// Who asks.
#[derive(Clone, Debug)]
pub struct Asker {
    /// Where they are.
    pub from: IpAddr,
    /// Whether they are at this computer or know the code.
    pub is_keeper: bool,
    /// What they say of themselves.
    pub says: Says,
}

/// What somebody says of themselves.
#[derive(Clone, Debug)]
pub enum Says {
    /// By IPP, a name.
    Name(String),
    /// At the desk, the keys that their browser got with what it uploaded.
    Keys(Vec<String>),
}

impl Asker {
    /// Whether a job is theirs: by IPP the same name from the same address, at the desk the same address or
    /// the job's key.
    #[must_use]
    pub fn owns(&self, owner: &Owner) -> bool {
        let is_there = owner.from == Some(self.from);
        match &self.says {
            Says::Name(user) => is_there && owner.user == *user,
            Says::Keys(keys) => {
                let key = owner.key.as_deref();
                is_there || key.is_some_and(|key| keys.iter().any(|said| is_same(said, key)))
            }
        }
    }
}

/// That somebody may do something, perhaps to a job.
#[derive(Clone, Copy, Debug)]
pub struct Permit<T> {
    asked: T,
    job: u32,
}

impl<T: Copy> Permit<T> {
    /// What may be done.
    pub fn asked(&self) -> T {
        self.asked
    }

    /// The job it is about; 0, which is none, if it is about none.
    pub fn job(&self) -> u32 {
        self.job
    }
}

/// Why something is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Refused {
    /// It is about a job, and there is no such job.
    #[error("there is no such job")]
    NoJob,
    /// The job is somebody else's.
    #[error(
        "the job is somebody else's: its owner may do this, or whoever types the code that `foilpress serve` shows"
    )]
    Foreign,
    /// Only the keeper may.
    #[error("type the code that `foilpress serve` shows in its terminal")]
    Code,
}

/// Lets somebody do something, perhaps to a job, of which number and owner are known.
///
/// # Errors
/// The table says no.
pub fn permit<T: Into<Deed> + Copy>(
    asked: T,
    asker: &Asker,
    job: Option<(u32, &Owner)>,
) -> Result<Permit<T>, Refused> {
    let granted = Permit { asked, job: job.map_or(0, |(id, _)| id) };
    match (who(asked.into()), job) {
        (Who::Anybody, _) => Ok(granted),
        (Who::Owner, None) => Err(Refused::NoJob),
        (Who::Owner, Some((_, owner))) if asker.is_keeper || asker.owns(owner) => Ok(granted),
        (Who::Owner, Some(_)) => Err(Refused::Foreign),
        (Who::Keeper, _) if asker.is_keeper => Ok(granted),
        (Who::Keeper, _) => Err(Refused::Code),
    }
}

/// Whether somebody is at this computer, or knows the code.
#[must_use]
pub fn is_keeper(asked: &Asked<'_>, code: &str) -> bool {
    asked.peer.ip().to_canonical().is_loopback() || asked.code.is_some_and(|said| is_same(said, code))
}

/// Compares all bytes, so that the time tells nothing.
fn is_same(said: &str, known: &str) -> bool {
    let (said, known) = (said.as_bytes(), known.as_bytes());
    said.len() == known.len() && said.iter().zip(known).fold(0, |all, (a, b)| all | (a ^ b)) == 0
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
            check(&asked(host, origin), &names, false).is_ok()
        }
        for host in [
            "localhost",
            "localhost:8631",
            "127.0.0.1:8631",
            "[::1]:8631",
            "[fe80::1]",
            "[fe80::1%25eth0]:8631",
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
        // A program that prints has no page; a page that pretends to be one has its origin.
        let foreign = |origin| check(&asked(Some("printer.lan"), origin), &[], true).is_ok();
        assert!(foreign(None) && !foreign(Some("http://printer.lan")) && !foreign(Some("null")));
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
            is_keeper(&Asked { peer: peer.parse().unwrap(), host: None, origin: None, code }, "482913")
        };
        assert!(from("127.0.0.1:1", None) && from("[::1]:1", None) && from("[::ffff:127.0.0.1]:1", None));
        assert!(from("192.168.1.7:1", Some("482913")));
        for wrong in [None, Some(""), Some("48291"), Some("4829130"), Some("482914")] {
            assert!(!from("192.168.1.7:1", wrong), "{wrong:?}");
        }
    }

    const ROUTES: [Route; 15] = [
        Route::File(Asset::Page),
        Route::State,
        Route::Upload,
        Route::Chart,
        Route::Plan,
        Route::Preview,
        Route::Picture,
        Route::Change,
        Route::Again,
        Route::Release,
        Route::Hold,
        Route::Cancel,
        Route::Lay,
        Route::Load,
        Route::Switched,
    ];

    /// Deeds by the letters that whoever wrote the rule gave them: all may, owner and keeper, keeper alone.
    fn letter(deed: Deed) -> char {
        let name = format!("{deed:?}");
        let name = name.trim_start_matches("Desk(").trim_start_matches("Ipp(").trim_end_matches(')');
        match name {
            "Plan" | "Preview" | "Picture" | "Change" | "Again" => 'o',
            "Release" | "Hold" | "Cancel" | "Lay" => 'o',
            "SendDocument" | "CancelJob" | "HoldJob" | "ReleaseJob" | "CloseJob" => 'o',
            "Load" | "Switched" | "CancelJobs" => 'k',
            _ => 'a',
        }
    }

    /// Each cell of the table: every deed by a stranger, by the owner from elsewhere and from there, and by
    /// the keeper.
    #[test]
    fn everybody_may_do_what_the_table_says_and_no_more() {
        let at = |last: u8| IpAddr::from([192, 168, 1, last]);
        let owner = Owner { user: "ada".into(), from: Some(at(7)), key: Some("k7".into()) };
        let asker = |last, is_keeper, says| Asker { from: at(last), is_keeper, says };
        let name = |name: &str| Says::Name(name.into());
        let keys = |keys: &[&str]| Says::Keys(keys.iter().map(ToString::to_string).collect());
        let desk = ROUTES.map(Deed::Desk);
        let ipp = Operation::ALL.map(Deed::Ipp);
        for deed in desk.into_iter().chain(ipp) {
            let is_desk = matches!(deed, Deed::Desk(_));
            let askers = match is_desk {
                true => vec![
                    ("stranger", asker(8, false, keys(&[]))),
                    ("stranger", asker(8, false, keys(&["k8", ""]))),
                    ("owner", asker(7, false, keys(&[]))),
                    ("owner", asker(9, false, keys(&["k8", "k7"]))),
                    ("keeper", asker(8, true, keys(&[]))),
                ],
                false => vec![
                    ("stranger", asker(8, false, name("ada"))),
                    ("stranger", asker(7, false, name("eve"))),
                    ("owner", asker(7, false, name("ada"))),
                    ("keeper", asker(8, true, name("eve"))),
                ],
            };
            for (who, asker) in askers {
                let found = match deed {
                    Deed::Desk(route) => permit(route, &asker, Some((3, &owner))).map(|permit| permit.job()),
                    Deed::Ipp(operation) => {
                        permit(operation, &asker, Some((3, &owner))).map(|permit| permit.job())
                    }
                };
                let expected = match (letter(deed), who) {
                    ('a', _) | ('o', "owner") | (_, "keeper") => Ok(3),
                    ('o', _) => Err(Refused::Foreign),
                    _ => Err(Refused::Code),
                };
                assert_eq!(found, expected, "{deed:?} by {who}: {asker:?}");
            }
        }
        let nobody = asker(8, true, keys(&[]));
        assert_eq!(permit(Route::Cancel, &nobody, None).map(|_| ()), Err(Refused::NoJob));
        assert!(permit(Route::Upload, &asker(8, false, keys(&[])), None).is_ok());
    }
}
