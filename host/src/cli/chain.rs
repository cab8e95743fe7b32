//! Every arrow of the chain by itself: each command reads what the one before it wrote.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use super::args::{DocumentArgs, FactorArgs, GamutArgs, InkArgs, PageArgs};
use super::choice::choice;
use super::layout::MediaArgs;
use super::output::{Kind, Staged};
use appearance::document::{self, ColourSpace, foil};
use appearance::gamut::files::Provenance;
use appearance::gamut::{self, Printable};
use observe::Observer;
use press::job::placement;
use press::separate::{self, Severity};
use press::sheet::Sheet;
use press::{pipeline, simulate};

/// Arguments of `factor`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress factor my-material/ --bases 6 -o my-material.foil")]
pub struct Factor {
    #[command(flatten)]
    document: DocumentArgs,
    #[command(flatten)]
    factor: FactorArgs,
    /// Folder to write: bases.csv, weight maps as pictures, document.toml
    #[arg(short, long, value_name = "DOC.foil")]
    output: PathBuf,
}

impl Factor {
    /// Document → bases and weight maps.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let document = self.document.open(observer)?;
        let staged = Staged::folder(&self.output, Kind::Foil)?;
        let (factored, report) = pipeline::factor_document(&document, &self.factor.settings(), observer)?;
        if let Some(report) = report {
            observer.note(&report.to_string());
        }
        foil::write(&factored, &document.name, document.size_mm, staged.path())?;
        staged.commit()
    }
}

/// Arguments of `map`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Example:\n  foilpress map my-material.foil --intent basis --inks process,MS -o my-material.mix"
)]
pub struct Map {
    /// A folder made by `factor`
    #[arg(value_name = "DOC.foil")]
    factored: PathBuf,
    /// The document it was made from, so that clamp and blend see its own pixels instead of the bases' mixtures
    #[arg(long, value_name = "DOC")]
    document: Option<String>,
    /// Which material of that document, as it was given to `factor`
    #[arg(long, value_name = "NUMBER|NAME", requires = "document")]
    material: Option<String>,
    /// Encoding of that document's colour maps, as it was given to `factor`
    #[arg(long, value_name = "SPACE", requires = "document", value_parser = choice::<ColourSpace>())]
    colour_space: Option<ColourSpace>,
    #[command(flatten)]
    gamut: GamutArgs,
    #[command(flatten)]
    inks: InkArgs,
    /// Seed of the sample of pixels that cartridges are chosen by
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder to write: weight maps over stacks as pictures, mix.toml
    #[arg(short, long, value_name = "DOC.mix")]
    output: PathBuf,
}

impl Map {
    /// Bases → mixtures of stacks.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let (set, library) = self.inks.at_hand()?;
        let read = foil::read_watched(&self.factored, observer)?;
        let (factored, _) = pipeline::factor_document(&read, &Default::default(), observer)?;
        let document = self
            .document
            .as_ref()
            .map(|spec| {
                let samples = factored.space.angles().len();
                let options = document::Options {
                    material: self.material.clone(),
                    colour_space: self.colour_space,
                    samples,
                };
                document::open(spec, &options, observer)
            })
            .transpose()?;
        let staged = Staged::folder(&self.output, Kind::Mix)?;
        let printable = Printable::from_library(&library, &set, &factored.space);
        let materials = document.as_ref().map(|document| document.materials());
        let mapped = gamut::map(&factored, materials, &printable, &self.gamut.settings(self.seed), observer)?;
        let provenance = Provenance {
            document: read.name.clone(),
            mapping: format!("intent {:?}, seed {}", mapped.report.intent, self.seed),
            library: library.name().into(),
            size_mm: read.size_mm,
        };
        gamut::files::save(&mapped.mix, &provenance, staged.path())?;
        staged.commit()
    }
}

