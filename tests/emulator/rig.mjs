// The emulated bridge with the rig at its cable: `node rig.mjs IMAGE FOLDER RIG_IMAGE RIG_FOLDER`.
//
// Each folder gets a socket `serial`, the board's serial port. The first line on standard output says that both are up; at the end of
// standard input the program ends.

import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { Board } from './board.mjs';
import { pair } from './pair.mjs';
import { SerialPort, keepTime, listen } from './serial.mjs';
import { Host } from './usb.mjs';

const args = process.argv.slice(2);
if (args.length !== 4) {
  console.error('usage: node rig.mjs IMAGE.uf2 FOLDER RIG_IMAGE.uf2 RIG_FOLDER');
  process.exit(2);
}

const [bridge, rig] = [args[0], args[2]].map((image) => new Board(new Uint8Array(readFileSync(image))));
pair(bridge, rig);
// Before either board looks for one.
const ends = [[bridge, args[1]], [rig, args[3]]].map(([board, folder]) => ({ folder, host: new Host(board) }));
let woken = () => {};

async function up() {
  const devices = await Promise.all(ends.map(({ host }) => host.enumerate()));
  for (const [i, { folder, host }] of ends.entries()) {
    const device = devices[i];
    const serial = new SerialPort(host, async () => device);
    await listen(join(folder, 'serial'), () => woken(), (socket) => serial.connected(socket));
  }
  console.log(JSON.stringify({ up: true }));
}
up().catch((error) => {
  console.error(String(error.stack));
  process.exit(1);
});
process.stdin.on('end', () => process.exit(0)).resume();
await keepTime(bridge, { sleep: (sleep) => { woken = sleep; } });
