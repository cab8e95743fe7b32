//! Outputs appear whole or not at all.
//!
//! Everything is written to a hidden staging folder beside its destination and moved there at the end,
//! [durably](durable::place). The staging folder is removed when the program fails, and by [`remove_on_interrupt`] when it is
//! stopped. A folder is replaced only by a folder of the same [`Kind`] and if this program wrote all of it, a file only by a
//! file in the same format.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::cli::console::say;
use anyhow::{Context, Result, bail};
use appearance::edit;
use art::process;
use files::durable;
use files::scratch::{self, Scratch};
use press::separate::files::is_signed;
use protocol::ink::Ink;

/// What the user is told when the program is interrupted.
static FAREWELL: Mutex<Option<String>> = Mutex::new(None);

/// Sets what the user is told if the program is interrupted from now on.
pub fn say_on_interrupt(text: &str) {
    *FAREWELL.lock().unwrap_or_else(PoisonError::into_inner) = Some(text.to_owned());
}

/// The kind of a folder this program writes, which decides what may be in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The result of `print`.
    Print,
    /// Bases and weight maps.
    Foil,
    /// Mixtures of stacks.
    Mix,
    /// One stack for every dot.
    Dots,
    /// The same on a page.
    Sheet,
    /// One-bit passes.
    Passes,
    /// Pictures of passes without their description.
    Pictures,
    /// Curves from photographs.
    Measured,
    /// A library with predicted curves.
    Predicted,
    /// A sample's maps, which the user may have painted in since: never replaced.
    Maps,
}

impl Kind {
    /// The file that every folder of this kind has.
    fn marker(self) -> Option<&'static str> {
        match self {
            Kind::Print => Some("report.json"),
            Kind::Foil => Some("document.toml"),
            Kind::Mix => Some("mix.toml"),
            Kind::Dots => Some("dots.toml"),
            Kind::Sheet => Some("sheet.toml"),
            Kind::Passes => Some("passes.toml"),
            Kind::Measured => Some(measure::curves::library::FIGURES),
            Kind::Predicted => Some(inks::archive::PREDICTION),
            Kind::Pictures | Kind::Maps => None,
        }
    }

    /// Whether this program writes files of that name.
    fn writes(self, name: &str) -> bool {
        let between = |start: &str, end: &str| name.strip_prefix(start)?.strip_suffix(end);
        let number = |start: &str, end: &str| {
            between(start, end)
                .is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
        };
        self.marker() == Some(name)
            || match self {
                Kind::Print => {
                    ["job.rgl", "plan.html", "sheet.png", "materials.png", "separation.png", "passes"].contains(&name)
                        || ["report.html", "sheet.html", "display.html", "preview.png"].contains(&name)
                        || name.strip_prefix("preview-").is_some_and(is_pass)
                        || ["mask-", "seen-"].iter().any(|start| number(start, ".png") || between(start, ".png") == Some("align"))
                }
                Kind::Foil => {
                    ["bases.csv", edit::FILE_NAME].contains(&name)
                        || number("weights-", ".png")
                        || number("mask-", ".png")
                        || number("curve-", ".csv")
                }
                Kind::Mix => number("weights-", ".png"),
                Kind::Dots => name == "separation.png",
                Kind::Sheet => ["separation.png", "layout.toml"].contains(&name),
                Kind::Passes | Kind::Pictures => is_pass(name),
                Kind::Measured => {
                    [inks::FILE_NAME, "report.html"].contains(&name)
                        || name.ends_with(".csv")
                        || number("mask-", ".png")
                        || number("residuals-", ".png")
                }
                Kind::Predicted => {
                    name == inks::FILE_NAME || inks::archive::BESIDE.contains(&name) || name.ends_with(".csv")
                }
                Kind::Maps => false,
            }
            // What file browsers leave in every folder they show.
            || [".DS_Store", "Thumbs.db", "desktop.ini"].contains(&name)
    }

    /// The first entry of a folder that this program did not write, if there is one.
    fn foreign_entry(self, folder: &Path) -> io::Result<Option<PathBuf>> {
        let (mut entries, mut marked) = (0, self.marker().is_none());
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name();
            let known = name.to_str().is_some_and(|name| self.writes(name));
            let passes = self == Kind::Print && name == "passes";
            // Without a description beside them, pictures of passes are told from art by what is written in them.
            let signed =
                self != Kind::Pictures || !is_pass(&name.to_string_lossy()) || is_signed(&entry.path());
            if !known || !signed || entry.file_type()?.is_dir() != passes {
                return Ok(Some(entry.path()));
            }
            if passes && let Some(foreign) = Kind::Passes.foreign_entry(&entry.path())? {
                return Ok(Some(foreign));
            }
            marked |= self.marker().is_some_and(|marker| name == marker);
            entries += 1;
        }
        Ok((entries > 0 && !marked).then(|| folder.to_path_buf()))
    }
}

