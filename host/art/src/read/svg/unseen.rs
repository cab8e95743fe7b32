//! What the renderer leaves out of a drawing without a word, named for its owner.
//!
//! Problem: drawings hold more than the renderer draws: mesh gradients and hatches, clips by CSS shapes, elements of later
//! standards. It leaves them out, and what they fill.
//! Method: what is drawn is compared with what the renderer knows: elements where shapes are drawn, what paints, clips, masks
//! and filters refer to, and clips that refer to nothing. Of the renderer's own tree, tiles of patterns are compared with a dot.
//! Cost: a walk over the elements. Limits: patterns in clips, masks and drawings within the drawing are not looked at.

use std::collections::BTreeSet;
use std::path::Path;

use resvg::tiny_skia::Transform;
use resvg::usvg::{self, roxmltree::Document};

use super::bounds::urls;
use super::nodes::{self, Node};

/// The most parts that a note lists, so that it stays a few lines.
const LISTED: usize = 12;

/// Elements that are known and drawn only where something refers to them, or not at all.
const DEFINED: [&str; 33] = [
    "defs",
    "title",
    "desc",
    "metadata",
    "style",
    "script",
    "clipPath",
    "mask",
    "pattern",
    "marker",
    "symbol",
    "filter",
    "linearGradient",
    "radialGradient",
    "meshgradient",
    "meshGradient",
    "hatch",
    "solidcolor",
    "solidColor",
    "stop",
    "view",
    "cursor",
    "font",
    "font-face",
    "glyph",
    "color-profile",
    "animate",
    "animateTransform",
    "animateMotion",
    "animateColor",
    "set",
    "discard",
    "namedview",
];

/// What a property may refer to.
const TARGETS: [(&str, &[&str]); 5] = [
    ("fill", &["linearGradient", "radialGradient", "pattern"]),
    ("stroke", &["linearGradient", "radialGradient", "pattern"]),
    ("clip-path", &["clipPath"]),
    ("mask", &["mask"]),
    ("filter", &["filter"]),
];

/// A note on what is left out, if anything is.
pub(super) fn note(path: &Path, document: &Document<'_>) -> Option<String> {
    let ids = nodes::by_id(document);
    let mut found: Vec<String> = Vec::new();
    let mut count = 0;
    let mut add = |part: String| {
        if !found.contains(&part) {
            count += 1;
            if found.len() < LISTED {
                found.push(part);
            }
        }
    };
    for node in document.descendants().filter(|node| nodes::name(*node).is_some()) {
        let shown = || !node.ancestors().any(nodes::is_hidden);
        if is_unknown(node) && shown() {
            add(called(node));
        }
        for (property, targets) in TARGETS {
            let Some(value) = nodes::property(node, property) else { continue };
            match urls(value).next() {
                Some(id) => match ids.get(id) {
                    Some(target) if nodes::name(*target).is_some_and(|name| targets.contains(&name)) => {}
                    Some(target) if shown() => add(called(*target)),
                    // Paint has a stand-in for what is missing.
                    None if shown() && value.trim_end().ends_with(')') => {
                        add(format!("the {property} of {} (it has no `{id}`)", called(node)));
                    }
                    _ => {}
                },
                None if property == "clip-path" && value.contains('(') && shown() => {
                    add(format!("the clip of {} by `{value}`", called(node)));
                }
                None => {}
            }
        }
    }
    if count > found.len() {
        found.push(format!("and {} more", count - found.len()));
    }
    (count > 0).then(|| {
        format!(
            "{}: cannot be drawn and is left out: {}; convert it to paths or to a picture in the drawing program, or \
             export the drawing as PNG",
            path.display(),
            found.join(", ")
        )
    })
}

/// A note on patterns whose tiles are so small at this scale that the renderer has no dot for them.
pub(super) fn vanished(path: &Path, tree: &usvg::Tree, scale: Transform) -> Option<String> {
    let mut found = BTreeSet::new();
    tiles(tree.root(), scale, &mut found);
    let more = found.len().saturating_sub(LISTED);
    let names: Vec<String> = found.into_iter().take(LISTED).map(|id| format!("`{id}`")).collect();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!names.is_empty()).then(|| {
        format!(
            "{}: nothing is drawn with the pattern {}{more}, whose tile is smaller than a dot; make the tile larger, or use a \
             plain colour",
            path.display(),
            names.join(", ")
        )
    })
}

