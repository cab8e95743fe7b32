//! Operations on one-bit planes: making them from bytes, and combining them.

use rayon::prelude::*;

use crate::window::Window;
use appearance::wide::wide;
use sheet::Plane;

/// A plane without ink.
pub(crate) fn blank(width: usize, length: usize) -> Plane {
    let stride = width.div_ceil(8);
    Plane { width, length, stride, bits: vec![0; stride * length] }
}

/// A plane with ink everywhere.
pub(crate) fn full(width: usize, length: usize) -> Plane {
    from_bytes(width, &vec![1; width * length], |_| true)
}

/// The plane of all dots whose byte satisfies `ink`. `width` is at least 1.
pub(crate) fn from_bytes(width: usize, bytes: &[u8], ink: impl Fn(u8) -> bool + Sync) -> Plane {
    from(width, bytes, |&byte| ink(byte))
}

/// The plane of all dots that satisfy `ink`. `width` is at least 1.
pub(crate) fn from<T: Sync>(width: usize, dots: &[T], ink: impl Fn(&T) -> bool + Sync) -> Plane {
    let mut plane = blank(width, dots.len() / width);
    plane.bits.par_chunks_mut(plane.stride).zip(dots.par_chunks_exact(width)).for_each(|(bits, dots)| {
        wide(
            #[inline(always)]
            || {
                let (eights, rest) = dots.as_chunks::<8>();
                let byte = |dots: &[T]| {
                    dots.iter().zip(0..).fold(0, |bits, (dot, at)| bits | u8::from(ink(dot)) << (7 - at))
                };
                bits.iter_mut().zip(eights).for_each(|(bits, eight)| *bits = byte(eight));
                if let (Some(last), false) = (bits.last_mut(), rest.is_empty()) {
                    *last = byte(rest);
                }
            },
        );
    });
    plane
}

/// The smallest window around all ink; `None` without any.
pub(crate) fn bounds(plane: &Plane) -> Option<Window> {
    // First and last row and byte with ink, and the dots of all rows together.
    let mut rows = None;
    let mut dots = vec![0u8; plane.stride];
    for (y, row) in plane.bits.chunks_exact(plane.stride.max(1)).enumerate() {
        if row.iter().fold(0, |all, &byte| all | byte) != 0 {
            rows = Some((rows.map_or(y, |(top, _)| top), y));
            dots.iter_mut().zip(row).for_each(|(all, &byte)| *all |= byte);
        }
    }
    let (top, bottom) = rows?;
    let (first, last) = (dots.iter().position(|&byte| byte != 0)?, dots.iter().rposition(|&byte| byte != 0)?);
    let left = 8 * first + dots[first].leading_zeros() as usize;
    let right = 8 * last + 7 - dots[last].trailing_zeros() as usize;
    Some(Window { left, top, width: right + 1 - left, height: bottom + 1 - top })
}

/// Combines `with` into `plane` byte by byte. Both have the same size.
pub(crate) fn merge(plane: &mut Plane, with: &Plane, join: impl Fn(u8, u8) -> u8 + Sync) {
    let rows = plane.bits.par_chunks_mut(1 << 12).zip(with.bits.par_chunks(1 << 12));
    rows.for_each(|(to, from)| to.iter_mut().zip(from).for_each(|(to, &from)| *to = join(*to, from)));
}

/// Adds the ink of another plane.
pub(crate) fn add(plane: &mut Plane, with: &Plane) {
    merge(plane, with, |a, b| a | b);
}

/// Whether a dot has ink.
pub(crate) fn at(plane: &Plane, x: usize, y: usize) -> bool {
    plane.bits[y * plane.stride + x / 8] & 0x80 >> (x % 8) != 0
}
