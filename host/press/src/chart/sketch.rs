//! A dot map to draw rectangles, letters and halftoned patches on.

use std::convert::Infallible;

use embedded_graphics::mono_font::ascii::{FONT_9X18, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Pixel, Point, Size};
use embedded_graphics::text::{Baseline, Text};
use inks::{Library, Stack};
use protocol::ink::Ink;

use super::error::ChartError;
use crate::layout::Mm;
use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps};
use halftone::{Method, halftone};
use observe::Observer;
use sheet::{DotMap, SheetError};

/// Width of a letter of scale 1 in dots.
pub(super) const LETTER: usize = 10;
/// Height of a line of scale 1 in dots.
pub(super) const LINE: usize = 20;

/// Millimetres as dots; charts are drawn with lengths that are not negative.
pub(super) fn mm(length: f64) -> usize {
    Mm(length).dots().max(0) as usize
}

/// How a patch is halftoned: with the minimum clusters of the library, or with this one for all stacks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Screen {
    pub method: Method,
    pub minimum: Option<u16>,
}

impl From<Method> for Screen {
    fn from(method: Method) -> Screen {
        Screen { method, minimum: None }
    }
}

/// Scale of letters 18 dots high whose capitals are as high as those of 6 points, 36 dots.
const SIX_POINTS: usize = 3;

/// A rectangle: x, y, width, length in dots.
pub(super) type Place = (usize, usize, usize, usize);

/// Something being drawn. What leaves its edges is cut off.
pub(super) struct Sketch {
    width: usize,
    length: usize,
    stacks: Vec<Stack>,
    index: Vec<u8>,
}

impl Sketch {
    pub(super) fn new(width: usize, length: usize) -> Sketch {
        Sketch { width, length, stacks: vec![Stack::SUBSTRATE], index: vec![0; width * length] }
    }

    pub(super) fn finish(self) -> Result<DotMap, SheetError> {
        DotMap::new(self.width, self.length, self.stacks, self.index)
    }

    /// The number of a stack. Charts have far fewer than 256; the check is [`DotMap::new`]'s.
    fn number(&mut self, stack: &Stack) -> u8 {
        let known = self.stacks.iter().position(|known| known == stack);
        known.unwrap_or_else(|| {
            self.stacks.push(stack.clone());
            self.stacks.len() - 1
        }) as u8
    }

    fn put(&mut self, x: usize, y: usize, number: u8) {
        if x < self.width && y < self.length {
            self.index[y * self.width + x] = number;
        }
    }

    /// Fills a rectangle.
    pub(super) fn fill(&mut self, (x, y, width, length): Place, stack: &Stack) {
        let number = self.number(stack);
        let end = (x + width).min(self.width);
        for row in y..(y + length).min(self.length) {
            if x < end {
                self.index[row * self.width + x..row * self.width + end].fill(number);
            }
        }
    }

    /// Writes a line of letters with its top left corner at (x, y), each dot of them `scale` dots wide.
    pub(super) fn text(&mut self, x: usize, y: usize, scale: usize, stack: &Stack, text: &str) {
        self.letters((x, y), (&FONT_10X20, scale), stack, text);
    }

