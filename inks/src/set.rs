//! Sets of inks.
//!
//! Text form: words joined by commas, each an ink by any of its names (`cyan`, `MS`, `gold`) or a group (`process`,
//! `metallic`, `clear`, `foil`, `default`, `all`); a leading `-` removes it. A text that starts with `-` or `+` modifies the default set. A set contains
//! foils only if it names them or `all`: their ink codes have never been seen in a real stream, so using them must be an
//! explicit choice.

use std::fmt;
use std::str::FromStr;

use protocol::ink::{Ink, Kind};
use serde::Deserialize;

use super::names;

/// A set of inks. The default is every ink except the foils and white.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct InkSet(u16);

/// A word that is neither an ink nor a group.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is neither an ink nor a group of inks{}; {}", hint(suggestion), choices())]
pub struct InkSetError {
    /// The word.
    pub word: String,
    /// A similar name, if there is one.
    pub suggestion: Option<&'static str>,
}

fn hint(suggestion: &Option<&'static str>) -> String {
    suggestion.map_or(String::new(), |s| format!(", did you mean `{s}`?"))
}

fn choices() -> String {
    let groups: Vec<_> = GROUPS.iter().map(|(name, _)| *name).collect();
    format!("the groups are {}; the inks are {}", groups.join(", "), Ink::ALL.map(Ink::name).join(", "))
}

type Member = fn(Ink) -> bool;

const GROUPS: [(&str, Member); 6] = [
    ("process", |ink| ink.kind() == Kind::Process),
    ("metallic", |ink| ink.kind() == Kind::Metallic),
    ("clear", |ink| matches!(ink.kind(), Kind::Finish | Kind::Primer)),
    ("foil", |ink| ink.kind() == Kind::Foil),
    ("default", |ink| !matches!(ink.kind(), Kind::Foil | Kind::White)),
    ("all", |_| true),
];

impl Default for InkSet {
    fn default() -> InkSet {
        InkSet::EMPTY.with_all(|ink| !matches!(ink.kind(), Kind::Foil | Kind::White))
    }
}

impl InkSet {
    /// The empty set: only the bare substrate can be printed.
    pub const EMPTY: InkSet = InkSet(0);

    /// Every ink, including the foils.
    pub const ALL: InkSet = InkSet((1 << Ink::ALL.len()) - 1);

    /// The set of these inks.
    pub fn of(inks: impl IntoIterator<Item = Ink>) -> InkSet {
        inks.into_iter().fold(InkSet::EMPTY, InkSet::with)
    }

    /// The set with this ink.
    #[must_use]
    pub fn with(self, ink: Ink) -> InkSet {
        InkSet(self.0 | 1 << ink as u16)
    }

    /// The set without this ink.
    #[must_use]
    pub fn without(self, ink: Ink) -> InkSet {
        InkSet(self.0 & !(1 << ink as u16))
    }

    fn with_all(self, member: impl Fn(Ink) -> bool) -> InkSet {
        Ink::ALL.into_iter().filter(|&ink| member(ink)).fold(self, InkSet::with)
    }

    /// Whether the ink is in the set.
    pub fn contains(self, ink: Ink) -> bool {
        self.0 & 1 << ink as u16 != 0
    }

    /// Whether all of the inks are in the set.
    pub fn contains_all(self, inks: &[Ink]) -> bool {
        inks.iter().all(|&ink| self.contains(ink))
    }

    /// The number of inks in the set.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The inks, in the order of their codes.
    pub fn iter(self) -> impl Iterator<Item = Ink> {
        Ink::ALL.into_iter().filter(move |&ink| self.contains(ink))
    }
}

impl FromStr for InkSet {
    type Err = InkSetError;

    fn from_str(text: &str) -> Result<InkSet, InkSetError> {
        let changes_default = text.trim_start().starts_with(['-', '+']);
        let mut set = if changes_default { InkSet::default() } else { InkSet::EMPTY };
        for word in text.split(',').flat_map(words) {
            let (take, name) = signed(word);
            let named = match GROUPS.iter().find(|(group, _)| group.eq_ignore_ascii_case(name)) {
                Some((_, member)) => InkSet::EMPTY.with_all(member),
                None => InkSet::EMPTY.with(
                    names::ink(name)
                        .ok_or_else(|| InkSetError { word: name.into(), suggestion: closest(name) })?,
                ),
            };
            set = if take { InkSet(set.0 & !named.0) } else { InkSet(set.0 | named.0) };
        }
        Ok(set)
    }
}

