//! Strokes that keep their width however their shape is scaled.
//!
//! Problem: charts and drawings of parts ask for lines of one width at any scale (`vector-effect="non-scaling-stroke"`), which
//! the renderer does not know: it scales them until they cover the art.
//! Method: such shapes are written with a name, and the renderer's tree tells their scale on the page of the drawing. The width
//! and the dashes are then written divided by it. Cost: none for other drawings; for these the tree of the drawing is read
//! once more. Limits: a shape that is scaled differently across and down has one width, by the root of its area; a clone has
//! that of what it clones.
//! Source: SVG 2 section 7.13: the width is in the units of the outermost viewport.

use std::collections::HashMap;

use resvg::usvg::{self, roxmltree::NodeId};

use super::nodes::{self, Node};
use super::write::{Way, written};

/// How each such shape is written, by its node.
pub(super) type Widths = HashMap<NodeId, Vec<(&'static str, String)>>;

/// Whether a shape asks for it.
fn keeps_width(node: Node<'_, '_>) -> bool {
    nodes::property(node, "vector-effect") == Some("non-scaling-stroke")
}

/// The widths of the strokes that keep theirs; `read` reads a drawing.
pub(super) fn widths<'a, E>(
    root: Node<'a, 'a>,
    read: impl FnOnce(&str) -> Result<usvg::Tree, E>,
) -> Result<Widths, E> {
    let shapes: Vec<Node> = root.descendants().filter(|node| keeps_width(*node)).collect();
    if shapes.is_empty() {
        return Ok(Widths::new());
    }
    let own = |node: Node<'_, '_>| format!("foilpress-stroke-{}", node.id().get_usize());
    let named = written(root, |node| match keeps_width(node) {
        true => Way::With(vec![("id", own(node))]),
        false => Way::Keep,
    });
    let tree = read(&named)?;
    let mut widths = Widths::new();
    for shape in shapes {
        let Some(usvg::Node::Path(path)) = tree.node_by_id(&own(shape)) else { continue };
        let Some(stroke) = path.stroke() else { continue };
        let place = path.abs_transform();
        let scale = (place.sx * place.sy - place.kx * place.ky).abs().sqrt();
        if !(scale.is_finite() && scale > 0.0) {
            continue;
        }
        let width = (stroke.width().get() / scale).to_string();
        let mut style = vec![format!("stroke-width:{width}")];
        if let Some(dashes) = stroke.dasharray() {
            let dashes: Vec<String> = dashes.iter().map(|dash| (dash / scale).to_string()).collect();
            style.push(format!("stroke-dasharray:{}", dashes.join(" ")));
            style.push(format!("stroke-dashoffset:{}", stroke.dashoffset() / scale));
        }
        let before = shape.attribute("style").unwrap_or_default();
        // What comes first counts before what the shape and style sheets say.
        let style = style.iter().map(|part| format!("{part}!important")).collect::<Vec<_>>().join(";");
        widths.insert(shape.id(), vec![("style", format!("{style};{before}"))]);
    }
    Ok(widths)
}
