//! From the art of a page to a job: inks as the user chose them, the place on the sheet, passes, bytes.

use std::io::Write;

use inks::{InkSet, Library};
use protocol::ink::{Ink, Kind};
use protocol::paper::{LEFT, Paper};
use protocol::rgl::Page;

use super::{FilterError, io_error};
use crate::job::placement::DOTS_PER_MM;
use crate::layers::{self, Artwork};
use crate::layout::{self, Cut, Layout, Mm, Point, Position};
use crate::observe::Observer;
use crate::pipeline;
use crate::queue::options::{Choices, Spots};
use crate::queue::ppd;
use crate::separate::{self, Plane, Severity};

/// What makes jobs of pages.
pub(super) struct Press<'a> {
    pub choices: &'a Choices,
    pub library: &'a Library,
    pub out: &'a mut dyn Write,
    pub observer: &'a dyn Observer,
    /// Jobs written.
    pub jobs: usize,
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

    /// How a page is read, drawn at so many pixels an inch.
    pub(super) fn options(&self, dpi: u16) -> layers::Options {
        let choices = self.choices;
        // Black text is to be solid, whatever else is on the page.
        let mut reserved = InkSet::EMPTY;
        if choices.colours.contains(Ink::Black) {
            reserved = reserved.with(Ink::Black);
        }
        if choices.spots == Spots::Reserved {
            reserved = layers::Options::default().inks;
        } else if choices.white == layers::White::Reserved {
            reserved = reserved.with(Ink::White);
        }
        layers::Options {
            dpi: Some(dpi.into()),
            reserved: !reserved.is_empty(),
            inks: reserved,
            ..layers::Options::default()
        }
    }

    /// How its layers become stacks.
    fn settings(&self) -> layers::Settings {
        let choices = self.choices;
        let spots = Ink::ALL.into_iter().filter(|ink| match ink.kind() {
            Kind::Process => choices.colours.contains(*ink),
            Kind::Foil => choices.foils,
            _ => true,
        });
        layers::Settings {
            inks: InkSet::of(spots),
            // What the page itself draws in white or finish is printed whatever is chosen.
            white: Some(choices.white).filter(|&white| white != layers::White::None),
            finish: Some(choices.finish).filter(|&finish| finish != layers::Finish::None),
            ..layers::Settings::default()
        }
    }

    /// The job of a page; empty if nothing is on it. `mirrored` turns it left to right.
    pub(super) fn job(
        &mut self,
        number: usize,
        paper: Paper,
        art: &Artwork,
        mirrored: bool,
    ) -> Result<Vec<u8>, FilterError> {
        let Some(drawn) = bounds(&art.drawn) else {
            self.observer.note(&format!("page {number} is blank; no sheet is made of it"));
            return Ok(Vec::new());
        };
        let settings = self.settings();
        let foil = art.layers.iter().map(|layer| layer.ink).find(|ink| ink.kind() == Kind::Foil);
        if let Some(ink) = foil.filter(|&ink| !settings.inks.contains(ink)) {
            return Err(FilterError::Foil { page: number, ink });
        }
        let composed = layers::compose(art, &settings, self.library, self.observer)
            .map_err(|source| FilterError::Layers { page: number, source })?;
        for suggestion in &composed.suggestions {
            self.observer.note(&format!("page {number}: {}", suggestion.text));
        }
        let layout = Layout {
            position: position(self.choices.place, paper, drawn),
            mirror: mirrored,
            // What is cut off is told below: a page is always larger than what can be printed of it.
            cut: true,
            profile: self.choices.profile,
            ..Layout::centred(paper)
        };
        if let Some(cut) = beyond(&layout, art.width, drawn) {
            self.observer
                .note(&format!("page {number}: {cut} lies on the margins, where this machine cannot print"));
        }
        let in_page = |source| FilterError::Layout { page: number, source };
        let sheet = layout::arrange(&composed.piece, &layout, self.observer).map_err(in_page)?.sheet;
        let separation = separate::separate(&sheet, self.library.rules(), self.observer)?;
        if let Some(check) = separation.checks.iter().find(|check| check.severity == Severity::Error) {
            return Err(FilterError::Refused { page: number, why: check.with_stacks() });
        }
        let (media, curl_correction) = (self.choices.media, self.choices.curl_correction);
        let page = Page { media, curl_correction, ..Page::plain(paper) };
        Ok(pipeline::job_on(page, &separation.passes, &settings.inks, self.observer)?)
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

/// Where what is drawn goes on its sheet.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Place {
    /// Where the page has it.
    Page,
    /// In the middle of the printable area.
    Centre,
    /// Its top left corner this far from the corner of the sheet.
    At(Point),
}

