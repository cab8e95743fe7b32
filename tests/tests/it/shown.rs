//! Commands that the README, the guides and the help show, run on small documents, or as they stand where
//! [everything is tried](testing::is_full).
//!
//! Small is a sixth of every length on paper and of every picture's side, and 150 pixels for a preview; each
//! word of a command is there, in its order. What prints a document or art is asked for its plan instead ([`planned`]):
//! the same words decide the same dots, and pictures and pages of a print are what other tests look at. What
//! a later command would have of such a print is then not there, and the command has to say so; that its
//! words are wrong it would say first. A document's commands run in order, in a copy of the folders that it
//! speaks of, so that later lines find what earlier ones made. What goes to a bridge goes to one that this
//! test serves: only the address is another. [`ELSEWHERE`] names the commands that need more than that, and
//! who runs them.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use appearance::document::write_sample;
use appearance::sample::SAMPLES;
use foilpress_tests::served::{Bridge, Port};
use observe::Silent;
use protocol::ink::Ink;
use testing::program::{self, small_document};

/// Commands that are not run here, by their first words, and why.
const ELSEWHERE: [(&str, &str); 21] = [
    ("foilpress bridge flash", "needs a board in its boot loader: tests/it/emulator/flash.rs"),
    ("foilpress queue", "changes the computer's print system: tests/it/queue/system.rs"),
    ("foilpress serve", "runs until Ctrl-C: tests/it/serve/mod.rs"),
    ("lp ", "needs a print server: tests/it/queue/mod.rs"),
    ("gs ", "is Ghostscript's own"),
    ("cargo ", "is the build itself, and the gate"),
    ("apt ", "is the system's own"),
    ("cat job.rgl > /dev/usb/lp0", "needs a printer; the program never opens such a device unasked"),
    ("foilpress inspect page.md5k", "needs Ghostscript: press::inspect::ghostscript"),
    ("foilpress bridge list", "needs USB: tests/it/emulator/found.rs"),
    ("foilpress resume", "needs an interrupted job: tests/it/link/process.rs, tests/it/emulator/mod.rs"),
    ("foilpress cancel", "needs an interrupted job: tests/it/link/process.rs, tests/it/emulator/mod.rs"),
    ("foilpress bridge status --watch", "runs until Ctrl-C: tests/it/emulator/care.rs"),
    ("foilpress bridge jobs --print", "needs a stored job: bridge/tests/it/alone.rs"),
    ("foilpress bridge jobs --delete", "needs a stored job: bridge/tests/it/alone.rs"),
    ("foilpress bridge log", "needs the firmware's debug data: tests/it/emulator/care.rs"),
    ("foilpress bridge test", "needs a loop-back plug, or no printer: tests/it/emulator/care.rs"),
    ("foilpress compare", "needs photographs: host/tests/it/compare/mod.rs"),
    ("foilpress measure", "needs photographs: host/tests/it/measure.rs"),
    ("foilpress doctor", "judges the whole computer: tests/it/emulator/mod.rs"),
    ("foilpress generate", "is for packages: `cargo xtask package` runs it"),
];

/// Documents that show commands, and the folder these are typed in.
const DOCUMENTS: [(&str, &str); 16] = [
    ("README.md", "."),
    ("docs/guide.md", "."),
    ("docs/guide/charts.md", "."),
    ("docs/guide/compare.md", "."),
    ("docs/guide/decals.md", "docs/guide/decal"),
    ("docs/guide/display.md", "."),
    ("docs/guide/edit.md", "."),
    ("docs/guide/libraries.md", "docs/guide"),
    ("docs/guide/page.md", "."),
    ("docs/guide/preview.md", "."),
    ("docs/guide/queue.md", "."),
    ("docs/guide/serve.md", "."),
    ("docs/guide/two-pictures.md", "docs/guide/views"),
    ("docs/emulator.md", "."),
    ("docs/measuring-inks.md", "."),
    ("docs/wiring.md", "."),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("this package lies in the project")
}

