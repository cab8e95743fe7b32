//! What clients ask for: one function for each operation. The attributes of jobs are in `operations/about.rs`.
//!
//! Method: a request that has a document is judged before the document is read ([`begin`]); when it is on disk the job is answered for
//! ([`arrived`]). All others are answered at once ([`answer`]).
//! Who may ask for what is one table ([`access`](crate::access)).
//! Limits: one document for a job.
//! Source: RFC 8011, section 4; PWG 5100.7, 5100.11 and 5100.14.

mod about;

use std::path::{Path, PathBuf};

use ipp::model::{DelimiterTag, StatusCode};
use ipp::value::IppValue;

pub use self::about::state;
use self::about::{TEMPLATE, Wanted, attributes};
use crate::access::{Asker, Permit, Says, Who, who};
use crate::jobs::{Job, Owner, State};
use crate::printer;
use crate::server::{ChangeError, Preset, Server};
use crate::spool::{KINDS, Kind, Packing, SpoolError};
use crate::template::Ticket;
use crate::values::{each, keyword, read_text};
use crate::wire::{Operation, Place, Request, Response};
use files::durable;

/// What is to be done with the document behind a request.
pub struct Incoming {
    /// The job it belongs to.
    pub job: u32,
    /// How it is packed.
    pub packing: Packing,
    /// Whether the job is complete with it.
    pub is_last: bool,
    /// Whether the job was made for this document, and goes if it does not arrive.
    is_own: bool,
    /// What of the request is not possible here.
    unsupported: Vec<(String, IppValue)>,
}

/// The longest words of somebody who wants to see the printer.
const LONGEST_WORDS: usize = 80;

fn status(request: &Request, status: StatusCode, words: &str) -> Response {
    Response::new(&request.header, status).saying(words)
}

fn failed(server: &Server, request: &Request, error: &ChangeError) -> Response {
    let code = match error {
        ChangeError::NoJob => StatusCode::ClientErrorNotFound,
        ChangeError::State(_) | ChangeError::Stale => StatusCode::ClientErrorNotPossible,
        ChangeError::Share(_) => StatusCode::ServerErrorBusy,
        ChangeError::Sheet | ChangeError::Value(_) => StatusCode::ClientErrorAttributesOrValuesNotSupported,
        ChangeError::Store(_) | ChangeError::Disk(_) if durable::is_full(error) => {
            StatusCode::ServerErrorTemporaryError
        }
        ChangeError::Store(_) | ChangeError::Disk(_) => StatusCode::ServerErrorInternalError,
    };
    status(request, code, &server.without_places(&observe::with_causes(error)))
}

fn operation(request: &Request) -> Option<Operation> {
    Operation::of(request.header.operation_or_status)
}

/// Whether a request may have a document behind it.
pub fn takes_document(request: &Request) -> bool {
    matches!(operation(request), Some(Operation::PrintJob | Operation::SendDocument))
}

/// The last part of the address a request is about, which must be a printer's or a job's here.
fn target<'a>(
    server: &'a Server,
    place: &Place,
    request: &Request,
) -> Result<(&'a Preset, Option<u32>), Response> {
    let bad = |words: &str| status(request, StatusCode::ClientErrorBadRequest, words);
    let printer = request.operation("printer-uri").and_then(read_text);
    let job = request.operation("job-uri").and_then(read_text);
    let id = match request.operation("job-id") {
        Some(IppValue::Integer(id)) => Some(u32::try_from(*id).unwrap_or(0)),
        Some(_) => return Err(bad("the job's number is of another kind")),
        None => None,
    };
    let path = |address: &str| -> Option<String> {
        let rest = address.split_once("://")?.1;
        Some(rest.split_once('/').map_or("", |(_, path)| path).trim_matches('/').to_owned())
    };
    let (path, id) = match (printer, job) {
        (Some(printer), _) => (path(&printer), id),
        (None, Some(job)) => {
            let found = path(&job).and_then(|path| {
                let (printer, id) = path.rsplit_once('/')?;
                Some((printer.to_owned(), id.parse().ok()?))
            });
            match found {
                Some((printer, id)) => (Some(printer), Some(id)),
                None => return Err(bad("the address of the job is none")),
            }
        }
        (None, None) => return Err(bad("the request names no printer")),
    };
    let missing = || status(request, StatusCode::ClientErrorNotFound, "there is no such printer");
    let name = match path.as_deref() {
        // Some clients call a printer by its host alone.
        Some("" | "ipp" | "ipp/print") => place.printer.as_str(),
        Some(path) => path.strip_prefix("ipp/print/").ok_or_else(missing)?,
        None => return Err(bad("the address of the printer is none")),
    };
    Ok((server.printer(name).ok_or_else(missing)?, id))
}

