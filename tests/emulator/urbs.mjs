// Requests as Linux gets them from a program with a USB library (usbdevfs), carried out on the emulated bus.
//
// The socket carries, little-endian:
//
//   request  id u32, what u8 (0 submit, 1 cancel, 2 reset), type u8 (2 control, 3 bulk), endpoint u8 (0x80: to the
//            host), flags u8, length u32, attached u32, then `attached` bytes: for bulk what is sent; for control the
//            eight bytes of setup and what is sent
//   answer   id u32, status i32 (0 or a negative errno), length u32 (bytes received, or sent), attached u32, then
//            `attached` bytes: what was received
//
// A cancelled request is answered like any other, once, with -ENOENT. The end of the connection is the device's end.

const [SUBMIT, CANCEL, RESET] = [0, 1, 2];
const CONTROL = 2;
const [ENOENT, EPIPE, ESHUTDOWN] = [-2, -32, -108];
const ZERO_PACKET = 0x40;
const HEAD = 16;
const PACKET = 64;
// More than a kernel takes in one request.
const MOST = 16 << 20;

export class Urbs {
  #host;
  #reset;
  #sockets = new Set();
  #wanted = new Map(); // endpoint: requests for what comes from it, oldest first
  #sending = new Map(); // endpoint: promise of everything before
  #open = new Map(); // id: request

  /// `reset` replugs the device.
  constructor(host, reset) {
    this.#host = host;
    this.#reset = reset;
  }

  connected(socket) {
    this.#sockets.add(socket);
    let buffer = Buffer.alloc(0);
    socket.on('data', (bytes) => {
      buffer = Buffer.concat([buffer, bytes]);
      while (buffer.length >= HEAD) {
        const [length, attached] = [buffer.readUInt32LE(8), buffer.readUInt32LE(12)];
        if (attached > MOST || length > MOST) return socket.destroy();
        if (buffer.length < HEAD + attached) break;
        const [what, type, address, flags] = buffer.subarray(4, 8);
        const urb = { socket, id: buffer.readUInt32LE(0), type, endpoint: address & 15, inward: address >= 0x80, flags, length,
          bytes: new Uint8Array(buffer.subarray(HEAD, HEAD + attached)), received: [], sent: 0 };
        buffer = buffer.subarray(HEAD + attached);
        if (what === SUBMIT) this.#submit(urb);
        else if (what === CANCEL) this.#cancel(urb);
        else if (what === RESET) this.#answer(urb, 0);
        if (what === RESET) this.#reset();
      }
    });
    socket.on('close', () => {
      this.#sockets.delete(socket);
      for (const urb of [...this.#open.values()]) if (urb.socket === socket) this.#drop(urb);
    });
  }

  /// The cable was pulled: every request fails, and so do the connections.
  unplugged() {
    for (const urb of [...this.#open.values()]) this.#finish(urb, ESHUTDOWN);
    for (const socket of this.#sockets) socket.end();
    this.#sending.clear();
  }

  #answer({ socket, id, inward, received, sent }, status) {
    const head = Buffer.alloc(16);
    head.writeUInt32LE(id, 0);
    head.writeInt32LE(status, 4);
    head.writeUInt32LE(inward ? received.length : sent, 8);
    head.writeUInt32LE(received.length, 12);
    socket.write(Buffer.concat([head, Buffer.from(received)]));
  }

  #finish(urb, status) {
    if (this.#drop(urb)) this.#answer(urb, status);
  }

  /// Nobody waits for it any more.
  #drop(urb) {
    if (!this.#open.delete(urb.id)) return false;
    const line = this.#wanted.get(urb.endpoint);
    const at = line?.indexOf(urb) ?? -1;
    if (at >= 0) line.splice(at, 1);
    if (at >= 0 && line.length === 0) this.#host.read(urb.endpoint, null);
    return true;
  }

  #cancel({ id }) {
    const urb = this.#open.get(id);
    if (!urb) return;
    urb.cancelled = true;
    this.#finish(urb, ENOENT);
  }

  #submit(urb) {
    this.#open.set(urb.id, urb);
    if (urb.type === CONTROL) this.#control(urb);
    else if (urb.inward) this.#receive(urb);
    else this.#send(urb);
  }

  async #control(urb) {
    const setup = new DataView(urb.bytes.buffer);
    const [type, request] = urb.bytes;
    urb.inward = type >= 0x80;
    const data = urb.inward ? setup.getUint16(6, true) : urb.bytes.subarray(8);
    const result = await this.#host.transfer([type, request, setup.getUint16(2, true), setup.getUint16(4, true)], data).catch(() => null);
    if (result) [urb.received, urb.sent] = [[...result], data.length];
    this.#finish(urb, result ? 0 : EPIPE);
  }

  #receive(urb) {
    const { endpoint } = urb;
    const line = this.#wanted.get(endpoint) ?? [];
    this.#wanted.set(endpoint, line);
    line.push(urb);
    if (line.length > 1) return;
    this.#host.read(endpoint, (packet) => {
      const [first] = line;
      for (const byte of packet) first.received.push(byte);
      if (packet.length < PACKET || first.received.length >= first.length) this.#finish(first, 0);
    });
  }

  #send(urb) {
    const before = this.#sending.get(urb.endpoint) ?? Promise.resolve();
    this.#sending.set(urb.endpoint, before.then(async () => {
      const { bytes, endpoint } = urb;
      try {
        const whole = bytes.length > 0 && bytes.length % PACKET === 0 && urb.flags & ZERO_PACKET;
        do {
          if (urb.cancelled) return;
          const packet = bytes.subarray(urb.sent, urb.sent + PACKET);
          await this.#host.send(endpoint, packet);
          urb.sent += packet.length;
        } while (urb.sent < bytes.length);
        if (whole) await this.#host.send(endpoint, bytes.subarray(0, 0));
        this.#finish(urb, 0);
      } catch {
        this.#finish(urb, ESHUTDOWN);
      }
    }));
  }
}
