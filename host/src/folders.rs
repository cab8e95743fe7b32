//! Where the user's own files are: calibration profiles, presets and ink libraries.

use std::path::{Path, PathBuf};

/// There is no folder for the user's files.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no folder for your settings; set HOME, or set FOILPRESS_CONFIG to a folder")]
pub struct NoFolder;

/// A name that cannot be the name of a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a valid name; use at most 64 letters, digits, - and _")]
pub struct NoName(String);

/// The folder of settings: `FOILPRESS_CONFIG`, or `foilpress` where the system keeps programs' settings.
pub fn config() -> Result<PathBuf, NoFolder> {
    let var = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let home = |under: &str| var("HOME").map(|home| home.join(under));
    let system = if cfg!(windows) {
        var("APPDATA")
    } else if cfg!(target_os = "macos") {
        home("Library/Application Support")
    } else {
        var("XDG_CONFIG_HOME").or_else(|| home(".config"))
    };
    var("FOILPRESS_CONFIG").or_else(|| system.map(|system| system.join("foilpress"))).ok_or(NoFolder)
}

/// The path of `NAME.toml` in a folder. A name cannot lead to another folder.
pub fn file(folder: &Path, name: &str) -> Result<PathBuf, NoName> {
    Ok(folder.join(format!("{}.toml", checked(name)?)))
}

/// The path of the folder `NAME` in a folder. A name cannot lead to another folder.
pub fn folder(folder: &Path, name: &str) -> Result<PathBuf, NoName> {
    Ok(folder.join(checked(name)?))
}

fn checked(name: &str) -> Result<&str, NoName> {
    const LONGEST: usize = 64;
    let plain = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.chars().count() > LONGEST || name.starts_with('-') || !name.chars().all(plain)
    {
        return Err(NoName(name.into()));
    }
    Ok(name)
}

/// The names of the `.toml` files in a folder, sorted; none when there is no such folder.
pub fn names(folder: &Path) -> std::io::Result<Vec<String>> {
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "toml")
            && let Some(name) = path.file_stem().and_then(|stem| stem.to_str())
            && file(folder, name).is_ok()
        {
            names.push(name.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_stays_in_its_folder() {
        let folder = Path::new("/somewhere");
        assert_eq!(file(folder, "decal-2"), Ok(folder.join("decal-2.toml")));
        for wrong in ["", "..", "a/b", "a\\b", ".hidden", "-x", "a b", "\u{0}"] {
            assert!(file(folder, wrong).is_err() && super::folder(folder, wrong).is_err(), "{wrong}");
        }
        assert!(file(folder, &"x".repeat(65)).is_err());
    }
}