/// Whether a file has the name of a pass, as in `01-cyan.png`.
fn is_pass(name: &str) -> bool {
    let parts = name.strip_suffix(".png").and_then(|name| name.split_once('-'));
    parts.is_some_and(|(number, ink)| {
        number.len() >= 2 && number.bytes().all(|b| b.is_ascii_digit()) && Ink::from_name(ink).is_some()
    })
}

/// What a file is by its first bytes; `None` if it is empty or not there.
fn format_of(path: &Path) -> Option<&'static str> {
    let mut start = Vec::new();
    fs::File::open(path).ok()?.take(16).read_to_end(&mut start).ok()?;
    let formats: [(&[u8], &str); 9] = [
        (b"\x89PNG", "a PNG picture"),
        (b"\xff\xd8", "a JPEG picture"),
        (b"II*\0", "a TIFF picture"),
        (b"MM\0*", "a TIFF picture"),
        (b"%PDF", "a PDF document"),
        (b"%!", "a PostScript document"),
        (b"<!", "a page in HTML"),
        (b"<", "a drawing or another XML file"),
        (b"\x1b", "a print job"),
    ];
    let known = formats.into_iter().find(|(magic, _)| start.starts_with(magic));
    known.map(|(_, name)| name).or((!start.is_empty()).then_some("another file"))
}

/// A place to write a file or a folder before it appears under its own name.
pub struct Staged {
    target: PathBuf,
    inside: PathBuf,
    folder: Scratch,
}

impl Staged {
    /// Prepares to write the file `target`. Fails early if it cannot be written.
    pub fn file(target: &Path) -> Result<Staged> {
        Staged::new(target, |target, found| {
            if found.is_dir() {
                bail!("{} is a folder; name a file to write", target.display());
            }
            if !found.is_file() {
                bail!("{} is a device, not a file; name a file to write", target.display());
            }
            Ok(())
        })
    }

    /// Prepares to write the folder `target`. Fails early if it cannot be written or holds anything this program did not write.
    pub fn folder(target: &Path, kind: Kind) -> Result<Staged> {
        Staged::new(target, |target, found| {
            if !found.is_dir() {
                bail!("{} is a file; name a folder to write", target.display());
            }
            let foreign =
                kind.foreign_entry(target).with_context(|| format!("cannot read {}", target.display()))?;
            match foreign {
                None => Ok(()),
                Some(_) if kind == Kind::Maps => bail!(
                    "{} exists; maps that may have been edited are never replaced, so choose another folder (-o)",
                    target.display()
                ),
                Some(foreign) if foreign == target => bail!(
                    "{} exists and was not written by this command; choose another folder",
                    target.display()
                ),
                Some(foreign) => bail!(
                    "{} exists and holds {}, which this command did not write; choose another folder",
                    target.display(),
                    foreign.strip_prefix(target).unwrap_or(&foreign).display()
                ),
            }
        })
    }

