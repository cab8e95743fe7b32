//! Styles of a drawing, worked out for each element before anything else reads it.
//!
//! Problem: drawings of design programs and of the web say the same thing several times: an attribute, a style, a style sheet,
//! each for another reader. The renderer takes the last, prints in black what it does not understand, and tells nobody.
//! Method: the cascade of CSS. For each element its attributes, the rules that are for it and its own style are read in this
//! order; a value that is not understood ([`values`](super::values)) is dropped, so the one before it counts, and one note lists
//! these. The text of the drawing is changed where that makes a difference: style sheets are gone, a style holds what counts, a
//! transform is an attribute. All else stays as it was written, so that whatever reads the drawing next sees the same as the
//! renderer. Cost: each rule is tried on each element. Limits: an element of an entity that is used twice has one style; a clone
//! has the variables of what it clones.
//! Source: CSS Cascade 4, CSS Variables 1; SVG 2 section 6 for attributes, and section 7 for geometry in styles.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use std::path::Path;

use observe::Diagnosis;
use resvg::usvg::roxmltree::{Document, NodeId};

use super::nodes::{self, Node};
use super::sheets::{self, Declaration};
use super::unseen::called;
use super::values::{self, Value, understood};
use super::write;
use crate::error::wrong;

/// The most parts that a note lists, so that it stays a few lines.
const LISTED: usize = 12;

/// The most letters of a value that a note quotes, so that it stays a line.
const QUOTED: usize = 60;

/// Attributes whose values are looked at.
const ATTRIBUTES: [&str; 10] = [
    "fill",
    "stroke",
    "color",
    "stop-color",
    "flood-color",
    "lighting-color",
    "image-rendering",
    "stroke-width",
    "opacity",
    "transform",
];

/// Properties that become one transform, in the order in which they are applied.
const MOVES: [&str; 4] = ["translate", "rotate", "scale", "transform"];

/// Properties that are attributes of some elements to the renderer.
const GEOMETRY: [(&str, &[&str]); 9] = [
    ("x", &["rect", "image", "use", "svg"]),
    ("y", &["rect", "image", "use", "svg"]),
    ("width", &["rect", "image", "use", "svg"]),
    ("height", &["rect", "image", "use", "svg"]),
    ("cx", &["circle", "ellipse"]),
    ("cy", &["circle", "ellipse"]),
    ("r", &["circle"]),
    ("rx", &["rect", "ellipse"]),
    ("ry", &["rect", "ellipse"]),
];

