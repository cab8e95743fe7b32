//! `foilpress preset`: named sets of options.
//!
//! A preset is a table of long options. It is applied before the arguments are parsed, as if its options had been typed first:
//! so it can hold any option of a command, its options are checked by the same rules, and typed options override it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use serde::{Deserialize, Serialize};

use crate::cli::console::{chain, say, show, usage};
use crate::folders;
use files::durable::{self, Access};
use files::{read_toml, write_toml};

/// `--preset`, for commands whose options a preset can hold.
#[derive(ClapArgs, Debug)]
pub struct PresetArg {
    /// Load a preset; options given here override it
    ///
    /// `foilpress preset save` makes a preset; `paper` is there from the start, the chain of the 2009 paper. Without --preset the
    /// one chosen by `foilpress preset use` applies, if there is one and its options fit the command; `none` stops that for this
    /// command.
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
}

/// Presets that are always there, unless one of the same name is saved: the chain of the 2009 paper.
const BUILT_IN: [(&str, &[(&str, &str)]); 1] =
    [("paper", &[("factor", "sacls"), ("halftone", "walk"), ("intent", "basis"), ("metric", "paper")])];

/// Where the name of a preset is expected, it means that none is to be used.
const NONE: &str = "none";

/// Arguments of `preset`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress preset save decal --media film --mirror --paper postcard\n  \
    foilpress print sample:leaf --preset decal --size 60mm\n  \
    foilpress preset use decal         (apply it from now on without naming it)\n  \
    foilpress preset use none\n  \
    foilpress preset remove decal\n  \
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
        #[arg(value_parser = new_name)]
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
    /// Remove a preset that was saved
    Remove {
        /// Name of the preset
        name: String,
    },
    /// Apply a preset to every command that it fits, without naming it; `none` stops that
    Use {
        /// Name of the preset, or none
        name: String,
    },
}

/// The name of a preset to save.
fn new_name(name: &str) -> Result<String, String> {
    if name == NONE {
        return Err("`none` means that no preset is used; choose another name".into());
    }
    folders::file(Path::new(""), name).map(|_| name.to_owned()).map_err(|error| error.to_string())
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

    /// The preset of this name, and its options as words.
    fn load(name: &str) -> Result<(Preset, Vec<String>)> {
        let path = folders::file(&presets()?, name)?;
        // A link that leads nowhere is a preset that cannot be used.
        if path.symlink_metadata().is_ok() {
            let bad = || format!("preset `{name}` cannot be used; correct its file, or save it again");
            let preset: Preset = read_toml(&path).with_context(bad)?;
            let words = preset.words().with_context(|| path.display().to_string()).with_context(bad)?;
            return Ok((preset, words));
        }
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, options)) => {
                let option = |(name, value): &(&str, &str)| (name.to_string(), value.to_string().into());
                let preset = Preset { options: options.iter().map(option).collect() };
                let words = preset.words()?;
                Ok((preset, words))
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

/// The presets that can be used, with their options as words.
#[cfg(feature = "serve")]
pub fn all() -> Result<Vec<(String, Vec<String>)>> {
    let loaded = names()?.into_iter().map(|name| Ok((name.clone(), Preset::load(&name)?.1)));
    loaded.collect()
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

/// Why these arguments would not be taken, in clap's words; `None` if they would.
fn refusal(program: &clap::Command, args: &[OsString]) -> Option<String> {
    // The first line says what is wrong, the others how to get help.
    let said = program.clone().try_get_matches_from(args).err()?.to_string();
    Some(said.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned())
}

/// Why a command would not take these options alone.
fn refused_by(command: &clap::Command, program: &clap::Command, words: &[String]) -> Option<String> {
    // A preset holds no file names, so any name will do for those that the command needs.
    let needed = command.get_arguments().filter(|arg| arg.is_required_set() || arg.get_id() == "document");
    let needed = needed.map(|arg| arg.get_long().map_or("name".into(), |long| format!("--{long}=name")));
    let start = ["foilpress".to_owned(), command.get_name().to_owned()];
    let args = start.into_iter().chain(words.iter().cloned()).chain(needed).map(OsString::from);
    refusal(program, &args.collect::<Vec<_>>())
}

/// Runs `preset`. `program` is the whole command line, whose commands decide which options fit.
pub fn run(args: &Args, program: &clap::Command) -> Result<()> {
    match &args.command {
        Command::Save { name, options } => save(name, options, program),
        Command::List { json } => list(*json),
        Command::Remove { name } => remove(name),
        Command::Use { name } => apply(name),
    }
}

fn save(name: &str, options: &[String], program: &clap::Command) -> Result<()> {
    let preset = Preset::of_words(options).map_err(usage)?;
    let words = preset.words()?;
    let able: Vec<&clap::Command> =
        program.get_subcommands().filter(|command| takes_preset(command)).collect();
    let refusals: Vec<Option<String>> =
        able.iter().map(|command| refused_by(command, program, &words)).collect();
    if words.iter().any(|word| word.starts_with("--preset")) {
        return Err(usage("a preset cannot load another preset"));
    }
    if let (true, Some(Some(first))) = (refusals.iter().all(Option::is_some), refusals.first()) {
        return Err(usage(format!("no command accepts these options together: {first}")));
    }
    let folder = presets()?;
    let path = folders::file(&folder, name)?;
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    write_toml(&path, &preset)?;
    let fits: Vec<&str> = able
        .into_iter()
        .zip(&refusals)
        .filter(|(_, refusal)| refusal.is_none())
        .map(|(command, _)| command.get_name())
        .collect();
    let instead = match BUILT_IN.iter().any(|(known, _)| known == &name) {
        true => "; it stands in for the built-in one of this name until it is removed",
        false => "",
    };
    show(&format!("{}: {} (for {}){instead}\n", path.display(), words.join(" "), fits.join(", ")))
}

/// Lists the presets, a line each. One that cannot be used says so.
fn list(json: bool) -> Result<()> {
    let used = in_use();
    let names = names()?;
    let presets = names.iter().map(|name| (name, used.as_ref() == Some(name), Preset::load(name)));
    if json {
        let row = |(name, in_use, preset): (&String, bool, Result<(Preset, Vec<String>)>)| {
            Ok(match preset {
                Ok((Preset { options }, _)) => {
                    serde_json::json!({ "name": name, "options": serde_json::to_value(options)?, "in_use": in_use })
                }
                Err(error) => serde_json::json!({ "name": name, "error": chain(&error), "in_use": in_use }),
            })
        };
        let rows = presets.map(row).collect::<Result<Vec<_>>>()?;
        return show(&format!("{}\n", serde_json::to_string_pretty(&rows)?));
    }
    let line = |(name, in_use, preset): (&String, bool, Result<(Preset, Vec<String>)>)| {
        let used = if in_use { "  (in use)" } else { "" };
        let words = preset.map_or_else(|error| chain(&error), |(_, words)| words.join(" "));
        format!("{name:<16} {words}{used}\n")
    };
    show(&presets.map(line).collect::<String>())
}

/// Removes a preset; if it is in use, none is from now on.
fn remove(name: &str) -> Result<()> {
    let path = folders::file(&presets()?, name)?;
    match std::fs::remove_file(&path) {
        Ok(()) => {}
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            if BUILT_IN.iter().any(|(known, _)| *known == name) {
                bail!("preset `{name}` is built in and stays");
            }
            bail!("there is no preset `{name}` (there are: {})", names().unwrap_or_default().join(", "));
        }
        Err(error) => return Err(error).with_context(|| format!("cannot remove {}", path.display())),
    }
    let is_built_in = BUILT_IN.iter().any(|(known, _)| *known == name);
    if in_use().as_deref() == Some(name) && !is_built_in {
        apply(NONE)?;
    }
    show(&format!(
        "removed preset `{name}`{}\n",
        if is_built_in { "; the built-in one stands again" } else { "" }
    ))
}

/// Applies a preset from now on, or none.
fn apply(name: &str) -> Result<()> {
    let path = marker()?;
    if name == NONE {
        return match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(error).with_context(|| format!("cannot remove {}", path.display()))
            }
            _ => show("no preset is in use\n"),
        };
    }
    let words = Preset::load(name)?.1.join(" ");
    durable::write(&path, format!("{name}\n").as_bytes(), Access::Everyone)
        .with_context(|| format!("cannot write {}", path.display()))?;
    show(&format!("applied from now on: {words}\n"))
}

