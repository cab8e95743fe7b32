//! The server as its clients see it: over a socket.

mod advert;
mod browser;
mod clients;
mod desk;
mod devices;
mod fitted;
mod jobs;
mod limits;
mod network;
mod rights;
mod stuck;

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use inks::Library;
use make::options::Choices;
use observe::Silent;
use serve::body::Limits;
use serve::http::run;
use serve::server::{Preset, Server, Settings};
use tempfile::TempDir;

/// A server in this process, which writes sheets into a folder.
pub struct Running {
    /// The server itself.
    pub server: Arc<Server>,
    /// Where it listens.
    pub address: SocketAddr,
    place: PathBuf,
    /// It goes with the server.
    _folder: Option<TempDir>,
}

impl Running {
    /// With these limits. `prints` says whether anything becomes of jobs.
    pub fn start(limits: Limits, prints: bool) -> Running {
        let folder = tempfile::tempdir().unwrap();
        let to = format!("file:{}", folder.path().join("sheets").display());
        let running = Running::begin_in(folder.path().to_path_buf(), &to, limits, prints);
        Running { _folder: Some(folder), ..running }
    }

    /// One that sends sheets there, and prints nothing.
    pub fn start_to(to: &str, limits: Limits) -> Running {
        let folder = tempfile::tempdir().unwrap();
        let running = Running::begin_in(folder.path().to_path_buf(), to, limits, false);
        Running { _folder: Some(folder), ..running }
    }

    /// One that keeps its things in a folder.
    pub fn begin_in(place: PathBuf, to: &str, limits: Limits, prints: bool) -> Running {
        let server = Arc::new(Server::begin(settings(&place, to), Box::new(Silent)).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let serving = server.clone();
        std::thread::spawn(move || run(&serving, vec![listener], limits).unwrap());
        if prints {
            let printing = server.clone();
            std::thread::spawn(move || serve::worker::work(&printing));
        }
        Running { server, address, place, _folder: None }
    }

    /// A place in the folder of this server.
    pub fn path(&self, name: &str) -> PathBuf {
        self.place.join(name)
    }
}

/// A server with one printer and its things in a folder.
pub fn settings(place: &Path, to: &str) -> Settings {
    let choices = Choices::default();
    Settings {
        to: to.parse().unwrap(),
        printers: vec![Preset { name: "standard".into(), about: "ALPS MD-5500".into(), choices }],
        folder: place.join("serve"),
        library: Library::builtin(),
        devices: device::printers::Printers::at(&place.join("printers")).unwrap(),
        hosts: vec!["workshop.local".into()],
        instance: None,
    }
}
