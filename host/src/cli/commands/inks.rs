//! `foilpress inks`: list, show and check the inks and stacks of a library; what else is done with
//! libraries is in the modules below.

mod choose;
mod diff;
mod from;
mod gamut;
mod page;
pub(super) mod place;
mod predict;
mod share;

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use files::shelf::Disk;
use inks::{Entry, InkSet, Library, Origins, Provenance, Severity, Source, Stack, own};
use protocol::ink::Ink;
use serde::Serialize;

use crate::cli::console::{closed_pipe, draw, show, stdout};
use crate::cli::output::Staged;
use crate::libraries;
use appearance::brdf::plot;
use observe::{Observer, visible_line};
use sheet::dots_in_words;

/// The library of inks and stacks.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks list --inks process,metallic-silver\n  \
    foilpress inks show MS+C --figures                   (with the figures behind its curve)\n  \
    foilpress inks check my-library/                     (before it is used with --library)\n  \
    foilpress inks predict mine/ -o full/                (the other stacks, from those measured)\n  \
    foilpress inks diff builtin my-library/ -o diff.html\n  \
    foilpress inks choose my-material/ --cartridges 4")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// List the stacks with their layers, their peak reflectance and the origin of their curves; or what
    /// was added
    List {
        /// List the libraries and inks that were added with `inks add` instead
        #[arg(long, conflicts_with_all = ["library", "inks"])]
        added: bool,
        /// Ink library: its folder, or the name it was added under [default: the built-in library, which is
        /// modelled, not measured]
        #[arg(long, value_name = "LIBRARY")]
        library: Option<PathBuf>,
        /// List only stacks made of these inks, such as `process,metallic-silver,finish`, `all` or
        /// `-metallic`; foils are left out unless they or `all` are named [default: list every stack]
        #[arg(long, value_name = "INKS", allow_hyphen_values = true)]
        inks: Option<InkSet>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Show one stack with its cartridges, cautions and figures, and a plot of its curve
    Show {
        /// Stack: inks from the bottom up, such as `MS+C+F`, `metallic-silver+cyan` or `substrate`
        stack: String,
        /// Ink library: its folder, or the name it was added under [default: the built-in library]
        #[arg(long, value_name = "LIBRARY")]
        library: Option<PathBuf>,
        /// List every figure that the curve is based on
        #[arg(long)]
        figures: bool,
        /// Also write the plot to this SVG file
        #[arg(long, value_name = "FILE.svg")]
        plot: Option<PathBuf>,
    },
    /// Add a curve from another instrument to a library: a goniometer, a gloss meter with a spectrophotometer
    From(from::Args),
    /// Predict the stacks that were not measured from those that were
    ///
    /// The figures of the layer model are fitted to all measured curves. A stack is predicted if each of
    /// its inks is in a measured stack. Each measured stack is also predicted from the others alone, which
    /// shows how far predictions are off.
    Predict(predict::Args),
    /// Check a library and list every problem with its file, line and field
    ///
    /// Errors make a library unusable: files that cannot be read, stacks that reflect more light than
    /// arrives. Warnings doubt a curve: it rises where prints only fall, its samples scatter, its highlight
    /// is clipped, a process ink adds light. Notes say what was not measured, and how uncertain the rest
    /// is.
    #[command(after_help = "Examples:\n  \
        foilpress inks check my-library/\n  \
        foilpress inks check my-library/ --json")]
    Check {
        /// Library: its folder with `library.toml`, or the name it was added under
        #[arg(value_name = "LIBRARY")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Compare two libraries stack by stack, and say which differences are within the measurement
    Diff(diff::Args),
    /// Choose the best cartridges for a document, and show what each is worth
    ///
    /// The choice is exact for a sample of the document's pixels: no other set of cartridges comes nearer
    /// to them.
    Choose(choose::Args),
    /// Show how near a library comes to the bases of a document
    Gamut(gamut::Args),
    /// List the stacks that mixtures of the other stacks can replace
    Redundant(gamut::Redundant),
    /// Add a library to your own, so that --library finds it by its name; or an ink of another maker
    ///
    /// A ribbon of another maker is in a cartridge that the printer takes for one it knows. With --as and
    /// --colour the ink gets a name of its own: art, options and queues may use it, and plans and the check
    /// of the cartridges show it beside the ink it poses as.
    #[command(after_help = "Examples:\n  \
        foilpress inks add my-library/\n  \
        foilpress inks add my-library/ --name matt-paper\n  \
        foilpress inks add neon-pink --as metallic-red --colour ff40a0")]
    Add {
        /// Folder with `library.toml`, such as `foilpress measure` writes; or the name of the ink
        what: PathBuf,
        /// Name of the library [default: the name of the folder]
        #[arg(long, conflicts_with = "poses_as")]
        name: Option<String>,
        /// Ink whose code and barcode the cartridge has
        #[arg(long = "as", value_name = "INK", value_parser = art::names::typed, requires = "colour")]
        poses_as: Option<Ink>,
        /// Colour of the ink on white paper: red, green and blue, such as ff40a0
        #[arg(long, value_name = "RRGGBB", requires = "poses_as")]
        colour: Option<String>,
    },
    /// Remove a library or an ink that was added; the folder or archive it was added from stays as it is
    #[command(after_help = "Examples:\n  \
        foilpress inks list --added\n  \
        foilpress inks remove matt-paper")]
    Remove {
        /// Name of the library or the ink
        name: String,
    },
    /// Write a library as one archive, with its licence and the origin of its curves
    #[command(after_help = "Examples:\n  \
        foilpress inks export my-library/ -o mine.zip --licence CC0-1.0")]
    Export {
        /// Library: its folder, or the name it was added under
        library: PathBuf,
        /// Archive to write [default: LIBRARY.zip in the current folder]
        #[arg(short, long, value_name = "FILE.zip")]
        output: Option<PathBuf>,
        /// Licence to give it under, such as CC0-1.0 or CC-BY-4.0 [default: the one that library.toml names]
        #[arg(long, value_name = "NAME")]
        licence: Option<String>,
    },
    /// Add the library in an archive to your own
    #[command(after_help = "Examples:\n  \
        foilpress inks import mine.zip --name theirs")]
    Import {
        /// Archive that `foilpress inks export` wrote
        archive: PathBuf,
        /// Name of the library [default: the name of the archive]
        #[arg(long)]
        name: Option<String>,
    },
}

/// Runs the subcommand; what it has to say goes to the standard output.
pub fn run(args: Args, observer: &dyn Observer) -> anyhow::Result<()> {
    let (text, verdict) = match args.what {
        What::List { added: true, json, .. } => (share::list(json)?, Ok(())),
        What::List { library, inks, json, .. } => {
            (list(&libraries::given(library.as_deref())?, inks, json)?, Ok(()))
        }
        What::Show { stack, library, figures, plot } => {
            let colour = stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
            let library = libraries::given(library.as_deref())?;
            let entry = &*find(&library, &stack)?;
            show(&describe(&library, entry, figures))?;
            draw(&plot::terminal(&entry.curve, colour))?;
            let mut text = String::new();
            if let Some(file) = &plot {
                let title =
                    format!("{}: {} ({})", entry.stack, library.words(&entry.stack), entry.provenance.word());
                let staged = Staged::file(file)?;
                std::fs::write(staged.path(), plot::svg(&title, &entry.curve)?)
                    .with_context(|| format!("cannot write {}", file.display()))?;
                staged.commit()?;
                writeln!(text, "\nplot written to {}", file.display())?;
            }
            (text, Ok(()))
        }
        What::Check { dir, json } => check(&libraries::folder(&dir)?, json)?,
        What::From(args) => (from::run(&args, observer)?, Ok(())),
        What::Predict(args) => (predict::run(&args, observer)?, Ok(())),
        What::Diff(args) => (diff::run(&args)?, Ok(())),
        What::Choose(args) => (choose::run(&args, observer)?, Ok(())),
        What::Gamut(args) => (gamut::run(&args, observer)?, Ok(())),
        What::Redundant(args) => (gamut::redundant(&args)?, Ok(())),
        What::Add { what, poses_as: Some(ink), colour: Some(colour), .. } => {
            (share::add_ink(&what.to_string_lossy(), &colour, ink)?, Ok(()))
        }
        What::Add { what, name, .. } => (share::add(&what, name)?, Ok(())),
        What::Remove { name } => (share::remove(&name)?, Ok(())),
        What::Export { library, output, licence } => {
            (share::export(&library, output.as_deref(), licence.as_deref())?, Ok(()))
        }
        What::Import { archive, name } => (share::import(&archive, name)?, Ok(())),
    };
    match show(&text) {
        // A reader that closes the pipe early, such as `head`, is not a failure.
        Err(error) if !closed_pipe(&error) => Err(error),
        _ => verdict,
    }
}

/// The entry of a stack given as text, on the list or beyond it, as prints use both. Suggests another when
/// there is none.
fn find<'a>(library: &'a Library, text: &str) -> anyhow::Result<Cow<'a, Entry>> {
    let stack: Stack = text.parse()?;
    if let Some(entry) = library.entry(&stack) {
        return Ok(Cow::Borrowed(entry));
    }
    if let Some(entry) = library.beyond_list(&stack) {
        return Ok(Cow::Owned(entry));
    }
    let sorted = |stack: &Stack| {
        let mut layers = stack.layers().to_vec();
        layers.sort();
        layers
    };
    if let Some(other) = library.entries().iter().find(|entry| sorted(&entry.stack) == sorted(&stack)) {
        bail!(
            "stack {stack} is not in the library, but {} is; name the inks from the bottom up",
            other.stack
        );
    }
    let name = stack.to_string();
    let near = library
        .entries()
        .iter()
        .map(|entry| (strsim::normalized_levenshtein(&name, &entry.stack.to_string()), &entry.stack))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((_, near)) => bail!(
            "stack {stack} is not in the library; the nearest is {near}; `foilpress inks list` shows every stack"
        ),
        None => bail!("stack {stack} is not in the library"),
    }
}

