//! Reading and writing the factored document, a folder.
//!
//! `NAME.foil/` contains `document.toml` (the index), `bases.csv` (`basis,theta_h_deg,r,g,b`, reflectance in 1/sr) and one
//! 16-bit grey PNG of weights per basis (`weights::grey`). The weights of every pixel must sum to one, up to
//! rounding to 16 bits. Writing fills a temporary folder and renames it at the end.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use files::FolderKind;
use files::shelf::Shelf;
use inks::Curve;
use serde::{Deserialize, Serialize};

use observe::Observer;

use super::content::MOST_BYTES;
use super::content::{Content, Document, check_size_mm};
use super::error::DocumentError;
use super::picture::{MOST_PIXELS, Picture};
use super::source::Source;
use crate::brdf::{Space, Table};
use crate::materials::{Factored, check_reflectance};
use crate::weights::WeightMaps;
use crate::weights::grey::{from_greys, to_grey};

/// The folder, and the file that marks it.
pub(super) const FOIL: FolderKind =
    FolderKind { name: "factored document", text: "document.toml", command: "factor" };

const BASES: &str = "bases.csv";

/// The version that is written, and the only one that is read: a number so that a later program can tell.
const FORMAT: u32 = 1;

/// The most bases. Each has its own map, and no document needs more than a few dozen.
pub(crate) const MOST_BASES: usize = 256;

/// The most weights in all, for memory's sake.
pub(crate) const MOST_WEIGHTS: usize = 1 << 30;

/// `document.toml`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Index {
    format: u32,
    name: String,
    width: usize,
    height: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    size_mm: Option<[f64; 2]>,
    /// Samples of the half angle, on the square-root grid.
    samples: usize,
    bases: String,
    /// One file per basis, in order.
    maps: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<Origin>,
}

/// What a factored document was made of, as long as nobody has changed it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The [digest](Document::digest) of the document that was factored.
    pub document: String,
    /// The [fingerprint](crate::edit::fingerprint) of its bases and weights.
    pub result: String,
}

#[derive(Serialize, Deserialize)]
struct BasisRow {
    basis: usize,
    theta_h_deg: f64,
    r: f64,
    g: f64,
    b: f64,
}

/// Writes a factored document as the folder `path`, which must not exist yet. Only half-angle tabulations can be written,
/// because the file contains curves. `origin` says what was factored, unless it was edited since.
pub fn write(
    factored: &Factored,
    name: &str,
    size_mm: Option<(f64, f64)>,
    origin: Option<Origin>,
    path: &Path,
) -> Result<(), DocumentError> {
    let angles = factored.space.angles();
    let field =
        |problem: String| DocumentError::Field { path: path.to_path_buf(), field: "bases".into(), problem };
    if angles.is_empty() {
        return Err(field(
            "only curves of the half angle can be written; this document uses another tabulation".into(),
        ));
    }
    if factored.bases.len() != factored.maps.channels() || factored.bases.len() > MOST_BASES {
        let (bases, maps) = (factored.bases.len(), factored.maps.channels());
        return Err(field(format!(
            "{bases} bases and {maps} maps; expected equal numbers, at most {MOST_BASES}"
        )));
    }
    files::new_folder(path)?;
    let (width, height) = (factored.maps.width(), factored.maps.height());
    let mut maps = Vec::new();
    let mut row = vec![0u8; 2 * width * height];
    for basis in 0..factored.maps.channels() {
        let file = format!("weights-{basis:02}.png");
        for (pixel, out) in row.chunks_exact_mut(2).enumerate() {
            out.copy_from_slice(&to_grey(factored.maps.at(pixel)[basis]).to_ne_bytes());
        }
        let at = path.join(&file);
        let picture = readers::png(&row, (width as u32, height as u32), readers::Pixel::Grey16)
            .map_err(files::io(&at, "write"))?;
        files::write(&at, |out| out.write_all(&picture))?;
        maps.push(file);
    }
    files::write(&path.join(BASES), |out| {
        let mut csv = csv::Writer::from_writer(out);
        for (basis, row) in factored.bases.rows().enumerate() {
            for (theta, value) in angles.iter().zip(row.chunks_exact(3)) {
                let theta_h_deg = theta.to_degrees();
                csv.serialize(BasisRow { basis, theta_h_deg, r: value[0], g: value[1], b: value[2] })?;
            }
        }
        csv.flush()
    })?;
    let index = Index {
        format: FORMAT,
        name: name.into(),
        width,
        height,
        size_mm: size_mm.map(|(w, h)| [w, h]),
        samples: angles.len(),
        bases: BASES.into(),
        maps,
        origin,
    };
    // Last, because a folder without it is no document.
    Ok(files::write_toml(&path.join(FOIL.text), &index)?)
}

/// Reads the factored document in the folder `path`.
pub fn read(shelf: &dyn Shelf, path: &Path, observer: &dyn Observer) -> Result<Document, DocumentError> {
    open(path, Source::new(shelf, observer))
}

