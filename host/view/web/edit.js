// Edits of the document's materials, shown at once and written as the steps that `foilpress edit --steps` replays. The
// arithmetic is that of `edit/surface.rs`: gloss is stretched along the tangent, tint and albedo multiply the base colour.

import { clamp } from './geometry.js';

/**
 * A basis as body (1/sr) and one lobe, and its base colour and metalness. `number` is that of the document.
 * @typedef {{ number: number, body: number[], f0: number[], alpha: number, base: number[], metallic: number }} Surface
 * @typedef {{ rougher: number, tint: string, albedo: number }} Edit
 * @typedef {Record<number, Edit>} Edits
 */

const WIDTHS = [0.02, 1];
const DIELECTRIC = 0.04;

/** @returns {Edit} */
export const unedited = () => ({ rougher: 1, tint: '#ffffff', albedo: 1 });

const isUnedited = (/** @type {Edit} */ { rougher, tint, albedo }) => rougher === 1 && tint === '#ffffff' && albedo === 1;

/** The bases that are edited, by their place on the page. @param {Edits} edits @returns {[number, Edit][]} */
export const chosen = (edits) =>
  Object.entries(edits).map(([k, edit]) => /** @type {[number, Edit]} */ ([Number(k), edit])).filter(([, edit]) => !isUnedited(edit));

const linearTint = (/** @type {string} */ tint) => [1, 3, 5].map((at) => {
  const v = Number.parseInt(tint.slice(at, at + 2), 16) / 255;
  return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
});

/** What a lobe of this width lets see of its slopes. @param {number} cos @param {number} alpha */
function visible(cos, alpha) {
  const c2 = Math.max(cos * cos, 1e-12);
  return 1 / Math.sqrt(1 + alpha * alpha * (Math.max(1 - c2, 0) / c2)) / cos ** 6;
}

/**
 * The table of a curve after an edit. Entries lie at equal chords between normal and half vector.
 * @param {Float32Array} table R G B for each entry
 * @param {Surface} surface
 * @param {Edit} edit
 * @param {number} last the largest half angle at which the curve is known, in radians
 */
export function edited(table, surface, edit, last) {
  if (isUnedited(edit)) return table;
  const entries = table.length / 3;
  const alpha = clamp(surface.alpha * edit.rougher, WIDTHS[0], WIDTHS[1]);
  const k = alpha / surface.alpha;
  const tint = linearTint(edit.tint);
  const lightest = Math.max(...surface.base.map((b, c) => b * tint[c]));
  const albedo = edit.albedo > 1 && lightest > 0 ? Math.min(edit.albedo, Math.max(1 / lightest, 1)) : edit.albedo;
  const own = DIELECTRIC * (1 - surface.metallic);
  const out = new Float32Array(table.length);
  for (let n = 0; n < entries; n++) {
    const theta = 2 * Math.asin(Math.min(Math.SQRT1_2 * (n / (entries - 1)), 1));
    // Beyond its last sample a curve stays as it is there, so it is edited there.
    const tan = Math.tan(Math.min(theta, last)) / k;
    const read = Math.atan(tan);
    const from = Math.min(read, last);
    const x = Math.min(Math.SQRT2 * Math.sin(from / 2), 1) * (entries - 1);
    const i = Math.min(Math.floor(x), entries - 2);
    const fall = read > last ? (Math.tan(last) / tan) ** 4 : 1;
    const factor = k === 1 ? 1
      : (fall * visible(Math.cos(Math.min(theta, last)), alpha)) / visible(Math.cos(from), surface.alpha) / (k * k);
    for (let c = 0; c < 3; c++) {
      const f = table[3 * i + c] + (x - i) * (table[3 * i + 3 + c] - table[3 * i + c]);
      const gloss = Math.max(f - surface.body[c], 0) * factor;
      // Where there is less than the body, all of it is body.
      const body = Math.min(table[3 * n + c], surface.body[c]);
      const white = surface.f0[c] > own ? own / surface.f0[c] : 1;
      out[3 * n + c] = tint[c] * albedo * (body + (1 - white) * gloss) + white * gloss;
    }
  }
  return out;
}

/**
 * The step file, or nothing where nothing is edited.
 * @param {string} name of the document
 * @param {string} fingerprint
 * @param {Surface[]} surfaces
 * @param {Edits} edits
 */
export function steps(name, fingerprint, surfaces, edits) {
  const lines = chosen(edits).map(([k, { rougher, tint, albedo }]) => [
    '', '[[step]]', `basis = ${surfaces[k].number}`, ...(rougher === 1 ? [] : [`rougher = ${decimal(rougher)}`]),
    ...(tint === '#ffffff' ? [] : [`tint = "${tint}"`]), ...(albedo === 1 ? [] : [`albedo = ${decimal(albedo)}`]),
  ].join('\n'));
  // A JSON string is a TOML string once control characters are gone.
  const title = JSON.stringify(name.replace(/\p{Cc}/gu, ' '));
  return lines.length ? `format = 1\ndocument = ${title}\nfingerprint = "${fingerprint}"\n${lines.join('\n')}\n` : '';
}

const decimal = (/** @type {number} */ v) => (Number.isInteger(v) ? v.toFixed(1) : String(v));

/** @param {Edits} edits */
export const editsWritten = (edits) =>
  chosen(edits).map(([k, { rougher, tint, albedo }]) => `${k},${rougher},${tint.slice(1)},${albedo}`).join(';');

/**
 * Reads what `editsWritten` wrote; parts that are not understood are left out.
 * @param {string} text
 * @param {number} count of bases
 * @returns {Edits}
 */
export function editsRead(text, count) {
  /** @type {Edits} */
  const edits = {};
  for (const part of text.split(';')) {
    const [k, rougher, tint, albedo] = part.split(',');
    const numbers = [k, rougher, albedo].map((v) => (v?.trim() ? Number(v) : NaN));
    if (!numbers.every(Number.isFinite) || !/^[0-9a-f]{6}$/.test(tint) || !Number.isInteger(numbers[0])) continue;
    if (numbers[0] < 0 || numbers[0] >= count) continue;
    edits[numbers[0]] = { rougher: clamp(numbers[1], 0.125, 8), tint: `#${tint}`, albedo: clamp(numbers[2], 0, 4) };
  }
  return edits;
}
