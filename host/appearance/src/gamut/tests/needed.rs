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

/// Every cartridge that is printed serves a material: removed by itself, each pixel fitted from nothing and
/// from several starts, some surface of the document gets worse by what is worth it, or loses its hue.
#[test]
fn no_cartridge_is_left_that_brings_nothing() {
    let space = space();
    for (document, metal) in [(wood(), false), (metals(), true)] {
        let printable = Printable::from_library(&Library::builtin(), &InkSet::default(), &space);
        let all = Candidates::new(&space, &printable, LIGHT).unwrap();
        let mapped = clamped(&document, &printable, &GamutSettings::default(), &Silent).unwrap();
        let inks = &mapped.report.cartridges;
        let fits = |left: Option<Ink>| -> Vec<(f64, bool)> {
            let holds = |k: usize| all.inks[k].iter().all(|i| Some(i) != left && inks.contains(&i));
            let hull = all.free.subset(&(0..all.len()).filter(|&k| holds(k)).collect::<Vec<_>>());
            let rows = document.surfaces.iter().map(|s| {
                let target = hull.target(&document.space.row(&s.curve(space.angles()))).unwrap();
                let best = Mixer::new().best(&hull, &target).unwrap();
                (best.fit.objective, hull.keeps_hue(&best.weights, &target))
            });
            rows.collect()
        };
        let with = fits(None);
        for &ink in inks {
            let without = fits(Some(ink));
            let gains = |(a, b): (&(f64, bool), &(f64, bool))| b.0 - a.0 > 0.0045 || a.1 && !b.1;
            assert!(with.iter().zip(&without).any(gains), "{ink:?} of {inks:?} serves no surface");
        }
        assert_eq!(inks.iter().any(|ink| ink.kind() == protocol::ink::Kind::Metallic), metal, "{inks:?}");
    }
}
