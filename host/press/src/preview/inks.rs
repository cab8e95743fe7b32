//! Dots as ink on a background of any colour: the whole sheet, or one pass.
//!
//! Method: a palette. Every stack gets the colour of its layers on the background (transparent inks tint it, other inks
//! cover it), and every dot is one pixel. Clear inks hardly show among others, as on paper; the picture of their own pass
//! shows them in a label colour. Cost: one look at each dot. Limits: not a proof, because gloss and metal do not show; see
//! [`super::flat()`] for lit sheets.

use std::io;
use std::str::FromStr;

use readers::Pixels;
use readers::exact::Exact;

use crate::separate::Pass;
use sheet::colours::{label, upon};
use sheet::picture::encoded;
use sheet::{Area, Sheet};

/// A background to print on, sRGB.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Ground(pub [u8; 3]);

impl Default for Ground {
    /// Nearly white paper.
    fn default() -> Ground {
        Ground([252, 252, 250])
    }
}

/// Text that is not a colour.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a colour; write it like #204080, or use black, white or clear")]
pub struct NoColour(String);

impl FromStr for Ground {
    type Err = NoColour;

    fn from_str(text: &str) -> Result<Ground, NoColour> {
        match text.to_ascii_lowercase().as_str() {
            "white" => return Ok(Ground([255; 3])),
            "black" => return Ok(Ground([0; 3])),
            // The bluish grey of decal film on its backing.
            "clear" => return Ok(Ground([205, 214, 222])),
            _ => {}
        }
        let digits = text.strip_prefix('#').unwrap_or(text);
        let value = (digits.len() == 6 && digits.bytes().all(|c| c.is_ascii_hexdigit()))
            .then(|| u32::from_str_radix(digits, 16).ok())
            .flatten();
        let [_, r, g, b] = value.ok_or_else(|| NoColour(text.into()))?.to_be_bytes();
        Ok(Ground([r, g, b]))
    }
}

/// A picture of an area of a sheet in its inks as PNG, one pixel a dot; of a sheet with `across` dots in
/// 1/600 inch, each row is repeated as often, so that the picture has the sheet's shape.
///
/// # Errors
/// None is known: the data is of the picture's size.
///
/// # Panics
/// If the area leaves the sheet, which is a bug of the caller.
pub fn sheet_in_inks(sheet: &Sheet, area: Area, across: usize, ground: Ground) -> io::Result<Vec<u8>> {
    let palette: Vec<[u8; 3]> = sheet.stacks().iter().map(|stack| upon(stack, ground.0)).collect();
    let size = (area.width, area.length * across);
    encoded(size, square(across), Exact::Indexed(&palette), &sheet.index_of(area, across))
}

/// Pixels per inch of a picture in the sheet's shape.
fn square(across: usize) -> (u16, u16) {
    let dpi = u16::try_from(600 * across).unwrap_or(u16::MAX);
    (dpi, dpi)
}

/// A picture of an area of one pass in its ink, as [`sheet_in_inks`] draws it.
///
/// # Errors
/// None is known: the data is of the picture's size.
///
/// # Panics
/// If the area leaves the sheet, which is a bug of the caller.
pub fn pass_in_ink(pass: &Pass, area: Area, across: usize, ground: Ground) -> io::Result<Vec<u8>> {
    let palette = [ground.0, label(pass.ink, ground.0)];
    let rows = pass.plane.rows_in(area).map(Iterator::collect::<Vec<u8>>);
    let bits: Vec<u8> = rows.flat_map(|row| row.repeat(across)).collect();
    encoded((area.width, area.length * across), square(across), Exact::Two(&palette), &bits)
}

/// A picture of an area of a sheet, which has `across` dots in 1/600 inch; at most `longest` pixels on its longer side.
/// Each pixel is the mean of its dots.
///
/// # Panics
/// If the area leaves the sheet, which is a bug of the caller.
pub fn thumbnail(
    sheet: &Sheet,
    area: Area,
    across: usize,
    ground: Ground,
    longest: usize,
) -> Pixels<[u8; 3]> {
    let palette: Vec<[u8; 3]> = sheet.stacks().iter().map(|stack| upon(stack, ground.0)).collect();
    let step = (area.width / across).max(area.length).div_ceil(longest.max(1)).max(1);
    let wide = step * across;
    let (width, height) = (area.width.div_ceil(wide), area.length.div_ceil(step));
    let mut sums = vec![[0u32; 4]; width * height];
    for (y, row) in sheet.index_of(area, 1).chunks_exact(area.width.max(1)).enumerate() {
        for (sum, dots) in sums[y / step * width..].iter_mut().zip(row.chunks(wide)) {
            for &dot in dots {
                let colour = palette[usize::from(dot)];
                (0..3).for_each(|c| sum[c] += u32::from(colour[c]));
                sum[3] += 1;
            }
        }
    }
    // The sides of a sheet fit in u16, and a mean of bytes fits in a byte.
    Pixels::from_fn(width as u32, height as u32, |x, y| {
        let [r, g, b, count] = sums[y as usize * width + x as usize];
        [r, g, b].map(|sum| ((sum + count / 2) / count.max(1)) as u8)
    })
}

