//! Dot maps and sheets on disk: `dots.toml` (size and stacks) or `sheet.toml` (paper and stacks), and `separation.png`,
//! one byte a dot, whose palette shows the stacks in false colours.

use std::path::Path;

use inks::Stack;
use protocol::paper::{LARGEST, Paper};
use protocol::rgl::Resolution;
use serde::{Deserialize, Serialize};

use super::colours::colours;
use super::picture::{encoded, read_png, write_png};
use super::{Area, DotMap, Sheet, check_stacks};
use files::{FileError, FolderKind, write_toml};
use readers::exact::Exact;

const SHEET: FolderKind = FolderKind { name: "sheet", text: "sheet.toml", command: "layout" };

const DOTS: FolderKind = FolderKind { name: "dot map", text: "dots.toml", command: "halftone" };

/// The picture beside the text.
const PICTURE: &str = "separation.png";

/// Number of the format, raised when old files can no longer be read.
const FORMAT: u32 = 1;

/// Paper as text: a name and the size that goes with it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperText {
    name: String,
    width: u16,
    length: u16,
}

impl PaperText {
    /// The text of a paper.
    pub fn new(paper: Paper) -> PaperText {
        PaperText { name: paper.name().to_string(), width: paper.width(), length: paper.length() }
    }

    /// The paper, if name and size agree.
    pub fn paper(&self) -> Result<Paper, String> {
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
            return Err(format!("paper: {}", larger_than_paper((*width).into(), (*length).into())));
        }
        Ok(paper)
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SheetText {
    format: u32,
    picture: String,
    stacks: Vec<Stack>,
    paper: PaperText,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DotsText {
    format: u32,
    picture: String,
    stacks: Vec<Stack>,
    width: u16,
    length: u16,
}

/// The problem, if the number of a format is not ours.
pub fn check_format(found: u32, ours: u32) -> Result<(), String> {
    if found == ours {
        return Ok(());
    }
    Err(format!("format: {found}, but this program reads {ours}; write the file again with this program"))
}

/// The problem, if numbers and names are not those of a text of ours.
fn check(format: u32, picture: &str, stacks: &[Stack]) -> Result<(), String> {
    check_format(format, FORMAT)?;
    if picture != PICTURE {
        return Err(format!("picture: `{picture}`, expected `{PICTURE}`"));
    }
    check_stacks(stacks).map_err(|error| format!("stacks: {error}"))
}

impl DotMap {
    fn save_picture(&self, folder: &Path) -> Result<(), FileError> {
        let colours = colours(self.stacks());
        let size = (self.width(), self.length());
        let dpi = Resolution::Dpi600.dpi();
        write_png(&folder.join(PICTURE), size, dpi, Exact::Indexed(&colours), self.index())
    }

    fn load_picture(
        folder: &Path,
        (width, length): (u16, u16),
        stacks: Vec<Stack>,
    ) -> Result<DotMap, FileError> {
        let picture = folder.join(PICTURE);
        let (width, length) = (width.into(), length.into());
        let index = read_png(&picture, (width, length), Exact::Indexed(&colours(&stacks)))?;
        DotMap::new(width, length, stacks, index)
            .map_err(|error| FileError::Text { path: picture, problem: error.to_string() })
    }

    /// Writes `dots.toml` and `separation.png` into a folder that exists, the text last.
    ///
    /// # Errors
    /// A map larger than any sheet of paper, and what the system refuses.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        let path = folder.join(DOTS.text);
        let side = |dots: usize, most: u16| u16::try_from(dots).ok().filter(|&dots| dots <= most);
        let (Some(width), Some(length)) = (side(self.width(), LARGEST.0), side(self.length(), LARGEST.1))
        else {
            let problem = larger_than_paper(self.width(), self.length());
            return Err(FileError::Text { path, problem });
        };
        self.save_picture(folder)?;
        let text = DotsText {
            format: FORMAT,
            picture: PICTURE.to_string(),
            stacks: self.stacks().to_vec(),
            width,
            length,
        };
        write_toml(&path, &text)
    }

    /// Reads what [`DotMap::save`] wrote. Anything that does not fit is an error with the file and the field.
    ///
    /// # Errors
    /// Files that cannot be read, or are not what was written.
    pub fn load(folder: &Path) -> Result<DotMap, FileError> {
        let path = folder.join(DOTS.text);
        let text: DotsText = DOTS.read(folder)?;
        let wrong = |problem: String| FileError::Text { path: path.clone(), problem };
        check(text.format, &text.picture, &text.stacks).map_err(wrong)?;
        let (width, length) = (text.width, text.length);
        if !(1..=LARGEST.0).contains(&width) || !(1..=LARGEST.1).contains(&length) {
            return Err(wrong(larger_than_paper(width.into(), length.into())));
        }
        DotMap::load_picture(folder, (width, length), text.stacks)
    }
}

fn larger_than_paper(width: usize, length: usize) -> String {
    let (most, longest) = LARGEST;
    format!(
        "{width} x {length} dots; a side has at least 1 dot, the largest sheet of paper {most} x {longest}"
    )
}

impl Sheet {
    /// Writes `sheet.toml` and `separation.png` into a folder that exists, the text last.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        self.dots().save_picture(folder)?;
        let text = SheetText {
            format: FORMAT,
            picture: PICTURE.to_string(),
            stacks: self.stacks().to_vec(),
            paper: PaperText::new(self.paper()),
        };
        write_toml(&folder.join(SHEET.text), &text)
    }

