//! From dots to everything a print is: page, passes, job, pictures, plan, and the way to the printer.
//!
//! What everything that is printed has in common, whatever made the dots.

pub mod cut_lines;
pub mod deliver;
pub mod plan_output;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use inks::{InkSet, Library};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::cli::arguments::layout::{LayoutArgs, MediaArgs};
use crate::cli::commands::ledger;
use crate::cli::console::show;
use crate::cli::output::{self, Kind, Staged, write};
use crate::cli::printing::deliver::DeliverArgs;
use observe::Observer;
use press::job::plan::Suggestion;
use press::layout::Layout;
use press::pipeline::{self, Draft, Job, Request};
use press::preview::inks::{Ground, save_pass, save_sheet};
use press::separate;
use sheet::DotMap;

/// What is made of dots, and where it goes.
#[derive(Args, Debug)]
pub struct JobArgs {
    #[command(flatten)]
    pub layout: LayoutArgs,
    #[command(flatten)]
    pub media: MediaArgs,
    #[command(flatten)]
    pub result: ResultArgs,
    #[command(flatten)]
    pub deliver: DeliverArgs,
}

/// Where results go and how they look.
#[derive(Args, Debug)]
pub struct ResultArgs {
    /// Background colour of the previews: black, white, clear, or a value such as #204080
    #[arg(long, value_name = "COLOUR")]
    pub background: Option<Ground>,
    /// Folder to write [default: NAME.print in the current folder]
    ///
    /// A folder that this command wrote before is replaced; any other folder is left alone and reported as an error.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print the report as JSON instead of the plan in words
    #[arg(long)]
    pub json: bool,
}

/// The places a print is written to, prepared before the work so that a wrong one is reported early.
pub struct Places {
    target: PathBuf,
    folder: Staged,
    also: Option<Staged>,
}

impl Places {
    /// Prepares the folder for something of this name, and the file the job goes to if it goes to one.
    pub fn new(name: &str, result: &ResultArgs, deliver: &DeliverArgs) -> Result<Places> {
        let usual = || format!("{}.print", output::file_name(name)).into();
        let target = result.output.clone().unwrap_or_else(usual);
        let also = deliver.file()?;
        if let Some(to) = also
            && absolute(to)?.starts_with(absolute(&target)?)
        {
            bail!(
                "--to {} lies in {}, which is written as a whole; choose another place",
                to.display(),
                target.display()
            );
        }
        let folder = Staged::folder(&target, Kind::Print)?;
        let also = also.map(Staged::file).transpose()?;
        Ok(Places { target, folder, also })
    }

    /// Everything appears.
    fn commit(self, job: &[u8]) -> Result<()> {
        if let Some(also) = &self.also {
            write(also.path(), job)?;
        }
        self.folder.commit()?;
        match self.also {
            Some(also) => also.commit(),
            None => Ok(()),
        }
    }
}

fn absolute(path: &Path) -> Result<PathBuf> {
    std::path::absolute(path).with_context(|| format!("`{}` is not a path", path.display()))
}

/// A job that was proved on the simulated printer and written where it will appear.
pub struct Made {
    /// The job.
    pub job: Job,
    /// The folder it was written to, which has another name yet.
    pub folder: PathBuf,
    places: Places,
}

