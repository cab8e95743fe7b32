//! Reading and checking a library, with the same code for the built-in text and an owner's folder.
//!
//! Findings are collected, so that an owner sees all of them at once; only a file that is not TOML with the expected keys
//! stops the reading early. A library with errors is not returned.

mod curves;
pub(crate) mod fields;

use maths::Maths;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use files::shelf::Shelf;
use protocol::ink::Ink;
use toml::Spanned;

use self::curves::{Listing, ReadCurve};
use self::fields::{parse_stack, provenance, text};
use crate::albedo::{self, Albedo, INCIDENCES};
use crate::format::{DotsOf, DotsTable, FILE_NAME, FORMAT, File, InkTable, MOST_BYTES, MeasuredTable};
use crate::judge;
use crate::library::{Cartridge, Dots, Entry, Library};
use crate::model::{Layer, Listed, Model, Optics, Paper};
use crate::problem::{Findings, Problem};
use crate::provenance::{Figure, Provenance, Trust};
use crate::rule::{Rule, Severity};
use crate::stack::Stack;

/// The most stacks: a sheet numbers them with a byte.
pub(crate) const MOST_STACKS: usize = 256;
/// A measured albedo up to this value is a calibration error; a larger one is not a reflectance.
const CALIBRATION: f64 = 1.05;
/// The largest dot gain, in um: two dots.
const MOST_GAIN: f64 = 85.0;

type Found = (Option<Library>, Vec<Problem>);

/// A library's folder.
#[derive(Clone, Copy)]
pub(crate) struct Folder<'a> {
    /// Where it stands.
    pub shelf: &'a dyn Shelf,
    /// Its path there.
    pub path: &'a Path,
}

/// Reads `library.toml` of a folder, which may be based on the library that `built_in` gives.
pub(crate) fn folder(folder: Folder<'_>, built_in: fn() -> Library) -> Found {
    let file = folder.path.join(FILE_NAME);
    match text(folder.shelf, &file, MOST_BYTES) {
        Ok(text) => parse(&text, &file, Some((folder, built_in))),
        Err(problem) => {
            let problem =
                Problem { file, line: None, field: String::new(), severity: Severity::Error, text: problem };
            (None, vec![problem])
        }
    }
}