    /// An area of the sheet in false colours as PNG, one colour for each stack, a pixel a dot. The sheet has
    /// `dpi` dots per inch across and along.
    ///
    /// # Errors
    /// None is known: the data is of the picture's size.
    ///
    /// # Panics
    /// When the area leaves the sheet: a bug of the caller, never a matter of input.
    pub fn in_colours(&self, area: Area, dpi: (u16, u16)) -> std::io::Result<Vec<u8>> {
        let palette = colours(self.stacks());
        encoded((area.width, area.length), dpi, Exact::Indexed(&palette), &self.index_of(area, 1))
    }

    /// Reads what [`Sheet::save`] wrote. Anything that does not fit is an error with the file and the field.
    ///
    /// # Errors
    /// Files that cannot be read, or are not what was written.
    pub fn load(folder: &Path) -> Result<Sheet, FileError> {
        let path = folder.join(SHEET.text);
        let text: SheetText = SHEET.read(folder)?;
        let wrong = |problem: String| FileError::Text { path: path.clone(), problem };
        check(text.format, &text.picture, &text.stacks).map_err(wrong)?;
        let paper = text.paper.paper().map_err(wrong)?;
        let dots = DotMap::load_picture(folder, (paper.width(), paper.length()), text.stacks)?;
        Ok(Sheet { paper, dots })
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
        #![proptest_config(testing::cases(32))]
        #[test]
        fn a_sheet_comes_back_dot_by_dot(width in 1u16..90, length in 1u16..90, stacks in 1usize..40, seed: u32) {
            let folder = tempfile::tempdir().unwrap();
            let sheet = sheet(width, length, stacks, seed);
            sheet.save(folder.path()).unwrap();
            prop_assert_eq!(Sheet::load(folder.path()).unwrap(), sheet);
        }
    }

    #[test]
    fn a_dot_map_comes_back_and_what_is_no_dot_map_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let dots = sheet(9, 7, 3, 1).dots;
        dots.save(folder.path()).unwrap();
        assert_eq!(DotMap::load(folder.path()).unwrap(), dots);
        assert!(Sheet::load(folder.path()).unwrap_err().to_string().contains(SHEET.text));
        let path = folder.path().join(DOTS.text);
        let good = std::fs::read_to_string(&path).unwrap();
        for (from, to, words) in [
            ("format = 1", "format = 9", "format: 9"),
            ("width = 9", "width = 8", "expected 8 x 7"),
            ("width = 9", "width = 0", "at least 1"),
            ("length = 7", "length = 9000", "largest sheet of paper"),
            ("length = 7", "length = 7\npaper = 1", "paper"),
            ("separation.png", "../separation.png", "picture: `../separation.png`"),
        ] {
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let text = DotMap::load(folder.path()).unwrap_err().to_string();
            assert!(
                text.contains(words) && text.contains(folder.path().to_str().unwrap()),
                "{words}: {text}"
            );
        }
        let wide = DotMap::new(5000, 1, vec![Stack::SUBSTRATE], vec![0; 5000]).unwrap();
        assert!(wide.save(folder.path()).unwrap_err().to_string().contains("5000 x 1 dots"));
    }

    #[test]
    fn nothing_else_is_left_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        sheet(9, 9, 3, 1).save(folder.path()).unwrap();
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, [PICTURE, SHEET.text]);
    }

    #[test]
    fn a_file_that_does_not_fit_is_named_with_its_field() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(SHEET.text);
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
            ("\"substrate\", ", "", "the substrate comes first"),
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
        super::write_png(&picture, (9, 7), (600, 600), Exact::Bits, &[0; 14]).unwrap();
        assert!(
            Sheet::load(folder.path())
                .unwrap_err()
                .to_string()
                .contains("found 9 x 7 dots, One bits Grayscale")
        );
        super::write_png(&picture, (9, 7), (600, 600), Exact::Indexed(&[[0; 3]; 3]), &[3; 63]).unwrap();
        assert!(
            Sheet::load(folder.path()).unwrap_err().to_string().contains("dot (0, 0) has stack number 3")
        );
        std::fs::remove_file(&picture).unwrap();
        assert!(Sheet::load(folder.path()).unwrap_err().to_string().contains(PICTURE));
    }
}
