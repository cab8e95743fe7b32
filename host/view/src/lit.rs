//! What is lit: curves over the half angle, and the weight of each at every place of the sheet.
//!
//! Problem: one renderer for documents, mixtures and millions of printed dots.
//! Method: reflectance is linear, so all three are sums of a few curves with weights that add up to 1: bases for a document,
//! stacks for dots. A pixel of a map is the mean over exactly the area it covers, and a pyramid of maps, each half as wide
//! as the one before, gives the mean over any larger area (Williams 1983).
//! Printed dots stay beside their maps ([`Dots`]), for pixels that see few of them.
//! Cost: 4 bytes for each weight, and a third more for the pyramid; a byte for each dot. Limits: detail of documents that is finer than
//! a pixel of the map is averaged.

use appearance::brdf::{Table, reflectances};
use appearance::factor::Factored;
use appearance::gamut::InkMix;
use appearance::weights::ONE;
use inks::{Curve, Library};
use press::preview::Source;
use rayon::prelude::*;
use sheet::{Area, DotMap};

use crate::error::ViewError;

/// Most curves of one picture: as many as a dot map can have stacks.
const MOST_CURVES: usize = 256;

/// Pixels of fewer dots than this look at the dots, as in the page.
const FEW: f32 = 2.0;

/// Pixels of more dots than this never do: they would look at more than 256 places.
const MOST_FEW: f32 = 8.0;

/// Sides of maps are multiples of this, so that the first levels of the pyramid halve exactly.
const STEP: usize = 32;

/// Weights of a place are stored in groups of this many, so that products run in lanes.
pub(crate) const LANES: usize = 8;

/// A document, a mixture or a printed sheet, ready to be lit. See the module text.
pub struct Lit {
    /// Width and height in metres.
    pub(crate) size: [f64; 2],
    pub(crate) curves: Vec<Curve>,
    /// Weights of a place: as many as curves, rounded up to whole lanes.
    pub(crate) stride: usize,
    pub(crate) levels: Vec<Level>,
    /// The dots of a print.
    pub(crate) dots: Option<Dots>,
    /// With dot gain, the flat body of each curve: the last three weights of a place are what its bodies lose.
    pub(crate) bodies: Vec<[f32; 3]>,
}

/// Printed dots, each with the number of its curve.
pub(crate) struct Dots {
    pub width: usize,
    pub height: usize,
    pub curves: Vec<u8>,
    /// Dots of a metre across and down.
    pub density: [f32; 2],
    /// Pixels of fewer dots than this look at them.
    pub few: f32,
}

/// One level of the pyramid.
pub(crate) struct Level {
    pub width: usize,
    pub height: usize,
    /// Row by row from the top, `stride` weights a place.
    pub weights: Vec<f32>,
}

/// The size of a weight map for a source of so many pixels or dots, with at most `longest` on the longer side.
pub fn fit((width, height): (usize, usize), longest: usize) -> (usize, usize) {
    let most = longest.max(STEP) / STEP * STEP;
    let scale = (most as f64 / width.max(height).max(1) as f64).min(1.0);
    let side = |side: usize| ((side as f64 * scale).ceil() as usize).next_multiple_of(STEP).min(most);
    (side(width.max(1)), side(height.max(1)))
}

/// The bases of a mapped document are mixtures of stacks.
pub fn mapped(mix: InkMix, library: &Library, space: &appearance::brdf::Space) -> Factored {
    let stacks = reflectances(&mix.stacks, library, space);
    let mut bases = Table::new(space.columns());
    for shares in &mix.matrix {
        let mut row = vec![0.0; space.columns()];
        for (&share, stack) in shares.iter().zip(stacks.rows()) {
            let share = f64::from(share) / f64::from(ONE);
            row.iter_mut().zip(stack).for_each(|(sum, f)| *sum += share * f);
        }
        bases.push(&row);
    }
    Factored { space: space.clone(), bases, maps: mix.maps }
}