fn job_of(server: &Server, place: &Place, request: &Request) -> Result<u32, Response> {
    let (_, id) = target(server, place, request)?;
    let id =
        id.ok_or_else(|| status(request, StatusCode::ClientErrorBadRequest, "the request names no job"))?;
    match server.data().jobs.contains_key(&id) {
        true => Ok(id),
        false => Err(status(request, StatusCode::ClientErrorNotFound, "there is no such job")),
    }
}

/// Who asks.
fn asker(place: &Place, request: &Request) -> Asker {
    let named = request.operation("requesting-user-name").and_then(read_text);
    let says = Says::Name(named.unwrap_or_else(|| "anonymous".into()));
    Asker { from: place.from, is_keeper: place.is_keeper, says }
}

/// Whose job it is that a request makes.
fn owner(place: &Place, request: &Request) -> Owner {
    let Asker { from, says, .. } = asker(place, request);
    let user = if let Says::Name(user) = says { user } else { String::new() };
    Owner { user, from: Some(from), key: None }
}

/// Lets whoever asks do what they ask for.
fn permitted(
    server: &Server,
    place: &Place,
    request: &Request,
    operation: Operation,
) -> Result<Permit<Operation>, Response> {
    let is_about_job = who(operation.into()) == Who::Owner || operation == Operation::GetJobAttributes;
    let job = if is_about_job { Some(job_of(server, place, request)?) } else { None };
    let asker = asker(place, request);
    server
        .permit(operation, &asker, job)
        .map_err(|refused| status(request, StatusCode::ClientErrorNotAuthorized, &refused.to_string()))
}

/// A ticket, and what of the request is not possible.
fn ticket(request: &Request) -> Result<(Ticket, Vec<(String, IppValue)>), Response> {
    let (mut ticket, mut unsupported) = (Ticket::default(), Vec::new());
    for attribute in request.job() {
        if !ticket.take(attribute.name(), attribute.value()) {
            unsupported.push((attribute.name().to_string(), attribute.value().clone()));
        }
    }
    let must = matches!(request.operation("ipp-attribute-fidelity"), Some(IppValue::Boolean(true)));
    ticket.must_fit = must;
    if must && !unsupported.is_empty() {
        let code = StatusCode::ClientErrorAttributesOrValuesNotSupported;
        let mut response = status(request, code, "not every attribute is possible");
        add_unsupported(&mut response, &unsupported);
        return Err(response);
    }
    Ok((ticket, unsupported))
}

fn add_unsupported(response: &mut Response, unsupported: &[(String, IppValue)]) {
    for (name, value) in unsupported {
        response.add(DelimiterTag::UnsupportedAttributes, name, value.clone());
    }
}

/// How the document is packed, if it is of a kind that is printed.
fn document(request: &Request) -> Result<Packing, Response> {
    let format = request.operation("document-format").and_then(read_text);
    let is_known =
        |format: &str| format == "application/octet-stream" || KINDS.iter().any(|kind| kind.mime == format);
    if let Some(format) = format.filter(|format| !is_known(&format.to_ascii_lowercase())) {
        let code = StatusCode::ClientErrorDocumentFormatNotSupported;
        let mut response = status(request, code, "documents of this type are not printed");
        response.add(DelimiterTag::UnsupportedAttributes, "document-format", crate::values::mime(&format));
        return Err(response);
    }
    match request.operation("compression").and_then(read_text).as_deref() {
        None | Some("none") => Ok(Packing::None),
        Some("deflate") => Ok(Packing::Deflate),
        Some("gzip") => Ok(Packing::Gzip),
        Some(other) => {
            let code = StatusCode::ClientErrorCompressionNotSupported;
            let mut response = status(request, code, "documents packed like this are not read");
            response.add(DelimiterTag::UnsupportedAttributes, "compression", keyword(other));
            Err(response)
        }
    }
}

