// A board, a printer and a program on the workstation, put together.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { Board } from './board.mjs';
import { Frames, ask, begin, data, hello, listStored, parse, store } from './frames.mjs';
import { Printer, waveform } from './printer.mjs';
import { Host } from './usb.mjs';

export const MS = 1_000_000;
export const RAW = 0;
export const STREAMS = 1;

const { FOILPRESS_IMAGE: image, FOILPRESS_JOBS: jobs } = process.env;

/// Why the tests cannot run, or false.
export const skip = image && jobs ? false : 'run by `cargo xtask emulator`, which builds the image';

/// Numbers from 0 to `below` - 1, the same for the same seed (mulberry32).
export const random = (seed) => (below) => {
  seed = (seed + 0x6d2b79f5) | 0;
  let value = Math.imul(seed ^ (seed >>> 15), 1 | seed);
  value = (value + Math.imul(value ^ (value >>> 7), 61 | value)) ^ value;
  return ((value ^ (value >>> 14)) >>> 0) % below;
};

/// The same bytes, all of them.
export const same = (taken, expected) => {
  assert.equal(taken.length, expected.length, 'number of bytes');
  const at = taken.findIndex((byte, i) => byte !== expected[i]);
  assert.equal(at, -1, `first difference at byte ${at}`);
};

// 800 ns each, and a clock cycle of what an edge may be late.
const STANDARD = 792;

/// Every time kept, no strobe while the printer was not ready.
export const legal = (printer, least = STANDARD) => {
  const { shortest, wrong } = waveform(printer.edges);
  assert.deepEqual(wrong.slice(0, 3), []);
  for (const time of ['setup', 'strobe', 'hold']) assert.ok(shortest[time] >= least, `${time} ${shortest[time]} ns`);
  return shortest;
};

/// What an image may take and do.
export function budgets(image) {
  const text = readFileSync(new URL('../../xtask/budgets.toml', import.meta.url), 'utf8');
  const [, section] = text.split(`[${image}]`);
  return Object.fromEntries([...section.split('\n[')[0].matchAll(/^(\w+) = (\d+)/gm)].map(([, key, value]) => [key, Number(value)]));
}

export const job = (name) => new Uint8Array(readFileSync(join(jobs, name)));

export class Bench {
  constructor(settings) {
    this.settings = settings;
    this.board = new Board(new Uint8Array(readFileSync(image)));
    if (!settings?.unaware) this.board.rest();
    this.printer = new Printer(this.board, settings);
    this.host = new Host(this.board);
    this.frames = new Frames();
    this.heard = [];
    this.progress = null;
    this.requests = 0;
  }

  /// Runs the board until a promise is kept.
  async until(promise, limitMs = 2000) {
    let [settled, result, failure] = [false, undefined, undefined];
    promise.then((value) => { [settled, result] = [true, value]; }, (error) => { [settled, failure] = [true, error]; });
    if (!(await this.board.run(() => settled, limitMs * MS))) throw new Error(`nothing after ${limitMs} ms of the board's time`);
    if (failure) throw failure;
    return result;
  }

  /// What the watchdog does: the board begins anew, with its memory as it was. The printer notices nothing. With `memory` false,
  /// what the loss of the supply does; with `reason` 0, what RUN does.
  restarted(memory = true, reason = 1) {
    const next = new this.constructor(this.settings);
    if (memory) {
      next.board.chip.sram.set(this.board.chip.sram);
      next.board.chip.peripherals[0x40058].reason = reason;
    }
    next.printer.taken = this.printer.taken;
    next.board.chip.flash.set(this.board.chip.flash);
    return next;
  }

  /// The processor hangs: it executes nothing any more, and what needs no processor goes on.
  hang() {
    this.board.chip.core.executeInstruction = () => 1;
  }

  pass(ms) {
    return this.board.run(() => false, ms * MS);
  }

  /// Plugs the board in and opens `way`: 'serial' or 'bulk'.
  async connect(way) {
    this.device = await this.until(this.host.enumerate());
    await this.open(way);
    this.greeted = this.board.now;
    // As every host does that opens the link: the zero ends whatever stands in the reader.
    await this.say(Uint8Array.of(0, ...hello()));
    await this.hear(({ kind, at }) => kind === 'hello' && at > this.greeted);
  }

  async open(way) {
    const kind = way === 'serial' ? 0x0a : 0xff;
    this.end = this.device.interfaces.find((one) => one.class === kind);
    if (way === 'serial') await this.until(this.host.openSerial(this.end.number - 1, true));
    this.host.read(this.end.in, (packet) => this.listen(packet));
  }

