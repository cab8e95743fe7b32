//! Other programs at work, under a time limit.
//!
//! Problem: a page in PostScript is a program, and it may never end. Whoever waits for it must be told, and nothing may go on
//! running behind their back.
//! Method: a thread beside each program holds a deadline and kills the program when it passes. Each sign of progress, such
//! as the next page, moves the deadline; while the caller itself is at work there is none. All pages together have a limit,
//! too, and there are at most [`MOST_PAGES`]: a program may show pages for ever. What a program complains of is
//! read all the time, so it never waits for a full pipe, and its first lines become the error. One list has all programs at
//! work, and [`stop_all`] kills them when this one is interrupted.
//! Cost: two threads for each program. Limits: only the program itself is killed, not what it may have started.

use std::io::{self, Read as _};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How long a page may take unless [`LIMIT_VARIABLE`] says otherwise. The heaviest ordinary pages take some ten seconds at
/// 600 dpi.
const LIMIT: Duration = Duration::from_secs(60);

/// How many pages at their limit a document may take altogether: ten minutes, unless the limit of a page is another.
const PAGES_LIMIT: u32 = 10;

/// The most pages of a document: a print of more would take days; few enough for hostile files.
pub const MOST_PAGES: u32 = 1000;

/// Environment variable with another limit in seconds, for slow computers.
pub const LIMIT_VARIABLE: &str = "FOILPRESS_TIME_LIMIT";

/// The most bytes of complaints that are kept from their beginning, so that a hostile document does not fill
/// memory with them.
const MOST_WORDS: u64 = 1 << 16;

/// The most bytes of complaints that are kept from their end, where Ghostscript sums them up: enough for its
/// summary.
const LAST_WORDS: usize = 1 << 14;

/// How lines begin that only tell how far Ghostscript is.
const PROGRESS: [&str; 3] = ["Processing pages ", "Page ", "Loading "];

/// How often a program is asked whether it has ended.
const POLL: Duration = Duration::from_millis(5);

/// How long a page may take: [`LIMIT_VARIABLE`] in seconds, from 1 to 86400, or one minute.
#[must_use]
pub fn limit() -> Duration {
    let seconds = std::env::var(LIMIT_VARIABLE).ok().and_then(|text| text.trim().parse().ok());
    seconds.filter(|seconds| (1..=86_400).contains(seconds)).map_or(LIMIT, Duration::from_secs)
}

/// A page that takes too long, in words.
#[must_use]
pub fn too_long(limit: Duration) -> String {
    format!(
        "drawing it took more than {} s and was stopped; simplify it, or export the page as PNG; on a slow computer, set \
         {LIMIT_VARIABLE} to more seconds",
        limit.as_secs()
    )
}

/// Why a program did not do its work.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// It cannot be started, for example because it is not installed.
    #[error("it cannot be started")]
    Start(#[source] io::Error),
    /// It failed; what it complained of.
    #[error("{0}")]
    Failed(String),
    /// It took too long and was stopped.
    #[error("{}", too_long(*.0))]
    TooLong(Duration),
    /// All pages together took too long, and it was stopped.
    #[error(
        "drawing its pages took more than {} s altogether and was stopped; print fewer pages at once; on a slow computer, set \
         {LIMIT_VARIABLE} to more seconds",
        .0.as_secs()
    )]
    TooLongAltogether(Duration),
    /// The operating system reported an error.
    #[error("it cannot be watched")]
    Io(#[from] io::Error),
}

/// The programs at work. A program that has ended may be in the list: killing it does nothing.
static RUNNING: Mutex<Vec<Arc<Mutex<Child>>>> = Mutex::new(Vec::new());

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Kills every program at work and lets none be started any more. Called when this program is interrupted: who waits for a
/// killed program takes it for a failure, and may try another way.
pub fn stop_all() {
    let running = locked(&RUNNING);
    for child in running.iter() {
        let mut child = locked(child);
        // It may have ended meanwhile. A killed program ends at once, but not before it is waited for.
        let _ = child.kill();
        let _ = child.wait();
    }
    // Never released.
    std::mem::forget(running);
}