fn create(
    server: &Server,
    place: &Place,
    printer: &Preset,
    request: &Request,
    ticket: Ticket,
) -> Result<u32, Response> {
    let named =
        |attribute: &str| request.operation(attribute).and_then(read_text).filter(|name| !name.is_empty());
    let name = named("job-name").or_else(|| named("document-name")).unwrap_or_else(|| "Untitled".into());
    server
        .create(printer, &name, owner(place, request), ticket)
        .map_err(|error| failed(server, request, &error))
}

/// Judges a request that may have a document, before the document is read.
///
/// # Errors
/// The answer of a request that is refused.
pub fn begin(server: &Server, place: &Place, request: &Request) -> Result<Incoming, Response> {
    let packing = document(request)?;
    if operation(request) == Some(Operation::PrintJob) {
        permitted(server, place, request, Operation::PrintJob)?;
        let (printer, _) = target(server, place, request)?;
        let (ticket, unsupported) = ticket(request)?;
        let job = create(server, place, printer, request, ticket)?;
        return Ok(Incoming { job, packing, is_last: true, is_own: true, unsupported });
    }
    let job = permitted(server, place, request, Operation::SendDocument)?.job();
    let is_last = match request.operation("last-document") {
        Some(IppValue::Boolean(last)) => *last,
        _ => {
            let words = "the request does not say whether this is the last document";
            return Err(status(request, StatusCode::ClientErrorBadRequest, words));
        }
    };
    match server.data().jobs.get(&job) {
        Some(Job { state: State::Incoming, .. }) => {
            Ok(Incoming { job, packing, is_last, is_own: false, unsupported: Vec::new() })
        }
        _ => Err(status(request, StatusCode::ClientErrorNotPossible, "the job has its document already")),
    }
}

/// The client has gone in the middle of a document.
pub fn gone(server: &Server, incoming: &Incoming) {
    if incoming.is_own {
        server.forget(incoming.job);
    }
}

/// Answers for a document that has arrived, or not.
pub fn arrived(
    server: &Server,
    place: &Place,
    request: &Request,
    incoming: &Incoming,
    spooled: Result<(PathBuf, Kind, u64), SpoolError>,
) -> Response {
    let id = incoming.job;
    let kept = match spooled {
        // The last of several documents may be none.
        Err(SpoolError::Empty) if !incoming.is_own && incoming.is_last => Ok(()),
        Err(error) => {
            if incoming.is_own {
                server.forget(id);
            }
            let code = match &error {
                SpoolError::TooLarge => StatusCode::ClientErrorRequestEntityTooLong,
                SpoolError::Packing => StatusCode::ClientErrorCompressionError,
                SpoolError::Kind => StatusCode::ClientErrorDocumentFormatNotSupported,
                SpoolError::Empty => StatusCode::ClientErrorBadRequest,
                SpoolError::Share(_) => StatusCode::ServerErrorBusy,
                SpoolError::Disk(error) if durable::is_full(error) => StatusCode::ServerErrorTemporaryError,
                SpoolError::Disk(_) => StatusCode::ServerErrorInternalError,
            };
            return status(request, code, &observe::with_causes(&error));
        }
        Ok((path, kind, octets)) => keep_document(server, id, &path, kind, octets),
    };
    let kept = match incoming.is_last {
        true => kept.and_then(|()| server.arrived(id)),
        false => kept,
    };
    match kept {
        Ok(()) => job_answer(server, place, request, id, &incoming.unsupported),
        Err(error) => failed(server, request, &error),
    }
}

/// A job has this document.
///
/// # Errors
/// It has one already, or it cannot be kept.
pub fn keep_document(
    server: &Server,
    id: u32,
    path: &Path,
    kind: Kind,
    octets: u64,
) -> Result<(), ChangeError> {
    server.change(id, |job| {
        if job.document.is_some() {
            return Err(ChangeError::State("one with a document already"));
        }
        job.document = path.file_name().map(|name| name.to_string_lossy().into_owned());
        (job.format, job.octets) = (kind.mime.into(), octets);
        Ok(())
    })
}

