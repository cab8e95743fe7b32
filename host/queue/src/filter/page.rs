//! From the art of a page to a job: inks as the user chose them, the place on the sheet, passes, bytes.

use std::io::Write;
use std::path::Path;

use inks::{InkSet, Library};
use protocol::ink::{Ink, Kind};
use protocol::paper::{LEFT, Paper};

use super::{FilterError, io_error};
use crate::options::{Choices, Place, Spots};
use crate::ppd;
use art::{Artwork, Room, Window};
use observe::Observer;
use press::job::Handling;
use press::layout::{Cut, Layout, Mm, Point, Position};
use press::pipeline::{self, JobError, Request};
use press::separate::CARTRIDGES;

/// What makes jobs of pages.
pub(super) struct Press<'a> {
    pub choices: &'a Choices,
    pub library: &'a Library,
    pub out: &'a mut dyn Write,
    pub observer: &'a dyn Observer,
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

    /// What of a page is printed, and where. `drawn` is the window around everything on it, none if it is blank. Notes why
    /// nothing is printed.
    pub(super) fn view(
        &mut self,
        number: usize,
        paper: Paper,
        (size, dpi): ((usize, usize), u16),
        drawn: Option<Window>,
        mirrored: bool,
    ) -> Option<View> {
        let pages = &self.choices.pages;
        if !pages.is_empty() && !pages.iter().any(|range| range.contains(&number)) {
            return None;
        }
        let Some(drawn) = drawn else {
            self.observer.note(&format!("page {number} is blank; the page is skipped"));
            return None;
        };
        // A page is turned about its middle, not what is drawn on it.
        let whole = mirrored || self.choices.finish == art::Finish::All;
        match View::of(self.choices.place, paper, (size, dpi), drawn, whole) {
            Ok(view) => Some(view),
            Err(beyond) => {
                self.observer.note(&format!(
                    "everything on page {number} lies on the margins, where the printer cannot print ({beyond}); the page is \
                     skipped"
                ));
                self.in_margins.get_or_insert((number, beyond));
                None
            }
        }
    }

    /// The job of a picture that has no page of its own: in the middle of the sheet, as large as it says or as fits.
    pub(super) fn picture(&mut self, path: &Path) -> Result<Vec<u8>, FilterError> {
        let layout = Layout { cut: true, ..Layout::centred(self.choices.paper) };
        let (width, length) = layout.largest();
        let room = Room { width, length, cut: true };
        let options = art::Options { dpi: None, room, ..self.options(self.choices.dpi) };
        let art = art::open(&[path.to_path_buf()], &options, self.observer)
            .map_err(|source| FilterError::Layers { page: 1, source: source.calling_it("this document") })?;
        let view = View {
            window: Window { left: 0, top: 0, width: art.width, height: art.length },
            position: match self.choices.place {
                Place::At(corner) => Position::FromEdge(corner),
                Place::Page | Place::Centre => Position::Centred,
            },
            beyond: None,
        };
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
        let layout = Layout {
            position: view.position,
            mirror: mirrored,
            cut: true,
            profile: self.choices.profile,
            ..Layout::centred(paper)
        };
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
        // What a page has on its margins was left out before; what is moved there is cut off now.
        let moved = !matches!(self.choices.place, Place::Page);
        if let Some(cut) = view.beyond.or(job.draft.laid.cut.filter(|_| moved)) {
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

/// What of a page is printed, and where.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct View {
    /// The part of the page, in its pixels.
    pub window: Window,
    position: Position,
    /// What is left out on the margins.
    beyond: Option<Cut>,
}

impl View {
    /// `whole` asks for all that can be printed, also where nothing is drawn.
    ///
    /// # Errors
    /// How far everything lies beyond what can be printed.
    fn of(
        place: Place,
        paper: Paper,
        (size, dpi): ((usize, usize), u16),
        drawn: Window,
        whole: bool,
    ) -> Result<View, Cut> {
        let pixels = |dots: u16| usize::from(dots) * usize::from(dpi) / 600;
        let (across, down) = (pixels(paper.width()), pixels(paper.length()));
        let position = match place {
            Place::Page => {
                // A page that is a little smaller than its paper is paper there.
                let (left, top) = (pixels(LEFT), pixels(paper.top()));
                let (width, height) =
                    (across.min(size.0.saturating_sub(left)), down.min(size.1.saturating_sub(top)));
                let mm = |pixels: usize| pixels as f64 * 25.4 / f64::from(dpi);
                let beyond = Cut {
                    left: mm(left.saturating_sub(drawn.left)),
                    top: mm(top.saturating_sub(drawn.top)),
                    right: mm((drawn.left + drawn.width).saturating_sub(left + width)),
                    bottom: mm((drawn.top + drawn.height).saturating_sub(top + height)),
                };
                let room = Window { left, top, width, height };
                let Some(seen) = drawn.meet(&room) else { return Err(beyond) };
                // What is bare costs as much time as what is drawn.
                let window = if whole { room } else { seen };
                let dots = |pixels: usize| Mm::of_dots((pixels * 600 / usize::from(dpi)) as i64);
                return Ok(View {
                    window,
                    position: Position::FromPrintable(Point(
                        dots(window.left - left),
                        dots(window.top - top),
                    )),
                    beyond: (beyond != Cut::default()).then_some(beyond),
                });
            }
            Place::Centre => Position::Centred,
            Place::At(corner) => Position::FromEdge(corner),
        };
        // No more than the sheet holds can be halftoned.
        let window = Window { width: drawn.width.min(across), height: drawn.height.min(down), ..drawn };
        let over = |found: usize, most: usize| (found - most) as f64 * 25.4 / f64::from(dpi);
        let beyond = Cut {
            right: over(drawn.width, window.width),
            bottom: over(drawn.height, window.height),
            ..Cut::default()
        };
        Ok(View { window, position, beyond: (beyond != Cut::default()).then_some(beyond) })
    }
}
