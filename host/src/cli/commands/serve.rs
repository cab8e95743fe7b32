//! `foilpress serve`: a printer for every device of the house.
//!
//! The server itself is behind the feature `serve`, for its libraries are many, and whoever builds this
//! program to print one file needs none of them. The command line is the same without it.

use std::fs::File;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args as ClapArgs;
use serde::{Deserialize, Serialize};

use device::connection::Destination;
use device::transit::journal::Journal;

/// Arguments of `serve`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  \
    foilpress serve --to usb:                              (for this computer: http://localhost:8631/)\n  \
    foilpress serve --to usb: --share                      (for every device of the house)\n  \
    foilpress serve --to file:sheets                       (keeps each sheet as a file in the folder sheets)\n  \
    sudo foilpress serve --to usb: --install               (from now on, at every start of this computer)\n  \
    sudo foilpress serve --to usb:E66 --as left --listen [::]:8632 --install     (a second printer there)\n\n\
    Each preset that fits `foilpress layers` is a printer of its own, at ipp://HOST:8631/ipp/print/PRESET. The printer `standard` \
    is always there. Stop the server with Ctrl-C: jobs are kept, and continue when it starts again.")]
pub struct Args {
    /// Destination: usb:, serial:PORT or tcp:HOST:PORT for a bridge, raw:DEVICE, or file:FOLDER
    #[arg(long, value_name = "WHERE", value_parser = destination, required_unless_present = "uninstall")]
    pub to: Option<(String, Destination)>,
    /// Address and port to listen on [default: 127.0.0.1:8631]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub listen: Option<SocketAddr>,
    /// Listen on all addresses of this computer, so that other devices can print; with --listen, on that one
    ///
    /// Everyone who reaches this computer can print then, and print dialogs find the printers. To change the
    /// loaded sheet, or to cancel a job of somebody else, other devices need the code that is shown in the
    /// terminal.
    #[arg(long)]
    pub share: bool,
    /// Another name under which this computer is asked for, such as printer.lan; may be given several times
    #[arg(long = "name", value_name = "HOST", value_parser = host_name)]
    pub names: Vec<String>,
    /// What this printer is called where a computer has several, each with a server and a port of its own
    #[arg(long = "as", value_name = "NAME", value_parser = instance)]
    pub instance: Option<String>,
    /// Install the server as a service of the system that is found by print dialogs, with your presets (as
    /// root)
    ///
    /// Writes a systemd unit and a service file of Avahi for each printer, and copies your presets, profiles
    /// and ink libraries. Install again after a change of them.
    #[arg(long, conflicts_with_all = ["jobs", "library", "share"])]
    pub install: bool,
    /// Remove the service with everything it has kept (as root)
    #[arg(long, conflicts_with_all = ["install", "to", "listen", "share", "jobs", "library", "names"])]
    pub uninstall: bool,
    /// Folder of the jobs [default: serve/ beside the jobs of `send`]
    #[arg(long, value_name = "DIR")]
    pub jobs: Option<PathBuf>,
    /// Your own ink library: its folder, or the name it was added under [default: the built-in library]
    #[arg(long, value_name = "LIBRARY")]
    pub library: Option<PathBuf>,
}

/// What a server tells of itself while it runs, in a file beside its jobs.
#[derive(Serialize, Deserialize, Debug, PartialEq)]
pub struct Running {
    /// The desk.
    pub desk: String,
    /// Where it listens.
    pub listens: SocketAddr,
    /// Addresses of its printers.
    pub printers: Vec<String>,
    /// Whether print dialogs of other computers find it, in words.
    pub announced: String,
    /// What other devices have to know to change things.
    pub code: String,
}

impl Running {
    /// What the server says that keeps its jobs in this folder; `None` if none runs there.
    ///
    /// # Errors
    /// The folder cannot be looked into, or there is a server that has not said it yet.
    pub fn find(folder: &Path) -> std::io::Result<Option<Running>> {
        let lock = match File::open(folder.join("lock")) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            lock => lock?,
        };
        if lock.try_lock_shared().is_ok() {
            return Ok(None);
        }
        let text = std::fs::read(folder.join(RUNNING))?;
        Ok(Some(serde_json::from_slice(&text)?))
    }

    /// Who may print.
    pub fn who(&self) -> &'static str {
        match self.listens.ip().is_loopback() {
            true => "this computer only (--share is for all)",
            false => "everyone who reaches this computer",
        }
    }
}

