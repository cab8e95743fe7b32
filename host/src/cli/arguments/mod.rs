//! Arguments that several subcommands share, and the settings they mean.

pub mod choice;
pub mod document_dots;
pub mod layout;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use appearance::brdf::Space;
use appearance::gamut::Printable;
use appearance::views::{self, Pictures};
use clap::Args;
use files::shelf::Disk;
use inks::{InkSet, InkSetError, Library, Trust};
use make::choice::{Metric, name};
use make::options::HALFTONE;
use make::print::SEED;
use protocol::ink::{Ink, Kind};
use protocol::rgl::Media;

use appearance::document::{self, ColourSpace, Document};
use appearance::factor::{self, Method};
use appearance::gamut::{self, Intent};

use crate::cli::arguments::choice::{choice, of_page, utf8, whole};
use crate::cli::console::usage;
use crate::libraries;
use observe::Observer;

/// What to read.
#[derive(Args, Debug)]
pub struct DocumentArgs {
    /// Document: a folder of texture maps or its .zip, a .gltf, .glb, .mtlx, .usda, .usdz or .mtl file, a
    /// measured BRDF (.binary, .bsdf, .brdf, .csv), a .foil folder, or sample:NAME
    #[arg(
        value_name = "DOC",
        value_parser = utf8(),
        default_value = "",
        hide_default_value = true,
        required_unless_present_any = ["straight", "hdr"]
    )]
    pub document: String,
    #[command(flatten)]
    pub pictures: PicturesArgs,
    /// Material of a glTF file, by number (from 0) or name [default: the only one]
    #[arg(long, value_name = "NUMBER|NAME")]
    pub material: Option<String>,
    /// Encoding of the colour maps [default: the usual one of their file format]
    #[arg(long, value_name = "SPACE", value_parser = choice::<ColourSpace>())]
    pub colour_space: Option<ColourSpace>,
    /// Number of angles at which each reflectance curve is sampled, 32 to 512; 32 is enough for anything
    /// printable
    #[arg(long, default_value_t = document::SAMPLES, value_parser = whole(32..=512usize))]
    pub samples: usize,
}

/// Pictures to make a document of.
#[derive(Args, Debug, Default)]
pub struct PicturesArgs {
    /// Picture seen straight on, where --highlight names another one that is seen in the reflection of the
    /// light
    #[arg(long, value_name = "PICTURE", requires = "highlight", conflicts_with_all = ["document", "material", "hdr"])]
    pub straight: Option<PathBuf>,
    /// Picture of the same proportions seen in the reflection of the light. What is black in it cannot be
    /// seen: a white mark on black is hidden until the light falls on it
    #[arg(long, value_name = "PICTURE", requires = "straight", conflicts_with_all = ["document", "material", "hdr"])]
    pub highlight: Option<PathBuf>,
    /// Picture with more light than white (.hdr, .exr, float .tif), whose exposure changes as the print is
    /// tilted
    #[arg(long, value_name = "PICTURE", conflicts_with_all = ["document", "material"])]
    pub hdr: Option<PathBuf>,
}

impl PicturesArgs {
    fn pictures(&self) -> Option<Pictures> {
        match (&self.straight, &self.highlight, &self.hdr) {
            (Some(straight), Some(highlight), _) => {
                Some(Pictures::Pair { straight: straight.clone(), highlight: highlight.clone() })
            }
            (_, _, Some(hdr)) => Some(Pictures::Exposures(hdr.clone())),
            _ => None,
        }
    }

    /// The options given, by their long names without dashes.
    pub fn given(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let all = [("straight", &self.straight), ("highlight", &self.highlight), ("hdr", &self.hdr)];
        all.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?)))
    }
}

impl DocumentArgs {
    /// The document of this name, read with the usual options.
    pub fn named(document: String) -> DocumentArgs {
        DocumentArgs {
            document,
            pictures: PicturesArgs::default(),
            material: None,
            colour_space: None,
            samples: document::SAMPLES,
        }
    }

    /// Where the document is; of two pictures, the first. Empty if none was named.
    pub fn path(&self) -> &Path {
        self.pictures.given().next().map_or_else(|| Path::new(&self.document), |(_, path)| path)
    }

