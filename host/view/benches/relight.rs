//! A relit frame of 1024 x 1024 pixels and eight bases: `cargo bench -p foilpress-view --bench relight`.

use appearance::brdf::{Space, Table};
use appearance::factor::Factored;
use appearance::weights::{ONE, WeightMaps};
use divan::Bencher;
use inks::Curve;
use observe::Silent;
use press::preview::{Probe, Source};
use view::{Camera, Light, Lit, Pose, Renderer, Scene, direction};

const SIDE: usize = 1024;

fn main() {
    divan::main();
}

fn lit(bases: usize) -> Lit {
    let space = Space::half_angle(32);
    let mut rows = Table::new(space.columns());
    for i in 0..bases {
        let (diffuse, alpha) = (0.02 * i as f64, 0.04 + 0.03 * i as f64);
        rows.push(&space.row(&Curve::sampled(space.angles(), |t| [diffuse + inks::ggx::lobe(t, alpha); 3])));
    }
    let weights = |i: usize| {
        let mut weights = vec![0; bases];
        let (first, part) = (i.wrapping_mul(2_654_435_761) >> 7, (i as u16).wrapping_mul(40_503) >> 1);
        weights[first % bases] += part.min(ONE);
        weights[(first / 11) % bases] += ONE - part.min(ONE);
        weights
    };
    let data = (0..SIDE * SIDE).flat_map(weights).collect();
    let maps = WeightMaps::new(SIDE, SIDE, bases, data).expect("weights sum to one");
    Lit::new(&Source::Factored(&Factored { space, bases: rows, maps }), [0.1, 0.1], SIDE).expect("a document")
}

fn scene(distance: Option<f64>, curl: Option<f64>, probe: Option<Probe>) -> Scene {
    Scene {
        camera: Camera::whole(direction(10.0, 5.0), distance, [0.1, 0.1], 1.0),
        pose: Pose { turn: 0.1, tip: 0.0, curl },
        lights: if probe.is_none() { vec![Light::Near([0.1, 0.1, 0.4])] } else { Vec::new() },
        probe,
    }
}

#[divan::bench(args = [8, 24], sample_count = 20)]
fn far_eye(bencher: Bencher, bases: usize) {
    let (lit, scene) = (lit(bases), scene(None, None, None));
    let renderer = Renderer::new(&lit);
    bencher.bench_local(|| renderer.render(&scene, SIDE, SIDE, &Silent));
}

#[divan::bench(args = [8, 24], sample_count = 20)]
fn near_eye(bencher: Bencher, bases: usize) {
    let (lit, scene) = (lit(bases), scene(Some(0.5), None, None));
    let renderer = Renderer::new(&lit);
    bencher.bench_local(|| renderer.render(&scene, SIDE, SIDE, &Silent));
}

#[divan::bench(args = [8], sample_count = 20)]
fn bent(bencher: Bencher, bases: usize) {
    let (lit, scene) = (lit(bases), scene(Some(0.5), Some(0.1), None));
    let renderer = Renderer::new(&lit);
    bencher.bench_local(|| renderer.render(&scene, SIDE, SIDE, &Silent));
}

#[divan::bench(args = [8], sample_count = 5)]
fn under_a_probe(bencher: Bencher, bases: usize) {
    let (lit, scene) = (lit(bases), scene(Some(0.5), Some(0.1), Some(Probe::studio(128))));
    let renderer = Renderer::new(&lit);
    bencher.bench_local(|| renderer.render(&scene, SIDE, SIDE, &Silent));
}
