// The other pages that the program writes. With `FOILPRESS_KEEP` a picture of each stays in that folder.

import assert from 'node:assert/strict';
import { resolve } from 'node:path';
import test from 'node:test';
import { rested, visited } from './browser.mjs';

const folder = resolve(process.env.FOILPRESS_PAGE ?? '.');
const desk = { width: 1000, height: 760, webgl: false, beside: true };

/** @type {(name: string, how: any, run: (page: import('playwright-core').Page) => Promise<void>) => Promise<void>} */
const visit = (name, how, run) => visited(`${folder}/${name}`, name, how, run);

for (const colorScheme of ['light', 'dark']) {
  test(`the display follows mouse and keyboard, ${colorScheme}`, () => visit('wall/display.html', { ...desk, touch: true, colorScheme }, async (page) => {
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
    await changes('finger', () => page.touchscreen.tap(box.x + 0.2 * box.width, box.y + 0.6 * box.height));
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
    const chosen = () => page.locator('#frames [aria-checked="true"]').textContent();
    const speed = page.locator('#speed');
    const slow = await page.locator('#playing output').textContent();
    await speed.focus();
    await page.keyboard.press('End');
    assert.notEqual(await page.locator('#playing output').textContent(), slow);
    const first = await chosen();
    await page.click('#play');
    assert.equal(await page.getAttribute('#play', 'aria-pressed'), 'true');
    const seen = new Set();
    for (let i = 0; i < 60 && seen.size < 2; i++) {
      seen.add(await chosen());
      await page.waitForTimeout(50);
    }
    assert.ok(seen.size > 1 && seen.has(first), `${[...seen]}`);
    await page.click('#play');
    const still = await chosen();
    await page.waitForTimeout(600);
    assert.equal(await chosen(), still);
    assert.equal(await page.isVisible('#message'), false);
    // On a phone what is seen stays in sight, and a key comes to nothing beneath it.
    await page.setViewportSize({ width: 390, height: 700 });
    for (let i = 0; i < 30; i++) {
      await page.keyboard.press('Tab');
      const covered = await page.evaluate(() => {
        const [found, figure] = [document.activeElement, document.querySelector('#seenFigure').getBoundingClientRect()];
        if (figure.top < 0 || figure.bottom > innerHeight) return 'out of sight';
        return !found.closest('aside') || found.getBoundingClientRect().top >= figure.bottom ? '' : found.outerHTML;
      });
      assert.equal(covered, '');
    }
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

  test(`the sheet's page shows the print beside its document, ${colorScheme}`, () => visit('print/sheet.html', { ...desk, webgl: true, colorScheme }, async (page) => {
    const at = await rested(page);
    assert.deepEqual([at.get('show'), at.get('with')], ['document', 'printed']);
    const before = await page.locator('#picture').screenshot();
    await page.focus('#picture');
    for (let i = 0; i < 8; i++) await page.keyboard.press('ArrowRight');
    assert.notEqual((await rested(page)).get('light'), at.get('light'));
    assert.notDeepEqual(await page.locator('#picture').screenshot(), before);
  }));

  test(`a comparison follows mouse, touch and keyboard, ${colorScheme}`, () => visit('photos/compare.html', { ...desk, touch: true, colorScheme }, async (page) => {
    const pairs = page.locator('figure.pair');
    assert.equal(await pairs.count(), 2);
    for (const pair of await pairs.all()) {
      await pair.scrollIntoViewIfNeeded();
      const [slider, choice, over] = ['input[type="range"]', 'select', '.over'].map((part) => pair.locator(part));
      const value = async () => Number(await slider.inputValue());
      /** The photograph is drawn as far as the slider says. */
      const split = async (expected, what) => {
        assert.ok(Math.abs((await value()) - expected) <= 1, `${what}: ${await value()}, not ${expected}`);
        const clip = await over.evaluate((image) => getComputedStyle(image).clipPath);
        assert.ok(Math.abs(Number(/([\d.]+)%/.exec(clip)?.[1] ?? 0) - (100 - (await value()))) < 0.01, clip);
      };
      await split(50, 'at first');
      await slider.focus();
      await page.keyboard.press('Home');
      await split(0, 'keyboard');
      const box = await pair.locator('.stage').boundingBox();
      await page.mouse.move(box.x + 0.2 * box.width, box.y + box.height / 2);
      await page.mouse.down();
      await page.mouse.move(box.x + 0.7 * box.width, box.y + box.height / 2);
      await page.mouse.up();
      await split(70, 'mouse');
      await page.touchscreen.tap(box.x + 0.3 * box.width, box.y + box.height / 2);
      await split(30, 'touch');
      // Each view is one picture, and all of them differ.
      const views = new Set();
      for (let i = 0; i < (await choice.locator('option').count()); i++) {
        await choice.selectOption({ index: i });
        const shown = pair.locator('img.view:visible');
        assert.equal(await shown.count(), 1);
        views.add(await shown.getAttribute('src'));
      }
      assert.equal(views.size, 4);
      assert.equal(await pair.locator('img').evaluateAll((all) => all.filter((image) => image.naturalWidth === 0).length), 0);
    }
    // Figures for both photographs, and all together.
    assert.equal(await page.locator('h2:has-text("Figures") + div tr').count(), 4);
  }));

  for (const [what, name, pictures] of [
    ['plan', 'print/plan.html', 'img'], ['measurement', 'mine/report.html', 'img, figure svg'], ['two libraries', 'diff.html', 'figure svg'],
    ['gamut', 'gamut.html', 'figure svg'],
  ]) {
    test(`the page of the ${what} has the colours that were asked for, ${colorScheme}`, () => visit(name, { ...desk, colorScheme }, async (page) => {
      assert.ok((await page.locator(pictures).count()) > 0);
      /** How light text and ground are. */
      const lightness = () => page.evaluate(() => {
        const { color, backgroundColor } = getComputedStyle(document.documentElement);
        return [color, backgroundColor].map((rgb) => Number(/\d+/.exec(rgb)[0]));
      });
      const [text, ground] = await lightness();
      assert.equal(text > ground, colorScheme === 'dark', `${text} on ${ground}`);
      // Paper is white, whatever the screen was.
      await page.emulateMedia({ media: 'print' });
      assert.deepEqual((await lightness())[1], 255);
      await page.emulateMedia({ media: null });
    }));
  }
}
