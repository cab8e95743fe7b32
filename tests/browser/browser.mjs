// A real browser with the page in it, watched: whatever it asks of a network or complains of is kept.

import { dirname } from 'node:path';
import { chromium } from 'playwright-core';

/**
 * @param {{ width: number, height: number, touch?: boolean, webgl?: boolean, colorScheme?: 'light' | 'dark', beside?: boolean,
 *   scale?: number, before?: [(given: any) => void, any] }} how
 * `beside` lets a page show the pictures that lie beside it; `before` runs in the page before its own script.
 */
export async function open(file, { width, height, touch = false, webgl = true, colorScheme = 'light', beside = false, scale = 1, before }) {
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
    const own = request.url().split('#')[0] === `file://${file}`
      || (beside && request.resourceType() === 'image' && request.url().startsWith(`file://${dirname(file)}/`));
    if (!/^(data|blob):/.test(request.url()) && !own) complaints.push(`asked for ${request.url()}`);
  });
  await page.goto(`file://${file}`);
  if (webgl) await page.waitForSelector('#stage.ready', { timeout: 60_000 });
  return { browser, page, complaints };
}

/** Waits until the hand has rested and the picture is drawn finely, and returns the address. */
export async function rested(page) {
  await page.waitForFunction(() => !document.querySelector('#stage.changing'));
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  return new URLSearchParams(new URL(page.url()).hash.slice(1));
}
