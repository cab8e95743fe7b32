//! The sheet at the desk: what a job would print, as the simulated printer makes it of the same bytes.
//!
//! Method: a sheet is printed by the simulator once and kept while somebody looks at it; each view of it is a
//! picture of an area, in some of its inks, on the ground it will lie on. Cost: a sheet takes 4 MB a pass,
//! and a tenth of a second to print; a view a tenth of a second. Limits: one sheet is kept. Pictures are of
//! colours, not of materials.

use make::options::PAGE;
use press::job::ribbon;
use press::layout::paper::sheet_mm;
use press::preview::inks::{Ground, thumbnail};
use protocol::ink::Ink;
use protocol::paper::LEFT;
use queue::backend::Sheets as _;
use serde_json::{Value, json};
use sheet::Area;

use super::parameter;
use crate::jobs::Job;
use crate::making::Making;
use crate::seen::{keep_picture, printed, sheet_without};
use crate::server::Server;
use crate::template::{ORIENTATIONS, Ticket};
use crate::worker;

/// The longest side of a view in pixels.
const LONGEST: usize = 1600;
fn job(server: &Server, id: u32) -> Result<Job, String> {
    Ok(server.data().jobs.get(&id).cloned().ok_or("there is no such job")?)
}

/// What a held job would print: its sheets, and of one of them where its page lies, its passes and what they
/// take.
///
/// # Errors
/// In words: why nothing can be printed.
pub fn plan(server: &Server, id: u32, query: &str) -> Result<Value, String> {
    let sheets = worker::prepare(server, id)?;
    let job = job(server, id)?;
    let page = super::number(query, "page").and_then(|page| usize::try_from(page).ok()).unwrap_or(1);
    let page = page.clamp(1, sheets.count().max(1));
    let printout = printed(&server.seen, &job, page, &sheets)?;
    keep_picture(&server.seen, &server.store, &job, &sheets)?;
    let passes: Vec<Value> = printout
        .passes
        .iter()
        .map(|pass| {
            let took = ribbon::of(&pass.plane, printout.resolution.dpi());
            json!({
                "ink": pass.ink.name(),
                "colour": queue::messages::colour(pass.ink),
                "dots": pass.plane.dots(),
                "ribbon_mm": took.ribbon_mm.round(),
                "seconds": took.seconds.round(),
            })
        })
        .collect();
    let (paper, note) =
        (printout.paper, if job.laid.is_empty() { job.message.clone() } else { job.laid.join("; ") });
    let mm = |dots: u16| 25.4 * f64::from(dots) / 600.0;
    let (width, length) = sheet_mm(paper);
    let lies = job.lies.map(|lies| lies.map(|side| f64::from(side) / 100.0));
    Ok(json!({
        "job": id,
        "name": job.name,
        "sheets": sheets.count(),
        "page": page,
        "passes": passes,
        "note": note,
        "sheet": {
            "mm": [width, length],
            "printable_mm": [mm(LEFT), mm(paper.top()), mm(paper.width()), mm(paper.length())],
            "dots": [paper.width(), paper.length()],
        },
        "lies_mm": lies,
        "is_drawn": job.format != crate::spool::JOB,
        "ticket": ticket(&job),
        "options": options(),
    }))
}

/// What a job asks for, by the names and values that change it.
fn ticket(job: &Job) -> Value {
    let Ticket { scaling, orientation, copies, pages, quality, white_passes, own, wide, .. } = &job.ticket;
    let pages: Vec<String> = pages
        .iter()
        .map(|(from, to)| if from == to { from.to_string() } else { format!("{from}-{to}") })
        .collect();
    let text = |number: Option<String>| number.unwrap_or_default();
    let mut all = json!({
        "printer": job.printer,
        "scaling": if wide.is_some() { "" } else { scaling.unwrap_or_default().name() },
        "orientation": orientation.unwrap_or(ORIENTATIONS[4].0).to_string(),
        "copies": copies.to_string(),
        "pages": pages.join(","),
        "quality": text(quality.map(|quality| quality.to_string())),
        "white-passes": text(white_passes.map(|passes| passes.to_string())),
    });
    for option in PAGE {
        all[option.keyword] = own.get(option.keyword).cloned().unwrap_or_default().into();
    }
    all
}

/// What can be chosen beside that: each option with its values.
fn options() -> Vec<Value> {
    // The sheet is what is loaded, and quality and place have controls of their own.
    let is_elsewhere =
        |keyword: &str| ["MediaType", "cupsPrintQuality", "FoilpressPosition"].contains(&keyword);
    let shown =
        PAGE.iter().filter(|option| option.in_dialog().nth(1).is_some() && !is_elsewhere(option.keyword));
    shown
        .map(|option| {
            let values: Vec<Value> =
                option.in_dialog().map(|value| json!([value.dialog.0, value.dialog.1])).collect();
            json!({ "keyword": option.keyword, "label": option.text, "values": values })
        })
        .collect()
}

/// A picture of an area of a sheet that is drawn.
///
/// # Errors
/// In words: there is no such sheet or area.
pub fn view(server: &Server, id: u32, query: &str) -> Result<Vec<u8>, String> {
    let job = job(server, id)?;
    let number = |name: &str| super::number(query, name).and_then(|number| usize::try_from(number).ok());
    let sheets = Making::of(&server.store.sheets(&job));
    let printout = printed(&server.seen, &job, number("page").unwrap_or(1), &sheets)?;
    let without = parameter(query, "without").unwrap_or_default();
    let without: Vec<Ink> = without.split(',').filter_map(Ink::from_name).collect();
    let ground = parameter(query, "ground").unwrap_or_default();
    let ground = match ground.as_str() {
        "" | "paper" => Ground::default(),
        colour => colour.parse().map_err(|error: press::preview::inks::NoColour| error.to_string())?,
    };
    let (sheet, across) = sheet_without(&printout, &without)?;
    // Dots of 1/600 inch, whatever the job has across.
    let whole = Area { left: 0, top: 0, width: sheet.width() / across, length: sheet.length() };
    let left = number("left").unwrap_or(0).min(whole.width.saturating_sub(1));
    let top = number("top").unwrap_or(0).min(whole.length.saturating_sub(1));
    let side = |name: &str, most: usize| number(name).unwrap_or(most).clamp(1, most);
    let area = Area {
        left: left * across,
        top,
        width: side("width", whole.width - left) * across,
        length: side("length", whole.length - top),
    };
    let longest = number("longest").unwrap_or(LONGEST).clamp(1, LONGEST);
    thumbnail(&sheet, area, across, ground, longest).png().map_err(|error| error.to_string())
}
