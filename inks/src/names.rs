//! The names of inks, as owners and drawing programs write them.
//!
//! Problem: a cartridge has a name and a code here, other names on its box and in the old driver, and shorter ones in the
//! mouths of owners. An option that takes some of them and not others is a trap.
//! Method: one table beside the names and codes of the printer's language. Case and what stands between words do not matter.
//! Everything that reads an ink from a person asks [`ink`]. Cost: a walk over some fifty names. Limits: English names.

use protocol::ink::Ink;

/// Names in addition to [`Ink::name`] and [`Ink::short`], with words joined by `-`.
const ALSO: [(&str, Ink); 32] = [
    ("k", Ink::Black),
    ("key", Ink::Black),
    ("gold", Ink::MetallicGold),
    ("silver", Ink::MetallicSilver),
    ("metallic-red", Ink::MetallicMagenta),
    ("metallic-blue", Ink::MetallicCyan),
    ("metal-gold", Ink::MetallicGold),
    ("metal-silver", Ink::MetallicSilver),
    ("gold-metallic", Ink::MetallicGold),
    ("silver-metallic", Ink::MetallicSilver),
    ("foil-gold", Ink::GoldFoil),
    ("foil-silver", Ink::SilverFoil),
    ("flash-gold", Ink::GoldFoil),
    ("flash-silver", Ink::SilverFoil),
    ("spot-white", Ink::White),
    ("under-white", Ink::White),
    ("undercoat-white", Ink::White),
    ("process-black", Ink::Black),
    ("process-cyan", Ink::Cyan),
    ("process-magenta", Ink::Magenta),
    ("process-yellow", Ink::Yellow),
    ("gloss", Ink::Finish),
    ("glossy", Ink::Finish),
    ("glossy-finish", Ink::Finish),
    ("gloss-finish", Ink::Finish),
    ("finish-ii", Ink::Finish),
    ("clear-coat", Ink::Finish),
    ("varnish", Ink::Finish),
    ("vphoto-primer", Ink::Primer),
    ("photo-primer", Ink::Primer),
    ("mf", Ink::Primer),
    ("mf-ink", Ink::Primer),
];

/// The ink of this name or code, if the whole text is one.
pub fn ink(text: &str) -> Option<Ink> {
    let words: Vec<String> = text
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    let name = words.join("-");
    let also = || ALSO.iter().find(|(known, _)| *known == name).map(|&(_, ink)| ink);
    Ink::from_name(&name).or_else(also)
}

/// All names of more than a code, for suggestions.
pub fn known() -> impl Iterator<Item = &'static str> {
    Ink::ALL
        .into_iter()
        .map(Ink::name)
        .chain(ALSO.iter().map(|(name, _)| *name))
        .filter(|name| name.len() > 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_that_of_one_ink() {
        for known in Ink::ALL {
            assert_eq!((ink(known.name()), ink(known.short())), (Some(known), Some(known)));
        }
        for (i, (name, wanted)) in ALSO.iter().enumerate() {
            assert_eq!(ink(name), Some(*wanted));
            assert!(ALSO[..i].iter().all(|(other, _)| other != name), "{name} is listed twice");
        }
        assert_eq!((ink("Gold Foil"), ink("METAL_silver")), (Some(Ink::GoldFoil), Some(Ink::MetallicSilver)));
        assert_eq!((ink(""), ink("golden"), ink("gold leaf")), (None, None, None));
    }
}
