// Draws the page in each of some states, and writes the canvas as PNG and the steps of its edits, if any, as TOML:
// `shots.mjs PAGE STATES.json FOLDER WIDTH HEIGHT`.

import { readFile, writeFile } from 'node:fs/promises';
import { open, rested } from './browser.mjs';

const [file, states, folder, width, height] = process.argv.slice(2);
const { browser, page, complaints } = await open(file, { width: Number(width) + 420, height: Number(height) + 120 });
await page.addStyleTag({
  content: `#stage { position: fixed !important; top: 0; left: 0; width: ${width}px !important; height: ${height}px !important; border-radius: 0 !important }`,
});
await page.waitForTimeout(1000);
// An address that is set while something moves may be overwritten by that of where it moved to.
await rested(page);
for (const [i, state] of JSON.parse(await readFile(states, 'utf8')).entries()) {
  await page.evaluate((hash) => { location.hash = hash; }, state);
  // The page writes its own address when it rests: the same view, in other words.
  await page.waitForFunction((hash) => location.hash !== `#${hash}`, state);
  await page.waitForTimeout(300);
  await rested(page);
  const url = await page.evaluate(() => document.querySelector('canvas').toDataURL('image/png'));
  await writeFile(`${folder}/${i}.png`, Buffer.from(url.split(',')[1], 'base64'));
  const steps = await page.inputValue('#steps');
  if (steps) await writeFile(`${folder}/${i}.toml`, steps);
}
await browser.close();
if (complaints.length) throw new Error(complaints.join('\n'));
