//! Plain colour to the process inks: an image is a matte document.
//!
//! Problem: a photograph has millions of colours and a page thirty million dots, and white must stay bare paper.
//! Method: sRGB is taken relative to the paper: white is the bare paper and black is black ink (without it, the darkest
//! stack of the process inks at hand), colours lie between them in linear light. A lattice of 17 x 17 x 17 such colours is
//! fitted to the stacks by the gamut stage (eq. 1 at every node, so what cannot be printed is clamped to the nearest that
//! can), pixels are interpolated in it among the four corners of a tetrahedron, and the mix of stacks goes
//! to the halftone stage. Interpolated mixtures are mixtures, so every pixel is printable.
//! Cost: 50 ms for the lattice, 20 ns a pixel, 10 ns a dot. Pictures finer than 300 dpi are averaged to it, in linear
//! light: no cluster of dots is finer. Limits: colours are clamped, not compressed; the ink library decides how true
//! they are.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use image::DynamicImage;
use inks::{InkSet, Library, Stack};
use moxcms::{ColorProfile, DataColorSpace, Layout, TransformOptions};
use protocol::ink::{Ink, Kind};
use protocol::paper::Paper;
use rayon::prelude::*;

use super::raster::{self, Density, Unstated, io, wrong};
use super::{Artwork, LayersError, Options, bits, reserved};
use crate::halftone::Placement;
use crate::pipeline;
use crate::separate::Plane;
use appearance::brdf::{Space, Table};
use appearance::document::{Materials, SAMPLES};
use appearance::factor::Factored;
use appearance::gamut::{self, Gloss, InkMix, Intent, Printable};
use appearance::weights::{ONE, WeightMaps};
use observe::Observer;

/// Nodes along an edge of the lattice.
const NODES: usize = 17;

/// Colours to be printed with the process inks.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// sRGB, three bytes a pixel; 255, 255, 255 is bare paper.
    pub rgb: Vec<u8>,
}

/// A picture as read: straight alpha, sRGB.
pub(super) struct Pixels {
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub density: Option<Density>,
    /// Red, green, blue, opacity.
    pub rgba: Vec<u8>,
    pub notes: Vec<String>,
}

