//! The installed package on the machine's own print system: what `foilpress queue` does there.
//!
//! Changes the machine, so it runs only when asked for: `cargo xtask package` installs the package, runs this, and takes the
//! package away again.

use super::bridge::Bridge;
use super::{FAST, extent, near, pdf, printed};
use protocol::ink::Ink;
use std::fs;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = "/usr/bin/foilpress";
/// No name somebody has given to a queue.
const QUEUE: &str = "Foilpress-package-test";
const NOBODY: u32 = 65534;

fn run(command: &mut Command) -> Output {
    command
        .env("LC_ALL", "C")
        .env_remove("CUPS_SERVER")
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a program says, which has to succeed.
fn say(program: &str, arguments: &[&str]) -> String {
    let output = run(Command::new(program).args(arguments));
    assert!(output.status.success(), "{program} {arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn wait_for(what: &str, mut is: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < Duration::from_secs(60), "waiting in vain for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// The machine's print system; started if it does not run, and then ended again. The queue goes in any case.
struct System(Option<Child>);

impl System {
    fn start() -> System {
        let answers = || run(Command::new("lpstat").arg("-r")).stdout.starts_with(b"scheduler is running");
        let cupsd = (!answers()).then(|| {
            let mut cupsd = Command::new("/usr/sbin/cupsd");
            cupsd.arg("-f").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        });
        let system = System(cupsd);
        wait_for("the print system", answers);
        system
    }
}

impl Drop for System {
    fn drop(&mut self) {
        run(Command::new("lpadmin").args(["-x", QUEUE]));
        if let Some(cupsd) = &mut self.0 {
            let _ = cupsd.kill();
            let _ = cupsd.wait();
        }
    }
}

#[test]
#[ignore = "changes the machine's print system; `cargo xtask package` runs it"]
fn a_queue_of_the_machine_is_made_prints_is_listed_and_goes() {
    let _system = System::start();
    let bridge = Bridge::start(FAST);
    let to = format!("tcp:{}", bridge.address);
    let install = ["queue", "install", "--name", QUEUE, "--to", &to];

    // Who may not is told so, and nothing is left behind.
    let refused = run(Command::new(PROGRAM).args(install).uid(NOBODY).gid(NOBODY).stdin(Stdio::null()));
    assert_eq!(refused.status.code(), Some(1), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("with sudo"), "{}", text(&refused.stderr));
    assert!(!say(PROGRAM, &["queue", "list"]).contains(QUEUE));

    say(PROGRAM, &install);
    let listed = say(PROGRAM, &["queue", "list"]);
    assert!(listed.contains(&format!("{QUEUE}  {}", bridge.uri())) && listed.contains("idle"), "{listed}");

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("art.pdf");
    fs::write(&file, pdf(&["0 g 120 240 240 240 re f"])).unwrap();
    say("lp", &["-d", QUEUE, file.to_str().unwrap()]);
    wait_for("the sheet", || say("lpstat", &["-W", "not-completed", "-o", QUEUE]).is_empty());
    let sheets = printed(&bridge);
    let [sheet] = &sheets[..] else {
        panic!("{} sheets\n{}", sheets.len(), say("lpstat", &["-l", "-p", QUEUE]))
    };
    let top = 842 * 600 / 72 - 284;
    let (sides, dots) = extent(sheet, Ink::Black);
    assert!(near(sides, [1000 - 80, top - 4000, 3000 - 80, top - 2000]), "{sides:?}");
    assert_eq!(dots, ((sides[2] - sides[0]) * (sides[3] - sides[1])) as u64);

    say(PROGRAM, &["queue", "remove", "--name", QUEUE]);
    assert!(!say(PROGRAM, &["queue", "list"]).contains(QUEUE));
    let gone = run(Command::new(PROGRAM).args(["queue", "remove", "--name", QUEUE]));
    assert!(text(&gone.stderr).contains("there is no queue"), "{}", text(&gone.stderr));
    assert!(fs::exists("/usr/lib/cups/backend/foilpress").unwrap(), "the package's files are the package's");
}
