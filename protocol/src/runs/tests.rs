extern crate std;
use super::*;
use crate::ink::Ink;
use crate::paper::Paper;
use crate::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use crate::rgl::{JobSetup, JobWriter, Page};
use crate::walk::Walk;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

fn coded(width: u16, height: u16, bits: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    encode(width, height, bits, &mut vec![0; MAX_BAND], |bytes| stream.extend_from_slice(bytes)).unwrap();
    stream
}

/// The plane of a stream that arrives in portions of the given sizes.
fn decoded(
    width: u16,
    height: u16,
    stream: &[u8],
    mut sizes: impl Iterator<Item = usize>,
) -> Result<Option<Vec<u8>>, Defect> {
    let mut decoder = Decoder::new(width, height);
    let mut memory = vec![0xee; band_bytes(width)];
    let (mut plane, mut left) = (Vec::new(), stream);
    let stride = stride(width);
    loop {
        let portion = left.len().min(sizes.next().unwrap_or(usize::MAX));
        let (used, step) = decoder.step(&left[..portion], &mut memory)?;
        left = &left[used..];
        match step {
            Step::More if left.is_empty() => return Ok(None),
            Step::More => {}
            Step::Blank { y, rows } => {
                assert_eq!(plane.len(), usize::from(y) * stride);
                plane.resize(plane.len() + usize::from(rows) * stride, 0);
            }
            Step::Band { y, rows } => {
                assert_eq!(plane.len(), usize::from(y) * stride);
                plane.extend_from_slice(&memory[..usize::from(rows) * stride]);
            }
            Step::End => return Ok(left.is_empty().then_some(plane)),
        }
    }
}

/// A runs band by the text of the format: a list of bits, each dot asked for by its position.
fn runs_by_definition(walk: &Walk, start: u32, len: u32, minimum: u32, codes: &[u8]) -> Vec<(u16, u16)> {
    let mut bits = codes.iter().flat_map(|byte| (0..8).rev().map(move |i| u32::from(byte >> i & 1)));
    let (mut sums, mut counts) = ([32u32; 2], [4u32; 2]);
    let (mut on, mut position, mut dots, mut first) = (0, 0, Vec::new(), true);
    while position < len {
        let mut number = |n: u32| (0..n).fold(0, |value, _| value * 2 + bits.next().unwrap());
        let length = if first {
            number(20)
        } else {
            let k = (0..).find(|k| counts[on] << k >= sums[on]).unwrap();
            let mut quotient = 0;
            while quotient < 20 && number(1) == 1 {
                quotient += 1;
            }
            let value = if quotient == 20 { number(20) } else { quotient * (1 << k) + number(k) };
            sums[on] += value.min(8 << k).min(1 << 20);
            counts[on] += 1;
            if counts[on] == 64 {
                (sums[on], counts[on]) = (sums[on] / 2, 32);
            }
            value + minimum
        };
        first = false;
        for at in position..(position + length).min(len) {
            if on == 1 {
                dots.push(walk.at(start + at).unwrap());
            }
        }
        position += length;
        on = 1 - on;
    }
    dots
}

/// A plane that has at least `cluster` dots on or off in a row along the walk, about `share` of them on.
fn clustered(width: u16, height: u16, cluster: u32, share: u32, seed: u64) -> Vec<u8> {
    let walk = Walk::new(width, height);
    let mut plane = vec![0; stride(width) * usize::from(height)];
    let mut state = seed | 1;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as u32
    };
    let mut position = 0;
    while position < walk.len() {
        let on = random() % 100 < share;
        let end = (position + cluster + random() % 4).min(walk.len());
        for at in position..end {
            if on {
                let (x, y) = walk.at(at).unwrap();
                plane[usize::from(y) * stride(width) + usize::from(x) / 8] |= 0x80 >> (x % 8);
            }
        }
        position = end;
    }
    plane
}

/// Bytes of the rows of a plane in the printer's own language.
fn printed(width: u16, height: u16, bits: &[u8]) -> usize {
    let page = Page::plain(Paper::Custom { width, length: height });
    let mut writer = JobWriter::new(JobSetup::new(page, &[Ink::Black], None).unwrap(), height).unwrap();
    let mut out = vec![0; COMMAND_ROOM + ROW_ROOM + stride(width)];
    writer.begin(&mut out).unwrap();
    writer.next_pass(&mut out).unwrap();
    bits.chunks_exact(stride(width)).map(|row| writer.row(row, &mut out).unwrap()).sum()
}

