//! Whether a test notices when a decision of the bridge is another one: `cargo xtask mutants`.
//!
//! Problem: a test that passes proves nothing unless one would fail where the code is wrong. Method: a copy
//! of the sources, in which each decision of the files that decide ([`DECIDE`]) is [changed](change()) by a
//! switch, all of them in one build; then the bridge's tests and some seconds of the simulation of the whole
//! system run once for each number, until one fails. Faults that were once found or planted by hand
//! (`planted.toml`) are tried, too.
//! Cost: a build, and half a minute for each mutant that lives. Limits: what hangs counts as noticed.
//! Source: mutation testing (DeMillo, Lipton, Sayward, 1978); one build for all by switches ("mutant
//! schemata", Untch and others, 1993).

mod change;

use anyhow::{Context as _, Result, ensure};
use change::{Mutant, change};
use serde::Deserialize;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, mpsc};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

/// The files that decide what goes to the printer and what is known of it.
const DECIDE: [&str; 12] = [
    "bridge/src/alone.rs",
    "bridge/src/checkpoint.rs",
    "bridge/src/driver/introduction.rs",
    "bridge/src/driver/mod.rs",
    "bridge/src/driver/question.rs",
    "bridge/src/driver/supply.rs",
    "bridge/src/engine/alone.rs",
    "bridge/src/engine/link.rs",
    "bridge/src/engine/mod.rs",
    "bridge/src/engine/work.rs",
    "bridge/src/standing.rs",
    "bridge/src/store/diary.rs",
];

/// The switch in the bridge, and a checkpoint that is one call late for a fault that is planted.
const SWITCH: &str = "
mod switch {
    extern crate std;
    use crate::engine::Checkpoint;
    use core::cell::Cell;
    pub(crate) fn mutant(number: u32) -> bool {
        static NUMBER: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
        let read = || std::env::var(\"FOILPRESS_MUTANT\").ok()?.parse().ok();
        *NUMBER.get_or_init(|| read().unwrap_or(0)) == number
    }
    std::thread_local!(static LATE: Cell<Option<Checkpoint>> = const { Cell::new(None) });
    pub(crate) fn late(now: Checkpoint) -> Checkpoint {
        LATE.replace(Some(now)).unwrap_or(now)
    }
}
pub(crate) use switch::{late, mutant};
";

/// Cases of a property test and seconds of the simulation, for a first look and for what lives behind it.
const LOOKS: [[&str; 2]; 2] = [["4", "4"], ["32", "20"]];

/// Who lives longer than the tests took, so often, hangs.
const HANGS: u32 = 4;

/// The share of the mutants that a part of them is.
const PART: usize = 10;

#[derive(Deserialize)]
struct Planted {
    fault: Vec<Fault>,
}

#[derive(Deserialize)]
struct Fault {
    what: String,
    file: String,
    /// Why it may live.
    harmless: Option<String>,
    find: String,
    with: String,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize()?;
    let place = root.join("target/mutants");
    let mutants = prepare(&root, &place.join("tree"))?;
    let tests = build(&place)?;
    let mut limits = [Duration::from_secs(3_600); LOOKS.len()];
    for (look, limit) in LOOKS.into_iter().zip(&mut limits) {
        let start = Instant::now();
        ensure!(run(&tests, 0, look, *limit)?.is_none(), "a test fails though nothing is changed");
        *limit = start.elapsed() * HANGS;
    }
    let seed: usize = env::var("PROPTEST_RNG_SEED").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    let named: Vec<usize> = arguments.iter().filter_map(|text| text.parse().ok()).collect();
    let is_part = arguments.iter().any(|text| text == "--part");
    let chosen: Vec<usize> = (1..=mutants.len())
        .filter(|number| named.is_empty() || named.contains(number))
        .filter(|number| !is_part || mutants[number - 1].line == 0 || (number + seed).is_multiple_of(PART))
        .collect();
    println!("{} of {} mutants, each for at most {limits:?}", chosen.len(), mutants.len());
    let lived = try_all(&tests, &chosen, &mutants, limits)?;
    println!("{} of {} lived:", lived.len(), chosen.len());
    for number in &lived {
        let Mutant { file, line, what, .. } = &mutants[number - 1];
        println!("| {number} | {file}:{line} | {what} |");
    }
    let planted = lived.iter().filter(|number| mutants[**number - 1].must_die).count();
    ensure!(planted == 0, "{planted} planted faults lived");
    Ok(())
}

/// Copies the sources that git knows, with a switch for each decision; says which there are. Those that are
/// planted have line 0.
fn prepare(root: &Path, tree: &Path) -> Result<Vec<Mutant>> {
    let listed = Command::new("git")
        .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        .current_dir(root)
        .output()?;
    let Planted { fault: planted } =
        toml::from_str(&fs::read_to_string(root.join("tests/mutants/planted.toml"))?)?;
    let of = |fault: &Fault| Mutant {
        file: fault.file.clone(),
        line: 0,
        what: match &fault.harmless {
            None => fault.what.clone(),
            Some(why) => format!("{} (harmless: {why})", fault.what),
        },
        must_die: fault.harmless.is_none(),
    };
    let mut mutants: Vec<Mutant> = planted.iter().map(of).collect();
    let files = String::from_utf8(listed.stdout)?;
    for file in files.split('\0').filter(|file| root.join(file).is_file()) {
        let (from, to) = (root.join(file), tree.join(file));
        fs::create_dir_all(to.parent().context("a folder")?)?;
        let mut bytes = fs::read(&from).with_context(|| format!("cannot read {}", from.display()))?;
        for (number, fault) in (1..).zip(&planted).filter(|(_, fault)| fault.file == file) {
            bytes = fault.plant(core::str::from_utf8(&bytes)?, number)?.into_bytes();
        }
        if DECIDE.contains(&file) {
            bytes = change(file, core::str::from_utf8(&bytes)?, &mut mutants)?.into_bytes();
        }
        if file == "bridge/src/lib.rs" {
            bytes.extend_from_slice(SWITCH.as_bytes());
        }
        // What has not changed is not built again.
        if fs::read(&to).ok().as_ref() != Some(&bytes) {
            fs::write(&to, bytes)?;
        }
    }
    Ok(mutants)
}

impl Fault {
    /// A source with this fault in it.
    fn plant(&self, source: &str, number: usize) -> Result<String> {
        ensure!(source.matches(&self.find).count() == 1, "{} has not once: {}", self.file, self.find);
        let switch = match self.file.starts_with("bridge/") {
            true => format!("crate::mutant({number})"),
            false => format!("std::env::var(\"FOILPRESS_MUTANT\").is_ok_and(|text| text == \"{number}\")"),
        };
        Ok(source.replace(&self.find, &self.with.replace("PLANTED", &switch)))
    }
}

/// Builds the tests; gives them with the folders they run in.
fn build(place: &Path) -> Result<Vec<(PathBuf, PathBuf)>> {
    let tree = place.join("tree");
    let output = Command::new(env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
        .args([
            "test",
            "--no-run",
            "--message-format=json-render-diagnostics",
            "-p",
            "foilpress-bridge",
            "-p",
            "foilpress-system",
        ])
        .current_dir(&tree)
        .env("CARGO_TARGET_DIR", place.join("build"))
        .env("CARGO_INCREMENTAL", "0")
        .stderr(Stdio::inherit())
        .output()?;
    ensure!(output.status.success(), "the changed sources do not build");
    let mut tests = Vec::new();
    for line in String::from_utf8(output.stdout)?.lines() {
        let Ok(message) = serde_json::from_str::<serde_json::Value>(line) else { continue };
        if let (Some(program), Some(manifest)) =
            (message["executable"].as_str(), message["manifest_path"].as_str())
            && let Some(folder) = Path::new(manifest).parent()
        {
            tests.push((program.into(), folder.into()));
        }
    }
    // The bridge's own come first: they are the quickest.
    tests.sort_by_key(|(_, folder): &(PathBuf, PathBuf)| folder.ends_with("system"));
    Ok(tests)
}

/// Tries the chosen ones, two at a time; gives those that lived.
fn try_all(
    tests: &[(PathBuf, PathBuf)],
    chosen: &[usize],
    mutants: &[Mutant],
    limits: [Duration; LOOKS.len()],
) -> Result<Vec<usize>> {
    let (next, lived) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || -> Result<()> {
        while let Some(&number) = chosen.get(next.fetch_add(1, Ordering::Relaxed)) {
            let mut noticed = None;
            for (look, limit) in LOOKS.into_iter().zip(limits) {
                if noticed.is_none() {
                    noticed = run(tests, number, look, limit)?;
                }
            }
            let Mutant { file, line, what, .. } = &mutants[number - 1];
            println!("{number:>4} {file}:{line} {what}: {}", noticed.as_deref().unwrap_or("LIVES"));
            if noticed.is_none()
                && let Ok(mut lived) = lived.lock()
            {
                lived.push(number);
            }
        }
        Ok(())
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(work)).collect();
        threads
            .into_iter()
            .try_for_each(|thread| thread.join().unwrap_or_else(|_| anyhow::bail!("a thread failed")))
    })?;
    let mut lived = lived.into_inner().unwrap_or_default();
    lived.sort_unstable();
    Ok(lived)
}

