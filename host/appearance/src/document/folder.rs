//! A folder of texture maps as a document.
//!
//! The maps are base colour, roughness and metallic (separate, or packed as occlusion-roughness-metallic or
//! metallic-smoothness), or diffuse, specular and glossiness; a normal map adds to roughness
//! ([`super::relief`]), and a clear coat lies over either. Files are recognised by name ([`super::names`])
//! or listed in [`SETTINGS`]. All maps are resized to the base colour. The notes report which encoding was
//! assumed, what was resized and what was left out.

mod files;
mod locate;
mod settings;

use std::path::Path;

use super::content::MOST_BYTES;
use super::content::{Content, Document, Options};
use super::error::DocumentError;
use super::names::{self, Role};
use super::picture::{Encoding, Picture};
use super::relief;
use super::source::Source;
use super::texture::layers::CoatLayer;
use super::texture::{Field, Plane, same_shape};
use crate::brdf::Space;
use crate::materials::{Surface, Surfaces, dielectric, metallic, specular};

use files::Files;
pub(super) use locate::{Found, locate};
pub(super) use settings::{FolderSettings, SETTINGS, Workflow};

struct Reader<'a, 'b> {
    files: Files,
    source: &'a mut Source<'b>,
    /// The common size of all maps.
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
                "{name} is {} x {} pixels, but the base colour is {} x {}; all maps need the same proportions",
                found.0, found.1, self.size.0, self.size.1
            )));
        }
        self.source.note(format!(
            "{name}: resized from {} x {} to {} x {} pixels, the size of the base colour",
            found.0, found.1, self.size.0, self.size.1
        ));
        Ok(plane.resized(self.size.0, self.size.1))
    }

    /// A picture whose alpha is smoothness.
    fn smooth(&mut self, name: &str) -> Result<Picture, DocumentError> {
        let path = self.files.folder.join(name);
        let bytes = self.source.read(&path, MOST_BYTES)?;
        let picture = Picture::decode_with_alpha(&bytes, &path, self.source)?;
        if !picture.has_alpha() {
            let problem = "expected smoothness in the alpha channel, found no alpha; a map of its own is named \
                           glossiness or roughness";
            return Err(DocumentError::Picture { path, problem: problem.into() });
        }
        self.source.note(format!("{name}: alpha is read as smoothness (roughness = 1 - alpha)"));
        self.source.observer.advance(1);
        Ok(picture)
    }

    /// One channel as data, which are 0 to 1.
    fn data(&mut self, name: &str, picture: &Picture, channel: usize) -> Result<Field, DocumentError> {
        /// By how much a sharp step may overshoot when a map was resized: Gibbs' phenomenon adds 9 %.
        const OVERSHOOT: f32 = 0.1;
        let plane = picture.channel(channel);
        if let Some((at, by)) = plane.outside() {
            if by > OVERSHOOT {
                let (x, y, value) = (at % picture.width, at / picture.width, plane.at(at));
                return Err(DocumentError::Picture {
                    path: self.files.folder.join(name),
                    problem: format!(
                        "pixel ({x}, {y}) is {value}; roughness, metallic and the like are 0 to 1 (divide a map of 0 \
                         to 255 by 255)"
                    ),
                });
            }
            self.source
                .note(format!("{name}: values outside 0 to 1 are clamped; the farthest is {}", plane.at(at)));
        }
        Ok(Field::Map(self.fit(plane, name)?))
    }

    /// A map with one number per pixel.
    fn single(&mut self, role: Role) -> Result<Option<Field>, DocumentError> {
        let Some(name) = self.files.one(role)? else { return Ok(None) };
        if let Some(channel) = self.files.channel(role) {
            let path = self.files.folder.join(&name);
            let bytes = self.source.read(&path, MOST_BYTES)?;
            let picture = Picture::decode_with_alpha(&bytes, &path, self.source)?;
            let has = if channel == 3 { picture.has_alpha() } else { channel < picture.colours() };
            if !has {
                let letter = ["r", "g", "b", "a"][channel];
                let problem =
                    format!("it has no channel {letter}, which {SETTINGS} names for {}", role.name());
                return Err(DocumentError::Picture { path, problem });
            }
            self.source.observer.advance(1);
            return self.data(&name, &picture, channel).map(Some);
        }
        let picture = self.picture(&name)?;
        if !picture.is_grey() {
            return Err(DocumentError::Picture {
                path: self.files.folder.join(&name),
                problem: format!(
                    "expected one {} value per pixel, found colours; if this is a packed map, {SETTINGS} names a channel \
                     under [maps], as in `{} = \"{name}:g\"`",
                    role.name(),
                    role.name()
                ),
            });
        }
        self.data(&name, &picture, 0).map(Some)
    }

    /// A colour map as linear fields.
    fn colour(
        &mut self,
        name: &str,
        picture: &Picture,
        encoding: Encoding,
    ) -> Result<[Field; 3], DocumentError> {
        if picture.has_foreign_profile() {
            self.source.note(format!("{name}: the colour profile is not applied"));
        }
        if picture.has_other_primaries() {
            self.source
                .note(format!("{name}: colours are converted from the primaries that the file states"));
        }
        let planes = picture.linear(encoding);
        let outside = planes.iter().any(|plane| !plane.is_share());
        if outside {
            self.source.note(format!(
                "{name}: colours outside 0 to 1 are clamped, because reflectances cannot lie there"
            ));
        }
        let [r, g, b] = planes;
        Ok([Field::Map(self.fit(r, name)?), Field::Map(self.fit(g, name)?), Field::Map(self.fit(b, name)?)])
    }
}

