//! Colours to mixtures of the process inks.
//!
//! Problem: a photograph has millions of colours, and each must become shares of stacks that an eye takes for it.
//! Method: sRGB is relative to the paper. White is bare paper, and black is black ink; without black ink, it is the darkest
//! stack of the allowed process inks. Other colours lie between the two in linear light, brought into the inks' reach by an
//! [`Intent`] and mixed of the stacks at the nodes of a `lattice`, one for pictures and one for text and drawings.
//! Cost: 60 ms for a lattice, 20 ns a colour. Limits: the accuracy of colours is that of the ink library.

use inks::Stack;
use maths::Maths;

use crate::colour::intent::Intent;
use crate::colour::lattice::{Lattice, Near, Nodes, Tint, step, with_tints};
use crate::colour::solids::Solids;
use crate::error::unfitted;
use appearance::brdf::Space;
use appearance::gamut::{InkMix, Printable};
use appearance::srgb;
use observe::Diagnosis;

/// What is wanted of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wishes {
    /// How colours that the inks do not reach are replaced.
    pub intent: Intent,
    /// Exponent that brightens the colours: values become their power 1 / `gamma`.
    pub gamma: f64,
    /// Whether text or a drawing has any of the colours.
    pub has_drawings: bool,
    /// Whether a picture has any.
    pub has_pictures: bool,
}

/// The nodes of the lattices, fitted.
pub(crate) struct Fit {
    pub stacks: Vec<Stack>,
    /// Shares of the stacks in each channel.
    pub matrix: Vec<Vec<u16>>,
    pub channels: usize,
    pub nodes: Nodes,
    /// Places of the 256 values between nodes.
    pub steps: [(usize, u32); 256],
    /// Number of the lattice for text and drawings.
    pub of_drawings: usize,
}