/// Makes a job, proves it, and writes what every print has: the job, its passes, the plan as a page, and the dots as the
/// simulated printer printed them: all inks on the ground, and each pass by itself. `notes` are what the readers had to
/// assume, `suggestions` what would improve the print.
pub fn make(
    request: &Request<'_>,
    notes: &[String],
    suggestions: &[Suggestion],
    places: Places,
    ground: Ground,
    observer: &dyn Observer,
) -> Result<Made> {
    let mut job = pipeline::job(request, observer)?;
    job.draft.plan.notes = notes.to_vec();
    job.draft.plan.suggestions = suggestions.to_vec();
    job.draft.plan.price(&ledger::prices());
    let printout = job.prove(observer)?;
    let Draft { sheet, laid, separation, plan } = &job.draft;
    let folder = places.folder.create()?.to_path_buf();
    write(&folder.join("job.rgl"), &job.bytes)?;
    let passes = folder.join("passes");
    fs::create_dir(&passes).with_context(|| format!("cannot write {}", passes.display()))?;
    let (across, dpi) = (plan_output::across(plan), plan.resolution_dpi);
    // One thread compresses a picture, so they are written beside each other, the largest first.
    let pictures: [&(dyn Fn() -> Result<()> + Sync); 5] = [
        // The page is the simulated sheet, dot for dot.
        &|| Ok(save_sheet(sheet, laid.area, across, ground, &folder.join("preview.png"))?),
        &|| Ok(sheet.save_colours(laid.area, dpi, &folder.join("separation.png"))?),
        &|| {
            let html = plan_output::page(plan, sheet, &separation.passes, laid.area, ground)?;
            write(&folder.join("plan.html"), html.as_bytes())
        },
        &|| {
            printout.passes.par_iter().enumerate().try_for_each(|(i, pass)| {
                let name = format!("preview-{:02}-{}.png", i + 1, pass.ink.name());
                Ok(save_pass(pass, laid.area, across, ground, &folder.join(name))?)
            })
        },
        &|| Ok(separate::files::save(separation, dpi, &passes)?),
    ];
    pictures.par_iter().with_max_len(1).try_for_each(|picture| picture())?;
    Ok(Made { job, folder, places })
}

impl Made {
    /// Writes the report, makes everything appear, shows the plan and sends the job. `more` is what else the report
    /// holds, `advice` what else to say below the plan, and `picture` the file to look at.
    pub fn finish(
        self,
        more: Value,
        (advice, picture): (&str, &str),
        result: &ResultArgs,
        deliver: &DeliverArgs,
        observer: &dyn Observer,
    ) -> Result<()> {
        let Made { job, folder, places } = self;
        let plan = &job.draft.plan;
        let mut report = json!({
            "program": concat!("foilpress ", env!("CARGO_PKG_VERSION")),
            "document": { "name": plan.document },
            "plan": plan,
            "job": { "bytes": job.bytes.len() },
        });
        if let Value::Object(more) = more {
            for (name, value) in more {
                report[name] = value;
            }
        }
        let report = serde_json::to_string_pretty(&report)?;
        write(&folder.join("report.json"), report.as_bytes())?;
        let target = places.target.clone();
        places.commit(&job.bytes)?;
        if result.json {
            show(&format!("{report}\n"))?;
        } else {
            show(&format!(
                "{plan}{advice}\nThe simulated printer made exactly this sheet. See {}; {} is the plan on one page.\n",
                target.join(picture).display(),
                target.join("plan.html").display()
            ))?;
        }
        deliver.send(&job, observer)
    }
}

/// Flat art or a chart that is to be printed.
pub struct Artwork<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its dots.
    pub dots: &'a DotMap,
    /// The inks the user allowed; a foil among them is consent to print it.
    pub allowed: InkSet,
    /// The library.
    pub library: &'a Library,
    /// What the readers had to assume.
    pub notes: &'a [String],
    /// What would improve the print.
    pub suggestions: Vec<Suggestion>,
    /// What else the report should hold: an object, or null for nothing.
    pub report: Value,
    /// What else to say below the plan; empty for nothing.
    pub advice: String,
}

impl<'a> Artwork<'a> {
    /// The job to make of it.
    pub fn request(&self, layout: &'a Layout, media: &MediaArgs) -> Request<'a> {
        let Artwork { name, dots, allowed, library, .. } = *self;
        Request { name, dots, layout, handling: media.handling(), allowed, library }
    }

    /// Makes a job of it, writes everything, shows the plan and sends the job.
    pub fn print(
        &self,
        layout: &'a Layout,
        media: &MediaArgs,
        result: &ResultArgs,
        deliver: &DeliverArgs,
        observer: &dyn Observer,
    ) -> Result<()> {
        let places = Places::new(self.name, result, deliver)?;
        let ground = result.background.unwrap_or_default();
        let request = self.request(layout, media);
        let made = make(&request, self.notes, &self.suggestions, places, ground, observer)?;
        made.finish(self.report.clone(), (&self.advice, "preview.png"), result, deliver, observer)
    }
}
