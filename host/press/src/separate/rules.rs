//! What is known about pages that hold, show and do not jam the ribbon, as data.
//!
//! Problem: the printer prints anything; some pages disappoint. Knowledge is uneven, so each rule says how
//! it is known, how much it matters, and who can keep it ([`Keeper`]).
//! Method: the rules on the order of layers in a stack are the ink library's ([`inks::Rule`]); `PAGE_RULES`
//! is a table of conditions on what only the page knows: how small the dots are, how much an ink covers,
//! what is used. `check` tries each. Nothing here changes the passes. Cost: negligible, except that rules
//! on cluster size look at the whole page once for each ink concerned.
//! Source: the vendor's guides, what owners have reported, the open driver's habits, and section 4.2 of the
//! 2009 paper; each rule's certainty says which.

use std::cmp::Reverse;
use std::fmt;

use inks::{Certainty, Rule, Severity, Stack};
use protocol::ink::Kind;
use serde::Serialize;

use super::passes::{MOST_CARTRIDGES, Plan};
use sheet::clusters::{Touch, smallest_clusters};
use sheet::{Sheet, dots_in_words};

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
            names => format!("{} (stacks: {})", self.text, names.join(", ")),
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

/// Who can see to it that a rule is not touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeper {
    /// The program, where it chooses stacks and dots: what it makes of materials on its own touches none of
    /// these.
    Program,
    /// Who prints: by the art, a setting, or by knowing.
    Owner,
}

struct PageRule {
    name: &'static str,
    keeper: Keeper,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
}

const fn rule(
    name: &'static str,
    keeper: Keeper,
    severity: Severity,
    certainty: Certainty,
    when: When,
    text: &'static str,
) -> PageRule {
    PageRule { name, keeper, severity, certainty, when, text }
}

const PAGE_RULES: [PageRule; 9] = [
    rule(
        "foil-speckle",
        Keeper::Program,
        Severity::Error,
        Certainty::Published,
        When::Finer(Kind::Foil, 9),
        "foil in clusters of fewer than 3 x 3 dots does not stick, or takes more foil with it; \
         draw what is smaller larger, or set the minimum cluster of foil stacks to 16",
    ),
    rule(
        "foil-fine",
        Keeper::Program,
        Severity::Warning,
        Certainty::Vendor,
        When::Finer(Kind::Foil, 16),
        "foil in clusters of fewer than 4 x 4 dots may not stick; draw what is smaller larger, or raise the minimum cluster of foil",
    ),
    rule(
        "foil-code",
        Keeper::Program,
        Severity::Warning,
        Certainty::Inferred,
        When::Uses(Kind::Foil),
        "the ink codes of the foils are inferred and no captured stream confirms them; print a small patch first",
    ),
    rule(
        "primer-ribbon",
        Keeper::Program,
        Severity::Note,
        Certainty::Reported,
        When::Uses(Kind::Primer),
        "primer can tear its ribbon with the media setting for plain paper; with the setting for cardboard it did not",
    ),
    rule(
        "white-thin",
        Keeper::Owner,
        Severity::Note,
        Certainty::Measured,
        When::Single(Kind::White),
        "one layer of white looks grey; three are nearly white",
    ),
    rule(
        "metallic-fine",
        Keeper::Program,
        Severity::Warning,
        Certainty::Published,
        When::Finer(Kind::Metallic, 8),
        "metallic inks need clusters of 8 to 16 dots; draw what is smaller larger, or raise the minimum cluster of what a halftone made",
    ),
    rule(
        "finish-partial",
        Keeper::Owner,
        Severity::Note,
        Certainty::Driver,
        When::Partial(Kind::Finish),
        "the vendor's driver prints finish over the whole page or not at all; here it covers some dots only",
    ),
    rule(
        "primer-partial",
        Keeper::Owner,
        Severity::Note,
        Certainty::Driver,
        When::Partial(Kind::Primer),
        "the vendor's driver prints primer over the whole page or not at all; here it covers some dots only",
    ),
    rule(
        "finish-pass-last",
        Keeper::Program,
        Severity::Note,
        Certainty::Driver,
        When::NotLast(Kind::Finish),
        "other inks are printed after finish; this is harmless where they share no dot with it",
    ),
];

