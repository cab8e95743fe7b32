//! `foilpress compare`: photographs of a printed sheet beside its prediction.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;
use inks::Library;
use make::Print;

use crate::cli::arguments::document_dots::DotsArgs;
use crate::cli::commands::preset::PresetArg;
use crate::cli::commands::preview::subject::{is_printed, printed, printed_name};
use crate::cli::console::{print_job, show};
use crate::cli::output::Staged;
use appearance::factor::Factored;
use measure::compare::{
    CompareSetup, ComparedDocument, ComparedPrint, Comparison, Errors, Factor, PhotoFigures, compare, page,
    space,
};
use observe::Observer;
use press::layout::{Layout, arrange};
use press::simulate;
use sheet::{Area, DotMap};
use view::mapped;

/// Arguments of `compare`.
#[derive(ClapArgs, Debug)]
#[command(
    args_override_self = true,
    mut_arg("document", |arg| arg.required_unless_present("photos").help(
        "What was printed: a document as given to `print`, with the same options; a job (.rgl); or a folder written by `layout` or \
         `simulate`"
    )),
    after_help = "Examples:\n  \
    foilpress compare photos/ sample:leaf --size 60mm --camera camera.toml     (with the options of `print`)\n  \
    foilpress compare photos/ --job job.rgl --camera camera.toml               (the print alone, without the document)\n\n\
    Print with --camera-marks, photograph the flat sheet under one lamp at a time with all four marks in the picture, and say in\n\
    camera.toml where the lamps stood. The marks tell sheet and camera; the paper around them sets exposure and white\n\
    balance. docs/guide/compare.md shows it step by step."
)]
pub struct Args {
    /// Folder of photographs: TIFF, PNG, OpenEXR, JPEG, or camera RAW where LibRaw's tools are installed
    #[arg(value_name = "PHOTOS")]
    photos: PathBuf,
    #[command(flatten)]
    dots: DotsArgs,
    #[command(flatten)]
    preset: PresetArg,
    /// Job that was printed. With a document as well, it has to be the job of that document
    #[arg(long, value_name = "JOB.rgl")]
    job: Option<PathBuf>,
    /// Camera file: where the lamps stood, and what is known of the camera
    #[arg(long, value_name = "FILE.toml")]
    camera: PathBuf,
    /// Page to write, with sliders between photographs and prediction [default: compare.html in the folder of photographs]
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

/// Stacks named for a photograph.
const STACKS: usize = 4;

/// What was printed.
struct Work {
    name: String,
    sheet: DotMap,
    library: Library,
    document: Option<(Factored, Factored, Area)>,
}

/// Runs `compare`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let setup = CompareSetup::read(&args.camera)?;
    if !args.photos.is_dir() {
        bail!("{}: not a folder; expected the folder of the photographs", args.photos.display());
    }
    let output = args.output.clone().unwrap_or_else(|| args.photos.join("compare.html"));
    let staged = Staged::file(&output)?;
    let work = args.work(observer)?;
    let printed = ComparedPrint {
        sheet: &work.sheet,
        library: &work.library,
        document: work.document.as_ref().map(|(document, mapped, area)| ComparedDocument {
            document,
            mapped,
            area: *area,
        }),
    };
    let (comparison, pictures) = compare(&args.photos, &setup, &printed, observer)?;
    for warning in &comparison.warnings {
        observer.note(warning);
    }
    let text = page::html(&work.name, &comparison, &pictures);
    std::fs::write(staged.path(), text).with_context(|| format!("cannot write {}", output.display()))?;
    staged.commit()?;
    if args.json {
        let mut json = serde_json::to_value(&comparison)?;
        json["written"] = output.display().to_string().into();
        return show(&format!("{}\n", serde_json::to_string_pretty(&json)?));
    }
    show(&summary(&comparison, &output))
}