impl Fit {
    /// Fits the nodes of the lattices that are needed.
    pub fn new(inks: (&Printable, &Solids<'_>), space: &Space, wishes: &Wishes) -> Result<Fit, Diagnosis> {
        Fit::by(Near::USUAL, inks, space, wishes)
    }

    fn by(
        near: Near,
        (printable, solids): (&Printable, &Solids<'_>),
        space: &Space,
        wishes: &Wishes,
    ) -> Result<Fit, Diagnosis> {
        let intents: &[Intent] = match wishes.intent {
            Intent::Auto if wishes.has_drawings && wishes.has_pictures => {
                &[Intent::Perceptual, Intent::Colorimetric]
            }
            Intent::Auto if wishes.has_drawings => &[Intent::Colorimetric],
            Intent::Auto | Intent::Perceptual => &[Intent::Perceptual],
            Intent::Colorimetric => &[Intent::Colorimetric],
        };
        let mut mix =
            Lattice::new(space, printable, intents, wishes.gamma).mixtures(printable).map_err(unfitted)?;
        let of_drawings = intents.len() - 1;
        let light = |level: f64| f64::from(srgb::decode(level.power(1.0 / wishes.gamma) as f32));
        for lattice in 0..intents.len() {
            let has_tints = wishes.intent == Intent::Auto && wishes.has_drawings && lattice == of_drawings;
            let tint =
                |node| if has_tints { Tint::of(node, near, light) } else { Tint::of_corner(node, near) };
            mix = with_tints(mix, lattice, tint, |colour| solids.named(colour)).map_err(unfitted)?;
        }
        let InkMix { stacks, maps, matrix } = mix;
        let channels = maps.channels();
        let steps = std::array::from_fn(|value| step(value, light));
        Ok(Fit { stacks, matrix, channels, nodes: Nodes::new(&maps), steps, of_drawings })
    }

    /// The number of a stack, which is added if nothing uses it yet.
    pub fn number(&mut self, stack: Stack) -> u8 {
        let known = self.stacks.iter().position(|known| *known == stack);
        known.unwrap_or_else(|| {
            self.stacks.push(stack);
            self.matrix.iter_mut().for_each(|shares| shares.push(0));
            self.stacks.len() - 1
        }) as u8
    }

    /// The share of every stack at each node.
    pub fn shares(&self) -> impl Iterator<Item = Vec<u64>> {
        self.nodes.weights().map(|weights| {
            let share = |stack: usize| {
                let parts = weights.iter().zip(&self.matrix);
                parts.map(|(&weight, shares)| u64::from(weight) * u64::from(shares[stack])).sum()
            };
            (0..self.stacks.len()).map(share).collect()
        })
    }

    /// The weights of a colour's channels, that of a picture or of text and drawings. `sums` is scratch space.
    #[inline]
    pub fn channels_of(&self, colour: [u8; 3], is_drawn: bool, sums: &mut [[u16; 8]], out: &mut [u16]) {
        let lattice = if is_drawn { self.of_drawings } else { 0 };
        self.nodes.between(lattice, colour.map(|v| self.steps[usize::from(v)]), sums, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::intent::{Light, difference, oklab};
    use crate::colour::lattice::{NODES, ends};
    use appearance::document::SAMPLES;
    use appearance::weights::ONE;
    use inks::{InkSet, Library};
    use palette::convert::FromColorUnclamped;
    use palette::white_point::D65;
    use palette::{Lab, LinSrgb};
    use protocol::ink::Kind;

    fn fitted(wishes: &Wishes) -> (Fit, Printable) {
        fitted_by(Near::USUAL, wishes)
    }

    fn fitted_by(near: Near, wishes: &Wishes) -> (Fit, Printable) {
        let space = Space::half_angle(SAMPLES);
        let process = InkSet::of(InkSet::default().iter().filter(|ink| ink.kind() == Kind::Process));
        let printable = Printable::from_library(&Library::builtin(), &process, &space);
        let fit = Fit::by(near, (&printable, &Solids::new(&printable, &space)), &space, wishes).unwrap();
        (fit, printable)
    }

    /// The share of each stack in a colour.
    fn shares(fit: &Fit, colour: [u8; 3], is_drawn: bool) -> Vec<f64> {
        let (mut sums, mut weights) = (fit.nodes.scratch(), vec![0; fit.channels]);
        fit.channels_of(colour, is_drawn, &mut sums, &mut weights);
        let share = |stack: usize| -> f64 {
            let parts = weights.iter().zip(&fit.matrix);
            parts.map(|(&weight, shares)| f64::from(weight) * f64::from(shares[stack])).sum()
        };
        let one = f64::from(ONE) * f64::from(ONE);
        (0..fit.stacks.len()).map(|stack| share(stack) / one).collect()
    }

    const DRAWN: Wishes = Wishes { intent: Intent::Auto, gamma: 1.0, has_drawings: true, has_pictures: true };

    /// What is printed for each pixel of a picture, between black and paper in linear light.
    fn printed(pixels: &[[u8; 3]], intent: Intent) -> Vec<Light> {
        let (fit, printable) =
            fitted(&Wishes { intent, gamma: 1.0, has_drawings: false, has_pictures: true });
        let (bare, black) = ends(&printable, &Space::half_angle(SAMPLES));
        let row = |stack: &Stack| {
            printable.curves.row(printable.stacks.iter().position(|known| known == stack).unwrap())
        };
        let of = |&pixel: &[u8; 3]| {
            let shares = shares(&fit, pixel, false);
            std::array::from_fn(|c| {
                let at = 3 * (SAMPLES - 1) + c;
                let light: f64 =
                    fit.stacks.iter().zip(&shares).map(|(stack, share)| share * row(stack)[at]).sum();
                let [paper, black] = [bare, black].map(|end| printable.curves.row(end)[at]);
                (light - black) / (paper - black)
            })
        };
        pixels.iter().map(of).collect()
    }

    /// Whether what is printed for a pixel is part of a solid, which has a hue of its own.
    fn is_near_a_primary(pixel: [u8; 3]) -> bool {
        let reach = Near::USUAL.corner * 255.0 / (NODES - 1) as f64;
        let full = pixel.iter().filter(|&&v| v > 127).count();
        (1..=2).contains(&full) && pixel.iter().all(|&v| f64::from(v.min(255 - v)) < reach)
    }

    fn linear(pixel: [u8; 3]) -> Light {
        pixel.map(|v| f64::from(appearance::srgb::decode(f32::from(v) / 255.0)))
    }

    #[test]
    fn greys_reflect_what_they_should_and_white_is_bare_paper() {
        let greys: Vec<[u8; 3]> = (0..=255).map(|v| [v; 3]).collect();
        for intent in [Intent::Perceptual, Intent::Colorimetric] {
            for (grey, light) in greys.iter().zip(printed(&greys, intent)) {
                assert!((light[1] - linear(*grey)[1]).abs() < 0.02, "{grey:?} is printed as {light:?}");
            }
            let (fit, _) = fitted(&Wishes { intent, gamma: 1.0, has_drawings: false, has_pictures: true });
            let paper = fit.stacks.iter().position(|stack| stack.layers().is_empty()).unwrap();
            assert_eq!(shares(&fit, [255; 3], false)[paper], 1.0, "white has no ink");
        }
    }

    #[test]
    fn printable_colours_are_printed_as_they_are_by_the_colorimetric_intent() {
        // Muted colours, and those of skin, sky and leaves.
        let muted =
            [[194, 150, 130], [98, 122, 157], [87, 108, 67], [133, 128, 177], [120, 80, 60], [180, 190, 120]];
        for (pixel, light) in muted.into_iter().zip(printed(&muted, Intent::Colorimetric)) {
            let off = difference(light, linear(pixel));
            assert!(off < 0.02, "{pixel:?} differs by {off}");
        }
    }

    #[test]
    fn ramps_to_a_saturated_colour_are_printed_without_a_flat_patch_by_the_perceptual_intent() {
        for end in [
            [255u8, 0, 0],
            [0, 255, 0],
            [0, 0, 255],
            [0, 255, 255],
            [255, 0, 255],
            [255, 255, 0],
            [255, 128, 0],
        ] {
            // From grey to the colour; on the way every step of the picture is one of print.
            let ramp: Vec<[u8; 3]> =
                (0..=16).map(|i| end.map(|v| (128 + i * (i32::from(v) - 128) / 16) as u8)).collect();
            let light = printed(&ramp, Intent::Perceptual);
            for (pair, pixels) in light.windows(2).zip(ramp.windows(2)) {
                let (step, asked) =
                    (difference(pair[0], pair[1]), difference(linear(pixels[0]), linear(pixels[1])));
                // A solid is farther away than the colour that was asked, and may be darker where that is lighter.
                let bounds = if is_near_a_primary(pixels[1]) { (0.0, f64::INFINITY) } else { (0.08, 1.6) };
                let found = step / asked;
                assert!(found >= bounds.0 && found < bounds.1, "{:?}: {step} for {asked}", pixels[1]);
            }
        }
    }

    /// Hue in degrees and colourfulness in CAM16, which the intents do not use.
    fn cam16(light: Light) -> (f64, f64) {
        use palette::cam16::{Cam16Jmh, Parameters};
        use palette::convert::FromColorUnclamped;
        let light = palette::LinSrgb::new(light[0], light[1], light[2]);
        let seen = Cam16Jmh::from_xyz(
            palette::Xyz::from_color_unclamped(light),
            Parameters::default_static_wp(40.0),
        );
        (seen.hue.into_positive_degrees(), seen.colorfulness)
    }

    #[test]
    fn hues_are_printed_as_they_are_and_blue_does_not_become_purple() {
        let levels = [0u8, 51, 102, 153, 204, 255];
        let reds = || levels.into_iter().flat_map(|r| levels.map(|g| (r, g)));
        let mut pixels: Vec<[u8; 3]> = reds().flat_map(|(r, g)| levels.map(|b| [r, g, b])).collect();
        pixels.retain(|&pixel| !is_near_a_primary(pixel));
        for intent in [Intent::Perceptual, Intent::Colorimetric] {
            let turns: Vec<(f64, f64, [u8; 3])> = pixels
                .iter()
                .zip(printed(&pixels, intent))
                .map(|(&pixel, light)| {
                    ((cam16(linear(pixel)), oklab(linear(pixel))), (cam16(light), oklab(light)), pixel)
                })
                // Neither is nearly grey, where hue has no meaning.
                .filter(|(asked, found, _)| asked.0.1 > 15.0 && found.0.1 > 10.0)
                .map(|((was, asked), (is, found), pixel)| {
                    let turned = (asked[1] * found[2] - asked[2] * found[1])
                        .atan2(asked[1] * found[1] + asked[2] * found[2]);
                    ((is.0 - was.0 + 540.0).rem_euclid(360.0) - 180.0, turned.to_degrees(), pixel)
                })
                .collect();
            let mean =
                |of: fn(&(f64, f64, [u8; 3])) -> f64| turns.iter().map(of).sum::<f64>() / turns.len() as f64;
            let (seen, meant) = (mean(|turn| turn.0.abs()), mean(|turn| turn.1.abs()));
            assert!(seen < 3.0 && meant < 1.0, "{intent:?}: {seen} degrees in CAM16, {meant} in Oklab");
            for &(seen, meant, pixel) in &turns {
                // The darkest lie between the first nodes of the lattice.
                let most = match pixel.into_iter().max() {
                    Some(..=51) => 40.0,
                    Some(..=102) => 10.0,
                    _ => 5.0,
                };
                assert!(meant.abs() < most, "{intent:?}: {pixel:?} turns by {meant}");
                let [r, g, b] = pixel.map(u32::from);
                // Purple is where CAM16's hue grows.
                assert!(
                    b <= 2 * r.max(g) || seen < 3.0,
                    "{intent:?}: {pixel:?} turns by {seen} towards purple"
                );
            }
        }
    }

    #[test]
    fn every_lattice_has_the_solids_at_its_corners() {
        for intent in [Intent::Auto, Intent::Perceptual, Intent::Colorimetric] {
            let (fit, printable) = fitted(&Wishes { intent, ..DRAWN });
            let solids = Solids::new(&printable, &Space::half_angle(SAMPLES));
            for (bits, is_drawn) in (0..8).flat_map(|bits| [(bits, false), (bits, true)]) {
                let corner = [4, 2, 1].map(|bit| if bits & bit > 0 { 255 } else { 0 });
                let solid = solids.named(corner).unwrap();
                let number = fit.stacks.iter().position(|stack| *stack == solid).unwrap();
                assert_eq!(shares(&fit, corner, is_drawn)[number], 1.0, "{corner:?}, {intent:?}");
            }
        }
    }

    #[test]
    fn a_tint_of_an_ink_is_that_ink_alone() {
        // The light of the value between black and paper is the ground, and the rest is the ink.
        let tints = [
            ([179, 255, 255], "C", "substrate", 179),
            ([255, 51, 255], "M", "substrate", 51),
            ([255, 255, 127], "Y", "substrate", 127),
            ([255, 153, 153], "M+Y", "substrate", 153),
            ([255, 0, 127], "M+Y", "M", 127),
            ([0, 204, 255], "C+M", "C", 204),
        ];
        let (fit, _) = fitted(&DRAWN);
        for (rgb, name, ground, value) in tints {
            let share = 1.0 - f64::from(srgb::decode(value as f32 / 255.0));
            let shares = shares(&fit, rgb, true);
            let of = |name: &str| shares[fit.stacks.iter().position(|s| s.to_string() == name).unwrap()];
            assert!((of(name) - share).abs() < 0.005, "{name}: {} of {share}", of(name));
            assert!((of(name) + of(ground) - 1.0).abs() < 0.002, "{name}: {shares:?}");
        }
    }

    /// Tints change the hue of a pink by hardly more than an eye takes for the same.
    #[test]
    fn a_drawn_pink_looks_about_as_colorimetric_does() {
        let lab = |wishes: &Wishes, is_drawn: bool| {
            let (fit, printable) = fitted(wishes);
            let space = Space::half_angle(SAMPLES);
            let solids = Solids::new(&printable, &space);
            let shares = shares(&fit, [255, 128, 128], is_drawn);
            let parts = || fit.stacks.iter().map(|stack| solids.body(stack)).zip(&shares);
            let [r, g, b] = std::array::from_fn(|c| parts().map(|(body, share)| share * body[c]).sum());
            Lab::<D65, f64>::from_color_unclamped(LinSrgb::<f64>::new(r, g, b))
        };
        let drawn = lab(&DRAWN, true);
        let exact = lab(&Wishes { intent: Intent::Colorimetric, ..DRAWN }, false);
        let off = [drawn.l - exact.l, drawn.a - exact.a, drawn.b - exact.b];
        let off = off.into_iter().map(|v| v * v).sum::<f64>().sqrt();
        println!("{drawn:?} and {exact:?}: {off:.1}");
        assert!(off <= 12.0, "{drawn:?} and {exact:?}: {off}");
    }

    /// It was 0.6 over the last sixteenth: a dark band at the end.
    #[test]
    fn a_shading_that_ends_in_a_tint_of_two_inks_has_no_step() {
        // And so it is with tints that reach a fifth farther or less far.
        let Near { edge, hue, .. } = Near::USUAL;
        for (edge, hue) in
            [(edge, hue), (0.8 * edge, hue), (1.2 * edge, hue), (edge, 0.8 * hue), (edge, 1.2 * hue)]
        {
            let (fit, _) = fitted_by(Near { edge, hue, ..Near::USUAL }, &DRAWN);
            for (end, name) in [([0, 170, 255], "C+M"), ([255, 102, 0], "Y"), ([128, 0, 255], "M")] {
                let stack = fit.stacks.iter().position(|stack| stack.to_string() == name).unwrap();
                let at = |part: u32| {
                    let colour = end.map(|v: u32| (255 - (255 - v) * part / 64) as u8);
                    shares(&fit, colour, true)[stack]
                };
                let steps = (4..=64).map(|part| (at(part) - at(part - 4)).abs());
                let most = steps.fold(0.0, f64::max);
                println!("{edge}, {hue}: {end:?}: {most}");
                let bound = if (edge, hue) == (Near::USUAL.edge, Near::USUAL.hue) { 0.2 } else { 0.25 };
                assert!(most < bound, "{edge}, {hue}: {end:?}: {most}");
            }
        }
    }
}
