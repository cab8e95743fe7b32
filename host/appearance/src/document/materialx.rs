//! MaterialX: one material of a `.mtlx` file as a document, with the pictures that its inputs are connected to.
//!
//! Problem: material libraries hand out `.mtlx` files whose shaders have dozens of inputs, most of which no ink can show.
//! Method: of `standard_surface`, `open_pbr_surface`, `gltf_pbr` and `UsdPreviewSurface` the inputs of base, metal,
//! specular lobe, coat and normal are read, each a number or a picture ([`graph`]); the other inputs that are set are named in a
//! note. Cost: the file as a tree, at most [`MOST_NODES`] nodes. Limits: no node definitions, no includes, no procedures: an input
//! that is read and is more than a picture with factors is an error.
//! Source: MaterialX specification 1.39; OpenPBR Surface 1.1; Autodesk Standard Surface 1.0.1.

mod graph;

use std::path::Path;

use roxmltree::{Node, ParsingOptions};

use super::content::{Content, Document, Options, SWATCH_MM};
use super::error::DocumentError;
use super::inputs::{Inputs, Value};
use super::source::Source;
use super::texture::Field;
use super::texture::layers::{CoatLayer, Layers, PbrWorkflow, build};
use crate::brdf::Space;
use crate::materials::dielectric;

use graph::{Graph, Link, MOST_NODES};

/// The largest file: far more than any graph; pictures lie beside it, and this is held in memory as a tree.
const MOST_TEXT: u64 = 16 << 20;

