//! CMYK JPEG: four plates.
//!
//! Problem: a CMYK picture states how much of four inks to print, not what colour results. Its profile, if it has one,
//! describes another printer's inks.
//! Method: each plate becomes a layer of its ink and keeps its tones, as in a separated TIFF. Adobe stores inverted values, where
//! 0 is full ink, and all programs that write such files do the same. YCCK is the same picture with cyan, magenta and yellow
//! as a luminance and two differences.
//! Cost: the file in memory, and five bytes a pixel. Limits: baseline and progressive files of 8 bits.
//! Source: Adobe technical note 5116, section 18; ITU-T T.871 for the transform.

use std::path::Path;

use observe::Diagnosis;
use protocol::ink::Ink;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::artwork::Artwork;
use super::coverage::{Coverage, Scan};
use super::decode::{jpeg_frame, whole_jpeg};
use super::error::{io, wrong};
use super::names::{self, stem};
use super::options::Options;
use super::orientation::Turn;
use super::size::{self, MOST_BYTES, Unstated};
use readers::resolution::{self, Dpi};

/// The inks of the plates, in the order of the channels.
pub(super) const PLATES: [Ink; 4] = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black];

/// Reads a JPEG with four channels; `None` if it has another number of channels.
pub(super) fn read_jpeg(path: &Path, options: &Options) -> Result<Option<Artwork>, Diagnosis> {
    let read = io(path, "read it");
    if std::fs::metadata(path).map_err(&read)?.len() > MOST_BYTES {
        return Err(wrong(path, "the file is larger than a gigabyte"));
    }
    let bytes = std::fs::read(path).map_err(&read)?;
    let Some((4, height, width)) = jpeg_frame(&bytes) else { return Ok(None) };
    let (width, height) = (u32::from(width), u32::from(height));
    size::check_pixels(path, width, height)?;
    whole_jpeg(path, &bytes)?;
    if options.reserves() {
        return Err(
            wrong(path, "the picture is CMYK, but reserved colours are sRGB").hint("convert it to sRGB")
        );
    }
    let bad = |error| wrong(path, format!("cannot decode the picture: {error}"));
    // The limits of the format: the size was checked above.
    let usual = DecoderOptions::default().set_max_width(1 << 16).set_max_height(1 << 16);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes[..]), usual);
    decoder.decode_headers().map_err(bad)?;
    let stored = match decoder.input_colorspace() {
        Some(space @ (ColorSpace::CMYK | ColorSpace::YCCK)) => space,
        // A later segment may call the four channels three, which the decoder cannot handle.
        _ => return Err(wrong(path, "it has four channels that are neither CMYK nor YCCK")),
    };
    let luminance = stored == ColorSpace::YCCK;
    decoder.set_options(usual.jpeg_set_out_colorspace(stored));
    let pixels = decoder.decode().map_err(bad)?;
    let profile = decoder.icc_profile().is_some();
    let turn = Turn::of_exif(decoder.exif().map(Vec::as_slice));
    let (pixels, rest) = pixels.as_chunks::<4>();
    if pixels.len() != width as usize * height as usize || !rest.is_empty() {
        return Err(wrong(path, "its number of pixels differs from that in its header"));
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
    let plate = |plate: usize| pixels.iter().map(|pixel| inks(pixel)[plate]).collect();
    let plates = (0..4).map(|number| turn.plane(plate(number), (width, height))).collect();
    let dpi = turn.dpi(resolution::of_file(&bytes, image::ImageFormat::Jpeg));
    artwork(path, turn.size((width, height)), dpi, plates, profile, options).map(Some)
}

/// Red, green and blue of a luminance and two differences.
fn rgb_of(y: u8, cb: u8, cr: u8) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    // Casts of floats saturate.
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|v| v.round() as u8)
}

/// Art of four plates: one byte a pixel, 255 full ink.
fn artwork(
    path: &Path,
    (width, height): (u32, u32),
    dpi: Option<Dpi>,
    plates: Vec<Vec<u8>>,
    profile: bool,
    options: &Options,
) -> Result<Artwork, Diagnosis> {
    let mut notes = vec![note(path, profile)];
    let sides = (f64::from(width), f64::from(height));
    let dots = size::dots(path, sides, dpi, Unstated::FillRoom, options, &mut notes)?;
    let mut art = Artwork::blank(&stem(path), dots);
    art.notes = notes;
    for (ink, coverage) in PLATES.into_iter().zip(plates) {
        let scan = Scan { path: path.to_path_buf(), width, height, dpi, coverage, by: Coverage::Dark };
        art.add(scan, &plate_of(ink), names::Named { place: None, ink }, true, options);
    }
    Ok(art)
}

/// The name of a plate.
pub(super) fn plate_of(ink: Ink) -> String {
    format!("the {} plate", ink.name())
}

/// A note on a CMYK picture.
pub(super) fn note(path: &Path, profile: bool) -> String {
    format!(
        "{}: CMYK, so its four plates are printed unchanged in cyan, magenta, yellow and black{}; convert it to sRGB to \
         match its colours to these inks",
        path.display(),
        if profile { ", without its colour profile, which describes other inks" } else { "" }
    )
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::*;
    use proptest::prelude::*;

    /// 16 x 8 pixels written by libjpeg (through Pillow): the left half 200, 0, 40, 20 of 255 in cyan, magenta, yellow and
    /// black; the right half is bare.
    const CMYK: &[u8] = include_bytes!("cmyk.jpg");

    fn planes(bytes: &[u8]) -> Vec<Vec<u8>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        std::fs::write(&path, bytes).unwrap();
        let options = Options { dpi: Some(600.0), ..Options::default() };
        let art = read_jpeg(&path, &options).unwrap().unwrap();
        let plane =
            |ink: Ink| match art.layers.iter().find(|layer| layer.ink == ink).map(|layer| &layer.shape) {
                Some(Shape::Tone(tones)) => tones.clone(),
                Some(Shape::Solid(plane)) => {
                    (0..128).map(|at| 255 * (plane.bits[at / 8] >> (7 - at % 8) & 1)).collect()
                }
                None => vec![0; 128],
            };
        PLATES.map(plane).to_vec()
    }

    fn near(planes: &[Vec<u8>], wanted: [u8; 4], tolerance: u8) {
        for (plane, wanted) in planes.iter().zip(wanted) {
            assert_eq!(plane.len(), 128);
            for (at, &tone) in plane.iter().enumerate() {
                let wanted = if at % 16 < 8 { wanted } else { 0 };
                // Tones this near to zero count as zero.
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
        // By T.871: 55 + 1.402 x 87 = 177, 55 - 0.344 x 127 - 0.714 x 87 < 0, 55 + 1.772 x 127 > 255. The right half, all
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
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("photo.jpg");
            std::fs::write(&path, &bytes).unwrap();
            // One dot for each pixel: a full page would take long.
            let options = Options { dpi: Some(600.0), ..Options::default() };
            if let Err(error) = read_jpeg(&path, &options) {
                // A size error names the page; any other error names the file.
                let size = error.fault() == observe::Fault::Setting;
                prop_assert!(size || error.to_string().contains("photo.jpg"), "{}", error);
            }
        }
    }
}