#[derive(Serialize)]
struct Row<'a> {
    number: usize,
    stack: &'a Stack,
    layers: Vec<&'static str>,
    words: String,
    /// Reflectance in 1/sr at half angles of 0, 10 and 30 degrees, linear RGB.
    reflectance: [[f64; 3]; 3],
    minimum_cluster: u16,
    breaks: Vec<&'a str>,
    provenance: &'a Provenance,
}

fn list(library: &Library, inks: Option<InkSet>, json: bool) -> anyhow::Result<String> {
    let entries = library.at_hand(&inks.unwrap_or(InkSet::ALL));
    if json {
        let rows: Vec<Row<'_>> = entries
            .into_iter()
            .map(|entry| Row {
                number: entry.number,
                stack: &entry.stack,
                layers: entry.stack.layers().iter().map(|ink| ink.name()).collect(),
                words: library.words(&entry.stack),
                reflectance: [0.0, 10.0, 30.0].map(|degrees: f64| entry.curve.at(degrees.to_radians())),
                minimum_cluster: library.minimum_cluster(&entry.stack),
                breaks: library.broken_rules(&entry.stack).iter().map(|rule| rule.name.as_str()).collect(),
                provenance: &entry.provenance,
            })
            .collect();
        return Ok(serde_json::to_string_pretty(&rows)? + "\n");
    }
    let mut text = String::new();
    writeln!(text, "{}\n{}\n", visible_line(library.name()), library.about())?;
    writeln!(
        text,
        "{:>3}  {:<10} {:>9} {:>9}  {:<10} layers, bottom first",
        "no.", "stack", "f(0)", "f(30)", "curve"
    )?;
    for entry in &entries {
        let at = |degrees: f64| appearance::srgb::luminance(entry.curve.at(degrees.to_radians()));
        writeln!(
            text,
            "{:>3}  {:<10} {:>9.4} {:>9.4}  {:<10} {}",
            entry.number,
            entry.stack,
            at(0.0),
            at(30.0),
            entry.provenance.word(),
            library.words(&entry.stack)
        )?;
    }
    let origins = Origins::count(entries.iter().copied());
    writeln!(text, "\n{origins}. f is the luminance of the reflectance, in 1/sr.")?;
    if !own::all().is_empty() {
        writeln!(text, "\nInks of your own:")?;
        own::all().iter().for_each(|own| text.push_str(&share::ink_line(own)));
    }
    Ok(text)
}

