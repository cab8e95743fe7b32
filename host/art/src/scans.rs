//! Scanned pages and drawings saved as JPEG: paper that is nearly white, and ink that is nearly black.
//!
//! Problem: text is cut where it is softened between white and black, but noise leaves hardly a pixel of either, and all of it
//! would be screened as a photograph.
//! Method: a page is one of black on white if half of its pictures is nearly white, most of the rest nearly black or beside it, and what is
//! nearly white changes from pixel to pixel as noise does; a flat tint does not. Nearly white is white there, and nearly black
//! black.
//! Cost: 1 ns a pixel, twice on such a page. Limits: text in colour keeps its noise, and tints lighter than [`PAPER`] vanish with it.

use rayon::prelude::*;

use super::kinds::{ObjectType, split};

/// Paper with noise has at least so much in each of red, green and blue, and ink at most so much.
const PAPER: u8 = 225;
const INK: u8 = 48;

/// Pixels of pictures.
#[derive(Clone, Copy, Default)]
struct Counts {
    paper: usize,
    /// Nearly white, but not white, amid paper, as the soft edge of a letter is not; and how many of these differ from the pixel before.
    noise: usize,
    changes: usize,
    ink: usize,
    others: usize,
}

impl Counts {
    fn of<const N: usize>(pixels: &[[u8; N]]) -> Counts {
        let mut counts = Counts::default();
        let is_paper = |pixel: Option<&[u8; N]>| {
            pixel.is_none_or(|pixel| {
                split(pixel).0 != ObjectType::Picture || plain(split(pixel).1) == [255; 3]
            })
        };
        for (at, pixel) in pixels.iter().enumerate() {
            let (kind, colour) = split(pixel);
            if kind != ObjectType::Picture {
                continue;
            }
            match plain(colour) {
                [255, 255, 255] => {
                    let before = at.checked_sub(1).and_then(|at| pixels.get(at));
                    let noise =
                        usize::from(colour != [255; 3] && is_paper(before) && is_paper(pixels.get(at + 1)));
                    counts.paper += 1;
                    counts.noise += noise;
                    counts.changes += noise & usize::from(before.is_none_or(|before| before != pixel));
                }
                [0, 0, 0] => counts.ink += 1,
                _ => counts.others += 1,
            }
        }
        counts
    }

    fn and(self, other: Counts) -> Counts {
        Counts {
            paper: self.paper + other.paper,
            noise: self.noise + other.noise,
            changes: self.changes + other.changes,
            ink: self.ink + other.ink,
            others: self.others + other.others,
        }
    }

    fn is_black_on_white(&self) -> bool {
        // Of a page that was enlarged four times, one pixel in four differs from that before.
        self.paper > self.ink + self.others && self.others <= 3 * self.ink && 6 * self.changes > self.noise
    }
}

/// White or black, if a colour is nearly one of them.
fn plain(colour: [u8; 3]) -> [u8; 3] {
    if colour.iter().all(|&v| v >= PAPER) {
        [255; 3]
    } else if colour.iter().all(|&v| v <= INK) {
        [0; 3]
    } else {
        colour
    }
}

/// Takes the noise from pixels if they are such a page; returns whether they are.
pub(super) fn clean<const N: usize>(pixels: &mut [[u8; N]]) -> bool {
    let counts = pixels.par_chunks(1 << 16).map(Counts::of).reduce(Counts::default, Counts::and);
    let clean = |pixel: &mut [u8; N]| {
        let (kind, colour) = split(pixel);
        if kind == ObjectType::Picture {
            pixel[N - 3..].copy_from_slice(&plain(colour));
        }
    };
    if counts.is_black_on_white() {
        pixels.par_iter_mut().for_each(clean);
    }
    counts.is_black_on_white()
}

#[cfg(test)]
mod tests {
    use super::super::colour::Colour;
    use super::super::key::{BLACK, WHITE};
    use super::*;
    use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
    use image::{ExtendedColorType, ImageDecoder};

    const SIDE: usize = 240;

    /// Strokes of 4 to 7 pixels, straight and round: how much of a pixel they cover.
    fn covered(at: usize) -> f64 {
        let inside = |i: usize| {
            let place = |at: usize, i: usize| at as f64 + (i as f64 + 0.5) / 4.0;
            let (x, y) = (place(at % SIDE, i % 4), place(at / SIDE, i / 4));
            let far = (x % 60.0 - 30.0).hypot(y % 60.0 - 30.0);
            (14.0..14.0 + 4.0 + y / 80.0).contains(&far) || (2.3..6.8).contains(&(x % 60.0))
        };
        (0..16).filter(|&i| inside(i)).count() as f64 / 16.0
    }

