//! The printer description: papers with the margins the machine enforces, and the [`options`] of the
//! dialog, as a PPD file, which is what print systems of this kind understand.
//!
//! Source: the PPD specification 4.3 and the print system's extensions to it (`cupsFilter2`, `cupsManualCopies`). The
//! numbers come from the tables the jobs are made by, so that dialog and job cannot differ.

use std::fmt::Write as _;

use protocol::paper::{LEFT, Paper};

use super::options;
use crate::simulate::Stock;

/// What the filter makes.
pub const JOB_TYPE: &str = "application/vnd.foilpress-rgl";

/// How the print system knows a file of that type by its first bytes.
pub const TYPES: &str = "\
# Jobs for ALPS MD printers: they begin with the command that selects the printer's language, or with a reset before it.\n\
application/vnd.foilpress-rgl rgl string(0,<1B258041>) string(0,<1B651B258041>)\n";

/// Papers and what dialogs call them.
const PAPERS: [(Paper, &str, &str); 6] = [
    (Paper::A4, "A4", "A4"),
    (Paper::Letter, "Letter", "US Letter"),
    (Paper::Legal, "Legal", "US Legal"),
    (Paper::Executive, "Executive", "Executive"),
    (Paper::B5, "B5", "B5 (JIS)"),
    (Paper::Postcard, "Postcard", "Postcard (100 x 148 mm)"),
];

/// 1/600 inch as points, as short as it is exact to a thousandth.
fn points(dots: f64) -> String {
    let text = format!("{:.3}", dots * 72.0 / 600.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The size of a sheet in points. Known sizes have the numbers everybody gives them.
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

/// The paper whose sheet has this size in points, within 2 mm.
pub fn paper_of(width: f64, length: f64) -> Option<Paper> {
    const NEAR: f64 = 2.0 * 72.0 / 25.4;
    PAPERS.into_iter().map(|(paper, ..)| paper).find(|&paper| {
        let stock = Stock::of(paper);
        let at = |dots: u16| f64::from(dots) * 72.0 / 600.0;
        (at(stock.width) - width).abs() < NEAR && (at(stock.length) - length).abs() < NEAR
    })
}

/// Names of the papers, for messages.
pub fn papers() -> String {
    PAPERS.map(|(_, name, _)| name).join(", ")
}

/// The printer description.
pub fn description() -> String {
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
    papers_into(&mut text);
    for option in options::all() {
        // The first choice is the default; writing to a string does not fail.
        let (keyword, first) = (option.keyword, &option.choices[0].0);
        let _ = write!(
            text,
            "\n*OpenUI *{keyword}/{}: PickOne\n*OrderDependency: 20 AnySetup *{keyword}\n*Default{keyword}: {first}\n",
            option.text
        );
        for (choice, words) in &option.choices {
            let _ = writeln!(text, "*{keyword} {choice}/{}: \"\"", translation(words));
        }
        let _ = writeln!(text, "*CloseUI: *{keyword}");
    }
    text.push_str(
        "\n*OpenUI *MirrorPrint/Mirror, for what is seen from behind: Boolean\n\
         *OrderDependency: 20 AnySetup *MirrorPrint\n\
         *DefaultMirrorPrint: False\n\
         *MirrorPrint False/No: \"\"\n\
         *MirrorPrint True/Yes: \"\"\n\
         *CloseUI: *MirrorPrint\n\
         \n*DefaultFont: Courier\n*Font Courier: Standard \"(1.05)\" Standard ROM\n",
    );
    text
}

/// A text as a PPD holds it: a colon would end it.
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
        // Points count from the lower left corner, the machine from the upper left.
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
    text.push_str("\n*DefaultPaperDimension: A4\n");
    for (paper, name, words) in PAPERS {
        let (width, length) = sheet(paper);
        let _ = writeln!(text, "*PaperDimension {name}/{words}: \"{width} {length}\"");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_of_points_is_the_paper_it_was_declared_as() {
        for (paper, ..) in PAPERS {
            let (width, length) = sheet(paper);
            assert_eq!(paper_of(width.parse().unwrap(), length.parse().unwrap()), Some(paper));
        }
        assert_eq!(paper_of(595.276, 841.89), Some(Paper::A4));
        assert_eq!(paper_of(842.0, 595.0), None, "A4 on its side does not go in");
        assert_eq!(paper_of(f64::NAN, 842.0), None);
    }

    #[test]
    fn every_paper_the_machine_knows_by_name_is_declared() {
        assert!(Paper::named().all(|paper| PAPERS.iter().any(|row| row.0 == paper)));
    }

    #[test]
    fn the_margins_are_those_measured_on_paper() {
        // A4 on hardware: left 3.39 mm, top 12.03 mm, right 3.41 mm, bottom 15.23 mm.
        let text = description();
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
        for line in description().lines() {
            assert!(line.len() <= 255, "{line}");
        }
    }
}
