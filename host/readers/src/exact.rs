//! PNG files that are data: dots of a sheet, bits of a pass, weights.
//!
//! Problem: they must come back bit by bit.
//! Method: nothing is converted on the way. A file with another size, depth or kind than expected is refused,
//! before anything is decoded. Cost: the file is written fast rather than small. Limits: grey of one or 16
//! bits, one or eight bits of a palette.

use std::io::{self, BufRead, Seek, Write};

use png::{BitDepth, ColorType, Transformations};

/// What a picture must be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Exact<'a> {
    /// One bit a dot, rows padded to bytes, 0 black.
    Bits,
    /// One bit a dot, rows padded to bytes, in two colours.
    Two(&'a [[u8; 3]; 2]),
    /// One byte a dot, with as many colours as there are stacks.
    Indexed(&'a [[u8; 3]]),
    /// Two bytes a dot, the higher first.
    Deep,
}

impl<'a> Exact<'a> {
    fn png(self) -> (ColorType, BitDepth) {
        match self {
            Exact::Bits => (ColorType::Grayscale, BitDepth::One),
            Exact::Two(_) => (ColorType::Indexed, BitDepth::One),
            Exact::Indexed(_) => (ColorType::Indexed, BitDepth::Eight),
            Exact::Deep => (ColorType::Grayscale, BitDepth::Sixteen),
        }
    }

    fn colours(self) -> &'a [[u8; 3]] {
        match self {
            Exact::Bits | Exact::Deep => &[],
            Exact::Two(colours) => colours,
            Exact::Indexed(colours) => colours,
        }
    }

    /// The bytes of a picture.
    fn bytes(self, width: usize, height: usize) -> usize {
        match self {
            Exact::Bits | Exact::Two(_) => width.div_ceil(8) * height,
            Exact::Indexed(_) => width * height,
            Exact::Deep => 2 * width * height,
        }
    }
}

/// What every picture with a resolution says of the program that wrote it.
pub const SIGNATURE: (&str, &str) = ("Software", "Foilpress");

/// Writes a picture, with so many pixels per inch across and down.
///
/// # Errors
/// Those of `out`, and a number of bytes that differs from the size.
pub fn write(
    out: impl Write,
    (width, height): (usize, usize),
    dpi: Option<(u16, u16)>,
    kind: Exact,
    data: &[u8],
) -> io::Result<()> {
    let side = |side: usize| u32::try_from(side).map_err(|_| io::Error::other("too large for a PNG"));
    let mut encoder = png::Encoder::new(out, side(width)?, side(height)?);
    let (colour, depth) = kind.png();
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    if let Some(dpi) = dpi {
        let per_metre = |dpi: u16| (f64::from(dpi) / 0.0254).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: per_metre(dpi.0),
            yppu: per_metre(dpi.1),
            unit: png::Unit::Meter,
        }));
        encoder.add_text_chunk(SIGNATURE.0.into(), SIGNATURE.1.into())?;
    }
    if colour == ColorType::Indexed {
        encoder.set_palette(kind.colours().concat());
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(())
}

/// Why a picture is not what it must be.
#[derive(Debug, thiserror::Error)]
pub enum Inexact {
    /// It is no PNG, or damaged.
    #[error("the picture is damaged")]
    Damaged(#[from] io::Error),
    /// It has another size or kind.
    #[error("expected {expected}, found {found}")]
    Other {
        /// Size and kind expected.
        expected: String,
        /// Size and kind found.
        found: String,
    },
}

/// Reads a picture that must be of this size and kind; for an indexed one the colours may differ, not their
/// number.
///
/// # Errors
/// Another picture, or a damaged one.
pub fn read(
    file: impl BufRead + Seek,
    (width, height): (usize, usize),
    kind: Exact,
) -> Result<Vec<u8>, Inexact> {
    // What decoding takes beside the pixels, for small pictures, too.
    let bytes = 2 * kind.bytes(width.max(64), height.max(64)).max(width * height) + (1 << 20);
    let mut decoder = png::Decoder::new_with_limits(file, png::Limits { bytes });
    decoder.set_transformations(Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(io::Error::from)?;
    let info = reader.info();
    let colours = info.palette.as_ref().map_or(0, |palette| palette.len() / 3);
    let describe = |width: usize, height: usize, colour, depth, colours: usize| match colour {
        ColorType::Indexed => format!("{width} x {height} dots, {depth:?} bits indexed, {colours} colours"),
        _ => format!("{width} x {height} dots, {depth:?} bits {colour:?}"),
    };
    let (colour, depth) = kind.png();
    let found = describe(info.width as usize, info.height as usize, info.color_type, info.bit_depth, colours);
    let expected = describe(width, height, colour, depth, kind.colours().len());
    if found != expected || info.animation_control.is_some() {
        return Err(Inexact::Other { expected, found });
    }
    let mut data = vec![0; kind.bytes(width, height)];
    reader.next_frame(&mut data).map_err(io::Error::from)?;
    // Only this verifies the checksum of the last chunk.
    reader.finish().map_err(io::Error::from)?;
    Ok(data)
}
