//! A document with everything that decides its dots: what `print`, `preview` and `compare` begin with.

use anyhow::Result;
use appearance::document::Document;
use appearance::gamut::{self, Gain, Intent};
use clap::Args as ClapArgs;
use inks::{InkSet, Library};
use make::PageSettings;
use make::print::{Print, Settings};
use observe::Observer;
use press::layout::Layout;
use press::pipeline::document;
use sheet::Size;

use crate::cli::arguments::layout::LayoutArgs;
use crate::cli::arguments::{DocumentArgs, FactorArgs, GamutArgs, HalftoneArg, InkArgs};

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

impl DotsArgs {
    /// The document's dots. Nothing is written.
    pub fn dots(&self, observer: &dyn Observer) -> Result<Print> {
        let (inks, library) = self.inks.at_hand()?;
        let document = self.document.open(|| Ok((inks, library.clone())), observer)?;
        let page = |layout| PageSettings { layout, ..PageSettings::default() };
        self.halftone(document, (inks, library), page, observer)
    }

    /// The dots of a document that is open already, on a page of this layout.
    pub fn halftone(
        &self,
        document: Document,
        (inks, library): (InkSet, Library),
        page: impl FnOnce(Layout) -> PageSettings,
        observer: &dyn Observer,
    ) -> Result<Print> {
        let dots = document::Settings {
            factor: self.factor.settings(),
            gamut: self.gamut.settings(self.factor.seed),
            inks,
            halftone: self.halftone.halftone.unwrap_or_default(),
            size: self.size,
        };
        let page = page(self.layout.layout(observer)?);
        let print = Print::new(document, &Settings { dots, library, page, probe: None }, observer)?;
        let report = &print.halftoned.mapped.report;
        if print.uses_bases() {
            self.factor.note_unused(&print.document, observer);
        } else if self.factor.is_chosen() {
            observer.note(match report.not_blended {
                None => "every pixel was fitted by itself, so --bases and --factor change nothing; --intent basis uses bases",
                Some(_) => {
                    "every pixel was fitted by itself; --bases and --factor decided only that intent `blend` would not do \
                     better; --intent basis uses bases"
                }
            });
        }
        let foils = print.halftoned.foils.as_ref();
        if let Some(words) =
            foils.and_then(|gain| foils_in_words(gain, report.intent, &print.settings.dots.gamut))
        {
            observer.note(&words);
        }
        if let Some(contrasts) = &print.contrasts {
            observer.note(&contrasts.to_string());
        }
        Ok(print)
    }
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
