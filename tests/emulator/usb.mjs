// The USB host: enumerates the board and moves packets over a bus with a clock.
//
// rp2040js takes a buffer away the moment the firmware arms it. Firmware that watches the AVAILABLE bit (embassy
// does) then reads 64 bytes of rubbish. Here the controller's two entry points are replaced: a buffer stays available
// until its packet has crossed the bus, which takes as long as it takes at full speed, one packet at a time.
//
// The host keeps the toggle of every endpoint, as USB 2.0 has it (8.6): a packet that is not the one that comes next is taken for a
// repetition, acknowledged and dropped, by whichever side hears it.

const AVAILABLE = 1 << 10;
const STALL = 1 << 11;
const DATA1 = 1 << 13;
const FULL = 1 << 15;
const LENGTH = 0x3ff;

/// At 12 Mbit/s: the bytes, and 21 more for tokens, checksum, handshake and the gaps between.
const packetNs = (bytes) => Math.ceil(((bytes + 21) * 8 * 1000) / 12);

const key = (endpoint, out) => endpoint * 2 + (out ? 1 : 0);
const control = (endpoint, out) => 0x80 + endpoint * 8 + (out ? 4 : 0);

export class Host {
  constructor(board) {
    this.board = board;
    this.usb = board.chip.usbCtrl;
    this.memory = board.chip.usbDPRAM;
    this.view = board.chip.usbDPRAMView;
    this.armed = new Set();
    this.queues = new Map(); // packets that wait for an OUT buffer: { bytes, sent, lost }
    this.crossing = new Set(); // those of them that are on the bus
    this.reading = new Map(); // who wants packets of an IN endpoint
    this.busFreeAt = 0;
    this.packets = 0;
    this.toggles = new Map(); // of the packet that comes next: 0 or DATA1
    this.dropped = 0; // bytes of packets that were taken for repetitions
    this.resets = 0;
    this.attached = new Promise((resolve) => { this.onReset = resolve; });
    this.usb.DPRAMUpdated = (offset, value) => this.written(offset, value);
    this.usb.onUSBEnabled = () => this.usb.resetDevice();
    this.usb.onResetReceived = () => { this.resets += 1; this.onReset(); };
  }

  written(offset, value) {
    if (offset < 0x80 || offset > 0xfc) return;
    const [endpoint, out] = [(offset - 0x80) >> 3, (offset & 4) !== 0];
    if (endpoint === 0 && value & STALL) {
      this.stalled?.();
      return;
    }
    if (value & AVAILABLE) {
      this.armed.add(key(endpoint, out));
      this.go(endpoint, out);
    } else {
      this.armed.delete(key(endpoint, out));
    }
  }

  /// Moves a packet if both sides are ready.
  go(endpoint, out) {
    const id = key(endpoint, out);
    if (!this.armed.has(id)) return;
    const queue = this.queues.get(id);
    if (out ? !queue?.length : !this.reading.get(id)) return;
    this.armed.delete(id);
    const register = control(endpoint, out);
    const packet = out ? queue.shift() : null;
    const length = out ? packet.bytes.length : this.view.getUint32(register, true) & LENGTH;
    if (out) this.crossing.add(packet);
    const resets = this.resets;
    this.onBus(packetNs(length), () => {
      if (resets !== this.resets) return;
      const now = this.view.getUint32(register, true);
      this.crossing.delete(packet);
      // Taken back by the firmware meanwhile.
      if (!(now & AVAILABLE)) {
        packet?.lost(new Error('the buffer was taken back'));
        return;
      }
      // Nobody asks for it any more: it stays where it is.
      if (!out && !this.reading.get(id)) {
        this.armed.add(id);
        return;
      }
      const at = this.usb.getEndpointBufferOffset(endpoint, out);
      this.packets += 1;
      const toggle = this.toggles.get(id) ?? 0;
      const repeats = endpoint !== 0 && (now & DATA1) !== toggle;
      if (repeats) this.dropped += length;
      // Whoever sends goes on; whoever hears a repetition waits for the next one.
      if (out || !repeats) this.toggles.set(id, toggle ^ DATA1);
      if (out && repeats) {
        packet.sent();
        this.armed.add(id);
        this.go(endpoint, out);
      } else if (out) {
        this.memory.set(packet.bytes, at);
        this.view.setUint32(register, (now & ~(AVAILABLE | LENGTH)) | FULL | length, true);
        this.usb.indicateBufferReady(endpoint, true);
        packet.sent();
      } else {
        const bytes = this.memory.slice(at, at + length);
        this.view.setUint32(register, now & ~(AVAILABLE | FULL), true);
        this.usb.indicateBufferReady(endpoint, false);
        if (!repeats) this.reading.get(id)(bytes);
      }
    });
  }

  /// One packet after the other.
  onBus(ns, done) {
    this.busFreeAt = Math.max(this.busFreeAt, this.board.now) + ns;
    this.board.clock.createAlarm(done).schedule(this.busFreeAt - this.board.now);
  }

  /// Sends a packet; the promise is kept when it has crossed the bus, broken when it never will.
  send(endpoint, bytes) {
    const id = key(endpoint, true);
    const queue = this.queues.get(id) ?? [];
    this.queues.set(id, queue);
    const sent = new Promise((resolve, reject) => queue.push({ bytes, sent: resolve, lost: reject }));
    this.go(endpoint, true);
    return sent;
  }

  /// Whether packets of an OUT endpoint wait or cross.
  busy(endpoint) {
    return this.crossing.size > 0 || (this.queues.get(key(endpoint, true))?.length ?? 0) > 0;
  }

