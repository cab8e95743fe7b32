//! What Ghostscript says of a document that it cannot read or draws in part, in words for its owner.
//!
//! Problem: Ghostscript ends well even if it has drawn nothing, and what it then says is many lines. Its interpreter of PDF
//! since version 9.56 complains in other words than the one before it: of some things at once, and of all at the end, in
//! two lists of errors and warnings. Most warnings are about the form of the document, and nothing is missing.
//! Method: a few sentences have a meaning of their own. Of the others the first complaint is quoted: any error that is no
//! matter of form, and the warnings that mean that something is not drawn.
//! Limits: the sentences are those of versions 9.5 to 10; what other versions say in other words is not noticed.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// How far from its end a document says where the table of its objects is: readers look in the last 1024 bytes, and forgive some
/// more.
const END: u64 = 4096;

/// What Ghostscript says of a page that there is not; then follows how many there are.
const BEYOND: &str = "greater than the number of pages";

/// What begins the lists at the end, and whether it is the one of errors.
const LISTS: [(&str, bool); 2] =
    [("The following errors were encountered", true), ("The following warnings were encountered", false)];

/// Listed errors of form: nothing is missing.
const FORM: [&str; 17] = [
    "no header detected",
    "header lacks a version number",
    "content stream lacks endstream",
    "missing white space after number",
    "object lacks an endobj",
    "Incorrect /Length for stream object",
    "Page object doe snot have /Page type",
    "Page object does not have /Page type",
    "A dictionary is missing a required /Type key.",
    "object lacks a required Subtype",
    "stream inherited a resource",
    "Group attributes dictionary is missing /CS",
    "Image has both ImageMask and ColorSpace keys.",
    "Definition of a name is a reference to itself",
    "page tree root node /Count did not match the actual number of pages in the tree.",
    "An annotation has an invalid named destination",
    "Error setting a halftone",
];

/// Listed warnings that mean that what has the pattern is not drawn.
const PATTERN: [&str; 2] = ["error in pattern", "error in shading"];

/// Listed warnings that mean that something else is not drawn.
const MISSING: [&str; 5] = [
    "recoverable image error",
    "error in Mask",
    "error in annotation Appearance",
    "error in annotation",
    "Couldn't find a named resource",
];

/// What is said at once of parts that the document names but does not have.
const UNNAMED: &str = "Couldn't find named resource";

/// What is said of a document with more spot colours than have plates.
const SPOTS: &str = "Max spot colorants reached";

/// A note on a document that the older interpreter draws.
pub const OLDER: &str = "the document has gradients that this version of Ghostscript leaves out, so its older interpreter draws \
    them; it draws some, such as narrow stripes, wrong or not at all; where it does, save the page as a \
    picture (PNG) and print that";

/// What the decoder of JBIG2 says of a picture that it gives up.
const JBIG2: &str = "jbig2dec FATAL ERROR";

/// The families that every reader has a stand-in for: those of the standard.
const STANDARD: [&str; 5] = ["Helvetica", "Times", "Courier", "Symbol", "ZapfDingbats"];

/// The most fonts that a note names, so that it stays a few lines.
const FONTS: usize = 8;

/// The longest quote, in characters, so that it stays a line or two.
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

/// That a page has a size that no page has, if Ghostscript fails for that.
#[must_use]
pub fn impossible_size(why: &str) -> Option<String> {
    let sides = why.split_once("/PageSize [")?.1.split_once(']')?.0;
    let mm: Vec<f64> = sides
        .split_whitespace()
        .map(|side| side.parse::<f64>().ok().map(|points| points * 25.4 / 72.0))
        .collect::<Option<_>>()?;
    let [width, length] = mm[..] else { return None };
    Some(format!(
        "a page of it is {width:.1} x {length:.1} mm, which cannot be drawn; give it a size such as \
         210 x 297 mm"
    ))
}

