//! The desk: a page for people, and what it asks for.
//!
//! Method: the page is a few files in the program, and asks for one description of everything every two seconds. A document that is
//! dropped on it becomes a held job; its sheets are drawn, and shown as the simulated printer makes them ([`sheet`]). What is changed
//! there becomes the job's ticket, and it is drawn again. Printing releases the job, whose sheets are there already. Charts go the
//! same way ([`charts`]). What was printed can be printed again.
//! Limits: no file of another machine, so it works without internet.
//! Source: what owners like of LPrint and PAPPL: the loaded sheet is set here, for dialogs can only read it.

pub mod sheet;

use std::fs;
use std::net::IpAddr;
use std::path::PathBuf;

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::{Method, Response, StatusCode};
use observe::{Silent, with_causes};
use serde_json::{Value, json};

use crate::access::{Asker, Asset, Permit, Route};
use crate::body::{Gone, Limits, keep, plain, words};
use crate::budget::{Client, Purpose};
use crate::charts::{self, CHARTS};
use crate::jobs::{Job, Owner, State};
use crate::operations;
use crate::server::{ChangeError, Data, Server, key};
use crate::spool::{Kind, Packing, Spool, SpoolError};
use crate::template::{AUTO, Ticket, keyword_of, label, sheets, size_of};
use crate::values::clean;
use device::ledger::{Ledger, totals};
use make::options::of_attribute;

/// The routes there are.
const ROUTES: [(Method, &str, Route); 22] = [
    (Method::GET, "/", Route::File(Asset::Page)),
    (Method::GET, "/desk.css", Route::File(Asset::Style)),
    (Method::GET, "/icon.png", Route::File(Asset::Icon)),
    (Method::GET, "/desk/desk.js", Route::File(Asset::Desk)),
    (Method::GET, "/desk/ask.js", Route::File(Asset::Ask)),
    (Method::GET, "/desk/sheet.js", Route::File(Asset::Sheet)),
    (Method::GET, "/desk/ticket.js", Route::File(Asset::Ticket)),
    (Method::GET, "/desk/lists.js", Route::File(Asset::Lists)),
    (Method::GET, "/desk.json", Route::State),
    (Method::GET, "/desk/preview.png", Route::Preview),
    (Method::GET, "/desk/picture.png", Route::Picture),
    (Method::POST, "/desk/print", Route::Upload),
    (Method::POST, "/desk/chart", Route::Chart),
    (Method::POST, "/desk/plan", Route::Plan),
    (Method::POST, "/desk/change", Route::Change),
    (Method::POST, "/desk/again", Route::Again),
    (Method::POST, "/desk/release", Route::Release),
    (Method::POST, "/desk/hold", Route::Hold),
    (Method::POST, "/desk/cancel", Route::Cancel),
    (Method::POST, "/desk/lay", Route::Lay),
    (Method::POST, "/desk/load", Route::Load),
    (Method::POST, "/desk/switched", Route::Switched),
];

/// What is asked for by this method at this path.
pub fn route(method: &Method, path: &str) -> Option<Route> {
    let method = if method == Method::HEAD { &Method::GET } else { method };
    ROUTES.into_iter().find(|(by, at, _)| by == method && *at == path).map(|(.., route)| route)
}

