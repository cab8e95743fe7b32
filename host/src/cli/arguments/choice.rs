//! Values of options: enums by their names, and whole numbers in a range.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::builder::{OsStringValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use make::choice::Choice;
use make::options::{Choices, PageOption};

/// Reads a value by its name. Help and completion list the names.
pub fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let names = T::ALL.iter().map(|(_, name, help)| {
        let name = PossibleValue::new(name);
        if help.is_empty() { name } else { name.help(help) }
    });
    PossibleValuesParser::new(names).try_map(|name| {
        T::ALL.iter().find(|(_, known, _)| *known == name).map(|(value, ..)| *value).ok_or("unknown name")
    })
}

/// Reads a value of a page's option by its name. `get` takes it from the choices.
pub fn of_page<T: Clone + Send + Sync + 'static>(
    option: &'static PageOption,
    get: fn(Choices) -> T,
) -> impl TypedValueParser<Value = T> {
    let names = option.typed().map(|value| PossibleValue::new(value.name).help(value.help));
    PossibleValuesParser::new(names).try_map(move |name| {
        option.typed().find(|value| value.name == name).map(|value| value.of(get)).ok_or("unknown name")
    })
}

/// Reads the name of a document, which is part of texts in UTF-8: of reports, and of edits to replay.
pub fn utf8() -> impl TypedValueParser<Value = String> {
    OsStringValueParser::new().try_map(|name| {
        name.into_string().map_err(|_| "expected a name in UTF-8; rename the file or the folder")
    })
}

/// Reads a whole number in a range, both ends included.
pub fn whole<T>(range: RangeInclusive<T>) -> impl TypedValueParser<Value = T>
where
    T: FromStr + PartialOrd + fmt::Display + Clone + Send + Sync + 'static,
{
    move |text: &str| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
    }
}
