import { chromium } from 'playwright-core';
const [page_, out, hash = '', size = '1280x800'] = process.argv.slice(2);
const [width, height] = size.split('x').map(Number);
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'] });
const page = await browser.newPage({ viewport: { width, height } });
page.on('console', (m) => console.log('console', m.type(), m.text()));
page.on('pageerror', (e) => console.log('error', e.message));
const t = Date.now();
await page.goto('file://' + page_ + hash);
try { await page.waitForSelector('#stage.ready', { timeout: 20000 }); } catch (e) { console.log(await page.textContent('#message')); }
console.log('ready', Date.now() - t);
if (process.argv[6]) { await page.mouse.click(...process.argv[6].split(',').map(Number)); }
await page.waitForTimeout(600);
await page.screenshot({ path: out });
await browser.close();
