//! The plan of a job, in numbers for programs and in words for the person who loads the cartridges.

use std::fmt::{self, Write as _};

use inks::Library;
use serde::Serialize;

use super::placement::size_mm;
use crate::halftone::Placement;
use crate::separate::{Check, Separation};
use crate::sheet::Sheet;
use crate::sheet::colours::colours;

/// What will be printed, from what, and what to think of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Name of the document.
    pub document: String,
    /// Name of the paper.
    pub paper: &'static str,
    /// Width and height of the document on paper in millimetres.
    pub size_mm: (f64, f64),
    /// The same in dots of 1/600 inch.
    pub size_dots: (u16, u16),
    /// Where its corner lies in the printable area, in dots.
    pub origin_dots: (u16, u16),
    /// The cartridges to load, in the order of first use.
    pub cartridges: Vec<Cartridge>,
    /// The passes, first printed (lowest) first.
    pub passes: Vec<Pass>,
    /// The stacks in use, most dots first; shares are of the document's dots.
    pub stacks: Vec<Share>,
    /// What the machine's rules say of the job.
    pub checks: Vec<Check>,
}

/// A cartridge to load.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cartridge {
    /// Name of the ink.
    pub ink: &'static str,
    /// What owners call it.
    pub sold_as: String,
    /// The vendor's part number.
    pub part: &'static str,
    /// The barcode on it.
    pub barcode: u8,
}

/// A pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pass {
    /// Number, from 1.
    pub number: usize,
    /// Name of the ink.
    pub ink: &'static str,
    /// Dots with ink.
    pub dots: u64,
    /// Dots as a share of the document's.
    pub share: f64,
}

/// A stack and how much of the document it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The stack, short names from the bottom.
    pub stack: String,
    /// The same in the words of the boxes.
    pub words: String,
    /// Its false colour in the separation picture, sRGB as `#rrggbb`.
    pub colour: String,
    /// Dots.
    pub dots: u64,
    /// Dots as a share of the document's.
    pub share: f64,
}

impl Plan {
    /// The plan of a separated sheet.
    pub fn new(
        document: &str,
        sheet: &Sheet,
        placement: &Placement,
        separation: &Separation,
        library: &Library,
    ) -> Plan {
        let area = u64::from(placement.width) * u64::from(placement.height);
        let share = |dots: u64| dots as f64 / area as f64;
        let outside = sheet.index().len() as u64 - area;
        let mut stacks: Vec<Share> = sheet
            .stacks()
            .iter()
            .zip(sheet.census())
            .zip(colours(sheet.stacks()))
            .enumerate()
            .map(|(i, ((stack, dots), [r, g, b]))| {
                let dots = if i == 0 { dots.saturating_sub(outside) } else { dots };
                Share {
                    stack: stack.to_string(),
                    words: library.words(stack),
                    colour: format!("#{r:02x}{g:02x}{b:02x}"),
                    dots,
                    share: share(dots),
                }
            })
            .filter(|stack| stack.dots > 0)
            .collect();
        stacks.sort_by_key(|stack| std::cmp::Reverse(stack.dots));
        let cartridge = |&ink: &protocol::ink::Ink| Cartridge {
            ink: ink.name(),
            sold_as: library.cartridge(ink).map_or_else(|| ink.name().into(), |c| c.okidata.clone()),
            part: ink.part(),
            barcode: ink.barcode(),
        };
        Plan {
            document: document.into(),
            paper: placement.paper.name(),
            size_mm: size_mm(placement),
            size_dots: (placement.width, placement.height),
            origin_dots: (placement.x, placement.y),
            cartridges: separation.plan.cartridges.iter().map(cartridge).collect(),
            passes: (1..)
                .zip(&separation.plan.passes)
                .map(|(number, pass)| Pass {
                    number,
                    ink: pass.ink.name(),
                    dots: pass.dots,
                    share: share(pass.dots),
                })
                .collect(),
            stacks,
            checks: separation.checks.clone(),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size_mm;
        writeln!(
            f,
            "{}: {width:.1} x {height:.1} mm ({} x {} dots) on {}",
            self.document, self.size_dots.0, self.size_dots.1, self.paper
        )?;
        writeln!(f, "\nLoad {} cartridge{}:", self.cartridges.len(), plural(self.cartridges.len()))?;
        for cartridge in &self.cartridges {
            writeln!(f, "    {:<22} {}, barcode {}", cartridge.sold_as, cartridge.part, cartridge.barcode)?;
        }
        writeln!(
            f,
            "\n{} pass{} over the sheet, in this order:",
            self.passes.len(),
            if self.passes.len() == 1 { "" } else { "es" }
        )?;
        for pass in &self.passes {
            writeln!(
                f,
                "    {}  {:<18} {:>13} dots  {:>5.1} %",
                pass.number,
                pass.ink,
                grouped(pass.dots),
                100.0 * pass.share
            )?;
        }
        writeln!(f, "\nThe document's dots are:")?;
        // Sorted, so that what would read 0.0 % stands together at the end.
        let shown = self.stacks.partition_point(|stack| stack.share >= 0.0005);
        for stack in &self.stacks[..shown] {
            writeln!(f, "    {:>5.1} %  {:<12} {}", 100.0 * stack.share, stack.stack, stack.words)?;
        }
        let rest = &self.stacks[shown..];
        if !rest.is_empty() {
            let share: f64 = rest.iter().map(|stack| stack.share).sum();
            writeln!(f, "    {:>5.1} %  {} other{}", 100.0 * share, rest.len(), plural(rest.len()))?;
        }
        if !self.checks.is_empty() {
            writeln!(f, "\nBefore you print:")?;
            for check in &self.checks {
                writeln!(f, "    {check}")?;
            }
        }
        Ok(())
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// A number with its thousands apart.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        // Writing to a string does not fail.
        let _ = write!(text, "{digit}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::grouped;

    #[test]
    fn thousands_stand_apart() {
        assert_eq!(["0", "999", "1 000", "30 585 600"], [0, 999, 1000, 30_585_600].map(grouped)[..]);
    }
}
