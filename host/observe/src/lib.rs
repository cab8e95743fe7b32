//! What every stage reports, without knowing who reads it: its progress to an [`Observer`], its errors
//! [with their causes](with_causes) and [by whose fault](Diagnosis), and text of files as terminals [may show it](visible).

mod diagnosis;
mod text;

pub use diagnosis::{Diagnosis, Fault, Hint, with_hints};
pub use text::{visible, visible_line};

/// Watches a stage at work. Calls may come from several threads.
pub trait Observer: Sync {
    /// A stage begins; `total` steps will be reported through [`Observer::advance`].
    fn begin(&self, stage: &str, total: u64);
    /// Some steps of the current stage are done.
    fn advance(&self, steps: u64);
    /// The current stage is done.
    fn end(&self);
    /// Something the user should know, in a sentence.
    fn note(&self, text: &str);
}

/// Watches nothing.
pub struct Silent;

impl Observer for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn end(&self) {}
    fn note(&self, _text: &str) {}
}

/// Hands on notes alone: for work beside a stage that is shown.
pub struct Beside<'a>(pub &'a dyn Observer);

impl Observer for Beside<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}

    fn advance(&self, _steps: u64) {}

    fn end(&self) {}

    fn note(&self, text: &str) {
        self.0.note(text);
    }
}

/// An error with its causes: `what happened: its cause: the cause of that`.
///
/// The text of an error in these crates never includes its source, so each cause is said once. Wherever an error becomes
/// text for people (a message, a note, JSON, a line for the print system) this is the function that makes it.
#[must_use]
pub fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string().trim_end().to_owned();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        // Parsers of text files end their messages with a line break.
        text.push_str(error.to_string().trim_end());
        cause = error.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;
    use std::fmt;

    #[derive(Debug)]
    struct Link(&'static str, Option<Box<Link>>);

    impl fmt::Display for Link {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(self.0)
        }
    }

    impl Error for Link {
        fn source(&self) -> Option<&(dyn Error + 'static)> {
            self.1.as_deref().map(|link| link as _)
        }
    }

    #[test]
    fn an_error_is_followed_by_each_of_its_causes() {
        let cause = Link("the disk is full\n", None);
        let error = Link("not saved", Some(Box::new(Link("cannot write", Some(Box::new(cause))))));
        assert_eq!(with_causes(&error), "not saved: cannot write: the disk is full");
    }
}
