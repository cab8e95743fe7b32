// A board's ends for other programs: its serial port at a socket, and its time beside the world's.

import { rmSync } from 'node:fs';
import { createServer } from 'node:net';

const SLICE_NS = 2_000_000;

/// One connection at a time at a socket. Whatever happens there wakes the board.
export function listen(path, wake, connected) {
  rmSync(path, { force: true });
  const server = createServer((socket) => {
    socket.on('error', () => {});
    socket.on('data', wake);
    socket.on('close', wake);
    connected(socket);
    wake();
  });
  return new Promise((resolve) => server.listen(path, resolve));
}

/// What the kernel's driver does when the serial port is opened and closed.
export class SerialPort {
  #opened = Promise.resolve();
  #port = null;

  /// `device` gives the enumerated device, once there is one.
  constructor(host, device) {
    Object.assign(this, { host, device });
  }

  /// The cable was pulled.
  destroy() {
    this.#port?.destroy();
  }

  async #data() {
    return (await this.device()).interfaces.find((one) => one.class === 0x0a);
  }

  /// A program has opened it; the connection is its open file.
  connected(socket) {
    const { host } = this;
    this.#port?.destroy();
    this.#port = socket;
    // What fails here fails because the cable was pulled; the program finds out by its port's end.
    const turn = (act) => { this.#opened = this.#opened.then(act).catch(() => socket.destroy()); };
    turn(async () => {
      if (this.#port !== socket) return;
      const data = await this.#data();
      await host.openSerial(data.number - 1, true);
      const take = (packet) => {
        if (socket.write(packet)) return;
        // The next packet is asked for when this one has gone.
        host.read(data.in, null);
        socket.once('drain', () => { if (this.#port === socket) host.read(data.in, take); });
      };
      host.read(data.in, take);
    });
    socket.on('data', (bytes) => {
      socket.pause();
      turn(async () => {
        const data = await this.#data();
        await host.write(data.out, new Uint8Array(bytes));
        socket.resume();
      });
    });
    socket.on('close', () => turn(async () => {
      if (this.#port !== socket) return;
      this.#port = null;
      const data = await this.#data();
      host.read(data.in, null);
      await host.openSerial(data.number - 1, false);
    }));
  }
}

/// Runs the board for ever, never ahead of the world's time. After each slice, or once `until` holds, comes a `turn`; `sleep` gets what ends a
/// pause early.
export async function keepTime(board, { until = () => false, turn = () => {}, sleep }) {
  let ahead = performance.now() - board.now / 1e6;
  for (;;) {
    await board.run(until, SLICE_NS);
    turn();
    const late = performance.now() - (ahead + board.now / 1e6);
    if (late > 0) ahead += late;
    else if (late < -1) {
      await new Promise((resolve) => {
        const timer = setTimeout(resolve, -late);
        sleep(() => { clearTimeout(timer); resolve(); });
      });
      sleep(() => {});
    }
  }
}
