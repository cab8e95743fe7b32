// The controls beside the picture: what is shown, the lights, how the sheet is held, and the legend.

import { answer, arrows, inDegrees, mark, rechoose, rechosen, slider } from './controls.js';
import { buildEdits } from './editing.js';
import { clamp } from './geometry.js';
import { element } from './spot.js';
import { available, byId, data, faceTheEye, held, leastRadius, limits, redraw, shareAddress, state } from './stage.js';
import { initial, MOST_LIGHTS, read, TITLES } from './state.js';

/** Where lights are put that are added. */
const PLACES = [[35, 20], [-35, -20], [30, -35], [-25, 30]];

/** @param {string} show */
function showFirst(show) {
  state.show = show;
  if (state.with === show) state.with = '';
  rechoose();
  redraw(false);
}

/** Where a new light goes: the place that is farthest from all others. */
function freePlace() {
  const fromOthers = (/** @type {number[]} */ [a, e]) => Math.min(Infinity, ...state.lights.map((l) => Math.hypot(l.azimuth - a, l.elevation - e)));
  const [azimuth, elevation] = PLACES.reduce((best, place) => (fromOthers(place) > fromOthers(best) ? place : best));
  return { azimuth, elevation };
}

/** Brings the choices in line with the state. */
function choices() {
  const left = byId('left');
  mark(left, 'aria-checked', (button) => button.dataset.show === state.show);
  for (const button of left.children) {
    /** @type {HTMLElement} */ (button).tabIndex = /** @type {HTMLElement} */ (button).dataset.show === state.show ? 0 : -1;
  }
  const other = /** @type {HTMLSelectElement} */ (byId('with'));
  other.replaceChildren(element('option', { value: '' }, 'nothing'),
    ...available.filter((show) => show !== state.show).map((show) => element('option', { value: show }, TITLES[show])));
  other.value = state.with;
  byId('passRow').hidden = state.show !== 'passes' && state.with !== 'passes';
  /** @type {HTMLSelectElement} */ (byId('pass')).value = String(state.pass);
  /** @type {HTMLInputElement} */ (byId('probe')).checked = state.probe;
  held.lamp = clamp(held.lamp, 0, Math.max(state.lights.length - 1, 0));
  const lights = byId('lights');
  const numbers = state.lights.map((_, i) => {
    const button = element('button', { type: 'button', id: `light${i + 1}`, 'aria-pressed': String(i === held.lamp), 'aria-label': `Choose light ${i + 1}` }, String(i + 1));
    button.addEventListener('click', () => {
      held.lamp = i;
      rechoose();
      redraw(false);
    });
    return button;
  });
  const more = element('button', { type: 'button', id: 'more' }, '+ add');
  more.addEventListener('click', () => {
    state.lights.push({ ...freePlace(), distance: 0.6 });
    held.lamp = state.lights.length - 1;
    rechoose();
    redraw(false);
  });
  const fewer = element('button', { type: 'button', id: 'fewer' }, '− remove');
  fewer.addEventListener('click', () => {
    state.lights.splice(held.lamp, 1);
    rechoose();
    redraw(false);
  });
  const focused = lights.contains(document.activeElement) ? document.activeElement?.id ?? '' : null;
  lights.replaceChildren(...numbers, ...(state.lights.length < MOST_LIGHTS ? [more] : []), ...(state.lights.length ? [fewer] : []));
  if (focused !== null) (document.getElementById(focused) ?? numbers[held.lamp] ?? more).focus();
  legend();
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

export function build() {
  byId('name').textContent = data.name;
  byId('about').textContent = data.about;
  const left = byId('left');
  available.forEach((show) => {
    const button = element('button', { type: 'button', role: 'radio', 'aria-checked': 'false', 'data-show': show }, TITLES[show]);
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
    rechoose();
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
  byId('reset').addEventListener('click', () => {
    Object.assign(state, initial());
    read(data.start, state, limits);
    rechoose();
    redraw(false);
  });
  byId('share').addEventListener('click', async () => {
    shareAddress();
    try {
      await navigator.clipboard.writeText(location.href);
      answer(byId('share'), 'Copied');
    } catch {
      answer(byId('share'), 'The address above is this view');
    }
  });

  rechosen.push(choices);
  buildEdits();
  const hasLight = () => state.lights.length > 0;
  const [light, sheet] = [byId('sliders-light'), byId('sliders-sheet')];
  const degrees = (/** @type {string} */ more, /** @type {string} */ less) => (/** @type {number} */ v) => inDegrees(v, more, less);
  const chosen = () => state.lights[held.lamp];
  slider(light, 'direction', { min: -88, max: 88, step: 1, shown: hasLight, get: () => chosen().azimuth, set: (v) => (chosen().azimuth = v), words: degrees('right', 'left') });
  slider(light, 'height', { min: -88, max: 88, step: 1, shown: hasLight, get: () => chosen().elevation, set: (v) => (chosen().elevation = v), words: degrees('up', 'down') });
  // The last step is far away.
  const near = (/** @type {number} */ d) => (d > 0 ? Math.log(d / 0.1) / Math.log(30) : 1.04);
  const metres = (/** @type {number} */ v) => (v > 1.02 ? 0 : 0.1 * 30 ** v);
  const inMetres = (/** @type {number} */ d) => (d ? `${d.toFixed(2)} m` : 'far');
  slider(light, 'distance', { min: 0, max: 1.04, step: 0.01, shown: hasLight, get: () => near(chosen().distance), set: (v) => (chosen().distance = metres(v)), words: () => inMetres(chosen().distance) });
  slider(light, 'exposure', { min: -10, max: 10, step: 0.1, get: () => state.exposure, set: (v) => (state.exposure = v), words: (v) => `${v >= 0.05 ? '+' : ''}${Math.abs(v) < 0.05 ? '0' : v.toFixed(1)} EV` });
  slider(light, 'tone curve', { min: 0, max: 1, step: 0.05, get: () => state.knee, set: (v) => (state.knee = v), words: (v) => (v < 1 ? `from ${Math.round(100 * v)} %` : 'cut off') });
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
  slider(sheet, 'eye', { min: 0, max: 1.04, step: 0.01, get: () => near(state.distance), set: (v) => (state.distance = metres(v)), words: () => inMetres(state.distance) });
  const viewed = (/** @type {0 | 1} */ i) => (/** @type {number} */ v) => {
    state.view[i] = v;
    faceTheEye();
  };
  slider(sheet, 'eye across', { min: -80, max: 80, step: 1, get: () => state.view[0], set: viewed(0), words: degrees('right', 'left') });
  slider(sheet, 'eye up', { min: -80, max: 80, step: 1, get: () => state.view[1], set: viewed(1), words: degrees('up', 'down') });
}
