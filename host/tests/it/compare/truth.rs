//! What a comparison should say: figures over all dots, without a camera.

use std::path::Path;

use appearance::document;
use observe::Silent;

use super::camera::{DOTS_PER_MM, Picture, Sheet, Shot, Steps, V, dot, lit, minus};

/// A full pixel spoils what is read between it and the next, in mm.
const REACH: f64 = 0.11;

/// Mean light of the photograph as it would be without camera, of the prediction and of the document, over spots of the document's copy
/// that no full pixel of the photograph touches: a millimetre apart, with weights that fall to 0 a millimetre away.
pub struct Truth {
    pub spots: usize,
    pub photo: Vec<V>,
    pub print: Vec<V>,
    pub document: Vec<V>,
}

impl Truth {
    pub fn new(sheet: &Sheet, shot: &Shot, picture: &Picture, tile: &Path) -> Truth {
        let options = document::Options::default();
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
        // In mm, which are the squares that spots stand between.
        let (across, down) = (59usize, 39usize);
        let [mx, my] = sheet.middle();
        let (left, top) = ((copy.left as f64 - mx) / DOTS_PER_MM, (my - copy.top as f64) / DOTS_PER_MM);
        let mut spots = vec![(0.0, [[0.0; 3]; 3]); across * down];
        for y in 0..copy.length {
            for x in 0..copy.width {
                let (dx, dy) = (copy.left + x, copy.top + y);
                let place = [(dx as f64 + 0.5 - mx) / DOTS_PER_MM, (my - dy as f64 - 0.5) / DOTS_PER_MM];
                let (theta, irradiance) = lit(place, shot.eye, shot.lamp);
                let stack = usize::from(sheet.page.sheet.index()[dy * sheet.page.sheet.width() + dx]);
                let pixel = (y * materials.height() / copy.length) * materials.width()
                    + x * materials.width() / copy.width;
                let light = [&sheet.curves[stack], &sheet.library[stack], &curves[curve_of[pixel]]]
                    .map(|curve| curve.at(theta).map(|f| f * irradiance));
                let (u, v) = (
                    (x as f64 + 0.5) / copy.width as f64 * 60.0,
                    (y as f64 + 0.5) / copy.length as f64 * 40.0,
                );
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (u as usize + i, v as usize + j))
                {
                    if !(1..=across).contains(&i) || !(1..=down).contains(&j) {
                        continue;
                    }
                    let weight = (1.0 - (u - i as f64).abs()) * (1.0 - (v - j as f64).abs());
                    let (whole, sums) = &mut spots[(j - 1) * across + i - 1];
                    *whole += weight;
                    for (sum, light) in sums.iter_mut().zip(light) {
                        (0..3).for_each(|c| sum[c] += weight * light[c]);
                    }
                }
            }
        }
        let full = shot.full(picture);
        let touched = |i: usize| {
            full.iter().any(|[x, y]| {
                let off = |at: f64, k: usize| (at - (k + 1) as f64).abs() < 1.0 + REACH;
                off(x - left, i % across) && off(top - y, i / across)
            })
        };
        let mut truth =
            Truth { spots: spots.len(), photo: Vec::new(), print: Vec::new(), document: Vec::new() };
        for (_, (whole, sums)) in spots.into_iter().enumerate().filter(|(i, _)| !touched(*i)) {
            let [photo, print, document] = sums.map(|sum| sum.map(|v| v / whole));
            truth.photo.push(photo);
            truth.print.push(print);
            truth.document.push(document);
        }
        truth
    }
}

pub fn rms(a: &[V], b: &[V]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| dot(minus(*a, *b), minus(*a, *b))).sum::<f64>() / (3 * a.len()) as f64)
        .sqrt()
}

pub fn size(a: &[V]) -> f64 {
    rms(a, &vec![[0.0; 3]; a.len()])
}
