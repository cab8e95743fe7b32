//! Balls against an independent renderer, where there is one: `FOILPRESS_REFERENCE` names the script, which needs
//! `python3` with NumPy. It takes a curve as CSV and a panorama as `.npy`, and writes radiance as `.npy`.

use std::path::{Path, PathBuf};
use std::process::Command;

use appearance::brdf::{Space, Table};
use inks::Curve;
use observe::Silent;
use press::preview::{Probe, Radiance, sphere};
use testing::needs::{self, Need};

/// Where the reference is, if it can run here.
fn reference() -> Option<PathBuf> {
    needs::path(Need::Reference, "FOILPRESS_REFERENCE").filter(|_| needs::numpy())
}

/// Diffuse reflectance, F0 and width as a curve at these angles.
fn curve(angles: &[f64], (diffuse, f0, alpha): (f64, f64, f64)) -> Curve {
    Curve::sampled(angles, |t| {
        let lobe = f0 * inks::ggx::lobe(t, alpha);
        [diffuse + lobe, 0.7 * diffuse + lobe, 0.2 * diffuse + 0.5 * lobe]
    })
}

/// The lobes themselves, at so many angles that straight lines between them do, which is what the reference draws.
fn write_curve(path: &Path, material: (f64, f64, f64)) {
    const ROWS: u32 = 20_000;
    let angle = |n: u32| std::f64::consts::FRAC_PI_2 * (f64::from(n) / f64::from(ROWS - 1)).powi(2);
    let angles: Vec<f64> = (0..ROWS).map(angle).collect();
    curve(&angles, material).to_csv(std::fs::File::create(path).unwrap()).unwrap();
}

/// NumPy's format, version 1: magic, length of the header, a Python dictionary padded to 64 bytes, then the data.
fn write_npy(path: &Path, probe: &Probe) {
    let shape = format!("({}, {}, 3)", probe.height(), probe.width());
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(probe.rgb().iter().flatten().flat_map(|v| v.to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

fn read_npy(path: &Path, values: usize) -> Vec<[f32; 4]> {
    let bytes = std::fs::read(path).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..start]);
    assert!(header.contains("'<f4'") && header.contains("False"), "{header}");
    let numbers: Vec<f32> =
        bytes[start..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers.len(), 4 * values);
    numbers.chunks_exact(4).map(|p| p.try_into().unwrap()).collect()
}

fn run(script: &Path, mode: &str, args: &[&str], curve: &Path, out: &Path, size: usize) -> Vec<[f32; 4]> {
    let status = Command::new("python3")
        .arg(script)
        .arg(mode)
        .args(["--size", &size.to_string(), "--curve"])
        .arg(curve)
        .arg("--out")
        .arg(out)
        .args(args)
        .output()
        .unwrap();
    assert!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    read_npy(out, size * size)
}

/// Greatest difference over wholly covered pixels, as a share of the pixel or, where it is darker, of the mean; and root mean
/// square difference, as a share of the ball's root mean square. By itself a pixel at the rim may be farther off: beyond the last sample, at
/// 87 degrees, nobody knows the curve.
fn difference(ours: &Radiance, theirs: &[[f32; 4]]) -> (f64, f64) {
    let covered = || ours.pixels.iter().zip(theirs).filter(|(_, b)| b[3] > 0.999);
    let each = || covered().flat_map(|(a, b)| (0..3).map(|c| (f64::from(a[c]), f64::from(b[c]))));
    assert!(covered().all(|(a, _)| a[3] == 1.0), "both cover the same pixels");
    let n = each().count() as f64;
    assert!(n > 0.0);
    let mean = each().map(|(_, b)| b).sum::<f64>() / n;
    let most = each().map(|(a, b)| (a - b).abs() / b.max(mean)).fold(0.0, f64::max);
    let squares = |value: fn((f64, f64)) -> f64| each().map(value).map(|v| v * v).sum::<f64>();
    (most, (squares(|(a, b)| a - b) / squares(|(_, b)| b)).sqrt())
}

/// White paper and silver foil on primer: the dullest and the sharpest thing that can be printed.
const PAPER: (f64, f64, f64) = (0.27, 0.04, 0.28);
const FOIL: (f64, f64, f64) = (0.005, 0.85, 0.045);
/// The sharpest thing that a document can have.
const MIRROR: (f64, f64, f64) = (0.005, 0.9, 0.02);
/// Samples of a curve, as everywhere in the program.
const SAMPLES: usize = 32;

#[test]
fn a_ball_lit_from_the_eye_is_the_references_ball() {
    let Some(script) = reference() else { return };
    let dir = tempfile::tempdir().unwrap();
    let space = Space::half_angle(SAMPLES);
    for material in [PAPER, FOIL, MIRROR] {
        let curve = curve(space.angles(), material);
        let (csv, out) = (dir.path().join("curve.csv"), dir.path().join("ball.npy"));
        write_curve(&csv, material);
        let theirs = run(&script, "sphere-dir", &[], &csv, &out, 96);
        let (most, rms) = difference(&sphere::under_light(&curve, [0.0, 0.0, 1.0], 96).unwrap(), &theirs);
        println!("{material:?}: greatest difference {most:.2e} of a pixel, rms {rms:.2e} of the ball");
        assert!(most < 0.005 && rms < 0.005, "{material:?}: greatest {most}, rms {rms}");
    }
}

/// A glTF file with a clear coat, read and lit, against the reference with both lobes by the extension's formula.
#[test]
fn a_ball_under_a_clear_coat_is_the_references_ball() {
    let Some(script) = reference() else { return };
    let dir = tempfile::tempdir().unwrap();
    let (csv, out) = (dir.path().join("curve.csv"), dir.path().join("ball.npy"));
    for (weight, base, coat) in [(1.0, 0.6, 0.3), (0.5, 0.7, 0.25)] {
        let gltf = format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_materials_clearcoat"], "materials": [{{"name": "lacquer",
            "pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.2, 0.1, 1], "metallicFactor": 0, "roughnessFactor": {base}}},
            "extensions": {{"KHR_materials_clearcoat": {{"clearcoatFactor": {weight}, "clearcoatRoughnessFactor": {coat}}}}}}}]}}"#
        );
        let path = dir.path().join("lacquer.gltf");
        std::fs::write(&path, gltf).unwrap();
        let document =
            appearance::document::open(path.to_str().unwrap(), &Default::default(), &Silent).unwrap();
        let space = document.materials().space();
        let mut row = vec![0.0f32; space.columns()];
        document.materials().reflectance(0, &mut row);
        let ours = space.curve(&row.into_iter().map(f64::from).collect::<Vec<_>>());
        // The base under the coat, which light passes twice, and the coat's own lobe.
        let expected = |f0: f64| {
            let angle = |n: u32| std::f64::consts::FRAC_PI_2 * (f64::from(n) / 19_999.0).powi(2);
            let angles: Vec<f64> = (0..20_000).map(angle).collect();
            Curve::sampled(&angles, |t| {
                [0.5, 0.2, 0.1].map(|colour: f64| {
                    let below = colour * 0.96 / std::f64::consts::PI + 0.04 * inks::ggx::lobe(t, base * base);
                    (1.0 - weight + weight * (1.0 - f0) * (1.0 - f0)) * below
                        + weight * f0 * inks::ggx::lobe(t, coat * coat)
                })
            })
        };
        let compare = |curve: &Curve| {
            curve.to_csv(std::fs::File::create(&csv).unwrap()).unwrap();
            let theirs = run(&script, "sphere-dir", &[], &csv, &out, 96);
            difference(&sphere::under_light(&ours, [0.0, 0.0, 1.0], 96).unwrap(), &theirs)
        };
        let (most, rms) = compare(&expected(0.04));
        println!("coat {weight}: greatest difference {most:.2e} of a pixel, rms {rms:.2e} of the ball");
        assert!(most < 0.01 && rms < 0.005, "coat {weight}: greatest {most}, rms {rms}");
        // A coat of another index, or none, is another ball.
        for f0 in [0.0, 0.05] {
            assert!(compare(&expected(f0)).1 > 0.01, "f0 {f0}");
        }
    }
}