/// The commands in a document's code blocks: continued lines joined, comments cut off.
fn commands(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let (mut inside, mut continues) = (false, false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
            continue;
        }
        if !inside {
            continue;
        }
        let line =
            line.split(" # ").next().unwrap_or_default().split("   #").next().unwrap_or_default().trim();
        let (line, goes_on) = line.strip_suffix('\\').map_or((line, false), |line| (line.trim_end(), true));
        match found.last_mut().filter(|_| continues) {
            Some(last) => *last = format!("{last} {line}"),
            None => found.push(line.to_owned()),
        }
        continues = goes_on;
    }
    found.retain(|line| is_command(line));
    found
}

fn is_command(line: &str) -> bool {
    let line = line.strip_prefix("sudo ").unwrap_or(line);
    ["foilpress ", "cargo ", "lp ", "gs ", "apt ", "cat ", "cd ", "mkdir "].iter().any(|word| line.starts_with(word))
        // A drawing of the chain is no command.
        && !line.contains("──")
}

/// Why this command is not run here.
fn elsewhere(command: &str) -> Option<&'static str> {
    let command = command.strip_prefix("sudo ").unwrap_or(command);
    ELSEWHERE.iter().find(|(words, _)| command.starts_with(words)).map(|(_, why)| *why)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// What every length is divided by.
const SMALLER: f64 = 6.0;

/// The command with the numbers behind this option smaller.
fn scaled(command: &str, option: &str) -> String {
    let option = format!(" {option} ");
    let Some((before, rest)) = command.split_once(&option) else { return command.to_owned() };
    let (value, after) = rest.split_at(rest.find(' ').unwrap_or(rest.len()));
    let unit = value.trim_start_matches(|c: char| c.is_ascii_digit() || ".x".contains(c));
    let numbers = value[..value.len() - unit.len()].split('x').map(|number| {
        let number: f64 = number.parse().expect("a number");
        (number / SMALLER).round().to_string()
    });
    format!("{before}{option}{}{unit}{after}", numbers.collect::<Vec<_>>().join("x"))
}

/// What becomes of a print that is only planned: the command, and the files and folders that it does not
/// make. `None` for everything that is no print.
fn planned(command: &str) -> Option<(String, Vec<String>)> {
    let mut words = command.split(' ');
    let (mut plan, mut unmade) = match (words.next()?, words.next()?) {
        ("foilpress", "print") => ("foilpress plan".to_owned(), Vec::new()),
        ("foilpress", "layers") => ("foilpress plan layers".to_owned(), Vec::new()),
        _ => return None,
    };
    let mut document = None;
    while let Some(word) = words.next() {
        match word {
            "--yes" => {}
            "-o" | "--to" => {
                let made = words.next()?;
                unmade.push(made.strip_prefix("file:").unwrap_or(made).to_owned());
            }
            "--copies" | "--probe" => drop(words.next()),
            word => {
                document = document.or(Some(word).filter(|word| !word.starts_with('-')));
                plan = format!("{plan} {word}");
            }
        }
    }
    // Where it goes if nothing else is said.
    let name = document.and_then(|document| Path::new(document).file_name()?.to_str());
    unmade.extend(name.map(|name| format!("{name}.print")));
    Some((plan, unmade))
}

/// Makes a sample's maps and its size on paper smaller.
fn shrink(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "png") {
            let map = image::open(&path).unwrap();
            let side = |side: u32| (f64::from(side) / SMALLER).ceil() as u32;
            let filter = image::imageops::FilterType::Triangle;
            map.resize_exact(side(map.width()), side(map.height()), filter).save(&path).unwrap();
        }
    }
    let path = folder.join("material.toml");
    let mut settings: toml::Table = toml::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    for side in settings["size_mm"].as_array_mut().expect("two sides") {
        *side = toml::Value::Float(side.as_float().expect("a length") / SMALLER);
    }
    fs::write(&path, settings.to_string()).unwrap();
}

/// A folder to type commands in, and a bridge.
struct Desk {
    folder: tempfile::TempDir,
    bridge: Bridge,
    address: String,
}

