//! A picture to lay radiance and words out on.

use std::convert::Infallible;

use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_9X15, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Pixel, Point, Size};
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage};

use super::tone::{Exposure, linear, srgb};
use super::{PreviewError, Radiance, check_size};

/// The neutral ground, sRGB.
pub const GROUND: [u8; 3] = [52, 52, 52];
/// Words that matter.
pub const INK: [u8; 3] = [232, 232, 232];
/// Words that explain.
pub const FAINT: [u8; 3] = [168, 168, 168];

/// The sizes of letters in use; every letter of a size is equally wide.
#[derive(Clone, Copy)]
pub enum Letters {
    Title,
    Plain,
    Small,
}

impl Letters {
    fn font(self) -> &'static MonoFont<'static> {
        match self {
            Letters::Title => &FONT_10X20,
            Letters::Plain => &FONT_9X15,
            Letters::Small => &FONT_7X13,
        }
    }

    /// Pixels a letter is wide.
    pub fn width(self) -> usize {
        self.font().character_size.width as usize
    }

    /// Pixels a line is high.
    pub fn height(self) -> usize {
        self.font().character_size.height as usize
    }
}

/// A picture on the neutral ground.
pub struct Canvas {
    image: RgbImage,
}

impl Canvas {
    pub fn new(width: usize, height: usize) -> Result<Canvas, PreviewError> {
        check_size(width, height)?;
        Ok(Canvas { image: RgbImage::from_pixel(width as u32, height as u32, Rgb(GROUND)) })
    }

    pub fn finish(self) -> RgbImage {
        self.image
    }

    /// Writes a line with its top left corner at (x, y); what does not fit is cut off. Letters outside Latin-1
    /// appear as question marks.
    pub fn text(&mut self, x: usize, y: usize, letters: Letters, colour: [u8; 3], text: &str) {
        let style = MonoTextStyle::new(letters.font(), Rgb888::new(colour[0], colour[1], colour[2]));
        let at = Point::new(x.min(i32::MAX as usize) as i32, y.min(i32::MAX as usize) as i32);
        let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(self);
    }

    /// Lays radiance over the ground with its top left corner at (x, y).
    pub fn paste(&mut self, x: usize, y: usize, picture: &Radiance, exposure: Exposure) {
        let ground = linear(GROUND);
        for (j, row) in picture.pixels.chunks_exact(picture.width).enumerate() {
            for (i, &[r, g, b, covered]) in row.iter().enumerate() {
                let (px, py) = ((x + i) as u32, (y + j) as u32);
                if covered <= 0.0 || px >= self.image.width() || py >= self.image.height() {
                    continue;
                }
                // The curve is for what is covered; the edge then blends what is shown.
                let shown = exposure.shown([r, g, b].map(|v| v / covered));
                let blend = |c: usize| shown[c] * covered + ground[c] * (1.0 - covered);
                self.image.put_pixel(px, py, Rgb(srgb([blend(0), blend(1), blend(2)])));
            }
        }
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.image.width(), self.image.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y))
                && x < self.image.width()
                && y < self.image.height()
            {
                self.image.put_pixel(x, y, Rgb([colour.r(), colour.g(), colour.b()]));
            }
        }
        Ok(())
    }
}
