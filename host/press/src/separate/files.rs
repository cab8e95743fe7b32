//! Passes on disk: `passes.toml` and one PNG a pass, one bit a dot, ink shown black.

use std::path::Path;

use inks::Stack;
use protocol::ink::Ink;
use protocol::paper::Paper;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Pass, Separation};
use files::shelf::{Disk, Shelf as _};
use files::{FileError, FolderKind, write_toml};
use readers::exact::{Exact, SIGNATURE};
use sheet::files::{PaperText, check_format};
use sheet::picture::{read_png, write_png};
use sheet::{MOST_PASSES, Plane};

/// The folder, and the text beside the pictures.
pub(super) const PASSES: FolderKind =
    FolderKind { name: "folder of passes", text: "passes.toml", command: "separate" };

/// Number of the format, raised when old files can no longer be read.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: u32,
    stacks: Vec<Stack>,
    paper: PaperText,
    #[serde(default, rename = "pass")]
    passes: Vec<PassText>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PassText {
    ink: String,
    file: String,
    dots: u64,
}

/// Passes as read back, ready for [`super::compose`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Saved {
    /// The paper.
    pub paper: Paper,
    /// The stacks the passes were made of, the substrate first.
    pub stacks: Vec<Stack>,
    /// The passes, first printed first.
    pub passes: Vec<Pass>,
}

/// `01-cyan.png` for the first pass.
pub fn name(pass: usize, ink: Ink) -> String {
    format!("{:02}-{}.png", pass + 1, ink.name())
}

/// Writes a plane of `dpi` dots per inch across and along as a one-bit picture, ink black.
pub fn save_plane(plane: &Plane, dpi: (u16, u16), path: &Path) -> Result<(), FileError> {
    let bits: Vec<u8> = plane.bits.iter().map(|byte| !byte).collect();
    write_png(path, (plane.width, plane.length), dpi, Exact::Bits, &bits)
}

/// Whether this program wrote a picture, as the picture says.
#[must_use]
pub fn is_signed(path: &Path) -> bool {
    let signature = [SIGNATURE.0, "\0", SIGNATURE.1].concat();
    let signed = |start: Vec<u8>| start.windows(signature.len()).any(|found| found == signature.as_bytes());
    Disk.start(path, 1 << 10).is_ok_and(signed)
}

/// Writes `passes.toml` and a picture of each pass, of `dpi` dots per inch across and along, into a folder that exists, the text
/// last.
pub fn save(separation: &Separation, dpi: (u16, u16), folder: &Path) -> Result<(), FileError> {
    separation
        .passes
        .par_iter()
        .enumerate()
        .try_for_each(|(i, pass)| save_plane(&pass.plane, dpi, &folder.join(name(i, pass.ink))))?;
    let pass = |(i, pass): (usize, &Pass)| PassText {
        ink: pass.ink.name().to_string(),
        file: name(i, pass.ink),
        dots: pass.plane.dots(),
    };
    let text = Text {
        format: FORMAT,
        stacks: separation.stacks.clone(),
        paper: PaperText::new(separation.paper),
        passes: separation.passes.iter().enumerate().map(pass).collect(),
    };
    write_toml(&folder.join(PASSES.text), &text)
}

/// Reads what [`save`] wrote. Anything that does not fit is an error with the file and the field.
pub fn load(folder: &Path) -> Result<Saved, FileError> {
    let path = folder.join(PASSES.text);
    let text: Text = PASSES.read(folder)?;
    let wrong = |problem: String| FileError::Text { path: path.clone(), problem };
    check_format(text.format, FORMAT).map_err(wrong)?;
    let paper = text.paper.paper().map_err(wrong)?;
    sheet::check_stacks(&text.stacks).map_err(|error| wrong(format!("stacks: {error}")))?;
    if text.passes.len() > MOST_PASSES {
        return Err(wrong(format!("pass: {} passes, at most {MOST_PASSES}", text.passes.len())));
    }
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let stride = width.div_ceil(8);
    let read = |(i, pass): (usize, &PassText)| -> Result<Pass, FileError> {
        let number = i + 1;
        let ink = Ink::from_name(&pass.ink)
            .ok_or_else(|| wrong(format!("pass {number}, ink: `{}` is no ink", pass.ink)))?;
        // The name is given by place and ink, so a file elsewhere is never opened.
        if pass.file != name(i, ink) {
            let problem = format!("pass {number}, file: `{}`, expected `{}`", pass.file, name(i, ink));
            return Err(wrong(problem));
        }
        let mut bits = read_png(&folder.join(&pass.file), (width, length), Exact::Bits)?;
        bits.iter_mut().for_each(|byte| *byte = !*byte);
        if width % 8 != 0 {
            let used = !(0xffu8 >> (width % 8));
            bits.iter_mut().skip(stride - 1).step_by(stride).for_each(|byte| *byte &= used);
        }
        let plane = Plane { width, length, stride, bits };
        let dots = plane.dots();
        if dots != pass.dots {
            return Err(wrong(format!(
                "pass {number}, dots: {}, but {} has {dots}; the picture was changed",
                pass.dots, pass.file
            )));
        }
        Ok(Pass { ink, plane })
    };
    let passes: Vec<Result<Pass, FileError>> = text.passes.par_iter().enumerate().map(read).collect();
    let passes = passes.into_iter().collect::<Result<_, _>>()?;
    Ok(Saved { paper, stacks: text.stacks, passes })
}
