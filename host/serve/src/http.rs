//! HTTP: connections with limits, and where each request goes.
//!
//! Problem: a document may be a gigabyte, a client may be slow, hostile or many, and none of this may hinder another one. Method: hyper
//! reads heads and hands on bodies piece by piece; a document goes to disk as it comes. Each connection has its time: for a head, for
//! each piece, and for a document as a whole, which must come at a least pace. One computer has no more than its share of connections.
//! What touches the disk runs where the runtime expects it to block.
//! Cost: a task and two buffers of 64 KB a connection. Limits: see [`Limits`]; HTTP/1.1.
//! Source: RFC 9110 and 9112; RFC 8010, section 4, for IPP over HTTP.

use std::collections::HashMap;
use std::convert::Infallible;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::header::{CONNECTION, CONTENT_TYPE, HOST, HeaderName, HeaderValue, ORIGIN, UPGRADE};
use hyper::service::service_fn;
use hyper::upgrade::OnUpgrade;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::block_in_place;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;

use crate::access::{self, Asked};
use crate::body::{Gone, Limits, drain, keep, piece, plain, words};
use crate::desk;
use crate::operations;
use crate::server::Server;
use crate::tls::{self, HANDSHAKE};
use crate::values::now;
use crate::wire::{self, Place};

/// The header in which a page says the code.
const CODE: HeaderName = HeaderName::from_static("x-foilpress-code");

/// Between two looks at jobs whose document does not come.
const TICK: Duration = Duration::from_secs(5);

/// Connections of each computer.
#[derive(Default)]
struct Guests(Mutex<HashMap<IpAddr, usize>>);

/// A connection that counts while it is there.
struct Guest {
    guests: Arc<Guests>,
    address: IpAddr,
}

impl Guests {
    fn enter(self: &Arc<Self>, address: IpAddr, limits: &Limits) -> Option<Guest> {
        let mut guests = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if guests.values().sum::<usize>() >= limits.connections {
            return None;
        }
        let count = guests.entry(address).or_default();
        if *count >= limits.of_one {
            return None;
        }
        *count += 1;
        Some(Guest { guests: self.clone(), address })
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        let mut guests = self.guests.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = guests.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                guests.remove(&self.address);
            }
        }
    }
}

/// Serves until the process ends.
///
/// # Errors
/// The system gives no threads, or the listeners are none.
pub fn run(server: &Arc<Server>, listeners: Vec<std::net::TcpListener>, limits: Limits) -> io::Result<()> {
    let acceptor = tls::acceptor(&server.settings.folder, &server.settings.hosts)?;
    // Documents are written to disk where they are read, so a few more threads than that needs.
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build()?;
    runtime.block_on(async {
        let guests = Arc::new(Guests::default());
        for listener in listeners {
            listener.set_nonblocking(true)?;
            let listener = TcpListener::from_std(listener)?;
            let house = House { server: server.clone(), acceptor: acceptor.clone(), limits };
            tokio::spawn(listen(house, listener, guests.clone()));
        }
        loop {
            tokio::time::sleep(TICK).await;
            block_in_place(|| {
                server.time_out(now().saturating_sub(crate::printer::TIME_OUT.unsigned_abs().into()))
            });
        }
    })
}

/// What each connection needs.
#[derive(Clone)]
struct House {
    server: Arc<Server>,
    acceptor: TlsAcceptor,
    limits: Limits,
}

async fn listen(house: House, listener: TcpListener, guests: Arc<Guests>) {
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => {
                // One too many is closed; the others go on.
                if let Some(guest) = guests.enter(peer.ip().to_canonical(), &house.limits) {
                    tokio::spawn(connection(house.clone(), stream, peer, Arc::new(guest)));
                }
            }
            // As where no more files can be opened: there are some again when others have gone.
            Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
        }
    }
}

async fn connection(house: House, stream: TcpStream, peer: SocketAddr, guest: Arc<Guest>) {
    // Answers are small, and whoever waits for one should not wait longer.
    let _ = stream.set_nodelay(true);
    let mut first = [0];
    match timeout(house.limits.head, stream.peek(&mut first)).await {
        Ok(Ok(1)) if first[0] == HANDSHAKE => encrypted(house, stream, peer, guest).await,
        Ok(Ok(1)) => spoken(house, stream, peer, guest, false).await,
        // Nothing came.
        _ => {}
    }
}

async fn encrypted<S>(house: House, stream: S, peer: SocketAddr, guest: Arc<Guest>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    if let Ok(Ok(stream)) = timeout(house.limits.head, house.acceptor.accept(stream)).await {
        spoken(house, stream, peer, guest, true).await;
    }
}

/// Requests on a connection, until it is closed or changes over to encryption.
async fn spoken<S>(house: House, stream: S, peer: SocketAddr, guest: Arc<Guest>, is_encrypted: bool)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let limits = house.limits;
    let service = service_fn(|mut request: Request<Incoming>| {
        let (house, guest) = (house.clone(), guest.clone());
        async move {
            if !is_encrypted && wants_encryption(&request) {
                tokio::spawn(change_over(house, hyper::upgrade::on(&mut request), peer, guest));
                return Ok(switching());
            }
            Ok::<_, Infallible>(respond(&house.server, request, peer, &house.limits, is_encrypted).await)
        }
    });
    let mut builder = hyper::server::conn::http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(limits.head).max_buf_size(64 << 10);
    // What goes wrong here is the client's: it is gone.
    let _ = builder.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}

