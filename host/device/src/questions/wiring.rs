//! The wiring of a bridge, tried with a loop-back plug.
//!
//! Problem: seventeen wires between a board and a plug, some of which are crossed, broken or touch each other; five of them
//! can be read. Method: the plug leads five outputs at a time to the five inputs, in three [`Plug`] positions, so that
//! every output meets an input alone and every input meets three outputs. In each position the outputs are driven all
//! high, all low, each alone low and each alone high, and the inputs are read: 26 patterns. What a fault would show is worked out
//! for every single fault there is, and those faults are named that show exactly what was seen. When none does there
//! are several at once, and the lines are named that do not do what they should.
//!
//! Cost: some 260 faults, twice, times 78 readings: milliseconds. Limits: a plug cannot tell a broken wire from one that is held high,
//! since inputs rest high; nor see the printer's +5 V, nor slow edges. Two lines that touch and are driven apart meet half way,
//! behind their resistors: whether that reads low or high is the chip's affair, so both are tried.

use std::fmt;

use protocol::link::message::{AT_REST, Lines};
use serde::Serialize;

/// A line: its name, and where it is to be found.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct Line {
    /// As in IEEE 1284, compatibility mode.
    pub name: &'static str,
    /// Pin of a DB-25 plug, as on a PC.
    pub db25: u8,
    /// Pin of the 36-pin Centronics plug.
    pub centronics: u8,
    /// GPIO of the Pico.
    pub gpio: u8,
}

impl fmt::Display for Line {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Line { name, db25, centronics, gpio } = self;
        write!(out, "{name} (GP{gpio}; pin {centronics} of the 36, {db25} of a DB-25)")
    }
}

const fn line(name: &'static str, gpio: u8, db25: u8, centronics: u8) -> Line {
    Line { name, db25, centronics, gpio }
}

/// The outputs, Data1 to Data8 first; their number is their bit in [`Levels`].
pub const OUTPUTS: [Line; 12] = [
    line("Data1", 2, 2, 2),
    line("Data2", 3, 3, 3),
    line("Data3", 4, 4, 4),
    line("Data4", 5, 5, 5),
    line("Data5", 6, 6, 6),
    line("Data6", 7, 7, 7),
    line("Data7", 8, 8, 8),
    line("Data8", 9, 9, 9),
    line("nStrobe", 10, 1, 1),
    line("nAutoFd", 11, 14, 14),
    line("nInit", 12, 16, 31),
    line("nSelectIn", 13, 17, 36),
];

/// The inputs; their number is their bit in [`Lines`].
pub const INPUTS: [Line; 5] = [
    line("nAck", 14, 10, 10),
    line("Busy", 15, 11, 11),
    line("PError", 16, 12, 12),
    line("Select", 17, 13, 13),
    line("nFault", 18, 15, 32),
];

/// Levels of the outputs, bit for bit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Levels(pub u16);

impl Levels {
    const ALL: u16 = 0xfff;
    /// nStrobe, nAutoFd and nInit high, nSelectIn low, data low.
    pub const REST: Levels = Levels((AT_REST.1 as u16) << 8 | AT_REST.0 as u16);

    /// Data1..Data8, Data1 in bit 0.
    pub fn data(self) -> u8 {
        self.0 as u8
    }

    /// nStrobe, nAutoFd, nInit, nSelectIn from bit 0.
    pub fn control(self) -> u8 {
        (self.0 >> 8) as u8
    }
}

/// A position of the loop-back plug.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
pub enum Plug {
    /// Data1 to Data5.
    First,
    /// Data6 to Data8, nStrobe, nAutoFd.
    Second,
    /// nInit, nSelectIn, Data1 to Data3.
    Third,
}

impl Plug {
    /// All of them.
    pub const ALL: [Plug; 3] = [Plug::First, Plug::Second, Plug::Third];

    /// Its number on the plug.
    pub fn number(self) -> u8 {
        match self {
            Plug::First => 1,
            Plug::Second => 2,
            Plug::Third => 3,
        }
    }

    /// The outputs at the inputs, in the order of [`INPUTS`].
    pub fn wires(self) -> [usize; 5] {
        match self {
            Plug::First => [0, 1, 2, 3, 4],
            Plug::Second => [5, 6, 7, 8, 9],
            Plug::Third => [10, 11, 0, 1, 2],
        }
    }
}

