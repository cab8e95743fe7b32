//! What a photograph's file says about how it was taken.
//!
//! Source: CIPA DC-008 (EXIF).

use std::io::{BufRead, Seek};

use ::exif::{In, Reader, Tag, Value};

/// How a photograph was taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exif {
    /// Exposure time in seconds.
    pub seconds: Option<f64>,
    /// The aperture's f-number.
    pub aperture: Option<f64>,
    /// Sensitivity.
    pub iso: Option<f64>,
    /// The focal length that gives the same picture on 35 mm film, in millimetres.
    pub film_focal_mm: Option<f64>,
    /// Which side is up, 1 to 8.
    pub orientation: Option<u8>,
}

/// Reads EXIF; a file without it gives nothing.
pub fn exif(mut file: impl BufRead + Seek) -> Exif {
    let Ok(fields) = Reader::new().read_from_container(&mut file) else { return Exif::default() };
    let number = |tag| {
        let field = fields.get_field(tag, In::PRIMARY)?;
        let value = match &field.value {
            Value::Rational(values) => values.first()?.to_f64(),
            other => f64::from(other.get_uint(0)?),
        };
        Some(value).filter(|value| value.is_finite() && *value > 0.0)
    };
    Exif {
        seconds: number(Tag::ExposureTime),
        aperture: number(Tag::FNumber),
        iso: number(Tag::PhotographicSensitivity),
        film_focal_mm: number(Tag::FocalLengthIn35mmFilm),
        orientation: number(Tag::Orientation).map(|value| value as u8),
    }
}
