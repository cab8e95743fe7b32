//! Pictures that are made here, and their files.
//!
//! Method: a plain raster of one value a pixel. Its file is a PNG, or a JPEG where a page has many
//! photographs; radiance is an OpenEXR file. Cost: the pixels, and the file in memory. Limits: 8 bits a
//! sample, but for greys of 16 bits.

use std::io::{self, Cursor};

use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage as _};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _};

/// A raster of one value a pixel, rows from the top: `u8` for a grey, `[u8; 3]` for sRGB.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pixels<P> {
    size: (u32, u32),
    pixels: Vec<P>,
}

impl<P: Copy> Pixels<P> {
    /// A raster of the values that `value` has at each x and y.
    pub fn from_fn(width: u32, height: u32, mut value: impl FnMut(u32, u32) -> P) -> Pixels<P> {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            pixels.extend((0..width).map(|x| value(x, y)));
        }
        Pixels { size: (width, height), pixels }
    }

    /// A raster of one value.
    pub fn filled(width: u32, height: u32, value: P) -> Pixels<P> {
        Pixels { size: (width, height), pixels: vec![value; width as usize * height as usize] }
    }

    /// Pixels across and down.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// A value.
    ///
    /// # Panics
    /// Outside of the raster.
    pub fn at(&self, x: u32, y: u32) -> P {
        assert!(x < self.size.0, "pixel {x} of {}", self.size.0);
        self.pixels[y as usize * self.size.0 as usize + x as usize]
    }

    /// A value to change; none outside of the raster.
    pub fn at_mut(&mut self, x: u32, y: u32) -> Option<&mut P> {
        if x >= self.size.0 {
            return None;
        }
        self.pixels.get_mut(y as usize * self.size.0 as usize + x as usize)
    }

    /// All values, row by row.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }
}

impl Pixels<[u8; 3]> {
    /// The bytes of a PNG.
    ///
    /// # Errors
    /// A raster without pixels.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        png(self.pixels.as_flattened(), self.size, Pixel::Rgb)
    }

    /// The bytes of a JPEG; `quality` is 1 to 100.
    ///
    /// # Errors
    /// A raster without pixels, or with more than the format allows.
    pub fn jpeg(&self, quality: u8) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let (width, height) = self.size;
        JpegEncoder::new_with_quality(&mut bytes, quality)
            .encode(self.pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
            .map_err(io::Error::other)?;
        Ok(bytes)
    }
}

impl Pixels<u8> {
    /// The bytes of a PNG.
    ///
    /// # Errors
    /// A raster without pixels.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        png(&self.pixels, self.size, Pixel::Grey)
    }
}

/// What the samples of a PNG are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Pixel {
    /// A byte a pixel.
    Grey,
    /// Two bytes a pixel, in the order of this computer's bytes.
    Grey16,
    /// Red, green and blue, a byte each.
    Rgb,
}

/// A picture as the bytes of a PNG.
///
/// # Errors
/// A picture without pixels, or a number of samples that differs from its size.
pub fn png(samples: &[u8], size: (u32, u32), kind: Pixel) -> io::Result<Vec<u8>> {
    let (colour, each) = match kind {
        Pixel::Grey => (ExtendedColorType::L8, 1),
        Pixel::Grey16 => (ExtendedColorType::L16, 2),
        Pixel::Rgb => (ExtendedColorType::Rgb8, 3),
    };
    if u64::from(size.0) * u64::from(size.1) * each != samples.len() as u64 {
        return Err(io::Error::other(format!("{} bytes for {size:?} pixels of {each}", samples.len())));
    }
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(samples, size.0, size.1, colour).map_err(io::Error::other)?;
    Ok(bytes)
}

/// Linear colours with opacity, which they are multiplied by, as the bytes of an OpenEXR file.
///
/// # Errors
/// A picture without pixels, or a number of pixels that differs from its size.
pub fn open_exr(pixels: &[[f32; 4]], (width, height): (usize, usize)) -> io::Result<Vec<u8>> {
    if width * height != pixels.len() {
        return Err(io::Error::other(format!("{} pixels for {width} x {height}", pixels.len())));
    }
    let mut bytes = Cursor::new(Vec::new());
    let pixel = |at: Vec2<usize>| pixels[at.y() * width + at.x()].into();
    let channels = SpecificChannels::rgba(|at| -> (f32, f32, f32, f32) { pixel(at) });
    Image::from_channels((width, height), channels)
        .write()
        .to_buffered(&mut bytes)
        .map_err(io::Error::other)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_by_the_library() {
        let colours = Pixels::from_fn(3, 2, |x, y| [x as u8, y as u8, 9]);
        let read = image::load_from_memory(&colours.png().unwrap()).unwrap().into_rgb8();
        assert_eq!((read.dimensions(), read.get_pixel(2, 1).0), ((3, 2), colours.at(2, 1)));
        let greys = Pixels::from_fn(3, 2, |x, y| (10 * y + x) as u8);
        let read = image::load_from_memory(&greys.png().unwrap()).unwrap();
        assert_eq!(
            read,
            image::DynamicImage::ImageLuma8(
                image::GrayImage::from_raw(3, 2, vec![0, 1, 2, 10, 11, 12]).unwrap()
            )
        );
        let flat = Pixels::filled(8, 8, [200, 100, 50]);
        let read = image::load_from_memory(&flat.jpeg(90).unwrap()).unwrap().into_rgb8();
        assert!(read.pixels().all(|p| p.0.iter().zip([200, 100, 50]).all(|(&a, b)| a.abs_diff(b) < 4)));
    }

    #[test]
    fn radiance_comes_back() {
        let pixels = [[0.25, 1.5, 1e5, 1.0], [0.0, 0.5, -1.0, 0.5]];
        let bytes = open_exr(&pixels, (2, 1)).unwrap();
        let read = crate::exr::exr(&bytes).unwrap();
        assert_eq!((read.channels, &read.values[..]), (4, pixels.as_flattened()));
        assert!(open_exr(&pixels, (3, 1)).is_err());
    }

    #[test]
    fn what_lies_outside_is_nothing_and_what_has_no_pixels_no_file() {
        let mut raster = Pixels::filled(2, 2, 7u8);
        assert!(raster.at_mut(2, 0).is_none() && raster.at_mut(0, 2).is_none());
        *raster.at_mut(1, 0).unwrap() = 9;
        assert_eq!((raster.at(1, 0), raster.at(0, 1)), (9, 7));
        assert!(Pixels::filled(0, 2, 7u8).png().is_err());
        assert!(png(&[0; 5], (2, 3), Pixel::Grey).is_err());
    }
}