impl Args {
    fn work(&self, observer: &dyn Observer) -> Result<Work> {
        let path = self.dots.document.path();
        if path.as_os_str().is_empty() {
            let Some(job) = &self.job else {
                bail!("say what was printed: a document with the options of `print`, or --job JOB.rgl");
            };
            return self.alone(job, observer);
        }
        if self.job.is_none() && is_printed(path) {
            return self.alone(path, observer);
        }
        if self.dots.layout.mirror {
            bail!(
                "--mirror: a mirrored print is compared without its document; leave DOC out and give --job"
            );
        }
        let prepared = self.dots.dots(observer)?;
        let layout = Layout { camera_marks: true, ..prepared.settings.page.layout.clone() };
        let page = arrange(&prepared.halftoned.dots, &layout, observer)?;
        if let Some(job) = &self.job
            && let Some(difference) = simulate::difference(&page.sheet, &print_job(job, observer)?)
        {
            bail!(
                "{}: not the job of {} with these options ({difference}); give the options that it was printed with, \
                     --camera-marks included, or leave DOC out",
                job.display(),
                path.display()
            );
        }
        let Some(&area) = page.laid.copies.first() else {
            bail!("nothing of the document lies on the sheet")
        };
        let target = prepared.bases(observer)?;
        let Print { document, settings, halftoned, .. } = prepared;
        let library = settings.library;
        let mixture = mapped(halftoned.mapped.mix, &library, &space());
        let sheet = page.sheet.dots().clone();
        Ok(Work { name: document.name, sheet, library, document: Some((target, mixture, area)) })
    }

    /// Printed dots without the document that they are of.
    fn alone(&self, path: &Path, observer: &dyn Observer) -> Result<Work> {
        let Some(sheet) = printed(path, observer)? else {
            bail!("{}: not a job; the name of a job ends in .rgl", path.display());
        };
        let name = printed_name(path);
        let library = self.dots.inks.library()?;
        Ok(Work { name, sheet, library, document: None })
    }
}

fn summary(comparison: &Comparison, output: &Path) -> String {
    let mut text = format!("{:<20} {:>5} {:>5} {:>5} {:>9}", "photograph", "light", "view", "half", "error");
    if comparison.document {
        let _ = write!(text, " {:>8} {:>9}", "gamut", "halftone");
    }
    let _ = writeln!(text, " {:>8} {:>8}", "inks", "rest");
    let line = |errors: &Errors| {
        let mut line = format!(" {:>7.1} %", 100.0 * errors.total);
        if let (Some(gamut), Some(halftone)) = (errors.gamut, errors.halftone) {
            let _ = write!(line, " {:>6.1} % {:>7.1} %", 100.0 * gamut, 100.0 * halftone);
        }
        let _ = writeln!(line, " {:>6.1} % {:>6.1} %", 100.0 * errors.inks, 100.0 * errors.rest);
        line
    };
    for photo in &comparison.photos {
        let [light, view, half] = photo.angles_deg;
        let _ =
            write!(text, "{:<20} {light:>4.0}° {view:>4.0}° {half:>4.0}°{}", photo.name, line(&photo.errors));
    }
    if comparison.photos.len() > 1 {
        let _ = write!(text, "{:<20} {:>5} {:>5} {:>5}{}", "all", "", "", "", line(&comparison.errors));
    }
    let from = if comparison.document { "document" } else { "predicted print" };
    let _ = writeln!(
        text,
        "\nerror: root mean square difference of the photograph's light from the {from}, over spots 1 mm wide"
    );
    for photo in &comparison.photos {
        let _ = writeln!(text, "{}", stacks(photo));
    }
    let _ = writeln!(text, "{}", output.display());
    text
}

/// The stacks that are brighter or darker in a photograph than predicted.
fn stacks(photo: &PhotoFigures) -> String {
    let differ: Vec<&Factor> = photo.stacks.iter().filter(|factor| factor.differs).collect();
    if differ.is_empty() {
        return format!(
            "{}: no stack differs from its prediction by more than four standard errors and 1 %",
            photo.name
        );
    }
    let told = differ.iter().take(STACKS).map(|factor| {
        let rgb = factor.factor.map(|value| format!("{value:.3}")).join(" ");
        let error = factor.standard_error.iter().copied().fold(0.0, f64::max);
        format!("{} {rgb} (± {error:.3})", factor.stack)
    });
    let more = if differ.len() > STACKS { ", and others" } else { "" };
    format!(
        "{}: photographed over predicted light (red, green, blue): {}{more}",
        photo.name,
        told.collect::<Vec<_>>().join(", ")
    )
}
