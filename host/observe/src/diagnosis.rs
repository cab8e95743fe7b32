//! Errors sorted by whose fault they are.
//!
//! Problem: what a person can do about an error depends on whether a file, a setting or a missing program is the cause, and
//! only the program that they use knows how its settings are changed.
//! Method: a [`Diagnosis`] says what is wrong, and carries beside it the fault, what to do, and the settings to do it with by their
//! names. A command line turns them into options, a print queue into its own settings.
//! Limits: names of settings are those of the long options of the command line.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

/// Whose fault an error is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A file cannot be read, is damaged, of an unknown format, or unsuitable.
    File,
    /// A name in a file may or may not be meant as that of an ink.
    Name,
    /// A setting is out of range, or does not suit the file.
    Setting,
    /// A program that is needed is not installed.
    Missing,
    /// There is nothing to print.
    Nothing,
}

/// What to do about an error.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hint {
    /// In words that name no option; may be empty.
    pub words: String,
    /// The settings that do it, by their names, each with a value to give it or an empty text.
    pub settings: Vec<(&'static str, String)>,
}

/// Why a stage does not do what it was asked for.
///
/// As text it is the message and the words of its hints; with `{:#}` the message alone.
#[derive(Debug)]
pub struct Diagnosis {
    fault: Fault,
    path: Option<PathBuf>,
    message: String,
    hints: Vec<Hint>,
    source: Option<Box<dyn Error + Send + Sync>>,
}

impl Diagnosis {
    /// A diagnosis with this message.
    #[must_use]
    pub fn new(fault: Fault, message: impl Into<String>) -> Diagnosis {
        Diagnosis { fault, path: None, message: message.into(), hints: Vec::new(), source: None }
    }

    /// A file that is damaged, of an unknown format, or unsuitable.
    #[must_use]
    pub fn of_file(path: &Path, problem: impl Into<String>) -> Diagnosis {
        Diagnosis { path: Some(path.to_path_buf()), ..Diagnosis::new(Fault::File, problem) }
    }

    /// A setting that does not suit the file.
    #[must_use]
    pub fn of_setting(setting: &'static str, problem: impl fmt::Display) -> Diagnosis {
        Diagnosis::new(Fault::Setting, format!("{setting}: {problem}")).set(setting, "")
    }

    /// The same about this file.
    #[must_use]
    pub fn about(self, path: &Path) -> Diagnosis {
        Diagnosis { path: Some(path.to_path_buf()), ..self }
    }

    /// The same with another name for the file, if it names one.
    #[must_use]
    pub fn calling_it(self, name: &str) -> Diagnosis {
        Diagnosis { path: self.path.as_ref().map(|_| name.into()), ..self }
    }

    /// The same with a cause.
    #[must_use]
    pub fn because(self, source: impl Into<Box<dyn Error + Send + Sync>>) -> Diagnosis {
        Diagnosis { source: Some(source.into()), ..self }
    }

    /// The same with one more thing to do.
    #[must_use]
    pub fn hint(mut self, words: impl Into<String>) -> Diagnosis {
        self.hints.push(Hint { words: words.into(), settings: Vec::new() });
        self
    }

    /// The same with a setting that does what the last hint says, and a value for it or an empty text.
    #[must_use]
    pub fn set(mut self, setting: &'static str, value: impl Into<String>) -> Diagnosis {
        if self.hints.is_empty() {
            self.hints.push(Hint::default());
        }
        if let Some(hint) = self.hints.last_mut() {
            hint.settings.push((setting, value.into()));
        }
        self
    }

    /// Whose fault it is.
    #[must_use]
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// What to do about it.
    #[must_use]
    pub fn hints(&self) -> &[Hint] {
        &self.hints
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(path) = &self.path {
            write!(f, "{}: ", path.display())?;
        }
        f.write_str(&self.message)?;
        let hints = if f.alternate() { &[][..] } else { &self.hints };
        let words = hints.iter().map(|hint| &hint.words).filter(|words| !words.is_empty());
        words.into_iter().try_for_each(|words| write!(f, "; {words}"))
    }
}

impl Error for Diagnosis {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source.as_deref().map(|source| source as _)
    }
}

/// An error with its causes, as [`with_causes`](crate::with_causes) says it but without hints, and the hints of all of them.
#[must_use]
pub fn with_hints<'a>(error: &'a (dyn Error + 'static)) -> (String, Vec<&'a Hint>) {
    let (mut text, mut hints) = (String::new(), Vec::new());
    let mut cause = Some(error);
    while let Some(error) = cause {
        let said = match error.downcast_ref::<Diagnosis>() {
            Some(diagnosis) => {
                hints.extend(diagnosis.hints());
                format!("{diagnosis:#}")
            }
            None => error.to_string(),
        };
        if !text.is_empty() {
            text.push_str(": ");
        }
        text.push_str(said.trim_end());
        cause = error.source();
    }
    (text, hints)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hints_are_beside_the_message() {
        let cause = std::io::Error::other("the disk is on fire");
        let diagnosis = Diagnosis::of_file(Path::new("art.png"), "it is too large")
            .because(cause)
            .hint("print it smaller")
            .set("size", "20mm")
            .set("dpi", "");
        assert_eq!(diagnosis.to_string(), "art.png: it is too large; print it smaller");
        let (text, hints) = with_hints(&diagnosis);
        assert_eq!(text, "art.png: it is too large: the disk is on fire");
        let settings = vec![("size", "20mm".to_owned()), ("dpi", String::new())];
        assert_eq!(hints, [&Hint { words: "print it smaller".into(), settings }]);
        assert_eq!(
            diagnosis.calling_it("this document").to_string(),
            "this document: it is too large; print it smaller"
        );
        let setting = Diagnosis::of_setting("finish", "there is no finish");
        assert_eq!(
            (setting.fault(), setting.to_string()),
            (Fault::Setting, "finish: there is no finish".into())
        );
    }
}
