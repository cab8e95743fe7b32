//! Every basis before and after mapping, as lit balls: `materials.png`, after figure 6 of the 2009 paper.
//!
//! Each basis has a card with the target on the left and the print on the right, both under a light near the eye and under a
//! light probe. The card also states the distance of the metric and the mixture in words. All balls under one kind of light
//! share the exposure of white paper under it, so that cards can be compared.

use inks::Stack;
use rayon::prelude::*;
use readers::Pixels;

use appearance::brdf::{Space, Table};
use observe::Observer;

use super::canvas::{Canvas, FAINT, Heading, INK, Letters, shortened};
use super::error::{PreviewError, check_size};
use super::probe::Probe;
use super::radiance::Radiance;
use super::sphere::{under_light, under_probe};
use super::tone::ToneCurve;

/// One material before and after mapping.
#[derive(Clone, Debug)]
pub struct Swatch<'a> {
    /// Its name, such as `basis 3`.
    pub name: String,
    /// The reflectance to reproduce, a row of the space.
    pub target: &'a [f64],
    /// The reflectance of the mixture.
    pub printed: &'a [f64],
    /// The mixture: stacks and their weights, which sum to about 1.
    pub mix: Vec<(Stack, f64)>,
}

/// Direction of the light on the left ball of each pair: off the eye, to move the highlight off the centre.
const LIGHT: [f64; 3] = [-0.45, 0.5, 1.0];

/// Rows of the light probe.
const PROBE_ROWS: usize = 128;

const GAP: usize = 20;

/// Lays out `swatches` as cards with balls of `ball` pixels across; a badge says if curves are `modelled`.
///
/// # Errors
/// A row of another space, a space without half angles, or a picture that would be too large.
pub fn materials_picture(
    space: &Space,
    swatches: &[Swatch],
    probe: &Probe,
    ball: usize,
    modelled: bool,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>, PreviewError> {
    check_size(ball, ball)?;
    let mut rows = Table::new(space.columns());
    for row in swatches.iter().flat_map(|s| [s.target, s.printed]) {
        if row.len() != space.columns() {
            let (expected, found) = (space.columns(), row.len());
            return Err(PreviewError::Shape { what: "columns of a swatch", expected, found });
        }
        rows.push(row);
    }
    // White paper is rendered only to set the exposure under the probe.
    rows.push(&vec![0.85 / std::f64::consts::PI; space.columns()]);
    let mut around = under_probe(space, &rows, &probe.resized(PROBE_ROWS), ball, observer)?;
    let paper = around.pop().map_or(ToneCurve::PAPER, |p| ToneCurve::of(&[p]));
    let near: Vec<Radiance> = (0..2 * swatches.len())
        .into_par_iter()
        .map(|i| under_light(&space.curve(rows.row(i)), LIGHT, ball))
        .collect::<Result<_, _>>()?;

    let across = if swatches.len() <= 3 {
        1
    } else if swatches.len() <= 8 {
        2
    } else {
        3
    };
    let pair = 2 * ball + 6;
    let card = (2 * pair + GAP, 2 * (Letters::Plain.height() + 4) + ball + 2 * (Letters::Small.height() + 4));
    let head = GAP + Letters::Title.height() + GAP / 2;
    let down = swatches.len().div_ceil(across);
    let step = (card.0 + 2 * GAP, card.1 + GAP);
    let mut canvas = Canvas::new(2 * GAP + across * step.0 - GAP, head + down.max(1) * step.1 + GAP / 2)?;
    let title = "Materials before and after mapping";
    canvas.heading(Heading { title, modelled }, GAP, Letters::Title);
    for (i, swatch) in swatches.iter().enumerate() {
        let (x, y) = (GAP + i % across * step.0, head + i / across * step.1);
        let d = space.distance(swatch.target, swatch.printed);
        let line = Letters::Plain.height() + 4;
        canvas.text(x, y, Letters::Plain, INK, &format!("{}   d = {d:.3}", swatch.name));
        canvas.text(x, y + line, Letters::Small, FAINT, "target: one light, light probe");
        canvas.text(x + pair + GAP, y + line, Letters::Small, FAINT, "print");
        for (side, left) in [(0, x), (1, x + pair + GAP)] {
            let top = y + 2 * line;
            canvas.paste(left, top, &near[2 * i + side], ToneCurve::PAPER);
            canvas.paste(left + ball + 6, top, &around[2 * i + side], paper);
        }
        let words = mix_in_words(&swatch.mix);
        let room = card.0 / Letters::Small.width();
        let mut below = y + 2 * line + ball + 6;
        for part in wrapped(&words, room, 2) {
            canvas.text(x, below, Letters::Small, INK, &part);
            below += Letters::Small.height() + 2;
        }
    }
    Ok(canvas.finish())
}

/// A mixture in words, largest weight first, in whole per cents that sum to 100: `62 % MS+C, 38 % substrate`.
/// Weights that round to zero are left out.
pub fn mix_in_words(mix: &[(Stack, f64)]) -> String {
    let sum: f64 = mix.iter().map(|m| m.1.max(0.0)).sum();
    if sum.is_nan() || sum <= 0.0 {
        return "nothing".to_string();
    }
    let exact: Vec<f64> = mix.iter().map(|m| m.1.max(0.0) / sum * 100.0).collect();
    let mut whole: Vec<u32> = exact.iter().map(|v| v.floor() as u32).collect();
    let mut order: Vec<usize> = (0..mix.len()).collect();
    order.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()));
    let left = 100u32.saturating_sub(whole.iter().sum()) as usize;
    order.iter().take(left).for_each(|&i| whole[i] += 1);
    order.sort_by_key(|&i| (std::cmp::Reverse(whole[i]), i));
    let parts = order.iter().filter(|&&i| whole[i] > 0).map(|&i| format!("{} % {}", whole[i], mix[i].0));
    parts.collect::<Vec<_>>().join(", ")
}