/// How many pages a document has that has not the page that was asked for.
fn pages(said: &str) -> Option<u32> {
    said.split_once(BEYOND)?.1.lines().next()?.rsplit(' ').next()?.parse().ok()
}

/// What Ghostscript complains of.
#[derive(Default)]
struct Complaints<'a> {
    /// The first that means that a pattern is missing.
    pattern: Option<&'a str>,
    /// The first other.
    other: Option<&'a str>,
}

impl Complaints<'_> {
    fn of(said: &str) -> Complaints<'_> {
        let (mut found, mut list) = (Complaints::default(), None);
        for line in said.lines() {
            let item = line.strip_prefix('\t').map(str::trim);
            list = match (item, LISTS.iter().find(|(start, _)| line.starts_with(start))) {
                (None, begun) => begun.map(|&(_, errors)| errors),
                (Some(_), _) => list,
            };
            match (item, list) {
                (Some(item), Some(errors)) => {
                    let pattern = !errors && PATTERN.contains(&item);
                    let other = if errors { !FORM.contains(&item) } else { MISSING.contains(&item) };
                    found.pattern = found.pattern.or(Some(item).filter(|_| pattern));
                    found.other = found.other.or(Some(item).filter(|_| other));
                }
                _ if line.starts_with(UNNAMED) => found.other = found.other.or(Some(UNNAMED)),
                _ if line.starts_with(JBIG2) => found.other = found.other.or(Some(line)),
                _ => {
                    let error = line.split_once("**** Error").map(|(_, text)| text);
                    let error = error.filter(|text| text.starts_with([':', ' ']));
                    found.other = found.other.or(error.map(|text| text.trim_start_matches([':', ' '])));
                }
            }
        }
        found
    }
}

/// A note on fonts that were replaced because neither the document nor the computer has them.
#[must_use]
pub fn replaced_fonts(said: &str) -> Option<String> {
    let mut found: Vec<String> = Vec::new();
    let mut count = 0;
    for (font, stand_in) in said.lines().filter_map(replaced) {
        let named =
            quote(font.split_once('+').filter(|(tag, _)| tag.len() == 6).map_or(font, |(_, name)| name));
        let letters =
            |name: &str| name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
        let family = named.split('-').next().unwrap_or_default();
        if STANDARD.contains(&family) || stand_in.is_some_and(|other| letters(other) == letters(&named)) {
            continue;
        }
        let stand_in = stand_in.map_or(String::new(), |other| format!(" (drawn in {})", quote(other)));
        let text = format!("{named}{stand_in}");
        let known = |part: &String| {
            *part == text || part.strip_prefix(&named).is_some_and(|rest| rest.starts_with(" ("))
        };
        if !found.iter().any(known) {
            count += 1;
            if found.len() < FONTS {
                found.push(text);
            }
        }
    }
    if count > found.len() {
        found.push(format!("and {} more", count - found.len()));
    }
    (count > 0).then(|| {
        format!(
            "text is not drawn in its font, because neither the document nor this computer has it: {}; embed the font, or convert the \
             text to paths",
            found.join(", ")
        )
    })
}

/// The font that a line says was replaced, and what with.
fn replaced(line: &str) -> Option<(&str, Option<&str>)> {
    if let Some(font) = line.strip_prefix("%%NoFont: ") {
        return Some((font.trim(), None));
    }
    if let Some(rest) = line.strip_prefix("Substituting font ") {
        let (stand_in, font) = rest.split_once(" for ")?;
        return Some((font.trim_end_matches('.'), Some(stand_in)));
    }
    let rest = line.strip_prefix("Loading font ").or_else(|| line.strip_prefix("Loading CIDFont "))?;
    let (font, file) =
        rest.split_once(" (or substitute) from ").or_else(|| rest.split_once(" substitute from "))?;
    let name = file.rsplit(['/', '\\']).next()?;
    Some((font, Some(name.rsplit_once('.').map_or(name, |(stem, _)| stem))))
}

