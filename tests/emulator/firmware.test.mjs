// The real image, from power-on to the last byte at the printer.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, budgets, job, legal, same, skip } from './bench.mjs';
import { abandon, ask, cancel, configure, data, drive, hello, helloOf, initialise } from './frames.mjs';

const LINES = 0, STATUS = 1, DEVICE_ID = 2, BOARD = 4;

test('a composite device appears, with a serial port and bulk endpoints', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const { device, names, interfaces } = bench.device;
  assert.deepEqual([...device.subarray(4, 7)], [0xef, 2, 1]);
  assert.deepEqual(names.slice(0, 2), ['Foilpress', 'Foilpress bridge']);
  assert.match(names[2], /^[0-9A-F]{16}$/);
  assert.deepEqual(interfaces.map((one) => one.class), [2, 10, 0xff, 7]);
  assert.deepEqual(bench.board.complaints, []);
});

test('nothing is strobed before the host asks for it, and nOE goes low only with the lines at rest', { skip }, async () => {
  const bench = new Bench();
  const seen = [];
  const strobe = bench.board.pin(10), enable = bench.board.pin(20);
  enable.addListener(() => seen.push([enable.value, strobe.value, bench.board.pin(12).value, bench.board.pin(13).value]));
  await bench.connect('serial');
  await bench.pass(50);
  assert.deepEqual(seen.at(-1), [0, 1, 1, 0], 'nOE low, nStrobe and nInit high, nSelectIn low');
  assert.deepEqual(bench.printer.taken, []);
  assert.equal(bench.printer.edges.filter(({ line }) => line === 'strobe' || line === 'init').length, 0);
});

for (const way of ['serial', 'bulk']) {
  test(`a raw job over ${way} arrives byte for byte, within the timing`, { skip }, async (t) => {
    const bench = new Bench();
    await bench.connect(way);
    const bytes = job('page.rgl');
    const start = bench.board.now;
    const progress = await bench.print(7, RAW, bytes);
    assert.equal(progress.state, 'done');
    assert.equal(progress.printed, bytes.length);
    same(bench.printer.taken, bytes);
    const shortest = legal(bench.printer);
    const seconds = (bench.board.now - start) / 1e9;
    t.diagnostic(`${bytes.length} bytes, ${(bytes.length / seconds / 1000).toFixed(0)} kB/s, ${JSON.stringify(shortest)} ns`);
    assert.equal(bench.frames.damaged, 0);
  });
}

test('pass streams become the bytes that the workstation writes into a file', { skip }, async (t) => {
  const bench = new Bench();
  await bench.connect('bulk');
  for (const [number, name] of [[1, 'small'], [2, 'page']]) {
    const expected = job(`${name}.rgl`), streams = job(`${name}.streams`);
    bench.printer.taken = [];
    const start = bench.board.now, before = bench.board.instructions;
    const progress = await bench.print(number, STREAMS, streams);
    assert.equal(progress.state, 'done');
    same(bench.printer.taken, expected);
    const seconds = (bench.board.now - start) / 1e9;
    t.diagnostic(`${name}: ${streams.length} bytes become ${expected.length}, ${(expected.length / seconds / 1000).toFixed(0)} kB/s at the port, ${bench.board.instructions - before} instructions`);
  }
  legal(bench.printer);
});

for (const [line, level, state] of [['paperOut', 1, 'paper out'], ['select', 0, 'off line'], ['fault', 0, 'error']]) {
  test(`a printer that says "${state}" stops the job, and it goes on without a byte lost or doubled`, { skip }, async () => {
    const bench = new Bench();
    await bench.connect('bulk');
    const bytes = job('small.rgl');
    bench.printer.pauses = [{ after: 700, line, level, ns: 30 * MS }];
    const { printer } = bench;
    let stopped;
    const progress = await bench.print(3, RAW, bytes, {
      until: () => {
        if (bench.progress.state === 'stopped') stopped ??= [bench.progress.detail, printer.taken.length];
        return false;
      },
    });
    assert.equal(progress.state, 'done');
    assert.deepEqual(stopped, [state, 700]);
    same(printer.taken, bytes);
    legal(printer);
  });
}

