//! How each flat colour is printed: as a stack, or by the shape it belongs to.
//!
//! Problem: letters and areas are sharpest in a stack, but a stack may stand for several colours, and what is drawn in one of
//! them on another would vanish.
//! Method: the stack that a colour names ([`Solids`]), or one that looks like the mixture that would be printed in its place.
//! Where two colours that can be told apart touch, only the one nearer to the stack is printed as it; the other is printed by
//! its shapes, of which each knows the stacks that may stand for it, the nearest first.
//! Cost: 1 ns a dot where two such colours share a stack, nothing on other pages. Limits: contact is that of colours anywhere on
//! the page; `outline` looks at each shape.

use super::colour::Fit;
use super::flat::Flat;
use super::intent::{Light, difference, difference_in_hue};
use super::kinds::K_OF_PICTURES;
use super::looks::apart;
use super::solids::Solids;

/// A flat colour is printed as a stack that differs from its mixture by at most so much in Oklab; 0.02 is barely visible. Two
/// hundredths of paper in K are 0.04: specks in a black area are worse than an area that is as much too dark.
const SAME: f64 = 0.05;
/// At most so much of that may be hue and chroma: another hue is another colour, wherever it is on the page.
const SAME_HUE: f64 = 0.02;
/// A colour that differs from paper by at most so much is paper: nobody sees the difference, but everybody the specks.
const BARE: f64 = 0.01;
/// A stack that differs from a colour by at most so much looks about like it: dark grey as K, dark red as M+Y; not 50 % grey as K, nor orange
/// as M+Y.
const NEAR: f64 = 0.1;
/// Colours of sRGB that differ by more can be told apart where they touch.
const APART: f64 = 0.05;
/// Least weight of a stack in the mixture of a colour that the stack may stand for, and least part of the mixture's ink.
const NEARLY: f64 = 1.0 / 8.0;
/// The same where no other is seen.
const LEAST: f64 = 1.0 / 32.0;
/// Where a colour hardly differs from what it lies on, as in near-black on black, a stack or paper stands for it only if it is at most so many
/// times farther from it than its nearest stack, or darker: what is drawn faintly is not printed in a brighter ink or in paper. Dark red letters on red are
/// black.
const AS_NEAR: f64 = 2.0;
/// A light colour is pale if its nearest stack is more than so many times farther from it than paper.
const PALE: f64 = 4.0 / 3.0;
/// What hue and chroma count against lightness where a stack stands for a colour: darker letters are still of their colour, others are not.
const HUE: f64 = 2.5;
/// How far in hue and chroma such a stack may be: so far, and so many times the colour's own chroma more. Letters in a grey with a little blue
/// are black, not cyan.
const TURNED: f64 = 0.03;
const MORE_TURNED: f64 = 1.5;
/// Stacks that may stand for a colour; the last is repeated where there are fewer.
pub(super) const CHOICES: usize = 4;

/// How the dots of a colour are printed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Treatment {
    /// As this stack.
    Solid(u8),
    /// By the shape they belong to.
    Shape(Shape),
}

/// What may stand for a colour that is no stack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Shape {
    /// The nearest stack with ink, then others of its mixture and paper, the nearest first, then those with little of the mixture.
    pub solids: [u8; CHOICES],
    /// Those that stand for it even where it hardly differs from what it lies on, a bit each: about as near as the first, or darker.
    pub mild: u8,
    /// Whether the colour has more ink than paper, and is no pale one that paper is nearer to than any stack.
    pub dark: bool,
    /// Whether the nearest stack looks about like the colour, and whether paper does.
    pub near: bool,
    pub bare: bool,
    /// The stacks of its mixture, a bit each; those beyond the 64th are not told.
    pub mixed: u64,
    /// Among all colours: those nearer to their stack keep it first.
    pub rank: u8,
}

/// How each flat colour is printed, from the weights of the stacks in its mixture. Stacks that colours name and nothing else
/// uses are added to the mix.
pub(super) fn treatments(flat: &Flat, width: usize, fit: &mut Fit, solids: &Solids<'_>) -> Vec<Treatment> {
    let bodies: Vec<Light> = fit.stacks.iter().map(|stack| solids.body(stack)).collect();
    let found: Vec<Found> =
        flat.colours.iter().map(|&(_, colour)| Found::of(colour, fit, &bodies, solids)).collect();
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|&a, &b| found[a].off.total_cmp(&found[b].off).then(a.cmp(&b)));
    let mut rank = vec![0; found.len()];
    order.iter().enumerate().for_each(|(place, &at)| rank[at] = place as u8);
    let parted = parted(flat, width, &found, &rank);
    let treatment = |at: usize| match found[at].shape {
        Some(shape) if !found[at].is_solid || parted[at] => {
            Treatment::Shape(Shape { rank: rank[at], ..shape })
        }
        _ => Treatment::Solid(found[at].stack),
    };
    (0..found.len()).map(treatment).collect()
}

