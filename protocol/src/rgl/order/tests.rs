//! What a job may and may not be, command by command.

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
        Paper(PaperCode::from_paper(crate::paper::Paper::A4)),
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
fn the_cartridge_list_belongs_to_multi_plane_and_holds_every_ink() {
    let list = super::Cartridges::new(&[Ink::White, Ink::Black]).unwrap();
    let with = |mode, ink| {
        let mut commands = setup();
        commands.insert(6, Cartridges(list));
        commands[8] = Mode(mode);
        verdict(&[commands, vec![select(ink, true)], end()].concat())
    };
    assert_eq!(with(super::Mode::MultiPlane, Ink::White), Ok(true));
    assert_eq!(with(super::Mode::MultiPlane, Ink::Cyan), Err((10, Fault::InkNotInList)));
    assert_eq!(with(super::Mode::ColourPlane, Ink::White), Err((8, Fault::UnexpectedCartridges)));
    let mut without = setup();
    without[7] = Mode(super::Mode::MultiPlane);
    assert_eq!(verdict(&without), Err((7, Fault::MissingCartridges)));
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

/// A shift moves the picture on a page that stays as it is: what was the last row or dot lies beyond it.
#[test]
fn a_shifted_row_has_to_lie_on_the_page() {
    let mut begin = setup();
    let at = begin.iter().position(|command| matches!(command, CurlCorrection(_))).unwrap();
    begin.splice(at..at, [ShiftX(8), ShiftY(2)]);
    let verdict = |rows: &[Command<'static>]| {
        verdict(&[&begin[..], &[select(Ink::Black, true), PLAIN], rows, &end()].concat())
    };
    let first = begin.len() + 2;
    let wide = |bytes: usize| Row { last: true, data: vec![0xff; bytes].leak() };
    assert_eq!(verdict(&[Skip(6369), wide(599)]), Ok(true));
    assert_eq!(verdict(&[Skip(6370), wide(599)]), Err((first + 1, Fault::BeyondLength)));
    assert_eq!(verdict(&[Skip(6369), wide(600)]), Err((first + 1, Fault::BeyondWidth)));
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
fn an_eighth_cartridge_is_refused() {
    let mut passes = vec![];
    for &ink in &Ink::ALL[..7] {
        passes.extend([select(ink, false), BackFeed]);
    }
    let with = |ink| verdict(&job(&[passes.clone(), vec![select(ink, true)]].concat()));
    assert_eq!(with(Ink::ALL[0]), Ok(true), "a repeat is no new cartridge");
    assert_eq!(with(Ink::ALL[7]), Err((setup().len() + 14, Fault::TooManyCartridges)));
}
