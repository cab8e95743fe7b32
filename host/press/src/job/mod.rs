//! The plan of a job in words, in figures and as a page, and the bytes of a job.

pub mod cost;
pub(crate) mod fault;
mod loading;
pub mod page;
pub mod plan;
pub mod ribbon;
pub mod stream;
mod thin;

use protocol::paper::Paper;
use protocol::rgl::{Media, Page};

/// How the printer is told to treat the sheet.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Handling {
    /// The printer's media type, which sets its heat.
    pub media: Media,
    /// Whether the printer corrects the sheet's curl.
    pub curl_correction: bool,
}

impl Handling {
    /// Whether the sheet is film, through which the ground is seen: a transparency, or what is printed
    /// without curl correction as decal film is.
    #[must_use]
    pub fn is_film(self) -> bool {
        match self.media {
            Media::Plain => !self.curl_correction,
            Media::Transparency
            | Media::TransparencyTwice
            | Media::SpecialTransparency
            | Media::SpecialTransparencyTwice
            | Media::BackPrintFilm
            | Media::BackPrintFilmTwice => true,
            _ => false,
        }
    }

    /// A page of this paper in the printer's language.
    pub(crate) fn page(self, paper: Paper) -> Page {
        Page { media: self.media, curl_correction: self.curl_correction, ..Page::plain(paper) }
    }
}
