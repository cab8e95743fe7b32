//! `foilpress edit`: change the basis materials of a document, everywhere or under a mask.
//!
//! One command makes one step, or replays a file of them. The edited document is a new folder, which also keeps all steps
//! since the document that was edited first.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use clap::Args as ClapArgs;

use crate::cli::arguments::{DocumentArgs, InkArgs};
use crate::cli::console::show;
use crate::cli::output::{self, Kind, Staged};
use appearance::brdf::{Space, Table, plot};
use appearance::document::{foil, name_of};
use appearance::edit::{
    self, Change, Edited, Effect, FILE_NAME, Mask, Replacement, Step, Steps, Surface, Tint, fingerprint,
};
use appearance::gamut::Printable;
use appearance::materials::{Factored, Nearest};
use files::shelf::{Disk, Shelf};
use observe::Observer;
use press::pipeline::document as stages;

/// Two bases, such as 1,4.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Two(usize, usize);

impl FromStr for Two {
    type Err = String;

    fn from_str(text: &str) -> Result<Two, String> {
        let number = |text: &str| text.trim().parse().ok();
        text.split_once(',')
            .and_then(|(a, b)| Some(Two(number(a)?, number(b)?)))
            .ok_or_else(|| "expected the numbers of two bases, such as 1,4".into())
    }
}

/// A share of a basis that becomes another one, such as 1,4,0.3.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mixing(Two, f64);

impl FromStr for Mixing {
    type Err = String;

    fn from_str(text: &str) -> Result<Mixing, String> {
        text.rsplit_once(',')
            .and_then(|(two, share)| Some(Mixing(two.parse().ok()?, share.trim().parse().ok()?)))
            .ok_or_else(|| {
                "expected two bases and the share of the first that becomes the second, such as 1,4,0.3"
                    .into()
            })
    }
}

/// A basis and the document that replaces it, such as 3=chrome.binary.
#[derive(Clone, Debug, PartialEq)]
struct Replacing(usize, String);

impl FromStr for Replacing {
    type Err = String;

    fn from_str(text: &str) -> Result<Replacing, String> {
        text.split_once('=')
            .and_then(|(basis, document)| Some(Replacing(basis.trim().parse().ok()?, document.to_owned())))
            .filter(|Replacing(_, document)| !document.is_empty())
            .ok_or_else(|| {
                "expected a basis and a document, such as 3=chrome.binary or 3=other.foil:2".into()
            })
    }
}

/// Arguments of `edit`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress factor sample:ladder --bases 6 -o ladder.foil\n  \
    foilpress edit ladder.foil --show\n  \
    foilpress edit ladder.foil --basis 2 --rougher 1.5 --tint '#c08040' -o edited.foil\n  \
    foilpress edit edited.foil --swap 2,4 --mask basis:2,0.5 -o again.foil\n  \
    foilpress edit ladder.foil --steps again.foil/steps.toml -o replayed.foil\n\n\
    DOC never changes. The edited document keeps its steps as steps.toml, beside their masks and curves: change them by hand\n\
    and replay them on the document that was edited first. Under a mask a basis is split: the edited one is new and gets the\n\
    last number.")]
pub struct Args {
    #[command(flatten)]
    document: DocumentArgs,
    /// Basis whose surface to edit, counted from 0 [default: every basis]
    #[arg(long, value_name = "N")]
    basis: Option<usize>,
    /// Make the highlight so many times as wide (0.05 to 20)
    #[arg(long, value_name = "FACTOR", conflicts_with = "glossier")]
    rougher: Option<f64>,
    /// Make the highlight so many times as narrow (0.05 to 20)
    #[arg(long, value_name = "FACTOR")]
    glossier: Option<f64>,
    /// Multiply the base colour by this one: the body of a dielectric, the highlight of a metal
    #[arg(long, value_name = "#RRGGBB")]
    tint: Option<Tint>,
    /// Multiply the base colour by this factor (0 to 20), as far as no channel returns more light than it receives
    #[arg(long, value_name = "FACTOR")]
    albedo: Option<f64>,
    /// Replace basis N by a measured material (.binary, .bsdf, .brdf, .csv), or by a basis of another document (other.foil:2)
    #[arg(long, value_name = "N=DOC", conflicts_with_all = ["basis", "rougher", "glossier", "tint", "albedo", "swap", "mix"])]
    replace: Option<Replacing>,
    /// Let two bases change places
    #[arg(long, value_name = "A,B", conflicts_with_all = ["basis", "rougher", "glossier", "tint", "albedo", "mix"])]
    swap: Option<Two>,
    /// Let a share (0 to 1) of basis A become basis B
    #[arg(long, value_name = "A,B,SHARE", conflicts_with_all = ["basis", "rougher", "glossier", "tint", "albedo"])]
    mix: Option<Mixing>,
    /// Edit only where this mask is white: a grey picture of the document's size, basis:N (where basis N is),
    /// basis:N,WEIGHT (where it weighs at least that), or region:X,Y (the region around that pixel where the same basis
    /// weighs most) [default: everywhere]
    #[arg(long, value_name = "MASK")]
    mask: Option<String>,
    /// Replay the steps of this file
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["basis", "rougher", "glossier", "tint", "albedo", "replace", "swap", "mix", "mask"])]
    steps: Option<PathBuf>,
    /// Show the bases, and the curves of the edited ones before and after; without -o nothing is written
    #[arg(long)]
    show: bool,
    #[command(flatten)]
    inks: InkArgs,
    /// Folder to write: the edited document and its steps [default: DOC-edited.foil in the current folder]
    #[arg(short, long, value_name = "DOC.foil")]
    output: Option<PathBuf>,
}

