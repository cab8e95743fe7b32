extern crate std;
use super::*;
use crate::ink::Ink;
use crate::paper::Paper;
use crate::rgl::job::{COMMAND_ROOM, ROW_ROOM};
use crate::rgl::{JobSetup, JobWriter, Page};
use crate::walk::{Frame, Placed, Walk};
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

fn coded(width: u16, height: u16, bits: &[u8]) -> Vec<u8> {
    coded_along(Placed::whole(width, height), bits)
}

fn coded_along(walk: Placed, bits: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    encode(&walk, bits, &mut vec![0; MAX_BAND], |bytes| stream.extend_from_slice(bytes)).unwrap();
    stream
}

/// The plane of a stream that arrives in portions of the given sizes.
fn decoded(
    width: u16,
    height: u16,
    stream: &[u8],
    sizes: impl Iterator<Item = usize>,
) -> Result<Option<Vec<u8>>, Defect> {
    decoded_along(Placed::whole(width, height), stream, sizes)
}

fn decoded_along(
    walk: Placed,
    stream: &[u8],
    mut sizes: impl Iterator<Item = usize>,
) -> Result<Option<Vec<u8>>, Defect> {
    let width = walk.width();
    let mut decoder = Decoder::new(walk);
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
            Step::Band { y, rows, reach } => {
                assert_eq!(plane.len(), usize::from(y) * stride);
                let rows = &memory[..usize::from(rows) * stride];
                assert!(rows.chunks_exact(stride).all(|row| row[reach..].iter().all(|&byte| byte == 0)));
                plane.extend_from_slice(rows);
            }
            Step::End => return Ok(left.is_empty().then_some(plane)),
        }
    }
}

/// A page that begins with another memory, as another job's does, has none of the dots that this one held.
#[test]
fn another_page_may_have_another_memory() {
    let walk = Placed::whole(64, 8);
    let mut bits = vec![0; 64];
    bits[0] = 0x80;
    let stream = coded_along(walk, &bits);
    let mut decoder = Decoder::new(walk);
    for dirt in [0, 0xee] {
        decoder.begin(walk);
        let mut memory = vec![dirt; band_bytes(64)];
        let (_, step) = decoder.step(&stream, &mut memory).unwrap();
        let Step::Band { y: 0, rows: 8, .. } = step else { panic!("{step:?}") };
        assert!(memory[..64] == bits, "with {dirt:02x}");
    }
}

/// A runs band by the text of the format: a list of bits and the band's dots, one after the other.
fn runs_by_definition(order: &[(u16, u16)], minimum: u32, codes: &[u8]) -> Vec<(u16, u16)> {
    let len = order.len() as u32;
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
                dots.push(order[at as usize]);
            }
        }
        position += length;
        on = 1 - on;
    }
    dots
}

/// A band of runs across by the text of the format: strings of bits, each dot by itself.
fn across_by_definition(width: usize, height: usize, side: usize, codes: &[u8]) -> Vec<Vec<bool>> {
    let bits: Vec<u8> = codes.iter().flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1)).collect();
    let mut bits = bits.into_iter();
    // Counts and sums: of first runs, of off and on runs for each kind, of rows.
    let mut pairs = vec![(4usize, 32usize); 13];
    for pair in [4, 5, 10, 11, 12] {
        pairs[pair] = (4, 8);
    }
    let pair_of = |kind: usize, index: usize| match index {
        0 => [0, 3, 6, 9][kind],
        _ => [[2, 1], [5, 4], [8, 7], [11, 10]][kind][index % 2],
    };
    let mut rows: Vec<Vec<bool>> = Vec::new();
    while rows.len() < height {
        let kind = usize::from(2 * bits.next().unwrap() + bits.next().unwrap());
        let mut row =
            if kind >= 2 && !rows.is_empty() { rows[rows.len() - 1].clone() } else { vec![false; width] };
        // `None` is what is left.
        let mut code = |pair: usize, cells: bool| -> Result<Option<usize>, ()> {
            let (count, sum) = pairs[pair];
            let k = (0..).find(|k| count << k >= sum).unwrap();
            let quotient = (0..=8).take_while(|_| bits.next() == Some(1)).count();
            if quotient == 9 {
                return Ok(None);
            }
            let escaped = quotient == 8;
            if escaped && cells {
                return Err(());
            }
            let plain = if escaped { 14 } else { k };
            let rest = (0..plain).fold(0, |value, _| value * 2 + usize::from(bits.next().unwrap()));
            let value = if escaped { rest } else { (quotient << k) + rest };
            let (count, sum) = (count + 1, sum + value.min(8 << k).min(1 << 20));
            pairs[pair] = if count == 64 { (32, sum / 2) } else { (count, sum) };
            Ok(Some(value))
        };
        let (mut x, mut index) = (0, 0);
        while x < width {
            let mut unit = 1;
            let mut number = Err(());
            if kind % 2 == 1 && index > 0 {
                number = code(pair_of(kind, index), true);
                unit = side;
            }
            if number.is_err() {
                unit = 1;
                number = code(pair_of(if index > 0 { kind & 2 } else { kind }, index), false);
            }
            let end = match number.unwrap() {
                Some(value) => (x + (value + usize::from(index > 0)) * unit).min(width),
                None => width,
            };
            for dot in &mut row[x..end] {
                *dot ^= index % 2 == 1;
            }
            (x, index) = (end, index + 1);
        }
        let alike = code(12, false).unwrap().unwrap_or(height);
        let alike = alike.min(height - rows.len() - 1);
        rows.extend(vec![row; alike + 1]);
    }
    rows
}