/// The arguments with the options of a preset inserted, if one is named or in use.
pub fn expand(args: Vec<OsString>, program: &clap::Command) -> Result<Vec<OsString>> {
    let place = args.iter().skip(1).position(|arg| !arg.to_string_lossy().starts_with('-')).map(|at| at + 1);
    let Some(mut place) = place else { return Ok(args) };
    let Some(mut command) = program.find_subcommand(&args[place]) else { return Ok(args) };
    // `plan layers` takes the options of the inner command.
    while let Some(inner) = args.get(place + 1).and_then(|word| command.find_subcommand(word)) {
        (command, place) = (inner, place + 1);
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
    let (name, words) = match (&named, in_use()) {
        (Some(name), _) if name == NONE => return Ok(args),
        (Some(name), _) => (name.clone(), Preset::load(name)?.1),
        (None, Some(name)) => {
            let loaded =
                Preset::load(&name).context("a preset is in use (`foilpress preset use none` stops that)")?;
            (name, loaded.1)
        }
        (None, None) => return Ok(args),
    };
    let mut all = args[..=place].to_vec();
    all.extend(words.iter().map(OsString::from));
    all.extend_from_slice(typed);
    // What is wrong without the preset as well is told of the arguments alone.
    let refused = refusal(program, &all).filter(|_| refusal(program, &args).is_none());
    if let (Some(why), Some(_)) = (&refused, &named) {
        let path = folders::file(&presets()?, &name)?;
        let place = if path.is_file() { format!(" ({})", path.display()) } else { String::new() };
        return Err(usage(format!("preset `{name}`{place} does not fit this command: {why}")));
    }
    let quiet = args.iter().any(|arg| arg == "-q" || arg == "--quiet");
    if named.is_none() && !quiet {
        let what = match &refused {
            None => words.join(" "),
            Some(_) => "does not fit this command and is ignored".into(),
        };
        say(&format!("note: preset `{name}`: {what}"));
    }
    Ok(if refused.is_none() { all } else { args })
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
        // `preview` needs the name of a file to write, too.
        for command in ["print", "layers", "plan", "preview"] {
            let command = program.find_subcommand(command).unwrap();
            assert!(refused_by(command, &program, &["--meda=film".to_owned()]).unwrap().contains("--meda"));
            let words: &[String] = if command.get_name() == "preview" { &[] } else { &words };
            assert_eq!(refused_by(command, &program, words), None);
        }
    }
    #[test]
    fn no_preset_is_saved_under_a_name_that_stands_for_none() {
        let saved = |name: &str| {
            let typed = ["foilpress", "preset", "save", name, "--mirror"];
            crate::cli::Args::command().try_get_matches_from(typed).map(|_| ()).map_err(|e| e.to_string())
        };
        assert_eq!(saved("decal"), Ok(()));
        assert!(saved(NONE).unwrap_err().contains("no preset is used"));
        assert!(saved("../x").unwrap_err().contains("is not a valid name"));
    }
}
