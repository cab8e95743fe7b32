// Where the eye, the lights and the sheet are: the same as `scene.rs`. Metres and radians; x right, y up, z to the eye.

/** @typedef {[number, number, number]} Vector */

/** @type {(a: Vector, b: Vector) => number} */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @type {(a: Vector, by: number) => Vector} */
export const scaled = (a, by) => [a[0] * by, a[1] * by, a[2] * by];

/** @type {(a: Vector, b: Vector) => Vector} */
export const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** @type {(a: Vector) => Vector} */
export const unit = (a) => scaled(a, 1 / Math.hypot(...a));

export const clamp = (/** @type {number} */ v, /** @type {number} */ low, /** @type {number} */ high) =>
  Math.min(Math.max(v, low), high);

const RADIANS = Math.PI / 180;

/**
 * The unit direction at an azimuth to the right and an elevation upwards, in degrees.
 * @param {number} azimuth
 * @param {number} elevation
 * @returns {Vector}
 */
export function direction(azimuth, elevation) {
  const [a, e] = [azimuth * RADIANS, elevation * RADIANS];
  return [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
}

/**
 * The sheet's axes in the world: turned about the upright axis, then tipped back, in degrees.
 * @param {number} turn
 * @param {number} tip
 * @returns {[Vector, Vector, Vector]}
 */
export function axes(turn, tip) {
  const [st, ct] = [Math.sin(turn * RADIANS), Math.cos(turn * RADIANS)];
  const [sp, cp] = [Math.sin(tip * RADIANS), Math.cos(tip * RADIANS)];
  return [[ct, -st * sp, -st * cp], [0, cp, -sp], [st, ct * sp, ct * cp]];
}

/** @type {(frame: [Vector, Vector, Vector], v: Vector) => Vector} */
export const intoSheet = (frame, v) => [dot(frame[0], v), dot(frame[1], v), dot(frame[2], v)];

/**
 * What the shader needs to know of a scene, in the axes of the sheet.
 * @param {import('./state.js').State} state
 * @param {[number, number]} size of the sheet in metres
 * @param {number} width of the picture in pixels
 * @param {number} height
 */
export function seen(state, size, width, height) {
  const frame = axes(state.turn, state.tip);
  const towards = direction(...state.view);
  const level = Math.hypot(towards[0], towards[2]);
  /** @type {Vector} */
  const right = level > 1e-9 ? [towards[2] / level, 0, -towards[0] / level] : [1, 0, 0];
  /** @type {Vector} */
  const up = [
    towards[1] * right[2] - towards[2] * right[1],
    towards[2] * right[0] - towards[0] * right[2],
    towards[0] * right[1] - towards[1] * right[0],
  ];
  const tall = windowHeight(size, width / height) / state.zoom;
  const pixel = tall / height;
  const [r, u] = [scaled(intoSheet(frame, right), pixel), scaled(intoSheet(frame, up), pixel)];
  const [left, top] = [state.pan[0] / pixel - width / 2, state.pan[1] / pixel + height / 2];
  const facing = intoSheet(frame, towards);
  return {
    right: r,
    up: u,
    pixel,
    towards: facing,
    near: state.distance > 0,
    eye: scaled(facing, state.distance),
    corner: plus(scaled(r, left), scaled(u, top)),
    curl: state.curl,
    lights: state.lights.map(({ azimuth, elevation, distance }) => {
      const l = intoSheet(frame, direction(azimuth, elevation));
      return distance > 0 ? [...scaled(l, distance), 1] : [...l, 0];
    }),
  };
}

/**
 * Metres across the height of a picture that shows a whole sheet with a margin.
 * @param {[number, number]} size
 * @param {number} aspect
 */
export const windowHeight = (size, aspect) => 1.08 * Math.max(size[1], size[0] / Math.max(aspect, 1e-3));

/**
 * Where a point of the picture lies on the sheet: metres right and up of its middle, or null beside it.
 * @param {ReturnType<typeof seen>} scene
 * @param {[number, number]} size
 * @param {number} x
 * @param {number} y
 * @returns {[number, number] | null}
 */
export function placeAt(scene, size, x, y) {
  const window = plus(plus(scene.corner, scaled(scene.right, x)), scaled(scene.up, -y));
  const o = scene.near ? scene.eye : window;
  const d = scene.near ? plus(window, scaled(scene.eye, -1)) : scaled(scene.towards, -1);
  let t = -o[2] / d[2];
  let s = o[0] + t * d[0];
  if (scene.curl > 0) {
    const r = scene.curl;
    const a = d[0] * d[0] + d[2] * d[2];
    const b = o[0] * d[0] + o[2] * d[2] + r * d[2];
    const c = o[0] * o[0] + o[2] * o[2] + 2 * o[2] * r;
    const root = Math.sqrt(b * b - a * c);
    t = b < 0 ? c / (root - b) : (-b - root) / a;
    s = r * Math.atan2(o[0] + t * d[0], o[2] + t * d[2] + r);
  }
  const y2 = o[1] + t * d[1];
  const inside = Number.isFinite(t) && (!scene.near || t > 0) && Math.abs(s) <= size[0] / 2 && Math.abs(y2) <= size[1] / 2;
  return inside ? [s, y2] : null;
}

/**
 * Where a point of the sheet lies in the picture, or null where it faces away or lies outside.
 * @param {ReturnType<typeof seen>} scene
 * @param {[number, number]} place metres right and up of the middle
 * @returns {[number, number] | null}
 */
export function pixelOf(scene, [s, y]) {
  const { curl: r, towards, eye, near, corner, right, up } = scene;
  /** @type {Vector} */
  const n = r > 0 ? [Math.sin(s / r), 0, Math.cos(s / r)] : [0, 0, 1];
  /** @type {Vector} */
  const at = r > 0 ? [r * n[0], y, r * (n[2] - 1)] : [s, y, 0];
  const fromEye = plus(at, scaled(eye, -1));
  if (near ? dot(n, fromEye) >= 0 : dot(n, towards) <= 0) return null;
  // Along the ray into the window, which goes through the middle of the sheet.
  const depth = near ? -dot(fromEye, towards) : 1;
  if (depth <= 0) return null;
  const inWindow = near ? plus(eye, scaled(fromEye, dot(eye, towards) / depth)) : at;
  const across = plus(inWindow, scaled(corner, -1));
  const square = scene.pixel * scene.pixel;
  return [dot(across, right) / square, -dot(across, up) / square];
}
