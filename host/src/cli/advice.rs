//! Which options help: libraries name what is wrong or what they suggest, only the command line knows its options.

use inks::InkSet;
use press::chart::ChartError;
use press::halftone::HalftoneError;
use press::layers::{Accept, LayersError, Remedy, Setting, Settings};
use press::layout::{LayoutError, SizeError};
use press::pipeline::JobError;
use press::pipeline::document::StageError;
use press::simulate::PrintoutError;
use protocol::ink::Ink;

use super::choice::Choice;

/// Which options to try, if this error is one of those that options help against.
pub fn of(error: &anyhow::Error) -> Option<String> {
    error.chain().find_map(|cause| {
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
        if let Some(advice) = cause.downcast_ref().and_then(of_layers) {
            return Some(advice);
        }
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

/// What Ghostscript says of a file that it does not find.
const NOT_FOUND: &str = "/undefinedfilename";

/// The options that help against an error of layers.
fn of_layers(error: &LayersError) -> Option<String> {
    Some(match error {
        LayersError::Setting { setting, .. } => format!("the option is {}", option_of(*setting)),
        LayersError::Foil { ink, .. } => format!("add --inks +{}", ink.name()),
        LayersError::NoSize { fits_mm, .. } | LayersError::Beyond { fits_mm, .. }
            if below(*fits_mm) <= 0.0 =>
        {
            "nothing fits there: print fewer copies (--repeat) with a smaller --gap, or take a larger --paper"
                .into()
        }
        LayersError::NoSize { fits_mm, .. } => {
            format!("such as --dpi 1200, or --size {}mm for the largest that fits", below(*fits_mm))
        }
        LayersError::File { path, problem } if path.to_str().is_none() && problem.contains(NOT_FOUND) => {
            "the name of the file is not UTF-8, so Ghostscript does not find it; rename the file".into()
        }
        LayersError::Beyond { fits_mm, says, .. } => format!(
            "the options are --size ({}mm is the largest that fits), {}--paper and --crop",
            below(*fits_mm),
            if says.is_some() { "--dpi, " } else { "" }
        ),
        LayersError::Pages { pages, .. } => format!(
            "--page {} reads one page; --pages white,gold,black reads one page per ink",
            pages.first().unwrap_or(&1)
        ),
        LayersError::TooLarge { fits_mm, .. } => {
            format!("--size {}mm is the largest that fits", below(*fits_mm))
        }
        LayersError::TooSmall { .. } => "the options are --size and --dpi".into(),
        LayersError::White { .. } => "--white alpha prints white wherever the art is not transparent".into(),
        LayersError::Passes { .. } => "the option is --passes".into(),
        _ => return None,
    })
}

/// The options that follow a suggestion, if `allowed` are the inks that may be used now.
pub fn options_of(remedy: &Remedy, allowed: &InkSet) -> String {
    match remedy {
        Remedy::Accept(accept) => {
            let name =
                Accept::ALL.iter().find(|(known, ..)| known == accept).map_or("", |(_, name, _)| *name);
            format!("--accept {name}")
        }
        Remedy::Media(media) => format!("--media {}", media.name()),
        Remedy::Order(inks) => format!("--order {}", names(inks.iter().copied())),
        Remedy::Without(ink) if *allowed == Settings::default().inks => format!("--inks -{}", ink.name()),
        Remedy::Without(ink) => format!("--inks {}", names(allowed.iter().filter(|other| other != ink))),
    }
}

fn names(inks: impl Iterator<Item = Ink>) -> String {
    inks.map(Ink::name).collect::<Vec<_>>().join(",")
}

fn option_of(setting: Setting) -> &'static str {
    match setting {
        Setting::Inks => "--inks",
        Setting::Order => "--order",
        Setting::White => "--white",
        Setting::Choke => "--choke",
        Setting::Spread => "--spread",
        Setting::Finish => "--finish",
    }
}

/// A length in millimetres with one decimal, rounded down.
fn below(mm: f64) -> f64 {
    (10.0 * mm).floor() / 10.0
}

#[cfg(test)]
mod tests {
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

    fn said(error: LayersError) -> String {
        of(&error.into()).expect("there is an option")
    }

    #[test]
    fn errors_name_the_option_that_avoids_them() {
        let foil = LayersError::Foil { layer: "01-foil".into(), ink: Ink::GoldFoil };
        let text = said(foil);
        assert!(text.ends_with("add --inks +gold-foil"), "{text}");
        let setting =
            LayersError::Setting { setting: Setting::Finish, problem: "finish is not allowed".into() };
        assert!(said(setting).ends_with("the option is --finish"));
        let none = LayersError::Beyond {
            path: "art.svg".into(),
            says: None,
            size_mm: (20.0, 10.0),
            room_mm: (0.0, 269.7),
            fits_mm: 0.0,
        };
        let text = said(none);
        assert!(text.contains("--repeat") && !text.contains("--size"), "{text}");
        let large = LayersError::TooLarge {
            width_mm: 300.0,
            height_mm: 200.0,
            most_width_mm: 209.1,
            most_height_mm: 328.5,
            fits_mm: 203.29,
        };
        assert!(said(large).ends_with("--size 203.2mm is the largest that fits"));
    }
}
