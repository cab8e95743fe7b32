//! Which options help: libraries name what is wrong, what to do and the settings to do it with, only the command line knows its
//! options.

use std::error::Error;

use art::{Remedy, Settings};
use halftone::HalftoneError;
use inks::InkSet;
use make::choice::name;
use observe::{Hint, with_hints};
use press::chart::ChartError;
use press::layout::{LayoutError, SizeError};
use press::pipeline::JobError;
use press::pipeline::document::StageError;
use press::simulate::PrintoutError;
use protocol::ink::Ink;

/// An error with its causes, and what to do about it in words and options of the command line.
pub fn explained(error: &anyhow::Error) -> (String, Vec<String>) {
    let (text, hints) = with_hints(stage(error.as_ref()));
    (text, hints.into_iter().map(in_options).chain(of(error)).collect())
}

/// The error of the stage that refused, if it is one of the library's.
fn stage<'a>(error: &'a (dyn Error + 'static)) -> &'a (dyn Error + 'static) {
    error.downcast_ref().map_or(error, make::Error::stage)
}

/// A hint with the options that change its settings.
fn in_options(hint: &Hint) -> String {
    let option = |(name, value): &(&str, String)| format!("--{name} {value}").trim_end().to_owned();
    let options: Vec<String> = hint.settings.iter().map(option).collect();
    match (&hint.words[..], &options[..]) {
        (words, []) => words.to_owned(),
        ("", [option]) => format!("the option is {option}"),
        (words, options) => format!("{words}: {}", options.join(", ")),
    }
}

/// Which options to try, if this error is one of those that options help against.
fn of(error: &anyhow::Error) -> Option<String> {
    error.chain().map(stage).find_map(|cause| {
        let layout = cause.downcast_ref::<LayoutError>();
        let layout = layout.or_else(|| match cause.downcast_ref()? {
            JobError::Layout(error) => Some(error),
            _ => None,
        });
        let layout = layout.or_else(|| match cause.downcast_ref()? {
            StageError::Layout(error) => Some(error),
            _ => None,
        });
        let size = cause.downcast_ref::<SizeError>();
        let size = size.or_else(|| match cause.downcast_ref()? {
            StageError::Size(error) => Some(error),
            _ => None,
        });
        if let Some(StageError::Halftone(HalftoneError::NotProcess { .. })) = cause.downcast_ref() {
            return Some("--inks process leaves the others out".into());
        }
        if let Some(PrintoutError::Resolution { .. }) = cause.downcast_ref() {
            return Some(
                "`foilpress plan JOB --html FILE` shows it on a page, and `foilpress inspect JOB --passes DIR` writes its \
                 passes as pictures"
                    .into(),
            );
        }
        let advice = match (layout, size, cause.downcast_ref()) {
            (Some(LayoutError::Beyond { .. }), ..) => {
                Some("change --at or --size, take a larger --paper, or cut with --crop")
            }
            (Some(LayoutError::FillsNothing { .. }), ..) => Some("give a smaller --size or a larger --paper"),
            (_, Some(SizeError::TooLarge { .. }), _) => {
                Some("give a smaller --size, a larger --paper, or cut with --crop")
            }
            (_, Some(SizeError::BeyondSheets { .. }), _) => Some("give a smaller --size"),
            (_, Some(SizeError::TooSmall { .. }), _) => Some("give a larger --size"),
            (.., Some(ChartError::TooMany { .. })) => Some("the options are --inks and --paper"),
            (.., Some(ChartError::Beyond { .. })) => {
                Some("change --at, --repeat or --gap, take a larger --paper, or cut with --crop")
            }
            (.., Some(ChartError::Layout(LayoutError::FillsNothing { .. }))) => {
                Some("change --at or take a larger --paper")
            }
            _ => None,
        };
        advice.map(str::to_owned)
    })
}

/// The options that follow a suggestion, if `allowed` are the inks that may be used now.
pub fn options_of(remedy: &Remedy, allowed: &InkSet) -> String {
    match remedy {
        Remedy::Accept(accept) => format!("--accept {}", name(*accept)),
        Remedy::Media(media) => format!("--media {}", media.name()),
        Remedy::Order(inks) => format!("--order {}", names(inks.iter().copied())),
        Remedy::Without(ink) if *allowed == Settings::default().inks => format!("--inks -{}", ink.name()),
        Remedy::Without(ink) => format!("--inks {}", names(allowed.iter().filter(|other| other != ink))),
    }
}

fn names(inks: impl Iterator<Item = Ink>) -> String {
    inks.map(Ink::name).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use art::Accept;
    use make::choice::Choice as _;
    use observe::{Diagnosis, Fault};

    use super::*;

    #[test]
    fn leaving_out_an_ink_keeps_all_others_that_are_allowed() {
        let without = Remedy::Without(Ink::Yellow);
        assert_eq!(options_of(&without, &Settings::default().inks), "--inks -yellow");
        let some = InkSet::of([Ink::White, Ink::Cyan, Ink::Yellow, Ink::Black]);
        let option = options_of(&without, &some);
        let typed: InkSet = option.strip_prefix("--inks ").unwrap().parse().unwrap();
        assert_eq!(typed, InkSet::of([Ink::White, Ink::Cyan, Ink::Black]));
    }

    #[test]
    fn every_addition_has_a_name_to_type() {
        for (accept, name, _) in Accept::ALL {
            assert_eq!(options_of(&Remedy::Accept(*accept), &InkSet::EMPTY), format!("--accept {name}"));
        }
    }

    #[test]
    fn hints_name_the_options_that_change_their_settings() {
        let diagnosis = Diagnosis::of_setting("finish", "it is not allowed");
        assert_eq!(explained(&diagnosis.into()).1, ["the option is --finish"]);
        let diagnosis = Diagnosis::new(Fault::Setting, "the art is too large")
            .hint("print it smaller or crop it")
            .set("size", "203.2mm")
            .set("crop", "")
            .hint("it is a large picture");
        let (text, hints) = explained(&anyhow::Error::new(diagnosis).context("not printed"));
        assert_eq!(text, "not printed: the art is too large");
        assert_eq!(hints, ["print it smaller or crop it: --size 203.2mm, --crop", "it is a large picture"]);
    }
}
