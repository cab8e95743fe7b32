//! Lines of a drawing from its dots, for a cutting plotter.
//!
//! Problem: a cutter follows a path; the art that says where is a stroke or an area of dots, whatever program drew it.
//! Method: what is narrower than [`STROKE`] is a stroke, and its path is its middle: dots are taken off its edges, from four sides in
//! turn, until it is one dot wide (Zhang and Suen). What is wider is an area, and its path is its edge. The path of dots is then
//! straightened: it keeps the fewest corners that leave no dot further than half a dot beside it (Douglas and Peucker). Cost: some
//! passes over the dots of strokes, as many as half of their width. Limits: corners of strokes are rounded by half their width;
//! [`MOST_DOTS`] of strokes; a path lies within a dot (0.04 mm) of the drawn one.
//! Source: T. Y. Zhang, C. Y. Suen, A fast parallel algorithm for thinning digital patterns, CACM 27 (1984); D. Douglas,
//! T. Peucker, Cartographica 10 (1973).

use maths::Maths;
use std::collections::{HashMap, HashSet};

use crate::dots::bitplane;
use sheet::Plane;

/// Strokes are narrower than this many dots: 1.5 mm, more than plotters' programs ask for.
const STROKE: usize = 36;

/// The most dots of strokes and edges, so that their paths take no more memory than the page itself.
pub const MOST_DOTS: usize = 1 << 22;

/// How far in dots a straightened path may lie from the dots.
const OFF: f64 = 1.0;

/// A path in dots from the corner of the art, through the middles of dots or along their edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Its corners.
    pub points: Vec<(f64, f64)>,
    /// Whether it ends where it begins.
    pub closed: bool,
}

/// A dot.
type Dot = (i32, i32);

