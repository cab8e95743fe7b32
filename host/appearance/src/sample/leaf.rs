//! An autumn oak leaf: waxy gloss that varies, veins of metallic silver, on matte paper.
//!
//! The outline is a union of lobes, each a bent capsule around its own vein, with the creases between them filled so that
//! lobes and bays are round. Finer veins branch off the veins of the lobes and bend toward the tip.

use super::canvas::{
    Coarse, Coat, DistanceField, Point, bezier, blend, capsule, cells, clouds, colour, hash, inside, mix,
    mix3, paint, smooth,
};
use super::painting::Painting;
use maths::Maths;

/// Any size would do; golden jobs hold this one.
const WIDTH: usize = 1024;
/// As [`WIDTH`]: any would do.
const HEIGHT: usize = 1448;

/// The midrib from the end of the stalk to the tip.
const MIDRIB: [Point; 4] = [[640.0, 1385.0], [520.0, 1130.0], [600.0, 520.0], [478.0, 130.0]];

/// The share of the midrib that is stalk; any leaf would do.
const STALK: f32 = 0.2;

/// A lobe: where on the blade (0 base to 1 tip) it leaves the midrib, its length and radius in pixels, and its
/// angle to the midrib in degrees.
struct Lobe {
    at: f32,
    length: f32,
    radius: f32,
    angle: f32,
}

const fn lobe(at: f32, length: f32, radius: f32, angle: f32) -> Lobe {
    Lobe { at, length, radius, angle }
}

/// The lobes of the left side; those of the right are shifted a little.
const LOBES: [Lobe; 6] = [
    lobe(0.06, 120.0, 30.0, 68.0),
    lobe(0.17, 226.0, 45.0, 61.0),
    lobe(0.32, 345.0, 58.0, 56.0),
    lobe(0.50, 372.0, 62.0, 50.0),
    lobe(0.68, 285.0, 54.0, 45.0),
    lobe(0.83, 150.0, 40.0, 37.0),
];

/// A place on the blade's midrib and the direction there.
fn midrib(at: f32) -> (Point, Point) {
    let s = STALK + (1.0 - STALK) * at;
    let (a, b) = (bezier(MIDRIB, s - 0.01), bezier(MIDRIB, (s + 0.01).min(1.0)));
    (bezier(MIDRIB, s), unit([b[0] - a[0], b[1] - a[1]]))
}

fn unit(v: Point) -> Point {
    let length = (v[0] * v[0] + v[1] * v[1]).sqrt().max(1e-6);
    [v[0] / length, v[1] / length]
}

fn turned(v: Point, degrees: f32) -> Point {
    let (s, c) = degrees.to_radians().sine_cosine();
    [c * v[0] - s * v[1], s * v[0] + c * v[1]]
}

fn along(p: Point, direction: Point, length: f32) -> Point {
    [p[0] + direction[0] * length, p[1] + direction[1] * length]
}

/// A vein that leaves at an angle (degrees, signed) and bends back by `bend` over its length.
fn vein(from: Point, direction: Point, angle: f32, bend: f32, length: f32, steps: usize) -> Vec<Point> {
    let mut points = vec![from];
    let mut at = from;
    for step in 0..steps {
        let turn = angle - bend * angle.signum() * (step as f32 + 0.5) / steps as f32;
        at = along(at, turned(direction, turn), length / steps as f32);
        points.push(at);
    }
    points
}

/// The veins of all lobes: their points, and their lobe's radius.
fn lobe_veins() -> Vec<(Vec<Point>, f32)> {
    let mut veins = Vec::new();
    for side in [-1.0f32, 1.0] {
        for (i, lobe) in LOBES.iter().enumerate() {
            let jitter = |k: u32| hash(i as i32, side as i32, 40 + k) - 0.5;
            let at = lobe.at + if side > 0.0 { 0.035 } else { 0.0 } + 0.02 * jitter(0);
            let (from, direction) = midrib(at);
            let length = lobe.length * (1.0 + 0.14 * jitter(1));
            let angle = side * (lobe.angle + 8.0 * jitter(2));
            veins
                .push((vein(from, direction, angle, 16.0, length, 6), lobe.radius * (1.0 + 0.2 * jitter(3))));
        }
    }
    veins
}

