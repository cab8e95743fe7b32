//! Lines that are cut and not printed.
//!
//! Problem: owners draw the outline for their cutting plotter in the art, in a spot colour or a layer of
//! its own. Printed, it costs ribbon and frames every sticker.
//! Method: a name is that of a line for a cutter if it consists of words of cutting alone, one of which
//! says what is done; what bears it is left out with a note. What a maker puts before its names says
//! nothing. Limits: English, German and Italian.
//! Source: the names that Roland VersaWorks (CutContour, PerfCutContour), Mimaki, Summa (ThruCut, KissCut),
//! Zünd and Esko (Crease, Dieline, Stanze) give their users to type.

use crate::read::names;

/// What is done to the sheet, alone or with what it is done to in one word.
const DONE: [&str; 27] = [
    "cut",
    "cuts",
    "cutting",
    "cutter",
    "cutline",
    "cutlines",
    "cutcontour",
    "kisscut",
    "thrucut",
    "throughcut",
    "diecut",
    "dieline",
    "dielines",
    "perfcut",
    "perfcutcontour",
    "perforation",
    "perforate",
    "crease",
    "creasing",
    "stanze",
    "stanzen",
    "stanzlinie",
    "stanzkontur",
    "schnitt",
    "schneiden",
    "fustella",
    "taglio",
];

/// Words that may stand beside it.
const BESIDE: [&str; 14] = [
    "contour", "kontur", "kiss", "perf", "thru", "through", "die", "line", "lines", "path", "half", "full",
    "layer", "spot",
];

/// Whether a layer or a spot colour of this name is for a cutter.
pub(crate) fn is_cut(name: &str) -> bool {
    let mut words = names::parts(name);
    words.retain(|word| !word.chars().all(|c| c.is_ascii_digit()));
    let is_done = |word: &String| DONE.contains(&word.as_str());
    // `Die line` is one word in two.
    let is_die = words.windows(2).any(|two| two[0] == "die" && two[1].starts_with("line"));
    (is_die || words.iter().any(is_done))
        && words.iter().all(|word| is_done(word) || BESIDE.contains(&word.as_str()))
}

/// A note on what is left out.
pub(crate) fn note(place: &dyn std::fmt::Display, part: &str, name: &str) -> String {
    format!("{place}: {part} `{name}` is for a cutter: left out of the print")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_for_cutters_are_known_however_they_are_written() {
        for name in [
            "CutContour",
            "Cut Contour",
            "CUT",
            "Kiss-Cut",
            "thru_cut 2",
            "Cutting",
            "Stanze",
            "Cut Contour Kiss",
            "RDG_CUT_2",
            "PerfCutContour",
            "Die line",
            "Crease",
        ] {
            assert!(is_cut(name), "{name}");
        }
        for name in [
            "Cute",
            "Shortcut",
            "White",
            "Cut flowers",
            "",
            "Hairdie",
            "RDG_WHITE",
            "RDG_GLOSS",
            "Contour line",
        ] {
            assert!(!is_cut(name), "{name}");
        }
    }
}
