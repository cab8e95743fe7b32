//! What the elements of a drawing are: their names, and which of them draw.

use std::collections::HashMap;

use resvg::usvg::roxmltree;

pub(super) use roxmltree::Node;

const SVG: &str = "http://www.w3.org/2000/svg";

/// Elements that hold others and have no picture of their own.
const HOLDERS: [&str; 4] = ["g", "a", "switch", "svg"];

/// Elements that draw something.
const SHAPES: [&str; 10] =
    ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon", "text", "image", "use"];

/// Elements that draw text in other programs, but not in the renderer.
const FLOWED: [&str; 3] = ["foreignObject", "flowRoot", "textArea"];

/// The languages of this computer's user, as far as drawings can ask for them.
const LANGUAGE: &str = "en";

/// The name of an SVG element, without prefix. Drawings without any namespace are understood.
pub(super) fn name<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let tag = node.tag_name();
    (node.is_element() && matches!(tag.namespace(), None | Some(SVG))).then(|| tag.name())
}

fn is_one(node: Node<'_, '_>, names: &[&str]) -> bool {
    name(node).is_some_and(|name| names.contains(&name))
}

/// Whether an element is a group of others.
pub(super) fn is_holder(node: Node<'_, '_>) -> bool {
    is_one(node, &HOLDERS)
}

/// Whether an element is text that the renderer leaves out.
pub(super) fn is_flowed(node: Node<'_, '_>) -> bool {
    is_one(node, &FLOWED)
}

/// Whether an element is drawn where it stands, unlike a definition.
pub(super) fn is_drawn(node: Node<'_, '_>) -> bool {
    is_holder(node) || is_one(node, &SHAPES) || is_flowed(node)
}

/// What an element itself says of a property, in its style or else in an attribute. Style sheets are not looked at.
pub(super) fn property<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let style = node.attribute("style").unwrap_or_default();
    let mut parts = style.split(';').filter_map(|part| part.split_once(':'));
    let own = parts.rfind(|(known, _)| known.trim() == name).map(|(_, value)| value);
    own.or_else(|| node.attribute(name)).map(|value| value.trim().trim_end_matches("!important").trim_end())
}

/// Whether an element says of itself that it is not displayed.
pub(super) fn is_hidden(node: Node<'_, '_>) -> bool {
    property(node, "display") == Some("none")
}

/// The child of a `switch` that is drawn: the first that the renderer can draw and whose conditions hold.
pub(super) fn chosen<'a, 'i>(switch: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    switch.children().find(|&child| {
        let speaks = |languages: &str| {
            languages
                .split(',')
                .any(|language| language.trim().split('-').next().is_some_and(|l| l == LANGUAGE))
        };
        is_drawn(child)
            && !is_flowed(child)
            && !child.has_attribute("requiredExtensions")
            && child.attribute("systemLanguage").is_none_or(speaks)
    })
}

/// The children of an element that are drawn.
pub(super) fn drawn<'a, 'i>(node: Node<'a, 'i>) -> Vec<Node<'a, 'i>> {
    match name(node) {
        Some("switch") => chosen(node).into_iter().collect(),
        _ if is_holder(node) => node.children().filter(|&child| is_drawn(child)).collect(),
        _ => Vec::new(),
    }
}

/// Elements by their identifiers. Of several with one identifier the first counts, as in the renderer.
pub(super) fn by_id<'a, 'i>(document: &'a roxmltree::Document<'i>) -> HashMap<&'a str, Node<'a, 'i>> {
    let mut ids = HashMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    ids
}

/// What an element refers to by `#id`.
pub(super) fn reference<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let xlink = ("http://www.w3.org/1999/xlink", "href");
    node.attribute("href").or_else(|| node.attribute(xlink))?.trim().strip_prefix('#')
}
