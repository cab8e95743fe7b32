//! The printer's status answer of 38 bytes, read.
//!
//! Source: answers recorded from the hardware. The second and third byte of a cassette entry are not the remaining ribbon
//! and are not shown. Places are not slots, since the carousel turns: cassettes are known by their barcode. While the
//! printer reports an error it does not renew the entries.

use std::fmt;

use protocol::ink::Ink;
use serde::Serialize;

use crate::simulate::STATUS_LENGTH;

/// How the printer is, by its own answer.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Status {
    /// Whether it is printing.
    pub printing: bool,
    /// Whether it holds bytes that are not printed.
    pub holds_data: bool,
    /// Whether it is off line.
    pub off_line: bool,
    /// Whether its lever stands at the tray, not at the manual slot.
    pub tray: bool,
    /// What is the matter, in words.
    pub errors: Vec<String>,
    /// The cassettes it has found.
    pub cassettes: Vec<Cassette>,
    /// Whether the cassettes are those of before the error.
    pub stale: bool,
}

/// A cassette as the printer sees it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Cassette {
    /// Its barcode.
    pub barcode: u8,
    /// Its ink, if the barcode is known.
    pub ink: Option<&'static str>,
    /// Whether it is on the carriage.
    pub on_carriage: bool,
    /// Its condition: `loaded`, `backwards` or `end of ribbon`.
    pub condition: &'static str,
}

/// Bytes that are no status answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the printer answered {0} bytes that are not its status answer; switch it off and on if that stays so")]
pub struct NoStatus(usize);

impl Status {
    /// Reads an answer.
    pub fn read(bytes: &[u8]) -> Result<Status, NoStatus> {
        let wrong = NoStatus(bytes.len());
        let answer: &[u8; STATUS_LENGTH] = bytes.try_into().map_err(|_| wrong)?;
        if answer[..4] != [0x02, 0x80, (STATUS_LENGTH - 5) as u8, 0] || answer[STATUS_LENGTH - 1] != 0x03 {
            return Err(wrong);
        }
        let status = answer[4];
        let error: [u8; 5] = std::array::from_fn(|i| answer[32 + i]);
        let cassettes = answer[5..32]
            .chunks_exact(3)
            .enumerate()
            .filter(|(_, entry)| entry[0] >> 6 != 3)
            .map(|(place, entry)| {
                let barcode = entry[0] & 0x3f;
                Cassette {
                    barcode,
                    ink: Ink::from_barcode(barcode).map(Ink::name),
                    on_carriage: place == 8,
                    condition: match entry[0] >> 6 {
                        0 => "loaded",
                        1 => "backwards",
                        _ => "end of ribbon",
                    },
                }
            })
            .collect();
        Ok(Status {
            printing: status & 0x08 != 0,
            holds_data: status & 0x01 != 0,
            off_line: status & 0x80 != 0,
            tray: status & 0x10 != 0,
            stale: status & 0xc0 == 0xc0,
            errors: errors(error),
            cassettes,
        })
    }
}

