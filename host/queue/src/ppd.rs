//! The printer description: papers with the margins the printer enforces, and the `options` of the
//! dialog, as a PPD file.
//!
//! Source: the PPD specification 4.3 and the print system's extensions to it (`cupsFilter2`, `cupsManualCopies`). The
//! numbers come from the tables that jobs are made from, so that dialog and job cannot differ.

use std::fmt::Write as _;

use protocol::paper::{LEFT, Paper};

use super::options::{FEED, OFFSET};
use make::options::{Custom, MIRROR, PAGE};
use press::layout::{self, Mm, Point, Profile};
use press::simulate::Stock;

/// The type of the filter's output.
pub const JOB_TYPE: &str = "application/vnd.foilpress-rgl";

/// How the print system recognises a file of that type by its first bytes.
pub const TYPES: &str = "\
# Jobs for ALPS MD printers: they begin with the command that selects the printer's language, or with a reset before it.\n\
application/vnd.foilpress-rgl rgl string(0,<1B258041>) string(0,<1B651B258041>)\n";

/// Papers and their names in dialogs.
const PAPERS: [(Paper, &str, &str); 6] = [
    (Paper::A4, "A4", "A4"),
    (Paper::Letter, "Letter", "US Letter"),
    (Paper::Legal, "Legal", "US Legal"),
    (Paper::Executive, "Executive", "Executive"),
    (Paper::B5, "B5", "B5 (JIS)"),
    (Paper::Postcard, "Postcard", "Postcard (100 x 148 mm)"),
];

