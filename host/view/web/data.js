// What the page was written with, and how it is unpacked: bytes are deflated and in base64, weights are steps from the left
// neighbour, dots are the numbers of their stacks.

/**
 * @typedef {{ width: number, height: number, names: string[], curves: string, weights: string }} PackedLayer
 * @typedef {{ width: number, length: number, map: [number, number], names: string[], inks: string[][],
 *   colours: number[][], passes: { name: string, colour: number[] }[], bits: number[], curves: string, dots: string }} PackedDots
 * @typedef {{ name: string, about: string, size: [number, number], start: string, white: number, steps: number,
 *   metric: { angles: number[], radiance: number[], weight: number[] },
 *   edits: { fingerprint: string, replay: string, surfaces: import('./edit.js').Surface[] } | null,
 *   document: PackedLayer | null, mapped: PackedLayer | null, printed: PackedDots,
 *   difference: { width: number, height: number, most: number, bytes: string } | null,
 *   probe: { width: number, height: number, texels: string } }} Packed
 */

/**
 * Curves and the weight of each at every place; `levels` halve from one to the next, four weights a texel and group.
 * @typedef {{ width: number, height: number, data: Uint8Array }} Level
 * @typedef {{ names: string[], curves: Float32Array, channels: number, levels: Level[] }} Layer
 */

/** @param {string} text */
export async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** @param {string} text */
export async function unpackedFloats(text) {
  return new Float32Array((await unpacked(text)).buffer);
}

/**
 * What part `i` of `parts` covers of a side: places and shares, as in `Cover` of the renderer.
 * @param {number} i
 * @param {number} parts
 * @param {number} side
 * @returns {[number, number][]}
 */
function covered(i, parts, side) {
  const [from, to] = [(i * side) / parts, ((i + 1) * side) / parts];
  /** @type {[number, number][]} */
  const out = [];
  for (let place = Math.floor(from); place < Math.ceil(to - 1e-9); place++) {
    out.push([place, (Math.min(place + 1, to) - Math.max(place, from)) / (to - from)]);
  }
  return out;
}

/**
 * The whole pyramid above the first level.
 * @param {Level} first
 * @param {number} groups
 */
function pyramid(first, groups) {
  const levels = [first];
  for (let last = first; Math.max(last.width, last.height) > 1; last = levels[levels.length - 1]) {
    const [width, height] = [Math.max(last.width >> 1, 1), Math.max(last.height >> 1, 1)];
    const data = new Uint8Array(width * height * groups * 4);
    const across = Array.from({ length: width }, (_, x) => covered(x, width, last.width));
    for (let y = 0; y < height; y++) {
      const down = covered(y, height, last.height);
      for (let group = 0; group < groups; group++) {
        const from = group * last.width * last.height;
        for (let x = 0; x < width; x++) {
          let [r, g, b, a] = [0.5, 0.5, 0.5, 0.5];
          for (const [py, dy] of down) {
            for (const [px, dx] of across[x]) {
              const i = 4 * (from + py * last.width + px);
              const part = dx * dy;
              r += part * last.data[i];
              g += part * last.data[i + 1];
              b += part * last.data[i + 2];
              a += part * last.data[i + 3];
            }
          }
          const out = 4 * (group * width * height + y * width + x);
          data[out] = r;
          data[out + 1] = g;
          data[out + 2] = b;
          data[out + 3] = a;
        }
      }
    }
    levels.push({ width, height, data });
  }
  return levels;
}

/**
 * @param {PackedLayer} packed
 * @returns {Promise<Layer>}
 */
export async function layer(packed) {
  const { width, height, names } = packed;
  const [steps, curves] = await Promise.all([unpacked(packed.weights), unpackedFloats(packed.curves)]);
  const groups = Math.ceil(names.length / 4);
  const data = new Uint8Array(width * height * groups * 4);
  for (let channel = 0; channel < names.length; channel++) {
    const out = 4 * (channel >> 2) * width * height + (channel & 3);
    for (let y = 0; y < height; y++) {
      let weight = 0;
      for (let x = 0; x < width; x++) {
        const at = y * width + x;
        weight = (weight + steps[channel * width * height + at]) & 255;
        data[out + 4 * at] = weight;
      }
    }
  }
  return { names, curves, channels: names.length, levels: pyramid({ width, height, data }, groups) };
}

/**
 * The weights of stacks: at each place of the map the mean over exactly the dots it covers.
 * @param {PackedDots} packed
 * @param {Uint8Array} dots
 * @returns {Promise<Layer>}
 */
export async function stackWeights(packed, dots) {
  const { names, width: dotsAcross, length, map: [width, height] } = packed;
  const groups = Math.ceil(names.length / 4);
  const stride = groups * 4;
  const data = new Uint8Array(width * height * stride);
  // For each dot the place it begins in and how much of it lies there; the rest lies in the next one, where dots are finer
  // than places.
  const across = Array.from({ length: width }, (_, x) => covered(x, width, dotsAcross));
  const row = new Float32Array(width * stride);
  for (let y = 0; y < height; y++) {
    row.fill(0);
    for (const [py, down] of covered(y, height, length)) {
      const line = py * dotsAcross;
      for (let x = 0; x < width; x++) {
        for (const [px, part] of across[x]) row[x * stride + dots[line + px]] += down * part;
      }
    }
    for (let x = 0; x < width; x++) {
      for (let k = 0; k < names.length; k++) {
        const at = (k >> 2) * width * height + y * width + x;
        data[4 * at + (k & 3)] = 255 * row[x * stride + k] + 0.5;
      }
    }
  }
  const curves = await unpackedFloats(packed.curves);
  return { names, curves, channels: names.length, levels: pyramid({ width, height, data }, groups) };
}

/**
 * Dots cut into square tiles, one after the other, since a texture has a longest side.
 * @param {Uint8Array} dots
 * @param {number} width
 * @param {number} length
 * @param {number} tile
 */
export function tiles(dots, width, length, tile) {
  const [across, down] = [Math.ceil(width / tile), Math.ceil(length / tile)];
  const out = new Uint8Array(across * down * tile * tile);
  for (let y = 0; y < length; y++) {
    for (let i = 0; i < across; i++) {
      const part = dots.subarray(y * width + i * tile, y * width + Math.min((i + 1) * tile, width));
      out.set(part, ((Math.floor(y / tile) * across + i) * tile + (y % tile)) * tile);
    }
  }
  return { data: out, count: across * down };
}
