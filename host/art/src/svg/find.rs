//! Which parts of a drawing are layers of ink, and what is drawn beside them.
//!
//! Problem: programs nest layers in groups, links, switches and drawings, name single shapes after inks, and clone layers.
//! Method: an element is named by its label, such as that of an Inkscape layer, or else by its identifier; a clone without
//! a name of an ink by what it refers to. A group is a layer if an ink is found in its name, a single element only if the
//! name is that of an ink and nothing else, since programs also name shapes by their colours. An ink within a layer of
//! another ink is a layer of its own. Whatever is drawn in no layer is listed. Cost: a walk over the drawing. Limits:
//! layers within what a clone refers to are not found.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use resvg::usvg::roxmltree::{Document, NodeId};

use super::super::error::{NamedPart, unknown_ink, wrong};
use super::super::names::{self, Named};
use super::nodes::{self, Node};
use super::write::Way;
use observe::Diagnosis;

/// The most layers that are looked for: more than a sheet can have.
const MOST_LAYERS: usize = 64;

/// The most parts that a note lists by name.
const LISTED: usize = 12;

/// The most letters of a text that a note quotes.
const QUOTED: usize = 24;

/// A layer of ink: one or several elements.
pub(super) struct Layer {
    pub label: String,
    pub named: Named,
    /// Whether it is a group, not a single element.
    group: bool,
    /// Whether all of it is kept from being displayed, as when an owner hides a layer.
    pub hidden: bool,
    /// Its elements.
    roots: HashSet<NodeId>,
    /// The elements around them.
    around: HashSet<NodeId>,
}

/// The layers of a drawing from the bottom up, and notes on what is left out.
pub(super) fn layers(
    path: &Path,
    document: &Document<'_>,
    notes: &mut Vec<String>,
) -> Result<Vec<Layer>, Diagnosis> {
    let mut layers: Vec<Layer> = Vec::new();
    // Of several elements with one identifier the first counts, as in the renderer.
    let mut ids: HashMap<&str, Node> = HashMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    let (mut slips, mut parts) = (Vec::new(), Vec::new());
    // The parser bounds the depth; a stack of its own spares this walk the recursion.
    let mut waiting: Vec<(Node, Option<usize>)> = vec![(document.root_element(), None)];
    while let Some((node, mut within)) = waiting.pop() {
        let top = node == document.root_element();
        let found = if top { None } else { ink(node, within.is_some(), &ids) };
        if let Some((label, named)) = found
            && within.is_none_or(|at| layers[at].named.ink != named.ink)
        {
            if let Some(at) = within {
                notes.push(format!(
                    "{}: `{label}` lies within layer `{}`: printed as a layer of its own",
                    path.display(),
                    layers[at].label
                ));
            }
            let group = nodes::is_holder(node);
            // A shape or clone joins the layer of its ink. Of two groups of one ink the owner has to say how they lie.
            let joins = |layer: &Layer| layer.named == named && !(group && layer.group);
            let at = layers.iter().position(joins).unwrap_or_else(|| {
                let (roots, around) = (HashSet::new(), HashSet::new());
                layers.push(Layer { label, named, group: false, hidden: true, roots, around });
                layers.len() - 1
            });
            layers[at].group |= group;
            layers[at].hidden &= node.ancestors().any(nodes::is_hidden);
            layers[at].roots.insert(node.id());
            for around in node.ancestors().skip(1) {
                // What is around this one is known then.
                if !layers[at].around.insert(around.id()) {
                    break;
                }
            }
            if layers.len() > MOST_LAYERS {
                let problem = format!("the drawing has more than {MOST_LAYERS} layers of ink");
                return Err(wrong(path, problem).hint("merge those of one ink"));
            }
            within = Some(at);
        } else if within.is_none() && is_layer(node) {
            slips.push(label(node));
        } else if within.is_none() && parts.len() < LISTED && nodes::is_holder(node) {
            let label = label(node);
            if let Some(named) = names::ink(&label) {
                parts.push(format!("`{label}` (a layer of ink would be `{}`)", named.ink.name()));
            }
        }
        waiting.extend(nodes::drawn(node).into_iter().rev().map(|child| (child, within)));
    }
    if layers.iter().all(|layer| layer.hidden)
        && !layers.is_empty()
        && left_out(path, document, &layers).is_some()
    {
        notes.push(format!(
            "{}: printed as a picture, since all layers named after inks are hidden: {}; to print them as layers, show them in \
             the drawing program",
            path.display(),
            labels(&layers)
        ));
        layers.clear();
    }
    if layers.is_empty() {
        // A drawing may have layers that mean nothing; the name of an ink with a slip of the hand is worth a note.
        let meant =
            |name: &String| names::closest(name).map(|ink| format!("`{name}` (did you mean `{ink}`?)"));
        let found: Vec<String> = slips.iter().filter_map(meant).chain(parts).collect();
        if !found.is_empty() {
            let found = found.join(", ");
            notes.push(format!(
                "{}: printed as a picture, since no layer names an ink: {found}",
                path.display()
            ));
        }
    } else {
        for name in slips {
            if let suggestion @ Some(_) = names::closest(&name) {
                return Err(unknown_ink(path, NamedPart::Layer, &name, suggestion));
            }
        }
        if let Some(note) = left_out(path, document, &layers) {
            notes.push(note);
            notes.extend(shapes_alone(path, &layers));
        }
        for layer in layers.iter().filter(|layer| layer.group && !names::is_whole(&layer.label)) {
            notes.push(format!(
                "{}: layer `{}` is printed in {}, because of its name; a drawing is printed as a picture if no layer is named \
                 after an ink: rename the layer for that",
                path.display(),
                layer.label,
                layer.named.ink.name()
            ));
        }
    }
    notes.extend(flowed(path, document, &layers));
    Ok(layers)
}