/// Cells of `side` from the corner (`left`, `top`), `columns` by `rows` dots, about `share` of them on.
fn cells(
    (width, height): (u16, u16),
    side: u16,
    (left, top): (u16, u16),
    (columns, rows): (u16, u16),
    share: u32,
    seed: u64,
) -> Vec<u8> {
    let mut plane = vec![0; stride(width) * usize::from(height)];
    for y in top..height.min(top.saturating_add(rows)) {
        for x in left..width.min(left.saturating_add(columns)) {
            let cell = u64::from((y - top) / side) << 20 | u64::from((x - left) / side);
            let mixed = (cell ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mixed = (mixed ^ mixed >> 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            if (mixed >> 33) as u32 % 100 < share {
                plane[usize::from(y) * stride(width) + usize::from(x) / 8] |= 0x80 >> (x % 8);
            }
        }
    }
    plane
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
    let lattice = (
        (1u16..300, 1u16..200),
        prop::sample::select(vec![1u16, 2, 3, 4, 6, 8, 24]),
        ((0u16..100, 0u16..70), (1u16..300, 1u16..200)),
        (0u32..101, any::<u64>()),
    )
        .prop_map(|(size, side, (corner, art), (share, seed))| {
            (size.0, size.1, cells(size, side, corner, art, share, seed))
        });
    // Drawn shapes over cells.
    let mixed = (lattice.clone(), shapes.clone()).prop_map(|((w, h, mut plane), (w2, h2, drawn))| {
        for y in 0..usize::from(h.min(h2)) {
            for x in 0..stride(w.min(w2)).saturating_sub(1) {
                plane[y * stride(w) + x] |= drawn[y * stride(w2) + x];
            }
        }
        (w, h, plane)
    });
    prop_oneof![clusters, shapes, noise, lattice, mixed]
}

proptest! {
    #![proptest_config(testing::cases(128))]

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
    fn a_stream_along_any_pictures_walk_is_its_plane(
        (width, height, plane) in a_plane(),
        corner in any::<[prop::sample::Index; 4]>(),
        sizes in prop::collection::vec(0usize..50, 1..20).prop_map(|mut sizes| { sizes.push(1); sizes }),
    ) {
        let [x, y, w, h] = corner;
        let (x, y) = (x.index(width.into()) as u16, y.index(height.into()) as u16);
        let frame = Frame { x, y, width: w.index((width - x).into()) as u16 + 1, height: h.index((height - y).into()) as u16 + 1 };
        let walk = Placed::new(width, height, frame).unwrap();
        let stream = coded_along(walk, &plane);
        prop_assert_eq!(decoded_along(walk, &stream, core::iter::empty()), Ok(Some(plane.clone())));
        prop_assert_eq!(decoded_along(walk, &stream, sizes.into_iter().cycle()), Ok(Some(plane.clone())));
        // Bands of few rows cost a byte each for their form at most, when rows are packed.
        let bands = walk.bands().count();
        let rows = printed(width, height, &plane);
        prop_assert!(stream.len() <= rows.max(2) + 3 * bands, "{} bytes for {rows}", stream.len());
        // Other bytes are no worse along it.
        let _ = decoded_along(walk, &plane, core::iter::empty());
    }

    #[test]
    fn a_band_beside_the_picture_is_what_the_format_says(
        (left, right, w, h) in (0u16..200, 0u16..200, 1u16..300, 1u16..65),
        codes in prop::collection::vec(any::<u8>(), 3000),
    ) {
        let walk = Placed::new(left + w + right, h, Frame { x: left, y: 0, width: w, height: h }).unwrap();
        // The picture's dots, those to the left of it, those to the right.
        let mut order = Vec::new();
        for (x0, width) in [(left, w), (0, left), (left + w, right)] {
            let own = Walk::new(width, h);
            order.extend((0..own.len()).map(|at| own.at(at).unwrap()).map(|(x, y)| (x0 + x, y)));
        }
        let stream = [&[form::RUNS, 3][..], &codes[..], &[0; 20000]].concat();
        let stride = stride(walk.width());
        let mut decoder = Decoder::new(walk);
        let mut memory = vec![0; band_bytes(walk.width())];
        // A band of odd height may be several.
        prop_assume!(walk.bands().count() == 1);
        let (_, step) = decoder.step(&stream, &mut memory).unwrap();
        let whole = matches!(step, Step::Band { y: 0, rows, .. } if rows == h);
        prop_assert!(whole, "{:?}", step);
        let mut expected = vec![0; memory.len()];
        for (x, y) in runs_by_definition(&order, 3, &stream[2..]) {
            expected[usize::from(y) * stride + usize::from(x) / 8] |= 0x80 >> (x % 8);
        }
        prop_assert!(memory == expected);
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
        form in 0u8..5,
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
        let order: Vec<_> = (0..walk.len()).map(|at| walk.at(at).unwrap()).collect();
        for (x, y) in runs_by_definition(&order, u32::from(stream[1]), &stream[2..]) {
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
fn runs_across_are_those_of_the_format() {
    for side in [2u16, 3, 4, 6, 8] {
        for (left, top, share) in [(0, 0, 30), (5, 7, 11), (123, 31, 70)] {
            let (width, height) = (401, 64);
            let mut plane = cells((width, height), side, (left, top), (250, 50), share, 9);
            let mut band = vec![0; MAX_BAND];
            encode_across::put_across(&plane, width, &mut band).unwrap();
            assert_eq!((band[0], u16::from(band[1])), (form::ACROSS, side));
            // A line beside the lattice, slanted.
            for y in 0..height {
                plane[usize::from(y) * stride(width) + 40 + usize::from(y / 16)] |= 0x30;
            }
            let length = encode_across::put_across(&plane, width, &mut band).unwrap();
            let rows = across_by_definition(width.into(), height.into(), band[1].into(), &band[2..length]);
            for (y, row) in rows.iter().enumerate() {
                for (x, dot) in row.iter().enumerate() {
                    let bit = plane[y * stride(width) + x / 8] >> (7 - x % 8) & 1 == 1;
                    assert_eq!(*dot, bit, "side {side}, dot {x}, {y}");
                }
            }
            assert_eq!(decoded(width, height, &band[..length], core::iter::repeat(1)), Ok(Some(plane)));
        }
    }
}

proptest! {
    #[test]
    fn any_codes_across_mean_what_the_format_says(
        (width, height) in (1u16..150, 1u16..65),
        side in 1u8..30,
        codes in prop::collection::vec(any::<u8>(), 3000),
    ) {
        let stream = [&[form::ACROSS, side][..], &codes[..], &[0; 3000]].concat();
        let mut decoder = Decoder::new(Placed::whole(width, height));
        let mut memory = vec![0; band_bytes(width)];
        let (_, step) = decoder.step(&stream, &mut memory).unwrap();
        let whole = matches!(step, Step::Band { y: 0, rows, .. } if rows == height);
        prop_assert!(whole, "{:?}", step);
        let rows = across_by_definition(width.into(), height.into(), side.into(), &stream[2..]);
        for (y, row) in rows.iter().enumerate() {
            for (x, dot) in row.iter().enumerate() {
                prop_assert_eq!(memory[y * stride(width) + x / 8] >> (7 - x % 8) & 1 == 1, *dot);
            }
        }
    }
}

#[test]
fn the_example_across_is_read_and_written() {
    let text = include_str!("../../../docs/wire-format.md");
    assert!(text.contains("`03 03 50 49 2c 01 80`"));
    let rows = [[0x0e, 0x07, 0], [0x0e, 0x07, 0], [0x0e, 0x07, 0], [0x0e, 0x07, 0x80]].concat();
    let stream = [form::ACROSS, 3, 0x50, 0x49, 0x2c, 0x01, 0x80];
    let mut out = [0; 20];
    let length = super::encode_across::put_across(&rows, 24, &mut out).unwrap();
    assert_eq!(out[..length], stream);
    assert_eq!(decoded(24, 4, &stream, core::iter::empty()), Ok(Some(rows)));
    // Eight ones and a zero before 14 plain bits; nine for all that is left of a row, and of the band.
    let stream = [form::ACROSS, 1, 0x3f, 0xc0, 0x02, 0xff, 0xff, 0xe0];
    let all = [0x07, 0xff, 0xff].repeat(4);
    assert_eq!(decoded(24, 4, &stream, core::iter::empty()), Ok(Some(all)));
}

#[test]
fn a_band_of_runs_across_takes_a_row_at_a_time() {
    // A full row and 63 like it.
    let input = [form::ACROSS, 1, 0x03, 0xff, 0xff];
    let (mut decoder, mut memory) = (Decoder::new(Placed::whole(4800, 64)), vec![0; band_bytes(4800)]);
    let (mut read, mut slices) = (0, 0);
    loop {
        let (used, step) = decoder.slice(&input[read..], &mut memory).unwrap();
        read += used;
        slices += 1;
        let dots: u32 = memory.iter().map(|byte| byte.count_ones()).sum();
        assert_eq!(dots, 4800 * slices);
        if step.is_some() {
            assert_eq!((step, slices), (Some(Step::Band { y: 0, rows: 64, reach: 600 }), 64));
            break;
        }
    }
}

#[test]
fn a_run_over_many_tiles_is_laid_out_a_little_at_a_time() {
    // Two bands of 34 and 32 rows, none of whose tiles is full, and one of tiles that are: each a single run.
    for (width, height, most) in [(4800, 66, 1024), (4803, 64, 4096)] {
        for band in Walk::new(width, height).bands() {
            // Twenty zeros, twenty ones, the length in twenty bits, four to fill the byte.
            let bits = ((1 << 20) - 1) << 24 | u64::from(band.len()) << 4;
            let mut input = &[&[form::RUNS, 0][..], &bits.to_be_bytes()].concat()[..];
            let mut decoder = Decoder::new(Placed::whole(width, band.height));
            let mut memory = vec![0; band_bytes(width)];
            let mut before = 0;
            loop {
                let (used, step) = decoder.slice(input, &mut memory).unwrap();
                input = &input[used..];
                let dots: u32 = memory.iter().map(|byte| byte.count_ones()).sum();
                assert!(dots - before <= most, "{} dots in one slice", dots - before);
                before = dots;
                if step.is_some() {
                    let rows = band.height;
                    assert_eq!(
                        (step, dots),
                        (Some(Step::Band { y: 0, rows, reach: stride(width) }), band.len())
                    );
                    break;
                }
            }
        }
    }
}

#[test]
fn a_halftoned_picture_costs_the_same_wherever_it_lies() {
    let (w, h) = (1000, 500);
    let picture = clustered(w, h, 8, 30, 5);
    let alone = coded(w, h, &picture).len();
    for (x, y) in [(0, 0), (1, 0), (333, 129), (2005, 77)] {
        let (width, height) = (4800, 1000);
        let mut plane = vec![0; stride(width) * usize::from(height)];
        for row in 0..h {
            for column in 0..w {
                if picture[usize::from(row) * stride(w) + usize::from(column) / 8] << (column % 8) & 0x80 != 0
                {
                    let (x, y) = (x + column, y + row);
                    plane[usize::from(y) * stride(width) + usize::from(x) / 8] |= 0x80 >> (x % 8);
                }
            }
        }
        let frame = Frame { x, y, width: w, height: h };
        let placed = coded_along(Placed::new(width, height, frame).unwrap(), &plane).len();
        // What is blank beside it costs a code a band, and a run cut by the edge may be the shortest.
        assert!(placed < alone + alone / 40 + 80, "{placed} bytes at {x}, {y}, {alone} alone");
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
    assert_eq!(defect(&[4]), Defect::Form);
    assert_eq!(defect(&[form::ACROSS, 0]), Defect::Count);
    assert_eq!(defect(&[form::BLANK, 0]), Defect::Count);
    assert_eq!(defect(&[form::BLANK, 3]), Defect::Count);
    assert_eq!(defect(&[form::ROWS, 0, 65]), Defect::Count);
    // Four bytes, dots beyond column 20, a literal cut off, the reserved header.
    assert_eq!(defect(&[form::ROWS, 8, 1, 2, 3, 4]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 6, 1, 2, 0x18, 0]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 5, 1, 7, 1]), Defect::Row);
    assert_eq!(defect(&[form::ROWS, 5, 0x80, 7, 1]), Defect::Row);
    let mut decoder = Decoder::new(Placed::whole(4800, 64));
    assert_eq!(decoder.step(&[1], &mut [0; 100]), Err(Defect::Memory));
}

#[test]
fn a_decoder_and_its_band_stay_within_64_kilobytes_for_4800_dots() {
    assert!(core::mem::size_of::<Decoder>() + band_bytes(4800) <= 64 * 1024);
}
