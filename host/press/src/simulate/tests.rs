//! The printer as its operator and its jobs meet it.

use proptest::prelude::*;
use protocol::ink::Ink;
use protocol::paper::Paper;
use protocol::rgl::encode::encode_into;
use protocol::rgl::{Command, Compression, Fault, Media, Mode, Page, PaperCode, Resolution};

use super::*;
use crate::job::stream::write_job;
use crate::separate::Pass;
use inks::Stack;
use observe::Silent;
use sheet::Plane;
use sheet::Sheet;

const SMALL: Paper = Paper::Custom { width: 100, length: 80 };

/// A pass with the dots for which `dot` says so.
fn pass(paper: Paper, ink: Ink, dot: impl Fn(usize, usize) -> bool) -> Pass {
    let (width, length) = (usize::from(paper.width()), usize::from(paper.length()));
    let stride = width.div_ceil(8);
    let mut bits = vec![0; stride * length];
    for y in 0..length {
        for x in (0..width).filter(|&x| dot(x, y)) {
            bits[y * stride + x / 8] |= 0x80 >> (x % 8);
        }
    }
    Pass { ink, plane: Plane { width, length, stride, bits } }
}

fn job(paper: Paper, passes: &[Pass]) -> Vec<u8> {
    let mut bytes = vec![];
    write_job(Page::plain(paper), None, passes, &mut bytes, &Silent).unwrap();
    bytes
}

/// Three passes in three inks: a square, stripes, a diagonal.
fn three() -> Vec<Pass> {
    vec![
        pass(SMALL, Ink::White, |x, y| (10..40).contains(&x) && (10..40).contains(&y)),
        pass(SMALL, Ink::Cyan, |_, y| y % 7 == 0),
        pass(SMALL, Ink::Black, |x, y| x == y),
    ]
}

fn printer(cartridges: &[Ink]) -> Printer {
    let cartridges: Vec<Cartridge> = cartridges.iter().map(|&ink| ink.into()).collect();
    Printer::new(Carousel::new(&cartridges).unwrap(), Lever::Manual)
}

fn loaded(cartridges: &[Ink]) -> Printer {
    let mut printer = printer(cartridges);
    printer.load(Stock::of(SMALL));
    printer
}

const ALL_THREE: [Ink; 3] = [Ink::White, Ink::Cyan, Ink::Black];

