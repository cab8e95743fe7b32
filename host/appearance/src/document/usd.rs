//! USD: one material of a text file (`.usda`), by itself or packed as USDZ, with the pictures that its
//! inputs are connected to.
//!
//! Problem: a USDZ beside its maps says which of them is metal, or that all of it is; by the names of the
//! files that is lost.
//! Method: the text becomes a tree ([`tree`]); the surface of a material is followed to its
//! `UsdPreviewSurface`, whose inputs are numbers or pictures of `UsdUVTexture`, with their channel, scale
//! and colour space. Cost: the file as a tree. Limits: one layer, so nothing that references, payloads or
//! variants bring; binary files (`.usdc`) are an error that says what to export.
//! Source: OpenUSD's specification of UsdPreviewSurface 2.6.

mod tree;

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

use tree::{Prim, Property};

/// The largest file: far more than any material, and held in memory as a tree.
const MOST_TEXT: u64 = 16 << 20;

/// The most steps from an input to its value, so that a file that refers to itself ends.
const DEEPEST: usize = 16;

/// Inputs of the surface that are read, or say nothing about reflectance.
const READ: [&str; 12] = [
    "diffuseColor",
    "metallic",
    "roughness",
    "ior",
    "clearcoat",
    "clearcoatRoughness",
    "normal",
    "useSpecularWorkflow",
    "specularColor",
    "occlusion",
    "displacement",
    "opacityThreshold",
];

/// Whether these are the first bytes of a binary file.
pub(super) fn is_binary(head: &[u8]) -> bool {
    head.starts_with(b"PXR-USDC")
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
    if is_binary(&source.head(path)?) {
        return Err(wrong("USD", "it is a binary file; export .usda, glTF or MaterialX".into()));
    }
    let bytes = source.read(path, MOST_TEXT)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| wrong("USD", error.to_string()))?;
    let top = tree::parse(text).map_err(|(line, problem)| wrong(&format!("line {line}"), problem))?;
    let scene = Scene { top: &top, path };
    let (place, material) = choose(&scene, options.material.as_deref())?;
    let surface = scene.surface(&place, material)?;
    let set = surface.1.properties.iter().filter_map(|property| property.name.strip_prefix("inputs:"));
    let unread: Vec<&str> = set.filter(|name| !READ.contains(&name.trim_end_matches(".connect"))).collect();
    if !unread.is_empty() {
        source.note(format!("{}: inputs that are not printed: {}", path.display(), unread.join(", ")));
    }
    source.observer.begin("reading", unread.len().max(1) as u64);
    let mut reader =
        Reader { scene: &scene, surface: surface.1, inputs: Inputs { path, source: &mut source } };
    let layers = reader.layers()?;
    let (surfaces, textured) = build(layers, path, space, &mut source)?;
    source.observer.end();
    let (notes, digest) = source.finish();
    Ok(Document {
        name: material.name.clone(),
        content: Content::Surfaces(surfaces),
        size_mm: (!textured).then_some((SWATCH_MM, SWATCH_MM)),
        notes,
        digest,
        views: None,
    })
}

struct Scene<'t> {
    top: &'t [Prim],
    path: &'t Path,
}

/// The requested material, by number or name; by default the only one. Returned with its path in the scene.
fn choose<'t>(scene: &Scene<'t>, asked: Option<&str>) -> Result<(String, &'t Prim), DocumentError> {
    let mut found: Vec<(String, &Prim)> = Vec::new();
    let mut waiting: Vec<(String, &Prim)> =
        scene.top.iter().rev().map(|prim| (format!("/{}", prim.name), prim)).collect();
    while let Some((place, prim)) = waiting.pop() {
        waiting.extend(prim.children.iter().rev().map(|child| (format!("{place}/{}", child.name), child)));
        if prim.kind == "Material" {
            found.push((place, prim));
        }
    }
    let fail = |problem: String| DocumentError::Choice {
        path: scene.path.to_path_buf(),
        problem,
        materials: found.iter().enumerate().map(|(i, (_, prim))| format!("{i} ({})", prim.name)).collect(),
    };
    match (asked, &found[..]) {
        (_, []) => Err(scene.wrong("materials", "the file has no material".into())),
        (None, [one]) => Ok(one.clone()),
        (None, several) => Err(fail(format!("the file has {} materials", several.len()))),
        (Some(asked), all) => {
            let numbered = asked.parse::<usize>().ok().and_then(|number| all.get(number));
            let chosen =
                numbered.or_else(|| all.iter().find(|(place, prim)| prim.name == asked || place == asked));
            chosen.cloned().ok_or_else(|| fail(format!("there is no material `{asked}`")))
        }
    }
}