/// How to write a drawing so that only this layer is drawn.
pub(super) fn only<'a>(layers: &'a [Layer], at: usize) -> impl FnMut(Node<'_, '_>) -> Way + 'a {
    let layer = &layers[at];
    // Parents come first, so an element lies in the layer if its parent does.
    let mut within: HashSet<NodeId> = HashSet::new();
    move |node| {
        let id = node.id();
        if node.parent_element().is_none() {
            // The ground of the page is drawn in no layer.
            let own = node.attribute("style").unwrap_or_default();
            return Way::With(vec![("style", format!("{own};background-color:none!important"))]);
        }
        let inside = node.parent().is_some_and(|parent| within.contains(&parent.id()));
        let others = layers.iter().enumerate().any(|(i, other)| i != at && other.roots.contains(&id));
        if layer.roots.contains(&id) || inside && !others {
            within.insert(id);
            return Way::Keep;
        }
        let drawn_here = node.parent().is_some_and(|parent| layer.around.contains(&parent.id())) || inside;
        if nodes::is_drawn(node) && drawn_here && !layer.around.contains(&id) {
            return Way::Hide;
        }
        Way::Keep
    }
}

/// Whether an element is a layer of Inkscape.
fn is_layer(node: Node<'_, '_>) -> bool {
    node.attributes().any(|a| a.name() == "groupmode" && a.value() == "layer")
}

/// What an element is called.
fn label(node: Node<'_, '_>) -> String {
    let own = |name: &str| node.attributes().find(|a| a.name() == name).map(|a| a.value().to_owned());
    let id = || node.attribute("id").map(unescaped);
    own("label").or_else(|| own("data-name")).or_else(id).unwrap_or_default()
}

/// An identifier as it was typed: Illustrator writes `_x0020_` for a space and `_x30_` for a digit in front.
fn unescaped(id: &str) -> String {
    let mut out = String::new();
    let mut rest = id;
    while let Some(at) = rest.find("_x") {
        out.push_str(&rest[..at]);
        let code = rest[at + 2..].split_once('_');
        let c = code.and_then(|(code, after)| Some((u32::from_str_radix(code, 16).ok()?, after)));
        match c.and_then(|(code, after)| Some((char::from_u32(code)?, after))) {
            Some((c, after)) => {
                out.push(c);
                rest = after;
            }
            None => {
                out.push_str("_x");
                rest = &rest[at + 2..];
            }
        }
    }
    out + rest
}

/// The ink that an element is named after, and that name.
fn ink(node: Node<'_, '_>, within: bool, ids: &HashMap<&str, Node<'_, '_>>) -> Option<(String, Named)> {
    let own = label(node);
    let named = |label: &str, layer: bool| names::ink(label).filter(|_| layer || names::is_whole(label));
    if let Some(named) = named(&own, is_layer(node)) {
        return Some((own, named));
    }
    // Within a layer a clone of another layer is art like any other.
    let target = *ids.get(nodes::reference(node).filter(|_| !within && nodes::name(node) == Some("use"))?)?;
    let label = label(target);
    let named = named(&label, is_layer(target))?;
    Some((label, named))
}

