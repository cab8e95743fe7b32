//! Every edit is seen on every basis, whatever made the bases.
//!
//! What a change looks like is judged on a ball under a lamp at the eye, drawn here from the samples of the curve by straight lines: nothing
//! of the edits, of the nearest surface, or of the renderer is used.

use super::super::*;
use crate::brdf::{Space, Table};
use crate::factor::{FactorSettings, Method, factor};
use crate::materials::Factored;
use crate::weights::WeightMaps;
use observe::Silent;

/// Places from the middle of the ball to its rim.
const PLACES: usize = 600;

/// A ball as it looks.
#[derive(Debug)]
struct Look {
    /// Light of all of it, for each channel.
    light: [f64; 3],
    /// Green light in its middle, and half-way to its rim.
    middle: f64,
    beside: f64,
    /// The ball's radius around the middle that half of the light of the highlight comes from; 0 without any.
    highlight: f64,
}

fn look(space: &Space, row: &[f64]) -> Look {
    let angles = space.angles();
    let at = |theta: f64, c: usize| {
        let above = angles.partition_point(|&a| a < theta).clamp(1, angles.len() - 1);
        let part = ((theta - angles[above - 1]) / (angles[above] - angles[above - 1])).clamp(0.0, 1.0);
        row[3 * (above - 1) + c] * (1.0 - part) + row[3 * above + c] * part
    };
    // A ring of the ball at r shows the half angle asin r and receives cos theta; beside the highlight is the body.
    let ring = |i: usize| (i as f64 + 0.5) / PLACES as f64;
    let body = (0..PLACES).map(|i| at(ring(i).asin(), 1)).fold(f64::INFINITY, f64::min);
    let (mut light, mut shine) = ([0.0; 3], Vec::new());
    for r in (0..PLACES).map(ring) {
        let (theta, area) = (r.asin(), 2.0 * r / PLACES as f64);
        (0..3).for_each(|c| light[c] += at(theta, c) * theta.cos() * area);
        // To 45 degrees: at the rim Fresnel's rise is no part of it.
        if theta < std::f64::consts::FRAC_PI_4 {
            shine.push((at(theta, 1) - body) * theta.cos() * area);
        }
    }
    let half = 0.5 * shine.iter().sum::<f64>();
    let mut sum = 0.0;
    let inside = shine.iter().take_while(|part| {
        sum += **part;
        sum < half
    });
    Look { light, middle: at(0.0, 1), beside: at(0.5, 1), highlight: inside.count() as f64 / PLACES as f64 }
}

/// How the look of each basis changes with an edit of that basis; only its own.
fn changes(document: &Factored, surface: Surface) -> Vec<(Look, Look)> {
    let space = &document.space;
    let edit = |basis: usize| {
        let step = Step { change: Change::Surface { basis: Some(basis), surface }, mask: None };
        let edited = apply(document, &[step]).unwrap();
        for other in (0..document.bases.len()).filter(|&other| other != basis) {
            assert_eq!(edited.document.bases.row(other), document.bases.row(other));
        }
        assert_eq!(edited.document.maps, document.maps);
        (look(space, document.bases.row(basis)), look(space, edited.document.bases.row(basis)))
    };
    (0..document.bases.len()).map(edit).collect()
}

/// What is not seen of edits of each basis.
fn unseen(name: &str, document: &Factored) -> String {
    let sum = |look: &Look| look.light.iter().sum::<f64>();
    let named = |basis: usize, what: &str, looks: &(Look, Look)| {
        format!("{name}, basis {basis}, {what}: {:?}\nwas {:?}", looks.1, looks.0)
    };
    let mut unseen = Vec::new();
    for (what, surface) in [
        ("darker", Surface { albedo: 0.5, ..Surface::default() }),
        ("tinted", Surface { tint: Tint([255, 128, 128]), ..Surface::default() }),
        ("rougher", Surface { rougher: 2.0, ..Surface::default() }),
        ("glossier", Surface { rougher: 0.6, ..Surface::default() }),
    ] {
        for (basis, looks) in changes(document, surface).iter().enumerate() {
            let (before, after) = looks;
            let seen = match what {
                // A dielectric's highlight stays as it is.
                "darker" => (0.45..0.97).contains(&(sum(after) / sum(before))),
                "tinted" => {
                    let warmth = |look: &Look| look.light[0] / (look.light[1] + look.light[2]).max(1e-9);
                    warmth(after) > 1.05 * warmth(before) && sum(after) < sum(before)
                }
                // A matt basis has no highlight that could become much wider or narrower.
                "rougher" if before.middle < 1.1 * before.beside => after.middle <= 1.01 * before.middle,
                "glossier" if before.middle < 1.1 * before.beside => after.middle >= 0.99 * before.middle,
                "rougher" => after.highlight > 1.15 * before.highlight && after.middle < 0.8 * before.middle,
                _ => after.highlight < 0.9 * before.highlight && after.middle > 1.2 * before.middle,
            };
            if !seen {
                unseen.push(named(basis, what, looks));
            }
        }
    }
    unseen.join("\n")
}

/// The dove by each method and few bases.
#[test]
fn edits_of_the_dove_are_seen_on_every_basis_of_every_method() {
    let document = crate::document::open("sample:dove", &Default::default(), &Silent).unwrap();
    for method in [Method::Archetypes, Method::Kmeans, Method::Sacls] {
        let settings = FactorSettings { method, bases: Some(3), ..FactorSettings::default() };
        let factored = factor(document.materials(), &settings, &Silent).unwrap().factored;
        assert_eq!(unseen(&format!("{method:?}"), &factored), "");
    }
}

/// Bases that lie outside the materials of a document, as those of a factorization without bounds do: a highlight less that of
/// another material is a hole.
#[test]
fn edits_are_seen_on_bases_with_holes() {
    let space = Space::half_angle(32);
    let material = |kd: [f64; 3], f0: [f64; 3], alpha: f64| {
        let lobes = vec![inks::Lobe { f0, alpha }];
        space.row(&inks::Lobes { kd, entering: 0.96, lobes }.curve(space.angles()))
    };
    let materials = [
        material([0.03, 0.08, 0.25], [0.04; 3], 0.6),
        material([0.0; 3], [0.95, 0.93, 0.88], 0.12),
        material([0.06, 0.12, 0.03], [0.04; 3], 0.15),
    ];
    let mut bases = Table::new(space.columns());
    for (a, one) in materials.iter().enumerate() {
        for (_, other) in materials.iter().enumerate().filter(|(b, _)| *b != a) {
            for part in [0.02, 0.3] {
                let outside = |(one, other): (&f64, &f64)| (one + part * (one - other)).max(0.0);
                bases.push(&one.iter().zip(other).map(outside).collect::<Vec<_>>());
            }
        }
    }
    let holes = bases.rows().filter(|row| row[1] == 0.0).count();
    assert!(holes >= 2, "{holes}");
    let maps = WeightMaps::uniform(4, 4);
    let mut all = String::new();
    for (i, row) in bases.rows().enumerate() {
        let mut one = Table::new(space.columns());
        one.push(row);
        println!("{i}: {:.3?}", crate::materials::Nearest::to(&space, row));
        all += &unseen(&format!("{i}"), &Factored { space: space.clone(), bases: one, maps: maps.clone() });
    }
    assert_eq!(all, "");
}