/// The file of [`Running`].
const RUNNING: &str = "running.json";

/// The folder of the jobs of a user's server, or of one of several.
pub fn folder(instance: Option<&str>) -> Result<PathBuf> {
    let name = instance.map_or_else(|| "serve".to_owned(), |name| format!("serve@{name}"));
    Ok(Journal::of_user()?.folder().join(name))
}

/// The folders of all servers of this user and of the system.
///
/// # Errors
/// There is no place for the user's.
pub fn folders() -> Result<Vec<PathBuf>> {
    let own = folder(None)?;
    let mut all = Vec::new();
    for first in [own.as_path(), Path::new("/var/lib/foilpress-serve")] {
        all.push(first.to_path_buf());
        let beside = first.parent().and_then(|parent| std::fs::read_dir(parent).ok()).into_iter().flatten();
        let start = format!("{}@", first.file_name().unwrap_or_default().to_string_lossy());
        let is_one =
            |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&start));
        let mut others: Vec<PathBuf> =
            beside.filter_map(|entry| Some(entry.ok()?.path())).filter(is_one).collect();
        others.sort();
        all.append(&mut others);
    }
    Ok(all)
}

/// A name that a host may have.
fn host_name(text: &str) -> Result<String, String> {
    let label =
        |label: &str| !label.is_empty() && label.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    match text.len() <= 253 && text.trim_end_matches('.').split('.').all(label) {
        true => Ok(text.trim_end_matches('.').to_owned()),
        false => Err("a host's name has letters, digits and - between dots, such as printer.lan".into()),
    }
}

/// The name of a server among several.
fn instance(text: &str) -> Result<String, String> {
    crate::folders::folder(Path::new(""), text).map(|_| text.to_owned()).map_err(|error| error.to_string())
}

fn destination(text: &str) -> Result<(String, Destination), device::connection::NoDestination> {
    Ok((text.to_owned(), text.parse()?))
}

/// Runs `serve`.
#[cfg(not(feature = "serve"))]
pub fn run(_args: &Args, _program: &clap::Command) -> Result<()> {
    anyhow::bail!(
        "this program was built without the print server; packages have it, and so does `cargo run --release --features serve -- serve`"
    )
}

#[cfg(feature = "serve")]
pub use with_server::run;

#[cfg(feature = "serve")]
mod with_server {
    use std::net::{Ipv4Addr, Ipv6Addr, TcpListener};
    use std::sync::Arc;

    use anyhow::{Context as _, bail};
    use clap::FromArgMatches as _;
    use serve::advert::{Advert, has_avahi, is_real};
    use serve::body::Limits;
    use serve::http;
    use serve::install::{Places, Service};
    use serve::server::{Preset, Server, Settings, identities};
    use serve::worker;

    use super::*;
    use crate::cli::commands::{Command, preset};
    use crate::cli::console::{say, show};
    use crate::cli::output;
    use device::printers::Printers;
    use files::durable::{self, Access};
    use observe::{Observer, Silent, with_causes};

    /// The printer that is always there.
    const STANDARD: &str = "standard";

    /// What the server says, at the terminal.
    struct Terminal;

    impl Observer for Terminal {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn note(&self, text: &str) {
            say(&format!("note: {text}"));
        }
    }

