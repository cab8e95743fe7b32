//! What a drawing may ask of the computer.
//!
//! Problem: a drawing of a thousand letters can ask for a tile of a pattern as large as a house, for patterns in patterns in
//! patterns, or for as many clones as there are grains of sand. The renderer has no bounds and ends the program.
//! Method: before the renderer reads it, a walk over the elements and what they refer to tells how deep they lie in each
//! other ([`MOST_DEEP`]) and how many are drawn if all clones, tiles and clips are counted ([`MOST_DRAWN`]). Before it is
//! drawn, a walk over the renderer's own tree adds up the memory of layers, tiles and pictures that exist at the same time.
//! Cost: a look at each element. Limits: filters may take long whatever their number; the time limit of a page ends them.
//! What style sheets refer to is in the styles of the elements by then ([`styles`](super::styles)).
//! Source: `render_layer` and `render_pattern_pixmap` of resvg 0.49 for what is allocated, layers of up to 5 x 5 canvases.

use resvg::tiny_skia::{Rect, Transform};
use resvg::usvg::{self, roxmltree};

use super::nodes::{self, Node};

/// How deep elements may lie in each other, and in what they refer to, so that hostile drawings do not fill
/// the stack.
pub(super) const MOST_DEEP: usize = 512;

/// The most elements that are drawn, so that a hostile drawing of uses of uses ends.
pub(super) const MOST_DRAWN: f64 = 2e6;

/// The most bytes of pixels that exist at the same time while a drawing is rendered: a page of 600 dpi with five layers as large.
pub(super) const MOST_BYTES: f64 = 768.0 * 1024.0 * 1024.0;

/// The stack of the thread that renders: as much as [`MOST_DEEP`] patterns in each other take, four times.
pub(super) const STACK: usize = 1 << 26;

/// Checks the elements of a drawing.
///
/// # Errors
/// In words what is beyond the bounds.
pub(super) fn check(document: &roxmltree::Document<'_>) -> Result<(), String> {
    let edges = Edges::of(document);
    #[derive(Clone, Copy)]
    enum State {
        Unseen,
        /// On the way to here; what refers to it in a circle is not drawn again.
        Open,
        Done {
            deep: usize,
            drawn: f64,
        },
    }
    let root = document.root_element().id().get_usize();
    let mut states = vec![State::Unseen; edges.of.len()];
    states[root] = State::Open;
    // A node, its next edge, and what is known of it. A stack of its own spares this walk the recursion.
    let mut way: Vec<(usize, usize, usize, f64)> = vec![(root, 0, 0, 1.0)];
    let (mut deep, mut drawn) = (0, 0.0);
    while let Some((node, next, deepest, all)) = way.last_mut() {
        let Some(&to) = edges.of[*node].get(*next) else {
            (deep, drawn) = (*deepest + 1, *all);
            states[*node] = State::Done { deep, drawn };
            way.pop();
            if let Some((.., deepest, all)) = way.last_mut() {
                *deepest = deep.max(*deepest);
                *all += drawn;
            }
            continue;
        };
        *next += 1;
        match states[to] {
            State::Unseen => {
                states[to] = State::Open;
                way.push((to, 0, 0, 1.0));
            }
            State::Open => {}
            State::Done { deep, drawn } => {
                *deepest = deep.max(*deepest);
                *all += drawn;
            }
        }
    }
    if deep > MOST_DEEP {
        return Err(format!(
            "its elements, clips and patterns lie {deep} deep in each other; expected at most {MOST_DEEP}"
        ));
    }
    if drawn > MOST_DRAWN {
        return Err(format!("with all clones, patterns and clips it has more than {MOST_DRAWN:.0} elements"));
    }
    Ok(())
}

/// For each node its children and what it refers to.
struct Edges {
    of: Vec<Vec<usize>>,
}