    fn new(target: &Path, check: impl FnOnce(&Path, &fs::Metadata) -> Result<()>) -> Result<Staged> {
        // A link is followed: its target is replaced, and the link stays.
        let linked = fs::symlink_metadata(target).is_ok_and(|found| found.is_symlink());
        let target = if linked {
            fs::canonicalize(target).with_context(|| format!("{} is a broken link", target.display()))?
        } else {
            target.to_path_buf()
        };
        let name = target
            .file_name()
            .with_context(|| format!("{} does not name a file or folder to write", target.display()))?
            .to_owned();
        if let Ok(found) = fs::metadata(&target) {
            check(&target, &found)?;
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if !parent.is_dir() {
            bail!("cannot write {}: there is no folder {}", target.display(), parent.display());
        }
        let folder = Scratch::beside(parent).map_err(|error| {
            // The error's own text names the staging folder, which means nothing to the user.
            let inner = error.get_ref().and_then(|error| error.source()?.downcast_ref::<io::Error>());
            let code = error.raw_os_error().or_else(|| inner.and_then(io::Error::raw_os_error));
            let reason = code.map_or(error, io::Error::from_raw_os_error);
            anyhow::anyhow!("cannot write in {}: {reason}", parent.display())
        })?;
        Ok(Staged { inside: folder.path().join(name), target, folder })
    }

    /// Where to write; nothing exists there yet.
    pub fn path(&self) -> &Path {
        &self.inside
    }

    /// Where to write, as a folder that was created.
    pub fn create(&self) -> Result<&Path> {
        fs::create_dir(&self.inside).with_context(|| format!("cannot write {}", self.target.display()))?;
        Ok(&self.inside)
    }

    /// Moves what was written to its own name, replacing what was there.
    pub fn commit(self) -> Result<()> {
        if let Some(old) = format_of(&self.target)
            && let Some(new) = format_of(&self.inside)
            && old != new
        {
            bail!("{} exists and is {old}, not {new}; choose another name", self.target.display());
        }
        // Held to the end, so that an interruption waits until the new output has replaced the old.
        let mut folders = scratch::folders();
        let was_there = self.target.exists();
        if let Err(error) = durable::place(&self.inside, &self.target) {
            // An old folder that was put aside and does not go back is in the staging folder, which stays.
            if was_there && !self.target.exists() {
                let kept = self.folder.keep(&mut folders);
                bail!(
                    "cannot write {}: {error}; the previous contents are in {}",
                    self.target.display(),
                    kept.display()
                );
            }
            return Err(error).with_context(|| format!("cannot write {}", self.target.display()));
        }
        folders.retain(|path| path != self.folder.path());
        Ok(())
    }
}

/// Writes a file, in a folder that is staged.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// A document's name as a file name, without blanks, so that it can be typed as it stands. Names come from documents, which
/// must not decide where this program writes.
pub fn file_name(name: &str) -> String {
    const LONGEST: usize = 80;
    let plain: String = name
        .trim()
        .chars()
        .map(|c| if c.is_control() || c.is_whitespace() || "/\\:*?\"<>|".contains(c) { '-' } else { c })
        .take(LONGEST)
        .collect();
    let plain = plain.trim_start_matches(['.', '-']).trim_end_matches(['.', ' ']);
    // File systems count bytes.
    let cut = (0..=plain.len().min(2 * LONGEST)).rev().find(|&at| plain.is_char_boundary(at)).unwrap_or(0);
    if cut == 0 { "document".into() } else { plain[..cut].to_owned() }
}

/// Waits for ever if the program is being stopped. Called before the program ends with a failure, which may only be that the
/// staging folder was removed while it was in use.
pub fn yield_to_interrupt() {
    drop(scratch::folders());
}

type End = Box<dyn FnOnce() + Send>;

static END: std::sync::Mutex<Option<End>> = std::sync::Mutex::new(None);

/// What to do beside all else when the program is told to stop. It may end the program by itself, as a server does, which is always
/// ended so.
#[cfg(feature = "serve")]
pub fn at_interrupt(end: impl FnOnce() + Send + 'static) {
    *END.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(end));
}

