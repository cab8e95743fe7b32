//! `foilpress bridge test`: test the wiring with a loop-back plug or a meter.

use std::io::Write as _;
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::Args as ClapArgs;
use protocol::link::message::Lines;
use serde_json::json;

use super::found::{PATIENCE, named_or_only};
use crate::cli::console::{say, stderr, stdout};
use crate::cli::output::say_on_interrupt;
use device::connection::Address;
use device::questions::query::{Query, QueryError};
use device::questions::wiring::{self, Levels, OUTPUTS, Plug, Seen, Verdict};

/// Time between two checks whether the plug has been moved.
const POLL: Duration = Duration::from_millis(300);

/// How long each line of the pattern is held: time enough to read a meter.
const HOLD: Duration = Duration::from_secs(3);

/// Arguments of `bridge test`.
#[derive(ClapArgs, Debug)]
#[command(after_help = "Examples:\n  foilpress bridge test\n  foilpress bridge test --pattern\n\n\
    Take the cable off the printer first, and put the loop-back plug on its end; docs/wiring.md says how to make one. The \
    plug has three positions, and the test waits until it has been in each. The test looks for the plug with the data lines \
    only, which a printer ignores, and goes on only when it has found one: what follows would reset a printer and send it \
    bytes. --pattern needs no plug: it holds one output after the other at its opposite level for three seconds each. It \
    refuses to run while something that is switched on is connected.")]
pub struct Args {
    /// Address of the bridge [default: the only one]
    #[arg(long, value_name = "WHERE")]
    to: Option<Address>,
    /// Step through the outputs slowly, for a meter or an oscilloscope
    #[arg(long)]
    pattern: bool,
    /// Print JSON
    #[arg(long, conflicts_with = "pattern")]
    json: bool,
}

/// Runs `bridge test`. Fails if the wiring is not good.
pub fn run(args: &Args) -> Result<()> {
    let address = named_or_only(args.to.as_ref())?;
    let mut link = address.open()?;
    let mut query = Query::new(&mut *link, PATIENCE)?;
    let progress = *query.progress();
    if progress.is_open() {
        bail!(QueryError::JobOpen(progress.job));
    }
    if args.pattern { walk(&mut query) } else { test(&mut query, args.json) }
}

fn probe(query: &mut Query<'_>, levels: Levels) -> Result<Lines, QueryError> {
    query.probe(levels.data(), levels.control(), PATIENCE)
}

fn test(query: &mut Query<'_>, json: bool) -> Result<()> {
    let seen = try_positions(&mut |levels| probe(query, levels))?;
    probe(query, Levels::REST)?;
    if seen.is_empty() {
        bail!(
            "no loop-back plug answers; connect it in place of the printer (docs/wiring.md says how to make one)"
        );
    }
    let tried: Vec<u8> = seen.iter().map(|seen| seen.plug.number()).collect();
    let verdict = wiring::judge(&seen);
    report(&verdict, &tried, json)?;
    if verdict != Verdict::Good {
        bail!("the wiring is faulty");
    }
    Ok(())
}

/// Tests the plug in each of its positions; without a terminal, only in its present one, since nobody can be asked to move it.
fn try_positions(probe: &mut dyn FnMut(Levels) -> Result<Lines, QueryError>) -> Result<Vec<Seen>> {
    let attended = stderr().is_terminal();
    let mut seen: Vec<Seen> = Vec::new();
    let mut asked = None;
    while let Some(next) = Plug::ALL.into_iter().find(|plug| seen.iter().all(|seen| seen.plug != *plug)) {
        match wiring::find(probe)? {
            Some(plug) if seen.iter().all(|seen| seen.plug != plug) => {
                let found = wiring::look(plug, probe)?;
                // Only if the plug was not moved meanwhile.
                if wiring::find(probe)? == Some(plug) {
                    let words = if found.is_good() { "good" } else { "faulty" };
                    say(&format!("position {}: {words}", plug.number()));
                    seen.push(found);
                }
            }
            _ if !attended => break,
            _ => {
                if asked.replace(next) != Some(next) {
                    say(&format!(
                        "put the loop-back plug in position {} (in place of the printer)",
                        next.number()
                    ));
                }
                sleep(POLL);
            }
        }
    }
    Ok(seen)
}

fn report(verdict: &Verdict, tried: &[u8], json: bool) -> Result<()> {
    let mut out = stdout();
    if json {
        let (faults, astray) = match verdict {
            Verdict::Good => (vec![], vec![]),
            Verdict::One(faults) => (faults.iter().map(ToString::to_string).collect(), vec![]),
            Verdict::Several(astray) => (vec![], astray.clone()),
        };
        let good = *verdict == Verdict::Good;
        let all = json!({ "good": good, "positions": tried, "one_of": faults, "astray": astray });
        return Ok(writeln!(out, "{}", serde_json::to_string_pretty(&all)?)?);
    }
    match verdict {
        Verdict::Good if tried.len() == Plug::ALL.len() => {
            writeln!(out, "the wiring is good: all outputs and inputs work")?;
        }
        Verdict::Good => writeln!(out, "good so far; the other positions of the plug were not tried")?,
        Verdict::One(faults) => {
            for (i, fault) in faults.iter().enumerate() {
                writeln!(out, "{}{fault}", if i > 0 { "or: " } else { "" })?;
            }
        }
        Verdict::Several(astray) => {
            writeln!(out, "more than one fault:")?;
            for astray in astray {
                writeln!(out, "  {astray}")?;
            }
        }
    }
    Ok(())
}

fn walk(query: &mut Query<'_>) -> Result<()> {
    let (lines, _) = query.lines(PATIENCE)?;
    // Inputs rest high; a device that is switched on at the other end holds one of them low.
    if lines.high(Lines::POWER) && lines.0 & 0x1f != 0x1f {
        bail!("a device that is switched on is connected; take the cable off the printer first");
    }
    say_on_interrupt("the lines stay as they are until the next job begins");
    let mut out = stdout();
    writeln!(out, "at rest: nStrobe, nAutoFd, nInit high; nSelectIn and the data lines low")?;
    for (bit, line) in OUTPUTS.iter().enumerate() {
        let levels = Levels(Levels::REST.0 ^ 1 << bit);
        probe(query, levels)?;
        let level = if levels.0 >> bit & 1 == 1 { "high" } else { "low" };
        writeln!(out, "{line} is {level}, all others at rest")?;
        out.flush()?;
        sleep(HOLD);
    }
    probe(query, Levels::REST)?;
    writeln!(out, "all lines at rest again")?;
    Ok(())
}
