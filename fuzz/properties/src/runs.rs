//! Pass streams: portions do not matter, no bytes harm the decoder, what is coded comes back dot for dot.

use protocol::runs::{Decoder, Defect, Header, MAX_BAND, MAX_HEADER, Step, band_bytes, encode, stride};

/// Width and height, two bytes each, then a stream, which is also taken for a plane and for a header.
pub fn check(bytes: &[u8]) {
    if let Ok(Some((header, length))) = Header::read(bytes) {
        let mut out = [0; MAX_HEADER];
        assert_eq!(header.write(&mut out), length);
        assert_eq!(out[..length], bytes[..length]);
    }
    let Some((head, bytes)) = bytes.split_first_chunk::<4>() else { return };
    let (width, height) = size(head);
    let whole = decode(width, height, bytes, usize::MAX);
    assert_eq!(decode(width, height, bytes, 1), whole, "byte by byte");
    assert_eq!(decode(width, height, bytes, 5), whole, "in portions of 5");
    if let Ok((plane, true)) = whole {
        comes_back(width, height, &plane);
    }
    let mut plane = vec![0; stride(width) * usize::from(height)];
    let count = bytes.len().min(plane.len());
    plane[..count].copy_from_slice(&bytes[..count]);
    blank_margin(width, &mut plane);
    comes_back(width, height, &plane);
}

/// All widths there are; the wider, the fewer rows, so that a run takes no longer than the next.
fn size(head: &[u8; 4]) -> (u16, u16) {
    let width = u16::from_le_bytes([head[0], head[1]]) % 9880 + 1;
    let rows = (40_000 / u32::from(width)).clamp(3, 260) as u16;
    (width, u16::from_le_bytes([head[2], head[3]]) % rows + 1)
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
fn decode(width: u16, height: u16, stream: &[u8], portion: usize) -> Result<(Vec<u8>, bool), Defect> {
    let mut memory = vec![0; band_bytes(width)];
    let mut decoder = Decoder::new(width, height);
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
                Step::Band { y, rows } => {
                    assert_eq!(plane.len(), usize::from(y) * stride(width));
                    plane.extend_from_slice(&memory[..usize::from(rows) * stride(width)]);
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

fn comes_back(width: u16, height: u16, plane: &[u8]) {
    let (mut stream, mut buffer) = (Vec::new(), vec![0; MAX_BAND]);
    encode(width, height, plane, &mut buffer, |band| {
        assert!(band.len() <= MAX_BAND);
        stream.extend_from_slice(band);
    })
    .expect("room for every plane");
    let (again, complete) = decode(width, height, &stream, usize::MAX).expect("what was encoded");
    assert!(complete && again == plane, "{width} x {height} came back as something else");
}
