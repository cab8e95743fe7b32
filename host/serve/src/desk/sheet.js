// The sheet: what would be printed, on its ground, as large as one likes. What lies on it is moved and made larger here.
// Lengths are millimetres of the sheet; the server draws the area that is in sight, in dots.

import { at, attempt, element, picture } from "./ask.js";

const stage = at("stage"), paper = at("paper"), piece = at("piece"), preview = at("preview");
let plan = null, zoom = 1, shown = 0, is_drawing = false, moved = () => {};
/** What lies on the sheet: left, top, width, length; and whether it is being moved. */
let lies = null, is_held = false, tells = 0;

/** Pixels of a millimetre. */
const scale = () => paper.clientWidth / plan.sheet.mm[0];
const percent = (part, whole) => `${(100 * part) / whole}%`;

function place(one, [left, top, width, length]) {
  const [across, down] = plan.sheet.mm;
  Object.assign(one.style, {
    left: percent(left, across), top: percent(top, down), width: percent(width, across), height: percent(length, down),
  });
}

/** The sheet as large as it goes into the stage, times the zoom. */
function lay() {
  const [width, length] = plan.sheet.mm;
  const most = Math.min(stage.clientWidth, (stage.clientHeight * width) / length);
  paper.style.width = `${most * zoom}px`;
  paper.style.height = `${(most * zoom * length) / width}px`;
  paper.style.background = { paper: "#fcfcfa", clear: "#cdd6de" }[at("ground").value] ?? at("ground").value;
  paper.classList.toggle("mirrored", at("mirrored").checked);
  piece.hidden = !lies;
  if (lies) place(piece, lies);
}

/** Asks for a picture of what is in sight, unless it is being drawn. */
async function look() {
  if (!plan || is_drawing) return;
  const turn = ++shown, [left, top, width, length] = plan.sheet.printable_mm;
  const dots = plan.sheet.dots[0] / width, px = scale();
  const sight = paper.getBoundingClientRect(), window = stage.getBoundingClientRect();
  const within = (from, to, start, side) => {
    const first = Math.max(0, Math.min(side, from / px - start)), last = Math.max(0, Math.min(side, to / px - start));
    return [Math.floor(first * dots), Math.ceil(last * dots)];
  };
  let x = [window.left - sight.left, window.right - sight.left];
  if (at("mirrored").checked) x = [sight.width - x[1], sight.width - x[0]];
  const [fromX, toX] = within(x[0], x[1], left, width);
  const [fromY, toY] = within(window.top - sight.top, window.bottom - sight.top, top, length);
  if (toX <= fromX || toY <= fromY) return;
  const without = [...at("inks").querySelectorAll("input:not(:checked)")].map((one) => one.value).join(",");
  const pixels = Math.ceil((Math.max(toX - fromX, toY - fromY) / dots) * px * devicePixelRatio);
  const url = await picture("/desk/preview.png", {
    job: plan.job, page: plan.page, ground: at("ground").value, without,
    left: fromX, top: fromY, width: toX - fromX, length: toY - fromY, longest: pixels,
  });
  if (turn !== shown) return URL.revokeObjectURL(url);
  URL.revokeObjectURL(preview.src);
  preview.src = url;
  place(preview, [left + fromX / dots, top + fromY / dots, (toX - fromX) / dots, (toY - fromY) / dots]);
}

let waits = 0;
/** Looks once nothing has changed for a moment. */
function soon(wait = 120) {
  clearTimeout(waits);
  waits = setTimeout(() => attempt(look), wait);
}

/** Zooms so that what is in the middle stays there. */
function zoomTo(to) {
  if (!plan) return;
  const middle = (from, side, all) => (from + side / 2) / all;
  const x = middle(stage.scrollLeft, stage.clientWidth, stage.scrollWidth);
  const y = middle(stage.scrollTop, stage.clientHeight, stage.scrollHeight);
  zoom = Math.min(64, Math.max(1, to));
  lay();
  stage.scrollLeft = x * stage.scrollWidth - stage.clientWidth / 2;
  stage.scrollTop = y * stage.scrollHeight - stage.clientHeight / 2;
  soon();
}

/** What lies on the sheet goes there at once, before it is drawn there. */
export function put(left, top, width) {
  if (!lies || ![left, top, width].every(Number.isFinite) || width <= 0) return;
  lies = [left, top, width, (lies[3] * width) / lies[2]];
  place(piece, lies);
}

