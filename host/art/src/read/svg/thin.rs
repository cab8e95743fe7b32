//! Lines and shapes that are thinner than a dot, made as thick as one.
//!
//! Problem: without soft edges a dot is painted if its centre is covered, so a thinner line falls apart or vanishes.
//! Method: a stroke is at least a dot wide. A filled shape that is thinner gets a stroke of its own paint of that width,
//! which paints what it touches, as PostScript does. How thin a shape is follows from its area and outline: it is the short
//! side of the rectangle that has both. The renderer's drawing cannot be changed, so it is written, changed and read again;
//! drawings without thin parts are not.
//! Cost: a walk over the paths; the text of the drawing if there are thin parts. Limits: a shape whose thin parts are a
//! small share of it, patterns, clips and masks, and drawings within drawings stay as they are.

use maths::Maths;
use resvg::tiny_skia::{Path, PathSegment, Point, Transform};
use resvg::usvg::{self, roxmltree};

use super::nodes;
use super::write::{Way, written};

/// The width of a stroke that was thinner than a dot: a little more than one, for the renderer counts in 1/64.
const WIDTH: f32 = 1.0 + 1.0 / 256.0;

/// What is as thick as this is not thin: art that is drawn dot by dot may be off by a rounding.
const ENOUGH: f32 = 1.0 - 1.0 / 256.0;

/// How much more a dot may be in one direction of a drawing than in the other before a stroke is no longer widened by it.
const ASKEW: f32 = 8.0;

/// The least area of a shape that is drawn, in dots.
const LEAST_AREA: f64 = 0.01;

/// Lines that stand for a curve.
const PARTS: u32 = 8;

/// What a thin part needs: the width of its stroke, and whether it has none yet.
#[derive(Clone, Copy)]
struct Need {
    width: f32,
    filled: bool,
}

/// The drawing with its thin parts a dot thick at this scale; `None` if it has none.
pub(super) fn thickened(
    tree: &usvg::Tree,
    scale: Transform,
    options: &usvg::Options<'_>,
) -> Option<usvg::Tree> {
    let mut needs = Vec::new();
    gather(tree.root(), scale, &mut needs);
    if needs.iter().all(Option::is_none) {
        return None;
    }
    let plain = usvg::WriteOptions { indent: usvg::Indent::None, ..usvg::WriteOptions::default() };
    let text = tree.to_string(&plain);
    let document = roxmltree::Document::parse(&text).ok()?;
    // Paths are written in the order in which they are drawn; those of definitions come first.
    let is_path = |node: &nodes::Node<'_, '_>| {
        nodes::name(*node) == Some("path")
            && !node.ancestors().any(|around| nodes::name(around) == Some("defs"))
    };
    if document.descendants().filter(is_path).count() != needs.len() {
        return None;
    }
    let mut next = needs.into_iter();
    let changed = written(document.root_element(), |node| {
        match is_path(&node).then(|| next.next()).flatten().flatten() {
            Some(need) => {
                let mut own = vec![("stroke-width", need.width.to_string())];
                if need.filled {
                    let of_fill = |name: &str| node.attribute(name).unwrap_or_default().to_owned();
                    own.push(("stroke", of_fill("fill")));
                    own.push(("stroke-linejoin", "bevel".into()));
                    if node.has_attribute("fill-opacity") {
                        own.push(("stroke-opacity", of_fill("fill-opacity")));
                    }
                }
                Way::With(own)
            }
            None => Way::Keep,
        }
    });
    usvg::Tree::from_str(&changed, options).ok()
}

/// What each path of a group needs, in the order in which they are drawn.
fn gather(group: &usvg::Group, scale: Transform, needs: &mut Vec<Option<Need>>) {
    for node in group.children() {
        match node {
            usvg::Node::Group(inner) => gather(inner, scale, needs),
            usvg::Node::Text(text) => gather(text.flattened(), scale, needs),
            usvg::Node::Path(path) => needs.push(need(path, scale.pre_concat(path.abs_transform()))),
            usvg::Node::Image(_) => {}
        }
    }
}

/// What a path needs where it is drawn.
fn need(path: &usvg::Path, place: Transform) -> Option<Need> {
    let (most, least) = stretch(place);
    // Seen from its side nothing is drawn.
    let dots = least.max(most / ASKEW);
    let width = Some(WIDTH / dots).filter(|width| width.is_finite() && *width > 0.0)?;
    match (path.stroke(), path.fill()) {
        (Some(stroke), _) => (stroke.width().get() * dots < ENOUGH).then_some(Need { width, filled: false }),
        (None, Some(_)) => (thickness(path.data(), place) < ENOUGH).then_some(Need { width, filled: true }),
        (None, None) => None,
    }
}

/// The most and the least dots that one unit becomes: the singular values of the transform.
fn stretch(t: Transform) -> (f32, f32) {
    let sum = (t.sx + t.sy).hypotenuse(t.ky - t.kx);
    let difference = (t.sx - t.sy).hypotenuse(t.ky + t.kx);
    ((sum + difference) / 2.0, (sum - difference).abs() / 2.0)
}

