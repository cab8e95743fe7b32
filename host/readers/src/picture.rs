//! A picture as its file has it: planes with names, colours, a resolution.
//!
//! Problem: layers of ink, plates of a press and photographs come in the same formats. What a plane is for is
//! not the file's to say. Method: a reader hands over what the file says: named planes, process plates,
//! opacity, and colours as they are stored, the right way up. [`Picture::to_srgb`] brings the colours to sRGB
//! by the profile or the power that the file states. Cost: what the pixels take. Limits: 8 bits a sample;
//! deeper samples are rounded, and a note says so. Source: IEC 61966-2-1 for sRGB.

use std::path::PathBuf;

use maths::Maths as _;
use observe::Diagnosis;
use rayon::prelude::*;

use crate::profile;
use crate::resolution::Dpi;

/// A decoded picture, the right way up.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// What messages call it: the name of its file.
    pub name: PathBuf,
    /// Pixels across and down.
    pub size: (u32, u32),
    /// Planes beside the colours, or in place of them, in the order of the file.
    pub planes: Vec<Plane>,
    /// Its colours.
    pub colours: Option<Raster>,
    /// Pixels per inch, if the file states them.
    pub resolution: Option<Dpi>,
    /// The colour profile of its colours or its process plates, not applied.
    pub profile: Option<Vec<u8>>,
    /// The power of light of its values, if they have neither a profile nor the power of sRGB.
    pub gamma: Option<f64>,
    /// What had to be assumed.
    pub notes: Vec<String>,
}

/// One plane of a picture, a byte a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Its name in the file; empty for process plates and opacity.
    pub name: String,
    /// What the file says it is.
    pub kind: PlaneKind,
    /// Its samples, rows from the top: 255 is a full plate, or opaque.
    pub samples: Vec<u8>,
}

/// What a plane is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneKind {
    /// The plate of a process ink.
    Process(Process),
    /// A plate with a name. `inverted` says that the file has 0 for full, as Photoshop displays its channels.
    Plate {
        /// Whether 0 is full in the file.
        inverted: bool,
    },
    /// The opacity of everything but named plates.
    Opacity,
}

/// The inks of a press, in the order of their channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// C.
    Cyan,
    /// M.
    Magenta,
    /// Y.
    Yellow,
    /// K.
    Black,
}

impl Process {
    /// All of them, in the order of the channels.
    pub const ALL: [Process; 4] = [Process::Cyan, Process::Magenta, Process::Yellow, Process::Black];
}

/// Samples of 8 bits, a row after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Samples of a pixel: grey; grey and opacity; red, green, blue; these and opacity.
    pub channels: usize,
    /// The samples. Opacity is straight.
    pub samples: Vec<u8>,
}

impl Raster {
    /// Whether pixels have an opacity.
    pub fn has_opacity(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// Red, green, blue and opacity of each pixel.
    #[must_use]
    pub fn into_rgba(self) -> Vec<u8> {
        match self.channels {
            1 => self.samples.iter().flat_map(|&v| [v, v, v, 255]).collect(),
            2 => self.samples.as_chunks::<2>().0.iter().flat_map(|&[v, a]| [v, v, v, a]).collect(),
            3 => self.samples.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect(),
            _ => self.samples,
        }
    }
}

impl From<image::DynamicImage> for Raster {
    fn from(image: image::DynamicImage) -> Raster {
        let colour = image.color();
        let (channels, samples) = match (colour.has_color(), colour.has_alpha()) {
            (false, false) => (1, image.into_luma8().into_raw()),
            (false, true) => (2, image.into_luma_alpha8().into_raw()),
            (true, false) => (3, image.into_rgb8().into_raw()),
            (true, true) => (4, image.into_rgba8().into_raw()),
        };
        Raster { channels, samples }
    }
}

impl Picture {
    /// Brings the colours to sRGB with opacity, by the profile or the power that the file states, and notes
    /// what changed them.
    ///
    /// # Errors
    /// A profile for pixels of another kind.
    pub fn to_srgb(&mut self) -> Result<(), Diagnosis> {
        let Some(colours) = self.colours.take() else { return Ok(()) };
        let grey = colours.channels < 3;
        let mut rgba = colours.into_rgba();
        if let Some(profile) = self.profile.take() {
            self.notes.extend(profile::to_srgb(&self.name, &profile, grey, &mut rgba)?);
        }
        if let Some(gamma) = self.gamma.take() {
            let table: Vec<u8> = (0..=255).map(|v| of_power(v, gamma)).collect();
            rgba.par_chunks_exact_mut(4).for_each(|pixel| {
                pixel[..3].iter_mut().for_each(|v| *v = table[usize::from(*v)]);
            });
            self.notes.push(format!("{}: its gamma of {gamma:.3} was applied", self.name.display()));
        }
        self.colours = Some(Raster { channels: 4, samples: rgba });
        Ok(())
    }
}

/// A value whose light has this power, in sRGB.
fn of_power(value: u8, gamma: f64) -> u8 {
    let light = (f64::from(value) / 255.0).power(1.0 / gamma);
    let encoded = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.power(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(channels: usize, samples: &[u8], gamma: Option<f64>) -> Picture {
        Picture {
            name: "a.png".into(),
            size: ((samples.len() / channels) as u32, 1),
            planes: Vec::new(),
            colours: Some(Raster { channels, samples: samples.to_vec() }),
            resolution: None,
            profile: None,
            gamma,
            notes: Vec::new(),
        }
    }

    #[test]
    fn greys_and_opaque_colours_become_four_channels() {
        for (channels, samples, wanted) in [
            (1, &[7, 200][..], vec![7, 7, 7, 255, 200, 200, 200, 255]),
            (2, &[7, 9], vec![7, 7, 7, 9]),
            (3, &[1, 2, 3], vec![1, 2, 3, 255]),
            (4, &[1, 2, 3, 4], vec![1, 2, 3, 4]),
        ] {
            let mut picture = picture(channels, samples, None);
            picture.to_srgb().unwrap();
            assert_eq!(picture.colours.unwrap().samples, wanted);
            assert!(picture.notes.is_empty());
        }
    }

    #[test]
    fn values_that_are_light_itself_become_those_of_srgb() {
        // Half the light is 188 in sRGB, a fifth of it 124; opacity is no light.
        let mut picture = picture(2, &[128, 128, 51, 51], Some(1.0));
        picture.to_srgb().unwrap();
        assert_eq!(picture.colours.unwrap().samples, [188, 188, 188, 128, 124, 124, 124, 51]);
        assert_eq!(picture.notes, ["a.png: its gamma of 1.000 was applied"]);
    }

    #[test]
    fn a_damaged_profile_is_no_reason_to_refuse_a_picture() {
        let mut picture = Picture { profile: Some(vec![1; 200]), ..picture(3, &[1, 2, 3], None) };
        picture.to_srgb().unwrap();
        assert_eq!(picture.notes, ["a.png: its colour profile is damaged, so it is read as sRGB"]);
        assert_eq!(picture.colours.unwrap().samples, [1, 2, 3, 255]);
    }
}
