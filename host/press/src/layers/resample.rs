//! From a picture's pixels to dots of 600 dpi.
//!
//! Method: coverage is averaged over the pixels of a dot, or interpolated between them where there are fewer pixels than
//! dots (a triangle filter). Values that cannot be averaged, such as classes, are taken from the pixel under the middle
//! of the dot. Cost: nothing where pixels are dots; otherwise that of the `image` crate, or 1 ns a dot.

use image::GrayImage;
use image::imageops::FilterType;

/// Coverage at the dots.
pub(super) fn average(coverage: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    if (from.0 as usize, from.1 as usize) == to {
        return coverage;
    }
    // The length is the product of the sides, so there is always an image.
    match GrayImage::from_raw(from.0, from.1, coverage) {
        Some(image) => {
            image::imageops::resize(&image, to.0 as u32, to.1 as u32, FilterType::Triangle).into_raw()
        }
        None => vec![0; to.0 * to.1],
    }
}

/// For each dot the value of the pixel under its middle.
pub(super) fn nearest(bytes: Vec<u8>, from: (u32, u32), to: (usize, usize)) -> Vec<u8> {
    let from = (from.0 as usize, from.1 as usize);
    if from == to {
        return bytes;
    }
    let columns: Vec<usize> = (0..to.0).map(|x| (2 * x + 1) * from.0 / (2 * to.0)).collect();
    let row = |y: usize| &bytes[(2 * y + 1) * from.1 / (2 * to.1) * from.0..][..from.0];
    (0..to.1).flat_map(|y| columns.iter().map(move |&x| row(y)[x])).collect()
}
