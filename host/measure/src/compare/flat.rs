//! Pictures laid flat on the sheet, and their means over squares of it.

/// The part of the sheet that is compared, in squares of a millimetre and in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Its middle and its size in mm of the sheet's frame.
    pub(crate) middle: [f64; 2],
    pub(crate) size: [f64; 2],
    /// Squares across and down.
    pub(crate) squares: [usize; 2],
    /// Pixels along a side of a square.
    pub(crate) fine: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

/// Side of a square in mm: figures are means over these, so that single dots do not count.
pub(crate) const SQUARE: f64 = 1.0;
/// The most pixels along a side of a window.
const LONGEST: f64 = 1000.0;

impl Window {
    /// A window with about `pixels` pixels a millimetre.
    pub(crate) fn new(middle: [f64; 2], size: [f64; 2], pixels: f64) -> Window {
        let squares = size.map(|side| (side / SQUARE).round().max(1.0) as usize);
        let most = (LONGEST / squares[0].max(squares[1]) as f64).floor().max(1.0);
        let fine = pixels.round().clamp(1.0, most.min(8.0)) as usize;
        let [width, height] = squares.map(|count| count * fine);
        Window { middle, size, squares, fine, width, height }
    }

    /// A place of the picture (pixels from its top left corner) in mm of the sheet's frame.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        [
            self.middle[0] + (x / self.width as f64 - 0.5) * self.size[0],
            self.middle[1] + (0.5 - y / self.height as f64) * self.size[1],
        ]
    }

    /// The middle of a square, counted row by row.
    pub(crate) fn square(&self, i: usize) -> [f64; 2] {
        let fine = self.fine as f64;
        self.place(((i % self.squares[0]) as f64 + 0.5) * fine, ((i / self.squares[0]) as f64 + 0.5) * fine)
    }
}

/// A picture of a window.
#[derive(Clone, Debug)]
pub(crate) struct Flat {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgb: Vec<[f32; 3]>,
    /// Whether a pixel was seen, and not full.
    pub(crate) known: Vec<bool>,
}

impl Flat {
    pub(crate) fn new(width: usize, height: usize) -> Flat {
        Flat { width, height, rgb: vec![[0.0; 3]; width * height], known: vec![true; width * height] }
    }

    /// Means over squares; `None` where a pixel is not known.
    pub(crate) fn squares(&self, window: &Window) -> Vec<Option<[f64; 3]>> {
        let ([across, down], fine) = (window.squares, window.fine);
        (0..across * down)
            .map(|i| {
                let (left, top) = (i % across * fine, i / across * fine);
                let mut sum = [0.0f64; 3];
                for y in top..top + fine {
                    for x in left..left + fine {
                        let at = y * self.width + x;
                        if !self.known[at] {
                            return None;
                        }
                        (0..3).for_each(|c| sum[c] += f64::from(self.rgb[at][c]));
                    }
                }
                Some(sum.map(|v| v / (fine * fine) as f64))
            })
            .collect()
    }
}
