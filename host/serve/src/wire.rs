//! IPP messages: the request before its document, and the answer.
//!
//! Problem: whoever reaches the port may send anything, and the document behind a request must not be read into memory. Method:
//! [`head`] walks over the bytes that have come, without copying, and says where the attributes end, that more is needed, or that
//! this is no IPP: every length, the bytes of every fixed type, the two strings inside a text with its language, the nesting of
//! collections. Only what it has passed goes to the parser of the `ipp` crate, which relies on some of that.
//! Cost: a walk over at most [`MOST`] bytes for each piece that arrives.
//! Limits: 256 KB of attributes, collections in eight levels, at most 4,096 values.
//! Source: RFC 8010, section 3; RFC 8011, section 4.1.

use std::io::Cursor;
use std::net::IpAddr;

use ipp::attribute::{IppAttribute, IppAttributes};
use ipp::model::{DelimiterTag, IppVersion, StatusCode};
use ipp::parser::IppParser;
use ipp::prelude::IppHeader;
use ipp::reader::IppReader;
use ipp::value::IppValue;

use crate::values::{charset, language, text};

/// The most bytes of a request before its document.
pub const MOST: usize = 256 << 10;
/// The deepest nesting of collections.
const DEEPEST: usize = 8;
/// The most values of a request.
const MOST_VALUES: usize = 4096;
/// Version, operation and number of a request.
const HEADER: usize = 8;

/// The operations there are, with their codes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(i16)]
pub enum Operation {
    /// A job with its document.
    PrintJob = 0x02,
    /// Whether a job would be taken.
    ValidateJob = 0x04,
    /// A job without its document.
    CreateJob = 0x05,
    /// The document of a job.
    SendDocument = 0x06,
    /// A job ends.
    CancelJob = 0x08,
    /// What is known of a job.
    GetJobAttributes = 0x09,
    /// All jobs.
    GetJobs = 0x0a,
    /// What is known of a printer.
    GetPrinterAttributes = 0x0b,
    /// A job waits until it is released.
    HoldJob = 0x0c,
    /// It does not wait any more.
    ReleaseJob = 0x0d,
    /// Jobs of anybody end.
    CancelJobs = 0x38,
    /// Jobs of whoever asks end.
    CancelMyJobs = 0x39,
    /// A job has all its documents.
    CloseJob = 0x3b,
    /// The printer shows which it is.
    IdentifyPrinter = 0x3c,
}

impl Operation {
    /// All of them.
    pub const ALL: [Operation; 14] = [
        Operation::PrintJob,
        Operation::ValidateJob,
        Operation::CreateJob,
        Operation::SendDocument,
        Operation::CancelJob,
        Operation::GetJobAttributes,
        Operation::GetJobs,
        Operation::GetPrinterAttributes,
        Operation::HoldJob,
        Operation::ReleaseJob,
        Operation::CancelJobs,
        Operation::CancelMyJobs,
        Operation::CloseJob,
        Operation::IdentifyPrinter,
    ];

    /// The code in a request.
    #[must_use]
    pub const fn code(self) -> i16 {
        self as i16
    }

    /// The operation of a request.
    #[must_use]
    pub fn of(code: i16) -> Option<Operation> {
        Operation::ALL.into_iter().find(|known| known.code() == code)
    }
}

/// Where a request came in.
#[derive(Clone, Debug)]
pub struct Place {
    /// The host and port the client has called, for the addresses in answers.
    pub host: String,
    /// Whether the connection is encrypted.
    pub is_encrypted: bool,
    /// The printer's name in the path; empty for none.
    pub printer: String,
    /// Where the client is.
    pub from: IpAddr,
    /// Whether it is this computer, or knows the code.
    pub is_keeper: bool,
}

impl Place {
    /// The address of a printer.
    pub fn printer(&self, name: &str) -> String {
        self.as_scheme(if self.is_encrypted { "ipps" } else { "ipp" }, name)
    }

    /// The same with or without encryption.
    pub fn as_scheme(&self, scheme: &str, name: &str) -> String {
        format!("{scheme}://{}/ipp/print/{name}", self.host)
    }

    /// The address of a page.
    pub fn page(&self, path: &str) -> String {
        let scheme = if self.is_encrypted { "https" } else { "http" };
        format!("{scheme}://{}/{path}", self.host)
    }
}

/// Bytes that are no IPP request.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("byte {at} of the request: {what}")]
pub struct Malformed {
    /// Where.
    pub at: usize,
    /// What is wrong.
    pub what: &'static str,
}

