//! Floating-point pictures in TIFF and BigTIFF.
//!
//! Problem: the common decoder reads floats of 32 bits in RGB only, but measured maps are grey, or have halves.
//! Method: the samples are read as they are stored, of 16, 32 or 64 bits, in strips, tiles or planes, and become 32-bit floats.
//! Cost: the picture twice while it is decoded. Limits: grey or RGB, with or without alpha; the first page.

use ::tiff::ColorType;
use ::tiff::decoder::DecodingResult;
use ::tiff::tags::Tag;

use image::metadata::Orientation;

use crate::exr::Floats;
use crate::fault::Fault;
use crate::resolution::{TiffDecoder, tiff_decoder};

fn damaged(error: ::tiff::TiffError) -> Fault {
    Fault::Damaged(error.to_string())
}

/// A TIFF with samples in floating point, whose header was read.
pub(crate) struct FloatTiff<'a> {
    decoder: TiffDecoder<'a>,
    size: (u32, u32),
    channels: usize,
}

/// Reads the header of a TIFF; `None` if its samples are whole numbers, or if the header is damaged.
///
/// # Errors
/// A kind of pixels that is not decoded.
pub(crate) fn float_tiff(bytes: &[u8]) -> Result<Option<FloatTiff<'_>>, Fault> {
    const FLOAT: u16 = 3;
    let Some(mut decoder) = tiff_decoder(bytes) else { return Ok(None) };
    match decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat) {
        Ok(Some(formats)) if formats.first() == Some(&FLOAT) => {}
        _ => return Ok(None),
    }
    let (size, colour) = match (decoder.dimensions(), decoder.colortype()) {
        (Ok(size), Ok(colour)) => (size, colour),
        (Err(error), _) | (_, Err(error)) => return Err(damaged(error)),
    };
    let channels = match colour {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        other => {
            return Err(Fault::Kind(format!(
                "floating-point pixels of type {other:?} are not supported; save it as RGB or grey"
            )));
        }
    };
    Ok(Some(FloatTiff { decoder, size, channels }))
}

impl FloatTiff<'_> {
    /// Pixels across and down.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Values of a pixel, 1 to 4: grey or RGB, then alpha.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// How to turn it before it is shown, as its tag states.
    pub fn turn(&mut self) -> Orientation {
        let stated = self.decoder.find_tag_unsigned::<u8>(Tag::Orientation).ok().flatten();
        stated.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms)
    }

    /// Its pixels; the size is the caller's to check.
    ///
    /// # Errors
    /// A damaged file, or samples of another depth.
    pub fn decode(mut self) -> Result<Floats, Fault> {
        let mut decoded = DecodingResult::F32(Vec::new());
        self.decoder.read_image_to_buffer(&mut decoded).map_err(damaged)?;
        let mut values: Vec<f32> = match decoded {
            DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
            DecodingResult::F32(values) => values,
            DecodingResult::F64(values) => values.into_iter().map(|v| v as f32).collect(),
            _ => {
                let problem = "its samples have neither 16, 32 nor 64 bits; save it with 32 bits";
                return Err(Fault::Kind(problem.into()));
            }
        };
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let (pixels, channels) = (width * height, self.channels);
        if values.len() != pixels * channels {
            let stated = pixels * channels;
            return Err(Fault::Damaged(format!(
                "it has {} values; its header states {stated}",
                values.len()
            )));
        }
        const PLANES: u16 = 2;
        let layout = self.decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(damaged)?;
        if layout == Some(PLANES) && channels > 1 {
            let planes = values;
            values = (0..pixels * channels).map(|i| planes[i % channels * pixels + i / channels]).collect();
        }
        Ok(Floats { width, height, channels, values, primaries: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::tiff::encoder::{TiffEncoder, colortype};

    fn tags(bits: u16, samples: u16, planar: u16, photometric: u16, body: &[u8]) -> Vec<u8> {
        let mut file = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let mut directory = encoder.image_directory().unwrap();
        let each = |value: u16| vec![value; usize::from(samples)];
        let planes = if planar == 2 { usize::from(samples) } else { 1 };
        let offsets: Vec<u32> =
            body.chunks(body.len() / planes).map(|part| directory.write_data(part).unwrap() as u32).collect();
        let counts = vec![(body.len() / planes) as u32; planes];
        let mut write = |tag: Tag, value: &[u16]| directory.write_tag(tag, value).unwrap();
        write(Tag::BitsPerSample, &each(bits));
        write(Tag::SampleFormat, &each(3));
        write(Tag::SamplesPerPixel, &[samples]);
        write(Tag::PlanarConfiguration, &[planar]);
        write(Tag::PhotometricInterpretation, &[photometric]);
        write(Tag::ImageWidth, &[2]);
        write(Tag::ImageLength, &[1]);
        write(Tag::RowsPerStrip, &[1]);
        write(Tag::Compression, &[1]);
        directory.write_tag(Tag::StripOffsets, &offsets[..]).unwrap();
        directory.write_tag(Tag::StripByteCounts, &counts[..]).unwrap();
        directory.finish().unwrap();
        file.into_inner()
    }

    fn read(bytes: &[u8]) -> Floats {
        float_tiff(bytes).unwrap().unwrap().decode().unwrap()
    }

    #[test]
    fn halves_floats_and_doubles_are_the_same_numbers() {
        // 0.25 and 1.5 in each width, by hand.
        let half = [0x3400u16, 0x3e00].iter().flat_map(|v| v.to_ne_bytes()).collect::<Vec<u8>>();
        let single = [0.25f32, 1.5].iter().flat_map(|v| v.to_ne_bytes()).collect::<Vec<u8>>();
        let double = [0.25f64, 1.5].iter().flat_map(|v| v.to_ne_bytes()).collect::<Vec<u8>>();
        for (bits, body) in [(16, half), (32, single), (64, double)] {
            let found = read(&tags(bits, 1, 1, 1, &body));
            assert_eq!((found.width, found.height, found.channels), (2, 1, 1));
            assert_eq!(found.values, [0.25, 1.5], "{bits} bits");
        }
    }

    #[test]
    fn planes_are_interleaved() {
        let values = [1.0f32, 2.0, 10.0, 20.0, 100.0, 200.0];
        let body: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
        assert_eq!(read(&tags(32, 3, 2, 2, &body)).values, [1.0, 10.0, 100.0, 2.0, 20.0, 200.0]);
        assert_eq!(read(&tags(32, 3, 1, 2, &body)).values, values);
    }

    #[test]
    fn the_64_bit_format_is_read_and_whole_numbers_are_left_to_others() {
        let mut file = std::io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new_big(&mut file).unwrap();
        encoder.write_image::<colortype::Gray32Float>(2, 1, &[0.5, 0.75]).unwrap();
        let bytes = file.into_inner();
        assert_eq!(crate::format(&bytes, std::path::Path::new("a")), Some(image::ImageFormat::Tiff));
        assert_eq!(read(&bytes).values, [0.5, 0.75]);
        let mut file = std::io::Cursor::new(Vec::new());
        TiffEncoder::new(&mut file).unwrap().write_image::<colortype::Gray8>(1, 1, &[7]).unwrap();
        assert!(float_tiff(file.get_ref()).unwrap().is_none());
        assert!(float_tiff(b"II*\0\xff").unwrap().is_none());
    }
}
