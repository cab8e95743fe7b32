// The printer at the end of the cable: its side of the handshake, and a record of every edge.
//
// Compatibility mode as in IEEE 1284: Busy rises some time after the strobe falls, then comes the work on the byte,
// then a pulse on nAck, and Busy falls with its end. Nibble mode answers a negotiation with the device ID or with
// what the printer has to say. A byte strobed before the printer is ready is lost, as on a real one.

const [DATA, STROBE, AUTO_FEED, INIT, SELECT_IN] = [2, 10, 11, 12, 13];
const LINES = { ack: 14, busy: 15, paperOut: 16, select: 17, fault: 18, power: 21 };
const ENABLE = 20;
const LOW = 0;

export class Printer {
  /// `onByte` is told every byte; then neither bytes nor edges are kept here, only what they amount to.
  constructor(board, { busyAfter = 300, work = 1000, ack = 500, id = null, negotiates = true, status = null, onByte = null, onReset = null } = {}) {
    Object.assign(this, { board, busyAfter, work, ack, id, negotiates, status, onByte, onReset });
    this.taken = [];
    this.count = 0;
    this.room = Infinity; // bytes it takes in all before it stays busy
    this.edges = [];
    this.waveform = new Waveform();
    this.resets = 0;
    this.pauses = []; // { after, line, level, ns }
    this.phase = 'forward';
    this.readyAt = 0;
    this.takenAt = -Infinity;
    this.off = false;
    this.level = {};
    this.own = { paperOut: 0, select: 1, fault: 1 };
    for (const [line, level] of Object.entries({ ack: 1, busy: 0, power: 1, ...this.own })) this.set(line, level);
    // What the cable shows before the buffers are enabled: pull-ups.
    this.out = { strobe: 1, autoFeed: 1, init: 1, selectIn: 1, data: 0xff };
    const outputs = [STROBE, AUTO_FEED, INIT, SELECT_IN, ENABLE, ...Array.from({ length: 8 }, (_, i) => DATA + i)];
    for (const pin of outputs) board.pin(pin).addListener(() => this.look());
  }

  /// Drives one of the printer's own lines.
  set(line, level) {
    if (this.level[line] === level) return;
    this.level[line] = level;
    this.note(line, level);
    this.board.pin(LINES[line]).setInputValue(level === 1);
  }

  note(line, level) {
    const edge = { at: this.board.now, line, level };
    this.waveform.look(edge);
    if (!this.onByte) this.edges.push(edge);
  }

  /// The printer's own switch. What it was at work on is gone.
  power(on) {
    this.off = !on;
    this.readyAt = on ? 0 : Infinity;
    [this.phase, this.full, this.say] = ['forward', false, []];
    for (const [line, level] of on ? [['power', 1], ['busy', 0], ['ack', 1]] : [['busy', 1], ['power', 0]]) this.set(line, level);
  }

  /// Changes status lines when a real printer would: while it is at work on a byte, or when none has come for a while,
  /// and after a conversation, which uses them for something else.
  change(lines) {
    Object.assign(this.own, lines);
    const idle = this.board.now - this.takenAt > 1_000_000;
    if (this.phase !== 'forward') return;
    if (this.readyAt === Infinity || idle) for (const [line, level] of Object.entries(this.own)) this.set(line, level);
    else this.later(1000, () => this.change({}));
  }

  later(ns, act) {
    this.board.clock.createAlarm(act).schedule(ns);
  }

  /// The host's end of the cable has changed somewhere.
  look() {
    const high = (pin) => (this.enabled && this.board.pin(pin).value === LOW ? 0 : 1);
    this.enabled = this.board.pin(ENABLE).value === LOW;
    const before = this.out;
    let data = 0;
    for (let bit = 0; bit < 8; bit++) data |= high(DATA + bit) << bit;
    this.out = { strobe: high(STROBE), autoFeed: high(AUTO_FEED), init: high(INIT), selectIn: high(SELECT_IN), data };
    for (const line of ['data', 'selectIn', 'autoFeed', 'init', 'strobe']) {
      if (before[line] === this.out[line]) continue;
      this.note(line, this.out[line]);
      this.react(line, this.out[line]);
    }
  }

  react(line, level) {
    if (line === 'init' && level === 0) {
      this.resets += 1;
      this.onReset?.();
    }
    if (line === 'strobe' && level === 0 && this.phase === 'forward') this.take();
    if (this.negotiates) this.converse(line, level);
  }

  take() {
    if (this.board.now < this.readyAt) return;
    this.count += 1;
    if (this.onByte) this.onByte(this.out.data);
    else this.taken.push(this.out.data);
    const pauses = this.pauses.filter(({ after }) => after === this.count);
    let busy = this.work;
    for (const { line, level, ns } of pauses) {
      busy = Math.max(busy, ns);
      if (line) {
        this.later(this.busyAfter, () => this.set(line, level));
        this.later(this.busyAfter + ns, () => this.set(line, 1 - level));
      }
    }
    this.readyAt = Infinity;
    this.takenAt = this.board.now;
    this.later(this.busyAfter, () => this.set('busy', 1));
    this.later(this.busyAfter + busy, () => this.finish());
    // The status question, and its answer when it is worked on.
    if (this.status && this.taken.length >= 2 && this.taken.at(-2) === 5 && this.taken.at(-1) === 1) {
      this.later(3_000_000, () => { this.say = [...this.status]; });
    }
  }

