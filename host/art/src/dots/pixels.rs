//! The pixels of a picture, and their colours at the dots.
//!
//! Problem: a page has a pixel for each dot, a picture has more or fewer.
//! Method: pictures that are no finer than dots are made hard at edges and smooth elsewhere ([`Edges`]). Otherwise a dot has the colour of the pixel that it is. Of several, those whose middles lie in it, it has the colour that at least half
//! of them have, the darkest of these, and otherwise the average of their light: so lines that are half a dot wide stay whole.
//! Cost: 1 ns a dot where pixels are dots, 10 ns where they are finer. Limits: 8 bits a channel.

use std::ops::Range;
use std::sync::LazyLock;

use crate::colour::packed::{DRAWN, Key, LABEL, colour, key, of_drawn};
use crate::dots::edges::Edges;
use crate::dots::resample;
use crate::dots::turn;
use crate::read::object_type::{BYTES, INKS_OF_PICTURES, ObjectType, split};
use appearance::srgb;
use appearance::wide::wide;
use rayon::prelude::*;
use sheet::Turn;

/// Pixels that are looked at together: most of a page is paper.
const BLOCK: usize = 32;

/// Rows that are read at once.
const STRIP: usize = 64;

/// Writes the colours of rows of dots.
pub(crate) type Rows<'a> = dyn Fn(Range<usize>, &mut [Key]) + Sync + 'a;

/// Pixels of red, green and blue, row by row from the top; 255, 255, 255 is bare paper.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Pixels {
    /// Three bytes a pixel, or four with a tag before them ([`ObjectType`]).
    pub bytes: Vec<u8>,
    pub each: usize,
    pub width: usize,
    pub height: usize,
}

impl Pixels {
    /// The same pixels, turned.
    pub fn turned(self, turn: Turn) -> Pixels {
        let size = (self.width, self.height);
        let (width, height) = turn.sides(size);
        Pixels { bytes: turn::samples(self.bytes, self.each, size, turn), width, height, ..self }
    }

    /// What writes the colours of rows of so many dots; `labels` says whether text is a label.
    pub fn rows(&self, dots: (usize, usize), labels: bool) -> Box<Rows<'_>> {
        match self.each {
            BYTES => self.rows_of::<BYTES>(dots, labels),
            _ => self.rows_of::<3>(dots, labels),
        }
    }

    /// The picture with a pixel for each dot, four bytes each.
    pub fn at_dots(&self, dots: (usize, usize)) -> Vec<u8> {
        let rows = self.rows(dots, true);
        let mut out = vec![0; BYTES * dots.0 * dots.1];
        out.par_chunks_mut(BYTES * dots.0 * STRIP).enumerate().for_each(|(number, out)| {
            let pixels = out.as_chunks_mut::<BYTES>().0;
            let (top, mut keys) = (number * STRIP, vec![0; pixels.len()]);
            rows(top..top + pixels.len() / dots.0, &mut keys);
            for (pixel, key) in pixels.iter_mut().zip(keys) {
                let [r, g, b] = colour(key);
                let tag = match () {
                    () if key & LABEL > 0 => ObjectType::TEXT,
                    () if key & DRAWN > 0 => ObjectType::DRAWING,
                    () => ObjectType::PICTURE,
                };
                *pixel = [tag, r, g, b];
            }
        });
        out
    }

    fn rows_of<const N: usize>(&self, dots: (usize, usize), labels: bool) -> Box<Rows<'_>> {
        let (size, pixels) = ((self.width, self.height), self.bytes.as_chunks::<N>().0);
        // Pages with tags are drawn without soft edges, but for their pictures.
        let may_be_soft = size.0 <= dots.0 && size.1 <= dots.1 && (size != dots || N < BYTES);
        if may_be_soft {
            let edges = Edges::new(move |x, y| key_of(&pixels[y * size.0 + x], labels), size, dots);
            return Box::new(move |rows, out| edges.read(rows, out));
        }
        Box::new(move |rows, out| {
            rows.zip(out.chunks_exact_mut(dots.0))
                .for_each(|(y, out)| row(pixels, (size, dots), labels, y, out));
        })
    }
}

#[inline(always)]
fn key_of<const N: usize>(pixel: &[u8; N], labels: bool) -> Key {
    let (kind, colour) = split(pixel);
    if N < BYTES || kind != ObjectType::Picture {
        return of_drawn(kind, colour, labels);
    }
    // All are compared, without a branch.
    let own = key(colour, false);
    INKS_OF_PICTURES
        .iter()
        .fold(own, |found, &(of, named)| if own == key(of, false) { key(named, false) } else { found })
}

fn row<const N: usize>(
    pixels: &[[u8; N]],
    ((width, height), dots): ((usize, usize), (usize, usize)),
    labels: bool,
    y: usize,
    out: &mut [Key],
) {
    let rows = resample::pixels(y, height, dots.1);
    if dots.0 == width && rows.len() == 1 {
        let row = &pixels[rows.start * width..][..width];
        wide(
            #[inline(always)]
            || {
                for (out, pixels) in out.chunks_mut(BLOCK).zip(row.chunks(BLOCK)) {
                    if pixels.iter().fold(true, |all, pixel| all & (*pixel == pixels[0])) {
                        out.fill(key_of(&pixels[0], labels));
                    } else {
                        out.iter_mut().zip(pixels).for_each(|(out, pixel)| *out = key_of(pixel, labels));
                    }
                }
            },
        );
        return;
    }
    let mut under = Vec::new();
    for (x, out) in out.iter_mut().enumerate() {
        let columns = resample::pixels(x, width, dots.0);
        under.clear();
        for row in rows.clone() {
            let row = &pixels[row * width..][..width];
            under.extend(row[columns.clone()].iter().map(|pixel| key_of(pixel, labels)));
        }
        *out = joined(&mut under);
    }
}

/// The colour of a dot with these pixels.
fn joined(under: &mut [Key]) -> Key {
    if under.iter().all(|key| *key == under[0]) {
        return under[0];
    }
    under.sort_unstable();
    let runs = under.chunk_by(|a, b| a == b);
    let darkness = |key: Key| std::cmp::Reverse(colour(key).iter().map(|&v| u32::from(v)).sum::<u32>());
    match runs.max_by_key(|run| (run.len(), darkness(run[0]))) {
        Some(run) if 2 * run.len() >= under.len() => run[0],
        _ => average(under),
    }
}

/// The colour with the mean of their light.
pub(crate) fn average(keys: &[Key]) -> Key {
    static LIGHT: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|value| srgb::decode(value as f32 / 255.0)));
    let mean = |c: usize| {
        let sum: f32 = keys.iter().map(|&key| LIGHT[usize::from(colour(key)[c])]).sum();
        (255.0 * srgb::encode(sum / keys.len() as f32)).round() as u8
    };
    key([mean(0), mean(1), mean(2)], keys[0] & DRAWN > 0)
}
