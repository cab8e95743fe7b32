//! The text of a USD file as a tree of prims with their properties.
//!
//! Method: a scanner for the tokens of the format, and recursive descent over prims. Of values only what
//! materials need is kept: numbers, words, names of files, and paths to other properties; arrays,
//! dictionaries and samples over time are passed over.
//! Cost: the file as a tree. Limits: [`MOST_PRIMS`] prims and properties, [`DEEPEST`] levels, so that
//! hostile files end; variants are passed over, and what they hold is not there.
//! Source: the grammar of the text format in the documentation of OpenUSD 24.

use std::iter::Peekable;
use std::str::CharIndices;

/// The most prims and properties together: far more than any material.
const MOST_PRIMS: usize = 200_000;
/// The most levels of prims, and of brackets in values. Source: ten times as many as exporters write.
const DEEPEST: usize = 64;

/// A part of a scene.
#[derive(Debug, Default)]
pub(super) struct Prim {
    /// Its type, such as `Material`; empty if none is given.
    pub kind: String,
    /// Its name.
    pub name: String,
    pub properties: Vec<Property>,
    pub children: Vec<Prim>,
}

/// A property: its name, such as `inputs:roughness` or `inputs:roughness.connect`, and what it is set to.
#[derive(Debug)]
pub(super) struct Property {
    pub name: String,
    pub value: Value,
    pub line: usize,
}

/// What a property is set to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Numbers(Vec<f32>),
    /// A string or a token.
    Text(String),
    /// The name of a file.
    Asset(String),
    /// The path of another property.
    Path(String),
    /// Anything else, or nothing.
    Other,
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Text(String),
    Asset(String),
    Path(String),
    Sign(char),
}

/// What is wrong, and in which line.
pub(super) type Wrong = (usize, String);

struct Scanner<'t> {
    chars: Peekable<CharIndices<'t>>,
    text: &'t str,
    line: usize,
    ahead: Option<Token>,
}

impl<'t> Scanner<'t> {
    fn new(text: &'t str) -> Scanner<'t> {
        Scanner { chars: text.char_indices().peekable(), text, line: 1, ahead: None }
    }

    fn wrong<T>(&self, problem: impl Into<String>) -> Result<T, Wrong> {
        Err((self.line, problem.into()))
    }

    fn bump(&mut self) -> Option<char> {
        let (_, c) = self.chars.next()?;
        self.line += usize::from(c == '\n');
        Some(c)
    }

    /// Passes over as many characters as a mark has.
    fn skip(&mut self, mark: &str) {
        mark.chars().for_each(|_| {
            self.bump();
        });
    }

    /// What is left of the text.
    fn rest(&mut self) -> &'t str {
        self.chars.peek().map_or("", |&(at, _)| &self.text[at..])
    }

    fn next(&mut self) -> Result<Option<Token>, Wrong> {
        if let Some(token) = self.ahead.take() {
            return Ok(Some(token));
        }
        while let Some(&(_, c)) = self.chars.peek() {
            if c == '#' {
                while self.chars.peek().is_some_and(|&(_, c)| c != '\n') {
                    self.bump();
                }
            } else if c.is_whitespace() || c == ';' {
                self.bump();
            } else {
                break;
            }
        }
        let Some(&(_, c)) = self.chars.peek() else { return Ok(None) };
        let token = match c {
            '"' | '\'' => Token::Text(self.between(&[&c.to_string().repeat(3), &c.to_string()])?),
            '@' => Token::Asset(self.between(&["@@@", "@"])?),
            '<' => {
                self.bump();
                Token::Path(self.until(">")?)
            }
            c if is_of_word(c) => {
                let mut word = String::new();
                while let Some(&(_, c)) = self.chars.peek().filter(|(_, c)| is_of_word(*c)) {
                    word.push(c);
                    self.bump();
                }
                Token::Word(word)
            }
            sign => {
                self.bump();
                Token::Sign(sign)
            }
        };
        Ok(Some(token))
    }

