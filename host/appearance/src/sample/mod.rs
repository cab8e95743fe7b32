//! Samples: documents drawn by our own code, so that there is something to print before there is a document.
//!
//! Each is an ordinary folder of texture maps (8-bit PNG and `material.toml`), or opens from memory with the
//! very same numbers. Deterministic: no clock, no random source but a hash.

mod canvas;
mod card;
mod dove;
mod flange;
mod ladder;
mod leaf;

use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::brdf::Space;
use crate::document::folder::{self, Workflow};
use crate::document::picture::decode_srgb;
use crate::document::source::Source;
use crate::document::surfaces::{Surfaces, dielectric, metallic, specular};
use crate::document::{ColourSpace, Content, Document, DocumentError};
use observe::Observer;

/// A sample that can be drawn.
#[derive(Clone, Copy)]
pub struct Sample {
    /// Its name, as in `sample:NAME`.
    pub name: &'static str,
    /// What it shows.
    pub about: &'static str,
    draw: fn() -> Painting,
}

/// All samples.
pub const SAMPLES: [Sample; 5] = [
    Sample { name: "leaf", about: "an autumn oak leaf with silver veins on matte paper", draw: leaf::draw },
    Sample {
        name: "card",
        about: "a greeting card: gold, silver and glossy holly on matte green",
        draw: card::draw,
    },
    Sample { name: "dove", about: "a silver dove with a glossy olive twig on matte blue", draw: dove::draw },
    Sample { name: "flange", about: "a rusted steel ring, bare metal beside rust", draw: flange::draw },
    Sample {
        name: "ladder",
        about: "four steps of gloss over one colour, 100, 80, 50 and 10 percent",
        draw: ladder::draw,
    },
];

/// What else the pixels of a painting hold beside their base colour, 0 to 255 for 0 to 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finish {
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
pub struct Painting {
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

impl Sample {
    /// The sample of that name.
    pub fn named(name: &str) -> Result<Sample, DocumentError> {
        SAMPLES.into_iter().find(|sample| sample.name == name).ok_or_else(|| DocumentError::Sample {
            name: name.into(),
            known: SAMPLES.iter().map(|sample| sample.name).collect(),
        })
    }

    /// Draws it. Takes a fraction of a second.
    pub fn draw(&self) -> Painting {
        (self.draw)()
    }
}

impl Painting {
    /// The files of the painting: names and contents.
    fn maps(&self) -> Vec<(&'static str, Vec<u8>, ExtendedColorType)> {
        let (grey, rgb) = (ExtendedColorType::L8, ExtendedColorType::Rgb8);
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

    fn size_mm(&self) -> [f64; 2] {
        [f64::from(self.size.0) / 10.0, f64::from(self.size.1) / 10.0]
    }

    /// Writes the painting as a folder of texture maps. The folder must exist.
    pub fn write(&self, name: &str, folder: &Path) -> Result<(), DocumentError> {
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |source| DocumentError::Io { path, attempt: "write", source }
        };
        for (file, data, colour) in self.maps() {
            let path = folder.join(file);
            let output = std::fs::File::create_new(&path).map_err(io(&path))?;
            PngEncoder::new(std::io::BufWriter::new(output))
                .write_image(&data, self.width as u32, self.height as u32, colour)
                .map_err(|error| io(&path)(std::io::Error::other(error)))?;
        }
        let settings = folder::Settings {
            name: Some(name.into()),
            size_mm: Some(self.size_mm()),
            colour_space: Some(ColourSpace::Srgb),
            workflow: Some(match self.finish {
                Finish::Metallic { .. } => Workflow::MetallicRoughness,
                Finish::Specular { .. } => Workflow::SpecularGlossiness,
            }),
            ..folder::Settings::default()
        };
        let path = folder.join(folder::SETTINGS);
        let text = toml::to_string(&settings).map_err(|error| io(&path)(std::io::Error::other(error)))?;
        std::fs::write(&path, text).map_err(io(&path))
    }

    fn surfaces(&self, space: Space) -> Surfaces {
        // The steps of the folder reader, in its order: the same numbers to the last bit.
        let colour: Vec<f32> = (0..=255u8).map(|v| decode_srgb(f32::from(v) / 255.0)).collect();
        let linear = |rgb: [u8; 3]| rgb.map(|v| colour[usize::from(v)]);
        let data = |v: u8| f32::from(v) / 255.0;
        let f0_plain = [dielectric(1.5); 3];
        match &self.finish {
            Finish::Metallic { roughness, metallic: metal } => {
                Surfaces::build(self.width, self.height, space, |i| {
                    metallic(linear(self.base[i]), f0_plain, data(roughness[i]), data(metal[i]))
                })
            }
            Finish::Specular { f0, glossiness } => Surfaces::build(self.width, self.height, space, |i| {
                specular(linear(self.base[i]), linear(f0[i]), data(glossiness[i]))
            }),
        }
    }
}

/// Opens a sample without touching the disk.
pub(crate) fn document(name: &str, space: Space, observer: &dyn Observer) -> Result<Document, DocumentError> {
    let sample = Sample::named(name)?;
    let mut source = Source::new(observer);
    observer.begin("drawing", 1);
    let painting = sample.draw();
    for (file, data, _) in painting.maps() {
        source.take_in(file, &data);
    }
    let surfaces = painting.surfaces(space);
    observer.advance(1);
    observer.end();
    let (notes, digest) = source.finish();
    let [width, height] = painting.size_mm();
    Ok(Document {
        name: sample.name.into(),
        content: Content::Surfaces(surfaces),
        size_mm: Some((width, height)),
        notes,
        digest,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::{Materials, Options, open};
    use observe::Silent;

    /// It is drawn twice here: nothing but its own code decides what it looks like.
    #[test]
    fn every_sample_opens_the_same_from_memory_and_from_its_folder() {
        for sample in SAMPLES {
            let folder = tempfile::tempdir().unwrap();
            sample.draw().write(sample.name, folder.path()).unwrap();
            let options = Options::default();
            let file = open(folder.path().to_str().unwrap(), &options, &Silent).unwrap();
            let memory = open(&format!("sample:{}", sample.name), &options, &Silent).unwrap();
            assert_eq!((&file.name, file.size_mm), (&memory.name, memory.size_mm));
            let (Content::Surfaces(file), Content::Surfaces(memory)) = (&file.content, &memory.content)
            else {
                panic!("a sample is made of surfaces")
            };
            assert_eq!((file.width(), file.height()), (memory.width(), memory.height()));
            for pixel in 0..file.width() * file.height() {
                assert_eq!(file.surface(pixel), memory.surface(pixel), "{} pixel {pixel}", sample.name);
            }
        }
    }

    #[test]
    fn an_unknown_sample_is_answered_with_the_known_ones() {
        let error = open("sample:laef", &Options::default(), &Silent).unwrap_err().to_string();
        assert!(error.contains("laef") && error.contains("ladder"), "{error}");
    }
}