/// Signed distance to the blade.
fn outline(p: Point, veins: &[(Vec<Point>, f32)], body: &[(Point, f32)]) -> f32 {
    let mut d = f32::MAX;
    for pair in body.windows(2) {
        d = blend(d, capsule(p, pair[0].0, pair[1].0, pair[0].1, pair[1].1), 20.0);
    }
    for (points, radius) in veins {
        // The lobe ends before its vein would leave it, and swells towards its end.
        let last = (points.len() - 1) as f32;
        let mut own = f32::MAX;
        for (i, pair) in points.windows(2).enumerate() {
            let swell = |i: usize| radius * mix(0.8, 1.0, smooth(0.0, 0.75, i as f32 / last));
            own = own.min(capsule(p, pair[0], pair[1], swell(i), swell(i + 1)));
        }
        d = blend(d, own, 70.0);
    }
    let wave = clouds(p[0] / 70.0, p[1] / 70.0, 2, 5) - 0.5;
    let ripple = clouds(p[0] / 19.0, p[1] / 19.0, 2, 6) - 0.5;
    d + 20.0 * wave + 5.0 * ripple
}

/// The finer veins of one vein: to both sides, shorter towards its end, each with finer ones of its own.
fn branches(
    shape: &mut DistanceField,
    parent: &[Point],
    reach: f32,
    count: usize,
    radius: f32,
    depth: u32,
    seed: u32,
) {
    for k in 0..count {
        let u = (k as f32 + 0.6) / (count as f32 + 0.4);
        let place = u * (parent.len() - 1) as f32;
        let i = (place as usize).min(parent.len() - 2);
        let s = place - i as f32;
        let from = [mix(parent[i][0], parent[i + 1][0], s), mix(parent[i][1], parent[i + 1][1], s)];
        let direction = unit([parent[i + 1][0] - parent[i][0], parent[i + 1][1] - parent[i][1]]);
        let jitter = |j: u32| hash(k as i32, j as i32, seed) - 0.5;
        for side in [-1.0f32, 1.0] {
            let j = if side > 0.0 { 10 } else { 0 };
            let angle = side * (46.0 + 16.0 * jitter(j));
            let length = reach * (1.15 - 0.6 * u) * (1.0 + 0.5 * jitter(j + 1));
            let points = vein(from, direction, angle, 24.0, length, 4);
            shape.line(&points, |u| mix(radius, 0.25, u));
            if depth > 0 {
                branches(
                    shape,
                    &points,
                    0.4 * reach,
                    2,
                    0.55 * radius,
                    depth - 1,
                    seed * 31 + k as u32 * 7 + j,
                );
            }
        }
    }
}