/// The property of a prim with this name.
fn property<'t>(prim: &'t Prim, name: &str) -> Option<&'t Property> {
    prim.properties.iter().rev().find(|property| property.name == name)
}

impl<'t> Scene<'t> {
    fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.to_path_buf(), field: field.into(), problem }
    }

    /// The prim at a path, such as `/Root/Looks/Gold`.
    fn prim(&self, place: &str) -> Option<&'t Prim> {
        let mut names = place.strip_prefix('/')?.split('/');
        let first = names.next()?;
        let start = self.top.iter().find(|prim| prim.name == first)?;
        names.try_fold(start, |prim, name| prim.children.iter().find(|child| child.name == name))
    }

    /// The surface of a material, and where it is.
    fn surface(&self, place: &str, material: &Prim) -> Result<(String, &'t Prim), DocumentError> {
        let outputs = ["outputs:surface.connect", "outputs:mtlx:surface.connect"];
        let Some(output) = outputs.iter().find_map(|name| property(material, name)) else {
            return Err(self.wrong(place, "the material has no outputs:surface that is connected".into()));
        };
        let (prim, _, at) = self.target(output)?;
        match property(prim, "info:id").map(|id| &id.value) {
            Some(tree::Value::Text(id)) if id == "UsdPreviewSurface" => Ok((at, prim)),
            id => Err(self.wrong(
                place,
                format!(
                    "its surface is {}; only UsdPreviewSurface is read",
                    match id {
                        Some(tree::Value::Text(id)) => id,
                        _ => "of no kind that is stated",
                    }
                ),
            )),
        }
    }

    /// What a connection leads to: the prim, the name of its property, and the prim's path.
    fn target(&self, connection: &Property) -> Result<(&'t Prim, String, String), DocumentError> {
        let field = format!("line {}", connection.line);
        let tree::Value::Path(target) = &connection.value else {
            return Err(self.wrong(&field, format!("{} is connected to no path", connection.name)));
        };
        let (place, name) = target.split_once('.').unwrap_or((target, ""));
        let prim = self.prim(place);
        let prim =
            prim.ok_or_else(|| self.wrong(&field, format!("`{target}` does not exist in this file")))?;
        Ok((prim, name.into(), place.into()))
    }

    /// What an input of a prim is set to; `None` if it is not.
    fn value(&self, prim: &'t Prim, name: &str, steps: usize) -> Result<Option<Value>, DocumentError> {
        let Some(steps) = steps.checked_sub(1) else {
            return Err(self.wrong(name, format!("no value after {DEEPEST} connections")));
        };
        if let Some(connection) = property(prim, &format!("inputs:{name}.connect")) {
            let (other, output, _) = self.target(connection)?;
            if let Some(outer) = output.strip_prefix("inputs:") {
                return self.value(other, outer, steps);
            }
            let id = property(other, "info:id").map(|id| id.value.clone());
            let is_picture = id == Some(tree::Value::Text("UsdUVTexture".into()));
            if !is_picture {
                let field = format!("line {}", connection.line);
                let problem = format!(
                    "{name} comes from the node {}, which is not read; bake it to a picture",
                    other.name
                );
                return Err(self.wrong(&field, problem));
            }
            return self
                .image(other, output.trim_start_matches("outputs:"))
                .map(|image| Some(Value::Image(image)));
        }
        let Some(property) = property(prim, &format!("inputs:{name}")) else { return Ok(None) };
        match &property.value {
            tree::Value::Numbers(numbers) if !numbers.is_empty() => Ok(Some(Value::Numbers(numbers.clone()))),
            other => {
                let field = format!("line {}", property.line);
                Err(self.wrong(&field, format!("expected numbers for {name}, found {other:?}")))
            }
        }
    }

    /// The picture of a texture, seen by one of its outputs.
    fn image(&self, texture: &Prim, output: &str) -> Result<Image, DocumentError> {
        let Some(file) = property(texture, "inputs:file") else {
            return Err(self.wrong(&texture.name, "the texture has no file".into()));
        };
        let field = format!("line {}", file.line);
        let tree::Value::Asset(name) = &file.value else {
            return Err(self.wrong(&field, "expected the name of a file between @".into()));
        };
        let plain = name.replace('\\', "/");
        if plain.contains('<') {
            return Err(self.wrong(&field, format!("`{name}` stands for several files; name one of them")));
        }
        let Some(path) = inside(self.path.parent().unwrap_or(Path::new("")), &plain) else {
            let problem = format!("`{name}` must be a file in the document's folder or below");
            return Err(self.wrong(&field, problem));
        };
        let colours = match property(texture, "inputs:sourceColorSpace") {
            Some(Property { value: tree::Value::Text(space), line, .. }) => Colours::named(space)
                .map_err(|problem| self.wrong(&format!("sourceColorSpace in line {line}"), problem))?,
            // What USD calls auto.
            _ if output == "rgb" => Colours::named("auto").unwrap_or(LINEAR),
            _ => LINEAR,
        };
        let numbers = |name: &str| match property(texture, name).map(|property| &property.value) {
            Some(tree::Value::Numbers(numbers)) if !numbers.is_empty() => Some(numbers.clone()),
            _ => None,
        };
        let channel = match output {
            "r" => Some(0),
            "g" => Some(1),
            "b" => Some(2),
            "a" => Some(3),
            _ => None,
        };
        let scale = numbers("inputs:scale").unwrap_or_else(|| vec![1.0]);
        let bias = numbers("inputs:bias").unwrap_or_else(|| vec![0.0]);
        let of = |numbers: &[f32]| {
            let at = |c: usize| *numbers.get(c).or(numbers.first()).unwrap_or(&0.0);
            channel.map_or_else(|| std::array::from_fn(at), |channel| [at(channel); 3])
        };
        Ok(Image { file: path, colours, channel, factor: of(&scale), bias: of(&bias), note: None })
    }
}

