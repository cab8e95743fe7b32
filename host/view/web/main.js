// The page: reads the data, unpacks it and draws.

import './hand.js';
import { rechoose } from './controls.js';
import { layer, stackWeights, unpacked, unpackedFloats } from './data.js';
import { Drawing } from './draw.js';
import { build } from './panel.js';
import { byId, canvas, data, drawn, eachFrame, faceTheEye, limits, redraw, stage, state } from './stage.js';
import { read } from './state.js';

/** How near to its edge an address may show the sheet: the program's limit. */
const EDGE = 1e-3;

/** @param {string} text */
function tellOver(text) {
  const message = byId('message');
  message.textContent = text;
  message.hidden = false;
}

/**
 * Says why nothing can be moved, and takes away what would do nothing.
 * @param {string} text
 */
function say(text) {
  document.body.classList.add('still');
  stage.classList.remove('ready');
  tellOver(text);
}

async function start() {
  build();
  read(data.start, state, limits);
  read(location.hash, state, limits);
  faceTheEye(EDGE);
  rechoose();
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });
  if (!gl || typeof DecompressionStream === 'undefined') {
    say('This browser has no WebGL2, so the light cannot be moved here. The picture shows the sheet under one light.');
    return;
  }
  const [dots, probe, difference, document_, mapped] = await Promise.all([
    unpacked(data.printed.dots), unpackedFloats(data.probe.texels), data.difference ? unpacked(data.difference.bytes) : null,
    data.document && layer(data.document), data.mapped && layer(data.mapped),
  ]);
  const layers = { printed: await stackWeights(data.printed, dots), ...(document_ && { document: document_ }), ...(mapped && { mapped }) };
  /** @type {[string, string]} */
  const shaders = [byId('vertex').textContent ?? '', byId('fragment').textContent ?? ''];
  const make = () => new Drawing(canvas, gl, data, { layers, dots, probe, difference }, shaders);
  Object.assign(drawn, { drawing: make(), layers, dots });
  canvas.addEventListener('webglcontextlost', (event) => {
    event.preventDefault();
    drawn.drawing = null;
    stage.classList.remove('ready');
    tellOver('The graphics card is gone for a while. Until it is back, the picture shows the sheet under one light.');
  });
  canvas.addEventListener('webglcontextrestored', () => {
    drawn.drawing = make();
    byId('message').hidden = true;
    redraw(false);
  });
  eachFrame.after.push(() => stage.classList.add('ready'));
  // It is told of the size at first, too.
  new ResizeObserver(() => redraw(false)).observe(canvas);
  addEventListener('hashchange', (event) => {
    // What an address leaves out when there is none of it.
    Object.assign(state, { with: '', edits: {} });
    // The page may have written its own address since.
    read(new URL(event.newURL).hash, state, limits);
    faceTheEye(EDGE);
    rechoose();
    redraw(false);
  });
}

start().catch((/** @type {Error} */ error) => say(`The page cannot draw: ${error.message}. The picture shows the sheet under one light.`));
