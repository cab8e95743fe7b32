//! Whether the cartridges a job needs are in the printer.
//!
//! Cartridges are known by their barcode; the carousel turns, so places mean nothing. What the printer says while it reports
//! an error was true before the error, and decides nothing.

use protocol::ink::Ink;

use super::status::Status;

/// What the printer says of the cartridges a job needs.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Found {
    /// All are in and ready.
    All,
    /// Some are not.
    Missing(Vec<Missing>),
    /// The answer decides nothing: the printer reports an error.
    Stale,
}

/// A cartridge a job needs that is not ready.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Missing {
    /// Its ink.
    pub ink: Ink,
    /// What is the matter, when it is in the printer: `backwards` or `end of ribbon`.
    pub condition: Option<&'static str>,
}

/// Looks for the cartridges of these inks in the printer's answer.
pub(crate) fn find(status: &Status, wanted: &[Ink]) -> Found {
    if status.stale {
        return Found::Stale;
    }
    let missing: Vec<Missing> = wanted
        .iter()
        .filter_map(|&ink| {
            let mut its = status.cartridges.iter().filter(|cartridge| cartridge.barcode == ink.barcode());
            if its.clone().any(|cartridge| cartridge.condition == "loaded") {
                return None;
            }
            Some(Missing { ink, condition: its.next().map(|cartridge| cartridge.condition) })
        })
        .collect();
    if missing.is_empty() { Found::All } else { Found::Missing(missing) }
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}, barcode {})", self.ink.name(), self.ink.part(), self.ink.barcode())?;
        let own: Vec<&str> = inks::own::posing_as(self.ink).collect();
        if !own.is_empty() {
            write!(f, " or your {}, which poses as it", own.join(" or "))?;
        }
        match self.condition {
            Some("backwards") => write!(f, ": it is loaded the wrong way round"),
            Some(condition) => write!(f, ": {condition}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use press::simulate::{Carousel, Cartridge, Condition, Lever, Printer, Trouble};

    /// The answer comes from the simulated printer, whose cartridges stand in whatever places they were given.
    fn printer(cartridges: &[Cartridge]) -> Printer {
        Printer::new(Carousel::new(cartridges).unwrap(), Lever::Auto)
    }

    fn ask(printer: &Printer, wanted: &[Ink]) -> Found {
        find(&Status::read(&printer.status()).unwrap(), wanted)
    }

    #[test]
    fn cartridges_are_found_by_barcode_in_any_place() {
        let loaded = printer(&[Ink::Cyan.into(), Ink::White.into(), Ink::Black.into()]);
        assert_eq!(ask(&loaded, &[Ink::White, Ink::Cyan]), Found::All);
        let Found::Missing(missing) = ask(&loaded, &[Ink::White, Ink::MetallicGold]) else { panic!() };
        assert_eq!(missing, [Missing { ink: Ink::MetallicGold, condition: None }]);
        assert_eq!(missing[0].to_string(), "metallic-gold (MDC-METG, barcode 8)");
    }

    #[test]
    fn a_cartridge_that_cannot_print_counts_as_missing_and_says_why() {
        let backwards = Cartridge { condition: Condition::Backwards, ..Ink::White.into() };
        let Found::Missing(missing) = ask(&printer(&[backwards]), &[Ink::White]) else { panic!() };
        assert!(missing[0].to_string().contains("wrong way round"));
        // Another of the same ink that is ready is enough.
        assert_eq!(ask(&printer(&[backwards, Ink::White.into()]), &[Ink::White]), Found::All);
    }

    #[test]
    fn nothing_is_decided_from_an_answer_with_an_error() {
        let mut stopped = printer(&[Ink::White.into()]);
        stopped.strike(Trouble::CoverOpen);
        assert_eq!(ask(&stopped, &[Ink::White]), Found::Stale);
        assert_eq!(ask(&stopped, &[Ink::Black]), Found::Stale);
    }
}
