//! Every step of the chain by itself: each command reads what the one before it wrote. Together they give
//! the job of `print`, since the steps are the ones that `pipeline` is made of.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use crate::cli::arguments::choice::{choice, utf8};
use crate::cli::arguments::layout::{LayoutArgs, MediaArgs};
use crate::cli::arguments::{AtHand, DocumentArgs, FactorArgs, GamutArgs, HalftoneArg, InkArgs};
use crate::cli::console::print_job;
use crate::cli::output::{self, Kind, Staged};
use appearance::document::foil::{self, Origin};
use appearance::document::{self, ColourSpace, Document};
use appearance::edit::fingerprint;
use appearance::factor::Factored;
use appearance::gamut::files::Provenance;
use appearance::gamut::{self, GamutError, Printable};
use files::shelf::Disk;
use halftone::metrics;
use observe::Observer;
use press::layout;
use press::pipeline::{self, document as stages};
use press::separate;
use protocol::paper::Paper;
use protocol::rgl::{Media, Resolution};
use sheet::DotMap;
use sheet::Size;

/// Where a result goes: the place named, else the current folder under the name of what it is made from.
fn named(output: &Option<PathBuf>, from: &Path, ending: &str) -> PathBuf {
    output
        .clone()
        .unwrap_or_else(|| format!("{}.{ending}", output::file_name(&document::name_of(&Disk, from))).into())
}

/// Arguments of `factor`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress factor my-material/ --bases 6 -o my-material.foil")]
pub struct Factor {
    #[command(flatten)]
    document: DocumentArgs,
    #[command(flatten)]
    factor: FactorArgs,
    /// Folder to write: bases.csv, weight maps as pictures, document.toml [default: DOC.foil in the current
    /// folder]
    #[arg(short, long, value_name = "DOC.foil")]
    output: Option<PathBuf>,
}

impl Factor {
    /// Document → bases and weight maps.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let document = self.document.open(|| InkArgs::of(None, None).at_hand(), observer)?;
        let usual = || format!("{}.foil", output::file_name(&document.name)).into();
        let staged = Staged::folder(&self.output.clone().unwrap_or_else(usual), Kind::Foil)?;
        let (factored, report) = stages::factored(&document, &self.factor.settings(), observer)?;
        if let Some(report) = report {
            observer.note(&report.to_string());
        }
        self.factor.note_unused(&document, observer);
        let origin = Origin { document: document.digest.clone(), result: fingerprint(&factored) };
        foil::write(&factored, &document.name, document.size_mm, Some(origin), staged.path())?;
        staged.commit()
    }
}

/// Arguments of `map`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Example:\n  foilpress map my-material.foil --intent basis --inks process,MS -o my-material.mix"
)]
pub struct Map {
    /// Folder written by `factor`
    #[arg(value_name = "DOC.foil")]
    factored: PathBuf,
    /// Document that was factored, so that clamp and blend use its own pixels instead of mixtures of the
    /// bases
    #[arg(long, value_name = "DOC", value_parser = utf8())]
    document: Option<String>,
    /// Material of that document, as given to `factor`
    #[arg(long, value_name = "NUMBER|NAME", requires = "document")]
    material: Option<String>,
    /// Encoding of that document's colour maps, as given to `factor`
    #[arg(long, value_name = "SPACE", requires = "document", value_parser = choice::<ColourSpace>())]
    colour_space: Option<ColourSpace>,
    #[command(flatten)]
    gamut: GamutArgs,
    #[command(flatten)]
    inks: InkArgs,
    /// Seed of the random sample of pixels by which cartridges are chosen
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder to write: weight maps over stacks as pictures, mix.toml [default: DOC.mix in the current
    /// folder]
    #[arg(short, long, value_name = "DOC.mix")]
    output: Option<PathBuf>,
}

impl Map {
    /// Bases → mixtures of stacks.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let AtHand { inks, library, .. } = self.inks.on(Media::default())?;
        let read = foil::read(&Disk, &self.factored, observer)?;
        let (factored, _) = stages::factored(&read, &Default::default(), observer)?;
        let document = self
            .document
            .as_ref()
            .map(|spec| {
                let samples = factored.space.angles().len();
                let options = document::Options {
                    material: self.material.clone(),
                    colour_space: self.colour_space,
                    samples,
                    ..document::Options::default()
                };
                document::open(spec, &options, observer)
            })
            .transpose()?;
        if let Some(document) = &document {
            self.check_origin(document, &factored, observer)?;
        }
        let staged = Staged::folder(&named(&self.output, &self.factored, "mix"), Kind::Mix)?;
        let printable = Printable::combined(&library, &inks, &factored.space);
        let materials = document.as_ref().map(|document| document.materials());
        let pixels = materials.unwrap_or(&*factored);
        let bases = || Ok::<_, GamutError>(Cow::Borrowed(&*factored));
        let mapped = gamut::map(pixels, bases, &printable, &self.gamut.settings(self.seed), observer)?;
        let provenance = Provenance {
            document: read.name.clone(),
            mapping: format!("intent {:?}, seed {}", mapped.report.intent, self.seed),
            library: library.name().into(),
            size_mm: read.size_mm,
        };
        gamut::files::save(&mapped.mix, &provenance, staged.path())?;
        staged.commit()
    }

