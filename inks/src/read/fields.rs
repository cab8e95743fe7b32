//! Single fields of a library and of its files, checked: texts of bounded length, stacks, and who measured when and how.

use std::path::Path;

use files::FileError;
use files::shelf::Shelf;
use toml::Spanned;

use crate::problem::Findings;
use crate::stack::Stack;

/// The most layers: far more than can be printed, as a limit for hostile files.
const MOST_LAYERS: usize = 16;
/// The largest curve file, in bytes.
pub(crate) const MOST_CURVE_BYTES: u64 = 16 << 20;

/// Reads a text file of at most `most` bytes.
pub(super) fn text(shelf: &dyn Shelf, path: &Path, most: u64) -> Result<String, String> {
    let bytes = shelf.read(path, most).map_err(|error| match error {
        // Whoever reads this knows the file already.
        FileError::Io { source, .. } => source.to_string(),
        FileError::Large { .. } => format!("the file is longer than {most} bytes"),
        other => other.to_string(),
    })?;
    String::from_utf8(bytes).map_err(|error| format!("not UTF-8 text: {error}"))
}

/// Parses a stack, and reports an error if that fails.
pub(super) fn parse_stack(text: &str, field: &str, offset: usize, findings: &mut Findings) -> Option<Stack> {
    match text.parse::<Stack>() {
        Ok(stack) if stack.layers().len() <= MOST_LAYERS => Some(stack),
        Ok(stack) => {
            let problem = format!("{} layers; the limit is {MOST_LAYERS}", stack.layers().len());
            findings.error(Some(offset), field, problem);
            None
        }
        Err(error) => {
            findings.error(Some(offset), field, error.to_string());
            None
        }
    }
}

/// Checks who, when and how.
pub(super) fn provenance(
    owner: &str,
    what: &str,
    [by, when, setup]: [&Spanned<String>; 3],
    findings: &mut Findings,
) {
    for (name, value) in [("by", by), ("when", when), ("setup", setup)] {
        if value.get_ref().trim().is_empty() {
            let problem = format!("is empty; a {what} needs who, when and how");
            findings.error(Some(value.span().start), format!("{owner}.{name}"), problem);
        }
    }
    if !is_date(when.get_ref()) {
        let problem = format!("`{}` is not a date; expected YYYY-MM-DD or YYYY-MM", when.get_ref());
        findings.error(Some(when.span().start), format!("{owner}.when"), problem);
    }
}

/// `YYYY-MM` or `YYYY-MM-DD`, with a month and a day that exist in some year.
fn is_date(text: &str) -> bool {
    let number = |part: &str, digits: usize| -> Option<u32> {
        (part.len() == digits && part.bytes().all(|b| b.is_ascii_digit())).then(|| part.parse().ok())?
    };
    let parts: Vec<&str> = text.split('-').collect();
    let (year, month, day) = match parts[..] {
        [year, month] => (year, month, "01"),
        [year, month, day] => (year, month, day),
        _ => return false,
    };
    number(year, 4).is_some()
        && number(month, 2).is_some_and(|month| (1..=12).contains(&month))
        && number(day, 2).is_some_and(|day| (1..=31).contains(&day))
}
