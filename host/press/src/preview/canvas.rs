//! A picture on which radiance and text are laid out.

use std::convert::Infallible;

use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_9X15, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Pixel, Point, Size};
use embedded_graphics::text::{Baseline, Text};
use rayon::prelude::*;
use readers::Pixels;

use super::error::{PreviewError, check_size};
use super::radiance::Radiance;
use super::tone::{ToneCurve, linear, srgb};

/// The neutral background, sRGB.
const GROUND: [u8; 3] = [52, 52, 52];
/// Colour of important text.
pub(super) const INK: [u8; 3] = [232, 232, 232];
/// Colour of explanatory text.
pub(super) const FAINT: [u8; 3] = [168, 168, 168];

/// Ground of the badge.
const BADGE: [u8; 3] = [240, 178, 104];

/// Width of a page on a telephone, in pixels.
const TELEPHONE: usize = 390;

/// Sizes of letters; all letters of a size have the same width.
#[derive(Clone, Copy)]
pub(super) enum Letters {
    Title,
    Plain,
    Small,
    /// Twice [`Letters::Plain`].
    Large,
    /// Twice [`Letters::Title`].
    Huge,
}

impl Letters {
    fn font(self) -> &'static MonoFont<'static> {
        match self {
            Letters::Title | Letters::Huge => &FONT_10X20,
            Letters::Plain | Letters::Large => &FONT_9X15,
            Letters::Small => &FONT_7X13,
        }
    }

    /// How many times they are enlarged.
    fn times(self) -> usize {
        if matches!(self, Letters::Large | Letters::Huge) { 2 } else { 1 }
    }

    /// The smallest that can be read on a telephone, whose page shows a picture of this width in 390 pixels.
    pub fn readable(wide: usize) -> Letters {
        let all = [Letters::Plain, Letters::Title, Letters::Large];
        all.into_iter().find(|letters| letters.height() * TELEPHONE >= 13 * wide).unwrap_or(Letters::Huge)
    }

    /// Width of a letter in pixels.
    pub fn width(self) -> usize {
        self.font().character_size.width as usize * self.times()
    }

    /// Height of a line in pixels.
    pub fn height(self) -> usize {
        self.font().character_size.height as usize * self.times()
    }
}

/// What stands above a picture.
#[derive(Clone, Copy, Debug)]
pub struct Heading<'a> {
    /// Its title.
    pub title: &'a str,
    /// Whether curves of its inks are modelled, which a badge says.
    pub modelled: bool,
}

/// The badge of pictures whose inks were not measured.
const MODELLED: &str = "modelled inks";

/// A picture on the neutral background.
pub(super) struct Canvas {
    image: Pixels<[u8; 3]>,
}

impl Canvas {
    pub fn new(width: usize, height: usize) -> Result<Canvas, PreviewError> {
        check_size(width, height)?;
        Ok(Canvas { image: Pixels::filled(width as u32, height as u32, GROUND) })
    }

    pub fn finish(self) -> Pixels<[u8; 3]> {
        self.image
    }

    /// Writes a line with its top left corner at (x, y), cut off at the edge. Letters outside Latin-1
    /// become question marks.
    pub fn text(&mut self, x: usize, y: usize, letters: Letters, colour: [u8; 3], text: &str) {
        let (width, height) = self.image.size();
        let (width, height) = (width as usize, height as usize);
        if x >= width || y >= height {
            return;
        }
        let style = MonoTextStyle::new(letters.font(), Rgb888::new(colour[0], colour[1], colour[2]));
        // Cut here, because the drawing library adds up widths without checking for overflow.
        let visible: String = text.chars().take((width - x).div_ceil(letters.width())).collect();
        let text = Text::with_baseline(&visible, Point::zero(), style, Baseline::Top);
        let Ok(_) = text.draw(&mut Enlarged { canvas: self, at: (x, y), times: letters.times() });
    }