  /// Takes back the packets of an OUT endpoint that have not begun to cross.
  takeBack(endpoint) {
    for (const packet of this.queues.get(key(endpoint, true))?.splice(0) ?? []) packet.lost(new Error('taken back'));
  }

  /// Pulls the cable and plugs it in again: nothing of what was under way arrives, and the device is to be enumerated.
  replug() {
    this.toggles.clear();
    this.attached = new Promise((resolve) => { this.onReset = resolve; });
    const lost = [...this.crossing, ...[...this.queues.values()].flat()];
    this.queues.clear();
    this.crossing.clear();
    this.reading.clear();
    this.armed.clear();
    for (const packet of lost) packet.lost(new Error('the cable was pulled'));
    this.stalled?.();
    this.usb.resetDevice();
  }

  /// Sends bytes in packets of 64.
  async write(endpoint, bytes) {
    for (let at = 0; at < bytes.length; at += 64) await this.send(endpoint, bytes.subarray(at, at + 64));
  }

  /// Gives every packet of an endpoint to `take`, or, with nothing, no longer asks for any.
  read(endpoint, take) {
    this.reading.set(key(endpoint, false), take);
    if (take) this.go(endpoint, false);
  }

  /// A control transfer; `data` is what is sent, or how many bytes are wanted. `null` if it was refused. One at a time.
  transfer(setup, data) {
    const result = this.control.then(() => this.transferNow(setup, data));
    this.control = result.catch(() => {});
    return result;
  }

  control = Promise.resolve();

  async transferNow([requestType, request, value, index], data) {
    const wanted = typeof data === 'number' ? data : data.length;
    const setup = new Uint8Array([requestType, request, value & 255, value >> 8, index & 255, index >> 8, wanted & 255, wanted >> 8]);
    const refused = new Promise((resolve) => { this.stalled = () => resolve(null); });
    await new Promise((resolve) => this.onBus(packetNs(8), () => { this.usb.sendSetupPacket(setup); resolve(); }));
    const whole = async () => {
      const received = [];
      if (requestType & 0x80) {
        for (;;) {
          const packet = await this.one(0);
          received.push(...packet);
          if (packet.length < 64 || received.length >= wanted) break;
        }
        await this.send(0, new Uint8Array(0));
      } else {
        if (wanted > 0) await this.write(0, data);
        await this.one(0);
      }
      return Uint8Array.from(received);
    };
    const result = await Promise.race([whole(), refused]);
    this.stalled = null;
    if (result) this.beginAnew(requestType, request, index);
    this.takeBack(0);
    this.reading.delete(key(0, false));
    return result;
  }

  /// Requests behind which endpoints go on with DATA0: SET_CONFIGURATION, SET_INTERFACE, CLEAR_FEATURE(ENDPOINT_HALT).
  beginAnew(requestType, request, index) {
    if (requestType === 0x00 && request === 9) this.toggles.clear();
    if (requestType === 0x02 && request === 1) this.toggles.delete(key(index & 15, (index & 0x80) === 0));
    if (requestType === 0x01 && request === 11) {
      const { in: to, out: from } = this.interfaces.find(({ number }) => number === index) ?? {};
      for (const id of [key(to, false), key(from, true)]) this.toggles.delete(id);
    }
  }

  interfaces = [];

  /// Ends the halt of an endpoint, as hosts do with every transfer they give up.
  clearHalt(address) {
    return this.transfer([0x02, 1, 0, address], new Uint8Array(0));
  }

  /// The next packet of an endpoint.
  one(endpoint) {
    return new Promise((resolve) => this.read(endpoint, (packet) => { this.read(endpoint, null); resolve(packet); }));
  }

  /// What an operating system does with a new device. Gives its descriptors and where to talk to it.
  async enumerate() {
    await this.attached;
    const device = await this.transfer([0x80, 6, 0x0100, 0], 18);
    await this.transfer([0x00, 5, 9, 0], new Uint8Array(0));
    const head = await this.transfer([0x80, 6, 0x0200, 0], 9);
    const configuration = await this.transfer([0x80, 6, 0x0200, 0], head[2] | (head[3] << 8));
    const string = async (index) => {
      const bytes = await this.transfer([0x80, 6, 0x0300 | index, 0x0409], 255);
      return new TextDecoder('utf-16le').decode(bytes.subarray(2));
    };
    const names = [await string(device[14]), await string(device[15]), await string(device[16])];
    await this.transfer([0x00, 9, configuration[5], 0], new Uint8Array(0));
    this.interfaces = interfaces(configuration);
    return { device, configuration, names, interfaces: this.interfaces };
  }

  /// What a program does that opens the serial port, or closes it.
  async openSerial(number, open) {
    const rate = new Uint8Array([0x00, 0xc2, 0x01, 0x00, 0, 0, 8]); // 115200 8N1
    if (open) await this.transfer([0x21, 0x20, 0, number], rate);
    await this.transfer([0x21, 0x22, open ? 3 : 0, number], new Uint8Array(0));
  }
}

/// The interfaces in a configuration descriptor, with their endpoints.
function interfaces(bytes) {
  const found = [];
  for (let at = 0; at < bytes.length; at += bytes[at]) {
    if (bytes[at + 1] === 4) found.push({ number: bytes[at + 2], class: bytes[at + 5], in: 0, out: 0 });
    if (bytes[at + 1] === 5) found.at(-1)[bytes[at + 2] & 0x80 ? 'in' : 'out'] = bytes[at + 2] & 15;
  }
  return found;
}
