//! What is looked at: printed dots, and the document and the mixture of inks that they stand for.
//!
//! Problem: `preview` shows documents, jobs and sheets, `print` what it has just printed, and both write the same page.
//! Cost: bases that make a document look like itself are fitted to it for `preview`, which takes longer than its dots; `print` shows the
//! dots alone unless the document came with bases.

use std::path::Path;

use ::view::page::{Subject, Target, page};
use ::view::{Lit, Renderer, mapped, proportions};
use anyhow::Result;
use appearance::brdf::{Space, Table, reflectances};
use appearance::document::{SAMPLES, name_of};
use appearance::factor::{Factored, Method};
use appearance::gamut::InkMix;
use inks::Library;
use observe::Observer;
use press::layout::{Mm, Repeat};
use press::preview::{Probe, Radiance, Source, ToneCurve, mix_in_words, picture};
use sheet::{Area, DotMap, Sheet};

use super::view::{Show, ViewArgs};
use super::wear::Told;
use crate::cli::arguments::FactorArgs;
use crate::cli::arguments::document_dots::{DocumentDots, DotsArgs};
use crate::cli::console::{job_in, print_job};
use crate::cli::{arguments::choice, output};

/// Pixels of the longer side of the picture in the page.
const STILL: usize = 800;

/// The most places on the longer side of a weight map, for the memory's sake.
const MOST_PLACES: usize = 2048;

/// What there is to show.
pub struct PreviewSubject {
    pub name: String,
    pub space: Space,
    pub library: Library,
    pub dots: DotMap,
    pub target: Option<Both>,
    /// What a worn printer made of the dots.
    pub worn: Option<Told>,
}

/// A document and its mixture of inks.
pub struct Both {
    pub document: Factored,
    pub mapped: Factored,
    pub mixtures: Vec<String>,
    /// The commands that replay edits of the document, one a line.
    pub replay: String,
}

/// A page.
pub struct Page {
    pub html: String,
    /// Width and height of its picture for browsers that cannot draw.
    pub pixels: (usize, usize),
    pub tone: ToneCurve,
}

impl PreviewSubject {
    /// What the argument names: a document, or printed dots. A document has its bases beside it only if that is what will be looked at:
    /// finding them takes longer than all else.
    pub fn open(work: &DotsArgs, with_bases: bool, observer: &dyn Observer) -> Result<PreviewSubject> {
        let path = work.document.path();
        if let Some(dots) = printed(path, observer)? {
            let name = printed_name(path);
            let library = work.inks.library()?;
            return Ok(PreviewSubject {
                name,
                space: Space::half_angle(SAMPLES),
                library,
                dots,
                target: None,
                worn: None,
            });
        }
        let prepared = work.document_dots(observer)?;
        if prepared.layout.repeat != Repeat::Grid(1, 1) {
            observer.note("one copy of the document is shown; `foilpress print` it and preview its job to see the whole sheet");
        }
        let bases = with_bases.then(|| prepared.bases(observer)).transpose()?;
        Ok(PreviewSubject::of(&prepared, &prepared.halftoned.mapped.mix, bases, work))
    }

    /// A document's dots, with the document and its mixture beside them where it has bases. `work` is what was asked for.
    pub fn of(
        prepared: &DocumentDots,
        mix: &InkMix,
        bases: Option<Factored>,
        work: &DotsArgs,
    ) -> PreviewSubject {
        let DocumentDots { document, library, halftoned, .. } = prepared;
        let space = document.materials().space().clone();
        let words = |row: &Vec<u16>| {
            let parts = mix.stacks.iter().cloned().zip(row.iter().map(|&share| f64::from(share)));
            mix_in_words(&parts.filter(|(_, share)| *share > 0.0).collect::<Vec<_>>())
        };
        let target = bases.map(|document| Both {
            document,
            mapped: mapped(mix, library, &space),
            mixtures: mix.matrix.iter().map(words).collect(),
            replay: replay(prepared, work),
        });
        let (name, library, dots) = (document.name.clone(), library.clone(), halftoned.dots.clone());
        PreviewSubject { name, space, library, dots, target, worn: None }
    }

