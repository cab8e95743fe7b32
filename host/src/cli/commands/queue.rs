//! `foilpress queue`: print queues of the system, and what the print system itself starts.

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command as Process, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Error, Result, bail};
use clap::{Args as ClapArgs, Subcommand};
use inks::Library;
use serde_json::json;

use crate::cli::console::{chain, show, stderr, stdout};
use device::printers::{self, Printers};
use observe::{Observer, with_causes};
use press::layout::Profile;
use queue::call::{Call, Exit};
use queue::install::{self, Places};
use queue::messages::{Messages, Report as _};
use queue::options;
use queue::{backend, filter, listing, ppd, uri};

/// Arguments of `queue`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    sudo foilpress queue install --name Alps --to serial:/dev/ttyACM0\n  \
    lp -d Alps file.pdf\n  \
    lp -d Alps -o MediaType=GlossyPaper -o FoilpressWhite=Under photo.png\n  \
    lp -d Alps job.rgl                                   (a job, unchanged)\n  \
    foilpress queue list\n  \
    sudo foilpress queue remove --name Alps")]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Install a queue so that every application can print, or change one (as root)
    Install(Install),
    /// Remove a queue (as root)
    Remove(Remove),
    /// List the queues of this program
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Print the printer description (PPD), to install a queue by hand
    Ppd,
}

/// Arguments of `queue install`.
#[derive(ClapArgs, Debug)]
struct Install {
    /// Name of the queue
    #[arg(long, value_parser = queue_name)]
    name: String,
    /// Destination: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE
    #[arg(long, value_name = "WHERE", value_parser = uri::of)]
    to: String,
    /// Calibration profile of the printer (`foilpress profile`), or its file [default: the profile named `default`, if it
    /// exists]
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
}

/// Arguments of `queue remove`.
#[derive(ClapArgs, Debug)]
struct Remove {
    /// Name of the queue
    #[arg(long, value_parser = queue_name)]
    name: String,
}

/// Checks that the print system accepts a name for a queue.
fn queue_name(name: &str) -> Result<String, String> {
    let fits = !name.is_empty()
        && name.len() <= 127
        && !name.starts_with('-')
        && name.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c));
    if fits {
        Ok(name.into())
    } else {
        Err("expected a name of letters, digits, -, _ and . that does not begin with -".into())
    }
}

/// Runs `queue`.
pub fn run(args: &Args, observer: &dyn Observer) -> Result<()> {
    match &args.command {
        Command::Install(args) => install(args, observer),
        Command::Remove(args) => remove(args, observer),
        Command::List { json } => list(*json),
        Command::Ppd => show(&ppd::description(&Profile::default())),
    }
}