impl Lit {
    /// Reads a factored document or a sheet of this size on paper (metres), with at most `longest` places on its longer side.
    ///
    /// # Errors
    /// A document that is not factored, too many materials, a size that is no length, tables that do not match each other.
    pub fn new(source: &Source, size: [f64; 2], longest: usize) -> Result<Lit, ViewError> {
        if !size.iter().all(|side| (1e-5..=10.0).contains(side)) {
            return Err(ViewError::Size { width: size[0], height: size[1] });
        }
        let space = source.space();
        let rows: Vec<&[f64]> = match source {
            Source::Document(_) => return Err(ViewError::NotFactored),
            Source::Factored(factored) => factored.bases.rows().collect(),
            Source::Print { stacks, .. } => stacks.rows().collect(),
        };
        if rows.len() > MOST_CURVES {
            return Err(ViewError::Materials { found: rows.len(), most: MOST_CURVES });
        }
        let (width, height) = fit(source.size(), longest);
        let shares = source.shares(width, height)?.ok_or(ViewError::NotFactored)?;
        // What occurs nowhere costs nothing.
        let channels = rows.len();
        let most = shares
            .par_chunks_exact(channels)
            .fold(|| vec![0.0f32; channels], greatest)
            .reduce(|| vec![0.0; channels], |most, pixel| greatest(most, &pixel));
        let used: Vec<usize> = (0..channels).filter(|&i| most[i] > 0.0).collect();
        let stride = used.len().next_multiple_of(LANES);
        let mut weights = vec![0.0; width * height * stride];
        weights.par_chunks_exact_mut(stride).zip(shares.par_chunks_exact(channels)).for_each(
            |(out, pixel)| {
                out.iter_mut().zip(&used).for_each(|(out, &i)| *out = pixel[i]);
            },
        );
        drop(shares);
        let levels = pyramid(Level { width, height, weights }, stride);
        let dots = match source {
            Source::Print { dots, area, .. } => Some(Dots::new(dots, area, &used, size, [width, height])),
            _ => None,
        };
        let curves = used.iter().map(|&i| space.curve(rows[i])).collect();
        Ok(Lit { size, curves, stride, levels, dots, bodies: Vec::new() })
    }

    /// Width and height of the sheet in metres.
    pub fn size(&self) -> [f64; 2] {
        self.size
    }
}

impl Dots {
    /// The dots of an area that is as large as the sheet. `used` are the stacks of the curves, and `places` those of the finest map.
    fn new(dots: &DotMap, area: &Area, used: &[usize], size: [f64; 2], places: [usize; 2]) -> Dots {
        let mut number = [0u8; MOST_CURVES];
        used.iter().enumerate().for_each(|(curve, &stack)| number[stack] = curve as u8);
        let row = |y: usize| &dots.index()[(area.top + y) * dots.width() + area.left..][..area.width];
        let curves = (0..area.length)
            .into_par_iter()
            .flat_map_iter(|y| row(y).iter().map(|&stack| number[usize::from(stack)]));
        let (width, height) = (area.width, area.length);
        // Where a pixel is smaller than a place of the map, too.
        let place = (width as f32 / places[0] as f32).max(height as f32 / places[1] as f32);
        Dots {
            width,
            height,
            curves: curves.collect(),
            density: [width as f32 / size[0] as f32, height as f32 / size[1] as f32],
            few: place.clamp(FEW, MOST_FEW),
        }
    }
}

fn greatest(mut most: Vec<f32>, pixel: &[f32]) -> Vec<f32> {
    most.iter_mut().zip(pixel).for_each(|(most, &w)| *most = most.max(w));
    most
}

/// A level and all smaller ones, down to a single place.
pub(crate) fn pyramid(first: Level, stride: usize) -> Vec<Level> {
    let mut levels = vec![first];
    while let Some(last) = levels.last()
        && last.width.max(last.height) > 1
    {
        levels.push(halved(last, stride));
    }
    levels
}

