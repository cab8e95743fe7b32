//! Weights as 16-bit greys, as the folders of a factored and of a mapped document keep them.
//!
//! A weight `w` in units of 1/[`ONE`] is `w * 65535 / 32768`, rounded, so that full weight is white in any viewer. That scale
//! is above one, so rounding back restores every weight. The greys of a pixel sum to white up to one rounding each; people
//! paint such maps, and then it is the greys whose sum they keep.

use super::{ONE, quantise};

/// The grey of a weight.
pub(crate) fn to_grey(weight: u16) -> u16 {
    // At most ONE, so at most 65535.
    ((u32::from(weight) * 65_535 + u32::from(ONE) / 2) / u32::from(ONE)) as u16
}

/// The weight nearest to a grey.
fn from_grey(grey: u16) -> u16 {
    ((u32::from(grey) * u32::from(ONE) + 32_767) / 65_535) as u16
}

/// The weights of a pixel from its grey values. Written values give the original weights; painted values, which sum to
/// white up to one rounding each, are rounded by largest remainder. Any other sum stays wrong and becomes an error.
pub(crate) fn from_greys(grey: &[u16], weights: &mut [u16]) {
    weights.iter_mut().zip(grey).for_each(|(w, &g)| *w = from_grey(g));
    if weights.iter().map(|&w| u32::from(w)).sum::<u32>() == u32::from(ONE) {
        return;
    }
    let sum: u32 = grey.iter().map(|&g| u32::from(g)).sum();
    if sum.abs_diff(u32::from(u16::MAX)) as usize <= grey.len() {
        let exact: Vec<f64> = grey.iter().map(|&g| f64::from(g)).collect();
        quantise(&exact, weights);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_weight_survives_its_grey() {
        for weight in 0..=ONE {
            assert_eq!(from_grey(to_grey(weight)), weight);
        }
        assert_eq!(to_grey(ONE), u16::MAX);
    }

    proptest! {
        /// An artist who paints in the maps keeps the sum of grey values, not of our units.
        #[test]
        fn painted_greys_that_sum_to_white_are_weights(
            mut cuts in prop::collection::vec(0u16..=u16::MAX, 1..8), off in -1i32..=1,
        ) {
            cuts.extend([0, u16::MAX]);
            cuts.sort_unstable();
            let mut grey: Vec<u16> = cuts.windows(2).map(|pair| pair[1] - pair[0]).collect();
            grey[0] = (i32::from(grey[0]) + off).clamp(0, 65535) as u16;
            let mut weights = vec![0; grey.len()];
            from_greys(&grey, &mut weights);
            prop_assert_eq!(weights.iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
            for (&w, &g) in weights.iter().zip(&grey) {
                prop_assert!((f64::from(w) - f64::from(g) * 32768.0 / 65535.0).abs() <= 2.0);
            }
            // A step of 8 bits is more than rounding.
            if grey[0] < 65000 {
                grey[0] += 257;
                from_greys(&grey, &mut weights);
                prop_assert!(weights.iter().map(|&w| u32::from(w)).sum::<u32>() != u32::from(ONE));
            }
        }
    }
}
