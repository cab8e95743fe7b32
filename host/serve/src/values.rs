//! IPP values as this program makes and reads them.
//!
//! Texts are cut to what their kind may hold, at the border of a character. Control characters of a client's
//! text never get here: they are replaced where it is read ([`clean`]).

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use ipp::value::{BoundedString, IppDateTime, IppTextValue, IppValue};

/// The longest name in bytes.
const LONGEST_NAME: usize = 255;

fn fit<const MOST: usize>(text: &str) -> BoundedString<MOST> {
    let mut end = text.len().min(MOST);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    BoundedString::new_truncated(&text[..end])
}

/// A keyword.
pub fn keyword(word: &str) -> IppValue {
    IppValue::Keyword(fit(word))
}

/// Keywords.
pub fn keywords<'a>(words: impl IntoIterator<Item = &'a str>) -> IppValue {
    list(words.into_iter().map(keyword))
}

/// Several values; one is that value.
pub fn list(values: impl IntoIterator<Item = IppValue>) -> IppValue {
    let mut values: Vec<IppValue> = values.into_iter().collect();
    match values.len() {
        0 => IppValue::NoValue,
        1 => values.remove(0),
        _ => IppValue::Array(values),
    }
}

/// A text for people: at most 127 bytes, as the shortest kinds have.
pub fn text(words: &str) -> IppValue {
    IppValue::TextWithoutLanguage(IppTextValue::Short(fit(words)))
}

/// A longer text, at most 1023 bytes.
pub fn long_text(words: &str) -> IppValue {
    IppValue::TextWithoutLanguage(IppTextValue::Long(fit(words)).shrink())
}

/// A name.
pub fn name(words: &str) -> IppValue {
    IppValue::NameWithoutLanguage(fit(words))
}

/// An address.
pub fn uri(address: &str) -> IppValue {
    IppValue::Uri(fit(address))
}

/// A type of documents.
pub fn mime(kind: &str) -> IppValue {
    IppValue::MimeMediaType(fit(kind))
}

/// A charset.
pub fn charset(name: &str) -> IppValue {
    IppValue::Charset(fit(name))
}

/// A language.
pub fn language(name: &str) -> IppValue {
    IppValue::NaturalLanguage(fit(name))
}

/// A number; what does not fit is the largest one.
pub fn integer(number: impl TryInto<i32>) -> IppValue {
    IppValue::Integer(number.try_into().unwrap_or(i32::MAX))
}

/// Numbers from one to another.
pub fn range(min: i32, max: i32) -> IppValue {
    IppValue::RangeOfInteger { min, max }
}

/// Pixels per inch in both directions.
pub fn dpi(number: u16) -> IppValue {
    let number = i32::from(number);
    IppValue::Resolution { cross_feed: number, feed: number, units: 3 }
}

/// Bytes.
pub fn octets(text: &str) -> IppValue {
    IppValue::OctetString(Bytes::copy_from_slice(text.as_bytes()))
}

/// That a value is not known.
pub fn unknown() -> IppValue {
    IppValue::Other { tag: 0x12, data: Bytes::new() }
}

/// Members and their values.
pub fn collection<'a>(members: impl IntoIterator<Item = (&'a str, IppValue)>) -> IppValue {
    IppValue::Collection(members.into_iter().map(|(member, value)| (fit(member), value)).collect())
}

/// A moment, in seconds since 1970, as date and time in UTC.
pub fn date_time(seconds: u64) -> IppValue {
    let (days, second) = (seconds / 86400, seconds % 86400);
    let (year, month, day) = civil(days);
    let small = |number: u64| u8::try_from(number).unwrap_or(u8::MAX);
    IppValue::DateTime(IppDateTime {
        year: u16::try_from(year).unwrap_or(u16::MAX),
        month: small(month),
        day: small(day),
        hour: small(second / 3600),
        minutes: small(second / 60 % 60),
        seconds: small(second % 60),
        deci_seconds: 0,
        utc_dir: '+',
        utc_hours: 0,
        utc_mins: 0,
    })
}