  /// Done with a byte, as soon as there is room for the next.
  finish() {
    this.full = this.count >= this.room;
    if (this.full || this.off) return;
    this.readyAt = this.board.now;
    this.set('ack', 0);
    // It may have been switched off meanwhile.
    this.later(this.ack, () => { if (!this.off) for (const [line, level] of [['ack', 1], ['busy', 0]]) this.set(line, level); });
  }

  /// Makes room for so many bytes in all.
  grant(room) {
    this.room = room;
    if (this.full) this.finish();
  }

  say = [];

  converse(line, level) {
    const answer = (lines, ack) => {
      this.later(2_000, () => Object.entries(lines).forEach(([name, value]) => this.set(name, value)));
      if (ack !== undefined) this.later(2_500, () => this.set('ack', ack));
    };
    const offer = () => {
      const none = this.reply.length ? 0 : 1;
      return { fault: none, paperOut: none, select: this.flag, busy: 0 };
    };
    if (this.phase === 'forward' && line === 'autoFeed' && level === 0 && this.out.selectIn === 1) {
      this.phase = 'negotiating';
      answer({ paperOut: 1, select: 1, fault: 1 }, 0);
    } else if (this.phase === 'negotiating' && line === 'strobe' && level === 0) {
      this.mode = this.out.data;
    } else if (this.phase === 'negotiating' && line === 'autoFeed' && level === 1 && this.mode !== undefined) {
      const known = this.mode === 0 || (this.mode === 4 && this.id !== null);
      this.reply = this.mode === 4 && known ? [...this.id] : this.mode === 0 ? this.say.splice(0) : [];
      this.flag = known && this.mode !== 0 ? 1 : 0;
      this.half = null;
      this.mode = undefined;
      this.phase = 'reverse';
      answer(offer(), 1);
    } else if (this.phase === 'reverse' && line === 'autoFeed' && level === 0) {
      if (this.half === null && this.reply.length === 0) return;
      const nibble = this.half ?? this.reply[0] & 15;
      this.half = this.half === null ? this.reply.shift() >> 4 : null;
      answer({ fault: nibble & 1, select: (nibble >> 1) & 1, paperOut: (nibble >> 2) & 1, busy: nibble >> 3 }, 0);
    } else if (this.phase === 'reverse' && line === 'autoFeed' && level === 1 && this.out.selectIn === 1) {
      answer(this.half === null ? offer() : {}, 1);
    } else if ((this.phase === 'reverse' || this.phase === 'negotiating') && line === 'selectIn' && level === 0) {
      this.phase = 'leaving';
      answer({ fault: 1, busy: 0 }, 0);
    } else if (this.phase === 'leaving' && line === 'autoFeed' && level === 0) {
      answer(this.own, 1);
    } else if (this.phase === 'leaving' && line === 'autoFeed' && level === 1 && this.level.ack === 1) {
      this.phase = 'forward';
      this.change({});
    }
  }
}

/// For so long after the printer's switch a byte may still come: the bridge saw it ready, and the data's setup cannot be
/// called back. That the next byte stays away is what counts.
const ON_ITS_WAY = 1_000;

/// The shortest of every time around the strobes, and every strobe or change of data that came when it must not.
export class Waveform {
  shortest = { setup: Infinity, strobe: Infinity, hold: Infinity, between: Infinity };
  wrong = [];
  #level = { busy: 0, paperOut: 0, select: 1, fault: 1, power: 1, selectIn: 0, data: 0 };
  #dataAt = -Infinity;
  #fallAt = null;
  #riseAt = null;
  #lastFall = null;
  #offAt = -Infinity;

  #least(name, ns) {
    this.shortest[name] = Math.min(this.shortest[name], ns);
  }

  look({ at, line, level: now }) {
    const level = this.#level;
    level[line] = now;
    if (line === 'power' && now === 0) this.#offAt = at;
    const onItsWay = at - this.#offAt < ON_ITS_WAY;
    if (line === 'selectIn' && now === 1) [this.#riseAt, this.#lastFall] = [null, null];
    if (level.selectIn === 1) return;
    if (line === 'data') {
      if (this.#fallAt !== null) this.wrong.push({ at, what: 'data changed under the strobe' });
      // Behind a printer that is off the buffers let go.
      if (level.busy && level.power && !onItsWay) this.wrong.push({ at, what: 'data changed while busy' });
      if (this.#riseAt !== null) this.#least('hold', at - this.#riseAt);
      this.#dataAt = at;
    } else if (line === 'strobe' && now === 0) {
      this.#least('setup', at - this.#dataAt);
      if (this.#lastFall !== null) this.#least('between', at - this.#lastFall);
      if ((level.busy || level.paperOut || !level.select || !level.fault || !level.power) && !onItsWay) this.wrong.push({ at, what: 'strobe while not ready', ...level });
      [this.#fallAt, this.#lastFall] = [at, at];
    } else if (line === 'strobe') {
      if (this.#fallAt !== null) this.#least('strobe', at - this.#fallAt);
      [this.#fallAt, this.#riseAt] = [null, at];
    }
  }
}

/// The same for edges that were kept.
export function waveform(edges) {
  const whole = new Waveform();
  for (const edge of edges) whole.look(edge);
  return whole;
}
