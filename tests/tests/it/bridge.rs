//! From a halftoned sheet through pass streams and the bridge's engine to the simulated printer.

use appearance::gamut::InkMix;
use appearance::weights::{WeightMaps, quantise};
use bridge::engine::{Engine, Identity, Memory};
use halftone::{Settings, halftone};
use inks::Stack;
use observe::Silent;
use press::job::stream::write_job;
use press::separate::{Pass, separate};
use press::simulate::{Carousel, Cartridge, Lever, Printer, Setup, Stock, difference, print};
use protocol::ink::Ink;
use protocol::link::frame::{self, MAX, Reader};
use protocol::link::message::{DATA_MAX, JobKind, JobState, ToBridge};
use protocol::paper::Paper;
use protocol::rgl::Page;
use protocol::runs::{Decoder, Header, MAX_BAND, MAX_HEADER, encode};
use protocol::walk::Placed;
use sheet::Sheet;

const PAPER: Paper = Paper::Custom { width: 900, length: 610 };
const INKS: [Ink; 3] = [Ink::MetallicSilver, Ink::Cyan, Ink::Finish];

/// Five stacks of up to three layers, smoothly mixed, clusters of at least 9 dots.
fn sheet() -> Sheet {
    let stacks = vec![
        Stack::SUBSTRATE,
        Stack::new(vec![Ink::MetallicSilver]),
        Stack::new(vec![Ink::Cyan]),
        Stack::new(vec![Ink::MetallicSilver, Ink::Cyan]),
        Stack::new(vec![Ink::MetallicSilver, Ink::Cyan, Ink::Finish]),
    ];
    let (width, height, count) = (90, 61, stacks.len());
    let mut data = vec![0; width * height * count];
    for (pixel, out) in data.chunks_exact_mut(count).enumerate() {
        let (x, y) = ((pixel % width) as f64 / 30.0, (pixel / width) as f64 / 20.0);
        let weights: Vec<f64> = (0..count).map(|i| 1.05 + (x * (1.0 + i as f64) + y).sin()).collect();
        quantise(&weights, out);
    }
    let matrix = (0..count).map(|i| (0..count).map(|j| if i == j { 1 << 15 } else { 0 }).collect()).collect();
    let mix = InkMix { stacks, maps: WeightMaps::new(width, height, count, data).unwrap(), matrix };
    let page = (PAPER.width(), PAPER.length());
    let dots = halftone(&mix, page, None, &Settings::uniform(count, 9), &Silent).unwrap();
    let (stacks, index) = dots.into_parts();
    Sheet::new(PAPER, stacks, index).unwrap()
}

/// The job's data for the bridge.
fn streams(passes: &[Pass]) -> Vec<u8> {
    let inks: Vec<Ink> = passes.iter().map(|pass| pass.ink).collect();
    let header = Header::new(Page::plain(PAPER), &inks, None, PAPER.width(), PAPER.length()).unwrap();
    let mut out = [0; MAX_HEADER];
    let length = header.write(&mut out);
    let (mut bytes, mut buffer) = (out[..length].to_vec(), vec![0; MAX_BAND]);
    for pass in passes {
        encode(&Placed::whole(PAPER.width(), PAPER.length()), &pass.plane.bits, &mut buffer, |band| {
            bytes.extend_from_slice(band)
        })
        .unwrap();
    }
    bytes
}

/// What crosses the port, and how the job ends; it is cancelled when so many bytes have crossed.
fn bridged(data: &[u8], cancel_at: Option<usize>) -> (Vec<u8>, JobState) {
    let (mut queue, mut output, mut band) = (vec![0; 4096], vec![0; 4096], vec![0; 8192]);
    let mut decoder = Decoder::default();
    let memory = Memory { data: &mut queue, output: &mut output, band: &mut band, decoder: &mut decoder };
    let mut engine = Engine::new(memory, Identity { boot: 1, serial: 1, firmware: "test" });
    engine.wake(true, 0);
    let (mut reader, mut frame) = (Reader::new(), [0; MAX]);
    let mut tell = |engine: &mut Engine<'_>, message: ToBridge<'_>| {
        let length = frame::write(&message, &mut frame).unwrap();
        engine.receive(&mut reader, &frame[..length]);
    };
    tell(&mut engine, ToBridge::Begin { job: 1, kind: JobKind::Streams, length: data.len() as u32 });
    let mut printed = Vec::new();
    loop {
        let progress = engine.progress();
        if !matches!(progress.state, JobState::Printing | JobState::Cancelling) {
            return (printed, progress.state);
        }
        if cancel_at.is_some_and(|at| printed.len() >= at) {
            tell(&mut engine, ToBridge::Cancel { job: 1 });
        }
        let (from, to) = (progress.accepted, progress.limit.min(progress.accepted + DATA_MAX as u32));
        if from < to {
            let bytes = &data[from as usize..to as usize];
            tell(&mut engine, ToBridge::Data { job: 1, offset: from, bytes });
        }
        for _ in 0..100 {
            engine.work();
        }
        let bytes = engine.output();
        let count = bytes.len().min(1000);
        printed.extend_from_slice(&bytes[..count]);
        engine.consumed(count);
    }
}

#[test]
fn the_paper_shows_the_sheet_that_went_through_the_bridge() {
    let sheet = sheet();
    let passes = separate(&sheet, &[], &Silent).unwrap().passes;
    let (printed, state) = bridged(&streams(&passes), None);
    assert_eq!(state, JobState::Done);
    let mut file = Vec::new();
    write_job(Page::plain(PAPER), None, &passes, &mut file, &Silent).unwrap();
    assert!(printed == file, "the bridge and the file writer differ");
    let printout = print(&printed, &Setup::default(), &Silent).unwrap();
    assert_eq!(difference(&printout.sheet().unwrap(), &sheet), None);
}

#[test]
fn the_job_after_a_cancelled_one_prints_on_the_same_printer() {
    let sheet = sheet();
    let passes = separate(&sheet, &[], &Silent).unwrap().passes;
    let data = streams(&passes);
    let whole = bridged(&data, None).0;
    let cartridges = INKS.map(Cartridge::from);
    let mut printer = Printer::new(Carousel::new(&cartridges).unwrap(), Lever::Auto);
    for eighth in 0..8 {
        let (printed, state) = bridged(&data, Some(1 + whole.len() * eighth / 8));
        assert_eq!(state, JobState::Cancelled);
        printer.load(Stock::of(PAPER));
        assert_eq!(printer.feed(&printed), Ok(printed.len()), "{eighth}/8");
        assert!(printer.take_printout().is_some(), "{eighth}/8: the sheet stays in the printer");
        printer.load(Stock::of(PAPER));
        assert_eq!(printer.feed(&whole), Ok(whole.len()), "{eighth}/8");
        let printout = printer.take_printout().unwrap();
        assert_eq!(difference(&printout.sheet().unwrap(), &sheet), None);
    }
}
