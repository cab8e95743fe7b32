//! The legal order of a job, command by command.
//!
//! ```text
//! job    = [reset] select-rgl setup raster-start passes raster-end FF leave-rgl [reset]
//! passes = pass { back-feed pass }          colourPlane, multiPlane
//!        | rows                             blackRaster: no select, no back-feed
//! pass   = ink-select rows                  the last one says so
//! rows   = { [compression] [skip] row }
//! ```
//! [`Order`] is the state machine: the writer asks it before it writes, the reader after it has parsed. It keeps a
//! few dozen bytes and never looks at anything twice.

use super::command::{Cassettes, Command, Compression, MAX_CASSETTES, Mode, PaperCode, Resolution};
use super::fault::{Fault, Refusal};
use super::parse::ROW_HEAD;
use crate::ink::Ink;
use crate::{packbits, paper};

/// The most passes in a job. The machine's own limit is not known; seven cassettes with repeats stay far below.
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
    /// Cassette list.
    pub cassettes: Option<Cassettes>,
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
    pub(super) fn of(row: &[u8]) -> Extent {
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
        Command::Cassettes(_) => 9,
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
                cassettes: None,
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
                _ => Extent::of(data),
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
            Command::Cassettes(list) => self.declared.cassettes = Some(list),
            Command::ShiftX(dots) => self.declared.shift_x = dots,
            Command::ShiftY(rows) => self.declared.shift_y = rows,
            Command::BuiltInGloss => self.declared.gloss = true,
            Command::CurlCorrection(on) => self.declared.curl = Some(on),
            Command::Mode(mode) => match (mode, self.declared.cassettes) {
                (Mode::MultiPlane, None) => return Err(Fault::MissingCassettes),
                (Mode::ColourPlane | Mode::BlackRaster, Some(_)) => return Err(Fault::UnexpectedCassettes),
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
        if self.declared.cassettes.is_some_and(|list| !list.inks().contains(&ink)) {
            return Err(Fault::InkNotInList);
        }
        let inks = self.inks | 1 << ink as u16;
        if inks.count_ones() as usize > MAX_CASSETTES {
            return Err(Fault::TooManyCassettes);
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
mod tests {
    extern crate std;

    use super::*;
    use Command::*;
    use std::{vec, vec::Vec};

    const ROW: Command<'_> = Row { last: false, data: &[0x80] };
    const PLAIN: Command<'_> = Compression(super::Compression::Plain);
    const PACKED: Command<'_> = Compression(super::Compression::Packed);

    fn select(ink: Ink, last: bool) -> Command<'static> {
        InkSelect { ink, last }
    }

    fn setup() -> Vec<Command<'static>> {
        vec![
            SelectRgl,
            Resolution(super::Resolution::Dpi600),
            Media(super::super::command::Media::Plain),
            Paper(PaperCode::of(crate::paper::Paper::A4)),
            Length(6372),
            Width(4800),
            CurlCorrection(true),
            Mode(super::Mode::ColourPlane),
            RasterStart,
        ]
    }

    fn end() -> Vec<Command<'static>> {
        vec![RasterEnd, FormFeed, LeaveRgl, Reset]
    }

    fn job(passes: &[Command<'static>]) -> Vec<Command<'static>> {
        [setup(), passes.to_vec(), end()].concat()
    }

    /// The position of the first command refused and why, or whether the job is over.
    fn verdict(commands: &[Command<'_>]) -> Result<bool, (usize, Fault)> {
        let mut order = Order::new();
        for (i, command) in commands.iter().enumerate() {
            order.accept(command).map_err(|refusal| (i, refusal.fault))?;
        }
        Ok(order.is_over())
    }

    /// The fault of a job with these passes; `at` counts from the first command after the setup.
    fn refused(passes: &[Command<'static>]) -> (usize, Fault) {
        let (at, fault) = verdict(&job(passes)).unwrap_err();
        (at - setup().len(), fault)
    }

    #[test]
    fn complete_jobs_are_taken_with_or_without_the_first_reset() {
        let passes = [
            select(Ink::White, false),
            PLAIN,
            Skip(3),
            ROW,
            BackFeed,
            select(Ink::White, true),
            PACKED,
            Row { last: true, data: &[0, 1] },
        ];
        assert_eq!(verdict(&job(&passes)), Ok(true));
        assert_eq!(verdict(&[vec![Reset], job(&passes)].concat()), Ok(true));
        assert_eq!(verdict(&job(&[select(Ink::Cyan, false), BackFeed, select(Ink::Black, true)])), Ok(true));
    }

    #[test]
    fn every_setup_command_that_is_always_there_is_missed() {
        let whole = job(&[select(Ink::Black, true)]);
        let missing = [
            (0, Fault::OutOfOrder),
            (1, Fault::MissingResolution),
            (2, Fault::MissingMedia),
            (3, Fault::MissingPaper),
            (4, Fault::MissingLength),
            (5, Fault::MissingWidth),
            (6, Fault::MissingCurl),
            (7, Fault::MissingMode),
        ];
        for (at, fault) in missing {
            let mut commands = whole.clone();
            commands.remove(at);
            assert_eq!(verdict(&commands), Err((at, fault)));
        }
    }

    #[test]
    fn setup_commands_come_once_and_in_their_order() {
        let whole = job(&[select(Ink::Black, true)]);
        for at in 0..setup().len() {
            let mut twice = whole.clone();
            twice.insert(at + 1, whole[at]);
            assert_eq!(verdict(&twice), Err((at + 1, Fault::Repeated)));
            if at > 0 && at + 1 < setup().len() {
                let mut swapped = whole.clone();
                swapped.swap(at, at + 1);
                assert!(matches!(verdict(&swapped), Err((i, _)) if i == at));
            }
        }
        let mut late = whole.clone();
        late.insert(7, Width(4800));
        assert_eq!(verdict(&late), Err((7, Fault::Repeated)));
        let mut late = whole;
        late.insert(8, ShiftX(3));
        assert_eq!(verdict(&late), Err((8, Fault::OutOfOrder)));
    }

    #[test]
    fn pages_the_machine_does_not_take_are_refused() {
        for (at, wrong) in [(4, Length(0)), (4, Length(7761)), (5, Width(0)), (5, Width(4941))] {
            let mut commands = setup();
            commands[at] = wrong;
            assert_eq!(verdict(&commands), Err((at, Fault::PageSize)));
        }
    }

    #[test]
    fn the_cassette_list_belongs_to_multi_plane_and_holds_every_ink() {
        let list = super::Cassettes::new(&[Ink::White, Ink::Black]).unwrap();
        let with = |mode, ink| {
            let mut commands = setup();
            commands.insert(6, Cassettes(list));
            commands[8] = Mode(mode);
            verdict(&[commands, vec![select(ink, true)], end()].concat())
        };
        assert_eq!(with(super::Mode::MultiPlane, Ink::White), Ok(true));
        assert_eq!(with(super::Mode::MultiPlane, Ink::Cyan), Err((10, Fault::InkNotInList)));
        assert_eq!(with(super::Mode::ColourPlane, Ink::White), Err((8, Fault::UnexpectedCassettes)));
        let mut without = setup();
        without[7] = Mode(super::Mode::MultiPlane);
        assert_eq!(verdict(&without), Err((7, Fault::MissingCassettes)));
    }

    #[test]
    fn back_feeds_stand_between_passes_and_nowhere_else() {
        let (more, last) = (select(Ink::Cyan, false), select(Ink::Black, true));
        assert_eq!(refused(&[]), (0, Fault::NoPass));
        assert_eq!(refused(&[BackFeed]), (0, Fault::NoPass));
        assert_eq!(refused(&[more, last]), (1, Fault::MissingBackFeed));
        assert_eq!(refused(&[more]), (1, Fault::NotLastPass));
        assert_eq!(refused(&[more, BackFeed]), (2, Fault::BackFeedWithoutPass));
        assert_eq!(refused(&[more, BackFeed, BackFeed]), (2, Fault::BackFeedWithoutPass));
        assert_eq!(refused(&[last, BackFeed]), (1, Fault::BackFeedAfterLast));
        assert_eq!(refused(&[last, last]), (1, Fault::PassAfterLast));
        assert_eq!(refused(&[more, FormFeed]), (1, Fault::OutOfOrder));
    }

    #[test]
    fn black_raster_has_one_pass_that_is_never_selected() {
        let mut commands = setup();
        commands[7] = Mode(super::Mode::BlackRaster);
        assert_eq!(verdict(&[commands.clone(), vec![PLAIN, ROW], end()].concat()), Ok(true));
        let selected = [commands, vec![select(Ink::Black, true)]].concat();
        assert_eq!(verdict(&selected), Err((9, Fault::PassAfterLast)));
    }

    #[test]
    fn rows_are_announced_inside_the_page_and_end_once() {
        let pass = |rows: &[Command<'static>]| {
            let (at, fault) = refused(&[&[select(Ink::Black, true)], rows].concat());
            (at - 1, fault)
        };
        let wide = vec![0xff; 600].leak();
        let beyond = vec![0xff; 601].leak();
        assert_eq!(pass(&[ROW]), (0, Fault::NoCompression));
        assert_eq!(pass(&[PLAIN, PACKED]), (1, Fault::CompressionWithoutRow));
        assert_eq!(pass(&[PLAIN]), (1, Fault::CompressionWithoutRow));
        assert_eq!(pass(&[PLAIN, Skip(1), Skip(1)]), (2, Fault::SkipWithoutRow));
        assert_eq!(pass(&[PLAIN, Skip(1), PACKED]), (2, Fault::SkipWithoutRow));
        assert_eq!(pass(&[PLAIN, Skip(1)]), (2, Fault::SkipWithoutRow));
        assert_eq!(pass(&[PLAIN, Row { last: false, data: &[1, 0] }]), (1, Fault::TrailingZero));
        assert_eq!(pass(&[PACKED, Row { last: false, data: &[0xff, 0] }]), (1, Fault::TrailingZero));
        assert_eq!(pass(&[PACKED, Row { last: false, data: &[0x80, 1] }]), (1, Fault::ReservedHeader));
        assert_eq!(pass(&[PACKED, Row { last: false, data: &[3, 1] }]), (1, Fault::PackedCutOff));
        assert_eq!(
            pass(&[PLAIN, Row { last: false, data: wide }, Row { last: false, data: beyond }]),
            (2, Fault::BeyondWidth)
        );
        assert_eq!(pass(&[PLAIN, Skip(6371), ROW, ROW]), (3, Fault::BeyondLength));
        assert_eq!(pass(&[PLAIN, Skip(65535), ROW]), (2, Fault::BeyondLength));
        assert_eq!(pass(&[PLAIN, Row { last: true, data: &[1] }, ROW]), (2, Fault::RowAfterLast));
        assert_eq!(pass(&[PLAIN, Row { last: true, data: &[1] }, Skip(1)]), (2, Fault::RowAfterLast));
    }

    #[test]
    fn a_dot_in_the_spare_bits_of_the_last_byte_is_beyond_the_width() {
        let mut commands = setup();
        commands[5] = Width(12);
        commands.extend([select(Ink::Black, true), PLAIN]);
        let with = |last: u8| {
            verdict(&[commands.clone(), vec![Row { last: false, data: vec![0, last].leak() }]].concat())
        };
        assert_eq!(with(0x10), Ok(false));
        assert_eq!(with(0x08), Err((11, Fault::BeyondWidth)));
        commands[5] = Width(16);
        commands.insert(6, ShiftX(5));
        let shifted = |last: u8| {
            verdict(&[commands.clone(), vec![Row { last: false, data: vec![0, last].leak() }]].concat())
        };
        assert_eq!(shifted(0x20), Ok(false));
        assert_eq!(shifted(0x10), Err((12, Fault::BeyondWidth)));
    }

    #[test]
    fn a_packed_fault_is_placed_at_its_byte() {
        let mut order = Order::new();
        let begin = [setup(), vec![select(Ink::Black, true), PACKED]].concat();
        begin.iter().for_each(|command| order.accept(command).unwrap());
        let refusal = order.accept(&Row { last: false, data: &[0, 9, 0x80, 1] }).unwrap_err();
        assert_eq!((refusal.fault, refusal.at), (Fault::ReservedHeader, 6 + 2));
    }

    #[test]
    fn the_end_is_one_form_feed_and_nothing_follows_it() {
        let whole = job(&[select(Ink::Black, true)]);
        let end = whole.len() - 4;
        let without = |at: usize| {
            let mut commands = whole.clone();
            commands.remove(at);
            verdict(&commands)
        };
        assert_eq!(without(end + 1), Err((end + 1, Fault::MissingFormFeed)));
        assert_eq!(without(end), Err((end, Fault::OutOfOrder)));
        for after in [Reset, SelectRgl, FormFeed, ROW] {
            assert_eq!(verdict(&[whole.clone(), vec![after]].concat()), Err((whole.len(), Fault::AfterJob)));
        }
        let mut twice = whole.clone();
        twice.insert(end + 1, FormFeed);
        assert_eq!(verdict(&twice), Err((end + 2, Fault::OutOfOrder)));
    }

    #[test]
    fn an_eighth_cassette_is_refused() {
        let mut passes = vec![];
        for &ink in &Ink::ALL[..7] {
            passes.extend([select(ink, false), BackFeed]);
        }
        let with = |ink| verdict(&job(&[passes.clone(), vec![select(ink, true)]].concat()));
        assert_eq!(with(Ink::ALL[0]), Ok(true), "a repeat is no new cassette");
        assert_eq!(with(Ink::ALL[7]), Err((setup().len() + 14, Fault::TooManyCassettes)));
    }
}
