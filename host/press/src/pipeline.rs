//! From something laid on a page to a job with its plan: one way for everything that is printed.
//!
//! Problem: documents, layers, charts, pages of a queue and the step-by-step commands must not differ in what they
//! refuse, what they warn of and what they send.
//! Method: [`draft`] lays a dot map on its page, separates it and draws up the plan; [`job`] also refuses what must not be
//! printed and writes the bytes. The steps in between, [`separate_page`] and [`encode`], are what the step-by-step commands
//! call. [`document`] makes the dot map of a document; those of layers and charts come from their modules.
//!
//! Where the bytes are parsed: not here, but for [`Job::prove`]. A job is written by the writer of `protocol::rgl`, whose
//! tests hold it against the parser, so reading it back adds nothing that a plan or a queue needs.
//! 1. A job that is kept is proved once, where it is made: `prove` prints it on the simulated printer and compares the sheet
//!    dot for dot. Its pictures are drawn from that printout, so they show what the bytes say, not what was meant.
//! 2. A job that is sent is parsed strictly once more by the sender, before the first byte leaves: its bytes may come from
//!    a file, a queue or another program, and no sender is to trust the one before it.
//!
//! `docs/decisions/where-a-job-is-checked.md` has the figures.

pub mod document;

use inks::{Certainty, InkSet, Library, Severity};
use protocol::ink::Kind;
use protocol::paper::Paper;
use protocol::rgl::{FoilConsent, Media, Page, Resolution};
use protocol::walk::Frame;

use crate::job::Handling;
use crate::job::plan::{Plan, Subject};
use crate::job::stream::{self, StreamError};
use crate::layout::{self, Arranged, Laid, Layout, LayoutError};
use crate::separate::{self, Check, Pass, SeparateError, Separation};
use crate::simulate::{self, Difference, Printout, PrintoutError, SimulateError};
use observe::Observer;
use sheet::{DotMap, Sheet};

/// What is to be printed, and how.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Name of the document or art.
    pub name: &'a str,
    /// Its dots.
    pub dots: &'a DotMap,
    /// The paper and how the dots lie on it.
    pub layout: &'a Layout,
    /// How the printer is told to treat the sheet.
    pub handling: Handling,
    /// The inks that may be used. A foil among them is the user's consent to print it.
    pub allowed: InkSet,
    /// The ink library: its rules and names.
    pub library: &'a Library,
}

/// A job before its bytes are written: the page, its passes and its plan.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The page.
    pub sheet: Sheet,
    /// Where things are on it.
    pub laid: Laid,
    /// Its passes, and what the rules say of them.
    pub separation: Separation,
    /// The plan.
    pub plan: Plan,
}

/// A job with its plan.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it prints.
    pub draft: Draft,
    /// How the printer is told to treat the sheet.
    pub page: Page,
    /// Where the dots lie on the page, which is where the walk along which they may have been halftoned begins.
    pub frame: Frame,
    /// The job in the printer's language.
    pub bytes: Vec<u8>,
}

