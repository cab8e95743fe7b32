//! The options of a job as the print system hands them over, by the keywords of [`make::options::PAGE`].
//!
//! Option strings of the print system are pairs `name=value`, separated by blanks; a value with blanks is quoted or has
//! backslashes; a bare `name` means true and `noname` false.

use make::options::{Choices, MIRROR, PAGE, PageOption};
use press::layout::Profile;

/// Keywords for the calibration profile of the queue's printer in its description.
pub const OFFSET: &str = "FoilpressOffset";
/// See [`OFFSET`].
pub const FEED: &str = "FoilpressFeed";

/// An option with a value that is not one of its choices.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{option}={found} is not possible; choose {known}")]
pub struct NoChoice {
    /// The option.
    pub option: &'static str,
    /// What was asked for.
    pub found: String,
    /// The choices, in words.
    pub known: String,
}

/// The choices of a job: its options override the defaults of the printer description, which override the first choices.
///
/// # Errors
/// A value in the job's options that is not a choice. Such a value among the defaults is ignored.
pub fn read(options: &[(String, String)], description: Option<&str>) -> Result<Choices, NoChoice> {
    // The last one wins, as in the print system.
    let asked = |keyword: &str| {
        options.iter().rev().find(|(name, _)| name.eq_ignore_ascii_case(keyword)).map(|(_, value)| value)
    };
    let mut choices = Choices::default();
    for option in PAGE.into_iter().filter(|option| option.keyword != MIRROR.keyword) {
        let usual = description.and_then(|text| default_of(text, option.keyword));
        let usual = option
            .in_dialog()
            .find(|value| usual.is_some_and(|usual| value.dialog.0.eq_ignore_ascii_case(usual)));
        if let Some(value) = usual.or_else(|| option.in_dialog().next()) {
            (value.set)(&mut choices);
        }
        if let Some(value) = asked(option.keyword) {
            option.choose(value, &mut choices).ok_or_else(|| no_choice(option, value))?;
        }
    }
    // The print system has a name of its own for it, and hands over whatever it was given.
    choices.mirror = [MIRROR.keyword, "mirror"]
        .into_iter()
        .any(|keyword| asked(keyword).is_some_and(|value| value.eq_ignore_ascii_case("true")));
    choices.custom_paper = ["PageSize", "media"]
        .into_iter()
        .any(|keyword| asked(keyword).is_some_and(|value| value.to_ascii_lowercase().starts_with("custom.")));
    choices.profile = description.map_or_else(Profile::default, profile_in);
    Ok(choices)
}

fn no_choice(option: &'static PageOption, found: &str) -> NoChoice {
    let mut known: Vec<&str> = option.in_dialog().map(|value| value.dialog.0).collect();
    known.extend(option.custom.map(|custom| custom.is));
    let last = known.pop().unwrap_or_default();
    let known = if known.is_empty() { last.into() } else { format!("{} or {last}", known.join(", ")) };
    NoChoice { option: option.keyword, found: found.into(), known }
}

/// `*DefaultKEYWORD: value` in a printer description.
fn default_of<'a>(description: &'a str, keyword: &str) -> Option<&'a str> {
    description.lines().find_map(|line| {
        Some(line.strip_prefix("*Default")?.strip_prefix(keyword)?.strip_prefix(':')?.trim())
    })
}

/// The calibration profile in a printer description; values out of range are ignored.
pub fn profile_in(description: &str) -> Profile {
    let numbers = |keyword: &str| -> Option<Vec<f64>> {
        let value = description
            .lines()
            .find_map(|line| line.strip_prefix('*')?.strip_prefix(keyword)?.strip_prefix(':'))?;
        value.trim().trim_matches('"').split_whitespace().map(|number| number.parse().ok()).collect()
    };
    let mut profile = Profile::default();
    if let Some(&[x, y]) = numbers(OFFSET).as_deref() {
        profile.offset_mm = [x, y];
    }
    if let Some(&[feed]) = numbers(FEED).as_deref() {
        profile.feed = feed;
    }
    if profile.problem().is_some() { Profile::default() } else { profile }
}

