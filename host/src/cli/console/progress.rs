//! Progress bars on the terminal: one at a time, with the time left, and a line for what is done.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::say;
use observe::{Observer, visible_line};

/// Stages shorter than this leave no line behind.
const WORTH_A_LINE: Duration = Duration::from_millis(50);

/// Draws on standard error. Without a terminal it writes only notes and finished stages, one on a line.
pub struct Progress {
    quiet: bool,
    current: Mutex<Option<(ProgressBar, String, Instant)>>,
}

impl Progress {
    /// Progress for a person, or with `quiet` only notes.
    pub fn new(quiet: bool) -> Progress {
        Progress { quiet, current: Mutex::new(None) }
    }

    fn with<R>(&self, act: impl FnOnce(&mut Option<(ProgressBar, String, Instant)>) -> R) -> R {
        act(&mut self.current.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observer for Progress {
    fn begin(&self, stage: &str, total: u64) {
        if self.quiet {
            return;
        }
        self.end();
        let bar = ProgressBar::new(total);
        if let Ok(style) = ProgressStyle::with_template("{msg:>30} {wide_bar} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        let stage = visible_line(stage).into_owned();
        bar.set_message(stage.clone());
        self.with(|current| *current = Some((bar, stage, Instant::now())));
    }

    fn advance(&self, steps: u64) {
        self.with(|current| {
            if let Some((bar, ..)) = current {
                bar.inc(steps);
            }
        });
    }

    fn end(&self) {
        if let Some((bar, stage, start)) = self.with(Option::take) {
            bar.finish_and_clear();
            let took = start.elapsed();
            if took >= WORTH_A_LINE {
                say(&format!("{stage:>30}  {:.1} s", took.as_secs_f64()));
            }
        }
    }

    fn note(&self, text: &str) {
        self.with(|current| match current {
            Some((bar, ..)) => bar.suspend(|| say(&format!("note: {text}"))),
            None => say(&format!("note: {text}")),
        });
    }
}
