//! `foilpress inks diff`: two libraries, stack by stack.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use appearance::brdf::{Difference, Space, compare, plot};
use inks::{Entry, Library, Origins, Stack};
use observe::visible_line;
use press::html::{self, escape};
use serde::Serialize;

use super::page;
use crate::libraries;

/// Angles at which curves are compared.
const SAMPLES: usize = 96;
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Arguments of `inks diff`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks diff builtin my-library/\n  \
    foilpress inks diff builtin my-library/ -o diff.html  (both curves of every stack that differs)")]
pub struct Args {
    /// First library: a folder, the name of a library that was added, or `builtin`
    #[arg(value_name = "LIBRARY")]
    first: PathBuf,
    /// Second library
    #[arg(value_name = "LIBRARY")]
    second: PathBuf,
    /// Also write one self-contained page with both curves of each stack that differs
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row<'a> {
    stack: &'a Stack,
    #[serde(flatten)]
    difference: Difference,
    #[serde(skip)]
    entries: [&'a Entry; 2],
}

impl Row<'_> {
    fn is_equal(&self) -> bool {
        self.difference.distance <= 1e-9
    }

    /// What the measurement says about the difference.
    fn verdict(&self) -> &'static str {
        match self.difference.within {
            Some(true) => "within the measurement",
            Some(false) => "beyond the measurement",
            None => "",
        }
    }

    fn largest(&self) -> String {
        let largest = &self.difference.largest;
        let times = match largest.ratio {
            ratio if (0.1..10.0).contains(&ratio) => format!("{:+.0} %", 100.0 * (ratio - 1.0)),
            ratio if ratio > 1.0 => format!("{ratio:.0} times the"),
            ratio => format!("1/{:.0} of the", 1.0 / ratio),
        };
        format!("{times} {} at {:.0} deg", CHANNELS[largest.channel], largest.theta_deg)
    }

    fn band(&self) -> String {
        self.difference.band.map_or_else(|| "-".into(), |band| format!("{band:.4}"))
    }
}

#[derive(Serialize)]
struct Report<'a> {
    first: &'a str,
    second: &'a str,
    /// How many curves of each are measured, predicted and modelled.
    #[serde(skip)]
    origins: [Origins; 2],
    stacks: &'a [Row<'a>],
    only_first: Vec<&'a Stack>,
    only_second: Vec<&'a Stack>,
}

fn only<'a>(library: &'a Library, other: &Library) -> Vec<&'a Stack> {
    library.entries().iter().map(|entry| &entry.stack).filter(|stack| other.entry(stack).is_none()).collect()
}

/// Runs `inks diff`.
pub fn run(args: &Args) -> Result<String> {
    let (first, second) = (libraries::open(&args.first)?, libraries::open(&args.second)?);
    let space = Space::half_angle(SAMPLES);
    let mut rows: Vec<Row<'_>> = first
        .entries()
        .iter()
        .filter_map(|a| second.entry(&a.stack).map(|b| (a, b)))
        .map(|(a, b)| Row { stack: &a.stack, difference: compare(&space, a, b), entries: [a, b] })
        .collect();
    if rows.is_empty() {
        bail!("the two libraries have no stack in common");
    }
    rows.sort_by(|a, b| b.difference.distance.total_cmp(&a.difference.distance));
    let report = Report {
        first: first.name(),
        second: second.name(),
        origins: [first.origins(), second.origins()],
        stacks: &rows,
        only_first: only(&first, &second),
        only_second: only(&second, &first),
    };
    if let Some(output) = &args.output {
        write_page(output, &report)?;
    }
    if args.json {
        return Ok(serde_json::to_string_pretty(&report)? + "\n");
    }
    let mut text = words(&report)?;
    if let Some(output) = &args.output {
        writeln!(text, "\npage written to {}", output.display())?;
    }
    Ok(text)
}

fn listed(stacks: &[&Stack]) -> String {
    stacks.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

fn words(report: &Report<'_>) -> Result<String> {
    let mut text = format!(
        "first:  {}\n        {}\nsecond: {}\n        {}\n\n",
        visible_line(report.first),
        report.origins[0],
        visible_line(report.second),
        report.origins[1]
    );
    let differ: Vec<_> = report.stacks.iter().filter(|row| !row.is_equal()).collect();
    if !differ.is_empty() {
        writeln!(text, "{:<10} {:>7} {:>7}  {:<28} verdict", "stack", "d", "band", "largest difference")?;
    }
    for row in &differ {
        let line = format!(
            "{:<10} {:>7.4} {:>7}  {:<28} {}",
            row.stack,
            row.difference.distance,
            row.band(),
            row.largest(),
            row.verdict()
        );
        writeln!(text, "{}", line.trim_end())?;
    }
    writeln!(
        text,
        "{}{} stacks are equal",
        if differ.is_empty() { "" } else { "\n" },
        report.stacks.len() - differ.len()
    )?;
    for (stacks, which) in [(&report.only_first, "first"), (&report.only_second, "second")] {
        if !stacks.is_empty() {
            writeln!(text, "only in the {which}: {}", listed(stacks))?;
        }
    }
    text.push_str(
        "\nd is the difference people see (0.01: barely visible; 0.05: obvious). The band is the d that two standard\n\
         deviations of the measurement make. The largest difference is that of the second to the first.\n",
    );
    Ok(text)
}

fn write_page(target: &Path, report: &Report<'_>) -> Result<()> {
    let mut body = format!(
        "<p>Lines: {} ({}). Dashed: {} ({}). Bands are two standard deviations.</p>",
        escape(report.first),
        report.origins[0],
        escape(report.second),
        report.origins[1]
    );
    let differ = || report.stacks.iter().filter(|row| !row.is_equal());
    if differ().next().is_some() {
        body.push_str(&html::wide("differences"));
        body.push_str(
            "<table><tr><th>stack<th class=n>d<th class=n>light<th class=n>band<th>largest difference<th>verdict",
        );
    }
    for row in differ() {
        write!(
            body,
            "<tr><td><a href=\"#{0}\">{0}</a><td class=n>{1:.4}<td class=n>{2:.4}<td class=n>{3}<td>{4}<td>{5}",
            row.stack,
            row.difference.distance,
            row.difference.light,
            row.band(),
            row.largest(),
            row.verdict()
        )?;
    }
    if differ().next().is_some() {
        body.push_str("</table></div>");
    }
    let equal = report.stacks.len() - differ().count();
    write!(body, "<p>{equal} stacks are equal.")?;
    for (stacks, name) in [(&report.only_first, report.first), (&report.only_second, report.second)] {
        if !stacks.is_empty() {
            write!(body, " Only in {}: {}.", escape(name), listed(stacks))?;
        }
    }
    body.push_str("</p>");
    for row in differ() {
        let lines = row
            .entries
            .map(|entry| plot::Line { curve: &entry.curve, uncertainty: entry.uncertainty.as_ref() });
        let title = format!("{}: d = {:.4}", row.stack, row.difference.distance);
        let plot = html::drawing(&format!("curves of {}", row.stack), &plot::compared(&title, &lines)?);
        write!(body, "<h2 id=\"{0}\">{0} {1}</h2>{plot}", row.stack, row.verdict())?;
    }
    page::write(target, "Two ink libraries", &body)
}
