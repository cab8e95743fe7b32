//! A dove in silver with a glossy olive twig, on matte blue.

use super::canvas::{Coat, DistanceField, Point, bezier, clouds, inside, mix, noise, paint, smooth};
use super::painting::Painting;
use maths::Maths;

/// Any size would do; golden jobs hold this one.
const WIDTH: usize = 1280;
/// As [`WIDTH`]: any would do.
const HEIGHT: usize = 960;

/// Vertical offset of everything drawn, so that the bird stands in the middle.
const DROP: f32 = 118.0;

fn dropped(p: Point) -> Point {
    [p[0], p[1] + DROP]
}

/// A closed outline of curves: each entry continues from the end of the one before.
fn closed(start: Point, curves: &[[Point; 3]]) -> Vec<Point> {
    let mut points = Vec::new();
    let mut from = start;
    for &[a, b, to] in curves {
        points.extend((0..20).map(|k| dropped(bezier([from, a, b, to], k as f32 / 20.0))));
        from = to;
    }
    points
}

/// Head, breast, belly, tail and back, flying to the right.
const BODY: [[Point; 3]; 8] = [
    [[905.0, 382.0], [912.0, 398.0], [902.0, 416.0]],
    [[900.0, 500.0], [812.0, 610.0], [650.0, 622.0]],
    [[560.0, 626.0], [470.0, 640.0], [330.0, 730.0]],
    [[318.0, 700.0], [300.0, 690.0], [262.0, 694.0]],
    [[270.0, 664.0], [262.0, 650.0], [232.0, 630.0]],
    [[400.0, 590.0], [480.0, 520.0], [590.0, 470.0]],
    [[680.0, 436.0], [760.0, 420.0], [800.0, 392.0]],
    [[824.0, 352.0], [872.0, 344.0], [896.0, 372.0]],
];

/// A wing: a fan of feathers from a shoulder.
struct Wing {
    shoulder: Point,
    /// The end of the arm; feathers start along it from the shoulder.
    wrist: Point,
    /// Angles of the first and the last feather in degrees, y down.
    fan: (f32, f32),
    /// Lengths of the shortest (at the shoulder) and the longest feather.
    lengths: (f32, f32),
    feathers: usize,
}

const NEAR: Wing = Wing {
    shoulder: [600.0, 520.0],
    wrist: [640.0, 330.0],
    fan: (196.0, 276.0),
    lengths: (180.0, 352.0),
    feathers: 13,
};
const FAR: Wing = Wing {
    shoulder: [730.0, 440.0],
    wrist: [800.0, 290.0],
    fan: (248.0, 322.0),
    lengths: (120.0, 270.0),
    feathers: 10,
};

impl Wing {
    /// Draws the feathers into one shape and their shafts and gaps into another.
    fn draw(&self, shape: &mut DistanceField, lines: &mut DistanceField, coverts: &mut DistanceField) {
        let arm = [
            self.shoulder,
            [mix(self.shoulder[0], self.wrist[0], 0.4), mix(self.shoulder[1], self.wrist[1], 0.4)],
            [mix(self.shoulder[0], self.wrist[0], 0.8), mix(self.shoulder[1], self.wrist[1], 0.8)],
            self.wrist,
        ]
        .map(dropped);
        for k in 0..self.feathers {
            let u = k as f32 / (self.feathers - 1) as f32;
            let from = bezier(arm, u);
            let angle = mix(self.fan.0, self.fan.1, u).to_radians();
            let length = mix(self.lengths.0, self.lengths.1, smooth(0.0, 1.0, u.power(0.8)));
            // Feathers curve back a little towards their tips.
            let points: Vec<Point> = (0..=12)
                .map(|s| {
                    let s = s as f32 / 12.0;
                    let bent = angle - 0.28 * s * s;
                    [from[0] + length * s * bent.cosine(), from[1] + length * s * bent.sine()]
                })
                .collect();
            shape.line(&points, |s| 21.0 * (1.0 - s.whole_power(4)).max(0.02).sqrt() + 2.0);
            lines.line(&points, |s| mix(2.0, 0.5, s));
        }
        let arm: Vec<Point> = (0..=10).map(|k| bezier(arm, k as f32 / 10.0)).collect();
        shape.line(&arm, |s| mix(46.0, 22.0, s));
        coverts.line(&arm, |s| mix(58.0, 30.0, s));
    }
}

/// A twig from the beak with its leaves.
fn twig(stem: &mut DistanceField, leaves: &mut DistanceField, veins: &mut DistanceField) {
    let curve = [[926.0, 402.0], [985.0, 430.0], [1030.0, 490.0], [1056.0, 580.0]].map(dropped);
    let points: Vec<Point> = (0..=20).map(|k| bezier(curve, k as f32 / 20.0)).collect();
    stem.line(&points, |s| mix(4.2, 2.0, s));
    for k in 0..9 {
        let u = 0.1 + 0.1 * k as f32;
        let (at, next) = (bezier(curve, u), bezier(curve, u + 0.02));
        let heading = (next[1] - at[1]).arctangent2(next[0] - at[0]);
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let angle = heading + side * if k == 8 { 0.0 } else { 0.85 };
        let length = mix(104.0, 74.0, u);
        let place = |s: f32, across: f32| {
            [
                at[0] + length * s * angle.cosine() - across * angle.sine(),
                at[1] + length * s * angle.sine() + across * angle.cosine(),
            ]
        };
        let outline: Vec<Point> = (0..24)
            .map(|j| {
                let (s, side) = if j < 12 { (j as f32 / 12.0, 1.0) } else { (2.0 - j as f32 / 12.0, -1.0) };
                place(s, side * 15.0 * (4.0 * s * (1.0 - s)).power(0.8))
            })
            .collect();
        leaves.fill(&outline);
        veins.stroke(place(0.04, 0.0), place(0.9, 0.0), 1.5, 0.6);
    }
}

