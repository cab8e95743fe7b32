//! Which parts of a drawing are layers of ink, and what is drawn beside them.
//!
//! Problem: programs nest layers in groups, links, switches and drawings, name single shapes after inks, and clone layers.
//! Method: an element is named by its label, such as that of an Inkscape layer or what Affinity and Illustrator write beside an
//! identifier, or else by its identifier; a clone without
//! a name of an ink by what it refers to. A group is a layer if an ink is found in its name, a single element only if the
//! name is that of an ink and nothing else, since programs also name shapes by their colours. An ink within a layer of
//! another ink is a layer of its own. Whatever is drawn in no layer is listed. Cost: a walk over the drawing. Limits:
//! layers within what a clone refers to are not found.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use protocol::ink::Ink;
use resvg::usvg::roxmltree::{Document, NodeId};

use super::nodes::{self, Node};
use super::units::AFFINITY;
use super::write::Way;
use crate::error::{NamedPart, unknown_ink, wrong};
use crate::read::cut_lines;
use crate::read::names::{self, Named};
use observe::Diagnosis;

/// The most layers that are looked for: more than a sheet can have.
const MOST_LAYERS: usize = 64;

/// The most parts that a note lists by name, so that it stays a few lines.
const LISTED: usize = 12;

/// The most letters of a text that a note quotes, so that a dozen of them stay a few lines.
const QUOTED: usize = 24;

/// A layer of ink: one or several elements.
pub(super) struct Layer {
    pub label: String,
    pub named: Named,
    /// Whether it is a group, not a single element.
    group: bool,
    /// Whether all of it is kept from being displayed, as when an owner hides a layer.
    pub hidden: bool,
    /// The least opacity of its elements and what is around them, if they are not opaque.
    pub opacity: Option<f64>,
    /// What its groups lie in.
    beside: HashSet<NodeId>,
    /// Its elements.
    roots: HashSet<NodeId>,
    /// The elements around them.
    around: HashSet<NodeId>,
}

/// What is for a cutter and not printed.
pub(super) type Cuts = HashSet<NodeId>;

