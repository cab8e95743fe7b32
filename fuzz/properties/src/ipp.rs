//! Requests of print clients: no bytes make the reader fail, wherever they are cut, and a job asks only for what can be printed.

use arbitrary::{Result, Unstructured};
use serve::template::{MOST_COPIES, Ticket, keyword_of, paper, size_of};
use serve::wire::{Request, head};

/// Cuts that are tried of one request.
const CUTS: usize = 400;

/// Bytes as they come; and a script for a request that is nearly right.
pub fn check(bytes: &[u8]) {
    taken(bytes);
    if let Ok(request) = nearly(&mut Unstructured::new(bytes)) {
        taken(&request);
    }
}

fn taken(bytes: &[u8]) {
    let whole = head(bytes);
    for cut in 0..bytes.len().min(CUTS) {
        match (head(&bytes[..cut]), whole) {
            // What has come so far is no reason to change the verdict, but to wait for more.
            (Ok(None), _) => {}
            (early, _) => assert_eq!(early, whole, "at {cut} of {} bytes", bytes.len()),
        }
    }
    let Ok(Some(end)) = whole else { return };
    let Ok(request) = Request::read(bytes[..end].to_vec()) else { return };
    let _ = request.check();
    let mut ticket = Ticket::default();
    for attribute in request.job() {
        ticket.take(attribute.name(), attribute.value());
    }
    assert!((1..=MOST_COPIES.unsigned_abs()).contains(&ticket.copies));
    assert!(ticket.pages.iter().all(|&(from, to)| 1 <= from && from <= to), "{:?}", ticket.pages);
    if let Some(size) = ticket.size {
        assert!(paper(size).is_some(), "{size:?}");
        assert_eq!(size_of(&keyword_of(size)), Some(size));
    }
}

/// Attributes of a job, most of them of the right kind and length.
fn nearly(script: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    const NAMES: [&str; 12] = [
        "copies",
        "media",
        "media-col",
        "media-type",
        "print-quality",
        "page-ranges",
        "overrides",
        "printer-resolution",
        "job-hold-until",
        "",
        "media-size",
        "x-dimension",
    ];
    /// Tags with the length of their values; those of -1 have any.
    const TAGS: [(u8, i8); 12] = [
        (0x21, 4),
        (0x22, 1),
        (0x23, 4),
        (0x31, 11),
        (0x32, 9),
        (0x33, 8),
        (0x34, 0),
        (0x37, 0),
        (0x4a, -1),
        (0x44, -1),
        (0x42, -1),
        (0x35, -1),
    ];
    let mut bytes = vec![2, 0, 0, 2, 0, 0, 0, 1, 1];
    for (tag, name, value) in
        [(0x47, "attributes-charset", "utf-8"), (0x48, "attributes-natural-language", "en")]
    {
        put(&mut bytes, tag, name.as_bytes(), value.as_bytes());
    }
    bytes.push(2);
    while !script.is_empty() && bytes.len() < 4000 {
        let (tag, length) = *script.choose(&TAGS)?;
        let name = *script.choose(&NAMES)?;
        let length = match usize::try_from(length) {
            Ok(length) => length,
            Err(_) => script.int_in_range(0..=30)?,
        };
        let value = script.bytes(length.min(script.len()))?.to_vec();
        // Keywords that mean something are not found by chance.
        let value = match script.ratio(1u8, 4u8)? && length > 0 && tag == 0x44 {
            true => b"custom_x_120x180mm".to_vec(),
            false => value,
        };
        put(&mut bytes, tag, name.as_bytes(), &value);
    }
    bytes.push(3);
    Ok(bytes)
}

fn put(bytes: &mut Vec<u8>, tag: u8, name: &[u8], value: &[u8]) {
    bytes.push(tag);
    for part in [name, value] {
        bytes.extend(u16::try_from(part.len()).unwrap_or(0).to_be_bytes());
        bytes.extend(part);
    }
}
