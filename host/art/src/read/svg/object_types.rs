//! What drew each pixel of an SVG drawing: text, a shape or a picture.
//!
//! Problem: the renderer returns only colours, and what lies above hides what lies beneath.
//! Method: the drawing is rendered again without its text, and again without its pictures. A pixel that differs shows text,
//! or a picture. Cost: a look at each pixel. Limits: text that looks like what is beneath it is no text, which nobody sees.

use crate::read::object_type::{BYTES, ObjectType};

/// A rendered drawing on white, with the kind of each pixel ([`object_type`](crate::read::object_type)); what
/// is transparent has no kind.
/// `rgba` is the drawing in straight alpha, `no_text` and `no_pictures` are the same without these, if it has any.
pub(crate) fn tagged(rgba: &[u8], no_text: Option<&[u8]>, no_pictures: Option<&[u8]>) -> Vec<u8> {
    let mut pixels = vec![0; rgba.len()];
    let (from, to) = (rgba.as_chunks::<4>().0, pixels.as_chunks_mut::<BYTES>().0);
    for (at, (out, &[r, g, b, alpha])) in to.iter_mut().zip(from).enumerate() {
        let shows = |without: Option<&[u8]>| {
            without.is_some_and(|without| without.get(4 * at..4 * at + 4) != Some(&[r, g, b, alpha]))
        };
        let tag = match alpha {
            0 => 0,
            _ if shows(no_pictures) => ObjectType::PICTURE,
            _ if shows(no_text) => ObjectType::TEXT,
            _ => ObjectType::DRAWING,
        };
        let alpha = u32::from(alpha);
        let on_white = |v: u8| ((u32::from(v) * alpha + 255 * (255 - alpha) + 127) / 255) as u8;
        *out = [tag, on_white(r), on_white(g), on_white(b)];
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_text_and_shapes_are_told_apart_where_they_show() {
        // Nothing, a shape, a picture over nothing, a picture over the shape, text, half a shape.
        let all =
            [[0; 4], [0, 0, 200, 255], [90, 91, 92, 255], [90, 91, 92, 255], [1, 1, 1, 255], [0, 0, 0, 128]];
        let (mut no_text, mut no_pictures) = (all, all);
        no_text[4] = [0; 4];
        no_pictures[2] = [0; 4];
        no_pictures[3] = [0, 0, 200, 255];
        let flat = |pixels: [[u8; 4]; 6]| pixels.concat();
        let pixels = tagged(&flat(all), Some(&flat(no_text)), Some(&flat(no_pictures)));
        let tags: Vec<u8> = pixels.as_chunks::<4>().0.iter().map(|pixel| pixel[0]).collect();
        assert_eq!(tags, [0, 4, 2, 2, ObjectType::TEXT, 4]);
        assert_eq!(pixels[..8], [0, 255, 255, 255, 4, 0, 0, 200]);
        assert_eq!(pixels[20..], [4, 127, 127, 127]);
    }
}
