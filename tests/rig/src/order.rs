//! What a program tells the rig and hears from it, a line of text each.
//!
//! | order | does |
//! |---|---|
//! | `begin WORK_NS BYTES` | a printer that is on and idle, with counters at zero; it works so long on each byte, and stays at work on byte number `BYTES` |
//! | `more BYTES` | goes on for so many bytes |
//! | `lines PERROR SELECT NFAULT` | sets these lines, 0 or 1 each |
//! | `power 0`, `power 1` | the printer's switch |
//! | `id TEXT` | its device ID; without a text it does not negotiate |
//! | `report` | answered by a [`Report`] |
//! | `wave FROM` | answered by `wave` and up to 128 words of samples from there, eight hexadecimal digits each |
//!
//! All others are answered by `ok`, and what is no order by `error` and the reason.

use crate::nibble::Status;
use core::fmt;
use heapless::String;

/// Bytes of the longest line.
pub const LINE_MAX: usize = 1100;

/// Bytes of the longest device ID.
pub const ID_MAX: usize = 255;

/// An order.
#[expect(clippy::large_enum_variant, reason = "there is one at a time")]
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Order {
    /// Begins anew.
    Begin {
        /// Time at work on each byte, in ns.
        work_ns: u32,
        /// The byte it stays at work on, the first one being 1.
        bytes: u32,
    },
    /// Goes on for so many bytes.
    More(u32),
    /// Sets PError, Select, nFault.
    Lines(Status),
    /// Switches the printer on or off.
    Power(bool),
    /// Its device ID; empty: it does not negotiate.
    Id(String<ID_MAX>),
    /// Asks for a [`Report`].
    Report,
    /// Asks for samples from this word on.
    Wave(u32),
}

/// Why a line is no order.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BadOrder(&'static str);

impl fmt::Display for BadOrder {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.0)
    }
}

impl Order {
    /// Reads a line without its end.
    ///
    /// # Errors
    /// Another word, too few or too many figures, a device ID that is too long or not ASCII.
    pub fn parse(line: &str) -> Result<Order, BadOrder> {
        let (word, rest) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
        let mut figures = rest.split_ascii_whitespace().map(str::parse::<u32>);
        let mut figure = || match figures.next() {
            Some(Ok(figure)) => Ok(figure),
            Some(Err(_)) => Err(BadOrder("not a whole number")),
            None => Err(BadOrder("a number is missing")),
        };
        let mut level = || match figure()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(BadOrder("a level is 0 or 1")),
        };
        let order = match word {
            "begin" => match [figure()?, figure()?] {
                [_, 0] => return Err(BadOrder("it takes at least one byte")),
                [work_ns, bytes] => Order::Begin { work_ns, bytes },
            },
            "more" => Order::More(figure()?),
            "lines" => Order::Lines(Status { paper_out: level()?, select: level()?, fault: level()? }),
            "power" => Order::Power(level()?),
            "id" => {
                let id =
                    String::try_from(rest.trim()).map_err(|_| BadOrder("longer than a device ID may be"))?;
                return match id.is_ascii() {
                    true => Ok(Order::Id(id)),
                    false => Err(BadOrder("a device ID is ASCII")),
                };
            }
            "report" => Order::Report,
            "wave" => Order::Wave(figure()?),
            _ => return Err(BadOrder("the orders are: begin, more, lines, power, id, report, wave")),
        };
        match figures.next() {
            None => Ok(order),
            Some(_) => Err(BadOrder("more numbers than it takes")),
        }
    }
}

impl fmt::Display for Order {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Order::Begin { work_ns, bytes } => write!(out, "begin {work_ns} {bytes}"),
            Order::More(bytes) => write!(out, "more {bytes}"),
            Order::Lines(Status { paper_out, select, fault }) => {
                write!(out, "lines {} {} {}", u8::from(*paper_out), u8::from(*select), u8::from(*fault))
            }
            Order::Power(on) => write!(out, "power {}", u8::from(*on)),
            Order::Id(id) => write!(out, "id {id}"),
            Order::Report => out.write_str("report"),
            Order::Wave(from) => write!(out, "wave {from}"),
        }
    }
}

/// What the rig has seen since it began.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// Bytes taken.
    pub taken: u32,
    /// Their [`checksum`](crate::checksum).
    pub checksum: u32,
    /// Strobes. More than bytes: some came while the rig was busy or switched off.
    pub strobes: u32,
    /// Pulses of nInit.
    pub resets: u32,
    /// Bytes taken when the last of them was noticed.
    pub reset_at: u32,
    /// Negotiations.
    pub asked: u32,
    /// Words sampled.
    pub words: u32,
}

impl fmt::Display for Report {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Report { taken, checksum, strobes, resets, reset_at, asked, words } = self;
        write!(out, "report {taken} {checksum} {strobes} {resets} {reset_at} {asked} {words}")
    }
}

impl Report {
    /// Reads the line that [`Report`] prints.
    pub fn parse(line: &str) -> Option<Report> {
        let mut figures = line.trim().strip_prefix("report ")?.split(' ').map(|figure| figure.parse().ok());
        let mut figure = || figures.next().flatten();
        let report = Report {
            taken: figure()?,
            checksum: figure()?,
            strobes: figure()?,
            resets: figure()?,
            reset_at: figure()?,
            asked: figure()?,
            words: figure()?,
        };
        figures.next().is_none().then_some(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    fn orders() -> impl Strategy<Value = Order> {
        prop_oneof![
            (any::<u32>(), 1u32..).prop_map(|(work_ns, bytes)| Order::Begin { work_ns, bytes }),
            any::<u32>().prop_map(Order::More),
            any::<[bool; 3]>().prop_map(|[paper_out, select, fault]| Order::Lines(Status {
                paper_out,
                select,
                fault
            })),
            any::<bool>().prop_map(Order::Power),
            "([!-~][ -~]{0,200}[!-~])?".prop_map(|id| Order::Id(String::try_from(&*id).unwrap())),
            Just(Order::Report),
            any::<u32>().prop_map(Order::Wave),
        ]
    }

    proptest! {
        #[test]
        fn an_order_is_read_as_it_was_written_within_the_longest_line(order in orders()) {
            let line = order.to_string();
            prop_assert!(line.len() < LINE_MAX);
            prop_assert_eq!(Order::parse(&line), Ok(order));
        }

        #[test]
        fn a_report_is_read_as_it_was_written(figures in any::<[u32; 7]>()) {
            let [taken, checksum, strobes, resets, reset_at, asked, words] = figures;
            let report = Report { taken, checksum, strobes, resets, reset_at, asked, words };
            prop_assert_eq!(Report::parse(&report.to_string()), Some(report));
        }

        #[test]
        fn any_line_is_an_order_or_refused(line in ".{0,400}") {
            let _ = Order::parse(&line);
        }
    }

    #[test]
    fn what_is_no_order_is_refused_with_a_reason() {
        for line in [
            "",
            "begin",
            "begin 5",
            "begin 5 0",
            "begin 5 -1",
            "begin 5 6 7",
            "lines 0 1",
            "lines 0 1 2",
            "power on",
            "more 4294967296",
            "stop",
        ] {
            assert!(Order::parse(line).is_err(), "{line}");
        }
        assert!(Order::parse(&std::format!("id {}", "x".repeat(256))).is_err());
        assert!(Order::parse("id Gerät").is_err());
    }
}
