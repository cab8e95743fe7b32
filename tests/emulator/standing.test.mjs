// A sheet that the loss of the supply tears: whoever comes next, and however, the next thing the printer sees is nInit.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, job, same, skip } from './bench.mjs';
import { printStored } from './frames.mjs';

const STATUS = 1, DEVICE_ID = 2;

/// A board that loses its supply in the middle of job 7, with another one in its store; the printer keeps what it has.
async function torn(cableOut) {
  let bench = new Bench({ work: 3_000 });
  await bench.connect('bulk');
  assert.equal((await bench.store(5, STREAMS, job('small.streams'), 'small')).state, 'stored');
  await bench.print(7, STREAMS, job('page.streams'), { until: () => bench.printer.taken.length > 9000 });
  const had = bench.printer.taken.length;
  bench = bench.restarted(false);
  if (cableOut) bench.printer.set('power', 0);
  await bench.connect('bulk');
  const { jobs } = await bench.hear(({ kind }) => kind === 'past');
  const standing = await bench.hear(({ kind }) => kind === 'standing');
  await bench.pass(100);
  if (cableOut) {
    bench.printer.set('power', 1);
    await bench.pass(100);
  }
  return { bench, had, jobs, standing };
}

const expected = () => job('small.rgl');
const WAYS = {
  'a job of the link, from a computer that knows nothing': (bench) => bench.print(9, RAW, expected()),
  'a plain job': async (bench) => {
    const { out } = bench.device.interfaces.find((one) => one.class === 7);
    await bench.until(bench.host.write(out, expected()), 10_000);
  },
  'a stored job': async (bench) => {
    await bench.say(printStored(77, 5));
  },
  'the button': (bench) => bench.board.press(100),
};

for (const [what, begin] of Object.entries(WAYS)) {
  for (const cableOut of [false, true]) {
    test(`${what} comes behind a reset${cableOut ? ', though the printer\u2019s cable was out at the start' : ''}`, { skip }, async () => {
      const { bench, had, jobs, standing } = await torn(cableOut);
      assert.deepEqual([jobs[0].job, jobs[0].state], [7, 'lost'], 'its owner is told');
      assert.deepEqual([standing.standing, standing.job], ['unknown', 7]);
      for (const question of [STATUS, DEVICE_ID]) assert.equal((await bench.ask(question)).answer, 'unsure');
      const { resets } = bench.printer;
      assert.equal(bench.printer.taken.length, had);
      await begin(bench);
      await bench.board.run(() => bench.printer.taken.length >= had + expected().length, 3000 * MS);
      same(bench.printer.taken.slice(had), expected());
      assert.equal(bench.printer.resets, resets + 1);
      const edges = bench.printer.edges.filter(({ line, level }) => level === 0 && (line === 'strobe' || line === 'init'));
      assert.equal(edges[0].line, 'init', 'before the first byte');
    });
  }
}

test('behind a whole sheet and a cut nothing is reset', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  assert.equal((await bench.print(3, RAW, expected())).state, 'done');
  // The end is noted within a look of the task at the store.
  await bench.pass(30);
  bench = bench.restarted(false);
  await bench.connect('bulk');
  const { standing } = await bench.hear(({ kind }) => kind === 'standing');
  assert.equal(standing, 'at rest');
  assert.equal((await bench.print(4, RAW, expected())).state, 'done');
  assert.equal(bench.printer.resets, 0);
  assert.notEqual((await bench.ask(STATUS)).answer, 'unsure');
});
