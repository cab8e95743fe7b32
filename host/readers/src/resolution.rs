//! The resolution that a picture's file states.
//!
//! Method: PNG and BMP state pixels per metre; the JFIF and EXIF segments of a JPEG and the tags of a TIFF state pixels per inch or
//! per centimetre. Of the two segments JFIF comes first; in EXIF, 72 dpi means that the resolution is unknown, by its
//! standard (CIPA DC-008). Limits: resolutions outside of [`RESOLUTIONS`] are ignored.

use std::io::Cursor;
use std::ops::RangeInclusive;

use ::tiff::decoder::{Decoder, Limits};
use ::tiff::tags::Tag;
use image::ImageFormat;

/// Pixels per inch, across and down.
pub type Dpi = (f64, f64);

/// The resolution in a file of this format.
pub fn of_file(bytes: &[u8], format: ImageFormat) -> Option<Dpi> {
    match format {
        ImageFormat::Png => {
            let decoder = png::Decoder::new(Cursor::new(bytes));
            decoder.read_info().ok()?.info().pixel_dims.and_then(of_png)
        }
        ImageFormat::Jpeg => of_jfif(bytes).filter(plausible).or_else(|| of_exif(bytes)),
        ImageFormat::Tiff => of_tiff(&mut tiff_decoder(bytes)?),
        ImageFormat::Bmp => of_bmp(bytes),
        _ => None,
    }
    .filter(plausible)
}

/// The resolution in the header of a PNG.
pub fn of_png(dims: png::PixelDimensions) -> Option<Dpi> {
    let inch = |per_metre: u32| f64::from(per_metre) * 0.0254;
    (dims.unit == png::Unit::Meter).then(|| (inch(dims.xppu), inch(dims.yppu))).filter(plausible)
}

/// The resolution in the header of a BMP, unless that is the old one of OS/2.
fn of_bmp(bytes: &[u8]) -> Option<Dpi> {
    let number = |at: usize| bytes.get(at..)?.first_chunk().map(|four| u32::from_le_bytes(*four));
    let inch = |at: usize| Some(f64::from(number(at)?) * 0.0254);
    if number(14)? < 40 { None } else { Some((inch(38)?, inch(42)?)) }
}

/// Resolutions of pictures, in pixels per inch: programs that mean none leave 1 and the like.
pub const RESOLUTIONS: RangeInclusive<f64> = 5.0..=10_000.0;

fn plausible(dpi: &Dpi) -> bool {
    RESOLUTIONS.contains(&dpi.0) && RESOLUTIONS.contains(&dpi.1)
}

/// The resolution in the JFIF segment, which follows the start of the file if there is one.
fn of_jfif(bytes: &[u8]) -> Option<Dpi> {
    let segment = bytes.strip_prefix(b"\xff\xd8\xff\xe0")?.get(2..14)?.strip_prefix(b"JFIF\0")?;
    let number = |at: usize| f64::from(u16::from_be_bytes([segment[at], segment[at + 1]]));
    let inch = match segment[2] {
        1 => 1.0,
        2 => 2.54,
        _ => return None,
    };
    Some((number(3) * inch, number(5) * inch))
}

/// The resolution in the EXIF segment of a JPEG.
fn of_exif(bytes: &[u8]) -> Option<Dpi> {
    let exif = exif::Reader::new().read_from_container(&mut Cursor::new(bytes)).ok()?;
    let field = |tag| Some(&exif.get_field(tag, exif::In::PRIMARY)?.value);
    let inch = match field(exif::Tag::ResolutionUnit).and_then(|unit| unit.get_uint(0)) {
        None | Some(2) => 1.0,
        Some(3) => 2.54,
        Some(_) => return None,
    };
    let along = |tag| match field(tag)? {
        exif::Value::Rational(ratios) => Some(ratios.first()?.to_f64() * inch),
        _ => None,
    };
    let dpi = (along(exif::Tag::XResolution)?, along(exif::Tag::YResolution)?);
    (dpi != (72.0, 72.0)).then_some(dpi)
}

/// A TIFF decoder over bytes in memory.
pub type TiffDecoder<'a> = Decoder<Cursor<&'a [u8]>>;

/// A TIFF decoder with limits; `None` if the header is damaged.
pub fn tiff_decoder(bytes: &[u8]) -> Option<TiffDecoder<'_>> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 1 << 30;
    limits.intermediate_buffer_size = 1 << 30;
    Some(Decoder::new(Cursor::new(bytes)).ok()?.with_limits(limits))
}

/// The resolution in the tags of a TIFF's first image.
pub fn of_tiff(decoder: &mut TiffDecoder<'_>) -> Option<Dpi> {
    let inch = match decoder.find_tag_unsigned::<u16>(Tag::ResolutionUnit).ok()? {
        None | Some(2) => 1.0,
        Some(3) => 2.54,
        Some(_) => return None,
    };
    let mut along = |tag| {
        let ratio = decoder.get_tag(tag).ok()?.into_u64_vec().ok()?;
        let &[numerator, denominator] = ratio.as_slice() else { return None };
        Some(numerator as f64 / denominator as f64 * inch)
    };
    Some((along(Tag::XResolution)?, along(Tag::YResolution)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dpi_of(bytes: &[u8]) -> Option<Dpi> {
        of_file(bytes, image::guess_format(bytes).ok()?)
    }

    #[test]
    fn each_format_states_it_in_its_own_way() {
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 1, 1);
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: 23_622,
            yppu: 23_622,
            unit: png::Unit::Meter,
        }));
        encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
        let found = dpi_of(&png).unwrap();
        assert!((found.0 - 600.0).abs() < 0.02 && found.0 == found.1, "{found:?}");
        let jpeg = [&[0xff, 0xd8, 0xff, 0xe0, 0, 16][..], b"JFIF\0", &[1, 1, 1, 1, 44, 2, 88, 0, 0]].concat();
        assert_eq!(dpi_of(&jpeg), Some((300.0, 600.0)));
        let mut tiff = Cursor::new(Vec::new());
        let mut encoder = ::tiff::encoder::TiffEncoder::new(&mut tiff).unwrap();
        let mut picture = encoder.new_image::<::tiff::encoder::colortype::Gray8>(1, 1).unwrap();
        let fraction = |n| ::tiff::encoder::Rational { n, d: 10 };
        picture.x_resolution(fraction(2362));
        picture.y_resolution(fraction(1181));
        picture.resolution_unit(::tiff::tags::ResolutionUnit::Centimeter);
        picture.write_data(&[0]).unwrap();
        let found = dpi_of(tiff.get_ref()).unwrap();
        assert!((found.0 - 599.95).abs() < 0.01 && (found.1 - 299.97).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn what_is_damaged_or_silent_states_nothing() {
        for bytes in [
            &b""[..],
            b"\x89PNG\r\n\x1a\n\xff\xff\xff\xffabcd",
            b"\x89PNG\r\n\x1a\n\0\0\0\x09pHYs\0",
            &[0xff, 0xd8, 0xff, 0xe0, 0, 16, b'J'],
            b"II*\0\xff\xff\xff\xff",
        ] {
            assert_eq!(dpi_of(bytes), None, "{bytes:?}");
        }
    }
}