impl Desk {
    fn new() -> Desk {
        let folder = tempfile::tempdir().unwrap();
        copy(&root().join("docs/guide"), &folder.path().join("docs/guide"));
        copy(&root().join("docs/pictures"), &folder.path().join("docs/pictures"));
        let bin = folder.path().join("bin");
        fs::create_dir(&bin).unwrap();
        std::os::unix::fs::symlink(program::path(), bin.join("foilpress")).unwrap();
        // The printer has what the samples ask for, and takes a page in a moment.
        let inks =
            [Ink::Cyan, Ink::Magenta, Ink::Yellow, Ink::Black, Ink::MetallicSilver, Ink::Finish, Ink::White];
        let (bridge, address) =
            Bridge::on_tcp(([127, 0, 0, 1], 0).into(), Port::new(&inks, 1 << 20)).unwrap();
        Desk { folder, bridge, address: format!("tcp:{address}") }
    }

    /// The command with this desk's addresses for those of a real one, and this desk's documents.
    fn here(&self, command: &str) -> String {
        let mut command = command.strip_prefix("sudo ").unwrap_or(command).to_owned();
        if !testing::is_full() {
            for sample in SAMPLES {
                let (name, small) =
                    (format!("sample:{}", sample.name), self.folder.path().join("samples").join(sample.name));
                if command.contains(&name) {
                    if fs::create_dir_all(&small).is_ok() && !small.join("material.toml").exists() {
                        write_sample(&sample, &small).unwrap();
                        shrink(&small);
                    }
                    command = command.replace(&name, &small.display().to_string());
                }
            }
            for (option, of) in
                [("--size", "foilpress"), ("--middle", "foilpress"), ("--pixels", "foilpress preview")]
            {
                if command.contains(of) {
                    command = scaled(&command, option);
                }
            }
            if command.starts_with("foilpress preview ") && !command.contains("--pixels") {
                command.push_str(" --pixels 150");
            }
        }
        if let Some(rest) = command.strip_prefix("cargo run --release -- ") {
            command = format!("foilpress {rest}");
        }
        for address in ["serial:/dev/ttyACM0", "serial:target/firmware/bridge/tty", "usb:"] {
            command = command.replace(address, &self.address);
        }
        // A device that takes everything and answers nothing.
        command = command.replace("/dev/usb/lp0", "/dev/null");
        // Without an address the program looks for the only bridge on USB.
        let is_of_a_bridge = ["foilpress bridge reset", "foilpress bridge status", "foilpress bridge jobs"]
            .iter()
            .any(|words| command.starts_with(words));
        if is_of_a_bridge && !command.contains("--to") && !command.contains("--by-hand") {
            command = format!("{command} --to {}", self.address);
        }
        // Nobody is there to answer.
        if command.contains("--to tcp:")
            && ["foilpress print", "foilpress chart", "foilpress layers"]
                .iter()
                .any(|words| command.starts_with(words))
            && !command.contains("--yes")
        {
            command = format!("{command} --yes");
        }
        command
    }

