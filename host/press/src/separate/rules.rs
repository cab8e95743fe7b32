//! What is known about pages that hold, show and do not jam the ribbon, as data.
//!
//! Problem: the machine prints anything; some pages disappoint. Knowledge is uneven, so each rule says how it is
//! known, and how much it matters.
//! Method: the rules on the order of layers in a stack are the ink library's ([`inks::Rule`]); `PAGE_RULES` is a
//! table of conditions on what only the page knows: how small the dots are, how much an ink covers, what is used.
//! `check` tries each. Nothing here changes the passes. Cost: negligible, except that rules on cluster size look at
//! the whole page once for each ink concerned.
//! Source: the vendor's guides, what owners have reported, the open driver's habits, and section 4.2 of the 2009 paper; each
//! rule's certainty says which.

use std::cmp::Reverse;
use std::fmt;

use inks::{Certainty, Rule, Severity, Stack};
use protocol::ink::Kind;
use serde::Serialize;

use super::{MOST_CARTRIDGES, Plan};
use crate::halftone::metrics::smallest_clusters;
use crate::sheet::Sheet;

/// A rule that a sheet touches.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the rule.
    pub rule: String,
    /// How much it matters; a sheet with an [`Severity::Error`] must not be printed.
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
        write!(f, "{}: {}", self.severity, self.text)
    }
}

impl Check {
    /// The text and the names of the stacks, the first few of many.
    pub fn with_stacks(&self) -> String {
        const NAMED: usize = 8;
        let mut names: Vec<String> = self.stacks.iter().take(NAMED).map(Stack::to_string).collect();
        if self.stacks.len() > NAMED {
            names.push(format!("{} more", self.stacks.len() - NAMED));
        }
        match names.as_slice() {
            [] => self.text.clone(),
            names => format!("{}; it is about {}", self.text, names.join(", ")),
        }
    }
}

/// A condition on the page.
enum When {
    /// Exactly one layer of this kind.
    Single(Kind),
    /// A layer of this kind.
    Uses(Kind),
    /// Dots of this kind in clusters smaller than this.
    Finer(Kind, u32),
    /// This kind covers a part of the page only.
    Partial(Kind),
    /// This kind is printed before an ink of another kind.
    NotLast(Kind),
}

struct PageRule {
    name: &'static str,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
}

const fn rule(
    name: &'static str,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
) -> PageRule {
    PageRule { name, severity, certainty, when, text }
}

const PAGE_RULES: [PageRule; 9] = [
    rule(
        "foil-speckle",
        Severity::Error,
        Certainty::Published,
        When::Finer(Kind::Foil, 9),
        "foil in clusters of fewer than 3 x 3 dots does not stick, or takes more foil with it; \
         set the minimum cluster of foil stacks to 16",
    ),
    rule(
        "foil-fine",
        Severity::Warning,
        Certainty::Vendor,
        When::Finer(Kind::Foil, 16),
        "foil does not take fine dots: clusters under 4 x 4 dots are uncertain; raise the minimum cluster of foil",
    ),
    rule(
        "foil-code",
        Severity::Warning,
        Certainty::Inferred,
        When::Uses(Kind::Foil),
        "the ink codes of the foils are inferred, no captured stream confirms them; try a small patch first",
    ),
    rule(
        "primer-ribbon",
        Severity::Note,
        Certainty::Reported,
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
        Severity::Warning,
        Certainty::Published,
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
        "finish-pass-last",
        Severity::Note,
        Certainty::Driver,
        When::NotLast(Kind::Finish),
        "other inks are printed after finish; harmless on dots that do not share it",
    ),
];

