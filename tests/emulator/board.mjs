// The board: an RP2040 that runs the real image, with a clock that its PIO block keeps too.
//
// rp2040js runs state machines in bursts of its own and knows neither their clock divider nor the delays in their
// instructions. Here they are stepped by the same clock as the processor, so an edge at a pin happens at the
// nanosecond it would happen on silicon, give or take the fraction of a divided clock.

import { BasePeripheral, RP2040 } from 'rp2040js';

const NS_PER_CYCLE = 8; // 125 MHz
const FLASH = 0x10000000;
const NOWHERE = 0x1f000000;
const RAM = 0x20000000;
const HARD_FAULT = 3;

// While the processor sleeps, time goes on in steps of at most this, so that what the test does is not late.
const MOST_NS = 20_000;

// The pin of the button, which a resistor in the pad holds high.
const BUTTON = 22;

// Where the boot ROM's functions are that write the flash, and what they take: some 45 ms for a sector and 0.7 for a page, as the data
// sheets of such chips have it. The processor stands still meanwhile, and everything else goes on.
const ERASE = 0x60;
const PROGRAM = 0x64;
// The others.
const LOOK_UP = 0x30;
const NOTHING = 0x48;
const MEMCPY44 = 0x50;
const NAMES = { C4: MEMCPY44, RE: ERASE, RP: PROGRAM };
const SECTOR = 4096;
const SECTOR_NS = 45_000_000;
const PAGE = 256;
const PAGE_NS = 700_000;

/// A boot ROM of a few instructions: the functions the image calls, and a table look-up that finds them. The
/// real one cannot be kept here, and nothing else of it is needed. Those that write the flash are done by [`Board.step`].
function bootRom(rom) {
  const half = (address, ...values) => {
    for (const [i, value] of values.entries()) {
      const at = address + 2 * i;
      const shift = (at & 2) * 8;
      rom[at >> 2] = ((rom[at >> 2] & ~(0xffff << shift)) | (value << shift)) >>> 0;
    }
  };
  half(0x14, 0x0001); // the table: never looked into
  half(0x18, LOOK_UP | 1); // the look-up
  // r1 is the function's name; `Board.step` puts the function of this name into r0.
  half(LOOK_UP, 0x4770); //                  bx lr
  half(NOTHING, 0x4770); //                  bx lr
  half(ERASE, 0x4770); //                    bx lr
  half(PROGRAM, 0x4770); //                  bx lr
  half(MEMCPY44, 0x3a04, 0x588b, 0x5083, 0xd1fb, 0x4770); // subs r2, #4; ldr r3, [r1, r2]; str r3, [r0, r2]; bne; bx lr
}

/// A peripheral whose registers are all zero.
class Quiet extends BasePeripheral {
  readUint32() { return 0; }
  writeUint32() {}
}

/// Puts a UF2 image into the flash.
function load(chip, image) {
  const view = new DataView(image.buffer, image.byteOffset, image.byteLength);
  for (let at = 0; at < image.length; at += 512) {
    if (view.getUint32(at, true) !== 0x0a324655) throw new Error(`block ${at / 512} is no UF2`);
    const address = view.getUint32(at + 12, true);
    const length = view.getUint32(at + 16, true);
    chip.flash.set(image.subarray(at + 32, at + 32 + length), address - FLASH);
  }
}

export class Board {
  constructor(image) {
    this.chip = new RP2040();
    this.clock = this.chip.clock;
    this.chip.logger = {
      debug() {},
      // rp2040js only reports this instruction. Without its effect a task that wakes itself sleeps on.
      info: (part, text) => { if (text === 'SEV') this.chip.core.eventRegistered = true; },
      warn() {},
      error: (part, text) => this.complaints.push(`${part}: ${text}`),
    };
    this.complaints = [];
    bootRom(this.chip.bootrom);
    load(this.chip, image);
    // The cache's controller is not modelled; its stream of nothing is at its end.
    this.chip.peripherals[0x14000] = new Quiet(this.chip, 'XIP_CTRL');
    // As the boot ROM leaves it.
    this.chip.core.SP = 0x20041f00;
    this.chip.core.LR = 0;
    this.chip.core.PC = FLASH;
    // While awake.
    this.instructions = 0;
    this.cycles = 0;
    this.erased = 0;
    this.pin(BUTTON).setInputValue(true);
    // A pin that was never told reads low; the lines of a printer are told by the printer.
    this.machines = [];
    for (const pio of this.chip.pio) {
      pio.run = () => {};
      for (const machine of pio.machines) {
        // A fresh machine has an empty output register (rp2040js begins with a full one).
        machine.outputShiftCount = 32;
        // A change of how the FIFOs are joined empties them.
        const write = machine.writeUint32.bind(machine);
        machine.writeUint32 = (offset, value) => {
          const before = machine.shiftCtrl;
          write(offset, value);
          if ((before ^ machine.shiftCtrl) >>> 30 === 0) return;
          machine.txFIFO.reset();
          machine.rxFIFO.reset();
          machine.updateDMATx();
          machine.updateDMARx();
        };
        this.machines.push({ pio, machine, due: 0, idle: 0 });
      }
    }
    // There is no memory below the first byte, and an access there is a bus error; rp2040js only reports it.
    for (const access of ['writeUint32', 'writeUint16', 'writeUint8', 'readUint32', 'readUint16', 'readUint8']) {
      const act = this.chip[access].bind(this.chip);
      this.chip[access] = (address, value) => {
        if (address >>> 0 >= NOWHERE && address >>> 0 < RAM) {
          this.busError = true;
          return 0;
        }
        return act(address, value);
      };
    }
    this.watchdogBites = 0;
    this.chip.peripherals[0x40058].onWatchdogTrigger = () => { this.watchdogBites += 1; };
  }

