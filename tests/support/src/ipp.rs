//! A client of a print server, for tests: requests byte by byte, over a plain socket.
//!
//! Source: RFC 8010, section 3. Written without a look at the server's own reader and writer.

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// An attribute of a request: tag, name, value.
pub type Attribute<'a> = (u8, &'a str, &'a [u8]);

/// Print-Job.
pub const PRINT: u16 = 2;
/// Cancel-Job.
pub const CANCEL: u16 = 8;
/// Get-Job-Attributes.
pub const JOB: u16 = 9;

/// The bytes of a message: groups of attributes, each behind its tag.
pub fn message(operation: u16, groups: &[(u8, &[Attribute<'_>])]) -> Vec<u8> {
    let mut bytes = vec![2, 0];
    bytes.extend(operation.to_be_bytes());
    bytes.extend([0, 0, 0, 1]);
    for (group, attributes) in groups {
        bytes.push(*group);
        for (tag, name, value) in *attributes {
            bytes.push(*tag);
            for part in [name.as_bytes(), value] {
                bytes.extend((part.len() as u16).to_be_bytes());
                bytes.extend(part);
            }
        }
    }
    bytes.push(3);
    bytes
}

/// The bytes of a request: operation attributes, then those of the job.
pub fn request(operation: u16, uri: &str, attributes: &[Attribute<'_>], job: &[Attribute<'_>]) -> Vec<u8> {
    let begin: [Attribute<'_>; 3] = [
        (0x47, "attributes-charset", b"utf-8"),
        (0x48, "attributes-natural-language", b"en"),
        (0x45, "printer-uri", uri.as_bytes()),
    ];
    let groups = [(1, &[&begin, attributes].concat()[..]), (2, job)];
    message(operation, if job.is_empty() { &groups[..1] } else { &groups })
}

/// An HTTP answer: its code and its body.
///
/// # Errors
/// The server is gone, or does not answer as HTTP.
pub fn http(to: SocketAddr, head: &str, body: &[u8]) -> io::Result<(u16, Vec<u8>)> {
    let mut stream = TcpStream::connect(to)?;
    stream.set_read_timeout(Some(Duration::from_secs(60)))?;
    stream
        .write_all(format!("{head}Content-Length: {}\r\nConnection: close\r\n\r\n", body.len()).as_bytes())?;
    // A server that refuses may not read on.
    let _ = stream.write_all(body);
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").ok_or(io::ErrorKind::UnexpectedEof)?;
    let code = std::str::from_utf8(&answer[..end]).ok().and_then(|head| head.get(9..12)?.parse().ok());
    Ok((code.ok_or(io::ErrorKind::InvalidData)?, answer.split_off(end + 4)))
}

/// The answer to an IPP request: its status and its bytes.
///
/// # Errors
/// The server is gone, or answers with another code than 200.
pub fn ask(to: SocketAddr, body: &[u8]) -> io::Result<(u16, Vec<u8>)> {
    let head = format!("POST /ipp/print HTTP/1.1\r\nHost: {to}\r\nContent-Type: application/ipp\r\n");
    match http(to, &head, body)? {
        (200, bytes) if bytes.len() >= 8 => Ok((u16::from_be_bytes([bytes[2], bytes[3]]), bytes)),
        (code, _) => Err(io::Error::other(format!("HTTP {code}"))),
    }
}

/// The number that is the value of an attribute in an answer.
pub fn number(answer: &[u8], name: &str) -> Option<i32> {
    let wanted = [&(name.len() as u16).to_be_bytes()[..], name.as_bytes(), &[0, 4]].concat();
    let at = answer.windows(wanted.len()).position(|part| part == wanted)? + wanted.len();
    Some(i32::from_be_bytes(answer.get(at..at + 4)?.try_into().ok()?))
}

/// Prints a document on a printer; the number of its job.
///
/// # Errors
/// The server is gone, or refuses.
pub fn print(to: SocketAddr, printer: &str, name: &str, document: &[u8]) -> io::Result<i32> {
    let uri = format!("ipp://{to}/ipp/print/{printer}");
    let named: [Attribute<'_>; 2] =
        [(0x42, "requesting-user-name", b"me"), (0x42, "job-name", name.as_bytes())];
    let (status, answer) = ask(to, &[request(PRINT, &uri, &named, &[]), document.to_vec()].concat())?;
    number(&answer, "job-id")
        .filter(|_| status < 0x100)
        .ok_or_else(|| io::Error::other(format!("{status:04x}")))
}

/// The state of a job.
///
/// # Errors
/// The server is gone, or knows no such job.
pub fn state(to: SocketAddr, job: i32) -> io::Result<i32> {
    let uri = format!("ipp://{to}/ipp/print");
    let (status, answer) = ask(to, &request(JOB, &uri, &[(0x21, "job-id", &job.to_be_bytes())], &[]))?;
    number(&answer, "job-state").ok_or_else(|| io::Error::other(format!("{status:04x}")))
}