/** What is shown is being drawn anew. */
export function draws() {
  is_drawing = true;
}

/** Shows a plan. `change` is told where its page is moved to; one that is old does not say where it lies. */
export function show(new_plan, change, is_old) {
  const is_other = plan?.job !== new_plan.job;
  [plan, moved, is_drawing] = [new_plan, change, false];
  if (is_other || !(is_held || tells || is_old)) lies = new_plan.is_drawn ? new_plan.lies_mm : null;
  if (is_other) zoom = 1;
  const off = new Set([...at("inks").querySelectorAll("input:not(:checked)")].map((one) => one.value));
  const inks = [...new Map(plan.passes.map((pass) => [pass.ink, pass.colour]))];
  at("inks").replaceChildren(at("inks").firstElementChild, ...inks.map(([ink, colour]) => {
    const box = element("input", { type: "checkbox", value: ink, checked: is_other || !off.has(ink) });
    box.addEventListener("change", () => soon(0));
    return element("label", {}, box, " ", swatch(colour), ` ${ink}`);
  }));
  at("pager").hidden = plan.sheets < 2;
  at("page").textContent = `${plan.page} of ${plan.sheets}`;
  [at("before").disabled, at("after").disabled] = [plan.page <= 1, plan.page >= plan.sheets];
  lay();
  return look();
}

export function hide() {
  plan = null;
  shown += 1;
  URL.revokeObjectURL(preview.src);
  preview.removeAttribute("src");
}

export function swatch(colour) {
  const made = element("span", { className: "swatch" });
  made.style.background = colour === "none" ? "transparent" : colour;
  return made;
}

/** A drag of the piece, or of its corner. */
function drag(event) {
  if (!lies || event.button > 0) return;
  event.preventDefault();
  const is_corner = event.target === at("corner"), from = [event.clientX, event.clientY], was = [...lies];
  const flip = at("mirrored").checked ? -1 : 1;
  piece.setPointerCapture(event.pointerId);
  is_held = true;
  const go = ({ clientX, clientY }) => {
    const dx = (flip * (clientX - from[0])) / scale(), dy = (clientY - from[1]) / scale();
    const width = Math.max(1, was[2] + dx);
    lies = is_corner ? [was[0], was[1], width, (was[3] * width) / was[2]] : [was[0] + dx, was[1] + dy, was[2], was[3]];
    place(piece, lies);
  };
  const end = () => {
    piece.removeEventListener("pointermove", go);
    is_held = false;
    if (lies.some((side, index) => side !== was[index])) tell(is_corner);
  };
  piece.addEventListener("pointermove", go);
  piece.addEventListener("lostpointercapture", end, { once: true });
}

function tell(is_wider) {
  tells = 0;
  const [left, top, width] = lies.map((side) => side.toFixed(2));
  moved({ at: `${left},${top}`, ...(is_wider ? { wide: width } : {}) });
}

piece.addEventListener("pointerdown", drag);
stage.addEventListener("keydown", (event) => {
  const step = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
  const by = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
  if (event.key === "+" || event.key === "-") zoomTo(event.key === "+" ? zoom * 1.5 : zoom / 1.5);
  else if (by && lies) {
    lies = [lies[0] + by[0], lies[1] + by[1], lies[2], lies[3]];
    place(piece, lies);
    clearTimeout(tells);
    tells = setTimeout(() => tell(false), 500);
  } else return;
  event.preventDefault();
});
stage.addEventListener("scroll", () => soon());
at("closer").addEventListener("click", () => zoomTo(zoom * 1.5));
at("farther").addEventListener("click", () => zoomTo(zoom / 1.5));
// Four pixels a dot.
at("dots").addEventListener("click", () => {
  const fit = paper.clientWidth / zoom, [, , width] = plan.sheet.printable_mm;
  zoomTo((4 * plan.sheet.dots[0] * plan.sheet.mm[0]) / width / fit);
});
for (const id of ["ground", "mirrored"]) {
  at(id).addEventListener("change", () => {
    if (!plan) return;
    lay();
    soon(0);
  });
}
new ResizeObserver(() => {
  if (!plan) return;
  lay();
  soon();
}).observe(stage);
