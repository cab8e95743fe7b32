//! HTTP: connections with limits, and where each request goes.
//!
//! Problem: a document may be a gigabyte, a client may be slow, hostile or many, and none of this may hinder another one. Method: hyper
//! reads heads and hands on bodies piece by piece; a document goes to disk as it comes. Each connection has its time: for a head, for
//! each piece, and for a document as a whole, which must come at a least pace. A client has no more than its share ([`budget`](crate::budget)).
//! What touches the disk runs where the runtime expects it to block.
//! Cost: a task and two buffers of 64 KB a connection. Limits: see [`Limits`]; HTTP/1.1.
//! Source: RFC 9110 and 9112; RFC 8010, section 4, for IPP over HTTP.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, Instant};

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

use crate::access::{self, Asked, Asker, Refused, Route, Says};
use crate::body::{Gone, Limits, drain, keep, piece, plain, words};
use crate::budget::{Client, Connection, Connections, MOST_OF_ONE};
use crate::desk;
use crate::operations;
use crate::server::Server;
use crate::tls::{self, HANDSHAKE};
use crate::wire::{self, Place};

/// The header in which a page says the code.
const CODE: HeaderName = HeaderName::from_static("x-foilpress-code");

/// The header in which a page shows the keys of what its browser has uploaded, separated by commas.
const KEYS: HeaderName = HeaderName::from_static("x-foilpress-keys");
/// The most of them: nobody has more jobs that wait.
const MOST_KEYS: usize = MOST_OF_ONE;

/// How long somebody waits who asked for what they may not: whoever guesses is slow.
const REFUSED: Duration = Duration::from_secs(1);

/// How long a job waits that somebody has put on the desk and nobody releases.
const HELD: Duration = Duration::from_secs(24 * 60 * 60);

/// Between two looks at jobs whose document does not come.
const TICK: Duration = Duration::from_secs(5);