/// Reads an option string of the print system.
pub fn parse(text: &str) -> Vec<(String, String)> {
    let mut options = Vec::new();
    let mut rest = text.chars().peekable();
    loop {
        while rest.next_if(|c| c.is_whitespace()).is_some() {}
        let mut name = String::new();
        while let Some(c) = rest.next_if(|&c| c != '=' && !c.is_whitespace()) {
            name.push(c);
        }
        if name.is_empty() && rest.next_if_eq(&'=').is_none() {
            return options;
        }
        if rest.next_if_eq(&'=').is_none() {
            options.push(match name.strip_prefix("no") {
                Some(negated) if !negated.is_empty() => (negated.into(), "false".into()),
                _ => (name, "true".into()),
            });
            continue;
        }
        let (mut value, mut quote) = (String::new(), None);
        while let Some(c) = rest.next_if(|&c| quote.is_some() || !c.is_whitespace()) {
            match (c, quote) {
                ('\\', _) => value.extend(rest.next()),
                (c, Some(open)) if c == open => quote = None,
                ('"' | '\'', None) => quote = Some(c),
                (c, _) => value.push(c),
            }
        }
        options.push((name, value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use art::White;
    use make::options::{Place, Spots};
    use proptest::prelude::*;
    use protocol::rgl::Media;

    fn pair(name: &str, value: &str) -> (String, String) {
        (name.into(), value.into())
    }

    #[test]
    fn an_option_string_is_read_as_the_print_system_writes_it() {
        let read = parse(
            r#"media=A4 job-uuid=urn:uuid:1-2 title='a "b" c' path=x\ y\\z nocollate fit-to-page k="v w""#,
        );
        assert_eq!(
            read,
            [
                pair("media", "A4"),
                pair("job-uuid", "urn:uuid:1-2"),
                pair("title", r#"a "b" c"#),
                pair("path", r"x y\z"),
                pair("collate", "false"),
                pair("fit-to-page", "true"),
                pair("k", "v w"),
            ]
        );
        assert!(parse("  ").is_empty());
    }

    #[test]
    fn the_job_overrides_the_queue_and_the_queue_overrides_the_defaults() {
        let usual = read(&[], None).unwrap();
        assert_eq!(
            (usual.media, usual.white, usual.dpi, usual.spots),
            (Media::Plain, White::None, 600, Spots::Named)
        );
        let description =
            "*DefaultMediaType: GlossyPaper\n*DefaultFoilpressWhite: Under\n*DefaultFoilpressCurl: Nonsense";
        let queue = read(&[], Some(description)).unwrap();
        assert_eq!(
            (queue.media, queue.white, queue.curl_correction),
            (Media::GlossyPaper, White::Under, true)
        );
        let job =
            [pair("FoilpressWhite", "Opaque"), pair("mediatype", "cardboard"), pair("FoilpressCurl", "off")];
        let job = read(&job, Some(description)).unwrap();
        assert_eq!((job.media, job.white, job.curl_correction), (Media::Cardboard, White::Opaque, false));
    }

    #[test]
    fn a_position_is_read_as_dialogs_and_as_people_write_it() {
        let place = |value: &str| read(&[pair("FoilpressPosition", value)], None).map(|c| c.place);
        let at = Ok(Place::At("20x30mm".parse().unwrap()));
        assert_eq!(place("Custom.20x30mm"), at);
        assert_eq!(place("20x30mm"), at);
        assert_eq!(place("centre"), Ok(Place::Centre));
        assert_eq!(read(&[], None).unwrap().place, Place::Page);
        let error = place("left").unwrap_err().to_string();
        assert!(error.contains("Centre") && error.contains("20x30mm"), "{error}");
    }

    #[test]
    fn a_gamma_is_a_word_or_a_number_in_its_range() {
        let gamma = |value: &str| read(&[pair("FoilpressGamma", value)], None).map(|c| c.gamma);
        assert_eq!((gamma("Lighter"), gamma("1.7"), gamma("Custom.0.5")), (Ok(1.3), Ok(1.7), Ok(0.5)));
        for wrong in ["0", "NaN", "-1", "inf", "9"] {
            let said = gamma(wrong).unwrap_err().to_string();
            let end = "choose Normal, Lighter, Darker or a number from 0.2 to 5, such as 1.2";
            assert!(said.starts_with(&format!("FoilpressGamma={wrong} ")) && said.ends_with(end), "{said}");
        }
    }

    #[test]
    fn a_value_that_is_not_a_choice_is_answered_with_the_choices() {
        let error = read(&[pair("FoilpressWhite", "Beneath")], None).unwrap_err().to_string();
        assert!(
            error.contains("FoilpressWhite") && error.contains("Beneath") && error.contains("Silhouette"),
            "{error}"
        );
    }

    #[test]
    fn colours_and_steps_that_cannot_be_are_answered_with_what_can() {
        for wrong in ["rouge=gold", "#ff0000", "#ff0000=jam", "#ffffff=gold", "#ff0000=gold,#ff0000=white"] {
            let error = read(&[pair("FoilpressColour", wrong)], None).unwrap_err().to_string();
            assert!(
                error.ends_with("choose None or colours and their inks, such as #ff0000=gold"),
                "{error}"
            );
        }
        for wrong in ["61", "-1", "many"] {
            assert!(read(&[pair("FoilpressTolerance", wrong)], None).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_choice_can_be_asked_for_and_keywords_differ() {
        for option in PAGE {
            let keywords: Vec<&str> = option.in_dialog().map(|value| value.dialog.0).collect();
            for (i, value) in option.in_dialog().enumerate() {
                let (keyword, text) = value.dialog;
                assert!(keyword.bytes().all(|b| b.is_ascii_alphanumeric()) && !text.is_empty());
                assert!(keywords[..i].iter().all(|other| !other.eq_ignore_ascii_case(keyword)));
                read(&[pair(option.keyword, keyword)], None).unwrap();
            }
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_to_its_end(text in ".{0,80}") {
            parse(&text);
        }

        #[test]
        fn a_quoted_value_comes_back(value in "[ -~]{0,20}") {
            let quoted: String = value.chars().flat_map(|c| match c {
                '\\' | '"' => vec!['\\', c],
                c => vec![c],
            }).collect();
            prop_assert_eq!(parse(&format!("a=\"{quoted}\" b=1")), [pair("a", &value), pair("b", "1")]);
        }
    }
}
