//! What the parameters of a material of a scene are set to: numbers, or pictures that its document names.
//!
//! Problem: MaterialX, USD and Wavefront files each follow their own connections, and mean the same by what
//! they end at.
//! Method: a value is numbers or a picture with a channel, a factor and a space of colours; here it becomes
//! a map or a constant. Colours that Rec. 709 does not have are clamped, with a note. Cost: what decoding
//! costs. Limits: a parameter that is one number for the whole material may be no picture.

use std::path::{Path, PathBuf};

use super::colours::Colours;
use super::content::MOST_BYTES;
use super::error::DocumentError;
use super::picture::Picture;
use super::relief;
use super::source::Source;
use super::texture::{Field, Plane};

/// What is said of colours that no mixture of red, green and blue is.
const OUTSIDE: &str = "colours outside of Rec. 709 are clamped to it";

/// What a parameter is set to.
#[derive(Debug)]
pub(super) enum Value {
    /// At least one number.
    Numbers(Vec<f32>),
    /// A picture.
    Image(Image),
}

/// A picture that a parameter is connected to.
#[derive(Debug)]
pub(super) struct Image {
    pub file: PathBuf,
    pub colours: Colours,
    /// The channel that is used; all of them if none.
    pub channel: Option<usize>,
    /// What the values are multiplied by.
    pub factor: [f32; 3],
    /// What is added then.
    pub bias: [f32; 3],
    /// What was left out.
    pub note: Option<String>,
}

impl Image {
    /// A map of its values, with the factor and what is added of a channel.
    fn scaled(&self, plane: Plane, channel: usize) -> Field {
        match (self.factor[channel], self.bias[channel]) {
            (factor, 0.0) => Field::Map(plane).times(factor),
            (factor, bias) => Field::Map(plane.map(|v| (v * factor + bias).max(0.0))),
        }
    }
}

/// Reads what parameters are set to.
pub(super) struct Inputs<'a, 's> {
    /// The document.
    pub path: &'a Path,
    pub source: &'a mut Source<'s>,
}

impl Inputs<'_, '_> {
    pub fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.to_path_buf(), field: field.into(), problem }
    }

    fn picture(&mut self, image: &Image) -> Result<Picture, DocumentError> {
        let bytes = self.source.read(&image.file, MOST_BYTES)?;
        let picture = match image.channel {
            Some(3) => Picture::decode_with_alpha(&bytes, &image.file, self.source)?,
            _ => Picture::decode(&bytes, &image.file, self.source)?,
        };
        if let Some(note) = &image.note {
            self.source.note(note.clone());
        }
        self.source.observer.advance(1);
        Ok(picture)
    }

    /// A parameter with one number per pixel.
    pub fn single(&mut self, name: &str, value: Option<Value>, default: f32) -> Result<Field, DocumentError> {
        Ok(match value {
            None => Field::Constant(default),
            Some(Value::Numbers(numbers)) => Field::Constant(numbers[0]),
            Some(Value::Image(image)) => {
                let picture = self.picture(&image)?;
                let channel = image.channel.unwrap_or(0);
                if channel == 3 && !picture.has_alpha() {
                    return Err(self.wrong(name, format!("{} has no channel of alpha", image.file.display())));
                }
                let plane = picture.channel(channel);
                if plane.outside().is_some() {
                    return Err(self.wrong(name, format!("{}: values are 0 to 1", image.file.display())));
                }
                image.scaled(plane, 0)
            }
        })
    }

    /// A colour, linear.
    pub fn colour(
        &mut self,
        name: &str,
        value: Option<Value>,
        default: [f32; 3],
    ) -> Result<[Field; 3], DocumentError> {
        Ok(match value {
            None => default.map(Field::Constant),
            Some(Value::Numbers(numbers)) => {
                if numbers.iter().any(|&v| v < 0.0) {
                    self.source.note(format!("{name}: {OUTSIDE}"));
                }
                std::array::from_fn(|c| Field::Constant(numbers.get(c).unwrap_or(&numbers[0]).max(0.0)))
            }
            Some(Value::Image(image)) => {
                let picture = self.picture(&image)?.with_primaries(image.colours.primaries);
                let file = image.file.display();
                self.source.note(format!("{file}: {name} read as {}", image.colours.name));
                let mut planes = picture.linear(image.colours.encoding);
                if planes.iter().any(|plane| plane.values().any(|v| v < 0.0)) {
                    self.source.note(format!("{file}: {OUTSIDE}"));
                    planes = planes.map(|plane| plane.map(|v| v.max(0.0)));
                }
                match image.channel {
                    Some(channel) => {
                        let plane = &planes[channel.min(2)];
                        std::array::from_fn(|c| image.scaled(plane.clone(), c))
                    }
                    None => {
                        let [r, g, b] = planes;
                        [image.scaled(r, 0), image.scaled(g, 1), image.scaled(b, 2)]
                    }
                }
            }
        })
    }

    /// A parameter that may only be a number.
    pub fn number(&mut self, name: &str, value: Option<Value>, default: f32) -> Result<f32, DocumentError> {
        match self.single(name, value, default)? {
            Field::Constant(value) => Ok(value),
            Field::Map(_) => Err(self.wrong(name, "a picture is not read here; set a number".into())),
        }
    }

    /// The slope variance of a normal map, whose window is that of a base colour of this size.
    pub fn normal(
        &mut self,
        name: &str,
        value: Option<Value>,
        base: Option<(usize, usize)>,
    ) -> Result<Option<Field>, DocumentError> {
        let Some(Value::Image(image)) = value else { return Ok(None) };
        let picture = self.picture(&image)?;
        let file = image.file.display().to_string();
        if picture.colours() != 3 {
            return Err(self.wrong(name, format!("{file}: expected three components")));
        }
        let scale = base.map_or(1.0, |(width, _)| picture.width as f64 / width as f64);
        let radius = (scale * (relief::WINDOW / 2) as f64).round().clamp(1.0, 256.0) as usize;
        self.source.note(relief::note(&file));
        let (x, y) = (picture.channel(0), picture.channel(1));
        Ok(Some(Field::Map(relief::slope_variance(&x, &y, image.factor[0], radius))))
    }
}
