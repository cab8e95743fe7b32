// Control requests that a host gives up in the middle, and those that want no bytes: a bus reset brings the board back.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, job, random, same, skip } from './bench.mjs';

/// A SETUP packet crosses.
async function setup({ host, board }, type, request, value, index, length) {
  host.usb.sendSetupPacket(new Uint8Array([type, request, value & 255, value >> 8, index & 255, index >> 8, length & 255, length >> 8]));
  await board.run(() => false, 50_000);
}

const taken = (bench) => bench.until(bench.host.one(0));

/// What is begun, and given up.
const KINDS = {
  'GET_DEVICE_ID, before its first packet': (bench) => setup(bench, 0xa1, 0, 0, 0x0300, 512),
  'GET_DEVICE_ID, behind its first packet': async (bench) => { await setup(bench, 0xa1, 0, 0, 0x0300, 512); await taken(bench); },
  'GET_DESCRIPTOR of the configuration, before its first packet': (bench) => setup(bench, 0x80, 6, 0x200, 0, 255),
  'GET_DESCRIPTOR of the device, before its status': async (bench) => { await setup(bench, 0x80, 6, 0x100, 0, 18); await taken(bench); },
  'SET_CONTROL_LINE_STATE, before its status': (bench) => setup(bench, 0x21, 0x22, 1, 0, 0),
  'SET_LINE_CODING, before its data': (bench) => setup(bench, 0x21, 0x20, 0, 0, 7),
  'SET_LINE_CODING, behind its data': async (bench) => {
    await setup(bench, 0x21, 0x20, 0, 0, 7);
    await bench.until(bench.host.send(0, Uint8Array.of(0, 0xc2, 1, 0, 0, 0, 8)));
  },
  'SET_CONFIGURATION, before its status': (bench) => setup(bench, 0, 9, 1, 0, 0),
  'PORT_STATUS, before its packet': (bench) => setup(bench, 0xa1, 1, 0, 3, 1),
  'SOFT_RESET, before its status': (bench) => setup(bench, 0x21, 2, 0, 3, 0),
};

/// The host forgets what it has begun.
function forget(host) {
  host.takeBack(0);
  host.read(0, null);
  host.control = Promise.resolve();
}

/// A board that is enumerated; its address is watched.
async function connected() {
  const bench = new Bench();
  const write = bench.host.usb.writeUint32.bind(bench.host.usb);
  bench.host.usb.writeUint32 = (offset, value) => {
    if ((offset & 0xfff) === 0) bench.address = value & 127;
    return write(offset, value);
  };
  await bench.connect('bulk');
  return bench;
}

for (const [what, begin] of Object.entries(KINDS)) {
  test(`behind ${what}, a bus reset brings the board back`, { skip }, async () => {
    const bench = await connected();
    assert.notEqual(bench.address, 0);
    await begin(bench);
    await bench.pass(3);
    forget(bench.host);
    bench.host.replug();
    await bench.pass(60);
    assert.equal(bench.address, 0, 'it keeps its address');
    await bench.connect('bulk');
    const bytes = job('small.rgl');
    assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
    same(bench.printer.taken, bytes);
    assert.equal(bench.board.watchdogBites, 0, 'without a restart');
  });
}

/// USB 2.0, 9.4.5: the request puts the toggle to DATA0, halted or not.
test('behind CLEAR_FEATURE(ENDPOINT_HALT), sent at any count of packets, nothing is dropped', { skip }, async () => {
  const next = random(9);
  const bytes = job('small.rgl');
  const bench = await connected();
  const plain = bench.device.interfaces.find((one) => one.class === 7);
  for (const count of [1, 2, 3, 6, 0, ...Array.from({ length: 12 }, () => next(20))]) {
    bench.printer.taken = [];
    const cut = Math.min(count * 64, bytes.length);
    await bench.until(bench.host.write(plain.out, bytes.subarray(0, cut)), 10_000);
    if (next(2)) await bench.pass(next(4));
    assert.ok(await bench.until(bench.host.clearHalt(plain.out)));
    await bench.until(bench.host.write(plain.out, bytes.subarray(cut)), 20_000);
    await bench.board.run(() => bench.printer.taken.length >= bytes.length, 2000 * MS);
    same(bench.printer.taken, bytes);
    assert.equal(bench.host.dropped, 0, `behind ${count} packets`);
  }
});

test('CLEAR_FEATURE(ENDPOINT_HALT) at any instant of a job of the link costs nothing', { skip }, async () => {
  const next = random(10);
  const bytes = job('small.rgl');
  for (let round = 0; round < 3; round++) {
    const bench = await connected();
    const requests = [
      () => bench.host.clearHalt(bench.end.out),
      () => bench.host.clearHalt(0x80 | bench.end.in),
    ];
    for (let from = 0; from < bytes.length - 400; ) {
      // A host has nothing under way on an endpoint whose halt it ends.
      const end = from + 1 + next(600);
      await bench.print(3, RAW, bytes, { piece: 1 + next(300), from, until: (sent) => { from = sent; return sent >= end; } });
      assert.ok(await bench.until(requests[next(requests.length)]()));
    }
    assert.equal((await bench.print(3, RAW, bytes, { from: bench.progress.accepted })).state, 'done');
    same(bench.printer.taken, bytes);
    assert.equal(bench.host.dropped, 0);
  }
});

test('a request to the host that wants no bytes is answered, and so is the next one', { skip }, async () => {
  const bench = await connected();
  for (const [type, request, value] of [[0x80, 6, 0x0100], [0x80, 0, 0], [0xa1, 0, 0], [0xa1, 1, 0]]) {
    await setup(bench, type, request, value, 0, 0);
    assert.equal((await taken(bench)).length, 0);
    assert.equal((await bench.until(bench.host.transfer([0x80, 6, 0x0100, 0], 18))).length, 18);
  }
});
