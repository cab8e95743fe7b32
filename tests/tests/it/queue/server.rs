//! A print server of its own: configuration, spool and programs in a temporary folder, on loopback, no system service.

use press::layout::Profile;
use queue::install::{DESCRIPTION, Places, put};
use queue::ppd;
use std::fs;
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use testing::needs::Need;

/// Longer than anything here takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(240);

pub struct Server {
    folder: TempDir,
    place: String,
    cupsd: Option<Child>,
}

/// Whether a server can be started here; else the test is left out.
pub fn available() -> bool {
    let needed = [
        "/usr/sbin/cupsd",
        "/usr/bin/lp",
        "/usr/sbin/lpadmin",
        "/usr/bin/ipptool",
        "/usr/lib/cups/filter/pdftopdf",
        "/usr/bin/gs",
    ];
    let absent: Vec<&str> = needed.into_iter().filter(|path| !Path::new(path).exists()).collect();
    // The server gives its programs other rights, which only root can.
    let root = fs::metadata("/proc/self").is_ok_and(|data| std::os::unix::fs::MetadataExt::uid(&data) == 0);
    match (absent.as_slice(), root) {
        ([], true) => return true,
        ([], false) => Need::Queue.skip("only root can start a print server"),
        (absent, _) => {
            Need::Queue
                .skip(&format!("{} not installed; `cargo xtask queue` installs them", absent.join(", ")));
        }
    }
    false
}

impl Server {
    pub fn start() -> Server {
        let folder = tempfile::Builder::new().prefix("foilpress-cups").tempdir().unwrap();
        // Filters and backends run as another user.
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut server = Server { folder, place: format!("127.0.0.1:{port}"), cupsd: None };
        server.configure();
        server.run();
        server
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn configure(&self) {
        let root = self.folder.path().display();
        // As the package makes it: every user may add to it.
        fs::create_dir(self.path("printers")).unwrap();
        fs::set_permissions(self.path("printers"), fs::Permissions::from_mode(0o1777)).unwrap();
        for folder in ["etc", "cache", "run", "spool", "spool/tmp", "log", "bin", "files"] {
            fs::create_dir_all(self.path(folder)).unwrap();
        }
        // The system's own programs, and among them ours.
        for folder in fs::read_dir("/usr/lib/cups").unwrap().map(|entry| entry.unwrap()) {
            let here = self.path("bin").join(folder.file_name());
            fs::create_dir_all(&here).unwrap();
            for program in fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap()) {
                if program.file_name() != "foilpress" {
                    symlink(program.path(), here.join(program.file_name())).unwrap();
                }
            }
        }
        let program = self.path("bin/foilpress");
        fs::copy(testing::program::path(), &program).unwrap();
        let places = Places {
            programs: self.path("bin"),
            types: self.path("etc"),
            descriptions: self.path("files"),
            program: program.clone(),
        };
        for file in places.files(&program) {
            put(&file).unwrap();
        }
        fs::write(
            self.path("etc/cups-files.conf"),
            format!(
                "ServerRoot {root}/etc\nServerBin {root}/bin\nCacheDir {root}/cache\nStateDir {root}/run\n\
             RequestRoot {root}/spool\nTempDir {root}/spool/tmp\nAccessLog {root}/log/access\n\
             ErrorLog {root}/log/error\nPageLog {root}/log/page\nSystemGroup root\nUser lp\nGroup lp\n\
             SetEnv FOILPRESS_PRINTERS {root}/printers\n"
            ),
        )
        .unwrap();
        fs::write(self.path("etc/cupsd.conf"), format!(
            "Listen {}\nLogLevel debug\nDirtyCleanInterval 0\nBrowsing Off\nWebInterface No\nDefaultAuthType None\nPageLogFormat %p %j %P %C\n\
             <Location />\nOrder allow,deny\nAllow all\n</Location>\n\
             <Policy default>\nJobPrivateAccess all\nJobPrivateValues none\n<Limit All>\nOrder allow,deny\nAllow all\n\
             </Limit>\n</Policy>\n",
            self.place
        )).unwrap();
    }