/// The text of a drawing in which styles hold only what counts, and a note on what is not understood.
///
/// # Errors
/// It expands to more than `most` bytes.
pub(super) fn resolved(
    path: &Path,
    document: &Document<'_>,
    most: u64,
) -> Result<(Option<String>, Option<String>), Diagnosis> {
    let mut unread = Unread::default();
    let own_sheets: Vec<Node> =
        document.descendants().filter(|node| nodes::name(*node) == Some("style") && is_css(*node)).collect();
    let texts: Vec<String> = own_sheets
        .iter()
        .filter(|sheet| match sheet.attribute("media").map(|media| (media, sheets::is_for_print(media))) {
            None | Some((_, Some(true))) => true,
            Some((_, Some(false))) => false,
            Some((media, None)) => {
                unread.add(format!("style sheet for `{}`", quoted(media)));
                false
            }
        })
        .map(|sheet| sheet.children().filter_map(|child| child.text()).collect())
        .collect();
    for linked in
        document.root().children().filter_map(|node| node.pi()).filter(|pi| pi.target == "xml-stylesheet")
    {
        unread.add(format!("linked style sheet `{}`", quoted(linked.value.unwrap_or_default())));
    }
    let plain: Vec<_> = texts.iter().map(|text| sheets::plain(text)).collect();
    let rules = sheets::rules(&plain, |part| unread.add(format!("rule `{}`", quoted(part))));
    let styles: HashMap<NodeId, _> = document
        .descendants()
        .filter_map(|node| Some((node.id(), sheets::plain(node.attribute("style")?))))
        .collect();

    let mut edits = Edits { from: document.root_element().range().start, ..Edits::default() };
    own_sheets.iter().for_each(|sheet| edits.put(sheet.range(), String::new()));
    let mut variables: HashMap<NodeId, Vec<(&str, &str)>> = HashMap::new();
    for node in document.descendants() {
        // Of what moves a drawing, `fill` is something else.
        let still = |name: &&str| !(name.starts_with("animate") || ["set", "style"].contains(name));
        let Some(name) = nodes::name(node).filter(still) else { continue };
        let mut said: Vec<Declaration> = Vec::new();
        rules.iter().filter(|rule| rule.is_for(node)).for_each(|rule| said.extend(&rule.declarations));
        let by_rules = !said.is_empty();
        if let Some(style) = styles.get(&node.id()) {
            said.extend(sheets::declarations(style, &mut |part| unread.add(format!("`{}`", quoted(part)))));
        }
        said.sort_by_key(|declaration| declaration.important);
        let own: Vec<_> =
            said.iter().filter(|d| d.name.starts_with("--")).map(|d| (d.name, d.value)).collect();
        if !own.is_empty() {
            variables.insert(node.id(), own);
        }
        let variable = |name: &str| {
            let known = |of: Node<'_, '_>| {
                variables.get(&of.id())?.iter().rfind(|(known, _)| *known == name).map(|(_, value)| *value)
            };
            node.ancestors().find_map(known)
        };
        let (mut element, mut dropped) = (Styled::default(), Vec::new());
        for attribute in
            node.attributes().filter(|a| a.namespace().is_none() && ATTRIBUTES.contains(&a.name()))
        {
            let (property, value) = (attribute.name(), attribute.value());
            match understood(property, value, &variable) {
                // The renderer knows its values from styles only.
                Some(Value::Plain(plain)) if property == "image-rendering" => {
                    element.say(property, Some(plain), true);
                    element.attributes.push((property, None));
                }
                Some(Value::Plain(plain) | Value::Wide(plain)) => {
                    element.known.insert(property, plain.clone());
                    if plain != value {
                        element.attributes.push((property, Some(plain)));
                    }
                }
                Some(Value::Unset) => element.attributes.push((property, None)),
                None => {
                    element.attributes.push((property, None));
                    dropped.push((property, value));
                }
            }
        }
        for Declaration { name: property, value, .. } in &said {
            if property.starts_with("--") {
                element.changed = true;
                continue;
            }
            let geometry = GEOMETRY.iter().find(|(known, _)| known == property);
            if geometry.is_some_and(|(_, of)| {
                !of.contains(&name) || node == document.root_element() || *value == "auto"
            }) {
                continue;
            }
            match understood(property, value, &variable) {
                Some(Value::Wide(_)) if element.known.contains_key(property) => element.changed = true,
                Some(Value::Plain(plain) | Value::Wide(plain)) => match geometry {
                    Some(_) if values::length(&plain) => element.attributes.push((*property, Some(plain))),
                    Some(_) => unread.value(node, property, value, None),
                    None => {
                        let changed = plain != *value || MOVES.contains(property);
                        element.say(property, Some(plain), changed);
                    }
                },
                Some(Value::Unset) => {
                    element.say(property, None, true);
                    element.attributes.push((property, None));
                }
                None => {
                    element.changed = true;
                    unread.value(node, property, value, element.known.get(property));
                }
            }
        }
        for (property, value) in
            dropped.into_iter().filter(|(property, _)| !element.known.contains_key(property))
        {
            unread.value(node, property, value, None);
        }
        element.changed |= by_rules;
        if element.changed || !element.attributes.is_empty() {
            if let Some(reference) = element.box_of_transform() {
                unread.value(node, "transform-box", reference, None);
            }
            element.write(node, &mut edits);
            if edits.added as u64 > most {
                let problem = format!("its style sheets expand to more than {} MB", most >> 20);
                return Err(wrong(path, problem).hint("simplify the drawing, or export it as PNG"));
            }
        }
    }
    if edits.in_entities {
        unread.add("styles of elements that are defined as entities".into());
    }
    Ok((edits.applied(document.input_text()), unread.note(path)))
}

/// Whether a style sheet is one.
fn is_css(sheet: Node<'_, '_>) -> bool {
    matches!(sheet.attribute("type").map(str::trim), None | Some("" | "text/css"))
}

