//! Curves that a library's owner gives: their files in its folder, and the stacks they belong to.
//!
//! A file's name may not lead out of the folder, its length is bounded, and what is wrong in it is found with its line.

use std::path::{Path, PathBuf};

use files::shelf::inside;

use super::Folder;
use super::fields::{MOST_CURVE_BYTES, parse_stack, provenance, text};
use crate::curve::{Curve, CurveError};
use crate::format::MeasuredTable;
use crate::problem::{Findings, Problem};
use crate::provenance::Provenance;
use crate::rule::Severity;
use crate::stack::Stack;
use crate::uncertainty::Uncertainty;

/// A measured or predicted curve as it was read.
pub(super) struct ReadCurve {
    pub curve: Curve,
    pub uncertainty: Option<Uncertainty>,
    pub provenance: Provenance,
    pub file: PathBuf,
}

/// A listed stack and its position in the text.
pub(super) struct Listing {
    pub stack: Stack,
    pub offset: Option<usize>,
    pub measured: Option<ReadCurve>,
}

/// Reads a `measured` or `predicted` curve and assigns it to its stack, which is appended to the list if it is new.
pub(super) fn given(
    table: &MeasuredTable,
    word: &str,
    folder: Option<Folder<'_>>,
    wanted: &mut Vec<Listing>,
    findings: &mut Findings,
) {
    let owner = format!("{word} {}", table.stack.get_ref());
    let offset = table.stack.span().start;
    let stack = parse_stack(table.stack.get_ref(), &owner, offset, findings);
    provenance(&owner, &format!("{word} curve"), [&table.by, &table.when, &table.setup], findings);
    let field = format!("{owner}.curve");
    let curve = match path_of(folder, table.curve.get_ref()) {
        Ok((folder, path)) => {
            curve(folder, &path, findings, table.curve.span().start, &field).map(|(c, u)| (c, u, path))
        }
        Err(problem) => {
            findings.error(Some(table.curve.span().start), field, problem);
            None
        }
    };
    let (Some(stack), Some((curve, uncertainty, file))) = (stack, curve) else { return };
    let (by, when, setup) =
        (table.by.get_ref().clone(), table.when.get_ref().clone(), table.setup.get_ref().clone());
    let provenance = match word {
        "measured" => Provenance::Measured { by, when, setup },
        _ => Provenance::Predicted { by, when, setup },
    };
    let place = wanted.iter().position(|want| want.stack == stack).unwrap_or_else(|| {
        wanted.push(Listing { stack, offset: Some(offset), measured: None });
        wanted.len() - 1
    });
    if let Some(other) = &wanted[place].measured {
        let problem = match other.provenance.word() {
            other if other == word => format!("is {word} twice"),
            other => format!("is {other} as well; a stack has one curve"),
        };
        findings.error(Some(offset), owner, problem);
    }
    wanted[place].offset.get_or_insert(offset);
    wanted[place].measured = Some(ReadCurve { curve, uncertainty, provenance, file });
}

/// The path of a file inside the folder; names that lead out of it are errors.
fn path_of<'a>(folder: Option<Folder<'a>>, name: &str) -> Result<(Folder<'a>, PathBuf), String> {
    let folder = folder.ok_or("a library without a folder cannot have curve files")?;
    let path = inside(folder.path, name);
    let path =
        path.ok_or_else(|| format!("`{name}` must be the name of a file inside the library's folder"))?;
    Ok((folder, path))
}

/// Reads a curve and its standard deviations, if it has them.
fn curve(
    folder: Folder<'_>,
    path: &Path,
    findings: &mut Findings,
    offset: usize,
    field: &str,
) -> Option<(Curve, Option<Uncertainty>)> {
    let text = match text(folder.shelf, path, MOST_CURVE_BYTES) {
        Ok(text) => text,
        Err(problem) => {
            findings.error(Some(offset), field, format!("{}: {problem}", path.display()));
            return None;
        }
    };
    let curve = Curve::from_csv(text.as_bytes(), path);
    match curve.and_then(|curve| Ok((curve, Uncertainty::from_csv(&text, path)?))) {
        Ok(read) => Some(read),
        Err(CurveError::Csv { path, line, problem }) => {
            findings.found.push(Problem {
                file: path,
                line: usize::try_from(line).ok().filter(|&line| line > 0),
                field: field.into(),
                severity: Severity::Error,
                text: problem,
            });
            None
        }
        Err(error) => {
            findings.error(Some(offset), field, error.to_string());
            None
        }
    }
}

/// Warns about curves in the folder that the library does not use, probably by mistake.
pub(super) fn unused(Folder { shelf, path: folder }: Folder<'_>, named: &[String], findings: &mut Findings) {
    let unused = shelf
        .list(folder)
        .unwrap_or_default()
        .into_iter()
        .map(|(name, _)| folder.join(name))
        .filter(|path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")))
        .filter(|path| !named.iter().any(|name| folder.join(name) == *path));
    for file in unused.take(100) {
        findings.found.push(Problem {
            file,
            line: None,
            field: String::new(),
            severity: Severity::Warning,
            text: "this curve is not used by any `[[measured]]` or `[[predicted]]`".into(),
        });
    }
}
