//! The plan of a job, in numbers for programs and in words for the person who loads the cartridges.
//!
//! Dots and areas are counted; ribbon and time are estimates ([`ribbon`]) and say so wherever they are shown.

use std::fmt::{self, Write as _};

use inks::{Certainty, Library, Severity, own};
use observe::visible_line;
use protocol::ink::{Ink, Kind};
use protocol::paper::{LEFT, Paper};
use protocol::rgl::{Media, Page};
use serde::Serialize;

use super::cost::{self, Cost, Price};
use super::loading;
use super::ribbon::{self, Use};
use super::thin::thin;
use crate::layout::{Cut, Laid, Mm, paper};
use crate::separate::{Check, MOST_CARTRIDGES, Pass as Dots, Planned, Separation};
use sheet::colours::colours;
use sheet::{Area, Plane, Sheet};

/// Lines of foil thinner than this many dots (0.17 mm) may not stick: foil fails on screens finer than about 100 an inch,
/// whose smaller dots are of this size.
const FOIL_LINE: usize = 4;
/// The share of foil in thinner lines that is worth a warning: corners and rounding always have a little.
const FOIL_SHARE: f64 = 0.01;

/// What will be printed, with which cartridges, and what to watch for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Name of the document.
    pub document: String,
    /// Name of the paper.
    pub paper: &'static str,
    /// Width and length of the sheet of paper in millimetres.
    pub sheet_mm: (f64, f64),
    /// The printer's media type.
    pub media: &'static str,
    /// Whether the printer corrects the sheet's curl.
    pub curl_correction: bool,
    /// Dots an inch across and along.
    pub resolution_dpi: (u16, u16),
    /// Width and height of one copy on paper in millimetres.
    pub size_mm: (f64, f64),
    /// The same in dots.
    pub size_dots: (u16, u16),
    /// Top left corner of the first copy in the printable area, in dots.
    pub origin_dots: (u16, u16),
    /// The same from the corner of the sheet of paper, in millimetres.
    pub from_edge_mm: (f64, f64),
    /// Columns and rows of copies on the sheet.
    pub copies: (u16, u16),
    /// Whether the print is mirrored left to right; absent if the bytes of a job are all that is known.
    pub mirrored: Option<bool>,
    /// What the layout cuts off.
    pub cut: Option<Cut>,
    /// The cartridges to load, in the order of first use.
    pub cartridges: Vec<Cartridge>,
    /// What to replace on the way, when there are more than the printer holds.
    pub changes: Vec<Change>,
    /// The passes, first printed (lowest) first.
    pub passes: Vec<Pass>,
    /// What the ribbon costs, an estimate: a sum for each currency. Empty as long as no price is known.
    pub costs_estimated: Vec<Cost>,
    /// Time in seconds, an estimate.
    pub seconds_estimated: f64,
    /// The stacks in use, most dots first; shares are of the copies' dots.
    pub stacks: Vec<Share>,
    /// What the rules say of the job, most severe first.
    pub checks: Vec<Check>,
    /// What the readers of the document or art had to assume, in sentences.
    pub notes: Vec<String>,
    /// How the print will look, in sentences.
    pub look: Vec<String>,
    /// What would improve the print.
    pub suggestions: Vec<Suggestion>,
}

/// Something that would improve the print, if the user says so.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suggestion {
    /// The problem, its reason and its remedy.
    pub text: String,
    /// How to ask for it.
    pub how: String,
    /// Number of dots concerned.
    pub dots: u64,
}

/// A cartridge to load.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cartridge {
    /// Name of the ink.
    pub ink: &'static str,
    /// What owners call it, and inks of their own that the printer takes for it.
    pub sold_as: String,
    /// The vendor's part number.
    pub part: &'static str,
    /// The barcode on it.
    pub barcode: u8,
    /// The first pass with it; the printer pauses before that pass if it is missing.
    pub first_pass: usize,
    /// Ribbon used in all its passes, in millimetres, an estimate.
    pub ribbon_mm_estimated: f64,
    /// What a whole cartridge costs, if the owner has said so.
    pub price: Option<Cost>,
    /// What its ribbon in this job costs, an estimate, if it is also known how much ribbon a cartridge gives.
    pub cost_estimated: Option<Cost>,
}

