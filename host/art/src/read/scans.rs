//! Scanned pages and drawings saved as JPEG: paper that is nearly white, and ink that is nearly black.
//!
//! Problem: text is cut where it is softened between white and black, but noise leaves hardly a pixel of either, and all of it
//! would be screened as a photograph.
//! Method: a page is a scan if half of its pictures is nearly white and what is nearly white changes from pixel to pixel as noise does; a
//! flat tint does not. If most of the rest is nearly black or beside it, it is black on white: nearly white is white there, and nearly
//! black black. Otherwise nearly white is white if noise is half of the page and hardly differs from white: that is paper, and no sky.
//! Cost: 1 ns a pixel, twice on such a page. Limits: text in colour keeps its own noise, and tints lighter than [`Rules::paper`] vanish with
//! that of paper.

use rayon::prelude::*;

use crate::read::object_type::{ObjectType, split};
use appearance::wide::wide;

/// What is nearly white and nearly black. A test moves each of these by a fifth.
#[derive(Clone, Copy, Debug)]
struct Rules {
    /// Paper with noise has at least so much in each of red, green and blue, and ink at most so much.
    paper: u8,
    ink: u8,
    /// The paper of a scan in colour nearly always has at least so much.
    bright: u8,
}

impl Rules {
    const USUAL: Rules = Rules { paper: 225, ink: 48, bright: 243 };

    /// White or black, if a colour is nearly one of them.
    #[inline(always)]
    fn plain(self, colour: [u8; 3]) -> [u8; 3] {
        if colour.iter().all(|&v| v >= self.paper) {
            [255; 3]
        } else if colour.iter().all(|&v| v <= self.ink) {
            [0; 3]
        } else {
            colour
        }
    }
}

/// Pixels of pictures.
#[derive(Clone, Copy, Default)]
struct Counts {
    paper: usize,
    /// Nearly white, but not white, amid paper, as the soft edge of a letter is not; and how many of these differ from the pixel before.
    noise: usize,
    changes: usize,
    /// How many of it are hardly darker than white.
    bright: usize,
    ink: usize,
    others: usize,
}

/// How many pixels are nearly white paper, and how many are of pictures.
fn paper<const N: usize>(rules: Rules, pixels: &[[u8; N]]) -> (u64, u64) {
    let (mut paper, mut pictures) = (0u32, 0u32);
    wide(
        #[inline(always)]
        || {
            for pixel in pixels {
                let (kind, [r, g, b]) = split(pixel);
                let is_picture = kind == ObjectType::Picture;
                pictures += u32::from(is_picture);
                paper += u32::from(is_picture & (r.min(g).min(b) >= rules.paper));
            }
        },
    );
    (paper.into(), pictures.into())
}