/// Gathers the patterns of a group that vanish.
fn tiles<'a>(group: &'a usvg::Group, scale: Transform, found: &mut BTreeSet<&'a str>) {
    let scale = scale.pre_concat(group.transform());
    for node in group.children() {
        match node {
            usvg::Node::Group(inner) => tiles(inner, scale, found),
            usvg::Node::Text(text) => tiles(text.flattened(), scale, found),
            usvg::Node::Image(_) => {}
            usvg::Node::Path(shape) => {
                let (fill, stroke) =
                    (shape.fill().map(usvg::Fill::paint), shape.stroke().map(usvg::Stroke::paint));
                for paint in [fill, stroke].into_iter().flatten() {
                    let usvg::Paint::Pattern(pattern) = paint else { continue };
                    let (sx, sy) = scale.pre_concat(pattern.transform()).get_scale();
                    // The renderer rounds a tile to dots.
                    if (pattern.rect().width() * sx).min(pattern.rect().height() * sy) < 0.5 {
                        found.insert(pattern.id());
                    } else {
                        tiles(pattern.root(), Transform::from_scale(sx, sy), found);
                    }
                }
            }
        }
    }
}

/// Whether an element is drawn where it stands in other programs only.
fn is_unknown(node: Node<'_, '_>) -> bool {
    let name = nodes::name(node).unwrap_or_default();
    let parent = node.parent_element();
    parent.is_some_and(nodes::is_holder) && !nodes::is_drawn(node) && !DEFINED.contains(&name)
}

/// An element as a note names it.
pub(super) fn called(node: Node<'_, '_>) -> String {
    let kind = match nodes::name(node).unwrap_or_default() {
        "meshgradient" | "meshGradient" => "mesh gradient",
        "g" => "group",
        other => other,
    };
    match node.attribute("id") {
        Some(id) => format!("{kind} `{id}`"),
        None => kind.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_renderer_does_not_draw_is_named_and_what_it_draws_is_not() {
        let noted = |inside: &str| {
            let text = format!("<svg xmlns='http://www.w3.org/2000/svg' xmlns:x='urn:x'>{inside}</svg>");
            note(Path::new("a.svg"), &Document::parse(&text).unwrap())
        };
        for (inside, words) in [
            ("<defs><meshgradient id='m'/></defs><rect fill='url(#m)'/>", "left out: mesh gradient `m`;"),
            (
                "<defs><hatch id='h'/></defs><rect style='stroke:url(#h)'/><rect fill='url(#h)'/>",
                ": hatch `h`;",
            ),
            ("<solidColor id='s'/><rect style='fill:url(#s)'/>", ": solidColor `s`;"),
            ("<g><video id='v'/></g>", ": video `v`;"),
            ("<rect clip-path='circle(5px)' id='r'/>", "the clip of rect `r` by `circle(5px)`;"),
            ("<g mask='url(#gone)'/>", "the mask of group (it has no `gone`);"),
            ("<rect id='r' filter='url(#r)'/>", "left out: rect `r`;"),
        ] {
            let said = noted(inside).unwrap();
            assert!(said.contains(words), "{inside}: {said}");
        }
        let many: String = (0..20).map(|i| format!("<video id='v{i}'/>")).collect();
        assert!(noted(&many).unwrap().contains("`v11`, and 8 more;"));
        for inside in [
            "<linearGradient id='l'/><pattern id='p'/><rect fill='url(#l)' stroke='url(\"#p\") red'/>",
            "<clipPath id='c'><rect/></clipPath><g clip-path='url(#c)'><text>a<tspan/></text></g><x:mesh/>",
            "<rect fill='url(#gone) #000'/><rect filter='blur(2px)' clip-path='none'/><metadata/><style>a{}</style>",
            "<meshgradient id='m'/><g style='display:none'><video/><rect fill='url(#m)'/></g>",
        ] {
            assert_eq!(noted(inside), None, "{inside}");
        }
    }
}
