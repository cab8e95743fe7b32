//! A plain picture as an image for the display: its colours as matte materials.

use std::path::Path;

use appearance::brdf::Space;
use appearance::materials::Materials;
use appearance::srgb::decode;
use readers::Bounds;

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
        let decoded = || readers::open(&bytes, image::guess_format(&bytes)?, BOUNDS)?.decode();
        let image = decoded().map_err(|error| match error {
            image::ImageError::Limits(_) => {
                bad(format!("the picture is too large; at most {LONGEST} pixels a side and 1 GB are read"))
            }
            error => bad(format!("expected a PNG, JPEG or TIFF picture: {error}")),
        })?;
        let image = image.into_rgba8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        let shade: Vec<f32> =
            (0..=255u8).map(|v| decode(f32::from(v) / 255.0) * std::f32::consts::FRAC_1_PI).collect();
        let colour = |p: &image::Rgba<u8>| {
            let [r, g, b, a] = p.0;
            [r, g, b].map(|v| shade[usize::from(v)] * f32::from(a) / 255.0)
        };
        Ok(Matte { width, height, space, rgb: image.pixels().map(colour).collect() })
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
