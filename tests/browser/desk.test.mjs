// The desk of the print server, as somebody at a computer and somebody with a phone use it.

import assert from 'node:assert/strict';
import test from 'node:test';
import { visited } from './browser.mjs';

const address = process.env.FOILPRESS_PAGE ?? 'http://localhost:8631/';

/** A picture of 20 x 20 mm at 300 dpi, dropped as from a file manager. */
async function drop(page, name) {
  const files = await page.evaluateHandle(async (called) => {
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [236, 236];
    const pen = canvas.getContext('2d');
    pen.fillStyle = 'white';
    pen.fillRect(0, 0, 236, 236);
    pen.fillStyle = 'black';
    pen.fillRect(60, 60, 120, 80);
    const blob = await new Promise((done) => canvas.toBlob(done));
    const transfer = new DataTransfer();
    transfer.items.add(new File([blob], called, { type: 'image/png' }));
    return transfer;
  }, name);
  await page.dispatchEvent('#drop', 'dragover', { dataTransfer: files });
  assert.ok(await page.locator('#drop.over').count());
  await page.dispatchEvent('#drop', 'drop', { dataTransfer: files });
}

/** The line of a job in the queue, once it says this. */
const line = (page, name, words) => page.waitForSelector(`#jobs li:has-text("${name}"):has-text("${words}")`);

/** What is drawn is shown with its passes before anything is printed. */
async function planned(page, passes) {
  await page.waitForSelector('#plan-words:has-text("1 sheet; the first one takes these passes")');
  assert.equal(await page.locator('#passes li').count(), passes);
  await page.waitForFunction(() => document.querySelector('#preview').naturalWidth > 100);
  assert.match(await page.textContent('#passes li'), /dots, about \d+\.\d\d m of ribbon/);
}

test('a file is dropped, looked at and printed', () => visited(address, 'desk', { width: 1000, height: 760, webgl: false, colorScheme: 'light', refusals: 1 }, async (page) => {
  await page.waitForSelector('#size option', { state: 'attached' });
  await page.selectOption('#size', { label: 'postcard' });
  await page.click('#load button');
  await page.waitForFunction(async () => (await (await fetch('/desk.json')).json()).loaded.size.startsWith('jpn_hagaki'));
  await drop(page, '<img src=x> leaf.png');
  await planned(page, 1);
  await line(page, '<img src=x> leaf.png', 'held');
  assert.equal(await page.locator('#jobs img').count(), 0);
  await page.click('#go');
  await line(page, 'leaf.png', ': printed');
  assert.equal(await page.isVisible('#plan'), false);
  // What is no document is told, and stays no job.
  await page.setInputFiles('#file', { name: 'words.txt', mimeType: 'text/plain', buffer: Buffer.from('hello') });
  await page.waitForFunction(() => document.querySelector('#said').textContent !== '');
  assert.equal(await page.locator('#jobs li').count(), 1);
  // A picture of the plan in sight is part of what axe looks at.
  await page.selectOption('#which', 'first');
  await page.click('#chart button');
  await planned(page, 1);
}));

test('a phone draws a chart, and takes it out of the queue', () => visited(address, 'desk', { width: 390, height: 844, touch: true, webgl: false, colorScheme: 'dark', refusals: 1 }, async (page) => {
  await page.waitForSelector('#which option', { state: 'attached' });
  await page.selectOption('#which', 'heads');
  assert.match(await page.textContent('#look'), /streak in every ink is the head/);
  await page.tap('#chart button');
  await planned(page, 4);
  await line(page, 'chart heads', 'held');
  await page.locator('#jobs button', { hasText: 'Cancel' }).first().tap();
  await line(page, 'chart heads', 'cancelled');
  // A chart without room says so.
  await page.selectOption('#which', 'ramp');
  await page.tap('#chart button');
  await page.waitForFunction(() => /ramp/.test(document.querySelector('#said').textContent));
  // Every control can be hit by a finger.
  const small = await page.locator('button:visible, select:visible, input:visible').evaluateAll((all) => all.filter((one) => one.getBoundingClientRect().height < 44).map((one) => one.outerHTML));
  assert.deepEqual(small, []);
}));
