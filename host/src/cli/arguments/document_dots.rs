//! A document with everything that decides its dots, and the dots: what `print`, `preview` and `compare` begin with.

use anyhow::{Result, bail};
use clap::Args as ClapArgs;
use inks::{InkSet, Library};

use crate::cli::arguments::layout::LayoutArgs;
use crate::cli::arguments::{DocumentArgs, FactorArgs, GamutArgs, HalftoneArg, InkArgs};
use appearance::brdf::reflectances;
use appearance::document::Document;
use appearance::factor::{self, Factored};
use appearance::gamut::{self, Gain, Intent, Printable};
use observe::Observer;
use press::layout::Layout;
use press::pipeline::document::{self, Halftoned, Settings};
use press::preview::gloss::{self, Gloss};
use press::preview::{self, Contrasts, EYE, Source};
use rayon::prelude::*;
use sheet::{Area, Size};

/// Bases of a document whose print needs none, so that the picture of it is close.
const BASES: usize = 12;

/// A document and everything that decides its dots.
#[derive(ClapArgs, Debug)]
pub struct DotsArgs {
    #[command(flatten)]
    pub document: DocumentArgs,
    /// Size on paper, such as 120x90mm, 12cm or 5x4in
    ///
    /// The document keeps its proportions. [default: the document's own size, else as large as the page allows]
    #[arg(long)]
    pub size: Option<Size>,
    #[command(flatten)]
    pub layout: LayoutArgs,
    #[command(flatten)]
    pub factor: FactorArgs,
    #[command(flatten)]
    pub gamut: GamutArgs,
    #[command(flatten)]
    pub halftone: HalftoneArg,
    #[command(flatten)]
    pub inks: InkArgs,
}

/// A document's dots and how they lie on the page.
pub struct DocumentDots {
    pub document: Document,
    pub library: Library,
    pub settings: Settings,
    pub layout: Layout,
    pub halftoned: Halftoned,
    /// How well each of two pictures is seen, if the document was made of two.
    pub contrasts: Option<Contrasts>,
}

impl DocumentDots {
    /// Gloss of each material of the mapping, in its order.
    pub fn gloss(&self) -> Vec<Gloss> {
        let space = self.document.materials().space();
        let lowest = gloss::lowest_peak(&Printable::combined(&self.library, &self.settings.inks, space));
        let materials = self.halftoned.mapped.report.materials.par_iter();
        materials.map(|material| Gloss::of(space, material, lowest)).collect()
    }

    /// What there is to say of the document beside the plan: what was assumed, and its gloss.
    pub fn notes(&self, gloss: &[Gloss]) -> Vec<String> {
        let materials = &self.halftoned.mapped.report.materials;
        let shares: Vec<(f64, Gloss)> =
            materials.iter().map(|m| m.share).zip(gloss.iter().copied()).collect();
        self.document.notes.iter().cloned().chain(gloss::sentences(&shares)).collect()
    }

    /// How the document's bases for pictures of it are found, unless it came with bases.
    pub fn factoring(&self) -> factor::FactorSettings {
        let uses_bases = self.halftoned.mapped.report.intent.uses_bases();
        let bases = self.settings.factor.bases.or((!uses_bases).then_some(BASES));
        factor::FactorSettings { bases, ..self.settings.factor }
    }

    /// The document's bases for pictures of it.
    pub fn bases(&self, observer: &dyn Observer) -> Result<Factored> {
        Ok(document::factored(&self.document, &self.factoring(), observer)?.0.into_owned())
    }
}

impl DotsArgs {
    /// The document's dots. Nothing is written.
    pub fn document_dots(&self, observer: &dyn Observer) -> Result<DocumentDots> {
        let (inks, library) = self.inks.at_hand()?;
        let document = self.document.open(|| Ok((inks, library.clone())), observer)?;
        self.halftone(document, inks, library, observer)
    }

    /// The dots of a document that is open already.
    pub fn halftone(
        &self,
        mut document: Document,
        inks: InkSet,
        library: Library,
        observer: &dyn Observer,
    ) -> Result<DocumentDots> {
        let layout = self.layout.layout(observer)?;
        let settings = Settings {
            factor: self.factor.settings(),
            gamut: self.gamut.settings(self.factor.seed),
            inks,
            halftone: self.halftone.halftone.unwrap_or_default(),
            size: self.size,
        };
        let halftoned = document::halftoned(&document, &library, &settings, &layout, observer)?;
        let report = &halftoned.mapped.report;
        if report.intent.uses_bases() {
            self.factor.note_unused(&document, observer);
        } else if self.factor.is_chosen() {
            observer.note(match report.not_blended {
                None => "every pixel was fitted by itself, so --bases and --factor change nothing; --intent basis uses bases",
                Some(_) => {
                    "every pixel was fitted by itself; --bases and --factor decided only that intent `blend` would not do \
                     better; --intent basis uses bases"
                }
            });
        }
        if let Some(words) =
            halftoned.foils.as_ref().and_then(|gain| foils_in_words(gain, report.intent, &settings.gamut))
        {
            observer.note(&words);
        }
        let contrasts = contrasts(&document, &library, &halftoned)?;
        if let Some(contrasts) = &contrasts {
            if let Some(name) = contrasts.lost() {
                bail!(
                    "nothing is left of {name} in the print: {contrasts}; allow more inks (--inks all), print larger, or give the other \
                     picture less contrast"
                );
            }
            observer.note(&contrasts.to_string());
            document.notes.push(contrasts.to_string());
        }
        Ok(DocumentDots { document, library, settings, layout, halftoned, contrasts })
    }
}

/// How well each of two pictures is seen on the dots.
fn contrasts(document: &Document, library: &Library, halftoned: &Halftoned) -> Result<Option<Contrasts>> {
    let (Some(views), Some(target)) = (&document.views, document.as_factored()) else { return Ok(None) };
    let dots = &halftoned.dots;
    let stacks = reflectances(dots.stacks(), library, &target.space);
    let print = Source::Print { dots, space: &target.space, stacks: &stacks, area: Area::whole(dots) };
    Ok(preview::contrasts(target, views, &print, EYE)?)
}

/// What foils would bring to what the intent maps, if that can be seen.
fn foils_in_words(gain: &Gain, intent: Intent, settings: &gamut::GamutSettings) -> Option<String> {
    /// Share of the difference that is worth the trouble.
    const WORTH: f64 = 0.1;
    let share = 1.0 - gain.after / gain.before;
    let names: Vec<&str> = gain.inks.iter().map(|ink| ink.name()).collect();
    (share >= WORTH).then(|| {
        format!(
            "with {} the inks would come {:.0} % nearer to {} (root mean square difference{} {:.3} instead of {:.3}); \
             --inks +foil allows foils",
            names.join(" and "),
            100.0 * share,
            if intent == Intent::Basis { "the bases of this document" } else { "this document" },
            settings.measure(),
            gain.after,
            gain.before
        )
    })
}
