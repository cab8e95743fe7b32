//! What is known about the order of inks and what sticks to what, as data.
//!
//! Problem: the machine prints any order; some orders do not hold, do not show or jam the ribbon. Knowledge is
//! uneven, so each rule says how it is known, and how much it matters.
//! Method: `RULES` is a table of conditions on the stacks in use; `check` tries each. Nothing here changes the
//! passes. Cost: negligible, except that rules on cluster size look at the whole page once for each ink concerned.
//! Source: the notes on the machine, sections 9 and 14; the 2009 paper, section 4.2.

use std::fmt;

use inks::Stack;
use protocol::ink::{Ink, Kind};
use serde::Serialize;

use super::Plan;
use crate::halftone::metrics::smallest_clusters;
use crate::sheet::Sheet;

/// How much it matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Must not be printed.
    Refuse,
    /// Likely to disappoint.
    Warn,
    /// Good to know.
    Note,
}

/// How it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Certainty {
    /// Measured on hardware.
    Measured,
    /// From the source or the streams of the established open driver.
    Driver,
    /// From the vendor's manuals and data.
    Vendor,
    /// Reported by users or sellers of the machine.
    User,
    /// From the 2009 paper's experiments.
    Paper,
    /// Concluded from several of the above.
    Inferred,
}

/// A rule that a sheet touches.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the rule.
    pub rule: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// How it is known.
    pub certainty: Certainty,
    /// What the rule says and what to do.
    pub text: String,
    /// The stacks concerned; empty when the page as a whole is.
    pub stacks: Vec<Stack>,
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = match self.severity {
            Severity::Refuse => "refused",
            Severity::Warn => "careful",
            Severity::Note => "note",
        };
        write!(f, "{word}: {}", self.text)
    }
}