    /// Opens the document. The reader notes to the observer what it had to assume. `at_hand` gives the
    /// inks, by which two pictures are kept apart, and their library.
    pub fn open(
        &self,
        at_hand: impl FnOnce() -> Result<(InkSet, Library)>,
        observer: &dyn Observer,
    ) -> Result<Document> {
        if let Some(pictures) = self.pictures.pictures() {
            let (inks, library) = at_hand()?;
            let space = Space::half_angle(self.samples);
            let printable = Printable::combined(&library, &inks, &space);
            let mut document =
                views::open(&Disk, &pictures, self.colour_space, &printable, &space, observer)?;
            document.name.retain(|c| !c.is_control());
            return Ok(document);
        }
        let options = document::Options {
            material: self.material.clone(),
            colour_space: self.colour_space,
            samples: self.samples,
            ..document::Options::default()
        };
        let mut document = match document::open(&self.document, &options, observer) {
            Ok(document) => document,
            Err(error) if art::is_art(&Disk, Path::new(&self.document)) => {
                return Err(anyhow::Error::new(error).context(format!(
                    "{0} is artwork, not a document of materials: `foilpress layers {0}` prints it, `foilpress plan layers {0}` plans it",
                    self.document
                )));
            }
            Err(error @ document::DocumentError::Choice { .. }) => bail!("{error} (--material)"),
            Err(error) => return Err(error.into()),
        };
        // The name may come from a file of unknown origin, and it is shown on the terminal.
        document.name.retain(|c| !c.is_control());
        if document.name.trim().is_empty() {
            document.name = "document".into();
        }
        Ok(document)
    }
}

/// How to factor the document.
#[derive(Args, Debug)]
pub struct FactorArgs {
    /// Number of bases, where the intent uses them [default: as many as the document needs]
    #[arg(long, value_parser = whole(1..=factor::MOST_BASES))]
    pub bases: Option<usize>,
    /// Method that finds the bases: archetypes, or the paper's kmeans (convex hull) and sacls
    #[arg(long = "factor", value_name = "METHOD", default_value = "archetypes", value_parser = choice::<Method>())]
    pub method: Method,
    /// Seed of all random choices; equal seeds give equal prints
    #[arg(long, default_value_t = SEED)]
    pub seed: u64,
}

impl FactorArgs {
    /// Whether something about the bases was chosen.
    pub fn is_chosen(&self) -> bool {
        self.bases.is_some() || self.method != Method::default()
    }

    /// Says that a choice of bases has no effect on a document that has its own.
    pub fn note_unused(&self, document: &Document, observer: &dyn Observer) {
        if self.is_chosen() && document.as_factored().is_some() {
            observer.note(
                "the document came factored and keeps its bases, so --bases and --factor change nothing",
            );
        }
    }

    /// The settings meant.
    pub fn settings(&self) -> factor::FactorSettings {
        factor::FactorSettings {
            method: self.method,
            bases: self.bases,
            seed: self.seed,
            ..factor::FactorSettings::default()
        }
    }
}

/// What to print with.
#[derive(Args, Clone, Debug)]
pub struct InkArgs {
    /// Inks to print with, such as process,MS or -finish [default: all but the foils, and
    /// but primer on plain paper]
    ///
    /// Names and the groups process, metallic, clear, foil, default, all, separated by commas; a leading -
    /// removes one from the default.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub inks: Option<String>,
    /// Your own ink library: its folder, or the name it was added under [default: the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    pub library: Option<PathBuf>,
    /// Curves of the library to rely on; stacks with other curves are not printed. Bare paper is always there
    #[arg(long, value_name = "CURVES", default_value = "all", value_parser = choice::<Trust>())]
    pub trust: Trust,
}

impl InkArgs {
    /// These inks of this library, whatever the origin of its curves.
    pub fn of(inks: Option<String>, library: Option<PathBuf>) -> InkArgs {
        InkArgs { inks, library, trust: Trust::All }
    }

