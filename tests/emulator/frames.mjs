// Frames and messages, written anew from docs/wire-format.md: the firmware is not tested with its own code.

/// Bytes of a frame: COBS(message ‖ CRC-32) ‖ 00.
export function frame(message) {
  const sum = crc(message);
  const body = [...message, sum & 255, (sum >>> 8) & 255, (sum >>> 16) & 255, sum >>> 24];
  const out = [];
  let block = [];
  const close = () => { out.push(block.length + 1, ...block); block = []; };
  for (const byte of body) {
    if (byte === 0) close();
    else {
      block.push(byte);
      if (block.length === 254) close();
    }
  }
  close();
  return Uint8Array.from([...out, 0]);
}

/// Finds frames in packets; gives the messages of the undamaged ones and counts the others.
export class Frames {
  pending = [];
  damaged = 0;

  *feed(packet) {
    for (const byte of packet) {
      if (byte !== 0) {
        this.pending.push(byte);
        continue;
      }
      const message = this.pending.length ? open(this.pending) : undefined;
      this.pending = [];
      if (message === null) this.damaged += 1;
      else if (message) yield message;
    }
  }
}

function open(coded) {
  const body = [];
  for (let at = 0; at < coded.length; ) {
    const code = coded[at];
    if (at + code > coded.length) return null;
    body.push(...coded.slice(at + 1, at + code));
    at += code;
    if (code !== 255 && at < coded.length) body.push(0);
  }
  if (body.length < 5) return null;
  const message = body.slice(0, -4);
  const [a, b, c, d] = body.slice(-4);
  return crc(message) === (a | (b << 8) | (c << 16) | (d << 24)) >>> 0 ? message : null;
}

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let i = 0; i < 8; i++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  return value;
});

function crc(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) value = (value >>> 8) ^ TABLE[(value ^ byte) & 255];
  return ~value >>> 0;
}

const varint = (value) => {
  const out = [];
  for (; value >= 0x80; value = Math.floor(value / 128)) out.push((value % 128) | 0x80);
  return [...out, value];
};

export const hello = () => frame([0, 3, ...varint(0)]);
/// A Hello of another version, with anything behind its version.
export const helloOf = (version, rest) => frame([0, version, ...rest]);
export const begin = (job, kind, length) => frame([1, ...varint(job), kind, ...varint(length)]);
export const data = (job, offset, bytes) => frame([2, ...varint(job), ...varint(offset), ...varint(bytes.length), ...bytes]);
export const cancel = (job) => frame([3, ...varint(job)]);
export const ask = (request, what) => frame([4, ...varint(request), what]);
export const configure = ({ setup, strobe, hold, settle, handshake = 0, patience = 600, heed = 0x3f }) =>
  frame([5, ...[setup, strobe, hold, settle].flatMap(varint), handshake, ...varint(patience), heed]);
export const initialise = (request = 0) => frame([6, ...varint(request)]);
export const drive = (level, lines) => frame([8, level, lines]);
export const probe = (request, level, lines) => frame([9, ...varint(request), level, lines]);
export const abandon = (job) => frame([11, ...varint(job)]);
export const readLog = (request, from) => frame([10, ...varint(request), ...varint(from)]);

export const store = (job, kind, length, name) =>
  frame([12, ...varint(job), kind, ...varint(length), name.length, ...new TextEncoder().encode(name)]);
export const listStored = (request, index) => frame([13, ...varint(request), index]);
export const printStored = (job, stored) => frame([14, ...varint(job), ...varint(stored)]);
export const deleteStored = (request, stored) => frame([15, ...varint(request), ...varint(stored)]);

const STATES = ['none', 'printing', 'stopped', 'cancelling', 'done', 'cancelled', 'broken', 'lost', 'storing', 'stored'];
const FAULTS = ['paper out', 'off line', 'error', 'power off', 'busy too long', 'no ack', 'held'];

/// A message of the bridge.
export function parse(message) {
  let at = 0;
  const byte = () => message[at++];
  const number = () => {
    let [value, scale] = [0, 1];
    for (;;) {
      const next = byte();
      value += (next & 127) * scale;
      if (next < 128) return value;
      scale *= 128;
    }
  };
  const bytes = () => {
    const length = number();
    return Uint8Array.from(message.slice(at, (at += length)));
  };
  const fault = () => FAULTS[byte()];
  switch (byte()) {
    case 0:
      return { kind: 'hello', version: byte(), schema: number(), boot: number(), serial: number(), firmware: new TextDecoder().decode(bytes()) };
    case 1: {
      const [job, state] = [number(), STATES[byte()]];
      const detail = state === 'stopped' ? fault() : state === 'broken' ? [number(), byte()] : undefined;
      return { kind: 'progress', job, state, detail, accepted: number(), limit: number(), printed: number(), pass: byte(), row: number() };
    }
    case 2:
      return { kind: 'lines', request: number(), lines: byte(), fault: byte() ? fault() : null };
    case 3: {
      const [request, which] = [number(), byte()];
      return { kind: 'answer', request, answer: which === 0 ? bytes() : ['', 'not now', 'one-way', 'silent', 'stopped', 'unsure'][which] };
    }
    case 4:
      return { kind: 'refused', reason: byte(), job: number() };
    case 6:
      return { kind: 'log', request: number(), from: number(), end: number(), bytes: bytes() };
    case 7: {
      const jobs = Array.from({ length: 16 }, () => {
        const [job, state] = [number(), STATES[byte()]];
        const detail = state === 'stopped' ? fault() : state === 'broken' ? [number(), byte()] : undefined;
        return { job, state, detail, printed: number() };
      });
      return { kind: 'past', jobs: jobs.filter(({ job }) => job !== 0) };
    }
    case 8:
      return { kind: 'board', request: number(), fixed: number(), stack: number(), used: number(), longest: number() };
    case 9: {
      const [request, count, room, total] = [number(), byte(), number(), number()];
      const job = byte()
        ? { job: number(), kind: byte(), length: number(), name: new TextDecoder().decode(bytes()) }
        : null;
      return { kind: 'stored', request, count, room, total, job };
    }
    case 10:
      return { kind: 'standing', standing: ['unknown', 'at rest', 'in a sheet'][byte()], job: number() };
    default:
      return { kind: 'other' };
  }
}