/// What the inks make of a flat colour.
struct Found {
    colour: [u8; 3],
    /// The stack nearest to it.
    stack: u8,
    /// How far the stack is from what would be printed in its place; none for a stack that the colour names.
    off: f64,
    /// Whether it may be printed as that stack.
    is_solid: bool,
    /// What may stand for it, of no rank yet; `None` for a stack that the colour names.
    shape: Option<Shape>,
}

impl Found {
    fn of(colour: [u8; 3], fit: &mut Fit, bodies: &[Light], solids: &Solids<'_>) -> Found {
        if let Some(stack) = solids.named(colour) {
            return Found { colour, stack: fit.number(stack), off: 0.0, is_solid: true, shape: None };
        }
        let weights = &fit.weights(colour)[..bodies.len()];
        let wanted = solids.wanted(colour);
        let mixed = std::array::from_fn(|c| weights.iter().zip(bodies).map(|(w, body)| w * body[c]).sum());
        if difference(bodies[0], wanted) <= BARE {
            return Found { colour, stack: 0, off: 0.0, is_solid: true, shape: None };
        }
        let hue = |stack: usize| difference_in_hue(bodies[stack], wanted);
        let all = |stack: usize| difference(bodies[stack], wanted);
        let lightness = |stack: usize| (all(stack).powi(2) - hue(stack).powi(2)).max(0.0).sqrt();
        let off = |stack: usize| lightness(stack).hypot(HUE * hue(stack));
        let inked = || (1..weights.len()).filter(|&stack| weights[stack] > 0.0);
        let mut near: Vec<usize> = inked().filter(|&stack| weights[stack] >= NEARLY).collect();
        near.sort_by(|&a, &b| off(a).total_cmp(&off(b)));
        // White has no chroma.
        let most_hue = TURNED + MORE_TURNED * difference_in_hue(wanted, [1.0; 3]);
        let is_like = |&stack: &usize| hue(stack) <= most_hue;
        let most = |stacks: &mut dyn Iterator<Item = usize>| {
            stacks.max_by(|&a, &b| weights[a].total_cmp(&weights[b]))
        };
        let nearest = near.iter().copied().find(is_like);
        // In pale colours hardly any stack has an eighth; a stack without an eighth of the ink is but a correction.
        let ink = 1.0 - weights[0];
        let of_ink = || inked().filter(|&stack| weights[stack] >= NEARLY * ink);
        let nearest = nearest.or_else(|| most(&mut of_ink().filter(is_like)));
        let Some(nearest) = nearest.or(near.first().copied()).or_else(|| most(&mut inked())) else {
            return Found { colour, stack: 0, off: 0.0, is_solid: true, shape: None };
        };
        // Paper stands for a colour where it is nearer than the inks that are left, or where none is.
        let others = near.iter().copied().filter(|&stack| stack != nearest).filter(is_like);
        let mut others: Vec<usize> = others.chain([0]).collect();
        others.sort_by(|&a, &b| off(a).total_cmp(&off(b)));
        // What is seen on its ground in none of these may be seen in less of the mixture.
        let mut less: Vec<usize> =
            inked().filter(|&stack| (LEAST..NEARLY).contains(&weights[stack])).filter(is_like).collect();
        less.sort_by(|&a, &b| off(a).total_cmp(&off(b)));
        let less = less.into_iter().filter(|&stack| stack != nearest);
        let ranked: Vec<usize> = std::iter::once(nearest).chain(others).chain(less).take(CHOICES).collect();
        let choices: [u8; CHOICES] = std::array::from_fn(|at| ranked[at.min(ranked.len() - 1)] as u8);
        let bright = |stack: usize| bodies[stack].iter().sum::<f64>();
        let is_mild = |stack: usize| off(stack) <= AS_NEAR * off(nearest) || bright(stack) < bright(nearest);
        let from_mixture = difference(bodies[nearest], mixed);
        let is_pale = luminance(wanted) >= 0.5 && off(nearest) > PALE * off(0);
        Found {
            colour,
            stack: nearest as u8,
            off: from_mixture,
            is_solid: from_mixture <= SAME && difference_in_hue(bodies[nearest], mixed) <= SAME_HUE,
            shape: Some(Shape {
                solids: choices,
                dark: weights[0] < 0.5 && !is_pale,
                near: all(nearest) <= NEAR,
                bare: all(0) <= NEAR,
                mild: (0..CHOICES)
                    .filter(|&at| is_mild(choices[at].into()))
                    .fold(0, |bits, at| bits | 1 << at),
                mixed: inked().filter(|&stack| stack < 64).fold(0, |bits, stack| bits | 1 << stack),
                rank: 0,
            }),
        }
    }
}