/// A file of the page.
fn file(asset: Asset) -> Response<Full<Bytes>> {
    let (kind, text) = match asset {
        Asset::Page => ("text/html; charset=utf-8", include_str!("desk/desk.html")),
        Asset::Style => ("text/css; charset=utf-8", include_str!("desk/desk.css")),
        Asset::Icon => return plain(StatusCode::OK, "image/png", icon()),
        Asset::Desk => (SCRIPT, include_str!("desk/desk.js")),
        Asset::Ask => (SCRIPT, include_str!("desk/ask.js")),
        Asset::Sheet => (SCRIPT, include_str!("desk/sheet.js")),
        Asset::Ticket => (SCRIPT, include_str!("desk/ticket.js")),
        Asset::Lists => (SCRIPT, include_str!("desk/lists.js")),
    };
    plain(StatusCode::OK, kind, text)
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Does what is asked, and shows what there is to see.
pub fn act(server: &Server, permit: &Permit<Route>, query: &str, asker: &Asker) -> Response<Full<Bytes>> {
    let job = permit.job();
    let refused = |why: &str| words(StatusCode::UNPROCESSABLE_ENTITY, &server.without_places(why));
    let told = |done: Result<Value, String>| match done {
        Ok(value) => plain(StatusCode::OK, "application/json", value.to_string()),
        Err(why) => refused(&why),
    };
    let done = match permit.asked() {
        Route::File(asset) => return file(asset),
        Route::State => return told(Ok(describe(server, asker))),
        Route::Preview => {
            return match sheet::view(server, job, query) {
                Ok(picture) => plain(StatusCode::OK, "image/png", picture),
                Err(why) => refused(&why),
            };
        }
        Route::Picture => {
            return match fs::read(server.store.picture(job)) {
                Ok(picture) => plain(StatusCode::OK, "image/png", picture),
                Err(_) => words(StatusCode::NOT_FOUND, "there is no picture of this job"),
            };
        }
        Route::Chart => return told(chart(server, query, asker.from)),
        Route::Plan => {
            let Some(_looks) = server.looks(Client::at(asker.from)) else {
                return words(
                    StatusCode::TOO_MANY_REQUESTS,
                    "another plan of yours is being drawn; wait for it",
                );
            };
            return told(sheet::plan(server, job, query));
        }
        Route::Again => return told(again(server, job, asker.from)),
        // It comes with its body, which `upload` reads.
        Route::Upload => return words(StatusCode::BAD_REQUEST, "the request has no document"),
        Route::Change => change(server, job, query),
        Route::Load => {
            let size = parameter(query, "size").map(|size| size_of(&size).ok_or(ChangeError::Sheet));
            let kind = parameter(query, "kind");
            size.transpose().and_then(|size| server.load((size, kind), number(query, "revision")))
        }
        Route::Switched => server.switched(),
        Route::Lay => server.lay_on_loaded(job),
        Route::Cancel => server.cancel(job),
        Route::Hold => server.hold(job),
        Route::Release => server.release(job),
    };
    match done {
        Ok(()) => words(StatusCode::OK, "done"),
        Err(error) => words(StatusCode::CONFLICT, &server.without_places(&with_causes(&error))),
    }
}

/// Everything that a query says beside the job becomes a change of it.
fn change(server: &Server, job: u32, query: &str) -> Result<(), ChangeError> {
    let names = query.split('&').filter_map(|pair| pair.split_once('=').map(|(name, _)| name));
    let mut changes: Vec<(String, String)> = Vec::new();
    let mut printer = None;
    for name in names {
        let value = parameter(query, name).unwrap_or_default();
        match name {
            "job" => {}
            "printer" => {
                let missing = || ChangeError::Value("there is no such printer".into());
                printer = Some(server.printer(&value).ok_or_else(missing)?);
            }
            name => changes.push((name.into(), value)),
        }
    }
    server.edit(job, printer, &changes)
}

/// A job that was printed becomes another one, which is held.
fn again(server: &Server, job: u32, from: IpAddr) -> Result<Value, String> {
    let owner = owner(from)?;
    let id = server.again(job, owner.clone()).map_err(|error| with_causes(&error))?;
    Ok(made(id, &owner))
}

/// The owner of what comes from the page at this address, with a new key.
fn owner(from: IpAddr) -> Result<Owner, String> {
    let key = key().map_err(|error| error.to_string())?;
    Ok(Owner { user: "desk".into(), from: Some(from), key: Some(key) })
}

/// What a page is told of its new job.
fn made(id: u32, owner: &Owner) -> Value {
    json!({ "job": id, "key": owner.key })
}

/// A document from the page: a job that is held until somebody has seen its plan.
pub async fn upload(
    server: &Server,
    query: &str,
    from: IpAddr,
    body: &mut Incoming,
    limits: &Limits,
) -> Response<Full<Bytes>> {
    let Some(printer) = server.printer(&parameter(query, "printer").unwrap_or_default()) else {
        return words(StatusCode::NOT_FOUND, "there is no such printer");
    };
    let name = parameter(query, "name").unwrap_or_else(|| "Untitled".into());
    let owner = match owner(from) {
        Ok(owner) => owner,
        Err(why) => return words(StatusCode::SERVICE_UNAVAILABLE, &why),
    };
    let created = || server.create(printer, &name, owner.clone(), waiting());
    let id = match tokio::task::block_in_place(created) {
        Ok(id) => id,
        Err(error) => {
            return words(StatusCode::SERVICE_UNAVAILABLE, &server.without_places(&with_causes(&error)));
        }
    };
    let _receives = server.receives(id);
    let (folder, room) = (server.store.folder(id), |octets| server.reserve(id, octets));
    let Ok(kept) = keep(body, &[], (&folder, Packing::None), &room, limits).await else {
        tokio::task::block_in_place(|| server.forget(id));
        let Gone = Gone;
        return words(StatusCode::REQUEST_TIMEOUT, "the document did not come in time");
    };
    tokio::task::block_in_place(|| match held(server, id, kept) {
        Ok(()) => plain(StatusCode::OK, "application/json", made(id, &owner).to_string()),
        Err(why) => words(StatusCode::UNPROCESSABLE_ENTITY, &server.without_places(&why)),
    })
}

/// What the page asks for: to wait.
fn waiting() -> Ticket {
    Ticket { held: true, ..Ticket::default() }
}

/// A job has its document, and waits; one whose document is none is forgotten.
fn held(server: &Server, id: u32, kept: Result<(PathBuf, Kind, u64), SpoolError>) -> Result<(), String> {
    let arrived = kept.map_err(|error| with_causes(&error)).and_then(|(path, kind, octets)| {
        operations::keep_document(server, id, &path, kind, octets)
            .and_then(|()| server.arrived(id))
            .map_err(|error| with_causes(&error))
    });
    if arrived.is_err() {
        server.forget(id);
    }
    arrived
}

/// A chart becomes a job that is held, as a document does.
fn chart(server: &Server, query: &str, from: IpAddr) -> Result<Value, String> {
    let printer =
        server.printer(&parameter(query, "printer").unwrap_or_default()).ok_or("there is no such printer")?;
    let name = parameter(query, "chart").unwrap_or_default();
    let ticket = waiting().on(server.data().loaded());
    let bytes = {
        let _turn = server.drawing.take(Purpose::Look);
        let inks = {
            let data = server.data();
            let loaded = data.cartridges.iter().filter(|found| found.is_loaded);
            charts::inks(loaded.map(|found| found.name.as_str()))
        };
        let choices = ticket.choices(&printer.choices);
        charts::job(&name, &choices, &inks, &server.settings.library, &Silent)
            .map_err(|error| error.to_string())?
    };
    let owner = owner(from)?;
    let id = server
        .create(printer, &format!("chart {name}"), owner.clone(), ticket)
        .map_err(|error| with_causes(&error))?;
    let kept = Spool::begin(&server.store.folder(id), Packing::None, bytes.len() as u64)
        .and_then(|mut spool| spool.take(&bytes).and_then(|()| spool.end()));
    held(server, id, kept).map(|()| made(id, &owner))
}

/// The value of a parameter in an address, [clean].
fn parameter(query: &str, name: &str) -> Option<String> {
    let value = query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))?;
    let mut bytes = Vec::new();
    let mut rest = value.bytes();
    while let Some(byte) = rest.next() {
        let digit =
            |byte: Option<u8>| char::from(byte?).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
        bytes.push(match byte {
            b'+' => b' ',
            b'%' => digit(rest.next())? << 4 | digit(rest.next())?,
            byte => byte,
        });
    }
    Some(clean(&String::from_utf8(bytes).ok()?).chars().take(200).collect())
}