/// What the factored document in the folder `path` was made of, if it says so.
///
/// # Errors
/// A file that cannot be read, or a wrong value in it.
pub fn origin(
    shelf: &dyn Shelf,
    path: &Path,
    observer: &dyn Observer,
) -> Result<Option<Origin>, DocumentError> {
    Ok(index(path, &mut Source::new(shelf, observer))?.origin)
}

fn index(path: &Path, source: &mut Source<'_>) -> Result<Index, DocumentError> {
    let at = path.join(FOIL.text);
    let text = source.read_text(&at).map_err(|error| match error {
        DocumentError::File(error) => FOIL.unless_missing(source.shelf(), path, error).into(),
        error => error,
    })?;
    let wrong = |problem: String| DocumentError::Settings { path: at, problem };
    match toml::from_str(&text) {
        Ok(index) => check(&index).map(|()| index).map_err(wrong),
        Err(error) => Err(wrong(error.to_string())),
    }
}

pub(super) fn open(path: &Path, mut source: Source<'_>) -> Result<Document, DocumentError> {
    let index = index(path, &mut source)?;
    let space = Space::half_angle(index.samples);
    let bases = read_bases(&path.join(&index.bases), &index, &space, &mut source)?;

    let channels = index.maps.len();
    source.observer.begin("reading", channels as u64);
    // The first map is read before memory for all maps is allocated, so the index alone allocates nothing.
    let mut data = Vec::new();
    for (channel, name) in index.maps.iter().enumerate() {
        let at = path.join(name);
        let bytes = source.read(&at, MOST_BYTES)?;
        let picture = Picture::decode(&bytes, &at, &mut source)?;
        let problem = match picture.sixteen() {
            _ if (picture.width, picture.height) != (index.width, index.height) => format!(
                "expected {} x {} weights, found {} x {}",
                index.width, index.height, picture.width, picture.height
            ),
            None => "expected weights as 16-bit grey".into(),
            Some(weights) => {
                data.resize(index.width * index.height * channels, 0);
                for (out, &w) in data.chunks_exact_mut(channels).zip(weights) {
                    out[channel] = w;
                }
                source.observer.advance(1);
                continue;
            }
        };
        return Err(DocumentError::Picture { path: at, problem });
    }
    source.observer.end();
    let mut grey = vec![0; channels];
    for weights in data.chunks_exact_mut(channels) {
        grey.copy_from_slice(weights);
        from_greys(&grey, weights);
    }
    let maps = WeightMaps::new(index.width, index.height, channels, data)
        .map_err(|source| DocumentError::Weights { path: path.to_path_buf(), source })?;
    let name = if index.name.is_empty() { source.name_of(path) } else { index.name };
    let (notes, digest) = source.finish();
    Ok(Document {
        name,
        content: Content::Factored(Factored { space, bases, maps }),
        size_mm: index.size_mm.map(|[w, h]| (w, h)),
        notes,
        digest,
        views: None,
    })
}

/// Checks the values in `document.toml`, before anything of that size is allocated.
fn check(index: &Index) -> Result<(), String> {
    if index.format != FORMAT {
        return Err(format!("format = {}: expected {FORMAT}", index.format));
    }
    let pixels = (index.width as u64).saturating_mul(index.height as u64);
    if pixels == 0 || pixels > MOST_PIXELS {
        return Err(format!("{} x {} pixels: expected 1 to {MOST_PIXELS}", index.width, index.height));
    }
    if index.maps.is_empty() || index.maps.len() > MOST_BASES {
        return Err(format!("maps: {} files; expected 1 to {MOST_BASES}", index.maps.len()));
    }
    if pixels * index.maps.len() as u64 > MOST_WEIGHTS as u64 {
        return Err(format!("{pixels} pixels of {} weights: too many for memory", index.maps.len()));
    }
    if index.samples == 0 || index.samples > 4096 {
        return Err(format!("samples = {}: expected 1 to 4096", index.samples));
    }
    if let Some(size) = index.size_mm {
        check_size_mm(size)?;
    }
    for name in index.maps.iter().chain([&index.bases]) {
        let plain = Path::new(name).components().eq([std::path::Component::Normal(name.as_ref())]);
        if !plain || name.contains('\\') {
            return Err(format!("`{name}` must be the name of a file in the same folder"));
        }
    }
    Ok(())
}

/// A curve as a row of the space. Samples on exactly its grid are used unchanged, so that writing and reading changes
/// nothing.
pub(crate) fn row(space: &Space, curve: &Curve) -> Vec<f64> {
    let (theta, grid) = (curve.theta(), space.angles());
    let on_grid = theta.len() == grid.len() && theta.iter().zip(grid).all(|(a, b)| (a - b).abs() < 1e-9);
    if on_grid { curve.rgb().iter().flatten().copied().collect() } else { space.row(curve) }
}

