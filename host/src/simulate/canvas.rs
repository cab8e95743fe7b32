//! The dots of one pass, as its rows come in.

use protocol::packbits;
use protocol::rgl::Compression;

use crate::separate::Plane;

/// The plane of a pass while it is printed: the declared page at the job's resolution.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    plane: Plane,
    shift_x: usize,
    shift_y: usize,
    /// Dots across that lie on the sheet.
    edge: usize,
    /// How many dots wide a dot of this ink comes out.
    spread: usize,
    row: Vec<u8>,
    /// Dots that fell beside the sheet.
    pub(crate) platen: u64,
    /// Dots that widened beyond the page and were thrown away.
    pub(crate) lost: u64,
}

impl Canvas {
    pub(crate) fn new(
        width: usize,
        length: usize,
        shift: (usize, usize),
        edge: usize,
        spread: usize,
    ) -> Canvas {
        let stride = width.div_ceil(8);
        Canvas {
            plane: Plane { width, length, stride, bits: vec![0; stride * length] },
            shift_x: shift.0,
            shift_y: shift.1,
            edge: edge.min(width),
            spread,
            row: vec![0; stride],
            platen: 0,
            lost: 0,
        }
    }

    /// Prints a row that the order of the job has accepted: it unpacks, and it lies inside the page.
    pub(crate) fn put(&mut self, row: u32, compression: Option<Compression>, data: &[u8]) {
        let stride = self.plane.stride;
        let start = (row as usize + self.shift_y) * stride;
        let Some(place) = self.plane.bits.get_mut(start..start + stride) else { return };
        let simple = self.shift_x == 0 && self.spread == 1 && self.edge == self.plane.width;
        let target = if simple { &mut *place } else { &mut self.row[..] };
        let length = match compression {
            Some(Compression::Packed) => packbits::unpack_into(data, target).unwrap_or(0),
            _ => {
                let length = data.len().min(stride);
                target[..length].copy_from_slice(&data[..length]);
                length
            }
        };
        if simple {
            return;
        }
        for (i, &byte) in self.row[..length].iter().enumerate() {
            let mut left = byte;
            while left != 0 {
                let bit = left.leading_zeros() as usize;
                left &= !(0x80 >> bit);
                for wide in 0..self.spread {
                    let x = (i * 8 + bit + self.shift_x) * self.spread + wide;
                    if x >= self.plane.width {
                        self.lost += 1;
                    } else if x >= self.edge {
                        self.platen += 1;
                    } else {
                        place[x / 8] |= 0x80 >> (x % 8);
                    }
                }
            }
        }
    }

    pub(crate) fn into_plane(self) -> Plane {
        self.plane
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(mut canvas: Canvas, data: &[u8]) -> (Vec<u8>, u64, u64) {
        canvas.put(0, Some(Compression::Plain), data);
        (canvas.plane.bits.clone(), canvas.platen, canvas.lost)
    }

    #[test]
    fn rows_are_moved_widened_and_cut_at_the_sheet() {
        assert_eq!(plain(Canvas::new(20, 1, (0, 0), 99, 1), &[0x81, 0x40]), (vec![0x81, 0x40, 0], 0, 0));
        assert_eq!(plain(Canvas::new(20, 1, (3, 0), 99, 1), &[0x81]), (vec![0x10, 0x20, 0], 0, 0));
        assert_eq!(plain(Canvas::new(16, 1, (0, 0), 99, 2), &[0x81]), (vec![0xc0, 0x03], 0, 0));
        assert_eq!(plain(Canvas::new(16, 1, (0, 0), 99, 2), &[0x80, 0x80]), (vec![0xc0, 0], 0, 2));
        assert_eq!(plain(Canvas::new(16, 1, (0, 0), 7, 1), &[0x83]), (vec![0x82, 0], 1, 0));
    }

    #[test]
    fn a_shift_downwards_moves_the_row() {
        let mut canvas = Canvas::new(8, 3, (0, 1), 8, 1);
        canvas.put(1, Some(Compression::Packed), &[0x00, 0x18]);
        assert_eq!(canvas.into_plane().bits, [0, 0, 0x18]);
    }
}
