//! `foilpress inks predict`: the stacks that nobody measured, from those that were.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use appearance::brdf::{Space, compare};
use files::shelf::Disk;
use inks::predict::{FittedFigure, LeftOut, Predicted, Prediction};
use inks::{Curve, FILE_NAME, Library, Provenance, Stack, archive};
use measure::curves::library::{curve_name, quoted};
use observe::Observer;
use serde::Serialize;

use crate::cli::output::{Kind, Staged};
use crate::libraries;

/// Angles at which the curves that were left out are compared with the measured ones.
const SAMPLES: usize = 64;
/// The most stacks that a sentence lists.
const LISTED: usize = 12;

/// Arguments of `inks predict`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks predict mine/ -o full/\n  \
    foilpress inks diff builtin full/ -o diff.html\n  \
    foilpress print sample:ladder --library full --trust predicted")]
pub struct Args {
    /// Library with measured curves: its folder, or the name it was added under
    library: PathBuf,
    /// Folder to write: the same library with the predicted curves, and prediction.json with the fitted figures
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A measured stack as it is reported.
#[derive(Serialize)]
struct Row<'a> {
    #[serde(flatten)]
    left: &'a LeftOut,
    /// Distance d from the measured curve to the one that the others predict.
    distance: Option<f64>,
}

/// The content of `prediction.json`.
#[derive(Serialize)]
struct Report<'a> {
    format: u32,
    model: &'a str,
    /// Relative; none if no stack could be left out.
    leave_one_out: Option<f64>,
    measured: Vec<Row<'a>>,
    predicted: Vec<&'a Stack>,
    unknown: &'a [Stack],
    figures: &'a [FittedFigure],
}

/// Runs `inks predict`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<String> {
    let folder = libraries::folder(&args.library)?;
    let library = libraries::open(&folder)?;
    let staged = Staged::folder(&args.output, Kind::Predicted)?;
    observer.begin("leaving stacks out", library.origins().measured as u64);
    let found = library.predict(|| observer.advance(1));
    observer.end();
    let found = found?;
    let space = Space::half_angle(SAMPLES);
    let rows: Vec<Row<'_>> = found.measured.iter().map(|left| row(&library, &space, left)).collect();
    let report = Report {
        format: 1,
        model: &found.model,
        leave_one_out: found.error,
        measured: rows,
        predicted: found.stacks.iter().map(|predicted| &predicted.stack).collect(),
        unknown: &found.unknown,
        figures: &found.figures,
    };
    let members = members(&folder, &library, &found, &report)?;
    archive::place(&members, staged.create()?)?;
    let full = Library::open(&Disk, staged.path())
        .context("the predicted curves cannot be used as an ink library")?;
    staged.commit()?;
    if args.json {
        return Ok(serde_json::to_string_pretty(&report)? + "\n");
    }
    Ok(words(&report, &full, &args.output.display().to_string())?)
}

fn row<'a>(library: &Library, space: &Space, left: &'a LeftOut) -> Row<'a> {
    let distance = library.entry(&left.stack).zip(left.curve.as_ref()).map(|(entry, curve)| {
        let mut other = entry.clone();
        (other.curve, other.uncertainty) = (curve.clone(), None);
        compare(space, entry, &other).distance
    });
    Row { left, distance }
}

/// The files of the library with what was predicted.
fn members(
    folder: &std::path::Path,
    library: &Library,
    found: &Prediction,
    report: &Report<'_>,
) -> Result<Vec<archive::Member>> {
    let mut members = archive::gather(&Disk, folder).with_context(|| format!("{}", folder.display()))?;
    members.retain(|member| member.name != archive::PREDICTION);
    let (mut people, mut when) = (Vec::new(), "");
    for entry in library.entries() {
        if let Provenance::Measured { by, when: then, .. } = &entry.provenance {
            when = when.max(then);
            if !people.contains(&by.as_str()) {
                people.push(by);
            }
        }
    }
    let error = found.error.map_or_else(
        || "no stack could be left out to test it".into(),
        |error| format!("leave-one-out error {:.1} %", 100.0 * error),
    );
    let mut tables = String::new();
    for predicted in &found.stacks {
        let name = free(&members, &predicted.stack);
        let from = listed(predicted.from.iter());
        let setup = format!("layer model ({}) fitted to measured curves, here {from}; {error}", found.model);
        writeln!(tables, "\n[[predicted]]")?;
        for (key, value) in [
            ("stack", predicted.stack.to_string()),
            ("curve", name.clone()),
            ("by", people.join(", ")),
            ("when", when.to_owned()),
            ("setup", setup),
        ] {
            writeln!(tables, "{key} = {}", quoted(&value))?;
        }
        members.push(archive::Member { name, bytes: csv(predicted)?.into_bytes() });
    }
    if let Some(file) = members.iter_mut().find(|member| member.name == FILE_NAME) {
        file.bytes.extend(tables.bytes());
    }
    let figures = serde_json::to_vec_pretty(report)?;
    members.push(archive::Member { name: archive::PREDICTION.into(), bytes: figures });
    Ok(members)
}