#[test]
fn balls_under_a_probe_are_the_references_balls() {
    let Some(script) = reference() else { return };
    let dir = tempfile::tempdir().unwrap();
    let space = Space::half_angle(SAMPLES);
    let mut cases = vec![(Probe::studio(64), PAPER)];
    match needs::data() {
        Some(data) => cases.push((Probe::read(&data.join("env/studio.hdr")).unwrap().resized(64), FOIL)),
        None => cases.push((Probe::studio(64), FOIL)),
    }
    for (probe, material) in &cases {
        let curve = curve(space.angles(), *material);
        let at = |name: &str| dir.path().join(name);
        let (csv, env, out) = (at("curve.csv"), at("env.npy"), at("ball.npy"));
        write_curve(&csv, *material);
        write_npy(&env, probe);
        let args = ["--env", env.to_str().unwrap(), "--env-height", "64"];
        let theirs = run(&script, "sphere-env", &args, &csv, &out, 40);
        let mut rows = Table::new(space.columns());
        rows.push(&space.row(&curve));
        let ours = &sphere::under_probe(&space, &rows, probe, 40, &Silent).unwrap()[0];
        // The reference takes one sample a pixel and counts as covered what that sample hits.
        let inner: Vec<[f32; 4]> =
            theirs.iter().zip(&ours.pixels).map(|(t, o)| if o[3] == 1.0 { *t } else { [0.0; 4] }).collect();
        let (most, rms) = difference(ours, &inner);
        println!("{material:?}: greatest difference {most:.2e} of a pixel, rms {rms:.2e} of the ball");
        assert!(rms < 5e-3 && most < 5e-3, "{material:?}: greatest {most}, rms {rms}");
    }
}
