//! The light that pixels send to the eye.
//!
//! Problem: each pixel mixes all curves at its own half angle, for each light.
//! Method: all curves lie in one table over the half angle, entry by entry ([`Fine`]), so a light costs one lookup and one
//! product of weights and entries: `L = sum_k w_k f_k(theta_h) E cos_i`. Angles are found in lanes over the pixels of a block,
//! products in lanes over the curves. What the lanes hold is summed once, after all lights ([`Sums`]).
//! Cost: two entries of the table for each pixel and light. Limits: one bounce and no shadows.

use press::preview::{ENTRIES, Fine};

use crate::footprint::Weights;
use crate::lit::{LANES, Lit};
use crate::ray::{BLOCK, Hits, V, Values, dot, greater, minus};
use crate::scene::{Frame, Light, unit};

/// The curves of a sheet in one table.
pub(crate) struct Curves {
    pub fine: Fine,
    /// For each entry the three channels, each with a value for every curve.
    table: Vec<[f32; LANES]>,
    /// Groups of lanes of a channel.
    groups: usize,
}

/// A light in the axes of the sheet.
pub(crate) enum Lamp {
    /// Its unit direction.
    Far(V),
    /// Its place, and the square of its distance from the origin.
    Near(V, f32),
}

/// How a light falls on the pixels of a block.
pub(crate) struct Lighting {
    /// `E cos_i`, 0 where the light does not reach or the sheet covers nothing.
    irradiance: Values,
    /// The chord between the normal and the half vector.
    chord: Values,
}

/// What the pixels of a block send to the eye in three channels, still apart by curves.
pub(crate) struct Sums {
    pub lanes: Vec<[[f32; LANES]; 3]>,
}

impl Curves {
    /// Reads the curves.
    pub fn new(lit: &Lit) -> Curves {
        let fine = Fine::new();
        let groups = lit.stride / LANES;
        let mut table = vec![[0.0; LANES]; ENTRIES * 3 * groups];
        for (k, curve) in lit.curves.iter().enumerate() {
            for (entry, rgb) in fine.table(curve).into_iter().enumerate() {
                for (c, f) in rgb.into_iter().enumerate() {
                    table[(entry * 3 + c) * groups + k / LANES][k % LANES] = f;
                }
            }
        }
        Curves { fine, table, groups }
    }

    /// For each channel and curve, the product of light on every entry with the curve.
    pub fn product(&self, light: &[[f32; 3]]) -> Vec<[f32; LANES]> {
        let groups = self.groups;
        let mut out = vec![[0.0; LANES]; 3 * groups];
        for (light, entry) in light.iter().zip(self.table.chunks_exact(3 * groups)) {
            if *light != [0.0; 3] {
                let channels = out.chunks_exact_mut(groups).zip(entry.chunks_exact(groups));
                for (c, (out, f)) in channels.enumerate() {
                    let (out, f) = (out.as_flattened_mut().iter_mut(), f.as_flattened());
                    out.zip(f).for_each(|(out, &f)| *out += light[c] * f);
                }
            }
        }
        out
    }

    /// Adds the light of a lamp that pixels with these weights send to the eye.
    #[inline(always)]
    pub fn shade(&self, lighting: &Lighting, weights: &Weights, sums: &mut Sums) {
        let groups = self.groups;
        let weights = weights.values.chunks_exact(groups);
        for (i, (light, weights)) in sums.lanes.iter_mut().zip(weights).enumerate() {
            let irradiance = lighting.irradiance[i];
            if irradiance > 0.0 {
                let (entry, s) = self.fine.at(lighting.chord[i]);
                let near = &self.table[entry * 3 * groups..][..6 * groups];
                let (near, far) = near.split_at(3 * groups);
                for (c, light) in light.iter_mut().enumerate() {
                    let (near, far) = (&near[c * groups..][..groups], &far[c * groups..][..groups]);
                    let mut sum = *light;
                    for ((w, near), far) in weights.iter().zip(near).zip(far) {
                        for l in 0..LANES {
                            sum[l] += irradiance * w[l] * (near[l] + s * (far[l] - near[l]));
                        }
                    }
                    *light = sum;
                }
            }
        }
    }
}

impl Lamp {
    /// Brings a light into the axes of the sheet.
    pub fn new(light: &Light, frame: &Frame) -> Lamp {
        let f32s = |v: [f64; 3]| frame.in_sheet(v).map(|c| c as f32);
        match *light {
            Light::Far(v) => Lamp::Far(f32s(unit(v))),
            Light::Near(at) => Lamp::Near(f32s(at), dot(f32s(at), f32s(at))),
        }
    }
}

impl Default for Lighting {
    fn default() -> Lighting {
        Lighting { irradiance: [0.0; BLOCK], chord: [0.0; BLOCK] }
    }
}

impl Default for Sums {
    fn default() -> Sums {
        Sums { lanes: vec![[[0.0; LANES]; 3]; BLOCK] }
    }
}

impl Sums {
    /// Writes the sums of all lanes to pixels, as far as each is covered.
    #[inline(always)]
    pub fn finish(&self, covered: &Values, out: &mut [[f32; 4]]) {
        for ((out, lanes), &covered) in out.iter_mut().zip(&self.lanes).zip(covered) {
            // Half by half, which the compiler does in fewer steps than one after the other.
            let [r, g, b] = lanes.map(|[a, b, c, d, e, f, g, h]| ((a + e) + (c + g)) + ((b + f) + (d + h)));
            *out = [r * covered, g * covered, b * covered, covered];
        }
    }
}

impl Lighting {
    /// Finds how a light falls on all pixels of a block.
    #[inline(always)]
    pub fn fall(&mut self, lamp: &Lamp, hits: &Hits) {
        match *lamp {
            Lamp::Far(towards) => self.fall_from(hits, |_| (towards, 1.0)),
            Lamp::Near(lamp, square) => self.fall_from(hits, |at| {
                let to = minus(lamp, at);
                let inverse = 1.0 / dot(to, to).sqrt();
                (to.map(|c| c * inverse), square * inverse * inverse)
            }),
        }
    }

    /// `lamp` is the unit direction to the light from a point of the sheet, and what distance leaves of it there.
    #[inline(always)]
    fn fall_from(&mut self, hits: &Hits, lamp: impl Fn(V) -> (V, f32)) {
        for i in 0..BLOCK {
            let (l, left) = lamp([hits.at[0][i], hits.at[1][i], hits.at[2][i]]);
            let n = [hits.normal[0][i], 0.0, hits.normal[1][i]];
            let cos = n[0] * l[0] + n[2] * l[2];
            let h = [l[0] + hits.view[0][i], l[1] + hits.view[1][i], l[2] + hits.view[2][i]];
            let inverse = 1.0 / greater(dot(h, h).sqrt(), 1e-12);
            let d = [h[0] * inverse - n[0], h[1] * inverse - n[1], h[2] * inverse - n[2]];
            self.chord[i] = dot(d, d).sqrt();
            self.irradiance[i] = if (hits.covered[i] > 0.0) & (cos > 0.0) { left * cos } else { 0.0 };
        }
    }
}