/// Removes what is staged, and every other temporary folder, when the program is told to stop, which then ends with exit
/// code 130.
pub fn remove_on_interrupt() -> Result<()> {
    ctrlc::set_handler(|| {
        // First, so that none of them writes into a folder that is being removed.
        process::stop_all();
        // Never released, so that from here on nothing new is staged and nothing is moved to its destination.
        let paths = scratch::folders();
        for path in paths.iter() {
            // A stage may still be writing into the folder; a second try catches what it added meanwhile.
            for _ in 0..3 {
                match fs::remove_dir_all(path) {
                    Err(error) if error.kind() != io::ErrorKind::NotFound => {}
                    _ => break,
                }
            }
        }
        if let Some(end) = END.lock().unwrap_or_else(PoisonError::into_inner).take() {
            end();
        }
        let farewell = FAREWELL.lock().unwrap_or_else(PoisonError::into_inner);
        let text = farewell.as_deref().unwrap_or("nothing unfinished is left behind");
        say("");
        say(&format!("foilpress: interrupted; {text}"));
        std::process::exit(130);
    })
    .context("cannot watch for Ctrl-C")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn nothing_is_left_when_the_work_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let staged = Staged::folder(&folder.path().join("out.print"), Kind::Print).unwrap();
        fs::write(staged.create().unwrap().join("half"), "x").unwrap();
        drop(staged);
        assert!(entries(folder.path()).is_empty());
    }

    #[test]
    fn our_own_folder_is_replaced_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.print");
        for round in ["one", "two"] {
            let staged = Staged::folder(&target, Kind::Print).unwrap();
            let inside = staged.create().unwrap();
            fs::write(inside.join("report.json"), round).unwrap();
            fs::create_dir(inside.join("passes")).unwrap();
            for file in ["passes/passes.toml", "passes/01-cyan.png"] {
                fs::write(inside.join(file), round).unwrap();
            }
            staged.commit().unwrap();
            assert_eq!(fs::read_to_string(target.join("report.json")).unwrap(), round);
            assert_eq!(entries(folder.path()), ["out.print"]);
        }
        // Of another kind, and with something of the user's at any depth, however like ours it is called.
        assert!(Staged::folder(&target, Kind::Foil).is_err());
        for mine in [
            "passes/thesis",
            "passes/thesis.png",
            "thesis",
            "preview-mine.png",
            "mask-rim.png",
            "passes/2024-holiday.png",
        ] {
            fs::write(target.join(mine), "x").unwrap();
            let said = Staged::folder(&target, Kind::Print).err().unwrap().to_string();
            assert!(said.contains(mine), "{said}");
            fs::remove_file(target.join(mine)).unwrap();
        }
        assert!(Staged::folder(&target, Kind::Print).is_ok());
        // A report alone does not make a folder ours.
        fs::write(folder.path().join("report.json"), "{}").unwrap();
        assert!(Staged::folder(folder.path(), Kind::Print).is_err());
    }

    #[test]
    fn maps_are_never_replaced_and_the_message_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("leaf");
        let staged = Staged::folder(&target, Kind::Maps).unwrap();
        fs::write(staged.create().unwrap().join("metallic.png"), "x").unwrap();
        staged.commit().unwrap();
        let said = Staged::folder(&target, Kind::Maps).err().unwrap().to_string();
        assert!(said.contains("may have been edited") && !said.contains("did not write"), "{said}");
    }

    /// Art is called like the passes that `inspect` writes.
    #[test]
    fn pictures_of_passes_do_not_take_the_place_of_art() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("art");
        let plane = sheet::Plane { width: 8, length: 8, stride: 1, bits: vec![0; 8] };
        for _ in 0..2 {
            let staged = Staged::folder(&target, Kind::Pictures).unwrap();
            press::separate::files::save_plane(
                &plane,
                (600, 600),
                &staged.create().unwrap().join("01-white.png"),
            )
            .unwrap();
            staged.commit().unwrap();
        }
        image::GrayImage::new(8, 8).save(target.join("02-gold.png")).unwrap();
        let said = Staged::folder(&target, Kind::Pictures).err().unwrap().to_string();
        assert!(said.contains("02-gold.png, which this command did not write"), "{said}");
    }

    #[test]
    fn a_file_never_takes_the_place_of_one_in_another_format() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("art.svg");
        fs::write(&target, "<svg/>").unwrap();
        let staged = Staged::file(&target).unwrap();
        fs::write(staged.path(), b"\x1b\x65job").unwrap();
        let said = staged.commit().unwrap_err().to_string();
        assert!(
            said.ends_with("is a drawing or another XML file, not a print job; choose another name"),
            "{said}"
        );
        assert_eq!(fs::read_to_string(&target).unwrap(), "<svg/>");
        assert_eq!(entries(folder.path()), ["art.svg"]);
    }

    #[test]
    fn a_file_is_replaced_in_one_step() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("job.rgl");
        fs::write(&target, "old").unwrap();
        let staged = Staged::file(&target).unwrap();
        fs::write(staged.path(), "new").unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
    }

    #[test]
    fn a_file_never_takes_the_place_of_a_folder_nor_a_folder_that_of_a_file() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Staged::file(folder.path()).is_err());
        let file = folder.path().join("notes");
        fs::write(&file, "x").unwrap();
        assert!(Staged::folder(&file, Kind::Print).is_err());
        #[cfg(unix)]
        assert!(Staged::file(Path::new("/dev/null")).is_err());
    }

    #[test]
    #[cfg(unix)]
    fn what_a_link_leads_to_is_replaced_and_the_link_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("job.rgl"), folder.path().join("latest"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        let staged = Staged::file(&link).unwrap();
        fs::write(staged.path(), "new").unwrap();
        staged.commit().unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
    }

    #[test]
    fn a_documents_name_leads_nowhere() {
        for (name, expected) in [
            ("leaf", "leaf"),
            ("../../evil", "evil"),
            ("metal/gold", "metal-gold"),
            ("", "document"),
            ("..", "document"),
            (" \n ", "document"),
            ("-o", "o"),
            ("Gold \u{5370}", "Gold-\u{5370}"),
            ("ramp SF MS", "ramp-SF-MS"),
        ] {
            assert_eq!(file_name(name), expected, "{name}");
        }
        assert!(file_name(&"\u{5370}".repeat(500)).len() < 200);
    }
}
