//! Pages that know what drew each pixel: text, a drawing or a picture.
//!
//! Problem: letters must stay whole and photographs must stay smooth, but a drawn page is only colours.
//! Method: Ghostscript's device `bitrgbtags` writes four bytes a pixel: red, green, blue, and a tag of what was drawn there
//! last, which is the first byte in older versions and the last in newer ones. Here it is the first. Where objects are
//! transparent, the tag has the bits of all of them; a picture among them makes the dot part of a picture.
//! Cost: four bytes a pixel. Limits: an SVG without pictures is all drawing; other pictures have no kinds.
//! Source: Ghostscript's `gdevbit.c`; its documentation does not tell of this device.

use std::io::{self, BufRead, Read};

use crate::window::Window;
use rayon::prelude::*;

/// Ghostscript's device for such pages.
pub const DEVICE: &str = "bitrgbtags";

/// Bytes of a pixel: its tag, red, green and blue.
pub const BYTES: usize = 4;

/// What Ghostscript makes of full inks and nothing else in a picture, whose colours it converts with a profile, and the colour that names
/// them.
pub(crate) const INKS_OF_PICTURES: [([u8; 3], [u8; 3]); 7] = [
    ([0, 174, 239], [0, 255, 255]),
    ([236, 0, 140], [255, 0, 255]),
    ([255, 242, 0], [255, 255, 0]),
    ([46, 48, 146], [0, 0, 255]),
    ([0, 166, 80], [0, 255, 0]),
    ([237, 28, 36], [255, 0, 0]),
    ([35, 31, 32], [0, 0, 0]),
];

/// What drew a pixel.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum ObjectType {
    /// Letters.
    Text,
    /// Lines, areas and shadings.
    Drawing,
    /// A picture, or bare paper.
    Picture,
}

impl ObjectType {
    /// Tag of pixels that something was drawn on, but not text or a picture. Source: `GS_VECTOR_TAG` in
    /// Ghostscript's `gscms.h`.
    pub(crate) const DRAWING: u8 = 4;
    /// Tag of pixels of a picture. Source: `GS_IMAGE_TAG` in Ghostscript's `gscms.h`.
    pub(crate) const PICTURE: u8 = 2;
    /// Tag of pixels of text. Source: `GS_TEXT_TAG` in Ghostscript's `gscms.h`.
    pub(crate) const TEXT: u8 = 1;

    /// The kind that one of Ghostscript's tags means.
    #[inline(always)]
    pub(crate) fn of(tag: u8) -> ObjectType {
        match tag {
            tag if tag & ObjectType::PICTURE != 0 => ObjectType::Picture,
            tag if tag & ObjectType::TEXT != 0 => ObjectType::Text,
            tag if tag & ObjectType::DRAWING != 0 => ObjectType::Drawing,
            _ => ObjectType::Picture,
        }
    }
}

/// What drew a pixel of three bytes, or of four with a tag before them, and its colour.
#[inline(always)]
pub(crate) fn split<const N: usize>(pixel: &[u8; N]) -> (ObjectType, [u8; 3]) {
    let kind = if N == BYTES { ObjectType::of(pixel[0]) } else { ObjectType::Picture };
    (kind, [pixel[N - 3], pixel[N - 2], pixel[N - 1]])
}

/// Where Ghostscript writes the tag of a pixel. What is read here always has it first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// Before red, green and blue: before version 10.04.
    First,
    /// After them.
    Last,
}

impl Order {
    /// The order that shows in some pixels: a tag is less than 128, and red or blue of one pixel at least is more, unless all
    /// are dark.
    pub(crate) fn seen(pixels: &[u8]) -> Option<Order> {
        let is_light = |value: u8| value >= 128;
        pixels.as_chunks::<BYTES>().0.iter().find_map(|&[first, .., last]| {
            match (is_light(first), is_light(last)) {
                (false, true) => Some(Order::First),
                (true, false) => Some(Order::Last),
                _ => None,
            }
        })
    }

    /// The number of the byte that is the tag.
    pub(crate) fn tag(self) -> usize {
        if self == Order::First { 0 } else { BYTES - 1 }
    }

    /// Brings the tags of pixels to the front.
    pub(crate) fn turn(self, pixels: &mut [u8]) {
        if self == Order::Last {
            pixels.as_chunks_mut::<BYTES>().0.iter_mut().for_each(|pixel| pixel.rotate_right(1));
        }
    }
}

