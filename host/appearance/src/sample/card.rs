//! A greeting card: a word and a border in gold, stars in silver, glossy holly on matte paper.

use maths::Maths;
use std::f32::consts::TAU;

use super::canvas::{Coat, DistanceField, Point, bezier, clouds, hash, inside, mix, noise, paint, smooth};
use super::painting::Painting;

/// Any size would do; golden jobs hold this one.
const WIDTH: usize = 1024;
/// As [`WIDTH`]: any would do. A postcard's shape.
const HEIGHT: usize = 1443;

/// A pen stroke with a broad nib held at 40 degrees: thin along the nib, wide across it.
fn pen(shape: &mut DistanceField, strokes: &[[Point; 4]], at: Point, scale: f32, thin: f32, wide: f32) {
    for stroke in strokes {
        let curve = stroke.map(|p| [at[0] + scale * p[0], at[1] + scale * p[1]]);
        let points: Vec<Point> = (0..=36).map(|k| bezier(curve, k as f32 / 36.0)).collect();
        let radius = |u: f32| {
            let (a, b) = (bezier(curve, (u - 0.02).max(0.0)), bezier(curve, (u + 0.02).min(1.0)));
            let slant = (b[1] - a[1]).arctangent2(b[0] - a[0]) + 40f32.to_radians();
            mix(thin, wide, slant.sine().abs())
        };
        shape.line(&points, radius);
    }
}

/// `Joy`, in units of the x-height, each letter a few curves.
const WORD: [[Point; 4]; 11] = [
    // J: the flag on top, then the stem with its hook.
    [[0.15, -0.95], [0.45, -1.25], [0.95, -1.05], [1.25, -1.2]],
    [[0.95, -1.1], [0.85, -0.4], [0.85, 0.5], [0.55, 1.0]],
    [[0.55, 1.0], [0.3, 1.42], [-0.35, 1.35], [-0.3, 0.9]],
    [[-0.3, 0.9], [-0.25, 0.6], [0.15, 0.65], [0.15, 0.9]],
    // o: two bows and the stroke to the next letter.
    [[1.75, 0.0], [1.25, -0.05], [1.15, 0.95], [1.65, 1.0]],
    [[1.65, 1.0], [2.2, 1.05], [2.3, 0.0], [1.75, 0.0]],
    [[1.98, 0.1], [2.15, 0.32], [2.4, 0.3], [2.62, 0.05]],
    // y: two downstrokes and a long tail.
    [[2.62, 0.05], [2.7, 0.5], [2.6, 1.0], [2.95, 1.0]],
    [[2.95, 1.0], [3.3, 1.0], [3.4, 0.4], [3.48, 0.0]],
    [[3.48, 0.0], [3.4, 0.8], [3.35, 1.6], [2.9, 1.95]],
    [[2.9, 1.95], [2.3, 2.35], [1.6, 1.85], [0.6, 1.95]],
];

/// A flourish for a corner, drawn into the upper left.
const FLOURISH: [[Point; 4]; 5] = [
    [[0.0, 1.5], [0.0, 0.4], [0.4, 0.0], [1.5, 0.0]],
    [[0.06, 1.0], [0.3, 1.25], [0.75, 1.1], [0.66, 0.78]],
    [[0.66, 0.78], [0.58, 0.55], [0.3, 0.62], [0.38, 0.82]],
    [[1.0, 0.06], [1.25, 0.3], [1.1, 0.75], [0.78, 0.66]],
    [[0.78, 0.66], [0.55, 0.58], [0.62, 0.3], [0.82, 0.38]],
];

