//! Text as a terminal may show it.
//!
//! Problem: names, descriptions and answers come from files and devices of unknown origin. A control character in one of them
//! sets the terminal's title, writes to its clipboard or hides a line; a mark that changes the direction of text makes a name
//! read as another.
//! Method: each such character is written as the escape `\u001b`, which is also how it stands in a JSON string. JSON therefore
//! keeps its meaning.
//! Limits: characters that only look alike are left as they are.

use std::borrow::Cow;

/// Whether a character does something to a terminal other than to appear where it stands.
///
/// These are the control characters (C0, DEL, C1), the separators of lines and paragraphs, and the controls of bidirectional
/// text (Unicode Standard Annex 9, section 2). All of them have four hexadecimal digits.
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, acts: impl Fn(char) -> bool) -> Cow<'_, str> {
    let Some(first) = text.find(&acts) else { return Cow::Borrowed(text) };
    let mut safe = String::with_capacity(text.len() + 16);
    safe.push_str(&text[..first]);
    for c in text[first..].chars() {
        match c {
            '\t' => safe.push(' '),
            c if acts(c) => safe.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => safe.push(c),
        }
    }
    Cow::Owned(safe)
}

/// The text with an escape for each character that would act on a terminal. Line breaks stay, and a tab becomes a blank.
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    escaped(text, |c| acts(c) && c != '\n')
}

/// The same in one line, for a name that stands in a line with other text: a line break becomes an escape, too.
#[must_use]
pub fn visible_line(text: &str) -> Cow<'_, str> {
    escaped(text, acts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_on_a_terminal_is_escaped_and_everything_else_stays() {
        for (text, shown) in [
            ("plain, été, 日本, שלום", "plain, été, 日本, שלום"),
            ("\u{1b}[31mred\u{7}", "\\u001b[31mred\\u0007"),
            ("\u{9b}31m \u{7f}", "\\u009b31m \\u007f"),
            ("gnp.\u{202e}exe", "gnp.\\u202eexe"),
            ("\u{2066}a\u{2069}\u{200f}\u{61c}", "\\u2066a\\u2069\\u200f\\u061c"),
            ("a\r\n\tb", "a\\u000d\n b"),
        ] {
            assert_eq!(visible(text), shown);
        }
        assert_eq!(visible_line("a\nfoilpress: all is well"), "a\\u000afoilpress: all is well");
    }
}