/// The short side of the rectangle with the area and the outline of a path, in dots; without end if it has no area, for
/// then nothing is drawn.
fn thickness(path: &Path, place: Transform) -> f32 {
    let mut rings: Vec<Ring> = Vec::new();
    for segment in path.segments() {
        let at = |p: Point| {
            let mut point = p;
            place.map_point(&mut point);
            point
        };
        let steps = (1..=PARTS).map(|i| i as f32 / PARTS as f32);
        if let PathSegment::MoveTo(p) = segment {
            rings.push(Ring::at(at(p)));
        }
        let Some(ring) = rings.last_mut() else { continue };
        let a = ring.last;
        match segment {
            PathSegment::MoveTo(_) => {}
            PathSegment::LineTo(p) => ring.line(at(p)),
            PathSegment::QuadTo(p, q) => {
                let (p, q) = (at(p), at(q));
                for t in steps {
                    let of = |a: f32, p: f32, q: f32| (1.0 - t) * ((1.0 - t) * a + 2.0 * t * p) + t * t * q;
                    ring.line(Point::from_xy(of(a.x, p.x, q.x), of(a.y, p.y, q.y)));
                }
            }
            PathSegment::CubicTo(p, q, r) => {
                let (p, q, r) = (at(p), at(q), at(r));
                for t in steps {
                    let s = 1.0 - t;
                    let of = |a: f32, p: f32, q: f32, r: f32| {
                        s * s * s * a + 3.0 * s * t * (s * p + t * q) + t * t * t * r
                    };
                    ring.line(Point::from_xy(of(a.x, p.x, q.x, r.x), of(a.y, p.y, q.y, r.y)));
                }
            }
            PathSegment::Close => ring.line(ring.first),
        }
    }
    for ring in &mut rings {
        ring.line(ring.first);
    }
    let half = rings.iter().map(|ring| ring.outline).sum::<f64>() / 2.0;
    let area = enclosed(&rings);
    if area < LEAST_AREA {
        return f32::INFINITY;
    }
    ((half - (half * half - 4.0 * area).max(0.0).sqrt()) / 2.0) as f32
}

/// A closed part of a path, in dots.
struct Ring {
    first: Point,
    last: Point,
    /// Positive in one sense, negative in the other.
    area: f64,
    outline: f64,
    /// Left, top, right, bottom.
    around: [f32; 4],
}

impl Ring {
    fn at(p: Point) -> Ring {
        Ring { first: p, last: p, area: 0.0, outline: 0.0, around: [p.x, p.y, p.x, p.y] }
    }

    fn line(&mut self, to: Point) {
        let from = std::mem::replace(&mut self.last, to);
        // Reckoned from the ring's own begin, where little is lost to rounding.
        let of = |p: Point| (f64::from(p.x - self.first.x), f64::from(p.y - self.first.y));
        let ((ax, ay), (bx, by)) = (of(from), of(to));
        self.area += (ax * by - bx * ay) / 2.0;
        self.outline += (bx - ax).hypotenuse(by - ay);
        self.around = joined(self.around, [to.x, to.y, to.x, to.y]);
    }
}

fn joined(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

/// The area of rings. One that runs against the largest is a hole if it lies among those that run with it.
fn enclosed(rings: &[Ring]) -> f64 {
    let Some(largest) = rings.iter().max_by(|a, b| a.area.abs().total_cmp(&b.area.abs())) else { return 0.0 };
    let with = |ring: &&Ring| ring.area.signum() == largest.area.signum();
    let around = rings.iter().filter(with).fold(largest.around, |all, ring| joined(all, ring.around));
    let area = |ring: &Ring| {
        let hole = !with(&ring) && joined(around, ring.around) == around;
        if hole { -ring.area.abs() } else { ring.area.abs() }
    };
    rings.iter().map(area).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resvg::tiny_skia::{PathBuilder, Rect};

    #[test]
    fn thickness_is_the_short_side_of_a_rectangle() {
        let rect = |w, h| PathBuilder::from_rect(Rect::from_xywh(3.0, 700.0, w, h).unwrap());
        for (w, h) in [(100.0, 0.5), (0.25, 40.0), (3.0, 3.0), (1000.0, 20.0)] {
            let found = thickness(&rect(w, h), Transform::identity());
            assert!((found - w.min(h)).abs() < 0.01, "{w} x {h}: {found}");
            let turned = Transform::from_rotate(30.0).post_scale(2.0, 2.0);
            let found = thickness(&rect(w, h), turned);
            assert!((found - 2.0 * w.min(h)).abs() < 0.02, "{w} x {h}: {found}");
        }
        let disc = PathBuilder::from_circle(5.0, 5.0, 4.0).unwrap();
        assert!((thickness(&disc, Transform::identity()) - 6.2).abs() < 0.3);
    }

    #[test]
    fn a_transform_stretches_most_and_least() {
        let (most, least) = stretch(Transform::from_rotate(40.0).pre_scale(3.0, 0.5));
        assert!((most - 3.0).abs() < 1e-4 && (least - 0.5).abs() < 1e-4, "{most} {least}");
    }
}
