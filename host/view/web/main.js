// The page: reads the data, draws, and follows mouse, touch and keyboard.

import { layer, stackWeights, unpacked, unpackedFloats } from './data.js';
import { Drawing } from './draw.js';
import { edited, editsWritten, steps, unedited } from './edit.js';
import { clamp, placeAt, seen, windowHeight } from './geometry.js';
import { chart, distance, element, inWords, reflectance, shares, weightsAt } from './spot.js';
import { initial, MOST_LIGHTS, MOST_ZOOM, read, SHOWS, written } from './state.js';

/** A frame that takes longer while something moves is drawn coarser, in milliseconds. */
const SLOW = 30;
/** How long the hand rests before the picture is drawn finely, in milliseconds. */
const REST = 140;
const MOST_COARSE = 6;

/** @type {<T extends HTMLElement>(id: string) => T} */
const byId = (id) => {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return /** @type {any} */ (found);
};

const data = /** @type {import('./data.js').Packed} */ (JSON.parse(byId('data').textContent ?? ''));
const canvas = /** @type {HTMLCanvasElement} */ (byId('picture'));
const stage = byId('stage');
const titles = {
  document: 'Document', mapped: 'Mapped', printed: 'Print', difference: 'Difference', stacks: 'Stacks', passes: 'Passes',
};
const available = SHOWS.filter((show) =>
  show === 'document' ? data.document : show === 'mapped' ? data.mapped : show === 'difference' ? data.difference
    : show === 'passes' ? data.printed.passes.length > 0 : true);
const leastRadius = data.size[0] / Math.PI;
const limits = { shows: available, passes: data.printed.passes.length, leastRadius, bases: data.edits ? data.edits.surfaces.length : 0 };

const state = initial();
let lamp = 0;
let tool = 'light';
let basis = 0;
/** @type {Drawing | null} */
let drawing = null;
/** @type {Record<string, import('./data.js').Layer>} */
let layers = {};
/** @type {Uint8Array} */
let dots = new Uint8Array();
/** @type {[number, number] | null} */
let spotAt = null;

// ---- drawing: once a frame at most, coarser while something moves ----

let asked = false;
let moving = false;
let coarse = 1;
let lastFrame = 0;
/** @type {number | undefined} */
let rest;

/** @param {boolean} inMotion */
function redraw(inMotion) {
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
  if (!drawing) return;
  if (moving) {
    const took = now - lastFrame;
    if (took > SLOW && took < 1000) coarse = Math.min(coarse * 1.4, MOST_COARSE);
    else if (took < SLOW / 2) coarse = Math.max(coarse / 1.1, 1);
    lastFrame = now;
  }
  fit(moving ? coarse : 1);
  applyEdits();
  drawing.draw(state, moving);
  overlays();
}

/** @param {number} by how many times coarser than the screen */
function fit(by) {
  const ratio = Math.min(devicePixelRatio || 1, 2) / by;
  const [width, height] = [Math.max(Math.round(canvas.clientWidth * ratio), 1), Math.max(Math.round(canvas.clientHeight * ratio), 1)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
}

function shareAddress() {
  const text = `#${written(state)}`;
  // A page from a disk may not be allowed to change its address.
  try {
    history.replaceState(null, '', text);
  } catch {
    location.hash = text;
  }
}

// ---- edits of the document ----

let applied = '';
/** @type {Float32Array} the curves as they were */
let original = new Float32Array();

/** Brings the curves of the document in line with the edits. */
function applyEdits() {
  const shown = layers.document;
  const wanted = editsWritten(state.edits);
  if (!shown || !data.edits || wanted === applied) return;
  applied = wanted;
  const { surfaces } = data.edits;
  const last = data.metric.angles[data.metric.angles.length - 1];
  const size = 3 * data.steps;
  surfaces.forEach((surface, k) => {
    const table = original.subarray(k * size, (k + 1) * size);
    shown.curves.set(edited(table, surface, state.edits[k] ?? unedited(), last), k * size);
  });
  drawing?.recurve('document');
}

const editOf = () => (state.edits[basis] ??= unedited());

function buildEdits() {
  if (!data.edits || !data.document) return;
  const which = /** @type {HTMLSelectElement} */ (byId('basis'));
  which.append(...data.edits.surfaces.map(({ number }, k) => element('option', { value: k }, `basis ${number}`)));
  which.addEventListener('change', () => {
    basis = Number(which.value);
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
      byId('copySteps').textContent = 'Copied';
    } catch {
      byId('copySteps').textContent = 'Selected; copy it';
    }
  });
  byId('unedit').addEventListener('click', () => {
    state.edits = {};
    sync();
    redraw(false);
  });
  synced.push({
    sync: () => {
      byId('edits').hidden = !isShown();
      which.value = String(basis);
      tint.value = editOf().tint;
      text.value = data.edits ? steps(data.name, data.edits.fingerprint, data.edits.surfaces, state.edits) : '';
      byId('stepFile').hidden = !text.value;
      byId('copySteps').textContent = 'Copy steps';
    },
  });
}

