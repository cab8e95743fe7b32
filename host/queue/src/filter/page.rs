//! From the art of a page to a job: inks as the user chose them, the place on the sheet, passes, bytes.

use std::io::Write;
use std::path::Path;

use inks::Library;
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;

use super::{FilterError, io_error};
use crate::ppd;
use art::{Artwork, Room, Window};
use make::options::{Choices, Place, is_chosen};
use make::{Layers, layers};
use observe::Observer;
use press::layout::{Cut, Layout, LayoutError, Mm, Point, Position};
use press::pipeline::JobError;
use press::separate::CARTRIDGES;

/// What makes jobs of pages.
pub(super) struct Press<'a> {
    pub choices: &'a Choices,
    pub library: &'a Library,
    pub out: &'a mut dyn Write,
    pub observer: &'a dyn Observer,
    /// Pages seen.
    pub pages: usize,
    /// Jobs written.
    pub jobs: usize,
    /// Pages on which something is white.
    pub white: usize,
    /// The first page on which everything lies on the margins, and how far.
    pub in_margins: Option<(usize, Cut)>,
}

impl Press<'_> {
    /// Writes a job; one of no bytes is none.
    pub(super) fn write(&mut self, job: &[u8]) -> Result<(), FilterError> {
        if !job.is_empty() {
            self.out.write_all(job).map_err(io_error("write the job"))?;
            self.jobs += 1;
        }
        Ok(())
    }

    /// Notes that no page of the document has the reserved white that was asked for.
    pub(super) fn without_white(&self) {
        if self.choices.white == art::White::Reserved && self.jobs > 0 && self.white == 0 {
            self.observer.note(
                "FoilpressWhite=Reserved: no page has the reserved white, so none is printed; draw what is to be white in \
                 exactly 230,230,230 without shading or smooth edges, or choose another FoilpressWhite",
            );
        }
    }

    /// How a page is read, drawn at so many pixels an inch.
    pub(super) fn options(&self, dpi: u16) -> art::Options {
        let settings = layers::Settings::of(self.choices, self.choices.paper, self.library);
        art::Options { dpi: Some(dpi.into()), ..settings.reading() }
    }

    /// Where a page is printed. `drawn` is the window around everything on it, none if it is blank. Notes why nothing is
    /// printed.
    ///
    /// # Errors
    /// A layout that does not hold.
    pub(super) fn view(
        &mut self,
        number: usize,
        paper: Paper,
        (size, dpi): ((usize, usize), u16),
        drawn: Option<Window>,
        mirrored: bool,
    ) -> Result<Option<View>, FilterError> {
        self.pages = number;
        if !is_chosen(&self.choices.pages, number) {
            return Ok(None);
        }
        let Some(drawn) = drawn else {
            self.observer.note(&format!("page {number} is blank; the page is skipped"));
            return Ok(None);
        };
        let in_layout = |error: LayoutError| FilterError::Job { page: number, source: error.into() };
        let layout = self.settings(paper, mirrored).page.layout;
        match View::of(self.choices.place, &layout, (size, dpi), drawn).map_err(in_layout)? {
            Ok(view) => Ok(Some(view)),
            Err(beyond) => {
                self.observer.note(&format!(
                    "everything on page {number} lies on the margins, where the printer cannot print ({beyond}); the page is \
                     skipped"
                ));
                self.in_margins.get_or_insert((number, beyond));
                Ok(None)
            }
        }
    }

    /// How a page is printed, in the middle of its paper.
    fn settings(&self, paper: Paper, mirror: bool) -> layers::Settings {
        let mut settings = layers::Settings::of(self.choices, paper, self.library);
        settings.page.layout.mirror = mirror;
        settings
    }

    /// The job of a picture that has no page of its own: in the middle of the sheet, as large as it says or as fits.
    pub(super) fn picture(&mut self, path: &Path) -> Result<Vec<u8>, FilterError> {
        self.pages = 1;
        if !is_chosen(&self.choices.pages, 1) {
            return Ok(Vec::new());
        }
        let layout = Layout { cut: true, ..Layout::centred(self.choices.paper) };
        let (width, length) = layout.largest();
        let room = Room { width, length, cut: true };
        let options = art::Options { dpi: None, room, ..self.options(self.choices.dpi) };
        let art = art::open(&[path.to_path_buf()], &options, self.observer)
            .map_err(|source| FilterError::Layers { page: 1, source: source.calling_it("this document") })?;
        let position = match self.choices.place {
            Place::At(corner) => Position::FromEdge(corner),
            Place::Page | Place::Centre => Position::Centred,
        };
        let laid = self.settings(self.choices.paper, self.choices.mirror).page.layout;
        let layout = Layout { position, ..laid };
        let placed = layout.placed((art.width, art.length));
        let (_, beyond) = placed.map_err(|error| FilterError::Job { page: 1, source: error.into() })?;
        let view = View { position, beyond };
        self.job(1, self.choices.paper, &art, &view, self.choices.mirror)
    }

    /// The job of a page's art. `mirrored` turns it left to right.
    pub(super) fn job(
        &mut self,
        number: usize,
        paper: Paper,
        art: &Artwork,
        view: &View,
        mirrored: bool,
    ) -> Result<Vec<u8>, FilterError> {
        let mut settings = self.settings(paper, mirrored);
        settings.page.layout.position = view.position;
        let foil = art.layers.iter().map(|layer| layer.ink).find(|ink| ink.kind() == Kind::Foil);
        if let Some(ink) = foil.filter(|&ink| !settings.compose.inks.contains(ink)) {
            return Err(FilterError::Foil { page: number, ink });
        }
        if art.layers.iter().any(|layer| layer.ink == Ink::White) {
            self.white += 1;
        } else if self.choices.white == art::White::Reserved {
            self.observer.note(&format!(
                "page {number}: nothing has the reserved white 230,230,230; no white is printed"
            ));
        }
        let layers = Layers::compose(art, &settings, self.observer)
            .map_err(|source| FilterError::Layers { page: number, source })?;
        for suggestion in &layers.composed.suggestions {
            self.observer.note(&format!("page {number}: {}", suggestion.text));
        }
        let job = layers.job(self.observer).map_err(|error| unprintable(number, error))?;
        if let Some(cut) = view.beyond {
            self.observer
                .note(&format!("page {number}: {cut} lies on the margins, where the printer cannot print"));
        }
        Ok(job.bytes)
    }
}