/// A fault of the wiring. Outputs and inputs by their numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// An output that has always this level at the plug.
    Output(usize, bool),
    /// An input that has always this level.
    Input(usize, bool),
    /// Each has the other's place.
    OutputsCrossed(usize, usize),
    /// Each has the other's place.
    InputsCrossed(usize, usize),
    /// They touch.
    OutputsTouch(usize, usize),
    /// They touch.
    InputsTouch(usize, usize),
    /// An output and an input that touch.
    Touch(usize, usize),
}

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        const HIGH: &str = "is always high: its wire is broken, or it is held high";
        const LOW: &str = "is always low: it touches ground, or its buffer gives nothing";
        let stuck = |high: bool| if high { HIGH } else { LOW };
        match *self {
            Fault::Output(output, high) => write!(out, "{} {}", OUTPUTS[output], stuck(high)),
            Fault::Input(input, high) => write!(out, "{} {}", INPUTS[input], stuck(high)),
            Fault::OutputsCrossed(a, b) => write!(out, "{} and {} are crossed", OUTPUTS[a], OUTPUTS[b]),
            Fault::InputsCrossed(a, b) => write!(out, "{} and {} are crossed", INPUTS[a], INPUTS[b]),
            Fault::OutputsTouch(a, b) => write!(out, "{} and {} touch", OUTPUTS[a], OUTPUTS[b]),
            Fault::InputsTouch(a, b) => write!(out, "{} and {} touch", INPUTS[a], INPUTS[b]),
            Fault::Touch(output, input) => write!(out, "{} and {} touch", OUTPUTS[output], INPUTS[input]),
        }
    }
}

/// What two lines that touch read as when one is driven high and the other low.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Contest {
    Low,
    High,
}

impl Contest {
    const BOTH: [Contest; 2] = [Contest::Low, Contest::High];
}

/// Every single fault.
fn faults() -> Vec<Fault> {
    let pairs = |count: usize| (0..count).flat_map(move |b| (0..b).map(move |a| (a, b)));
    let levels = |count: usize| (0..count).flat_map(|line| [(line, false), (line, true)]);
    let (outputs, inputs) = (OUTPUTS.len(), INPUTS.len());
    let mut faults: Vec<Fault> = levels(outputs).map(|(line, high)| Fault::Output(line, high)).collect();
    faults.extend(levels(inputs).map(|(line, high)| Fault::Input(line, high)));
    for (a, b) in pairs(outputs) {
        faults.extend([Fault::OutputsCrossed(a, b), Fault::OutputsTouch(a, b)]);
    }
    for (a, b) in pairs(inputs) {
        faults.extend([Fault::InputsCrossed(a, b), Fault::InputsTouch(a, b)]);
    }
    faults.extend((0..outputs).flat_map(|output| (0..inputs).map(move |input| Fault::Touch(output, input))));
    faults
}

/// What the inputs read through a plug, nAck in bit 0. Without one they rest high.
fn reading(fault: Option<Fault>, contest: Contest, plug: Option<Plug>, Levels(mut levels): Levels) -> u8 {
    // A thirteenth line, always high, for the inputs that nothing leads to.
    const NONE: usize = OUTPUTS.len();
    levels |= 1 << NONE;
    let wires = plug.map_or([NONE; 5], Plug::wires);
    let high = |levels: u16, line: usize| levels >> line & 1 == 1;
    let set = |levels: u16, line: usize, high: bool| levels & !(1 << line) | u16::from(high) << line;
    let both = |levels: u16, a: usize, b: usize| {
        let (a_high, b_high) = (high(levels, a), high(levels, b));
        let met = if contest == Contest::Low { a_high && b_high } else { a_high || b_high };
        set(set(levels, a, met), b, met)
    };
    match fault {
        Some(Fault::Output(line, level)) => levels = set(levels, line, level),
        Some(Fault::OutputsCrossed(a, b)) => {
            levels = set(set(levels, a, high(levels, b)), b, high(levels, a));
        }
        Some(Fault::OutputsTouch(a, b)) => levels = both(levels, a, b),
        // The input is on the wire of the output that the plug leads to it.
        Some(Fault::Touch(output, input)) if plug.is_some() => levels = both(levels, output, wires[input]),
        _ => {}
    }
    let mut inputs =
        wires.iter().rev().fold(0u16, |inputs, &wire| inputs << 1 | u16::from(high(levels, wire)));
    match fault {
        Some(Fault::Input(line, level)) => inputs = set(inputs, line, level),
        Some(Fault::InputsCrossed(a, b)) => {
            inputs = set(set(inputs, a, high(inputs, b)), b, high(inputs, a));
        }
        Some(Fault::InputsTouch(a, b)) => inputs = both(inputs, a, b),
        Some(Fault::Touch(output, input)) if plug.is_none() => {
            inputs = set(inputs, input, high(levels, output));
        }
        _ => {}
    }
    inputs as u8
}

/// The levels that are driven in a position, in order.
fn patterns() -> impl Iterator<Item = Levels> {
    let alone = (0..OUTPUTS.len()).flat_map(|line| [Levels(1 << line), Levels(Levels::ALL & !(1 << line))]);
    [Levels(Levels::ALL), Levels(0)].into_iter().chain(alone)
}

/// What was read in a position of the plug.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Seen {
    /// The position.
    pub plug: Plug,
    readings: Vec<u8>,
}

impl Seen {
    /// Whether all is as it should be.
    pub fn is_good(&self) -> bool {
        self.explained_by(None, Contest::Low)
    }

