// What Windows asks a new device for: the bytes of Microsoft OS 2.0 Descriptors Specification (2018), written out by hand, by which it
// binds WinUSB to the bulk endpoints without a driver of ours, and the class codes by which it binds its own to the serial port.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, skip } from './bench.mjs';

const hex = (text) => Uint8Array.from(text.trim().split(/\s+/), (byte) => parseInt(byte, 16));
const utf16 = (text) => Uint8Array.from(Buffer.from(text, 'utf16le'));

/// Binary Device Object Store: one platform capability, MS OS 2.0 (table 4), Windows 8.1 and newer, 178 bytes to be had by request 0x20.
const STORE = hex(`
  05 0f 21 00 01
  1c 10 05 00  df 60 dd d8 89 45 c7 4c 9c d2 65 9d 9e 64 8a 9f  00 00 03 06  b2 00  20  00`);

/// The descriptor set: header, first configuration, function that begins at interface 2, compatible ID, registry property.
const SET = Uint8Array.of(
  ...hex('0a 00 00 00 00 00 03 06 b2 00'),
  ...hex('08 00 01 00 00 00 a8 00'),
  ...hex('08 00 02 00 02 00 a0 00'),
  ...hex('14 00 03 00 57 49 4e 55 53 42 00 00 00 00 00 00 00 00 00 00'),
  ...hex('84 00 04 00 07 00 2a 00'), ...utf16('DeviceInterfaceGUIDs\0'),
  ...hex('50 00'), ...utf16('{6E8C7E4B-3D0D-4F7A-9B0B-0F1C5C1E5F55}\0\0'));

test('Windows binds its own drivers to the bridge', { skip }, async () => {
  const bench = new Bench();
  const { host } = bench;
  const { device, configuration, interfaces } = await bench.until(host.enumerate());
  assert.ok((device[2] | device[3] << 8) >= 0x0201, 'an older device is not asked for its store');
  assert.deepEqual([...device.subarray(4, 7)], [0xef, 2, 1], 'a device of several functions');
  const head = await bench.until(host.transfer([0x80, 6, 0x0f00, 0], 5));
  const store = await bench.until(host.transfer([0x80, 6, 0x0f00, 0], head[2] | (head[3] << 8)));
  // Another capability may stand before Microsoft's.
  assert.ok(Buffer.from(store).includes(Buffer.from(STORE.subarray(5))), Buffer.from(store).toString('hex'));
  const set = await bench.until(host.transfer([0xc0, 0x20, 0, 7], SET.length));
  assert.deepEqual([...set], [...SET]);
  // The function that the set names is the one with the bulk endpoints, and the serial port has its association.
  assert.equal(interfaces.find((found) => found.number === 2).class, 0xff);
  assert.ok(Buffer.from(configuration).includes(Buffer.from([8, 11, 0, 2, 2, 2])), 'interfaces 0 and 1 are a serial port');
});
