// What lies over the picture: a lamp for each light, the handle of a split picture, and the scale.

import { arrows, inDegrees, rechoose, sync, tell, within } from './controls.js';
import { clamp } from './geometry.js';
import { element } from './spot.js';
import { byId, canvas, drawn, eachFrame, held, metresPerPixel, redraw, stage, state } from './stage.js';
import { TITLES } from './state.js';

const lampButtons = byId('lamps');
const handle = byId('handle');

/** Lights lie on a hemisphere over the picture, seen from above. */
export const hemisphere = () => 0.46 * Math.min(canvas.clientWidth, canvas.clientHeight);

function layOver() {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  while (lampButtons.childElementCount > state.lights.length) lampButtons.lastElementChild?.remove();
  while (lampButtons.childElementCount < state.lights.length) addLampButton(lampButtons.childElementCount);
  state.lights.forEach(({ azimuth, elevation }, i) => {
    const button = /** @type {HTMLElement} */ (lampButtons.children[i]);
    const r = hemisphere() / 90;
    button.style.left = `${clamp(width / 2 + azimuth * r, 8, width - 8)}px`;
    button.style.top = `${clamp(height / 2 - elevation * r, 8, height - 8)}px`;
    button.setAttribute('aria-pressed', String(i === held.lamp));
    button.setAttribute('aria-label', lampInWords(i));
    button.hidden = !lit();
  });
  handle.hidden = !state.with;
  handle.style.left = `${state.split * width}px`;
  handle.setAttribute('aria-valuenow', String(Math.round(100 * state.split)));
  const [left, right] = handle.querySelectorAll('.tag');
  left.textContent = TITLES[state.show];
  right.textContent = TITLES[state.with] ?? '';
  stage.dataset.shows = [state.show, state.with].filter(Boolean).map((show) => TITLES[show]).join(', ');
  scaleBar();
}

/** @param {number} i */
export function lampInWords(i) {
  const { azimuth, elevation } = state.lights[i];
  return `Light ${i + 1}: ${inDegrees(azimuth, 'right', 'left')}, ${inDegrees(elevation, 'up', 'down')}`;
}

const lit = () => [state.show, state.with].some((show) => show in drawn.layers);

function scaleBar() {
  const most = metresPerPixel() * 110 * 1000;
  const power = 10 ** Math.floor(Math.log10(most));
  const mm = [5, 2, 1].map((n) => n * power).find((n) => n <= most) ?? power;
  const [bar, text] = byId('scale').children;
  /** @type {HTMLElement} */ (bar).style.width = `${mm / 1000 / metresPerPixel()}px`;
  text.textContent = mm >= 1 ? `${mm} mm` : `${Math.round(mm * 1000)} µm`;
}

/** @param {number} i */
function addLampButton(i) {
  const button = element('button', { type: 'button', class: 'lamp' }, element('span', {}, String(i + 1)));
  button.addEventListener('pointerdown', (event) => {
    event.preventDefault();
    button.focus();
    held.lamp = i;
    rechoose();
    button.setPointerCapture(event.pointerId);
    const box = canvas.getBoundingClientRect();
    const move = (/** @type {PointerEvent} */ e) => {
      const r = hemisphere() / 90;
      place(i, (e.clientX - box.left - box.width / 2) / r, (box.top + box.height / 2 - e.clientY) / r);
    };
    button.addEventListener('pointermove', move);
    button.addEventListener('lostpointercapture', () => button.removeEventListener('pointermove', move), { once: true });
  });
  button.addEventListener('focus', () => {
    held.lamp = i;
    rechoose();
  });
  button.addEventListener('keydown', (event) => {
    const [x, y] = arrows(event) ?? [0, 0];
    if (x || y) {
      event.preventDefault();
      place(i, state.lights[i].azimuth + 3 * x, state.lights[i].elevation + 3 * y);
      tell(() => lampInWords(i));
    }
  });
  lampButtons.append(button);
}

/** @type {(i: number, azimuth: number, elevation: number) => void} */
export function place(i, azimuth, elevation) {
  const light = state.lights[i];
  light.azimuth = within(azimuth, light.azimuth, 88);
  light.elevation = within(elevation, light.elevation, 88);
  sync();
  redraw(true);
}

handle.addEventListener('pointerdown', (event) => {
  event.preventDefault();
  handle.focus();
  handle.setPointerCapture(event.pointerId);
});
handle.addEventListener('pointermove', (event) => {
  if (!handle.hasPointerCapture(event.pointerId)) return;
  const box = canvas.getBoundingClientRect();
  state.split = clamp((event.clientX - box.left) / box.width, 0, 1);
  redraw(true);
});
handle.addEventListener('keydown', (event) => {
  const [across, up] = arrows(event) ?? [0, 0];
  const x = across || up;
  const end = event.key === 'Home' ? 0 : event.key === 'End' ? 1 : null;
  if (x === 0 && end === null) return;
  event.preventDefault();
  state.split = end ?? clamp(state.split + 0.02 * x, 0, 1);
  redraw(false);
});

eachFrame.after.push(layOver);
