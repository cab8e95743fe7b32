//! Letters that something shows through: text at an opacity of 80 % over a shading or a photograph.
//!
//! Problem: where objects are transparent, Ghostscript's tag has the bits of all of them. A letter over a picture, or under a faint one, is
//! text and a picture, in colours that vary with what is behind it.
//! Method: what touches and is both is a letter if its colours are near each other, and if their mean can be told from what is beside
//! it: text that a picture hides is of its colours. All of the letter takes the mean, or one like it that another letter has.
//! Cost: a look at each pixel of a page with tags. Limits: [`MOST`] colours; letters with texture are part of the picture.

use std::ops::Range;

use rayon::prelude::*;

use super::flat::{similar, split};
use super::kinds::{BYTES, ObjectType};
use super::looks::apart;
use super::main_colours::WHITE_AND_BLACK;
use super::posters::Span;
use sheet::forest::{Forest, beside};

/// The tag of such a letter.
const BOTH: u8 = ObjectType::TEXT | ObjectType::PICTURE;
/// The most that the colours of a letter may differ in each of red, green and blue.
const EVEN: u8 = 80;
/// How far a letter must be from what is beside it.
const PLAIN: f64 = 0.1;
/// The most colours of such letters on a page.
const MOST: usize = 64;

/// Sums over pixels.
#[derive(Clone)]
struct Colours {
    least: [u8; 3],
    most: [u8; 3],
    sum: [u64; 3],
    count: u64,
}

impl Colours {
    fn none() -> Colours {
        Colours { least: [u8::MAX; 3], most: [0; 3], sum: [0; 3], count: 0 }
    }

    fn add(&mut self, colour: [u8; 3]) {
        for (c, v) in colour.into_iter().enumerate() {
            self.least[c] = self.least[c].min(v);
            self.most[c] = self.most[c].max(v);
            self.sum[c] += u64::from(v);
        }
        self.count += 1;
    }

    fn mean(&self) -> Option<[u8; 3]> {
        (self.count > 0).then(|| self.sum.map(|sum| (sum / self.count) as u8))
    }
}

/// The stretches of such letters, with the colour of each letter.
pub(super) fn letters<const N: usize>(pixels: &[[u8; N]], width: usize) -> Vec<Span> {
    if N != BYTES {
        return Vec::new();
    }
    // White and black are no tones wherever they are.
    let is_both = |pixel: &[u8; N]| pixel[0] & BOTH == BOTH && !WHITE_AND_BLACK.contains(&split(pixel).1);
    let rows = pixels.par_chunks(width).enumerate().map(|(y, row)| stretches(row, y * width, is_both));
    let stretches: Vec<Range<usize>> = rows.collect::<Vec<_>>().into_iter().flatten().collect();
    let roots = Forest::of_stretches(&stretches, width, |_, _| true).roots();
    let mut found = vec![[Colours::none(), Colours::none()]; stretches.len()];
    for (stretch, &root) in stretches.iter().zip(&roots) {
        let [own, border] = &mut found[root as usize];
        pixels[stretch.clone()].iter().for_each(|pixel| own.add(split(pixel).1));
        let around = beside(stretch.clone(), width).filter_map(|at| pixels.get(at));
        around.filter(|pixel| !is_both(pixel)).for_each(|pixel| border.add(split(pixel).1));
    }
    let mut chosen: Vec<[u8; 3]> = Vec::new();
    let colours: Vec<Option<[u8; 3]>> = found
        .iter()
        .map(|[own, beside]| {
            let mean = own.mean()?;
            let even = (0..3).all(|c| own.most[c] - own.least[c] <= EVEN);
            if !even || beside.mean().is_some_and(|beside| apart(mean, beside) < PLAIN) {
                return None;
            }
            let known = chosen.iter().copied().find(|&known| similar(known, mean));
            known.or_else(|| {
                (chosen.len() < MOST).then(|| {
                    chosen.push(mean);
                    mean
                })
            })
        })
        .collect();
    let spans = stretches
        .into_iter()
        .zip(roots)
        .filter_map(|(stretch, root)| Some((stretch, colours[root as usize]?)));
    spans.collect()
}

/// The stretches of a row, which begins at a pixel of the page, of pixels that are so.
fn stretches<P>(row: &[P], start: usize, is: impl Fn(&P) -> bool) -> Vec<Range<usize>> {
    let mut at = start;
    let runs = row.chunk_by(|a, b| is(a) == is(b)).map(|run| {
        at += run.len();
        (is(&run[0]), at - run.len()..at)
    });
    runs.filter_map(|(is, run)| is.then_some(run)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters 5 wide and 12 high, 10 apart, over or under what is behind them.
    fn page(
        letter: impl Fn(usize, usize) -> [u8; 3],
        ground: impl Fn(usize, usize) -> [u8; 3],
    ) -> Vec<[u8; 4]> {
        let pixel = |at: usize| {
            let (x, y) = (at % 60, at / 60);
            let (tag, [r, g, b]) =
                if is_letter(at) { (BOTH, letter(x, y)) } else { (ObjectType::PICTURE, ground(x, y)) };
            [tag, r, g, b]
        };
        (0..60 * 20).map(pixel).collect()
    }

    fn is_letter(at: usize) -> bool {
        (at % 60) % 10 < 5 && (4..16).contains(&(at / 60))
    }

    #[test]
    fn letters_over_a_shading_take_their_mean() {
        let ground = |x: usize, y: usize| [x as u8, 100 + y as u8, 200];
        // White at 80 %.
        let over = |x, y| ground(x, y).map(|v| ((255 * 4 + u32::from(v)) / 5) as u8);
        let page = page(over, ground);
        let found = letters(&page, 60);
        let dots: usize = found.iter().map(|(span, _)| span.len()).sum();
        assert_eq!(dots, (0..60 * 20).filter(|&at| is_letter(at)).count());
        let mut colours: Vec<[u8; 3]> = found.iter().map(|&(_, colour)| colour).collect();
        for (span, colour) in found {
            for at in span {
                assert!(is_letter(at) && similar(colour, split(&page[at]).1), "{at}: {colour:?}");
            }
        }
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 1, "letters that are alike have one colour: {colours:?}");
    }

    #[test]
    fn what_a_picture_hides_or_gives_texture_is_no_letter() {
        let ground = |x: usize, y: usize| [x as u8, 100 + y as u8, 200];
        assert!(letters(&page(ground, ground), 60).is_empty());
        let texture = |x: usize, y: usize| [((x * 7 + y * 13) % 5 * 50) as u8, 30, 30];
        assert!(letters(&page(texture, ground), 60).is_empty());
        // In three bytes there are no tags.
        assert!(letters(&[[3, 3, 3]; 4], 2).is_empty());
    }
}