/// Whether a word removes, and what.
fn signed(word: &str) -> (bool, &str) {
    match word.strip_prefix('-') {
        Some(name) => (true, name),
        None => (false, word.strip_prefix('+').unwrap_or(word)),
    }
}

/// The words between two commas: one, if they are the name of an ink, such as `silver foil`.
fn words(part: &str) -> Vec<&str> {
    let part = part.trim();
    let several = part.chars().skip(1).any(|c| "-+".contains(c));
    let one = !several && names::ink(signed(part).1).is_some();
    if one { vec![part] } else { part.split_whitespace().collect() }
}

impl TryFrom<String> for InkSet {
    type Error = InkSetError;

    fn try_from(text: String) -> Result<InkSet, InkSetError> {
        text.parse()
    }
}

/// An ink, given in a file by its long or short name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct InkName(pub Ink);

impl TryFrom<String> for InkName {
    type Error = InkSetError;

    fn try_from(word: String) -> Result<InkName, InkSetError> {
        match names::ink(&word) {
            Some(ink) => Ok(InkName(ink)),
            None => Err(InkSetError { suggestion: closest(&word), word }),
        }
    }
}

/// The known name most similar to this one, if any is similar enough.
fn closest(word: &str) -> Option<&'static str> {
    let word = word.to_ascii_lowercase();
    names::known()
        .chain(GROUPS.iter().map(|(name, _)| *name))
        .map(|name| (strsim::normalized_damerau_levenshtein(&word, name), name))
        .filter(|(likeness, _)| *likeness >= 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

impl fmt::Display for InkSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.iter().map(Ink::name).collect::<Vec<_>>().join(","))
    }
}

impl fmt::Debug for InkSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn set(text: &str) -> InkSet {
        text.parse().unwrap()
    }

    #[test]
    fn foils_need_to_be_named() {
        for text in ["default", "process,metallic,clear", "-white", "+white"] {
            assert!(!set(text).contains(Ink::SilverFoil) && !set(text).contains(Ink::GoldFoil), "{text}");
        }
        for text in ["all", "foil", "+silver-foil", "C,SF"] {
            assert!(set(text).contains(Ink::SilverFoil), "{text}");
        }
    }

    #[test]
    fn words_add_and_remove_in_order() {
        let inks = [Ink::Black, Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::MetallicSilver, Ink::Finish];
        assert_eq!(set("process,metallic-silver,finish"), InkSet::of(inks));
        assert_eq!(set("all,-white"), InkSet::ALL.without(Ink::White));
        assert_eq!(set("-metallic"), set("process clear"));
        assert_eq!(set("process,-K,k"), set("process"));
        assert_eq!(set(""), InkSet::EMPTY);
        assert_eq!(
            set("gold,Silver Foil, mf -key"),
            InkSet::of([Ink::MetallicGold, Ink::SilverFoil, Ink::Primer])
        );
        assert_eq!(set("all,-gold foil,-C"), InkSet::ALL.without(Ink::GoldFoil).without(Ink::Cyan));
    }

    #[test]
    fn a_typo_gets_a_suggestion() {
        let error = "process,metalic-silver".parse::<InkSet>().unwrap_err();
        assert_eq!(error.suggestion, Some("metallic-silver"));
        assert!(error.to_string().contains("did you mean `metallic-silver`?"), "{error}");
        let error = "chartreuse".parse::<InkSet>().unwrap_err();
        assert!(error.suggestion.is_none() && error.to_string().contains("gold-foil"), "{error}");
    }

    proptest! {
        #[test]
        fn the_text_of_a_set_is_the_set(bits in 0u16..1 << 13) {
            let some = InkSet(bits);
            prop_assert_eq!(set(&some.to_string()), some);
            prop_assert_eq!(InkSet::of(some.iter()), some);
        }

        #[test]
        fn no_text_panics(text in "\\PC{0,40}") {
            let _ = text.parse::<InkSet>();
        }
    }
}