/// Runs `edit`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    let is_edit = args.steps.is_some() || args.changes();
    if !is_edit && !args.show {
        bail!("name an edit, such as --rougher 1.5 or --steps FILE.toml, or list the bases with --show");
    }
    if !is_edit && (args.output.is_some() || args.mask.is_some() || args.basis.is_some()) {
        bail!("there is nothing to write or to mask without an edit, such as --rougher 1.5");
    }
    let staged = match is_edit && (args.output.is_some() || !args.show) {
        true => Some(args.staged()?),
        false => None,
    };
    let (set, library) = args.inks.at_hand()?;
    let document = args.document.open(|| Ok((set, library.clone())), observer)?;
    let (factored, report) = stages::factored(&document, &Default::default(), observer)?;
    if let Some(report) = report {
        observer.note(&report.to_string());
    }
    let kept = args.kept(&document.name, document.as_factored(), &fingerprint(&factored), observer)?;
    let added = args.added(&factored.space, &fingerprint(&factored), observer)?;
    let edited = edit::apply(&factored, &added)?;

    let printable = Printable::combined(&library, &set, &factored.space);
    let told = Told::of(&factored, &edited, &printable)?;
    told.warn(observer);
    let (width, height) = (factored.maps.width(), factored.maps.height());
    let mut text = format!("{}: {width} x {height} pixels, {}\n", document.name, bases(factored.bases.len()));
    if args.show {
        text += &told.table();
    }
    for effect in &edited.effects {
        text += &told.effect(effect, &added[effect.step]);
    }
    if is_edit && edited.effects.is_empty() {
        text += "these edits change nothing\n";
    }
    if args.show {
        text += &told.curves();
    }
    if let Some((staged, target)) = staged {
        let mut all = kept;
        all.steps.extend(added);
        all.result = Some(fingerprint(&edited.document));
        foil::write(&edited.document, &document.name, document.size_mm, None, staged.path())?;
        all.write(staged.path(), &edited.document.space)?;
        staged.commit()?;
        let steps = match all.steps.len() {
            1 => "1 step".to_owned(),
            n => format!("{n} steps"),
        };
        let into = target.display();
        writeln!(text, "{into}: {}; {steps} in {into}/{FILE_NAME}", bases(edited.document.bases.len()))?;
    }
    show(&text)
}

impl Args {
    fn changes(&self) -> bool {
        self.surface() || self.replace.is_some() || self.swap.is_some() || self.mix.is_some()
    }

    fn surface(&self) -> bool {
        self.rougher.is_some() || self.glossier.is_some() || self.tint.is_some() || self.albedo.is_some()
    }

    /// The folder to write and its name. It must not be the document.
    fn staged(&self) -> Result<(Staged, PathBuf)> {
        let document = self.document.path();
        let target = self.output.clone().unwrap_or_else(|| {
            let name = name_of(&Disk, document);
            let name = name.strip_prefix("sample:").unwrap_or(&name);
            format!("{}-edited.foil", output::file_name(name)).into()
        });
        let place = |path: &Path| path.canonicalize().ok();
        if place(document).is_some_and(|document| place(&target) == Some(document)) {
            bail!(
                "{} is the document itself, which stays as it is; name another folder with -o",
                target.display()
            );
        }
        Ok((Staged::folder(&target, Kind::Foil)?, target))
    }

