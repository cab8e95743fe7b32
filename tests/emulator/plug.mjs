// A loop-back plug in the printer's place: five outputs lead to the five inputs (docs/wiring.md).

const OUTPUTS = Object.fromEntries([...Array.from({ length: 8 }, (_, i) => [`data${i + 1}`, 2 + i]), ['strobe', 10], ['autoFeed', 11], ['init', 12], ['selectIn', 13]]);
const INPUTS = [14, 15, 16, 17, 18]; // nAck, Busy, PError, Select, nFault
const ENABLE = 20;
const POWER = 21;
const LOW = 0;

/// The outputs in each position of the plug, in the order of the inputs.
export const POSITIONS = {
  1: ['data1', 'data2', 'data3', 'data4', 'data5'],
  2: ['data6', 'data7', 'data8', 'strobe', 'autoFeed'],
  3: ['init', 'selectIn', 'data1', 'data2', 'data3'],
};

export class Plug {
  /// `alter` gives the wiring a fault: it may change the levels of the outputs, by name, before they come back.
  constructor(board, alter = () => {}) {
    Object.assign(this, { board, alter, wires: null });
    board.pin(POWER).setInputValue(false);
    for (const pin of [...Object.values(OUTPUTS), ENABLE]) board.pin(pin).addListener(() => this.look());
    this.move(null);
  }

  /// Puts it in a position, or takes it off.
  move(position) {
    this.wires = POSITIONS[position] ?? null;
    this.look();
  }

  look() {
    const enabled = this.board.pin(ENABLE).value === LOW;
    const levels = Object.fromEntries(Object.entries(OUTPUTS).map(([name, pin]) => [name, !enabled || this.board.pin(pin).value !== LOW]));
    this.alter(levels);
    INPUTS.forEach((pin, i) => this.board.pin(pin).setInputValue(this.wires ? levels[this.wires[i]] : true));
  }
}