/// The next level: sides halved and rounded down, every place the mean over the area it covers.
fn halved(level: &Level, stride: usize) -> Level {
    let (width, height) = ((level.width / 2).max(1), (level.height / 2).max(1));
    let mut weights = vec![0.0; width * height * stride];
    weights.par_chunks_exact_mut(width * stride).enumerate().for_each(|(y, row)| {
        for (x, out) in row.chunks_exact_mut(stride).enumerate() {
            for (py, down) in covered(y, height, level.height) {
                for (px, across) in covered(x, width, level.width) {
                    let part = down * across;
                    let from = &level.weights[(py * level.width + px) * stride..][..stride];
                    out.iter_mut().zip(from).for_each(|(out, &w)| *out += part * w);
                }
            }
        }
    });
    Level { width, height, weights }
}

/// The places that part `i` of `parts` covers of a side, with their shares, which sum to 1.
fn covered(i: usize, parts: usize, side: usize) -> impl Iterator<Item = (usize, f32)> {
    appearance::materials::Cover::new(i, parts, side)
        .shares()
        .collect::<Vec<_>>()
        .into_iter()
        .map(move |(place, share)| (place, share as f32 / side as f32))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use appearance::brdf::Space;
    use appearance::weights::WeightMaps;

    /// One curve everywhere.
    pub fn uniform(size: [f64; 2], f: impl FnMut(f64) -> [f64; 3]) -> Lit {
        // So many angles that reading between them does not matter.
        let space = Space::half_angle(512);
        let mut bases = Table::new(space.columns());
        bases.push(&space.row(&Curve::sampled(space.angles(), f)));
        let factored = Factored { space, bases, maps: WeightMaps::uniform(4, 4) };
        Lit::new(&Source::Factored(&factored), size, 64).unwrap()
    }

    #[test]
    fn every_level_holds_all_weights() {
        let space = Space::half_angle(4);
        let mut bases = Table::new(space.columns());
        (0..3).for_each(|i| bases.push(&[0.1 * f64::from(i); 12]));
        // The second basis is nowhere.
        let data = (0..70 * 45u16).flat_map(|i| [i * 7 % ONE, 0, ONE - i * 7 % ONE]).collect();
        let maps = WeightMaps::new(70, 45, 3, data).unwrap();
        let factored = Factored { space, bases, maps };
        let lit = Lit::new(&Source::Factored(&factored), [0.07, 0.045], 1024).unwrap();
        assert_eq!((lit.curves.len(), lit.stride), (2, LANES));
        assert_eq!((lit.levels[0].width, lit.levels[0].height), (96, 64));
        let mean = |level: &Level, c: usize| {
            let sum: f64 = level.weights.chunks_exact(LANES).map(|w| f64::from(w[c])).sum();
            sum / (level.width * level.height) as f64
        };
        let shares = factored.shares();
        for level in &lit.levels {
            assert!((mean(level, 0) - shares[0]).abs() < 1e-5 && (mean(level, 1) - shares[2]).abs() < 1e-5);
        }
        assert_eq!(lit.levels.last().map(|level| (level.width, level.height)), Some((1, 1)));
    }

    #[test]
    fn sizes_keep_proportions_and_halve() {
        assert_eq!(fit((512, 512), 1024), (512, 512));
        assert_eq!(fit((4800, 6372), 1024), (800, 1024));
        assert_eq!(fit((3, 1), 1024), (32, 32));
    }

    #[test]
    fn sizes_that_are_no_lengths_are_refused() {
        let factored = |size| {
            let space = Space::half_angle(4);
            let mut bases = Table::new(12);
            bases.push(&[0.1; 12]);
            let factored = Factored { space, bases, maps: WeightMaps::uniform(4, 4) };
            Lit::new(&Source::Factored(&factored), size, 64).err().map(|error| error.to_string())
        };
        for size in [[0.0, 0.1], [f64::NAN, 0.1], [0.1, 1e9], [0.1, -1.0]] {
            assert!(factored(size).is_some_and(|said| said.contains("each side must be")));
        }
    }
}