/// A stack in words: its curve, its cartridges, and the rules it breaks.
fn describe(library: &Library, entry: &Entry, figures: bool) -> String {
    let stack = &entry.stack;
    let mut lines = vec![format!("{stack}: {}", library.words(stack))];
    if library.entry(stack).is_none() {
        lines.push(
            "list      not on the list of the library, but its rules allow it, so prints may use it".into(),
        );
    }
    lines.extend(curve_lines(entry));
    lines.push(format!(
        "cluster   at least {} of 1/600 inch",
        dots_in_words(library.minimum_cluster(stack).into())
    ));
    for (place, &ink) in stack.layers().iter().enumerate() {
        lines.push(String::new());
        lines.extend(layer_lines(library, ink, if place == 0 { "bottom" } else { "above" }));
    }
    let broken = library.broken_rules(stack);
    if !broken.is_empty() {
        lines.push(String::new());
        lines.extend(
            broken.iter().map(|rule| format!("{}: {} ({})", rule.severity, rule.says, rule.certainty)),
        );
    }
    if figures && let Provenance::Modelled { parameters, .. } = &entry.provenance {
        lines.push(String::new());
        for parameter in parameters {
            let value = parameter.value.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
            lines.push(format!("  {:<32} {value:<22} {}", parameter.name, parameter.source));
        }
    }
    lines.push(String::new());
    lines.push("reflectance in 1/sr over the half angle:".into());
    let lines: Vec<_> = lines.iter().map(|line| visible_line(line)).collect();
    lines.join("\n") + "\n"
}