test('a slow printer sets the pace', { skip }, async () => {
  const bench = new Bench({ busyAfter: 500, work: 40_000, ack: 5_000 });
  await bench.connect('bulk');
  const bytes = job('small.rgl').subarray(0, 3000);
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length >= 1200 });
  same(bench.printer.taken.slice(0, 1200), bytes.subarray(0, 1200));
  legal(bench.printer);
});

test('slower timing is kept to', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  await bench.say(configure({ setup: 5000, strobe: 3000, hold: 2000, settle: 1000 }));
  const bytes = job('small.rgl');
  await bench.print(3, RAW, bytes);
  same(bench.printer.taken, bytes);
  const { setup, strobe, hold } = legal(bench.printer);
  assert.ok(setup >= 5000 && strobe >= 3000 && hold >= 2000);
});

test('the handshake by nAck, worked by the processor, delivers the same', { skip }, async (t) => {
  const bench = new Bench();
  await bench.connect('bulk');
  await bench.say(configure({ setup: 800, strobe: 800, hold: 800, settle: 500, handshake: 1 }));
  const bytes = job('small.rgl');
  const start = bench.board.now;
  assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
  legal(bench.printer, 800);
  t.diagnostic(`${((bytes.length / (bench.board.now - start)) * 1e6).toFixed(0)} kB/s`);
});

test('a status question is answered at once while data are under way', { skip }, async (t) => {
  const bench = new Bench({ work: 20_000 });
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: (sent) => sent > 9000 });
  const waits = [];
  for (let i = 0; i < 5; i++) {
    const asked = bench.board.now;
    const answer = await bench.ask(LINES);
    waits.push((answer.at - asked) / MS);
    await bench.pass(7);
  }
  t.diagnostic(`ms: ${waits.map((ms) => ms.toFixed(2)).join(' ')}`);
  assert.ok(Math.max(...waits) <= 5);
});

test('a cancelled job is brought to a legal end', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length > 5000 });
  await bench.say(cancel(3));
  await bench.hear(({ kind, state }) => kind === 'progress' && state === 'cancelled');
  const taken = bench.printer.taken;
  assert.ok(taken.length < bytes.length);
  // End of raster, one form feed, end of RGL, reset.
  assert.deepEqual(taken.slice(-11), [0x1b, 0x2a, 0x72, 0x43, 0x0c, 0x1b, 0x25, 0x00, 0x58, 0x1b, 0x65]);
  legal(bench.printer);
  bench.printer.taken = [];
  const next = job('small.rgl');
  assert.equal((await bench.print(4, RAW, next)).state, 'done');
  same(bench.printer.taken, next);
});

test('the serial port is closed in the middle, and the job goes on over the other way', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('serial');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: (sent) => sent > 6000 });
  const serial = bench.end;
  await bench.pass(2);
  bench.host.read(serial.in, null);
  await bench.until(bench.host.openSerial(serial.number - 1, false));
  await bench.pass(5);
  await bench.open('bulk');
  await bench.say(hello());
  await bench.hear(({ kind }) => kind === 'hello');
  const { accepted } = await bench.hear(({ kind, job: number }) => kind === 'progress' && number === 3);
  assert.equal((await bench.print(3, RAW, bytes, { from: accepted })).state, 'done');
  same(bench.printer.taken, bytes);
});

test('a bus reset in the middle of a job costs nothing', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: (sent) => sent > 6000 });
  await bench.pass(2);
  const accepted = await bench.replug('bulk');
  assert.equal((await bench.print(3, RAW, bytes, { from: accepted })).state, 'done');
  same(bench.printer.taken, bytes);
});