    /// The steps that made the document, if it is an edited one and nobody has changed it since; else none.
    fn kept(
        &self,
        name: &str,
        edited: Option<&Factored>,
        fingerprint: &str,
        observer: &dyn Observer,
    ) -> Result<Steps> {
        let fresh = Steps {
            document: name.to_owned(),
            fingerprint: Some(fingerprint.to_owned()),
            result: None,
            steps: Vec::new(),
        };
        let path = self.document.path().join(FILE_NAME);
        let Some(factored) = edited.filter(|_| path.is_file()) else { return Ok(fresh) };
        let earlier = Steps::read(&disk(), &path, &factored.space, observer).context(
            "the earlier steps of the document cannot be kept; delete them to edit it as a new document",
        )?;
        if earlier.result.as_deref() == Some(fingerprint) {
            return Ok(earlier);
        }
        observer.note(&format!(
            "{} was changed since its steps were written, so they are not kept: the new steps begin at the document as it is",
            self.document.document
        ));
        Ok(fresh)
    }

    /// The steps of this command.
    fn added(&self, space: &Space, fingerprint: &str, observer: &dyn Observer) -> Result<Vec<Step>> {
        if let Some(path) = &self.steps {
            let read = Steps::read(&disk(), path, space, observer)?;
            read.check(path, fingerprint)?;
            return Ok(read.steps);
        }
        let change = if let Some(Replacing(basis, document)) = &self.replace {
            Change::Replace { basis: *basis, by: Replacement::open(&disk(), document, space, observer)? }
        } else if let Some(Two(a, b)) = self.swap {
            Change::Swap(a, b)
        } else if let Some(Mixing(Two(basis, into), share)) = self.mix {
            Change::Mix { basis, into, share }
        } else if self.surface() {
            let rougher = match self.glossier {
                Some(factor) => Surface::glossier(factor)?,
                None => self.rougher.unwrap_or(1.0),
            };
            let surface = Surface {
                rougher,
                tint: self.tint.unwrap_or(Tint::WHITE),
                albedo: self.albedo.unwrap_or(1.0),
            };
            Change::Surface { basis: self.basis, surface }
        } else {
            return Ok(Vec::new());
        };
        let mask = self.mask.as_deref().map(|text| Mask::open(&Disk, text, observer)).transpose()?;
        Ok(vec![Step { change, mask }])
    }
}

fn bases(n: usize) -> String {
    if n == 1 { "1 basis".into() } else { format!("{n} bases") }
}

/// What is told of a basis.
struct Basis {
    share: f64,
    surface: Nearest,
    /// Distance to the nearest mixture of inks.
    reach: f64,
    /// The basis before that it was made of, and its distance to the nearest mixture, if its curve is another one.
    before: Option<(usize, f64)>,
}

/// What is told of an edited document.
struct Told<'a> {
    before: &'a Factored,
    edited: &'a Edited,
    bases: Vec<Basis>,
}

/// The distance from which a difference is visible.
const VISIBLE: f64 = 0.01;

