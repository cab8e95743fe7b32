// The board as an ordinary printer: what an operating system does with it that knows nothing of Foilpress.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, job, skip } from './bench.mjs';
import { begin, initialise } from './frames.mjs';
import { waveform } from './printer.mjs';

const LOCAL = 0xffffffff;
const text = (bytes) => new TextDecoder().decode(bytes);
const id = (words) => [0, words.length + 2, ...new TextEncoder().encode(words)];
const same = (taken, expected) => assert.ok(Buffer.from(taken).equals(Buffer.from(expected)), `${taken.length} bytes for ${expected.length}`);

class Plain extends Bench {
  async plug() {
    await this.connect('bulk');
    this.plain = this.device.interfaces.find((one) => one.class === 7);
  }

  deviceId() {
    // The interface in the high byte, by the class's own rule.
    return this.until(this.host.transfer([0xa1, 0, 0, this.plain.number << 8], 1000));
  }

  async portStatus() {
    return (await this.until(this.host.transfer([0xa1, 1, 0, this.plain.number], 1)))[0];
  }

  /// As `cat job > /dev/usb/lp0`: the next packet when the last one was taken.
  cat(bytes) {
    return this.host.write(this.plain.out, bytes);
  }

  ended(state) {
    return this.hear((heard) => heard.kind === 'progress' && heard.job === LOCAL && heard.state === state, 20_000);
  }
}

test('it is a printer with both directions, in the same device', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const { configuration } = bench.device;
  const at = configuration.findIndex((_, i) => configuration[i] === 9 && configuration[i + 1] === 4 && configuration[i + 5] === 7);
  assert.deepEqual([...configuration.subarray(at + 5, at + 8)], [7, 1, 2]);
  assert.ok(bench.plain.in && bench.plain.out);
});

test('it answers for the printer: by a description that fits until that has been heard, then in its own words', { skip }, async () => {
  const words = 'MANUFACTURER:ALPS   ;COMMAND SET:RGL;MODEL:MD-5500_T-03   ;CLASS:PRINTER;';
  const bench = new Plain({ id: id(words) });
  bench.printer.set('select', 0); // not ready yet
  await bench.plug();
  await bench.pass(700);
  const before = await bench.deviceId();
  assert.equal(before[0] * 256 + before[1], before.length);
  assert.match(text(before.subarray(2)), /^MANUFACTURER:ALPS;COMMAND SET:RGL;MODEL:MD-5500;.*Foilpress/);
  assert.equal(bench.printer.edges.filter(({ line, level }) => line === 'autoFeed' && level === 0).length, 0, 'a printer that is not ready is not spoken to');
  bench.printer.set('select', 1);
  await bench.pass(700);
  assert.deepEqual([...(await bench.deviceId())], id(words));
  // Another one is put in its place.
  bench.printer.set('power', 0);
  await bench.pass(20);
  assert.match(text(await bench.deviceId()), /Foilpress/);
  bench.printer.id = id('MFG:ALPS;MDL:MD-5000;');
  bench.printer.set('power', 1);
  await bench.pass(700);
  assert.match(text(await bench.deviceId()), /Foilpress/, 'it may be in the middle of a sheet');
  await bench.say(initialise(7));
  await bench.pass(700);
  assert.match(text(await bench.deviceId()), /MDL:MD-5000;$/);
  assert.deepEqual(bench.printer.taken, []);
});

test('the port status is that of the lines', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  assert.equal(await bench.portStatus(), 0x18);
  for (const [line, level, status] of [['paperOut', 1, 0x38], ['select', 0, 0x28], ['fault', 0, 0x20], ['power', 0, 0]]) {
    bench.printer.set(line, level);
    // The lines are read every millisecond.
    await bench.pass(2);
    assert.equal(await bench.portStatus(), status, line);
  }
});

test('requests that are not of the class are refused', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  assert.equal(await bench.until(bench.host.transfer([0xa1, 7, 0, bench.plain.number], 4)), null);
});

