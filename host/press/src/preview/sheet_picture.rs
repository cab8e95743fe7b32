//! The target beside the simulated print, under several lights: `sheet.png`.
//!
//! The lights stand side by side in twos, so that words can be read on a telephone. Below each are the
//! target, the print, and a close-up of the print's dots where they vary most. All panels of a light share
//! one exposure, that of the target, so a difference between them is a difference on paper; each light has
//! its own, as an eye adapts. Pixels of the print have whole dots ([`Source::in_whole_dots`]).

use readers::Pixels;

use observe::Observer;
use sheet::{Area, DotMap};

use super::canvas::{Canvas, FAINT, Heading, INK, Letters, shortened};
use super::error::{PreviewError, check_size};
use super::flat::{Light, flat};
use super::radiance::Radiance;
use super::source::Source;
use super::tone::ToneCurve;

/// The default lights: above the middle, beside it, and low enough to show only the body colour.
pub const STANDARD_LIGHTS: [(&str, Light); 4] = [
    ("light: eye", Light::Point([0.0, 0.0, 1.3])),
    ("light: left", Light::Point([-0.3, 0.2, 1.1])),
    ("light: right", Light::Point([0.3, -0.15, 1.1])),
    ("light: raking", Light::Point([0.0, 2.1, 1.4])),
];

/// Far lights at four angles to an eye above: the reflection, two tilts, and the 45 degrees at which
/// colours are measured.
pub const TILTS: [(&str, Light); 4] = [
    ("reflection", Light::Far([0.0, 0.0, 1.0])),
    ("tilted by 15°", Light::Far([0.258_819_045, 0.0, 0.965_925_826])),
    ("tilted by 30°", Light::Far([0.5, 0.0, 0.866_025_404])),
    ("tilted by 45°", Light::Far([1.0, 0.0, 1.0])),
];

const GAP: usize = 16;

/// Lights side by side.
const ACROSS: usize = 2;

/// Width of a dot in the close-up, in pixels.
const MAGNIFIED: usize = 5;

/// Candidate places for the close-up, across and down.
const PLACES: usize = 24;

/// Target, print and its dots under each of some lights, not yet laid out.
pub struct Panels<'a> {
    lights: &'a [(&'a str, Light)],
    width: usize,
    height: usize,
    rows: Vec<(&'static str, Vec<Radiance>)>,
    /// Lights side by side.
    across: usize,
    one_exposure: bool,
}

impl<'a> Panels<'a> {
    /// Lights target and print. Panels have the print's proportions, and at most `longest` pixels on their
    /// longer side.
    ///
    /// # Errors
    /// Those of [`flat()`].
    pub fn lit(
        target: &Source,
        print: &Source,
        lights: &'a [(&'a str, Light)],
        longest: usize,
        observer: &dyn Observer,
    ) -> Result<Panels<'a>, PreviewError> {
        check_size(longest, longest)?;
        let (print, (width, height)) = print.in_whole_dots(longest);
        let only: Vec<Light> = lights.iter().map(|l| l.1).collect();
        let mut rows = vec![
            ("target", flat(target, &only, width, height, observer)?),
            ("print", flat(&print, &only, width, height, observer)?),
        ];
        if let Some(panels) = close_up(&print, &only, width, height, observer)? {
            rows.push(("its dots", panels));
        }
        Ok(Panels { lights, width, height, rows, across: ACROSS, one_exposure: false })
    }

    /// As a figure: all lights in a row, with one exposure, without the magnified dots.
    #[must_use]
    pub fn in_a_row(mut self) -> Panels<'a> {
        self.rows.truncate(2);
        Panels { across: self.lights.len().max(1), one_exposure: true, ..self }
    }

    /// Lays them out, with `notes` below the picture, one line each.
    ///
    /// # Errors
    /// A picture larger than [`LONGEST_SIDE`](super::LONGEST_SIDE).
    pub fn picture(&self, heading: Heading, notes: &[String]) -> Result<Pixels<[u8; 3]>, PreviewError> {
        let &Panels { lights, width, height, ref rows, across, one_exposure } = self;
        let target = &rows[0].1;
        let tones: Vec<ToneCurve> = match one_exposure {
            true => vec![ToneCurve::of(target); target.len()],
            false => target.iter().map(ToneCurve::of_view).collect(),
        };
        let wide = GAP + across.min(lights.len().max(1)) * (width + GAP);
        let letters = if one_exposure { Letters::Plain } else { Letters::readable(wide) };
        let (line, head) = (letters.height() + 6, GAP + letters.height() + GAP);
        let group = line + rows.len() * (line + height + GAP);
        let groups = lights.len().div_ceil(across);
        let foot = notes.len() * line + GAP;
        let mut canvas = Canvas::new(wide, head + groups * group + foot)?;
        let whole = |words: &str| shortened(words, (wide - 2 * GAP) / letters.width());
        canvas.heading(heading, GAP, letters);
        for (i, (light, _)) in lights.iter().enumerate() {
            let (left, top) = (GAP + i % across * (width + GAP), head + i / across * group);
            let within = |words: &str| shortened(words, width / letters.width());
            canvas.text(left, top, letters, INK, &within(light));
            for (r, (name, panels)) in rows.iter().enumerate() {
                let top = top + line + r * (line + height + GAP);
                canvas.text(left, top, letters, FAINT, &within(name));
                canvas.paste(left, top + line, &panels[i], tones[i]);
            }
        }
        for (i, note) in notes.iter().enumerate() {
            canvas.text(GAP, head + groups * group + i * line, letters, FAINT, &whole(note));
        }
        Ok(canvas.finish())
    }
}