/// The answer to whoever has made a job.
fn job_answer(
    server: &Server,
    place: &Place,
    request: &Request,
    id: u32,
    unsupported: &[(String, IppValue)],
) -> Response {
    let mut response = Response::new(&request.header, StatusCode::SuccessfulOk);
    if !unsupported.is_empty() {
        response.set_status(StatusCode::SuccessfulOkIgnoredOrSubstitutedAttributes);
        add_unsupported(&mut response, unsupported);
    }
    let uuid = server.uuid(&format!("job {id}"));
    let data = server.data();
    if let Some(job) = data.jobs.get(&id) {
        let wanted = ["job-id", "job-uri", "job-uuid", "job-state", "job-state-reasons", "job-state-message"];
        for (name, value) in attributes(server, &data, place, job, &uuid) {
            if wanted.contains(&name) {
                response.add(DelimiterTag::JobAttributes, name, value);
            }
        }
    }
    response
}

/// Answers a request that has no document.
pub fn answer(server: &Server, place: &Place, request: &Request) -> Response {
    match answered(server, place, request) {
        Ok(response) | Err(response) => response,
    }
}

fn answered(server: &Server, place: &Place, request: &Request) -> Result<Response, Response> {
    let ok = || Response::new(&request.header, StatusCode::SuccessfulOk);
    let change =
        |done: Result<(), ChangeError>| done.map(|()| ok()).map_err(|error| failed(server, request, &error));
    let Some(operation) = operation(request) else {
        return Err(status(
            request,
            StatusCode::ServerErrorOperationNotSupported,
            "there is no such operation",
        ));
    };
    let permit = permitted(server, place, request, operation)?;
    match permit.asked() {
        // They have a document, and are answered when it is there.
        Operation::PrintJob | Operation::SendDocument => {
            Err(status(request, StatusCode::ClientErrorBadRequest, "the request has no document"))
        }
        Operation::ValidateJob => {
            target(server, place, request)?;
            document(request)?;
            let (_, unsupported) = ticket(request)?;
            let mut response = ok();
            if !unsupported.is_empty() {
                response.set_status(StatusCode::SuccessfulOkIgnoredOrSubstitutedAttributes);
                add_unsupported(&mut response, &unsupported);
            }
            Ok(response)
        }
        Operation::CreateJob => {
            let (printer, _) = target(server, place, request)?;
            let (ticket, unsupported) = ticket(request)?;
            let id = create(server, place, printer, request, ticket)?;
            Ok(job_answer(server, place, request, id, &unsupported))
        }
        Operation::GetPrinterAttributes => {
            let (printer, _) = target(server, place, request)?;
            let wanted = Wanted::of(request, &["all"]);
            let mut response = ok();
            for (group, name, value) in printer::attributes(server, printer, place) {
                if wanted.has(name, group) {
                    response.add(DelimiterTag::PrinterAttributes, name, value);
                }
            }
            Ok(response)
        }
        Operation::GetJobs => get_jobs(server, place, request),
        Operation::GetJobAttributes => {
            let id = permit.job();
            let wanted = Wanted::of(request, &["all"]);
            let uuid = server.uuid(&format!("job {id}"));
            let (mut response, data) = (ok(), server.data());
            if let Some(job) = data.jobs.get(&id) {
                add_job(&mut response, attributes(server, &data, place, job, &uuid), &wanted);
            }
            Ok(response)
        }
        Operation::CancelJob => change(server.cancel(permit.job())),
        Operation::HoldJob => change(server.hold(permit.job())),
        Operation::ReleaseJob => change(server.release(permit.job())),
        Operation::CloseJob => {
            let id = permit.job();
            let is_open = server.data().jobs.get(&id).is_some_and(|job| job.state == State::Incoming);
            if is_open { change(server.arrived(id)) } else { Ok(ok()) }
        }
        Operation::CancelMyJobs | Operation::CancelJobs => {
            let (printer, _) = target(server, place, request)?;
            let asker = asker(place, request);
            let asked: Option<Vec<u32>> = request.operation("job-ids").map(|ids| {
                let number = |id: &IppValue| match id {
                    IppValue::Integer(id) => u32::try_from(*id).ok(),
                    _ => None,
                };
                each(ids).iter().filter_map(number).collect()
            });
            // This computer may be asked under any name of its user.
            let owns = |job: &Job| match &asker.says {
                Says::Name(user) if asker.is_keeper => job.owner.user == *user,
                _ => asker.owns(&job.owner),
            };
            let theirs =
                |job: &Job| job.printer == printer.name && (operation == Operation::CancelJobs || owns(job));
            let jobs: Vec<u32> = {
                let data = server.data();
                if let Some(asked) = &asked
                    && asked.iter().any(|id| !data.jobs.get(id).is_some_and(theirs))
                {
                    return Err(status(
                        request,
                        StatusCode::ClientErrorNotFound,
                        "not all are jobs of yours",
                    ));
                }
                let open = data.jobs.values().filter(|job| theirs(job) && !job.state.is_over());
                let open = open.map(|job| job.id);
                open.filter(|id| asked.as_ref().is_none_or(|asked| asked.contains(id))).collect()
            };
            for id in jobs {
                // One that has ended meanwhile is over all the same.
                match server.cancel(id) {
                    Err(ChangeError::State(_) | ChangeError::NoJob) | Ok(()) => {}
                    Err(error) => return Err(failed(server, request, &error)),
                }
            }
            Ok(ok())
        }
        Operation::IdentifyPrinter => {
            let (printer, _) = target(server, place, request)?;
            let words = request.operation("message").and_then(read_text).unwrap_or_default();
            match server.identify() {
                true => {
                    let words: String = words.chars().take(LONGEST_WORDS).collect();
                    let said = format!("somebody wants to see the printer {} {words}", printer.name);
                    server.observer.note(said.trim_end());
                    Ok(ok())
                }
                false => Err(status(request, StatusCode::ServerErrorBusy, "it has just been shown")),
            }
        }
    }
}