/// Arguments of `halftone`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress halftone my-material.mix --size 120x90mm -o my-material.sheet")]
pub struct Halftone {
    /// A folder made by `map`
    #[arg(value_name = "DOC.mix")]
    mix: PathBuf,
    #[command(flatten)]
    page: PageArgs,
    /// How dots are chosen
    #[arg(long, value_name = "METHOD", default_value = "walk", value_parser = choice::<press::halftone::Method>())]
    halftone: press::halftone::Method,
    /// Folder of an ink library of your own: its minimum clusters count
    #[arg(long, value_name = "DIR")]
    library: Option<PathBuf>,
    /// Folder to write: one stack for every dot as a picture, sheet.toml
    #[arg(short, long, value_name = "DOC.sheet")]
    output: PathBuf,
}

impl Halftone {
    /// Mixtures → one stack for every dot.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let library = InkArgs { inks: None, library: self.library.clone() }.library()?;
        let (mix, provenance) = gamut::files::load(&self.mix)?;
        let pixels = (mix.maps.width(), mix.maps.height());
        let placement = placement::place(pixels, provenance.size_mm, self.page.size, self.page.paper)?;
        let staged = Staged::folder(&self.output, Kind::Sheet)?;
        let sheet = pipeline::halftone_mix(&mix, &library, &placement, self.halftone, observer)?;
        sheet.save(staged.create()?)?;
        staged.commit()
    }
}

/// Arguments of `separate`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress separate my-material.sheet -o my-material.passes")]
pub struct Separate {
    /// A folder made by `halftone` or `simulate`
    #[arg(value_name = "DOC.sheet")]
    sheet: PathBuf,
    /// Folder of an ink library of your own: its order rules count
    #[arg(long, value_name = "DIR")]
    library: Option<PathBuf>,
    /// Folder to write: a one-bit picture for each pass, passes.toml
    #[arg(short, long, value_name = "DOC.passes")]
    output: PathBuf,
}

impl Separate {
    /// Sheet → one-bit passes.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let library = InkArgs { inks: None, library: self.library.clone() }.library()?;
        let sheet = Sheet::load(&self.sheet)?;
        let staged = Staged::folder(&self.output, Kind::Passes)?;
        let separation = separate::separate(&sheet, library.rules(), observer)?;
        for check in &separation.checks {
            match check.severity {
                Severity::Error => bail!("this must not be printed: {}", check.with_stacks()),
                Severity::Warning => observer.note(&check.to_string()),
                Severity::Note => observer.note(&check.text),
            }
        }
        separate::files::save(&separation, staged.create()?)?;
        staged.commit()
    }
}

/// Arguments of `encode`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress encode my-material.passes -o job.rgl")]
pub struct Encode {
    /// A folder made by `separate`
    #[arg(value_name = "DOC.passes")]
    passes: PathBuf,
    #[command(flatten)]
    media: MediaArgs,
    /// Yes, print foil: its codes were never seen on hardware, and it needs process ink beneath it
    #[arg(long)]
    foil: bool,
    /// File to write
    #[arg(short, long, value_name = "JOB.rgl")]
    output: PathBuf,
}

impl Encode {
    /// Passes → the printer's language.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let saved = separate::files::load(&self.passes)?;
        let staged = Staged::file(&self.output)?;
        let inks = if self.foil { inks::InkSet::ALL } else { inks::InkSet::default() };
        let job = pipeline::job_on(self.media.page(saved.paper), &saved.passes, &inks, observer)?;
        fs::write(staged.path(), job).with_context(|| format!("cannot write {}", self.output.display()))?;
        staged.commit()
    }
}

/// Arguments of `simulate`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress simulate job.rgl -o printed.sheet")]
pub struct Simulate {
    /// A job in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Folder to write: the sheet the simulated printer made
    #[arg(short, long, value_name = "SHEET")]
    output: PathBuf,
}

impl Simulate {
    /// The printer's language → the sheet that comes out.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let job = super::read_job(&self.job)?;
        let staged = Staged::folder(&self.output, Kind::Sheet)?;
        let printout = simulate::print(&job, &simulate::Setup::default(), observer)
            .with_context(|| format!("{}", self.job.display()))?;
        printout.sheet()?.save(staged.create()?)?;
        staged.commit()
    }
}
