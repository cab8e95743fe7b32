//! `foilpress profile`: calibration profiles of printers.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};

use crate::cli::arguments::layout::profiles;
use crate::cli::console::{chain, show, usage};
use crate::folders;
use press::layout::{Mm, Point, Profile};

/// Arguments of `profile`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress chart calibration --to serial:/dev/ttyACM0     (print it, then measure with a ruler)\n  \
    foilpress profile set default --cross 20.4x29.7mm --distance 200.3mm\n  \
    foilpress measure registration scan.png --chart registration.rgl --profile default\n  \
    foilpress profile list\n  \
    foilpress print sample:leaf --profile default")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// List the profiles
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Save measurements of the calibration chart as a profile; the profile `default` is used whenever none is named
    Set(Set),
}

#[derive(ClapArgs, Debug)]
struct Set {
    /// Name of the profile
    name: String,
    /// Centre of the first cross, measured from the left and top edges of the sheet
    #[arg(long, value_name = "X,Y")]
    cross: Point,
    /// Distance from the first cross to the one below it [default: not measured; the feed is taken as exact]
    #[arg(long, value_name = "LENGTH")]
    distance: Option<Mm>,
}

/// Runs `profile`.
pub fn run(args: &Args) -> Result<()> {
    match &args.command {
        Command::List { json } => list(*json),
        Command::Set(set) => {
            let profile = press::chart::calibration::profile(set.cross, set.distance);
            if let Some(problem) = profile.problem() {
                return Err(usage(format!("--cross and --distance make {problem}; measure them again")));
            }
            let path = save_profile(&set.name, &profile)?;
            show(&format!("{}: {}\n", path.display(), in_words(&profile)))
        }
    }
}

/// Lists the profiles, a line each. One that cannot be used says so.
fn list(json: bool) -> Result<()> {
    let folder = profiles()?;
    let names = folders::names(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let load = |name: &str| anyhow::Ok(Profile::load(&folders::file(&folder, name)?)?);
    let profiles = names.iter().map(|name| (name, load(name)));
    if json {
        let row = |(name, profile): (&String, Result<Profile>)| {
            let mut row = match profile {
                Ok(profile) => serde_json::to_value(profile)?,
                Err(error) => serde_json::json!({ "error": chain(&error) }),
            };
            row["name"] = name.as_str().into();
            anyhow::Ok(row)
        };
        let rows = profiles.map(row).collect::<Result<Vec<_>>>()?;
        return show(&format!("{}\n", serde_json::to_string_pretty(&rows)?));
    }
    let line = |(name, profile): (&String, Result<Profile>)| {
        let words = profile.map_or_else(|error| chain(&error), |profile| in_words(&profile));
        format!("{name:<16} {words}\n")
    };
    let text: String = profiles.map(line).collect();
    if text.is_empty() {
        return show(&format!(
            "no profiles in {}; print `foilpress chart calibration` to make one\n",
            folder.display()
        ));
    }
    show(&text)
}

/// Saves a profile under a name; nothing is written if it is none of a printer.
pub fn save_profile(name: &str, profile: &Profile) -> Result<PathBuf> {
    if let Some(problem) = profile.problem() {
        bail!("{problem}; measure again");
    }
    let folder = profiles()?;
    let path = folders::file(&folder, name)?;
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    profile.save(&path)?;
    Ok(path)
}

/// A profile in a line.
pub fn in_words(profile: &Profile) -> String {
    let Profile { offset_mm: [x, y], feed, skew_deg } = profile;
    let skew = if *skew_deg == 0.0 { String::new() } else { format!(", skew {skew_deg:.2} degrees") };
    format!("offset {x:.2}, {y:.2} mm, feed {feed:.4}{skew}")
}
