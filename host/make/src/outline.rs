//! A document as mixtures of a few materials, as the page of its sheet shows it beside the print.
//!
//! Problem: a page lights a document by its bases, and most documents come without. Bases that are good
//! enough to print by take longer than the print. Method: fewer bases, learnt from fewer materials, and
//! weights where the page has places; of a document that is much finer, every n-th pixel is looked at.
//! Cost: a second or two. Limits: for pictures alone; most pixels of a leaf are within .005 of their own
//! look, where .01 is barely visible, and the page says how near they are.

use appearance::brdf::Space;
use appearance::factor::{self, FactorError, FactorSettings, Factoring};
use appearance::materials::{Materials, Reduced, resolution};
use observe::Observer;
use view::fit;

/// Bases.
const BASES: usize = 8;
/// Places along the longer side of the document, and pixels that are looked at for each along a side.
const PLACES: (usize, usize) = (512, 2);

/// A document in a few materials.
pub(crate) fn of(
    document: &dyn Materials,
    seed: u64,
    observer: &dyn Observer,
) -> Result<Factoring, FactorError> {
    let longer = document.width().max(document.height());
    let every = Every { document, step: (longer / (PLACES.0 * PLACES.1)).max(1) };
    let pixels = (every.width(), every.height());
    let settings = FactorSettings { bases: Some(BASES), seed, ..FactorSettings::default() };
    match resolution(pixels, fit(pixels, PLACES.0)) {
        Some(cells) => factor::outline(&Reduced::new(&every, cells), &settings, observer),
        None => factor::outline(&every, &settings, observer),
    }
}

/// Every so many pixels of a document, along and across.
struct Every<'a> {
    document: &'a dyn Materials,
    step: usize,
}

impl Every<'_> {
    fn at(&self, pixel: usize) -> usize {
        let (x, y) = (pixel % self.width(), pixel / self.width());
        y * self.step * self.document.width() + x * self.step
    }
}

impl Materials for Every<'_> {
    fn width(&self) -> usize {
        self.document.width().div_ceil(self.step)
    }
    fn height(&self) -> usize {
        self.document.height().div_ceil(self.step)
    }
    fn space(&self) -> &Space {
        self.document.space()
    }
    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        self.document.reflectance(self.at(pixel), out);
    }
    fn add(&self, pixel: usize, part: f32, out: &mut [f32]) {
        self.document.add(self.at(pixel), part, out);
    }
    fn key(&self, pixel: usize, row: &mut [f32]) -> u64 {
        self.document.key(self.at(pixel), row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use appearance::brdf::Table;
    use appearance::factor::Factored;
    use appearance::weights::{ONE, WeightMaps};
    use observe::Silent;

    #[test]
    fn a_fine_document_is_shown_as_it_is() {
        let space = Space::half_angle(8);
        let side = 2200;
        let mut bases = Table::new(space.columns());
        [0.6, 0.05].iter().for_each(|&light| bases.push(&vec![light; space.columns()]));
        let weights = (0..40 * side).flat_map(|i| if i % side < side / 2 { [ONE, 0] } else { [0, ONE] });
        let maps = WeightMaps::new(side, 40, 2, weights.collect()).unwrap();
        let document = Factored { space: space.clone(), bases, maps };
        let found = of(&document, 1, &Silent).unwrap();
        let (width, height) = (found.factored.maps.width(), found.factored.maps.height());
        assert!(width <= 512 && height < width && found.report.rmse < 1e-3, "{width} x {height}");
        for (place, original) in [(0, 0), (width - 1, side - 1)] {
            let (mut shown, mut right) = (vec![0.0; space.columns()], vec![0.0; space.columns()]);
            found.factored.reflectance(place, &mut shown);
            document.reflectance(original, &mut right);
            let wide = |row: &[f32]| row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>();
            assert!(space.distance(&wide(&shown), &wide(&right)) < 2e-3);
        }
    }
}
