//! A folder of texture maps as a document.
//!
//! Base colour with roughness and metallic (apart, or packed as occlusion-roughness-metallic), or diffuse with
//! specular and glossiness; a normal map folds into roughness ([`super::relief`]). Files are found by name
//! ([`super::names`]) or named in [`SETTINGS`]. All maps are brought to the size of the base colour. Nothing is taken
//! silently: the notes say which encoding was assumed, what was resized, what was left out.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::DocumentError;
use super::names::{self, Role};
use super::picture::Picture;
use super::relief;
use super::source::{MOST_BYTES, Source};
use super::surfaces::{Surfaces, dielectric, metallic, specular};
use super::texture::{Field, Plane, same_shape};
use super::{ColourSpace, Content, Document, Options, stem};
use crate::brdf::Space;

/// The optional settings file of a folder.
pub const SETTINGS: &str = "material.toml";

/// The most directory entries looked at.
const MOST_FILES: usize = 10_000;

/// Which numbers the maps hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Workflow {
    /// Base colour, roughness, metallic.
    MetallicRoughness,
    /// Diffuse colour, specular colour, glossiness.
    SpecularGlossiness,
}

/// What `material.toml` may say. Everything is optional; unknown keys are errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// What to call the document.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Width and height on paper in millimetres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_mm: Option<[f64; 2]>,
    /// Encoding of the colour maps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour_space: Option<ColourSpace>,
    /// Which numbers the maps hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workflow: Option<Workflow>,
    /// Roughness where there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
    /// Metallic where there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f32>,
    /// Which files to read, where names do not tell.
    #[serde(default, skip_serializing_if = "MapNames::is_empty")]
    pub maps: MapNames,
}

/// The `[maps]` of `material.toml`: file names within the folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names are the roles of `names::Role`")]
pub struct MapNames {
    #[serde(alias = "base_colour", alias = "diffuse", skip_serializing_if = "Option::is_none")]
    pub base_color: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion_roughness_metallic: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glossiness: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<String>,
}

impl MapNames {
    fn is_empty(&self) -> bool {
        *self == MapNames::default()
    }

    fn named(&self) -> impl Iterator<Item = (Role, &str)> {
        [
            (Role::BaseColor, &self.base_color),
            (Role::Roughness, &self.roughness),
            (Role::Metallic, &self.metallic),
            (Role::Packed, &self.occlusion_roughness_metallic),
            (Role::Specular, &self.specular),
            (Role::Glossiness, &self.glossiness),
            (Role::Normal, &self.normal),
        ]
        .into_iter()
        .filter_map(|(role, name)| Some((role, name.as_deref()?)))
    }
}

/// The files of a folder that play a role, with what is needed to complain about them.
struct Files {
    folder: PathBuf,
    seen: Vec<String>,
    by_role: Vec<(Role, String)>,
}

impl Files {
    fn find(folder: &Path, settings: &Settings, source: &mut Source<'_>) -> Result<Files, DocumentError> {
        let io = |source| DocumentError::Io { path: folder.to_path_buf(), attempt: "list", source };
        let (mut seen, mut foreign) = (Vec::new(), Vec::new());
        for entry in std::fs::read_dir(folder).map_err(io)?.take(MOST_FILES) {
            let name = entry.map_err(io)?.file_name().to_string_lossy().into_owned();
            if name.starts_with('.') {
                continue;
            }
            if is_picture(&name) {
                seen.push(name);
            } else if is_foreign_picture(&name) {
                foreign.push(name);
            }
        }
        seen.sort();
        if !foreign.is_empty() {
            foreign.sort();
            source.note(format!(
                "not read: {}; save maps as PNG, JPEG, TIFF, OpenEXR or Radiance HDR",
                super::error::list(&foreign)
            ));
        }
        let stems: Vec<&str> =
            seen.iter().map(|name| name.rsplit_once('.').map_or(&name[..], |(s, _)| s)).collect();
        let roles = names::roles(&stems);
        let mut files = Files { folder: folder.to_path_buf(), seen: seen.clone(), by_role: Vec::new() };
        for (role, name) in settings.maps.named() {
            if Path::new(name).components().count() != 1 || name.contains(['/', '\\']) || name == ".." {
                return Err(DocumentError::Settings {
                    path: folder.join(SETTINGS),
                    problem: format!("maps: `{name}` must be the name of a file in the same folder"),
                });
            }
            files.by_role.push((role, name.to_string()));
        }
        for (name, role) in seen.iter().zip(roles) {
            if let Some(role) = role
                && settings.maps.named().all(|(named, _)| named != role)
            {
                files.by_role.push((role, name.clone()));
            }
        }
        files.choose_normal(source);
        Ok(files)
    }

