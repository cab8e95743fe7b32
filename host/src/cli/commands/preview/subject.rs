//! What is looked at: what the argument names, a document, a job or a sheet.

use std::borrow::Cow;
use std::path::Path;

use anyhow::Result;
use appearance::brdf::Space;
use appearance::document::{SAMPLES, name_of};
use appearance::factor::{Factored, Method};
use files::shelf::Disk;
use inks::Library;
use make::choice;
use make::print::{Print, SEED};
use make::shown::{Mixture, Shown, size};
use observe::Observer;
use press::layout::Repeat;
use sheet::{DotMap, Sheet};

use super::wear::Told;
use crate::cli::arguments::document_dots::DotsArgs;
use crate::cli::console::{job_in, print_job};
use crate::cli::output;

/// What there is to show.
pub struct PreviewSubject {
    pub name: String,
    pub library: Library,
    pub dots: DotMap,
    /// What a worn printer made of the dots.
    pub worn: Option<Told>,
    space: Space,
    /// The document and its mixture of inks, and the commands that replay edits of it.
    target: Option<(Factored, Mixture, String)>,
}

impl PreviewSubject {
    /// What the argument names: a document, or printed dots. A document has its bases beside it only if that is what will be looked at:
    /// finding them takes longer than all else.
    pub fn open(work: &DotsArgs, with_bases: bool, observer: &dyn Observer) -> Result<PreviewSubject> {
        let path = work.document.path();
        if let Some(dots) = printed(path, observer)? {
            let name = printed_name(path);
            let (library, space) = (work.inks.library()?, Space::half_angle(SAMPLES));
            return Ok(PreviewSubject { name, library, dots, worn: None, space, target: None });
        }
        let print = work.dots(observer)?;
        if print.settings.page.layout.repeat != Repeat::Grid(1, 1) {
            observer.note("one copy of the document is shown; `foilpress print` it and preview its job to see the whole sheet");
        }
        let bases = with_bases.then(|| print.bases(observer)).transpose()?;
        let space = print.document.materials().space().clone();
        let replay = bases.as_ref().map(|_| replay(&print, work)).unwrap_or_default();
        let Print { document, settings, halftoned, .. } = print;
        let target = bases
            .map(|document| {
                let mixture = Mixture::of(halftoned.mapped.mix, &settings.library, &space)?;
                Ok::<_, make::Error>((document, mixture, replay))
            })
            .transpose()?;
        let (name, library, dots) = (document.name, settings.library, halftoned.dots);
        Ok(PreviewSubject { name, library, dots, worn: None, space, target })
    }

    /// The same for the renderer and the page.
    pub fn shown(&self) -> Shown<'_> {
        Shown {
            name: &self.name,
            space: &self.space,
            library: &self.library,
            dots: Cow::Borrowed(&self.dots),
            target: self.target.as_ref().map(|(document, mixture, _)| (document, mixture)),
            replay: self.target.as_ref().map_or("", |(.., replay)| replay),
            also: self.worn.as_ref().map_or_else(String::new, |worn| format!(", {}", worn.brief())),
        }
    }

    /// Width and height in metres.
    pub fn size(&self) -> [f64; 2] {
        size(&self.dots)
    }

    /// Says what a worn printer made of the dots.
    pub fn say(&self, out: &mut dyn std::io::Write) -> std::io::Result<()> {
        self.worn.as_ref().map_or(Ok(()), |worn| worn.write(out))
    }
}

/// The commands that replay edits of the document's bases: `edit`, after the `factor` that finds the same bases if the document
/// came without any. Pages are shown to others, so a path is only its last part.
pub fn replay(print: &Print, work: &DotsArgs) -> String {
    let asked = &work.document;
    let last = asked.path().file_name().map(|name| name.to_string_lossy().into_owned());
    let name = last.unwrap_or_else(|| asked.document.clone());
    let edit = |foil: &str| format!("foilpress edit {} --steps steps.toml -o edited.foil", word(foil));
    let file = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let pictures: Vec<String> =
        asked.pictures.given().map(|(option, path)| format!("--{option} {}", word(&file(path)))).collect();
    if print.document.as_factored().is_some() && pictures.is_empty() {
        return edit(&name);
    }
    let found = print.factoring();
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
    option("seed", (found.seed != SEED).then(|| found.seed.to_string()));
    let foil = format!("{}.foil", output::file_name(&print.document.name));
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
    name_of(&Disk, folder.filter(|_| whole.ends_with("job.rgl")).unwrap_or(&whole))
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
