//! A sheet on disk: `sheet.toml` (paper and stacks) and `separation.png`, one byte a dot, whose palette shows the
//! stacks in false colours.

use std::path::Path;

use inks::Stack;
use protocol::paper::{LARGEST, Paper};
use serde::{Deserialize, Serialize};

use super::colours::colours;
use super::picture::{FileError, Kind, read_png, read_toml, write_png, write_toml};
use super::{Sheet, check_stacks};
use crate::preview::Area;

/// The text beside the picture.
pub const TEXT: &str = "sheet.toml";

/// The picture.
pub const PICTURE: &str = "separation.png";

/// Number of the format, raised when old files can no longer be read.
const FORMAT: u32 = 1;

/// Paper as text: a name and the size that goes with it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperText {
    name: String,
    width: u16,
    length: u16,
}

impl PaperText {
    pub(crate) fn new(paper: Paper) -> PaperText {
        PaperText { name: paper.name().to_string(), width: paper.width(), length: paper.length() }
    }

    /// The paper, if name and size agree.
    pub(crate) fn paper(&self) -> Result<Paper, String> {
        let PaperText { name, width, length } = self;
        let paper = match Paper::from_name(name) {
            Some(paper) => paper,
            None if name == "custom" => Paper::Custom { width: *width, length: *length },
            None => {
                let known: Vec<&str> = Paper::named().map(Paper::name).collect();
                return Err(format!("paper.name: `{name}` is none of {}, custom", known.join(", ")));
            }
        };
        if (paper.width(), paper.length()) != (*width, *length) {
            return Err(format!(
                "paper: {name} is {} x {} dots, not {width} x {length}",
                paper.width(),
                paper.length()
            ));
        }
        if *width == 0 || *length == 0 || *width > LARGEST.0 || *length > LARGEST.1 {
            return Err(format!(
                "paper: {width} x {length} dots; a side is at least 1, the largest sheet {} x {}",
                LARGEST.0, LARGEST.1
            ));
        }
        Ok(paper)
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: u32,
    picture: String,
    stacks: Vec<Stack>,
    paper: PaperText,
}

/// The problem, if the number of a format is not ours.
pub(crate) fn check_format(found: u32, ours: u32) -> Result<(), String> {
    if found == ours {
        return Ok(());
    }
    Err(format!("format: {found}, but this program reads {ours}; write the file again with this program"))
}

impl Sheet {
    /// Writes [`TEXT`] and [`PICTURE`] into a folder that exists, the text last.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        let colours = colours(self.stacks());
        let size = (self.width(), self.length());
        write_png(&folder.join(PICTURE), size, Kind::Indexed(&colours), self.index())?;
        let text = Text {
            format: FORMAT,
            picture: PICTURE.to_string(),
            stacks: self.stacks().to_vec(),
            paper: PaperText::new(self.paper()),
        };
        write_toml(&folder.join(TEXT), &text)
    }

    /// Writes an area of the sheet in false colours, one for each stack ([`colours()`]), a pixel a dot.
    ///
    /// # Panics
    /// When the area leaves the sheet: a bug of the caller, never a matter of input.
    pub fn save_colours(&self, area: Area, path: &Path) -> Result<(), FileError> {
        let rows = self.index().chunks_exact(self.width()).skip(area.top).take(area.length);
        let dots: Vec<u8> = rows.flat_map(|row| &row[area.left..][..area.width]).copied().collect();
        write_png(path, (area.width, area.length), Kind::Indexed(&colours(self.stacks())), &dots)
    }