fn a_plane() -> impl Strategy<Value = (u16, u16, Vec<u8>)> {
    let clusters = (1u16..300, 1u16..200, 1u32..20, 0u32..101, any::<u64>())
        .prop_map(|(w, h, cluster, share, seed)| (w, h, clustered(w, h, cluster, share, seed)));
    // Rectangles, some of them thin: type, lines, solids.
    let shapes =
        (1u16..300, 1u16..200, prop::collection::vec((0u16..300, 0u16..200, 1u16..90, 1u16..90), 0..8))
            .prop_map(|(w, h, shapes)| {
                let mut plane = vec![0; stride(w) * usize::from(h)];
                for (x0, y0, dx, dy) in shapes {
                    for y in y0..(y0 + dy).min(h) {
                        for x in x0..(x0 + dx).min(w) {
                            plane[usize::from(y) * stride(w) + usize::from(x) / 8] |= 0x80 >> (x % 8);
                        }
                    }
                }
                (w, h, plane)
            });
    let noise =
        (1u16..300, 1u16..200, any::<u64>()).prop_map(|(w, h, seed)| (w, h, clustered(w, h, 1, 50, seed)));
    prop_oneof![clusters, shapes, noise]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn a_stream_is_its_plane_whatever_the_portions(
        (width, height, plane) in a_plane(),
        sizes in prop::collection::vec(0usize..50, 1..20).prop_map(|mut sizes| { sizes.push(1); sizes }),
    ) {
        let stream = coded(width, height, &plane);
        prop_assert_eq!(decoded(width, height, &stream, core::iter::empty()), Ok(Some(plane.clone())));
        prop_assert_eq!(decoded(width, height, &stream, core::iter::repeat(1)), Ok(Some(plane.clone())));
        prop_assert_eq!(decoded(width, height, &stream, sizes.into_iter().cycle()), Ok(Some(plane)));
    }

    #[test]
    fn no_plane_costs_more_than_in_the_printers_own_language((width, height, plane) in a_plane()) {
        let (stream, rows) = (coded(width, height, &plane).len(), printed(width, height, &plane));
        // A page without a dot has no row, but a stream of blank bands.
        prop_assert!(stream <= rows.max(2), "{stream} bytes for {rows}");
    }

    #[test]
    fn a_cut_stream_is_incomplete_and_not_misread((width, height, plane) in a_plane(), cut in any::<prop::sample::Index>()) {
        let stream = coded(width, height, &plane);
        let cut = cut.index(stream.len());
        prop_assert_eq!(decoded(width, height, &stream[..cut], core::iter::empty()), Ok(None));
    }

    #[test]
    fn no_bytes_make_the_decoder_fail_other_than_by_a_defect(
        (width, height) in (1u16..400, 1u16..200),
        form in 0u8..4,
        bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(0xff), Just(0)], 0..3000),
    ) {
        let stream: Vec<u8> = core::iter::once(form).chain(bytes).collect();
        let _ = decoded(width, height, &stream, core::iter::empty());
    }
}

#[test]
fn runs_are_those_of_the_format() {
    for (width, height, share) in [(128, 64, 30), (200, 64, 5), (77, 61, 60), (1000, 64, 12)] {
        let plane = clustered(width, height, 8, share, 5);
        let stream = coded(width, height, &plane);
        assert_eq!((stream[0], stream[1]), (form::RUNS, 8));
        let walk = Walk::new(width, height);
        let mut rebuilt = vec![0; plane.len()];
        for (x, y) in runs_by_definition(&walk, 0, walk.len(), u32::from(stream[1]), &stream[2..]) {
            rebuilt[usize::from(y) * stride(width) + usize::from(x) / 8] |= 0x80 >> (x % 8);
        }
        assert_eq!(rebuilt, plane);
    }
}

#[test]
fn rows_are_those_of_the_format() {
    // Two rows alike, a blank one twice, one that does not pack.
    let rows = [[0xff, 0xff, 0xff], [0xff, 0xff, 0xff], [0, 0, 0], [0, 0, 0], [0x12, 0x34, 0]];
    let stream = [form::ROWS, 5, 0xfe, 0xff, 0, 1, 1, 0, 1, 4, 0x12, 0x34];
    assert_eq!(decoded(24, 5, &stream, core::iter::empty()), Ok(Some(rows.concat())));
}

#[test]
fn a_run_over_many_tiles_is_laid_out_a_little_at_a_time() {
    // Two bands of 34 and 32 rows, none of whose tiles is full, and one of tiles that are: each a single run.
    for (width, height, most) in [(4800, 66, 1024), (4803, 64, 4096)] {
        for band in Walk::new(width, height).bands() {
            // Twenty zeros, twenty ones, the length in twenty bits, four to fill the byte.
            let bits = ((1 << 20) - 1) << 24 | u64::from(band.len()) << 4;
            let mut input = &[&[form::RUNS, 0][..], &bits.to_be_bytes()].concat()[..];
            let mut decoder = Decoder::new(width, band.height);
            let mut memory = vec![0; band_bytes(width)];
            let mut before = 0;
            loop {
                let (used, step) = decoder.slice(input, &mut memory).unwrap();
                input = &input[used..];
                let dots: u32 = memory.iter().map(|byte| byte.count_ones()).sum();
                assert!(dots - before <= most, "{} dots in one slice", dots - before);
                before = dots;
                if step.is_some() {
                    assert_eq!((step, dots), (Some(Step::Band { y: 0, rows: band.height }), band.len()));
                    break;
                }
            }
        }
    }
}

#[test]
fn blank_bands_are_counted() {
    assert_eq!(coded(4800, 6372, &vec![0; 600 * 6372]), [form::BLANK, 100]);
    assert_eq!(coded(8, 300 * 64, &vec![0; 300 * 64]), [form::BLANK, 255, form::BLANK, 45]);
}

#[test]
fn defects_are_found() {
    let defect = |stream: &[u8]| decoded(20, 70, stream, core::iter::empty()).unwrap_err();
    assert_eq!(defect(&[3]), Defect::Form);
    assert_eq!(defect(&[form::BLANK, 0]), Defect::Count);
    assert_eq!(defect(&[form::BLANK, 3]), Defect::Count);
    assert_eq!(defect(&[form::ROWS, 0, 65]), Defect::Count);
    // Four bytes, dots beyond column 20, a literal cut off, the reserved header.
    assert_eq!(defect(&[form::ROWS, 8, 1, 2, 3, 4]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 6, 1, 2, 0x18, 0]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 5, 1, 7, 1]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 5, 0x80, 7, 1]), Defect::Row);
    let mut decoder = Decoder::new(4800, 64);
    assert_eq!(decoder.step(&[1], &mut [0; 100]), Err(Defect::Memory));
}

#[test]
fn a_decoder_and_its_band_stay_within_64_kilobytes_for_4800_dots() {
    assert!(core::mem::size_of::<Decoder>() + band_bytes(4800) <= 64 * 1024);
}
