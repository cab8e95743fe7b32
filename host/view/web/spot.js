// A spot of the sheet: its curve in the document and in the print, the distance d between the two, the stacks there and the
// inks of the dot itself.

/**
 * @typedef {import('./data.js').Layer} Layer
 * @typedef {{ name: string, share: number }} Share
 */

/** Side of the square that counts as a spot, in metres: some cells of the halftone. */
export const SPOT = 0.0008;

const SVG = 'http://www.w3.org/2000/svg';

/**
 * Mean weights of a layer over a square around a place (metres from the middle).
 * @param {Layer} layer
 * @param {[number, number]} place
 * @param {[number, number]} size
 */
export function weightsAt(layer, place, size) {
  const [{ width, height, data }] = layer.levels;
  /** @type {(at: number, count: number, side: number) => [number, number]} */
  const range = (at, count, side) => {
    const half = (SPOT / 2 / side) * count;
    const low = Math.min(Math.max(Math.floor(at * count - half + 0.5), 0), count - 1);
    return [low, Math.min(Math.max(Math.ceil(at * count + half - 0.5), low + 1), count)];
  };
  const [x0, x1] = range(place[0] / size[0] + 0.5, width, size[0]);
  const [y0, y1] = range(0.5 - place[1] / size[1], height, size[1]);
  const sums = new Float64Array(layer.channels);
  for (let y = y0; y < y1; y++) {
    for (let x = x0; x < x1; x++) {
      for (let k = 0; k < sums.length; k++) sums[k] += data[4 * ((k >> 2) * width * height + y * width + x) + (k & 3)];
    }
  }
  const total = sums.reduce((a, b) => a + b, 0) || 1;
  return sums.map((v) => v / total);
}

/**
 * Reflectance (1/sr) of a mixture at a half angle (radians), R G B.
 * @param {Layer} layer
 * @param {Float64Array} weights
 * @param {number} theta
 * @param {number} steps
 */
export function reflectance(layer, weights, theta, steps) {
  const x = Math.min(Math.SQRT2 * Math.sin(theta / 2), 1) * (steps - 1);
  const i = Math.min(Math.floor(x), steps - 2);
  const out = [0, 0, 0];
  weights.forEach((w, k) => {
    if (w > 0) {
      for (let c = 0; c < 3; c++) {
        const at = 3 * (k * steps + i) + c;
        out[c] += w * (layer.curves[at] + (x - i) * (layer.curves[at + 3] - layer.curves[at]));
      }
    }
  });
  return out;
}

/**
 * The distance d of the metric between two mixtures.
 * @param {import('./data.js').Packed} data
 * @param {(theta: number) => number[]} a
 * @param {(theta: number) => number[]} b
 */
export function distance({ metric: { angles, radiance, weight } }, a, b) {
  let sum = 0;
  angles.forEach((theta, n) => {
    const [one, two] = [a(theta), b(theta)];
    for (let c = 0; c < 3; c++) {
      sum += (weight[n] * (Math.cbrt(one[c] * radiance[n]) - Math.cbrt(two[c] * radiance[n]))) ** 2;
    }
  });
  return Math.sqrt(sum);
}

/** @param {number} d */
export const inWords = (d) => (d < 0.01 ? 'not visible' : d < 0.02 ? 'barely visible' : d < 0.05 ? 'visible' : 'obvious');

/**
 * Shares in whole per cents, largest first; those below a half are left out.
 * @param {Layer} layer
 * @param {Float64Array} weights
 * @returns {Share[]}
 */
export const shares = (layer, weights) =>
  [...weights].map((share, k) => ({ name: layer.names[k], share, k }))
    .filter(({ share }) => share >= 0.005).sort((a, b) => b.share - a.share);

/**
 * An element with attributes and children, which are text unless they are elements.
 * @param {string} name
 * @param {Record<string, string | number>} attributes
 * @param {(Node | string)[]} children
 */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}

/**
 * Brightness over the half angle, logarithmic: how strong and how sharp a highlight is.
 * @param {{ name: string, at: (theta: number) => number[] }[]} lines
 */
export function chart(lines) {
  const [width, height, left, bottom] = [300, 150, 34, 20];
  const most = (70 * Math.PI) / 180;
  const luminance = (/** @type {number[]} */ [r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const points = lines.map(({ name, at }) => ({
    name,
    values: Array.from({ length: 141 }, (_, i) => Math.max(luminance(at((most * i) / 140)), 1e-4)),
  }));
  const all = points.flatMap(({ values }) => values);
  const low = Math.floor(Math.log10(Math.min(...all)));
  const high = Math.max(Math.ceil(Math.log10(Math.max(...all))), low + 1);
  const y = (/** @type {number} */ v) => (height - bottom) * (1 - (Math.log10(v) - low) / (high - low)) + 6;
  const svg = document.createElementNS(SVG, 'svg');
  svg.setAttribute('viewBox', `0 0 ${width} ${height + 8}`);
  svg.setAttribute('role', 'img');
  svg.setAttribute('aria-label', 'Reflectance over the half angle');
  /** @type {(name: string, attributes: Record<string, string | number>, text?: string) => void} */
  const add = (name, attributes, text = '') => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
    made.textContent = text;
    svg.append(made);
  };
  for (let power = low; power <= high; power++) {
    add('line', { class: 'grid', x1: left, x2: width, y1: y(10 ** power), y2: y(10 ** power) });
    add('text', { x: left - 5, y: y(10 ** power) + 3, 'text-anchor': 'end' }, power > 3 ? `1e${power}` : String(10 ** power));
  }
  for (let degrees = 0; degrees <= 60; degrees += 20) {
    const x = left + ((width - left) * degrees) / 70;
    add('text', { x, y: height + 4, 'text-anchor': 'middle' }, `${degrees}°`);
  }
  for (const { name, values } of points) {
    const d = values.map((v, i) => `${i ? 'L' : 'M'}${(left + ((width - left) * i) / 140).toFixed(1)} ${y(v).toFixed(1)}`);
    add('path', { class: name, d: d.join('') });
  }
  return svg;
}
