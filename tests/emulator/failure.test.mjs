// The program fails: its last words are in the log behind the restart, and the job goes on at the byte.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { Bench, RAW, job, same, skip } from './bench.mjs';
import { readLog } from './frames.mjs';

/// Symbols of the ELF file beside the image: address and name. A symbol of defmt is a text, and its address the number in the log.
function symbols() {
  const elf = readFileSync(process.env.FOILPRESS_IMAGE.replace(/uf2$/, 'elf'));
  const word = (at) => elf.readUInt32LE(at);
  const section = (i) => word(32) + i * elf.readUInt16LE(46);
  const found = [];
  for (let i = 0; i < elf.readUInt16LE(48); i++) {
    const at = section(i);
    if (word(at + 4) !== 2) continue; // not a table of symbols
    const names = word(section(word(at + 24)) + 16);
    for (let one = word(at + 16); one < word(at + 16) + word(at + 20); one += 16) {
      const begin = names + word(one);
      found.push([word(one + 4), elf.toString('utf8', begin, elf.indexOf(0, begin))]);
    }
  }
  return found;
}

/// A frame of the log, from its reversed zero-compressing code.
function decode(coded) {
  const out = [];
  for (let at = coded.length - 1; at >= 0; ) {
    const code = coded[at--];
    if (code < 0x80) for (let bit = 6; bit >= 0; bit--) out.push((code >> bit) & 1 ? 0 : coded[at--]);
    else {
      if (code < 0xff) out.push(0);
      for (let n = code < 0xff ? (code & 0x7f) + 7 : 134; n > 0; n--) out.push(coded[at--]);
    }
  }
  return Buffer.from(out.reverse().map((byte) => byte ?? 0));
}

/// The log's entries: number of the text, and what follows the time.
async function log(bench) {
  const [frames, bytes] = [[], []];
  for (let from = 0, end = 1; from < end; ) {
    const request = ++bench.requests;
    await bench.say(readLog(request, from));
    const piece = await bench.hear((heard) => heard.kind === 'log' && heard.request === request);
    bytes.push(...piece.bytes);
    [from, end] = [piece.from + piece.bytes.length, piece.end];
  }
  for (let begin = 0, end; (end = bytes.indexOf(0, begin)) >= 0; begin = end + 1) {
    const frame = decode(bytes.slice(begin, end));
    if (frame.length >= 10) frames.push({ text: frame.readUInt16LE(0), rest: frame.subarray(10) });
  }
  return frames;
}

const numbered = (all, text) => all.find(([, name]) => name.includes(`"data":"${text}`))[0] & 0xffff;

/// Runs until the processor is about to execute something in a function.
function reach(bench, all, name) {
  const found = all.find(([, symbol]) => symbol.includes(name));
  assert.ok(found, `the image has no ${name}`);
  const [address] = found;
  for (let i = 0; i < 50_000_000; i++) {
    bench.board.step();
    if (bench.board.chip.core.PC === (address & ~1)) return;
  }
  throw new Error(`${name} was never reached`);
}

/// Runs until the program is about to write an entry of its log.
function reachLog(bench, all) {
  // The printer goes, which is logged.
  bench.printer.later(0, () => bench.printer.change({ paperOut: 1 }));
  reach(bench, all, '8retained3log17h');
  bench.printer.own.paperOut = 0;
}

const FAILURES = {
  'a fault of the processor': {
    text: 'fault at ',
    strike({ board }) {
      const { PC } = board.chip.core;
      board.fault();
      return PC;
    },
  },
  'a fault in the middle of an entry of the log': {
    text: 'fault at ',
    strike(bench, all) {
      bench.say(readLog(1, 0)).catch(() => {});
      reachLog(bench, all);
      const { PC } = bench.board.chip.core;
      bench.board.fault();
      return PC;
    },
  },
  'a stack that grows beyond its end': {
    text: 'fault: the stack has grown beyond its ',
    strike(bench, all) {
      // At a function's beginning, which puts registers on the stack.
      reachLog(bench, all);
      bench.board.chip.core.SP = 0x20000008;
    },
  },
};

for (const [what, { text, strike }] of Object.entries(FAILURES)) {
  test(`${what} is told in the log behind the restart, and costs no byte`, { skip }, async () => {
    const all = symbols();
    const bytes = job('small.rgl');
    let bench = new Bench();
    await bench.connect('bulk');
    await bench.print(3, RAW, bytes, { until: () => bench.printer.taken.length >= 3000 });
    const at = strike(bench, all);
    await bench.pass(50);
    // The buffers are off, and the program waits for the watchdog.
    assert.equal(bench.board.pin(20).value === 0, false, 'nOE is low');
    const had = bench.printer.taken.length;
    await bench.pass(50);
    assert.equal(bench.printer.taken.length, had, 'bytes behind the end');
    bench = bench.restarted();
    await bench.connect('bulk');
    const { printed } = await bench.hear(({ kind, job: heard }) => kind === 'progress' && heard === 3);
    assert.equal(printed, had);
    assert.equal((await bench.print(3, RAW, bytes)).state, 'done');
    same(bench.printer.taken, bytes);
    const entries = await log(bench);
    const told = entries.find((entry) => entry.text === numbered(all, text));
    assert.ok(told, `not in the log: ${text}`);
    if (at !== undefined) assert.equal(told.rest.readUInt32LE(0) & ~1, at & ~1);
    // The start behind it says how much of the stack was used.
    assert.ok(entries.some((entry) => entry.text === numbered(all, 'the run before used ')));
  });
}
