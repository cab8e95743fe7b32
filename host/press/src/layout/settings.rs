//! What decides how a dot map lies on a page, and why it may not.

use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::Resolution;

use super::length::Point;
use super::profile::Profile;
use super::rect::{Cut, Rect};
use sheet::SheetError;

/// Most copies side by side or below each other.
pub const MOST_REPEATS: u16 = 200;

/// How a dot map is laid on a page.
#[derive(Clone, PartialEq, Debug)]
pub struct Layout {
    /// The paper.
    pub paper: Paper,
    /// Dots an inch. At 1200 x 600 dpi a dot map has two dots across for each of its rows' height; where things are is still
    /// reckoned in 1/600 inch.
    pub resolution: Resolution,
    /// Where the block of copies goes.
    pub position: Position,
    /// How many copies.
    pub repeat: Repeat,
    /// Between copies, across and down, in millimetres; not negative.
    pub gap: Point,
    /// Whether each copy is turned left to right, for what is seen from behind.
    pub mirror: bool,
    /// Ticks where to cut.
    pub crop_marks: bool,
    /// Crosses that every pass prints.
    pub registration_marks: bool,
    /// Patterns at the corners that tell a camera which sheet it sees and from where ([`camera`](super::camera)).
    pub camera_marks: bool,
    /// Inks of the marks; empty for those in use: the one that shows best for ticks, all for crosses, a dark one for camera
    /// marks.
    pub mark_inks: Vec<Ink>,
    /// Whether what lies beyond the printable area is cut off instead of refused.
    pub cut: bool,
    /// The printer's calibration.
    pub profile: Profile,
}

/// Where the block of copies goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Position {
    /// In the middle of the printable area.
    Centred,
    /// Its top left corner this far from the corner of the sheet of paper.
    FromEdge(Point),
    /// Its top left corner this far from the corner of the printable area.
    FromPrintable(Point),
}

/// How many copies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Repeat {
    /// Columns and rows, both at least 1.
    Grid(u16, u16),
    /// As many as the printable area holds.
    Fill,
}

impl Layout {
    /// One copy in the middle of the paper, without marks, on a printer that is exact.
    pub fn centred(paper: Paper) -> Layout {
        Layout {
            paper,
            resolution: Resolution::Dpi600,
            position: Position::Centred,
            repeat: Repeat::Grid(1, 1),
            gap: Point::default(),
            mirror: false,
            crop_marks: false,
            registration_marks: false,
            camera_marks: false,
            mark_inks: Vec::new(),
            cut: false,
            profile: Profile::default(),
        }
    }

    /// Dots across in 1/600 inch: 1, or 2 at 1200 x 600 dpi; 0 at a resolution that nothing is laid out for.
    pub(crate) fn across(&self) -> usize {
        self.resolution.across(1).into()
    }

    /// The part of the ideal page that this printer reaches, in dots of the printable area.
    pub(super) fn room(&self) -> Rect {
        let (width, length) = (i64::from(self.paper.width()), i64::from(self.paper.length()));
        let (x, y) = self.profile.offset();
        let reach = Rect { left: x, right: x + width, top: y, bottom: self.profile.lands_on(length - 1) + 1 };
        reach.meet(Rect { left: 0, right: width, top: 0, bottom: length })
    }
}

/// Why a dot map cannot be laid on a page.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A part lies beyond the printable area.
    #[error(
        "{cut} of {width:.1} x {length:.1} mm would be cut off; the printable area of {paper} is {most_width:.1} x \
         {most_length:.1} mm; {}",
        smaller(*width, *length, *most_width, *most_length)
    )]
    Beyond {
        /// What would be cut.
        cut: Cut,
        /// Width of all copies together in mm.
        width: f64,
        /// Their length.
        length: f64,
        /// Name of the paper.
        paper: &'static str,
        /// Width that can be printed in mm.
        most_width: f64,
        /// Length that can be printed.
        most_length: f64,
    },
    /// Nothing of it lies on the printable area.
    #[error("nothing lies on the printable area of {paper}; choose another position or size")]
    Nothing {
        /// Name of the paper.
        paper: &'static str,
    },
    /// Not even one copy fits.
    #[error(
        "not one copy of {width:.1} x {length:.1} mm fits; the printable area of {paper} is {most_width:.1} x {most_length:.1} mm"
    )]
    FillsNothing {
        /// Width of a copy in mm.
        width: f64,
        /// Its length.
        length: f64,
        /// Name of the paper.
        paper: &'static str,
        /// Width that can be printed in mm.
        most_width: f64,
        /// Length that can be printed.
        most_length: f64,
    },
    /// Numbers that make no layout.
    #[error("{0}")]
    Setting(String),
    /// No number is left for the marks' stacks.
    #[error("the page would have more than 256 different stacks; print it without marks")]
    Stacks,
    /// The page is no sheet.
    #[error(transparent)]
    Sheet(#[from] SheetError),
}

/// What to do about something of this size in too little room: move it, or make it this small.
fn smaller(width: f64, length: f64, most_width: f64, most_length: f64) -> String {
    let scale = (most_width / width).min(most_length / length);
    if scale >= 1.0 {
        return "move it".into();
    }
    // Never more than fits.
    let below = |mm: f64| (10.0 * scale * mm).floor() / 10.0;
    format!("make it smaller ({:.1} x {:.1} mm fits)", below(width), below(length))
}
