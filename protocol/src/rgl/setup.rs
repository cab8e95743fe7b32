//! What a job may be, before its first byte.
//!
//! [`JobSetup::new`] is where what must never be sent is refused: inks other than cyan, magenta, yellow and black at
//! another resolution than 600 dpi, foils without consent, more than seven cassettes, a page larger than the machine
//! takes. A value of this type is the proof.
//!
//! What is refused and why: `docs/rgl.md`, section "What is never sent"; the choice of mode: section "Transfer modes".

use super::command::{Cassettes, MAX_CASSETTES, Media, Mode, Resolution};
use super::fault::Fault;
use super::order::MAX_PASSES;
use crate::ink::{Ink, Kind};
use crate::paper::{LARGEST, Paper};

/// The user's explicit choice to use foil: its ink codes are inferred, no stream of the vendor's confirms them, and
/// foil needs cyan, magenta, yellow and black beneath it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FoilConsent(());

impl FoilConsent {
    /// To be called only where the user has said so.
    pub fn given_by_the_user() -> FoilConsent {
        FoilConsent(())
    }
}

/// The sheet and how it is printed, whatever the inks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Page {
    /// The paper.
    pub paper: Paper,
    /// What it is made of.
    pub media: Media,
    /// Dots per inch.
    pub resolution: Resolution,
    /// Whether the machine corrects curl: on for paper, off for decal film.
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
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct JobSetup {
    page: Page,
    mode: Mode,
    cassettes: Option<Cassettes>,
    inks: [Ink; MAX_PASSES],
    passes: u8,
}

impl JobSetup {
    /// A job of these passes, first printed first. Up to four cassettes the mode is colourPlane, from five to seven
    /// multiPlane with a list of them in the order of first use; an ink in several passes counts once.
    ///
    /// Errors: [`Fault::NoPasses`], [`Fault::TooManyPasses`], [`Fault::TooManyCassettes`], [`Fault::SpotResolution`],
    /// [`Fault::FoilWithoutConsent`], [`Fault::PageSize`].
    pub fn new(page: Page, passes: &[Ink], foil: Option<FoilConsent>) -> Result<JobSetup, Fault> {
        if passes.is_empty() {
            return Err(Fault::NoPasses);
        }
        if passes.len() > MAX_PASSES {
            return Err(Fault::TooManyPasses);
        }
        check_page(&page)?;
        if page.resolution != Resolution::Dpi600 && passes.iter().any(|ink| ink.kind() != Kind::Process) {
            return Err(Fault::SpotResolution);
        }
        if foil.is_none() && passes.iter().any(|ink| ink.kind() == Kind::Foil) {
            return Err(Fault::FoilWithoutConsent);
        }
        let mut cassettes = [passes[0]; MAX_CASSETTES];
        let mut count = 0;
        for ink in passes {
            if !cassettes[..count].contains(ink) {
                *cassettes.get_mut(count).ok_or(Fault::TooManyCassettes)? = *ink;
                count += 1;
            }
        }
        let (mode, cassettes) = match count {
            0..=4 => (Mode::ColourPlane, None),
            _ => (Mode::MultiPlane, Cassettes::new(&cassettes[..count])),
        };
        let mut inks = [passes[0]; MAX_PASSES];
        inks[..passes.len()].copy_from_slice(passes);
        Ok(JobSetup { page, mode, cassettes, inks, passes: passes.len() as u8 })
    }

    /// A job of one plane of black in the mode made for that.
    ///
    /// Errors: [`Fault::PageSize`].
    pub fn black_raster(page: Page) -> Result<JobSetup, Fault> {
        check_page(&page)?;
        let inks = [Ink::Black; MAX_PASSES];
        Ok(JobSetup { page, mode: Mode::BlackRaster, cassettes: None, inks, passes: 1 })
    }

    /// The page.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// The inks of the passes, first printed first.
    pub fn passes(&self) -> &[Ink] {
        &self.inks[..usize::from(self.passes)]
    }

    /// The cassette list, in the mode that has one.
    pub fn cassettes(&self) -> Option<Cassettes> {
        self.cassettes
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
        assert_eq!(why(plain, &Ink::ALL[..8], None), Fault::TooManyCassettes);
        assert_eq!(why(plain, &[Ink::Black; 33], None), Fault::TooManyPasses);
        let custom = |width, length| Page::plain(Paper::Custom { width, length });
        for page in
            [custom(0, 100), custom(100, 0), custom(4941, 100), custom(100, 7761), custom(65535, 65535)]
        {
            assert_eq!(why(page, &[Ink::Black], None), Fault::PageSize);
        }
    }
}