test('garbage and repeated data change nothing', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('small.rgl');
  await bench.say(Uint8Array.from({ length: 3000 }, (_, i) => (i * 131 + (i >> 3)) & 255));
  // As every host does that opens the link: ends whatever stands in the reader.
  await bench.say(Uint8Array.of(0));
  await bench.print(3, RAW, bytes, { until: (sent) => sent > 1000 });
  await bench.say(data(3, 0, bytes.subarray(0, 800)));
  await bench.say(data(3, 5, bytes.subarray(5, 300)));
  await bench.pass(2);
  assert.equal((await bench.print(3, RAW, bytes, { from: bench.progress.accepted })).state, 'done');
  same(bench.printer.taken, bytes);
});

test('the device ID and the status answer are read in nibble mode, and forward printing goes on', { skip }, async () => {
  const text = 'MFG:ALPS;MDL:MD-5500;CLS:PRINTER;';
  const id = [0, text.length + 2, ...new TextEncoder().encode(text)];
  const status = [2, 0x80, 33, 0, 0x10, ...Array.from({ length: 32 }, (_, i) => (i * 37) & 255), 3];
  const bench = new Bench({ id, status });
  await bench.connect('bulk');
  assert.deepEqual([...(await bench.ask(DEVICE_ID)).answer], id);
  assert.deepEqual([...(await bench.ask(STATUS)).answer], status);
  assert.deepEqual(bench.printer.taken, [5, 1]);
  bench.printer.taken = [];
  const bytes = job('small.rgl');
  assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
  legal(bench.printer);
});

test('a printer that knows no IEEE 1284 is told apart and printed on', { skip }, async () => {
  const bench = new Bench({ negotiates: false });
  await bench.connect('bulk');
  assert.equal((await bench.ask(DEVICE_ID)).answer, 'one-way');
  const bytes = job('small.rgl');
  assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
});

test('a wiring test sets every line, and the next job begins from rest', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  // The board first leads the printer out of a conversation that it may be in.
  await bench.pass(50);
  for (let bit = 0; bit < 8; bit++) {
    await bench.say(drive(1 << bit, 0b0111));
    await bench.pass(3);
    assert.equal(bench.printer.out.data, 1 << bit);
  }
  await bench.say(drive(0, 0b1010));
  await bench.pass(3);
  const { strobe, autoFeed, init, selectIn } = bench.printer.out;
  assert.deepEqual([strobe, autoFeed, init, selectIn], [0, 1, 0, 1]);
  bench.printer.taken = [];
  bench.printer.edges = [];
  await bench.say(initialise());
  await bench.pass(3);
  const bytes = job('small.rgl');
  assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
});

test('a printer that is switched off in the middle loses the job, and nothing more is sent', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length > 3000 });
  bench.printer.power(false);
  const { taken } = bench.printer;
  const had = taken.length;
  await bench.hear(({ kind, state }) => kind === 'progress' && state === 'lost');
  await bench.pass(5);
  assert.deepEqual([bench.printer.enabled, bench.printer.out.selectIn, bench.printer.out.strobe], [false, 1, 1], 'nOE is low');
  bench.printer.power(true);
  await bench.pass(2);
  assert.deepEqual([bench.printer.enabled, bench.printer.out.selectIn], [true, 0], 'nOE is high');
  await bench.pass(48);
  assert.equal(taken.length, had);
});

test('whenever in a byte the printer is switched off, at most that byte is still on its way', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  const { taken, edges } = bench.printer;
  // A byte is 2.6 us; the steps fall everywhere in it.
  for (let id = 3; id < 23; id++) {
    const had = taken.length;
    await bench.print(id, RAW, bytes, { until: () => taken.length > had + 300 });
    bench.printer.later(140 * id, () => bench.printer.power(false));
    await bench.hear(({ kind, state }) => kind === 'progress' && state === 'lost');
    const off = edges.findLastIndex(({ line, level }) => line === 'power' && level === 0);
    const strobes = edges.slice(off).filter(({ line, level }) => line === 'strobe' && level === 0);
    assert.ok(strobes.length <= 1, `${strobes.length} bytes after the switch`);
    bench.printer.power(true);
    await bench.pass(5);
  }
  legal(bench.printer);
});

