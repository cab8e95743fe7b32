//! Pictures of exact dots: writing and strictly reading one-bit and indexed PNG.
//!
//! A picture that is data must come back bit by bit, so nothing is converted on the way: a file with another size,
//! depth or kind than expected is refused, before anything is decoded.

use std::io::BufReader;
use std::path::Path;

use files::{FileError, io, write};

/// What a picture must be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind<'a> {
    /// One bit a dot, rows padded to bytes, 0 black.
    Bits,
    /// One bit a dot, rows padded to bytes, in two colours.
    Two(&'a [[u8; 3]; 2]),
    /// One byte a dot, with as many colours as there are stacks.
    Indexed(&'a [[u8; 3]]),
}

impl<'a> Kind<'a> {
    fn png(self) -> (png::ColorType, png::BitDepth) {
        match self {
            Kind::Bits => (png::ColorType::Grayscale, png::BitDepth::One),
            Kind::Two(_) => (png::ColorType::Indexed, png::BitDepth::One),
            Kind::Indexed(_) => (png::ColorType::Indexed, png::BitDepth::Eight),
        }
    }

    fn colours(self) -> &'a [[u8; 3]] {
        match self {
            Kind::Bits => &[],
            Kind::Two(colours) => colours,
            Kind::Indexed(colours) => colours,
        }
    }
}

/// What every picture says of the program that wrote it.
pub const SIGNATURE: (&str, &str) = ("Software", "Foilpress");

/// Writes a picture with so many pixels per inch across and down.
pub fn write_png(
    path: &Path,
    (width, length): (usize, usize),
    dpi: (u16, u16),
    kind: Kind,
    data: &[u8],
) -> Result<(), FileError> {
    write(path, |out| {
        // Sides are u16 in every paper.
        let mut encoder = png::Encoder::new(out, width as u32, length as u32);
        let (colour, depth) = kind.png();
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::Fast);
        let per_metre = |dpi: u16| (f64::from(dpi) / 0.0254).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: per_metre(dpi.0),
            yppu: per_metre(dpi.1),
            unit: png::Unit::Meter,
        }));
        encoder.add_text_chunk(SIGNATURE.0.into(), SIGNATURE.1.into())?;
        if colour == png::ColorType::Indexed {
            encoder.set_palette(kind.colours().concat());
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(data)?;
        writer.finish()?;
        Ok(())
    })
}

/// Reads a picture that must be of this size and kind; for an indexed one the colours may differ, not their number.
pub fn read_png(path: &Path, (width, length): (usize, usize), kind: Kind) -> Result<Vec<u8>, FileError> {
    let file = std::fs::File::open(path).map_err(io(path, "open"))?;
    let bad = |source| FileError::Png { path: path.to_path_buf(), source };
    let bytes = width.max(64) * length.max(64);
    let mut decoder =
        png::Decoder::new_with_limits(BufReader::new(file), png::Limits { bytes: 2 * bytes + (1 << 20) });
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(bad)?;
    let info = reader.info();
    let colours = info.palette.as_ref().map_or(0, |palette| palette.len() / 3);
    let describe = |width: usize, length: usize, colour, depth, colours: usize| match colour {
        png::ColorType::Indexed => {
            format!("{width} x {length} dots, {depth:?} bits indexed, {colours} colours")
        }
        _ => format!("{width} x {length} dots, {depth:?} bits {colour:?}"),
    };
    let (colour, depth) = kind.png();
    let found = describe(info.width as usize, info.height as usize, info.color_type, info.bit_depth, colours);
    let expected = describe(width, length, colour, depth, kind.colours().len());
    if found != expected || info.animation_control.is_some() {
        return Err(FileError::Kind { path: path.to_path_buf(), expected, found });
    }
    let size = if depth == png::BitDepth::One { width.div_ceil(8) * length } else { width * length };
    let mut data = vec![0; size];
    reader.next_frame(&mut data).map_err(bad)?;
    reader.finish().map_err(bad)?;
    Ok(data)
}