impl Edges {
    fn of(document: &roxmltree::Document<'_>) -> Edges {
        let ids = nodes::by_id(document);
        let count = document.descendants().next_back().map_or(0, |node| node.id().get_usize()) + 1;
        let mut of = vec![Vec::new(); count];
        for node in document.descendants().filter(Node::is_element) {
            let edges = &mut of[node.id().get_usize()];
            edges.extend(node.children().filter(Node::is_element).map(|child| child.id().get_usize()));
            let mut to = |id: &str| edges.extend(ids.get(id).map(|target| target.id().get_usize()));
            node.attributes().for_each(|a| urls(a.value()).for_each(&mut to));
            nodes::reference(node).into_iter().for_each(to);
        }
        Edges { of }
    }
}

/// What a value refers to by `url(#id)`.
pub(super) fn urls(value: &str) -> impl Iterator<Item = &str> {
    value.split("url(").skip(1).filter_map(|rest| {
        let rest = rest.trim_start_matches(|c: char| c.is_whitespace() || c == '"' || c == '\'');
        let id = rest.strip_prefix('#')?;
        Some(id.split([')', '"', '\'']).next()?.trim())
    })
}

/// The bytes of pixels that exist at the same time while a drawing is rendered.
pub(super) fn need(tree: &usvg::Tree, scale: Transform, (width, height): (u32, u32)) -> f64 {
    let canvas = 4.0 * f64::from(width) * f64::from(height);
    let walk = Walk { width: f64::from(width), height: f64::from(height), canvas };
    canvas + walk.group(tree.root(), scale)
}

/// The canvas of a walk.
struct Walk {
    width: f64,
    height: f64,
    /// Its bytes.
    canvas: f64,
}

impl Walk {
    /// The bytes of a layer: not beyond two canvases around the canvas.
    fn layer(&self, bounds: Rect, transform: Transform) -> f64 {
        // The border that the renderer adds.
        const BORDER: f64 = 4.0;
        let Some(bounds) = bounds.transform(transform) else { return 0.0 };
        let side = |side: f32, most: f64| (f64::from(side) + BORDER).min(5.0 * most);
        4.0 * side(bounds.width(), self.width) * side(bounds.height(), self.height)
    }

    fn group(&self, group: &usvg::Group, transform: Transform) -> f64 {
        let transform = transform.pre_concat(group.transform());
        let within = group.children().iter().map(|node| self.node(node, transform)).fold(0.0, f64::max);
        if !group.should_isolate() {
            return within;
        }
        let layer = self.layer(group.layer_bounding_box().to_rect(), transform);
        let mut beside = within;
        // A step of a filter has what it reads and what it makes; many steps are the time limit's affair.
        let steps = group.filters().iter().map(|filter| filter.primitives().len().min(2)).max().unwrap_or(0);
        beside = beside.max(layer * (steps + usize::from(steps > 0)) as f64);
        let mut clip = group.clip_path();
        let mut clips = 0.0;
        while let Some(path) = clip {
            clips += layer;
            beside = beside.max(clips + self.group(path.root(), transform.pre_concat(path.transform())));
            clip = path.clip_path();
        }
        let mut mask = group.mask();
        let mut masks = 0.0;
        while let Some(of) = mask {
            masks += 2.0 * layer;
            beside = beside.max(masks + self.group(of.root(), transform));
            mask = of.mask();
        }
        layer + beside
    }

    fn node(&self, node: &usvg::Node, transform: Transform) -> f64 {
        match node {
            usvg::Node::Group(group) => self.group(group, transform),
            usvg::Node::Text(text) => self.group(text.flattened(), transform),
            usvg::Node::Path(path) => {
                let fill = path.fill().map(|fill| self.paint(fill.paint(), transform));
                let stroke = path.stroke().map(|stroke| self.paint(stroke.paint(), transform));
                fill.unwrap_or(0.0).max(stroke.unwrap_or(0.0))
            }
            usvg::Node::Image(image) => match image.kind() {
                usvg::ImageKind::SVG(tree) => self.canvas + self.group(tree.root(), transform),
                _ => 4.0 * f64::from(image.size().width()) * f64::from(image.size().height()),
            },
        }
    }

