//! What Ghostscript says of a document that it cannot read, in words for its owner.
//!
//! Problem: Ghostscript ends well even if it has drawn nothing, and what it then says is many lines.
//! Method: a few of its sentences have a meaning of their own; of the others the first complaint is quoted.
//! Limits: the sentences are those of versions 9.5 to 10; of other versions the quote alone remains.

/// The longest quote, in characters.
const LONGEST: usize = 120;

/// Why no page of a document was drawn, or not the one of this number.
#[must_use]
pub fn no_page(said: &str, number: Option<u32>) -> String {
    if said.contains("requires a password") {
        return "it is encrypted and needs a password; save it without one".into();
    }
    let beyond = said.contains("greater than the number of pages");
    match (complaint(said).filter(|_| !beyond), number) {
        (Some(complaint), _) => {
            format!("it is damaged (Ghostscript says `{complaint}`); save or export it again")
        }
        (None, Some(number)) => format!("there is no page {number}"),
        (None, None) => "it has no page".into(),
    }
}

/// The first thing that Ghostscript complains of.
#[must_use]
pub fn complaint(said: &str) -> Option<String> {
    let line = said.lines().find_map(|line| Some(line.split_once("**** Error: ")?.1))?;
    let quote: String = line.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    Some(quote.trim().trim_end_matches('.').to_owned())
}

/// A note on a document that was drawn with complaints, if there are any.
#[must_use]
pub fn doubt(said: &str) -> Option<String> {
    let complaint = complaint(said)?;
    Some(format!("the document is damaged (Ghostscript says `{complaint}`), so some of it may be missing"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_has_words_of_its_own() {
        let damaged = "   **** Error: Couldn't initialise file.\n               Output may be incorrect.\n";
        let locked = "GPL Ghostscript 10.00.0: \n   **** This file requires a password for access.\n";
        let beyond = "   Requested FirstPage is greater than the number of pages in the file: 1\n";
        assert!(
            no_page(damaged, Some(1)).contains("is damaged (Ghostscript says `Couldn't initialise file`)")
        );
        assert!(no_page(&[locked, damaged].concat(), None).contains("needs a password"));
        assert_eq!(no_page(&[damaged, beyond].concat(), Some(7)), "there is no page 7");
        assert_eq!(no_page("noise", None), "it has no page");
        assert_eq!((complaint("noise"), doubt("")), (None, None));
        let long = complaint(&format!("**** Error: \x1b{}", "x".repeat(500))).unwrap();
        assert_eq!(long, "x".repeat(120));
    }
}