/// A leaf of holly: its outline between seven spines, and its middle vein.
fn holly(leaves: &mut DistanceField, veins: &mut DistanceField, base: Point, degrees: f32, length: f32) {
    let (s, c) = degrees.to_radians().sine_cosine();
    let place = |x: f32, y: f32| [base[0] + length * (c * x - s * y), base[1] + length * (s * x + c * y)];
    const SPINES: [Point; 5] = [[0.0, 0.02], [0.18, 0.21], [0.45, 0.30], [0.74, 0.24], [1.0, 0.0]];
    let mut outline = Vec::new();
    for side in [1.0f32, -1.0] {
        for i in 0..SPINES.len() - 1 {
            let k = if side > 0.0 { i } else { SPINES.len() - 1 - i };
            let next = if side > 0.0 { i + 1 } else { SPINES.len() - 2 - i };
            let (a, b) = (SPINES[k], SPINES[next]);
            // Between two spines the margin bends inwards.
            for step in 0..8 {
                let u = step as f32 / 8.0;
                let bay = 0.26 * u * (1.0 - u);
                outline.push(place(mix(a[0], b[0], u), side * (mix(a[1], b[1], u) - bay)));
            }
        }
    }
    leaves.fill(&outline);
    let middle: Vec<Point> = (0..=8).map(|k| place(0.02 + 0.9 * k as f32 / 8.0, 0.0)).collect();
    veins.line(&middle, |u| mix(2.2, 0.7, u));
    for (x, reach) in [(0.2, 0.13), (0.42, 0.19), (0.66, 0.15)] {
        for side in [1.0f32, -1.0] {
            veins.stroke(place(x, 0.0), place(x + 0.12, side * reach), 1.2, 0.5);
        }
    }
}

/// A star of six arms with side arms, as a snow crystal.
fn star(shape: &mut DistanceField, centre: Point, radius: f32, turn: f32) {
    for arm in 0..6 {
        let angle = turn + TAU * arm as f32 / 6.0;
        let toward = |angle: f32, from: Point, length: f32| {
            [from[0] + length * angle.cosine(), from[1] + length * angle.sine()]
        };
        shape.stroke(centre, toward(angle, centre, radius), 0.07 * radius + 0.6, 0.6);
        for at in [0.42, 0.68] {
            let from = toward(angle, centre, at * radius);
            for side in [-1.0f32, 1.0] {
                let end = toward(angle + side * TAU / 6.0, from, (0.95 - at) * 0.62 * radius);
                shape.stroke(from, end, 0.04 * radius + 0.5, 0.5);
            }
        }
    }
}

/// The word, the border and its flourishes.
fn gilding() -> DistanceField {
    let (width, height) = (WIDTH as f32, HEIGHT as f32);
    let mut gold = DistanceField::new(WIDTH, HEIGHT, 6.0);
    pen(&mut gold, &WORD, [268.0, 560.0], 142.0, 2.6, 13.0);
    for (inset, radius) in [(46.0, 3.4), (62.0, 1.4)] {
        let corners = [
            [inset, inset],
            [width - inset, inset],
            [width - inset, height - inset],
            [inset, height - inset],
        ];
        for k in 0..4 {
            gold.stroke(corners[k], corners[(k + 1) % 4], radius, radius);
        }
    }
    for (x, y) in [(1.0f32, 1.0f32), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let corner = [if x > 0.0 { 84.0 } else { width - 84.0 }, if y > 0.0 { 84.0 } else { height - 84.0 }];
        let strokes = FLOURISH.map(|stroke| stroke.map(|p| [x * p[0], y * p[1]]));
        pen(&mut gold, &strokes, corner, 112.0, 1.6, 4.6);
    }
    gold
}

/// Stars and dots.
fn sky() -> DistanceField {
    let width = WIDTH as f32;
    let mut silver = DistanceField::new(WIDTH, HEIGHT, 4.0);
    let stars = [
        ([268.0, 300.0], 74.0),
        ([724.0, 290.0], 96.0),
        ([512.0, 206.0], 48.0),
        ([180.0, 500.0], 40.0),
        ([862.0, 520.0], 52.0),
        ([166.0, 398.0], 28.0),
        ([852.0, 410.0], 24.0),
        ([664.0, 462.0], 26.0),
        ([560.0, 380.0], 30.0),
        ([842.0, 210.0], 30.0),
        ([160.0, 700.0], 26.0),
        ([874.0, 760.0], 34.0),
    ];
    for (i, (centre, radius)) in stars.into_iter().enumerate() {
        star(&mut silver, centre, radius, hash(i as i32, 0, 9));
    }
    for i in 0..90 {
        let at = |k: i32, low: f32, high: f32| mix(low, high, hash(i, k, 12));
        silver.disc([at(0, 90.0, width - 90.0), at(1, 110.0, 1010.0)], at(2, 0.9, 2.8));
    }
    silver
}

