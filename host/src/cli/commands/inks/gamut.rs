//! `foilpress inks gamut` and `inks redundant`: what a library can print, and what it would not miss.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use appearance::brdf::{Space, plot};
use appearance::gamut::{
    self, GamutError, GamutSettings, Gloss, Intent, LIGHT, LeftOut, MaterialReport, Printable,
};
use inks::{InkSet, Stack};
use observe::Observer;
use press::html;
use press::pipeline::document as stages;
use protocol::ink::Ink;
use serde_json::{Value, json};

use super::page;
use crate::cli::arguments::choice::utf8;
use crate::cli::arguments::{DocumentArgs, FactorArgs, InkArgs};
use crate::libraries;

/// Angles at which stacks are compared with mixtures.
const SAMPLES: usize = 64;

/// Arguments of `inks gamut`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks gamut builtin --document my-material/\n  \
    foilpress inks gamut my-library/ --document my-material/ -o gamut.html")]
pub struct Args {
    /// Library: a folder, the name of a library that was added, or `builtin`
    library: PathBuf,
    /// Document whose bases are compared with what the library can print
    #[arg(long, value_name = "DOC", value_parser = utf8())]
    document: String,
    /// Inks to print with, as in `print` [default: all but the foils]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    inks: Option<String>,
    #[command(flatten)]
    factor: FactorArgs,
    /// Also write one self-contained page with the curve of each basis and of its mixture
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A basis and the stack that is nearest to it.
struct Basis {
    nearest: Stack,
    /// Distance d to that stack alone.
    alone: f64,
    mapped: MaterialReport,
}

/// Runs `inks gamut`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<String> {
    let inks = InkArgs::of(args.inks.clone(), Some(args.library.clone()));
    let (set, library) = inks.at_hand()?;
    let opening = DocumentArgs::named(args.document.clone());
    let document = opening.open(|| Ok((set, library.clone())), observer)?;
    args.factor.note_unused(&document, observer);
    let (factored, _) = stages::factored(&document, &args.factor.settings(), observer)?;
    let space = &factored.space;
    let printable = Printable::combined(&library, &set, space);
    // All inks at once: what the library can print, not what seven cartridges can.
    let settings = GamutSettings {
        intent: Intent::Basis,
        gloss: Gloss::Keep,
        most_cartridges: Ink::ALL.len(),
        ..GamutSettings::default()
    };
    let bases = || Ok::<_, GamutError>(Cow::Borrowed(&*factored));
    let mapped = gamut::map(&*factored, bases, &printable, &settings, observer)?;
    let found: Vec<Basis> = mapped
        .report
        .materials
        .into_iter()
        .map(|mapped| {
            let (nearest, alone) = nearest(space, &printable, &mapped.target);
            Basis { nearest, alone, mapped }
        })
        .collect();
    if let Some(output) = &args.output {
        write_page(output, &document.name, library.name(), space, &found)?;
    }
    if args.json {
        let bases: Vec<Value> = found.iter().map(report).collect();
        let whole = json!({"document": document.name, "library": library.name(), "bases": bases});
        return Ok(serde_json::to_string_pretty(&whole)? + "\n");
    }
    let mut text = format!("{} in {}\n\n", document.name, library.name());
    writeln!(
        text,
        "{:<5} {:>6}  {:<12} {:>7} {:>9} {:>7}  mixture",
        "basis", "share", "nearest", "d", "mixed d", "light"
    )?;
    for (i, basis) in found.iter().enumerate() {
        let m = &basis.mapped;
        writeln!(
            text,
            "{i:<5} {:>5.1}%  {:<12} {:>7.4} {:>9.4} {:>7.4}  {}",
            100.0 * m.share,
            basis.nearest,
            basis.alone,
            m.unscaled_distance,
            m.light,
            mixture(&m.weights)
        )?;
    }
    text.push_str(
        "\nd is the difference people see (0.01: barely visible; 0.05: obvious): from the basis to the nearest stack, and to the\n\
         best mixture. light is the difference in returned light, which mixtures are chosen by as well.\n",
    );
    if let Some(output) = &args.output {
        writeln!(text, "page written to {}", output.display())?;
    }
    Ok(text)
}

fn nearest(space: &Space, printable: &Printable, target: &[f64]) -> (Stack, f64) {
    let distances = printable.curves.rows().map(|row| space.distance(row, target));
    let nearest = printable.stacks.iter().zip(distances).min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map_or((Stack::SUBSTRATE, f64::INFINITY), |(stack, d)| (stack.clone(), d))
}

fn report(basis: &Basis) -> Value {
    let m = &basis.mapped;
    json!({
        "share": m.share, "nearest": basis.nearest, "distance_nearest": basis.alone,
        "distance_mixed": m.unscaled_distance, "light": m.light, "mixture": weights(&m.weights),
    })
}

