// Every control of the page by mouse, touch and keyboard. `FOILPRESS_PAGE` names the page: a document with a hostile name.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import test from 'node:test';
import { deflateSync } from 'node:zlib';
import { open, rested } from './browser.mjs';

const file = process.env.FOILPRESS_PAGE;
const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const numbers = (text) => text.split(',').map(Number);

/** Software draws the picture: with a quarter of its dots unless everything is tried as it stands. */
const scale = process.env.FOILPRESS_FULL ? 1 : 0.5;

/** Runs in a page, and fails if the page complained. */
async function visit(how, run) {
  const { browser, page, complaints } = await open(file, { scale, ...how });
  try {
    await run(page);
    assert.deepEqual(complaints, []);
  } finally {
    await browser.close();
  }
}
const desk = { width: 900, height: 640 };
const phone = { width: 390, height: 780, touch: true };

/** A place on the sheet, beside lamp and handle. */
async function place(page) {
  const box = await page.locator('#picture').boundingBox();
  return [box.x + 0.66 * box.width, box.y + 0.6 * box.height];
}

async function drag(page, dx, dy, from) {
  const [x, y] = from ?? (await place(page));
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx / 2, y + dy / 2);
  await page.mouse.move(x + dx, y + dy);
  await page.mouse.up();
  return rested(page);
}

test('a hostile name is text and nothing else', () => visit(desk, async (page) => {
  const name = await page.locator('#name').textContent();
  assert.match(name, /<img src=x onerror=/);
  assert.equal(await page.evaluate(() => window.hacked), undefined);
  assert.equal(await page.locator('h1 *').count(), 0);
}));

test('the mouse drags light, sheet and picture, and the wheel zooms where it is', () => visit(desk, async (page) => {
  const before = await rested(page);
  let after = await drag(page, 60, -40);
  const [a, e] = numbers(after.get('light'));
  assert.ok(a > numbers((before.get('light') ?? '-25,30,0'))[0] + 5 && e > 32, after.get('light'));
  await page.click('[data-tool=sheet]');
  after = await drag(page, 80, 40);
  const [turn, tip] = numbers(after.get('tilt'));
  assert.ok(turn > 10 && tip < -5, after.get('tilt'));
  await page.click('[data-tool=move]');
  after = await drag(page, 50, 50);
  const [x, y] = numbers(after.get('pan'));
  assert.ok(x < 0 && y > 0, after.get('pan'));
  const [mx, my] = await place(page);
  await page.mouse.move(mx + 100, my);
  await page.mouse.wheel(0, -600);
  after = await rested(page);
  assert.ok(Number(after.get('zoom')) > 2, after.get('zoom'));
  assert.ok(numbers(after.get('pan'))[0] > x, 'the point under the mouse stays');
  await page.click('#whole');
  after = await rested(page);
  assert.deepEqual([after.get('zoom'), after.get('pan')], ['1', '0,0']);
  await page.click('#nearer');
  await page.click('#nearer');
  await page.click('#farther');
  after = await rested(page);
  assert.equal(after.get('zoom'), '1.5');
  // The lamp itself, and the handle.
  const lamp = await page.locator('.lamp').boundingBox();
  after = await drag(page, 30, 0, [lamp.x + 22, lamp.y + 22]);
  assert.ok(numbers(after.get('light'))[0] > a, `${after.get('light')} from ${a}, lamp at ${JSON.stringify(lamp)}`);
  const handle = await page.locator('#handle').boundingBox();
  after = await drag(page, 100, 0, [handle.x + 22, handle.y + 90]);
  assert.ok(Number(after.get('split')) > 0.55, after.get('split'));
}));

