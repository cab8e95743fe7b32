//! From a document to its dots: bases and weight maps, the mixture of stacks, the halftone.
//!
//! Nothing is decided here that a stage does not decide; this is only their order, and the values between
//! them, kept for those who want to look.

use std::borrow::Cow;

use inks::{InkSet, Library};

use crate::layout::{self, Layout, LayoutError, SizeError, size};
use crate::preview::{EYE, spot_mm};
use appearance::document::{Document, Materials};
use appearance::factor::{self, FactorError, Factored};
use appearance::gamut::{self, DistanceUncertainty, Gain, GamutError, Mapped, Printable};
use appearance::materials::{Reduced, resolution};
use appearance::weights::WeightError;
use halftone::{HalftoneError, halftone};
use observe::Observer;
use protocol::ink::Kind;
use sheet::Size;
use sheet::{DOTS_PER_MM, DotMap};

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the document is factored.
    pub factor: factor::FactorSettings,
    /// How it is mapped to the printer's gamut.
    pub gamut: gamut::GamutSettings,
    /// The inks at hand.
    pub inks: InkSet,
    /// Inks that are held back until the owner names them, each kind by itself: what they would bring is
    /// found.
    pub held_back: InkSet,
    /// How dots are chosen.
    pub halftone: halftone::Method,
    /// Size on paper.
    pub size: Option<Size>,
}

/// A document as dots, and what it went through.
pub struct Halftoned {
    /// What the factoring reports; absent when the document came factored, or the intent uses no bases.
    pub factoring: Option<factor::FactorReport>,
    /// The mixture of stacks, and what the mapping reports.
    pub mapped: Mapped,
    /// The dots.
    pub dots: DotMap,
    /// What inks would bring that are held back, for each kind that would bring something.
    pub held_back: Vec<Gain>,
    /// How much of the distance between document and mixture lies within the measurement of the stacks, if
    /// one in use has standard deviations.
    pub doubt: Option<DistanceUncertainty>,
}