/// Draws the leaf.
pub fn draw() -> Painting {
    let veins = lobe_veins();
    let body: Vec<(Point, f32)> = (0..=12)
        .map(|k| {
            let at = k as f32 / 12.0 * 0.97;
            let radius = 9.0 + 82.0 * smooth(-0.04, 0.42, at) - 40.0 * smooth(0.6, 1.0, at);
            (midrib(at).0, radius)
        })
        .collect();
    let blade = Coarse::sample(WIDTH, HEIGHT, 4, |p| outline(p, &veins, &body));

    let mut silver = DistanceField::new(WIDTH, HEIGHT, 16.0);
    let stalk: Vec<Point> = (0..=40).map(|k| bezier(MIDRIB, k as f32 / 40.0)).collect();
    silver.line(&stalk, |u| mix(9.0, 1.6, u.power(0.7)));
    for (points, _) in &veins {
        silver.line(points, |u| mix(4.6, 1.3, u));
    }
    let mut fine = DistanceField::new(WIDTH, HEIGHT, 5.0);
    for (i, (points, radius)) in veins.iter().enumerate() {
        let length: f32 = points.windows(2).map(|p| (p[1][0] - p[0][0]).hypotenuse(p[1][1] - p[0][1])).sum();
        let count = (length / 46.0) as usize + 1;
        branches(&mut fine, points, 1.5 * radius, count, 1.15, 1, 100 + i as u32);
    }
    let spine: Vec<Point> = (0..=24).map(|k| midrib(k as f32 / 24.0).0).collect();
    branches(&mut fine, &spine, 62.0, 15, 1.1, 1, 77);

    let paper = Coat::new(0xF2EBDC, 1.0, 0.0);
    let vein_coat = Coat::new(0xDCD9D2, 0.27, 1.0);
    let (gold, orange, russet, olive) =
        (colour(0xE0A02C), colour(0xBE5718), colour(0x7C2210), colour(0x7D7A24));
    let (glow, dark) = (colour(0xEDC05A), colour(0x3A170A));
    paint(WIDTH, HEIGHT, (1900, 2687), |i, p| {
        let edge = blade.at(p);
        let grain = clouds(p[0] / 7.0, p[1] / 3.0, 3, 1) - 0.5;
        let shadow = smooth(46.0, -30.0, blade.at([p[0] - 13.0, p[1] - 17.0]));
        let stalk_shadow = 0.35 * smooth(16.0, 2.0, silver.at(shifted(i, p)));
        let mut coat = paper.shaded((1.0 + 0.05 * grain) * (1.0 - 0.42 * shadow.max(stalk_shadow)));

        let share = inside(edge);
        if share > 0.0 {
            let depth = -edge;
            let drift = clouds(p[0] / 210.0, p[1] / 210.0, 4, 11);
            let mottle = clouds(p[0] / 46.0, p[1] / 46.0, 4, 12);
            // From the veins outward: gold, orange, russet; drift moves the borders about.
            let out = smooth(110.0, 4.0, depth + 150.0 * (drift - 0.5));
            let mut base = mix3(gold, orange, smooth(0.05, 0.6, out + 0.5 * (mottle - 0.5)));
            base = mix3(base, russet, smooth(0.45, 1.0, out + 0.7 * (mottle - 0.45)));
            let green = smooth(0.54, 0.72, clouds(p[0] / 260.0, p[1] / 260.0, 3, 14));
            base = mix3(base, olive, 0.75 * green * smooth(14.0, 70.0, depth));
            let (first, second) = cells(p[0] / 9.0, p[1] / 9.0, 21);
            let mesh = smooth(0.16, 0.02, second - first);
            base = mix3(base, glow, 0.07 * mesh + 0.34 * smooth(14.0, 2.0, silver.at(i)));
            let shade = 0.82 + 0.36 * clouds(p[0] / 24.0, p[1] / 24.0, 3, 15);
            base = base.map(|v| v * shade);
            // Waxy between the veins, dull where the leaf has dried.
            let dry = smooth(0.5, 0.7, clouds(p[0] / 120.0, p[1] / 120.0, 3, 16));
            let mut roughness = 0.34 + 0.16 * mottle + 0.34 * dry + 0.12 * mesh;
            // Rim and spots are dead and matte.
            let rim = smooth(9.0, 1.0, depth + 6.0 * (mottle - 0.5));
            base = mix3(base, dark, 0.75 * rim);
            let (spot, _) = cells(p[0] / 34.0, p[1] / 34.0, 31);
            let size = 0.05 + 0.2 * smooth(0.55, 0.95, clouds(p[0] / 90.0, p[1] / 90.0, 2, 32));
            let speck = smooth(size, 0.6 * size, spot);
            base = mix3(base, dark, 0.85 * speck);
            roughness = mix(roughness, 0.9, rim.max(speck));
            let mut leaf = Coat { base, roughness, metallic: 0.0 };
            leaf = leaf.under(vein_coat, 0.7 * inside(fine.at(i)) * smooth(2.0, 10.0, depth));
            coat = coat.under(leaf, share);
        }
        coat.under(vein_coat, inside(silver.at(i)) * if edge > 6.0 && p[1] < 1000.0 { 0.0 } else { 1.0 })
    })
}

/// The pixel that casts its shadow on this one.
fn shifted(pixel: usize, p: Point) -> usize {
    if p[0] < 10.0 || p[1] < 12.0 { pixel } else { pixel - 9 - 11 * WIDTH }
}