impl<'a> Told<'a> {
    fn of(before: &'a Factored, edited: &'a Edited, printable: &Printable) -> Result<Told<'a>> {
        let (space, after) = (&before.space, &edited.document);
        let changed: Vec<bool> = edited
            .origin
            .iter()
            .enumerate()
            .map(|(i, &origin)| i != origin || after.bases.row(i) != before.bases.row(origin))
            .collect();
        let mut rows = Table::new(space.columns());
        after.bases.rows().for_each(|row| rows.push(row));
        let old: Vec<usize> = (0..changed.len()).filter(|&i| changed[i]).collect();
        old.iter().for_each(|&i| rows.push(before.bases.row(edited.origin[i])));
        let reach = edit::reach(space, &rows, printable)?;
        let bases = after
            .bases
            .rows()
            .zip(after.shares())
            .enumerate()
            .map(|(i, (row, share))| Basis {
                share,
                surface: Nearest::to(space, row),
                reach: reach[i],
                before: old
                    .iter()
                    .position(|&o| o == i)
                    .map(|at| (edited.origin[i], reach[changed.len() + at])),
            })
            .collect();
        Ok(Told { before, edited, bases })
    }

    /// Says what lies outside the gamut because of the edits.
    fn warn(&self, observer: &dyn Observer) {
        for (i, basis) in self.bases.iter().enumerate() {
            let Some((_, before)) =
                basis.before.filter(|(_, before)| basis.reach > before.max(VISIBLE) + 5e-4)
            else {
                continue;
            };
            let verb = if before > VISIBLE { "is further outside" } else { "leaves" };
            observer.note(&format!(
                "basis {i} {verb} what the inks can print: the difference from the nearest mixture was d = {before:.3} and is {:.3} \
                 (0.01: barely visible; 0.05: obvious)",
                basis.reach
            ));
        }
    }

    /// A line for each basis.
    fn table(&self) -> String {
        let mut text = String::from("basis   share  body     highlight  alpha  metal  d of print\n");
        for (i, basis) in self.bases.iter().enumerate() {
            let Nearest { diffuse, f0, alpha, .. } = basis.surface;
            let shines = f0.iter().any(|&f| f > 1e-4);
            let alpha = if shines { format!("{alpha:.3}") } else { "matt".into() };
            let metal = 100.0 * basis.surface.metallic().metallic;
            let _ = write!(
                text,
                "{i:5} {:5.1} %  {}  {}    {alpha:>5}  {metal:3.0} %  {:.3}",
                100.0 * basis.share,
                Tint::of_linear(diffuse),
                Tint::of_linear(f0),
                basis.reach
            );
            if let Some((origin, before)) = basis.before {
                let d = self
                    .before
                    .space
                    .distance(self.before.bases.row(origin), self.edited.document.bases.row(i));
                let from = if origin == i { String::new() } else { format!("from basis {origin}, ") };
                let _ = write!(text, " (before: {before:.3}; {from}changed by d = {d:.3})");
            }
            text.push('\n');
        }
        text
    }

    /// What a step did to a basis.
    fn effect(&self, effect: &Effect, step: &Step) -> String {
        let Effect { basis, into, share, .. } = *effect;
        let mut what = match &step.change {
            Change::Surface { surface, .. } => surface_in_words(surface, effect),
            Change::Replace { by, .. } => format!("replaced by {}", by.name),
            Change::Swap(..) => format!("and basis {into} change places"),
            Change::Mix { share, .. } => format!("becomes basis {into} for {:.1} %", 100.0 * share),
        };
        if let Some(mask) = &step.mask {
            let _ = write!(what, " under {mask}");
        }
        let new = match step.change {
            Change::Surface { .. } | Change::Replace { .. } if into != basis => format!(", now basis {into}"),
            _ => String::new(),
        };
        format!(
            "step {}: basis {basis} {what} ({:.1} % of the document){new}\n",
            effect.step + 1,
            100.0 * share
        )
    }

    /// The curves of the edited bases before and after.
    fn curves(&self) -> String {
        let (space, after) = (&self.before.space, &self.edited.document);
        let changed = self.bases.iter().enumerate().filter_map(|(i, basis)| Some((i, basis.before?.0)));
        changed
            .map(|(i, origin)| {
                let [old, new] = [self.before.bases.row(origin), after.bases.row(i)].map(|row| space.curve(row));
                let plot = plot::terminal_change(&old, &new);
                format!("\nbasis {i}: reflectance (1/sr) over the half angle, before (dots) and after (line)\n{plot}")
            })
            .collect()
    }
}

/// An edit of a surface, with what it came to where a limit was in the way.
fn surface_in_words(surface: &Surface, effect: &Effect) -> String {
    let mut parts = Vec::new();
    let differs = |asked: f64, came: f64| (came / asked - 1.0).abs() > 1e-6;
    if let Some(applied) = effect.applied {
        let (asked, came) = (surface.rougher, applied.rougher);
        let (word, asked, came) =
            if asked < 1.0 { ("glossier", asked.recip(), came.recip()) } else { ("rougher", asked, came) };
        if asked != 1.0 {
            parts.push(match differs(asked, came) {
                true => {
                    format!("{word} by {came:.2} (not {asked:.2}: a highlight has a width from 0.02 to 1)")
                }
                false => format!("{word} by {asked:.2}"),
            });
        }
        if surface.tint != Tint::WHITE {
            parts.push(format!("tinted {}", surface.tint));
        }
        if surface.albedo != 1.0 {
            parts.push(match differs(surface.albedo, applied.albedo) {
                true => format!(
                    "lighter by {:.2} (not {}: it would return more light than it receives)",
                    applied.albedo, surface.albedo
                ),
                false => format!("times {} in base colour", surface.albedo),
            });
        }
    }
    parts.join(", ")
}

fn disk() -> Arc<dyn Shelf> {
    Arc::new(Disk)
}
