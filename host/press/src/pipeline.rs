//! The whole chain: a document in, the bytes of a job and the simulated sheet out.
//!
//! Nothing is decided here that a stage does not decide; this is only their order, and the values between them kept
//! for those who want to look.

use inks::{InkSet, Library};
use protocol::ink::Kind;
use protocol::paper::Paper;
use protocol::rgl::{FoilConsent, Media, Page};

use crate::halftone::eye::Tangent;
use crate::halftone::{self, HalftoneError, Placement};
use crate::job::placement::{self, PlacementError, Size};
use crate::job::stream::{self, StreamError};
use crate::layout::{self, Arranged, Laid, Layout, LayoutError};
use crate::separate::{self, Pass, SeparateError, Separation, Severity};
use crate::sheet::{Piece, Sheet};
use crate::simulate::{self, Difference, Printout, PrintoutError, SimulateError};
use appearance::brdf::{Space, Table};
use appearance::document::Document;
use appearance::factor::{self, FactorError, Factored};
use appearance::gamut::{self, GamutError, InkMix, Mapped, Printable};
use observe::Observer;

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the document is factored.
    pub factor: factor::Settings,
    /// How it is mapped to the printer's gamut.
    pub gamut: gamut::Settings,
    /// The inks at hand. Foils in the set are the user's consent to print them.
    pub inks: InkSet,
    /// How dots are chosen.
    pub halftone: halftone::Method,
    /// The paper and how the document lies on it.
    pub layout: Layout,
    /// What the paper is made of.
    pub media: Media,
    /// Whether the machine corrects the paper's curl.
    pub curl_correction: bool,
    /// Size on paper.
    pub size: Option<Size>,
}

/// Everything a print is made of.
pub struct Print {
    /// The document in bases and weight maps.
    pub factored: Factored,
    /// What the factoring reports; absent when the document came factored.
    pub factoring: Option<factor::Report>,
    /// The mixture of stacks, and what the mapping reports.
    pub mapped: Mapped,
    /// The document by itself, as halftoned: what the page repeats, mirrors and marks.
    pub halftoned: Sheet,
    /// Where the first of it lies on the page.
    pub placement: Placement,
    /// Where everything lies on the page.
    pub laid: Laid,
    /// The page.
    pub sheet: Sheet,
    /// Its passes.
    pub separation: Separation,
    /// The job in the printer's language.
    pub job: Vec<u8>,
    /// What the simulated printer made of `job`, pass by pass.
    pub printout: Printout,
    /// The same as a sheet: equal to `sheet`, dot for dot.
    pub printed: Sheet,
}

