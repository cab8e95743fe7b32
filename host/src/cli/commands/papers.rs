//! `foilpress papers`: paper sizes with their printable areas.

use std::fmt::Write as _;

use anyhow::Result;
use clap::Args as ClapArgs;

use crate::cli::console::show;
use press::layout;

/// Arguments of `papers`.
#[derive(ClapArgs, Debug)]
pub struct Args {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `papers`.
pub fn run(args: &Args) -> Result<()> {
    let table: Vec<_> = layout::paper::table().collect();
    if args.json {
        return show(&format!("{}\n", serde_json::to_string_pretty(&table)?));
    }
    let mut text =
        String::from("            sheet, mm        printable, mm    margins: left, top, right, bottom\n");
    for paper in table {
        let ((width, length), (across, along)) = (paper.sheet_mm, paper.printable_mm);
        let [left, top, right, bottom] = paper.margins_mm;
        writeln!(
            text,
            "{:<10} {width:>6.1} x {length:<6.1}  {across:>6.1} x {along:<6.1}  {left:>4.1} {top:>5.1} {right:>4.1} \
             {bottom:>5.1}  {}",
            paper.name, paper.known
        )?;
    }
    text.push_str("Any other size: --paper 120x180mm, for example, with the margins of a4.\n");
    show(&text)
}