/// A place in the bytes of a request.
struct Walk<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Walk<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number(&mut self) -> Option<usize> {
        let two = self.take(2)?;
        Some(usize::from(u16::from_be_bytes([two[0], two[1]])))
    }

    fn string(&mut self) -> Option<&'a [u8]> {
        let length = self.number()?;
        self.take(length)
    }
}

/// Where the attributes of a request end; `None` if more bytes are needed.
///
/// # Errors
/// No request begins like this.
pub fn head(bytes: &[u8]) -> Result<Option<usize>, Malformed> {
    let mut walk = Walk { bytes, at: HEADER };
    if bytes.len() < HEADER {
        return Ok(None);
    }
    let (mut depth, mut values) = (0usize, 0usize);
    loop {
        let at = walk.at;
        let wrong = |what| Malformed { at, what };
        if at > MOST || values > MOST_VALUES {
            return Err(wrong("too many attributes"));
        }
        let Some(tag) = walk.take(1) else { return Ok(None) };
        let tag = tag[0];
        match tag {
            0x01..=0x0a if depth > 0 => return Err(wrong("a group begins inside a collection")),
            0x03 => return Ok(Some(walk.at)),
            0x01..=0x0a => continue,
            0x10..=0x4a => {}
            _ => return Err(wrong("no tag of a group or a value")),
        }
        values += 1;
        let (Some(name), Some(value)) = (walk.string(), walk.string()) else { return Ok(None) };
        let fits = match tag {
            0x21 | 0x23 => value.len() == 4,
            0x22 => value.len() == 1,
            0x31 => value.len() == 11,
            0x32 => value.len() == 9,
            0x33 => value.len() == 8,
            0x34 | 0x37 => value.is_empty(),
            0x35 | 0x36 => {
                let mut inner = Walk { bytes: value, at: 0 };
                inner.string().is_some() && inner.string().is_some() && inner.at == value.len()
            }
            _ => true,
        };
        if !fits {
            return Err(wrong("a value of the wrong length"));
        }
        if depth > 0 && !name.is_empty() {
            return Err(wrong("a name inside a collection"));
        }
        match tag {
            0x34 if depth == DEEPEST => return Err(wrong("collections nested too deeply")),
            0x34 => depth += 1,
            0x37 => {
                depth = depth
                    .checked_sub(1)
                    .ok_or_else(|| wrong("the end of a collection that did not begin"))?;
            }
            _ => {}
        }
    }
}

/// A request without its document.
pub struct Request {
    /// Version, operation, number.
    pub header: IppHeader,
    attributes: IppAttributes,
}

/// Why a request is not answered with more than a status.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{what}")]
pub struct Refused {
    /// The status.
    pub status: StatusCode,
    /// Why, for people.
    pub what: &'static str,
}

impl Request {
    /// Reads the bytes that [`head`] has passed.
    ///
    /// # Errors
    /// What the parser does not take after all, such as a name that is too long.
    pub fn read(bytes: Vec<u8>) -> Result<Request, Malformed> {
        let parser = IppParser::new(IppReader::new(Cursor::new(bytes)));
        match parser.parse_parts() {
            Ok((header, attributes, _)) => Ok(Request { header, attributes }),
            Err(_) => {
                Err(Malformed { at: HEADER, what: "an attribute that is too long or of no known kind" })
            }
        }
    }

    /// Whether the request is one that can be answered: its version, its number, and what it has to begin with.
    ///
    /// # Errors
    /// Which status it gets instead.
    pub fn check(&self) -> Result<(), Refused> {
        let bad = |what| Refused { status: StatusCode::ClientErrorBadRequest, what };
        if !matches!(self.header.version.0 >> 8, 1 | 2) {
            let status = StatusCode::ServerErrorVersionNotSupported;
            return Err(Refused { status, what: "versions 1.1 and 2.0 are supported" });
        }
        if self.header.request_id < 1 {
            return Err(bad("the number of a request is at least 1"));
        }
        let first = self.attributes.groups().first();
        let operation = first
            .filter(|group| group.tag() == DelimiterTag::OperationAttributes)
            .map_or(&[][..], |group| group.attributes());
        let [charset, language, ..] = operation else {
            return Err(bad("the operation attributes are missing"));
        };
        if charset.name().as_str() != "attributes-charset"
            || language.name().as_str() != "attributes-natural-language"
        {
            return Err(bad("the request does not begin with its charset and its language"));
        }
        let known = |name: &str| ["utf-8", "us-ascii"].iter().any(|known| name.eq_ignore_ascii_case(known));
        match charset.value() {
            IppValue::Charset(name) if known(name) => {}
            IppValue::Charset(_) => {
                let status = StatusCode::ClientErrorCharsetNotSupported;
                return Err(Refused { status, what: "the charset is utf-8" });
            }
            _ => return Err(bad("the charset is of another kind")),
        }
        if !matches!(language.value(), IppValue::NaturalLanguage(_)) {
            return Err(bad("the language is of another kind"));
        }
        let is_twice = |attributes: &[IppAttribute]| {
            let mut names: Vec<&str> = attributes.iter().map(|a| a.name().as_str()).collect();
            names.sort_unstable();
            names.windows(2).any(|two| two[0] == two[1])
        };
        match self.attributes.groups().iter().any(|group| is_twice(group.attributes())) {
            true => Err(bad("an attribute is there twice")),
            false => Ok(()),
        }
    }

