//! Makes a table of green noise: the order in which dots are set, by void and cluster.
//!
//! Method: the energy of a dot is the sum of a kernel over the dots that are set, on a torus. The kernel is wide, so that
//! dots keep away from each other, less a narrow one, so that they gather. From a tenth of the dots at random, the dot of
//! most energy moves to the place of least until nothing is gained. From there, dots leave in order of most energy, which are the
//! lowest ranks from the top down, and are added in order of least energy, which are the others.
//! Energies are integers, so the table is the same on any machine.
//! Cost: some 500 additions a dot.

use maths::Maths;

/// Deviation of the wide Gaussian in dots, and of the narrow one; the narrow one's height.
const WIDE: f64 = 2.2;
const NARROW: f64 = 0.8;
const DEPTH: f64 = 1.3;

/// The rank of every dot of a square of `side` dots, with clusters `scale` times as large as the usual ones.
pub(super) fn ranks(side: usize, scale: f64) -> Vec<u16> {
    let dots = side * side;
    let mut field = Field::new(side, scale);
    let first = dots / 10;
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut set = 0;
    while set < first {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        let at = (random >> 20) as usize % dots;
        if !field.set[at] {
            field.flip(at);
            set += 1;
        }
    }
    // Some moves only change places with each other, so they end.
    for _ in 0..4 * first {
        let from = field.tightest();
        field.flip(from);
        let to = field.emptiest();
        field.flip(to);
        if from == to {
            break;
        }
    }
    let start = field.set.clone();
    let mut ranks = vec![0; dots];
    for rank in (0..first).rev() {
        let at = field.tightest();
        ranks[at] = rank as u16;
        field.flip(at);
    }
    (0..dots).filter(|&at| start[at]).for_each(|at| field.flip(at));
    for rank in first..dots {
        let at = field.emptiest();
        ranks[at] = rank as u16;
        field.flip(at);
    }
    ranks
}

/// Dots that are set, and the energy of all.
struct Field {
    side: usize,
    /// Rows of the kernel, with its middle at `reach`, `reach`.
    kernel: Vec<i32>,
    reach: usize,
    energy: Vec<i32>,
    set: Vec<bool>,
    /// For each row the least energy of a dot that is not set, and the most of one that is.
    least: Vec<i32>,
    most: Vec<i32>,
}

impl Field {
    fn new(side: usize, scale: f64) -> Field {
        let (wide, narrow) = (scale * WIDE, scale * NARROW);
        let reach = ((4.5 * wide).ceil() as usize).min((side - 1) / 2);
        let across = 2 * reach + 1;
        let kernel = (0..across * across).map(|at| {
            let (x, y) = ((at % across) as f64 - reach as f64, (at / across) as f64 - reach as f64);
            let gauss = |deviation: f64| (-(x * x + y * y) / (2.0 * deviation * deviation)).exponential();
            (65536.0 * (gauss(wide) - DEPTH * gauss(narrow))).round() as i32
        });
        let mut field = Field {
            side,
            kernel: kernel.collect(),
            reach,
            energy: vec![0; side * side],
            set: vec![false; side * side],
            least: vec![0; side],
            most: vec![0; side],
        };
        (0..side).for_each(|y| field.look(y));
        field
    }

    /// Finds the extremes of a row anew.
    fn look(&mut self, y: usize) {
        let row = y * self.side..(y + 1) * self.side;
        let dots = || self.energy[row.clone()].iter().zip(&self.set[row.clone()]);
        self.least[y] =
            dots().map(|(&energy, &set)| if set { i32::MAX } else { energy }).fold(i32::MAX, i32::min);
        self.most[y] =
            dots().map(|(&energy, &set)| if set { energy } else { i32::MIN }).fold(i32::MIN, i32::max);
    }

    /// The dot that is not set and has the least energy.
    fn emptiest(&self) -> usize {
        let y = (0..self.side).min_by_key(|&y| self.least[y]).unwrap_or(0);
        self.find(y, self.least[y], false)
    }

    /// The dot that is set and has the most energy.
    fn tightest(&self) -> usize {
        let y = (0..self.side).max_by_key(|&y| self.most[y]).unwrap_or(0);
        self.find(y, self.most[y], true)
    }

    fn find(&self, y: usize, energy: i32, set: bool) -> usize {
        let mut row = y * self.side..(y + 1) * self.side;
        row.find(|&at| self.energy[at] == energy && self.set[at] == set).unwrap_or(0)
    }

    /// Sets a dot, or clears it.
    fn flip(&mut self, at: usize) {
        let (side, across) = (self.side, 2 * self.reach + 1);
        let (x, y) = (at % side + side - self.reach, at / side + side - self.reach);
        self.set[at] = !self.set[at];
        let sign = if self.set[at] { 1 } else { -1 };
        for (down, kernel) in self.kernel.chunks_exact(across).enumerate() {
            let row = &mut self.energy[(y + down) % side * side..][..side];
            for (right, value) in kernel.iter().enumerate() {
                row[(x + right) % side] += sign * value;
            }
        }
        for down in 0..across {
            self.look((y + down) % side);
        }
    }
}
