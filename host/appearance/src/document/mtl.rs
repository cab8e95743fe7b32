//! Wavefront MTL: one material of a `.mtl` file, with the pictures that it names.
//!
//! Method: line by line; of a material its colour, roughness, metalness, clear coat and normal map are
//! read, each a number or a picture, with the physically based extension. Roughness is found from the
//! exponent `Ns` only where nothing else says it, with a note.
//! Cost: one pass. Limits: [`MOST_LINES`] lines; options of pictures are passed over, and every line that
//! is not read is named.
//! Source: the format's description by Alias|Wavefront, 1995; D. Ulrich's physically based extension, 2013.

use std::path::Path;

use files::shelf::inside;

use super::colours::{Colours, LINEAR};
use super::content::{Content, Document, Options, SWATCH_MM};
use super::error::DocumentError;
use super::inputs::{Image, Inputs, Value};
use super::source::Source;
use super::texture::Field;
use super::texture::layers::{CoatLayer, Layers, PbrWorkflow, build};
use crate::brdf::Space;
use crate::materials::dielectric;

/// The largest file. Source: a thousand times what exporters write.
const MOST_TEXT: u64 = 16 << 20;
/// The most lines. Source: as for [`MOST_TEXT`].
const MOST_LINES: usize = 200_000;

/// Options before the name of a picture, and the most numbers or words that follow each.
const PICTURE_OPTIONS: [(&str, usize); 12] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-boost", 1),
    ("-mm", 2),
    ("-o", 3),
    ("-s", 3),
    ("-t", 3),
    ("-texres", 1),
    ("-clamp", 1),
    ("-bm", 1),
    ("-imfchan", 1),
    ("-type", 1),
];

/// What is read, and what says nothing about reflectance; the rest is named in a note.
const READ: [&str; 17] = [
    "Kd", "map_Kd", "Pr", "map_Pr", "Pm", "map_Pm", "Pc", "map_Pc", "Pcr", "Ni", "Ns", "norm", "map_Bump",
    "bump", "illum", "Ka", "map_Ka",
];

/// A line of a material: its first word, the rest, and its number.
type Line<'t> = (&'t str, &'t str, usize);

struct Material<'t> {
    name: &'t str,
    lines: Vec<Line<'t>>,
}

pub(super) fn open(
    path: &Path,
    options: &Options,
    space: Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let wrong = |field: &str, problem: String| DocumentError::Field {
        path: path.to_path_buf(),
        field: field.into(),
        problem,
    };
    let bytes = source.read(path, MOST_TEXT)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| wrong("MTL", error.to_string()))?;
    let mut materials: Vec<Material<'_>> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if number >= MOST_LINES {
            return Err(wrong("MTL", format!("more than {MOST_LINES} lines")));
        }
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match (word, materials.last_mut()) {
            ("newmtl", _) => materials.push(Material { name: rest.trim(), lines: Vec::new() }),
            _ if line.is_empty() || line.starts_with('#') => {}
            (_, None) => {}
            (_, Some(material)) => material.lines.push((word, rest.trim(), number + 1)),
        }
    }
    let material = choose(path, &materials, options.material.as_deref())?;
    let unread: Vec<&str> =
        material.lines.iter().map(|(word, ..)| *word).filter(|word| !READ.contains(word)).collect();
    if !unread.is_empty() {
        source.note(format!("{}: lines that are not printed: {}", path.display(), unread.join(", ")));
    }
    source.observer.begin("reading", 1);
    let mut reader = Reader { material, inputs: Inputs { path, source: &mut source } };
    let layers = reader.layers()?;
    let (surfaces, textured) = build(layers, path, space, &mut source)?;
    source.observer.end();
    let name = if material.name.is_empty() { source.name_of(path) } else { material.name.to_owned() };
    let (notes, digest) = source.finish();
    Ok(Document {
        name,
        content: Content::Surfaces(surfaces),
        size_mm: (!textured).then_some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
        views: None,
    })
}

/// The requested material, by number or name; by default the only one.
fn choose<'m, 't>(
    path: &Path,
    materials: &'m [Material<'t>],
    asked: Option<&str>,
) -> Result<&'m Material<'t>, DocumentError> {
    let fail = |problem: String| DocumentError::Choice {
        path: path.to_path_buf(),
        problem,
        materials: materials
            .iter()
            .enumerate()
            .map(|(i, material)| format!("{i} ({})", material.name))
            .collect(),
    };
    match (asked, materials) {
        (_, []) => Err(DocumentError::Field {
            path: path.to_path_buf(),
            field: "newmtl".into(),
            problem: "the file has no material".into(),
        }),
        (None, [one]) => Ok(one),
        (None, several) => Err(fail(format!("the file has {} materials", several.len()))),
        (Some(asked), all) => {
            let numbered = asked.parse::<usize>().ok().and_then(|number| all.get(number));
            let named = || all.iter().find(|material| material.name == asked);
            numbered.or_else(named).ok_or_else(|| fail(format!("there is no material `{asked}`")))
        }
    }
}

