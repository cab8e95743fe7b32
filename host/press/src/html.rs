//! The frame of every page that the program writes.
//!
//! Problem: pages hold names from files of unknown origin, open from a disk, and should look like one program's.
//! Method: one head, which says language, width and what the page may load: nothing but pictures beside it and within it; text is
//! escaped. Pages that are read ([`read`]) share a style: text and tables in the light or dark colours that the reader's system asks
//! for, pictures on their own ground, and always light on paper. Pages that work bring their own style to [`head`].

/// The style of pages that are read.
const READ: &str = include_str!("read.css");

/// A page that is read: `title` as plain text, `style` as CSS for this kind of page, `body` as HTML that begins with the heading.
pub fn read(title: &str, style: &str, body: &str) -> String {
    format!("{}<body>\n<main>\n{body}</main>\n</body>\n</html>\n", head(title, &[READ, style]))
}

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

/// A badge that says that curves of inks are modelled, and what that means, where it is so.
pub fn modelled(words: Option<&str>) -> String {
    let badge = |words| {
        format!("<p><span class=\"badge\">modelled inks</span> <small>{}.</small></p>\n", escape(words))
    };
    words.map(badge).unwrap_or_default()
}

/// A drawing in SVG, which is one picture to who cannot see it; `what` says what it shows.
pub fn drawing(what: &str, svg: &str) -> String {
    format!("<figure role=\"img\" aria-label=\"{}\">{svg}</figure>", escape(what))
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
    use super::{escape, head, read};

    #[test]
    fn names_from_files_stay_text() {
        assert_eq!(escape("<b>\"a\" & 'c'\u{7}"), "&lt;b&gt;&quot;a&quot; &amp; &#39;c&#39; ");
        assert!(head("</title><script>", &[]).contains("<title>&lt;/title&gt;&lt;script&gt;</title>"));
    }

    #[test]
    fn pages_that_are_read_have_a_language_and_a_main_part() {
        let page = read("a title", "p{}", "<h1>A title</h1>\n");
        assert!(page.contains("<html lang=\"en\">") && page.contains("prefers-color-scheme: dark"), "{page}");
        assert!(page.ends_with("<body>\n<main>\n<h1>A title</h1>\n</main>\n</body>\n</html>\n"), "{page}");
    }
}
