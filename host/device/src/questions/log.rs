//! The firmware's log, read from the bridge and decoded.
//!
//! The firmware writes numbers and values; the words stand in the program it was built as (ELF). The bridge keeps the last
//! few thousand bytes, over a restart too, so the log tells what came before one. Limit: with another program than the
//! one on the bridge the words are wrong, or the frames make no sense and are counted as unreadable.

use std::time::Duration;

use defmt_decoder::{DecodeError, Table};
use serde::Serialize;

use super::query::{Query, QueryError};
use crate::connection::printable;

/// The most of a log that is read: a bridge keeps far less, and one may always have more.
const MOST: usize = 100_000;

/// A log as it came.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Raw {
    /// Bytes that are gone, because newer ones took their place.
    pub lost: u32,
    /// The rest.
    pub bytes: Vec<u8>,
}

/// An entry.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Entry {
    /// Since the bridge was started, in seconds, as the firmware wrote it.
    pub time: String,
    /// error, warn, info, debug or trace; nothing for plain text.
    pub level: Option<&'static str>,
    /// What happened.
    pub text: String,
    /// Where in the firmware's source, if the program tells.
    pub place: Option<String>,
}

/// A log in words.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Log {
    /// The entries, oldest first.
    pub entries: Vec<Entry>,
    /// Entries that make no sense with this program.
    pub unreadable: usize,
}

/// Why a log cannot be put into words.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// Not an ELF file, or one of another defmt.
    #[error(
        "this is no program whose log can be read ({0}); `cargo xtask firmware` writes it as foilpress-bridge.elf"
    )]
    Program(String),
    /// A program that logs nothing.
    #[error("this program logs nothing: is it the bridge's firmware (foilpress-bridge.elf)?")]
    Silent,
}

/// Reads all there is.
pub fn read(query: &mut Query<'_>, patience: Duration) -> Result<Raw, QueryError> {
    let mut piece = query.log(0, patience)?;
    let mut raw = Raw { lost: piece.at, bytes: Vec::new() };
    let mut read = 0;
    loop {
        let next = piece.at.wrapping_add(piece.bytes.len() as u32);
        read += piece.bytes.len();
        raw.bytes.append(&mut piece.bytes);
        if next == piece.end || read >= MOST {
            return Ok(raw);
        }
        piece = query.log(next, patience)?;
        if piece.at != next {
            // It was written over while it was read: what is left begins anew.
            raw = Raw { lost: piece.at, bytes: Vec::new() };
        }
    }
}

/// Puts a log into the words of `program`, the firmware's ELF file.
pub fn decode(raw: &Raw, program: &[u8]) -> Result<Log, LogError> {
    let wrong = |error: anyhow::Error| LogError::Program(error.to_string());
    let table = Table::parse(program).map_err(wrong)?.ok_or(LogError::Silent)?;
    // A program without its debug information still has its words.
    let places = table
        .get_locations(program)
        .ok()
        .filter(|places| table.indices().all(|i| places.contains_key(&(i as u64))));
    let mut bytes = &raw.bytes[..];
    if raw.lost > 0 {
        // The first frame is cut; it ends with a zero.
        let end = bytes.iter().position(|&byte| byte == 0).map_or(bytes.len(), |zero| zero + 1);
        bytes = &bytes[end..];
    }
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut log = Log { entries: Vec::new(), unreadable: 0 };
    loop {
        match decoder.decode() {
            Ok(frame) => log.entries.push(Entry {
                time: frame.display_timestamp().map(|time| time.to_string()).unwrap_or_default(),
                level: frame.level().map(|level| level.as_str()),
                text: printable(&frame.display_message().to_string()),
                place: places
                    .as_ref()
                    .and_then(|places| places.get(&frame.index()))
                    .map(|place| format!("{}:{}", place.file.display(), place.line)),
            }),
            Err(DecodeError::UnexpectedEof) => return Ok(log),
            Err(DecodeError::Malformed) => log.unreadable += 1,
        }
    }
}
