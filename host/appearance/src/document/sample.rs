//! A sample as a document: opened from memory, or written as a folder of texture maps.

use std::io::Write as _;
use std::path::Path;

use super::content::{ColourSpace, Content, Document};
use super::error::DocumentError;
use super::folder::{FolderSettings, SETTINGS, Workflow};
use super::source::Source;
use crate::brdf::Space;
use crate::sample::{Finish, Sample};

/// Writes a sample as a folder of texture maps. The folder must exist.
pub fn write_sample(sample: &Sample, folder: &Path) -> Result<(), DocumentError> {
    let painting = sample.draw();
    for (file, data, kind) in painting.maps() {
        let path = folder.join(file);
        let picture = readers::png(&data, (painting.width as u32, painting.height as u32), kind)
            .map_err(files::io(&path, "write"))?;
        files::write(&path, |out| out.write_all(&picture))?;
    }
    let settings = FolderSettings {
        name: Some(sample.name.into()),
        size_mm: Some(painting.size_mm()),
        colour_space: Some(ColourSpace::Srgb),
        workflow: Some(match painting.finish {
            Finish::Metallic { .. } => Workflow::MetallicRoughness,
            Finish::Specular { .. } => Workflow::SpecularGlossiness,
        }),
        ..FolderSettings::default()
    };
    Ok(files::write_toml(&folder.join(SETTINGS), &settings)?)
}

/// Opens a sample without touching the disk.
pub(super) fn open(name: &str, space: Space, mut source: Source<'_>) -> Result<Document, DocumentError> {
    let sample = Sample::named(name)?;
    source.observer.begin("drawing", 1);
    let painting = sample.draw();
    for (file, data, _) in painting.maps() {
        source.take_in(file, &data);
    }
    let surfaces = painting.surfaces(space);
    source.observer.advance(1);
    source.observer.end();
    let (notes, digest) = source.finish();
    let [width, height] = painting.size_mm();
    Ok(Document {
        name: sample.name.into(),
        content: Content::Surfaces(surfaces),
        size_mm: Some((width, height)),
        notes,
        digest,
        views: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::content::Options;
    use crate::document::open::open;
    use crate::materials::Materials;
    use crate::sample::SAMPLES;
    use observe::Silent;

    /// Each sample is drawn twice here, so the test also shows that drawing is deterministic.
    #[test]
    fn every_sample_opens_the_same_from_memory_and_from_its_folder() {
        for sample in SAMPLES {
            let folder = tempfile::tempdir().unwrap();
            write_sample(&sample, folder.path()).unwrap();
            let options = Options::default();
            let file = open(folder.path().to_str().unwrap(), &options, &Silent).unwrap();
            let memory = open(&format!("sample:{}", sample.name), &options, &Silent).unwrap();
            assert_eq!((&file.name, file.size_mm), (&memory.name, memory.size_mm));
            let (Content::Surfaces(file), Content::Surfaces(memory)) = (&file.content, &memory.content)
            else {
                panic!("a sample is made of surfaces")
            };
            assert_eq!((file.width(), file.height()), (memory.width(), memory.height()));
            for pixel in 0..file.width() * file.height() {
                assert_eq!(file.surface(pixel), memory.surface(pixel), "{} pixel {pixel}", sample.name);
            }
        }
    }

    #[test]
    fn the_error_for_an_unknown_sample_lists_the_known_ones() {
        let error = open("sample:laef", &Options::default(), &Silent).unwrap_err().to_string();
        assert!(error.contains("laef") && error.contains("ladder"), "{error}");
    }
}