fn weights(mixture: &[(Stack, f64)]) -> Vec<Value> {
    mixture.iter().map(|(stack, weight)| json!({"stack": stack, "weight": weight})).collect()
}

fn mixture(weights: &[(Stack, f64)]) -> String {
    let parts = weights.iter().map(|(stack, weight)| format!("{:.0} % {stack}", 100.0 * weight));
    parts.collect::<Vec<_>>().join(", ")
}

fn write_page(target: &Path, document: &str, library: &str, space: &Space, found: &[Basis]) -> Result<()> {
    let wide = html::wide("bases");
    let mut body = format!(
        "<p>Library: {}. Lines: the basis. Dashed: the best mixture of the library's stacks. d is the difference people see \
         (0.01: barely visible; 0.05: obvious).</p>{wide}<table><tr><th>basis<th class=n>share<th>nearest stack<th class=n>d\
         <th class=n>mixed d<th class=n>light<th>mixture",
        html::escape(library)
    );
    for (i, basis) in found.iter().enumerate() {
        let m = &basis.mapped;
        write!(
            body,
            "<tr><td>{i}<td class=n>{:.1} %<td>{}<td class=n>{:.4}<td class=n>{:.4}<td class=n>{:.4}<td class=words>{}",
            100.0 * m.share,
            basis.nearest,
            basis.alone,
            m.unscaled_distance,
            m.light,
            mixture(&m.weights)
        )?;
    }
    body.push_str("</table></div>");
    for (i, basis) in found.iter().enumerate() {
        let curves = [space.curve(&basis.mapped.target), space.curve(&basis.mapped.printed)];
        let lines = [0, 1].map(|k: usize| plot::Line { curve: &curves[k], uncertainty: None });
        let title = format!("basis {i}: d = {:.4}", basis.mapped.unscaled_distance);
        write!(
            body,
            "<h2>Basis {i}: {}</h2>{}",
            mixture(&basis.mapped.weights),
            html::drawing(&format!("curves of basis {i}"), &plot::compared(&title, &lines)?)
        )?;
    }
    page::write(target, &format!("{document} in the gamut of a library"), &body)
}

/// Arguments of `inks redundant`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks redundant --inks process\n  \
    foilpress inks redundant my-library/ --within 0.02 --inks process,metallic-silver --json")]
pub struct Redundant {
    /// Library: a folder, the name of a library that was added, or `builtin` [default: the built-in library]
    library: Option<PathBuf>,
    /// Consider only stacks made of these inks, as in `inks list` [default: every stack]
    #[arg(long, value_name = "INKS", allow_hyphen_values = true)]
    inks: Option<InkSet>,
    /// Leave out stacks that a mixture of the others replaces within this difference (0.01: barely visible)
    #[arg(long, value_name = "D", default_value_t = 0.01)]
    within: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `inks redundant`.
pub fn redundant(args: &Redundant) -> Result<String> {
    let library = libraries::given(args.library.as_deref())?;
    let space = Space::half_angle(SAMPLES);
    let printable = Printable::from_library(&library, &args.inks.unwrap_or(InkSet::ALL), &space);
    let found = gamut::redundancy(&space, &printable, LIGHT, args.within)?;
    if args.json {
        let one = |left: &LeftOut| {
            let mixture = weights(&left.mixture);
            json!({"stack": left.stack, "alone": left.alone, "together": left.together, "mixture": mixture})
        };
        return Ok(serde_json::to_string_pretty(&found.iter().map(one).collect::<Vec<_>>())? + "\n");
    }
    let mut left: Vec<&LeftOut> = found.iter().filter(|left| left.together.is_some()).collect();
    left.sort_by(|a, b| a.together.unwrap_or(0.0).total_cmp(&b.together.unwrap_or(0.0)));
    let mut text = format!("{}\n\n", library.name());
    if !left.is_empty() {
        writeln!(text, "{:<10} {:>7} {:>9}  mixture that replaces it", "stack", "alone", "together")?;
    }
    for stack in &left {
        let together = stack.together.unwrap_or(0.0);
        let mixture = mixture(&stack.mixture);
        writeln!(text, "{:<10} {:>7.4} {together:>9.4}  {mixture}", stack.stack, stack.alone)?;
    }
    writeln!(
        text,
        "{}{} of {} stacks can be left out together: mixtures of the other {} replace each within {}, light included.",
        if left.is_empty() { "" } else { "\n" },
        left.len(),
        found.len(),
        found.len() - left.len(),
        args.within
    )?;
    let staying = || found.iter().filter(|left| left.together.is_none() && !left.stack.layers().is_empty());
    if let Some(least) = staying().min_by(|a, b| a.alone.total_cmp(&b.alone)) {
        writeln!(
            text,
            "Of those that stay, {} is missed least: {:.4} if it alone is left out.",
            least.stack, least.alone
        )?;
    }
    Ok(text)
}
