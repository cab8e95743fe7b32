//! The desk: a page for people, and what it asks for.
//!
//! Limits: no file of another machine, no font, no library: it works without internet.

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::{Response, StatusCode};

use crate::http::{Limits, plain, words};
use crate::server::Server;

/// Who asks.
pub struct Guest {
    /// Whether they may change what is not theirs.
    pub may_change: bool,
    /// Whether a page of this server asks.
    pub is_own: bool,
}

/// Answers whoever looks.
pub fn get(_server: &Server, path: &str) -> Response<Full<Bytes>> {
    match path {
        "/" => plain(StatusCode::OK, "text/html; charset=utf-8", "<!doctype html>"),
        _ => words(StatusCode::NOT_FOUND, "there is no such page"),
    }
}

/// Does what is asked.
pub async fn post(
    _server: &Server,
    _path: &str,
    _query: &str,
    _guest: &Guest,
    _body: Incoming,
    _limits: &Limits,
) -> Response<Full<Bytes>> {
    words(StatusCode::NOT_FOUND, "there is no such thing to do")
}
