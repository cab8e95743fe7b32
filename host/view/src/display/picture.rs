//! A plain picture as an image for the display: its colours as matte materials.

use std::path::Path;

use appearance::brdf::Space;
use appearance::materials::Materials;
use appearance::srgb::decode;
use readers::{Bounds, Fault, Format};

use super::DisplayError;

/// The longest side of a picture in pixels.
const LONGEST: u32 = 16_384;

/// What decoding it may use.
const BOUNDS: Bounds = Bounds { side: Some(LONGEST), bytes: 1 << 30 };

/// Whether a file is a plain picture by its name.
pub fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    path.is_file() && ["png", "jpg", "jpeg", "tif", "tiff"].contains(&ending.as_str())
}

/// sRGB colours of matte surfaces. Transparent pixels are seen on black: nothing is shown there.
pub struct Matte {
    width: usize,
    height: usize,
    space: Space,
    /// Reflectance in 1/sr.
    rgb: Vec<[f32; 3]>,
}

impl Matte {
    /// Reads a picture, tabulated in `space`.
    ///
    /// # Errors
    /// A file that is no picture, or a larger one than is read.
    pub fn read(path: &Path, space: Space) -> Result<Matte, DisplayError> {
        let bad = |problem: String| DisplayError::Picture(format!("{}: {problem}", path.display()));
        let bytes = std::fs::read(path).map_err(|error| bad(format!("cannot be read: {error}")))?;
        let decoded = || Format::of(&bytes, path)?.open(&bytes, BOUNDS)?.decode();
        let stored = decoded().map_err(|fault| match fault {
            Fault::Large(_) => {
                bad(format!("the picture is too large; at most {LONGEST} pixels a side and 1 GB are read"))
            }
            fault => bad(format!("expected a PNG, JPEG or TIFF picture: {fault}")),
        })?;
        let (width, height, channels) = (stored.width, stored.height, stored.channels);
        let shade: Vec<f32> =
            (0..=255u8).map(|v| decode(f32::from(v) / 255.0) * std::f32::consts::FRAC_1_PI).collect();
        let colour = |pixel: &[u8]| {
            let alpha = if channels.is_multiple_of(2) { pixel[channels - 1] } else { u8::MAX };
            let rgb = if channels < 3 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
            rgb.map(|v| shade[usize::from(v)] * f32::from(alpha) / 255.0)
        };
        let rgb = stored.samples.into_eight().chunks_exact(channels).map(colour).collect();
        Ok(Matte { width, height, space, rgb })
    }
}

impl Materials for Matte {
    fn width(&self) -> usize {
        self.width
    }

    fn height(&self) -> usize {
        self.height
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        out.as_chunks_mut::<3>().0.fill(self.rgb[pixel]);
    }
}