    /// Runs `serve` until the process is ended.
    pub fn run(args: &Args, program: &clap::Command) -> Result<()> {
        let (typed, to) = match &args.to {
            _ if args.uninstall => return uninstall(args),
            Some(to) => to.clone(),
            None => bail!("--to says where sheets go, such as --to usb:"),
        };
        if args.install {
            return install(args, &typed, program);
        }
        let folder = match &args.jobs {
            Some(folder) => folder.clone(),
            None => super::folder(args.instance.as_deref())?,
        };
        let listeners = listen(args)?;
        let address = listeners[0].local_addr()?;
        let mut hosts = hosts();
        hosts.extend(args.names.iter().cloned());
        let settings = Settings {
            to,
            printers: printers(program)?,
            folder,
            library: crate::libraries::given(args.library.as_deref())?,
            devices: Printers::of_system()?,
            hosts,
            instance: args.instance.clone(),
        };
        let host = match address.ip().is_unspecified() {
            true => settings.hosts.first().map_or("localhost", String::as_str).to_owned(),
            false => address.ip().to_string(),
        };
        let host = if host.contains(':') { format!("[{host}]") } else { host };
        let port = address.port();
        let mut text = String::new();
        for printer in &settings.printers {
            text.push_str(&format!("ipp://{host}:{port}/ipp/print/{}  {}\n", printer.name, printer.about));
        }
        text.push_str(&format!(
            "http://{host}:{port}/  the desk: jobs, the loaded sheet, printing from a browser\n"
        ));
        let server = Arc::new(Server::begin(settings, Box::new(Terminal))?);
        if !address.ip().is_loopback() {
            text.push_str(&format!("code for changes from other devices: {}\n", server.code()));
        }
        let (advert, announced) = announce(&server, address);
        if !address.ip().is_loopback() {
            text.push_str(&format!("in print dialogs: {announced}\n"));
        }
        let printer = |printer: &Preset| format!("ipp://{host}:{port}/ipp/print/{}", printer.name);
        let running = Running {
            desk: format!("http://{host}:{port}/"),
            listens: address,
            printers: server.settings.printers.iter().map(printer).collect(),
            announced,
            code: server.code(),
        };
        let told = server.settings.folder.join(RUNNING);
        durable::write(&told, &serde_json::to_vec(&running)?, Access::Private)
            .with_context(|| format!("cannot write {}", told.display()))?;
        output::at_interrupt(move || {
            drop(advert);
            // What stays is the word of a server whose lock is gone.
            let _ = std::fs::remove_file(&told);
            say("foilpress: the server has ended; its jobs are kept");
            std::process::exit(0);
        });
        let printing = server.clone();
        std::thread::Builder::new().name("printing".into()).spawn(move || worker::work(&printing))?;
        show(&text)?;
        Ok(http::run(&server, listeners, Limits::default())?)
    }

    /// The port without `--listen`.
    const PORT: u16 = 8631;

    /// Listens where the arguments say: on the address that is given; to share without one, on all addresses
    /// of both families, of which one is enough.
    fn listen(args: &Args) -> Result<Vec<TcpListener>> {
        let bound = |address: SocketAddr| {
            TcpListener::bind(address).with_context(|| {
                format!("cannot listen on {address}; is another server there? --listen chooses another port")
            })
        };
        match args.listen {
            Some(address) if args.share && address.ip().is_loopback() => bail!(
                "--share is for other devices, which do not reach {}; leave --listen out, or give it an address of this computer in \
                 the network, such as --listen [::]:{}",
                address.ip(),
                address.port()
            ),
            Some(address) => Ok(vec![bound(address)?]),
            None if !args.share => Ok(vec![bound((Ipv4Addr::LOCALHOST, PORT).into())?]),
            None => {
                // Where one socket has both families, the second is in use already.
                let both: [SocketAddr; 2] =
                    [(Ipv6Addr::UNSPECIFIED, PORT).into(), (Ipv4Addr::UNSPECIFIED, PORT).into()];
                let open: Vec<TcpListener> =
                    both.into_iter().filter_map(|address| TcpListener::bind(address).ok()).collect();
                if open.is_empty() { Ok(vec![bound(both[1])?]) } else { Ok(open) }
            }
        }
    }

    /// Announces the printers to other computers, if those can reach them; and what came of it.
    fn announce(server: &Server, address: SocketAddr) -> (Option<Advert>, String) {
        if address.ip().is_loopback() {
            return (None, "no, the server listens on this computer only".into());
        }
        if has_avahi() {
            return (
                None,
                "by Avahi, if `sudo foilpress serve --install` has told it of the printers".into(),
            );
        }
        let uuid = |printer: &Preset| server.uuid(&format!("printer {}", printer.name));
        let printers: Vec<(Preset, String)> =
            server.settings.printers.iter().map(|printer| (printer.clone(), uuid(printer))).collect();
        let called = (server.settings.computer(), server.settings.called());
        match Advert::begin(&printers, (called.0, &called.1), address.port(), is_real) {
            Ok(advert) => (Some(advert), "yes, while the server runs".into()),
            Err(error) => (None, format!("no: {}", with_causes(&error))),
        }
    }

    /// Tells the system about the service.
    fn systemctl(arguments: &[&str]) -> Result<()> {
        let done = std::process::Command::new("systemctl").args(arguments).status();
        match done.context("cannot start systemctl; the files are there, but this system has no systemd")? {
            status if status.success() => Ok(()),
            status => bail!("systemctl {}: {status}", arguments.join(" ")),
        }
    }

    const AS_ROOT: &str = "only root may change services; run the same command with sudo";

