//! Equation 1 for one basis: all starts, one start, and a start from a neighbour's solution.

#![allow(clippy::disallowed_methods, reason = "it decides no dot of a job")]

use appearance::brdf::Space;
use appearance::document::Surface;
use appearance::gamut::{LIGHT, Printable};
use appearance::solve::{Hull, Mixer, Target};
use divan::{Bencher, black_box};
use inks::{InkSet, Library};
use protocol::ink::Ink;

/// 57 stacks, 32 samples, and thirty surfaces from matte paint to polished metal.
fn problem() -> (Hull, Vec<Target>) {
    let space = Space::half_angle(32);
    let printable = Printable::from_library(&Library::builtin(), &InkSet::of(Ink::ALL), &space);
    let hull = Hull::new(&space, &printable.curves, &vec![0.0; printable.stacks.len()], LIGHT).unwrap();
    let targets = (0..30)
        .map(|i| {
            let (m, hue) = ((i % 6) as f32 / 5.0, (i % 5) as f32 / 4.0);
            let base = [0.8 - 0.5 * hue, 0.5, 0.2 + 0.6 * hue];
            let surface = Surface {
                diffuse: base.map(|b| b * (1.0 - m)),
                f0: base.map(|b| 0.04 * (1.0 - m) + b * m),
                alpha: 0.03 + 0.02 * i as f32,
            };
            hull.target(&space.row(&surface.curve(space.angles()))).unwrap()
        })
        .collect();
    (hull, targets)
}

#[divan::bench]
fn all_starts(bencher: Bencher) {
    let (hull, targets) = problem();
    let mut mixer = Mixer::new();
    bencher.counter(divan::counter::ItemsCount::new(targets.len())).bench_local(|| {
        for target in &targets {
            black_box(mixer.best(&hull, target).unwrap());
        }
    });
}

#[divan::bench]
fn tangent_start(bencher: Bencher) {
    let (hull, targets) = problem();
    let mut mixer = Mixer::new();
    let mut a = vec![0.0; hull.len()];
    bencher.counter(divan::counter::ItemsCount::new(targets.len())).bench_local(|| {
        for target in &targets {
            mixer.tangent(&hull, target, &mut a).unwrap();
            black_box(mixer.refine(&hull, target, &mut a, 0.0).unwrap());
        }
    });
}

#[divan::bench]
fn from_another_answer(bencher: Bencher) {
    let (hull, targets) = problem();
    let mut mixer = Mixer::new();
    let mut a = vec![0.0; hull.len()];
    a[0] = 1.0;
    bencher.counter(divan::counter::ItemsCount::new(targets.len())).bench_local(|| {
        for target in &targets {
            black_box(mixer.refine(&hull, target, &mut a, 1e-8).unwrap());
        }
    });
}

fn main() {
    divan::main();
}