    /// Runs a command in this folder; what it said if it failed. `is_whole`: what it reads is there, or it
    /// has to fail for that and for nothing in its words.
    fn run(&self, command: &str, folder: &Path, is_whole: bool) -> Result<(), String> {
        let path = std::env::var("PATH").unwrap_or_default();
        let mut child = Command::new("sh")
            .args(["-c", command])
            .current_dir(folder)
            .env("PATH", format!("{}:{path}", self.folder.path().join("bin").display()))
            .env("FOILPRESS_CONFIG", self.folder.path().join("config"))
            .env("FOILPRESS_JOBS", self.folder.path().join("jobs"))
            .env("FOILPRESS_PRINTERS", self.folder.path().join("printers"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Enter for each further copy. What asks a question needs a terminal. A command that reads nothing may have ended.
        let _ = child.stdin.take().map(|mut stdin| stdin.write_all(b"\n\n\n"));
        let output = child.wait_with_output().unwrap();
        // 1 is a file that is not there, 2 a word that is wrong.
        if !is_whole && output.status.code() == Some(1) {
            return Ok(());
        }
        if is_whole && output.status.success() {
            if let Some(written) =
                command.strip_prefix("foilpress sample ").and_then(|rest| rest.split(" -o ").nth(1))
                && !testing::is_full()
            {
                shrink(&folder.join(written));
            }
            return Ok(());
        }
        Err(format!(
            "{command}\n    {}",
            String::from_utf8_lossy(&output.stderr).trim().replace('\n', "\n    ")
        ))
    }

    /// Runs all of them, a folder further where one says `cd`.
    fn run_all(&self, from: &str, commands: &[String]) {
        let mut folder: PathBuf = self.folder.path().join(from);
        let (mut failed, mut ran, mut unmade) = (Vec::new(), 0, Vec::new());
        for command in commands {
            let command = match command.strip_prefix("cargo run --release -- ") {
                Some(_) => self.here(command),
                None if elsewhere(command).is_some() => continue,
                None => self.here(command),
            };
            if let Some(into) = command.strip_prefix("cd ") {
                folder = folder.join(into);
                continue;
            }
            let plan = planned(&command).filter(|_| !testing::is_full());
            let command = plan.map_or(command, |(plan, not_made)| {
                unmade.extend(not_made.into_iter().map(|path| folder.join(path)));
                plan
            });
            let reads = |word: &str| {
                let word = folder.join(word.rsplit(['=', ':']).next().unwrap_or(word));
                unmade.iter().any(|path| word.starts_with(path)) && !word.exists()
            };
            failed.extend(self.run(&command, &folder, !command.split(' ').any(reads)).err());
            ran += 1;
        }
        println!("{ran} commands ran, {} are run elsewhere", commands.len() - ran);
        assert!(failed.is_empty(), "{} of {ran} commands failed:\n{}", failed.len(), failed.join("\n"));
        // What was printed on the way was whole jobs, one after the other.
        let printed = self.bridge.printed();
        for sheet in press::inspect::sheets(&printed).into_iter().filter(|sheet| !sheet.is_empty()) {
            let found = press::inspect::inspect(&printed[sheet], &Silent).inspection;
            assert!(found.error.is_none() && found.complete, "at the port: {:?}", found.error);
        }
    }
}

/// Shown commands of a document run, from the first to the last.
fn document(name: &str) {
    let (_, folder) =
        DOCUMENTS.iter().find(|(document, _)| *document == name).expect("a document of the list");
    let commands = commands(&fs::read_to_string(root().join(name)).unwrap());
    assert!(!commands.is_empty(), "{name} shows no command");
    Desk::new().run_all(folder, &commands);
}

#[test]
fn the_readme() {
    document("README.md");
}

#[test]
fn the_guide() {
    document("docs/guide.md");
}

#[test]
fn charts() {
    document("docs/guide/charts.md");
}

#[test]
fn comparisons() {
    document("docs/guide/compare.md");
}

#[test]
fn decals() {
    document("docs/guide/decals.md");
}

#[test]
fn displays() {
    document("docs/guide/display.md");
}

#[test]
fn edits() {
    document("docs/guide/edit.md");
}

#[test]
fn pages() {
    document("docs/guide/page.md");
}

#[test]
fn the_guide_of_libraries() {
    document("docs/guide/libraries.md");
}

#[test]
fn previews() {
    document("docs/guide/preview.md");
}

#[test]
fn two_pictures() {
    document("docs/guide/two-pictures.md");
}

#[test]
fn measuring_inks() {
    document("docs/measuring-inks.md");
}

#[test]
fn print_queues() {
    document("docs/guide/queue.md");
    document("docs/guide/serve.md");
}

#[test]
fn the_emulator_and_the_wiring() {
    document("docs/emulator.md");
    document("docs/wiring.md");
}

/// A document with commands that no test runs is noticed.
#[test]
fn no_document_with_commands_is_left_out() {
    let mut folders = vec![
        root().to_path_buf(),
        root().join("docs"),
        root().join("docs/guide"),
        root().join("docs/decisions"),
    ];
    // CONTRIBUTING speaks to those who build, and shows cargo's commands alone.
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "md") {
                continue;
            }
            let name = path.strip_prefix(root()).unwrap().display().to_string();
            let left: Vec<String> = commands(&fs::read_to_string(&path).unwrap())
                .into_iter()
                .filter(|command| {
                    elsewhere(command).is_none()
                        && !command.starts_with("cd ")
                        && !command.starts_with("mkdir ")
                })
                .collect();
            let is_known = DOCUMENTS.iter().any(|(document, _)| *document == name);
            assert!(is_known || left.is_empty(), "{name} shows {left:?}, and no test runs it");
        }
    }
}

