//! The legal order of a job, command by command.
//!
//! ```text
//! job    = [reset] select-rgl setup raster-start passes raster-end FF leave-rgl [reset]
//! passes = pass { back-feed pass }          colourPlane, multiPlane
//!        | rows                             blackRaster: no select, no back-feed
//! pass   = ink-select rows                  the last one says so
//! rows   = { [compression] [skip] row }
//! ```
//! [`Order`] is the state machine. The writer asks it before it writes, the reader after it has parsed. It keeps a few
//! dozen bytes and reads everything once.
//!
//! The order and its sources: `docs/rgl.md`, sections "Order of a job" and "Setup".

use super::command::{Cartridges, Command, Compression, MAX_CARTRIDGES, Mode, PaperCode, Resolution};
use super::fault::{Fault, Refusal};
use super::parse::ROW_HEAD;
use crate::ink::Ink;
use crate::{packbits, paper};

/// The most passes in a job. The printer's own limit is not known; seven cartridges with repeats stay far below.
pub const MAX_PASSES: usize = 32;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    Before,
    AfterReset,
    /// The place in the setup of the command that came last.
    Setup(u8),
    /// Raster data: before the first pass, in a pass, or after a back-feed.
    NoPassYet,
    Pass,
    BackFed,
    RasterEnded,
    Ejected,
    Left,
    Over,
}

/// What the setup has declared so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Declared {
    /// Resolution.
    pub resolution: Option<Resolution>,
    /// Media type.
    pub media: Option<super::command::Media>,
    /// Paper code.
    pub paper: Option<PaperCode>,
    /// Page length in rows of the job's resolution.
    pub length: u16,
    /// Page width in dots of the job's resolution.
    pub width: u16,
    /// Cartridge list.
    pub cartridges: Option<Cartridges>,
    /// Shift to the right in dots.
    pub shift_x: u16,
    /// Shift downwards in rows.
    pub shift_y: u16,
    /// Built-in gloss.
    pub gloss: bool,
    /// Curl correction.
    pub curl: Option<bool>,
    /// Transfer mode.
    pub mode: Option<Mode>,
}

/// The current pass.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Rows {
    ink: Ink,
    last: bool,
    compression: Option<Compression>,
    compression_pending: bool,
    skip_pending: bool,
    next: u32,
    closed: bool,
}

/// How far a row reaches: its bytes once unpacked, at least 1, the last of them not 0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Extent {
    bytes: usize,
    last: u8,
}

impl Extent {
    /// The extent of a plain row.
    pub(super) fn of_row(row: &[u8]) -> Extent {
        Extent { bytes: row.len(), last: row.last().copied().unwrap_or(0) }
    }

    /// Dots from the row's start to its last dot, included.
    fn dots(self) -> usize {
        self.bytes * 8 - self.last.trailing_zeros() as usize
    }
}

/// The state of a job. See the [module](self).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Order {
    stage: Stage,
    seen: u16,
    declared: Declared,
    passes: u8,
    inks: u16,
    rows: Rows,
}

/// Places of the setup commands, from 1, and the fault when one that is always there is missing.
const REQUIRED: [(u8, Fault); 7] = [
    (2, Fault::MissingResolution),
    (3, Fault::MissingMedia),
    (4, Fault::MissingPaper),
    (5, Fault::MissingLength),
    (6, Fault::MissingWidth),
    (13, Fault::MissingCurl),
    (14, Fault::MissingMode),
];

fn place(command: &Command<'_>) -> Option<u8> {
    Some(match command {
        Command::SelectRgl => 1,
        Command::Resolution(_) => 2,
        Command::Media(_) => 3,
        Command::Paper(_) => 4,
        Command::Length(_) => 5,
        Command::Width(_) => 6,
        Command::LineFeed(_) => 7,
        Command::HeadDrive(_) => 8,
        Command::Cartridges(_) => 9,
        Command::ShiftX(_) => 10,
        Command::ShiftY(_) => 11,
        Command::BuiltInGloss => 12,
        Command::CurlCorrection(_) => 13,
        Command::Mode(_) => 14,
        Command::RasterStart => 15,
        _ => return None,
    })
}

impl Default for Order {
    fn default() -> Order {
        Order::new()
    }
}

impl Order {
    /// Before the first byte.
    pub const fn new() -> Order {
        Order {
            stage: Stage::Before,
            seen: 0,
            declared: Declared {
                resolution: None,
                media: None,
                paper: None,
                length: 0,
                width: 0,
                cartridges: None,
                shift_x: 0,
                shift_y: 0,
                gloss: false,
                curl: None,
                mode: None,
            },
            passes: 0,
            inks: 0,
            rows: Rows::new(Ink::Black, true),
        }
    }

    /// What the setup has declared so far.
    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    /// Passes begun so far.
    pub fn passes(&self) -> usize {
        usize::from(self.passes)
    }

    /// The ink of the current pass.
    pub fn ink(&self) -> Ink {
        self.rows.ink
    }