    /// Writes the title at the left, and the badge at the right, both this far from the edge.
    pub fn heading(&mut self, heading: Heading, gap: usize, letters: Letters) {
        let room = (self.image.size().0 as usize).saturating_sub(2 * gap) / letters.width();
        let badge = if heading.modelled { MODELLED.len() } else { 0 };
        self.text(gap, gap, letters, INK, &shortened(heading.title, room.saturating_sub(badge + 2)));
        if heading.modelled {
            let left = gap + room.saturating_sub(badge) * letters.width();
            let (width, height) = (badge * letters.width(), letters.height());
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (left + x, gap + y))) {
                if let Some(pixel) = self.image.at_mut(x as u32, y as u32) {
                    *pixel = BADGE;
                }
            }
            self.text(left, gap, letters, GROUND, MODELLED);
        }
    }

    /// Draws radiance over the background with its top left corner at (x, y).
    pub fn paste(&mut self, x: usize, y: usize, picture: &Radiance, tone: ToneCurve) {
        let ground = linear(GROUND);
        let (width, stride) = (picture.width.max(1), self.image.size().0 as usize);
        let lines = self.image.pixels_mut().par_chunks_exact_mut(stride.max(1)).skip(y);
        lines.zip(picture.pixels.par_chunks_exact(width)).for_each(|(line, row)| {
            let visible = line.iter_mut().skip(x);
            for (out, &[r, g, b, covered]) in visible.zip(row).filter(|(_, pixel)| pixel[3] > 0.0) {
                // Tone mapping applies to the covered part; the result is then blended at the edge.
                let shown = tone.shown([r, g, b].map(|v| v / covered));
                let blend = |c: usize| shown[c] * covered + ground[c] * (1.0 - covered);
                *out = srgb([blend(0), blend(1), blend(2)]);
            }
        });
    }
}

/// A canvas on which something is drawn at a place, so many times enlarged.
struct Enlarged<'a> {
    canvas: &'a mut Canvas,
    at: (usize, usize),
    times: usize,
}

impl OriginDimensions for Enlarged<'_> {
    fn size(&self) -> Size {
        Size::from(self.canvas.image.size())
    }
}

impl DrawTarget for Enlarged<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) else { continue };
            for part in 0..self.times * self.times {
                let x = self.at.0 + x * self.times + part % self.times;
                let y = self.at.1 + y * self.times + part / self.times;
                if let Some(pixel) = self.canvas.image.at_mut(x as u32, y as u32) {
                    *pixel = [colour.r(), colour.g(), colour.b()];
                }
            }
        }
        Ok(())
    }
}

/// A picture by itself on the neutral background.
///
/// # Errors
/// A side that is 0 or too long.
pub fn picture(radiance: &Radiance, tone: ToneCurve) -> Result<Pixels<[u8; 3]>, PreviewError> {
    let mut canvas = Canvas::new(radiance.width, radiance.height)?;
    canvas.paste(0, 0, radiance, tone);
    Ok(canvas.finish())
}

/// A text cut to `room` letters.
pub(super) fn shortened(text: &str, room: usize) -> String {
    if text.chars().count() <= room {
        return text.to_string();
    }
    text.chars().take(room.saturating_sub(2)).chain("..".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stay_where_they_are_put_and_what_does_not_fit_is_cut_off() {
        let mut canvas = Canvas::new(40, 30).unwrap();
        canvas.text(9, 8, Letters::Small, INK, "MS+C · 62 % ñ");
        canvas.text(1 << 40, 5, Letters::Title, INK, "far away");
        canvas.text(5, 1 << 40, Letters::Title, INK, "far below");
        let image = canvas.finish();
        let lit = |x: u32, y: u32| image.at(x, y) != GROUND;
        let all = || (0..30).flat_map(|y| (0..40).map(move |x| (x, y)));
        assert!(all().filter(|&(x, y)| lit(x, y)).count() > 40);
        assert!(all().filter(|&(x, y)| lit(x, y)).all(|(x, y)| x >= 9 && (8..21).contains(&y)));
    }

    #[test]
    fn half_covered_pixels_are_half_ground() {
        let mut canvas = Canvas::new(3, 1).unwrap();
        let pixels = vec![[0.2, 0.2, 0.2, 1.0], [0.1, 0.1, 0.1, 0.5], [0.0; 4]];
        canvas.paste(
            0,
            0,
            &Radiance { width: 3, height: 1, pixels },
            ToneCurve { exposure: 1.0, ..ToneCurve::PAPER },
        );
        let image = canvas.finish();
        let value = |x| linear(image.at(x, 0))[0];
        assert!((value(0) - 0.2).abs() < 2e-3);
        assert!((value(1) - 0.5 * (0.2 + linear(GROUND)[0])).abs() < 2e-3);
        assert_eq!(image.at(2, 0), GROUND);
    }

    #[test]
    fn pictures_beyond_the_edge_are_cut_off() {
        let mut canvas = Canvas::new(2, 2).unwrap();
        let picture = Radiance { width: 3, height: 3, pixels: vec![[9.0, 9.0, 9.0, 1.0]; 9] };
        canvas.paste(1, 1, &picture, ToneCurve { exposure: 1.0, ..ToneCurve::PAPER });
        let image = canvas.finish();
        assert_eq!(image.at(0, 1), GROUND);
        assert!(image.at(1, 1)[0] > 240);
    }

    #[test]
    fn words_that_do_not_fit_are_cut() {
        assert_eq!(shortened("light from the left", 8), "light ..");
        assert_eq!(shortened("short", 8), "short");
    }
}
