//! The resolution that a picture's file states.
//!
//! Limits: cameras and programs that do not know it write 72 or 96, so whoever uses it has to check it.

use std::path::Path;

use pictures::resolution::of_file;

use crate::MeasureError;

/// Pixels per inch across and down as the file states them.
///
/// # Errors
/// A file that cannot be read.
pub fn dpi(path: &Path) -> Result<Option<[f64; 2]>, MeasureError> {
    let bytes =
        std::fs::read(path).map_err(|source| MeasureError::Io { path: path.to_path_buf(), source })?;
    let format = image::guess_format(&bytes).ok();
    Ok(format.and_then(|format| of_file(&bytes, format)).map(|(across, down)| [across, down]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dpi_of(name: &str, bytes: &[u8]) -> Option<[f64; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        dpi(&path).unwrap()
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
        let found = dpi_of("a.png", &png).unwrap();
        assert!(found.iter().all(|v| (v - 600.0).abs() < 0.02), "{found:?}");
        let jpeg = [&[0xff, 0xd8, 0xff, 0xe0, 0, 16][..], b"JFIF\0", &[1, 1, 1, 1, 44, 2, 88, 0, 0]].concat();
        assert_eq!(dpi_of("a.jpg", &jpeg), Some([300.0, 600.0]));
        // Little-endian TIFF: x and y as fractions, in dots per centimetre.
        let mut tiff = b"II*\0\x08\0\0\0\x05\0".to_vec();
        for (tag, kind, value) in [(256u16, 3u16, 1u32), (257, 3, 1), (282, 5, 74), (283, 5, 82), (296, 3, 3)]
        {
            tiff.extend(tag.to_le_bytes());
            tiff.extend(kind.to_le_bytes());
            tiff.extend(1u32.to_le_bytes());
            tiff.extend(value.to_le_bytes());
        }
        tiff.extend([0; 4]);
        [2362u32, 10, 1181, 10].iter().for_each(|v| tiff.extend(v.to_le_bytes()));
        let found = dpi_of("a.tif", &tiff).unwrap();
        assert!((found[0] - 599.95).abs() < 0.01 && (found[1] - 299.97).abs() < 0.01, "{found:?}");
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
            assert_eq!(dpi_of("a", bytes), None, "{bytes:?}");
        }
    }
}
