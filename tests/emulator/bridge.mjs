// The emulated bridge as a device that other programs can use: `node bridge.mjs IMAGE FOLDER`.
//
// Three sockets in FOLDER are the ends of its cables:
//
//   serial   the serial port. A connection is a program that has it open; the bytes are plain.
//   usb      the whole device, for requests as the kernel gets them (urbs.mjs).
//   printer  the parallel port. Lines of JSON: from here { "bytes": BASE64 } that crossed the port and { "init": true };
//            to here any of { "room": bytes taken in all before it stays busy, "lines": { paperOut, select, fault },
//            "power": whether it is switched on, "answer": BASE64 for nibble mode, "id": BASE64 }. Nobody there: a printer
//            that takes everything.
//
// Lines on standard input are orders: `replug`, `figures`, `plug N` (a loop-back plug in the printer's place, in position N, for
// good). Each is answered by a line of JSON on standard output;
// the first line there says that the bridge is up. At the end of standard input the program ends.
//
// The board's clock never runs ahead of the world's, so that waiting costs nothing and its timers mean what they say;
// it falls behind when the board has more to do than this machine can do in time.

import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { Board } from './board.mjs';
import { Plug } from './plug.mjs';
import { Printer } from './printer.mjs';
import { SerialPort, keepTime, listen } from './serial.mjs';
import { Urbs } from './urbs.mjs';
import { Host } from './usb.mjs';

const [image, folder] = process.argv.slice(2);
if (!folder) {
  console.error('usage: node bridge.mjs IMAGE.uf2 FOLDER');
  process.exit(2);
}

const board = new Board(new Uint8Array(readFileSync(image)));
board.rest();
const host = new Host(board);
let woken = () => {};
const wake = () => woken();

const serve = (name, connected) => listen(join(folder, name), wake, connected);

// The printer.
let paper = null;
let crossed = [];
const printer = new Printer(board, {
  id: [],
  onByte: (byte) => { if (paper) crossed.push(byte); },
  // At once, so that it stands between the bytes before and behind it.
  onReset: () => {
    report();
    told({ init: true });
  },
});
const told = (message) => paper?.write(`${JSON.stringify(message)}\n`);
function report() {
  if (crossed.length) told({ bytes: Buffer.from(crossed).toString('base64') });
  crossed = [];
}
function printerConnected(socket) {
  paper = socket;
  const lines = createInterface({ input: socket });
  lines.on('error', () => {});
  lines.on('line', (line) => {
    const { room, lines: levels, power, answer, id } = JSON.parse(line);
    if (room !== undefined) printer.grant(room);
    if (levels) printer.change(levels);
    if (power !== undefined && power === printer.off) printer.power(power);
    if (answer) printer.say.push(...Buffer.from(answer, 'base64'));
    if (id) printer.id = [...Buffer.from(id, 'base64')];
  });
  socket.on('close', () => { if (paper === socket) paper = null; });
}

let plug = null;

// The device, enumerated as soon as it appears, and after every replugging.
const urbs = new Urbs(host, () => replug());
let device = host.enumerate();
async function replug() {
  host.replug();
  device = host.enumerate();
  serial.destroy();
  urbs.unplugged();
  await device;
}

const serial = new SerialPort(host, () => device);

/// What has been measured, in the board's time.
const figures = () => ({
  now: board.now, instructions: board.instructions, cycles: board.cycles, bytes: printer.count,
  shortest: printer.waveform.shortest, wrong: printer.waveform.wrong.slice(0, 3),
  complaints: board.complaints.slice(0, 3), watchdog: board.watchdogBites,
});

const answer = (message) => console.log(JSON.stringify(message));
const orders = createInterface({ input: process.stdin });
orders.on('line', async (order) => {
  wake();
  if (order === 'replug') {
    await replug();
    answer({ replugged: true });
  } else if (order === 'figures') {
    answer(figures());
  } else if (order.startsWith('plug ')) {
    printer.set = () => {};
    plug ??= new Plug(board);
    plug.move(order.slice(5));
    answer({ plugged: true });
  } else {
    answer({ error: `no such order: ${order}` });
  }
});
orders.on('close', () => process.exit(0));

async function up() {
  const { device: own, configuration, names } = await device;
  writeFileSync(join(folder, 'descriptors'), Buffer.concat([own, configuration]));
  writeFileSync(join(folder, 'names'), `${names.join('\n')}\n`);
  await serve('serial', (socket) => serial.connected(socket));
  await serve('usb', (socket) => urbs.connected(socket));
  await serve('printer', printerConnected);
  answer({ up: true, names });
}
up().catch((error) => {
  console.error(String(error.stack));
  process.exit(1);
});

await keepTime(board, {
  until: () => crossed.length > 512,
  turn: report,
  sleep: (sleep) => { woken = sleep; },
});
