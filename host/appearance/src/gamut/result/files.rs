//! A mapped document as a folder: `mix.toml` and one 16-bit grey PNG per weight map.
//!
//! `mix.toml` holds the stacks and the matrix. `weights-000.png` and so on hold the weights as greys
//! (`weights::grey`); reading restores the same weights. Reading is
//! strict: wrong sizes, wrong sums and unknown keys are errors that name the file and the field. Each file is written under
//! a temporary name and renamed; a caller that needs the whole folder to appear at once must rename it too.

use std::io::BufReader;
use std::path::{Path, PathBuf};

use files::durable::{self, Access};
use files::shelf::{Disk, Shelf as _};
use files::{FileError, FolderKind};
use inks::Stack;
use rayon::prelude::*;
use readers::exact::{self, Exact, Inexact};
use serde::{Deserialize, Serialize};

use super::mix::{InkMix, MixError};
use crate::weights::grey::{from_greys, to_grey};
use crate::weights::{ONE, WeightError, WeightMaps};

/// The folder.
const MIX: FolderKind = FolderKind { name: "mapped document", text: "mix.toml", command: "map" };
/// The format that the description declares.
const FORMAT: &str = "foilpress-mix-1";
/// The most pixels times maps read: a gigabyte of weights, 30 maps of 4096 x 4096.
const MOST_WEIGHTS: usize = 1 << 29;

/// Why a mapped document could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MixFileError {
    /// Reading or writing failed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The description is invalid.
    #[error("{}: {problem}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the field.
        problem: String,
    },
    /// A weight map is not a PNG of the right kind.
    #[error("{}: {problem}; expected a 16-bit grey PNG of {width} x {height} pixels", path.display())]
    Map {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
        /// Pixels across, from the description.
        width: usize,
        /// Pixels down, from the description.
        height: usize,
    },
    /// The weight maps do not fit together.
    #[error("{}: the weight maps cannot be used", path.display())]
    Weights {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        source: WeightError,
    },
    /// Stacks and matrix do not fit together.
    #[error("{}: the mixtures cannot be used", path.display())]
    Mix {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: MixError,
    },
}

/// The origin of a mix, stored with it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The document.
    #[serde(default)]
    pub document: String,
    /// How the document was mapped.
    #[serde(default)]
    pub mapping: String,
    /// The ink library.
    #[serde(default)]
    pub library: String,
    /// Width and height of the document on paper in millimetres.
    #[serde(default)]
    pub size_mm: Option<(f64, f64)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    format: String,
    width: usize,
    height: usize,
    /// Full weight; always 32768.
    one: u16,
    stacks: Vec<Stack>,
    matrix: Vec<Vec<u16>>,
    #[serde(default)]
    provenance: Provenance,
}

/// Writes a mix to a folder, which is created if it does not exist.
pub fn save(mix: &InkMix, provenance: &Provenance, folder: &Path) -> Result<(), MixFileError> {
    let described = folder.join(MIX.text);
    mix.check().map_err(|source| MixFileError::Mix { path: described.clone(), source })?;
    durable::make_folder(folder, Access::Everyone).map_err(files::io(folder, "write"))?;
    let maps = &mix.maps;
    (0..maps.channels()).into_par_iter().try_for_each(|channel| {
        let mut bytes = Vec::with_capacity(maps.width() * maps.height() * 2);
        for weights in maps.data().chunks_exact(maps.channels()) {
            bytes.extend_from_slice(&to_grey(weights[channel]).to_be_bytes());
        }
        let path = folder.join(map_name(channel));
        let size = (maps.width(), maps.height());
        files::write(&path, |file| exact::write(file, size, None, Exact::Deep, &bytes))
    })?;
    let description = Description {
        format: FORMAT.into(),
        width: maps.width(),
        height: maps.height(),
        one: ONE,
        stacks: mix.stacks.clone(),
        matrix: mix.matrix.clone(),
        provenance: provenance.clone(),
    };
    // Last, because a folder without a description is not a mix.
    Ok(files::write_toml(&described, &description)?)
}

