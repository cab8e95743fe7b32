//! `foilpress preset`: named sets of options.
//!
//! A preset is a table of long options. It is applied before the arguments are parsed, as if its options had been typed first:
//! so it can hold any option of a command, its options are checked by the same rules, and typed options override it.

use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use serde::{Deserialize, Serialize};

use super::stdio::show;
use crate::folders;
use press::files::{read_toml, write_toml};

/// `--preset`, for commands whose options a preset can hold.
#[derive(ClapArgs, Debug)]
pub struct PresetArg {
    /// Load a preset; options given here override it
    ///
    /// `foilpress preset save` makes a preset; `paper` is there from the start, the chain of the 2009 paper. Without --preset the one chosen by `foilpress preset use` applies, if there is
    /// one and its options fit the command.
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
}

/// Presets that are always there, unless one of the same name is saved: the chain of the 2009 paper.
const BUILT_IN: [(&str, &[(&str, &str)]); 1] =
    [("paper", &[("factor", "sacls"), ("halftone", "walk"), ("intent", "basis"), ("metric", "paper")])];

/// Arguments of `preset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress preset save decal --media film --mirror --paper postcard\n  \
    foilpress print sample:leaf --preset decal --size 60mm\n  \
    foilpress preset use decal         (apply it from now on without naming it)\n  \
    foilpress preset use none\n  \
    foilpress preset list")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Save options under a name, replacing any preset of that name
    Save {
        /// Name of the preset
        name: String,
        /// Options to save, by their long names, as they would be typed
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, required = true, value_name = "OPTIONS")]
        options: Vec<String>,
    },
    /// List the presets and show which one is in use
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Apply a preset to every command that it fits, without naming it; `none` stops that
    Use {
        /// Name of the preset, or none
        name: String,
    },
}

/// A preset as it is saved.
#[derive(Serialize, Deserialize, Debug, PartialEq)]
#[serde(deny_unknown_fields)]
struct Preset {
    options: toml::Table,
}

impl Preset {
    /// Options as typed: `--name value`, `--name=value` or `--name`.
    fn of_words(words: &[String]) -> Result<Preset> {
        let mut options = toml::Table::new();
        let mut words = words.iter().peekable();
        while let Some(word) = words.next() {
            let Some(name) = word.strip_prefix("--").filter(|name| !name.is_empty()) else {
                bail!(
                    "`{word}` is not an option; a preset takes options by their long names, such as --media film"
                );
            };
            let (name, value) = match name.split_once('=') {
                Some((name, value)) => (name, Some(value.to_owned())),
                None => (name, words.next_if(|next| !next.starts_with("--")).cloned()),
            };
            let value = value.map_or(toml::Value::Boolean(true), toml::Value::String);
            if options.insert(name.to_owned(), value).is_some() {
                bail!("--{name} is given twice");
            }
        }
        Ok(Preset { options })
    }

    /// The options as words.
    fn words(&self) -> Result<Vec<String>> {
        let mut words = Vec::new();
        for (name, value) in &self.options {
            match value {
                toml::Value::Boolean(false) => {}
                toml::Value::Boolean(true) => words.push(format!("--{name}")),
                toml::Value::String(text) => words.push(format!("--{name}={text}")),
                toml::Value::Integer(number) => words.push(format!("--{name}={number}")),
                toml::Value::Float(number) => words.push(format!("--{name}={number}")),
                _ => bail!("option {name}: expected text, a number, true or false"),
            }
        }
        Ok(words)
    }

    fn load(name: &str) -> Result<Preset> {
        let path = folders::file(&presets()?, name)?;
        if path.is_file() {
            return Ok(read_toml(&path)?);
        }
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, options)) => {
                let option = |(name, value): &(&str, &str)| (name.to_string(), value.to_string().into());
                Ok(Preset { options: options.iter().map(option).collect() })
            }
            None => bail!(
                "there is no preset `{name}` (there are: {}); `foilpress preset save {name} OPTIONS` creates it",
                names().unwrap_or_default().join(", ")
            ),
        }
    }
}

