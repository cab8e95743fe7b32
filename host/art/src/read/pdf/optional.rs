//! The layers of a PDF (optional content): what they are named, and whether they are meant to be printed.
//!
//! Problem: Ghostscript draws what the document shows when it is opened, whatever a layer says of printing, and layers that are
//! named after inks are drawn in the colours of the screen. The owner of either hears nothing.
//! Method: the groups among the [objects](super::objects) of the document say their name and their state for printing. They become
//! notes. Cost: that of reading the objects. Limits: encrypted documents tell nothing. States are noted, not followed.
//! Source: ISO 32000-2, sections 8.11.2 and 8.11.4.4.

use std::path::Path;

use super::objects::{self, Object, entry, is_encrypted, reference, references};
use crate::read::names;

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
    let Ok(bytes) = objects::bytes(path) else { return Vec::new() };
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
    let has = |word: &[u8]| memchr::memmem::find(bytes, word).is_some();
    if is_encrypted(bytes) || !has(b"/OCG") && !has(b"/ObjStm") {
        return Vec::new();
    }
    let objects = objects::objects(bytes);
    let resolved = |value: &[u8]| -> Vec<u8> {
        let object = reference(value).and_then(|number| objects.get(&number));
        object.map_or_else(|| value.to_vec(), |object| object.text.clone())
    };
    let of = |dictionary: &[u8], key: &[u8]| entry(dictionary, key).map(|value| resolved(&value));
    // What is hidden is listed by reference in the default configuration.
    let configuration = objects.values().find_map(|object| {
        let properties = of(&object.text, b"/OCProperties")?;
        of(&properties, b"/D")
    });
    let hidden = configuration.and_then(|d| of(&d, b"/OFF")).unwrap_or_default();
    let hidden: Vec<u32> = references(&hidden);
    let is_group = |object: &Object| entry(&object.text, b"/Type").is_some_and(|kind| kind == b"/OCG");
    let groups = objects.iter().filter(|(_, object)| is_group(object));
    groups
        .filter_map(|(number, object)| {
            let state = of(&object.text, b"/Usage")
                .and_then(|usage| of(&usage, b"/Print"))
                .and_then(|print| of(&print, b"/PrintState"));
            Some(Group {
                name: text(&of(&object.text, b"/Name")?)?,
                shown: !hidden.contains(number),
                prints: state.map(|state| state == b"/ON"),
            })
        })
        .collect()
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