    /// Two handednesses of one normal map are the same map to us.
    fn choose_normal(&mut self, source: &mut Source<'_>) {
        let normals = self.all(Role::Normal);
        if normals.len() == 2 {
            let direct = |name: &str| {
                let name = name.to_ascii_lowercase();
                name.contains("dx") || name.contains("directx")
            };
            let drop = match (direct(&normals[0]), direct(&normals[1])) {
                (true, false) => normals[0].clone(),
                (false, true) => normals[1].clone(),
                _ => return,
            };
            self.by_role.retain(|(_, name)| *name != drop);
            source.note(format!("{drop}: the same normals again in the other convention; not read"));
        }
    }

    fn all(&self, role: Role) -> Vec<String> {
        self.by_role.iter().filter(|(r, _)| *r == role).map(|(_, name)| name.clone()).collect()
    }

    fn error(&self, problem: String) -> DocumentError {
        DocumentError::Maps { folder: self.folder.clone(), problem, seen: self.seen.clone() }
    }

    /// The one file of a role, if there is one.
    fn one(&self, role: Role) -> Result<Option<String>, DocumentError> {
        match &self.all(role)[..] {
            [] => Ok(None),
            [name] => Ok(Some(name.clone())),
            several => Err(self.error(format!(
                "{} could each be the {} map; name one in [maps] of {SETTINGS}",
                several.join(" and "),
                role.name()
            ))),
        }
    }
}

fn is_picture(name: &str) -> bool {
    has_extension(name, &["png", "jpg", "jpeg", "tif", "tiff", "exr", "hdr", "rgbe"])
}

/// Pictures by their name that no decoder here reads.
fn is_foreign_picture(name: &str) -> bool {
    has_extension(
        name,
        &["tga", "webp", "bmp", "gif", "dds", "psd", "ktx2", "avif", "heic", "jxl", "jp2", "svg", "tx"],
    )
}

fn has_extension(name: &str, kinds: &[&str]) -> bool {
    name.rsplit_once('.').is_some_and(|(_, kind)| kinds.contains(&kind.to_ascii_lowercase().as_str()))
}

/// Reads `material.toml`, if the folder has one.
fn settings(folder: &Path, source: &mut Source<'_>) -> Result<Settings, DocumentError> {
    let path = folder.join(SETTINGS);
    if !path.is_file() {
        return Ok(Settings::default());
    }
    let text = source.read_text(&path)?;
    let wrong = |problem: String| DocumentError::Settings { path: path.clone(), problem };
    let settings: Settings = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    if let Some(size) = settings.size_mm {
        check_size_mm(size).map_err(wrong)?;
    }
    for (key, value) in [("roughness", settings.roughness), ("metallic", settings.metallic)] {
        if let Some(value) = value
            && !(0.0..=1.0).contains(&value)
        {
            return Err(wrong(format!("{key} = {value}: expected a number from 0 to 1")));
        }
    }
    Ok(settings)
}

/// Whether a size can be meant: from a dot to 10 metres.
pub(super) fn check_size_mm(size: [f64; 2]) -> Result<(), String> {
    match size.iter().find(|mm| !(0.04..=10_000.0).contains(*mm)) {
        Some(mm) => Err(format!("size_mm: {mm} is no length on paper; expected 0.04 to 10000 millimetres")),
        None => Ok(()),
    }
}

