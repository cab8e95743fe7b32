//! The target beside the simulated print, under several lights: `sheet.png`.
//!
//! Two rows, target and print, and a column for each light. One exposure, chosen from the target, serves every
//! panel, so that what differs between the rows differs on paper.

use image::RgbImage;

use crate::observe::Observer;

use super::canvas::{Canvas, FAINT, INK, Letters};
use super::tone::Exposure;
use super::{Light, PreviewError, Source, check_size, flat};

/// The lights of the usual picture: over the middle, beside it, and low enough to show the body colour alone.
pub const STANDARD_LIGHTS: [(&str, Light); 4] = [
    ("light at the eye", Light::Point([0.0, 0.0, 1.3])),
    ("light from the left", Light::Point([-0.3, 0.2, 1.1])),
    ("light from the right", Light::Point([0.3, -0.15, 1.1])),
    ("raking light", Light::Point([0.0, 2.6, 1.3])),
];

const GAP: usize = 16;

/// Lays target and print out under each of `lights`, panels of `longest` pixels on their longer side in the
/// target's proportions. `title` heads the picture, `notes` stand below it, a line each.
///
/// # Errors
/// As [`flat`]; also when the whole would be larger than [`super::LONGEST_SIDE`].
pub fn sheet_picture(
    target: &Source,
    print: &Source,
    lights: &[(&str, Light)],
    longest: usize,
    title: &str,
    notes: &[String],
    observer: &dyn Observer,
) -> Result<RgbImage, PreviewError> {
    check_size(longest, longest)?;
    let (width, height) = print.fit(longest);
    let only: Vec<Light> = lights.iter().map(|l| l.1).collect();
    let rows = [
        ("target", flat(target, &only, width, height, observer)?),
        ("print, simulated", flat(print, &only, width, height, observer)?),
    ];
    let exposure = Exposure::of(&rows[0].1);

    let head = GAP + Letters::Title.height() + GAP;
    let label = Letters::Plain.height() + 6;
    let foot = notes.len() * (Letters::Small.height() + 3) + GAP;
    let wide = GAP + lights.len().max(1) * (width + GAP);
    let mut canvas = Canvas::new(wide, head + rows.len() * (label + height + GAP) + foot)?;
    canvas.text(GAP, GAP, Letters::Title, INK, title);
    for (r, (name, panels)) in rows.iter().enumerate() {
        let top = head + r * (label + height + GAP);
        for (i, (panel, (light, _))) in panels.iter().zip(lights).enumerate() {
            let left = GAP + i * (width + GAP);
            let room = width / Letters::Plain.width();
            let words = if i == 0 { format!("{name} · {light}") } else { (*light).to_string() };
            canvas.text(left, top, Letters::Plain, INK, &shortened(&words, room));
            canvas.paste(left, top + label, panel, exposure);
        }
    }
    let below = head + rows.len() * (label + height + GAP);
    for (i, note) in notes.iter().enumerate() {
        canvas.text(GAP, below + i * (Letters::Small.height() + 3), Letters::Small, FAINT, note);
    }
    Ok(canvas.finish())
}

/// The text, cut to `room` letters.
pub(super) fn shortened(text: &str, room: usize) -> String {
    if text.chars().count() <= room {
        return text.to_string();
    }
    text.chars().take(room.saturating_sub(2)).chain("..".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{Space, Table};
    use crate::observe::Silent;
    use crate::preview::Area;
    use crate::sheet::Sheet;
    use inks::Stack;
    use protocol::paper::Paper;

    #[test]
    fn the_same_sheet_twice_gives_the_same_row_twice() {
        let space = Space::half_angle(8);
        let stacks = vec![Stack::SUBSTRATE, "MS".parse().unwrap()];
        let index = (0..60 * 40).map(|i| u8::from(i % 60 > 30)).collect();
        let sheet = Sheet::new(Paper::Custom { width: 60, length: 40 }, stacks, index).unwrap();
        let mut rows = Table::new(space.columns());
        rows.push(&vec![0.27; space.columns()]);
        rows.push(&vec![0.05; space.columns()]);
        let print = Source::Print { sheet: &sheet, space: &space, stacks: &rows, area: Area::whole(&sheet) };
        let notes = ["a note".to_string()];
        let picture =
            sheet_picture(&print, &print, &STANDARD_LIGHTS, 60, "a sheet", &notes, &Silent).unwrap();
        assert_eq!(picture.width() as usize, GAP + 4 * (60 + GAP));
        let first = (2 * GAP + Letters::Title.height() + Letters::Plain.height() + 6) as u32;
        let step = (Letters::Plain.height() + 6 + 40 + GAP) as u32;
        let mut seen = std::collections::BTreeSet::new();
        for y in first..first + 40 {
            for x in GAP as u32..picture.width() - GAP as u32 {
                assert_eq!(picture.get_pixel(x, y), picture.get_pixel(x, y + step), "({x}, {y})");
                seen.insert(picture.get_pixel(x, y).0);
            }
        }
        assert!(seen.len() > 10, "only {} colours", seen.len());
    }

    #[test]
    fn words_that_do_not_fit_are_cut() {
        assert_eq!(shortened("light from the left", 8), "light ..");
        assert_eq!(shortened("short", 8), "short");
    }
}
