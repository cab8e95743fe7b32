//! Inks of one's own: ribbons of other makers, in cartridges that the printer takes for those of an ink it knows.
//!
//! Problem: some twenty translucent and fluorescent ribbons are sold for these printers. Each carries the barcode of a vendor's
//! cartridge, so the printer knows it by that, and its owner by another name.
//! Method: such an ink is a name, a colour and the ink whose place it takes. Wherever an ink is named, its name means the ink
//! it poses as, whose code and barcode go into jobs and are asked for in the printer. Plans and checks name both: only the
//! owner can tell which of the two is loaded. The program hands over its user's list once, when it starts.
//! Limits: order, knockout and curves are those of the ink it poses as; a library of one's own has others. A name holds no
//! digits at its ends and no code, for which readers of names have other uses.
//! Source: owners' reports on ribbons in use.

use std::sync::OnceLock;

use protocol::ink::Ink;
use serde::{Deserialize, Serialize};

use crate::cartridges;

/// The most inks of one's own: more than are sold.
pub const MOST: usize = 64;

/// An ink of another maker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Own {
    /// Its name: words in lower case, joined by `-`.
    name: String,
    /// sRGB as it looks on white paper.
    colour: [u8; 3],
    /// The ink whose place it takes.
    poses_as: Ink,
}

/// As it is stored.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    name: String,
    colour: String,
    poses_as: String,
}

/// The file.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    ink: Vec<Row>,
}

/// Words that readers of names pass over, or that stand for several inks.
const TAKEN: [&str; 11] =
    ["spot", "ink", "layer", "plate", "pass", "process", "metallic", "clear", "foil", "default", "all"];

static LIST: OnceLock<Vec<Own>> = OnceLock::new();

/// The inks of the user of this process; none until [`set`].
pub fn all() -> &'static [Own] {
    LIST.get().map_or(&[], Vec::as_slice)
}

/// Hands over the inks of the user of this process, once: jobs of one process never differ in what a name means.
pub fn set(list: Vec<Own>) {
    // The first list stays.
    let _ = LIST.set(list);
}

/// The names of inks of one's own that pose as this one.
pub fn posing_as(ink: Ink) -> impl Iterator<Item = &'static str> {
    all().iter().filter(move |own| own.poses_as == ink).map(|own| own.name.as_str())
}

/// The ink of one's own of this name, in upper or lower case, whatever stands between its words.
pub fn named(text: &str) -> Option<&'static Own> {
    let name = plain(text);
    all().iter().find(|own| own.name == name)
}

/// A name as it is compared.
fn plain(text: &str) -> String {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().join("-")
}

/// A colour as `#ff0000` or `ff0000`.
///
/// # Errors
/// A message that says how colours are written.
pub fn colour(text: &str) -> Result<[u8; 3], String> {
    let digits = text.trim().trim_start_matches('#');
    let hexadecimal = digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| hexadecimal);
    let [_, red, green, blue] = number
        .ok_or_else(|| {
            format!("`{text}` is no colour; write six digits of red, green and blue, such as #ff0000")
        })?
        .to_be_bytes();
    Ok([red, green, blue])
}

