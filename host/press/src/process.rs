//! Other programs at work, under a time limit.
//!
//! Problem: a page in PostScript is a program, and it may never end. Whoever waits for it must be told, and nothing may go on
//! running behind their back.
//! Method: a thread beside each program holds a deadline and kills the program when it passes. Each sign of progress, such
//! as the next page, moves the deadline; while the caller itself is at work there is none. What a program complains of is
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

/// Environment variable with another limit in seconds, for slow computers.
pub const LIMIT_VARIABLE: &str = "FOILPRESS_TIME_LIMIT";

/// The most bytes of complaints that are kept.
const MOST_WORDS: u64 = 1 << 14;

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

struct Clock<T>(Mutex<T>, Condvar);

/// A program at work. Dropping it kills it.
pub struct Process {
    child: Arc<Mutex<Child>>,
    clock: Arc<Clock<Deadline>>,
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
                let _ = io::copy(&mut pipe, &mut io::sink());
                String::from_utf8_lossy(&text).into_owned()
            })
        });
        let child = Arc::new(Mutex::new(child));
        running.push(Arc::clone(&child));
        drop(running);
        let clock = Arc::new(Clock(Mutex::new(Deadline::At(Instant::now() + limit)), Condvar::new()));
        let watched = (Arc::clone(&child), Arc::clone(&clock));
        thread::spawn(move || watch(&watched.0, &watched.1));
        Ok(Process { child, clock, limit, words })
    }

    /// Its output, if the command pipes it; once.
    pub fn output(&mut self) -> Option<ChildStdout> {
        locked(&self.child).stdout.take()
    }

    /// It has made progress, or it is waited for again: the limit begins anew.
    pub fn advance(&self) {
        self.set(Deadline::At(Instant::now() + self.limit));
    }

    /// It is not waited for now: there is no limit until [`Process::advance`].
    pub fn pause(&self) {
        self.set(Deadline::Open);
    }

    /// The error of a program that was killed because its limit has passed.
    pub fn passed(&self) -> Option<ProcessError> {
        matches!(*locked(&self.clock.0), Deadline::Passed).then_some(ProcessError::TooLong(self.limit))
    }

    fn set(&self, deadline: Deadline) {
        let mut now = locked(&self.clock.0);
        if !matches!(*now, Deadline::Passed) {
            *now = deadline;
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
            .take(3)
            .map(|line| line.chars().filter(|c| !c.is_control()).collect::<String>())
            .collect();
        Err(ProcessError::Failed(if said.is_empty() { "no reason given".into() } else { said.join("; ") }))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.set(Deadline::Over);
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
fn watch(child: &Mutex<Child>, Clock(deadline, changed): &Clock<Deadline>) {
    let mut now = locked(deadline);
    loop {
        now = match *now {
            Deadline::Over | Deadline::Passed => return,
            Deadline::Open => changed.wait(now).unwrap_or_else(PoisonError::into_inner),
            Deadline::At(end) => match end.checked_duration_since(Instant::now()) {
                Some(left) => changed.wait_timeout(now, left).unwrap_or_else(PoisonError::into_inner).0,
                None => {
                    *now = Deadline::Passed;
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
        let missing = Process::start(&mut Command::new("no-such-program"), second);
        assert!(
            matches!(missing, Err(ProcessError::Start(error)) if error.kind() == io::ErrorKind::NotFound)
        );
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
