//! Which ink a file, a layer or a channel names.
//!
//! Problem: owners name files `white.png`, `01-white.png`, `Gold Foil` or `decal_metallic gold 2`.
//! Method: a leading number is the layer's place from the paper up; a trailing number tells two layers of
//! one ink apart. The words between them are compared with the known names: the whole first, then the
//! longest ending, then the longest beginning, so `gold foil` never means `gold`. What a maker puts before
//! the names of its spots says nothing. The metals of a colour guide are those of the printer. Spot colours
//! of old Japanese programs are in Shift-JIS. Limits: English and Japanese names, and the usual ones of
//! white; codes of one or two letters only as the whole name.

use std::path::Path;

use encoding_rs::SHIFT_JIS;
use observe::Diagnosis;
use protocol::ink::Ink;

use crate::error::{NamedPart, unknown_ink};

/// An ink named by a file, a channel or a layer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Named {
    /// Place from the paper up, if the name begins with a number.
    pub place: Option<u32>,
    /// The ink.
    pub ink: Ink,
}

fn exact(words: &[String]) -> Option<Ink> {
    inks::names::ink(&words.join("-"))
}

/// What makers put before the names of their spots: Roland's programs.
const MAKERS: [&str; 1] = ["rdg"];

/// The words of a name in lower case: what other characters or a capital after a small letter part.
pub(crate) fn parts(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_small = false;
    for c in name.chars() {
        if !c.is_alphanumeric() || was_small && c.is_uppercase() {
            words.push(String::new());
        }
        was_small = c.is_lowercase();
        if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
            word.extend(c.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty() && !MAKERS.contains(&word.as_str()));
    words
}

/// The metallic ink that a colour of the guide by Pantone stands for: 871 to 876 are golds, 877 is silver.
fn metal(name: &str) -> Option<Ink> {
    let words = parts(name);
    let number = &words[words.iter().position(|word| word == "pantone" || word == "pms")? + 1..].first()?;
    match number.trim_end_matches(|c: char| c.is_alphabetic()).parse().ok()? {
        871..=876 => Some(Ink::MetallicGold),
        877 => Some(Ink::MetallicSilver),
        _ => None,
    }
}

/// The leading number of a name, and its words in lower case.
fn words(name: &str) -> (Option<u32>, Vec<String>) {
    let mut words = parts(name);
    let mut place = None;
    // `01white` means the same as `01-white`.
    if let Some(first) = words.first().cloned() {
        let digits = first.len() - first.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        if digits > 0 && (digits < first.len() || words.len() > 1) {
            place = first[..digits].parse().ok();
            words[0] = first[digits..].to_owned();
            words.retain(|word| !word.is_empty());
        }
    }
    if words.len() > 1 && words.last().is_some_and(|last| last.chars().all(|c| c.is_ascii_digit())) {
        words.pop();
    }
    (place, words)
}

/// The ink that a name stands for. `name` is a file name without its extension, or the name of a layer or
/// channel.
pub(crate) fn ink(name: &str) -> Option<Named> {
    let (place, words) = words(name);
    let n = words.len();
    let ends = (0..n).map(|at| &words[at..]);
    let begins = (1..n).rev().map(|at| &words[..at]);
    // Codes of one or two letters must be the whole name: `logo-m` may state a size.
    let found = ends.chain(begins).filter(|part| part.len() == n || part.join("-").len() > 2).find_map(exact);
    found.or_else(|| metal(name)).map(|ink| Named { place, ink }).or_else(|| self::ink(&shift_jis(name)?))
}

/// A name that was read as Latin-1, in the encoding that Japanese programs wrote spot colours in, if it is
/// in it.
fn shift_jis(name: &str) -> Option<String> {
    let bytes: Option<Vec<u8>> = name.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect();
    let bytes = bytes.filter(|bytes| !bytes.is_ascii())?;
    let text = SHIFT_JIS.decode_without_bom_handling_and_without_replacement(&bytes)?;
    // A few codes stand for themselves.
    Some(text.into_owned()).filter(|text| text != name)
}

/// Words that say of a name only that it is one of an ink.
const SAYING: [&str; 5] = ["spot", "ink", "layer", "plate", "pass"];

/// Whether a name is that of an ink, apart from numbers around it: a `black cat` is a cat. Codes are none:
/// programs name shapes `c` or `k` for other reasons.
pub(crate) fn is_whole(name: &str) -> bool {
    let mut words = parts(name);
    words.retain(|word| !SAYING.contains(&word.as_str()));
    let number = |word: &&String| word.chars().all(|c| c.is_ascii_digit());
    let first = words.iter().take_while(|word| number(word)).count();
    let last = words.iter().rev().take_while(|word| number(word)).count();
    let name = words.get(first..words.len() - last).unwrap_or_default().join("-");
    name.len() > 2 && typed(&name).is_ok()
}

/// Whether a file is named after an ink and nothing else but a place: in `2024 white` the number is no place.
pub(crate) fn is_exact(name: &str) -> bool {
    /// Digits of a place, so that `2024 white` has none.
    const DIGITS: usize = 2;
    let mut numbers = name.split(|c: char| !c.is_ascii_digit());
    numbers.all(|number| number.len() <= DIGITS) && (is_whole(name) || exact(&words(name).1).is_some())
}

/// The ink of one of several pages for which these inks are named. Equal inks need to know at which depth
/// they lie: that of their page.
pub(crate) fn of_page(inks: &[Ink], page: u32, ink: Ink) -> Named {
    let repeated = inks.iter().enumerate().any(|(at, ink)| inks[..at].contains(ink));
    Named { place: repeated.then_some(page), ink }
}

/// A file name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "art".into(), |stem| stem.to_string_lossy().into_owned())
}