impl Counts {
    fn of<const N: usize>(rules: Rules, pixels: &[[u8; N]]) -> Counts {
        let mut counts = Counts::default();
        let is_paper = |pixel: Option<&[u8; N]>| {
            pixel.is_none_or(|pixel| {
                split(pixel).0 != ObjectType::Picture || rules.plain(split(pixel).1) == [255; 3]
            })
        };
        for (at, pixel) in pixels.iter().enumerate() {
            let (kind, colour) = split(pixel);
            if kind != ObjectType::Picture {
                continue;
            }
            if colour == [255; 3] {
                counts.paper += 1;
                continue;
            }
            match rules.plain(colour) {
                [255, 255, 255] => {
                    let before = at.checked_sub(1).and_then(|at| pixels.get(at));
                    let noise = usize::from(is_paper(before) && is_paper(pixels.get(at + 1)));
                    counts.paper += 1;
                    counts.noise += noise;
                    counts.bright += noise & usize::from(colour.iter().all(|&v| v >= rules.bright));
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
            bright: self.bright + other.bright,
            ink: self.ink + other.ink,
            others: self.others + other.others,
        }
    }

    /// Of a page that was enlarged four times, one pixel in four differs from that before.
    fn has_noise(&self) -> bool {
        6 * self.changes > self.noise
    }

    fn is_black_on_white(&self) -> bool {
        self.paper > self.ink + self.others && self.others <= 3 * self.ink && self.has_noise()
    }

    /// Whether it is paper with something in colour on it.
    fn is_on_paper(&self) -> bool {
        let all = self.paper + self.ink + self.others;
        2 * self.noise > all && 20 * self.bright >= 19 * self.noise && self.has_noise()
    }
}

/// Takes the noise from pixels if they are such a page; returns whether they are.
pub(crate) fn clean<const N: usize>(pixels: &mut [[u8; N]]) -> bool {
    clean_by(Rules::USUAL, pixels)
}

/// The same by these rules.
fn clean_by<const N: usize>(rules: Rules, pixels: &mut [[u8; N]]) -> bool {
    let both = |a: (u64, u64), b: (u64, u64)| (a.0 + b.0, a.1 + b.1);
    // Most of a photograph is no paper.
    let (paper, pictures) =
        pixels.par_chunks(1 << 16).map(|pixels| paper(rules, pixels)).reduce(|| (0, 0), both);
    if 2 * paper <= pictures {
        return false;
    }
    let parts = pixels.par_chunks(1 << 16).map(|pixels| Counts::of(rules, pixels));
    let counts = parts.reduce(Counts::default, Counts::and);
    let is_black = counts.is_black_on_white();
    if !is_black && !counts.is_on_paper() {
        return false;
    }
    pixels.par_iter_mut().for_each(|pixel| {
        let (kind, colour) = split(pixel);
        let plain = rules.plain(colour);
        if kind == ObjectType::Picture && (is_black || plain == [255; 3]) {
            pixel[N - 3..].copy_from_slice(&plain);
        }
    });
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::Colour;
    use crate::colour::packed::{BLACK, WHITE};
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

    /// The usual rules, and each of them a fifth farther from or nearer to white or black.
    fn moved() -> Vec<Rules> {
        let usual = Rules::USUAL;
        let from_white = |v: u8, fifths: u8| 255 - ((255 - v) * fifths).div_ceil(5);
        let moved = [4, 6].map(|fifths| {
            [
                Rules { paper: from_white(usual.paper, fifths), ..usual },
                Rules { ink: usual.ink / 5 * fifths, ..usual },
                Rules { bright: from_white(usual.bright, fifths), ..usual },
            ]
        });
        [&[usual], moved.as_flattened()].concat()
    }

    #[test]
    fn black_strokes_through_jpeg_are_cut_where_they_cover_half_a_pixel() {
        for rules in moved() {
            let mut pixels = through_jpeg([0; 3], [255; 3]);
            let exact = pixels.iter().filter(|pixel| **pixel == [255; 3] || **pixel == [0; 3]).count();
            assert!(exact < pixels.len() * 3 / 4, "there is noise: {exact}");
            assert!(clean_by(rules, &mut pixels));
            let size = (SIDE as u32, SIDE as u32);
            let colour = Colour::of_pixels::<3>(pixels.concat(), size).unwrap();
            let keys = colour.keys((SIDE, SIDE));
            let wrong = (0..SIDE * SIDE)
                .filter(|&at| (covered(at) - 0.5).abs() > 0.25)
                .filter(|&at| keys[at] != if covered(at) > 0.5 { BLACK } else { WHITE })
                .count();
            assert_eq!(wrong, 0);
        }
    }

    /// Text in orange and blue on paper with noise, as a scanner sees it.
    #[test]
    fn coloured_strokes_on_noisy_paper_keep_their_colours_and_have_no_specks() {
        let inks = [[230.0, 126.0, 34.0], [40.0, 70.0, 140.0]];
        let noise =
            |at: usize| (0..6).map(|n| ((at * 6 + n) as u32).wrapping_mul(0x9e37_79b1) >> 29).sum::<u32>();
        let page: Vec<[u8; 3]> = (0..SIDE * SIDE)
            .map(|at| {
                let (ink, share) = (inks[at / SIDE / 60 % 2], covered(at));
                let off = f64::from(noise(at)) - 21.0;
                ink.map(|v| (v * share + 252.0 * (1.0 - share) + off / 2.0) as u8)
            })
            .collect();
        for rules in moved() {
            let mut pixels = page.clone();
            assert!(clean_by(rules, &mut pixels), "{rules:?}");
            for (at, (pixel, before)) in pixels.iter().zip(&page).enumerate() {
                match covered(at) {
                    0.0 => assert_eq!(*pixel, [255; 3], "{rules:?}: {before:?}"),
                    0.5.. => assert_eq!(pixel, before, "{rules:?}"),
                    _ => {}
                }
            }
        }
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
