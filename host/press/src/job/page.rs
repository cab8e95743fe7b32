//! The plan as one page to print and lay beside the printer: a single HTML file that loads nothing else.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use readers::Pixels;

use super::plan::{Plan, Suggestion, grouped, plural};
use super::ribbon;
use crate::html::{self, escape};

/// The pictures on the page: what the sheet will look like.
pub struct Pictures {
    /// The whole sheet.
    pub sheet: Pixels<[u8; 3]>,
    /// The printed part of it in each pass, in the order of the plan's passes.
    pub passes: Vec<Pixels<[u8; 3]>>,
}

/// The plan with pictures of the sheet and of each pass, for a sheet of A4 or letter.
///
/// # Errors
/// When a picture cannot be compressed.
pub fn html(plan: &Plan, pictures: &Pictures) -> std::io::Result<String> {
    let encoded = |picture: &Pixels<[u8; 3]>| Ok::<_, std::io::Error>(STANDARD.encode(picture.png()?));
    let sheet = encoded(&pictures.sheet)?;
    let passes: Vec<String> = pictures.passes.iter().map(encoded).collect::<Result<_, _>>()?;
    let mut body = String::new();
    // Writing to a string does not fail.
    let _ = write(plan, &sheet, &passes, &mut body);
    Ok(html::read(&format!("{}: job plan", plan.document), STYLE, &body))
}

const STYLE: &str = "@page{margin:15mm}:root{font:10.5pt/1.35 sans-serif}body{max-width:calc(180mm + 2.4rem)}@media print{body{padding:0}}\
    h1{font-size:16pt;margin:0 0 1mm}h2{font-size:11.5pt;margin:4mm 0 1mm}h2:first-of-type{clear:both}p{margin:1mm 0;max-width:none}\
    table{width:100%}th,td{padding:.6mm 2mm;border-bottom-width:.2mm}th{font-weight:600}img{border:.2mm solid #999}\
    .sheet{float:right;width:52mm;margin:0 0 3mm 5mm}.passes{display:flex;flex-wrap:wrap;gap:3mm}\
    figure{break-inside:avoid}figure img{max-width:41mm;max-height:41mm}figcaption{font-size:8.5pt}\
    .box{display:inline-block;width:3.4mm;height:3.4mm;border:.3mm solid;vertical-align:-.5mm}";

fn write(plan: &Plan, sheet: &str, passes: &[String], page: &mut String) -> std::fmt::Result {
    let name = escape(&plan.document);
    write!(
        page,
        "<img class=\"sheet\" alt=\"the sheet as it is printed\" src=\"data:image/png;base64,{sheet}\">\n<h1>{name}</h1>\n"
    )?;
    let (width, height) = plan.size_mm;
    write!(page, "<p>{width:.1} &times; {height:.1} mm on {}", plan.paper)?;
    if plan.copies != (1, 1) {
        write!(page, ", {} &times; {} copies", plan.copies.0, plan.copies.1)?;
    }
    writeln!(
        page,
        "; top left corner at {:.1} mm, {:.1} mm.{}{}</p>\n\
         <p>Media <b>{}</b>, curl correction <b>{}</b>.</p>\n<p>About <b>{}</b> <small>({})</small></p>",
        plan.from_edge_mm.0,
        plan.from_edge_mm.1,
        match plan.resolution_dpi {
            (600, 600) => String::new(),
            (across, along) => format!(" Printed at {across} &times; {along} dpi."),
        },
        if plan.mirrored == Some(true) { " <b>Mirrored</b> left to right." } else { "" },
        plan.media,
        if plan.curl_correction { "on" } else { "off" },
        ribbon::duration(plan.seconds_estimated),
        Plan::TIME_NOTE
    )?;
    page.push_str(&html::modelled(plan.modelled_in_words().as_deref()));
    write_cartridges(plan, page)?;
    write_passes(plan, passes, page)?;
    write_checks(plan, page)
}

