//! The server as its clients see it: over a socket.

mod advert;
mod browser;
mod clients;
mod desk;
mod devices;
mod fitted;
mod jobs;
mod limits;
mod rights;

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
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
    folder: TempDir,
}

impl Running {
    /// With these limits. `prints` says whether anything becomes of jobs.
    pub fn start(limits: Limits, prints: bool) -> Running {
        let folder = tempfile::tempdir().unwrap();
        let to = format!("file:{}", folder.path().join("sheets").display());
        Running::begin(folder, &to, limits, prints)
    }

    /// One that sends sheets there, and prints nothing.
    pub fn start_to(to: &str, limits: Limits) -> Running {
        Running::begin(tempfile::tempdir().unwrap(), to, limits, false)
    }

    fn begin(folder: TempDir, to: &str, limits: Limits, prints: bool) -> Running {
        let choices = Choices::default();
        let settings = Settings {
            to: to.parse().unwrap(),
            printers: vec![Preset { name: "standard".into(), about: "ALPS MD-5500".into(), choices }],
            folder: folder.path().join("serve"),
            library: Library::builtin(),
            devices: device::printers::Printers::at(&folder.path().join("printers")).unwrap(),
            hosts: vec!["workshop.local".into()],
        };
        let server = Arc::new(Server::begin(settings, Box::new(Silent)).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let serving = server.clone();
        std::thread::spawn(move || run(&serving, vec![listener], limits).unwrap());
        if prints {
            let printing = server.clone();
            std::thread::spawn(move || serve::worker::work(&printing));
        }
        Running { server, address, folder }
    }

    /// A place in the folder of this server.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