/// Reads the header of the next page: its width and height; `None` at the end.
///
/// # Errors
/// Reading, or something other than such a page.
pub fn header(input: &mut impl BufRead) -> io::Result<Option<(usize, usize)>> {
    let bad = || io::Error::new(io::ErrorKind::InvalidData, "this is no page with tags");
    let (mut width, mut height, mut depth, mut first) = (None, None, None, true);
    loop {
        let mut line = Vec::new();
        (&mut *input).take(256).read_until(b'\n', &mut line)?;
        if line.is_empty() && first {
            return Ok(None);
        }
        let text = std::str::from_utf8(&line).map_err(|_| bad())?;
        let number = |name: &str| text.strip_prefix(name).and_then(|rest| rest.trim().parse::<usize>().ok());
        match text.trim_end() {
            "P7" if first => {}
            _ if first || text.is_empty() => return Err(bad()),
            "ENDHDR" => break,
            _ => {
                width = width.or(number("WIDTH "));
                height = height.or(number("HEIGHT "));
                depth = depth.or(number("DEPTH "));
            }
        }
        first = false;
    }
    match (width, height, depth) {
        (Some(width), Some(height), Some(BYTES)) => Ok(Some((width, height))),
        _ => Err(bad()),
    }
}

/// The window around everything that is not white; `None` for a blank page.
pub fn bounds(pixels: &[u8], width: usize) -> Option<Window> {
    let drawn = |&[_, r, g, b]: &[u8; BYTES]| r & g & b != 255;
    let [top, bottom, left, right] = pixels
        .as_chunks::<BYTES>()
        .0
        .par_chunks_exact(width.max(1))
        .enumerate()
        .filter_map(|(y, row)| {
            // Most rows are blank, and all of one is seen faster than its first drawn pixel.
            let tag = u32::from_ne_bytes([255, 0, 0, 0]);
            if row.iter().fold(u32::MAX, |all, pixel| all & (u32::from_ne_bytes(*pixel) | tag)) == u32::MAX {
                return None;
            }
            Some([y, y, row.iter().position(drawn)?, row.iter().rposition(drawn)?])
        })
        .reduce_with(|a, b| [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])])?;
    Some(Window { left, top, width: right + 1 - left, height: bottom + 1 - top })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_header_is_read_to_its_end_and_nothing_else_is_taken_for_one() {
        let page = b"P7\nWIDTH 12\nHEIGHT 7\nMAXVAL 255\nDEPTH 4\nTUPLTYPE RGB_TAG\nENDHDR\nrest";
        let mut input = &page[..];
        assert_eq!(header(&mut input).unwrap(), Some((12, 7)));
        assert_eq!(input, b"rest");
        assert_eq!(header(&mut &b""[..]).unwrap(), None);
        for wrong in
            [&b"P6\n12 7\n255\n"[..], b"P7\nWIDTH 12\nHEIGHT 7\nDEPTH 3\nENDHDR\n", b"P7\nWIDTH 12\n"]
        {
            assert!(header(&mut &wrong[..]).is_err());
        }
    }

    #[test]
    fn tags_come_to_the_front_and_dark_pixels_do_not_tell_where_they_were() {
        let first = [[4, 0, 0, 0], [1, 100, 200, 7], [2, 3, 4, 128], [0, 255, 255, 255]];
        let last = first.map(|[tag, r, g, b]| [r, g, b, tag]);
        for (pixels, order) in [(first, Order::First), (last, Order::Last)] {
            assert_eq!(Order::seen(pixels[..2].as_flattened()), None);
            assert_eq!(Order::seen(pixels.as_flattened()), Some(order));
            let mut turned = pixels;
            order.turn(turned.as_flattened_mut());
            assert_eq!(turned, first);
        }
    }

    #[test]
    fn a_picture_under_or_over_something_transparent_is_a_picture() {
        let kinds = [0, 1, 2, 4, 5, 6, 7].map(ObjectType::of);
        use ObjectType::*;
        assert_eq!(kinds, [Picture, Text, Picture, Drawing, Text, Picture, Picture]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_header_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = header(&mut &bytes[..]);
            let _ = header(&mut &[&b"P7\n"[..], &bytes].concat()[..]);
        }

        #[test]
        fn bounds_are_those_of_the_pixels_that_are_not_white(
            width in 1usize..9, pixels in prop::collection::vec((any::<u8>(), 250u8..), 0..80)
        ) {
            let pixels = &pixels[..pixels.len() / width * width];
            let bytes: Vec<u8> = pixels.iter().flat_map(|&(tag, v)| [tag, 255, v, 255]).collect();
            let drawn: Vec<usize> = (0..pixels.len()).filter(|&at| pixels[at].1 != 255).collect();
            let found = bounds(&bytes, width);
            prop_assert_eq!(found.is_some(), !drawn.is_empty());
            if let Some(window) = found {
                let columns = drawn.iter().map(|at| at % width);
                prop_assert_eq!(window.left, columns.clone().min().unwrap());
                prop_assert_eq!(window.left + window.width - 1, columns.max().unwrap());
                prop_assert_eq!(window.top, drawn[0] / width);
                prop_assert_eq!(window.top + window.height - 1, drawn[drawn.len() - 1] / width);
            }
        }
    }
}
