// What a spot of the sheet is made of, in words and as a chart.

import { placeAt, seen } from './geometry.js';
import { chart, distance, element, inWords, reflectance, shares, weightsAt } from './spot.js';
import { byId, canvas, data, drawn, state } from './stage.js';

/** @type {(x: number, y: number) => void} */
export function look(x, y) {
  const { drawing, layers, dots } = drawn;
  if (!drawing) return;
  const scene = seen(state, data.size, canvas.clientWidth, canvas.clientHeight);
  const spotAt = placeAt(scene, data.size, x, y);
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
