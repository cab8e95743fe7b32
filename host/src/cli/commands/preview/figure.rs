//! `foilpress preview --figure`: figures of the 2009 paper, of any document.

use std::borrow::Cow;

use anyhow::Result;
use appearance::brdf::{Space, Table, reflectances};
use appearance::document::SAMPLES;
use appearance::factor::Factored;
use appearance::gamut::{self, GamutSettings, Gloss, Intent, Mapped, Printable};
use clap::ValueEnum;
use inks::{Library, Stack};
use observe::Observer;
use press::preview::figures::{SIX_LIGHTS, balls_picture, bases_alone, weights_picture};
use press::preview::{Heading, Panels, Probe, Source, near_picture};
use readers::Pixels;
use sheet::{Area, DotMap};

use super::subject::{printed, printed_name};
use crate::cli::arguments::document_dots::DotsArgs;

/// Which one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Figure {
    /// Each basis as a ball above its weight map (figure 4)
    Weights,
    /// Bases as balls in four columns: the document's, the stacks', clamped, and mapped with their differences kept (figure 5)
    Balls,
    /// Document over print under six lights, from above down to 15 degrees (figure 11)
    Lights,
    /// The print and a checkerboard behind it, which it mirrors (figure 2)
    Near,
}

/// Draws a figure of a document.
pub fn figure(
    figure: Figure,
    work: &DotsArgs,
    probe: &Probe,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>> {
    if figure == Figure::Near {
        return near(work, observer);
    }
    let prepared = work.dots(observer)?;
    let name = &prepared.document.name;
    if figure == Figure::Lights {
        let dots = &prepared.halftoned.dots;
        let space = prepared.document.materials().space();
        let stacks = reflectances(dots.stacks(), &prepared.settings.library, space);
        let print = Source::Print { dots, space, stacks: &stacks, area: Area::whole(dots) };
        let panels = Panels::lit(&prepared.target(), &print, &SIX_LIGHTS, 300, observer)?.in_a_row();
        return Ok(panels.picture(heading(name, dots.stacks(), &prepared.settings.library), &[])?);
    }
    let bases = prepared.bases(observer)?;
    if figure == Figure::Weights {
        return Ok(weights_picture(name, &bases, probe, observer)?);
    }
    // Each basis as a document of its own: what the inks come nearest to, and what keeps their differences.
    let alone = bases_alone(&bases)?;
    let printable =
        Printable::combined(&prepared.settings.library, &prepared.settings.dots.inks, &bases.space);
    let map = |intent, gloss| -> Result<Mapped> {
        let settings = GamutSettings { intent, gloss, eye: None, ..prepared.settings.dots.gamut.clone() };
        let bases = || Ok::<_, gamut::GamutError>(Cow::Borrowed(&alone));
        Ok(gamut::map(&alone, bases, &printable, &settings, &observe::Silent)?)
    };
    let clamped = map(Intent::Clamp, Gloss::Keep)?;
    let mapped = map(Intent::Basis, GamutSettings::default().gloss)?;
    let columns = [
        ("document", alone.bases.clone()),
        ("stacks in use", stacks(&mapped, &prepared.settings.library, &alone)),
        ("clamped", mixed(&clamped, &prepared.settings.library, &alone)),
        ("mapped", mixed(&mapped, &prepared.settings.library, &alone)),
    ];
    let heading = heading(name, &mapped.mix.stacks, &prepared.settings.library);
    Ok(balls_picture(heading, &bases.space, &columns, probe, observer)?)
}

/// What a print mirrors: of a document, a job or a sheet.
fn near(work: &DotsArgs, observer: &dyn Observer) -> Result<Pixels<[u8; 3]>> {
    let path = work.document.path();
    if let Some(dots) = printed(path, observer)? {
        return mirroring(&printed_name(path), &dots, inked(&dots), &work.inks.library()?, observer);
    }
    let prepared = work.dots(observer)?;
    let dots = &prepared.halftoned.dots;
    mirroring(&prepared.document.name, dots, Area::whole(dots), &prepared.settings.library, observer)
}

/// An area of dots before a checkerboard.
pub fn mirroring(
    name: &str,
    dots: &DotMap,
    area: Area,
    library: &Library,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>> {
    let space = Space::half_angle(SAMPLES);
    let stacks = reflectances(dots.stacks(), library, &space);
    let print = Source::Print { dots, space: &space, stacks: &stacks, area };
    Ok(near_picture(heading(name, dots.stacks(), library), &print, observer)?)
}

/// A name above pictures of these stacks.
fn heading<'a>(title: &'a str, stacks: &[Stack], library: &Library) -> Heading<'a> {
    Heading { title, modelled: !library.modelled(stacks).is_empty() }
}

/// The part of a page that has ink; all of one that has none.
fn inked(dots: &DotMap) -> Area {
    let bare: Vec<bool> = dots.stacks().iter().map(|stack| stack.layers().is_empty()).collect();
    let has_ink = |&stack: &u8| !bare[usize::from(stack)];
    let rows = || dots.index().chunks_exact(dots.width().max(1));
    let first = |row: &[u8]| row.iter().position(has_ink);
    let last = |row: &[u8]| row.iter().rposition(has_ink);
    let (Some(top), Some(bottom), Some(left), Some(right)) = (
        rows().position(|row| row.iter().any(has_ink)),
        rows().rposition(|row| row.iter().any(has_ink)),
        rows().filter_map(first).min(),
        rows().filter_map(last).max(),
    ) else {
        return Area::whole(dots);
    };
    Area { left, top, width: right + 1 - left, length: bottom + 1 - top }
}

/// What the mixture of each pixel reflects.
fn mixed(mapped: &Mapped, library: &Library, document: &Factored) -> Table {
    let curves = reflectances(&mapped.mix.stacks, library, &document.space);
    let mut rows = Table::new(document.space.columns());
    let mut shares = vec![0.0; curves.len()];
    for pixel in 0..document.bases.len() {
        mapped.mix.shares(pixel, &mut shares);
        let mut row = vec![0.0; document.space.columns()];
        for (share, curve) in shares.iter().zip(curves.rows()) {
            row.iter_mut().zip(curve).for_each(|(sum, f)| *sum += share * f);
        }
        rows.push(&row);
    }
    rows
}

/// The stacks that take most of the mixtures, as many as there are bases.
fn stacks(mapped: &Mapped, library: &Library, document: &Factored) -> Table {
    let curves = reflectances(&mapped.mix.stacks, library, &document.space);
    let mut total = vec![0.0; curves.len()];
    let mut shares = vec![0.0; curves.len()];
    for pixel in 0..document.bases.len() {
        mapped.mix.shares(pixel, &mut shares);
        total.iter_mut().zip(&shares).for_each(|(sum, share)| *sum += share);
    }
    let mut order: Vec<usize> = (0..curves.len()).filter(|&k| total[k] > 0.0).collect();
    order.sort_by(|&a, &b| total[b].total_cmp(&total[a]));
    order.truncate(document.bases.len());
    let mut rows = Table::new(document.space.columns());
    order.into_iter().for_each(|k| rows.push(curves.row(k)));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_cut_to_its_ink() {
        let page =
            |index: Vec<u8>| DotMap::new(5, 4, vec![Stack::SUBSTRATE, "K".parse().unwrap()], index).unwrap();
        let index = (0..20).map(|i| u8::from(i == 7 || i == 13)).collect();
        assert_eq!(inked(&page(index)), Area { left: 2, top: 1, width: 2, length: 2 });
        assert_eq!(inked(&page(vec![0; 20])), Area { left: 0, top: 0, width: 5, length: 4 });
    }
}