/// Reads the text of a library. The library of a folder can have curves and be based on the built-in one; the built-in
/// text itself has no folder.
pub(crate) fn parse(text: &str, file: &Path, folder: Option<(Folder<'_>, fn() -> Library)>) -> Found {
    let mut findings = Findings { text, file: file.to_path_buf(), found: Vec::new() };
    let parsed = match toml::from_str::<File>(text) {
        Ok(parsed) => parsed,
        Err(error) => {
            findings.error(error.span().map(|span| span.start), "", error.message());
            return (None, findings.found);
        }
    };
    if *parsed.format.get_ref() != FORMAT {
        let problem = format!("version {}; expected version {FORMAT}", parsed.format.get_ref());
        findings.error(Some(parsed.format.span().start), "format", problem);
        return (None, findings.found);
    }
    let base = match (&parsed.based_on, folder) {
        (None, _) => None,
        (Some(name), Some((_, built_in))) if name.get_ref() == "built-in" => Some(built_in()),
        (Some(name), _) => {
            let problem = format!("`{}`: expected `built-in`, or no `based_on` at all", name.get_ref());
            findings.error(Some(name.span().start), "based_on", problem);
            return (None, findings.found);
        }
    };
    let library = build(parsed, base, folder.map(|(folder, _)| folder), &mut findings);
    let usable = library.filter(|_| !findings.fatal());
    (usable, findings.found)
}

/// The parts of a library that a text can take from its base or replace.
#[derive(Default)]
struct Parts {
    name: Option<String>,
    about: Option<String>,
    licence: Option<String>,
    paper: Option<Paper>,
    model: Option<Model>,
    layers: [Option<Layer>; Ink::ALL.len()],
    cartridges: Vec<Cartridge>,
    rules: Vec<Rule>,
    stacks: Option<Vec<Stack>>,
}

impl Parts {
    fn from_base(base: Library) -> Parts {
        Parts {
            name: Some(format!("{}, changed", base.name)),
            about: Some("Modelled where it was not measured.".into()),
            // What is based on a library has a licence of its own.
            licence: None,
            paper: Some(base.optics.paper),
            model: Some(base.optics.model),
            layers: base.optics.layers,
            cartridges: base.cartridges,
            rules: base.rules,
            stacks: Some(base.entries.into_iter().map(|entry| entry.stack).collect()),
        }
    }
}

fn missing(findings: &mut Findings, table: &str) {
    findings.error(None, table, "missing; add it, or set `based_on = \"built-in\"`");
}

fn build(
    file: File,
    base: Option<Library>,
    folder: Option<Folder<'_>>,
    findings: &mut Findings,
) -> Option<Library> {
    let mut parts = base.map_or_else(Parts::default, Parts::from_base);
    // Only the figures of this text are checked; those of a base were checked when it was read.
    if let Some(paper) = file.paper {
        ranges("paper", &paper.figures(), findings);
        cluster("paper", &paper.minimum_cluster, findings);
        parts.paper = Some(paper);
    }
    if let Some(model) = file.model {
        ranges("model", &model.figures(), findings);
        parts.model = Some(model);
    }
    parts.name = file.name.or(parts.name);
    parts.about = file.about.or(parts.about);
    parts.licence = file.licence.and_then(|licence| checked_licence(licence, findings));
    let mut seen = Vec::new();
    for table in file.ink {
        let offset = table.span().start;
        ink(table.into_inner(), offset, &mut seen, &mut parts, findings);
    }
    parts.cartridges.sort_by_key(|cartridge| cartridge.ink);
    dots(file.dots, &mut parts, findings);
    merge_rules(file.rule, &mut parts.rules, findings);
    let mut wanted = match (file.stacks, parts.stacks.take()) {
        (Some(texts), _) => listed_stacks(&texts, findings),
        (None, Some(stacks)) => {
            stacks.into_iter().map(|stack| Listing { stack, offset: None, measured: None }).collect()
        }
        (None, None) => {
            missing(findings, "stacks");
            Vec::new()
        }
    };
    measurements(&file.measured, &file.predicted, folder, &mut wanted, findings);
    check_stacks(&wanted, &parts.cartridges, findings);
    finish(parts, wanted, findings)
}

/// The name of a licence: one line of text.
fn checked_licence(licence: Spanned<String>, findings: &mut Findings) -> Option<String> {
    let offset = licence.span().start;
    let licence = licence.into_inner();
    if is_licence(&licence) {
        return Some(licence);
    }
    let problem = "expected the name of a licence in one line, such as `CC0-1.0` or `CC-BY-4.0`";
    findings.error(Some(offset), "licence", problem);
    None
}

/// Whether a text can be the name of a licence.
pub(crate) fn is_licence(text: &str) -> bool {
    (1..=200).contains(&text.trim().len()) && !text.chars().any(char::is_control)
}

/// Reads all measured and predicted curves, and warns about curves in the folder that are not used.
fn measurements(
    measured: &[Spanned<MeasuredTable>],
    predicted: &[Spanned<MeasuredTable>],
    folder: Option<Folder<'_>>,
    wanted: &mut Vec<Listing>,
    findings: &mut Findings,
) {
    let mut named: Vec<String> = Vec::new();
    for (tables, word) in [(measured, "measured"), (predicted, "predicted")] {
        if let Some(beyond) = tables.get(MOST_STACKS) {
            findings.error(Some(beyond.span().start), word, format!("more than {MOST_STACKS}"));
        }
        for table in tables.iter().take(MOST_STACKS) {
            curves::given(table.get_ref(), word, folder, wanted, findings);
        }
        named.extend(tables.iter().map(|table| table.get_ref().curve.get_ref().clone()));
    }
    if let Some(folder) = folder {
        curves::unused(folder, &named, findings);
    }
}

/// Checks that every layer has a cartridge, and the number and the first of the stacks.
fn check_stacks(wanted: &[Listing], cartridges: &[Cartridge], findings: &mut Findings) {
    for want in wanted {
        for ink in want.stack.layers() {
            if !cartridges.iter().any(|cartridge| cartridge.ink == *ink) {
                let problem = format!("contains {}, which has no `[[ink]]`", ink.name());
                findings.error(want.offset, format!("stack {}", want.stack), problem);
            }
        }
    }
    if wanted.first().is_none_or(|first| first.stack != Stack::SUBSTRATE) || wanted.len() > MOST_STACKS {
        let problem =
            format!("{} stacks; expected at most {MOST_STACKS}, with `substrate` first", wanted.len());
        findings.error(None, "stacks", problem);
    }
}

/// Makes the library, if there are no errors so far.
fn finish(parts: Parts, wanted: Vec<Listing>, findings: &mut Findings) -> Option<Library> {
    let Parts { name, about, licence, paper, model, layers, cartridges, rules, .. } = parts;
    let Some(paper) = paper else {
        missing(findings, "paper");
        return None;
    };
    let Some(model) = model else {
        missing(findings, "model");
        return None;
    };
    let optics = Optics { paper, model, layers };
    if findings.fatal() {
        return None;
    }
    let quadratures = albedo::standard();
    let mut entries = Vec::with_capacity(wanted.len());
    for want in wanted {
        let number = entries.len();
        entries.extend(entry(number, want, &optics, &quadratures, &rules, findings));
    }
    judge::filters(&entries, findings);
    Some(Library {
        name: name.unwrap_or_default(),
        about: about.unwrap_or_default(),
        licence,
        optics,
        cartridges,
        rules,
        entries,
        trust: Trust::All,
    })
}

/// The stacks that the file lists, without invalid ones and duplicates.
fn listed_stacks(texts: &[Spanned<String>], findings: &mut Findings) -> Vec<Listing> {
    let mut wanted: Vec<Listing> = Vec::new();
    for text in texts {
        let (offset, field) = (text.span().start, format!("stacks: {}", text.get_ref()));
        if wanted.len() == MOST_STACKS {
            findings.error(Some(offset), "stacks", format!("more than {MOST_STACKS}"));
            break;
        }
        let Some(stack) = parse_stack(text.get_ref(), &field, offset, findings) else { continue };
        if wanted.iter().any(|other| other.stack == stack) {
            findings.error(Some(offset), field, "is listed twice");
        } else {
            wanted.push(Listing { stack, offset: Some(offset), measured: None });
        }
    }
    wanted
}

fn ranges(owner: &str, figures: &[Listed<'_>], findings: &mut Findings) {
    for (name, [least, most], value) in figures {
        if let Some(number) = value.numbers().into_iter().find(|n| !(*least..=*most).contains(n)) {
            let problem = format!("{number} is outside {least} to {most}");
            findings.error(Some(value.offset()), format!("{owner}.{name}"), problem);
        }
    }
}

fn cluster(owner: &str, figure: &Figure<u16>, findings: &mut Findings) {
    if !(1..=1024).contains(&figure.get()) {
        let problem = format!("{} dots; expected 1 to 1024", figure.get());
        findings.error(Some(figure.offset()), format!("{owner}.minimum_cluster"), problem);
    }
}

/// Checks the table of an ink and replaces the one known so far.
fn ink(table: InkTable, offset: usize, seen: &mut Vec<Ink>, parts: &mut Parts, findings: &mut Findings) {
    let ink = table.ink.0;
    let owner = format!("ink {}", ink.name());
    if seen.contains(&ink) {
        findings.error(Some(offset), owner.clone(), "is given twice");
    }
    seen.push(ink);
    // The printer identifies an ink by these; a typo would print with another ribbon.
    let mut same = |field: &str, offset: usize, found: String, expected: String| {
        if found != expected {
            let problem = format!("{found}, but the printer uses {expected}");
            findings.error(Some(offset), format!("{owner}.{field}"), problem);
        }
    };
    let (code, barcode, part) = (&table.code, &table.barcode, &table.part);
    same("code", code.span().start, format!("{:#04x}", code.get_ref()), format!("{:#04x}", ink.code()));
    same("barcode", barcode.span().start, barcode.get_ref().to_string(), ink.barcode().to_string());
    same("part", part.span().start, part.get_ref().clone(), ink.part().into());
    cluster(&owner, &table.minimum_cluster, findings);
    let layer = table.layer.map(|layer| {
        ranges(&owner, &layer.get_ref().figures(), findings);
        if let Layer::Metal(metal) = layer.get_ref()
            && metal.binder_f0.is_some() != metal.binder_alpha.is_some()
        {
            let problem = "binder_f0 and binder_alpha need each other: give both or neither";
            findings.error(Some(layer.span().start), owner.clone(), problem);
        }
        layer.into_inner()
    });
    parts.layers[ink as usize] = layer;
    parts.cartridges.retain(|cartridge| cartridge.ink != ink);
    parts.cartridges.push(Cartridge {
        ink,
        okidata: table.okidata,
        alps: table.alps,
        minimum_cluster: table.minimum_cluster,
        dots: None,
        cautions: table.cautions,
    });
}

/// Dots as measured override what the tables of inks and paper say.
fn dots(tables: Vec<Spanned<DotsTable>>, parts: &mut Parts, findings: &mut Findings) {
    let mut seen: Vec<&str> = Vec::new();
    for table in tables {
        let offset = table.span().start;
        let DotsTable { ink, minimum_cluster, dot_gain_um, by, when, setup } = table.into_inner();
        let of = *ink.get_ref();
        let owner = format!("dots {}", of.name());
        if seen.contains(&of.name()) {
            findings.error(Some(offset), owner.clone(), "are given twice");
        }
        seen.push(of.name());
        provenance(&owner, "measured figure", [&by, &when, &setup], findings);
        let (least, at) = (*minimum_cluster.get_ref(), minimum_cluster.span().start);
        if !(1..=1024).contains(&least) {
            let problem = format!("{least} dots; expected 1 to 1024");
            findings.error(Some(at), format!("{owner}.minimum_cluster"), problem);
        }
        if let Some(gain) = &dot_gain_um
            && !(-MOST_GAIN..=MOST_GAIN).contains(gain.get_ref())
        {
            let problem = format!("{}; expected {} to {MOST_GAIN} um", gain.get_ref(), -MOST_GAIN);
            findings.error(Some(gain.span().start), format!("{owner}.dot_gain_um"), problem);
        }
        let note = format!("measured by {}, {}: {}", by.get_ref(), when.get_ref(), setup.get_ref());
        match of {
            DotsOf::Paper => match &mut parts.paper {
                Some(paper) => paper.minimum_cluster.measured(least, note),
                None => missing(findings, "paper"),
            },
            DotsOf::Ink(ink) => match parts.cartridges.iter_mut().find(|cartridge| cartridge.ink == ink) {
                Some(cartridge) => {
                    cartridge.minimum_cluster.measured(least, note);
                    cartridge.dots = Some(Dots {
                        dot_gain_um: dot_gain_um.map(Spanned::into_inner),
                        by: by.into_inner(),
                        when: when.into_inner(),
                        setup: setup.into_inner(),
                    });
                }
                None => findings.error(Some(offset), owner, "the library has no `[[ink]]` of it"),
            },
        }
    }
}

/// Each rule replaces the one with its name, or is appended.
fn merge_rules(given: Vec<Spanned<Rule>>, rules: &mut Vec<Rule>, findings: &mut Findings) {
    let mut seen: Vec<String> = Vec::new();
    for rule in given {
        let (offset, rule) = (rule.span().start, rule.into_inner());
        if seen.contains(&rule.name) {
            findings.error(Some(offset), format!("rule {}", rule.name), "is given twice");
        }
        seen.push(rule.name.clone());
        match rules.iter_mut().find(|known| known.name == rule.name) {
            Some(known) => *known = rule,
            None => rules.push(rule),
        }
    }
}

/// Angles at which a modelled curve is tabulated: the square-root grid from 0 to 89.6 degrees. Lobes grow as 1 / cos toward
/// 90 degrees, so beyond the grid the last value is used.
pub(crate) fn grid() -> Vec<f64> {
    const STEPS: u32 = 512;
    (0..STEPS).map(|n| FRAC_PI_2 * (f64::from(n) / f64::from(STEPS)).squared()).collect()
}

/// Makes the entry of a stack, with the checks that need its curve.
fn entry(
    number: usize,
    want: Listing,
    optics: &Optics,
    quadratures: &[Albedo],
    rules: &[Rule],
    findings: &mut Findings,
) -> Option<Entry> {
    let Listing { stack, offset, measured } = want;
    let field = format!("stack {stack}");
    let (curve, uncertainty, lobes, provenance) = match measured {
        Some(ReadCurve { curve, uncertainty, provenance, file }) => {
            if provenance.is_measured() {
                judge::curve(&stack, &file, &curve, uncertainty.as_ref(), findings);
            }
            (curve, uncertainty, None, provenance)
        }
        None => match optics.lobes(&stack) {
            Ok(lobes) => {
                let (model, parameters) = (optics.model.name.clone(), optics.parameters(&stack));
                (lobes.curve(&grid()), None, Some(lobes), Provenance::Modelled { model, parameters })
            }
            Err(error) => {
                findings.error(offset, field, error.to_string());
                return None;
            }
        },
    };
    for (quadrature, degrees) in quadratures.iter().zip(INCIDENCES) {
        let albedo = match &lobes {
            Some(lobes) => quadrature.sum(|t| lobes.at(t)),
            None => quadrature.of_curve(&curve),
        };
        let albedo = albedo.into_iter().fold(0.0, f64::max);
        if albedo > 1.0 {
            // The error of the quadrature, 2e-4, is far below the difference between the two cases.
            let severity =
                if albedo <= CALIBRATION && lobes.is_none() { Severity::Warning } else { Severity::Error };
            let problem = format!(
                "reflects {:.1}% of the light that arrives {degrees} degrees from the normal",
                100.0 * albedo
            );
            findings.add(severity, offset, field.clone(), problem);
            break;
        }
    }
    // Stacks of the base library are not listed in this text, so their findings do not concern its owner.
    for rule in rules.iter().filter(|rule| offset.is_some() && rule.broken_by(&stack)) {
        let problem = format!("{} ({}; {})", rule.says, rule.name, rule.certainty);
        findings.add(rule.severity, offset, field.clone(), problem);
    }
    Some(Entry { number, stack, curve, uncertainty, lobes, provenance })
}