/// The presets there are, in the order of their names.
fn names() -> Result<Vec<String>> {
    let folder = presets()?;
    let mut names = folders::names(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    names.extend(BUILT_IN.iter().map(|(name, _)| name.to_string()));
    names.sort();
    names.dedup();
    Ok(names)
}

fn presets() -> Result<PathBuf> {
    Ok(folders::config()?.join("presets"))
}

/// The file that names the preset in use.
fn marker() -> Result<PathBuf> {
    Ok(folders::config()?.join("preset-in-use"))
}

/// The preset in use, if there is one.
fn in_use() -> Option<String> {
    let text = std::fs::read_to_string(marker().ok()?).ok()?;
    let name = text.trim();
    (!name.is_empty()).then(|| name.to_owned())
}

/// Whether a command takes `--preset`.
fn takes_preset(command: &clap::Command) -> bool {
    command.get_arguments().any(|arg| arg.get_id() == "preset")
}

/// Why a command would not take these options, in clap's words; `None` if it would.
fn refusal(program: &clap::Command, command: &[&str], words: &[String]) -> Option<String> {
    let typed = ["foilpress"].iter().chain(command).map(|&name| name.to_owned()).chain(words.iter().cloned());
    // A preset holds no file names, so any name of a document will do.
    match program.clone().try_get_matches_from(typed.chain(["document".to_owned()])) {
        Ok(_) => None,
        // The first line says what is wrong, the others how to get help.
        Err(error) => Some(error.to_string().lines().next().unwrap_or_default().to_owned()),
    }
}

/// Runs `preset`. `program` is the whole command line, whose commands decide which options fit.
pub fn run(args: &Args, program: &clap::Command) -> Result<()> {
    match &args.command {
        Command::Save { name, options } => save(name, options, program),
        Command::List { json } => list(*json),
        Command::Use { name } => apply(name),
    }
}

fn save(name: &str, options: &[String], program: &clap::Command) -> Result<()> {
    let preset = Preset::of_words(options)?;
    let words = preset.words()?;
    let able: Vec<&str> = program
        .get_subcommands()
        .filter(|command| takes_preset(command))
        .map(clap::Command::get_name)
        .collect();
    let refusals: Vec<Option<String>> =
        able.iter().map(|&command| refusal(program, &[command], &words)).collect();
    if words.iter().any(|word| word.starts_with("--preset")) {
        bail!("a preset cannot load another preset");
    }
    if let (true, Some(Some(first))) = (refusals.iter().all(Option::is_some), refusals.first()) {
        bail!("no command accepts these options together: {}", first.trim_start_matches("error: "));
    }
    let folder = presets()?;
    let path = folders::file(&folder, name)?;
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    write_toml(&path, &preset)?;
    let fits: Vec<&str> = able
        .into_iter()
        .zip(&refusals)
        .filter(|(_, refusal)| refusal.is_none())
        .map(|(name, _)| name)
        .collect();
    show(&format!("{}: {} (for {})\n", path.display(), words.join(" "), fits.join(", ")))
}

fn list(json: bool) -> Result<()> {
    let names = names()?;
    let used = in_use();
    if json {
        let preset = |name: &String| {
            let preset = Preset::load(name)?;
            let in_use = used.as_ref() == Some(name);
            let options = serde_json::to_value(&preset.options)?;
            anyhow::Ok(serde_json::json!({ "name": name, "options": options, "in_use": in_use }))
        };
        let presets = names.iter().map(preset).collect::<Result<Vec<_>>>()?;
        return show(&format!("{}\n", serde_json::to_string_pretty(&presets)?));
    }
    let mut text = String::new();
    for name in &names {
        let words = Preset::load(name)?.words()?.join(" ");
        let used = if used.as_deref() == Some(name) { "  (in use)" } else { "" };
        text.push_str(&format!("{name:<16} {words}{used}\n"));
    }
    show(&text)
}

/// Applies a preset from now on, or none.
fn apply(name: &str) -> Result<()> {
    let path = marker()?;
    if name == "none" {
        return match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(error).with_context(|| format!("cannot remove {}", path.display()))
            }
            _ => show("no preset is in use\n"),
        };
    }
    let words = Preset::load(name)?.words()?.join(" ");
    std::fs::write(&path, format!("{name}\n")).with_context(|| format!("cannot write {}", path.display()))?;
    show(&format!("applied from now on: {words}\n"))
}

