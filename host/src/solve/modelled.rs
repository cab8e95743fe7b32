//! Test-only: the 57 stacks by the layering rules, until the library itself is here.
use crate::brdf::{Space, Table};
use inks::{Curve, Stack};
use protocol::ink::{Ink, Kind};

type Rgb = [f64; 3];
const PAPER: Rgb = [0.842, 0.854, 0.884];
const AL: Rgb = [0.908, 0.916, 0.921];

pub const NAMES: &str = "substrate C M Y K MC MM MG MS GF SF F P C+M C+Y M+Y C+M+Y C+F M+F Y+F K+F C+M+F C+Y+F M+Y+F C+M+Y+F \
MC+F MM+F MG+F MS+F GF+F SF+F MS+C MS+M MS+Y MS+C+M MS+C+Y MS+M+Y SF+C SF+M SF+Y SF+C+M SF+C+Y SF+M+Y MG+C MG+M MG+Y \
GF+C GF+M P+SF P+GF P+MS P+MG MS+C+F MS+M+F MS+Y+F P+F MS+K";

pub fn stacks() -> Vec<Stack> {
    NAMES.split_whitespace().map(|n| n.parse().unwrap()).collect()
}

fn mul(a: Rgb, b: Rgb) -> Rgb {
    std::array::from_fn(|c| a[c] * b[c])
}
fn scale(a: Rgb, s: f64) -> Rgb {
    a.map(|v| v * s)
}

fn transmittance(ink: Ink) -> Rgb {
    let solid: Rgb = match ink {
        Ink::Cyan => [0.012, 0.310, 0.701],
        Ink::Magenta => [0.690, 0.012, 0.196],
        Ink::Yellow => [0.842, 0.747, 0.012],
        _ => [0.021; 3],
    };
    std::array::from_fn(|c| (solid[c] / PAPER[c]).min(1.0))
}

pub fn curve(stack: &Stack, theta: &[f64]) -> Curve {
    let mut kd = PAPER;
    let mut lobes: Vec<(Rgb, f64)> = vec![([0.04; 3], 0.28)];
    let (mut metal, mut primed) = (false, false);
    for &ink in stack.layers() {
        match ink.kind() {
            Kind::Process => {
                let t = transmittance(ink);
                kd = mul(kd, t);
                let gloss = ([0.04; 3], if ink == Ink::Black { 0.14 } else { 0.12 });
                if metal {
                    lobes[0] = (scale(mul(lobes[0].0, t), 0.92), lobes[0].1 * 1.05);
                    lobes.truncate(1);
                    lobes.push(gloss);
                } else {
                    lobes = vec![gloss];
                }
            }
            Kind::Metallic | Kind::Foil => {
                metal = true;
                let tint = |i| transmittance(i);
                let (d, f, a, binder) = match ink {
                    Ink::MetallicSilver => ([0.1; 3], scale(AL, 0.62), 0.27, true),
                    Ink::MetallicGold => {
                        (scale([1.0, 0.75, 0.35], 0.09), mul(scale(AL, 0.6), [0.98, 0.74, 0.36]), 0.29, true)
                    }
                    Ink::MetallicCyan => (
                        scale(tint(Ink::Cyan), 0.1),
                        mul(scale(AL, 0.58), tint(Ink::Cyan).map(|t| t.powf(0.8))),
                        0.31,
                        true,
                    ),
                    Ink::MetallicMagenta => (
                        scale(tint(Ink::Magenta), 0.1),
                        mul(scale(AL, 0.58), tint(Ink::Magenta).map(|t| t.powf(0.8))),
                        0.31,
                        true,
                    ),
                    Ink::SilverFoil => ([0.015; 3], scale(AL, 0.93), 0.06, false),
                    _ => ([0.015; 3], mul(scale(AL, 0.93), [0.99, 0.78, 0.36]), 0.06, false),
                };
                let a = a * match (primed, binder) {
                    (true, true) => 0.88,
                    (true, false) => 0.75,
                    _ => 1.0,
                };
                kd = d;
                lobes = vec![(f, a)];
                if binder {
                    lobes.push(([0.02; 3], 0.3));
                }
            }
            Kind::Finish => {
                kd = kd.map(|k| 0.96 * 0.7 * k / (1.0 - 0.3 * k));
                if metal {
                    lobes[0] = (scale(lobes[0].0, 0.96 * 0.96), lobes[0].1 * 1.15);
                    lobes.truncate(1);
                } else {
                    lobes.clear();
                }
                lobes.push(([0.04; 3], 0.05));
            }
            Kind::Primer => {
                primed = true;
                kd = scale(kd, 0.97);
                lobes[0].1 *= 0.75;
            }
            Kind::White => {}
        }
    }
    Curve::sampled(theta, |t| {
        std::array::from_fn(|c| {
            0.96 * kd[c] / std::f64::consts::PI
                + lobes.iter().map(|(f, a)| f[c] * inks::ggx::lobe(t, *a)).sum::<f64>()
        })
    })
}

pub fn table(space: &Space) -> Table {
    let mut table = Table::new(space.columns());
    for stack in stacks() {
        table.push(&space.row(&curve(&stack, space.angles())));
    }
    table
}
