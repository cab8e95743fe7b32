//! What drew each pixel of an SVG drawing: text, a shape or a picture.
//!
//! Problem: the renderer returns only colours, and what lies above hides what lies beneath.
//! Method: the drawing is rendered again with its text hidden, and again with its pictures hidden. A pixel that differs
//! shows text, or a picture. Drawings without either are not rendered again.
//! Cost: a rendering for each of the two. Limits: text that looks like what is beneath it is no text, which nobody sees.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, roxmltree};

use super::kinds::{BYTES, Kind};

/// A rendered drawing on white, with the kind of each pixel ([`kinds`](super::kinds)); what is transparent has no kind.
/// `text` is the drawing, rendered with these options and scale to `rgba`, which has straight alpha.
pub(super) fn tagged(
    text: &str,
    options: &usvg::Options<'_>,
    scale: Transform,
    size: (u32, u32),
    rgba: &[u8],
) -> Vec<u8> {
    let hidden = |element: &str| {
        let used = text.contains(&format!("<{element}")) || text.contains(&format!(":{element}"));
        used.then(|| without(text, element, options, scale, size)).flatten()
    };
    let (no_text, no_pictures) = (hidden("text"), hidden("image"));
    let mut pixels = vec![0; rgba.len()];
    let (from, to) = (rgba.as_chunks::<4>().0, pixels.as_chunks_mut::<BYTES>().0);
    for (at, (out, &[r, g, b, alpha])) in to.iter_mut().zip(from).enumerate() {
        let shows = |hidden: &Option<Vec<u8>>| {
            hidden.as_ref().is_some_and(|hidden| hidden.get(4 * at..4 * at + 4) != Some(&[r, g, b, alpha]))
        };
        let tag = match alpha {
            0 => 0,
            _ if shows(&no_pictures) => Kind::PICTURE,
            _ if shows(&no_text) => Kind::TEXT,
            _ => Kind::DRAWING,
        };
        let alpha = u32::from(alpha);
        let on_white = |v: u8| ((u32::from(v) * alpha + 255 * (255 - alpha) + 127) / 255) as u8;
        *out = [tag, on_white(r), on_white(g), on_white(b)];
    }
    pixels
}

/// The drawing rendered with all elements of a name hidden; `None` if that fails.
fn without(
    text: &str,
    element: &str,
    options: &usvg::Options<'_>,
    scale: Transform,
    (width, height): (u32, u32),
) -> Option<Vec<u8>> {
    let parsing = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let start = {
        let document = roxmltree::Document::parse_with_options(text, parsing).ok()?;
        document.root_element().first_child()?.range().start
    };
    let mut hiding = text.to_owned();
    hiding.insert_str(start, &format!("<style>{element}{{display:none!important}}</style>"));
    let tree = usvg::Tree::from_str(&hiding, options).ok()?;
    let mut pixmap = Pixmap::new(width, height)?;
    resvg::render(&tree, scale, &mut pixmap.as_mut());
    Some(super::svg::straight(pixmap))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_and_shapes_are_told_apart_where_they_show() {
        // A blue shape, a picture over its right half, and a red shape over the middle of all.
        let mut png = Vec::new();
        let grey = image::RgbImage::from_pixel(2, 2, image::Rgb([90, 91, 92]));
        grey.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        let picture = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, png);
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' width='12' height='4'>\
             <rect x='2' width='10' height='4' fill='#0000c8'/>\
             <image x='6' width='6' height='4' preserveAspectRatio='none' xlink:href='data:image/png;base64,{picture}'/>\
             <rect x='5' y='1' width='2' height='2' fill='#c80000'/></svg>"
        );
        let options =
            usvg::Options { shape_rendering: usvg::ShapeRendering::CrispEdges, ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&text, &options).unwrap();
        let mut pixmap = Pixmap::new(12, 4).unwrap();
        resvg::render(&tree, Transform::identity(), &mut pixmap.as_mut());
        let pixels = tagged(&text, &options, Transform::identity(), (12, 4), pixmap.data());
        let tags: Vec<u8> = pixels.as_chunks::<4>().0.iter().map(|pixel| pixel[0]).collect();
        assert_eq!(tags[..12], [0, 0, 4, 4, 4, 4, 2, 2, 2, 2, 2, 2]);
        assert_eq!(tags[12..24], [0, 0, 4, 4, 4, 4, 4, 2, 2, 2, 2, 2]);
        assert_eq!(pixels[..4], [0, 255, 255, 255]);
        assert_eq!(pixels[8..12], [4, 0, 0, 200]);
    }
}
