//! Every sample, and every real document at hand, becomes a job that the simulated printer prints dot for
//! dot.
//!
//! [`Job::prove`] itself refuses a sheet that differs from the page; what is asserted here is asserted of
//! what came out of the printer. Real documents stand in the folder named by `FOILPRESS_DATA`.

use appearance::document::{self, Options};
use appearance::gamut::{self, Intent};
use appearance::{factor, sample};
use inks::{InkSet, Library, Stack};
use observe::Silent;
use press::job::Handling;
use press::layout::Layout;
use press::pipeline::document::{Halftoned, Settings, halftoned};
use press::pipeline::{self, Job, Request};
use protocol::paper::Paper;
use protocol::rgl::Media;
use sheet::Sheet;
use sheet::Size;

/// A document, its job, and the sheet that the simulated printer made of it.
struct Print {
    halftoned: Halftoned,
    job: Job,
    printed: Sheet,
}

fn print(spec: &str, intent: Intent, inks: InkSet) -> Print {
    let document =
        document::open(spec, &Options::default(), &Silent).unwrap_or_else(|e| panic!("{spec}: {e}"));
    let side = if testing::is_full() { 80.0 } else { 40.0 };
    let settings = Settings {
        factor: factor::FactorSettings { bases: Some(4), ..Default::default() },
        gamut: gamut::GamutSettings { intent, ..Default::default() },
        inks,
        held_back: inks::InkSet::EMPTY,
        halftone: Default::default(),
        size: Some(Size { width: side, height: Some(side) }),
    };
    let (layout, library) = (Layout::centred(Paper::Postcard), Library::builtin());
    let halftoned =
        halftoned(&document, &library, &settings, &layout, &Silent).unwrap_or_else(|e| panic!("{spec}: {e}"));
    let request = Request {
        name: &document.name,
        dots: &halftoned.dots,
        layout: &layout,
        handling: Handling { media: Media::Plain, curl_correction: true },
        allowed: inks,
        library: &library,
    };
    let job = pipeline::job(&request, &Silent).unwrap_or_else(|e| panic!("{spec}: {e}"));
    let printout = job.prove(&Silent).unwrap_or_else(|e| panic!("{spec}: {e}"));
    let printed = printout.sheet_with(job.draft.sheet.stacks()).unwrap_or_else(|e| panic!("{spec}: {e}"));
    Print { halftoned, job, printed }
}

/// What must be true of any sheet that comes out of the printer.
fn check(spec: &str, print: &Print, inks: InkSet) {
    let sheet = &print.printed;
    let library = Library::builtin();
    let used: Vec<&Stack> = sheet
        .stacks()
        .iter()
        .zip(sheet.census())
        .filter(|(_, dots)| *dots > 0)
        .map(|(stack, _)| stack)
        .collect();
    for stack in &used {
        assert!(inks.contains_all(stack.layers()), "{spec}: `{stack}` needs an ink that is not at hand");
        let listed = library.entry(stack).is_some();
        assert!(listed || library.broken_rules(stack).is_empty(), "{spec}: rules are against `{stack}`");
        assert!(library.curve_of(stack, &[0.0]).is_some(), "{spec}: nobody knows what `{stack}` reflects");
        assert!(print.halftoned.mapped.mix.stacks.contains(stack), "{spec}: `{stack}` was not asked for");
    }
    assert!(used.len() > 1, "{spec}: something is printed");
    let cartridges = InkSet::of(used.iter().flat_map(|stack| stack.layers().iter().copied()));
    assert!(cartridges.len() <= 7, "{spec}: {} cartridges", cartridges.len());

    // Outside its rectangle the sheet is bare; inside, every stack has the share the mix asks for.
    let [place] = print.job.draft.laid.copies[..] else { panic!("{spec}: one copy") };
    assert_eq!((place.width, place.length), (print.halftoned.dots.width(), print.halftoned.dots.length()));
    let inside = |dot: usize| {
        let (x, y) = (dot % sheet.width(), dot / sheet.width());
        (place.left..place.left + place.width).contains(&x)
            && (place.top..place.top + place.length).contains(&y)
    };
    assert!(sheet.index().iter().enumerate().all(|(dot, &stack)| stack == 0 || inside(dot)), "{spec}");
    let mix = &print.halftoned.mapped.mix;
    let pixels = (mix.maps.width() * mix.maps.height()) as f64;
    let mut asked = vec![0.0; mix.stacks.len()];
    for weights in mix.maps.data().chunks_exact(mix.maps.channels()) {
        for (&weight, shares) in weights.iter().zip(&mix.matrix) {
            for (asked, &share) in asked.iter_mut().zip(shares) {
                *asked += f64::from(weight) * f64::from(share) / f64::from(1u32 << 30) / pixels;
            }
        }
    }
    let dots = (place.width * place.length) as f64;
    let outside = (sheet.index().len() as f64) - dots;
    for (stack, (count, asked)) in sheet.stacks().iter().zip(sheet.census().into_iter().zip(asked)) {
        let bare = if stack.layers().is_empty() { outside } else { 0.0 };
        let printed = (count as f64 - bare) / dots;
        assert!(
            (printed - asked).abs() < 4e-3,
            "{spec}: `{stack}` asked for {asked:.4}, printed {printed:.4}"
        );
    }
}

#[test]
fn every_sample_prints() {
    for sample in testing::drawn(&sample::SAMPLES, 3) {
        let spec = format!("sample:{}", sample.name);
        let print = print(&spec, Intent::Basis, InkSet::default());
        check(&spec, &print, InkSet::default());
    }
}

#[test]
fn foils_print_where_they_are_at_hand() {
    let print = print("sample:card", Intent::Basis, InkSet::ALL);
    check("sample:card", &print, InkSet::ALL);
}

#[test]
fn a_document_prints_pixel_by_pixel() {
    for intent in [Intent::Clamp, Intent::Blend] {
        let print = print("sample:ladder", intent, InkSet::default());
        check("sample:ladder", &print, InkSet::default());
    }
}

#[test]
fn every_real_document_prints() {
    let Some(data) = testing::needs::data() else { return };
    let folder = data.join("svbrdf");
    let files = std::fs::read_dir(&folder).expect("the real documents").flatten();
    let mut documents: Vec<_> = files.map(|document| document.path()).collect();
    documents.sort();
    assert!(!documents.is_empty(), "{} is empty", folder.display());
    for document in testing::drawn(&documents, 2) {
        let spec = document.display().to_string();
        let print = print(&spec, Intent::Basis, InkSet::default());
        check(&spec, &print, InkSet::default());
    }
}
