//! Exact averages over equal parts of a row of places, such as the pixels of a document or the dots of a sheet.

/// What one of `parts` equal parts covers of a side of `size` places: places in a row, with the share of each in 1/`parts`
/// of a place. The shares of a part sum to `size`, and those of a place, over all parts, to `parts`.
#[derive(Clone, Copy, Debug)]
pub struct Cover {
    /// First place, and the one after the last.
    pub places: (usize, usize),
    /// Shares of the first and of the last place.
    pub ends: (u32, u32),
    /// Share of every place between.
    pub whole: u32,
}

impl Cover {
    /// What part `i` of `parts` covers of a side of `size` places; both are 1 or more and below 2^16.
    pub fn new(i: usize, parts: usize, size: usize) -> Cover {
        // In 1/parts of a place.
        let (start, end) = (i * size, (i + 1) * size);
        let places = (start / parts, end.div_ceil(parts));
        let first = end.min((places.0 + 1) * parts) - start;
        let last = end - start.max((places.1 - 1) * parts);
        Cover { places, ends: (first as u32, last as u32), whole: parts as u32 }
    }

    /// The share of a place of this part.
    pub fn share(&self, place: usize) -> u32 {
        match place {
            _ if place == self.places.0 => self.ends.0,
            _ if place + 1 == self.places.1 => self.ends.1,
            _ => self.whole,
        }
    }

    /// All places with their shares.
    pub fn shares(&self) -> impl Iterator<Item = (usize, u32)> + use<'_> {
        (self.places.0..self.places.1).map(|place| (place, self.share(place)))
    }

    /// All places with their shares, or `most` of them, evenly spread and alike, where there are more.
    pub fn sampled(&self, most: usize) -> impl Iterator<Item = (usize, u32)> + use<'_> {
        let (from, to) = self.places;
        let count = (to - from).min(most);
        (0..count).map(move |i| match count == to - from {
            true => (from + i, self.share(from + i)),
            // The centres of equal parts.
            false => (from + (2 * i + 1) * (to - from) / (2 * count), 1),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_cover_a_side_once_and_alike(size in 1usize..300, parts in 1usize..300) {
            let mut covered = vec![0; size];
            for i in 0..parts {
                let cover = Cover::new(i, parts, size);
                prop_assert!(cover.places.0 < cover.places.1 && cover.places.1 <= size);
                prop_assert_eq!(cover.shares().map(|(_, share)| share).sum::<u32>() as usize, size);
                for (place, share) in cover.sampled(usize::MAX) {
                    // By the lengths of intervals: the part and the place, on a common scale.
                    let (from, to) = ((i * size).max(place * parts), ((i + 1) * size).min((place + 1) * parts));
                    prop_assert_eq!(share as usize, to - from);
                    covered[place] += share as usize;
                }
            }
            prop_assert!(covered.iter().all(|&shares| shares == parts));
        }
    }
}