/// The rules a sheet touches, most severe first, those on layers before those on the page. `census` counts the dots
/// of each stack.
pub(super) fn check(sheet: &Sheet, census: &[u64], plan: &Plan, order: &[Rule]) -> Vec<Check> {
    let used: Vec<(usize, &Stack)> =
        sheet.stacks().iter().enumerate().filter(|(q, _)| census[*q] > 0).collect();
    let layers = |stack: &Stack, kind: Kind| stack.layers().iter().filter(|ink| ink.kind() == kind).count();
    let concerned = |touches: &dyn Fn(&Stack) -> bool| -> Vec<Stack> {
        used.iter().filter(|(_, stack)| touches(stack)).map(|(_, stack)| (*stack).clone()).collect()
    };
    let mut checks = Vec::new();
    for rule in order {
        let stacks = concerned(&|stack| rule.broken_by(stack));
        if !stacks.is_empty() {
            let Rule { name, says, severity, certainty, .. } = rule.clone();
            checks.push(Check { rule: name, severity, certainty, text: says, stacks });
        }
    }
    let finest: Vec<(Kind, u32)> = [Kind::Foil, Kind::Metallic]
        .into_iter()
        .filter(|&kind| used.iter().any(|(_, stack)| layers(stack, kind) > 0))
        .map(|kind| {
            let mut label = [0; 256];
            for (q, _) in used.iter().filter(|(_, stack)| layers(stack, kind) > 0) {
                label[*q] = 1;
            }
            (kind, smallest_clusters(sheet.width(), sheet.index(), &label)[1])
        })
        .collect();
    for rule in &PAGE_RULES {
        let having = |kind: Kind| concerned(&|stack| layers(stack, kind) > 0);
        let mut text = rule.text.to_string();
        let (touched, stacks) = match rule.when {
            When::Single(kind) => {
                let stacks = concerned(&|stack| layers(stack, kind) == 1);
                (!stacks.is_empty(), stacks)
            }
            When::Uses(kind) => {
                let stacks = having(kind);
                (!stacks.is_empty(), stacks)
            }
            When::Finer(kind, dots) => {
                let least = finest.iter().find(|(of, _)| *of == kind).map_or(u32::MAX, |(_, least)| *least);
                text = format!("{text} (smallest cluster: {least} dots)");
                (least < dots, having(kind))
            }
            When::Partial(kind) => {
                let with_kind = used.iter().filter(|(_, stack)| layers(stack, kind) > 0);
                let covered: u64 = with_kind.map(|(q, _)| census[*q]).sum();
                (covered > 0 && covered < sheet.index().len() as u64, having(kind))
            }
            When::NotLast(kind) => {
                let kinds: Vec<Kind> = plan.passes.iter().map(|pass| pass.ink.kind()).collect();
                let first = kinds.iter().position(|&k| k == kind);
                (first.is_some_and(|first| kinds[first..].iter().any(|&k| k != kind)), Vec::new())
            }
        };
        // The sharper of two rules on the same size is enough.
        let said =
            rule.name == "foil-fine" && checks.iter().any(|check: &Check| check.rule == "foil-speckle");
        if touched && !said {
            let PageRule { severity, certainty, .. } = *rule;
            checks.push(Check { rule: rule.name.into(), severity, certainty, text, stacks });
        }
    }
    if plan.cartridges.len() > MOST_CARTRIDGES {
        let dots = |ink| plan.passes.iter().filter(|pass| pass.ink == ink).map(|pass| pass.dots).sum::<u64>();
        let least = plan.cartridges.iter().copied().min_by_key(|&ink| dots(ink));
        checks.push(Check {
            rule: "cartridges".into(),
            severity: Severity::Error,
            certainty: Certainty::Vendor,
            text: format!(
                "{} cartridges, and the machine holds {MOST_CARTRIDGES}: one would have to be changed in the middle of the \
                 sheet, and how long the machine holds it then is not known, so no such job is sent; leave out an ink{}",
                plan.cartridges.len(),
                least.map_or_else(String::new, |ink| format!(
                    ", {} has the fewest dots ({})",
                    ink.name(),
                    dots(ink)
                ))
            ),
            stacks: Vec::new(),
        });
    }
    checks.sort_by_key(|check| Reverse(check.severity));
    checks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::separate::separate;
    use inks::Library;
    use observe::Silent;
    use protocol::paper::Paper;

    /// A sheet of 32 x 32 dots, bare but for a square of the stack with this side.
    fn sheet(stack: &str, side: usize) -> Sheet {
        let stacks = vec![Stack::SUBSTRATE, stack.parse().unwrap()];
        let index = (0..1024).map(|dot| u8::from(dot % 32 < side && dot / 32 < side)).collect();
        Sheet::new(Paper::Custom { width: 32, length: 32 }, stacks, index).unwrap()
    }

    fn checks(sheet: &Sheet, order: &[Rule]) -> Vec<Check> {
        separate(sheet, order, &Silent).unwrap().checks
    }

    /// The built-in rules that a page touches.
    fn touched(stack: &str, side: usize) -> Vec<(String, Severity)> {
        let checks = checks(&sheet(stack, side), Library::builtin().rules());
        checks.into_iter().map(|check| (check.rule, check.severity)).collect()
    }

    #[test]
    fn ordinary_stacks_touch_no_rule() {
        for stack in ["C", "C+M+Y", "MS+C", "MG+Y", "MS+M+F"] {
            let rules = touched(stack, 32);
            assert!(rules.is_empty(), "{stack}: {rules:?}");
        }
    }

    #[test]
    fn each_rule_is_touched_by_what_it_describes_and_not_by_what_it_allows() {
        let has =
            |stack: &str, side: usize, rule: &str| touched(stack, side).iter().any(|(name, _)| name == rule);
        for (rule, wrong, right) in [
            ("foil-code", "GF", "MG"),
            ("primer-ribbon", "P", "F"),
            ("white-thin", "W+C", "W+W+W"),
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
        assert_eq!(checks[0], ("foil-speckle".into(), Severity::Error));
        assert!(checks.iter().all(|(rule, _)| rule != "foil-fine"));
        assert!(checks.is_sorted_by_key(|(_, severity)| Reverse(*severity)));
    }

    #[test]
    fn an_owners_rules_take_the_place_of_the_built_in_ones() {
        let rule = |name: &str, severity, over: &str, under: &str| Rule {
            name: name.into(),
            says: format!("{over} should not lie over {under}"),
            severity,
            certainty: Certainty::Measured,
            over: Some(over.parse().unwrap()),
            under: Some(under.parse().unwrap()),
            directly_on: None,
            needs: None,
            most_layers: None,
        };
        let order = [
            rule("mine", Severity::Note, "finish", "black"),
            rule("apart", Severity::Warning, "finish", "yellow"),
            rule("never", Severity::Error, "all", "magenta"),
        ];
        let stacks = ["substrate", "K+F", "M+F", "K+C+F", "F+C", "Y+F"].map(|text| text.parse().unwrap());
        // The last two stacks have no dot.
        let index = (0..1024).map(|dot| (dot % 4) as u8).collect();
        let sheet = Sheet::new(Paper::Custom { width: 32, length: 32 }, stacks.to_vec(), index).unwrap();
        let checks = checks(&sheet, &order);
        let said = |name: &str| checks.iter().filter(|check| check.rule == name).collect::<Vec<_>>();
        let [mine] = said("mine")[..] else { panic!("{checks:?}") };
        assert_eq!(mine.stacks, [stacks[1].clone(), stacks[3].clone()]);
        assert_eq!((mine.severity, mine.certainty), (Severity::Note, Certainty::Measured));
        assert_eq!(mine.text, "finish should not lie over black");
        assert!(said("apart").is_empty(), "no dot has it");
        assert_eq!(checks[0].rule, "never");
        assert_eq!(checks[0].with_stacks(), "all should not lie over magenta; it is about M+F");
        assert!(said("finish-partial").len() == 1 && checks.len() == 3, "{checks:?}");
    }

    #[test]
    fn the_librarys_rules_name_every_stack_that_breaks_them_once() {
        let library = Library::builtin();
        let stacks: Vec<Stack> = library.entries().iter().map(|entry| entry.stack.clone()).collect();
        // Seven cartridges at a time.
        for inks in ["foil,process,finish", "metallic,cyan,magenta,finish", "primer,foil,metallic"] {
            let set: inks::InkSet = inks.parse().unwrap();
            let stacks: Vec<Stack> =
                stacks.iter().filter(|s| set.contains_all(s.layers())).cloned().collect();
            let index = (0..1024).map(|dot| (dot % stacks.len()) as u8).collect();
            let sheet = Sheet::new(Paper::Custom { width: 32, length: 32 }, stacks.clone(), index).unwrap();
            let checks = checks(&sheet, library.rules());
            for rule in library.rules() {
                let expected: Vec<&Stack> = stacks.iter().filter(|stack| rule.broken_by(stack)).collect();
                let found: Vec<&Check> = checks.iter().filter(|check| check.rule == rule.name).collect();
                assert_eq!(found.len(), usize::from(!expected.is_empty()), "{}", rule.name);
                assert!(found.iter().all(|check| check.stacks.iter().eq(expected.iter().copied())));
            }
        }
    }
}