    fn paint(&self, paint: &usvg::Paint, transform: Transform) -> f64 {
        let usvg::Paint::Pattern(pattern) = paint else { return 0.0 };
        let (sx, sy) = transform.pre_concat(pattern.transform()).get_scale();
        let sides = (f64::from(pattern.rect().width() * sx), f64::from(pattern.rect().height() * sy));
        4.0 * sides.0 * sides.1 + self.group(pattern.root(), Transform::from_scale(sx, sy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(inside: &str) -> Result<(), String> {
        let text = format!("<svg xmlns='http://www.w3.org/2000/svg'>{inside}</svg>");
        check(&roxmltree::Document::parse(&text).unwrap())
    }

    /// Things of a kind, each of which refers to the next.
    fn chain(count: usize, each: impl Fn(usize) -> String) -> String {
        (0..count).map(each).collect()
    }

    #[test]
    fn what_lies_too_deep_in_each_other_is_refused_however_it_is_nested() {
        type Each = fn(usize) -> String;
        let kinds: [Each; 3] = [
            |i| format!("<clipPath id='a{i}' clip-path='url(#a{})'/>", i + 1),
            |i| format!("<pattern id='a{i}'><rect style='fill: url( \"#a{}\" )'/></pattern>", i + 1),
            |i| format!("<mask id='a{i}'><use href='#a{}'/></mask>", i + 1),
        ];
        for (kind, each) in kinds.into_iter().enumerate() {
            assert_eq!(checked(&chain(200, each)), Ok(()), "{kind}");
            let said = checked(&chain(600, each)).unwrap_err();
            assert!(said.contains("deep in each other"), "{kind}: {said}");
        }
        let groups = |n: usize| format!("{}<rect/>{}", "<g>".repeat(n), "</g>".repeat(n));
        assert_eq!(checked(&groups(500)), Ok(()));
        assert!(checked(&groups(520)).is_err());
        // A circle is no depth.
        assert_eq!(
            checked(&chain(300, |i| format!("<g id='a{i}'><use href='#a{}'/></g>", (i + 1) % 300))),
            Err("its elements, clips and patterns lie 601 deep in each other; expected at most 512".into())
        );
        assert_eq!(checked("<g id='a'><use href='#b'/></g><g id='b'><use href='#a'/></g>"), Ok(()));
    }

    #[test]
    fn clones_of_clones_are_counted() {
        let laughs = |levels: usize| {
            chain(levels, |i| format!("<g id='a{i}'>{}</g>", format!("<use href='#a{}'/>", i + 1).repeat(10)))
        };
        assert_eq!(checked(&laughs(4)), Ok(()));
        assert!(checked(&laughs(9)).unwrap_err().contains("more than 2000000 elements"));
    }

    #[test]
    fn memory_is_that_of_tiles_layers_and_pictures_at_the_same_time() {
        let of = |inside: &str| {
            let text =
                format!("<svg xmlns='http://www.w3.org/2000/svg' width='100' height='100'>{inside}</svg>");
            let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).unwrap();
            need(&tree, Transform::from_scale(2.0, 2.0), (200, 200))
        };
        let canvas = 4.0 * 200.0 * 200.0;
        assert_eq!(of("<rect width='9' height='9'/>"), canvas);
        let tile = "<pattern id='p' width='1000' height='50' patternUnits='userSpaceOnUse'><circle r='9'/></pattern>\
            <rect width='9' height='9' fill='url(#p)'/>";
        assert_eq!(of(tile), canvas + 4.0 * 2000.0 * 100.0);
        let layers = "<g opacity='.5'><g opacity='.5'><rect width='50' height='9999'/></g></g>";
        assert_eq!(of(layers), canvas + 2.0 * 4.0 * 104.0 * 1000.0);
    }
}
