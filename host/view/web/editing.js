// The sliders that edit the document's materials, and the steps that they write.

import { answer, slider, sync, synced } from './controls.js';
import { edited, editsWritten, steps, unedited } from './edit.js';
import { clamp } from './geometry.js';
import { element } from './spot.js';
import { byId, data, drawn, eachFrame, held, redraw, state } from './stage.js';

let applied = '';
/** The curves as they were. @type {Float32Array} */
let original = new Float32Array();

/** Brings the curves of the document in line with the edits. */
function applyEdits() {
  const shown = drawn.layers.document;
  const wanted = editsWritten(state.edits);
  if (!shown || !data.edits || wanted === applied) return;
  applied = wanted;
  if (!original.length) original = shown.curves.slice();
  const { surfaces } = data.edits;
  const last = data.metric.angles[data.metric.angles.length - 1];
  const size = 3 * data.steps;
  surfaces.forEach((surface, k) => {
    const table = original.subarray(k * size, (k + 1) * size);
    shown.curves.set(edited(table, surface, state.edits[k] ?? unedited(), last), k * size);
  });
  drawn.drawing?.recurve('document');
}

/** Linear shares of light as sRGB bytes. @param {number[]} base */
const coded = (base) => base.map((v) => Math.round(255 * clamp(v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055, 0, 1)));

const editOf = () => (state.edits[held.basis] ??= unedited());

export function buildEdits() {
  if (!data.edits || !data.document) return;
  const { replay, surfaces } = data.edits;
  byId('replay').textContent = replay;
  const which = /** @type {HTMLSelectElement} */ (byId('basis'));
  which.append(...surfaces.map(({ number }, k) => element('option', { value: k }, `basis ${number}`)));
  which.addEventListener('change', () => {
    held.basis = Number(which.value);
    sync();
  });
  const into = byId('sliders-edits');
  const isShown = () => [state.show, state.with].includes('document');
  const times = (/** @type {number} */ v) => `× ${v.toFixed(2)}`;
  const set = (/** @type {'rougher' | 'albedo'} */ what) => (/** @type {number} */ v) => (editOf()[what] = v);
  slider(into, 'rougher', {
    min: -3, max: 3, step: 0.05, shown: isShown, get: () => Math.log2(editOf().rougher),
    set: (v) => set('rougher')(Number((2 ** v).toFixed(3))), words: () => times(editOf().rougher),
  });
  slider(into, 'albedo', { min: 0, max: 4, step: 0.05, shown: isShown, get: () => editOf().albedo, set: set('albedo'), words: times });
  const tint = /** @type {HTMLInputElement} */ (byId('tint'));
  tint.addEventListener('input', () => {
    editOf().tint = tint.value;
    sync();
    redraw(true);
  });
  const text = /** @type {HTMLTextAreaElement} */ (byId('steps'));
  byId('copySteps').addEventListener('click', async () => {
    text.select();
    try {
      await navigator.clipboard.writeText(text.value);
      answer(byId('copySteps'), 'Copied');
    } catch {
      answer(byId('copySteps'), 'Selected; copy it');
    }
  });
  byId('unedit').addEventListener('click', () => {
    state.edits = {};
    sync();
    redraw(false);
  });
  synced.push(() => {
    byId('edits').hidden = !isShown();
    which.value = String(held.basis);
    byId('basisColour').style.backgroundColor = `rgb(${coded(surfaces[held.basis].base).join(' ')})`;
    tint.value = editOf().tint;
    text.value = data.edits ? steps(data.name, data.edits.fingerprint, data.edits.surfaces, state.edits) : '';
    byId('stepFile').hidden = !text.value;
  });
}

eachFrame.before.push(applyEdits);