/// Serves until the process ends.
///
/// # Errors
/// The system gives no threads, or the listeners are none.
pub fn run(server: &Arc<Server>, listeners: Vec<std::net::TcpListener>, limits: Limits) -> io::Result<()> {
    let acceptor = tls::acceptor(&server.settings.folder, &server.settings.hosts)?;
    // Documents are written to disk where they are read, so a few more threads than that needs.
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build()?;
    runtime.block_on(async {
        let guests = Arc::new(Connections::default());
        for listener in listeners {
            listener.set_nonblocking(true)?;
            let listener = TcpListener::from_std(listener)?;
            let house = House { server: server.clone(), acceptor: acceptor.clone(), limits };
            tokio::spawn(listen(house, listener, guests.clone()));
        }
        loop {
            tokio::time::sleep(TICK).await;
            block_in_place(|| {
                server.time_out(Duration::from_secs(crate::printer::TIME_OUT.unsigned_abs().into()), HELD);
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

async fn listen(house: House, listener: TcpListener, guests: Arc<Connections>) {
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => {
                // One too many is closed; the others go on.
                if let Some(guest) = guests.enter(Client::at(peer.ip()), &house.limits.connections) {
                    tokio::spawn(connection(house.clone(), stream, peer, Arc::new(guest)));
                }
            }
            // As where no more files can be opened: there are some again when others have gone.
            Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
        }
    }
}

async fn connection(house: House, stream: TcpStream, peer: SocketAddr, guest: Arc<Connection>) {
    // Answers are small, and whoever waits for one should not wait longer.
    let _ = stream.set_nodelay(true);
    let mut first = [0];
    match timeout(house.limits.head, stream.peek(&mut first)).await {
        Ok(Ok(1)) if first[0] == HANDSHAKE => encrypted(house, stream, peer, guest).await,
        Ok(Ok(1)) => spoken(house, stream, peer, guest, None).await,
        // Nothing came.
        _ => {}
    }
}

async fn encrypted<S>(house: House, stream: S, peer: SocketAddr, guest: Arc<Connection>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let begun = Instant::now();
    if let Ok(Ok(stream)) = timeout(house.limits.head, house.acceptor.accept(stream)).await {
        spoken(house, stream, peer, guest, Some(begun)).await;
    }
}

/// Requests on a connection, until it is closed or changes over to encryption, which began then.
async fn spoken<S>(
    house: House,
    stream: S,
    peer: SocketAddr,
    guest: Arc<Connection>,
    encrypted: Option<Instant>,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (limits, is_encrypted) = (house.limits, encrypted.is_some());
    // What a handshake took is gone; one that takes long leaves little.
    let spent = encrypted.map_or(Duration::ZERO, |begun| begun.elapsed());
    let head = limits.head.saturating_sub(spent).max(Duration::from_millis(500));
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
    builder.timer(TokioTimer::new()).header_read_timeout(head).max_buf_size(64 << 10);
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
    guest: Arc<Connection>,
) -> Pin<Box<dyn Future<Output = ()> + Send>> {
    Box::pin(changed_over(house, upgrade, peer, guest))
}

/// The connection behind a change to encryption. The request that asked for it is answered there first.
async fn changed_over(house: House, upgrade: OnUpgrade, peer: SocketAddr, guest: Arc<Connection>) {
    let begun = Instant::now();
    let Ok(Ok(stream)) = timeout(house.limits.head, upgrade).await else { return };
    let Ok(Ok(mut stream)) = timeout(house.limits.head, house.acceptor.accept(TokioIo::new(stream))).await
    else {
        return;
    };
    let answer = b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\nAllow: GET, HEAD, OPTIONS, POST\r\n\r\n";
    if stream.write_all(answer).await.is_ok() && stream.flush().await.is_ok() {
        spoken(house, stream, peer, guest, Some(begun)).await;
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
    if request.headers().get_all(&HOST).iter().count() > 1 {
        return words(StatusCode::BAD_REQUEST, "the request names two hosts");
    }
    let is_ipp = request.method() == Method::POST && header(&CONTENT_TYPE) == Some("application/ipp");
    if let Err(why) = access::check(&asked, &server.settings.hosts, is_ipp) {
        return words(StatusCode::FORBIDDEN, why);
    }
    let is_keeper = access::is_keeper(&asked, &server.code());
    let from = peer.ip().to_canonical();
    let path = request.uri().path().to_owned();
    if is_ipp {
        let host = host.unwrap_or_default().to_owned();
        let printer = path.trim_matches('/').strip_prefix("ipp/print").unwrap_or("");
        let printer = printer.trim_matches('/').to_owned();
        let place = Place { host, is_encrypted, printer, from, is_keeper };
        return ipp(server, request.into_body(), &place, limits).await;
    }
    let keys = header(&KEYS).unwrap_or_default().split(',').map(|key| key.trim().to_owned());
    let asker = Asker { from, is_keeper, says: Says::Keys(keys.take(MOST_KEYS).collect()) };
    let Some(route) = desk::route(request.method(), &path) else {
        return words(StatusCode::NOT_FOUND, "there is no such page");
    };
    let query = request.uri().query().unwrap_or_default().to_owned();
    match server.permit(route, &asker, desk::number(&query, "job")) {
        Err(refused) => {
            tokio::time::sleep(REFUSED).await;
            let status = match refused {
                Refused::NoJob => StatusCode::NOT_FOUND,
                Refused::Foreign | Refused::Code => StatusCode::UNAUTHORIZED,
            };
            words(status, &refused.to_string())
        }
        Ok(_) if route == Route::Upload => {
            desk::upload(server, &query, from, &mut request.into_body(), limits).await
        }
        Ok(permit) => block_in_place(|| desk::act(server, &permit, &query, &asker)),
    }
}

/// An IPP request.
async fn ipp(server: &Server, mut body: Incoming, place: &Place, limits: &Limits) -> Response<Full<Bytes>> {
    const IPP: &str = "application/ipp";
    let late = || words(StatusCode::REQUEST_TIMEOUT, "the request did not come in time");
    let (mut bytes, begun) = (Vec::new(), Instant::now());
    let end = loop {
        match wire::head(&bytes) {
            Ok(Some(end)) => break end,
            Ok(None) => {}
            Err(error) => return words(StatusCode::BAD_REQUEST, &error.to_string()),
        }
        let all = limits.head + Duration::from_secs(bytes.len() as u64 / limits.pace.max(1));
        match timeout(all.saturating_sub(begun.elapsed()), piece(&mut body, limits)).await {
            Ok(Ok(Some(more))) => bytes.extend_from_slice(&more),
            Ok(Ok(None)) => {
                return words(StatusCode::BAD_REQUEST, "the request ends in the middle of its attributes");
            }
            Ok(Err(Gone)) | Err(_) => return late(),
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
    let room = |octets| server.reserve(incoming.job, octets);
    let to = (folder.as_path(), incoming.packing);
    let Ok(spooled) = keep(&mut body, &rest, to, &room, limits).await else {
        block_in_place(|| operations::gone(server, &incoming));
        return late();
    };
    if spooled.is_err() {
        drain(&mut body, limits).await;
    }
    let response = block_in_place(|| operations::arrived(server, place, &request, &incoming, spooled));
    plain(StatusCode::OK, IPP, response.bytes())
}
