//! The server as a service of the system, and its advertisement: two kinds of files, and no trace when they are removed.
//!
//! Method: a systemd unit starts the server with a sandbox of its own, as the user of the print system, who may open a bridge. A service
//! file of Avahi for each printer makes it appear in print dialogs. The identity in the advertisement is that of the printer, so no
//! system shows it twice; the server itself announces nothing where Avahi does ([`crate::advert`]).
//! Limits: Linux with systemd and Avahi.
//! Source: systemd.exec(5), avahi.service(5); Bonjour Printing Specification 1.2.1 and PWG 5100.14, section 4, for the keys.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use files::durable::{self, Access};

use crate::advert::keys;
use crate::printer::title;
use crate::server::Preset;

/// The name of the unit.
pub const UNIT: &str = "foilpress-serve.service";
/// Folder of jobs, below `/var/lib`.
const STATE: &str = "foilpress-serve";

/// Where the service keeps its things, below a root.
pub struct Places {
    root: PathBuf,
}

/// What the service is started with.
pub struct Service<'a> {
    /// The program.
    pub program: &'a Path,
    /// Where sheets go.
    pub to: &'a str,
    /// Its port.
    pub port: u16,
    /// The printers with their identities.
    pub printers: &'a [(Preset, String)],
    /// The folder with the presets it is to have.
    pub presets: &'a Path,
}

impl Places {
    /// Those of the system, or of a folder that stands for its root.
    pub fn at(root: &Path) -> Places {
        Places { root: root.to_path_buf() }
    }

    fn unit(&self) -> PathBuf {
        self.root.join("etc/systemd/system").join(UNIT)
    }

    fn advertisements(&self) -> PathBuf {
        self.root.join("etc/avahi/services")
    }

    /// The folder of its jobs.
    pub fn state(&self) -> PathBuf {
        self.root.join("var/lib").join(STATE)
    }

    fn presets(&self) -> PathBuf {
        self.root.join("etc/foilpress-serve/presets")
    }

    /// Writes all files, in place of those that an earlier call has left.
    ///
    /// # Errors
    /// What the system says.
    pub fn install(&self, service: &Service<'_>) -> io::Result<Vec<PathBuf>> {
        self.remove_advertisements()?;
        let mut written = Vec::new();
        let mut put = |path: PathBuf, text: &str| -> io::Result<()> {
            durable::make_folder(path.parent().unwrap_or(Path::new("/")), Access::Everyone)?;
            durable::write(&path, text.as_bytes(), Access::Everyone)?;
            written.push(path);
            Ok(())
        };
        remove_folder(&self.presets())?;
        for (preset, _) in service.printers {
            let from = service.presets.join(format!("{}.toml", preset.name));
            if from.is_file() {
                put(self.presets().join(format!("{}.toml", preset.name)), &fs::read_to_string(from)?)?;
            }
        }
        for (preset, uuid) in service.printers {
            let name = format!("foilpress-{}.service", preset.name);
            put(self.advertisements().join(name), &advertisement(preset, uuid, service.port))?;
        }
        put(self.unit(), &unit(service))?;
        Ok(written)
    }

    /// Removes all files, and the jobs.
    ///
    /// # Errors
    /// What the system says.
    pub fn uninstall(&self) -> io::Result<()> {
        self.remove_advertisements()?;
        match fs::remove_file(self.unit()) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        remove_folder(&self.root.join("etc/foilpress-serve"))?;
        remove_folder(&self.state())
    }