    fn group(&self, tag: DelimiterTag) -> impl Iterator<Item = &IppAttribute> {
        self.attributes.groups_of(tag).flat_map(|group| group.attributes())
    }

    /// An operation attribute.
    pub fn operation(&self, name: &str) -> Option<&IppValue> {
        self.group(DelimiterTag::OperationAttributes)
            .find(|a| a.name().as_str() == name)
            .map(IppAttribute::value)
    }

    /// The attributes that a job is to have.
    pub fn job(&self) -> impl Iterator<Item = &IppAttribute> {
        self.group(DelimiterTag::JobAttributes)
    }
}

/// An answer.
pub struct Response {
    version: IppVersion,
    status: StatusCode,
    id: i32,
    attributes: IppAttributes,
}

impl Response {
    /// An answer to a request with this header.
    pub fn new(to: &IppHeader, status: StatusCode) -> Response {
        let version = match to.version.0 >> 8 {
            1 | 2 => to.version,
            _ => IppVersion::v2_0(),
        };
        let mut attributes = IppAttributes::new();
        for (name, value) in
            [("attributes-charset", charset("utf-8")), ("attributes-natural-language", language("en"))]
        {
            put(&mut attributes, DelimiterTag::OperationAttributes, name, value);
        }
        Response { version, status, id: to.request_id, attributes }
    }

    /// The same with a word for people.
    #[must_use]
    pub fn saying(mut self, words: &str) -> Response {
        self.add(DelimiterTag::OperationAttributes, "status-message", text(words));
        self
    }

    /// Adds an attribute to the last group of this kind.
    pub fn add(&mut self, tag: DelimiterTag, name: &str, value: IppValue) {
        put(&mut self.attributes, tag, name, value);
    }

    /// Begins another group of a kind, as for the next of several jobs.
    pub fn begin(&mut self, tag: DelimiterTag) {
        self.attributes.groups_mut().push(ipp::attribute::IppAttributeGroup::new(tag));
    }

    /// Changes the status.
    pub fn set_status(&mut self, status: StatusCode) {
        self.status = status;
    }

    /// The bytes.
    pub fn bytes(&self) -> Vec<u8> {
        // The codes of statuses fit: the type says so.
        let header = IppHeader::new(self.version, self.status as i16, self.id);
        [&header.to_bytes()[..], &self.attributes.to_bytes()].concat()
    }
}

