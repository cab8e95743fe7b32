//! The layers of a PDF (optional content): what they are named, and whether they are meant to be printed.
//!
//! Problem: Ghostscript draws what the document shows when it is opened, whatever a layer says of printing, and layers that are
//! named after inks are drawn in the colours of the screen. The owner of either hears nothing.
//! Method: objects are gathered from the text of the document and from its compressed object streams; the groups among them say
//! their name and their state for printing. They become notes. Cost: a look at the bytes of the file, and the object streams
//! expanded. Limits: [`MOST_BYTES`] of file and as much of expanded streams; encrypted documents tell nothing; an object that is
//! defined twice counts as it is last. States are noted, not followed.
//! Source: ISO 32000-2, sections 7.5.7, 8.11.2 and 8.11.4.4.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use flate2::read::ZlibDecoder;

use crate::read::names;

/// The most bytes of a document, and of its expanded object streams, that are looked at, as memory must hold
/// them; beyond it only a note is missing.
const MOST_BYTES: u64 = 1 << 26;

/// The most layers that a note names, so that it stays a few lines.
const LISTED: usize = 8;

/// A layer.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Group {
    name: String,
    /// Whether it is shown when the document is opened.
    shown: bool,
    /// Its state for printing, if it has one of its own.
    prints: Option<bool>,
}