struct Reader<'a, 'b> {
    files: Files,
    source: &'a mut Source<'b>,
    /// The size everything is brought to.
    size: (usize, usize),
}

impl Reader<'_, '_> {
    fn picture(&mut self, name: &str) -> Result<Picture, DocumentError> {
        let path = self.files.folder.join(name);
        let bytes = self.source.read(&path, MOST_BYTES)?;
        let picture = Picture::decode(&bytes, &path, self.source)?;
        self.source.observer.advance(1);
        Ok(picture)
    }

    fn fit(&mut self, plane: Plane, name: &str) -> Result<Plane, DocumentError> {
        let found = (plane.width(), plane.height());
        if found == self.size {
            return Ok(plane);
        }
        if !same_shape(found, self.size) {
            return Err(self.files.error(format!(
                "{name} is {} x {} pixels, but the base colour is {} x {}: maps of one material need one shape",
                found.0, found.1, self.size.0, self.size.1
            )));
        }
        self.source.note(format!(
            "{name}: resized from {} x {} to {} x {} pixels, the size of the base colour",
            found.0, found.1, self.size.0, self.size.1
        ));
        Ok(plane.resized(self.size.0, self.size.1))
    }

    /// One channel as data.
    fn data(&mut self, name: &str, picture: &Picture, channel: usize) -> Result<Field, DocumentError> {
        let plane = picture.channel(channel);
        Ok(Field::Map(self.fit(plane, name)?))
    }

    /// A map of one number a pixel.
    fn single(&mut self, role: Role) -> Result<Option<Field>, DocumentError> {
        let Some(name) = self.files.one(role)? else { return Ok(None) };
        let picture = self.picture(&name)?;
        if picture.colours() == 3 {
            let (red, green) = (picture.channel(0), picture.channel(1));
            let apart = red.data().iter().zip(green.data()).any(|(a, b)| (a - b).abs() > 0.02);
            if apart {
                return Err(DocumentError::Picture {
                    path: self.files.folder.join(&name),
                    problem: format!(
                        "expected one {} value a pixel, found colours; if it is packed, name it \
                         occlusion_roughness_metallic",
                        role.name()
                    ),
                });
            }
        }
        self.data(&name, &picture, 0).map(Some)
    }

    /// A colour map as linear fields.
    fn colour(
        &mut self,
        name: &str,
        picture: &Picture,
        space: ColourSpace,
    ) -> Result<[Field; 3], DocumentError> {
        if picture.has_foreign_profile() {
            self.source.note(format!("{name}: its colour profile is not applied"));
        }
        let planes = picture.linear(space);
        let outside = planes.iter().any(|plane| plane.data().iter().any(|v| !(0.0..=1.0).contains(v)));
        if outside {
            self.source.note(format!("{name}: colours outside 0 to 1 are clamped; they are reflectances"));
        }
        let [r, g, b] = planes;
        Ok([Field::Map(self.fit(r, name)?), Field::Map(self.fit(g, name)?), Field::Map(self.fit(b, name)?)])
    }
}

