//! From a page to a job: how it lies on its sheet, inks as the user chose them, passes, bytes.

use std::io::Write;
use std::path::Path;

use inks::Library;
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;

use super::{FilterError, Filtered, Lies, MOST_SHEETS, io_error};
use crate::ppd;
use art::pdf::Part;
use art::{Artwork, Window};
use make::fitted::{Fitted, FittedError};
use make::options::{Choices, Place, is_chosen};
use make::{Layers, layers};
use observe::{Diagnosis, Observer};
use press::layout::fit::{Edge, Fit, Scaling, Wish, fit};
use press::layout::paper::sheet_mm;
use press::layout::{Cut, Layout, LayoutError, Mm, Point, Position};
use press::pipeline::JobError;
use press::separate::CARTRIDGES;

/// What makes jobs of pages.
pub(super) struct Press<'a> {
    pub choices: &'a Choices,
    library: &'a Library,
    pub out: &'a mut dyn Write,
    pub observer: &'a dyn Observer,
    /// Pages seen.
    pub pages: usize,
    /// Jobs written.
    pub jobs: usize,
    /// Pages on which something is white.
    white: usize,
    /// The first page on which everything lies on the margins, and how far.
    pub in_margins: Option<(usize, Cut)>,
    /// How pages lie: in words, the first of them, and how many there are.
    said: Vec<(String, usize, usize)>,
    is_cut: bool,
    /// Where the first page lies that is printed.
    lies: Option<Lies>,
}

/// What a page is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Of {
    /// That of a document, as it was written.
    Document,
    /// A picture of one, which was drawn for the sheet.
    Raster,
}

/// How a page is laid on its sheet.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Laid {
    paper: Paper,
    pub fit: Fit,
    /// Where what is drawn on it goes then.
    place: Place,
}

/// A picture of a page: its pixels across and down, how many of them are printed in an inch, and the window
/// around everything that is drawn on it, none if it is blank.
pub(super) type Drawn = ((usize, usize), f64, Option<Window>);

