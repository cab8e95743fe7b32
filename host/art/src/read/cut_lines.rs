//! Lines that are cut and not printed.
//!
//! Problem: owners draw the outline for their cutting plotter in the art, in a spot colour or a layer of its own. Printed, it costs
//! ribbon and frames every sticker.
//! Method: the names that plotters look for are known; what bears one is left out with a note. Limits: the names of the makers of
//! plotters and of design programs, in English.
//! Source: the names that Roland VersaWorks (CutContour, PerfCutContour and those that begin with `RDG_`), Mimaki, Summa (ThruCut,
//! KissCut) and Esko (Crease, Dieline) give their users to type.

/// Names, in lower case and without anything but letters.
const NAMES: [&str; 14] = [
    "cutcontour",
    "perfcutcontour",
    "cut",
    "cutline",
    "cutlines",
    "kisscut",
    "thrucut",
    "throughcut",
    "diecut",
    "dieline",
    "perfcut",
    "perforation",
    "crease",
    "cutter",
];

/// What the spots of one maker begin with.
const ROLAND: &str = "rdg_";

/// Whether a layer or a spot colour of this name is for a cutter.
pub(crate) fn is_cut(name: &str) -> bool {
    let name = name.trim().to_lowercase();
    let letters: String = name.chars().filter(|c| c.is_alphabetic()).collect();
    name.starts_with(ROLAND) || NAMES.contains(&letters.as_str())
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
            "RDG_WHITE_X",
            "Die line",
            "Crease",
        ] {
            assert!(is_cut(name), "{name}");
        }
        for name in ["Cute", "Shortcut", "White", "Cut flowers", "", "Hairdie"] {
            assert!(!is_cut(name), "{name}");
        }
    }
}