/// The dots of a sheet, magnified [`MAGNIFIED`] times, as `width` x `height` pixels under each of `lights`.
/// `None` for sources without dots, and for sheets so small that a close-up would show nothing new.
fn close_up(
    print: &Source,
    lights: &[Light],
    width: usize,
    height: usize,
    observer: &dyn Observer,
) -> Result<Option<Vec<Radiance>>, PreviewError> {
    let &Source::Print { dots, space, stacks, area } = print else { return Ok(None) };
    let (across, down) = (width / MAGNIFIED, height / MAGNIFIED);
    if across == 0 || down == 0 || area.width < 2 * across || area.length < 2 * down {
        return Ok(None);
    }
    let part = most_varied(dots, area, across, down);
    let longest = area.width.max(area.length) as f64;
    let x = ((part.left - area.left) as f64 + 0.5 * (across as f64 - area.width as f64)) / longest;
    let y = (0.5 * (area.length as f64 - down as f64) - (part.top - area.top) as f64) / longest;
    // Over so small a part, the direction and brightness of a light are constant.
    let near: Vec<Light> = lights.iter().map(|light| Light::Far(light.direction(x, y))).collect();
    let mut panels =
        flat(&Source::Print { dots, space, stacks, area: part }, &near, width, height, observer)?;
    for ((panel, light), near) in panels.iter_mut().zip(lights).zip(&near) {
        let gain = (light.at(x, y).1 / near.at(0.0, 0.0).1) as f32;
        panel.pixels.iter_mut().for_each(|p| (0..3).for_each(|c| p[c] *= gain));
    }
    Ok(Some(panels))
}

