//! How to change a setting of layers on the command line: advice that libraries leave to the program.

use inks::InkSet;
use press::layers::{Accept, LayersError, Remedy, Setting, Settings};
use protocol::ink::Ink;

use super::choice::Choice;

/// The options that follow a suggestion, if `allowed` are the inks that may be used now.
pub fn options_of(remedy: &Remedy, allowed: &InkSet) -> String {
    match remedy {
        Remedy::Accept(accept) => {
            let name = Accept::ALL.iter().find(|(known, ..)| known == accept).map_or("", |(_, name, _)| *name);
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

/// An error of layers together with the options that avoid it, if there are any.
pub fn with_options(error: LayersError) -> anyhow::Error {
    let advice = match &error {
        LayersError::Setting { setting, problem } => {
            return anyhow::anyhow!("{}: {problem}", option_of(*setting));
        }
        LayersError::Foil { ink, .. } => format!("add --inks +{}", ink.name()),
        LayersError::NoSize { fits_mm, .. } => {
            format!("such as --dpi 1200, or --size {}mm for the largest that fits", below(*fits_mm))
        }
        LayersError::Beyond { fits_mm, .. } => {
            format!(
                "the options are --size ({}mm is the largest that fits), --dpi, --paper and --crop",
                below(*fits_mm)
            )
        }
        LayersError::TooLarge { fits_mm, .. } => {
            format!("--size {}mm is the largest that fits", below(*fits_mm))
        }
        LayersError::TooSmall { .. } => "the options are --size and --dpi".into(),
        LayersError::Passes { .. } => "the option is --passes".into(),
        _ => return error.into(),
    };
    anyhow::anyhow!("{error}; {advice}")
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

    #[test]
    fn errors_name_the_option_that_avoids_them() {
        let foil = LayersError::Foil { layer: "01-foil".into(), ink: Ink::GoldFoil };
        let text = with_options(foil).to_string();
        assert!(
            text.starts_with("01-foil asks for gold-foil") && text.ends_with("add --inks +gold-foil"),
            "{text}"
        );
        let setting =
            LayersError::Setting { setting: Setting::Finish, problem: "finish is not allowed".into() };
        assert_eq!(with_options(setting).to_string(), "--finish: finish is not allowed");
        let large = LayersError::TooLarge {
            width_mm: 300.0,
            height_mm: 200.0,
            most_width_mm: 209.1,
            most_height_mm: 328.5,
            fits_mm: 203.29,
        };
        assert!(with_options(large).to_string().ends_with("--size 203.2mm is the largest that fits"));
    }
}
