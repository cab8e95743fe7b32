//! The one way to standard output and standard error.
//!
//! Problem: what people read is made of names, texts and answers of files and devices of unknown origin.
//! Method: every byte for people goes through [`stdout`], [`stderr`] or [`say`], which show what would act on the terminal as an
//! escape ([`observe::visible`]). The program's own colours and movements of the cursor are written beside them with [`draw`].
//! A note or an error may have several lines; those after the first are indented, so that none can be taken for another message.
//! Limits: in results, a line break of a name is a line break; readers of files keep such names out.
//! Jobs for the print system go to standard output as they are, and clap draws its help by itself.

use std::io::{self, IsTerminal, Stderr, StdoutLock, Write};

use anyhow::{Context, Result};
use observe::visible;

/// Indents the lines of a message after the first.
const CONTINUED: &str = "\n    ";

/// A writer of text that shows what would act on a terminal as escapes. Bytes that are no text become U+FFFD.
pub struct Visible<W>(W);

impl<W: Write> Write for Visible<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let (text, length) = match str::from_utf8(bytes) {
            Ok(text) => (text, bytes.len()),
            Err(error) if error.valid_up_to() == 0 => ("\u{fffd}", error.error_len().unwrap_or(bytes.len())),
            // The rest comes with the next call.
            Err(error) => {
                let whole = error.valid_up_to();
                (str::from_utf8(&bytes[..whole]).unwrap_or_default(), whole)
            }
        };
        self.0.write_all(visible(text).as_bytes())?;
        Ok(length)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<W: IsTerminal> Visible<W> {
    /// Whether a person sees what is written.
    pub fn is_terminal(&self) -> bool {
        self.0.is_terminal()
    }
}

/// Standard output, for results.
#[expect(clippy::disallowed_methods, reason = "what it writes is escaped")]
pub fn stdout() -> Visible<StdoutLock<'static>> {
    Visible(io::stdout().lock())
}

/// Standard error, for questions; [`say`] writes messages. It is not locked: threads that report do not wait for a question.
#[expect(clippy::disallowed_methods, reason = "what it writes is escaped")]
pub fn stderr() -> Visible<Stderr> {
    Visible(io::stderr())
}

/// Writes a result to standard output.
pub fn show(text: &str) -> Result<()> {
    stdout().write_all(text.as_bytes()).context("cannot write to standard output")
}

/// Writes text with the program's own escape sequences to standard output; nothing in it comes from a file.
#[expect(clippy::disallowed_methods, reason = "the sequences are the program's own")]
pub fn draw(text: &str) -> io::Result<()> {
    io::stdout().lock().write_all(text.as_bytes())
}

/// Writes a message to standard error, such as a note. A closed standard error does not stop the work.
pub fn say(text: &str) {
    let line = text.trim_end().replace('\n', CONTINUED) + "\n";
    // At once, so that threads do not write into each other's lines.
    let _ = stderr().write_all(line.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(pieces: &[&[u8]]) -> String {
        let mut out = Visible(Vec::new());
        for piece in pieces {
            out.write_all(piece).unwrap();
        }
        String::from_utf8(out.0).unwrap()
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({ "name": "a\u{9b}31m\u{202e}\u{1b}]0;x\u{7}\n" });
        let text = written(&[serde_json::to_string_pretty(&value).unwrap().as_bytes()]);
        assert!(text.contains("\\u009b31m\\u202e\\u001b]0;x"), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }

    proptest! {
        #[test]
        fn whatever_is_written_nothing_acts_on_the_terminal(pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 0..4)) {
            let pieces: Vec<&[u8]> = pieces.iter().map(Vec::as_slice).collect();
            let text = written(&pieces);
            prop_assert_eq!(text.matches('\n').count(), pieces.concat().iter().filter(|&&byte| byte == b'\n').count());
            prop_assert_eq!(observe::visible(&text), text.as_str());
            for c in text.chars().filter(|c| *c != '\n') {
                prop_assert!(!c.is_control(), "{c:?}");
            }
        }

        #[test]
        fn text_that_only_says_something_stays(text in "[ -~äßñ日本שלום…]*") {
            prop_assert_eq!(written(&[text.as_bytes()]), text);
        }
    }
}