test('every view, every pass and every slider changes picture and address', () => visit(desk, async (page) => {
  const picture = () => page.evaluate(() => document.querySelector('canvas').toDataURL());
  await page.selectOption('#with', '');
  const seen = new Set();
  for (const show of ['document', 'mapped', 'printed', 'difference', 'stacks', 'passes']) {
    await page.click(`[data-show=${show}]`);
    assert.equal((await rested(page)).get('show'), show);
    seen.add(await picture());
  }
  assert.equal(seen.size, 6);
  await page.selectOption('#pass', '1');
  assert.equal((await rested(page)).get('pass'), '1');
  await page.click('[data-show=printed]');
  await page.selectOption('#with', 'stacks');
  assert.equal((await rested(page)).get('with'), 'stacks');
  await page.selectOption('#with', '');
  for (const slider of await page.locator('input[type=range]:visible').all()) {
    const [address, before] = [(await rested(page)).toString(), await picture()];
    await slider.focus();
    const upper = await slider.evaluate((input) => Number(input.value) > (Number(input.min) + Number(input.max)) / 2);
    for (let i = 0; i < 8; i++) await page.keyboard.press(upper ? 'ArrowLeft' : 'ArrowRight');
    const name = await slider.evaluate((input) => input.closest('label').textContent);
    assert.notEqual((await rested(page)).toString(), address, name);
    assert.notEqual(await picture(), before, name);
  }
  const before = await picture();
  await page.check('#probe');
  assert.equal((await rested(page)).get('probe'), '1');
  assert.notEqual(await picture(), before);
  await page.click('#more');
  assert.equal((await rested(page)).get('light').split(';').length, 2);
  await page.click('#lights button:first-child');
  await page.click('#fewer');
  assert.equal((await rested(page)).get('light').split(';').length, 1);
  // The focus stays among the lights, and each new light has a place of its own.
  const focused = () => page.evaluate(() => document.activeElement.id);
  for (const id of ['more', 'more', 'light4']) {
    await page.focus('#more');
    await page.keyboard.press('Enter');
    assert.equal(await focused(), id);
  }
  await page.focus('#light2');
  await page.keyboard.press('Enter');
  assert.equal(await focused(), 'light2');
  assert.equal(await page.getAttribute('#light2', 'aria-pressed'), 'true');
  const places = (await rested(page)).get('light').split(';').map(numbers);
  for (const [i, [a, e]] of places.entries()) {
    for (const [b, f] of places.slice(i + 1)) assert.ok(Math.hypot(a - b, e - f) > 20, JSON.stringify(places));
  }
  // Without a light there is nothing to slide.
  for (let i = 0; i < 4; i++) await page.click('#fewer');
  assert.equal((await rested(page)).get('light'), '');
  assert.deepEqual(await page.locator('#sliders-light .slider:visible span').allTextContents(), ['exposure', 'tone curve']);
  await page.evaluate(() => document.querySelectorAll('#sliders-light input').forEach((input) => input.dispatchEvent(new Event('input'))));
  await page.click('#reset');
  assert.equal((await rested(page)).get('probe'), '0');
}));

test('the keyboard reaches and does everything', () => visit(desk, async (page) => {
  await page.focus('#picture');
  const before = numbers((await rested(page)).get('light') ?? '-25,30');
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowUp');
  let now = await rested(page);
  assert.deepEqual(numbers(now.get('light')).slice(0, 2), [before[0] + 3, before[1] + 3]);
  await page.keyboard.press('Shift+ArrowRight');
  await page.keyboard.press('Alt+ArrowDown');
  await page.keyboard.press('+');
  now = await rested(page);
  assert.ok(numbers(now.get('tilt'))[0] > 0 && numbers(now.get('pan'))[1] !== 0 && Number(now.get('zoom')) > 1, now.toString());
  await page.keyboard.press('-');
  await page.keyboard.press('0');
  assert.equal((await rested(page)).get('zoom'), '1');
  await page.keyboard.press('Enter');
  assert.match(await page.locator('#spot').textContent(), /d = \d\.\d{3}/);
  for (const [key, tool] of [['t', 'sheet'], ['m', 'move'], ['l', 'light']]) {
    await page.keyboard.press(key);
    assert.equal(await page.locator(`[data-tool=${tool}]`).getAttribute('aria-pressed'), 'true');
  }
  await page.focus('#handle');
  await page.keyboard.press('Home');
  assert.equal((await rested(page)).get('split'), '0');
  await page.keyboard.press('ArrowRight');
  assert.equal((await rested(page)).get('split'), '0.02');
  await page.focus('.lamp');
  await page.keyboard.press('ArrowLeft');
  assert.equal(numbers((await rested(page)).get('light'))[0], before[0]);
  await page.focus('[data-show=document]');
  await page.keyboard.press('ArrowRight');
  assert.equal((await rested(page)).get('show'), 'mapped');
  // Everything that can be operated is reached by Tab.
  const reached = new Set();
  await page.evaluate(() => /** @type {HTMLElement} */ (document.activeElement).blur());
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement?.id || document.activeElement?.className || document.activeElement?.tagName));
  }
  for (const id of ['picture', 'handle', 'lamp', 'with', 'probe', 'share', 'reset']) assert.ok(reached.has(id), id);
}));

test('a key never comes to what the picture covers', () => visit({ width: 640, height: 430 }, async (page) => {
  for (const key of ['Tab', 'Shift+Tab']) {
    for (let i = 0; i < 45; i++) {
      await page.keyboard.press(key);
      const covered = await page.evaluate(() => {
        const found = document.activeElement;
        if (!found || found === document.body || found.closest('#stage')) return '';
        const [{ top, bottom }, stage] = [found, document.querySelector('#stage')].map((element) => element.getBoundingClientRect());
        return top >= stage.bottom && bottom <= innerHeight ? '' : found.outerHTML;
      });
      assert.equal(covered, '', `${key} ${i}`);
    }
  }
}));