/// The ink of a layer, channel or plate in a file. A name of no ink is left out with a note, unless it
/// resembles the name of one, which is an error.
pub(crate) fn of_part(
    path: &Path,
    name: &str,
    part: NamedPart,
    notes: &mut Vec<String>,
) -> Result<Option<Named>, Diagnosis> {
    let named = ink(name);
    if named.is_none() {
        if let suggestion @ Some(_) = closest(name) {
            return Err(unknown_ink(path, part, name, suggestion));
        }
        notes.push(format!("{}: {part} `{name}` names no ink: left out", path.display()));
    }
    Ok(named)
}

/// The known name that is most similar to this one, if one is similar enough. Slips of the hand keep the
/// first letter: `Fold`, as fold lines are called, is no slip of `gold`.
pub(crate) fn closest(name: &str) -> Option<&'static str> {
    let (_, words) = words(name);
    let name = words.join("-");
    inks::names::known()
        .filter(|known| known.chars().next() == name.chars().next())
        .map(|known| (strsim::normalized_damerau_levenshtein(&name, known), known))
        .filter(|(likeness, _)| *likeness > 0.6)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}

/// Reads an ink from any of its names.
///
/// # Errors
/// A message with the nearest known name and the names of all inks.
pub fn typed(word: &str) -> Result<Ink, String> {
    let (place, words) = words(word);
    match (place, exact(&words)) {
        (None, Some(ink)) => Ok(ink),
        _ => {
            let hint = closest(word).map_or(String::new(), |s| format!(", did you mean `{s}`?"));
            Err(format!("`{word}` is not an ink{hint}; the inks are {}", Ink::ALL.map(Ink::name).join(", ")))
        }
    }
}

/// Reads a colour of the art and the ink it stands for, such as `#ff0000=gold`. The name of an ink of one's
/// own alone is that ink in its own colour.
///
/// # Errors
/// A message that says how it is written.
pub fn colour(text: &str) -> Result<(Ink, [u8; 3]), String> {
    match text.split_once('=') {
        Some((colour, ink)) => Ok((typed(ink.trim())?, written(colour)?)),
        None => match inks::own::named(text) {
            Some(own) => Ok((own.poses_as(), own.colour())),
            None => Err("write it as a colour and an ink, such as #ff0000=gold".into()),
        },
    }
}

/// A colour as designers write it: `#f00`, `#ff0000`, `red`, or six digits alone.
fn written(text: &str) -> Result<[u8; 3], String> {
    let css = text.trim().parse::<svgtypes::Color>().ok().filter(|colour| colour.alpha == 255);
    css.map_or_else(|| inks::own::colour(text), |colour| Ok([colour.red, colour.green, colour.blue]))
}