    /// With a document its pixels are mapped, and only their bases come from what was factored: so it must
    /// be the one that was factored, and nothing may have been changed since.
    fn check_origin(&self, document: &Document, factored: &Factored, observer: &dyn Observer) -> Result<()> {
        let problem = match foil::origin(&Disk, &self.factored, observer)? {
            None => "it was edited, or made by hand",
            Some(origin) if origin.document != document.digest => "it was factored from another document",
            Some(origin) if origin.result != fingerprint(factored) => {
                "its bases or weights were changed since it was factored"
            }
            Some(_) => return Ok(()),
        };
        bail!(
            "{}: {problem}, and --document maps the pixels of the document itself; leave --document out to map what is in {}",
            self.factored.display(),
            self.factored.display()
        )
    }
}

/// Arguments of `halftone`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress halftone my-material.mix --size 120x90mm -o my-material.dots")]
pub struct Halftone {
    /// Folder written by `map`
    #[arg(value_name = "DOC.mix")]
    mix: PathBuf,
    /// Size on paper, such as 120x90mm, 12cm or 5x4in; the document keeps its proportions
    /// [default: the document's own size, else as large as a4 allows]
    #[arg(long)]
    size: Option<Size>,
    #[command(flatten)]
    halftone: HalftoneArg,
    /// Your own ink library: its folder, or the name it was added under; its minimum clusters apply
    /// [default: the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    library: Option<PathBuf>,
    /// Folder to write: a picture with one stack for every dot, dots.toml [default: DOC.dots in the current
    /// folder]
    #[arg(short, long, value_name = "DOC.dots")]
    output: Option<PathBuf>,
}

impl Halftone {
    /// Mixtures → one stack for every dot.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let library = InkArgs::of(None, self.library.clone()).library()?;
        let (mix, provenance) = gamut::files::load(&self.mix)?;
        let pixels = (mix.maps.width(), mix.maps.height());
        // Whether it fits its paper is the layout's business; only the largest sheet is a limit here.
        let any = layout::Layout { cut: true, ..layout::Layout::centred(Paper::A4) };
        let size = layout::size::dots(pixels, provenance.size_mm, self.size, &any)?;
        let staged = Staged::folder(&named(&self.output, &self.mix, "dots"), Kind::Dots)?;
        let settings = halftone::Settings {
            method: self.halftone.halftone.unwrap_or_default(),
            ..halftone::Settings::from_library(&mix.stacks, &library)
        };
        let dots = halftone::halftone(&mix, size, None, &settings, observer)?;
        dots.save(staged.create()?)?;
        if let Some(look) = metrics::look(&mix, &dots, &settings)? {
            observer.note(&look.to_string());
        }
        staged.commit()
    }
}