/// The inputs of a shader that are read: their names, and their values where they are not set.
struct Shader {
    kind: &'static str,
    weight: Option<(&'static str, f32)>,
    colour: (&'static str, f32),
    metal: (&'static str, f32),
    roughness: (&'static str, f32),
    level: Option<(&'static str, f32)>,
    tint: Option<&'static str>,
    ior: &'static str,
    coat: (&'static str, f32),
    coat_roughness: (&'static str, f32),
    coat_ior: Option<(&'static str, f32)>,
    normal: &'static str,
}

const SHADERS: [Shader; 4] = [
    Shader {
        kind: "standard_surface",
        weight: Some(("base", 1.0)),
        colour: ("base_color", 0.8),
        metal: ("metalness", 0.0),
        roughness: ("specular_roughness", 0.2),
        level: Some(("specular", 1.0)),
        tint: Some("specular_color"),
        ior: "specular_IOR",
        coat: ("coat", 0.0),
        coat_roughness: ("coat_roughness", 0.1),
        coat_ior: Some(("coat_IOR", 1.5)),
        normal: "normal",
    },
    Shader {
        kind: "open_pbr_surface",
        weight: Some(("base_weight", 1.0)),
        colour: ("base_color", 0.8),
        metal: ("base_metalness", 0.0),
        roughness: ("specular_roughness", 0.3),
        level: Some(("specular_weight", 1.0)),
        tint: Some("specular_color"),
        ior: "specular_ior",
        coat: ("coat_weight", 0.0),
        coat_roughness: ("coat_roughness", 0.0),
        coat_ior: Some(("coat_ior", 1.6)),
        normal: "geometry_normal",
    },
    Shader {
        kind: "gltf_pbr",
        weight: None,
        colour: ("base_color", 1.0),
        metal: ("metallic", 1.0),
        roughness: ("roughness", 1.0),
        level: Some(("specular", 1.0)),
        tint: Some("specular_color"),
        ior: "ior",
        coat: ("clearcoat", 0.0),
        coat_roughness: ("clearcoat_roughness", 0.0),
        coat_ior: None,
        normal: "normal",
    },
    Shader {
        kind: "UsdPreviewSurface",
        weight: None,
        colour: ("diffuseColor", 0.18),
        metal: ("metallic", 0.0),
        roughness: ("roughness", 0.5),
        level: None,
        tint: None,
        ior: "ior",
        coat: ("clearcoat", 0.0),
        coat_roughness: ("clearcoatRoughness", 0.01),
        coat_ior: None,
        normal: "normal",
    },
];

impl Shader {
    fn reads(&self, name: &str) -> bool {
        let optional = [self.weight, self.level, self.coat_ior].into_iter().flatten().map(|(name, _)| name);
        [
            self.colour.0,
            self.metal.0,
            self.roughness.0,
            self.ior,
            self.coat.0,
            self.coat_roughness.0,
            self.normal,
        ]
        .into_iter()
        .chain(optional)
        .chain(self.tint)
        .any(|read| read == name)
    }
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
    let text = std::str::from_utf8(&bytes).map_err(|error| wrong("XML", error.to_string()))?;
    let parsing = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let tree = roxmltree::Document::parse_with_options(text, parsing)
        .map_err(|error| wrong("XML", error.to_string()))?;
    let root = tree.root_element();
    if !root.has_tag_name("materialx") {
        return Err(wrong(
            "XML",
            format!("expected a <materialx> document, found <{}>", root.tag_name().name()),
        ));
    }
    let graph = Graph { root, path };
    let (name, surface) = choose(&graph, options.material.as_deref())?;
    let kind = surface.tag_name().name();
    let Some(shader) = SHADERS.iter().find(|shader| shader.kind == kind) else {
        let known: Vec<&str> = SHADERS.iter().map(|shader| shader.kind).collect();
        return Err(wrong(
            &name,
            format!("the shader {kind} is not read; expected one of {}", known.join(", ")),
        ));
    };
    let inputs = || surface.children().filter(|node| node.has_tag_name("input"));
    let unread: Vec<&str> =
        inputs().filter(|input| is_set(input)).filter_map(|input| input.attribute("name")).collect();
    let unread: Vec<&str> = unread.into_iter().filter(|name| !shader.reads(name)).collect();
    if !unread.is_empty() {
        source.note(format!("{}: inputs that are not printed: {}", path.display(), unread.join(", ")));
    }
    source.observer.begin("reading", inputs().filter(|input| !input.has_attribute("value")).count() as u64);
    let mut reader = Reader { graph: &graph, surface, inputs: Inputs { path, source: &mut source } };
    let layers = reader.layers(shader)?;
    let (surfaces, textured) = build(layers, path, space, &mut source)?;
    source.observer.end();
    let name = if name.is_empty() { source.name_of(path) } else { name };
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

/// Whether an input is connected, or has a number other than 0.
fn is_set(input: &Node<'_, '_>) -> bool {
    input
        .attribute("value")
        .is_none_or(|value| graph::numbers(value).is_none_or(|v| v.iter().any(|&v| v != 0.0)))
}

/// The shader of the requested material, by number or name; by default the only one.
fn choose<'d>(graph: &Graph<'d, '_>, asked: Option<&str>) -> Result<(String, Node<'d, 'd>), DocumentError> {
    let of_kind = |kind: &str| -> Vec<Node<'d, 'd>> {
        graph
            .root
            .children()
            .filter(|node| node.is_element() && node.attribute("type") == Some(kind))
            .collect()
    };
    let mut found = of_kind("material");
    let shaders = found.is_empty();
    if shaders {
        found = of_kind("surfaceshader");
    }
    let name = |node: &Node<'_, '_>| node.attribute("name").unwrap_or_default().to_owned();
    let fail = |problem: String| DocumentError::Choice {
        path: graph.path.to_path_buf(),
        problem,
        materials: found.iter().enumerate().map(|(i, node)| format!("{i} ({})", name(node))).collect(),
    };
    let chosen = match (asked, &found[..]) {
        (_, []) => return Err(graph.wrong("materials", "the file has no material".into())),
        (None, [one]) => *one,
        (None, several) => return Err(fail(format!("the file has {} materials", several.len()))),
        (Some(asked), all) => {
            let numbered = asked.parse::<usize>().ok().and_then(|number| all.get(number));
            let named = all.iter().find(|node| node.attribute("name") == Some(asked));
            match numbered.or(named) {
                Some(node) => *node,
                None => return Err(fail(format!("there is no material `{asked}`"))),
            }
        }
    };
    if shaders {
        return Ok((name(&chosen), chosen));
    }
    let input = graph::input(&chosen, "surfaceshader")
        .ok_or_else(|| graph.wrong(&name(&chosen), "the material has no surfaceshader".into()))?;
    match graph.link(&input)? {
        Link::Node(surface, _) => Ok((name(&chosen), surface)),
        Link::Value(_) => Err(graph.wrong(&name(&chosen), "its surfaceshader is not connected".into())),
    }
}

struct Reader<'a, 'd, 's> {
    graph: &'a Graph<'d, 'a>,
    surface: Node<'d, 'd>,
    inputs: Inputs<'a, 's>,
}

impl Reader<'_, '_, '_> {
    fn value(&self, name: &str) -> Result<Option<Value>, DocumentError> {
        graph::input(&self.surface, name).map(|input| self.graph.value(&input)).transpose()
    }

    fn single(&mut self, (name, default): (&str, f32)) -> Result<Field, DocumentError> {
        let value = self.value(name)?;
        self.inputs.single(name, value, default)
    }

    fn colour(&mut self, name: &str, default: f32) -> Result<[Field; 3], DocumentError> {
        let value = self.value(name)?;
        self.inputs.colour(name, value, [default; 3])
    }

    fn number(&mut self, (name, default): (&str, f32)) -> Result<f32, DocumentError> {
        let value = self.value(name)?;
        self.inputs.number(name, value, default)
    }

    fn layers(&mut self, shader: &Shader) -> Result<Layers, DocumentError> {
        let weight = shader.weight.map_or(Ok(1.0), |input| self.number(input))?;
        let base = self.colour(shader.colour.0, shader.colour.1)?.map(|field| field.times(weight));
        let metal = self.single(shader.metal)?;
        let roughness = self.single(shader.roughness)?;
        let level = shader.level.map_or(Ok(Field::Constant(1.0)), |input| self.single(input))?;
        let plain = dielectric(self.number((shader.ior, 1.5))?);
        let f0 = match shader.tint {
            Some(name) => self.colour(name, 1.0)?.map(|field| field.times(plain)),
            None => [plain; 3].map(Field::Constant),
        };
        let coat = self.coat(shader)?;
        let normal = self.value(shader.normal)?;
        let variance = self.inputs.normal(shader.normal, normal, base[0].size())?;
        Ok(Layers { base, kind: PbrWorkflow::Metallic { roughness, metal, f0, level }, variance, coat })
    }

    fn coat(&mut self, shader: &Shader) -> Result<Option<CoatLayer>, DocumentError> {
        let weight = self.single(shader.coat)?;
        if weight == Field::Constant(0.0) {
            return Ok(None);
        }
        let roughness = self.single(shader.coat_roughness)?;
        let ior = shader.coat_ior.map_or(Ok(1.5), |input| self.number(input))?;
        Ok(Some(CoatLayer { weight, roughness, f0: dielectric(ior) }))
    }
}

#[cfg(test)]
mod tests;