    /// The text between the first of these marks that is there, and the same again.
    fn between(&mut self, marks: &[&str]) -> Result<String, Wrong> {
        let rest = self.rest();
        let mark = marks.iter().find(|mark| rest.starts_with(**mark)).copied().unwrap_or_default().to_owned();
        self.skip(&mark);
        self.until(&mark)
    }

    fn until(&mut self, mark: &str) -> Result<String, Wrong> {
        let mut text = String::new();
        let began = self.line;
        loop {
            if self.rest().starts_with(mark) {
                self.skip(mark);
                return Ok(text);
            }
            match self.bump() {
                Some('\\') => text.extend(self.bump().filter(|&c| c != 'n')),
                Some(c) => text.push(c),
                None => {
                    return Err((began, format!("the text that begins here has no end; expected `{mark}`")));
                }
            }
        }
    }

    fn peek(&mut self) -> Result<Option<&Token>, Wrong> {
        if self.ahead.is_none() {
            self.ahead = self.next()?;
        }
        Ok(self.ahead.as_ref())
    }

    fn is_next(&mut self, sign: char) -> Result<bool, Wrong> {
        let is = self.peek()? == Some(&Token::Sign(sign));
        if is {
            self.ahead = None;
        }
        Ok(is)
    }

    /// Passes over what is between a bracket, which was read, and the one that closes it.
    fn pass(&mut self) -> Result<(), Wrong> {
        let (mut open, began) = (1, self.line);
        while open > 0 {
            match self.next()? {
                Some(Token::Sign('(' | '[' | '{')) => open += 1,
                Some(Token::Sign(')' | ']' | '}')) => open -= 1,
                Some(_) => {}
                None => return Err((began, "a bracket that opens here is not closed".into())),
            }
        }
        Ok(())
    }
}

fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | ':' | '.' | '-' | '+')
}

/// The prims of a file.
///
/// # Errors
/// What is wrong, with its line.
pub(super) fn parse(text: &str) -> Result<Vec<Prim>, Wrong> {
    let mut scanner = Scanner::new(text);
    let mut top = Prim::default();
    let mut count = 0;
    if scanner.is_next('(')? {
        scanner.pass()?;
    }
    body(&mut scanner, &mut top, &mut count, 0)?;
    match scanner.next()? {
        None => Ok(top.children),
        Some(token) => scanner.wrong(format!("expected a prim, found {token:?}")),
    }
}

/// What is between the braces of a prim, up to the closing one or the end.
fn body(scanner: &mut Scanner<'_>, prim: &mut Prim, count: &mut usize, depth: usize) -> Result<(), Wrong> {
    if depth > DEEPEST {
        return scanner.wrong(format!("prims lie more than {DEEPEST} deep"));
    }
    loop {
        let Some(Token::Word(word)) = scanner.peek()? else { return Ok(()) };
        let word = word.clone();
        scanner.ahead = None;
        *count += 1;
        if *count > MOST_PRIMS {
            return scanner.wrong(format!("more than {MOST_PRIMS} prims and properties"));
        }
        match &word[..] {
            "def" | "over" | "class" => {
                let child = child(scanner, count, depth)?;
                prim.children.push(child);
            }
            "variantSet" => {
                scanner.next()?;
                if !(scanner.is_next('=')? && scanner.is_next('{')?) {
                    return scanner.wrong("expected `= {` behind the name of a set of variants");
                }
                scanner.pass()?;
            }
            _ => prim.properties.extend(property(scanner, word)?),
        }
    }
}