/// Arguments of `layout`.
#[derive(ClapArgs, Debug)]
#[command(
    after_help = "Example:\n  foilpress layout my-material.dots --paper letter --repeat 2x3 --gap 3mm -o my-material.sheet"
)]
pub struct Layout {
    /// A folder made by `halftone`
    #[arg(value_name = "DOC.dots")]
    dots: PathBuf,
    #[command(flatten)]
    layout: LayoutArgs,
    /// Folder to write: one stack for every dot of the page as a picture, sheet.toml, layout.toml
    /// [default: DOC.sheet in the current folder]
    #[arg(short, long, value_name = "DOC.sheet")]
    output: Option<PathBuf>,
}

impl Layout {
    /// Dots → a page.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let layout = self.layout.layout(observer)?;
        let dots = DotMap::load(&self.dots)?;
        let staged = Staged::folder(&named(&self.output, &self.dots, "sheet"), Kind::Sheet)?;
        layout::arrange(&dots, &layout, observer)?.save(staged.create()?)?;
        staged.commit()
    }
}

/// Arguments of `separate`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress separate my-material.sheet -o my-material.passes")]
pub struct Separate {
    /// Folder written by `layout` or `simulate`
    #[arg(value_name = "DOC.sheet")]
    sheet: PathBuf,
    /// Your own ink library: its folder, or the name it was added under; its order rules apply [default:
    /// the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    library: Option<PathBuf>,
    /// Folder to write: a one-bit picture for each pass, passes.toml [default: DOC.passes in the current
    /// folder]
    #[arg(short, long, value_name = "DOC.passes")]
    output: Option<PathBuf>,
}

impl Separate {
    /// A page → one-bit passes.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let library = InkArgs::of(None, self.library.clone()).library()?;
        let layout::Arranged { sheet, laid } = layout::Arranged::load(&self.sheet)?;
        let staged = Staged::folder(&named(&self.output, &self.sheet, "passes"), Kind::Passes)?;
        let separation = pipeline::separate_page(&sheet, &laid, &library, observer)?;
        pipeline::permit(&separation)?;
        for check in &separation.checks {
            match check.severity {
                inks::Severity::Note => observer.note(&check.text),
                inks::Severity::Warning | inks::Severity::Error => observer.note(&check.to_string()),
            }
        }
        separate::files::save(&separation, Resolution::Dpi600.dpi(), staged.create()?)?;
        staged.commit()
    }
}

/// Arguments of `encode`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress encode my-material.passes -o job.rgl")]
pub struct Encode {
    /// Folder written by `separate`
    #[arg(value_name = "DOC.passes")]
    passes: PathBuf,
    #[command(flatten)]
    media: MediaArgs,
    /// Allow foil; its ink codes have never been seen on hardware, and it needs process ink beneath it
    #[arg(long)]
    foil: bool,
    /// File to write [default: DOC.rgl in the current folder]
    #[arg(short, long, value_name = "JOB.rgl")]
    output: Option<PathBuf>,
}

impl Encode {
    /// Passes → the printer's language.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let saved = separate::files::load(&self.passes)?;
        let output = named(&self.output, &self.passes, "rgl");
        let staged = Staged::file(&output)?;
        let allowed = if self.foil { inks::InkSet::ALL } else { inks::InkSet::default() };
        let job = pipeline::encode(saved.paper, self.media.handling(), &saved.passes, &allowed, observer)?;
        fs::write(staged.path(), job).with_context(|| format!("cannot write {}", output.display()))?;
        staged.commit()
    }
}

/// Arguments of `simulate`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Example:\n  foilpress simulate job.rgl -o printed.sheet")]
pub struct Simulate {
    /// Job in the printer's language
    #[arg(value_name = "JOB.rgl")]
    job: PathBuf,
    /// Folder to write: the sheet that the simulated printer made
    #[arg(short, long, value_name = "SHEET")]
    output: PathBuf,
}

impl Simulate {
    /// The printer's language → the sheet that comes out.
    pub fn run(&self, observer: &dyn Observer) -> Result<()> {
        let staged = Staged::folder(&self.output, Kind::Sheet)?;
        print_job(&self.job, observer)?.save(staged.create()?)?;
        staged.commit()
    }
}
