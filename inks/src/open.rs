//! Opening a library: the built-in text, or a folder that may be based on it.

use std::path::Path;
use std::sync::LazyLock;

use files::shelf::Shelf;

use crate::library::Library;
use crate::problem::Problem;
use crate::read::{self, Folder};
use crate::rule::Severity;

/// Why a folder is not a valid library.
#[derive(Debug, thiserror::Error)]
pub enum LibraryError {
    /// The library has errors; the list may contain warnings and notes too.
    #[error("{}", summary(problems))]
    Problems {
        /// All findings.
        problems: Vec<Problem>,
    },
}

fn summary(problems: &[Problem]) -> String {
    let errors: Vec<_> = problems.iter().filter(|p| p.severity == Severity::Error).collect();
    let mut text: Vec<String> = errors.iter().take(5).map(ToString::to_string).collect();
    if errors.len() > 5 {
        text.push(format!("and {} more errors; check the library to list all of them", errors.len() - 5));
    }
    text.join("\n")
}

const BUILTIN: &str = include_str!("../library/library.toml");

static CHECKED_BUILTIN: LazyLock<Library> =
    LazyLock::new(|| match read::parse(BUILTIN, "built-in".as_ref(), None) {
        (Some(library), _) => library,
        // The text is part of the program and tested, so no input can cause this.
        (None, problems) => panic!("{}", summary(&problems)),
    });

impl Library {
    /// The library that comes with the program: every curve modelled.
    pub fn builtin() -> Library {
        CHECKED_BUILTIN.clone()
    }

    /// Reads the library in a folder: `library.toml` and its curves.
    pub fn open(shelf: &dyn Shelf, folder: &Path) -> Result<Library, LibraryError> {
        match read::folder(Folder { shelf, path: folder }, Library::builtin) {
            (Some(library), _) => Ok(library),
            (None, problems) => Err(LibraryError::Problems { problems }),
        }
    }

    /// All findings about the library in a folder, the most severe first.
    pub fn check(shelf: &dyn Shelf, folder: &Path) -> Vec<Problem> {
        let (_, mut problems) = read::folder(Folder { shelf, path: folder }, Library::builtin);
        problems.sort_by_key(|problem| std::cmp::Reverse(problem.severity));
        problems
    }
}
