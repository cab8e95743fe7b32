// What is seen of a printed grid of stacks under a screen: the forward model of `host/view/src/display`, and its controls.

import { unpacked, unpackedFloats } from './data.js';

/**
 * @typedef {{ name: string, about: string, pixels: [number, number], cells: [number, number], tile: number, margin: number,
 *   order: number[], edges: [number[], number[]], side: number, passes: number[], brightness: number, white: number,
 *   steps: number, stacks: string[], colours: number[][], curves: string,
 *   placed: { shift: [number, number], depth: number },
 *   frames: { name: string, values: string, distance: number | null }[] }} Data
 * @typedef {[number, number, number]} Vector
 * @typedef {{ lightX: number, lightY: number, eyeX: number, eyeY: number, shiftX: number, shiftY: number, depth: number,
 *   speed: number }} State
 */

const GLASS = 1.5;
const KNEE = 0.4;

/** @type {<T extends HTMLElement>(id: string) => T} */
const byId = (id) => {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return /** @type {any} */ (found);
};

const data = /** @type {Data} */ (JSON.parse(byId('data').textContent ?? ''));
const count = data.stacks.length;

// ---- the forward model ----

/** @param {number} azimuth @param {number} elevation @returns {Vector} */
function direction(azimuth, elevation) {
  const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  return [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
}

/** Where the way through a place of the print crosses the screen, less that place. @param {Vector} to @param {State} at */
function crossing([x, y], at) {
  const sine = Math.hypot(x, y) / GLASS;
  const per = at.depth / (GLASS * Math.sqrt(1 - sine * sine));
  return [x * per - at.shiftX, -y * per - at.shiftY];
}

/**
 * The pieces of each cell along an axis: length, and the cells of the screen on the way in and on the way out, -1 beyond.
 * @param {number[]} edges @param {number} wayIn @param {number} wayOut
 * @returns {[number, number, number][][]}
 */
function pieces(edges, wayIn, wayOut) {
  const cells = edges.length - 1;
  const side = data.side;
  /** @param {number} at */
  const above = (at) => (at >= 0 && at < side * cells ? Math.min(Math.floor(at / side), cells - 1) : -1);
  return Array.from({ length: cells }, (_, cell) => {
    const [from, to] = [edges[cell], edges[cell + 1]];
    const cuts = [from, to];
    for (const way of [wayIn, wayOut]) {
      for (let i = Math.ceil((from + way) / side); i <= Math.floor((to + way) / side); i++) {
        cuts.push(Math.min(Math.max(i * side - way, from), to));
      }
    }
    cuts.sort((a, b) => a - b);
    /** @type {[number, number, number][]} */
    const out = [];
    for (let i = 1; i < cuts.length; i++) {
      const long = cuts[i] - cuts[i - 1];
      const middle = 0.5 * (cuts[i] + cuts[i - 1]);
      if (long > 1e-12) out.push([long, above(middle + wayIn), above(middle + wayOut)]);
    }
    return out;
  });
}

/**
 * The weight of each stack in each pixel.
 * @param {Uint8Array} values @param {State} at @param {Vector} light @param {Vector} eye
 */
function seen(values, at, light, eye) {
  const [a, b] = [crossing(light, at), crossing(eye, at)];
  const columns = pieces(data.edges[0], a[0], b[0]);
  const rows = pieces(data.edges[1], a[1], b[1]);
  const across = data.cells[0];
  const passes = data.passes;
  /** @param {number} x @param {number} y */
  const through = (x, y) => passes[x < 0 || y < 0 ? 0 : values[y * across + x]];
  const [width, height] = data.pixels;
  const tile = data.tile;
  const weights = new Float32Array(width * height * count);
  for (let y = 0; y < height; y++) {
    const top = data.margin + y * tile;
    const tall = data.edges[1][top + tile] - data.edges[1][top];
    for (let x = 0; x < width; x++) {
      const left = data.margin + x * tile;
      const area = tall * (data.edges[0][left + tile] - data.edges[0][left]);
      const out = (y * width + x) * count;
      for (let t = 0; t < tile * tile; t++) {
        let sum = 0;
        for (const [long, inY, outY] of rows[top + Math.floor(t / tile)]) {
          for (const [wide, inX, outX] of columns[left + (t % tile)]) {
            sum += long * wide * through(inX, inY) * through(outX, outY);
          }
        }
        weights[out + data.order[t]] += sum / area;
      }
    }
  }
  return weights;
}

/** The stacks' reflectance at the half angle between two directions. @param {Float32Array} curves @param {Vector} light @param {Vector} eye */
function reflected(curves, light, eye) {
  const sum = light.map((v, c) => v + eye[c]);
  const angle = Math.acos(Math.min(1, sum[2] / Math.hypot(...sum)));
  const place = ((2 * Math.sin(angle / 2)) / Math.SQRT2) * (data.steps - 1);
  const below = Math.min(Math.floor(place), data.steps - 2);
  const part = place - below;
  return Array.from({ length: count }, (_, q) =>
    [0, 1, 2].map((c) => {
      const at = (q * data.steps + below) * 3 + c;
      return curves[at] + part * (curves[at + 3] - curves[at]);
    }));
}

/** @param {number} v */
const bent = (v) => (v <= KNEE ? v : KNEE + ((1 - KNEE) * (v - KNEE)) / (v - KNEE + 1 - KNEE));
/** @param {number} v */
const coded = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);

