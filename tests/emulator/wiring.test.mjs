// The wiring test's half in the firmware: every output drives its own pin, every input is read from its own, and nothing of
// it happens while a job is open.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, RAW, job, skip } from './bench.mjs';
import { probe } from './frames.mjs';
import { POSITIONS, Plug } from './plug.mjs';

const NAMES = ['data1', 'data2', 'data3', 'data4', 'data5', 'data6', 'data7', 'data8', 'strobe', 'autoFeed', 'init', 'selectIn'];

async function read(bench, levels) {
  const request = ++bench.requests;
  await bench.say(probe(request, levels & 255, levels >> 8));
  const { lines } = await bench.hear((heard) => heard.kind === 'lines' && heard.request === request);
  return lines;
}

for (const [position, wires] of Object.entries(POSITIONS)) {
  test(`through position ${position} of the loop-back plug every output comes back at its input`, { skip }, async () => {
    const bench = new Bench();
    bench.printer.set = () => {};
    const plug = new Plug(bench.board);
    await bench.connect('bulk');
    plug.move(position);
    for (const bit of NAMES.keys()) {
      for (const levels of [1 << bit, 0xfff & ~(1 << bit)]) {
        const expected = wires.reduce((inputs, name, i) => inputs | (((levels >> NAMES.indexOf(name)) & 1) << i), 0);
        assert.equal(await read(bench, levels), expected, `${NAMES[bit]} alone, ${levels.toString(2)}`);
      }
    }
  });
}

test('a probe shows the levels of its own moment, not those of the one before', { skip }, async () => {
  const bench = new Bench();
  bench.printer.set = () => {};
  const plug = new Plug(bench.board);
  await bench.connect('bulk');
  plug.move('1');
  for (let i = 0; i < 50; i++) assert.equal(await read(bench, i & 1 ? 0x700 : 0x71f), i & 1 ? 0 : 31);
});

test('while a job is open nothing is driven', { skip }, async () => {
  const bench = new Bench({ work: 20_000 });
  await bench.connect('bulk');
  const bytes = job('small.rgl');
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length > 500 });
  await bench.say(probe(1, 0xff, 0));
  const { kind, answer } = await bench.hear((heard) => heard.request === 1);
  assert.deepEqual([kind, answer], ['answer', 'not now']);
  assert.equal((await bench.print(3, RAW, bytes, { from: bench.progress.accepted })).state, 'done');
  assert.ok(Buffer.from(bench.printer.taken).equals(Buffer.from(bytes)));
});