/// Reads a picture and brings its colours to sRGB.
pub(super) fn read(path: &Path) -> Result<Pixels, LayersError> {
    let file = File::open(path).map_err(io(path, "open it"))?;
    let decoded = raster::decode(path, BufReader::new(file))?;
    let (width, height) = (decoded.image.width(), decoded.image.height());
    let mut notes = Vec::new();
    let deep = matches!(
        decoded.image,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    if deep {
        notes.push(format!("{}: 16 bits a channel are read as 8", path.display()));
    }
    let grey = !decoded.image.color().has_color();
    let mut rgba = decoded.image.into_rgba8().into_raw();
    if let Some(profile) = decoded.profile {
        notes.extend(to_srgb(path, &profile, grey, &mut rgba)?);
    }
    Ok(Pixels { path: path.to_path_buf(), width, height, density: decoded.density, rgba, notes })
}

/// Applies an embedded profile; says so if it changed anything. `grey` is a picture whose file has grey values only.
pub(super) fn to_srgb(
    path: &Path,
    profile: &[u8],
    grey: bool,
    rgba: &mut [u8],
) -> Result<Option<String>, LayersError> {
    let Ok(profile) = ColorProfile::new_from_slice(profile) else {
        return Ok(Some(format!("{}: its colour profile is damaged; read as sRGB", path.display())));
    };
    let of_grey = match profile.color_space {
        DataColorSpace::Rgb => false,
        DataColorSpace::Gray if grey => true,
        other => {
            return Err(wrong(
                path,
                format!(
                    "its colour profile is for {other:?}, which its pixels are not; convert the picture to sRGB"
                ),
            ));
        }
    };
    let srgb = ColorProfile::new_srgb();
    let bad =
        |error| wrong(path, format!("its colour profile cannot be applied ({error}); convert it to sRGB"));
    let layout = if of_grey { Layout::GrayAlpha } else { Layout::Rgba };
    let transform = profile
        .create_transform_8bit(layout, &srgb, Layout::Rgba, TransformOptions::default())
        .map_err(bad)?;
    let mut changed = false;
    let mut line = vec![0; 4 << 12];
    let mut greys = Vec::new();
    for pixels in rgba.chunks_mut(4 << 12) {
        let line = &mut line[..pixels.len()];
        if of_grey {
            greys.clear();
            greys.extend(pixels.as_chunks::<4>().0.iter().flat_map(|&[v, _, _, alpha]| [v, alpha]));
        }
        transform.transform(if of_grey { &greys } else { &*pixels }, line).map_err(bad)?;
        changed |= pixels != line;
        pixels.copy_from_slice(line);
    }
    Ok(changed.then(|| format!("{}: its colour profile was applied", path.display())))
}

/// Art from one picture: reserved colours as layers if asked for, all else as colour.
pub(super) fn artwork(name: &str, mut pixels: Pixels, options: &Options) -> Result<Artwork, LayersError> {
    let sides = (f64::from(pixels.width), f64::from(pixels.height));
    let unstated = if options.reserved { Unstated::IsDots } else { Unstated::Fills };
    let dots = raster::dots(&pixels.path, sides, pixels.density, unstated, options, &mut pixels.notes)?;
    Ok(artwork_of(name, pixels, dots, options))
}

/// The same at a size that is known.
pub(super) fn artwork_of(name: &str, pixels: Pixels, dots: (usize, usize), options: &Options) -> Artwork {
    let Pixels { path, width, height, mut rgba, notes, .. } = pixels;
    let size = (width, height);
    let transparent = rgba.par_chunks_exact(4).any(|p| p[3] < 255);
    let opaque = transparent.then(|| plane_of::<4>(&rgba, size, dots, |p| p[3] > 0));
    rgba.par_chunks_exact_mut(4).for_each(|p| {
        let alpha = u32::from(p[3]);
        for v in &mut p[..3] {
            *v = ((u32::from(*v) * alpha + 255 * (255 - alpha) + 127) / 255) as u8;
        }
    });
    let mut rgb = rgba;
    // In place: three bytes of a pixel never lie after its four.
    for at in 0..rgb.len() / 4 {
        rgb.copy_within(4 * at..4 * at + 3, 3 * at);
    }
    rgb.truncate(rgb.len() / 4 * 3);
    let file = path.file_name().map_or_else(|| name.into(), |file| file.to_string_lossy().into_owned());
    let mut art = flat(name, &file, size, dots, rgb, options);
    art.opaque = opaque;
    art.notes.splice(..0, notes);
    art
}

/// Art from pixels without transparency, three bytes each. `file` is what notes call it.
pub(super) fn flat(
    name: &str,
    file: &str,
    size: (u32, u32),
    dots: (usize, usize),
    mut rgb: Vec<u8>,
    options: &Options,
) -> Artwork {
    let drawn = plane_of::<3>(&rgb, size, dots, |p| *p != [255; 3]);
    let (mut layers, mut notes) = (Vec::new(), Vec::new());
    if options.reserved {
        let found = reserved::take(&mut rgb, size, dots, options);
        notes.extend(found.notes(file));
        layers = found.layers;
    }
    let white = |bytes: &[u8]| bytes.iter().fold(255, |all, byte| all & byte) == 255;
    let colour = rgb.par_chunks(1 << 12).any(|bytes| !white(bytes)).then(|| {
        let full = Colour { width: size.0 as usize, height: size.1 as usize, rgb };
        full.averaged(dots)
    });
    let (width, length) = dots;
    Artwork { name: name.into(), width, length, layers, colour, drawn, opaque: None, notes }
}

/// The dots whose pixel, of `N` bytes, is so.
fn plane_of<const N: usize>(
    pixels: &[u8],
    size: (u32, u32),
    dots: (usize, usize),
    is: impl Fn(&[u8; N]) -> bool + Sync,
) -> Plane {
    let pixels = pixels.as_chunks::<N>().0;
    if (size.0 as usize, size.1 as usize) == dots {
        return bits::from(dots.0, pixels, is);
    }
    let bytes: Vec<u8> = pixels.par_iter().map(|pixel| u8::from(is(pixel))).collect();
    bits::from_bytes(dots.0, &raster::nearest(bytes, size, dots), |byte| byte > 0)
}

impl Colour {
    /// At most one pixel for two dots along each side.
    fn averaged(self, dots: (usize, usize)) -> Colour {
        let to = (self.width.min(dots.0.div_ceil(2)), self.height.min(dots.1.div_ceil(2)));
        if to == (self.width, self.height) {
            return self;
        }
        // Sums of linear light, 16 bits a channel: exact enough for 8-bit sRGB to come back as it was.
        let linear: Vec<u32> = (0..=255u8)
            .map(|v| {
                (65535.0 * appearance::document::picture::decode_srgb(f32::from(v) / 255.0)).round() as u32
            })
            .collect();
        let coded: Vec<u8> = (0..=65535)
            .map(|light| {
                let above = linear.partition_point(|&v| v < light).clamp(1, 255);
                let nearer = light.abs_diff(linear[above]) <= light.abs_diff(linear[above - 1]);
                (if nearer { above } else { above - 1 }) as u8
            })
            .collect();
        // Whole pixels: pairs, or the first and last are shared where sides are no multiples, which no dot shows.
        let span = |at: usize, from: usize, to: usize| match from.div_ceil(2) == to {
            true => 2 * at..(2 * at + 2).min(from),
            false => at * from / to..((at + 1) * from).div_ceil(to),
        };
        let mut rgb = vec![0; to.0 * to.1 * 3];
        rgb.par_chunks_exact_mut(to.0 * 3).enumerate().for_each(|(y, row)| {
            let rows = span(y, self.height, to.1);
            for (x, out) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let columns = span(x, self.width, to.0);
                let mut sum = [0u64; 3];
                for y in rows.clone() {
                    let line = &self.rgb[3 * (y * self.width + columns.start)..][..3 * columns.len()];
                    for pixel in line.as_chunks::<3>().0 {
                        sum.iter_mut()
                            .zip(pixel)
                            .for_each(|(sum, &v)| *sum += u64::from(linear[usize::from(v)]));
                    }
                }
                let count = (rows.len() * columns.len()) as u64;
                *out = sum.map(|sum| coded[((sum + count / 2) / count) as usize]);
            }
        });
        Colour { width: to.0, height: to.1, rgb }
    }

    /// The stacks of the dots: every stack is of process inks.
    pub(super) fn halftone(
        &self,
        dots: (usize, usize),
        inks: &InkSet,
        library: &Library,
        observer: &dyn Observer,
    ) -> Result<(Vec<Stack>, Vec<u8>), LayersError> {
        let mix = self.mix(inks, library, observer)?;
        // Art is refused before if it is larger than any page.
        let (width, height) = (dots.0 as u16, dots.1 as u16);
        let place = Placement { paper: Paper::Custom { width, length: height }, x: 0, y: 0, width, height };
        let sheet = pipeline::halftone_mix(&mix, library, &place, Default::default(), observer)?;
        Ok(sheet.into_parts())
    }

    /// The mixture of stacks at every pixel.
    fn mix(&self, inks: &InkSet, library: &Library, observer: &dyn Observer) -> Result<InkMix, LayersError> {
        let space = Space::half_angle(SAMPLES);
        let process = InkSet::of(inks.iter().filter(|ink| ink.kind() == Kind::Process));
        let printable = Printable::from_library(library, &process, &space);
        let lattice = Lattice::new(space, &printable);
        let mut bases = Table::new(lattice.space.columns());
        bases.push(&lattice.paper);
        let maps = WeightMaps::uniform(lattice.width(), lattice.height());
        let factored = Factored { space: lattice.space.clone(), bases, maps };
        let settings =
            gamut::Settings { intent: Intent::Clamp, gloss: Gloss::Keep, ..gamut::Settings::default() };
        let nodes = gamut::map(&factored, Some(&lattice), &printable, &settings, observer)?.mix;
        let channels = nodes.maps.channels();
        let mut data = vec![0u16; self.width * self.height * channels];
        let steps: [(usize, u32); 256] = std::array::from_fn(step);
        let lattice = Nodes::new(&nodes.maps);
        data.par_chunks_mut(channels << 12).zip(self.rgb.par_chunks(3 << 12)).for_each(|(out, rgb)| {
            let mut sums = vec![[0; 8]; lattice.each];
            for (out, pixel) in out.chunks_exact_mut(channels).zip(rgb.as_chunks::<3>().0) {
                lattice.between(pixel.map(|v| steps[usize::from(v)]), &mut sums, out);
            }
        });
        let maps =
            WeightMaps::new(self.width, self.height, channels, data).map_err(gamut::GamutError::from)?;
        Ok(InkMix { stacks: nodes.stacks, maps, matrix: nodes.matrix })
    }
}

