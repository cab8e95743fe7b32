//! The device ID that the bridge shows to an operating system: the printer's own, as soon as it is known.

use heapless::Vec;

/// The longest device ID, its two length bytes included.
pub const DEVICE_ID_MAX: usize = 512;

/// What is shown until the printer has told its own. Any driver for the printer matches it.
const UNHEARD: &[u8] =
    b"MANUFACTURER:ALPS;COMMAND SET:RGL;MODEL:MD-5500;CLASS:PRINTER;DESCRIPTION:Foilpress bridge, printer not heard yet;";

/// A device ID as GET_DEVICE_ID returns it: its length in two bytes, high byte first, and text.
pub struct DeviceId(Vec<u8, DEVICE_ID_MAX>);

impl DeviceId {
    /// That of a printer that has not been heard.
    pub fn new() -> Self {
        let mut id = DeviceId(Vec::new());
        id.forget();
        id
    }

    /// Takes over what the printer has answered, with or without length bytes in front. Returns false, and changes nothing,
    /// if that is no device ID.
    ///
    /// The length is not believed, since printers send it wrong; the text ends before the first byte that cannot be
    /// printed. What does not fit [`DEVICE_ID_MAX`] is cut off.
    pub fn learn(&mut self, answer: &[u8]) -> bool {
        // The high byte of a length is below a space, and no text begins with such a byte.
        let text = match answer {
            [high, _, rest @ ..] if *high < b' ' => rest,
            text => text,
        };
        let printable = |byte: &u8| byte.is_ascii_graphic() || *byte == b' ';
        let end = text.iter().position(|byte| !printable(byte)).unwrap_or(text.len());
        let text = &text[..end.min(DEVICE_ID_MAX - 2)];
        if !text.contains(&b':') {
            return false;
        }
        // At most DEVICE_ID_MAX, so it fits both the two bytes and the room.
        #[expect(clippy::cast_possible_truncation, reason = "at most DEVICE_ID_MAX")]
        let length = (text.len() + 2) as u16;
        self.0.clear();
        self.0.extend_from_slice(&length.to_be_bytes()).is_ok() && self.0.extend_from_slice(text).is_ok()
    }

    /// The printer was switched off, and may be another one from now on.
    pub fn forget(&mut self) {
        self.learn(UNHEARD);
    }

    /// The answer to GET_DEVICE_ID.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl Default for DeviceId {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::String;
    use std::vec;

    fn text(id: &DeviceId) -> String {
        String::from_utf8(id.bytes()[2..].to_vec()).unwrap()
    }

    proptest! {
        #[test]
        fn whatever_a_printer_answers_the_device_id_is_well_formed(
            answer in prop_oneof![
                prop::collection::vec(any::<u8>(), 0..700),
                "[ -~]{0,600}".prop_map(String::into_bytes),
            ],
            prefix in prop::collection::vec(0u8..40, 0..3),
        ) {
            let mut id = DeviceId::new();
            let before = id.bytes().to_vec();
            let learned = id.learn(&[prefix, answer].concat());
            let bytes = id.bytes();
            prop_assert!(learned || bytes == before);
            prop_assert!(bytes.len() <= 512);
            prop_assert_eq!(usize::from(u16::from_be_bytes([bytes[0], bytes[1]])), bytes.len());
            prop_assert!(bytes[2..].iter().all(|byte| (b' '..=b'~').contains(byte)));
            prop_assert!(bytes[2..].contains(&b':'));
        }
    }

    #[test]
    fn the_length_is_counted_anew_whatever_the_printer_says_it_is() {
        for prefix in [&b""[..], b"\x00\x0c", b"\x0c\x00", b"\x01\xff"] {
            let mut id = DeviceId::new();
            assert!(id.learn(&[prefix, b"MFG:ALPS;MDL:MD-5000;\0\xff garbage"].concat()));
            assert_eq!(id.bytes(), b"\x00\x17MFG:ALPS;MDL:MD-5000;");
        }
    }

    #[test]
    fn a_truncated_id_is_kept_as_far_as_it_came_and_an_oversized_one_is_cut() {
        let mut id = DeviceId::new();
        assert!(id.learn(b"\x00\x40MFG:AL"));
        assert_eq!(text(&id), "MFG:AL");
        let long = [&b"MFG:"[..], &vec![b'A'; 2000]].concat();
        assert!(id.learn(&long));
        assert_eq!(id.bytes().len(), 512);
        assert_eq!(id.bytes()[..2], [2, 0]);
        assert_eq!(id.bytes()[2..], long[..510]);
    }

    #[test]
    fn what_is_no_device_id_changes_nothing_and_forgetting_goes_back_to_the_description() {
        let mut id = DeviceId::new();
        let unheard = id.bytes().to_vec();
        assert!(id.learn(b"MFG:ALPS;"));
        for nonsense in [&b""[..], b"\x00", b"\x00\x02", b"\x00\x10\xff\xff:", b"no colon", b"\x02\x80MFG"] {
            assert!(!id.learn(nonsense), "{nonsense:?}");
        }
        assert_eq!(text(&id), "MFG:ALPS;");
        id.forget();
        assert_eq!(id.bytes(), unheard);
    }
}
