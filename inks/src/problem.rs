//! Findings about a library: what is wrong, where, and how severe it is.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::rule::Severity;

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// The file.
    pub file: PathBuf,
    /// Line, counted from one, if the finding concerns one.
    pub line: Option<usize>,
    /// The field, such as `ink cyan: filter.alpha`; empty for the file as a whole.
    pub field: String,
    /// How severe it is.
    pub severity: Severity,
    /// What was found, what was expected, what to do.
    pub text: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}: ", self.severity)?;
        if !self.field.is_empty() {
            write!(f, "{}: ", self.field)?;
        }
        f.write_str(&self.text)
    }
}

/// Collects findings about one text.
pub(crate) struct Findings<'a> {
    pub text: &'a str,
    pub file: PathBuf,
    pub found: Vec<Problem>,
}

impl Findings<'_> {
    /// The line of a byte offset.
    fn line(&self, offset: usize) -> usize {
        let before = &self.text.as_bytes()[..offset.min(self.text.len())];
        1 + before.iter().filter(|&&byte| byte == b'\n').count()
    }

    /// Adds a finding at a byte offset of the text.
    pub fn add(
        &mut self,
        severity: Severity,
        offset: Option<usize>,
        field: impl Into<String>,
        text: impl Into<String>,
    ) {
        let line = offset.map(|offset| self.line(offset));
        let (field, text) = (field.into(), text.into());
        self.found.push(Problem { file: self.file.clone(), line, field, severity, text });
    }

    /// Adds an error.
    pub fn error(&mut self, offset: Option<usize>, field: impl Into<String>, text: impl Into<String>) {
        self.add(Severity::Error, offset, field, text);
    }

    /// Whether anything found makes the library unusable.
    pub fn fatal(&self) -> bool {
        self.found.iter().any(|problem| problem.severity == Severity::Error)
    }
}