/// A condition on a stack, or on the page.
enum When {
    /// A layer of the first kinds anywhere above one of the second, but for a foil whose undercoat is whole.
    Over(&'static [Kind], &'static [Kind]),
    /// A layer of this kind directly above one of those.
    OnTopOf(Kind, &'static [Kind]),
    /// A layer of this kind without all of these inks somewhere beneath.
    Without(Kind, &'static [Ink]),
    /// A layer of this kind that is neither the first nor on a layer of these kinds.
    NotFirst(Kind, &'static [Kind]),
    /// Exactly one layer of this kind.
    Single(Kind),
    /// A layer of this kind.
    Uses(Kind),
    /// More layers than this.
    Higher(usize),
    /// Dots of this kind in clusters smaller than this.
    Finer(Kind, u32),
    /// This kind covers a part of the page only.
    Partial(Kind),
    /// This kind is printed before an ink of another kind.
    NotLast(Kind),
}

struct Rule {
    name: &'static str,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
}

/// The undercoat that gives foil its grip.
const UNDERCOAT: [Ink; 4] = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black];

const fn rule(
    name: &'static str,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
) -> Rule {
    Rule { name, severity, certainty, when, text }
}

const RULES: [Rule; 17] = [
    rule(
        "foil-speckle",
        Severity::Refuse,
        Certainty::Paper,
        When::Finer(Kind::Foil, 9),
        "foil in clusters of fewer than 3 x 3 dots does not stick, or takes more foil with it; \
         set the minimum cluster of foil stacks to 16",
    ),
    rule(
        "foil-fine",
        Severity::Warn,
        Certainty::Vendor,
        When::Finer(Kind::Foil, 16),
        "foil does not take fine dots: clusters under 4 x 4 dots are uncertain; raise the minimum cluster of foil",
    ),
    rule(
        "foil-undercoat",
        Severity::Warn,
        Certainty::Vendor,
        When::Without(Kind::Foil, &UNDERCOAT),
        "foil needs cyan, magenta, yellow and black, all four solid beneath it, for grip and gloss",
    ),
    rule(
        "foil-code",
        Severity::Warn,
        Certainty::Inferred,
        When::Uses(Kind::Foil),
        "the ink codes of the foils are inferred, no captured stream confirms them; try a small patch first",
    ),
    rule(
        "ink-on-foil",
        Severity::Warn,
        Certainty::Vendor,
        When::Over(&[Kind::Process, Kind::White, Kind::Metallic, Kind::Primer], &[Kind::Foil]),
        "the vendor prints foil last; ink on foil may not hold (the 2009 paper printed process colours on it)",
    ),
    rule(
        "opaque-over-transparent",
        Severity::Warn,
        Certainty::Vendor,
        When::Over(&[Kind::White, Kind::Metallic, Kind::Foil], &[Kind::Process]),
        "an opaque ink hides the transparent colour beneath it; put white, metallics and foil first",
    ),
    rule(
        "white-on-colour",
        Severity::Warn,
        Certainty::Measured,
        When::OnTopOf(Kind::White, &[Kind::Process]),
        "white sticks badly on colours and is full of missing points on black; put it under them",
    ),
    rule(
        "finish-last",
        Severity::Warn,
        Certainty::Driver,
        When::Over(&[Kind::Process, Kind::Metallic, Kind::Foil], &[Kind::Finish]),
        "finish is the clear top coat; an ink above it loses its gloss and may not stick",
    ),
    rule(
        "finish-under-white",
        Severity::Note,
        Certainty::Measured,
        When::Over(&[Kind::White, Kind::Primer], &[Kind::Finish]),
        "finish between primer and white evens the white (seen once, on plain paper: black, primer, finish, primer, white)",
    ),
    rule(
        "primer-first",
        Severity::Note,
        Certainty::Driver,
        When::NotFirst(Kind::Primer, &[Kind::Finish, Kind::Primer]),
        "primer is an undercoat for bare paper; above other inks it only repairs missing points",
    ),
    rule(
        "primer-ribbon",
        Severity::Note,
        Certainty::User,
        When::Uses(Kind::Primer),
        "primer can tear its ribbon on plain paper settings; the cardboard setting cured it",
    ),
    rule(
        "white-thin",
        Severity::Note,
        Certainty::Measured,
        When::Single(Kind::White),
        "one layer of white looks grey; three are nearly white",
    ),
    rule(
        "metallic-fine",
        Severity::Warn,
        Certainty::Paper,
        When::Finer(Kind::Metallic, 8),
        "metallic flakes need clusters of 8 to 16 dots; raise their minimum cluster",
    ),
    rule(
        "finish-partial",
        Severity::Note,
        Certainty::Driver,
        When::Partial(Kind::Finish),
        "the driver prints finish solid or not at all; here it covers a part of the page, dot by dot",
    ),
    rule(
        "primer-partial",
        Severity::Note,
        Certainty::Driver,
        When::Partial(Kind::Primer),
        "the driver prints primer solid or not at all; here it covers a part of the page, dot by dot",
    ),
    rule(
        "layers",
        Severity::Warn,
        Certainty::User,
        When::Higher(3),
        "resin does not always hold on resin; more than three layers are rarely reported to work",
    ),
    rule(
        "finish-pass-last",
        Severity::Note,
        Certainty::Driver,
        When::NotLast(Kind::Finish),
        "other inks are printed after finish; harmless on dots that do not share it",
    ),
];

/// The rules a sheet touches, most severe first. `census` counts the dots of each stack.
pub(super) fn check(sheet: &Sheet, census: &[u64], plan: &Plan) -> Vec<Check> {
    let used: Vec<(usize, &Stack)> =
        sheet.stacks().iter().enumerate().filter(|(q, _)| census[*q] > 0).collect();
    let has = |kind: Kind| move |stack: &Stack| stack.layers().iter().any(|ink| ink.kind() == kind);
    let finest: Vec<(Kind, u32)> = [Kind::Foil, Kind::Metallic]
        .into_iter()
        .filter(|&kind| used.iter().any(|(_, stack)| has(kind)(stack)))
        .map(|kind| {
            let mut label = [0; 256];
            for (q, _) in used.iter().filter(|(_, stack)| has(kind)(stack)) {
                label[*q] = 1;
            }
            (kind, smallest_clusters(sheet.width(), sheet.index(), &label)[1])
        })
        .collect();
    let mut checks = Vec::new();
    for rule in &RULES {
        let stacks = |touches: &dyn Fn(&Stack) -> bool| -> Vec<Stack> {
            used.iter().filter(|(_, stack)| touches(stack)).map(|(_, stack)| (*stack).clone()).collect()
        };
        let mut text = rule.text.to_string();
        let (touched, stacks) = match &rule.when {
            When::Finer(kind, dots) => {
                let least = finest.iter().find(|(of, _)| of == kind).map_or(u32::MAX, |(_, least)| *least);
                text = format!("{text} (smallest cluster: {least} dots)");
                (least < *dots, stacks(&has(*kind)))
            }
            When::Partial(kind) => {
                let covered: u64 =
                    used.iter().filter(|(_, stack)| has(*kind)(stack)).map(|(q, _)| census[*q]).sum();
                (covered > 0 && covered < sheet.index().len() as u64, stacks(&has(*kind)))
            }
            When::NotLast(kind) => {
                let kinds: Vec<Kind> = plan.passes.iter().map(|pass| pass.ink.kind()).collect();
                let first = kinds.iter().position(|k| k == kind);
                (first.is_some_and(|first| kinds[first..].iter().any(|k| k != kind)), Vec::new())
            }
            other => {
                let stacks = stacks(&|stack| other.touches(stack.layers()));
                (!stacks.is_empty(), stacks)
            }
        };
        // The sharper of two rules on the same size is enough.
        let said =
            rule.name == "foil-fine" && checks.iter().any(|check: &Check| check.rule == "foil-speckle");
        if touched && !said {
            let Rule { name, severity, certainty, .. } = *rule;
            checks.push(Check { rule: name, severity, certainty, text, stacks });
        }
    }
    checks.sort_by_key(|check| check.severity);
    checks
}

impl When {
    fn touches(&self, layers: &[Ink]) -> bool {
        let beneath = |i: usize, inks: &[Ink]| inks.iter().all(|ink| layers[..i].contains(ink));
        layers.iter().enumerate().any(|(i, layer)| match self {
            When::Over(upper, lower) => {
                upper.contains(&layer.kind())
                    && layers[..i].iter().any(|below| lower.contains(&below.kind()))
                    && !(layer.kind() == Kind::Foil && beneath(i, &UNDERCOAT))
            }
            When::OnTopOf(kind, below) => {
                layer.kind() == *kind && i > 0 && below.contains(&layers[i - 1].kind())
            }
            When::Without(kind, inks) => layer.kind() == *kind && !beneath(i, inks),
            When::NotFirst(kind, on) => layer.kind() == *kind && i > 0 && !on.contains(&layers[i - 1].kind()),
            When::Single(kind) => {
                layer.kind() == *kind && layers.iter().filter(|ink| ink.kind() == *kind).count() == 1
            }
            When::Uses(kind) => layer.kind() == *kind,
            When::Higher(most) => layers.len() > *most,
            // These look at the page, not at a stack.
            When::Finer(..) | When::Partial(_) | When::NotLast(_) => false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Silent;
    use crate::separate::separate;
    use protocol::paper::Paper;

    /// A page of 32 x 32 dots, bare but for a square of the stack with this side.
    fn touched(stack: &str, side: usize) -> Vec<(&'static str, Severity)> {
        let stacks = vec![Stack::SUBSTRATE, stack.parse().unwrap()];
        let index = (0..1024).map(|dot| u8::from(dot % 32 < side && dot / 32 < side)).collect();
        let sheet = Sheet::new(Paper::Custom { width: 32, length: 32 }, stacks, index).unwrap();
        let checks = separate(&sheet, &Silent).unwrap().checks;
        checks.iter().map(|check| (check.rule, check.severity)).collect()
    }

    #[test]
    fn ordinary_stacks_touch_no_rule() {
        for stack in ["C", "C+M+Y", "MS+C", "MG+Y", "MS+M+F"] {
            let rules: Vec<_> = touched(stack, 32).iter().map(|(rule, _)| *rule).collect();
            assert!(rules.is_empty(), "{stack}: {rules:?}");
        }
    }

    #[test]
    fn each_rule_is_touched_by_what_it_describes_and_not_by_what_it_allows() {
        let has =
            |stack: &str, side: usize, rule: &str| touched(stack, side).iter().any(|(name, _)| *name == rule);
        for (rule, wrong, right) in [
            ("foil-undercoat", "SF", "C+M+Y+K+SF"),
            ("foil-undercoat", "C+M+Y+SF", "K+Y+M+C+GF"),
            ("foil-code", "GF", "MG"),
            ("ink-on-foil", "SF+C", "SF+F"),
            ("opaque-over-transparent", "C+MS", "C+M+Y+K+SF"),
            ("opaque-over-transparent", "K+F+W", "W+K"),
            ("white-on-colour", "K+W", "K+P+W"),
            ("finish-last", "F+C", "C+F"),
            ("finish-under-white", "F+P+W", "W+F"),
            ("primer-first", "C+P", "P+C"),
            ("primer-first", "W+P", "P+F+P"),
            ("primer-ribbon", "P", "F"),
            ("white-thin", "W+C", "W+W+W"),
            ("layers", "MS+C+M+F", "MS+C+F"),
            ("finish-pass-last", "F+P", "P+F"),
        ] {
            assert!(has(wrong, 20, rule), "{rule}: {wrong}");
            assert!(!has(right, 20, rule), "{rule}: {right}");
        }
        for (rule, stack, wrong, right) in [
            ("foil-speckle", "SF", 2, 3),
            ("foil-fine", "SF", 3, 4),
            ("metallic-fine", "MS", 2, 3),
            ("finish-partial", "F", 31, 32),
            ("primer-partial", "P", 31, 32),
        ] {
            assert!(has(stack, wrong, rule), "{rule}: {wrong}");
            assert!(!has(stack, right, rule), "{rule}: {right}");
        }
    }

    #[test]
    fn foil_in_specks_is_refused_first_and_once() {
        let checks = touched("SF", 2);
        assert_eq!(checks[0], ("foil-speckle", Severity::Refuse));
        assert!(checks.iter().all(|(rule, _)| *rule != "foil-fine"));
        assert!(checks.is_sorted_by_key(|(_, severity)| *severity));
    }
}
