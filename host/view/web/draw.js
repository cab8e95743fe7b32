// The sheet drawn by WebGL2. One program draws all views; a split picture is drawn twice, each half by itself.

import { tiles } from './data.js';
import { seen } from './geometry.js';
import { field, tree } from './surroundings.js';
import { MOST_LIGHTS } from './state.js';

/** The neutral background of all pictures, sRGB. */
const GROUND = [52, 52, 52];
/** Nodes of the grid under a light probe: at rest, and while something moves. */
const NODES = { fine: 33, coarse: 9 };
/** The largest number of 16 bits: a sun may send more, and infinity has no colour. */
const MOST_HALF = 65504;
const MODES = { lit: 0, difference: 1, stacks: 2, passes: 3 };

const linear = (/** @type {number} */ v) => {
  const c = v / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
};

/**
 * @typedef {{ weights: WebGLTexture, curves: WebGLTexture, layer: import('./data.js').Layer,
 *   field: WebGLTexture | null, fieldKey: string }} OnCard
 */

export class Drawing {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {WebGL2RenderingContext} gl
   * @param {import('./data.js').Packed} data
   * @param {{ layers: Record<string, import('./data.js').Layer>, dots: Uint8Array, probe: Float32Array,
   *   difference: Uint8Array | null }} parts
   * @param {[string, string]} shaders
   */
  constructor(canvas, gl, data, parts, shaders) {
    this.canvas = canvas;
    this.gl = gl;
    this.data = data;
    this.program = program(gl, shaders);
    /** @type {Map<string, WebGLUniformLocation | null>} */
    this.places = new Map();
    this.probe = tree(data.probe.width, data.probe.height, parts.probe);
    gl.bindVertexArray(gl.createVertexArray());
    gl.useProgram(this.program);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    /** @type {Record<string, OnCard>} */
    this.layers = {};
    for (const [name, layer] of Object.entries(parts.layers)) this.layers[name] = this.#upload(layer);
    this.#uploadDots(parts.dots);
    this.#uploadDifference(parts.difference);
    this.empty = this.#texture(gl.TEXTURE_2D_ARRAY);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, 1, 1, 1);
  }