/// Runs the tests with one mutant; says which noticed.
fn run(
    tests: &[(PathBuf, PathBuf)],
    number: usize,
    [cases, seconds]: [&str; 2],
    limit: Duration,
) -> Result<Option<String>> {
    for (program, folder) in tests {
        let mut child = Command::new(program)
            .args(["--test-threads=1", "--skip", "of_the_documents"])
            .current_dir(folder)
            .env("FOILPRESS_MUTANT", number.to_string())
            .env("FOILPRESS_SECONDS", seconds)
            .env("FOILPRESS_SEED", "1")
            .env("PROPTEST_CASES", cases)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let name = program.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match wait(&mut child, limit)? {
            Some(Failed(None)) => {}
            Some(Failed(Some(test))) => return Ok(Some(test)),
            None => return Ok(Some(format!("{name} hangs"))),
        }
    }
    Ok(None)
}

/// The test that failed, if one did.
struct Failed(Option<String>);

/// Waits until a test of this process fails, or all have passed; none if it hangs. It is over then.
fn wait(child: &mut Child, limit: Duration) -> Result<Option<Failed>> {
    let (tell, told) = mpsc::channel();
    let lines = BufReader::new(child.stdout.take().context("its words")?).lines();
    let reader = thread::spawn(move || {
        let failed = lines.map_while(Result::ok).find_map(|line| {
            let test = line.strip_prefix("test ")?.strip_suffix(" ... FAILED")?;
            Some(test.to_owned())
        });
        // Whoever waits may have given up.
        let _ = tell.send(failed);
    });
    let said = told.recv_timeout(limit);
    let ended = if matches!(said, Ok(None)) { Some(child.wait()?) } else { None };
    // One that has ended cannot be killed.
    let _ = child.kill();
    child.wait()?;
    reader.join().ok();
    let Ok(failed) = said else { return Ok(None) };
    let crashed = ended.is_some_and(|status| !status.success()).then(|| "it ended by itself".to_owned());
    Ok(Some(Failed(failed.or(crashed))))
}