/// The layers of a drawing from the bottom up, what of it is for a cutter, and notes on what is left out.
pub(super) fn layers(
    path: &Path,
    document: &Document<'_>,
    notes: &mut Vec<String>,
) -> Result<(Vec<Layer>, Cuts), Diagnosis> {
    let mut layers: Vec<Layer> = Vec::new();
    let mut cuts = Cuts::new();
    let ids = nodes::by_id(document);
    let (mut slips, mut parts) = (Vec::new(), Vec::new());
    // The parser bounds the depth; a stack of its own spares this walk the recursion.
    let mut waiting: Vec<(Node, Option<usize>)> = vec![(document.root_element(), None)];
    while let Some((node, mut within)) = waiting.pop() {
        let top = node == document.root_element();
        if !top && cut_lines::is_cut(&label(node)) {
            if draws(node) {
                notes.push(cut_lines::note(&path.display(), "layer", &label(node)));
            }
            cuts.insert(node.id());
            continue;
        }
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
            // A shape or clone joins the layer of its ink, and so does the sublayer of another object. Of two groups side by side the
            // owner has to say how they lie.
            let parent = node.parent().map(|parent| parent.id());
            let joins = |layer: &Layer| {
                layer.named == named
                    && !(group && parent.is_some_and(|parent| layer.beside.contains(&parent)))
            };
            let at = layers.iter().position(joins).unwrap_or_else(|| {
                let (roots, around) = (HashSet::new(), HashSet::new());
                layers.push(Layer {
                    label,
                    named,
                    group: false,
                    hidden: true,
                    opacity: None,
                    beside: HashSet::new(),
                    roots,
                    around,
                });
                layers.len() - 1
            });
            layers[at].group |= group;
            layers[at].beside.extend(parent.filter(|_| group));
            layers[at].hidden &= node.ancestors().any(nodes::is_hidden);
            let opacity = node.ancestors().filter_map(opacity).fold(1.0, f64::min);
            layers[at].opacity =
                Some(opacity.min(layers[at].opacity.unwrap_or(1.0))).filter(|o| *o > 0.0 && *o < 1.0);
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
        && left_out(path, document, (&layers, &cuts)).is_some()
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
        if let Some(note) = left_out(path, document, (&layers, &cuts)) {
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
    Ok((layers, cuts))
}

impl Layer {
    /// What is for a cutter, as if it were a layer.
    pub(super) fn of_cuts(cuts: &Cuts, document: &Document<'_>) -> Layer {
        let nodes = cuts.iter().filter_map(|id| document.get_node(*id));
        let around = nodes.flat_map(|node| node.ancestors().skip(1)).map(|node| node.id()).collect();
        let named = Named { place: None, ink: Ink::Black };
        let (label, roots) = ("for a cutter".into(), cuts.clone());
        Layer {
            label,
            named,
            group: true,
            hidden: false,
            opacity: None,
            beside: HashSet::new(),
            roots,
            around,
        }
    }
}

/// How to write a drawing so that only this layer is drawn. Owners let layers shine through to see what lies beneath: unless its
/// tones are kept, a layer is opaque, whatever is drawn in it.
pub(super) fn only<'a>(layers: &'a [Layer], at: usize, toned: bool) -> impl FnMut(Node<'_, '_>) -> Way + 'a {
    let layer = &layers[at];
    // What comes first counts, and the renderer takes no empty part of a style.
    let opaque = if toned { "" } else { "opacity:1!important;" };
    // Parents come first, so an element lies in the layer if its parent does.
    let mut within: HashSet<NodeId> = HashSet::new();
    move |node| {
        let id = node.id();
        if node.parent_element().is_none() {
            // The ground of the page is drawn in no layer.
            let own = node.attribute("style").unwrap_or_default();
            let opaque = if opacity(node) == Some(0.0) { "" } else { opaque };
            return Way::With(vec![("style", format!("{opaque}background-color:none!important;{own}"))]);
        }
        let inside = node.parent().is_some_and(|parent| within.contains(&parent.id()));
        let others = layers.iter().enumerate().any(|(i, other)| i != at && other.roots.contains(&id));
        let own = layer.roots.contains(&id);
        if own || inside && !others {
            within.insert(id);
            if !own || toned {
                return Way::Keep;
            }
        }
        // What is not visible at all is hidden by its owner.
        if (own || layer.around.contains(&id) && !toned) && opacity(node) != Some(0.0) {
            let style = node.attribute("style").unwrap_or_default();
            return Way::With(vec![("style", format!("{opaque}{style}"))]);
        }
        let drawn_here = node.parent().is_some_and(|parent| layer.around.contains(&parent.id())) || inside;
        if nodes::is_drawn(node) && drawn_here && !layer.around.contains(&id) {
            return Way::Hide;
        }
        Way::Keep
    }
}

/// What an element says of its opacity, from 0 to 1.
fn opacity(node: Node<'_, '_>) -> Option<f64> {
    let stated = nodes::property(node, "opacity")?;
    let share = match stated.strip_suffix('%') {
        Some(percent) => percent.trim().parse::<f64>().ok()? / 100.0,
        None => stated.parse().ok()?,
    };
    Some(share).filter(|share| (0.0..=1.0).contains(share))
}

/// Whether an element is a layer of Inkscape.
fn is_layer(node: Node<'_, '_>) -> bool {
    node.attributes().any(|a| a.name() == "groupmode" && a.value() == "layer")
}

/// What an element is called.
fn label(node: Node<'_, '_>) -> String {
    let own = |name: &str| node.attributes().find(|a| a.name() == name).map(|a| a.value().to_owned());
    let affinity = || node.attribute((AFFINITY, "id")).map(str::to_owned);
    let id = || node.attribute("id").map(unescaped);
    own("label").or_else(affinity).or_else(|| own("data-name")).or_else(id).unwrap_or_default()
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
fn left_out(path: &Path, document: &Document<'_>, (layers, cuts): (&[Layer], &Cuts)) -> Option<String> {
    let mut named = Vec::new();
    let mut counted: Vec<(&str, usize)> = Vec::new();
    let mut waiting = vec![document.root_element()];
    while let Some(node) = waiting.pop() {
        let id = node.id();
        if layers.iter().any(|layer| layer.roots.contains(&id)) {
            continue;
        }
        if nodes::is_hidden(node) || cuts.contains(&id) {
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