/// The rules on pages, and who keeps each.
pub fn keepers() -> impl Iterator<Item = (&'static str, Keeper)> {
    PAGE_RULES.iter().map(|rule| (rule.name, rule.keeper))
}

/// What the conditions are tried on.
struct Page<'a> {
    plan: &'a Plan,
    /// The stacks on a dot, and how many dots each has.
    used: Vec<(&'a Stack, u64)>,
    /// Dots of the whole page.
    dots: u64,
    /// Dots of the smallest cluster of each kind of ink that is used and has a rule on it.
    finest: Vec<(Kind, u32)>,
}

fn layers(stack: &Stack, kind: Kind) -> usize {
    stack.layers().iter().filter(|ink| ink.kind() == kind).count()
}

impl<'a> Page<'a> {
    fn new(sheet: &'a Sheet, census: &[u64], plan: &'a Plan) -> Page<'a> {
        let finest = [Kind::Foil, Kind::Metallic].into_iter().filter_map(|kind| {
            let mut label = [0; 256];
            for (q, stack) in sheet.stacks().iter().enumerate() {
                label[q] = u8::from(census[q] > 0 && layers(stack, kind) > 0);
            }
            let any = label.contains(&1);
            any.then(|| (kind, smallest_clusters(sheet.width(), sheet.index(), &label, Touch::Corner)[1]))
        });
        Page {
            plan,
            used: sheet.stacks().iter().zip(census.iter().copied()).filter(|(_, dots)| *dots > 0).collect(),
            dots: sheet.index().len() as u64,
            finest: finest.collect(),
        }
    }

    /// The stacks on a dot for which this holds.
    fn stacks(&self, holds: impl Fn(&Stack) -> bool) -> Vec<Stack> {
        self.used.iter().filter(|(stack, _)| holds(stack)).map(|(stack, _)| (*stack).clone()).collect()
    }

    fn least(&self, kind: Kind) -> Option<u32> {
        self.finest.iter().find(|(of, _)| *of == kind).map(|(_, least)| *least)
    }

    /// The stacks a condition is about, none for the page as a whole; `None` if it does not hold.
    fn touched(&self, when: &When) -> Option<Vec<Stack>> {
        let having = |kind: Kind| self.stacks(|stack| layers(stack, kind) > 0);
        match *when {
            When::Single(kind) => {
                Some(self.stacks(|stack| layers(stack, kind) == 1)).filter(|s| !s.is_empty())
            }
            When::Uses(kind) => Some(having(kind)).filter(|stacks| !stacks.is_empty()),
            When::Finer(kind, dots) => self.least(kind).filter(|&least| least < dots).map(|_| having(kind)),
            When::Partial(kind) => {
                let covered: u64 =
                    self.used.iter().filter(|(stack, _)| layers(stack, kind) > 0).map(|(_, dots)| dots).sum();
                (covered > 0 && covered < self.dots).then(|| having(kind))
            }
            When::NotLast(kind) => {
                let mut kinds =
                    self.plan.passes.iter().map(|pass| pass.ink.kind()).skip_while(|&other| other != kind);
                kinds.any(|other| other != kind).then(Vec::new)
            }
        }
    }
}

