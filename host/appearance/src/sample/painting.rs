//! The maps of a sample, and the surfaces they define.

use readers::Pixel;

use crate::brdf::Space;
use crate::materials::{Surfaces, dielectric, metallic, specular};
use crate::srgb;

/// The maps of a painting besides its base colour, 0 to 255 for 0 to 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Finish {
    /// Roughness and metallic.
    Metallic {
        /// Roughness, linear.
        roughness: Vec<u8>,
        /// Metallic, linear.
        metallic: Vec<u8>,
    },
    /// Specular colour and glossiness.
    Specular {
        /// Reflectance at normal incidence, sRGB.
        f0: Vec<[u8; 3]>,
        /// Glossiness, linear.
        glossiness: Vec<u8>,
    },
}

/// The maps of a sample at 8 bits, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Painting {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Base or diffuse colour, sRGB.
    pub base: Vec<[u8; 3]>,
    /// The other maps.
    pub finish: Finish,
    /// Width and height on paper in tenths of a millimetre.
    pub size: (u16, u16),
}

impl Painting {
    /// The files of the painting: name, samples and their kind.
    pub fn maps(&self) -> Vec<(&'static str, Vec<u8>, Pixel)> {
        let (grey, rgb) = (Pixel::Grey, Pixel::Rgb);
        match &self.finish {
            Finish::Metallic { roughness, metallic } => vec![
                ("base_color.png", self.base.concat(), rgb),
                ("roughness.png", roughness.clone(), grey),
                ("metallic.png", metallic.clone(), grey),
            ],
            Finish::Specular { f0, glossiness } => vec![
                ("diffuse.png", self.base.concat(), rgb),
                ("specular.png", f0.concat(), rgb),
                ("glossiness.png", glossiness.clone(), grey),
            ],
        }
    }

    /// Width and height on paper in millimetres.
    pub fn size_mm(&self) -> [f64; 2] {
        [f64::from(self.size.0) / 10.0, f64::from(self.size.1) / 10.0]
    }

    /// The surfaces of the painting, equal to the last bit to those of the folder it is written to.
    pub fn surfaces(&self, space: Space) -> Surfaces {
        // The steps of the folder reader, in the same order.
        let colour: Vec<f32> = (0..=255u8).map(|v| srgb::decode(f32::from(v) / 255.0)).collect();
        let linear = move |rgb: [u8; 3]| rgb.map(|v| colour[usize::from(v)]);
        let data = |v: u8| f32::from(v) / 255.0;
        let (width, height, base) = (self.width, self.height, self.base.clone());
        match self.finish.clone() {
            Finish::Metallic { roughness, metallic: metal } => {
                Surfaces::build(width, height, space, move |i| {
                    metallic(linear(base[i]), [dielectric(1.5); 3], data(roughness[i]), data(metal[i]))
                })
            }
            Finish::Specular { f0, glossiness } => Surfaces::build(width, height, space, move |i| {
                specular(linear(base[i]), linear(f0[i]), data(glossiness[i]))
            }),
        }
    }
}
