// Two boards on one clock and one cable: the bridge, and the rig in the printer's place.
//
// A board by itself lets time pass from one instruction of its processor to the next. Here what comes next on either board comes
// next: an instruction, a step of a state machine, an alarm. State machines that wait for a pin or a queue are not stepped until it has come.

const MOST_NS = 20_000;
const LOW = 0;

// Both have the same pins, inputs and outputs exchanged.
const FROM_BRIDGE = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13];
const FROM_PRINTER = [14, 15, 16, 17, 18, 21];
const ENABLE = 20;
const POWER = 21;

/// Joins the pins. A line nobody drives is held high by its pull-up, but for the printer's +5 V.
function connect(bridge, rig) {
  const join = (from, to, pins) => {
    const look = () => {
      const driven = from.pin(ENABLE).value === LOW;
      for (const pin of pins) {
        const level = driven ? from.pin(pin).value !== LOW : pin !== POWER;
        if (to.pin(pin).rawInputValue !== level) to.pin(pin).setInputValue(level);
      }
    };
    for (const pin of [...pins, ENABLE]) from.pin(pin).addListener(look);
    look();
  };
  join(bridge, rig, FROM_BRIDGE);
  join(rig, bridge, FROM_PRINTER);
  // The rig samples its own outputs, too.
  for (const pin of FROM_PRINTER) {
    const own = rig.pin(pin);
    own.addListener(() => own.setInputValue(own.value !== LOW));
  }
}

/// Makes the boards go in step: `step` of either lets both go on.
export function pair(bridge, rig) {
  connect(bridge, rig);
  const ends = [bridge, rig].map((board) => ({
    board,
    core: board.chip.core,
    // When the processor's next instruction is due.
    due: 0,
    machines: board.machines.map((one) => ({ ...one, due: null })),
  }));
  const step = () => {
    const { now } = bridge;
    let next = now + MOST_NS;
    for (const end of ends) {
      if (!end.core.waiting) next = Math.min(next, Math.max(end.due, now));
      for (const one of end.machines) {
        const { machine } = one;
        if (!machine.enabled || machine.waiting) {
          one.due = null;
          continue;
        }
        one.due ??= now;
        next = Math.min(next, one.due);
      }
      if (end.board.clock.nextAlarm) next = Math.min(next, now + end.board.clock.nanosToNextAlarm);
    }
    for (const { board } of ends) board.clock.tick(next - now);
    for (const end of ends) {
      for (const one of end.machines) {
        if (one.due !== null && one.due <= next && one.machine.enabled) end.board.stepMachine(one);
      }
      if (!end.core.waiting && end.due <= next) {
        // `instruct` may put it off further.
        end.due = next;
        end.due += end.board.instruct();
      }
    }
  };
  for (const end of ends) {
    end.board.step = step;
    // The processor stands still, and nothing else does.
    end.board.pass = (ns) => { end.due += ns; };
  }
}
