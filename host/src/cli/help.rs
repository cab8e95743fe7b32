//! What `-h` shows of each command: the options that most people need, on one screen.
//!
//! Problem: `print` has fifty options, and their help takes two hundred lines.
//! Method: [`FIRST`] names up to eight options of each command that has more than fit. They are listed first, in this order, and
//! `-h` shows only them, and examples. `--help` shows all: the others follow under the headings of [`GROUPS`].
//! Limits: clap lists subcommands alike in both, so the program's own `-h` hides the steps of `print`.

use clap::{Arg, ArgAction, Command};

/// Options that are about the program and not about the print.
pub const GENERAL: &str = "General options";

/// The options of a command that most people need, by their long names; positional arguments are always shown.
const FIRST: &[(&str, &[&str])] = &[
    ("print", &["size", "paper", "repeat", "inks", "intent", "preset", "output", "to"]),
    ("plan", &["size", "paper", "repeat", "inks", "intent", "preset", "html", "json"]),
    ("layers", &["size", "white", "finish", "passes", "mirror", "repeat", "output", "to"]),
    ("plan layers", &["size", "white", "finish", "passes", "mirror", "repeat", "html", "json"]),
    ("preview", &["output", "show", "light", "view", "zoom", "curl", "pixels", "size"]),
    ("compare", &["output", "job", "camera", "size", "paper", "at", "inks", "preset"]),
    ("display", &["pitch", "mask-size", "pixels", "stacks", "depth", "inks", "output", "to"]),
    ("edit", &["show", "basis", "rougher", "tint", "replace", "swap", "mask", "output"]),
    ("chart stacks", &["inks", "library", "strips", "paper", "repeat", "media", "output", "to"]),
    ("chart ramp", &["library", "halftone", "paper", "at", "media", "profile", "output", "to"]),
    ("chart ladder", &["library", "halftone", "paper", "at", "media", "profile", "output", "to"]),
    ("chart halftone", &["library", "paper", "at", "repeat", "media", "profile", "output", "to"]),
    ("chart registration", &["inks", "paper", "media", "output", "to", "yes", "copies", "json"]),
    ("chart calibration", &["ink", "paper", "media", "output", "to", "yes", "copies", "json"]),
    ("chart first", &["ink", "paper", "media", "output", "to", "yes", "copies", "json"]),
    ("chart heads", &["inks", "paper", "media", "output", "to", "yes", "copies", "json"]),
    ("layout", &["paper", "at", "repeat", "gap", "mirror", "crop-marks", "profile", "output"]),
    ("factor", &["bases", "factor", "seed", "material", "colour-space", "samples", "output"]),
    ("inks choose", &["cartridges", "inks", "library", "trust", "material", "json"]),
    ("map", &["inks", "intent", "metric", "library", "trust", "document", "seed", "output"]),
];

/// Examples that `-h` shows.
const EXAMPLES: usize = 3;

/// What the other options of these commands are about.
const GROUPS: &[(&str, &[&str])] = &[
    ("Document", &["straight", "highlight", "hdr", "material", "colour-space", "samples", "document"]),
    ("Artwork", &["reserved", "colour", "tolerance", "dpi", "page", "pages", "tones", "gamma", "accept"]),
    ("Layers of ink", &["order", "passes", "knockout", "white", "choke", "spread", "finish"]),
    (
        "Inks and materials",
        &["inks", "library", "trust", "bases", "factor", "seed", "intent", "metric", "halftone", "text"],
    ),
    ("Edits", &["glossier", "albedo", "mix", "steps"]),
    ("Display", &["cell", "transmission", "shift"]),
    (
        "Page",
        &[
            "size",
            "fit",
            "resolution",
            "paper",
            "at",
            "from",
            "repeat",
            "gap",
            "mirror",
            "crop-marks",
            "registration-marks",
            "camera-marks",
            "mark-ink",
            "crop",
            "profile",
            "media",
            "curl",
        ],
    ),
    ("View", &["figure", "light-probe", "distance", "middle", "seen-from", "tilt", "exposure", "tone-curve"]),
    ("Worn printer", &["registration-error", "feed-error", "missing-dots", "wear-seed", "dot-gain"]),
    ("Result", &["preset", "probe", "background", "output", "cut-lines", "json"]),
    ("Sending", &["to", "copies", "force", "yes"]),
];

/// The commands that `print` is made of; the short help of the program names them in a line of its own.
pub const STEPS: [&str; 7] = ["factor", "map", "halftone", "layout", "separate", "encode", "simulate"];

/// The command line with its help in order. With `short` the help that is asked for is `-h`.
pub fn arranged(program: Command, short: bool) -> Command {
    let hidden = |name: &str| short && STEPS.contains(&name);
    let version =
        Arg::new("version").short('V').long("version").action(ArgAction::Version).help("Print version");
    let program = program.disable_version_flag(true).arg(version.help_heading(GENERAL).display_order(902));
    below(program, "").mut_subcommands(|command| {
        let hide = hidden(command.get_name()) || command.is_hide_set();
        command.hide(hide)
    })
}