/// What to load, and what to replace on the way.
fn write_cartridges(plan: &Plan, page: &mut String) -> std::fmt::Result {
    writeln!(
        page,
        "<h2>Load</h2>\n<table class=\"cards\"><tr><td></td><th>Cartridge</th><th>Part</th><th class=\"n\">Barcode</th>\
         <th class=\"n\">From pass</th><th class=\"n\">Ribbon*</th></tr>"
    )?;
    let (now, later) = plan.loaded();
    for (place, cartridge) in now.iter().chain(later).enumerate() {
        if place == now.len() {
            writeln!(
                page,
                "<tr><td colspan=\"6\">The printer holds no more; these have no place:</td></tr>"
            )?;
        }
        writeln!(
            page,
            "<tr><td><span class=\"box\"></span></td>\
             <td data-name=\"Cartridge\">{}</td><td data-name=\"Part\">{}</td>\
             <td class=\"n\" data-name=\"Barcode\">{}</td><td class=\"n\" data-name=\"From pass\">{}</td>\
             <td class=\"n\" data-name=\"Ribbon*\">{}</td></tr>",
            escape(&cartridge.sold_as),
            cartridge.part,
            cartridge.barcode,
            cartridge.first_pass,
            ribbon::length(cartridge.ribbon_mm_estimated)
        )?;
    }
    writeln!(page, "</table>")?;
    if !plan.changes.is_empty() {
        writeln!(page, "<p>The printer would stop in the middle of the sheet:</p>\n<ul>")?;
        for change in &plan.changes {
            writeln!(
                page,
                "<li>before pass <b>{}</b>: replace {} with <b>{}</b></li>",
                change.before_pass, change.take_out, change.put_in
            )?;
        }
        writeln!(page, "</ul>")?;
    }
    Ok(())
}

/// The passes, what they use, and what each prints.
fn write_passes(plan: &Plan, pictures: &[String], page: &mut String) -> std::fmt::Result {
    writeln!(
        page,
        "<p><small>If a cartridge is missing, the printer pauses before that pass and continues once it is \
         loaded.</small></p>\n<h2>Passes</h2>\n<table class=\"cards\"><tr><th class=\"n\">#</th><th>Ink</th>\
         <th class=\"n\">Dots</th><th class=\"n\">Cover</th><th class=\"n\">Ribbon*</th></tr>"
    )?;
    for pass in &plan.passes {
        writeln!(
            page,
            "<tr><td class=\"n\" data-name=\"Pass\">{}</td><td data-name=\"Ink\">{}</td>\
             <td class=\"n\" data-name=\"Dots\">{}</td>\
             <td class=\"n\" data-name=\"Cover\">{:.1} %</td><td class=\"n\" data-name=\"Ribbon*\">{}</td></tr>",
            pass.number,
            pass.ink,
            grouped(pass.dots),
            100.0 * pass.share,
            ribbon::length(pass.estimate.ribbon_mm)
        )?;
    }
    writeln!(page, "</table>\n<p><small>* {}.</small></p>", Plan::RIBBON_NOTE)?;
    for cost in plan.costs() {
        writeln!(page, "<p>Cost: {}.</p>", escape(&cost))?;
    }
    writeln!(page, "<div class=\"passes\">")?;
    for (pass, picture) in plan.passes.iter().zip(pictures) {
        let (number, ink) = (pass.number, pass.ink);
        writeln!(
            page,
            "<figure><img alt=\"pass {number}, {ink}\" src=\"data:image/png;base64,{picture}\">\
             <figcaption>{number} {ink}</figcaption></figure>"
        )?;
    }
    writeln!(
        page,
        "</div>\n<p><small>The pictures show the sheet and the printed part of each pass{}.</small></p>",
        if plan.mirrored == Some(true) { ", mirrored as they are printed" } else { "" }
    )?;
    Ok(())
}

/// What the rules say, what the readers had to assume, and what would be better.
fn write_checks(plan: &Plan, page: &mut String) -> std::fmt::Result {
    if !plan.checks.is_empty() {
        writeln!(page, "<h2>Before you print</h2>\n<ul>")?;
        for check in &plan.checks {
            writeln!(page, "<li><b>{}</b>: {}</li>", check.severity, escape(&check.text))?;
        }
        writeln!(page, "</ul>")?;
    }
    for (heading, sentences) in plan.said() {
        writeln!(page, "<h2>{heading}</h2>\n<ul>")?;
        for sentence in sentences {
            writeln!(page, "<li>{}</li>", escape(sentence))?;
        }
        writeln!(page, "</ul>")?;
    }
    if !plan.suggestions.is_empty() {
        writeln!(page, "<h2>Suggestions, followed only when you say so</h2>\n<ul>")?;
        for Suggestion { text, how, dots } in &plan.suggestions {
            let (text, how, count, s) = (escape(text), escape(how), grouped(*dots), plural(*dots));
            writeln!(page, "<li><b>{how}</b>: {text} ({count} dot{s})</li>")?;
        }
        writeln!(page, "</ul>")?;
    }
    Ok(())
}
