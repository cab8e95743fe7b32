// A job goes into the board's flash, the program leaves, and the board prints it alone: its flash is written by the image's own code, and
// the supply goes in the middle of it.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Bench, MS, RAW, STREAMS, job, legal, random, same, skip } from './bench.mjs';
import { deleteStored, printStored } from './frames.mjs';

/// Runs until the printer has had so many bytes.
const taken = (bench, count, limitMs) => bench.board.run(() => bench.printer.taken.length >= count, limitMs * MS);

test('a stored job is printed with no cable to a host, by the button, again and again', { skip }, async () => {
  const expected = job('small.rgl');
  let bench = new Bench();
  await bench.connect('bulk');
  const { room, total } = await bench.stored();
  // 2 MiB, of which 128 KiB are the image's and two sectors the diary's.
  assert.equal(total, 14 * 252 + (480 - 2 - 1) * 15 * 252);
  assert.equal(room, total);
  assert.equal((await bench.store(5, STREAMS, job('small.streams'), 'small')).state, 'stored');
  assert.equal((await bench.store(6, RAW, expected, 'small, byte for byte')).state, 'stored');
  assert.equal(bench.printer.taken.length, 0);
  const { jobs } = await bench.stored();
  assert.deepEqual(jobs.map(({ job, name }) => [job, name]), [[5, 'small'], [6, 'small, byte for byte']]);

  // The supply goes, and comes back from somewhere without a host.
  bench = bench.restarted(false);
  await bench.pass(50);
  const resets = bench.printer.resets;
  await bench.board.press(200);
  assert.ok(await taken(bench, expected.length, 2000));
  same(bench.printer.taken, expected);
  legal(bench.printer);
  // By its diary it knew that the printer stood between two jobs.
  assert.equal(bench.printer.resets, resets);

  // With a host again: the first one by its number, then it goes.
  await bench.connect('bulk');
  bench.printer.taken = [];
  await bench.say(printStored(77, 5));
  await bench.hear((heard) => heard.kind === 'progress' && heard.job === 77 && heard.state === 'done');
  same(bench.printer.taken, expected);
  await bench.say(deleteStored(900, 5));
  await bench.hear((heard) => heard.kind === 'stored' && heard.request === 900);
  assert.deepEqual((await bench.stored()).jobs.map(({ job }) => job), [6]);
});

test('the button holds a job and cancels it', { skip }, async () => {
  const expected = job('page.rgl');
  // A slow printer: there is time to press.
  const bench = new Bench({ work: 10_000 });
  await bench.connect('bulk');
  assert.equal((await bench.store(5, STREAMS, job('page.streams'), 'page')).state, 'stored');
  await bench.board.press(100);
  assert.ok(await taken(bench, 1000, 2000));
  await bench.board.press(100);
  const held = bench.printer.taken.length;
  await bench.pass(100);
  assert.equal(bench.printer.taken.length, held);
  assert.ok(held < expected.length / 2);
  await bench.board.press(3100);
  await bench.hear((heard) => heard.kind === 'progress' && heard.state === 'cancelled', 3000);
  assert.ok(bench.printer.taken.length < expected.length);
});

test('ten cuts of the supply while the image stores and prints cost nothing but the sheet in the rollers', { skip }, async () => {
  const next = random(5);
  const expected = job('small.rgl'), streams = job('small.streams');
  let bench = new Bench();
  await bench.connect('bulk');
  assert.equal((await bench.store(1, STREAMS, streams, 'first')).state, 'stored');
  let [stored, lost] = [[1], 0];
  for (let cut = 0; cut < 10; cut++) {
    if (cut % 2 === 0) {
      bench.board.cutAfter = next(32);
      await bench.store(10 + cut, STREAMS, streams, 'more').catch(() => {});
      assert.ok(bench.board.off || bench.progress.state === 'stored');
    } else {
      // In the middle of the sheet, whatever the flash does.
      await bench.board.press(100);
      await taken(bench, next(expected.length - 100), 2000);
    }
    const half = bench.printer.taken.length;
    bench = bench.restarted(false);
    const { resets } = bench.printer;
    await bench.connect('bulk');
    const { jobs } = await bench.stored();
    const found = jobs.map(({ job }) => job);
    assert.ok([stored, [...stored, 10 + cut]].some((all) => all.join() === found.join()), `${found} after ${stored}`);
    stored = found;
    const torn = half > 0 && half < expected.length;
    if (cut % 2 === 1) {
      assert.equal(torn, bench.progress.state === 'lost');
      lost += 1;
    }
    // What comes next is a whole sheet, behind a reset if there is a part of one.
    bench.printer.taken = [];
    await bench.say(printStored(100 + cut, 1));
    await bench.hear((heard) => heard.kind === 'progress' && heard.job === 100 + cut && heard.state === 'done');
    same(bench.printer.taken, expected);
    assert.equal(bench.printer.resets, resets + (torn ? 1 : 0));
    bench.printer.taken = [];
  }
  assert.ok(lost === 5 && stored.length > 1 && stored.length < 6, `${lost} ${stored}`);
});

test('a flash that never ends an operation costs the store until the supply was away, and nothing else', { skip }, async () => {
  let bench = new Bench();
  await bench.connect('bulk');
  const bytes = job('small.rgl');
  bench.board.flashHangs = true;
  await assert.rejects(bench.store(5, RAW, bytes, 'leaf', 500));
  bench = bench.restarted();
  // If it were begun again it would hang again.
  bench.board.flashHangs = true;
  await bench.connect('bulk');
  assert.equal((await bench.stored()).total, 0);
  assert.equal((await bench.print(6, RAW, bytes)).state, 'done');
  same(bench.printer.taken, bytes);
  bench = bench.restarted(false);
  await bench.connect('bulk');
  assert.ok((await bench.stored()).total > 1_000_000);
});