    /// Starts the server, again after [`Server::kill`].
    pub fn run(&mut self) {
        let child = Command::new("/usr/sbin/cupsd")
            .arg("-f")
            .arg("-c")
            .arg(self.path("etc/cupsd.conf"))
            .arg("-s")
            .arg(self.path("etc/cups-files.conf"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        self.cupsd = Some(child);
        self.wait_for("the server to listen", |server| TcpStream::connect(&server.place).is_ok());
    }

    /// Ends the server as a crash would, and its backends with it.
    pub fn kill(&mut self) {
        if let Some(mut cupsd) = self.cupsd.take() {
            let children = children(cupsd.id());
            cupsd.kill().unwrap();
            cupsd.wait().unwrap();
            for child in children {
                let _ = Command::new("kill").args(["-9", &child.to_string()]).status();
            }
        }
    }

    pub fn command(&self, program: &str, arguments: &[&str]) -> Output {
        let mut command = Command::new(program);
        command.args(arguments).env("CUPS_SERVER", &self.place).env("LC_ALL", "C");
        command.output().unwrap_or_else(|error| panic!("{program}: {error}"))
    }

    /// What a program says, which has to succeed.
    pub fn say(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(program, arguments);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(output.status.success(), "{program} {arguments:?}: {}\n{}", text(&output.stderr), self.log());
        text(&output.stdout)
    }

    /// Makes a queue that leads to `uri`.
    pub fn queue(&self, name: &str, uri: &str) {
        let description = self.path("files").join(DESCRIPTION);
        self.say("lpadmin", &["-p", name, "-v", uri, "-P", description.to_str().unwrap(), "-E"]);
    }

    /// The same for a machine that prints beside its place.
    pub fn queue_of(&self, name: &str, uri: &str, profile: &Profile) {
        fs::write(self.path("files").join(DESCRIPTION), ppd::description(profile)).unwrap();
        self.queue(name, uri);
    }

    /// Prints a file, returns the number of the job.
    pub fn print(&self, arguments: &[&str]) -> u32 {
        let said = self.say("lp", arguments);
        // `request id is Alps-1 (1 file(s))`
        let number =
            said.split_whitespace().nth(3).and_then(|id| id.rsplit_once('-')).map(|(_, n)| n.parse());
        number.unwrap_or_else(|| panic!("{said}")).unwrap()
    }

    pub fn wait_for(&self, what: &str, mut is: impl FnMut(&Server) -> bool) {
        let start = Instant::now();
        while !is(self) {
            assert!(start.elapsed() < PATIENCE, "waiting in vain for {what}\n{}", self.log());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Until a job is over; the word for how it ended.
    pub fn wait_for_job(&self, job: u32) -> String {
        let mut state = String::new();
        self.wait_for(&format!("job {job}"), |server| {
            state = server.job(job, "job-state");
            ["completed", "canceled", "aborted"].contains(&state.as_str())
        });
        state
    }

    /// An attribute of a job.
    pub fn job(&self, job: u32, attribute: &str) -> String {
        let test = self.path("files/job.test");
        fs::write(
            &test,
            "{\nOPERATION Get-Job-Attributes\nGROUP operation-attributes-tag\n\
            ATTR charset attributes-charset utf-8\nATTR language attributes-natural-language en\n\
            ATTR uri job-uri $uri\nATTR name requesting-user-name root\n}\n",
        )
        .unwrap();
        let uri = format!("ipp://{}/jobs/{job}", self.place);
        let said = self.say("ipptool", &["-tv", &uri, test.to_str().unwrap()]);
        let line = said
            .lines()
            .rev()
            .find_map(|line| line.trim().strip_prefix(attribute)?.strip_prefix(" (")?.split_once(" = "));
        line.map_or(String::new(), |(_, value)| value.to_owned())
    }

    /// What people see beside the printer's name: its message and its alerts.
    pub fn state(&self, queue: &str) -> String {
        self.say("lpstat", &["-l", "-p", queue])
    }

    /// The end of the server's log.
    pub fn log(&self) -> String {
        let log = fs::read(self.path("log/error")).unwrap_or_default();
        let log = String::from_utf8_lossy(&log);
        let lines: Vec<&str> =
            log.lines().filter(|line| line.contains("[Job") || line.starts_with('E')).collect();
        lines[lines.len().saturating_sub(60)..].join("\n")
    }
}

/// The processes started by a process, and by those.
fn children(process: u32) -> Vec<u32> {
    let mut all = Vec::new();
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(number) = entry.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else {
            continue;
        };
        // `12 (name) S 1 ...`; a name may hold anything.
        let stat = fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
        let parent = stat.rsplit_once(')').and_then(|(_, rest)| rest.split_whitespace().nth(1)?.parse().ok());
        if parent == Some(process) {
            all.push(number);
            all.extend(children(number));
        }
    }
    all
}

impl Drop for Server {
    fn drop(&mut self) {
        self.kill();
    }
}
