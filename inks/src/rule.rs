//! Rules on the order of layers, as data.
//!
//! Knowledge about them is uneven, so every rule states its certainty. Breaking a rule usually gives a warning and is not
//! forbidden, because owners have successfully broken most of them.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::set::InkSet;
use crate::stack::Stack;

/// How certain a rule or a caution is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Certainty {
    /// Observed on a real printer under controlled conditions.
    Measured,
    /// Published experiments on such a printer.
    Published,
    /// From the established open driver or its streams.
    Driver,
    /// From the vendor's manual or driver.
    Vendor,
    /// Reported by owners or sellers.
    Reported,
    /// Inferred from other facts.
    Inferred,
    /// A cautious guess.
    Guess,
}

impl fmt::Display for Certainty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Certainty::Measured => "measured",
            Certainty::Published => "published",
            Certainty::Driver => "driver",
            Certainty::Vendor => "vendor",
            Certainty::Reported => "reported",
            Certainty::Inferred => "inferred",
            Certainty::Guess => "guess",
        })
    }
}

/// How much a finding matters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information.
    Note,
    /// Usable, but expect trouble.
    Warning,
    /// Not usable: such a file is not read, such a stack not chosen, such a sheet not printed.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        })
    }
}

/// A rule on the order of layers. Without a condition it is never broken.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Short name. A library that is based on another replaces a rule by its name.
    pub name: String,
    /// The reason, as shown to users.
    pub says: String,
    /// The severity of breaking it.
    pub severity: Severity,
    /// How certain it is.
    pub certainty: Certainty,
    /// The inks the rule is about.
    pub over: Option<InkSet>,
    /// The inks they should not lie above, with or without layers between.
    pub under: Option<InkSet>,
    /// The inks they should not lie on directly.
    pub directly_on: Option<InkSet>,
    /// The inks that must all lie beneath them.
    pub needs: Option<InkSet>,
    /// The most layers a stack should have.
    pub most_layers: Option<usize>,
}

impl Rule {
    /// Whether a stack breaks the rule.
    pub fn broken_by(&self, stack: &Stack) -> bool {
        let layers = stack.layers();
        self.most_layers.is_some_and(|most| layers.len() > most)
            || layers.iter().enumerate().any(|(at, &ink)| {
                let beneath = &layers[..at];
                let meets = |set: InkSet| beneath.last().is_some_and(|&ink| set.contains(ink));
                if !self.over.is_some_and(|over| over.contains(ink)) {
                    return false;
                }
                self.under.is_some_and(|under| beneath.iter().any(|&ink| under.contains(ink)))
                    || self.directly_on.is_some_and(meets)
                    || self.needs.is_some_and(|needs| !needs.iter().all(|ink| beneath.contains(&ink)))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str) -> InkSet {
        text.parse().unwrap()
    }

    fn rule(over: &str, under: Option<&str>, needs: Option<&str>, most_layers: Option<usize>) -> Rule {
        Rule {
            name: String::new(),
            says: String::new(),
            severity: Severity::Warning,
            certainty: Certainty::Guess,
            over: Some(set(over)),
            under: under.map(set),
            directly_on: None,
            needs: needs.map(set),
            most_layers,
        }
    }

    #[test]
    fn a_rule_considers_every_layer_beneath() {
        let stack = |text: &str| text.parse::<Stack>().unwrap();
        let below_colour = rule("metallic", Some("process"), None, None);
        assert!(below_colour.broken_by(&stack("C+F+MS")) && !below_colour.broken_by(&stack("MS+C+F")));
        let undercoat = rule("foil", None, Some("process"), None);
        assert!(undercoat.broken_by(&stack("C+M+Y+SF")) && !undercoat.broken_by(&stack("C+M+Y+K+SF")));
        assert!(undercoat.broken_by(&stack("SF+C+M+Y+K")) && !undercoat.broken_by(&stack("MS+C")));
        let touching = Rule { directly_on: Some(set("black")), ..rule("white", None, None, None) };
        assert!(touching.broken_by(&stack("K+W+W")) && !touching.broken_by(&stack("K+P+W+K")));
        assert!(
            !rule("all", None, None, None).broken_by(&stack("C+M+Y+K+SF+F")),
            "no condition, no complaint"
        );
        let short = rule("", None, None, Some(3));
        assert!(short.broken_by(&stack("C+M+Y+F")) && !short.broken_by(&stack("C+M+Y")));
    }
}
