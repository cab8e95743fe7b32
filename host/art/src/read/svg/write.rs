//! A drawing as text again, with parts of it hidden or changed.
//!
//! Problem: the renderer takes whole drawings, and a layer must be rendered within the clips, masks and transforms around
//! it.
//! Method: the parsed drawing is written without prefixes, entities and foreign elements. What is not to be drawn lies in a
//! group that is not displayed, so clones of it and definitions in it stay valid. Embedded data that cannot be decoded is
//! written as an empty picture, because the renderer reports neither, but asks for the latter. The standard allows no group
//! in a clip path, and the renderer then draws nothing; Inkscape writes and shows them, so they are written as the shapes in
//! them. Cost: the size of the text. Limits: style rules that ask for the parent of a hidden element (`svg > g`) do not apply
//! to its clones; groups in a clip path that are clipped themselves stay groups.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::rc::Rc;

use data_url::DataUrl;

use super::nodes::{self, Node};

const SVG: &str = "http://www.w3.org/2000/svg";
const XLINK: &str = "http://www.w3.org/1999/xlink";
const XML: &str = "http://www.w3.org/XML/1998/namespace";

/// What to do with an element.
pub(super) enum Way {
    /// Write it as it is.
    Keep,
    /// Keep it from being drawn.
    Hide,
    /// Write it with these attributes in place of its own.
    With(Vec<(&'static str, String)>),
}

impl Way {
    /// Both ways of writing an element; styles are joined.
    pub fn and(self, other: Way) -> Way {
        match (self, other) {
            (Way::Hide, _) | (_, Way::Hide) => Way::Hide,
            (Way::Keep, way) | (way, Way::Keep) => way,
            (Way::With(mut all), Way::With(more)) => {
                for (name, value) in more {
                    match all.iter_mut().find(|(known, _)| *known == name && name == "style") {
                        Some((_, style)) => *style = format!("{};{value}", style.trim_end_matches(';')),
                        None => all.push((name, value)),
                    }
                }
                Way::With(all)
            }
        }
    }
}

/// The most elements that are written for clones of groups in clip paths: a drawing can clone clones without end.
const MOST_CLONED: usize = 1 << 14;

/// Elements by their identifiers, once they are asked for.
type Ids<'a> = OnceCell<HashMap<&'a str, Node<'a, 'a>>>;

/// What the groups around a shape in a clip path say of it.
#[derive(Default)]
struct Around {
    transform: String,
    clip_rule: Option<String>,
}

impl Around {
    /// With what a group or a clone says.
    fn with(&self, node: Node<'_, '_>) -> Around {
        let moved = |name| node.attribute(name).unwrap_or("0");
        let shift = match nodes::name(node) {
            Some("use") => format!("translate({},{})", moved("x"), moved("y")),
            _ => String::new(),
        };
        let transform = [&self.transform, node.attribute("transform").unwrap_or_default(), &shift].join(" ");
        let own = nodes::property(node, "clip-rule").map(str::to_owned);
        Around { transform, clip_rule: own.or_else(|| self.clip_rule.clone()) }
    }

    /// The attributes of a shape.
    fn of(&self, shape: Node<'_, '_>) -> Vec<(&'static str, String)> {
        let own = shape.attribute("transform").unwrap_or_default();
        let rule = self.clip_rule.as_ref().filter(|_| nodes::property(shape, "clip-rule").is_none());
        let transform = ("transform", format!("{} {own}", self.transform));
        [Some(transform), rule.map(|rule| ("clip-rule", rule.clone()))].into_iter().flatten().collect()
    }
}

/// The group that an element in a clip path is or clones.
fn group_in_clip<'a>(node: Node<'a, 'a>, ids: &Ids<'a>) -> Option<Node<'a, 'a>> {
    let free = |node: Node<'_, '_>| {
        ["clip-path", "mask", "filter"].iter().all(|name| nodes::property(node, name).is_none())
    };
    let target = match nodes::name(node)? {
        "use" => *ids.get_or_init(|| nodes::by_id(node.document())).get(nodes::reference(node)?)?,
        _ => node,
    };
    (matches!(nodes::name(target), Some("g" | "symbol" | "a" | "svg")) && free(node) && free(target))
        .then_some(target)
}

/// Writes a drawing; `way` is asked for each element, parents first.
pub(super) fn written<'a>(root: Node<'a, 'a>, mut way: impl FnMut(Node<'a, 'a>) -> Way) -> String {
    enum Step<'a> {
        Open(Node<'a, 'a>),
        /// A part of a clip path, and what is around it there.
        Clip(Node<'a, 'a>, Rc<Around>),
        Close(&'a str),
    }
    let mut out = String::new();
    let mut steps = vec![Step::Open(root)];
    let (mut cloned, ids) = (0, Ids::default());
    while let Some(step) = steps.pop() {
        let (node, around) = match step {
            Step::Close(name) => {
                out.extend(["</", name, ">"]);
                continue;
            }
            Step::Open(node) if node.is_text() => {
                escape(&mut out, node.text().unwrap_or_default(), false);
                continue;
            }
            Step::Open(node) => (node, None),
            Step::Clip(node, around) => match group_in_clip(node, &ids).filter(|_| cloned < MOST_CLONED) {
                Some(_) if nodes::is_hidden(node) => continue,
                Some(group) => {
                    let mut around = around.with(node);
                    if group != node {
                        around = around.with(group);
                    }
                    let (around, first) = (Rc::new(around), steps.len());
                    let shapes = group.children().filter(|child| nodes::is_drawn(*child));
                    steps.extend(shapes.map(|child| Step::Clip(child, around.clone())));
                    cloned += steps.len() - first + 1;
                    steps[first..].reverse();
                    continue;
                }
                None => (node, Some(around)),
            },
        };
        let Some(name) = nodes::name(node) else { continue };
        // The renderer takes the first child whose conditions hold; only that child is kept, see below.
        let name = if name == "switch" { "g" } else { name };
        let unchosen = node.parent_element().is_some_and(|parent| {
            nodes::name(parent) == Some("switch")
                && nodes::is_drawn(node)
                && nodes::chosen(parent) != Some(node)
        });
        let way = match (way(node), around) {
            (Way::Keep, Some(around)) if !around.transform.is_empty() => Way::With(around.of(node)),
            (way, _) => way,
        };
        if unchosen || matches!(way, Way::Hide) {
            out.push_str("<g display=\"none\">");
            steps.push(Step::Close("g"));
        }
        out.extend(["<", name]);
        if node == root {
            out.push_str(&format!(" xmlns=\"{SVG}\" xmlns:xlink=\"{XLINK}\""));
        }
        let changed: &[(&str, String)] = if let Way::With(changed) = &way { changed } else { &[] };
        for (name, value) in changed {
            attribute(&mut out, "", name, value);
        }
        for own in node.attributes() {
            let prefix = match own.namespace() {
                None => "",
                Some(SVG) if !node.has_attribute(own.name()) => "",
                Some(XLINK) => "xlink:",
                Some(XML) => "xml:",
                _ => continue,
            };
            if !prefix.is_empty() || changed.iter().all(|(name, _)| *name != own.name()) {
                attribute(&mut out, prefix, own.name(), decodable(own.name(), own.value()));
            }
        }
        out.push('>');
        steps.push(Step::Close(name));
        let first = steps.len();
        if name == "clipPath" {
            let around = Rc::new(Around::default());
            steps.extend(node.children().map(|child| Step::Clip(child, around.clone())));
        } else {
            steps.extend(node.children().map(Step::Open));
        }
        steps[first..].reverse();
    }
    out
}

/// An attribute's value, or a picture of no bytes in place of data that is damaged.
fn decodable<'a>(name: &str, value: &'a str) -> &'a str {
    let damaged = || {
        DataUrl::process(value).is_ok_and(|data| data.decode_to_vec().is_err())
            && value.starts_with("data:image")
    };
    if name == "href" && damaged() { "data:image/png;base64," } else { value }
}

/// Writes an attribute with a space before it.
pub(super) fn attribute(out: &mut String, prefix: &str, name: &str, value: &str) {
    out.extend([" ", prefix, name, "=\""]);
    escape(out, value, true);
    out.push('"');
}

/// Text with the characters that mark up escaped; in attributes also line ends, which parsers replace by spaces.
fn escape(out: &mut String, text: &str, attribute: bool) {
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' if attribute => out.push_str("&quot;"),
            '\t' | '\n' if attribute => out.push_str(if c == '\n' { "&#10;" } else { "&#9;" }),
            '\r' => out.push_str("&#13;"),
            c => out.push(c),
        }
    }
}
