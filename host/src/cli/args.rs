//! Arguments that several subcommands share, and the settings they mean.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use inks::{InkSet, Library};
use protocol::paper::Paper;

use appearance::document::{self, ColourSpace, Document};
use appearance::factor::{self, Method};
use appearance::gamut::{self, Intent};
use press::job::placement::Size;
use press::layers;
use press::layout;

use super::choice::choice;
use observe::Observer;

/// What to read.
#[derive(Args, Debug)]
pub struct DocumentArgs {
    /// A folder of texture maps, a .gltf or .glb file, a measured BRDF (.binary, .bsdf, .csv), a .foil folder, or
    /// sample:NAME
    #[arg(value_name = "DOC")]
    pub document: String,
    /// Which material of a glTF file, by number (from 0) or name
    #[arg(long, value_name = "NUMBER|NAME")]
    pub material: Option<String>,
    /// Encoding of the colour maps, if it is not the usual one of their file format
    #[arg(long, value_name = "SPACE", value_parser = choice::<ColourSpace>())]
    pub colour_space: Option<ColourSpace>,
    /// Angles each reflectance curve is sampled at, 32 to 512; 32 is enough for everything printable
    #[arg(long, default_value_t = document::SAMPLES, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(32..=512))]
    pub samples: usize,
}

impl DocumentArgs {
    /// Opens the document; what the reader decided it tells the observer itself.
    pub fn open(&self, observer: &dyn Observer) -> Result<Document> {
        let options = document::Options {
            material: self.material.clone(),
            colour_space: self.colour_space,
            samples: self.samples,
        };
        let mut document = match document::open(&self.document, &options, observer) {
            Ok(document) => document,
            Err(error) if layers::is_art(Path::new(&self.document)) => {
                return Err(anyhow::Error::new(error).context(format!(
                    "{0} is art, not a material: `foilpress layers {0}` prints it, `foilpress plan layers {0}` plans it",
                    self.document
                )));
            }
            Err(error @ document::DocumentError::Choice { .. }) => bail!("{error} (--material)"),
            Err(error) => return Err(error.into()),
        };
        // A name may come from anybody's file, and is shown on the terminal.
        document.name.retain(|c| !c.is_control());
        if document.name.trim().is_empty() {
            document.name = "document".into();
        }
        Ok(document)
    }
}

/// How to take the document apart.
#[derive(Args, Debug)]
pub struct FactorArgs {
    /// Number of bases [default: as many as the document needs]
    #[arg(long, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=factor::MOST_BASES as u64))]
    pub bases: Option<usize>,
    /// How bases are learnt: archetypes, or the paper's kmeans (convex hull) and sacls
    #[arg(long = "factor", value_name = "METHOD", default_value = "archetypes", value_parser = choice::<Method>())]
    pub method: Method,
    /// Seed of everything that is left to chance; equal seeds give equal prints
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl FactorArgs {
    /// The settings meant.
    pub fn settings(&self) -> factor::Settings {
        factor::Settings {
            method: self.method,
            bases: self.bases,
            seed: self.seed,
            ..factor::Settings::default()
        }
    }
}

/// What to print with.
#[derive(Args, Debug)]
pub struct InkArgs {
    /// Inks at hand: names and the groups process, metallic, clear, foil, default, all, joined by commas; a leading
    /// - takes one away from the default [default: all but the foils]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub inks: Option<String>,
    /// Folder of an ink library of your own, such as one you measured
    #[arg(long, value_name = "DIR")]
    pub library: Option<PathBuf>,
}

impl InkArgs {
    /// The inks at hand and the library, which has a stack of them.
    pub fn at_hand(&self) -> Result<(InkSet, Library)> {
        let (set, library) = (self.set()?, self.library()?);
        if library.at_hand(&set).iter().all(|entry| entry.stack.layers().is_empty()) {
            bail!("--inks: there is no stack of {set} alone; `foilpress inks list` shows what goes together");
        }
        Ok((set, library))
    }

    fn set(&self) -> Result<InkSet> {
        let set: InkSet = match &self.inks {
            Some(text) => text.parse()?,
            None => InkSet::default(),
        };
        if set.is_empty() {
            bail!("--inks leaves no ink to print with");
        }
        Ok(set)
    }

    /// The library.
    pub fn library(&self) -> Result<Library> {
        Ok(match &self.library {
            Some(folder) => Library::from_dir(folder)?,
            None => Library::builtin(),
        })
    }
}

/// How to fit materials to the inks.
#[derive(Args, Debug)]
pub struct GamutArgs {
    /// What to do with materials no ink can make: basis keeps differences (the paper), clamp keeps closest, blend is
    /// between, auto clamps unless that would make different materials look alike
    #[arg(long, value_name = "INTENT", default_value = "auto", value_parser = choice::<Intent>())]
    pub intent: Intent,
}

impl GamutArgs {
    /// The settings meant.
    pub fn settings(&self, seed: u64) -> gamut::Settings {
        gamut::Settings { intent: self.intent, seed, ..gamut::Settings::default() }
    }
}

/// Where and how large.
#[derive(Args, Debug)]
pub struct PageArgs {
    /// Size on paper, such as 120x90mm, 12cm or 5x4in; the document keeps its shape and is centred
    /// [default: the document's own size, else as large as the page allows]
    #[arg(long)]
    pub size: Option<Size>,
    /// Paper: a4, letter, legal, executive, b5, postcard, or the size of the sheet such as 120x180mm
    #[arg(long, default_value = "a4", value_parser = layout::paper::read)]
    pub paper: Paper,
}
