//! The dots of one pass, as its rows arrive.

use protocol::packbits;
use protocol::rgl::Compression;

use sheet::Plane;

/// The plane of a pass during printing: the declared page at the job's resolution.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    plane: Plane,
    shift_x: usize,
    shift_y: usize,
    /// Dots across that lie on the sheet.
    edge: usize,
    /// Width of a printed dot of this ink, in dots of the job.
    spread: usize,
    row: Vec<u8>,
    /// Dots that missed the sheet.
    pub(crate) platen: u64,
    /// Parts of wide dots beyond the page, which are dropped.
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

    /// Prints a row that the job's grammar has accepted, so it can be unpacked and lies inside the page.
    pub(crate) fn put(&mut self, row: u32, compression: Option<Compression>, data: &[u8]) {
        let stride = self.plane.stride;
        let start = (row as usize + self.shift_y) * stride;
        let Some(place) = self.plane.bits.get_mut(start..start + stride) else { return };
        let in_place = self.shift_x == 0 && self.spread == 1;
        let target = if in_place { &mut *place } else { &mut self.row[..] };
        let length = match compression {
            Some(Compression::Packed) => packbits::unpack_into(data, target).unwrap_or(0),
            _ => {
                let length = data.len().min(stride);
                target[..length].copy_from_slice(&data[..length]);
                length
            }
        };
        if !in_place {
            if self.spread == 1 {
                shift_into(place, &self.row[..length], self.shift_x);
            } else {
                self.lost +=
                    widen_into(place, &self.row[..length], self.shift_x, self.spread, self.plane.width);
            }
        }
        if self.edge < self.plane.width {
            self.platen += cut(place, self.edge);
        }
    }

    pub(crate) fn into_plane(self) -> Plane {
        self.plane
    }
}

/// Adds a row moved to the right by so many dots. The caller ensures that it fits.
fn shift_into(place: &mut [u8], row: &[u8], by: usize) {
    let (bytes, bits) = (by / 8, by % 8);
    for (i, &byte) in row.iter().enumerate() {
        let [left, right] = (u16::from(byte) << 8 >> bits).to_be_bytes();
        for (at, part) in [(i + bytes, left), (i + bytes + 1, right)] {
            if part != 0
                && let Some(place) = place.get_mut(at)
            {
                *place |= part;
            }
        }
    }
}

/// Adds a row with every dot `spread` dots wide. Returns the number of dots beyond `width`.
fn widen_into(place: &mut [u8], row: &[u8], shift: usize, spread: usize, width: usize) -> u64 {
    let mut lost = 0;
    for (i, &byte) in row.iter().enumerate() {
        for bit in (0..8).filter(|bit| byte << bit & 0x80 != 0) {
            for wide in 0..spread {
                let x = (i * 8 + bit + shift) * spread + wide;
                if x < width {
                    place[x / 8] |= 0x80 >> (x % 8);
                } else {
                    lost += 1;
                }
            }
        }
    }
    lost
}

/// Removes the dots of a row from column `edge` on and returns their number.
fn cut(row: &mut [u8], edge: usize) -> u64 {
    let mut dots = 0;
    for (i, byte) in row.iter_mut().enumerate().skip(edge / 8) {
        let keep = if i == edge / 8 { !(0xff >> (edge % 8)) } else { 0 };
        dots += u64::from((*byte & !keep).count_ones());
        *byte &= keep;
    }
    dots
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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

    proptest! {
        #[test]
        fn every_dot_lands_where_the_shift_and_the_width_of_its_ink_put_it(
            row in proptest::collection::vec(any::<u8>(), 1..9),
            shift in 0..30usize, edge in 0..120usize, spread in 1..3usize,
        ) {
            let width = 101;
            let dots: Vec<usize> = (0..row.len() * 8).filter(|x| row[x / 8] << (x % 8) & 0x80 != 0).collect();
            let all: Vec<usize> =
                dots.iter().flat_map(|x| (0..spread).map(move |wide| (x + shift) * spread + wide)).collect();
            let mut want = vec![0; 13];
            for x in all.iter().filter(|&&x| x < width.min(edge)) {
                want[x / 8] |= 0x80 >> (x % 8);
            }
            let platen = all.iter().filter(|&&x| x < width && x >= edge).count() as u64;
            let lost = all.iter().filter(|&&x| x >= width).count() as u64;
            prop_assert_eq!(plain(Canvas::new(width, 1, (shift, 0), edge, spread), &row), (want, platen, lost));
        }
    }

    #[test]
    fn a_shift_downwards_moves_the_row() {
        let mut canvas = Canvas::new(8, 3, (0, 1), 8, 1);
        canvas.put(1, Some(Compression::Packed), &[0x00, 0x18]);
        assert_eq!(canvas.into_plane().bits, [0, 0, 0x18]);
    }
}
