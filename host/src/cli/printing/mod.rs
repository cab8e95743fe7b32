//! From what was made to where it goes: the folder of a print, the plan on the terminal, and the way to the
//! printer.

pub mod cut_lines;
pub mod deliver;
pub mod plan_output;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use inks::{InkSet, Library};
use make::{Made, PageSettings};
use rayon::prelude::*;
use serde_json::Value;

use crate::cli::arguments::layout::{LayoutArgs, MediaArgs};
use crate::cli::commands::ledger;
use crate::cli::console::show;
use crate::cli::output::{self, Kind, Staged, write};
use crate::cli::printing::deliver::DeliverArgs;
use observe::{Beside, Observer};
use press::layout::Layout;
use press::preview::inks::Ground;
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

impl JobArgs {
    /// What the page and its pictures are like, on this layout.
    pub fn page(&self, layout: Layout) -> PageSettings {
        page(layout, &self.media, &self.result)
    }
}

/// What a page and its pictures are like.
pub fn page(layout: Layout, media: &MediaArgs, result: &ResultArgs) -> PageSettings {
    let ground = result.background.unwrap_or_default();
    PageSettings { layout, handling: media.handling(), ground, prices: ledger::prices() }
}

/// Makes a job of the dots of a chart, writes everything, shows the plan and sends the job.
pub fn print_dots(
    (name, dots, advice): (&str, &DotMap, &str),
    (allowed, library): (InkSet, &Library),
    page: &PageSettings,
    result: &ResultArgs,
    deliver: &DeliverArgs,
    observer: &dyn Observer,
) -> Result<()> {
    let places = Places::new(name, result, deliver)?;
    let made = Made::proved(&page.request(name, dots, allowed, library), page, observer)?;
    places.write(&made, observer)?;
    places.finish(&made, Value::Null, (advice, "preview.png"), result, deliver, observer)
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

    /// Writes what every print has: the job, its passes, pictures and pages. Returns the folder, which has
    /// another name yet.
    pub fn write(&self, made: &Made, observer: &dyn Observer) -> Result<PathBuf> {
        let folder = self.folder.create()?.to_path_buf();
        write(&folder.join("job.rgl"), &made.job.bytes)?;
        let passes = folder.join("passes");
        fs::create_dir(&passes).with_context(|| format!("cannot write {}", passes.display()))?;
        let beside = Beside(observer);
        let picture = |name: &String| write(&folder.join(name), &made.picture(name, &beside)?);
        let page = |name: &&str| write(&folder.join(name), made.page(name, &beside)?.as_bytes());
        let dpi = made.plan().resolution_dpi;
        // One thread compresses a picture, so they are made beside each other.
        let (pages, (pictures, passes)) = rayon::join(
            || made.pages().par_iter().with_max_len(1).try_for_each(page),
            || {
                rayon::join(
                    || made.pictures().par_iter().with_max_len(1).try_for_each(picture),
                    || separate::files::save(&made.job.draft.separation, dpi, &passes),
                )
            },
        );
        pages?;
        pictures?;
        passes?;
        Ok(folder)
    }

    /// Writes the report, makes everything appear, shows the plan and sends the job. `more` is what else the report
    /// holds (an object, or null for nothing), `advice` what else to say below the plan, and `picture` the
    /// file to look at.
    pub fn finish(
        self,
        made: &Made,
        more: Value,
        (advice, picture): (&str, &str),
        result: &ResultArgs,
        deliver: &DeliverArgs,
        observer: &dyn Observer,
    ) -> Result<()> {
        let mut report = made.report();
        if let Value::Object(more) = more {
            more.into_iter().for_each(|(name, value)| report[name] = value);
        }
        let report = serde_json::to_string_pretty(&report)?;
        write(&self.folder.path().join("report.json"), report.as_bytes())?;
        let target = self.target.clone();
        self.commit(&made.job.bytes)?;
        if result.json {
            show(&format!("{report}\n"))?;
        } else {
            let plan = made.plan();
            show(&format!(
                "{plan}{advice}\nThe simulated printer made exactly this sheet. See {}; {} is the plan on one page.\n",
                target.join(picture).display(),
                target.join("plan.html").display()
            ))?;
        }
        deliver.send(&made.job, observer)
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