test('what is written to it arrives byte for byte, and the link has its turn afterwards', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const bytes = job('page.rgl').subarray();
  await bench.until(bench.cat(bytes), 20_000);
  await bench.ended('done');
  same(bench.printer.taken, bytes);
  assert.deepEqual(waveform(bench.printer.edges).wrong, []);
  bench.printer.taken = [];
  const next = job('small.rgl');
  assert.equal((await bench.print(5, RAW, next)).state, 'done');
  same(bench.printer.taken, next);
});

test('two jobs in one stream, each with its end', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const both = Buffer.concat([job('small.rgl'), job('small.rgl')]);
  await bench.until(bench.cat(both), 20_000);
  await bench.ended('done');
  await bench.board.run(() => bench.printer.taken.length === both.length, 500 * MS);
  same(bench.printer.taken, both);
});

test('one owner at a time: it waits for the job of the link, and the link for its', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const bytes = job('small.rgl');
  await bench.print(5, RAW, bytes, { until: (sent) => sent > 3000 });
  let written = false;
  bench.cat(bytes).then(() => { written = true; });
  await bench.pass(60);
  assert.equal(written, false);
  assert.ok(bench.printer.taken.length <= 3900, 'nothing of it is printed between');
  assert.equal((await bench.print(5, RAW, bytes, { from: bench.progress.accepted })).state, 'done');
  same(bench.printer.taken.slice(0, bytes.length), bytes);
  // Now it is the plain one's turn, and the link is told so.
  await bench.board.run(() => bench.printer.taken.length > bytes.length + 1000, 500 * MS);
  await bench.say(begin(6, RAW, bytes.length));
  assert.equal((await bench.hear(({ kind }) => kind === 'refused')).reason, 1);
  await bench.ended('done');
  same(bench.printer.taken, Buffer.concat([bytes, bytes]));
});

const END = [0x1b, 0x2a, 0x72, 0x43, 0x0c, 0x1b, 0x25, 0x00, 0x58, 0x1b, 0x65];

for (const recipient of [0x21, 0x23]) {
  test(`a soft reset (${recipient.toString(16)}) in the middle ends the sheet, and the next job prints`, { skip }, async () => {
    const bench = new Plain({ work: 20_000 });
    await bench.plug();
    const bytes = job('small.rgl');
    // Nobody waits for the packets that the reset throws away.
    bench.cat(bytes.subarray(0, 9000));
    await bench.board.run(() => bench.printer.taken.length > 1000, 500 * MS);
    bench.host.queues.clear();
    await bench.until(bench.host.transfer([recipient, 2, 0, bench.plain.number], new Uint8Array(0)));
    await bench.ended('cancelled');
    assert.deepEqual(bench.printer.taken.slice(-END.length), END);
    bench.printer.taken = [];
    await bench.until(bench.cat(bytes), 20_000);
    await bench.ended('done');
    same(bench.printer.taken, bytes);
  });
}

test('a cable pulled in the middle ends the sheet', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const bytes = job('small.rgl');
  await bench.until(bench.cat(bytes.subarray(0, 6400)), 20_000);
  await bench.pass(5);
  await bench.replug('bulk');
  await bench.board.run(() => ['broken', 'cancelled'].includes(bench.progress.state), 500 * MS);
  assert.equal(bench.progress.state, 'broken');
  assert.deepEqual(bench.printer.taken.slice(-END.length), END);
  bench.printer.taken = [];
  assert.equal((await bench.print(5, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
});

test('text in no known language goes through, and gives the printer free when it is over', { skip }, async () => {
  const bench = new Plain();
  await bench.plug();
  const words = new TextEncoder().encode('plain text\r\n');
  await bench.until(bench.cat(words));
  await bench.board.run(() => bench.printer.taken.length === words.length, 500 * MS);
  same(bench.printer.taken, words);
  await bench.pass(7000);
  bench.printer.taken = [];
  const bytes = job('small.rgl');
  assert.equal((await bench.print(5, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
});