/// Why a document was not printed: the error of the stage that refused.
#[derive(Debug, thiserror::Error)]
pub enum PrintError {
    /// Factoring.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// Gamut mapping.
    #[error(transparent)]
    Gamut(#[from] GamutError),
    /// Placing on the page.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// Halftoning.
    #[error(transparent)]
    Halftone(#[from] HalftoneError),
    /// Laying it on the page.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Separation.
    #[error(transparent)]
    Separate(#[from] SeparateError),
    /// Writing the job.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The rules on stacks and pages forbid the job.
    #[error("this must not be printed: {0}")]
    Refused(String),
    /// The simulated printer.
    #[error("the simulated printer did not print the job: {0}")]
    Simulate(#[from] SimulateError),
    /// The simulated sheet.
    #[error(transparent)]
    Printout(#[from] PrintoutError),
    /// The simulated sheet is another one. Never seen; if it is, it is a bug worth a report.
    #[error("the simulated sheet is not the one that was sent: {0}")]
    Different(Difference),
}

/// Prints a document on the simulated printer.
pub fn print(
    document: &Document,
    library: &Library,
    settings: &Settings,
    observer: &dyn Observer,
) -> Result<Print, PrintError> {
    let materials = document.materials();
    // Refused before the long work, not after it.
    let pixels = (materials.width(), materials.height());
    let (width, height) = placement::dots(pixels, document.size_mm, settings.size, &settings.layout)?;
    layout::check(width.into(), height.into(), &settings.layout)?;
    let (factored, factoring) = factor_document(document, &settings.factor, observer)?;
    if let Some(report) = &factoring {
        observer.note(&report.to_string());
    }
    let printable = Printable::from_library(library, &settings.inks, &factored.space);
    let mapped = gamut::map(&factored, Some(materials), &printable, &settings.gamut, observer)?;
    let alone = Placement { paper: Paper::Custom { width, length: height }, x: 0, y: 0, width, height };
    let halftoned = halftone_mix(&mapped.mix, library, &alone, settings.halftone, observer)?;
    let Arranged { sheet, laid } =
        layout::arrange(&Piece::from(halftoned.clone()), &settings.layout, observer)?;
    let separation = separate_page(&sheet, &laid, library, observer)?;
    if let Some(check) = separation.checks.iter().find(|check| check.severity == Severity::Error) {
        return Err(PrintError::Refused(check.with_stacks()));
    }
    let page = Page {
        media: settings.media,
        curl_correction: settings.curl_correction,
        ..Page::plain(settings.layout.paper)
    };
    let job = job_on(page, &separation.passes, &settings.inks, observer)?;
    let printout = simulate::print(&job, &simulate::Setup::default(), observer)?;
    let printed = printout.sheet_with(sheet.stacks())?;
    if let Some(difference) = simulate::difference(&sheet, &printed) {
        return Err(PrintError::Different(difference));
    }
    // Sides of a sheet are u16, and the layout has refused a page without a piece.
    let [x, y, width, height] =
        laid.pieces.first().map_or([0; 4], |p| [p.left, p.top, p.width, p.length].map(|dots| dots as u16));
    let placement = Placement { paper: settings.layout.paper, x, y, width, height };
    Ok(Print {
        factored,
        factoring,
        mapped,
        halftoned,
        placement,
        laid,
        sheet,
        separation,
        job,
        printout,
        printed,
    })
}

/// A document's bases and maps: its own if it came factored.
pub fn factor_document(
    document: &Document,
    settings: &factor::Settings,
    observer: &dyn Observer,
) -> Result<(Factored, Option<factor::Report>), FactorError> {
    if let Some(factored) = document.as_factored() {
        return Ok((factored.clone(), None));
    }
    let factoring = factor::factor(document.materials(), settings, observer)?;
    Ok((factoring.factored, Some(factoring.report)))
}

/// Halftones a mix with the library's minimum clusters.
pub fn halftone_mix(
    mix: &InkMix,
    library: &Library,
    placement: &Placement,
    method: halftone::Method,
    observer: &dyn Observer,
) -> Result<Sheet, HalftoneError> {
    let minimum = mix.stacks.iter().map(|stack| library.minimum_cluster(stack)).collect();
    let points = if method == halftone::Method::Best {
        let space = Space::half_angle(32);
        Tangent::of_mix(mix, &space, &reflectances(&mix.stacks, library, &space)).leading()
    } else {
        Vec::new()
    };
    halftone::halftone(mix, placement, &halftone::Settings { method, minimum, points }, observer)
}

/// The passes of a page. What the rules say is about its pieces: marks are cut off.
pub fn separate_page(
    sheet: &Sheet,
    laid: &Laid,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Separation, SeparateError> {
    let mut separation = separate::separate(sheet, library.rules(), observer)?;
    let census = laid.census(sheet);
    separation.spare_marks(|stack| {
        sheet.stacks().iter().zip(census).any(|(known, dots)| known == stack && dots > 0)
    });
    Ok(separation)
}

/// The bytes of a job on this page. A foil among `inks` is the user's consent to print it.
pub fn job_on(
    page: Page,
    passes: &[Pass],
    inks: &InkSet,
    observer: &dyn Observer,
) -> Result<Vec<u8>, StreamError> {
    let foil = inks.iter().any(|ink| ink.kind() == Kind::Foil).then(FoilConsent::given_by_the_user);
    let mut job = Vec::new();
    stream::write_job(page, foil, passes, &mut job, observer)?;
    Ok(job)
}

/// What the stacks of a sheet reflect, one row a stack, as the library has it.
///
/// A stack the library does not know shows as its longest part from the top that it does know: the uppermost
/// layers decide most of what is seen.
pub fn stack_table(sheet: &Sheet, library: &Library, space: &Space) -> Table {
    reflectances(sheet.stacks(), library, space)
}

fn reflectances(stacks: &[inks::Stack], library: &Library, space: &Space) -> Table {
    let mut table = Table::new(space.columns());
    for stack in stacks {
        let layers = stack.layers();
        let known = (0..=layers.len()).find_map(|below| library.entry(&inks::Stack::new(&layers[below..])));
        let row = known.map(|entry| space.row(&entry.curve_at(space.angles())));
        table.push(&row.unwrap_or_else(|| vec![0.0; space.columns()]));
    }
    table
}
