//! What an input of a MaterialX shader is connected to: numbers, or a picture.
//!
//! Method: connections are followed from the input to a picture, through graphs, conversions, single channels and factors.
//! A file's name is put together from the prefixes of the elements around it, and must stay in the document's folder; its colour
//! space is that of the nearest element that states one ([`Colours`]). Limits: nodes that compute anything else are errors, chains end after
//! [`DEEPEST`] steps.

use std::path::Path;

use files::shelf::inside;
use roxmltree::Node;

use crate::document::colours::{Colours, LINEAR};
use crate::document::error::DocumentError;
use crate::document::inputs::{Image, Value};

/// The most nodes of the document's tree: far more than any graph of materials, few enough for hostile files.
pub(super) const MOST_NODES: u32 = 200_000;

/// The most steps from an input to its picture, so that a graph that refers to itself ends.
const DEEPEST: usize = 32;

/// A document and its place.
pub(super) struct Graph<'d, 'p> {
    pub(super) root: Node<'d, 'd>,
    pub(super) path: &'p Path,
}

/// What an input is connected to.
pub(super) enum Link<'d> {
    /// A value in the document.
    Value(Node<'d, 'd>),
    /// A node, and which of its outputs.
    Node(Node<'d, 'd>, Option<&'d str>),
}

/// The numbers of a value; `None` if it holds anything else.
pub(super) fn numbers(text: &str) -> Option<Vec<f32>> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers.filter(|numbers| numbers.iter().all(|v| v.is_finite()))
}

/// The input of a node with this name.
pub(super) fn input<'d>(node: &Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    node.children().find(|child| child.has_tag_name("input") && child.attribute("name") == Some(name))
}