    fn letters(
        &mut self,
        (x, y): (usize, usize),
        (font, scale): (&MonoFont<'_>, usize),
        stack: &Stack,
        text: &str,
    ) {
        let number = self.number(stack);
        let mut pen = Pen { sketch: self, x, y, scale, number };
        let style = MonoTextStyle::new(font, BinaryColor::On);
        let Ok(_) = Text::with_baseline(text, Point::zero(), style, Baseline::Top).draw(&mut pen);
    }

    /// Letters that end at x.
    pub(super) fn text_to(&mut self, x: usize, y: usize, scale: usize, stack: &Stack, text: &str) {
        self.text(x.saturating_sub(text.len() * LETTER * scale), y, scale, stack, text);
    }

    /// Fills a rectangle with a halftone of two stacks; `share` is that of the first, 0 to 1, at each of as many places
    /// from left to right.
    pub(super) fn halftone(
        &mut self,
        place: Place,
        stacks: [&Stack; 2],
        share: &[f64],
        screen: Screen,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(), ChartError> {
        self.screened(place, stacks, share, screen, |_, _| true, (library, observer))
    }

    /// Writes lines of 6-point letters, as high as they are in ordinary print, in a halftone of two stacks.
    pub(super) fn halftoned_text(
        &mut self,
        place: Place,
        stacks: [&Stack; 2],
        share: f64,
        screen: Screen,
        lines: &str,
        work: (&Library, &dyn Observer),
    ) -> Result<(), ChartError> {
        let (_, _, width, length) = place;
        let mut mask = Sketch::new(width, length);
        mask.letters((0, 0), (&FONT_9X18, SIX_POINTS), &Stack::new([Ink::Black]), lines);
        let is_letter = |x: usize, y: usize| mask.index[y * width + x] > 0;
        self.screened(place, stacks, &[share], screen, is_letter, work)
    }

    fn screened(
        &mut self,
        (x, y, width, length): Place,
        [a, b]: [&Stack; 2],
        share: &[f64],
        Screen { method, minimum }: Screen,
        is_part: impl Fn(usize, usize) -> bool,
        (library, observer): (&Library, &dyn Observer),
    ) -> Result<(), ChartError> {
        let mut stacks = vec![Stack::SUBSTRATE];
        let mut row_of = |stack: &Stack| {
            stacks.iter().position(|known| known == stack).unwrap_or_else(|| {
                stacks.push(stack.clone());
                stacks.len() - 1
            })
        };
        let rows = [row_of(a), row_of(b)];
        let matrix =
            rows.map(|at| (0..stacks.len()).map(|q| if q == at { ONE } else { 0 }).collect()).to_vec();
        let weights: Vec<u16> = share
            .iter()
            .map(|share| (share.clamp(0.0, 1.0) * f64::from(ONE)).round() as u16)
            .flat_map(|first| [first, ONE - first])
            .collect();
        // Sides of a chart are those of a sheet, which are u16.
        let (wide, long) = (width as u16, length as u16);
        let maps = WeightMaps::new(share.len(), 1, 2, weights)?;
        let mix = InkMix { stacks, maps, matrix };
        let mut settings =
            halftone::Settings { method, ..halftone::Settings::from_library(&mix.stacks, library) };
        if let Some(minimum) = minimum {
            settings.minimum.fill(minimum);
        }
        let patch = halftone(&mix, (wide, long), None, &settings, observer)?;
        let numbers: Vec<u8> = mix.stacks.iter().map(|stack| self.number(stack)).collect();
        for (row, dots) in patch.index().chunks_exact(width).enumerate() {
            for (column, &dot) in dots.iter().enumerate().filter(|&(column, _)| is_part(column, row)) {
                self.put(x + column, y + row, numbers[usize::from(dot)]);
            }
        }
        Ok(())
    }
}

/// What the letters' library draws with.
struct Pen<'a> {
    sketch: &'a mut Sketch,
    x: usize,
    y: usize,
    scale: usize,
    number: u8,
}

impl OriginDimensions for Pen<'_> {
    fn size(&self) -> Size {
        // Only a hint to the library; the sketch cuts by itself.
        Size::new(u16::MAX.into(), u16::MAX.into())
    }
}

impl DrawTarget for Pen<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (BinaryColor::On, Ok(x), Ok(y)) = (colour, usize::try_from(at.x), usize::try_from(at.y)) {
                for dy in 0..self.scale {
                    for dx in 0..self.scale {
                        self.sketch.put(
                            self.x + x * self.scale + dx,
                            self.y + y * self.scale + dy,
                            self.number,
                        );
                    }
                }
            }
        }
        Ok(())
    }
}