struct Reader<'a, 't, 's> {
    scene: &'a Scene<'t>,
    surface: &'t Prim,
    inputs: Inputs<'a, 's>,
}

impl Reader<'_, '_, '_> {
    fn value(&self, name: &str) -> Result<Option<Value>, DocumentError> {
        self.scene.value(self.surface, name, DEEPEST)
    }

    fn single(&mut self, name: &str, default: f32) -> Result<Field, DocumentError> {
        let value = self.value(name)?;
        self.inputs.single(name, value, default)
    }

    fn colour(&mut self, name: &str, default: f32) -> Result<[Field; 3], DocumentError> {
        let value = self.value(name)?;
        self.inputs.colour(name, value, [default; 3])
    }

    fn number(&mut self, name: &str, default: f32) -> Result<f32, DocumentError> {
        let value = self.value(name)?;
        self.inputs.number(name, value, default)
    }

    fn layers(&mut self) -> Result<Layers, DocumentError> {
        let base = self.colour("diffuseColor", 0.18)?;
        let roughness = self.single("roughness", 0.5)?;
        let ior = self.number("ior", 1.5)?;
        let kind = if self.number("useSpecularWorkflow", 0.0)? != 0.0 {
            PbrWorkflow::Specular { f0: self.colour("specularColor", 0.0)?, gloss: roughness.inverted() }
        } else {
            let f0 = [dielectric(ior); 3].map(Field::Constant);
            PbrWorkflow::Metallic {
                roughness,
                metal: self.single("metallic", 0.0)?,
                f0,
                level: Field::Constant(1.0),
            }
        };
        let weight = self.single("clearcoat", 0.0)?;
        let coat = match weight == Field::Constant(0.0) {
            true => None,
            false => Some(CoatLayer {
                weight,
                roughness: self.single("clearcoatRoughness", 0.01)?,
                f0: dielectric(1.5),
            }),
        };
        let normal = match self.value("normal")? {
            // What scales normals to -1 to 1 is no factor on their slopes.
            Some(Value::Image(image)) => {
                Some(Value::Image(Image { factor: [1.0; 3], bias: [0.0; 3], ..image }))
            }
            other => other,
        };
        let variance = self.inputs.normal("normal", normal, base[0].size())?;
        Ok(Layers { base, kind, variance, coat })
    }
}

#[cfg(test)]
mod tests;
