// Accidents, at random but the same for the same seed: whatever happens on the cables and at the printer, the printer gets
// the same bytes, within its timing.
//
// FOILPRESS_RUNS is how many runs; a run that fails says its seed.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, job, legal, random, same, skip } from './bench.mjs';
import { data, hello } from './frames.mjs';

const RUNS = Number(process.env.FOILPRESS_RUNS ?? 50);
// A minute of waiting is a second of this machine's; a few are enough.
const MINUTE = 60_000 * MS;

/// The ways in which a conversation goes wrong. Each begins between two frames.
const ACCIDENTS = {
  /// The cable is pulled, in the middle of a frame.
  async cut(bench, bytes, pick, way) {
    const frame = data(3, bench.progress.accepted, bytes.subarray(bench.progress.accepted, bench.progress.accepted + 1 + pick(900)));
    bench.host.write(bench.end.out, frame.subarray(0, 1 + pick(frame.length))).catch(() => {});
    await bench.pass(pick(3));
    await bench.replug(way);
  },
  /// The program is killed in the middle of a frame, and the next one opens the same or the other way.
  async killed(bench, bytes, pick, way) {
    const frame = data(3, bench.progress.accepted, bytes.subarray(bench.progress.accepted, bench.progress.accepted + 1 + pick(900)));
    await bench.say(frame.subarray(0, pick(frame.length)));
    bench.host.read(bench.end.in, null);
    if (bench.end.class === 0x0a) await bench.until(bench.host.openSerial(bench.end.number - 1, false));
    await bench.open(way);
  },
  /// The board is plugged into another port.
  async replug(bench, bytes, pick, way) {
    await bench.replug(way);
  },
  async garbage(bench, bytes, pick) {
    await bench.say(Uint8Array.from({ length: 1 + pick(2500) }, () => pick(256)));
  },
  async repeated(bench, bytes, pick) {
    const again = pick(bench.progress.accepted + 1);
    await bench.say(data(3, again, bytes.subarray(again, again + 300)));
  },
  async damaged(bench, bytes, pick) {
    const frame = data(3, bench.progress.accepted, bytes.subarray(bench.progress.accepted, bench.progress.accepted + 300));
    frame[1 + pick(frame.length - 2)] ^= 1 << pick(8);
    await bench.say(frame);
  },
  /// A frame is lost on the way: what follows begins too far on.
  async lost(bench, bytes, pick) {
    const at = bench.progress.accepted + 1 + pick(900);
    await bench.say(data(3, at, bytes.subarray(at, at + 300)));
  },
  async reordered(bench, bytes, pick) {
    const at = bench.progress.accepted;
    const [first, second] = [1 + pick(400), 1 + pick(400)];
    await bench.say(data(3, at + first, bytes.subarray(at + first, at + first + second)));
    await bench.say(data(3, at, bytes.subarray(at, at + first)));
  },
  /// The workstation sleeps for a while.
  async silence(bench, bytes, pick) {
    await bench.pass(pick(500));
  },
};

test('whatever happens on the cables, the printer gets the same bytes', { skip }, async (t) => {
  const happened = {};
  const note = (what) => { happened[what] = (happened[what] ?? 0) + 1; };
  const names = Object.keys(ACCIDENTS);
  for (let seed = 1; seed <= RUNS; seed++) {
    const pick = random(seed);
    const bench = new Bench({ busyAfter: pick(500), work: 200 + pick(4000), ack: 500 + pick(2000) });
    const [kind, name] = pick(2) ? [RAW, 'small.rgl'] : [STREAMS, 'small.streams'];
    const [bytes, expected] = [job(name), job('small.rgl')];
    for (let i = seed % 30 === 0 ? 1 : pick(4); i > 0; i--) {
      const [what, line, level] = [['busy', null, 1], ['paper out', 'paperOut', 1], ['off line', 'select', 0], ['error', 'fault', 0]][pick(4)];
      const long = seed % 30 === 0 && i === 1;
      note(what);
      if (long) note('for a minute');
      bench.printer.pauses.push({ after: 1 + pick(expected.length - 1), line, level, ns: long ? MINUTE : pick(10 * MS) });
    }
    try {
      await bench.connect(pick(2) ? 'bulk' : 'serial');
      const limitMs = 5 * 60_000;
      let from = 0;
      for (let i = 1 + pick(4); i > 0; i--) {
        const at = from + pick(3000);
        await bench.print(3, kind, bytes, { from, piece: 1 + pick(900), limitMs, until: (sent) => sent >= at });
        const what = names[pick(names.length)];
        note(what);
        await ACCIDENTS[what](bench, bytes, pick, pick(2) ? 'bulk' : 'serial');
        await bench.pass(pick(10));
        await bench.say(Uint8Array.of(0));
        await bench.say(hello());
        const asked = bench.board.now;
        from = (await bench.hear(({ kind: heard, job: number, at: when }) => heard === 'progress' && number === 3 && when > asked)).accepted;
        if (bench.progress.state === 'done') break;
      }
      assert.equal((await bench.print(3, kind, bytes, { from, limitMs })).state, 'done');
      same(bench.printer.taken, expected);
      legal(bench.printer);
    } catch (error) {
      error.message = `seed ${seed}: ${error.message}`;
      throw error;
    }
  }
  t.diagnostic(`${RUNS} runs, ${JSON.stringify(happened)}`);
  const never = [...names, 'busy', 'paper out', 'off line', 'error'].filter((what) => !happened[what]);
  assert.ok(RUNS < 50 || never.length === 0, `never happened, so it was not tried: ${never}`);
});