/// Reads a mix and its origin.
pub fn load(folder: &Path) -> Result<(InkMix, Provenance), MixFileError> {
    let path = folder.join(MIX.text);
    let wrong = |problem: String| MixFileError::Description { path: path.clone(), problem };
    let described: Description = MIX.read(folder)?;
    let Description { format, width, height, one, stacks, matrix, provenance } = described;
    if format != FORMAT {
        return Err(wrong(format!("`format` is `{format}`, expected `{FORMAT}`")));
    }
    if one != ONE {
        return Err(wrong(format!("`one` is {one}, expected {ONE}")));
    }
    let channels = matrix.len();
    if channels == 0 {
        return Err(wrong("`matrix` has no rows; expected one per weight map".into()));
    }
    let total = width.checked_mul(height).and_then(|n| n.checked_mul(channels));
    if width == 0 || height == 0 || total.is_none_or(|n| n > MOST_WEIGHTS) {
        return Err(wrong(format!(
            "`width`, `height` and the rows of `matrix` give {width} x {height} pixels with {channels} weights each; \
             expected 1 to {MOST_WEIGHTS} weights in total"
        )));
    }
    // The first map is read before memory for all maps is allocated, so the description alone allocates nothing.
    let mut data = Vec::new();
    for channel in 0..channels {
        let path = folder.join(map_name(channel));
        let grey = read_map(&path, width, height)?;
        if channel == 0 {
            data.resize(width * height * channels, 0);
        }
        for (pixel, grey) in grey.chunks_exact(2).enumerate() {
            data[pixel * channels + channel] = u16::from_be_bytes([grey[0], grey[1]]);
        }
    }
    let mut grey = vec![0; channels];
    for weights in data.chunks_exact_mut(channels) {
        grey.copy_from_slice(weights);
        from_greys(&grey, weights);
    }
    let maps = WeightMaps::new(width, height, channels, data)
        .map_err(|source| MixFileError::Weights { path: folder.to_path_buf(), source })?;
    let mix = InkMix::new(stacks, maps, matrix)
        .map_err(|source| MixFileError::Mix { path: path.clone(), source })?;
    Ok((mix, provenance))
}

fn read_map(path: &Path, width: usize, height: usize) -> Result<Vec<u8>, MixFileError> {
    let wrong = |problem: String| MixFileError::Map { path: path.to_path_buf(), problem, width, height };
    let file = Disk.open(path).map_err(files::io(path, "open"))?;
    exact::read(BufReader::new(file), (width, height), Exact::Deep).map_err(|error| match error {
        Inexact::Damaged(said) => wrong(said.to_string()),
        Inexact::Other { found, .. } => wrong(format!("it has {found}")),
    })
}