/// The arguments with the options of a preset inserted, if one is named or in use.
pub fn expand(args: Vec<OsString>, program: &clap::Command) -> Result<Vec<OsString>> {
    let place = args.iter().skip(1).position(|arg| !arg.to_string_lossy().starts_with('-')).map(|at| at + 1);
    let Some(mut place) = place else { return Ok(args) };
    let Some(mut command) = program.find_subcommand(&args[place]) else { return Ok(args) };
    let mut path = vec![command.get_name()];
    // `plan layers` takes the options of the inner command.
    while let Some(inner) = args.get(place + 1).and_then(|word| command.find_subcommand(word)) {
        (command, place) = (inner, place + 1);
        path.push(command.get_name());
    }
    if !takes_preset(command) {
        return Ok(args);
    }
    let typed = &args[place + 1..];
    let end = typed.iter().position(|arg| arg == "--").unwrap_or(typed.len());
    let named = typed[..end].iter().enumerate().find_map(|(at, arg)| {
        let arg = arg.to_str()?;
        match arg.strip_prefix("--preset=") {
            Some(name) => Some(name.to_owned()),
            None if arg == "--preset" => Some(typed.get(at + 1)?.to_str()?.to_owned()),
            None => None,
        }
    });
    let words = match (&named, in_use()) {
        (Some(name), _) => Preset::load(name)?.words().with_context(|| format!("preset `{name}`"))?,
        (None, Some(name)) => {
            let words = Preset::load(&name).and_then(|preset| preset.words()).with_context(|| {
                format!("preset `{name}` is in use (`foilpress preset use none` stops that)")
            })?;
            let quiet = args.iter().any(|arg| arg == "-q" || arg == "--quiet");
            let fits = refusal(program, &path, &words).is_none();
            if !quiet {
                let what =
                    if fits { words.join(" ") } else { "does not fit this command and is ignored".into() };
                let _ = writeln!(std::io::stderr(), "note: preset `{name}`: {what}");
            }
            if !fits {
                return Ok(args);
            }
            words
        }
        (None, None) => return Ok(args),
    };
    let mut all = args[..=place].to_vec();
    all.extend(words.into_iter().map(OsString::from));
    all.extend_from_slice(typed);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn options_come_back_as_they_were_typed() {
        let typed = ["--media", "film", "--mirror", "--size=8cm", "--at", "-1x2mm"].map(str::to_owned);
        let preset = Preset::of_words(&typed).unwrap();
        let text = toml::to_string(&preset).unwrap();
        let read: Preset = toml::from_str(&text).unwrap();
        assert_eq!(read, preset);
        let mut words = read.words().unwrap();
        words.sort();
        assert_eq!(words, ["--at=-1x2mm", "--media=film", "--mirror", "--size=8cm"]);
        for wrong in [&["-q"][..], &["film"], &["--"], &["--a", "--a"]] {
            let words: Vec<String> = wrong.iter().map(|&word| word.to_owned()).collect();
            assert!(Preset::of_words(&words).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn typed_options_override_a_preset() {
        let words: Vec<String> =
            ["--media=film", "--media=thick", "--mirror", "--mirror"].map(str::to_owned).to_vec();
        let program = crate::cli::Args::command();
        assert_eq!(refusal(&program, &["print"], &words), None);
        assert!(refusal(&program, &["print"], &["--meda=film".to_owned()]).is_some());
    }
}
