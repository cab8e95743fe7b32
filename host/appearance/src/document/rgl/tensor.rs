//! The tensor file: named arrays of numbers after one header.
//!
//! Layout (little-endian): `tensor_file\0`, two version bytes 1 and 0, u32 number of fields; for each
//! field, u16 length and text of the name, u16 number of dimensions, u8 type, u64 offset from the start of
//! the file, then u64 per dimension. Types: 1 u8, 2 i8, 3 u16, 4 i16, 5 u32, 6 i32, 7 u64, 8 i64, 9 f16, 10
//! f32, 11 f64. Every offset and shape is checked against the file before a value is read.

use std::path::{Path, PathBuf};

use crate::document::error::DocumentError;

/// The most fields in a file: published ones have some ten; few enough for hostile files.
const MOST_FIELDS: u32 = 256;

/// The most dimensions in a field: published ones have five; each must be stored, so the bound comes before
/// memory.
const MOST_DIMENSIONS: u16 = 8;

/// The place and shape of a field.
#[derive(Clone, Debug)]
struct Field {
    name: String,
    kind: u8,
    offset: usize,
    shape: Vec<usize>,
}

/// The fields and the bytes of a file.
pub struct TensorFile<'a> {
    path: PathBuf,
    bytes: &'a [u8],
    fields: Vec<Field>,
}

/// An array of single-precision numbers, the last dimension fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Its dimensions, slowest first.
    pub shape: Vec<usize>,
    /// Its values, finite.
    pub data: Vec<f32>,
}

/// Reads little-endian numbers from the header.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(n).filter(|&end| end <= self.bytes.len());
        let Some(end) = end else {
            return Err(format!(
                "the file ends at byte {}, but {n} bytes were expected from byte {} on",
                self.bytes.len(),
                self.at
            ));
        };
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn number(&mut self, n: usize) -> Result<u64, String> {
        Ok(self.take(n)?.iter().rev().fold(0, |v, &byte| v << 8 | u64::from(byte)))
    }
}

fn size_of(kind: u8) -> Option<usize> {
    match kind {
        1 | 2 => Some(1),
        3 | 4 | 9 => Some(2),
        5 | 6 | 10 => Some(4),
        7 | 8 | 11 => Some(8),
        _ => None,
    }
}

impl<'a> TensorFile<'a> {
    /// Reads the header; `path` names the file in errors.
    pub fn parse(bytes: &'a [u8], path: &Path) -> Result<TensorFile<'a>, DocumentError> {
        let wrong = |problem: String| DocumentError::Field {
            path: path.to_path_buf(),
            field: "header".into(),
            problem,
        };
        let fields = header(bytes).map_err(wrong)?;
        Ok(TensorFile { path: path.to_path_buf(), bytes, fields })
    }

    /// An error about a field.
    pub fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.clone(), field: field.into(), problem }
    }

    /// Whether the file has this field.
    pub fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }

    /// A field with this many dimensions. All numbers must be finite.
    pub fn tensor(&self, name: &str, dimensions: usize) -> Result<Tensor, DocumentError> {
        let Some(field) = self.fields.iter().find(|field| field.name == name) else {
            let names: Vec<&str> = self.fields.iter().map(|field| &field.name[..]).collect();
            return Err(self.wrong(name, format!("missing; the file has {}", names.join(", "))));
        };
        if field.shape.len() != dimensions {
            return Err(
                self.wrong(name, format!("expected {dimensions} dimensions, found {:?}", field.shape))
            );
        }
        // The check of the header bounds the product by the length of the file.
        let count: usize = field.shape.iter().product();
        let Some(size) = size_of(field.kind) else {
            return Err(self.wrong(name, format!("unknown type {}", field.kind)));
        };
        let raw = &self.bytes[field.offset..][..count * size];
        let data: Vec<f32> = raw.chunks_exact(size).map(|b| number(field.kind, b)).collect();
        if let Some(at) = data.iter().position(|v| !v.is_finite()) {
            return Err(self.wrong(name, format!("value {at} is {}, not a finite number", data[at])));
        }
        Ok(Tensor { shape: field.shape.clone(), data })
    }
}

fn header(bytes: &[u8]) -> Result<Vec<Field>, String> {
    let mut cursor = Cursor { bytes, at: 0 };
    if cursor.take(12)? != b"tensor_file\0" {
        return Err("expected a tensor file, which starts with `tensor_file`".into());
    }
    let version = cursor.take(2)?;
    if version != [1, 0] {
        return Err(format!("version {}.{}; expected 1.0", version[0], version[1]));
    }
    let count = cursor.number(4)? as u32;
    if count > MOST_FIELDS {
        return Err(format!("{count} fields; the limit is {MOST_FIELDS}"));
    }
    let mut fields = Vec::new();
    for index in 0..count {
        let length = cursor.number(2)? as usize;
        let name = String::from_utf8_lossy(cursor.take(length)?).into_owned();
        let dimensions = cursor.number(2)? as u16;
        if dimensions > MOST_DIMENSIONS {
            return Err(format!(
                "field {index} (`{name}`) has {dimensions} dimensions; the limit is {MOST_DIMENSIONS}"
            ));
        }
        let kind = cursor.number(1)? as u8;
        let offset = cursor.number(8)?;
        let shape: Vec<u64> = (0..dimensions).map(|_| cursor.number(8)).collect::<Result<_, _>>()?;
        let size =
            size_of(kind).ok_or_else(|| format!("field {index} (`{name}`) has unknown type {kind}"))?;
        let end = shape
            .iter()
            .try_fold(size as u64, |n, &d| n.checked_mul(d))
            .and_then(|n| n.checked_add(offset))
            .filter(|&end| end <= bytes.len() as u64 && offset <= bytes.len() as u64);
        // With a zero among them, the other dimensions could be anything.
        if end.is_none() || shape.contains(&0) {
            return Err(format!(
                "field {index} (`{name}`) of shape {shape:?} at byte {offset} does not fit in the file of {} bytes",
                bytes.len()
            ));
        }
        let shape = shape.into_iter().map(|d| d as usize).collect();
        fields.push(Field { name, kind, offset: offset as usize, shape });
    }
    Ok(fields)
}

/// One number of a known type, from its bytes.
fn number(kind: u8, b: &[u8]) -> f32 {
    let bits = b.iter().rev().fold(0u64, |v, &byte| v << 8 | u64::from(byte));
    match kind {
        2 => f32::from(bits as u8 as i8),
        4 => f32::from(bits as u16 as i16),
        6 => bits as u32 as i32 as f32,
        8 => bits as i64 as f32,
        9 => half::f16::from_bits(bits as u16).to_f32(),
        10 => f32::from_bits(bits as u32),
        11 => f64::from_bits(bits) as f32,
        _ => bits as f32,
    }
}