/// The eight dots around one, in a circle that begins above.
const AROUND: [Dot; 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// The paths of a plane, from the top; `None` if it has too many dots to be lines.
pub(crate) fn paths(plane: &Plane) -> Option<Vec<Path>> {
    let wide = opened(plane);
    let mut strokes = HashSet::new();
    for y in 0..plane.length {
        for x in 0..plane.width {
            if bitplane::at(plane, x, y) && !bitplane::at(&wide, x, y) {
                strokes.insert((x as i32, y as i32));
            }
        }
        if strokes.len() > MOST_DOTS {
            return None;
        }
    }
    // The rounded corners of an area are no strokes.
    let strokes = without_corners(strokes, &wide);
    let mut paths = middles(thinned(strokes));
    paths.extend(edges(&wide)?);
    let mut paths: Vec<Path> =
        paths.into_iter().map(straightened).filter(|path| path.points.len() > 1).collect();
    paths.sort_by(|a, b| {
        (a.points[0].1, a.points[0].0)
            .partial_cmp(&(b.points[0].1, b.points[0].0))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    Some(paths)
}

/// What of a plane is covered by squares of [`STROKE`] that it covers.
fn opened(plane: &Plane) -> Plane {
    let (width, length) = (plane.width, plane.length);
    let mut wide = bitplane::blank(width, length);
    let mut heights = vec![0usize; width];
    for y in 0..length {
        let mut run = 0;
        for (x, height) in heights.iter_mut().enumerate() {
            *height = if bitplane::at(plane, x, y) { (*height + 1).min(STROKE) } else { 0 };
            run = if *height == STROKE { run + 1 } else { 0 };
            if run >= STROKE {
                let first = if run == STROKE { x + 1 - STROKE } else { x };
                for above in y + 1 - STROKE..=y {
                    for column in first..=x {
                        wide.bits[above * wide.stride + column / 8] |= 0x80 >> (column % 8);
                    }
                }
            }
        }
    }
    wide
}

/// Strokes without the parts of areas that no square covers: those that touch an area and reach no further than a corner does.
fn without_corners(strokes: HashSet<Dot>, wide: &Plane) -> HashSet<Dot> {
    let inside = |(x, y): Dot| {
        x >= 0
            && y >= 0
            && (x as usize) < wide.width
            && (y as usize) < wide.length
            && bitplane::at(wide, x as usize, y as usize)
    };
    let mut left = strokes.clone();
    let mut kept = HashSet::new();
    while let Some(&first) = left.iter().next() {
        left.remove(&first);
        let (mut part, mut at) = (vec![first], 0);
        let mut touches = false;
        let (mut low, mut high) = (first, first);
        while let Some(&(x, y)) = part.get(at) {
            at += 1;
            low = (low.0.min(x), low.1.min(y));
            high = (high.0.max(x), high.1.max(y));
            for (dx, dy) in AROUND {
                let next = (x + dx, y + dy);
                touches |= inside(next);
                if left.remove(&next) {
                    part.push(next);
                }
            }
        }
        let reach = (high.0 - low.0).max(high.1 - low.1);
        if !touches || reach as usize > STROKE {
            kept.extend(part);
        }
    }
    kept
}

/// Strokes made one dot wide.
fn thinned(mut dots: HashSet<Dot>) -> HashSet<Dot> {
    loop {
        let mut changed = false;
        for step in 0..2 {
            let gone: Vec<Dot> = dots.iter().copied().filter(|&dot| goes(&dots, dot, step)).collect();
            changed |= !gone.is_empty();
            gone.iter().for_each(|dot| {
                dots.remove(dot);
            });
        }
        if !changed {
            return dots;
        }
    }
}

/// Whether a dot at an edge is taken off in this step.
fn goes(dots: &HashSet<Dot>, (x, y): Dot, step: usize) -> bool {
    let p = AROUND.map(|(dx, dy)| dots.contains(&(x + dx, y + dy)));
    let count = p.iter().filter(|&&set| set).count();
    let turns = (0..8).filter(|&at| !p[at] && p[(at + 1) % 8]).count();
    let (north, east, south, west) = (p[0], p[2], p[4], p[6]);
    let sides =
        if step == 0 { !east || !south || !north && !west } else { !north || !west || !east && !south };
    (2..=6).contains(&count) && turns == 1 && sides
}

/// The neighbours of a dot of a thin stroke. Where a step has a dot in its corner, the way is along the sides.
fn neighbours(dots: &HashSet<Dot>, (x, y): Dot) -> Vec<Dot> {
    let has = |(dx, dy): Dot| dots.contains(&(x + dx, y + dy));
    let near = AROUND
        .iter()
        .filter(|&&(dx, dy)| has((dx, dy)) && (dx == 0 || dy == 0 || !has((dx, 0)) && !has((0, dy))));
    near.map(|(dx, dy)| (x + dx, y + dy)).collect()
}

/// The paths along dots that are one wide: between ends and forks, and then what is left, which are loops.
fn middles(dots: HashSet<Dot>) -> Vec<Path> {
    let links: HashMap<Dot, Vec<Dot>> = dots.iter().map(|&dot| (dot, neighbours(&dots, dot))).collect();
    let mut all: Vec<Dot> = dots.into_iter().collect();
    all.sort_unstable_by_key(|&(x, y)| (y, x));
    let mut gone: HashSet<(Dot, Dot)> = HashSet::new();
    let mut paths = Vec::new();
    let (nodes, others): (Vec<Dot>, Vec<Dot>) = all.into_iter().partition(|dot| links[dot].len() != 2);
    for start in nodes.into_iter().chain(others) {
        for &next in &links[&start] {
            if gone.contains(&(start, next)) {
                continue;
            }
            let (mut path, mut from, mut to) = (vec![start], start, next);
            loop {
                gone.insert((from, to));
                gone.insert((to, from));
                path.push(to);
                if to == start || links[&to].len() != 2 {
                    break;
                }
                let Some(&further) = links[&to].iter().find(|&&other| other != from) else { break };
                if gone.contains(&(to, further)) {
                    break;
                }
                (from, to) = (to, further);
            }
            let closed = path.len() > 3 && path.last() == Some(&start);
            if closed {
                path.pop();
            }
            let middle = |&(x, y): &Dot| (f64::from(x) + 0.5, f64::from(y) + 0.5);
            paths.push(Path { points: path.iter().map(middle).collect(), closed });
        }
    }
    paths
}

/// The edges of areas, with the area at the right of the way.
fn edges(plane: &Plane) -> Option<Vec<Path>> {
    let has = |x: i32, y: i32| {
        x >= 0
            && y >= 0
            && (x as usize) < plane.width
            && (y as usize) < plane.length
            && bitplane::at(plane, x as usize, y as usize)
    };
    // From each corner of dots the ways on, at most two where two dots touch by a corner.
    let mut ways: HashMap<Dot, Vec<Dot>> = HashMap::new();
    for y in 0..plane.length as i32 {
        for x in 0..plane.width as i32 {
            if !has(x, y) {
                continue;
            }
            let sides = [
                (has(x, y - 1), (x, y), (x + 1, y)),
                (has(x + 1, y), (x + 1, y), (x + 1, y + 1)),
                (has(x, y + 1), (x + 1, y + 1), (x, y + 1)),
                (has(x - 1, y), (x, y + 1), (x, y)),
            ];
            for (_, from, to) in sides.into_iter().filter(|(covered, ..)| !covered) {
                ways.entry(from).or_default().push(to);
            }
        }
        if ways.len() > MOST_DOTS {
            return None;
        }
    }
    let mut starts: Vec<Dot> = ways.keys().copied().collect();
    starts.sort_unstable_by_key(|&(x, y)| (y, x));
    let mut paths = Vec::new();
    for start in starts {
        while let Some(first) = ways.get_mut(&start).and_then(Vec::pop) {
            let (mut points, mut at) = (vec![start], first);
            while at != start {
                points.push(at);
                let Some(next) = ways.get_mut(&at).and_then(Vec::pop) else { break };
                at = next;
            }
            let point = |&(x, y): &Dot| (f64::from(x), f64::from(y));
            paths.push(Path { points: points.iter().map(point).collect(), closed: true });
        }
    }
    Some(paths)
}

/// A path with the fewest corners that stay beside its dots.
fn straightened(path: Path) -> Path {
    let Path { mut points, closed } = path;
    if closed {
        // A loop is two ways: to the point furthest from its first, and back.
        let from = points[0];
        let far = |&(x, y): &(f64, f64)| (x - from.0).hypotenuse(y - from.1);
        let apart =
            (0..points.len()).max_by(|&a, &b| far(&points[a]).total_cmp(&far(&points[b]))).unwrap_or(0);
        points.push(from);
        let mut kept = reduced(&points[..=apart]);
        kept.pop();
        kept.extend(reduced(&points[apart..]));
        kept.pop();
        return Path { points: kept, closed };
    }
    Path { points: reduced(&points), closed }
}

/// The points of a way that are kept, its ends among them.
fn reduced(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut kept = vec![false; points.len()];
    (kept[0], kept[points.len() - 1]) = (true, true);
    let mut waiting = vec![(0, points.len() - 1)];
    while let Some((from, to)) = waiting.pop() {
        let ((ax, ay), (bx, by)) = (points[from], points[to]);
        let (dx, dy) = (bx - ax, by - ay);
        let length = dx.hypotenuse(dy);
        let off = |&(x, y): &(f64, f64)| match length {
            0.0 => (x - ax).hypotenuse(y - ay),
            _ => (dx * (y - ay) - dy * (x - ax)).abs() / length,
        };
        let furthest = (from + 1..to).max_by(|&a, &b| off(&points[a]).total_cmp(&off(&points[b])));
        if let Some(at) = furthest.filter(|&at| off(&points[at]) > OFF) {
            kept[at] = true;
            waiting.extend([(from, at), (at, to)]);
        }
    }
    points.iter().zip(kept).filter(|(_, kept)| *kept).map(|(point, _)| *point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(width: usize, length: usize, is: impl Fn(f64, f64) -> bool) -> Plane {
        let dots: Vec<u8> = (0..width * length)
            .map(|at| u8::from(is((at % width) as f64 + 0.5, (at / width) as f64 + 0.5)))
            .collect();
        bitplane::from_bytes(width, &dots, |dot| dot > 0)
    }

    /// The length of a path.
    fn length(path: &Path) -> f64 {
        let ways = path.points.windows(2).map(|two| (two[0], two[1]));
        let back = path.closed.then(|| (path.points[path.points.len() - 1], path.points[0]));
        ways.chain(back).map(|((ax, ay), (bx, by))| (bx - ax).hypot(by - ay)).sum()
    }

    #[test]
    fn the_path_of_a_stroke_is_its_middle_and_that_of_an_area_its_edge() {
        // A ring with a stroke of several widths, its middle 200 dots from the centre.
        for width in [2.0, 6.0, 20.0] {
            let ring = drawn(500, 500, |x, y| ((x - 250.0).hypot(y - 250.0) - 200.0).abs() < width / 2.0);
            let [path] = &paths(&ring).unwrap()[..] else { panic!("one ring of {width}") };
            assert!(path.closed);
            for &(x, y) in &path.points {
                let off = (x - 250.0).hypot(y - 250.0) - 200.0;
                assert!(off.abs() < 1.5, "{width}: {off}");
            }
            let round = 2.0 * std::f64::consts::PI * 200.0;
            assert!((length(path) / round - 1.0).abs() < 0.03, "{width}: {} of {round}", length(path));
            assert!(path.points.len() < 120, "{width}: {} corners", path.points.len());
        }
        let disc = drawn(500, 500, |x, y| (x - 250.0).hypot(y - 250.0) < 200.0);
        let [path] = &paths(&disc).unwrap()[..] else { panic!("one disc") };
        // What a square of 1.5 mm does not reach of a round edge is left.
        assert!(
            path.closed
                && path.points.iter().all(|&(x, y)| ((x - 250.0).hypot(y - 250.0) - 200.0).abs() < 3.0)
        );
        let rectangle = drawn(200, 100, |x, y| (20.0..180.0).contains(&x) && (10.0..90.0).contains(&y));
        let [path] = &paths(&rectangle).unwrap()[..] else { panic!("one rectangle") };
        let mut corners = path.points.clone();
        corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(corners, [(20.0, 10.0), (20.0, 90.0), (180.0, 10.0), (180.0, 90.0)]);
    }

    #[test]
    fn open_lines_forks_and_nothing_have_their_paths() {
        let line = drawn(300, 60, |x, y| (10.0..290.0).contains(&x) && (28.0..32.0).contains(&y));
        let [path] = &paths(&line).unwrap()[..] else { panic!("one line") };
        assert!(!path.closed && path.points.len() == 2 && (length(path) - 280.0).abs() < 6.0, "{path:?}");
        let cross = drawn(100, 100, |x, y| (x - 50.0).abs() < 2.0 || (y - 50.0).abs() < 2.0);
        let found = paths(&cross).unwrap();
        let all: f64 = found.iter().map(length).sum();
        assert!(
            (4..=6).contains(&found.len()) && (all - 196.0).abs() < 8.0,
            "{} paths of {all}",
            found.len()
        );
        assert_eq!(paths(&drawn(9, 9, |_, _| false)), Some(Vec::new()));
    }
}
