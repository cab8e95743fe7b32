//! What the pages of `foilpress inks` share: one HTML file that loads nothing else.

use std::path::Path;

use anyhow::{Context, Result};
use press::job::page::escape;

use super::super::output::Staged;

const STYLE: &str = "body{font:15px/1.45 sans-serif;color:#111;max-width:1000px;margin:1.5em auto;padding:0 1em}h1{font-size:1.5em}\
    h2{font-size:1.15em;margin:1.6em 0 .3em}table{border-collapse:collapse}th,td{text-align:left;padding:.15em .8em;\
    border-bottom:1px solid #ccc}td.n,th.n{text-align:right}svg{max-width:100%;height:auto}";

/// The name of a file without what a terminal could take for a command.
pub fn file_name_of(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    name.chars().filter(|c| !c.is_control()).collect()
}

/// Writes a page with this title and body; the body is HTML already.
pub fn write(target: &Path, title: &str, body: &str) -> Result<()> {
    let title = escape(title);
    let page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style>\
         <h1>{title}</h1>{body}</html>\n"
    );
    let staged = Staged::file(target)?;
    std::fs::write(staged.path(), page).with_context(|| format!("cannot write {}", target.display()))?;
    staged.commit()
}