/// The leaves and their veins in layers, the lowest first, with a pair of leaves in each.
fn sprig() -> [(DistanceField, DistanceField); 3] {
    [(-62.0, 190.0), (-20.0, 310.0), (14.0, 262.0)].map(|(degrees, length)| {
        let (mut leaves, mut veins) =
            (DistanceField::new(WIDTH, HEIGHT, 26.0), DistanceField::new(WIDTH, HEIGHT, 4.0));
        holly(&mut leaves, &mut veins, [530.0, 1200.0], degrees, length);
        holly(&mut leaves, &mut veins, [494.0, 1200.0], 180.0 - degrees, length);
        (leaves, veins)
    })
}

/// Centres and radii of the berries.
const BERRIES: [(Point, f32); 5] = [
    ([470.0, 1196.0], 37.0),
    ([548.0, 1186.0], 40.0),
    ([508.0, 1246.0], 38.0),
    ([508.0, 1136.0], 30.0),
    ([590.0, 1240.0], 27.0),
];

/// The signed distance to the nearest berry, and its radius in eighths of a pixel.
fn berry(p: Point) -> (f32, u32) {
    BERRIES.iter().fold((f32::MAX, 0), |best, (c, r)| {
        let d = ((p[0] - c[0]).squared() + (p[1] - c[1]).squared()).sqrt() - r;
        if d < best.0 { (d, (*r * 8.0) as u32) } else { best }
    })
}

/// Draws the card.
pub fn draw() -> Painting {
    let (gold, silver, layers) = (gilding(), sky(), sprig());
    let paper = Coat::new(0x1D3B34, 0.95, 0.0);
    let (gold_coat, silver_coat) = (Coat::new(0xE8B955, 0.22, 1.0), Coat::new(0xE2E4E6, 0.2, 1.0));
    let (leaf, vein) = (Coat::new(0x4F9A4B, 0.36, 0.0), Coat::new(0xA9CE8C, 0.45, 0.0));
    let red = Coat::new(0xC3141E, 0.14, 0.0);
    paint(WIDTH, HEIGHT, (1050, 1480), |i, p| {
        let fibre = noise(p[0] / 2.0, p[1] / 5.0, 1) + noise(p[0] / 9.0, p[1] / 2.0, 2) - 1.0;
        let glow = smooth(760.0, 60.0, ((p[0] - 512.0).squared() + (0.8 * (p[1] - 640.0)).squared()).sqrt());
        let mut coat = paper.shaded((0.72 + 0.62 * glow) * (1.0 + 0.07 * fibre));
        coat = coat.under(silver_coat, inside(silver.at(i)));
        let worn = clouds(p[0] / 60.0, p[1] / 60.0, 3, 30);
        coat = coat.under(Coat { roughness: 0.16 + 0.16 * worn, ..gold_coat }, inside(gold.at(i)));

        for (leaves, veins) in &layers {
            let depth = -leaves.at(i);
            coat = coat.shaded(1.0 - 0.5 * smooth(20.0, -4.0, -depth));
            if depth < -1.0 {
                continue;
            }
            let tone =
                0.5 + 0.5 * smooth(0.0, 22.0, depth) + 0.35 * (clouds(p[0] / 40.0, p[1] / 40.0, 3, 31) - 0.5);
            let mut green = leaf.shaded(tone).under(vein, 0.8 * inside(veins.at(i)));
            green.roughness += 0.12 * (clouds(p[0] / 25.0, p[1] / 25.0, 2, 32) - 0.5);
            // A fine gilt margin, as on embossed cards.
            green = green.under(gold_coat, smooth(3.6, 2.2, depth));
            coat = coat.under(green, inside(-depth));
        }

        let (distance, size) = berry(p);
        let round = smooth(0.0, size as f32 / 8.0, -distance);
        let body = red.shaded(0.45 + 0.75 * round);
        coat.shaded(1.0 - 0.5 * smooth(7.0, 0.0, distance)).under(body, inside(distance))
    })
}