// ---- state and controls ----

/** @returns {State} */
const initial = () => ({
  lightX: -20, lightY: 0, eyeX: 0, eyeY: 0, shiftX: data.placed.shift[0], shiftY: data.placed.shift[1],
  depth: data.placed.depth, speed: 2,
});

const state = initial();
let frame = 0;
/** @type {Uint8Array[]} */
let values = [];
let curves = new Float32Array();
let asked = false;

/** As far as a tile. */
const reach = Math.round(data.side * data.tile * 100) / 100;
/** @type {[keyof State, string, string, number, number, number, string][]} name, where, label, least, most, step, unit */
const SLIDERS = [
  ['speed', 'playing', 'speed', 0.5, 12, 0.5, ' /s'],
  ['lightX', 'directions', 'light across', -80, 80, 1, '°'],
  ['lightY', 'directions', 'light up', -80, 80, 1, '°'],
  ['eyeX', 'directions', 'eye across', -80, 80, 1, '°'],
  ['eyeY', 'directions', 'eye up', -80, 80, 1, '°'],
  ['shiftX', 'placing', 'right by', -reach, reach, 0.01, ' mm'],
  ['shiftY', 'placing', 'down by', -reach, reach, 0.01, ' mm'],
  ['depth', 'placing', 'depth', 0, 3, 0.01, ' mm'],
];

for (const [name, where, label, least, most, step] of SLIDERS) {
  const row = document.createElement('label');
  row.className = 'slider';
  const title = document.createElement('span');
  title.textContent = label;
  const input = document.createElement('input');
  Object.assign(input, { type: 'range', min: String(least), max: String(most), step: String(step), id: name });
  const output = document.createElement('output');
  input.addEventListener('input', () => {
    state[name] = Number(input.value);
    update();
  });
  row.append(title, input, output);
  byId(where).append(row);
}

function update() {
  for (const [name, , , , , step, unit] of SLIDERS) {
    const input = /** @type {HTMLInputElement} */ (byId(name));
    input.value = String(state[name]);
    const digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
    const output = input.nextElementSibling;
    if (output) output.textContent = state[name].toFixed(digits).replace('-', '−') + unit;
  }
  if (!asked) {
    asked = true;
    requestAnimationFrame(draw);
  }
}

function draw() {
  asked = false;
  const [light, eye] = [direction(state.lightX, state.lightY), direction(state.eyeX, state.eyeY)];
  const weights = seen(values[frame], state, light, eye);
  const colour = reflected(curves, light, eye);
  const adapted = /** @type {HTMLInputElement} */ (byId('adapted')).checked;
  const gain = data.white * Math.max(0, light[2]) * (adapted ? 1 / data.brightness : 1);
  const [width, height] = data.pixels;
  const picture = new ImageData(width, height);
  const rgb = [0, 0, 0];
  for (let i = 0; i < width * height; i++) {
    for (let c = 0; c < 3; c++) {
      let sum = 0;
      for (let q = 0; q < count; q++) sum += weights[i * count + q] * colour[q][c];
      rgb[c] = sum * gain;
    }
    const most = Math.max(rgb[0], rgb[1], rgb[2]);
    const together = most > KNEE ? bent(most) / most : 1;
    for (let c = 0; c < 3; c++) {
      const shown = most > KNEE ? 0.5 * (rgb[c] * together + bent(rgb[c])) : rgb[c];
      picture.data[4 * i + c] = 255 * coded(Math.min(1, shown));
    }
    picture.data[4 * i + 3] = 255;
  }
  put('seen', picture, 900);
  drawMask();
}