test('materials are edited by mouse and keyboard, and the steps are there to copy', () => visit(desk, async (page) => {
  const picture = () => page.evaluate(() => document.querySelector('canvas').toDataURL());
  const steps = () => page.inputValue('#steps');
  await page.click('[data-show=document]');
  await page.selectOption('#with', '');
  await rested(page);
  const before = await picture();
  assert.equal(await steps(), '');
  await page.selectOption('#basis', '1');
  await page.focus('#sliders-edits label:nth-child(1) input');
  for (let i = 0; i < 20; i++) await page.keyboard.press('ArrowRight');
  let after = await rested(page);
  assert.equal(after.get('edit'), '1,2,ffffff,1');
  const rough = await picture();
  assert.notEqual(rough, before);
  const albedo = await page.locator('#sliders-edits label:nth-child(2) input').boundingBox();
  await page.mouse.click(albedo.x + 0.125 * albedo.width, albedo.y + albedo.height / 2);
  await page.fill('#tint', '#ff8000');
  after = await rested(page);
  assert.match(after.get('edit'), /^1,2,ff8000,0\.\d+$/);
  assert.notEqual(await picture(), rough);
  const text = await steps();
  assert.match(text, /^format = 1\ndocument = ".*"\nfingerprint = "[0-9a-f]{64}"\n\n\[\[step\]\]\nbasis = 1\nrougher = 2\.0\ntint = "#ff8000"\nalbedo = 0\.\d+\n$/);
  await page.click('#copySteps');
  await page.waitForFunction(() => /Copied|Selected/.test(document.querySelector('#copySteps').textContent));
  await page.waitForFunction(() => document.querySelector('#copySteps').textContent === 'Copy steps');
  assert.equal(await page.locator('#replay').textContent(), "foilpress factor 'a <b>' -o a.foil\nfoilpress edit a.foil --steps steps.toml -o edited.foil");
  const chip = () => page.locator('#basisColour').evaluate((found) => getComputedStyle(found).backgroundColor);
  const colours = [];
  for (const basis of ['0', '1', '2']) {
    await page.selectOption('#basis', basis);
    colours.push(await chip());
  }
  assert.equal(new Set(colours).size, 3, colours.join(' '));
  await page.evaluate(() => { location.hash = 'show=document&edit=1,x,ff8000,1;99,2,ffffff,1;0,2,<b>,1;-1,1,000000,1'; });
  assert.equal((await rested(page)).get('edit'), null);
  await page.evaluate(() => { location.hash = 'show=document&edit=0,2,ffffff,1'; });
  assert.equal((await rested(page)).get('edit'), '0,2,ffffff,1');
  // An address without edits is that of the document as it was.
  await page.evaluate(() => { location.hash = 'show=document'; });
  after = await rested(page);
  assert.deepEqual([after.get('edit'), await picture() === before], [null, true]);
  await page.evaluate(() => { location.hash = 'show=document&with=printed'; });
  assert.equal((await rested(page)).get('with'), 'printed');
  await page.evaluate(() => { location.hash = 'exposure=0'; });
  assert.equal((await rested(page)).get('with'), null);
  await page.evaluate((hash) => { location.hash = `${hash}&edit=0,2,ffffff,1`; }, 'show=document');
  await rested(page);
  await page.click('#unedit');
  after = await rested(page);
  assert.deepEqual([after.get('edit'), await steps(), await picture() === before], [null, '', true]);
  await page.click('[data-show=printed]');
  assert.equal(await page.isVisible('#edits'), false);
}));