// ---- what lies over the picture ----

const lampButtons = byId('lamps');

/** Lights lie on a hemisphere over the picture, seen from above. */
const hemisphere = () => 0.46 * Math.min(canvas.clientWidth, canvas.clientHeight);

function overlays() {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  while (lampButtons.childElementCount > state.lights.length) lampButtons.lastElementChild?.remove();
  while (lampButtons.childElementCount < state.lights.length) addLampButton(lampButtons.childElementCount);
  state.lights.forEach(({ azimuth, elevation }, i) => {
    const button = /** @type {HTMLElement} */ (lampButtons.children[i]);
    const r = hemisphere() / 90;
    button.style.left = `${clamp(width / 2 + azimuth * r, 8, width - 8)}px`;
    button.style.top = `${clamp(height / 2 - elevation * r, 8, height - 8)}px`;
    button.setAttribute('aria-pressed', String(i === lamp));
    button.setAttribute('aria-label', `Light ${i + 1}: ${inDegrees(azimuth, 'right', 'left')}, ${inDegrees(elevation, 'up', 'down')}`);
    button.hidden = !lit();
  });
  const handle = byId('handle');
  handle.hidden = !state.with;
  handle.style.left = `${state.split * width}px`;
  handle.setAttribute('aria-valuenow', String(Math.round(100 * state.split)));
  const [left, right] = handle.querySelectorAll('.tag');
  left.textContent = title(state.show);
  right.textContent = title(state.with);
  scaleBar();
}

const lit = () => [state.show, state.with].some((show) => show in layers);

const inDegrees = (/** @type {number} */ v, /** @type {string} */ more, /** @type {string} */ less) =>
  `${Math.abs(Math.round(v))}° ${v < -0.5 ? less : more}`;

const title = (/** @type {string} */ show) => titles[/** @type {keyof typeof titles} */ (show)] ?? '';

function metresPerPixel() {
  return windowHeight(data.size, canvas.clientWidth / canvas.clientHeight) / state.zoom / canvas.clientHeight;
}

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
    lamp = i;
    controls();
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
    lamp = i;
    controls();
  });
  button.addEventListener('keydown', (event) => {
    const [x, y] = arrows(event) ?? [0, 0];
    if (x || y) {
      event.preventDefault();
      place(i, state.lights[i].azimuth + 3 * x, state.lights[i].elevation + 3 * y);
    }
  });
  lampButtons.append(button);
}

/** @type {(i: number, azimuth: number, elevation: number) => void} */
function place(i, azimuth, elevation) {
  state.lights[i].azimuth = clamp(azimuth, -88, 88);
  state.lights[i].elevation = clamp(elevation, -88, 88);
  sync();
  redraw(true);
}

// ---- the picture under the hand ----

/** @type {(event: KeyboardEvent) => [number, number] | null} */
const arrows = (event) =>
  /** @type {Record<string, [number, number]>} */ ({ ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] })[event.key] ?? null;

/** @type {(x: number, y: number, by: string) => void} */
function drag(x, y, by) {
  if (by === 'move') {
    const step = metresPerPixel();
    state.pan = [clamp(state.pan[0] - x * step, -5, 5), clamp(state.pan[1] + y * step, -5, 5)];
  } else if (by === 'sheet') {
    state.turn = clamp(state.turn + 0.25 * x, -80, 80);
    state.tip = clamp(state.tip - 0.25 * y, -80, 80);
    faceTheEye();
  } else if (state.lights[lamp]) {
    const r = hemisphere() / 90;
    place(lamp, state.lights[lamp].azimuth + x / r, state.lights[lamp].elevation - y / r);
    return;
  }
  sync();
  redraw(true);
}

