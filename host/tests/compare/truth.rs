//! What a comparison should say: figures over all dots, without a camera.

use std::path::Path;

use appearance::document;
use observe::Silent;

use crate::camera::{DOTS_PER_MM, Picture, Sheet, Shot, Steps, V, dot, lit, minus};

/// A full pixel spoils what is read between it and the next, in mm.
const REACH: f64 = 0.11;

/// Mean light of the photograph as it would be without camera, of the prediction and of the document, over squares of the
/// document's copy that no full pixel of the photograph touches.
pub struct Truth {
    pub squares: usize,
    pub photo: Vec<V>,
    pub print: Vec<V>,
    pub document: Vec<V>,
}

impl Truth {
    pub fn new(sheet: &Sheet, shot: &Shot, picture: &Picture, tile: &Path) -> Truth {
        let options = document::Options { material: None, colour_space: None, samples: document::SAMPLES };
        let document = document::open(tile.to_str().unwrap(), &options, &Silent).unwrap();
        let materials = document.materials();
        let space = materials.space();
        // Few pixels differ.
        let (mut rows, mut curves, mut curve_of) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..materials.width() * materials.height() {
            let mut row = vec![0.0f32; space.columns()];
            materials.reflectance(pixel, &mut row);
            let known = rows.iter().position(|known| *known == row).unwrap_or_else(|| {
                let curve = space.curve(&row.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
                curves.push(Steps::new(&curve, [1.0; 3]));
                rows.push(row);
                rows.len() - 1
            });
            curve_of.push(known);
        }
        let copy = sheet.page.laid.copies[0];
        let (across, down) = (60usize, 40usize);
        let mut squares =
            Truth { squares: across * down, photo: Vec::new(), print: Vec::new(), document: Vec::new() };
        let [mx, my] = sheet.middle();
        let (left, top) = ((copy.left as f64 - mx) / DOTS_PER_MM, (my - copy.top as f64) / DOTS_PER_MM);
        let full = shot.full(picture);
        let touched = |i: usize, j: usize| {
            full.iter().any(|[x, y]| {
                let off = |at: f64, k: usize| (at - k as f64 - 0.5).abs() < 0.5 + REACH;
                off(x - left, i) && off(top - y, j)
            })
        };
        for j in 0..down {
            for i in (0..across).filter(|i| !touched(*i, j)) {
                let range = |k: usize, side: usize, count: usize| {
                    (k * side).div_ceil(count)..((k + 1) * side).div_ceil(count)
                };
                let mut sums = [[0.0; 3]; 3];
                let mut count = 0.0;
                for y in range(j, copy.length, down) {
                    for x in range(i, copy.width, across) {
                        let (dx, dy) = (copy.left + x, copy.top + y);
                        let place =
                            [(dx as f64 + 0.5 - mx) / DOTS_PER_MM, (my - dy as f64 - 0.5) / DOTS_PER_MM];
                        let (theta, irradiance) = lit(place, shot.eye, shot.lamp);
                        let stack = usize::from(sheet.page.sheet.index()[dy * sheet.page.sheet.width() + dx]);
                        let pixel = (y * materials.height() / copy.length) * materials.width()
                            + x * materials.width() / copy.width;
                        let curves = [&sheet.curves[stack], &sheet.library[stack], &curves[curve_of[pixel]]];
                        for (sum, curve) in sums.iter_mut().zip(curves) {
                            let f = curve.at(theta);
                            (0..3).for_each(|c| sum[c] += f[c] * irradiance);
                        }
                        count += 1.0;
                    }
                }
                let [photo, print, document] = sums.map(|sum| sum.map(|v| v / count));
                squares.photo.push(photo);
                squares.print.push(print);
                squares.document.push(document);
            }
        }
        squares
    }
}

pub fn rms(a: &[V], b: &[V]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| dot(minus(*a, *b), minus(*a, *b))).sum::<f64>() / (3 * a.len()) as f64)
        .sqrt()
}

pub fn size(a: &[V]) -> f64 {
    rms(a, &vec![[0.0; 3]; a.len()])
}