/// A cartridge to replace in the course of the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// The pass before which the printer pauses and asks, from 1.
    pub before_pass: usize,
    /// The ink of the cartridge to take out.
    pub take_out: &'static str,
    /// The ink of the one to put in.
    pub put_in: &'static str,
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
    /// The share of the copies' dots that has its ink; marks do not count.
    pub share: f64,
    /// Runs of the carriage, ribbon and time, estimates.
    pub estimate: Use,
}

/// A stack and how much of the print it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The stack, short names from the bottom.
    pub stack: String,
    /// The same by the names on the cartridges.
    pub words: String,
    /// Its false colour in the separation picture, sRGB as `#rrggbb`.
    pub colour: String,
    /// Dots.
    pub dots: u64,
    /// Dots as a share of the copies'.
    pub share: f64,
    /// Whether its curve is modelled, and not measured.
    pub modelled: bool,
}

/// What a plan is made from.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// Name of the document.
    pub name: &'a str,
    /// The page.
    pub sheet: &'a Sheet,
    /// Where things are on it.
    pub laid: &'a Laid,
    /// Its passes.
    pub passes: &'a [Dots],
    /// The passes in numbers and the cartridges.
    pub planned: &'a [Planned],
    /// What the rules say.
    pub checks: &'a [Check],
    /// How the page is declared to the printer.
    pub page: &'a Page,
    /// Whether it is mirrored, if that is known.
    pub mirrored: Option<bool>,
}

impl<'a> Subject<'a> {
    /// A separated sheet.
    pub fn new(
        name: &'a str,
        sheet: &'a Sheet,
        laid: &'a Laid,
        separation: &'a Separation,
        page: &'a Page,
        mirrored: bool,
    ) -> Subject<'a> {
        let (planned, checks) = (&separation.plan.passes, &separation.checks);
        let (passes, mirrored) = (&separation.passes, Some(mirrored));
        Subject { name, sheet, laid, passes, planned, checks, page, mirrored }
    }
}

impl Plan {
    /// The plan of a page.
    pub fn new(subject: &Subject<'_>, library: &Library) -> Plan {
        let Subject { sheet, laid, .. } = *subject;
        let paper = subject.page.paper;
        let first = laid.copies.first().copied().unwrap_or(laid.area);
        let area: u64 = laid.copies.iter().map(|copy| (copy.width * copy.length) as u64).sum();
        let share = |dots: u64| dots as f64 / area.max(1) as f64;
        let dpi = subject.page.resolution.dpi();
        let passes: Vec<Pass> = (1..)
            .zip(subject.planned.iter().zip(subject.passes))
            .map(|(number, (planned, dots))| Pass {
                number,
                ink: planned.ink.name(),
                dots: planned.dots,
                share: share(laid.copies.iter().map(|copy| dots.plane.dots_in(copy)).sum()),
                estimate: ribbon::of(&dots.plane, dpi),
            })
            .collect();
        // At 1200 x 600 dpi there are two dots across in 1/600 inch.
        let across = usize::from(subject.page.resolution.across(1)).max(1);
        let mm = |dots: usize| Mm::of_dots(dots as i64).0;
        // Sides of a sheet are u16.
        let dots = |(a, b): (usize, usize)| (a as u16, b as u16);
        Plan {
            document: subject.name.into(),
            paper: paper.name(),
            sheet_mm: paper::sheet_mm(paper),
            media: subject.page.media.name(),
            curl_correction: subject.page.curl_correction,
            resolution_dpi: dpi,
            size_mm: (mm(first.width / across), mm(first.length)),
            size_dots: dots((first.width, first.length)),
            origin_dots: dots((first.left, first.top)),
            from_edge_mm: from_edge(paper, Area { left: first.left / across, ..first }),
            copies: laid.grid,
            mirrored: subject.mirrored,
            cut: laid.cut,
            cartridges: cartridges(subject.planned, &passes, library),
            changes: changes(subject.planned),
            costs_estimated: Vec::new(),
            seconds_estimated: passes.iter().map(|pass| pass.estimate.seconds).sum(),
            passes,
            stacks: shares(sheet, laid, library),
            checks: checks(subject),
            notes: Vec::new(),
            look: Vec::new(),
            suggestions: Vec::new(),
        }
    }

