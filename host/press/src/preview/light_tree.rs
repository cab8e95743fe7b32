//! The light of a probe as a tree, and what of it falls on a normal at every half angle.
//!
//! Problem: a ball of 160 pixels under a probe of 32 768 texels would be 700 million directions of light.
//! Method: the texels form a quadtree. A node replaces its texels where the curve and the cosine hardly change over it, which
//! depends on the normal. Neighbouring normals go down the tree together, a lane each, and a node is opened where any of them
//! asks for it. What a node sends is spread over the two nearest entries of a table of the half angle (`fine`), one for each
//! normal.
//! Cost: building looks at every node once; gathering at some thousands of nodes for eight normals, half of which send light.
//! Limits: the eye is far away on the z axis.

use super::fine::{ENTRIES, Fine};
use super::probe::{Directions, Probe};

/// The most normals that go down the tree together.
pub const NORMALS: usize = 8;

/// A node replaces its texels if its half vectors spread over no more than this fraction of their angle to the normal. A test
/// shows that every pixel stays within 1 % of the sum over single texels, for the sharpest foil and for paper.
const OPENING: f64 = 0.12;

/// Sine of the reach of the largest nodes that may cross the horizon of a normal.
const HORIZON: f32 = 0.1;

/// A texel of a probe, or a group of them.
struct Node {
    /// Unit direction of the light, weighted by radiance.
    towards: [f32; 3],
    /// Its half vector with the eye.
    half: [f32; 3],
    /// Sum of radiance times solid angle; a fourth channel of zero fills a vector.
    light: [f32; 4],
    /// Greatest sine of the angle between `towards` and the node's corners.
    reach: f32,
    /// The least squared distance of a normal from `half` at which the node replaces its texels; 0 for single texels.
    closest: f32,
    /// The node after this one's descendants.
    next: u32,
}

/// A quadtree of nodes, each followed by its descendants.
pub struct LightTree {
    nodes: Vec<Node>,
}

/// Light on up to [`NORMALS`] normals, by half angle.
pub struct Gathered(Vec<[f32; 4]>);

impl Default for Gathered {
    fn default() -> Gathered {
        Gathered(vec![[0.0; 4]; NORMALS * ENTRIES])
    }
}

impl Gathered {
    /// The light on normal `k` for each entry of a table, in three channels and one of zero.
    pub fn of(&self, k: usize) -> &[[f32; 4]] {
        &self.0[k * ENTRIES..][..ENTRIES]
    }
}

/// What the texels of a node add up to.
#[derive(Clone, Copy)]
struct Sums {
    light: [f64; 3],
    /// Directions and their total weight, which is the light.
    mean: [f64; 3],
    total: f64,
}

impl LightTree {
    /// The tree of a probe.
    pub fn new(probe: &Probe) -> LightTree {
        let mut tree = LightTree { nodes: Vec::with_capacity(2 * probe.rgb().len()) };
        let solid: Vec<f64> = (0..probe.height()).map(|y| probe.solid_angle(y)).collect();
        let builder = Builder { probe, directions: Directions::new(probe), solid };
        tree.add(&builder, [0, probe.width()], [0, probe.height()]);
        tree
    }

    /// Adds the node of columns `x` and rows `y` (start, end) with its descendants. Each recursion halves the longer side, so
    /// the depth is the logarithm of the number of texels.
    fn add(&mut self, builder: &Builder, x: [usize; 2], y: [usize; 2]) -> Sums {
        let here = self.nodes.len();
        self.nodes.push(Node {
            towards: [0.0; 3],
            half: [0.0; 3],
            light: [0.0; 4],
            reach: 0.0,
            closest: 0.0,
            next: 0,
        });
        let (across, down) = (x[1] - x[0], y[1] - y[0]);
        let single = across == 1 && down == 1;
        let sums = if single {
            builder.texel(x[0], y[0])
        } else if across >= down {
            let middle = x[0] + across / 2;
            self.add(builder, [x[0], middle], y).with(&self.add(builder, [middle, x[1]], y))
        } else {
            let middle = y[0] + down / 2;
            self.add(builder, x, [y[0], middle]).with(&self.add(builder, x, [middle, y[1]]))
        };
        let length = dot(sums.mean, sums.mean).sqrt();
        // Directions may cancel. Such a node is always opened, so its direction does not matter.
        let scattered = length < 0.3 * sums.total;
        let towards =
            if length > 1e-12 * sums.total { sums.mean.map(|v| v / length) } else { [0.0, 1.0, 0.0] };
        let h = half(towards);
        let (mut reach, mut spread) = (0.0f64, 0.0f64);
        if scattered {
            (reach, spread) = (2.0, 2.0);
        } else if !single {
            for j in 0..=4 {
                for i in 0..=4 {
                    let d = builder.directions.at(4 * x[0] + across * i, 4 * y[0] + down * j);
                    reach = reach.max(distance(d, towards));
                    spread = spread.max(distance(half(d), h));
                }
            }
        }
        let [r, g, b] = sums.light.map(|v| v as f32);
        self.nodes[here] = Node {
            towards: towards.map(|v| v as f32),
            half: h.map(|v| v as f32),
            light: [r, g, b, 0.0],
            reach: reach as f32,
            closest: (spread / OPENING).powi(2) as f32,
            next: self.nodes.len() as u32,
        };
        sums
    }

