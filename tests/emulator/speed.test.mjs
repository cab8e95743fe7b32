// How fast it is, in the board's own time. The limits are reckoned from the timing asked for and the printer's, not from
// what the program at the port happens to do.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, job, legal, random, same, skip } from './bench.mjs';
import { data } from './frames.mjs';

// The default timing: data before the strobe, the strobe, data behind it.
const [SETUP, STROBE, HOLD] = [800, 800, 800];
const PIECE = 900;

/// Nanoseconds a byte takes at least: the data may change when the printer is no longer busy and the hold time is over.
const port = ({ busyAfter, work, ack }) => Math.max(STROBE + HOLD, busyAfter + work + ack) + SETUP;

/// Nanoseconds a byte takes on the bus at 12 Mbit/s in packets of 64, with 21 bytes' time around each, in frames.
const bus = () => (data(3, 100_000, new Uint8Array(PIECE)).length / PIECE) * ((64 + 21) * 8 * 1000) / 12 / 64;

const MODEL = { busyAfter: 300, work: 1000, ack: 500 };
const QUICK = { busyAfter: 200, work: 400, ack: 400 };

const strobes = (printer) => printer.edges.filter(({ line, level }) => line === 'strobe' && level === 0).map(({ at }) => at);

for (const [what, settings] of [['the model printer', MODEL], ['a printer that is quicker than the timing', QUICK]]) {
  for (const way of ['serial', 'bulk']) {
    test(`100 kB go to ${what} over ${way} at nine tenths of what port and bus allow`, { skip }, async (t) => {
      const pick = random(1);
      // In no language, so passed through as it is.
      const bytes = Uint8Array.from({ length: 102_400 }, (_, i) => (i === 0 ? 0x41 : pick(256)));
      const bench = new Bench(settings);
      await bench.connect(way);
      // The board first leads the printer out of a conversation that it may be in.
      await bench.pass(50);
      const start = bench.board.now;
      assert.equal((await bench.print(7, RAW, bytes, { piece: PIECE })).state, 'done');
      const took = bench.board.now - start;
      same(bench.printer.taken, bytes);
      legal(bench.printer);
      const least = Math.max(port(settings), bus());
      const share = (bytes.length * least) / took;
      t.diagnostic(`${((bytes.length / took) * 1e6).toFixed(0)} kB/s from the first frame to the last answer, ${(100 * share).toFixed(1)} % of ${(1e6 / least).toFixed(0)} kB/s (port ${port(settings)} ns a byte, bus ${bus().toFixed(0)} ns)`);
      assert.ok(share >= 0.9);
    });
  }
}

const ROWS = { clusters: 256, placed: 260, cells: 256, 'small-clusters': 340, 'small-cells': 340 };

for (const [name, what, settings] of [['clusters', 'the model printer', MODEL], ...Object.keys(ROWS).map((name) => [name, 'a printer that is quicker than the timing', QUICK])]) {
  test(`decoding ${name} keeps the port at work with ${what}`, { skip }, async (t) => {
    const expected = job(`${name}.rgl`), streams = job(`${name}.streams`);
    const bench = new Bench(settings);
    await bench.connect('bulk');
    const before = bench.board.cycles;
    assert.equal((await bench.print(1, STREAMS, streams)).state, 'done');
    same(bench.printer.taken, expected);
    legal(bench.printer);
    const at = strobes(bench.printer);
    const busy = ((at.length - 1) * port(settings)) / (at.at(-1) - at[0]);
    const perDot = (bench.board.cycles - before) / (2 * 4800 * ROWS[name]);
    t.diagnostic(`${((at.at(-1) - at[0]) / (at.length - 1)).toFixed(0)} ns a byte, the port at work ${(100 * busy).toFixed(1)} % of the time; ${perDot.toFixed(1)} cycles a dot, all included`);
    assert.ok(busy >= 0.9);
  });
}

const ASKED = [['serial', RAW, 'page', 'rgl'], ['bulk', RAW, 'page', 'rgl'], ['bulk', STREAMS, 'clusters', 'streams'], ['bulk', STREAMS, 'cells', 'streams'], ['bulk', STREAMS, 'page', 'streams']];

for (const [way, kind, name, end] of ASKED) {
  test(`how the printer is, is answered within 5 ms while ${name}.${end} goes out over ${way}`, { skip }, async (t) => {
    const bench = new Bench(MODEL);
    await bench.connect(way);
    const asking = [];
    assert.equal((await bench.print(3, kind, job(`${name}.${end}`), { piece: PIECE, asking })).state, 'done');
    same(bench.printer.taken, job(`${name}.rgl`));
    asking.sort((a, b) => a - b);
    const ms = (part) => (asking[Math.floor((asking.length - 1) * part)] / MS).toFixed(2);
    t.diagnostic(`${asking.length} answers: half within ${ms(0.5)} ms, 95 % within ${ms(0.95)} ms, all within ${ms(1)} ms`);
    assert.ok(asking.length >= 20 && asking.at(-1) <= 5 * MS);
  });
}