/// Converts 1/600 inch to points: the shortest text that is exact to a thousandth.
fn points(dots: f64) -> String {
    let text = format!("{:.3}", dots * 72.0 / 600.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The size of a sheet in points. Known sizes have their customary numbers.
fn sheet(paper: Paper) -> (String, String) {
    let (width, length) = match paper {
        Paper::A4 => ("595", "842"),
        Paper::Letter => ("612", "792"),
        Paper::Legal => ("612", "1008"),
        Paper::Executive => ("522", "756"),
        Paper::B5 => ("516", "729"),
        Paper::Postcard => ("284", "419"),
        Paper::Custom { .. } => {
            let stock = Stock::of(paper);
            return (points(stock.width.into()), points(stock.length.into()));
        }
    };
    (width.into(), length.into())
}

/// The paper of a sheet of this size in millimetres: a known paper that agrees within 2 mm, unless the size is `custom`;
/// otherwise a sheet of exactly this size.
///
/// # Errors
/// In words: why the printer cannot take the sheet.
pub fn paper_of(width: f64, length: f64, custom: bool) -> Result<Paper, String> {
    const NEAR: f64 = 2.0;
    let known = PAPERS.into_iter().map(|(paper, ..)| paper).find(|&paper| {
        let (across, down) = layout::paper::sheet_mm(paper);
        (across - width).abs() < NEAR && (down - length).abs() < NEAR
    });
    match known {
        Some(paper) if !custom => Ok(paper),
        _ => layout::paper::custom(Mm(width), Mm(length)),
    }
}

/// The printer description, for a printer with this calibration profile.
pub fn description(profile: &Profile) -> String {
    let mut text = format!(
        "*PPD-Adobe: \"4.3\"\n\
         *FormatVersion: \"4.3\"\n\
         *FileVersion: \"{version}\"\n\
         *LanguageVersion: English\n\
         *LanguageEncoding: ISOLatin1\n\
         *PCFileName: \"FOILPRES.PPD\"\n\
         *Manufacturer: \"ALPS\"\n\
         *Product: \"(MD-5500)\"\n\
         *ModelName: \"ALPS MD-5500\"\n\
         *ShortNickName: \"ALPS MD-5500, Foilpress\"\n\
         *NickName: \"ALPS MD-5500 (Oki DP-5000), Foilpress {version}\"\n\
         *1284DeviceID: \"MFG:ALPS;MDL:MD-5500;CMD:RGL;\"\n\
         *PSVersion: \"(3010.000) 0\"\n\
         *LanguageLevel: \"3\"\n\
         *ColorDevice: True\n\
         *DefaultColorSpace: RGB\n\
         *FileSystem: False\n\
         *Throughput: \"1\"\n\
         *LandscapeOrientation: Plus90\n\
         *TTRasterizer: Type42\n\
         *cupsVersion: 2.2\n\
         *cupsManualCopies: True\n\
         *cupsLanguages: \"en\"\n\
         *cupsFilter2: \"application/vnd.cups-pdf {JOB_TYPE} 0 foilpress\"\n\
         *cupsFilter2: \"image/pwg-raster {JOB_TYPE} 0 foilpress\"\n\
         *cupsFilter2: \"{JOB_TYPE} {JOB_TYPE} 0 -\"\n\
         *DefaultResolution: 600dpi\n\
         *Resolution 600dpi/600 dpi: \"\"\n",
        version = env!("CARGO_PKG_VERSION"),
    );
    let [x, y] = profile.offset_mm;
    // Writing to a string does not fail, here and below.
    let _ = writeln!(text, "*{OFFSET}: \"{x} {y}\"\n*{FEED}: \"{}\"", profile.feed);
    papers_into(&mut text);
    for option in PAGE {
        // The first choice is the default.
        let (keyword, kind) =
            (option.keyword, if option.keyword == MIRROR.keyword { "Boolean" } else { "PickOne" });
        let first = option.in_dialog().next().map_or("", |value| value.dialog.0);
        let _ = write!(
            text,
            "\n*OpenUI *{keyword}/{}: {kind}\n*OrderDependency: 20 AnySetup *{keyword}\n*Default{keyword}: {first}\n",
            option.text
        );
        for value in option.in_dialog() {
            let (choice, words) = value.dialog;
            let _ = writeln!(text, "*{keyword} {choice}/{}: \"\"", translation(words));
        }
        let _ = writeln!(text, "*CloseUI: *{keyword}");
        if let Some(Custom { name, text: words, .. }) = option.custom {
            let _ = write!(
                text,
                "*Custom{keyword} True: \"\"\n*ParamCustom{keyword} {name}/{}: 1 string 0 40\n",
                translation(words)
            );
        }
    }
    text.push_str("\n*DefaultFont: Courier\n*Font Courier: Standard \"(1.05)\" Standard ROM\n");
    text
}

/// A text for a PPD file, where a colon would end it.
fn translation(text: &str) -> String {
    text.replace(':', ",").replace('…', "...")
}

fn papers_into(text: &mut String) {
    for (keyword, words, region) in [("PageSize", "Paper", "PageSize"), ("PageRegion", "Paper", "PageRegion")]
    {
        let _ = write!(
            text,
            "\n*OpenUI *{keyword}/{words}: PickOne\n*OrderDependency: 10 AnySetup *{keyword}\n*Default{keyword}: A4\n"
        );
        for (paper, name, words) in PAPERS {
            let (width, length) = sheet(paper);
            let _ =
                writeln!(text, "*{region} {name}/{words}: \"<</PageSize[{width} {length}]>>setpagedevice\"");
        }
        let _ = writeln!(text, "*CloseUI: *{keyword}");
    }
    text.push_str("\n*DefaultImageableArea: A4\n");
    for (paper, name, words) in PAPERS {
        let (_, length) = sheet(paper);
        // Points count from the lower left corner, the printer from the upper left.
        let length: f64 = length.parse::<f64>().unwrap_or_default() * 600.0 / 72.0;
        let (left, right) = (f64::from(LEFT), f64::from(LEFT + paper.width()));
        let top = length - f64::from(paper.top());
        let bottom = top - f64::from(paper.length());
        let _ = writeln!(
            text,
            "*ImageableArea {name}/{words}: \"{} {} {} {}\"",
            points(left),
            points(bottom),
            points(right),
            points(top)
        );
    }
    custom_papers_into(text);
    text.push_str("\n*DefaultPaperDimension: A4\n");
    for (paper, name, words) in PAPERS {
        let (width, length) = sheet(paper);
        let _ = writeln!(text, "*PaperDimension {name}/{words}: \"{width} {length}\"");
    }
}

/// Sheets of custom sizes.
fn custom_papers_into(text: &mut String) {
    let (Point(narrowest, shortest), Point(widest, longest)) = layout::paper::custom_range();
    // Rounded inwards to a hundredth of a point, so that the printer accepts every declared size.
    let least = |side: Mm| (side.0 * 7200.0 / 25.4).ceil() / 100.0;
    let most = |side: Mm| (side.0 * 7200.0 / 25.4).floor() / 100.0;
    let [left, top, right, bottom] =
        layout::paper::custom_margins().map(|margin| points(margin.dots() as f64));
    let _ = write!(
        text,
        "\n*VariablePaperSize: True\n*MaxMediaWidth: \"{}\"\n*MaxMediaHeight: \"{}\"\n\
         *HWMargins: {left} {bottom} {right} {top}\n\
         *NonUIOrderDependency: 10 AnySetup *CustomPageSize True\n\
         *CustomPageSize True: \"pop pop pop <</PageSize[5 -2 roll]/ImagingBBox null>>setpagedevice\"\n\
         *ParamCustomPageSize Width: 1 points {} {}\n\
         *ParamCustomPageSize Height: 2 points {} {}\n\
         *ParamCustomPageSize WidthOffset: 3 points 0 0\n\
         *ParamCustomPageSize HeightOffset: 4 points 0 0\n\
         *ParamCustomPageSize Orientation: 5 int 0 0\n",
        most(widest),
        most(longest),
        least(narrowest),
        most(widest),
        least(shortest),
        most(longest)
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::profile_in;

    #[test]
    fn a_page_of_points_is_the_paper_it_was_declared_as() {
        let mm = |points: f64| points * 25.4 / 72.0;
        for (paper, ..) in PAPERS {
            let (width, length) = sheet(paper);
            let (width, length) = (mm(width.parse().unwrap()), mm(length.parse().unwrap()));
            assert_eq!(paper_of(width, length, false), Ok(paper));
        }
        assert_eq!(paper_of(mm(595.276), mm(841.89), false), Ok(Paper::A4));
        assert!(paper_of(297.0, 210.0, false).is_err(), "A4 on its side does not go in");
        assert!(paper_of(f64::NAN, 297.0, false).is_err());
    }

    #[test]
    fn a_sheet_of_its_own_size_is_that_and_not_the_paper_that_is_nearly_as_large() {
        let custom = |width, length| paper_of(width, length, true);
        assert_eq!(paper_of(101.0, 149.0, false), Ok(Paper::Postcard));
        // Margins of A4: 80 dots left and right, 284 at the top, 360 at the bottom.
        let dots = |mm: f64| (mm * 600.0 / 25.4).round() as u16;
        let expected = Paper::Custom { width: dots(101.0) - 160, length: dots(149.0) - 644 };
        assert_eq!(custom(101.0, 149.0), Ok(expected));
        assert_eq!(paper_of(120.0, 180.0, false), custom(120.0, 180.0));
    }

    #[test]
    fn the_largest_and_the_smallest_declared_sheet_go_in() {
        let text = description(&Profile::default());
        let range = |name: &str| -> [f64; 2] {
            let line =
                text.lines().find_map(|line| line.strip_prefix(&format!("*ParamCustomPageSize {name}: ")));
            let mut numbers =
                line.unwrap().split(' ').skip(2).map(|n| n.parse::<f64>().unwrap() * 25.4 / 72.0);
            [numbers.next().unwrap(), numbers.next().unwrap()]
        };
        let (widths, lengths) = (range("Width"), range("Height"));
        for at in 0..2 {
            assert!(paper_of(widths[at], lengths[at], true).is_ok(), "{} x {}", widths[at], lengths[at]);
        }
        assert!(widths[1] > 215.5 && lengths[1] > 355.0 && widths[0] < 20.0 && lengths[0] < 40.0);
    }

    #[test]
    fn a_machine_is_in_the_description_of_its_queue() {
        let machine = Profile { offset_mm: [0.25, -1.5], feed: 1.0015, ..Profile::default() };
        assert_eq!(profile_in(&description(&machine)), machine);
        assert_eq!(profile_in("*FoilpressOffset: \"99 0\"\n"), Profile::default());
        assert_eq!(profile_in("*FoilpressOffset: \"\"\n*FoilpressFeed: x\n"), Profile::default());
    }

    #[test]
    fn every_paper_the_machine_knows_by_name_is_declared() {
        assert!(Paper::named().all(|paper| PAPERS.iter().any(|row| row.0 == paper)));
    }

    #[test]
    fn the_margins_are_those_measured_on_paper() {
        // A4 on hardware: left 3.39 mm, top 12.03 mm, right 3.41 mm, bottom 15.23 mm.
        let text = description(&Profile::default());
        let line = text.lines().find_map(|line| line.strip_prefix("*ImageableArea A4/A4: ")).unwrap();
        let area: Vec<f64> = line.trim_matches('"').split(' ').map(|n| n.parse().unwrap()).collect();
        let mm = |points: f64| points * 25.4 / 72.0;
        for (found, measured) in
            [(area[0], 3.39), (595.276 - area[2], 3.41), (841.89 - area[3], 12.03), (area[1], 15.23)]
        {
            assert!((mm(found) - measured).abs() < 0.15, "{} mm, measured {measured} mm", mm(found));
        }
    }

    #[test]
    fn a_line_of_the_description_is_never_too_long() {
        for line in description(&Profile::default()).lines() {
            assert!(line.len() <= 255, "{line}");
        }
    }
}