/// Why a document does not become dots: the error of the stage that refused.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// Its size on paper.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// Its place on the page.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Averaging weight maps. Never seen; if it is, it is a bug worth a report.
    #[error(transparent)]
    Weights(#[from] WeightError),
    /// Factoring.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// Gamut mapping.
    #[error(transparent)]
    Gamut(#[from] GamutError),
    /// Halftoning.
    #[error(transparent)]
    Halftone(#[from] HalftoneError),
}

/// Halftones a document at the size it will have on a page of this layout. Detail finer than a cluster of
/// dots is averaged before anything is fitted to it.
///
/// # Errors
/// Those of the stages; a size or a layout without room, and inks that the halftone cannot print,
/// are refused before the long work.
pub fn halftoned(
    document: &Document,
    library: &Library,
    settings: &Settings,
    layout: &Layout,
    observer: &dyn Observer,
) -> Result<Halftoned, StageError> {
    if matches!(settings.halftone, halftone::Method::Blue | halftone::Method::Fine) {
        let entries = library.at_hand(&settings.inks);
        halftone::check_single_dots(entries.into_iter().map(|entry| &entry.stack))?;
    }
    let materials = document.materials();
    let pixels = (materials.width(), materials.height());
    let (width, height) = size::dots(pixels, document.size_mm, settings.size, layout)?;
    layout::check(width.into(), height.into(), layout)?;
    let cells = cells((width, height), pixels, library, settings);
    if let Some((across, down)) = cells {
        observer.note(&format!(
            "the print shows {across} x {down} of the document's {} x {} pixels: materials are averaged over its clusters",
            pixels.0, pixels.1
        ));
    }
    let across_mm = f64::from(width) / DOTS_PER_MM / pixels.0 as f64;
    if across_mm > SOFT_MM && !is_one_material(materials) {
        observer.note(&format!(
            "a pixel of the document is {across_mm:.1} mm wide on paper, so borders between pixels will be about {across_mm:.0} mm \
             soft; enlarge the maps without smoothing to print them hard"
        ));
    }
    let reduced = cells.map(|cells| Reduced::new(materials, cells));
    let materials: &dyn Materials = reduced.as_ref().map_or(materials, |reduced| reduced);
    let printable = Printable::combined(library, &settings.inks, materials.space());
    let mut factoring = None;
    let bases = || match (document.as_factored(), cells) {
        (Some(factored), Some(cells)) => Ok(Cow::Owned(factored.reduced(cells)?)),
        (Some(factored), None) => Ok(Cow::Borrowed(factored)),
        (None, _) => {
            let factor::Factoring { factored, report } =
                factor::factor(materials, &settings.factor, observer)?;
            factoring = Some(report);
            Ok::<_, StageError>(Cow::Owned(factored))
        }
    };
    let mapping = gamut::GamutSettings {
        eye: spot(width, materials.width(), settings.halftone),
        hue: settings.gamut.hue && document.views.is_none(),
        ..settings.gamut.clone()
    };
    let mapped = gamut::map(materials, bases, &printable, &mapping, observer)?;
    // The automatic choice may have tried bases that it does not use.
    let factoring = factoring.filter(|_| mapped.report.intent.uses_bases());
    if let Some(report) = &factoring {
        observer.note(&report.to_string());
    }
    let chosen = halftone::Settings {
        method: settings.halftone,
        ..halftone::Settings::from_library(&mapped.mix.stacks, library)
    };
    let dots = halftone(&mapped.mix, (width, height), None, &chosen, observer)?;
    let mut held_back = Vec::new();
    for kind in [Kind::Primer, Kind::Foil] {
        let of_kind = InkSet::of(settings.held_back.iter().filter(|ink| ink.kind() == kind));
        if !of_kind.is_empty() {
            // Beside the cartridges chosen.
            let all = InkSet::of(mapped.report.cartridges.iter().copied().chain(of_kind.iter()));
            let more = Printable::combined(library, &all, materials.space());
            let judged = &mapped.judged;
            held_back.extend(gamut::gain(judged, &printable, &more, materials.space(), &mapping)?);
        }
    }
    let doubt = gamut::distance_uncertainty(materials, &mapped.mix, library, settings.gamut.seed);
    Ok(Halftoned { factoring, mapped, dots, held_back, doubt })
}

/// The width of a pixel on paper from which a border between two is plainly soft.
const SOFT_MM: f64 = 2.0;

/// Whether all pixels are equal. The document is coarse, so they are few.
fn is_one_material(materials: &dyn Materials) -> bool {
    let row = |pixel| {
        let mut row = vec![0f32; materials.space().columns()];
        materials.reflectance(pixel, &mut row);
        row
    };
    let first = row(0);
    (1..materials.width() * materials.height()).all(|pixel| row(pixel) == first)
}

/// Side in pixels of the spot that an eye averages over, if the dots are rearranged for the eye: then the
/// mixtures are, too.
fn spot(dots: u16, pixels: usize, method: halftone::Method) -> Option<f64> {
    let dots_per_pixel = f64::from(dots) / pixels as f64;
    (method == halftone::Method::Best).then(|| spot_mm(EYE) * DOTS_PER_MM / dots_per_pixel)
}

/// The resolution that a print of so many dots has for a document of so many pixels, if it is less than the
/// document's: a pixel for each cell of the smallest clusters.
fn cells(
    (width, height): (u16, u16),
    pixels: (usize, usize),
    library: &Library,
    settings: &Settings,
) -> Option<(usize, usize)> {
    let entries = library.at_hand(&settings.inks);
    let least = entries.into_iter().map(|entry| library.minimum_cluster(&entry.stack)).min().unwrap_or(1);
    let side = match settings.halftone {
        halftone::Method::Blue | halftone::Method::Fine => 1,
        _ => (1..).find(|side| side * side >= usize::from(least)).unwrap_or(1),
    };
    resolution(pixels, (usize::from(width).div_ceil(side), usize::from(height).div_ceil(side)))
}

/// A document's bases and maps: its own if it came factored.
///
/// # Errors
/// Those of the factoring.
pub fn factored<'a>(
    document: &'a Document,
    settings: &factor::FactorSettings,
    observer: &dyn Observer,
) -> Result<(Cow<'a, Factored>, Option<factor::FactorReport>), FactorError> {
    if let Some(factored) = document.as_factored() {
        return Ok((Cow::Borrowed(factored), None));
    }
    let factoring = factor::factor(document.materials(), settings, observer)?;
    Ok((Cow::Owned(factoring.factored), Some(factoring.report)))
}
