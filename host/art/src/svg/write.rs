//! A drawing as text again, with parts of it hidden or changed.
//!
//! Problem: the renderer takes whole drawings, and a layer must be rendered within the clips, masks and transforms around
//! it.
//! Method: the parsed drawing is written without prefixes, entities and foreign elements. What is not to be drawn lies in a
//! group that is not displayed, so clones of it and definitions in it stay valid. Embedded data that cannot be decoded is
//! written as an empty picture, because the renderer reports neither, but asks for the latter. Cost: the size of the text. Limits: style
//! rules that ask for the parent of a hidden element (`svg > g`) do not apply to its clones.

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

/// Writes a drawing; `way` is asked for each element, parents first.
pub(super) fn written<'a>(root: Node<'a, 'a>, mut way: impl FnMut(Node<'a, 'a>) -> Way) -> String {
    enum Step<'a> {
        Open(Node<'a, 'a>),
        Close(&'a str),
    }
    let mut out = String::new();
    let mut steps = vec![Step::Open(root)];
    while let Some(step) = steps.pop() {
        let node = match step {
            Step::Close(name) => {
                out.extend(["</", name, ">"]);
                continue;
            }
            Step::Open(node) if node.is_text() => {
                escape(&mut out, node.text().unwrap_or_default(), false);
                continue;
            }
            Step::Open(node) => node,
        };
        let Some(name) = nodes::name(node) else { continue };
        // The renderer takes the first child whose conditions hold; only that child is kept, see below.
        let name = if name == "switch" { "g" } else { name };
        let unchosen = node.parent_element().is_some_and(|parent| {
            nodes::name(parent) == Some("switch")
                && nodes::is_drawn(node)
                && nodes::chosen(parent) != Some(node)
        });
        let way = way(node);
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
        steps.extend(node.children().map(Step::Open));
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

fn attribute(out: &mut String, prefix: &str, name: &str, value: &str) {
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
