//! What may lie on what: the machine's order rules, kept as data.
//!
//! Knowledge of this is uneven, so every rule says how sure it is, and breaking one is something to be told, not
//! something forbidden: owners have printed against most of them.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::set::InkSet;
use crate::stack::Stack;

/// How sure a rule or a caution is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Certainty {
    /// Seen on a real machine under controlled conditions.
    Measured,
    /// Experiments on such a machine, published by others.
    Published,
    /// The established open driver does so, or its streams show it.
    Driver,
    /// The vendor's manual or driver says so.
    Vendor,
    /// Owners or sellers say so.
    Reported,
    /// Concluded from other facts.
    Inferred,
    /// A guess on the safe side.
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
    /// Good to know.
    Note,
    /// Usable, but expect trouble.
    Warning,
    /// Not usable: a file with it is not read, a stack with it is not chosen, a sheet with it is not printed.
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

/// One rule on the order of layers. Without a condition it is never broken.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Short name, by which a library that is based on another replaces its rule.
    pub name: String,
    /// The reason, in words.
    pub says: String,
    /// What breaking it means.
    pub severity: Severity,
    /// How sure it is.
    pub certainty: Certainty,
    /// The inks the rule is about.
    pub over: Option<InkSet>,
    /// What they should not lie above, whatever is between.
    pub under: Option<InkSet>,
    /// What they should not lie on with nothing between.
    pub directly_on: Option<InkSet>,
    /// What they should all have beneath them.
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
    fn a_rule_looks_at_everything_beneath() {
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
