//! CMYK JPEG: four plates.
//!
//! Problem: a CMYK picture says how much of four inks to print, not what it looks like; a profile, if there is one, tells that of
//! another printer's inks.
//! Method: its plates are taken as what they are called, layers of cyan, magenta, yellow and black with their tones, as those of
//! a separated TIFF are. Adobe stores ink upside down, 0 is full ink, and every program that writes such files follows; what
//! it calls YCCK is the same with cyan, magenta and yellow as a luminance and two differences.
//! Cost: the file in memory, and five bytes a pixel. Limits: baseline and progressive files of 8 bits.
//! Source: Adobe technical note 5116, section 18; ITU-T T.871 for the transform.

use std::path::Path;

use protocol::ink::Ink;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::raster::{self, Coverage, Density, Scan, Unstated, wrong};
use super::{Artwork, LayersError, Options, names};

/// The inks of the plates, in the order of the channels.
pub(super) const PLATES: [Ink; 4] = [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black];

/// The art of a JPEG with four channels; nothing if it has others.
pub(super) fn jpeg(path: &Path, options: &Options) -> Result<Option<Artwork>, LayersError> {
    let read = raster::io(path, "read it");
    if std::fs::metadata(path).map_err(&read)?.len() > raster::MOST_BYTES {
        return Err(wrong(path, "the file is larger than a gigabyte"));
    }
    let bytes = std::fs::read(path).map_err(&read)?;
    let Some((4, height, width)) = raster::jpeg_frame(&bytes) else { return Ok(None) };
    let (width, height) = (u32::from(width), u32::from(height));
    raster::check_size(path, width, height)?;
    if options.reserved {
        return Err(wrong(path, "the picture is CMYK; reserved colours are sRGB, so convert it to sRGB"));
    }
    let bad = |error| wrong(path, format!("cannot decode the picture: {error}"));
    // The limits of the format, so that the check above is the one that speaks.
    let usual = DecoderOptions::default().set_max_width(1 << 16).set_max_height(1 << 16);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes[..]), usual);
    decoder.decode_headers().map_err(bad)?;
    let stored = match decoder.input_colorspace() {
        Some(space @ (ColorSpace::CMYK | ColorSpace::YCCK)) => space,
        // Four channels that a later segment calls three: the decoder would not know what to do with them.
        _ => return Err(wrong(path, "it has four channels and calls them something else than CMYK or YCCK")),
    };
    let luminance = stored == ColorSpace::YCCK;
    decoder.set_options(usual.jpeg_set_out_colorspace(stored));
    let pixels = decoder.decode().map_err(bad)?;
    let profile = decoder.icc_profile().is_some();
    let (pixels, rest) = pixels.as_chunks::<4>();
    if pixels.len() != width as usize * height as usize || !rest.is_empty() {
        return Err(wrong(path, "it holds another number of pixels than it says"));
    }
    let inks = |&[c, m, y, k]: &[u8; 4]| {
        if luminance {
            // Red, green and blue of the transform are 255 less cyan, magenta and yellow, which are upside down.
            let [red, green, blue] = rgb_of(c, m, y);
            [red, green, blue, 255 - k]
        } else {
            [c, m, y, k].map(|v| 255 - v)
        }
    };
    let plates = (0..4).map(|plate| pixels.iter().map(|pixel| inks(pixel)[plate]).collect()).collect();
    let density = raster::density(&bytes, image::ImageFormat::Jpeg);
    art(path, (width, height), density, plates, profile, options).map(Some)
}

/// Red, green and blue of a luminance and two differences.
fn rgb_of(y: u8, cb: u8, cr: u8) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    // Casts of floats saturate.
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|v| v.round() as u8)
}

/// Art of four plates, 255 full ink, a byte a pixel.
fn art(
    path: &Path,
    (width, height): (u32, u32),
    density: Option<Density>,
    plates: Vec<Vec<u8>>,
    profile: bool,
    options: &Options,
) -> Result<Artwork, LayersError> {
    let mut notes = vec![note(path, profile)];
    let sides = (f64::from(width), f64::from(height));
    let dots = raster::dots(path, sides, density, Unstated::Fills, options, &mut notes)?;
    let mut art = Artwork::blank(&super::stem(path), dots);
    art.notes = notes;
    for (ink, coverage) in PLATES.into_iter().zip(plates) {
        let scan = Scan { path: path.to_path_buf(), width, height, density, coverage, by: Coverage::Dark };
        art.add(scan, &plate_of(ink), names::Named { place: None, ink }, true, options);
    }
    Ok(art)
}

/// What to call a plate.
pub(super) fn plate_of(ink: Ink) -> String {
    format!("the {} plate", ink.name())
}

/// What to say of a CMYK picture.
pub(super) fn note(path: &Path, profile: bool) -> String {
    format!(
        "{}: CMYK, so its four plates are printed as they are in cyan, magenta, yellow and black{}; for colours matched to \
         these inks convert it to sRGB",
        path.display(),
        if profile { ", and its colour profile, which is of other inks, is not used" } else { "" }
    )
}

#[cfg(test)]
mod tests {
    use super::super::Shape;
    use super::*;
    use proptest::prelude::*;

    /// 16 x 8 pixels written by libjpeg (through Pillow): the left half 200, 0, 40, 20 of 255 in cyan, magenta, yellow and
    /// black, the right half bare.
    const CMYK: &[u8] = include_bytes!("cmyk.jpg");

    fn planes(bytes: &[u8]) -> Vec<Vec<u8>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        std::fs::write(&path, bytes).unwrap();
        let options = Options { dpi: Some(600.0), ..Options::default() };
        let art = jpeg(&path, &options).unwrap().unwrap();
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
                // Tones this near to none count as none.
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
        // The same numbers, called YCCK: luminance 55, differences 255 and 215, black upside down.
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
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn no_change_to_a_file_panics(changes in prop::collection::vec((2usize..CMYK.len(), any::<u8>()), 1..4), cut in 0usize..40) {
            let mut bytes = CMYK.to_vec();
            changes.iter().for_each(|&(at, value)| bytes[at] = value);
            bytes.truncate(bytes.len() - cut / 2);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("photo.jpg");
            std::fs::write(&path, &bytes).unwrap();
            // A pixel a dot: a page of them takes its time.
            let options = Options { dpi: Some(600.0), ..Options::default() };
            if let Err(error) = jpeg(&path, &options) {
                // Sizes are of the page, all else of the file.
                let size = matches!(error, LayersError::TooSmall { .. } | LayersError::TooLarge { .. });
                prop_assert!(size || error.to_string().contains("photo.jpg"), "{}", error);
            }
        }
    }
}