test('a spot tells its curve, its mixture and the inks of its dot', () => visit(desk, async (page) => {
  // The description scrolls into sight: at once, lest a click comes while the picture is on its way.
  await page.emulateMedia({ reducedMotion: 'reduce' });
  const [x, y] = await place(page);
  await page.mouse.click(x - 60, y + 40);
  assert.equal(await page.locator('#spot svg path').count(), 2);
  const shares = (await page.locator('#mixture li b').allTextContents()).map((text) => Number.parseInt(text, 10));
  const sum = shares.reduce((a, b) => a + b, 0);
  assert.ok(sum >= 97 && sum <= 103, String(sum));
  assert.match(await page.locator('#dot').textContent(), /This dot: .+\(.+\)/);
  // One line each.
  for (const span of await page.locator('#spot figcaption span').all()) assert.ok((await span.boundingBox()).height < 30);
  // The mark lies where the spot does.
  const centre = async (/** @type {string} */ what) => {
    const box = await page.locator(what).boundingBox();
    return [box.x + box.width / 2, box.y + box.height / 2];
  };
  const near = ([a, b], [c, d]) => assert.ok(Math.hypot(a - c, b - d) < 2, `${[a, b]}, not ${[c, d]}`);
  const [mx, my] = await centre('#picture');
  // Looking may have scrolled the page; the picture stays in sight.
  const [px, py] = [mx + 80, my + 50];
  await page.mouse.click(px, py);
  const [nx, ny] = await centre('#picture');
  near(await centre('#ring'), [px + nx - mx, py + ny - my]);
  await page.click('#nearer');
  await rested(page);
  near(await centre('#ring'), [nx + 1.5 * 80, ny + 1.5 * 50]);
  for (const how of ['tilt=20,-15&distance=0.4', 'tilt=-15,10&distance=0&curl=0.06', 'view=25,10&distance=0.3&curl=0.08&pan=0.01,0.005']) {
    await page.evaluate((hash) => { location.hash = `show=printed&view=0,0&curl=0&pan=0,0&zoom=1&${hash}`; }, how);
    await rested(page);
    await page.mouse.click(nx + 70, ny - 40);
    near(await centre('#ring'), [nx + 70, ny - 40]);
  }
  // What was said of the spot follows an edit.
  const said = () => page.locator('#d').innerText();
  const before = await said();
  await page.evaluate(() => { location.hash = 'show=document&edit=0,3,ff0000,0.5;1,3,ff0000,0.5;2,3,ff0000,0.5'; });
  await rested(page);
  assert.match(await said(), /Print and edited document differ/);
  assert.notEqual((await said()).match(/0\.\d+/)[0], before.match(/0\.\d+/)[0]);
  await page.click('#unedit');
  await rested(page);
  assert.equal(await said(), before);
  await page.evaluate(() => { location.hash = 'show=document&view=0,0&tilt=0,0&curl=0&pan=0,0&zoom=1&distance=0.5'; });
  await rested(page);
  const box = await page.locator('#picture').boundingBox();
  await page.mouse.click(box.x + 4, box.y + 0.6 * box.height);
  assert.match(await page.locator('#spot').textContent(), /Beside the sheet/);
  assert.equal(await page.isVisible('#ring'), false);
}));

test('fingers drag, pinch and tap', () => visit(phone, async (page) => {
  await page.evaluate(() => { location.hash = 'show=printed'; });
  const session = await page.context().newCDPSession(page);
  const [x, y] = await place(page);
  const touch = (type, ...points) => session.send('Input.dispatchTouchEvent', {
    type, touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })),
  });
  const before = numbers((await rested(page)).get('light') ?? '-25,30');
  await touch('touchStart', [x, y]);
  await touch('touchMove', [x + 20, y]);
  await touch('touchMove', [x + 50, y]);
  await touch('touchEnd');
  assert.ok(numbers((await rested(page)).get('light'))[0] > before[0] + 5);
  await touch('touchStart', [x - 40, y], [x + 40, y]);
  await touch('touchMove', [x - 60, y], [x + 60, y]);
  await touch('touchMove', [x - 90, y], [x + 90, y]);
  await touch('touchEnd');
  assert.ok(Number((await rested(page)).get('zoom')) > 1.8);
  // The finger that is lifted last drags nothing.
  const still = (await rested(page)).get('light');
  await touch('touchStart', [x - 40, y], [x + 40, y]);
  await touch('touchMove', [x - 45, y], [x + 45, y]);
  await touch('touchEnd', [x - 45, y]);
  for (const by of [20, 40]) {
    await session.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: [{ x: x + 45 - by, y: y + by, id: 1 }] });
  }
  await touch('touchEnd');
  assert.equal((await rested(page)).get('light'), still);
  await page.touchscreen.tap(x, y);
  assert.match(await page.locator('#spot').textContent(), /This dot/);
  // What is said of the spot comes into sight below the picture.
  await page.waitForFunction(() => {
    const [said, picture] = ['#spot h2', '#picture'].map((what) => document.querySelector(what).getBoundingClientRect());
    return said.top >= picture.bottom && said.bottom < innerHeight;
  });
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, 'nothing is cut off');
}));

