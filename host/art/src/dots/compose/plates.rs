//! Plates of process inks with tones, whose dots are picked together.
//!
//! Problem: plates that are each picked from one table lie on each other: a third of cyan and a third of magenta would be blue on a third.
//! Method: the coverages of a dot are a mixture of all stacks of the plates, each with the share that it has where plates know nothing
//! of each other (Demichel's equations). The stacks lie in order of lightness on [0, 1), the darkest first, and the threshold of the
//! green noise at the dot picks one, as for colours.
//! Cost: 20 ns a dot that has tones. Limits: four plates, each of another ink.

use inks::{InkSet, Library, Stack};
use protocol::ink::Ink;
use rayon::prelude::*;

use crate::colour::largest_cluster;
use crate::colour::solids::Solids;
use appearance::brdf::Space;
use appearance::document::SAMPLES;
use appearance::gamut::Printable;
use appearance::weights::ONE;
use halftone::green_noise::{SIDE, Table};
use observe::Diagnosis;
use sheet::{Plane, pack};

/// Plates that are picked together: one for each process ink, so that no set needs more.
pub(super) const MOST: usize = 4;
/// Sets of plates, a bit each.
const SETS: usize = 1 << MOST;

/// The dots of each of at most [`MOST`] plates with these inks, a byte of coverage a dot in rows of `width`.
pub(super) fn picked(
    plates: &[(Ink, &[u8])],
    width: usize,
    library: &Library,
) -> Result<Vec<Plane>, Diagnosis> {
    let inks = InkSet::of(plates.iter().map(|(ink, _)| *ink));
    let table = Table::for_cluster(largest_cluster(&inks, library)?);
    let order = by_lightness(plates, &inks, library);
    let dots = plates.first().map_or(0, |(_, plate)| plate.len());
    let mut index = vec![0u8; dots];
    index.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, out)| {
        let thresholds = table.row(y);
        let mut last = ([0; MOST], [0; SETS]);
        for (x, out) in out.iter_mut().enumerate() {
            let mut covered = [0; MOST];
            covered.iter_mut().zip(plates).for_each(|(c, (_, plate))| *c = plate[y * width + x]);
            if covered != last.0 {
                last = (covered, shares(covered));
            }
            *out = pick(&last.1, &order, thresholds[x % SIDE]);
        }
    });
    let sets = std::array::from_fn(|set| set as u16);
    Ok(pack::pack(width, &index, &sets, plates.len()))
}

/// The share of each set of plates in 1/255^4.
fn shares(covered: [u8; MOST]) -> [u64; SETS] {
    std::array::from_fn(|set| {
        let part = |(at, &c): (usize, &u8)| u64::from(if set >> at & 1 == 1 { c } else { 255 - c });
        covered.iter().enumerate().map(part).product()
    })
}

/// The set that a threshold picks.
fn pick(shares: &[u64; SETS], order: &[u8; SETS], threshold: u16) -> u8 {
    let at = 255u64.pow(MOST as u32) * u64::from(threshold) / u64::from(ONE);
    let mut sum = 0;
    let reached = order.iter().find(|&&set| {
        sum += shares[usize::from(set)];
        sum > at
    });
    reached.copied().unwrap_or(0)
}

/// All sets, the darkest first: each ink filters the light by itself.
fn by_lightness(plates: &[(Ink, &[u8])], inks: &InkSet, library: &Library) -> [u8; SETS] {
    let space = Space::half_angle(SAMPLES);
    let printable = Printable::from_library(library, inks, &space);
    let solids = Solids::new(&printable, &space);
    let light: Vec<f64> =
        plates.iter().map(|(ink, _)| solids.body(&Stack::new([*ink])).iter().sum::<f64>()).collect();
    let of = |set: u8| -> f64 {
        let has = light.iter().enumerate().filter(|(at, _)| set >> at & 1 == 1);
        has.map(|(_, light)| light).product()
    };
    let mut order = std::array::from_fn(|set| set as u8);
    order.sort_by(|&a, &b| of(a).total_cmp(&of(b)));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn plates_have_their_coverage_and_overlap_as_if_by_chance(c in 20u8..=235, m in 20u8..=235, k in prop_oneof![Just(0u8), 20u8..200]) {
            let (width, dots) = (SIDE, SIDE * SIDE);
            let plates = [c, m, k].map(|covered| vec![covered; dots]);
            let inks = [Ink::Cyan, Ink::Magenta, Ink::Black];
            let given: Vec<(Ink, &[u8])> = inks.into_iter().zip(plates.iter().map(Vec::as_slice)).collect();
            let found = picked(&given, width, &Library::builtin()).unwrap();
            let share = |dots: u64| dots as f64 / (SIDE * SIDE) as f64;
            for (plane, covered) in found.iter().zip([c, m, k]) {
                let off = share(plane.dots()) - f64::from(covered) / 255.0;
                prop_assert!(off.abs() < 0.003, "{covered} of 255: off by {off}");
            }
            let both: u32 = found[0].bits.iter().zip(&found[1].bits).map(|(a, b)| (a & b).count_ones()).sum();
            let wanted = f64::from(c) * f64::from(m) / 255.0 / 255.0;
            prop_assert!((share(both.into()) - wanted).abs() < 0.003, "{both} dots of both for {wanted}");
        }
    }

    #[test]
    fn a_plate_that_is_all_or_nothing_is_that() {
        let (ink, cyan) = ([0u8, 255, 0, 255], [0u8, 0, 255, 255]);
        let found = picked(&[(Ink::Black, &ink), (Ink::Cyan, &cyan)], 4, &Library::builtin()).unwrap();
        assert_eq!([found[0].bits[0] >> 4, found[1].bits[0] >> 4], [0b0101, 0b0011]);
    }
}
