//! CMYK JPEG: four plates.
//!
//! Problem: a CMYK picture states how much of four inks to print, not what colour results. Its profile, if it
//! has one, describes another printer's inks.
//! Method: each plate becomes a plane. Adobe stores inverted values, where 0 is full ink, and all programs
//! that write such files do the same. YCCK is the same picture with cyan, magenta and yellow as a luminance
//! and two differences. Cost: the file in memory, and five bytes a pixel. Limits: baseline and progressive
//! files of 8 bits. Source: Adobe technical note 5116, section 18; ITU-T T.871 for the transform.

use std::path::Path;

use image::ImageFormat;
use observe::Diagnosis;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::jpeg;
use crate::picture::{Picture, Plane, PlaneKind, Process};
use crate::request::{Request, whole_jpeg};
use crate::resolution;
use crate::turn::Turn;

/// Reads a JPEG with four channels.
pub(crate) fn read(bytes: &[u8], name: &Path, request: &Request<'_>) -> Result<Picture, Diagnosis> {
    let wrong = |problem: String| Diagnosis::of_file(name, problem);
    let size = jpeg::size(bytes).ok_or_else(|| wrong("the file is damaged".into()))?;
    request.check(name, size)?;
    whole_jpeg(name, bytes)?;
    let bad = |error| wrong(format!("cannot decode the picture: {error}"));
    // The limits of the format: the size was checked above.
    let usual = DecoderOptions::default().set_max_width(1 << 16).set_max_height(1 << 16);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), usual);
    decoder.decode_headers().map_err(bad)?;
    let stored = match decoder.input_colorspace() {
        Some(space @ (ColorSpace::CMYK | ColorSpace::YCCK)) => space,
        // A later segment may call the four channels three, which the decoder cannot handle.
        _ => return Err(wrong("it has four channels that are neither CMYK nor YCCK".into())),
    };
    let luminance = stored == ColorSpace::YCCK;
    decoder.set_options(usual.jpeg_set_out_colorspace(stored));
    let pixels = decoder.decode().map_err(bad)?;
    let profile = decoder.icc_profile();
    let turn = Turn::of_exif(decoder.exif().map(Vec::as_slice));
    let (pixels, rest) = pixels.as_chunks::<4>();
    if pixels.len() != size.0 as usize * size.1 as usize || !rest.is_empty() {
        return Err(wrong("its number of pixels differs from that in its header".into()));
    }
    let inks = |&[c, m, y, k]: &[u8; 4]| {
        if luminance {
            // Red, green and blue of the transform are the inverted cyan, magenta and yellow: 255 minus them.
            let [red, green, blue] = rgb_of(c, m, y);
            [red, green, blue, 255 - k]
        } else {
            [c, m, y, k].map(|v| 255 - v)
        }
    };
    let plane = |(number, plate)| Plane {
        name: String::new(),
        kind: PlaneKind::Process(plate),
        samples: turn.plane(pixels.iter().map(|pixel| inks(pixel)[number]).collect(), size),
    };
    Ok(Picture {
        name: name.into(),
        size: turn.size(size),
        planes: Process::ALL.into_iter().enumerate().map(plane).collect(),
        colours: None,
        resolution: turn.dpi(resolution::of_file(bytes, ImageFormat::Jpeg)),
        profile,
        gamma: None,
        notes: Vec::new(),
    })
}

/// Red, green and blue of a luminance and two differences.
fn rgb_of(y: u8, cb: u8, cr: u8) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    // Casts of floats saturate.
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|v| v.round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 16 x 8 pixels written by libjpeg (through Pillow): the left half 200, 0, 40, 20 of 255 in cyan,
    /// magenta, yellow and black; the right half is bare.
    const CMYK: &[u8] = include_bytes!("cmyk.jpg");

    fn request<'a>() -> Request<'a> {
        Request {
            page: None,
            planes: Some(&|_| false),
            pixels: 1 << 20,
            finest: None,
            room: "a test",
            besides: "",
        }
    }

    fn planes(bytes: &[u8]) -> Vec<Vec<u8>> {
        let picture = crate::read(bytes.to_vec(), Path::new("photo.jpg"), &request()).unwrap();
        assert!(picture.colours.is_none());
        picture.planes.into_iter().map(|plane| plane.samples).collect()
    }

    fn near(planes: &[Vec<u8>], wanted: [u8; 4], tolerance: u8) {
        for (plane, wanted) in planes.iter().zip(wanted) {
            assert_eq!(plane.len(), 128);
            for (at, &tone) in plane.iter().enumerate() {
                let wanted = if at % 16 < 8 { wanted } else { 0 };
                assert!(tone.abs_diff(wanted) <= tolerance, "{at}: {tone}, not {wanted}");
            }
        }
    }

    #[test]
    fn plates_of_a_cmyk_jpeg_are_the_right_way_round() {
        near(&planes(CMYK), [200, 0, 40, 20], 3);
    }

    #[test]
    fn luminance_and_differences_become_the_inks_they_stand_for() {
        // The same numbers as YCCK: luminance 55, differences 255 and 215, black inverted.
        let at = CMYK.windows(5).position(|window| window == b"Adobe").unwrap() + 11;
        let mut ycck = CMYK.to_vec();
        assert_eq!(ycck[at], 0);
        ycck[at] = 2;
        // By T.871: 55 + 1.402 x 87 = 177, 55 - 0.344 x 127 - 0.714 x 87 < 0, 55 + 1.772 x 127 > 255. The
        // right half, all
        // 255, is 255 + 1.402 x 127 and more in red and blue, and 255 - 1.058 x 127 = 120.5 in green.
        let planes = planes(&ycck);
        for (plane, (left, right)) in planes.iter().zip([(177, 255), (0, 121), (255, 255), (20, 0)]) {
            for (at, &tone) in plane.iter().enumerate() {
                let wanted: u8 = if at % 16 < 8 { left } else { right };
                assert!(tone.abs_diff(wanted) <= 4, "{at}: {tone}, not {wanted}");
            }
        }
    }

    proptest! {
        #![proptest_config(testing::cases(200))]
        #[test]
        fn no_change_to_a_file_panics(changes in prop::collection::vec((2usize..CMYK.len(), any::<u8>()), 1..4), cut in 0usize..40) {
            let mut bytes = CMYK.to_vec();
            changes.iter().for_each(|&(at, value)| bytes[at] = value);
            bytes.truncate(bytes.len() - cut / 2);
            if let Err(error) = crate::read(bytes, Path::new("photo.jpg"), &request()) {
                prop_assert!(error.to_string().contains("photo.jpg"), "{}", error);
            }
        }
    }
}