/// Whether a client asks for encryption before it sends anything that matters.
fn wants_encryption(request: &Request<Incoming>) -> bool {
    let header = |name: HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
    request.method() == Method::OPTIONS
        && header(UPGRADE).is_some_and(|wanted| wanted.split(',').any(|one| one.trim().starts_with("TLS/")))
        && header(CONNECTION).is_some_and(|words| words.to_ascii_lowercase().contains("upgrade"))
}

fn switching() -> Response<Full<Bytes>> {
    let mut response = Response::new(Full::default());
    *response.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    let headers = response.headers_mut();
    headers.insert(UPGRADE, HeaderValue::from_static("TLS/1.2,HTTP/1.1"));
    headers.insert(CONNECTION, HeaderValue::from_static("Upgrade"));
    response
}

/// [`changed_over`] without its type, which would hold itself.
fn change_over(
    house: House,
    upgrade: OnUpgrade,
    peer: SocketAddr,
    guest: Arc<Guest>,
) -> Pin<Box<dyn Future<Output = ()> + Send>> {
    Box::pin(changed_over(house, upgrade, peer, guest))
}

/// The connection behind a change to encryption. The request that asked for it is answered there first.
async fn changed_over(house: House, upgrade: OnUpgrade, peer: SocketAddr, guest: Arc<Guest>) {
    let Ok(Ok(stream)) = timeout(house.limits.head, upgrade).await else { return };
    let Ok(Ok(mut stream)) = timeout(house.limits.head, house.acceptor.accept(TokioIo::new(stream))).await
    else {
        return;
    };
    let answer = b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\nAllow: GET, HEAD, OPTIONS, POST\r\n\r\n";
    if stream.write_all(answer).await.is_ok() && stream.flush().await.is_ok() {
        spoken(house, stream, peer, guest, true).await;
    }
}

async fn respond(
    server: &Server,
    request: Request<Incoming>,
    peer: SocketAddr,
    limits: &Limits,
    is_encrypted: bool,
) -> Response<Full<Bytes>> {
    let header = |name: &HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
    let (host, origin, code) = (header(&HOST), header(&ORIGIN), header(&CODE));
    let asked = Asked { peer, host, origin, code };
    if let Err(why) = access::check(&asked, &server.settings.hosts) {
        return words(StatusCode::FORBIDDEN, why);
    }
    let may_change = access::may_change(&asked, &server.settings.code);
    let host = host.unwrap_or_default().to_owned();
    let path = request.uri().path().to_owned();
    let kind = header(&CONTENT_TYPE).unwrap_or_default().to_owned();
    match (request.method(), path.as_str()) {
        (&Method::POST, path) if kind == "application/ipp" => {
            let printer = path.trim_matches('/').strip_prefix("ipp/print").unwrap_or("");
            let printer = printer.trim_matches('/').to_owned();
            let from = peer.ip().to_canonical();
            let place = Place { host, is_encrypted, printer, from, may_change };
            ipp(server, request.into_body(), &place, limits).await
        }
        (&Method::GET | &Method::HEAD, path) => {
            let query = request.uri().query().unwrap_or_default();
            block_in_place(|| desk::get(server, path, query))
        }
        (&Method::POST, path) => {
            let query = request.uri().query().unwrap_or_default().to_owned();
            let path = path.to_owned();
            let guest = desk::Guest { from: peer.ip().to_canonical(), may_change };
            desk::post(server, &path, &query, &guest, request.into_body(), limits).await
        }
        _ => words(StatusCode::METHOD_NOT_ALLOWED, "there is no such thing to do"),
    }
}

/// An IPP request.
async fn ipp(server: &Server, mut body: Incoming, place: &Place, limits: &Limits) -> Response<Full<Bytes>> {
    const IPP: &str = "application/ipp";
    let late = || words(StatusCode::REQUEST_TIMEOUT, "the request did not come in time");
    let mut bytes = Vec::new();
    let end = loop {
        match wire::head(&bytes) {
            Ok(Some(end)) => break end,
            Ok(None) => {}
            Err(error) => return words(StatusCode::BAD_REQUEST, &error.to_string()),
        }
        match piece(&mut body, limits).await {
            Ok(Some(more)) => bytes.extend_from_slice(&more),
            Ok(None) => {
                return words(StatusCode::BAD_REQUEST, "the request ends in the middle of its attributes");
            }
            Err(Gone) => return late(),
        }
    };
    let rest = bytes.split_off(end);
    let request = match wire::Request::read(bytes) {
        Ok(request) => request,
        Err(error) => return words(StatusCode::BAD_REQUEST, &error.to_string()),
    };
    if let Err(refused) = request.check() {
        let response = wire::Response::new(&request.header, refused.status).saying(refused.what);
        return plain(StatusCode::OK, IPP, response.bytes());
    }
    if !operations::takes_document(&request) {
        // The end of a body in chunks comes behind its last byte. A connection that is not read to there is closed, and with it
        // the answer may be lost.
        drain(&mut body, limits).await;
        let response = block_in_place(|| operations::answer(server, place, &request));
        return plain(StatusCode::OK, IPP, response.bytes());
    }
    let incoming = match block_in_place(|| operations::begin(server, place, &request)) {
        Ok(incoming) => incoming,
        Err(response) => {
            drain(&mut body, limits).await;
            return plain(StatusCode::OK, IPP, response.bytes());
        }
    };
    let folder = server.store.folder(incoming.job);
    let _receives = server.receives(incoming.job);
    let Ok(spooled) = keep(&mut body, &rest, &folder, incoming.packing, limits).await else {
        block_in_place(|| operations::gone(server, &incoming));
        return late();
    };
    if spooled.is_err() {
        drain(&mut body, limits).await;
    }
    let response = block_in_place(|| operations::arrived(server, place, &request, &incoming, spooled));
    plain(StatusCode::OK, IPP, response.bytes())
}
