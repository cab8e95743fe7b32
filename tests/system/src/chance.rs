//! What happens when: drawn from a seed, or read from a script.
//!
//! Problem: a failure after a hundred thousand steps helps nobody unless it can be had again, and with less around it. Method: every
//! occasion at which something may happen has a [`Key`] (the step, a count within it, the kind). Whether it happens there is a
//! function of seed and key, and so is everything about it. So a run that is told the keys of another one does the same, and
//! without some of them it is a run in which only these have not happened. Rates are drawn once for each seed, many of them zero:
//! faults that hide each other are then apart in some seeds (swarm testing, Groce and others, 2012).

use std::collections::BTreeSet;

/// What can happen.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Kind {
    /// A user does something.
    Act,
    /// The other user does something while the first one waits.
    ActToo,
    /// An operating system prints through the plain printer interface.
    Plain,
    /// Somebody presses the button.
    Press,
    /// A user asks for the sheet's end.
    Cancel,
    /// A user leaves (Ctrl-C).
    Leave,
    /// The printer takes half of the next question.
    HalfAsked,
    /// A burst on the link is lost.
    Lose,
    /// It comes twice.
    Double,
    /// A bit of it is another.
    Flip,
    /// It comes late.
    Late,
    /// The data lines of the cable are pulled for a while; the board keeps its supply.
    Unplug,
    /// A process is killed.
    Kill,
    /// The board restarts by its watchdog.
    Watchdog,
    /// Somebody presses RUN.
    Run,
    /// The board loses its supply.
    Cut,
    /// The printer is switched off and on again, or its cable is pulled and put back.
    SwitchOff,
    /// The printer is out of paper for a while.
    PaperOut,
    /// A bit of the flash changes.
    Age,
}

/// How often, of a million occasions, when nothing is drawn.
const RATES: [(Kind, u32); 19] = [
    (Kind::Act, 30_000),
    (Kind::ActToo, 2_000),
    (Kind::Plain, 3_000),
    (Kind::Press, 900),
    (Kind::Cancel, 2_000),
    (Kind::Leave, 300),
    (Kind::HalfAsked, 600),
    (Kind::Lose, 15_000),
    (Kind::Double, 10_000),
    (Kind::Flip, 10_000),
    (Kind::Late, 10_000),
    (Kind::Unplug, 400),
    (Kind::Kill, 400),
    (Kind::Watchdog, 400),
    (Kind::Run, 700),
    (Kind::Cut, 700),
    (Kind::SwitchOff, 1_200),
    (Kind::PaperOut, 400),
    (Kind::Age, 300),
];

/// An occasion.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Key {
    /// The step.
    pub step: u64,
    turn: u32,
    /// What may happen.
    pub kind: Kind,
}

/// Numbers that belong to an occasion.
#[derive(Clone, Copy, Debug)]
pub struct Draw(u64);

impl Draw {
    /// The numbers of this seed.
    pub fn new(seed: u64) -> Draw {
        Draw(seed)
    }

    /// The next number (splitmix64).
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// The next number below this, 0 if there is none.
    pub fn below(&mut self, end: usize) -> usize {
        if end == 0 { 0 } else { (self.number() % end as u64) as usize }
    }

    /// Whether something of this probability, in 1000, is the case.
    pub fn one_in_1000(&mut self, rate: u32) -> bool {
        self.number() % 1000 < u64::from(rate)
    }
}

/// Decides what happens.
pub struct Chance {
    seed: u64,
    rates: [u32; RATES.len()],
    script: Option<BTreeSet<Key>>,
    happened: Vec<Key>,
    step: u64,
    turn: u32,
    calm: bool,
}

impl Chance {
    /// With a script only what it says happens; with none, what the seed has drawn.
    pub fn new(seed: u64, script: Option<BTreeSet<Key>>) -> Chance {
        let mut draw = Draw::new(seed ^ 0x5eed);
        let rates = RATES.map(|(kind, rate)| match kind {
            Kind::Act => rate,
            _ => rate * [0, 0, 0, 1, 1, 4][draw.below(6)],
        });
        Chance { seed, rates, script, happened: Vec::new(), step: 0, turn: 0, calm: false }
    }

    /// A step begins.
    pub fn begin(&mut self, step: u64) {
        (self.step, self.turn) = (step, 0);
    }

    /// From now on nothing happens any more.
    pub fn calm(&mut self) {
        self.calm = true;
    }

    /// What has happened until now.
    pub fn happened(&self) -> &[Key] {
        &self.happened
    }

    /// Whether this happens on this occasion, and the numbers that belong to it.
    pub fn happens(&mut self, kind: Kind) -> Option<Draw> {
        if self.calm {
            return None;
        }
        self.turn += 1;
        let key = Key { step: self.step, turn: self.turn, kind };
        let mut draw = Draw::new(
            self.seed
                ^ key.step.wrapping_mul(0x1_0000_01b3)
                ^ u64::from(key.turn) << 48
                ^ (kind as u64) << 40,
        );
        let number = draw.number() % 1_000_000;
        let happens = match &self.script {
            Some(script) => script.contains(&key),
            None => number < u64::from(self.rates[kind as usize]),
        };
        happens.then(|| {
            self.happened.push(key);
            draw
        })
    }
}