    /// Adds what the ribbon costs.
    pub fn price(&mut self, prices: &[Price]) {
        for cartridge in &mut self.cartridges {
            let Some(price) = prices.iter().find(|price| price.ink == cartridge.ink) else { continue };
            cartridge.price = Some(price.cartridge.clone());
            cartridge.cost_estimated = price.of(cartridge.ribbon_mm_estimated);
        }
        let costs = self.cartridges.iter().filter_map(|cartridge| cartridge.cost_estimated.as_ref());
        self.costs_estimated = cost::sums(costs);
    }

    /// What the ribbon costs, in sentences; empty as long as no price is known.
    pub(super) fn costs(&self) -> Vec<String> {
        let mut said = Vec::new();
        let named = |wanted: fn(&Cartridge) -> bool| -> Vec<&'static str> {
            self.cartridges
                .iter()
                .filter(|cartridge| wanted(cartridge))
                .map(|cartridge| cartridge.ink)
                .collect()
        };
        if !self.costs_estimated.is_empty() {
            let sums: Vec<String> = self.costs_estimated.iter().map(Cost::to_string).collect();
            let counted = named(|cartridge| cartridge.cost_estimated.is_some());
            let mut text = format!("about {} for the ribbon of {}", sums.join(" and "), counted.join(", "));
            let others = named(|cartridge| cartridge.price.is_none());
            if !others.is_empty() {
                text += &format!("; no price is known for {}", others.join(", "));
            }
            said.push(text);
        }
        for cartridge in &self.cartridges {
            if let (Some(price), None) = (&cartridge.price, &cartridge.cost_estimated) {
                said.push(format!(
                    "a cartridge of {} is {price}; how much ribbon one gives is not known yet",
                    cartridge.ink
                ));
            }
        }
        said
    }
}

/// From the corner of the paper to that of an area, in millimetres.
fn from_edge(paper: Paper, area: Area) -> (f64, f64) {
    (
        Mm::of_dots(area.left as i64 + i64::from(LEFT)).0,
        Mm::of_dots(area.top as i64 + i64::from(paper.top())).0,
    )
}

fn cartridges(planned: &[Planned], passes: &[Pass], library: &Library) -> Vec<Cartridge> {
    let mut inks: Vec<Ink> = Vec::new();
    for pass in planned {
        if !inks.contains(&pass.ink) {
            inks.push(pass.ink);
        }
    }
    let cartridge = |ink: Ink| {
        let its = passes.iter().filter(|pass| pass.ink == ink.name());
        Cartridge {
            ink: ink.name(),
            sold_as: own::posing_as(ink).fold(
                library.cartridge(ink).map_or_else(|| ink.name().into(), |c| c.okidata.clone()),
                |names, own| names + " or your " + own,
            ),
            part: ink.part(),
            barcode: ink.barcode(),
            first_pass: its.clone().next().map_or(1, |pass| pass.number),
            ribbon_mm_estimated: its.map(|pass| pass.estimate.ribbon_mm).sum(),
            price: None,
            cost_estimated: None,
        }
    };
    inks.into_iter().map(cartridge).collect()
}

fn changes(planned: &[Planned]) -> Vec<Change> {
    let inks: Vec<Ink> = planned.iter().map(|pass| pass.ink).collect();
    let named = |change: loading::Change| Change {
        before_pass: change.before_pass,
        take_out: change.out.name(),
        put_in: change.wanted.name(),
    };
    loading::loading(&inks).1.into_iter().map(named).collect()
}

/// The stacks on the copies; what marks take is in the passes only.
fn shares(sheet: &Sheet, laid: &Laid, library: &Library) -> Vec<Share> {
    let census = laid.census(sheet);
    let area = census.iter().sum::<u64>().max(1);
    let mut stacks: Vec<Share> = sheet
        .stacks()
        .iter()
        .zip(census)
        .zip(colours(sheet.stacks()))
        .map(|((stack, dots), [r, g, b])| Share {
            stack: stack.to_string(),
            words: library.words(stack),
            colour: format!("#{r:02x}{g:02x}{b:02x}"),
            dots,
            share: dots as f64 / area as f64,
            modelled: !library.modelled([stack]).is_empty(),
        })
        .filter(|stack| stack.dots > 0)
        .collect();
    stacks.sort_by_key(|stack| std::cmp::Reverse(stack.dots));
    stacks
}

