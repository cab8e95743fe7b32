//! Guests from other computers: what each may do over the network, and that five of them shut nobody out.

use std::io::{Read as _, Write as _};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use observe::Silent;
use serve::body::Limits;
use serve::server::Server;
use testing::namespace;

use super::limits::sheet;
use super::settings;

/// Addresses of other computers, in a network that is this test's own.
const ADDRESSES: &str =
    "ip link set lo up && for n in $(seq 1 9); do ip addr add 10.9.0.$n/32 dev lo; done; true";

fn address(last: u8) -> IpAddr {
    IpAddr::from([10, 9, 0, last])
}

/// A connection from an address.
fn connected(from: IpAddr, to: SocketAddr) -> TcpStream {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let stream = runtime.block_on(async {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind(SocketAddr::new(from, 0)).unwrap();
        socket.connect(to).await.unwrap().into_std().unwrap()
    });
    stream.set_nonblocking(false).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    stream
}

/// A request from an address with these headers: its status and its body; none if the connection is closed.
fn ask(from: IpAddr, to: SocketAddr, line: &str, headers: &str, body: &[u8]) -> Option<(u16, String)> {
    let mut stream = connected(from, to);
    let head = format!(
        "{line} HTTP/1.1\r\nHost: {to}\r\nConnection: close\r\n{headers}Content-Length: {}\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).ok()?;
    stream.write_all(body).ok()?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok()?;
    let text = String::from_utf8_lossy(&answer).into_owned();
    let code = text.get(9..12)?.parse().ok()?;
    Some((code, text.split_once("\r\n\r\n")?.1.to_owned()))
}

/// A server at an address of the network, with these limits.
fn served(folder: &std::path::Path, limits: Limits) -> (Arc<Server>, SocketAddr) {
    let server = Arc::new(Server::begin(settings(folder, "raw:/dev/null"), Box::new(Silent)).unwrap());
    let listener = TcpListener::bind(SocketAddr::new(address(9), 0)).unwrap();
    let to = listener.local_addr().unwrap();
    let serving = server.clone();
    std::thread::spawn(move || serve::http::run(&serving, vec![listener], limits).unwrap());
    (server, to)
}

fn has_network() -> bool {
    let is_there = Command::new("ip").arg("-V").output().is_ok_and(|done| done.status.success());
    if !is_there {
        println!("skipped: there is no program `ip`");
    }
    is_there
}

#[test]
fn a_job_of_the_desk_is_its_owners_and_the_keepers() {
    if !has_network() {
        return;
    }
    let name = "network::a_job_of_the_desk_is_its_owners_and_the_keepers";
    let Some(folder) = namespace::inside(name, "-rn", ADDRESSES) else { return };
    let (server, to) = served(&folder, Limits::default());
    let code = format!("x-foilpress-code: {}\r\n", server.code());
    let upload = |from: u8| {
        let (status, text) =
            ask(address(from), to, "POST /desk/print?printer=standard&name=leaf.rgl", "", &sheet()).unwrap();
        assert_eq!(status, 200, "{text}");
        let told: serde_json::Value = serde_json::from_str(&text).unwrap();
        (told["job"].as_u64().unwrap(), format!("x-foilpress-keys: {}\r\n", told["key"].as_str().unwrap()))
    };
    // Who asks, with which headers, and whether they may.
    let deeds = [
        "POST /desk/plan",
        "GET /desk/preview.png",
        "POST /desk/change",
        "POST /desk/release",
        "POST /desk/cancel",
    ];
    let (_, foreign) = upload(3);
    let askers = [
        ("stranger", 2, "", false),
        ("stranger with another key", 3, foreign.as_str(), false),
        ("owner", 1, "", true),
        ("owner elsewhere", 4, "own", true),
        ("keeper", 5, code.as_str(), true),
        ("wrong code", 6, "x-foilpress-code: aaaaaaaa\r\n", false),
    ];
    // Who is refused waits a second each time.
    let all = |(who, from, has, may): (&str, u8, &str, bool)| {
        let (job, key) = upload(1);
        let headers = if has == "own" { &key } else { has };
        for deed in deeds {
            let (status, text) = ask(address(from), to, &format!("{deed}?job={job}"), headers, b"").unwrap();
            assert_eq!(status, if may { 200 } else { 401 }, "{who}: {deed}: {text}");
        }
        for deed in ["POST /desk/load?kind=film", "POST /desk/switched"] {
            let (status, _) = ask(address(from), to, deed, headers, b"").unwrap();
            assert_eq!(status, if who == "keeper" { 200 } else { 401 }, "{who}: {deed}");
        }
    };
    std::thread::scope(|scope| {
        for asker in askers {
            let all = &all;
            scope.spawn(move || all(asker));
        }
    });
}

#[test]
fn five_addresses_with_slow_connections_shut_nobody_out() {
    if !has_network() {
        return;
    }
    let name = "network::five_addresses_with_slow_connections_shut_nobody_out";
    let Some(folder) = namespace::inside(name, "-rn", ADDRESSES) else { return };
    let limits = Limits { head: Duration::from_secs(4), ..Limits::default() };
    let (_server, to) = served(&folder, limits);
    let mut slow: Vec<TcpStream> =
        (1..=5).cycle().take(600).map(|last| connected(address(last), to)).collect();
    for stream in &mut slow {
        // One that is over its share is closed at once.
        let _ = stream.write_all(b"POST /ipp/print HTTP/1.1\r\nHost: ");
    }
    let start = Instant::now();
    for _ in 0..10 {
        let (status, _) = ask(address(6), to, "GET /desk.json", "", b"").expect("an answer");
        assert_eq!(status, 200);
    }
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    // Letter by letter does not help them.
    let until = Instant::now() + Duration::from_secs(6);
    while Instant::now() < until {
        slow.retain_mut(|stream| stream.write_all(b"x").is_ok());
        std::thread::sleep(Duration::from_millis(200));
    }
    let is_open = |stream: &mut TcpStream| {
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let mut bytes = [0; 64];
        matches!(stream.read(&mut bytes), Err(error) if error.kind() == std::io::ErrorKind::WouldBlock)
    };
    assert_eq!(slow.iter_mut().map(is_open).filter(|open| *open).count(), 0);
}