/// The smallest rectangle around the dots of a plane: left, top, and one past right and bottom.
fn bounds(plane: &Plane) -> Option<[usize; 4]> {
    let mut columns = vec![0u8; plane.stride];
    let (mut top, mut bottom) = (None, 0);
    for (y, row) in plane.bits.chunks_exact(plane.stride).enumerate() {
        if row.iter().any(|&bits| bits != 0) {
            columns.iter_mut().zip(row).for_each(|(all, &bits)| *all |= bits);
            top = top.or(Some(y));
            bottom = y + 1;
        }
    }
    let left = columns.iter().position(|&bits| bits != 0)?;
    let right = columns.iter().rposition(|&bits| bits != 0)?;
    Some([
        8 * left + columns[left].leading_zeros() as usize,
        top?,
        8 * right + 8 - columns[right].trailing_zeros() as usize,
        bottom,
    ])
}

/// The place of the whole page when what is drawn of it lies in this rectangle.
fn position(place: Place, paper: Paper, [left, top, right, bottom]: [usize; 4]) -> Position {
    // Pages are held in memory: their sides are far below the limits of i64.
    let (left, top) = (left as i64, top as i64);
    let (width, length) = (right as i64 - left, bottom as i64 - top);
    let corner = match place {
        Place::Page => (left, top),
        Place::At(Point(x, y)) => (x.dots(), y.dots()),
        Place::Centre => (
            i64::from(LEFT) + (i64::from(paper.width()) - width).div_euclid(2),
            i64::from(paper.top()) + (i64::from(paper.length()) - length).div_euclid(2),
        ),
    };
    Position::FromEdge(Point(Mm::of_dots(corner.0 - left), Mm::of_dots(corner.1 - top)))
}

/// How far what is drawn reaches beyond the printable area. `width` is that of the page.
fn beyond(layout: &Layout, width: usize, [left, top, right, bottom]: [usize; 4]) -> Option<Cut> {
    let Position::FromEdge(Point(x, y)) = layout.position else { return None };
    let (left, right) = if layout.mirror { (width - right, width - left) } else { (left, right) };
    let (x, y) = (x.dots() - i64::from(LEFT), y.dots() - i64::from(layout.paper.top()));
    let mm = |dots: i64| dots.max(0) as f64 / DOTS_PER_MM;
    let cut = Cut {
        left: mm(-(x + left as i64)),
        top: mm(-(y + top as i64)),
        right: mm(x + right as i64 - i64::from(layout.paper.width())),
        bottom: mm(y + bottom as i64 - i64::from(layout.paper.length())),
    };
    (cut != Cut::default()).then_some(cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bounds_are_those_of_the_outermost_dots(
            width in 1usize..40,
            dots in prop::collection::vec((0usize..40, 0usize..9), 0..6),
        ) {
            let stride = width.div_ceil(8);
            let mut plane = Plane { width, length: 9, stride, bits: vec![0; 9 * stride] };
            let dots: Vec<(usize, usize)> = dots.into_iter().map(|(x, y)| (x % width, y)).collect();
            for (x, y) in &dots {
                plane.bits[y * stride + x / 8] |= 0x80 >> (x % 8);
            }
            let expected = (!dots.is_empty()).then(|| {
                let xs = || dots.iter().map(|dot| dot.0);
                let ys = || dots.iter().map(|dot| dot.1);
                [xs().min().unwrap(), ys().min().unwrap(), xs().max().unwrap() + 1, ys().max().unwrap() + 1]
            });
            prop_assert_eq!(bounds(&plane), expected);
        }
    }
}