fn read_bases(
    path: &Path,
    index: &Index,
    space: &Space,
    source: &mut Source<'_>,
) -> Result<Table, DocumentError> {
    let wrong =
        |field: String, problem: String| DocumentError::Field { path: path.to_path_buf(), field, problem };
    let bytes = source.read(path, 256 << 20)?;
    let mut samples: BTreeMap<usize, (Vec<f64>, Vec<[f64; 3]>)> = BTreeMap::new();
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
    for row in reader.deserialize::<BasisRow>() {
        let row = row.map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            wrong(format!("line {line}"), format!("{error}; expected the columns basis,theta_h_deg,r,g,b"))
        })?;
        if row.basis >= index.maps.len() {
            let problem = format!("there are {} maps, numbered from 0", index.maps.len());
            return Err(wrong(format!("basis {}", row.basis), problem));
        }
        let (theta, rgb) = samples.entry(row.basis).or_default();
        theta.push(row.theta_h_deg.to_radians());
        rgb.push([row.r, row.g, row.b]);
    }
    let mut bases = Table::new(space.columns());
    for basis in 0..index.maps.len() {
        let Some((theta, rgb)) = samples.remove(&basis) else {
            return Err(wrong(format!("basis {basis}"), "it has a map but no samples".into()));
        };
        let curve =
            Curve::new(theta, rgb).map_err(|error| wrong(format!("basis {basis}"), error.to_string()))?;
        let row = row(space, &curve);
        check_reflectance(&row).map_err(|error| wrong(format!("basis {basis}"), error.to_string()))?;
        bases.push(&row);
    }
    Ok(bases)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::quantise;
    use files::shelf::Disk;
    use observe::Silent;
    use proptest::prelude::*;

    fn factored(width: usize, height: usize, bases: usize, seed: u32) -> Factored {
        let value = |i: u32| {
            let v = (i + 1).wrapping_mul(2_654_435_761).wrapping_add(seed).wrapping_mul(2_246_822_519);
            f64::from(v ^ (v >> 13)) / f64::from(u32::MAX)
        };
        let space = Space::half_angle(7);
        let mut table = Table::new(space.columns());
        for b in 0..bases {
            let row: Vec<f64> =
                (0..space.columns()).map(|j| 30.0 * value((b * 64 + j) as u32).powi(3)).collect();
            table.push(&row);
        }
        let mut data = vec![0; width * height * bases];
        for (pixel, out) in data.chunks_exact_mut(bases).enumerate() {
            let weights: Vec<f64> = (0..bases).map(|b| value((pixel * 97 + b * 7) as u32).powi(4)).collect();
            quantise(&weights, out);
        }
        let maps = WeightMaps::new(width, height, bases, data).unwrap();
        Factored { space, bases: table, maps }
    }

    proptest! {
        #![proptest_config(testing::cases(16))]
        #[test]
        fn reading_gives_back_what_was_written(
            width in 1usize..9, height in 1usize..9, bases in 1usize..6, seed in any::<u32>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("a.foil");
            let original = factored(width, height, bases, seed);
            let origin = Origin { document: "ab".into(), result: "cd".into() };
            write(&original, "a thing", Some((12.5, 30.0)), Some(origin.clone()), &path).unwrap();
            prop_assert_eq!(super::origin(&Disk, &path, &Silent).unwrap(), Some(origin));
            let document = read(&Disk, &path, &Silent).unwrap();
            prop_assert_eq!(document.name.as_str(), "a thing");
            prop_assert_eq!(document.size_mm, Some((12.5, 30.0)));
            prop_assert_eq!(document.as_factored(), Some(&original));
            // No temporary folder is left.
            prop_assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn weights_that_do_not_sum_to_one_are_refused_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.foil");
        write(&factored(3, 2, 2, 5), "a", None, None, &path).unwrap();
        std::fs::copy(path.join("weights-00.png"), path.join("weights-01.png")).unwrap();
        let error = observe::with_causes(&read(&Disk, &path, &Silent).unwrap_err());
        assert!(error.contains("a.foil") && error.contains("pixel (0, 0)"), "{error}");
    }

    #[test]
    fn unknown_keys_and_foreign_paths_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.foil");
        write(&factored(2, 2, 1, 5), "a", None, None, &path).unwrap();
        let text = std::fs::read_to_string(path.join(FOIL.text)).unwrap();
        for (from, to, says) in [
            ("samples", "sampels", "sampels"),
            ("weights-00.png", "../weights-00.png", "same folder"),
            ("width = 2", "width = 0", "0 x 2"),
            ("width = 2", "width = 99999999999", "99999999999"),
            ("format = 1", "format = 2", "format"),
            ("width = 2", "width = 3", "expected 3 x 2"),
        ] {
            std::fs::write(path.join(FOIL.text), text.replace(from, to)).unwrap();
            let error = read(&Disk, &path, &Silent).unwrap_err().to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn an_existing_folder_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write(&factored(2, 2, 1, 5), "a", None, None, folder.path()).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