/// Strobes and pulses of nInit while the printer's supply was absent, but for the byte that was set up already.
const drivenWithoutSupply = ({ edges }) => {
  let off = null;
  return edges.filter(({ at, line, level }) => {
    if (line === 'power') off = level === 0 ? at : null;
    return off !== null && at - off > 1000 && level === 0 && (line === 'strobe' || line === 'init');
  }).length;
};

// The printer seems ready but for its +5 V: a broken wire, say.
for (const [what, kind, name, handshake] of [['a raw job', RAW, 'small.rgl', 0], ['a raw job by nAck', RAW, 'small.rgl', 1], ['pass streams', STREAMS, 'small.streams', 0], ['plain text', RAW, null, 0]]) {
  test(`${what} waits for the printer's +5 V, and then arrives byte for byte`, { skip }, async () => {
    const bench = new Bench();
    bench.printer.set('power', 0);
    await bench.connect('bulk');
    if (handshake) await bench.say(configure({ setup: 800, strobe: 800, hold: 800, settle: 500, handshake }));
    const bytes = name ? job(name) : Uint8Array.from({ length: 3000 }, (_, i) => 97 + (i % 26));
    const expected = name ? job('small.rgl') : bytes;
    const end = bench.board.now + 400 * MS;
    let from = 0;
    await bench.print(3, kind, bytes, { until: (sent) => { from = sent; return bench.board.now > end; } });
    assert.deepEqual([bench.printer.taken.length, drivenWithoutSupply(bench.printer)], [0, 0]);
    assert.deepEqual([bench.progress.state, bench.progress.detail], ['stopped', 'power off']);
    bench.printer.set('power', 1);
    assert.equal((await bench.print(3, kind, bytes, { from })).state, 'done');
    same(bench.printer.taken, expected);
    // What it had of another job nobody knew.
    assert.equal(bench.printer.resets, 1);
    legal(bench.printer);
  });
}

test('what an operating system prints waits for the printer\'s +5 V too', { skip }, async () => {
  const bench = new Bench();
  bench.printer.set('power', 0);
  await bench.connect('bulk');
  const { out } = bench.device.interfaces.find((one) => one.class === 7);
  const bytes = job('small.rgl');
  let written = false;
  bench.host.write(out, bytes).then(() => { written = true; });
  await bench.pass(400);
  assert.deepEqual([bench.printer.taken.length, drivenWithoutSupply(bench.printer)], [0, 0]);
  bench.printer.set('power', 1);
  assert.ok(await bench.board.run(() => written && bench.printer.taken.length === bytes.length, 2000 * MS));
  same(bench.printer.taken, bytes);
  legal(bench.printer);
});

test('whenever in a byte the sense line falls, what has crossed is counted, and nothing more crosses', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  const { printer } = bench;
  for (let id = 3; id < 23; id++) {
    const had = printer.taken.length;
    await bench.print(id, RAW, bytes, { until: () => printer.taken.length > had + 300 });
    printer.later(140 * id, () => printer.set('power', 0));
    await bench.hear(({ kind, state, job: number }) => kind === 'progress' && state === 'lost' && number === id);
    assert.equal(bench.progress.printed, printer.taken.length - had);
    assert.equal(drivenWithoutSupply(printer), 0);
    printer.set('power', 1);
    await bench.pass(5);
  }
  legal(printer);
});

test('a host of another version is answered, and so learns which version the bridge has', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  for (const rest of [[], [1, 2, 3, 4, 5, 6, 7, 8, 9], [0]]) {
    const asked = bench.board.now;
    await bench.say(helloOf(77, rest));
    assert.equal((await bench.hear(({ kind, at }) => kind === 'hello' && at > asked)).version, 5);
  }
});