  /**
   * @param {GLenum} target
   * @param {GLenum} filter between texels
   * @param {GLenum} least between texels and levels
   */
  #texture(target, filter = this.gl.NEAREST, least = filter) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(target, texture);
    gl.texParameteri(target, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(target, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, filter);
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, least);
    return texture;
  }

  /**
   * @param {import('./data.js').Layer} layer
   * @returns {OnCard}
   */
  #upload(layer) {
    const { gl, data: { steps } } = this;
    const groups = Math.ceil(layer.channels / 4);
    const weights = this.#texture(gl.TEXTURE_2D_ARRAY, gl.LINEAR, gl.LINEAR_MIPMAP_LINEAR);
    const [first] = layer.levels;
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, layer.levels.length, gl.RGBA8, first.width, first.height, groups);
    layer.levels.forEach(({ width, height, data }, level) =>
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, level, 0, 0, 0, width, height, groups, gl.RGBA, gl.UNSIGNED_BYTE, data));
    const curves = this.#texture(gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, steps, layer.channels);
    this.#uploadCurves(layer);
    return { weights, curves, layer, field: null, fieldKey: '' };
  }

  /**
   * Writes the curves of a layer to the texture that is bound.
   * @param {import('./data.js').Layer} layer
   */
  #uploadCurves(layer) {
    const { gl, data: { steps } } = this;
    const texels = new Float32Array(layer.channels * steps * 4);
    for (let i = 0; i < layer.channels * steps; i++) texels.set(layer.curves.subarray(3 * i, 3 * i + 3), 4 * i);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, steps, layer.channels, gl.RGBA, gl.FLOAT, texels);
  }

  /**
   * Takes the curves of a layer again after they have changed.
   * @param {string} name
   */
  recurve(name) {
    const on = this.layers[name];
    if (!on) return;
    this.gl.activeTexture(this.gl.TEXTURE0);
    this.gl.bindTexture(this.gl.TEXTURE_2D, on.curves);
    this.#uploadCurves(on.layer);
    on.fieldKey = '';
  }

  /** @param {Uint8Array} dots */
  #uploadDots(dots) {
    const { gl, data: { printed } } = this;
    this.tile = Math.min(2048, gl.getParameter(gl.MAX_TEXTURE_SIZE), Math.max(printed.width, printed.length));
    const { data, count } = tiles(dots, printed.width, printed.length, this.tile);
    this.dots = this.#texture(gl.TEXTURE_2D_ARRAY);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.R8UI, this.tile, this.tile, count);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, 0, this.tile, this.tile, count, gl.RED_INTEGER, gl.UNSIGNED_BYTE, data);
    const stacks = printed.names.length;
    this.colours = this.#texture(gl.TEXTURE_2D);
    const colours = new Float32Array(printed.colours.flatMap((rgb) => [...rgb.map(linear), 1]));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, stacks, 1, 0, gl.RGBA, gl.FLOAT, colours);
    this.passes = this.#texture(gl.TEXTURE_2D);
    const bits = Uint16Array.from(printed.bits);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16UI, stacks, 1, 0, gl.RED_INTEGER, gl.UNSIGNED_SHORT, bits);
  }

  /** @param {Uint8Array | null} bytes */
  #uploadDifference(bytes) {
    const { gl, data: { difference } } = this;
    this.difference = this.#texture(gl.TEXTURE_2D, gl.LINEAR);
    const [width, height] = difference ? [difference.width, difference.height] : [1, 1];
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, bytes ?? new Uint8Array(1));
  }

  /** @param {string} name */
  #place(name) {
    if (!this.places.has(name)) this.places.set(name, this.gl.getUniformLocation(this.program, name));
    return this.places.get(name) ?? null;
  }

  /**
   * @param {import('./state.js').State} state
   * @param {boolean} coarse whether something moves
   */
  draw(state, coarse) {
    const { gl, canvas, data } = this;
    const { width, height } = canvas;
    const scene = seen(state, data.size, width, height);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.SCISSOR_TEST);
    gl.uniform2f(this.#place('picture'), width, height);
    for (const name of /** @type {const} */ (['corner', 'right', 'up', 'towards', 'eye'])) {
      gl.uniform3fv(this.#place(name), scene[name]);
    }
    gl.uniform1i(this.#place('near'), Number(scene.near));
    gl.uniform1f(this.#place('curl'), scene.curl);
    gl.uniform2fv(this.#place('sheet'), data.size);
    const lights = new Float32Array(4 * MOST_LIGHTS);
    scene.lights.forEach((light, i) => lights.set(light, 4 * i));
    gl.uniform1i(this.#place('lights'), scene.lights.length);
    gl.uniform4fv(this.#place('light'), lights);
    gl.uniform1f(this.#place('exposure'), data.white * 2 ** state.exposure);
    gl.uniform1f(this.#place('knee'), state.knee);
    gl.uniform3fv(this.#place('ground'), GROUND.map(linear));
    gl.uniform2i(this.#place('dotSize'), data.printed.width, data.printed.length);
    gl.uniform1i(this.#place('tile'), this.tile ?? 1);
    gl.uniform1i(this.#place('steps'), data.steps);
    gl.uniform1ui(this.#place('pass'), 1 << state.pass);
    const ink = data.printed.passes[state.pass];
    gl.uniform3fv(this.#place('passColour'), (ink ? ink.colour : [0, 0, 0]).map(linear));
    const middle = Math.round(state.split * width);
    if (state.with) {
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(0, 0, middle, height);
      this.#half(state.show, state, coarse);
      gl.scissor(middle, 0, width - middle, height);
      this.#half(state.with, state, coarse);
    } else {
      this.#half(state.show, state, coarse);
    }
  }

  /** Waits until the card has drawn all that it was told to. */
  done() {
    const { gl } = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return new Promise((/** @type {(value: void) => void} */ resolve) => {
      const ask = () => {
        if (!fence || gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED) {
          gl.deleteSync(fence);
          resolve();
        } else setTimeout(ask, 2);
      };
      setTimeout(ask);
    });
  }

  /**
   * @param {string} show
   * @param {import('./state.js').State} state
   * @param {boolean} coarse
   */
  #half(show, state, coarse) {
    const { gl } = this;
    const mode = show in this.layers ? MODES.lit : MODES[/** @type {keyof typeof MODES} */ (show)];
    const layer = this.layers[show] ?? this.layers.printed;
    const [first] = layer.layer.levels;
    const surrounded = mode === MODES.lit && state.probe;
    if (surrounded) this.#surround(layer, state, coarse);
    gl.uniform1i(this.#place('mode'), mode);
    gl.uniform1i(this.#place('surrounded'), Number(surrounded));
    gl.uniform1i(this.#place('hasDots'), Number(layer === this.layers.printed));
    gl.uniform2i(this.#place('mapSize'), first.width, first.height);
    gl.uniform1i(this.#place('channels'), layer.layer.channels);
    const array = gl.TEXTURE_2D_ARRAY;
    /** @type {[string, GLenum, WebGLTexture | null | undefined][]} */
    const bound = [
      ['weights', array, layer.weights], ['curves', gl.TEXTURE_2D, layer.curves],
      ['field', array, surrounded ? layer.field : this.empty], ['dots', array, this.dots],
      ['colours', gl.TEXTURE_2D, this.colours], ['difference', gl.TEXTURE_2D, this.difference],
      ['passes', gl.TEXTURE_2D, this.passes],
    ];
    bound.forEach(([name, target, texture], i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(target, texture ?? null);
      gl.uniform1i(this.#place(name), i);
    });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /**
   * Light from all around depends on how the sheet is held and seen, and on nothing else.
   * @param {OnCard} on
   * @param {import('./state.js').State} state
   * @param {boolean} coarse
   */
  #surround(on, state, coarse) {
    const { gl, data } = this;
    const still = state.curl === 0 && state.distance === 0;
    const side = still ? 2 : coarse ? NODES.coarse : NODES.fine;
    const held = [state.view, state.distance, state.turn, state.tip, state.curl].join();
    if (on.fieldKey === `${held} ${NODES.fine}` || on.fieldKey === `${held} ${side}`) return;
    on.fieldKey = `${held} ${side}`;
    if (on.field) gl.deleteTexture(on.field);
    const values = field(this.probe, state, data.size, on.layer.curves, data.steps, side).map((v) => Math.min(v, MOST_HALF));
    gl.activeTexture(gl.TEXTURE0);
    on.field = this.#texture(gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, side, side, on.layer.channels);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, 0, side, side, on.layer.channels, gl.RGBA, gl.FLOAT, values);
  }
}

/**
 * @param {WebGL2RenderingContext} gl
 * @param {[string, string]} shaders
 */
function program(gl, shaders) {
  const made = gl.createProgram();
  [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, i) => {
    const shader = gl.createShader(kind);
    if (!shader) throw new Error('the graphics card refuses a shader');
    gl.shaderSource(shader, shaders[i]);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? 'shader');
    gl.attachShader(made, shader);
  });
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? 'program');
  return made;
}