  get now() {
    return this.clock.nanos;
  }

  pin(number) {
    return this.chip.gpio[number];
  }

  /// Runs until `done()` or, at the latest, for `limitNs` of the board's time. Promises go on in between.
  async run(done, limitNs) {
    const end = this.now + limitNs;
    while (!done()) {
      if (this.now >= end) return false;
      for (let i = 0; i < 400 && this.now < end; i++) this.step();
      // Not only promises but timers and sockets of the test, now and then.
      await ((this.turns = (this.turns + 1) | 0) % 64 === 0 ? new Promise(setImmediate) : null);
    }
    return true;
  }

  turns = 0;

  step() {
    const { chip, clock } = this;
    if (chip.core.waiting) {
      const alarm = clock.nextAlarm ? clock.nanosToNextAlarm : MOST_NS;
      this.pass(Math.min(Math.max(alarm, NS_PER_CYCLE), MOST_NS));
    } else {
      this.instructions += 1;
      const before = chip.core.PC;
      if (before < 0x80) this.rom(before);
      const cycles = chip.core.executeInstruction();
      if (this.busError) {
        this.busError = false;
        // The registers are as far as the instruction came, which a real processor takes back.
        chip.core.PC = before;
        this.fault();
      }
      this.cycles += cycles;
      this.pass(cycles * NS_PER_CYCLE);
    }
  }

  /// What the boot ROM's functions do beside returning.
  rom(at) {
    const { registers } = this.chip.core;
    const offset = registers[0];
    if (at === LOOK_UP) {
      const name = String.fromCharCode(registers[1] & 255, (registers[1] >> 8) & 255);
      registers[0] = (NAMES[name] ?? NOTHING) | 1;
    } else if (at === ERASE) {
      for (let sector = offset; sector < offset + registers[1]; sector += SECTOR) {
        this.flashOperation(SECTOR_NS, (part) => this.chip.flash.fill(0xff, sector, sector + SECTOR * part));
        this.erased += 1;
      }
    } else if (at === PROGRAM) {
      const [from, count] = [registers[1], registers[2]];
      for (let page = 0; page < count; page += PAGE) {
        this.flashOperation(PAGE_NS, (part) => {
          for (let i = page; i < page + PAGE * part; i++) this.chip.flash[offset + i] &= this.chip.readUint8(from + i);
        });
      }
    }
  }

  /// How many operations of the flash are left before the supply goes, in the middle of the next one.
  cutAfter = Infinity;
  off = false;

  flashOperation(ns, act) {
    if (this.off) return;
    if (this.cutAfter-- <= 0) {
      this.off = true;
      act(0.5);
      // Nothing of the board goes on.
      this.step = () => this.pass(MOST_NS);
      return;
    }
    act(1);
    this.pass(ns);
  }

  /// Presses the button for so long, and lets go.
  async press(ms) {
    this.pin(BUTTON).setInputValue(false);
    await this.run(() => false, ms * 1_000_000);
    this.pin(BUTTON).setInputValue(true);
    await this.run(() => false, 150_000_000);
  }

  /// The processor takes the exception of a fault, as after an instruction that does not exist. One in its own handler locks it up.
  fault() {
    const { core } = this.chip;
    if (core.IPSR === HARD_FAULT) core.executeInstruction = () => 1;
    else core.exceptionEntry(HARD_FAULT);
    this.busError = false;
  }

  /// Time passes for everything but the processor.
  pass(ns) {
    const end = this.now + ns;
    for (;;) {
      let next = null;
      for (const one of this.machines) {
        const { machine } = one;
        if (!machine.enabled) {
          one.due = 0;
          continue;
        }
        if (one.due === 0) one.due = this.now;
        if (one.due < end && (next === null || one.due < next.due)) next = one;
      }
      if (next === null) break;
      if (next.due > this.now) this.clock.tick(next.due - this.now);
      // An alarm may have switched it off.
      if (next.machine.enabled) this.stepMachine(next);
    }
    if (end > this.now) this.clock.tick(end - this.now);
    // The processor may wake by what happened before its time is up; it then is at most 20 µs late.
  }

  stepMachine(one) {
    const { pio, machine } = one;
    const before = machine.cycles;
    machine.step();
    pio.checkChangedPins();
    // `cycles` grows by one for an instruction and by its delay; by nothing while it waits.
    const ticks = Math.max(1, machine.cycles - before);
    const divider = (machine.clockDivInt || 65536) + machine.clockDivFrac / 256;
    one.due += ticks * divider * NS_PER_CYCLE;
  }
}
