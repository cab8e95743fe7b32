// The board restarts in the middle of a sheet: what its memory keeps, and what the host is told when it has kept nothing.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, job, skip } from './bench.mjs';
import { configure, readLog } from './frames.mjs';

const same = (taken, expected) => {
  const at = expected.findIndex((byte, i) => byte !== taken[i]);
  assert.ok(taken.length === expected.length && at === -1, `${taken.length} bytes for ${expected.length}, first difference at ${at}`);
};

/// Connects and gives where the job stands.
async function standing(bench, number) {
  await bench.connect('bulk');
  return bench.hear(({ kind, job: heard }) => kind === 'progress' && heard === number);
}

for (const [what, kind, name] of [['raw job', RAW, 'small.rgl'], ['job of pass streams', STREAMS, 'small.streams']]) {
  test(`a ${what} goes on behind the last byte that crossed before a processor hung`, { skip }, async () => {
    const expected = job('small.rgl'), bytes = job(name);
    for (const after of [60, 700, 1024, 5000, 9500]) {
      let bench = new Bench();
      await bench.connect('bulk');
      await bench.print(3, kind, bytes, { until: () => bench.printer.taken.length >= after });
      bench.hang();
      // The strobe engine sends what it was given, and is silent long before the watchdog bites.
      await bench.pass(50);
      bench = bench.restarted();
      const { printed, accepted, state } = await standing(bench, 3);
      assert.deepEqual([printed, accepted, state], [bench.printer.taken.length, 0, 'printing']);
      assert.equal((await bench.print(3, kind, bytes)).state, 'done');
      same(bench.printer.taken, expected);
    }
  });
}

test('restarts again and again, wherever they come but in the microsecond of a strobe, cost nothing', { skip }, async () => {
  const expected = job('small.rgl');
  let bench = new Bench({ work: 12_000 });
  await bench.connect('bulk');
  for (let i = 1; i <= 7; i++) {
    await bench.print(3, RAW, expected, { until: () => bench.printer.taken.length >= i * 1400 });
    // Three microseconds behind a strobe: that byte has crossed, and the next one has to wait for the printer.
    const { board, printer } = bench;
    const had = printer.taken.length;
    while (printer.taken.length === had) board.step();
    const strobed = board.now;
    while (board.now < strobed + 3000) board.step();
    bench = bench.restarted();
    const { printed } = await standing(bench, 3);
    assert.equal(printed, bench.printer.taken.length);
  }
  assert.equal((await bench.print(3, RAW, expected)).state, 'done');
  same(bench.printer.taken, expected);
});

test('RUN pressed while bytes flow loses the job and says so; while none flow it costs nothing', { skip }, async () => {
  const expected = job('small.rgl');
  let bench = new Bench({ work: 12_000 });
  await bench.connect('bulk');
  // The host is slow: all whole commands that it has sent have crossed.
  await bench.print(3, RAW, expected, { until: (sent) => sent >= 1800 });
  await bench.pass(500);
  bench = bench.restarted(true, 0);
  assert.equal((await standing(bench, 3)).state, 'printing');
  await bench.print(3, RAW, expected, { until: () => bench.printer.taken.length >= 4000 });
  const { resets } = bench.printer;
  bench = bench.restarted(true, 0);
  assert.equal((await standing(bench, 3)).state, 'lost');
  await bench.pass(50);
  assert.equal(bench.printer.resets, resets + 1);
});

test('bytes that the processor sent itself are known too', { skip }, async () => {
  const expected = job('small.rgl');
  let bench = new Bench({ work: 20_000 });
  await bench.connect('bulk');
  const byHand = configure({ setup: 800, strobe: 800, hold: 800, settle: 500, handshake: 1 });
  await bench.say(byHand);
  await bench.print(3, RAW, expected, { until: () => bench.printer.taken.length >= 2500 });
  const { board, printer } = bench;
  const had = printer.taken.length;
  while (printer.taken.length < had + 7) board.step();
  const strobed = board.now;
  while (board.now < strobed + 12_000) board.step();
  bench = bench.restarted();
  assert.equal((await standing(bench, 3)).printed, bench.printer.taken.length);
  assert.equal((await bench.print(3, RAW, expected)).state, 'done');
  same(bench.printer.taken, expected);
});

test('a job that was over before stays over', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('small.rgl');
  assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
  await bench.pass(5);
  bench = bench.restarted();
  assert.equal((await standing(bench, 3)).state, 'done');
  assert.equal((await bench.print(4, RAW, bytes)).state, 'done');
  same(bench.printer.taken, Buffer.concat([bytes, bytes]));
});

test('a plain job that a restart cut in two is lost, and the printer is reset before the next one', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  const out = bench.device.interfaces.find((one) => one.class === 7).out;
  const bytes = job('small.rgl');
  await bench.until(bench.host.write(out, bytes.subarray(0, 6400)));
  await bench.board.run(() => bench.printer.taken.length > 2000, 500 * MS);
  bench.hang();
  await bench.pass(50);
  bench = bench.restarted();
  bench.printer.taken = [];
  const before = bench.printer.resets;
  assert.equal((await standing(bench, 0xffffffff)).state, 'lost');
  assert.equal((await bench.print(4, RAW, bytes)).state, 'done');
  assert.equal(bench.printer.resets, before + 1);
  same(bench.printer.taken, bytes);
});

test('without its memory the board says by its diary which sheet was lost', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('small.rgl');
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length >= 3000 });
  bench = bench.restarted(false);
  const { state, printed } = await standing(bench, 3);
  assert.deepEqual([state, printed], ['lost', 0]);
  // What stands in that memory after the supply was away is anything.
  bench = bench.restarted();
  for (let i = 0; i < bench.board.chip.sram.length; i++) bench.board.chip.sram[i] = (i * 73 + (i >> 7)) & 255;
  assert.equal((await standing(bench, 3)).state, 'lost');
});

test('the log is read from any byte on, says what is gone, and goes on after a restart', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  const read = async (from) => {
    const request = ++bench.requests;
    await bench.say(readLog(request, from));
    return bench.hear((heard) => heard.kind === 'log' && heard.request === request);
  };
  const all = async () => {
    const bytes = [];
    let { from: start, ...piece } = await read(0);
    for (let at = start; ; piece = await read(at)) {
      if (at !== start) assert.equal(piece.from, at);
      bytes.push(...piece.bytes);
      at += piece.bytes.length;
      if (at === piece.end) return { start, bytes, end: at };
    }
  };
  const first = await all();
  assert.equal(first.start, 0);
  // defmt's frames end with a zero, and there is one at least: that of the start.
  assert.equal(first.bytes.at(-1), 0);
  assert.deepEqual([...(await read(5)).bytes], first.bytes.slice(5));
  assert.equal((await read(first.end)).bytes.length, 0);
  bench = bench.restarted();
  await bench.connect('bulk');
  const second = await all();
  assert.deepEqual(second.bytes.slice(0, first.end), first.bytes);
  assert.ok(second.end > first.end);
  // Jobs are told of, and at last the beginning is written over.
  const bytes = job('small.rgl').subarray(0, 2000);
  const lines = second.end - first.end;
  for (let number = 10; (await read(0)).from === 0; number++) {
    assert.ok(number < 300, `nothing is written over, ${lines}`);
    await bench.print(number, RAW, bytes.subarray(0, 20), { limitMs: 3000 });
  }
  const { from, end } = await read(0);
  assert.ok(end - from > 3000 && end - from < 4096, `${end - from} bytes are kept`);
  assert.equal((await read(1)).from, from);
});
