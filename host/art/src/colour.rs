//! Plain colour to the process inks: a picture is a matte document.
//!
//! Problem: a photograph has millions of colours, a page has thirty million dots, white must stay bare paper, and letters
//! must stay whole.
//! Method: sRGB is relative to the paper. White is bare paper, and black is black ink; without black ink, it is the darkest
//! stack of the allowed process inks. Other colours lie between the two in linear light, brought into the inks' reach by an
//! [`Intent`] and fitted to the stacks at the nodes of a `lattice`. Dots in `flat` colours that a stack prints are fixed to
//! it, and `outline` decides which dots of letters and lines are. The halftone makes the others of their mixtures.
//! Cost: 60 ms for a lattice, 20 ns a pixel, 10 ns a dot; a page in black and white needs none of it. Pictures finer than
//! 300 dpi are averaged to 300 dpi in linear light, because no cluster of dots is finer. White and black dots do not count
//! in such an average: they are fixed. Limits: the accuracy of colours is that of the ink library.

use std::borrow::Cow;
use std::ops::Range;

use inks::{InkSet, Library, Stack};
use protocol::ink::Ink;
use rayon::prelude::*;

use super::averages::{averaged, joined};
use super::bitplane;
use super::compose::Settings;
use super::error::{not_halftoned, unfitted};
use super::fine;
use super::flat::{BLACK, Flat, INKED, TONE, is_tone, split};
use super::intent::Intent;
use super::lattice::{Lattice, Nodes, ends, step, with_tints};
use super::looks::Looks;
use super::outline;
use super::pixels::Pixels;
use super::solids::Solids;
use super::treatments::treatments;
use appearance::brdf::Space;
use appearance::document::SAMPLES;
use appearance::gamut::{self, InkMix, Printable};
use appearance::srgb;
use appearance::weights::{ONE, WeightMaps};
use halftone::green_noise::Table;
use halftone::{Method, halftone};
use observe::{Diagnosis, Observer};
use sheet::{Plane, pack};

/// Colours to print with the process inks.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Colour {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// sRGB, three bytes a pixel; 255, 255, 255 is bare paper. Empty if everything is black or white, and as long as flat
    /// colours may all become solids.
    pub rgb: Vec<u8>,
    /// For each pixel whether text or a drawing has its colour; empty if none has.
    pub(super) drawn: Vec<bool>,
    /// Whether the colours are printed on dots of layers, too; an ink of a layer otherwise has its dots to itself.
    pub(super) overprints: bool,
    /// The dots in flat colours; without any, all are tones.
    pub(super) flat: Flat,
    /// The black dots, if all others are white; then there is nothing else.
    pub(super) black: Option<Plane>,
    /// The colours as they are read; then there is nothing else.
    pub(super) pixels: Option<Pixels>,
}

impl Colour {
    /// The colours of pixels of three bytes, or of four with a tag before them, to be printed on so many dots; `None` if
    /// all are white.
    pub(super) fn of<const N: usize>(
        pixels: &[[u8; N]],
        size: (u32, u32),
        dots: (usize, usize),
    ) -> Option<Colour> {
        let white = |pixels: &[[u8; N]]| {
            pixels.iter().fold(255, |all, pixel| all & split(pixel).1.iter().fold(255, |a, v| a & v)) == 255
        };
        if pixels.par_chunks(1 << 12).all(white) {
            return None;
        }
        let flat = Flat::of(pixels, size.0 as usize);
        if flat.is_black_and_white() {
            let flat = flat.at_dots(size, dots);
            return Some(Colour::black(bitplane::from_bytes(dots.0, &flat.index, |dot| dot == BLACK)));
        }
        if !flat.has_tones() {
            return Colour::of_flat(flat.at_dots(size, dots), dots);
        }
        // Of flat colours it is not yet known which are fixed.
        let is_flat = |at: usize| !is_tone(flat.index[at]);
        let size_of = (size.0 as usize, size.1 as usize);
        let colour = averaged(|at| split(&pixels[at]), is_flat, &flat, size_of, dots);
        Some(Colour { flat: flat.at_dots(size, dots), ..colour })
    }