/// Why there is no job.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// Laying it on the page.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Separation.
    #[error(transparent)]
    Separate(#[from] SeparateError),
    /// The rules on stacks and pages forbid the job.
    #[error("this must not be printed: {text}")]
    Refused {
        /// The rule.
        rule: String,
        /// What it says, with its stacks.
        text: String,
    },
    /// Writing the job.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The simulated printer refused the job. Never seen; if it is, it is a bug worth a report.
    #[error("the simulated printer did not print the job")]
    Simulate(#[from] SimulateError),
    /// The simulated sheet cannot be compared. Never seen either.
    #[error(transparent)]
    Printout(#[from] PrintoutError),
    /// The simulated sheet is not the one that was laid out. Never seen either.
    #[error("the simulated sheet is not the one that was laid out: {0}")]
    Different(Difference),
}

/// Lays dots on their page, separates them and draws up the plan. What must not be printed is planned, too: the plan's
/// checks say why.
///
/// # Errors
/// A layout without room, or more passes than a sheet can take.
pub fn draft(request: &Request<'_>, observer: &dyn Observer) -> Result<Draft, JobError> {
    let Request { name, layout, library, .. } = *request;
    let Arranged { sheet, laid } = layout::arrange(request.dots, layout, observer)?;
    let separation = separate_page(&sheet, &laid, library, observer)?;
    let mut separation = separation;
    separation.checks.splice(..0, wrong_resolution(layout, &separation.passes));
    separation.checks.splice(..0, untried(request.handling.media));
    let page = Page { resolution: layout.resolution, ..request.handling.page(layout.paper) };
    let plan = Plan::new(&Subject::new(name, &sheet, &laid, &separation, &page, layout.mirror), library);
    Ok(Draft { sheet, laid, separation, plan })
}

/// Makes a job with its plan.
///
/// # Errors
/// Those of [`draft`], a rule that forbids the job, or nothing to print.
pub fn job(request: &Request<'_>, observer: &dyn Observer) -> Result<Job, JobError> {
    let draft = draft(request, observer)?;
    permit(&draft.separation)?;
    let passes = &draft.separation.passes;
    let Layout { paper, resolution, .. } = *request.layout;
    let page = Page { resolution, ..request.handling.page(paper) };
    let bytes = encoded(page, passes, &request.allowed, observer)?;
    let frame = layout::frame(request.dots.width(), request.dots.length(), request.layout)?;
    Ok(Job { draft, page, frame, bytes })
}

/// What forbids media for which the printer may expect rows of another kind ([the language](../../../docs/rgl.md#media)).
fn untried(media: Media) -> Option<Check> {
    matches!(media, Media::VPhotoFilm | Media::VPhotoCard).then(|| Check {
        rule: "vphoto".into(),
        severity: Severity::Error,
        certainty: Certainty::Inferred,
        text: "VPhoto media may switch the printer to rows of four bits a dot, which nobody has tried; choose another medium, such as \
               glossy-paper"
            .into(),
        stacks: Vec::new(),
    })
}

/// What forbids passes at another resolution than 600 dpi: the printer takes the pitch of a dot from the cartridge.
fn wrong_resolution(layout: &Layout, passes: &[Pass]) -> Option<Check> {
    let mut special: Vec<&str> = passes
        .iter()
        .map(|pass| pass.ink)
        .filter(|ink| ink.kind() != Kind::Process)
        .map(|ink| ink.name())
        .collect();
    special.dedup();
    (layout.resolution != Resolution::Dpi600 && !special.is_empty()).then(|| Check {
        rule: "resolution".into(),
        severity: Severity::Error,
        certainty: Certainty::Measured,
        text: format!(
            "only cyan, magenta, yellow and black print at 1200 dpi, and white came out twice as wide; print at 600 dpi, or \
             without {}",
            special.join(", ")
        ),
        stacks: Vec::new(),
    })
}

/// The passes of a page, and what the rules say of its copies: marks are cut off, so no rule but a ban is about them.
///
/// # Errors
/// More passes or layers than a sheet can take.
pub fn separate_page(
    sheet: &Sheet,
    laid: &Laid,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Separation, JobError> {
    let mut separation = separate::separate(sheet, library.rules(), observer)?;
    let census = laid.census(sheet);
    separation.spare_marks(|stack| {
        sheet.stacks().iter().zip(census).any(|(known, dots)| known == stack && dots > 0)
    });
    Ok(separation)
}

/// Whether the rules permit to print this.
///
/// # Errors
/// [`JobError::Refused`] with the rule and its stacks.
pub fn permit(separation: &Separation) -> Result<(), JobError> {
    match separation.checks.iter().find(|check| check.severity == Severity::Error) {
        Some(check) => Err(JobError::Refused { rule: check.rule.clone(), text: check.with_stacks() }),
        None => Ok(()),
    }
}

/// The bytes of a job. A foil among the inks `allowed` is the user's consent to print it.
///
/// # Errors
/// Nothing to print, foil without consent, or passes that are not the paper's size.
pub fn encode(
    paper: Paper,
    handling: Handling,
    passes: &[Pass],
    allowed: &InkSet,
    observer: &dyn Observer,
) -> Result<Vec<u8>, JobError> {
    encoded(handling.page(paper), passes, allowed, observer)
}

fn encoded(
    page: Page,
    passes: &[Pass],
    allowed: &InkSet,
    observer: &dyn Observer,
) -> Result<Vec<u8>, JobError> {
    let foil = allowed.iter().any(|ink| ink.kind() == Kind::Foil).then(FoilConsent::given_by_the_user);
    let mut bytes = Vec::new();
    stream::write_job(page, foil, passes, &mut bytes, observer)?;
    Ok(bytes)
}

impl Job {
    /// The passes that are printed: those that have a dot.
    pub fn passes(&self) -> impl Iterator<Item = &Pass> {
        self.draft.separation.passes.iter().filter(|pass| !pass.plane.is_blank())
    }

    /// Prints the bytes on the simulated printer and compares its sheet with the page, dot for dot. Returns what the
    /// printer made of the bytes, pass by pass.
    ///
    /// # Errors
    /// Bytes that the simulated printer refuses, or another sheet: a bug, never a matter of input.
    pub fn prove(&self, observer: &dyn Observer) -> Result<Printout, JobError> {
        let printout = simulate::print(&self.bytes, &simulate::Setup::default(), observer)?;
        let sheet = &self.draft.sheet;
        match simulate::difference(sheet, &printout.sheet_in_dots(Some(sheet.stacks()))?) {
            Some(difference) => Err(JobError::Different(difference)),
            None => Ok(printout),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Stack;
    use observe::Silent;
    use protocol::ink::Ink;
    use protocol::rgl::Media;

    const PLAIN: Handling = Handling { media: Media::Plain, curl_correction: true };

    fn square(stack: &str) -> DotMap {
        let stacks = vec![Stack::SUBSTRATE, stack.parse().unwrap()];
        let index = (0..2400).map(|dot| u8::from((5..35).contains(&(dot % 60)) && dot / 60 < 30)).collect();
        DotMap::new(60, 40, stacks, index).unwrap()
    }

    fn request<'a>(
        dots: &'a DotMap,
        layout: &'a Layout,
        allowed: InkSet,
        library: &'a Library,
    ) -> Request<'a> {
        Request { name: "square", dots, layout, handling: PLAIN, allowed, library }
    }

    #[test]
    fn a_job_prints_the_page_it_was_drafted_as() {
        let (dots, library) = (square("MS+C"), Library::builtin());
        let layout = Layout {
            repeat: layout::Repeat::Grid(2, 3),
            crop_marks: true,
            ..Layout::centred(Paper::Custom { width: 700, length: 700 })
        };
        let request = request(&dots, &layout, InkSet::default(), &library);
        let job = job(&request, &Silent).unwrap();
        let printout = job.prove(&Silent).unwrap();
        let inks: Vec<Ink> = printout.passes.iter().map(|pass| pass.ink).collect();
        assert_eq!(inks, [Ink::MetallicSilver, Ink::Cyan]);
        assert_eq!((job.draft.plan.copies, job.draft.plan.passes.len()), ((2, 3), 2));
        // Another sheet is told apart.
        let mut other = job;
        let (stacks, mut index) = other.draft.sheet.dots().clone().into_parts();
        index[0] ^= 1;
        other.draft.sheet = Sheet::new(layout.paper, stacks, index).unwrap();
        assert!(matches!(other.prove(&Silent), Err(JobError::Different(_))));
    }

    #[test]
    fn a_job_at_1200_dpi_prints_its_dots_where_they_are_wanted_and_takes_process_inks_only() {
        let library = Library::builtin();
        // 61 x 20 at 1/600 inch: twice as many dots across, every other one black but for one column of cyan.
        let dots = |other: &str| {
            let stacks = vec![Stack::SUBSTRATE, "K".parse().unwrap(), other.parse().unwrap()];
            let index = (0..122 * 20).map(|dot| if dot % 122 == 31 { 2 } else { (dot % 2) as u8 });
            DotMap::new(122, 20, stacks, index.collect()).unwrap()
        };
        for mirror in [false, true] {
            let layout = Layout {
                resolution: Resolution::Dpi1200,
                position: layout::Position::FromPrintable("2.54x5.08mm".parse().unwrap()),
                repeat: layout::Repeat::Grid(2, 1),
                gap: "2.54x0mm".parse().unwrap(),
                mirror,
                ..Layout::centred(Paper::A4)
            };
            let dots = dots("C");
            let job = job(&request(&dots, &layout, InkSet::default(), &library), &Silent).unwrap();
            let printout = job.prove(&Silent).unwrap();
            assert_eq!((printout.resolution, printout.paper), (Resolution::Dpi1200, Paper::A4));
            let plane = &printout.passes.iter().find(|pass| pass.ink == Ink::Black).unwrap().plane;
            assert_eq!((plane.width, plane.length), (9600, 6372));
            // Found one by one: corners at 60 and 181 x 120 in 1/600 inch.
            for (x, y) in (100..400).flat_map(|x| (115..145).map(move |y| (x, y))) {
                let black = plane.bits[y * plane.stride + x / 8] & 0x80 >> (x % 8) != 0;
                let wanted = [120, 362].iter().any(|&left| {
                    let at = if mirror { (left + 121usize).checked_sub(x) } else { x.checked_sub(left) };
                    (120..140).contains(&y) && at.is_some_and(|at| at < 122 && at % 2 == 1 && at != 31)
                });
                assert_eq!(black, wanted, "({x}, {y}), mirror {mirror}");
            }
            let plan = &job.draft.plan;
            assert_eq!((plan.resolution_dpi, plan.size_dots), ((1200, 600), (122, 20)));
            assert!((plan.size_mm.0 - 61.0 * 25.4 / 600.0).abs() < 1e-9, "{:?}", plan.size_mm);
            assert!((plan.from_edge_mm.0 - (80.0 + 60.0) * 25.4 / 600.0).abs() < 1e-9);
        }
        let layout = Layout { resolution: Resolution::Dpi1200, ..Layout::centred(Paper::A4) };
        let white = dots("W");
        let asked = request(&white, &layout, InkSet::default(), &library);
        assert_eq!(draft(&asked, &Silent).unwrap().plan.checks[0].rule, "resolution");
        let said = job(&asked, &Silent).unwrap_err().to_string();
        assert!(said.contains("print at 600 dpi, or without white"), "{said}");
    }

    #[test]
    fn what_must_not_be_printed_is_planned_but_becomes_no_job() {
        // Foil in clusters of four dots does not stick.
        let stacks = vec![Stack::SUBSTRATE, Stack::new([Ink::GoldFoil])];
        let index = (0..2400).map(|dot| u8::from(dot % 60 % 8 < 2 && dot / 60 % 8 < 2)).collect();
        let (dots, library) = (DotMap::new(60, 40, stacks, index).unwrap(), Library::builtin());
        let layout = Layout::centred(Paper::Postcard);
        let request = request(&dots, &layout, InkSet::ALL, &library);
        let draft = draft(&request, &Silent).unwrap();
        assert_eq!(draft.plan.checks[0].rule, "foil-speckle");
        let said = job(&request, &Silent).unwrap_err().to_string();
        assert!(said.starts_with("this must not be printed: foil in clusters"), "{said}");
    }

    #[test]
    fn foil_is_written_only_with_consent() {
        let (dots, library) = (square("SF"), Library::builtin());
        let layout = Layout::centred(Paper::Postcard);
        assert!(job(&request(&dots, &layout, InkSet::ALL, &library), &Silent).is_ok());
        let refused = job(&request(&dots, &layout, InkSet::default(), &library), &Silent);
        assert!(matches!(refused, Err(JobError::Stream(StreamError::Forbidden(_)))));
    }
}
