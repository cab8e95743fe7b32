//! The distinct materials of a document.
//!
//! Problem: in textures a third to nine tenths of the pixels repeat an earlier one bit for bit, and what has been computed
//! for a material need not be computed again.
//! Method: pixels are grouped by their keys ([`Materials::key`]) and numbered in reading order. Each pixel is then compared
//! in full with the first pixel of its group; one that differs (a hash collision) becomes a material of its own, so a
//! collision costs time and nothing else.
//! Cost: one key per pixel, and one evaluation if it is not the first of its group, on all cores; 12 bytes per pixel.
//! Limits: equal means bit for bit; what is equal only by chance may count as two materials.

use std::borrow::Cow;
use std::collections::HashMap;

use rayon::prelude::*;

use super::pixels::Materials;

/// Pixels per parallel task: enough work for a thread, and many tasks so that no thread waits for another.
const RUN: usize = 4096;

/// Which pixels have the same material. See the module documentation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Distinct {
    class: Vec<u32>,
    first: Vec<u32>,
}

impl Distinct {
    /// Finds the distinct materials. The document must have fewer than 2^32 pixels.
    pub fn find(materials: &dyn Materials) -> Distinct {
        let (pixels, columns) = (materials.width() * materials.height(), materials.space().columns());
        let mut hashes = vec![0u64; pixels];
        hashes.par_chunks_mut(RUN).enumerate().for_each(|(run, hashes)| {
            let mut row = vec![0.0; columns];
            for (i, out) in hashes.iter_mut().enumerate() {
                *out = materials.key(run * RUN + i, &mut row);
            }
        });
        let mut seen: HashMap<u64, u32> = HashMap::new();
        let mut first = Vec::new();
        let mut class: Vec<u32> = hashes
            .iter()
            .enumerate()
            .map(|(pixel, &hash)| {
                *seen.entry(hash).or_insert_with(|| {
                    first.push(pixel as u32);
                    first.len() as u32 - 1
                })
            })
            .collect();
        let colliding: Vec<Vec<u32>> = class
            .par_chunks(RUN)
            .enumerate()
            .map(|(run, class)| {
                let (mut row, mut same) = (vec![0.0; columns], vec![0.0; columns]);
                let mut held = None;
                let mut colliding = Vec::new();
                for (i, &class) in class.iter().enumerate() {
                    let pixel = run * RUN + i;
                    let model = first[class as usize];
                    if model as usize == pixel {
                        continue;
                    }
                    if held != Some(model) {
                        materials.reflectance(model as usize, &mut same);
                        held = Some(model);
                    }
                    materials.reflectance(pixel, &mut row);
                    if bits(&row).ne(bits(&same)) {
                        colliding.push(pixel as u32);
                    }
                }
                colliding
            })
            .collect();
        for pixel in colliding.into_iter().flatten() {
            class[pixel as usize] = first.len() as u32;
            first.push(pixel);
        }
        Distinct { class, first }
    }

    /// The first pixel of each distinct material.
    pub fn first(&self) -> &[u32] {
        &self.first
    }

    /// For every pixel, the index of its material in [`Distinct::first`].
    #[cfg(test)]
    pub fn class(&self) -> &[u32] {
        &self.class
    }

    /// Copies the values of the materials, `each` per material, to their pixels. Owned values are returned as they are if no
    /// material repeats, so that they do not take up memory twice.
    pub fn spread<'a, T: Copy + Default + Send + Sync + 'a>(
        &self,
        values: impl Into<Cow<'a, [T]>>,
        each: usize,
    ) -> Vec<T> {
        let values = values.into();
        if self.class.iter().enumerate().all(|(pixel, &class)| pixel == class as usize) {
            return values.into_owned();
        }
        let mut out = vec![T::default(); self.class.len() * each];
        out.par_chunks_mut(RUN * each).zip(self.class.par_chunks(RUN)).for_each(|(out, class)| {
            for (out, &class) in out.chunks_exact_mut(each).zip(class) {
                out.copy_from_slice(&values[class as usize * each..][..each]);
            }
        });
        out
    }
}

fn bits(row: &[f32]) -> impl Iterator<Item = u32> {
    row.iter().map(|v| v.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Space;
    use proptest::prelude::*;

    /// Pixels that are small numbers; equal numbers are equal materials.
    struct Named(Vec<u8>, Space);

    impl Materials for Named {
        fn width(&self) -> usize {
            self.0.len()
        }

        fn height(&self) -> usize {
            1
        }

        fn space(&self) -> &Space {
            &self.1
        }

        fn reflectance(&self, pixel: usize, out: &mut [f32]) {
            out.fill(f32::from(self.0[pixel]));
        }
    }

    proptest! {
        #[test]
        fn pixels_share_a_number_exactly_when_they_are_equal(names in prop::collection::vec(0u8..20, 1..200)) {
            let distinct = Distinct::find(&Named(names.clone(), Space::half_angle(2)));
            for (a, &class_a) in names.iter().zip(distinct.class()) {
                prop_assert_eq!(names[distinct.first()[class_a as usize] as usize], *a);
                for (b, &class_b) in names.iter().zip(distinct.class()) {
                    prop_assert_eq!(a == b, class_a == class_b);
                }
            }
            let firsts: Vec<u8> = distinct.first().iter().map(|&pixel| names[pixel as usize]).collect();
            prop_assert_eq!(distinct.spread(&firsts, 1), names);
        }
    }
}
