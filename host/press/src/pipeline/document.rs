//! From a document to its dots: bases and weight maps, the mixture of stacks, the halftone.
//!
//! Nothing is decided here that a stage does not decide; this is only their order, and the values between them, kept
//! for those who want to look.

use inks::{InkSet, Library};

use crate::halftone::{self, HalftoneError, halftone};
use crate::layout::{self, Layout, LayoutError, Size, SizeError, size};
use crate::sheet::DotMap;
use appearance::document::Document;
use appearance::factor::{self, FactorError, Factored};
use appearance::gamut::{self, GamutError, Mapped, Printable};
use appearance::materials::{Materials, Reduced, resolution};
use appearance::weights::WeightError;
use observe::Observer;

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the document is factored.
    pub factor: factor::Settings,
    /// How it is mapped to the printer's gamut.
    pub gamut: gamut::Settings,
    /// The inks at hand.
    pub inks: InkSet,
    /// How dots are chosen.
    pub halftone: halftone::Method,
    /// Size on paper.
    pub size: Option<Size>,
}

/// A document as dots, and what it went through.
pub struct Halftoned {
    /// The document in bases and weight maps.
    pub factored: Factored,
    /// What the factoring reports; absent when the document came factored.
    pub factoring: Option<factor::Report>,
    /// The mixture of stacks, and what the mapping reports.
    pub mapped: Mapped,
    /// The dots.
    pub dots: DotMap,
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

/// Halftones a document at the size it will have on a page of this layout. Detail finer than a cluster of dots is averaged
/// before anything is fitted to it.
///
/// # Errors
/// Those of the stages; a size or a layout without room is refused before the long work.
pub fn halftoned(
    document: &Document,
    library: &Library,
    settings: &Settings,
    layout: &Layout,
    observer: &dyn Observer,
) -> Result<Halftoned, StageError> {
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
    let reduced = cells.map(|cells| Reduced::new(materials, cells));
    let materials: &dyn Materials = reduced.as_ref().map_or(materials, |reduced| reduced);
    let (factored, factoring) = match (document.as_factored(), cells) {
        (Some(factored), Some(cells)) => (factored.reduced(cells)?, None),
        (Some(factored), None) => (factored.clone(), None),
        (None, _) => {
            let factoring = factor::factor(materials, &settings.factor, observer)?;
            (factoring.factored, Some(factoring.report))
        }
    };
    if let Some(report) = &factoring {
        observer.note(&report.to_string());
    }
    let printable = Printable::from_library(library, &settings.inks, &factored.space);
    let mapped = gamut::map(&factored, Some(materials), &printable, &settings.gamut, observer)?;
    let chosen = halftone::Settings {
        method: settings.halftone,
        ..halftone::Settings::from_library(&mapped.mix.stacks, library)
    };
    let dots = halftone(&mapped.mix, (width, height), None, &chosen, observer)?;
    Ok(Halftoned { factored, factoring, mapped, dots })
}

/// The resolution that a print of so many dots has for a document of so many pixels, if it is less than the document's: a
/// pixel for each cell of the smallest clusters.
fn cells(
    (width, height): (u16, u16),
    pixels: (usize, usize),
    library: &Library,
    settings: &Settings,
) -> Option<(usize, usize)> {
    let entries = library.at_hand(&settings.inks);
    let least = entries.into_iter().map(|entry| library.minimum_cluster(&entry.stack)).min().unwrap_or(1);
    let side = match settings.halftone {
        halftone::Method::Blue => 1,
        _ => (1..).find(|side| side * side >= usize::from(least)).unwrap_or(1),
    };
    resolution(pixels, (usize::from(width).div_ceil(side), usize::from(height).div_ceil(side)))
}

/// A document's bases and maps: its own if it came factored.
///
/// # Errors
/// Those of the factoring.
pub fn factored(
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
