// The picture on the screen: what it shows, drawn once a frame at most and coarser while something moves, and the address that
// holds the view.

import { seen, windowHeight } from './geometry.js';
import { initial, SHOWS, written } from './state.js';

/** A frame that takes longer while something moves is drawn coarser, in milliseconds. */
const SLOW = 30;
/** How long the hand rests before the picture is drawn finely, in milliseconds. */
const REST = 140;
const MOST_COARSE = 6;

/** @type {<T extends HTMLElement>(id: string) => T} */
export const byId = (id) => {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return /** @type {any} */ (found);
};

export const data = /** @type {import('./data.js').Packed} */ (JSON.parse(byId('data').textContent ?? ''));
export const canvas = /** @type {HTMLCanvasElement} */ (byId('picture'));
export const stage = byId('stage');
export const available = SHOWS.filter((show) =>
  show === 'document' ? data.document : show === 'mapped' ? data.mapped : show === 'difference' ? data.difference
    : show === 'passes' ? data.printed.passes.length > 0 : true);
export const leastRadius = data.size[0] / Math.PI;
export const limits = { shows: available, passes: data.printed.passes.length, leastRadius, bases: data.edits ? data.edits.surfaces.length : 0 };

/** What the address holds. */
export const state = initial();
/** What the hand has chosen: the light, what dragging does, the basis to edit. */
export const held = { lamp: 0, tool: 'light', basis: 0 };
/**
 * What is drawn, once it is unpacked.
 * @type {{ drawing: import('./draw.js').Drawing | null, layers: Record<string, import('./data.js').Layer>, dots: Uint8Array }}
 */
export const drawn = { drawing: null, layers: {}, dots: new Uint8Array() };
/**
 * What is done before the picture is drawn, and after.
 * @type {{ before: (() => void)[], after: (() => void)[] }}
 */
export const eachFrame = { before: [], after: [] };

let asked = false;
let moving = false;
let coarse = 1;
let lastFrame = 0;
/** @type {number | undefined} */
let rest;

/** @param {boolean} inMotion */
export function redraw(inMotion) {
  moving = inMotion;
  stage.classList.add('changing');
  clearTimeout(rest);
  rest = setTimeout(() => {
    shareAddress();
    if (moving) redraw(false);
    else stage.classList.remove('changing');
  }, REST);
  if (!asked) {
    asked = true;
    requestAnimationFrame(frame);
  }
}

/** @param {number} now */
function frame(now) {
  asked = false;
  if (moving) {
    const took = now - lastFrame;
    if (took > SLOW && took < 1000) coarse = Math.min(coarse * 1.4, MOST_COARSE);
    else if (took < SLOW / 2) coarse = Math.max(coarse / 1.1, 1);
    lastFrame = now;
  }
  drawNow();
}

export function drawNow() {
  const { drawing } = drawn;
  if (!drawing) return;
  fit(moving ? coarse : 1);
  eachFrame.before.forEach((step) => step());
  drawing.draw(state, moving);
  eachFrame.after.forEach((step) => step());
}

/** @param {number} by how many times coarser than the screen */
function fit(by) {
  const ratio = Math.min(devicePixelRatio || 1, 2) / by;
  const [width, height] = [Math.max(Math.round(canvas.clientWidth * ratio), 1), Math.max(Math.round(canvas.clientHeight * ratio), 1)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
}

export function shareAddress() {
  const text = `#${written(state)}`;
  // A page from a disk may not be allowed to change its address.
  try {
    history.replaceState(null, '', text);
  } catch {
    location.hash = text;
  }
}

/** Metres of the sheet that a pixel of the picture shows. */
export function metresPerPixel() {
  return windowHeight(data.size, canvas.clientWidth / canvas.clientHeight) / state.zoom / canvas.clientHeight;
}

/** The sheet is never turned so far that its back would be seen. */
export function faceTheEye() {
  while (seen(state, data.size, 1, 1).towards[2] < 0.02) {
    state.turn *= 0.97;
    state.tip *= 0.97;
    if (Math.abs(state.turn) + Math.abs(state.tip) < 1) {
      state.view = [state.view[0] * 0.97, state.view[1] * 0.97];
    }
  }
}
