//! Where an edit applies.
//!
//! A mask is a weight for every pixel, in units of 1/[`ONE`]: painted (white: wholly, black: not at all), or made of the
//! weight maps as they are before the step. Cost: a pass over the pixels. Limits: a painted mask has the document's size.

use std::fmt;
use std::path::{Path, PathBuf};

use files::shelf::Shelf;
use observe::Observer;

use super::error::EditError;
use crate::document::DocumentError;
use crate::document::MOST_BYTES;
use crate::document::picture::Picture;
use crate::document::source::Source;
use crate::weights::ONE;

/// The most by which the channels of a grey picture may differ, so that a step of 8 bits and rounding is no
/// colour.
const GREY: f32 = 1.5 / 255.0;

const EXPECTED: &str = "a grey picture, `basis:N` (where basis N is), `basis:N,WEIGHT` (where it weighs at least that, above 0 to 1), or \
                        `region:X,Y` (the region around that pixel where the same basis weighs most)";

/// Where an edit applies.
#[derive(Clone, Debug, PartialEq)]
pub enum Mask {
    /// A painted picture.
    Painted(Painted),
    /// A basis, by its weight.
    Basis(usize),
    /// The region of a map where a basis weighs at least this (above 0, at most 1).
    AtLeast(usize, f64),
    /// The connected region around a pixel (column, row) where the same basis weighs most.
    Region(usize, usize),
}

/// A painted mask.
#[derive(Clone, Debug, PartialEq)]
pub struct Painted {
    /// Its file, for people.
    pub name: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// How far the edit applies at each pixel, 0..=[`ONE`], rows from the top.
    pub values: Vec<u16>,
}

impl fmt::Display for Mask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mask::Painted(painted) => write!(f, "{}", painted.name),
            Mask::Basis(basis) => write!(f, "basis:{basis}"),
            Mask::AtLeast(basis, weight) => write!(f, "basis:{basis},{weight}"),
            Mask::Region(x, y) => write!(f, "region:{x},{y}"),
        }
    }
}

impl Mask {
    /// A mask of weight maps if the text is one, `basis:N`, `basis:N,WEIGHT` or `region:X,Y`; none if it names a picture.
    ///
    /// # Errors
    /// Numbers that are none or out of range.
    pub fn of_maps(text: &str) -> Result<Option<Mask>, EditError> {
        let wrong = || EditError::Text { text: text.into(), expected: EXPECTED };
        if let Some(numbers) = text.strip_prefix("region:") {
            let (x, y) = numbers.split_once(',').ok_or_else(wrong)?;
            let number = |text: &str| text.trim().parse().map_err(|_| wrong());
            return Ok(Some(Mask::Region(number(x)?, number(y)?)));
        }
        let Some(numbers) = text.strip_prefix("basis:") else { return Ok(None) };
        let (basis, weight) = numbers.split_once(',').map_or((numbers, None), |(b, w)| (b, Some(w)));
        let basis = basis.trim().parse().map_err(|_| wrong())?;
        let Some(weight) = weight else { return Ok(Some(Mask::Basis(basis))) };
        let weight: f64 = weight.trim().parse().map_err(|_| wrong())?;
        if !(weight > 0.0 && weight <= 1.0) {
            return Err(wrong());
        }
        Ok(Some(Mask::AtLeast(basis, weight)))
    }

    /// The mask that a text means: one of weight maps, or the picture of that name.
    ///
    /// # Errors
    /// Numbers that are none or out of range, a picture that cannot be read or is not grey.
    pub fn open(shelf: &dyn Shelf, text: &str, observer: &dyn Observer) -> Result<Mask, EditError> {
        match Mask::of_maps(text)? {
            Some(mask) => Ok(mask),
            None => Ok(Mask::Painted(Painted::read(Path::new(text), &mut Source::new(shelf, observer))?)),
        }
    }

    /// How far the edit applies at each pixel, 0..=[`ONE`].
    pub(super) fn values(&self, size: (usize, usize), maps: &[Vec<u16>]) -> Result<Vec<u16>, EditError> {
        let map = |basis: usize| {
            maps.get(basis).ok_or(EditError::Basis { found: basis, bases: maps.len() }).map(Vec::as_slice)
        };
        Ok(match *self {
            Mask::Painted(ref painted) => {
                let found = (painted.width, painted.height);
                if found != size {
                    return Err(EditError::Shape { name: painted.name.clone(), found, expected: size });
                }
                painted.values.clone()
            }
            Mask::Basis(basis) => map(basis)?.to_vec(),
            Mask::AtLeast(basis, weight) => {
                let least = f64::from(ONE) * weight;
                map(basis)?.iter().map(|&w| if f64::from(w) >= least { ONE } else { 0 }).collect()
            }
            Mask::Region(x, y) => {
                if x >= size.0 || y >= size.1 {
                    return Err(EditError::Pixel { found: (x, y), size });
                }
                region(size, maps, y * size.0 + x)
            }
        })
    }
}

/// The pixels connected by their sides to `start` where the same basis weighs most; of equal ones, the first.
fn region((width, height): (usize, usize), maps: &[Vec<u16>], start: usize) -> Vec<u16> {
    let most = |pixel: usize| {
        (0..maps.len()).fold(0, |best, b| if maps[b][pixel] > maps[best][pixel] { b } else { best })
    };
    let basis = most(start);
    let mut inside = vec![0; width * height];
    inside[start] = ONE;
    let mut left = vec![start];
    while let Some(pixel) = left.pop() {
        let (x, y) = (pixel % width, pixel / width);
        let beside = [
            (x > 0).then(|| pixel - 1),
            (x + 1 < width).then(|| pixel + 1),
            (y > 0).then(|| pixel - width),
            (y + 1 < height).then(|| pixel + width),
        ];
        for next in beside.into_iter().flatten() {
            if inside[next] == 0 && most(next) == basis {
                inside[next] = ONE;
                left.push(next);
            }
        }
    }
    inside
}

impl Painted {
    pub(super) fn read(path: &Path, source: &mut Source<'_>) -> Result<Painted, EditError> {
        let bytes = source.read(path, MOST_BYTES)?;
        let picture = Picture::decode(&bytes, path, source)?;
        let wrong = |problem: String| {
            EditError::Document(DocumentError::Picture { path: PathBuf::from(path), problem })
        };
        let (width, height) = (picture.width, picture.height);
        let grey = picture.channel(0);
        for channel in 1..picture.colours() {
            let other = picture.channel(channel);
            if let Some(at) = (0..width * height).find(|&at| (grey.at(at) - other.at(at)).abs() > GREY) {
                let (x, y) = (at % width, at / width);
                return Err(wrong(format!("a mask is grey, and pixel ({x}, {y}) is coloured")));
            }
        }
        if let Some(at) = (0..width * height).find(|&at| !(0.0..=1.0).contains(&grey.at(at))) {
            let (x, y) = (at % width, at / width);
            return Err(wrong(format!("pixel ({x}, {y}) of the mask is {}; expected 0 to 1", grey.at(at))));
        }
        let values = grey.values().map(|v| (v * f32::from(ONE)).round() as u16).collect();
        // The name is shown on terminals.
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let name = name.chars().filter(|c| !c.is_control()).collect();
        Ok(Painted { name, width, height, values })
    }
}
