//! A document with everything that decides its dots: what `print`, `preview` and `compare` begin with.

use anyhow::Result;
use appearance::document::Document;
use appearance::gamut::{Gain, Intent};
use clap::Args as ClapArgs;
use make::PageSettings;
use make::choice::Metric;
use make::print::{Print, Settings};
use observe::Observer;
use press::layout::Layout;
use press::pipeline::document;
use protocol::ink::Kind;
use sheet::Size;

use crate::cli::arguments::layout::LayoutArgs;
use crate::cli::arguments::{AtHand, DocumentArgs, FactorArgs, GamutArgs, HalftoneArg, InkArgs};

/// A document and everything that decides its dots.
#[derive(ClapArgs, Debug)]
pub struct DotsArgs {
    #[command(flatten)]
    pub document: DocumentArgs,
    /// Size on paper, such as 120x90mm, 12cm or 5x4in
    ///
    /// The document keeps its proportions. [default: the document's own size, else as large as the page
    /// allows]
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
        let plain = PageSettings::default();
        let at_hand = self.inks.on(plain.handling.media)?;
        let document = self.document.open(|| Ok((at_hand.inks, at_hand.library.clone())), observer)?;
        self.halftone(document, at_hand, |layout| PageSettings { layout, ..plain }, observer)
    }

    /// The dots of a document that is open already, on a page of this layout.
    pub fn halftone(
        &self,
        document: Document,
        AtHand { inks, held_back, library }: AtHand,
        page: impl FnOnce(Layout) -> PageSettings,
        observer: &dyn Observer,
    ) -> Result<Print> {
        let dots = document::Settings {
            factor: self.factor.settings(),
            gamut: self.gamut.settings(self.factor.seed),
            inks,
            held_back,
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
        let held_back = print.halftoned.held_back.iter();
        held_back
            .filter_map(|gain| held_back_in_words(gain, report.intent, self.gamut.metric))
            .for_each(|words| observer.note(&words));
        if let Some(contrasts) = &print.contrasts {
            observer.note(&contrasts.to_string());
        }
        Ok(print)
    }
}

/// What inks that are held back would bring to what the intent maps, if that is worth the trouble.
fn held_back_in_words(gain: &Gain, intent: Intent, metric: Metric) -> Option<String> {
    /// Share of the difference that is worth the trouble.
    const WORTH: f64 = 0.1;
    let share = 1.0 - gain.after / gain.before;
    let names: Vec<&str> = gain.inks.iter().map(|ink| ink.name()).collect();
    let is_primer = gain.inks.iter().any(|ink| ink.kind() == Kind::Primer);
    (is_primer || share >= WORTH).then(|| {
        format!(
            "with {} the inks would come {:.0} % nearer to {} (root mean square difference{} {:.3} instead of {:.3}); {}",
            names.join(" and "),
            100.0 * share,
            if intent == Intent::Basis { "the bases of this document" } else { "this document" },
            if metric == Metric::Paper { " d" } else { ", light, hue and grain included," },
            gain.after,
            gain.before,
            if is_primer {
                "primer is left out, as its ribbon can tear on plain paper: --media names another sheet, and --inks +primer \
                 takes it all the same"
            } else {
                "--inks +foil allows foils"
            }
        )
    })
}