/// The program's sources as its messages read: continued strings joined, `…` for what is filled in.
fn messages() -> String {
    let mut folders = vec![root().join("host")];
    let mut text = String::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("target") {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                text.push_str(&fs::read_to_string(path).unwrap());
            }
        }
    }
    let mut joined = String::new();
    for (at, piece) in text.split("\\\n").enumerate() {
        joined.push_str(if at == 0 { piece } else { piece.trim_start() });
    }
    let mut pieces = joined.replace("\\\"", "\"").split('{').map(str::to_owned).collect::<Vec<_>>();
    for piece in pieces.iter_mut().skip(1) {
        // Braces around code hold lines or strings.
        if let Some((_, after)) = piece.split_once('}').filter(|(name, _)| !name.contains(['\n', '"'])) {
            *piece = format!("…{after}");
        }
    }
    pieces.concat()
}

/// What documents quote in their tables of messages and symptoms is what the program says.
#[test]
fn quoted_messages_are_those_of_the_program() {
    let messages = messages();
    let (mut strange, mut quoted) = (Vec::new(), 0);
    for (name, _) in DOCUMENTS {
        let mut is_table = false;
        for line in fs::read_to_string(root().join(name)).unwrap().lines() {
            is_table = line.starts_with("| message")
                || line.starts_with("| symptom")
                || is_table && line.starts_with('|');
            let Some(cell) = line.split('|').nth(1).filter(|_| is_table) else { continue };
            let quotes = cell.split(['`', '"']).skip(1).step_by(2).filter(|quote| !quote.starts_with("--"));
            for part in quotes.flat_map(|quote| quote.split(|c: char| c == '…' || c.is_ascii_digit())) {
                // Hints follow behind a semicolon.
                let part = part.trim_matches([' ', ',', '.', ':', ';', ')']);
                if part.chars().count() >= 8 && !part.starts_with("foilpress") {
                    quoted += 1;
                    if !messages.contains(part) {
                        strange.push(format!("{name}: {part}"));
                    }
                }
            }
        }
    }
    assert!(quoted > 30, "only {quoted} quotations were found");
    assert!(strange.is_empty(), "no message says:\n{}", strange.join("\n"));
}

/// The examples of a command's help and of its subcommands'.
fn examples(words: &str, found: &mut Vec<String>) {
    let output = Command::new(program::path()).args(words.split_whitespace()).arg("--help").output().unwrap();
    assert!(output.status.success(), "{words}");
    let help = String::from_utf8(output.stdout).unwrap();
    if let Some((_, shown)) = help.split_once("Examples:") {
        // Comments follow in brackets or behind a few spaces.
        let lines = shown.lines().map(|line| {
            line.split("  (")
                .next()
                .unwrap_or_default()
                .split("   ")
                .find(|part| part.contains("foilpress"))
                .unwrap_or_default()
                .trim()
        });
        found.extend(lines.filter(|line| is_command(line)).map(str::to_owned));
    }
    let Some((_, list)) = help.split_once("\nCommands:\n") else { return };
    for line in list.lines().take_while(|line| !line.is_empty()) {
        let Some(name) =
            line.strip_prefix("  ").and_then(|line| line.split(' ').next()).filter(|name| !name.is_empty())
        else {
            continue;
        };
        if name != "help" {
            examples(&format!("{words} {name}"), found);
        }
    }
}