test('a finger works every control', () => visit(phone, async (page) => {
  const session = await page.context().newCDPSession(page);
  /** @param {string} what @param {number} dx @param {number} dy @param {number[]} at */
  const once = async (what, dx, dy, [across, down]) => {
    const found = page.locator(what).first();
    await found.evaluate((control) => control.closest('#stage') ?? control.scrollIntoView({ block: 'center' }));
    const box = await found.boundingBox();
    const [x, y] = [box.x + across * box.width, box.y + down * box.height];
    const touch = (/** @type {string} */ type, /** @type {number[][]} */ ...points) =>
      session.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })) });
    await touch('touchStart', [x, y]);
    for (let i = 1; i <= 4; i++) await touch('touchMove', [x + (dx * i) / 4, y + (dy * i) / 4]);
    await touch('touchEnd');
  };
  /** On a busy machine a finger's moves come late, and a browser may take them for none. */
  const swipe = async (what, dx, dy, test, at = [0.5, 0.5]) => {
    for (let i = 0; i < 40; i++) {
      if (i % 10 === 0) await once(what, dx, dy, at);
      if (test(await rested(page))) return;
      await page.waitForTimeout(100);
    }
    assert.fail(`${what}: ${await rested(page)}`);
  };
  /** A tap right after a swipe may be taken for its end. @param {string} name */
  const tool = async (name) => {
    const button = page.locator(`[data-tool=${name}]`);
    for (let i = 0; i < 10; i++) {
      await button.tap();
      if (await button.getAttribute('aria-pressed') === 'true') return;
      await page.waitForTimeout(200);
    }
    assert.fail(`${name} is not chosen`);
  };
  const before = await rested(page);
  const scrolled = await page.evaluate(() => scrollY);
  await swipe('.lamp', 60, 0, (now) => numbers(now.get('light'))[0] > numbers(before.get('light'))[0] + 10);
  await swipe('#handle', 90, 0, (now) => Number(now.get('split')) > 0.6, [0.5, 0.2]);
  await tool('sheet');
  await swipe('#picture', 40, 20, (now) => numbers(now.get('tilt'))[0] > 5, [0.3, 0.7]);
  await tool('move');
  await swipe('#picture', 40, 20, (now) => now.get('pan') !== before.get('pan'), [0.3, 0.7]);
  assert.equal(await page.evaluate(() => scrollY), scrolled, 'a finger on the picture does not scroll the page');
  await page.tap('#nearer');
  assert.ok(Number((await rested(page)).get('zoom')) > 1.2);
  await page.tap('#whole');
  assert.equal((await rested(page)).get('zoom'), '1');
  for (const show of ['mapped', 'printed', 'passes', 'document']) {
    await page.tap(`[data-show=${show}]`);
    assert.equal((await rested(page)).get('show'), show);
  }
  await page.tap('#more');
  assert.equal((await rested(page)).get('light').split(';').length, 2);
  await page.tap('#probe');
  assert.equal((await rested(page)).get('probe'), '1');
  for (const [slider, key] of [['#sliders-light label:nth-child(4) input', 'exposure'], ['#sliders-sheet label:nth-child(3) input', 'curl'], ['#sliders-edits input', 'edit']]) {
    const old = (await rested(page)).get(key);
    await swipe(slider, 40, 0, (now) => now.get(key) !== old);
  }
  await page.tap('#unedit');
  assert.equal((await rested(page)).get('edit'), null);
  await page.tap('#reset');
  assert.equal((await rested(page)).get('light'), before.get('light'));
  // Large enough for a finger, by WCAG 2.2.
  for (const control of await page.locator('button:visible, input:visible, select:visible, [role=slider]:visible').all()) {
    const box = await control.boundingBox();
    assert.ok(Math.min(box.width, box.height) >= 18, await control.evaluate((found) => found.outerHTML));
  }
}));

test('an address brings back its view, and nonsense in it does no harm', () => visit(desk, async (page) => {
  const view = 'show=printed&light=10,20,0;-30,40,0.5&probe=0&view=5,-5&distance=0.4&tilt=10,-20&curl=0.08&zoom=3&pan=0.01,-0.01&exposure=1.5&knee=0.7';
  await page.evaluate((hash) => { location.hash = hash; }, view);
  assert.equal(decodeURIComponent((await rested(page)).toString()), view);
  await page.evaluate(() => { location.hash = 'show=<b>&light=NaN,1;2&zoom=1e99&pan=a&tilt=999,-999&curl=-1&distance=1e-9&exposure=Infinity&pass=77&split=-4'; });
  const after = await rested(page);
  assert.equal(after.get('show'), 'printed');
  assert.equal(after.get('zoom'), '400');
  // Whatever the program takes, the page takes; a control shows the end of its range and changes nothing.
  const far = 'show=printed&light=150,0,0.02&probe=0&view=0,88&distance=0.02&tilt=0,5&curl=0&zoom=1&pan=0,0&exposure=-13.5&knee=0.4';
  for (const hash of [far, far.replace('view=0,88', 'view=120,0').replace('tilt=0,5', 'tilt=85,0')]) {
    await page.evaluate((to) => { location.hash = to; }, hash);
    assert.equal(decodeURIComponent((await rested(page)).toString()), hash);
  }
  await page.focus('#picture');
  await page.keyboard.press('ArrowRight');
  assert.equal((await rested(page)).get('light'), '150,0,0.02');
  await page.keyboard.press('ArrowLeft');
  assert.equal((await rested(page)).get('light'), '147,0,0.02');
  await page.evaluate(() => { location.hash = 'light=20,0,50&distance=50'; });
  await rested(page);
  assert.equal(await page.locator('#sliders-light output').nth(2).innerText(), '50.00 m');
}));