/// Why a page cannot be printed. Which options leave inks out is said where there are too many.
fn unprintable(page: usize, error: JobError) -> FilterError {
    match error {
        JobError::Refused { rule, text } if rule == CARTRIDGES => FilterError::Cartridges { page, text },
        source => FilterError::Job { page, source },
    }
}

/// The paper of a page of so many pixels.
pub(super) fn paper(
    page: usize,
    (width, height): (usize, usize),
    dpi: u16,
    choices: &Choices,
) -> Result<Paper, FilterError> {
    let mm = |pixels: usize| pixels as f64 * 25.4 / f64::from(dpi);
    ppd::paper_of(mm(width), mm(height), choices.custom_paper).map_err(|problem| FilterError::Paper {
        page,
        width: mm(width),
        length: mm(height),
        problem,
    })
}

/// Where a page is printed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct View {
    position: Position,
    /// What of its art is left out on the margins.
    beyond: Option<Cut>,
}

impl View {
    /// Where the whole page lies if what is drawn on it lies at its place. `layout` is of its paper.
    ///
    /// # Errors
    /// A layout that does not hold; in it, how far everything lies beyond what can be printed.
    fn of(
        place: Place,
        layout: &Layout,
        (size, dpi): ((usize, usize), u16),
        drawn: Window,
    ) -> Result<Result<View, Cut>, LayoutError> {
        let dots = |pixels: usize| pixels * 600 / usize::from(dpi);
        let mm = |dots: usize| Mm::of_dots(dots as i64);
        // A mirrored page is turned about its middle.
        let left = match layout.mirror {
            true => size.0.saturating_sub(drawn.left + drawn.width),
            false => drawn.left,
        };
        let (left, top) = (dots(left), dots(drawn.top));
        let position = match place {
            Place::Page => Position::FromEdge(Point(mm(left), mm(top))),
            Place::Centre => Position::Centred,
            Place::At(corner) => Position::FromEdge(corner),
        };
        let (width, length) = (dots(drawn.width), dots(drawn.height));
        let ((x, y), beyond) = Layout { position, ..layout.clone() }.placed((width, length))?;
        let corner = Point(Mm::of_dots(x - left as i64), Mm::of_dots(y - top as i64));
        Ok(match beyond {
            Some(cut)
                if cut.left.max(cut.right) >= mm(width).0 || cut.top.max(cut.bottom) >= mm(length).0 =>
            {
                Err(cut)
            }
            beyond => Ok(View { position: Position::FromPrintable(corner), beyond }),
        })
    }
}