impl<'a> Press<'a> {
    pub fn new(
        (choices, library): (&'a Choices, &'a Library),
        out: &'a mut dyn Write,
        observer: &'a dyn Observer,
    ) -> Press<'a> {
        Press {
            choices,
            library,
            out,
            observer,
            pages: 0,
            jobs: 0,
            white: 0,
            in_margins: None,
            said: Vec::new(),
            is_cut: false,
            lies: None,
        }
    }

    /// What became of the pages.
    pub fn filtered(&self) -> Filtered {
        let words = |(words, first, count): &(String, usize, usize)| match count {
            1 => format!("page {first}: {words}"),
            _ => format!("page {first} and {} more: {words}", count - 1),
        };
        Filtered {
            jobs: self.jobs,
            laid: self.said.iter().map(words).collect(),
            is_cut: self.is_cut,
            lies: self.lies,
        }
    }

    /// Says how a page lies, once for all pages of which it is true.
    fn say(&mut self, number: usize, words: String) {
        match self.said.iter_mut().find(|(known, ..)| *known == words) {
            Some((.., count)) => *count += 1,
            None => {
                self.observer.note(&format!("page {number}: {words}"));
                self.said.push((words, number, 1));
            }
        }
    }

    /// Counts a page, from 1. Whether it is among those to print.
    pub fn wants(&mut self, number: usize) -> bool {
        self.pages = number;
        is_chosen(&self.choices.pages, number)
    }

    /// The part of a page in PDF that is printed: what is meant to be seen of it, or all of it where its size is the
    /// sheet's.
    pub fn part(&self) -> Part {
        if self.choices.fit.is_some() { Part::CropBox } else { Part::Sheet }
    }

    /// How a page of this width and length in millimetres is laid.
    ///
    /// # Errors
    /// There is no such sheet, or the page cannot be laid on the one that is given.
    pub fn laid(&self, page: usize, size: (f64, f64), of: Of) -> Result<Laid, FilterError> {
        let Choices { paper, place, fit: wish, custom_paper, .. } = *self.choices;
        let Some(wish) = wish else {
            let (width, length) = size;
            let paper = ppd::paper_of(width, length, custom_paper);
            let paper = paper.map_err(|problem| FilterError::Paper { page, width, length, problem })?;
            return Ok(Laid { paper, fit: Fit::AS_IT_COMES, place });
        };
        let wish = match (of, wish) {
            (Of::Document, wish) => wish,
            // Whoever has drawn it has turned and scaled it, too.
            (Of::Raster, Wish { scaling: scaling @ (Scaling::None | Scaling::Wide(_)), corner, .. }) => {
                Wish { scaling, corner, ..Wish::default() }
            }
            (Of::Raster, Wish { corner, .. }) => Wish { corner, ..Wish::default() },
        };
        let fit = fit(size, Edge::Margin, paper, &self.placed(wish))
            .map_err(|source| FilterError::Fit { page, source })?;
        // Whoever asks for a width, or for a sheet that is covered, may not know how long the page gets.
        let (width, length) = (fit.scale * size.0, fit.scale * size.1);
        let sheet = sheet_mm(paper);
        if fit.scale > 1.0 && width * length > MOST_SHEETS * sheet.0 * sheet.1 {
            return Err(FilterError::Large { page, width, length });
        }
        Ok(Laid { paper, fit, place: Place::Page })
    }

    /// A wish with the place that was chosen.
    fn placed(&self, wish: Wish) -> Wish {
        let corner = if let Place::At(corner) = self.choices.place { Some(corner) } else { wish.corner };
        Wish { corner, ..wish }
    }

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

    /// How a page is read.
    fn options(&self) -> art::Options {
        let settings = layers::Settings::of(self.choices, self.choices.paper, self.library);
        art::Options { dpi: Some(self.choices.dpi.into()), ..settings.reading() }
    }

    /// The job of a page; empty if nothing is on it, with a note. `mirrored` turns it left to right.
    ///
    /// # Errors
    /// Art that cannot be printed, a layout that does not hold.
    pub fn page(
        &mut self,
        number: usize,
        laid: &Laid,
        (size, dpi, drawn): Drawn,
        mirrored: bool,
        art: impl FnOnce(&str, &art::Options) -> Result<Artwork, Diagnosis>,
    ) -> Result<Vec<u8>, FilterError> {
        let Some(drawn) = drawn else {
            self.observer.note(&format!("page {number} is blank; the page is skipped"));
            return Ok(Vec::new());
        };
        let turn = laid.fit.turn;
        let drawn = drawn.turned(size, turn);
        let lying = (turn.sides(size), dpi, drawn);
        let Some(corner) = self.corner(number, laid, lying, &laid.fit.to_string(), mirrored)? else {
            return Ok(Vec::new());
        };
        let art = art(&format!("page {number}"), &self.options())
            .map_err(|source| FilterError::Layers { page: number, source })?;
        self.job(number, laid, &art.turned(turn), corner, mirrored)
    }

    /// Where the corner of a page goes, turned already, so that what is drawn on it lies at its place; none if all of
    /// it lies on the margins. Says how it lies, in these words, and what is cut.
    fn corner(
        &mut self,
        number: usize,
        laid: &Laid,
        (size, dpi, drawn): ((usize, usize), f64, Window),
        words: &str,
        mirrored: bool,
    ) -> Result<Option<Position>, FilterError> {
        let dots = |pixels: usize| Mm(25.4 * pixels as f64 / dpi).dots();
        // A mirrored page is turned about its middle.
        let left = if mirrored { size.0.saturating_sub(drawn.left + drawn.width) } else { drawn.left };
        let (left, top) = (dots(left), dots(drawn.top));
        let Point(x, y) = laid.fit.corner;
        let position = match laid.place {
            Place::Page => {
                Position::FromEdge(Point(Mm::of_dots(x.dots() + left), Mm::of_dots(y.dots() + top)))
            }
            Place::Centre => Position::Centred,
            Place::At(corner) => Position::FromEdge(corner),
        };
        let in_layout = |error: LayoutError| FilterError::Job { page: number, source: error.into() };
        let layout = Layout { position, ..self.settings(laid.paper, mirrored).page.layout };
        let sides = (dots(drawn.width), dots(drawn.height));
        let side = |dots: i64| usize::try_from(dots).unwrap_or(0);
        let whole = size;
        let size = (side(sides.0), side(sides.1));
        let ((x, y), beyond) = layout.placed(size).map_err(in_layout)?;
        let (width, length) = (Mm::of_dots(sides.0).0, Mm::of_dots(sides.1).0);
        if let Some(cut) = beyond
            && (cut.left.max(cut.right) >= width || cut.top.max(cut.bottom) >= length)
        {
            self.observer.note(&format!(
                "everything on page {number} lies on the margins, where the printer cannot print ({cut}); the page is skipped"
            ));
            self.in_margins.get_or_insert((number, cut));
            return Ok(None);
        }
        if !words.is_empty() {
            self.say(number, words.into());
        }
        let mm = |pixels: usize| 25.4 * pixels as f64 / dpi;
        if laid.place == Place::Page {
            let Point(Mm(left), Mm(top)) = laid.fit.corner;
            self.lies.get_or_insert(Lies { left, top, width: mm(whole.0), length: mm(whole.1) });
        }
        if let Some(cut) = beyond {
            self.is_cut = true;
            self.say(number, format!("{cut} lies on the margins, where the printer cannot print"));
        }
        Ok(Some(Position::FromPrintable(Point(Mm::of_dots(x - left), Mm::of_dots(y - top)))))
    }

    /// How a page is printed, in the middle of its paper.
    fn settings(&self, paper: Paper, mirror: bool) -> layers::Settings {
        let mut settings = layers::Settings::of(self.choices, paper, self.library);
        settings.page.layout.mirror = mirror;
        settings
    }

    /// The job of a picture that has no page of its own.
    pub(super) fn picture(&mut self, path: &Path) -> Result<Vec<u8>, FilterError> {
        if !self.wants(1) {
            return Ok(Vec::new());
        }
        let in_picture =
            |source: Diagnosis| FilterError::Layers { page: 1, source: source.calling_it("this document") };
        let (paths, paper) = ([path.to_path_buf()], self.choices.paper);
        let options = art::Options { dpi: None, ..self.options() };
        let wish = self.placed(self.choices.fit.unwrap_or_default());
        let fitted = Fitted::of(&paths, &options, paper, &wish).map_err(|error| match error {
            FittedError::Art(source) => in_picture(source),
            FittedError::Fit(source) => FilterError::Fit { page: 1, source },
        })?;
        let art = art::open(&paths, &fitted.read, self.observer).map_err(in_picture)?;
        let laid = Laid { paper, fit: fitted.fit, place: Place::Page };
        let (whole, mirrored) = (Window::whole((art.width, art.length)), self.choices.mirror);
        let lying = ((art.width, art.length), 600.0, whole);
        match self.corner(1, &laid, lying, &fitted.to_string(), mirrored)? {
            Some(corner) => self.job(1, &laid, &art, corner, mirrored),
            None => Ok(Vec::new()),
        }
    }

    /// The job of a page's art.
    fn job(
        &mut self,
        number: usize,
        laid: &Laid,
        art: &Artwork,
        corner: Position,
        mirrored: bool,
    ) -> Result<Vec<u8>, FilterError> {
        let mut settings = self.settings(laid.paper, mirrored);
        settings.page.layout.position = corner;
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
