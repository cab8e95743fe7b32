//! The names of the printer's cartridges, as owners and drawing programs write them.
//!
//! Problem: a cartridge has a name and a code here, other names on its box and in the old driver, and shorter ones in the
//! mouths of owners. An option that takes some of them and not others is a trap.
//! Method: one table beside the names and codes of the printer's language. Case and what stands between words do not matter.
//! Everything that reads an ink from a person asks [`ink`](crate::names::ink). Japanese names, in which most
//! of these printers were sold, are looked up without what printers' shops write around them (`特色`, `版`, …).
//! Cost: a walk over some eighty names. Limits: English and Japanese names.

use protocol::ink::Ink;

/// Names in addition to [`Ink::name`] and [`Ink::short`], with words joined by `-`.
const ALSO: [(&str, Ink); 33] = [
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
    ("white-ink", Ink::White),
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

/// What else shops call them. No slip of the hand is taken for these: `blank` is no `blanc`.
const SHOPS: [(&str, Ink); 5] = [
    ("weiss", Ink::White),
    ("weiß", Ink::White),
    ("bianco", Ink::White),
    ("blanc", Ink::White),
    ("clear", Ink::Finish),
];

/// Japanese names, without what is written around them.
const JAPANESE: [(&str, Ink); 30] = [
    ("白", Ink::White),
    ("シロ", Ink::White),
    ("ホワイト", Ink::White),
    ("金", Ink::MetallicGold),
    ("キン", Ink::MetallicGold),
    ("ゴールド", Ink::MetallicGold),
    ("メタリックゴールド", Ink::MetallicGold),
    ("銀", Ink::MetallicSilver),
    ("ギン", Ink::MetallicSilver),
    ("シルバー", Ink::MetallicSilver),
    ("メタリックシルバー", Ink::MetallicSilver),
    ("メタリックレッド", Ink::MetallicMagenta),
    ("メタリックマゼンタ", Ink::MetallicMagenta),
    ("メタリックブルー", Ink::MetallicCyan),
    ("メタリックシアン", Ink::MetallicCyan),
    ("金箔", Ink::GoldFoil),
    ("ゴールドフォイル", Ink::GoldFoil),
    ("銀箔", Ink::SilverFoil),
    ("シルバーフォイル", Ink::SilverFoil),
    ("黒", Ink::Black),
    ("墨", Ink::Black),
    ("スミ", Ink::Black),
    ("ブラック", Ink::Black),
    ("シアン", Ink::Cyan),
    ("マゼンタ", Ink::Magenta),
    ("イエロー", Ink::Yellow),
    ("黄", Ink::Yellow),
    ("光沢", Ink::Finish),
    ("フィニッシュ", Ink::Finish),
    ("プライマー", Ink::Primer),
];

/// What stands before and behind Japanese names: special colour; plate, colour, ink, layer.
const BEFORE: [&str; 2] = ["特色", "特"];
const BEHIND: [&str; 5] = ["版", "色", "インク", "インキ", "レイヤー"];

/// The ink of a Japanese name.
fn japanese(name: &str) -> Option<Ink> {
    let plain: String = name.chars().filter(|c| *c != '-' && !c.is_ascii_digit()).collect();
    let begin = BEFORE.iter().find_map(|before| plain.strip_prefix(before)).unwrap_or(&plain);
    let whole = BEHIND.iter().find_map(|behind| begin.strip_suffix(behind)).unwrap_or(begin);
    JAPANESE.iter().find(|(known, _)| *known == whole).map(|&(_, ink)| ink)
}

/// The ink of this name or code among those that the printer knows.
pub(crate) fn ink(text: &str) -> Option<Ink> {
    let words: Vec<String> = text
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    let name = words.join("-");
    let also = || ALSO.iter().chain(&SHOPS).find(|(known, _)| *known == name).map(|&(_, ink)| ink);
    Ink::from_name(&name).or_else(also).or_else(|| japanese(&name))
}

/// All names of more than a code.
pub(crate) fn known() -> impl Iterator<Item = &'static str> {
    let names = Ink::ALL.into_iter().map(Ink::name).chain(ALSO.iter().map(|(name, _)| *name));
    names.filter(|name| name.len() > 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn japanese_names_are_those_of_inks_with_what_shops_write_around_them() {
        for (name, wanted) in [
            ("白", Ink::White),
            ("特色白", Ink::White),
            ("白版", Ink::White),
            ("ホワイト インク", Ink::White),
            ("01 金", Ink::MetallicGold),
            ("金箔", Ink::GoldFoil),
            ("銀色", Ink::MetallicSilver),
            ("墨版", Ink::Black),
        ] {
            assert_eq!(ink(name), Some(wanted), "{name}");
        }
        for (i, (name, wanted)) in JAPANESE.iter().enumerate() {
            assert_eq!(ink(name), Some(*wanted));
            assert!(JAPANESE[..i].iter().all(|(other, _)| other != name), "{name} is listed twice");
        }
        assert_eq!((ink("白鳥"), ink("金魚"), ink("版"), ink("背景")), (None, None, None, None));
    }

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