/// Opens a folder of maps. See the module text.
pub(super) fn open(
    folder: &Path,
    options: &Options,
    space: Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let settings = settings(folder, &mut source)?;
    let files = Files::find(folder, &settings, &mut source)?;
    let Some(base_name) = files.one(Role::BaseColor)? else {
        return Err(files.error(format!(
            "no base colour map; expected a name such as base_color, albedo or diffuse, or [maps] in {SETTINGS}"
        )));
    };
    let maps = files.by_role.iter().filter(|(role, _)| *role != Role::Ignored).count();
    source.observer.begin("reading", maps as u64);

    let mut reader = Reader { files, source: &mut source, size: (0, 0) };
    let picture = reader.picture(&base_name)?;
    reader.size = (picture.width, picture.height);
    let chosen = options.colour_space.or(settings.colour_space);
    let encoding = |picture: &Picture| chosen.unwrap_or(picture.natural_space());
    let said = match (chosen.is_some(), encoding(&picture)) {
        (true, ColourSpace::Srgb) => "read as sRGB, as told".into(),
        (true, ColourSpace::Linear) => "read as linear, as told".into(),
        (false, ColourSpace::Srgb) => {
            format!(
                "colours of whole numbers are taken as sRGB; say colour_space in {SETTINGS} if they are linear"
            )
        }
        (false, ColourSpace::Linear) => {
            format!(
                "colours in floating point are taken as linear; say colour_space in {SETTINGS} if they are sRGB"
            )
        }
    };
    reader.source.note(format!("{base_name}: {said}; every other map but colours is linear data"));
    let base = reader.colour(&base_name, &picture, encoding(&picture))?;
    drop(picture);

    let variance = match reader.files.one(Role::Normal)? {
        None => None,
        Some(name) => Some(normal_variance(&mut reader, &name)?),
    };
    let workflow = match settings.workflow {
        Some(workflow) => workflow,
        None => workflow_of(&reader.files, &settings)?,
    };
    let (width, height) = reader.size;
    let rougher = |alpha: f32, pixel: usize| match &variance {
        None => alpha,
        Some(variance) => relief::widened(alpha, variance.at(pixel)),
    };
    let rgb = |fields: &[Field; 3], pixel: usize| -> [f32; 3] {
        std::array::from_fn(|c| fields[c].at(pixel).clamp(0.0, 1.0))
    };
    let surfaces = match workflow {
        Workflow::MetallicRoughness => {
            let (roughness, metal) = roughness_metallic(&mut reader, &settings)?;
            let f0 = [dielectric(1.5); 3];
            Surfaces::build(width, height, space, |i| {
                let metal = metal.at(i).clamp(0.0, 1.0);
                let mut surface = metallic(rgb(&base, i), f0, roughness.at(i).clamp(0.0, 1.0), metal);
                surface.alpha = rougher(surface.alpha, i);
                surface
            })
        }
        Workflow::SpecularGlossiness => {
            let (f0, gloss) = specular_glossiness(&mut reader, encoding)?;
            Surfaces::build(width, height, space, |i| {
                let mut surface = specular(rgb(&base, i), rgb(&f0, i), gloss.at(i).clamp(0.0, 1.0));
                surface.alpha = rougher(surface.alpha, i);
                surface
            })
        }
    };
    source.observer.end();
    let (notes, digest) = source.finish();
    Ok(Document {
        name: settings.name.unwrap_or_else(|| stem(folder)),
        content: Content::Surfaces(surfaces),
        size_mm: settings.size_mm.map(|[w, h]| (w, h)),
        notes,
        digest,
    })
}

/// Which workflow the maps found belong to.
fn workflow_of(files: &Files, settings: &Settings) -> Result<Workflow, DocumentError> {
    let has = |role| files.by_role.iter().any(|(r, _)| *r == role);
    let rough = has(Role::Roughness) || has(Role::Packed) || settings.roughness.is_some();
    match (rough, has(Role::Glossiness)) {
        (true, false) => Ok(Workflow::MetallicRoughness),
        (true, true) if has(Role::Metallic) || has(Role::Packed) => Ok(Workflow::MetallicRoughness),
        (true, true) => Err(files.error(format!(
            "both roughness and glossiness maps; say workflow = \"metallic-roughness\" or \"specular-glossiness\" \
             in {SETTINGS}"
        ))),
        (false, true) => Ok(Workflow::SpecularGlossiness),
        (false, false) => Err(files.error(format!(
            "no roughness map; expected a name such as roughness, occlusion_roughness_metallic or glossiness, or \
             `roughness = 0.5` in {SETTINGS}"
        ))),
    }
}

