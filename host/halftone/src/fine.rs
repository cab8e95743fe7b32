//! Dots of a mixture, each picked by itself from the table of green noise.
//!
//! Method: a dot's mixture is read at its middle, between pixels or averaged over them as for every halftone ([`Axis`]). Its stacks lie in
//! order of what they reflect on [0, 1), the darkest first, and the dot's threshold picks one. The table is that of the largest minimum
//! cluster among the stacks.
//! Cost: channels times stacks multiplications a dot. Limits: process inks.

use rayon::prelude::*;

use super::axis::Axis;
use super::green_noise::{SIDE, Table};
use super::solids::Solids;
use super::{SAMPLES, Settings, TONE};
use appearance::brdf::Space;
use appearance::gamut::InkMix;
use appearance::weights::ONE;
use observe::Observer;

/// The stack of every dot.
pub(super) fn fine(
    mix: &InkMix,
    (width, length): (usize, usize),
    settings: &Settings,
    solids: &Solids,
    observer: &dyn Observer,
) -> Vec<u8> {
    let maps = &mix.maps;
    let axis = |dots: usize, pixels: usize| {
        if pixels > dots { Axis::over(dots, pixels) } else { Axis::between(dots, pixels) }
    };
    let (across, down) = (axis(width, maps.width()), axis(length, maps.height()));
    let order = by_lightness(mix, settings);
    let table = Table::for_cluster(settings.minimum.iter().copied().max().unwrap_or(1));
    let mut index = vec![0; width * length];
    observer.begin("halftone", (width * length) as u64);
    index.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        let mut weights = vec![0u64; maps.channels()];
        let thresholds = table.row(y);
        for (x, out) in out.iter_mut().enumerate() {
            *out = solids.at(x, y);
            if *out != TONE {
                continue;
            }
            weights.fill(0);
            down.parts(2 * y + 1, |row, part| {
                across.parts(2 * x + 1, |column, piece| {
                    let pixel = maps.at(row * maps.width() + column);
                    weights.iter_mut().zip(pixel).for_each(|(sum, &w)| *sum += part * piece * u64::from(w));
                });
            });
            let share = |q: usize| -> u64 {
                weights.iter().zip(&mix.matrix).map(|(&weight, shares)| weight * u64::from(shares[q])).sum()
            };
            let total = u64::from(ONE) * weights.iter().sum::<u64>();
            // Where the threshold lies between nothing and all.
            let at = (u128::from(total) * u128::from(thresholds[x % SIDE]) / u128::from(ONE)) as u64;
            let mut sum = 0;
            let reached = order.iter().find(|&&q| {
                sum += share(q);
                sum > at
            });
            *out = reached.map_or(0, |&q| q as u8);
        }
        observer.advance(width as u64);
    });
    observer.end();
    index
}

/// The numbers of the stacks, the darkest first; as they are if nothing says what they reflect.
fn by_lightness(mix: &InkMix, settings: &Settings) -> Vec<usize> {
    let mut order: Vec<usize> = (0..mix.stacks.len()).collect();
    if let Some(table) = &settings.reflectance {
        let space = Space::half_angle(SAMPLES);
        let light = |q: usize| table.row(q).iter().zip(space.weight()).map(|(f, w)| f * w).sum::<f64>();
        order.sort_by(|&a, &b| light(a).total_cmp(&light(b)));
    }
    order
}