/// How much light the eye sees.
fn luminance([r, g, b]: Light) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The colours that may not be printed as their stack, because a colour that can be told from them is printed as it beside
/// them.
fn parted(flat: &Flat, width: usize, found: &[Found], rank: &[u8]) -> Vec<bool> {
    // Black in CMYK beside black in sRGB is black.
    let share = |a: usize, b: usize| {
        found[a].colour != K_OF_PICTURES
            && found[a].stack == found[b].stack
            && found[a].is_solid
            && found[b].is_solid
            && apart(found[a].colour, found[b].colour) > APART
    };
    let mut parted = vec![false; found.len()];
    let pairs = || (0..found.len()).flat_map(|a| (0..found.len()).map(move |b| (a, b)));
    let rivals: Vec<(usize, usize)> =
        pairs().filter(|&(a, b)| found[a].shape.is_some() && rank[b] < rank[a] && share(a, b)).collect();
    if rivals.is_empty() {
        return parted;
    }
    let touching = flat.touching(width);
    for (a, b) in rivals {
        parted[a] |= touching.has(a as u8, b as u8);
    }
    parted
}

#[cfg(test)]
mod tests {
    use super::super::colour::Colour;
    use super::super::compose::Settings;
    use super::super::flat::TONE;
    use super::super::intent::oklab;
    use super::super::kinds::ObjectType;
    use super::super::looks::Looks;
    use super::super::outline::fixed;
    use super::*;
    use appearance::brdf::Space;
    use appearance::document::SAMPLES;
    use appearance::gamut::Printable;
    use inks::{InkSet, Library};
    use observe::Silent;
    use protocol::ink::Kind;

    fn process_inks() -> (Printable, Space) {
        let process = InkSet::of(InkSet::default().iter().filter(|ink| ink.kind() == Kind::Process));
        let space = Space::half_angle(SAMPLES);
        (Printable::from_library(&Library::builtin(), &process, &space), space)
    }

    fn fit(printable: &Printable, solids: &Solids<'_>, space: &Space) -> Fit {
        let drawn = Colour::of(&[[ObjectType::DRAWING, 1, 2, 3]; 4], (4, 1), (4, 1)).unwrap();
        drawn.fit((printable, solids), space.clone(), &Settings::default(), &Silent).unwrap()
    }

    /// A ground with a bar of another colour, seven dots wide: what each is printed as in the middle, and the bar at its edge.
    fn printed(fit: &mut Fit, solids: &Solids<'_>, kind: ObjectType, [ground, bar]: [[u8; 3]; 2]) -> [u8; 3] {
        let mut colours = vec![(ObjectType::Picture, [255; 3]), (ObjectType::Picture, [0; 3])];
        let mut number = |kind: ObjectType, rgb: [u8; 3]| {
            let plain = colours.iter().position(|&(_, known)| known == rgb);
            plain.unwrap_or_else(|| {
                colours.push((kind, rgb));
                colours.len() - 1
            }) as u8
        };
        let (under, over) = (number(ObjectType::Drawing, ground), number(kind, bar));
        let inside = |at: usize| (20..27).contains(&(at % 60)) && (10..40).contains(&(at / 60));
        let index = (0..60 * 50).map(|at| if inside(at) { over } else { under }).collect();
        let flat = Flat { colours, index };
        let treatments = treatments(&flat, 60, fit, solids);
        let looks = Looks::of(&flat, &treatments, &fit.stacks, solids, None::<fn(usize) -> [u8; 3]>);
        let fixed = fixed(&flat, 60, &treatments, &looks);
        [5, 23, 20].map(|x| fixed[25 * 60 + x])
    }

