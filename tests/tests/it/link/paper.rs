//! From a document to the paper, over a bad link, to a printer with an absent-minded operator.

use super::EVERYTHING;
use super::wire::{self, World};
use appearance::document::{self, Options};
use appearance::{factor, gamut};
use device::encodings::streams;
use device::transit::session::Outcome;
use model::{ALL, Job, seeded};
use observe::Silent;
use press::job::Handling;
use press::layout::Layout;
use press::pipeline::document::{Settings, halftoned};
use press::pipeline::{self, Request};
use press::simulate::{Carousel, Lever, Printer, Stock, Trouble, difference, wanted};
use protocol::link::message::{Fault, JobKind};
use protocol::paper::Paper;
use protocol::rgl::Media;
use rand::RngExt;
use std::cell::RefCell;

#[test]
fn a_document_becomes_the_very_sheet_whatever_happens_on_the_way() {
    let document = document::open("sample:leaf", &Options::default(), &Silent).unwrap();
    let settings = Settings {
        factor: factor::FactorSettings::default(),
        gamut: gamut::GamutSettings::default(),
        inks: inks::InkSet::default(),
        held_back: inks::InkSet::EMPTY,
        halftone: Default::default(),
        size: Some("12x9mm".parse().unwrap()),
    };
    let (layout, library) = (Layout::centred(Paper::Postcard), inks::Library::builtin());
    let halftoned = halftoned(&document, &library, &settings, &layout, &Silent).unwrap();
    let request = Request {
        name: &document.name,
        dots: &halftoned.dots,
        layout: &layout,
        handling: Handling { media: Media::default(), curl_correction: true },
        allowed: settings.inks,
        library: &library,
    };
    let print = pipeline::job(&request, &Silent).unwrap();
    let streams = streams::of_bytes(&print.bytes, &Silent).expect("a job of our own has streams");
    for seed in 0..4 {
        let mut random = seeded(seed);
        let (kind, data) =
            if seed % 2 == 0 { (JobKind::Streams, &streams) } else { (JobKind::Raw, &print.bytes) };
        let cartridges = wanted(&print.bytes);
        let printer = RefCell::new(Printer::new(Carousel::new(&cartridges).unwrap(), Lever::Auto));
        printer.borrow_mut().load(Stock::of(Paper::Postcard));
        let troubles = RefCell::new(0);
        let job = Job { id: 77, kind, data: data.clone(), expected: print.bytes.clone() };
        let mut boards = wire::boards(&mut random);
        let mut world =
            World::new(&job, &mut boards, ALL, EVERYTHING).with_port(Box::new(|bytes, random| {
                let mut printer = printer.borrow_mut();
                if let Some(trouble) = printer.trouble() {
                    // The operator comes by now and then and does what the printer wants.
                    if random.random_range(0..20) == 0 {
                        match trouble {
                            Trouble::CoverOpen => printer.close_cover(),
                            _ => printer.clear(),
                        }
                    }
                    return (0, Some(Fault::OffLine));
                }
                if random.random_range(0..60) == 0 {
                    *troubles.borrow_mut() += 1;
                    printer.strike(Trouble::CoverOpen);
                    return (0, Some(Fault::OffLine));
                }
                let count = bytes.len().min(random.random_range(0..3000));
                (printer.feed(&bytes[..count]).unwrap(), None)
            }));
        assert_eq!(world.run(None, &mut random), Outcome::Printed, "seed {seed}");
        assert!(world.printed == print.bytes, "seed {seed}");
        println!(
            "seed {seed}: {} bytes of {kind:?}, {:?}, {} troubles",
            data.len(),
            world.accidents,
            troubles.borrow()
        );
        drop(world);
        let printout = printer.borrow_mut().take_printout().expect("the sheet has come out");
        let sheet = printout.sheet_with(print.draft.sheet.stacks()).unwrap();
        assert_eq!(difference(&sheet, &print.draft.sheet), None, "seed {seed}");
    }
}
