//! The server as a service of the system, and its advertisement: a few kinds of files, and no trace when they
//! are removed.
//!
//! Method: a systemd unit starts the server with a sandbox of its own, as the user of the print system, who
//! may open a bridge. It has settings of its own: the presets that are its printers, and all profiles and ink
//! libraries, which presets name. A service file of Avahi for each of these printers makes it appear in print
//! dialogs. The identity in the advertisement is that of the printer, so no system shows it twice; the server
//! itself announces nothing where Avahi does ([`crate::advert`]). A computer with several printers has a unit
//! for each, `foilpress-serve@NAME`, with a port, settings and jobs of its own.
//! Limits: Linux with systemd and Avahi.
//! Source: systemd.exec(5), avahi.service(5); Bonjour Printing Specification 1.2.1 and PWG 5100.14, section
//! 4, for the keys.

use std::fs;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use files::durable::{self, Access};

use crate::advert::keys;
use crate::printer::title;
use crate::server::{Preset, called};

/// The name of the unit, of its settings below `/etc`, and of its jobs below `/var/lib`.
const NAME: &str = "foilpress-serve";
/// What a server reads of its settings beside presets.
const SETTINGS: [&str; 2] = ["profiles", "libraries"];

/// Where the service keeps its things, below a root.
pub struct Places {
    root: PathBuf,
    instance: Option<String>,
}

/// What the service is started with.
pub struct Service<'a> {
    /// The program.
    pub program: &'a Path,
    /// Where sheets go.
    pub to: &'a str,
    /// Where it listens; everywhere if that is not said.
    pub listen: Option<SocketAddr>,
    /// Its port.
    pub port: u16,
    /// Other names of this computer.
    pub names: &'a [String],
    /// The printers with their identities.
    pub printers: &'a [(Preset, String)],
    /// The folder of the settings that it is to have.
    pub config: &'a Path,
}

impl Places {
    /// Those of the system, or of a folder that stands for its root; of one of several services.
    pub fn at(root: &Path, instance: Option<&str>) -> Places {
        Places { root: root.to_path_buf(), instance: instance.map(str::to_owned) }
    }

    /// What the service is called.
    fn name(&self) -> String {
        self.instance.as_ref().map_or_else(|| NAME.to_owned(), |instance| format!("{NAME}@{instance}"))
    }

    /// The name of its unit.
    pub fn unit_name(&self) -> String {
        format!("{}.service", self.name())
    }

    fn units(&self) -> PathBuf {
        self.root.join("etc/systemd/system")
    }

    fn advertisements(&self) -> PathBuf {
        self.root.join("etc/avahi/services")
    }

    /// How the name of an advertisement begins.
    fn advertises(&self) -> String {
        self.instance
            .as_ref()
            .map_or_else(|| "foilpress-".into(), |instance| format!("foilpress@{instance}-"))
    }

    /// The folder of its jobs.
    pub fn state(&self) -> PathBuf {
        self.root.join("var/lib").join(self.name())
    }

    fn settings(&self) -> PathBuf {
        self.root.join("etc").join(self.name())
    }

    /// The unit of another one of these services that listens at this port.
    ///
    /// # Errors
    /// What the system says.
    pub fn with_port(&self, port: u16) -> io::Result<Option<String>> {
        let line = at_port(port);
        for entry in entries(&self.units())? {
            let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let is_one = name.starts_with(NAME) && name != self.unit_name() && entry.is_file();
            if is_one && fs::read_to_string(&entry)?.lines().any(|found| found == line) {
                return Ok(Some(name));
            }
        }
        Ok(None)
    }

