//! Pass streams of a full A4 page: eight clustered planes, and pages as people draw them.
//!
//! Run `cargo bench --bench runs`. Prints the sizes beside the times; decoding is timed on this machine, the
//! microcontroller's cycles are counted elsewhere.

use divan::Bencher;
use foilpress::gamut::InkMix;
use foilpress::halftone::{Placement, Settings, halftone};
use foilpress::observe::Silent;
use foilpress::weights::{WeightMaps, quantise};
use inks::Stack;
use protocol::ink::Ink;
use protocol::packbits;
use protocol::paper::Paper;
use protocol::runs::{Decoder, MAX_BAND, Step, band_bytes, encode, stride};
use std::sync::OnceLock;

fn main() {
    let (mut packed, mut streams) = (0, 0);
    for plane in planes() {
        packed += packed_rows(plane);
        streams += stream(plane).len();
    }
    println!(
        "eight planes: packed rows {packed} bytes, pass streams {streams}, 1/{:.2}",
        packed as f64 / streams as f64
    );
    divan::main();
}

const WIDTH: u16 = 4800;
const ROWS: u16 = 6372;

/// Eight stacks of one ink and the bare paper, smooth weights, clusters of at least 8 dots.
fn planes() -> &'static [Vec<u8>] {
    static PLANES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    PLANES.get_or_init(|| {
        let (width, height, count) = (1200, 1593, 9);
        let mut data = vec![0; width * height * count];
        for (pixel, out) in data.chunks_exact_mut(count).enumerate() {
            let (x, y) = ((pixel % width) as f64 / 190.0, (pixel / width) as f64 / 230.0);
            let weights: Vec<f64> = (0..count)
                .map(|i| 1.05 + (x * (1.0 + i as f64 * 0.3) + y * (2.0 - i as f64 * 0.2)).sin())
                .collect();
            quantise(&weights, out);
        }
        let stacks =
            std::iter::once(Stack::SUBSTRATE).chain(Ink::ALL[..8].iter().map(|&ink| Stack::new(vec![ink])));
        let matrix =
            (0..count).map(|i| (0..count).map(|j| if i == j { 1 << 15 } else { 0 }).collect()).collect();
        let maps = WeightMaps::new(width, height, count, data).expect("quantised");
        let mix = InkMix { stacks: stacks.collect(), maps, matrix };
        let page = Placement { paper: Paper::A4, x: 0, y: 0, width: WIDTH, height: ROWS };
        let sheet = halftone(&mix, &page, &Settings::uniform(count, 8), &Silent).expect("a page");
        (1..9u8)
            .map(|ink| {
                let dots = sheet.index().chunks_exact(8);
                dots.map(|dots| dots.iter().fold(0, |byte, &stack| byte << 1 | u8::from(stack == ink)))
                    .collect()
            })
            .collect()
    })
}

/// Bytes of the rows' data in the printer's language, without the commands around them.
fn packed_rows(plane: &[u8]) -> usize {
    let mut out = vec![0; stride(WIDTH)];
    plane
        .chunks_exact(stride(WIDTH))
        .map(|row| {
            let end = row.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
            packbits::pack_into(&row[..end], &mut out[..end]).unwrap_or(end)
        })
        .sum()
}

fn stream(plane: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(WIDTH, ROWS, plane, &mut vec![0; MAX_BAND], |band| bytes.extend_from_slice(band)).expect("room");
    bytes
}

/// One clustered plane into its stream.
#[divan::bench(sample_count = 10)]
fn encode_a_plane(bencher: Bencher) {
    let plane = &planes()[3];
    bencher.counter(divan::counter::BytesCount::of_slice(plane)).bench_local(|| stream(plane));
}

/// And back.
#[divan::bench(sample_count = 10)]
fn decode_a_plane(bencher: Bencher) {
    let plane = &planes()[3];
    let stream = stream(plane);
    let mut memory = vec![0; band_bytes(WIDTH)];
    let mut decoder = Decoder::new(WIDTH, ROWS);
    bencher.counter(divan::counter::BytesCount::of_slice(plane)).bench_local(|| {
        decoder.restart();
        let mut left = &stream[..];
        loop {
            let (used, step) = decoder.step(left, &mut memory).expect("a stream");
            left = &left[used..];
            divan::black_box(&memory);
            if step == Step::End {
                break;
            }
        }
    });
}
