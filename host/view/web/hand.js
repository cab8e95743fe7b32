// The picture under the hand: mouse, touch, wheel and keys move light, sheet and picture, and a tap looks at a spot.

import { arrows, inDegrees, mark, sync, tell, within } from './controls.js';
import { clamp } from './geometry.js';
import { hemisphere, lampInWords, place } from './lamps.js';
import { look } from './look.js';
import { byId, canvas, faceTheEye, held, metresPerPixel, redraw, stage, state } from './stage.js';
import { MOST_ZOOM } from './state.js';

/** @type {(x: number, y: number, by: string) => void} */
function drag(x, y, by) {
  if (by === 'move') {
    const step = metresPerPixel();
    state.pan = [clamp(state.pan[0] - x * step, -5, 5), clamp(state.pan[1] + y * step, -5, 5)];
  } else if (by === 'sheet') {
    state.turn = within(state.turn + 0.25 * x, state.turn, 80);
    state.tip = within(state.tip - 0.25 * y, state.tip, 80);
    faceTheEye();
  } else if (state.lights[held.lamp]) {
    const r = hemisphere() / 90;
    place(held.lamp, state.lights[held.lamp].azimuth + x / r, state.lights[held.lamp].elevation - y / r);
    return;
  }
  sync();
  redraw(true);
}

/**
 * Zooms, and keeps the point of the picture where it is.
 * @param {number} by
 * @param {number} x from the middle of the picture, in pixels
 * @param {number} y
 */
function zoom(by, x = 0, y = 0) {
  const before = metresPerPixel();
  state.zoom = clamp(state.zoom * by, 0.5, MOST_ZOOM);
  const change = before - metresPerPixel();
  state.pan = [clamp(state.pan[0] + x * change, -5, 5), clamp(state.pan[1] - y * change, -5, 5)];
  redraw(true);
}

function whole() {
  state.zoom = 1;
  state.pan = [0, 0];
  redraw(false);
}

/** @type {Map<number, { x: number, y: number }>} */
const fingers = new Map();
let travelled = 0;
/** Whether there were two fingers: the one that is lifted last drags nothing. */
let pinched = false;

canvas.addEventListener('pointerdown', (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  if (fingers.size === 1) [travelled, pinched] = [0, false];
  else pinched = true;
});
canvas.addEventListener('pointermove', (event) => {
  const finger = fingers.get(event.pointerId);
  if (!finger) return;
  const [x, y] = [event.clientX - finger.x, event.clientY - finger.y];
  travelled += Math.abs(x) + Math.abs(y);
  if (fingers.size === 2) {
    const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    const before = Math.hypot(finger.x - other.x, finger.y - other.y);
    const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    const box = canvas.getBoundingClientRect();
    drag(x / 2, y / 2, 'move');
    zoom(after / Math.max(before, 1), (event.clientX + other.x) / 2 - box.left - box.width / 2, (event.clientY + other.y) / 2 - box.top - box.height / 2);
  } else if (!pinched && travelled > 4) {
    drag(x, y, event.buttons & 6 ? 'move' : event.shiftKey ? 'sheet' : held.tool);
  }
  [finger.x, finger.y] = [event.clientX, event.clientY];
});
const lift = (/** @type {PointerEvent} */ event) => {
  if (!fingers.delete(event.pointerId)) return;
  if (event.type === 'pointerup' && !pinched && travelled <= 4) {
    const box = canvas.getBoundingClientRect();
    look(event.clientX - box.left, event.clientY - box.top);
  }
};
canvas.addEventListener('pointerup', lift);
canvas.addEventListener('pointercancel', lift);
// A hand that another window takes over lifts nothing here.
canvas.addEventListener('lostpointercapture', lift);
canvas.addEventListener('contextmenu', (event) => event.preventDefault());
// Lamps and the handle lie over the picture.
stage.addEventListener('wheel', (event) => {
  event.preventDefault();
  const box = canvas.getBoundingClientRect();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
  // Two fingers on a touchpad are a wheel with Ctrl, in small steps.
  const by = event.ctrlKey ? clamp(-event.deltaY, -40, 40) / 100 : clamp(-event.deltaY * lines, -300, 300) / 400;
  zoom(Math.exp(by), event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2);
}, { passive: false });
canvas.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey) return;
  const arrow = arrows(event);
  const zoomed = () => `Zoom ${Number(state.zoom.toFixed(1))}`;
  if (arrow) {
    const [x, y] = arrow;
    if (event.altKey) drag(-40 * x, 40 * y, 'move');
    else if (event.shiftKey) {
      drag(12 * x, -12 * y, 'sheet');
      tell(() => `Sheet turned ${inDegrees(state.turn, 'right', 'left')}, tipped ${inDegrees(state.tip, 'back', 'front')}`);
    } else if (state.lights[held.lamp]) {
      place(held.lamp, state.lights[held.lamp].azimuth + 3 * x, state.lights[held.lamp].elevation + 3 * y);
      tell(() => (state.lights[held.lamp] ? lampInWords(held.lamp) : ''));
    }
  } else if (event.key === '+' || event.key === '=') {
    zoom(1.25);
    tell(zoomed);
  } else if (event.key === '-') {
    zoom(0.8);
    tell(zoomed);
  } else if (event.key === '0') {
    whole();
    tell(zoomed);
  } else if (event.key === 'Enter') look(canvas.clientWidth / 2, canvas.clientHeight / 2);
  else if (event.key.toLowerCase() === 'l') choose('light');
  else if (event.key.toLowerCase() === 't') choose('sheet');
  else if (event.key.toLowerCase() === 'm') choose('move');
  else return;
  event.preventDefault();
});

/** @param {string} name */
function choose(name) {
  held.tool = name;
  mark(byId('tools'), 'aria-pressed', (button) => button.dataset.tool === held.tool);
}

for (const button of byId('tools').querySelectorAll('[data-tool]')) {
  button.addEventListener('click', () => choose(/** @type {HTMLElement} */ (button).dataset.tool ?? 'light'));
}
byId('nearer').addEventListener('click', () => zoom(1.5));
byId('farther').addEventListener('click', () => zoom(1 / 1.5));
byId('whole').addEventListener('click', whole);