    /// How the rows of the current pass are packed, once it has said so.
    pub fn compression(&self) -> Option<Compression> {
        self.rows.compression
    }

    /// The number of the row accepted last, from 0, shift not included.
    pub fn row(&self) -> u32 {
        self.rows.next.saturating_sub(1)
    }

    /// Whether nothing of a job has come yet.
    pub fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::Before | Stage::AfterReset)
    }

    /// Whether rows may come.
    pub fn in_pass(&self) -> bool {
        self.stage == Stage::Pass
    }

    /// Whether the job is complete; only a reset may follow.
    pub fn is_complete(&self) -> bool {
        matches!(self.stage, Stage::Left | Stage::Over)
    }

    /// Whether the reset after the job has come: nothing may follow.
    pub fn is_over(&self) -> bool {
        self.stage == Stage::Over
    }

    /// Takes the next command. Positions in a refusal count from the command's first byte.
    pub fn accept(&mut self, command: &Command<'_>) -> Result<(), Refusal> {
        if let Command::Row { last, data } = *command {
            self.row_may_come().map_err(|fault| Refusal::new(fault, 0))?;
            let extent = match self.rows.compression {
                Some(Compression::Packed) => {
                    let (bytes, last) = packbits::measure(data).map_err(|error| {
                        let fault = match error.kind {
                            packbits::ErrorKind::ReservedHeader => Fault::ReservedHeader,
                            packbits::ErrorKind::CutOff | packbits::ErrorKind::TooLong => Fault::PackedCutOff,
                        };
                        Refusal::new(fault, ROW_HEAD + error.at)
                    })?;
                    Extent { bytes, last }
                }
                _ => Extent::of_row(data),
            };
            return self.accept_row(extent, last).map_err(|fault| Refusal::new(fault, 0));
        }
        let result = match (place(command), command) {
            (Some(place), _) => self.setup(place, command),
            (None, Command::Compression(_) | Command::Skip(_)) => self.before_row(command),
            _ => self.between(command),
        };
        result.map_err(|fault| Refusal::new(fault, 0))
    }

    /// A command of the setup.
    fn setup(&mut self, place: u8, command: &Command<'_>) -> Result<(), Fault> {
        if self.is_complete() {
            return Err(Fault::AfterJob);
        }
        if self.seen & (1 << place) != 0 {
            return Err(Fault::Repeated);
        }
        let before = match self.stage {
            Stage::Before | Stage::AfterReset if place == 1 => 0,
            Stage::Setup(before) if before < place => before,
            _ => return Err(Fault::OutOfOrder),
        };
        if let Some(&(_, missing)) = REQUIRED.iter().find(|&&(p, _)| before < p && p < place) {
            return Err(missing);
        }
        let resolution = self.declared.resolution.unwrap_or_default();
        match *command {
            Command::Resolution(resolution) => self.declared.resolution = Some(resolution),
            Command::Media(media) => self.declared.media = Some(media),
            Command::Paper(paper) => self.declared.paper = Some(paper),
            Command::Length(rows) => {
                if rows == 0 || rows > resolution.along(paper::LARGEST.1) {
                    return Err(Fault::PageSize);
                }
                self.declared.length = rows;
            }
            Command::Width(dots) => {
                if dots == 0 || dots > resolution.across(paper::LARGEST.0) {
                    return Err(Fault::PageSize);
                }
                self.declared.width = dots;
            }
            Command::Cartridges(list) => self.declared.cartridges = Some(list),
            Command::ShiftX(dots) => self.declared.shift_x = dots,
            Command::ShiftY(rows) => self.declared.shift_y = rows,
            Command::BuiltInGloss => self.declared.gloss = true,
            Command::CurlCorrection(on) => self.declared.curl = Some(on),
            Command::Mode(mode) => match (mode, self.declared.cartridges) {
                (Mode::MultiPlane, None) => return Err(Fault::MissingCartridges),
                (Mode::ColourPlane | Mode::BlackRaster, Some(_)) => return Err(Fault::UnexpectedCartridges),
                _ => self.declared.mode = Some(mode),
            },
            _ => {}
        }
        self.seen |= 1 << place;
        self.stage = if place < 15 {
            Stage::Setup(place)
        } else if self.declared.mode == Some(Mode::BlackRaster) {
            // The one pass of this mode begins by itself.
            self.begin_pass(Ink::Black, true)?;
            Stage::Pass
        } else {
            Stage::NoPassYet
        };
        Ok(())
    }

    fn begin_pass(&mut self, ink: Ink, last: bool) -> Result<(), Fault> {
        if usize::from(self.passes) == MAX_PASSES {
            return Err(Fault::TooManyPasses);
        }
        if self.declared.cartridges.is_some_and(|list| !list.inks().contains(&ink)) {
            return Err(Fault::InkNotInList);
        }
        let inks = self.inks | 1 << ink as u16;
        if inks.count_ones() as usize > MAX_CARTRIDGES {
            return Err(Fault::TooManyCartridges);
        }
        self.inks = inks;
        self.passes += 1;
        self.rows = Rows::new(ink, last);
        Ok(())
    }

    /// Compression and skip.
    fn before_row(&mut self, command: &Command<'_>) -> Result<(), Fault> {
        match self.stage {
            Stage::Pass => {}
            Stage::NoPassYet | Stage::BackFed => return Err(Fault::NoPass),
            Stage::Left | Stage::Over => return Err(Fault::AfterJob),
            _ => return Err(Fault::OutOfOrder),
        }
        let rows = &mut self.rows;
        if rows.closed {
            return Err(Fault::RowAfterLast);
        }
        if rows.skip_pending {
            return Err(Fault::SkipWithoutRow);
        }
        match *command {
            Command::Compression(_) if rows.compression_pending => Err(Fault::CompressionWithoutRow),
            Command::Compression(compression) => {
                rows.compression = Some(compression);
                rows.compression_pending = true;
                Ok(())
            }
            Command::Skip(0) => Err(Fault::ZeroSkip),
            Command::Skip(count) => {
                rows.next += u32::from(count);
                rows.skip_pending = true;
                Ok(())
            }
            _ => Err(Fault::OutOfOrder),
        }
    }

    /// Whether a row may come at all.
    fn row_may_come(&self) -> Result<(), Fault> {
        match self.stage {
            Stage::Pass if self.rows.closed => Err(Fault::RowAfterLast),
            Stage::Pass if self.rows.compression.is_none() => Err(Fault::NoCompression),
            Stage::Pass => Ok(()),
            Stage::NoPassYet | Stage::BackFed => Err(Fault::NoPass),
            Stage::Left | Stage::Over => Err(Fault::AfterJob),
            _ => Err(Fault::OutOfOrder),
        }
    }

    /// Whether a row of this extent may stand at row number `row`.
    pub(super) fn fits(&self, extent: Extent, row: u32) -> Result<(), Fault> {
        if extent.bytes == 0 {
            Err(Fault::EmptyRow)
        } else if extent.last == 0 {
            Err(Fault::TrailingZero)
        } else if extent.dots() + usize::from(self.declared.shift_x) > usize::from(self.declared.width) {
            Err(Fault::BeyondWidth)
        } else if row + u32::from(self.declared.shift_y) >= u32::from(self.declared.length) {
            Err(Fault::BeyondLength)
        } else {
            Ok(())
        }
    }

    /// A row whose extent is known.
    pub(super) fn accept_row(&mut self, extent: Extent, last: bool) -> Result<(), Fault> {
        self.row_may_come()?;
        self.fits(extent, self.rows.next)?;
        self.rows.next += 1;
        self.rows.closed = last;
        self.rows.skip_pending = false;
        self.rows.compression_pending = false;
        Ok(())
    }

    /// What stands between passes, and at both ends of the job.
    fn between(&mut self, command: &Command<'_>) -> Result<(), Fault> {
        if self.stage == Stage::Pass {
            if self.rows.skip_pending {
                return Err(Fault::SkipWithoutRow);
            }
            if self.rows.compression_pending {
                return Err(Fault::CompressionWithoutRow);
            }
        }
        self.stage = match (self.stage, command) {
            (Stage::Before, Command::Reset) => Stage::AfterReset,
            (Stage::NoPassYet | Stage::BackFed, &Command::InkSelect { ink, last }) => {
                self.begin_pass(ink, last)?;
                Stage::Pass
            }
            (Stage::Pass, Command::InkSelect { .. }) if self.rows.last => return Err(Fault::PassAfterLast),
            (Stage::Pass, Command::InkSelect { .. }) => return Err(Fault::MissingBackFeed),
            (Stage::Pass, Command::BackFeed) if self.rows.last => return Err(Fault::BackFeedAfterLast),
            (Stage::Pass, Command::BackFeed) => Stage::BackFed,
            (Stage::Pass, Command::RasterEnd) if !self.rows.last => return Err(Fault::NotLastPass),
            (Stage::Pass, Command::RasterEnd) => Stage::RasterEnded,
            (Stage::NoPassYet, Command::RasterEnd | Command::BackFeed) => return Err(Fault::NoPass),
            (Stage::BackFed, Command::RasterEnd | Command::BackFeed) => {
                return Err(Fault::BackFeedWithoutPass);
            }
            (Stage::RasterEnded, Command::FormFeed) => Stage::Ejected,
            (Stage::RasterEnded, Command::LeaveRgl) => return Err(Fault::MissingFormFeed),
            (Stage::Ejected, Command::LeaveRgl) => Stage::Left,
            (Stage::Left, Command::Reset) => Stage::Over,
            (Stage::Left | Stage::Over, _) => return Err(Fault::AfterJob),
            _ => return Err(Fault::OutOfOrder),
        };
        Ok(())
    }
}

impl Rows {
    const fn new(ink: Ink, last: bool) -> Rows {
        Rows {
            ink,
            last,
            compression: None,
            compression_pending: false,
            skip_pending: false,
            next: 0,
            closed: false,
        }
    }
}

#[cfg(test)]
mod tests;