/// What of a plane lies within these areas.
fn copies(plane: &Plane, areas: &[Area]) -> Plane {
    let mut copies = Plane { bits: vec![0; plane.bits.len()], ..plane.clone() };
    for area in areas {
        for row in area.top..(area.top + area.length).min(plane.length) {
            let own = row * plane.stride;
            for x in area.left..(area.left + area.width).min(plane.width) {
                copies.bits[own + x / 8] |= plane.bits[own + x / 8] & (0x80 >> (x % 8));
            }
        }
    }
    copies
}

/// The rules' checks and those that only the layout and the planes show, most severe first.
fn checks(subject: &Subject<'_>) -> Vec<Check> {
    let mut checks = subject.checks.to_vec();
    let mut add = |rule: &str, severity, certainty, text| {
        checks.push(Check { rule: rule.into(), severity, certainty, text, stacks: Vec::new() });
    };
    if let Some(cut) = &subject.laid.cut {
        let text = format!("cut off beyond the printable area: {cut}");
        add("cut", Severity::Warning, Certainty::Measured, text);
    }
    if subject.laid.marks_left_out > 0 {
        let text = format!(
            "{} marks have no room in the printable area and were left out; move the print or leave more room around it",
            subject.laid.marks_left_out
        );
        add("marks", Severity::Note, Certainty::Measured, text);
    }
    if subject.page.paper == Paper::Postcard {
        let text = "set the feed lever to M: postcards are fed by hand; moving the lever while a sheet is in the printer ejects it";
        add("lever", Severity::Note, Certainty::Vendor, text.into());
    }
    if subject.page.media == Media::GlossyLabel {
        let text = "use only labels that are sold for thermal transfer";
        add("labels", Severity::Note, Certainty::Vendor, text.into());
    }
    let foils = subject.passes.iter().filter(|pass| pass.ink.kind() == Kind::Foil);
    // What marks have of a foil is no art.
    let art = |pass: &Dots| thin(&copies(&pass.plane, &subject.laid.copies), FOIL_LINE);
    for (pass, (few, all)) in foils.map(|pass| (pass, art(pass))) {
        let share = few as f64 / all.max(1) as f64;
        if share > FOIL_SHARE {
            let text = format!(
                "{:.0} % of {} is in lines or dots thinner than {:.2} mm, which may not stick; make them thicker",
                100.0 * share,
                pass.ink.name(),
                Mm::of_dots(FOIL_LINE as i64).0
            );
            add("foil-thin", Severity::Warning, Certainty::Vendor, text);
        }
    }
    checks.sort_by_key(|check| std::cmp::Reverse(check.severity));
    checks
}

impl Plan {
    /// How the time was estimated.
    pub const TIME_NOTE: &'static str = "an estimate: only short passes have been timed, never a full page";
    /// How the ribbon was estimated.
    pub const RIBBON_NOTE: &'static str = "an estimate, rather low: in each band of 10 mm the ribbon runs from the first dot to the last, however few there are";

    /// The stacks in use whose curves are modelled.
    pub fn modelled(&self) -> Vec<&str> {
        self.stacks.iter().filter(|stack| stack.modelled).map(|stack| &*stack.stack).collect()
    }

    /// That curves are modelled, in a sentence after the words `modelled inks`.
    pub fn modelled_in_words(&self) -> Option<String> {
        let modelled = self.modelled();
        let which = match modelled.len() {
            0 => return None,
            all if all == self.stacks.len() => "these stacks".into(),
            _ => modelled.join(", "),
        };
        Some(format!("no curve of {which} was measured, so pictures and differences are estimates"))
    }

    /// Ribbon of all passes in millimetres, an estimate.
    pub fn ribbon_mm(&self) -> f64 {
        self.passes.iter().map(|pass| pass.estimate.ribbon_mm).sum()
    }

    /// What the readers had to assume, and how the print will look, under headings.
    pub(super) fn said(&self) -> impl Iterator<Item = (&'static str, &Vec<String>)> {
        let all = [("From reading the files", &self.notes), ("How it will look", &self.look)];
        all.into_iter().filter(|(_, sentences)| !sentences.is_empty())
    }

    /// The cartridges to load before the first pass, and those for which the printer has no place then.
    pub fn loaded(&self) -> (&[Cartridge], &[Cartridge]) {
        self.cartridges.split_at(self.cartridges.len().min(MOST_CARTRIDGES))
    }
}