fn child(scanner: &mut Scanner<'_>, count: &mut usize, depth: usize) -> Result<Prim, Wrong> {
    let mut prim = Prim::default();
    let mut token = scanner.next()?;
    if let Some(Token::Word(kind)) = token {
        prim.kind = kind;
        token = scanner.next()?;
    }
    let Some(Token::Text(name)) = token else {
        return scanner.wrong("expected the name of a prim in quotes");
    };
    prim.name = name;
    if scanner.is_next('(')? {
        scanner.pass()?;
    }
    if !scanner.is_next('{')? {
        return scanner.wrong(format!("expected `{{` behind the prim {:?}", prim.name));
    }
    body(scanner, &mut prim, count, depth + 1)?;
    if !scanner.is_next('}')? {
        return scanner.wrong(format!("expected `}}` at the end of the prim {:?}", prim.name));
    }
    Ok(prim)
}

/// A property, whose first word was read. Its name is the last word before `=`; without one it is only
/// declared.
fn property(scanner: &mut Scanner<'_>, first: String) -> Result<Option<Property>, Wrong> {
    let mut name = first;
    loop {
        match scanner.peek()? {
            Some(Token::Word(word)) if !is_beginning(word) => {
                name.clone_from(word);
                scanner.ahead = None;
            }
            Some(Token::Sign('[')) => {
                // The type of an array.
                scanner.ahead = None;
                if !scanner.is_next(']')? {
                    return scanner.wrong(format!("expected `]` in the type of {name}"));
                }
            }
            Some(Token::Sign('(')) => {
                scanner.ahead = None;
                scanner.pass()?;
                return Ok(None);
            }
            Some(Token::Sign('=')) => break,
            _ => return Ok(None),
        }
    }
    scanner.ahead = None;
    let line = scanner.line;
    let value = value(scanner, 0)?;
    if scanner.is_next('(')? {
        scanner.pass()?;
    }
    Ok(Some(Property { name, value, line }))
}

/// Whether a word begins a prim, so that a property declared before it has ended.
fn is_beginning(word: &str) -> bool {
    matches!(word, "def" | "over" | "class" | "variantSet" | "custom" | "uniform" | "rel")
}

fn value(scanner: &mut Scanner<'_>, depth: usize) -> Result<Value, Wrong> {
    if depth > DEEPEST {
        return scanner.wrong("brackets lie too deep");
    }
    Ok(match scanner.next()? {
        Some(Token::Word(word)) => match word.parse::<f32>() {
            Ok(number) if number.is_finite() => Value::Numbers(vec![number]),
            Ok(_) => return scanner.wrong(format!("`{word}` is no finite number")),
            Err(_) => match &word[..] {
                "true" => Value::Numbers(vec![1.0]),
                "false" => Value::Numbers(vec![0.0]),
                _ => Value::Other,
            },
        },
        Some(Token::Text(text)) => Value::Text(text),
        Some(Token::Asset(name)) => Value::Asset(name),
        Some(Token::Path(path)) => Value::Path(path),
        Some(Token::Sign('(')) => {
            let mut numbers = Vec::new();
            loop {
                if scanner.is_next(')')? {
                    break Value::Numbers(numbers);
                }
                match value(scanner, depth + 1)? {
                    // Four are the most that a colour or a factor has.
                    Value::Numbers(more) if numbers.len() < 16 => numbers.extend(more),
                    Value::Numbers(_) => {}
                    _ => return scanner.wrong("expected numbers in brackets"),
                }
                scanner.is_next(',')?;
            }
        }
        // One target of a connection may stand in brackets.
        Some(Token::Sign('[')) => match scanner.peek()? {
            Some(Token::Path(path)) => {
                let path = path.clone();
                scanner.ahead = None;
                scanner.pass()?;
                Value::Path(path)
            }
            _ => {
                scanner.pass()?;
                Value::Other
            }
        },
        Some(Token::Sign('{')) => {
            scanner.pass()?;
            Value::Other
        }
        Some(Token::Sign(sign)) => return scanner.wrong(format!("expected a value, found `{sign}`")),
        None => return scanner.wrong("expected a value, found the end of the file"),
    })
}
