//! `foilpress bridge status --watch`: the status, refreshed until the program is interrupted.

use std::io::Write as _;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Result;
use console::Term;
use protocol::link::message::Ask;
use serde_json::json;

use super::found::{Found, PATIENCE};
use crate::cli::console::{chain, draw, stdout};
use device::connection::Address;
use device::connection::transport::Transport;
use device::questions::query::{Query, Reply};
use observe::visible;

/// Time between two questions to the bridge.
const POLL: Duration = Duration::from_secs(1);

/// Time between two questions to the printer, which is asked only between jobs.
const ASK: Duration = Duration::from_secs(5);

/// Rows that a text takes on a terminal with so many columns.
fn rows(text: &str, columns: usize) -> usize {
    text.lines().map(|line| line.chars().count().div_ceil(columns.max(1)).max(1)).sum()
}

/// What is on the screen.
struct Screen {
    json: bool,
    terminal: bool,
    /// The text that was shown last.
    shown: String,
}

impl Screen {
    /// Shows a text in place of the last one. Without a terminal it is added below, if it differs.
    fn show(&mut self, text: String) -> std::io::Result<()> {
        if text == self.shown {
            return Ok(());
        }
        let mut out = stdout();
        if self.terminal && !self.shown.is_empty() {
            // Moves up to the first line and erases everything below.
            let columns = usize::from(Term::stdout().size().1);
            draw(&format!("\x1b[{}F\x1b[J", rows(&visible(&self.shown), columns)))?;
        } else if !self.json && !self.shown.is_empty() {
            writeln!(out)?;
        }
        out.write_all(text.as_bytes())?;
        self.shown = text;
        out.flush()
    }

    fn show_found(&mut self, found: &Found) -> Result<()> {
        let mut text = Vec::new();
        if self.json {
            writeln!(text, "{}", serde_json::to_string(&found.json())?)?;
        } else {
            found.write(&mut text)?;
        }
        Ok(self.show(String::from_utf8_lossy(&text).into_owned())?)
    }

    fn show_loss(&mut self, address: &Address, error: &anyhow::Error) -> Result<()> {
        Ok(self.show(if self.json {
            format!("{}\n", json!({ "address": address.to_string(), "lost": chain(error) }))
        } else {
            format!("{address}: {}; trying again\n", chain(error))
        })?)
    }
}

/// Shows bridge and printer for ever. Waits for a bridge that goes away, once it has been connected.
pub fn run(address: &Address, json: bool, quiet: bool) -> Result<()> {
    let mut screen = Screen { json, terminal: stdout().is_terminal() && !json, shown: String::new() };
    let mut been = false;
    loop {
        let met = match address.open() {
            Ok(mut link) => follow(&mut *link, quiet, &mut screen, &mut been),
            Err(error) => Err(error.into()),
        };
        match met {
            Err(error) if been && error.downcast_ref::<std::io::Error>().is_none() => {
                screen.show_loss(address, &error)?;
            }
            Err(error) => return Err(error),
            Ok(never) => match never {},
        }
        sleep(POLL);
    }
}

/// Follows one connection until it fails. An error of standard output is an [`std::io::Error`].
fn follow(
    link: &mut dyn Transport,
    quiet: bool,
    screen: &mut Screen,
    been: &mut bool,
) -> Result<std::convert::Infallible> {
    let mut query = Query::new(link, PATIENCE)?;
    let mut found = Found::of_bridge(&mut query)?;
    *been = true;
    let mut asked: Option<Instant> = None;
    loop {
        match (found.fault, found.progress.is_open()) {
            (Some(fault), _) => found.status = Reply::Stopped(fault),
            (None, true) => found.status = Reply::NotNow,
            (None, false) if asked.is_none_or(|at| at.elapsed() >= ASK) => {
                if !matches!(found.device_id, Reply::Bytes(_) | Reply::OneWay) {
                    found.device_id = found.printer(&mut query, Ask::DeviceId, quiet)?;
                }
                found.status = found.printer(&mut query, Ask::Printer, quiet)?;
                asked = Some(Instant::now());
            }
            (None, false) => {}
        }
        screen.show_found(&found)?;
        sleep(POLL);
        found.progress = query.ask_progress(PATIENCE)?;
        found.standing = query.standing();
        (found.lines, found.fault) = query.lines(PATIENCE)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_longer_than_the_terminal_takes_more_rows() {
        assert_eq!(rows("12345678\n\n123456789\n", 8), 1 + 1 + 2);
        assert_eq!(rows("", 80), 0);
    }
}
