// What controls have in common: each brings itself in line with the state after every change.

import { element } from './spot.js';
import { redraw } from './stage.js';

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
    how.set(Number(input.value));
    sync();
    redraw(true);
  });
    if (how.shown && !how.shown()) return;
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