/// A complaint as it may be quoted.
fn quote(complaint: &str) -> String {
    let quote: String = complaint.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    quote.trim().trim_end_matches('.').to_owned()
}

/// The first thing that Ghostscript complains of.
fn complaint(said: &str) -> Option<String> {
    let found = Complaints::of(said);
    found.other.or(found.pattern).map(quote)
}

/// Whether a pattern of a document was not drawn.
pub(super) fn lacks_pattern(said: &str) -> bool {
    Complaints::of(said).pattern.is_some()
}

/// Whether the older interpreter draws more of a document than the usual one, which left out a pattern: it draws the pattern,
/// and has a complaint only if the usual one has another as well.
pub(super) fn is_better(older: &str, usual: &str) -> bool {
    let (older, usual) = (Complaints::of(older), Complaints::of(usual));
    older.pattern.is_none() && (older.other.is_none() || usual.other.is_some())
}

/// A note on a document that was drawn with complaints, if there are any.
#[must_use]
pub fn damaged(said: &str) -> Option<String> {
    let found = Complaints::of(said);
    let pattern = found.pattern.map(|complaint| {
        format!(
            "part of the document is missing, because Ghostscript cannot draw it (it says `{}`); save the page as a picture \
             (PNG) and print that, or save the PDF with another program",
            quote(complaint)
        )
    });
    let other = found.other.map(|complaint| {
        format!(
            "the document is damaged (Ghostscript says `{}`), so some of it may be missing",
            quote(complaint)
        )
    });
    let spots = said.contains(SPOTS).then(|| {
        "the document has more than 60 spot colours, and Ghostscript makes process colours of the others, layers of ink \
         among them; leave out colours that the page does not use"
            .into()
    });
    let notes: Vec<String> = other.into_iter().chain(pattern).chain(spots).collect();
    (!notes.is_empty()).then(|| notes.join("; "))
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
        let length = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(length.saturating_sub(END)))?;
        let mut end = Vec::new();
        file.read_to_end(&mut end)?;
        Ok::<_, std::io::Error>(end)
    };
    is_pdf(path).unwrap_or(false) && ends().is_ok_and(|end| !end.windows(9).any(|word| word == b"startxref"))
}

