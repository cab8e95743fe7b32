//! What can be known of a job: its attributes, and which of them a client wants to see.
//!
//! Source: RFC 8011, sections 4.3.4 and 5.3; PWG 5100.7.

use ipp::value::IppValue;

use crate::jobs::{Job, State};
use crate::printer;
use crate::server::{Data, Server};
use crate::template::{AUTO, NO_ORIENTATION, keyword_of};
use crate::values::{
    date_time, dpi, each, integer, keyword, keywords, list, long_text, name, now, range, read_text, uri,
};
use crate::wire::{Place, Request};
use queue::messages::Reason;

/// The attributes that a client wants to see.
pub struct Wanted(Vec<String>);

impl Wanted {
    pub fn of(request: &Request, usual: &[&str]) -> Wanted {
        Wanted(match request.operation("requested-attributes") {
            Some(value) => each(value).iter().filter_map(read_text).collect(),
            None => usual.iter().map(ToString::to_string).collect(),
        })
    }

    pub fn has(&self, name: &str, group: &str) -> bool {
        // The table of all sheets is long, and is given to whoever names it.
        let by_group = name != "media-col-database";
        self.0.iter().any(|wanted| wanted == name || by_group && (wanted == "all" || wanted == group))
    }
}

/// What of a job is as its owner wants it.
pub const TEMPLATE: [&str; 12] = [
    "copies",
    "media",
    "media-col",
    "page-ranges",
    "print-quality",
    "print-content-optimize",
    "print-rendering-intent",
    "print-color-mode",
    "print-scaling",
    "orientation-requested",
    "printer-resolution",
    "sides",
];

/// A reason that stops a job, as its own.
fn stops(reason: Reason) -> bool {
    !matches!(reason, Reason::SupplyMissing)
}

/// The state of a job in numbers, and its reasons.
pub fn state(data: &Data, job: &Job) -> (i32, Vec<&'static str>) {
    match job.state {
        State::Incoming => (4, vec!["job-incoming"]),
        State::Held if job.ticket.held => (4, vec!["job-hold-until-specified"]),
        State::Held => (4, vec!["resources-are-not-ready"]),
        State::Processing | State::Pending if job.cancel => (5, vec!["processing-to-stop-point"]),
        State::Pending if data.lacks_sheet(job) => (3, vec!["resources-are-not-ready"]),
        State::Pending => (3, vec!["none"]),
        State::Processing if data.reasons.iter().any(|&reason| stops(reason)) => {
            (6, vec!["printer-stopped", "job-printing"])
        }
        State::Processing if job.sheets.is_none() => (5, vec!["job-transforming"]),
        State::Processing => (5, vec!["job-printing"]),
        State::Canceled => (7, vec!["job-canceled-by-user"]),
        State::Aborted => (8, vec!["aborted-by-system"]),
        State::Completed if job.is_cut => (9, vec!["job-completed-with-warnings"]),
        State::Completed => (9, vec!["job-completed-successfully"]),
    }
}

/// Seconds the printer had been up at a moment; what was before its start is 0.
fn up(server: &Server, moment: Option<u64>) -> IppValue {
    let began = now().saturating_sub(server.started.elapsed().as_secs());
    moment.map_or(IppValue::NoValue, |moment| integer(moment.saturating_sub(began)))
}

/// All that can be known of a job.
pub fn attributes(
    server: &Server,
    data: &Data,
    place: &Place,
    job: &Job,
    uuid: &str,
) -> Vec<(&'static str, IppValue)> {
    let (number, reasons) = state(data, job);
    let date = |moment: Option<u64>| moment.map_or(IppValue::NoValue, date_time);
    let printer = place.printer(&job.printer);
    let sheets = job.sheets.map_or(IppValue::NoValue, integer);
    let before = data.jobs.values().filter(|other| !other.state.is_over() && other.id < job.id).count();
    let ticket = &job.ticket;
    let word = |word: &Option<String>, usual: &str| keyword(word.as_deref().unwrap_or(usual));
    let mut all = vec![
        ("job-id", integer(job.id)),
        ("job-uri", uri(&format!("{printer}/{}", job.id))),
        ("job-uuid", uri(&format!("urn:uuid:{uuid}"))),
        ("job-printer-uri", uri(&printer)),
        ("job-more-info", uri(&place.page(""))),
        ("job-name", name(&job.name)),
        ("job-originating-user-name", name(&job.owner.user)),
        ("job-state", IppValue::Enum(number)),
        ("job-state-reasons", keywords(reasons)),
        ("job-state-message", long_text(&job.message)),
        ("number-of-documents", integer(i32::from(job.document.is_some()))),
        ("document-format-supplied", crate::values::mime(&job.format)),
        ("job-k-octets", integer(job.octets.div_ceil(1024))),
        ("job-impressions", sheets.clone()),
        ("job-impressions-completed", integer(job.done)),
        ("job-media-sheets", sheets),
        ("job-media-sheets-completed", integer(job.done)),
        ("job-printer-up-time", integer(server.started.elapsed().as_secs() + 1)),
        ("time-at-creation", up(server, Some(job.created))),
        ("time-at-processing", up(server, job.begun)),
        ("time-at-completed", up(server, job.ended)),
        ("date-time-at-creation", date(Some(job.created))),
        ("date-time-at-processing", date(job.begun)),
        ("date-time-at-completed", date(job.ended)),
        ("number-of-intervening-jobs", integer(before)),
        ("copies", integer(ticket.copies)),
        ("sides", keyword("one-sided")),
        ("print-quality", IppValue::Enum(ticket.quality.unwrap_or(4))),
        ("print-content-optimize", word(&ticket.content, AUTO)),
        ("print-rendering-intent", word(&ticket.intent, AUTO)),
        ("print-color-mode", word(&ticket.colour, AUTO)),
        ("print-scaling", keyword(ticket.scaling.unwrap_or_default().name())),
        ("printer-resolution", dpi(if ticket.quality == Some(3) { 300 } else { 600 })),
    ];
    if let Some(asked) = ticket.orientation.filter(|asked| *asked != NO_ORIENTATION) {
        all.push(("orientation-requested", IppValue::Enum(asked)));
    }
    let loaded = data.loaded();
    let size = ticket.size.unwrap_or(loaded.size);
    let kind = ticket.kind.as_deref().unwrap_or(&loaded.kind);
    all.push(("media", keyword(&keyword_of(size))));
    all.push(("media-col", printer::media_col(size, Some(kind))));
    if !ticket.pages.is_empty() {
        all.push(("page-ranges", list(ticket.pages.iter().map(|&(from, to)| range(from, to)))));
    }
    if let Some(percent) = data.percent.filter(|_| job.state == State::Processing) {
        all.push(("job-media-progress", integer(percent)));
    }
    all
}