/// A parameter that is a number.
pub fn number(query: &str, name: &str) -> Option<u32> {
    parameter(query, name)?.parse().ok()
}

/// The most jobs that are shown.
const SHOWN: usize = 50;

/// Everything that the page shows.
fn describe(server: &Server, asker: &Asker) -> Value {
    let data = server.data();
    let printers: Vec<Value> = server
        .settings
        .printers
        .iter()
        .map(|printer| json!({ "name": printer.name, "about": printer.about }))
        .collect();
    let sizes: Vec<Value> =
        sheets().map(|(keyword, size)| json!({ "keyword": keyword, "label": label(size) })).collect();
    let types: Vec<Value> = std::iter::once((AUTO, "As the preset says"))
        .chain(of_attribute("media-type").map(|(keyword, value)| (keyword, value.help)))
        .map(|(keyword, label)| json!({ "keyword": keyword, "label": label }))
        .collect();
    let charts = CHARTS.map(|(name, label, look)| json!({ "name": name, "label": label, "look": look }));
    let jobs: Vec<Value> =
        data.jobs.values().rev().take(SHOWN).map(|job| about(server, &data, job, asker)).collect();
    let ribbons = Ledger::of(&server.settings.devices).lines().map_or_else(
        |_| Vec::new(),
        |(lines, _)| {
            let total = |total: device::ledger::Total| json!({ "ink": total.ink, "used_mm": total.ribbon_mm.round() });
            totals(&lines, |_| None).into_iter().map(total).collect::<Vec<Value>>()
        },
    );
    let loaded = data.loaded();
    let wanted = data.reasons.contains(&queue::messages::Reason::SupplyMissing);
    json!({
        "printers": printers,
        "charts": charts,
        "sizes": sizes,
        "types": types,
        "loaded": { "size": keyword_of(loaded.size), "kind": loaded.kind, "revision": data.revision() },
        "await_switch": data.await_switch().count(),
        "is_keeper": asker.is_keeper,
        "drawing": data.drawing.map(|(job, sheets)| json!({ "job": job, "sheets": sheets })),
        "aside": if asker.is_keeper { data.aside.clone() } else { Vec::new() },
        "state": {
            "message": data.said(),
            "reasons": data.keywords(),
            "percent": data.percent,
            "prints": data.current().map(|job| job.id),
            "is_stopped": data.stopped().is_some(),
            "wants_cartridge": wanted,
        },
        "cartridges": data.cartridges,
        "ribbons": ribbons,
        "jobs": jobs,
        "identify": data.identify,
    })
}