/// Opens a folder of maps. See the module documentation.
pub(super) fn open(
    folder: &Path,
    options: &Options,
    space: Space,
    mut source: Source<'_>,
) -> Result<Document, DocumentError> {
    let settings = settings::read(folder, &mut source)?;
    let files = Files::find(folder, &settings, &mut source)?;
    let Some(base_name) = files.one(Role::BaseColor)? else {
        return Err(files.error(format!(
            "no base colour map; expected a name such as base_color, albedo or diffuse, or [maps] in {SETTINGS}"
        )));
    };
    let read = |role: &Role| !matches!(role, Role::Ignored | Role::Unprintable);
    let maps = files.by_role.iter().filter(|(role, _)| read(role)).count();
    source.observer.begin("reading", maps as u64);

    let mut reader = Reader { files, source: &mut source, size: (0, 0) };
    let picture = reader.picture(&base_name)?;
    reader.size = (picture.width, picture.height);
    let chosen = options.colour_space.or(settings.colour_space);
    let encoding = |picture: &Picture| chosen.map_or(picture.natural_encoding(), Encoding::from);
    let how = encoding_words(encoding(&picture), chosen.is_some());
    reader.source.note(format!("{base_name}: {how}; maps other than colours are read as linear data"));
    let base = reader.colour(&base_name, &picture, encoding(&picture))?;
    drop(picture);

    let variance = match reader.files.one(Role::Normal)? {
        None => None,
        Some(name) => Some(normal_variance(&mut reader, &name)?),
    };
    let coat = coat(&mut reader, &settings)?;
    let workflow = match settings.workflow {
        Some(workflow) => workflow,
        None => workflow_of(&reader.files, &settings)?,
    };
    let surfaces = match workflow {
        Workflow::MetallicRoughness => {
            let (roughness, metal) = roughness_metallic(&mut reader, &settings)?;
            build(reader.size, space, variance, coat, move |i| {
                let metal = metal.at(i).clamp(0.0, 1.0);
                metallic(rgb(&base, i), [dielectric(1.5); 3], roughness.at(i).clamp(0.0, 1.0), metal)
            })
        }
        Workflow::SpecularGlossiness => {
            let (f0, gloss) = specular_glossiness(&mut reader, encoding)?;
            build(reader.size, space, variance, coat, move |i| {
                specular(rgb(&base, i), rgb(&f0, i), gloss.at(i).clamp(0.0, 1.0))
            })
        }
    };
    source.observer.end();
    let name = settings.name.unwrap_or_else(|| source.name_of(folder));
    let (notes, digest) = source.finish();
    Ok(Document {
        name,
        content: Content::Surfaces(surfaces),
        size_mm: settings.size_mm.map(|[w, h]| (w, h)),
        notes,
        digest,
        views: None,
    })
}

/// A note on how the colours are read, and how to change that if it is a default.
fn encoding_words(encoding: Encoding, chosen: bool) -> String {
    match (chosen, encoding) {
        (true, Encoding::Srgb) => "read as sRGB, as requested".into(),
        (true, _) => "read as linear, as requested".into(),
        (false, Encoding::Power(power)) => {
            format!("colours are read by the gamma that the file states ({power})")
        }
        (false, Encoding::Srgb) => {
            format!("integer colours are read as sRGB; set colour_space in {SETTINGS} if they are linear")
        }
        (false, Encoding::Linear) => {
            format!(
                "floating-point colours are read as linear; set colour_space in {SETTINGS} if they are sRGB"
            )
        }
    }
}

