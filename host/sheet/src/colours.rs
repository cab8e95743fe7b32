//! A colour for each stack, to tell stacks apart on a screen.
//!
//! Problem: 57 stacks side by side should look like what they are and still be different from each other.
//! Method: each layer tints or hides what is below it with its ink's colour; a colour too near an earlier one gives
//! way to the nearest of 4096 that is far enough, and "far enough" shrinks until there is one.
//! Cost: stacks^2 x 4096 at worst, 0.1 s for 256. Limits: false colours, not a preview.

use inks::Stack;
use maths::Maths;
use protocol::ink::{Ink, Kind};

/// Distance at which two colours are easily told apart, in steps of 1/255.
const FAR: f64 = 48.0;

/// How an ink looks on a screen, 0..=1, sRGB as it is displayed.
fn tint(ink: Ink) -> [f64; 3] {
    match ink {
        Ink::Black => [0.12, 0.12, 0.13],
        Ink::Cyan => [0.0, 0.66, 0.92],
        Ink::Magenta => [0.90, 0.05, 0.52],
        Ink::Yellow => [1.0, 0.90, 0.05],
        Ink::MetallicGold => [0.71, 0.58, 0.27],
        Ink::MetallicMagenta => [0.66, 0.25, 0.42],
        Ink::MetallicCyan => [0.24, 0.48, 0.62],
        Ink::MetallicSilver => [0.60, 0.62, 0.65],
        Ink::White => [0.94, 0.93, 0.88],
        Ink::Finish => [0.84, 0.78, 0.98],
        Ink::Primer => [0.92, 0.97, 0.86],
        Ink::GoldFoil => [1.0, 0.76, 0.10],
        Ink::SilverFoil => [0.78, 0.86, 0.97],
    }
}

/// How an ink looks in a print, 0..=1, sRGB: as its label, but for the clear ones, which have no colour of their own. By the ink
/// library's model finish takes a tenth of the light that what lies beneath it gives back, primer a thirtieth, nearly the
/// same of all colours.
fn seen(ink: Ink) -> [f64; 3] {
    match ink.kind() {
        Kind::Finish => [0.955; 3],
        Kind::Primer => [0.985; 3],
        _ => tint(ink),
    }
}

/// Nearly white paper, 0..=1.
const PAPER: [f64; 3] = [0.99, 0.99, 0.98];

/// How a stack looks on a screen upon a ground of this colour, both sRGB. Transparent inks tint what is below them, the
/// others hide it. Stacks that look alike have the same colour.
pub fn upon(stack: &Stack, ground: [u8; 3]) -> [u8; 3] {
    bytes(look(stack, fractions(ground), seen))
}

/// The same for one ink to be seen by itself: clear ones are labelled with a colour that they do not have.
pub fn label(ink: Ink, ground: [u8; 3]) -> [u8; 3] {
    bytes(look(&Stack::new([ink]), fractions(ground), tint))
}

fn fractions(colour: [u8; 3]) -> [f64; 3] {
    colour.map(|c| f64::from(c) / 255.0)
}

fn bytes(colour: [f64; 3]) -> [u8; 3] {
    // Within 0..=255: tints and grounds are.
    colour.map(|c| c.round() as u8)
}

fn look(stack: &Stack, ground: [f64; 3], tint: impl Fn(Ink) -> [f64; 3]) -> [f64; 3] {
    let mut colour = ground;
    for &ink in stack.layers() {
        let tint = tint(ink);
        colour = match ink.kind() {
            Kind::Process | Kind::Primer | Kind::Finish => std::array::from_fn(|c| colour[c] * tint[c]),
            Kind::Metallic | Kind::Foil | Kind::White => tint,
        };
    }
    colour.map(|c| c * 255.0)
}

/// Redmean, a weighted distance in RGB near enough to what the eye sees for labels.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let red = (a[0] + b[0]) / 2.0 / 256.0;
    let d: [f64; 3] = std::array::from_fn(|c| (a[c] - b[c]).squared());
    (((2.0 + red) * d[0] + 4.0 * d[1] + (3.0 - red) * d[2]) / 3.0).sqrt()
}

/// One colour for each stack, all different, sRGB.
pub fn colours(stacks: &[Stack]) -> Vec<[u8; 3]> {
    let grid: Vec<[f64; 3]> =
        (0..4096).map(|i| [i / 256, i / 16 % 16, i % 16].map(|v| f64::from(v) * 17.0)).collect();
    // How far each grid colour is from all colours given away.
    let mut free = vec![f64::INFINITY; grid.len()];
    let mut taken: Vec<[f64; 3]> = Vec::with_capacity(stacks.len());
    for stack in stacks {
        let wanted = look(stack, PAPER, tint).map(f64::round);
        let nearest = taken.iter().map(|&other| distance(wanted, other)).fold(f64::INFINITY, f64::min);
        let mut far = FAR;
        let colour = loop {
            if nearest >= far {
                break wanted;
            }
            let able = grid.iter().zip(&free).filter(|(_, free)| **free >= far).map(|(colour, _)| *colour);
            let order = |a: &[f64; 3], b: &[f64; 3]| distance(*a, wanted).total_cmp(&distance(*b, wanted));
            if let Some(colour) = able.min_by(order) {
                break colour;
            }
            far *= 0.8;
        };
        for (free, &place) in free.iter_mut().zip(&grid) {
            *free = free.min(distance(place, colour));
        }
        taken.push(colour);
    }
    // Whole numbers within 0..=255 by construction.
    taken.into_iter().map(|colour| colour.map(|c| c as u8)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Library;

    #[test]
    fn clear_inks_change_a_print_as_the_model_says() {
        let library = Library::builtin();
        // At a raking half angle there is no gloss left, only the light from beneath.
        let beneath = |stack: &str| {
            let entry = library.entry(&stack.parse().unwrap()).unwrap();
            entry.curve_at(&[1.2]).rgb()[0]
        };
        let light = |v: u8| f64::from(appearance::srgb::decode(f32::from(v) / 255.0));
        for clear in ["F", "P"] {
            let (film, bare) = (beneath(clear), beneath("substrate"));
            let shown = upon(&clear.parse().unwrap(), [255; 3]);
            for c in 0..3 {
                let (shown, modelled) = (light(shown[c]), film[c] / bare[c]);
                assert!((shown - modelled).abs() < 0.03, "{clear}: {shown}, the model says {modelled}");
            }
        }
    }

    #[test]
    fn colours_differ_and_plain_inks_look_like_themselves() {
        let mut stacks = vec![Stack::SUBSTRATE];
        stacks.extend(Ink::ALL.map(|ink| Stack::new([ink])));
        let singles = stacks.len();
        for a in Ink::ALL {
            stacks.extend(Ink::ALL.map(|b| Stack::new([a, b])));
        }
        stacks.truncate(64);
        let colours = colours(&stacks);
        for (i, a) in colours.iter().enumerate() {
            for (j, b) in colours[..i].iter().enumerate() {
                let d = distance(a.map(f64::from), b.map(f64::from));
                assert!(d > 20.0, "{} and {}: {d}", stacks[i], stacks[j]);
            }
        }
        let of = |text: &str| {
            let stack: Stack = text.parse().unwrap();
            colours[stacks[..singles].iter().position(|s| *s == stack).unwrap()]
        };
        let ([r, g, b], [kr, ..]) = (of("C"), of("K"));
        assert!(b > r && g > r && kr < 60);
        assert!(of("substrate").iter().all(|&c| c > 245));
    }
}
