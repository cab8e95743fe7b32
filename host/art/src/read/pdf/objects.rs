//! The objects of a PDF, and a document in which some of them are others.
//!
//! Problem: Ghostscript tells what a page looks like, not what its objects say; and some pages must be
//! drawn as if they said something else.
//! Method: objects are gathered from the text of the document and from its compressed object streams.
//! Changed ones are appended, with a table of their places, as programs save small changes. Cost: a look at
//! the bytes of the file, and the object streams expanded. Limits: [`MOST_BYTES`] of file and as much of
//! expanded streams; encrypted documents are not changed; an object that is defined twice counts as it is
//! last.
//! Source: ISO 32000-2, sections 7.5.4 to 7.5.8, 8.6.6.4 and 8.6.7.

use std::collections::BTreeMap;
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::Path;

use flate2::read::ZlibDecoder;
use memchr::memmem;

use crate::read::process;

/// The most bytes of a document, and of its expanded object streams, that are looked at, as memory must hold
/// them.
const MOST_BYTES: u64 = 1 << 26;

/// The bytes of a document, as many as are looked at.
pub(super) fn bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(MOST_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Whether these may not be all of its bytes.
pub(super) fn is_cut(bytes: &[u8]) -> bool {
    bytes.len() as u64 >= MOST_BYTES
}

/// Whether a document is encrypted: without its key it has no names, and its streams are noise.
pub(super) fn is_encrypted(bytes: &[u8]) -> bool {
    memmem::find(bytes, b"/Encrypt").is_some()
}

/// A document in which `change` has changed objects; `None` if it changes none, or the document cannot be
/// changed.
pub(super) fn changed(bytes: &[u8], change: impl Fn(&[u8]) -> Option<Vec<u8>>) -> Option<Vec<u8>> {
    // Places count from its header.
    let bytes = &bytes[memmem::find(bytes, b"%PDF-")?..];
    if is_encrypted(bytes) || is_cut(bytes) {
        return None;
    }
    let end = memmem::rfind(bytes, b"startxref")?;
    let (last, _) = token(bytes, end + b"startxref".len())?;
    let last: usize = str::from_utf8(last).ok()?.parse().ok()?;
    let table = bytes.get(last..)?;
    // The new table is of the kind of the one before it: readers take no mixture.
    let is_stream = !table.starts_with(b"xref");
    let begin: &[u8] = if is_stream { b" obj" } else { b"trailer" };
    let trailer = &table[memmem::find(table, begin)? + begin.len()..];
    let (root, size) = (entry(trailer, b"/Root")?, entry(trailer, b"/Size")?);
    let mut out = bytes.to_vec();
    let mut places: Vec<(u32, usize)> = Vec::new();
    for (number, Object { text, stream }) in objects(bytes) {
        let Some(text) = change(&text) else { continue };
        // A table begins with a line of its own.
        out.push(b'\n');
        places.push((number, out.len()));
        out.extend(format!("{number} 0 obj\n").into_bytes());
        out.extend(text);
        out.push(b'\n');
        out.extend(&bytes[stream]);
        out.extend(b"\nendobj\n");
    }
    if places.is_empty() {
        return None;
    }
    let place = out.len();
    let root = process::text(&root);
    let more = format!("/Root {root} /Prev {last}");
    if is_stream {
        let own: u32 = str::from_utf8(&size).ok()?.parse().ok()?;
        places.push((own, place));
        let index: String = places.iter().map(|(number, _)| format!("{number} 1 ")).collect();
        let rows = places
            .iter()
            .map(|(_, place)| Some([&[1][..], &u32::try_from(*place).ok()?.to_be_bytes()].concat()));
        let rows = rows.collect::<Option<Vec<_>>>()?.concat();
        let about = format!(
            "/Size {} /W [1 4 0] /Index [{index}] {more} /Length {}",
            own.checked_add(1)?,
            rows.len()
        );
        out.extend(format!("{own} 0 obj\n<< /Type /XRef {about} >>\nstream\n").into_bytes());
        out.extend(rows);
        out.extend(b"\nendstream\nendobj\n");
    } else {
        let rows: String =
            places.iter().map(|(number, at)| format!("{number} 1\n{at:010} 00000 n \n")).collect();
        let size = process::text(&size);
        out.extend(format!("xref\n{rows}trailer\n<< /Size {size} {more} >>\n").into_bytes());
    }
    out.extend(format!("startxref\n{place}\n%%EOF\n").into_bytes());
    Some(out)
}

/// An object that sets all to overprint where it says that something knocks out; `None` if it says nothing
/// of it.
pub(super) fn overprinting(object: &[u8]) -> Option<Vec<u8>> {
    replaced(object, |before, token| {
        let is_said = matches!(before, Some(b"/OP" | b"/op")) && token == b"false";
        is_said.then(|| b"true".to_vec())
    })
}

/// An object in which spot colours that are `left_out` are those that paint nothing; `None` if it has none
/// of them.
pub(super) fn without(object: &[u8], left_out: impl Fn(&str) -> bool) -> Option<Vec<u8>> {
    if !["/Separation", "/DeviceN"].iter().any(|kind| memmem::find(object, kind.as_bytes()).is_some()) {
        return None;
    }
    replaced(object, |before, token| {
        let is_name = token.starts_with(b"/")
            && (before
                .is_none_or(|before| matches!(before, b"/Separation" | b"[") || before.starts_with(b"/")));
        (is_name && left_out(&name(token))).then(|| b"/None".to_vec())
    })
}

/// The text of a name.
fn name(token: &[u8]) -> String {
    process::unescaped(token.strip_prefix(b"/").unwrap_or(token), b'#')
}

/// An object with other tokens where there are any for one and the one before it.
fn replaced(object: &[u8], other: impl Fn(Option<&[u8]>, &[u8]) -> Option<Vec<u8>>) -> Option<Vec<u8>> {
    let (mut out, mut copied, mut at, mut before) = (Vec::new(), 0, 0, None);
    while let Some((token, end)) = token(object, at) {
        if let Some(other) = other(before, token) {
            out.extend(&object[copied..end - token.len()]);
            out.extend(other);
            copied = end;
        }
        (at, before) = (end, Some(token));
    }
    out.extend(&object[copied..]);
    (copied > 0).then_some(out)
}

/// Where a word is in a document.
fn places(bytes: &[u8], word: &[u8]) -> Vec<usize> {
    memchr::memmem::find_iter(bytes, word).collect()
}

/// An object of a document.
pub(super) struct Object {
    /// What it says: of a stream its dictionary.
    pub text: Vec<u8>,
    /// Where its stream is, from that word on; empty if it has none.
    stream: Range<usize>,
}

/// The objects of a document by their numbers, those of object streams among them.
pub(super) fn objects(bytes: &[u8]) -> BTreeMap<u32, Object> {
    let mut found = BTreeMap::new();
    let (ends, streams) = (places(bytes, b"endobj"), places(bytes, b"stream"));
    let next = |places: &[usize], from: usize| places.get(places.partition_point(|&at| at < from)).copied();
    // An object without an end, or many in each other, cost no more than the document twice.
    let (mut left, mut work) = (MOST_BYTES, 2 * MOST_BYTES);
    for begin in places(bytes, b" obj") {
        let at = begin + 4;
        let Some(number) = number_before(&bytes[..begin]) else { continue };
        let end = next(&ends, at).unwrap_or(bytes.len());
        let stream = next(&streams, at).filter(|&stream| stream < end);
        let object_text = &bytes[at..stream.unwrap_or(end)];
        let Some(rest) = work.checked_sub(object_text.len() as u64) else { break };
        work = rest;
        let packed = entry(object_text, b"/Type").is_some_and(|kind| kind == b"/ObjStm");
        if let (Some(stream), true) = (stream, packed) {
            let data = &bytes[stream + 6..end];
            let data = data.strip_prefix(b"\r\n").or_else(|| data.strip_prefix(b"\n")).unwrap_or(data);
            let mut expanded = Vec::new();
            // What is behind the stream is not part of it, and what is damaged ends it.
            let _ = ZlibDecoder::new(data).take(left).read_to_end(&mut expanded);
            left -= expanded.len() as u64;
            let object = |(number, text)| (number, Object { text, stream: 0..0 });
            found.extend(in_stream(object_text, &expanded).into_iter().map(object));
        } else {
            let stream = stream.map_or(0..0, |stream| stream..end);
            found.insert(number, Object { text: object_text.trim_ascii().to_vec(), stream });
        }
    }
    found
}

/// The objects of an object stream: pairs of numbers and places, and the objects from the place that it says.
fn in_stream(dictionary: &[u8], data: &[u8]) -> Vec<(u32, Vec<u8>)> {
    let number =
        |key: &[u8]| -> Option<usize> { str::from_utf8(&entry(dictionary, key)?).ok()?.parse().ok() };
    let (Some(first), Some(count)) = (number(b"/First"), number(b"/N")) else { return Vec::new() };
    let Some(head) = data.get(..first).and_then(|head| str::from_utf8(head).ok()) else { return Vec::new() };
    let numbers: Vec<usize> = head.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    let pairs: Vec<[usize; 2]> = numbers.as_chunks::<2>().0.iter().take(count).copied().collect();
    let object = |(at, &[number, place]): (usize, &[usize; 2])| {
        let end = pairs.get(at + 1).map_or(data.len(), |next| first.saturating_add(next[1]).min(data.len()));
        Some((u32::try_from(number).ok()?, data.get(first.checked_add(place)?..end)?.to_vec()))
    };
    pairs.iter().enumerate().filter_map(object).collect()
}

/// The number of an object before its generation.
fn number_before(bytes: &[u8]) -> Option<u32> {
    let tail = &bytes[bytes.len().saturating_sub(24)..];
    let mut words = tail.rsplit(|byte: &u8| !byte.is_ascii_digit()).filter(|word| !word.is_empty());
    let (_generation, number) = (words.next()?, words.next()?);
    str::from_utf8(number).ok()?.parse().ok()
}

/// The value of a key in a dictionary, not of one within it.
pub(super) fn entry(dictionary: &[u8], key: &[u8]) -> Option<Vec<u8>> {
    let inside = dictionary.trim_ascii().strip_prefix(b"<<")?;
    let mut at = 0;
    while at < inside.len() {
        let (token, end) = token(inside, at)?;
        if token == b">>" {
            return None;
        }
        let (value, after) = value(inside, end)?;
        if token == key {
            return Some(value.to_vec());
        }
        at = after;
    }
    None
}

/// A whole value: a dictionary, an array, a reference, or a token.
fn value(bytes: &[u8], from: usize) -> Option<(&[u8], usize)> {
    let begin = from + bytes.get(from..)?.iter().position(|byte| !byte.is_ascii_whitespace())?;
    let (first, mut end) = token(bytes, begin)?;
    if first == b"<<" || first == b"[" {
        let mut depth = 1;
        while depth > 0 {
            let (part, after) = token(bytes, end)?;
            match part {
                b"<<" | b"[" => depth += 1,
                b">>" | b"]" => depth -= 1,
                _ => {}
            }
            end = after;
        }
    } else if first.iter().all(u8::is_ascii_digit) {
        // `10 0 R`
        let (generation, after) = token(bytes, end)?;
        if generation.iter().all(u8::is_ascii_digit)
            && let Some((b"R", after)) = token(bytes, after)
        {
            end = after;
        }
    }
    Some((&bytes[begin..end], end))
}

/// The token from a place on, and where it ends.
fn token(bytes: &[u8], from: usize) -> Option<(&[u8], usize)> {
    let begin = from + bytes.get(from..)?.iter().position(|byte| !byte.is_ascii_whitespace())?;
    let rest = &bytes[begin..];
    let length = match rest {
        [b'<', b'<', ..] | [b'>', b'>', ..] => 2,
        [b'[' | b']' | b'{' | b'}' | b'>' | b')', ..] => 1,
        [b'<', ..] => rest.iter().position(|&byte| byte == b'>')? + 1,
        [b'(', ..] => string_end(rest)?,
        [_, after @ ..] => {
            let ends = |byte: &u8| byte.is_ascii_whitespace() || b"<>[](){}/%".contains(byte);
            1 + after.iter().position(ends).unwrap_or(after.len())
        }
        [] => return None,
    };
    Some((&rest[..length], begin + length))
}

/// Where a string in parentheses ends.
fn string_end(bytes: &[u8]) -> Option<usize> {
    let (mut depth, mut escaped) = (0, false);
    for (at, &byte) in bytes.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'(' => depth += 1,
            b')' if depth == 1 => return Some(at + 1),
            b')' => depth -= 1,
            _ => {}
        }
    }
    None
}

/// The number of an object that a value refers to.
pub(super) fn reference(value: &[u8]) -> Option<u32> {
    match references(value)[..] {
        [number] if value.first().is_some_and(u8::is_ascii_digit) => Some(number),
        _ => None,
    }
}

/// The numbers of all objects that a value refers to.
pub(super) fn references(value: &[u8]) -> Vec<u32> {
    let text = String::from_utf8_lossy(value);
    let words: Vec<&str> = text
        .split(|c: char| c.is_ascii_whitespace() || c == '[' || c == ']')
        .filter(|w| !w.is_empty())
        .collect();
    let three = words.windows(3).filter(|three| three[2] == "R" && three[1].parse::<u32>().is_ok());
    three.filter_map(|three| three[0].parse().ok()).collect()
}