/// A picture of an area of one pass in its ink, with `across` dots in 1/600 inch; at most `longest` pixels on its longer
/// side. Each pixel is the mean of its dots.
///
/// # Panics
/// If the area leaves the plane, which is a bug of the caller.
pub fn pass_thumbnail(
    pass: &Pass,
    area: Area,
    across: usize,
    ground: Ground,
    longest: usize,
) -> Pixels<[u8; 3]> {
    let colours = [ground.0, label(pass.ink, ground.0)];
    let step = (area.width / across).max(area.length).div_ceil(longest.max(1)).max(1);
    let wide = step * across;
    let (width, height) = (area.width.div_ceil(wide), area.length.div_ceil(step));
    // Dots of each pixel: all of them, and those with ink.
    let mut sums = vec![[0u32; 2]; width * height];
    for (y, row) in pass.plane.rows_in(area).enumerate() {
        let sums = &mut sums[y / step * width..][..width];
        for (i, sum) in sums.iter_mut().enumerate() {
            sum[0] += wide.min(area.width - i * wide) as u32;
        }
        for (i, eight) in row.enumerate().filter(|(_, eight)| *eight != 0) {
            let (first, last) = (8 * i / wide, (8 * i + 7) / wide);
            if first == last {
                sums[first][1] += eight.count_ones();
            } else {
                let inked = (0..8).filter(|bit| eight << bit & 0x80 != 0);
                inked.for_each(|bit| sums[(8 * i + bit) / wide][1] += 1);
            }
        }
    }
    // The sides of an area fit in u16, and a mean of bytes fits in a byte.
    Pixels::from_fn(width as u32, height as u32, |x, y| {
        let [all, inked] = sums[y as usize * width + x as usize];
        let mean = |c: usize| {
            let sum = u32::from(colours[0][c]) * (all - inked) + u32::from(colours[1][c]) * inked;
            ((sum + all / 2) / all.max(1)) as u8
        };
        [mean(0), mean(1), mean(2)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::ink::Ink;
    use protocol::paper::Paper;

    fn sheet() -> Sheet {
        let stacks = ["substrate", "W", "C", "W+C"].map(|text| text.parse().unwrap()).to_vec();
        let index = (0..20 * 12).map(|i| ((i % 20) / 5) as u8).collect();
        Sheet::new(Paper::Custom { width: 20, length: 12 }, stacks, index).unwrap()
    }

    #[test]
    fn colours_are_read_and_nonsense_is_not() {
        assert_eq!("#204080".parse(), Ok(Ground([0x20, 0x40, 0x80])));
        assert_eq!("204080".parse::<Ground>(), "#204080".parse());
        assert_eq!("Black".parse(), Ok(Ground([0; 3])));
        for wrong in ["", "#12345", "#1234567", "#+12345", "blue", "#ggгг"] {
            assert!(wrong.parse::<Ground>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn white_hides_the_ground_and_cyan_does_not() {
        let area = Area { left: 0, top: 2, width: 20, length: 3 };
        let png = sheet_in_inks(&sheet(), area, 1, Ground([0x20, 0x40, 0x80])).unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (20, 3));
        let at = |x: u32| picture.get_pixel(x, 1).0;
        assert_eq!(at(0), [0x20, 0x40, 0x80]);
        assert!(at(5).iter().all(|&c| c > 200), "white on blue is white");
        assert!(at(10).iter().all(|&c| c < 0x80), "cyan on blue is dark");
        assert!(at(15)[2] > 200 && at(15)[0] < 30, "cyan on white on blue is cyan");
    }

    #[test]
    fn a_pass_shows_its_own_dots_only() {
        let plane = sheet::Plane { width: 20, length: 2, stride: 3, bits: vec![0, 0x18, 0, 0x80, 0, 0x10] };
        let area = Area { left: 4, top: 0, width: 16, length: 2 };
        let png = pass_in_ink(&Pass { ink: Ink::White, plane }, area, 1, Ground([0; 3])).unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        let lit: Vec<(u32, u32)> =
            picture.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 100).map(|(x, y, _)| (x, y)).collect();
        assert_eq!(lit, [(7, 0), (8, 0), (15, 1)]);
    }

    #[test]
    fn a_thumbnail_of_a_pass_keeps_the_mean_of_its_area() {
        // 4 x 2 dots of ink at (5, 1).
        let mut bits = vec![0u8; 3 * 5];
        for (x, y) in [1, 2].into_iter().flat_map(|y| (5..9).map(move |x| (x, y))) {
            bits[y * 3 + x / 8] |= 0x80 >> (x % 8);
        }
        let pass = Pass { ink: Ink::White, plane: sheet::Plane { width: 20, length: 5, stride: 3, bits } };
        let area = Area { left: 4, top: 0, width: 12, length: 4 };
        let small = pass_thumbnail(&pass, area, 1, Ground([0; 3]), 6);
        assert_eq!(small.size(), (6, 2));
        let white = f64::from(label(Ink::White, [0; 3])[0]);
        // Dots 4 and 5 of rows 0 and 1: one of four has ink.
        for (x, y, share) in [(0, 0, 0.25), (1, 0, 0.5), (2, 0, 0.25), (3, 0, 0.0), (1, 1, 0.5), (5, 1, 0.0)]
        {
            let found = f64::from(small.at(x, y)[0]);
            assert!((found - share * white).abs() <= 1.0, "({x}, {y}): {found}");
        }
    }

    #[test]
    fn a_thumbnail_keeps_the_mean() {
        let small = thumbnail(&sheet(), sheet().whole(), 1, Ground([0; 3]), 10);
        assert_eq!(small.size(), (10, 6));
        let white = f64::from(upon(&"W".parse().unwrap(), [0; 3])[0]);
        // Dots 4 and 5: half ground, half white.
        assert!((f64::from(small.at(2, 0)[0]) - white / 2.0).abs() <= 1.0);
    }
}
