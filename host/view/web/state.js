// Everything a visitor can change, and how it is written in the address, so that a view can be shared.

import { editsRead, editsWritten } from './edit.js';
import { clamp } from './geometry.js';

/**
 * Angles in degrees, lengths in metres; a distance or radius of 0 is far away or flat.
 * @typedef {{ azimuth: number, elevation: number, distance: number }} Lamp
 * @typedef {{ show: string, with: string, split: number, pass: number, lights: Lamp[], probe: boolean,
 *   view: [number, number], distance: number, turn: number, tip: number, curl: number,
 *   zoom: number, pan: [number, number], exposure: number, knee: number, edits: import('./edit.js').Edits }} State
 */

export const MOST_LIGHTS = 4;
export const MOST_ZOOM = 400;
/** Beyond what `--exposure` takes: a panorama in other units may need more, and the program chooses it. */
const MOST_STOPS = 40;
/** Eye and lights come no nearer, in metres. These limits and those of angles are the program's. */
const NEAREST = 0.01;
/** What can be shown, and its name. @type {Record<string, string>} */
export const TITLES = {
  document: 'Document', mapped: 'Mapped', printed: 'Print', difference: 'Difference', stacks: 'Stacks', passes: 'Passes',
};
export const SHOWS = Object.keys(TITLES);

/** @returns {State} */
export const initial = () => ({
  show: 'printed', with: '', split: 0.5, pass: 0, lights: [{ azimuth: -25, elevation: 30, distance: 0.6 }],
  probe: false, view: [0, 0], distance: 0.5, turn: 0, tip: 0, curl: 0, zoom: 1, pan: [0, 0], exposure: 0, knee: 0.4, edits: {},
});

const rounded = (/** @type {number} */ v, digits = 2) => String(Number(v.toFixed(digits)));

/**
 * @param {State} s
 * @returns {string}
 */
export function written(s) {
  const lights = s.lights.map((l) => [l.azimuth, l.elevation, l.distance].map((v) => rounded(v)).join(','));
  const parts = [['show', s.show]];
  if (s.with) parts.push(['with', s.with], ['split', rounded(s.split, 3)]);
  if (s.show === 'passes' || s.with === 'passes') parts.push(['pass', String(s.pass)]);
  parts.push(
    ['light', lights.join(';')], ['probe', s.probe ? '1' : '0'], ['view', s.view.map((v) => rounded(v)).join(',')],
    ['distance', rounded(s.distance, 3)], ['tilt', `${rounded(s.turn)},${rounded(s.tip)}`], ['curl', rounded(s.curl, 4)],
    ['zoom', rounded(s.zoom, 3)], ['pan', s.pan.map((v) => rounded(v, 5)).join(',')], ['exposure', rounded(s.exposure)],
    ['knee', rounded(s.knee)],
  );
  const edits = editsWritten(s.edits);
  if (edits) parts.push(['edit', edits]);
  return parts.map(([key, value]) => `${key}=${value}`).join('&');
}

/**
 * Reads a fragment over a state. What is not understood is left as it was: addresses are typed and cut off by hand.
 * @param {string} text
 * @param {State} state
 * @param {{ shows: string[], passes: number, leastRadius: number, bases: number }} limits
 */
export function read(text, state, limits) {
  const given = new URLSearchParams(text.replace(/^#/, ''));
  /** @type {(key: string, count: number) => number[] | null} */
  const numbers = (key, count) => {
    const values = (given.get(key) ?? '').split(',').map((v) => (v.trim() === '' ? NaN : Number(v)));
    return values.length === count && values.every(Number.isFinite) ? values : null;
  };
  /** @type {(key: string, low: number, high: number, old: number) => number} */
  const one = (key, low, high, old) => {
    const value = numbers(key, 1);
    return value ? clamp(value[0], low, high) : old;
  };
  const show = given.get('show');
  if (show && limits.shows.includes(show)) {
    state.show = show;
    const other = given.get('with') ?? '';
    state.with = limits.shows.includes(other) ? other : '';
  }
  state.split = one('split', 0, 1, state.split);
  state.pass = Math.round(one('pass', 0, Math.max(limits.passes - 1, 0), state.pass));
  const lights = given.get('light');
  if (lights !== null) {
    const lamps = lights.split(';').filter(Boolean).slice(0, MOST_LIGHTS).map((lamp) => lamp.split(',').map(Number));
    if (lamps.every((l) => (l.length === 2 || l.length === 3) && l.every(Number.isFinite))) {
      state.lights = lamps.map(([a, e, d]) => ({
        azimuth: clamp(a, -180, 180), elevation: clamp(e, -90, 90), distance: d > 0 ? clamp(d, NEAREST, 100) : 0,
      }));
    }
  }
  if (given.has('probe')) state.probe = given.get('probe') === '1';
  const view = numbers('view', 2);
  if (view) state.view = [clamp(view[0], -180, 180), clamp(view[1], -90, 90)];
  const distance = one('distance', 0, 100, state.distance);
  state.distance = distance > 0 ? Math.max(distance, NEAREST) : 0;
  const tilt = numbers('tilt', 2);
  if (tilt) [state.turn, state.tip] = [clamp(tilt[0], -180, 180), clamp(tilt[1], -90, 90)];
  const curl = one('curl', 0, 1000, state.curl);
  state.curl = curl > 0 ? Math.max(curl, limits.leastRadius) : 0;
  state.zoom = one('zoom', 0.5, MOST_ZOOM, state.zoom);
  const pan = numbers('pan', 2);
  if (pan) state.pan = [clamp(pan[0], -5, 5), clamp(pan[1], -5, 5)];
  state.exposure = one('exposure', -MOST_STOPS, MOST_STOPS, state.exposure);
  state.knee = one('knee', 0, 1, state.knee);
  const edit = given.get('edit');
  if (edit !== null) state.edits = editsRead(edit, limits.bases);
}