/// What counts of all that is said of an element.
#[derive(Default)]
struct Styled<'a> {
    /// What counts so far.
    known: HashMap<&'a str, String>,
    /// What its style says, in order.
    style: Vec<(&'a str, Option<String>)>,
    /// Attributes that are another or none.
    attributes: Vec<(&'a str, Option<String>)>,
    /// Whether its style is another.
    changed: bool,
}

impl<'a> Styled<'a> {
    fn say(&mut self, property: &'a str, value: Option<String>, changed: bool) {
        match &value {
            Some(value) => self.known.insert(property, value.clone()),
            None => self.known.remove(property),
        };
        self.style.push((property, value));
        self.changed |= changed;
    }

    /// The box that a transform refers to, if it is not that of the drawing.
    fn box_of_transform(&self) -> Option<&str> {
        let reference = self.known.get("transform-box")?;
        let moved = MOVES.iter().any(|property| self.known.contains_key(property));
        (moved && reference != "view-box").then_some(reference)
    }

    /// Changes the text of an element.
    fn write(mut self, node: Node<'_, '_>, edits: &mut Edits) {
        if self.changed {
            let (mut last, mut style) = (HashSet::new(), Vec::new());
            for (property, value) in self.style.iter().rev().filter(|(property, _)| last.insert(*property)) {
                style.extend(
                    value
                        .iter()
                        .filter(|_| !MOVES.contains(property))
                        .map(|value| format!("{property}:{value}")),
                );
            }
            style.reverse();
            self.attributes.push(("style", Some(style.join(";")).filter(|style| !style.is_empty())));
            if MOVES.iter().any(|property| last.contains(property)) {
                let own = node.attribute("transform");
                let of = |property| self.known.get(property).map(String::as_str);
                let moves = MOVES.map(|property| of(property).or(own.filter(|_| property == "transform")));
                let moves: Vec<&str> = moves.into_iter().flatten().filter(|part| !part.is_empty()).collect();
                self.attributes.push(("transform", Some(moves.join(" ")).filter(|moves| !moves.is_empty())));
            }
        }
        let mut added = String::new();
        let last: BTreeMap<&str, Option<String>> = self.attributes.into_iter().collect();
        for (name, value) in last {
            let mut text = String::new();
            value.iter().for_each(|value| write::attribute(&mut text, "", name, value));
            match node.attributes().find(|own| own.namespace().is_none() && own.name() == name) {
                Some(own) => edits.put(own.range(), text.trim_start().to_owned()),
                None => added += &text,
            }
        }
        if !added.is_empty() {
            let (text, start) = (node.document().input_text(), node.range().start + 1);
            let ends = |c: char| c.is_whitespace() || c == '/' || c == '>';
            let at = start + text.get(start..).and_then(|text| text.find(ends)).unwrap_or_default();
            edits.put(at..at, added);
        }
    }
}

/// Changes of a text, by where they begin and end.
#[derive(Default)]
struct Edits {
    all: BTreeMap<(usize, usize), String>,
    /// The bytes of all of them.
    added: usize,
    /// Where the first element begins. What lies before it is quoted in its own way.
    from: usize,
    in_entities: bool,
}

impl Edits {
    fn put(&mut self, range: Range<usize>, text: String) {
        if range.start < self.from {
            self.in_entities = true;
            return;
        }
        self.added += text.len();
        self.all.insert((range.start, range.end), text);
    }

    /// The text with the changes, if there are any.
    fn applied(&self, text: &str) -> Option<String> {
        let mut out = String::with_capacity(text.len() + self.added);
        let mut done = 0;
        for (&(start, end), new) in &self.all {
            // An element within one that is gone.
            let Some(before) = text.get(done..start) else { continue };
            out.extend([before, new]);
            done = end;
        }
        out.push_str(text.get(done..)?);
        (!self.all.is_empty()).then_some(out)
    }
}

/// What is not understood.
#[derive(Default)]
struct Unread {
    found: Vec<String>,
    known: HashSet<String>,
}

impl Unread {
    fn add(&mut self, part: String) {
        if self.known.insert(part.clone()) && self.found.len() < LISTED {
            self.found.push(part);
        }
    }

    /// The value of a property, and what counts in its place.
    fn value(&mut self, node: Node<'_, '_>, property: &str, value: &str, instead: Option<&String>) {
        let what = format!("`{property}:{}`", quoted(value));
        if value.trim().is_empty() || self.known.contains(&what) || node.ancestors().any(nodes::is_hidden) {
            return;
        }
        self.known.insert(what.clone());
        if self.found.len() < LISTED {
            let instead = instead.map_or(String::new(), |value| format!(" (`{}` counts)", quoted(value)));
            self.found.push(format!("{what} of {}{instead}", called(node)));
        }
    }

    fn note(mut self, path: &Path) -> Option<String> {
        let more = self.known.len() - self.found.len();
        if more > 0 {
            self.found.push(format!("and {more} more"));
        }
        (!self.found.is_empty()).then(|| {
            format!(
                "{}: not understood, and printed as if it were not there: {}; use colours such as #aabbcc and transforms in \
                 pixels and degrees, or export the drawing as PNG",
                path.display(),
                self.found.join(", ")
            )
        })
    }
}

/// The start of a text in one line.
fn quoted(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(QUOTED) {
        Some((at, _)) => format!("{}…", &line[..at]),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::super::parsed;
    use super::*;
    use proptest::prelude::*;

    fn resolved(text: &str) -> (Option<String>, Option<String>) {
        super::resolved(Path::new("a.svg"), &parsed(Path::new("a.svg"), text).unwrap(), 1 << 20).unwrap()
    }

    fn drawing(inside: &str) -> String {
        format!("<svg xmlns='http://www.w3.org/2000/svg'>{inside}</svg>")
    }

    #[test]
    fn only_what_counts_is_left_and_all_else_stays_as_it_was() {
        for (inside, wanted) in [
            (
                "<g style=\"fill : red; stroke:Blue\" id='a'/><style/>",
                "<g style=\"fill : red; stroke:Blue\" id='a'/>",
            ),
            ("<style>.a{fill:red;x:1}</style><g class='a'/>", "<g style=\"fill:red\" class='a'/>"),
            ("<g fill='blurple' stroke = 'red'/>", "<g  stroke = 'red'/>"),
            (
                "<g transform='scale(2)' style='rotate:90deg'></g>",
                "<g transform=\"rotate(90) scale(2)\" ></g>",
            ),
            ("<g style='fill:red;fill:unset' fill='blue'/>", "<g  />"),
            ("<animate fill='freeze'/>", "<animate fill='freeze'/>"),
            ("<image image-rendering='pixelated'/>", "<image style=\"image-rendering:pixelated\" />"),
        ] {
            let found = resolved(&drawing(inside)).0.unwrap_or(drawing(inside));
            let plain = |text: &str| text.replace("  ", " ").replace(" />", "/>").replace(" >", ">");
            assert_eq!(plain(&found), plain(&drawing(wanted)), "{inside}");
        }
        let entities = "<!DOCTYPE svg [<!ENTITY s \"fill:var(--a, red)\"><!ENTITY e \"<g style='&s;'/>\">]>";
        let (text, note) = resolved(&format!("{entities}{}", drawing("<rect style='&s;'/>&e;")));
        assert!(text.unwrap().ends_with("<rect style=\"fill:red\"/>&e;</svg>"));
        assert!(note.unwrap().contains("styles of elements that are defined as entities"));
    }

    #[test]
    fn styles_without_end_are_refused() {
        let text = drawing(&format!("<style>*{{filter:{}}}</style>{}", "x".repeat(9000), "<g/>".repeat(200)));
        let error =
            super::resolved(Path::new("a.svg"), &Document::parse(&text).unwrap(), 1 << 20).unwrap_err();
        assert!(error.to_string().contains("style sheets expand to more than 1 MB"));
    }

    proptest! {
        #![proptest_config(testing::cases(300))]
        #[test]
        fn what_is_resolved_is_a_drawing_and_stays_as_it_is(
            parts in proptest::collection::vec(0usize..30, 0..40),
            cut in 0usize..40,
        ) {
            const PARTS: [&str; 30] = [
                "{", "}", "(", ")", ";", ":", ",", "'", "/*", "*/", "\\", "!important", "@media print", ".a", "g", "*", "fill:",
                "stroke:", "transform:", "--v:", "var(--v)", "var(--w,", "light-dark(", "red", "rgb(1 2 3)", "rotate(9deg)",
                "unset;", "ß", " ", "scale:2;",
            ];
            let text = |parts: &[usize]| parts.iter().map(|at| PARTS[*at]).collect::<String>();
            let (sheet, style) = parts.split_at(cut.min(parts.len()));
            let inside = format!(
                "<style>{}</style><g class='a' fill=\"{}\" style=\"{}\"><rect/></g>",
                text(sheet), text(&style[..style.len() / 2]), text(style)
            );
            let first = drawing(&inside);
            let again = resolved(&first).0.unwrap();
            prop_assert!(Document::parse(&again).is_ok(), "{again}");
            prop_assert_eq!(resolved(&again).0, None, "{}", again);
        }
    }
}
