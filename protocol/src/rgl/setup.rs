//! What a job may be, before its first byte.
//!
//! [`JobSetup::new`] refuses what must never be sent: inks other than cyan, magenta, yellow and black at a resolution
//! other than 600 dpi, foils without consent, more than seven cartridges, a page larger than the printer takes. A value
//! of this type is the proof.
//!
//! What is refused and why: `docs/rgl.md`, section "What is never sent"; the choice of mode: section "Transfer modes".

use super::command::{Cartridges, MAX_CARTRIDGES, Media, Mode, Resolution};
use super::fault::Fault;
use super::order::MAX_PASSES;
use crate::ink::{Ink, Kind};
use crate::paper::{LARGEST, Paper};
use heapless::Vec;

/// The user's explicit choice to use foil. Its ink codes are inferred, no stream of the vendor's driver confirms them,
/// and foil needs cyan, magenta, yellow and black beneath it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FoilConsent(());

impl FoilConsent {
    /// Call this only where the user has agreed.
    pub fn given_by_the_user() -> FoilConsent {
        FoilConsent(())
    }
}

/// The sheet and how it is printed, independent of the inks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Page {
    /// The paper.
    pub paper: Paper,
    /// What it is made of.
    pub media: Media,
    /// Dots per inch.
    pub resolution: Resolution,
    /// Whether the printer corrects curl: on for paper, off for decal film.
    pub curl_correction: bool,
    /// Shift to the right in 1/600 inch.
    pub shift_x: u16,
    /// Shift downwards in 1/600 inch.
    pub shift_y: u16,
}

impl Page {
    /// Plain paper at 600 dpi, curl corrected, not shifted.
    pub fn plain(paper: Paper) -> Page {
        Page {
            paper,
            media: Media::Plain,
            resolution: Resolution::Dpi600,
            curl_correction: true,
            shift_x: 0,
            shift_y: 0,
        }
    }

    /// Dots across the printable area at the page's resolution.
    pub fn width(&self) -> u16 {
        self.resolution.across(self.paper.width())
    }

    /// Rows of the printable area at the page's resolution.
    pub fn length(&self) -> u16 {
        self.resolution.along(self.paper.length())
    }
}

/// A page and its passes, proved to be sendable.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct JobSetup {
    page: Page,
    mode: Mode,
    cartridges: Option<Cartridges>,
    passes: Vec<Ink, MAX_PASSES, u8>,
}

impl JobSetup {
    /// A job of these passes, in printing order. With up to four cartridges the mode is colourPlane; with five to seven it
    /// is multiPlane with a list. That has an entry for each pass, repeats kept, as the driver's has; if there are more passes than
    /// entries, one for each cartridge in the order of first use.
    ///
    /// Errors: [`Fault::NoPasses`], [`Fault::TooManyPasses`], [`Fault::TooManyCartridges`], [`Fault::SpotResolution`],
    /// [`Fault::FoilWithoutConsent`], [`Fault::PageSize`].
    pub fn new(page: Page, passes: &[Ink], foil: Option<FoilConsent>) -> Result<JobSetup, Fault> {
        if passes.is_empty() {
            return Err(Fault::NoPasses);
        }
        let passes = Vec::from_slice(passes).map_err(|_| Fault::TooManyPasses)?;
        check_page(&page)?;
        if page.resolution != Resolution::Dpi600 && passes.iter().any(|ink| ink.kind() != Kind::Process) {
            return Err(Fault::SpotResolution);
        }
        if foil.is_none() && passes.iter().any(|ink| ink.kind() == Kind::Foil) {
            return Err(Fault::FoilWithoutConsent);
        }
        let mut cartridges = Vec::<Ink, MAX_CARTRIDGES, u8>::new();
        for ink in &passes {
            if !cartridges.contains(ink) {
                cartridges.push(*ink).map_err(|_| Fault::TooManyCartridges)?;
            }
        }
        let (mode, cartridges) = match cartridges.len() {
            0..=4 => (Mode::ColourPlane, None),
            _ => (Mode::MultiPlane, Cartridges::new(&passes).or_else(|| Cartridges::new(&cartridges))),
        };
        Ok(JobSetup { page, mode, cartridges, passes })
    }

    /// A job of one plane of black in the mode made for that.
    ///
    /// Errors: [`Fault::PageSize`].
    pub fn black_raster(page: Page) -> Result<JobSetup, Fault> {
        check_page(&page)?;
        Ok(JobSetup { page, mode: Mode::BlackRaster, cartridges: None, passes: Vec::from_iter([Ink::Black]) })
    }

    /// The page.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// The inks of the passes, first printed first.
    pub fn passes(&self) -> &[Ink] {
        &self.passes
    }

    /// The cartridge list, in the mode that has one.
    pub fn cartridges(&self) -> Option<Cartridges> {
        self.cartridges
    }

    /// The transfer mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }
}

fn check_page(page: &Page) -> Result<(), Fault> {
    let (width, length) = (page.paper.width(), page.paper.length());
    if page.width() == 0 || page.length() == 0 || width > LARGEST.0 || length > LARGEST.1 {
        return Err(Fault::PageSize);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_must_never_be_sent_is_no_job() {
        let plain = Page::plain(Paper::A4);
        let fine = Page { resolution: Resolution::Dpi1200, ..plain };
        let why = |page, inks: &[Ink], foil| JobSetup::new(page, inks, foil).unwrap_err();
        for ink in Ink::ALL.into_iter().filter(|ink| ink.kind() != Kind::Process) {
            assert_eq!(
                why(fine, &[Ink::Cyan, ink], Some(FoilConsent::given_by_the_user())),
                Fault::SpotResolution
            );
        }
        for foil in [Ink::GoldFoil, Ink::SilverFoil] {
            assert_eq!(why(plain, &[foil], None), Fault::FoilWithoutConsent);
            assert!(JobSetup::new(plain, &[foil], Some(FoilConsent::given_by_the_user())).is_ok());
        }
        assert_eq!(why(plain, &[], None), Fault::NoPasses);
        assert_eq!(why(plain, &Ink::ALL[..8], None), Fault::TooManyCartridges);
        assert_eq!(why(plain, &[Ink::Black; 33], None), Fault::TooManyPasses);
        let custom = |width, length| Page::plain(Paper::Custom { width, length });
        for page in
            [custom(0, 100), custom(100, 0), custom(4941, 100), custom(100, 7761), custom(65535, 65535)]
        {
            assert_eq!(why(page, &[Ink::Black], None), Fault::PageSize);
        }
    }
}