/// Until when the program may go on without progress.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Deadline {
    /// Until then.
    At(Instant),
    /// For ever: the caller is at work.
    Open,
    /// It has passed, and the program was killed.
    Passed,
    /// The program has ended.
    Over,
}

/// The time of a program.
struct Time {
    deadline: Deadline,
    /// Since when it is at work; none while the caller is.
    since: Option<Instant>,
    /// What it had left for all pages then.
    left: Duration,
}

impl Time {
    /// The program begins to work or goes on: it has this limit, or what is left for all pages.
    fn advance(&mut self, now: Instant, limit: Duration) {
        self.stop(now);
        self.since = Some(now);
        self.deadline = Deadline::At(now + limit.min(self.left));
    }

    /// The program has worked until now.
    fn stop(&mut self, now: Instant) {
        if let Some(since) = self.since.take() {
            self.left = self.left.saturating_sub(now - since);
        }
        self.deadline = Deadline::Open;
    }
}

struct Clock(Mutex<Time>, Condvar);

/// A program at work. Dropping it kills it.
pub struct Process {
    child: Arc<Mutex<Child>>,
    clock: Arc<Clock>,
    limit: Duration,
    words: Option<JoinHandle<String>>,
}

impl Process {
    /// Starts a program with this limit. Its input is empty; its output goes where the command says, its complaints here.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start(command: &mut Command, limit: Duration) -> Result<Process, ProcessError> {
        // The list is held until the program is in it, so that none is missed by `stop_all`.
        let mut running = locked(&RUNNING);
        let mut child =
            command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(ProcessError::Start)?;
        let words = child.stderr.take().map(|mut pipe| {
            thread::spawn(move || {
                let mut text = Vec::new();
                // What cannot be read is not shown.
                let _ = (&mut pipe).take(MOST_WORDS).read_to_end(&mut text);
                let first = text.len();
                while let Ok(1..) = (&mut pipe).take(LAST_WORDS as u64).read_to_end(&mut text) {
                    let beyond = (text.len() - first).saturating_sub(LAST_WORDS);
                    text.drain(first..first + beyond);
                }
                self::text(&text)
            })
        });
        let child = Arc::new(Mutex::new(child));
        running.push(Arc::clone(&child));
        drop(running);
        let mut time = Time { deadline: Deadline::Open, since: None, left: PAGES_LIMIT * limit };
        time.advance(Instant::now(), limit);
        let clock = Arc::new(Clock(Mutex::new(time), Condvar::new()));
        let watched = (Arc::clone(&child), Arc::clone(&clock));
        thread::spawn(move || watch(&watched.0, &watched.1));
        Ok(Process { child, clock, limit, words })
    }

    /// Its output, if the command pipes it; once.
    pub fn output(&mut self) -> Option<ChildStdout> {
        locked(&self.child).stdout.take()
    }

    /// It has made progress, or it is waited for again: the limit begins anew, as far as the limit of all pages allows.
    pub fn advance(&self) {
        self.change(|time| time.advance(Instant::now(), self.limit));
    }

    /// It is not waited for now: there is no limit until [`Process::advance`].
    pub fn pause(&self) {
        self.change(|time| time.stop(Instant::now()));
    }

    /// The error of a program that was killed because its limit has passed.
    pub fn passed(&self) -> Option<ProcessError> {
        let time = locked(&self.clock.0);
        (time.deadline == Deadline::Passed).then(|| match time.left < self.limit {
            true => ProcessError::TooLongAltogether(PAGES_LIMIT * self.limit),
            false => ProcessError::TooLong(self.limit),
        })
    }

    fn change(&self, change: impl FnOnce(&mut Time)) {
        let mut time = locked(&self.clock.0);
        if time.deadline != Deadline::Passed {
            change(&mut time);
            self.clock.1.notify_one();
        }
    }

    /// Waits for its end; `progressed` says whether there is progress since it was last asked. Returns what it said, as far as
    /// it was kept.
    ///
    /// # Errors
    /// It failed, or it took too long.
    pub fn end(mut self, mut progressed: impl FnMut() -> bool) -> Result<String, ProcessError> {
        let status = loop {
            if let Some(status) = locked(&self.child).try_wait()? {
                break status;
            }
            if progressed() {
                self.advance();
            }
            thread::sleep(POLL);
        };
        self.judge(status)
    }

    fn judge(&mut self, status: ExitStatus) -> Result<String, ProcessError> {
        // Before its words are waited for: something that it started may still hold the pipe.
        if let (false, Some(error)) = (status.success(), self.passed()) {
            return Err(error);
        }
        let words = self.words.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        if status.success() {
            return Ok(words);
        }
        let said: Vec<String> = words
            .lines()
            .filter(|line| !PROGRESS.iter().any(|start| line.starts_with(start)))
            .take(3)
            .map(|line| line.chars().filter(|c| !c.is_control()).collect::<String>())
            .collect();
        Err(ProcessError::Failed(if said.is_empty() { "no reason given".into() } else { said.join("; ") }))
    }
}

