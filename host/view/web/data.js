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
  // A callback for each of ten million bytes takes half a second.
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** @param {string} text */
export async function unpackedFloats(text) {
  return new Float32Array((await unpacked(text)).buffer);
}

/**
 * What each of `parts` covers of a side, as in `Cover` of the renderer: part `i` has the places and shares from `first[i]` up to
 * `first[i + 1]`.
 * @param {number} parts
 * @param {number} side
 */
function covers(parts, side) {
  const first = new Int32Array(parts + 1);
  /** @type {number[]} */
  const places = [];
  /** @type {number[]} */
  const shares = [];
  for (let i = 0; i < parts; i++) {
    const [from, to] = [(i * side) / parts, ((i + 1) * side) / parts];
    for (let place = Math.floor(from); place < Math.ceil(to - 1e-9); place++) {
      places.push(place);
      shares.push((Math.min(place + 1, to) - Math.max(place, from)) / (to - from));
    }
    first[i + 1] = places.length;
  }
  return { first, places: Int32Array.from(places), shares: Float64Array.from(shares) };
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
    const [across, down] = [covers(width, last.width), covers(height, last.height)];
    for (let y = 0; y < height; y++) {
      for (let group = 0; group < groups; group++) {
        const from = group * last.width * last.height;
        for (let x = 0; x < width; x++) {
          let [r, g, b, a] = [0.5, 0.5, 0.5, 0.5];
          for (let j = down.first[y]; j < down.first[y + 1]; j++) {
            const row = from + down.places[j] * last.width;
            for (let k = across.first[x]; k < across.first[x + 1]; k++) {
              const i = 4 * (row + across.places[k]);
              const part = across.shares[k] * down.shares[j];
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
  const [across, down] = [covers(width, dotsAcross), covers(height, length)];
  const row = new Float32Array(width * stride);
  for (let y = 0; y < height; y++) {
    row.fill(0);
    for (let j = down.first[y]; j < down.first[y + 1]; j++) {
      const line = down.places[j] * dotsAcross;
      for (let x = 0; x < width; x++) {
        for (let k = across.first[x]; k < across.first[x + 1]; k++) {
          row[x * stride + dots[line + across.places[k]]] += down.shares[j] * across.shares[k];
        }
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
