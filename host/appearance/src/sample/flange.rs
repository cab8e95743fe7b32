//! A rusted steel flange: a turned ring with bolt holes, partly bare metal and partly rust.

use maths::Maths;
use std::f32::consts::TAU;

use super::canvas::{Coat, Point, cells, clouds, hash, inside, mix, noise, paint, smooth};
use super::painting::Painting;

/// Any size would do; golden jobs hold this one.
const SIDE: usize = 1024;
const CENTRE: Point = [512.0, 512.0];

/// Radius of the ring in pixels; any flange would do, as for all measures below.
const OUTER: f32 = 448.0;
/// Radius of the bore; any would do.
const BORE: f32 = 168.0;
/// Radius of the raised face around the bore; any between bore and bolts would do.
const FACE: f32 = 258.0;
/// Radius of the circle of bolts; any between face and ring would do.
const BOLTS: f32 = 352.0;
/// Radius of a hole; any would do that leaves room to face and ring.
const HOLE: f32 = 42.0;
/// Holes on the circle of bolts; any would do.
const HOLES: usize = 8;

/// Distances to the ring's outside, its bore, the step of its face and the nearest bolt hole.
struct Ring {
    radius: f32,
    edge: f32,
    hole: f32,
}

fn ring(p: Point) -> Ring {
    let (x, y) = (p[0] - CENTRE[0], p[1] - CENTRE[1]);
    let radius = (x * x + y * y).sqrt();
    let turn = TAU / HOLES as f32;
    // The bolt nearest in angle.
    let angle = ((y.arctangent2(x) / turn - 0.5).round() + 0.5) * turn;
    let (hx, hy) = (x - BOLTS * angle.cosine(), y - BOLTS * angle.sine());
    let hole = (hx * hx + hy * hy).sqrt() - HOLE;
    let edge = (radius - OUTER).max(BORE - radius).max(-hole);
    Ring { radius, edge, hole }
}

/// Draws the flange.
pub fn draw() -> Painting {
    let paper = Coat::new(0xE9E4DA, 1.0, 0.0);
    let steel = Coat::new(0xC9C7C2, 0.24, 1.0);
    let (bright, deep, black) =
        (Coat::new(0xB5602A, 0.86, 0.0), Coat::new(0x6B2E17, 0.92, 0.0), Coat::new(0x33201A, 0.8, 0.0));
    paint(SIDE, SIDE, (1500, 1500), |_, p| {
        let Ring { radius, edge, hole } = ring(p);
        let grain = clouds(p[0] / 6.0, p[1] / 4.0, 2, 3) - 0.5;
        let shadow = smooth(38.0, -20.0, ring([p[0] - 14.0, p[1] - 18.0]).edge);
        let ground = paper.shaded((1.0 + 0.04 * grain) * (1.0 - 0.5 * shadow));
        let share = inside(edge);
        if share <= 0.0 {
            return ground;
        }
        // Grooves of the lathe: fine rings of unequal depth.
        let groove = noise(radius / 1.7, 0.5, 8) * 0.6 + noise(radius / 5.3, 7.5, 9) * 0.4;
        let wear = clouds(p[0] / 90.0, p[1] / 90.0, 4, 10);
        let mut metal = steel.shaded(0.86 + 0.2 * groove);
        metal.roughness = 0.17 + 0.16 * groove + 0.14 * wear;
        // Scratches, each a straight line through a cell.
        let (cx, cy) = ((p[0] / 150.0).floor(), (p[1] / 150.0).floor());
        let tilt = TAU * hash(cx as i32, cy as i32, 60);
        let across = (p[0] - 150.0 * cx - 75.0) * tilt.sine() - (p[1] - 150.0 * cy - 75.0) * tilt.cosine();
        let scratch = smooth(1.4, 0.2, (across + 30.0 * (wear - 0.5)).abs());
        metal.roughness += 0.2 * scratch;

        // Rust starts at rims, in holes and at the step of the face, and spreads from there.
        let step = (radius - FACE).abs();
        let near =
            smooth(70.0, 0.0, -edge) * 0.22 + smooth(46.0, 0.0, hole) * 0.16 + smooth(26.0, 0.0, step) * 0.14
                - 0.10 * smooth(FACE + 4.0, FACE - 14.0, radius);
        let eaten = clouds(p[0] / 130.0, p[1] / 130.0, 6, 20)
            + 0.35 * (clouds(p[0] / 17.0, p[1] / 17.0, 3, 21) - 0.5);
        let rust = smooth(0.50, 0.60, eaten + near);
        let hue = clouds(p[0] / 38.0, p[1] / 38.0, 4, 22);
        let mut crust = bright.under(deep, smooth(0.35, 0.7, hue + 0.5 * (rust - 0.6)));
        crust = crust.under(black, 0.8 * smooth(0.62, 0.8, clouds(p[0] / 22.0, p[1] / 22.0, 3, 23)));
        crust = crust.shaded(0.8 + 0.4 * noise(p[0] / 3.1, p[1] / 3.1, 24));
        // Pits of rust in the bare metal, and metal shining through thin rust.
        let (pit, _) = cells(p[0] / 21.0, p[1] / 21.0, 25);
        let pitted = smooth(0.24, 0.12, pit) * smooth(0.36, 0.5, eaten + near);
        let mut coat = metal.under(crust, rust.max(0.9 * pitted));
        // Edges and the step of the face: a dark line with a light one beside it.
        let bevel = smooth(7.0, 2.0, (edge + 5.0).abs());
        coat = coat.shaded(1.0 + 0.25 * bevel - 0.55 * smooth(4.0, 0.5, (step - 1.0).abs()));
        coat.roughness = mix(coat.roughness, 0.35, 0.4 * bevel);
        ground.under(coat, share)
    })
}
