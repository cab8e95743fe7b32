//! Hard edges of pictures that are coarser than dots, or softened.
//!
//! Problem: a browser's screenshot has a pixel for four dots each way, and its letters fade into the ground. Drawn as pixels they have
//! steps, drawn as tones they are specks.
//! Method: a dot lies between four pixels. If these are about one colour, the dot is a tone between them. Otherwise the two that differ most
//! are followed to where the picture differs no more, at most [`Rules::far_mm`] away: to the two colours of an edge, of which one at least
//! fills 2 x 2 pixels. If the four lie between these two colours, within [`Rules::off`], each has a coverage, and the dot has one of the two
//! colours: by whether the coverage between the pixels is half. What is left is a tone.
//! Where pixels are dots, one that is softened takes the nearer of the two colours.
//! A stroke may be nowhere as dark as it was drawn. So the colour of one that fills no 2 x 2 pixels is the one that is farthest from the
//! ground where the stroke goes on within [`Rules::far_mm`], unless less than [`Rules::stroke`] of that colour is left here.
//! Cost: 5 ns a dot, 60 ns where pixels are dots, some 300 ns at an edge; a byte a pixel. Limits: corners are rounded by half a pixel; what is fainter than
//! [`Rules::tone`] is a tone.

use std::ops::Range;

use rayon::prelude::*;

use crate::colour::packed::{DRAWN, Key, colour, key};

/// What an edge is. A test moves each of these by a fifth.
#[derive(Clone, Copy)]
pub(crate) struct Rules {
    /// The largest difference in red, green or blue of pixels that are a tone.
    pub tone: u8,
    /// How far a pixel's colour may lie from the line between those of an edge.
    pub off: f32,
    /// How far away the colours of an edge may lie.
    pub far_mm: f64,
    /// So many of a pixel and its eight neighbours that are about one colour are an area; along a softened edge there are three.
    pub area: usize,
    /// The least part of a stroke's colour that is the stroke.
    pub stroke: f32,
}

impl Rules {
    pub const USUAL: Rules = Rules { tone: 12, off: 20.0, far_mm: 1.0, area: 5, stroke: 0.6 };
}

/// A picture whose edges are hard at the dots.
pub(crate) struct Edges<F> {
    pixel: F,
    width: usize,
    height: usize,
    /// For each column of dots the pixel before its middle and how far the middle is from there to the next, in 1/256.
    columns: Vec<(usize, u32)>,
    rows: Vec<(usize, u32)>,
    /// Pixels that have 2 x 2 of one colour near.
    near: Vec<bool>,
    far: usize,
    rules: Rules,
    /// Whether there is a pixel for each dot.
    are_dots: bool,
}

/// What lies between four pixels.
enum Between {
    Plain(Key),
    Tone([Key; 4]),
    /// The two colours, and how much each pixel has of the second, in 1/255.
    Edge([Key; 2], [u8; 4]),
}

impl<F: Fn(usize, usize) -> Key + Sync> Edges<F> {
    /// Of so many pixels and dots; `dpi` is that of the pixels.
    pub fn new(pixel: F, size: (usize, usize), dots: (usize, usize)) -> Edges<F> {
        Edges::by(Rules::USUAL, pixel, size, dots)
    }

    /// The same by these rules.
    pub fn by(rules: Rules, pixel: F, (width, height): (usize, usize), dots: (usize, usize)) -> Edges<F> {
        let are_dots = (width, height) == dots;
        let dpi = 600.0 * (width as f64 / dots.0 as f64).max(height as f64 / dots.1 as f64);
        let far = ((rules.far_mm * dpi / 25.4).round() as usize).clamp(2, 8);
        let near = near_flat(&pixel, (width, height), far);
        let (columns, rows) = (between(dots.0, width), between(dots.1, height));
        Edges { pixel, width, height, columns, rows, near, far, rules, are_dots }
    }

    /// The colours of rows of dots.
    pub fn read(&self, rows: Range<usize>, out: &mut [Key]) {
        let mut known = (usize::MAX, Vec::new());
        for (y, out) in rows.zip(out.chunks_exact_mut(self.columns.len())) {
            let (top, down) = self.rows[y];
            if top != known.0 {
                known.0 = top;
                known.1.clear();
                known.1.extend((0..self.width).map(|left| self.between(left, top)));
            }
            for (out, &(left, right)) in out.iter_mut().zip(&self.columns) {
                let parts =
                    [(256 - right) * (256 - down), right * (256 - down), (256 - right) * down, right * down];
                *out = match &known.1[left] {
                    Between::Plain(key) => *key,
                    Between::Tone(keys) => tone(keys, parts),
                    Between::Edge([first, second], covered) => {
                        let sum: u32 = covered.iter().zip(parts).map(|(&c, part)| u32::from(c) * part).sum();
                        if sum >= 128 << 16 { *second } else { *first }
                    }
                };
            }
        }
    }

