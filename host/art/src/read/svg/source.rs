//! The text of an SVG drawing, from the bytes of its file.
//!
//! Problem: programs save drawings as UTF-8, as UTF-16, or in the encoding of their country, and write comments of any
//! length before the first element.
//! Method: a byte order mark counts first, then the declaration of the first line, then UTF-8. The prolog is skipped as XML
//! defines it, so the kind of file is told by its first element. Cost: one pass, none for UTF-8. Limits: the first element
//! lies within the first megabyte; EBCDIC and UTF-32 are errors.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

use crate::error::wrong;
use files::shelf::Shelf;
use observe::Diagnosis;

/// How far into a file its first element is looked for: enough for any declaration and comment before it.
const PROLOG: u64 = 1 << 20;

/// Whether a file is an SVG drawing; `start` holds its first bytes.
pub(crate) fn is_svg(shelf: &dyn Shelf, file: &Path, start: &[u8]) -> bool {
    let begins = |bytes: &[u8]| first_element(&lossy(bytes));
    match begins(start) {
        First::Named(name) => name == "svg" || lossy(start).contains("<svg"),
        First::NoMarkup => false,
        // The prolog is longer than what was read.
        First::Further => {
            let more = shelf.start(file, PROLOG);
            more.is_ok_and(|more| matches!(begins(&more), First::Named(name) if name == "svg"))
        }
    }
}

/// The text of a drawing.
pub(super) fn decoded(path: &Path, bytes: Vec<u8>) -> Result<String, Diagnosis> {
    let (encoding, mark) = match encoding(&bytes) {
        Ok(found) => found,
        Err(label) => {
            let problem = format!("its encoding `{label}` is unknown");
            return Err(wrong(path, problem).hint("save the drawing as UTF-8"));
        }
    };
    let bad = |_| {
        let name = encoding.name();
        wrong(path, format!("it has bytes that are not {name}, its encoding"))
            .hint("save the drawing as UTF-8")
    };
    if encoding == UTF_8 {
        let mut bytes = bytes;
        bytes.drain(..mark);
        return String::from_utf8(bytes).map_err(|_| bad(()));
    }
    let text = encoding.decode_without_bom_handling_and_without_replacement(&bytes[mark..]);
    text.map(Cow::into_owned).ok_or(()).map_err(bad)
}

/// The encoding of a drawing and the length of its byte order mark, or the label of an unknown encoding.
fn encoding(bytes: &[u8]) -> Result<(&'static Encoding, usize), String> {
    if let Some(found) = Encoding::for_bom(bytes) {
        return Ok(found);
    }
    // Markup begins with `<`, whose other byte is zero in UTF-16.
    match bytes {
        [b'<', 0, ..] => return Ok((UTF_16LE, 0)),
        [0, b'<', ..] => return Ok((UTF_16BE, 0)),
        _ => {}
    }
    let Some(label) = declared(bytes) else { return Ok((UTF_8, 0)) };
    match Encoding::for_label(label.as_bytes()) {
        // The declaration itself was read byte by byte, so it outlived a conversion to UTF-8.
        Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => Ok((UTF_8, 0)),
        Some(encoding) => Ok((encoding, 0)),
        None => Err(label),
    }
}

/// The encoding that an XML declaration states.
fn declared(bytes: &[u8]) -> Option<String> {
    let start = &bytes[..bytes.len().min(256)];
    let line = start.strip_prefix(b"<?xml")?;
    let line = String::from_utf8_lossy(line);
    let line = &line[..line.find("?>")?];
    let value =
        line[line.find("encoding")? + "encoding".len()..].trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| ['"', '\''].contains(c))?;
    value[1..].split(quote).next().map(str::to_owned)
}

/// Text to look at; what cannot be decoded stands for itself.
fn lossy(bytes: &[u8]) -> String {
    let (encoding, mark) = encoding(bytes).unwrap_or((UTF_8, 0));
    encoding.decode_without_bom_handling(&bytes[mark..]).0.into_owned()
}

