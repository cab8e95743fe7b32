// The picture on the screen: what it shows, drawn once a frame at most and coarser while something moves, and the address that
// holds the view.

import { clamp, seen, windowHeight } from './geometry.js';
import { initial, SHOWS, written } from './state.js';

/** A frame that takes longer while something moves is drawn coarser, in milliseconds. */
const SLOW = 30;
/** How long the hand rests after a frame before the picture is drawn finely, in milliseconds. */
const REST = 140;
const MOST_COARSE = 10;

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
 * What is done before the picture is drawn, and after; each is told whether something moves.
 * @type {Record<'before' | 'after', ((motion: boolean) => void)[]>}
 */
export const eachFrame = { before: [], after: [] };

/** Whether something changed since the last frame was begun. */
let stale = false;
/** Whether a frame is asked for or still being drawn: the next one waits for it, so that none queue up. */
let busy = false;
let moving = false;
let coarse = 1;
/** How long the last fine frame took. */
let fine = 0;
/** @type {number | undefined} */
let rest;
let resting = 0;

/** @param {boolean} inMotion */
export function redraw(inMotion) {
  if (inMotion && !moving) coarse = clamp(Math.sqrt(fine / SLOW), 1, MOST_COARSE);
  moving = inMotion;
  stale = true;
  stage.classList.add('changing');
  clearTimeout(rest);
  cancelAnimationFrame(resting);
  if (!busy) next();
}

function next() {
  busy = true;
  requestAnimationFrame(async () => {
    stale = false;
    const motion = moving;
    const took = await draw(motion);
    busy = false;
    // One frame knows how coarse the next has to be: time goes with the number of pixels.
    if (!motion) fine = took;
    else if (took > SLOW) coarse = Math.min(coarse * Math.max(Math.sqrt(took / SLOW), 1.1), MOST_COARSE);
    else if (took < SLOW / 2) coarse = Math.max(coarse / 1.1, 1);
    if (stale) next();
    else rest = setTimeout(settle, REST);
  });
}

/** What the hand did during a slow frame is told right before the next one, so it rests only if nothing is told then. */
function settle() {
  resting = requestAnimationFrame(() => {
    shareAddress();
    if (moving) redraw(false);
    else stage.classList.remove('changing');
  });
}

/**
 * @param {boolean} motion
 * @returns {Promise<number>} how long it took, in milliseconds
 */
async function draw(motion) {
  const { drawing } = drawn;
  if (!drawing) return 0;
  const begun = performance.now();
  fit(motion ? coarse : 1);
  eachFrame.before.forEach((step) => step(motion));
  drawing.draw(state, motion);
  eachFrame.after.forEach((step) => step(motion));
  await drawing.done();
  return performance.now() - begun;
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

/**
 * The sheet is never turned so far that its back would be seen.
 * @param {number} least of the cosine between the sheet's normal and the eye; an address may go as far as the program does
 */
export function faceTheEye(least = 0.02) {
  while (seen(state, data.size, 1, 1).towards[2] < least) {
    state.turn *= 0.97;
    state.tip *= 0.97;
    if (Math.abs(state.turn) + Math.abs(state.tip) < 1) {
      state.view = [state.view[0] * 0.97, state.view[1] * 0.97];
    }
  }
}