/// The origin of a stack's curve and, if it is modelled, the lobes it is made of.
fn curve_lines(entry: &Entry) -> Vec<String> {
    let mut lines = Vec::new();
    match &entry.provenance {
        Provenance::Modelled { model, parameters } => {
            let count = |source| parameters.iter().filter(|p| p.source == source).count();
            lines.push(format!("curve     modelled, not measured: {model}"));
            lines.push(format!(
                "based on  {} figures: {} measured, {} from literature, {} from formulas, {} guesses",
                parameters.len(),
                count(Source::Measured),
                count(Source::Literature),
                count(Source::Formula),
                count(Source::Guess)
            ));
        }
        Provenance::Measured { by, when, setup } => {
            lines.push(format!("curve     measured by {by}, {when}: {setup}"));
        }
        Provenance::Predicted { by, when, setup } => {
            lines.push(format!("curve     predicted from measurements by {by}, {when}: {setup}"));
        }
    }
    if let Some(lobes) = &entry.lobes {
        let rgb = |v: [f64; 3]| format!("{:.3} {:.3} {:.3}", v[0], v[1], v[2]);
        // As the curve has it: the share that the surface turns back never reaches the body.
        lines.push(format!("diffuse   albedo {}", rgb(lobes.kd.map(|kd| lobes.entering * kd))));
        for lobe in &lobes.lobes {
            lines.push(format!("lobe      F0 {}, alpha {:.3}", rgb(lobe.f0), lobe.alpha));
        }
        lines.push(format!(
            "gloss     {:.0} units at 60 degrees, as a gloss meter would read the model",
            inks::gloss::units(lobes)
        ));
    }
    lines
}

/// One layer of a stack: its cartridge and the cautions about it.
fn layer_lines(library: &Library, ink: Ink, place: &str) -> Vec<String> {
    let Some(cartridge) = library.cartridge(ink) else {
        return vec![format!("{place}: {}, for which the library has no cartridge", ink.name())];
    };
    let mut lines = vec![
        format!("{place}: {} ({}), sold by ALPS as {}", cartridge.okidata, ink.short(), cartridge.alps),
        format!(
            "  cartridge {}, barcode {}, ink code {:02x}, minimum cluster {}",
            ink.part(),
            ink.barcode(),
            ink.code(),
            dots_in_words(cartridge.minimum_cluster.get().into())
        ),
    ];
    if let Some(dots) = &cartridge.dots {
        let gain = dots.dot_gain_um.map_or(String::new(), |gain| format!(", dot gain {gain:.1} um"));
        lines.push(format!("  dots measured by {}, {}: {}{gain}", dots.by, dots.when, dots.setup));
    }
    lines.extend(own::posing_as(ink).map(|own| format!("  your {own} poses as it")));
    lines.extend(
        cartridge.cautions.iter().map(|caution| format!("  {} ({})", caution.text, caution.certainty)),
    );
    lines
}