/// Whether a document is PDF.
///
/// # Errors
/// Those of opening it.
pub(super) fn is_pdf(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(super::HEADER as u64).read_to_end(&mut start)?;
    Ok(super::is_pdf(&start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_of_no_size_is_told_with_its_size() {
        let why = "Error: /undefined in --runpdf--; information: [/PageSize [2834645.75 720]]; stack:";
        let said = impossible_size(why).unwrap();
        assert!(said.starts_with("a page of it is 1000000.0 x 254.0 mm, which cannot be drawn"), "{said}");
        for other in ["", "[/PageSize [", "/PageSize [1]", "/PageSize [a b]"] {
            assert_eq!(impossible_size(other), None, "{other}");
        }
    }

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

    /// The end of what Ghostscript 10.00 says of a document with these errors and warnings.
    fn listed(errors: &[&str], warnings: &[&str]) -> String {
        let list = |kind: &str, items: &[&str]| {
            let items: String = items.iter().map(|item| format!("\t{item}\n")).collect();
            match items.as_str() {
                "" => String::new(),
                items => format!(
                    "\nThe following {kind} were encountered at least once while processing this file:\n{items}"
                ),
            }
        };
        format!(
            "Processing pages 1 through 1.\nPage 1\n{}{}\n   **** This file had errors that were repaired or ignored.\n   \
             **** The file was produced by: \n   **** >>>> Skia/PDF m156 <<<<\n   **** Please notify the author of the \
             software that produced this\n",
            list("errors", errors),
            list("warnings", warnings)
        )
    }

    #[test]
    fn what_is_listed_at_the_end_is_noted_if_something_may_be_missing() {
        let noted = |errors: &[&str], warnings: &[&str]| damaged(&listed(errors, warnings));
        let token = noted(&["error executing PDF token"], &[]).unwrap();
        assert!(token.contains("is damaged (Ghostscript says `error executing PDF token`)"), "{token}");
        let pattern = noted(&[], &["garbage left on stack", "error in pattern"]).unwrap();
        assert!(
            pattern.starts_with("part of the document is missing") && pattern.contains("`error in pattern`")
        );
        let both = noted(&["PDF file was repaired"], &["error in pattern"]).unwrap();
        assert!(both.contains("`PDF file was repaired`") && both.contains("`error in pattern`"), "{both}");
        assert!(noted(&[], &["error in Mask"]).unwrap().contains("is damaged"));
        for (errors, warnings) in [
            (&["missing white space after number"][..], &[][..]),
            (&[], &["invalid operator used in text block", "encountered more Q than q"]),
            (&["object lacks an endobj"], &["badly escaped name"]),
        ] {
            assert_eq!(noted(errors, warnings), None, "{errors:?} {warnings:?}");
        }
        let named = damaged("Page 1\nCouldn't find named resource\nCouldn't find named resource\n").unwrap();
        assert!(named.contains("`Couldn't find named resource`"), "{named}");
        let old = damaged("   **** Error 'gs' ignored -- ExtGState missing from Resources.\n").unwrap();
        assert!(old.contains("`'gs' ignored -- ExtGState missing from Resources`"), "{old}");
        // The older interpreter always says this, and titles may say anything.
        assert_eq!(
            damaged("   **** Warning: You are using the legacy PDF interpreter (-dNEWPDF=false)\n"),
            None
        );
        assert_eq!(damaged("   **** >>>> The following errors were encountered <<<<\n\tx\n"), None);
    }

    #[test]
    fn the_older_interpreter_is_better_if_it_draws_the_pattern_and_loses_nothing_else() {
        let usual = listed(&[], &["error in pattern"]);
        let torn = listed(&["error executing PDF token"], &["error in pattern"]);
        let error = "   **** Error: Unable to determine object number for Im9 so ignoring it\n";
        assert!(lacks_pattern(&usual) && !lacks_pattern(&listed(&["malformed number"], &[])));
        assert!(is_better("noise", &usual) && is_better("noise", &torn) && is_better(error, &torn));
        // As versions answer that have one interpreter only.
        assert!(!is_better(error, &usual) && !is_better(&usual, &usual));
    }

    #[test]
    fn fonts_that_were_replaced_are_named_once_and_those_of_the_standard_are_not() {
        let said = "Page 1\nLoading font EurostileBold (or substitute) from /usr/share/gs/Font/NimbusSans-Regular\n\
            Loading CIDFont MS-Gothic substitute from /usr/share/gs/CIDFSubst/DroidSansFallback.ttf\n\
            Loading font ABCDEF+EurostileBold (or substitute) from /x/NimbusSans-Regular\n\
            Loading font Helvetica-Bold (or substitute) from /x/NimbusSans-Bold\n\
            Loading font Times (or substitute) from /x/NimbusRoman-Regular\n\
            Loading font TimesTen (or substitute) from /x/NimbusRoman-Regular\n\
            Loading font DejaVuSans (or substitute) from /usr/share/fonts/DejaVuSans.ttf\n\
            Substituting font Courier for Moby.\n%%NoFont: NoSuch\n";
        let note = replaced_fonts(said).unwrap();
        assert!(
            note.contains(
                "has it: EurostileBold (drawn in NimbusSans-Regular), MS-Gothic (drawn in DroidSansFallback), TimesTen (drawn in \
                 NimbusRoman-Regular), Moby (drawn in Courier), NoSuch; embed"
            ),
            "{note}"
        );
        assert_eq!(replaced_fonts("Page 1\nLoading font Helvetica (or substitute) from /x/NimbusSans"), None);
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
