//! A curve of another document that takes the place of a basis.

use std::path::Path;
use std::sync::Arc;

use files::shelf::Shelf;
use inks::Curve;
use observe::Observer;

use super::error::EditError;
use crate::brdf::Space;
use crate::document::{self, Content, DocumentError, Options, foil};
use crate::materials::check_reflectance;

/// The longest curve file, in bytes, as in documents: 65,536 rows, which is the most that a curve may have,
/// of 256 characters each.
const MOST_BYTES: u64 = 16 << 20;

/// The curve of a measured material, or of a basis of another document.
#[derive(Clone, Debug, PartialEq)]
pub struct Replacement {
    /// Where it comes from, for people.
    pub name: String,
    /// Its reflectance (1/sr), a row of the document's space.
    pub row: Vec<f64>,
}

impl Replacement {
    /// Opens `DOC`, which has one material, or `DOC:N`, basis N of a factored document. `space` is that of the document to edit.
    ///
    /// # Errors
    /// A document that cannot be read or has several materials, a basis that it does not have.
    pub fn open(
        shelf: &Arc<dyn Shelf>,
        text: &str,
        space: &Space,
        observer: &dyn Observer,
    ) -> Result<Replacement, EditError> {
        let name = text.chars().filter(|c| !c.is_control()).collect::<String>();
        let refused = |problem: String| EditError::Replacement { name: name.clone(), problem };
        // A name with a colon and a number may also be that of a file.
        let numbered =
            text.rsplit_once(':').and_then(|(path, basis)| Some((path, basis.parse::<usize>().ok()?)));
        let (path, basis) = match numbered {
            Some((path, basis)) if shelf.kind(Path::new(text)).is_err() => (path, Some(basis)),
            _ => (text, None),
        };
        let ending = Path::new(path).extension();
        if basis.is_none() && ending.is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
            let path = Path::new(path);
            let bytes = document::source::Source::new(&**shelf, observer).read(path, MOST_BYTES)?;
            let curve = Curve::from_csv(&bytes[..], path).map_err(DocumentError::from)?;
            return Replacement::checked(name.clone(), foil::row(space, &curve), refused);
        }
        let options =
            Options { samples: space.angles().len(), shelf: Arc::clone(shelf), ..Options::default() };
        let document = document::open(path, &options, observer)?;
        let row = match (&document.content, basis) {
            (Content::Uniform(_), None) => {
                let mut row = vec![0.0; space.columns()];
                document.materials().reflectance(0, &mut row);
                row.into_iter().map(f64::from).collect()
            }
            (Content::Uniform(_), Some(_)) => {
                return Err(refused("it is a single material without bases; leave the number out".into()));
            }
            (Content::Factored(other), basis) => {
                let bases = other.bases.len();
                let basis = match basis {
                    Some(basis) => basis,
                    None if bases == 1 => 0,
                    None => {
                        return Err(refused(format!(
                            "it has {bases} bases; name one of them, such as `{path}:0`"
                        )));
                    }
                };
                if basis >= bases {
                    return Err(refused(format!(
                        "there is no basis {basis} among its {bases}, counted from 0"
                    )));
                }
                foil::row(space, &other.space.curve(other.bases.row(basis)))
            }
            (Content::Surfaces(_), _) => {
                return Err(refused(
                    "it has a material for every pixel; factor it, and name one of its bases".into(),
                ));
            }
        };
        Replacement::checked(name.clone(), row, refused)
    }

    fn checked(
        name: String,
        row: Vec<f64>,
        refused: impl Fn(String) -> EditError,
    ) -> Result<Replacement, EditError> {
        check_reflectance(&row).map_err(|error| refused(error.to_string()))?;
        Ok(Replacement { name, row })
    }
}