    /// Reads what [`Sheet::save`] wrote. Anything that does not fit is an error with the file and the field.
    pub fn load(folder: &Path) -> Result<Sheet, FileError> {
        let path = folder.join(TEXT);
        let text: Text = read_toml(&path)?;
        let wrong = |problem: String| FileError::Text { path: path.clone(), problem };
        check_format(text.format, FORMAT).map_err(wrong)?;
        if text.picture != PICTURE {
            return Err(wrong(format!("picture: `{}`, expected `{PICTURE}`", text.picture)));
        }
        let paper = text.paper.paper().map_err(wrong)?;
        check_stacks(&text.stacks).map_err(|error| wrong(format!("stacks: {error}")))?;
        let size = (usize::from(paper.width()), usize::from(paper.length()));
        let picture = folder.join(PICTURE);
        let index = read_png(&picture, size, Kind::Indexed(&colours(&text.stacks)))?;
        Sheet::new(paper, text.stacks, index)
            .map_err(|error| FileError::Text { path: picture, problem: error.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sheet(width: u16, length: u16, stacks: usize, seed: u32) -> Sheet {
        let dots = usize::from(width) * usize::from(length);
        let random = |i: usize| ((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 7) as usize;
        let index = (0..dots).map(|i| (random(i) % stacks) as u8).collect();
        let inks = protocol::ink::Ink::ALL;
        let stack =
            |i: usize| Stack::new((0..i.div_ceil(13)).map(|j| inks[(i + j * 5) % 13]).collect::<Vec<_>>());
        Sheet::new(Paper::Custom { width, length }, (0..stacks).map(stack).collect(), index).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn a_sheet_comes_back_dot_by_dot(width in 1u16..90, length in 1u16..90, stacks in 1usize..40, seed: u32) {
            let folder = tempfile::tempdir().unwrap();
            let sheet = sheet(width, length, stacks, seed);
            sheet.save(folder.path()).unwrap();
            prop_assert_eq!(Sheet::load(folder.path()).unwrap(), sheet);
        }
    }

    #[test]
    fn nothing_else_is_left_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        sheet(9, 9, 3, 1).save(folder.path()).unwrap();
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, [PICTURE, TEXT]);
    }

    #[test]
    fn a_file_that_does_not_fit_is_named_with_its_field() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(TEXT);
        sheet(9, 7, 3, 1).save(folder.path()).unwrap();
        let good = std::fs::read_to_string(&path).unwrap();
        let error = |text: String| {
            std::fs::write(&path, text).unwrap();
            Sheet::load(folder.path()).unwrap_err().to_string()
        };
        for (from, to, words) in [
            ("format = 1", "format = 9", "format: 9"),
            ("format = 1", "format = 1\nformt = 2", "formt"),
            ("width = 9", "width = 8", "expected 8 x 7"),
            ("width = 9", "width = 0", "at least 1"),
            ("width = 9", "width = 65535", "largest sheet"),
            ("\"custom\"", "\"a4\"", "a4 is 4800 x 6372"),
            ("\"custom\"", "\"a44\"", "`a44` is none of"),
            ("\"substrate\", ", "", "substrate first"),
            ("\"substrate\"", "\"tin\"", "`tin`"),
            ("separation.png", "../separation.png", "picture: `../separation.png`"),
        ] {
            assert!(good.contains(from), "{good}");
            let text = error(good.replacen(from, to, 1));
            assert!(
                text.contains(words) && text.contains(folder.path().to_str().unwrap()),
                "{words}: {text}"
            );
        }
        std::fs::write(&path, &good).unwrap();
        let picture = folder.path().join(PICTURE);
        let bytes = std::fs::read(&picture).unwrap();
        for length in [0, 7, 40, bytes.len() / 2, bytes.len() - 20] {
            std::fs::write(&picture, &bytes[..length]).unwrap();
            assert!(Sheet::load(folder.path()).is_err(), "{length} of {} bytes", bytes.len());
        }
        super::write_png(&picture, (9, 7), Kind::Bits, &[0; 14]).unwrap();
        assert!(
            Sheet::load(folder.path())
                .unwrap_err()
                .to_string()
                .contains("found 9 x 7 dots, One bits Grayscale")
        );
        super::write_png(&picture, (9, 7), Kind::Indexed(&[[0; 3]; 3]), &[3; 63]).unwrap();
        assert!(
            Sheet::load(folder.path()).unwrap_err().to_string().contains("dot (0, 0) has stack number 3")
        );
        std::fs::remove_file(&picture).unwrap();
        assert!(Sheet::load(folder.path()).unwrap_err().to_string().contains(PICTURE));
    }
}
