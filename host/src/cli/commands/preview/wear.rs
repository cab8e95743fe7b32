//! Options of `preview` for a worn printer and for light inside the paper.

use std::io::Write;
use std::str::FromStr;

use anyhow::{Result, bail};
use clap::Args;
use inks::Library;
use press::layout::Mm;
use press::preview::{Wear, Worn};
use serde_json::{Value, json};
use sheet::DotMap;

/// The largest root mean square shift, in millimetres: beyond it there is no print to look at.
const MOST_SHIFT: f64 = 10.0;
/// The largest root mean square feed error, in per cent.
const MOST_FEED: f64 = 10.0;

/// A share in per cent.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Percent(f64);

impl FromStr for Percent {
    type Err = String;

    fn from_str(text: &str) -> Result<Percent, String> {
        let number = text.trim().strip_suffix('%').unwrap_or(text).trim();
        match number.parse() {
            Ok(percent) if (0.0..=100.0).contains(&percent) => Ok(Percent(percent)),
            _ => Err("expected a share from 0 to 100 %, such as 2%".into()),
        }
    }
}

fn shift(text: &str) -> Result<Mm, String> {
    match text.parse::<Mm>() {
        Ok(mm) if (0.0..=MOST_SHIFT).contains(&mm.0) => Ok(mm),
        Ok(_) => Err(format!("expected a length from 0 to {MOST_SHIFT} mm, such as 0.05mm")),
        Err(error) => Err(error.to_string()),
    }
}

fn feed(text: &str) -> Result<Percent, String> {
    match text.parse::<Percent>() {
        Ok(percent) if percent.0 <= MOST_FEED => Ok(percent),
        _ => Err(format!("expected a share from 0 to {MOST_FEED} %, such as 0.05%")),
    }
}

fn gain(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(n) if view::DOT_GAIN.contains(&n) => Ok(n),
        _ => {
            let (low, high) = (view::DOT_GAIN.start(), view::DOT_GAIN.end());
            Err(format!("expected a number n from {low} to {high}, such as 1.7"))
        }
    }
}

/// What a printer and paper do to the dots.
#[derive(Args, Debug)]
pub struct WearArgs {
    /// Shift every pass across and along by random lengths of this root mean square, such as 0.05mm
    #[arg(long, value_name = "LENGTH", value_parser = shift)]
    registration_error: Option<Mm>,
    /// Feed every pass too far or too little by random shares of this root mean square, such as 0.05%
    #[arg(long, value_name = "PERCENT", value_parser = feed)]
    feed_error: Option<Percent>,
    /// Leave out this share of the dots of every pass at random, such as 2%
    #[arg(long, value_name = "PERCENT")]
    missing_dots: Option<Percent>,
    /// Choose among printers that are worn alike
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    wear_seed: u64,
    /// Darken halftones by light that spreads inside the paper: n of the Yule-Nielsen model, 1 (none) to 10; a model, not a
    /// measurement; not for a page
    #[arg(long, value_name = "N", value_parser = gain)]
    pub dot_gain: Option<f64>,
}

/// What became of the dots, to be told.
pub struct Told {
    worn: Worn,
    /// Whether passes may have moved.
    moved: bool,
    /// Dots on stacks that neither plan nor library has.
    unlisted: u64,
    /// Of these, dots on stacks of which only the upper layers are known.
    topmost: u64,
}

impl WearArgs {
    fn wear(&self) -> Wear {
        let share = |percent: Option<Percent>| percent.map_or(0.0, |percent| percent.0 / 100.0);
        Wear {
            registration: self.registration_error.map_or(0.0, |mm| mm.0),
            feed: share(self.feed_error),
            missing: share(self.missing_dots),
            seed: self.wear_seed,
        }
    }

    /// Refuses what would change nothing: the options act on printed dots.
    pub fn check(&self, shows_print: bool, page: bool) -> Result<()> {
        if page && self.dot_gain.is_some() {
            bail!("--dot-gain: a page cannot show it; write a picture (.png or .exr) or a .glb");
        }
        if !shows_print && (!self.wear().is_none() || self.dot_gain.is_some()) {
            bail!(
                "--show: --registration-error, --feed-error, --missing-dots and --dot-gain act on printed dots; leave \
                 --show out, or take --show printed"
            );
        }
        Ok(())
    }