/** The sheet is never turned so far that its back would be seen. */
function faceTheEye() {
  while (seen(state, data.size, 1, 1).towards[2] < 0.02) {
    state.turn *= 0.97;
    state.tip *= 0.97;
    if (Math.abs(state.turn) + Math.abs(state.tip) < 1) {
      state.view = [state.view[0] * 0.97, state.view[1] * 0.97];
    }
  }
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

canvas.addEventListener('pointerdown', (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  travelled = fingers.size > 1 ? Infinity : 0;
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
  } else if (fingers.size === 1 && travelled > 4) {
    drag(x, y, event.buttons & 6 ? 'move' : event.shiftKey ? 'sheet' : tool);
  }
  [finger.x, finger.y] = [event.clientX, event.clientY];
});
const lift = (/** @type {PointerEvent} */ event) => {
  if (!fingers.delete(event.pointerId)) return;
  if (event.type === 'pointerup' && fingers.size === 0 && travelled <= 4) {
    const box = canvas.getBoundingClientRect();
    look(event.clientX - box.left, event.clientY - box.top);
  }
};
canvas.addEventListener('pointerup', lift);
canvas.addEventListener('pointercancel', lift);
canvas.addEventListener('contextmenu', (event) => event.preventDefault());
canvas.addEventListener('wheel', (event) => {
  event.preventDefault();
  const box = canvas.getBoundingClientRect();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
  zoom(Math.exp(clamp(-event.deltaY * lines, -300, 300) / 400), event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2);
}, { passive: false });
canvas.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey) return;
  const arrow = arrows(event);
  if (arrow) {
    const [x, y] = arrow;
    if (event.altKey) drag(-40 * x, 40 * y, 'move');
    else if (event.shiftKey) drag(12 * x, -12 * y, 'sheet');
    else if (state.lights[lamp]) place(lamp, state.lights[lamp].azimuth + 3 * x, state.lights[lamp].elevation + 3 * y);
  } else if (event.key === '+' || event.key === '=') zoom(1.25);
  else if (event.key === '-') zoom(0.8);
  else if (event.key === '0') whole();
  else if (event.key === 'Enter') look(canvas.clientWidth / 2, canvas.clientHeight / 2);
  else if (event.key.toLowerCase() === 'l') choose('light');
  else if (event.key.toLowerCase() === 't') choose('sheet');
  else if (event.key.toLowerCase() === 'm') choose('move');
  else return;
  event.preventDefault();
});

const handle = byId('handle');
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
  const [x] = arrows(event) ?? [0];
  const end = event.key === 'Home' ? 0 : event.key === 'End' ? 1 : null;
  if (x === 0 && end === null) return;
  event.preventDefault();
  state.split = end ?? clamp(state.split + 0.02 * x, 0, 1);
  redraw(false);
});

// ---- a spot ----

/** @type {(x: number, y: number) => void} */
function look(x, y) {
  if (!drawing) return;
  const scene = seen(state, data.size, canvas.clientWidth, canvas.clientHeight);
  spotAt = placeAt(scene, data.size, x, y);
  const spot = byId('spot');
  spot.replaceChildren(element('h2', {}, 'Spot'));
  if (!spotAt) {
    spot.append(element('p', { class: 'hint' }, 'Beside the sheet. Click or tap the sheet itself.'));
    return;
  }
  const { printed } = data;
  const dotX = Math.min(Math.floor((spotAt[0] / data.size[0] + 0.5) * printed.width), printed.width - 1);
  const dotY = Math.min(Math.floor((0.5 - spotAt[1] / data.size[1]) * printed.length), printed.length - 1);
  const stack = dots[dotY * printed.width + dotX];
  const mix = weightsAt(layers.printed, spotAt, data.size);
  const print = (/** @type {number} */ theta) => reflectance(layers.printed, mix, theta, data.steps);
  const lines = [{ name: 'print', at: print }];
  const from = [(spotAt[0] + data.size[0] / 2) * 1000, (data.size[1] / 2 - spotAt[1]) * 1000];
  spot.append(element('p', { class: 'hint' }, `${from[0].toFixed(1)} mm from the left, ${from[1].toFixed(1)} mm from the top`));
  if (layers.document) {
    const weights = weightsAt(layers.document, spotAt, data.size);
    const target = (/** @type {number} */ theta) => reflectance(layers.document, weights, theta, data.steps);
    lines.push({ name: 'document', at: target });
    const d = distance(data, target, print);
    spot.append(element('p', { id: 'd' }, `Print and document differ by d = ${d.toFixed(3)}: ${inWords(d)}.`));
  }
  const captions = lines.map(({ name }) => element('span', { class: name }, name === 'print' ? '— print' : '- - document'));
  spot.append(element('figure', {}, chart(lines), element('figcaption', {}, ...captions, element('span', { class: 'hint' }, '1/sr over the half angle'))));
  const rows = shares(layers.printed, mix).map(({ name, share }) => {
    const colour = printed.colours[printed.names.indexOf(name)];
    const chip = element('span', { class: 'chip' });
    chip.style.backgroundColor = `rgb(${colour.join(' ')})`;
    return element('li', {}, chip, element('b', {}, `${Math.round(100 * share)} %`), name);
  });
  spot.append(element('p', {}, 'Mixture of stacks:'), element('ul', { id: 'mixture' }, ...rows));
  const inks = printed.inks[stack];
  spot.append(element('p', { id: 'dot' }, `This dot: ${printed.names[stack]}`, inks.length ? ` (${inks.join(', then ')})` : ' (bare paper)'));
}