/// The node below a value and how far above it the value lies, in 1/256.
fn step(value: usize) -> (usize, u32) {
    let at = value * (NODES - 1);
    let node = (at / 255).min(NODES - 2);
    (node, ((at - node * 255) * 256).div_euclid(255) as u32)
}

/// The mixtures of the lattice's nodes, for what lies between them.
struct Nodes {
    /// For each node its weights, eight at a time, the rest zero.
    lanes: Vec<[u16; 8]>,
    /// Lanes of a node.
    each: usize,
    /// Channel of the largest weight of each node.
    largest: Vec<usize>,
}

impl Nodes {
    fn new(maps: &WeightMaps) -> Nodes {
        let each = maps.channels().div_ceil(8);
        let nodes = || maps.data().chunks_exact(maps.channels());
        let lanes = nodes().flat_map(|node| {
            (0..each).map(move |lane| {
                std::array::from_fn(|at| node.get(8 * lane + at).copied().unwrap_or_default())
            })
        });
        let largest = nodes().map(|node| (0..node.len()).max_by_key(|&at| node[at]).unwrap_or(0)).collect();
        Nodes { lanes: lanes.collect(), each, largest }
    }

    /// The mixture between nodes: along the edges of the cube from its lowest corner to its highest, the axis with the
    /// largest fraction first. `sums` is room for the lanes of a node.
    #[inline]
    fn between(&self, at: [(usize, u32); 3], sums: &mut [[u16; 8]], out: &mut [u16]) {
        let [x, y, z] = at;
        let mut axes = [(x.1, NODES * NODES), (y.1, NODES), (z.1, 1)];
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            if axes[a].0 < axes[b].0 {
                axes.swap(a, b);
            }
        }
        let mut node = (x.0 * NODES + y.0) * NODES + z.0;
        let mut nearest = (0, node);
        let mut last = 256;
        sums.fill([0; 8]);
        for (next, step) in axes.into_iter().chain([(0, 0)]) {
            let part = last - next;
            if part == 256 {
                return out.copy_from_slice(&self.of(node).as_flattened()[..out.len()]);
            }
            if part > 0 {
                for (sums, weights) in sums.iter_mut().zip(self.of(node)) {
                    for (sum, &weight) in sums.iter_mut().zip(weights) {
                        *sum += ((u32::from(weight) * (part << 8)) >> 16) as u16;
                    }
                }
                nearest = nearest.max((part, node));
            }
            (last, node) = (next, node + step);
        }
        // What rounding down leaves, less than four units a channel, goes to the largest of the nearest node.
        let total: u16 = sums.as_flattened().iter().sum();
        sums.as_flattened_mut()[self.largest[nearest.1]] += ONE - total;
        out.copy_from_slice(&sums.as_flattened()[..out.len()]);
    }

    fn of(&self, node: usize) -> &[[u16; 8]] {
        &self.lanes[node * self.each..][..self.each]
    }
}