    fn remove_advertisements(&self) -> io::Result<()> {
        let folder = match fs::read_dir(self.advertisements()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            folder => folder?,
        };
        for entry in folder {
            let path = entry?.path();
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if name.starts_with("foilpress-") && name.ends_with(".service") {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
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

fn unit(service: &Service<'_>) -> String {
    format!(
        "[Unit]\n\
         Description=Foilpress print server (IPP Everywhere) for the ALPS MD-5500\n\
         After=network-online.target avahi-daemon.service\n\
         Wants=network-online.target\n\
         \n\
         [Service]\n\
         ExecStart={} serve --share --listen 0.0.0.0:{} --to {} --jobs /var/lib/{STATE}\n\
         Environment=FOILPRESS_CONFIG=/etc/foilpress-serve\n\
         Environment=FOILPRESS_PRINTERS=/var/lib/{STATE}/printers\n\
         Restart=on-failure\n\
         User=lp\n\
         Group=lp\n\
         SupplementaryGroups=dialout\n\
         StateDirectory={STATE}\n\
         StateDirectoryMode=0700\n\
         NoNewPrivileges=yes\n\
         ProtectSystem=strict\n\
         ProtectHome=yes\n\
         PrivateTmp=yes\n\
         ProtectKernelTunables=yes\n\
         ProtectKernelModules=yes\n\
         ProtectControlGroups=yes\n\
         ProtectClock=yes\n\
         RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX AF_NETLINK\n\
         RestrictNamespaces=yes\n\
         RestrictSUIDSGID=yes\n\
         LockPersonality=yes\n\
         CapabilityBoundingSet=\n\
         MemoryMax=2G\n\
         \n\
         [Install]\n\
         WantedBy=multi-user.target\n",
        quoted(&service.program.to_string_lossy()),
        service.port,
        quoted(service.to),
    )
}

fn advertisement(preset: &Preset, uuid: &str, port: u16) -> String {
    let escape = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let records: String = keys(preset, uuid)
        .into_iter()
        .map(|(key, value)| format!("    <txt-record>{key}={}</txt-record>\n", escape(&value)))
        .collect();
    format!(
        "<?xml version=\"1.0\" standalone='no'?>\n\
         <!DOCTYPE service-group SYSTEM \"avahi-service.dtd\">\n\
         <service-group>\n  \
         <name replace-wildcards=\"yes\">{}</name>\n  \
         <service>\n    \
         <type>_ipp._tcp</type>\n    \
         <subtype>_print._sub._ipp._tcp</subtype>\n    \
         <subtype>_universal._sub._ipp._tcp</subtype>\n    \
         <port>{port}</port>\n\
         {records}  \
         </service>\n  \
         <service>\n    \
         <type>_ipps._tcp</type>\n    \
         <subtype>_print._sub._ipps._tcp</subtype>\n    \
         <subtype>_universal._sub._ipps._tcp</subtype>\n    \
         <port>{port}</port>\n\
         {records}  \
         </service>\n\
         </service-group>\n",
        escape(&title(&preset.name, "%h"))
    )
}

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
        let (root, presets) = (folder.path().join("root"), folder.path().join("presets"));
        fs::create_dir_all(&presets).unwrap();
        fs::write(presets.join("decal.toml"), "[options]\nmedia = \"film\"\n").unwrap();
        let preset = |name: &str| {
            let choices = Choices::default();
            (Preset { name: name.into(), about: "<&>".into(), choices }, format!("uuid-of-{name}"))
        };
        let places = Places::at(&root);
        let service = |printers| Service {
            program: Path::new("/opt/50% \"of\"/foilpress"),
            to: "usb:",
            port: 8631,
            printers,
            presets: &presets,
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
        assert_eq!(written.len(), 4);
        let read = |path: &str| fs::read_to_string(root.join(path)).unwrap();
        let text = read("etc/avahi/services/foilpress-decal.service");
        for record in
            ["rp=ipp/print/decal", "UUID=uuid-of-decal", "URF=V1.4", "pdl=application/pdf,image/pwg-raster"]
        {
            assert!(text.contains(&format!("<txt-record>{record}")), "{record}: {text}");
        }
        let unit = read("etc/systemd/system/foilpress-serve.service");
        assert!(unit.contains(r#"ExecStart="/opt/50%% \"of\"/foilpress" serve --share"#), "{unit}");
        fs::create_dir_all(places.state().join("jobs/1")).unwrap();
        places.uninstall().unwrap();
        assert_eq!(everything(&root), [others]);
        assert!(!places.state().exists());
        places.uninstall().unwrap();
    }
}