test('the status question waits until it is known that the printer stands between two jobs', { skip }, async () => {
  const status = [2, 0x80, 33, 0, 0x10, ...Array.from({ length: 32 }, (_, i) => (i * 37) & 255), 3];
  const bench = new Bench({ id: [0, 9, ...new TextEncoder().encode('MFG:A;')], status, unaware: true });
  await bench.connect('bulk');
  for (const what of [STATUS, DEVICE_ID]) assert.equal((await bench.ask(what)).answer, 'unsure');
  assert.deepEqual(bench.printer.taken, []);
  await bench.say(initialise(777));
  // It is answered when the printer has been reset.
  await bench.hear(({ kind, request }) => kind === 'lines' && request === 777);
  assert.deepEqual([...(await bench.ask(STATUS)).answer], status);
});

test('a printer that has shown that it does not negotiate is not tried again, and gets no question', { skip }, async () => {
  const bench = new Bench({ negotiates: false });
  await bench.connect('bulk');
  await bench.pass(700);
  const tried = () => bench.printer.edges.filter(({ line, level }) => line === 'selectIn' && level === 1).length;
  const before = tried();
  for (let i = 0; i < 5; i++) for (const what of [STATUS, DEVICE_ID]) assert.equal((await bench.ask(what)).answer, 'one-way');
  assert.deepEqual([tried() - before, bench.printer.taken.length], [0, 0]);
});

test('a job that is given up ends at once although the printer takes nothing, and the next one prints behind a reset', { skip }, async () => {
  const bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('page.rgl');
  await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length > 3000 });
  bench.printer.change({ paperOut: 1 });
  await bench.pass(5);
  await bench.say(abandon(3));
  await bench.hear(({ kind, state }) => kind === 'progress' && state === 'lost');
  const had = bench.printer.taken.length;
  assert.deepEqual([bench.progress.printed, bench.printer.resets], [had, 1]);
  bench.printer.change({ paperOut: 0 });
  await bench.pass(5);
  assert.equal((await bench.print(4, RAW, job('small.rgl'))).state, 'done');
  same(bench.printer.taken.slice(had), job('small.rgl'));
});

test('a mute printer keeps nobody waiting: lines are answered while it is asked, and no task runs for a millisecond', { skip }, async (t) => {
  const bench = new Bench({ id: [0, 9, ...new TextEncoder().encode('MFG:A;')] });
  await bench.connect('bulk');
  const request = ++bench.requests;
  await bench.say(ask(request, STATUS));
  const waits = [];
  for (let i = 0; i < 60; i++) {
    const asked = bench.board.now;
    waits.push(((await bench.ask(LINES)).at - asked) / MS);
    await bench.pass(20);
  }
  assert.equal((await bench.hear((heard) => heard.request === request, 4000)).answer, 'silent');
  assert.ok(Math.max(...waits) <= 5, `${Math.max(...waits)} ms`);
  // And everything else the firmware does: both kinds of jobs, by both senders, the log.
  assert.equal((await bench.print(3, STREAMS, job('page.streams'))).state, 'done');
  await bench.say(configure({ setup: 65_535, strobe: 65_535, hold: 65_535, settle: 65_535, handshake: 1 }));
  await bench.print(4, RAW, job('small.rgl').subarray(0, 2500), { until: () => bench.printer.taken.length > 14_000, limitMs: 60_000 });
  const { fixed, stack, used, longest } = await bench.ask(BOARD);
  t.diagnostic(`lines within ${Math.max(...waits).toFixed(2)} ms; no task ran longer than ${longest} us; stack ${used} of ${stack} bytes, other memory ${fixed} bytes`);
  const budget = budgets('foilpress-bridge');
  assert.ok(longest > 50 && longest < budget.longest_us, `${longest} us`);
  assert.equal(stack, budget.stack);
  assert.ok(used > 1000 && used < budget.used && fixed > 100_000 && fixed <= budget.memory, `${used} of ${stack}, ${fixed}`);
});
