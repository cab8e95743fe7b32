//! `foilpress plan`: what a job or a document needs, before anything is sent.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{ArgMatches, Args as ClapArgs, Command, FromArgMatches};
use inks::Library;
use protocol::rgl::Page;

use super::output::Staged;
use super::print::Work;
use super::{layers, piece};
use observe::Observer;
use press::job;
use press::job::plan::{Plan, Subject};
use press::layout::Laid;
use press::preview::Area;
use press::preview::inks::{Ground, thumbnail};
use press::separate::{self, Pass, Planned};
use press::sheet::Sheet;
use press::simulate;

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
            _ => Document::from_arg_matches(matches).map(Args::Document),
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

/// The sub-command for art.
const LAYERS: &str = "layers";

/// Arguments of `plan DOC`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    after_help = "Examples:\n  \
    foilpress plan job.rgl\n  \
    foilpress plan sample:leaf --size 80mm --repeat 2x3 --gap 2mm\n  \
    foilpress plan layers white.png gold.png --passes white=3\n  \
    foilpress plan job.rgl --html plan.html              (one page to print and keep beside the printer)\n  \
    foilpress plan job.rgl --json\n\n\
    A job is planned from its bytes; the options for page, inks and materials apply only to documents."
)]
pub struct Document {
    #[command(flatten)]
    work: Work,
    #[command(flatten)]
    shown: Shown,
}

/// How a plan is shown.
#[derive(ClapArgs, Debug)]
pub struct Shown {
    /// Also write the plan as a self-contained HTML page to this file
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    /// Background colour of the page's picture: black, white, clear, or a value such as #204080
    #[arg(long, value_name = "COLOUR")]
    background: Option<Ground>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Shown {
    /// Prepares the page before the work, so that a wrong place is told early.
    pub fn stage(&self) -> Result<Option<Staged>> {
        self.html.as_deref().map(Staged::file).transpose()
    }

    /// Shows a plan and writes its page, if that is wanted. `report` is more for programs, under a name of its own,
    /// `advice` more for people.
    pub fn show(
        &self,
        page: Option<Staged>,
        (plan, sheet): (&Plan, &Sheet),
        report: Option<(&str, serde_json::Value)>,
        advice: &str,
    ) -> Result<()> {
        if let Some(staged) = page {
            let picture = thumbnail(sheet, self.background.unwrap_or_default(), piece::THUMBNAIL);
            piece::write(staged.path(), job::page::html(plan, &picture)?.as_bytes())?;
            staged.commit()?;
        }
        if !self.json {
            return super::show(&format!("{plan}{advice}"));
        }
        let mut json = serde_json::to_value(plan)?;
        if let Some((name, value)) = report {
            json[name] = value;
        }
        super::show(&format!("{}\n", serde_json::to_string_pretty(&json)?))
    }
}

/// Runs `plan`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let args = match args {
        Args::Document(args) => args,
        Args::Layers(args) => return layers::plan(args, observer),
    };
    let page = args.shown.stage()?;
    let path = Path::new(&args.work.document.document);
    let (plan, sheet) = if is_job(path) {
        of_job(path, &args.work.inks.library()?, observer)?
    } else {
        let done = args.work.print(observer)?;
        (done.plan, done.print.printed)
    };
    args.shown.show(page, (&plan, &sheet), None, "")
}

/// Whether a file begins like a job. All jobs begin with an escape; no document's file does.
fn is_job(path: &Path) -> bool {
    let mut first = [0];
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rgl"))
        || (path.is_file()
            && File::open(path).and_then(|mut file| file.read_exact(&mut first)).is_ok()
            && first == *b"\x1b")
}

/// The plan of a job from its bytes, and the sheet it prints.
fn of_job(path: &Path, library: &Library, observer: &dyn Observer) -> Result<(Plan, Sheet)> {
    let job = super::read_job(path)?;
    let printout = simulate::print(&job, &simulate::Setup::default(), observer)
        .with_context(|| format!("{}", path.display()))?;
    let sheet = printout.sheet().with_context(|| format!("{}", path.display()))?;
    let curl = press::inspect::inspect(&job, observer).inspection.setup.curl_correction;
    let page = Page {
        media: printout.media,
        resolution: printout.resolution,
        curl_correction: curl.unwrap_or(true),
        ..Page::plain(printout.paper)
    };
    let passes: Vec<Pass> = printout.passes.into_iter().filter(|pass| pass.plane.dots() > 0).collect();
    let Some(area) = inked(&sheet) else { bail!("{}: there is nothing on the sheet", path.display()) };
    let planned: Vec<Planned> =
        passes.iter().map(|pass| Planned { ink: pass.ink, dots: pass.plane.dots() }).collect();
    let checks = separate::check(&sheet, &planned, library.rules());
    let laid = Laid { pieces: vec![area], area, grid: (1, 1), cut: None, marks_left_out: 0 };
    let name = path.file_name().map_or_else(|| "job".into(), |name| name.to_string_lossy().into_owned());
    let subject = Subject {
        name: &name,
        sheet: &sheet,
        laid: &laid,
        passes: &passes,
        planned: &planned,
        checks: &checks,
        page: &page,
    };
    Ok((Plan::new(&subject, library), sheet))
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
