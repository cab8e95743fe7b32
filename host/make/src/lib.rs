//! Foilpress for other programs: documents of materials and flat art to jobs for the printer.
//!
//! [`Print`] is a document and [`Layers`] is flat art on its way to a job. [`Print::of`] and [`Layers::of`]
//! go the whole way: settings in, [`Made`] out, which holds the job, its plan and notes, and draws pictures
//! and pages when they are asked for by name. Nothing is written or printed; progress goes to an
//! [`Observer`](observe::Observer). The crates of the stages are at hand here by their names.
//!
//! ```
//! use foilpress::{Print, appearance::document, observe::Silent, print::Settings};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A folder of texture maps, as `foilpress sample leaf` writes it, would do as well.
//! let leaf = document::open("sample:leaf", &document::Options::default(), &Silent)?;
//! let mut settings = Settings::default();
//! settings.dots.size = Some("30mm".parse()?);
//! let made = Print::of(leaf, &settings, &Silent)?;
//!
//! // Every job begins with the command that selects the printer's language.
//! assert_eq!(made.job.bytes[..4], *b"\x1b\x25\x80\x41");
//! let d = made.distance().expect("a document has one");
//! assert!(d < 0.05, "print and document differ obviously: d = {d}");
//! let first = &made.plan().passes[0];
//! let name = format!("preview-{:02}-{}.png", first.number, first.ink);
//! assert!(made.picture(&name, &Silent)?.starts_with(b"\x89PNG"));
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_wrap,
    reason = "counts of dots on one page are exact"
)]

pub use {appearance, art, halftone, inks, observe, press, protocol, sheet, view as relit};

pub mod choice;
mod error;
pub mod fitted;
pub mod layers;
pub mod made;
pub mod options;
mod outline;
pub mod print;
mod report;
pub mod shown;
pub mod view;

pub use error::Error;
pub use layers::Layers;
pub use made::Made;
pub use print::Print;

use ::inks::{InkSet, Library};
use ::press::job::Handling;
use ::press::job::cost::Price;
use ::press::layout::Layout;
use ::press::pipeline::Request;
use ::press::preview::inks::Ground;
use ::protocol::paper::Paper;
use ::protocol::rgl::Media;
use ::sheet::DotMap;

/// How dots lie on the paper, and what is shown of it.
#[derive(Clone, Debug)]
pub struct PageSettings {
    /// The paper and how the dots lie on it.
    pub layout: Layout,
    /// How the printer is told to treat the sheet.
    pub handling: Handling,
    /// Background of the pictures.
    pub ground: Ground,
    /// What cartridges cost, if that is known.
    pub prices: Vec<Price>,
}

impl Default for PageSettings {
    /// In the middle of plain A4.
    fn default() -> PageSettings {
        PageSettings {
            layout: Layout::centred(Paper::A4),
            handling: Handling { media: Media::Plain, curl_correction: true },
            ground: Ground::default(),
            prices: Vec::new(),
        }
    }
}

impl PageSettings {
    /// The job to make of dots of this name.
    #[must_use]
    pub fn request<'a>(
        &'a self,
        name: &'a str,
        dots: &'a DotMap,
        allowed: InkSet,
        library: &'a Library,
    ) -> Request<'a> {
        Request { name, dots, layout: &self.layout, handling: self.handling, allowed, library }
    }
}