    fn install(args: &Args, to: &str, program: &clap::Command) -> Result<()> {
        let places = Places::at(Path::new("/"), args.instance.as_deref());
        let printers = printers(program)?;
        let (config, port) = (crate::folders::config()?, args.listen.map_or(PORT, |address| address.port()));
        for printer in &printers {
            travels(&printer.name)?;
        }
        if let Some(other) = places.with_port(port).context(AS_ROOT)? {
            bail!(
                "port {port} is that of the service {other}; choose another one, such as --listen [::]:{}",
                port + 1
            );
        }
        let names: Vec<String> = printers.iter().map(|printer| printer.name.clone()).collect();
        let uuids = identities(&places.state(), &names).context(AS_ROOT)?;
        let printers: Vec<(Preset, String)> = printers.into_iter().zip(uuids).collect();
        let own = std::env::current_exe().context("cannot find this program's own file")?;
        let service = Service {
            program: &own,
            to,
            listen: args.listen,
            port,
            names: &args.names,
            printers: &printers,
            config: &config,
        };
        let written = places.install(&service).context(AS_ROOT)?;
        let list: String = written.iter().map(|path| format!("{}\n", path.display())).collect();
        show(&list)?;
        let unit = places.unit_name();
        systemctl(&["daemon-reload"])?;
        systemctl(&["enable", &unit])?;
        // One that runs already has read what was there before.
        systemctl(&["restart", &unit])
    }

    /// Whether a preset has what it needs where the service reads: a library that is named by its folder
    /// stays behind.
    fn travels(name: &str) -> Result<()> {
        let Some((_, words)) = preset::all()?.into_iter().find(|(known, _)| known == name) else {
            return Ok(());
        };
        for library in words.iter().filter_map(|word| word.strip_prefix("--library=")) {
            if crate::libraries::added(library).is_none()
                && !crate::libraries::is_built_in(Path::new(library))
            {
                bail!(
                    "the preset `{name}` names the ink library {library}, which the service cannot read; add it with \
                     `foilpress inks add`, and save the preset with the name that it has then"
                );
            }
        }
        Ok(())
    }

    fn uninstall(args: &Args) -> Result<()> {
        let places = Places::at(Path::new("/"), args.instance.as_deref());
        // A service that is not there need not be stopped.
        let stopped = systemctl(&["disable", "--now", &places.unit_name()]);
        places.uninstall().context(AS_ROOT)?;
        show("the service is removed, with its jobs\n")?;
        match stopped {
            Ok(()) => systemctl(&["daemon-reload"]),
            Err(_) => Ok(()),
        }
    }

    /// The printer without options, and one for each preset that fits.
    fn printers(program: &clap::Command) -> Result<Vec<Preset>> {
        let mut printers = vec![of_words(STANDARD, &[], program)?];
        for (name, words) in preset::all()? {
            if name == STANDARD {
                bail!(
                    "the preset `{STANDARD}` has the name of the printer without options; save it under another one"
                );
            }
            match of_words(&name, &words, program) {
                Ok(printer) => printers.push(printer),
                Err(_) => say(&format!(
                    "note: the preset `{name}` does not fit `foilpress layers`, so it is no printer"
                )),
            }
        }
        Ok(printers)
    }

    fn of_words(name: &str, words: &[String], program: &clap::Command) -> Result<Preset> {
        let typed = ["foilpress", "layers", "art"].into_iter().chain(words.iter().map(String::as_str));
        let matches = program.clone().try_get_matches_from(typed)?;
        let args = crate::cli::Args::from_arg_matches(&matches)?;
        let Command::Layers(layers) = args.command else { bail!("no preset of `foilpress layers`") };
        let about = match words {
            [] => "ALPS MD-5500".into(),
            words => format!("ALPS MD-5500, {}", words.join(" ")),
        };
        Ok(Preset { name: name.into(), about, choices: layers.choices(&Silent)? })
    }

    /// The names under which this computer may be asked for.
    fn hosts() -> Vec<String> {
        let name = std::fs::read_to_string("/proc/sys/kernel/hostname")
            .ok()
            .or_else(|| std::env::var("COMPUTERNAME").ok())
            .or_else(|| std::env::var("HOSTNAME").ok());
        let name = name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
        let Some(name) = name else { return Vec::new() };
        let short = name.split('.').next().unwrap_or(&name).to_owned();
        vec![format!("{short}.local"), name, short]
    }
}