    fn explained_by(&self, fault: Option<Fault>, contest: Contest) -> bool {
        let mut readings = patterns().zip(&self.readings);
        readings.all(|(levels, &read)| reading(fault, contest, Some(self.plug), levels) == read)
    }
}

/// Which position the plug is in, found by the data lines alone, to which a printer does not listen without a strobe: so a
/// printer that is connected in place of the plug comes to no harm. `None`: no plug.
pub fn find<E>(probe: &mut dyn FnMut(Levels) -> Result<Lines, E>) -> Result<Option<Plug>, E> {
    let mut seen = Vec::new();
    for levels in data_patterns() {
        seen.push((levels, probe(levels)?.0 & 0x1f));
    }
    // How far from what was seen the likest fault is, in readings.
    let distance = |plug: Option<Plug>, fault: Option<Fault>| -> Option<u32> {
        let distance = |contest: Contest| {
            let apart =
                |&(levels, read): &(_, u8)| (reading(fault, contest, plug, levels) ^ read).count_ones();
            seen.iter().map(apart).sum()
        };
        Contest::BOTH.into_iter().map(distance).min()
    };
    let explanations: Vec<Option<Fault>> =
        std::iter::once(None).chain(faults().into_iter().map(Some)).collect();
    let likest = |plug: Option<Plug>| {
        // Of two that are as near, no fault is likelier than one.
        explanations.iter().map(|&fault| (distance(plug, fault), fault.is_some())).min()
    };
    let places = std::iter::once(None).chain(Plug::ALL.map(Some));
    Ok(places.min_by_key(|&plug| likest(plug)).flatten())
}

/// All data lines high, all low, each alone low and each alone high, the control lines at rest.
fn data_patterns() -> impl Iterator<Item = Levels> {
    let alone = (0..8).flat_map(|line| [1 << line, 0xff & !(1 << line)]);
    [0xff, 0].into_iter().chain(alone).map(|data| Levels(Levels::REST.0 & !0xff | data))
}

/// Drives every pattern and reads what comes back. Puts the lines to rest.
///
/// **Only with a plug that was [found](find)**: to a printer this is a reset and some bytes.
pub fn look<E>(plug: Plug, probe: &mut dyn FnMut(Levels) -> Result<Lines, E>) -> Result<Seen, E> {
    let mut readings = Vec::new();
    for levels in patterns() {
        readings.push(probe(levels)?.0 & 0x1f);
    }
    probe(Levels::REST)?;
    Ok(Seen { plug, readings })
}

/// What is to be said of the wiring.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// All lines that were tried do what they should.
    Good,
    /// One of these, each of which shows exactly what was seen.
    One(Vec<Fault>),
    /// No single fault shows what was seen: outputs with the inputs that follow them, and those that should.
    Several(Vec<Astray>),
}

/// An output that does not come back where it should.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Astray {
    /// The position of the plug.
    pub plug: Plug,
    /// The output.
    pub output: Line,
    /// The inputs that follow it.
    pub found: Vec<&'static str>,
    /// The one that should, if one should.
    pub expected: Option<&'static str>,
}

impl fmt::Display for Astray {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found =
            if self.found.is_empty() { "nowhere".into() } else { format!("at {}", self.found.join(" and ")) };
        let expected = self.expected.unwrap_or("nowhere");
        write!(
            out,
            "{} comes back {found}, and should at {expected} (position {})",
            self.output,
            self.plug.number()
        )
    }
}

/// Explains what was seen, in one position or in several.
pub fn judge(seen: &[Seen]) -> Verdict {
    if seen.iter().all(Seen::is_good) {
        return Verdict::Good;
    }
    let one: Vec<Fault> = faults()
        .into_iter()
        .filter(|&fault| {
            let explains = |contest| seen.iter().all(|seen| seen.explained_by(Some(fault), contest));
            Contest::BOTH.into_iter().any(explains)
        })
        .collect();
    if !one.is_empty() {
        return Verdict::One(one);
    }
    let mut astray = Vec::new();
    for Seen { plug, readings } in seen {
        let wires = plug.wires();
        // The first two readings are all high and all low; then each output alone, high and low.
        for (output, alone) in readings[2..].chunks_exact(2).enumerate() {
            let follow = |input: &usize| {
                let bit = 1 << input;
                readings[0] & bit != alone[1] & bit || readings[1] & bit != alone[0] & bit
            };
            let found: Vec<usize> = (0..INPUTS.len()).filter(follow).collect();
            let expected = wires.iter().position(|&wire| wire == output);
            if found != Vec::from_iter(expected) {
                astray.push(Astray {
                    plug: *plug,
                    output: OUTPUTS[output],
                    found: found.into_iter().map(|input| INPUTS[input].name).collect(),
                    expected: expected.map(|input| INPUTS[input].name),
                });
            }
        }
    }
    Verdict::Several(astray)
}

#[cfg(test)]
mod tests;