// ---- controls ----

/** @type {{ sync: () => void }[]} */
const synced = [];
const sync = () => synced.forEach((control) => control.sync());

/**
 * @param {HTMLElement} into
 * @param {string} name
 * @param {{ min: number, max: number, step: number, get: () => number, set: (v: number) => void, words: (v: number) => string,
 *   shown?: () => boolean }} how
 */
function slider(into, name, how) {
  const input = /** @type {HTMLInputElement} */ (element('input', { type: 'range', min: how.min, max: how.max, step: how.step }));
  const output = element('output');
  const label = element('label', { class: 'slider' }, element('span', {}, name), input, output);
  input.addEventListener('input', () => {
    how.set(Number(input.value));
    sync();
    redraw(true);
  });
  synced.push({
    sync: () => {
      label.hidden = how.shown ? !how.shown() : false;
      if (label.hidden) return;
      const value = how.get();
      input.value = String(value);
      output.textContent = how.words(value);
      input.setAttribute('aria-valuetext', output.textContent);
    },
  });
  into.append(label);
}

/**
 * The button of a group that is chosen.
 * @param {HTMLElement} group
 * @param {string} attribute
 * @param {(button: HTMLElement) => boolean} chosen
 */
function mark(group, attribute, chosen) {
  for (const button of group.children) {
    if (button.hasAttribute(attribute)) button.setAttribute(attribute, String(chosen(/** @type {HTMLElement} */ (button))));
  }
}

/** @param {string} name */
function choose(name) {
  tool = name;
  mark(byId('tools'), 'aria-pressed', (button) => button.dataset.tool === tool);
}

/** @param {string} show */
function showFirst(show) {
  state.show = show;
  if (state.with === show) state.with = '';
  controls();
  redraw(false);
}

/** Brings all controls in line with the state. */
function controls() {
  const left = byId('left');
  mark(left, 'aria-checked', (button) => button.dataset.show === state.show);
  for (const button of left.children) {
    /** @type {HTMLElement} */ (button).tabIndex = /** @type {HTMLElement} */ (button).dataset.show === state.show ? 0 : -1;
  }
  const other = /** @type {HTMLSelectElement} */ (byId('with'));
  other.replaceChildren(element('option', { value: '' }, 'nothing'),
    ...available.filter((show) => show !== state.show).map((show) => element('option', { value: show }, title(show))));
  other.value = state.with;
  byId('passRow').hidden = state.show !== 'passes' && state.with !== 'passes';
  /** @type {HTMLSelectElement} */ (byId('pass')).value = String(state.pass);
  /** @type {HTMLInputElement} */ (byId('probe')).checked = state.probe;
  lamp = clamp(lamp, 0, Math.max(state.lights.length - 1, 0));
  const lights = byId('lights');
  const numbers = state.lights.map((_, i) => {
    const button = element('button', { type: 'button', 'aria-pressed': String(i === lamp), 'aria-label': `Choose light ${i + 1}` }, String(i + 1));
    button.addEventListener('click', () => {
      lamp = i;
      controls();
      overlays();
    });
    return button;
  });
  const more = element('button', { type: 'button', id: 'more' }, '+ add');
  more.addEventListener('click', () => {
    state.lights.push({ azimuth: 35, elevation: 20, distance: 0.6 });
    lamp = state.lights.length - 1;
    controls();
    redraw(false);
  });
  const fewer = element('button', { type: 'button', id: 'fewer' }, '− remove');
  fewer.addEventListener('click', () => {
    state.lights.splice(lamp, 1);
    controls();
    redraw(false);
  });
  const focused = document.activeElement?.id;
  lights.replaceChildren(...numbers, ...(state.lights.length < MOST_LIGHTS ? [more] : []), ...(state.lights.length ? [fewer] : []));
  if (focused === 'more' || focused === 'fewer') document.getElementById(focused)?.focus();
  legend();
  sync();
}

