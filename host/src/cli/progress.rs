//! Progress bars on the terminal: one at a time, with the time left, and a line for what is done.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use crate::observe::Observer;

/// Draws on standard error. Where that is no terminal only notes and finished stages are written, one a line.
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
        if let Ok(style) = ProgressStyle::with_template("{msg:>24} {wide_bar} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(stage.to_owned());
        self.with(|current| *current = Some((bar, stage.to_owned(), Instant::now())));
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
            eprintln!("{stage:>24}  {:.1} s", start.elapsed().as_secs_f64());
        }
    }

    fn note(&self, text: &str) {
        self.with(|current| match current {
            Some((bar, ..)) => bar.suspend(|| eprintln!("note: {text}")),
            None => eprintln!("note: {text}"),
        });
    }
}
