// What a spot of the sheet is made of, in words and as a chart.

import { editsWritten } from './edit.js';
import { pixelOf, placeAt, seen } from './geometry.js';
import { chart, distance, element, inWords, reflectance, shares, weightsAt } from './spot.js';
import { byId, canvas, data, drawn, eachFrame, state } from './stage.js';

/** The spot that was looked at: metres right and up of the middle. @type {[number, number] | null} */
let lookedAt = null;
/** The edits that its description shows. */
let described = '';

/** @type {(x: number, y: number) => void} */
export function look(x, y) {
  if (!drawn.drawing) return;
  lookedAt = placeAt(seen(state, data.size, canvas.clientWidth, canvas.clientHeight), data.size, x, y);
  describe();
  ring();
  const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const narrow = matchMedia('(max-width: 820px)').matches;
  byId('spot').scrollIntoView({ behavior: calm ? 'auto' : 'smooth', block: narrow ? 'start' : 'nearest' });
}

/** Marks the spot on the picture, wherever the sheet is by now. */
function ring() {
  const at = lookedAt && pixelOf(seen(state, data.size, canvas.clientWidth, canvas.clientHeight), lookedAt);
  const mark = byId('ring');
  mark.hidden = !at;
  if (at) [mark.style.left, mark.style.top] = at.map((v) => `${v}px`);
}

function describe() {
  const { layers, dots } = drawn;
  const spot = byId('spot');
  spot.replaceChildren(element('h2', {}, 'Spot'));
  described = editsWritten(state.edits);
  if (!lookedAt) {
    spot.append(element('p', { class: 'hint' }, 'Beside the sheet. Click or tap the sheet itself.'));
    return;
  }
  const spotAt = lookedAt;
  const subject = described ? 'edited document' : 'document';
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
    spot.append(element('p', { id: 'd' }, `Print and ${subject} differ by d = ${d.toFixed(3)}: ${inWords(d)}.`));
  }
  const captions = lines.map(({ name }) => element('span', { class: name }, name === 'print' ? '— print' : `- - ${subject}`));
  spot.append(element('p', { class: 'hint' }, 'Reflectance, 1/sr, over the half angle:'),
    element('figure', {}, chart(lines), element('figcaption', {}, ...captions)));
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

eachFrame.after.push((motion) => {
  ring();
  // Not while a slider moves: what is read aloud would be cut off again and again.
  if (lookedAt && !motion && described !== editsWritten(state.edits)) describe();
});