    fn between(&self, left: usize, top: usize) -> Between {
        if self.are_dots {
            return self.own(left, top);
        }
        let (right, bottom) = ((left + 1).min(self.width - 1), (top + 1).min(self.height - 1));
        let places = [(left, top), (right, top), (left, bottom), (right, bottom)];
        let keys = places.map(|place| self.at(place));
        if keys.iter().all(|&key| key == keys[0]) {
            return Between::Plain(keys[0]);
        }
        if self.is_tone(&keys) || !self.near[top * self.width + left] {
            return Between::Tone(keys);
        }
        self.edge(&places, keys).unwrap_or(Between::Tone(keys))
    }

    /// What a pixel is that is a dot: only one that is softened changes.
    fn own(&self, x: usize, y: usize) -> Between {
        let own = self.at((x, y));
        let is_corner = colour(own).iter().all(|&v| v == 0 || v == 255);
        if is_corner || !self.near[y * self.width + x] {
            return Between::Plain(own);
        }
        let is_like = |place: &(usize, usize)| self.is_tone(&[own, self.at(*place)]);
        let is_area = self.around((x, y)).filter(is_like).nth(self.rules.area - 1).is_some();
        if is_area || self.is_flat((x, y)) {
            return Between::Plain(own);
        }
        let places: Vec<(usize, usize)> = self.around((x, y)).collect();
        self.edge(&places, [own; 4]).unwrap_or(Between::Plain(own))
    }

    /// The edge between pixels, of which `keys` are to be divided.
    fn edge(&self, places: &[(usize, usize)], keys: [Key; 4]) -> Option<Between> {
        let apart =
            |a: (usize, usize), b: (usize, usize)| square(minus(light(self.at(a)), light(self.at(b))));
        let pairs =
            places.iter().enumerate().flat_map(|(n, &a)| places[n + 1..].iter().map(move |&b| (a, b)));
        let (a, b) = pairs.max_by(|one, other| apart(one.0, one.1).total_cmp(&apart(other.0, other.1)))?;
        // From each away from the other.
        let first = self.follow(a, light(self.at(b)))?;
        let second = self.follow(b, light(self.at(first)))?;
        let first = self.follow(first, light(self.at(second)))?;
        let (ground, stroke) = match (self.is_flat(first), self.is_flat(second)) {
            (true, true) => return self.of(self.at(first), self.at(second), keys),
            (true, false) => (first, second),
            (false, true) => (second, first),
            (false, false) => {
                // In the counter of a letter neither is reached.
                let flat = self.nearest_flat(places[0])?;
                let to = |end: (usize, usize)| square(minus(light(self.at(end)), light(self.at(flat))));
                if to(first) < to(second) { (flat, second) } else { (flat, first) }
            }
        };
        let (ground, here) = (self.at(ground), self.at(stroke));
        let farthest = self.stroke(stroke, ground);
        let left = part(light(ground), light(farthest), light(here)).0;
        self.of(ground, if left >= self.rules.stroke { farthest } else { here }, keys)
    }

    /// Between two colours, if the four pixels are.
    fn of(&self, first: Key, second: Key, keys: [Key; 4]) -> Option<Between> {
        let (from, to) = (light(first), light(second));
        let parts = keys.map(|key| part(from, to, light(key)));
        let all = first != second && parts.iter().all(|&(_, off)| off <= self.rules.off);
        let covered = parts.map(|(part, _)| (255.0 * part.clamp(0.0, 1.0)).round() as u8);
        all.then_some(Between::Edge([first, second], covered))
    }

    /// Whether pixels are about one colour.
    fn is_tone(&self, keys: &[Key]) -> bool {
        (0..3).all(|c| {
            let range =
                keys.iter().map(|&key| colour(key)[c]).fold((255, 0), |(a, b), v| (v.min(a), v.max(b)));
            range.1.saturating_sub(range.0) <= self.rules.tone
        })
    }

    fn at(&self, (x, y): (usize, usize)) -> Key {
        (self.pixel)(x, y)
    }

    fn around(&self, (x, y): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
        let (right, bottom) = ((x + 2).min(self.width), (y + 2).min(self.height));
        (y.saturating_sub(1)..bottom).flat_map(move |v| (x.saturating_sub(1)..right).map(move |u| (u, v)))
    }