/// A picture of one ink.
fn disc(path: &Path) {
    let picture = image::GrayImage::from_fn(600, 400, |x, y| {
        let inside = (x as f32 - 300.0).hypot(y as f32 - 200.0) < 150.0;
        image::Luma([if inside { 0 } else { 255 }])
    });
    picture.save(path).unwrap();
}

/// A drawing with a layer for each of two inks.
const DRAWING: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" width="30mm" height="20mm" viewBox="0 0 30 20">
<g id="gold"><circle cx="10" cy="10" r="8" fill="#c90"/></g>
<g id="black"><path d="M18 3h9v14h-9z" stroke="#000" fill="none"/></g>
</svg>"##;

/// A page in plain colours.
const PAGE: &str = "%!PS
<< /PageSize [85 57] >> setpagedevice
0 0 0.6 setrgbcolor 10 10 65 37 rectfill 1 0.8 0 setrgbcolor 20 20 20 17 rectfill
showpage
";

/// A page for each of three inks.
const PLATES: &str = "%!PS
<< /PageSize [85 57] >> setpagedevice
10 10 65 37 rectfill showpage 20 20 20 17 rectfill showpage 50 20 20 17 rectfill showpage
";

/// A material without maps.
const HELMET: &str = r#"{"asset": {"version": "2.0"}, "materials": [{"name": "brass", "pbrMetallicRoughness":
{"baseColorFactor": [0.8, 0.6, 0.2, 1], "metallicFactor": 1, "roughnessFactor": 0.4}}]}"#;

/// Files, a preset and a profile that the examples of the help name.
fn files_of_the_examples(desk: &Desk) {
    let folder = desk.folder.path();
    small_document(&folder.join("my-material"));
    for ink in ["white", "gold", "black"] {
        disc(&folder.join(format!("{ink}.png")));
    }
    copy(&folder.join("docs/guide/decal"), &folder.join("decal"));
    for picture in ["day.png", "night.png", "window.hdr"] {
        fs::copy(folder.join("docs/guide/views").join(picture), folder.join(picture)).unwrap();
    }
    copy(&root().join("inks/library"), &folder.join("my-library"));
    copy(&folder.join("docs/guide/few-stacks"), &folder.join("mine"));
    fs::copy(folder.join("docs/guide/readings/k.toml"), folder.join("k.toml")).unwrap();
    fs::write(folder.join("p-sf.brdf"), "3 430 550 650\n0.2 0 0.3 3 0.2 0.2 0.2\n0.8 0 0.6 1 0.1 0.1 0.1\n")
        .unwrap();
    fs::copy(folder.join("docs/guide/reserved/art.png"), folder.join("art.png")).unwrap();
    image::open(folder.join("docs/pictures/leaf-sheet.jpg")).unwrap().save(folder.join("photo.png")).unwrap();
    fs::write(folder.join("art.svg"), DRAWING).unwrap();
    fs::write(folder.join("page.ps"), PAGE).unwrap();
    fs::write(folder.join("plates.ps"), PLATES).unwrap();
    fs::write(folder.join("helmet.gltf"), HELMET).unwrap();
    for command in [
        "gs -q -dBATCH -dNOPAUSE -sDEVICE=pdfwrite -sOutputFile=decal.pdf page.ps",
        "gs -q -dBATCH -dNOPAUSE -sDEVICE=pdfwrite -sOutputFile=plates.pdf plates.ps",
        "foilpress layers white.png --to file:job.rgl",
        "foilpress preset save decal --media film --mirror --paper postcard",
        "foilpress profile set default --cross 20.4x29.7mm --distance 200.3mm",
    ] {
        desk.run(command, folder, true).unwrap();
    }
}

#[test]
fn the_examples_of_the_help() {
    let mut commands = Vec::new();
    examples("", &mut commands);
    assert!(commands.len() > 30, "only {} examples were found", commands.len());
    let desk = Desk::new();
    files_of_the_examples(&desk);
    desk.run_all(".", &commands);
}