/// A note on what is drawn beside the layers.
fn left_out(path: &Path, document: &Document<'_>, layers: &[Layer]) -> Option<String> {
    let mut named = Vec::new();
    let mut counted: Vec<(&str, usize)> = Vec::new();
    let mut waiting = vec![document.root_element()];
    while let Some(node) = waiting.pop() {
        let id = node.id();
        if layers.iter().any(|layer| layer.roots.contains(&id)) {
            continue;
        }
        if nodes::is_hidden(node) {
            continue;
        }
        if node == document.root_element() || layers.iter().any(|layer| layer.around.contains(&id)) {
            waiting.extend(nodes::drawn(node).into_iter().rev());
            continue;
        }
        if !draws(node) {
            continue;
        }
        let name = nodes::name(node).unwrap_or_default();
        let called = match name {
            "text" | "foreignObject" | "flowRoot" | "textArea" => quoted(node),
            _ => label(node),
        };
        let kind = if is_layer(node) {
            "layer"
        } else if name == "g" {
            "group"
        } else {
            name
        };
        if called.is_empty() || named.len() == LISTED {
            match counted.iter_mut().find(|(known, _)| *known == kind) {
                Some((_, count)) => *count += 1,
                None => counted.push((kind, 1)),
            }
        } else {
            let meant = names::closest(&called).filter(|_| nodes::is_holder(node));
            let hint = meant.map_or(String::new(), |ink| format!(" (did you mean `{ink}`?)"));
            named.push(format!("{kind} `{called}`{hint}"));
        }
    }
    let further = if named.len() == LISTED { "further " } else { "" };
    named.extend(counted.iter().map(|(kind, count)| format!("{further}{kind} ({count})")));
    (!named.is_empty()).then(|| {
        format!("{}: left out, because it lies in no layer of an ink: {}", path.display(), named.join(", "))
    })
}

/// A note for the owner of a picture of which some shapes happen to have names of inks, which leaves out all others.
fn shapes_alone(path: &Path, layers: &[Layer]) -> Option<String> {
    if layers.iter().any(|layer| layer.group) {
        return None;
    }
    Some(format!(
        "{}: only the shapes named after inks are printed: {}; to print the whole drawing as a picture, rename them, or export \
         it as PNG",
        path.display(),
        labels(layers)
    ))
}

/// The names of layers, quoted.
fn labels(layers: &[Layer]) -> String {
    let labels: Vec<String> = layers.iter().map(|layer| format!("`{}`", layer.label)).collect();
    labels.join(", ")
}

/// Whether an element or something in it draws.
fn draws(node: Node<'_, '_>) -> bool {
    let mut waiting = vec![node];
    while let Some(node) = waiting.pop() {
        if nodes::is_hidden(node) {
            continue;
        }
        if !nodes::is_holder(node) {
            return true;
        }
        waiting.extend(nodes::drawn(node));
    }
    false
}

/// The beginning of a text.
fn quoted(node: Node<'_, '_>) -> String {
    let all: String = node.descendants().filter(Node::is_text).filter_map(|text| text.text()).collect();
    let words = all.split_whitespace().collect::<Vec<_>>().join(" ");
    if words.chars().count() <= QUOTED {
        return words;
    }
    words.chars().take(QUOTED - 1).chain(['…']).collect()
}

/// A note on text in layers that the renderer cannot draw.
fn flowed(path: &Path, document: &Document<'_>, layers: &[Layer]) -> Option<String> {
    let mut found: Vec<String> = Vec::new();
    let mut count = 0;
    let mut waiting = vec![(document.root_element(), layers.is_empty())];
    while let Some((node, within)) = waiting.pop() {
        let within = within || layers.iter().any(|layer| layer.roots.contains(&node.id()));
        if nodes::is_hidden(node) {
            continue;
        }
        if nodes::is_flowed(node) && within {
            count += 1;
            if found.len() < LISTED {
                found.push(format!("`{}`", quoted(node)));
            }
        }
        waiting.extend(nodes::drawn(node).into_iter().rev().map(|child| (child, within)));
    }
    if count > found.len() {
        found.push(format!("and {} more", count - found.len()));
    }
    (count > 0).then(|| {
        format!(
            "{}: flowed text cannot be drawn and is left out: {}; convert it to plain text or to paths",
            path.display(),
            found.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_of_illustrator_are_read_as_they_were_typed() {
        for (id, typed) in [
            ("_x30_1_White", "01_White"),
            ("Gold_x0020_Foil", "Gold Foil"),
            ("_xyz_x", "_xyz_x"),
            ("a_x41_", "aA"),
        ] {
            assert_eq!(unescaped(id), typed);
        }
    }
}