/// Breaks a list at its commas into at most `lines` lines of at most `room` letters.
fn wrapped(text: &str, room: usize, lines: usize) -> Vec<String> {
    let mut out = vec![String::new()];
    for part in text.split_inclusive(", ") {
        let last = out.len() - 1;
        if !out[last].is_empty() && out[last].len() + part.trim_end().len() > room && out.len() < lines {
            out.push(part.to_string());
        } else {
            out[last].push_str(part);
        }
    }
    out.iter().map(|line| shortened(line.trim_end(), room)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use proptest::prelude::*;

    fn stack(text: &str) -> Stack {
        text.parse().unwrap()
    }

    #[test]
    fn mixtures_read_like_a_recipe() {
        let mix =
            [(stack("substrate"), 0.302), (stack("MS+C"), 0.617), (stack("F"), 0.08), (stack("K"), 0.001)];
        assert_eq!(mix_in_words(&mix), "62 % MS+C, 30 % substrate, 8 % F");
        assert_eq!(mix_in_words(&[]), "nothing");
        assert_eq!(mix_in_words(&[(stack("K"), f64::NAN)]), "nothing");
    }

    proptest! {
        #[test]
        fn per_cents_of_a_recipe_sum_to_a_hundred(shares in prop::collection::vec(0.0f64..1.0, 1..57)) {
            let mix: Vec<_> = shares.iter().map(|&s| (stack("C"), s)).collect();
            if shares.iter().sum::<f64>() > 0.0 {
                let words = mix_in_words(&mix);
                let sum: u32 = words.split(", ").map(|p| p.split(' ').next().unwrap().parse::<u32>().unwrap()).sum();
                prop_assert_eq!(sum, 100);
            }
        }
    }

    #[test]
    fn long_recipes_break_at_their_commas() {
        let lines = wrapped("62 % MS+C, 30 % substrate, 8 % F, 3 % K", 12, 2);
        assert_eq!(lines, ["62 % MS+C,", "30 % subst.."]);
    }

    /// The balls of one row of the space are the same picture wherever they stand.
    #[test]
    fn equal_materials_have_equal_balls_on_both_sides_of_a_card() {
        let space = Space::half_angle(16);
        let row = space.row(&inks::Curve::sampled(space.angles(), |t| [0.5 * inks::ggx::lobe(t, 0.1); 3]));
        let swatch =
            Swatch { name: "basis 1".into(), target: &row, printed: &row, mix: vec![(stack("MS"), 1.0)] };
        let ball = 40;
        let picture = materials_picture(&space, &[swatch], &Probe::studio(16), ball, false, &Silent).unwrap();
        let shift = (2 * ball + 6 + GAP) as u32;
        // The balls' lines: below the title and the card's two lines of words.
        let top = (GAP + Letters::Title.height() + GAP / 2 + 2 * (Letters::Plain.height() + 4)) as u32;
        let mut lit = 0;
        for y in top..top + ball as u32 {
            for x in GAP as u32..(GAP + 2 * ball + 6) as u32 {
                let left = picture.at(x, y);
                assert_eq!(left, picture.at(x + shift, y), "({x}, {y})");
                lit += u32::from(left[0] > 60);
            }
        }
        assert!(lit > 300, "{lit} pixels lit");
    }

    #[test]
    fn a_row_of_another_space_is_refused() {
        let space = Space::half_angle(4);
        let good = vec![0.1; 12];
        let swatch = Swatch { name: String::new(), target: &good, printed: &good[..9], mix: Vec::new() };
        let error =
            materials_picture(&space, &[swatch], &Probe::constant(1.0), 8, false, &Silent).unwrap_err();
        assert!(matches!(error, PreviewError::Shape { expected: 12, found: 9, .. }), "{error}");
    }
}