impl fmt::Display for Cartridge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:<22} {}, barcode {:<2}  first used in pass {}",
            self.sold_as, self.part, self.barcode, self.first_pass
        )
    }
}

impl Plan {
    /// What to load, and what to replace on the way.
    fn write_cartridges(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (now, later) = self.loaded();
        writeln!(f, "\nLoad {} cartridge{}:", now.len(), plural(now.len()))?;
        now.iter().try_for_each(|cartridge| writeln!(f, "    {cartridge}"))?;
        if !later.is_empty() {
            writeln!(f, "The printer holds no more. These have no place:")?;
            later.iter().try_for_each(|cartridge| writeln!(f, "    {cartridge}"))?;
            writeln!(f, "It would stop in the middle of the sheet:")?;
            for Change { before_pass, take_out, put_in } in &self.changes {
                writeln!(f, "    before pass {before_pass}: replace {take_out} with {put_in}")?;
            }
        }
        writeln!(
            f,
            "If a cartridge is missing, the printer pauses before that pass and continues once it is loaded."
        )?;
        Ok(())
    }

    /// The passes and what they use.
    fn write_passes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{} pass{} over the sheet, in this order:",
            self.passes.len(),
            if self.passes.len() == 1 { "" } else { "es" }
        )?;
        for pass in &self.passes {
            writeln!(
                f,
                "   {:>2}  {:<18} {:>13} dots  {:>5.1} %   ribbon ~{}",
                pass.number,
                pass.ink,
                grouped(pass.dots),
                100.0 * pass.share,
                ribbon::length(pass.estimate.ribbon_mm)
            )?;
        }
        writeln!(f, "Ribbon: about {} in all ({}).", ribbon::length(self.ribbon_mm()), Plan::RIBBON_NOTE)?;
        for cost in self.costs() {
            writeln!(f, "Cost: {cost}.")?;
        }
        writeln!(f, "Time: about {} ({}).", ribbon::duration(self.seconds_estimated), Plan::TIME_NOTE)?;
        Ok(())
    }

    /// The stacks; what would read 0.0 % is summed up.
    fn write_stacks(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nStacks, by share of the print's dots:")?;
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
        if let Some(words) = self.modelled_in_words() {
            writeln!(f, "Modelled inks: {words}.")?;
        }
        Ok(())
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size_mm;
        writeln!(
            f,
            "{}: {width:.1} x {height:.1} mm ({} x {} dots) on {}",
            visible_line(&self.document),
            self.size_dots.0,
            self.size_dots.1,
            self.paper
        )?;
        let (columns, rows) = self.copies;
        if (columns, rows) != (1, 1) {
            writeln!(f, "{columns} x {rows} copies on the sheet")?;
        }
        writeln!(
            f,
            "top left corner at {:.1} mm, {:.1} mm; media {}, curl correction {}",
            self.from_edge_mm.0,
            self.from_edge_mm.1,
            self.media,
            if self.curl_correction { "on" } else { "off" }
        )?;
        if self.resolution_dpi != (600, 600) {
            writeln!(f, "printed at {} x {} dpi", self.resolution_dpi.0, self.resolution_dpi.1)?;
        }
        if self.mirrored == Some(true) {
            writeln!(f, "mirrored left to right")?;
        }
        self.write_cartridges(f)?;
        self.write_passes(f)?;
        self.write_stacks(f)?;
        if !self.checks.is_empty() {
            writeln!(f, "\nBefore you print:")?;
            for check in &self.checks {
                writeln!(f, "    {check}")?;
            }
        }
        for (heading, sentences) in self.said() {
            writeln!(f, "\n{heading}:")?;
            for sentence in sentences {
                writeln!(f, "    {}", visible_line(sentence))?;
            }
        }
        if !self.suggestions.is_empty() {
            writeln!(f, "\nSuggestions, followed only when you say so:")?;
            for Suggestion { text, how, dots } in &self.suggestions {
                writeln!(f, "    {how:<26} {text} ({} dot{})", grouped(*dots), plural(*dots))?;
            }
        }
        Ok(())
    }
}

pub(super) fn plural(count: impl PartialEq + From<u8>) -> &'static str {
    if count == 1.into() { "" } else { "s" }
}

/// A number with its thousands apart.
pub fn grouped(number: u64) -> String {
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
