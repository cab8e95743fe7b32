//! Mirrors narrower than a pixel: whatever cannot be known of their peaks is marked, and what is called measured is true.
//!
//! Pixels are made here: each is the mean of rays through its area, under a lamp without extent.

use inks::ggx;
use measure::curves::extent::Pixel;
use measure::curves::reduce::{CurveRow, Doubts, SampleOrigin, reduce};
use measure::geometry::scene::Scene;
use measure::setup::Setup;
use rayon::prelude::*;

const SIZE: (usize, usize) = (240, 200);
const FIELD_DEG: f64 = 7.0;
/// Half angles that are photographed.
const WIDEST_DEG: f64 = 9.0;

fn scene() -> Scene {
    let setup = Setup::parse(&format!(
        "format = 1\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\n\
         [camera]\nposition_mm = [0, 0, 1200]\nfield_of_view_deg = {FIELD_DEG}\n\
         [[light]]\nposition_mm = [353, 30, 898]\n\
         [sample]\nshape = \"cylinder\"\nradius_mm = 50\nheight_mm = 100\nstack = \"SF\"\n\
         [exposures]\n\"a.png\" = 1\n"
    ))
    .unwrap();
    Scene::new(&setup, SIZE, FIELD_DEG.to_radians()).unwrap()
}

fn mirror(theta: f64, alpha: f64) -> f64 {
    0.005 + 0.9 * ggx::lobe(theta, alpha)
}

/// The curve of a can of this mirror around its highlight.
fn measured(alpha: f64) -> Vec<CurveRow> {
    let scene = scene();
    let pixels: Vec<Pixel> = (0..SIZE.0 * SIZE.1)
        .into_par_iter()
        .filter_map(|i| {
            let (x, y) = ((i % SIZE.0) as f64, (i / SIZE.0) as f64);
            let middle =
                scene.view(x + 0.5, y + 0.5, 0).filter(|view| view.theta < WIDEST_DEG.to_radians())?;
            // Rays across and down a pixel: along the can the half angle changes little.
            let (across, down) = if middle.theta < 0.03 { (160, 8) } else { (12, 4) };
            let mut light = 0.0;
            for k in 0..across * down {
                let part = |k: usize, of: usize| (k as f64 + 0.5) / of as f64;
                let view = scene.view(x + part(k % across, across), y + part(k / across, down), 0)?;
                light += mirror(view.theta, alpha) * view.irradiance / (across * down) as f64;
            }
            (light > 0.0).then_some(Pixel {
                x: x + 0.5,
                y: y + 0.5,
                light: 0,
                value: [light; 3],
                variance: [1e-6; 3],
                bound: 0,
                first: 0,
            })
        })
        .collect();
    reduce(&scene, &pixels, &Doubts { card: 0.005, ..Doubts::default() }).rows
}

#[test]
fn what_is_called_measured_is_true_however_narrow_the_mirror() {
    // A pixel is 0.7 degrees of the can, the lobe of alpha 0.01 as wide; printed foil has 0.045.
    for (alpha, resolved) in [(0.0005, false), (0.001, false), (0.003, false), (0.01, true), (0.03, true)] {
        let rows = measured(alpha);
        let blurred = rows.iter().filter(|row| row.kind == SampleOrigin::Blurred).count();
        assert_eq!(blurred == 0, resolved, "alpha {alpha}: {blurred} rows are blurred");
        for row in rows.iter().filter(|row| row.theta_deg < WIDEST_DEG - 1.0) {
            let (found, sigma) = (row.rgb[1], row.sigma[1] / row.rgb[1]);
            let off = mirror(row.theta_deg.to_radians(), alpha) / found - 1.0;
            println!(
                "{alpha:<6} {:6.3} {:12} {:4} pixels {found:10.4}, truth {:+7.1} %, sigma {:5.1} %",
                row.theta_deg,
                row.kind.word(),
                row.pixels,
                100.0 * off,
                100.0 * sigma
            );
            let limit = if row.kind == SampleOrigin::Measured { 0.07 } else { 0.3 };
            assert!(off.abs() <= limit || off.abs() <= 2.0 * sigma || sigma >= 1.0, "alpha {alpha}: {row:?}");
            assert!(row.kind != SampleOrigin::Measured || off.abs() <= 0.25, "alpha {alpha}: {row:?}");
        }
    }
}