test('the scale lies beside the tools, wide and low', () => visit({ width: 844, height: 390 }, async (page) => {
  for (const size of [{ width: 844, height: 390 }, { width: 960, height: 600 }, { width: 1000, height: 600 }, { width: 390, height: 844 }, { width: 320, height: 568 }]) {
    await page.setViewportSize(size);
    // The scale has another width at each.
    for (const zoom of [1, 1.3, 1.6, 1.9]) {
      await page.evaluate((by) => { location.hash = `zoom=${by}`; }, zoom);
      await rested(page);
      const [scale, tools] = await Promise.all(['#scale', '#tools'].map((what) => page.locator(what).boundingBox()));
      assert.ok(scale.y + scale.height <= tools.y || scale.x >= tools.x + tools.width, JSON.stringify([size, scale, tools]));
      assert.ok(tools.x + tools.width <= size.width - 4, JSON.stringify([size, tools]));
    }
  }
  const behind = await page.locator('#scale').evaluate((scale) => getComputedStyle(scale).backgroundColor);
  assert.match(behind, /rgba\(24, 24, 24/);
}));

/** A panorama of 4 x 2 texels with a sun that no number of 16 bits holds. */
const texels = deflateSync(Buffer.from(Float32Array.from({ length: 24 }, (_, i) => (i > 2 && i < 6 ? 3e7 : 0.1)).buffer)).toString('base64');
const hot = (/** @type {string} */ probe) => {
  const { parse } = JSON;
  JSON.parse = (text, ...more) => {
    const read = parse(text, ...more);
    if (read.probe) Object.assign(read.probe, { width: 4, height: 2, texels: probe });
    return read;
  };
};
test('a sun makes the page white, not black', () => visit({ ...desk, before: [hot, texels] }, async (page) => {
  for (const show of ['document', 'printed']) {
    await page.evaluate((what) => { location.hash = `show=${what}&light=&probe=1&tilt=0,0&exposure=2`; }, show);
    await rested(page);
    const middle = await page.evaluate(() => {
      const from = document.querySelector('canvas');
      const to = new OffscreenCanvas(1, 1).getContext('2d');
      to.drawImage(from, from.width * 0.52, from.height * 0.52, 1, 1, 0, 0, 1, 1);
      return [...to.getImageData(0, 0, 1, 1).data];
    });
    assert.ok(Math.max(...middle.slice(0, 3)) > 150, `${show}: ${middle}`);
  }
}));

for (const colorScheme of ['light', 'dark']) {
  for (const [where, how] of [['a desk', desk], ['a phone', phone]]) {
    test(`axe-core finds nothing on ${where}, ${colorScheme}`, () => visit({ ...how, colorScheme }, async (page) => {
      await page.focus('#picture');
      await page.keyboard.press('Enter');
      await page.evaluate(() => { location.hash = 'edit=0,2,ffffff,1'; });
      await page.evaluate(axe);
      for (const show of ['document', 'difference', 'stacks', 'passes']) {
        await page.click(`[data-show=${show}]`);
        await rested(page);
        const { violations } = await page.evaluate(() => window.axe.run());
        assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes.map((node) => node.html)]), []);
      }
    }));
  }
}

test('what keys did is said once they rest, and once', () => visit(desk, async (page) => {
  await page.evaluate(() => {
    window.said_ = [];
    new MutationObserver(() => window.said_.push(document.querySelector('#said').textContent)).observe(document.querySelector('#said'), { childList: true });
  });
  /** @param {string[]} keys @param {RegExp} expected */
  const says = async (keys, expected) => {
    await page.evaluate(() => { window.said_ = []; });
    for (const key of keys) await page.keyboard.press(key);
    await page.waitForFunction(() => window.said_.length > 0);
    await page.waitForTimeout(700);
    const said = await page.evaluate(() => window.said_);
    assert.equal(said.length, 1, said.join(' | '));
    assert.match(said[0], expected);
  };
  await page.focus('#picture');
  await says(Array(6).fill('ArrowRight'), /^Light 1: \d+° (left|right), \d+° up$/);
  await says(['Shift+ArrowRight', 'Shift+ArrowRight'], /^Sheet turned 6° right, tipped 0° back$/);
  await says(['+', '+'], /^Zoom 1\.6$/);
  await says(['0'], /^Zoom 1$/);
  await page.focus('.lamp');
  await says(['ArrowUp', 'ArrowUp'], /^Light 1: /);
  // A mouse says nothing.
  await page.evaluate(() => { window.said_ = []; });
  await drag(page, 40, 20);
  await page.waitForTimeout(800);
  assert.deepEqual(await page.evaluate(() => window.said_), []);
}));