fn check(dir: &Path, json: bool) -> anyhow::Result<(String, anyhow::Result<()>)> {
    let problems = Library::check(&Disk, dir);
    let mut text: String =
        problems.iter().map(|problem| problem.to_string().replace('\n', "\n    ") + "\n").collect();
    let count = |severity| problems.iter().filter(|problem| problem.severity == severity).count();
    let (errors, warnings, notes) = (count(Severity::Error), count(Severity::Warning), count(Severity::Note));
    if let Ok(library) = Library::open(&Disk, dir) {
        text.push_str(&format!("{}: {}\n", dir.display(), library.origins()));
    }
    let counted = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    text.push_str(&format!(
        "{}: {}, {}, {}\n",
        dir.display(),
        counted(errors, "error"),
        counted(warnings, "warning"),
        counted(notes, "note")
    ));
    let verdict = match errors {
        0 => Ok(()),
        _ => Err(anyhow::anyhow!("{} cannot be used as an ink library", dir.display())),
    };
    if json {
        text = serde_json::to_string_pretty(&problems)? + "\n";
    }
    Ok((text, verdict))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        args: Args,
    }

    fn parse(words: &str) -> Result<What, clap::Error> {
        Program::try_parse_from(std::iter::once("inks").chain(words.split(' ')))
            .map(|program| program.args.what)
    }

    #[test]
    fn sets_of_inks_are_arguments() {
        let What::List { inks: Some(inks), .. } = parse("list --inks -metallic").unwrap() else { panic!() };
        assert!(!inks.contains(Ink::MetallicSilver) && inks.contains(Ink::Finish));
        let error = parse("list --inks finnish").err().unwrap();
        assert!(error.to_string().contains("did you mean `finish`?"), "{error}");
    }

    #[test]
    fn the_list_has_a_line_for_each_stack_and_says_modelled() {
        let library = Library::builtin();
        let text = list(&library, None, false).unwrap();
        for entry in library.entries() {
            assert!(text.lines().any(|line| line.contains(&format!(" {} ", entry.stack))), "{}", entry.stack);
        }
        assert!(text.contains("57 stacks: 0 measured, 57 modelled"));
        let few = list(&library, Some("process".parse().unwrap()), false).unwrap();
        assert!(few.contains("\n9 stacks: "), "{few}");
    }

    #[test]
    fn the_json_list_is_the_library() {
        let text = list(&Library::builtin(), None, true).unwrap();
        let rows: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(rows.as_array().unwrap().len(), 57);
        assert_eq!(rows[52]["stack"], "MS+C+F");
        assert_eq!(rows[52]["layers"], serde_json::json!(["metallic-silver", "cyan", "finish"]));
        assert!(rows[52]["provenance"]["modelled"]["parameters"].as_array().unwrap().len() > 10);
    }

    #[test]
    fn a_foil_stack_is_shown_with_its_cartridges_and_its_trouble() {
        let library = Library::builtin();
        let text = describe(&library, &find(&library, "SF+C").unwrap(), true);
        for word in [
            "Flash Silver",
            "MDC-FMES",
            "barcode 6",
            "modelled, not measured",
            "inferred",
            "16 dots",
            "warning: foil prints properly only on",
            "silver-foil.reflectance",
        ] {
            assert!(text.contains(word), "`{word}` is not in:\n{text}");
        }
    }

    #[test]
    fn a_stack_the_library_lacks_brings_the_nearest() {
        let library = Library::builtin();
        let error = |text: &str| find(&library, text).unwrap_err().to_string();
        assert!(error("C+MS").contains("but MS+C is"), "{}", error("C+MS"));
        assert!(error("C+M+Y+K").contains("nearest is"), "{}", error("C+M+Y+K"));
        assert!(error("metalic-gold").contains("metallic-gold"), "{}", error("metalic-gold"));
        assert_eq!(find(&library, "gold").unwrap().stack.to_string(), "MG");
    }

    #[test]
    fn check_fails_on_errors_and_counts_what_it_found() {
        let folder = tempfile::tempdir().unwrap();
        let (text, verdict) = check(folder.path(), false).unwrap();
        assert!(verdict.is_err() && text.contains("1 error,"), "{text}");
        std::fs::write(folder.path().join("library.toml"), "format = 1\nbased_on = \"built-in\"\n").unwrap();
        let (text, verdict) = check(folder.path(), false).unwrap();
        assert!(verdict.is_ok() && text.contains("0 errors"), "{text}");
    }
}
