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
  await page.waitForSelector('#takes:has-text("1 sheet; this one takes about")');
  await page.waitForFunction((count) => document.querySelectorAll('#passes li').length === count, passes);
  await page.waitForFunction(() => document.querySelector('#preview').naturalWidth > 100);
  assert.match(await page.textContent('#passes li'), /dots, about \d+\.\d\d m of ribbon/);
}

/** The value of a field of the job, once it is this. */
const has = (page, name, value) => page.waitForFunction(
  ([field, wanted]) => Math.abs(document.querySelector(`[name="${field}"]`).value - wanted) < 0.06, [name, value]);

/** Types into a field of the job, as somebody who then goes on to the next one. */
async function type(page, name, value) {
  await page.fill(`[name="${name}"]`, value);
  await page.press(`[name="${name}"]`, 'Tab');
}

test('a file is dropped, placed, looked at and printed', () => visited(address, 'desk', { width: 1000, height: 900, webgl: false, colorScheme: 'light', refusals: 2 }, async (page) => {
  await page.waitForSelector('#size option', { state: 'attached' });
  await page.selectOption('#size', { label: 'postcard' });
  await page.click('#load button');
  await page.waitForFunction(async () => (await (await fetch('/desk.json')).json()).loaded.size.startsWith('jpn_hagaki'));
  await drop(page, '<img src=x> leaf.png');
  await planned(page, 1);
  await line(page, '<img src=x> leaf.png', 'held');
  assert.equal(await page.locator('#jobs img').count(), 0);
  // By numbers, by keys, by hand: each moves what is printed.
  await type(page, 'wide', '20');
  await has(page, 'wide', 20);
  await type(page, 'left', '30');
  await type(page, 'top', '40');
  await has(page, 'left', 30);
  await has(page, 'top', 40);
  await page.focus('#stage');
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowRight');
  await has(page, 'left', 32);
  const [sheet, piece] = await Promise.all(['#paper', '#piece'].map((one) => page.locator(one).boundingBox()));
  const [x, y] = [piece.x + piece.width / 3, piece.y + piece.height / 3];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + sheet.width / 10, y + sheet.width / 20, { steps: 4 });
  await page.mouse.up();
  // A tenth of a sheet of 100 mm.
  await has(page, 'left', 42);
  await has(page, 'top', 45);
  // Its corner makes it larger, and where it lies stays.
  await page.selectOption('#ground', 'black');
  await page.uncheck('#inks input');
  await page.check('#inks input');
  await page.click('#dots');
  await page.click('#farther');
  // A place off the sheet is told, and nothing is lost.
  await type(page, 'left', '300');
  await page.waitForSelector('#said:has-text("lies off the sheet")');
  await type(page, 'left', '42');
  await planned(page, 1);
  await has(page, 'left', 42);
  // White is a choice of two clicks.
  await page.selectOption('[name="FoilpressWhite"]', 'Under');
  await planned(page, 2);
  await page.click('#go');
  await page.click('#history summary');
  await page.waitForSelector('#over li:has-text("leaf.png"):has-text(": printed")');
  await page.waitForFunction(() => document.querySelector('#over img').naturalWidth > 10);
  assert.equal(await page.isVisible('#plan'), false);
  // What is no document is told, and stays no job.
  await page.setInputFiles('#file', { name: 'words.txt', mimeType: 'text/plain', buffer: Buffer.from('hello') });
  await page.waitForFunction(() => document.querySelector('#said').textContent !== '');
  assert.equal(await page.locator('#over li').count(), 1);
  assert.equal(await page.locator('#jobs li').count(), 0);
  // Once more: it lies where it lay, and waits.
  await page.click('#over button:has-text("Print again")');
  await planned(page, 2);
  await has(page, 'left', 42);
  // A second tab shows what the first one set, and sets no more than it has changed.
  const tab = await page.context().newPage();
  await tab.goto(address);
  await tab.waitForFunction(() => document.querySelector('#size').value.startsWith('jpn_hagaki'));
  await tab.selectOption('#kind', 'film');
  await tab.click('#load button');
  await tab.waitForFunction(async () => (await (await fetch('/desk.json')).json()).loaded.kind === 'film');
  await page.waitForFunction(() => document.querySelector('#kind').value === 'film');
  assert.match(await page.inputValue('#size'), /^jpn_hagaki/);
  await tab.close();
}));

test('a phone draws a chart, and takes it out of the queue', () => visited(address, 'desk', { width: 390, height: 844, touch: true, webgl: false, colorScheme: 'dark', refusals: 1 }, async (page) => {
  await page.waitForSelector('#which option', { state: 'attached' });
  await page.locator('summary', { hasText: 'Or a chart' }).tap();
  await page.selectOption('#which', 'heads');
  await page.waitForSelector('#look:has-text("streak in every ink is the head")');
  await page.tap('#chart');
  await planned(page, 4);
  await line(page, 'chart heads', 'held');
  // Nothing is wider than the phone.
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
  await page.locator('#jobs li', { hasText: 'chart heads' }).locator('button', { hasText: 'Cancel' }).tap();
  await page.waitForSelector('#jobs li:has-text("chart heads")', { state: 'detached' });
  // A chart without room says so.
  await page.selectOption('#which', 'ramp');
  await page.tap('#chart');
  await page.waitForFunction(() => /ramp/.test(document.querySelector('#said').textContent));
  // Every control can be hit by a finger; a box to tick by its words, too.
  const hit = 'button:visible, select:visible, input:not([type="checkbox"]):visible, label:has([type="checkbox"]):visible';
  const small = await page.locator(hit).evaluateAll((all) => all.filter((one) => one.getBoundingClientRect().height < 44).map((one) => one.outerHTML));
  assert.deepEqual(small, []);
}));
