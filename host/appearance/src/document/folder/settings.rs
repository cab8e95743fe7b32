//! `material.toml`: facts about a folder of maps that file names cannot tell.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::document::content::{ColourSpace, check_size_mm};
use crate::document::error::DocumentError;
use crate::document::names::Role;
use crate::document::source::Source;

/// The optional settings file of a folder.
pub const SETTINGS: &str = "material.toml";

/// What the maps hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Workflow {
    /// Base colour, roughness, metallic.
    MetallicRoughness,
    /// Diffuse colour, specular colour, glossiness.
    SpecularGlossiness,
}

/// The contents of `material.toml`. Every key is optional; unknown keys are errors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FolderSettings {
    /// The name of the document.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Width and height on paper in millimetres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_mm: Option<[f64; 2]>,
    /// Encoding of the colour maps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour_space: Option<ColourSpace>,
    /// What the maps hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub workflow: Option<Workflow>,
    /// Roughness if there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
    /// Metallic if there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f32>,
    /// How much of the surface a clear coat covers if there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat: Option<f32>,
    /// Roughness of the clear coat if there is no map, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat_roughness: Option<f32>,
    /// The files to read, where their names do not tell.
    #[serde(default, skip_serializing_if = "MapNames::is_empty")]
    pub maps: MapNames,
}

/// The `[maps]` of `material.toml`: file names within the folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the fields are the roles of `names::Role`")]
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
    pub metallic_smoothness: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular_smoothness: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coat_roughness: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<String>,
}

impl MapNames {
    fn is_empty(&self) -> bool {
        *self == MapNames::default()
    }

    pub(super) fn named(&self) -> impl Iterator<Item = (Role, &str)> {
        [
            (Role::BaseColor, &self.base_color),
            (Role::Roughness, &self.roughness),
            (Role::Metallic, &self.metallic),
            (Role::Packed, &self.occlusion_roughness_metallic),
            (Role::Specular, &self.specular),
            (Role::Glossiness, &self.glossiness),
            (Role::MetallicSmoothness, &self.metallic_smoothness),
            (Role::SpecularSmoothness, &self.specular_smoothness),
            (Role::Coat, &self.coat),
            (Role::CoatRoughness, &self.coat_roughness),
            (Role::Normal, &self.normal),
        ]
        .into_iter()
        .filter_map(|(role, name)| Some((role, name.as_deref()?)))
    }
}

/// Reads `material.toml` if the folder has one.
pub(super) fn read(folder: &Path, source: &mut Source<'_>) -> Result<FolderSettings, DocumentError> {
    let path = folder.join(SETTINGS);
    if !source.is_file(&path) {
        return Ok(FolderSettings::default());
    }
    let text = source.read_text(&path)?;
    let wrong = |problem: String| DocumentError::Settings { path: path.clone(), problem };
    let settings: FolderSettings = toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    if let Some(size) = settings.size_mm {
        check_size_mm(size).map_err(wrong)?;
    }
    for (key, value) in [
        ("roughness", settings.roughness),
        ("metallic", settings.metallic),
        ("coat", settings.coat),
        ("coat_roughness", settings.coat_roughness),
    ] {
        if let Some(value) = value
            && !(0.0..=1.0).contains(&value)
        {
            return Err(wrong(format!("{key} = {value}: expected a number from 0 to 1")));
        }
    }
    Ok(settings)
}