/// The same for a command and everything below it; `path` is the words that lead to it.
fn below(command: Command, path: &str) -> Command {
    let first = FIRST.iter().find(|(known, _)| *known == path).map(|(_, first)| *first);
    let command = match first {
        None => command,
        Some(first) => command.mut_args(|arg| {
            let Some(long) = arg.get_long() else { return arg };
            if let Some(place) = first.iter().position(|name| *name == long) {
                return arg.display_order(place);
            }
            let group = GROUPS.iter().find(|(_, names)| names.contains(&long));
            arg.hide_short_help(true).help_heading(group.map_or("More options", |(heading, _)| *heading))
        }),
    };
    let help =
        if first.is_some() { "Print help (-h) or help with all options (--help)" } else { "Print help" };
    let command = match command.get_after_help().map(ToString::to_string) {
        Some(after) if command.get_after_long_help().is_none() => {
            let examples = after.lines().take(1 + EXAMPLES).take_while(|line| !line.is_empty());
            command.after_help(examples.collect::<Vec<_>>().join("\n")).after_long_help(after)
        }
        _ => command,
    };
    // Clap's own stands before everything that has a heading.
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help).help(help);
    let command = command.disable_help_flag(true).arg(help.help_heading(GENERAL).display_order(901));
    command.mut_subcommands(|inner| {
        let path = format!("{path} {}", inner.get_name());
        below(inner, path.trim_start())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::program;

    /// Columns of the narrowest terminal.
    const COLUMNS: usize = 80;

    /// Each command with the words that lead to it, as `-h` and `--help` see it.
    fn commands(short: bool) -> Vec<(String, Command)> {
        fn add(command: &Command, path: &str, found: &mut Vec<(String, Command)>) {
            found.push((path.to_owned(), command.clone()));
            for inner in
                command.get_subcommands().filter(|inner| inner.get_name() != "help" && !inner.is_hide_set())
            {
                add(inner, format!("{path} {}", inner.get_name()).trim_start(), found);
            }
        }
        let mut program = program(short).term_width(COLUMNS);
        program.build();
        let mut found = Vec::new();
        add(&program, "", &mut found);
        found
    }

    /// The long names of the options that a help lists, in its order.
    fn listed(help: &str) -> Vec<&str> {
        // Descriptions, which may begin a line with an option, stand further to the right.
        let options = help
            .split("\nExample")
            .next()
            .unwrap_or(help)
            .lines()
            .map(|line| (line, line.trim_start()))
            .filter(|(line, text)| [2, 6].contains(&(line.len() - text.len())) && text.starts_with('-'));
        let long = options.filter_map(|(_, text)| text.split_once("--").map(|(_, rest)| rest));
        long.map(|rest| rest.split([' ', '=']).next().unwrap_or(rest)).collect()
    }

    #[test]
    fn short_help_is_one_screen_and_begins_with_what_people_need() {
        let commands = commands(true);
        assert!(commands.len() > 40, "{} commands", commands.len());
        for (path, mut command) in commands {
            let help = command.render_help().to_string();
            let lines = help.trim_end().lines().count();
            assert!(lines <= 40, "foilpress {path} -h has {lines} lines:\n{help}");
            if let Some((_, first)) = FIRST.iter().find(|(known, _)| *known == path) {
                assert!(first.len() <= 8, "{path}");
                assert_eq!(listed(&help)[..first.len()], **first, "{path}:\n{help}");
            }
        }
    }

    #[test]
    fn long_help_lists_every_option_once() {
        for (path, mut command) in commands(false) {
            let help = command.render_long_help().to_string();
            let mut listed = listed(&help);
            let mut options: Vec<String> = command
                .get_arguments()
                .filter(|arg| !arg.is_hide_set())
                .filter_map(|arg| arg.get_long().map(str::to_owned))
                .collect();
            listed.sort_unstable();
            options.sort_unstable();
            assert_eq!(listed, options, "{path}:\n{help}");
            assert!(!help.contains("More options"), "{path}: an option is in no group:\n{help}");
        }
    }

    #[test]
    fn every_command_and_option_named_here_exists() {
        let commands = commands(false);
        for (path, first) in FIRST {
            let command = commands.iter().find(|(known, _)| known == path).map(|(_, command)| command);
            let command = command.unwrap_or_else(|| panic!("there is no command {path}"));
            for name in *first {
                assert!(command.get_arguments().any(|arg| arg.get_long() == Some(name)), "{path} --{name}");
            }
        }
        for step in STEPS {
            assert!(commands.iter().any(|(path, _)| path == step), "{step}");
        }
    }
}
