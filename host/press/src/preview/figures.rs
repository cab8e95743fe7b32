//! Figures 4, 5 and 11 of the 2009 paper, of any document.
//!
//! [`weights_picture`] has a ball of each basis above its weight map, [`balls_picture`] materials row by row in named columns, all under one
//! light probe and one exposure, and [`SIX_LIGHTS`] are the lights of the row in which a document stands over its print
//! ([`Panels`](super::Panels)).

use rayon::prelude::*;
use readers::Pixels;

use appearance::brdf::{Space, Table};
use appearance::factor::Factored;
use appearance::weights::ONE;
use observe::Observer;

use super::canvas::{Canvas, FAINT, Heading, Letters, shortened};
use super::error::PreviewError;
use super::flat::Light;
use super::probe::Probe;
use super::radiance::Radiance;
use super::source::Source;
use super::sphere::under_probe;
use super::tone::ToneCurve;

/// A near light from above the middle down to 15 degrees over the sheet, at one distance.
pub const SIX_LIGHTS: [(&str, Light); 6] = [
    ("90°", Light::Point([0.0, 0.0, 1.5])),
    ("75°", Light::Point([0.0, 0.388, 1.449])),
    ("60°", Light::Point([0.0, 0.75, 1.299])),
    ("45°", Light::Point([0.0, 1.061, 1.061])),
    ("30°", Light::Point([0.0, 1.299, 0.75])),
    ("15°", Light::Point([0.0, 1.449, 0.388])),
];

/// Pixels across a ball, and of the longer side of a weight map.
const SIDE: usize = 160;

const GAP: usize = 16;

/// The most bases in a row.
const ACROSS: usize = 8;

/// Rows of the light probe.
const PROBE_ROWS: usize = 128;

/// Balls of these rows under a probe, and the exposure of white paper there.
fn balls(
    space: &Space,
    rows: &Table,
    probe: &Probe,
    observer: &dyn Observer,
) -> Result<(Vec<Radiance>, ToneCurve), PreviewError> {
    let mut all = rows.clone();
    all.push(&vec![0.85 / std::f64::consts::PI; space.columns()]);
    let mut around = under_probe(space, &all, &probe.resized(PROBE_ROWS), SIDE, observer)?;
    let paper = around.pop().map_or(ToneCurve::PAPER, |paper| ToneCurve::of(&[paper]));
    Ok((around, paper))
}

/// Figure 4: each basis of a document as a ball, and below it where it is.
///
/// # Errors
/// A space without half angles, or a picture that would be too large.
pub fn weights_picture(
    name: &str,
    factored: &Factored,
    probe: &Probe,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>, PreviewError> {
    let (balls, paper) = balls(&factored.space, &factored.bases, probe, observer)?;
    let source = Source::Factored(factored);
    let (width, height) = source.fit(SIDE);
    let shares = source.shares(width, height)?.unwrap_or_default();
    let (bases, line) = (balls.len().max(1), Letters::Plain.height() + 4);
    let across = bases.min(ACROSS);
    let head = GAP + Letters::Title.height() + GAP;
    let card = line + SIDE + GAP / 2 + height + GAP;
    let mut canvas = Canvas::new(GAP + across * (SIDE + GAP), head + bases.div_ceil(across) * card)?;
    canvas.heading(Heading { title: name, modelled: false }, GAP, Letters::Title);
    for (k, (ball, share)) in balls.iter().zip(factored.shares()).enumerate() {
        let (x, y) = (GAP + k % across * (SIDE + GAP), head + k / across * card);
        canvas.text(x, y, Letters::Plain, FAINT, &format!("basis {k}, {:.1} %", 100.0 * share));
        canvas.paste(x, y + line, ball, paper);
        // The share itself, as light: half the weight is half as light.
        let pixels =
            shares.par_chunks_exact(bases).map(|pixel| [pixel[k], pixel[k], pixel[k], 1.0]).collect();
        let map = Radiance { width, height, pixels };
        let linear = ToneCurve { exposure: 1.0, knee: 1.0 };
        canvas.paste(x, y + line + SIDE + GAP / 2, &map, linear);
    }
    Ok(canvas.finish())
}

/// Columns of balls under their names, as figure 5 has them; all of one tabulation.
///
/// # Errors
/// A space without half angles, or a picture that would be too large.
pub fn balls_picture(
    heading: Heading,
    space: &Space,
    columns: &[(&str, Table)],
    probe: &Probe,
    observer: &dyn Observer,
) -> Result<Pixels<[u8; 3]>, PreviewError> {
    let line = Letters::Plain.height() + 4;
    let rows = columns.iter().map(|(_, rows)| rows.len()).max().unwrap_or(0);
    let head = GAP + Letters::Title.height() + GAP;
    let mut canvas =
        Canvas::new(GAP + columns.len().max(1) * (SIDE + GAP), head + line + rows.max(1) * (SIDE + GAP))?;
    canvas.heading(heading, GAP, Letters::Title);
    for (i, (name, rows)) in columns.iter().enumerate() {
        let x = GAP + i * (SIDE + GAP);
        canvas.text(x, head, Letters::Plain, FAINT, &shortened(name, SIDE / Letters::Plain.width()));
        let (balls, paper) = balls(space, rows, probe, observer)?;
        for (j, ball) in balls.iter().enumerate() {
            canvas.paste(x, head + line + j * (SIDE + GAP), ball, paper);
        }
    }
    Ok(canvas.finish())
}

/// The pixels of a document whose materials are the bases of another, one a pixel.
///
/// # Errors
/// None; weights of one channel a pixel always sum to one.
pub fn bases_alone(factored: &Factored) -> Result<Factored, appearance::weights::WeightError> {
    let n = factored.bases.len();
    let data = (0..n * n).map(|i| if i % n == i / n { ONE } else { 0 }).collect();
    let maps = appearance::weights::WeightMaps::new(n, 1, n, data)?;
    Ok(Factored { space: factored.space.clone(), bases: factored.bases.clone(), maps })
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::weights::WeightMaps;
    use observe::Silent;

    #[test]
    fn a_basis_is_light_where_it_is_and_dark_where_it_is_not() {
        let space = Space::half_angle(16);
        let mut bases = Table::new(space.columns());
        bases.push(&vec![0.27; space.columns()]);
        bases.push(&vec![0.01; space.columns()]);
        // The first on the left half, the second on the right.
        let data = (0..64 * 32).flat_map(|i| if i % 64 < 32 { [ONE, 0] } else { [0, ONE] }).collect();
        let factored = Factored { space, bases, maps: WeightMaps::new(64, 32, 2, data).unwrap() };
        let picture = weights_picture("two", &factored, &Probe::studio(16), &Silent).unwrap();
        let line = Letters::Plain.height() + 4;
        let top = GAP + Letters::Title.height() + GAP + line;
        let at = |basis: usize, x: usize, y: usize| {
            picture.at((GAP + basis * (SIDE + GAP) + x) as u32, (top + y) as u32)[1]
        };
        let map = SIDE + GAP / 2 + 40;
        for basis in 0..2 {
            let (own, other) = if basis == 0 { (30, 130) } else { (130, 30) };
            assert!(at(basis, own, map) > 240 && at(basis, other, map) < 10, "basis {basis}");
        }
        // The ball of paper is lighter than that of black.
        assert!(at(0, SIDE / 2, SIDE / 2) > 2 * at(1, SIDE / 2, SIDE / 2));
        let alone = bases_alone(&factored).unwrap();
        assert_eq!((alone.maps.at(0), alone.maps.at(1)), (&[ONE, 0][..], &[0, ONE][..]));
    }
}
