//! Eight planes as the halftones make them.

use appearance::gamut::InkMix;
use appearance::weights::{ONE, WeightMaps, quantise};
use halftone::{Method, Settings, halftone};
use inks::Stack;
use observe::Silent;
use protocol::ink::Ink;
use protocol::paper::Paper;
use sheet::DotMap;
use std::sync::OnceLock;

/// Dots across an A4 page.
pub const WIDTH: u16 = 4800;
/// Its rows.
pub const ROWS: u16 = 6372;

/// The planes of a whole A4 page, made once.
pub fn planes() -> &'static [Vec<u8>] {
    static PLANES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    PLANES.get_or_init(|| clustered((1200, 1593), (190.0, 230.0), Paper::A4))
}

/// The same mix in cells, made once.
pub fn cells() -> &'static [Vec<u8>] {
    static PLANES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    PLANES.get_or_init(|| halftoned(Method::Cells, (1200, 1593), (190.0, 230.0), Paper::A4))
}

/// Eight stacks of one ink and the bare paper over a whole page, smooth weights given by `size` pixels that turn once in
/// about 2 pi `scale` of them, clusters of at least 8 dots along the walk.
pub fn clustered(size: (usize, usize), scale: (f64, f64), paper: Paper) -> Vec<Vec<u8>> {
    halftoned(Method::Walk, size, scale, paper)
}

/// The same by another method.
pub fn halftoned(method: Method, size: (usize, usize), scale: (f64, f64), paper: Paper) -> Vec<Vec<u8>> {
    let map = dots(method, &Ink::ALL[..8], size, scale, paper);
    (1..9u8)
        .map(|ink| {
            let dots = map.index().chunks_exact(8);
            dots.map(|dots| dots.iter().fold(0, |byte, &stack| byte << 1 | u8::from(stack == ink))).collect()
        })
        .collect()
}

/// A stack of each of these inks and the bare paper over a whole page.
pub fn dots(
    method: Method,
    inks: &[Ink],
    (width, height): (usize, usize),
    scale: (f64, f64),
    paper: Paper,
) -> DotMap {
    let count = inks.len() + 1;
    let mut data = vec![0; width * height * count];
    for (pixel, out) in data.chunks_exact_mut(count).enumerate() {
        let (x, y) = ((pixel % width) as f64 / scale.0, (pixel / width) as f64 / scale.1);
        let weights: Vec<f64> = (0..count)
            .map(|i| 1.05 + (x * (1.0 + i as f64 * 0.3) + y * (2.0 - i as f64 * 0.2)).sin())
            .collect();
        quantise(&weights, out);
    }
    let stacks = std::iter::once(Stack::SUBSTRATE).chain(inks.iter().map(|&ink| Stack::new(vec![ink])));
    let matrix = (0..count).map(|i| (0..count).map(|j| if i == j { ONE } else { 0 }).collect()).collect();
    let maps = WeightMaps::new(width, height, count, data).expect("quantised");
    let mix = InkMix { stacks: stacks.collect(), maps, matrix };
    let page = (paper.width(), paper.length());
    let settings = Settings { method, ..Settings::uniform(count, 8) };
    halftone(&mix, page, None, &settings, &Silent).expect("a page")
}