fn bytes(commands: &[Command<'_>]) -> Vec<u8> {
    let mut all = vec![];
    for command in commands {
        let mut out = [0; 600];
        let length = encode_into(command, &mut out).unwrap();
        all.extend_from_slice(&out[..length]);
    }
    all
}

/// A job made command by command, as another program might: one pass of `ink`, one row.
fn raw(resolution: Resolution, width: u16, ink: Ink, row: &[u8]) -> Vec<u8> {
    bytes(&[
        Command::SelectRgl,
        Command::Resolution(resolution),
        Command::Media(Media::Plain),
        Command::Paper(PaperCode::from_paper(SMALL)),
        Command::Length(80),
        Command::Width(width),
        Command::CurlCorrection(true),
        Command::Mode(Mode::ColourPlane),
        Command::RasterStart,
        Command::InkSelect { ink, last: true },
        Command::Compression(Compression::Plain),
        Command::Row { last: false, data: row },
        Command::RasterEnd,
        Command::FormFeed,
        Command::LeaveRgl,
        Command::Reset,
    ])
}

#[test]
fn cartridges_are_on_the_carriage_in_the_order_of_the_passes() {
    let mut printer = loaded(&[Ink::Black, Ink::White, Ink::Cyan]);
    let mut seen = vec![];
    for byte in job(SMALL, &three()) {
        printer.feed(&[byte]).unwrap();
        let on = printer.carousel().on_carriage();
        if seen.last() != Some(&on) {
            seen.push(on);
        }
    }
    assert_eq!(seen, [None, Some(16), Some(3), Some(0)]);
}

#[test]
fn the_sheet_goes_back_between_passes_and_out_at_the_end() {
    let mut printer = loaded(&ALL_THREE);
    let mut seen = vec![];
    for byte in job(SMALL, &three()) {
        printer.feed(&[byte]).unwrap();
        let position = printer.position();
        if seen.last() != Some(&position) {
            seen.push(position);
        }
    }
    // The square ends below row 39, the last stripe below row 77, the diagonal below row 79; the margin is 284.
    let turns: Vec<_> = seen.windows(2).filter(|w| w[1] < w[0]).map(|w| (w[0], w[1])).collect();
    let top = Some(284);
    assert_eq!(turns, [(Some(284 + 40), top), (Some(284 + 78), top), (Some(284 + 80), top), (top, None)]);
    assert_eq!(seen[..2], [None, top]);
}

#[test]
fn a_missing_cartridge_is_asked_for_by_its_barcode_and_the_print_goes_on_with_it() {
    let job = job(SMALL, &three());
    let mut printer = loaded(&[Ink::Cyan, Ink::Black]);
    let taken = printer.feed(&job).unwrap();
    assert!(taken < job.len());
    assert_eq!(printer.trouble(), Some(Trouble::RibbonMismatch { wanted: 16 }));
    assert_eq!(printer.feed(&job[taken..]), Ok(0), "it waits");

    // The recorded answer's status and error bytes; the cartridges as they were before, whatever goes in meanwhile.
    assert_eq!(printer.feed(&[0x05, 0x01]), Ok(2));
    let asked = printer.answers();
    assert_eq!((asked.len(), asked[4], &asked[32..37]), (38, 0xc9, &[0, 0x10, 0, 0x86, 0][..]));
    printer.insert(Ink::Magenta.into()).unwrap();
    assert_eq!(printer.trouble(), Some(Trouble::RibbonMismatch { wanted: 16 }));
    assert_eq!(printer.status()[5..32], asked[5..32]);

    printer.insert(Ink::White.into()).unwrap();
    assert_eq!(printer.trouble(), None);
    assert_ne!(printer.status()[5..32], asked[5..32]);
    assert_eq!(printer.feed(&job[taken..]), Ok(job.len() - taken));
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn a_spent_ribbon_stops_the_print_until_a_fresh_one_is_in() {
    let spent = Cartridge { condition: Condition::Spent, ..Ink::Cyan.into() };
    let cartridges = [Ink::White.into(), spent, Ink::Black.into()];
    let mut printer = Printer::new(Carousel::new(&cartridges).unwrap(), Lever::Auto);
    printer.load(Stock::of(SMALL));
    let job = job(SMALL, &three());
    let taken = printer.feed(&job).unwrap();
    assert_eq!(printer.trouble(), Some(Trouble::RibbonEnd { barcode: 3 }));
    assert_eq!(printer.status()[33], 0x20);
    printer.insert(Ink::Cyan.into()).unwrap();
    printer.feed(&job[taken..]).unwrap();
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn without_paper_nothing_begins_and_with_paper_everything_is_printed() {
    let job = job(SMALL, &three());
    let mut printer = printer(&ALL_THREE);
    let taken = printer.feed(&job).unwrap();
    assert_eq!((printer.trouble(), printer.status()[4]), (Some(Trouble::NoPaper), 0xc0));
    printer.load(Stock::of(SMALL));
    assert_eq!(printer.feed(&job[taken..]), Ok(job.len() - taken));
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn a_sheet_too_short_is_printed_in_part_and_the_error_can_be_cleared() {
    let a4 = [pass(Paper::A4, Ink::Black, |x, y| x % 600 == 0 && y % 100 == 0)];
    let long = job(Paper::A4, &a4);
    let mut printer = printer(&ALL_THREE);
    printer.load(Stock::of(Paper::Postcard));
    let taken = printer.feed(&long).unwrap();
    assert_eq!(printer.trouble(), Some(Trouble::WrongSize));
    assert_eq!(printer.status()[32..37], [0, 0x80, 0xc0, 0, 0]);
    assert!(taken < long.len());

    assert_eq!(printer.feed(&[0x02, 0x02, 0x06, 0x00, 0x40, 0x52, 0x43, 0x4c, 0x33, 0x01, 0x03]), Ok(11));
    assert_eq!((printer.answers(), printer.trouble()), (vec![0x06], None));
    let part = printer.take_printout().unwrap();
    assert!(!part.complete);
    // 3496 rows of paper less both margins: rows 0 to 2871.
    let last = part.passes[0].plane.bits.iter().rposition(|&byte| byte != 0).unwrap() / 600;
    assert_eq!(last, 2800);

    printer.load(Stock::of(SMALL));
    printer.feed(&job(SMALL, &three())).unwrap();
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn every_paper_prints_on_its_own_sheet_to_its_last_row() {
    for paper in Paper::named().chain([SMALL]) {
        let last = usize::from(paper.length()) - 1;
        let passes = [pass(paper, Ink::Black, |x, y| y == last && x % 3 == 0)];
        let printout = print(&job(paper, &passes), &Setup::default(), &Silent).unwrap();
        assert_eq!((printout.paper, &printout.passes[..], printout.platen_dots), (paper, &passes[..], 0));
    }
}

#[test]
fn the_longer_a4_pages_of_other_drivers_print_too() {
    let longest = Paper::Custom { width: 4800, length: 6381 };
    let setup = Setup { stock: Some(Stock::of(Paper::A4)), ..Setup::default() };
    let passes = [pass(longest, Ink::Black, |x, y| x == y)];
    assert!(print(&job(longest, &passes), &setup, &Silent).unwrap().complete);
}

#[test]
fn dots_beside_the_sheet_soil_the_platen() {
    let setup = Setup { stock: Some(Stock { width: 80 + 60, length: 1000 }), ..Setup::default() };
    let passes = [pass(SMALL, Ink::Black, |x, y| y == 5 && x >= 50)];
    let printout = print(&job(SMALL, &passes), &setup, &Silent).unwrap();
    assert_eq!(printout.platen_dots, 40);
    assert_eq!(printout.passes[0], pass(SMALL, Ink::Black, |x, y| y == 5 && (50..60).contains(&x)));
}

#[test]
fn white_comes_out_twice_as_wide_in_a_job_of_1200_dpi_and_black_does_not() {
    let fine = |ink| {
        let printout =
            print(&raw(Resolution::Dpi1200, 200, ink, &[0x90]), &Setup::default(), &Silent).unwrap();
        assert!(matches!(printout.sheet(), Err(PrintoutError::Resolution { across: 1200, along: 600 })));
        printout.passes[0].plane.bits[..2].to_vec()
    };
    assert_eq!(fine(Ink::Black), [0x90, 0x00]);
    assert_eq!(fine(Ink::White), [0xc3, 0x00]);
    let wide = raw(Resolution::Dpi1200, 200, Ink::White, &[0xff; 25]);
    assert_eq!(print(&wide, &Setup::default(), &Silent).unwrap().lost_dots, 200);
}

#[test]
fn questions_are_answered_between_jobs_and_refused_within() {
    let mut printer = loaded(&ALL_THREE);
    assert_eq!(printer.feed(&[0x05]), Ok(1));
    assert!(printer.answers().is_empty());
    assert_eq!(printer.feed(&[0x01]), Ok(1));
    assert_eq!(printer.answers().len(), STATUS_LENGTH);
    let job = job(SMALL, &three());
    printer.feed(&job).unwrap();
    printer.feed(&[0x05, 0x01]).unwrap();
    assert_eq!(printer.answers()[4], 0x01, "just finished");
    assert!(printer.take_printout().is_some());
    printer.feed(&[0x05, 0x01]).unwrap();
    assert_eq!(printer.answers()[4], 0x00, "idle");

    printer.load(Stock::of(SMALL));
    printer.feed(&job[..4]).unwrap();
    let begun = printer.offset();
    assert_eq!(printer.feed(&[0x05, 0x01]), Err(Refused { offset: begun, fault: Fault::StatusInJob }));
}

#[test]
fn the_status_lags_behind_a_sheet_as_it_is_told_to() {
    let mut printer = loaded(&ALL_THREE).lagging(2, 3);
    printer.feed(&job(SMALL, &three())).unwrap();
    assert!(printer.take_printout().is_some());
    let said = [(); 7].map(|()| {
        printer.feed(&[0x05, 0x01]).unwrap();
        printer.answers()[4]
    });
    assert_eq!(said, [0, 0, 9, 9, 9, 0, 0]);
}

#[test]
fn a_second_job_waits_until_the_sheet_is_taken() {
    let job = job(SMALL, &three());
    let mut printer = loaded(&ALL_THREE);
    printer.feed(&job).unwrap();
    let mut other = printer.clone();
    let refused = Refused { offset: job.len() as u64, fault: Fault::AfterJob };
    assert_eq!(other.feed(&job), Err(refused));
    assert_eq!(other.feed(&[]), Err(refused), "it stays refused");
    other.power_cycle();
    assert_eq!(other.feed(&[]), Ok(0));
    printer.take_printout().unwrap();
    printer.load(Stock::of(SMALL));
    assert_eq!(printer.feed(&job), Ok(job.len()));
}

#[test]
fn wherever_a_piece_ends_the_next_job_prints_once_the_sheet_is_taken() {
    let job = job(SMALL, &three());
    let bytes = [&job[..], &status::ASK, &job].concat();
    // Around the end of the first job, its last reset and the question behind it.
    let last = job.len() + 3;
    for end in job.len() - 8..=last {
        let mut printer = loaded(&ALL_THREE);
        let mut sheets = Vec::new();
        for piece in [&bytes[..end], &bytes[end..last], &bytes[last..]] {
            printer.feed(piece).unwrap_or_else(|refused| panic!("cut at {end}: {refused}"));
            if let Some(sheet) = printer.take_printout() {
                sheets.push(sheet);
                printer.load(Stock::of(SMALL));
            }
        }
        assert!(sheets.len() == 2 && sheets.iter().all(|sheet| sheet.passes == three()), "cut at {end}");
        assert_eq!(printer.answers().len(), STATUS_LENGTH);
    }
}

#[test]
fn a_motor_error_needs_the_switch() {
    let job = job(SMALL, &three());
    let mut printer = loaded(&ALL_THREE);
    printer.feed(&job[..200]).unwrap();
    printer.strike(Trouble::Motor { unit: 0x80 });
    assert_eq!(printer.feed(&job[200..]), Ok(0));
    printer.clear();
    assert_eq!(printer.trouble(), Some(Trouble::Motor { unit: 0x80 }));
    assert_eq!(printer.status()[32..37], [0x80, 0, 0, 0, 0x80]);
    printer.power_cycle();
    assert_eq!(printer.trouble(), None);
    assert!(!printer.take_printout().unwrap().complete);
    printer.load(Stock::of(SMALL));
    assert_eq!(printer.feed(&job), Ok(job.len()));
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn an_open_cover_only_pauses_the_job() {
    let job = job(SMALL, &three());
    let mut printer = loaded(&ALL_THREE);
    let mut taken = printer.feed(&job[..200]).unwrap();
    printer.strike(Trouble::CoverOpen);
    taken += printer.feed(&job[200..]).unwrap();
    printer.close_cover();
    printer.feed(&job[taken..]).unwrap();
    assert_eq!(printer.take_printout().unwrap().passes, three());
}

#[test]
fn a_job_cut_off_anywhere_is_no_sheet_and_says_where_it_ends() {
    let job = job(SMALL, &three());
    // The reset after the job may be missing, nothing else.
    for cut in (0..job.len() - 2).step_by(3).chain(job.len() - 12..job.len() - 2) {
        let refused = Refused { offset: cut as u64, fault: Fault::Truncated };
        assert_eq!(print(&job[..cut], &Setup::default(), &Silent), Err(refused.into()));
    }
    assert!(print(&job[..job.len() - 2], &Setup::default(), &Silent).unwrap().complete);
}

#[test]
fn messages_say_which_byte_which_ink_and_what_to_do() {
    let mut bad = job(SMALL, &three());
    bad[3] = 0;
    let text = print(&bad, &Setup::default(), &Silent).unwrap_err().to_string();
    assert_eq!(text, "byte 0: no command of the printer's language begins with these bytes");
    let setup = Setup { cartridges: Some(vec![]), ..Setup::default() };
    let text = print(&job(SMALL, &three()), &setup, &Silent).unwrap_err().to_string();
    assert!(text.ends_with("ribbon mismatch: insert the white cartridge (barcode 16)"), "{text}");
}

#[test]
fn stacks_that_are_not_in_the_list_are_named() {
    let printout = print(&job(SMALL, &three()), &Setup::default(), &Silent).unwrap();
    let list = [Stack::SUBSTRATE, "W".parse().unwrap(), "C".parse().unwrap(), "K".parse().unwrap()];
    let missing = printout.sheet_with(&list).unwrap_err();
    assert!(matches!(&missing, PrintoutError::UnknownStack(stack) if stack.layers().len() > 1), "{missing}");
}

#[test]
fn an_eighth_cartridge_is_refused_where_it_is_asked_for() {
    let mut eight = raw(Resolution::Dpi600, 100, Ink::Black, &[1]);
    let select = eight.windows(5).position(|w| w == [0x1b, 0x1a, 0x00, 0x80, 0x72]).unwrap();
    let before: Vec<u8> = Ink::ALL[1..8]
        .iter()
        .flat_map(|&ink| bytes(&[Command::InkSelect { ink, last: false }, Command::BackFeed]))
        .collect();
    eight.splice(select..select, before.iter().copied());
    let refused = Refused { offset: (select + before.len()) as u64, fault: Fault::TooManyCartridges };
    assert_eq!(print(&eight, &Setup::default(), &Silent), Err(refused.into()));
}

/// Every outcome there is to see, whatever the pieces the bytes came in.
fn outcome(
    stream: &[u8],
    pieces: &[usize],
    cartridges: &[Ink],
) -> (Option<Refused>, Option<Trouble>, Vec<u8>, Option<Printout>) {
    let mut printer = loaded(cartridges);
    let mut rest = stream;
    let mut pieces = pieces.iter().cycle();
    let mut refused = None;
    while !rest.is_empty() {
        let piece = rest.len().min(*pieces.next().unwrap_or(&rest.len()));
        match printer.feed(&rest[..piece]) {
            Err(error) => refused = Some(error),
            Ok(taken) if taken == piece => {
                rest = &rest[piece..];
                continue;
            }
            Ok(_) => {}
        }
        break;
    }
    let status = printer.status().to_vec();
    (refused, printer.trouble(), [status, printer.answers()].concat(), printer.take_printout())
}

/// A number of passes, the sets of them that are used, and for each dot one of the sets.
fn pages() -> impl Strategy<Value = (Paper, Vec<Ink>, Vec<u32>)> {
    (1..70u16, 1..50u16, prop_oneof![1..8usize, 13..20usize]).prop_flat_map(|(width, length, passes)| {
        let dots = usize::from(width) * usize::from(length);
        // Seven inks at most: the printer holds no more.
        (
            Just(Paper::Custom { width, length }),
            proptest::collection::vec((0..7usize).prop_map(|i| Ink::ALL[i + 4]), passes),
            proptest::collection::vec(0..1u32 << passes, 1..40)
                .prop_flat_map(move |sets| proptest::collection::vec(proptest::sample::select(sets), dots)),
        )
    })
}

proptest! {
    #![proptest_config(testing::cases(48))]

    #[test]
    fn the_sheet_that_was_sent_comes_out_dot_for_dot((paper, inks, sets) in pages()) {
        let width = usize::from(paper.width());
        let passes: Vec<Pass> = inks.iter().enumerate()
            .map(|(p, &ink)| pass(paper, ink, |x, y| sets[y * width + x] >> p & 1 != 0))
            .collect();
        let mut stacks = vec![Stack::SUBSTRATE];
        let index: Vec<u8> = sets.iter().map(|set| {
            let layers: Vec<Ink> = (0..inks.len()).filter(|p| set >> p & 1 != 0).map(|p| inks[p]).collect();
            let stack = Stack::new(layers);
            let known = stacks.iter().position(|s| *s == stack);
            known.unwrap_or_else(|| { stacks.push(stack); stacks.len() - 1 }) as u8
        }).collect();
        let sent = Sheet::new(paper, stacks, index).unwrap();
        prop_assume!(passes.iter().any(|pass| !pass.plane.is_blank()));

        let printout = print(&job(paper, &passes), &Setup::default(), &Silent).unwrap();
        let printing: Vec<Pass> =
            passes.into_iter().filter(|pass| !pass.plane.is_blank()).collect();
        prop_assert_eq!(&printout.passes, &printing);
        let sheet = printout.sheet().unwrap();
        prop_assert_eq!(difference(&sent, &sheet), None);
        prop_assert_eq!(&printout.sheet_with(sent.stacks()).unwrap(), &sent);

        // One dot changed is found.
        let mut other = sheet.index().to_vec();
        let dot = other.len() / 2;
        other[dot] = if other[dot] == 0 { sheet.stacks().len() as u8 - 1 } else { 0 };
        let other = Sheet::new(paper, sheet.stacks().to_vec(), other).unwrap();
        let found = difference(&sent, &other);
        let at = match found {
            Some(Difference::Dot { x, y, .. }) => Some(y * width + x),
            _ => None,
        };
        prop_assert_eq!(at, Some(dot));
    }

    #[test]
    fn byte_by_byte_is_the_same_as_all_at_once(
        pieces in proptest::collection::vec(1..40usize, 1..6),
        spoil in proptest::option::of((any::<prop::sample::Index>(), any::<u8>())),
        question in proptest::option::of(any::<prop::sample::Index>()),
        missing in proptest::bool::weighted(0.3),
    ) {
        let mut stream = job(SMALL, &three());
        if let Some((at, byte)) = spoil {
            let at = at.index(stream.len());
            stream[at] = byte;
        }
        if let Some(at) = question {
            let at = at.index(stream.len() + 1);
            stream.splice(at..at, [0x05, 0x01]);
        }
        let cartridges = if missing { &ALL_THREE[1..] } else { &ALL_THREE };
        let whole = outcome(&stream, &[], cartridges);
        prop_assert_eq!(&outcome(&stream, &[1], cartridges), &whole);
        prop_assert_eq!(&outcome(&stream, &pieces, cartridges), &whole);
    }

    #[test]
    fn no_bytes_make_the_printer_panic(
        head in 0..120usize,
        tail in proptest::collection::vec(
            prop_oneof![Just(0x1bu8), Just(0x1a), Just(0x2a), Just(0x62), Just(0x57), Just(0x0c), any::<u8>()],
            0..200,
        ),
    ) {
        let stream = [&job(SMALL, &three())[..head], &tail].concat();
        let _ = print(&stream, &Setup::default(), &Silent);
        let seen = crate::inspect::inspect(&stream, &Silent);
        prop_assert_eq!(seen.inspection.complete, seen.inspection.error.is_none());
    }
}
