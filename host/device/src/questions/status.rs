//! The printer's own answer to how it is, in words and as figures for programs.

use std::fmt;

use protocol::ink::Ink;
use protocol::status::{self, CartridgePlace, Complaint};
use serde::Serialize;

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
    /// The cartridges it has found.
    pub cartridges: Vec<CartridgeStatus>,
    /// Whether the cartridges are those of before the error.
    pub stale: bool,
}

/// A cartridge as the printer sees it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct CartridgeStatus {
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
#[error(
    "the printer answered {0} bytes that are not its status answer; switch it off and on if that stays so"
)]
pub struct NoStatus(usize);

impl Status {
    /// Reads an answer.
    pub fn read(bytes: &[u8]) -> Result<Status, NoStatus> {
        let answer = status::Status::parse(bytes).map_err(|status::NotAStatus| NoStatus(bytes.len()))?;
        let cartridges = answer
            .places()
            .into_iter()
            .enumerate()
            .filter_map(|(place, content)| {
                let (barcode, condition) = match content {
                    CartridgePlace::Empty => return None,
                    CartridgePlace::Loaded(barcode) => (barcode, "loaded"),
                    CartridgePlace::Backwards(barcode) => (barcode, "backwards"),
                    CartridgePlace::AtEnd(barcode) => (barcode, "end of ribbon"),
                };
                let ink = Ink::from_barcode(barcode).map(Ink::name);
                Some(CartridgeStatus { barcode, ink, on_carriage: place == status::PLACES - 1, condition })
            })
            .collect();
        Ok(Status {
            printing: answer.printing(),
            holds_data: answer.has_data(),
            off_line: answer.off_line(),
            tray: answer.automatic_feed(),
            stale: answer.in_error(),
            errors: answer.complaints().map(words).collect(),
            cartridges,
        })
    }
}

/// A complaint in the words of somebody who stands before the printer.
fn words(complaint: Complaint) -> String {
    let source = |manual: bool| if manual { "manual slot" } else { "tray" };
    match complaint {
        Complaint::Motor { units } => {
            let parts = [
                (0x80, "cartridge changer"),
                (0x40, "carriage"),
                (0x20, "bail arm"),
                (0x10, "line feed"),
                (0x08, "feeder"),
                (0x04, "anti-curl"),
            ];
            let named: Vec<&str> =
                parts.iter().filter(|(bit, _)| units & bit != 0).map(|(_, name)| *name).collect();
            format!("a motor has stopped ({}); that names what stopped, not why", named.join(", "))
        }
        Complaint::CoverOpen => "the cover is open; close it".into(),
        Complaint::Memory => "it reports a fault of its settings memory".into(),
        Complaint::NoPaper { manual } => format!("no paper in the {}; load a sheet", source(manual)),
        Complaint::WrongSize { manual } => {
            format!("wrong paper size in the {}; load the paper the job declares", source(manual))
        }
        Complaint::Jam { at_exit: true } => "paper jam at the exit; take the sheet out".into(),
        Complaint::Jam { at_exit: false } => "paper jam: the sheet was not fed; take it out".into(),
        Complaint::RibbonEnd => "a ribbon is at its end; load a new cartridge".into(),
        Complaint::RibbonBreak => "a ribbon is torn; take the cartridge out and look".into(),
        Complaint::PlaceOccupied => "a cartridge holder is occupied; take a cartridge out".into(),
        Complaint::WrongCartridge { wanted } => match Ink::from_barcode(wanted) {
            Some(ink) => {
                format!("it wants the {} cartridge ({}, barcode {wanted}); load it", ink.name(), ink.part())
            }
            None => format!("it wants a cartridge with barcode {wanted}"),
        },
        Complaint::Cartridge => "it reports a fault of a cartridge".into(),
    }
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
            writeln!(f, "cartridges as they were before the error:")?;
        } else {
            writeln!(f, "cartridges:{}", if self.cartridges.is_empty() { " none" } else { "" })?;
        }
        for cartridge in &self.cartridges {
            writeln!(
                f,
                "    {:<18} barcode {:>2}, {}{}",
                cartridge.ink.unwrap_or("unknown ink"),
                cartridge.barcode,
                cartridge.condition,
                if cartridge.on_carriage { ", on the carriage" } else { "" }
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use press::simulate::{Carousel, Lever, Printer, Trouble};

    /// The simulated printer makes its answers by other code, from the layout recorded from the hardware.
    #[test]
    fn the_simulated_printers_answers_say_what_it_is_told() {
        let mut printer = Printer::new(Carousel::new(&[Ink::White.into()]).unwrap(), Lever::Auto);
        assert_eq!(Status::read(&printer.status()).unwrap().cartridges[0].ink, Some("white"));
        for (trouble, word) in [
            (Trouble::CoverOpen, "cover"),
            (Trouble::NoPaper, "no paper"),
            (Trouble::RibbonMismatch { wanted: Ink::MetallicGold.barcode() }, "gold"),
        ] {
            printer.strike(trouble);
            let status = Status::read(&printer.status()).unwrap();
            assert!(
                status.errors.iter().any(|error| error.contains(word)),
                "{trouble:?}: {:?}",
                status.errors
            );
        }
    }

    #[test]
    fn anything_else_is_no_status() {
        for wrong in [&[][..], &[0x15], &[0; 38], &[2; 39]] {
            assert_eq!(Status::read(wrong), Err(NoStatus(wrong.len())));
        }
    }
}
