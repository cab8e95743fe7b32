//! Sheets against an independent renderer: `FOILPRESS_REFERENCE` names the script, which needs `python3` with NumPy. It
//! photographs a flat and a bent sheet from 1.2 m under a near light, and keeps the radiance of every pixel.

use std::path::{Path, PathBuf};
use std::process::Command;

use appearance::brdf::{Space, Table};
use appearance::factor::Factored;
use appearance::weights::WeightMaps;
use inks::Curve;
use observe::Silent;
use press::preview::Source;
use testing::needs::{self, Need};
use view::{Camera, Light, Lit, Pose, Renderer, Scene};

const SIZE: (usize, usize) = (480, 360);
/// Half the field of view across, and the distance of the reference's camera from its origin.
const HALF: f64 = 7.0;
const CAMERA: f64 = 1.2;
const LIGHT: [f64; 3] = [0.35, 0.10, 0.90];
const RADIUS: f64 = 0.05;

fn reference() -> Option<PathBuf> {
    needs::path(Need::Reference, "FOILPRESS_REFERENCE").filter(|_| needs::numpy())
}

fn curve(angles: &[f64], alpha: f64) -> Curve {
    Curve::sampled(angles, |t| {
        let lobe = 0.3 * inks::ggx::lobe(t, alpha);
        [0.1 + lobe, 0.07 + 0.8 * lobe, 0.02 + 0.4 * lobe]
    })
}

/// The radiance of the reference's picture, before noise and sensor.
fn photographed(script: &Path, folder: &Path, shape: &str, alpha: f64) -> Vec<[f32; 3]> {
    let csv = folder.join("curve.csv");
    let angles: Vec<f64> =
        (0..20_000).map(|n| std::f64::consts::FRAC_PI_2 * (f64::from(n) / 19_999.0).powi(2)).collect();
    curve(&angles, alpha).to_csv(std::fs::File::create(&csv).unwrap()).unwrap();
    let light = LIGHT.map(|c| c.to_string()).join(",");
    let out = folder.join("photo");
    let run = |command: &mut Command| {
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    run(Command::new("python3")
        .arg(script)
        .args(["photo", "--shape", shape, "--no-noise", "--times", "0.1", "--light", &light, "--curve"])
        .arg(&csv)
        .arg("--out-dir")
        .arg(&out));
    // The archive is compressed; plain numbers are not.
    let plain = folder.join("radiance");
    let code = "import numpy,sys; numpy.load(sys.argv[1])['radiance'].astype('<f4').tofile(sys.argv[2])";
    run(Command::new("python3").args(["-c", code]).arg(out.join("truth.npz")).arg(&plain));
    let bytes = std::fs::read(plain).unwrap();
    let values: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    assert_eq!(values.len(), 3 * SIZE.0 * SIZE.1);
    values.as_chunks::<3>().0.to_vec()
}

/// The same picture by this crate. The reference's origin is the middle of a flat sheet, and the axis of a bent one.
fn rendered(bent: bool, alpha: f64) -> (Vec<[f32; 4]>, f64) {
    let space = Space::half_angle(512);
    let mut bases = Table::new(space.columns());
    bases.push(&space.row(&curve(space.angles(), alpha)));
    let factored = Factored { space, bases, maps: WeightMaps::uniform(8, 8) };
    let width = if bent { std::f64::consts::PI * RADIUS } else { 0.12 };
    let lit = Lit::new(&Source::Factored(&factored), [width, 0.12], 64).unwrap();
    let off = if bent { RADIUS } else { 0.0 };
    let distance = CAMERA - off;
    let light = [LIGHT[0], LIGHT[1], LIGHT[2] - off];
    let across = 2.0 * distance * HALF.to_radians().tan();
    let scene = Scene {
        camera: Camera {
            towards: [0.0, 0.0, 1.0],
            distance: Some(distance),
            middle: [0.0; 2],
            height: across * SIZE.1 as f64 / SIZE.0 as f64,
        },
        pose: Pose { curl: bent.then_some(RADIUS), ..Pose::default() },
        lights: vec![Light::Near(light)],
        probe: None,
    };
    let picture = Renderer::new(&lit).render(&scene, SIZE.0, SIZE.1, &Silent).unwrap();
    // Its lamp has the intensity that gives grey of 18 % at its origin a radiance of 1; ours has irradiance 1 at ours.
    let square = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>();
    let intensity = std::f64::consts::PI / 0.18 * square(LIGHT);
    (picture.pixels, intensity / square(light))
}

#[test]
fn sheets_agree_with_the_reference_within_half_a_per_cent() {
    let Some(script) = reference() else { return };
    for (shape, alpha) in [("flat", 0.1), ("flat", 0.3), ("cylinder", 0.15), ("cylinder", 0.3)] {
        let folder = tempfile::tempdir().unwrap();
        let expected = photographed(&script, folder.path(), shape, alpha);
        let (found, scale) = rendered(shape == "cylinder", alpha);
        let (mut worst, mut sum, mut compared) = (0.0f64, 0.0, 0);
        for (i, pixel) in found.iter().enumerate() {
            let (x, y) = (i % SIZE.0, i / SIZE.0);
            // Whole pixels of the sheet, lit all over, away from the card beside it and from grazing angles.
            let inside = (x.saturating_sub(2)..(x + 3).min(SIZE.0))
                .flat_map(|x| (y.saturating_sub(2)..(y + 3).min(SIZE.1)).map(move |y| y * SIZE.0 + x))
                .all(|n| found[n][3] == 1.0 && found[n][0] > 0.002 && expected[n][0] > 0.0);
            if !inside {
                continue;
            }
            for c in 0..3 {
                let off = (f64::from(pixel[c]) * scale / f64::from(expected[i][c]) - 1.0).abs();
                worst = worst.max(off);
                sum += off;
                compared += 1;
            }
        }
        let mean = sum / f64::from(compared);
        println!("{shape}, alpha {alpha}: {compared} values, mean {mean:.5}, worst {worst:.5}");
        assert!(
            compared > 60_000 && mean < 0.001 && worst < 0.005,
            "{shape} {alpha}: {compared} values, mean {mean}, worst {worst}"
        );
    }
}