/// The surfaces of all pixels, widened by the slope variance of the normal map, under the clear coat.
fn build(
    (width, height): (usize, usize),
    space: Space,
    variance: Option<Field>,
    coat: Option<CoatLayer>,
    surface: impl Fn(usize) -> Surface + Send + Sync + 'static,
) -> Surfaces {
    Surfaces::build(width, height, space, move |i| {
        let mut surface = surface(i);
        if let Some(variance) = &variance {
            surface.alpha = relief::widened(surface.alpha, variance.at(i));
        }
        surface.under(coat.as_ref().map(|coat| coat.at(i)).unwrap_or_default())
    })
}

fn rgb(fields: &[Field; 3], pixel: usize) -> [f32; 3] {
    std::array::from_fn(|c| fields[c].at(pixel).clamp(0.0, 1.0))
}

/// The workflow of the maps found.
fn workflow_of(files: &Files, settings: &FolderSettings) -> Result<Workflow, DocumentError> {
    let has = |role| files.by_role.iter().any(|(r, _)| *r == role);
    let packed = has(Role::Packed) || has(Role::MetallicSmoothness);
    let rough = has(Role::Roughness) || packed || settings.roughness.is_some();
    let in_normal = files.all(Role::Normal).iter().any(|name| names::has_gloss(name));
    match (rough, has(Role::Glossiness) || has(Role::SpecularSmoothness) || in_normal) {
        (_, true) if in_normal && has(Role::Metallic) => Ok(Workflow::MetallicRoughness),
        (true, true) if in_normal => Ok(Workflow::MetallicRoughness),
        (true, false) => Ok(Workflow::MetallicRoughness),
        (true, true) if has(Role::Metallic) || packed => Ok(Workflow::MetallicRoughness),
        (true, true) => Err(files.error(format!(
            "found both roughness and glossiness maps; set workflow = \"metallic-roughness\" or \
             \"specular-glossiness\" in {SETTINGS}"
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
    settings: &FolderSettings,
) -> Result<(Field, Field), DocumentError> {
    let mut roughness = reader.single(Role::Roughness)?;
    let mut metal = reader.single(Role::Metallic)?;
    if let Some(name) = reader.files.one(Role::Packed)? {
        if roughness.is_some() && metal.is_some() {
            reader.source.note(format!("{name}: not read, because its channels exist as separate maps"));
        } else {
            let picture = reader.picture(&name)?;
            // Where the name of the material ends in metal, its roughness has the name of a packed map.
            if picture.is_grey() && roughness.is_none() && names::alone(&name) == Some(Role::Roughness) {
                reader
                    .source
                    .note(format!("{name}: read as roughness alone, because its channels are equal"));
                roughness = Some(reader.data(&name, &picture, 0)?);
            } else if picture.colours() != 3 {
                return Err(DocumentError::Picture {
                    path: reader.files.folder.join(&name),
                    problem: "its name says that three channels are packed in it, found grey".into(),
                });
            } else {
                const LETTERS: [&str; 3] = ["red", "green", "blue"];
                let (of_roughness, of_metal) = names::packing(&name);
                let also = of_metal.map(|channel| format!(", metallic from {}", LETTERS[channel]));
                let from = LETTERS[of_roughness];
                reader
                    .source
                    .note(format!("{name}: roughness is read from {from}{}", also.unwrap_or_default()));
                if roughness.is_none() {
                    roughness = Some(reader.data(&name, &picture, of_roughness)?);
                }
                if let (None, Some(channel)) = (&metal, of_metal) {
                    metal = Some(reader.data(&name, &picture, channel)?);
                }
            }
        }
    }
    if let Some(name) = reader.files.one(Role::MetallicSmoothness)? {
        if roughness.is_some() && metal.is_some() {
            reader.source.note(format!("{name}: not read, because its channels exist as separate maps"));
        } else {
            let picture = reader.smooth(&name)?;
            if roughness.is_none() {
                roughness = Some(reader.data(&name, &picture, 3)?.inverted());
            }
            if metal.is_none() {
                metal = Some(reader.data(&name, &picture, 0)?);
            }
        }
    }
    if roughness.is_none() {
        roughness = gloss_of_normal(reader)?.map(Field::inverted);
    }
    for role in [Role::Specular, Role::Glossiness, Role::SpecularSmoothness] {
        if let Some(name) = reader.files.all(role).first() {
            reader.source.note(format!(
                "{name}: not read; a roughness map selects the metallic workflow (set workflow in {SETTINGS} to change \
                 that)"
            ));
        }
    }
    let Some(roughness) = roughness.or(settings.roughness.map(Field::Constant)) else {
        return Err(reader.files.error(format!("no roughness map, and no `roughness` in {SETTINGS}")));
    };
    let metal = metal.or(settings.metallic.map(Field::Constant)).unwrap_or_else(|| {
        reader.source.note("no metallic map: the whole material is non-metallic".into());
        Field::Constant(0.0)
    });
    Ok((roughness, metal))
}

fn specular_glossiness(
    reader: &mut Reader<'_, '_>,
    encoding: impl Fn(&Picture) -> Encoding,
) -> Result<([Field; 3], Field), DocumentError> {
    let mut f0 = None;
    let mut gloss = reader.single(Role::Glossiness)?;
    if let Some(name) = reader.files.one(Role::SpecularSmoothness)? {
        let picture = reader.smooth(&name)?;
        let encoding = encoding(&picture);
        f0 = Some(reader.colour(&name, &picture, encoding)?);
        if gloss.is_none() {
            gloss = Some(reader.data(&name, &picture, 3)?);
        }
    }
    let gloss = match gloss.map_or_else(|| gloss_of_normal(reader), |gloss| Ok(Some(gloss)))? {
        Some(gloss) => gloss,
        None => match reader.single(Role::Roughness)? {
            Some(roughness) => roughness.inverted(),
            None => {
                return Err(reader
                    .files
                    .error("no glossiness map for the specular-glossiness workflow".into()));
            }
        },
    };
    let f0 = match (f0, reader.files.one(Role::Specular)?) {
        (Some(f0), _) => f0,
        (None, Some(name)) => {
            let picture = reader.picture(&name)?;
            let encoding = encoding(&picture);
            reader.colour(&name, &picture, encoding)?
        }
        (None, None) => {
            reader.source.note("no specular map: reflectance at normal incidence is 0.04 everywhere".into());
            std::array::from_fn(|_| Field::Constant(dielectric(1.5)))
        }
    };
    Ok((f0, gloss))
}

/// The glossiness in the alpha of a normal map whose name says so.
fn gloss_of_normal(reader: &mut Reader<'_, '_>) -> Result<Option<Field>, DocumentError> {
    let Some(name) = reader.files.one(Role::Normal)?.filter(|name| names::has_gloss(name)) else {
        return Ok(None);
    };
    let picture = reader.smooth(&name)?;
    reader.data(&name, &picture, 3).map(Some)
}

/// The clear coat, if there is one. A coat that two maps describe is left out: the material is there
/// without it.
fn coat(reader: &mut Reader<'_, '_>, settings: &FolderSettings) -> Result<Option<CoatLayer>, DocumentError> {
    for role in [Role::Coat, Role::CoatRoughness] {
        let several = reader.files.all(role);
        if several.len() > 1 {
            reader.source.note(format!(
                "{} could each be the {} map, so no coat is printed; name one of them under [maps] in {SETTINGS}",
                several.join(" and "),
                role.name()
            ));
            return Ok(None);
        }
    }
    let Some(weight) = reader.single(Role::Coat)?.or(settings.coat.map(Field::Constant)) else {
        return Ok(None);
    };
    let roughness = reader.single(Role::CoatRoughness)?.or(settings.coat_roughness.map(Field::Constant));
    let roughness = roughness.unwrap_or_else(|| {
        reader.source.note("no map of the clear coat's roughness: the coat is smooth".into());
        Field::Constant(0.0)
    });
    Ok(Some(CoatLayer { weight, roughness, f0: dielectric(1.5) }))
}

/// The slope variance of a normal map, at the size of the base colour. The window covers the same area of
/// the document for any size of the normal map.
fn normal_variance(reader: &mut Reader<'_, '_>, name: &str) -> Result<Field, DocumentError> {
    let picture = reader.picture(name)?;
    if picture.colours() != 3 {
        return Err(DocumentError::Picture {
            path: reader.files.folder.join(name),
            problem: "expected normals with three components, found grey".into(),
        });
    }
    let scale = picture.width as f64 / reader.size.0 as f64;
    let radius = (scale * (relief::WINDOW / 2) as f64).round().clamp(1.0, 256.0) as usize;
    let variance = relief::slope_variance(&picture.channel(0), &picture.channel(1), 1.0, radius);
    reader.source.note(relief::note(name));
    Ok(Field::Map(reader.fit(variance, name)?))
}

#[cfg(test)]
mod tests;