/// A name in which `mark` and two hexadecimal digits stand for a byte.
pub(crate) fn unescaped(name: &[u8], mark: u8) -> String {
    let mut bytes = Vec::new();
    let mut rest = name;
    while let Some((&byte, after)) = rest.split_first() {
        let digits = after.get(..2).filter(|two| byte == mark && two.iter().all(u8::is_ascii_hexdigit));
        let digits = digits.and_then(|two| str::from_utf8(two).ok());
        match digits.and_then(|two| u8::from_str_radix(two, 16).ok()) {
            Some(code) => {
                bytes.push(code);
                rest = &after[2..];
            }
            None => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    text(&bytes)
}

/// Words of a program or a document in any encoding: each line is UTF-8, else Latin-1, so that unlike bytes stay unlike.
pub(crate) fn text(bytes: &[u8]) -> String {
    let line = |line: &[u8]| match std::str::from_utf8(line) {
        Ok(line) => line.to_owned(),
        Err(_) => line.iter().map(|&byte| char::from(byte)).collect(),
    };
    bytes.split_inclusive(|&byte| byte == b'\n').map(line).collect()
}

impl Drop for Process {
    fn drop(&mut self) {
        self.change(|time| time.deadline = Deadline::Over);
        locked(&RUNNING).retain(|other| !Arc::ptr_eq(other, &self.child));
        let mut child = locked(&self.child);
        if !matches!(child.try_wait(), Ok(Some(_))) {
            let _ = child.kill();
            // A killed program ends at once, and leaves no entry behind in the system's table.
            let _ = child.wait();
        }
    }
}

/// Kills a program when its deadline has passed.
fn watch(child: &Mutex<Child>, Clock(time, changed): &Clock) {
    let mut now = locked(time);
    loop {
        now = match now.deadline {
            Deadline::Over | Deadline::Passed => return,
            Deadline::Open => changed.wait(now).unwrap_or_else(PoisonError::into_inner),
            Deadline::At(end) => match end.checked_duration_since(Instant::now()) {
                Some(left) => changed.wait_timeout(now, left).unwrap_or_else(PoisonError::into_inner).0,
                None => {
                    now.deadline = Deadline::Passed;
                    let _ = locked(child).kill();
                    return;
                }
            },
        };
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdout(Stdio::piped());
        command
    }

    /// Whether a process of this number exists and is no corpse.
    #[cfg(target_os = "linux")]
    fn alive(id: u32) -> bool {
        std::fs::read_to_string(format!("/proc/{id}/stat")).is_ok_and(|text| !text.contains(") Z "))
    }

    #[test]
    fn a_program_that_ends_is_judged_by_its_end_and_its_first_words() {
        let second = Duration::from_secs(20);
        let said = Process::start(&mut shell("echo fine >&2"), second).unwrap().end(|| false).unwrap();
        assert_eq!(said, "fine\n");
        let failed = Process::start(&mut shell("echo one >&2; echo two >&2; exit 3"), second).unwrap();
        assert_eq!(failed.end(|| false).unwrap_err().to_string(), "one; two");
        let far = "echo Processing pages 1 through 2. >&2; echo Page 1 >&2; echo one >&2; exit 3";
        let failed = Process::start(&mut shell(far), second).unwrap();
        assert_eq!(failed.end(|| false).unwrap_err().to_string(), "one");
        let missing = Process::start(&mut Command::new("no-such-program"), second);
        assert!(
            matches!(missing, Err(ProcessError::Start(error)) if error.kind() == io::ErrorKind::NotFound)
        );
    }

    #[test]
    fn of_a_flood_of_words_the_first_and_the_last_are_kept() {
        let script = "echo first >&2; yes | head -c 300000 >&2; echo last >&2";
        let said =
            Process::start(&mut shell(script), Duration::from_secs(20)).unwrap().end(|| false).unwrap();
        assert!(said.starts_with("first\n") && said.ends_with("y\nlast\n"));
        assert_eq!(said.len(), MOST_WORDS as usize + LAST_WORDS);
    }

    #[test]
    fn a_program_that_does_not_end_is_killed_at_its_limit_and_one_that_goes_on_is_not() {
        let limit = Duration::from_millis(300);
        let begun = Instant::now();
        let endless = Process::start(&mut shell("exec sleep 60"), limit).unwrap();
        let error = endless.end(|| false).unwrap_err();
        assert!(matches!(error, ProcessError::TooLong(_)), "{error}");
        assert!(begun.elapsed() < Duration::from_secs(20) && error.to_string().contains(LIMIT_VARIABLE));
        // Twice the limit, with progress all the time.
        let busy = Process::start(&mut shell("sleep 0.7"), limit).unwrap();
        busy.end(|| true).unwrap();
        // The caller is at work.
        let waiting = Process::start(&mut shell("sleep 0.7"), limit).unwrap();
        waiting.pause();
        waiting.end(|| false).unwrap();
    }

    #[test]
    fn progress_for_ever_has_an_end_and_the_callers_own_work_does_not_count() {
        let (second, begun) = (Duration::from_secs(1), Instant::now());
        let at = |seconds: u32| begun + seconds * second;
        let mut time = Time { deadline: Deadline::Open, since: None, left: PAGES_LIMIT * second };
        // A page takes a second, and the caller as long after each.
        for page in 0..PAGES_LIMIT {
            time.advance(at(2 * page), second);
            assert!(time.deadline == Deadline::At(at(2 * page + 1)), "page {page}");
            time.stop(at(2 * page + 1));
            assert!(time.deadline == Deadline::Open);
        }
        time.advance(at(2 * PAGES_LIMIT), second);
        assert!(time.deadline == Deadline::At(at(2 * PAGES_LIMIT)), "nothing is left");
        // Progress at every third of a second.
        let mut time = Time { deadline: Deadline::Open, since: None, left: PAGES_LIMIT * second };
        for third in 0..3 * PAGES_LIMIT {
            time.advance(begun + third * second / 3, second);
            let Deadline::At(end) = time.deadline else { panic!("it is at work") };
            assert!(end <= at(PAGES_LIMIT), "{third}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn nothing_runs_on_when_a_program_is_dropped_or_all_are_stopped() {
        let start = || Process::start(&mut shell("exec sleep 60"), Duration::from_secs(60)).unwrap();
        let dropped = start();
        let id = locked(&dropped.child).id();
        assert!(alive(id));
        drop(dropped);
        assert!(!alive(id));
        let stopped = start();
        // Other tests' programs may not be killed, so only this one is taken from the list.
        let id = locked(&stopped.child).id();
        assert!(locked(&RUNNING).iter().any(|child| locked(child).id() == id));
        let _ = locked(&stopped.child).kill();
        assert!(stopped.end(|| false).is_err() && !alive(id));
        assert!(!locked(&RUNNING).iter().any(|child| locked(child).id() == id));
    }
}