    /// The colours of pixels of `N` bytes ([`Colour::of`]), kept as they are; `None` if all are white.
    pub(super) fn of_pixels<const N: usize>(bytes: Vec<u8>, size: (u32, u32)) -> Option<Colour> {
        let is_white = |pixels: &[[u8; N]]| {
            pixels.iter().fold(255, |all, pixel| all & split(pixel).1.iter().fold(255, |a, v| a & v)) == 255
        };
        let white = bytes.as_chunks::<N>().0.par_chunks(1 << 12).all(is_white);
        let pixels = Pixels { bytes, each: N, width: size.0 as usize, height: size.1 as usize };
        (!white).then(|| Colour { pixels: Some(pixels), ..Colour::default() })
    }

    /// The colours of these pixels as tones and flat colours.
    pub(super) fn read(&self, dots: (usize, usize)) -> Cow<'_, Colour> {
        let Some(Pixels { bytes, each, width, height }) = &self.pixels else { return Cow::Borrowed(self) };
        let size = (*width as u32, *height as u32);
        let read = match each {
            4 => Colour::of::<4>(bytes.as_chunks().0, size, dots),
            _ => Colour::of::<3>(bytes.as_chunks().0, size, dots),
        };
        Cow::Owned(Colour { overprints: self.overprints, ..read.unwrap_or_default() })
    }

    /// Whether no dot has a colour: all that was drawn is finer than a dot.
    fn is_empty(&self) -> bool {
        self.pixels.is_none() && self.black.is_none() && self.rgb.is_empty() && self.flat.index.is_empty()
    }

    /// Flat colours alone; `None` if all are white.
    pub(super) fn of_flat(flat: Flat, dots: (usize, usize)) -> Option<Colour> {
        if flat.is_black_and_white() {
            let black = bitplane::from_bytes(dots.0, &flat.index, |dot| dot == BLACK);
            return (black.dots() > 0).then(|| Colour::black(black));
        }
        Some(Colour { flat, ..Colour::default() })
    }

    /// The colours between which dots are halftoned. Flat colours are averaged only now, when it may be known which dots are `fixed`.
    pub(super) fn averages(&self, dots: (usize, usize), fixed: Option<&[u8]>) -> Cow<'_, Colour> {
        let is_fixed = |at: usize| fixed.is_some_and(|fixed| fixed[at] != TONE);
        let has_colours = !self.flat.index.is_empty() && self.flat.colours.len() > usize::from(BLACK) + 1;
        match self.rgb.is_empty() {
            _ if !has_colours => Cow::Borrowed(self),
            false => Cow::Owned(joined(self, &self.flat, is_fixed, dots)),
            true => {
                let pixel = |at: usize| self.flat.colours[usize::from(self.flat.index[at])];
                Cow::Owned(averaged(pixel, is_fixed, &self.flat, dots, dots))
            }
        }
    }

    /// The colour of a dot that is a tone, or is beside one; `None` if there are no tones.
    fn tones(&self, dots: (usize, usize)) -> Option<impl Fn(usize) -> [u8; 3] + Sync> {
        (!self.rgb.is_empty()).then_some(move |at: usize| {
            let (x, y) = (at % dots.0 * self.width / dots.0, at / dots.0 * self.height / dots.1);
            let at = 3 * (y * self.width + x);
            [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
        })
    }

    /// Black dots on white.
    pub(super) fn black(dots: Plane) -> Colour {
        Colour { black: Some(dots), ..Colour::default() }
    }

    /// The plane of each process ink that the colours need.
    pub(super) fn planes(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        settings: &Settings,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<Vec<(Ink, Plane)>, Diagnosis> {
        let is_fine = settings.halftone == Method::Fine;
        let colour = if is_fine { Cow::Borrowed(self) } else { self.read(dots) };
        if colour.is_empty() {
            return Ok(Vec::new());
        }
        if let Some(black) = &colour.black {
            let inks = black_inks(inks, library);
            return Ok(inks.into_iter().map(|ink| (ink, black.clone())).collect());
        }
        let (stacks, index) = match is_fine {
            true => colour.fine(dots, inks, settings, library, observer)?,
            false => colour.halftone(dots, inks, settings, library, observer)?,
        };
        let mut inks_of = [0u16; 256];
        for (inks_of, stack) in inks_of.iter_mut().zip(&stacks) {
            let has = inks.iter().enumerate().filter(|(_, ink)| stack.layers().contains(ink));
            *inks_of = has.fold(0, |bits, (at, _)| bits | 1 << at);
        }
        let planes = pack::pack(dots.0, &index, &inks_of, inks.len());
        Ok(inks.iter().zip(planes).collect())
    }

    /// Picks the stack of each dot by a table: stacks of process inks, and the stack of each dot.
    fn fine(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        settings: &Settings,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(Vec<Stack>, Vec<u8>), Diagnosis> {
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(library, inks, &space);
        let solids = Solids::new(&printable, &space);
        let fit = self.fit((&printable, &solids), space, settings, observer)?;
        let minimum = fit.stacks.iter().map(|stack| library.minimum_cluster(stack)).max();
        let table = Table::for_cluster(minimum.unwrap_or_default());
        let index = match &self.pixels {
            Some(pixels) => fine::dots(pixels.rows(dots), dots, &fit, &solids, table),
            None => {
                let keys = self.flat.keys();
                let rows = |rows: Range<usize>, out: &mut [fine::Key]| {
                    let dots = &self.flat.index[rows.start * dots.0..rows.end * dots.0];
                    out.iter_mut().zip(dots).for_each(|(out, &dot)| *out = keys[usize::from(dot)]);
                };
                fine::dots(rows, dots, &fit, &solids, table)
            }
        };
        Ok((fit.stacks, index))
    }

    /// Halftones the colours: stacks of process inks, and the stack of each dot.
    fn halftone(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        settings: &Settings,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(Vec<Stack>, Vec<u8>), Diagnosis> {
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(library, inks, &space);
        let solids = Solids::new(&printable, &space);
        if let Some(done) = self.without_tones(&solids) {
            return Ok(done);
        }
        let mut fit = self.fit((&printable, &solids), space, settings, observer)?;
        let fixed = (!self.flat.index.is_empty()).then(|| {
            let treatments = treatments(&self.flat, dots.0, &mut fit, &solids);
            let looks = Looks::of(&self.flat, &treatments, &fit.stacks, &solids, self.tones(dots));
            outline::fixed(&self.flat, dots.0, &treatments, &looks)
        });
        let fixed = match fixed {
            Some(fixed) if !fixed.par_chunks(1 << 16).any(|dots| dots.contains(&TONE)) => {
                return Ok((fit.stacks, fixed));
            }
            fixed => fixed,
        };
        let mix = self.averages(dots, fixed.as_deref()).mix(fit)?;
        // Larger art was refused when its size was decided.
        let size = (dots.0 as u16, dots.1 as u16);
        let toning = halftone::Settings {
            method: settings.halftone,
            ..halftone::Settings::from_library(&mix.stacks, library)
        };
        Ok(halftone(&mix, size, fixed.as_deref(), &toning, observer).map_err(not_halftoned)?.into_parts())
    }

    /// Fits the nodes of the lattices that are needed.
    pub(super) fn fit(
        &self,
        (printable, solids): (&Printable, &Solids<'_>),
        space: Space,
        settings: &Settings,
        observer: &dyn Observer,
    ) -> Result<Fit, Diagnosis> {
        let has_drawings = self.pixels.is_some() || self.flat.colours.len() > 2 || !self.drawn.is_empty();
        let intents: &[Intent] = match settings.intent {
            Intent::Auto if has_drawings => &[Intent::Perceptual, Intent::Colorimetric],
            Intent::Auto => &[Intent::Perceptual],
            Intent::Perceptual => &[Intent::Perceptual],
            Intent::Colorimetric => &[Intent::Colorimetric],
        };
        let lattice = Lattice::new(space, printable, intents, settings.gamma);
        // A colour is the light of the whole surface: its rows are flat, so the light would only count it twice.
        let clamp = gamut::GamutSettings {
            intent: gamut::Intent::Clamp,
            light: 0.0,
            ..gamut::GamutSettings::default()
        };
        let mut mix = gamut::clamped(&lattice, printable, &clamp, observer).map_err(unfitted)?.mix;
        let of_drawings = intents.len() - 1;
        if of_drawings > 0 {
            let named = |colour| solids.named(colour);
            let amount = |level: f64| {
                let value = level.powf(1.0 / settings.gamma);
                // Dots add light.
                if settings.halftone == Method::Fine { srgb::decode(value as f32).into() } else { value }
            };
            mix = with_tints(mix, of_drawings, amount, named).map_err(unfitted)?;
        }
        let InkMix { stacks, maps, matrix } = mix;
        let channels = maps.channels();
        let steps = std::array::from_fn(step);
        Ok(Fit { stacks, matrix, channels, nodes: Nodes::new(&maps), steps, of_drawings })
    }

    /// The mixture of stacks at every pixel.
    fn mix(&self, fit: Fit) -> Result<InkMix, Diagnosis> {
        let channels = fit.channels;
        let mut data = vec![0u16; self.width * self.height * channels];
        data.par_chunks_mut(channels << 12).zip(self.rgb.par_chunks(3 << 12)).enumerate().for_each(
            |(block, (out, rgb))| {
                let mut sums = fit.nodes.scratch();
                let drawn = self.drawn.get(block << 12..).unwrap_or_default();
                let drawn = drawn.iter().copied().chain(std::iter::repeat(false));
                for ((out, pixel), drawn) in
                    out.chunks_exact_mut(channels).zip(rgb.as_chunks::<3>().0).zip(drawn)
                {
                    let lattice = if drawn { fit.of_drawings } else { 0 };
                    fit.nodes.between(lattice, pixel.map(|v| fit.steps[usize::from(v)]), &mut sums, out);
                }
            },
        );
        let maps = WeightMaps::new(self.width, self.height, channels, data).map_err(unfitted)?;
        Ok(InkMix { stacks: fit.stacks, maps, matrix: fit.matrix })
    }

    /// The stacks, and that of each dot, if all dots are in colours that are the name of a stack.
    fn without_tones(&self, solids: &Solids<'_>) -> Option<(Vec<Stack>, Vec<u8>)> {
        let index = &self.flat.index;
        let used = index.par_chunks(1 << 16).map(|dots| {
            let mut used = [false; 256];
            dots.iter().for_each(|&dot| used[usize::from(dot)] = true);
            used
        });
        let used = used.reduce(|| [false; 256], |a, b| std::array::from_fn(|at| a[at] | b[at]));
        if index.is_empty() || used[usize::from(TONE)] || used[usize::from(INKED)] {
            return None;
        }
        let mut stacks = vec![Stack::SUBSTRATE];
        let mut number = [0u8; 256];
        for (at, (_, colour)) in self.flat.colours.iter().enumerate().filter(|(at, _)| used[*at]) {
            let stack = solids.named(*colour)?;
            let known = stacks.iter().position(|known| *known == stack).unwrap_or_else(|| {
                stacks.push(stack);
                stacks.len() - 1
            });
            number[at] = known as u8;
        }
        Some((stacks, index.par_iter().map(|&dot| number[usize::from(dot)]).collect()))
    }
}

/// The inks of black: black ink or, without it, the darkest stack of these process inks.
fn black_inks(inks: &InkSet, library: &Library) -> Vec<Ink> {
    if inks.contains(Ink::Black) {
        return vec![Ink::Black];
    }
    let space = Space::half_angle(SAMPLES);
    let printable = Printable::from_library(library, inks, &space);
    printable.stacks[ends(&printable, &space).1].layers().to_vec()
}

/// The nodes of the lattices, fitted.
pub(super) struct Fit {
    pub stacks: Vec<Stack>,
    /// Shares of the stacks in each channel.
    matrix: Vec<Vec<u16>>,
    channels: usize,
    nodes: Nodes,
    /// Places of the 256 values between nodes.
    pub steps: [(usize, u32); 256],
    /// Number of the lattice for text and drawings.
    pub of_drawings: usize,
}

impl Fit {
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

    /// The weights of the stacks in a flat colour.
    pub fn weights(&self, colour: [u8; 3]) -> Vec<f64> {
        let (mut sums, mut weights) = (self.nodes.scratch(), vec![0; self.channels]);
        self.nodes.between(
            self.of_drawings,
            colour.map(|v| self.steps[usize::from(v)]),
            &mut sums,
            &mut weights,
        );
        let share = |stack: usize| -> f64 {
            let parts = weights.iter().zip(&self.matrix);
            parts.map(|(&weight, shares)| f64::from(weight) * f64::from(shares[stack])).sum()
        };
        let one = f64::from(ONE) * f64::from(ONE);
        (0..self.stacks.len()).map(|stack| share(stack) / one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::intent::{Light, difference, oklab};
    use super::super::kinds::ObjectType;
    use super::super::treatments::{Shape, Treatment};
    use super::*;
    use observe::Silent;
    use protocol::ink::Kind;

    /// The mixture of pictures' pixels by an intent, with the reflectance of the stacks.
    fn mixed(pixels: &[[u8; 3]], intent: Intent) -> (InkMix, Printable) {
        let colour = Colour {
            width: pixels.len(),
            height: 1,
            rgb: pixels.as_flattened().to_vec(),
            ..Colour::default()
        };
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(&Library::builtin(), &process(), &space);
        let settings = Settings { intent, ..Settings::default() };
        let fit =
            colour.fit((&printable, &Solids::new(&printable, &space)), space.clone(), &settings, &Silent);
        let mix = colour.mix(fit.unwrap()).unwrap();
        (mix, printable)
    }

    fn process() -> InkSet {
        InkSet::of(InkSet::default().iter().filter(|ink| ink.kind() == Kind::Process))
    }

    /// What is printed for each pixel, between black and paper in linear light.
    fn printed(pixels: &[[u8; 3]], intent: Intent) -> Vec<Light> {
        let (mix, printable) = mixed(pixels, intent);
        let (bare, black) = ends(&printable, &Space::half_angle(SAMPLES));
        let row = |stack: &Stack| {
            printable.curves.row(printable.stacks.iter().position(|known| known == stack).unwrap())
        };
        let mut shares = vec![0.0; mix.stacks.len()];
        (0..pixels.len())
            .map(|pixel| {
                mix.shares(pixel, &mut shares);
                std::array::from_fn(|c| {
                    let at = 3 * (SAMPLES - 1) + c;
                    let light: f64 =
                        mix.stacks.iter().zip(&shares).map(|(stack, share)| share * row(stack)[at]).sum();
                    let [paper, black] = [bare, black].map(|end| printable.curves.row(end)[at]);
                    (light - black) / (paper - black)
                })
            })
            .collect()
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
            let (mix, _) = mixed(&greys, intent);
            let mut shares = vec![0.0; mix.stacks.len()];
            mix.shares(255, &mut shares);
            assert_eq!(shares[0], 1.0, "white has no ink: {shares:?}");
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
                assert!(step > 0.08 * asked && step < 1.6 * asked, "{:?}: {step} for {asked}", pixels[1]);
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
        let pixels: Vec<[u8; 3]> = reds().flat_map(|(r, g)| levels.map(|b| [r, g, b])).collect();
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
    fn a_tint_of_an_ink_is_that_ink_alone() {
        // The value between black and paper decides: of it, or of its light, is the ground, and the rest is the ink.
        let tints = [
            ([179, 255, 255], "C", "substrate", 179),
            ([255, 51, 255], "M", "substrate", 51),
            ([255, 255, 127], "Y", "substrate", 127),
            ([255, 153, 153], "M+Y", "substrate", 153),
            ([255, 0, 127], "M+Y", "M", 127),
            ([0, 204, 255], "C+M", "C", 204),
        ];
        let pixels: Vec<[u8; 4]> =
            tints.iter().flat_map(|&([r, g, b], ..)| [[ObjectType::DRAWING, r, g, b]; 4]).collect();
        let colour = Colour::of(&pixels, (16, 1), (16, 1)).unwrap();
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(&Library::builtin(), &process(), &space);
        let solids = Solids::new(&printable, &space);
        for halftone in [Method::Cells, Method::Fine] {
            let settings = Settings { halftone, ..Settings::default() };
            let fit = colour.fit((&printable, &solids), space.clone(), &settings, &Silent).unwrap();
            for (rgb, name, ground, value) in tints {
                let value = value as f32 / 255.0;
                let share =
                    1.0 - f64::from(if halftone == Method::Fine { srgb::decode(value) } else { value });
                let weights = fit.weights(rgb);
                let of = |name: &str| weights[fit.stacks.iter().position(|s| s.to_string() == name).unwrap()];
                assert!((of(name) - share).abs() < 0.005, "{name}: {} of {share}", of(name));
                assert!((of(name) + of(ground) - 1.0).abs() < 0.002, "{name}: {weights:?}");
            }
        }
    }

    /// It was 0.6 over the last sixteenth: a dark band at the end.
    #[test]
    fn a_shading_that_ends_in_a_tint_of_two_inks_has_no_step() {
        let colour = Colour::of(&[[ObjectType::DRAWING, 1, 2, 3]; 4], (4, 1), (4, 1)).unwrap();
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(&Library::builtin(), &process(), &space);
        let solids = Solids::new(&printable, &space);
        let fit = colour.fit((&printable, &solids), space, &Settings::default(), &Silent).unwrap();
        for (end, name) in [([0, 170, 255], "C+M"), ([255, 102, 0], "Y"), ([128, 0, 255], "M")] {
            let stack = fit.stacks.iter().position(|stack| stack.to_string() == name).unwrap();
            let at = |part: u32| {
                let colour = end.map(|v: u32| (255 - (255 - v) * part / 64) as u8);
                fit.weights(colour)[stack]
            };
            let steps = (4..=64).map(|part| (at(part) - at(part - 4)).abs());
            let most = steps.fold(0.0, f64::max);
            assert!(most < 0.2, "{end:?}: {most}");
        }
    }

    #[test]
    fn inks_are_found_in_flat_colours() {
        let names = [
            [0, 0, 0],
            [255, 0, 255],
            [0, 0, 255],
            [0, 255, 255],
            [255, 255, 0],
            [255, 0, 0],
            [0, 255, 0],
            [20, 20, 20],
            [128, 128, 128],
            [204, 204, 204],
        ];
        let mut pixels: Vec<[u8; 4]> =
            names.iter().flat_map(|&[r, g, b]| [[ObjectType::DRAWING, r, g, b]; 8]).collect();
        pixels.push([0, 255, 255, 255]);
        let colour = Colour::of(&pixels, (pixels.len() as u32, 1), (pixels.len(), 1)).unwrap();
        let space = Space::half_angle(SAMPLES);
        let printable = Printable::from_library(&Library::builtin(), &process(), &space);
        let solids = Solids::new(&printable, &space);
        let mut fit =
            colour.fit((&printable, &solids), space.clone(), &Settings::default(), &Silent).unwrap();
        let treatments = treatments(&colour.flat, pixels.len(), &mut fit, &solids);
        let found = |rgb: [u8; 3]| {
            let at = colour.flat.colours.iter().position(|(_, colour)| *colour == rgb).unwrap();
            match treatments[at] {
                Treatment::Solid(stack) => fit.stacks[usize::from(stack)].to_string(),
                Treatment::Shape(Shape { solids, dark, .. }) => {
                    format!("{} {}", if dark { "dark" } else { "pale" }, fit.stacks[usize::from(solids[0])])
                }
            }
        };
        assert_eq!(names.map(found), ["K", "M", "C+M", "C", "Y", "M+Y", "C+Y", "K", "dark K", "pale K"]);
    }
}