/// The lattice as a document: a matte for every node, red by rows of planes.
struct Lattice {
    space: Space,
    paper: Vec<f64>,
    black: Vec<f64>,
    /// Linear light of the nodes.
    light: [f64; NODES],
}

impl Lattice {
    fn new(space: Space, printable: &Printable) -> Lattice {
        let bright = |row: &[f64]| row.iter().zip(space.weight()).map(|(r, w)| r * w).sum::<f64>();
        let bare = printable.stacks.iter().position(|stack| stack.layers().is_empty()).unwrap_or(0);
        let black = printable.stacks.iter().position(|stack| stack.layers() == [Ink::Black]);
        let darkest = (0..printable.stacks.len())
            .min_by(|&a, &b| bright(printable.curves.row(a)).total_cmp(&bright(printable.curves.row(b))));
        // Black is black ink, where there is any: text in three inks is never sharp.
        let darkest = black.or(darkest).unwrap_or(0);
        let paper = printable.curves.row(bare).to_vec();
        let black = printable.curves.row(darkest).to_vec();
        let light = std::array::from_fn(|i| {
            f64::from(appearance::document::picture::decode_srgb(i as f32 / (NODES - 1) as f32))
        });
        Lattice { space, paper, black, light }
    }
}

impl Materials for Lattice {
    fn width(&self) -> usize {
        NODES * NODES
    }

    fn height(&self) -> usize {
        NODES
    }

    fn space(&self) -> &Space {
        &self.space
    }