/// The part of `width` x `length` dots with the greatest entropy of stacks, among evenly spaced places.
fn most_varied(dots: &DotMap, area: Area, width: usize, length: usize) -> Area {
    let mut best = (f64::NEG_INFINITY, area);
    let mut counts = vec![0u32; dots.stacks().len()];
    for place in 0..PLACES * PLACES {
        let left = area.left + (area.width - width) * (place % PLACES) / (PLACES - 1);
        let top = area.top + (area.length - length) * (place / PLACES) / (PLACES - 1);
        counts.fill(0);
        for row in top..top + length {
            for &dot in &dots.index()[row * dots.width() + left..][..width] {
                counts[usize::from(dot)] += 1;
            }
        }
        let share = |&n: &u32| f64::from(n) / (width * length) as f64;
        let entropy: f64 = counts.iter().map(share).filter(|s| *s > 0.0).map(|s| -s * s.ln()).sum();
        if entropy > best.0 {
            best = (entropy, Area { left, top, width, length });
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::{Space, Table};
    use inks::Stack;
    use observe::Silent;
    use protocol::paper::Paper;
    use sheet::Sheet;

    #[test]
    fn the_same_sheet_twice_gives_the_same_row_twice() {
        let space = Space::half_angle(8);
        let stacks = vec![Stack::SUBSTRATE, "MS".parse().unwrap()];
        let index = (0..60 * 40).map(|i| u8::from(i % 60 > 30)).collect();
        let sheet = Sheet::new(Paper::Custom { width: 60, length: 40 }, stacks, index).unwrap();
        let mut rows = Table::new(space.columns());
        rows.push(&vec![0.27; space.columns()]);
        rows.push(&vec![0.05; space.columns()]);
        let print = Source::Print {
            dots: sheet.dots(),
            space: &space,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        let notes = ["a note".to_string()];
        let picture = Panels::lit(&print, &print, &STANDARD_LIGHTS, 60, &Silent)
            .unwrap()
            .picture(Heading { title: "a sheet", modelled: true }, &notes)
            .unwrap();
        assert_eq!(picture.size().0 as usize, GAP + 2 * (60 + GAP));
        let line = Letters::Plain.height() + 6;
        let first = (GAP + Letters::Plain.height() + GAP + 2 * line) as u32;
        let step = (line + 40 + GAP) as u32;
        let mut seen = std::collections::BTreeSet::new();
        for y in first..first + 40 {
            for x in GAP as u32..picture.size().0 - GAP as u32 {
                assert_eq!(picture.at(x, y), picture.at(x, y + step), "({x}, {y})");
                seen.insert(picture.at(x, y));
            }
        }
        assert!(seen.len() > 10, "only {} colours", seen.len());
    }

    /// Lines three dots apart are even where three dots are a pixel, and few dots have some pixels each.
    #[test]
    fn pixels_have_whole_dots() {
        let space = Space::half_angle(8);
        let stacks = vec![Stack::SUBSTRATE, "MS".parse().unwrap()];
        let mut rows = Table::new(space.columns());
        [0.27, 0.05].iter().for_each(|&f| rows.push(&vec![f; space.columns()]));
        for (width, longest, panel) in [(250usize, 100, 83), (1000, 333, 250), (40, 100, 80)] {
            let index = (0..width * 30).map(|i| u8::from(i % width % 3 == 0)).collect();
            let paper = Paper::Custom { width: width as u16, length: 30 };
            let sheet = Sheet::new(paper, stacks.clone(), index).unwrap();
            let area = Area::whole(sheet.dots());
            let print = Source::Print { dots: sheet.dots(), space: &space, stacks: &rows, area };
            let (print, (across, down)) = print.in_whole_dots(longest);
            assert_eq!(across, panel);
            let seen = flat(&print, &[Light::Far([0.0, 0.0, 1.0])], across, down, &Silent).unwrap();
            let values: std::collections::BTreeSet<u32> =
                seen[0].pixels.iter().map(|p| (1e4 * p[0]) as u32).collect();
            assert_eq!(values.len(), if panel == 83 { 1 } else { 2 }, "{width}: {values:?}");
        }
    }

    #[test]
    fn the_close_up_is_taken_where_stacks_meet() {
        let stacks = vec![Stack::SUBSTRATE, "MS".parse().unwrap(), "C".parse().unwrap()];
        // Bare, but for a patch of three stacks around (70, 50).
        let index = (0..200 * 100).map(|i| (i % 200, i / 200)).map(|(x, y): (i32, i32)| {
            if (x - 70).abs() < 9 && (y - 50).abs() < 9 { ((x + y) % 3) as u8 } else { 0 }
        });
        let paper = Paper::Custom { width: 200, length: 100 };
        let sheet = Sheet::new(paper, stacks, index.collect()).unwrap();
        let area = Area { left: 10, top: 10, width: 180, length: 80 };
        let part = most_varied(sheet.dots(), area, 20, 16);
        assert!(part.left.abs_diff(60) < 8 && part.top.abs_diff(42) < 8, "{part:?}");
        assert_eq!((part.width, part.length), (20, 16));
    }

    /// A uniform sheet looks the same through the magnifier as without it.
    #[test]
    fn the_close_up_is_lit_like_the_place_it_is_taken_from() {
        let space = Space::half_angle(32);
        let paper = Paper::Custom { width: 300, length: 200 };
        let sheet = Sheet::new(paper, vec![Stack::SUBSTRATE], vec![0; 300 * 200]).unwrap();
        let mut rows = Table::new(space.columns());
        rows.push(&space.row(&inks::Curve::sampled(space.angles(), |t| [0.2 + inks::ggx::lobe(t, 0.3); 3])));
        let print = Source::Print {
            dots: sheet.dots(),
            space: &space,
            stacks: &rows,
            area: Area::whole(sheet.dots()),
        };
        let lights = STANDARD_LIGHTS.map(|l| l.1);
        let (width, height) = (150, 100);
        let panels = close_up(&print, &lights, width, height, &Silent).unwrap().unwrap();
        let whole = flat(&print, &lights, 300, 200, &Silent).unwrap();
        // All places are equally varied, so the first is taken: 30 x 20 dots at the top left.
        for (panel, whole) in panels.iter().zip(&whole) {
            let (found, expected) =
                (panel.pixels[height / 2 * width + width / 2][0], whole.pixels[10 * 300 + 15][0]);
            assert!((found / expected - 1.0).abs() < 0.02, "{found}, not {expected}");
        }
    }
}
