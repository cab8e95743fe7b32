//! What the pages of `foilpress inks` share: one HTML file that loads nothing else.

use std::path::Path;

use anyhow::{Context, Result};
use press::html::{self, escape};

use crate::cli::output::Staged;

/// The name of a file without what a terminal could take for a command.
pub fn file_name_of(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    name.chars().filter(|c| !c.is_control()).collect()
}

/// Writes a page with this title and body; the body is HTML already.
pub fn write(target: &Path, title: &str, body: &str) -> Result<()> {
    let page = html::read(title, "", &format!("<h1>{}</h1>\n{body}\n", escape(title)));
    let staged = Staged::file(target)?;
    std::fs::write(staged.path(), page).with_context(|| format!("cannot write {}", target.display()))?;
    staged.commit()
}
