// A real browser with the page in it, watched: whatever it asks of a network or complains of is kept.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { dirname } from 'node:path';
import { chromium } from 'playwright-core';

const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/**
 * A page in a file, or at an address.
 * @param {string} place
 * @param {{ width: number, height: number, touch?: boolean, webgl?: boolean, colorScheme?: 'light' | 'dark', beside?: boolean,
 *   scale?: number, before?: [(given: any) => void, any] }} how
 * `beside` lets a page show the pictures that lie beside it; `before` runs in the page before its own script.
 */
export async function open(place, { width, height, touch = false, webgl = true, colorScheme = 'light', beside = false, scale = 1, before }) {
  const isServed = place.startsWith('http:');
  const address = isServed ? place : `file://${place}`;
  const browser = await chromium.launch({
    executablePath: process.env.FOILPRESS_CHROMIUM,
    // Software WebGL, which every machine has.
    args: ['--no-sandbox', '--js-flags=--expose-gc',
      ...(webgl ? ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'] : ['--disable-gpu', '--disable-3d-apis'])],
  });
  const context = await browser.newContext({ viewport: { width, height }, hasTouch: touch, isMobile: touch, colorScheme, deviceScaleFactor: scale });
  const page = await context.newPage();
  if (before) await page.addInitScript(...before);
  const complaints = [];
  page.on('console', (message) => {
    // The software renderer tells its authors that reading pixels is slow.
    if (['error', 'warning'].includes(message.type()) && !/GPU stall|GL Driver Message|WebGL/.test(message.text())) complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(error.message));
  page.on('request', (request) => {
    const own = request.url().split('#')[0] === address
      || (isServed && request.url().startsWith(address))
      || (beside && request.resourceType() === 'image' && request.url().startsWith(`${dirname(address)}/`));
    if (!/^(data|blob):/.test(request.url()) && !own) complaints.push(`asked for ${request.url()}`);
  });
  await page.goto(address);
  if (webgl) await page.waitForSelector('#stage.ready', { timeout: 60_000 });
  return { browser, page, complaints };
}

/** Waits until the hand has rested and the picture is drawn finely, and returns the address. */
export async function rested(page) {
  await page.waitForFunction(() => !document.querySelector('#stage.changing'));
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  return new URLSearchParams(new URL(page.url()).hash.slice(1));
}

/** Runs in a page, and fails if the page complained, or if axe-core finds anything on a desk or a phone. */
export async function visited(place, name, how, run) {
  const { browser, page, complaints } = await open(place, how);
  try {
    await run(page);
    await page.evaluate(axe);
    for (const width of [1280, 390]) {
      await page.setViewportSize({ width, height: 844 });
      const { violations } = await page.evaluate(() => window.axe.run());
      assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes.map((node) => node.html)]), [], `${width} pixels`);
      // Nothing is wider than a phone, but tables that scroll for themselves.
      // A page may have to draw anew at first.
      const fits = page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth, null, { timeout: 10_000 });
      await fits.catch(() => assert.fail(`wider than ${width} pixels`));
      if (process.env.FOILPRESS_KEEP) {
        await page.screenshot({ path: `${process.env.FOILPRESS_KEEP}/${name.replaceAll('/', '-')}-${how.colorScheme}-${width}.png`, fullPage: true });
      }
    }
    // A page may be told that something cannot be done, and the browser complains of that, too.
    const refusals = complaints.filter((text) => /status of 422/.test(text));
    assert.equal(refusals.length, how.refusals ?? 0);
    assert.deepEqual(complaints.filter((text) => !refusals.includes(text)), []);
  } finally {
    await browser.close();
  }
}