    /// Whether a pixel is one of 2 x 2 of one colour.
    fn is_flat(&self, (x, y): (usize, usize)) -> bool {
        let own = self.at((x, y));
        let corner = |left: usize, top: usize| {
            left + 1 < self.width
                && top + 1 < self.height
                && [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .all(|(u, v)| self.at((left + u, top + v)) == own)
        };
        let (left, top) = (x.saturating_sub(1)..=x, y.saturating_sub(1)..=y);
        top.into_iter().any(|top| left.clone().any(|left| corner(left, top)))
    }

    /// The nearest pixel that is one of 2 x 2 of one colour.
    fn nearest_flat(&self, (x, y): (usize, usize)) -> Option<(usize, usize)> {
        let place = |right: isize, down: isize| {
            let (x, y) = (x.checked_add_signed(right)?, y.checked_add_signed(down)?);
            (x < self.width && y < self.height).then_some((x, y))
        };
        (0..=self.far as isize).find_map(|ring| {
            let side = move || -ring..=ring;
            let all = side().flat_map(move |down| side().map(move |right| (right, down)));
            let ring = all.filter(|(right, down)| right.abs().max(down.abs()) == ring);
            ring.filter_map(|(right, down)| place(right, down)).find(|&place| self.is_flat(place))
        })
    }

    /// Where the picture is farthest from a colour, followed from one pixel to the next; `None` if it goes on as far as is looked: that is a
    /// shading.
    fn follow(&self, from: (usize, usize), away: [f32; 3]) -> Option<(usize, usize)> {
        let far = |place: (usize, usize)| square(minus(light(self.at(place)), away));
        let mut at = (from, far(from));
        for _ in 0..=self.far {
            if self.is_flat(at.0) {
                return Some(at.0);
            }
            let next = self.around(at.0).map(|place| (place, far(place)));
            match next.max_by(|one, other| one.1.total_cmp(&other.1)) {
                Some(next) if next.1 > at.1 => at = next,
                _ => return Some(at.0),
            }
        }
        None
    }

    /// The colour farthest from the ground that a stroke has near a place.
    fn stroke(&self, from: (usize, usize), ground: Key) -> Key {
        let side = 2 * self.far + 1;
        let ground = light(ground);
        let mut seen = [false; 17 * 17];
        let mut open = vec![from];
        let (mut best, mut best_at) = (square(minus(light(self.at(from)), ground)), from);
        let own = light(self.at(from));
        while let Some(place) = open.pop() {
            for next in self.around(place) {
                let (x, y) = (next.0 + self.far, next.1 + self.far);
                let inside = x >= from.0 && y >= from.1 && x - from.0 < side && y - from.1 < side;
                if !inside || std::mem::replace(&mut seen[(y - from.1) * side + x - from.0], true) {
                    continue;
                }
                let colour = light(self.at(next));
                let (left, off) = part(ground, own, colour);
                if left >= self.rules.stroke && off <= self.rules.off {
                    open.push(next);
                    let far = square(minus(colour, ground));
                    if far > best {
                        (best, best_at) = (far, next);
                    }
                }
            }
        }
        self.at(best_at)
    }
}

/// How far on the way from one colour to another a third is, and how far beside it.
fn part(from: [f32; 3], to: [f32; 3], colour: [f32; 3]) -> (f32, f32) {
    let (way, off) = (minus(to, from), minus(colour, from));
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let part = dot(off, way) / dot(way, way).max(1.0);
    let beside = minus(off, way.map(|v| part * v));
    (part, square(beside).sqrt())
}

fn light(key: Key) -> [f32; 3] {
    colour(key).map(f32::from)
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn square(a: [f32; 3]) -> f32 {
    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
}

/// The colour between four, whose parts sum to 65536.
fn tone(keys: &[Key; 4], parts: [u32; 4]) -> Key {
    let colours = keys.map(colour);
    let mean = |c: usize| {
        let sum: u32 = colours.iter().zip(parts).map(|(colour, part)| u32::from(colour[c]) * part).sum();
        ((sum + (1 << 15)) >> 16) as u8
    };
    key([mean(0), mean(1), mean(2)], keys[0] & DRAWN > 0)
}

/// For each dot the pixel before its middle, and how far the middle is from there to the next, in 1/256.
fn between(dots: usize, pixels: usize) -> Vec<(usize, u32)> {
    let place = |dot: usize| {
        // (dot + 1/2) * pixels / dots - 1/2.
        let twice = (2 * dot + 1) * pixels;
        let at = 256 * twice.saturating_sub(dots) / (2 * dots);
        (at / 256, (at % 256) as u32)
    };
    (0..dots).map(place).collect()
}

/// The pixels with 2 x 2 of one colour at most so far away.
fn near_flat(
    pixel: &(impl Fn(usize, usize) -> Key + Sync),
    (width, height): (usize, usize),
    far: usize,
) -> Vec<bool> {
    let mut across = vec![false; width * height];
    across.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        if y + 1 == height {
            return;
        }
        let mut until = 0;
        for x in 0..width - 1 {
            let own = pixel(x, y);
            if pixel(x + 1, y) == own && pixel(x, y + 1) == own && pixel(x + 1, y + 1) == own {
                let from = x.saturating_sub(far).max(until);
                until = (x + 2 + far).min(width);
                out[from..until].fill(true);
            }
        }
    });
    let mut near = vec![false; width * height];
    near.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for row in across.chunks_exact(width).take((y + far + 1).min(height)).skip(y.saturating_sub(far + 1))
        {
            out.iter_mut().zip(row).for_each(|(out, &near)| *out |= near);
        }
    });
    near
}