    /// Writes all files, in place of those that an earlier call has left.
    ///
    /// # Errors
    /// What the system says.
    pub fn install(&self, service: &Service<'_>) -> io::Result<Vec<PathBuf>> {
        self.remove_advertisements()?;
        let mut written = Vec::new();
        let mut put = |path: PathBuf, contents: &[u8]| -> io::Result<()> {
            durable::make_folder(path.parent().unwrap_or(Path::new("/")), Access::Everyone)?;
            durable::write(&path, contents, Access::Everyone)?;
            written.push(path);
            Ok(())
        };
        remove_folder(&self.settings())?;
        for (preset, _) in service.printers {
            let file = Path::new("presets").join(format!("{}.toml", preset.name));
            let from = service.config.join(&file);
            if from.is_file() {
                put(self.settings().join(file), &fs::read(from)?)?;
            }
        }
        for folder in SETTINGS {
            for file in all_below(&service.config.join(folder))? {
                let place = file.strip_prefix(service.config).unwrap_or(&file);
                put(self.settings().join(place), &fs::read(&file)?)?;
            }
        }
        for (preset, uuid) in service.printers {
            let name = format!("{}{}.service", self.advertises(), preset.name);
            put(self.advertisements().join(name), self.advertisement(preset, uuid, service.port).as_bytes())?;
        }
        put(self.units().join(self.unit_name()), self.unit(service).as_bytes())?;
        Ok(written)
    }

    /// Removes all files, and the jobs.
    ///
    /// # Errors
    /// What the system says.
    pub fn uninstall(&self) -> io::Result<()> {
        self.remove_advertisements()?;
        match fs::remove_file(self.units().join(self.unit_name())) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        remove_folder(&self.settings())?;
        remove_folder(&self.state())
    }