    fn reflectance(&self, pixel: usize, out: &mut [f32]) {
        let light = [pixel / (NODES * NODES), pixel / NODES % NODES, pixel % NODES].map(|i| self.light[i]);
        for (at, out) in out.iter_mut().enumerate() {
            *out = (self.black[at] + light[at % 3] * (self.paper[at] - self.black[at])) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observe::Silent;
    use proptest::prelude::*;

    #[test]
    fn greys_reflect_what_they_should_and_white_is_bare_paper() {
        let greys: Vec<u8> = (0..=255).collect();
        let colour = Colour { width: 256, height: 1, rgb: greys.iter().flat_map(|&v| [v; 3]).collect() };
        let (library, inks) = (Library::builtin(), InkSet::default());
        let mix = colour.mix(&inks, &library, &Silent).unwrap();
        let space = Space::half_angle(SAMPLES);
        let row = |stack: &str| {
            let entry = library.entry(&stack.parse().unwrap()).unwrap();
            space.row(&entry.curve_at(space.angles()))
        };
        let (paper, darkest) = (row("substrate"), row("K"));
        let mut shares = vec![0.0; mix.stacks.len()];
        for (pixel, &v) in greys.iter().enumerate() {
            mix.shares(pixel, &mut shares);
            let light = f64::from(appearance::document::picture::decode_srgb(f32::from(v) / 255.0));
            // The raking half of the curve: the body's colour without the surface's gloss.
            let at = 3 * (SAMPLES - 1) + 1;
            let printed: f64 = mix
                .stacks
                .iter()
                .zip(&shares)
                .map(|(stack, share)| share * row(&stack.to_string())[at])
                .sum();
            let wanted = darkest[at] + light * (paper[at] - darkest[at]);
            assert!((printed - wanted).abs() < 0.02 * paper[at], "grey {v}: {printed}, not {wanted}");
        }
        mix.shares(255, &mut shares);
        assert_eq!(shares[0], 1.0, "white has no ink: {shares:?}");
    }

    #[test]
    fn averages_are_of_light_not_of_numbers() {
        let checks = (0..64 * 64).flat_map(|at| if (at % 64 + at / 64) % 2 == 0 { [255; 3] } else { [0; 3] });
        let colour = Colour { width: 64, height: 64, rgb: checks.collect() };
        let half = colour.clone().averaged((64, 64));
        assert_eq!((half.width, half.height), (32, 32));
        // sRGB of half the light.
        assert!(half.rgb.iter().all(|&v| v == 188), "{:?}", &half.rgb[..6]);
        assert_eq!(colour.clone().averaged((128, 128)), colour, "300 dpi stays as it is");
    }

    proptest! {
        #[test]
        fn between_nodes_weights_are_those_of_the_tetrahedron(pixel: [u8; 3], seed: u32, channels in 1usize..20) {
            let random = |i: usize| f64::from((i as u32 ^ seed).wrapping_mul(0x9e37_79b1) >> 11);
            let mut data = vec![0; NODES * NODES * NODES * channels];
            for (node, out) in data.chunks_exact_mut(channels).enumerate() {
                let weights: Vec<f64> = (0..channels).map(|q| random(channels * node + q)).collect();
                appearance::weights::quantise(&weights, out);
            }
            let maps = WeightMaps::new(NODES * NODES, NODES, channels, data).unwrap();
            let (nodes, at) = (Nodes::new(&maps), pixel.map(|v| step(usize::from(v))));
            let (mut sums, mut out) = (vec![[0; 8]; nodes.each], vec![0; channels]);
            nodes.between(at, &mut sums, &mut out);
            prop_assert_eq!(out.iter().map(|&w| u32::from(w)).sum::<u32>(), u32::from(ONE));
            // The barycentric form: a corner for each axis that is at least as far along as the fraction says.
            let mut exact = vec![0.0; channels];
            let mut levels = vec![0, 256];
            levels.extend(at.map(|(_, part)| part));
            levels.sort_unstable();
            for pair in levels.windows(2) {
                let node = at.iter().fold(0, |node, &(n, part)| node * NODES + n + usize::from(part > pair[0]));
                let share = f64::from(pair[1] - pair[0]) / 256.0;
                exact.iter_mut().zip(maps.at(node)).for_each(|(sum, &w)| *sum += share * f64::from(w));
            }
            for (&out, &exact) in out.iter().zip(&exact) {
                let off = f64::from(out) - exact;
                prop_assert!(off > -4.0 && off <= 4.0 * channels as f64, "{} is not {}", out, exact);
            }
        }

        #[test]
        fn a_value_lies_between_its_nodes(value in 0usize..256) {
            let (node, part) = step(value);
            let at = (node as f64 + f64::from(part) / 256.0) / (NODES - 1) as f64;
            prop_assert!((at - value as f64 / 255.0).abs() < 1.0 / 4000.0);
        }
    }
}