    /// The inks to print with and the library, which has at least one stack of them.
    pub fn at_hand(&self) -> Result<(InkSet, Library)> {
        let (set, library) = (self.set()?, self.library()?);
        let none =
            |library: &Library| library.at_hand(&set).iter().all(|entry| entry.stack.layers().is_empty());
        if self.trust != Trust::All && none(&library) && !none(&library.clone().trusting(Trust::All)) {
            bail!(
                "--trust {}: the library has no such curve of a stack made only of {set}; `foilpress inks list` says where each \
                 curve comes from",
                name(self.trust)
            );
        }
        if none(&library) {
            bail!(
                "--inks: the library has no stack made only of {set}; `foilpress inks list` shows the stacks it has"
            );
        }
        Ok((set, library))
    }

    /// The same for a document on a sheet of this kind: without primer where its ribbon can tear, and
    /// without what nobody has named.
    pub fn on(&self, media: Media) -> Result<AtHand> {
        let (inks, library) = self.at_hand()?;
        let is_plain = matches!(media, Media::Plain | Media::PlainTwice);
        let torn = |ink: &Ink| is_plain && ink.kind() == Kind::Primer && !self.names(*ink);
        let kept = InkSet::of(inks.iter().filter(|ink| !torn(ink)));
        if kept.is_empty() {
            return Ok(AtHand { inks, held_back: InkSet::EMPTY, library });
        }
        let foils = Ink::ALL.into_iter().filter(|ink| ink.kind() == Kind::Foil && self.inks.is_none());
        let held_back = InkSet::of(inks.iter().filter(torn).chain(foils));
        Ok(AtHand { inks: kept, held_back, library })
    }

    /// Whether the owner has asked for an ink, by its name or that of a group other than the default.
    fn names(&self, ink: Ink) -> bool {
        let words = self.inks.iter().flat_map(|text| text.split(',')).map(str::trim);
        let asked = words.filter(|word| !word.starts_with('-')).map(|word| word.trim_start_matches('+'));
        asked.filter(|word| !word.eq_ignore_ascii_case("default")).any(|word| {
            let set: Result<InkSet, InkSetError> = word.parse();
            set.is_ok_and(|set| set.contains(ink))
        })
    }

    fn set(&self) -> Result<InkSet> {
        let set: InkSet = match &self.inks {
            Some(text) => text.parse().map_err(|error: InkSetError| usage(format!("--inks: {error}")))?,
            None => InkSet::default(),
        };
        if set.is_empty() {
            return Err(usage("--inks leaves no ink to print with"));
        }
        Ok(set)
    }

    /// The library, trusted as far as was asked.
    pub fn library(&self) -> Result<Library> {
        Ok(libraries::given(self.library.as_deref())?.trusting(self.trust))
    }
}

/// The inks to print a document with.
#[derive(Clone)]
pub struct AtHand {
    /// Those to mix.
    pub inks: InkSet,
    /// Those that are there, or might be, and wait until the owner names them.
    pub held_back: InkSet,
    /// Their library.
    pub library: Library,
}

/// How mixtures become dots.
#[derive(Args, Debug)]
pub struct HalftoneArg {
    #[arg(long, value_name = "METHOD", help = HALFTONE.help, value_parser = of_page(&HALFTONE, |choices| choices.halftone))]
    pub halftone: Option<halftone::Method>,
}

/// How to map materials to the inks.
#[derive(Args, Debug)]
pub struct GamutArgs {
    /// How to treat materials that no ink can make
    ///
    /// basis keeps their differences (the paper's way), clamp keeps each one as close as possible, blend
    /// lies between, contrast keeps differences between neighbours, auto clamps unless that would make
    /// different materials look alike that blend keeps apart.
    #[arg(long, value_name = "INTENT", default_value = "auto", value_parser = choice::<Intent>())]
    pub intent: Intent,
    /// What "close" means
    ///
    /// light counts how much light a material returns beside the shape of its highlight, so that metals
    /// shine; paper is the distance of the 2009 paper, which counts the shape alone.
    #[arg(long, value_name = "METRIC", default_value = "light", value_parser = choice::<Metric>())]
    pub metric: Metric,
}

impl GamutArgs {
    /// The settings meant.
    pub fn settings(&self, seed: u64) -> gamut::GamutSettings {
        gamut::GamutSettings {
            intent: self.intent,
            light: self.metric.light(),
            seed,
            ..gamut::GamutSettings::default()
        }
    }
}