    fn remove_advertisements(&self) -> io::Result<()> {
        for path in entries(&self.advertisements())? {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if name.starts_with(&self.advertises()) && name.ends_with(".service") {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

/// The line of a unit that says at which port it listens.
fn at_port(port: u16) -> String {
    format!("# It listens at port {port}.")
}

/// What is in a folder; nothing if there is none.
fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        found => found?.map(|entry| Ok(entry?.path())).collect(),
    }
}

/// All files in a folder and below it.
fn all_below(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in entries(folder)? {
        match path.is_dir() {
            true => all.append(&mut all_below(&path)?),
            false => all.push(path),
        }
    }
    all.sort();
    Ok(all)
}

fn remove_folder(path: &Path) -> io::Result<()> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// A word of a unit's command line.
fn quoted(word: &str) -> String {
    let escaped: String = word
        .chars()
        .flat_map(|c| match c {
            '"' | '\\' => vec!['\\', c],
            '%' | '$' => vec![c, c],
            c => vec![c],
        })
        .collect();
    format!("\"{escaped}\"")
}

impl Places {
    fn unit(&self, service: &Service<'_>) -> String {
        let listen = match service.listen {
            Some(address) => format!("--listen {address}"),
            None => "--share".into(),
        };
        let names = service.names.iter().map(|name| format!(" --name {}", quoted(name)));
        let names = names.chain(self.instance.iter().map(|name| format!(" --as {name}")));
        format!(
            "{}\n\
             [Unit]\n\
             Description=Foilpress print server (IPP Everywhere) for the ALPS MD-5500{}\n\
             After=network-online.target avahi-daemon.service\n\
             Wants=network-online.target\n\
             \n\
             [Service]\n\
             ExecStart={} serve {listen} --to {}{} --jobs /var/lib/{state}\n\
             Environment=FOILPRESS_CONFIG=/etc/{state}\n\
             Environment=FOILPRESS_PRINTERS=/var/lib/{state}/printers\n\
             StateDirectory={state}\n\
             {SANDBOX}\
             \n\
             [Install]\n\
             WantedBy=multi-user.target\n",
            at_port(service.port),
            self.instance.as_ref().map(|name| format!(", {name}")).unwrap_or_default(),
            quoted(&service.program.to_string_lossy()),
            quoted(service.to),
            names.collect::<String>(),
            state = self.name(),
        )
    }

    fn advertisement(&self, preset: &Preset, uuid: &str, port: u16) -> String {
        let escape = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let records: String = keys(preset, uuid)
            .into_iter()
            .map(|(key, value)| format!("    <txt-record>{key}={}</txt-record>\n", escape(&value)))
            .collect();
        let service = |kind: &str| {
            format!(
                "  <service>\n    \
                 <type>{kind}._tcp</type>\n    \
                 <subtype>_print._sub.{kind}._tcp</subtype>\n    \
                 <subtype>_universal._sub.{kind}._tcp</subtype>\n    \
                 <port>{port}</port>\n\
                 {records}  \
                 </service>\n"
            )
        };
        format!(
            "<?xml version=\"1.0\" standalone='no'?>\n\
             <!DOCTYPE service-group SYSTEM \"avahi-service.dtd\">\n\
             <service-group>\n  \
             <name replace-wildcards=\"yes\">{}</name>\n\
             {}{}\
             </service-group>\n",
            escape(&title(&preset.name, &called("%h", self.instance.as_deref()))),
            service("_ipp"),
            service("_ipps"),
        )
    }
}

/// What the service may do. It draws documents of strangers: of the system it sees what it needs to reach a
/// bridge.
const SANDBOX: &str = "\
    Restart=on-failure\n\
    User=lp\n\
    Group=lp\n\
    SupplementaryGroups=dialout\n\
    StateDirectoryMode=0700\n\
    UMask=0077\n\
    NoNewPrivileges=yes\n\
    ProtectSystem=strict\n\
    ProtectHome=yes\n\
    ProtectProc=invisible\n\
    ProtectHostname=yes\n\
    ProtectClock=yes\n\
    ProtectKernelLogs=yes\n\
    ProtectKernelModules=yes\n\
    ProtectKernelTunables=yes\n\
    ProtectControlGroups=yes\n\
    PrivateTmp=yes\n\
    PrivateMounts=yes\n\
    DevicePolicy=closed\n\
    DeviceAllow=char-usb_device rw\n\
    DeviceAllow=char-usb rw\n\
    DeviceAllow=char-ttyACM rw\n\
    DeviceAllow=char-ttyUSB rw\n\
    DeviceAllow=char-lp rw\n\
    RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX AF_NETLINK\n\
    RestrictNamespaces=yes\n\
    RestrictRealtime=yes\n\
    RestrictSUIDSGID=yes\n\
    LockPersonality=yes\n\
    MemoryDenyWriteExecute=yes\n\
    RemoveIPC=yes\n\
    SystemCallArchitectures=native\n\
    SystemCallFilter=@system-service\n\
    SystemCallFilter=~@privileged @resources\n\
    CapabilityBoundingSet=\n\
    MemoryMax=2G\n";

#[cfg(test)]
mod tests {
    use super::*;
    use make::options::Choices;

    fn everything(folder: &Path) -> Vec<PathBuf> {
        let mut all = Vec::new();
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.path() {
                path if path.is_dir() => all.extend(everything(&path)),
                path => all.push(path),
            }
        }
        all
    }

    #[test]
    fn what_is_installed_names_each_printer_once_and_uninstalling_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (root, config) = (folder.path().join("root"), folder.path().join("config"));
        for (file, text) in [
            ("presets/decal.toml", "[options]\nmedia = \"film\"\n"),
            ("presets/other.toml", "no printer"),
            ("profiles/default.toml", "offset"),
            ("libraries/mine/library.toml", "inks"),
        ] {
            fs::create_dir_all(config.join(file).parent().unwrap()).unwrap();
            fs::write(config.join(file), text).unwrap();
        }
        let preset = |name: &str| {
            let choices = Choices::default();
            (Preset { name: name.into(), about: "<&>".into(), choices }, format!("uuid-of-{name}"))
        };
        let (places, left) = (Places::at(&root, None), Places::at(&root, Some("left")));
        let names = ["printer.lan".to_owned()];
        let service = |printers| Service {
            program: Path::new("/opt/50% \"of\"/foilpress"),
            to: "usb:",
            listen: None,
            port: 8631,
            names: &names,
            printers,
            config: &config,
        };
        let (three, two) =
            ([preset("standard"), preset("decal"), preset("old")], [preset("standard"), preset("decal")]);
        places.install(&service(&three[..])).unwrap();
        let others = root.join("etc/avahi/services/others.service");
        fs::write(&others, "theirs").unwrap();
        // Again with one printer less: its advertisement goes.
        let written = places.install(&service(&two[..])).unwrap();
        let mut found = everything(&root);
        found.retain(|path| *path != others);
        found.sort();
        let mut expected = written.clone();
        expected.sort();
        assert_eq!(found, expected);
        assert_eq!(written.len(), 6);
        assert_eq!(
            fs::read_to_string(root.join("etc/foilpress-serve/profiles/default.toml")).unwrap(),
            "offset"
        );
        let read = |path: &str| fs::read_to_string(root.join(path)).unwrap();
        let text = read("etc/avahi/services/foilpress-decal.service");
        for record in
            ["rp=ipp/print/decal", "UUID=uuid-of-decal", "URF=V1.4", "pdl=application/pdf,image/pwg-raster"]
        {
            assert!(text.contains(&format!("<txt-record>{record}")), "{record}: {text}");
        }
        let unit = read("etc/systemd/system/foilpress-serve.service");
        let starts =
            r#"ExecStart="/opt/50%% \"of\"/foilpress" serve --share --to "usb:" --name "printer.lan" --jobs"#;
        assert!(unit.contains(starts), "{unit}");
        // A second printer beside it: with a port, settings and a name of its own, and it goes alone.
        assert_eq!(left.with_port(8631).unwrap().as_deref(), Some("foilpress-serve.service"));
        assert_eq!((left.with_port(8632).unwrap(), places.with_port(8631).unwrap()), (None, None));
        assert_eq!(left.with_port(863).unwrap(), None);
        let listen = Some("[::]:8632".parse().unwrap());
        left.install(&Service { port: 8632, listen, names: &[], ..service(&two[..]) }).unwrap();
        let unit = read("etc/systemd/system/foilpress-serve@left.service");
        for words in ["--listen [::]:8632", "--as left", "FOILPRESS_CONFIG=/etc/foilpress-serve@left\n"] {
            assert!(unit.contains(words), "{unit}");
        }
        assert!(read("etc/avahi/services/foilpress@left-decal.service").contains("ALPS decal @ %h left"));
        assert_eq!(places.with_port(8632).unwrap().as_deref(), Some("foilpress-serve@left.service"));
        left.uninstall().unwrap();
        let mut again = everything(&root);
        again.retain(|path| *path != others);
        again.sort();
        assert_eq!(again, expected);
        fs::create_dir_all(places.state().join("jobs/1")).unwrap();
        places.uninstall().unwrap();
        assert_eq!(everything(&root), [others]);
        assert!(!places.state().exists());
        places.uninstall().unwrap();
    }

    /// As strangers' documents are drawn inside. Judged by the system's own table, where it has one.
    #[test]
    fn the_sandbox_is_tight() {
        let folder = tempfile::tempdir().unwrap();
        let places = Places::at(folder.path(), None);
        let service = Service {
            program: Path::new("/usr/bin/foilpress"),
            to: "usb:",
            listen: None,
            port: 8631,
            names: &[],
            printers: &[],
            config: folder.path(),
        };
        places.install(&service).unwrap();
        let unit = folder.path().join("etc/systemd/system/foilpress-serve.service");
        let judged = std::process::Command::new("systemd-analyze")
            .args(["security", "--offline=yes", "--threshold=30"])
            .arg(&unit)
            .output();
        let Ok(judged) = judged else { return println!("skipped: there is no systemd-analyze") };
        let text = String::from_utf8_lossy(&judged.stdout).into_owned();
        assert!(judged.status.success(), "{text}");
    }
}