test('a lost graphics card leaves a picture and a sentence, and comes back as it was', () => visit(desk, async (page) => {
  const picture = () => page.evaluate(() => document.querySelector('canvas').toDataURL());
  await page.evaluate(() => { location.hash = 'show=document&with=printed&edit=0,3,ff0000,1&probe=1'; });
  await rested(page);
  const before = await picture();
  await page.evaluate(() => {
    window.lose_ = document.querySelector('canvas').getContext('webgl2').getExtension('WEBGL_lose_context');
    window.lose_.loseContext();
  });
  await page.waitForSelector('#message:not([hidden])');
  assert.match(await page.locator('#message').textContent(), /graphics card/);
  assert.ok(await page.isVisible('#still'));
  const [message, tools] = await Promise.all(['#message', '#tools'].map((what) => page.locator(what).boundingBox()));
  assert.ok(message.y + message.height <= tools.y, JSON.stringify([message, tools]));
  await page.focus('#picture').catch(() => {});
  await page.keyboard.press('ArrowRight');
  await page.evaluate(() => window.lose_.restoreContext());
  await page.waitForSelector('#stage.ready');
  assert.equal(await page.isVisible('#message'), false);
  await page.evaluate(() => { location.hash = 'show=document&with=printed&edit=0,3,ff0000,1&probe=1&light=-25,30,0.6'; });
  await rested(page);
  assert.equal(await picture(), before);
}));

test('what is chosen shows in the colours of the system, and colours that are the matter stay', () => visit(desk, async (page) => {
  await page.click('[data-show=stacks]');
  await rested(page);
  const colours = (/** @type {string} */ what) => page.locator(what).evaluateAll((all) => all.map((found) => getComputedStyle(found).backgroundColor));
  const chips = await colours('#legend .chip');
  await page.emulateMedia({ forcedColors: 'active' });
  assert.deepEqual(await colours('#legend .chip'), chips);
  for (const [group, on] of [['#tools [data-tool]', '[aria-pressed="true"]'], ['#left button', '[aria-checked="true"]'], ['#lights button[aria-pressed]', '[aria-pressed="true"]']]) {
    const [chosen] = await colours(`${group}${on}`);
    assert.notEqual(chosen, (await colours('#share'))[0], group);
  }
  await page.emulateMedia({ forcedColors: null, reducedMotion: 'reduce' });
  assert.equal(await page.locator('#share').evaluate((button) => getComputedStyle(button).transitionDuration), '0s');
}));

test('on paper there is the picture in its proportions, what it shows, and nothing to press', () => visit({ ...desk, colorScheme: 'dark' }, async (page) => {
  await rested(page);
  await page.emulateMedia({ media: 'print' });
  for (const control of ['aside', '#tools', '.lamp', '#handle', '#scale']) assert.equal(await page.locator(control).locator('visible=true').count(), 0, control);
  assert.equal(await page.locator('#picture').evaluate((canvas) => getComputedStyle(canvas).objectFit), 'contain');
  assert.match(await page.locator('#stage').evaluate((stage) => getComputedStyle(stage, '::after').content), /Document, Print/);
  const pages = (await page.pdf({ format: 'A4' })).toString('latin1').match(/\/Type \/Page\b/g);
  assert.equal(pages?.length, 1);
  await page.emulateMedia({ media: null });
}));

test('a name of a thousand words leaves room for the picture', () => visit({
  ...desk, before: [(name) => {
    const { parse } = JSON;
    JSON.parse = (text, ...more) => Object.assign(parse(text, ...more), { name });
  }, `\u202e\u05e9\u05dc\u05d5\u05dd </script> ${'very long '.repeat(1000)}`],
}, async (page) => {
  assert.ok((await page.locator('#name').boundingBox()).height < 120);
  const box = await page.locator('#picture').boundingBox();
  assert.ok(box.y < 200 && box.height > 300, JSON.stringify(box));
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true);
}));

test('a wheel on a lamp zooms; a hand that is taken away drags nothing', () => visit(desk, async (page) => {
  await rested(page);
  const lamp = await page.locator('.lamp').boundingBox();
  await page.mouse.move(lamp.x + 22, lamp.y + 22);
  await page.mouse.wheel(0, -400);
  assert.ok(Number((await rested(page)).get('zoom')) > 1.5);
  assert.equal(await page.evaluate(() => scrollY), 0);
  // Two fingers on a touchpad are a wheel with Ctrl: as far as they spread.
  await page.evaluate(() => document.querySelector('#whole').click());
  await page.evaluate(() => document.querySelector('#picture').dispatchEvent(new WheelEvent('wheel', { deltaY: -10, ctrlKey: true, bubbles: true, cancelable: true })));
  assert.equal((await rested(page)).get('zoom'), '1.105');
  const [x, y] = await place(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 20, y);
  await page.evaluate(() => {
    const canvas = document.querySelector('#picture');
    canvas.dispatchEvent(new PointerEvent('lostpointercapture', { pointerId: 1, bubbles: true }));
  });
  const still = (await rested(page)).get('light');
  await page.mouse.move(x + 90, y + 60);
  await page.mouse.up();
  assert.equal((await rested(page)).get('light'), still);
}));

test('going away and back finds the view again', () => visit(desk, async (page) => {
  await page.focus('#picture');
  for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowUp');
  const view = (await rested(page)).toString();
  await page.evaluate(() => { location.href = 'about:blank'; });
  await page.waitForURL('about:blank');
  await page.goBack();
  await page.waitForSelector('#stage.ready');
  assert.equal((await rested(page)).toString(), view);
}));

