//! What is looked at: printed dots, and the document and the mixture of inks that they stand for.
//!
//! Problem: `preview` shows documents, jobs and sheets, a print what was just made of a document, and both
//! are the same page. Cost: bases that make a document look like itself are fitted to it first, which takes
//! longer than its dots; without them the dots are shown alone.

use std::borrow::Cow;

use appearance::brdf::{Space, Table, reflectances};
use appearance::factor::Factored;
use appearance::gamut::InkMix;
use appearance::materials::resolution;
use inks::Library;
use observe::Observer;
use press::layout::Mm;
use press::preview::{Probe, Radiance, Source, ToneCurve, mix_in_words, picture};
use sheet::{Area, DotMap};
use view::page::{LONGEST, Subject, Target, page};
use view::{Lit, Renderer, fit, proportions};

use crate::Error;
use crate::view::{Show, View};

/// Pixels of the longer side of the picture in the page.
const STILL: usize = 800;

/// The most places on the longer side of a weight map, for the memory's sake.
const MOST_PLACES: usize = 2048;

/// What there is to show.
pub struct Shown<'a> {
    /// Its name.
    pub name: &'a str,
    /// The tabulation of all curves.
    pub space: &'a Space,
    /// The library.
    pub library: &'a Library,
    /// The printed dots.
    pub dots: Cow<'a, DotMap>,
    /// The document and its mixture of inks, if there is more than dots.
    pub target: Option<(&'a Factored, &'a Mixture)>,
    /// The commands that replay edits of the document, one a line; empty if its bases are not to be edited.
    pub replay: &'a str,
    /// What else to say of it: what a worn printer made of the dots.
    pub also: String,
}

/// The mixture of inks of a document, to be looked at.
pub struct Mixture {
    /// Its curves and their weights.
    pub mapped: Factored,
    /// What each basis is mixed of.
    pub words: Vec<String>,
}

impl Mixture {
    /// That of a mapping, no finer than a page shows it.
    ///
    /// # Errors
    /// Never for a mix that is valid.
    pub fn of(mix: InkMix, library: &Library, space: &Space) -> Result<Mixture, Error> {
        let words = |row: &Vec<u16>| {
            let parts = mix.stacks.iter().cloned().zip(row.iter().map(|&share| f64::from(share)));
            mix_in_words(&parts.filter(|(_, share)| *share > 0.0).collect::<Vec<_>>())
        };
        let words = mix.matrix.iter().map(words).collect();
        let mapped = view::mapped(mix, library, space);
        let pixels = (mapped.maps.width(), mapped.maps.height());
        let cells = resolution(pixels, fit(pixels, LONGEST));
        let mapped = match cells {
            Some(cells) => mapped.reduced(cells)?,
            None => mapped,
        };
        Ok(Mixture { mapped, words })
    }
}

/// A page.
pub struct Page {
    /// Its text.
    pub html: String,
    /// Width and height of its picture for browsers that cannot draw.
    pub pixels: (usize, usize),
    /// The tone curve at first.
    pub tone: ToneCurve,
}

impl Shown<'_> {
    /// What the stacks of the dots reflect.
    #[must_use]
    pub fn stacks(&self) -> Table {
        reflectances(self.dots.stacks(), self.library, self.space)
    }

    /// What a picture shows.
    #[must_use]
    pub fn source<'a>(&'a self, what: Show, stacks: &'a Table) -> Source<'a> {
        match (what, self.target) {
            (Show::Document, Some((document, _))) => Source::Factored(document),
            (Show::Mapped, Some((_, mixture))) => Source::Factored(&mixture.mapped),
            _ => Source::Print { dots: &self.dots, space: self.space, stacks, area: Area::whole(&self.dots) },
        }
    }

    /// Places on the longer side of a weight map that is fine enough for a sheet of so many pixels. The
    /// renderer looks at the dots of a print where a pixel has fewer than two, so its map needs no more
    /// places than half the dots.
    #[must_use]
    pub fn places(&self, what: Show, pixels: f64) -> usize {
        let most = match what {
            Show::Printed => self.dots.width().max(self.dots.length()).div_ceil(2).clamp(64, MOST_PLACES),
            _ => MOST_PLACES,
        };
        // At most `most`, an integer of a few thousand.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let places = pixels.ceil().clamp(64.0, most as f64) as usize;
        places
    }

    /// The page on which light follows the hand, as it is at first in this view.
    ///
    /// # Errors
    /// A scene that cannot be seen.
    pub fn page(&self, view: &View, observer: &dyn Observer) -> Result<Page, Error> {
        let (stacks, size) = (self.stacks(), self.size());
        let places = self.places(view.what(), STILL as f64 * view.zoom);
        let lit = Lit::new(&self.source(view.what(), &stacks), size, places)?;
        let (width, height) = proportions(size, STILL);
        let scene = view.scene(size, width as f64 / height as f64)?;
        let radiance = Renderer::new(&lit).render(&scene, width, height, observer)?;
        let tone = view.tone(&radiance);
        let studio = Probe::studio(64);
        let subject = Subject {
            name: self.name,
            about: &self.about(),
            size,
            target: self.target.map(|(document, mixture)| Target {
                document,
                mapped: &mixture.mapped,
                mixtures: &mixture.words,
                replay: self.replay,
            }),
            dots: &self.dots,
            stacks: &stacks,
            space: self.space,
            probe: view.probe.as_ref().unwrap_or(&studio),
            start: &view.fragment(&scene.camera, tone, self.target.is_some()),
            still: &png(&radiance, tone)?,
        };
        Ok(Page { html: page(&subject, observer)?, pixels: (width, height), tone })
    }

    /// Width and height in metres.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        size(&self.dots)
    }

    fn about(&self) -> String {
        let [width, height] = self.size().map(|side| side * 1000.0);
        let stacks = self.dots.census().iter().filter(|&&dots| dots > 0).count();
        let word = if stacks == 1 { "stack" } else { "stacks" };
        let dots = counted(self.dots.index().len());
        format!("{width:.0} x {height:.0} mm, {dots} dots of {stacks} {word}{}", self.also)
    }
}

/// Width and height of dots in metres.
#[must_use]
pub fn size(dots: &DotMap) -> [f64; 2] {
    [dots.width(), dots.length()].map(|dots| Mm::of_dots(dots as i64).0 / 1000.0)
}

/// A number of dots in words.
fn counted(dots: usize) -> String {
    match dots {
        0..10_000 => dots.to_string(),
        10_000..950_000 => format!("{:.0} thousand", dots as f64 / 1e3),
        _ => format!("{:.1} million", dots as f64 / 1e6),
    }
}

/// A picture as PNG.
///
/// # Errors
/// A side that is 0 or too long.
pub fn png(radiance: &Radiance, tone: ToneCurve) -> Result<Vec<u8>, Error> {
    Ok(picture(radiance, tone)?.png()?)
}
