//! Cartridges that bring nothing, by trying every one.

use super::*;
use crate::gamut::candidates::Candidates;
use crate::gamut::settings::LIGHT;
use crate::solve::Mixer;

const SIDE: usize = 16;

/// Brown wood under varnish, its rings as sines: no metal, so no metallic ink is any use.
fn wood() -> Field {
    let surfaces = (0..SIDE * SIDE).map(|pixel| {
        let (x, y) = ((pixel % SIDE) as f32, (pixel / SIDE) as f32);
        let ring = 0.5 + 0.5 * (0.9 * x + 1.5 * (0.4 * y).sin()).sin();
        let pore = 0.5 + 0.5 * (2.7 * x + 0.3 * y).sin();
        let diffuse = [[0.26, 0.07], [0.13, 0.03], [0.05, 0.012]].map(|[a, b]| a * ring + b * (1.0 - ring));
        surface(diffuse.map(|d| d * (0.8 + 0.2 * pore)), [0.04; 3], 0.09 + 0.25 * pore)
    });
    Field { space: space(), width: SIDE, surfaces: surfaces.collect() }
}

/// Two metals and a paint beside each other: foils and process inks are all of use.
fn metals() -> Field {
    let surfaces = (0..SIDE * SIDE).map(|pixel| {
        let (part, other) = ((pixel % SIDE) as f32 / SIDE as f32, (pixel / SIDE) as f32 / SIDE as f32);
        match pixel % 3 {
            0 => surface(
                [0.0; 3],
                [0.7, 0.5 + 0.2 * part, 0.3].map(|c| c * (0.6 + 0.4 * other)),
                0.2 + 0.2 * part,
            ),
            1 => surface([0.0; 3], [0.5; 3].map(|c| c * (0.5 + 0.5 * part)), 0.15 + 0.2 * other),
            _ => surface([0.4 * part, 0.05, 0.05 + 0.2 * other], [0.04; 3], 0.3),
        }
    });
    Field { space: space(), width: SIDE, surfaces: surfaces.collect() }
}

#[test]
fn no_cartridge_is_left_that_brings_nothing() {
    let space = space();
    for (document, metal) in [(wood(), false), (metals(), true)] {
        let printable = Printable::from_library(&Library::builtin(), &InkSet::default(), &space);
        let all = Candidates::new(&space, &printable, LIGHT).unwrap();
        // As many pixels as the choice is made by, so every one of them is looked at.
        let mapped = clamped(&document, &printable, &GamutSettings::default(), &Silent).unwrap();
        let inks = &mapped.report.cartridges;
        // Each pixel fitted from nothing, from several starts, to all that these cartridges print.
        let distance = |left: Option<Ink>| {
            let holds = |k: usize| all.inks[k].iter().all(|i| Some(i) != left && inks.contains(&i));
            let hull = all.free.subset(&(0..all.len()).filter(|&k| holds(k)).collect::<Vec<_>>());
            let rows = document.surfaces.iter().map(|s| {
                let target = hull.target(&document.space.row(&s.curve(space.angles()))).unwrap();
                Mixer::new().best(&hull, &target).unwrap().fit.distance.powi(2)
            });
            (rows.sum::<f64>() / document.surfaces.len() as f64).sqrt()
        };
        let with = distance(None);
        for &ink in inks {
            let without = distance(Some(ink));
            // The choice tells distances apart to a thousandth of these limits.
            assert!(without > with + (0.0095 * with).max(4.9e-5), "{ink:?} of {inks:?}: {with} {without}");
        }
        assert_eq!(inks.iter().any(|ink| ink.kind() == protocol::ink::Kind::Metallic), metal, "{inks:?}");
    }
}
