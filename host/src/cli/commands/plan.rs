//! `foilpress plan`: what a job or a document needs, before anything is sent.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use anyhow::{Context, Result, bail};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args as ClapArgs, Command, FromArgMatches};
use inks::Library;
use protocol::rgl::Page;
use serde_json::Value;

use crate::cli::commands::layers;
use crate::cli::commands::print::Work;
use crate::cli::console::{job_in, read_job};
use crate::cli::printing::plan_output::{DrawnPlan, PlanOutputArgs};
use observe::Observer;
use press::job::plan::{Plan, Subject};
use press::layout::Laid;
use press::separate::{self, Pass, Planned};
use press::simulate;
use sheet::{Area, Sheet};

/// Arguments of `plan`: a job or a document, or the sub-command for art.
#[derive(Debug)]
pub enum Args {
    /// `plan DOC`
    Document(Document),
    /// `plan layers ART…`
    Layers(layers::PlanArgs),
}

// Deriving would ask for DOC even where there is a sub-command.
impl FromArgMatches for Args {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Args, clap::Error> {
        match matches.subcommand() {
            Some((LAYERS, matches)) => layers::PlanArgs::from_arg_matches(matches).map(Args::Layers),
            _ => {
                let mut document = Document::from_arg_matches(matches)?;
                document.of_documents = of_documents(matches);
                Ok(Args::Document(document))
            }
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Args::from_arg_matches(matches)?;
        Ok(())
    }
}

impl ClapArgs for Args {
    fn augment_args(command: Command) -> Command {
        let layers = layers::PlanArgs::augment_args(Command::new(LAYERS))
            .about("Show the plan of spot-colour artwork");
        Document::augment_args(command)
            .mut_arg("html", |html| html.alias("page"))
            .subcommand_negates_reqs(true)
            .args_conflicts_with_subcommands(true)
            .subcommand(layers)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Args::augment_args(command)
    }
}

/// Options that also say how a job is planned or shown.
const OF_JOBS: [&str; 5] = ["library", "preset", "html", "background", "json"];

/// The options given that decide what becomes of a document, by their long names.
fn of_documents(matches: &ArgMatches) -> Vec<String> {
    let command = Document::augment_args(Command::new(""));
    let given = command
        .get_arguments()
        .filter(|arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine));
    let long = given.filter_map(|arg| arg.get_long()).filter(|long| !OF_JOBS.contains(long));
    long.map(|long| format!("--{long}")).collect()
}

/// The sub-command for art.
const LAYERS: &str = "layers";

/// Arguments of `plan DOC`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress plan job.rgl\n  \
    foilpress plan sample:leaf --size 60mm --repeat 3x3 --gap 2mm\n  \
    foilpress plan layers white.png gold.png --passes white=3\n  \
    foilpress plan job.rgl --html plan.html              (one page to print and keep beside the printer)\n  \
    foilpress plan job.rgl --json\n\n\
    A job is planned from its bytes; the options for page, inks and materials apply only to documents."
)]
pub struct Document {
    #[command(flatten)]
    work: Work,
    #[command(flatten)]
    output: PlanOutputArgs,
    /// Of the options given, those that have no effect on a job.
    #[arg(skip)]
    of_documents: Vec<String>,
}

/// Runs `plan`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let args = match args {
        Args::Document(args) => args,
        Args::Layers(args) => return layers::plan(args, observer),
    };
    let page = args.output.stage()?;
    let path = args.work.dots.document.path();
    let drawn = if is_job(path) {
        let mut drawn = of_job(path, &args.work.dots.inks.library()?, observer)?;
        if !args.of_documents.is_empty() {
            // A preset in use may have given them, so they are no mistake.
            let note = format!(
                "a job is planned as it is, so {} {} no effect",
                args.of_documents.join(", "),
                if args.of_documents.len() == 1 { "has" } else { "have" }
            );
            observer.note(&note);
            drawn.plan.notes.push(note);
        }
        drawn
    } else {
        args.work.draft(observer)?.into()
    };
    args.output.show(page, drawn, &Value::Null, "")
}

/// Whether this is the folder of a print, or a file that begins like a job. All jobs begin with an escape; no document's file does.
fn is_job(path: &Path) -> bool {
    let mut first = [0];
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rgl"))
        || job_in(path).is_some()
        || (path.is_file()
            && File::open(path).and_then(|mut file| file.read_exact(&mut first)).is_ok()
            && first == *b"\x1b")
}

/// The plan of a job from its bytes, and what it prints.
fn of_job(path: &Path, library: &Library, observer: &dyn Observer) -> Result<DrawnPlan> {
    let job = read_job(path)?;
    let printout = simulate::print(&job, &simulate::Setup::default(), observer)
        .with_context(|| format!("{}", path.display()))?;
    let sheet = printout.sheet_in_dots(None).with_context(|| format!("{}", path.display()))?;
    let page = Page {
        media: printout.media,
        resolution: printout.resolution,
        curl_correction: printout.curl_correction,
        ..Page::plain(printout.paper)
    };
    let passes: Vec<Pass> = printout.passes.into_iter().filter(|pass| pass.plane.dots() > 0).collect();
    let Some(area) = inked(&sheet) else { bail!("{}: the job prints nothing", path.display()) };
    let planned: Vec<Planned> =
        passes.iter().map(|pass| Planned { ink: pass.ink, dots: pass.plane.dots() }).collect();
    let checks = separate::check(&sheet, &planned, library.rules());
    let laid = Laid::single(area);
    let name = path.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    let subject = Subject {
        name: &name,
        sheet: &sheet,
        laid: &laid,
        passes: &passes,
        planned: &planned,
        checks: &checks,
        page: &page,
        mirrored: None,
    };
    Ok(DrawnPlan { plan: Plan::new(&subject, library), sheet, passes, area })
}

/// The smallest rectangle that holds all ink.
fn inked(sheet: &Sheet) -> Option<Area> {
    let rows = sheet.index().chunks_exact(sheet.width());
    let (mut top, mut bottom, mut left, mut right) = (None, 0, sheet.width(), 0);
    for (y, row) in rows.enumerate() {
        if let (Some(first), Some(last)) =
            (row.iter().position(|&dot| dot != 0), row.iter().rposition(|&dot| dot != 0))
        {
            top.get_or_insert(y);
            (bottom, left, right) = (y, left.min(first), right.max(last));
        }
    }
    let top = top?;
    Some(Area { left, top, width: right + 1 - left, length: bottom + 1 - top })
}
