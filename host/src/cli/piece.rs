//! From a piece to everything a print is: page, passes, job, pictures, plan, and the way to the printer.
//!
//! The half that everything that prints flat ink has in common, whatever made the piece.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use inks::{InkSet, Library};
use protocol::rgl::Page;
use rayon::prelude::*;
use serde_json::json;

use super::deliver::DeliverArgs;
use super::layout::{LayoutArgs, MediaArgs};
use super::output::{self, Kind, Staged};
use observe::Observer;
use press::job::page;
use press::job::plan::{Plan, Subject};
use press::layout::{self, Laid, Layout};
use press::pipeline;
use press::preview::inks::{Ground, save_pass, save_sheet, thumbnail};
use press::separate::{self, Separation, Severity};
use press::sheet::{Piece, Sheet};
use press::simulate::{self, Printout};

/// Pixels of the longer side of the sheet on the plan's page.
pub const THUMBNAIL: usize = 640;

/// What is made of a piece, and where it goes.
#[derive(Args, Debug)]
pub struct PieceArgs {
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

impl ResultArgs {
    /// The folder to write for something of this name.
    pub fn target(&self, name: &str) -> PathBuf {
        self.output.clone().unwrap_or_else(|| format!("{}.print", output::file_name(name)).into())
    }
}

/// The places a print is written to, prepared before the work so that a wrong one is told early.
pub struct Places {
    /// The folder that will be there.
    pub target: PathBuf,
    folder: Staged,
    also: Option<Staged>,
}

impl Places {
    /// Prepares the folder, and the file the job goes to if it goes to one.
    pub fn new(target: PathBuf, also: Option<&Path>) -> Result<Places> {
        if let Some(to) = also
            && absolute(to)?.starts_with(absolute(&target)?)
        {
            bail!(
                "--to {} lies in {}, which is written whole; choose another place",
                to.display(),
                target.display()
            );
        }
        let folder = Staged::folder(&target, Kind::Print)?;
        let also = also.map(Staged::file).transpose()?;
        Ok(Places { target, folder, also })
    }

    /// The folder to write into, made now.
    pub fn create(&self) -> Result<&Path> {
        self.folder.create()
    }

    /// Everything appears.
    pub fn commit(self, job: &[u8]) -> Result<()> {
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
    std::path::absolute(path).with_context(|| format!("`{}` is no path", path.display()))
}

/// Writes a file of a print.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes what every print has: the job, the plan as a page, and the dots of the job as the simulated printer printed them:
/// all inks on the ground, and each pass by itself.
pub fn write_job(
    folder: &Path,
    job: &[u8],
    plan: &Plan,
    printed: &Sheet,
    printout: &Printout,
    laid: &Laid,
    ground: Ground,
) -> Result<()> {
    write(&folder.join("job.rgl"), job)?;
    let picture = thumbnail(printed, ground, THUMBNAIL);
    write(&folder.join("plan.html"), page::html(plan, &picture)?.as_bytes())?;
    save_sheet(printed, laid.area, ground, &folder.join("preview.png"))?;
    printout.passes.par_iter().enumerate().try_for_each(|(i, pass)| {
        let name = format!("preview-{:02}-{}.png", i + 1, pass.ink.name());
        save_pass(pass, laid.area, ground, &folder.join(name))
    })?;
    Ok(())
}

/// A piece that is to be printed.
pub struct Job<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its dots.
    pub piece: &'a Piece,
    /// The inks the user allowed; a foil among them is consent to print it.
    pub allowed: InkSet,
    /// The library.
    pub library: &'a Library,
    /// What else the report should hold, under a name of its own.
    pub report: Option<(&'static str, serde_json::Value)>,
    /// What else to say below the plan; empty for nothing.
    pub advice: String,
}

/// Lays a piece on its page, prints it on the simulated printer, writes everything, shows the plan and sends the job.
pub fn print(job: &Job<'_>, args: &PieceArgs, observer: &dyn Observer) -> Result<()> {
    print_on(job, &args.layout.layout(observer)?, &args.media, &args.result, &args.deliver, observer)
}

/// A piece on its page, with its passes and its plan.
pub struct Prepared {
    /// The page.
    pub sheet: Sheet,
    /// Its plan.
    pub plan: Plan,
    page: Page,
    laid: Laid,
    separation: Separation,
}

/// Lays a piece on its page and plans it.
pub fn prepare(
    job: &Job<'_>,
    layout: &Layout,
    media: &MediaArgs,
    observer: &dyn Observer,
) -> Result<Prepared> {
    let page: Page = media.page(layout.paper);
    let layout::Arranged { sheet, laid } = layout::arrange(job.piece, layout, observer)?;
    let separation = pipeline::separate_page(&sheet, &laid, job.library, observer)?;
    let plan = Plan::new(&Subject::new(job.name, &sheet, &laid, &separation, &page), job.library);
    Ok(Prepared { sheet, plan, page, laid, separation })
}

/// The same on a layout that was decided elsewhere.
pub fn print_on(
    job: &Job<'_>,
    layout: &Layout,
    media: &MediaArgs,
    result: &ResultArgs,
    deliver: &DeliverArgs,
    observer: &dyn Observer,
) -> Result<()> {
    let places = Places::new(result.target(job.name), deliver.file())?;
    let Prepared { sheet, plan, page, laid, separation } = prepare(job, layout, media, observer)?;
    if let Some(check) = separation.checks.iter().find(|check| check.severity == Severity::Error) {
        bail!("this must not be printed: {}", check.with_stacks());
    }
    let bytes = pipeline::job_on(page, &separation.passes, &job.allowed, observer)?;
    let printout = simulate::print(&bytes, &simulate::Setup::default(), observer)?;
    let printed = printout.sheet_with(sheet.stacks())?;
    if let Some(difference) = simulate::difference(&sheet, &printed) {
        bail!("the simulated sheet is not the one that was sent: {difference}");
    }

    let folder = places.create()?;
    write_job(folder, &bytes, &plan, &printed, &printout, &laid, result.background.unwrap_or_default())?;
    let passes = folder.join("passes");
    fs::create_dir(&passes).with_context(|| format!("cannot write {}", passes.display()))?;
    separate::files::save(&separation, &passes)?;
    sheet.save_colours(laid.area, &folder.join("separation.png"))?;
    let mut report = json!({
        "program": concat!("foilpress ", env!("CARGO_PKG_VERSION")),
        "document": { "name": job.name },
        "plan": plan,
        "job": { "bytes": bytes.len() },
        // The sheets were compared dot for dot above.
        "simulated": { "equal": true },
    });
    if let Some((name, value)) = &job.report {
        report[*name] = value.clone();
    }
    let report = serde_json::to_string_pretty(&report)?;
    write(&folder.join("report.json"), report.as_bytes())?;
    let target = places.target.clone();
    places.commit(&bytes)?;

    if result.json {
        super::show(&format!("{report}\n"))?;
    } else {
        super::show(&format!(
            "{plan}{}\nThe simulated printer made exactly this sheet. Look at {}; {} is the plan on one page.\n",
            job.advice,
            target.join("preview.png").display(),
            target.join("plan.html").display()
        ))?;
    }
    deliver.send(job.name, &bytes, observer)
}
