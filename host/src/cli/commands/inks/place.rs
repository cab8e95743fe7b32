//! Adding what was measured to a library in a folder, which is created if it is not there. Nothing changes unless the whole is a
//! library afterwards.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use files::shelf::Disk;
use inks::{FILE_NAME, Library, Stack, archive};

use crate::cli::output::{Kind, Staged};

/// Adds the table and the file of a stack's curve.
pub fn curve(folder: &Path, table: &str, added: archive::Member, stack: &Stack) -> Result<Library> {
    if let Some(here) = present(folder)?
        && let Some(known) = here.entry(stack).filter(|entry| entry.lobes.is_none())
    {
        bail!(
            "{} has a {} curve of {stack} already; remove its table from {FILE_NAME} first",
            folder.display(),
            known.provenance.word()
        );
    }
    if folder.join(&added.name).exists() {
        bail!("{} exists; rename it, or remove it first", folder.join(&added.name).display());
    }
    add(folder, table, Some(added), "the curve cannot be used")
}

/// Adds tables of the dots of inks, or of `paper`.
pub fn dots(folder: &Path, tables: &str, names: &[&str]) -> Result<Library> {
    if let Some(here) = present(folder)? {
        for name in names {
            let paper = &here.optics().paper.minimum_cluster;
            let known = match inks::names::ink(name) {
                Some(ink) => here.cartridge(ink).is_some_and(|cartridge| cartridge.dots.is_some()),
                None => paper.source() == inks::Source::Measured,
            };
            if known {
                bail!(
                    "{} has measured dots of {name} already; remove their [[dots]] table from {FILE_NAME} first",
                    folder.display()
                );
            }
        }
    }
    add(folder, tables, None, "the figures cannot be used")
}

/// The library in a folder that exists.
fn present(folder: &Path) -> Result<Option<Library>> {
    if !folder.exists() {
        return Ok(None);
    }
    let here = Library::open(&Disk, folder)
        .with_context(|| format!("{} is not a usable ink library", folder.display()))?;
    Ok(Some(here))
}

fn add(folder: &Path, tables: &str, added: Option<archive::Member>, unusable: &str) -> Result<Library> {
    let new = !folder.exists();
    let mut members = if new {
        let text = "format = 1\nbased_on = \"built-in\"\nname = \"measured stacks\"\n";
        vec![archive::Member { name: FILE_NAME.into(), bytes: text.into() }]
    } else {
        archive::gather(&Disk, folder).with_context(|| format!("{}", folder.display()))?
    };
    let index =
        members.iter().position(|member| member.name == FILE_NAME).context("a library has library.toml")?;
    members[index].bytes.extend(tables.bytes());
    let toml = members[index].bytes.clone();
    members.extend(added.clone());
    let checked = tempfile::tempdir().context("cannot make a temporary folder")?;
    archive::place(&members, checked.path())?;
    let library = Library::open(&Disk, checked.path()).map_err(|error| {
        // The temporary folder means nothing to the user.
        let inside = format!("{}{}", checked.path().display(), std::path::MAIN_SEPARATOR);
        anyhow::anyhow!("{unusable}: {}", error.to_string().replace(&inside, ""))
    })?;
    if new {
        let staged = Staged::folder(folder, Kind::Measured)?;
        archive::place(&members, staged.create()?)?;
        staged.commit()?;
    } else {
        // The curve first: a curve that no table names is a warning, a table without its curve an error.
        let toml = archive::Member { name: FILE_NAME.into(), bytes: toml };
        for archive::Member { name, bytes } in added.iter().chain([&toml]) {
            let target = folder.join(name);
            let staged = Staged::file(&target)?;
            fs::write(staged.path(), bytes).with_context(|| format!("cannot write {}", target.display()))?;
            staged.commit()?;
        }
    }
    Ok(library)
}