    #[test]
    fn no_letter_vanishes_in_its_ground() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let levels = [0u8, 85, 170, 255];
        let colours: Vec<[u8; 3]> =
            (0..64).map(|at| [at / 16, at / 4 % 4, at % 4].map(|i| levels[i])).collect();
        let mut fit = fit(&printable, &solids, &space);
        let light = |rgb: [u8; 3]| rgb.map(|v| f64::from(appearance::srgb::decode(f32::from(v) / 255.0)));
        let (mut same, mut solid) = (Vec::new(), 0);
        let mut turned = Vec::new();
        for &ground in &colours {
            for &bar in colours.iter().filter(|&&bar| difference(light(bar), light(ground)) > 0.1) {
                for kind in [ObjectType::Text, ObjectType::Drawing] {
                    let [under, over, _] = printed(&mut fit, &solids, kind, [ground, bar]);
                    if over != TONE {
                        solid += 1;
                        if under == over {
                            same.push((ground, bar));
                        }
                        // What is plainly lighter than its ground is not printed darker, nor the other way round.
                        let body = |stack: u8| solids.body(&fit.stacks[usize::from(stack)]);
                        let seen = if under == TONE { solids.wanted(ground) } else { body(under) };
                        let asked = oklab(light(bar))[0] - oklab(light(ground))[0];
                        let found = oklab(body(over))[0] - oklab(seen)[0];
                        // The six primaries are their inks, however dark, and cyan with magenta is a little darker than black.
                        let is_named = solids.named(bar).is_some();
                        let is_lightness =
                            asked.abs() > 0.2 && asked.abs() > 0.75 * difference(light(bar), light(ground));
                        if !is_named && is_lightness && asked.signum() * found < -0.02 {
                            turned.push((ground, bar));
                        }
                    }
                }
            }
        }
        assert!(
            same.is_empty(),
            "{} of {solid} letters vanish, such as {:?}",
            same.len(),
            &same[..4.min(same.len())]
        );
        assert!(solid > 3000, "{solid}");
        assert!(
            turned.is_empty(),
            "{} of {solid} are turned, such as {:?}",
            turned.len(),
            &turned[..4.min(turned.len())]
        );
    }

    /// Peach, sand, pink, lilac and mint letters were black, and cream ones had black outlines.
    #[test]
    fn pale_letters_on_paper_are_neither_black_nor_solid() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        for pale in [
            [255, 242, 204],
            [255, 217, 178],
            [237, 190, 213],
            [225, 190, 237],
            [173, 217, 195],
            [204, 204, 255],
        ] {
            let (nearest, ..) = alone(pale, &mut fit, &solids);
            assert_ne!(nearest, "K", "{pale:?}");
            let [under, middle, edge] = printed(&mut fit, &solids, ObjectType::Text, [[255; 3], pale]);
            assert_eq!((under, middle), (0, TONE), "{pale:?}");
            assert!(edge != TONE && edge > 0, "{pale:?} has no edge");
        }
        // Pale, but an ink is much nearer than paper.
        let [_, over, _] = printed(&mut fit, &solids, ObjectType::Text, [[255; 3], [255, 240, 120]]);
        assert_eq!(fit.stacks[usize::from(over)].to_string(), "Y");
    }

    /// Text in the colour of its ground was a solid in it.
    #[test]
    fn what_nobody_can_tell_from_its_ground_is_screened_with_it() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        for (ground, text) in [
            ([245, 158, 11], [245, 160, 14]),
            ([34, 150, 94], [33, 151, 95]),
            ([90, 122, 153], [90, 122, 153]),
        ] {
            let [_, over, _] = printed(&mut fit, &solids, ObjectType::Text, [ground, text]);
            assert_eq!(over, TONE, "{text:?} on {ground:?}");
        }
    }

    /// Half of the border of such letters is white and half of it the shadow, here a little more and there a little less.
    #[test]
    fn letters_with_a_shadow_are_printed_alike() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        let colours = vec![
            (ObjectType::Picture, [255; 3]),
            (ObjectType::Picture, [0; 3]),
            (ObjectType::Text, [16, 96, 192]),
            (ObjectType::Text, [136, 136, 170]),
        ];
        let width = 40;
        // Letters of several forms, each with a shadow to the right and below.
        let letters = [(10, 60, 6), (14, 40, 6), (20, 12, 5), (22, 18, 7), (12, 12, 4), (16, 30, 8)];
        let is = |letter: (usize, usize, usize), x: usize, y: usize| {
            let (wide, high, stroke) = letter;
            let inside = (8..8 + wide).contains(&x) && (4..4 + high).contains(&y);
            inside && (x < 8 + stroke || y >= 4 + high - stroke)
        };
        let mut index = Vec::new();
        for letter in letters {
            index.extend((0..width * 80).map(|at| {
                let (x, y) = (at % width, at / width);
                match is(letter, x, y) {
                    true => 2,
                    false if x >= 3 && y >= 3 && is(letter, x - 3, y - 3) => 3,
                    false => 0,
                }
            }));
        }
        let flat = Flat { colours, index };
        let treatments = treatments(&flat, width, &mut fit, &solids);
        let looks = Looks::of(&flat, &treatments, &fit.stacks, &solids, None::<fn(usize) -> [u8; 3]>);
        let fixed = fixed(&flat, width, &treatments, &looks);
        for colour in [2, 3] {
            let mut found: Vec<u8> = fixed
                .iter()
                .zip(&flat.index)
                .filter(|&(_, &own)| own == colour)
                .map(|(&dot, _)| dot)
                .collect();
            found.sort_unstable();
            found.dedup();
            assert!(found.len() == 1 && found[0] != TONE, "colour {colour} is {found:?}");
        }
    }

    /// Near-black in black was a white letter.
    #[test]
    fn what_is_nearly_its_ground_is_no_letter_in_the_opposite_colour() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        for kind in [ObjectType::Text, ObjectType::Drawing] {
            for dark in [[32; 3], [51; 3], [28, 8, 8], [74, 13, 13], [10, 58, 10], [92, 74, 36]] {
                let [_, over, _] = printed(&mut fit, &solids, kind, [[0; 3], dark]);
                assert!(over == TONE || fit.stacks[usize::from(over)].to_string() == "K", "{dark:?}: {over}");
            }
            // Dark red on red is black.
            let [_, over, _] = printed(&mut fit, &solids, kind, [[255, 0, 0], [192, 0, 0]]);
            assert!(over != TONE && fit.stacks[usize::from(over)].to_string() == "K", "{over}");
            // Halfway it is read by the contrast.
            assert_eq!(printed(&mut fit, &solids, kind, [[0; 3], [138; 3]])[1], 0);
        }
    }

    /// Grey letters with a little blue were cyan, and purple ones were cyan as well.
    #[test]
    fn what_stands_for_a_colour_is_darker_rather_than_of_another_hue() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        for (colour, wanted) in [
            ([149, 165, 166], "K"),
            ([100, 116, 139], "K"),
            ([141, 110, 99], "K"),
            ([148, 103, 189], "C+M"),
            ([31, 119, 180], "C"),
            ([192, 0, 0], "M+Y"),
            ([245, 121, 0], "M+Y"),
            ([204, 214, 221], "K"),
        ] {
            assert_eq!(alone(colour, &mut fit, &solids).0, wanted, "{colour:?}");
        }
    }

    /// How a colour is printed where nothing else is: the stack nearest to it, how far that is from the mixture, and whether it
    /// is printed.
    fn alone(colour: [u8; 3], fit: &mut Fit, solids: &Solids<'_>) -> (String, f64, bool) {
        let bodies: Vec<Light> = fit.stacks.iter().map(|stack| solids.body(stack)).collect();
        let found = Found::of(colour, fit, &bodies, solids);
        (fit.stacks[usize::from(found.stack)].to_string(), found.off, found.is_solid)
    }

    #[test]
    fn a_stack_stands_for_a_colour_a_little_lighter_and_for_none_of_another_hue() {
        let (printable, space) = process_inks();
        let solids = Solids::new(&printable, &space);
        let mut fit = fit(&printable, &solids, &space);
        // Yellow on half and on three quarters of the dots of magenta: another hue than either solid.
        for (colour, stack) in [([255, 0, 127], "M"), ([255, 0, 64], "M+Y")] {
            let (nearest, found, solid) = alone(colour, &mut fit, &solids);
            assert!(nearest == stack && !solid, "{colour:?}: {nearest} {found:.3} {solid}");
        }
        // What CMYK black becomes by the usual profile, and dark greys.
        for colour in [[35, 31, 32], [26, 26, 26], [16, 16, 16]] {
            let (nearest, found, solid) = alone(colour, &mut fit, &solids);
            assert!(nearest == "K" && solid, "{colour:?}: {nearest} {found:.3}");
        }
        // A screen shows no difference between black and what is nearly black: it is no white letter in it.
        let black = fit.stacks.iter().position(|stack| stack.to_string() == "K").map(|at| at as u8);
        for nearly in [2, 5, 10] {
            for kind in [ObjectType::Text, ObjectType::Drawing] {
                let printed = printed(&mut fit, &solids, kind, [[0; 3], [nearly; 3]]);
                assert_eq!(printed.map(Some), [black; 3], "{nearly} on black");
            }
        }
        // A ground that is nearly white has no specks, and a tint of five hundredths of a stack is one.
        for (colour, bare) in [
            ([252, 252, 252], true),
            ([253, 253, 251], true),
            ([243, 243, 243], false),
            ([255, 255, 240], false),
        ] {
            let (nearest, found, solid) = alone(colour, &mut fit, &solids);
            assert_eq!(nearest == "substrate" && solid, bare, "{colour:?}: {nearest} {found:.3}");
        }
    }
}
