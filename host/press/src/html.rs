//! The frame of every page that the program writes.
//!
//! Problem: pages hold names from files of unknown origin, open from a disk, and should look like one program's.
//! Method: one head, which says language, width and what the page may load: nothing but pictures beside it and within it; text is
//! escaped. [`READ`] is the style of pages that are read; pages that work bring their own.

/// The style of pages that are read: text, tables and plots on light paper.
pub const READ: &str = include_str!("read.css");

/// A page up to its body: `title` as plain text, `styles` as CSS, one after the other.
pub fn head(title: &str, styles: &[&str]) -> String {
    let (title, styles) = (escape(title), styles.concat());
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1, viewport-fit=cover\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src 'self' file: data:; \
         style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n<title>{title}</title>\n<style>\n{styles}</style>\n</head>\n"
    )
}

/// The beginning of a part that scrolls sideways where it is wider than the page, as tables are on a phone; `</div>` ends it.
/// `what` says what it is to who cannot see it, and keys reach it.
pub fn wide(what: &str) -> String {
    format!("<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"{}\">", escape(what))
}

/// Text as it stands in HTML, between tags and in quoted attributes. Control characters become spaces.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::{escape, head};

    #[test]
    fn names_from_files_stay_text() {
        assert_eq!(escape("<b>\"a\" & 'c'\u{7}"), "&lt;b&gt;&quot;a&quot; &amp; &#39;c&#39; ");
        assert!(head("</title><script>", &[]).contains("<title>&lt;/title&gt;&lt;script&gt;</title>"));
    }
}