/// The text of these bytes if they are markup.
pub(super) fn markup(bytes: &[u8]) -> Option<String> {
    let start = &bytes[..bytes.len().min(1 << 12)];
    (first_element(&lossy(start)) != First::NoMarkup).then(|| lossy(bytes))
}

/// What a text begins with.
#[derive(PartialEq, Debug)]
enum First {
    /// An element of this name, without its prefix.
    Named(String),
    /// A prolog that does not end here.
    Further,
    /// No markup.
    NoMarkup,
}

/// The first element after declarations, comments and the document type.
fn first_element(text: &str) -> First {
    let mut rest = text.trim_start();
    if !rest.starts_with('<') {
        return First::NoMarkup;
    }
    loop {
        let end = if rest.starts_with("<!--") {
            rest.find("-->").map(|at| at + 3)
        } else if rest.starts_with("<?") {
            rest.find("?>").map(|at| at + 2)
        } else if rest.starts_with("<!") {
            end_of_doctype(rest)
        } else if let Some(element) = rest.strip_prefix('<') {
            let ends = |c: char| c.is_whitespace() || c == '>' || c == '/';
            let Some(end) = element.find(ends) else { return First::Further };
            let name = &element[..end];
            return First::Named(name.rsplit(':').next().unwrap_or(name).to_owned());
        } else if rest.is_empty() {
            return First::Further;
        } else {
            return First::NoMarkup;
        };
        match end {
            Some(end) => rest = rest[end..].trim_start(),
            None => return First::Further,
        }
    }
}

/// Where a document type ends, whose entities are in brackets.
fn end_of_doctype(text: &str) -> Option<usize> {
    let plain = text.find('>')?;
    match text.find('[') {
        Some(open) if open < plain => {
            let mut at = open;
            loop {
                at += text[at..].find(']')? + 1;
                let after = text[at..].trim_start();
                if after.starts_with('>') {
                    return Some(text.len() - after.len() + 1);
                }
            }
        }
        _ => Some(plain + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_element_tells_the_kind() {
        let named = |name: &str| First::Named(name.into());
        let doctype =
            "<?xml version='1.0'?>\n<!DOCTYPE svg [<!ENTITY a \"x>y\"> ]>\n<!-- <html> -->\n<svg:svg xmlns";
        for (text, first) in [
            ("<svg width='1'>", named("svg")),
            (doctype, named("svg")),
            ("<!DOCTYPE svg PUBLIC \"-//W3C\" \"http://w3.org\"><svg>", named("svg")),
            ("<html><svg>", named("html")),
            ("<!-- a comment with no end", First::Further),
            ("<?xml?>", First::Further),
            ("<?xml?> words", First::NoMarkup),
            ("P5 3 3", First::NoMarkup),
        ] {
            assert_eq!(first_element(text), first, "{text}");
        }
    }

    #[test]
    fn bytes_are_read_in_the_encoding_they_state() {
        let path = Path::new("a.svg");
        let utf16 = |text: &str, big: bool| -> Vec<u8> {
            text.encode_utf16().flat_map(|u| if big { u.to_be_bytes() } else { u.to_le_bytes() }).collect()
        };
        let latin = b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><svg id=\"wei\xdf\"/>".to_vec();
        assert!(decoded(path, latin).unwrap().ends_with("<svg id=\"weiß\"/>"));
        let text = "<svg id=\"weiß\"/>";
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            utf16(text, false),
            utf16(text, true),
            [vec![0xff, 0xfe], utf16(text, false)].concat(),
            [vec![0xfe, 0xff], utf16(text, true)].concat(),
        ] {
            assert_eq!(decoded(path, bytes).unwrap(), text);
        }
        let error = |bytes: &[u8]| decoded(path, bytes.to_vec()).unwrap_err().to_string();
        assert!(error(b"<svg id=\"wei\xdf\"/>").contains("bytes that are not UTF-8"));
        assert!(error(b"<?xml version='1.0' encoding='cp037'?><svg/>").contains("`cp037` is unknown"));
    }
}