test('five hundred changes of light leave no memory behind', () => visit({ width: 620, height: 400 }, async (page) => {
  const used = () => page.evaluate(() => {
    globalThis.gc();
    globalThis.gc();
    return performance.memory.usedJSHeapSize;
  });
  const turn = async (/** @type {number} */ count) => {
    for (let i = 0; i < count; i++) {
      await page.evaluate((hash) => { location.hash = hash; }, `show=document&light=${(i * 7) % 60},${i % 50},0.5&tilt=${i % 90 < 9 ? i % 9 : 0},0&probe=${Number(i % 90 < 9)}`);
      await page.evaluate(() => new Promise(requestAnimationFrame));
    }
    await rested(page);
  };
  await turn(20);
  const before = await used();
  await turn(500);
  const after = await used();
  assert.ok(after < before + 4e6, `${before} bytes became ${after}`);
}));

test('without WebGL2 there is a picture and a sentence', () => visit({ ...desk, webgl: false }, async (page) => {
  await page.waitForSelector('#message:not([hidden])');
  assert.match(await page.locator('#message').textContent(), /no WebGL2/);
  const uncovered = () => page.locator('#message').evaluate((message) => {
    const { left, top, width, height } = message.getBoundingClientRect();
    return [0.02, 0.5, 0.98].every((x) => document.elementFromPoint(left + x * width, top + height / 2) === message);
  });
  for (const size of [desk, { width: 390, height: 780 }]) {
    await page.setViewportSize({ width: size.width, height: size.height });
    assert.ok(await uncovered(), JSON.stringify(size));
  }
  for (const control of ['#tools', 'aside', '#scale', '.lamp']) assert.equal(await page.locator(control).locator('visible=true').count(), 0, control);
  assert.ok(await page.locator('#still').evaluate((image) => image.naturalWidth > 0 && image.offsetWidth > 0));
}));

test('dragging stays fluid, coarser if it must, and rest draws finely', () => visit(desk, async (page) => {
  const size = () => page.evaluate(() => document.querySelector('canvas').width);
  const fine = await size();
  const [x, y] = await place(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  const took = [];
  let least = fine;
  for (let i = 0; i < 60; i++) {
    await page.mouse.move(x + i, y);
    took.push(await page.evaluate(() => new Promise((done) => {
      requestAnimationFrame((first) => requestAnimationFrame((second) => done(second - first)));
    })));
    least = Math.min(least, await size());
  }
  await page.mouse.up();
  await rested(page);
  assert.equal(await size(), fine);
  const usual = took.slice(30).sort((a, b) => a - b)[15];
  // On a machine too slow for that the picture is as coarse as it gets.
  assert.ok(usual <= 34 || least < fine / 4, `${usual} ms a frame, ${least} of ${fine} pixels`);
  console.log(`${usual} ms a frame while dragging, ${least} of ${fine} pixels wide`);
}));

/** Draws everything so many times over, and keeps what was drawn when and how widely, and when the hand moved. */
const slow = (/** @type {number} */ times) => {
  window.frames_ = [];
  window.moves_ = [];
  addEventListener('pointermove', (event) => window.moves_.push(event.timeStamp), { capture: true });
  const once = WebGL2RenderingContext.prototype.drawArrays;
  WebGL2RenderingContext.prototype.drawArrays = function drawArrays(...given) {
    window.frames_.push([performance.now(), this.canvas.width]);
    for (let i = 0; i < times; i++) once.apply(this, given);
  };
};
test('a picture that takes long is coarse from the first move until the hand rests', () => visit({ ...desk, scale: 2, before: [slow, 4] }, async (page) => {
  await page.evaluate(() => { location.hash = 'show=printed&with='; });
  await rested(page);
  const fine = await page.evaluate(() => document.querySelector('canvas').width);
  await page.click('[data-tool=sheet]');
  const [x, y] = await place(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.evaluate(() => { window.frames_ = []; });
  for (const until = Date.now() + 4000; Date.now() < until;) {
    await page.mouse.move(x + (Date.now() / 20) % 80, y);
    await page.waitForTimeout(10);
  }
  const [frames, moves] = await page.evaluate(() => [window.frames_, window.moves_]);
  await page.mouse.up();
  const widths = frames.map(([, width]) => width);
  assert.ok(widths.length > 5, `${widths.length} frames in 4 s`);
  // On a busy machine the hand of the test pauses, too.
  const hasty = frames.filter(([at, width]) => width > 0.6 * fine && moves.some((move) => move > at - 100 && move < at - 30));
  assert.deepEqual(hasty, [], `${widths} of ${fine}`);
  await rested(page);
  assert.equal(await page.evaluate(() => document.querySelector('canvas').width), fine);
  console.log(`${widths.length} frames in 4 s, ${widths[0]} and then ${widths[2]} of ${fine} pixels wide`);
}));
