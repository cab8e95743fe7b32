// The other pages that the program writes: the display's and the report.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { resolve } from 'node:path';
import test from 'node:test';
import { open } from './browser.mjs';

const folder = resolve(process.env.FOILPRESS_PAGE ?? '.');
const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const desk = { width: 1000, height: 760, webgl: false, beside: true };

/** Runs in a page, and fails if the page complained or axe-core finds something serious. */
async function visit(name, how, run) {
  const { browser, page, complaints } = await open(`${folder}/${name}`, how);
  try {
    await run(page);
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => window.axe.run());
    const serious = violations.filter(({ impact }) => impact === 'serious' || impact === 'critical');
    assert.deepEqual(serious.map(({ id, nodes }) => [id, nodes.map((node) => node.html)]), []);
    assert.deepEqual(complaints, []);
  } finally {
    await browser.close();
  }
}

for (const colorScheme of ['light', 'dark']) {
  test(`the display follows mouse and keyboard, ${colorScheme}`, () => visit('wall/display.html', { ...desk, colorScheme }, async (page) => {
    const drawn = () => page.evaluate(() => ['seen', 'mask'].map((id) => document.getElementById(id).toDataURL()).join());
    await page.waitForSelector('#frames [aria-checked="true"]');
    await page.waitForFunction(() => document.getElementById('seen').width > 1);
    /** What was done must change the picture, which is drawn in the next frames. */
    const changes = async (name, run) => {
      const before = await drawn();
      await run();
      for (let i = 0; i < 40 && (await drawn()) === before; i++) await page.waitForTimeout(50);
      assert.notEqual(await drawn(), before, name);
    };
    const box = await page.locator('#seen').boundingBox();
    await changes('drag', async () => {
      await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
      await page.mouse.down();
      await page.mouse.move(box.x + 0.9 * box.width, box.y + 0.3 * box.height);
      await page.mouse.up();
    });
    await page.focus('#seen');
    await changes('arrows', async () => { for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft'); });
    await changes('eye used to it', () => page.click('#adapted'));
    await page.focus('#frames [aria-checked="true"]');
    await changes('frames', () => page.keyboard.press('ArrowRight'));
    assert.equal(await page.locator('#frames [aria-checked="true"]').count(), 1);
    await changes('shift', async () => {
      await page.locator('#placing input').first().focus();
      for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowRight');
    });
    await changes('start again', () => page.click('#reset'));
    assert.equal(await page.isVisible('#message'), false);
  }));

  test(`the report shows every picture, ${colorScheme}`, () => visit('print/report.html', { ...desk, colorScheme }, async (page) => {
    const broken = await page.evaluate(async () => {
      const all = [...document.images];
      all.forEach((image) => { image.loading = 'eager'; });
      await Promise.all(all.map((image) => image.decode().catch(() => {})));
      return all.filter((image) => image.naturalWidth === 0).map((image) => image.src);
    });
    assert.deepEqual(broken, []);
    assert.ok((await page.locator('img').count()) > 3);
    // No link within the page is dead.
    const links = await page.locator('a[href^="#"]').evaluateAll((all) => all.map((a) => a.getAttribute('href').slice(1)));
    for (const id of links) assert.ok(await page.evaluate((target) => document.getElementById(target) !== null, id), id);
  }));
}
