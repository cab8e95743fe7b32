//! Bodies of requests and of answers, and what clients may take.
//!
//! Problem: a document may be a gigabyte, and its client slow or gone. Method: a body comes piece by piece,
//! each within its time, and a document goes to disk as it comes, at a least pace.
//! Cost: one piece in memory. Limits: see [`Limits`].

use std::time::{Duration, Instant};

use bytes::Bytes;
use http_body_util::{BodyExt as _, Full};
use hyper::body::Incoming;
use hyper::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue};
use hyper::{Response, StatusCode};
use tokio::task::block_in_place;
use tokio::time::timeout;

use crate::budget::{Exceeded, Places};
use crate::spool::{Kind, Packing, Spool, SpoolError};

/// What clients may take.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Connections at once.
    pub connections: Places,
    /// Time for the whole head of a request, from its first byte on, beside what its bytes take at
    /// [`Limits::pace`]; also the longest rest between two requests.
    pub head: Duration,
    /// Time for each piece of a body.
    pub piece: Duration,
    /// Time for a body beside what its bytes take at [`Limits::pace`].
    pub body: Duration,
    /// The least pace of a body in bytes a second.
    pub pace: u64,
    /// Bytes of a document.
    pub document: u64,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            connections: Places { all: 256, of_one: 32, for_new: 64 },
            head: Duration::from_secs(15),
            piece: Duration::from_secs(30),
            body: Duration::from_secs(60),
            pace: 1024,
            document: queue::filter::LARGEST,
        }
    }
}

/// An answer of this type.
pub fn plain(status: StatusCode, kind: &'static str, body: impl Into<Bytes>) -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::new(body.into()));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    for (name, value) in [
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("referrer-policy", "no-referrer"),
        ("cache-control", "no-store"),
    ] {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.insert(
        CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(
            "default-src 'none'; img-src 'self' data: blob:; style-src 'self'; script-src 'self'; connect-src 'self'; \
             frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
        ),
    );
    response
}

/// An answer in words.
pub fn words(status: StatusCode, text: &str) -> Response<Full<Bytes>> {
    plain(status, "text/plain; charset=utf-8", format!("{text}\n"))
}

/// The next piece of a body; `None` at its end.
///
/// # Errors
/// It does not come in time, or the client is gone.
pub async fn piece(body: &mut Incoming, limits: &Limits) -> Result<Option<Bytes>, Gone> {
    loop {
        match timeout(limits.piece, body.frame()).await {
            Err(_) | Ok(Some(Err(_))) => return Err(Gone),
            Ok(None) => return Ok(None),
            Ok(Some(Ok(frame))) => match frame.into_data() {
                Ok(data) if data.is_empty() => {}
                Ok(data) => return Ok(Some(data)),
                // Trailers are not for us.
                Err(_) => {}
            },
        }
    }
}

/// The client is too slow, or gone.
#[derive(Clone, Copy, Debug)]
pub struct Gone;

/// A document on its way to disk. `room` is told of its unpacked bytes so far, and says whether there is room
/// for them.
///
/// # Errors
/// The client is too slow, or gone.
pub async fn keep(
    body: &mut Incoming,
    first: &[u8],
    (folder, packing): (&std::path::Path, Packing),
    room: &(dyn Fn(u64) -> Result<(), Exceeded> + Sync),
    limits: &Limits,
) -> Result<Result<(std::path::PathBuf, Kind, u64), SpoolError>, Gone> {
    let start = Instant::now();
    let mut spool = match block_in_place(|| Spool::begin(folder, packing, limits.document)) {
        Ok(spool) => spool,
        Err(error) => return Ok(Err(error)),
    };
    let mut came = first.len() as u64;
    let take = |spool: &mut Spool, bytes: &[u8]| {
        block_in_place(|| {
            spool.take(bytes)?;
            room(spool.length()).map_err(SpoolError::Share)
        })
    };
    if let Err(error) = take(&mut spool, first) {
        return Ok(Err(error));
    }
    while let Some(bytes) = piece(body, limits).await? {
        came += bytes.len() as u64;
        if start.elapsed() > limits.body + Duration::from_secs(came / limits.pace) {
            return Err(Gone);
        }
        if let Err(error) = take(&mut spool, &bytes) {
            return Ok(Err(error));
        }
    }
    Ok(block_in_place(|| spool.end()))
}

/// Reads on to the end: a client that is still sending would not see its answer. It has the time that a
/// document has, and may send as much.
pub async fn drain(body: &mut Incoming, limits: &Limits) {
    let (mut came, start) = (0, Instant::now());
    while let Ok(Some(bytes)) = piece(body, limits).await {
        came += bytes.len() as u64;
        if came > limits.document || start.elapsed() > limits.body + Duration::from_secs(came / limits.pace) {
            return;
        }
    }
}
