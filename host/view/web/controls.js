// What controls have in common: each brings itself in line with the state after every change.

import { clamp } from './geometry.js';
import { element } from './spot.js';
import { byId, redraw } from './stage.js';

/** How long keys rest before what they did is read aloud, in milliseconds: none interrupts the one before. */
const READ = 600;

/** How long a button says what it did, in milliseconds. */
const ANSWERED = 2500;

/** What follows every change. @type {(() => void)[]} */
export const synced = [];
export const sync = () => synced.forEach((follow) => follow());

/** What follows a choice of a view or a light. @type {(() => void)[]} */
export const rechosen = [];
export function rechoose() {
  rechosen.forEach((follow) => follow());
  sync();
}

/**
 * @param {HTMLElement} into
 * @param {string} name
 * @param {{ min: number, max: number, step: number, get: () => number, set: (v: number) => void, words: (v: number) => string,
 *   shown?: () => boolean }} how
 */
export function slider(into, name, how) {
  const input = /** @type {HTMLInputElement} */ (element('input', { type: 'range', min: how.min, max: how.max, step: how.step }));
  const output = element('output');
  const label = element('label', { class: 'slider' }, element('span', {}, name), input, output);
  input.addEventListener('input', () => {
    if (how.shown && !how.shown()) return;
    how.set(Number(input.value));
    sync();
    redraw(true);
  });
  synced.push(() => {
    label.hidden = how.shown ? !how.shown() : false;
    if (label.hidden) return;
    const value = how.get();
    input.value = String(value);
    output.textContent = how.words(value);
    input.setAttribute('aria-valuetext', output.textContent);
  });
  into.append(label);
}

/**
 * The button of a group that is chosen.
 * @param {HTMLElement} group
 * @param {string} attribute
 * @param {(button: HTMLElement) => boolean} chosen
 */
export function mark(group, attribute, chosen) {
  for (const button of group.children) {
    if (button.hasAttribute(attribute)) button.setAttribute(attribute, String(chosen(/** @type {HTMLElement} */ (button))));
  }
}

/** @type {(event: KeyboardEvent) => [number, number] | null} */
export const arrows = (event) =>
  /** @type {Record<string, [number, number]>} */ ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] })[event.key] ?? null;

export const inDegrees = (/** @type {number} */ v, /** @type {string} */ more, /** @type {string} */ less) =>
  `${Math.abs(Math.round(v))}° ${v < -0.5 ? less : more}`;

/** @type {number | undefined} */
let told;

/**
 * Says to who cannot see the picture what keys made of it, once they rest.
 * @param {() => string} words
 */
export function tell(words) {
  clearTimeout(told);
  told = setTimeout(() => (byId('said').textContent = words()), READ);
}

/**
 * What a drag or an arrow may make of a value: as far as `limit`, and from beyond it only back.
 * @param {number} value
 * @param {number} old
 * @param {number} limit
 */
export const within = (value, old, limit) => clamp(value, Math.min(-limit, old), Math.max(limit, old));

/**
 * Words on a button for a while.
 * @param {HTMLElement} button
 * @param {string} text
 */
export function answer(button, text) {
  const usual = (button.dataset.usual ??= button.textContent ?? '');
  button.textContent = text;
  setTimeout(() => (button.textContent = usual), ANSWERED);
}