function legend() {
  const box = byId('legend');
  const shown = [state.show, state.with];
  box.replaceChildren();
  if (shown.includes('difference')) {
    const bar = element('div', { class: 'bar' });
    bar.style.background = 'linear-gradient(90deg, #440154, #3b528b, #21918c, #5ec962, #fde725)';
    box.append(bar, element('div', { class: 'marks' }, ...['0', '0.05 obvious', '0.1', '0.15', '0.2'].map((text) => element('span', {}, text))),
      element('p', { class: 'hint' }, 'Difference d of print and document; 0.01 is barely visible.'));
  }
  if (shown.includes('stacks')) {
    box.append(element('ul', {}, ...data.printed.names.map((name, i) => {
      const chip = element('span', { class: 'chip' });
      chip.style.backgroundColor = `rgb(${data.printed.colours[i].join(' ')})`;
      return element('li', {}, chip, name);
    })));
  }
  box.hidden = box.childElementCount === 0;
}

function build() {
  byId('name').textContent = data.name;
  byId('about').textContent = data.about;
  const left = byId('left');
  available.forEach((show) => {
    const button = element('button', { type: 'button', role: 'radio', 'aria-checked': 'false', 'data-show': show }, title(show));
    button.addEventListener('click', () => showFirst(show));
    left.append(button);
  });
  left.addEventListener('keydown', (event) => {
    const [x, y] = arrows(event) ?? [0, 0];
    if (!x && !y) return;
    event.preventDefault();
    const at = available.indexOf(state.show) + (x || -y);
    showFirst(available[(at + available.length) % available.length]);
    /** @type {HTMLElement | null} */ (left.querySelector('[aria-checked="true"]'))?.focus();
  });
  byId('withRow').hidden = available.length < 2;
  byId('with').addEventListener('change', (event) => {
    state.with = /** @type {HTMLSelectElement} */ (event.target).value;
    controls();
    redraw(false);
  });
  const pass = byId('pass');
  pass.append(...data.printed.passes.map(({ name }, i) => element('option', { value: i }, `${i + 1}: ${name}`)));
  pass.addEventListener('change', () => {
    state.pass = Number(/** @type {HTMLSelectElement} */ (pass).value);
    redraw(false);
  });
  byId('probe').addEventListener('change', (event) => {
    state.probe = /** @type {HTMLInputElement} */ (event.target).checked;
    redraw(false);
  });
  for (const button of byId('tools').querySelectorAll('[data-tool]')) {
    button.addEventListener('click', () => choose(/** @type {HTMLElement} */ (button).dataset.tool ?? 'light'));
  }
  byId('nearer').addEventListener('click', () => zoom(1.5));
  byId('farther').addEventListener('click', () => zoom(1 / 1.5));
  byId('whole').addEventListener('click', whole);
  byId('reset').addEventListener('click', () => {
    Object.assign(state, initial());
    read(data.start, state, limits);
    controls();
    redraw(false);
  });
  byId('share').addEventListener('click', async () => {
    shareAddress();
    try {
      await navigator.clipboard.writeText(location.href);
      byId('share').textContent = 'Copied';
    } catch {
      byId('share').textContent = 'The address above is this view';
    }
  });

  buildEdits();
  const hasLight = () => state.lights.length > 0;
  const [light, sheet] = [byId('sliders-light'), byId('sliders-sheet')];
  const degrees = (/** @type {string} */ more, /** @type {string} */ less) => (/** @type {number} */ v) => inDegrees(v, more, less);
  const chosen = () => state.lights[lamp];
  slider(light, 'direction', { min: -88, max: 88, step: 1, shown: hasLight, get: () => chosen().azimuth, set: (v) => (chosen().azimuth = v), words: degrees('right', 'left') });
  slider(light, 'height', { min: -88, max: 88, step: 1, shown: hasLight, get: () => chosen().elevation, set: (v) => (chosen().elevation = v), words: degrees('up', 'down') });
  // The last step is far away.
  const near = (/** @type {number} */ d) => (d > 0 ? Math.log(d / 0.1) / Math.log(30) : 1.04);
  const metres = (/** @type {number} */ v) => (v > 1.02 ? 0 : 0.1 * 30 ** v);
  const inMetres = (/** @type {number} */ v) => (metres(v) ? `${metres(v).toFixed(2)} m` : 'far');
  slider(light, 'distance', { min: 0, max: 1.04, step: 0.01, shown: hasLight, get: () => near(chosen().distance), set: (v) => (chosen().distance = metres(v)), words: inMetres });
  slider(light, 'exposure', { min: -5, max: 5, step: 0.1, get: () => state.exposure, set: (v) => (state.exposure = v), words: (v) => `${v >= 0.05 ? '+' : ''}${Math.abs(v) < 0.05 ? '0' : v.toFixed(1)} EV` });
  const turned = (/** @type {'turn' | 'tip'} */ which) => (/** @type {number} */ v) => {
    state[which] = v;
    faceTheEye();
  };
  slider(sheet, 'turn', { min: -80, max: 80, step: 1, get: () => state.turn, set: turned('turn'), words: degrees('right', 'left') });
  slider(sheet, 'tip', { min: -80, max: 80, step: 1, get: () => state.tip, set: turned('tip'), words: degrees('back', 'front') });
  slider(sheet, 'bend', {
    min: 0, max: 1, step: 0.01, get: () => (state.curl > 0 ? leastRadius / state.curl : 0),
    set: (v) => (state.curl = v > 0 ? leastRadius / v : 0), words: () => (state.curl > 0 ? `r ${(state.curl * 1000).toFixed(0)} mm` : 'flat'),
  });
  slider(sheet, 'eye', { min: 0, max: 1.04, step: 0.01, get: () => near(state.distance), set: (v) => (state.distance = metres(v)), words: inMetres });
  const viewed = (/** @type {0 | 1} */ i) => (/** @type {number} */ v) => {
    state.view[i] = v;
    faceTheEye();
  };
  slider(sheet, 'eye across', { min: -80, max: 80, step: 1, get: () => state.view[0], set: viewed(0), words: degrees('right', 'left') });
  slider(sheet, 'eye up', { min: -80, max: 80, step: 1, get: () => state.view[1], set: viewed(1), words: degrees('up', 'down') });
}