fn about(server: &Server, data: &Data, job: &Job, asker: &Asker) -> Value {
    let (state, _) = operations::state(data, job);
    let words = match state {
        3 if data.lacks_sheet(job) => "waits for its sheet",
        3 => "waits",
        4 if job.state == State::Incoming => "arrives",
        4 => "held",
        5 if job.sheets.is_none() => "is drawn",
        5 => "prints",
        6 => "stopped",
        7 => "cancelled",
        8 => "failed",
        _ => "printed",
    };
    let is_mine = asker.is_keeper || asker.owns(&job.owner);
    json!({
        "id": job.id,
        "name": job.name,
        "user": job.owner.user,
        "printer": job.printer,
        "state": words,
        "over": job.state.is_over(),
        "held": job.state == State::Held,
        "waits": job.state == State::Pending,
        "stopped": job.state == State::Held && !job.ticket.held,
        "mine": is_mine,
        "again": is_mine && job.state == State::Completed && server.store.document(job).is_some(),
        "lacks": data.lacks_sheet(job).then(|| sheet_of(data, job)),
        "message": job.message,
        "sheets": job.sheets,
        "done": job.done,
    })
}

/// The sheet that a job is for, as it is loaded.
fn sheet_of(data: &Data, job: &Job) -> Value {
    let loaded = data.loaded();
    let size = job.ticket.size.unwrap_or(loaded.size);
    json!({ "size": keyword_of(size), "kind": job.ticket.kind.as_ref().unwrap_or(&loaded.kind) })
}

/// A sheet with a leaf of foil on it, 128 x 128 pixels.
fn icon() -> Vec<u8> {
    const SIDE: u32 = 128;
    let picture = readers::Pixels::from_fn(SIDE, SIDE, |x, y| {
        let (dx, dy) = (f64::from(x) - 64.0, f64::from(y) - 70.0);
        let leaf = dx.abs() < 26.0 * (1.0 - (dy / 40.0) * (dy / 40.0)).max(0.0);
        match (12..116).contains(&x) && (6..122).contains(&y) {
            true if leaf && dx.abs() > 1.5 => [225, 160, 0],
            true => [250, 250, 246],
            false => [40, 60, 90],
        }
    });
    // Into memory nothing fails.
    picture.png().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn parameters_are_read_as_browsers_write_them() {
        let query = "printer=decal&name=Blatt%20%C3%A4%0A.pdf&job=7";
        assert_eq!(parameter(query, "printer").as_deref(), Some("decal"));
        assert_eq!(parameter(query, "name").as_deref(), Some("Blatt ä .pdf"));
        assert_eq!(number(query, "job"), Some(7));
        assert_eq!((parameter(query, "size"), parameter("name=%zz", "name")), (None, None));
    }

    #[test]
    fn the_icon_is_a_picture() {
        let picture = image::load_from_memory(&icon()).unwrap();
        assert_eq!((picture.width(), picture.height()), (128, 128));
    }

    proptest! {
        #[test]
        fn any_query_is_read(query in ".{0,80}") {
            parameter(&query, "name");
        }
    }
}