fn roughness_metallic(
    reader: &mut Reader<'_, '_>,
    settings: &Settings,
) -> Result<(Field, Field), DocumentError> {
    let mut roughness = reader.single(Role::Roughness)?;
    let mut metal = reader.single(Role::Metallic)?;
    if let Some(name) = reader.files.one(Role::Packed)? {
        if roughness.is_some() && metal.is_some() {
            reader.source.note(format!("{name}: not read, its channels are there as maps of their own"));
        } else {
            let picture = reader.picture(&name)?;
            if picture.colours() != 3 {
                return Err(DocumentError::Picture {
                    path: reader.files.folder.join(&name),
                    problem: "expected three channels (occlusion, roughness, metallic), found grey".into(),
                });
            }
            if roughness.is_none() {
                roughness = Some(reader.data(&name, &picture, 1)?);
            }
            if metal.is_none() {
                metal = Some(reader.data(&name, &picture, 2)?);
            }
        }
    }
    for role in [Role::Specular, Role::Glossiness] {
        if let Some(name) = reader.files.all(role).first() {
            reader.source.note(format!(
                "{name}: not read; with roughness the metallic workflow is meant (workflow in {SETTINGS} can say \
                 otherwise)"
            ));
        }
    }
    let Some(roughness) = roughness.or(settings.roughness.map(Field::Constant)) else {
        return Err(reader.files.error(format!("no roughness map, and no `roughness` in {SETTINGS}")));
    };
    let metal = metal.or(settings.metallic.map(Field::Constant)).unwrap_or_else(|| {
        reader.source.note("no metallic map: nothing is metal".into());
        Field::Constant(0.0)
    });
    Ok((roughness, metal))
}

fn specular_glossiness(
    reader: &mut Reader<'_, '_>,
    encoding: impl Fn(&Picture) -> ColourSpace,
) -> Result<([Field; 3], Field), DocumentError> {
    let gloss = match reader.single(Role::Glossiness)? {
        Some(gloss) => gloss,
        None => match reader.single(Role::Roughness)? {
            Some(Field::Map(roughness)) => Field::Map(roughness.map(|r| 1.0 - r)),
            Some(Field::Constant(roughness)) => Field::Constant(1.0 - roughness),
            None => {
                return Err(reader
                    .files
                    .error("no glossiness map for the specular-glossiness workflow".into()));
            }
        },
    };
    let f0 = match reader.files.one(Role::Specular)? {
        Some(name) => {
            let picture = reader.picture(&name)?;
            let encoding = encoding(&picture);
            reader.colour(&name, &picture, encoding)?
        }
        None => {
            reader.source.note("no specular map: normal-incidence reflectance is 0.04 everywhere".into());
            std::array::from_fn(|_| Field::Constant(dielectric(1.5)))
        }
    };
    Ok((f0, gloss))
}

/// The slope variance of a normal map at the size of the base colour. The window covers the same patch of the
/// document whatever the size of the normal map.
fn normal_variance(reader: &mut Reader<'_, '_>, name: &str) -> Result<Field, DocumentError> {
    let picture = reader.picture(name)?;
    if picture.colours() != 3 {
        return Err(DocumentError::Picture {
            path: reader.files.folder.join(name),
            problem: "expected the three components of normals, found grey".into(),
        });
    }
    let scale = picture.width as f64 / reader.size.0 as f64;
    let radius = (scale * (relief::WINDOW / 2) as f64).round().clamp(1.0, 256.0) as usize;
    let variance = relief::slope_variance(&picture.channel(0), &picture.channel(1), 1.0, radius);
    reader.source.note(relief_note(name));
    Ok(Field::Map(reader.fit(variance, name)?))
}

/// What the user is told about a normal map.
pub(super) fn relief_note(name: &str) -> String {
    format!(
        "{name}: paper is flat; bumps within {} pixels are printed as roughness, larger relief is lost",
        relief::WINDOW
    )
}

#[cfg(test)]
mod tests;