/** Puts a picture on a canvas, each of its pixels as large as the width allows. @param {string} id @param {ImageData} picture @param {number} most */
function put(id, picture, most) {
  const canvas = /** @type {HTMLCanvasElement} */ (byId(id));
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    [canvas.width, canvas.height] = [picture.width, picture.height];
    canvas.style.width = `min(100%, ${most}px, calc(${(picture.width / picture.height).toFixed(4)} * var(--tall)))`;
  }
  canvas.getContext('2d')?.putImageData(picture, 0, 0);
}

let masked = -1;
function drawMask() {
  if (masked === frame) return;
  masked = frame;
  const picture = new ImageData(data.cells[0], data.cells[1]);
  values[frame].forEach((value, i) => picture.data.set([value, value, value, 255], 4 * i));
  put('mask', picture, 460);
  const distance = data.frames[frame].distance;
  byId('maskNote').textContent = distance === null ? 'to lay the screen in line with the print'
    : `average difference to the image d = ${distance.toFixed(3)}`;
  for (const [i, button] of [...byId('frames').children].entries()) {
    button.setAttribute('aria-checked', String(i === frame));
    if (button instanceof HTMLElement) button.tabIndex = i === frame ? 0 : -1;
  }
}

/** @param {number} to */
function show(to) {
  frame = (to + data.frames.length) % data.frames.length;
  update();
}

let timer = 0;
/** @param {boolean} on */
function play(on) {
  const button = byId('play');
  button.setAttribute('aria-pressed', String(on));
  button.textContent = on ? 'Pause' : 'Play';
  clearTimeout(timer);
  if (!on) return;
  const next = () => {
    // The last frame is the pattern to align by.
    show((frame + 1) % Math.max(1, data.frames.length - 1));
    timer = setTimeout(next, 1000 / state.speed);
  };
  timer = setTimeout(next, 1000 / state.speed);
}

/** @param {number} v */
const turned = (v) => Math.min(80, Math.max(-80, Math.round(v)));

function listen() {
  const canvas = byId('seen');
  /** @param {PointerEvent} event */
  const follow = (event) => {
    const box = canvas.getBoundingClientRect();
    state.lightX = turned(160 * ((event.clientX - box.left) / box.width - 0.5));
    state.lightY = turned(-160 * ((event.clientY - box.top) / box.height - 0.5));
    update();
  };
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    follow(event);
  });
  canvas.addEventListener('pointermove', (event) => {
    if (canvas.hasPointerCapture(event.pointerId)) follow(event);
  });
  canvas.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: [-2, 0], ArrowRight: [2, 0], ArrowUp: [0, 2], ArrowDown: [0, -2] }[event.key];
    if (!step) return;
    event.preventDefault();
    state.lightX = turned(state.lightX + step[0]);
    state.lightY = turned(state.lightY + step[1]);
    update();
  });
  byId('adapted').addEventListener('change', update);
  byId('play').addEventListener('click', () => play(byId('play').getAttribute('aria-pressed') !== 'true'));
  byId('reset').addEventListener('click', () => {
    play(false);
    Object.assign(state, initial());
    show(0);
  });
  byId('frames').addEventListener('keydown', (event) => {
    const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    show(frame + step);
    const button = byId('frames').children[frame];
    if (button instanceof HTMLElement) button.focus();
  });
}

async function start() {
  byId('name').textContent = data.name;
  byId('about').textContent = data.about;
  for (const [i, { name }] of data.frames.entries()) {
    const button = document.createElement('button');
    button.type = 'button';
    button.setAttribute('role', 'radio');
    button.textContent = name;
    button.addEventListener('click', () => show(i));
    byId('frames').append(button);
  }
  if (data.frames.length < 3) byId('play').hidden = byId('playing').hidden = true;
  for (const [q, name] of data.stacks.entries()) {
    const item = document.createElement('li');
    const chip = document.createElement('span');
    chip.className = 'chip';
    chip.style.background = `rgb(${data.colours[q].join(' ')})`;
    item.append(chip, name);
    byId('stacks').append(item);
  }
  curves = await unpackedFloats(data.curves);
  values = await Promise.all(data.frames.map((each) => unpacked(each.values)));
  listen();
  update();
}

start().catch((error) => {
  byId('message').hidden = false;
  byId('message').textContent = `The page cannot show this display: ${error instanceof Error ? error.message : error}`;
});