fn get_jobs(server: &Server, place: &Place, request: &Request) -> Result<Response, Response> {
    let (printer, _) = target(server, place, request)?;
    let wanted = Wanted::of(request, &["job-id", "job-uri"]);
    let is_over = match request.operation("which-jobs").and_then(read_text).as_deref() {
        None | Some("not-completed") => Some(false),
        Some("completed") => Some(true),
        Some("all") => None,
        Some(other) => {
            let code = StatusCode::ClientErrorAttributesOrValuesNotSupported;
            let mut response = status(request, code, "there is no such choice of jobs");
            response.add(DelimiterTag::UnsupportedAttributes, "which-jobs", keyword(other));
            return Err(response);
        }
    };
    let mine = matches!(request.operation("my-jobs"), Some(IppValue::Boolean(true)))
        .then(|| owner(place, request).user);
    let limit = match request.operation("limit") {
        Some(IppValue::Integer(limit)) => usize::try_from(*limit).unwrap_or(usize::MAX),
        _ => usize::MAX,
    };
    let mut response = Response::new(&request.header, StatusCode::SuccessfulOk);
    let fits = |job: &&Job| {
        job.printer == printer.name
            && is_over.is_none_or(|over| job.state.is_over() == over)
            && mine.as_ref().is_none_or(|mine| job.owner.user == *mine)
    };
    let data = server.data();
    let mut jobs: Vec<&Job> = data.jobs.values().filter(fits).collect();
    if is_over == Some(true) {
        // The last to end comes first.
        jobs.sort_by_key(|job| std::cmp::Reverse((job.ended, job.id)));
    }
    for job in jobs.into_iter().take(limit) {
        let uuid = crate::server::identity(&data, &format!("job {}", job.id));
        response.begin(DelimiterTag::JobAttributes);
        add_job(&mut response, attributes(server, &data, place, job, &uuid), &wanted);
    }
    Ok(response)
}

fn add_job(response: &mut Response, attributes: Vec<(&'static str, IppValue)>, wanted: &Wanted) {
    for (name, value) in attributes {
        let group = if TEMPLATE.contains(&name) { "job-template" } else { "job-description" };
        if wanted.has(name, group) {
            response.add(DelimiterTag::JobAttributes, name, value);
        }
    }
}
