//! How large a drawing is on paper: what its first element states, and what its program meant by it.
//!
//! Problem: drawings state their size in millimetres, in pixels, as `100%`, or by a view box alone. A pixel is 1/96 inch by
//! the standard, but programs write the pixels of their own documents.
//! Method: a length with a unit of length is the size. For all others the maker's mark tells how many units an inch has; the
//! size is then an assumption, which a note states. Cost: a look at the first element and the comments before it.
//! Limits: Affinity writes the resolution of a document nowhere, so that of its documents for print is taken.
//! Source: CSS 2.1 section 4.3.2 (96 px an inch); files of the programs: Illustrator has 72 px an inch, Inkscape had 90 up to
//! 0.91 (its release notes of 0.92), Affinity's documents for print have 300.

use super::nodes::{self, Node};
use crate::read::size::Units;

/// Units of length that have a size on paper.
const ABSOLUTE: [&str; 5] = ["mm", "cm", "in", "pt", "pc"];

const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";
pub(super) const AFFINITY: &str = "http://www.serif.com/";

/// How many pixels of the standard an inch has. Source: CSS Values and Units 3, absolute lengths.
const CSS: f64 = 96.0;

/// The measure of a drawing.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Measure {
    /// Pixels in an inch, by which its program and so the renderer convert lengths.
    pub per_inch: f64,
    /// What has to be assumed if the drawing states no size on paper.
    pub assumed: Option<Units>,
}

/// The measure of the drawing with this first element.
pub(super) fn measure(root: Node<'_, '_>) -> Measure {
    let maker = maker(root);
    Measure { per_inch: maker.css, assumed: (!is_stated(root)).then_some(maker.units) }
}

struct Maker {
    css: f64,
    units: Units,
}

fn maker(root: Node<'_, '_>) -> Maker {
    let of = |css, per_inch, why| Maker { css, units: Units { per_inch, why } };
    // The last program that saved it counts: Inkscape keeps the comments of others.
    if let Some(version) = root.attribute((INKSCAPE, "version")) {
        let mut numbers = version.split(|c: char| !c.is_ascii_digit()).map(str::parse::<u32>);
        let mut number = || numbers.next().and_then(Result::ok).unwrap_or_default();
        return match (number(), number()) {
            (0, ..92) => of(90.0, 90.0, ", as Inkscape wrote before 0.92"),
            _ => of(CSS, CSS, ", as Inkscape writes"),
        };
    }
    if root.namespaces().any(|space| space.uri() == AFFINITY) {
        return of(CSS, 300.0, ", as Affinity's documents for print have");
    }
    let document = root.document().root();
    let mut comments = document.children().chain(root.children()).filter(Node::is_comment);
    if comments.any(|comment| comment.text().unwrap_or_default().contains("Adobe Illustrator")) {
        return of(72.0, 72.0, ", as Illustrator writes");
    }
    of(CSS, CSS, "")
}

/// Whether the first element states a size on paper. A side that is missing follows from the other and the view box.
fn is_stated(root: Node<'_, '_>) -> bool {
    debug_assert_eq!(nodes::name(root), Some("svg"));
    let absolute = |side| {
        let length = root.attribute(side)?.trim();
        Some(ABSOLUTE.iter().any(|unit| length.to_ascii_lowercase().ends_with(unit)))
    };
    absolute("width").or_else(|| absolute("height")).unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::super::parsed;
    use super::*;
    use std::path::Path;

    #[test]
    fn the_marks_of_programs_tell_their_pixels() {
        const SPACES: &str = "xmlns=\"http://www.w3.org/2000/svg\" \
            xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\"";
        let ai = "<!-- Generator: Adobe Illustrator 27.0.0, SVG Export Plug-In . -->";
        for (before, attributes, inside, css, assumed) in [
            ("", "width='40mm' height='20mm'", "", 96.0, None),
            ("", "height='20MM' viewBox='0 0 2 1'", "", 96.0, None),
            (ai, "width='3in' height='2in'", "", 72.0, None),
            (ai, "width='113.39px' height='56.69px'", "", 72.0, Some(72.0)),
            ("", "viewBox='0 0 113.39 56.69'", ai, 72.0, Some(72.0)),
            (ai, "viewBox='0 0 9 9' inkscape:version='1.3 (0e150ed)'", "", 96.0, Some(96.0)),
            ("", "width='141.73' height='9' inkscape:version='0.91 r13725'", "", 90.0, Some(90.0)),
            ("", "width='40mm' inkscape:version='0.48.4 r9939'", "", 90.0, None),
            ("", "width='141' inkscape:version='0.92.4 (5da689c313)'", "", 96.0, Some(96.0)),
            ("", "width='100%' viewBox='0 0 9 9' xmlns:serif='http://www.serif.com/'", "", 96.0, Some(300.0)),
            ("", "width='60mm' xmlns:serif='http://www.serif.com/'", "", 96.0, None),
            ("<!-- a drawing -->", "width='9' height='9'", "", 96.0, Some(96.0)),
        ] {
            let text = format!("{before}<svg {SPACES} {attributes}>{inside}</svg>");
            let document = parsed(Path::new("a.svg"), &text).unwrap();
            let found = measure(document.root_element());
            assert_eq!((found.per_inch, found.assumed.map(|units| units.per_inch)), (css, assumed), "{text}");
        }
    }
}