/** @param {string} text */
function say(text) {
  const message = byId('message');
  message.textContent = text;
  message.hidden = false;
}

async function start() {
  build();
  read(data.start, state, limits);
  read(location.hash, state, limits);
  faceTheEye();
  controls();
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
  if (!gl || typeof DecompressionStream === 'undefined') {
    say('This browser has no WebGL2, so the light cannot be moved here. The picture shows the sheet under one light.');
    return;
  }
  const [bytes, probe, difference, document_, mapped] = await Promise.all([
    unpacked(data.printed.dots), unpackedFloats(data.probe.texels), data.difference ? unpacked(data.difference.bytes) : null,
    data.document && layer(data.document), data.mapped && layer(data.mapped),
  ]);
  dots = bytes;
  layers = { printed: await stackWeights(data.printed, dots) };
  if (document_) {
    layers.document = document_;
    original = document_.curves.slice();
  }
  if (mapped) layers.mapped = mapped;
  /** @type {[string, string]} */
  const shaders = [byId('vertex').textContent ?? '', byId('fragment').textContent ?? ''];
  const make = () => new Drawing(canvas, gl, data, { layers, dots, probe, difference }, shaders);
  drawing = make();
  canvas.addEventListener('webglcontextlost', (event) => {
    event.preventDefault();
    drawing = null;
  });
  canvas.addEventListener('webglcontextrestored', () => {
    drawing = make();
    redraw(false);
  });
  new ResizeObserver(() => redraw(false)).observe(canvas);
  addEventListener('hashchange', (event) => {
    // The page may have written its own address since.
    read(new URL(event.newURL).hash, state, limits);
    faceTheEye();
    controls();
    redraw(false);
  });
  fit(1);
  applyEdits();
  drawing.draw(state, false);
  stage.classList.add('ready');
  overlays();
}

start().catch((/** @type {Error} */ error) => say(`The page cannot draw: ${error.message}. The picture shows the sheet under one light.`));
