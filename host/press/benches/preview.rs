//! Lighting a full A4 page and material balls, and comparing print and document.
//!
//! Run `cargo bench --bench preview`. The page has eight stacks in clusters of 4 x 4 dots, every stack everywhere;
//! balls are 112 pixels across under a probe of 256 x 128 texels, and 256 under one of 1024 x 512.

use appearance::brdf::{Space, Table};
use appearance::factor::Factored;
use appearance::weights::{ONE, WeightMaps};
use divan::Bencher;
use inks::{Curve, Stack};
use observe::Silent;
use press::preview::{Light, Probe, STANDARD_LIGHTS, Source, fidelity, flat, sphere};
use protocol::ink::Ink;
use protocol::paper::Paper;
use sheet::{Area, Sheet};

const STACKS: usize = 8;

fn main() {
    divan::main();
}

fn materials(space: &Space, count: usize) -> Table {
    let mut rows = Table::new(space.columns());
    for i in 0..count {
        let (diffuse, alpha) = (0.02 * (i % 11) as f64, 0.05 + 0.02 * (i % 13) as f64);
        let lobe = |t| inks::ggx::lobe(t, alpha);
        let curve =
            Curve::sampled(space.angles(), |t| [diffuse + lobe(t), diffuse + 0.8 * lobe(t), 0.5 * lobe(t)]);
        rows.push(&space.row(&curve));
    }
    rows
}

fn page() -> Sheet {
    let mut stacks = vec![Stack::SUBSTRATE];
    stacks.extend(Ink::ALL[..STACKS - 1].iter().map(|&ink| Stack::new([ink])));
    let (width, length) = (usize::from(Paper::A4.width()), usize::from(Paper::A4.length()));
    let mixed = |x: usize, y: usize| {
        ((x as u32).wrapping_mul(2_654_435_761) ^ (y as u32).wrapping_mul(2_246_822_519))
            .wrapping_mul(3_266_489_917)
    };
    let dot = |i: usize| (mixed(i % width / 4, i / width / 4) >> 29) as u8;
    Sheet::new(Paper::A4, stacks, (0..width * length).map(dot).collect()).unwrap()
}

/// Four lights on pictures of 480 and of 1593 pixels.
#[divan::bench(args = [480, 1593], sample_count = 10)]
fn a4_page_under_four_lights(bencher: Bencher, longest: usize) {
    let (space, sheet) = (Space::half_angle(32), page());
    let stacks = materials(&space, STACKS);
    let print =
        Source::Print { dots: sheet.dots(), space: &space, stacks: &stacks, area: Area::whole(sheet.dots()) };
    let lights: Vec<Light> = STANDARD_LIGHTS.iter().map(|l| l.1).collect();
    let (width, height) = print.fit(longest);
    bencher.bench_local(|| flat(&print, &lights, width, height, &Silent).unwrap());
}

/// The same probe on 1 and on 30 materials: light is gathered once for all of them.
#[divan::bench(args = [1, 30], sample_count = 10)]
fn balls_under_a_probe(bencher: Bencher, count: usize) {
    let (space, probe) = (Space::half_angle(32), Probe::studio(128));
    let rows = materials(&space, count);
    bencher.bench_local(|| sphere::under_probe(&space, &rows, &probe, 112, &Silent).unwrap());
}

/// A large ball under a large probe, and eight more: what each after the first takes is an eighth of the difference.
#[divan::bench(args = [1, 9], sample_count = 5)]
fn large_balls_under_a_large_probe(bencher: Bencher, count: usize) {
    let (space, probe) = (Space::half_angle(32), Probe::studio(512));
    let rows = materials(&space, count);
    bencher.bench_local(|| sphere::under_probe(&space, &rows, &probe, 256, &Silent).unwrap());
}

/// A4 from half a metre, against a document of 1024 x 1024 pixels and eight bases.
#[divan::bench(sample_count = 10)]
fn fidelity_of_an_a4_page(bencher: Bencher) {
    let (space, sheet) = (Space::half_angle(32), page());
    let stacks = materials(&space, STACKS);
    let weights = [ONE / STACKS as u16; STACKS].repeat(1024 * 1024);
    let maps = WeightMaps::new(1024, 1024, STACKS, weights).unwrap();
    let target = Factored { space: space.clone(), bases: stacks.clone(), maps };
    let print =
        Source::Print { dots: sheet.dots(), space: &space, stacks: &stacks, area: Area::whole(sheet.dots()) };
    let size = (sheet.width(), sheet.length());
    bencher.bench_local(|| fidelity(&Source::Factored(&target), &print, size, 0.5, &Silent).unwrap());
}
