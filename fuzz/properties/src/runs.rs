//! Pass streams: portions do not matter, no bytes harm the decoder, what is coded comes back dot for dot.

use protocol::runs::{Decoder, Defect, Header, MAX_BAND, MAX_HEADER, Step, band_bytes, encode, stride};
use protocol::walk::{Frame, Placed};

/// Width and height, the corner of a picture and its size, two bytes each, then a stream, which is also taken for a plane and
/// for a header.
pub fn check(bytes: &[u8]) {
    if let Ok(Some((header, length))) = Header::read(bytes) {
        let mut out = [0; MAX_HEADER];
        assert_eq!(header.write(&mut out), length);
        assert_eq!(out[..length], bytes[..length]);
    }
    let Some((head, bytes)) = bytes.split_first_chunk::<12>() else { return };
    let walk = walk(head);
    let (width, height) = (walk.width(), walk.height());
    let whole = decode(walk, bytes, usize::MAX);
    assert_eq!(decode(walk, bytes, 1), whole, "byte by byte");
    assert_eq!(decode(walk, bytes, 5), whole, "in portions of 5");
    if let Ok((plane, true)) = whole {
        comes_back(walk, &plane);
    }
    let mut plane = vec![0; stride(width) * usize::from(height)];
    let count = bytes.len().min(plane.len());
    plane[..count].copy_from_slice(&bytes[..count]);
    blank_margin(width, &mut plane);
    comes_back(walk, &plane);
}

/// All widths there are; the wider, the fewer rows, so that a run takes no longer than the next.
fn walk(head: &[u8; 12]) -> Placed {
    let word = |i: usize| u16::from_le_bytes([head[2 * i], head[2 * i + 1]]);
    let width = word(0) % 9880 + 1;
    let rows = (40_000 / u32::from(width)).clamp(3, 260) as u16;
    let height = word(1) % rows + 1;
    let (x, y) = (word(2) % width, word(3) % height);
    let frame = Frame { x, y, width: word(4) % (width - x) + 1, height: word(5) % (height - y) + 1 };
    Placed::new(width, height, frame).expect("it lies within")
}

fn blank_margin(width: u16, plane: &mut [u8]) {
    let unused = (8 - width % 8) % 8;
    for row in plane.chunks_exact_mut(stride(width)) {
        if let Some(last) = row.last_mut() {
            *last &= 0xff << unused;
        }
    }
}

/// The plane as far as the stream goes, and whether that is to its end.
fn decode(walk: Placed, stream: &[u8], portion: usize) -> Result<(Vec<u8>, bool), Defect> {
    let (width, height) = (walk.width(), walk.height());
    let mut memory = vec![0; band_bytes(width)];
    let mut decoder = Decoder::new(walk);
    let mut plane = Vec::new();
    for mut left in stream.chunks(portion) {
        loop {
            let (used, step) = decoder.step(left, &mut memory)?;
            left = &left[used..];
            match step {
                Step::More => {
                    assert!(left.is_empty(), "input was left over");
                    break;
                }
                Step::Blank { y, rows } => {
                    assert_eq!(plane.len(), usize::from(y) * stride(width));
                    plane.resize(plane.len() + usize::from(rows) * stride(width), 0);
                }
                Step::Band { y, rows, reach } => {
                    assert_eq!(plane.len(), usize::from(y) * stride(width));
                    let rows = &memory[..usize::from(rows) * stride(width)];
                    assert!(
                        rows.chunks_exact(stride(width))
                            .all(|row| row[reach..].iter().all(|&byte| byte == 0))
                    );
                    plane.extend_from_slice(rows);
                }
                Step::End => {
                    assert_eq!(plane.len(), usize::from(height) * stride(width));
                    return Ok((plane, true));
                }
            }
        }
    }
    Ok((plane, decoder.ended()))
}

fn comes_back(walk: Placed, plane: &[u8]) {
    let (mut stream, mut buffer) = (Vec::new(), vec![0; MAX_BAND]);
    encode(&walk, plane, &mut buffer, |band| {
        assert!(band.len() <= MAX_BAND);
        stream.extend_from_slice(band);
    })
    .expect("room for every plane");
    let (again, complete) = decode(walk, &stream, usize::MAX).expect("what was encoded");
    assert!(complete && again == plane, "{walk:?} came back as something else");
}