/// A name for the curve of a stack that no other file has, whatever the case of its letters.
fn free(members: &[archive::Member], stack: &Stack) -> String {
    let name = curve_name(&stack.to_string());
    let taken = |name: &str| members.iter().any(|member| member.name.eq_ignore_ascii_case(name));
    let others = (2u32..).map(|n| name.replace(".csv", &format!("-{n}.csv")));
    std::iter::once(name.clone()).chain(others).find(|name| !taken(name)).unwrap_or(name)
}

fn csv(predicted: &Predicted) -> Result<String> {
    let mut text = "theta_h_deg,r,g,b,r_sigma,g_sigma,b_sigma,kind\n".to_owned();
    rows(&mut text, &predicted.curve, &predicted.sigma)?;
    Ok(text)
}

/// Lines of a predicted curve's file.
pub fn rows(text: &mut String, curve: &Curve, sigma: &[[f64; 3]]) -> Result<()> {
    for ((t, v), s) in curve.theta().iter().zip(curve.rgb()).zip(sigma) {
        let numbers = v.iter().chain(s).map(|v| format!("{v:.6e}")).collect::<Vec<_>>().join(",");
        writeln!(text, "{:.6},{numbers},predicted", t.to_degrees())?;
    }
    Ok(())
}

fn listed<'a>(stacks: impl Iterator<Item = &'a Stack>) -> String {
    let names: Vec<String> = stacks.map(ToString::to_string).collect();
    match names.len() {
        n if n <= LISTED => names.join(", "),
        n => format!("{} and {} more", names[..LISTED].join(", "), n - LISTED),
    }
}

fn words(report: &Report<'_>, full: &Library, output: &str) -> Result<String, std::fmt::Error> {
    let mut text =
        format!("{:<12} {:>9} {:>9} {:>9} {:>8}\n", "measured", "modelled", "fitted", "left out", "d");
    for row in &report.measured {
        let LeftOut { stack, modelled, fitted, left_out, .. } = row.left;
        let percent = |v: f64| format!("{:.1} %", 100.0 * v);
        let left_out = left_out.map_or_else(|| "-".into(), percent);
        let d = row.distance.map_or_else(|| "-".into(), |d| format!("{d:.4}"));
        writeln!(text, "{stack:<12} {:>9} {:>9} {left_out:>9} {d:>8}", percent(*modelled), percent(*fitted))?;
    }
    text.push_str(
        "\nColumns are root mean square differences from the measured curve: of the library's own figures, of the figures fitted\n\
         to all measured curves, and of those fitted to all but this one. d is the difference people see of the last (0.01:\n\
         barely visible; 0.05: obvious). A stack whose ink is in no other measured stack cannot be left out.\n\n",
    );
    match report.leave_one_out {
        Some(error) => writeln!(text, "leave-one-out error: {:.1} %", 100.0 * error)?,
        None => writeln!(text, "leave-one-out error: unknown; measure stacks that share inks")?,
    }
    writeln!(text, "predicted: {}", listed(report.predicted.iter().copied()))?;
    if !report.unknown.is_empty() {
        writeln!(
            text,
            "still modelled, since an ink in them was not measured: {}",
            listed(report.unknown.iter())
        )?;
    }
    writeln!(
        text,
        "\n{output}: {}\nNext: foilpress inks check {output}; print with --library {output} --trust predicted",
        full.origins()
    )?;
    Ok(text)
}