/// The rules a sheet touches, most severe first, those on layers before those on the page. `census` counts
/// the dots of each stack.
pub(super) fn check(sheet: &Sheet, census: &[u64], plan: &Plan, rules: &[Rule]) -> Vec<Check> {
    let page = Page::new(sheet, census, plan);
    let mut checks = Vec::new();
    for rule in rules {
        let stacks = page.stacks(|stack| rule.broken_by(stack));
        if !stacks.is_empty() {
            let Rule { name, says, severity, certainty, .. } = rule.clone();
            checks.push(Check { rule: name, severity, certainty, text: says, stacks });
        }
    }
    for rule in &PAGE_RULES {
        // The sharper of two rules on the same size is enough.
        let told =
            rule.name == "foil-fine" && checks.iter().any(|check: &Check| check.rule == "foil-speckle");
        let Some(stacks) = page.touched(&rule.when).filter(|_| !told) else { continue };
        let text = match rule.when {
            When::Finer(kind, _) => {
                let least = page.least(kind).unwrap_or_default();
                format!("{} (smallest cluster: {})", rule.text, dots_in_words(least))
            }
            _ => rule.text.to_string(),
        };
        let PageRule { severity, certainty, .. } = *rule;
        checks.push(Check { rule: rule.name.into(), severity, certainty, text, stacks });
    }
    checks.extend(too_many_cartridges(plan));
    checks.sort_by_key(|check| Reverse(check.severity));
    checks
}

/// The rule on how many cartridges the printer holds.
pub const CARTRIDGES: &str = "cartridges";

/// More cartridges than the printer holds are an error.
fn too_many_cartridges(plan: &Plan) -> Option<Check> {
    if plan.cartridges.len() <= MOST_CARTRIDGES {
        return None;
    }
    let dots = |ink| plan.passes.iter().filter(|pass| pass.ink == ink).map(|pass| pass.dots).sum::<u64>();
    let least = plan.cartridges.iter().map(|&ink| dots(ink)).min().unwrap_or_default();
    let rarest: Vec<&str> =
        plan.cartridges.iter().filter(|&&ink| dots(ink) == least).map(|ink| ink.name()).collect();
    let rare = match rarest[..] {
        [one] => format!(", for example {one}, which has the fewest dots ({least})"),
        _ if rarest.len() == plan.cartridges.len() => String::new(),
        _ => format!(", for example one of {}, which have the fewest dots ({least} each)", rarest.join(", ")),
    };
    Some(Check {
        rule: CARTRIDGES.into(),
        severity: Severity::Error,
        certainty: Certainty::Vendor,
        text: format!(
            "the job needs {} cartridges and the printer holds {MOST_CARTRIDGES}; it would have to stop in the middle of \
             the sheet for a change, and how long it waits is not known; leave out an ink{rare}",
            plan.cartridges.len()
        ),
        stacks: Vec::new(),
    })
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
    fn an_ink_is_named_as_the_rarest_only_if_others_have_more_dots() {
        let inks = ["K", "C", "M", "Y", "MG", "MM", "MC", "MS"];
        let said = |few: usize| {
            let stacks = [Stack::SUBSTRATE].into_iter().chain(inks.map(|ink| ink.parse().unwrap())).collect();
            // The last `few` inks have half as many dots.
            let index = (0..1024usize).map(|dot| match (dot % 8, dot / 8) {
                (ink, turn) if ink >= 8 - few && turn >= 64 => 0,
                (ink, _) => 1 + ink as u8,
            });
            let sheet = Sheet::new(Paper::Custom { width: 32, length: 32 }, stacks, index.collect()).unwrap();
            checks(&sheet, &[]).iter().find(|check| check.rule == "cartridges").unwrap().text.clone()
        };
        assert!(said(0).ends_with("leave out an ink"), "{}", said(0));
        assert!(
            said(1).ends_with("for example metallic-silver, which has the fewest dots (64)"),
            "{}",
            said(1)
        );
        let two = "for example one of metallic-cyan, metallic-silver, which have the fewest dots (64 each)";
        assert!(said(2).ends_with(two), "{}", said(2));
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
        assert_eq!(checks[0].with_stacks(), "all should not lie over magenta (stacks: M+F)");
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