/// Notes on the layers of a document. `spots` says whether its inks are drawn as spot colours.
pub(super) fn notes(path: &Path, spots: bool) -> Vec<String> {
    let mut bytes = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(MOST_BYTES).read_to_end(&mut bytes));
    if read.is_err() {
        return Vec::new();
    }
    let groups = groups(&bytes);
    let list = |groups: &[&Group]| {
        let mut names: Vec<String> =
            groups.iter().take(LISTED).map(|group| format!("`{}`", group.name)).collect();
        if groups.len() > LISTED {
            names.push("…".into());
        }
        names.join(", ")
    };
    let chosen = |is: &dyn Fn(&Group) -> bool| groups.iter().filter(|group| is(group)).collect::<Vec<_>>();
    let guides = chosen(&|group| group.shown && group.prints == Some(false));
    let missing = chosen(&|group| !group.shown && group.prints == Some(true));
    let inks = chosen(&|group| names::is_whole(&group.name));
    let note = |groups: &[&Group], text: &str| {
        (!groups.is_empty()).then(|| format!("{}: {} {text}", path.display(), list(groups)))
    };
    [
        note(
            &guides,
            "is a layer that is not meant to be printed, but is shown, so it is printed; hide it in the program that made the \
             document",
        ),
        note(
            &missing,
            "is a layer that is meant to be printed, but is hidden, so it is left out; show it in the program that made the \
             document",
        ),
        note(
            if spots { &[] } else { &inks[..] },
            "is a layer named after an ink; layers of a PDF are not read, so it is printed in its colours; draw it in a spot colour of \
             that name, or save the drawing as SVG",
        ),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The layers of a document, in the order of their numbers.
fn groups(bytes: &[u8]) -> Vec<Group> {
    // Without its key an encrypted document has no names.
    let has = |word: &[u8]| memchr::memmem::find(bytes, word).is_some();
    if has(b"/Encrypt") || !has(b"/OCG") && !has(b"/ObjStm") {
        return Vec::new();
    }
    let objects = objects(bytes);
    let resolved = |value: &[u8]| -> Vec<u8> {
        reference(value).and_then(|number| objects.get(&number)).cloned().unwrap_or_else(|| value.to_vec())
    };
    let of = |dictionary: &[u8], key: &[u8]| entry(dictionary, key).map(|value| resolved(&value));
    // What is hidden is listed by reference in the default configuration.
    let configuration = objects.values().find_map(|object| {
        let properties = of(object, b"/OCProperties")?;
        of(&properties, b"/D")
    });
    let hidden = configuration.and_then(|d| of(&d, b"/OFF")).unwrap_or_default();
    let hidden: Vec<u32> = references(&hidden);
    let is_group = |object: &[u8]| entry(object, b"/Type").is_some_and(|kind| kind == b"/OCG");
    let groups = objects.iter().filter(|(_, object)| is_group(object));
    groups
        .filter_map(|(number, object)| {
            let state = of(object, b"/Usage")
                .and_then(|usage| of(&usage, b"/Print"))
                .and_then(|print| of(&print, b"/PrintState"));
            Some(Group {
                name: text(&of(object, b"/Name")?)?,
                shown: !hidden.contains(number),
                prints: state.map(|state| state == b"/ON"),
            })
        })
        .collect()
}

/// Where a word is in a document.
fn places(bytes: &[u8], word: &[u8]) -> Vec<usize> {
    memchr::memmem::find_iter(bytes, word).collect()
}

/// The objects of a document by their numbers, without those of streams.
fn objects(bytes: &[u8]) -> BTreeMap<u32, Vec<u8>> {
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
        let object = &bytes[at..stream.unwrap_or(end)];
        let Some(rest) = work.checked_sub(object.len() as u64) else { break };
        work = rest;
        let packed = entry(object, b"/Type").is_some_and(|kind| kind == b"/ObjStm");
        if let (Some(stream), true) = (stream, packed) {
            let data = &bytes[stream + 6..end];
            let data = data.strip_prefix(b"\r\n").or_else(|| data.strip_prefix(b"\n")).unwrap_or(data);
            let mut expanded = Vec::new();
            // What is behind the stream is not part of it, and what is damaged ends it.
            let _ = ZlibDecoder::new(data).take(left).read_to_end(&mut expanded);
            left -= expanded.len() as u64;
            found.extend(in_stream(object, &expanded));
        } else {
            found.insert(number, object.trim_ascii().to_vec());
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
fn entry(dictionary: &[u8], key: &[u8]) -> Option<Vec<u8>> {
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
fn reference(value: &[u8]) -> Option<u32> {
    match references(value)[..] {
        [number] if value.first().is_some_and(u8::is_ascii_digit) => Some(number),
        _ => None,
    }
}

/// The numbers of all objects that a value refers to.
fn references(value: &[u8]) -> Vec<u32> {
    let text = String::from_utf8_lossy(value);
    let words: Vec<&str> = text
        .split(|c: char| c.is_ascii_whitespace() || c == '[' || c == ']')
        .filter(|w| !w.is_empty())
        .collect();
    let three = words.windows(3).filter(|three| three[2] == "R" && three[1].parse::<u32>().is_ok());
    three.filter_map(|three| three[0].parse().ok()).collect()
}

/// The text of a string in parentheses or of hexadecimal digits, without control characters.
fn text(value: &[u8]) -> Option<String> {
    let bytes = match value {
        [b'(', inside @ .., b')'] => unescaped(inside),
        [b'<', inside @ .., b'>'] => {
            let digits: Vec<u8> = inside
                .iter()
                .filter_map(|&byte| char::from(byte).to_digit(16))
                .map(|digit| digit as u8)
                .collect();
            digits.chunks(2).map(|two| two[0] << 4 | two.get(1).copied().unwrap_or(0)).collect()
        }
        _ => return None,
    };
    let text = if let Some(wide) = bytes.strip_prefix(b"\xfe\xff") {
        let units: Vec<u16> = wide.as_chunks::<2>().0.iter().map(|&two| u16::from_be_bytes(two)).collect();
        String::from_utf16_lossy(&units)
    } else {
        let plain = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
        crate::read::process::text(plain)
    };
    Some(text.chars().filter(|c| !c.is_control()).collect())
}

/// The bytes of a string in parentheses.
fn unescaped(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = bytes;
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte != b'\\' {
            out.push(byte);
            continue;
        }
        let digits = rest.iter().take(3).take_while(|byte| (b'0'..=b'7').contains(byte)).count();
        if digits > 0 {
            let code = rest[..digits].iter().fold(0u32, |code, digit| code * 8 + u32::from(digit - b'0'));
            out.push(code as u8);
            rest = &rest[digits..];
        } else if let Some((&escaped, after)) = rest.split_first() {
            out.push(match escaped {
                b'n' => b'\n',
                b'r' => b'\r',
                b't' => b'\t',
                other => other,
            });
            rest = after;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;
    use proptest::prelude::*;

    fn group(name: &str, shown: bool, prints: Option<bool>) -> Group {
        Group { name: name.into(), shown, prints }
    }

    const CATALOG: &str =
        "<< /Type /Catalog /OCProperties << /OCGs [10 0 R 11 0 R] /D << /Name (a) /OFF [12 0 R] >> >> >>";
    const LAYERS: [&str; 3] = [
        "<< /Type /OCG /Name (White \\(1\\)) >>",
        "<< /Type /OCG /Name <FEFF767D> /Usage << /View << /ViewState /ON >> /Print << /PrintState /OFF >> >> >>",
        "<</Usage 13 0 R/Type/OCG/Name(print only)>>",
    ];

    #[test]
    fn layers_are_found_in_plain_objects_and_in_object_streams() {
        let wanted = [
            group("White (1)", true, None),
            group("白", true, Some(false)),
            group("print only", false, Some(true)),
        ];
        let usage = "<< /Print << /PrintState /ON >> >>";
        let object = |number: usize, text: &str| format!("{number} 0 obj\n{text}\nendobj\n");
        let plain = format!(
            "%PDF-1.5\n{}{}{}",
            object(1, CATALOG),
            (10..).zip(LAYERS).map(|(number, layer)| object(number, layer)).collect::<String>(),
            object(13, usage)
        );
        assert_eq!(groups(plain.as_bytes()), wanted);
        assert_eq!(groups(plain.replace("obj\n<<", "obj<<").as_bytes()), wanted);
        let all = [LAYERS[0], LAYERS[1], LAYERS[2], usage];
        let mut head = String::new();
        let mut place = 0;
        for (number, text) in (10..).zip(all) {
            head += &format!("{number} {place} ");
            place += text.len() + 1;
        }
        let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        packed.write_all(format!("{head}{}", all.join("\n")).as_bytes()).unwrap();
        let packed = packed.finish().unwrap();
        let stream = [
            format!(
                "%PDF-1.5\n{}20 0 obj << /Type /ObjStm /N 4 /First {} /Filter /FlateDecode /Length {} >> stream\r\n",
                object(1, CATALOG),
                head.len(),
                packed.len()
            )
            .into_bytes(),
            packed,
            b"\nendstream endobj".to_vec(),
        ]
        .concat();
        assert_eq!(groups(&stream), wanted);
        assert!(groups(&[&stream[..], b"trailer << /Encrypt 9 0 R >>"].concat()).is_empty());
    }

    #[test]
    fn an_object_that_is_defined_again_counts_as_it_is_last() {
        let twice = "1 0 obj << /Type /OCG /Name (a) >> endobj 1 0 obj << /Type /OCG /Name (b) >> endobj";
        assert_eq!(groups(twice.as_bytes()), [group("b", true, None)]);
    }

    proptest! {
        #[test]
        fn any_bytes_have_layers_or_none(parts in prop::collection::vec(prop::sample::select(vec![
            "1 0 obj", "endobj", "<<", ">>", "/Type", "/OCG", "/ObjStm", "/Name", "(a", "\\", ")", "<4", "[", "]", "stream\n", "R", " ", "/N", "/First", "9",
        ]), 0..60)) {
            let _ = groups([&parts.concat(), "/OCG"].concat().as_bytes());
        }
    }
}