    /// What the stacks of the dots reflect.
    pub fn stacks(&self) -> Table {
        reflectances(self.dots.stacks(), &self.library, &self.space)
    }

    /// What a picture shows.
    pub fn source<'a>(&'a self, what: Show, stacks: &'a Table) -> Source<'a> {
        match (what, &self.target) {
            (Show::Document, Some(both)) => Source::Factored(&both.document),
            (Show::Mapped, Some(both)) => Source::Factored(&both.mapped),
            _ => {
                Source::Print { dots: &self.dots, space: &self.space, stacks, area: Area::whole(&self.dots) }
            }
        }
    }

    /// Places on the longer side of a weight map that is fine enough for a sheet of so many pixels. The renderer looks at the dots of a
    /// print where a pixel has fewer than two, so its map needs no more places than half the dots.
    pub fn places(&self, what: Show, pixels: f64) -> usize {
        let most = match what {
            Show::Printed => self.dots.width().max(self.dots.length()).div_ceil(2).clamp(64, MOST_PLACES),
            _ => MOST_PLACES,
        };
        // At most `most`, an integer of a few thousand.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let places = pixels.ceil().clamp(64.0, most as f64) as usize;
        places
    }

    /// The page on which light follows the hand, as it is at first with these options.
    ///
    /// # Errors
    /// A scene that cannot be seen.
    pub fn page(&self, view: &ViewArgs, probe: Option<&Probe>, observer: &dyn Observer) -> Result<Page> {
        let (stacks, size) = (self.stacks(), self.size());
        let places = self.places(view.what(), STILL as f64 * view.zoom);
        let lit = Lit::new(&self.source(view.what(), &stacks), size, places)?;
        let (width, height) = proportions(size, STILL);
        let scene = view.scene(size, width as f64 / height as f64, probe.cloned())?;
        let radiance = Renderer::new(&lit).render(&scene, width, height, observer)?;
        let tone = view.tone(&radiance);
        let studio = Probe::studio(64);
        let subject = Subject {
            name: &self.name,
            about: &self.about(),
            size,
            target: self.target.as_ref().map(|both| Target {
                document: &both.document,
                mapped: &both.mapped,
                mixtures: &both.mixtures,
                replay: &both.replay,
            }),
            dots: &self.dots,
            stacks: &stacks,
            space: &self.space,
            probe: probe.unwrap_or(&studio),
            start: &view.fragment(&scene.camera, tone, self.target.is_some(), probe.is_some()),
            still: &png(&radiance, tone)?,
        };
        Ok(Page { html: page(&subject, observer)?, pixels: (width, height), tone })
    }

    /// Width and height in metres.
    pub fn size(&self) -> [f64; 2] {
        [self.dots.width(), self.dots.length()].map(|dots| Mm::of_dots(dots as i64).0 / 1000.0)
    }

    fn about(&self) -> String {
        let [width, height] = self.size().map(|side| side * 1000.0);
        let stacks = self.dots.census().iter().filter(|&&dots| dots > 0).count();
        format!(
            "{width:.0} x {height:.0} mm, {} dots of {stacks} {}",
            counted(self.dots.index().len()),
            if stacks == 1 { "stack" } else { "stacks" }
        ) + &self.worn.as_ref().map_or_else(String::new, |worn| format!(", {}", worn.brief()))
    }

    /// Says what a worn printer made of the dots.
    pub fn say(&self, out: &mut dyn std::io::Write) -> std::io::Result<()> {
        self.worn.as_ref().map_or(Ok(()), |worn| worn.write(out))
    }
}