    /// Replaces `gathered` by the light on up to [`NORMALS`] normals, the nearer to each other the faster.
    #[inline(always)]
    pub fn gather(&self, normals: &[[f32; 3]], fine: &Fine, gathered: &mut Gathered) {
        let Some(first) = normals.first() else { return };
        gathered.0.fill([0.0; 4]);
        let mut n = first.map(|v| [v; NORMALS]);
        for (k, normal) in normals.iter().enumerate() {
            (0..3).for_each(|c| n[c][k] = normal[c]);
        }
        let mut i = 0;
        while let Some(node) = self.nodes.get(i) {
            let (mut cos, mut square) = ([0.0f32; NORMALS], [0.0f32; NORMALS]);
            let (t, h) = (&node.towards, &node.half);
            for k in 0..NORMALS {
                cos[k] = n[0][k] * t[0] + n[1][k] * t[1] + n[2][k] * t[2];
                let d = [n[0][k] - h[0], n[1][k] - h[1], n[2][k] - h[2]];
                square[k] = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            }
            // The cosine has a kink at the horizon, so only small nodes may cross it.
            let kink = if node.reach < HORIZON { -2.0 } else { node.reach };
            let (mut lit, mut open) = (0u32, 0u32);
            for k in 0..NORMALS {
                let reached = u32::from(cos[k] > -node.reach);
                lit |= reached;
                open |= reached & u32::from((square[k] < node.closest) | (cos[k] <= kink));
            }
            if open != 0 {
                i += 1;
                continue;
            }
            if lit != 0 {
                for square in &mut square {
                    *square = square.sqrt();
                }
                let (entry, part) = fine.at_each(&square);
                for (k, light) in gathered.0.chunks_exact_mut(ENTRIES).take(normals.len()).enumerate() {
                    let cos = cos[k].max(0.0);
                    add(&mut light[entry[k]], cos * (1.0 - part[k]), &node.light);
                    add(&mut light[entry[k] + 1], cos * part[k], &node.light);
                }
            }
            i = node.next as usize;
        }
    }
}

/// `sum += part light`, in one vector.
#[inline(always)]
fn add(sum: &mut [f32; 4], part: f32, light: &[f32; 4]) {
    let [r, g, b, none] = *sum;
    *sum = [r + part * light[0], g + part * light[1], b + part * light[2], none + part * light[3]];
}

/// What all nodes are built from.
struct Builder<'a> {
    probe: &'a Probe,
    directions: Directions,
    /// The solid angle of a texel of each row.
    solid: Vec<f64>,
}

impl Builder<'_> {
    fn texel(&self, x: usize, y: usize) -> Sums {
        let omega = self.solid[y];
        let texel = self.probe.rgb()[y * self.probe.width() + x].map(f64::from);
        // Black texels have a tiny weight, because a dark node needs a direction, too.
        let weight = omega * (texel.iter().sum::<f64>() + 1e-9);
        let direction = self.directions.at(4 * x + 2, 4 * y + 2);
        Sums { light: texel.map(|v| omega * v), mean: direction.map(|v| weight * v), total: weight }
    }
}

impl Sums {
    fn with(self, other: &Sums) -> Sums {
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        Sums {
            light: sum(self.light, other.light),
            mean: sum(self.mean, other.mean),
            total: self.total + other.total,
        }
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    dot(d, d).sqrt()
}

/// The half vector of a unit direction and the eye. For light from straight behind, some vector across the view.
pub(super) fn half(l: [f64; 3]) -> [f64; 3] {
    let h = [l[0], l[1], l[2] + 1.0];
    let length = dot(h, h).sqrt();
    if length < 1e-6 { [1.0, 0.0, 0.0] } else { h.map(|v| v / length) }
}
