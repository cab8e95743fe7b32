//! Samples of the lines, and the shortest times between their edges.
//!
//! A sample is 16 bits, one every [`SAMPLE_NS`], two in a word, the earlier one in its lower half: Data1 to Data8 from bit 0, then nStrobe,
//! nAutoFd, nInit, nSelectIn, nAck, Busy, PError, Select. They begin with the first strobe. Times are exact to a sample.

/// Between two samples, in ns.
pub const SAMPLE_NS: u32 = crate::TICK_NS;

/// Words of samples the rig keeps: one millisecond.
pub const WORDS: usize = 16 << 10;

const STROBE: u16 = 1 << 8;
const SELECT_IN: u16 = 1 << 11;
const BUSY: u16 = 1 << 13;

/// The samples in words.
pub fn samples(words: &[u32]) -> impl Iterator<Item = u16> + '_ {
    words.iter().flat_map(|word| [*word as u16, (*word >> 16) as u16])
}

/// The shortest times that were seen, in ns; none if there was no such edge.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Shortest {
    /// Data before nStrobe falls.
    pub setup: Option<u32>,
    /// nStrobe low.
    pub strobe: Option<u32>,
    /// Data behind the rise of nStrobe.
    pub hold: Option<u32>,
    /// From strobe to strobe.
    pub between: Option<u32>,
    /// Strobes that fell while Busy was high, or data that changed under a strobe.
    pub wrong: u32,
}

/// Looks through samples. While nSelectIn is high the host negotiates, and nothing counts.
pub fn shortest(samples: impl Iterator<Item = u16>) -> Shortest {
    let mut shortest = Shortest::default();
    let mut before: Option<u16> = None;
    // Sample numbers of the last edges.
    let (mut data, mut fall, mut rise) = (None, None, None);
    for (at, now) in (0u32..).zip(samples) {
        let Some(last) = before.replace(now) else { continue };
        if now & SELECT_IN != 0 {
            (data, fall, rise) = (None, None, None);
            continue;
        }
        let since = |edge: Option<u32>| edge.map(|edge| (at - edge) * SAMPLE_NS);
        let least = |known: &mut Option<u32>, ns: Option<u32>| {
            if let Some(ns) = ns {
                *known = Some(known.map_or(ns, |known| known.min(ns)));
            }
        };
        if (last ^ now) & 0xff != 0 {
            shortest.wrong += u32::from(now & STROBE == 0);
            least(&mut shortest.hold, since(rise));
            data = Some(at);
        }
        if last & !now & STROBE != 0 {
            // A sample that shows both edges does not say which came first.
            shortest.wrong += u32::from(last & BUSY != 0);
            least(&mut shortest.setup, since(data));
            least(&mut shortest.between, since(fall));
            fall = Some(at);
        }
        if !last & now & STROBE != 0 {
            least(&mut shortest.strobe, since(fall));
            rise = Some(at);
        }
    }
    shortest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn the_times_that_were_made_are_found(
            bytes in prop::collection::vec((any::<u8>(), 1usize..40, 1usize..40, 1usize..40), 2..60),
        ) {
            let mut samples = Vec::new();
            let (mut data, mut made) = (0x55u8, [u32::MAX; 3]);
            samples.extend([u16::from(data) | STROBE; 3]);
            let mut seen = false;
            for &(step, setup, strobe, hold) in &bytes {
                // Another byte each time, or there is no edge to measure by.
                data = data.wrapping_add(step | 1);
                samples.extend(core::iter::repeat_n(u16::from(data) | STROBE, setup));
                samples.extend(core::iter::repeat_n(u16::from(data), strobe));
                samples.extend(core::iter::repeat_n(u16::from(data) | STROBE, hold));
                for (least, time) in made.iter_mut().zip([setup, strobe, hold]) {
                    *least = (*least).min(time as u32 * SAMPLE_NS);
                }
                seen = true;
            }
            samples.push(u16::from(data ^ 1) | STROBE);
            prop_assert!(seen);
            let found = shortest(samples.into_iter());
            prop_assert_eq!([found.setup, found.strobe, found.hold], made.map(Some));
            prop_assert_eq!(found.wrong, 0);
        }
    }

    #[test]
    fn strobes_under_busy_and_data_that_change_under_a_strobe_are_wrong() {
        let good = [STROBE, STROBE | 1, STROBE | 1, 1, 1, STROBE | 1];
        assert_eq!(shortest(good.into_iter()).wrong, 0);
        assert_eq!(shortest(good.map(|sample| sample | BUSY).into_iter()).wrong, 1);
        assert_eq!(shortest([STROBE | 1, 1, 3, STROBE | 3].into_iter()).wrong, 1);
        assert_eq!(shortest(good.map(|sample| sample | BUSY | SELECT_IN).into_iter()), Shortest::default());
    }

    #[test]
    fn the_lower_half_of_a_word_is_the_earlier_sample() {
        assert_eq!(
            samples(&[0x2222_1111, 0x4444_3333]).collect::<Vec<_>>(),
            [0x1111, 0x2222, 0x3333, 0x4444]
        );
    }
}