/// A number of dots in words.
fn counted(dots: usize) -> String {
    match dots {
        0..10_000 => dots.to_string(),
        10_000..950_000 => format!("{:.0} thousand", dots as f64 / 1e3),
        _ => format!("{:.1} million", dots as f64 / 1e6),
    }
}

/// The commands that replay edits of the document's bases: `edit`, after the `factor` that finds the same bases if the document
/// came without any. Pages are shown to others, so a path is only its last part.
fn replay(prepared: &DocumentDots, work: &DotsArgs) -> String {
    let asked = &work.document;
    let last = asked.path().file_name().map(|name| name.to_string_lossy().into_owned());
    let name = last.unwrap_or_else(|| asked.document.clone());
    let edit = |foil: &str| format!("foilpress edit {} --steps steps.toml -o edited.foil", word(foil));
    let file = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let pictures: Vec<String> =
        asked.pictures.given().map(|(option, path)| format!("--{option} {}", word(&file(path)))).collect();
    if prepared.document.as_factored().is_some() && pictures.is_empty() {
        return edit(&name);
    }
    let found = prepared.factoring();
    let subject = if pictures.is_empty() { word(&name) } else { pictures.join(" ") };
    let mut line = format!("foilpress factor {subject}");
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            line.push_str(&format!(" --{name} {}", word(&value)));
        }
    };
    option("material", asked.material.clone());
    option("colour-space", asked.colour_space.map(|space| choice::name(space).into()));
    option("samples", (asked.samples != SAMPLES).then(|| asked.samples.to_string()));
    option("bases", found.bases.map(|bases| bases.to_string()));
    option("factor", (found.method != Method::default()).then(|| choice::name(found.method).into()));
    option("seed", (found.seed != FactorArgs::SEED).then(|| found.seed.to_string()));
    let foil = format!("{}.foil", output::file_name(&prepared.document.name));
    format!("{line} -o {}\n{}", word(&foil), edit(&foil))
}

/// A word as shells read it.
fn word(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "._-/:+,".contains(c);
    match text {
        _ if text.starts_with('-') => word(&format!("./{text}")),
        _ if !text.is_empty() && text.chars().all(plain) => text.into(),
        _ => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

/// Whether this is a job, or a folder with one or with dots.
pub fn is_printed(path: &Path) -> bool {
    ["dots.toml", "sheet.toml"].iter().any(|name| path.join(name).is_file())
        || job_in(path).is_some()
        || path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rgl"))
}

/// The dots of a job or of a folder with one or with a sheet; nothing for a document.
pub fn printed(path: &Path, observer: &dyn Observer) -> Result<Option<DotMap>> {
    if path.join("dots.toml").is_file() {
        return Ok(Some(DotMap::load(path)?));
    }
    if path.join("sheet.toml").is_file() {
        return Ok(Some(Sheet::load(path)?.dots().clone()));
    }
    if is_printed(path) { Ok(Some(print_job(path, observer)?.dots().clone())) } else { Ok(None) }
}

/// The name of a job or of a folder with a sheet. `print` calls every job alike, but its folder by the document.
pub fn printed_name(path: &Path) -> String {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = whole.parent().filter(|folder| folder.join("plan.html").is_file());
    name_of(folder.filter(|_| whole.ends_with("job.rgl")).unwrap_or(&whole))
}

/// A picture as PNG.
pub fn png(radiance: &Radiance, tone: ToneCurve) -> Result<Vec<u8>> {
    Ok(picture(radiance, tone)?.png()?)
}

#[cfg(test)]
mod tests {
    use super::word;

    #[test]
    fn names_are_one_word_of_a_shell() {
        for (name, expected) in [
            ("my-material.glb", "my-material.glb"),
            ("sample:leaf", "sample:leaf"),
            ("été", "été"),
            ("a b", "'a b'"),
            ("it's", "'it'\\''s'"),
            ("$(reboot)", "'$(reboot)'"),
            ("-o", "./-o"),
            ("", "''"),
        ] {
            assert_eq!(word(name), expected);
        }
    }
}