struct Reader<'a, 't, 's> {
    material: &'a Material<'t>,
    inputs: Inputs<'a, 's>,
}

impl Reader<'_, '_, '_> {
    /// What one of these words is set to; the last line that has it counts.
    fn numbers(&self, word: &str) -> Result<Option<Value>, DocumentError> {
        let Some((_, rest, line)) = self.material.lines.iter().rfind(|(own, ..)| *own == word) else {
            return Ok(None);
        };
        let numbers: Option<Vec<f32>> = rest.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers.filter(|numbers| !numbers.is_empty() && numbers.iter().all(|v| v.is_finite())) {
            Some(numbers) => Ok(Some(Value::Numbers(numbers))),
            None => Err(self
                .inputs
                .wrong(&format!("line {line}"), format!("expected numbers for {word}, found `{rest}`"))),
        }
    }

    /// The picture that one of these words names.
    fn picture(&self, words: &[&str], colours: Colours) -> Result<Option<Image>, DocumentError> {
        let found = self.material.lines.iter().rfind(|(own, ..)| words.contains(own));
        let Some((word, rest, line)) = found else { return Ok(None) };
        let mut rest = *rest;
        while let Some((option, most)) = PICTURE_OPTIONS.iter().find(|(option, _)| {
            rest.strip_prefix(option).is_some_and(|after| after.starts_with(char::is_whitespace))
        }) {
            rest = rest[option.len()..].trim_start();
            for taken in 0..*most {
                let (first, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                // Numbers at the end of a series may be left out; words may not.
                if taken > 0 && first.parse::<f32>().is_err() {
                    break;
                }
                rest = after.trim_start();
            }
        }
        let field = format!("line {line}");
        let name = rest.replace('\\', "/");
        let Some(file) = inside(self.inputs.path.parent().unwrap_or(Path::new("")), &name) else {
            let problem = format!("{word}: `{rest}` must be a file in the document's folder or below");
            return Err(self.inputs.wrong(&field, problem));
        };
        Ok(Some(Image { file, colours, channel: None, factor: [1.0; 3], bias: [0.0; 3], note: None }))
    }

    /// A parameter: its picture, or its number.
    fn single(&mut self, (picture, number): (&str, &str), default: f32) -> Result<Field, DocumentError> {
        let value = match self.picture(&[picture], LINEAR)? {
            Some(image) => Some(Value::Image(image)),
            None => self.numbers(number)?,
        };
        self.inputs.single(number, value, default)
    }

    fn layers(&mut self) -> Result<Layers, DocumentError> {
        let srgb = Colours::named("srgb_texture").unwrap_or(LINEAR);
        let colour = match self.picture(&["map_Kd"], srgb)? {
            Some(image) => Some(Value::Image(image)),
            None => self.numbers("Kd")?,
        };
        let base = self.inputs.colour("Kd", colour, [0.8; 3])?;
        let has = |word: &str| self.material.lines.iter().any(|(own, ..)| *own == word);
        let by_exponent = !has("Pr") && !has("map_Pr");
        let roughness = match self.numbers("Ns")? {
            Some(Value::Numbers(exponent)) if by_exponent => {
                // Blinn's exponent of a lobe of this width, and roughness as the root of the width.
                let roughness = (2.0 / (exponent[0].max(0.0) + 2.0)).sqrt().sqrt();
                self.inputs.source.note(format!(
                    "roughness {roughness:.2} is found from the exponent Ns {}; Pr or map_Pr states it",
                    exponent[0]
                ));
                Field::Constant(roughness.clamp(0.0, 1.0))
            }
            _ => {
                if by_exponent {
                    self.inputs.source.note("no roughness (Pr, map_Pr or Ns): 0.5 is taken".into());
                }
                self.single(("map_Pr", "Pr"), 0.5)?
            }
        };
        let metal = self.single(("map_Pm", "Pm"), 0.0)?;
        let ior = self.numbers("Ni")?;
        let f0 = dielectric(self.inputs.number("Ni", ior, 1.5)?);
        let weight = self.single(("map_Pc", "Pc"), 0.0)?;
        let coat = match weight == Field::Constant(0.0) {
            true => None,
            false => Some(CoatLayer {
                weight,
                roughness: self.single(("map_Pcr", "Pcr"), 0.0)?,
                f0: dielectric(1.5),
            }),
        };
        let normal = self.picture(&["norm"], LINEAR)?.map(Value::Image);
        if normal.is_none() && self.picture(&["map_Bump", "bump"], LINEAR)?.is_some() {
            self.inputs.source.note("the bump map is not read: a normal map is named by norm".into());
        }
        let variance = self.inputs.normal("norm", normal, base[0].size())?;
        let f0 = [f0; 3].map(Field::Constant);
        let kind = PbrWorkflow::Metallic { roughness, metal, f0, level: Field::Constant(1.0) };
        Ok(Layers { base, kind, variance, coat })
    }
}

#[cfg(test)]
mod tests;