fn map_name(channel: usize) -> String {
    format!("weights-{channel:03}.png")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mix() -> InkMix {
        let maps = WeightMaps::new(3, 2, 2, [0, 1, 5, 16384, 32767, 32768].map(|w| [w, ONE - w]).concat());
        let stacks = ["substrate", "MS+C", "P+SF"].map(|s| s.parse().unwrap()).to_vec();
        InkMix::new(stacks, maps.unwrap(), vec![vec![0, 32768, 0], vec![16384, 1, 16383]]).unwrap()
    }

    fn saved() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        save(&mix(), &Provenance { document: "leaf".into(), ..Provenance::default() }, folder.path())
            .unwrap();
        folder
    }

    fn edited(from: &str, to: &str) -> String {
        let folder = saved();
        let path = folder.path().join(MIX.text);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        std::fs::write(&path, text.replace(from, to)).unwrap();
        observe::with_causes(&load(folder.path()).unwrap_err())
    }

    #[test]
    fn loading_restores_what_was_saved() {
        let folder = saved();
        let (loaded, provenance) = load(folder.path()).unwrap();
        assert_eq!(loaded, mix());
        assert_eq!(provenance.document, "leaf");
        let files: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(files.len(), 3, "no temporary file is left: {files:?}");
    }

    #[test]
    fn a_wrong_description_is_named_with_its_field() {
        for (from, to, word) in [
            ("foilpress-mix-1", "foilpress-mix-9", "format"),
            ("width = 3", "width = 4", "weights-000.png"),
            ("width = 3", "width = 99999999999", "width"),
            ("height = 2", "height = 0", "height"),
            ("height = 2", "hight = 2", "hight"),
            ("one = 32768", "one = 32767", "one"),
            ("16383", "16382", "row 1"),
            ("\"MS+C\"", "\"MS+tin\"", "tin"),
            ("\"MS+C\"", "\"P+SF\"", "P+SF"),
            ("document", "dokument", "dokument"),
        ] {
            let error = edited(from, to);
            assert!(error.contains(word), "{from} -> {to}: {error}");
        }
    }

    #[test]
    fn a_wrong_map_is_named() {
        let folder = saved();
        let path = folder.path().join("weights-001.png");
        let bytes = std::fs::read(&path).unwrap();
        // Cut short at every length: an error that names the file, never a panic.
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            match load(folder.path()) {
                Err(error) => assert!(error.to_string().contains("weights-001.png"), "{length}: {error}"),
                Ok((loaded, _)) => assert_eq!(loaded, mix(), "only the end mark may be missing"),
            }
        }
        std::fs::copy(folder.path().join("weights-000.png"), &path).unwrap();
        let error = load(folder.path()).unwrap_err();
        assert!(observe::with_causes(&error).contains("pixel (0, 0)"), "{error}");
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(load(folder.path()), Err(MixFileError::File(FileError::Io { .. }))));
    }

    /// Painted greys of which no weight is a whole number, though they sum to white: as they are read in a `.foil` folder.
    #[test]
    fn greys_that_sum_to_white_are_weights() {
        let folder = saved();
        let path = folder.path().join(MIX.text);
        let text = std::fs::read_to_string(&path).unwrap();
        let at = text.find("matrix").unwrap();
        let end = at + text[at..].find("\n[").unwrap_or(text.len() - at);
        let unit = "matrix = [[32768, 0, 0], [0, 32768, 0], [0, 0, 32768]]\n";
        let text = format!("{}{unit}{}", &text[..at], &text[end..]);
        std::fs::write(&path, text.replace("width = 3", "width = 1").replace("height = 2", "height = 1"))
            .unwrap();
        let paint = |greys: [u16; 3]| {
            for (channel, grey) in greys.into_iter().enumerate() {
                let file = std::fs::File::create(folder.path().join(map_name(channel))).unwrap();
                let mut encoder = png::Encoder::new(file, 1, 1);
                encoder.set_color(png::ColorType::Grayscale);
                encoder.set_depth(png::BitDepth::Sixteen);
                encoder.write_header().unwrap().write_image_data(&grey.to_be_bytes()).unwrap();
            }
            load(folder.path())
        };
        let (read, _) = paint([32767, 19661, 13107]).unwrap();
        assert_eq!(read.maps.at(0).iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
        assert!(read.maps.at(0).iter().zip([16383, 9830, 6553]).all(|(&w, near)| w.abs_diff(near) <= 1));
        let error = paint([32767, 19661, 13200]).unwrap_err();
        assert!(observe::with_causes(&error).contains("pixel (0, 0)"), "{error}");
    }

    #[test]
    fn eight_bits_are_refused() {
        let folder = saved();
        let file = std::fs::File::create(folder.path().join("weights-000.png")).unwrap();
        let mut encoder = png::Encoder::new(file, 3, 2);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.write_header().unwrap().write_image_data(&[0; 6]).unwrap();
        let error = load(folder.path()).unwrap_err().to_string();
        assert!(error.contains("Eight") && error.contains("16-bit"), "{error}");
    }
}
