//! Charts for the desk: the sheets that tell the state of a printer, without a terminal.
//!
//! Method: the charts of `foilpress chart` that need no choice but a name, on the sheet that is loaded, with the inks that the printer
//! has found. A chart becomes a finished job, which is looked at and printed as any other.
//! Cost: the dots of a sheet, about 35 MB, while it is made. Limits: ramps are of black; other stacks, and measuring by them, are
//! for the command line.

use halftone::Method;
use inks::{InkSet, Library, Stack};
use make::options::Choices;
use observe::{Observer, with_causes};
use press::chart;
use press::job::Handling;
use press::layout::Layout;
use press::pipeline::{self, Request};
use protocol::ink::{Ink, Kind};

/// Name, label, and what to look for.
pub const CHARTS: [(&str, &str, &str); 5] = [
    (
        "first",
        "First sheet",
        "Four bars of black, 5.0 mm wide and 3.0 mm from bar to bar: a printer's first sheet.",
    ),
    (
        "heads",
        "Heads and ribbons",
        "A narrow strip of each ink. A streak in every ink is the head, in one ink its ribbon.",
    ),
    (
        "registration",
        "Registration",
        "Verniers between the first ink and the others: how far apart passes land.",
    ),
    (
        "ramp",
        "Ramp",
        "From black to the bare paper, for `foilpress measure ramp`. It needs a sheet 200 mm wide.",
    ),
    (
        "halftone",
        "Halftones",
        "A ramp, flat tones and small text by each halftone: which of them the printer holds.",
    ),
];

/// Why there is no chart: a name that is none, or a sheet that is too small for it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct NoChart(String);

/// The inks of cartridges of these names that a chart may use; those of process colours if none is known. A foil is printed only by
/// who names it.
pub fn inks<'a>(found: impl Iterator<Item = &'a str>) -> Vec<Ink> {
    let mut inks: Vec<Ink> = Vec::new();
    for name in found {
        let ink = Ink::ALL.into_iter().find(|ink| ink.name() == name && ink.kind() != Kind::Foil);
        inks.extend(ink.filter(|ink| !inks.contains(ink)));
    }
    match inks.is_empty() {
        true => vec![Ink::Black, Ink::Cyan, Ink::Magenta, Ink::Yellow],
        false => inks,
    }
}

/// The job of a chart, on the sheet and the calibration of these choices.
///
/// # Errors
/// No such chart, or no room for it.
pub fn job(
    name: &str,
    choices: &Choices,
    inks: &[Ink],
    library: &Library,
    observer: &dyn Observer,
) -> Result<Vec<u8>, NoChart> {
    let failed = |error: &dyn std::error::Error| NoChart(with_causes(error));
    let (black, bare) = (Stack::new(vec![Ink::Black]), Stack::SUBSTRATE);
    let layout = Layout {
        camera_marks: name != "first" && name != "heads",
        profile: choices.profile,
        ..Layout::centred(choices.paper)
    };
    let room = |chart, size| chart::check_room(chart, size, &layout);
    let dots = match name {
        "first" => chart::first(inks[0], choices.paper),
        "heads" => chart::heads(inks, choices.paper),
        "registration" => chart::registration(inks, choices.paper),
        "ramp" => room("ramp", chart::ramp::parts().size)
            .and_then(|()| chart::ramp(&black, &bare, Method::default(), library, observer)),
        "halftone" => room("halftone", chart::size_of_halftones(&black, &bare))
            .and_then(|()| chart::halftones(&black, &bare, library, observer)),
        _ => return Err(NoChart("there is no such chart".into())),
    };
    let dots = dots.map_err(|error| failed(&error))?;
    let request = Request {
        name,
        dots: &dots,
        layout: &layout,
        handling: Handling { media: choices.media, curl_correction: choices.curl_correction },
        allowed: InkSet::of(inks.iter().copied().chain([Ink::Black])),
        library,
    };
    pipeline::job(&request, observer).map(|job| job.bytes).map_err(|error| failed(&error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use press::chart::first::{APART, BARS, WIDE};
    use press::inspect::inspect;
    use protocol::paper::Paper;

    #[test]
    fn what_is_told_of_the_first_sheet_is_what_is_printed_on_it() {
        let about = CHARTS[0].2;
        assert!(about.contains(&format!("{WIDE:.1} mm wide and {APART:.1} mm")) && BARS == 4, "{about}");
    }

    #[test]
    fn a_chart_has_the_inks_that_are_loaded_and_no_foil() {
        let names = ["white", "gold-foil", "cyan", "white", "cartridge-99"];
        let found = inks(names.into_iter());
        assert_eq!(found, [Ink::White, Ink::Cyan]);
        let choices = Choices { paper: Paper::Postcard, ..Choices::default() };
        let bytes = job("heads", &choices, &found, &Library::builtin(), &Silent).unwrap();
        let printed = inspect(&bytes, &Silent);
        let printed = InkSet::of(printed.passes.iter().map(|pass| pass.ink));
        assert_eq!(printed, InkSet::of(found));
        assert_eq!(inks(["gold-foil"].into_iter()).len(), 4);
    }

    #[test]
    fn a_chart_without_room_and_one_that_is_none_are_refused() {
        let choices = Choices { paper: Paper::Postcard, ..Choices::default() };
        let inks = inks(std::iter::empty());
        for (name, words) in [("ramp", "ramp"), ("../first", "no such chart")] {
            let error = job(name, &choices, &inks, &Library::builtin(), &Silent).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}
