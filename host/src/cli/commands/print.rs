//! `foilpress print`: from a document to a folder with the job and everything to look at.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args as ClapArgs;
use make::PageSettings;
use make::made::Subject;
use observe::Observer;
use press::pipeline::Draft;
use press::preview::{EYE, Probe};
use serde_json::Value;

use crate::cli::arguments::document_dots::DotsArgs;
use crate::cli::arguments::layout::MediaArgs;
use crate::cli::commands::preset::PresetArg;
use crate::cli::commands::preview::subject::replay;
use crate::cli::printing::deliver::DeliverArgs;
use crate::cli::printing::{self, Places, ResultArgs};

/// A document and everything that decides how it is printed.
#[derive(ClapArgs, Debug)]
pub struct Work {
    #[command(flatten)]
    pub dots: DotsArgs,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    preset: PresetArg,
}

impl Work {
    /// The plan of the document. Nothing is written.
    pub fn draft(&self, observer: &dyn Observer) -> Result<Draft> {
        let handling = self.media.handling();
        let inks = self.dots.inks.on(handling.media)?;
        let document = self.dots.document.open(|| Ok((inks.inks, inks.library.clone())), observer)?;
        let page = |layout| PageSettings { layout, handling, ..PageSettings::default() };
        Ok(self.dots.halftone(document, inks, page, observer)?.draft(observer)?)
    }
}

/// Arguments of `print`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress print sample:leaf\n  \
    foilpress print my-material/ --size 120x90mm --bases 8 --to file:job.rgl\n  \
    foilpress print sample:leaf --size 60mm --repeat fill --gap 3mm --crop-marks\n  \
    foilpress print helmet.gltf --material 0 --factor sacls --intent clamp\n  \
    foilpress print sample:card --inks all          (with foils)\n  \
    foilpress print --straight day.png --highlight night.png --inks all\n  \
    foilpress print --hdr window.hdr"
)]
pub struct Args {
    #[command(flatten)]
    work: Work,
    /// Light probe (.hdr or .exr) that lights the spheres in materials.png [default: a soft studio]
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    deliver: DeliverArgs,
}

/// Runs `print`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let dots = &args.work.dots;
    let inks = dots.inks.on(args.work.media.handling().media)?;
    let probe = args.probe.as_deref().map(Probe::read).transpose()?;
    let document = dots.document.open(|| Ok((inks.inks, inks.library.clone())), observer)?;
    let places = Places::new(&document.name, &args.result, &args.deliver)?;
    let page = |layout| printing::page(layout, &args.work.media, &args.result);
    let mut print = dots.halftone(document, inks, page, observer)?;
    print.settings.probe = probe;
    let replay = replay(&print, dots);
    let mut made = print.made(observer)?;
    let mut advice = String::new();
    if let Subject::Document(seen) = &mut made.subject {
        seen.replay = replay;
        let doubt = seen.print.halftoned.doubt;
        advice = format!(
            "\nSeen from {EYE} m, print and document differ: average difference d = {:.3} (0.01: barely visible; 0.05: \
             obvious).{}",
            seen.fidelity.mean,
            doubt.map_or_else(String::new, |doubt| format!(" {doubt}."))
        );
    }
    places.write(&made, observer)?;
    places.finish(&made, Value::Null, (&advice, "report.html"), &args.result, &args.deliver, observer)
}
