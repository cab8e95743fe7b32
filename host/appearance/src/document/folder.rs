//! A folder of texture maps as a document.
//!
//! Base colour with roughness and metallic (apart, or packed as occlusion-roughness-metallic), or diffuse with
//! specular and glossiness; a normal map folds into roughness ([`super::relief`]). Files are found by name
//! ([`super::names`]) or named in [`SETTINGS`]. All maps are brought to the size of the base colour. Nothing is taken
//! silently: the notes say which encoding was assumed, what was resized, what was left out.

mod files;
mod settings;

use std::path::Path;

use super::error::DocumentError;
use super::names::Role;
use super::picture::Picture;
use super::relief;
use super::source::{MOST_BYTES, Source};
use super::surfaces::{Surfaces, dielectric, metallic, specular};
use super::texture::{Field, Plane, same_shape};
use super::{ColourSpace, Content, Document, Options, stem};
use crate::brdf::Space;

use files::Files;
pub(super) use settings::check_size_mm;
pub use settings::{MapNames, SETTINGS, Settings, Workflow};

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
    let settings = settings::read(folder, &mut source)?;
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