/// Year, month and day of a day since 1970, in the Gregorian calendar. Years begin in March here, so that
/// leap days end them.
/// Source: H. Hinnant, "chrono-Compatible Low-Level Date Algorithms", `civil_from_days`.
fn civil(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * march + 2) / 5 + 1;
    let month = if march < 10 { march + 3 } else { march - 9 };
    (era * 400 + year + u64::from(month <= 2), month, day)
}

/// Now, in seconds since 1970.
pub fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs()
}

/// Characters of the category Cf, from and to: they are not seen, and change how others are. Source: Unicode
/// 16.0,
/// `DerivedGeneralCategory.txt`.
const FORMATS: [(char, char); 21] = [
    ('\u{ad}', '\u{ad}'),
    ('\u{600}', '\u{605}'),
    ('\u{61c}', '\u{61c}'),
    ('\u{6dd}', '\u{6dd}'),
    ('\u{70f}', '\u{70f}'),
    ('\u{890}', '\u{891}'),
    ('\u{8e2}', '\u{8e2}'),
    ('\u{180e}', '\u{180e}'),
    ('\u{200b}', '\u{200f}'),
    ('\u{202a}', '\u{202e}'),
    ('\u{2060}', '\u{2064}'),
    ('\u{2066}', '\u{206f}'),
    ('\u{feff}', '\u{feff}'),
    ('\u{fff9}', '\u{fffb}'),
    ('\u{110bd}', '\u{110bd}'),
    ('\u{110cd}', '\u{110cd}'),
    ('\u{13430}', '\u{1343f}'),
    ('\u{1bca0}', '\u{1bca3}'),
    ('\u{1d173}', '\u{1d17a}'),
    ('\u{e0001}', '\u{e0001}'),
    ('\u{e0020}', '\u{e007f}'),
];

/// Somebody's text with a blank for each control or format character.
pub fn clean(text: &str) -> String {
    let acts = |c: char| c.is_control() || FORMATS.iter().any(|(from, to)| (*from..=*to).contains(&c));
    text.chars().map(|c| if acts(c) { ' ' } else { c }).collect()
}

/// What a client calls something: the text of a value, [clean], at most 255 bytes.
pub fn read_text(value: &IppValue) -> Option<String> {
    let text = match value {
        IppValue::NameWithoutLanguage(name) | IppValue::NameWithLanguage { name, .. } => name.as_str(),
        IppValue::TextWithoutLanguage(text) | IppValue::TextWithLanguage { text, .. } => text.as_ref(),
        IppValue::Keyword(word) => word.as_str(),
        IppValue::MimeMediaType(kind) => kind.as_str(),
        IppValue::Uri(uri) => uri.as_str(),
        _ => return None,
    };
    let clean = clean(text);
    Some(fit::<LONGEST_NAME>(&clean).into_inner())
}

/// The values of an attribute, one after the other.
pub fn each(value: &IppValue) -> &[IppValue] {
    match value {
        IppValue::Array(values) => values,
        value => std::slice::from_ref(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn days_are_counted_as_in_the_calendar() {
        for (days, date) in
            [(0, (1970, 1, 1)), (59, (1970, 3, 1)), (11_016, (2000, 2, 29)), (20_785, (2026, 11, 28))]
        {
            assert_eq!(civil(days), date);
        }
    }

    #[test]
    fn what_is_not_seen_of_a_text_is_a_blank() {
        assert_eq!(clean("gnp.\u{202e}exe\u{feff}\u{7}\u{ad}é, שלום, 日本"), "gnp. exe   é, שלום, 日本");
    }

    proptest! {
        #[test]
        fn any_text_fits_and_is_whole_characters(words in ".{0,400}") {
            for value in [keyword(&words), text(&words), long_text(&words), name(&words), uri(&words)] {
                let kept = read_text(&value).unwrap();
                prop_assert!(kept.len() <= LONGEST_NAME);
                prop_assert!(clean(&words).starts_with(&kept));
            }
        }
    }
}