/// The error bytes in words.
fn errors([e0, e1, e2, e3, e4]: [u8; 5]) -> Vec<String> {
    let mut words = Vec::new();
    let mut say = |is: bool, what: String| {
        if is {
            words.push(what);
        }
    };
    let units = [
        (0x80, "cassette changer"),
        (0x40, "carriage"),
        (0x20, "bail arm"),
        (0x10, "line feed"),
        (0x08, "feeder"),
        (0x04, "anti-curl"),
    ];
    let unit = units.iter().find(|(bit, _)| e4 & bit != 0).map_or("motor", |(_, name)| name);
    say(
        e0 & 0x80 != 0,
        format!("it reports a fault of the {unit} motor; that names what stopped, not why"),
    );
    say(e0 & 0x40 != 0, "the cover is open; close it".into());
    say(e0 & 0x01 != 0, "it reports a fault of its memory (EEPROM)".into());
    let source = if e2 & 0x40 != 0 { "manual slot" } else { "tray" };
    say(e1 & 0x80 != 0 && e2 & 0x80 != 0, format!("wrong paper size in the {source}; load the paper the job declares"));
    say(e1 & 0x80 != 0 && e2 & 0x80 == 0, format!("no paper in the {source}; load a sheet"));
    say(
        e1 & 0x40 != 0,
        format!(
            "paper jam {}; take the sheet out",
            match (e2 & 0x08 != 0, e2 & 0x04 != 0) {
                (true, _) => "at the exit",
                (false, true) => "at the manual slot",
                (false, false) => "at the tray",
            }
        ),
    );
    say(e1 & 0x20 != 0, "a ribbon is at its end; put in a fresh cassette".into());
    say(e1 & 0x02 != 0, "a ribbon is torn; take the cassette out and look".into());
    let cassette = (e3 & 7) >> 1;
    let barcode = e3 >> 3;
    say(
        e1 & 0x10 != 0 && cassette == 3,
        match Ink::from_barcode(barcode) {
            Some(ink) => {
                format!("it wants the {} cassette ({}, barcode {barcode}); put it in", ink.name(), ink.part())
            }
            None => format!("it wants a cassette with barcode {barcode}"),
        },
    );
    say(e1 & 0x10 != 0 && cassette == 2, "a cassette holder is occupied; take a cassette out".into());
    say(e1 & 0x10 != 0 && cassette < 2, "it reports a fault of a cassette".into());
    words
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let doing = match (self.printing, self.holds_data, self.off_line) {
            (true, ..) => "printing",
            (false, true, _) => "just finished, or about to begin",
            (false, false, true) => "off line",
            (false, false, false) => "idle",
        };
        writeln!(f, "printer: {doing}, feeds from the {}", if self.tray { "tray" } else { "manual slot" })?;
        for error in &self.errors {
            writeln!(f, "    {error}")?;
        }
        if self.stale {
            writeln!(f, "cassettes as they were before the error:")?;
        } else {
            writeln!(f, "cassettes:{}", if self.cassettes.is_empty() { " none" } else { "" })?;
        }
        for cassette in &self.cassettes {
            writeln!(
                f,
                "    {:<18} barcode {:>2}, {}{}",
                cassette.ink.unwrap_or("unknown ink"),
                cassette.barcode,
                cassette.condition,
                if cassette.on_carriage { ", on the carriage" } else { "" }
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Carousel, Lever, Printer, Trouble};

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> = hex.bytes().filter(u8::is_ascii_hexdigit).collect();
        digits
            .chunks(2)
            .map(|two| u8::from_str_radix(std::str::from_utf8(two).unwrap(), 16).unwrap())
            .collect()
    }

    #[test]
    fn answers_recorded_from_the_machine_are_understood() {
        let idle = Status::read(&bytes(
            "02802100 00 ff0000 030000 010000 000000 ff0000 020000 ff0000 ff0000 ff0000 0000000000 03",
        ))
        .unwrap();
        assert!(!idle.printing && !idle.off_line && !idle.tray && idle.errors.is_empty());
        let names: Vec<_> = idle.cassettes.iter().map(|c| c.ink.unwrap()).collect();
        assert_eq!(names, ["cyan", "yellow", "black", "magenta"]);

        let mismatch = Status::read(&bytes(
            "02802100 c9 ff0000 033100 018d02 008d02 ff0000 023f00 ff0000 ff0000 ff0000 0010008600 03",
        ))
        .unwrap();
        assert!(mismatch.printing && mismatch.off_line && mismatch.stale);
        assert_eq!(mismatch.errors.len(), 1);
        assert!(mismatch.errors[0].contains("white cassette (MDC-SCWH, barcode 16)"), "{:?}", mismatch.errors);
    }

    #[test]
    fn error_bytes_seen_on_the_machine_have_their_words() {
        let words = |e| errors(e).join(" | ");
        assert!(words([0, 0x80, 0x80, 0, 0]).contains("wrong paper size in the tray"));
        let both = words([0, 0xc0, 0x08, 0, 0]);
        assert!(both.contains("no paper in the tray") && both.contains("jam at the exit"), "{both}");
        assert!(words([0x80, 0, 0, 0, 0x80]).contains("cassette changer"));
        assert_eq!(words([0; 5]), "");
    }

    #[test]
    fn the_simulated_printers_answers_say_what_it_is_told() {
        let mut printer = Printer::new(Carousel::new(&[Ink::White.into()]).unwrap(), Lever::Auto);
        assert_eq!(Status::read(&printer.status()).unwrap().cassettes[0].ink, Some("white"));
        for (trouble, word) in [
            (Trouble::CoverOpen, "cover"),
            (Trouble::NoPaper, "no paper"),
            (Trouble::RibbonMismatch { wanted: Ink::MetallicGold.barcode() }, "gold"),
        ] {
            printer.strike(trouble);
            let status = Status::read(&printer.status()).unwrap();
            assert!(status.errors.iter().any(|error| error.contains(word)), "{trouble:?}: {:?}", status.errors);
        }
    }

    #[test]
    fn anything_else_is_no_status() {
        for wrong in [&[][..], &[0x15], &[0; 38], &[2; 39]] {
            assert_eq!(Status::read(wrong), Err(NoStatus(wrong.len())));
        }
    }
}
