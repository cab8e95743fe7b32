//! Pass streams of a full A4 page: eight planes, halftoned along the walk and in cells.
//!
//! Run `cargo bench --bench runs`. Prints the sizes beside the times; decoding is timed on this machine, the
//! microcontroller's cycles are counted elsewhere.

use divan::Bencher;
use foilpress_tests::planes::{ROWS, WIDTH, cells, planes};
use protocol::packbits;
use protocol::runs::{Decoder, MAX_BAND, Step, band_bytes, encode, stride};
use protocol::walk::Placed;

fn main() {
    for (name, planes) in [("walk", planes()), ("cells", cells())] {
        let packed: usize = planes.iter().map(|plane| packed_rows(plane)).sum();
        let streams: usize = planes.iter().map(|plane| stream(plane).len()).sum();
        println!(
            "eight planes, {name}: packed rows {packed} bytes, pass streams {streams}, 1/{:.2}",
            packed as f64 / streams as f64
        );
    }
    divan::main();
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
    encode(&Placed::whole(WIDTH, ROWS), plane, &mut vec![0; MAX_BAND], |band| bytes.extend_from_slice(band))
        .expect("room");
    bytes
}

/// The fourth plane of a halftone.
fn plane(method: &str) -> &'static [u8] {
    if method == "walk" { &planes()[3] } else { &cells()[3] }
}

/// One plane into its stream.
#[divan::bench(sample_count = 10, args = ["walk", "cells"])]
fn encode_a_plane(bencher: Bencher, method: &str) {
    let plane = plane(method);
    bencher.counter(divan::counter::BytesCount::of_slice(plane)).bench_local(|| stream(plane));
}

/// And back.
#[divan::bench(sample_count = 10, args = ["walk", "cells"])]
fn decode_a_plane(bencher: Bencher, method: &str) {
    let plane = plane(method);
    let stream = stream(plane);
    let mut memory = vec![0; band_bytes(WIDTH)];
    let mut decoder = Decoder::new(Placed::whole(WIDTH, ROWS));
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
