//! Style sheets and styles of a drawing, taken apart into rules and declarations.
//!
//! Problem: the renderer's reader of style sheets skips whatever it does not know, media rules among them, and ends a style at
//! the first slip. It tells nobody.
//! Method: text is cut where brackets and quotes are closed, as CSS defines its recovery from errors. Rules for print, for any
//! medium and for a light page count; others are for another page, or not understood. `simplecss` reads the selectors. Cost: a
//! pass over the text for each level of media rules, of which there are at most [`MOST_DEEP`]. Limits: rules within rules,
//! layers of rules and escapes in names are not understood.
//! Source: CSS Syntax 3, Media Queries 4.

use std::borrow::Cow;

use simplecss::{AttributeOperator, Element, PseudoClass, Selector};

use super::nodes::Node;

/// How deep media rules may lie in each other, so that hostile sheets do not fill the stack.
const MOST_DEEP: usize = 8;

/// The longest selector that is read: a reader without bounds calls itself for each part.
const MOST_SELECTOR: usize = 1024;

/// What stands for `:root`, which `simplecss` does not know, with the same weight.
const ROOT: &str = "[foilpress-root]";

/// A declaration.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Declaration<'a> {
    pub name: &'a str,
    pub value: &'a str,
    pub important: bool,
}

/// A rule of a style sheet.
pub(super) struct Rule<'a> {
    selector: Selector<'a>,
    pub declarations: Vec<Declaration<'a>>,
}

impl Rule<'_> {
    /// Whether it is for this element.
    pub fn is_for(&self, node: Node<'_, '_>) -> bool {
        self.selector.matches(&Matched(node))
    }
}

/// Text of CSS without comments, with what `simplecss` reads as `:root`.
pub(super) fn plain(text: &str) -> Cow<'_, str> {
    if !text.contains("/*") && !text.contains(":root") {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(['"', '\'', '/']) {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let len = match rest.strip_prefix("/*") {
            Some(comment) => {
                out.push(' ');
                rest = comment.split_once("*/").map_or("", |(_, after)| after);
                continue;
            }
            None if rest.starts_with('/') => 1,
            None => quoted(rest),
        };
        out.push_str(&rest[..len]);
        rest = &rest[len..];
    }
    out.push_str(rest);
    Cow::Owned(out.replace(":root", ROOT))
}

/// The length of a quoted text with its quotes.
fn quoted(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut at = 1;
    while at < bytes.len() && bytes[at] != bytes[0] {
        at += 1 + usize::from(bytes[at] == b'\\');
    }
    // An escape may hide the first byte of a longer letter.
    (at + 1..)
        .find(|at| *at >= text.len() || text.is_char_boundary(*at))
        .unwrap_or(text.len())
        .min(text.len())
}

/// Where one of `ends` stands outside of brackets and quotes; the length of the text if nowhere.
fn end(text: &str, ends: &[u8]) -> usize {
    let bytes = text.as_bytes();
    let (mut at, mut deep) = (0, 0_usize);
    while at < bytes.len() {
        match bytes[at] {
            byte if deep == 0 && ends.contains(&byte) => return at,
            b'"' | b'\'' => at += quoted(&text[at..]) - 1,
            b'(' | b'[' | b'{' => deep += 1,
            b')' | b']' | b'}' => deep = deep.saturating_sub(1),
            _ => {}
        }
        at += 1;
    }
    text.len()
}

/// The parts of a text between these bytes outside of brackets and quotes.
pub(super) fn parts(text: &str, between: u8) -> impl Iterator<Item = &str> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let text = rest?;
        let at = end(text, &[between]);
        rest = text.get(at + 1..);
        Some(text[..at].trim())
    })
}

/// What stands before the bracket that closes, and what follows it.
pub(super) fn closed(text: &str, close: u8) -> (&str, &str) {
    let at = end(text, &[close]);
    (&text[..at], text.get(at + 1..).unwrap_or_default())
}

/// Whether a value ends where it ends: its brackets and quotes are closed, and no other declaration is in it.
pub(super) fn is_whole(value: &str) -> bool {
    end(&format!("{value};"), b";") == value.len()
}

/// The declarations of a style or a rule; what is none is left out, and `tell` hears of rules within.
pub(super) fn declarations<'a>(text: &'a str, tell: &mut dyn FnMut(&'a str)) -> Vec<Declaration<'a>> {
    let mut found = Vec::new();
    for part in parts(text, b';') {
        let Some((name, value)) = part.split_once(':') else { continue };
        let name = name.trim_end();
        let letter = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte) || !byte.is_ascii();
        if name.is_empty() || !name.bytes().all(letter) {
            if part.contains('{') {
                tell(part);
            }
            continue;
        }
        let plain = value.rsplit_once('!').filter(|(_, word)| word.trim().eq_ignore_ascii_case("important"));
        let important = plain.is_some();
        found.push(Declaration { name, value: plain.map_or(value, |(value, _)| value).trim(), important });
    }
    found
}

