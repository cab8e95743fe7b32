//! A full A4 page in five passes: written as a job, printed by the simulated printer, composed to a sheet, inspected.
//!
//! The page is what the halftone makes: dots in clusters of about eight, in every row. Figures are to be read against
//! `copy_the_planes`, which only moves as many bytes as the passes have.

use divan::{Bencher, black_box};
use observe::Silent;
use press::inspect::inspect;
use press::job::stream::write_job;
use press::separate::Pass;
use press::simulate::{self, Setup};
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Page;
use sheet::Plane;

fn main() {
    divan::main();
}

/// Five passes of clustered dots, from a fixed linear congruence.
fn passes() -> Vec<Pass> {
    let (width, length) = (usize::from(Paper::A4.width()), usize::from(Paper::A4.length()));
    let stride = width.div_ceil(8);
    let inks = [Ink::Primer, Ink::MetallicSilver, Ink::White, Ink::Cyan, Ink::Finish];
    let mut state = 1u32;
    let mut planes: Vec<Vec<u8>> = vec![vec![0; stride * length]; inks.len()];
    for y in 0..length {
        let mut x = 0;
        while x < width {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let (set, run) = (state >> 27, 8 + (state >> 20 & 7) as usize);
            for dot in x..(x + run).min(width) {
                for (p, plane) in planes.iter_mut().enumerate() {
                    plane[y * stride + dot / 8] |= ((set >> p & 1) as u8) << (7 - dot % 8);
                }
            }
            x += run;
        }
    }
    let pass = |(ink, bits)| Pass { ink, plane: Plane { width, length, stride, bits } };
    inks.into_iter().zip(planes).map(pass).collect()
}

fn job(passes: &[Pass]) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_job(Page::plain(Paper::A4), None, passes, &mut bytes, &Silent).unwrap();
    bytes
}

#[divan::bench(sample_count = 20)]
fn copy_the_planes(bencher: Bencher) {
    let passes = passes();
    bencher.bench(|| black_box(passes.clone()));
}

#[divan::bench(sample_count = 20)]
fn write_the_job(bencher: Bencher) {
    let passes = passes();
    bencher
        .bench(|| write_job(Page::plain(Paper::A4), None, &passes, &mut std::io::sink(), &Silent).unwrap());
}

#[divan::bench(sample_count = 20)]
fn write_a_blank_page_but_for_one_dot_a_pass(bencher: Bencher) {
    let mut passes = passes();
    for pass in &mut passes {
        pass.plane.bits.fill(0);
        pass.plane.bits[300_000] = 1;
    }
    bencher
        .bench(|| write_job(Page::plain(Paper::A4), None, &passes, &mut std::io::sink(), &Silent).unwrap());
}

#[divan::bench(sample_count = 20)]
fn print_the_job(bencher: Bencher) {
    let job = job(&passes());
    bencher.bench(|| simulate::print(&job, &Setup::default(), &Silent).unwrap());
}

#[divan::bench(sample_count = 20)]
fn compose_the_sheet(bencher: Bencher) {
    let printout = simulate::print(&job(&passes()), &Setup::default(), &Silent).unwrap();
    bencher.bench(|| printout.sheet().unwrap());
}

#[divan::bench(sample_count = 20)]
fn inspect_the_job(bencher: Bencher) {
    let job = job(&passes());
    bencher.bench(|| inspect(&job, &Silent));
}
