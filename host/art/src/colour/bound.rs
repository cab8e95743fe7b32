//! How far a mixture may lie from the colour that was asked for: one bound for whatever drops shares or
//! names a stack.
//!
//! Problem: a share of the dots says little of what an eye sees. Paper on 3 % of black's dots is 20 L*,
//! yellow on 3 % of the paper is nothing.
//! Method: colours are compared as an eye does, in CIELAB between black and paper: at most [`LIGHTER`] in
//! lightness and [`APART`] in CIEDE2000. Two names stay, since owners mean them: a flat ground that is
//! nearly paper is paper, and what programs write for full black of CMYK is black ink.
//! Cost: a microsecond. Limits: the colours of the ink library.
//! Source: CIE 142 (2001), through `palette`.

use palette::color_difference::Ciede2000;
use palette::convert::FromColorUnclamped;
use palette::white_point::D65;
use palette::{Lab, LinSrgb};

use crate::colour::intent::Light;
use appearance::srgb;

/// The most that dropping shares may change in lightness. Source: half of what is seen between two panels
/// side by side.
const LIGHTER: f64 = 1.0;
/// The most in CIEDE2000: what is just seen side by side. Source: of a ramp in 256 steps no step may be
/// more than one and a half, though one colour has lost a share and the next has not.
const APART: f64 = 1.0;

/// A flat colour this near to paper, in lightness and in CIEDE2000, is paper: nobody spends a ribbon on it.
/// Source: grey 250, the lightest ground that page designers write.
const PAPER: f64 = 2.0;

/// What converting full black of CMYK leaves in sRGB, by the profile.
/// Source: those profiles with relative colorimetric intent and compensation of the black point.
const FULL_BLACK: [[u8; 3]; 2] = [
    // U.S. Web Coated (SWOP) v2.
    [35, 31, 32],
    // Coated FOGRA39.
    [29, 29, 27],
];

/// A colour as an eye sees it.
pub(crate) type Seen = Lab<D65, f64>;

/// What an eye sees of light between black and paper.
pub(crate) fn seen([r, g, b]: Light) -> Seen {
    Lab::from_color_unclamped(LinSrgb::new(r, g, b))
}

/// What an eye sees of a colour of sRGB.
fn drawn(colour: [u8; 3]) -> Seen {
    seen(colour.map(|v| f64::from(srgb::decode(f32::from(v) / 255.0))))
}

/// Whether a mixture may stand for what was asked.
pub(crate) fn bound(asked: Seen, mixture: Seen) -> bool {
    (asked.l - mixture.l).abs() <= LIGHTER && asked.difference(mixture) <= APART
}

/// Whether a flat colour is what programs write for full black of CMYK.
pub(crate) fn is_full_black(colour: [u8; 3]) -> bool {
    FULL_BLACK.contains(&colour)
}

/// Whether a flat colour is nearly paper.
pub(crate) fn is_paper(colour: [u8; 3]) -> bool {
    // Most are far from it.
    colour.iter().all(|&v| v > 200) && {
        let (seen, paper) = (drawn(colour), seen([1.0; 3]));
        paper.l - seen.l <= PAPER && paper.difference(seen) <= PAPER
    }
}