impl<'d> Graph<'d, '_> {
    pub(super) fn wrong(&self, field: &str, problem: String) -> DocumentError {
        DocumentError::Field { path: self.path.to_path_buf(), field: field.into(), problem }
    }

    /// Follows one connection.
    pub(super) fn link(&self, input: &Node<'d, 'd>) -> Result<Link<'d>, DocumentError> {
        let name = input.attribute("name").unwrap_or("input");
        let among = |parent: Node<'d, 'd>, wanted: &str| {
            parent.children().find(|node| node.is_element() && node.attribute("name") == Some(wanted))
        };
        let missing =
            |wanted: &str| self.wrong(name, format!("`{wanted}`, to which it is connected, does not exist"));
        // The scope of a connection is the graph around the node that has the input, or around an output.
        let owner = input.parent_element().unwrap_or(self.root);
        let scope =
            if input.has_tag_name("output") { owner } else { owner.parent_element().unwrap_or(self.root) };
        if let Some(wanted) = input.attribute("interfacename") {
            let outer = among(scope, wanted).filter(|node| node.has_tag_name("input"));
            return self.follow(&outer.ok_or_else(|| missing(wanted))?);
        }
        if let Some(wanted) = input.attribute("nodegraph") {
            let graph = among(self.root, wanted).ok_or_else(|| missing(wanted))?;
            let mut outputs = graph.children().filter(|node| node.has_tag_name("output"));
            let output = match input.attribute("output") {
                Some(wanted) => outputs.find(|node| node.attribute("name") == Some(wanted)),
                None => outputs.next(),
            };
            return self.link(&output.ok_or_else(|| missing(wanted))?);
        }
        if let Some(wanted) = input.attribute("nodename") {
            let node = among(scope, wanted).or_else(|| among(self.root, wanted));
            return Ok(Link::Node(node.ok_or_else(|| missing(wanted))?, input.attribute("output")));
        }
        Ok(Link::Value(*input))
    }

    /// The input of a graph: its own value, or what it is connected to outside.
    fn follow(&self, outer: &Node<'d, 'd>) -> Result<Link<'d>, DocumentError> {
        if outer.has_attribute("value") { Ok(Link::Value(*outer)) } else { self.link(outer) }
    }

    /// What an input is in the end.
    pub(super) fn value(&self, input: &Node<'d, 'd>) -> Result<Value, DocumentError> {
        self.resolve(input, DEEPEST)
    }

    fn resolve(&self, at: &Node<'d, 'd>, steps: usize) -> Result<Value, DocumentError> {
        let name = at.attribute("name").unwrap_or("input").to_owned();
        let Some(steps) = steps.checked_sub(1) else {
            return Err(self.wrong(&name, format!("no picture after {DEEPEST} connections")));
        };
        let (node, output) = match self.link(at)? {
            Link::Node(node, output) => (node, output),
            Link::Value(of) => {
                let text = of.attribute("value").unwrap_or_default();
                let numbers = numbers(text)
                    .ok_or_else(|| self.wrong(&name, format!("expected numbers, found `{text}`")))?;
                let encoded = of.attribute("type").is_some_and(|kind| kind.starts_with("color"));
                return Ok(Value::Numbers(match encoded {
                    true => self.colours(&of, None)?.linear(&numbers),
                    false => numbers,
                }));
            }
        };
        let kind = node.tag_name().name();
        let place = node.attribute("name").unwrap_or(kind);
        let inner = |name: &str| match input(&node, name) {
            Some(input) => self.resolve(&input, steps),
            None => Err(self.wrong(place, format!("the node {kind} has no input `{name}`"))),
        };
        // One channel of what a node gets.
        let single = |value: Value, channel: usize| match value {
            Value::Numbers(numbers) => Value::Numbers(vec![*numbers.get(channel).unwrap_or(&numbers[0])]),
            Value::Image(image) => Value::Image(Image { channel: Some(channel), ..image }),
        };
        let letter = |letter: Option<char>| match letter {
            Some('r' | 'x') => Ok(0),
            Some('g' | 'y') => Ok(1),
            Some('b' | 'z') => Ok(2),
            Some('a' | 'w') => Ok(3),
            _ => Err(self.wrong(place, "expected one of the channels r, g, b, a".into())),
        };
        match kind {
            "image" | "tiledimage" | "gltf_image" | "gltf_colorimage" | "UsdUVTexture" => {
                let image = Value::Image(self.image(&node, place)?);
                Ok(match output {
                    None | Some("out" | "rgb" | "outcolor") => image,
                    Some("outa") => single(image, 3),
                    Some(one) => single(image, letter(one.chars().last())?),
                })
            }
            "constant" => inner("value"),
            "convert" | "dot" | "normalmap" | "gltf_normalmap" => inner("in"),
            "extract" => {
                let index = input(&node, "index").and_then(|index| index.attribute("value")?.trim().parse().ok());
                Ok(single(inner("in")?, index.unwrap_or(0).min(3)))
            }
            "swizzle" => {
                let channels = input(&node, "channels").and_then(|input| input.attribute("value")).unwrap_or("");
                match channels.len() {
                    1 => Ok(single(inner("in")?, letter(channels.chars().next())?)),
                    _ if "rgba".starts_with(channels) || "xyzw".starts_with(channels) => inner("in"),
                    _ => Err(self.wrong(place, format!("the order of channels `{channels}` is not read"))),
                }
            }
            "separate2" | "separate3" | "separate4" => {
                Ok(single(inner("in")?, letter(output.and_then(|output| output.chars().last()))?))
            }
            "multiply" => match (inner("in1")?, inner("in2")?) {
                (Value::Image(mut image), Value::Numbers(by)) | (Value::Numbers(by), Value::Image(mut image)) => {
                    (0..3).for_each(|c| image.factor[c] *= by.get(c).unwrap_or(&by[0]));
                    Ok(Value::Image(image))
                }
                (Value::Numbers(a), Value::Numbers(b)) => {
                    let most = a.len().max(b.len());
                    let at = |of: &[f32], i: usize| *of.get(i).unwrap_or(&of[0]);
                    Ok(Value::Numbers((0..most).map(|i| at(&a, i) * at(&b, i)).collect()))
                }
                _ => Err(self.wrong(place, "a product of two pictures is not read; bake it to one".into())),
            },
            other => Err(self.wrong(
                &name,
                format!("it comes from the node `{place}` ({other}), which is not read; bake the material to pictures"),
            )),
        }
    }

    fn image(&self, node: &Node<'d, 'd>, place: &str) -> Result<Image, DocumentError> {
        let Some(file) = input(node, "file") else {
            return Err(self.wrong(place, "the picture has no file".into()));
        };
        let file = match self.link(&file)? {
            Link::Value(value) => value,
            Link::Node(..) => return Err(self.wrong(place, "the name of its file is computed".into())),
        };
        let value = file.attribute("value").unwrap_or_default();
        // The outermost prefix comes first.
        let prefixes: Vec<&str> = file.ancestors().filter_map(|node| node.attribute("fileprefix")).collect();
        let name: String = prefixes.into_iter().rev().chain([value]).collect();
        let name = name.replace('\\', "/");
        if name.contains(['<', '{']) {
            return Err(self.wrong(place, format!("`{name}` stands for several files; name one of them")));
        }
        let Some(path) = inside(self.path.parent().unwrap_or(Path::new("")), &name) else {
            return Err(
                self.wrong(place, format!("`{name}` must be a file in the document's folder or below"))
            );
        };
        let moved = ["uvtiling", "uvoffset", "realworldimagesize", "scale", "rotation"].iter().any(|&name| {
            let value = input(node, name).and_then(|input| numbers(input.attribute("value")?));
            let still = if name.contains("tiling") || name == "scale" { 1.0 } else { 0.0 };
            value.is_some_and(|value| value.iter().any(|&v| v != still)) && name != "realworldimagesize"
        });
        let note = moved.then(|| {
            format!("{place}: the picture is printed once, as it is stored; its placement is ignored")
        });
        let stated = input(node, "sourceColorSpace").and_then(|input| input.attribute("value"));
        let colours = self.colours(&file, stated)?;
        Ok(Image { file: path, colours, channel: None, factor: [1.0; 3], bias: [0.0; 3], note })
    }

    /// The colour space that holds for a value: its own, or that of the nearest element around it.
    fn colours(&self, value: &Node<'d, 'd>, stated: Option<&str>) -> Result<Colours, DocumentError> {
        let around = || value.ancestors().find_map(|node| node.attribute("colorspace"));
        let Some(name) = stated.or_else(around).filter(|name| !name.is_empty()) else { return Ok(LINEAR) };
        let line = value.document().text_pos_at(value.range().start).row;
        Colours::named(name).map_err(|problem| self.wrong(&format!("colorspace in line {line}"), problem))
    }
}