impl Own {
    /// An ink of this name and colour in a cartridge with the barcode of `poses_as`.
    ///
    /// # Errors
    /// A message that says why the name or the colour will not do.
    pub fn new(name: &str, colour: &str, poses_as: Ink) -> Result<Own, String> {
        /// As long as a name fits into a line of a plan.
        const LONGEST: usize = 40;
        let name = plain(name);
        let is_digit = |c: char| c.is_numeric();
        if name.chars().count() < 3
            || name.chars().count() > LONGEST
            || name.starts_with(is_digit)
            || name.ends_with(is_digit)
        {
            return Err(format!(
                "`{name}` will not do as the name of an ink: use 3 to {LONGEST} letters, with digits only in the middle, such as \
                 neon-pink"
            ));
        }
        if let Some(word) = name.split('-').find(|word| TAKEN.contains(word)) {
            return Err(format!(
                "`{word}` in the name of an ink has another meaning; leave it out, as in neon-pink"
            ));
        }
        if let Some(ink) = cartridges::ink(&name) {
            return Err(format!("`{name}` is a name of {} already; choose another", ink.name()));
        }
        Ok(Own { name, colour: self::colour(colour)?, poses_as })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// sRGB as it looks on white paper.
    pub fn colour(&self) -> [u8; 3] {
        self.colour
    }

    /// The ink whose place it takes.
    pub fn poses_as(&self) -> Ink {
        self.poses_as
    }
}

/// Reads a list as [`write()`] writes it.
///
/// # Errors
/// A message that says what is wrong, with the line or the name.
pub fn read(text: &str) -> Result<Vec<Own>, String> {
    let file: File = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
    let mut list: Vec<Own> = Vec::new();
    for Row { name, colour, poses_as } in file.ink {
        let ink = cartridges::ink(&poses_as)
            .ok_or_else(|| format!("ink `{name}`: `{poses_as}` is none of the printer's inks"))?;
        add(&mut list, Own::new(&name, &colour, ink)?)?;
    }
    Ok(list)
}

/// Adds an ink to a list.
///
/// # Errors
/// A message if the name is in the list, or the list is full.
pub fn add(list: &mut Vec<Own>, own: Own) -> Result<(), String> {
    if list.iter().any(|other| other.name == own.name) {
        return Err(format!(
            "there is an ink `{0}` already; `foilpress inks remove {0}` removes it",
            own.name
        ));
    }
    if list.len() >= MOST {
        return Err(format!("there are {MOST} inks already, the most there can be"));
    }
    list.push(own);
    Ok(())
}

/// A list as text.
///
/// # Errors
/// What the format cannot hold; no list that [`add`] made is such.
pub fn write(list: &[Own]) -> Result<String, String> {
    let row = |own: &Own| {
        let [red, green, blue] = own.colour;
        Row {
            name: own.name.clone(),
            colour: format!("#{red:02x}{green:02x}{blue:02x}"),
            poses_as: own.poses_as.name().into(),
        }
    };
    toml::to_string(&File { ink: list.iter().map(row).collect() }).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_list_is_read_as_it_was_written() {
        let mut list = Vec::new();
        add(&mut list, Own::new("Neon Pink", "ff40a0", Ink::MetallicMagenta).unwrap()).unwrap();
        add(&mut list, Own::new("pale-blue", "#80C0FF", Ink::MetallicCyan).unwrap()).unwrap();
        assert_eq!(list[0].name(), "neon-pink");
        assert_eq!(read(&write(&list).unwrap()).unwrap(), list);
        let again = Own::new("neon_pink", "#000000", Ink::White).unwrap();
        assert!(add(&mut list, again).unwrap_err().contains("already"));
    }

    #[test]
    fn names_and_colours_that_mean_something_else_are_refused() {
        for (name, why) in [
            ("gold", "metallic-gold already"),
            ("白", "3 to 40"),
            ("mg", "3 to 40"),
            ("pink 2", "digits"),
            ("2 pink", "digits"),
            ("neon-layer", "`layer`"),
            ("all", "`all`"),
            ("\u{1b}[2J", "3 to 40"),
        ] {
            let said = Own::new(name, "#ff0000", Ink::White).unwrap_err();
            assert!(said.contains(why) && !said.contains('\u{1b}'), "{name}: {said}");
        }
        for colour in ["red", "#ff00", "#+f0000", "ff00000", "ééé"] {
            assert!(Own::new("pink", colour, Ink::White).is_err(), "{colour}");
        }
        let twice = "[[ink]]\nname='pink'\ncolour='#ff0000'\nposes_as='gold'\n".repeat(2);
        assert!(read(&twice).unwrap_err().contains("already"));
        assert!(
            read("[[ink]]\nname='a-pink'\ncolour='#ff0000'\nposes_as='jam'\n").unwrap_err().contains("jam")
        );
        assert!(read("[[ink]]\nname='a-pink'\nsize=1\n").is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_a_list_or_a_message(text in "\\PC{0,60}", name in "\\PC{0,60}") {
            let _ = (read(&text), colour(&text));
            if let Ok(own) = Own::new(&name, "#123456", Ink::Finish) {
                prop_assert_eq!(read(&write(std::slice::from_ref(&own)).unwrap()).unwrap(), [own]);
            }
        }
    }
}