/// Runs a program of the print system and returns its output.
fn system(program: &str, arguments: &[&str]) -> Result<String> {
    let output = Process::new(program).args(arguments).env("LC_ALL", "C").output().with_context(|| {
        format!("cannot start {program}; is CUPS installed (Debian: apt install cups ghostscript)?")
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let said = said.trim();
        if ["Forbidden", "Unauthorized", "Not authorized"].iter().any(|word| said.contains(word)) {
            bail!("{} ({program}: {said})", as_root());
        }
        if ["Unable to connect", "Scheduler is not running"].iter().any(|words| said.contains(words)) {
            bail!(
                "the print system does not answer; is it running (Debian: sudo service cups start)? ({program}: {said})"
            );
        }
        bail!("{program}: {said}");
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn as_root() -> String {
    "only root may change queues; run the same command with sudo".into()
}

/// Where a package puts the program.
const PACKAGED: &str = "/usr/bin/foilpress";

fn install(args: &Install, observer: &dyn Observer) -> Result<()> {
    let profile = match args.profile.as_deref().filter(|name| name.ends_with(".toml")) {
        Some(file) => Profile::load(Path::new(file))?,
        None => crate::cli::arguments::layout::profile(args.profile.as_deref(), observer)?,
    };
    let places = Places::usual(Path::new("/"));
    if !places.programs.is_dir() {
        bail!(
            "{} does not exist; is CUPS installed (Debian: apt install cups ghostscript)?",
            places.programs.display()
        );
    }
    // Asked before anything is written: if the print system does not answer, no queue can be installed.
    queues()?;
    let mut program = std::env::current_exe().context("cannot find this program")?;
    // A package has installed its own files, which stay.
    if program != Path::new(PACKAGED) && !install::is_roots(&program).with_context(as_root)? {
        install::copy_program(&program, &places.program).with_context(as_root)?;
        observer.note(&format!(
            "others than root can change {}, so the print system gets a copy: {}; after an update, install the queue again",
            program.display(),
            places.program.display()
        ));
        program = places.program.clone();
    }
    for file in places.files(&program) {
        if install::put(&file)
            .with_context(|| format!("cannot write {}", file.path.display()))
            .with_context(as_root)?
        {
            observer.note(&format!("wrote {}", file.path.display()));
        }
    }
    // Queue and users must share what is known about a printer that needs a reset.
    printers::make_shared_folder().with_context(as_root)?;
    // The description of a queue holds the calibration profile of its printer.
    let mut description = tempfile::NamedTempFile::new().context("cannot write the printer description")?;
    description
        .write_all(ppd::description(&profile).as_bytes())
        .context("cannot write the printer description")?;
    let description =
        description.path().to_str().context("the path of the folder for temporary files is not UTF-8")?;
    // A failed job is not repeated automatically, and one lost sheet must not stop the jobs after it.
    system(
        "lpadmin",
        &[
            "-p",
            &args.name,
            "-v",
            &args.to,
            "-P",
            description,
            "-D",
            "ALPS MD-5500",
            "-o",
            "printer-error-policy=abort-job",
            "-E",
        ],
    )?;
    observer.note(&format!("queue {} is installed; print with: lp -d {} file.pdf", args.name, args.name));
    Ok(())
}

fn remove(args: &Remove, observer: &dyn Observer) -> Result<()> {
    ours(&args.name)?;
    system("lpadmin", &["-x", &args.name])?;
    observer.note(&format!("queue {} is removed", args.name));
    let left = queues()?.into_iter().any(|(_, device)| uri::parse(&device).is_ok());
    if !left && !Path::new(PACKAGED).exists() {
        // Files written for the first queue are removed with the last; the files of a package are left to it.
        for file in Places::usual(Path::new("/")).remove().with_context(as_root)? {
            observer.note(&format!("removed {}", file.display()));
        }
    }
    Ok(())
}

/// Names and devices of all queues.
fn queues() -> Result<Vec<(String, String)>> {
    // The program fails when there is no queue at all, which is not an error here.
    let text = match system("lpstat", &["-v"]) {
        Err(error) if error.to_string().contains("No destinations") => String::new(),
        other => other?,
    };
    Ok(text
        .lines()
        .filter_map(|line| line.strip_prefix("device for ")?.split_once(": "))
        .map(|(name, device)| (name.into(), device.into()))
        .collect())
}

fn ours(name: &str) -> Result<()> {
    match queues()?.iter().find(|(queue, _)| queue == name) {
        None => bail!("there is no queue {name}; `foilpress queue list` shows the queues"),
        Some((_, device)) if uri::parse(device).is_err() => {
            bail!(
                "queue {name} leads to {device}, which does not belong to this program; `lpadmin -x {name}` removes it"
            )
        }
        Some(_) => Ok(()),
    }
}

fn list(json: bool) -> Result<()> {
    let mut found = Vec::new();
    for (name, device) in queues()? {
        if uri::parse(&device).is_ok() {
            let state: Vec<String> =
                system("lpstat", &["-p", &name])?.lines().map(|line| line.trim().to_owned()).collect();
            found.push((name, device, state));
        }
    }
    let mut out = stdout();
    if json {
        let queue = |(name, device, state): &(String, String, Vec<String>)| json!({ "name": name, "device": device, "state": state });
        let queues: Vec<_> = found.iter().map(queue).collect();
        return Ok(writeln!(out, "{}", serde_json::to_string_pretty(&queues)?)?);
    }
    for (name, device, state) in &found {
        writeln!(out, "{name}  {device}")?;
        state.iter().try_for_each(|line| writeln!(out, "    {line}"))?;
    }
    if found.is_empty() {
        writeln!(out, "no queue leads to this program; `foilpress queue install` installs one")?;
    }
    Ok(())
}

/// Arguments passed by the print system, not by people.
#[derive(ClapArgs, Debug)]
pub struct Conventional {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Set by the signal that asks the program to end.
static STOP: AtomicBool = AtomicBool::new(false);

/// The backend: without arguments a list of devices, otherwise a job.
pub fn backend(args: &Conventional) -> ExitCode {
    if args.arguments.is_empty() {
        return match show(&listing::devices()) {
            Ok(()) => ExitCode::SUCCESS,
            Err(_) => ExitCode::from(Exit::Failed as u8),
        };
    }
    let messages = Messages::new(stderr());
    // The print system asks a job to end by SIGTERM.
    if let Err(error) = ctrlc::set_handler(|| STOP.store(true, Ordering::SeqCst)) {
        messages.debug(&format!("cannot watch for signals: {}", with_causes(&error)));
    }
    let call = Call::read(&args.arguments, &|name| std::env::var_os(name)).map_err(Error::from);
    let exit = match call.and_then(|call| Ok((call, Printers::of_system()?))) {
        Ok((call, printers)) => {
            let stop = || STOP.load(Ordering::SeqCst);
            backend::run(&call, &printers, &mut io::stdin().lock(), &messages, &stop)
        }
        Err(error) => {
            messages.error(&chain(&error));
            Exit::Stop
        }
    };
    ExitCode::from(exit as u8)
}

/// The filter: `job user title copies options [file]`, jobs to standard output.
pub fn filter(args: &Conventional) -> ExitCode {
    let messages = Messages::of_filter(stderr());
    // A cancelled job leaves neither folders nor a Ghostscript behind.
    if let Err(error) = crate::cli::output::remove_on_interrupt() {
        messages.debug(&chain(&error));
    }
    let why = match filtered(&args.arguments, &messages) {
        Ok(1..) => return ExitCode::SUCCESS,
        Ok(0) => "there is nothing to print: every page is blank".into(),
        Err(error) => {
            crate::cli::output::yield_to_interrupt();
            chain(&error)
        }
    };
    messages.error(&why);
    // The print system shows this message with the job only if it reads it before it sees the filter end; otherwise it
    // shows "Filter failed" alone.
    wait_until_read();
    ExitCode::FAILURE
}

/// How long the print system may take to read a message.
const HEARD: Duration = Duration::from_secs(10);

/// Waits until standard error has been read, where that can be seen, and for a moment in which it is acted upon.
fn wait_until_read() {
    let end = Instant::now() + HEARD;
    // A pipe says at either end how much is in it.
    #[cfg(target_os = "linux")]
    #[expect(clippy::disallowed_methods, reason = "nothing is written")]
    while Instant::now() < end && rustix::io::ioctl_fionread(io::stderr()).is_ok_and(|unread| unread > 0) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(1).min(end.saturating_duration_since(Instant::now())));
}

fn filtered(arguments: &[OsString], observer: &dyn Observer) -> Result<usize> {
    let (asked, file) = match arguments {
        [_job, _user, _title, _copies, options] => (options, None),
        [_job, _user, _title, _copies, options, file] => (options, Some(PathBuf::from(file))),
        other => bail!("expected job-id user title copies options [file], found {} arguments", other.len()),
    };
    // Its defaults are the queue's; without it the program's own apply.
    let description = std::env::var_os("PPD").and_then(|path| std::fs::read_to_string(path).ok());
    let choices = options::read(&options::parse(&asked.to_string_lossy()), description.as_deref())?;
    #[expect(clippy::disallowed_methods, reason = "jobs are bytes, and the print system reads them")]
    let mut out = io::BufWriter::with_capacity(1 << 18, io::stdout());
    let library = Library::builtin();
    Ok(match &file {
        Some(path) => {
            let document =
                std::fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
            filter::run(document, Some(path), &choices, &library, &mut out, observer)?
        }
        None => filter::run(io::stdin(), None, &choices, &library, &mut out, observer)?,
    }
    .jobs)
}