/// The rules of style sheets, those that weigh more last. `tell` hears of what is not understood.
pub(super) fn rules<'a>(sheets: &'a [Cow<'_, str>], mut tell: impl FnMut(&'a str)) -> Vec<Rule<'a>> {
    let mut rules = Vec::new();
    let mut waiting: Vec<&str> = sheets.iter().rev().map(AsRef::as_ref).collect();
    let mut deep = vec![0; waiting.len()];
    while let (Some(text), Some(level)) = (waiting.pop(), deep.pop()) {
        let text = text.trim_start_matches(|c: char| c.is_whitespace() || c == '}');
        if text.is_empty() {
            continue;
        }
        let at = end(text, b"{;");
        let head = text[..at].trim();
        let (body, after) = match text.as_bytes().get(at) {
            Some(b'{') => closed(&text[at + 1..], b'}'),
            _ => ("", text.get(at + 1..).unwrap_or_default()),
        };
        waiting.push(after);
        deep.push(level);
        if let Some(query) = head.strip_prefix("@media") {
            match is_for_print(query) {
                Some(true) if level < MOST_DEEP => {
                    waiting.push(body);
                    deep.push(level + 1);
                }
                Some(false) => {}
                _ => tell(head),
            }
            continue;
        }
        if let Some(name) = head.strip_prefix('@') {
            // None of these says what a drawing looks like; missing fonts have a note of their own.
            let silent =
                ["font-face", "charset", "namespace", "page", "keyframes", "-webkit-keyframes", "property"];
            if !silent.contains(&name.split_whitespace().next().unwrap_or_default()) {
                tell(head);
            }
            continue;
        }
        let said = declarations(body, &mut tell);
        for selector in parts(head, b',').filter(|_| !said.is_empty()) {
            match Selector::parse(selector).filter(|_| selector.len() <= MOST_SELECTOR) {
                Some(selector) => rules.push(Rule { selector, declarations: said.clone() }),
                // What follows a pointer or a selection is not on paper.
                None if ["::", ":hover", ":focus", ":active"].iter().any(|part| selector.contains(part)) => {}
                None => tell(selector),
            }
        }
    }
    rules.sort_by_key(|rule| rule.selector.specificity());
    rules
}

/// Whether a media query holds for a page of print; `None` if it is not understood.
pub(super) fn is_for_print(query: &str) -> Option<bool> {
    let one = |query: &str| {
        let words = query.to_ascii_lowercase().replace(": ", ":");
        let mut all = Some(true);
        for word in words.split(" and ") {
            match word.trim().trim_start_matches("only ").trim() {
                "" | "all" | "print" | "(prefers-color-scheme:light)" => {}
                "screen" | "speech" | "(prefers-color-scheme:dark)" | "(hover:hover)" => return Some(false),
                _ => all = None,
            }
        }
        all
    };
    let found: Vec<_> = parts(query, b',').map(one).collect();
    if found.contains(&Some(true)) {
        Some(true)
    } else {
        found.into_iter().collect::<Option<Vec<_>>>().map(|_| false)
    }
}

/// An element as `simplecss` looks at it.
struct Matched<'a, 'i>(Node<'a, 'i>);

impl Element for Matched<'_, '_> {
    fn parent_element(&self) -> Option<Self> {
        self.0.parent_element().map(Matched)
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.0.prev_sibling_element().map(Matched)
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        match self.0.attribute(name) {
            Some(value) => operator.matches(value),
            None => Some(name) == ROOT.get(1..ROOT.len() - 1) && self.0.parent_element().is_none(),
        }
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        class == PseudoClass::FirstChild && self.0.prev_sibling_element().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str) -> Vec<(String, bool)> {
        let found = declarations(text, &mut |_| {});
        found.iter().map(|d| (format!("{}={}", d.name, d.value), d.important)).collect()
    }

    #[test]
    fn a_slip_ends_no_style() {
        let text =
            "fill: red;; *zoom:1; stroke ; a{b:c}; x: url(data:a;b) '; (' ; Stroke:blue ! IMPORTANT; --a:(";
        let plain = |text: &str| (text.to_owned(), false);
        assert_eq!(
            said(text),
            [plain("fill=red"), plain("x=url(data:a;b) '; ('"), ("Stroke=blue".into(), true), plain("--a=(")]
        );
        assert_eq!(plain_of("a/* ; */b '/* no */' :root /* open"), "a b '/* no */' [foilpress-root]  ");
    }

    fn plain_of(text: &str) -> String {
        plain(text).into_owned()
    }

    #[test]
    fn rules_are_those_for_print_and_others_are_told() {
        let sheet = "@charset 'x'; .a{fill:red} @media print and (prefers-color-scheme: light), speech {b, #c > d{x:1}}
            @media screen{e{x:2}} @media (min-width:3px){f{x:3}} g:nth-child(2){x:4} h::after{x:5} @import 'u';
            :root{--v:1} }} i{}";
        let sheets = [plain(sheet)];
        let mut told = Vec::new();
        let rules = rules(&sheets, |part| told.push(part));
        let found: Vec<String> = rules.iter().map(|rule| rule.selector.to_string()).collect();
        assert_eq!(found, ["b", "*[class~='a']", "*[foilpress-root]", "*[id='c'] > d"]);
        assert_eq!(told, ["@media (min-width:3px)", "g:nth-child(2)", "@import 'u'"]);
    }

    #[test]
    fn any_text_ends() {
        for text in [
            "{",
            "}",
            "@",
            "@media print{".repeat(2000).as_str(),
            "a{'",
            "\\",
            "'\\",
            "'\\ß",
            "[[",
            "a,,b{x:1}",
        ] {
            let sheets = [plain(text)];
            rules(&sheets, |_| {});
            said(text);
        }
    }
}