/// What is wrong with the colours that stand for inks, after the name of their option.
pub fn wrong_colours(colours: &[(Ink, [u8; 3])]) -> Option<String> {
    /// The most inks that a list names: far more than cartridges, so that nothing real is refused.
    const MOST: usize = 16;
    if colours.len() > MOST {
        return Some(format!("is given {} times; {MOST} is the most", colours.len()));
    }
    if let Some((ink, _)) = colours.iter().find(|(_, colour)| *colour == [255; 3]) {
        return Some(format!("#ffffff={} is bare paper, which no ink prints", ink.name()));
    }
    colours.iter().enumerate().find_map(|(at, (ink, colour))| {
        let (other, _) = colours[..at].iter().find(|(_, earlier)| earlier == colour)?;
        let [r, g, b] = colour;
        Some(format!("gives #{r:02x}{g:02x}{b:02x} two inks, {} and {}", other.name(), ink.name()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn owners_names_lead_to_their_ink() {
        for (name, place, wanted) in [
            ("white", None, Ink::White),
            ("01-white", Some(1), Ink::White),
            ("2_Gold Foil", Some(2), Ink::GoldFoil),
            ("gold", None, Ink::MetallicGold),
            ("10silver-foil", Some(10), Ink::SilverFoil),
            ("decal_metallic gold 2", None, Ink::MetallicGold),
            ("k", None, Ink::Black),
            ("MS", None, Ink::MetallicSilver),
            ("white-logo", None, Ink::White),
            ("Spot White", None, Ink::White),
            ("white-2", None, Ink::White),
            ("badge (Black)", None, Ink::Black),
            ("WhiteInk", None, Ink::White),
            ("Bianco", None, Ink::White),
            ("03 Weiß", Some(3), Ink::White),
            ("Blanc", None, Ink::White),
            ("Clear", None, Ink::Finish),
            ("RDG_WHITE", None, Ink::White),
            ("RDG_GLOSS", None, Ink::Finish),
            ("RDG_PRIMER", None, Ink::Primer),
            ("RDG_METALLIC_SILVER", None, Ink::MetallicSilver),
            ("PANTONE 871 C", None, Ink::MetallicGold),
            ("Pantone 876C", None, Ink::MetallicGold),
            ("PMS 877", None, Ink::MetallicSilver),
            ("01_白", Some(1), Ink::White),
            ("デカール 金", None, Ink::MetallicGold),
            // 白 and 銀箔 in Shift-JIS, read as Latin-1.
            ("\u{94}\u{92}", None, Ink::White),
            ("\u{8b}\u{e2}\u{94}\u{93}", None, Ink::SilverFoil),
        ] {
            assert_eq!(ink(name), Some(Named { place, ink: wanted }), "{name}");
        }
    }

    #[test]
    fn what_names_no_ink_is_none_and_slips_are_understood() {
        for name in [
            "logo",
            "logo-m",
            "photo",
            "2024",
            "",
            "golden",
            "whitee",
            "PANTONE 185 C",
            "PANTONE",
            "877",
            "RDG_",
        ] {
            assert_eq!(ink(name), None, "{name}");
        }
        assert_eq!(closest("whitee"), Some("white"));
        assert_eq!(closest("01-golld"), Some("gold"));
        assert_eq!((closest("holiday"), closest("Fold"), closest("Bianca")), (None, None, None));
        assert!(typed("sliver").unwrap_err().contains("did you mean `silver`?"));
        assert_eq!(typed("silver foil"), Ok(Ink::SilverFoil));
    }

    #[test]
    fn colours_are_written_as_designers_do() {
        for text in
            ["#ff0000=gold", "ff0000=gold", "#f00=gold", "red=gold", " Red = gold", "rgb(255,0,0)=gold"]
        {
            assert_eq!(colour(text), Ok((Ink::MetallicGold, [255, 0, 0])), "{text}");
        }
        for text in ["#ff000=gold", "rouge=gold", "#ff000080=gold", "red"] {
            assert!(colour(text).is_err(), "{text}");
        }
    }

    #[test]
    fn single_elements_need_the_whole_name_of_an_ink() {
        for (name, whole) in [
            ("white", true),
            ("01-white", true),
            ("Gold_Foil-2", true),
            ("path-white", false),
            ("black eye", false),
            ("k", false),
            ("12", false),
            ("", false),
        ] {
            assert_eq!(is_whole(name), whole, "{name}");
        }
    }

    #[test]
    fn a_year_or_a_word_beside_an_ink_makes_a_name_of_something_else() {
        for name in ["white", "k", "01-white", "Gold_Foil-2", "Spot White", "3 Gold Foil"] {
            assert!(is_exact(name), "{name}");
        }
        for name in ["2024 white", "white-1024", "scan-yellow", "logo white", "photo", ""] {
            assert!(!is_exact(name), "{name}");
        }
    }

    proptest! {
        #[test]
        fn no_name_panics(name in "\\PC{0,40}") {
            let _ = (ink(&name), closest(&name), typed(&name));
        }

        #[test]
        fn a_number_before_the_name_is_its_place(place in 0u32..1000, which in 0usize..13) {
            let wanted = Some(Named { place: Some(place), ink: Ink::ALL[which] });
            prop_assert_eq!(ink(&format!("{place:02}-{}", Ink::ALL[which].name())), wanted);
        }
    }
}
