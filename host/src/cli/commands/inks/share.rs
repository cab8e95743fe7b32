//! `foilpress inks add`, `list --added`, `remove`, `export` and `import`: libraries become the user's own, and go to others.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use files::shelf::Disk;
use inks::own::{self, Own};
use inks::{Library, archive};
use protocol::ink::Ink;

use crate::cli::output::{Staged, file_name};
use crate::{libraries, own_inks};

/// The name that a folder or a file suggests.
fn suggested(path: &Path, name: Option<String>) -> String {
    let own = |path: &Path| {
        let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        let part = if whole.is_dir() { whole.file_name() } else { whole.file_stem() };
        part.map_or_else(String::new, |part| part.to_string_lossy().into_owned())
    };
    name.unwrap_or_else(|| own(path))
}

fn installed(name: &str, members: &[archive::Member], from: &Path) -> Result<String> {
    let (folder, library) =
        libraries::install(name, members).with_context(|| format!("{}", from.display()))?;
    let licence = library.licence().map_or_else(String::new, |licence| format!(", licence {licence}"));
    Ok(format!(
        "{name}: {}{licence}\nin {}\nUse it with --library {name}; `foilpress inks remove {name}` removes it\n",
        library.origins(),
        folder.display()
    ))
}

/// Makes the library in a folder one of the user's own.
pub fn add(dir: &Path, name: Option<String>) -> Result<String> {
    Library::open(&Disk, dir).with_context(|| format!("{} is not a usable ink library", dir.display()))?;
    let members = archive::gather(&Disk, dir).with_context(|| format!("{}", dir.display()))?;
    installed(&suggested(dir, name), &members, dir)
}

/// An ink of one's own in a line.
pub fn ink_line(own: &Own) -> String {
    let ([red, green, blue], ink) = (own.colour(), own.poses_as());
    format!(
        "{:<16} #{red:02x}{green:02x}{blue:02x}  poses as {} (barcode {}, ink code {:02x})\n",
        own.name(),
        ink.name(),
        ink.barcode(),
        ink.code()
    )
}

/// Makes an ink of another maker one of the user's own.
pub fn add_ink(name: &str, colour: &str, ink: Ink) -> Result<String> {
    let (own, path) = own_inks::add(name, colour, ink)?;
    Ok(format!(
        "{}in {}\nName layers and spot colours {name}; `foilpress inks remove {name}` removes it\n",
        ink_line(&own),
        path.display(),
        name = own.name()
    ))
}

/// Writes a library as one archive.
pub fn export(spec: &Path, output: Option<&Path>, licence: Option<&str>) -> Result<String> {
    if libraries::is_built_in(spec) {
        bail!("the built-in library comes with every copy of the program, so there is nothing to export");
    }
    let folder = libraries::folder(spec)?;
    let library = libraries::open(spec)?;
    let output = output.map_or_else(
        || PathBuf::from(format!("{}.zip", file_name(&suggested(&folder, None)))),
        Path::to_path_buf,
    );
    let staged = Staged::file(&output)?;
    let members = archive::gather(&Disk, &folder).with_context(|| format!("{}", folder.display()))?;
    let bytes =
        archive::pack(&members, &library, licence).with_context(|| format!("{}", folder.display()))?;
    std::fs::write(staged.path(), &bytes).with_context(|| format!("cannot write {}", output.display()))?;
    staged.commit()?;
    Ok(format!("{}: {}, {} bytes\n", output.display(), library.origins(), bytes.len()))
}

/// Makes the library in an archive one of the user's own.
pub fn import(path: &Path, name: Option<String>) -> Result<String> {
    let cannot = || format!("cannot read {}", path.display());
    let mut bytes = Vec::new();
    let file = File::open(path).with_context(cannot)?;
    file.take(archive::MOST_ARCHIVE + 1).read_to_end(&mut bytes).with_context(cannot)?;
    let members = archive::unpack(&bytes).with_context(|| format!("{}", path.display()))?;
    installed(&suggested(path, name), &members, path)
}

/// The libraries and inks that were added, a line each. A library that cannot be used says so.
pub fn list(json: bool) -> Result<String> {
    let opened = |name: String| {
        let library = libraries::added(&name)
            .context("it was removed just now")
            .and_then(|folder| libraries::open(&folder));
        (name, library)
    };
    let all: Vec<(String, Result<Library>)> = libraries::names().into_iter().map(opened).collect();
    if json {
        let row = |(name, library): &(String, Result<Library>)| match library {
            Ok(library) => {
                serde_json::json!({ "name": name, "about": library.name(), "stacks": library.origins().to_string() })
            }
            Err(error) => serde_json::json!({ "name": name, "error": format!("{error:#}") }),
        };
        let ink = |own: &Own| serde_json::json!({ "name": own.name(), "colour": own.colour(), "poses_as": own.poses_as().name() });
        let rows: Vec<_> = all.iter().map(row).chain(own::all().iter().map(ink)).collect();
        return Ok(serde_json::to_string_pretty(&rows)? + "\n");
    }
    if all.is_empty() && own::all().is_empty() {
        return Ok("no library was added; `foilpress inks add DIR` adds one\n".into());
    }
    let line = |(name, library): &(String, Result<Library>)| match library {
        Ok(library) => format!("{name:<16} {}\n", library.origins()),
        Err(_) => format!("{name:<16} cannot be used; see `foilpress inks check {name}`\n"),
    };
    Ok(all.iter().map(line).chain(own::all().iter().map(ink_line)).collect())
}

/// Removes an ink or a library that was added.
pub fn remove(name: &str) -> Result<String> {
    if let Some(path) = own_inks::remove(name)? {
        return Ok(format!("{name}: removed from {}\n", path.display()));
    }
    let folder = libraries::remove(name)?;
    Ok(format!("{name}: removed from {}\n", folder.display()))
}
