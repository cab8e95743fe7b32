// A sheet under a light probe, as in `surroundings.rs`: the panorama is a tree, its light is gathered at the nodes of a grid
// over the sheet into the entries of a table of the half angle, and the product with each curve is what that curve sends to
// the eye.

import { axes, direction, intoSheet, plus, scaled, unit } from './geometry.js';

/** @typedef {import('./geometry.js').Vector} Vector */
/** @typedef {{ towards: Vector, light: Vector, reach: number, next: number }} Node */

const OPENING = 0.15;
const HORIZON = 0.1;
/** Entries of the table that light is gathered in. */
const BINS = 256;

/**
 * @param {number} width
 * @param {number} height
 * @param {Float32Array} texels
 */
export function tree(width, height, texels) {
  /** @type {Node[]} */
  const nodes = [];
  const towardsOf = (/** @type {number} */ u, /** @type {number} */ v) => {
    const [phi, t] = [2 * Math.PI * u, Math.PI * v];
    return /** @type {Vector} */ ([Math.sin(phi) * Math.sin(t), Math.cos(t), -Math.cos(phi) * Math.sin(t)]);
  };
  /** @type {(x: [number, number], y: [number, number]) => void} */
  const add = (x, y) => {
    /** @type {Vector} */
    let mean = [0, 0, 0];
    /** @type {Vector} */
    let light = [0, 0, 0];
    let total = 0;
    for (let row = y[0]; row < y[1]; row++) {
      const omega =
        ((Math.cos((Math.PI * row) / height) - Math.cos((Math.PI * (row + 1)) / height)) * 2 * Math.PI) / width;
      for (let column = x[0]; column < x[1]; column++) {
        const i = 3 * (row * width + column);
        /** @type {Vector} */
        const texel = [texels[i], texels[i + 1], texels[i + 2]];
        const weight = omega * (texel[0] + texel[1] + texel[2] + 1e-9);
        mean = plus(mean, scaled(towardsOf((column + 0.5) / width, (row + 0.5) / height), weight));
        light = plus(light, scaled(texel, omega));
        total += weight;
      }
    }
    const length = Math.hypot(...mean);
    /** @type {Vector} */
    const towards = length > 1e-12 * total ? scaled(mean, 1 / length) : [0, 1, 0];
    const single = x[1] - x[0] === 1 && y[1] - y[0] === 1;
    let reach = 0;
    if (!single && length < 0.3 * total) reach = 2;
    else if (!single) {
      for (let n = 0; n < 25; n++) {
        const u = (x[0] + ((x[1] - x[0]) * (n % 5)) / 4) / width;
        const v = (y[0] + ((y[1] - y[0]) * Math.floor(n / 5)) / 4) / height;
        reach = Math.max(reach, Math.hypot(...plus(towardsOf(u, v), scaled(towards, -1))));
      }
    }
    const here = nodes.push({ towards, light, reach, next: 0 }) - 1;
    if (!single) {
      if (x[1] - x[0] >= y[1] - y[0]) {
        const m = x[0] + ((x[1] - x[0]) >> 1);
        add([x[0], m], y);
        add([m, x[1]], y);
      } else {
        const m = y[0] + ((y[1] - y[0]) >> 1);
        add(x, [y[0], m]);
        add(x, [m, y[1]]);
      }
    }
    nodes[here].next = nodes.length;
  };
  add([0, width], [0, height]);
  return nodes;
}

/**
 * Bins lie densely where lobes are steep: at chord = sqrt 2 (i / (BINS - 1))^2.
 * @param {Node[]} nodes
 * @param {Vector} n
 * @param {Vector} view
 * @param {Float32Array} light
 */
function gather(nodes, n, view, light) {
  light.fill(0);
  let i = 0;
  while (i < nodes.length) {
    const { towards: l, light: sent, reach, next } = nodes[i];
    const cos = n[0] * l[0] + n[1] * l[1] + n[2] * l[2];
    if (cos <= -reach) {
      i = next;
      continue;
    }
    const h0 = l[0] + view[0];
    const h1 = l[1] + view[1];
    const h2 = l[2] + view[2];
    const length = Math.max(Math.sqrt(h0 * h0 + h1 * h1 + h2 * h2), 1e-6);
    const [d0, d1, d2] = [h0 / length - n[0], h1 / length - n[1], h2 / length - n[2]];
    const chord = Math.sqrt(d0 * d0 + d1 * d1 + d2 * d2);
    if (reach > 0 && !((cos > reach || reach < HORIZON) && reach <= OPENING * chord * length)) {
      i++;
      continue;
    }
    if (cos > 0) {
      const at = Math.min(Math.sqrt(chord * Math.SQRT1_2) * (BINS - 1), BINS - 1.001);
      const k = Math.floor(at);
      const [near, far] = [cos * (1 - at + k), cos * (at - k)];
      for (let c = 0; c < 3; c++) {
        light[3 * k + c] += near * sent[c];
        light[3 * k + 3 + c] += far * sent[c];
      }
    }
    i = next;
  }
}

/**
 * What each curve sends to the eye at `side` x `side` nodes of the sheet: R G B 1 for each node and curve.
 * @param {Node[]} world
 * @param {import('./state.js').State} state
 * @param {[number, number]} size
 * @param {Float32Array} curves
 * @param {number} steps
 * @param {number} side
 */
export function field(world, state, size, curves, steps, side) {
  const frame = axes(state.turn, state.tip);
  const nodes = world.map((node) => ({ ...node, towards: intoSheet(frame, node.towards) }));
  const towards = intoSheet(frame, direction(...state.view));
  const count = curves.length / steps / 3;
  // The curves at the bins.
  const tables = new Float32Array(count * BINS * 3);
  for (let k = 0; k < count; k++) {
    for (let i = 0; i < BINS; i++) {
      const x = (i / (BINS - 1)) ** 2 * (steps - 1);
      const low = Math.min(Math.floor(x), steps - 2);
      for (let c = 0; c < 3; c++) {
        const from = 3 * (k * steps + low) + c;
        tables[3 * (k * BINS + i) + c] = curves[from] + (x - low) * (curves[from + 3] - curves[from]);
      }
    }
  }
  const out = new Float32Array(side * side * count * 4);
  const light = new Float32Array(3 * BINS);
  for (let j = 0; j < side; j++) {
    for (let i = 0; i < side; i++) {
      const [s, y] = [(i / (side - 1) - 0.5) * size[0], (0.5 - j / (side - 1)) * size[1]];
      const r = state.curl;
      /** @type {Vector} */
      const n = r > 0 ? [Math.sin(s / r), 0, Math.cos(s / r)] : [0, 0, 1];
      /** @type {Vector} */
      const at = r > 0 ? [r * n[0], y, r * (n[2] - 1)] : [s, y, 0];
      const view = state.distance > 0 ? unit(plus(scaled(towards, state.distance), scaled(at, -1))) : towards;
      gather(nodes, n, view, light);
      for (let k = 0; k < count; k++) {
        const to = 4 * ((k * side + j) * side + i);
        for (let c = 0; c < 3; c++) {
          let sum = 0;
          const from = 3 * k * BINS + c;
          for (let b = 0; b < 3 * BINS; b += 3) sum += light[b + c] * tables[from + b];
          out[to + c] = sum;
        }
        out[to + 3] = 1;
      }
    }
  }
  return out;
}