  /// The cable is pulled and plugged in again: nothing of what was under way arrives. Then hello, and where a job stands.
  async replug(way) {
    this.host.replug();
    this.frames = new Frames();
    await this.connect(way);
    return (await this.hear(({ kind, at }) => kind === 'progress' && at > this.greeted)).accepted;
  }

  listen(packet) {
    for (const message of this.frames.feed(packet)) {
      const heard = { at: this.board.now, ...parse(message) };
      this.heard.push(heard);
      if (heard.kind === 'progress') this.progress = heard;
      if (heard.kind === 'lines') this.onLines?.(heard);
    }
  }

  say(bytes) {
    return this.until(this.host.write(this.end.out, bytes));
  }

  /// The first message from now on, or of those not looked at yet, that fits.
  async hear(fits, limitMs = 2000) {
    let found;
    const look = () => {
      const at = this.heard.findIndex(fits);
      if (at >= 0) [found] = this.heard.splice(at, 1);
      return found !== undefined;
    };
    if (!(await this.board.run(look, limitMs * MS))) {
      throw new Error(`not heard in ${limitMs} ms; last progress ${JSON.stringify(this.progress)}, printed ${this.printer.taken.length}`);
    }
    return found;
  }

  /// Sends a job and waits for its end, keeping to the credits; `piece` bytes in a frame. `asking`: how the lines are is
  /// asked again and again meanwhile, and how many nanoseconds each answer took goes there.
  async print(number, kind, bytes, { piece = 900, limitMs = 20_000, from = 0, until = () => false, asking = null } = {}) {
    await this.say(begin(number, kind, bytes.length));
    await this.hear((heard) => heard.kind === 'progress' && heard.job === number);
    let [next, sending, stop, askAt] = [from, false, false, 0];
    const ended = () => ['done', 'cancelled', 'broken', 'lost'].includes(this.progress.state) && this.progress.job === number;
    const step = () => {
      stop ||= until(next);
      // Never in the middle of a frame.
      if (ended() || (stop && !sending)) return true;
      if (asking && !sending && this.board.now >= askAt) {
        const [request, asked] = [++this.requests, this.board.now];
        askAt = Infinity;
        sending = true;
        this.host.write(this.end.out, ask(request, 0)).then(() => { sending = false; });
        this.onLines = (heard) => {
          if (heard.request !== request) return;
          asking.push(heard.at - asked);
          askAt = heard.at + 3 * MS;
        };
      }
      if (!sending && !stop && next < Math.min(this.progress.limit, bytes.length)) {
        const end = Math.min(next + piece, this.progress.limit, bytes.length);
        sending = true;
        this.host.write(this.end.out, data(number, next, bytes.subarray(next, end))).then(() => { sending = false; });
        next = end;
      }
      return false;
    };
    if (!(await this.board.run(step, limitMs * MS))) {
      throw new Error(`the job does not end: sent ${next} of ${bytes.length}, ${JSON.stringify(this.progress)}, taken ${this.printer.taken.length}`);
    }
    return this.progress;
  }

  /// Stores a job in the board's flash, and waits for its end.
  async store(number, kind, bytes, name, limitMs = 60_000) {
    await this.say(store(number, kind, bytes.length, name));
    await this.hear((heard) => heard.kind === 'progress' && heard.job === number);
    let [next, sending] = [0, false];
    const step = () => {
      if (['stored', 'cancelled', 'broken'].includes(this.progress.state) && this.progress.job === number) return true;
      if (!sending && next < Math.min(this.progress.limit, bytes.length)) {
        const end = Math.min(next + 900, this.progress.limit, bytes.length);
        sending = true;
        this.host.write(this.end.out, data(number, next, bytes.subarray(next, end))).then(() => { sending = false; });
        next = end;
      }
      return this.board.off;
    };
    if (!(await this.board.run(step, limitMs * MS))) throw new Error(`the job is not stored: ${JSON.stringify(this.progress)}`);
    return this.progress;
  }

  /// What is stored, one after the other.
  async stored() {
    const jobs = [];
    for (let index = 0; ; index++) {
      const request = ++this.requests;
      await this.say(listStored(request, index));
      const { job, room, total } = await this.hear((heard) => heard.kind === 'stored' && heard.request === request);
      if (!job) return { jobs, room, total };
      jobs.push(job);
    }
  }

  /// Asks, and gives the answer.
  async ask(what, limitMs = 3000) {
    const request = ++this.requests;
    await this.say(ask(request, what));
    return this.hear((heard) => heard.request === request, limitMs);
  }
}