fn put(attributes: &mut IppAttributes, tag: DelimiterTag, name: &str, value: IppValue) {
    // Names are this program's own, and short; one that is not would be left out.
    let Ok(attribute) = IppAttribute::with_name(name, value) else { return };
    match attributes.groups_mut().iter_mut().rev().find(|group| group.tag() == tag) {
        Some(group) => group.attributes_mut().push(attribute),
        None => attributes.add(tag, attribute),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use testing::ipp::{Attribute, message};

    fn request(attributes: &[Attribute<'_>]) -> Vec<u8> {
        message(11, &[(1, attributes)])
    }

    const BEGIN: [Attribute<'_>; 2] =
        [(0x47, "attributes-charset", b"utf-8"), (0x48, "attributes-natural-language", b"en")];

    #[test]
    fn the_end_of_the_attributes_is_found_wherever_the_bytes_are_cut() {
        let mut attributes = BEGIN.to_vec();
        attributes.push((0x34, "media-col", b""));
        attributes.push((0x4a, "", b"media-type"));
        attributes.push((0x44, "", b"stationery"));
        attributes.push((0x37, "", b""));
        let bytes = request(&attributes);
        let whole = [&bytes[..], b"%PDF-1.4 and more"].concat();
        assert_eq!(head(&whole), Ok(Some(bytes.len())));
        for cut in 0..bytes.len() {
            assert_eq!(head(&whole[..cut]), Ok(None), "{cut}");
        }
        let read = Request::read(bytes).unwrap();
        assert_eq!(read.check(), Ok(()));
        assert!(matches!(read.operation("media-col"), Some(IppValue::Collection(_))));
    }

    #[test]
    fn what_would_make_a_parser_stumble_is_refused_before_it() {
        for wrong in [
            (0x21, "copies", &b"\0\0\x01"[..]),
            (0x35, "x", b"\0\x02en\0\x09short"),
            (0x36, "x", b"\0"),
            (0x37, "", b""),
            (0x7f, "x", b"1234"),
            (0x22, "b", b""),
        ] {
            assert!(head(&request(&[wrong])).is_err(), "{wrong:?}");
        }
        let deep: Vec<Attribute<'_>> =
            (0..20).map(|level| (0x34, if level == 0 { "c" } else { "" }, &b""[..])).collect();
        assert!(head(&request(&deep)).is_err());
        let many = vec![(0x44, "a", &b"b"[..]); MOST_VALUES + 2];
        assert!(head(&request(&many)).is_err());
    }

    #[test]
    fn what_a_request_lacks_decides_its_status() {
        let status = |bytes: Vec<u8>| Request::read(bytes).unwrap().check().map_err(|refused| refused.status);
        assert_eq!(status(request(&BEGIN)), Ok(()));
        assert_eq!(status(request(&BEGIN[..1])), Err(StatusCode::ClientErrorBadRequest));
        assert_eq!(status(request(&[BEGIN[1], BEGIN[0]])), Err(StatusCode::ClientErrorBadRequest));
        let latin = (0x47, "attributes-charset", &b"latin-1"[..]);
        assert_eq!(status(request(&[latin, BEGIN[1]])), Err(StatusCode::ClientErrorCharsetNotSupported));
        let mut zero = request(&BEGIN);
        zero[7] = 0;
        assert_eq!(status(zero), Err(StatusCode::ClientErrorBadRequest));
        let mut old = request(&BEGIN);
        old[0] = 0;
        assert_eq!(status(old), Err(StatusCode::ServerErrorVersionNotSupported));
    }

    proptest! {
        /// Nothing that the walk passes makes the parser panic, and the walk reads no further than it says.
        #[test]
        fn no_bytes_make_it_fail(bytes in prop::collection::vec(any::<u8>(), 0..400), seed in 0usize..6) {
            let starts: [&[u8]; 6] = [&[], &[2, 0, 0, 2, 0, 0, 0, 1, 1], &[1, 1, 0, 4, 0, 0, 0, 1, 1, 0x34, 0, 1, 99, 0, 0],
                &[2, 0, 0, 2, 0, 0, 0, 1, 1, 0x35, 0, 1, 99], &[2, 0, 0, 2, 0, 0, 0, 1, 2], &[2, 0, 0, 2, 0, 0, 0, 1, 1, 0x36]];
            let mut message = starts[seed].to_vec();
            message.extend(bytes);
            message.push(3);
            if let Ok(Some(end)) = head(&message) {
                prop_assert!(end <= message.len());
                prop_assert_eq!(head(&message[..end]), Ok(Some(end)));
                if let Ok(request) = Request::read(message[..end].to_vec()) {
                    let _ = request.check();
                    let _ = request.job().count();
                }
            }
        }

        /// An answer is a message that the walk passes, and comes back as what was put in.
        #[test]
        fn an_answer_can_be_read(words in "[ -~]{1,300}", number in any::<i32>()) {
            let header = IppHeader::new(IppVersion::v2_0(), 11, 5);
            let mut answer = Response::new(&header, StatusCode::SuccessfulOk).saying(&words);
            answer.add(DelimiterTag::PrinterAttributes, "copies-default", IppValue::Integer(number));
            let bytes = answer.bytes();
            prop_assert_eq!(head(&bytes), Ok(Some(bytes.len())));
            let read = Request::read(bytes).unwrap();
            let copies = read.group(DelimiterTag::PrinterAttributes).next().unwrap();
            prop_assert_eq!(copies.value(), &IppValue::Integer(number));
        }
    }
}
