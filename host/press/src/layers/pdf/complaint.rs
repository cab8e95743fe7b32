//! What Ghostscript says of a document that it cannot read, in words for its owner.
//!
//! Problem: Ghostscript ends well even if it has drawn nothing, and what it then says is many lines.
//! Method: a few of its sentences have a meaning of their own; of the others the first complaint is quoted.
//! Limits: the sentences are those of versions 9.5 to 10; of other versions the quote alone remains.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// How far from its end a document says where the table of its objects is: readers look in the last 1024 bytes, and forgive some
/// more.
const END: u64 = 4096;

/// What Ghostscript says of a page that there is not; then follows how many there are.
const BEYOND: &str = "greater than the number of pages";

/// The longest quote, in characters.
const LONGEST: usize = 120;

/// Why no page of a document was drawn, or not the one of this number.
#[must_use]
pub fn no_page(said: &str, number: Option<u32>) -> String {
    if said.contains("requires a password") {
        return "it is encrypted and needs a password; save it without one".into();
    }
    let beyond = said.contains(BEYOND);
    match (complaint(said).filter(|_| !beyond), number) {
        (Some(complaint), _) => {
            format!("it is damaged (Ghostscript says `{complaint}`); save or export it again")
        }
        (None, Some(number)) => match pages(said) {
            Some(pages) => format!("there is no page {number}; the file has {pages}"),
            None => format!("there is no page {number}"),
        },
        (None, None) => "it has no page".into(),
    }
}

/// How many pages a document has that has not the page that was asked for.
fn pages(said: &str) -> Option<u32> {
    said.split_once(BEYOND)?.1.lines().next()?.rsplit(' ').next()?.parse().ok()
}

/// The first thing that Ghostscript complains of.
fn complaint(said: &str) -> Option<String> {
    let line = said.lines().find_map(|line| Some(line.split_once("**** Error: ")?.1))?;
    let quote: String = line.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    Some(quote.trim().trim_end_matches('.').to_owned())
}

/// A note on a document that was drawn with complaints, if there are any.
#[must_use]
pub fn damaged(said: &str) -> Option<String> {
    complaint(said).map(|complaint| {
        format!("the document is damaged (Ghostscript says `{complaint}`), so some of it may be missing")
    })
}

/// A note on a document that has no end.
#[must_use]
pub fn cut_short(path: &Path) -> Option<String> {
    is_cut_short(path).then(|| "the document is cut short, so some of it may be missing".into())
}

/// Whether a file begins as PDF and has no table of its objects at its end: Ghostscript then draws what it finds, in silence.
fn is_cut_short(path: &Path) -> bool {
    let ends = || {
        let mut file = File::open(path)?;
        let mut start = [0; 4];
        file.read_exact(&mut start)?;
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(length.saturating_sub(END)))?;
        let mut end = Vec::new();
        file.read_to_end(&mut end)?;
        Ok::<_, std::io::Error>((start, end))
    };
    ends().is_ok_and(|(start, end)| &start == b"%PDF" && !end.windows(9).any(|word| word == b"startxref"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_has_words_of_its_own() {
        let broken = "   **** Error: Couldn't initialise file.\n               Output may be incorrect.\n";
        let locked = "GPL Ghostscript 10.00.0: \n   **** This file requires a password for access.\n";
        let beyond = "   Requested FirstPage is greater than the number of pages in the file: 1\n";
        assert!(
            no_page(broken, Some(1)).contains("is damaged (Ghostscript says `Couldn't initialise file`)")
        );
        assert!(no_page(&[locked, broken].concat(), None).contains("needs a password"));
        assert_eq!(no_page(&[broken, beyond].concat(), Some(7)), "there is no page 7; the file has 1");
        assert_eq!(no_page(BEYOND, Some(7)), "there is no page 7");
        assert_eq!(no_page("noise", None), "it has no page");
        assert_eq!((damaged("noise"), cut_short(Path::new("none"))), (None, None));
        let long = complaint(&format!("**** Error: \x1b{}", "x".repeat(500))).unwrap();
        assert_eq!(long, "x".repeat(120));
    }

    #[test]
    fn a_document_without_an_end_is_cut_short() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pdf");
        let body = "1 0 obj <<>> endobj\n".repeat(400);
        for (text, cut) in [
            (format!("%PDF-1.4\n{body}xref\ntrailer\nstartxref\n9\n%%EOF\n"), false),
            (format!("%PDF-1.4\n{body}"), true),
            (format!("%!PS\n{body}"), false),
        ] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(cut_short(&path).is_some(), cut);
        }
    }
}
