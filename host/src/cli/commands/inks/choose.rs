//! `foilpress inks choose`: the best cartridges for a document, and what each is worth.

use std::fmt::Write as _;

use anyhow::Result;
use appearance::gamut::{self, Choice, GamutSettings, Printable, Worth};
use observe::Observer;
use press::separate::MOST_CARTRIDGES;
use serde_json::{Value, json};

use crate::cli::arguments::choice::whole;
use crate::cli::arguments::{DocumentArgs, InkArgs};

/// Arguments of `inks choose`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress inks choose my-material/ --cartridges 4\n  \
    foilpress inks choose my-material/ --inks all --json")]
pub struct Args {
    #[command(flatten)]
    document: DocumentArgs,
    /// Number of cartridges; the printer holds seven
    #[arg(long, value_name = "NUMBER", default_value_t = MOST_CARTRIDGES, value_parser = whole(1..=MOST_CARTRIDGES))]
    cartridges: usize,
    #[command(flatten)]
    inks: InkArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs `inks choose`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<String> {
    let (set, library) = args.inks.at_hand()?;
    let document = args.document.open(|| Ok((set, library.clone())), observer)?;
    let materials = document.materials();
    let printable = Printable::combined(&library, &set, materials.space());
    let settings = GamutSettings { most_cartridges: args.cartridges, ..GamutSettings::default() };
    let choice = gamut::choose(materials, &printable, &settings, observer)?;
    if args.json {
        return Ok(serde_json::to_string_pretty(&report(&choice))? + "\n");
    }
    Ok(words(&choice, &document.name, set.len())?)
}

fn report(choice: &Choice) -> Value {
    let one = |worth: &Worth| {
        json!({
            "ink": worth.ink.name(), "material": worth.material, "share": worth.share,
            "with": worth.with, "without": worth.without, "hue_share": worth.hue,
        })
    };
    json!({
        "cartridges": choice.chosen.iter().map(one).collect::<Vec<_>>(),
        "left_out": choice.given_up.iter().map(one).collect::<Vec<_>>(),
        "distance": choice.distance,
        "distance_with_all": choice.all,
        "pixels": choice.pixels,
    })
}

fn words(choice: &Choice, name: &str, at_hand: usize) -> Result<String, std::fmt::Error> {
    let mut text = format!("best cartridges for {name}: {} of {at_hand}\n", choice.chosen.len());
    for (title, inks) in [("cartridge", &choice.chosen), ("left out", &choice.given_up)] {
        if inks.is_empty() {
            continue;
        }
        writeln!(text, "\n{title:<18} {:>8} {:>11}  serves most", "with it", "without it")?;
        for Worth { ink, material, share, with, without, hue } in inks {
            let share = 100.0 * share;
            write!(text, "{:<18} {with:>8.4} {without:>11.4}  the {material}, {share:.1} %", ink.name())?;
            if *hue >= 0.005 {
                write!(text, "; the hue of {:.0} %", 100.0 * hue)?;
            }
            writeln!(text)?;
        }
    }
    writeln!(
        text,
        "\n{:.4} with these cartridges, {:.4} with all inks at hand: root mean square differences over {} pixels,\n\
         light, hue and grain included (0.01: barely visible; 0.05: obvious).",
        choice.distance, choice.all, choice.pixels
    )?;
    Ok(text)
}
