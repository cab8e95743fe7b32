//! From the art of a page to a job: inks as the user chose them, the place on the sheet, passes, bytes.

use std::io::Write;
use std::path::Path;

use inks::{InkSet, Library};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;

use super::{FilterError, io_error};
use crate::options::{Choices, Place, Spots, is_chosen};
use crate::ppd;
use art::{Artwork, Room, Window};
use observe::Observer;
use press::job::Handling;
use press::layout::{Cut, Layout, LayoutError, Mm, Point, Position};
use press::pipeline::{self, JobError, Request};
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
        let choices = self.choices;
        let mut reserved = InkSet::EMPTY;
        if choices.spots == Spots::Reserved {
            reserved = art::Options::default().inks;
        } else if choices.white == art::White::Reserved {
            reserved = reserved.with(Ink::White);
        }
        art::Options {
            dpi: Some(dpi.into()),
            reserved: !reserved.is_empty(),
            inks: reserved,
            colours: choices.inks_of.clone(),
            tolerance: choices.tolerance,
            ..art::Options::default()
        }
    }

    /// How its layers become stacks.
    fn settings(&self) -> art::Settings {
        let choices = self.choices;
        let spots = Ink::ALL.into_iter().filter(|ink| match ink.kind() {
            Kind::Process => choices.colours.contains(*ink),
            Kind::Foil => choices.foils && choices.more.inks.contains(*ink),
            _ => choices.more.inks.contains(*ink),
        });
        art::Settings {
            inks: InkSet::of(spots),
            // What the page itself draws in white or finish is printed whatever is chosen.
            // Its reserved white is a layer of it, see `options`.
            white: Some(choices.white)
                .filter(|white| !matches!(white, art::White::None | art::White::Reserved)),
            finish: Some(choices.finish).filter(|&finish| finish != art::Finish::None),
            intent: choices.intent,
            gamma: choices.gamma,
            halftone: choices.halftone,
            ..choices.more.clone()
        }
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
        let layout = self.layout(paper, mirrored);
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

    /// How a page is laid on its paper, in the middle of it.
    fn layout(&self, paper: Paper, mirror: bool) -> Layout {
        Layout { mirror, cut: true, profile: self.choices.profile, ..Layout::centred(paper) }
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
        let layout = Layout { position, ..self.layout(self.choices.paper, self.choices.mirror) };
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
        let settings = self.settings();
        let foil = art.layers.iter().map(|layer| layer.ink).find(|ink| ink.kind() == Kind::Foil);
        if let Some(ink) = foil.filter(|&ink| !settings.inks.contains(ink)) {
            return Err(FilterError::Foil { page: number, ink });
        }
        if art.layers.iter().any(|layer| layer.ink == Ink::White) {
            self.white += 1;
        } else if self.choices.white == art::White::Reserved {
            self.observer.note(&format!(
                "page {number}: nothing has the reserved white 230,230,230; no white is printed"
            ));
        }
        let composed = art::compose(art, &settings, self.library, self.observer)
            .map_err(|source| FilterError::Layers { page: number, source })?;
        for suggestion in &composed.suggestions {
            self.observer.note(&format!("page {number}: {}", suggestion.text));
        }
        let layout = Layout { position: view.position, ..self.layout(paper, mirrored) };
        let handling = Handling { media: self.choices.media, curl_correction: self.choices.curl_correction };
        let request = Request {
            name: &art.name,
            dots: &composed.dots,
            layout: &layout,
            handling,
            allowed: settings.inks,
            library: self.library,
        };
        let job = pipeline::job(&request, self.observer).map_err(|error| unprintable(number, error))?;
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