    /// A picture of these strokes in a colour on a ground, through JPEG.
    fn through_jpeg(ink: [u8; 3], ground: [u8; 3]) -> Vec<[u8; 3]> {
        let mix = |c: usize, share: f64| f64::from(ink[c]) * share + f64::from(ground[c]) * (1.0 - share);
        let pixels: Vec<u8> = (0..SIDE * SIDE)
            .flat_map(|at| std::array::from_fn::<u8, 3, _>(|c| mix(c, covered(at)).round() as u8))
            .collect();
        let mut file = Vec::new();
        let side = SIDE as u32;
        JpegEncoder::new_with_quality(&mut file, 85)
            .encode(&pixels, side, side, ExtendedColorType::Rgb8)
            .unwrap();
        let mut out = vec![0; pixels.len()];
        JpegDecoder::new(std::io::Cursor::new(file)).unwrap().read_image(&mut out).unwrap();
        out.as_chunks::<3>().0.to_vec()
    }

    #[test]
    fn black_strokes_through_jpeg_are_cut_where_they_cover_half_a_pixel() {
        let mut pixels = through_jpeg([0; 3], [255; 3]);
        let exact = pixels.iter().filter(|pixel| **pixel == [255; 3] || **pixel == [0; 3]).count();
        assert!(exact < pixels.len() * 3 / 4, "there is noise: {exact}");
        assert!(clean(&mut pixels));
        let size = (SIDE as u32, SIDE as u32);
        let colour = Colour::of_pixels::<3>(pixels.concat(), size).unwrap();
        let keys = colour.keys((SIDE, SIDE));
        let wrong = (0..SIDE * SIDE)
            .filter(|&at| (covered(at) - 0.5).abs() > 0.25)
            .filter(|&at| keys[at] != if covered(at) > 0.5 { BLACK } else { WHITE })
            .count();
        assert_eq!(wrong, 0);
    }

    /// A page of text with softened letters and a panel in a pale tint, as a browser draws it.
    #[test]
    fn the_tints_of_a_page_without_noise_stay() {
        let panel = [236, 240, 243];
        let page = |panel: [u8; 3]| -> Vec<[u8; 3]> {
            let colour = |at: usize| {
                let ground = if (60..90).contains(&(at / SIDE)) { panel } else { [255; 3] };
                let share = covered(at);
                ground.map(|v| (f64::from(v) * (1.0 - share)).round() as u8)
            };
            (0..SIDE * SIDE).map(colour).collect()
        };
        let mut pixels = page(panel);
        clean(&mut pixels);
        assert!(pixels.iter().filter(|&&pixel| pixel == panel).count() > SIDE * 15);
    }

    #[test]
    fn colours_tints_and_photographs_are_no_such_page() {
        assert!(!clean(&mut through_jpeg([30, 60, 160], [255; 3])));
        assert!(!clean(&mut through_jpeg([0; 3], [190, 220, 240])));
        // Black text on a panel that is nearly white, without noise.
        let mut panel: Vec<[u8; 3]> =
            (0..SIDE * SIDE).map(|at| if covered(at) > 0.5 { [0; 3] } else { [240; 3] }).collect();
        assert!(!clean(&mut panel));
        // A bright photograph of a thing on white.
        let mut photograph: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let (x, y) = ((at % SIDE) as f64 - 120.0, (at / SIDE) as f64 - 120.0);
                let (far, noise) = (x.hypot(y), (at * 7919 % 13) as f64);
                [if far < 80.0 { 20.0 + 2.0 * far + noise } else { 240.0 + noise } as u8; 3]
            })
            .collect();
        assert!(!clean(&mut photograph));
    }

    #[test]
    fn text_and_drawings_beside_a_scan_keep_their_colours() {
        let scan: Vec<[u8; 4]> =
            through_jpeg([0; 3], [255; 3]).iter().map(|&[r, g, b]| [ObjectType::PICTURE, r, g, b]).collect();
        let panel = [ObjectType::DRAWING, 240, 240, 240];
        let mut page = scan;
        page[0] = panel;
        assert!(clean(&mut page));
        assert_eq!(page[0], panel);
        assert!(page[1..].iter().any(|pixel| pixel[1..] == [0; 3]));
    }
}