    /// The dots as this printer prints them.
    pub fn apply(&self, dots: &mut DotMap, library: &Library) -> Result<Option<Told>> {
        let wear = self.wear();
        if wear.is_none() {
            return Ok(None);
        }
        let worn = wear.print(dots)?;
        let counted = |is: &dyn Fn(&inks::Stack) -> bool| {
            let census = worn.dots.census();
            worn.dots
                .stacks()
                .iter()
                .zip(census)
                .filter(|(stack, _)| is(stack))
                .map(|(_, dots)| dots)
                .sum::<u64>()
        };
        let new = |stack: &inks::Stack| !dots.stacks().contains(stack) && library.entry(stack).is_none();
        let unlisted = counted(&new);
        let topmost = counted(&|stack| new(stack) && library.curve_of(stack, &[0.0]).is_none());
        *dots = worn.dots.clone();
        Ok(Some(Told { worn, moved: wear.registration > 0.0 || wear.feed > 0.0, unlisted, topmost }))
    }
}

impl Told {
    /// A line for what a page says about itself.
    pub fn brief(&self) -> String {
        format!("on a worn printer: {} of the inked dots changed", self.changed())
    }

    fn changed(&self) -> String {
        percent(self.worn.changed, self.worn.planned)
    }

    /// Where the passes fell, and what that did.
    pub fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        // Dots alone may be missing.
        for moved in self.worn.passes.iter().filter(|_| self.moved) {
            let [right, down] = moved.millimetres();
            let place = |v: f64, more: &str, less: &str| {
                format!("{:.2} mm {}", v.abs(), if v < 0.0 { less } else { more })
            };
            write!(
                out,
                "{}: {}, {}",
                moved.ink.name(),
                place(right, "right", "left"),
                place(down, "down", "up")
            )?;
            if moved.feed != 0.0 {
                write!(out, ", fed {:+.3} %", 100.0 * moved.feed)?;
            }
            writeln!(out)?;
        }
        writeln!(out, "dots whose stack is not as planned: {} of the inked ones", self.changed())?;
        if self.unlisted > 0 {
            let of = |dots| percent(dots, self.worn.planned);
            write!(out, "dots on stacks that neither plan nor library has: {}", of(self.unlisted))?;
            match self.topmost {
                0 => writeln!(out, " (computed by the layer model)")?,
                top if top == self.unlisted => {
                    writeln!(out, " (shown as their topmost part that the library has)")?
                }
                top => {
                    writeln!(out, " (computed by the layer model, but {} as their topmost part)", of(top))?
                }
            }
        }
        if self.worn.merged > 0 {
            let merged = percent(self.worn.merged, self.worn.planned);
            writeln!(out, "dots on one of more than 256 stacks, shown as a similar one: {merged}")?;
        }
        Ok(())
    }

    /// The same for programs.
    pub fn json(&self) -> Value {
        let passes = self.worn.passes.iter().map(|moved| {
            let [right, down] = moved.millimetres();
            json!({ "ink": moved.ink.name(), "right_mm": right, "down_mm": down, "feed": moved.feed })
        });
        json!({
            "passes": passes.collect::<Vec<_>>(), "planned_dots": self.worn.planned, "changed_dots": self.worn.changed,
            "unlisted_dots": self.unlisted, "topmost_dots": self.topmost, "merged_dots": self.worn.merged,
        })
    }
}

fn percent(part: u64, whole: u64) -> String {
    format!("{:.1} %", 100.0 * part as f64 / whole.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_lengths_are_read_or_refused_with_what_is_expected() {
        assert_eq!("2%".parse::<Percent>().unwrap(), Percent(2.0));
        assert_eq!("0.5".parse::<Percent>().unwrap(), Percent(0.5));
        for text in ["", "%", "-1", "101%", "NaN", "2%%", "inf"] {
            assert!(text.parse::<Percent>().unwrap_err().contains("such as 2%"), "{text}");
        }
        assert_eq!(shift("0.05mm").unwrap(), Mm(0.05));
        for text in ["0.05", "-1mm", "2cm", "x"] {
            assert!(shift(text).unwrap_err().contains("mm"), "{text}");
        }
        assert!(feed("11%").is_err() && feed("0.1%").is_ok());
        for text in ["0.5", "11", "NaN", "n"] {
            assert!(gain(text).unwrap_err().contains("from 1 to 10"), "{text}");
        }
    }
}