/// Draws the dove.
pub fn draw() -> Painting {
    let shape = |reach| DistanceField::new(WIDTH, HEIGHT, reach);
    let (mut body, mut near, mut far) = (shape(40.0), shape(40.0), shape(40.0));
    let (mut shafts, mut far_shafts) = (shape(14.0), shape(14.0));
    let (mut coverts, mut far_coverts) = (shape(40.0), shape(40.0));
    body.fill(&closed([896.0, 372.0], &BODY));
    NEAR.draw(&mut near, &mut shafts, &mut coverts);
    FAR.draw(&mut far, &mut far_shafts, &mut far_coverts);
    let (mut stem, mut leaves, mut veins) = (shape(4.0), shape(14.0), shape(4.0));
    twig(&mut stem, &mut leaves, &mut veins);
    let mut beak = shape(4.0);
    beak.fill(&closed(
        [898.0, 380.0],
        &[
            [[915.0, 382.0], [930.0, 392.0], [942.0, 410.0]],
            [[925.0, 412.0], [912.0, 414.0], [898.0, 412.0]],
            [[896.0, 400.0], [896.0, 392.0], [898.0, 380.0]],
        ],
    ));
    let mut tail = shape(4.0);
    for (k, end) in [[300.0, 712.0], [282.0, 690.0], [262.0, 664.0]].into_iter().enumerate() {
        tail.stroke(dropped([470.0, 600.0 - 14.0 * k as f32]), dropped(end), 0.8, 1.8);
    }

    let blue = Coat::new(0x2A5A93, 0.96, 0.0);
    let silver = Coat::new(0xE4E5E7, 0.23, 1.0);
    let (leaf, pale) = (Coat::new(0x5E7F3A, 0.3, 0.0), Coat::new(0xB9C78E, 0.4, 0.0));
    paint(WIDTH, HEIGHT, (1600, 1200), |i, p| {
        let fibre = noise(p[0] / 2.5, p[1] / 6.0, 1) + noise(p[0] / 11.0, p[1] / 2.5, 2) - 1.0;
        let glow = smooth(900.0, 120.0, ((p[0] - 640.0).squared() + (p[1] - 480.0).squared()).sqrt());
        let nearest = body.at(i).min(near.at(i)).min(far.at(i));
        let shadow = 0.4 * smooth(34.0, -10.0, nearest);
        let mut coat = blue.shaded((0.68 + 0.55 * glow) * (1.0 + 0.05 * fibre) * (1.0 - shadow));

        // Down is dull, flight feathers shine; towards its rim every part darkens, as if it were round.
        let down = clouds(p[0] / 14.0, p[1] / 9.0, 3, 20);
        let feather = |shaft: f32, tone: f32| {
            let rib = smooth(1.2, 0.0, shaft);
            let vane = smooth(0.0, 14.0, shaft);
            let mut coat = silver.shaded(tone * (1.02 - 0.34 * vane));
            coat.roughness = 0.16 + 0.16 * vane + 0.06 * down + 0.25 * rib;
            coat
        };
        let rim = |d: f32| mix(0.55, 1.0, smooth(0.0, 9.0, -d));
        let mut plumage = silver.shaded(0.84 + 0.24 * down);
        plumage.roughness = 0.34 + 0.22 * down;
        // Small feathers lie over the roots of the large ones, the border between them frayed.
        let fray = 26.0 * (clouds(p[0] / 16.0, p[1] / 16.0, 2, 21) - 0.5);
        let soft = |d: f32| smooth(10.0, -10.0, d + fray);
        let wing = feather(far_shafts.at(i), 1.0).under(plumage, soft(far_coverts.at(i)));
        coat = coat.under(wing.shaded(0.62 * rim(far.at(i))), inside(far.at(i)));
        let trunk = plumage.shaded(rim(body.at(i)) * (1.0 - 0.5 * inside(tail.at(i))));
        coat = coat.shaded(1.0 - 0.3 * smooth(12.0, 0.0, body.at(i))).under(trunk, inside(body.at(i)));
        let covert = soft(coverts.at(i));
        coat = coat.shaded(1.0 - 0.35 * smooth(16.0, 0.0, near.at(i)) * (1.0 - covert));
        let wing = feather(shafts.at(i), mix(rim(near.at(i)), 1.0, covert)).under(plumage, covert);
        coat = coat.under(wing, inside(near.at(i)));

        let eye = ((p[0] - 868.0).squared() + (p[1] - 388.0 - DROP).squared()).sqrt() - 6.5;
        coat = coat.under(Coat::new(0x14100E, 0.1, 0.0), inside(eye));
        coat = coat.under(Coat::new(0xD98B3A, 0.3, 0.0), inside(beak.at(i)));
        coat = coat.under(Coat::new(0x6A4A26, 0.5, 0.0), inside(stem.at(i)));
        let tone = 0.7 + 0.5 * smooth(0.0, 12.0, -leaves.at(i));
        coat.under(leaf.shaded(tone).under(pale, 0.8 * inside(veins.at(i))), inside(leaves.at(i)))
    })
}
